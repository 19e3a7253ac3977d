# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a wind pump settles at, as a picture."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.gridspec import SubplotSpec
from matplotlib.patches import Patch
from matplotlib.transforms import blended_transform_factory

from linkage_ros.analysis.basins import ELSEWHERE, LEAVES
from linkage_ros.analysis.periodic import PeriodicMotion
from linkage_ros.analysis.pump import Analysis
from linkage_ros.analysis.table import write_table
from linkage_ros.charts.sizes import DPI, NUMBERS, SMALL, TEXT, TITLE, WIDTH
from linkage_ros.core.numeric import TWO_PI
from linkage_ros.palette import BLACK, DARK, FIRST, GREY, SECOND, WHITE, fractions, mixed

_Shade: TypeAlias = tuple[float, float, float]
# Stable states by growing speed; the unstable are grey and dashed.
_STABLE = tuple(
    map(fractions, (FIRST, SECOND, mixed(FIRST, BLACK, 0.6), mixed(SECOND, BLACK, 0.6)))
)
_UNSTABLE, _AVERAGED, _MOTOR, _REST = map(fractions, (DARK, BLACK, BLACK, GREY))
_MARKERS = 'osD^v<>'
_PARTS = 256  # of a turn


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
    colors = _colors(analysis)
    _draw_phase_plane(_panel(figure, cells[0, 0], 'Settled motions'), analysis, colors)
    _draw_section(
        _panel(figure, cells[0, 1], 'Poincaré section at crank angle 0, turn by turn'),
        analysis, colors,
    )  # fmt: skip
    _draw_basins(_panel(figure, cells[1, 0], 'Where starts settle'), analysis, colors)
    _draw_load(_panel(figure, cells[2, 0], 'Load curve and motor line'), analysis, colors)
    _draw_torques(figure, cells[2, 1], analysis, colors)
    _draw_runs(_panel(figure, cells[1, 1], 'Crank speed from single starts'), analysis, colors)
    table = figure.add_subplot(cells[3, :])
    table.axis('off')
    words = table.text(
        0.5, 1, '\n'.join(write_table(analysis)), va='top', ha='center', family='monospace',
        multialignment='left', fontsize=NUMBERS, linespacing=1.35,
        transform=blended_transform_factory(figure.transFigure, table.transAxes),
    )  # fmt: skip
    words.set_in_layout(False)  # it is as wide as the picture
    figure.savefig(path)


def _panel(figure: Figure, cell: SubplotSpec, title: str) -> Axes:
    axes = figure.add_subplot(cell)
    axes.set_title(title, fontsize=TEXT)
    axes.grid(color='0.9', linewidth=0.6)
    axes.set_axisbelow(True)
    return axes


def _label(axes: Axes, x: str, y: str) -> None:
    axes.set_xlabel(x, fontsize=TEXT)
    axes.set_ylabel(y, fontsize=TEXT)


def _legend(axes: Axes, columns: int, **options: Any) -> None:
    """Below, where it hides nothing."""
    axes.legend(
        fontsize=SMALL, title_fontsize=SMALL, ncols=columns, frameon=False, columnspacing=1.2,
        loc='upper center', bbox_to_anchor=(0.5, -0.16), borderpad=0, **options,
    )  # fmt: skip


def _colors(analysis: Analysis) -> list[_Shade]:
    """One for each state."""
    stable = iter(_STABLE * len(analysis.states))
    return [next(stable) if state.stable else _UNSTABLE for state in analysis.states]


def _style(state: PeriodicMotion, color: _Shade) -> dict[str, Any]:
    """A filled mark for a stable state, a hollow one for an unstable one."""
    return {
        'marker': 'o', 'markersize': 9, 'linestyle': 'none', 'markeredgewidth': 1.8,
        'markeredgecolor': 'black' if state.stable else color, 'zorder': 6,
        'markerfacecolor': color if state.stable else 'white',
    }  # fmt: skip


def _name(state: PeriodicMotion) -> str:
    return f'{state.speed:.4g} rad/s{"" if state.stable else ", unstable"}'


