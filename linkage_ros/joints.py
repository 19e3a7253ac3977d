# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The joints under which ROS sees a mechanism: those of the open tree in its URDF.

URDF has no closed loops. The loop is cut at the pin between coupler and rocker, and every joint
is measured from its parent in the tree: the coupler's from the crank.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from linkage_ros.motion import CrankState
from linkage_ros.numeric import SCALAR, wrap
from linkage_ros.solver import State


class Joint(NamedTuple):
    """A joint of the open tree.

    Attributes:
        name: Of the joint and of its child link.
        link: Index of the child link.
        parent: Index of the parent link; None: base_link.
    """

    name: str
    link: int
    parent: int | None


FOUR_BAR_JOINTS = (Joint('crank', 0, None), Joint('coupler', 1, 0), Joint('rocker', 2, None))


class JointValues(NamedTuple):
    """The joints at one stamp, in the order of the tree.

    Attributes:
        position: The crank's unwrapped, the others in (-pi, pi], rad.
        velocity: rad/s.
        acceleration: rad/s^2.
        effort: The driving torque at the crank, N m; 0 at passive joints.
    """

    position: tuple[float, ...]
    velocity: tuple[float, ...]
    acceleration: tuple[float, ...]
    effort: tuple[float, ...]


def joint_values(joints: tuple[Joint, ...], state: State, crank: CrankState) -> JointValues:
    """The joints' values of a state.

    Args:
        joints: The tree; its first joint is the crank.
        state: A state at crank.angle.
        crank: Where the crank is.

    Returns:
        The values, one for each joint.
    """
    angle, rate, acceleration, torque = state
    positions, velocities, accelerations = [crank.unwrapped], [rate[0]], [acceleration[0]]
    for _, link, parent in joints[1:]:
        if parent is None:
            position, velocity, acceleration_ = angle[link], rate[link], acceleration[link]
        else:
            position = wrap(angle[link] - angle[parent], SCALAR)
            velocity = rate[link] - rate[parent]
            acceleration_ = acceleration[link] - acceleration[parent]
        positions.append(position if position > -math.pi else math.pi)
        velocities.append(velocity)
        accelerations.append(acceleration_)
    effort = (torque, *(0.0 for _ in joints[1:]))
    return JointValues(tuple(positions), tuple(velocities), tuple(accelerations), effort)
