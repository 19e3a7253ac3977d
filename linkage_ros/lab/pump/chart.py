# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Draws the steady states of a wind pump in six panels, with tables below."""

import itertools
import math
import textwrap
from collections.abc import Iterator
from operator import itemgetter
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes

from linkage_ros.lab.output import NUMBERS, SMALL, WIDTH, chart
from linkage_ros.lab.pump.analysis import CHANGED, COUNT, Analysis
from linkage_ros.lab.pump.equations import BOTH
from linkage_ros.lab.pump.harmonic_balance import STATE
from linkage_ros.lab.pump.load_curve import (
    END,
    LOST,
    Piece,
    SteadyState,
    bistable_ranges,
    stability_lost,
)
from linkage_ros.lab.pump.motions import cubic
from linkage_ros.numeric import Array
from linkage_ros.palette import BLACK, DARK, FIRST, GREY, SECOND, fractions, mixed

# Colours of the stable pieces of the load curve, in order; unstable pieces are grey and dashed.
_STABLE = tuple(
    map(fractions, (FIRST, SECOND, mixed(FIRST, BLACK, 0.6), mixed(SECOND, BLACK, 0.6)))
)
_UNSTABLE, _MOTOR, _REST = map(fractions, (DARK, BLACK, GREY))
_PARTS = 512  # of a turn
_WIDEST = 138  # characters in a line below the panels
_FEW_POINTS, _BETWEEN = 3, 12  # fewest points of a smooth curve, and points drawn between two
_APART = 1e-6  # smallest distance of two points of a curve, relative to its size
# Largest torque drawn, relative to the motor's: always, and at most if a range ends beyond it.
_TORQUES, _FARTHEST = 2.0, 4.0
# Heights of a panel, the room below it, the room above all, and a line of text; widths of the left
# edge, a panel and the room to its right; inches.
_ROW, _GAP, _HEAD, _LINE, _LEFT, _PANEL, _BESIDE = 2.95, 0.9, 0.85, 0.185, 0.65, 4.1, 0.95
_LABELS = {
    'speed': 'Mean crank speed w, rad/s',
    'load': 'Mean torque on the crank, N m',
    'torque': "Motor's torque at rest M0, N m",
    'stroke': 'Stroke s, m',
    'flow': 'Flow, m/s',
}
_RARE = 0.01  # share of the starts below which no line is printed
_LARGE = 1e4  # multiplier above which only the magnitude is shown
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
    lines = [part for line in states_table(analysis) for part in textwrap.wrap(line, _WIDEST)]
    # Legends in two columns are below the panels, except the last: the table begins two lines
    # higher.
    entries = 1 + max(len(analysis.states), len(stability_lost(analysis.pieces)))
    gap = _GAP + _LINE * ((entries + 1) // 2)
    panels = 3 * _ROW + 2 * gap
    height = _HEAD + panels + _GAP + _LINE * (len(lines) - 2)
    with rc_context({'savefig.dpi': dpi}), chart(path, height, title, layout=None) as figure:
        (plane, runs), (load, *over_torque), others = figure.subplots(3, 2, gridspec_kw={
            'left': _LEFT / WIDTH, 'right': (_LEFT + 2 * _PANEL + _BESIDE) / WIDTH,
            'top': 1 - _HEAD / height, 'bottom': 1 - (_HEAD + panels) / height,
            'hspace': gap / _ROW, 'wspace': _BESIDE / _PANEL,
        })  # fmt: skip
        _draw_phase_plane(plane, analysis, colors)
        _draw_runs(runs, analysis, colors)
        _draw_load_curve(load, analysis, colors)
        for axes, quantity in zip((*over_torque, *others), CHANGED, strict=True):
            _draw_over_torque(axes, analysis, colors, quantity)
        figure.text(
            0.5, _LINE / 2 / height, '\n'.join(lines), ha='center', family='monospace',
            multialignment='left', fontsize=NUMBERS, linespacing=1.35,
        )  # fmt: skip


def _draw_phase_plane(axes: Axes, analysis: Analysis, colors: _Colors) -> None:
    """Draws the slider's motion in each steady state, exact and averaged."""
    angles = np.linspace(0, 2 * math.pi, _PARTS + 1)
    for state in analysis.states:
        x, _, v = state.motion.at(state.motion.turns * angles)
        axes.plot(x, v, linewidth=2.2, label=state.motion.name, **_line(colors, state.piece))
        axes.plot(x[0], v[0], **_mark(colors, state))
    label = 'averaged, one harmonic'
    for motion in filter(None, (state.averaged for state in analysis.states)):
        x, _, v = motion.at(angles)
        axes.plot(x, v, linewidth=1.8, label=label, color=_MOTOR, linestyle=':')
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
            state.motion.name, (place, state.motion.speed), xycoords=('axes fraction', 'data'),
            ha='right', xytext=(0, 9), textcoords='offset points', fontsize=SMALL,
            color='0.2', weight='bold',
        )  # fmt: skip
    axes.margins(y=0.1)
    axes.set(
        title='Crank speed from single starts', xlim=(0, None),
        xlabel='Time, s', ylabel="Crank speed phi1', rad/s",
    )  # fmt: skip


