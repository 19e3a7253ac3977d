# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Message bytes, read by two decoders that share nothing with the package: rosbags, Fast DDS."""

from __future__ import annotations

import json
import math
import os
import re
import struct
import sys
import warnings
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_typestore

from linkage_ros.ros.publishers import message_class
from linkage_ros.wire.codecs import (
    JointStateCodec,
    PointCodec,
    TrajectoryCodec,
    encode_float64,
    encode_float64_array,
    encode_string,
)
from linkage_ros.wire.diagnostics import ERROR, OK, WARN, Status, encode_diagnostics
from linkage_ros.wire.interfaces import (
    CLOCK,
    DIAGNOSTIC_ARRAY,
    FLOAT64,
    FLOAT64_MULTI_ARRAY,
    JOINT_STATE,
    JOINT_TRAJECTORY,
    POINT_STAMPED,
    STRING,
)
from linkage_ros.wire.topics import TOPICS

STORE = get_typestore(Stores.ROS2_JAZZY)
JOINTS = ('crank', 'coupler', 'rocker')
STAMPS = (
    *(0, 1, 999_999_999, 10**9, 10**9 + 1, 1_795_000_000_123_456_789),
    *((2**31 - 1) * 10**9 + 999_999_999, -1, -(10**9), -(2**31) * 10**9),
)
HARD = (0.0, -0.0, 5e-324, -5e-324, sys.float_info.max, -sys.float_info.max, 0.1, math.pi)
# Names of 1 to 20 characters reach every offset modulo 8, alone and in rows of up to six.
NAMES = [('j' * length,) for length in range(1, 21)] + [
    tuple('abcdef'[i] * (1 + (3 * i + shift) % 20) for i in range(count))
    for count in range(2, 7)
    for shift in (0, 1, 2, 3, 5, 8, 13)
]
FRAME = 'base_link'


@pytest.fixture(scope='module')
def fast_dds():
    """rclpy's serialisation, and the message classes."""
    serialization = pytest.importorskip('rclpy.serialization')
    from sensor_msgs.msg import JointState
    from std_msgs.msg import Float64, String

    with warnings.catch_warnings():
        # The first use imports a parser that imports sre_parse.
        warnings.simplefilter('ignore', DeprecationWarning)
        for kind in (JointState, Float64, String):
            serialization.serialize_message(kind())
    serialization.kinds = {'JointState': JointState, 'Float64': Float64, 'String': String}
    return serialization


