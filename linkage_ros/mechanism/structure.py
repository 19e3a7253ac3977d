# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Structure of a mechanism: links, points, pins and dyads."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, TypeAlias, cast

from linkage_ros.errors import ConfigurationError, Mistakes
from linkage_ros.formulas import ZERO, Vector, cos, sin, turned
from linkage_ros.mechanism.axes import axes_of
from linkage_ros.mechanism.dyads import Dyad
from linkage_ros.mechanism.kinematics import State
from linkage_ros.mechanism.parts import FRAME_NAME, Body, TracedPoint
from linkage_ros.mechanism.wrenches import FRAME
from linkage_ros.numeric import Real
from linkage_ros.quantities import shown
from linkage_ros.units import SLIDING, TURNING, JointUnits


class Point(NamedTuple):
    """A point, expressed as a linear combination of the link directions.

    The point is `fixed` plus the sum of weights[j] e^(i phi_j). In formulas, each complex
    number is a `Vector`.

    Attributes:
        weights: A complex weight for each moving link, m; 0 for a sliding link.
        fixed: Constant term x + iy, m.
    """

    weights: tuple[Any, ...]
    fixed: Any = 0j

    @classmethod
    def at(cls, position: complex, links: int) -> 'Point':
        """Creates a fixed point at x + iy, m, for a mechanism with this number of moving links."""
        return cls((0j,) * links, position)

    def along(self, link: int, along: Real, across: Real = 0.0) -> 'Point':
        """Returns the point [along, across], m, of a link whose first pin is at this point."""
        weights = list(self.weights)
        weights[link] += along + 1j * across
        return Point(tuple(weights), self.fixed)

    def wider(self, links: int) -> 'Point':
        """Returns the same point of a mechanism with further links."""
        return Point((*self.weights, *[0j] * links), self.fixed)

    def minus(self, other: 'Point') -> 'Point':
        """Returns the vector from another point to this one, as a linear combination."""
        weights = tuple(x - y for x, y in zip(self.weights, other.weights, strict=True))
        return Point(weights, self.fixed - other.fixed)

    def times(self, factor: complex) -> 'Point':
        """Returns the point multiplied by a complex number, such as e^(i angle) to turn it."""
        return Point(tuple(weight * factor for weight in self.weights), self.fixed * factor)

    def motion(
        self, directions: Sequence[Vector], rates: Sequence[Real], changes: Sequence[Real]
    ) -> tuple[Vector, Vector, Vector]:
        """Computes the motion of the point (Mottola 2017, eq. a2, a3, 34, 35 and derivatives).

        Args:
            directions: Unit vector of each link.
            rates: Angular velocity of each link, rad/s.
            changes: Angular acceleration of each link, rad/s^2.

        Returns:
            The position in m, the velocity in m/s and the acceleration in m/s^2.
        """
        position, velocity, acceleration = self.fixed, Vector(ZERO, ZERO), Vector(ZERO, ZERO)
        for weight, direction, rate, change in zip(
            self.weights, directions, rates, changes, strict=True
        ):
            arm = turned(direction, weight.x, weight.y)
            position += arm
            velocity += arm.left() * rate
            acceleration += arm.left() * change - arm * (rate * rate)
        return position, velocity, acceleration


