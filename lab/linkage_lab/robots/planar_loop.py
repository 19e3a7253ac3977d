# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Finds the planar linkage in a closed loop of a robot model.

Links connected by fixed joints are one body. If the loop is cut at the closure, the bodies form a
tree. The loop consists of the two paths from the closure to their first common body. Lengths,
centres of mass and joint zeros depend only on the bodies; the pose only determines the assembly
and the direction of gravity.

The coordinates of a body are those of its link nearest to the root, so that the lengths in the
file are not rounded.
"""

import cmath
import itertools
import json
import math
from collections import Counter, deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from linkage_lab.robots.model import (
    BALL,
    FIXED,
    IDENTITY,
    PRISMATIC,
    REVOLUTE,
    Closure,
    Inertial,
    Joint,
    Robot,
    Transform,
    listed,
    lumped,
)
from linkage_ros import CROSSED, OPEN, ConfigurationError, Solver, UnreachableError
from linkage_ros.extensions import MECHANISMS
from linkage_ros.formulas import Array
from linkage_ros.internals import wrap
from linkage_ros.quantities import build, shown

_PARALLEL = 2e-3  # rad, largest angle between axes that count as parallel
_NOTED = 1e-6  # rad, smallest such angle that is noted
_CLOSED = 1e-6  # largest distance of the ends of a closed loop, relative to the longest link
_DIGITS = 14  # kept of the longest length, so that links of equal length stay equal
_SHORTEST = 1e-9  # m, as for the lengths of a mechanism
_SLANTED = 0.6  # shortest projection of an axis of the frame that gives the plane's y axis
_OFF_PIN = 1e-6  # m, distance of a slider's centre of mass from its pin that is noted
_ALIKE = 1e-9  # rad, difference between two assemblies that cannot be told apart
_ONE = 1e-6  # rad or m, largest difference of assemblies that meet
_SLIDING = 'slider', 'rod'
_MASSLESS = Inertial(0.0, np.zeros(3), np.zeros((3, 3)))
_CYLINDER = 'inverted_slider_crank'
_KINDS = {
    (REVOLUTE, REVOLUTE, REVOLUTE, REVOLUTE): ('four_bar', 'rocker'),
    (REVOLUTE, REVOLUTE, REVOLUTE, PRISMATIC): ('slider_crank', 'slider'),
    (REVOLUTE, REVOLUTE, PRISMATIC, REVOLUTE): (_CYLINDER, 'barrel'),
}


class JointMap(NamedTuple):
    """The joint of the robot that moves a link of the mechanism.

    Its value is ratio * (own - zero). `own` is the direction of the link minus that of `parent`,
    rad, or the position of the slider, m.

    Attributes:
        name: Name of the joint; empty if it has none.
        zero: Value of `own` at which the joint is at 0.
        ratio: 1 or -1.
        parent: Name of the link from which it is measured.
    """

    name: str
    zero: float
    ratio: float
    parent: str


class PlanarLoop(NamedTuple):
    """The mechanism found in a robot.

    Attributes:
        kind: Name of the mechanism in `MECHANISMS`.
        values: Parameters of the mechanism and of `frame_joint`, by dotted name.
        joints: The robot's joint of each link.
        bodies: Names of the robot's links in each link of the mechanism, including the frame.
        axes: The plane in the axes of the frame's first link: origin, x axis, y axis and normal.
        given: The joint values of the pose, and those that close the loop at its crank value.
        closed: The joint values that close the loop.
        residual: Distance in the plane between both ends of the loop at the closed pose, m.
        gap: The same distance at the given pose, m.
        across: Distance of both ends along the normal, m.
        notes: Sentences about probably wrong values and omitted properties of the robot.
    """

    kind: str
    values: dict[str, Any]
    joints: dict[str, JointMap]
    bodies: dict[str, list[str]]
    axes: tuple[Array, Array, Array, Array]
    given: dict[str, float]
    closed: dict[str, float]
    residual: float
    gap: float
    across: float
    notes: list[str]

    @property
    def is_closed(self) -> bool:
        """Whether the residual is at most 1e-6 of the longest link."""
        lengths = [value for name, value in self.values.items() if name.endswith('.length')]
        return bool(self.residual <= _CLOSED * max(lengths))


class _Body(NamedTuple):
    """Links connected by fixed joints.

    Attributes:
        links: Pose of each link in the body by name, the first link first.
        above: Number of the joint towards the root; None for a root.
        base: Pose of a root in the root's axes.
    """

    links: dict[str, Transform]
    above: int | None
    base: Transform = IDENTITY


class _Edge(NamedTuple):
    """A movable joint of the tree.

    Attributes:
        joint: The joint.
        ends: Numbers of the bodies of its parent and child link.
    """

    joint: Joint
    ends: tuple[int, int]


class _Pin(NamedTuple):
    """A connection of two bodies in the loop.

    Attributes:
        bodies: Numbers of both bodies, in the order of the loop.
        places: The pin in the coordinates of each body, m.
        edge: Its joint; None for the closure.
        closure: Its closure; None for a joint of the tree.
    """

    bodies: tuple[int, int]
    places: dict[int, Array]
    edge: _Edge | None = None
    closure: Closure | None = None

    @property
    def name(self) -> str:
        """Name of the joint; a description of the closure."""
        return self.edge.joint.name or 'a joint without a name' if self.edge else 'the closure'

    @property
    def kind(self) -> str:
        """Kind of the joint; a closure is a revolute one."""
        return self.edge.joint.kind if self.edge else REVOLUTE

    def reversed(self) -> '_Pin':
        """Returns the same pin for the loop in the other direction."""
        return self._replace(bodies=(self.bodies[1], self.bodies[0]))


class _Tree:
    """The bodies of a robot, connected by its movable joints.

    Attributes:
        bodies: The bodies, each after the one towards the root.
        home: Number of the body of each link.
        leftover: Joints that close loops.
    """

    def __init__(self, robot: Robot, crank: str) -> None:
        """Builds the tree.

        Args:
            robot: The robot.
            crank: Name of a joint that is not cut open.
        """
        self.bodies: list[_Body] = []
        self.home: dict[str, int] = {}
        self.leftover: list[Joint] = []
        self._edges: list[_Edge] = []
        kept = self._spanning(robot, crank)
        at: dict[str, list[Joint]] = {link: [] for link in robot.links}
        for joint in kept:
            at[joint.parent].append(joint)
            at[joint.child].append(joint)
        children = {joint.child for joint in kept}
        for root in sorted(robot.links, key=lambda link: link in children):
            if root not in self.home:
                self._grow(root, at, robot.roots.get(root, IDENTITY))

    def _spanning(self, robot: Robot, crank: str) -> list[Joint]:
        """Returns the joints of a spanning tree; stores the others in `leftover`."""
        top = {link: link for link in robot.links}  # leads from each link to one of its group
        kept = list[Joint]()
        depths, kinds = _depths(robot), (FIXED, PRISMATIC, REVOLUTE)

        def order(joint: Joint) -> tuple[bool, int, int]:
            """Puts the joints last that may be cut: those of a tip, and those that do not turn."""
            rank = kinds.index(joint.kind) if joint.kind in kinds else len(kinds)
            is_kept = joint.kind == FIXED or joint.name == crank
            deep = max(depths.get(link, 0) for link in (joint.parent, joint.child))
            return not is_kept, rank, deep

        for joint in sorted(robot.joints, key=order):
            first, second = joint.parent, joint.child
            while top[first] != first:
                first = top[first]
            while top[second] != second:
                second = top[second]
            (self.leftover if first == second else kept).append(joint)
            top[second] = first
        return kept

    def _grow(self, root: str, at: Mapping[str, Sequence[Joint]], base: Transform) -> None:
        """Adds the bodies that a root carries."""
        self.home[root] = len(self.bodies)
        self.bodies.append(_Body({root: IDENTITY}, None, base))
        waiting = [root]
        while waiting:
            link = waiting.pop()
            own = self.home[link]
            for joint in at[link]:
                is_down = joint.parent == link
                other = joint.child if is_down else joint.parent
                if other in self.home:
                    continue
                waiting.append(other)
                if joint.kind == FIXED:
                    step = joint.moved(0.0)
                    place = self.bodies[own].links[link].then(step if is_down else step.inverse())
                    self.bodies[own].links[other] = place
                    self.home[other] = own
                    continue
                new = self.home[other] = len(self.bodies)
                self.bodies.append(_Body({other: IDENTITY}, len(self._edges)))
                self._edges.append(_Edge(joint, (own, new) if is_down else (new, own)))

    def name(self, body: int) -> str:
        """Returns the name of a body's first link."""
        return next(iter(self.bodies[body].links))

    def ancestors(self, body: int) -> list[int]:
        """Returns the bodies from a body to its root, both included."""
        path = [body]
        while (number := self.bodies[path[-1]].above) is not None:
            first, second = self._edges[number].ends
            path.append(first if second == path[-1] else second)
        return path

    def edges_of(self, body: int) -> list[_Edge]:
        """Returns the joints of a body."""
        return [edge for edge in self._edges if body in edge.ends]

    def frames(self, edge: _Edge) -> dict[int, Transform]:
        """Returns the pose of a joint's frame in the coordinates of its parent and child body."""
        (parent, child), joint = edge.ends, edge.joint
        return {
            parent: self.bodies[parent].links[joint.parent].then(joint.in_parent),
            child: self.bodies[child].links[joint.child].then(joint.in_child),
        }

    def poses(self, values: Mapping[str, float]) -> list[Transform]:
        """Returns the pose of each body at joint values; those left out are 0."""
        found = list[Transform]()
        for number, body in enumerate(self.bodies):
            if body.above is None:
                found.append(body.base)
                continue
            edge = self._edges[body.above]
            (parent, child), joint = edge.ends, edge.joint
            step = (
                self.bodies[parent].links[joint.parent]
                .then(joint.moved(values.get(joint.name, 0.0)))
                .then(self.bodies[child].links[joint.child].inverse())
            )  # fmt: skip
            other = parent if number == child else child
            found.append(found[other].then(step if number == child else step.inverse()))
        return found

    def cycle(self, closure: Closure) -> list[_Pin]:
        """Returns the pins of a closure's loop, the closure last; empty if there is no loop."""
        homes = [self.home[link] for link in closure.links]
        ways = [self.ancestors(home) for home in homes]
        common = next((body for body in ways[0] if body in ways[1]), None)
        if common is None:
            return []
        first, second = (way[: way.index(common) + 1] for way in ways)
        bodies = [*first, *second[-2::-1]]
        pins = list[_Pin]()
        for near, far in itertools.pairwise(bodies):
            numbers = self.bodies[near].above, self.bodies[far].above
            edges = (self._edges[number] for number in numbers if number is not None)
            edge = next(edge for edge in edges if set(edge.ends) == {near, far})
            places = {body: pose.place for body, pose in self.frames(edge).items()}
            pins.append(_Pin((near, far), places, edge))
        places = {
            home: self.bodies[home].links[link].of(point)
            for home, link, point in zip(homes, closure.links, closure.points, strict=True)
        }
        return [*pins, _Pin((bodies[-1], bodies[0]), places, closure=closure)]


