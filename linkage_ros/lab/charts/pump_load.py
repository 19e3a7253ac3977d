# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Panels of a pump's settled motions over the speed and the motor's torque."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.gridspec import SubplotSpec

from linkage_ros.lab.charts.page import Shade
from linkage_ros.lab.charts.pump_states import (
    AVERAGED,
    REST,
    UNSTABLE,
    add_panel,
    label_axes,
    state_style,
)
from linkage_ros.lab.charts.sizes import SMALL, TEXT
from linkage_ros.lab.pump.pump import Analysis
from linkage_ros.numeric import Array
from linkage_ros.palette import BLACK, fractions

_MOTOR = fractions(BLACK)


def draw_load_curve(axes: Axes, analysis: Analysis, colors: list[Shade]) -> None:
    """The mean torque that the motions take over their speed, and where the motor gives it."""
    damping = analysis.motor.damping
    for number, stretch in enumerate(analysis.averaged):
        axes.plot(
            [one.speed for one in stretch], [one.load for one in stretch], ':', color=AVERAGED,
            linewidth=2.2, zorder=4, label='' if number else 'averaged, one harmonic',
        )  # fmt: skip
    for (torque, speed, _, _), color, line in _pieces(analysis, colors):
        axes.plot(speed, torque - damping * speed, line, color=color, linewidth=2.2)
    top = max((one.speed for stretch in analysis.averaged for one in stretch), default=1.0)
    speeds = np.array((0.0, top))
    axes.plot(
        speeds, analysis.motor.at(speeds), '-', color=_MOTOR, linewidth=1.4,
        label=f'motor, M0 = {analysis.motor.torque:g} N m',
    )  # fmt: skip
    for kind, motion in analysis.branch.boundaries:
        axes.plot(
            speeds, motion.torque - damping * speeds, '-.', color=REST, linewidth=1,
            label=f'{kind}, M0 = {motion.torque:.4g} N m',
        )  # fmt: skip
    for state, color in zip(analysis.states, colors, strict=True):
        axes.plot(state.speed, state.torque - damping * state.speed, **state_style(state, color))
    axes.set_xlim(0, top)
    axes.set_ylim(0, None)
    axes.legend(fontsize=SMALL)
    label_axes(axes, 'Mean crank speed w, rad/s', 'Mean torque on the crank, N m')


def draw_torques(
    figure: Figure, cell: SubplotSpec, analysis: Analysis, colors: list[Shade]
) -> None:
    """Speed, stroke and flow over the motor's torque."""
    rows = cell.subgridspec(3, 1, hspace=0.06)
    labels = 'Speed w, rad/s', 'Stroke s, m', 'Flow s w, m/s'
    for number, words in enumerate(labels):
        axes = add_panel(
            figure, rows[number], '' if number else "Settled motions over the motor's torque"
        )
        for values, color, line in _pieces(analysis, colors):
            axes.plot(values[0], values[number + 1], line, color=color, linewidth=2)
        for one in analysis.branch.bistable_ranges():
            axes.axvspan(one.low, one.high, color='0.94', zorder=0)
        for state, color in zip(analysis.states, colors, strict=True):
            value = (state.speed, state.stroke, state.flow)[number]
            axes.plot(state.torque, value, **state_style(state, color))
        axes.axvline(analysis.motor.torque, color=_MOTOR, linewidth=1)
        axes.set_xlim(0, None)
        axes.set_ylim(0, None)
        axes.tick_params(labelbottom=number == len(labels) - 1)
        axes.set_ylabel(words, fontsize=SMALL)
    two = ', '.join(
        f'{one.low:.4g} to {one.high:.4g} N m' for one in analysis.branch.bistable_ranges()
    )
    axes.set_xlabel(
        f"Motor's torque at rest M0, N m\n(two stable states: {two or 'nowhere here'})",
        fontsize=TEXT,
    )


def _pieces(analysis: Analysis, colors: list[Shade]) -> Iterator[tuple[Array, Shade, str]]:
    """The pieces of the branch as arrays of torque, speed, stroke and flow; colours and lines."""
    for motions, stable in analysis.branch.pieces:
        color = REST if stable else UNSTABLE
        for state, own in zip(analysis.states, colors, strict=True):
            if stable and motions[0].speed <= state.speed <= motions[-1].speed:
                color = own
        values = np.array([(one.torque, one.speed, one.stroke, one.flow) for one in motions]).T
        yield values, color, '-' if stable else '--'
