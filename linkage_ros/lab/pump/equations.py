# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The equations of motion of a wind pump for arrays of phases, which need not all be reachable.

The force of a load curve with a return_value jumps where the slider reverses. A Fourier series
cannot represent this jump, so the force is smoothed: between slider speeds of -width and width, it
changes from one curve to the other as a cubic polynomial of the speed.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, cast

import numpy as np

from linkage_ros.dynamics.equations import (
    Model,
    accelerations,
    balance,
    mass_matrix,
    velocities,
)
from linkage_ros.dynamics.program import Program
from linkage_ros.dynamics.solver import Solver
from linkage_ros.dynamics.tape import Constants
from linkage_ros.formulas import Opaque, cos, sqrt, where
from linkage_ros.model.kinematics import LinkPose, State
from linkage_ros.model.load_curve import CurveForce, LoadCurve
from linkage_ros.model.parts import CROSSED, OPEN
from linkage_ros.model.structure import Description, Mechanism
from linkage_ros.model.wind_pump import ByCoupler, WindPump, WindPumpLoop
from linkage_ros.numeric import Array, Real

BOTH = 'both'  # the assembly of a motion that stretches the dyad
_EDGE = 1e-9  # relative, of the square of the dyad's length
_LARGEST = 1e9  # angles, rad
_WIDTH = 0.03  # relative to crank length x the motor's largest speed


class PumpSolver(Solver):
    """A solver with equations of motion for arrays; they check nothing, to be fast.

    The first coordinate is the crank angle, the second the slider position or the coupler angle.
    """

    @classmethod
    def of(cls, mechanism: WindPump) -> PumpSolver:
        """Returns the solver in the coordinates that describe most motions.

        Crank and coupler angle describe every motion if the rod is longer than crank and coupler
        together. If not, the coordinates are crank angle and slider position.
        """
        if mechanism.crank.length + mechanism.coupler.length >= mechanism.rod.length:
            return cls(mechanism)
        side = OPEN if mechanism.slider.position > 0 else CROSSED
        return cls(mechanism, description=Description(mechanism.other_coordinates, side))

    @property
    def by_coupler(self) -> bool:
        """Whether the second coordinate is the coupler angle, not the slider position."""
        return self.description.coordinates != self.mechanism.coordinates

    @property
    def unit(self) -> float:
        """Unit of the second coordinate, m or rad: as large as the crank makes its range."""
        pump = cast('WindPump', self.mechanism)
        return pump.crank.length / (pump.coupler.length if self.by_coupler else 1.0)

    def converted(self, phases: Array) -> Array:
        """Converts phases to the coordinates of this solver.

        Args:
            phases: Crank angle, slider position and their rates, of shape (4, n), in the assembly
                of the mechanism.

        Returns:
            Both coordinates and their rates, of shape (4, n).

        Raises:
            UnreachableError: The dyad cannot close.
        """
        if not self.by_coupler:
            return phases
        state = Solver(self.mechanism).state(tuple(phases[:2]), tuple(phases[2:]))
        return np.array([row[link] for row in (state.position, state.velocity) for link in (0, 1)])

    @functools.cached_property
    def _terms(self) -> Callable[..., tuple[Array, ...]]:
        pump = cast('WindPump', self.mechanism)
        b, c = pump.coupler.length, pump.rod.length
        limits = (b - c) ** 2 + _EDGE * (b + c) ** 2, (b + c) ** 2 * (1 - _EDGE)
        model = Model.of(pump, self.structure, pump.loop_of(self.description))
        constants = Constants((model, limits))
        program = Program(_terms, constants, ('q0', 'q1', 'u0', 'u1'))
        return program.code(frozenset(program.names)).bound(constants.numbers)

    def terms(self, *phases: Array) -> list[Array]:
        """Computes the terms of the equations of motion M q'' + h = torque on the crank.

        Args:
            phases: Crank angles, rad, slider positions, m, and their rates. For a solver in the
                other coordinates, crank and coupler angles and their rates.

        Returns:
            M11, M12, M22, h1 and h2; h2 is NaN where the dyad cannot close.
        """
        with np.errstate(all='ignore'):
            *found, h2, inside = self._terms(*phases)
        return [*found, np.where(inside > 0, h2, np.nan)]

    def slopes(self, torque: Real, *phases: Array) -> Array:
        """Computes the rates and accelerations of both coordinates.

        Args:
            torque: Torque on the crank, N m.
            phases: The arguments of `terms`, in arrays of one shape.

        Returns:
            Two rates and two accelerations, of shape (4, ...); the accelerations are nan where the
            dyad cannot close.
        """
        m11, m12, m22, h1, h2 = self.terms(*phases)
        push, whole = torque - h1, m11 * m22 - m12 * m12
        spin, change = (m22 * push + m12 * h2) / whole, -(m12 * push + m11 * h2) / whole
        return np.array((*phases[2:], spin, change))


