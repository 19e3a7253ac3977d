# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The equations of motion of a wind pump in the angles of its links, for arrays of phases.

Crank angle and slider position do not determine a motion where coupler and rod are in line, and
crank and coupler angle do not where the rod is perpendicular to the guide. The angles of all three
links determine both. They satisfy

    G = l1 sin phi1 + l2 sin phi2 + l3 sin phi3 = 0.

The velocities are phi1' for the crank and s' for the dyad. With n2 = l2 cos phi2,
n3 = l3 cos phi3 and N^2 = n2^2 + n3^2,

    phi2' = -(n2 / N^2) l1 cos phi1 phi1' - (n3 / N) s'
    phi3' = -(n3 / N^2) l1 cos phi1 phi1' + (n2 / N) s',

so that G' = 0. N is 0 only where coupler and rod are both perpendicular to the guide.
"""

import math
import operator
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, TypeAlias, cast

import numpy as np

from linkage_ros.dynamics.equations import (
    Model,
    accelerations,
    balance,
    driven_state,
    forward,
    velocities,
)
from linkage_ros.dynamics.program import Program
from linkage_ros.dynamics.solver import Solver
from linkage_ros.dynamics.tape import Constants
from linkage_ros.formulas import ZERO, Vector, sqrt, total, where
from linkage_ros.model.kinematics import LinkPose, Pose, State
from linkage_ros.model.load_curve import LoadCurve
from linkage_ros.model.parts import CROSSED, OPEN
from linkage_ros.model.structure import Mechanism
from linkage_ros.model.wind_pump import WindPump
from linkage_ros.numeric import Array, Real

BOTH = 'both'  # the assembly of a motion that stretches the dyad
_WIDTH = 0.03  # width of a smoothed load jump, relative to crank length x largest speed


class ByAngles(NamedTuple):
    """The kinematic constants of a wind pump that is described by the angles of its links.

    Attributes:
        crank: Length of the crank, m.
        coupler: Length of the coupler, m.
        rod: Length of the rod, m.
    """

    crank: float
    coupler: float
    rod: float

    def pose(self, q: tuple[Real, ...]) -> Pose:
        """Computes the pose at the angles of crank, coupler and rod, rad.

        Its derivatives belong to the velocities of crank and dyad.
        """
        sides = [Vector.at(angle) for angle in q]
        crank, *arms = (side * length for side, length in zip(sides, self, strict=True))
        coupler, rod = arms
        size = sqrt(coupler.x * coupler.x + rod.x * rod.x)
        normal, lever = Vector(coupler.x / size, rod.x / size), crank.x / size
        pairs = list(zip(normal, normal.left(), strict=True))
        slopes = [(-lever * along, across) for along, across in pairs]
        # G'' = 0 gives (phi2'', phi3'') along the normal, the rotation of the normal the rest.
        low, mixed, high = (
            total(arm.y * (one[i] * one[j]) for arm, one in zip(arms, pairs, strict=True))
            for i, j in ((0, 0), (0, 1), (1, 1))
        )
        bend = crank.y + lever * lever * low, -2 * lever * mixed, high
        turn = -lever * lever * mixed, lever * high, ZERO
        bends = [
            tuple((along * x + across * y) / size for x, y in zip(bend, turn, strict=True))
            for along, across in pairs
        ]
        slide = [-crank.y, ZERO]
        slide_bends = [-crank.x, ZERO, ZERO]
        for arm, (one, other), changes in zip(arms, slopes, bends, strict=True):
            squares = one * one, 2 * one * other, other * other
            slide = [slide[0] - arm.y * one, slide[1] - arm.y * other]
            slide_bends = [
                x - arm.x * square - arm.y * change
                for x, square, change in zip(slide_bends, squares, changes, strict=True)
            ]
        all_slopes, all_bends = ((1.0, ZERO), *slopes), ((ZERO, ZERO, ZERO), *bends)
        turning = map(LinkPose, q, sides, all_slopes, all_bends)
        place = crank.x + coupler.x + rod.x
        slider = LinkPose(place, Vector(1.0, ZERO), tuple(slide), tuple(slide_bends))
        return Pose((*turning, slider), ())

    def closure(self, q: tuple[Real, ...]) -> Real:
        """Computes G, m, at the angles of crank, coupler and rod, rad."""
        return total(Vector.at(angle).y * size for angle, size in zip(q, self, strict=True))


class PumpSolver(Solver):
    """A solver with fast, unchecked equations of motion for arrays of phases.

    A phase holds the crank angle, the positions of the `places`, and the velocities of crank and
    dyad. If the slider is the only place, its velocity replaces the dyad's.

    Attributes:
        by_slider: Whether the slider replaces coupler and rod.
        places: Numbers of the links, other than the crank, whose positions describe the motion.
        units: Units of the places and of the last velocity, rad or m and per second: their typical
            sizes at a crank speed of 1 rad/s.
    """

    def __init__(self, mechanism: WindPump, by_slider: bool = False) -> None:
        """Prepares the equations; see the attributes for the parameters."""
        super().__init__(mechanism)
        r, b, c = mechanism.crank.length, mechanism.coupler.length, mechanism.rod.length
        self._by_angles = ByAngles(r, b, c)
        self.by_slider, self.places = by_slider, (3,) if by_slider else (1, 2)
        self.units = np.array((r, r) if by_slider else (r / b, r / c, math.hypot(r / b, r / c)))
        loop = mechanism.loop() if by_slider else self._by_angles
        self._model = Constants((Model.of(mechanism, self.structure, loop), self.places))
        q, rates, changes = (
            tuple(f'{letter}{i}' for i in (0, *self.places)) for letter in ('q', 'rate', 'change')
        )
        driven = q, ('u0', 'u1'), 'torque'
        self._arguments: dict[Any, tuple[Any, ...]] = {
            _slopes: driven, _motion: driven, _residuals: (q, rates, changes),
        }  # fmt: skip
        self._compiled_for_arrays: dict[Callable[..., Any], Callable[..., Any]] = {}

    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]:
        return type(self), (self.mechanism, self.by_slider)

    def converted(self, phases: Array) -> Array:
        """Converts phases from crank angle, slider position and their rates.

        Args:
            phases: Phases in the assembly of the mechanism, of shape (4, n).

        Returns:
            The phases for this solver, of shape (k, n).

        Raises:
            UnreachableError: The dyad cannot close.
        """
        state = self.state(tuple(phases[:2]), tuple(phases[2:]))
        places, rates = (
            np.array([row[i] for i in self.places]) for row in (state.position, state.velocity)
        )
        return self.phases(phases[0], places, phases[2], rates)

    def phases(self, crank: Array, places: Array, speed: Array, rates: Array) -> Array:
        """Returns phases, given the rates of the places."""
        return np.array((crank, *places, speed, (self.ways(places) * rates).sum(axis=0)))

    def ways(self, places: Array) -> Array:
        """Computes the rates of the places while the crank rests and the last velocity is 1."""
        if self.by_slider:
            return np.ones_like(places)
        coupler, rod = self._levers(places)
        return np.array((-rod, coupler)) / np.hypot(coupler, rod)

    def _levers(self, places: Array) -> Array:
        """Computes n2 and n3, m, of shape (2, n)."""
        arms = zip(self._by_angles[1:], places, strict=True)
        return np.array([length * np.cos(place) for length, place in arms])

    def close(self, phases: Array) -> None:
        """Corrects small errors of G, in place."""
        levers, gap = self._levers(phases[1:3]), self._by_angles.closure(tuple(phases[:3]))
        phases[1:3] -= gap / (levers * levers).sum(axis=0) * levers

    def slopes(self, torque: Real, *phase: Array) -> Array:
        """Computes the derivatives of phases with respect to time.

        Args:
            torque: Torque on the crank, N m.
            phase: The rows of the phases, in arrays of the same shape.

        Returns:
            The derivatives, of shape (k, ...).
        """
        with np.errstate(all='ignore'):
            return np.array(self._evaluate(_slopes, *phase, torque))

    def states(self, torque: Array, *phase: Array) -> State:
        """Computes the motion of all links for the arguments of `slopes`."""
        return cast('State', self._evaluate(_motion, *phase, torque))

    def residuals(self, crank: Array, places: Array, rates: Array, changes: Array) -> Array:
        """Computes the residual forces of a motion, without the motor's torque.

        Args:
            crank: Crank angles, rad.
            places: Positions of the places, rad or m.
            rates: Velocity of the crank, then the rates of the places.
            changes: Acceleration of the crank, then those of the places.

        Returns:
            The force on dyad or slider; G, m, if there are two places; the torque on the crank.
        """
        return np.array(self._evaluate(_residuals, crank, *places, *rates, *changes))

    def _evaluate(self, formula: Callable[..., Any], *values: Real) -> Any:
        """Evaluates a formula for arrays; it is compiled on first use."""
        if formula not in self._compiled_for_arrays:
            program = Program(formula, self._model, self._arguments[formula])
            code = program.code(frozenset(program.names))
            self._compiled_for_arrays[formula] = code.bound(self._model.numbers)
        return self._compiled_for_arrays[formula](*values)


def assembly(coupler: Array, rod: Array) -> str:
    """Returns the assembly of a pump in a motion: open, crossed, or alternating between both."""
    is_open = np.sin(coupler - rod) > 0
    return OPEN if is_open.all() else BOTH if is_open.any() else CROSSED


_Constants: TypeAlias = tuple[Model, tuple[int, ...]]  # the model, and the numbers of the places
_Values: TypeAlias = tuple[Real, ...]


def _slopes(constants: _Constants, q: _Values, u: _Values, torque: Real) -> _Values:
    model, places = constants
    rates = velocities(model.loop.pose(q), u)
    return (u[0], *(rates[i] for i in places), *forward(model, q, u, torque))


def _motion(constants: _Constants, q: _Values, u: _Values, torque: Real) -> State:
    return driven_state(constants[0], q, u, torque)


def _residuals(constants: _Constants, q: _Values, rates: _Values, changes: _Values) -> _Values:
    model, places = constants
    pose = model.loop.pose(q)
    ways = [pose.links[i].jacobian[1] for i in places]  # orthogonal to the crank's effect
    u = rates[0], total(map(operator.mul, ways, rates[1:]))
    held = accelerations(pose, u, ())
    gains = (change - held[i] for change, i in zip(changes[1:], places, strict=True))
    a = changes[0], total(map(operator.mul, ways, gains))
    torque, force = balance(model, pose, velocities(pose, u), accelerations(pose, u, a))
    closures = (model.loop.closure(q),) if isinstance(model.loop, ByAngles) else ()
    return force, *closures, torque


@dataclass(frozen=True)
class SmoothLoad(LoadCurve):
    """A load curve with a return_value that does not jump where the slider reverses.

    A Fourier series cannot represent a jump. Between slider speeds of -width and width, the force
    therefore changes from one curve to the other as a cubic polynomial of the speed.

    Attributes:
        width: Slider speed below which the force is between the two curves, m/s.
    """

    width: float = 0.0

    def on(self, mechanism: Mechanism) -> Any:
        """See `LoadCurve`."""
        return _SmoothForce(super().on(mechanism), self.width)


class _SmoothForce(NamedTuple):
    curve: Any  # a CurveForce with a return_value
    width: float

    def forces(self, links: Sequence[LinkPose], rates: Sequence[Real]) -> dict[int, Real]:
        """See `Load`."""
        link, _, _, *curves = self.curve
        rate = rates[link] / self.width
        share = where(rate > 1, 1.0, where(rate < -1, -1.0, 0.5 * rate * (3 - rate * rate)))
        forth, back = (curve(links[link].position) for curve in curves)
        return {link: 0.5 * (forth + back + share * (forth - back))}


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
