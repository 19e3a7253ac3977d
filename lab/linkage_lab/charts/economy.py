# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_chart economy: driving-torque error when each term is omitted, at several speeds."""

import argparse
import functools
import itertools
import math
import textwrap
import time
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from matplotlib.axes import Axes
from matplotlib.text import Text
from matplotlib.ticker import LogLocator, NullLocator
from matplotlib.transforms import Bbox

from linkage_lab import torque_models
from linkage_lab.output import (
    NUMBERS,
    SMALL,
    chart,
    doubts,
    name_of,
    new_file,
    pictures,
    progress,
    save_records,
)
from linkage_lab.sampling import peaks, samples
from linkage_lab.torque_models import STATIC, TorqueProgram
from linkage_ros import ConfigurationError, Mechanism, MechanismError, Solver, cli, load
from linkage_ros.formulas import Array
from linkage_ros.internals import radians_per_second
from linkage_ros.palette import (
    BLACK,
    BLUE,
    GREY,
    ORANGE,
    PURPLE,
    WHITE,
    Color,
    colors_of,
    fractions,
    mixed,
)

POINT_MASSES = 'coupler as two point masses'
_FULL = 'full model'
# Names of reduced models, with their numbers of harmonics or nodes.
_HARMONICS = {
    f'{n} harmonic{"s" if n > 1 else ""}': n for n in (1, 2, 3, 4, 5, 6, 7, 8, 10, 12, 16, 24, 32)
}
_TABLES = {f'table of {n} nodes': n for n in (8, 16, 32, 64, 128, 256, 512, 1024)}
_TIMED = 8  # one of this many angles is timed
_FACTORS = 0.25, 0.5, 1.0, 2.0, 4.0  # default speeds, relative to the mechanism's own speed
_SAMPLES = 2048  # evenly spaced torques: series are fitted to all, tables use a subset
_LEAST = 1e-4  # smaller errors are not drawn
_ROUNDING = 1e-12  # smaller errors are rounding errors
_ROOM = 0.88  # width of a group of bars, relative to the distance between groups
_OTHERS = {'gravity': GREY, STATIC: BLACK}
_MARKER = 5  # half of the size of a marker, pixels
_HATCHES = '///', '\\\\\\', 'xxx', '...'  # of loads, in turn
# Places of a label beside its point that are tried in turn: points, and alignments.
_BESIDE = (
    ((-7, 0), 'right', 'center'), ((2, 9), 'left', 'center'), ((7, 0), 'left', 'center'),
    ((-5, -8), 'right', 'center'), ((2, 15), 'left', 'center'), ((0, -8), 'center', 'top'),
)  # fmt: skip


class _Curve(NamedTuple):
    """The reduced models of one kind, and how they are drawn.

    Attributes:
        label: Label in the legend.
        models: Names of the models, each with the label of its point.
        marker: Shape of the points.
        size: Their size, points.
        color: Their colour.
    """

    label: str
    models: Mapping[str, object]
    marker: str
    size: float
    color: Color


_REDUCED = (
    _Curve('harmonics', _HARMONICS, 'o', 5, BLUE),
    _Curve('nodes of a table', _TABLES, 's', 5, ORANGE),
    _Curve('two point masses', {POINT_MASSES: ''}, '*', 9, PURPLE),
)


class _Model(NamedTuple):
    """A model of the driving torque: its program, and the number of values that must be known."""

    program: TorqueProgram
    parameters: int


class _FullTorque(NamedTuple):
    """The driving torque of the full model at a crank speed.

    Attributes:
        program: Program of the model.
        angles: Crank angles, rad, shape (n,).
        torques: Torques at these angles, N m, shape (n,).
        peak: Largest magnitude of the torque, also between these angles, N m.
    """

    program: TorqueProgram
    angles: Array
    torques: Array
    peak: float


# One simpler model at one speed, as in the JSON file:
#   mechanism: name of the parameter file
#   rpm: crank speed
#   left_out: the omitted term, or the reduced model
#   error: largest torque error over a period, relative to the peak of the full model's torque
#   operations, microseconds, parameters: savings; time of one evaluation, number of known values
#   full_operations, full_microseconds, full_parameters: costs of the full model
Saving: TypeAlias = dict[str, Any]
_COSTS = 'operations', 'microseconds', 'parameters'


