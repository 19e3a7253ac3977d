# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Structure of a mechanism: links, points, pins and dyads. Base class of all mechanisms."""

import functools
import itertools
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, ClassVar, NamedTuple, TypeAlias, cast

from linkage_ros.errors import ConfigurationError
from linkage_ros.formulas import ZERO, Vector, cos, sin, turned
from linkage_ros.mechanism.dyad_reach import stroke_of
from linkage_ros.mechanism.dyads import Chain, Dyad, DyadSlider, ordered
from linkage_ros.mechanism.kinematics import Loop, Reach, State, Stroke
from linkage_ros.mechanism.loads import LOADS
from linkage_ros.mechanism.loads.base import AppliedLoad, JointLoad, Load
from linkage_ros.mechanism.parts import Body, Coupler, LoadedPart
from linkage_ros.mechanism.wrenches import FRAME
from linkage_ros.numeric import Real
from linkage_ros.quantities import Checked, shown
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
    """

    name: str
    mass: float
    inertia: float
    center: Point
    parent: int | None = None
    origin: complex = 0j
    angle: float = 0.0
    slides: bool = False

    @property
    def units(self) -> JointUnits:
        """Units of the joint."""
        return SLIDING if self.slides else TURNING

    @property
    def is_guided(self) -> bool:
        """Whether the link slides on the frame, so that it does not turn."""
        return self.slides and self.parent is None

    def spin(self, index: int) -> int | None:
        """Returns the index of the link whose angle gives the direction of this one.

        Args:
            index: Index of this link.

        Returns:
            This link, the link on which it slides, or None if it is guided by the frame.
        """
        return self.parent if self.slides else index

    def axes(self, index: int) -> tuple[int | None, float | None]:
        """Returns the direction from which the links that this one carries are measured.

        Args:
            index: Index of this link.

        Returns:
            The result of `spin`, and the direction of a guide on the frame, rad, or None.
        """
        return self.spin(index), self.angle if self.is_guided else None

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


def direction(angle: Real) -> Any:
    """Returns e^(i angle) for an angle, rad, or for an array of angles."""
    return cos(angle) + 1j * sin(angle)


def coupler_point(coupler: Coupler, pin: Point) -> dict[str, Point]:
    """Returns the coupler point C.

    Args:
        coupler: The coupler, with or without a coupler point.
        pin: The crank pin A.

    Returns:
        The point with the key 'C'; empty if the coupler has no coupler point.
    """
    return {} if coupler.point is None else {'C': pin.along(1, *coupler.point)}


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


# The indices of two links joined by a pin; their other pins determine their positions (an Assur
# group). If the second link slides on the frame, it is treated as an infinitely long link
# perpendicular to its guide; if it slides on another link, as the line from that link's pin to its
# own. If it slides on the first link, the two are a dyad with an inner guide (a cylinder).
DyadLinks: TypeAlias = tuple[int, int]


class Structure(NamedTuple):
    """The links, points and joints of a mechanism, without its motion.

    Attributes:
        links: The moving links, each after its parent.
        points: The pins A0, A, B and, if present, B0, D, the coupler point C and the mouth E of a
            barrel, by name.
        closure: Sum of the turning links' vectors around the loop. In a closed loop, this sum is
            0 or, with a sliding link, the position of that link's pin. The sliding link is the
            last of the loop.
        pins: The pin joints; empty if joint forces are not supported.
        dyads: The dyads, in the order in which they are solved.
        other_dyads: The dyads for `Mechanism.other_coordinates`.
        driven: Index of the link whose joint is driven; torque, laws, commands and measurements
            are those of this joint.
        added: The `closure` of each added dyad, whose links are the last ones.
    """

    links: tuple[Link, ...]
    points: dict[str, Point]
    closure: Point
    pins: tuple[Pin, ...] = ()
    dyads: tuple[DyadLinks, ...] = ()
    other_dyads: tuple[DyadLinks, ...] = ()
    driven: int = 0
    added: tuple[Point, ...] = ()

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
        return tuple((x, first + 2 * i) for i, x in enumerate((self.closure, *self.added)))

    def with_dyad(self, dyad: Dyad) -> 'Structure':
        """Returns the structure with the links, points and pins of a dyad."""
        i, name = len(self.links), dyad.name
        wide = self._replace(
            links=tuple(link._replace(center=link.center.wider(2)) for link in self.links),
            points={x: point.wider(2) for x, point in self.points.items()},
            closure=self.closure.wider(2),
            dyads=(*self.dyads, (i, i + 1)),
            other_dyads=(*self.other_dyads, (i, i + 1)) if self.other_dyads else (),
            added=tuple(x.wider(2) for x in self.added),
        )

        def turning(
            index: int, body: Body, carrier: str, at: tuple[float, float]
        ) -> tuple[Link, Point, int | None]:
            parent = None if carrier == 'frame' else self.link_index(carrier, name)
            end = wide.point_of(FRAME if parent is None else parent, at)
            link = Link(
                [*dyad.parts][index - i], body.mass, body.inertia,
                end.along(index, *body.center), parent, complex(*at),
            )  # fmt: skip
            return link, end, parent

        first, start, carrier = turning(i, dyad.first, dyad.from_, dyad.from_at)
        joint = start.along(i, dyad.first.length)
        points = {f'{name}_from': start, f'{name}_joint': joint}
        pins = [Pin(f'{name}_from', carrier, i), Pin(f'{name}_joint', i, i + 1)]
        if dyad.second is not None:
            second, end, carrier = turning(
                i + 1, dyad.second, str(dyad.to), dyad.to_at or (0.0, 0.0)
            )
            points[f'{name}_to'] = end
            pins.append(Pin(f'{name}_to', carrier, i + 1))
            gap = joint.minus(end.along(i + 1, dyad.second.length))
        else:
            slider, gap = cast('DyadSlider', dyad.slider), joint
            second = Link(
                f'{name}_slider', slider.mass, 0.0, joint, origin=complex(*slider.at),
                angle=slider.angle, slides=True,
            )  # fmt: skip
        return wide._replace(
            links=(*wide.links, first, second),
            points=wide.points | points,
            pins=(*wide.pins, *pins) if wide.pins else (),
            added=(*wide.added, gap),
        )

    def link_index(self, name: str, what: str, *others: str) -> int:
        """Returns the index of a link.

        Args:
            name: Name of the link.
            what: Name of the setting, for the error message.
            *others: Other valid names, for the error message.

        Raises:
            ConfigurationError: There is no such link.
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
        if body.slides and body.parent is not None:
            pin = next(pin.name for pin in self.pins if link in (pin.first, pin.second))
            return self.points[pin].along(body.parent, *at)
        if body.slides:
            center = body.center
            return center._replace(fixed=center.fixed + complex(*at) * direction(body.angle))
        above = FRAME if body.parent is None else body.parent
        return self.point_of(above, (body.origin.real, body.origin.imag)).along(link, *at)

    def loop_residual(self, state: State) -> float:
        """Computes the largest closure error of loop and dyads, m, at a state of floats."""
        found = []
        for closure, j in self.closures:
            last = self.links[j]
            reached: complex = closure.fixed + sum(
                weight * direction(angle)
                for weight, angle in zip(closure.weights, state.position, strict=False)
                if weight
            )
            if last.slides:
                slid = last.origin + state.position[j] * direction(last.angle)
                axis = 1.0 if last.parent is None else direction(state.position[last.parent])
                reached -= slid * axis
            found.append(abs(reached))
        return max(found)


