# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Hostile logs, the same for the same seed: damaged, or forged under right checksums."""

import json
import struct
from io import BytesIO

from hostile import NUMBERS, TEXTS, mutated
from hostile_bombs import MAGIC, bombs, resummed
from mcap.records import Channel, Header, Message, Metadata, Schema
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, IndexType, Writer

from linkage_ros.log.metadata import seal
from linkage_ros.log.writer import LogWriter
from linkage_ros.motion.speed_driven import SpeedMotion
from linkage_ros.parameters.configuration import configure, load
from linkage_ros.run.simulator import Simulator
from linkage_ros.wire.topics import DIAGNOSTICS, ROBOT_DESCRIPTION

# Where a length, a count, an offset or a time is expected.
WHOLE = (0, 1, 7, 8, 255, 2**15, 2**16 - 1, 2**24, 2**31, 2**32 - 1, 2**40, 2**63, 2**64 - 1)


def good_logs(folder):
    """Small logs of each kind of mechanism and drive, live ones and records: their bytes."""
    changed = {**load('quadrilateral').parameters(), 'crank_acceleration': 7.1, 'rate_hz': 50.0}
    torque = {**load('quadrilateral').parameters(), 'drive': 'torque', 'motor.torque': 1.0}
    for name in ('rpm', 'crank_acceleration', 'effort_command_topic', 'lead_time',
                 'trajectory_command_topic', 'trajectory_horizon'):  # fmt: skip
        torque.pop(name)
    runs = [configure(changed), configure(torque), load('compressor'), load('wind_pump')]
    return [_run(folder / f'{n}.mcap', run, live=n < 2) for n, run in enumerate(runs)]


def _run(path, configuration, *, live):
    """Thirty states, with a change of motion in the midst of a live run that has one."""
    simulator, start = Simulator(configuration), 1_795_000_000_000_000_000 if live else 0
    motion = simulator.begin(start)
    with LogWriter(path, configuration, overwrite=True) as log:
        channels = [log.add_topic(topic, f'/{topic.name}') for topic in simulator.topics]
        log.write_motion(motion.segment)
        log.write(
            log.add_topic(ROBOT_DESCRIPTION, '/robot_description'), start, simulator.description
        )
        if live:
            log.write(log.add_topic(DIAGNOSTICS, '/diagnostics'), start, b'\0\1\0\0' + bytes(16))
        for tick in range(30):
            stamp = start + simulator.elapsed(tick)
            if tick == 15 and live and isinstance(motion, SpeedMotion):
                motion = motion.change(stamp, -20.0)
                log.flush()
                log.write_motion(motion.segment)
            for channel, data in zip(
                channels, simulator.snapshot_at(motion, stamp).messages, strict=True
            ):
                log.write(channel, stamp, data)
    return path.read_bytes()


def log_file(rng, logs):
    """The bytes of a log that is damaged, forged or none."""
    draw, data = rng.random(), rng.choice(logs)
    if draw < 0.02:
        return rng.choice(bombs())()
    if draw < 0.5:
        return forged(rng, data)
    words = [struct.pack('<Q', number) for number in WHOLE] + [MAGIC, b'\x06', b'\x0c']
    for _ in range(rng.randint(1, 5)):
        data = mutated(rng, data, words) or data
    return resummed(data) if draw < 0.8 else data


def forged(rng, data):
    """A log of the same kind, with right checksums, that says something else."""
    records = _records(data)
    for _ in range(rng.randint(1, 4)):
        number = rng.randrange(1, len(records))
        if rng.random() < 0.5:  # messages are many, the others tell more
            number = rng.choice([n for n, r in enumerate(records) if not isinstance(r, Message)])
        kind = rng.randrange(8)
        if kind == 0:
            del records[number]
        elif kind == 1:
            records.insert(rng.randrange(len(records)), records[number])
        else:
            _forge(rng, records[number])
    return written(rng, records)


def bare(data):
    """A log as it is, but neither packed nor with a checksum."""
    return written(None, _records(data))


def _records(data):
    """What is in a log, each schema and channel once."""
    found, numbers = [], set()
    for record in StreamReader(BytesIO(data)).records:
        number = type(record), getattr(record, 'id', len(found))
        if isinstance(record, (Header, Schema, Channel, Message, Metadata)):
            if number not in numbers:
                found.append(record)
            numbers.add(number)
    return found


def _forge(rng, record):
    if isinstance(record, Message):
        if rng.random() < 0.6:
            size = rng.choice((1, 2, 4, 8))
            value = rng.choice(
                (struct.pack('<d', rng.choice(NUMBERS)), struct.pack('<Q', rng.choice(WHOLE)))
            )
            at = rng.randrange(len(record.data) // size + 1) * size
            record.data = record.data[:at] + value[:size] + record.data[at + size :]
            record.data = rng.choice(
                (record.data, record.data, record.data[:at], record.data * 50)
            )
        else:
            field = rng.choice(('log_time', 'publish_time', 'channel_id'))
            most = 2**16 if field == 'channel_id' else 2**64
            setattr(record, field, rng.choice(WHOLE) % most)
    elif isinstance(record, Metadata):
        fields = {name: text for name, text in record.metadata.items() if name != 'crc32'}
        name = rng.choice([*fields, 'before', 'torque', 'rpm', 'x', rng.choice(TEXTS)])
        value = rng.choice(
            (*TEXTS, *map(json.dumps, NUMBERS), *map(str, WHOLE), *map(json.dumps, TEXTS))
        )
        fields[plain(name)] = plain(value)
        record.metadata = seal(fields)
    elif isinstance(record, Channel):
        field = rng.choice(('topic', 'message_encoding', 'schema_id'))
        value = rng.choice(WHOLE) % 2**16 if field == 'schema_id' else plain(rng.choice(TEXTS))
        setattr(record, field, value)
    elif isinstance(record, Schema):
        field = rng.choice(('name', 'encoding'))
        setattr(record, field, plain(rng.choice((*TEXTS, 'sensor_msgs/msg/JointState'))))


def plain(text):
    """MCAP's texts are UTF-8."""
    return text.encode('utf-8', 'replace').decode()


def written(rng, records):
    """Records as a file, packed in one way or another, or without rng not at all."""
    stream = BytesIO()
    writer = Writer(stream, compression=CompressionType.NONE, enable_crcs=False)
    if rng is not None:
        packing = rng.choice((CompressionType.ZSTD, CompressionType.LZ4, CompressionType.NONE))
        index = rng.choice((IndexType.ALL, IndexType.ALL, IndexType.NONE, IndexType.METADATA))
        writer = Writer(
            stream, chunk_size=rng.choice((1, 500, 1 << 20)), compression=packing,
            use_chunking=rng.random() < 0.9, index_types=index, enable_crcs=rng.random() < 0.9,
        )  # fmt: skip
    writer.start('ros2', 'forged')
    numbers = {0: 0}
    for item in records:
        if isinstance(item, Schema):
            numbers[item.id] = writer.register_schema(item.name, item.encoding, item.data)
        elif isinstance(item, Channel):
            schema = numbers.get(item.schema_id, item.schema_id)
            writer.register_channel(item.topic, item.message_encoding, schema, item.metadata)
        elif isinstance(item, Message):
            try:
                writer.add_message(item.channel_id, item.log_time, item.data, item.publish_time)
            except KeyError:  # of no channel: mcap does not even write that
                continue
        elif isinstance(item, Metadata):
            writer.add_metadata(item.name, item.metadata)
    writer.finish()
    return stream.getvalue()
