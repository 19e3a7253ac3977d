# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Logs of at most a few MB that make a trusting reader take gigabytes, or work for ever."""

import struct
import zlib

import zstandard
from mcap.data_stream import RecordBuilder
from mcap.records import (
    Channel,
    ChunkIndex,
    DataEnd,
    Header,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
)

from linkage_ros.log.metadata import encode_configuration, encode_motion, seal
from linkage_ros.parameters.configuration import load
from linkage_ros.run.simulator import Simulator
from linkage_ros.wire.topics import JOINT_STATES

MAGIC = b'\x89MCAP0\r\n'


def resummed(data):
    """A file whose summary has the right checksum, whatever is in it."""
    start = struct.unpack_from('<Q', data, len(data) - 28)[0] if len(data) > 37 else 0
    if not 0 < start < len(data) - 37:
        return data
    return data[:-12] + struct.pack('<I', zlib.crc32(data[start:-12])) + data[-8:]


def packed(*records):
    """Records as they stand in a file."""
    builder = RecordBuilder()
    for record in records:
        record.write(builder)
    return builder.end()


def record(opcode, body, length=None):
    """A record as it stands in a file, of the length that it has or claims."""
    return struct.pack('<BQ', opcode, len(body) if length is None else length) + body


def chunk(packing, data, size):
    """A chunk record that claims to unpack to a size."""
    head = struct.pack('<QQQII', 0, 2**62, size, 0, len(packing)) + packing
    return record(6, head + struct.pack('<Q', len(data)) + data)


def tight(data):
    """A chunk that unpacks to what it claims."""
    return chunk(b'zstd', zstandard.compress(data), len(data))


def zeros(count, told=None):
    """A zstd frame that unpacks to MiB of zeros, and tells that or another number of bytes."""
    head = b'\x00\x50' if told is None else b'\xc0\x50' + struct.pack('<Q', told)
    block = struct.pack('<I', 1 << 1 | 1 << 20)[:3] + b'\0'  # of one byte 128 KiB times
    return b'\x28\xb5\x2f\xfd' + head + block * (8 * count) + b'\x01\0\0'


def whole(*data, indexed=None, behind=b'', times=(0, 1), metadata=(), again=0, channels=1):
    """A complete log of ours whose data section and summary hold what is given.

    Args:
        data: Records; chunks among them are indexed.
        indexed: How often, instead of once.
        behind: What else stands in the summary.
        times: Of its first and last message, ns.
        metadata: More metadata records.
        again: How often the last of them is indexed once more.
        channels: How many topics it has.
    """
    configuration = load('quadrilateral')
    names = ['linkage_ros', 'linkage_ros/motion', *(name for name, _ in metadata)]
    fields = [
        encode_configuration(configuration),
        encode_motion(Simulator(configuration).begin(0).segment),
    ]
    fields += [settings for _, settings in metadata]
    interface = JOINT_STATES.interface
    told = [Schema(1, interface.definition.encode(), 'ros2msg', interface.name)]
    told += [Channel(n, f'/joint_states{n or ""}', 'cdr', {}, 1) for n in range(channels)]
    file, places, chunks = MAGIC + packed(Header('ros2', 'bomb'), *told), [], []
    for name, settings in zip(names, fields, strict=True):
        stored = packed(Metadata(name, settings))
        places.append(MetadataIndex(len(file), len(stored), name))
        file += stored
    places += places[-1:] * again
    for stored in data:
        if stored[0] == 6:
            index = ChunkIndex(len(stored), len(file), 'zstd', 0, 2**62, 0, {}, 0, 0)
            chunks += [index] * (1 if indexed is None else indexed)
        file += stored
    file += packed(DataEnd(0))
    count = len(chunks)
    counts = Statistics(0, channels, {}, count, count, times[1], times[0], len(names), 1)
    summary = packed(*told, counts, *chunks, *places) + behind
    return resummed(file + summary + record(2, struct.pack('<QQI', len(file), 0, 0)) + MAGIC)


