# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_chart motion and movie: one period at a given speed, or of a settled wind pump."""

import argparse
import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from linkage_ros import ConfigurationError, Solver, travel
from linkage_ros.lab.charts.linkage import SECONDS, draw_movie
from linkage_ros.lab.charts.motion import DESIGN_COLORS, DRAWN_AT, draw_motion
from linkage_ros.lab.flywheel import size_flywheel
from linkage_ros.lab.output import folder, progress, save_csv
from linkage_ros.lab.period import Period, SpeedDrivenPeriod, extent, mean
from linkage_ros.lab.pump.periodic_motion import PeriodicMotion
from linkage_ros.lab.pump.settling import settle
from linkage_ros.parameters.configuration import Configuration, load
from linkage_ros.parameters.descriptions import motor_line
from linkage_ros.parameters.presets import find_file
from linkage_ros.units import radians_per_second


def motion(options: argparse.Namespace) -> None:
    """Draws one period of a mechanism, or of several mechanisms side by side; writes a table.

    Args:
        options: Parsed command-line options.

    Raises:
        ConfigurationError: A mechanism or an option is invalid, or a file cannot be written.
    """
    names = _names(options)
    others = {x: getattr(options, x) for x in ('acceleration', 'reactions', 'fluctuation')}
    designs = [load(source) for source in options.params]
    shown = [
        _show(source, design, options.rpm, **others)
        for source, design in zip(options.params, designs, strict=True)
    ]
    periods = dict(zip(names, (period for period, _ in shown), strict=True))
    (period, title), *more = shown
    stem = options.out / ('comparison' if more else f'{names[0]}_motion')
    picture, table = stem.with_name(f'{stem.name}.png'), stem.with_name(f'{stem.name}.csv')
    with folder(options.out):
        if more:
            measures = {name: _measures(one) for name, one in periods.items()}
            head = ['design', *measures[names[0]]]
            save_csv(table, head, ([name, *row.values()] for name, row in measures.items()))
            lines, notes = [*_lines(measures)], []
        else:
            head = [f'{name} [{column.unit}]' for name, column in period.columns.items()]
            columns = [column.values for column in period.columns.values()]
            save_csv(table, head, np.stack(columns, axis=-1).tolist())
            lines, notes = (
                [', '.join(title)],
                [*title[1:], f'drawn at crank angle {DRAWN_AT:g} deg'],
            )
        if options.fluctuation is not None:
            motor = getattr(designs[0].drive, 'motor', None)
            flywheel = options.out / f'{names[0]}_flywheel.png'
            lines += [*size_flywheel(period, motor, options.fluctuation, names[0], flywheel)]
            lines.append(str(flywheel))
        draw_motion(periods, notes, picture)
    print(*lines, picture, table, sep='\n')


def movie(options: argparse.Namespace) -> None:
    """Writes a movie of a mechanism.

    Args:
        options: Parsed command-line options.

    Raises:
        ConfigurationError: The mechanism or the speed is invalid, or the file cannot be written.
    """
    period, (name, about, speed, *_) = _show(options.params, load(options.params), options.rpm)
    share = 2 * math.pi / SECONDS / abs(period.speed or math.inf)
    title = [name, about, speed, f'shown at {share:.3g} of its speed']
    with folder(options.out.parent):
        draw_movie(period, title, options.out)
    print(', '.join(title), options.out, sep='\n')


def _names(options: argparse.Namespace) -> list[str]:
    """Returns the name of each mechanism's parameter file.

    Raises:
        ConfigurationError: There are too many mechanisms, or two have the same name.
    """
    count, most = len(options.params), len(DESIGN_COLORS)
    if count > most or (count > 1 and options.fluctuation is not None):
        raise ConfigurationError(
            f'{count} mechanisms: must be at most {most}, and only one with --fluctuation'
        )
    names = [find_file(source).stem for source in options.params]
    if len(set(names)) < count:
        raise ConfigurationError(f'{", ".join(names)}: give each file another name')
    return names


def _show(
    source: str, design: Configuration, rpm: float | None, **others: Any
) -> tuple[Period, list[str]]:
    """Computes the period to draw.

    Returns:
        The period, and its title: name, class, speed, and further lines.

    Raises:
        ConfigurationError: The mechanism or the options cannot be used.
    """
    mechanism, name, kind = design.mechanism, find_file(source).stem, design.kind.mechanism
    others = {option: value for option, value in others.items() if value}
    settles = Solver(mechanism).mobility is None  # its motor determines the motion
    compute = _settled if settles else _driven
    period, (group, *lines) = compute(source, mechanism, design.drive, rpm, others)
    about = [kind if kind != name else '', mechanism.assembly, group]
    return period, [name, ', '.join(filter(None, about)), *lines]