class Link(NamedTuple):
    """A moving link: its body, and its joint in the open tree for ROS.

    URDF does not support closed loops, so the loop is cut at the output link's pin. This pin is B
    between coupler and rocker or slider or, in a wind pump, D between rod and slider. Joint
    positions are relative to the parent link: the coupler is measured from the crank, the rod from
    the coupler. The loop of an inverted slider-crank is cut at the rod's pin A.

    Attributes:
        name: Name of the link and of its joint.
        mass: Mass, kg.
        inertia: Moment of inertia about the centre of mass, kg m^2; 0 for a guided link.
        center: Centre of mass; for a guided link, its pin.
        parent: Index of the parent link; None if the parent is base_link.
        origin: Position of the joint in the axes of the parent, x + iy, m.
        angle: Direction of the joint's x axis in the axes of the parent, rad.
        slides: Whether the joint is prismatic; it then slides along its x axis.
        pin: For a link that slides on a moving link, its pin.
    """

    name: str
    mass: float
    inertia: float
    center: Point
    parent: int | None = None
    origin: complex = 0j
    angle: float = 0.0
    slides: bool = False
    pin: Point | None = None

    @property
    def units(self) -> JointUnits:
        """Units of the joint."""
        return SLIDING if self.slides else TURNING

    @property
    def is_guided(self) -> bool:
        """Whether the link slides on the frame, so that it does not turn."""
        return self.slides and self.parent is None

    @property
    def driven_word(self) -> str:
        """Word for the link if its joint is driven: 'crank', 'cylinder' or 'slider'."""
        if not self.slides:
            return 'crank'
        return 'slider' if self.is_guided else 'cylinder'

    @classmethod
    def turning(cls, name: str, body: Body, index: int, pin: Point) -> 'Link':
        """Creates a link that turns about its first pin.

        Args:
            name: Name of the link.
            body: Dimensions and mass of the link.
            index: Index of the link among the moving links.
            pin: The first pin. The parent is the last link with a nonzero weight in this point,
                or base_link if there is none.

        Returns:
            The link, with a revolute joint at the pin.
        """
        parent = max((j for j, weight in enumerate(pin.weights) if weight), default=None)
        origin = pin.fixed if parent is None else pin.weights[parent]
        center = pin.along(index, *body.center)
        return cls(name, body.mass, body.inertia, center, parent, origin)

    @classmethod
    def carried(cls, name: str, body: Body, index: int, end: 'End') -> 'Link':
        """Creates a link of a dyad; for the arguments, see `turning`."""
        center = end.point.along(index, *body.center)
        return cls(name, body.mass, body.inertia, center, end.carrier, end.at)

    def wider(self, links: int) -> 'Link':
        """Returns the same link of a mechanism with further links."""
        pin = self.pin and self.pin.wider(links)
        return self._replace(center=self.center.wider(links), pin=pin)


class End(NamedTuple):
    """An end of a dyad, about which a link of the dyad turns.

    Attributes:
        carrier: Index of the link that carries the end; None for the frame.
        at: The end on that link, in its axes, x + iy, m.
        point: The end.
    """

    carrier: int | None
    at: complex
    point: Point


def direction(angle: Real) -> Any:
    """Returns e^(i angle) for an angle, rad, or for an array of angles."""
    return cos(angle) + 1j * sin(angle)


class Pin(NamedTuple):
    """A pin joint between two links.

    Attributes:
        name: Name of the pin's point.
        first: Index of the link that exerts the pin force; None for the frame.
        second: Index of the link on which the force acts.
    """

    name: str
    first: int | None
    second: int


class AddedDyad(NamedTuple):
    """An added dyad, whose two links follow those of the loop and of the dyads before.

    Attributes:
        closure: See `Structure.closure`.
        pins: Names of the pins at its first end, its joint and its second end, if there
            are.
    """

    closure: Point
    pins: tuple[str, ...]


class _New(NamedTuple):
    """Links, joints and closure that a dyad adds to a `Structure`.

    Attributes:
        links: Links of the dyad.
        joints: Point of each pin, and the links that the pin joins; see `Pin`.
        closure: See `Structure.closure`.
    """

    links: tuple[Link, Link]
    joints: tuple[tuple[Point, int | None, int], ...]
    closure: Point


# The indices of two links joined by a pin; their other pins determine their positions (an Assur
# group). If the second link slides on the frame, or on a link before the first one, it is treated
# as an infinitely long link perpendicular to its guide; if it slides on a later link, as the line
# from that link's pin to its own. If it slides on the first link, the two are a dyad with an inner
# guide (a cylinder).
DyadLinks: TypeAlias = tuple[int, int]


