# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Panels of a pump's settled motions over time and turns: where they run, what leads to them."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.patches import Patch

from linkage_ros.lab.charts.page import Shade
from linkage_ros.lab.charts.pump_states import (
    AVERAGED,
    REST,
    label_axes,
    legend_below,
    state_name,
    state_style,
)
from linkage_ros.lab.charts.sizes import SMALL, TEXT
from linkage_ros.lab.pump.basins import ELSEWHERE, LEAVES
from linkage_ros.lab.pump.pump import Analysis
from linkage_ros.lab.pump.runs import Run
from linkage_ros.palette import BLACK, WHITE, fractions

_MARKERS = 'osD^v<>'
_PARTS = 256  # of a turn


def draw_phase_plane(axes: Axes, analysis: Analysis, colors: list[Shade]) -> None:
    """The slider's settled motions, exact and averaged."""
    for state, color in zip(analysis.states, colors, strict=True):
        course = analysis.poincare.orbit(np.array([state.point]).T, state.torque, _PARTS)[..., 0]
        line = '-' if state.stable else '--'
        axes.plot(course[0], course[1], line, color=color, linewidth=2.2, label=state_name(state))
        axes.plot(*state.point[:2], **state_style(state, color))
    angle = np.linspace(0, 2 * math.pi, _PARTS)
    for number, one in enumerate(analysis.averaged_states):
        axes.plot(
            one.mean + one.cosine * np.cos(angle) + one.sine * np.sin(angle),
            one.speed * (one.sine * np.cos(angle) - one.cosine * np.sin(angle)),
            ':', color=AVERAGED, linewidth=1.8, label='' if number else 'averaged, one harmonic',
        )  # fmt: skip
    label_axes(axes, 'Slider position xD, m', "Slider velocity xD', m/s")
    if analysis.states:
        legend_below(axes)
    else:
        words = 'no settled motion found'
        axes.text(0.5, 0.5, words, ha='center', transform=axes.transAxes, fontsize=TEXT)


def draw_section(axes: Axes, analysis: Analysis, colors: list[Shade]) -> None:
    """The passages of single runs through crank angle 0."""
    for (run, color), marker in zip(
        _runs(analysis, colors), itertools.cycle(_MARKERS), strict=False
    ):
        x, w = run.passages[:, 1], run.passages[:, 3]
        axes.plot(x, w, '-', color=color, linewidth=0.5, alpha=0.6)
        axes.plot(x, w, marker, color=color, markersize=4.5, alpha=0.8, label=run.name)
        axes.plot(x[0], w[0], marker, color=color, markersize=10, markerfacecolor='white')
    for state, color in zip(analysis.states, colors, strict=True):
        axes.plot(state.point[0], state.point[2], **state_style(state, color))
    label_axes(axes, 'Slider position xD, m', "Crank speed phi1', rad/s")
    legend_below(axes, title='from, with the larger hollow mark:')


def draw_basins(axes: Axes, analysis: Analysis, colors: list[Shade]) -> None:
    """The grid of starts, each in the colour of the state that it settles at."""
    basins = analysis.basins
    fills: list[Shade] = [fractions(WHITE), fractions(BLACK), *(_tint(color) for color in colors)]
    norm = BoundaryNorm(np.arange(ELSEWHERE, len(colors) + 1) - 0.5, len(fills))
    axes.pcolormesh(
        basins.speeds, basins.velocities, basins.outcomes, cmap=ListedColormap(fills), norm=norm,
        shading='nearest', rasterized=True,
    )  # fmt: skip
    words = {LEAVES: 'coupler, rod in line', ELSEWHERE: 'elsewhere or not yet'}
    outcomes = [*range(len(colors)), LEAVES, ELSEWHERE]
    handles = [
        Patch(
            facecolor=fills[outcome - ELSEWHERE], edgecolor='black', linewidth=0.6,
            label=f'{words.get(outcome) or state_name(analysis.states[outcome])}: '
            f'{basins.share(outcome):.0%}',
        )
        for outcome in outcomes
        if basins.share(outcome)
    ]  # fmt: skip
    for run in analysis.runs:
        _, position, velocity, speed = run.passages[0]
        if position == basins.position:
            axes.plot(speed, velocity, 'o', color='black', markerfacecolor='white', markersize=8)
    legend_below(axes, handles=handles)
    axes.grid(visible=False)
    label_axes(
        axes, "Crank speed phi1' at the start, rad/s", "Slider velocity xD' at the start, m/s"
    )


def draw_runs(axes: Axes, analysis: Analysis, colors: list[Shade]) -> None:
    """The crank speed of single runs over time."""
    for run, color in _runs(analysis, colors):
        axes.plot(run.times, run.speeds, '-', color=color, linewidth=0.7)
        if run.ended:
            axes.plot(run.times[-1], run.speeds[-1], 'X', color='black', markersize=9)
    for state in analysis.states:
        axes.axhline(
            state.speed, color='black', linewidth=1, linestyle='-' if state.stable else '--'
        )
        axes.annotate(
            state_name(state), (0.98, state.speed), xycoords=('axes fraction', 'data'), ha='right',
            xytext=(0, 9), textcoords='offset points', fontsize=SMALL,
            color='0.2', weight='bold',
        )  # fmt: skip
    axes.margins(y=0.1)
    axes.set_xlim(0, None)
    label_axes(axes, 'Time, s', "Crank speed phi1', rad/s")


def _runs(analysis: Analysis, colors: list[Shade]) -> Iterator[tuple[Run, Shade]]:
    """The runs, with the colours of the states at which they end."""
    for run, end in zip(analysis.runs, analysis.ends, strict=True):
        yield run, colors[end] if end >= 0 else REST


def _tint(color: Shade) -> Shade:
    red, green, blue = (0.45 + 0.55 * part for part in color)
    return red, green, blue
