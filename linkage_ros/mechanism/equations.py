# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Equations of motion by virtual power: driving torque or accelerations from pose and loads.

Every centre of mass is a fixed linear combination of the link directions, G = sum_j rho_j
e^(i phi_j) (+ constant). The power balance in Ghalbi 2019 and the virtual work in Deliu and Vlase
sum m v . a, J w eps and P . v over the bodies. These sums depend on the bodies only through the
constants

    C_jk = sum_bodies m conj(rho_j) rho_k  (+ J on the diagonal)      W_j = sum_bodies m rho_j,

which are computed once. With A + i B = C_jk e^(i (phi_k - phi_j)), the generalised inertia force
on link j is sum_k A phi_k'' - B phi_k'^2. A sliding link contributes its mass times its
acceleration. The forces of the loads are subtracted. Weighted with the jacobian and summed over
the links, these forces give M q'' + h - Q, which equals the driving torque for the crank and 0 for
undriven coordinates. Pin reactions do not appear.
"""

import itertools
import operator
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NamedTuple

from linkage_ros.formulas import (
    ZERO,
    Opaque,
    Vector,
    cos,
    cross,
    dot,
    is_finite,
    number,
    require,
    sin,
    sqrt,
    total,
    turned,
    where,
)
from linkage_ros.mechanism.axes import spin_of
from linkage_ros.mechanism.base import Mechanism
from linkage_ros.mechanism.kinematics import LinkPose, Loop, PointMotion, Pose, Rows
from linkage_ros.mechanism.loads.base import JointLoad, Load
from linkage_ros.mechanism.nested import leaves
from linkage_ros.mechanism.structure import DyadLinks, Link, Pin, Point, Structure
from linkage_ros.mechanism.turning_frame import TurningFrame
from linkage_ros.numeric import Real


class Environment(NamedTuple):
    """The numbers of `Conditions`: unlike constants, they are given for each state.

    Attributes:
        gravity: Acceleration of gravity, m/s^2; empty for that of the model.
        frame: Direction of base_link, rad, its rate, rad/s, and its acceleration, rad/s^2; empty
            if base_link is at rest.
        forces: Force (x, y), N, of each load in `Model.given`.
    """

    gravity: tuple[Real, ...] = ()
    frame: tuple[Real, ...] = ()
    forces: tuple[tuple[Real, ...], ...] = ()


AT_REST = Environment()


class Model(NamedTuple):
    """The constants used by the formulas of a mechanism.

    Attributes:
        loop: Kinematic constants.
        links: The moving links of the mechanism.
        pins: The pin joints; empty if joint forces are not supported.
        pin_points: The points of the pins, in the same order.
        dyads: The dyads in the chosen coordinates.
        other_dyads: The dyads in the mechanism's other coordinates.
        driven: Index of the driven link.
        gravity: Acceleration of gravity in the axes of base_link at direction 0, m/s^2.
        pivot: The point of base_link that is fixed in the world if it turns, m.
        loads: Loads on the links, except weights and `joint_loads`.
        joint_loads: Loads caused by joint forces, such as friction.
        given: Indices of the loads whose forces are in the environment, in the order there.
        refuse: Function that rejects q, u and a if a value or a result is not finite. None, here
            and in the next three attributes, accepts everything.
        refuse_torque: Function that rejects q, u and a torque if a value or a result is not
            finite.
        refuse_forces: Function that rejects q if the joint forces are infinite.
        massless: Function that rejects a mass matrix that is not positive definite.
    """

    loop: Loop
    links: tuple[Link, ...]
    pins: tuple[Pin, ...]
    pin_points: tuple[Point, ...]
    dyads: tuple[DyadLinks, ...]
    other_dyads: tuple[DyadLinks, ...]
    driven: int
    gravity: Vector
    pivot: Any
    loads: tuple[Load, ...]
    joint_loads: tuple[JointLoad, ...]
    given: tuple[int, ...] = ()
    refuse: Opaque | None = None
    refuse_torque: Opaque | None = None
    refuse_forces: Opaque | None = None
    massless: Opaque | None = None

    @classmethod
    def of(
        cls,
        mechanism: Mechanism,
        structure: Structure,
        loop: Loop | None = None,
        pivot: tuple[float, float] = (0.0, 0.0),
        **refusals: Any,
    ) -> 'Model':
        """Collects the constants of a mechanism.

        Args:
            mechanism: The mechanism, with its loads.
            structure: Links, points and joints of the mechanism.
            loop: Kinematic constants; by default, those in the mechanism's own coordinates.
            pivot: The point of base_link that is fixed in the world if it turns, m.
            **refusals: Functions that reject values, by field name; by default, all values are
                accepted.
        """
        return cls(
            loop or mechanism.chain(),
            structure.links,
            structure.pins,
            tuple(structure.points[pin.name] for pin in structure.pins),
            structure.dyads,
            structure.other_dyads,
            structure.driven,
            Vector(*mechanism.gravity),
            complex(*pivot),
            tuple(mechanism.link_loads().values()),
            tuple(mechanism.joint_loads().values()),
            **refusals,
        )

    def within(self, environment: Environment) -> 'Model':
        """Returns the model with the given gravity and forces, and loads of a turning frame."""
        if not any(environment):
            return self
        gravity = Vector(*environment.gravity) if environment.gravity else self.gravity
        loads: list[Any] = list(self.loads)
        for j, force in zip(self.given, environment.forces, strict=True):
            loads[j] = loads[j]._replace(force=Vector(*force))
        if environment.frame:
            angle, rate, change = environment.frame
            gravity = turned(gravity, cos(angle), -sin(angle))
            loads.append(TurningFrame(self.links, self.pivot, rate, change))
        return self._replace(gravity=gravity, loads=tuple(loads))

    def weight(self, j: int) -> Vector:
        """Returns conj(W_j) g as a vector, N m; for a guided link, m g, N."""
        if self.links[j].is_guided:
            return self.gravity * self.links[j].mass
        turning = (link for link in self.links if not link.is_guided)
        arm = total(link.center.weights[j] * link.mass for link in turning)
        return Vector(dot(arm, self.gravity), cross(arm, self.gravity))

    def coupling(self, j: int, k: int) -> Vector:
        """Returns C_jk as (real, imaginary), kg m^2; both ZERO if no body couples the links."""
        result = Vector(ZERO, ZERO)
        for link in self.links:
            if not link.is_guided:
                first, second = link.center.weights[j] * link.mass, link.center.weights[k]
                result += Vector(dot(first, second), cross(first, second))
        return result

    def inertia(self, j: int) -> Real:
        """Returns C_jj of a link, kg m^2; for a guided link, its mass, kg."""
        if self.links[j].is_guided:
            return self.links[j].mass
        turning = [k for k in range(len(self.links)) if spin_of(self.links, k) == j]
        return self.coupling(j, j).x + total(self.links[k].inertia for k in turning)

    def coupled(self, pose: Pose, j: int, k: int) -> tuple[Real, Real]:
        """Returns A and B, the real and imaginary parts of C_jk e^(i (phi_k - phi_j))."""
        coupling = self.coupling(j, k)
        first, second = pose.links[j].direction, pose.links[k].direction
        cos, sin = dot(first, second), cross(first, second)
        return coupling.x * cos - coupling.y * sin, coupling.x * sin + coupling.y * cos


def velocities(pose: Pose, u: Sequence[Real]) -> list[Real]:
    """Computes the velocity of each link, rad/s or m/s, from the rates of the coordinates."""
    return [_product(link.jacobian, u) for link in pose.links]


def accelerations(pose: Pose, u: Sequence[Real], a: Sequence[Real]) -> list[Real]:
    """Computes the acceleration of each link, rad/s^2 or m/s^2.

    If `a`, the accelerations of the coordinates, is empty, the rates `u` are constant.
    """
    products = [x * y for x, y in itertools.combinations_with_replacement(u, 2)]
    return [
        _product(link.curvature, products) + (_product(link.jacobian, a) if a else ZERO)
        for link in pose.links
    ]


def _product(row: Iterable[Real], column: Iterable[Real]) -> Real:
    return total(map(operator.mul, row, column))


def acting_forces(
    model: Model, links: Sequence[LinkPose], rates: Sequence[Real]
) -> Iterator[tuple[int, Real]]:
    """Yields the generalised forces of weights, then those of the loads, as for `balance`.

    The torque of the weights on a turning link is Re(conj(i W_j e^(i phi_j)) g). Of the poses,
    `position` and `direction` are used.

    Yields:
        Index of a link and torque on it, N m, or force along its guide, N.
    """
    for j, link in enumerate(links):
        product = dot if model.links[j].is_guided else cross
        yield j, product(link.direction, model.weight(j))
    for load in model.loads:
        for wrench in load.wrenches(links, rates):
            yield from wrench.generalised(model.links, links)


def balance(
    model: Model, pose: Pose, rates: Sequence[Real], changes: Sequence[Real]
) -> list[Real]:
    """Computes M q'' + h - Q, the generalised force required for the given accelerations.

    For the actual accelerations, the force on the first coordinate is the driving torque. For the
    accelerations at q'' = 0, the forces are h - Q.

    Args:
        model: Constants of the mechanism.
        pose: Positions of the links.
        rates: Velocity of each link, rad/s or m/s.
        changes: Acceleration of each link, rad/s^2 or m/s^2.

    Returns:
        The generalised force on each coordinate: N m for an angle, N for a slider's position.
    """
    forces = [model.inertia(j) * change for j, change in enumerate(changes)]  # on each link
    for j, force in acting_forces(model, pose.links, rates):
        forces[j] = forces[j] - force  # -= would modify an array
    for j, k in itertools.combinations(range(len(forces)), 2):
        A, B = model.coupled(pose, j, k)
        forces[j] = forces[j] + A * changes[k] - B * (rates[k] * rates[k])
        forces[k] = forces[k] + A * changes[j] + B * (rates[j] * rates[j])
    return [_product(column, forces) for column in _columns(pose)]


def mass_matrix(model: Model, pose: Pose) -> list[list[Real]]:
    """Computes the mass matrix M; see `Solver.matrix` for the units."""
    links, columns = range(len(pose.links)), _columns(pose)
    inertias = [[ZERO] * len(links) for _ in links]  # of the links, before the jacobian
    for j in links:
        inertias[j][j] = model.inertia(j)
    for j, k in itertools.combinations(links, 2):
        coupling, _ = model.coupled(pose, j, k)
        inertias[j][k] = inertias[k][j] = coupling
    momenta = [[_product(row, column) for row in inertias] for column in columns]
    coordinates = range(len(columns))
    # M is symmetric, so min and max let the tape share equal entries.
    return [
        [_product(columns[min(i, j)], momenta[max(i, j)]) for j in coordinates]
        for i in coordinates
    ]


def _columns(pose: Pose) -> list[tuple[Real, ...]]:
    """Returns the columns of the jacobian, one per coordinate."""
    return list(zip(*(link.jacobian for link in pose.links), strict=True))


def state(
    model: Model,
    q: Sequence[Real],
    u: Sequence[Real],
    a: Sequence[Real] = (),
    environment: Environment = AT_REST,
) -> Rows:
    """Computes the rows of a `State`; if `a` is empty, for q'' = 0."""
    outside = leaves(environment)
    require(is_finite(*q, *outside), model.refuse, *q, *u, *a, *outside)
    pose = model.loop.pose(tuple(q))
    rates, changes = velocities(pose, u), accelerations(pose, u, a)
    torque, *_ = balance(model.within(environment), pose, rates, changes)
    require(is_finite(torque, *changes, *u, *a), model.refuse, *q, *u, *a, *outside)
    positions = tuple(link.position for link in pose.links)
    return positions, tuple(rates), tuple(changes), torque


def torque(
    model: Model,
    q: Sequence[Real],
    u: Sequence[Real],
    a: Sequence[Real] = (),
    environment: Environment = AT_REST,
) -> tuple[Real]:
    """Computes the driving torque alone; if `a` is empty, for q'' = 0."""
    outside = leaves(environment)
    require(is_finite(*q, *outside), model.refuse, *q, *u, *a, *outside)
    pose = model.loop.pose(tuple(q))
    rates, changes = velocities(pose, u), accelerations(pose, u, a)
    driving_torque, *_ = balance(model.within(environment), pose, rates, changes)
    require(is_finite(driving_torque, *u, *a), model.refuse, *q, *u, *a, *outside)
    return (driving_torque,)


def forward(
    model: Model,
    q: Sequence[Real],
    u: Sequence[Real],
    torque: Real,
    environment: Environment = AT_REST,
) -> tuple[Real, ...]:
    """Solves M q'' + h - Q = torque * levers for q'', given the torque or force on a link.

    `levers` are the derivatives of the driven link's position with respect to the coordinates.
    """
    outside = leaves(environment)
    require(is_finite(*q, *outside), model.refuse_torque, *q, *u, torque, *outside)
    pose = model.loop.pose(tuple(q))
    rates, changes = velocities(pose, u), accelerations(pose, u, ())  # with q'' = 0
    h_minus_Q = balance(model.within(environment), pose, rates, changes)
    M, levers = mass_matrix(model, pose), pose.links[model.driven].jacobian
    M_times_a = [torque * lever - force for lever, force in zip(levers, h_minus_Q, strict=True)]
    inertia = number(determinant(M))
    require(inertia > 0, model.massless)
    result = solved(M, M_times_a, inertia)
    require(is_finite(*result, *u, torque), model.refuse_torque, *q, *u, torque, *outside)
    return result


def driven(
    constants: tuple[Model, Opaque],
    q: Sequence[Real],
    u: Sequence[Real],
    environment: Environment = AT_REST,
) -> tuple[Real, ...]:
    """Computes the accelerations under a torque that is a function of the driven link's rate."""
    model, torque = constants
    require(is_finite(*q), model.refuse, *q, *u)
    rates = velocities(model.loop.pose(tuple(q)), u)
    return forward(model, q, u, torque(rates[model.driven]), environment)


