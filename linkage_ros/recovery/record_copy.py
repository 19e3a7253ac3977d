# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Copies what was read of a broken log, record by record, into a complete one."""

from __future__ import annotations

import numpy as np
from mcap.records import Attachment, Channel, Header, McapRecord, Message, Metadata, Schema
from mcap.writer import Writer

from linkage_ros.errors import ConfigurationError, LogError
from linkage_ros.log.chunks import Chunks
from linkage_ros.log.metadata import (
    CONFIGURATION_RECORD,
    END_RECORD,
    MOTION_RECORD,
    decode_configuration,
    decode_end,
    decode_motion,
)
from linkage_ros.log.untrusted_chunks import LARGEST
from linkage_ros.log.untrusted_mcap import Summary
from linkage_ros.recovery.damaged_mcap import Losses
from linkage_ros.wire.rows import message_record

# No chunk of ours is as large: the chunks stay as they were.
CHUNK_SIZE = 1 << 23
_MOST_CHANNELS = 2**16 - 1  # their numbers have 16 bits, and the writer begins with 1


def is_undamaged(record: Metadata) -> bool:
    """Whether a record of ours is undamaged; those of others have nothing to tell by."""
    try:
        if record.name == CONFIGURATION_RECORD:
            decode_configuration(record.metadata)
        elif record.name == MOTION_RECORD:
            decode_motion(record.metadata)
        elif record.name == END_RECORD:
            decode_end(record.metadata)
    except ConfigurationError:
        return True  # written by another version: undamaged, though this one cannot use it
    except LogError:
        return False
    return True


class RecordCopy:
    """Writes records to a new file; its own numbers stand for schemas and channels there.

    Attributes:
        chunks: Of the new file.
    """

    def __init__(self, writer: Writer, losses: Losses, spare: Summary | None) -> None:
        """Begins without a record.

        Args:
            writer: Writer of the new file.
            losses: Is told what cannot be copied.
            spare: What a complete file repeats at its end, for messages whose first chunk is lost.
        """
        self.chunks = Chunks(writer, CHUNK_SIZE)
        self._waiting = bytearray()
        # Of each channel the log times, ns, and the places of the messages that wait.
        self._index: dict[int, tuple[list[int], list[int]]] = {}
        self._writer, self._losses = writer, losses
        self._spare = spare.channels if spare else {}
        self._sources = spare.schemas if spare else {}
        self._schemas: dict[int, int] = {0: 0}
        self._channels: dict[int, int] = {}
        self._begun = self._is_configured = False

    def add(self, record: McapRecord) -> None:
        """Writes a record, unless it is damaged or there already."""
        if not self._begun:
            header = record if isinstance(record, Header) else Header('ros2', 'linkage_ros')
            self._writer.start(header.profile, header.library)
            self._begun = True
        if isinstance(record, Message):
            self._add_message(record)
            return
        self.write_messages()
        if isinstance(record, Schema):
            self._sources[record.id] = record
            self._schema(record.id)
        elif isinstance(record, Channel):
            self._channel(record)
        elif isinstance(record, Metadata):
            self._add_metadata(record)
        elif isinstance(record, Attachment):
            self._writer.add_attachment(
                record.create_time, record.log_time, record.name, record.media_type, record.data
            )

    def _schema(self, number: int) -> int | None:
        if number not in self._schemas and number in self._sources:
            source = self._sources[number]
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
        if message.channel_id not in self._channels and message.channel_id in self._spare:
            self._channel(self._spare[message.channel_id])
        channel = self._channels.get(message.channel_id)
        if channel is None:
            self._losses.messages += 1
            return
        log_times, places = self._index.setdefault(channel, ([], []))
        log_times.append(message.log_time)
        places.append(len(self._waiting))
        times = message.log_time, message.publish_time
        self._waiting += message_record(channel, times, message.data, message.sequence)
        if len(self._waiting) > LARGEST:
            self.write_messages()

    def write_messages(self) -> None:
        """Writes the messages that wait for others: one by one takes far longer."""
        index = {
            channel: (np.array(log_times, np.uint64), np.array(places))
            for channel, (log_times, places) in self._index.items()
        }
        self.chunks.add_records(self._waiting, index)
        self._waiting.clear()
        self._index.clear()

    def _add_metadata(self, record: Metadata) -> None:
        is_configuration = record.name == CONFIGURATION_RECORD
        if is_configuration and self._is_configured:
            return  # a log has one, at its beginning
        if record.name == END_RECORD and self._losses != Losses():
            return  # the log that is saved is not the one that was ended
        if is_undamaged(record):
            self._is_configured |= is_configuration
            self._writer.add_metadata(record.name, record.metadata)
        else:
            self._losses.records += 1
