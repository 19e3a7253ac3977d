# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_chart pump: steady states of a wind pump, in six panels with a table below."""

import argparse
import itertools
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeAlias, cast

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from scipy.interpolate import CubicHermiteSpline

from linkage_lab.output import (
    DPI,
    NUMBERS,
    SMALL,
    chart,
    name_of,
    new_file,
    pictures,
    save_records,
)
from linkage_lab.pump.analysis import Analysis, SteadyState, analyse
from linkage_lab.pump.continuation import END, LOST, Piece, bistable_ranges, stability_lost
from linkage_lab.pump.shooting import TURN
from linkage_ros import ConfigurationError, WindPump, load
from linkage_ros.formulas import Array
from linkage_ros.palette import BLACK, DARK, FIRST, GREY, SECOND, fractions, mixed

# Colours of the stable pieces of the curves, in order; unstable pieces are grey and dashed.
_STABLE = tuple(
    map(fractions, (FIRST, SECOND, mixed(FIRST, BLACK, 0.6), mixed(SECOND, BLACK, 0.6)))
)
_UNSTABLE, _MOTOR, _REST = map(fractions, (DARK, BLACK, GREY))
_PARTS = 512  # points of a closed curve
_FEW_POINTS, _BETWEEN = 3, 12  # fewest points of a smooth curve, and points drawn between two
_APART = 1e-6  # smallest distance of two points of a curve, relative to its size
# Largest torque drawn, relative to the motor's: always, and at most if a range ends beyond it.
_TORQUES, _FARTHEST = 2.0, 4.0
_ROW, _LINE = 4.0, 0.19  # heights of a row of panels with its legend, and of a line; inches
_LABELS = {
    'speed': 'Mean crank speed w, rad/s',
    'load': 'Mean torque on the crank, N m',
    'torque': "Motor's torque at rest M0, N m",
    'stroke': 'Stroke s, m',
    'flow': 'Flow, m/s',
}
_OVER_TORQUE = 'speed', 'stroke', 'flow'
_LARGE = 1e4  # multiplier above which only the magnitude is shown
_TABLE = (
    ('', 'turns', 'mean speed', 'stroke', 'flow', 'starts', 'Floquet', 'averaged'),
    ('', '', 'rad/s', 'm', 'm/s', '', 'multiplier', 'rad/s'),
)
_CELLS = '{:<9}{:>6}{:>12}{:>10}{:>10}{:>9}{:>20}{:>10}'
_Colors: TypeAlias = dict[Piece, tuple[float, float, float]]


def pump(options: argparse.Namespace) -> None:
    """Finds the steady states of a wind pump, draws them, and writes their numbers.

    Raises:
        ConfigurationError: The mechanism is not a wind pump, or a file cannot be written.
    """
    configuration = load(options.params).linkage(options.linkage)
    mechanism, drive = configuration.mechanism, cast('Any', configuration.drive)
    if not isinstance(mechanism, WindPump):
        raise ConfigurationError(f'{options.params} is not a wind_pump: try the preset wind_pump')
    name, motor = name_of(options.params, configuration), drive.motor
    records = new_file(options, options.out / f'{name}_settled.json')
    drawn = pictures(options, f'{name}_settled')
    found = analyse(mechanism, motor, options.speeds)
    save_records(records, [found.record()])
    draw_pump(found, f'{name}: {motor}', drawn, DPI / 2 if options.quick else DPI)
    print(records, *states_table(found), *drawn, sep='\n')


def draw_pump(analysis: Analysis, title: str, files: Sequence[Path], dpi: float) -> None:
    """Draws steady states, motions that reach them, and their dependence on the motor's torque.

    Args:
        analysis: Analysis of a pump.
        title: Title of the picture.
        files: The files, replaced if they exist.
        dpi: Pixels per inch.

    Raises:
        OSError: The picture cannot be written.
    """
    stable = itertools.cycle(_STABLE)
    colors = {piece: next(stable) if piece.stable else _UNSTABLE for piece in analysis.pieces}
    lines = '', *states_table(analysis)
    height = 3 * _ROW + _LINE * len(lines)
    with rc_context({'savefig.dpi': dpi}), chart(files, height, title) as figure:
        (plane, runs), (load, *over_torque), others = figure.subplots(3, 2)
        _draw_phase_plane(plane, analysis, colors)
        _draw_runs(runs, analysis, colors)
        _draw_load_curve(load, analysis, colors)
        for axes, quantity in zip((*over_torque, *others), _OVER_TORQUE, strict=True):
            _draw_over_torque(axes, analysis, colors, quantity)
        figure.get_layout_engine().set(hspace=0.04)
        figure.supxlabel(
            '\n'.join(lines), family='monospace', multialignment='left', fontsize=NUMBERS,
            linespacing=1.35,
        )  # fmt: skip