def clocks(chunks, messages):
    """A log of chunks full of true messages of another tool's topic, all of them empty."""
    told = packed(
        Schema(2, b'builtin_interfaces/Time clock', 'ros2msg', 'rosgraph_msgs/msg/Clock'),
        Channel(9, '/clock', 'cdr', {}, 2),
    )
    full = tight(record(5, struct.pack('<HIQQ', 9, 0, 0, 0)) * messages)
    count = chunks * messages
    counts = Statistics(0, 2, {9: count}, chunks, count, 1, 0, 2, 2)
    return whole(told, *[full] * chunks, behind=told + packed(counts))


def fields(size):
    """A channel with so many bytes of metadata: one empty field, over and over."""
    head = struct.pack('<HHII', 0, 1, 0, 0)
    return record(4, head + struct.pack('<I', size) + bytes(size))


def bombs():
    """Files of at most a few MB that make other readers take gigabytes, or for ever."""
    message = record(5, struct.pack('<HIQQ', 0, 0, 0, 0))
    joints = record(5, struct.pack('<HIQQ', 0, 0, 0, 0) + b'\0\1\0\0' + b'\xff' * 1_000_000)
    nested = message
    for _ in range(60):
        nested = chunk(b'', nested * 2, 2 * len(nested)) if len(nested) < 1 << 18 else nested
    claim = b'\x0c' + struct.pack('<QI', 400_000, 11)
    head = struct.pack('<QQQII', 0, 0, 1 << 24, 0, 4) + b'zstd' + struct.pack('<Q', 400_000)
    landmark = record(6, head, len(head) + 400_000) + b'\x28\xb5\x2f\xfd'
    # Each frame unpacks to MiB before its fault, and holds the next chunk: all of a thousand.
    frame = zeros(1)[:-3] + struct.pack('<I', len(landmark) + 6 + 32 << 3)[:3]
    chain = (landmark[:-4] + frame) * 10_000
    motions = [
        ('linkage_ros/motion', encode_motion(Simulator(load('quadrilateral')).begin(0).segment))
    ]
    endless = ('linkage_ros/motion', seal({
        'stamp': '0', 'phase': '1e999999999', 'speed': '0', 'rpm': '1', 'acceleration': '0',
    }))  # fmt: skip
    return (
        *(lambda told=told, size=size: whole(chunk(b'zstd', zeros(4096, told), size))
          for told in (None, 2**32) for size in (0, 2**32)),
        lambda: whole(chunk(b'zstd', zeros(16), 1 << 24)),
        lambda: whole(tight(message * 30_000)),
        lambda: whole(tight(message * 100_000), indexed=1000),
        lambda: clocks(100, 400_000),
        lambda: whole(*[tight(fields(16_000_000))] * 100),
        lambda: whole(chunk(b'', joints * 10, len(joints) * 10)),
        lambda: whole(chunk(b'', nested, len(nested))),
        lambda: whole(behind=chunk(b'zstd', zeros(4096), 2**32)),
        lambda: whole(behind=record(9, b'', 2**62)),
        lambda: whole(chunk(b'\x1b[31m' * 100, b'', 0)),
        lambda: whole(record(9, b'', 2**62)),
        lambda: whole(channels=3_000),
        lambda: whole(times=(2**64 - 1, 0)),
        lambda: whole(times=(0, 2**64 - 1)),
        lambda: whole(metadata=[endless]),
        lambda: whole(metadata=motions * 800),
        lambda: whole(metadata=[('x', {str(n): '' for n in range(100_000)})], again=1000),
        lambda: whole(b'\xff' + landmark * 40_000),
        lambda: whole(b'\xff' + chain),
        lambda: whole(b'\xff' + claim + b'linkage_ros' * 40_000),
        lambda: whole(b'\xff' + (claim + b'linkage_ros') * 40_000),
    )  # fmt: skip
