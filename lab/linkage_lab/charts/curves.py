# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Diagrams of a period: the curves of each, with their names, colours and dashes."""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from linkage_lab.period import OVER_TIME, Extent, Period, extent
from linkage_ros import palette
from linkage_ros.formulas import Array
from linkage_ros.palette import BLACK, Color

_TITLES = {
    'deg': 'Direction', 'rad/s': 'Angular velocity', 'rad/s\u00b2': 'Angular acceleration',
    'm': 'Position', 'm/s': 'Velocity', 'm/s\u00b2': 'Acceleration',
}  # fmt: skip
# Colours of the designs, in order.
DESIGN_COLORS = (
    palette.SKY, palette.ORANGE, BLACK, palette.PURPLE, palette.GREEN, palette.BLUE,
    palette.VERMILION,
)  # fmt: skip
NOISE = 1e-9  # relative to the largest value; smaller values are rounding errors


@dataclass(frozen=True)
class Curve:
    """A quantity over a period.

    Attributes:
        name: Name of the curve, unique in a diagram.
        unit: Unit of the values, as written in the heading.
        period: Period that the curve covers.
        values: One value for each sample of the period, in this unit.
        color: Colour of the curve: that of its link or design, otherwise black.
        dash: Number of the line style; see `dash` in output.py.
    """

    name: str
    unit: str
    period: Period
    values: Array
    color: Color = BLACK
    dash: int = 0


@dataclass(frozen=True)
class Panel:
    """A diagram: the title without the unit, and curves in the same unit."""

    title: str
    curves: Sequence[Curve]

    @property
    def heading(self) -> str:
        """The title with the unit."""
        return f'{self.title}, {self.curves[0].unit}'

    @property
    def has_names(self) -> bool:
        """Whether curves are named: there are several, or the title does not name the only one."""
        return len(self.curves) > 1 or self.curves[0].name not in self.title

    @property
    def is_constant(self) -> bool:
        """Whether every curve is constant."""
        return not any(np.ptp(curve.values) for curve in self.curves)

    def without_noise(self) -> 'Panel':
        """Returns the diagram with rounding errors removed from zero and constant values."""
        finite = [curve.values[np.isfinite(curve.values)] for curve in self.curves]
        least = NOISE * max(np.abs(values).max(initial=0.0) for values in finite)
        curves = list[Curve]()
        for curve in self.curves:
            values = curve.values
            if np.isfinite(values).all() and np.ptp(values) <= least:  # it is constant
                values = np.full_like(values, values[0])
            curves.append(replace(curve, values=np.where(np.abs(values) <= least, 0.0, values)))
        return replace(self, curves=curves)

    def measured(self) -> list[Extent]:
        """Finds the extreme values and the rms of each curve, without rounding errors."""
        extents = [extent(curve.period.x, curve.values) for curve in self.curves]
        least = NOISE * max(max(-one.low, one.high) for one in extents)
        return [
            one._replace(
                low=0.0 if abs(one.low) <= least else one.low,
                high=0.0 if abs(one.high) <= least else one.high,
            )
            for one in extents
        ]


def panels(period: Period, show: Collection[str]) -> list[Panel]:
    """Returns the diagrams of one mechanism; `show` are quantities of `QUANTITIES`."""
    found = list[Panel]()
    for quantity in ('position', 'velocity', 'acceleration'):
        if quantity in show:
            found += _link_panels(period, quantity)
    if 'torque' in show:
        found += _effort_panels(period)
    if 'load' in show:
        found += _load_panels(period)
    if 'point' in show:
        found += _point_panels(period)
    if 'shaking_moment' in period.columns:
        found += _reaction_panels(period)
    return [panel.without_noise() for panel in found]


def only_in_table(period: Period) -> list[Panel]:
    """Returns the quantities listed in the table that have no diagram."""
    found = [
        Panel(f'Rate of {name}', [replace(_curve(period, f'{name}.length_rate'), name=name)])
        for name in period.springs
    ]
    if period.columns['driving_power'].values.any():
        found.append(Panel('Driving power', [_curve(period, 'driving_power')]))
    return [panel.without_noise() for panel in found]


def compared(periods: Mapping[str, Period], show: Collection[str]) -> list[Panel]:
    """Returns the shared diagrams of several mechanisms: motion of the outputs, and torques."""
    first, found = next(iter(periods.values())), list[Panel]()
    for quantity in ('position', 'velocity', 'acceleration', 'torque'):
        if quantity not in show:
            continue
        curves = list[Curve]()
        for i, (design, period) in enumerate(periods.items()):
            if quantity == 'torque':
                column = period.effort
            else:
                column = period.motion_column(period.solver.output, quantity)
            curve = replace(_curve(period, column), name=design, color=DESIGN_COLORS[i], dash=i)
            curves.append(curve)
        found += _by_unit(curves, first.effort_name if quantity == 'torque' else '')
    return [panel.without_noise() for panel in found]


