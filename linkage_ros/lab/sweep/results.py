# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What became of designs: which are good, how far measures spread, and the table."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from linkage_ros.errors import ConfigurationError
from linkage_ros.lab.sweep.measures import MEASURES
from linkage_ros.lab.sweep.study import Study
from linkage_ros.numeric import Array

CANNOT_TURN, OUTSIDE, VALID, FRONT = OUTCOMES = (
    'cannot turn', 'outside the constraints', 'valid', 'on the Pareto front',
)  # fmt: skip


class Results:
    """The measures of all designs.

    Attributes:
        study: The study.
        base: Measures of the base by name; not numbers where it has none.
        of: Measures of the designs by name, likewise.
        measured: Whether each design is measured yet.
        good: Whether each design turns and fulfils the constraints.
        outcomes: One of OUTCOMES for each design.
    """

    def __init__(self, study: Study, base: Array, found: Array) -> None:
        """Judges designs.

        Args:
            study: The study.
            base: A row of `measure` for the base.
            found: The rows of the designs that are measured, the others not numbers.
        """
        self.study = study
        self.base = dict(zip(study.task.measures, base[1:].tolist(), strict=True))
        self.of = dict(zip(study.task.measures, found.T[1:], strict=True))
        self.measured = ~np.isnan(found[:, 0])
        self._held = {
            f'{name} {low:g} to {high:g}': (self.of[name] >= low) & (self.of[name] <= high)
            for name, (low, high) in study.constraints.items()
        }
        self.good = np.all([found[:, 0] == 1, *self._held.values()], axis=0)
        self.outcomes = np.where(self.good, VALID, OUTSIDE).astype(object)
        self.outcomes[found[:, 0] == 0] = CANNOT_TURN
        if study.goals:
            self._find_front()

    def _find_front(self) -> None:
        """Marks the designs that no other beats in both goals."""
        first, second = (
            self.of[name] * (1.0 if goal == 'least' else -1.0)
            for name, goal in self.study.goals.items()
        )
        rows = np.flatnonzero(self.good & np.isfinite(first + second))
        rows = rows[np.lexsort((second[rows], first[rows]))]
        before = np.minimum.accumulate(np.append(np.inf, second[rows]))[:-1]
        self.outcomes[rows[second[rows] < before]] = FRONT

    def require_good(self) -> None:
        """Refuses a study that leaves no design.

        Raises:
            ConfigurationError: With how many designs fulfil each constraint.
        """
        if not self.good.any():
            counts = ''.join(f', {x.sum()} have {words}' for words, x in self._held.items())
            turn = (self.outcomes != CANNOT_TURN).sum()
            raise ConfigurationError(
                f'no designs are left: of {len(self.good)}, {turn} turn{counts}; change the '
                'ranges or the constraints'
            )

    def summary(self) -> str:
        """How many designs there are, and what became of them."""
        counts = [f'{(self.outcomes == x).sum()} {x}' for x in OUTCOMES if x in self.outcomes]
        return f'{len(self.good)} designs: {", ".join(counts)}'

    def spread(self, measure: str) -> Array:
        """A measure of the good designs that have it."""
        values: Array = self.of[measure][self.good]
        return values[np.isfinite(values)]

    def lines(self) -> Iterator[str]:
        """How far each measure spreads, and because of what, in words."""
        for name, base in self.base.items():
            if len(values := self.spread(name)):
                span = f'{values.min():.5g} to {values.max():.5g} {MEASURES[name].unit}'.rstrip()
                yield f'{name}: {span}, base {base:.5g}{self._cause(name)}'

    def _cause(self, name: str) -> str:
        """The parameter that explains most of a measure's variance, by its correlation."""
        table = np.column_stack([self.study.designs, self.of[name]])
        table = table[self.good & np.isfinite(self.of[name])]
        if not np.ptp(table, axis=0).all():
            return ''
        shares = np.corrcoef(table, rowvar=False)[-1, :-1] ** 2
        most = [*self.study.columns][int(shares.argmax())]
        return f', {100 * shares.max():.0f} % of its variance by {most}'

    def save(self, path: Path) -> None:
        """Writes the designs that are measured as CSV; numbers read back to the last bit.

        Raises:
            OSError: It cannot be written; a file that was there stays.
        """
        units = {name: column.unit for name, column in self.study.columns.items()}
        units |= {name: MEASURES[name].unit for name in self.of}
        head = ','.join(f'{name} [{unit}]' for name, unit in units.items())
        table = np.column_stack([self.study.designs, *self.of.values()])
        new = path.with_suffix('.csv.new')
        with new.open('w', encoding='utf-8') as stream:
            stream.write(f'design,{head},outcome\n')
            for row in np.flatnonzero(self.measured).tolist():
                cells = ('' if np.isnan(x) else repr(x) for x in table[row].tolist())
                stream.write(f'{row + 1},{",".join(cells)},{self.outcomes[row]}\n')
        new.replace(path)
