# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_chart accuracy: time and error of the methods, one chart per linkage and others.

`methods/registry.py` declares the methods, `methods/measure.py` measures them, and the chart
`stability` shows where they fail. Further charts are for motions and for `drive: follow`.

The last chart shows the torque error of a measured crank against the filter's bandwidth, for
several encoder resolutions. A motor whose torque falls steeply with the speed turns the
quadrilateral at 150 rpm. The encoder rounds the angle to 2^bits steps per turn; a speed sensor
with the same number of bits and a range of +-300 rpm rounds the speed. `TrackingFilter` receives
1000 measurements per second.
"""

import argparse
import itertools
import math
import operator
import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib import rcParams
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullLocator

from linkage_lab.methods.integrators import OfPackage
from linkage_lab.methods.linkage_cases import NEAR, linkages
from linkage_lab.methods.measure import BATCH, LIMIT, ONE, Method, Point, label, measure_accuracy
from linkage_lab.methods.motion_cases import ENERGY, MEAN, SLOWEST, TRAJECTORY, motions
from linkage_lab.methods.registry import DEFAULT, INTEGRATORS, LIVE, METHODS, RECORDS
from linkage_lab.methods.stages import QUANTITIES
from linkage_lab.output import (
    SMALL,
    TEXT,
    Stopwatch,
    about,
    chart,
    new_file,
    pictures,
    progress,
    save_records,
)
from linkage_lab.reference.motions import InitialValueProblem
from linkage_ros import Solver, load
from linkage_ros.formulas import Array
from linkage_ros.internals import Motor, TrackingFilter, live_steps, radians_per_second
from linkage_ros.palette import (
    BLACK,
    BLUE,
    DARK,
    GREEN,
    ORANGE,
    PURPLE,
    SKY,
    VERMILION,
    Color,
    fractions,
)

_LEAST, _CEILING = 1e-17, 10.0  # limits at which smaller and larger errors are drawn
DEFAULT_BANDWIDTH = 20.0  # Hz, of `drive: follow`
_BITS = (12, 14, 16, 18, 20)
_BANDWIDTHS = (5.0, 7.0, 10.0, 14.0, 20.0, 30.0, 40.0, 60.0, 80.0, 120.0, 160.0, 240.0)  # Hz
_RPM = 150.0
_DAMPING = 20.0  # motor damping, N m s; keeps the speed within 3 % of 150 rpm
_SENSED = 2.0  # largest speed that the speed sensor measures, relative to 150 rpm
_PERIOD = 1_000_000  # between measurements, ns
_TURN = 400  # measurements per turn
# Turns in which the filter settles, and in all; the torque is compared in those between.
_SETTLING, _TURNS = 2, 4


def _style(marker: str, color: Color, size: float = 6.0, *, filled: bool = True) -> dict[str, Any]:
    return {
        'marker': marker, 'color': fractions(color), 'markersize': size,
        'markerfacecolor': fractions(color) if filled else 'white',
    }  # fmt: skip


# The defaults have the most prominent colour.
_STYLES = {
    DEFAULT: _style('*', VERMILION, 13),
    'factored, float32': _style('*', VERMILION, 9, filled=False),
    'two circles': _style('D', BLACK),
    'half-angle': _style('s', BLUE),
    'Newton-Raphson': _style('^', GREEN),
    "Ghalbi's listing": _style('v', SKY, 7),
    'table, cubic Hermite': _style('o', PURPLE),
    '2x2 solve': _style('P', ORANGE, 7),
    'central differences': _style('.', DARK, 7),
    LIVE: _style('o', VERMILION),
    RECORDS: _style('*', VERMILION, 11, filled=False),
    'DOP853': _style('s', BLUE),
    'RK4': _style('^', GREEN),
    'Radau': _style('D', PURPLE),
    'multipliers, unstabilised': _style('X', DARK),
    'multipliers, Baumgarte': _style('P', SKY, 7),
    'multipliers, projected': _style('v', ORANGE),
}
_OTHER = _style('d', DARK, filled=False)  # marker of a method added by a user
_STEADY = _style('*', VERMILION, 13)  # marker of the live default at its default setting
_ENCODERS = [
    _style(marker, color, 5)
    for marker, color in zip('s^oDv', (VERMILION, ORANGE, GREEN, BLUE, PURPLE), strict=True)
]
_ROLES = {
    DEFAULT: ' (default)',
    LIVE: ' (live default; star: 1 ms steps)',
    RECORDS: ' (default for records)',
}


class _Grid(NamedTuple):
    """The panels of a chart.

    Attributes:
        methods: Methods that may be measured.
        columns: Number of columns.
        panels: Quantity and mode of each panel of one mechanism.
        title: Title of a panel, as a format of mechanism, quantity and mode.
        time: The time in words.
        error: Units of the errors.
    """

    methods: Sequence[Method]
    columns: int
    panels: Sequence[tuple[str, str]]
    title: str
    time: str
    error: str


_OF_LINKAGE = _Grid(
    METHODS, 2, [*itertools.product(QUANTITIES, (ONE, BATCH))],
    '{1}, {2}', 'time per state', 'relative (angles: rad)',
)  # fmt: skip
_OF_MOTIONS = _Grid(
    INTEGRATORS, 3, [(TRAJECTORY, MEAN), (ENERGY, MEAN), (TRAJECTORY, SLOWEST)],
    '{0}, {1}, {2}', 'time per simulated ms', 'rad, crank lengths, or relative',
)  # fmt: skip


def accuracy(options: argparse.Namespace) -> None:
    """Measures speed and accuracy of all methods, draws the results, and writes the records.

    Raises:
        ConfigurationError: A file cannot be written.
    """
    quick = options.quick
    records = new_file(options, options.out / 'accuracy.json')
    follow_records = new_file(options, options.out / 'accuracy_follow.json')
    follow_pictures = pictures(options, 'accuracy_follow')
    watch = Stopwatch()
    of_linkages = measure_accuracy(linkages(quick=quick), METHODS, quick=quick)
    of_motions = measure_accuracy(motions(quick=quick), INTEGRATORS, quick=quick)
    points = [*of_linkages, *of_motions]
    save_records(records, points)
    warning, written = watch.warning(), [records]
    for title, stem, group in charts(points, about()):
        files = pictures(options, stem)
        draw_accuracy(group, f'{title}\n{warning}'.rstrip(), files)
        written += files
    errors, speeds = _measure_follow(quick=quick)
    save_records(follow_records, errors)
    title = f'Torque error of a measured crank: quadrilateral, {speeds}, measured at 1 kHz'
    draw_follow(errors, title, follow_pictures)
    written += [follow_records, *follow_pictures]
    print(*written, sep='\n')


def charts(
    points: Sequence[Point], machine: Mapping[str, str]
) -> Iterator[tuple[str, str, list[Point]]]:
    """Yields title, name of the file and points of each chart.

    Args:
        points: All points.
        machine: Software versions and description of the machine; see `about`.
    """
    groups: dict[str, list[Point]] = {}
    for point in points:
        is_state = point['quantity'] in QUANTITIES
        groups.setdefault(point['mechanism'] if is_state else 'motions', []).append(point)
    words = textwrap.fill(', '.join(f'{name} {value}' for name, value in machine.items()), 105)
    for name, group in groups.items():
        title = f'Speed against accuracy: {name.replace("_", "-")}\n{words}'
        yield title, f'accuracy_{name.replace(" ", "_")}', group


def draw_accuracy(points: Sequence[Point], title: str, files: Sequence[Path]) -> None:
    """Draws the chart of a linkage (a row per quantity) or of all motions (a row per motion)."""
    grid = _OF_LINKAGE if points[0]['quantity'] in QUANTITIES else _OF_MOTIONS
    measured = {point['method'] for point in points}
    methods = [method for method in grid.methods if method.name in measured]
    mechanisms = dict.fromkeys(point['mechanism'] for point in points)
    panels = [(name, *panel) for name in mechanisms for panel in grid.panels]
    panel_of = operator.itemgetter('mechanism', 'quantity', 'mode')
    rows = len(panels) // grid.columns
    with chart(files, 2.6 + 2.2 * rows, title) as figure:
        rcParams['text.parse_math'] = True  # for the powers of ten of tick labels
        all_axes = figure.subplots(rows, grid.columns, sharey=True, sharex='col')
        for axes, panel in zip(all_axes.flat, panels, strict=True):
            named = grid.title.format(*panel).replace('_', ' ')
            axes.set_title(named.replace(f', {MEAN}', ''))
            _draw_panel(axes, [point for point in points if panel_of(point) == panel])
        for axes in all_axes[-1]:
            axes.set_xlabel(f'{grid.time}, \N{MICRO SIGN}s', fontsize=TEXT)
            low, high = axes.get_xlim()
            # Axes of more than two decades have no room for labels at 2 and 5.
            axes.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5) if high < 200 * low else (1,)))
        figure.supylabel(f'largest error: {grid.error}', fontsize=TEXT)
        figure.legend(
            handles=_handles(methods), loc='outside lower center', ncols=3,
            title=textwrap.fill(_settings(methods), 115), title_fontsize=SMALL,
        )  # fmt: skip


def _handles(methods: Sequence[Method]) -> list[Line2D]:
    """Makes the entries of the legend."""
    handles = [
        Line2D([], [], linewidth=0.9 if len(method.settings) > 1 else 0,
               label=f'{method.name}{_ROLES.get(method.name, "")}',
               **_STYLES.get(method.name, _OTHER))
        for method in methods
    ]  # fmt: skip
    limit = f'worse than {LIMIT:g}: not on the front'
    return [
        *handles,
        Line2D([], [], color=fractions(BLACK), linewidth=1.0, label='front of right points'),
        Line2D([], [], color='0.85', linewidth=7, label=limit),
    ]


def _settings(methods: Sequence[Method]) -> str:
    """Describes the settings of all methods in one string."""
    spans = '; '.join(
        f'{method.name}: {label(method.settings[0])} to {label(method.settings[-1])}'
        for method in methods
        if len(method.settings) > 1
    )
    return (
        f'Settings along the lines: {spans}. Errors above {_CEILING:g} are drawn at {_CEILING:g}.'
    )


def _log_axes(axes: Axes, **options: Any) -> None:
    axes.set(xscale='log', yscale='log', **options)
    axes.xaxis.set_major_formatter('{x:g}')
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_minor_locator(NullLocator())


def _draw_panel(axes: Axes, points: Sequence[Point]) -> None:
    """Plots errors against times, with a line per method, and the front of right points."""
    _log_axes(axes, ylim=(2e-17, 30 * _CEILING), yticks=10.0 ** np.arange(-15, 1, 3))
    axes.axhspan(LIMIT, 1e30, color='0.94', zorder=0)
    drawn = [p for p in points if None not in (p['max_error'], p['us_per_state'])]
    for method, group in itertools.groupby(drawn, key=lambda point: point['method']):
        style, zorder = _STYLES.get(method, _OTHER), 5 if method in _ROLES else 3
        axes.plot(*_places(group), linewidth=0.9, zorder=zorder, **style)
    steady = label(INTEGRATORS[0].steady)
    live = (p for p in drawn if (p['method'], p['setting']) == (LIVE, steady))
    axes.plot(*_places(live), zorder=6, **_STEADY)
    front = sorted((p for p in points if p['pareto']), key=lambda p: p['us_per_state'])
    axes.step(
        *_places(front), where='post', color=fractions(BLACK), linewidth=1.2, alpha=0.7, zorder=2
    )
    if failed := dict.fromkeys(p['method'] for p in points if p not in drawn):
        height = 0.565 if points[0]['mechanism'] == NEAR else 0.97  # clear of the curves
        axes.text(
            0.98, height, 'no answer at some angle with some setting:\n' + '\n'.join(failed),
            ha='right', va='top', transform=axes.transAxes, color='0.3',
        )  # fmt: skip


def _places(points: Iterable[Point]) -> Any:
    """Returns times, us, and errors of points, limited to the range of the axis."""
    places = [(p['us_per_state'], np.clip(p['max_error'], _LEAST, _CEILING)) for p in points]
    return np.reshape(places, (-1, 2)).T


# ---------------------------------------------------------------- a measured crank


def _measure_follow(*, quick: bool) -> tuple[list[dict[str, Any]], str]:
    """Measures the torque error for several encoders and bandwidths.

    Returns the points, and the crank speeds in words. Each point has the resolution in bits,
    whether the velocity is also measured, the bandwidth of the filter, Hz, and the largest torque
    error, relative to the peak torque at a constant speed.
    """
    speed, solver = radians_per_second(_RPM), Solver(load('quadrilateral').mechanism)
    motor = Motor(_DAMPING * speed, _DAMPING)
    run = OfPackage(InitialValueProblem(solver.mechanism, (0.0, speed), motor), live_steps)
    stamps = [n * _PERIOD for n in range(1, _TURNS * _TURN + 1)]  # ns
    q, u = np.transpose([run.at(stamp * 1e-9) for stamp in stamps])  # rad, rad/s
    compared = slice(_SETTLING * _TURN, None)
    true = solver.state(q, u, solver.accelerations(q, u, motor.at(u))).torque[compared]
    peak = _peak_torque(solver, speed)
    bits, bandwidths = (_BITS[::2], _BANDWIDTHS[::4]) if quick else (_BITS, _BANDWIDTHS)
    encoders, points = list(itertools.product((False, True), bits)), []
    for has_velocity, bit in progress(encoders, 'errors, a measured crank'):
        steps = 2**bit  # per turn, or in the range of the speed sensor
        angles = _rounded(q, 2 * math.pi / steps)
        speeds = _rounded(u, 2 * _SENSED * speed / steps) if has_velocity else [None] * len(u)
        measurements = list(zip(stamps, angles, speeds, strict=True))
        for bandwidth in bandwidths:
            torque = _followed_torque(solver, bandwidth, measurements)[compared]
            points.append({
                'bits': bit, 'measured_velocity': has_velocity, 'follow_bandwidth': bandwidth,
                'max_error': float(np.abs(torque - true).max() / peak),
            })  # fmt: skip
    rpm = u[compared] * 30 / math.pi
    return points, f'{rpm.min():.0f} to {rpm.max():.0f} rpm'


def _followed_torque(
    solver: Solver, bandwidth: float, measurements: Iterable[tuple[int, float, float | None]]
) -> Array:
    """Returns the torque that the filter of `drive: follow` gives at each measurement, N m.

    Args:
        solver: The solver.
        bandwidth: Bandwidth of the filter, Hz.
        measurements: Stamp, ns, angle, rad, and, if it is measured, velocity, rad/s.
    """
    motion = TrackingFilter(bandwidth, solver.reach.period_turns)
    followed = [motion.at(stamp, angle, velocity) for stamp, angle, velocity in measurements]
    angle = np.concatenate([moment.q for moment in followed])
    velocity = np.concatenate([moment.u for moment in followed])
    acceleration = np.concatenate([moment.a for moment in followed])
    return np.asarray(solver.state(angle, velocity, acceleration).torque)


def _peak_torque(solver: Solver, speed: float) -> float:
    """Returns the largest driving torque in a turn at a constant speed, rad/s, N m."""
    turn = np.linspace(0.0, 2 * math.pi, _TURN)
    torque = solver.state(turn, np.full(_TURN, speed), np.zeros(_TURN)).torque
    return float(np.abs(torque).max())


def _rounded(values: Array, step: float) -> list[float]:
    """Returns values as an encoder or sensor with this step measures them."""
    rounded: list[float] = (step * np.rint(values / step)).tolist()
    return rounded


def draw_follow(points: Sequence[dict[str, Any]], title: str, files: Sequence[Path]) -> None:
    """Plots the torque error of a measured crank against the bandwidth, for each encoder."""
    with chart(files, 4.8, title) as figure:
        panels = figure.subplots(1, 2, sharey=True, sharex=True)
        for axes, velocity in zip(panels, (False, True), strict=True):
            _log_axes(axes, ylim=(1.0, 100.0), xlabel='follow_bandwidth, Hz')
            chosen = [p for p in points if p['measured_velocity'] == velocity]
            lines = itertools.groupby(chosen, key=lambda p: p['bits'])
            for (bits, group), style in zip(lines, _ENCODERS, strict=False):  # fewer if quick
                line = [(p['follow_bandwidth'], 100 * p['max_error']) for p in group]
                axes.plot(*zip(*line, strict=True), linewidth=1.2, label=f'{bits} bit', **style)
            axes.axvline(
                DEFAULT_BANDWIDTH, color=fractions(BLACK), linestyle='--', linewidth=1.0,
                label=f'default, {DEFAULT_BANDWIDTH:g} Hz',
            )  # fmt: skip
            axes.set_title(
                'angle and velocity are measured' if velocity else 'only the angle is measured'
            )
            for axis in (axes.xaxis, axes.yaxis):
                axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
                axis.set_major_formatter('{x:g}')
        panels[0].set_ylabel('largest torque error, % of the peak torque')
        panels[0].legend(loc='lower left')
