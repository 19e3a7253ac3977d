# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_chart sketch: what a parameter file means, as a drawing with all names, and in words."""

import argparse
import cmath
import contextlib
import functools
import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.path import Path
from matplotlib.patheffects import withStroke

from linkage_lab.assemblies import choices
from linkage_lab.charts.linkage_picture import NAME_STYLE, LinkagePicture
from linkage_lab.output import (
    NUMBERS,
    SMALL,
    WIDTH,
    chart,
    in_degrees,
    load_pose,
    name_of,
    pictures,
    rounded,
    wrapped,
    write_title,
)
from linkage_lab.period import Period, law_samples, length_unit
from linkage_lab.sampling import without_loads
from linkage_ros import Force, Solver, Spring, State, UnreachableError, cli
from linkage_ros.extensions import LOADS
from linkage_ros.formulas import Array
from linkage_ros.internals import FRAME, UNITS, Picture, axes_of, radians_per_second
from linkage_ros.palette import BLACK, DARK, GREY, Color, fractions
from linkage_ros.quantities import leaves

# Crank angle of a mechanism that turns fully and is given by lengths, deg; links rarely overlap
# there.
DRAWN_AT = 45.0
_STEPS_OF_LAW = 240  # in each repetition of a law
# Inches: height of the drawing, of a line of text, and margin.
HIGH, _LINE, _ROOM = 6.2, 0.165, 0.35
_CHARACTERS = 118  # in a line of text
_PLACES_OF_LOADS = 'link', 'to', 'pin'  # parameters of loads that are in the words on their links
_MARKS = 4.0  # length of the arrow of a slide's direction, in marks of the drawing
# Places of a dimension along its bar, the preferred ones first; the distance from other lines that
# is enough, relative to the size of the drawing; and how far from a bar a pin divides it, relative
# to the length of the bar.
_SHARES, _ROOM_OF_DIMENSION, _ON_BAR = (0.35, 0.5, 0.65, 0.2, 0.8), 0.06, 0.01
_SHARES_OF_ARROW = 0.5, 0.35, 0.65, 0.2, 0.8  # places of a link's arrow, the preferred first
_SHIFT = 0.2  # of the name of a link or spring along it, relative to its length
_AT_PIN = 0.03  # distance of marks that cover a pin, relative to the size of the drawing
# Two quarters of a disk: with a circle, the sign of a centre of mass.
_QUARTERS = Path.make_compound_path(Path.wedge(0, 90), Path.wedge(180, 270))
_NEAR_BAR = 12.0  # largest distance of a dimension from its bar, points
_GAPS = 4.5, 8.0, 13.0, 20.0, 30.0, 45.0, 60.0  # between names and what they belong to, points
SPRING_STYLE: dict[str, Any] = {
    'color': fractions(DARK), 'linewidth': 1.6, 'linestyle': (0, (1.5, 1.5)),
}  # fmt: skip


@dataclass(frozen=True)
class Sketched:
    """A mechanism at the position at which it is drawn.

    Attributes:
        design: The configuration.
        solver: Solver of the mechanism without loads, which do not change the motion.
        place: Position of the driven joint, rad or m.
        state: The state there, at the speed of the file.
        path: Positions of the links along the paths of the pins, rad and m, shape (n, links); None
            for all that they can reach, or for none, with two coordinates.
    """

    design: Any
    solver: Solver
    place: float
    state: State
    path: Array | None = None

    @property
    def unit(self) -> str:
        """Unit of lengths: 'm', 'mm', 'cm' or 'in'."""
        return length_unit(self.design.mechanism)

    @functools.cached_property
    def drawing(self) -> Picture:
        """The drawing of the mechanism."""
        return Picture(self.design.mechanism, self.place, units=self.unit)

    @property
    def positions(self) -> Array:
        """Positions of the links, rad and m, shape (1, links)."""
        return np.array([self.state.position])

    @property
    def rates(self) -> Array:
        """Rates of the links, rad/s and m/s, shape (1, links)."""
        return np.array([self.state.velocity])

    def length(self, value: float, digits: int = 5) -> str:
        """Writes a length, m, in the unit of the sketch."""
        return f'{round(value / float(UNITS[self.unit]), 9) + 0.0:.{digits}g}'

    def at(self, point: complex) -> str:
        """Writes a place, m, in the unit of the sketch."""
        return f'({self.length(point.real)}, {self.length(point.imag)})'

    def point(self, point: Any) -> complex:
        """Returns the place of a point of the structure, m."""
        turned = (cmath.rect(1.0, x) for x in self.state.position)
        arms = (weight * x for weight, x in zip(point.weights, turned, strict=True))
        return complex(point.fixed + sum(arms))

    def direction(self, j: int) -> float:
        """Returns the direction of a link, or of the guide on which it slides, rad."""
        spin, guide = axes_of(self.solver.structure.links, j)
        return (0.0 if spin is None else self.state.position[spin]) + (guide or 0.0)

    def pin_of(self, j: int) -> complex:
        """Returns the place of a sliding link's pin, m."""
        return self.point(self.solver.structure.point_of(j, (0.0, 0.0)))