def _driven(
    source: str, mechanism: Any, drive: Any, rpm: float | None, others: dict[str, Any]
) -> tuple[Period, list[str]]:
    """Computes a period at a given speed; describes it by Grashof class, speed and travel.

    Raises:
        ConfigurationError: No speed is given, options exclude each other, or the reactions have
            no finite value.
    """
    rpm = getattr(drive, 'rpm', None) if rpm is None else rpm
    if rpm is None:
        raise ConfigurationError(
            f'{source} has no crank speed of its own: give a speed, such as --rpm 60'
        )
    acceleration = others.get('acceleration', 0.0)
    if 'fluctuation' in others and (acceleration or not rpm):
        raise ConfigurationError(
            f'--fluctuation is for a steady speed other than 0, not for {rpm:g} rpm and '
            f'{acceleration:g} rad/s^2: change --rpm or --acceleration, or leave it out'
        )
    period = SpeedDrivenPeriod(
        mechanism, radians_per_second(rpm), acceleration, reactions='reactions' in others
    )
    accelerated = f', {acceleration:g} rad/s^2' if acceleration else ''
    grashof = period.solver.reach.grashof
    return period, [grashof, f'{rpm:g} rpm{accelerated}', *travel(period.solver).words()]


def _settled(
    source: str, mechanism: Any, drive: Any, rpm: float | None, others: dict[str, Any]
) -> tuple[Period, list[str]]:
    """Computes the steady motion of a wind pump, and describes it in lines of text.

    Raises:
        ConfigurationError: The pump does not settle, or an option does not apply to it.
    """
    for option in others:
        raise ConfigurationError(
            f'--{option} is for a crank at a given speed, but the motor of {source} determines '
            f'its speed: leave --{option} out'
        )
    name, given = ('start_rpm', drive.start_rpm) if rpm is None else ('--rpm', rpm)
    if not given > 0:
        raise ConfigurationError(
            f'{name} = {given:g}: must be above 0 rpm, because a wind_pump is started '
            'forwards before its motor drives it; try --rpm 20'
        )
    speed = radians_per_second(given)
    settled = settle(mechanism, drive.motor, speed, progress)
    low, high = settled.turning_points.min(), settled.turning_points.max()
    repeats = f', repeats after {settled.turns} turns' if settled.turns > 1 else ''
    return settled_turn(settled), [
        '', motor_line(drive.motor), f'from {speed:.4g} rad/s',
        f'settled at {settled.speed:.4g} rad/s{repeats}',
        f'stroke {settled.stroke:.4g} m ({low:.4g} to {high:.4g} m)',
        f'flow (stroke x speed) {settled.flow:.4g} m/s',
    ]  # fmt: skip


def settled_turn(motion: PeriodicMotion) -> Period:
    """Samples one period of a wind pump's steady state in steps of 0.5 deg."""
    crank = np.linspace(0, 2 * math.pi * motion.turns, 720 * motion.turns + 1)
    state = motion.states(crank)
    power = mean(crank, state.torque) * motion.speed
    return Period(motion.solver, crank, state, speed=motion.speed, mean_power=power)


def _measures(period: Period) -> dict[str, float | None]:
    """Computes the measures of a design by name and unit; None if a measure does not apply."""
    solver, columns = period.solver, period.columns
    link, found = solver.structure.links[-1], travel(solver) if solver.mobility else None
    way, torque = (
        extent(period.crank, columns[name].values)
        for name in (f'{link.name}.position', 'driving_torque')
    )
    angles = found.transmission if found else None
    force = [columns[name].values for name in columns if name.startswith('shaking_force')]
    return {
        'swing [deg]': None if link.slides else math.degrees(way.high - way.low),
        'stroke [m]': way.high - way.low if link.slides else None,
        'time ratio': found.time_ratio if found else None,
        'least transmission angle [deg]': (
            math.degrees(min(angles[0], math.pi - angles[1])) if angles else None
        ),
        'peak torque [N m]': max(-torque.low, torque.high),
        'rms torque [N m]': torque.rms,
        'mean power [W]': period.mean_power,
        'peak shaking force [N]': float(np.hypot(*force).max()) if force else None,
    }


def _lines(measures: dict[str, dict[str, float | None]]) -> Iterator[str]:
    """Formats a table of the designs, with a line per measure that applies to any of them."""
    width = 2 + max(12, *map(len, measures))
    yield ' ' * 32 + ''.join(f'{name:>{width}}' for name in measures)
    for name in next(iter(measures.values())):
        cells = ['-' if row[name] is None else f'{row[name]:.4g}' for row in measures.values()]
        if set(cells) != {'-'}:
            yield f'{name:<32}' + ''.join(f'{cell:>{width}}' for cell in cells)
