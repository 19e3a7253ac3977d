# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The one description of each mechanism: frozen, checked when made, free of any method.

Lengths in m, masses in kg, inertias in kg m^2 about each body's own centre of mass, angles in
rad counter-clockwise from the x axis of base_link.
"""

from __future__ import annotations

from dataclasses import dataclass

from linkage_ros.errors import MechanismError
from linkage_ros.quantities import Checked, quantity

OPEN = 'open'
CROSSED = 'crossed'

# Bounds on what may be typed in. Products of up to six lengths must neither overflow nor
# underflow; every linkage that can be built is far inside.
_LENGTHS = (1e-9, 1e9)
_MASSES = (0.0, 1e12)


@dataclass(frozen=True)
class Body(Checked):
    """A link: a rigid body between two pins.

    Attributes:
        length: Distance between its pins, m.
        mass: kg.
        inertia: About its centre of mass, kg m^2.
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
        point: Coupler point [along, across] from the crank pin, m; None: no point is traced.
    """

    point: tuple[float, float] | None = quantity(
        'pair', 'traced coupler point [along, across] from the crank pin', 'm',
        span=(-1e9, 1e9), default=None,
    )  # fmt: skip


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
class FourBar(Checked):
    """A four-bar linkage: crank A0-A, coupler A-B, rocker B0-B, frame A0-B0.

    Attributes:
        frame: The fixed link.
        crank: Driven link, from A0, the origin.
        coupler: Floating link, from the crank pin A to B.
        rocker: Output link, from B0.
        assembly: 'open': B lies left of the line from A to B0; 'crossed': right of it. Of a
            linkage that passes change points it names the branch at crank angles 0 to pi
            counted from the frame.
        gravity: Acceleration of gravity [x, y], m/s^2.
    """

    frame: Frame
    crank: Body
    coupler: Coupler
    rocker: Body
    assembly: str = quantity(
        'choice', 'side of the coupler-rocker pin', choices=(OPEN, CROSSED), default=OPEN
    )
    gravity: tuple[float, float] = quantity(
        'pair', 'acceleration of gravity [x, y]', 'm/s^2', span=(-1e6, 1e6), default=(0.0, -9.81)
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        longest, *others = sorted(
            (self.frame.length, self.crank.length, self.coupler.length, self.rocker.length),
            reverse=True,
        )
        if longest > sum(others):
            raise MechanismError(
                f'the longest link, {longest:g} m, is longer than the other three together, '
                f'{sum(others):g} m: the loop cannot close; shorten it or lengthen the others'
            )


# The names under which parameter files ask for a mechanism.
MECHANISMS: dict[str, type[FourBar]] = {'four_bar': FourBar}
