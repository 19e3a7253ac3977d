# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads MCAP logs of this package; rejects other files with a one-line error."""

import heapq
from collections import defaultdict, deque
from collections.abc import Callable, Container, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

from mcap.opcode import Opcode
from mcap.records import Channel, ChunkIndex, MetadataIndex, Schema, Statistics

from linkage_ros.errors import LogError
from linkage_ros.log.records import (
    CONFIGURATION_RECORD,
    END_RECORD,
    EVENT_RECORDS,
    LINKAGE,
    MOTION_RECORD,
    ROLE,
    Gap,
    LinkageEnd,
    TorqueEnd,
    decode_configuration,
    decode_events,
    decode_motion,
    unseal,
)
from linkage_ros.log.rows import MESSAGE_HEAD, RowLayout, RowLayouts, message_record
from linkage_ros.log.scan import MAGIC_SIZE, McapFile, mcap_file, records
from linkage_ros.messages.topics import EFFORT_COMMANDS, Topic
from linkage_ros.motion.segments import Segment
from linkage_ros.settings.old_names import has_old_names
from linkage_ros.units import TIME_END

# Largest size of messages buffered because chunks overlap in time, and overhead of a message in
# Python, bytes. The log of a simulator that was reset a hundred times requires a third of this.
_MOST_WAITING, _OVERHEAD = 1 << 29, 500


NO_CONFIGURATION = (
    'it has no configuration record of linkage_ros, which linkage_log recover needs; for logs of '
    'other programs there is "mcap recover"'
)


class LoggedMessage(NamedTuple):
    """A logged message.

    Attributes:
        topic: Fully qualified name of the topic.
        time: Log time, ns.
        data: CDR bytes of the message.
        published: Publish time, ns.
        channel: Number of the message's channel in the log.
    """

    topic: str
    time: int
    data: bytes
    published: int
    channel: int = 0


class LoggedTopic(NamedTuple):
    """A channel of a log.

    Attributes:
        number: Number of the channel.
        name: Fully qualified name of the topic.
        type: Type of the messages, such as 'std_msgs/msg/Float64'.
        messages: Number of messages.
        latched: Whether late subscribers receive the last message.
        layout: Message encoding, schema encoding, and schema text.
        role: Role of the topic in the run; see `Topic.role`. Empty for topics of other programs.
    """

    number: int
    name: str
    type: str
    messages: int
    latched: bool
    layout: tuple[str, str, str]
    role: str


class _Chunk(NamedTuple):
    """A chunk in the index; a tuple, because the log of a day has hundreds of thousands.

    Attributes:
        start: First log time of its messages, ns.
        end: Last log time, ns.
        offset: Offset in the file.
        channels: Numbers of the channels; may be empty in files of other writers.
    """

    start: int
    end: int
    offset: int
    channels: tuple[int, ...]


class _Queued(NamedTuple):
    """A message in the queue of messages that are not yet in order.

    Attributes:
        place: Log time, ns, offset of the chunk, and offset of the message in it: its order.
        message: The message.
    """

    place: tuple[int, int, int]
    message: LoggedMessage


