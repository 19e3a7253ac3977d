# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The steady states of a wind pump as a picture: six panels, and the numbers below them."""

from __future__ import annotations

import itertools
import math
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.transforms import blended_transform_factory

from linkage_ros.lab.charts.page import Shade
from linkage_ros.lab.charts.sizes import DPI, NUMBERS, SMALL, TEXT, TITLE, WIDTH
from linkage_ros.lab.pump.periodic import PeriodicMotion
from linkage_ros.lab.pump.pump import Analysis
from linkage_ros.lab.pump.states_table import states_table
from linkage_ros.palette import BLACK, DARK, FIRST, GREY, SECOND, fractions, mixed

# Stable states by growing speed; the unstable are grey and dashed.
_STABLE = tuple(
    map(fractions, (FIRST, SECOND, mixed(FIRST, BLACK, 0.6), mixed(SECOND, BLACK, 0.6)))
)
_UNSTABLE, _MOTOR, _REST = map(fractions, (DARK, BLACK, GREY))
_PARTS = 256  # of a turn
_QUANTITIES = (('speed', 'Mean crank speed w, rad/s'), ('stroke', 'Stroke s, m'),
               ('flow', 'Flow s w, m/s'))  # fmt: skip


def draw_pump(analysis: Analysis, title: str, path: Path) -> None:
    """Draws settled motions, how they are reached, and how they depend on the motor's torque.

    Args:
        analysis: Analysis of a pump.
        title: Title of the picture.
        path: The PNG file; replaced if there is one.

    Raises:
        OSError: The picture cannot be written.
    """
    figure = Figure(figsize=(WIDTH, 13.0), dpi=DPI, layout='constrained')
    figure.suptitle(title, fontsize=TITLE)
    cells = figure.add_gridspec(4, 2, height_ratios=(1, 1, 1, 0.29))
    plane, runs, load, *others = (figure.add_subplot(cells[i // 2, i % 2]) for i in range(6))
    for axes in (plane, runs, load, *others):
        axes.grid(color='0.9', linewidth=0.6)
        axes.set_axisbelow(True)
    stable = itertools.cycle(_STABLE)
    colors = [next(stable) if state.stable else _UNSTABLE for state in analysis.states]
    _draw_phase_plane(plane, analysis, colors)
    _draw_runs(runs, analysis, colors)
    _draw_load_curve(load, analysis, colors)
    for axes, (quantity, words) in zip(others, _QUANTITIES, strict=True):
        _draw_over_torque(axes, analysis, colors, quantity)
        _label(axes, "Motor's torque at rest M0, N m", words)
    ranges = analysis.branch.bistable_ranges()
    two = ', '.join(f'{one.low:.4g} to {one.high:.4g} N m' for one in ranges)
    others[0].set_title(f'Two stable states: {two or "nowhere here"}', fontsize=TEXT)
    table = figure.add_subplot(cells[3, :])
    table.axis('off')
    numbers = table.text(
        0.5, 1, '\n'.join(states_table(analysis)), va='top', ha='center', family='monospace',
        multialignment='left', fontsize=NUMBERS, linespacing=1.35,
        transform=blended_transform_factory(figure.transFigure, table.transAxes),
    )  # fmt: skip
    numbers.set_in_layout(False)  # it is as wide as the picture
    figure.savefig(path)


def _draw_phase_plane(axes: Axes, analysis: Analysis, colors: list[Shade]) -> None:
    """The slider's settled motions, exact and averaged."""
    axes.set_title('Settled motions', fontsize=TEXT)
    for state, color in zip(analysis.states, colors, strict=True):
        course = analysis.poincare.orbit(np.array([state.point]).T, state.torque, _PARTS)[..., 0]
        line = '-' if state.stable else '--'
        axes.plot(course[0], course[1], line, color=color, linewidth=2.2, label=_name(state))
        axes.plot(*state.point[:2], **_mark(state, color))
    angle = np.linspace(0, 2 * math.pi, _PARTS)
    for number, one in enumerate(analysis.averaged_states):
        axes.plot(
            one.mean + one.cosine * np.cos(angle) + one.sine * np.sin(angle),
            one.speed * (one.sine * np.cos(angle) - one.cosine * np.sin(angle)),
            ':', color=_MOTOR, linewidth=1.8, label='' if number else 'averaged, one harmonic',
        )  # fmt: skip
    _label(axes, 'Slider position xD, m', "Slider velocity xD', m/s")
    if analysis.states:
        # Below the panel it hides nothing.
        axes.legend(
            fontsize=SMALL, ncols=2, frameon=False, columnspacing=1.2, loc='upper center',
            bbox_to_anchor=(0.5, -0.16), borderpad=0,
        )  # fmt: skip
    else:
        words = 'no settled motion found'
        axes.text(0.5, 0.5, words, ha='center', transform=axes.transAxes, fontsize=TEXT)


def _draw_runs(axes: Axes, analysis: Analysis, colors: list[Shade]) -> None:
    """The crank speed of single runs over time."""
    axes.set_title('Crank speed from single starts', fontsize=TEXT)
    for run, end in zip(analysis.runs, analysis.ends, strict=True):
        color = _REST if end is None else colors[end]
        axes.plot(run.times, run.speeds, '-', color=color, linewidth=0.7)
        if run.ended:
            axes.plot(run.times[-1], run.speeds[-1], 'X', color='black', markersize=9)
    for state in analysis.states:
        line = '-' if state.stable else '--'
        axes.axhline(state.speed, color='black', linewidth=1, linestyle=line)
        axes.annotate(
            _name(state), (0.98, state.speed), xycoords=('axes fraction', 'data'), ha='right',
            xytext=(0, 9), textcoords='offset points', fontsize=SMALL,
            color='0.2', weight='bold',
        )  # fmt: skip
    axes.margins(y=0.1)
    axes.set_xlim(0, None)
    _label(axes, 'Time, s', "Crank speed phi1', rad/s")


def _draw_load_curve(axes: Axes, analysis: Analysis, colors: list[Shade]) -> None:
    """The mean torque that the motions take over their speed, and where the motor gives it."""
    axes.set_title('Load curve and motor line', fontsize=TEXT)
    motor = analysis.motor
    for number, stretch in enumerate(analysis.averaged):
        axes.plot(
            [one.speed for one in stretch], [one.load for one in stretch], ':', color=_MOTOR,
            linewidth=2.2, zorder=4, label='' if number else 'averaged, one harmonic',
        )  # fmt: skip
    for motions, stable in analysis.branch.pieces:
        speed, load = np.array([(m.speed, m.torque - motor.damping * m.speed) for m in motions]).T
        axes.plot(speed, load, linewidth=2.2, **_line(analysis, colors, motions, stable=stable))
    top = max((one.speed for stretch in analysis.averaged for one in stretch), default=1.0)
    look: dict[str, Any] = {'color': _MOTOR, 'linewidth': 1.4}
    lines = [('motor', motor.torque, look)]
    for kind, motion in analysis.branch.boundaries:
        lines.append((kind, motion.torque, {'color': _REST, 'linewidth': 1, 'linestyle': '-.'}))
    for name, torque, style in lines:
        label = f'{name}, M0 = {torque:.4g} N m'
        axes.plot((0.0, top), (torque, torque - motor.damping * top), label=label, **style)
    for state, color in zip(analysis.states, colors, strict=True):
        axes.plot(state.speed, state.torque - motor.damping * state.speed, **_mark(state, color))
    axes.set_xlim(0, top)
    axes.set_ylim(0, None)
    axes.legend(fontsize=SMALL)
    _label(axes, 'Mean crank speed w, rad/s', 'Mean torque on the crank, N m')


def _draw_over_torque(axes: Axes, analysis: Analysis, colors: list[Shade], quantity: str) -> None:
    """Speed, stroke or flow over the motor's torque."""
    for motions, stable in analysis.branch.pieces:
        torques, values = np.array([(m.torque, getattr(m, quantity)) for m in motions]).T
        axes.plot(torques, values, linewidth=2, **_line(analysis, colors, motions, stable=stable))
    for one in analysis.branch.bistable_ranges():
        axes.axvspan(one.low, one.high, color='0.94', zorder=0)
    for state, color in zip(analysis.states, colors, strict=True):
        axes.plot(state.torque, getattr(state, quantity), **_mark(state, color))
    axes.axvline(analysis.motor.torque, color=_MOTOR, linewidth=1)
    axes.set_xlim(0, None)
    axes.set_ylim(0, None)


def _line(
    analysis: Analysis, colors: list[Shade], motions: list[PeriodicMotion], *, stable: bool
) -> dict[str, Any]:
    """The line of a piece of the branch, in the colour of its state."""
    color = _REST if stable else _UNSTABLE
    for state, own in zip(analysis.states, colors, strict=True):
        if stable and motions[0].speed <= state.speed <= motions[-1].speed:
            color = own
    return {'color': color, 'linestyle': '-' if stable else '--'}


def _mark(state: PeriodicMotion, color: Shade) -> dict[str, Any]:
    """A filled mark for a stable state, a hollow one for an unstable one."""
    return {
        'marker': 'o', 'markersize': 9, 'linestyle': 'none', 'markeredgewidth': 1.8,
        'markeredgecolor': 'black' if state.stable else color, 'zorder': 6,
        'markerfacecolor': color if state.stable else 'white',
    }  # fmt: skip


def _name(state: PeriodicMotion) -> str:
    return f'{state.speed:.4g} rad/s{"" if state.stable else ", unstable"}'


def _label(axes: Axes, x: str, y: str) -> None:
    axes.set_xlabel(x, fontsize=TEXT)
    axes.set_ylabel(y, fontsize=TEXT)