def _draw_phase_plane(axes: Axes, analysis: Analysis, colors: _Colors) -> None:
    """Draws the slider's motion in each steady state, exact and averaged."""
    angles = np.linspace(0, TURN, _PARTS + 1)
    for state in analysis.states:
        x, _, v = state.motion.at(state.motion.turns * angles)
        axes.plot(x, v, linewidth=2.2, label=state.motion.name, **_line(colors, state.piece))
        axes.plot(x[0], v[0], **_mark(colors, state))
    averaged = [state.averaged for state in analysis.states if state.averaged]
    for i, motion in enumerate(averaged):
        x, _, v = motion.at(angles)
        label = '' if i else 'averaged, one harmonic'  # one entry in the legend
        axes.plot(x, v, linewidth=1.8, label=label, color=_MOTOR, linestyle=':')
    axes.set(
        title='Settled motions', xlabel='Slider position xD, m', ylabel="Slider velocity xD', m/s"
    )
    _put_legend_below(axes)


def _put_legend_below(axes: Axes) -> None:
    """Draws the legend below the panel, where it does not cover the curves."""
    axes.legend(
        *axes.get_legend_handles_labels(), ncols=2, columnspacing=1.2, labelspacing=0.2,
        loc='upper center', bbox_to_anchor=(0.5, -0.14),
    )  # fmt: skip


def _draw_runs(axes: Axes, analysis: Analysis, colors: _Colors) -> None:
    """Plots the crank speed of single runs against time."""
    for run in analysis.runs:
        color = _REST if run.state is None else colors[analysis.states[run.state].piece]
        axes.plot(run.times, run.speeds, '-', color=color, linewidth=0.7)
    for state in analysis.states:
        line = '-' if state.motion.stable else '--'
        axes.axhline(state.motion.speed, color='black', linewidth=1, linestyle=line)
        axes.annotate(
            state.motion.name, (0.98, state.motion.speed), xycoords=('axes fraction', 'data'),
            ha='right', xytext=(0, 9), textcoords='offset points', fontsize=SMALL,
            color='0.2', weight='bold', bbox={'color': 'white', 'alpha': 0.8, 'pad': 1},
        )  # fmt: skip
    axes.margins(y=0.1)
    axes.set(
        title='Crank speed from single starts', xlim=(0, None),
        xlabel='Time, s', ylabel="Crank speed phi1', rad/s",
    )  # fmt: skip


def _draw_load_curve(axes: Axes, analysis: Analysis, colors: _Colors) -> None:
    """Plots mean torque against mean speed, with the motor line and the limits of stability."""
    _draw_curves(axes, analysis, colors, 'speed', 'load')

    def draw_motor_line(name: str, torque: float, **style: Any) -> None:
        label = f'{name}, M0 = {torque:.4g} N m'
        axes.axline((0.0, torque), slope=-analysis.motor.damping, label=label, **style)

    draw_motor_line('motor', analysis.motor.torque, color=_MOTOR)
    for kind, motion in stability_lost(analysis.pieces):
        if motion.torque < _largest_torque(analysis):
            draw_motor_line(kind, motion.torque, color=_REST, linewidth=1, linestyle='-.')
    axes.set(title='Load curve and motor line')
    _put_legend_below(axes)


def _largest_torque(analysis: Analysis) -> float:
    """Returns the largest torque to draw, N m."""
    torque: float = analysis.motor.torque
    ends: list[float] = [1.1 * one['high'] for one in bistable_ranges(analysis.pieces)]
    return max([_TORQUES * torque, *(x for x in ends if x < _FARTHEST * torque)])


