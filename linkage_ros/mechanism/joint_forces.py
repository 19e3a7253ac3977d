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
from linkage_ros.mechanism.structure import DyadLinks, Link, Pin
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


class JointForces(NamedTuple):
    """The values of `Reactions`, in the order of pins and sliding links.

    Attributes:
        pins: Forces in the pins, N.
        guides: Normal forces of the guides, N.
        shaking_force: See `Reactions`, as for the next two.
        shaking_moment: Moment on the frame, N m.
        torque: Driving torque, N m, or force, N.
        moments: Moments of the guides, N m.
    """

    pins: tuple[Vector, ...]
    guides: tuple[Real, ...]
    shaking_force: Vector
    shaking_moment: Real
    torque: Real
    moments: tuple[Real, ...]


def reactions(
    model: Model,
    q: Sequence[Real],
    u: Sequence[Real],
    a: Sequence[Real],
    environment: Environment = AT_REST,
) -> JointForces:
    """Computes the joint forces of a moving mechanism.

    The forces grow without bound near a change point or a limit of the crank.
    """
    outside = leaves(environment)
    require(is_finite(*q, *u, *a, *outside), model.refuse, *q, *u, *a, *outside)
    pose = model.loop.pose(tuple(q))
    rates, changes = velocities(pose, u), accelerations(pose, u, a)
    balance = _Balance(model.within(environment), pose, rates, changes)
    shaking_force = balance.force_of_all()
    # Each dyad carries the later ones, so the last one is solved first.
    for dyad, sine in reversed(list(zip(model.dyads, pose.sines, strict=True))):
        _require_finite_forces(model, q, pose, dyad, sine)
        i, j = dyad
        balance.solve_dyad(i, j, sine)
        balance.solve_last_pin(j)
        balance.solve_last_pin(i)
    for j in reversed(range(len(pose.links))):
        balance.solve_last_pin(j)
    guides = [balance.guide(j) for j, link in enumerate(model.links) if link.slides]
    torque, lever = balance.drive(model.driven)
    return JointForces(
        pins=tuple(balance.forces[pin.name] for pin in model.pins),
        guides=tuple(guide.force for guide in guides),
        shaking_force=shaking_force,
        shaking_moment=-balance.moment(_FRAME) - lever * torque,
        torque=torque,
        moments=tuple(guide.moment for guide in guides),
    )


def _require_finite_forces(
    model: Model, q: Sequence[Real], pose: Pose, dyad: DyadLinks, sine: Real
) -> None:
    """Rejects coordinates within rounding errors of one at which a dyad is in line."""
    columns = zip(*(link.jacobian for link in pose.links), strict=True)
    for coordinate, column in zip(q, columns, strict=True):
        first, second = dyad_lines(model, pose, column, dyad)
        size = abs(coordinate) if model.links[model.driven].slides else 1 + abs(coordinate)
        rounding = _ULPS * abs(second.rate - first.rate) * size  # of the sine
        require(abs(sine) > rounding, model.refuse_forces, *q)


