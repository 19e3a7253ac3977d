# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Joint forces, and loads that they cause, such as dry friction.

Virtual power gives the driving torque without the joint forces, so they are computed only on
request, from the Newton-Euler equations of each body. For each dyad, the moment balances of its
two links about their outer pins give the force in the common pin. The force balance of each link
then gives its remaining pin force. Finally, the moment balance of the crank gives the driving
torque, independently of virtual power.

For a given motion, the joint forces are linear in the loads that they cause:
F_k = F0_k + sum_m R_km s_m. Here s_m is the magnitude of the force in joint m, and R_km is
proportional to the coefficients of friction. Newton's method solves s_k = |F_k|. Its matrix,
1_km - F_k . R_km / |F_k|, has determinant 1 without friction.

Several solutions may exist. The correct one is reached continuously from the frictionless forces
as the coefficients grow; the determinant stays positive along this path. Where the determinant
reaches 0, the forces become infinite or cease to exist: the mechanism is self-locking.
"""

import functools
import itertools
import math
import operator
from collections.abc import Sequence
from typing import Any, NamedTuple, cast

from linkage_ros.formulas import (
    ZERO,
    Vector,
    cross,
    dot,
    is_finite,
    number,
    require,
    sqrt,
    total,
    where,
)
from linkage_ros.mechanism.axes import spin_of
from linkage_ros.mechanism.equations import (
    AT_REST,
    Environment,
    Model,
    accelerations,
    determinant,
    dyad_lines,
    solved,
    state,
    velocities,
)
from linkage_ros.mechanism.kinematics import LinkPose, Pose, Rows
from linkage_ros.mechanism.loads.base import Contact
from linkage_ros.mechanism.nested import leaves
from linkage_ros.mechanism.structure import Link, Pin
from linkage_ros.mechanism.wrenches import FRAME, Wrench, place
from linkage_ros.numeric import Real

# Relative to the coordinate, because a double can only approximate a change point: k * math.pi is
# up to 2 ulp from it.
_ULPS = 2.0**-51
_CHANGE = 1e-12  # convergence tolerance for a round's changes, relative to the largest force
_ROUNDING = 1e-6  # the same tolerance, used once rounding errors keep the changes from shrinking
_SINGULAR = 1e-12  # a determinant below this is only rounding error
_CRAMER = 5  # largest number of contacts for Cramer's rule, whose cost doubles with each
_STEP = 1e-9  # smallest step of the coefficients, as a fraction of their full values
_ORIGIN = Vector(ZERO, ZERO)
_FRAME = FRAME  # also the index of the last body


class GuideForce(NamedTuple):
    """The force and the moment of a guide on its slider, or of a barrel on the rod in it.

    Attributes:
        force: Normal force, positive to the left of the guide's direction, N.
        moment: Moment about the slider's pin, N m.
    """

    force: Real
    moment: Real


class Reactions(NamedTuple):
    """Joint forces in the axes of base_link; floats or arrays, as in the state.

    Attributes:
        pins: Forces (x, y), N, by pin name. 'A0' is the force of the frame on the crank, 'A' of
            the crank on the coupler or on the rod of a cylinder, 'B' of the coupler on the rocker,
            rod or slider, 'B0' of the frame on the rocker or barrel, and 'D' of the rod on the
            slider.
        guides: Forces of the guides, by the name of the sliding link.
        shaking_force: Force (x, y) of bearings and guide on the frame, N. It includes an external
            force on the slider, because that force originates outside the machine.
        shaking_moment: Moment on the frame about A0, including the drive's reaction, N m.
        torque: Driving torque from the moment balance of the crank, N m; if a rod or slider is
            driven, the force along its guide from its force balance, N.
    """

    pins: dict[str, Vector]
    guides: dict[str, GuideForce]
    shaking_force: Vector
    shaking_moment: Real
    torque: Real


def reactions(
    model: Model,
    q: Sequence[Real],
    u: Sequence[Real],
    a: Sequence[Real],
    environment: Environment = AT_REST,
) -> tuple[tuple[Vector, ...], tuple[Real, ...], Vector, Real, Real, tuple[Real, ...]]:
    """Computes the joint forces of a moving mechanism, in the order of the fields of `Reactions`.

    The moments of the guides are the last item. The forces grow without bound near a change point
    or a limit of the crank.
    """
    outside = leaves(environment)
    require(is_finite(*q, *u, *a, *outside), model.refuse, *q, *u, *a, *outside)
    pose = model.loop.pose(tuple(q))
    rates, changes = velocities(pose, u), accelerations(pose, u, a)
    balance = _Balance(model.within(environment), pose, rates, changes)
    shaking_force = balance.force_of_all()
    for dyad, sine in reversed(list(zip(model.dyads, pose.sines, strict=True))):
        columns = zip(*(link.jacobian for link in pose.links), strict=True)
        for angle, column in zip(q, columns, strict=True):
            (_, k1), (_, k2) = dyad_lines(model, pose, column, dyad)
            # Reject coordinates within rounding errors of a change point.
            size = abs(angle) if model.links[model.driven].slides else 1 + abs(angle)
            near = _ULPS * abs(k2 - k1) * size
            require(abs(sine) > near, model.refuse_forces, *q)
        i, j = dyad
        balance.solve(i, j, sine)
        balance.solve_last_pin(j)
        balance.solve_last_pin(i)
    for j in reversed(range(len(pose.links))):
        balance.solve_last_pin(j)
    sliding = [j for j, link in enumerate(model.links) if link.slides]
    guides, moments = zip(*map(balance.guide, sliding), strict=True) if sliding else ((), ())
    torque, lever = balance.drive(model.driven)
    forces = tuple(balance.forces[pin.name] for pin in model.pins)
    shaking_moment = -balance.moment(_FRAME) - lever * torque
    return forces, guides, shaking_force, shaking_moment, torque, moments


class _Balance:
    """Newton-Euler equations of all bodies: the links and, as the last body, the frame.

    Attributes:
        forces: Known pin forces, by pin name. The pin's first link exerts the force on its second
            link.
        driving_force: Force of a driven cylinder, N.
    """

    def __init__(
        self,
        model: Model,
        pose: Pose,
        rates: Sequence[Real],
        changes: Sequence[Real],
    ) -> None:
        self.forces: dict[str, Vector] = {}
        self.driving_force: Real = ZERO
        self._guides: dict[int, tuple[Real, Real]] = {}
        self._links, self._pins, self._poses = model.links, model.pins, pose.links
        self._directions = [link.direction for link in pose.links]
        self._positions = {
            pin.name: place.motion(self._directions, rates, changes)[0]
            for pin, place in zip(model.pins, model.pin_points, strict=True)
        }
        # For each body, the known forces with their points of application, and the known couple.
        # Following d'Alembert, inertia is included as reversed forces and couples.
        self._known: list[list[tuple[Vector, Vector]]] = [[] for _ in (*model.links, 'frame')]
        self._couples = [ZERO] * len(self._known)
        # For each sliding link, its pin, through which the forces along and across its guide pass.
        self._slid: dict[int, Vector] = {}
        for j, body in enumerate(model.links):
            center, _, acceleration = body.center.motion(self._directions, rates, changes)
            self._known[j].append((center, (model.gravity - acceleration) * body.mass))
            spin = spin_of(model.links, j)
            change = ZERO if spin is None else changes[spin]
            self._couples[j] = self._couples[j] - body.inertia * change
            if body.slides:
                self._slid[j] = center
        for pin in model.pins:
            if model.links[pin.second].slides:
                self._slid[pin.second] = self._positions[pin.name]
        for load in model.loads:
            for wrench in load.wrenches(pose.links, rates):
                self._exert(wrench, pose.links)

    def _exert(self, wrench: Wrench, links: Sequence[LinkPose]) -> None:
        """Adds a wrench to the balances of its body and of the body that exerts it, if any."""
        body, effort, held, force, point, couple = wrench
        self._add_effort(body, body, effort)
        if body != _FRAME and self._links[body].slides and not self._links[body].is_guided:
            self._add_effort(self._parent(body), body, -effort)
        else:
            self._add_effort(_FRAME, body, -held)
        self._couples[body] = self._couples[body] + couple
        if point is None:
            return
        self._push(body, place(point, links), force)

    def _push(self, body: int, at: Vector, force: Vector) -> None:
        """Adds a force at a point of a body; the guide of a guided link takes its moment."""
        center = self._slid[body] if body != _FRAME and self._links[body].is_guided else at
        if at is not center:
            self._couples[body] = self._couples[body] + cross(at - center, force)
        self._known[body].append((center, force))

    def _add_effort(self, body: int, j: int, effort: Real) -> None:
        """Adds a load of link j to a body: a force along the guide or, if j turns, a couple."""
        if j == _FRAME or not self._links[j].slides:
            self._couples[body] = self._couples[body] + effort
        elif effort is not ZERO:
            self._push(body, self._slid[j], self._directions[j] * effort)

    def _parent(self, j: int) -> int:
        """Returns the body on which a link slides."""
        parent = self._links[j].parent
        return _FRAME if parent is None else parent

    def force(self, j: int) -> Vector:
        """Returns the force, N, that is missing from the force balance of body j."""
        return -Vector(*map(total, zip(*(force for _, force in self._known[j]), strict=True)))

    def force_of_all(self) -> Vector:
        """Returns the sum of the known forces on all bodies, N; joint forces cancel in it."""
        known = itertools.chain.from_iterable(self._known)
        return Vector(*map(total, zip(*(force for _, force in known), strict=True)))

    def moment(self, j: int, about: Vector = _ORIGIN) -> Real:
        """Returns the moment, N m, that is missing from the moment balance of body j."""
        return -(
            self._couples[j]
            + total(cross(place - about, force) for place, force in self._known[j])
        )

    def _add_pin_force(self, pin: Pin, force: Vector) -> None:
        """Adds a pin force to both of the pin's links."""
        self.forces[pin.name] = force
        self._push(pin.second, self._positions[pin.name], force)
        first = _FRAME if pin.first is None else pin.first
        self._push(first, self._positions[pin.name], -force)

    def solve(self, i: int, j: int, sine: Real) -> None:
        """Computes the force in the common pin of a dyad from the moments about its outer pins."""
        own, others = self._pins_of(i), self._pins_of(j)
        if self._links[j].slides and self._links[j].parent == i:
            (pin,), (outer_pin,) = others, own
            self._solve_cylinder(i, j, pin, self._positions[outer_pin.name])
            return
        (pin,), (outer_pin,) = own & others, own - others
        inner, outer = self._positions[pin.name], self._positions[outer_pin.name]
        first, second = self._directions[i], self._directions[j]
        across_first = -self.moment(i, outer) / dot(inner - outer, first)
        slides, parent = self._links[j].slides, self._links[j].parent
        barrel = parent if slides and parent is not None and parent > i else None
        if barrel is not None:
            second, across_second = self._across_barrel(barrel, j, inner)
        elif slides:  # a guide exerts no force along itself
            across_second = -dot(self.force(j), second)
            second = second.left()
        else:
            (outer_pin,) = others - own
            outer = self._positions[outer_pin.name]
            across_second = self.moment(j, outer) / dot(inner - outer, second)
        force = (second * across_first - first * across_second) * (1.0 / sine)
        self._add_pin_force(pin, force)
        if barrel is not None:
            self.driving_force = along = dot(self._directions[j], self.force(j))
            self._add_effort(j, j, along)
            self._add_effort(barrel, j, -along)
        if slides and parent is not None:
            self.guide(j)

    def _across_barrel(self, barrel: int, rod: int, pin: Vector) -> tuple[Vector, Real]:
        """Returns the direction from a barrel's pivot to its rod's pin, and the force across it.

        Barrel and rod are one body for the moments about the pivot.
        """
        (pivot,) = self._pins_of(barrel)
        outer = self._positions[pivot.name]
        arm = pin - outer
        length = sqrt(dot(arm, arm))
        moment = self.moment(barrel, outer) + self.moment(rod, outer)
        return arm * (1.0 / length), moment / length

    def _solve_cylinder(self, i: int, j: int, pin: Pin, pivot: Vector) -> None:
        """Computes the forces in the pin and in the guide of a link j that slides on a link i.

        The force balance of link j gives the component along the guide, and the moments of both
        links about the pivot of link i give the component across it.
        """
        axis, origin = self._directions[j], cast('Any', self._links[j].origin)
        along = dot(axis, self.force(j))
        moment = self.moment(i, pivot) + self.moment(j, pivot)
        across = (moment + origin.y * along) / self._poses[j].position
        self._add_pin_force(pin, axis * along + axis.left() * across)
        self.guide(j)

    def _pins_of(self, j: int) -> set[Pin]:
        """Returns the pins of a link whose forces are unknown."""
        return {
            pin
            for pin in self._pins
            if j in (pin.first, pin.second) and pin.name not in self.forces
        }

    def solve_last_pin(self, j: int) -> None:
        """Computes a turning link's last unknown pin force, if any, from its force balance."""
        unknown = self._pins_of(j)
        if unknown and not self._links[j].slides:
            (pin,), force = unknown, self.force(j)
            self._add_pin_force(pin, force if pin.second == j else -force)

    def drive(self, j: int) -> tuple[Real, Real]:
        """Computes what drives a link, from the balance of that link.

        Returns:
            The torque, N m, or force, N; and the moment about A0 of a unit of it, which acts in
            reverse on the frame: 1 for a torque, ZERO if another link exerts the force.
        """
        if not self._links[j].slides:
            return self.moment(j), 1.0
        axis = self._directions[j]
        if not self._links[j].is_guided:
            return self.driving_force, ZERO
        return dot(axis, self.force(j)), cross(self._slid[j], axis)

    def guide(self, j: int) -> tuple[Real, Real]:
        """Computes the force and the moment of a guide on its slider; see `Reactions`."""
        if j not in self._guides:
            across, place, body = self._directions[j].left(), self._slid[j], self._parent(j)
            force = dot(across, self.force(j))
            # All forces on a guided link pass through its pin.
            moment = -self._couples[j] if body == _FRAME else self.moment(j, place)
            self._push(body, place, across * -force)
            self._couples[body] = self._couples[body] - moment
            self._guides[j] = force, moment
        return self._guides[j]


