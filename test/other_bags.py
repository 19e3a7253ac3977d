# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Bags of a robot, as other programs write them."""

import math

from mcap.writer import CompressionType, Writer
from rosbags import rosbag2

from linkage_ros.messages.fields import Template
from linkage_ros.messages.templates import float64, joint_state
from linkage_ros.messages.topics import FLOAT64, JOINT_STATE

START, MS = 1_795_000_000_000_000_000, 1_000_000
JOINTS = ('elbow', 'crank', 'wrist')
ARM = Template(joint_state(JOINTS, 'world'))
GRIPPER = Template(joint_state(('finger', 'thumb'), 'hand'))
NUMBER = Template(float64('data'))


def measurement(n, *, stamp=None, joints=ARM):
    """Returns the message with the n-th measurement of a crank that swings through a wrap."""
    stamp = START + n * MS if stamp is None else stamp
    angle = math.remainder(3.0 + 2.0 * math.sin(0.01 * n), 2 * math.pi)
    row = {'position': (0.1, angle, 0.2), 'velocity': (0.0, 20 * math.cos(0.01 * n), 0.0)}
    numbers = [*row['position'], *row['velocity'], 0.0, 0.0, 0.0]
    return joints.pack(*divmod(stamp, 10**9), *numbers[: len(joints.places) - 2])


def robot(count=300):
    """Yields (topic, type, log time, bytes) of a robot's bag: two publishers, 40 other topics."""
    for n in range(count):
        time = START + n * MS + 700
        yield '/joint_states', JOINT_STATE, time, measurement(n)
        if n % 3 == 0:
            yield '/joint_states', JOINT_STATE, time + 1, measurement(n, joints=GRIPPER)
            yield '/gripper/joint_states', JOINT_STATE, time + 2, measurement(n, joints=GRIPPER)
        if n % 50 == 7:
            yield '/joint_states', JOINT_STATE, time + 3, measurement(n - 3)  # late
            yield '/joint_states', JOINT_STATE, time + 4, measurement(n)[:40]  # damaged
        yield f'/other_{n % 40}', FLOAT64, time + 5, NUMBER.pack(float(n))


def write_mcap(path, messages, **options):
    with path.open('wb') as stream:
        writer = Writer(stream, **options)
        writer.start('ros2', 'other')
        schemas, channels = {}, {}
        for topic, kind, time, data in messages:
            if kind.name not in schemas:
                schemas[kind.name] = writer.register_schema(
                    kind.name, 'ros2msg', kind.definition.encode()
                )
            if topic not in channels:
                channels[topic] = writer.register_channel(topic, 'cdr', schemas[kind.name])
            writer.add_message(channels[topic], time, data, time)
        writer.finish()
    return path


def write_rosbag2(path, messages, storage=rosbag2.StoragePlugin.MCAP, compression=None):
    bag = rosbag2.Writer(path, version=9, storage_plugin=storage)
    if compression:
        bag.set_compression(compression, rosbag2.CompressionFormat.ZSTD)
    with bag:
        connections = {}
        for topic, kind, time, data in messages:
            if topic not in connections:
                connections[topic] = bag.add_connection(
                    topic, kind.name, msgdef=kind.definition, rihs01=kind.hash
                )
            bag.write(connections[topic], time, data)
    return path


def write_split(path, messages):
    """Writes a folder of 12 files, in the order of whose numbers the names are not sorted."""
    path.mkdir()
    messages = [*messages]
    for i in range(12):
        write_mcap(path / f'run_{i}.mcap', messages[i * 40 : None if i == 11 else i * 40 + 40])
    return path


def write_unindexed(path, messages):
    options = 'chunking', 'statistics', 'summary_offsets'
    options = {f'use_{name}': False for name in options} | {'repeat_channels': False}
    return write_mcap(path, messages, **options)


WRITERS = {
    'zstd': lambda path, messages: write_mcap(path, messages, chunk_size=5000),
    'lz4': lambda path, messages: write_mcap(path, messages, compression=CompressionType.LZ4),
    'uncompressed': lambda path, messages: write_mcap(
        path, messages, compression=CompressionType.NONE
    ),
    'unchunked': write_unindexed,
    'rosbags': write_rosbag2,
    'split': write_split,
    'compressed chunks': lambda path, messages: write_rosbag2(
        path, messages, compression=rosbag2.CompressionMode.STORAGE
    ),
}