def economy(options: argparse.Namespace) -> None:
    """Omits each term at each speed, draws the errors, and writes the records.

    Raises:
        ConfigurationError: No speed is given, or a file cannot be written.
        MechanismError: The crank angle does not determine the motion, or no torque is needed.
    """
    configuration = load(options.params).linkage(options.linkage)
    name = name_of(options.params, configuration)
    measured = Economy(configuration.mechanism, name)
    own, rpms = _speeds(options.params, configuration.drive, options.rpm or [])
    records = new_file(options, options.out / f'{name}_economy.json')
    drawn = pictures(options, f'{name}_economy')
    cli.print_notes(doubts(configuration))
    savings = measured.measure(rpms, 20 if options.quick else 200)
    sentence = measured.sentence(own, options.tolerance, savings)
    save_records(records, savings)
    colors = colors_of(configuration.mechanism.parts())
    _draw(savings, [*measured.terms], colors, sentence, own, options.tolerance, drawn)
    print(f'{name}: {sentence}', records, *drawn, sep='\n')


def _speeds(source: str, drive: Any, given: Sequence[float]) -> tuple[float, list[float]]:
    """Returns the speed of the summary, and all speeds in order, rpm.

    Args:
        source: The parameter file.
        drive: Drive in that file. The summary is for the speed of the drive or, if it has none,
            for the first given speed.
        given: Given speeds, rpm; if there are none, the speeds are multiples of the drive's.

    Raises:
        ConfigurationError: A speed is 0, or there is none.
    """
    own = getattr(drive, 'rpm', given[0] if given else 0.0)
    rpms = sorted({own, *(given or [own * factor for factor in _FACTORS])})
    if 0.0 in rpms:
        raise ConfigurationError(
            f'{source} at 0 rpm: the torque is compared over a turn of the crank, which needs a '
            'speed; choose speeds, such as --rpm 30 60'
        )
    return own, rpms