class Structure(NamedTuple):
    """The links, points and joints of a mechanism, without its motion.

    Attributes:
        links: The moving links, each after its parent.
        points: The pins A0, A, B and, if present, B0, D and the mouth E of a barrel, then those of
            dyads and the traced points, by name. In a drawing, they have the names of its pins.
        closure: Sum of the turning links' vectors around the loop. In a closed loop, this sum is
            0 or, with a sliding link, the position of that link's pin from the first pin of the
            link on which it slides. The sliding link is the last of the loop.
        pins: The pin joints; empty if joint forces are not supported.
        dyads: The dyads, in the order in which they are solved.
        other_dyads: The dyads for `Mechanism.other_coordinates`.
        driven: Index of the link whose joint is driven; torque, laws, commands and measurements
            are those of this joint.
        added: The added dyads, whose links are the last ones.
        roles: The links of the loop by their names in the mechanism's class, such as 'rocker'.
        mouth: Name of the point at which the drawing of a barrel ends; empty without a barrel.
        traced: Links of the traced points, by the name of the point.
    """

    links: tuple[Link, ...]
    points: dict[str, Point]
    closure: Point
    pins: tuple[Pin, ...] = ()
    dyads: tuple[DyadLinks, ...] = ()
    other_dyads: tuple[DyadLinks, ...] = ()
    driven: int = 0
    added: tuple[AddedDyad, ...] = ()
    roles: tuple[str, ...] = ()
    mouth: str = ''
    traced: Mapping[str, str] = {}

    @property
    def driven_link(self) -> Link:
        """The link whose joint is driven."""
        return self.links[self.driven]

    @property
    def output_index(self) -> int:
        """Index of the output link; see `output_index`."""
        return output_index(self.links, self.driven)

    @property
    def closures(self) -> tuple[tuple[Point, int], ...]:
        """The `closure` of the loop and of each added dyad, with the last link of each."""
        first = len(self.links) - 2 * len(self.added) - 1
        closures = (self.closure, *(dyad.closure for dyad in self.added))
        return tuple((closure, first + 2 * i) for i, closure in enumerate(closures))

    def indices_of(self, roles: Sequence[str]) -> list[int]:
        """Returns the indices of links of the loop, given their names in the mechanism's class."""
        known = self.roles or tuple(link.name for link in self.links)
        return [known.index(role) for role in roles]

    def renamed(self, links: Sequence[str], points: Mapping[str, str]) -> 'Structure':
        """Returns the structure of the loop with other names.

        Args:
            links: New names of the links.
            points: New names of pins and points; those that are missing keep theirs.
        """
        return self._replace(
            links=tuple(
                link._replace(name=name) for link, name in zip(self.links, links, strict=True)
            ),
            points={points.get(name, name): point for name, point in self.points.items()},
            pins=tuple(pin._replace(name=points.get(pin.name, pin.name)) for pin in self.pins),
            roles=tuple(link.name for link in self.links),
            mouth=points.get(self.mouth, self.mouth),
        )

    def with_dyad(self, dyad: Dyad) -> 'Structure':
        """Returns the structure with the links, points and pins of a dyad."""
        i, j = len(self.links), len(self.links) + 1  # of the two links
        wide = self._for_two_more_links()
        if dyad.barrel is not None:
            new = _barrel_and_rod(wide, dyad, i, j)
        elif dyad.slider is not None:
            new = _link_and_slider(wide, dyad, i, j)
        else:
            new = _two_links(wide, dyad, i, j)
        joints = dict(zip(dyad.pins, new.joints, strict=True))
        points = {name: point for name, (point, _, _) in joints.items()}
        pins = [Pin(name, first, second) for name, (_, first, second) in joints.items()]
        return wide._replace(
            links=(*wide.links, *new.links),
            points=wide.points | points,
            pins=(*wide.pins, *pins) if wide.pins else (),
            dyads=(*wide.dyads, (i, j)),
            other_dyads=(*wide.other_dyads, (i, j)) if wide.other_dyads else (),
            added=(*wide.added, AddedDyad(new.closure, dyad.pins)),
        )

    def with_points(self, points: Sequence[TracedPoint]) -> 'Structure':
        """Returns the structure of all links with traced points after its pins.

        Raises:
            ConfigurationError: A link is unknown, or a name is already in use.
        """
        mistakes, all_points = Mistakes(), dict(self.points)
        taken = {*all_points, *(link.name for link in self.links), FRAME_NAME}
        for point in points:
            with mistakes:
                if point.name in taken:
                    raise ConfigurationError(
                        f'point {shown(point.name)}: a link, a pin or another point has this '
                        'name; give it another one'
                    )
                taken.add(point.name)
                link = self.link_index(point.link, f'points.{point.name}.link')
                all_points[point.name] = self.point_of(link, point.at or (0.0, 0.0))
        mistakes.check()
        return self._replace(points=all_points, traced={x.name: x.link for x in points})

    def _for_two_more_links(self) -> 'Structure':
        """Returns the same structure, whose points have weights for two more links."""
        return self._replace(
            links=tuple(link.wider(2) for link in self.links),
            points={name: point.wider(2) for name, point in self.points.items()},
            closure=self.closure.wider(2),
            added=tuple(dyad._replace(closure=dyad.closure.wider(2)) for dyad in self.added),
        )

    def ends(self, dyad: Any) -> tuple['End', 'End']:
        """Returns the first end of a dyad, and the second end or a point of the guide."""
        other = dyad.to, dyad.to_at or (0.0, 0.0)
        if dyad.slider is not None:
            other = dyad.slider.on, dyad.slider.at
        return self._end_on(dyad.name, dyad.from_, dyad.from_at), self._end_on(dyad.name, *other)

    def _end_on(self, dyad: str, carrier: str, at: tuple[float, float]) -> 'End':
        """Returns the end of a dyad on a link, or on the frame.

        Raises:
            ConfigurationError: No link has this name.
        """
        index = None if carrier == FRAME_NAME else self.link_index(carrier, dyad)
        point = self.point_of(FRAME if index is None else index, at)
        return End(index, complex(*at), point)

    def link_index(self, name: str, what: str, *others: str) -> int:
        """Returns the index of a link.

        Args:
            name: Name of the link.
            what: Name of the setting, for the error message.
            *others: Other valid names, for the error message.

        Raises:
            ConfigurationError: No link has this name.
        """
        names = [link.name for link in self.links]
        if name not in names:
            raise ConfigurationError(
                f'{what} = {shown(name)}: must be one of {", ".join((*names, *others))}'
            )
        return names.index(name)

    def point_of(self, link: int, at: tuple[float, float]) -> Point:
        """Returns a point of a body.

        Args:
            link: Index of a link, or FRAME.
            at: Point [along, across] from the link's first pin, m; on a sliding link, from its pin
                in the axes of its guide; on the frame, in the axes of base_link.
        """
        if link == FRAME:
            return Point.at(complex(*at), len(self.closure.weights))
        body = self.links[link]
        if body.slides:
            return self.turned_with(link, body.pin or body.center, at)
        above = FRAME if body.parent is None else body.parent
        return self.point_of(above, (body.origin.real, body.origin.imag)).along(link, *at)

    def place_on(self, link: int, point: Point) -> complex | None:
        """Returns the place of a point on a body; the inverse of `point_of`.

        Relative to the first pin, a point of the body is a constant length along the direction
        with which the body turns, and across it; on a body that does not turn, it is constant.

        Args:
            link: Index of a link, or FRAME.
            point: The point.

        Returns:
            [along, across] as in `point_of`, as x + iy, m; None if the point's expression is not
            that of a point of the body.
        """
        spin, guide = (None, None) if link == FRAME else axes_of(self.links, link)
        arm = point.minus(self.point_of(link, (0.0, 0.0)))
        terms = [*arm.weights, arm.fixed]
        place = complex(terms.pop(-1 if spin is None else spin))
        is_on_body = not any(terms)  # no other direction moves it
        if not is_on_body:
            return None
        return place if guide is None else place * direction(-guide)

    def turned_with(self, link: int, pin: Point, at: tuple[float, float]) -> Point:
        """Returns the point [along, across] from a pin, m, in the axes of a link that slides."""
        spin, guide = axes_of(self.links, link)
        arm = complex(*at) if guide is None else complex(*at) * direction(guide)
        if spin is None:
            return pin._replace(fixed=pin.fixed + arm)
        return pin.along(spin, arm.real, arm.imag)

    def place_of(
        self,
        what: str,
        link: str,
        at: tuple[float, float] | None,
        pin: str,
        *,
        frame_allowed: bool = False,
    ) -> tuple[int, Point]:
        """Returns where a load acts.

        Args:
            what: Start of the names of its settings, for error messages.
            link: Name of the link; empty if a pin is given.
            at: The place on the link; None for its first pin. See `point_of`.
            pin: Name of a pin, which acts on the link that carries it, or of a traced point;
                empty if a link is given.
            frame_allowed: Whether the load may act on the frame.

        Returns:
            Index of the link, or FRAME, and the point.

        Raises:
            ConfigurationError: There is no such link or pin, or both are given.
        """
        if not pin:
            others = [FRAME_NAME] if frame_allowed else []
            if not link:
                valid = ', '.join((*(x.name for x in self.links), *others))
                raise ConfigurationError(f'{what} is missing: must be one of {valid}; or give pin')
            index = FRAME if link in others else self.link_index(link, what, *others)
            return index, self.point_of(index, at or (0.0, 0.0))
        if link or at is not None:
            raise ConfigurationError(
                f'{what} and its place: leave them out beside pin = {shown(pin)}, or leave out pin'
            )
        return self._carrier_of(what, pin, frame_allowed=frame_allowed), self.points[pin]

    def _carrier_of(self, what: str, pin: str, *, frame_allowed: bool) -> int:
        """Returns the index of the link that carries a pin or traced point, or FRAME.

        Raises:
            ConfigurationError: There is no such pin, or the frame carries it but is not allowed.
        """
        # Of several joints at a pin, the first counts: it replaces those after it.
        carriers = {
            joint.name: FRAME if joint.first is None else joint.first
            for joint in reversed(self.pins)
        }
        names = [link.name for link in self.links]
        carriers |= {point: names.index(link) for point, link in self.traced.items()}
        if pin not in carriers:
            raise ConfigurationError(
                f'{what}: no pin {shown(pin)}; must be one of {", ".join(carriers)}'
            )
        if carriers[pin] == FRAME and not frame_allowed:
            raise ConfigurationError(
                f'{what}: the frame carries the pin {shown(pin)}; give link and at instead'
            )
        return carriers[pin]

    def loop_residual(self, state: State) -> float:
        """Computes the largest closure error of loop and dyads, m, at a state of floats."""
        return max(self._closure_error(closure, j, state) for closure, j in self.closures)

    def _closure_error(self, closure: Point, j: int, state: State) -> float:
        """Computes the closure error, m, of a loop or dyad whose last link is j."""
        terms = zip(closure.weights, state.position, strict=False)
        error: complex = closure.fixed + sum(
            weight * direction(angle) for weight, angle in terms if weight
        )
        last = self.links[j]
        if last.slides:
            pin = last.origin + state.position[j] * direction(last.angle)
            error -= pin * self._axis(last.parent, state)
        return abs(error)

    def _axis(self, j: int | None, state: State) -> Any:
        """Returns the direction of the x axis of a link, or of base_link, as e^(i angle)."""
        if j is None:
            return 1.0
        spin, guide = axes_of(self.links, j)
        turned = 1.0 if spin is None else direction(state.position[spin])
        return turned if guide is None else turned * direction(guide)


