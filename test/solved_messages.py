# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Makes the expected messages of a log from solver states, without the package's encoders.

A message is a dictionary of its fields. Floats are represented by 16 hexadecimal digits, so that
equality means equal bits; otherwise 0.0 and -0.0 would compare equal.
"""

import struct

from linkage_ros.mechanism.solver import Solver
from linkage_ros.messages.joints import joint_rows
from linkage_ros.messages.topics import (
    FLOAT64,
    JOINT_STATE,
    JOINT_TRAJECTORY,
    POINT_STAMPED,
    STRING,
)
from linkage_ros.messages.urdf import make_urdf

TYPES = {
    '/joint_states': JOINT_STATE.name,
    '/driving_torque': FLOAT64.name,
    '/mechanism_state': JOINT_TRAJECTORY.name,
    '/points/coupler_point': POINT_STAMPED.name,
    '/robot_description': STRING.name,
}


def plain(value):
    """Converts a field, or a message from any reader, to this form."""
    if isinstance(value, float):
        return struct.pack('>d', value).hex()
    if isinstance(value, (str, int)):
        return value
    if isinstance(value, bytes):  # rclpy represents a byte as bytes
        return value[0]
    if isinstance(value, dict):
        return {name: plain(item) for name, item in value.items()}
    if hasattr(value, 'tolist'):
        value = value.tolist()
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if hasattr(value, 'get_fields_and_field_types'):
        names = value.get_fields_and_field_types()
    else:
        names = getattr(type(value), '__slots__', None) or vars(value)
    # rosbags lists constants and the type name as fields too.
    fields = [name for name in names if not (name.isupper() or name.startswith('__'))]
    return {name: plain(getattr(value, name)) for name in fields}


def time_of(stamp):
    """Converts a stamp, ns, to seconds and nanoseconds as in ROS."""
    seconds, nanoseconds = divmod(stamp, 10**9)
    return {'sec': seconds, 'nanosec': nanoseconds}


def solved_messages(configuration, motion, stamps):
    """Makes the messages for some stamps.

    Args:
        configuration: Configuration of the run.
        motion: The segment of motion that contains all stamps.
        stamps: Stamps, ns.

    Returns:
        Pairs of stamp and message in order, by topic; the robot description has the first stamp.
    """
    solver = Solver(configuration.mechanism)
    links = solver.structure.links
    messages = {topic: [] for topic in TYPES}
    description = {'data': make_urdf(configuration.mechanism)}
    messages['/robot_description'].append((stamps[0], description))
    names = [link.name for link in links]
    for stamp in stamps:
        found = motion.at(stamp)
        state = solver.state(found.q, found.u, found.a)
        position, velocity, acceleration, effort = joint_rows(links, state, found.unwrapped)
        header = {'stamp': time_of(stamp), 'frame_id': 'base_link'}
        rates = {'position': position, 'velocity': velocity, 'effort': effort}
        point = {
            'positions': position,
            'velocities': velocity,
            'accelerations': acceleration,
            'effort': effort,
            'time_from_start': time_of(0),
        }
        found = {
            '/joint_states': {'header': header, 'name': names, **rates},
            '/driving_torque': {'data': state.torque},
            '/mechanism_state': {'header': header, 'joint_names': names, 'points': [point]},
        }
        for name in solver.structure.traced:
            x, y = solver.point(state, name).position
            found[f'/points/{name}'] = {'header': header, 'point': {'x': x, 'y': y, 'z': 0.0}}
        for topic, message in found.items():
            messages[topic].append((stamp, plain(message)))
    return {topic: rows for topic, rows in messages.items() if rows}
