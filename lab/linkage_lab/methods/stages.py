# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Formulas from the crank angle of a linkage to position, velocity, acceleration and torque.

A method computes one stage; the package's own formulas compute the other stages. A method for
rates receives the position as unit vectors. After a method for positions, the 2x2 solve of Ghalbi
2019 and Redaelli 2024 computes rates that are consistent with these positions. The torque always
comes from the package's own formula. Every method can therefore be compared in the charts of its
own stage and of all later stages. All formulas are compiled to programs (mechanism/tracer.py), so
that the comparison is fair. The loop equation (Ghalbi 2019, eq. 7 and 8; Redaelli 2024, eq. 2) is:

    gap = r e^(i alpha) + b e^(i beta) - B(y) = 0

where B(gamma) = d e^(i delta) + c e^(i gamma) for a rocker, and B(x) = (x + i e) e^(i guide) for a
slider.
"""

import functools
import math
import operator
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, TypeAlias

from linkage_lab.reference.states import Linkage, lengths
from linkage_ros import OPEN
from linkage_ros.extensions import LinkPose, Pose
from linkage_ros.formulas import (
    ZERO,
    Opaque,
    Real,
    Vector,
    atan2,
    cos,
    cross,
    dot,
    sin,
    sqrt,
    turned,
)
from linkage_ros.internals import Model, torque

QUANTITIES = ('position', 'rate', 'acceleration', 'torque')
STATE, POSITION, RATES = 'state', 'position', 'rates'  # stages; POSITION is also a quantity
# Quantities that a method of each stage computes itself.
OWN = {STATE: QUANTITIES, POSITION: QUANTITIES[:1], RATES: QUANTITIES[1:3]}
SPEED, ACCELERATION = 5 * math.pi, 20.0  # of the crank, rad/s (150 rpm) and rad/s^2

# Direction of the coupler and position of the output, each an angle, rad, or a unit vector; the
# position of a slider is in m. The links of dyads follow, if the method solves them.
Pair: TypeAlias = Sequence[Any]
Locate: TypeAlias = Callable[[Real], Pair]  # from the crank angle


class Links(NamedTuple):
    """The constants of a four-bar or a slider-crank.

    Attributes:
        r: Length of the crank, m.
        b: Length of the coupler, m.
        c: Length of the rocker, m; None if the output slides.
        d: Length of the frame, or offset of a slider, m.
        angle: Angle of frame or guide, rad.
        side: 1.0 for the open assembly, -1.0 for the crossed one.
        model: The package's own constants.
        tool: Additional input of a method's formula: a number, or the functions of `looked_up`.
    """

    r: Real
    b: Real
    c: Real | None
    d: Real
    angle: Real
    side: Real
    model: Model
    tool: Any

    @classmethod
    def of(cls, mechanism: Linkage, tool: Any = None) -> 'Links':
        """Collects the constants of a linkage; `tool` is a number or a function of the angle."""
        r, b, c, d = lengths(mechanism)
        side = 1.0 if mechanism.assembly == OPEN else -1.0
        model = Model.of(mechanism, mechanism.structure())
        if callable(tool):  # a program calls it, and then takes each of its results
            takers = map(operator.itemgetter, range(len(model.links) - 1))
            tool = tuple(map(Opaque, (tool, *takers)))
        return cls(r, b, c, d, mechanism.frame.angle, side, model, tool)


@functools.cache
def formula(quantity: str, stage: str, solve: Callable[..., Any]) -> Callable[..., Any]:
    """Combines the stages up to a quantity; all stages but one are the package's own.

    Args:
        quantity: One of QUANTITIES.
        stage: The stage that is not the package's own.
        solve: Formula of the stage.

    Returns:
        A function of links and crank angle. Depending on the quantity, it returns the positions of
        coupler, output and links of dyads, their rates, their accelerations, or the driving
        torque, N m, in a tuple. A direction is an angle, rad, or the two components of a
        unit vector; the position of a slider is in m.
    """
    locate, differentiate = (solve, two_by_two) if stage == POSITION else (factored, solve)

    def solved(links: Links, crank: Real) -> tuple[Real, ...]:
        if stage == STATE:
            return _of_package(quantity, links, crank)
        if stage == POSITION and quantity == POSITION:
            return tuple(_numbers(solve(links, crank)))
        place, first, second = differentiate(links, crank, functools.partial(locate, links))
        pose = posed(links, crank, place, first, second)
        if quantity == 'torque':
            model = links.model._replace(loop=_Posed(pose))
            return torque(model, (crank,), (SPEED,), (ACCELERATION,))
        return _of_pose(quantity, place, pose)

    return solved


def _of_package(quantity: str, links: Links, crank: Real) -> tuple[Real, ...]:
    """Computes a quantity by the package's own formulas alone; see `formula`."""
    if quantity == 'torque':
        return torque(links.model, (crank,), (SPEED,), (ACCELERATION,))
    pose = links.model.loop.pose((crank,))
    return _of_pose(quantity, tuple(link.position for link in pose.links[1:]), pose)


