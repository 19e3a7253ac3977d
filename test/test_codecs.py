# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Message bytes, read by two decoders that share nothing with the package: rosbags, Fast DDS."""

import json
import math
import os
import struct
import sys
import warnings
from pathlib import Path

import pytest
from joint_codec import JointStateCodec, encode_float64
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from linkage_ros.ros.topics import message_class
from linkage_ros.wire.cdr import (
    ERROR,
    OK,
    WARN,
    Status,
    encode_diagnostics,
    encode_string,
)
from linkage_ros.wire.codecs import float64_array, point, trajectory
from linkage_ros.wire.rows import Template
from linkage_ros.wire.topics import (
    CLOCK,
    DIAGNOSTIC_ARRAY,
    FLOAT64,
    FLOAT64_MULTI_ARRAY,
    JOINT_STATE,
    JOINT_TRAJECTORY,
    POINT_STAMPED,
    STRING,
    TOPICS,
)

STORE = get_typestore(Stores.ROS2_JAZZY)
JOINTS = ('crank', 'coupler', 'rocker')
STAMPS = (
    *(0, 1, 999_999_999, 10**9, 1_795_000_000_123_456_789),
    *((2**31 - 1) * 10**9 + 999_999_999, -1, -(2**31) * 10**9),
)
HARD = (0.0, -0.0, 5e-324, -5e-324, sys.float_info.max, -sys.float_info.max, 0.1, math.pi)
# Names of 1 to 9 characters reach every offset modulo 8, alone and in rows.
NAMES = [('j' * length,) for length in range(1, 10)] + [
    tuple('abcdef'[i] * (1 + (3 * i + shift) % 20) for i in range(count))
    for count in (2, 3, 6)
    for shift in (0, 1, 5)
]


@pytest.fixture(scope='module')
def fast_dds():
    """rclpy's serialisation."""
    serialization = pytest.importorskip('rclpy.serialization')
    with warnings.catch_warnings():
        # The first use imports a parser that imports sre_parse.
        warnings.simplefilter('ignore', DeprecationWarning)
        serialization.serialize_message(message_class(FLOAT64.name)())
    return serialization


@pytest.fixture
def decodings(fast_dds):
    """Reads a message with rosbags and with Fast DDS, which write the same bytes, but padding."""

    def decode(data, interface):
        read = STORE.deserialize_cdr(data, interface.name)
        message = fast_dds.deserialize_message(data, message_class(interface.name))
        filled = [bytes(STORE.serialize_cdr(read, interface.name))]
        filled.append(fast_dds.serialize_message(message))
        for other in filled:
            # On the way, DDS fills every message up to a multiple of 4 bytes.
            assert other[:4] == data[:4]
            assert 0 <= len(data) - len(other) < 4
        # Fast DDS leaves in the padding what was on the heap; rosbags and this package 0.
        assert data == filled[0].ljust(len(data), b'\0')
        pairs = zip(data, filled[1].ljust(len(data), b'\0'), strict=True)
        assert all(ours in (theirs, 0) for ours, theirs in pairs)
        return read, message

    return decode


