# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads the MCAP logs of this package, and says in one line what else a file is."""

from __future__ import annotations

import os
import struct
import textwrap
import zlib
from collections.abc import Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import BinaryIO, NamedTuple

from mcap.reader import McapReader, NonSeekingReader, make_reader
from mcap.records import Channel, ChunkIndex, Message, Schema, Statistics
from mcap.writer import MCAP0_MAGIC

from linkage_ros.errors import ConfigurationError, LogError
from linkage_ros.log.records import (
    CONFIGURATION_RECORD,
    MOTION_RECORD,
    read_configuration,
    read_motion,
)

_MAGIC_SIZE, _FOOTER_SIZE = 8, 9 + 20
_CUT = 'it is not complete: its run was killed; linkage_log recover saves what is there'


class LoggedMessage(NamedTuple):
    """A message as it was logged.

    Attributes:
        topic: Fully qualified name.
        type: Message type, such as 'std_msgs/msg/Float64'.
        time: Log time, ns.
        data: CDR bytes.
        published: Publish time, ns.
    """

    topic: str
    type: str
    time: int
    data: bytes
    published: int


class LoggedTopic(NamedTuple):
    """A channel of a log.

    Attributes:
        name: Fully qualified.
        type: Of its messages.
        messages: Their number.
        latched: Whether late subscribers get the last one.
        layout: Encodings of message and schema, and the schema's text.
    """

    name: str
    type: str
    messages: int
    latched: bool
    layout: tuple[str, str, str]


class LogReader(AbstractContextManager['LogReader']):
    """Reads a complete log of this package.

    Attributes:
        path: The file.
        configuration: Of the run.
        version: Of linkage_ros that wrote it.
        motions: The pieces of motion, in order.
        topics: The channels.
        start: Time of the first message, ns.
        end: Time of the last message, ns.
    """

    def __init__(self, path: Path | str) -> None:
        """Opens a log.

        Args:
            path: The file.

        Raises:
            LogError: It is no complete log of linkage_ros; says what it is.
        """
        self.path = Path(path)
        try:
            self._stream = self.path.open('rb')
        except OSError as error:
            raise LogError(f'{path} cannot be read: {error.strerror or error}') from error
        try:
            with _damage_reported(self.path):
                self._open()
        except BaseException:
            self._stream.close()
            raise

    def _open(self) -> None:
        if self._is_cut():
            raise LogError(_CUT)
        self._reader: McapReader = make_reader(self._stream, validate_crcs=True)
        summary = self._reader.get_summary()
        if summary is None or summary.statistics is None:
            raise LogError(_CUT)
        _check_summary(self._stream)
        if summary.statistics.chunk_count != len(summary.chunk_indexes):
            raise LogError('it is damaged: its index leaves out parts of it')
        _share_offsets(summary.chunk_indexes)
        records = list(self._reader.iter_metadata())
        # The index is under the summary's checksum, the records' names are under none.
        if [record.name for record in records] != [i.name for i in summary.metadata_indexes]:
            raise LogError('it is damaged: its metadata records are not those of its index')
        about, motions = [], []
        for record in records:
            if record.name == CONFIGURATION_RECORD:
                about.append(read_configuration(record.metadata))
            elif record.name == MOTION_RECORD:
                motions.append(read_motion(record.metadata))
        if not about:
            raise LogError('it is no log of linkage_ros: it has no configuration record')
        if len(about) > 1:
            raise LogError(f'it has {len(about)} configuration records: which one explains it?')
        self.version, self.configuration = about[0]
        self.motions = tuple(motions)
        statistics: Statistics = summary.statistics
        self.topics = tuple(
            _topic(channel, summary.schemas, statistics) for channel in summary.channels.values()
        )
        self.start, self.end = statistics.message_start_time, statistics.message_end_time

    def _is_cut(self) -> bool:
        """Whether it begins as an MCAP file but does not end as one."""
        begin = self._stream.read(_MAGIC_SIZE)
        if self._stream.seek(0, os.SEEK_END) < _MAGIC_SIZE:
            return False
        self._stream.seek(-_MAGIC_SIZE, os.SEEK_END)
        end = self._stream.read(_MAGIC_SIZE)
        self._stream.seek(0)
        return begin == MCAP0_MAGIC != end

    def messages(
        self,
        topics: Iterable[str] | None = None,
        start: int | None = None,
        end: int | None = None,
    ) -> Iterator[LoggedMessage]:
        """Reads messages in the order of their log times.

        Args:
            topics: Fully qualified names; None: all.
            start: First log time, ns; None: from the beginning.
            end: Log time before which to stop, ns; None: at the end.

        Yields:
            The messages.

        Raises:
            LogError: The file is damaged.
        """
        wanted = None if topics is None else list(topics)
        stored = self._reader.iter_messages(topics=wanted, starting_at=start, ending_before=end)
        with _damage_reported(self.path):
            for schema, channel, message in stored:
                yield _logged(schema, channel, message)

    def written(self) -> Iterator[LoggedMessage]:
        """Reads all messages in the order of writing, whatever their log times.

        Yields:
            The messages.

        Raises:
            LogError: The file is damaged.
        """
        expected = {topic.name: topic.messages for topic in self.topics}
        found = dict.fromkeys(expected, 0)
        with _damage_reported(self.path), self.path.open('rb') as stream:
            reader = NonSeekingReader(stream, validate_crcs=True)
            for schema, channel, message in reader.iter_messages(log_time_order=False):
                found[channel.topic] = found.get(channel.topic, 0) + 1
                yield _logged(schema, channel, message)
            # A damaged opcode hides its record: no checksum covers it.
            if found != expected:
                raise LogError('it is damaged: its messages are not as many as its summary says')

    def close(self) -> None:
        """Closes the file."""
        self._stream.close()

    def __exit__(self, *error: object) -> None:
        self.close()


