# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Chooses the closed loops of a robot model that move with its driven joint."""

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple, NoReturn

import numpy as np

from linkage_lab.robots.model import (
    BALL,
    FIXED,
    IDENTITY,
    PRISMATIC,
    REVOLUTE,
    Closure,
    Joint,
    RobotModel,
    listed,
)
from linkage_lab.robots.tree import Edge, Tree
from linkage_ros import ConfigurationError
from linkage_ros.formulas import Array
from linkage_ros.quantities import shown

_Loop = tuple[Closure, list[Edge]]


class Request(NamedTuple):
    """The request to import part of a robot.

    Attributes:
        crank: Name of the driven joint.
        close: Pairs of links whose origins coincide in the closed loops; empty if the model has
            closures.
        frame: Name of a link of the fixed body; empty for the body of the loops nearest to the
            root.
        at: Joint values of a pose, rad or m; those left out are 0.
        up: Direction opposite to gravity in the axes of the root; None for the model's gravity.
        world: Name of a link at rest, relative to which one joint turns the frame; empty if the
            frame is at rest.
        weld: Whether the links of `close` are fixed to each other in the closed loops.
    """

    crank: str
    close: Sequence[tuple[str, str]] = ()
    frame: str = ''
    at: Mapping[str, float] = {}
    up: Array | None = None
    world: str = ''
    weld: bool = False


class Outward(NamedTuple):
    """A joint of a loop, seen from the frame.

    Attributes:
        edge: The joint.
        near: Number of its body nearer to the frame.
        far: Number of its other body.
    """

    edge: Edge
    near: int
    far: int


class Loops(NamedTuple):
    """The closed loops of a driven joint.

    Attributes:
        robot: The robot.
        tree: The bodies of the robot.
        closures: The closures of the loops.
        joints: The joints of the loops, each after those that lead to it from the frame.
        frame: Number of the fixed body.
        driven: The driven joint.
        turning: The revolute joint whose axis is the normal of the plane.
        frame_joint: The joint that turns the frame; None if the frame is at rest.
    """

    robot: RobotModel
    tree: Tree
    closures: list[Closure]
    joints: list[Outward]
    frame: int
    driven: Edge
    turning: Edge
    frame_joint: Edge | None

    @property
    def bodies(self) -> list[int]:
        """Numbers of the bodies of the loops, the frame first."""
        return [self.frame, *(joint.far for joint in self.joints)]


def find_loops(robot: RobotModel, request: Request) -> Loops:
    """Finds the loops that move with a joint.

    Raises:
        ConfigurationError: A name is unknown, or there is no loop of the joint.
    """
    _require_names(robot, request)
    close = [*request.close]
    if request.weld:
        # Fixed joints close the loops; as with --close alone, no other closure of the model does.
        joints = [Joint('', FIXED, *pair, IDENTITY) for pair in close]
        robot, close = robot._replace(joints=[*robot.joints, *joints], closures=()), []
    tree = Tree(robot, request.crank)
    loops = _loops_of(robot, tree, request.crank, close)
    # Each joint once; by identity, because arrays in joints have no hash.
    edges = [*{id(edge): edge for _, loop in loops for edge in loop}.values()]
    for edge in edges:
        if edge.joint.kind not in {REVOLUTE, PRISMATIC}:
            raise ConfigurationError(
                f'joint {shown(edge.joint.name)} of the loop is {edge.joint.kind}: must be '
                'revolute or prismatic'
            )
    bodies = [*dict.fromkeys(body for edge in edges for body in edge.ends)]
    frame = _frame(tree, bodies, request.frame)
    driven = next(edge for edge in edges if edge.joint.name == request.crank)
    if driven.joint.kind == REVOLUTE and frame not in driven.ends:
        on_frame = [edge.joint.name for edge in edges if frame in edge.ends]
        raise ConfigurationError(
            f'--crank {request.crank}: it is not on the frame {tree.name(frame)}, which '
            f'carries {" and ".join(on_frame) or "no joint"}: drive one of them, or give --frame '
            'and a link next to the crank'
        )
    return Loops(
        robot, tree, [closure for closure, _ in loops], _outward(edges, frame), frame, driven,
        _turning(tree, loops[0], frame, driven),
        _frame_joint(tree, bodies, frame, request.world) if request.world else None,
    )  # fmt: skip