def driven_state(
    model: Model,
    q: Sequence[Real],
    u: Sequence[Real],
    torque: Real,
    environment: Environment = AT_REST,
) -> Rows:
    """Computes the rows of a `State` under a torque or force on the driven link."""
    a = forward(model, q, u, torque, environment)
    *rows, _ = state(model, q, u, a, environment)
    return *rows, torque


def solved(
    matrix: Sequence[Sequence[Real]], right: Sequence[Real], whole: Real
) -> tuple[Real, ...]:
    """Solves linear equations using Cramer's rule; `whole` is the determinant of the matrix."""
    solution = []
    for i in range(len(right)):
        rows = zip(matrix, right, strict=True)
        replaced = [[*row[:i], side, *row[i + 1 :]] for row, side in rows]
        solution.append(determinant(replaced) / whole)
    return tuple(solution)


def determinant(rows: Sequence[Sequence[Real]]) -> Real:
    """Computes a determinant by expansion along the first row."""
    if not rows:
        return 1.0
    result: Real = ZERO
    for i, factor in enumerate(rows[0]):
        term = factor * determinant([[*row[:i], *row[i + 1 :]] for row in rows[1:]])
        result = result - term if i % 2 else result + term
    return result


class DyadSine(NamedTuple):
    """The sine of the angle between the two links of a dyad.

    Attributes:
        sine: Absolute value of the sine; 0 if the links are in line.
        rate: Rate of change of the sine, 1/s.
    """

    sine: Real
    rate: Real


