# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads the MCAP logs of this package; describes other files in one line."""

from __future__ import annotations

import os
import textwrap
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

from mcap.opcode import Opcode
from mcap.records import Channel, Message, Schema, Statistics
from mcap.writer import MCAP0_MAGIC

from linkage_ros.errors import ConfigurationError, LogError, printable
from linkage_ros.files import open_file
from linkage_ros.log.mcap_file import McapFile, Summary, parsed
from linkage_ros.log.metadata import (
    CONFIGURATION_RECORD,
    END_RECORD,
    MOTION_RECORD,
    decode_configuration,
    decode_end,
    decode_motion,
)
from linkage_ros.log.time_order import in_order
from linkage_ros.units import TIME_END
from linkage_ros.wire.rows import RowLayout, message_record

_MAGIC_SIZE = len(MCAP0_MAGIC)
_NO_SCHEMA = Schema(0, b'', '', '')
_CUT = (
    'it is not complete: its run was killed, or goes on; linkage_log recover saves what is there'
)
_OTHER = 'name a log of linkage_ros, as linkage_record writes them'


class LoggedMessage(NamedTuple):
    """A message as it was logged.

    Attributes:
        topic: Fully qualified name.
        time: Log time, ns.
        data: CDR bytes.
        published: Publish time, ns.
    """

    topic: str
    time: int
    data: bytes
    published: int


class LoggedTopic(NamedTuple):
    """A channel of a log.

    Attributes:
        number: Number of the channel.
        name: Fully qualified name.
        type: Type of its messages, such as 'std_msgs/msg/Float64'.
        messages: Number of messages.
        latched: Whether late subscribers get the last message.
        layout: Encodings of message and schema, and the schema's text.
    """

    number: int
    name: str
    type: str
    messages: int
    latched: bool
    layout: tuple[str, str, str]


