# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A machine as it is drawn: pins and links, at one position, converted to a mechanism with dyads.

The loop of the input becomes the mechanism; each further pair of links that is held by those
before becomes a dyad. Lengths are those between the pins as drawn, computed from the decimals of
the coordinates and rounded once, so that a drawn parallelogram is one. The assemblies are those of
the drawn position.
"""

import itertools
import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from linkage_ros.errors import ConfigurationError, Mistakes
from linkage_ros.mechanism.base import Mechanism
from linkage_ros.mechanism.drawing_conversion import Conversion, listed
from linkage_ros.mechanism.exact import UNITS, Exact
from linkage_ros.mechanism.loads import loads_field
from linkage_ros.mechanism.loads.base import AppliedLoad
from linkage_ros.mechanism.parts import (
    FRAME_NAME,
    gravity_quantity,
    inertia_quantity,
    mass_quantity,
)
from linkage_ros.mechanism.points import TracedPoint, points_field
from linkage_ros.quantities import BOOLEANS, Checked, groups, named, quantity, required, shown

_NAME = '[A-Za-z](_?[A-Za-z0-9])*_?'  # without two underscores in succession
_RESERVED = {FRAME_NAME, 'world', 'base_link'}
_PLACES = (-1e12, 1e12)
# A pin that is so far from the others, or so near to the origin, is probably in another unit;
# relative to the size of the others.
_FAR, _NEAR = 10.0, 0.01
# A length that differs from the drawn one by more than this share of it is probably a mistake.
_OFF = 0.3


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

    mass: float = mass_quantity()
    inertia: float = inertia_quantity()
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
        length: Distance of the pins of a link of two, instead of the drawn one; None for the drawn
            one.
    """

    name: str = required()
    pins: Sequence[str] = quantity('names', 'pins of the link')
    mass: float = mass_quantity()
    inertia: float = inertia_quantity()
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
    pins: Sequence[str] | None = quantity(
        'names', 'pins of a block with several; the first is on its line', default=None
    )
    on: str = quantity('text', 'link that has the line, or frame', default=FRAME_NAME)
    mass: float = mass_quantity()
    inertia: float = inertia_quantity()
    center: tuple[float, float] | None = _center()

    @property
    def all_pins(self) -> Sequence[str]:
        """The pins of the block, first that on its line."""
        return self.pins or ((self.pin,) if self.pin else ())


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


@dataclass(frozen=True, kw_only=True, repr=False)
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
    frame: Sequence[str] = quantity('names', 'fixed pins')
    pins: Mapping[str, tuple[float, float]] = named(
        'pair', 'place of the pin [x, y], in units', span=_PLACES
    )
    links: Sequence[DrawnLink] = groups(DrawnLink, {'': DrawnLink})
    slides: Sequence[DrawnSlide] = groups(DrawnSlide, {'': DrawnSlide})
    cylinders: Sequence[DrawnCylinder] = groups(DrawnCylinder, {'': DrawnCylinder})

    def __post_init__(self) -> None:
        super().__post_init__()
        _check(self)

    @property
    def lengths(self) -> dict[str, float]:
        """The length of each link that may have one, as given or drawn, in `units`, by name."""
        guides = {slide.on for slide in self.slides}
        return {
            link.name: link.length or math.dist(*(self.pins[pin] for pin in link.pins))
            for link in self.links
            if len(link.pins) == 2 and link.name not in guides
        }

    def __repr__(self) -> str:
        parts: dict[str, Sequence[Any]] = {
            'links': self.links,
            'slides': self.slides,
            'cylinders': self.cylinders,
        }
        named = (
            f'{word} {", ".join(part.name for part in found)}'
            for word, found in parts.items()
            if found
        )
        return f'<Drawing (input {self.input}): {"; ".join(named)}>'

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
        return Conversion(self).mechanism(gravity, loads, points)


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
    loads: Sequence[AppliedLoad] = loads_field()
    points: Sequence[TracedPoint] = points_field()

    def converted(self) -> Mechanism:
        """Returns the mechanism; see `Drawing.mechanism`.

        Raises:
            ConfigurationError: There is none; the message has the `contradictions`, too.
        """
        with self.suspicion():
            return self.drawing.mechanism(
                gravity=self.gravity, loads=self.loads, points=self.points
            )

    @contextmanager
    def suspicion(self) -> Iterator[None]:
        """Adds to an error its probable cause: the values that contradict the drawing.

        Raises:
            ConfigurationError: The error.
        """
        try:
            yield
        except ConfigurationError as error:
            if not (strange := contradictions(self.drawing)):
                raise
            raise ConfigurationError('; '.join([*strange, str(error)])) from error

    @classmethod
    def drives(cls, values: Mapping[str, object]) -> tuple[tuple[str, ...], str]:
        """See `Mechanism.drives`."""
        driven = str(values.get('drawing.input'))
        if any(name.startswith(f'drawing.links.{driven}.') for name in values):
            return (), ''  # a slide with the name of a link is refused later
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


