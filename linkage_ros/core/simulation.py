# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The motion that a torque makes, in fixed steps: bounded work, and no step that is not checked.

Each step is Dormand and Prince's of order 5 (J. Comput. Appl. Math. 6 (1980), RK5(4)7M); what it
differs from its embedded result of order 4 tells whether the step was short enough. Where it was
not, it is halved, as often as a bounded number of trials allows; where that does not help, the
motion is at the edge of what its coordinates can describe, and ends with an error.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import NoReturn, Protocol, TypeAlias

from linkage_ros.core.equations import EquationsOfMotion
from linkage_ros.core.numeric import within_two_turns
from linkage_ros.errors import LinkageError, MotionError

# Coordinates, then their rates.
Phase: TypeAlias = tuple[float, ...]
# The torque on the crank, N m, at a time, s, and a crank speed, rad/s.
TorqueLaw: TypeAlias = Callable[[float, float], float]

LONGEST_STEP = 1e-3  # s
TOLERANCE = 1e-9
EDGE_PART = 0.25  # longest step, of the time to the edge
_HALVINGS = 40
_TRIALS = 400  # of steps, within one part of at most 1 ms
_AHEAD = 1e-3  # s, for which the time left foretells the end
_LEAST = 1e-5  # sine of the angle of a dyad that counts as none
_NEAR = 0.05  # sine of the angle of a dyad that counts as stretched or folded

_NODES = (0.2, 0.3, 0.8, 8 / 9, 1.0)
_STAGES = (
    (0.2,),
    (3 / 40, 9 / 40),
    (44 / 45, -56 / 15, 32 / 9),
    (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729),
    (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656),
)
_WEIGHTS = (35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84)
_ERRORS = (71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40)


