# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads bags of any program: an MCAP file, or the folder of a rosbag2 recording.

Each file is read from its start to its end, without its index, so that an incomplete bag gives all
messages before the damage, and memory holds one chunk at a time.
"""

import os
import struct
from collections import defaultdict
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import chain
from pathlib import Path
from typing import NamedTuple, TypeAlias

from mcap.opcode import Opcode
from mcap.records import Channel, Schema

from linkage_ros.errors import LogError, shortened
from linkage_ros.log.records import ROLE
from linkage_ros.log.rows import MESSAGE_HEAD
from linkage_ros.log.scan import (
    HEAD,
    IN_CHUNKS,
    McapFile,
    mcap_file,
    open_mcap,
    parsed,
    records,
)
from linkage_ros.messages.cdr import JointReader, decode_joint_state
from linkage_ros.messages.topics import JOINT_STATE
from linkage_ros.units import TIME_END

# Largest size of an uncompressed chunk, bytes. Images or point clouds may make chunks of 100 MB.
_LARGEST = 1 << 30
_TIME = struct.Struct('<15xQ')  # log time of a message; takes half the time of MESSAGE_HEAD
_CURE = (
    'of bags, only uncompressed MCAP files and those with compressed chunks are read; '
    'rosbags-convert --src FOLDER --dst NEW_FOLDER --dst-storage mcap converts others'
)


class BagTopic(NamedTuple):
    """A topic of a bag.

    Attributes:
        name: Fully qualified name.
        type: Type of the messages, such as 'sensor_msgs/msg/JointState'.
        role: See `Topic.role`; empty unless a run of this package wrote the topic.
    """

    name: str
    type: str
    role: str


# A message: its topic, log time, ns, and CDR bytes.
BagMessage: TypeAlias = tuple[BagTopic, int, bytes]


class Bag:
    """A bag of any program.

    Attributes:
        path: Path of the bag.
        files: The MCAP files of the bag, in the order of recording.
        size: Size of the files, bytes.
    """

    def __init__(self, path: Path | str) -> None:
        """Finds the files of a bag: an MCAP file, or those in a folder.

        Raises:
            LogError: There is no MCAP file.
        """
        self.path, self.files, self.size = Path(path), [Path(path)], 0
        if os.path.isdir(path):  # noqa: PTH112, accepts invalid names
            # rosbag2 numbers the files, as in run_0.mcap to run_10.mcap.
            self.files = sorted(self.path.glob('*.mcap'), key=lambda x: (len(x.name), x.name))
            if not self.files:
                names = shortened(', '.join(sorted(x.name for x in self.path.iterdir())), 80)
                raise LogError(f'{path} has no .mcap file, only {names or "nothing"}: {_CURE}')
        for file in self.files:
            with open_mcap(file, _CURE) as stream:
                self.size += stream.seek(0, os.SEEK_END)

    def messages(
        self,
        types: Collection[str] = (JOINT_STATE.name,),
        progress: Callable[[int], object] = lambda _: None,
    ) -> Iterator[list[BagMessage]]:
        """Yields the messages of some types by chunk, in the order of the files.

        Args:
            types: Types of the messages to read.
            progress: Called with the number of bytes read since the last call.

        Raises:
            LogError: The bag is incomplete or damaged; all messages before that were yielded.
        """
        for path in self.files:
            topics = _Topics(types)
            with mcap_file(path, _remedy, cure=_CURE, largest=_LARGEST) as file:
                for block, size in _blocks(file):
                    if messages := topics.messages(block):
                        yield messages
                    progress(size)

    def topics(self, type_name: str) -> set[str] | None:
        """Returns the names of the topics of a type; None if the index of a file is missing."""
        topics = set[str]()
        for path in self.files:
            with open_mcap(path, _CURE) as stream:
                summary = None
                with suppress(Exception):  # on damaged data the parser may raise any exception
                    summary = McapFile(stream).summary()
                if not summary or not summary[Channel]:
                    return None
                schemas = {schema.id for schema in summary[Schema] if schema.name == type_name}
                topics |= {x.topic for x in summary[Channel] if x.schema_id in schemas}
        return topics


def _remedy(file: McapFile) -> str:
    return f'"mcap recover" saves the readable data, at least {file.at} bytes'


def _blocks(file: McapFile) -> Iterator[tuple[bytes, int]]:
    """Yields the encoded schemas, channels and messages in each record of a file, and its size.

    Raises:
        LogError: A chunk is too large.
        ValueError: The file is damaged or incomplete. Damaged data may raise other exceptions.
    """
    opcode = 0
    for opcode, start, end in file.records():
        block = file.read(start, end - start) if opcode in IN_CHUNKS else b''
        if opcode == Opcode.CHUNK:
            block = file.content(start)
        yield block, end - start
    if opcode != Opcode.DATA_END:
        raise ValueError('the end of the data is missing')


class _Topics:
    """The topics of an MCAP file that were declared so far."""

    def __init__(self, types: Collection[str]) -> None:
        """Starts without topics; ignores those of other types."""
        self._types = types
        self._schemas, self._topics = dict[int, Schema](), dict[int, BagTopic]()

    def messages(self, block: bytes) -> list[BagMessage]:
        """Returns the messages of a block; see `Bag.messages`.

        Raises:
            LogError: A time is too large.
            ValueError: The block is damaged. Damaged data may raise other exceptions.
        """
        topics, messages, size = self._topics, list[BagMessage](), MESSAGE_HEAD.size
        for opcode, channel, start, end in records(block):
            if opcode != Opcode.MESSAGE:
                self._declare(opcode, block[start + HEAD.size : end])
            elif topic := topics.get(channel):
                (time,) = _TIME.unpack_from(block, start)
                if time >= TIME_END:
                    raise LogError(f'a message has the time {time} ns: must be a valid ROS time')
                messages.append((topic, time, block[start + size : end]))
        return messages

    def _declare(self, opcode: int, body: bytes) -> None:
        """Reads a schema or channel."""
        record = parsed(opcode, body)
        if opcode == Opcode.SCHEMA:
            self._schemas[record.id] = record
            return
        schema = self._schemas.get(record.schema_id)
        if schema and schema.name in self._types and record.message_encoding == 'cdr':
            role = record.metadata.get(ROLE, '')
            self._topics[record.id] = BagTopic(record.topic, schema.name, role)


def topic_of(bag: Bag, joints: Sequence[str], name: str = '') -> str:
    """Finds the topic with the joint states of some joints.

    Args:
        bag: The bag.
        joints: Names of the joints.
        name: Name of the topic; by default, the only topic that names one of the joints.

    Returns:
        The name of the topic.

    Raises:
        LogError: No topic or more than one names one of the joints, or the topic `name` does not.
    """
    # The topics that name a joint, and the first message of each topic.
    naming, first_messages = set[str](), dict[str, bytes]()
    readers = defaultdict[str, list[JointReader]](lambda: [JointReader(x) for x in joints])
    possible = {name} if name else bag.topics(JOINT_STATE.name)
    try:
        for topic, _, data in chain.from_iterable(bag.messages()):
            if topic.name in naming:
                continue
            first_messages.setdefault(topic.name, data)
            if _has_position(data, readers[topic.name]):
                naming.add(topic.name)
                if naming == possible:
                    break
    except LogError:  # the caller reads the messages before the damage
        if not naming:
            raise
    if name in naming:
        return name
    if len(naming) == 1 and not name:
        return naming.pop()
    words = ' or '.join(joints)
    if naming:
        raise LogError(
            f'{bag.path} has positions of {words} on {", ".join(sorted(naming))}: '
            'give one of these as --topic'
        )
    raise LogError(
        f'{bag.path} has no position of {words}: {_joints_instead(joints, first_messages)}'
    )


def _has_position(data: bytes, readers: Sequence[JointReader]) -> bool:
    """Returns whether a message is valid and has a position of one of the readers' joints."""
    try:
        return any(position is not None for _, position, _ in (x.read(data) for x in readers))
    except ValueError:
        return False


def _joints_instead(joints: Sequence[str], heard: Mapping[str, bytes]) -> str:
    """Describes the joints that a bag has instead, given the first message of each topic."""
    if not heard:
        return f'it has no {JOINT_STATE.name}'
    names = {topic: _names(data) for topic, data in sorted(heard.items())}
    nothing = 'nothing, or its messages are compressed or damaged'
    found = '; '.join(f'{topic} names {", ".join(own) or nothing}' for topic, own in names.items())
    others = {*chain.from_iterable(names.values())} - {*joints}
    return found + ('; give one of these as crank_joint or joints.crank.name' if others else '')


def _names(data: bytes) -> Sequence[str]:
    """Returns the names of the joints in a JointState; none if it is compressed or damaged."""
    with suppress(ValueError):
        return decode_joint_state(data).names
    return ()