def _depths(robot: Robot) -> dict[str, int]:
    """Returns how many joints are between each link and a root, on the shortest way."""
    below: dict[str, list[str]] = {link: [] for link in robot.links}
    for joint in robot.joints:
        below[joint.parent].append(joint.child)
    children = {joint.child for joint in robot.joints}
    found = {link: 0 for link in robot.links if link not in children}
    waiting = deque(found)
    while waiting:
        link = waiting.popleft()
        for child in below[link]:
            if child not in found:
                found[child] = found[link] + 1
                waiting.append(child)
    return found


def find_loop(
    robot: Robot,
    crank: str,
    close: tuple[str, str] | None = None,
    frame: str = '',
    at: Mapping[str, float] | None = None,
    up: Array | None = None,
    world: str = '',
    *,
    weld: bool = False,
) -> PlanarLoop:
    """Finds the linkage in the loop that contains a joint.

    Args:
        robot: The robot.
        crank: Name of the driven joint.
        close: Names of two links whose origins coincide in the closed loop; None if the model has
            a closure.
        frame: Name of a link of the fixed body; empty for the loop's body nearest to the root.
        at: Joint values of a pose, rad or m; those left out are 0.
        up: Direction opposite to gravity in the axes of the root; None for the model's gravity.
        world: Name of a link at rest, relative to which one joint turns the frame; empty if the
            frame is at rest.
        weld: Whether the links of `close` are fixed to each other in the closed loop.

    Returns:
        The mechanism, with its joints and bodies.

    Raises:
        ConfigurationError: A name is unknown, or there is no such loop.
    """
    values = dict(at or {})
    names = Counter(joint.name for joint in robot.joints if joint.name)
    if twice := next((name for name, times in names.items() if times > 1), ''):
        raise ConfigurationError(f'two joints are named {shown(twice)}: rename one')
    movable = {joint.name: joint for joint in robot.joints if joint.name and joint.kind != FIXED}
    _require_known('--crank', [crank], movable, 'movable joint')
    _require_known('--at', values, movable, 'movable joint')
    _require_known('--close', close or (), robot.links, 'link')
    _require_known('--frame', [frame] if frame else [], robot.links, 'link')
    _require_known('--world', [world] if world else [], robot.links, 'link')
    if weld and close:
        fixed = Joint('', FIXED, *close, IDENTITY)
        robot = robot._replace(joints=[*robot.joints, fixed], closures=())
        close = None
    tree = _Tree(robot, crank)
    cycle = _from_frame(tree, _the_loop(robot, tree, crank, close), crank, frame)
    gravity = robot.gravity
    if up is not None:
        if not (length := math.hypot(*up)):
            raise ConfigurationError('--up 0 0 0 is not a direction: give one, such as 0 0 1')
        gravity = -math.hypot(*gravity) / length * up
    turns = _frame_joint(tree, cycle, world) if world else None
    if turns:
        values.pop(turns.joint.name, None)  # gravity is that at its 0
    return _Planar(robot, tree, cycle, values, gravity, crank, turns).found()


