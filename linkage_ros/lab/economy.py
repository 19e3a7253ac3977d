# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Error of the driving torque without one of its terms, and the savings."""

from __future__ import annotations

import functools
import itertools
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
    numbers,
    operations,
    series_program,
    table_program,
    terms,
    torque_program,
    torques,
    with_point_masses,
    without,
)
from linkage_ros.model.structure import Mechanism
from linkage_ros.numeric import Array
from linkage_ros.quantities import flatten
from linkage_ros.units import radians_per_second

POINT_MASSES = 'coupler as two point masses'
_HARMONICS = (1, 2, 3, 4, 5, 6, 7, 8, 10, 12, 16, 24, 32)
_NODES = (8, 16, 32, 64, 128, 256, 512, 1024)
_TIMED = 8  # every such angle is timed
_SAMPLES = 2048  # even states to which series are fitted, and of which tables have some


class Cost(NamedTuple):
    """The cost of a model of the torque, or the saving of a simpler one.

    Attributes:
        operations: Operations of its program.
        microseconds: Time of one run of that program.
        parameters: Number of values to identify.
    """

    operations: int
    microseconds: float
    parameters: int

    def saved(self, full: Cost) -> Cost:
        """The saving of this model, compared with the full one."""
        return Cost(
            full.operations - self.operations,
            full.microseconds - self.microseconds,
            full.parameters - self.parameters,
        )