# Loads that joint forces cause.


class FoundLoad(NamedTuple):
    """The loads caused by joint forces, such as friction, as a `Load`.

    Attributes:
        inner: Torque on each link at its pins to other moving links, N m.
        outer: Load on each link from the frame: torque at a pin, N m, or force of a guide, N.
        couples: Torque on each link that slides on another link, at its pin, N m.
    """

    inner: tuple[Real, ...]
    outer: tuple[Real, ...]
    couples: tuple[Real, ...]

    def wrenches(self, _links: Sequence[LinkPose], _rates: Sequence[Real]) -> list[Wrench]:
        """See `Load`."""
        return [
            Wrench(j, inner + outer, outer, couple=couple)
            for j, (inner, outer, couple) in enumerate(zip(*self, strict=True))
        ]

    def potential(self, _links: Sequence[LinkPose]) -> Real:
        """Returns ZERO; see `Load`."""
        return ZERO


class Search(NamedTuple):
    """State of the iteration for the joint forces.

    Attributes:
        share: Fraction of the full coefficients used in this round, from 0 to 1.
        solved: Largest fraction for which the forces have converged.
        change: Largest change in the last round, N; inf before the first round of a fraction.
        sizes: Latest magnitudes of the forces in the joints that cause loads, N.
        known: Converged magnitudes of these forces at the fraction `solved`, N.
    """

    share: Any
    solved: Any
    change: Any
    sizes: tuple[Any, ...]
    known: tuple[Any, ...]


