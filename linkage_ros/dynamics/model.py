# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The constants of a mechanism that its equations of motion need.

Every centre of mass is a fixed combination of the link directions, G = sum_j rho_j e^(i phi_j)
(+ constant). Virtual power needs the bodies only through two kinds of constants,

    C_jk = sum_bodies m conj(rho_j) rho_k  (+ J on the diagonal)      W_j = sum_bodies m rho_j.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from linkage_ros.formulas import ZERO, Opaque, Vector, cross, dot, total
from linkage_ros.model.loads import JointLoad, Load
from linkage_ros.model.pose import LinkPose, Loop, Pose
from linkage_ros.model.structure import Link, Mechanism
from linkage_ros.numeric import Real


class Weight(NamedTuple):
    """The weights of all bodies, as a load; see `linkage_ros.model.loads.Load`.

    Attributes:
        links: The links.
        gravity: Acceleration of gravity, m/s^2.
    """

    links: tuple[Link, ...]
    gravity: Vector

    def _moment(self, j: int) -> Vector:
        """Conj(W_j) g as x and y, N m; of a link that slides m g, N."""
        if self.links[j].slides:
            return self.gravity * self.links[j].mass
        turning = (link for link in self.links if not link.slides)
        arm = total(link.center.weights[j] * link.mass for link in turning)
        return Vector(dot(arm, self.gravity), cross(arm, self.gravity))

    def forces(self, links: Sequence[LinkPose], _rates: Sequence[Real]) -> dict[int, Real]:
        """See `Load`: Re(conj(i W_j e^(i phi_j)) g)."""
        return {
            j: (dot if self.links[j].slides else cross)(link.direction, self._moment(j))
            for j, link in enumerate(links)
        }

    def potential(self, links: Sequence[LinkPose]) -> Real:
        """See `Load`."""
        energy = ZERO
        for j, link in enumerate(links):
            along = dot(link.direction, self._moment(j))
            energy = energy - (along * link.position if self.links[j].slides else along)
        return energy


class Model(NamedTuple):
    """The constants of a mechanism in motion, for formulas.

    Attributes:
        loop: Constants of the kinematics.
        links: The links.
        gravity: Acceleration of gravity, m/s^2.
        loads: What acts on the links besides their weights, but for `joint_loads`.
        joint_loads: What the forces in the joints make.
        refuse: Refuses q, u and a that are not finite, or that make a result not finite.
        refuse_torque: Refuses q, u and a torque, likewise.
        massless: Refuses a mass matrix that is not positive.
    """

    loop: Loop
    links: tuple[Link, ...]
    gravity: Vector
    loads: tuple[Load, ...]
    joint_loads: tuple[JointLoad, ...]
    refuse: Opaque
    refuse_torque: Opaque
    massless: Opaque

    @classmethod
    def of(
        cls, mechanism: Mechanism, links: tuple[Link, ...], loop: Loop, *refusals: Opaque
    ) -> Model:
        """The constants of a mechanism with these links and kinematics; the last fields as given.

        Args:
            mechanism: The mechanism.
            links: Its links.
            loop: Constants of its kinematics.
            *refusals: `refuse`, `refuse_torque` and `massless`.

        Returns:
            The constants.

        Raises:
            ConfigurationError: A load does not fit the mechanism.
        """
        loads, joint_loads = mechanism.link_loads(), mechanism.joint_loads()
        return cls(loop, links, Vector(*mechanism.gravity), loads, joint_loads, *refusals)

    def all_loads(self) -> tuple[Load, ...]:
        """The weights and what else acts on the links."""
        return (Weight(self.links, self.gravity), *self.loads)

    def coupling(self, j: int, k: int) -> Vector:
        """C_jk as real and imaginary part, kg m^2; ZERO: no body couples the links."""
        result = Vector(ZERO, ZERO)
        for link in self.links:
            if not link.slides:
                first, second = link.center.weights[j] * link.mass, link.center.weights[k]
                result += Vector(dot(first, second), cross(first, second))
        return result

    def inertia(self, j: int) -> Real:
        """C_jj of a link, kg m^2; of a link that slides its mass, kg."""
        link = self.links[j]
        return link.mass if link.slides else self.coupling(j, j).x + link.inertia

    def coupled(self, pose: Pose, j: int, k: int) -> tuple[Real, Real]:
        """C_jk e^(i (phi_k - phi_j)) as A and B."""
        coupling, first, second = (
            self.coupling(j, k), pose.links[j].direction, pose.links[k].direction,
        )  # fmt: skip
        cos, sin = dot(first, second), cross(first, second)
        return coupling.x * cos - coupling.y * sin, coupling.x * sin + coupling.y * cos