def _require_known(
    option: str, names: Iterable[str], known: Mapping[str, object], noun: str
) -> None:
    for name in names:
        if name not in known:
            has = listed(known) or 'none'
            raise ConfigurationError(
                f'{option} {shown(name)}: there is no such {noun}; the model has {has}'
            )


def _the_loop(robot: Robot, tree: _Tree, crank: str, close: tuple[str, str] | None) -> list[_Pin]:
    """Returns the pins of the only closed loop that contains the crank.

    Raises:
        ConfigurationError: There is no such loop, or several.
    """
    zero = np.zeros(3)
    closures = list(robot.closures)
    others = list(robot.others)
    for joint in tree.leftover:
        if joint.kind in {REVOLUTE, BALL}:
            points = joint.in_parent.place, joint.in_child.place
            axis = joint.in_parent.rotation @ joint.axis if joint.kind == REVOLUTE else None
            name = f'joint {shown(joint.name)}'
            ends = joint.parent, joint.child
            closures.append(Closure(name, ends, points, axis, joint.name))
        else:
            others.append(f'joint {shown(joint.name)} is {joint.kind}: must be revolute or ball')
    if close is not None:
        given = [closure for closure in closures if {*closure.links} == {*close}]
        closures = given or [Closure(' and '.join(close), close, (zero, zero))]
    loops = [(closure, tree.cycle(closure)) for closure in closures]
    loops = [loop for loop in loops if crank in {pin.name for pin in loop[1]}]
    if len(loops) == 1:
        return loops[0][1]
    if close is not None and not loops:
        joined = listed(pin.name for pin in tree.cycle(closures[0])[:-1]) or 'no joint'
        raise ConfigurationError(
            f'--close {" ".join(close)}: the loop between them consists of {joined}: it must '
            f'contain the crank, {crank}'
        )
    if not loops:
        for closure in closures:
            joined = listed(pin.name for pin in tree.cycle(closure)[:-1])
            others.append(f'{closure.name} closes a loop of {joined or "no joint"}')
        has = listed(others, '; ') or 'none'
        raise ConfigurationError(
            f'no closure in the model closes a loop with {crank} (constraints: {has}): give '
            '--close and two links whose origins coincide in the closed loop'
        )
    names = [*dict.fromkeys(' '.join(closure.links) for closure, _ in loops)]
    cure = f'choose one with --close, of {listed(names, "; ")}'
    if len(names) == 1:
        same = listed(closure.name for closure, _ in loops)
        cure = f'they all join {" and ".join(loops[0][0].links)}: keep one of {same}'
    raise ConfigurationError(f'{len(loops)} loops of the model contain {crank}: {cure}')


