# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A machine as it is drawn: pins and links, at one position, converted to a mechanism with dyads.

The loop of the input becomes the mechanism; each further pair of links that is held by those
before becomes a dyad. Lengths are those between the pins as drawn, computed from the decimals of
the coordinates and rounded once, so that a drawn parallelogram is one. The assemblies are those of
the drawn position.
"""

import decimal
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from fractions import Fraction
from typing import Any, NamedTuple, cast

from linkage_ros.errors import ConfigurationError, MechanismError, Mistakes, UnreachableError
from linkage_ros.mechanism.base import Drawn, Mechanism
from linkage_ros.mechanism.dyads import Dyad, DyadSlider
from linkage_ros.mechanism.four_bar import FourBar
from linkage_ros.mechanism.inverted_slider_crank import CYLINDER, InvertedSliderCrank
from linkage_ros.mechanism.loads import loads_field
from linkage_ros.mechanism.loads.base import AppliedLoad
from linkage_ros.mechanism.parts import (
    CROSSED,
    OPEN,
    Barrel,
    Body,
    Coupler,
    Frame,
    Guide,
    Rod,
    Slider,
    gravity_quantity,
)
from linkage_ros.mechanism.points import TracedPoint, points_field
from linkage_ros.mechanism.slider_crank import SliderCrank
from linkage_ros.quantities import Checked, groups, named, quantity, required, shown

UNITS = {'m': Fraction(1), 'cm': Fraction(1, 100), 'mm': Fraction(1, 1000),
         'in': Fraction(254, 10000)}  # fmt: skip
FRAME = 'frame'
_NAME = '[A-Za-z](_?[A-Za-z0-9])*_?'  # without two underscores in succession
_RESERVED = {FRAME, 'world', 'base_link'}
# rcl reads these as booleans.
_BOOLEANS = {'y', 'n', 'yes', 'no', 'on', 'off', 'true', 'false'}
_PLACES = (-1e12, 1e12)
_MASSES = (0.0, 1e12)
# The smallest sine of the angle at which two links meet that still tells their assembly: in the
# loop, which may be near a change point, and in a dyad.
_LEAST_SINE, _LEAST_SINE_OF_DYAD = 1e-6, 1e-3
_DIGITS = decimal.Context(prec=60)


def _mass() -> Any:
    return quantity('number', 'mass', 'kg', span=_MASSES, default=0.0)


def _inertia() -> Any:
    return quantity(
        'number', 'moment of inertia about the centre of mass', 'kg m^2', span=_MASSES, default=0.0
    )


def _center() -> Any:
    return quantity('pair', 'centre of mass as drawn [x, y], in units', span=_PLACES, default=None)


@dataclass(frozen=True)
class DrawnMass(Checked):
    """The mass of a barrel or a rod.

    Attributes:
        mass: Mass, kg.
        inertia: Moment of inertia about the centre of mass, kg m^2.
        center: Centre of mass [x, y] as drawn; None if the mass is 0.
    """

    mass: float = _mass()
    inertia: float = _inertia()
    center: tuple[float, float] | None = _center()


@dataclass(frozen=True)
class DrawnLink(Checked):
    """A link of a drawing.

    Attributes:
        name: Name of the link.
        pins: Names of its pins. A pin of one link alone is a point of it, whose path is traced.
        mass: Mass, kg.
        inertia: Moment of inertia about the centre of mass, kg m^2.
        center: Centre of mass [x, y] as drawn; None if the mass is 0.
        length: Distance of the two pins that join the link to its loop or dyad, instead of the
            drawn one; None for the drawn one.
    """

    name: str = required()
    pins: tuple[str, ...] = quantity('names', 'pins of the link')
    mass: float = _mass()
    inertia: float = _inertia()
    center: tuple[float, float] | None = _center()
    length: float | None = quantity(
        'number', 'distance of its two pins, in units, instead of the drawn one',
        span=(1e-9, 1e12), default=None,
    )  # fmt: skip


@dataclass(frozen=True)
class DrawnSlide(Checked):
    """A block that slides along a straight line of the frame or of a link.

    Attributes:
        name: Name of the block.
        direction: Direction [x, y] of the line as drawn, in which a position on the frame
            increases.
        pin: Pin of the block, through which the line passes; empty if `pins` are given.
        pins: Pins of the block; the line passes through the first. None if `pin` is given.
        on: Link that has the line, or 'frame'.
        mass: Mass, kg.
        inertia: Moment of inertia about the centre of mass, kg m^2; of no effect on the frame,
            where the block does not turn.
        center: Centre of mass [x, y] as drawn; on the frame it is the pin.
    """

    name: str = required()
    direction: tuple[float, float] = quantity(
        'pair', 'direction [x, y] of the line as drawn', span=_PLACES
    )
    pin: str = quantity('text', 'pin of the block, on its line', default='')
    pins: tuple[str, ...] | None = quantity(
        'names', 'pins of a block with several; the first is on its line', default=None
    )
    on: str = quantity('text', 'link that has the line, or frame', default=FRAME)
    mass: float = _mass()
    inertia: float = _inertia()
    center: tuple[float, float] | None = _center()


@dataclass(frozen=True)
class DrawnCylinder(Checked):
    """A cylinder between two pins.

    As the input it has a barrel and a rod; otherwise it is the line of loads of kind spring.

    Attributes:
        name: Name of the cylinder; its links are NAME_barrel and NAME_rod.
        from_: Pin of the barrel.
        to: Pin of the rod.
        barrel: Mass of the barrel.
        rod: Mass of the rod.
    """

    name: str = required()
    from_: str = quantity('text', 'pin of the barrel')
    to: str = quantity('text', 'pin of the rod')
    barrel: DrawnMass = field(default_factory=DrawnMass)
    rod: DrawnMass = field(default_factory=DrawnMass)


@dataclass(frozen=True, kw_only=True)
class Drawing(Checked):
    """A machine as it is drawn at one position.

    Attributes:
        pins: Place [x, y] of each pin by name, in `units`.
        links: The moving links.
        frame: Names of the fixed pins.
        input: Name of the driven link, which turns about a fixed pin, of a slide, or of a
            cylinder.
        slides: Blocks that slide along straight lines.
        cylinders: Cylinders.
        units: Unit of all lengths of the drawing: 'm', 'cm', 'mm' or 'in'.
    """

    units: str = quantity(
        'choice', 'unit of all lengths of the drawing', choices=UNITS.keys(), default='m'
    )
    input: str = quantity('text', 'driven link, slide or cylinder')
    frame: tuple[str, ...] = quantity('names', 'fixed pins')
    pins: Mapping[str, tuple[float, float]] = named(
        'pair', 'place of the pin [x, y], in units', span=_PLACES
    )
    links: tuple[Any, ...] = groups(DrawnLink, {'': DrawnLink})
    slides: tuple[Any, ...] = groups(DrawnSlide, {'': DrawnSlide})
    cylinders: tuple[Any, ...] = groups(DrawnCylinder, {'': DrawnCylinder})

    def __post_init__(self) -> None:
        super().__post_init__()
        _check(self)

    def mechanism(
        self,
        *,
        gravity: tuple[float, float] = (0.0, -9.81),
        loads: Sequence[AppliedLoad] = (),
        points: Sequence[TracedPoint] = (),
    ) -> Mechanism:
        """Returns the mechanism that the drawing shows.

        Args:
            gravity: Acceleration of gravity [x, y], m/s^2.
            loads: Loads; their places `at` and `to_at` are as drawn, in the drawing's units.
            points: Traced points besides the pins of one link alone; their places are as drawn.

        Raises:
            ConfigurationError: The drawing shows no mechanism that consists of a loop and dyads.
        """
        return _Conversion(self).mechanism(gravity, loads, points)


@dataclass(frozen=True, kw_only=True)
class DrawnMechanism(Checked):
    """A mechanism given by its drawing, as in a parameter file with `mechanism: drawing`.

    Attributes:
        drawing: The drawing.
        gravity: Acceleration of gravity [x, y], m/s^2.
        loads: Loads; their places are as drawn.
        points: Traced points besides the pins of one link alone; their places are as drawn.
    """

    drawing: Drawing
    gravity: tuple[float, float] = gravity_quantity()
    loads: tuple[Any, ...] = loads_field()
    points: tuple[Any, ...] = points_field()

    def converted(self) -> Mechanism:
        """Returns the mechanism; see `Drawing.mechanism`."""
        return self.drawing.mechanism(gravity=self.gravity, loads=self.loads, points=self.points)

    @classmethod
    def drives(cls, values: Mapping[str, object]) -> tuple[tuple[str, ...], str]:
        """See `Mechanism.drives`."""
        driven = str(values.get('drawing.input'))
        for group in ('slides', 'cylinders'):
            if any(name.startswith(f'drawing.{group}.{driven}.') for name in values):
                return ('torque', 'motion', 'follow'), (
                    f'because {driven} slides, so that it has no rpm; leave rpm out'
                )
        return (), ''

    @classmethod
    def unused(cls, _values: Mapping[str, object]) -> dict[str, str]:
        """See `Mechanism.unused`."""
        return {}


# ---------------------------------------------------------------- exact numbers


class Exact(NamedTuple):
    """A place or a vector, m, as the decimals that print its coordinates."""

    x: Fraction
    y: Fraction

    @classmethod
    def of(cls, pair: Sequence[float], unit: Fraction = Fraction(1)) -> 'Exact':
        """Returns a place, given its coordinates and their unit, m."""
        x, y = (Fraction(repr(float(value))) * unit for value in pair)
        return cls(x, y)

    def minus(self, other: 'Exact') -> 'Exact':
        """Returns the vector from another place to this one."""
        return Exact(self.x - other.x, self.y - other.y)

    def plus(self, other: 'Exact', times: Fraction = Fraction(1)) -> 'Exact':
        """Returns this place, moved by a multiple of a vector."""
        return Exact(self.x + other.x * times, self.y + other.y * times)

    def dot(self, other: 'Exact') -> Fraction:
        """Returns the scalar product."""
        return self.x * other.x + self.y * other.y

    def cross(self, other: 'Exact') -> Fraction:
        """Returns the cross product, positive if the other vector is to the left."""
        return self.x * other.y - self.y * other.x

    def foot(self, start: 'Exact', way: 'Exact') -> 'Exact':
        """Returns the foot of the perpendicular from this place to a line."""
        return start.plus(way, self.minus(start).dot(way) / way.dot(way))

    @property
    def angle(self) -> float:
        """Direction of the vector, rad in (-pi, pi]."""
        return math.atan2(float(self.y), float(self.x))

    @property
    def length(self) -> float:
        """Length of the vector, rounded once."""
        return _over_root(self.dot(self), self.dot(self))

    @property
    def rounded(self) -> tuple[float, float]:
        """The coordinates as floats."""
        return float(self.x), float(self.y)


def _over_root(value: Fraction, square: Fraction) -> float:
    """Divides a value by the root of a square, and rounds once."""
    quotient = value * value / square
    with decimal.localcontext(_DIGITS):
        root = (decimal.Decimal(quotient.numerator) / quotient.denominator).sqrt()
    return math.copysign(float(root), value)


# ---------------------------------------------------------------- checks


def _check(drawing: Drawing) -> None:
    """Rejects names and values with a mistake, all at once.

    Raises:
        ConfigurationError: There is one or more; the message has all.
    """
    mistakes = Mistakes()
    for problem in (
        *_bad_names(drawing),
        *_bad_input(drawing),
        *_bad_lists(drawing),
        *_bad_pins(drawing),
        *_bad_slides(drawing),
        *_bad_centers(drawing),
    ):
        with mistakes:
            raise ConfigurationError(problem)
    mistakes.check()


def _parts(drawing: Drawing) -> Iterator[tuple[str, Any, tuple[str, ...]]]:
    """Yields each part of the drawing with its parameter's name and its pins."""
    for link in drawing.links:
        yield f'drawing.links.{link.name}', link, link.pins
    for slide in drawing.slides:
        yield f'drawing.slides.{slide.name}', slide, _pins_of_slide(slide)
    for cylinder in drawing.cylinders:
        yield f'drawing.cylinders.{cylinder.name}', cylinder, (cylinder.from_, cylinder.to)


