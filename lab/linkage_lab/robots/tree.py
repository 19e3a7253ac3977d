# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The bodies of a robot model as a tree, and the joints and closures that close loops in it.

Links connected by fixed joints are one body. The coordinates of a body are those of its link
nearest to the root, so that the lengths in the file are not rounded.
"""

import itertools
from collections import deque
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from linkage_lab.robots.model import (
    FIXED,
    IDENTITY,
    PRISMATIC,
    REVOLUTE,
    Closure,
    Joint,
    RobotModel,
    Transform,
)


class Body(NamedTuple):
    """Links connected by fixed joints.

    Attributes:
        links: Pose of each link in the body by name, the first link first.
        above: Number of the joint towards the root; None for a root.
        base: Pose of a root in the root's axes.
    """

    links: dict[str, Transform]
    above: int | None
    base: Transform = IDENTITY


class Edge(NamedTuple):
    """A movable joint of the tree.

    Attributes:
        joint: The joint.
        ends: Numbers of the bodies of its parent and child link.
    """

    joint: Joint
    ends: tuple[int, int]


class Tree:
    """The bodies of a robot, connected by its movable joints.

    Attributes:
        bodies: The bodies, each after the one towards the root.
        home: Number of the body of each link.
        leftover: Joints that close loops.
    """

    def __init__(self, robot: RobotModel, crank: str) -> None:
        """Builds the tree, in which the joint named `crank` is not cut open."""
        self.bodies: list[Body] = []
        self.home: dict[str, int] = {}
        self.leftover: list[Joint] = []
        self._edges: list[Edge] = []
        kept = self._spanning(robot, crank)
        joints_at: dict[str, list[Joint]] = {link: [] for link in robot.links}
        for joint in kept:
            joints_at[joint.parent].append(joint)
            joints_at[joint.child].append(joint)
        # Roots, which are not the child of any joint, come first; `_grow` then adds the links that
        # they carry.
        children = {joint.child for joint in kept}
        for link in sorted(robot.links, key=lambda link: link in children):
            if link not in self.home:
                self._grow(link, joints_at, robot.roots.get(link, IDENTITY))

    def _spanning(self, robot: RobotModel, crank: str) -> list[Joint]:
        """Returns the joints of a spanning tree; stores the others in `leftover`."""
        # Connected links form groups: each link leads to another of its group, the last to itself.
        next_link = {link: link for link in robot.links}

        def last_of_group(link: str) -> str:
            while next_link[link] != link:
                link = next_link[link]
            return link

        depths, kinds = _depths(robot), (FIXED, PRISMATIC, REVOLUTE)

        def order(joint: Joint) -> tuple[bool, int, int]:
            """Puts the joints last that may be cut: those of a tip, and those that do not turn."""
            is_kept = joint.kind == FIXED or joint.name == crank
            rank = kinds.index(joint.kind) if joint.kind in kinds else len(kinds)
            depth = max(depths.get(link, 0) for link in (joint.parent, joint.child))
            return not is_kept, rank, depth

        kept = list[Joint]()
        for joint in sorted(robot.joints, key=order):
            first, second = last_of_group(joint.parent), last_of_group(joint.child)
            if first == second:  # the joint closes a loop
                self.leftover.append(joint)
            else:
                kept.append(joint)
                next_link[second] = first
        return kept

    def _grow(self, root: str, joints_at: Mapping[str, Sequence[Joint]], base: Transform) -> None:
        """Adds the bodies that a root carries."""
        self.home[root] = len(self.bodies)
        self.bodies.append(Body({root: IDENTITY}, None, base))
        waiting = [root]
        while waiting:
            link = waiting.pop()
            body = self.home[link]
            for joint in joints_at[link]:
                is_parent = joint.parent == link
                other = joint.child if is_parent else joint.parent
                if other in self.home:
                    continue
                waiting.append(other)
                if joint.kind == FIXED:
                    child_in_parent = joint.moved(0.0)
                    step = child_in_parent if is_parent else child_in_parent.inverse()
                    links = self.bodies[body].links
                    links[other] = links[link].then(step)
                    self.home[other] = body
                else:
                    new = self.home[other] = len(self.bodies)
                    self.bodies.append(Body({other: IDENTITY}, len(self._edges)))
                    self._edges.append(Edge(joint, (body, new) if is_parent else (new, body)))

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

    def edges_of(self, body: int) -> list[Edge]:
        """Returns the joints of a body."""
        return [edge for edge in self._edges if body in edge.ends]

    def frames(self, edge: Edge) -> dict[int, Transform]:
        """Returns the pose of a joint's frame in the coordinates of its parent and child body."""
        (parent, child), joint = edge.ends, edge.joint
        return {
            parent: self.bodies[parent].links[joint.parent].then(joint.in_parent),
            child: self.bodies[child].links[joint.child].then(joint.in_child),
        }

    def poses(self, values: Mapping[str, float]) -> list[Transform]:
        """Returns the pose of each body at joint values; those left out are 0."""
        poses = list[Transform]()
        for number, body in enumerate(self.bodies):
            if body.above is None:
                poses.append(body.base)
                continue
            edge = self._edges[body.above]
            (parent, child), joint = edge.ends, edge.joint
            child_in_parent = (
                self.bodies[parent].links[joint.parent]
                .then(joint.moved(values.get(joint.name, 0.0)))
                .then(self.bodies[child].links[joint.child].inverse())
            )  # fmt: skip
            if number == child:
                poses.append(poses[parent].then(child_in_parent))
            else:
                poses.append(poses[child].then(child_in_parent.inverse()))
        return poses

    def path(self, start: int, end: int) -> list[int]:
        """Returns the bodies from one to another along the tree; empty if no joints lead there."""
        from_start, from_end = self.ancestors(start), self.ancestors(end)
        common = next((body for body in from_start if body in from_end), None)
        if common is None:
            return []
        up = from_start[: from_start.index(common) + 1]
        down = from_end[: from_end.index(common)][::-1]
        return [*up, *down]

    def edges_along(self, path: Sequence[int]) -> list[Edge]:
        """Returns the joints between each two successive bodies of a path."""
        return [
            next(edge for edge in self.edges_of(near) if {*edge.ends} == {near, far})
            for near, far in itertools.pairwise(path)
        ]

    def edges_of_loop(self, closure: Closure) -> list[Edge]:
        """Returns the joints of a closure's loop, in order; empty if there is no loop."""
        start, end = (self.home[link] for link in closure.links)
        return self.edges_along(self.path(start, end))


def _depths(robot: RobotModel) -> dict[str, int]:
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