def _from_frame(tree: _Tree, cycle: list[_Pin], crank: str, frame: str) -> list[_Pin]:
    """Orders the pins of a loop from the frame on, so that the crank comes first.

    A driven cylinder comes third, a driven slider last: the crank is then on the frame.

    Raises:
        ConfigurationError: The loop is too long, or the crank is not on the frame.
    """
    names = listed(pin.name for pin in cycle[:-1])
    if len(cycle) != len(('A0', 'A', 'B', 'B0')):
        raise ConfigurationError(
            f'the loop has {len(cycle) - 1} joints and the closure, {names}: a four-bar, a '
            'slider-crank or a cylinder has 3 and the closure; a longer loop cannot be imported'
        )
    bodies = [pin.bodies[0] for pin in cycle]
    fixed = tree.home[frame] if frame else min(bodies, key=lambda body: len(tree.ancestors(body)))
    if fixed not in bodies:
        members = ', '.join(tree.name(body) for body in bodies)
        raise ConfigurationError(
            f'--frame {frame}: it is not part of the loop, which consists of {members}'
        )
    start = bodies.index(fixed)
    ordered = cycle[start:] + cycle[:start]
    driven = next(pin for pin in ordered if pin.name == crank)
    if driven.kind == PRISMATIC:
        if driven in ordered[:2]:
            ordered = [pin.reversed() for pin in reversed(ordered)]
        return ordered
    if ordered[0].name != crank:
        ordered = [pin.reversed() for pin in reversed(ordered)]
    if ordered[0].name != crank:
        own = [pin.name for pin in cycle if fixed in pin.bodies and pin.edge]
        raise ConfigurationError(
            f'--crank {crank}: it is not on the frame {tree.name(fixed)}, which '
            f'carries {" and ".join(own) or "no joint"}: drive one of them, or give --frame and a '
            'link next to the crank'
        )
    return ordered


def _frame_joint(tree: _Tree, cycle: Sequence[_Pin], world: str) -> _Edge:
    """Returns the joint between a link at rest and the frame.

    Raises:
        ConfigurationError: There is not exactly one joint between them, or it does not turn.
    """
    loop, start = [pin.bodies[0] for pin in cycle], cycle[0].bodies[0]
    name, home = tree.name(start), tree.home[world]
    ways = [tree.ancestors(body) for body in (start, home)]
    common = next((body for body in ways[0] if body in ways[1]), None)
    if common is None:
        raise ConfigurationError(f'--world {world}: no joint connects it to the frame {name}')
    first, second = (way[: way.index(common) + 1] for way in ways)
    way = [*first, *second[-2::-1]]
    edges = [
        next(edge for edge in tree.edges_of(near) if {*edge.ends} == {near, far})
        for near, far in itertools.pairwise(way)
    ]
    names = listed(edge.joint.name or 'a joint without a name' for edge in edges)
    if {*way[1:]} & {*loop}:
        problem = 'the loop itself is between them'
    elif not edges:
        problem = 'it is fixed to the frame, which is then at rest; leave --world out'
    elif len(edges) > 1:
        problem = (
            f'{len(edges)} joints, {names}, are between them, but only one can be measured; give '
            'the next link to the frame, if it is at rest'
        )
    elif edges[0].joint.kind != REVOLUTE or not edges[0].joint.name:
        problem = f'{names} must be a revolute joint with a name'
    else:
        return edges[0]
    raise ConfigurationError(f'--world {world}, and the frame {name}: {problem}')


