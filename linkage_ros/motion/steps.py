# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Integrates torque-driven motion: in checked fixed steps, or in adaptive steps for records.

Live runs use fixed steps with bounded work. If a step's error is too large, the step is halved, up
to a limited number of trials. If all trials fail, for example near a singularity of the
coordinates, the motion ends with an error. Records use SciPy's DOP853, Dormand and Prince's method
of order 8, with a continuous solution of order 7 within each step. Both use implicit fixed steps
under strong damping.

The table lists the processor time, in s per second of motion, for ticks of 1 ms. The quadrilateral
turns at 150 rpm and the wind pump at 3 rad/s; `Motor.damping` varies:

    damping, N m s       rate, 1/s   explicit   implicit   DOP853   implicit, 1e-11
    quadrilateral 30     6e2         0.04       0.04       0.4      0.1
    quadrilateral 200    4e3         0.1        0.04       1.0      0.13
    quadrilateral 1e3    2e4         0.4        0.03       2 to 3   0.15
    quadrilateral 1e7    2e8         -          0.03       -        0.04
    wind pump 1e5        5e3         0.07       0.07       0.4      0.08
    wind pump 4e5        2e4         0.4        0.1        1.2      0.09
    wind pump 1e7        5e5         11         0.08       20       0.07

At a damping of 1e5 N m s, the error of the quadrilateral's torque is 2e-7 N m for implicit steps
with a tolerance of 1e-11. It is 2e-5 N m for SciPy's Radau (1e-12) at the same cost, and 2e-6 N m
for SciPy's LSODA at a sixth of this cost.
"""

import math
from bisect import bisect_right
from collections.abc import Callable, Iterator, Sequence
from typing import Any, TypeAlias

import numpy as np

from linkage_ros.errors import LinkageError
from linkage_ros.formulas import Opaque
from linkage_ros.mechanism.program import Constants, Program
from linkage_ros.motion.driven_mechanism import DrivenMechanism
from linkage_ros.motion.runge_kutta import Plant, leap, stiff_leap
from linkage_ros.numeric import Array

# Coordinates, then their rates.
Values: TypeAlias = tuple[float, ...]

LONGEST_STEP = 1e-3  # s
TOLERANCE = 1e-9
_EDGE_PART = 0.25  # longest step, relative to the time until the coordinates become singular
_SHORTEST_FIXED_STEP = 1e-18  # s
_TRIALS = 400  # largest number of trials for each step of at most LONGEST_STEP

_STIFF = 2e3  # settling rate, 1/s, above which implicit steps cost less than explicit ones
_RECORD_TRIALS = 10_000  # limit like _TRIALS, for records

# For adaptive steps: the tolerance, relative and also absolute, in rad and crank lengths; the
# first and the shortest step, s; and a time longer than any run, s.
_TOLERANCE, _FIRST_STEP, _SHORTEST_STEP, _END = 1e-13, 1e-4, 1e-8, 1e10
# Largest number of adaptive steps between two states: a constant plus a number per second. A turn
# of a four-bar takes 100 steps, a second of the wind pump about 20.
_STEPS, _STEPS_A_SECOND = 5_000, 20_000


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
        trials: int = _TRIALS,
    ) -> None:
        """Starts a motion of a mechanism under its torque law.

        Args:
            driven: The mechanism.
            phase: Coordinates at the start, then their rates.
            longest: Largest length of a step, s.
            tolerance: Largest error of a step; see `runge_kutta.errors`.
            trials: Largest number of trials for each step.
        """
        self.time, self.tried = 0.0, 0
        self.phase, self.pairs = driven.wound(phase)
        self._longest, self._tolerance, self._trials = longest, tolerance, trials
        self._use(driven)
        self._slope: Values | None = driven.slope(self.phase)

    def _use(self, driven: DrivenMechanism) -> None:
        """Creates the program of a step in the coordinates of a driven mechanism."""
        constants = Constants(Plant(driven.units, Opaque(driven.accelerations)))
        values, slope = (
            tuple(f'{word}{i}' for i in range(len(driven.units))) for word in ('value', 'slope')
        )
        self.driven = driven
        self._leap = Program(self._formula, constants, (values, 'h', slope)).floats

    def changed(self) -> None:
        """Discards the slope, because the torque has changed."""
        self._slope = None

    def phases(self, times: Sequence[float]) -> Iterator[tuple[Values, int]]:
        """Yields `phase` and `pairs` at increasing times, s."""
        for time in times:
            self.advance(time)
            yield self.phase, self.pairs

    def advance(self, time: float) -> None:
        """Integrates the motion up to a time, s, not before the time reached.

        Raises:
            MotionError: The motion ends earlier. `time` and `phase` then hold the last values.
        """
        start, span = self.time, time - self.time
        steps = math.ceil(span / self._longest * (1 - 1e-9))
        for i in range(1, steps + 1):
            self._last_trial = self.tried + self._trials
            self._step((time if i == steps else start + span * (i / steps)) - self.time)
        self.time = time
        self.phase, pairs = self.driven.wound(self.phase)
        self.pairs += pairs

    def _step(self, h: float) -> None:
        """Performs a step of length h, s, in halves if its error is too large."""
        cause = None
        self.tried += 1
        try:
            end, slope, error = self._try(h)
        except LinkageError as refusal:
            cause, error = refusal, math.inf
        if cause is None and error <= self._tolerance:
            self.time, self.phase, self._slope = self.time + h, end, slope
            return
        if h <= _SHORTEST_FIXED_STEP or self.tried >= self._last_trial:
            self.driven.fail(self.time, self.phase, cause)
        end_time = self.time + h
        self._step(h / 2)
        remaining = end_time - self.time
        # After days of motion, the resolution of time is coarser than the shortest steps.
        is_about_half = abs(remaining - h / 2) < h / 4
        self._step(remaining if is_about_half else h / 2)

    def _try(self, h: float) -> tuple[Values, Values, float]:
        """Tries one step; returns the values and the slope at its end, and its largest error."""
        driven, self.phase, time_to_singularity = self.driven.ready(self.phase)
        if driven is not self.driven:
            self._use(driven)
            self._slope = None
        phase, slope = self.phase, self._slope or driven.slope(self.phase)
        if h > time_to_singularity * _EDGE_PART:
            return phase, slope, math.inf
        end, slope, errors = self._leap(*phase, h, *slope)
        has_nan = any(map(math.isnan, errors))  # max alone could ignore it
        return end, slope, math.inf if has_nan else max(errors)


class StiffSteps(FixedSteps):
    """Integrates a motion in equal steps whose length strong damping does not limit."""

    _formula = staticmethod(stiff_leap)


class AdaptiveSteps:
    """Integrates a motion with error control at every step; attributes as in `FixedSteps`."""

    def __init__(self, driven: DrivenMechanism, phase: Values) -> None:
        """Starts a motion at t = 0; see `FixedSteps`."""
        self.driven, self.time = driven, 0.0
        self.phase, self.pairs = driven.wound(phase)
        # Continuous solution of the last step, and the pairs of turns removed before it.
        self._between: Any = lambda times: np.repeat([self.phase], len(times), axis=0).T
        self._pairs_between = self.pairs
        self.changed()

    def changed(self) -> None:
        """Restarts the integrator after a change of the torque."""
        self._begin(self.time, self.phase)
        self._pairs_ahead = self.pairs

    def _begin(self, time: float, phase: Values) -> None:
        from scipy.integrate import DOP853

        self._steps: Any = DOP853(
            self._slope, time, np.array(phase), _END,
            rtol=_TOLERANCE, atol=_TOLERANCE * np.array(self.driven.units), first_step=_FIRST_STEP,
        )  # fmt: skip

    def advance(self, time: float) -> None:
        """Integrates the motion up to a time, s; see `FixedSteps.advance`."""
        for _ in self.phases([time]):
            pass

    def phases(self, times: Sequence[float]) -> Iterator[tuple[Values, int]]:
        """Yields `phase` and `pairs` at increasing times, s."""
        done = 0
        while done < len(times):
            self._reach(times[done])
            # Evaluate the continuous solution once for all times within the step.
            within = times[done : bisect_right(times, self._steps.t, done)]
            for time, values in zip(
                within, self._between(np.array(within)).T.tolist(), strict=True
            ):
                self.phase, pairs = self.driven.wound(tuple(values))
                self.time, self.pairs = time, self._pairs_between + pairs
                yield self.phase, self.pairs
            done += len(within)

    def _reach(self, time: float) -> None:
        """Performs steps until the last one contains a time, s."""
        left = _STEPS + _STEPS_A_SECOND * (time - self.time)
        while self._steps.t < time:
            if left < 0:
                self.driven.fail(self._steps.t, tuple(self._steps.y.tolist()), None)
            self._step()
            left -= 1

    def _slope(self, _: float, phase: Array) -> Array:
        return np.array(self.driven.slope(tuple(phase.tolist())))

    def _step(self) -> None:
        """Performs a step, in other coordinates if they are better."""
        driven, phase, time_to_singularity = self.driven.ready(tuple(self._steps.y.tolist()))
        if driven is not self.driven:
            self.driven = driven
            self._begin(self._steps.t, phase)
        steps = self._steps
        steps.max_step = time_to_singularity * _EDGE_PART
        while True:
            try:
                with np.errstate(all='ignore'):  # the slope rejects non-finite values
                    steps.step()
                break
            except LinkageError as cause:
                if steps.h_abs <= _SHORTEST_STEP:
                    self.driven.fail(steps.t, phase, cause)
                steps.h_abs = min(steps.h_abs, steps.max_step) / 4
        if steps.status == 'failed':
            self.driven.fail(steps.t, phase, None)
        self._between, self._pairs_between = steps.dense_output(), self._pairs_ahead
        phase, pairs = self.driven.wound(tuple(steps.y.tolist()))
        if pairs:  # keep the angle small, because the tolerance is relative to it
            steps.y = np.array(phase)
            self._pairs_ahead += pairs


Steps: TypeAlias = FixedSteps | AdaptiveSteps
# Creates an integrator from the values at t = 0.
Integrate: TypeAlias = Callable[[DrivenMechanism, Values], Steps]


def live_steps(driven: DrivenMechanism, phase: Values, **options: Any) -> Steps:
    """Creates an integrator with bounded work per tick; arguments as for `FixedSteps`."""
    return live_method(driven)(driven, phase, **options)


def live_method(driven: DrivenMechanism) -> type[FixedSteps]:
    """Selects the integrator that costs less at the mechanism's settling rate."""
    return StiffSteps if driven.rates[0] > _STIFF else FixedSteps


def record_steps(driven: DrivenMechanism, phase: Values) -> Steps:
    """Creates the most accurate integrator for the mechanism; arguments as in `live_steps`."""
    if driven.rates[0] > _STIFF:
        return StiffSteps(driven, phase, tolerance=1e-11, trials=_RECORD_TRIALS)
    # Corners of a load destroy the accuracy of long high-order steps.
    if any(load.has_corners for load in driven.solver.mechanism.loads):
        return FixedSteps(driven, phase, tolerance=1e-13, trials=_RECORD_TRIALS)
    return AdaptiveSteps(driven, phase)