def dyad_sines(model: Model, q: Sequence[Real], u: Sequence[Real]) -> tuple[DyadSine, ...]:
    """Computes the sine of the angle between each dyad's links, and the rate of this sine.

    The dyads of the current coordinates come first, then those of the other coordinates.
    """
    pose = model.loop.pose(tuple(q))
    rates, sines = velocities(pose, u), []
    dyads = (*model.dyads, *model.other_dyads)
    # The pose has exact sines of the first dyads alone.
    for dyad, exact_sine in itertools.zip_longest(dyads, pose.sines):
        first, second = dyad_lines(model, pose, rates, dyad)
        cosine = dot(first.direction, second.direction)
        sine = exact_sine
        if sine is None:
            sine = cross(first.direction, second.direction)
        rate = cosine * (second.rate - first.rate)
        sines.append(DyadSine(abs(sine), where(sine >= 0, rate, -rate)))
    return tuple(sines)


class Line(NamedTuple):
    """The line of a dyad's link.

    Attributes:
        direction: Unit vector.
        rate: Angular velocity, rad/s, or its derivative with respect to a coordinate.
    """

    direction: Vector
    rate: Real


def dyad_lines(
    model: Model, pose: Pose, rates: Sequence[Real], dyad: DyadLinks
) -> tuple[Line, Line]:
    """Returns the lines of a dyad's two links, which are parallel where the dyad is in line.

    Args:
        model: Constants of the mechanism.
        pose: Positions of the links.
        rates: Velocities of the links, or their derivatives with respect to a coordinate.
        dyad: The two links; see `structure.DyadLinks`.
    """
    i, j = dyad
    last, direction = model.links[j], pose.links[j].direction
    first = Line(pose.links[i].direction, rates[i])
    if not last.slides:
        return first, Line(direction, rates[j])
    parent = last.parent
    if parent == i:  # an inner guide
        first = Line(-first.direction.left(), first.rate)
    if parent is None or parent < i:  # a guide solved before: the line is its normal
        spin = spin_of(model.links, j)
        return first, Line(direction.left(), ZERO if spin is None else rates[spin])
    # The line from the pivot of the link with the guide to the pin of the sliding link.
    origin: Any = last.origin  # a `Vector` in formulas
    along, across = pose.links[j].position, origin.y
    square = along * along + across * across
    length = sqrt(square)
    line = turned(direction, along / length, across / length)
    return first, Line(line, rates[parent] - across * rates[j] / square)


