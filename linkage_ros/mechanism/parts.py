# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Parts of mechanisms: links with two pins, sliders and fixed links.

Lengths are in m, masses in kg, and moments of inertia in kg m^2 about each body's centre of mass.
Angles are in rad, counter-clockwise from the x axis of base_link.
"""

from dataclasses import dataclass
from typing import Any

from linkage_ros.errors import ConfigurationError
from linkage_ros.quantities import Checked, groups, quantity, require_name, required

FRAME_NAME = 'frame'  # of the fixed link, in parameters
OPEN = 'open'
CROSSED = 'crossed'

# Input ranges. They keep products of up to six lengths from overflowing or underflowing, and are
# far wider than any real linkage requires.
_LENGTHS = (1e-9, 1e9)
_MASSES = (0.0, 1e12)
_PLACES = (-1e9, 1e9)


def gravity_quantity() -> Any:
    """Declares the field of a mechanism that holds the acceleration of gravity [x, y], m/s^2."""
    return quantity(
        'pair', 'acceleration of gravity [x, y]', 'm/s^2', span=(-1e6, 1e6), default=(0.0, -9.81)
    )


def mass_quantity() -> Any:
    """Declares the mass of a body, kg."""
    return quantity('number', 'mass', 'kg', span=_MASSES, default=0.0)


def inertia_quantity() -> Any:
    """Declares the moment of inertia of a body about its centre of mass, kg m^2."""
    return quantity(
        'number', 'moment of inertia about the centre of mass', 'kg m^2', span=_MASSES, default=0.0
    )


def _center(origin: str) -> Any:
    """Declares the centre of mass, which is measured from this point."""
    return quantity(
        'pair', f'centre of mass [along, across] from {origin}', 'm', span=_PLACES,
        default=(0.0, 0.0),
    )  # fmt: skip


@dataclass(frozen=True)
class Body(Checked):
    """A link: a rigid body between two pins.

    Attributes:
        length: Distance between its pins, m.
        mass: Mass, kg.
        inertia: Moment of inertia about its centre of mass, kg m^2.
        center: Centre of mass [along, across] from the first pin, m.
    """

    length: float = quantity('number', 'distance between the pins', 'm', span=_LENGTHS)
    mass: float = mass_quantity()
    inertia: float = inertia_quantity()
    center: tuple[float, float] = _center('the first pin')


Rocker = Body  # the output link of a four-bar


def Coupler(
    length: float,
    mass: float = 0.0,
    inertia: float = 0.0,
    center: tuple[float, float] = (0.0, 0.0),
    point: object = None,
) -> Body:
    """Creates the floating link.

    Args:
        length: See `Body`, as for the next three.
        mass: Mass, kg.
        inertia: Moment of inertia, kg m^2.
        center: Centre of mass, m.
        point: Not accepted; the error gives what to write instead.

    Raises:
        ConfigurationError: A value is invalid, or there is a point.
    """
    if point is not None:
        raise ConfigurationError(
            f'Coupler(point={point!r}): since version 2.0, the mechanism has the traced points of '
            "all links; give it points=[TracedPoint('coupler_point', link='coupler', "
            f'at={point!r})]'
        )
    return Body(length, mass, inertia, center)


@dataclass(frozen=True)
class Frame(Checked):
    """The fixed link, from the crank pivot A0 to the rocker pivot B0.

    Attributes:
        length: Distance between the pivots, m.
        angle: Direction from A0 to B0, rad.
    """

    length: float = quantity('number', 'distance between the fixed pivots', 'm', span=_LENGTHS)
    angle: float = quantity(
        'number', 'direction from the crank pivot to the rocker pivot', 'rad',
        span=(-1e3, 1e3), default=0.0,
    )  # fmt: skip


@dataclass(frozen=True)
class Guide(Checked):
    """The fixed link of a slider-crank: the crank pivot A0 and a straight guide.

    Attributes:
        angle: Direction of the guide in which the slider's position increases, rad.
    """

    angle: float = quantity(
        'number', 'direction of the guide', 'rad', span=(-1e3, 1e3), default=0.0
    )


@dataclass(frozen=True)
class Slider(Checked):
    """A body that slides along a guide without turning; its pin is its centre of mass.

    A disc of mass m, inertia J and radius R that rolls along the guide moves like a slider of mass
    m + J / R^2. If the guide is not level, a load must cancel the weight of J / R^2.

    Attributes:
        offset: Distance from the crank pivot to the pin's path, positive to the left of the
            guide's direction, m.
        mass: Mass, kg.
    """

    offset: float = quantity(
        'number', "distance of the pin's path from the crank pivot, to the guide's left", 'm',
        span=_PLACES, default=0.0,
    )  # fmt: skip
    mass: float = mass_quantity()


@dataclass(frozen=True)
class Barrel(Checked):
    """The barrel of a cylinder, or a slotted lever, which turns about a pivot.

    Attributes:
        mass: Mass, kg.
        inertia: Moment of inertia about its centre of mass, kg m^2.
        center: Centre of mass [along, across] from the pivot, m.
    """

    mass: float = mass_quantity()
    inertia: float = inertia_quantity()
    center: tuple[float, float] = _center('the pivot')


@dataclass(frozen=True)
class Rod(Checked):
    """The rod of a cylinder, which slides in the barrel.

    Attributes:
        mass: Mass, kg.
        inertia: Moment of inertia about its centre of mass, kg m^2.
        center: Centre of mass [along, across] from its pin in the barrel's direction, m. A centre
            between the pivot and the pin is behind the pin, at a negative distance along.
    """

    mass: float = mass_quantity()
    inertia: float = inertia_quantity()
    center: tuple[float, float] = _center("the rod's pin in the barrel's direction")


@dataclass(frozen=True)
class TracedPoint(Checked):
    """A point of a link that is drawn with its path, published and logged.

    Attributes:
        name: Name of the point, in topics, columns and pictures.
        link: Link that carries the point.
        at: The point, [along, across] from the link's first pin, m; on a sliding link, from its
            pin in the axes of its guide; None for that pin.
    """

    name: str = required()
    link: str = quantity('text', 'link that carries the point')
    at: tuple[float, float] | None = quantity(
        'pair', 'point [along, across] on its link', 'm', span=_PLACES, default=None
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        require_name('point', self.name)


def points_field() -> Any:
    """Declares the field of a mechanism that holds its traced points."""
    return groups(TracedPoint, {'': TracedPoint})


@dataclass(frozen=True)
class Piston(Checked):
    """A slider on the x axis of base_link, whose position is an independent coordinate.

    Attributes:
        position: Position at t = 0, m.
        velocity: Velocity at t = 0, m/s.
        mass: Mass, kg.
    """

    position: float = quantity('number', 'position at t = 0', 'm', span=_PLACES)
    velocity: float = quantity('number', 'velocity at t = 0', 'm/s', span=(-1e6, 1e6), default=0.0)
    mass: float = mass_quantity()