class LogReader:
    """Reads a complete log of this package; opens the file only while it reads.

    Attributes:
        path: Path of the log.
        configuration: Configuration of the run.
        version: Version of linkage_ros that wrote the log.
        has_old_names: Whether its parameters have names before version 2.0.
        motions: The segments of motion of each linkage, in order, by its name.
        linkage_ends: The ends of motions while others continued, by name of the linkage.
        torque_ends: The ends of torques, in order.
        lost: Number of logged messages missing from the file; None if this is unknown, because the
            log was recovered without its end record or written by an old version.
        dropped: Number of states and other messages that the run dropped, because the disk was too
            slow.
        topics: The channels of the log.
        start: Log time of the first message, ns.
        end: Log time of the last message, ns.
    """

    def __init__(self, path: Path | str) -> None:
        """Reads the configuration, the motions and the index of a log.

        Raises:
            LogError: The file is not a complete log of linkage_ros. The message states the reason.
        """
        self.path = Path(path)
        # Channel and log time, ns, of efforts of 0 that are not part of a state.
        self._effort_zeros = set[tuple[int, int]]()
        with mcap_file(self.path, _remedy) as file:
            self._read_summary(file)

    def _read_summary(self, file: McapFile) -> None:
        """Reads the configuration, the motions and the index.

        Raises:
            LogError: The log is incomplete or damaged, or from another program.
        """
        summary = file.summary()
        if summary is None:
            raise LogError(
                f'it is incomplete: its run was killed or is still running; {_remedy(file)}'
            )
        statistics = summary[Statistics][-1]
        self._read_metadata(file, summary[MetadataIndex], statistics.message_count)
        self._read_topics(summary, statistics)
        self._chunks = [
            _Chunk(
                index.message_start_time,
                index.message_end_time,
                index.chunk_start_offset,
                tuple(index.message_index_offsets),
            )
            for index in summary[ChunkIndex]
        ]
        self._count = statistics.message_count
        self.start, self.end = statistics.message_start_time, statistics.message_end_time
        is_complete = (
            statistics.chunk_count == len(self._chunks)
            and statistics.channel_count == len(self.topics)
            and (bool(self._chunks) or not self._count)
        )
        repeats_role = len(self._roles) < sum(bool(topic.role) for topic in self.topics)
        if not is_complete or repeats_role:
            raise LogError('it is damaged: its index leaves out parts of it, or repeats a role')
        if not self.start <= self.end < TIME_END:
            raise LogError(f'its times, {self.start} to {self.end} ns, are not valid ROS times')

    def _read_metadata(
        self, file: McapFile, indexes: Sequence[MetadataIndex], messages: int
    ) -> None:
        """Reads the configuration, and what happened in the run.

        Raises:
            LogError: The records do not match the index, or there is no configuration.
        """
        records = defaultdict[str, list[dict[str, str]]](list)
        for index in indexes:
            record = file.content(index.offset)
            # The summary's checksum protects the index, but not the names of the records.
            if record.name != index.name:
                raise LogError('it is damaged: its metadata records do not match its index')
            records[record.name].append(record.metadata)
        configurations = records[CONFIGURATION_RECORD]
        if len(configurations) != 1:
            raise LogError(
                f'it is not a log of linkage_ros: it has {len(configurations)} configuration '
                'records instead of one; linkage_log csv and linkage_record --measured read bags '
                'of other programs'
            )
        (configuration,) = configurations
        self.version, self.configuration = decode_configuration(configuration)
        self.has_old_names = has_old_names(configuration)
        self.motions = self._decoded_motions(records[MOTION_RECORD])
        gaps = decode_events(Gap, records[EVENT_RECORDS[Gap]])
        self.dropped = sum(gap.dropped for gap in gaps)
        self.torque_ends = tuple(decode_events(TorqueEnd, records[EVENT_RECORDS[TorqueEnd]]))
        self.linkage_ends = dict[str, LinkageEnd]()
        for end in decode_events(LinkageEnd, records[EVENT_RECORDS[LinkageEnd]]):
            self.linkage_ends.setdefault(end.linkage, end)
        self.lost = None
        if records[END_RECORD]:
            self.lost = int(unseal(records[END_RECORD][0])['messages']) - messages
        self._gaps = [index.offset for index in indexes if index.name == EVENT_RECORDS[Gap]]

    def _decoded_motions(
        self, records: Sequence[dict[str, str]]
    ) -> dict[str, tuple[Segment, ...]]:
        """Returns the segments of motion of each linkage, in order.

        Raises:
            LogError: A record names an unknown linkage.
        """
        kind = self.configuration.drive_kind.segment
        motions = {linkage.name: list[Segment]() for linkage in self.configuration.linkages}
        for fields in records:
            linkage = fields.get(LINKAGE, '')
            segment = decode_motion(fields, kind)
            if linkage not in motions:
                raise LogError('it is damaged: a motion record names no linkage of the run')
            motions[linkage].append(segment)
        return {linkage: tuple(segments) for linkage, segments in motions.items()}

    def _read_topics(self, summary: Mapping[type, list[Any]], statistics: Statistics) -> None:
        """Reads the channels.

        Raises:
            LogError: No channel has a role.
        """
        schemas = {schema.id: schema for schema in summary[Schema]}
        channels = {channel.id: channel for channel in summary[Channel]}.values()
        self.topics = tuple(_topic(channel, schemas, statistics) for channel in channels)
        self._roles = {topic.role: topic for topic in self.topics if topic.role}
        if self.topics and not self._roles:
            raise LogError(
                f'its topics have no roles: version {self.version} wrote it; read it with that one'
            )
        # The effort of 0 that ends a torque is logged alone; it is not part of a state.
        if efforts := self.channel(EFFORT_COMMANDS):
            self._effort_zeros = {(efforts.number, end.stamp) for end in self.torque_ends}
        self._names = {topic.number: topic.name for topic in self.topics}

    def channel(self, topic: Topic) -> LoggedTopic | None:
        """Returns the channel with the role of a topic, or None."""
        return self._roles.get(topic.role)

    def messages(
        self,
        topics: Container[str] | None = None,
        start: int | None = None,
        end: int | None = None,
    ) -> Iterator[LoggedMessage]:
        """Reads messages in order of log time or, at equal times, in the order of the file.

        Args:
            topics: Fully qualified names of the topics to read; by default, all.
            start: Log time from which to read, ns; by default, from the start.
            end: Log time before which to stop, ns; by default, at the end.

        Yields:
            The messages.

        Raises:
            LogError: The file is damaged or too large when decompressed, or too many chunks
                overlap in time.
        """
        channels = {t.number for t in self.topics if topics is None or t.name in topics}
        times = range(start or 0, TIME_END if end is None else end)
        chunks = self._chunks_with(channels, times)
        next_starts = [*(chunk.start for chunk in chunks[1:]), TIME_END]
        # Messages not yet yielded, because messages of the next chunk may precede them.
        queue, queue_size = list[_Queued](), 0
        with mcap_file(self.path, _remedy) as file:
            for chunk, next_start in zip(chunks, next_starts, strict=False):
                for offset, message in self._messages_in(file, chunk):
                    if message.channel in channels and message.time in times:
                        place = message.time, chunk.offset, offset
                        heapq.heappush(queue, _Queued(place, message))
                        queue_size += len(message.data) + _OVERHEAD
                    if queue_size > _MOST_WAITING:
                        raise LogError('too many of its chunks overlap in time to be sorted')
                while queue and queue[0].message.time < next_start:
                    message = heapq.heappop(queue).message
                    queue_size -= len(message.data) + _OVERHEAD
                    yield message

    def _chunks_with(self, channels: set[int], times: range) -> list[_Chunk]:
        """Returns the chunks that may have messages of channels at log times, by first time."""

        def may_have_messages(chunk: _Chunk) -> bool:
            # Without an end, all chunks are read, also if a damaged index gives later times.
            is_before_end = chunk.start < times.stop or times.stop == TIME_END
            has_channels = not chunk.channels or not channels.isdisjoint(chunk.channels)
            return is_before_end and chunk.end >= times.start and has_channels

        chunks = filter(may_have_messages, self._chunks)
        return sorted(chunks, key=lambda chunk: (chunk.start, chunk.offset))

    def _messages_in(self, file: McapFile, chunk: _Chunk) -> Iterator[tuple[int, LoggedMessage]]:
        """Yields the messages of a chunk, with their offsets in it.

        Raises:
            LogError: A message is outside the times of the chunk.
        """
        data = file.content(chunk.offset)
        for opcode, _, start, end in records(data):
            if opcode == Opcode.MESSAGE:
                message = self._message(data, start, end)
                if not chunk.start <= message.time <= chunk.end:
                    raise LogError('it is damaged: its index has wrong times for a chunk')
                yield start, message

    def rows(
        self,
        layouts: RowLayouts,
        other: Callable[[LoggedMessage], object] = lambda _: None,
        gap: Callable[[], object] = lambda: None,
    ) -> Iterator[tuple[RowLayout, bytes]]:
        """Reads the messages of states in the order in which they were written.

        Args:
            layouts: Layouts of the rows, with the channel numbers of the log.
            other: Called with the messages of other channels.
            gap: Called where messages are missing; see `Gap`.

        Yields:
            The layout of a row, and MCAP records with sequence number 0: complete rows, or a
            single message that is not part of a complete row.

        Raises:
            LogError: The file is damaged.
        """
        message_count = 0
        layout, channels = layouts.of(layouts.names), {*layouts.channels.values()}
        with mcap_file(self.path, _remedy) as file:
            for data in self._chunk_data(file, gap):
                at = 0
                while at < len(data):
                    if count := layout.count(data, at):
                        rows = data[at : at + count * layout.size]
                        message_count += count * len(layout.channels)
                        at += len(rows)
                        yield layout, rows
                        continue
                    opcode, _, start, end = next(records(data, at))
                    if opcode != Opcode.MESSAGE:
                        at = end
                        continue
                    message = self._message(data, start, end)
                    is_zero = (message.channel, message.time) in self._effort_zeros
                    is_of_state = message.channel in channels and not is_zero
                    next_layout = layouts.at(data, at) if is_of_state else None
                    if next_layout and next_layout.count(data, at):
                        layout = next_layout
                        continue
                    message_count += 1
                    at = end
                    if is_of_state:
                        times = message.time, message.published
                        yield layout, message_record(message.channel, times, message.data)
                    else:
                        other(message)
            # A damaged opcode, which no checksum protects, hides records.
            if message_count != self._count:
                raise LogError('it is damaged: its number of messages does not match its summary')
            file.check_data()

    def _chunk_data(self, file: McapFile, gap: Callable[[], object]) -> Iterator[bytes]:
        """Yields the records of each chunk in the order of the file; see `rows` for `gap`."""
        gaps = deque(sorted(self._gaps))
        for offset in sorted(chunk.offset for chunk in self._chunks):
            while gaps and gaps[0] < offset:
                gaps.popleft()
                gap()
            yield file.content(offset)

    def _message(self, data: bytes, start: int, end: int) -> LoggedMessage:
        """Parses a message record of a chunk.

        Raises:
            KeyError: The channel of the message is unknown.
        """
        _, _, channel, _, time, published = MESSAGE_HEAD.unpack_from(data, start)
        body = data[start + MESSAGE_HEAD.size : end]
        return LoggedMessage(self._names[channel], time, body, published, channel)


def _remedy(file: McapFile) -> str:
    """Returns the remedy for an incomplete or damaged file; `recover` needs the configuration."""
    with suppress(Exception):  # on damaged data the parser may raise any exception
        # Runs of this package write it first.
        record = file.content(file.next_place(MAGIC_SIZE))
        unseal(record.metadata)
        if record.name == CONFIGURATION_RECORD:
            return 'linkage_log recover saves the readable data'
    return NO_CONFIGURATION


def _topic(channel: Channel, schemas: dict[int, Schema], statistics: Statistics) -> LoggedTopic:
    """Describes a channel."""
    schema = schemas[channel.schema_id] if channel.schema_id else Schema(0, b'', '', '')
    return LoggedTopic(
        channel.id,
        channel.topic,
        schema.name,
        statistics.channel_message_counts.get(channel.id, 0),
        'transient_local' in channel.metadata.get('offered_qos_profiles', ''),
        (channel.message_encoding, schema.encoding, schema.data.decode(errors='replace')),
        channel.metadata.get(ROLE, ''),
    )