def assembly(state: State) -> str:
    """Returns the assembly of a pump in states of a motion: open, crossed, or both in turn."""
    _, coupler, rod, *_ = state.position
    is_open = np.sin(coupler - rod) > 0
    return OPEN if is_open.all() else BOTH if is_open.any() else CROSSED


def _terms(constants: tuple[Any, ...], *phase: Real) -> tuple[Real, ...]:
    """Computes M11, M12, M22, h1, h2, and a number that is positive if the dyad can close."""
    model, limits = constants
    q, u = phase[:2], phase[2:]
    inside, reached = _reach(model.loop, limits, *q)
    # If the dyad cannot close, the terms are computed at other coordinates.
    pose = model.loop.pose(
        tuple(where(inside > 0, *both) for both in zip(q, reached, strict=True))
    )
    (m11, m12), (_, m22) = mass_matrix(model, pose)
    held = balance(model, pose, velocities(pose, u), accelerations(pose, u, ()))
    return m11, m12, m22, *held, inside


def _reach(
    loop: WindPumpLoop, limits: tuple[Real, Real], angle: Real, other: Real
) -> tuple[Real, tuple[Real, Real]]:
    """Returns a number that is positive where the dyad can close, and coordinates at which it can.

    In crank and coupler angle, the dyad closes at all finite angles: the coordinates are used only
    if the rod is longer than crank and coupler together.
    """
    if isinstance(loop, ByCoupler):
        return _LARGEST - abs(angle) - abs(other), (0.0, 0.0)
    r, (low, high) = loop.crank, limits
    square = other * other - 2 * r * other * cos(angle) + r * r
    return (square - low) * (high - square), (0.0, r + sqrt(0.5 * (low + high)))


class _SmoothForce(NamedTuple):
    curve: CurveForce
    back: Opaque
    width: float

    def forces(self, links: Sequence[LinkPose], rates: Sequence[Real]) -> dict[int, Real]:
        """See `Load`."""
        place, rate = links[self.curve.link].position, rates[self.curve.link] / self.width
        share = where(rate > 1, 1.0, where(rate < -1, -1.0, 0.5 * rate * (3 - rate * rate)))
        ends = self.curve.value(place), self.back(place)
        return {self.curve.link: 0.5 * (ends[0] + ends[1] + share * (ends[0] - ends[1]))}


@dataclass(frozen=True)
class SmoothLoad(LoadCurve):
    """A load curve with a return_value, smoothed where the slider reverses.

    Attributes:
        width: Slider speed below which the force is between the two curves, m/s.
    """

    width: float = 0.0

    def on(self, mechanism: Mechanism) -> Any:
        """See `LoadCurve`."""
        force = super().on(mechanism)
        return _SmoothForce(force, force.return_value or force.value, self.width)


def smoothed(mechanism: WindPump, pace: float) -> WindPump:
    """Replaces the load curves of a pump whose force jumps where the slider reverses.

    Args:
        mechanism: Description of the pump.
        pace: Largest crank speed, rad/s, to which the width of the transition is proportional.

    Returns:
        The pump with smooth loads; the given pump if none of its loads jumps.
    """
    width = _WIDTH * mechanism.crank.length * pace
    loads = tuple(
        SmoothLoad(load.link, load.over, load.at, load.value, load.return_value, width=width)
        if isinstance(load, LoadCurve) and load.return_value
        else load
        for load in mechanism.loads
    )
    return mechanism if loads == mechanism.loads else replace(mechanism, loads=loads)