def sketch(options: argparse.Namespace) -> None:
    """Draws a mechanism with all names, and describes it in words.

    Raises:
        ConfigurationError: The mechanism or an option is invalid, or a file cannot be written.
        UnreachableError: The mechanism cannot be at the position.
    """
    design, notes = load_pose(options)
    name = name_of(options.params, design)
    sketched = sketch_of(design, options.at)
    lines = [*describe(sketched)]
    files = pictures(options, f'{name}_sketch')
    cli.print_notes(notes)
    written = [part for line in lines for part in wrapped(line, _CHARACTERS, '    ')]
    height = _ROOM + HIGH + _LINE * len(written) + 0.15
    with chart(files, height, layout=None) as figure:
        write_title(figure, name)
        axes = figure.add_axes((0.02, 1 - (_ROOM + HIGH) / height, 0.96, HIGH / height))
        draw_sketch(axes, sketched, with_dimensions=options.dimensions, with_centers=True)
        figure.text(
            0.3 / WIDTH, 1 - (_ROOM + HIGH + 0.05) / height, '\n'.join(written), va='top',
            family='monospace', fontsize=NUMBERS - 0.5, linespacing=1.25,
        )  # fmt: skip
    print(name, *lines, *files, sep='\n')


def sketch_of(design: Any, at: float | None = None) -> Sketched:
    """Computes the state at which a mechanism is drawn.

    Args:
        design: The configuration.
        at: Position of the driven joint, rad or m; None for that of its drawing or, if it is given
            by lengths, 45 deg, the start, or the middle of the arc.

    Raises:
        UnreachableError: The mechanism cannot be there.
    """
    solver = without_loads(Solver(design.mechanism))
    driven = solver.structure.driven_link
    positions, rates = design.mechanism.start()
    place = _default_place(design, solver) if at is None else at
    rpm = 0.0 if driven.slides else getattr(design.drive, 'rpm', 0.0)
    state = solver.state((place, *positions), (radians_per_second(rpm), *rates))
    return Sketched(design, solver, place, state, _path_of_law(design, solver))


def _path_of_law(design: Any, solver: Solver) -> Array | None:
    """Returns the positions of the links along the law of the drive, or None; see `Sketched`."""
    law = design.drive.law(solver.structure.driven_link)
    if law is None or solver.mobility is None:
        return None
    time, motion = law_samples(solver, law, _STEPS_OF_LAW)
    with contextlib.suppress(UnreachableError):
        return np.stack(solver.state(*motion(time)[:3]).position, axis=-1)
    return None  # a note says so


def _default_place(design: Any, solver: Solver) -> float:
    """Returns the position of the driven joint if none is given; see `sketch_of`."""
    drawn, reach = _drawn_at(design), solver.mobility
    if drawn is not None:
        return drawn
    if reach is None or reach.turns_fully:
        return math.radians(DRAWN_AT)
    start: float = design.drive.drawn_angle(design.mechanism)
    low, high = reach.arc_around(start)
    return start if low < start < high else 0.5 * (low + high)


def sketch_at(design: Any, period: Period, now: int) -> Sketched:
    """Returns the state of a period at which its mechanism is drawn, that of sample `now`."""
    path, *rates = (period.rows(word) for word in ('position', 'velocity', 'acceleration'))
    velocity, acceleration = (tuple(row[now].tolist()) for row in rates)
    state = State(tuple(path[now].tolist()), velocity, acceleration, 0.0)
    solver = without_loads(period.solver)
    return Sketched(design, solver, float(period.crank[now]), state, path)


