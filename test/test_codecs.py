# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Decodes messages with two independent decoders: rosbags and Fast DDS."""

import math
import struct
import sys
import warnings

import pytest
from joint_codec import JointStateCodec, encode_float64
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from solved_messages import plain, time_of

from linkage_ros.messages.cdr import (
    ERROR,
    OK,
    WARN,
    Status,
    decode_point,
    encode_diagnostics,
    encode_string,
)
from linkage_ros.messages.fields import Template
from linkage_ros.messages.templates import float64_array, point, trajectory
from linkage_ros.messages.topics import (
    CLOCK,
    DIAGNOSTIC_ARRAY,
    FLOAT64,
    FLOAT64_MULTI_ARRAY,
    JOINT_STATE,
    JOINT_TRAJECTORY,
    POINT_STAMPED,
    STRING,
    TOPICS,
    WRENCH_STAMPED,
)
from linkage_ros.node.endpoints import message_class

STORE = get_typestore(Stores.ROS2_JAZZY)
JOINTS = ('crank', 'coupler', 'rocker')
STAMPS = (
    *(0, 1, 999_999_999, 10**9, 1_795_000_000_123_456_789),
    *((2**31 - 1) * 10**9 + 999_999_999, -1, -(2**31) * 10**9),
)
HARD = (0.0, -0.0, 5e-324, -5e-324, sys.float_info.max, -sys.float_info.max, 0.1, math.pi)
FLOATS = (*HARD, math.inf, -math.inf, math.nan)
# Names of 1 to 9 characters, alone and in rows, produce every offset modulo 8.
NAMES = [('j' * length,) for length in range(1, 10)] + [
    tuple('abcdef'[i] * (1 + (3 * i + shift) % 20) for i in range(count))
    for count in (2, 3, 6)
    for shift in (0, 1, 5)
]


@pytest.fixture(scope='module')
def fast_dds():
    """Returns rclpy's serialisation functions."""
    serialization = pytest.importorskip('rclpy.serialization')
    with warnings.catch_warnings():
        # The first use imports a parser that imports the deprecated sre_parse.
        warnings.simplefilter('ignore', DeprecationWarning)
        serialization.serialize_message(message_class(FLOAT64.name)())
    return serialization


@pytest.fixture
def decodings(fast_dds):
    """Decodes a message with rosbags and Fast DDS, and compares the bytes that they encode."""

    def decode(data, interface):
        read = STORE.deserialize_cdr(data, interface.name)
        message = fast_dds.deserialize_message(data, message_class(interface.name))
        filled = [bytes(STORE.serialize_cdr(read, interface.name))]
        filled.append(fast_dds.serialize_message(message))
        for other in filled:
            # DDS pads every message to a multiple of 4 bytes.
            assert other[:4] == data[:4]
            assert 0 <= len(data) - len(other) < 4
        # Fast DDS leaves heap memory in the padding; rosbags and this package write 0.
        assert data == filled[0].ljust(len(data), b'\0')
        pairs = zip(data, filled[1].ljust(len(data), b'\0'), strict=True)
        assert all(ours in (theirs, 0) for ours, theirs in pairs)
        return [plain(read), plain(message)]

    return decode


