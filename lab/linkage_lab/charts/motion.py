# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_chart motion: curves of one mechanism over a period, or of several side by side."""

import argparse
import cmath
import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from linkage_lab.charts.curves import DESIGN_COLORS, NOISE
from linkage_lab.charts.motion_sheet import draw_sheet
from linkage_lab.charts.sketch import DRAWN_AT, sketch_at
from linkage_lab.command_line import FORMATS
from linkage_lab.output import doubts, name_of, new_file, pictures, rounded, save_csv
from linkage_lab.period import Period, extent, extents, period_to_show, stepped
from linkage_ros import ConfigurationError, cli, load

_PERIOD_OPTIONS = 'acceleration', 'reactions', 'fluctuation'  # of `period_to_show`


def motion(options: argparse.Namespace) -> None:
    """Draws one period of a mechanism, or of several mechanisms side by side; writes a table.

    Raises:
        ConfigurationError: A mechanism or an option is invalid, or a file cannot be written.
    """
    designs = _designs(options)
    names = [*designs]
    stem = 'comparison' if len(names) > 1 else f'{names[0]}_motion'
    drawn, table = pictures(options, stem), new_file(options, options.out / f'{stem}.csv')
    flywheel = None
    if options.fluctuation is not None:
        flywheel = pictures(options, f'{names[0]}_flywheel')
    given = {name: value for name in _PERIOD_OPTIONS if (value := getattr(options, name))}
    shown = [
        period_to_show(source, design, options.rpm, **given) for source, design in designs.values()
    ]
    linkages = {name: design for name, (_, design) in designs.items()}
    first = linkages[names[0]]
    periods = dict(zip(names, (period for period, _ in shown), strict=True))
    _require_one_axis(periods.values())
    driven = [] if options.acceleration else _driven_by_loads(linkages, periods)
    gaps = (period.gap_note for period in periods.values())
    cli.print_notes([*doubts(*linkages.values()), *gaps, *driven])
    period, title = shown[0]
    if len(names) > 1:
        lines, remarks = _compare(periods, table), []
    else:
        _save_table(period, options, table)
        lines, remarks = [', '.join(title)], _remarks(first, period, title)
    files = [*drawn, table]
    if flywheel is not None:
        from linkage_lab.charts.flywheel_sheet import size_flywheel  # needs SciPy

        motor = getattr(first.drive, 'motor', None)
        lines += size_flywheel(period, motor, options.fluctuation, names[0], flywheel)
        files = [*flywheel, *files]
    sketches = {name: sketch_at(linkages[name], one, _shown(one)) for name, one in periods.items()}
    draw_sheet(sketches, periods, remarks, options, drawn)
    if options.json:
        cli.print_json(_as_json(periods, lines, files))
    else:
        print(*lines, *files, sep='\n')


def _require_one_axis(periods: Iterable[Period]) -> None:
    """Requires motions that can be drawn over the same axis.

    Raises:
        ConfigurationError: They have different variables, or efforts of different kinds.
    """
    if len({(period.across, period.effort) for period in periods}) > 1:
        raise ConfigurationError(
            'a motion along a law is drawn over time, that of a driven slide over its position '
            'and with its force, the others over the crank angle: draw them separately, or give '
            '--rpm'
        )


def _save_table(period: Period, options: argparse.Namespace, path: Path) -> None:
    """Writes the columns of a period, or with --csv at even steps, as CSV.

    Raises:
        ConfigurationError: The file cannot be written, or even steps are not possible.
    """
    columns = period.with_gaps()
    if options.csv is not None:
        columns = stepped(period, options.csv, reactions=options.reactions)
    head = [f'{name} [{unit}]' for name, (unit, _) in columns.items()]
    rows = zip(*(column.values.tolist() for column in columns.values()), strict=True)
    save_csv(path, head, ([None if math.isnan(x) else x for x in row] for row in rows))


def _remarks(design: Any, period: Period, title: Sequence[str]) -> list[str]:
    """Returns the description of one mechanism on its sheet."""
    kind, (_, about, *further) = design.mechanism_words, title
    power = f'mean power {rounded(_mean_power(period))} W'
    has_power = period.columns['driving_power'].values.any()  # a note says if it has not
    return [
        about if about.startswith(kind) else f'{kind}, {about}',  # if the file's name is the kind
        *further,
        *([power] if has_power else ()),
        f'shown at {_place(period)}',
    ]


def _as_json(
    periods: Mapping[str, Period], lines: Sequence[str], files: Iterable[Path]
) -> dict[str, Any]:
    """Returns the mean power and the extent of each quantity over the period, by design."""
    designs = {}
    for name, period in periods.items():
        columns = period.columns
        found = extents(period.x, np.array([column.values for column in columns.values()]))
        designs[name] = {
            'mean_power': _mean_power(period),
            'quantities': {
                quantity: {'unit': column.unit, **extent._asdict()}
                for (quantity, column), extent in zip(columns.items(), found, strict=True)
            },
        }
    return {'text': [*lines], 'files': [*map(str, files)], 'designs': designs}