def contradictions(drawing: Drawing) -> list[str]:
    """Returns a line for each pin in another unit, and for each length unlike the drawn one."""
    found = _pins_in_another_unit(drawing)
    for link in drawing.links:
        if link.length is None or len(link.pins) != 2:
            continue
        one, other = link.pins
        apart = math.dist(drawing.pins[one], drawing.pins[other])
        if abs(link.length - apart) > _OFF * apart:
            found.append(
                f'drawing.links.{link.name}.length = {link.length:g}, but {one} and {other} are '
                f'drawn {apart:.6g} {drawing.units} apart: correct it, or draw them so'
            )
    return found


def _pins_in_another_unit(drawing: Drawing) -> list[str]:
    """Returns a line for each pin that is among the others only if it is in m, or else in mm.

    If there are many, they may be right, and another pin wrong; none is returned then.
    """
    unit, metre = drawing.units, float(UNITS[drawing.units])
    if unit == 'in':  # too near to m: by chance, a right pin may be among the others, too
        return []
    other, factor = ('mm', float(UNITS['mm'])) if unit == 'm' else ('m', 1 / metre)
    found = []
    for name, place in drawing.pins.items():
        rest = [x for pin, x in drawing.pins.items() if pin != name]
        low, high = ([end(column) for column in zip(*rest, strict=True)] for end in (min, max))
        size, meant = math.dist(low, high), [factor * x for x in place]
        is_alone = _outside(place, low, high) > _FAR * size
        is_at_origin = factor > 1 and 0 < max(map(abs, place)) < _NEAR * size
        if (is_alone or is_at_origin) and _outside(meant, low, high) < 0.5 * size:
            found.append(
                f'drawing.pins.{name} = [{place[0]:g}, {place[1]:g}] {unit}; did you mean {other} '
                f'= [{meant[0]:.6g}, {meant[1]:.6g}] {unit}?'
            )
    return found if len(found) <= max(1, len(drawing.pins) // 3) else []


def _outside(place: Sequence[float], low: Sequence[float], high: Sequence[float]) -> float:
    """Returns by how much a place is outside a box."""
    return max(max(x - z, y - x, 0.0) for x, y, z in zip(place, low, high, strict=True))


# ---------------------------------------------------------------- checks


def _check(drawing: Drawing) -> None:
    """Rejects names and values with a mistake, all at once.

    Raises:
        ConfigurationError: There is one or more; the message has all.
    """
    checks = (
        (
            _bad_names,
            _bad_input,
            _bad_lists,
            _bad_lengths,
            _bad_pins,
            _bad_slides,
            _bad_cylinders,
            _bad_centers,
        ),
        (_rigid_pairs, _loose_parts),  # a misspelt pin would leave others loose
    )
    for each in checks:
        mistakes = Mistakes()
        for problem in (problem for find in each for problem in find(drawing)):
            with mistakes:
                raise ConfigurationError(problem)
        mistakes.check()


def _parts(drawing: Drawing) -> Iterator[tuple[str, Any, Sequence[str]]]:
    """Yields each part of the drawing with its parameter's name and its pins."""
    for link in drawing.links:
        yield f'drawing.links.{link.name}', link, link.pins
    for slide in drawing.slides:
        yield f'drawing.slides.{slide.name}', slide, slide.all_pins
    for cylinder in drawing.cylinders:
        yield f'drawing.cylinders.{cylinder.name}', cylinder, (cylinder.from_, cylinder.to)


def _bad_names(drawing: Drawing) -> Iterator[str]:
    seen = dict[str, str]()
    names = [(f'drawing.pins.{name}', name) for name in drawing.pins]
    parts = [(label, part.name) for label, part, _ in _parts(drawing)]
    for label, name in (*names, *parts):
        if name.lower() in BOOLEANS:
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
        yield f'drawing.input = {shown(drawing.input)}: must be one of {listed(parts)}'


def _bad_lists(drawing: Drawing) -> Iterator[str]:
    """Yields the mistakes in the lists of pins."""
    lists = {'drawing.frame': drawing.frame}
    lists |= {label: pins for label, _, pins in _parts(drawing)}
    for label, pins in lists.items():
        if len({*pins}) < len(pins):
            yield f'{label} names one pin twice: {", ".join(pins)}; leave one out'
        for pin in pins:
            if pin not in drawing.pins:
                known = listed(drawing.pins)
                yield f'{label}: no pin {shown(pin)} in drawing.pins, which has {known}'
    guides = {slide.on for slide in drawing.slides}
    for label, part, pins in _parts(drawing):
        if isinstance(part, DrawnLink) and len(pins) + (part.name in guides) < 2:
            yield f'{label}.pins = {list(pins)}: a link needs two pins or more'


def _bad_lengths(drawing: Drawing) -> Iterator[str]:
    guides = {slide.on: slide.name for slide in drawing.slides}
    for link in drawing.links:
        why = f'it has {len(link.pins)} pins' if len(link.pins) != 2 else ''
        if link.name in guides:
            why = f'{guides[link.name]} slides on it'
        if link.length is not None and why:
            yield (
                f'drawing.links.{link.name}.length is for a link of two pins without a slide on '
                f'it, but {why}: leave it out, and draw its pins where they are'
            )


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
    bodies = [*(link.name for link in drawing.links), *(slide.name for slide in drawing.slides)]
    for slide in drawing.slides:
        label = f'drawing.slides.{slide.name}'
        if bool(slide.pin) == bool(slide.pins):
            yield f'{label}: give pin, or pins for several'
        if slide.direction == (0.0, 0.0):
            yield f'{label}.direction = [0, 0]: must be a direction, such as [1.0, 0.0]'
        if slide.on != FRAME_NAME and (slide.on not in bodies or slide.on == slide.name):
            others = [name for name in bodies if name != slide.name]
            yield f'{label}.on = {shown(slide.on)}: must be one of {listed([FRAME_NAME, *others])}'
        for pin in {*slide.all_pins} & {*drawing.frame} if slide.on == FRAME_NAME else ():
            yield f'{label} has the fixed pin {pin}: take {pin} out of drawing.frame'


def _bad_cylinders(drawing: Drawing) -> Iterator[str]:
    for cylinder in drawing.cylinders:
        masses = {'barrel': cylinder.barrel, 'rod': cylinder.rod}
        heavy = [name for name, part in masses.items() if part.mass or part.inertia]
        if heavy and cylinder.name != drawing.input:
            yield (
                f'drawing.cylinders.{cylinder.name}.{" and ".join(heavy)}: only the input has a '
                'barrel and a rod with masses; leave them out, or draw a link, and a slide on it'
            )


def _rigid_pairs(drawing: Drawing) -> Iterator[str]:
    """Yields a message for each link on two fixed pins, and for each two links that share two."""
    for link in drawing.links:
        fixed = [pin for pin in link.pins if pin in drawing.frame]
        if len(fixed) > 1:
            yield (
                f'drawing.links.{link.name} has {" and ".join(fixed)} of drawing.frame, so that '
                'it cannot move: correct its pins or drawing.frame, or leave it out'
            )
    for one, other in itertools.combinations(drawing.links, 2):
        common = [pin for pin in one.pins if pin in other.pins]
        if len(common) > 1:
            yield (
                f'{one.name} and {other.name} share the pins {" and ".join(common)}, so that '
                'they are one rigid link: give both as one link, or leave out a pin'
            )


def _loose_parts(drawing: Drawing) -> Iterator[str]:
    """Yields a message for each link or slide that fewer than two joints hold."""
    moving = [
        (label, part, pins)
        for label, part, pins in _parts(drawing)
        if not isinstance(part, DrawnCylinder) or part.name == drawing.input
    ]
    counts = Counter([*drawing.frame, *(pin for _, _, pins in moving for pin in pins)])
    for label, part, pins in moving:
        if isinstance(part, DrawnCylinder):
            continue
        joined = [pin for pin in pins if counts[pin] > 1]
        single = [pin for pin in pins if pin not in joined]
        joints = len(joined) + isinstance(part, DrawnSlide)
        joints += sum(slide.on == part.name for slide in drawing.slides)
        if joints < 2:
            held = 'by its line alone' if isinstance(part, DrawnSlide) else 'nowhere'
            held = f'at {joined[0]} alone' if joined else held
            yield (
                f'{label} is joined to the others {held}: no other link has its '
                f'{" or ".join(single)}; add {"it" if len(single) == 1 else "one"} to another '
                'link or to drawing.frame, or leave this one out'
            )


def _bad_centers(drawing: Drawing) -> Iterator[str]:
    known = {name: Exact.of(place) for name, place in drawing.pins.items()}
    bodies = {FRAME_NAME, *(part.name for _, part, _ in _parts(drawing))}
    for label, part, pins in _parts(drawing):
        own: dict[str, tuple[Any, Sequence[str]]] = {label: (part, pins)}
        if isinstance(part, DrawnCylinder):
            own = {
                f'{label}.barrel': (part.barrel, (part.from_,)),
                f'{label}.rod': (part.rod, (part.to,)),
            }
        for name, (body, its_pins) in own.items():
            if isinstance(body, DrawnSlide) and body.on not in bodies - {body.name}:
                continue  # refused elsewhere
            if isinstance(body, DrawnSlide) and body.on == FRAME_NAME:
                if body.center is not None:
                    yield f'{name}.center: on the frame it is the pin; leave it out'
                continue
            if body.mass and body.center is None and {*its_pins} <= {*known}:
                places = [drawing.pins[pin] for pin in its_pins]
                middle = [math.fsum(row) / len(row) for row in zip(*places, strict=True)]
                yield (
                    f'{name} has a mass and no center: give it; the middle of its pins is '
                    f'center: {[float(f"{x:.6g}") for x in middle]}'
                )