class Round(NamedTuple):
    """The result of one round, that is, one step of Newton's method.

    Attributes:
        rows: The rows of the state under the loads caused by the previous forces.
        reactions: Forces under these loads, in the order of the fields of `Reactions`.
        loads: What the previous forces cause, for each of `Model.joint_loads`.
        search: Input of the next round; unchanged if the forces have converged.
        left: 0 if the forces have converged, 1 if more rounds are needed, -1 if friction locks
            the mechanism.
    """

    rows: Rows
    reactions: tuple[Any, ...]
    loads: tuple[FoundLoad, ...]
    search: Search
    left: Real


def search_names(model: Model) -> Search:
    """Returns a `Search` of argument names for the program of `joint_load_round`."""
    contacts = [*itertools.chain(*_contacts(model, [0.0] * len(model.links)))]
    rows: list[Any] = [
        tuple(f'{word}_{i}_{contact.joint}' for i, contact in enumerate(contacts))
        for word in ('size', 'known')
    ]
    return Search('share', 'solved', 'change', *rows)


def joint_load_round(
    model: Model,
    q: Sequence[Real],
    u: Sequence[Real],
    a: Sequence[Real],
    search: Search,
    environment: Environment = AT_REST,
) -> Round:
    """Computes the state under the loads caused by given joint forces, and one Newton step.

    Args:
        model: Constants of the mechanism.
        q: Coordinates, rad or m.
        u: Rates of the coordinates.
        a: Accelerations of the coordinates.
        search: The joint forces from the previous round.
        environment: The external influences.

    Returns:
        The state, the forces, and the input of the next round.
    """
    if outside := leaves(environment):
        require(is_finite(*outside), model.refuse, *q, *u, *a, *outside)
    model = model.within(environment)
    rates = velocities(model.loop.pose(tuple(q)), u)
    contacts_by_load, sizes = _contacts(model, rates), iter(search.sizes)
    contacts = [*itertools.chain(*contacts_by_load)]
    exert = functools.partial(_caused_loads, share=search.share, links=model.links)
    loads = tuple(
        exert(own, sizes=[*itertools.islice(sizes, len(own))]) for own in contacts_by_load
    )
    loaded = model._replace(loads=(*model.loads, *loads))
    found = reactions(loaded, q, u, a)

    # R_km: the force in joint k under the loads caused by a force of 1 N in joint m.
    nothing: Any = ZERO
    links = tuple(link._replace(mass=nothing, inertia=nothing) for link in model.links)
    weightless = model._replace(links=links, gravity=Vector(ZERO, ZERO))
    everyone = range(len(contacts))
    units = [exert(contacts, sizes=[1.0 if k == m else ZERO for k in everyone]) for m in everyone]
    alone = [reactions(weightless._replace(loads=(unit,)), q, u, a) for unit in units]
    slopes = [_forces(model, contacts, one) for one in alone]
    ahead, left = _newton_step(search, _forces(model, contacts, found), slopes)
    return Round(state(loaded, q, u, a), found, loads, ahead, left)