def _pins_of_slide(slide: DrawnSlide) -> tuple[str, ...]:
    return slide.pins or ((slide.pin,) if slide.pin else ())


def _bad_names(drawing: Drawing) -> Iterator[str]:
    seen = dict[str, str]()
    names = [(f'drawing.pins.{name}', name) for name in drawing.pins]
    parts = [(label, part.name) for label, part, _ in _parts(drawing)]
    for label, name in (*names, *parts):
        if name.lower() in _BOOLEANS:
            yield f'{label}: ROS reads {name} as a boolean; choose another name'
        elif name in _RESERVED or not re.fullmatch(_NAME, name):
            yield (
                f'{label}: a name must be letters, digits and single underscores, begin with a '
                f'letter, and be none of {", ".join(sorted(_RESERVED))}'
            )
    for label, name in parts:
        if name in seen:
            yield f'{label} has the name of {seen[name]}: rename one'
        seen[name] = label


def _bad_input(drawing: Drawing) -> Iterator[str]:
    parts = [part.name for _, part, _ in _parts(drawing)]
    if drawing.input not in parts:
        yield f'drawing.input = {shown(drawing.input)}: must be one of {_listed(parts)}'


def _bad_lists(drawing: Drawing) -> Iterator[str]:
    """Yields the mistakes in the lists of pins."""
    lists = {'drawing.frame': drawing.frame}
    lists |= {label: pins for label, _, pins in _parts(drawing)}
    for label, pins in lists.items():
        if len({*pins}) < len(pins):
            yield f'{label} names one pin twice: {", ".join(pins)}'
        for pin in pins:
            if pin not in drawing.pins:
                known = _listed(drawing.pins)
                yield f'{label}: no pin {shown(pin)} in drawing.pins, which has {known}'
    for label, part, pins in _parts(drawing):
        if isinstance(part, DrawnLink) and len(pins) < 2:
            yield f'{label}.pins = {list(pins)}: a link needs two pins or more'


