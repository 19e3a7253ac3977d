# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Writes the MCAP log: a bag that ROS tools open directly, with all data to verify it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TypeAlias

from mcap.writer import MCAP0_MAGIC, CompressionType, Writer

from linkage_ros.errors import LogError
from linkage_ros.log.chunks import Chunks
from linkage_ros.log.disk_sync import DiskSync
from linkage_ros.log.log_file import LogFile
from linkage_ros.log.metadata import (
    CONFIGURATION_RECORD,
    END_RECORD,
    MOTION_RECORD,
    encode_configuration,
    encode_end,
    encode_motion,
)
from linkage_ros.motion.segments import Segment
from linkage_ros.parameters.configuration import Configuration
from linkage_ros.wire.rows import RowLayout
from linkage_ros.wire.topics import Topic

# A row, the arguments of `LogWriter.write`, or a segment of motion.
LogItem: TypeAlias = bytes | tuple[int, int, bytes] | Segment

_CHUNK_SIZE = 1 << 20
_FOREVER = '{sec: 9223372036, nsec: 854775807}'


def _qos(topic: Topic) -> str:
    """A publisher's quality of service in rosbag2's format, which requires every key."""
    durability = 'transient_local' if topic.latched else 'volatile'
    return (
        f'- history: keep_last\n  depth: {topic.depth}\n'
        f'  reliability: reliable\n  durability: {durability}\n'
        f'  deadline: {_FOREVER}\n  lifespan: {_FOREVER}\n'
        f'  liveliness: automatic\n  liveliness_lease_duration: {_FOREVER}\n'
        '  avoid_ros_namespace_conventions: false\n'
    )


class LogWriter(AbstractContextManager['LogWriter']):
    """Writes one log; not thread-safe."""

    def __init__(self, path: Path | str, configuration: Configuration, *, overwrite: bool) -> None:
        """Creates the file and writes the configuration of the run.

        Args:
            path: The file.
            configuration: Configuration of the run.
            overwrite: Whether to replace an existing log.

        Raises:
            LogError: The file exists and is not to be replaced, or is no log; it is being written
                by another run, or cannot be created.
        """
        self._file = LogFile(path, MCAP0_MAGIC, overwrite=overwrite)
        self._writer = Writer(
            self._file.stream, chunk_size=_CHUNK_SIZE, compression=CompressionType.ZSTD
        )
        self._chunks = Chunks(self._writer, _CHUNK_SIZE)
        self._schemas: dict[str, int] = {}
        try:
            with self._file.reported():
                self._writer.start(profile='ros2', library='linkage_ros')
                record = encode_configuration(configuration)
                self._writer.add_metadata(CONFIGURATION_RECORD, record)
            self.flush()
        except LogError:
            self._file.discard()
            raise
        self._file.begun = True

    def add_topic(self, topic: Topic, name: str) -> int:
        """Declares a channel.

        Args:
            topic: The topic.
            name: Its fully qualified name.

        Returns:
            The channel, for `write`.
        """
        interface = topic.interface
        if interface.name not in self._schemas:
            self._schemas[interface.name] = self._writer.register_schema(
                interface.name, 'ros2msg', interface.definition.encode()
            )
        metadata = {'offered_qos_profiles': _qos(topic), 'topic_type_hash': interface.hash}
        schema = self._schemas[interface.name]
        return self._writer.register_channel(name, 'cdr', schema, metadata)

    def add_states(self, layout: RowLayout, topics: Iterable[tuple[Topic, str]]) -> None:
        """Declares the channels of rows, which come first in a log.

        Args:
            layout: Layout of the rows.
            topics: Topics and their fully qualified names.
        """
        self._layout = layout
        for topic, name in topics:
            self.add_topic(topic, name)

    def write(self, channel: int, stamp: int, data: bytes) -> None:
        """Appends a message.

        Args:
            channel: From `add_topic`.
            stamp: Log and publish time, ns.
            data: CDR bytes.

        Raises:
            LogError: The file cannot be written.
        """
        with self._file.reported():
            self._chunks.add(channel, stamp, data)

    def write_rows(self, rows: bytearray) -> None:
        """Appends the messages of states.

        Args:
            rows: In the layout of `add_states`.

        Raises:
            LogError: The file cannot be written.
        """
        if rows:
            with self._file.reported():
                self._chunks.add_rows(self._layout, rows)

    def write_motion(self, segment: Segment) -> None:
        """Appends a segment of motion."""
        with self._file.reported():
            self._writer.add_metadata(MOTION_RECORD, encode_motion(segment))

    def consume(self, items: Sequence[LogItem]) -> None:
        """Appends items, and flushes them.

        Args:
            items: Rows, arguments of `write`, and segments of motion.
        """
        rows = bytearray()  # next to each other: it takes far less time than one by one
        for item in items:
            if isinstance(item, bytes):
                rows += item
                continue
            self.write_rows(rows)
            rows.clear()
            if isinstance(item, tuple):
                self.write(*item)
            else:
                self.write_motion(item)
        self.write_rows(rows)
        self.flush()

    def flush(self) -> None:
        """Hands all messages to the operating system; a killed run loses only later ones.

        Raises:
            LogError: The file cannot be written, was removed or truncated; the log ends.
        """
        self._file.check_size()  # what is written now would hide that somebody cut it off
        with self._file.reported():
            self._writer.flush()
        if self._file.is_removed():
            self.close()
        self._file.check_size()

    def close(self) -> None:
        """Completes the file; restores it first if it was removed.

        Raises:
            LogError: The file cannot be written, was removed or truncated.
        """
        if self._file.stream.closed:
            return
        try:
            self._file.check_size()
            with self._file.reported():
                self._writer.flush()  # or the last chunk would lie behind the record
                self._writer.add_metadata(
                    END_RECORD, encode_end(self._chunks.statistics.message_count)
                )
                self._writer.finish()
                self._file.stream.flush()
            if self._file.is_removed():
                self._file.put_back()
        finally:
            self._file.close()

    def disk_sync(self) -> DiskSync:
        """The object that syncs the file to the disk, for a separate worker."""
        return DiskSync(self._file.path, self._file.stream.fileno())

    def __exit__(self, *error: object) -> None:
        self.close()
