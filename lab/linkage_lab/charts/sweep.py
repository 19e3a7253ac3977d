# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_chart sweep: measures many designs of one mechanism."""

import argparse
import os
import sys
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from linkage_lab.output import chart, doubts, new_file, pictures, save_csv
from linkage_lab.sweep.designs import CANNOT_TURN, REFUSED, REVERSES, TURNS, measured
from linkage_lab.sweep.measures import MEASURES
from linkage_lab.sweep.spread import cluster, processes, spread
from linkage_lab.sweep.study import Study, read_study
from linkage_ros import ConfigurationError, cli
from linkage_ros.cli import progress_bar
from linkage_ros.formulas import Array
from linkage_ros.palette import BLUE, GREY, SKY, VERMILION, fractions
from linkage_ros.quantities import counted

LIMITED, STUCK, UNFIT, REVERSING, OUTSIDE, VALID, FRONT = OUTCOMES = (
    'cannot turn', 'cannot move so far', 'a spring or load curve does not fit',
    'reverses inside a stroke with valves', 'outside the constraints', 'valid',
    'on the Pareto front',
)  # fmt: skip
_BLOCK = 2048  # designs per block, independent of the number of workers
_LOOKS: dict[str, dict[str, Any]] = {
    OUTSIDE: {'color': fractions(GREY), 's': 4, 'alpha': 0.5},
    VALID: {'color': fractions(SKY), 's': 6},
    FRONT: {'color': fractions(BLUE), 's': 22},
}


def sweep(options: argparse.Namespace) -> None:
    """Measures the designs of a study, writes their table, and draws their Pareto front.

    Raises:
        ConfigurationError: The study, the cluster or a file cannot be used, or no design meets
            all constraints.
        KeyboardInterrupt: Ctrl-C was pressed; the table holds the designs measured so far.
    """
    study = read_study(options.study)
    name, count = Path(options.study).stem, len(study.designs)
    table, drawn = new_file(options, options.out / f'{name}.csv'), pictures(options, name)
    cli.print_notes(doubts(study.base))
    (base,) = measured(study.task, np.array([[leaf.default for leaf in study.columns]]))
    measures = np.full((count, len(base)), np.nan)
    try:
        _measure(study, options, measures)
    finally:
        results, done = _Results(study, base, measures), int(np.isfinite(measures[:, 0]).sum())
        if 0 < done < count:
            table = table.with_stem(f'{name}_unfinished')
            print(f'{done} of {count} designs are in {table}', file=sys.stderr)
        if done:
            save_csv(table, *results.table())
    if not results.good.any():
        raise ConfigurationError(
            f'no design is left of {results.summary}; change the ranges or the constraints'
        )
    if study.goals:
        _draw_front(results, name, drawn)
    written = [table, *drawn] if study.goals else [table]
    if options.json:
        files = [*map(str, written)]
        cli.print_json({'text': [results.summary, *results.lines()], 'files': files})
    else:
        print(results.summary, *results.lines(), *written, sep='\n')


def _measure(study: Study, options: argparse.Namespace, measures: Array) -> None:
    """Measures the designs of a study in blocks, each on the first free worker.

    `measures` receives the result of `measured` for each design, as it arrives.

    Raises:
        ConfigurationError: The cluster cannot be used, or workers died repeatedly.
    """
    count = len(study.designs)
    blocks = np.split(study.designs, range(_BLOCK, count, _BLOCK))
    if options.scheduler is not None:
        connect = partial(cluster, options.scheduler)
    else:
        connect = partial(processes, min(options.workers or os.cpu_count() or 1, len(blocks)))
    with progress_bar(total=count, desc='sweep', unit=' designs') as bar:
        for i, rows in spread(partial(measured, study.task), blocks, connect):
            measures[i * _BLOCK : i * _BLOCK + len(rows)] = rows
            bar.update(len(rows))


