# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads and writes the records of an MCAP file with the mcap library."""

from contextlib import suppress
from io import BytesIO
from itertools import takewhile

from mcap.records import Channel, DataEnd, Header, Message, MessageIndex, Metadata, Schema
from mcap.stream_reader import StreamReader
from mcap.writer import Writer

from linkage_ros.log.records import END_RECORD


def records_of(log):
    """Returns the records up to the end of the data, header first; `log` is a path or bytes."""
    data = log if isinstance(log, bytes) else log.read_bytes()
    records = StreamReader(BytesIO(data)).records
    return list(takewhile(lambda record: not isinstance(record, DataEnd), records))


def packed_records(records, **options):
    """Writes records to bytes, in their original chunks, with valid checksums."""
    stream, schemas = BytesIO(), {0: 0}
    writer = Writer(stream, **options)
    for item in records:
        if isinstance(item, Header):
            writer.start(item.profile, item.library)
        elif isinstance(item, Schema):
            schemas[item.id] = writer.register_schema(item.name, item.encoding, item.data)
        elif isinstance(item, Channel):
            schema = schemas.get(item.schema_id, item.schema_id)
            writer.register_channel(item.topic, item.message_encoding, schema, item.metadata)
        elif isinstance(item, Message):
            with suppress(KeyError):  # of an unknown channel, which mcap refuses to write
                writer.add_message(item.channel_id, item.log_time, item.data, item.publish_time)
        elif isinstance(item, MessageIndex) or item.name == END_RECORD:
            writer.flush()
        if isinstance(item, Metadata):
            writer.add_metadata(item.name, item.metadata)
    writer.finish()
    return stream.getvalue()


def write_records(path, records, **options):
    """Writes records to a file; returns its path."""
    path.write_bytes(packed_records(records, **options))
    return path
