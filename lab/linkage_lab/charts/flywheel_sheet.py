# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_chart motion --fluctuation: the sheet of a flywheel and of a motor."""

import math
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from linkage_lab.flywheel import Crank, Cycle
from linkage_lab.output import (
    NUMBERS,
    SMALL,
    WIDTH,
    box,
    chart,
    dash,
    name_ends,
    over,
    round_ticks,
    rounded,
    write_title,
)
from linkage_lab.period import Extent, Period, angle_name, extent
from linkage_ros import LinkageError
from linkage_ros.internals import Motor
from linkage_ros.palette import BLACK, BLUE, GREEN, ORANGE, VERMILION, WHITE, fractions, mixed

_RPM = 30 / math.pi  # of 1 rad/s
# Inches: upper end of the table, its rows, a diagram, its title with the gap above, lower margin.
_TOP, _ROWS, _HIGH, _TITLE, _FOOT = 0.4, 0.19, 2.1, 0.6, 0.25
_LEFT, _NAMES = 0.75, 1.65  # margin left of the diagrams, and right of them for names
_SLIGHTLY = 1.01  # times the allowed fluctuation, which still counts as kept
_SHOWN = 2.0  # heights of the band above and below it that the diagram of speeds shows at most
# Colour and dash of each case, in all diagrams.
NEEDED, STEADY, BARE, DRIVEN = 'needed', 'with the flywheel', 'without flywheel', 'with this motor'
_STYLES: dict[str, dict[str, Any]] = {
    name: {'color': fractions(color), 'linestyle': dash(number), 'linewidth': 1.6}
    for name, color, number in (
        (NEEDED, BLACK, 0), (STEADY, BLUE, 1), (BARE, ORANGE, 2), (DRIVEN, GREEN, 3),
    )
}  # fmt: skip


class _Sizing(NamedTuple):
    """A flywheel for a mechanism, and what a motor does with it.

    Attributes:
        period: The motion at a constant speed.
        fluctuation: Allowed difference between the largest and the smallest speed, relative to
            the mean speed.
        added: Inertia of the flywheel, kg m^2.
        energy: First-order range of the kinetic energy, J.
        steady: The cycle with the flywheel, under a constant torque.
        bare: The cycle without a flywheel, under a constant torque; None if there is none.
        motor: The motor, if there is one.
        driven: The cycle with the flywheel, under the motor; None if there is none.
    """

    period: Period
    fluctuation: float
    added: float
    energy: float
    steady: Cycle
    bare: Cycle | None
    motor: Motor | None
    driven: Cycle | None

    @property
    def torque(self) -> float:
        """Mean torque, N m."""
        return self.period.mean_power / self.period.speed

    def keeps(self, cycle: Cycle | None) -> bool:
        """Returns whether a cycle has the mean speed and at most the fluctuation.

        A mean speed within half of the allowed fluctuation counts.
        """
        if cycle is None or cycle.fluctuation > _SLIGHTLY * self.fluctuation:
            return False
        return abs(cycle.speed / self.period.speed - 1) <= 0.5 * self.fluctuation


