# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Single messages as bytes: the package writes and reads rows of them."""

from linkage_ros.wire.codecs import float64, joint_state
from linkage_ros.wire.rows import Template


class JointStateCodec:
    """JointState messages of a fixed set of joints; JointTrajectory with `parts=trajectory`."""

    def __init__(self, names, frame_id='base_link', parts=joint_state):
        self._template = Template(parts(names, frame_id))

    def encode(self, stamp, *rows):
        """The bytes of a message: its stamp, ns, and rows of numbers in the order of the type."""
        return self._template.pack(
            *divmod(stamp, 10**9), *(number + 0.0 for row in rows for number in row)
        )

    def decode(self, data):
        """The stamp, ns, and all numbers of a message."""
        (stamp,), (numbers,) = self._template.read(data)
        return int(stamp), tuple(numbers.tolist())


def encode_float64(value):
    """The bytes of a std_msgs/Float64."""
    return Template(float64('data')).pack(value + 0.0)
