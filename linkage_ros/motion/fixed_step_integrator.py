# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Integrates torque-driven motion in fixed steps, with bounded work and checked steps.

Each step is Dormand and Prince's of order 5 (J. Comput. Appl. Math. 6 (1980), RK5(4)7M). Its
difference from the embedded result of order 4 shows whether the step was short enough. If not, it
is halved, within a limited number of trials; if that fails, the motion is at a singularity of its
coordinates, and ends with an error.
"""

from __future__ import annotations

import functools
import math
import operator
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple, Protocol, TypeAlias

from linkage_ros.dynamics.program import Program
from linkage_ros.dynamics.trees import Constants
from linkage_ros.errors import LinkageError
from linkage_ros.formulas import total, where
from linkage_ros.motion.driven_mechanism import DrivenMechanism
from linkage_ros.numeric import Array, Real

# Coordinates, then their rates.
Values: TypeAlias = tuple[float, ...]

LONGEST_STEP = 1e-3  # s
TOLERANCE = 1e-9
EDGE_PART = 0.25  # longest step, relative to the time to the end of the coordinates
_HALVINGS = 50
_TRIALS = 400  # largest number of trial steps per part of at most 1 ms


class Method(NamedTuple):
    """The weights of a method's sums of slopes; 0 for unused slopes.

    Attributes:
        stages: Weights of the point of each slope except the first.
        end: Weights for the end of a step.
        error: Weights for its error, including the slope at the end.
    """

    stages: tuple[tuple[Real, ...], ...]
    end: tuple[Real, ...]
    error: tuple[Real, ...]


DORMAND_PRINCE = Method(
    (
        (0.2,),
        (3 / 40, 9 / 40),
        (44 / 45, -56 / 15, 32 / 9),
        (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729),
        (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656),
    ),
    (35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84),
    (71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40),
)


class Steps(Protocol):
    """The interface of integrators of one motion.

    Attributes:
        driven: The driven mechanism in its current coordinates.
        phase: These coordinates, then their rates; the crank within two turns of 0.
        pairs: Pairs of whole turns removed from the crank angle.
        time: Time reached, s.
    """

    driven: DrivenMechanism
    phase: Values
    pairs: int
    time: float

    def changed(self) -> None:
        """Notes that the torque is another from now on."""

    def advance(self, time: float) -> None:
        """Integrates the motion to a time, s."""

    def phases(self, times: Sequence[float]) -> Iterator[tuple[Values, int]]:
        """Integrates to rising times, s; yields phase and pairs of whole turns at each."""


# Makes the integrator of a motion from the values at t = 0.
Integrate: TypeAlias = Callable[[DrivenMechanism, Values], Steps]


class FixedSteps:
    """Integrates a motion in equal steps between the requested times.

    Attributes:
        driven: The driven mechanism in its current coordinates.
        time: Time reached, s.
        phase: Coordinates, then their rates, at that time; the crank within two turns of 0.
        pairs: Pairs of whole turns removed from the crank angle.
        method: Method of a step.
    """

    method = DORMAND_PRINCE

    def __init__(
        self,
        driven: DrivenMechanism,
        phase: Values,
        longest: float = LONGEST_STEP,
        tolerance: float = TOLERANCE,
        time: float = 0.0,
        trials: int = _TRIALS,
    ) -> None:
        """Starts a motion.

        Args:
            driven: The driven mechanism.
            phase: Coordinates, then their rates.
            longest: Length of a step, s.
            tolerance: Largest error of a step, in rad and crank lengths; of rates, in the same
                units per second, relative to rates above one unit.
            time: Time of the start, s.
            trials: Largest number of trial steps for each step.

        Raises:
            LinkageError: The motion cannot start; see `Solver.accelerations`.
        """
        self.driven, self.time = driven, time
        self.phase, self.pairs = driven.wound(phase)
        self._longest, self._tolerance = longest, tolerance
        self._most_trials = self._trials = trials
        self._sums = _sums(self.method, len(phase))
        self._slope: Values | None = driven.slope(self.phase)

    def changed(self) -> None:
        """Notes that the torque is another from now on."""
        self._slope = None

    def phases(self, times: Sequence[float]) -> Iterator[tuple[Values, int]]:
        """See `Steps`."""
        for time in times:
            self.advance(time)
            yield self.phase, self.pairs

    def advance(self, time: float) -> None:
        """Follows the motion to a time.

        Args:
            time: Not before the time reached, s.

        Raises:
            MotionError: The motion ends earlier; `time` and `phase` hold the last values.
        """
        start, span = self.time, time - self.time
        steps = math.ceil(span / self._longest * (1 - 1e-9))
        for i in range(1, steps + 1):
            self._trials = self._most_trials
            self._step((time if i == steps else start + span * (i / steps)) - self.time, _HALVINGS)
        self.time = time
        self.phase, pairs = self.driven.wound(self.phase)
        self.pairs += pairs

    def _step(self, h: float, halvings: int) -> None:
        cause = None
        self._trials -= 1
        try:
            end, slope, error = self._try(h)
        except LinkageError as refusal:
            cause, error = refusal, math.inf
        if cause is None and error <= self._tolerance:
            self.time, self.phase, self._slope = self.time + h, end, slope
        elif halvings and self._trials > 0:
            until = self.time + h
            self._step(h / 2, halvings - 1)
            left = until - self.time
            # After days, time is coarser than the shortest steps.
            self._step(left if abs(left - h / 2) < h / 4 else h / 2, halvings - 1)
        else:
            self.driven.fail(self.time, self.phase, cause)

    def _try(self, h: float) -> tuple[Values, Values, float]:
        """Makes one step; returns its end, the slope there, and its error."""
        phase, driven = self.phase, self.driven
        better, self.phase, left = driven.ready(phase)
        if better is not driven:
            self.driven, self._slope = better, None
            driven, phase = better, self.phase
        slope = self._slope or driven.slope(phase)
        if h > left * EDGE_PART:
            return phase, slope, math.inf
        slopes = self._stages(h, slope)
        end = self._sums.end(*phase, h, *slopes)
        slope = driven.slope(end)
        errors = self._sums.error(*driven.units, *end, h, *slopes, *slope)
        # Not max: a nan must not pass.
        return end, slope, math.inf if sum(errors) != sum(errors) else max(errors)

    def _stages(self, h: float, slope: Values) -> list[float]:
        """The slopes of a step's stages, flat, from the first one."""
        slopes = list(slope)
        for move in self._sums.moves:
            slopes += self.driven.slope(move(*self.phase, h, *slopes))
        return slopes