def _draw_over_torque(axes: Axes, analysis: Analysis, colors: _Colors, quantity: str) -> None:
    """Plots speed, stroke or flow against the motor's torque."""
    ranges = bistable_ranges(analysis.pieces)
    for one in ranges:
        axes.axvspan(one['low'], one['high'], color='0.94', zorder=0)
    axes.axvline(analysis.motor.torque, color=_MOTOR, linewidth=1)
    _draw_curves(axes, analysis, colors, 'torque', quantity)
    if quantity == 'speed':
        words = ', '.join(map(_range_words, ranges))
        axes.set_title(f'Two or more stable states: {f"{words} N m" if words else "none found"}')


def _range_words(torques: dict[str, Any]) -> str:
    """Describes one of the `bistable_ranges`.

    It may extend beyond the end of a curve that was not followed further.
    """
    at_most = 'at most ' if torques['low_is'] in {END, LOST} else ''
    at_least = 'at least ' if torques['high_is'] in {END, LOST} else ''
    return f'{at_most}{torques["low"]:.4g} to {at_least}{torques["high"]:.4g}'


def _draw_curves(axes: Axes, analysis: Analysis, colors: _Colors, x: str, y: str) -> None:
    """Plots one quantity of all motions against another quantity, and marks the states."""
    most = _largest_torque(analysis)
    for piece in analysis.pieces:
        inside = [one for one in piece.motions if one.torque < most]
        rows = np.array([(getattr(one, x), getattr(one, y)) for one in inside]).reshape(-1, 2)
        axes.plot(*_smooth(rows).T, linewidth=2.2, **_line(colors, piece))
    for state in analysis.states:
        place = getattr(state.motion, x), getattr(state.motion, y)
        axes.plot(*place, **_mark(colors, state))
    axes.set(xlabel=_LABELS[x], ylabel=_LABELS[y], xlim=(0, None), ylim=(0, None))


def _smooth(rows: Array) -> Array:
    """Interpolates points, shape (n, 2), by cubics with the slopes of parabolas through three."""
    size = np.ptp(rows, axis=0)
    if len(rows) < _FEW_POINTS or not size.all():
        return rows
    steps = np.linalg.norm(np.diff(rows / size, axis=0), axis=1)
    is_new = steps > _APART  # two points at one place have no slope between them
    rows = rows[np.insert(is_new, 0, values=True)]
    length = np.append(0.0, np.cumsum(steps[is_new]))  # along the polygon through the points
    places = np.linspace(0, len(length) - 1, _BETWEEN * (len(length) - 1) + 1)
    fine = np.interp(places, np.arange(len(length)), length)
    spline = CubicHermiteSpline(length, rows, np.gradient(rows, length, axis=0))
    return np.asarray(spline(fine))


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


def states_table(analysis: Analysis) -> list[str]:
    """Formats the steady states, and the share of starts that reach none of them."""
    rows = (*_TABLE, *map(_cells, analysis.states))
    return [
        *(_CELLS.format(*row) for row in rows),
        'Floquet multiplier: growth of a small deviation over a period',
        f'{sum(analysis.lost.values()):.1%} of {analysis.starts} starts settle in no listed state',
        *(f'{share:.1%}: the motion {reason}' for reason, share in analysis.lost.items()),
    ]


def _cells(state: SteadyState) -> tuple[str, ...]:
    """Returns the table cells of a state and of the averaged state near it."""
    motion, averaged = state.motion, state.averaged
    return (
        'stable' if motion.stable else 'unstable', str(motion.turns), f'{motion.speed:.6f}',
        f'{motion.stroke:.6f}', f'{motion.flow:.6f}',
        f'{state.share:.1%}' if motion.stable else '-', _complex(motion.multipliers[0]),
        f'{averaged.speed:.4f}' if averaged else '-',
    )  # fmt: skip


def _complex(value: complex) -> str:
    """Formats a number with four decimals, or only its magnitude if it is large."""
    if abs(value) >= _LARGE:
        return f'{abs(value):.1e}'
    aside = f' \N{PLUS-MINUS SIGN} {value.imag:.4f}i' if value.imag else ''
    return f'{round(value.real, 4) + 0.0:.4f}{aside}'  # + 0.0 turns -0 into 0
