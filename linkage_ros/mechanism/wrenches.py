# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Wrenches on the bodies of a mechanism: a load as forces at points and couples.

Virtual power gives the generalised forces of a wrench, without joint forces; the joint forces and
the shaking force follow from the same wrench in the balances of its body. The functions take poses
whose `position` and `direction` are set; their derivatives are not used. `bodies` are the moving
links of a mechanism, each a `structure.Link`.
"""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

from linkage_ros.formulas import ZERO, Vector, cross, dot, turned
from linkage_ros.mechanism.axes import axes_of, spin_of
from linkage_ros.mechanism.kinematics import LinkPose
from linkage_ros.numeric import Real

FRAME = -1  # index of the body that does not move


class Wrench(NamedTuple):
    """A force at a point of a body, and a couple on it.

    Attributes:
        body: Index of the link on which it acts, or FRAME.
        effort: Couple, N m, positive counter-clockwise; on a sliding link, force along its guide
            through its pin, N. A link on which it slides takes the opposite force.
        by_frame: Share of `effort` that the frame exerts, so that its opposite acts on the frame.
        force: Force at `point`, in the axes of base_link, N.
        point: Point of the body, a `structure.Point`; None without a force.
        couple: Couple on a sliding link, N m; the guide of a guided link takes it.
    """

    body: int
    effort: Real = ZERO
    by_frame: Real = ZERO
    force: Vector = Vector(ZERO, ZERO)
    point: Any = None
    couple: Real = ZERO

    def generalised(
        self, bodies: Sequence[Any], links: Sequence[LinkPose]
    ) -> Iterator[tuple[int, Real]]:
        """Yields the power of the wrench per unit of each link's rate.

        Yields:
            Index of a link and torque on it, N m, or force along its guide, N.
        """
        body = self.body
        if body == FRAME:
            return
        if self.effort is not ZERO:
            yield body, self.effort
        spin = spin_of(bodies, body)
        if self.couple is not ZERO and spin is not None:
            yield spin, self.couple
        if self.point is None:
            return
        if bodies[body].is_guided:
            yield body, dot(links[body].direction, self.force)
            return
        for j, weight in enumerate(self.point.weights):
            if weight.x is not ZERO or weight.y is not ZERO:
                arm = turned(links[j].direction, weight.x, weight.y)
                yield j, cross(arm, self.force)


class ExertedForce(NamedTuple):
    """The force of a load at a point of a link.

    Attributes:
        load: Name of the load.
        link: Name of the link.
        force: Force (x, y) on the link in the axes of base_link, N.
        at: The point at which it acts, m.
    """

    load: str
    link: str
    force: Vector
    at: Vector


class Exerted(NamedTuple):
    """The loads on each link, as charts and arrows show them; see `Solver.exerted`.

    Attributes:
        efforts: Sum of all loads on a link without a point, by its name: couples, N m; on a
            sliding link, forces along its guide, N.
        forces: Forces at points, by 'LOAD on LINK', 'LOAD on LINK 2' and so on.
    """

    efforts: dict[str, Real]
    forces: dict[str, ExertedForce]


def poses(bodies: Sequence[Any], positions: Sequence[Real]) -> list[LinkPose]:
    """Returns poses for the functions below and for loads, from the positions in a `State`."""
    link_poses = []
    for j, position in enumerate(positions):
        spin, guide = axes_of(bodies, j)
        angle = 0.0 if spin is None else positions[spin]
        angle = angle if guide is None else angle + guide
        link_poses.append(LinkPose(position, Vector.at(angle), (), ()))
    return link_poses


def place(point: Any, links: Sequence[LinkPose]) -> Vector:
    """Returns the position of a point, m."""
    found: Vector = point.fixed
    for weight, link in zip(point.weights, links, strict=True):
        found += turned(link.direction, weight.x, weight.y)
    return found


def velocity(point: Any, links: Sequence[LinkPose], rates: Sequence[Real]) -> Vector:
    """Returns the velocity of a point, m/s."""
    found = Vector(ZERO, ZERO)
    for weight, link, rate in zip(point.weights, links, rates, strict=True):
        found += turned(link.direction, weight.x, weight.y).left() * rate
    return found
