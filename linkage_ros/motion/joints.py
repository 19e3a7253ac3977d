# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What ROS sees of a state: the values of the joints of the open tree in the URDF."""

from __future__ import annotations

import math
from typing import NamedTuple

from linkage_ros.dynamics.state import State
from linkage_ros.model.structure import Link
from linkage_ros.motion.speed_driven import CrankState
from linkage_ros.numeric import SCALAR, wrap


class JointValues(NamedTuple):
    """The joints at one stamp, in the order of the tree.

    Attributes:
        position: The crank's unwrapped, other angles in (-pi, pi], rad; a slider's place, m.
        velocity: rad/s or m/s.
        acceleration: rad/s^2 or m/s^2.
        effort: The driving torque at the crank, N m; 0 at passive joints.
    """

    position: tuple[float, ...]
    velocity: tuple[float, ...]
    acceleration: tuple[float, ...]
    effort: tuple[float, ...]


def joint_values(links: tuple[Link, ...], state: State, crank: CrankState) -> JointValues:
    """The joints' values of a state.

    Args:
        links: The tree; its first joint is the crank's.
        state: A state at crank.angle.
        crank: Where the crank is.

    Returns:
        The values, one for each joint.
    """
    position, rate, acceleration, torque = state
    positions, velocities, accelerations = [crank.unwrapped], [rate[0]], [acceleration[0]]
    for i, link in enumerate(links[1:], 1):
        place, velocity, acceleration_, parent = position[i], rate[i], acceleration[i], link.parent
        if parent is not None:
            place = wrap(place - position[parent], SCALAR)
            velocity -= rate[parent]
            acceleration_ -= acceleration[parent]
        positions.append(place if link.slides or place > -math.pi else math.pi)
        velocities.append(velocity)
        accelerations.append(acceleration_)
    effort = (torque, *(0.0 for _ in links[1:]))
    return JointValues(tuple(positions), tuple(velocities), tuple(accelerations), effort)
