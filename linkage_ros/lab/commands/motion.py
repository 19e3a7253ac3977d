# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_chart motion and movie: a period at a given speed, or a settled wind pump."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import cast

import numpy as np

from linkage_ros.dynamics.period import Period, SpeedDrivenPeriod, extent, mean
from linkage_ros.dynamics.solver import Solver
from linkage_ros.dynamics.travel import travel
from linkage_ros.errors import ConfigurationError, LinkageError
from linkage_ros.lab.charts.flywheel import draw_flywheel
from linkage_ros.lab.charts.motion import draw_motion
from linkage_ros.lab.charts.movie import SECONDS, draw_movie
from linkage_ros.lab.commands.output import folder, progress, save_table
from linkage_ros.lab.flywheel import Cycle, EvenTorque, UnsteadyError, motor_cycle
from linkage_ros.lab.pump.periodic_motion import PeriodicMotion
from linkage_ros.lab.pump.settling import settle
from linkage_ros.model.structure import Mechanism
from linkage_ros.model.wind_pump import WindPump
from linkage_ros.motion.drives import Drive, Motor, SpeedDrive, TorqueDrive
from linkage_ros.parameters.configuration import Configuration, load
from linkage_ros.parameters.descriptions import motor_line
from linkage_ros.parameters.presets import find_file
from linkage_ros.units import radians_per_second


def motion(options: argparse.Namespace) -> None:
    """Draws one period of a mechanism and writes its table.

    Args:
        options: Options of the command line.

    Raises:
        ConfigurationError: The mechanism, the speed or the folder cannot be used.
    """
    configuration, name = load(options.params), find_file(options.params).stem
    period, title = period_of(options, configuration, name)
    picture, table = options.out / f'{name}_motion.png', options.out / f'{name}_motion.csv'
    with folder(options.out):
        flywheel = _flywheel(options, period, configuration.drive, name)
        save_table(table, period.columns.values())
        draw_motion(period, title, picture)
    print(', '.join(title), *flywheel, picture, table, sep='\n')


def movie(options: argparse.Namespace) -> None:
    """Draws the movie of a mechanism.

    Args:
        options: Options of the command line.

    Raises:
        ConfigurationError: The mechanism, the speed or the file cannot be used.
    """
    configuration, name = load(options.params), find_file(options.params).stem
    plain = argparse.Namespace(
        **vars(options), acceleration=0.0, reactions=False, fluctuation=None
    )
    period, (_, about, speed, *_) = period_of(plain, configuration, name)
    share = 2 * math.pi / SECONDS / abs(period.speed or math.inf)
    title = [name, about, speed, f'shown at {share:.3g} of its speed']
    with folder(options.out.parent):
        draw_movie(period, title, options.out, progress)
    print(', '.join(title), options.out, sep='\n')


def period_of(
    options: argparse.Namespace, configuration: Configuration, name: str
) -> tuple[Period, list[str]]:
    """Computes the period to draw.

    Args:
        options: Options of the command line.
        configuration: Configuration of the mechanism.
        name: Name of its file.

    Returns:
        The period, and its title: name, class, lines.

    Raises:
        ConfigurationError: The mechanism or the options cannot be used.
    """
    mechanism = configuration.mechanism
    if Solver(mechanism).mobility is None:  # it moves as its motor drives it
        drive = cast('TorqueDrive', configuration.drive)
        period, words = _settled(options, cast('WindPump', mechanism), drive)
    else:
        period, words = _driven(options, mechanism, configuration.drive)
    kind, (group, *lines) = configuration.kind.mechanism, words
    about = [kind if kind != name else '', mechanism.assembly, group]  # presets bear kinds' names
    return period, [name, ', '.join(filter(None, about)), *lines]


def _flywheel(
    options: argparse.Namespace, period: Period, drive: Drive, name: str
) -> list[str | Path]:
    """Sizes and draws the flywheel if a fluctuation is given; returns lines about it."""
    if options.fluctuation is None:
        return []
    picture = options.out / f'{name}_flywheel.png'
    return [*size_flywheel(period, drive, options.fluctuation, name, picture), picture]


def _driven(
    options: argparse.Namespace, mechanism: Mechanism, drive: Drive
) -> tuple[Period, list[str]]:
    """Computes a period at a given speed, its class, and lines about it.

    Raises:
        ConfigurationError: No speed is given, options exclude each other, or the reactions have
            no finite value.
    """
    rpm = options.rpm
    if options.fluctuation is not None and options.acceleration:
        raise ConfigurationError(
            '--fluctuation is for a steady speed, and --acceleration changes it: leave one out'
        )
    if rpm is None:
        if not isinstance(drive, SpeedDrive):
            raise ConfigurationError(
                f'{options.params} has no crank speed of its own: at which speed to draw it? '
                'Add --rpm 60'
            )
        rpm = drive.rpm
    period = SpeedDrivenPeriod(
        mechanism, radians_per_second(rpm), options.acceleration, reactions=options.reactions
    )
    accelerated = f', {options.acceleration:g} rad/s^2' if options.acceleration else ''
    grashof = period.solver.reach.grashof
    return period, [grashof, f'{rpm:g} rpm{accelerated}', *travel(period.solver).words()]


def _settled(
    options: argparse.Namespace, mechanism: WindPump, drive: TorqueDrive
) -> tuple[Period, list[str]]:
    """Computes the steady motion of a wind pump, and lines about it.

    Raises:
        ConfigurationError: It does not settle, or an option does not apply to it.
    """
    for flag, given in (
        ('--acceleration', options.acceleration),
        ('--reactions', options.reactions),
        ('--fluctuation', options.fluctuation),
    ):
        if given:
            raise ConfigurationError(
                f'{flag} is for a crank at a given speed, and {options.params} moves as its motor '
                f'drives it: leave {flag} out'
            )
    motor, rpm = drive.motor, drive.start_rpm if options.rpm is None else options.rpm
    if not rpm > 0:
        name = 'start_rpm' if options.rpm is None else '--rpm'
        raise ConfigurationError(
            f'{name} = {rpm:g}: must be above 0 rpm, because a wind_pump is started forwards and '
            'left to its motor; try --rpm 20'
        )
    speed = radians_per_second(rpm)
    settled = settle(mechanism, motor, speed, progress)
    low, high = settled.turning_points.min(), settled.turning_points.max()
    repeats = f', repeats after {settled.turns} turns' if settled.turns > 1 else ''
    words = [
        '', motor_line(motor), f'from {speed:.4g} rad/s',
        f'settled at {settled.speed:.4g} rad/s{repeats}',
        f'stroke {settled.stroke:.4g} m ({low:.4g} to {high:.4g} m)',
        f'flow (stroke x speed) {settled.flow:.4g} m/s',
    ]  # fmt: skip
    return settled_turn(settled), words


def settled_turn(motion: PeriodicMotion) -> Period:
    """One period of a steady state, in steps of 0.5 deg."""
    crank = np.linspace(0, 2 * math.pi * motion.turns, 720 * motion.turns + 1)
    position, rate, velocity = motion.at(crank)
    torque = Motor(motion.torque, motion.damping).at(rate)
    q, u = (crank, position), (rate, velocity)
    state = motion.solver.state(q, u, motion.solver.accelerations(q, u, torque))
    power = mean(crank, torque) * motion.speed
    return Period(motion.solver, crank, state, speed=motion.speed, mean_power=power)


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
        ConfigurationError: The crank stands still.
        OSError: The picture cannot be written.
    """
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
    """Finds the steady motion under a motor with the flywheel (None: none), and lines about it."""
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