def numbers(count, offset=0):
    return tuple(HARD[(i + offset) % len(HARD)] * (1 + i // len(HARD)) for i in range(count))


def same_bits(got, row):
    """Whether numbers are those of a row whose zeros have no sign, as on the wire."""
    expected = [x + 0.0 for x in row]
    return struct.pack(f'{len(got)}d', *got) == struct.pack(f'{len(expected)}d', *expected)


def assert_header(message, stamp):
    seconds, rest = message.header.stamp.sec, message.header.stamp.nanosec
    assert 0 <= rest < 10**9
    assert seconds * 10**9 + rest == stamp
    assert message.header.frame_id == 'base_link'


# ---------------------------------------------------------------- joints


def joint_states(names, stamp=0):
    """A message and its rows."""
    rows = [numbers(len(names), offset) for offset in (0, 3, 5)]
    return JointStateCodec(names).encode(stamp, *rows), rows


@pytest.mark.parametrize('names', NAMES, ids='-'.join)
def test_both_decoders_read_back_every_joint_state_and_trajectory(names, decodings):
    codec = JointStateCodec(names, parts=trajectory)
    rows = [numbers(len(names), offset) for offset in (0, 2, 5, 7)]
    for stamp in STAMPS:
        data, states = joint_states(names, stamp)
        for message in decodings(data, JOINT_STATE):
            assert_header(message, stamp)
            assert list(message.name) == list(names)
            got = message.position, message.velocity, message.effort
            assert all(map(same_bits, got, states))
        data = codec.encode(stamp, *rows)
        assert codec.decode(data) == (stamp, tuple(x for row in rows for x in row))
        for message in decodings(data, JOINT_TRAJECTORY):
            assert_header(message, stamp)
            assert list(message.joint_names) == list(names)
            (point,) = message.points
            got = point.positions, point.velocities, point.accelerations, point.effort
            assert all(map(same_bits, got, rows))
            assert (point.time_from_start.sec, point.time_from_start.nanosec) == (0, 0)
        with pytest.raises(ValueError, match='no message with exactly header'):
            codec.decode(joint_states(names, stamp)[0])


DATA, ROWS = joint_states(JOINTS)
# Three names, but 4 positions, 2 velocities and 3 efforts: as long as it ought to be.
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
    assert JointStateCodec(JOINTS).decode(DATA) == (0, sum(ROWS, ()))
    with pytest.raises(ValueError, match=r'nanosec, position\[crank\], .*, effort\[rocker\]$'):
        JointStateCodec(JOINTS).decode(data)


# ---------------------------------------------------------------- the other types


@pytest.mark.parametrize('value', [*HARD, math.inf, -math.inf, math.nan])
def test_both_decoders_read_back_every_float(value, decodings):
    for message in decodings(encode_float64(value), FLOAT64):
        assert same_bits([message.data], [value])
    array = Template(float64_array('x')).pack(value + 0.0)
    for message in decodings(array, FLOAT64_MULTI_ARRAY):
        assert same_bits(list(message.data), [value])
        assert (list(message.layout.dim), message.layout.data_offset) == ([], 0)


@pytest.mark.parametrize('text', ['', 'a', 'ab', 'abc', 'abcd', 'ä€🙂', 'x' * 70_000])
def test_both_decoders_read_back_every_text(text, decodings):
    data = encode_string(text)
    assert len(data) % 4 == 0
    assert [message.data for message in decodings(data, STRING)] == [text] * 2


def test_points_are_read_back(decodings):
    template = Template(point('base_link'))
    for stamp in STAMPS:
        data = template.pack(*divmod(stamp, 10**9), 0.1, -5e-324)
        for message in decodings(data, POINT_STAMPED):
            assert_header(message, stamp)
            assert (message.point.x, message.point.y, message.point.z) == (0.1, -5e-324, 0.0)


STATUSES = [
    Status(OK, 'linkage_node: motion', '200.0 Hz kept', {'rate kept, Hz': '200.00', 'x': ''}),
    Status(WARN, 'n' * 7, 'a', {}),
    Status(ERROR, '', 'no space left; f\u00fcnf', {'target': '/tmp/run.mcap', 'lost': '12'}),
]


@pytest.mark.parametrize('count', range(4))
def test_diagnostics_are_read_back(count, decodings):
    data = encode_diagnostics(STAMPS[4], 'four_bar', STATUSES[:count])
    assert len(data) % 4 == 0
    for message in decodings(data, DIAGNOSTIC_ARRAY):
        stamp = message.header.stamp
        assert stamp.sec * 10**9 + stamp.nanosec == STAMPS[4]
        for status, expected in zip(message.status, STATUSES[:count], strict=True):
            level = status.level[0] if isinstance(status.level, bytes) else int(status.level)
            values = {pair.key: pair.value for pair in status.values}
            assert (level, status.name, status.message, values) == tuple(expected)
            assert status.hardware_id == 'four_bar'


# ---------------------------------------------------------------- interfaces


def share(package):
    """The installed description of a message package."""
    prefixes = [*filter(None, os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep))]
    folders = [Path(prefix, 'share', package, 'msg') for prefix in (*prefixes, sys.prefix)]
    return next((folder for folder in folders if folder.is_dir()), None)


@pytest.mark.parametrize(
    'interface',
    [*(topic.interface for topic in TOPICS), CLOCK, FLOAT64_MULTI_ARRAY],
    ids=lambda interface: interface.name,
)
def test_definition_and_type_hash_are_those_of_the_installed_package(interface):
    """A type hash covers names and types of all fields, of contained types as well."""
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(interface.definition, interface.name))
    assert store.hash_rihs01(interface.name) == interface.hash
    package, _, kind = interface.name.split('/')
    if (folder := share(package)) is None:
        pytest.skip(f'{package} is not installed')
    described = json.loads((folder / f'{kind}.json').read_text())
    hashes = {entry['type_name']: entry['hash_string'] for entry in described['type_hashes']}
    assert interface.hash == hashes[interface.name]
