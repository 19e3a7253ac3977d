# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Error of the driving torque without one of its terms, and the savings."""

from __future__ import annotations

import functools
import math
import time
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from linkage_ros.dynamics.solver import Solver
from linkage_ros.errors import MechanismError
from linkage_ros.lab.torque_models import (
    STATIC,
    TorqueProgram,
    counts,
    operations,
    series_program,
    table_program,
    terms,
    torque_program,
    with_point_masses,
    without,
)
from linkage_ros.model.structure import Mechanism
from linkage_ros.numeric import Array
from linkage_ros.units import radians_per_second

POINT_MASSES = 'coupler as two point masses'
_FULL = 'full model'
_HARMONICS = (1, 2, 3, 4, 5, 6, 7, 8, 10, 12, 16, 24, 32)
_NODES = (8, 16, 32, 64, 128, 256, 512, 1024)
_TIMED = 8  # every such angle is timed
_SAMPLES = 2048  # evenly spaced states: series are fitted to all, tables use some of them


class Saving(NamedTuple):
    """The error and the saving of one simpler model at one speed.

    Attributes:
        mechanism: Name of the parameter file.
        rpm: Crank speed.
        left_out: The omitted term, or the reduced model.
        error: Largest error of the torque over a period, as a share of the full torque's peak.
        operations: Operations that are saved.
        microseconds: Time that is saved in one run.
        parameters: Number of values that need not be identified.
        full_operations: Operations of the full model.
        full_microseconds: Time of one run of the full model.
        full_parameters: Number of values of the full model.
    """

    mechanism: str
    rpm: float
    left_out: str
    error: float
    operations: int
    microseconds: float
    parameters: int
    full_operations: int
    full_microseconds: float
    full_parameters: int