def _drawn_at(design: Any) -> float | None:
    return design.mechanism.drawn.position if design.mechanism.drawn else None


# ---------------------------------------------------------------- words


def describe(sketched: Sketched) -> Iterator[str]:
    """Yields lines that describe a mechanism at its drawn position."""
    structure = sketched.solver.structure
    yield from _kind(sketched)
    first = next(iter(structure.points))
    drawn = 'as drawn' if sketched.place == _drawn_at(sketched.design) else 'shown'
    is_drawn = bool(sketched.design.mechanism.drawn)
    axes = 'base_link, in the axes of the drawing' if is_drawn else 'base_link'
    driven = structure.driven_link
    yield (
        f'{drawn} at {driven.name} {_position(sketched, structure.driven)}; lengths in '
        f'{sketched.unit}, from {first}, the origin of {axes}'
    )
    drawing = sketched.drawing
    fixed = {
        name: complex(*pivot)
        for name, pivot in zip(drawing.pivot_names, drawing.pivots, strict=True)
    }
    places = (f'{name} {sketched.at(place)}' for name, place in fixed.items())
    yield f'frame: {", ".join(places)}'
    for j in range(len(structure.links)):
        yield _link(sketched, j)
    for name, link in structure.traced.items():
        place = sketched.at(sketched.point(structure.points[name]))
        yield f'point {name} of {link}: {place}, traced'
    for name, start, end in _springs(sketched):
        yield (
            f'line {name}: from {sketched.at(start)} to {sketched.at(end)}, length '
            f'{sketched.length(abs(end - start))}'
        )
    yield from _loads(sketched.design, structure)


def _kind(sketched: Sketched) -> Iterator[str]:
    """Yields the kind of mechanism, its assemblies and its reach."""
    mechanism, solver = sketched.design.mechanism, sketched.solver
    dyads = [' and '.join(dyad.parts) for dyad in mechanism.dyads]
    names = ', '.join(solver.links[: len(solver.links) - 2 * len(dyads)])
    plural = 's' if len(dyads) > 1 else ''
    added = f', and the dyad{plural} {"; ".join(dyads)}' if dyads else ''
    yield f'{sketched.design.mechanism_words}: {names}{added}'
    assemblies = [dyad.assembly_words for dyad in mechanism.dyads if dyad.has_assemblies]
    if len(choices(mechanism)[0]) > 1:
        assemblies.insert(0, f'loop {mechanism.assembly}')
    if assemblies:
        yield f'assemblies: {"; ".join(assemblies)}'
    reach, driven = solver.mobility, solver.structure.driven_link
    free = len(solver.coordinates)
    yield f'{free} degree{"s" if free > 1 else ""} of freedom; input: {driven.name}'
    if reach is not None:
        yield f'reach: {_reach(reach, driven)}'


def _reach(reach: Any, driven: Any) -> str:
    """Describes the class and the reach of the driven joint."""
    start = driven.name if reach.slides else f'{reach.grashof}: {driven.name}'
    if reach.turns_fully:
        turns = reach.period_turns
        repeats = f', the motion repeats after {turns} turns' if turns > 1 else ''
        return f'{start} turns fully{repeats}'
    scale, unit = (1.0, 'm') if reach.slides else (180 / math.pi, 'deg')
    arcs = [f'{low * scale:.6g} to {high * scale:.6g} {unit}' for low, high in reach.shown_arcs]
    return f'{start} {" and ".join(arcs)}; {"; ".join(reach.limits)}'


def _position(sketched: Sketched, j: int) -> str:
    """Writes the position of a link."""
    value = sketched.state.position[j]
    if sketched.solver.structure.links[j].slides:
        return f'{sketched.length(value)} {sketched.unit}'
    return in_degrees(value)


def _link(sketched: Sketched, j: int) -> str:
    """Describes a link: its axes, length and mass."""
    link = sketched.solver.structure.links[j]
    part = sketched.design.mechanism.parts()[link.name]
    words = _slide_words(sketched, j) if link.slides else _turning_words(sketched, j, part)
    for name, unit in (('mass', 'kg'), ('inertia', 'kg m^2')):
        if value := getattr(part, name, 0.0):
            words += f', {name} {rounded(value)} {unit}'
            if name == 'mass':
                words += f' at {sketched.at(_center(sketched, j))}'
    return f'{link.name}: {words}'