def _logged(schema: Schema | None, channel: Channel, message: Message) -> LoggedMessage:
    kind = '' if schema is None else schema.name
    return LoggedMessage(channel.topic, kind, message.log_time, message.data, message.publish_time)


def _topic(channel: Channel, schemas: dict[int, Schema], statistics: Statistics) -> LoggedTopic:
    schema = schemas[channel.schema_id]
    text = schema.data.decode(errors='replace')
    return LoggedTopic(
        channel.topic,
        schema.name,
        statistics.channel_message_counts.get(channel.id, 0),
        'transient_local' in channel.metadata.get('offered_qos_profiles', ''),
        (channel.message_encoding, schema.encoding, text),
    )


def _check_summary(stream: BinaryIO) -> None:
    """Compares the summary's checksum, which the mcap reader does not look at.

    Args:
        stream: The file; its position is moved.

    Raises:
        LogError: The summary is damaged.
    """
    footer = stream.seek(-(_FOOTER_SIZE + _MAGIC_SIZE), os.SEEK_END)
    _, _, start, _, expected = struct.unpack('<BQQQI', stream.read(_FOOTER_SIZE))
    stream.seek(start)
    # The checksum covers the summary and the footer up to the checksum itself.
    if expected and zlib.crc32(stream.read(footer + _FOOTER_SIZE - 4 - start)) != expected:
        raise LogError('it is damaged: the checksum of its summary is wrong')


def _share_offsets(chunks: Iterable[ChunkIndex]) -> None:
    """Gives chunks with the same channels one table of them: half of what an index holds.

    The reader looks at the keys alone. A log of a day has hundreds of thousands of chunks.
    """
    tables: dict[tuple[int, ...], dict[int, int]] = {}
    for chunk in chunks:
        offsets = chunk.message_index_offsets
        chunk.message_index_offsets = tables.setdefault(tuple(offsets), offsets)


@contextmanager
def _damage_reported(path: Path) -> Iterator[None]:
    """Turns whatever damage makes a parser raise into one line that names the file.

    Raises:
        LogError: The file is damaged or none of ours.
    """
    try:
        yield
    except LogError as error:
        raise LogError(f'{path} cannot be used: {error}') from error
    except ConfigurationError as error:
        words = textwrap.shorten(str(error), 300, placeholder=' ...')
        raise LogError(f'{path} cannot be used: its configuration is refused: {words}') from error
    except Exception as error:  # nothing bounds what damage makes a parser raise
        cause = ' '.join(f'{type(error).__name__}: {error}'.split())[:200]
        raise LogError(
            f'{path} is no readable MCAP file, or is damaged or not complete ({cause})'
        ) from error
