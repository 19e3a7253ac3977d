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
from typing import Protocol, TypeAlias

from linkage_ros.errors import LinkageError
from linkage_ros.motion.driven_mechanism import DrivenMechanism, Phase
from linkage_ros.numeric import within_two_turns

LONGEST_STEP = 1e-3  # s
TOLERANCE = 1e-9
EDGE_PART = 0.25  # longest step, of the time to the edge
_HALVINGS = 40
_TRIALS = 400  # of steps, within one part of at most 1 ms

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