class Economy:
    """The driving torque of one mechanism at constant speeds, by full and simpler models.

    Attributes:
        terms: Terms of the model, each with its non-zero parameters.
    """

    def __init__(self, mechanism: Mechanism, name: str) -> None:
        """Prepares the models of a mechanism.

        Args:
            mechanism: A mechanism whose crank turns fully.
            name: Name of its parameter file.

        Raises:
            MechanismError: The crank does not turn fully, or nothing needs a torque.
        """
        reach = Solver(mechanism).reach
        reach.require_full_turn()
        self.terms, self._counts = terms(mechanism), counts(mechanism)
        if not self.terms.keys() - {'gravity'}:
            raise MechanismError(
                f'{name} needs no torque, because nothing has a mass or a load: give links masses'
            )
        self._mechanism, self._name, self._full = mechanism, name, torque_program(mechanism)
        self._period, self._samples = reach.period_turns * 2 * math.pi, reach.samples()

    def measure(
        self, rpms: Sequence[float], rounds: int, progress: Callable[..., Iterable[Any]]
    ) -> list[Saving]:
        """Leaves out each term, and tries each reduced model, at each speed.

        Args:
            rpms: Crank speeds.
            rounds: Number of timings of each program; the shortest counts.
            progress: Wraps an iterable in a progress bar with a label.

        Returns:
            The savings, speed by speed.

        Raises:
            MechanismError: No torque is needed at one of the speeds.
        """
        first = self._models(radians_per_second(rpms[0]))
        costs = self._costs(first, progress(range(rounds), 'timing'))
        full, found = costs.pop(_FULL), []
        for rpm in progress(rpms, 'speeds'):
            speed = radians_per_second(rpm)
            models = self._models(speed)
            for name, cost in costs.items():
                error = self._error(models[name][0], speed)
                saved = full[0] - cost[0], full[1] - cost[1], full[2] - cost[2]
                found.append(Saving(self._name, rpm, name, error, *saved, *full))
        return found

    def sentence(self, rpm: float, tolerance: float, savings: Sequence[Saving]) -> str:
        """States what the torque needs at one speed, and which terms may be omitted together.

        Args:
            rpm: One of the measured speeds.
            tolerance: Allowed error, as a share of the full torque's peak.
            savings: From `measure`.

        Returns:
            One sentence.
        """
        errors = {x.left_out: x.error for x in savings if x.rpm == rpm}
        out: list[str] = []
        for name in sorted(self.terms, key=lambda name: errors[name]):
            if self._error(self._without(*out, name), radians_per_second(rpm)) <= tolerance:
                out.append(name)
        gone = frozenset[str]().union(*(self.terms[name] for name in out))
        left = {x: own for x, own in self.terms.items() if x != STATIC and not own <= gone}
        needed = [x for x, own in left.items() if not any(own < other for other in left.values())]
        largest = [x for x in out if not any(self.terms[x] < self.terms[y] for y in out)]
        good = [name for name in errors if name not in self.terms and errors[name] <= tolerance]
        smallest = [
            words + next(x for x in good if kind in x)
            for kind, words in ((POINT_MASSES, 'the '), ('harmonic', ''), ('table', 'a '))
            if any(kind in x for x in good)
        ]
        return (
            f'at {rpm:g} rpm, within {100 * tolerance:g} % of the peak, this scene needs '
            f'{_listed(needed, "and")}; it can leave out {_listed(largest, "and")}'
        ) + (f'; {_listed(smallest, "or")} will do' if good else '')

    def _models(self, speed: float) -> dict[str, tuple[TorqueProgram, int]]:
        """The full and the simpler models at a speed: programs, and the values they need."""
        everything = frozenset[str]().union(*self.terms.values())
        found = {_FULL: (self._full, self._count(everything))}
        for name, own in self.terms.items():
            found[name] = self._without(name), self._count(everything - own)
        if reduced := with_point_masses(self._mechanism):
            others = self._count(everything - self.terms['coupler'])
            found[POINT_MASSES] = torque_program(reduced), others + 2
        even = self._full.torques(np.arange(float(_SAMPLES)) * (self._period / _SAMPLES), speed)
        for n in _HARMONICS:
            program = series_program(even, self._period, n)
            found[f'{n} harmonic{"s" if n > 1 else ""}'] = program, 2 * n + 1
        for n in _NODES:
            found[f'table of {n} nodes'] = table_program(even[:: _SAMPLES // n], self._period), n
        return found

    def _without(self, *names: str) -> TorqueProgram:
        return torque_program(without(self._mechanism, names), static=STATIC in names)

    def _count(self, parameters: Iterable[str]) -> int:
        return sum(self._counts[name] for name in parameters)

    def _costs(
        self, models: dict[str, tuple[TorqueProgram, int]], rounds: Iterable[int]
    ) -> dict[str, tuple[int, float, int]]:
        """Measures operations, microseconds and values of each model.

        The programs alternate, so that a busy machine slows all alike.
        """
        programs = {program.source: program.scalar for program, _ in models.values()}
        best, angles = dict.fromkeys(programs, math.inf), self._samples[::_TIMED].tolist()
        for _ in rounds:
            for source, run in programs.items():
                start = time.perf_counter()
                for angle in angles:
                    run(angle, 1.0)
                best[source] = min(best[source], time.perf_counter() - start)
        return {
            name: (operations(source), best[source] / len(angles) * 1e6, count)
            for name, ((_, source), count) in models.items()
        }

    def _error(self, program: TorqueProgram, speed: float) -> float:
        """The largest error of a program's torque, as a share of the full torque's peak.

        Raises:
            MechanismError: The torque is 0.
        """
        full = self._exact(speed)
        peak = np.abs(full).max()
        if not peak:
            raise MechanismError(
                f'{self._name} needs no torque at {speed:g} rad/s: choose other speeds (--rpm)'
            )
        return float(np.abs(program.torques(self._samples, speed) - full).max() / peak)

    @functools.cache  # noqa: B019
    def _exact(self, speed: float) -> Array:
        """Torques of the full model at all angles, N m."""
        return self._full.torques(self._samples, speed)


def handover(savings: Sequence[Saving]) -> float | None:
    """The speed at which weights and inertia contribute equally, rpm; None: one is absent.

    The torque of weights does not depend on speed; that of inertia grows with its square.
    """
    errors = {(x.rpm, x.left_out): x.error for x in savings}
    for rpm in dict.fromkeys(x.rpm for x in savings):
        weights, inertia = errors.get((rpm, 'gravity'), 0.0), errors.get((rpm, STATIC), 0.0)
        if weights and inertia:
            return abs(rpm) * math.sqrt(weights / inertia)
    return None


def _listed(names: Sequence[str], word: str) -> str:
    """Joins names as text: a, b and c."""
    *others, last = names or ['nothing']
    return f'{", ".join(others)} {word} {last}' if others else last