def _effort_panels(period: Period) -> Iterator[Panel]:
    """Yields the diagram of the driving torque or force, in the colour of the driven link."""
    if not period.columns[period.effort].values.any():
        return  # a note says so
    curve = _of_link(period, period.effort, period.driven.name)
    word = period.effort.removeprefix('driving_')
    yield Panel(period.effort_name, [replace(curve, name=word, dash=0)])


def _load_panels(period: Period) -> Iterator[Panel]:
    """Yields the diagrams of loads: efforts on links, springs, and forces at points."""
    efforts = [column for column in period.columns if column.endswith('.load')]
    on_links = [_of_link(period, column, column.removesuffix('.load')) for column in efforts]
    yield from _by_unit(on_links, 'Load', 'on')
    springs = period.springs if period.solver.mobility else []
    for spring in springs:
        for word in ('length', 'leverage', 'tension'):
            if f'{spring}.{word}' not in period.columns:
                continue
            curve = replace(_curve(period, f'{spring}.{word}'), name=spring)
            yield Panel(f'{word.capitalize()} of {spring}', [curve])
    for column in period.columns:
        load, ending, _ = column.partition('.force.x')
        if ending and (load not in springs or load in period.cylinders):
            yield _vector_panel(period, f'Force {load}', f'{load}.force', BLACK)


def _point_panels(period: Period) -> Iterator[Panel]:
    """Yields the diagrams of the positions of traced points."""
    for point, link in period.solver.structure.traced.items():
        color = period.colors[link]
        yield _vector_panel(period, f'Point {point}', f'{point}.position', color)


def _link_panels(period: Period, quantity: str) -> Iterator[Panel]:
    """Yields the diagrams of positions, velocities or accelerations of the links."""
    driven, shown = period.driven.name, [*period.solver.links]
    has_constant_rate = not np.ptp(period.motion(driven, 'velocity').values)
    if period.across is not OVER_TIME and (has_constant_rate or quantity == 'position'):
        # The position of the driven link is the variable of the diagrams.
        shown.remove(driven)
    columns = {link: period.motion_column(link, quantity) for link in shown}
    yield from _by_unit([_of_link(period, column, link) for link, column in columns.items()])


def _reaction_panels(period: Period) -> Iterator[Panel]:
    """Yields the diagrams of joint forces, shaking force and shaking moment."""
    columns, structure = period.columns, period.solver.structure
    link_of_pin = {f'pin_{pin.name}': period.solver.links[pin.second] for pin in structure.pins}
    forces = list[Curve]()
    for column in columns:
        name, _, kind = column.partition('.')
        if kind == 'x' and name in link_of_pin:
            curve = _of_link(period, column, link_of_pin[name])
            magnitude = np.hypot(columns[f'{name}.x'].values, columns[f'{name}.y'].values)
            forces.append(replace(curve, name=name.removeprefix('pin_'), values=magnitude))
        elif kind == 'guide_force':
            forces.append(replace(_of_link(period, column, name), name=f'guide of {name}'))
    yield Panel('Joint forces', [replace(x, dash=i) for i, x in enumerate(forces)])
    yield _vector_panel(period, 'Shaking force', 'shaking_force', BLACK)
    yield Panel('Shaking moment', [replace(_curve(period, 'shaking_moment'), name='moment')])


def _vector_panel(period: Period, title: str, column: str, color: Color) -> Panel:
    """Makes the diagram of both components of a vector."""
    return Panel(title, [
        replace(_curve(period, f'{column}.{axis}'), name=axis, color=color, dash=i)
        for i, axis in enumerate('xy')
    ])  # fmt: skip


def _of_link(period: Period, column: str, link: str) -> Curve:
    """Makes a curve with the name, the colour and the dash of a link; the last link's is solid."""
    number = len(period.solver.links) - 1 - period.solver.links.index(link)
    return replace(_curve(period, column), name=link, color=period.colors[link], dash=number)


def _curve(period: Period, column: str) -> Curve:
    """Makes the black curve of a column."""
    unit, values = period.columns[column]
    if unit == 'rad':
        unit, values = 'deg', np.degrees(values)
    return Curve(column, unit.replace('^2', '\N{SUPERSCRIPT TWO}'), period, values)


def _by_unit(curves: Iterable[Curve], title: str = '', word: str = 'of') -> Iterator[Panel]:
    """Groups curves into one diagram per unit; without a title, it depends on the unit.

    The title names a single curve, after `word`.
    """
    groups = dict[str, list[Curve]]()
    for curve in curves:
        groups.setdefault(curve.unit, []).append(curve)
    for unit, group in groups.items():
        name = title or _TITLES[unit]
        yield Panel(name if len(group) > 1 else f'{name} {word} {group[0].name}', group)
