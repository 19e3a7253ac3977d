# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A spring and damper between points of two links, or of a link and the frame."""

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, NoReturn

from linkage_ros.errors import ConfigurationError, UnreachableError
from linkage_ros.formulas import ZERO, Opaque, dot, require, sqrt
from linkage_ros.mechanism.kinematics import LinkPose
from linkage_ros.mechanism.loads.base import AppliedLoad, LoadedMechanism
from linkage_ros.mechanism.parts import FRAME_NAME
from linkage_ros.mechanism.structure import Point, Structure
from linkage_ros.mechanism.wrenches import Wrench, place, velocity
from linkage_ros.numeric import Real
from linkage_ros.quantities import quantity
from linkage_ros.units import rad_and_deg

_NOT_NEGATIVE = (0.0, 1e12)


@dataclass(frozen=True)
class Spring(AppliedLoad):
    """A spring with damping between two points.

    Its tension is stiffness x (length - free_length) + damping x rate of length.

    Attributes:
        link: Name of the link at the spring's first end; empty if `pin` is given.
        at: First end [along, across] from the link's first pin, m; on a slider, from its pin in
            the axes of the guide; None for that pin.
        to: Name of the link at the second end, or 'frame'.
        to_at: Second end, likewise; on the frame, in the axes of base_link from A0.
        stiffness: Stiffness, N/m.
        free_length: Length without tension, m.
        damping: Damping coefficient, N s/m.
        pin: Pin or traced point at the first end, instead of `link` and `at`.
        to_pin: Pin or traced point at the second end, instead of `to` and `to_at`.
        cylinder: In a drawing, the cylinder whose pins are the ends, instead of all of these.
    """

    link: str = quantity('text', "link at the spring's first end", default='')
    at: tuple[float, float] | None = quantity(
        'pair', 'first end [along, across] from the first pin of the link', 'm',
        span=(-1e9, 1e9), default=None,
    )  # fmt: skip
    to: str = quantity('text', "link at the spring's second end, or frame", default=FRAME_NAME)
    to_at: tuple[float, float] | None = quantity(
        'pair', 'second end, likewise; on the frame, in the axes of base_link', 'm',
        span=(-1e9, 1e9), default=None,
    )  # fmt: skip
    stiffness: float = quantity('number', 'stiffness', 'N/m', span=_NOT_NEGATIVE, default=0.0)
    free_length: float = quantity(
        'number', 'length without tension', 'm', span=(0.0, 1e9), default=0.0
    )
    damping: float = quantity(
        'number', 'damping coefficient', 'N s/m', span=_NOT_NEGATIVE, default=0.0
    )
    pin: str = quantity(
        'text', 'pin or point at the first end, instead of link and at', default=''
    )
    to_pin: str = quantity(
        'text', 'pin or point at the second end, instead of to and to_at', default=''
    )
    cylinder: str = quantity('text', 'in a drawing, cylinder whose pins are the ends', default='')

    def on(self, mechanism: LoadedMechanism) -> 'PointSpring':
        """See `AppliedLoad.on`.

        Raises:
            ConfigurationError: The mechanism has no such link, or both ends are on one link.
        """
        structure = mechanism.structure()
        if self.cylinder:
            raise ConfigurationError(
                f'{self.label}.cylinder is for mechanism: drawing; give link and at, or pin'
            )
        (link, point), (other, other_point) = self.ends(structure)
        if link == other:
            raise ConfigurationError(
                f'{self.label}.to = {self.to!r}: a spring between two points of one link does '
                'nothing; name another link, or frame'
            )
        return PointSpring(
            link, point, other,
            other_point, self.stiffness, self.free_length, self.damping,
            Opaque(functools.partial(_refuse, self.label)),
        )  # fmt: skip

    def ends(self, structure: Structure) -> tuple[tuple[int, Point], tuple[int, Point]]:
        """Returns the link and the point of each end; see `Structure.place_of`."""
        to = '' if self.to_pin and self.to == FRAME_NAME else self.to
        return (
            structure.place_of(f'{self.label}.link', self.link, self.at, self.pin),
            structure.place_of(
                f'{self.label}.to', to, self.to_at, self.to_pin, frame_allowed=True
            ),
        )


class SpringMotion(NamedTuple):
    """The motion of a spring, as floats or arrays.

    Attributes:
        length: Distance of its ends, m.
        rate: Rate of this distance, m/s.
        tension: Force with which it pulls its ends together, N.
    """

    length: Real
    rate: Real
    tension: Real


def _refuse(label: str, crank: float) -> NoReturn:
    raise UnreachableError(
        f'at {rad_and_deg(crank)} the ends of the spring {label} '
        'coincide, so that its direction is undefined: move at or to_at, or set free_length and '
        'damping to 0',
        crank_angle=crank, arcs=(),
    )  # fmt: skip


class PointSpring(NamedTuple):
    """A spring between two points, in the form used by formulas.

    Attributes:
        link: Index of the link at the first end.
        point: The first end.
        other: Index of the link at the second end, or FRAME.
        other_point: The second end.
        stiffness: Stiffness, N/m.
        free_length: Length without tension, m.
        damping: Damping coefficient, N s/m.
        refuse: Function that rejects a crank angle at which the ends coincide.
    """

    link: int
    point: Point
    other: int
    other_point: Point
    stiffness: Real
    free_length: Real
    damping: Real
    refuse: Opaque

    def wrenches(self, links: Sequence[LinkPose], rates: Sequence[Real]) -> list[Wrench]:
        """See `Load`."""
        apart = place(self.other_point, links) - place(self.point, links)
        if self.free_length is ZERO and self.damping is ZERO:
            force = apart * self.stiffness
        else:
            length = self._length(links)
            tension = self.stiffness * (length - self.free_length)
            if self.damping is not ZERO:
                other_velocity = velocity(self.other_point, links, rates)
                own_velocity = velocity(self.point, links, rates)
                extension_rate = dot(other_velocity - own_velocity, apart) / length
                tension = tension + self.damping * extension_rate
            force = apart * (tension / length)
        return [
            Wrench(self.link, force=force, point=self.point),
            Wrench(self.other, force=-force, point=self.other_point),
        ]

    def potential(self, links: Sequence[LinkPose]) -> Real:
        """Returns the energy of the spring, J; see `Load`."""
        if self.free_length is ZERO:
            apart = place(self.other_point, links) - place(self.point, links)
            return 0.5 * (self.stiffness * dot(apart, apart))
        stretch = self._length(links) - self.free_length
        return 0.5 * (self.stiffness * (stretch * stretch))

    def _length(self, links: Sequence[LinkPose]) -> Real:
        apart = place(self.other_point, links) - place(self.point, links)
        square = dot(apart, apart)
        require(square > 0, self.refuse, links[0].position)
        return sqrt(square)
