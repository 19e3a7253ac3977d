# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_chart sweep: many designs of one mechanism."""

from __future__ import annotations

import argparse
import os
import sys
from functools import partial
from pathlib import Path

import numpy as np

from linkage_ros.lab.charts.sweep import draw_sweep
from linkage_ros.lab.commands.output import folder
from linkage_ros.lab.sweep.measures import measure
from linkage_ros.lab.sweep.results import Results
from linkage_ros.lab.sweep.spread import cluster, processes, spread
from linkage_ros.lab.sweep.study import read_study
from linkage_ros.progress import progress_bar

_BLOCK = 2048  # designs that a worker gets at a time, however many workers there are


def sweep(options: argparse.Namespace) -> None:
    """Measures the designs of a study, draws them and writes their table.

    Args:
        options: Options of the command line.

    Raises:
        ConfigurationError: The study, the cluster or the folder cannot be used, or no design is
            left.
        KeyboardInterrupt: After Ctrl-C; the table holds the designs that were measured.
    """
    study = read_study(options.study)
    name, count = Path(options.study).stem, len(study.designs)
    table, picture = options.out / f'{name}.csv', options.out / f'{name}.png'
    work = partial(measure, study.task)
    (base,) = work(np.array([[column.base for column in study.columns.values()]]))
    starts = range(0, count, _BLOCK)
    blocks = [study.designs[start : start + _BLOCK] for start in starts]
    connect = partial(processes, min(options.workers or os.cpu_count() or 1, len(blocks)))
    if options.scheduler is not None:
        connect = partial(cluster, options.scheduler)
    found = np.full((count, 1 + len(study.task.measures)), np.nan)
    with folder(options.out):
        try:
            with progress_bar(total=count, desc='sweep', unit=' designs') as bar:
                for i, rows in spread(work, blocks, connect):
                    found[starts[i] : starts[i] + len(rows)] = rows
                    bar.update(len(rows))
        finally:
            results = Results(study, base, found)
            measured = int(results.measured.sum())
            if measured:
                results.save(table)
            if 0 < measured < count:
                print(f'{measured} of {count} designs are in {table}', file=sys.stderr)
        results.require_good()
        draw_sweep(results, name, picture)
    print(results.summary(), *results.lines(), table, picture, sep='\n')