def _center(sketched: Sketched, j: int) -> complex:
    """Returns the centre of mass of a link, m; that of a slide on the frame is at its pin."""
    return sketched.point(sketched.solver.structure.links[j].center)


def _slide_words(sketched: Sketched, j: int) -> str:
    """Describes on what a link slides, its position, and where that is 0."""
    links = sketched.solver.structure.links
    parent = links[j].parent
    carrier = 'the frame' if parent is None else links[parent].name
    direction = in_degrees(math.remainder(sketched.direction(j), math.tau))
    return (
        f'slides on {carrier} at {_position(sketched, j)}, 0 at '
        f'{sketched.at(_zero(sketched, j))}, + towards {direction}'
    )


def _turning_words(sketched: Sketched, j: int, part: Any) -> str:
    """Describes between which points a link runs, its direction, and the lengths of its bars."""
    start, end = _ends(sketched, j)
    ends = f'from {start} to {end}' if end else f'turns about {start}'
    words = f'{ends}, direction {_position(sketched, j)}'
    if length := getattr(part, 'length', 0.0):
        words += f', length {sketched.length(length)}'
    for bar in _bars(sketched, sketched.solver.structure.links[j].name):
        if bar.name not in {f'{start} to {end}', f'{end} to {start}'}:
            words += f', {bar.name} {sketched.length(bar.length)}'
    return words


def _ends(sketched: Sketched, j: int) -> tuple[str, str]:
    """Returns the names of the points from which and to which a link's direction runs."""
    structure = sketched.solver.structure
    part = sketched.design.mechanism.parts()[structure.links[j].name]
    length = getattr(part, 'length', 0.0)
    places = {name: sketched.point(point) for name, point in structure.points.items()}
    near = 1e-9 * max(map(abs, places.values()))

    def name_at(distance: float) -> str:
        place = sketched.point(structure.point_of(j, (distance, 0.0)))
        return next((name for name, other in places.items() if abs(other - place) < near), '')

    return name_at(0.0), name_at(length) if length else ''


def _zero(sketched: Sketched, j: int) -> complex:
    """Returns the place on the path of a sliding link's pin at which its position is 0, m."""
    direction = cmath.rect(1.0, sketched.direction(j))
    return sketched.pin_of(j) - float(sketched.state.position[j]) * direction


def _springs(sketched: Sketched) -> Iterator[tuple[str, complex, complex]]:
    """Yields the lines of springs, and of cylinders without one: name and both ends, m."""
    lines = spring_lines(sketched.design, sketched.solver.structure, sketched.positions)
    for name, (line,) in lines.items():
        start, end = line @ (1, 1j)
        yield name, complex(start), complex(end)


def spring_lines(design: Any, structure: Any, positions: Array) -> dict[str, Array]:
    """Returns the lines of springs, and of cylinders without one.

    Args:
        design: The configuration.
        structure: The structure of its mechanism.
        positions: Positions of the links, rad and m, shape (n, links).

    Returns:
        Lines of shape (n, 2, 2), m, by name.
    """
    directions = np.exp(1j * positions)

    def places(point: Any) -> Array:
        if isinstance(point, complex):  # it is fixed
            return np.full(len(positions), point)
        return np.asarray(point.fixed + directions @ np.array(point.weights))

    lines = dict[str, Array]()
    for name, (start, end) in _line_ends(design, structure).items():
        line = np.stack([places(start), places(end)], axis=1)
        lines[name] = np.stack([line.real, line.imag], axis=-1)
    return lines


def _line_ends(design: Any, structure: Any) -> dict[str, tuple[Any, Any]]:
    """Returns the ends of springs, and of cylinders without one, by name.

    An end is a point of the structure, or a fixed place, x + iy, m.
    """
    given = design.drawn_mechanism
    loads = getattr(given, 'loads', ())
    cylinder_of = {x.name: x.cylinder for x in loads if getattr(x, 'cylinder', '')}
    ends = dict[str, tuple[Any, Any]]()
    for load in design.mechanism.loads:
        if isinstance(load, Spring):
            (_, start), (_, end) = load.ends(structure)
            cylinder = cylinder_of.get(load.name)
            ends[f'{cylinder} ({load.name})' if cylinder else load.name] = start, end
    drawing = getattr(given, 'drawing', None)
    if drawing is None:
        return ends
    points = dict(design.mechanism.drawn.fixed) | structure.points
    for cylinder in drawing.cylinders:
        if cylinder.name != drawing.input and cylinder.name not in cylinder_of.values():
            ends[cylinder.name] = points.get(cylinder.from_), points.get(cylinder.to)
    return ends


