# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Pin forces, shaking force and shaking moment from the Newton-Euler equations of each body.

Virtual power gives the driving torque without these forces, so they are computed only on request.
For each dyad, the moment balances of its two links about their outer pins give the force in the
common pin. The force balance of each link then gives its remaining pin force. Finally, the moment
balance of the crank gives the driving torque, independently of virtual power.
"""

from collections.abc import Sequence
from typing import NamedTuple

from linkage_ros.dynamics.equations import Model, accelerations, velocities
from linkage_ros.formulas import ZERO, Vector, cross, dot, is_finite, require, total
from linkage_ros.model.kinematics import Pose
from linkage_ros.model.structure import Pin
from linkage_ros.numeric import Real

# Relative to the coordinate, because a double can only approximate a change point: k * math.pi is
# up to 2 ulp from it.
_ROUNDING = 2.0**-51
_ORIGIN = Vector(ZERO, ZERO)
_FRAME = -1  # index of the last body


class Reactions(NamedTuple):
    """Joint forces in the axes of base_link; floats or arrays, as in the state.

    Attributes:
        pins: Forces (x, y), N, by pin name. 'A0' is the force of the frame on the crank, 'A' of
            the crank on the coupler, 'B' of the coupler on the rocker, rod or slider, 'B0' of the
            frame on the rocker, and 'D' of the rod on the slider.
        guide_force: Normal force of the guide on the slider, positive to the left of the guide's
            direction, N; None if there is no slider.
        shaking_force: Force (x, y) of bearings and guide on the frame, N. It includes an external
            force on the slider, because that force originates outside the machine.
        shaking_moment: Moment on the frame about A0, including the drive's reaction, N m.
        torque: Driving torque from the moment balance of the crank, N m.
    """

    pins: dict[str, Vector]
    guide_force: Real | None
    shaking_force: Vector
    shaking_moment: Real
    torque: Real


def reactions(
    model: Model, q: Sequence[Real], u: Sequence[Real], a: Sequence[Real]
) -> tuple[tuple[Vector, ...], tuple[Real, ...], Vector, Real, Real]:
    """Computes the joint forces of a moving mechanism, in the order of the fields of `Reactions`.

    The forces grow without bound near a change point or a limit of the crank.
    """
    require(is_finite(*q, *u, *a), model.refuse, *q, *u, *a)
    pose = model.loop.pose(tuple(q))
    balance = _Balance(model, pose, velocities(pose, u), accelerations(pose, u, a))
    for (i, j), sine in reversed(list(zip(model.dyads, pose.sines, strict=True))):
        for angle, k1, k2 in zip(q, pose.links[i].jacobian, pose.links[j].jacobian, strict=True):
            slope = (ZERO if model.links[j].slides else k2) - k1
            # Reject coordinates within rounding errors of a change point.
            near = _ROUNDING * abs(slope) * (1 + abs(angle))
            require(abs(sine) > near, model.refuse_forces, *q)
        balance.solve(i, j, sine)
    for j in reversed(range(len(pose.links))):
        balance.solve_last_pin(j)
    guides = tuple(balance.solve_guide(j) for j, link in enumerate(model.links) if link.slides)
    torque, forces = balance.moment(0), tuple(balance.forces[pin.name] for pin in model.pins)
    return forces, guides, -balance.force(_FRAME), -balance.moment(_FRAME) - torque, torque


class _Balance:
    """Newton-Euler equations of all bodies: the links and, as the last body, the frame.

    Attributes:
        forces: Known pin forces, by pin name. The pin's first link exerts the force on its second
            link.
    """

    def __init__(
        self,
        model: Model,
        pose: Pose,
        rates: Sequence[Real],
        changes: Sequence[Real],
    ) -> None:
        self.forces: dict[str, Vector] = {}
        self._links, self._pins = model.links, model.pins
        self._directions = [link.direction for link in pose.links]
        self._positions = {
            pin.name: place.follow(self._directions, rates, changes)[0]
            for pin, place in zip(model.pins, model.pin_points, strict=True)
        }
        # For each body, the known forces with their points of application, and the known couple.
        # Following d'Alembert, inertia is included as reversed forces and couples.
        self._known: list[list[tuple[Vector, Vector]]] = [[] for _ in (*model.links, 'frame')]
        self._couples = [ZERO] * len(self._known)
        self._centers = []
        for j, (body, change) in enumerate(zip(model.links, changes, strict=True)):
            center, _, acceleration = body.center.follow(self._directions, rates, changes)
            self._centers.append(center)
            self._known[j].append((center, (model.gravity - acceleration) * body.mass))
            self._couples[j] -= body.inertia * change
        for load in model.loads:
            for j, force in load.forces(pose.links, rates).items():
                self._add_load(j, j, force)
            held = load.resistance(pose.links, rates) if hasattr(load, 'resistance') else {}
            for j, force in held.items():
                self._add_load(_FRAME, j, -force)

    def _add_load(self, body: int, j: int, force: Real) -> None:
        """Adds a load of link j to a body: a force along the guide or, if j turns, a couple."""
        if self._links[j].slides:
            self._known[body].append((self._centers[j], self._directions[j] * force))
        else:
            self._couples[body] += force

    def force(self, j: int) -> Vector:
        """Returns the force, N, that is missing from the force balance of body j."""
        return -Vector(*map(total, zip(*(force for _, force in self._known[j]), strict=True)))

    def moment(self, j: int, about: Vector = _ORIGIN) -> Real:
        """Returns the moment, N m, that is missing from the moment balance of body j."""
        return -(
            self._couples[j]
            + total(cross(place - about, force) for place, force in self._known[j])
        )

    def _add_pin_force(self, pin: Pin, force: Vector) -> None:
        """Adds a pin force to both of the pin's links."""
        self.forces[pin.name] = force
        self._known[pin.second].append((self._positions[pin.name], force))
        first = _FRAME if pin.first is None else pin.first
        self._known[first].append((self._positions[pin.name], -force))

    def solve(self, i: int, j: int, sine: Real) -> None:
        """Computes the force in the common pin of a dyad from the moments about its outer pins."""
        own, others = self._pins_of(i), self._pins_of(j)
        (pin,), (outer_pin,) = own & others, own - others
        inner, outer = self._positions[pin.name], self._positions[outer_pin.name]
        first, second = self._directions[i], self._directions[j]
        across_first = -self.moment(i, outer) / dot(inner - outer, first)
        if self._links[j].slides:
            across_second = -dot(self.force(j), second)
            second = second.left()
        else:
            (outer_pin,) = others - own
            outer = self._positions[outer_pin.name]
            across_second = self.moment(j, outer) / dot(inner - outer, second)
        force = (second * across_first - first * across_second) * (1.0 / sine)
        self._add_pin_force(pin, force)

    def _pins_of(self, j: int) -> set[Pin]:
        return {pin for pin in self._pins if j in (pin.first, pin.second)}

    def solve_last_pin(self, j: int) -> None:
        """Computes a turning link's last unknown pin force, if any, from its force balance."""
        unknown = [pin for pin in self._pins_of(j) if pin.name not in self.forces]
        if unknown and not self._links[j].slides:
            (pin,), force = unknown, self.force(j)
            self._add_pin_force(pin, force if pin.second == j else -force)

    def solve_guide(self, j: int) -> Real:
        """Computes the force of a guide on its slider; see `Reactions.guide_force`."""
        across = self._directions[j].left()
        force = dot(across, self.force(j))
        self._known[_FRAME].append((self._centers[j], across * -force))
        return force
