# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_chart stability: every method of solving, where some of them fail."""

from __future__ import annotations

import argparse

from linkage_ros.lab.commands.output import folder, progress, save_records


def stability(options: argparse.Namespace) -> None:
    """Runs all methods through all situations, draws what comes of it and writes the records.

    Args:
        options: Options of the command line.

    Raises:
        ConfigurationError: The folder cannot be written.
    """
    from linkage_ros.lab.charts.stability import draw_stability
    from linkage_ros.lab.methods.motion_situations import MOTION_SITUATIONS
    from linkage_ros.lab.methods.outcomes import measure_outcomes
    from linkage_ros.lab.methods.registry import INTEGRATORS, METHODS
    from linkage_ros.lab.methods.situations import SITUATIONS

    records, picture = options.out / 'stability.json', options.out / 'stability.png'
    with folder(options.out):
        cases = 2 if options.quick else 30
        grids = [
            measure_outcomes(situations, methods, cases=cases, progress=progress)
            for situations, methods in ((SITUATIONS, METHODS), (MOTION_SITUATIONS, INTEGRATORS))
        ]
        save_records(records, [cell.record() for cells in grids for cell in cells])
        title = (
            'Outcome of each method in each situation\n'
            f'the worst of {cases} cases, or of a few motions, and the largest relative error'
        )
        draw_stability(grids[0], grids[1], title, picture)
    print(records, picture, sep='\n')