def size_flywheel(
    period: Period, motor: Motor | None, fluctuation: float, name: str, files: Sequence[Path]
) -> list[str]:
    """Sizes a flywheel for a mechanism, draws its effect, and checks the motor, if any.

    Args:
        period: The motion at a constant speed.
        motor: The motor, if there is one.
        fluctuation: Allowed difference between the largest and the smallest speed, relative to
            the mean speed.
        name: Name of the parameter file.
        files: The files of the picture.

    Returns:
        The summary, line by line.

    Raises:
        LinkageError: No flywheel gives this fluctuation.
        OSError: The picture cannot be written.
    """
    crank, speed = Crank(period.solver.mechanism), period.speed
    added = crank.inertia_for(fluctuation, speed)
    bare, failure = _attempt(crank, speed, 0.0)
    driven, driven_words = _attempt(crank, speed, added, motor) if motor else (None, '')
    sizing = _Sizing(
        period, fluctuation, added, crank.energy(speed), crank.cycle(speed, added), bare, motor,
        driven,
    )  # fmt: skip
    warning = _not_kept(crank, sizing, motor) if motor and not sizing.keeps(driven) else ''
    _draw(sizing, name, warning, files)
    without = f'{bare.fluctuation:.4g}' if bare else failure
    stored, total = rounded(sizing.energy), sizing.energy / (fluctuation * speed**2)
    lines = [
        _demand(period, 'driving_torque', sizing.torque),
        _demand(period, 'driving_power', period.mean_power),
        f'fluctuation {fluctuation:g}: add {added:.5g} kg m^2 to the crank (without: {without})',
        f'to first order: {stored} J between the extremes, {total:.5g} kg m^2 in total',
    ]
    if motor:
        needed = f'and the cycle needs {rounded(sizing.torque)} N m'
        _, without_words = _attempt(crank, speed, 0.0, motor)
        lines += [
            f'{motor}: {rounded(motor.at(speed))} N m at this speed, {needed}',
            f'with the flywheel: {driven_words}',
            f'without: {without_words}',
        ]
    return [*lines, warning] if warning else lines


def _not_kept(crank: Crank, sizing: _Sizing, motor: Motor) -> str:
    """Writes that the motor does not keep speed and fluctuation, and what would."""
    cures = list[str]()
    with suppress(LinkageError):  # no flywheel helps
        inertia = crank.inertia_for(sizing.fluctuation, sizing.period.speed, motor)
        if sizing.keeps(crank.cycle(sizing.period.speed, inertia, motor)):
            cures.append(f'{inertia:.4g} kg m^2')
    with suppress(LinkageError):  # no torque helps
        stronger = crank.motor_for(sizing.period.speed, sizing.added, motor)
        inertia = crank.inertia_for(sizing.fluctuation, sizing.period.speed, stronger)
        more = f' with {inertia:.4g} kg m^2' if inertia > _SLIGHTLY * sizing.added else ''
        cures.append(f'a motor of {rounded(stronger.torque)} N m at rest{more}')
    asked = f'{rounded(_RPM * sizing.period.speed)} rpm with fluctuation {sizing.fluctuation:g}'
    return f'NOT kept: {asked}; needs {" or ".join(cures) or "another motor"}'


def _demand(period: Period, name: str, average: float) -> str:
    """Describes peak, rms and mean of torque or power at a constant speed."""
    unit, values = period.columns[name]
    size = extent(period.crank, values)
    return (
        f'{name.replace("_", " ")}: peak {rounded(_peak(size))} {unit}, '
        f'rms {rounded(size.rms)} {unit}, mean {rounded(average + 0.0)} {unit}'
    )


def _peak(size: Extent) -> float:
    return max(-size.low, size.high) + 0.0


def _attempt(
    crank: Crank, speed: float, added: float, motor: Motor | None = None
) -> tuple[Cycle | None, str]:
    """Computes a cycle; returns it with a description, or None with the reason for failure."""
    try:
        cycle = crank.cycle(speed, added, motor)
    except LinkageError as error:
        return None, str(error)
    at = f'at {_speed(cycle)}, peak power {_peak_power(cycle)}'
    return cycle, f'the motor drives the cycle {at}'


def _speed(cycle: Cycle) -> str:
    return f'{rounded(_RPM * cycle.speed)} rpm, fluctuation {cycle.fluctuation:.4g}'


def _peak_power(cycle: Cycle) -> str:
    return f'{rounded(np.abs(cycle.torque * cycle.velocity).max())} W'


