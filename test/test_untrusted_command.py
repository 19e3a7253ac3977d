# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Decodes commands: messages packed by rclpy are read, invalid messages are reported."""

from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState

from linkage_ros.messages.cdr import ENCAPSULATION, decode_joint_state

NUMBERS = st.lists(st.floats(), max_size=5)


TEXT = st.text(st.characters(exclude_characters='\0', codec='utf-8'), max_size=9)


@given(TEXT, st.lists(TEXT, max_size=4), NUMBERS, NUMBERS, NUMBERS)
def test_a_command_is_read_as_it_was_sent(frame, names, position, velocity, effort):
    message = JointState(name=names, position=position, velocity=velocity, effort=effort)
    message.header.frame_id = frame
    message.header.stamp.sec, message.header.stamp.nanosec = 3, 7
    stamp, found_names, *found = decode_joint_state(serialize_message(message))
    assert (stamp, found_names) == (3_000_000_007, names)
    for got, sent in zip(found, (position, velocity, effort), strict=True):
        assert np.array_equal(got, sent, equal_nan=True)


def test_missing_terminator_keeps_name():
    message = serialize_message(JointState(name=['cranks'], effort=[2.0]))
    without = message.replace(b'\7\0\0\0cranks\0', b'\5\0\0\0crank\0\0')
    assert deserialize_message(without, JointState).name == ['crank']
    read = decode_joint_state(without)
    assert (read.names, read.efforts) == (['crank'], (2.0,))


@given(st.binary(max_size=200))
def test_invalid_command_is_reported(data):
    for bad in (data, ENCAPSULATION + data):
        with suppress(ValueError):
            efforts = decode_joint_state(bad).efforts
            assert len(efforts) <= len(bad) / 8


def test_a_command_of_megabytes_is_refused():
    message = JointState(name=['crank'], effort=[0.0] * 10_000)
    with pytest.raises(ValueError, match='bytes: must be at most 65536'):
        decode_joint_state(serialize_message(message))