def _contacts(model: Model, rates: Sequence[Real]) -> list[list[Contact]]:
    return [load.contacts(model.pins, model.links, rates) for load in model.joint_loads]


def _caused_loads(
    contacts: Sequence[Contact], sizes: Sequence[Real], share: Real, links: Sequence[Link]
) -> FoundLoad:
    """Computes the loads caused by forces of given magnitudes; `share` scales the coefficients."""
    inner, outer, couples = ([ZERO] * len(links) for _ in range(3))
    for contact, size in zip(contacts, sizes, strict=True):
        for j, lever in contact.levers.items():
            row = inner if len(contact.levers) > 1 else outer
            if links[j].slides and contact.joint != links[j].name:
                row = couples
            row[j] = row[j] + lever * (share * size)
    return FoundLoad(tuple(inner), tuple(outer), tuple(couples))


def _forces(model: Model, contacts: Sequence[Contact], found: tuple[Any, ...]) -> list[Vector]:
    """Returns the force, N, in the joint of each contact."""
    pins, guides, *_ = found
    names = [*(pin.name for pin in model.pins), *(x.name for x in model.links if x.slides)]
    forces = [*pins, *(Vector(guide, ZERO) for guide in guides)]
    return [forces[names.index(contact.joint)] for contact in contacts]