class _Planar:
    """Projects a loop of four bodies onto its plane."""

    def __init__(
        self,
        robot: Robot,
        tree: _Tree,
        cycle: list[_Pin],
        values: Mapping[str, float],
        gravity: Array,
        driven: str,
        turns: _Edge | None = None,
    ) -> None:
        """Computes the plane.

        Args:
            robot: The robot.
            tree: Its bodies.
            cycle: The pins A0, A, B and B0, the frame first.
            values: Joint values of the pose.
            gravity: Acceleration of gravity in the axes of the root, m/s^2.
            driven: Name of the driven joint.
            turns: The joint that turns the frame; None if the frame is at rest.

        Raises:
            ConfigurationError: The loop is not planar, or has no mechanism with its joints.
        """
        self.turns, self.driven = turns, driven
        self.tilts: list[tuple[str, float]] = []  # axes that are nearly parallel, rad
        self.slide, self.lengthens = 0.0, 1.0  # of a cylinder: rod position and ratio
        self.robot, self.tree, self.cycle, self.values = robot, tree, cycle, values
        self.bodies = [pin.bodies[0] for pin in cycle]  # frame, crank, coupler, output
        self.kind, output = self._kind()
        self.is_cylinder = self.kind == _CYLINDER
        self.names = ('frame', 'crank', 'rod' if self.is_cylinder else 'coupler', output)
        loop = {pin.name for pin in cycle}
        # The loop's joints at 0; the others do not change it.
        outside = {name: value for name, value in values.items() if name not in loop}
        self.zero, self.posed = tree.poses(outside), tree.poses(values)
        # A cylinder's loop may be closed at the crank.
        self.turning = next(pin for pin in cycle if pin.edge and pin.kind == REVOLUTE)
        self.world_normal = self._axis(self.turning)
        self._require_plane()
        # In the frame's axes: the normal, and the y axis, up as far as they allow.
        self.normal = self.zero[self.bodies[0]].rotation.T @ self.world_normal
        self.gravity = self.posed[self.bodies[0]].rotation.T @ gravity
        flat = [_in_plane(axis, self.normal) for axis in np.eye(3)[[1, 0, 2]]]
        ways = [way / length for way in flat if (length := math.hypot(*way)) > _SLANTED]
        self.y = max(
            (sign * way for way in ways for sign in (1.0, -1.0)),
            key=lambda way: round(float(-self.gravity @ way), 6),
        )
        self.x = np.cross(self.y, self.normal)

    def _kind(self) -> tuple[str, str]:
        """Returns the mechanism and the name of its output link.

        Raises:
            ConfigurationError: There is no mechanism with these joints.
        """
        kinds = tuple(pin.kind for pin in self.cycle)
        if kinds in _KINDS:
            return _KINDS[kinds]
        words = (f'{pin.name} {kind}' for pin, kind in zip(self.cycle, kinds, strict=True))
        raise ConfigurationError(
            f'the joints of the loop are {", ".join(words)}: a four_bar has 4 revolute ones, '
            'a slider_crank has a prismatic one on the frame, an inverted_slider_crank a '
            'prismatic one between two links, of which the crank carries the second; other loops '
            'cannot be imported'
        )

    def _outwards(self, pin: _Pin) -> tuple[int, int]:
        """Returns the bodies of a pin, the one nearer to the frame in the cut loop first."""
        cut = next(i for i, other in enumerate(self.cycle) if other.edge is None)
        is_before = self.cycle.index(pin) < cut
        return pin.bodies if is_before else (pin.bodies[1], pin.bodies[0])

    def _axis(self, pin: _Pin) -> Array:
        """Returns the axis about or along which a joint moves the body farther from the frame."""
        if pin.edge is None:
            return np.zeros(3)
        axis = self._own_axis(pin.edge)
        return axis if self._outwards(pin)[0] == pin.edge.ends[0] else -axis

    def _own_axis(self, edge: _Edge) -> Array:
        """Returns the axis of a joint, about or along which its child moves."""
        parent, _ = edge.ends
        turn = self.zero[parent].rotation @ self.tree.frames(edge)[parent].rotation
        axis: Array = turn @ edge.joint.axis
        return axis

    def _require_plane(self) -> None:
        """Requires axes parallel to the crank's, and a guide normal to it.

        Raises:
            ConfigurationError: The loop is not planar, or the frame does not turn in its plane.
        """
        for pin in self.cycle[1:]:
            if pin.edge is not None:
                self._require_axis(pin.name, self._axis(pin), slides=pin.kind == PRISMATIC)
            elif pin.closure and pin.closure.axis is not None:
                link = pin.closure.links[0]
                body = self.tree.home[link]
                turn = self.zero[body].rotation @ self.tree.bodies[body].links[link].rotation
                self._require_axis(pin.closure.joint, turn @ pin.closure.axis, slides=False)
        if self.turns is not None:
            self._require_axis(self.turns.joint.name, self._own_axis(self.turns), slides=False)

    def _require_axis(self, name: str, axis: Array, *, slides: bool) -> None:
        normal = self.world_normal
        along, across = abs(float(axis @ normal)), math.hypot(*np.cross(axis, normal))
        angle = math.atan2(along, across) if slides else math.atan2(across, along)
        if angle > _NOTED:
            self.tilts.append((name, angle))
        if angle > _PARALLEL:
            need = 'normal' if slides else 'parallel'
            raise ConfigurationError(
                f'the axis of {name} is {angle:.6g} rad ({math.degrees(angle):.4g} deg) off being '
                f'{need} to that of {self.turning.name}: must be at most '
                f'{_PARALLEL:g} rad, because the linkage is planar'
            )

    def _flat(self, body: int, vector: Array) -> complex:
        """Returns a vector of a body in the plane, with all joints of the loop at 0, x + iy."""
        turn = self.zero[self.bodies[0]].rotation.T @ self.zero[body].rotation
        inside = turn @ vector
        return complex(self.x @ inside, self.y @ inside)

    def _length(self, body: int, vector: Array) -> float:
        """Returns the length in the plane of a vector of a body, with the digits of the file."""
        return math.hypot(*_in_plane(vector, self._normal_in(body)))

    def _normal_in(self, body: int) -> Array:
        """Returns the normal in the axes of a body."""
        normal: Array = self.zero[body].rotation.T @ self.world_normal
        return normal

    def found(self) -> PlanarLoop:
        """Returns the mechanism.

        Raises:
            ConfigurationError: A link has no length, or the pose does not determine the assembly.
        """
        A0, A, B, B0 = self.cycle
        frame, crank, coupler, output = self.bodies
        slides, vectors = self.kind == 'slider_crank', self._vectors()
        lengths = {body: self._length(body, vector) for body, vector in vectors.items()}
        for body, length in lengths.items():
            if length < _SHORTEST:
                raise ConfigurationError(
                    f'both pins of {self.tree.name(body)} are in one place, {length:g} m apart: '
                    'a link of the loop needs a length'
                )
        angles = {body: cmath.phase(self._flat(body, v)) for body, v in vectors.items()}
        values: dict[str, Any] = {'mechanism': self.kind}
        size = max(lengths.values())
        if self.is_cylinder:
            way, self.slide, offset = self._cylinder(A, B, B0)
            angles[coupler] = angles[output] = way
            values['input'] = 'cylinder' if B.name == self.driven else 'crank'
            values['offset'] = _tidy(offset, size)
        for body, start in zip((crank, coupler, output), (A0, A, B0), strict=True):
            name = self.names[self.bodies.index(body)]
            if body in lengths:
                values[f'{name}.length'] = _tidy(lengths[body], size)
            values |= self._masses(name, body, start, angles.get(body), size)
        zeros = {body: angles[body] for body in (crank, coupler, output) if body in angles}
        if slides:
            guide, slide, offset = self._guide(B, B0, A0)
            values['frame.angle'], values['slider.offset'] = guide, _tidy(offset, size)
            values['input'] = 'slider' if B0.name == self.driven else 'crank'
            zeros[output] = slide
        else:
            values['frame.length'] = _tidy(lengths[frame], size)
            values['frame.angle'] = angles[frame]
        if self.turns:
            place = self.tree.frames(self.turns)[frame].place - A0.places[frame]
            pivot, is_above = self._flat(frame, place), self.turns.ends[1] == frame
            is_along = self._own_axis(self.turns) @ self.world_normal > 0
            values |= {
                'frame_joint.name': self.turns.joint.name,
                'frame_joint.zero': 0.0,
                'frame_joint.ratio': 1.0 if is_along == is_above else -1.0,
                'frame_joint.pivot': [_tidy(pivot.real, size), _tidy(pivot.imag, size)],
            }
        pull = complex(self.x @ self.gravity, self.y @ self.gravity)
        largest = math.hypot(*self.gravity)
        values['gravity'] = [_tidy(pull.real, largest), _tidy(pull.imag, largest)]
        return self._closed(values, self._joints(zeros))

    def _vectors(self) -> dict[int, Array]:
        """Returns the vector between the pins of each body that has two."""
        A0, A, B, B0 = self.cycle
        frame, crank, coupler, output = self.bodies
        found = {crank: A.places[crank] - A0.places[crank]}
        if not self.is_cylinder:
            found[coupler] = B.places[coupler] - A.places[coupler]
        if self.kind == 'four_bar':
            found[output] = B.places[output] - B0.places[output]
        if self.kind != 'slider_crank':
            found[frame] = B0.places[frame] - A0.places[frame]
        return found

    def _masses(
        self, name: str, body: int, start: _Pin, angle: float | None, size: float
    ) -> dict[str, Any]:
        """Returns mass and, if the body has a direction, rad, inertia and centre from a pin."""
        mass = self._lumped(body)
        if angle is None:
            return {f'{name}.mass': mass.mass}
        arm = self._flat(body, mass.center - start.places[body])
        along, normal = arm * cmath.exp(-1j * angle), self._normal_in(body)
        return {
            f'{name}.mass': mass.mass,
            f'{name}.inertia': float(normal @ mass.inertia @ normal),
            f'{name}.center': [_tidy(along.real, size), _tidy(along.imag, size)],
        }

    def _guide(self, B: _Pin, B0: _Pin, A0: _Pin) -> tuple[float, float, float]:
        """Returns direction, slider position at joint value 0, and offset of the guide."""
        frame, *_, output = self.bodies
        axis = self.zero[frame].rotation.T @ self._axis(B0)
        guide = complex(self.x @ axis, self.y @ axis)
        guide /= abs(guide)
        pin = self._flat(frame, B0.places[frame] - A0.places[frame])
        pin += self._flat(output, B.places[output] - B0.places[output])
        place = pin * guide.conjugate()
        return cmath.phase(guide), place.real, place.imag

    def _cylinder(self, A: _Pin, guide: _Pin, B0: _Pin) -> tuple[float, float, float]:
        """Returns direction and rod position at joint value 0, and the offset of the rod.

        The direction is that from the barrel to the crank pin at the given pose.
        """
        _, _, rod, barrel = self.bodies
        axis = self._axis(guide)
        if self._outwards(guide)[0] == rod:
            axis = -axis
        inside = self.zero[self.bodies[0]].rotation.T @ axis
        way = complex(self.x @ inside, self.y @ inside)
        way /= abs(way)
        arm = self._flat(barrel, guide.places[barrel] - B0.places[barrel])
        arm += self._flat(rod, A.places[rod] - guide.places[rod])
        value = self.values.get(guide.name, 0.0)
        self.lengthens = 1.0 if (arm * way.conjugate()).real + value >= 0 else -1.0
        way *= self.lengthens
        place = arm * way.conjugate()
        return cmath.phase(way), place.real, place.imag

    def _joints(self, zeros: Mapping[int, float]) -> dict[str, JointMap]:
        """Returns the joint of each link: the one towards the frame."""
        name_of = dict(zip(self.bodies, self.names, strict=True))
        found = {}
        for pin in self.cycle:
            if pin.edge is None:
                continue
            near, far = self._outwards(pin)
            name, zero, parent = pin.edge.joint.name, zeros[far], name_of[near]
            if self.is_cylinder and pin.kind == PRISMATIC:
                found['rod'] = JointMap(name, self.slide, self.lengthens, 'barrel')
                continue
            if pin.kind == PRISMATIC:  # the guide has the direction of the joint
                found[name_of[far]] = JointMap(name, zero, 1.0, parent)
                continue
            if parent == 'slider':  # does not turn
                parent = 'frame'
            if parent != 'frame':
                zero = float(wrap(zero - zeros[near]))
            ratio = 1.0 if self._axis(pin) @ self.world_normal > 0 else -1.0
            # A rod turns with its barrel.
            parent, link = ('barrel' if x == 'rod' else x for x in (parent, name_of[far]))
            found[link] = JointMap(name, zero + 0.0, ratio, parent)
        return {name: found[name] for name in self.names[1:]}

    def _lumped(self, body: int) -> Inertial:
        """Returns the mass of a body in its own coordinates.

        Raises:
            ConfigurationError: A mass is negative, that of a mesh, or not finite.
        """
        parts = []
        for link, pose in self.tree.bodies[body].links.items():
            inertial = self.robot.links[link]
            if inertial is None:
                continue
            if inertial.mass < 0:
                raise ConfigurationError(
                    f'the mass of {link} is {inertial.mass:g} kg: must be 0 or more'
                )
            if not math.isfinite(inertial.mass):
                raise ConfigurationError(
                    f'the mass of {link} is that of a mesh, which is not read, or not finite: '
                    'give it an inertial'
                )
            turned = pose.rotation @ inertial.inertia @ pose.rotation.T
            parts.append(Inertial(inertial.mass, pose.of(inertial.center), turned))
        return lumped(parts) or _MASSLESS

    def _closed(self, values: dict[str, Any], joints: dict[str, JointMap]) -> PlanarLoop:
        """Chooses the assembly that is nearer to the pose.

        Raises:
            ConfigurationError: The loop cannot close, or both assemblies are equally near.
        """
        given = {joint.name: self.values.get(joint.name, 0.0) for joint in joints.values()}
        crank = next(joint for joint in joints.values() if joint.name == self.driven)
        # The angle of a cylinder's crank determines the assembly.
        is_crank = self.is_cylinder and values['input'] == 'crank'
        own = crank.zero + given[crank.name] / crank.ratio
        size = max(value for name, value in values.items() if name.endswith('.length'))
        found = []
        for assembly in (OPEN,) if is_crank else (OPEN, CROSSED):
            made = values if is_crank else {**values, 'assembly': assembly}
            solver = Solver(build(MECHANISMS[self.kind], made))
            try:
                state = solver.state(own, 0.0, 0.0)
            except UnreachableError as error:
                turn = 0.0 if solver.reach.slides else math.tau
                turns = [turn and turn * round((own - sum(x) / 2) / turn) for x in error.arcs]
                reached = ' or '.join(
                    ' to '.join(f'{(x + turn - crank.zero) * crank.ratio:.6g}' for x in arc)
                    for arc, turn in zip(error.arcs, turns, strict=True)
                )
                unit = 'm' if solver.reach.slides else 'rad, plus whole turns'
                raise ConfigurationError(
                    f'the loop cannot close with {crank.name} at {given[crank.name]:g}: it can '
                    f'from {reached} {unit}; give --at {crank.name}=VALUE'
                ) from error
            places = dict(zip(solver.links, map(float, state.position), strict=True))
            closed, away = dict[str, float](), 0.0
            for link, joint in joints.items():
                slides = link in _SLIDING
                is_relative = joint.parent != 'frame' and not slides
                move = places[link] - (places[joint.parent] if is_relative else 0.0)
                move -= joint.zero
                move = move if slides else float(wrap(move))
                closed[joint.name] = joint.ratio * move + 0.0
                if joint is not crank:
                    off = closed[joint.name] - given[joint.name]
                    away += abs(off) / size if slides else abs(float(wrap(off)))
            closed[crank.name] = given[crank.name]
            found.append((away, made, closed))
        (away, made, closed), *others = sorted(found, key=lambda one: one[0])
        for other, _, pose in others:
            if other - away >= _ALIKE:
                continue
            moves = {link: pose[x.name] - closed[x.name] for link, x in joints.items()}
            turned = {x: wrap(move) for x, move in moves.items() if x not in _SLIDING}
            if max(map(abs, {**moves, **turned}.values())) < _ONE:
                raise ConfigurationError(
                    f'at {crank.name} {given[crank.name]:g} all links are in line, and both '
                    f'assemblies meet: give --at {crank.name}=VALUE, another value'
                )
            passive = [joint.name for joint in joints.values() if joint is not crank]
            raise ConfigurationError(
                'both assemblies are equally far from this pose: give --at and a value of '
                f'{" or ".join(passive)} in the wanted assembly'
            )
        ends = [self.gap({**self.values, **pose}) for pose in (closed, given)]
        self._require_closed(ends[0][0], size, closed)
        members = ([*self.tree.bodies[body].links] for body in self.bodies)
        return PlanarLoop(
            self.kind, made, joints, dict(zip(self.names, members, strict=True)),
            (self.cycle[0].places[self.bodies[0]], self.x, self.y, self.normal),
            given, closed, ends[0][0], ends[1][0], ends[0][1], [*self._notes(crank)],
        )  # fmt: skip

    def _require_closed(self, residual: float, size: float, pose: Mapping[str, float]) -> None:
        """Requires that the ends of the loop meet, as nearly as parallel axes allow.

        Raises:
            ConfigurationError: They do not.
        """
        # An axis that is not parallel moves what it carries, also along the normal.
        reach = sum(math.hypot(*place) for pin in self.cycle for place in pin.places.values())
        allowed = _CLOSED * size + sum(angle for _, angle in self.tilts) * reach
        if residual > allowed:
            values = ', '.join(f'{name} {value:.6g}' for name, value in pose.items())
            raise ConfigurationError(
                f'the ends of the loop stay {residual:.4g} m apart at {values}: must be at most '
                f'{allowed:.4g} m; give --at and the values of another pose'
            )

    def gap(self, values: Mapping[str, float]) -> tuple[float, float]:
        """Returns the distance of both ends of the loop in the plane and along its normal, m."""
        poses = self.tree.poses(values)
        closure = next(pin for pin in self.cycle if pin.edge is None)
        first, second = (poses[body].of(closure.places[body]) for body in closure.bodies)
        normal = poses[self.bodies[0]].rotation @ self.normal
        return math.hypot(*_in_plane(second - first, normal)), abs(
            float((second - first) @ normal)
        )

    def _mimics(self, crank: JointMap) -> Iterator[str]:
        """Yields the couplings in the file, and how to measure a crank that is coupled."""
        for pin in self.cycle:
            if not (pin.edge and pin.edge.joint.mimics):
                continue
            cure = 'the loop determines its value'
            if pin is self.cycle[0]:
                other, multiplier, offset = pin.edge.joint.mimics
                cure = 'it must be measured itself'
                if multiplier:
                    zero = json.dumps(float(crank.zero + offset / crank.ratio))
                    cure = (
                        f'if only {other} is measured, give joints.crank name: '
                        f'{json.dumps(other)}, zero: {zero}, ratio: {crank.ratio / multiplier!r}'
                    )
            yield f'{pin.name}: <mimic> is ignored; {cure}'

    def _off_pin(self) -> Iterator[str]:
        """Yields what is wrong if the slider's centre of mass is not its pin, as in the model.

        Raises:
            ConfigurationError: The frame turns, and the torque would be wrong.
        """
        if self.kind != 'slider_crank':
            return
        *_, output = self.bodies
        mass, pin = self._lumped(output), self.cycle[2].places[output]
        if mass.mass and (off := abs(self._flat(output, mass.center - pin))) > _OFF_PIN:
            where = f"the slider's centre of mass is {off:.4g} m from its pin"
            if self.turns:
                raise ConfigurationError(
                    f'{where}: on a frame that turns it must be in the pin; leave out --world for '
                    'the torque on a frame at rest'
                )
            yield f'{where}, but is taken there: the moment on the guide is wrong'

    def _simplified(self) -> Iterator[str]:
        """Yields what the model has and the linkage has not, and what is assumed."""
        for name, angle in self.tilts:
            yield (
                f'the axis of {name} is {angle:.4g} rad ({math.degrees(angle):.3g} deg) off, but '
                'is taken as exact'
            )
        yield from self.robot.notes
        left_out = {joint.name: joint.left_out for joint in self.robot.joints}
        for pin in self.cycle:
            name = pin.edge.joint.name if pin.edge else pin.closure.joint if pin.closure else ''
            if name and (text := left_out.get(name)):
                yield f'{name}: {text}: left out'
            if pin.closure and pin.closure.joint:
                yield f'{pin.closure.joint} closes the loop: its value is not published'
        for body in self.bodies[1:]:
            for link in self.tree.bodies[body].links:
                if link in self.robot.doubts:
                    yield f'{link}: {self.robot.doubts[link]}'

    def _notes(self, crank: JointMap) -> Iterator[str]:
        """Yields sentences about probably wrong values and omitted properties of the robot."""
        for joint in self.robot.joints:
            value = self.values.get(joint.name, 0.0)
            if joint.kind == REVOLUTE and abs(value) > math.tau:
                yield (
                    f'{joint.name} is at {value:g} rad; did you mean {value:g} deg = '
                    f'{math.radians(value):.4g} rad?'
                )
        yield from self._simplified()
        yield from self._mimics(crank)
        yield from self._off_pin()
        loop = [id(pin.edge) for pin in self.cycle]
        for body, name in zip(self.bodies, self.names, strict=True):
            others = [edge for edge in self.tree.edges_of(body) if id(edge) not in loop]
            if name == 'frame':
                above = self.tree.ancestors(body)[1:]
                others = [edge for edge in others if edge is not self.turns]
                moving = [edge.joint.name for edge in others if {*edge.ends} & {*above}]
                if moving:
                    yield (
                        f'the frame hangs on {", ".join(moving)}: it is taken as at rest, and '
                        'gravity is that of this pose; --world follows one joint in the plane'
                    )
            else:
                for edge in others:
                    yield (
                        f'{edge.joint.name} moves relative to the {name}: the mass beyond it is '
                        'left out'
                    )
            bare = [link for link in self.tree.bodies[body].links if self.robot.links[link]]
            if name != 'frame' and not bare:
                yield f'the {name} {self.tree.name(body)} has no mass in the model'


def _in_plane(vector: Array, normal: Array) -> Array:
    """Returns the part of a vector that is normal to a unit vector."""
    part: Array = vector - (vector @ normal) * normal
    return part


def _tidy(number: float, size: float) -> float:
    """Rounds a number to a fixed fraction of a size; returns 0.0 instead of -0.0."""
    return round(number, _DIGITS - math.ceil(math.log10(size))) + 0.0 if size else number
