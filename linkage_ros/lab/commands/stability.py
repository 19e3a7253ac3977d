# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_chart stability: every method of solving, where some of them fail."""

from __future__ import annotations

import argparse

from linkage_ros.lab.commands.output import folder, progress, save_records
from linkage_ros.lab.commands.presets import moving_presets


def stability(options: argparse.Namespace) -> None:
    """Runs all methods through all situations, draws what comes of it and writes the records.

    Args:
        options: Options of the command line.

    Raises:
        ConfigurationError: The folder cannot be written.
    """
    from linkage_ros.lab.charts.stability import draw_stability
    from linkage_ros.lab.methods.motion_outcomes import measure_motion_outcomes
    from linkage_ros.lab.methods.outcomes import measure_outcomes
    from linkage_ros.lab.methods.situations import SITUATIONS

    movers = moving_presets()
    records, picture = options.out / 'stability.json', options.out / 'stability.png'
    with folder(options.out):
        cases = 2 if options.quick else 30
        cells = measure_outcomes(SITUATIONS, cases=cases, progress=progress)
        moved = measure_motion_outcomes(movers, cases=cases, progress=progress)
        save_records(records, [cell.record() for cell in (*cells, *moved)])
        title = (
            'Outcome of each method in each situation\n'
            f'the worst of {cases} cases, or of a few motions, and the largest relative error'
        )
        draw_stability(cells, moved, title, picture)
    print(records, picture, sep='\n')
