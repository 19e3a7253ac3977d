# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_chart accuracy and stability: all methods, and where some of them fail."""

from __future__ import annotations

import argparse

from linkage_ros.lab.charts import stability as stability_chart
from linkage_ros.lab.charts.accuracy import draw_accuracy, draw_follow
from linkage_ros.lab.commands.output import about, folder, progress, save_records
from linkage_ros.lab.methods.accuracy import linkages, measure_accuracy, motions
from linkage_ros.lab.methods.follow_accuracy import measure_follow
from linkage_ros.lab.methods.measure import measure_outcomes
from linkage_ros.lab.methods.registry import INTEGRATORS, METHODS


def accuracy(options: argparse.Namespace) -> None:
    """Measures speed and accuracy of all methods, draws them and writes the records.

    Args:
        options: Options of the command line.

    Raises:
        ConfigurationError: The folder cannot be written.
    """
    out, quick = options.out, options.quick
    with folder(out):
        solved, moved = (
            measure_accuracy(cases, methods, quick=quick, progress=progress)
            for cases, methods in (
                (linkages(quick=quick), METHODS), (motions(quick=quick), INTEGRATORS),
            )
        )  # fmt: skip
        written = [out / 'accuracy.json']
        save_records(written[0], [*solved, *moved])
        on = ', '.join(f'{name} {value}' for name, value in about().items())
        for name in progress(
            [*dict.fromkeys(p['mechanism'] for p in solved), 'motions'], 'pictures'
        ):
            points = [p for p in solved if p['mechanism'] == name] or moved
            what = name.replace('_', '-') if points is not moved else 'motions under a torque'
            written.append(out / f'accuracy_{name.replace(" ", "_")}.png')
            draw_accuracy(points, f'Speed against accuracy: {what}\n{on}', written[-1])
        errors, (slowest, fastest) = measure_follow(quick=quick, progress=progress)
        written += (out / 'accuracy_follow.json', out / 'accuracy_follow.png')
        save_records(written[-2], errors)
        words = f'quadrilateral, {slowest:.0f} to {fastest:.0f} rpm, measured at 1 kHz'
        draw_follow(errors, f'Torque of a crank that is measured: {words}', written[-1])
    print(*written, sep='\n')


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
        save_records(records, cells)
        title = (
            'Outcome of each method in each situation\n'
            f'the worst of {cases} cases, or of a few motions, and the largest relative error'
        )
        stability_chart.draw_stability(cells, title, picture)
    print(records, picture, sep='\n')