@dataclass(frozen=True)
class DrivenMechanism:
    """A mechanism under a torque: a system of first order, for whatever integrates it.

    Attributes:
        equations: Of the mechanism.
        torque: On the crank, N m, over time, s, and crank speed, rad/s.
    """

    equations: EquationsOfMotion
    torque: TorqueLaw

    @property
    def units(self) -> Phase:
        """In which errors of coordinates and rates count: rad and crank lengths, also per s."""
        units = 1.0, self.equations.mechanism.crank.length
        return units[: len(self.equations.coordinates)] * 2

    def slope(self, time: float, phase: Phase) -> Phase:
        """The rates of coordinates and rates, as `look`."""
        return self.look(time, phase)[0]

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
            LinkageError: As `EquationsOfMotion.accelerations`.
        """
        count = len(phase) // 2
        q, u = phase[:count], phase[count:]
        accelerations, (sine, rate) = self.equations.forward(q, u, self.torque(time, u[0]))
        if rate >= 0:
            return (*u, *accelerations), math.inf
        # Below, rounding tells no more which way it goes: the edge counts as reached.
        return (*u, *accelerations), -sine / rate if sine > _LEAST else 0.0

    def sine(self, phase: Phase) -> float:
        """Of the angle at which coupler and third link meet, or coupler and guide's normal.

        Args:
            phase: Coordinates, then their rates.

        Returns:
            0 at the edge of what the coordinates describe.
        """
        return self.equations.dyad(phase[: len(phase) // 2])[0]

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
        sine, words = self.equations.dyad(q)
        with suppress(LinkageError):  # the end itself is a little later
            u = phase[len(q) :]
            _, (opening, rate) = self.equations.forward(q, u, self.torque(time, u[0]))
            left = -opening / rate if rate < 0 else math.inf
            time += left if left < _AHEAD else 0.0
        place = f'crank at {math.degrees(q[0]) % 360:.6g} deg'
        if len(q) > 1:
            place += f', slider at {q[1]:.6g} m'
        if sine < _NEAR and self.equations.has_edge:
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


class Steps(Protocol):
    """What follows a motion from time to time.

    Attributes:
        phase: Coordinates, then their rates; the crank within two turns of 0.
        pairs: Pairs of whole turns that belong to it.
        time: Up to which it was followed, s.
    """

    phase: Phase
    pairs: int
    time: float

    def changed(self) -> None:
        """Takes note that the torque is another from now on."""

    def advance(self, time: float) -> None:
        """Follows the motion to a time, s."""


# Begins to follow a motion at t = 0, from a phase.
Integrate: TypeAlias = Callable[[DrivenMechanism, Phase], Steps]


class FixedSteps:
    """Follows a motion in equal steps between the times that are asked for.

    Attributes:
        driven: What moves.
        time: Up to which it is followed, s.
        phase: At that time: coordinates, then their rates; the crank within two turns of 0.
        pairs: Pairs of whole turns that belong to it.
    """

    def __init__(
        self,
        driven: DrivenMechanism,
        phase: Phase,
        longest: float = LONGEST_STEP,
        tolerance: float = TOLERANCE,
        time: float = 0.0,
    ) -> None:
        """Begins a motion.

        Args:
            driven: What moves.
            phase: Coordinates, then their rates.
            longest: Step, s.
            tolerance: Of the error of a step, in rad and crank lengths; of rates, in the same
                per second, relative to a rate that is larger.
            time: Of the beginning, s.

        Raises:
            LinkageError: It cannot even begin, as `EquationsOfMotion.accelerations` tells.
        """
        self.driven, self.time = driven, time
        self.phase, self.pairs = wound(phase)
        self._longest, self._tolerance = longest, tolerance
        self._units = driven.units
        self._look: tuple[Phase, float] | None = driven.look(time, self.phase)

    def changed(self) -> None:
        """Takes note that the torque is another from now on."""
        self._look = None

    def advance(self, time: float) -> None:
        """Follows the motion to a time.

        Args:
            time: Not before the time reached, s.

        Raises:
            MotionError: It cannot be followed that far; `time` and `phase` are those reached.
        """
        start, span = self.time, time - self.time
        steps = math.ceil(span / self._longest * (1 - 1e-9))
        for i in range(1, steps + 1):
            self._trials = _TRIALS
            self._step((time if i == steps else start + span * (i / steps)) - self.time, _HALVINGS)
        self.time = time
        self.phase, pairs = wound(self.phase)
        self.pairs += pairs

    def _step(self, h: float, halvings: int) -> None:
        cause = None
        self._trials -= 1
        try:
            phase, look, error = self._try(h)
        except LinkageError as refusal:
            cause, error = refusal, math.inf
        if cause is None and error <= self._tolerance:
            self.time, self.phase, self._look = self.time + h, phase, look
        elif halvings and self._trials > 0:
            end = self.time + h
            self._step(h / 2, halvings - 1)
            self._step(end - self.time, halvings - 1)
        else:
            self.driven.fail(self.time, self.phase, cause)

    def _try(self, h: float) -> tuple[Phase, tuple[Phase, float], float]:
        """One step: where it ends, what is seen there, and its error."""
        time, phase, driven = self.time, self.phase, self.driven
        slope, left = self._look or driven.look(time, phase)
        if h > left * EDGE_PART:
            return phase, (slope, left), math.inf
        slopes = [slope]
        for node, stage in zip(_NODES, _STAGES, strict=True):
            slopes.append(driven.slope(time + node * h, _moved(phase, h, stage, slopes)))
        end = _moved(phase, h, _WEIGHTS, slopes)
        look = driven.look(time + h, end)
        slopes.append(look[0])
        apart = _moved((0.0,) * len(phase), h, _ERRORS, slopes)
        count = len(phase) // 2
        sizes = (*self._units[:count], *map(max, map(abs, end[count:]), self._units))
        errors = [abs(part) / size for part, size in zip(apart, sizes, strict=True)]
        # Not max: a nan must not pass.
        return end, look, math.inf if sum(errors) != sum(errors) else max(errors)


def wound(phase: Phase) -> tuple[Phase, int]:
    """A phase whose crank angle is within two turns of 0, and the pairs of turns left out."""
    angle, pairs = within_two_turns(phase[0])
    return (angle, *phase[1:]), pairs


def _moved(phase: Phase, h: float, weights: tuple[float, ...], slopes: list[Phase]) -> Phase:
    total = [0.0] * len(phase)
    for weight, slope in zip(weights, slopes, strict=False):
        if weight:
            total = [part + weight * rate for part, rate in zip(total, slope, strict=True)]
    return tuple([value + h * part for value, part in zip(phase, total, strict=True)])
