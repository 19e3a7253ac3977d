# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Parts of mechanisms: links with two pins, sliders and fixed links.

Lengths are in m, masses in kg, and moments of inertia in kg m^2 about each body's centre of mass.
Angles are in rad, counter-clockwise from the x axis of base_link.
"""

from dataclasses import dataclass
from typing import Any

from linkage_ros.mechanism.loads.link_load import PartLoad
from linkage_ros.quantities import Checked, quantity

OPEN = 'open'
CROSSED = 'crossed'

# Input ranges. They keep products of up to six lengths from overflowing or underflowing, and are
# far wider than any real linkage requires.
_LENGTHS = (1e-9, 1e9)
_MASSES = (0.0, 1e12)
_FORCES = (-1e12, 1e12)
_PLACES = (-1e9, 1e9)


def gravity_quantity() -> Any:
    """Declares the field of a mechanism that holds the acceleration of gravity [x, y], m/s^2."""
    return quantity(
        'pair', 'acceleration of gravity [x, y]', 'm/s^2', span=(-1e6, 1e6), default=(0.0, -9.81)
    )


def _mass() -> Any:
    return quantity('number', 'mass', 'kg', span=_MASSES, default=0.0)


def _inertia() -> Any:
    return quantity(
        'number', 'moment of inertia about the centre of mass', 'kg m^2', span=_MASSES, default=0.0
    )


def _center(origin: str) -> Any:
    """Declares the centre of mass, which is measured from this point."""
    return quantity(
        'pair', f'centre of mass [along, across] from {origin}', 'm', span=_PLACES,
        default=(0.0, 0.0),
    )  # fmt: skip


def _number(meaning: str, unit: str, span: tuple[float, float]) -> Any:
    return quantity('number', meaning, unit, span=span, default=0.0)


def _force(meaning: str = 'external force along the guide') -> Any:
    return _number(meaning, 'N', _FORCES)


def _damping() -> Any:
    return _number('resistance per sliding speed', 'N s/m', _MASSES)


def _stiffness(meaning: str = 'stiffness of a spring to the frame') -> Any:
    return _number(meaning, 'N/m', _MASSES)


def _rest_position() -> Any:
    return _number('position at which the spring is at rest', 'm', _PLACES)


class LoadedPart(Checked):
    """Base class of parts with parameters of a load on their own link."""

    def own_load(self, link: str) -> PartLoad | None:
        """Returns this load, or None if it is 0.

        Args:
            link: Name of the part's link.
        """
        raise NotImplementedError


class SlidingPart(LoadedPart):
    """Base class of parts that slide.

    Attributes:
        force: External force along the guide, N.
        damping: Damping coefficient of the guide, N s/m.
        stiffness: Stiffness of a spring to the frame, N/m.
        rest_position: Position at which the spring exerts no force, m.
    """

    force: float
    damping: float
    stiffness: float
    rest_position: float

    def own_load(self, link: str) -> PartLoad | None:
        """See `LoadedPart.own_load`."""
        values = self.force, self.damping, self.stiffness
        return PartLoad(link, *values, self.rest_position) if any(values) else None


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
    mass: float = _mass()
    inertia: float = _inertia()
    center: tuple[float, float] = _center('the first pin')


@dataclass(frozen=True)
class Coupler(Body):
    """The floating link, which may carry a traced point.

    Attributes:
        point: Coupler point [along, across] from the crank pin, m; None if no point is traced.
    """

    point: tuple[float, float] | None = quantity(
        'pair', 'traced coupler point [along, across] from the crank pin', 'm',
        span=_PLACES, default=None,
    )  # fmt: skip


@dataclass(frozen=True)
class Rocker(Body, LoadedPart):
    """The output link of a four-bar, including the load on it.

    Attributes:
        torque: External torque on the rocker, positive counter-clockwise, N m.
        damping: Damping coefficient of the rocker's bearing, N m s.
        stiffness: Stiffness of a torsion spring to the frame, N m/rad.
        rest_angle: Angle of the rocker at which the spring exerts no torque, rad.
    """

    torque: float = _number('external torque, positive counter-clockwise', 'N m', _FORCES)
    damping: float = _number('resistance per angular velocity', 'N m s', _MASSES)
    stiffness: float = _number('stiffness of a torsion spring to the frame', 'N m/rad', _MASSES)
    rest_angle: float = _number('direction in which the spring is at rest', 'rad', (-1e3, 1e3))

    def own_load(self, link: str) -> PartLoad | None:
        """See `LoadedPart.own_load`."""
        values = self.torque, self.damping, self.stiffness
        return PartLoad(link, *values, self.rest_angle) if any(values) else None


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
class Slider(SlidingPart):
    """A body that slides along a guide without turning; its pin is its centre of mass.

    A disc of mass m, inertia J and radius R that rolls along the guide moves like a slider of mass
    m + J / R^2. If the guide is not level, `force` must cancel the weight of J / R^2.

    Attributes:
        offset: Distance from the crank pivot to the pin's path, positive to the left of the
            guide's direction, m.
        mass: Mass, kg.
        force: External force along the guide, N.
        damping: Damping coefficient of the guide, N s/m.
        stiffness: Stiffness of a spring to the frame, N/m.
        rest_position: Position of the slider at which the spring exerts no force, m.
    """

    offset: float = quantity(
        'number', "distance of the pin's path from the crank pivot, to the guide's left", 'm',
        span=_PLACES, default=0.0,
    )  # fmt: skip
    mass: float = _mass()
    force: float = _force()
    damping: float = _damping()
    stiffness: float = _stiffness()
    rest_position: float = _rest_position()


@dataclass(frozen=True)
class Barrel(Checked):
    """The barrel of a cylinder, or a slotted lever, which turns about the fixed pivot B0.

    Attributes:
        mass: Mass, kg.
        inertia: Moment of inertia about its centre of mass, kg m^2.
        center: Centre of mass [along, across] from B0, m.
    """

    mass: float = _mass()
    inertia: float = _inertia()
    center: tuple[float, float] = _center('the pivot B0')


@dataclass(frozen=True)
class Rod(SlidingPart):
    """The rod of a cylinder, which slides in the barrel; its loads act between the two.

    Attributes:
        mass: Mass, kg.
        inertia: Moment of inertia about its centre of mass, kg m^2.
        center: Centre of mass [along, across] from the crank pin A in the barrel's direction, m.
            A centre between B0 and A is behind A, at a negative distance along.
        force: Force between barrel and rod that lengthens the cylinder, N.
        damping: Damping coefficient of the cylinder, N s/m.
        stiffness: Stiffness of a spring between barrel and rod, N/m.
        rest_position: Position of the rod at which the spring exerts no force, m.
    """

    mass: float = _mass()
    inertia: float = _inertia()
    center: tuple[float, float] = _center("A in the barrel's direction")
    force: float = _force('force that lengthens the cylinder')
    damping: float = _damping()
    stiffness: float = _stiffness('stiffness of a spring between barrel and rod')
    rest_position: float = _rest_position()


@dataclass(frozen=True)
class Piston(SlidingPart):
    """A slider on the x axis of base_link, whose position is an independent coordinate.

    Attributes:
        position: Position at t = 0, m.
        velocity: Velocity at t = 0, m/s.
        mass: Mass, kg.
        damping: Damping coefficient of the pump, N s/m.
        force: External force along the guide, N.
        stiffness: Stiffness of a spring to the frame, N/m.
        rest_position: Position of the slider at which the spring exerts no force, m.
    """

    position: float = quantity('number', 'position at t = 0', 'm', span=_PLACES)
    velocity: float = quantity('number', 'velocity at t = 0', 'm/s', span=(-1e6, 1e6), default=0.0)
    mass: float = _mass()
    damping: float = _damping()
    force: float = _force()
    stiffness: float = _stiffness()
    rest_position: float = _rest_position()