def _loads(design: Any, structure: Any) -> Iterator[str]:
    """Yields a line for each load: its links, and its parameters that are not the defaults."""
    values = design.parameters()
    for load in design.mechanism.loads:
        prefix = f'loads.{load.name}.'
        kind = values[f'{prefix}kind']
        defaults = {leaf.name: leaf.default for leaf in leaves(LOADS[kind], prefix)}
        changed = {
            name.removeprefix(prefix): value
            for name, value in values.items()
            if name in defaults and value != defaults[name]
        }
        words = kind
        if links := _links_of_load(load, structure):
            words = f'{kind} on {links}'
            if pin := values.get(f'{prefix}pin'):
                words += f' at pin {pin}'
            for word in _PLACES_OF_LOADS:
                changed.pop(word, None)
        parameters = (f'{name} {_words(value)}' for name, value in changed.items())
        yield f'load {load.name}: {", ".join([words, *parameters])}'


def _links_of_load(load: Any, structure: Any) -> str:
    """Returns the links on which a force or a spring acts; empty for other loads."""
    places = list[Any]()  # index of the link, and point
    if isinstance(load, Spring):
        places += load.ends(structure)
    if isinstance(load, Force):
        places.append(structure.place_of('', load.link, load.at, load.pin))
    names = ['frame' if j == FRAME else structure.links[j].name for j, _ in places]
    return ' and '.join(names)


def _words(value: Any) -> str:
    """Writes the value of a parameter."""
    if isinstance(value, (list, tuple)):
        return f'[{", ".join(map(_words, value))}]'
    return rounded(value) if isinstance(value, float) else str(value)


# ---------------------------------------------------------------- the drawing


class _Label(NamedTuple):
    """A name in the drawing.

    Attributes:
        text: The name.
        at: Position of the labelled part, x + iy, m.
        direction: Preferred direction from there.
        color: Colour of the text.
        bold: Whether the label names a link.
        is_optional: Whether to omit the label if there is no room near the part.
        shift: Vector by which `at` may be moved forwards and backwards along the part, m.
        part: The part if the label should be nearest to it, a line of shape (k, 2), m.
    """

    text: str
    at: complex
    direction: complex
    color: Color
    bold: bool = False
    is_optional: bool = False
    shift: complex = 0j
    part: Array | None = None


class _Drawn(NamedTuple):
    """Labels of drawn parts, and lines that names should not cover, m, shapes (k, 2)."""

    labels: list[_Label]
    lines: list[Array]


def draw_sketch(
    axes: Axes, sketched: Sketched, *, with_dimensions: bool, with_centers: bool
) -> None:
    """Draws a mechanism with all names and its loads.

    Args:
        axes: Axes to draw in.
        sketched: The mechanism.
        with_dimensions: Whether to write the lengths between pins.
        with_centers: Whether to mark the centres of mass that are not at a pin.
    """
    drawing = sketched.drawing
    parts = (
        _draw_springs(axes, sketched),
        _draw_loads(axes, sketched),
        _draw_slides(axes, sketched),
    )
    labels = [label for part in parts for label in part.labels]
    marks = [line for part in parts for line in part.lines]
    if with_centers:
        _draw_centers(axes, sketched)
    if with_dimensions:
        for bar in _ground_bars(drawing):
            line = np.array([bar.start, bar.end])
            axes.plot(line.real, line.imag, color=fractions(GREY), linewidth=0.8, dashes=(8, 3))
    path = sketched.path
    if path is None:  # pins of two coordinates move in areas, not on paths
        path = drawing.positions if sketched.solver.mobility else sketched.positions
    places = drawing.place(sketched.positions)
    lines = {link: line for link, (line,) in drawing.links(places).items()}
    # Marks count twice: a covered arrow is worse than a covered link.
    covered = [*marks, *marks, *lines.values(), *drawing.ground]
    picture = LinkagePicture(axes, drawing, path, sketched.positions, covered)
    middle = complex(*np.mean(places[0], axis=0))
    names = [link.name for link in sketched.solver.structure.links]
    labels += [_name(axes, sketched, j, lines[name], middle) for j, name in enumerate(names)]
    if with_dimensions:
        labels += _dimensions(sketched, marks)
    _write(axes, picture, labels, covered)