def output_index(links: Sequence[Link], driven: int) -> int:
    """Returns the index of the output link, whose travel is shown.

    It is the last link; for a cylinder, the crank if the cylinder is driven, else the barrel,
    whose swing is that of a slotted lever.

    Args:
        links: The moving links of a mechanism.
        driven: Index of the driven link.
    """
    last = len(links) - 1
    if last == driven:
        return 0
    parent = links[last].parent
    return last if parent is None or not links[last].slides else parent


def mouth(structure: Structure) -> complex:
    """Returns the mouth of a barrel, [along, across] as x + iy, m, where its drawing ends.

    Returns:
        Point E of the barrel; 0 if the loop's last link does not slide on another link.
    """
    (_, j), *_ = structure.closures
    last = structure.links[j]
    if last.parent is None or not last.slides:
        return 0j
    return complex(structure.points['E'].weights[last.parent])


class Description(NamedTuple):
    """A choice of coordinates for a mechanism.

    Attributes:
        coordinates: Names of the links whose positions determine all others.
        assembly: Assembly in these coordinates, 'open' or 'crossed'.
    """

    coordinates: tuple[str, ...]
    assembly: str

    def __str__(self) -> str:
        return ' '.join((*self.coordinates, self.assembly))


class Mechanism(Checked):
    """Base class of all mechanisms.

    Mechanisms are frozen dataclasses of parts and are validated on creation.

    Attributes:
        coordinates: Names of the links whose positions determine all others.
        other_coordinates: Alternative coordinates, used where `coordinates` are singular, that is,
            at a dead centre or a stretched dyad. Empty if there are none.
        crank: The link that turns about the origin; driven, unless the structure names another.
        assembly: Assembly of the loop, 'open' or 'crossed'.
        gravity: Acceleration of gravity [x, y], m/s^2.
        loads: Loads on the links, in addition to those defined by the parts.
        dyads: Dyads that the mechanism carries, in the order in which they are solved.
    """

    coordinates: ClassVar[tuple[str, ...]] = ('crank',)
    other_coordinates: ClassVar[tuple[str, ...]] = ()
    crank: Body
    assembly: str
    gravity: tuple[float, float]
    loads: tuple[AppliedLoad, ...] = ()
    dyads: tuple[Dyad, ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        self.require_closed()
        if self.dyads:
            links = [link.name for link in self.loop_structure().links]
            object.__setattr__(self, 'dyads', ordered(self.dyads, links))
        own = [load.key for load in self._part_loads]
        loads = tuple(load.completed() for load in _named(self.loads, own))
        object.__setattr__(self, 'loads', loads)

    @classmethod
    def drives(cls, _values: Mapping[str, object]) -> tuple[tuple[str, ...], str]:
        """Returns the kinds of drive that a mechanism can have; empty if all.

        Args:
            _values: Parameters of the mechanism by name.

        Returns:
            The kinds, and why no other kind is accepted.
        """
        return (), ''

    @classmethod
    def unused(cls, _values: Mapping[str, object]) -> dict[str, str]:
        """Returns the parameters of this class that do not apply, each with the reason.

        Args:
            _values: Parameters of the mechanism by name.
        """
        return {}

    def require_closed(self) -> None:
        """Rejects lengths with which the loop cannot close."""

    def loop_structure(self) -> Structure:
        """Returns the links, points and joints of the loop."""
        raise NotImplementedError

    def structure(self) -> Structure:
        """Returns the links, points and joints of the mechanism."""
        return self._structure

    @functools.cached_property
    def _structure(self) -> Structure:
        return functools.reduce(Structure.with_dyad, self.dyads, self.loop_structure())

    def parts(self) -> dict[str, Any]:
        """Returns the part of each link, with its mass and dimensions, by the link's name."""
        links = self.structure().links
        of_loop = links[: len(links) - 2 * len(self.dyads)]
        found = {link.name: getattr(self, link.name) for link in of_loop}
        return found | {name: part for dyad in self.dyads for name, part in dyad.parts.items()}

    def loop(self) -> Loop:
        """Returns the kinematic constants in the mechanism's own coordinates."""
        raise NotImplementedError

    @property
    def description(self) -> Description:
        """The mechanism's own coordinates and assembly."""
        return Description(self.coordinates, self.assembly)

    def chain(self, description: Description | None = None) -> Loop:
        """Returns the kinematic constants of loop and dyads.

        Args:
            description: Coordinates and assembly; by default, the mechanism's own.
        """
        loop = self.loop_of(description or self.description)
        if not self.dyads:
            return loop
        points = self.structure().points
        return Chain(loop, tuple(dyad.loop(points) for dyad in self.dyads))

    def loop_of(self, description: Description) -> Loop:
        """Returns the kinematic constants of the loop in a description."""
        mechanism: Mechanism = self
        if description.assembly != self.assembly:
            mechanism = replace(cast('Any', self), assembly=description.assembly)
        is_own = description.coordinates != self.other_coordinates
        return mechanism.loop() if is_own else mechanism.other_loop()

    def other_loop(self) -> Loop:
        """Returns the kinematic constants in `other_coordinates`."""
        raise NotImplementedError

    @functools.cached_property
    def _part_loads(self) -> list[AppliedLoad]:
        """The loads that parts give for their own links."""
        parts = self.parts().items()
        found = [part.own_load(name) for name, part in parts if isinstance(part, LoadedPart)]
        return [load for load in found if load is not None]

    def applied_loads(self) -> tuple[AppliedLoad, ...]:
        """Returns all loads with their parameters: those of parts, then `loads`."""
        return (*self._part_loads, *self.loads)

    def link_loads(self) -> dict[str, Load]:
        """Returns the loads on links by `AppliedLoad.key`: all but weights and `joint_loads`."""
        found = ((load.key, load.on(self)) for load in self.applied_loads())
        return {key: load for key, load in found if load is not None}

    def joint_loads(self) -> tuple[JointLoad, ...]:
        """Returns the loads caused by joint forces, such as friction."""
        found = (load.in_joints(self) for load in self.applied_loads())
        return tuple(load for load in found if load is not None)

    def loaded_link(self, name: str, what: str) -> int:
        """Returns the index of a link that may carry a load.

        These are the crank, the last link of the loop, and the sliders of dyads.

        Args:
            name: Name of the link.
            what: Name of the setting, for the error message.

        Returns:
            The index of the link in `structure().links`.

        Raises:
            ConfigurationError: The name is not that of such a link.
        """
        structure = self.structure()
        (_, last), *added = structure.closures
        carriers = [0, last, *(j for _, j in added if structure.links[j].slides)]
        names = {structure.links[j].name: j for j in carriers}
        if name not in names:
            raise ConfigurationError(
                f'{what} = {shown(name)}: must be {" or ".join(names)} of this mechanism'
            )
        return names[name]

    def swing_middle(self, _what: str, _near: float) -> float | None:
        """Returns the middle of the output link's swing.

        Args:
            _what: Name of the setting, for the error message.
            _near: A direction of the link that the setting gives, rad. If the link swings in one
                of two circuits, the middle is chosen so that this direction, within pi of the
                middle, is also within pi of the middle of each circuit.

        Returns:
            The direction of the link there, rad in [-pi, pi]; None for a sliding link.

        Raises:
            ConfigurationError: The link turns fully, so its swing has no middle.
        """
        return None

    def swing_side(self) -> Real | None:
        """Returns the direction opposite to one that the output link never reaches.

        Returns:
            The direction, rad in [-pi, pi]; None for a link that slides or turns fully.
        """
        return None

    def stroke(self, what: str, name: str) -> Stroke:
        """Returns the stroke of a slider, whose ends depend on the lengths alone.

        Args:
            what: Name of the setting, for the error message.
            name: Name of the link.

        Raises:
            ConfigurationError: The link is not a slider whose stroke has fixed ends.
        """
        if any(dyad.slider and name in dyad.parts for dyad in self.dyads):
            return stroke_of(self, what, name)
        raise ConfigurationError(
            f'{what}: {name} of a {type(self).__name__} is not a slider whose stroke has fixed '
            'ends; use a load over position, or crank_angle'
        )

    def reach(self) -> Reach | None:
        """Returns the crank's reach; None if the crank angle does not determine the motion."""
        return None

    def start(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Returns the coordinates other than the crank angle at t = 0, and their rates."""
        return (), ()


def _named(loads: Sequence[AppliedLoad], own: Sequence[str]) -> list[AppliedLoad]:
    """Gives loads their names, and sorts them, so that sums do not depend on the order given.

    A load without a name keeps its group, unless another load has it.

    Args:
        loads: The loads.
        own: Names of the loads of parts.

    Raises:
        ConfigurationError: Two loads have the same name.
    """
    kinds = {kind: name for name, kind in LOADS.items()}
    in_short, named = list[AppliedLoad](), list[AppliedLoad]()
    taken = {*own, *(load.name for load in loads)}
    for load in loads:
        if load.name:
            named.append(load)
        elif load.group and load.group not in (x.group for x in in_short):
            in_short.append(load)
        else:
            kind = kinds.get(type(load), type(load).__name__.lower())
            name = next(x for n in itertools.count(1) if (x := f'{kind}_{n}') not in taken)
            taken.add(name)
            named.append(replace(cast('Any', load), name=name))
    found = [*in_short, *sorted(named, key=lambda load: load.name)]
    keys = [*own, *(load.key for load in found)]
    for i, key in enumerate(keys):
        if key in keys[:i]:
            raise ConfigurationError(f'two loads have the name {shown(key)}: rename one')
    return found
