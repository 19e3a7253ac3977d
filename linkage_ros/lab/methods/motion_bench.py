# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How wrong a phase of a motion under a torque is."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from decimal import Decimal
from functools import cached_property

from linkage_ros.errors import LinkageError
from linkage_ros.lab.methods.bench import FAILURES
from linkage_ros.lab.methods.registry import Integrator, Setting
from linkage_ros.lab.reference.motions import MotionReference
from linkage_ros.lab.reference.problems import InitialValueProblem, Phase

TRAJECTORY, ENERGY, LOOP = 'trajectory', 'energy', 'loop'  # what is judged
_ASKED = 0.05  # s between two states that are compared


class MotionBench:
    """One motion, and its true phases.

    Attributes:
        problem: The motion and its start.
        times: At which states are compared, s.
    """

    def __init__(
        self,
        problem: InitialValueProblem,
        times: Sequence[float],
        formula: Callable[[float], Phase] | None = None,
    ) -> None:
        """Prepares it.

        Args:
            problem: The motion and its start.
            times: At which states are compared, s.
            formula: The motion in closed form; None: it is followed in many digits.
        """
        self.problem, self.times, self._formula = problem, tuple(times), formula
        self._kinetic, potential = problem.energy(problem.start)
        self._energy = self._kinetic + potential

    @cached_property
    def _exact(self) -> list[tuple[Decimal, ...]]:
        if self._formula:
            return [tuple(map(Decimal, self._formula(time))) for time in self.times]
        reference = MotionReference(self.problem)
        return [reference.at(time) for time in self.times]

    @cached_property
    def _sizes(self) -> Phase:
        rates = zip(*(state[self.problem.count :] for state in self._exact), strict=True)
        largest = (float(max(map(abs, rate))) for rate in rates)
        return (*self.problem.driven.units[: self.problem.count], *largest)

    def error(self, index: int, phase: Phase) -> float:
        """How far a phase is from the true one.

        Args:
            index: Index of the time.
            phase: Coordinates, the crank with all its turns, then their rates.

        Returns:
            The largest of its errors: in rad, crank lengths and, of rates, relative to the
            largest of the motion; inf if one is not finite.
        """
        if not all(map(math.isfinite, phase)):
            return math.inf
        values = zip(phase, self._exact[index], self._sizes, strict=True)
        return max(abs(float(Decimal(value) - true)) / size for value, true, size in values)

    def drift(self, phase: Phase) -> float:
        """The change of energy up to a phase.

        Args:
            phase: Phase of a motion without motor and damping.

        Returns:
            Relative to the kinetic energy at first; inf if a value is not finite.
        """
        if not all(map(math.isfinite, phase)):
            return math.inf
        return abs(sum(self.problem.energy(phase)) - self._energy) / self._kinetic

    def worst_error(self, method: Integrator, setting: Setting, quantity: str) -> float:
        """The largest error of an integrator over the motion; inf where it fails.

        Args:
            method: From the registry.
            setting: One of its settings.
            quantity: TRAJECTORY or ENERGY.

        Returns:
            The error.
        """
        try:
            follower = method.make(self.problem, setting)
            phases = [follower.at(time) for time in self.times]
        except (LinkageError, *FAILURES):
            return math.inf
        if quantity == ENERGY:
            return max(map(self.drift, phases))
        return max(itertools.starmap(self.error, enumerate(phases)))


def even(seconds: float) -> list[float]:
    """The times at which states are compared.

    Args:
        seconds: The last.

    Returns:
        Times, s.
    """
    return [(i + 1) * _ASKED for i in range(round(seconds / _ASKED))]
