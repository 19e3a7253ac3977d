# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Pin forces, shaking force and shaking moment: Newton-Euler, body by body.

Virtual power gives the driving torque without them, so they are computed only on request. The
moments of a dyad's two links about their outer pins give the force in their common pin; a link
with one unknown pin force gives that one; and last the crank gives the driving torque once more.
"""

from collections.abc import Sequence
from typing import NamedTuple

from linkage_ros.dynamics.equations import ACCEPT, Model, accelerations, velocities
from linkage_ros.formulas import ZERO, Opaque, Vector, cross, dot, is_finite, require
from linkage_ros.model.pose import Pose
from linkage_ros.model.structure import Dyad, Pin, Point, Structure
from linkage_ros.numeric import Real

# Relative to the coordinate: no double lies on a change point, and k * math.pi misses by 2 ulp.
_ROUNDING = 2.0**-51


class Reactions(NamedTuple):
    """Forces in the joints, in the axes of base_link; floats or arrays, as in the state.

    Attributes:
        pins: Forces (x, y) at 'A0', of the frame on the crank, 'A', of the crank on the coupler,
            'B', of the coupler on the rocker, rod or slider, 'B0', of the frame on the rocker, and
            'D', of the rod on the slider; N.
        guide_force: Force of the guide on the slider, to its left, N; None without a slider.
        shaking_force: Force (x, y) of bearings and guide on the frame, N. It includes an external
            force on the slider, because that comes from outside the machine.
        shaking_moment: Moment on the frame about A0, including the drive's reaction, N m.
        torque: Driving torque from the crank's balance of moments, N m.
    """

    pins: dict[str, Vector]
    guide_force: Real | None
    shaking_force: Vector
    shaking_moment: Real
    torque: Real


class Joints(NamedTuple):
    """The constants of a mechanism's joints, for formulas.

    Attributes:
        pins: The pin joints, empty where they are not known.
        places: Their points, in the same order.
        dyads: Which links meet in pins.
        refuse: Refuses q at which forces in the joints have no finite value.
    """

    pins: tuple[Pin, ...]
    places: tuple[Point, ...]
    dyads: tuple[Dyad, ...]
    refuse: Opaque

    @classmethod
    def of(cls, structure: Structure, refuse: Opaque = ACCEPT) -> 'Joints':
        """The constants of a structure."""
        places = tuple(structure.points[pin.name] for pin in structure.pins)
        return cls(structure.pins, places, structure.dyads, refuse)


def reactions(
    constants: tuple[Model, Joints], q: Sequence[Real], u: Sequence[Real], a: Sequence[Real]
) -> tuple[tuple[Vector, ...], tuple[Real, ...], Vector, Real, Real]:
    """The forces in the joints of a mechanism in motion, as fields of `Reactions`.

    They grow without bound towards a change point or a limit of the crank.
    """
    model, joints = constants
    require(is_finite(*q, *u, *a), model.refuse, *q, *u, *a)
    pose = model.loop.pose(tuple(q))
    balance = _Balance(model, joints, pose, velocities(pose, u), accelerations(pose, u, a))
    for dyad, sine in reversed(list(zip(joints.dyads, pose.sines, strict=True))):
        first, second = pose.links[dyad.first], pose.links[dyad.second]
        for angle, k1, k2 in zip(q, first.jacobian, second.jacobian, strict=True):
            slope = (ZERO if model.links[dyad.second].slides else k2) - k1
            # The coordinates are those of a change point, rounded.
            require(abs(sine) > _ROUNDING * abs(slope) * (1 + abs(angle)), joints.refuse, *q)
        balance.solve(dyad, sine)
    for j in reversed(range(len(pose.links))):
        balance.complete(j)
    forces = tuple(balance.forces[pin.name] for pin in joints.pins)
    torque = balance.moment(0, Vector(ZERO, ZERO))
    guides, shaking, moment = balance.on_frame()
    return forces, guides, shaking, moment - torque, torque


class _Balance:
    """Newton's and Euler's equations of all links, solved pin by pin.

    Attributes:
        forces: Forces in the solved pins by name, of the first link on the second.
    """

    def __init__(
        self,
        model: Model,
        joints: Joints,
        pose: Pose,
        rates: Sequence[Real],
        changes: Sequence[Real],
    ) -> None:
        self._links, self._pins = model.links, joints.pins
        self._directions = [link.direction for link in pose.links]
        self._place = {
            pin.name: place.follow(self._directions, rates, changes)[0]
            for pin, place in zip(joints.pins, joints.places, strict=True)
        }
        pushes = [ZERO] * len(model.links)
        self._resistance = [ZERO] * len(model.links)
        for load in model.loads:
            for j, force in load.forces(pose.links, rates).items():
                pushes[j] += force
            held = load.resistance(pose.links, rates) if hasattr(load, 'resistance') else {}
            for j, force in held.items():
                self._resistance[j] += force
        self._centers, self._needed, self._couples = [], [], []
        for body, direction, push, change in zip(
            model.links, self._directions, pushes, changes, strict=True
        ):
            center, _, acceleration = body.center.follow(self._directions, rates, changes)
            force = (acceleration - model.gravity) * body.mass
            self._centers.append(center)
            self._needed.append(force - direction * push if body.slides else force)
            self._couples.append(ZERO if body.slides else body.inertia * change - push)
        self.forces: dict[str, Vector] = {}

    def _known(self, j: int) -> list[tuple[Vector, Vector]]:
        """Places and values of the known pin forces on a link."""
        return [
            (self._place[pin.name], force if pin.second == j else -force)
            for pin in self._pins
            if j in (pin.first, pin.second) and (force := self.forces.get(pin.name))
        ]

    def _rest(self, j: int) -> Vector:
        """The force that must still act on a link."""
        rest = self._needed[j]
        for _, force in self._known(j):
            rest = rest - force
        return rest

    def moment(self, j: int, about: Vector) -> Real:
        """The moment that must still act on a link, about a point."""
        moment = self._couples[j] + cross(self._centers[j] - about, self._needed[j])
        for place, force in self._known(j):
            moment = moment - cross(place - about, force)
        return moment

    def solve(self, dyad: Dyad, sine: Real) -> None:
        """Finds the force in the inner pin from the moments about the outer pins."""
        inner = self._place[dyad.pin]
        first, second = self._directions[dyad.first], self._directions[dyad.second]
        outer = self._place[dyad.outer[0]]
        across_first = -self.moment(dyad.first, outer) / dot(inner - outer, first)
        if self._links[dyad.second].slides:
            across_second = -dot(self._rest(dyad.second), second)
            second = second.left()
        else:
            outer = self._place[dyad.outer[1]]
            across_second = self.moment(dyad.second, outer) / dot(inner - outer, second)
        self.forces[dyad.pin] = (second * across_first - first * across_second) * (1.0 / sine)

    def complete(self, j: int) -> None:
        """Finds the force in the one pin of a link that is not solved yet."""
        pins = [pin for pin in self._pins if j in (pin.first, pin.second)]
        unknown = [pin for pin in pins if pin.name not in self.forces]
        if unknown and not self._links[j].slides:
            (pin,), rest = unknown, self._rest(j)
            self.forces[pin.name] = rest if pin.second == j else -rest

    def on_frame(self) -> tuple[tuple[Real, ...], Vector, Real]:
        """The forces of the guides on their sliders; force and moment about A0 on the frame."""
        guides, shaking, moment = [], Vector(ZERO, ZERO), ZERO
        for j, body in enumerate(self._links):
            resistance = self._resistance[j]
            if body.slides:
                guide = self._directions[j]
                guides.append(dot(guide.left(), self._rest(j)))
                force = -(guide * resistance + guide.left() * guides[-1])
                shaking += force
                moment += cross(self._centers[j], force)
            else:
                moment -= resistance
        for pin in self._pins:
            if pin.first is None:
                force = self.forces[pin.name]
                shaking, moment = shaking - force, moment - cross(self._place[pin.name], force)
        return tuple(guides), shaking, moment
