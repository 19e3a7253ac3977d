# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A mechanism under a torque, as a system of first order: what integrators follow."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from statistics import median
from typing import NoReturn, TypeAlias

import numpy as np

from linkage_ros.dynamics.solver import Solver
from linkage_ros.errors import LinkageError, MotionError
from linkage_ros.model.reach import FULL_TURN
from linkage_ros.numeric import Array, Real

# The torque on the crank, N m, at a crank speed, rad/s.
TorqueLaw: TypeAlias = Callable[[float], Real]

_NUDGE = 1e-7  # of a value, or of its unit, for derivatives
_PLACES = 12  # crank angles at which eigenvalues are found
_SLOW = 1e-3  # rad/s or m/s: as good as rest
_SOON = 1e-3  # s
_LEAST = 1e-5  # sine of the angle of a dyad that counts as none
_NEAR = 0.05  # sine of the angle of a dyad that counts as stretched or folded


@dataclass(frozen=True)
class DrivenMechanism:
    """A mechanism under a torque: y' = slope(y), where y holds coordinates, then their rates.

    Attributes:
        solver: Solver of the mechanism.
        torque: On the crank, N m, over crank speed, rad/s.
    """

    solver: Solver
    torque: TorqueLaw

    @property
    def units(self) -> tuple[float, ...]:
        """The units of errors in y: rad and crank lengths, then the same per second."""
        units = 1.0, self.solver.mechanism.crank.length
        return units[: len(self.solver.coordinates)] * 2

    def slope(self, y: tuple[float, ...]) -> tuple[float, ...]:
        """Rates, then accelerations.

        Raises:
            LinkageError: As `Solver.accelerations`.
        """
        u = y[len(y) // 2 :]
        return (*u, *self.solver.forward(y, self.torque(u[0])))

    def jacobian(self, y: tuple[float, ...], slope: tuple[float, ...]) -> list[float]:
        """The derivatives of the accelerations, by differences.

        Args:
            y: Coordinates, then their rates.
            slope: The slope there.

        Returns:
            By each value of y in turn, those of all accelerations.

        Raises:
            LinkageError: As `Solver.accelerations`.
        """
        found: list[float] = []
        for i, (value, unit) in enumerate(zip(y, self.units, strict=True)):
            # Away from 0, at which the force of a load may leap.
            nudged = value + math.copysign(_NUDGE * max(abs(value), unit), value)
            there = self.slope((*y[:i], nudged, *y[i + 1 :]))
            pairs = zip(there[len(y) // 2 :], slope[len(y) // 2 :], strict=True)
            found.extend((a - b) / (nudged - value) for a, b in pairs)
        return found

    @functools.cached_property
    def rates(self) -> tuple[float, float]:
        """How fast it settles, and how fast it swings, about rest without the motor's torque, 1/s.

        From the eigenvalues of its linearised motion at several crank angles, the median of the
        largest: at the dead centre of a massless crank one is infinite.
        """
        free = DrivenMechanism(self.solver, lambda speed: self.torque(speed) - self.torque(0.0))
        arcs = self.solver.mobility.arcs if self.solver.mobility else FULL_TURN
        others, _ = self.solver.mechanism.start()
        found = []
        for low, high in arcs:
            for i in range(_PLACES):
                with suppress(LinkageError, np.linalg.LinAlgError):
                    angle = low + (high - low) * (i + 0.5) / _PLACES
                    found.append(free.eigenvalues((angle, *others)))
        settling, swinging = [-x.real.min() for x in found], [x.imag.max() for x in found]
        return float(median(settling or [0.0])), float(median(swinging or [0.0]))

    def eigenvalues(self, q: tuple[float, ...]) -> Array:
        """Those of the motion linearised about rest, 1/s."""
        y, count = (*q, *[_SLOW] * len(q)), len(q)
        below = np.reshape(self.jacobian(y, self.slope(y)), (2 * count, count)).T
        found: Array = np.linalg.eigvals(np.vstack([np.eye(count, 2 * count, count), below]))
        return found

    def sine(self, y: tuple[float, ...]) -> float:
        """The sine of the angle at which two links meet; 0 where the coordinates end."""
        return self.solver.alignment(y[: len(y) // 2])[0]

    def fail(self, time: float, y: tuple[float, ...], cause: Exception | None) -> NoReturn:
        """Ends a motion that cannot be followed any further.

        Args:
            time: Up to which it was followed, s; the error has the time of the end itself.
            y: Coordinates and rates at that time.
            cause: The error of the next step.

        Raises:
            MotionError: With time, place and what to do.
        """
        q = y[: len(y) // 2]
        sine, words = self.solver.alignment(q)
        with suppress(LinkageError):  # the end itself is a little later
            left = self.time_left(y, least=0.0)
            time += left if left < _SOON else 0.0
        place = f'crank at {math.degrees(q[0]) % 360:.6g} deg'
        if len(q) > 1:
            place += f', slider at {q[1]:.6g} m'
        if sine < _NEAR and self._is_limited:
            reason = (
                f'{words}: the motion goes on in another assembly, which these coordinates do not '
                'describe; start slower or from elsewhere, or change torque, masses or lengths'
            )
        else:
            reason = (
                'the motion is too fast for the shortest step; lower the speed, the torque, the '
                'commands (torque_limit) or a stiffness, or add mass'
            )
            if sine < _NEAR:
                reason += '; the links are in line but for a hair: make it a change point, or no'
        message = f'the motion ends at t = {time:.6g} s, {place}: {reason}'
        raise MotionError(message, time=time, coordinates=q) from cause

    def time_left(self, y: tuple[float, ...], least: float = _LEAST) -> float:
        """The time for which the coordinates can describe the motion, at constant rates, s.

        Where a dyad is stretched or folded, the coordinates turn back while the motion goes on in
        another assembly: only steps that are short beside this time can tell the two apart.

        Args:
            y: Coordinates, then their rates.
            least: A sine below it counts as 0: rounding hides which way it goes.

        Returns:
            The time to the first such place.

        Raises:
            LinkageError: As `Solver.accelerations`.
        """
        if not self._is_limited:
            return math.inf
        left = (
            -sine / rate if sine > least else 0.0
            for sine, _, rate in self.solver.meetings(y)
            if rate < 0
        )
        return min(left, default=math.inf)

    @functools.cached_property
    def _is_limited(self) -> bool:
        """Whether the coordinates cannot describe every motion; change points do no harm."""
        mobility = self.solver.mobility
        return mobility is None or not mobility.turns_fully