def _require_names(robot: RobotModel, request: Request) -> None:
    """Requires different names of joints, and known names in the request.

    Raises:
        ConfigurationError: Two joints have one name, or the model does not have a name.
    """
    counts = Counter(joint.name for joint in robot.joints if joint.name)
    for name, count in counts.items():
        if count > 1:
            raise ConfigurationError(f'two joints are named {shown(name)}: rename one')
    movable = {joint.name: joint for joint in robot.joints if joint.name and joint.kind != FIXED}
    _require_known('--crank', [request.crank], movable, 'movable joint')
    _require_known('--at', request.at, movable, 'movable joint')
    links = [link for pair in request.close for link in pair]
    _require_known('--close', links, robot.links, 'link')
    _require_known('--frame', filter(None, [request.frame]), robot.links, 'link')
    _require_known('--world', filter(None, [request.world]), robot.links, 'link')


def _require_known(
    option: str, names: Iterable[str], known: Mapping[str, object], noun: str
) -> None:
    for name in names:
        if name not in known:
            has = listed(known) or 'none'
            raise ConfigurationError(
                f'{option} {shown(name)}: there is no such {noun}; the model has {has}'
            )


def _loops_of(
    robot: RobotModel, tree: Tree, crank: str, close: Sequence[tuple[str, str]]
) -> list[_Loop]:
    """Returns the loops with the crank, and those that share a joint with one of them.

    Raises:
        ConfigurationError: There is none, or a loop of `close` is not among them.
    """
    closures, others = _closures_of(robot, tree)
    if close:
        closures = _closures_between(close, closures)
    loops = [(closure, tree.edges_of_loop(closure)) for closure in closures]
    connected, unconnected = _connected(loops, crank)
    if close and unconnected:
        _refuse_loop(*unconnected[0], crank, is_only=not connected)
    if not connected:
        for closure, loop in unconnected:
            joined = listed(edge.joint.name for edge in loop)
            others.append(f'{closure.name} closes a loop of {joined or "no joint"}')
        has = listed(others, '; ') or 'none'
        raise ConfigurationError(
            f'no closure in the model closes a loop with {crank} (constraints: {has}): give '
            '--close and two links whose origins coincide in the closed loop'
        )
    return sorted(connected, key=lambda loop: crank not in _joint_names(loop))  # its own first


def _closures_of(robot: RobotModel, tree: Tree) -> tuple[list[Closure], list[str]]:
    """Returns the closures of a model and of joints that close loops; and other constraints."""
    closures, others = list(robot.closures), list(robot.others)
    for joint in tree.leftover:
        if joint.kind in {REVOLUTE, BALL}:
            points = joint.in_parent.place, joint.in_child.place
            axis = joint.in_parent.rotation @ joint.axis if joint.kind == REVOLUTE else None
            name = f'joint {shown(joint.name)}'
            closures.append(Closure(name, (joint.parent, joint.child), points, axis, joint.name))
        else:
            others.append(f'joint {shown(joint.name)} is {joint.kind}: must be revolute or ball')
    return closures, others


def _closures_between(
    pairs: Sequence[tuple[str, str]], closures: Sequence[Closure]
) -> list[Closure]:
    """Returns the closures between pairs of links; if there is none, their origins coincide."""
    chosen, origin = list[Closure](), np.zeros(3)
    for pair in pairs:
        in_model = [closure for closure in closures if {*closure.links} == {*pair}]
        chosen += in_model or [Closure(pair[0], pair, (origin, origin))]
    return chosen


def _connected(loops: Sequence[_Loop], crank: str) -> tuple[list[_Loop], list[_Loop]]:
    """Returns the loops that share joints with the crank's, also through others; and the rest."""
    connected, unconnected, joints = list[_Loop](), [*loops], {crank}
    while added := [loop for loop in unconnected if joints & _joint_names(loop)]:
        unconnected = [loop for loop in unconnected if not joints & _joint_names(loop)]
        connected += added
        joints.update(*map(_joint_names, added))
    return connected, unconnected