class LogReader(AbstractContextManager['LogReader']):
    """Reads a complete log of this package.

    Attributes:
        path: The file.
        configuration: Configuration of the run.
        version: Version of linkage_ros that wrote it.
        has_same_urdf: Whether its robot_description can be recomputed; older versions gave links
            the names of joints.
        motions: The segments of motion, in order.
        lost: Number of logged messages missing from the file; 0 without an end record.
        topics: The channels.
        start: Time of the first message, ns.
        end: Time of the last message, ns.
    """

    def __init__(self, path: Path | str) -> None:
        """Opens a log.

        Args:
            path: The file.

        Raises:
            LogError: It is not a complete log of linkage_ros; the message says what it is.
        """
        self.path = Path(path)
        try:
            self._stream = open_file(self.path)
        except OSError as error:
            raise LogError(f'{path} cannot be read: {error.strerror or error}') from error
        try:
            with _damage_reported(self.path):
                self._open()
        except BaseException:
            self._stream.close()
            raise

    def _open(self) -> None:
        self._summary = summary = self._read_summary()
        statistics, file = summary.statistics, McapFile(self._stream)
        offsets = [index.offset for index in summary.metadata]
        chunks = [chunk.chunk_start_offset for chunk in summary.chunks]
        for places in (offsets, chunks):  # else one large record may be read many times
            if any(later <= earlier for earlier, later in pairwise(places)):
                raise LogError('it is damaged: its index goes back')
        found = [file.record(offset) for offset in offsets]
        records = [parsed(opcode, body) for opcode, body, _ in found if opcode == Opcode.METADATA]
        # The index is under the summary's checksum, the records' names are under none.
        if [record.name for record in records] != [i.name for i in summary.metadata]:
            raise LogError('it is damaged: its metadata records are not those of its index')
        about = [r.metadata for r in records if r.name == CONFIGURATION_RECORD]
        if not about:
            raise LogError('it is no log of linkage_ros: it has no configuration record')
        if len(about) > 1:
            raise LogError(f'it has {len(about)} configuration records: which one explains it?')
        if statistics.chunk_count != len(chunks):
            raise LogError('it is damaged: its index leaves out parts of it')
        self.version, self.configuration = decode_configuration(about[0])
        self.has_same_urdf = 'frame_id' in about[0]  # as old as the links' present names
        self.motions = tuple(decode_motion(r.metadata) for r in records if r.name == MOTION_RECORD)
        ends = [decode_end(r.metadata) for r in records if r.name == END_RECORD]
        self.lost = ends[0] - statistics.message_count if ends else 0
        self.topics = tuple(
            _topic(channel, summary.schemas, statistics) for channel in summary.channels.values()
        )
        self.start, self.end = statistics.message_start_time, statistics.message_end_time
        if not self.start <= self.end < TIME_END:
            raise LogError(f'its times, {self.start} to {self.end} ns, are none of ROS')

    def _read_summary(self) -> Summary:
        """Reads the summary of a complete MCAP file.

        Raises:
            LogError: It is a pipe or not an MCAP file, is truncated, or has a damaged index.
        """
        if not self._stream.seekable():
            raise LogError(f'it is a pipe, and a log is read from its end; {_OTHER}')
        begin = self._stream.read(_MAGIC_SIZE)
        if not begin:
            raise LogError(f'it is empty; {_OTHER}')
        if begin != MCAP0_MAGIC:
            words = printable(begin.decode('ascii', 'backslashreplace'))
            raise LogError(f"it is no MCAP file: it begins with '{words}'; {_OTHER}")
        self._stream.seek(self._stream.seek(0, os.SEEK_END) - _MAGIC_SIZE)
        if self._stream.read(_MAGIC_SIZE) != MCAP0_MAGIC:
            raise LogError(_CUT)
        summary = McapFile(self._stream).summary()
        if summary is None:
            raise LogError(_CUT)
        return summary

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
        names = None if topics is None else set(topics)
        summary = self._summary
        wanted = {
            number
            for number, channel in summary.channels.items()
            if names is None or channel.topic in names
        }
        last = TIME_END if end is None else end
        with _damage_reported(self.path):
            for message in in_order(McapFile(self._stream), summary, wanted, start or 0, last):
                yield self._message(message)

    def rows(
        self, layout: RowLayout, other: Callable[[LoggedMessage], object]
    ) -> Iterator[tuple[bytes, LoggedMessage | None]]:
        """Reads states in the order of writing.

        Args:
            layout: Layout of their messages, in the log's channels.
            other: Is given the messages of other channels.

        Yields:
            Whole rows, sequence numbers left out, and None; at the end, the beginning of a last
            row, and the message that does not fit there, None if the log ends.

        Raises:
            LogError: The file is damaged.
        """
        begun = b''  # of a row whose messages do not lie in one piece
        for item in self._data(layout):
            if isinstance(item, bytes) and not begun:
                yield item, None
                continue
            # Rows may lie behind one that is not complete.
            message = (
                item if isinstance(item, Message) else parsed(Opcode.MESSAGE, layout.first(item))
            )
            if message.channel_id not in layout.channels:
                other(self._message(message))
                continue
            times = message.log_time, message.publish_time
            row = begun + message_record(message.channel_id, times, message.data)
            if not layout.begins(row):
                yield begun, self._message(message)
                return
            begun = b'' if len(row) == layout.size else row
            if not begun:
                yield row, None
        if begun:
            yield begun, None

    def _data(self, layout: RowLayout) -> Iterator[bytes | Message]:
        """Reads the data section in the order of writing.

        Args:
            layout: Layout of rows.

        Yields:
            Whole rows, and other messages.

        Raises:
            LogError: The file is damaged.
        """
        # By channel: a file that was merged from others may have several of one topic.
        expected, found = self._summary.statistics.channel_message_counts, Counter[int]()
        with _damage_reported(self.path), open_file(self.path) as stream:
            file = McapFile(stream)
            for part in file.parts():
                data, at = part.data, 0
                while at < len(data):
                    if count := layout.count(data, at):
                        rows = data[at : at + count * layout.size]
                        file.allowance.take(count * len(layout.channels), len(rows))
                        found.update(dict.fromkeys(layout.channels, count))
                        yield rows
                        at += len(rows)
                        continue
                    record, at = file.next_record(data, at)
                    if isinstance(record, Channel):
                        self._check_channel(record)
                    elif isinstance(record, Message):
                        found[record.channel_id] += 1
                        if record.channel_id not in self._summary.channels:
                            raise LogError('it is damaged: a message is of an unknown channel')
                        yield record
            # A damaged opcode hides its record: no checksum covers it.
            if +found != +Counter(expected):
                raise LogError('it is damaged: its messages are not as many as its summary says')

    def _check_channel(self, channel: Channel) -> None:
        """Checks that the summary agrees with a channel.

        Raises:
            LogError: The summary has another channel of that number.
        """
        if self._summary.channels.get(channel.id) != channel:
            raise LogError('it is damaged: its channels are not those of its summary')

    def _message(self, message: Message) -> LoggedMessage:
        channel = self._summary.channels[message.channel_id]
        return LoggedMessage(channel.topic, message.log_time, message.data, message.publish_time)

    def close(self) -> None:
        """Closes the file."""
        self._stream.close()

    def __exit__(self, *error: object) -> None:
        self.close()


def _topic(channel: Channel, schemas: dict[int, Schema], statistics: Statistics) -> LoggedTopic:
    schema = schemas[channel.schema_id] if channel.schema_id else _NO_SCHEMA
    text = schema.data.decode(errors='replace')
    return LoggedTopic(
        channel.id,
        channel.topic,
        schema.name,
        statistics.channel_message_counts.get(channel.id, 0),
        'transient_local' in channel.metadata.get('offered_qos_profiles', ''),
        (channel.message_encoding, schema.encoding, text),
    )


@contextmanager
def _damage_reported(path: Path) -> Iterator[None]:
    """Turns any parser error into one line that names the file.

    Raises:
        LogError: The file is damaged, or not a log of this package.
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
            f'{path} is damaged or not complete: linkage_log recover saves what can be read of it '
            f'({cause})'
        ) from error
