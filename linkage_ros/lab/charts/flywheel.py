# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Draws speed and torque of a crank with a flywheel, and a motor in the torque-speed plane."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from linkage_ros.dynamics.period import Period
from linkage_ros.lab.charts.axes import chart, over_crank
from linkage_ros.lab.flywheel import Cycle
from linkage_ros.motion.drives import Motor
from linkage_ros.palette import BLACK, COLORS, FIRST, GREY, SECOND, fractions

_RPM = 30 / math.pi


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
    """
    *_, smooth = cycles.values()
    degrees, torque = np.degrees(period.crank), period.columns['driving_torque'].values
    with chart(path, 6.4 if motor is None else 9.2, '\n'.join(title)) as figure:
        speeds, torques, *planes = figure.subplots(2 if motor is None else 3, 1)
        for (name, cycle), color in zip(cycles.items(), (SECOND, COLORS['crank']), strict=False):
            angles = np.degrees(cycle.crank)
            speeds.plot(angles, _RPM * cycle.velocity, color=fractions(color), label=name)
        words = 'driving torque at a constant speed', 'mean torque, with the flywheel'
        torques.plot(degrees, torque, color=fractions(FIRST), label=words[0])
        torques.plot(angles, smooth.torque, color=fractions(BLACK), label=words[1])
        over_crank(speeds, period.crank, 'Crank speed, rpm')
        over_crank(torques, period.crank, 'Torque, N m')
        torques.set_xlabel('Crank angle, deg')
        if motor is not None:
            _draw_plane(planes[0], *motor, smooth)
        for axes in (speeds, torques, *planes):
            axes.legend(loc='lower left', bbox_to_anchor=(0, 0.98), ncols=3)


def _draw_plane(axes: Axes, motor: Motor, carried: Cycle | None, smooth: Cycle) -> None:
    """Draws a motor's line, the torque of the mechanism, and the motor's motion."""
    cycle, words = carried or smooth, 'taken by the mechanism, with the flywheel'
    axes.plot(_RPM * cycle.velocity, cycle.demand, color=fractions(FIRST), label=words)
    slope = -motor.damping / _RPM
    point = _RPM * cycle.speed, motor.at(cycle.speed)
    axes.axline(point, slope=slope, color=fractions(GREY), label="the motor's line")
    if carried is not None:
        axes.plot(
            _RPM * carried.velocity, carried.torque, color=fractions(BLACK), linewidth=4.0,
            solid_capstyle='butt', label='where the motor runs',
        )  # fmt: skip
    axes.set(xlabel='Crank speed, rpm', ylabel='Torque, N m')