class Saving(NamedTuple):
    """The error and the saving of one simpler model at one speed.

    Attributes:
        mechanism: Name of the parameter file.
        rpm: Crank speed.
        left_out: The omitted term, or the reduced model.
        error: Largest error of the torque over a period, as a share of the full torque's peak.
        saved: Cost of the full model minus that of this model.
        full: Cost of the full model.
    """

    mechanism: str
    rpm: float
    left_out: str
    error: float
    saved: Cost
    full: Cost

    def record(self) -> dict[str, Any]:
        """For JSON: the savings, and the costs of the full model as `full_operations` etc."""
        full = {f'full_{name}': value for name, value in self.full._asdict().items()}
        head = dict(zip(self._fields[:4], self[:4], strict=True))
        return {**head, **self.saved._asdict(), **full}


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
        self.terms = terms(mechanism)
        if not self.terms.keys() - {'gravity'}:
            raise MechanismError(
                f'{name} needs no torque, because nothing has a mass or a load: give links masses'
            )
        self._mechanism, self._name, self._values = mechanism, name, flatten(mechanism)
        self._period, self._samples = reach.period_turns * 2 * math.pi, reach.samples()
        self._full = torque_program(mechanism)

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
        models = self._models(radians_per_second(rpms[0])).values()
        full, *costs = self._costs(
            [self._full, *(program for program, _ in models)],
            [self._count(*self.terms.values()), *(needed for _, needed in models)],
            progress(range(rounds), 'timing'),
        )
        found = []
        for rpm in progress(rpms, 'speeds'):
            speed = radians_per_second(rpm)
            for (name, (program, _)), cost in zip(self._models(speed).items(), costs, strict=True):
                error = self._error(program, speed)
                found.append(Saving(self._name, rpm, name, error, cost.saved(full), full))
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
            joint = self._without([*out, name])
            if self._error(joint, radians_per_second(rpm)) <= tolerance:
                out.append(name)
        gone = {x for name in out for x in self.terms[name]}
        links = {name: own for name, own in self.terms.items() if name != STATIC}
        needed = [
            name for name, own in links.items()
            if not own <= gone and not any(own < other for other in links.values())
        ]  # fmt: skip
        largest = [x for x in out if not any(self.terms[x] < self.terms[y] for y in out)]
        words = (
            f'at {rpm:g} rpm, within {100 * tolerance:g} % of the peak, this scene needs '
            f'{_listed(needed, "and")}; it can leave out {_listed(largest, "and")}'
        )
        good = [name for name in errors if name not in self.terms and errors[name] <= tolerance]
        kinds = POINT_MASSES, 'harmonic', 'table'
        found = [next((x for x in good if kind in x), '') for kind in kinds]
        smallest = [x.replace('table', 'a table').replace('coupler', 'the coupler') for x in found]
        return words + (f'; {_listed([*filter(None, smallest)], "or")} will do' if good else '')

    def _models(self, speed: float) -> dict[str, tuple[TorqueProgram, int]]:
        """The simpler models at a speed by name: programs, and the values they need."""
        everything = {x for own in self.terms.values() for x in own}
        found = {
            name: (self._without([name]), self._count(everything - own))
            for name, own in self.terms.items()
        }
        if reduced := with_point_masses(self._mechanism):
            others = self._count(everything - self.terms['coupler'])
            found[POINT_MASSES] = torque_program(reduced), others + 2
        even = torques(self._full, np.arange(float(_SAMPLES)) * (self._period / _SAMPLES), speed)
        for n in _HARMONICS:
            program = series_program(even, self._period, n)
            found[f'{n} harmonic{"s" if n > 1 else ""}'] = program, 2 * n + 1
        for n in _NODES:
            found[f'table of {n} nodes'] = table_program(even[:: _SAMPLES // n], self._period), n
        return found

    def _without(self, names: Iterable[str]) -> TorqueProgram:
        return torque_program(without(self._mechanism, names), static=STATIC in names)

    @functools.cache  # noqa: B019
    def _exact(self, speed: float) -> Array:
        """Torques of the full model at all angles, N m."""
        return torques(self._full, self._samples, speed)

    def _count(self, *groups: Iterable[str]) -> int:
        """Counts the values in groups of parameters."""
        return sum(numbers(self._values[name]) for name in {*itertools.chain(*groups)})

    def _costs(
        self, programs: Sequence[TorqueProgram], needed: Sequence[int], rounds: Iterable[int]
    ) -> list[Cost]:
        """Measures the costs of programs, alternating so that a busy machine slows all alike."""
        by_source = {program.source: program for program in programs}
        best = dict.fromkeys(by_source, math.inf)
        for _ in rounds:
            for source, program in by_source.items():
                best[source] = min(best[source], self._time(program))
        return [
            Cost(operations(program), best[program.source], count)
            for program, count in zip(programs, needed, strict=True)
        ]

    def _time(self, program: TorqueProgram) -> float:
        """Time of one run, us."""
        run = program.scalar
        angles = self._samples[::_TIMED].tolist()
        start = time.perf_counter()
        for angle in angles:
            run(angle, 1.0)
        return (time.perf_counter() - start) / len(angles) * 1e6

    def _error(self, program: TorqueProgram, speed: float) -> float:
        """The largest error of a program's torque, as a share of the full torque's peak.

        Raises:
            MechanismError: The torque is 0.
        """
        full, found = self._exact(speed), torques(program, self._samples, speed)
        peak = np.abs(full).max()
        if not peak:
            raise MechanismError(
                f'{self._name} needs no torque at {speed:g} rad/s: choose other speeds (--rpm)'
            )
        return float(np.abs(found - full).max() / peak)


def handover(savings: Sequence[Saving]) -> float | None:
    """The speed at which weights and inertia contribute equally, rpm; None: one is absent.

    The torque of weights does not depend on speed; that of inertia grows with its square.
    """
    for one in savings:
        errors = {x.left_out: x.error for x in savings if x.rpm == one.rpm}
        weights, inertia = errors.get('gravity', 0.0), errors.get(STATIC, 0.0)
        if weights and inertia:
            return abs(one.rpm) * math.sqrt(weights / inertia)
    return None


def _listed(names: Sequence[str], word: str) -> str:
    """Joins names as text: a, b and c."""
    *others, last = names or ['nothing']
    return f'{", ".join(others)} {word} {last}' if others else last