def leap(
    slope: Callable[[tuple[Array, ...]], tuple[Array, ...]],
    units: Values,
    phase: tuple[Array, ...],
    h: Array,
) -> tuple[tuple[Array, ...], tuple[Real, ...]]:
    """Makes one step of many motions at once.

    Args:
        slope: Rates and accelerations at coordinates and rates.
        units: Units of errors; see `DrivenMechanism`.
        phase: Coordinates, then their rates.
        h: Length of each step, s.

    Returns:
        The end of each step, and its errors in those units, one array for each value.
    """
    slopes, end = [slope(phase)], phase
    for weights in (*DORMAND_PRINCE.stages, DORMAND_PRINCE.end):
        end = _moved(weights, phase, h, *slopes)
        slopes.append(slope(end))
    return end, _errors(DORMAND_PRINCE.error, units, end, h, *slopes)


class _Sums(NamedTuple):
    """The sums of a method as programs.

    Attributes:
        moves: From the values, h and the slopes so far, all flat, to the values at each stage.
        end: Likewise to the values at the end.
        error: From units, the values at the end, h and all slopes: the error of each value.
    """

    moves: tuple[Callable[..., Values], ...]
    end: Callable[..., Values]
    error: Callable[..., Values]


@functools.cache
def _sums(method: Method, size: int) -> _Sums:
    """The sums of a method for a number of values."""

    def row(word: str) -> tuple[str, ...]:
        return tuple(f'{word}{i}' for i in range(size))

    slopes = [row(f'slope{i}_') for i in range(len(method.error))]
    *moves, end = (
        Program(_moved, Constants(weights), (row('phase'), 'h', *slopes[: len(weights)])).scalar
        for weights in (*method.stages, method.end)
    )
    error = Program(_errors, Constants(method.error), (row('unit'), row('end'), 'h', *slopes))
    return _Sums(tuple(moves), end, error.scalar)


def _moved(
    weights: tuple[Real, ...], phase: tuple[Real, ...], h: Real, *slopes: tuple[Real, ...]
) -> tuple[Real, ...]:
    return tuple(
        value + h * total(map(operator.mul, weights, rates))
        for value, *rates in zip(phase, *slopes, strict=True)
    )


def _errors(
    weights: tuple[Real, ...],
    units: tuple[Real, ...],
    end: tuple[Real, ...],
    h: Real,
    *slopes: tuple[Real, ...],
) -> tuple[Real, ...]:
    apart = _moved(weights, (0.0,) * len(end), h, *slopes)
    sizes = [
        unit if i < len(end) // 2 else where(unit >= abs(value), unit, abs(value))
        for i, (unit, value) in enumerate(zip(units, end, strict=True))
    ]
    return tuple(abs(part) / size for part, size in zip(apart, sizes, strict=True))
