# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Integrates torque-driven motion in adaptive steps, for records.

This is the only file in this folder that uses SciPy. DOP853 is Dormand and Prince's method of
order 8, with a continuous solution of order 7 within each step.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from linkage_ros.errors import LinkageError
from linkage_ros.motion.driven_mechanism import DrivenMechanism
from linkage_ros.motion.fixed_step_integrator import EDGE_PART, Values
from linkage_ros.numeric import Array

_TOLERANCE = 1e-13  # relative; also absolute, in rad and crank lengths
_FIRST_STEP = 1e-4  # s
_SHORTEST_STEP = 1e-8  # s
# Largest number of steps between two states: a constant plus a number per second. A turn of a
# four-bar takes 100 steps, a second of the wind pump about 20.
_STEPS, _STEPS_A_SECOND = 5_000, 20_000
_END = 1e10  # s, longer than any run


class AdaptiveSteps:
    """Integrates a motion with error control at every step.

    Attributes:
        driven: The driven mechanism in its current coordinates.
        time: Time reached, s.
        phase: Coordinates at that time, then their rates; the crank angle is within two turns of
            0.
        pairs: Pairs of whole turns removed from the crank angle.
    """

    def __init__(self, driven: DrivenMechanism, phase: Values) -> None:
        """Starts a motion at t = 0.

        Args:
            driven: The mechanism and its torque law.
            phase: Coordinates at t = 0, then their rates.

        Raises:
            LinkageError: The motion cannot start; see `Solver.accelerations`.
        """
        self.driven, self.time = driven, 0.0
        self.phase, self.pairs = driven.wound(phase)
        self._steps = self._begin(0.0, self.phase)
        # Continuous solution of the last step, and the pairs of turns removed before it.
        self._between: Any = None
        self._pairs_ahead = self._pairs_between = self.pairs

    def changed(self) -> None:
        """Restarts the integrator after a change of the torque."""
        self._steps = self._begin(self.time, self.phase)
        self._pairs_ahead = self.pairs

    def _begin(self, time: float, phase: Values) -> Any:
        from scipy.integrate import DOP853

        return DOP853(
            self._slope, time, np.array(phase), _END,
            rtol=_TOLERANCE, atol=_TOLERANCE * np.array(self.driven.units), first_step=_FIRST_STEP,
        )  # fmt: skip

    def advance(self, time: float) -> None:
        """Integrates the motion up to a time.

        Args:
            time: Time not before the time reached, s.

        Raises:
            MotionError: The motion ends earlier.
        """
        left = _STEPS + _STEPS_A_SECOND * (time - self.time)
        while self._steps.t < time:
            if left < 0:
                self.driven.fail(self._steps.t, tuple(self._steps.y.tolist()), None)
            self._step()
            left -= 1
        if time > self.time:
            phase, pairs = self.driven.wound(tuple(self._between(time).tolist()))
            self.time, self.phase, self.pairs = time, phase, self._pairs_between + pairs

    def phases(self, times: Sequence[float]) -> Iterator[tuple[Values, int]]:
        """Yields `phase` and `pairs` at increasing times, s."""
        done = 0
        while done < len(times):
            self.advance(times[done])
            yield self.phase, self.pairs
            done += 1
            # For other times within the same step, evaluate the continuous solution only once.
            end = bisect_right(times, self._steps.t, done)
            if end > done:
                for values in self._between(np.array(times[done:end])).T.tolist():
                    self.phase, pairs = self.driven.wound(tuple(values))
                    self.time, self.pairs = times[done], self._pairs_between + pairs
                    yield self.phase, self.pairs
                    done += 1

    def _slope(self, _: float, phase: Array) -> Array:
        return np.array(self.driven.slope(tuple(phase.tolist())))

    def _step(self) -> None:
        steps = self._steps
        phase = tuple(steps.y.tolist())
        better, phase, left = self.driven.ready(phase)
        if better is not self.driven:
            self.driven = better
            self._steps = steps = self._begin(steps.t, phase)
        steps.max_step = left * EDGE_PART
        cause = self._try()
        while cause and steps.h_abs > _SHORTEST_STEP:
            steps.h_abs = min(steps.h_abs, steps.max_step) / 4
            cause = self._try()
        if cause or steps.status == 'failed':
            self.driven.fail(steps.t, phase, cause)
        self._between, self._pairs_between = steps.dense_output(), self._pairs_ahead
        phase, pairs = self.driven.wound(tuple(steps.y.tolist()))
        if pairs:  # keep the angle small, because the tolerance is relative to it
            steps.y = np.array(phase)
            self._pairs_ahead += pairs

    def _try(self) -> LinkageError | None:
        """Performs one step; returns the error if the slope rejects a value, otherwise None."""
        try:
            with np.errstate(all='ignore'):  # the slope rejects non-finite values
                self._steps.step()
        except LinkageError as refusal:
            return refusal
        return None