def _newton_step(
    search: Search, forces: Sequence[Vector], slopes: Sequence[Sequence[Vector]]
) -> tuple[Search, Real]:
    """Performs one step of Newton's method.

    Args:
        search: The iteration before the step.
        forces: F_k, the force in each joint, N.
        slopes: R_km, indexed [m][k].

    Returns:
        The iteration after the step, and `Round.left`.
    """
    sizes = [sqrt(dot(force, force)) for force in forces]
    matrix = [
        [
            (1.0 if k == m else ZERO) - dot(forces[k], row[k]) / where(sizes[k] > 0, sizes[k], 1.0)
            for m, row in enumerate(slopes)
        ]
        for k in range(len(forces))
    ]
    lacking = [found - size for found, size in zip(sizes, search.sizes, strict=True)]
    if len(matrix) > _CRAMER:
        whole, steps = _eliminated(matrix, lacking)
    else:
        whole = number(determinant(matrix))
        steps = solved(matrix, lacking, where(whole > _SINGULAR, whole, 1.0))
    return _next_round(search, steps, whole, _largest(sizes))


def _eliminated(
    matrix: Sequence[Sequence[Real]], right: Sequence[Real]
) -> tuple[Real, tuple[Real, ...]]:
    """Solves linear equations by elimination, in the order of the rows.

    Newton's matrix is the identity without friction. A pivot that reaches 0 as the coefficients
    grow is treated as a determinant of 0.

    Returns:
        The determinant or, if it is smaller, the smallest pivot; and the solution.
    """
    rows = [[*row, side] for row, side in zip(matrix, right, strict=True)]
    whole: Real = 1.0
    least: Real = 1.0
    for i, row in enumerate(rows):
        least = where(row[i] < least, row[i], least)
        whole = whole * row[i]
        pivot = where(row[i] > _SINGULAR, row[i], 1.0)
        row[i:] = [x / pivot for x in row[i:]]
        for other in rows[i + 1 :]:
            other[i:] = [x - other[i] * y for x, y in zip(other[i:], row[i:], strict=True)]
    found: list[Real] = []
    for i, row in reversed(list(enumerate(rows))):
        known = total(x * y for x, y in zip(row[i + 1 : -1], found, strict=True))
        found.insert(0, row[-1] - known)
    return where(whole < least, whole, least), tuple(found)