class _AppliedForce(NamedTuple):
    """A known force on a body, N, and its point of application, m."""

    point: Vector
    force: Vector


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
        self._guides: dict[int, GuideForce] = {}
        self._links, self._pins, self._poses = model.links, model.pins, pose.links
        self._directions = [link.direction for link in pose.links]
        self._positions = {
            pin.name: point.motion(self._directions, rates, changes)[0]
            for pin, point in zip(model.pins, model.pin_points, strict=True)
        }
        # For each body, the known forces and the known couple.
        bodies = len(model.links) + 1
        self._applied: list[list[_AppliedForce]] = [[] for _ in range(bodies)]
        self._couples = [ZERO] * bodies
        # For each sliding link, its pin, through which the forces along and across its guide pass.
        self._guide_pins: dict[int, Vector] = {}
        pin_of = {pin.second: pin.name for pin in model.pins}
        for j, body in enumerate(model.links):
            center, _, acceleration = body.center.motion(self._directions, rates, changes)
            # Following d'Alembert, inertia is included as reversed forces and couples.
            self._applied[j].append(
                _AppliedForce(center, (model.gravity - acceleration) * body.mass)
            )
            spin = spin_of(model.links, j)
            change = ZERO if spin is None else changes[spin]
            self._couples[j] = self._couples[j] - body.inertia * change
            if body.slides:
                self._guide_pins[j] = self._positions[pin_of[j]] if j in pin_of else center
        for load in model.loads:
            for wrench in load.wrenches(pose.links, rates):
                self._exert(wrench, pose.links)

    def _exert(self, wrench: Wrench, links: Sequence[LinkPose]) -> None:
        """Adds a wrench to the balances of its body and of the body that exerts it, if any."""
        body = wrench.body
        self._add_effort(body, body, wrench.effort)
        if body != _FRAME and self._links[body].slides and not self._links[body].is_guided:
            # A rod is pushed by the barrel in which it slides.
            self._add_effort(self._parent(body), body, -wrench.effort)
        else:  # the frame takes its share of the effort
            self._add_effort(_FRAME, body, -wrench.by_frame)
        self._couples[body] = self._couples[body] + wrench.couple
        if wrench.point is not None:
            self._push(body, place(wrench.point, links), wrench.force)

    def _push(self, body: int, at: Vector, force: Vector) -> None:
        """Adds a force at a point of a body; the guide of a guided link takes its moment."""
        if body != _FRAME and self._links[body].is_guided:
            pin = self._guide_pins[body]
            if at is not pin:
                self._couples[body] = self._couples[body] + cross(at - pin, force)
            at = pin
        self._applied[body].append(_AppliedForce(at, force))

    def _add_effort(self, body: int, j: int, effort: Real) -> None:
        """Adds an effort of link j to a body: a force along the guide or, if j turns, a couple."""
        if j == _FRAME or not self._links[j].slides:
            self._couples[body] = self._couples[body] + effort
        elif effort is not ZERO:
            self._push(body, self._guide_pins[j], self._directions[j] * effort)

    def _parent(self, j: int) -> int:
        """Returns the body on which a link slides."""
        parent = self._links[j].parent
        return _FRAME if parent is None else parent

    def force(self, j: int) -> Vector:
        """Returns the force, N, that is missing from the force balance of body j."""
        return -_sum(self._applied[j])

    def force_of_all(self) -> Vector:
        """Returns the sum of the known forces on all bodies, N; joint forces cancel in it."""
        return _sum([*itertools.chain.from_iterable(self._applied)])

    def moment(self, j: int, about: Vector = _ORIGIN) -> Real:
        """Returns the moment, N m, that is missing from the moment balance of body j."""
        moments = (cross(applied.point - about, applied.force) for applied in self._applied[j])
        return -(self._couples[j] + total(moments))

    def _add_pin_force(self, pin: Pin, force: Vector) -> None:
        """Adds a pin force to both of the pin's links."""
        self.forces[pin.name] = force
        self._push(pin.second, self._positions[pin.name], force)
        first = _FRAME if pin.first is None else pin.first
        self._push(first, self._positions[pin.name], -force)

    def solve_dyad(self, i: int, j: int, sine: Real) -> None:
        """Computes the force in the common pin of a dyad from the moments about its outer pins.

        Args:
            i: Index of the dyad's first link.
            j: Index of its second link.
            sine: See `Pose.sines`.
        """
        last = self._links[j]
        if last.slides and last.parent == i:
            self._solve_cylinder(i, j)
            return
        (pin,) = self._pins_of(i) & self._pins_of(j)
        at, first = self._positions[pin.name], self._directions[i]
        # The force is that of the first link on the second.
        across_first = -self._across(i, pin)
        # A link that slides on a later link is the rod of a driven cylinder.
        carrier = last.parent if last.slides else None
        barrel = carrier if carrier is not None and carrier > i else None
        if barrel is not None:
            second, across_second = self._across_barrel(barrel, j, at)
        elif last.slides:  # a guide exerts no force along itself
            across_second = -dot(self.force(j), self._directions[j])
            second = self._directions[j].left()
        else:
            second, across_second = self._directions[j], self._across(j, pin)
        force = (second * across_first - first * across_second) * (1.0 / sine)
        self._add_pin_force(pin, force)
        if barrel is not None:
            self._drive_cylinder(barrel, j)
        if carrier is not None:
            self.guide(j)

    def _across(self, j: int, pin: Pin) -> Real:
        """Returns the force in a pin across link j, N, from the moments about its other pin."""
        (outer_pin,) = self._pins_of(j) - {pin}
        outer = self._positions[outer_pin.name]
        arm = self._positions[pin.name] - outer
        return self.moment(j, outer) / dot(arm, self._directions[j])

    def _drive_cylinder(self, barrel: int, rod: int) -> None:
        """Adds the driving force between barrel and rod, from the force balance of the rod."""
        self.driving_force = dot(self._directions[rod], self.force(rod))
        self._add_effort(rod, rod, self.driving_force)
        self._add_effort(barrel, rod, -self.driving_force)

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

    def _solve_cylinder(self, i: int, j: int) -> None:
        """Computes the forces in the pin and in the guide of a link j that slides on a link i.

        The force balance of link j gives the component along the guide, and the moments of both
        links about the pivot of link i give the component across it.
        """
        (pin,), (pivot,) = self._pins_of(j), self._pins_of(i)
        axis, origin = self._directions[j], cast('Any', self._links[j].origin)
        along = dot(axis, self.force(j))
        about = self._positions[pivot.name]
        moment = self.moment(i, about) + self.moment(j, about)
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
        if not self._links[j].is_guided:
            return self.driving_force, ZERO
        axis = self._directions[j]
        return dot(axis, self.force(j)), cross(self._guide_pins[j], axis)

    def guide(self, j: int) -> GuideForce:
        """Computes the force and the moment of a guide on its slider, and adds them to its body.

        The first call computes them; later calls return the same result.
        """
        if j in self._guides:
            return self._guides[j]
        across, pin, body = self._directions[j].left(), self._guide_pins[j], self._parent(j)
        force = dot(across, self.force(j))
        # All forces on a guided link pass through its pin.
        moment = -self._couples[j] if body == _FRAME else self.moment(j, pin)
        self._push(body, pin, across * -force)
        self._couples[body] = self._couples[body] - moment
        self._guides[j] = GuideForce(force, moment)
        return self._guides[j]


