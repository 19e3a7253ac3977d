# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_chart motion --fluctuation: the flywheel, and the motor that carries the cycle."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

from linkage_ros.dynamics.period import Period, extent
from linkage_ros.errors import LinkageError
from linkage_ros.motion.drives import Drive, Motor, TorqueDrive
from linkage_ros.parameters.descriptions import motor_line
from linkage_ros.quantities import Quantity

if TYPE_CHECKING:
    from linkage_ros.lab.flywheel import Cycle

FLUCTUATION = Quantity(
    'number', 'largest less smallest speed over the mean, which a flywheel keeps', '', 1e-6, 1.0
)


def size_flywheel(
    period: Period, drive: Drive, fluctuation: float, name: str, picture: Path
) -> list[str]:
    """Finds the flywheel for a period at a constant speed, and draws it.

    Args:
        period: The period.
        drive: The drive; the command judges its motor, if it has one.
        fluctuation: Wanted, largest less smallest speed over the mean over time.
        name: Name of the parameter file.
        picture: The PNG file; replaced if there is one.

    Returns:
        Lines about it.

    Raises:
        ConfigurationError: The crank stands still.
        OSError: The picture cannot be written.
    """
    from linkage_ros.lab.charts.flywheel import draw_flywheel
    from linkage_ros.lab.flywheel import EvenTorque, UnsteadyError

    mechanism = period.solver.mechanism
    even = EvenTorque(mechanism, period.speed)
    added, first = even.inertia_for(fluctuation), even.first_order(fluctuation)
    cycles: dict[str, Cycle] = {}
    try:
        cycles['without flywheel'] = even.cycle(0.0)
        bare = f'{cycles["without flywheel"].fluctuation:.4g}'
    except UnsteadyError as error:
        bare = f'none: {error}'
    cycles['with the flywheel'] = even.cycle(added)
    lines = [
        *_demands(period),
        f'fluctuation {fluctuation:g}: add {added:.5g} kg m^2 to the crank (without: {bare})',
        f'to first order: {even.energy:.4g} J between the extremes, {first:.5g} kg m^2 in total',
    ]
    judged: tuple[Motor, Cycle | None] | None = None
    if isinstance(drive, TorqueDrive):
        carried, words = _judge(period, drive.motor, added)
        judged = drive.motor, carried
        lines += words
    draw_flywheel(period, cycles, judged, [name, *lines], picture)
    return lines


def _demands(period: Period) -> list[str]:
    """Peak, rms and mean of torque and power at a constant speed."""
    lines = []
    for column, average in (
        ('driving_torque', period.mean_power / period.speed),
        ('driving_power', period.mean_power),
    ):
        found = period.columns[column]
        size = extent(period.crank, found.values)
        peak = max(abs(size.low), abs(size.high))
        lines.append(
            f'{column.replace("_", " ")}: peak {peak:.4g} {found.unit}, rms {size.rms:.4g} '
            f'{found.unit}, mean {average:.4g} {found.unit}'
        )
    return lines


def _judge(period: Period, motor: Motor, added: float) -> tuple[Cycle | None, list[str]]:
    """The steady motion under a motor with the flywheel, None: there is none; and words."""
    from linkage_ros.lab.flywheel import motor_cycle

    needed, given = period.mean_power / period.speed, motor.at(period.speed)
    at = f'{given:.4g} N m at this speed, where the cycle takes {needed:.4g} N m'
    lines = [f'{motor_line(motor)}: {at}']
    found: dict[str, Cycle | None] = {}
    for name, inertia in (('with the flywheel', added), ('without', 0.0)):
        try:
            found[name] = motor_cycle(period.solver.mechanism, motor, period.speed, inertia)
        except LinkageError as error:
            lines.append(f'{name}: {error}')
            continue
        cycle = found[name]
        lines.append(
            f'{name}: the motor does not carry the cycle'
            if cycle is None
            else f'{name}: the motor carries the cycle at {cycle.speed * 30 / math.pi:.4g} rpm, '
            f'fluctuation {cycle.fluctuation:.4g}'
        )
    return found.get('with the flywheel'), lines
