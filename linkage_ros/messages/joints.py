# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Joints of messages: the map between the motion of a mechanism and the robot's own joints.

A robot's joint may have another name, zero, direction, gear ratio and parent link than the joint
of the open tree. Its value is ratio * (own - zero), and its effort is the own effort / ratio.
`own` is the direction of the link minus that of the parent link, or the position of a slider. The
direction of a sliding parent is that of its guide.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from linkage_ros.formulas import rint, where
from linkage_ros.mechanism.axes import axes_of
from linkage_ros.mechanism.kinematics import State
from linkage_ros.mechanism.structure import Link
from linkage_ros.numeric import Array, Real, wrap


class RobotJoint(NamedTuple):
    """The joint of a link in messages.

    Attributes:
        name: Name in messages; empty if it is not published.
        parent: Index of the turning link from which the joint is measured; None for the frame, and
            for the position of a sliding link.
        guide: Direction of a fixed guide from which the joint is measured, rad; None without one.
        zero: Value of `own` at which the joint is at 0, rad or m.
        ratio: Value of the joint per unit of `own`, not 0.
        is_mapped: Whether zero, ratio or parent were given.
        is_measured: Whether messages repeat the measured value.
    """

    name: str
    parent: int | None = None
    guide: float | None = None
    zero: float = 0.0
    ratio: float = 1.0
    is_mapped: bool = False
    is_measured: bool = False

    def own(self, value: Real) -> Real:
        """Returns `own` at a value of the joint, rad or m."""
        return value / self.ratio + self.zero if self.is_mapped else value

    def value(self, own: Real) -> Real:
        """Returns the value of the joint, rad or m."""
        return self.ratio * (own - self.zero) if self.is_mapped else own


def own_joints(links: Sequence[Link], joint_prefix: str = '') -> tuple[RobotJoint, ...]:
    """Returns the joints of the open tree, with their own names, zeros and parents."""
    return tuple(
        RobotJoint(f'{joint_prefix}{link.name}', *carrier_axes(links, link)) for link in links
    )


def carrier_axes(links: Sequence[Link], link: Link) -> tuple[int | None, float | None]:
    """Returns the turning link, or the direction of a guide, from which a link is measured.

    Args:
        links: The links of the open tree.
        link: One of them; a sliding link has a position, measured from no direction.
    """
    if link.slides or link.parent is None:
        return None, None
    return axes_of(links, link.parent)


def joint_rows(
    links: Sequence[Link],
    state: State,
    unwrapped: Real,
    joints: Sequence[RobotJoint] = (),
    driven: int = 0,
) -> list[list[Real]]:
    """Converts a state to joints; compiled as a formula.

    Args:
        links: The links of the open tree.
        state: State of the mechanism.
        unwrapped: Position of the driven link: crank angle including all turns, rad, or position
            of a slide, m; or the measured value of its joint.
        joints: The joint of each link; by default, those of the open tree.
        driven: Index of the driven link.

    Returns:
        Positions, rad or m, velocities, accelerations and efforts of the joints, as rows. A driven
        crank's angle includes all turns; other angles are relative to the parent link and within
        pi of `zero`, without -pi. The effort of the driven joint is the driving torque, N m, or
        force, N, divided by its ratio; other efforts are 0.
    """
    joints = joints or own_joints(links)
    motions = [
        _joint_motion(link, joint, state, i)
        for i, (link, joint) in enumerate(zip(links, joints, strict=True))
    ]
    rows = [list(row) for row in zip(*motions, strict=True)]
    joint = joints[driven]
    rows[0][driven] = unwrapped if joint.is_measured else joint.value(unwrapped)
    efforts: list[Real] = [0.0 for _ in links]
    efforts[driven] = state.torque / joint.ratio if joint.is_mapped else state.torque
    return [*rows, efforts]


def _joint_motion(link: Link, joint: RobotJoint, state: State, i: int) -> tuple[Real, Real, Real]:
    """Returns position, velocity and acceleration of the joint of link i."""
    values = [row[i] for row in state[:3]]
    if joint.parent is not None:
        values = [x - row[joint.parent] for x, row in zip(values, state[:3], strict=True)]
    position, velocity, acceleration = values
    if joint.guide is not None:
        position = position - joint.guide
    if joint.is_mapped:
        position = position - joint.zero
    if not link.slides:
        is_carried = joint.parent is not None or joint.guide is not None
        if joint.is_mapped or is_carried:
            position = wrap(position, rint)
        position = where(position <= -math.pi, math.pi, position)
    if not joint.is_mapped:
        return position, velocity, acceleration
    return joint.ratio * position, joint.ratio * velocity, joint.ratio * acceleration


def link_rows(joints: Sequence[RobotJoint], table: Array) -> Array:
    """Converts positions of joints, and their rates and accelerations, to those of the links.

    Args:
        joints: The joint of each link.
        table: Positions in the first row, then any number of derivatives, shape (k, links, n).

    Returns:
        The rows of the links, of the same shape: angles in base_link, and slider positions.
    """
    rows = np.empty_like(table)
    converted = set[int | None]([None])  # the links so far, and the frame
    while len(converted) <= len(joints):  # a parent may follow the links measured from it
        for i, joint in enumerate(joints):
            if i not in converted and joint.parent in converted:
                rows[:, i] = table[:, i] / joint.ratio
                rows[0, i] += joint.zero + (joint.guide or 0.0)
                if joint.parent is not None:
                    rows[:, i] += rows[:, joint.parent]
                converted.add(i)
    return rows