def _draw_phase_plane(axes: Axes, analysis: Analysis, colors: list[_Shade]) -> None:
    for state, color in zip(analysis.states, colors, strict=True):
        course = analysis.section.orbit(np.array([state.point]).T, state.torque, _PARTS)[..., 0]
        line = '-' if state.stable else '--'
        axes.plot(course[0], course[1], line, color=color, linewidth=2.2, label=_name(state))
        axes.plot(*state.point[:2], **_style(state, color))
    angle = np.linspace(0, TWO_PI[0], _PARTS)
    for number, one in enumerate(analysis.averaged_states):
        axes.plot(
            one.mean + one.cosine * np.cos(angle) + one.sine * np.sin(angle),
            one.speed * (one.sine * np.cos(angle) - one.cosine * np.sin(angle)),
            ':', color=_AVERAGED, linewidth=1.8, label='' if number else 'averaged, one harmonic',
        )  # fmt: skip
    _label(axes, 'Slider position xD, m', "Slider velocity xD', m/s")
    if analysis.states:
        _legend(axes, 2)
    else:
        axes.text(
            0.5,
            0.5,
            'no settled motion found',
            ha='center',
            transform=axes.transAxes,
            fontsize=TEXT,
        )


def _draw_section(axes: Axes, analysis: Analysis, colors: list[_Shade]) -> None:
    for (run, color), marker in zip(_runs(analysis, colors), _MARKERS * 9, strict=False):
        x, w = run.passages[:, 1], run.passages[:, 3]
        axes.plot(x, w, '-', color=color, linewidth=0.5, alpha=0.6)
        axes.plot(x, w, marker, color=color, markersize=4.5, alpha=0.8, label=run.name)
        axes.plot(x[0], w[0], marker, color=color, markersize=10, markerfacecolor='white')
    for state, color in zip(analysis.states, colors, strict=True):
        axes.plot(state.point[0], state.point[2], **_style(state, color))
    _label(axes, 'Slider position xD, m', "Crank speed phi1', rad/s")
    _legend(axes, 2, title='from, with the larger hollow mark:')


def _runs(analysis: Analysis, colors: list[_Shade]) -> Iterator[tuple[Any, _Shade]]:
    """The runs, with the colours of the states at which they end."""
    for run, end in zip(analysis.runs, analysis.ends, strict=True):
        yield run, colors[end] if end >= 0 else _REST


def _draw_basins(axes: Axes, analysis: Analysis, colors: list[_Shade]) -> None:
    basins = analysis.basins
    fills: list[_Shade] = [fractions(WHITE), fractions(BLACK), *(_tint(color) for color in colors)]
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
            label=f'{words.get(outcome) or _name(analysis.states[outcome])}: '
            f'{basins.share(outcome):.0%}',
        )
        for outcome in outcomes
        if basins.share(outcome)
    ]  # fmt: skip
    for run in analysis.runs:
        _, position, velocity, speed = run.passages[0]
        if position == basins.position:
            axes.plot(speed, velocity, 'o', color='black', markerfacecolor='white', markersize=8)
    _legend(axes, 2, handles=handles)
    axes.grid(visible=False)
    _label(axes, "Crank speed phi1' at the start, rad/s", "Slider velocity xD' at the start, m/s")


def _tint(color: _Shade) -> _Shade:
    red, green, blue = (0.45 + 0.55 * part for part in color)
    return red, green, blue


def _pieces(analysis: Analysis, colors: list[_Shade]) -> Iterator[tuple[Any, _Shade, str]]:
    """The pieces of the branch as arrays of torque, speed, stroke and flow; colours and lines."""
    for motions, stable in analysis.branch.pieces:
        color = _REST if stable else _UNSTABLE
        for state, own in zip(analysis.states, colors, strict=True):
            if stable and motions[0].speed <= state.speed <= motions[-1].speed:
                color = own
        values = np.array([(one.torque, one.speed, one.stroke, one.flow) for one in motions]).T
        yield values, color, '-' if stable else '--'