def point_motion(
    constants: tuple[Point, Opaque],
    angles: Sequence[Real],
    rates: Sequence[Real],
    changes: Sequence[Real],
) -> PointMotion:
    """Computes the motion of a point from the motion of all links."""
    point, refuse = constants
    require(is_finite(*angles, *rates, *changes), refuse, *angles, *rates, *changes)
    directions = [Vector.at(angle) for angle in angles]
    return PointMotion(*point.motion(directions, rates, changes))


def energy(
    model: Model, q: Sequence[Real], u: Sequence[Real], environment: Environment = AT_REST
) -> tuple[Real, Real]:
    """Computes the kinetic energy and the potential energy of weights and loads, J."""
    outside = leaves(environment)
    require(is_finite(*q, *u, *outside), model.refuse, *q, *u, *outside)
    model = model.within(environment)
    pose = model.loop.pose(tuple(q))
    kinetic = total(
        0.5 * mass * (u_i * u_j)
        for row, u_i in zip(mass_matrix(model, pose), u, strict=True)
        for mass, u_j in zip(row, u, strict=True)
    )
    of_weights = [
        -dot(link.direction, model.weight(j)) * (link.position if body.is_guided else 1.0)
        for j, (link, body) in enumerate(zip(pose.links, model.links, strict=True))
    ]
    of_loads = [load.potential(pose.links) for load in model.loads]
    potential = total([total(of_weights), *of_loads])
    require(is_finite(kinetic, potential), model.refuse, *q, *u, *outside)
    return kinetic, potential


def matrix(model: Model, q: Sequence[Real]) -> tuple[tuple[Real, ...], ...]:
    """Computes the mass matrix as a tuple of rows, one per coordinate."""
    require(is_finite(*q), model.refuse, *q)
    return tuple(map(tuple, mass_matrix(model, model.loop.pose(tuple(q)))))