def _two_links(wide: Structure, dyad: Any, i: int, j: int) -> _New:
    """Returns links i and j, joined by a pin, whose other ends are at pins; see `_New`."""
    (name, other_name), (start, end) = dyad.parts, wide.ends(dyad)
    joint = start.point.along(i, dyad.first.length)
    first = Link.carried(name, dyad.first, i, start)
    second = Link.carried(other_name, dyad.second, j, end)
    return _New(
        links=(first, second),
        joints=((start.point, start.carrier, i), (joint, i, j), (end.point, end.carrier, j)),
        closure=joint.minus(end.point.along(j, dyad.second.length)),
    )


def _link_and_slider(wide: Structure, dyad: Any, i: int, j: int) -> _New:
    """Returns link i from a pin to slider j, whose guide may be on a moving link; see `_New`."""
    (name, slider_name), (start, guide), slider = dyad.parts, wide.ends(dyad), dyad.slider
    first = Link.carried(name, dyad.first, i, start)
    joint = start.point.along(i, dyad.first.length)
    joints = ((start.point, start.carrier, i), (joint, i, j))
    last = Link(
        slider_name,
        slider.mass,
        slider.inertia or 0.0,
        center=joint,
        parent=guide.carrier,
        origin=guide.at,
        angle=slider.angle,
        slides=True,
    )
    if guide.carrier is None:
        return _New((first, last), joints, closure=joint)
    with_slider = wide._replace(links=(*wide.links, first, last))
    center = with_slider.turned_with(j, joint, slider.center or (0.0, 0.0))
    last = last._replace(center=center, pin=joint)
    closure = joint.minus(wide.point_of(guide.carrier, (0.0, 0.0)))
    return _New((first, last), joints, closure)


