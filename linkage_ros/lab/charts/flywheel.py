# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Draws speed and torque of a crank with a flywheel, and a motor in the torque-speed plane."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from linkage_ros.dynamics.period import Period
from linkage_ros.lab.charts.sizes import DPI, SMALL, TITLE, WIDTH
from linkage_ros.lab.flywheel import Cycle
from linkage_ros.motion.drives import Motor
from linkage_ros.palette import BLACK, COLORS, FIRST, GREY, SECOND, fractions
from linkage_ros.units import radians_per_second

_RPM = 1 / radians_per_second(1.0)


def draw_flywheel(
    period: Period,
    cycles: dict[str, Cycle],
    motor: tuple[Motor, Cycle | None] | None,
    title: Sequence[str],
    path: Path,
) -> None:
    """Draws speed and torque over the crank angle, and the torque-speed plane of a motor.

    Args:
        period: The mechanism at a constant speed.
        cycles: Steady motions under a constant torque by name; the last is with the flywheel.
        motor: The motor, and the steady motion under it with the flywheel; None: no motor.
        title: Lines of the title.
        path: The PNG file, replaced if it exists.

    Raises:
        OSError: The picture cannot be written.
    """
    figure = Figure(figsize=(WIDTH, 6.4 if motor is None else 9.2), dpi=DPI, layout='constrained')
    figure.suptitle('\n'.join(title), fontsize=TITLE, parse_math=False)
    speeds, torques, *planes = figure.subplots(2 if motor is None else 3, 1)
    for (name, cycle), color in zip(cycles.items(), (SECOND, COLORS['crank']), strict=False):
        angles, shade = np.degrees(cycle.crank), fractions(color)
        speeds.plot(angles, _RPM * cycle.velocity, color=shade, label=name)
    torques.plot(
        np.degrees(period.crank), period.columns['driving_torque'].values,
        color=fractions(FIRST), label='driving torque at a constant speed',
    )  # fmt: skip
    with_flywheel = [*cycles.values()][-1]
    torques.plot(
        np.degrees(with_flywheel.crank), with_flywheel.torque, color=fractions(BLACK),
        label='mean torque, with the flywheel',
    )  # fmt: skip
    for axes, words in ((speeds, 'Crank speed, rpm'), (torques, 'Torque, N m')):
        _finish(axes, words, 'Crank angle, deg')
        axes.set_xlim(0, math.degrees(period.crank[-1]))
        axes.set_xticks(np.linspace(0, math.degrees(period.crank[-1]), 9))
    if motor is not None:
        _draw_plane(planes[0], *motor, with_flywheel)
    figure.savefig(path)


def _draw_plane(axes: Axes, motor: Motor, carried: Cycle | None, even: Cycle) -> None:
    """Draws a motor's line, the torque of the mechanism, and the motor's motion."""
    cycle = carried or even
    axes.plot(
        _RPM * cycle.velocity, cycle.demand, color=fractions(FIRST),
        label='taken by the mechanism, with the flywheel',
    )  # fmt: skip
    low, high = axes.get_xlim()
    line = np.array([low - 0.5 * (high - low), high + 0.5 * (high - low)])
    axes.plot(
        line, motor.at(line / _RPM) + 0.0 * line, color=fractions(GREY), label="the motor's line"
    )
    if carried is not None:
        axes.plot(
            _RPM * carried.velocity, carried.torque, color=fractions(BLACK), linewidth=4.0,
            solid_capstyle='butt', label='where the motor runs',
        )  # fmt: skip
    _finish(axes, 'Torque, N m', 'Crank speed, rpm')


def _finish(axes: Axes, ordinate: str, abscissa: str) -> None:
    axes.set_ylabel(ordinate, fontsize=SMALL)
    axes.set_xlabel(abscissa, fontsize=SMALL)
    axes.tick_params(labelsize=SMALL)
    axes.grid(color='0.9', linewidth=0.6)
    axes.legend(fontsize=SMALL, frameon=False, loc='lower left', bbox_to_anchor=(0, 0.98), ncols=3)