def _draw(sizing: _Sizing, name: str, warning: str, files: Sequence[Path]) -> None:
    """Draws a table, and torque and speed over the crank angle; with a motor, also its line.

    Args:
        sizing: The flywheel, and what a motor does with it.
        name: Name of the parameter file.
        warning: A line below the table; empty if the motor keeps speed and fluctuation.
        files: The files of the picture.
    """
    rows = _rows(sizing)
    lines = math.ceil(len(rows) / 2) + (2 if warning else 0)
    top = _TOP + _ROWS * lines
    count = 3 if sizing.motor else 2
    height = top + count * (_HIGH + _TITLE) + _FOOT
    with chart(files, height, layout=None) as figure:
        write_title(figure, f'{name}: flywheel')
        _write_table(figure, rows)
        if warning:
            words = warning.replace('^2', '\N{SUPERSCRIPT TWO}')
            write_title(figure, words, top=top - 1.5 * _ROWS, color=fractions(VERMILION))

        def add_axes(number: int) -> Axes:
            y = top + number * (_HIGH + _TITLE) + 0.55 * _TITLE
            axes: Axes = figure.add_axes(box(height, _LEFT, y, WIDTH - _LEFT - _NAMES, _HIGH))
            return axes

        for number, draw in enumerate((_draw_torques, _draw_speeds)):
            axes = add_axes(number)
            draw(axes, sizing)
            axes.set_xlabel(f'{angle_name(sizing.period.driven.name)}, deg', labelpad=1)
        if sizing.motor:
            _draw_plane(add_axes(2), sizing)


def _rows(sizing: _Sizing) -> list[tuple[str, str]]:
    """Returns the rows of the table: names and values."""
    period, bare, driven = sizing.period, sizing.bare, sizing.driven
    torque = extent(period.crank, period.columns['driving_torque'].values)
    power = extent(period.crank, period.columns['driving_power'].values)
    rows = [
        ('mean speed', f'{rounded(_RPM * period.speed)} rpm'),
        ('allowed fluctuation', f'{sizing.fluctuation:g}'),
        ('without flywheel', f'{bare.fluctuation:.4g}' if bare else 'no steady cycle'),
        ('added to the crank', f'{sizing.added:.5g} kg m\N{SUPERSCRIPT TWO}'),
        ('surplus of a turn', f'{rounded(sizing.energy)} J'),
        ('torque: peak, rms, mean', f'{_listed(_peak(torque), torque.rms, sizing.torque)} N m'),
        ('power: peak, mean', f'{_listed(_peak(power), period.mean_power)} W'),
    ]
    if sizing.motor:
        rows += [
            ('motor', str(sizing.motor).removeprefix('motor ')),
            (DRIVEN, _speed(driven) if driven else 'cannot drive the cycle'),
        ]
    if driven:
        rows.append(('its peak power', _peak_power(driven)))
    return rows


def _listed(*values: float) -> str:
    return ', '.join(rounded(value + 0.0) for value in values)


