# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_chart motion --fluctuation: the flywheel of a mechanism, and its motor."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from linkage_ros.errors import LinkageError
from linkage_ros.lab.charts.axes import chart, over_crank
from linkage_ros.lab.flywheel import Crank, Cycle
from linkage_ros.lab.period import Period, extent
from linkage_ros.motion.drives import Drive, Motor, TorqueDrive
from linkage_ros.palette import BLACK, COLORS, FIRST, GREY, SECOND, fractions
from linkage_ros.parameters.descriptions import motor_line
from linkage_ros.units import radians_per_second

_RPM = 1 / radians_per_second(1.0)


def size_flywheel(
    period: Period, drive: Drive, fluctuation: float, name: str, picture: Path
) -> list[str]:
    """Finds the flywheel for a period at a constant speed, and draws it.

    Args:
        period: The period.
        drive: The drive; its motor is assessed, if it has one.
        fluctuation: Allowed difference of largest and smallest speed, relative to the mean.
        name: Name of the parameter file.
        picture: The PNG file, replaced if it exists.

    Returns:
        Lines about it.

    Raises:
        OSError: The picture cannot be written.
    """
    crank, speed = Crank(period.solver.mechanism), period.speed
    added, energy = crank.inertia_for(fluctuation, speed), crank.energy(speed)
    cycles, total = {}, energy / (fluctuation * speed**2)
    try:
        cycles['without flywheel'] = crank.cycle(speed, 0.0)
        bare = f'{cycles["without flywheel"].fluctuation:.4g}'
    except LinkageError as error:
        bare = f'none: {error}'
    cycles['with the flywheel'] = crank.cycle(speed, added)
    lines = [
        _demand(period, 'driving_torque', period.mean_power / speed),
        _demand(period, 'driving_power', period.mean_power),
        f'fluctuation {fluctuation:g}: add {added:.5g} kg m^2 to the crank (without: {bare})',
        f'to first order: {energy:.4g} J between the extremes, {total:.5g} kg m^2 in total',
    ]
    motor = drive.motor if isinstance(drive, TorqueDrive) else None
    carried: Cycle | None = None
    if motor:
        needed = f'where the cycle takes {period.mean_power / speed:.4g} N m'
        lines.append(f'{motor_line(motor)}: {motor.at(speed):.4g} N m at this speed, {needed}')
        carried, words = _carried(crank, motor, speed, added)
        lines += [
            f'with the flywheel: {words}',
            f'without: {_carried(crank, motor, speed, 0.0)[1]}',
        ]
    _draw(period, cycles, (motor, carried) if motor else None, [name, *lines], picture)
    return lines


def _demand(period: Period, name: str, average: float) -> str:
    """Peak, rms and mean of torque or power at a constant speed."""
    column = period.columns[name]
    size, unit = extent(period.crank, column.values), column.unit
    peak = max(abs(size.low), abs(size.high))
    return (
        f'{name.replace("_", " ")}: peak {peak:.4g} {unit}, rms {size.rms:.4g} {unit}, '
        f'mean {average:.4g} {unit}'
    )


def _carried(crank: Crank, motor: Motor, speed: float, added: float) -> tuple[Cycle | None, str]:
    """The cycle under the motor, if any, and its description."""
    try:
        cycle = crank.under(motor, speed, added)
    except LinkageError as error:
        return None, str(error)
    if cycle is None:
        return None, 'the motor does not carry the cycle'
    rpm = _RPM * cycle.speed
    return (
        cycle,
        f'the motor carries the cycle at {rpm:.4g} rpm, fluctuation {cycle.fluctuation:.4g}',
    )


def _draw(
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
