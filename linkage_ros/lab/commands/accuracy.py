# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_chart accuracy: every method of solving, speed against accuracy."""

from __future__ import annotations

import argparse

from linkage_ros.lab.commands.output import about, folder, progress, save_records
from linkage_ros.lab.commands.presets import moving_presets, solved_presets


def accuracy(options: argparse.Namespace) -> None:
    """Measures speed and accuracy of all methods, draws them and writes the records.

    Args:
        options: Options of the command line.

    Raises:
        ConfigurationError: The folder cannot be written.
    """
    from linkage_ros.lab.charts.accuracy import draw_accuracy, draw_integration
    from linkage_ros.lab.methods.accuracy import measure_accuracy, measure_motion_accuracy, tasks
    from linkage_ros.lab.methods.bench import Bench

    movers = moving_presets()
    with folder(options.out):
        benches = {
            name: Bench(task, 36 if options.quick else 360)
            for name, task in tasks(*solved_presets()).items()
        }
        points = measure_accuracy(benches, quick=options.quick, progress=progress)
        moved = measure_motion_accuracy(movers, quick=options.quick, progress=progress)
        on = ', '.join(f'{name} {value}' for name, value in about().items())
        records = options.out / 'accuracy.json'
        save_records(records, [point.record() for point in (*points, *moved)])
        drawings = [
            (
                f'accuracy_{name.replace(" ", "_")}.png', name.replace('_', '-'), draw_accuracy,
                [point for point in points if point.mechanism == name],
            )
            for name in benches
        ]  # fmt: skip
        motions = 'accuracy_motions.png', 'motions under a torque', draw_integration, moved
        for picture, what, draw, measured in progress([*drawings, motions], 'pictures'):
            draw(measured, f'Speed against accuracy: {what}\n{on}', options.out / picture)
    pictures = [options.out / picture for picture, *_ in (*drawings, motions)]
    print(records, *pictures, sep='\n')
