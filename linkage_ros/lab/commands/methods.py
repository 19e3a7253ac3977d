# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_chart accuracy and stability: all methods, and where some of them fail."""

from __future__ import annotations

import argparse
from dataclasses import asdict

from linkage_ros.lab.charts import stability as stability_chart
from linkage_ros.lab.charts.accuracy import draw_accuracy
from linkage_ros.lab.charts.follow import draw_follow
from linkage_ros.lab.commands.output import about, folder, progress, save_records
from linkage_ros.lab.methods.accuracy import linkages, measure_accuracy, motions
from linkage_ros.lab.methods.follow_accuracy import FollowBench, measure_follow
from linkage_ros.lab.methods.outcomes import measure_outcomes
from linkage_ros.lab.methods.registry import INTEGRATORS, METHODS


def accuracy(options: argparse.Namespace) -> None:
    """Measures speed and accuracy of all methods, draws them and writes the records.

    Args:
        options: Options of the command line.

    Raises:
        ConfigurationError: The folder cannot be written.
    """
    quick = options.quick
    with folder(options.out):
        solved, moved = (
            measure_accuracy(benches, methods, quick=quick, progress=progress)
            for benches, methods in (
                (linkages(quick=quick), METHODS), (motions(quick=quick), INTEGRATORS),
            )
        )  # fmt: skip
        records = options.out / 'accuracy.json'
        save_records(records, [point.record() for point in (*solved, *moved)])
        on = ', '.join(f'{name} {value}' for name, value in about().items())
        pictures = []
        for name in progress([*dict.fromkeys(p.mechanism for p in solved), 'motions'], 'pictures'):
            points = [p for p in solved if p.mechanism == name] or moved
            what = name.replace('_', '-') if points is not moved else 'motions under a torque'
            pictures.append(options.out / f'accuracy_{name.replace(" ", "_")}.png')
            draw_accuracy(points, f'Speed against accuracy: {what}\n{on}', pictures[-1])
        bench = FollowBench()
        errors = measure_follow(bench, quick=quick, progress=progress)
        followed, picture = (options.out / f'accuracy_follow.{kind}' for kind in ('json', 'png'))
        save_records(followed, [one._asdict() for one in errors])
        slowest, fastest = bench.rpm
        words = f'quadrilateral, {slowest:.0f} to {fastest:.0f} rpm, measured at 1 kHz'
        draw_follow(errors, f'Torque of a crank that is measured: {words}', picture)
    print(records, *pictures, followed, picture, sep='\n')


def stability(options: argparse.Namespace) -> None:
    """Runs all methods in all situations, draws the outcomes and writes the records.

    Args:
        options: Options of the command line.

    Raises:
        ConfigurationError: The folder cannot be written.
    """
    records, picture = options.out / 'stability.json', options.out / 'stability.png'
    with folder(options.out):
        cases = 2 if options.quick else 30
        cells = [
            cell for methods, situations in stability_chart.GRIDS
            for cell in measure_outcomes(situations, methods, cases=cases, progress=progress)
        ]  # fmt: skip
        save_records(records, [asdict(cell) for cell in cells])
        title = (
            'Outcome of each method in each situation\n'
            f'the worst of {cases} cases, or of a few motions, and the largest relative error'
        )
        stability_chart.draw_stability(cells, title, picture)
    print(records, picture, sep='\n')