def _write_table(figure: Figure, rows: Sequence[tuple[str, str]]) -> None:
    """Writes names and values in two pairs of columns."""
    half = math.ceil(len(rows) / 2)
    for i, (name, value) in enumerate(rows):
        x, y = 0.2 + 4.9 * (i // half), figure.get_figheight() - _TOP - (i % half + 0.5) * _ROWS
        style: dict[str, Any] = {'fontsize': NUMBERS, 'transform': figure.dpi_scale_trans}
        figure.text(x, y, name, color='0.35', **style)
        figure.text(x + 1.75, y, value, **style)


def _draw_torques(axes: Axes, sizing: _Sizing) -> None:
    """Plots the torques, and fills the work that the flywheel stores and returns."""
    period, steady, driven = sizing.period, sizing.steady, sizing.driven
    needed = period.columns['driving_torque'].values
    supplied = np.interp(period.crank, steady.crank, steady.torque)
    is_surplus = math.copysign(1.0, period.speed) * (supplied - needed) > 0

    def fill(label: str, where: Any, **look: Any) -> None:
        axes.fill_between(
            period.marks, needed, supplied, where, interpolate=True, linewidth=0, label=label,
            **look,
        )  # fmt: skip

    fill('surplus, stored', is_surplus, facecolor=fractions(mixed(BLUE, WHITE, 0.75)))
    fill('deficit, returned', ~is_surplus, facecolor='white', edgecolor='0.55', hatch='////')
    curves = {NEEDED: (period.marks, needed), STEADY: (_degrees(steady), steady.torque)}
    if driven:
        curves[DRIVEN] = _degrees(driven), driven.torque
    lines = _plot(axes, curves)
    over(axes, period, 'Torque, N m')
    _explain(axes, lines)


def _draw_speeds(axes: Axes, sizing: _Sizing) -> None:
    """Plots the speeds, and the band of the allowed fluctuation around them."""
    cycles = {BARE: sizing.bare, STEADY: sizing.steady, DRIVEN: sizing.driven}
    low, high = _band(sizing)
    axes.axhspan(low, high, color='0.88', label='allowed', zorder=0)
    curves = {name: (_degrees(x), _RPM * x.velocity) for name, x in cycles.items() if x}
    lines = _plot(axes, curves)
    # The speed without a flywheel may be far from the others, and may be cut off.
    shown = [low, high]
    for name, (_, speeds) in curves.items():
        if name != BARE:
            shown += [speeds.min(), speeds.max()]
    (bottom, top), room = axes.get_ylim(), _SHOWN * (high - low)
    axes.set_ylim(max(bottom, min(shown) - room), min(top, max(shown) + room))
    over(axes, sizing.period, 'Crank speed, rpm')
    _explain(axes, lines)


def _draw_plane(axes: Axes, sizing: _Sizing) -> None:
    """Plots torque against speed: the motor, the demand of the mechanism, the operating range."""
    motor, cycle = sizing.motor or Motor(), sizing.driven or sizing.steady
    low, high = _band(sizing)
    axes.axvspan(low, high, color='0.88', label='allowed', zorder=0)
    axes.plot(_RPM * cycle.velocity, cycle.demand, label=NEEDED, **_STYLES[NEEDED])
    point, slope = (_RPM * cycle.speed, motor.at(cycle.speed)), -motor.damping / _RPM
    look: dict[str, Any] = {'color': fractions(GREEN), 'solid_capstyle': 'butt'}
    axes.axline(point, slope=slope, label="the motor's line", linewidth=0.9, **look)
    if sizing.driven:
        ends = _RPM * cycle.velocity, cycle.torque
        axes.plot(*ends, label='operating range', linewidth=4.5, **look)
    axes.set_title('Torque, N m', loc='left', fontsize=SMALL, pad=4)
    axes.set_xlabel('Crank speed, rpm', labelpad=1)
    round_ticks(axes.xaxis, 'rpm', 8)
    round_ticks(axes.yaxis, 'N m', 5)
    _explain(axes, {})


def _band(sizing: _Sizing) -> tuple[float, float]:
    """Returns the ends of the band of allowed speeds, rpm, around the cycle with the flywheel."""
    ends = extent(sizing.steady.crank, sizing.steady.velocity)
    middle, half = (
        0.5 * (ends.low + ends.high),
        0.5 * sizing.fluctuation * abs(sizing.period.speed),
    )
    return _RPM * (middle - half), _RPM * (middle + half)


def _degrees(cycle: Cycle) -> Any:
    return np.degrees(cycle.crank)


def _plot(axes: Axes, curves: dict[str, tuple[Any, Any]]) -> dict[str, Line2D]:
    """Plots cases in their styles; returns their lines."""
    return {name: axes.plot(*points, **_STYLES[name])[0] for name, points in curves.items()}


def _explain(axes: Axes, lines: dict[str, Line2D]) -> None:
    """Writes the names of cases at the right ends of their lines, and explains the rest above."""
    name_ends(axes, lines, (WIDTH - _LEFT - _NAMES, _HIGH))
    axes.legend(
        loc='lower right', bbox_to_anchor=(1.0, 1.02), ncols=4, borderaxespad=0.0, borderpad=0.0
    )
