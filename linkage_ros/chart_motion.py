# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_chart motion: a period at a given speed, or of what a wind pump settles at."""

from __future__ import annotations

import argparse

from linkage_ros.chart_output import folder, libraries, progress
from linkage_ros.core.curves import Curves, Period
from linkage_ros.core.mechanism import Linkage, WindPump
from linkage_ros.core.travel import travel
from linkage_ros.errors import ConfigurationError
from linkage_ros.motion.drives import Drive, Motor, TorqueDrive
from linkage_ros.parameters.configuration import find_file, load
from linkage_ros.units import radians_per_second


def motion(options: argparse.Namespace) -> None:
    """Draws one period of a mechanism and writes its table.

    Args:
        options: Of the command line.

    Raises:
        ConfigurationError: The mechanism, the speed or the folder cannot be used.
    """
    with libraries():
        from linkage_ros.charts.motion import draw_motion
    for flag, value, most, unit in (
        ('--rpm', options.rpm or 0.0, 1e6, 'rpm'),
        ('--acceleration', options.acceleration, 1e9, 'rad/s^2'),
    ):
        if not abs(value) <= most:
            raise ConfigurationError(
                f'{flag} {value:g}: must be a number from {-most:g} to {most:g} {unit}'
            )
    configuration, name = load(options.params), find_file(options.params).stem
    mechanism = configuration.mechanism
    if isinstance(mechanism, WindPump):
        period, words = _settled(options, mechanism, configuration.drive)
    else:
        period, words = _driven(options, mechanism, configuration.drive)
    title = [name, f'{configuration.kind.mechanism}, {mechanism.assembly}{words[0]}', *words[1:]]
    picture, table = options.out / f'{name}_motion.png', options.out / f'{name}_motion.csv'
    with folder(options.out):
        period.save(table)
        draw_motion(period, title, picture)
    print(', '.join(title))
    print(f'{picture}\n{table}')


def _driven(
    options: argparse.Namespace, mechanism: Linkage, drive: Drive
) -> tuple[Period, list[str]]:
    """A period at a given speed, and words about it.

    Raises:
        ConfigurationError: No speed is given, or the reactions have no finite value.
    """
    if options.rpm is None and isinstance(drive, TorqueDrive):
        raise ConfigurationError(
            f'{options.params} is driven by a torque: at which speed to draw it? Add --rpm 60'
        )
    rpm = drive.target if options.rpm is None else options.rpm
    curves = Curves(
        mechanism, radians_per_second(rpm), options.acceleration, reactions=options.reactions
    )
    accelerated = f', {options.acceleration:g} rad/s^2' if options.acceleration else ''
    grashof = curves.solver.mobility.grashof
    return curves, [f', {grashof}', f'{rpm:g} rpm{accelerated}', *travel(curves.solver).words()]


def _settled(
    options: argparse.Namespace, mechanism: WindPump, drive: Drive
) -> tuple[Period, list[str]]:
    """A turn of what a wind pump settles at, and words about it.

    Raises:
        ConfigurationError: It does not settle, or options ask for what it does not have.
    """
    with libraries():
        from linkage_ros.analysis.settled import SettledTurn
    if options.acceleration or options.reactions:
        raise ConfigurationError(
            '--acceleration and --reactions are for a crank at a given speed: '
            f'{options.params} moves as its motor drives it'
        )
    motor = drive.motor if isinstance(drive, TorqueDrive) else Motor()
    rpm = drive.initial_rpm if options.rpm is None else options.rpm
    speed = radians_per_second(rpm)
    turn = SettledTurn(mechanism, motor, speed, progress)
    return turn, ['', motor.words(), f'from {speed:.4g} rad/s', *turn.words()]