def _draw_load_curve(axes: Axes, analysis: Analysis, colors: _Colors) -> None:
    """Plots mean torque against mean speed, with the motor line and the limits of stability."""
    _draw_branch(axes, analysis, colors, 'speed', 'load')
    _draw_motor_line(axes, analysis, 'motor', analysis.motor.torque, color=_MOTOR)
    for kind, motion in stability_lost(analysis.pieces):
        if motion.torque < _largest_torque(analysis):
            _draw_motor_line(
                axes, analysis, kind, motion.torque, color=_REST, linewidth=1, linestyle='-.'
            )
    axes.set(title='Load curve and motor line')
    _put_legend_below(axes)


def _draw_motor_line(
    axes: Axes, analysis: Analysis, name: str, torque: float, **style: Any
) -> None:
    """Draws the torque-speed line of the motor for a given torque at rest, N m."""
    label = f'{name}, M0 = {torque:.4g} N m'
    axes.axline((0.0, torque), slope=-analysis.motor.damping, label=label, **style)


def _largest_torque(analysis: Analysis) -> float:
    """Returns the largest torque to draw, N m."""
    motor = analysis.motor.torque
    ends = [1.1 * one['high'] for one in bistable_ranges(analysis.pieces)]
    return max([_TORQUES * motor, *(x for x in ends if x < _FARTHEST * motor)])


def _draw_over_torque(axes: Axes, analysis: Analysis, colors: _Colors, quantity: str) -> None:
    """Plots speed, stroke or flow against the motor's torque."""
    ranges = bistable_ranges(analysis.pieces)
    for one in ranges:
        axes.axvspan(one['low'], one['high'], color='0.94', zorder=0)
    axes.axvline(analysis.motor.torque, color=_MOTOR, linewidth=1)
    _draw_branch(axes, analysis, colors, 'torque', quantity)
    if quantity == 'speed':
        # The range may extend beyond the end of a curve that was not followed further.
        two = ', '.join(
            f'{"at most " * (one["low_is"] in {END, LOST})}{one["low"]:.4g} to '
            f'{"at least " * (one["high_is"] in {END, LOST})}{one["high"]:.4g}'
            for one in ranges
        )
        axes.set_title(f'Two or more stable states: {f"{two} N m" if two else "none found"}')


def _draw_branch(axes: Axes, analysis: Analysis, colors: _Colors, x: str, y: str) -> None:
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
    """Interpolates points by cubic curves with slopes of parabolas through three points."""
    if len(rows) < _FEW_POINTS or not np.ptp(rows, axis=0).all():
        return rows
    moves = np.linalg.norm(np.diff(rows / np.ptp(rows, axis=0), axis=0), axis=1)
    is_new = moves > _APART  # two points at one place have no slope between them
    rows, way = rows[np.insert(is_new, 0, values=True)], np.append(0.0, np.cumsum(moves[is_new]))
    places = np.linspace(0, len(way) - 1, _BETWEEN * (len(way) - 1) + 1)
    fine = np.interp(places, np.arange(len(way)), way)
    return np.array([cubic(way, row, np.gradient(row, way), fine) for row in rows.T]).T


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
    """Formats tables of states, of their sensitivity to the torque, and of unexplained starts.

    Args:
        analysis: Analysis of a pump.

    Returns:
        Lines for a monospaced font.
    """
    return [*_states_lines(analysis), *_changes_lines(analysis), *_remarks(analysis)]