def numbers(count, offset=0):
    return [HARD[(i + offset) % len(HARD)] * (1 + i // len(HARD)) for i in range(count)]


def on_wire(row):
    """Returns numbers as they are encoded: -0.0 becomes 0.0."""
    return [number + 0.0 for number in row]


def header(stamp, frame_id='base_link'):
    return {'stamp': time_of(stamp), 'frame_id': frame_id}


def joint_states(names, stamp=0, offsets=(0, 3, 5)):
    """Encodes a message; returns it and its rows."""
    rows = [numbers(len(names), offset) for offset in offsets]
    return JointStateCodec(names).encode(stamp, *rows), rows


@pytest.mark.parametrize('names', NAMES, ids='-'.join)
def test_both_decoders_read_back_every_joint_state_and_trajectory(names, decodings):
    codec, rows = (
        JointStateCodec(names, parts=trajectory),
        [numbers(len(names), i) for i in range(4)],
    )
    quantities = 'positions', 'velocities', 'accelerations', 'effort'
    for stamp in STAMPS:
        states, (position, velocity, effort) = joint_states(names, stamp)
        data = codec.encode(stamp, *rows)
        assert codec.decode(data) == (stamp, tuple(x for row in rows for x in row))
        point = dict(zip(quantities, map(on_wire, rows), strict=True), time_from_start=time_of(0))
        assert decodings(data, JOINT_TRAJECTORY) == [
            plain({'header': header(stamp), 'joint_names': names, 'points': [point]})
        ] * 2  # fmt: skip
        found = {'position': position, 'velocity': velocity, 'effort': effort}
        found = {name: on_wire(row) for name, row in found.items()}
        assert decodings(states, JOINT_STATE) == [
            plain({'header': header(stamp), 'name': names, **found})
        ] * 2  # fmt: skip
        with pytest.raises(ValueError, match='no message with exactly header'):
            codec.decode(states)


DATA, ROWS = joint_states(JOINTS)
# For three names, there are 4 positions, 2 velocities and 3 efforts; the length is correct.
OTHER_LENGTHS = [struct.pack(f'<I4x{n}d', n, *numbers(n)) for n in (4, 2, 3)]
BROKEN = {
    'nothing': b'',
    'header alone': DATA[:4],
    'a byte short': DATA[:-1],
    'a byte long': DATA + b'\0',
    'joints in another order': joint_states(('coupler', 'crank', 'rocker'))[0],
    'another joint': joint_states(('crank', 'coupler', 'rocket'))[0],
    'a joint less': joint_states(JOINTS[:2])[0],
    'another frame': DATA.replace(b'base_link', b'base_limb'),
    'another type': encode_float64(1.0),
    'big endian': b'\0\0\0\0' + DATA[4:],
    'sequences of other lengths': DATA[: -3 * len(OTHER_LENGTHS[2])] + b''.join(OTHER_LENGTHS),
}


@pytest.mark.parametrize('data', BROKEN.values(), ids=BROKEN)
def test_decode_refuses_other_messages(data):
    assert JointStateCodec(JOINTS).decode(DATA) == (0, tuple(x for row in ROWS for x in row))
    with pytest.raises(ValueError, match=r'nanosec, position\[crank\], .*, effort\[rocker\]$'):
        JointStateCodec(JOINTS).decode(data)


# ---------------------------------------------------------------- the other types


STATUSES = [
    Status(OK, 'linkage_node: motion', '200.0 Hz kept', {'rate kept, Hz': '200.00', 'x': ''}),
    Status(WARN, 'n' * 7, 'a', {}),
    Status(ERROR, '', 'no space left; f\u00fcnf', {'target': '/tmp/run.mcap', 'lost': '12'}),
]
DESCRIBED = [
    {
        **{name: getattr(status, name) for name in ('level', 'name', 'message')},
        'hardware_id': 'four_bar',
        'values': [{'key': key, 'value': value} for key, value in status.values.items()],
    }
    for status in STATUSES
]
EMPTY = {'dim': [], 'data_offset': 0}
# Bytes of a message, its type and its fields.
MESSAGES = [
    *((encode_float64(value), FLOAT64, {'data': value + 0.0}) for value in FLOATS),
    *((Template(float64_array('x')).pack(value), FLOAT64_MULTI_ARRAY,
       {'layout': EMPTY, 'data': [value]}) for value in FLOATS),
    *((encode_string(text), STRING, {'data': text})
      for text in ('', 'a', 'ab', 'abc', 'abcd', 'ä€🙂', 'x' * 70_000)),
    *((Template(point('x', 'base_link')).pack(*divmod(stamp, 10**9), 0.1, -5e-324), POINT_STAMPED,
       {'header': header(stamp), 'point': {'x': 0.1, 'y': -5e-324, 'z': 0.0}})
      for stamp in STAMPS),
    *((encode_diagnostics(STAMPS[4], 'four_bar', STATUSES[:count]), DIAGNOSTIC_ARRAY,
       {'header': header(STAMPS[4], ''), 'status': DESCRIBED[:count]}) for count in range(4)),
]  # fmt: skip


@pytest.mark.parametrize(('data', 'interface', 'fields'), MESSAGES, ids=range(len(MESSAGES)))
def test_both_decoders_read_back_every_other_message(data, interface, fields, decodings):
    assert decodings(data, interface) == [plain(fields)] * 2
    assert len(data) % 4 == 0  # DDS pads messages


@pytest.mark.parametrize('frame', ['', 'a', 'base_link'])
def test_point_is_read_back_and_no_other_bytes_are(frame):
    data = Template(point('x', frame)).pack(3, 7, 0.1, -5e-324)
    assert decode_point(data) == (3_000_000_007, (0.1, -5e-324, 0.0))
    for wrong in (data[:-1], data[:20], b'', b'\0\0' + data[2:], bytes(len(data))):
        with pytest.raises(ValueError, match='not a PointStamped'):
            decode_point(wrong)


# ---------------------------------------------------------------- interfaces


@pytest.mark.parametrize(
    'interface',
    [*(topic.interface for topic in TOPICS), CLOCK, FLOAT64_MULTI_ARRAY, WRENCH_STAMPED],
    ids=lambda interface: interface.name,
)
def test_definition_and_type_hash_are_those_of_jazzy(interface):
    """A type hash covers names and types of all fields, including nested types."""
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(interface.definition, interface.name))
    for types in (store, STORE):
        assert types.hash_rihs01(interface.name) == interface.hash
