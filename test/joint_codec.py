# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Encodes and decodes single messages; the package itself works on arrays of numbers."""

from linkage_ros.messages.fields import Template
from linkage_ros.messages.templates import float64, joint_state


class JointStateCodec:
    """Codec for JointState messages of some joints; JointTrajectory with `parts=trajectory`."""

    def __init__(self, names, frame_id='base_link', parts=joint_state):
        self._template = Template(parts(names, frame_id))

    def encode(self, stamp, *rows):
        """Encodes a message from its stamp, ns, and rows of numbers in the order of the type."""
        return self._template.pack(
            *divmod(stamp, 10**9), *(number + 0.0 for row in rows for number in row)
        )

    def decode(self, data):
        """Decodes the stamp, ns, and all numbers of a message."""
        (stamp,), (numbers,) = self._template.read(data)
        return int(stamp), tuple(numbers.tolist())


def encode_float64(value):
    """Encodes a std_msgs/Float64."""
    return Template(float64('data')).pack(value + 0.0)