def _next_round(
    search: Search, steps: Sequence[Real], whole: Real, largest: Real
) -> tuple[Search, Real]:
    """Computes the input of the next round, and `Round.left`.

    Args:
        search: Input of this round.
        steps: Newton steps of the force magnitudes, N.
        whole: Determinant of Newton's matrix.
        largest: Magnitude of the largest force, N.
    """
    share, change = search.share, _largest([abs(step) for step in steps])
    shrinks = change < 0.5 * search.change
    close = change <= where(shrinks, _CHANGE, _ROUNDING) * largest
    grown = share - search.solved
    further = share + 2.0 * grown
    moved = tuple(map(operator.add, search.sizes, steps))
    is_part = share < 1

    # What follows if the forces have converged at this share, approach, or do not approach: a
    # larger share or the end, another round, or a smaller share or a lock.
    converged = (
        Search(
            share=where(further < 1, further, 1.0),
            solved=share,
            change=where(is_part, math.inf, search.change),
            sizes=tuple(where(is_part, *pair) for pair in zip(moved, search.sizes, strict=True)),
            known=moved,
        ),
        where(is_part, 1.0, 0.0),
    )
    approaching = search._replace(change=change, sizes=moved), 1.0
    failed = (
        Search(
            share=share - 0.5 * grown,
            solved=search.solved,
            change=math.inf,
            sizes=search.known,
            known=search.known,
        ),
        where(grown > _STEP, 1.0, -1.0),
    )

    def chosen(if_converged: Any, if_approaching: Any, if_failed: Any) -> Any:
        if isinstance(if_failed, tuple):
            return tuple(map(chosen, if_converged, if_approaching, if_failed))
        found = where(close, if_converged, where(shrinks, if_approaching, if_failed))
        return where(whole > _SINGULAR, found, if_failed)

    ahead, left = chosen(converged, approaching, failed)
    return Search(*ahead), left


def _largest(values: Sequence[Real]) -> Real:
    return functools.reduce(lambda x, y: where(x > y, x, y), values)