def _of_pose(quantity: str, place: Pair, pose: Pose) -> tuple[Real, ...]:
    """Computes positions, rates or accelerations of all links but the crank.

    Args:
        quantity: 'position', 'rate' or 'acceleration'.
        place: Positions of the links.
        pose: The pose, with derivatives with respect to the crank angle.
    """
    links = pose.links[1:]
    if quantity == 'position':
        return tuple(_numbers(place))
    if quantity == 'rate':
        return tuple(link.jacobian[0] * SPEED for link in links)
    return tuple(
        link.curvature[0] * (SPEED * SPEED) + link.jacobian[0] * ACCELERATION for link in links
    )


class _Posed(NamedTuple):
    """A loop whose pose is known."""

    known: Pose

    def pose(self, _: tuple[Real, ...]) -> Pose:
        """Returns the pose."""
        return self.known


def _numbers(place: Pair) -> list[Real]:
    """Lists angles and the components of unit vectors."""
    return [x for part in place for x in (part if isinstance(part, tuple) else (part,))]


# ---------------------------------------------------------------- positions


def factored(links: Links, crank: Real) -> Pair:
    """Uses the package's own formula: sums of non-negative terms (transmission.py)."""
    poses = zip(links.model.links[1:], links.model.loop.pose((crank,)).links[1:], strict=True)
    return tuple(pose.position if link.slides else pose.direction for link, pose in poses)


def two_circles(links: Links, crank: Real) -> Pair:
    """Finds B by intersecting the circle about A with the circle about B0 or the slider's path.

    With the diagonal D from A to B0, the coupler's unit vector is along D + across D.left():

        along = (b^2 - c^2 + D.D) / (2 b D.D)        along^2 + across^2 = 1 / D.D
    """
    r, b, c, d, angle, side, *_ = links
    arm, frame = Vector.at(crank) * r, Vector.at(angle)
    if c is None:
        height = d - cross(frame, arm)
        run = side * sqrt(b * b - height * height)
        return (frame * run + frame.left() * height) * (1 / b), dot(frame, arm) + run
    diagonal = frame * d - arm
    over_square = 1 / dot(diagonal, diagonal)
    along = 0.5 / b + (0.5 * (b - c) * (b + c) / b) * over_square
    across = side * sqrt(over_square - along * along)
    coupler = turned(diagonal, along, across)
    return coupler, (coupler * b - diagonal) * (1 / c)


def half_angle(links: Links, crank: Real) -> Pair:
    """Solves quadratic equations for tangents of half angles (Mottola 2017, eq. 16 to 26)."""
    r, b, c, d, angle, side, *_ = links
    theta = crank - angle
    if c is None:
        height = d - r * sin(theta)
        along = _half_angle_root(height, -2 * b, height, -side)
        return along + angle, r * cos(theta) + b * cos(along)
    h1, h2, h3 = d / r, d / b, d / c
    squares = d * d + r * r
    h4 = (c * c - b * b - squares) / (2 * r * b)
    h5 = (squares - b * b + c * c) / (2 * r * c)
    cosine, middle = cos(theta), -2 * sin(theta)
    coupler = _half_angle_root(
        h4 - h1 + (1 + h2) * cosine, middle, h4 + h1 - (1 - h2) * cosine, -side
    )
    rocker = _half_angle_root(
        h5 - h1 + (1 - h3) * cosine, middle, h5 + h1 - (1 + h3) * cosine, -side
    )
    return coupler + angle, rocker + angle


def _half_angle_root(a: Real, b: Real, c: Real, sign: Real) -> Real:
    return 2 * atan2((-b + sign * sqrt(b * b - 4 * a * c)) / (2 * a), 1.0)


