# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How the settled states of a pump look in every panel: colour, mark and name."""

from __future__ import annotations

import itertools
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.gridspec import SubplotSpec

from linkage_ros.lab.charts.page import Shade
from linkage_ros.lab.charts.sizes import SMALL, TEXT
from linkage_ros.lab.pump.periodic import PeriodicMotion
from linkage_ros.lab.pump.pump import Analysis
from linkage_ros.palette import BLACK, DARK, FIRST, GREY, SECOND, fractions, mixed

# Stable states by growing speed; the unstable are grey and dashed.
_STABLE = tuple(
    map(fractions, (FIRST, SECOND, mixed(FIRST, BLACK, 0.6), mixed(SECOND, BLACK, 0.6)))
)
UNSTABLE, AVERAGED, REST = map(fractions, (DARK, BLACK, GREY))


def state_colors(analysis: Analysis) -> list[Shade]:
    """One for each state."""
    stable = itertools.cycle(_STABLE)
    return [next(stable) if state.stable else UNSTABLE for state in analysis.states]


def state_style(state: PeriodicMotion, color: Shade) -> dict[str, Any]:
    """A filled mark for a stable state, a hollow one for an unstable one."""
    return {
        'marker': 'o', 'markersize': 9, 'linestyle': 'none', 'markeredgewidth': 1.8,
        'markeredgecolor': 'black' if state.stable else color, 'zorder': 6,
        'markerfacecolor': color if state.stable else 'white',
    }  # fmt: skip


def state_name(state: PeriodicMotion) -> str:
    """Its mean speed."""
    return f'{state.speed:.4g} rad/s{"" if state.stable else ", unstable"}'


def add_panel(figure: Figure, cell: SubplotSpec, title: str) -> Axes:
    """A panel of the picture, with a grid behind what is drawn."""
    axes = figure.add_subplot(cell)
    axes.set_title(title, fontsize=TEXT)
    axes.grid(color='0.9', linewidth=0.6)
    axes.set_axisbelow(True)
    return axes


def label_axes(axes: Axes, x: str, y: str) -> None:
    """Writes what is on the axes."""
    axes.set_xlabel(x, fontsize=TEXT)
    axes.set_ylabel(y, fontsize=TEXT)


def legend_below(axes: Axes, **options: Any) -> None:
    """A legend below the panel, where it hides nothing."""
    axes.legend(
        fontsize=SMALL, title_fontsize=SMALL, ncols=2, frameon=False, columnspacing=1.2,
        loc='upper center', bbox_to_anchor=(0.5, -0.16), borderpad=0, **options,
    )  # fmt: skip
