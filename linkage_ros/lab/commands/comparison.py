# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_chart motion of several mechanisms: pictures and one table."""

from __future__ import annotations

import argparse
import csv
import math
import pathlib
from typing import TypeAlias

import numpy as np

from linkage_ros.dynamics.period import Period, extent
from linkage_ros.dynamics.travel import travel
from linkage_ros.errors import ConfigurationError
from linkage_ros.lab.charts.comparison import COLORS, draw_comparison
from linkage_ros.lab.commands.motion import period_of
from linkage_ros.lab.commands.output import folder
from linkage_ros.parameters.configuration import load
from linkage_ros.parameters.presets import find_file

Measures: TypeAlias = dict[str, float | None]


def comparison(options: argparse.Namespace) -> None:
    """Draws mechanisms beside each other, and writes a table of their measures.

    Args:
        options: Options of the command line.

    Raises:
        ConfigurationError: A mechanism, the options or the folder cannot be used.
    """
    if options.fluctuation is not None:
        raise ConfigurationError('--fluctuation is for one mechanism: leave it or the others out')
    if len(options.params) > len(COLORS):
        count = len(options.params)
        raise ConfigurationError(f'{count} mechanisms: must be at most {len(COLORS)}')
    names = [find_file(source).stem for source in options.params]
    if len(set(names)) < len(names):
        raise ConfigurationError(f'{", ".join(names)}: give each file another name')
    periods = {}
    for name, source in zip(names, options.params, strict=True):
        given = argparse.Namespace(**vars(options) | {'params': source})
        periods[name], _ = period_of(given, load(source), name)
    measures = {name: _measures(period) for name, period in periods.items()}
    picture, table = (options.out / f'comparison.{suffix}' for suffix in ('png', 'csv'))
    with folder(options.out):
        _save(measures, table)
        draw_comparison(periods, picture)
    print(*_lines(measures), picture, table, sep='\n')


def _measures(period: Period) -> Measures:
    """Measures of designs by name and unit; None if a mechanism lacks one."""
    solver, columns = period.solver, period.columns
    link = solver.structure.links[-1]
    output = columns[f'{link.name}.position'].values
    way = extent(period.crank, output)
    swing, torque = way.high - way.low, extent(period.crank, columns['driving_torque'].values)
    found = travel(solver) if solver.mobility else None
    angles = found.transmission if found else None
    force = None
    if 'shaking_moment' in columns:
        x, y = (columns[f'shaking_force.{axis}'].values for axis in 'xy')
        force = float(np.hypot(x, y).max())
    return {
        'swing [deg]': None if link.slides else math.degrees(swing),
        'stroke [m]': swing if link.slides else None,
        'time ratio': found.time_ratio if found else None,
        'least transmission angle [deg]': math.degrees(_sharpest(*angles)) if angles else None,
        'peak torque [N m]': max(abs(torque.low), abs(torque.high)),
        'rms torque [N m]': torque.rms,
        'mean power [W]': period.mean_power,
        'peak shaking force [N]': force,
    }


def _sharpest(low: float, high: float) -> float:
    """The transmission angle farthest from 90 deg, as an acute angle."""
    return min(low, math.pi - high)


def _save(measures: dict[str, Measures], path: object) -> None:
    with pathlib.Path(str(path)).open('w', newline='', encoding='utf-8') as stream:
        writer = csv.writer(stream)
        writer.writerow(['design', *next(iter(measures.values()))])
        for name, row in measures.items():
            writer.writerow([name, *('' if x is None else repr(float(x)) for x in row.values())])


def _lines(measures: dict[str, Measures]) -> list[str]:
    """The table as text, one line per measure."""
    width = max(12, *map(len, measures))
    names = [*next(iter(measures.values()))]
    rows = [[measures[design][name] for design in measures] for name in names]
    cells = [('', [*measures])] + [
        (name, ['-' if x is None else f'{x:.4g}' for x in row])
        for name, row in zip(names, rows, strict=True)
        if any(x is not None for x in row)
    ]
    return [f'{name:<32}' + ''.join(f'{x:>{width + 2}}' for x in row) for name, row in cells]