def _joint_names(loop: _Loop) -> set[str]:
    _, edges = loop
    return {edge.joint.name for edge in edges}


def _refuse_loop(closure: Closure, loop: Sequence[Edge], crank: str, *, is_only: bool) -> NoReturn:
    """Rejects a loop of --close that does not move with the crank.

    Raises:
        ConfigurationError: Always.
    """
    joined = listed(edge.joint.name for edge in loop) or 'no joint'
    start = f'--close {" ".join(closure.links)}: the loop between them consists of {joined}: it '
    if is_only:
        raise ConfigurationError(f'{start}must contain the crank, {crank}')
    raise ConfigurationError(
        f'{start}shares no joint with the loops of {crank}, so that it has a motor of its own: '
        'write two files, one for each motor'
    )


def _frame(tree: Tree, bodies: Sequence[int], frame: str) -> int:
    """Returns the fixed body.

    Raises:
        ConfigurationError: The given one is not part of the loops.
    """
    fixed = tree.home[frame] if frame else min(bodies, key=lambda x: len(tree.ancestors(x)))
    if fixed not in bodies:
        members = ', '.join(tree.name(body) for body in bodies)
        raise ConfigurationError(
            f'--frame {frame}: it is not part of the loop, which consists of {members}'
        )
    return fixed


def _outward(edges: Sequence[Edge], frame: int) -> list[Outward]:
    """Sorts the joints of loops from the frame on."""
    outward, reached, waiting = list[Outward](), {frame}, [*edges]
    while waiting:
        edge = next(edge for edge in waiting if reached & {*edge.ends})
        waiting = [other for other in waiting if other is not edge]
        near, far = edge.ends if edge.ends[0] in reached else edge.ends[::-1]
        outward.append(Outward(edge, near, far))
        reached.add(far)
    return outward


def _turning(tree: Tree, loop: _Loop, frame: int, driven: Edge) -> Edge:
    """Returns the driven joint if it turns; otherwise the first in its loop, from the frame on.

    Of both ways around the loop, it is the one on which the driven joint comes last.

    Raises:
        ConfigurationError: No joint turns.
    """
    if driven.joint.kind == REVOLUTE:
        return driven
    closure, edges = loop
    path = tree.path(*(tree.home[link] for link in closure.links))
    start = path.index(frame) if frame in path else 0
    from_end: list[Edge | None] = [*edges, None]  # None for the closure, between end and start
    around = from_end[start:] + from_end[:start]  # from the frame on
    if around.index(driven) < len(around) / 2:
        around.reverse()
    turning = [edge for edge in around if edge and edge.joint.kind == REVOLUTE]
    if not turning:
        raise ConfigurationError(
            f'no joint of the loop with {driven.joint.name} turns: the linkage must have a crank'
        )
    return turning[0]


def _frame_joint(tree: Tree, bodies: Sequence[int], frame: int, world: str) -> Edge:
    """Returns the joint between a link at rest and the frame.

    Raises:
        ConfigurationError: There is not exactly one joint between them, or it does not turn.
    """
    name, home = tree.name(frame), tree.home[world]
    path = tree.path(frame, home)
    if not path:
        raise ConfigurationError(f'--world {world}: no joint connects it to the frame {name}')
    edges = tree.edges_along(path)
    names = listed(edge.joint.name or 'a joint without a name' for edge in edges)
    if {*path[1:]} & {*bodies}:
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


def gravity_of(robot: RobotModel, up: Array | None) -> Array:
    """Returns gravity in the axes of the root, m/s^2.

    Raises:
        ConfigurationError: `up` has length 0.
    """
    if up is None:
        return robot.gravity
    if not (length := math.hypot(*up)):
        raise ConfigurationError('--up 0 0 0 is not a direction: give one, such as 0 0 1')
    gravity: Array = -math.hypot(*robot.gravity) / length * up
    return gravity
