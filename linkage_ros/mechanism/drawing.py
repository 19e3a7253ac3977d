# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A machine as it is drawn: pins and links, at one position, converted to a mechanism with dyads.

The loop of the input becomes the mechanism; each further pair of links that is held by those
before becomes a dyad. Lengths are those between the pins as drawn, computed from the decimals of
the coordinates and rounded once, so that a drawn parallelogram is one. The assemblies are those of
the drawn position.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from linkage_ros.errors import ConfigurationError, Mistakes
from linkage_ros.mechanism.base import Mechanism
from linkage_ros.mechanism.drawing_checks import contradictions, mistakes_of, mistakes_of_places
from linkage_ros.mechanism.drawing_conversion import Conversion
from linkage_ros.mechanism.exact import UNITS
from linkage_ros.mechanism.loads import loads_field
from linkage_ros.mechanism.loads.base import AppliedLoad
from linkage_ros.mechanism.parts import (
    FRAME_NAME,
    TracedPoint,
    gravity_quantity,
    inertia_quantity,
    mass_quantity,
    points_field,
)
from linkage_ros.quantities import Checked, groups, named, quantity, required

_PLACES = (-1e12, 1e12)


def _center() -> Any:
    return quantity('pair', 'centre of mass as drawn [x, y], in units', span=_PLACES, default=None)


class _Drawn(Checked):
    """Base class of a drawing and its parts, whose mistakes are all found at once."""

    allows_unknown = True


def _refuse(mistakes: Iterable[str]) -> None:
    """Rejects mistakes, if there are any.

    Raises:
        ConfigurationError: There are; the message has all.
    """
    collected = Mistakes()
    for words in mistakes:
        collected.add(words)
    collected.check()


@dataclass(frozen=True)
class DrawnMass(_Drawn):
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
class DrawnLink(_Drawn):
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
class DrawnSlide(_Drawn):
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
class DrawnCylinder(_Drawn):
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
class Drawing(_Drawn):
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
        _refuse(mistakes_of(self))

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
        lists: dict[str, Sequence[Any]] = {
            'links': self.links,
            'slides': self.slides,
            'cylinders': self.cylinders,
        }
        words = list[str]()
        for name, parts in lists.items():
            if parts:
                words.append(f'{name} {", ".join(part.name for part in parts)}')
        return f'<Drawing (input {self.input}): {"; ".join(words)}>'

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
        return DrawnMechanism(
            drawing=self, gravity=gravity, loads=loads, points=points
        ).converted()


@dataclass(frozen=True, kw_only=True)
class DrawnMechanism(_Drawn):
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

    def __post_init__(self) -> None:
        super().__post_init__()
        _refuse(mistakes_of_places(self.drawing, self.loads, self.points))

    def converted(self) -> Mechanism:
        """Returns the mechanism; see `Drawing.mechanism`.

        Raises:
            ConfigurationError: There is none; the message has the `contradictions`, too.
        """
        with self.suspicion():
            return Conversion(self.drawing).mechanism(self.gravity, self.loads, self.points)

    @contextmanager
    def suspicion(self) -> Iterator[None]:
        """Adds to an error its probable cause: the values that contradict the drawing.

        Raises:
            ConfigurationError: The error.
        """
        try:
            yield
        except ConfigurationError as error:
            strange = contradictions(self.drawing)
            if error.mistakes or not strange:
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