def _states_lines(analysis: Analysis) -> list[str]:
    if not analysis.states:
        return ['no settled motion found']
    head = (
        ('', 'turns', 'mean speed', 'stroke', 'flow', 'efficiency', 'starts', 'Floquet',
         'averaged', 'slow flow'),
        ('', '', 'rad/s', 'm', 'm/s', '', '', 'multiplier', 'rad/s', 'multiplier'),
    )  # fmt: skip
    widths = '{:<9}{:>6}{:>12}{:>10}{:>10}{:>12}{:>9}{:>20}{:>10}{:>20}'
    rows = [*head, *map(_cells, analysis.states)]
    return [
        *(widths.format(*row) for row in rows),
        (
            'multiplier: growth of a small deviation over a period; Floquet: of the exact motion; '
            'slow flow: of the averaged motion, an estimate'
        ),
    ]


def _cells(state: SteadyState) -> tuple[str, ...]:
    """Returns the table cells of a state and of the averaged state near it."""
    motion, averaged = state.motion, state.averaged
    return (
        'stable' if motion.stable else 'unstable', str(motion.turns), f'{motion.speed:.6f}',
        f'{motion.stroke:.6f}', f'{motion.flow:.6f}',
        '-' if motion.efficiency is None else _fixed(motion.efficiency),
        f'{state.share:.1%}' if motion.stable else '-', _complex(motion.multipliers[0]),
        f'{averaged.speed:.4f}' if averaged else '-',
        _complex(averaged.multipliers[0]) if averaged else '-',
    )  # fmt: skip


def _complex(value: complex) -> str:
    if abs(value) >= _LARGE:
        return f'{abs(value):.1e}'
    aside = f' \N{PLUS-MINUS SIGN} {_fixed(value.imag)}i' if value.imag else ''
    return f'{_fixed(value.real)}{aside}'


def _fixed(value: float, form: str = '.4f') -> str:
    """Formats a value rounded to four decimals; -0 becomes 0."""
    return format(round(value, 4) + 0.0, form)


def _changes_lines(analysis: Analysis) -> list[str]:
    """Makes a table of the relative change of each stable state with the motor torque."""
    head = 'changes of the stable states with the torque', *CHANGED
    lines = ['{:<46}{:>10}{:>10}{:>10}'.format(*head)]
    for one in sorted(analysis.sensitivities, key=itemgetter('state')):
        change = one['torque'] / analysis.motor.torque - 1
        name = f'{analysis.states[one["state"]].motion.name}, torque {change:+.0%}'
        cells = ''.join(f'{_fixed(change, "+.2%"):>10}' for change in one['changes'].values())
        lines.append(f'{name:<46}{cells}' if cells else f'{name}: {one["reason"]}')
    return lines if analysis.sensitivities else []


def _remarks(analysis: Analysis) -> Iterator[str]:
    """Yields remarks on inaccurate states, states in other assemblies, and other starts."""
    for motion in (state.motion for state in analysis.states):
        if motion.tail > STATE.tail:
            error = 10 * motion.tail
            yield f'{motion.name}: its numbers have a relative error of about {error:.0e}'
        if motion.assembly == BOTH:
            yield f'{motion.name}: stretches the dyad, and so alternates between the assemblies'
        elif motion.assembly != analysis.assembly:
            yield f'{motion.name}: in the {motion.assembly} assembly'
    for one in analysis.alternating:
        turns = ', '.join(f'{speed:.2f}' for speed in one['speeds'])
        yield (
            f'{one["share_of_starts"]:.1%} of {COUNT} starts alternate between the assemblies '
            f'at {one["speed"]:.4g} rad/s (period {one["period"]}, turns of {turns} rad/s): '
            'no Fourier series was found for it, so its curve and multipliers are not known'
        )
    if analysis.stopped > _RARE:
        yield f'{analysis.stopped:.1%} of {COUNT} starts come to rest, or rock back and forth'
    if analysis.unidentified > _RARE:
        yield (
            f'warning: {analysis.unidentified:.1%} of {COUNT} starts settle in none of the '
            'listed states: their motion is quasi-periodic, chaotic, of a long period, or had not '
            'settled in time (small motor.damping or slider.damping); draw such motions with '
            '--speeds'
        )
    if analysis.has_corners:
        yield 'the load curve has corners: speeds are accurate to about 0.01 %, multipliers to 1 %'
    if analysis.spread:
        yield (
            'the jump of load.return_value is spread over slider speeds of '
            f'+-{analysis.spread:.2g} m/s: speeds are accurate to about 0.5 %, multipliers to 0.02'
        )
