# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Copies the intact records of a damaged log into a complete log."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress

import numpy as np
from mcap.records import Attachment, Channel, McapRecord, Message, Metadata, Schema
from mcap.writer import Writer

from linkage_ros.errors import ConfigurationError, LogError
from linkage_ros.log.chunks import Chunks
from linkage_ros.log.mcap_file import McapFile, Part, Summary
from linkage_ros.log.metadata import (
    CONFIGURATION_RECORD,
    END_RECORD,
    MOTION_RECORD,
    decode_configuration,
    decode_end,
    decode_motion,
)
from linkage_ros.recovery.damaged_mcap import Losses
from linkage_ros.wire.rows import message_record

# No chunk of ours is as large: the chunks stay as they were.
CHUNK_SIZE = 1 << 23
_MOST_CHANNELS = 2**16 - 1  # their numbers have 16 bits, and the writer begins with 1
_DECODERS: dict[str, Callable[[Mapping[str, str]], object]] = {
    CONFIGURATION_RECORD: decode_configuration,
    MOTION_RECORD: decode_motion,
    END_RECORD: decode_end,
}


def _is_undamaged(record: Metadata) -> bool:
    """Returns whether a record of this package is intact; other records have no checksum."""
    try:
        if record.name in _DECODERS:
            _DECODERS[record.name](record.metadata)
    except ConfigurationError:
        return True  # written by another version: undamaged, though this one cannot use it
    except LogError:
        return False
    return True


class RecordCopy:
    """Writes records to a new file, with new numbers of schemas and channels.

    Attributes:
        chunks: Chunks of the new file.
        is_configured: Whether the new file has a configuration.
    """

    def __init__(self, writer: Writer, file: McapFile, losses: Losses, spare: Summary) -> None:
        """Begins without a record.

        Args:
            writer: Writer of the new file.
            file: The broken log.
            losses: Counts what cannot be copied.
            spare: Summary at the end of the file, for messages whose first chunk is lost.
        """
        self.chunks, self.is_configured = Chunks(writer, CHUNK_SIZE), False
        self._writer, self._file, self._losses, self._spare = writer, file, losses, spare
        self._waiting = bytearray()
        # Of each channel the log times, ns, and the places of the messages that wait.
        self._index: defaultdict[int, list[tuple[int, int]]] = defaultdict(list)
        self._schemas: dict[int, int] = {0: 0}
        self._channels: dict[int, int] = {}

    def add(self, part: Part) -> None:
        """Writes the contents of a part, unless they are damaged or already written."""
        if isinstance(part.record, Metadata):
            self._add_metadata(part.record)
        elif isinstance(part.record, Attachment):
            self._writer.add_attachment(**vars(part.record))
        else:
            for record in [part.record] if part.record else _records(self._file, part.data):
                self._add(record)
            self._write_messages()

    def _add(self, record: McapRecord) -> None:
        if isinstance(record, Message):
            self._add_message(record)
            return
        self._write_messages()
        if isinstance(record, Schema):
            self._spare.schemas[record.id] = record
            self._schema(record.id)
        elif isinstance(record, Channel):
            self._channel(record)

    def _schema(self, number: int) -> int | None:
        if number not in self._schemas and number in self._spare.schemas:
            source = self._spare.schemas[number]
            self._schemas[number] = self._writer.register_schema(
                source.name, source.encoding, source.data
            )
        return self._schemas.get(number)

    def _channel(self, channel: Channel) -> None:
        schema = self._schema(channel.schema_id)
        is_new = channel.id not in self._channels and len(self._channels) < _MOST_CHANNELS
        if is_new and schema is not None:
            self._channels[channel.id] = self._writer.register_channel(
                channel.topic, channel.message_encoding, schema, channel.metadata
            )

    def _add_message(self, message: Message) -> None:
        if message.channel_id not in self._channels and message.channel_id in self._spare.channels:
            self._channel(self._spare.channels[message.channel_id])
        channel = self._channels.get(message.channel_id)
        if channel is None:
            self._losses.messages += 1
            return
        self._index[channel].append((message.log_time, len(self._waiting)))
        times = message.log_time, message.publish_time
        self._waiting += message_record(channel, times, message.data, message.sequence)

    def _write_messages(self) -> None:
        """Writes the collected messages in one batch, which is far faster."""
        columns = {n: np.array(entries, np.uint64).T for n, entries in self._index.items()}
        self.chunks.add_records(self._waiting, {n: (t, p) for n, (t, p) in columns.items()})
        self._waiting.clear()
        self._index.clear()

    def _add_metadata(self, record: Metadata) -> None:
        is_configuration = record.name == CONFIGURATION_RECORD
        if is_configuration and self.is_configured:
            return  # a log has one, at its beginning
        if record.name == END_RECORD and self._losses != Losses():
            return  # the log that is saved is not the one that was ended
        if _is_undamaged(record):
            self.is_configured |= is_configuration
            self._writer.add_metadata(record.name, record.metadata)
        else:
            self._losses.records += 1


def _records(file: McapFile, data: bytes) -> Iterator[McapRecord]:
    """The complete records at the beginning of a part."""
    at = 0
    with suppress(Exception):  # nothing bounds what damage makes a parser raise
        while at < len(data):
            record, at = file.next_record(data, at)
            yield record
