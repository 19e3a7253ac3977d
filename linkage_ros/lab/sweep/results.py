# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Outcome of each design, spread of each measure, and the table."""

from __future__ import annotations

from collections.abc import Iterator

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
        base: Measures of the base by name; NaN where it has none.
        of: Measures of the designs by name; NaN likewise.
        good: Whether the crank of each design turns fully and the constraints are met.
        outcomes: One of OUTCOMES for each design.
    """

    def __init__(self, study: Study, base: Array, found: Array) -> None:
        """Determines the outcomes of designs.

        Args:
            study: The study.
            base: A row of `measure` for the base.
            found: A row of `measure` for each design; NaN for designs not yet measured.
        """
        self.study, self._turns = study, found[:, 0]
        self.base = dict(zip(study.task.measures, base[1:].tolist(), strict=True))
        self.of = dict(zip(study.task.measures, found.T[1:], strict=True))
        self._held = {
            f'{name} {low:g} to {high:g}': (self.of[name] >= low) & (self.of[name] <= high)
            for name, (low, high) in study.constraints.items()
        }
        self.good = np.all([self._turns == 1, *self._held.values()], axis=0)
        outcomes = np.where(self.good, VALID, OUTSIDE)
        self.outcomes = np.where(self._turns == 0, CANNOT_TURN, outcomes).astype(object)
        if study.goals:
            self.outcomes[self._front()] = FRONT

    def _front(self) -> Array:
        """The numbers of the designs on the Pareto front."""
        first, second = (
            self.of[name] * (1.0 if goal == 'least' else -1.0)
            for name, goal in self.study.goals.items()
        )
        rows = np.flatnonzero(self.good & np.isfinite(first + second))
        rows = rows[np.lexsort((second[rows], first[rows]))]
        best_before = np.minimum.accumulate(np.append(np.inf, second[rows]))[:-1]
        return np.asarray(rows[second[rows] < best_before])

    def require_good(self) -> None:
        """Refuses a study without a good design.

        Raises:
            ConfigurationError: No design is left; the message counts the designs that meet each
                constraint.
        """
        if not self.good.any():
            counts = ''.join(f', {x.sum()} have {words}' for words, x in self._held.items())
            raise ConfigurationError(
                f'no designs are left: of {len(self.good)}, {(self._turns == 1).sum()} turn'
                f'{counts}; change the ranges or the constraints'
            )

    def summary(self) -> str:
        """The number of designs with each outcome."""
        counts = [f'{(self.outcomes == x).sum()} {x}' for x in OUTCOMES if x in self.outcomes]
        return f'{len(self.good)} designs: {", ".join(counts)}'

    def spread(self, measure: str) -> Array:
        """The values of a measure for the good designs that have it."""
        values: Array = self.of[measure][self.good]
        return values[np.isfinite(values)]

    def lines(self) -> Iterator[str]:
        """Range and base of each measure, and the parameter that explains most of its variance."""
        for name, base in self.base.items():
            if len(values := self.spread(name)):
                span = f'{values.min():.5g} to {values.max():.5g} {MEASURES[name].unit}'.rstrip()
                yield f'{name}: {span}, base {base:.5g}{self._cause(name)}'

    def _cause(self, name: str) -> str:
        """The parameter with the largest share of a measure's variance, by its correlation."""
        table = np.column_stack([self.study.designs, self.of[name]])
        table = table[self.good & np.isfinite(self.of[name])]
        if not np.ptp(table, axis=0).all():
            return ''
        shares = np.corrcoef(table, rowvar=False)[-1, :-1] ** 2
        most = self.study.columns[int(shares.argmax())].name
        return f', {100 * shares.max():.0f} % of its variance by {most}'

    def head(self) -> list[str]:
        """Names and units of the columns of the table."""
        units = {leaf.name: leaf.quantity.unit for leaf in self.study.columns}
        units |= {name: MEASURES[name].unit for name in self.of}
        return ['design', *(f'{name} [{unit}]' for name, unit in units.items()), 'outcome']

    def rows(self) -> Iterator[list[object]]:
        """Rows of the table for the measured designs; missing values are None."""
        table = np.column_stack([self.study.designs, *self.of.values()])
        cells = np.where(np.isnan(table), None, table)  # type: ignore[call-overload]
        for row in np.flatnonzero(np.isfinite(self._turns)).tolist():
            yield [row + 1, *cells[row].tolist(), self.outcomes[row]]
