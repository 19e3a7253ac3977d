# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Writes MCAP logs: bags that ROS tools can open and that contain all data for verification."""

import struct
from collections.abc import Iterable, Sequence
from contextlib import AbstractContextManager
from itertools import groupby
from pathlib import Path
from typing import Any, cast

import numpy as np
import numpy.typing as npt
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Channel, MessageIndex, Schema, Statistics
from mcap.writer import CompressionType, Writer

from linkage_ros.log.log_file import LogFile
from linkage_ros.log.metadata import (
    CONFIGURATION_RECORD,
    END_RECORD,
    MOTION_RECORD,
    ROLE,
    encode_configuration,
    encode_motion,
    seal,
)
from linkage_ros.motion.segments import Segment
from linkage_ros.parameters.configuration import Configuration
from linkage_ros.wire.rows import RowLayout, message_record
from linkage_ros.wire.topics import Topic

CHUNK_SIZE = 1 << 20
_INDEX_HEAD = struct.Struct('<BQHI')  # opcode and length of the record, channel, size of entries
_FOREVER = '{sec: 9223372036, nsec: 854775807}'


class _Index(MessageIndex):
    """Message index of one channel in a chunk; its entries are stored as bytes."""

    records: Any

    def write(self, stream: RecordBuilder) -> None:
        """Writes the record; called by the writer of the mcap package."""
        entries = b''.join(self.records)
        size = len(entries)
        stream.write(_INDEX_HEAD.pack(Opcode.MESSAGE_INDEX, 6 + size, self.channel_id, size))
        stream.write(entries)


def _qos(topic: Topic) -> str:
    """Formats a publisher's quality of service for rosbag2, which requires every key."""
    durability = 'transient_local' if topic.latched else 'volatile'
    return (
        f'- history: keep_last\n  depth: {topic.depth}\n'
        f'  reliability: reliable\n  durability: {durability}\n'
        f'  deadline: {_FOREVER}\n  lifespan: {_FOREVER}\n'
        f'  liveliness: automatic\n  liveliness_lease_duration: {_FOREVER}\n'
        '  avoid_ros_namespace_conventions: false\n'
    )