def numbers(count, offset=0):
    return tuple(HARD[(i + offset) % len(HARD)] * (1 + i // len(HARD)) for i in range(count))


def encode(names, stamp=0):
    count = len(names)
    rows = [numbers(count, offset) for offset in (0, 2, 5)]
    return JointStateCodec(names).encode(stamp, *rows), unsigned(rows)


def unsigned(rows):
    """Rows of numbers whose zeros have no sign, as on the wire."""
    return [tuple(x + 0.0 for x in row) for row in rows]


def padding(data):
    """The offsets of the padding of a JointState, found by walking through it as CDR says."""
    at, gaps = 4, []

    def align(size):
        nonlocal at
        # Alignment counts from the end of the encapsulation header.
        while (at - 4) % size:
            gaps.append(at)
            at += 1

    def length():
        nonlocal at
        align(4)
        at += 4
        return struct.unpack_from('<I', data, at - 4)[0]

    def string():
        nonlocal at
        size = length()
        at += size

    at += 8
    string()
    for _ in range(length()):
        string()
    for _ in range(3):
        count = length()
        if count:
            align(8)
        at += 8 * count
    assert at == len(data)
    return gaps


def same_bits(first, second):
    return struct.pack(f'{len(first)}d', *first) == struct.pack(f'{len(second)}d', *second)


def check(message, names, stamp, rows):
    seconds, rest = message.header.stamp.sec, message.header.stamp.nanosec
    assert 0 <= rest < 10**9
    assert seconds * 10**9 + rest == stamp
    assert message.header.frame_id == FRAME
    assert list(message.name) == list(names)
    for row, got in zip(rows, (message.position, message.velocity, message.effort), strict=True):
        assert same_bits(list(got), row)


# ---------------------------------------------------------------- JointState


@pytest.mark.parametrize('names', NAMES, ids='-'.join)
def test_both_decoders_read_back_every_joint_state(names, fast_dds):
    for stamp in STAMPS:
        data, rows = encode(names, stamp)
        assert type(data) is bytes
        check(STORE.deserialize_cdr(data, JOINT_STATE.name), names, stamp, rows)
        kind = fast_dds.kinds['JointState']
        check(fast_dds.deserialize_message(data, kind), names, stamp, rows)


@pytest.mark.parametrize('names', NAMES, ids='-'.join)
def test_bytes_are_fast_dds_bytes_with_zeros_for_padding(names, fast_dds):
    for stamp in STAMPS:
        data, rows = encode(names, stamp)
        message = fast_dds.kinds['JointState'](name=list(names))
        message.header.frame_id = FRAME
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)
        message.position, message.velocity, message.effort = map(list, rows)
        theirs = fast_dds.serialize_message(message)
        gaps = padding(data)
        assert len(theirs) == len(data)
        assert [i for i in range(len(data)) if data[i] != theirs[i] and i not in gaps] == []
        assert all(data[i] == 0 for i in gaps)


@pytest.mark.parametrize('names', NAMES, ids='-'.join)
def test_bytes_are_rosbags_bytes(names):
    data, _ = encode(names, 123_456_789_012)
    message = STORE.deserialize_cdr(data, JOINT_STATE.name)
    assert bytes(STORE.serialize_cdr(message, JOINT_STATE.name)) == data


def test_the_cases_reach_every_gap():
    """Names end at every offset modulo 4, and the numbers begin with and without a gap."""
    after_names = {sum(4 + len(name) + 1 for name in names) % 4 for names in NAMES}
    assert after_names == {0, 1, 2, 3}
    gaps = set()
    for names in NAMES:
        data, _ = encode(names)
        numbers_at = len(data) - 8 * len(names) - 2 * (8 + 8 * len(names))
        gaps.add(numbers_at - 1 in padding(data))
    assert gaps == {True, False}


def test_padding_is_where_a_count_by_hand_finds_it():
    # Behind the 4 bytes of encapsulation: stamp 0-8, length 8-12, 'base_link' and its end 12-22,
    # gap, one name 24-28, length 28-32, 'crank' and its end 32-38, gap, one position 40-44, gap,
    # number 48-56, one velocity 56-60, gap, number 64-72, one effort 72-76, gap, number 80-88.
    gaps = [22, 23, 38, 39, *range(44, 48), *range(60, 64), *range(76, 80)]
    data, _ = encode(('crank',))
    assert padding(data) == [4 + gap for gap in gaps]
    assert len(data) == 4 + 88


def test_equal_states_give_equal_bytes_in_another_codec_and_after_other_states():
    first, other = JointStateCodec(JOINTS), JointStateCodec(list(JOINTS))
    rows = numbers(3), numbers(3, 1), numbers(3, 4)
    data = first.encode(5, *rows)
    first.encode(7, *(numbers(3, 6),) * 3)
    assert first.encode(5, *rows) == data == other.encode(5, *rows)


def test_bytes_handed_out_stay_as_they_are():
    codec = JointStateCodec(JOINTS)
    data = codec.encode(1, *(numbers(3),) * 3)
    kept = bytes(bytearray(data))
    codec.encode(2, *(numbers(3, 3),) * 3)
    assert data == kept


@settings(max_examples=150, deadline=None)
@given(
    st.integers(-(2**31) * 10**9, 2**31 * 10**9 - 1),
    st.lists(st.floats(), min_size=9, max_size=9),
)
def test_decode_gives_back_what_was_encoded(stamp, values):
    codec = JointStateCodec(JOINTS)
    got, read = codec.decode(codec.encode(stamp, values[:3], values[3:6], values[6:]))
    assert got == stamp
    assert same_bits(read, values)


def broken():
    """Messages that are none of the codec's three joints, by what is wrong."""
    good, _ = encode(JOINTS)
    swapped = encode(('coupler', 'crank', 'rocker'))[0]
    yield 'nothing', b''
    yield 'header alone', good[:4]
    yield 'stamp alone', good[:12]
    yield 'a byte short', good[:-1]
    yield 'a byte long', good + b'\0'
    yield 'half', good[: len(good) // 2]
    yield 'joints in another order', swapped
    yield 'another joint', encode(('crank', 'coupler', 'rocket'))[0]
    yield 'a joint more', encode((*JOINTS, 'slider'))[0]
    yield 'a joint less', encode(JOINTS[:2])[0]
    yield 'another frame', good.replace(b'base_link', b'base_limb')
    yield 'a float', encode_float64(1.0)
    yield 'text', encode_string('crank')
    yield 'big endian', b'\0\0\0\0' + good[4:]
    yield 'no CDR', b'\1\2\3\4' + good[4:]
    yield 'sequences of other lengths', other_lengths()


def other_lengths():
    """Three names, but 4 positions, 2 velocities and 3 efforts: as long as it ought to be."""
    good, _ = encode(JOINTS)
    rows = [struct.pack(f'<I4x{n}d', n, *numbers(n)) for n in (4, 2, 3)]
    return good[: -3 * len(rows[2])] + b''.join(rows)


def test_the_message_with_other_lengths_is_what_it_is_called():
    message = STORE.deserialize_cdr(other_lengths(), JOINT_STATE.name)
    assert list(message.name) == list(JOINTS)
    lengths = [len(row) for row in (message.position, message.velocity, message.effort)]
    assert lengths == [4, 2, 3]
    assert len(other_lengths()) == len(encode(JOINTS)[0])


@pytest.mark.parametrize('data', [pytest.param(data, id=name) for name, data in broken()])
def test_decode_refuses_other_messages(data):
    with pytest.raises(ValueError, match='no message of the joints crank, coupler, rocker'):
        JointStateCodec(JOINTS).decode(data)


def test_the_codec_accepts_the_message_that_the_broken_ones_were_made_of():
    data, rows = encode(JOINTS)
    assert JointStateCodec(JOINTS).decode(data) == (0, sum(rows, ()))


@pytest.mark.parametrize('rows', [((1.0,) * 2, (1.0,) * 3, (1.0,) * 3), ((1.0,) * 4,) * 3])
def test_a_row_of_another_length_is_refused(rows):
    with pytest.raises(struct.error, match='pack_into expected 12 items'):
        JointStateCodec(JOINTS).encode(0, *rows)


# ---------------------------------------------------------------- Float64 and String


@pytest.mark.parametrize('value', [*HARD, math.inf, -math.inf, math.nan])
def test_both_decoders_read_back_every_float(value, fast_dds):
    data = encode_float64(value)
    (right,) = unsigned([[value]])
    assert data == fast_dds.serialize_message(fast_dds.kinds['Float64'](data=right[0]))
    assert same_bits([STORE.deserialize_cdr(data, FLOAT64.name).data], right)
    read = fast_dds.deserialize_message(data, fast_dds.kinds['Float64'])
    assert same_bits([read.data], right)


@pytest.mark.parametrize(
    'text', ['', 'a', 'ab', 'abc', 'abcd', 'ä€🙂', '<robot/>\n', 'x' * 70_000]
)
def test_both_decoders_read_back_every_text(text, fast_dds):
    data = encode_string(text)
    serialized = fast_dds.serialize_message(fast_dds.kinds['String'](data=text))
    # On the way, DDS fills every message up to a multiple of 4 bytes.
    assert data == serialized + b'\0' * (-len(serialized) % 4)
    assert STORE.deserialize_cdr(data, STRING.name).data == text
    assert fast_dds.deserialize_message(data, fast_dds.kinds['String']).data == text


# ---------------------------------------------------------------- interfaces

INTERFACES = [*(topic.interface for topic in TOPICS), CLOCK, FLOAT64_MULTI_ARRAY]


def share(package):
    """The installed description of a message package."""
    prefixes = [*filter(None, os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep))]
    for prefix in (*prefixes, sys.prefix):
        folder = Path(prefix, 'share', package, 'msg')
        if folder.is_dir():
            return folder
    pytest.skip(f'{package} is not installed')
    return None


def fields(text):
    """The lines of a .msg without comments and blanks."""
    lines = (re.sub(r'\s+', ' ', line.partition('#')[0]).strip() for line in text.splitlines())
    return [line for line in lines if line]


@pytest.mark.parametrize('interface', INTERFACES, ids=lambda interface: interface.name)
def test_type_hashes_are_those_of_the_installed_packages(interface):
    package, _, kind = interface.name.split('/')
    described = json.loads((share(package) / f'{kind}.json').read_text())
    hashes = {entry['type_name']: entry['hash_string'] for entry in described['type_hashes']}
    assert interface.hash == hashes[interface.name]


@pytest.mark.parametrize('interface', INTERFACES, ids=lambda interface: interface.name)
def test_definitions_are_those_of_the_installed_packages(interface):
    first, *contained = interface.definition.split('=' * 80 + '\n')
    parts = [(interface.name.replace('/msg/', '/'), first)]
    for part in contained:
        title, _, text = part.partition('\n')
        assert title.startswith('MSG: ')
        parts.append((title.removeprefix('MSG: '), text))
    for name, text in parts:
        package, kind = name.split('/')
        assert fields(text) == fields((share(package) / f'{kind}.msg').read_text())
    # Every type that a field names is among the parts.
    named = {
        # A type of the same package is named without it; basic types are lower case.
        kind if '/' in kind else f'{name.partition("/")[0]}/{kind}'
        for name, text in parts
        for kind in (line.split()[0].partition('[')[0] for line in fields(text))
        if '/' in kind or kind[0].isupper()
    }
    assert named == {name for name, _ in parts[1:]}


@pytest.mark.parametrize('interface', INTERFACES, ids=lambda interface: interface.name)
def test_rosbags_makes_the_same_type_hash_from_the_definition(interface):
    from rosbags.typesys import get_types_from_msg

    store = get_typestore(Stores.EMPTY)
    types = get_types_from_msg(interface.definition, interface.name)
    store.register(types)
    assert store.hash_rihs01(interface.name) == interface.hash


def test_topics_are_unique_and_only_the_description_is_latched():
    names = [topic.name for topic in TOPICS]
    assert names == [
        *('joint_states', 'driving_torque', 'mechanism_state', 'coupler_point'),
        *('/diagnostics', 'robot_description'),
    ]
    assert [topic.name for topic in TOPICS if topic.latched] == ['robot_description']
    assert [topic.depth for topic in TOPICS] == [10, 10, 10, 10, 10, 1]
    assert [topic.name for topic in TOPICS if topic.on_demand] == ['mechanism_state']


# ---------------------------------------------------------------- the other types


def stamp_of(message):
    return message.header.stamp.sec * 10**9 + message.header.stamp.nanosec


@pytest.mark.parametrize('names', NAMES, ids='-'.join)
def test_trajectories_are_read_back(names, fast_dds):
    rows = [numbers(len(names), offset) for offset in (0, 2, 5, 7)]
    for stamp in STAMPS:
        codec = TrajectoryCodec(names)
        data = codec.encode(stamp, *rows)
        assert codec.decode(data) == (stamp, tuple(x for row in rows for x in row))
        for message in every_decoding(data, JOINT_TRAJECTORY, fast_dds):
            assert (stamp_of(message), message.header.frame_id) == (stamp, FRAME)
            assert list(message.joint_names) == list(names)
            (point,) = message.points
            got = point.positions, point.velocities, point.accelerations, point.effort
            assert all(same_bits(list(x), row) for x, row in zip(got, unsigned(rows), strict=True))
            assert (point.time_from_start.sec, point.time_from_start.nanosec) == (0, 0)
        with pytest.raises(ValueError, match='no message of the joints'):
            codec.decode(JointStateCodec(names).encode(stamp, *rows[:3]))


def test_points_are_read_back(fast_dds):
    for stamp in STAMPS:
        data = PointCodec().encode(stamp, 0.1, -5e-324)
        for message in every_decoding(data, POINT_STAMPED, fast_dds):
            assert (stamp_of(message), message.header.frame_id) == (stamp, FRAME)
            assert (message.point.x, message.point.y, message.point.z) == (0.1, -5e-324, 0.0)


STATUSES = [
    Status(OK, 'linkage_node: motion', '200.0 Hz kept', {'rate kept, Hz': '200.00', 'x': ''}),
    Status(WARN, 'n' * 7, 'a', {}),
    Status(ERROR, '', 'no space left; f\u00fcnf', {'target': '/tmp/run.mcap', 'lost': '12'}),
]


@pytest.mark.parametrize('count', range(4))
def test_diagnostics_are_read_back(count, fast_dds):
    data = encode_diagnostics(STAMPS[5], 'four_bar', STATUSES[:count])
    assert len(data) % 4 == 0
    for message in every_decoding(data, DIAGNOSTIC_ARRAY, fast_dds):
        assert stamp_of(message) == STAMPS[5]
        for status, expected in zip(message.status, STATUSES[:count], strict=True):
            level = status.level[0] if isinstance(status.level, bytes) else int(status.level)
            values = {pair.key: pair.value for pair in status.values}
            assert (level, status.name, status.message, values) == tuple(expected)
            assert status.hardware_id == 'four_bar'


def every_decoding(data, interface, fast_dds):
    """The message as rosbags and as Fast DDS read it."""
    yield STORE.deserialize_cdr(data, interface.name)
    yield fast_dds.deserialize_message(data, message_class(interface.name))


@pytest.mark.parametrize('value', [1.5, -0.0, 1e300])
def test_arrays_of_numbers_are_read_by_others_and_written_alike(fast_dds, value):
    from std_msgs.msg import Float64MultiArray

    data = encode_float64_array(value)
    message = fast_dds.deserialize_message(data, Float64MultiArray)
    assert message.data.tolist() == [value]
    assert (list(message.layout.dim), message.layout.data_offset) == ([], 0)
    read = STORE.deserialize_cdr(data, 'std_msgs/msg/Float64MultiArray')
    assert read.data.tolist() == [value]
    assert bytes(STORE.serialize_cdr(read, 'std_msgs/msg/Float64MultiArray')) == data