def _bad_pins(drawing: Drawing) -> Iterator[str]:
    """Yields the mistakes in the pins themselves."""
    used = {*drawing.frame, *(pin for _, _, pins in _parts(drawing) for pin in pins)}
    for pin in sorted({*drawing.pins} - used):
        yield (
            f'drawing.pins.{pin}: neither the frame nor a link has this pin; add it to one, or '
            'leave it out'
        )
    places = dict[Exact, str]()
    for pin, pair in drawing.pins.items():
        other = places.setdefault(Exact.of(pair), pin)
        if other != pin:
            yield (
                f'drawing.pins.{pin} is at the same place as {other}: write one pin that all '
                'their links share, or draw the machine at another position'
            )


def _bad_slides(drawing: Drawing) -> Iterator[str]:
    bodies = [part.name for part in (*drawing.links, *drawing.slides)]
    for slide in drawing.slides:
        label = f'drawing.slides.{slide.name}'
        if bool(slide.pin) == bool(slide.pins):
            yield f'{label}: give pin, or pins for several'
        if slide.direction == (0.0, 0.0):
            yield f'{label}.direction = [0, 0]: must be a direction, such as [1.0, 0.0]'
        if slide.on != FRAME and (slide.on not in bodies or slide.on == slide.name):
            others = [name for name in bodies if name != slide.name]
            yield f'{label}.on = {shown(slide.on)}: must be one of {_listed([FRAME, *others])}'


