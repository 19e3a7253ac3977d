# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Draws the steady states of a wind pump in six panels, with tables below."""

from __future__ import annotations

import itertools
import math
import textwrap
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from linkage_ros.lab.output import NUMBERS, SMALL, TEXT, TITLE, WIDTH
from linkage_ros.lab.pump.analysis import Analysis
from linkage_ros.lab.pump.load_curve import (
    END,
    LOST,
    Piece,
    SteadyState,
    bistable_ranges,
    stability_lost,
)
from linkage_ros.lab.pump.table import states_table
from linkage_ros.numeric import Array
from linkage_ros.palette import BLACK, DARK, FIRST, GREY, SECOND, fractions, mixed

# Colours of the stable pieces of the load curve, in order; unstable pieces are grey and dashed.
_STABLE = tuple(
    map(fractions, (FIRST, SECOND, mixed(FIRST, BLACK, 0.6), mixed(SECOND, BLACK, 0.6)))
)
_UNSTABLE, _MOTOR, _REST = map(fractions, (DARK, BLACK, GREY))
_PARTS = 512  # of a turn
_WIDEST = 138  # characters in a line below the panels
_FEW, _BETWEEN = 3, 12  # fewest points of a smooth curve, and points drawn between two
_APART = 1e-6  # smallest distance of two points of a curve, relative to its size
# Largest torque drawn, times the motor's: at least, and at most to show where ranges end.
_TORQUES, _FARTHEST = 2.0, 4.0
# Heights of a panel, the room below it, the room above all, and a line of text; widths of the left
# edge, a panel and the room to its right; inches.
_ROW, _GAP, _HEAD, _LINE, _LEFT, _PANEL, _BESIDE = 2.95, 0.9, 0.65, 0.185, 0.65, 4.1, 0.95
_LABELS = {
    'speed': 'Mean crank speed w, rad/s',
    'load': 'Mean torque on the crank, N m',
    'torque': "Motor's torque at rest M0, N m",
    'stroke': 'Stroke s, m',
    'flow': 'Flow, m/s',
}
_DOTS: dict[str, Any] = {'color': _MOTOR, 'linestyle': ':'}
_STYLE: dict[Any, Any] = {
    'axes.titlesize': TEXT, 'axes.labelsize': TEXT, 'legend.fontsize': SMALL,
    'axes.titley': 1.0,  # otherwise Matplotlib searches for a free place
    'axes.grid': True, 'grid.color': '0.9', 'grid.linewidth': 0.6, 'axes.axisbelow': True,
}  # fmt: skip
_Colors: TypeAlias = dict[Piece, tuple[float, float, float]]