def _draw_springs(axes: Axes, sketched: Sketched) -> _Drawn:
    """Draws springs and cylinders."""
    drawn = _Drawn([], [])
    for name, start, end in _springs(sketched):
        line = np.array([[start.real, start.imag], [end.real, end.imag]])
        axes.plot(*line.T, **SPRING_STYLE)
        drawn.lines.append(line)
        middle, way = 0.5 * (start + end), end - start
        drawn.labels.append(_Label(name, middle, 1j * way, DARK, shift=_SHIFT * way, part=line))
    return drawn


def _draw_loads(axes: Axes, sketched: Sketched) -> _Drawn:
    """Draws the arrows of loads, with their values."""
    drawing, drawn = sketched.drawing, _Drawn([], [])
    values = drawing.load_values(sketched.positions, sketched.rates)
    links = drawing.links(drawing.place(sketched.positions))
    corners = {link: line for link, (line,) in links.items()}
    for name, (arrow,) in drawing.loads(sketched.positions, sketched.rates).items():
        if not np.ptp(arrow, axis=0).any():
            continue  # no load here
        # It is above the links and the guide, along which it may point, and below the pins.
        axes.plot(*arrow.T, color=fractions(BLACK), linewidth=2.0, zorder=2.5)
        tail, tip = complex(*arrow[0]), complex(*arrow[Picture.ARROW_TIP])
        away = tail - tip if tail != tip else 1j
        load, on_link, link = name.partition(' on ')
        word = load if on_link else f'on {name}'
        drawn.lines.append(arrow)
        if link in corners:  # a thin line from the nearest pin, as the point may be far
            distances = np.linalg.norm(corners[link] - arrow[0], axis=1)
            arm = np.stack([corners[link][distances.argmin()], arrow[0]])
            axes.plot(*arm.T, color=fractions(drawing.colors[link]), linewidth=0.9)
            drawn.lines.append(arm)
        drawn.labels.append(_Label(f'{word} {values[name][0]}', tail, away, BLACK))
    return drawn


def _draw_slides(axes: Axes, sketched: Sketched) -> _Drawn:
    """Draws where the position of each slide is 0, and its + direction."""
    drawn = _Drawn([], [])
    mark = 0.025 * float(np.ptp(sketched.drawing.bounds, axis=0).max())  # unit of the sizes, m
    for j, link in enumerate(sketched.solver.structure.links):
        if not link.slides:
            continue
        zero, direction = _zero(sketched, j), cmath.rect(1.0, sketched.direction(j))
        side = 1j * direction
        start = zero + 1.5 * mark * side  # beside the path
        tick = np.array([zero + 0.5 * mark * side, start + 0.5 * mark * side])  # shows a pin there
        axes.plot(tick.real, tick.imag, color=fractions(DARK), linewidth=0.9, zorder=1.5)
        tip = start + _MARKS * mark * direction
        axes.annotate(
            '', (tip.real, tip.imag), (start.real, start.imag),
            arrowprops={'arrowstyle': '-|>', 'color': fractions(DARK), 'linewidth': 0.9},
            zorder=1.5,
        )  # fmt: skip
        axes.plot(tip.real, tip.imag, linestyle='')  # counts for the limits of the axes
        arrow = np.array([start, tip])
        drawn.lines.extend(np.stack([x.real, x.imag], axis=1) for x in (tick, arrow))
        drawn.labels.append(_Label(f'0 {link.name} +', 0.5 * (start + tip), side, BLACK))
    return drawn


