# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The equations of motion, M q'' + h = Q + torque, of every mechanism: torque in, motion out.

They are those of the driving torque (`dynamics`), solved for the accelerations. The coordinates q
are the crank angle and, of a wind pump, the slider's position; the torque acts on the crank.
"""

from __future__ import annotations

from collections.abc import Sequence

from linkage_ros.dynamics.arguments import checked
from linkage_ros.dynamics.driving_torque import MassDistribution
from linkage_ros.dynamics.state import State
from linkage_ros.errors import ConfigurationError, MechanismError
from linkage_ros.mechanisms.kinematics import kinematics_of
from linkage_ros.mechanisms.links import Links, PerCoordinate, PerLink
from linkage_ros.mechanisms.registry import Mechanism
from linkage_ros.numeric import ARRAY, SCALAR, Real, all_finite, functions_of
from linkage_ros.quantities import shown


class EquationsOfMotion:
    """The equations of motion of one mechanism.

    All methods take a float or an array for each coordinate; arrays broadcast.

    Attributes:
        mechanism: The description it was made from.
        structure: How its links hang together.
        coordinates: Names of the coordinates: 'crank' and, of a wind pump, 'slider'.
        has_edge: Whether motion can reach places beyond which the coordinates do not describe it.
    """

    def __init__(self, mechanism: Mechanism) -> None:
        self.mechanism = mechanism
        kinematics = kinematics_of(mechanism)
        self.structure, self.coordinates = kinematics.structure, kinematics.structure.coordinates
        self.has_edge, self._dyad, self._locate = (
            kinematics.has_edge, kinematics.dyad, kinematics.links,
        )  # fmt: skip
        self._masses = MassDistribution(self.structure, mechanism.gravity)
        self._crosses_guide = self.structure.joints[2].slides

    def accelerations(self, q: PerCoordinate, u: PerCoordinate, torque: Real) -> PerCoordinate:
        """The accelerations under a torque: M q'' + h - Q = torque, solved for q''.

        Args:
            q: Coordinates: crank angle, rad; slider position, m.
            u: Their rates, rad/s and m/s.
            torque: On the crank, N m, counter-clockwise positive.

        Returns:
            rad/s^2 and m/s^2.

        Raises:
            UnreachableError: The loop cannot close there, or a dyad is stretched.
            ConfigurationError: A value is not a finite number or an array of them, there is not
                one for each coordinate, their shapes do not broadcast, or an acceleration
                overflows.
            MechanismError: Something moves without a mass.
        """
        return self.forward(q, u, torque)[0]

    def forward(
        self, q: PerCoordinate, u: PerCoordinate, torque: Real
    ) -> tuple[PerCoordinate, tuple[Real, Real]]:
        """The accelerations under a torque, and how near the edge of what q can describe is.

        Args:
            q: As for `accelerations`.
            u: Likewise.
            torque: Likewise.

        Returns:
            The accelerations; and the sine of the angle at which coupler and third link meet, or
            the coupler and the normal of its guide, with its rate, 1/s. It is 0 at the edge,
            which motion reaches and leaves at a rate that is not. 1 and 0: there is no edge.

        Raises:
            UnreachableError: As for `accelerations`.
            ConfigurationError: Likewise.
            MechanismError: Likewise.
        """
        q, u, torque = checked(self.coordinates, q, u, torque=torque)
        links = self._links(q)
        rates = _rates(links, u)
        slide = (u[-1], 0.0) if len(u) > 1 else None
        held = self._masses.balance(links, rates, _accelerations(links, u, None), slide)
        matrix = self._masses.matrix(links)
        if len(u) == 1:
            ((inertia,),) = matrix
            _require_mass(inertia)
            found: PerCoordinate = ((torque - held[0]) / inertia,)
        else:
            (m11, m12), (_, m22) = matrix
            determinant = m11 * m22 - m12 * m12
            _require_mass(determinant)
            push, pull = torque - held[0], -held[1]
            found = (
                (m22 * push - m12 * pull) / determinant,
                (m11 * pull - m12 * push) / determinant,
            )
        if not all_finite(*found):
            raise ConfigurationError('the accelerations overflow at these rates: lower them')
        return found, self._edge(links, rates)

    def _edge(self, links: Links, rates: PerLink) -> tuple[Real, Real]:
        if not self.has_edge:
            return 1.0, 0.0
        _, (_, c2, c3), (_, s2, s3), _, _ = links
        along, across = c2 * c3 + s2 * s3, s2 * c3 - c2 * s3
        if self._crosses_guide:
            sine, rate = along, -across * rates[1]
        else:
            sine, rate = across, along * (rates[1] - rates[2])
        sign = 2.0 * (sine >= 0) - 1.0
        return sign * sine, sign * rate

    def state(self, q: PerCoordinate, u: PerCoordinate, a: PerCoordinate) -> State:
        """The motion of all links, and the torque on the crank that goes with it.

        Args:
            q: Coordinates.
            u: Their rates.
            a: Their accelerations; the slider of a wind pump, which nothing drives, has the one
                that `accelerations` gives.

        Returns:
            The state; floats, or arrays.

        Raises:
            UnreachableError: As for `accelerations`.
            ConfigurationError: As for `accelerations`.
        """
        q, u, a, _ = checked(self.coordinates, q, u, a)
        links = self._links(q)
        rates, changes = _rates(links, u), _accelerations(links, u, a)
        slide = (u[-1], a[-1]) if len(u) > 1 else None
        torque, *_ = self._masses.balance(links, rates, changes, slide)
        if slide:
            rates, changes = (*rates, u[-1]), (*changes, a[-1])
        return State(links[0], rates, changes, torque)

    def matrix(self, q: PerCoordinate) -> tuple[tuple[Real, ...], ...]:
        """The mass matrix M.

        Args:
            q: Coordinates.

        Returns:
            A row for each coordinate, kg m^2 between angles, kg between slides.

        Raises:
            UnreachableError: As for `accelerations`.
            ConfigurationError: As for `accelerations`.
        """
        q, _ = checked(self.coordinates, q)
        return self._masses.matrix(self._links(q))

    def energy(self, q: PerCoordinate, u: PerCoordinate) -> tuple[Real, Real]:
        """The mechanical energy of all bodies.

        Args:
            q: Coordinates.
            u: Their rates.

        Returns:
            Kinetic, and potential of the weights but for a constant, J.

        Raises:
            UnreachableError: As for `accelerations`.
            ConfigurationError: As for `accelerations`.
        """
        q, u, _ = checked(self.coordinates, q, u)
        links = self._links(q)
        matrix = self._masses.matrix(links)
        kinetic = sum(
            0.5 * mass * (one * other)
            for row, one in zip(matrix, u, strict=True)
            for mass, other in zip(row, u, strict=True)
        )
        return kinetic, self._masses.potential(links)

    def power(self, q: PerCoordinate, u: PerCoordinate, torque: Real) -> Real:
        """The power of all that is no weight: the rate at which the energy grows.

        Args:
            q: Coordinates.
            u: Their rates.
            torque: On the crank, N m.

        Returns:
            Of torque, external force and resistance, W.

        Raises:
            UnreachableError: As for `accelerations`.
            ConfigurationError: As for `accelerations`.
        """
        q, u, torque = checked(self.coordinates, q, u, torque=torque)
        power = torque * u[0]
        if slider := self.structure.slider:
            links = self._links(q)
            velocity = u[-1] if len(u) > 1 else _rates(links, u)[slider.link]
            power = power + (slider.force - slider.damping * velocity) * velocity
        return power

    def dyad(self, q: PerCoordinate) -> tuple[float, str]:
        """How near coupler and third link are to the edge of what the coordinates describe.

        Args:
            q: Coordinates; floats.

        Returns:
            The sine of the angle at which they meet, 0 at the edge, and what they are there, in
            words.

        Raises:
            ConfigurationError: As for `accelerations`, or a coordinate is an array.
        """
        q, _ = checked(self.coordinates, q)
        if not _is_scalar(q):
            raise ConfigurationError(f'q = {shown(q)}: must be numbers, one position at a time')
        return self._dyad(q)

    def _links(self, q: PerCoordinate) -> Links:
        return self._locate(q, SCALAR if _is_scalar(q) else ARRAY)


def _is_scalar(q: PerCoordinate) -> bool:
    return all(isinstance(value, float) for value in q)


def _rates(links: Links, u: Sequence[Real]) -> PerLink:
    partial = links[3]
    if len(partial) == 1:
        ((k1, k2, k3),), (speed,) = partial, u
        return k1 * speed, k2 * speed, k3 * speed
    ((k1, k2, k3), (_, j2, j3)), (speed, slide) = partial, u
    return k1 * speed, k2 * speed + j2 * slide, k3 * speed + j3 * slide


def _accelerations(links: Links, u: Sequence[Real], a: Sequence[Real] | None) -> PerLink:
    """Of the three links; None: those that remain while no speed changes."""
    if len(u) == 1:
        ((c1, c2, c3),), square = links[4], u[0] * u[0]
        e1, e2, e3 = c1 * square, c2 * square, c3 * square
    else:
        ((_, b2, b3), (_, c2, c3), (_, d2, d3)), (speed, slide) = links[4], u
        square, mixed, other = speed * speed, speed * slide, slide * slide
        e1 = 0.0
        e2 = b2 * square + c2 * mixed + d2 * other
        e3 = b3 * square + c3 * mixed + d3 * other
    if a is None:
        return e1, e2, e3
    g1, g2, g3 = _rates(links, a)
    return e1 + g1, e2 + g2, e3 + g3


def _require_mass(determinant: Real) -> None:
    if functions_of(determinant).lowest(determinant) <= 0:
        raise MechanismError(
            'something moves without a mass: its acceleration under a torque has no finite value; '
            'give the links a mass or an inertia'
        )
