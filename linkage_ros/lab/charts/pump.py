# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a wind pump settles at, as a picture: its panels, and the numbers below them."""

from __future__ import annotations

from pathlib import Path

from matplotlib.figure import Figure
from matplotlib.transforms import blended_transform_factory

from linkage_ros.lab.charts.pump_load import draw_load_curve, draw_torques
from linkage_ros.lab.charts.pump_motions import (
    draw_basins,
    draw_phase_plane,
    draw_runs,
    draw_section,
)
from linkage_ros.lab.charts.pump_states import add_panel, state_colors
from linkage_ros.lab.charts.sizes import DPI, NUMBERS, TITLE, WIDTH
from linkage_ros.lab.pump.pump import Analysis
from linkage_ros.lab.pump.states_table import states_table


def draw_pump(analysis: Analysis, title: str, path: Path) -> None:
    """Draws settled motions, how they are reached, and what they come to under other torques.

    Args:
        analysis: Of a pump.
        title: Of the picture.
        path: The PNG file; replaced if there is one.

    Raises:
        OSError: The picture cannot be written.
    """
    figure = Figure(figsize=(WIDTH, 13.0), dpi=DPI, layout='constrained')
    figure.suptitle(title, fontsize=TITLE)
    cells = figure.add_gridspec(4, 2, height_ratios=(1, 1, 1, 0.29))
    colors = state_colors(analysis)
    draw_phase_plane(add_panel(figure, cells[0, 0], 'Settled motions'), analysis, colors)
    draw_section(
        add_panel(figure, cells[0, 1], 'Poincaré section at crank angle 0, turn by turn'),
        analysis, colors,
    )  # fmt: skip
    draw_basins(add_panel(figure, cells[1, 0], 'Where starts settle'), analysis, colors)
    draw_load_curve(add_panel(figure, cells[2, 0], 'Load curve and motor line'), analysis, colors)
    draw_torques(figure, cells[2, 1], analysis, colors)
    draw_runs(add_panel(figure, cells[1, 1], 'Crank speed from single starts'), analysis, colors)
    table = figure.add_subplot(cells[3, :])
    table.axis('off')
    words = table.text(
        0.5, 1, '\n'.join(states_table(analysis)), va='top', ha='center', family='monospace',
        multialignment='left', fontsize=NUMBERS, linespacing=1.35,
        transform=blended_transform_factory(figure.transFigure, table.transAxes),
    )  # fmt: skip
    words.set_in_layout(False)  # it is as wide as the picture
    figure.savefig(path)