def _draw_centers(axes: Axes, sketched: Sketched) -> None:
    """Draws the centre of mass of each link that has a mass, unless it is at a pin."""
    drawing, (pins, near) = sketched.drawing, _pins(sketched)
    for j, link in enumerate(sketched.solver.structure.links):
        center = _center(sketched, j)
        if sketched.design.mechanism.parts()[link.name].mass and abs(pins - center).min() > near:
            style: Any = {'color': fractions(drawing.colors[link.name]), 'zorder': 3.9}
            place = [center.real], [center.imag]
            axes.plot(*place, 'o', markersize=8, markerfacecolor='white', **style)
            axes.plot(*place, marker=_QUARTERS, markersize=8, markeredgewidth=0, **style)


def _name(axes: Axes, sketched: Sketched, j: int, line: Array, middle: complex) -> _Label:
    """Draws the arrow of a link's direction; returns the label with its name.

    Args:
        axes: Axes to draw in.
        sketched: The mechanism.
        j: Index of the link.
        line: Line of the link, m, shape (k, 2).
        middle: Middle of the linkage, from which the name is away, m.
    """
    link = sketched.solver.structure.links[j]
    color = sketched.drawing.colors[link.name]
    direction = cmath.rect(1.0, sketched.direction(j))
    if link.slides:
        at, shift, part = sketched.pin_of(j), 0j, None
    else:
        (at, shift), part = _place_of_arrow(sketched, j, line, direction), line
        before = at - 1e-6 * float(np.ptp(line)) * direction
        axes.annotate(
            '', (at.real, at.imag), (before.real, before.imag),
            arrowprops={'arrowstyle': '-|>', 'color': fractions(color), 'mutation_scale': 15},
        )  # fmt: skip
    side = 1j * direction
    is_inward = (side * (at - middle).conjugate()).real < 0
    way = -side if is_inward else side
    return _Label(link.name, at, way, color, bold=True, shift=shift, part=part)


def _place_of_arrow(
    sketched: Sketched, j: int, line: Array, direction: complex
) -> tuple[complex, complex]:
    """Returns the place on a link, m, at which an arrow is on a line and covers no pin.

    The second complex number is a vector by which a name there may be moved along the line.
    """
    sides = [(start, end) for start, end in itertools.pairwise(line @ (1, 1j)) if start != end]
    parallel = [
        (start, end)
        for start, end in sides
        if abs(((end - start) / direction).imag) < _ON_BAR * abs(end - start)
    ]  # the first side of a link with a slot is not
    start, end = max(parallel or sides, key=lambda side: abs(side[1] - side[0]))
    places = [complex(start + share * (end - start)) for share in _SHARES_OF_ARROW]
    pins, near = _pins(sketched)
    marks = np.append(pins, _center(sketched, j))
    rooms = [min(abs(marks - place).min(), near) for place in places]
    return places[int(np.argmax(rooms))], _SHIFT * complex(end - start)


def _pins(sketched: Sketched) -> tuple[Any, float]:
    """Returns the places of all pins, x + iy, and the distance of a mark that covers one, m."""
    drawing = sketched.drawing
    pins = np.concatenate([drawing.pivots, drawing.place(sketched.positions)[0]])
    return pins @ (1, 1j), _AT_PIN * float(np.ptp(pins, axis=0).max())


def _ground_bars(drawing: Picture) -> list['_Bar']:
    """Returns the lines from the first fixed pin to the others."""
    (start, *others), (first, *names) = drawing.pivots @ (1, 1j), drawing.pivot_names
    return [
        _Bar(complex(start), complex(end), f'{first} to {name}')
        for end, name in zip(others, names, strict=True)
    ]


def _dimensions(sketched: Sketched, marks: list[Array]) -> Iterator[_Label]:
    """Yields the lengths of the bars of links that turn, and of the lines between fixed pins.

    Args:
        sketched: The mechanism.
        marks: Other lines, from which dimensions are kept away like from other bars.
    """
    drawing, written = sketched.drawing, list[complex]()
    bars = [bar for link in drawing.turning for bar in _bars(sketched, link)]
    ground = _ground_bars(drawing)
    bars += ground
    lines = [(bar.start, bar.end) for bar in bars]
    lines += [pair for mark in marks for pair in itertools.pairwise(mark @ (1, 1j))]
    enough = _ROOM_OF_DIMENSION * float(np.ptp(drawing.bounds, axis=0).max())
    for bar in bars:
        places = [bar.start + share * (bar.end - bar.start) for share in _SHARES]
        others = [line for line in lines if {*line} != {bar.start, bar.end}]
        others += [(place, place) for place in written]
        rooms = [min(_room(place, others), enough) for place in places]
        place = places[int(np.argmax(rooms))]  # the first of the best
        written.append(place)
        text, direction = sketched.length(bar.length, 4), 1j * (bar.end - bar.start)
        yield _Label(text, place, direction, BLACK, is_optional=bar not in ground)