class LogWriter(AbstractContextManager['LogWriter']):
    """Writes a log; not thread-safe.

    The mcap package has no public function that adds encoded records, so this class accesses
    private attributes of its writer.

    Attributes:
        file: The log file.
        library: The writer of the mcap package.
        statistics: Message counts and times so far.
        channels: Channels declared so far, by number.
        has_end: Whether to write an end record, which shows that the log includes the end of the
            run.
    """

    def __init__(
        self, path: Path | str, configuration: Configuration | None, *, overwrite: bool
    ) -> None:
        """Creates the file and writes the configuration of the run.

        Args:
            path: Path of the new file.
            configuration: Configuration of the run; None for a recovered log,
                to which the caller adds the record later, and `has_end` if the source has one.
            overwrite: Whether to replace an existing log.

        Raises:
            LogError: The file exists and must not be replaced, is not an MCAP file, is being
                written by another run, or cannot be created.
        """
        self.file = LogFile(path, overwrite=overwrite)
        self.library = Writer(
            cast('Any', self.file), chunk_size=CHUNK_SIZE, compression=CompressionType.ZSTD,
            enable_data_crcs=True,
        )  # fmt: skip
        self.library.start(profile='ros2', library='linkage_ros')
        private = vars(self.library)
        self._builder = private['_Writer__chunk_builder']
        self.statistics: Statistics = private['_Writer__statistics']
        self._schemas: dict[int, Schema] = private['_Writer__schemas']
        self.channels: dict[int, Channel] = private['_Writer__channels']
        self.has_end = configuration is not None
        if configuration is not None:
            self.library.add_metadata(CONFIGURATION_RECORD, encode_configuration(configuration))
            self.flush()

    def add_topic(self, topic: Topic, name: str) -> int:
        """Declares a channel.

        Args:
            topic: Topic of the channel's messages.
            name: Fully qualified name of the topic.

        Returns:
            The channel number, for `write`.
        """
        interface = topic.interface
        schemas = {schema.name: number for number, schema in self._schemas.items()}
        if interface.name not in schemas:
            schemas[interface.name] = self.library.register_schema(
                interface.name, 'ros2msg', interface.definition.encode()
            )
        metadata = {
            'offered_qos_profiles': _qos(topic), 'topic_type_hash': interface.hash,
            ROLE: topic.role,
        }  # fmt: skip
        return self.library.register_channel(name, 'cdr', schemas[interface.name], metadata)

    def add_states(self, layout: RowLayout, topics: Iterable[tuple[Topic, str]]) -> None:
        """Declares the channels of rows; must be called before `add_topic`.

        Args:
            layout: Layout of the rows.
            topics: Topics of a row and their fully qualified names.
        """
        self._layout = layout
        for topic, name in topics:
            self.add_topic(topic, name)

    def write(self, channel: int, stamp: int, data: bytes) -> None:
        """Appends a message.

        Args:
            channel: Channel number returned by `add_topic`.
            stamp: Log and publish time, ns.
            data: CDR bytes of the message.

        Raises:
            LogError: The file cannot be written.
        """
        index = np.array([[stamp, self.position]], np.uint64)
        self.add_records(
            message_record(channel, (stamp, stamp), data), index[:, 0], {channel: index}
        )

    def write_rows(self, rows: bytes | bytearray) -> None:
        """Appends the messages of states; chunks end with a complete row.

        Args:
            rows: Complete rows in the layout passed to `add_states`.

        Raises:
            LogError: The file cannot be written.
        """
        layout = self._layout
        while rows:
            start = self.position
            room = max(0, CHUNK_SIZE - start) // layout.size + 1
            some, rows = rows[: room * layout.size], rows[room * layout.size :]
            times = layout.column(some, layout.times)
            index = np.empty((len(layout.channels), len(times), 2), np.uint64)
            index[:, :, 0] = times
            index[:, :, 1] = np.add.outer(
                layout.starts, np.arange(start, start + len(some), layout.size)
            )
            self.add_records(some, times, dict(zip(layout.channels, index, strict=True)))

    def declare(self, record: Schema | Channel) -> None:
        """Appends a schema or channel, unless its number is in use or its schema is unknown."""
        known: dict[int, Any] = self.channels if isinstance(record, Channel) else self._schemas
        # Number 0: no schema.
        if record.id not in known and getattr(record, 'schema_id', 0) in {0, *self._schemas}:
            known[record.id] = record
            record.write(self._builder.record_writer)
        self.statistics.schema_count = len(self._schemas)
        self.statistics.channel_count = len(self.channels)

    @property
    def position(self) -> int:
        """Offset of the next record in the current chunk."""
        return int(self._builder.count)

    def add_records(
        self,
        data: bytes | bytearray,
        times: npt.NDArray[np.uint64],
        index: dict[int, npt.NDArray[np.uint64]],
    ) -> None:
        """Appends message records to the current chunk.

        Args:
            data: Concatenated message records.
            times: Log times that include the first and the last, ns.
            index: Log time, ns, and offset in the chunk of each message, shape (messages, 2), by
                channel number.
        """
        builder, statistics = self._builder, self.statistics
        builder.record_writer.write(data)
        if len(times):
            first, last = int(times.min()), int(times.max())
            for span, known in (
                (builder, builder.num_messages), (statistics, statistics.message_count)
            ):  # fmt: skip
                span.message_start_time = min(first, span.message_start_time if known else first)
                span.message_end_time = max(span.message_end_time, last)
        for channel, entries in index.items():
            builder.message_indices.setdefault(channel, _Index(channel, [])).records.append(
                entries.tobytes()
            )
            builder.num_messages += len(entries)
            statistics.message_count += len(entries)
            statistics.channel_message_counts[channel] += len(entries)
        if self.position > CHUNK_SIZE:
            self.library.flush()

    def write_motion(self, segment: Segment) -> None:
        """Appends a segment of motion."""
        self.library.add_metadata(MOTION_RECORD, encode_motion(segment))

    def consume(self, items: Sequence[Any]) -> None:
        """Appends items and flushes them; see `Worker`.

        Args:
            items: Rows, tuples of arguments for `write`, or segments of motion.
        """
        # Write adjacent rows together, which is much faster.
        for kind, group in groupby(items, type):
            if kind is bytes:
                self.write_rows(b''.join(group))
                continue
            for item in group:
                if kind is tuple:
                    self.write(*item)
                else:
                    self.write_motion(item)
        self.flush()

    def flush(self) -> None:
        """Passes all messages to the operating system, so that they survive if the run is killed.

        Raises:
            LogError: The file cannot be written, or was removed or truncated.
        """
        self.library.flush()

    def close(self) -> None:
        """Writes the end record and the summary, and closes the file.

        Raises:
            LogError: The file cannot be written, or was removed or truncated.
        """
        if self.file.stream.closed:
            return
        self.flush()  # otherwise the last chunk would follow the end record
        if self.has_end:
            end = seal({'messages': str(self.statistics.message_count)})
            self.library.add_metadata(END_RECORD, end)
        self.library.finish()
        self.library.flush()
        self.file.close()

    def __exit__(self, *error: object) -> None:
        self.close()