def looked_up(links: Links, crank: Real) -> Pair:
    """Calls the tool, an opaque function of the angle, and unpacks its results."""
    locate, *parts = links.tool
    found = locate(crank)
    return tuple(part(found) for part in parts)


# ---------------------------------------------------------------- the loop


class _Arms(NamedTuple):
    """Vectors of a loop, m.

    Attributes:
        crank: From A0 to A.
        coupler: From A to B.
        output: From B0 to B, or the slider's position along the guide.
        slope: Derivative of B with respect to the output.
        gap: Gap of the loop.
    """

    crank: Vector
    coupler: Vector
    output: Vector
    slope: Vector
    gap: Vector


def _arms(links: Links, crank: Real, place: Pair) -> _Arms:
    """Computes the vectors of a loop."""
    coupler, output = place
    first, second = Vector.at(crank) * links.r, _direction(coupler) * links.b
    frame = Vector.at(links.angle)
    if links.c is None:
        start, third, slope = frame.left() * links.d, frame * output, frame
    else:
        start, third = frame * links.d, _direction(output) * links.c
        slope = third.left()
    return _Arms(first, second, third, slope, gap=first + second - start - third)


def _closing(coupler: Vector, slope: Vector, gap: Vector) -> Pair:
    """Solves for the changes of coupler and output that change the gap by a vector."""
    over = -1.0 / dot(coupler, slope)
    return cross(gap, slope) * over, dot(coupler, gap) * over


def _direction(link: Real | Vector) -> Vector:
    return link if isinstance(link, Vector) else Vector.at(link)


def posed(links: Links, crank: Real, place: Pair, first: Pair, second: Pair) -> Pose:
    """Makes the pose from positions and their derivatives with respect to the crank angle."""
    poses = [LinkPose(crank, Vector.at(crank), (1.0,), (ZERO,))]
    for link, at, slope, bend in zip(links.model.links[1:], place, first, second, strict=True):
        direction = Vector.at(link.angle) if link.slides else _direction(at)
        position = atan2(at.y, at.x) if isinstance(at, Vector) else at
        poses.append(LinkPose(position, direction, (slope,), (bend,)))
    return Pose(tuple(poses), ())


def newton_step(links: Links, crank: Real, coupler: Real, output: Real) -> tuple[Real, ...]:
    """Computes the Newton step of coupler and output, and the current gap, m."""
    arms = _arms(links, crank, (coupler, output))
    return (*_closing(arms.coupler, arms.slope, -arms.gap), *arms.gap)


# ---------------------------------------------------------------- rates


def two_by_two(links: Links, crank: Real, locate: Locate) -> tuple[Pair, Pair, Pair]:
    """Solves the differentiated loop equation for the derivatives of coupler and output.

    See Ghalbi 2019, eq. 13 to 18; for a slider-crank, Redaelli 2024, eq. 5 to 8.
    """
    position = locate(crank)
    arms = _arms(links, crank, position)
    first = _closing(arms.coupler, arms.slope, -arms.crank.left())
    coupler_rate, output_rate = first
    right = arms.crank + arms.coupler * (coupler_rate * coupler_rate)
    if links.c is not None:
        right -= arms.output * (output_rate * output_rate)
    second = _closing(arms.coupler, arms.slope, right)
    return position, first, second


def central_differences(links: Links, crank: Real, locate: Locate) -> tuple[Pair, Pair, Pair]:
    """Differentiates positions one step before and after (Dahlquist and Bjorck, sec. 3.3)."""
    step = links.tool
    before, here, after = locate(crank - step), locate(crank), locate(crank + step)
    ahead = [_change(now, later) for now, later in zip(here, after, strict=True)]
    behind = [_change(earlier, now) for earlier, now in zip(before, here, strict=True)]
    per_angle, per_square = 1 / (2 * step), 1 / (step * step)
    first = tuple((a + b) * per_angle for a, b in zip(ahead, behind, strict=True))
    second = tuple((a - b) * per_square for a, b in zip(ahead, behind, strict=True))
    return here, first, second


def _change(old: Any, new: Any) -> Real:
    """Returns the angle between two directions, or the distance of two positions."""
    return atan2(cross(old, new), dot(old, new)) if isinstance(old, Vector) else new - old