def _bad_centers(drawing: Drawing) -> Iterator[str]:
    known = {name: Exact.of(place) for name, place in drawing.pins.items()}
    for label, part, pins in _parts(drawing):
        own: dict[str, tuple[Any, tuple[str, ...]]] = {label: (part, pins)}
        if isinstance(part, DrawnCylinder):
            own = {
                f'{label}.barrel': (part.barrel, (part.from_,)),
                f'{label}.rod': (part.rod, (part.to,)),
            }
        for name, (body, its_pins) in own.items():
            if isinstance(body, DrawnSlide) and body.on == FRAME:
                if body.center is not None:
                    yield f'{name}.center: on the frame it is the pin; leave it out'
                continue
            if body.mass and body.center is None and {*its_pins} <= {*known}:
                places = [drawing.pins[pin] for pin in its_pins]
                x, y = (math.fsum(row) / len(row) for row in zip(*places, strict=True))
                yield (
                    f'{name} has a mass and no center: the middle of its pins is '
                    f'center: [{x:.6g}, {y:.6g}]'
                )


def _listed(names: Iterable[str]) -> str:
    return ', '.join(sorted(names)) or 'none'


# ---------------------------------------------------------------- conversion


class _Body(NamedTuple):
    """A moving body of a drawing.

    Attributes:
        name: Name of the body.
        pins: Names of its pins.
        part: Its mass, and its length if that is given.
        on: Body with the line on which it slides, or 'frame'; empty for a link.
        way: Direction of the line as drawn.
    """

    name: str
    pins: tuple[str, ...]
    part: Any
    on: str = ''
    way: Exact = Exact(Fraction(1), Fraction(0))


class _Base(NamedTuple):
    """A loop that may become the mechanism.

    Attributes:
        kind: Class of the mechanism.
        bodies: Crank, coupler and rocker or slider; or crank, barrel and rod.
        pins: Pins A0 and A, then B and, of a rocker, B0; or B0 of a barrel.
    """

    kind: type[Mechanism]
    bodies: tuple[_Body, ...]
    pins: tuple[str, ...]


class _Axes(NamedTuple):
    """The axes of a body in the drawing.

    Attributes:
        start: Origin of the axes, where the body is carried.
        way: Direction of the first axis.
        end: Pin on the first axis, at the body's length; empty if there is none.
        length: This length, m.
    """

    start: Exact
    way: Exact
    end: str = ''
    length: float = 0.0