def _barrel_and_rod(wide: Structure, dyad: Any, i: int, j: int) -> _New:
    """Returns barrel i at the second end, and rod j, which slides in it, at the first end."""
    (name, rod_name), (start, end), rod = dyad.parts, wide.ends(dyad), dyad.rod
    barrel = Link.carried(name, dyad.barrel, i, end)
    last = Link(
        rod_name,
        rod.mass,
        rod.inertia,
        center=start.point.along(i, *rod.center),
        parent=i,
        origin=1j * dyad.offset,
        slides=True,
        pin=start.point,
    )
    return _New(
        links=(barrel, last),
        joints=((start.point, start.carrier, j), (end.point, end.carrier, i)),
        closure=start.point.minus(end.point),
    )


def output_index(links: Sequence[Link], driven: int) -> int:
    """Returns the index of the output link, whose travel is shown.

    It is the last link or, if that is driven, the crank; for a cylinder whose crank is driven, the
    barrel, whose swing is that of a slotted lever.

    Args:
        links: The moving links of a mechanism.
        driven: Index of the driven link.
    """
    last = len(links) - 1
    if last == driven:
        return 0
    barrel = last - 1
    return barrel if links[last].slides and links[last].parent == barrel else last


def mouth(structure: Structure) -> complex:
    """Returns the mouth of a barrel, [along, across] as x + iy, m, where its drawing ends.

    Returns:
        Point E of the barrel; 0 without a barrel.
    """
    if not structure.mouth:
        return 0j
    (_, j), *_ = structure.closures
    barrel = structure.links[j].parent
    return complex(structure.points[structure.mouth].weights[cast('int', barrel)])