class _Results:
    """Measures and outcomes of all designs.

    Attributes:
        study: Study that contains the designs.
        base: Measures of the base design by name; NaN for a measure that does not apply to it.
        of: Measures of the designs by name; NaN for a measure that does not apply to a design.
        good: Whether each design turns fully and meets all constraints.
        outcomes: One of OUTCOMES for each design.
        summary: The number of designs with each outcome.
    """

    def __init__(self, study: Study, base: Array, measures: Array) -> None:
        """Assigns an outcome to each design.

        `base` and `measures` are results of `measured`, NaN for designs not yet measured.
        """
        self.study, self._turns = study, measures[:, 0]
        self.base = dict(zip(study.task.measures, base[1:].tolist(), strict=True))
        self.of = dict(zip(study.task.measures, measures.T[1:], strict=True))
        self.good = self._turns == TURNS
        for name, (low, high) in study.constraints.items():
            self.good &= (self.of[name] >= low) & (self.of[name] <= high)
        self.outcomes = np.where(self.good, VALID, OUTSIDE).astype(object)
        self.outcomes[self._turns == CANNOT_TURN] = STUCK if study.task.prescribed else LIMITED
        self.outcomes[self._turns == REFUSED] = UNFIT
        self.outcomes[self._turns == REVERSES] = REVERSING
        if study.goals:
            self.outcomes[self._front()] = FRONT
        counts = [f'{(self.outcomes == x).sum()} {x}' for x in OUTCOMES if x in self.outcomes]
        self.summary = f'{counted(len(measures), "design")}: {", ".join(counts)}'

    def _front(self) -> Array:
        """Returns the indices of the designs on the Pareto front."""
        first, second = (  # both to be minimised
            self.of[name] * (1.0 if goal == 'least' else -1.0)
            for name, goal in self.study.goals.items()
        )
        candidates = np.flatnonzero(self.good & np.isfinite(first + second))
        ordered = candidates[np.lexsort((second[candidates], first[candidates]))]  # by the first
        best_before = np.minimum.accumulate(np.append(np.inf, second[ordered]))[:-1]
        return np.asarray(ordered[second[ordered] < best_before])

    def lines(self) -> Iterator[str]:
        """Yields a line for each measure that applies to any good design.

        It gives the range, the value of the base design, and the parameter that explains most of
        the variance.
        """
        for name, base in self.base.items():
            applies = self.good & np.isfinite(self.of[name])
            if not applies.any():
                continue
            # The parameters, and in the last column the measure.
            table = np.column_stack([self.study.designs, self.of[name]])[applies]
            low, high = table[:, -1].min(), table[:, -1].max()
            span = f'{low:.5g} to {high:.5g} {MEASURES[name].unit}'.rstrip()
            line = f'{name}: {span}, base {base:.5g}'
            if np.ptp(table, axis=0).all():
                correlations = np.atleast_2d(np.corrcoef(table, rowvar=False))[-1, :-1]
                shares = correlations**2
                cause = self.study.columns[int(shares.argmax())].name
                line += f', {100 * shares.max():.0f} % of its variance by {cause}'
            yield line

    def table(self) -> tuple[list[str], list[list[object]]]:
        """Returns column titles, and a row for each measured design; missing values are None."""
        units = {leaf.name: leaf.quantity.unit for leaf in self.study.columns}
        units |= {name: MEASURES[name].unit for name in self.of}
        head = ['design', *(f'{name} [{unit}]' for name, unit in units.items()), 'outcome']
        table = np.column_stack([self.study.designs, *self.of.values()])
        cells = np.where(np.isnan(table), None, table)  # type: ignore[call-overload]
        measured = np.flatnonzero(np.isfinite(self._turns)).tolist()
        return head, [[i + 1, *cells[i].tolist(), self.outcomes[i]] for i in measured]


def _draw_front(results: _Results, name: str, files: Sequence[Path]) -> None:
    """Plots the two goals of all designs against each other."""
    first, second = results.study.goals
    with chart(files, 4.6, f'{name}: {results.summary}') as figure:
        axes = figure.add_subplot()
        for outcome, look in _LOOKS.items():
            x, y = (results.of[goal][results.outcomes == outcome] for goal in (first, second))
            axes.scatter(x, y, label=outcome, linewidths=0, **look)
            if outcome == OUTSIDE:  # designs outside the constraints may lie far away
                axes.ignore_existing_data_limits = True
        base: dict[str, Any] = {'color': fractions(VERMILION), 'markersize': 11, 'label': 'base'}
        axes.plot(results.base[first], results.base[second], '*', **base)
        axes.margins(0.08)
        axes.set(xlabel=_label(first), ylabel=_label(second))
        axes.legend(frameon=True)


def _label(measure: str) -> str:
    """Describes a measure, with its unit if it has one."""
    return f'{measure.replace("_", " ").capitalize()}, {MEASURES[measure].unit}'.removesuffix(', ')
