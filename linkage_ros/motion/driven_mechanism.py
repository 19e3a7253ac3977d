# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A mechanism under a torque, as a system of first order: what integrators follow."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import NoReturn, TypeAlias

from linkage_ros.dynamics.solver import Solver
from linkage_ros.errors import LinkageError, MotionError

# Coordinates, then their rates.
Phase: TypeAlias = tuple[float, ...]
# The torque on the crank, N m, at a time, s, and a crank speed, rad/s.
TorqueLaw: TypeAlias = Callable[[float, float], float]

_AHEAD = 1e-3  # s, for which the time left foretells the end
_LEAST = 1e-5  # sine of the angle of a dyad that counts as none
_NEAR = 0.05  # sine of the angle of a dyad that counts as stretched or folded


@dataclass(frozen=True)
class DrivenMechanism:
    """A mechanism under a torque: a system of first order, for whatever integrates it.

    Attributes:
        solver: Solver of the mechanism.
        torque: On the crank, N m, over time, s, and crank speed, rad/s.
    """

    solver: Solver
    torque: TorqueLaw

    @property
    def units(self) -> Phase:
        """In which errors of coordinates and rates count: rad and crank lengths, also per s."""
        units = 1.0, self.solver.mechanism.crank.length
        return units[: len(self.solver.coordinates)] * 2

    def slope(self, time: float, phase: Phase) -> Phase:
        """The rates of coordinates and rates, as `look`."""
        count = len(phase) // 2
        u = phase[count:]
        return (*u, *self.solver.forward(phase[:count], u, self.torque(time, u[0])).accelerations)

    def look(self, time: float, phase: Phase) -> tuple[Phase, float]:
        """The rates of coordinates and rates, and how long they can describe the motion.

        At the edge of what the coordinates describe, where a dyad is stretched or folded, they
        turn back while the motion goes on in another assembly: a step that is not short beside
        the time left would take the one for the other.

        Args:
            time: s.
            phase: Coordinates, then their rates.

        Returns:
            Rates, then accelerations; and the time to the edge, s, if nothing turns them.

        Raises:
            LinkageError: As `Solver.accelerations`.
        """
        count = len(phase) // 2
        q, u = phase[:count], phase[count:]
        accelerations, edges = self.solver.forward(q, u, self.torque(time, u[0]))
        left = math.inf
        for sine, rate in edges:
            if rate < 0:
                # Below _LEAST, rounding hides which way it goes: the edge counts as reached.
                left = min(left, -sine / rate if sine > _LEAST else 0.0)
        return (*u, *accelerations), left

    def sine(self, phase: Phase) -> float:
        """Of the angle at which coupler and third link meet, or coupler and guide's normal.

        Args:
            phase: Coordinates, then their rates.

        Returns:
            0 at the edge of what the coordinates describe.
        """
        return self.solver.alignment(phase[: len(phase) // 2])[0]

    def fail(self, time: float, phase: Phase, cause: Exception | None) -> NoReturn:
        """Ends a motion that cannot be followed any further.

        Args:
            time: Up to which it was followed, s; the error tells when the end itself comes.
            phase: At that time.
            cause: What went wrong on the way on.

        Raises:
            MotionError: With time, place and what to do.
        """
        q = phase[: len(phase) // 2]
        sine, words = self.solver.alignment(q)
        with suppress(LinkageError):  # the end itself is a little later
            u = phase[len(q) :]
            _, edges = self.solver.forward(q, u, self.torque(time, u[0]))
            left = min((-s / rate for s, rate in edges if rate < 0), default=math.inf)
            time += left if left < _AHEAD else 0.0
        place = f'crank at {math.degrees(q[0]) % 360:.6g} deg'
        if len(q) > 1:
            place += f', slider at {q[1]:.6g} m'
        if sine < _NEAR and any(dyad.limits for dyad in self.solver.structure.dyads):
            reason = (
                f'{words}: the motion goes on in another assembly, which these coordinates do not '
                'describe; start slower or from elsewhere, or change torque, masses or lengths'
            )
        else:
            reason = (
                'the motion is too fast for the shortest step; lower the speed, the torque or the '
                'commands (torque_limit), or add mass'
            )
            if sine < _NEAR:
                reason += '; the links are in line but for a hair: make it a change point, or no'
        message = f'the motion ends at t = {time:.6g} s, {place}: {reason}'
        raise MotionError(message, time=time, coordinates=q) from cause
