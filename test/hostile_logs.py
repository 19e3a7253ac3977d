# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Hostile logs, the same for the same seed: damaged, or forged under right checksums."""

import json
import struct

from hostile import NUMBERS, TEXTS, mutated
from hostile_bombs import MAGIC, bombs, resummed
from live_logs import live, ticks
from mcap.records import Message, MessageIndex, Metadata
from mcap.writer import CompressionType, IndexType
from mcap_records import packed_records, records_of

from linkage_ros.log.metadata import seal
from linkage_ros.parameters.configuration import configure, load
from linkage_ros.record import record

# Where a length, a count, an offset or a time is expected.
WHOLE = (0, 1, 7, 8, 255, 2**15, 2**16 - 1, 2**24, 2**31, 2**32 - 1, 2**40, 2**63, 2**64 - 1)
WORDS = [struct.pack('<Q', n) for n in WHOLE] + [struct.pack('<d', n) for n in NUMBERS]

TORQUE = {**load('quadrilateral').parameters(), 'drive': 'torque', 'motor.torque': 1.0}
for name in ('rpm', 'crank_acceleration', 'effort_command_topic', 'lead_time',
             'trajectory_command_topic', 'trajectory_horizon'):  # fmt: skip
    del TORQUE[name]


def good_logs(folder):
    """Small logs of each kind of mechanism and drive, live ones and records: their bytes."""
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
    """The bytes of a log that is damaged, forged or none."""
    draw, data = rng.random(), rng.choice(logs)
    if draw < 0.02:
        return rng.choice(bombs())()
    if draw < 0.5:
        return forged(rng, data)
    for _ in range(rng.randint(1, 5)):
        data = mutated(rng, data, [*WORDS, MAGIC, b'\x06', b'\x0c']) or data
    return resummed(data) if draw < 0.8 else data


def forged(rng, data):
    """A log of the same kind, with right checksums, that says something else."""
    records = _records(data)
    for _ in range(rng.randint(1, 4)):
        number = rng.randrange(1, len(records))
        if rng.random() < 0.5:  # messages are many, the others tell more
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
    """A log as it is, but neither packed nor with a checksum."""
    return packed_records(_records(data), compression=CompressionType.NONE, enable_crcs=False)


def _records(data):
    return [record for record in records_of(data) if not isinstance(record, MessageIndex)]


def _forge(rng, record):
    """Gives a field of a record another value of its type."""
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
    """MCAP's texts are UTF-8."""
    return text.encode('utf-8', 'replace').decode()
