# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Parts of mechanisms: links with two pins, sliders and fixed links.

Lengths are in m, masses in kg, and moments of inertia in kg m^2 about each body's centre of mass.
Angles are in rad, counter-clockwise from the x axis of base_link.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

from linkage_ros.quantities import Checked, quantity

OPEN = 'open'
CROSSED = 'crossed'

# Input ranges. They keep products of up to six lengths from overflowing or underflowing, and are
# far wider than any real linkage requires.
_LENGTHS = (1e-9, 1e9)
_MASSES = (0.0, 1e12)
_FORCES = (-1e12, 1e12)
_SLIDER_LOAD = 'force', 'damping', 'stiffness', 'rest_position'


def gravity_quantity() -> Any:
    """Declares the field of a mechanism that holds the acceleration of gravity [x, y], m/s^2."""
    return quantity(
        'pair', 'acceleration of gravity [x, y]', 'm/s^2', span=(-1e6, 1e6), default=(0.0, -9.81)
    )


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
    mass: float = quantity('number', 'mass', 'kg', span=_MASSES, default=0.0)
    inertia: float = quantity(
        'number', 'moment of inertia about the centre of mass', 'kg m^2', span=_MASSES, default=0.0
    )
    center: tuple[float, float] = quantity(
        'pair', 'centre of mass [along, across] from the first pin', 'm',
        span=(-1e9, 1e9), default=(0.0, 0.0),
    )  # fmt: skip


@dataclass(frozen=True)
class Coupler(Body):
    """The floating link, which may carry a traced point.

    Attributes:
        point: Coupler point [along, across] from the crank pin, m; None if no point is traced.
    """

    point: tuple[float, float] | None = quantity(
        'pair', 'traced coupler point [along, across] from the crank pin', 'm',
        span=(-1e9, 1e9), default=None,
    )  # fmt: skip


@dataclass(frozen=True)
class Rocker(Body):
    """The output link of a four-bar, including the load on it.

    Attributes:
        torque: External torque on the rocker, positive counter-clockwise, N m.
        damping: Damping coefficient of the rocker's bearing, N m s.
        stiffness: Stiffness of a torsion spring to the frame, N m/rad.
        rest_angle: Angle of the rocker at which the spring exerts no torque, rad.
    """

    load_fields: ClassVar[tuple[str, ...]] = ('torque', 'damping', 'stiffness', 'rest_angle')

    torque: float = quantity(
        'number', 'external torque, positive counter-clockwise', 'N m', span=_FORCES, default=0.0
    )
    damping: float = quantity(
        'number', 'resistance per angular velocity', 'N m s', span=_MASSES, default=0.0
    )
    stiffness: float = quantity(
        'number', 'stiffness of a torsion spring to the frame', 'N m/rad', span=_MASSES,
        default=0.0,
    )  # fmt: skip
    rest_angle: float = quantity(
        'number', 'direction in which the spring is at rest', 'rad', span=(-1e3, 1e3), default=0.0
    )


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

    load_fields: ClassVar[tuple[str, ...]] = _SLIDER_LOAD

    offset: float = quantity(
        'number', "distance of the pin's path from the crank pivot, to the guide's left", 'm',
        span=(-1e9, 1e9), default=0.0,
    )  # fmt: skip
    mass: float = quantity('number', 'mass', 'kg', span=_MASSES, default=0.0)
    force: float = quantity(
        'number', 'external force along the guide', 'N', span=_FORCES, default=0.0
    )
    damping: float = quantity(
        'number', 'resistance per sliding speed', 'N s/m', span=_MASSES, default=0.0
    )
    stiffness: float = quantity(
        'number', 'stiffness of a spring to the frame', 'N/m', span=_MASSES, default=0.0
    )
    rest_position: float = quantity(
        'number', 'position at which the spring is at rest', 'm', span=(-1e9, 1e9), default=0.0
    )


@dataclass(frozen=True)
class Barrel(Checked):
    """The barrel of a cylinder, or a slotted lever, which turns about the fixed pivot B0.

    Attributes:
        mass: Mass, kg.
        inertia: Moment of inertia about its centre of mass, kg m^2.
        center: Centre of mass [along, across] from B0, m.
    """

    mass: float = quantity('number', 'mass', 'kg', span=_MASSES, default=0.0)
    inertia: float = quantity(
        'number', 'moment of inertia about the centre of mass', 'kg m^2', span=_MASSES, default=0.0
    )
    center: tuple[float, float] = quantity(
        'pair', 'centre of mass [along, across] from the pivot B0', 'm',
        span=(-1e9, 1e9), default=(0.0, 0.0),
    )  # fmt: skip


@dataclass(frozen=True)
class Rod(Checked):
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

    load_fields: ClassVar[tuple[str, ...]] = _SLIDER_LOAD

    mass: float = quantity('number', 'mass', 'kg', span=_MASSES, default=0.0)
    inertia: float = quantity(
        'number', 'moment of inertia about the centre of mass', 'kg m^2', span=_MASSES, default=0.0
    )
    center: tuple[float, float] = quantity(
        'pair', "centre of mass [along, across] from A in the barrel's direction", 'm',
        span=(-1e9, 1e9), default=(0.0, 0.0),
    )  # fmt: skip
    force: float = quantity(
        'number', 'force that lengthens the cylinder', 'N', span=_FORCES, default=0.0
    )
    damping: float = quantity(
        'number', 'resistance per sliding speed', 'N s/m', span=_MASSES, default=0.0
    )
    stiffness: float = quantity(
        'number', 'stiffness of a spring between barrel and rod', 'N/m', span=_MASSES, default=0.0
    )
    rest_position: float = quantity(
        'number', 'position at which the spring is at rest', 'm', span=(-1e9, 1e9), default=0.0
    )


@dataclass(frozen=True)
class Piston(Checked):
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

    load_fields: ClassVar[tuple[str, ...]] = _SLIDER_LOAD

    position: float = quantity('number', 'position at t = 0', 'm', span=(-1e9, 1e9))
    velocity: float = quantity('number', 'velocity at t = 0', 'm/s', span=(-1e6, 1e6), default=0.0)
    mass: float = quantity('number', 'mass', 'kg', span=_MASSES, default=0.0)
    damping: float = quantity(
        'number', 'resistance per sliding speed', 'N s/m', span=_MASSES, default=0.0
    )
    force: float = quantity(
        'number', 'external force along the guide', 'N', span=_FORCES, default=0.0
    )
    stiffness: float = quantity(
        'number', 'stiffness of a spring to the frame', 'N/m', span=_MASSES, default=0.0
    )
    rest_position: float = quantity(
        'number', 'position at which the spring is at rest', 'm', span=(-1e9, 1e9), default=0.0
    )
