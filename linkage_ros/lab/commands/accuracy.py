# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_chart accuracy: every method of solving, speed against accuracy."""

from __future__ import annotations

import argparse

from linkage_ros.lab.commands.output import about, folder, progress, save_records


def accuracy(options: argparse.Namespace) -> None:
    """Measures speed and accuracy of all methods, draws them and writes the records.

    Args:
        options: Options of the command line.

    Raises:
        ConfigurationError: The folder cannot be written.
    """
    from linkage_ros.lab.charts.accuracy import draw_accuracy
    from linkage_ros.lab.methods.accuracy import linkages, measure_accuracy, motions
    from linkage_ros.lab.methods.registry import INTEGRATORS, METHODS

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
    print(records, *pictures, sep='\n')