def _mean_power(period: Period) -> float:
    """Returns the mean power, W, or 0 if it is a rounding error."""
    mean, largest = period.mean_power, np.abs(period.columns['driving_power'].values).max()
    return mean if math.isinf(mean) or abs(mean) > NOISE * largest else 0.0


def _driven_by_loads(designs: Mapping[str, Any], periods: Mapping[str, Period]) -> list[str]:
    """Notes designs whose loads drive the crank on average, unless a gas does, as in an engine."""
    return [
        f'{name}: the loads drive the crank: mean power {rounded(period.mean_power)} W; did '
        'you mean loads of the other sign?'
        for name, period in periods.items()
        if period.is_driven_by_loads
        and not any(getattr(load, 'bore', None) for load in designs[name].mechanism.loads)
    ]


def _designs(options: argparse.Namespace) -> dict[str, tuple[str, Any]]:
    """Returns parameter file and configuration of each mechanism, by its name.

    Raises:
        ConfigurationError: There are too many mechanisms, or two have the same name.
    """
    chosen = options.linkage or ['']
    count, most = len(options.params) * len(chosen), len(DESIGN_COLORS)
    is_for_one = options.fluctuation is not None or options.csv is not None
    if count > most or (count > 1 and is_for_one):
        raise ConfigurationError(
            f'{count} mechanisms: must be at most {most}, and only one with --fluctuation or --csv'
        )
    for source in map(Path, options.params):
        if source.suffix in {'.csv', *(f'.{x}' for x in FORMATS)}:
            raise ConfigurationError(
                f'{source}: give parameter files alone; pictures and tables are named after them, '
                'and written into the folder --out'
            )
    found: dict[str, tuple[str, Any]] = {}
    for source in options.params:
        configuration = load(source)
        for linkage in chosen:
            design = configuration.linkage(linkage)
            name = name_of(source, design)
            if name in found:
                raise ConfigurationError(f'{name} is given twice: give each file another name')
            found[name] = source, design
    return found


def _compare(periods: Mapping[str, Period], path: Path) -> list[str]:
    """Writes a CSV file with a row per design; returns a table with a line per measure."""
    rows = {name: _measures(period) for name, period in periods.items()}
    measures = next(iter(rows.values())).keys()
    save_csv(path, ['design', *measures], ([name, *row.values()] for name, row in rows.items()))
    width = 2 + max(12, *map(len, rows))
    lines = [' ' * 32 + ''.join(f'{name:>{width}}' for name in rows)]
    for name in measures:
        values = [row[name] for row in rows.values()]
        cells = ['-' if value is None else rounded(value) for value in values]
        if set(cells) != {'-'}:
            lines.append(f'{name:<32}' + ''.join(f'{cell:>{width}}' for cell in cells))
    return lines


def _measures(period: Period) -> dict[str, float | None]:
    """Computes the measures of a design by name and unit; None if a measure does not apply."""
    structure, columns, travel = period.solver.structure, period.columns, period.travel
    output = structure.links[structure.output_index]
    position = extent(period.x, period.motion(output.name, 'position').values)
    extremes = travel.extremes if travel else (position.low, position.high)
    distance = extremes[1] - extremes[0] if extremes else None  # None if it turns fully
    transmission = None
    if travel and travel.transmission:
        smallest, largest = travel.transmission
        transmission = math.degrees(min(smallest, math.pi - largest))
    effort = extent(period.x, columns[period.effort].values)
    word, unit = period.effort.removeprefix('driving_'), period.driven.units.effort
    shaking_force = None
    if 'shaking_force.x' in columns:
        components = (columns[f'shaking_force.{axis}'].values for axis in 'xy')
        shaking_force = extent(period.x, np.hypot(*components)).high
    return {
        'swing [deg]': None if output.slides or distance is None else math.degrees(distance),
        'stroke [m]': distance if output.slides else None,
        'time ratio': travel.time_ratio if travel else None,
        'least transmission angle [deg]': transmission,
        f'peak {word} [{unit}]': max(-effort.low, effort.high),
        f'rms {word} [{unit}]': effort.rms,
        'mean power [W]': _mean_power(period),
        'peak shaking force [N]': shaking_force,
    }


def _shown(period: Period) -> int:
    """Returns the index of the sample at which the mechanism is shown, the nearest to its drawing.

    A mechanism without a drawing is shown at the crank angle `DRAWN_AT`.
    """
    drawn = period.solver.mechanism.drawn
    if drawn is None:
        crank = period.motion(period.solver.links[0], 'position').values
        apart = np.exp(1j * crank) - cmath.rect(1.0, math.radians(DRAWN_AT))
    elif period.driven.slides:
        apart = period.crank - drawn.position
    else:
        turns = period.solver.reach.period_turns
        apart = np.exp(1j * (period.crank - drawn.position) / turns) - 1.0
    return int(np.abs(apart).argmin())


def _place(period: Period) -> str:
    """Describes the position at which the mechanism is shown."""
    place = float(period.crank[_shown(period)])
    if period.driven.slides:
        return f'{period.driven.name} {place:.4g} m'
    return f'{period.driven.name} {math.degrees(place):.4g} deg'