class Economy:
    """Compares simpler models of a mechanism's driving torque with the full model.

    Attributes:
        terms: Terms of the model, each with the number of nonzero values per parameter.
    """

    def __init__(self, mechanism: Mechanism, name: str) -> None:
        """Finds the terms of the full model; `name` is that of the parameter file.

        Raises:
            MechanismError: The crank does not turn fully.
        """
        solver = Solver(mechanism)
        solver.reach.require_full_turn()
        self._mechanism, self._name = mechanism, name
        self.terms = torque_models.terms(mechanism)
        self._period = solver.reach.period_turns * 2 * math.pi
        self._solver = solver

    def measure(self, rpms: Sequence[float], rounds: int) -> list[Saving]:
        """Measures the error and the savings of each simpler model at each speed.

        Args:
            rpms: Crank speeds.
            rounds: Number of timings of each program; the shortest is kept.

        Returns:
            The savings of each model, sorted by speed.

        Raises:
            MechanismError: No torque is needed at one of the speeds.
        """
        costs = self._costs(self._models(rpms[0]), progress(range(rounds), 'timing'))
        full, savings = costs.pop(_FULL), list[Saving]()
        for rpm in progress(rpms, 'speeds'):
            models = self._models(rpm)
            for name, cost in costs.items():
                savings.append({
                    'mechanism': self._name, 'rpm': rpm, 'left_out': name,
                    'error': self._error(models[name].program, rpm),
                    **{word: full[word] - cost[word] for word in _COSTS},
                    **{f'full_{word}': full[word] for word in _COSTS},
                })  # fmt: skip
        return savings

    def sentence(self, rpm: float, tolerance: float, savings: Sequence[Saving]) -> str:
        """Describes the terms that the torque needs at one speed, and those that can be omitted.

        Args:
            rpm: One of the measured speeds.
            tolerance: Allowed error, relative to the peak of the full model's torque.
            savings: Result of `measure`.

        Returns:
            One sentence, without an initial capital letter or a full stop.
        """
        errors = {x['left_out']: x['error'] for x in savings if x['rpm'] == rpm}
        parameters = {name: frozenset(counts) for name, counts in self.terms.items()}
        left_out = self._left_out(rpm, tolerance, errors)
        unused = frozenset[str]().union(*(parameters[name] for name in left_out))
        used = {
            name: own for name, own in parameters.items() if name != STATIC and not own <= unused
        }
        text = (
            f'at {rpm:g} rpm, within {100 * tolerance:g} % of the peak, this mechanism needs '
            f'{_listed(_largest(used), "and")}; it can leave out '
            f'{_listed(_largest({name: parameters[name] for name in left_out}), "and")}'
        )
        good = [name for name in errors if name not in self.terms and errors[name] <= tolerance]
        return f'{text}; sufficient models: {_listed(_smallest(good), "or")}' if good else text

    def _left_out(self, rpm: float, tolerance: float, errors: Mapping[str, float]) -> list[str]:
        """Returns terms that can be omitted together, chosen in the order of their errors."""
        left_out: list[str] = []
        for name in sorted(self.terms, key=lambda name: errors[name]):
            if self._error(self._without(*left_out, name), rpm) <= tolerance:
                left_out.append(name)
        return left_out

    def _models(self, rpm: float) -> dict[str, _Model]:
        """Returns each model at a speed, by name."""
        # Terms share parameters, hence each is counted once.
        known = {name: n for own in self.terms.values() for name, n in own.items()}
        count, full = sum(known.values()), self._without()
        models = dict[str, _Model]()
        for name, own in self.terms.items():
            models[name] = _Model(self._without(name), count - sum(own.values()))
        models[_FULL] = _Model(full, count)
        if reduced := torque_models.with_point_masses(self._mechanism):
            program = torque_models.torque_program(reduced)
            models[POINT_MASSES] = _Model(program, models['coupler'].parameters + 2)
        angles = np.arange(float(_SAMPLES)) * (self._period / _SAMPLES)
        torques = full.torques(angles, radians_per_second(rpm))
        for name, n in _HARMONICS.items():
            program = torque_models.series_program(torques, self._period, n)
            models[name] = _Model(program, 2 * n + 1)
        for name, n in _TABLES.items():
            program = torque_models.table_program(torques[:: _SAMPLES // n], self._period)
            models[name] = _Model(program, n)
        return models

    def _without(self, *names: str) -> TorqueProgram:
        """Returns the program of the model without some terms."""
        simpler = torque_models.without(self._mechanism, names)
        return torque_models.torque_program(simpler, static=STATIC in names)

    def _costs(
        self, models: Mapping[str, _Model], rounds: Iterable[int]
    ) -> dict[str, dict[str, float]]:
        """Returns the operations, microseconds and parameters of each model.

        The programs are timed in turn, so that a busy machine slows all of them equally.
        """
        # Models with the same tape are the same program.
        programs = {model.program.tape: model.program.scalar for model in models.values()}
        shortest = dict.fromkeys(programs, math.inf)
        angles = self._solver.reach.samples()[::_TIMED].tolist()
        for _ in rounds:
            for tape, run in programs.items():
                start = time.perf_counter()
                for angle in angles:
                    run(angle, 1.0)
                shortest[tape] = min(shortest[tape], time.perf_counter() - start)
        return {
            name: {
                'operations': model.program.tape.operations,
                'microseconds': shortest[model.program.tape] / len(angles) * 1e6,
                'parameters': model.parameters,
            }
            for name, model in models.items()
        }

    def _error(self, program: TorqueProgram, rpm: float) -> float:
        """Computes a program's largest torque error, relative to the peak of the full torque."""
        full, speed = self._full_torque(rpm), radians_per_second(rpm)
        errors = np.abs(program.torques(full.angles, speed) - full.torques)
        if errors.max() < _ROUNDING * full.peak:
            return float(errors.max() / full.peak)

        def errors_at(angles: Array) -> Array:
            exact = full.program.torques(angles, speed)
            return np.abs(program.torques(angles, speed) - exact)[None]

        (largest,), _ = peaks(full.angles, errors[None], errors_at)
        return float(largest / full.peak)

    @functools.cache  # noqa: B019
    def _full_torque(self, rpm: float) -> _FullTorque:
        """Computes the torque of the full model at a speed.

        Raises:
            MechanismError: It is 0.
        """
        speed, program = radians_per_second(rpm), self._without()
        # Several angles between two nodes of the largest table; with friction, each takes long.
        steps = 720 if self._solver.model.joint_loads else 4 * max(_TABLES.values())
        angles = samples(self._solver, speed, steps)
        torques = program.torques(angles, speed)
        if not torques.any():
            raise MechanismError(
                f'{self._name} needs no torque at {rpm:g} rpm: give links masses or loads, or '
                'choose other speeds (--rpm)'
            )
        (peak,), _ = peaks(
            angles, np.abs(torques)[None], lambda x: np.abs(program.torques(x, speed))[None]
        )
        return _FullTorque(program, angles, torques, float(peak))


def handover(savings: Sequence[Saving]) -> float | None:
    """Computes the speed, rpm, at which weights and inertia contribute equally.

    Returns None if there are no weights or no inertia.

    The torque of weights does not depend on the speed; the torque of inertia grows with the speed
    squared.
    """
    rpm = savings[0]['rpm']
    errors = {x['left_out']: x['error'] for x in savings if x['rpm'] == rpm}
    weights, inertia = errors.get('gravity'), errors.get(STATIC)
    return abs(rpm) * math.sqrt(weights / inertia) if weights and inertia else None


def _largest(sets: Mapping[str, frozenset[str]]) -> list[str]:
    """Returns the names of the sets that are not part of a larger one."""
    return [name for name, own in sets.items() if not any(own < other for other in sets.values())]


def _smallest(models: Sequence[str]) -> list[str]:
    """Returns the first of the reduced models of each kind, with its article."""
    found = list[str]()
    for kind, article in ((POINT_MASSES, 'the '), ('harmonic', ''), ('table', 'a ')):
        of_kind = [name for name in models if kind in name]
        if of_kind:
            found.append(article + of_kind[0])
    return found


def _listed(names: Sequence[str], word: str) -> str:
    """Joins names into a phrase such as 'a, b and c'."""
    *others, last = names or ['nothing']
    return f'{", ".join(others)} {word} {last}' if others else last


def _draw(
    savings: Sequence[Saving],
    terms: Sequence[str],
    colors: Mapping[str, Color],
    sentence: str,
    rpm: float,
    tolerance: float,
    files: Sequence[Path],
) -> None:
    """Draws bars for each speed and, for one speed, the reduced models and a table of savings."""
    at_rpm, heights = [x for x in savings if x['rpm'] == rpm], (3.7, 2.4 + 0.17 * len(terms))
    title = textwrap.fill(f'{sentence[0].upper()}{sentence[1:]}.', 88)
    with chart(files, sum(heights), title) as figure:
        panels = figure.subplot_mosaic(
            [['bars', 'bars'], ['reduced', 'table']], width_ratios=(1, 1.1), height_ratios=heights
        )
        bars, reduced, table = panels['bars'], panels['reduced'], panels['table']
        _draw_bars(bars, savings, terms, colors)
        _draw_reduced(reduced, at_rpm)
        _format_errors(bars, 1.5 * max(x['error'] for x in savings), tolerance)
        _format_errors(reduced, 3.0, tolerance)
        _write_table(table, at_rpm, terms)
        table.legend(*reduced.get_legend_handles_labels(), loc='lower left', ncols=2)
        figure.draw_without_rendering()  # places the axes
        _place_labels(reduced)


def _format_errors(axes: Axes, largest: float, tolerance: float) -> None:
    """Formats the axis of errors, up to the largest one, and marks the tolerance."""
    axes.set(yscale='log', ylim=(_LEAST, largest))
    axes.axhline(tolerance, color=fractions(BLACK), linewidth=1.0, linestyle=':', zorder=3)
    axes.yaxis.set_major_formatter('{x:g}')
    axes.grid(visible=False, axis='x')


def _draw_bars(
    axes: Axes, savings: Sequence[Saving], terms: Sequence[str], colors: Mapping[str, Color]
) -> None:
    """Draws the errors without each term, and whether weights or inertia dominate."""
    speeds = list(dict.fromkeys(x['rpm'] for x in savings))
    width, hatches = _ROOM / len(terms), itertools.cycle(_HATCHES)
    for i, name in enumerate(terms):
        places = np.arange(len(speeds)) + (i + 0.5) * width - _ROOM / 2
        errors = [x['error'] for x in savings if x['left_out'] == name]
        for place, error in zip(places, errors, strict=True):
            if error < _LEAST:  # too low to be drawn
                word = '0' if error < _ROUNDING else '<'
                axes.text(place, 1.15 * _LEAST, word, ha='center', fontsize=NUMBERS)
        group, _, part = name.partition('.')
        color = _OTHERS.get(group) or colors.get(group)
        base, hatch = (color, '') if color else (WHITE, next(hatches))  # without a colour: a load
        axes.bar(
            places, np.maximum(errors, _LEAST), width, label=name, hatch=hatch,
            edgecolor=fractions(mixed(base, BLACK, 0.4)),
            color=fractions(mixed(base, WHITE, 0.55) if part else base),
        )  # fmt: skip
    _name_speeds(axes, speeds, handover(savings))
    axes.legend(
        title='left out\n(0: no error,\n<: below the axis)', title_fontsize=SMALL,
        loc='center left', bbox_to_anchor=(1.0, 0.5), labelspacing=0.35,
    )  # fmt: skip


def _name_speeds(axes: Axes, speeds: Sequence[float], equal: float | None) -> None:
    """Writes the title, and below each group of bars its speed and what dominates.

    Args:
        axes: The axes.
        speeds: The speeds, rpm.
        equal: Speed at which weights and inertia contribute equally, rpm; None if there is none.
    """
    title = 'Torque error, share of the peak torque'
    names = [f'{rpm:g} rpm' for rpm in speeds]
    if equal:
        title += f'; weights and inertia are equal at {equal:.3g} rpm'
        names = [
            f'{rpm:g} rpm\n{"inertia dominates" if abs(rpm) > equal else "weights dominate"}'
            for rpm in speeds
        ]
    axes.set_title(title, loc='left')
    axes.set_xticks(range(len(speeds)), names, fontsize=SMALL)
    axes.tick_params(axis='x', length=0)
    axes.set_xlim(-0.5, len(speeds) - 0.5)


def _draw_reduced(axes: Axes, savings: Sequence[Saving]) -> None:
    """Plots the torque errors of the reduced models against their computing time, at one speed."""
    full = savings[0]['full_microseconds']
    for curve in _REDUCED:
        shown = [x for x in savings if x['left_out'] in curve.models and x['error'] > _LEAST]
        if not shown:
            continue
        times = [full - x['microseconds'] for x in shown]
        errors = [x['error'] for x in shown]
        axes.plot(
            times, errors, color=fractions(curve.color), linewidth=0.9, marker=curve.marker,
            markersize=curve.size, label=curve.label,
        )  # fmt: skip
        for saving, time_taken, error in zip(shown, times, errors, strict=True):
            words = str(curve.models[saving['left_out']])
            axes.annotate(
                words, (time_taken, error), (0, 0), textcoords='offset points', fontsize=NUMBERS,
                in_layout=False,
            )  # fmt: skip
    axes.axvline(full, color=fractions(BLACK), linewidth=1.2, label='full model')
    axes.set(
        xscale='log',
        xlabel=f'Time to compute one torque at {savings[0]["rpm"]:g} rpm, \N{MICRO SIGN}s',
    )  # fmt: skip
    axes.set_title('Torque error of reduced models', loc='left')
    axes.margins(x=0.08)
    axes.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axes.xaxis.set_major_formatter('{x:g}')
    axes.xaxis.set_minor_locator(NullLocator())


def _place_labels(axes: Axes) -> None:
    """Moves labels to where they cover no line and no other label; hides those without a place."""
    occupied = list[Bbox]()  # by markers and labels
    for line in axes.lines:
        if line.get_marker() != 'None':
            points = line.get_transform().transform(line.get_xydata())
            occupied += [Bbox([point - _MARKER, point + _MARKER]) for point in points]
    paths = [line.get_transform().transform_path(line.get_path()) for line in axes.lines]
    for text in filter(Text.get_text, axes.texts):
        for offset, side, height in _BESIDE:
            text.set(position=offset, ha=side, va=height)
            box = text.get_window_extent()
            covers_line = any(path.intersects_bbox(box, filled=False) for path in paths)
            if not covers_line and not box.count_overlaps(occupied):
                occupied.append(box)
                break
        else:
            text.set_visible(False)


def _write_table(axes: Axes, savings: Sequence[Saving], terms: Sequence[str]) -> None:
    """Lists the costs of the full model and of each simpler model, at one speed."""
    full = {word: savings[0][f'full_{word}'] for word in _COSTS}
    at = f'at {savings[0]["rpm"]:g} rpm'
    lines = [
        f'{"":19}{"":>8}{"oper-":>8}{"micro-":>8}{"para-":>8}',
        f'{at:19}{"error":>8}{"ations":>8}{"seconds":>8}{"meters":>8}',
        _table_line(_FULL, 0.0, full), 'without',
    ]  # fmt: skip
    for saving in savings:
        if saving['left_out'] in (*terms, POINT_MASSES):
            costs = {word: full[word] - saving[word] for word in _COSTS}
            lines.append(_table_line(saving['left_out'], saving['error'], costs))
    axes.set_axis_off()
    axes.text(
        0, 1, '\n'.join(lines), va='top', transform=axes.transAxes,
        family='monospace', fontsize=NUMBERS, linespacing=1.35,
    )  # fmt: skip


def _table_line(name: str, error: float, costs: Mapping[str, Any]) -> str:
    """Formats a line of the table; an error of rounding is 0."""
    return (
        f'{name.removeprefix("coupler as "):19}{0.0 if error < _ROUNDING else error:>8.3g}'
        f'{costs["operations"]:>8d}{costs["microseconds"]:>8.1f}{costs["parameters"]:>8d}'
    )
