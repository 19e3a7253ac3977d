# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Integrates torque-driven motion in fixed steps, with error checks and bounded work.

Each step uses Dormand and Prince's method of order 5 (J. Comput. Appl. Math. 6 (1980), RK5(4)7M).
The difference from the embedded result of order 4 shows whether the step was short enough. If not,
the step is halved, up to a limited number of trials. If all trials fail, for example near a
singularity of the coordinates, the motion ends with an error.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple, Protocol, TypeAlias

from linkage_ros.dynamics.program import Program
from linkage_ros.dynamics.tape import Constants
from linkage_ros.errors import LinkageError
from linkage_ros.formulas import ZERO, Opaque, total, where
from linkage_ros.motion.driven_mechanism import DrivenMechanism, slope_at
from linkage_ros.numeric import Real

# Coordinates, then their rates.
Values: TypeAlias = tuple[float, ...]

LONGEST_STEP = 1e-3  # s
TOLERANCE = 1e-9
EDGE_PART = 0.25  # longest step, relative to the time until the coordinates become singular
_HALVINGS = 50
_TRIALS = 400  # largest number of trials for each step of at most LONGEST_STEP


class Method(NamedTuple):
    """The coefficients of a Runge-Kutta method: weights of the slopes, 0 for unused slopes.

    Attributes:
        stages: Weights for each point at which a slope after the first is evaluated.
        end: Weights for the values at the end of a step.
        error: Weights for the error of a step; the last is that of the slope at its end.
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
    """Interface of an integrator.

    Attributes:
        driven: The driven mechanism in its current coordinates.
        phase: Coordinates, then their rates; the crank angle is within two turns of 0.
        pairs: Pairs of whole turns removed from the crank angle.
        time: Time reached, s.
    """

    driven: DrivenMechanism
    phase: Values
    pairs: int
    time: float

    def changed(self) -> None:
        """Notifies the integrator that the torque has changed."""

    def advance(self, time: float) -> None:
        """Integrates the motion up to a time, s."""

    def phases(self, times: Sequence[float]) -> Iterator[tuple[Values, int]]:
        """Yields `phase` and `pairs` at increasing times, s."""


# Creates an integrator from the values at t = 0.
Integrate: TypeAlias = Callable[[DrivenMechanism, Values], Steps]


class Plant(NamedTuple):
    """The equations of motion integrated by a step.

    Attributes:
        units: Units of errors; see `DrivenMechanism.units`.
        accelerations: Function that returns the accelerations; its arguments are the coordinates,
            then their rates.
    """

    units: tuple[Real, ...]
    accelerations: Callable[..., Sequence[Real]]


def leap(
    plant: Plant, values: tuple[Real, ...], h: Real, slope: tuple[Real, ...]
) -> tuple[tuple[Real, ...], tuple[Real, ...], tuple[Real, ...]]:
    """Performs one step of a motion, or of many motions as arrays; compiled as a formula.

    Args:
        plant: The equations of motion.
        values: Coordinates, then their rates.
        h: Length of the step, s.
        slope: Rates and accelerations at the start of the step.

    Returns:
        The values and the slope at the end of the step, and the errors; see `errors`.
    """
    slopes, end = [slope], values
    for weights in (*DORMAND_PRINCE.stages, DORMAND_PRINCE.end):
        end = moved(weights, values, h, slopes)
        slopes.append(slope_at(plant.accelerations, end))
    return end, slopes[-1], errors(DORMAND_PRINCE.error, plant.units, end, h, slopes)


def moved(
    weights: Sequence[Real], values: tuple[Real, ...], h: Real, slopes: Sequence[Sequence[Real]]
) -> tuple[Real, ...]:
    """Returns values + h * (weighted sum of the slopes); compiled as a formula."""
    used = [(weight, rates) for weight, rates in zip(weights, slopes, strict=True) if weight]
    return tuple(
        value + h * total(weight * rates[i] for weight, rates in used)
        for i, value in enumerate(values)
    )


def errors(
    weights: Sequence[Real],
    units: Sequence[Real],
    end: tuple[Real, ...],
    h: Real,
    slopes: Sequence[Sequence[Real]],
) -> tuple[Real, ...]:
    """Estimates the errors of a step; compiled as a formula.

    Args:
        weights: Weights of the slopes in the error.
        units: Units of the errors; see `DrivenMechanism.units`.
        end: The values at the end of the step.
        h: Length of the step, s.
        slopes: The slopes evaluated in the step.

    Returns:
        The error of each value in its unit; for a rate above one unit, the relative error.
    """
    sizes = [
        unit if i < len(end) // 2 else where(unit >= abs(value), unit, abs(value))
        for i, (unit, value) in enumerate(zip(units, end, strict=True))
    ]
    apart = moved(weights, (ZERO,) * len(end), h, slopes)
    return tuple(abs(part) / size for part, size in zip(apart, sizes, strict=True))


class FixedSteps:
    """Integrates a motion in equal steps between the requested times.

    Attributes:
        driven: The driven mechanism in its current coordinates.
        time: Time reached, s.
        phase: Coordinates at that time, then their rates; the crank angle is within two turns of
            0.
        pairs: Pairs of whole turns removed from the crank angle.
        tried: Number of trials so far.
    """

    _formula = staticmethod(leap)

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
            driven: The mechanism and its torque law.
            phase: Coordinates at the start, then their rates.
            longest: Largest length of a step, s.
            tolerance: Largest error of a step; see `errors`.
            time: Time at the start, s.
            trials: Largest number of trials for each step.

        Raises:
            LinkageError: The motion cannot start; see `Solver.accelerations`.
        """
        self.time, self.tried = time, 0
        self.phase, self.pairs = driven.wound(phase)
        self._longest, self._tolerance = longest, tolerance
        self._most_trials = self._trials = trials
        self._use(driven)
        self._slope: Values | None = driven.slope(self.phase)

    def _use(self, driven: DrivenMechanism) -> None:
        """Creates the program of a step in the coordinates of a driven mechanism."""
        constants = Constants(Plant(driven.units, Opaque(driven.accelerations)))
        values, slope = (
            tuple(f'{word}{i}' for i in range(len(driven.units))) for word in ('value', 'slope')
        )
        self.driven = driven
        self._leap = Program(self._formula, constants, (values, 'h', slope)).scalar

    def changed(self) -> None:
        """Discards the slope, because the torque has changed."""
        self._slope = None

    def phases(self, times: Sequence[float]) -> Iterator[tuple[Values, int]]:
        """See `Steps.phases`."""
        for time in times:
            self.advance(time)
            yield self.phase, self.pairs

    def advance(self, time: float) -> None:
        """Integrates the motion up to a time.

        Args:
            time: Time not before the time reached, s.

        Raises:
            MotionError: The motion ends earlier. `time` and `phase` then hold the last values.
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
        self.tried += 1
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
            # After days of motion, the resolution of time is coarser than the shortest steps.
            self._step(left if abs(left - h / 2) < h / 4 else h / 2, halvings - 1)
        else:
            self.driven.fail(self.time, self.phase, cause)

    def _try(self, h: float) -> tuple[Values, Values, float]:
        """Tries one step; returns the values and the slope at its end, and its largest error."""
        driven, self.phase, left = self.driven.ready(self.phase)
        if driven is not self.driven:
            self._use(driven)
            self._slope = None
        phase, slope = self.phase, self._slope or driven.slope(self.phase)
        if h > left * EDGE_PART:
            return phase, slope, math.inf
        end, slope, apart = self._leap(*phase, h, *slope)
        # max alone could ignore a nan.
        return end, slope, math.inf if sum(apart) != sum(apart) else max(apart)