def _sum(applied: Sequence[_AppliedForce]) -> Vector:
    """Returns the sum of forces, N."""
    return Vector(total(one.force.x for one in applied), total(one.force.y for one in applied))


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
        reactions: Forces under these loads.
        loads: What the previous forces cause, for each of `Model.joint_loads`.
        search: Input of the next round; unchanged if the forces have converged.
        left: 0 if the forces have converged, 1 if more rounds are needed, -1 if friction locks
            the mechanism.
    """

    rows: Rows
    reactions: JointForces
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
    """Computes the state under the loads caused by given joint forces, and one Newton step."""
    if outside := leaves(environment):
        require(is_finite(*outside), model.refuse, *q, *u, *a, *outside)
    model = model.within(environment)
    rates = velocities(model.loop.pose(tuple(q)), u)
    contacts_by_load = _contacts(model, rates)
    contacts = [*itertools.chain(*contacts_by_load)]
    caused = functools.partial(_caused_loads, share=search.share, links=model.links)
    remaining_sizes = iter(search.sizes)
    loads = tuple(
        caused(own, sizes=[*itertools.islice(remaining_sizes, len(own))])
        for own in contacts_by_load
    )
    loaded = model._replace(loads=(*model.loads, *loads))
    under_loads = reactions(loaded, q, u, a)

    # R_km: the force in joint k under the loads caused by a force of 1 N in joint m alone.
    nothing: Any = ZERO
    massless_links = tuple(link._replace(mass=nothing, inertia=nothing) for link in model.links)
    weightless = model._replace(links=massless_links, gravity=Vector(ZERO, ZERO))
    slopes = []
    for m in range(len(contacts)):
        unit_sizes = [1.0 if k == m else ZERO for k in range(len(contacts))]
        unit_load = caused(contacts, sizes=unit_sizes)
        under_unit_load = reactions(weightless._replace(loads=(unit_load,)), q, u, a)
        slopes.append(_forces(model, contacts, under_unit_load))
    next_search, left = _newton_step(search, _forces(model, contacts, under_loads), slopes)
    return Round(state(loaded, q, u, a), under_loads, loads, next_search, left)


def _contacts(model: Model, rates: Sequence[Real]) -> list[list[Contact]]:
    return [load.contacts(model.pins, model.links, rates) for load in model.joint_loads]


def _caused_loads(
    contacts: Sequence[Contact], sizes: Sequence[Real], share: Real, links: Sequence[Link]
) -> FoundLoad:
    """Computes the loads caused by forces of given magnitudes; `share` scales the coefficients."""
    inner, outer, couples = ([ZERO] * len(links) for _ in range(3))
    for contact, size in zip(contacts, sizes, strict=True):
        for j, lever in contact.levers.items():
            is_in_pin_of_slider = links[j].slides and contact.joint != links[j].name
            if is_in_pin_of_slider:
                row = couples
            elif len(contact.levers) > 1:  # between two moving links
                row = inner
            else:
                row = outer
            row[j] = row[j] + lever * (share * size)
    return FoundLoad(tuple(inner), tuple(outer), tuple(couples))


def _forces(model: Model, contacts: Sequence[Contact], found: JointForces) -> list[Vector]:
    """Returns the force, N, in the joint of each contact."""
    force_in = {pin.name: force for pin, force in zip(model.pins, found.pins, strict=True)}
    sliding = [link.name for link in model.links if link.slides]
    for name, normal_force in zip(sliding, found.guides, strict=True):
        force_in.setdefault(name, Vector(normal_force, ZERO))
    return [force_in[contact.joint] for contact in contacts]


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
    matrix = []
    for k, (force, size) in enumerate(zip(forces, sizes, strict=True)):
        divisor = where(size > 0, size, 1.0)
        growths = [dot(force, slope[k]) / divisor for slope in slopes]  # of s_k with each s_m
        matrix.append([(1.0 if k == m else ZERO) - x for m, x in enumerate(growths)])
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
        for below in rows[i + 1 :]:
            below[i:] = [x - below[i] * y for x, y in zip(below[i:], row[i:], strict=True)]
    solution: list[Real] = []  # from the last unknown to the first
    for i, (*row, side) in reversed(list(enumerate(rows))):
        known = total(x * y for x, y in zip(row[i + 1 :], reversed(solution), strict=True))
        solution.append(side - known)
    return where(whole < least, whole, least), tuple(reversed(solution))


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
    is_close = change <= where(shrinks, _CHANGE, _ROUNDING) * largest
    grown = share - search.solved
    further = share + 2.0 * grown
    moved = tuple(map(operator.add, search.sizes, steps))
    is_part = share < 1

    # Converged at this share: go on with a larger share, or end.
    sizes = tuple(where(is_part, *pair) for pair in zip(moved, search.sizes, strict=True))
    converged = (
        Search(
            share=where(further < 1, further, 1.0),
            solved=share,
            change=where(is_part, math.inf, search.change),
            sizes=sizes,
            known=moved,
        ),
        where(is_part, 1.0, 0.0),
    )
    # The changes shrink: another round at the same share.
    approaching = search._replace(change=change, sizes=moved), 1.0
    # They do not: back to a smaller share or, if the step is too small, a lock.
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

    def selected(if_converged: Any, if_approaching: Any, if_failed: Any) -> Any:
        """Selects each number of nested tuples by what has happened."""
        if isinstance(if_failed, tuple):
            return tuple(map(selected, if_converged, if_approaching, if_failed))
        if_regular = where(is_close, if_converged, where(shrinks, if_approaching, if_failed))
        return where(whole > _SINGULAR, if_regular, if_failed)

    next_search, left = selected(converged, approaching, failed)
    return Search(*next_search), left


def _largest(values: Sequence[Real]) -> Real:
    return functools.reduce(lambda x, y: where(x > y, x, y), values)