def _draw_load(axes: Axes, analysis: Analysis, colors: list[_Shade]) -> None:
    damping = analysis.motor.damping
    for number, stretch in enumerate(analysis.averaged):
        axes.plot(
            [one.speed for one in stretch], [one.load for one in stretch], ':', color=_AVERAGED,
            linewidth=2.2, zorder=4, label='' if number else 'averaged, one harmonic',
        )  # fmt: skip
    for (torque, speed, _, _), color, line in _pieces(analysis, colors):
        axes.plot(speed, torque - damping * speed, line, color=color, linewidth=2.2)
    top = max((one.speed for stretch in analysis.averaged for one in stretch), default=1.0)
    speeds = np.array((0.0, top))
    axes.plot(
        speeds, analysis.motor.torque - damping * speeds, '-', color=_MOTOR, linewidth=1.4,
        label=f'motor, M0 = {analysis.motor.torque:g} N m',
    )  # fmt: skip
    for kind, motion in analysis.branch.boundaries:
        axes.plot(
            speeds, motion.torque - damping * speeds, '-.', color=_REST, linewidth=1,
            label=f'{kind}, M0 = {motion.torque:.4g} N m',
        )  # fmt: skip
    for state, color in zip(analysis.states, colors, strict=True):
        axes.plot(state.speed, state.torque - damping * state.speed, **_style(state, color))
    axes.set_xlim(0, top)
    axes.set_ylim(0, None)
    axes.legend(fontsize=SMALL)
    _label(axes, 'Mean crank speed w, rad/s', 'Mean torque on the crank, N m')


def _draw_torques(
    figure: Figure, cell: SubplotSpec, analysis: Analysis, colors: list[_Shade]
) -> None:
    rows = cell.subgridspec(3, 1, hspace=0.06)
    labels = 'Speed w, rad/s', 'Stroke s, m', 'Flow s w, m/s'
    for number, label in enumerate(labels):
        axes = _panel(
            figure, rows[number], '' if number else "Settled motions over the motor's torque"
        )
        for values, color, line in _pieces(analysis, colors):
            axes.plot(values[0], values[number + 1], line, color=color, linewidth=2)
        for one in analysis.branch.ranges():
            axes.axvspan(one.low, one.high, color='0.94', zorder=0)
        for state, color in zip(analysis.states, colors, strict=True):
            value = (state.speed, state.stroke, state.flow)[number]
            axes.plot(state.torque, value, **_style(state, color))
        axes.axvline(analysis.motor.torque, color=_MOTOR, linewidth=1)
        axes.set_xlim(0, None)
        axes.set_ylim(0, None)
        axes.tick_params(labelbottom=number == len(labels) - 1)
        axes.set_ylabel(label, fontsize=SMALL)
    two = ', '.join(f'{one.low:.4g} to {one.high:.4g}' for one in analysis.branch.ranges())
    axes.set_xlabel(
        f"Motor's torque at rest M0, N m\n(two stable states: {two or 'nowhere here'})",
        fontsize=TEXT,
    )


def _draw_runs(axes: Axes, analysis: Analysis, colors: list[_Shade]) -> None:
    for run, color in _runs(analysis, colors):
        axes.plot(run.times, run.speeds, '-', color=color, linewidth=0.7)
        if run.ended:
            axes.plot(run.times[-1], run.speeds[-1], 'X', color='black', markersize=9)
    for state in analysis.states:
        axes.axhline(
            state.speed, color='black', linewidth=1, linestyle='-' if state.stable else '--'
        )
        axes.annotate(
            _name(state), (0.98, state.speed), xycoords=('axes fraction', 'data'), ha='right',
            xytext=(0, 9), textcoords='offset points', fontsize=SMALL,
            color='0.2', weight='bold',
        )  # fmt: skip
    axes.margins(y=0.1)
    axes.set_xlim(0, None)
    _label(axes, 'Time, s', "Crank speed phi1', rad/s")
