# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Generates damaged and forged logs from a seed, and decompression bombs.

Bombs are logs of at most a few MB on which a naive reader uses gigabytes, or never ends.
"""

import json
import struct
import zlib

import zstandard
from hostile import NUMBERS, TEXTS, mutated
from live_logs import live, ticks
from mcap.data_stream import RecordBuilder
from mcap.records import (
    Channel,
    ChunkIndex,
    DataEnd,
    Header,
    Message,
    MessageIndex,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
)
from mcap.writer import CompressionType, IndexType
from mcap_records import packed_records, records_of

from linkage_ros.log.records import ROLE, encode_configuration, encode_motion, seal
from linkage_ros.messages.topics import JOINT_STATES
from linkage_ros.programs.record import record
from linkage_ros.run.states import Simulator
from linkage_ros.settings.configuration import configure, load

MAGIC = b'\x89MCAP0\r\n'


def resummed(data):
    """Returns a file with a correct checksum of its summary, which may be forged."""
    start = struct.unpack_from('<Q', data, len(data) - 28)[0] if len(data) > 37 else 0
    if not 0 < start < len(data) - 37:
        return data
    return data[:-12] + struct.pack('<I', zlib.crc32(data[start:-12])) + data[-8:]


def packed(*records):
    """Returns records in their binary form."""
    builder = RecordBuilder()
    for part in records:
        part.write(builder)
    return builder.end()


def record_bytes(opcode, body, length=None):
    """Returns a record in its binary form, with its true length or a false one."""
    return struct.pack('<BQ', opcode, len(body) if length is None else length) + body


def chunk(packing, data, size):
    """Returns a chunk record that states an uncompressed size."""
    head = struct.pack('<QQQII', 0, 2**62, size, 0, len(packing)) + packing
    return record_bytes(6, head + struct.pack('<Q', len(data)) + data)


def tight(data):
    """Returns a chunk that states its true uncompressed size."""
    return chunk(b'zstd', zstandard.compress(data), len(data))


def zeros(count, told=None):
    """Makes a zstd frame that unpacks to `count` MiB of zeros and states this or another size."""
    head = b'\x00\x50' if told is None else b'\xc0\x50' + struct.pack('<Q', told)
    block = struct.pack('<I', 1 << 1 | 1 << 20)[:3] + b'\0'  # repeats one byte 128 KiB times
    return b'\x28\xb5\x2f\xfd' + head + block * (8 * count) + b'\x01\0\0'


def whole(*data, behind=b'', times=(0, 1), metadata=(), again=0, channels=1):
    """Returns a complete log with given records in its data section and summary.

    Args:
        data: Records; the chunks among them are indexed.
        behind: Additional records of the summary.
        times: Log times of the first and the last message, ns.
        metadata: Additional metadata records.
        again: Number of additional index entries of the last metadata record.
        channels: Number of topics.
    """
    configuration = load('quadrilateral')
    names = ['linkage_ros', 'linkage_ros/motion', *(name for name, _ in metadata)]
    fields = [
        encode_configuration(configuration),
        encode_motion(Simulator(configuration.only).begin(0).segment),
    ]
    fields += [settings for _, settings in metadata]
    interface = JOINT_STATES.interface
    told = [Schema(1, interface.definition.encode(), 'ros2msg', interface.name)]
    role = {ROLE: JOINT_STATES.role}
    told += [
        Channel(n, f'/joint_states{n or ""}', 'cdr', {} if n else role, 1) for n in range(channels)
    ]
    file, places, chunks = MAGIC + packed(Header('ros2', 'bomb'), *told), [], []
    for name, settings in zip(names, fields, strict=True):
        stored = packed(Metadata(name, settings))
        places.append(MetadataIndex(len(file), len(stored), name))
        file += stored
    places += places[-1:] * again
    for stored in data:
        if stored[0] == 6:
            chunks.append(ChunkIndex(len(stored), len(file), 'zstd', 0, 2**62, 0, {}, 0, 0))
        file += stored
    file += packed(DataEnd(0))
    count = len(chunks)
    counts = Statistics(0, channels, {}, count, count, times[1], times[0], len(names), 1)
    summary = packed(*told, counts, *chunks, *places) + behind
    return resummed(file + summary + record_bytes(2, struct.pack('<QQI', len(file), 0, 0)) + MAGIC)


def bombs():
    """Returns files of at most a few MB on which other readers use gigabytes."""
    message = record_bytes(5, struct.pack('<HIQQ', 0, 0, 0, 0))
    joints = record_bytes(5, struct.pack('<HIQQ', 0, 0, 0, 0) + b'\0\1\0\0' + b'\xff' * 1_000_000)
    nested = message
    for _ in range(60):
        nested = chunk(b'', nested * 2, 2 * len(nested)) if len(nested) < 1 << 18 else nested
    claim = b'\x0c' + struct.pack('<QI', 400_000, 11)
    head = struct.pack('<QQQII', 0, 0, 1 << 24, 0, 4) + b'zstd' + struct.pack('<Q', 400_000)
    landmark = record_bytes(6, head, len(head) + 400_000) + b'\x28\xb5\x2f\xfd'
    # Each frame unpacks to MiB before its error, and contains the next of a thousand chunks.
    frame = zeros(1)[:-3] + struct.pack('<I', len(landmark) + 6 + 32 << 3)[:3]
    chain = (landmark[:-4] + frame) * 2_000
    motions = [
        (
            'linkage_ros/motion',
            encode_motion(Simulator(load('quadrilateral').only).begin(0).segment),
        )
    ]
    endless = ('linkage_ros/motion', seal({
        'stamp': '0', 'phase': '1e999999999', 'speed': '0', 'rpm': '1', 'acceleration': '0',
    }))  # fmt: skip
    return (
        *(lambda told=told, size=size: whole(chunk(b'zstd', zeros(4096, told), size))
          for told in (None, 2**32) for size in (0, 2**32)),
        lambda: whole(chunk(b'zstd', zeros(16), 1 << 24)),
        lambda: whole(tight(message * 30_000)),
        lambda: whole(chunk(b'', joints * 10, len(joints) * 10)),
        lambda: whole(chunk(b'', nested, len(nested))),
        lambda: whole(behind=chunk(b'zstd', zeros(4096), 2**32)),
        lambda: whole(behind=record_bytes(9, b'', 2**62)),
        lambda: whole(chunk(b'\x1b[31m' * 100, b'', 0)),
        lambda: whole(record_bytes(9, b'', 2**62)),
        lambda: whole(channels=3_000),
        lambda: whole(times=(2**64 - 1, 0)),
        lambda: whole(times=(0, 2**64 - 1)),
        lambda: whole(metadata=[endless]),
        lambda: whole(metadata=motions * 800),
        lambda: whole(metadata=[('x', {str(n): '' for n in range(100_000)})], again=3),
        lambda: whole(b'\xff' + landmark * 4_000),
        lambda: whole(b'\xff' + chain),
        lambda: whole(b'\xff' + claim + b'linkage_ros' * 40_000),
        lambda: whole(b"\xff" + (claim + b"linkage_ros") * 10_000),
    )  # fmt: skip


# ---------------------------------------------------------------- damaged and forged logs

# Values for a length, a count, an offset or a time.
WHOLE = (0, 1, 7, 8, 255, 2**15, 2**16 - 1, 2**24, 2**31, 2**32 - 1, 2**40, 2**63, 2**64 - 1)
WORDS = [struct.pack('<Q', n) for n in WHOLE] + [struct.pack('<d', n) for n in NUMBERS]

TORQUE = {**load('quadrilateral').parameters(), 'drive': 'torque', 'motor.torque': 1.0}
for name in ('rpm', 'crank_acceleration', 'effort_command_topic', 'lead_time',
             'trajectory_command_topic', 'trajectory_horizon'):  # fmt: skip
    del TORQUE[name]


def good_logs(folder):
    """Returns the bytes of small logs: each kind of mechanism and drive, live runs and records."""
    changed = {**load('quadrilateral').parameters(), 'crank_acceleration': 7.1, 'rate_hz': 50.0}
    plan = [*ticks(15), ('rpm', -20.0), *ticks(15)]
    paths = [
        live(folder / '0.mcap', configure(changed), plan),
        live(folder / '1.mcap', configure(TORQUE), ticks(30)),
    ]
    for number, configuration in enumerate((load('compressor'), load('wind_pump')), 2):
        paths.append(folder / f'{number}.mcap')
        duration = 30 / configuration.session.rate_hz
        record(configuration, paths[-1], duration=duration, overwrite=True)
    return [path.read_bytes() for path in paths]


def log_file(rng, logs):
    """Generates the bytes of a file that is a damaged log, a forged log, or no log."""
    draw, data = rng.random(), rng.choice(logs)
    if draw < 0.02:
        return rng.choice(bombs())()
    if draw < 0.5:
        return forged(rng, data)
    for _ in range(rng.randint(1, 5)):
        data = mutated(rng, data, [*WORDS, MAGIC, b'\x06', b'\x0c']) or data
    return resummed(data) if draw < 0.8 else data


def forged(rng, data):
    """Returns a log of the same kind with valid checksums and changed contents."""
    records = _records(data)
    for _ in range(rng.randint(1, 4)):
        number = rng.randrange(1, len(records))
        if rng.random() < 0.5:  # messages outnumber the other records, which are more interesting
            number = rng.choice([n for n, r in enumerate(records) if not isinstance(r, Message)])
        kind = rng.randrange(8)
        if kind == 0 and number:
            del records[number]
        elif kind == 1:
            records.insert(rng.randrange(1, len(records)), records[number])
        else:
            _forge(rng, records[number])
    packing = rng.choice((CompressionType.ZSTD, CompressionType.LZ4, CompressionType.NONE))
    index = rng.choice((IndexType.ALL, IndexType.ALL, IndexType.NONE, IndexType.METADATA))
    return packed_records(
        records, chunk_size=rng.choice((1, 500, 1 << 20)), compression=packing,
        use_chunking=rng.random() < 0.9, index_types=index, enable_crcs=rng.random() < 0.9,
    )  # fmt: skip


def bare(data):
    """Returns a log without compression and checksums."""
    return packed_records(_records(data), compression=CompressionType.NONE, enable_crcs=False)


def _records(data):
    return [record for record in records_of(data) if not isinstance(record, MessageIndex)]


def _forge(rng, record):
    """Replaces a field of a record by another value of its type."""
    name = rng.choice(list(vars(record)))
    value = getattr(record, name)
    if isinstance(value, int):
        value = rng.choice(WHOLE) % 2 ** (16 if name.endswith('id') else 64)
    elif isinstance(value, str):
        value = plain(rng.choice((*TEXTS, 'sensor_msgs/msg/JointState')))
    elif isinstance(value, bytes):
        value = mutated(rng, value, WORDS)
    else:
        fields = {key: text for key, text in value.items() if key != 'crc32'}
        key = rng.choice([*fields, 'before', 'torque', 'rpm', 'x', rng.choice(TEXTS)])
        texts = *TEXTS, *map(json.dumps, NUMBERS), *map(str, WHOLE), *map(json.dumps, TEXTS)
        fields[plain(key)] = plain(rng.choice(texts))
        value = seal(fields) if isinstance(record, Metadata) else fields
    setattr(record, name, value)


def plain(text):
    """Replaces surrogates, because strings in MCAP are UTF-8."""
    return text.encode('utf-8', 'replace').decode()