def draw_pump(analysis: Analysis, title: str, path: Path, dpi: float) -> None:
    """Draws steady states, motions that reach them, and their dependence on the motor's torque.

    Args:
        analysis: Analysis of a pump.
        title: Title of the picture.
        path: The PNG file, replaced if it exists.
        dpi: Pixels per inch.

    Raises:
        OSError: The picture cannot be written.
    """
    stable = itertools.cycle(_STABLE)
    colors = {piece: next(stable) if piece.stable else _UNSTABLE for piece in analysis.pieces}
    lines = [
        part for line in states_table(analysis) for part in textwrap.wrap(line, _WIDEST) or ['']
    ]
    # Legends below the first two rows of panels, in two columns.
    entries = len(analysis.states) + 1, len(_motor_lines(analysis))
    first, second = (_LINE * ((count + 1) // 2) for count in entries)
    above = 0.0, first, first + second
    # No legend is below the last panels: the table begins two lines higher.
    height = _HEAD + 3 * (_ROW + _GAP) + above[-1] + _LINE * (len(lines) - 2)
    figure = Figure(figsize=(WIDTH, height), dpi=dpi)
    figure.text(0.5, 1 - 0.3 / height, title, ha='center', fontsize=TITLE)
    with rc_context(_STYLE):
        places = itertools.product(range(3), range(2))
        plane, runs, load, *others = (
            figure.add_axes((
                (_LEFT + column * (_PANEL + _BESIDE)) / WIDTH,
                1 - (_HEAD + row * (_ROW + _GAP) + _ROW + above[row]) / height,
                _PANEL / WIDTH, _ROW / height,
            ))
            for row, column in places
        )  # fmt: skip
        _draw_phase_plane(plane, analysis, colors)
        _draw_runs(runs, analysis, colors)
        _draw_load_curve(load, analysis, colors)
        for axes, quantity in zip(others, ('speed', 'stroke', 'flow'), strict=True):
            _draw_over_torque(axes, analysis, colors, quantity)
    figure.text(
        0.5, _LINE / 2 / height, '\n'.join(lines), ha='center', family='monospace',
        multialignment='left', fontsize=NUMBERS, linespacing=1.35,
    )  # fmt: skip
    figure.savefig(path)


def _draw_phase_plane(axes: Axes, analysis: Analysis, colors: _Colors) -> None:
    """Draws the slider's motion in each steady state, exact and averaged."""
    angles = np.linspace(0, 2 * math.pi, _PARTS + 1)
    for state in analysis.states:
        x, _, v = state.motion.at(state.motion.turns * angles)
        axes.plot(x, v, linewidth=2.2, label=state.name, **_line(colors, state.piece))
        axes.plot(x[0], v[0], **_mark(colors, state))
    label = 'averaged, one harmonic'
    for motion in filter(None, analysis.averaged):
        x, _, v = motion.at(angles)
        axes.plot(x, v, linewidth=1.8, label=label, **_DOTS)
        label = ''
    axes.set(title='Settled motions')
    axes.set_xlabel('Slider position xD, m', labelpad=1)
    axes.set_ylabel("Slider velocity xD', m/s")
    _put_legend_below(axes)


def _put_legend_below(axes: Axes) -> None:
    """Draws the legend below the panel, where it does not cover the curves."""
    axes.legend(
        *axes.get_legend_handles_labels(), ncols=2, frameon=False, columnspacing=1.2,
        loc='upper center', bbox_to_anchor=(0.5, -0.16), borderpad=0, labelspacing=0.2,
    )  # fmt: skip


def _draw_runs(axes: Axes, analysis: Analysis, colors: _Colors) -> None:
    """Plots the crank speed of single runs against time."""
    for run in analysis.runs:
        color = _REST if run.state is None else colors[analysis.states[run.state].piece]
        axes.plot(run.times, run.speeds, '-', color=color, linewidth=0.7)
    for state in analysis.states:
        line, place = ('-', 0.98) if state.motion.stable else ('--', 0.6)
        axes.axhline(state.motion.speed, color='black', linewidth=1, linestyle=line)
        axes.annotate(
            state.name, (place, state.motion.speed), xycoords=('axes fraction', 'data'),
            ha='right', xytext=(0, 9), textcoords='offset points', fontsize=SMALL,
            color='0.2', weight='bold',
        )  # fmt: skip
    axes.margins(y=0.1)
    axes.set(
        title='Crank speed from single starts', xlim=(0, None),
        xlabel='Time, s', ylabel="Crank speed phi1', rad/s",
    )  # fmt: skip


def _draw_load_curve(axes: Axes, analysis: Analysis, colors: _Colors) -> None:
    """Plots the mean torque of the motions against their mean speed, and the motor's torque."""
    for label, (torque, style) in _motor_lines(analysis).items():
        axes.axline((0.0, torque), slope=-analysis.motor.damping, label=label, **style)
    _draw_branch(axes, analysis, colors, 'speed', 'load')
    axes.set(title='Load curve and motor line')
    _put_legend_below(axes)


def _motor_lines(analysis: Analysis) -> dict[str, tuple[float, dict[str, Any]]]:
    """Returns torque and style of the motor's line and of those at which stability is lost."""
    motor, grey = analysis.motor, {'color': _REST, 'linewidth': 1, 'linestyle': '-.'}
    lines: dict[str, Any] = {_at('motor', motor.torque): (motor.torque, {'color': _MOTOR})}
    for kind, motion in stability_lost(analysis.pieces):
        if motion.torque < _largest_torque(analysis):
            lines[_at(kind, motion.torque)] = motion.torque, grey
    return lines


def _largest_torque(analysis: Analysis) -> float:
    """Returns the largest torque to draw, N m."""
    motor = analysis.motor.torque
    ends = [1.1 * one['high'] for one in bistable_ranges(analysis.pieces)]
    largest: float = max([_TORQUES * motor, *(x for x in ends if x < _FARTHEST * motor)])
    return largest


def _at(name: str, torque: float) -> str:
    return f'{name}, M0 = {torque:.4g} N m'


def _draw_over_torque(axes: Axes, analysis: Analysis, colors: _Colors, quantity: str) -> None:
    """Plots speed, stroke or flow against the motor's torque."""
    ranges = bistable_ranges(analysis.pieces)
    for one in ranges:
        axes.axvspan(one['low'], one['high'], color='0.94', zorder=0)
    axes.axvline(analysis.motor.torque, color=_MOTOR, linewidth=1)
    _draw_branch(axes, analysis, colors, 'torque', quantity)
    if quantity == 'speed':
        # Where a curve was not followed further, the range may extend further.
        two = ', '.join(
            f'{"at most " * (one["low_is"] in {END, LOST})}{one["low"]:.4g} to '
            f'{"at least " * (one["high_is"] in {END, LOST})}{one["high"]:.4g}'
            for one in ranges
        )
        axes.set_title(f'Two or more stable states: {f"{two} N m" if two else "none found"}')


def _draw_branch(axes: Axes, analysis: Analysis, colors: _Colors, x: str, y: str) -> None:
    """Plots one quantity of all motions against another quantity, and marks the states."""
    largest, most = [0.0, 0.0], _largest_torque(analysis)
    for piece in analysis.pieces:
        inside = [one for one in piece.motions if one.torque < most]
        rows = np.array([(getattr(one, x), getattr(one, y)) for one in inside]).reshape(-1, 2)
        axes.plot(*_smooth(rows).T, linewidth=2.2, **_line(colors, piece))
        largest = np.maximum(largest, rows.max(axis=0, initial=0.0))
    for state in analysis.states:
        place = getattr(state.motion, x), getattr(state.motion, y)
        axes.plot(*place, **_mark(colors, state))
    axes.set(xlabel=_LABELS[x], ylabel=_LABELS[y])
    if np.all(largest):
        axes.set(xlim=(0, 1.04 * largest[0]), ylim=(0, 1.06 * largest[1]))


def _smooth(rows: Array) -> Array:
    """Interpolates points by cubic curves; each slope is that of a parabola through 3 points."""
    if len(rows) < _FEW or not np.ptp(rows, axis=0).all():
        return rows
    # Two points at one place have no slope between them.
    moves = np.diff(rows / np.ptp(rows, axis=0), axis=0)
    rows = rows[np.insert(np.linalg.norm(moves, axis=1) > _APART, 0, values=True)]
    away = np.linalg.norm(np.diff(rows / np.ptp(rows, axis=0), axis=0), axis=1)
    slopes = np.gradient(rows, np.append(0.0, np.cumsum(away)), axis=0)
    share, length = np.linspace(0, 1, _BETWEEN)[:, None, None], away[:, None]
    start, end = rows[:-1], rows[1:]
    bends = slopes[:-1] * length - (end - start), (end - start) - slopes[1:] * length
    bulge = share * (1 - share) * ((1 - share) * bends[0] + share * bends[1])
    points: Array = (start + share * (end - start) + bulge).swapaxes(0, 1).reshape(-1, 2)
    return points


def _line(colors: _Colors, piece: Piece) -> dict[str, Any]:
    return {'color': colors[piece], 'linestyle': '-' if piece.stable else '--'}


def _mark(colors: _Colors, state: SteadyState) -> dict[str, Any]:
    """Marks a state: filled if stable, hollow if unstable."""
    color, stable = colors[state.piece], state.motion.stable
    return {
        'marker': 'o', 'markersize': 9, 'linestyle': 'none', 'markeredgewidth': 1.8,
        'markeredgecolor': 'black' if stable else color, 'zorder': 6,
        'markerfacecolor': color if stable else 'white',
    }  # fmt: skip
