# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_chart sweep: many designs of one mechanism."""

from __future__ import annotations

import argparse
import os
import sys
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from linkage_ros.lab.charts.axes import chart
from linkage_ros.lab.commands.output import folder, save_csv
from linkage_ros.lab.sweep.measures import MEASURES, measure
from linkage_ros.lab.sweep.results import FRONT, OUTSIDE, VALID, Results
from linkage_ros.lab.sweep.spread import cluster, processes, spread
from linkage_ros.lab.sweep.study import read_study
from linkage_ros.palette import BLUE, GREY, SKY, VERMILION, fractions
from linkage_ros.progress import progress_bar

_BLOCK = 2048  # designs per block, independent of the number of workers
_HEIGHT = 4.6  # inches
_MARGIN = 0.08  # margin, relative to the span of the good designs
_LOOKS: dict[str, dict[str, Any]] = {
    OUTSIDE: {'color': fractions(GREY), 's': 4, 'alpha': 0.5},
    VALID: {'color': fractions(SKY), 's': 6},
    FRONT: {'color': fractions(BLUE), 's': 22},
}


def sweep(options: argparse.Namespace) -> None:
    """Measures the designs of a study, writes their table, and draws their Pareto front.

    Args:
        options: Options of the command line.

    Raises:
        ConfigurationError: The study, the cluster or the folder cannot be used, or no design is
            left.
        KeyboardInterrupt: After Ctrl-C; the table holds the designs that were measured.
    """
    study = read_study(options.study)
    name, count = Path(options.study).stem, len(study.designs)
    table, picture = (options.out / f'{name}.{suffix}' for suffix in ('csv', 'png'))
    work = partial(measure, study.task)
    (base,) = work(np.array([[leaf.default for leaf in study.columns]]))
    starts = range(0, count, _BLOCK)
    blocks = [study.designs[start : start + _BLOCK] for start in starts]
    connect = partial(processes, min(options.workers or os.cpu_count() or 1, len(blocks)))
    if options.scheduler is not None:
        connect = partial(cluster, options.scheduler)
    found = np.full((count, len(base)), np.nan)
    with folder(options.out):
        try:
            with progress_bar(total=count, desc='sweep', unit=' designs') as bar:
                for i, rows in spread(work, blocks, connect):
                    found[starts[i] : starts[i] + len(rows)] = rows
                    bar.update(len(rows))
        finally:
            results, measured = Results(study, base, found), int(np.isfinite(found[:, 0]).sum())
            if measured:
                save_csv(table, results.head(), results.rows())
            if 0 < measured < count:
                print(f'{measured} of {count} designs are in {table}', file=sys.stderr)
        results.require_good()
        files = [table]
        if study.goals:
            files.append(picture)
            _draw_front(results, name, picture)
    print(results.summary(), *results.lines(), *files, sep='\n')


def _draw_front(results: Results, name: str, path: Path) -> None:
    """Draws one goal of all designs against the other."""
    goals = [*results.study.goals]
    with chart(path, _HEIGHT, f'{name}: {results.summary()}') as figure:
        axes = figure.add_subplot()
        for outcome, look in _LOOKS.items():
            x, y = (results.of[goal][results.outcomes == outcome] for goal in goals)
            axes.scatter(x, y, label=outcome, linewidths=0, **look)
        base: dict[str, Any] = {'color': fractions(VERMILION), 'markersize': 11, 'label': 'base'}
        axes.plot(*(results.base[goal] for goal in goals), '*', **base)
        for axis, goal in zip('xy', goals, strict=True):
            # Designs outside the constraints may lie far away.
            values = np.append(results.spread(goal), results.base[goal])
            low, high = np.nanmin(values), np.nanmax(values)
            margin = _MARGIN * (high - low) or 1.0
            words = f'{goal.replace("_", " ").capitalize()}, {MEASURES[goal].unit}'
            label = words.removesuffix(', ')
            axes.set(**{f'{axis}lim': (low - margin, high + margin), f'{axis}label': label})
        axes.legend(frameon=True)