class _Bar(NamedTuple):
    """A bar between neighbouring pins of a link.

    Attributes:
        start: Place of one pin, x + iy, m.
        end: Place of the other pin.
        name: Names of both pins.
    """

    start: complex
    end: complex
    name: str

    @property
    def length(self) -> float:
        """Length of the bar, m."""
        return abs(self.end - self.start)


def _bars(sketched: Sketched, link: str) -> list[_Bar]:
    """Returns the bars between neighbouring pins of a link, each once."""
    structure, drawing = sketched.solver.structure, sketched.drawing
    points = drawing.place(sketched.positions)
    pins = dict(zip(drawing.pins, (points[0] @ (1, 1j)).tolist(), strict=True))
    pins.pop(structure.mouth, None)  # where the drawing of a barrel ends
    pins |= zip(drawing.pivot_names, (drawing.pivots @ (1, 1j)).tolist(), strict=True)
    name_at = {place: name for name, place in pins.items()}
    corners = (drawing.links(points)[link][0] @ (1, 1j)).tolist()
    own_pins = [*dict.fromkeys(corner for corner in corners if corner in name_at)]
    bars = dict[tuple[complex, complex], _Bar]()
    for start, end in itertools.pairwise(corners):
        if start == end or start not in name_at or end not in name_at:
            continue
        for one, other in itertools.pairwise(_divided(start, end, own_pins)):
            if (other, one) not in bars:
                bars[one, other] = _Bar(one, other, f'{name_at[one]} to {name_at[other]}')
    return [*bars.values()]


def _divided(start: complex, end: complex, pins: list[complex]) -> list[complex]:
    """Returns both ends of a line, and between them the pins that lie on it, in order."""
    shares = {pin: (pin - start) / (end - start) for pin in pins}
    inner = [
        pin
        for pin, share in shares.items()
        if abs(share.imag) < _ON_BAR and 0.0 < share.real < 1.0
    ]
    return [start, *sorted(inner, key=lambda pin: shares[pin].real), end]


def _room(place: complex, lines: list[tuple[complex, complex]]) -> float:
    """Returns the distance of a place from lines with two ends each, m; infinite without lines."""
    if not lines:
        return math.inf
    start, end = np.array(lines).T
    line = end - start
    square = np.where(line == 0.0, 1.0, abs(line) ** 2)
    share = np.clip(((place - start) * line.conjugate()).real / square, 0.0, 1.0)
    return float(abs(start + share * line - place).min())


def _write(axes: Axes, picture: LinkagePicture, labels: list[_Label], lines: list[Array]) -> None:
    """Writes labels where they cover no other label, and few lines."""
    halo = withStroke(linewidth=2.5, foreground='white')
    texts = [
        axes.annotate(
            label.text, (label.at.real, label.at.imag), xytext=(0, 0), ha='center',
            color=fractions(label.color), weight='bold' if label.bold else 'normal',
            path_effects=[halo], zorder=5, **{**NAME_STYLE, 'fontsize': SMALL},
        )
        for label in labels
    ]  # fmt: skip
    boxes = np.array([text.get_window_extent().get_points() for text in texts])
    sizes = 72 / axes.figure.dpi * np.ptp(boxes, axis=1)
    anchors = picture.to_points(np.array([[x.at.real, x.at.imag] for x in labels]))
    preferred = np.array([[x.direction.real, x.direction.imag] for x in labels])
    moved = np.array([[(x.at + x.shift).real, (x.at + x.shift).imag] for x in labels])
    places = picture.free_places(
        anchors, preferred, sizes, lines, _GAPS,
        [label.part for label in labels], picture.to_points(moved) - anchors,
    )  # fmt: skip
    for label, text, size, place in zip(labels, texts, sizes, places, strict=True):
        text.set_position(tuple(place.tolist()))
        if label.is_optional and (abs(place) - 0.5 * size).max() > _NEAR_BAR:
            text.set_text('')  # it would seem to belong to another bar
