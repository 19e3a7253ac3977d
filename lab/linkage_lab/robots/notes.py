# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Notes on values that an import omits or assumes, and on probable errors in the model."""

import json
import math
from collections.abc import Iterator, Mapping

from linkage_lab.robots.loops import Loops
from linkage_lab.robots.model import REVOLUTE
from linkage_lab.robots.plane import FRAME, JointMap, Plane


def notes_of(
    loops: Loops,
    plane: Plane,
    values: Mapping[str, float],
    names: Mapping[int, str],
    joints: Mapping[str, JointMap],
) -> Iterator[str]:
    """Yields sentences about probably wrong values and omitted properties of a robot.

    `names` are those of the links in the drawing, by number of the body.
    """
    for joint in loops.robot.joints:
        value = values.get(joint.name, 0.0)
        if joint.kind == REVOLUTE and abs(value) > math.tau:
            yield (
                f'{joint.name} is at {value:g} rad; did you mean {value:g} deg = '
                f'{math.radians(value):.4g} rad?'
            )
    yield from _simplified(loops, plane)
    yield from _mimics(loops, joints)
    yield from _beside(loops, names)


def _simplified(loops: Loops, plane: Plane) -> Iterator[str]:
    """Yields properties of the model that the linkage does not have, and assumptions."""
    for name, angle in plane.tilts:
        yield (
            f'the axis of {name} is {angle:.4g} rad ({math.degrees(angle):.3g} deg) off, but '
            'is taken as exact'
        )
    robot = loops.robot
    yield from robot.notes
    left_out = {joint.name: joint.left_out for joint in robot.joints}
    moving = [step.joint for step in plane.steps]
    closing = [closure.joint for closure in loops.closures if closure.joint]
    for name in (*moving, *closing):
        if text := left_out.get(name):
            yield f'{name}: {text}: left out'
    for name in closing:
        yield f'{name} closes the loop: its value is not published'
    for body in loops.bodies[1:]:
        for link in loops.tree.bodies[body].links:
            if link in robot.doubts:
                yield f'{link}: {robot.doubts[link]}'


def _mimics(loops: Loops, joints: Mapping[str, JointMap]) -> Iterator[str]:
    """Yields the couplings in the file, and how to measure a driven joint that is coupled."""
    for outward in loops.joints:
        joint = outward.edge.joint
        if not joint.mimics:
            continue
        if outward.edge is loops.driven:
            cure = _measured_by_other(joint.name, *joint.mimics, joints)
        else:
            cure = 'the loop determines its value'
        yield f'{joint.name}: <mimic> is ignored; {cure}'


def _measured_by_other(
    name: str, other: str, multiplier: float, offset: float, joints: Mapping[str, JointMap]
) -> str:
    """Describes how to measure a joint by another one that it follows.

    Args:
        name: Name of the joint, whose value is multiplier x other + offset.
        other: Name of the other joint.
        multiplier: See above.
        offset: See above.
        joints: The robot's joint of each link.
    """
    if not multiplier:
        return 'it must be measured itself'
    link, joint_map = next((link, x) for link, x in joints.items() if x.name == name)
    zero = json.dumps(float(joint_map.zero + offset / joint_map.ratio))
    return (
        f'if only {other} is measured, give joints.{link} name: '
        f'{json.dumps(other)}, zero: {zero}, ratio: {joint_map.ratio / multiplier!r}'
    )


def _beside(loops: Loops, names: Mapping[int, str]) -> Iterator[str]:
    """Yields the joints that are in no loop, and the links without mass."""
    tree = loops.tree
    in_loops = [id(joint.edge) for joint in loops.joints]  # arrays in joints cannot be compared
    for body, name in names.items():
        others = [edge for edge in tree.edges_of(body) if id(edge) not in in_loops]
        if name == FRAME:
            above = {*tree.ancestors(body)[1:]}
            carrying = [
                edge.joint.name
                for edge in others
                if edge is not loops.frame_joint and {*edge.ends} & above
            ]
            if carrying:
                yield (
                    f'the frame hangs on {", ".join(carrying)}: it is taken as at rest, and '
                    'gravity is that of this pose; --world follows one joint in the plane'
                )
            continue
        for edge in others:
            yield (
                f'{edge.joint.name} moves relative to {name}, but is in no loop of '
                f'{loops.driven.joint.name}: the mass beyond it is left out'
            )
        if not any(loops.robot.links[link] for link in tree.bodies[body].links):
            yield f'{name} has no mass in the model'