class _Conversion:
    """The conversion of a drawing.

    Attributes:
        at: Place of each pin, from the crank's fixed pin.
        axes: Axes of each body whose motion is known, in the order of solution.
    """

    def __init__(self, drawing: Drawing) -> None:
        """Collects the bodies."""
        self.drawing, self.unit = drawing, UNITS[drawing.units]
        self.at = {name: Exact.of(place, self.unit) for name, place in drawing.pins.items()}
        self.bodies = {link.name: _Body(link.name, link.pins, link) for link in drawing.links}
        for slide in drawing.slides:
            self.bodies[slide.name] = _Body(
                slide.name, _pins_of_slide(slide), slide, slide.on, Exact.of(slide.direction)
            )
        for cylinder in drawing.cylinders:
            if cylinder.name == drawing.input:
                barrel, rod = f'{cylinder.name}_barrel', f'{cylinder.name}_rod'
                way = self.at[cylinder.to].minus(self.at[cylinder.from_])
                self.bodies[barrel] = _Body(barrel, (cylinder.from_,), cylinder.barrel)
                self.bodies[rod] = _Body(rod, (cylinder.to,), cylinder.rod, barrel, way)
        self.axes: dict[str, _Axes] = {}

    def mechanism(self, gravity: Any, loads: Sequence[Any], points: Sequence[Any]) -> Mechanism:
        """Returns the mechanism; see `Drawing.mechanism`.

        Raises:
            ConfigurationError: Links are left that are no dyads.
        """
        base = self.base()
        origin = self.at[base.pins[0]]
        self.at = {name: place.minus(origin) for name, place in self.at.items()}
        mechanism = self.loop(base)
        waiting = {name: body for name, body in self.bodies.items() if name not in self.axes}
        dyads = []
        while waiting:
            found = self.next_dyad(waiting)
            if found is None:
                raise ConfigurationError(self.unsolved(waiting))
            dyads.append(found)
            waiting = {name: body for name, body in waiting.items() if name not in self.axes}
        changes = {
            'dyads': tuple(dyads),
            'loads': tuple(self.as_solved(load) for load in loads),
            'points': (*self.points(), *(self.as_solved(point) for point in points)),
            'gravity': gravity,
        }
        return cast('Mechanism', replace(cast('Any', mechanism), **changes))

    # ------------------------------------------------------------ the loop

    def base(self) -> _Base:
        """Chooses the loop that becomes the mechanism.

        Raises:
            ConfigurationError: The input is in no loop that can.
        """
        name = self.drawing.input
        if any(cylinder.name == name for cylinder in self.drawing.cylinders):
            name = f'{name}_rod'
        driven = self.bodies[name]
        found = [*(self.driven_slides(driven) if driven.on else self.driven_turns(driven))]
        if not found:
            raise ConfigurationError(self.no_base(driven))
        if len(found) > 1:
            found.sort(key=lambda base: self.preference(driven, base))
        return found[0]

    def driven_turns(self, crank: _Body) -> Iterator[_Base]:
        """Yields the loops of a crank."""
        fixed = [pin for pin in crank.pins if pin in self.drawing.frame]
        if len(fixed) != 1:
            return
        (A0,) = fixed
        for A in crank.pins:
            for coupler in self.at_pin(A, crank) if A != A0 else ():
                yield from self.loops_of(crank, coupler, A0, A)

    def loops_of(self, crank: _Body, coupler: _Body, A0: str, A: str) -> Iterator[_Base]:
        """Yields the loops of a crank and a body that is pinned to it at A."""
        sliding = (
            [(coupler.on, coupler)]
            if coupler.on
            else [
                (block.name, coupler) for block in self.bodies.values() if block.on == coupler.name
            ]
        )
        for name, rod in sliding:
            if name in self.bodies:
                barrel = self.bodies[name]
                for B0 in self.pivots(barrel, A0):
                    yield _Base(InvertedSliderCrank, (crank, barrel, rod), (A0, A, B0))
        if not coupler.on:
            yield from self.closed_by_pin(crank, coupler, A0, A)

    def closed_by_pin(self, crank: _Body, coupler: _Body, A0: str, A: str) -> Iterator[_Base]:
        """Yields the loops of a crank and a coupler with a third body, which are pinned at B."""
        for B in coupler.pins:
            for last in self.at_pin(B, crank, coupler) if B != A else ():
                if last.on == FRAME:
                    yield _Base(SliderCrank, (crank, coupler, last), (A0, A, B))
                elif not last.on:
                    for B0 in self.pivots(last, A0):
                        yield _Base(FourBar, (crank, coupler, last), (A0, A, B, B0))

    def driven_slides(self, driven: _Body) -> Iterator[_Base]:
        """Yields the loops of a driven slide or cylinder."""
        if driven.on == FRAME:
            for B in driven.pins:
                for coupler in self.at_pin(B, driven):
                    for crank, A0, A in self.cranks(coupler, B, driven):
                        yield _Base(SliderCrank, (crank, coupler, driven), (A0, A, B))
            return
        guide = self.bodies[driven.on]
        for barrel, rod in ((guide, driven), (driven, guide)):
            for B0 in self.pivots(barrel):
                for crank, A0, A in self.cranks(rod, B0, barrel):
                    yield _Base(InvertedSliderCrank, (crank, barrel, rod), (A0, A, B0))

    def cranks(self, coupler: _Body, pin: str, *others: _Body) -> Iterator[tuple[_Body, str, str]]:
        """Yields the cranks that are pinned to a body at another pin, with their pins A0 and A."""
        for A in coupler.pins:
            for crank in self.at_pin(A, coupler, *others) if pin != A else ():
                for A0 in self.pivots(crank, pin) if not crank.on else ():
                    yield crank, A0, A

    def at_pin(self, pin: str, *others: _Body) -> list[_Body]:
        """Returns the bodies at a pin that is not fixed, without the given ones."""
        if pin in self.drawing.frame:
            return []
        return [body for body in self.bodies.values() if pin in body.pins and body not in others]

    def pivots(self, body: _Body, *others: str) -> list[str]:
        """Returns the fixed pins of a body, without the given ones."""
        return [pin for pin in body.pins if pin in self.drawing.frame and pin not in others]

    def preference(self, driven: _Body, base: _Base) -> tuple[Any, ...]:
        """Returns the key by which the loops are sorted, the best first."""
        has_change_point = False
        if base.kind is not InvertedSliderCrank:
            trial = _Conversion(self.drawing)
            origin = trial.at[base.pins[0]]
            trial.at = {name: place.minus(origin) for name, place in trial.at.items()}
            try:
                reach = trial.loop(base).reach()
            except (ConfigurationError, MechanismError):
                reach = None
            has_change_point = reach is not None and reach.has_change_point
        near = base.pins[1] if not driven.on else base.pins[2]
        names = [body.name for body in base.bodies]
        return (
            base.kind is not InvertedSliderCrank,
            not has_change_point,
            driven.pins.index(near) if near in driven.pins else 0,
            *names[1:],
            *base.pins,
        )

    def loop(self, base: _Base) -> Mechanism:
        """Returns the mechanism of a loop, in the assembly that is drawn."""
        A0, A, *rest = base.pins
        crank, second, third = base.bodies
        names = {'A0': A0, 'A': A}
        self.turn(crank, A0, A)
        if base.kind is FourBar:
            B, B0 = rest
            self.turn(second, A, B)
            self.turn(third, B0, B)
            names |= {'B': B, 'B0': B0}
            parts = {
                'coupler': self.body(second, Coupler), 'rocker': self.body(third),
                'frame': Frame(self.at[B0].length, self.at[B0].angle),
            }  # fmt: skip
            position, closing = self.at[A].angle, (A, B)
        elif base.kind is SliderCrank:
            (B,) = rest
            self.turn(second, A, B)
            way = third.way
            self.axes[third.name] = _Axes(self.at[B], way)
            names |= {'B': B}
            parts = {
                'coupler': self.body(second, Coupler),
                'slider': Slider(_over_root(way.cross(self.at[B]), way.dot(way)), third.part.mass),
                'frame': Guide(way.angle),
            }
            position, closing = self.at[A].angle, (A, B)
            if self.drawing.input == third.name:
                parts['input'] = 'slider'
                position = _over_root(way.dot(self.at[B]), way.dot(way))
        else:
            (B0,) = rest
            arm, way = self.at[A].minus(self.at[B0]), (second.way if second.on else third.way)
            if arm.dot(way) < 0:
                way = Exact(-way.x, -way.y)
            self.axes[second.name] = _Axes(self.at[B0], way)
            self.axes[third.name] = _Axes(self.at[A], way)
            names |= {'B0': B0, 'E': f'{second.name}_mouth'}
            parts = {
                'barrel': self.mass(second, Barrel), 'rod': self.mass(third, Rod),
                'frame': Frame(self.at[B0].length, self.at[B0].angle),
                'offset': _over_root(way.cross(arm), way.dot(way)),
            }  # fmt: skip
            position, closing = self.at[A].angle, (A, B0)
            if self.drawing.input != crank.name:
                parts['input'] = CYLINDER
                position = _over_root(way.dot(arm), way.dot(way))
        drawn = Drawn(
            tuple(body.name for body in base.bodies), tuple(names.items()), self.at[A].angle,
            position,
        )  # fmt: skip
        kind = cast('Any', base.kind)
        return self.in_assembly(kind, closing, crank=self.body(crank), drawn=drawn, **parts)

    def in_assembly(self, kind: Any, pins: tuple[str, ...], **parts: Any) -> Mechanism:
        """Returns the mechanism in the assembly whose links are nearest to the drawn ones.

        Raises:
            ConfigurationError: The drawing does not tell the assembly.
        """
        found = list[tuple[float, Any]]()
        position = parts['drawn'].position
        names = parts['drawn'].links
        for assembly in (OPEN, CROSSED):
            if kind is InvertedSliderCrank and 'input' not in parts and assembly != OPEN:
                continue
            mechanism = kind(assembly=assembly, **parts)
            try:
                pose = mechanism.loop().pose((position,))
            except UnreachableError:
                continue
            off = 0.0
            for name, link in zip(names, pose.links, strict=True):
                way, axis = link.direction, self.axes[name].way
                off += abs(complex(way.x, way.y) - complex(*axis.rounded) / axis.length)
            (sine,) = pose.sines
            if abs(sine) > _LEAST_SINE:
                found.append((off, mechanism))
        if not found:
            raise ConfigurationError(
                f'the links that meet at {pins[-1]} are in line as drawn, or do not reach it, so '
                f'that the drawing does not tell their assembly: {", ".join(names)}; draw the '
                'machine at another position'
            )
        return cast('Mechanism', min(found, key=lambda pair: pair[0])[1])

    # ------------------------------------------------------------ dyads

    def next_dyad(self, waiting: Mapping[str, _Body]) -> Dyad | None:
        """Returns the dyad with the first name that known bodies hold, and notes its axes.

        Raises:
            ConfigurationError: Known bodies hold a body fast.
        """
        ready = list[tuple[str, Any]]()
        for name, body in waiting.items():
            held = [pin for pin in body.pins if self.carrier(pin)]
            if len(held) > 1 or (held and body.on and self.is_known(body.on)):
                raise ConfigurationError(self.rigid(body, held))
            for other in waiting.values():
                if other.name != name:
                    ready += self.pairs(body, other, held)
        if not ready:
            return None
        (_, make), *_ = sorted(ready, key=lambda pair: pair[0])
        return cast('Dyad', make())

    def pairs(self, first: _Body, last: _Body, held: list[str]) -> Iterator[tuple[str, Any]]:
        """Yields the name of the dyad of two bodies, if it is one, and a function to make it.

        Raises:
            ConfigurationError: Two pins join the bodies to one.
        """
        common = [pin for pin in first.pins if pin in last.pins and not self.carrier(pin)]
        if not first.on and not last.on and len(common) > 1:
            raise ConfigurationError(
                f'{first.name} and {last.name} share the pins {" and ".join(common)}, so that '
                'they are one rigid link: give both as one link, or leave out a pin'
            )
        name = f'{first.name}__{last.name}'
        ends = [pin for pin in last.pins if self.carrier(pin)]
        if len(held) != 1 or first.on:
            return
        (start,) = held
        if last.on == first.name and len(ends) == 1:
            yield name, lambda: self.with_rod(name, first, last, ends[0], start)
        elif len(common) == 1 and last.on and not ends and self.is_known(last.on):
            yield name, lambda: self.with_slider(name, first, last, start, common[0])
        elif len(common) == len(ends) == 1 and not last.on and first.name < last.name:
            pins = start, common[0], ends[0]
            yield name, lambda: self.with_two_links(name, (first, last), pins)

    def with_two_links(
        self, name: str, links: tuple[_Body, _Body], pins: tuple[str, str, str]
    ) -> Dyad:
        """Returns a dyad of two links."""
        (first, last), (start, joint, end) = links, pins
        joints = (self.joint(start, first), joint, self.joint(end, last))
        from_, to = self.carrier(start), self.carrier(end)
        from_at, to_at = self.local(from_, start), self.local(to, end)
        self.turn(first, start, joint)
        self.turn(last, end, joint)
        apart, near = self.at[end].minus(self.at[start]), self.at[joint].minus(self.at[start])
        far = self.at[joint].minus(self.at[end])
        self.require_side(near.cross(far), near, far, (first, last), joint)
        return Dyad(
            name=name, from_=from_, from_at=from_at, to=to, to_at=to_at,
            first=self.body(first), second=self.body(last),
            assembly=OPEN if apart.cross(near) > 0 else CROSSED,
            names=(first.name, last.name, *joints),
        )  # fmt: skip

    def with_slider(self, name: str, first: _Body, last: _Body, start: str, joint: str) -> Dyad:
        """Returns a dyad of a link and a slide on a known body."""
        joints = (self.joint(start, first), joint)
        from_, from_at = self.carrier(start), self.local(self.carrier(start), start)
        self.turn(first, start, joint)
        guide, way, line = self.axes.get(last.on), last.way, self.at[last.pins[0]]
        origin = Exact(Fraction(0), Fraction(0)) if guide is None else guide.start
        if guide is not None and line.minus(origin).dot(way) < 0:
            way = Exact(-way.x, -way.y)
        near = self.at[joint].minus(self.at[start])
        self.require_side(near.dot(way), near, way, (first, last), joint)
        zero = origin.foot(line, way).plus(self.at[joint].minus(line))
        self.axes[last.name] = _Axes(self.at[joint], way)
        at, angle = zero.rounded, way.angle
        inertia, center = 0.0, (0.0, 0.0)
        if guide is not None:
            at = self.in_axes(guide, zero)
            angle = math.atan2(float(guide.way.cross(way)), float(guide.way.dot(way)))
            inertia, center = last.part.inertia, self.center(last)
        return Dyad(
            name=name, from_=from_, from_at=from_at, first=self.body(first),
            slider=DyadSlider(last.part.mass, at, angle, last.on, inertia, center),
            assembly=OPEN if near.dot(way) > 0 else CROSSED,
            names=(first.name, last.name, *joints),
        )  # fmt: skip

    def with_rod(self, name: str, barrel: _Body, rod: _Body, start: str, end: str) -> Dyad:
        """Returns a dyad of a link that is pinned at its end, and a slide on it."""
        joints = self.joint(start, rod), self.joint(end, barrel)
        from_, to = self.carrier(start), self.carrier(end)
        from_at, to_at = self.local(from_, start), self.local(to, end)
        arm, way = self.at[start].minus(self.at[end]), rod.way
        if arm.dot(way) < 0:
            way = Exact(-way.x, -way.y)
        self.require_side(arm.dot(way), arm, way, (barrel, rod), start)
        self.axes[barrel.name] = _Axes(self.at[end], way)
        self.axes[rod.name] = _Axes(self.at[start], way)
        return Dyad(
            name=name, from_=from_, from_at=from_at, to=to, to_at=to_at,
            barrel=self.mass(barrel, Barrel), rod=self.mass(rod, Rod),
            offset=_over_root(way.cross(arm), way.dot(way)),
            names=(barrel.name, rod.name, *joints),
        )  # fmt: skip

    def require_side(
        self, area: Fraction, first: Exact, last: Exact, bodies: tuple[_Body, _Body], joint: str
    ) -> None:
        """Rejects a dyad whose drawn position does not tell its assembly.

        Raises:
            ConfigurationError: The two links are in line.
        """
        sine = _over_root(area, first.dot(first) * last.dot(last))
        if abs(sine) < _LEAST_SINE_OF_DYAD:
            names = ' and '.join(body.name for body in bodies)
            raise ConfigurationError(
                f'{names} are in line at {joint} as drawn, so that the drawing does not tell '
                'their assembly; draw the machine at another position'
            )

    # ------------------------------------------------------------ bodies and pins

    def is_known(self, body: str) -> bool:
        """Returns whether the motion of a body is known."""
        return body == FRAME or body in self.axes

    def carrier(self, pin: str) -> str:
        """Returns the first known body that has a pin, 'frame' if it is fixed, or ''."""
        if pin in self.drawing.frame:
            return FRAME
        return next((name for name in self.axes if pin in self.bodies[name].pins), '')

    def joint(self, pin: str, body: _Body) -> str:
        """Returns the name of the joint by which a pin carries a further body."""
        carrier = self.carrier(pin)
        others = (name for name in self.axes if pin in self.bodies[name].pins)
        is_first = not [name for name in others if name != carrier]
        return pin if is_first else f'{pin}_{body.name}'

    def turn(self, body: _Body, start: str, end: str) -> None:
        """Notes the axes of a link that is carried at one pin and closes its group at another."""
        way = self.at[end].minus(self.at[start])
        given = getattr(body.part, 'length', None)
        length = way.length if given is None else float(Fraction(repr(given)) * self.unit)
        self.axes[body.name] = _Axes(self.at[start], way, end, length)

    def in_axes(self, axes: _Axes, place: Exact) -> tuple[float, float]:
        """Returns a place [along, across] in the axes of a body, m."""
        apart, way = place.minus(axes.start), axes.way
        square = way.dot(way)
        return _over_root(apart.dot(way), square), _over_root(way.cross(apart), square)

    def local(self, body: str, pin: str) -> tuple[float, float]:
        """Returns a pin [along, across] on a body, m; on the frame in base_link."""
        if body == FRAME:
            return self.at[pin].rounded
        axes = self.axes[body]
        return (axes.length, 0.0) if pin == axes.end else self.in_axes(axes, self.at[pin])

    def center(self, body: _Body) -> tuple[float, float]:
        """Returns the centre of mass [along, across] of a body, m."""
        if body.part.center is None:
            return 0.0, 0.0
        place = Exact.of(body.part.center, self.unit).minus(self.origin_of_all())
        return self.in_axes(self.axes[body.name], place)

    def origin_of_all(self) -> Exact:
        """Returns the place of base_link's origin in the drawing, m."""
        pin = next(iter(self.at))
        return Exact.of(self.drawing.pins[pin], self.unit).minus(self.at[pin])

    def body(self, body: _Body, kind: Any = Body) -> Any:
        """Returns a link as a part of a mechanism."""
        return self.mass(body, kind, length=self.axes[body.name].length)

    def mass(self, body: _Body, kind: Any, **others: Any) -> Any:
        """Returns a body as a part of a mechanism."""
        part = body.part
        return kind(mass=part.mass, inertia=part.inertia, center=self.center(body), **others)

    def points(self) -> Iterator[TracedPoint]:
        """Yields the pins of one link alone, as points of it."""
        for pin in self.at:
            owners = [body.name for body in self.bodies.values() if pin in body.pins]
            if len(owners) == 1 and pin not in self.drawing.frame:
                yield TracedPoint(pin, owners[0], self.local(owners[0], pin))

    def place(self, label: str, body: str, at: tuple[float, float] | None) -> tuple[float, float]:
        """Returns a place [along, across] on a body, m, given as drawn.

        Raises:
            ConfigurationError: There is no such body, or no place.
        """
        if body != FRAME and body not in self.axes:
            names = _listed([*self.axes, FRAME])
            raise ConfigurationError(f'{label} = {shown(body)}: must be one of {names}')
        if at is None:
            raise ConfigurationError(f'{label}: give the place on {body} as drawn, [x, y], or pin')
        place = Exact.of(at, self.unit).minus(self.origin_of_all())
        return place.rounded if body == FRAME else self.in_axes(self.axes[body], place)

    def place_of_pin(self, label: str, pin: str, link: str) -> tuple[str, tuple[float, float]]:
        """Returns a link, or the carrier of a pin, and the place of the pin on it, m.

        Raises:
            ConfigurationError: There is no such pin, or no link has it.
        """
        owners = [name for name in self.axes if pin in self.bodies[name].pins]
        if pin in self.drawing.frame:
            owners.insert(0, FRAME)
        if not owners or link not in {'', *owners}:
            known = _listed(owners) if owners else _listed(self.at)
            what = f'link {shown(link)} at the pin {pin}' if owners else f'pin {shown(pin)}'
            raise ConfigurationError(f'{label}: no {what}; must be one of {known}')
        body = link or owners[0]
        return body, self.local(body, pin)

    def as_solved(self, load: Any) -> Any:
        """Returns a load or a point with its places in the axes of its links, instead of as drawn.

        Raises:
            ConfigurationError: A pin, a link or a cylinder does not exist.
        """
        label = getattr(load, 'label', f'points.{load.name}')
        cylinder, known = getattr(load, 'cylinder', ''), {x.name for x in fields(load)}
        if cylinder:
            given = {x.name: x for x in self.drawing.cylinders if x.name != self.drawing.input}
            if cylinder not in given:
                raise ConfigurationError(
                    f'{label}.cylinder = {shown(cylinder)}: must be one of {_listed(given)}'
                )
            pins = given[cylinder].from_, given[cylinder].to
            if pins[0] in self.drawing.frame:
                pins = pins[1], pins[0]
            load = replace(load, cylinder='', pin=pins[0], to_pin=pins[1], to=FRAME)
        changes: dict[str, Any] = {}
        for link, at, pin in (('link', 'at', 'pin'), ('to', 'to_at', 'to_pin')):
            if not {link, at} <= known:
                continue
            name, place = getattr(load, link), getattr(load, at)
            if given_pin := getattr(load, pin, ''):
                own = '' if link == 'to' and name == FRAME else name
                changes[link], changes[at] = self.place_of_pin(label, given_pin, own)
                changes[pin] = ''
            elif name:
                changes[at] = self.place(f'{label}.{link}', name, place)
        return replace(load, **changes) if changes else load

    # ------------------------------------------------------------ refusals

    def no_base(self, driven: _Body) -> str:
        """Explains why the input is in no loop that can be the mechanism."""
        fixed = self.pivots(driven)
        what = f'drawing.input = {shown(self.drawing.input)}'
        if not driven.on and len(fixed) != 1:
            pins = ' and '.join(fixed) or 'no fixed pin'
            return (
                f'{what}: it must turn about exactly one fixed pin, and has {pins}; correct '
                'drawing.frame, or choose another input'
            )
        return (
            f'{what}: it is in no loop of four links, or of three and a slide, that returns to '
            f'the frame at another pin; {self.freedom()}'
        )

    def rigid(self, body: _Body, held: Sequence[str]) -> str:
        """Explains that known bodies hold a body fast."""
        carriers = ' and '.join(dict.fromkeys(self.carrier(pin) for pin in held))
        also = f' and by its line on {body.on}' if body.on and self.is_known(body.on) else ''
        return (
            f'{body.name} is held at {" and ".join(held)} by {carriers}{also}, whose motion is '
            f'known without it, so that the machine cannot move; {self.freedom()}'
        )

    def unsolved(self, waiting: Mapping[str, _Body]) -> str:
        """Explains which bodies are left."""
        return (
            f'{_listed(waiting)}: no two of these are held by the links before them as a dyad, '
            f'so that they cannot be solved one pair after another; {self.freedom()}'
        )

    def freedom(self) -> str:
        """Counts the degrees of freedom of the drawing."""
        joints = sum(1 for body in self.bodies.values() if body.on)
        for pin in self.at:
            count = sum(pin in body.pins for body in self.bodies.values())
            joints += max(0, count - 1 + (pin in self.drawing.frame))
        free = 3 * len(self.bodies) - 2 * joints
        return (
            f'counted by links and joints the drawing has {free} degree'
            f'{"" if free == 1 else "s"} of freedom'
            f'{"" if free == 1 else ", where 1 is needed"}'
        )
