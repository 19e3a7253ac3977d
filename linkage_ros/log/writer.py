# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Writes MCAP logs: bags that ROS tools can open and that contain all data for verification."""

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, suppress
from itertools import groupby
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from mcap.records import Channel, Metadata, Schema

from linkage_ros.errors import LinkageError, LogError
from linkage_ros.log.disk import LogFile
from linkage_ros.log.mcap_writer import CHUNK_SIZE, McapWriter
from linkage_ros.log.records import (
    CONFIGURATION_RECORD,
    END_RECORD,
    EVENT_RECORDS,
    MOTION_RECORD,
    ROLE,
    Event,
    LoggedSegment,
    encode_configuration,
    encode_event,
    encode_motion,
    seal,
)
from linkage_ros.log.rows import LoggedState, RowLayout, RowLayouts, message_record
from linkage_ros.messages.templates import RunTemplates
from linkage_ros.messages.topics import Topic
from linkage_ros.motion.segments import Segment
from linkage_ros.numeric import Real
from linkage_ros.settings.configuration import Configuration

_FOREVER = '{sec: 9223372036, nsec: 854775807}'


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


# Adjacent message records, their log time, ns, and the channel and offset of each.
_Records: TypeAlias = tuple[bytes | memoryview, int, Sequence[tuple[int, int]]]


class LogWriter(AbstractContextManager['LogWriter']):
    """Writes a log; not thread-safe.

    Attributes:
        file: The log file.
        mcap: Writer of the file's records.
        has_end: Whether to write an end record, which shows that the log includes the end of the
            run.
    """

    def __init__(
        self, path: Path | str, configuration: Configuration | None, *, overwrite: bool
    ) -> None:
        """Creates the file and writes the configuration of the run.

        To a recovered log, the caller adds the configuration later, and sets `has_end` if the
        source has an end.

        Raises:
            LogError: The file cannot be created or written.
        """
        self.file = LogFile(path, overwrite=overwrite)
        self.mcap = McapWriter(self.file, 'ros2', 'linkage_ros')
        self.has_end = configuration is not None
        if configuration is not None:
            self._add(CONFIGURATION_RECORD, encode_configuration(configuration))
            try:
                self.flush()
            except LogError:
                self.file.remove()  # it would refuse the next attempt
                raise
            self.file.advice = '; linkage_log recover saves its contents'

    def _add(self, name: str, fields: dict[str, str]) -> None:
        self.mcap.add_metadata(Metadata(name, fields))

    def add_topic(self, topic: Topic, name: str) -> int:
        """Declares a channel for a topic of a fully qualified name; returns its number."""
        interface, mcap = topic.interface, self.mcap
        schemas = {schema.name: number for number, schema in mcap.schemas.items()}
        schema = schemas.get(interface.name, len(schemas) + 1)
        text = interface.definition.encode()
        mcap.declare(Schema(id=schema, data=text, encoding='ros2msg', name=interface.name))
        metadata = {
            'offered_qos_profiles': _qos(topic), 'topic_type_hash': interface.hash,
            ROLE: topic.role,
        }  # fmt: skip
        channel = len(mcap.channels) + 1
        mcap.declare(
            Channel(
                id=channel, topic=name, message_encoding='cdr', metadata=metadata, schema_id=schema
            )
        )
        return channel

    def add_states(
        self, templates: RunTemplates, name_of: Callable[[Topic], str]
    ) -> dict[str, int]:
        """Declares the channels of states; `name_of` returns a topic's fully qualified name.

        Returns:
            The channel number of each topic, by `Topic.name`.
        """
        channels = {topic: self.add_topic(topic, name_of(topic)) for topic in templates.topics}
        self._layouts = RowLayouts(templates, channels)
        return {topic.name: number for topic, number in channels.items()}

    def write(self, channel: int, stamp: int, data: bytes) -> None:
        """Appends a message.

        Args:
            channel: Channel number returned by `add_topic`.
            stamp: Log and publish time, ns.
            data: CDR bytes of the message.

        Raises:
            LogError: The file cannot be written.
        """
        self.write_messages([(channel, stamp, data)])

    def write_messages(self, messages: Iterable[tuple[int, int, bytes]]) -> None:
        """Appends messages, given as the arguments of `write`, much faster than one at a time.

        Raises:
            LogError: The file cannot be written.
        """
        self._write_records(
            (message_record(channel, (stamp, stamp), data), stamp, ((channel, 0),))
            for channel, stamp, data in messages
        )

    def _write_records(self, records: Iterable[_Records]) -> None:
        """Appends message records; see `_Records`."""
        data, times, entries = list[Any](), list[int](), defaultdict[int, list[Any]](list)
        end = self.mcap.position
        for record, time, places in records:
            data.append(record)
            times.append(time)
            for channel, start in places:
                entries[channel].append((time, end + start))
            end += len(record)
            if end > CHUNK_SIZE:
                self._add_records(data, times, entries)
                data, times, entries = [], [], defaultdict(list)
                end = self.mcap.position
        if data:
            self._add_records(data, times, entries)

    def _add_records(
        self, data: Iterable[Any], times: Sequence[int], entries: Mapping[int, Sequence[Any]]
    ) -> None:
        """Appends records to the chunk, given log time, ns, and offset of each, by channel."""
        index = {channel: np.array(rows, np.uint64) for channel, rows in entries.items()}
        self.mcap.add_records(b''.join(data), np.array(times, np.uint64), index)

    def write_states(
        self,
        times: Sequence[int],
        stamps: Sequence[int],
        numbers: Sequence[Real],
        linkages: tuple[str, ...] = ('',),
    ) -> None:
        """Appends the messages of states; chunks end with a complete state.

        Args:
            times: Log and publish time of each state, ns.
            stamps: Stamp of each state, ns.
            numbers: Numbers in the messages, see `Robot.row`, as arrays.
            linkages: Names of the linkages that the states hold.

        Raises:
            LogError: The file cannot be written.
        """
        layout = self._layouts.of(linkages)
        self._add_rows(layout, times, layout.rows(times, stamps, numbers))

    def _add_rows(self, layout: RowLayout, times: Sequence[int], rows: bytearray) -> None:
        """Appends the messages of states, a row for each state; see `write_states`."""
        remaining_times = np.asarray(times, np.uint64)
        while rows:
            start = self.mcap.position
            count = max(0, CHUNK_SIZE - start) // layout.size + 1  # the last one fills the chunk
            data, rows = rows[: count * layout.size], rows[count * layout.size :]
            logged, remaining_times = remaining_times[:count], remaining_times[count:]
            row_offsets = np.arange(start, start + len(data), layout.size)
            # Log time and offset of each message, by channel and row.
            index = np.empty((len(layout.channels), len(logged), 2), np.uint64)
            index[:, :, 0] = logged
            index[:, :, 1] = np.add.outer(layout.starts, row_offsets)
            self.mcap.add_records(data, logged, dict(zip(layout.channels, index, strict=True)))

    def write_motion(self, segment: Segment, linkage: str = '') -> None:
        """Appends a segment of the motion of a linkage."""
        self._add(MOTION_RECORD, encode_motion(segment, linkage))

    def write_event(self, event: Event) -> None:
        """Records an event: the end of a motion or torque, or, after `flush`, a gap."""
        self._add(EVENT_RECORDS[type(event)], encode_event(event))

    def consume(self, items: Sequence[Any]) -> None:
        """Appends items and flushes them; see `Worker`.

        If this fails, the log ends without an end record and a summary, so that `linkage_log`
        asks for `recover`.

        Args:
            items: States, tuples of arguments for `write`, segments of motion of linkages, or
                events.
        """
        try:
            self._append(items)
            self.flush()
        except Exception:
            self.file.close()
            raise

    def _append(self, items: Sequence[Any]) -> None:
        """Writes items, each as its kind requires."""
        # Write adjacent states and messages together, which is much faster.
        for are_messages, group in groupby(items, lambda x: type(x) in {LoggedState, tuple}):
            if are_messages:
                self._write_records(self._records_of([*group]))
                continue
            for item in group:
                if type(item) is LoggedSegment:
                    self.write_motion(item.segment, item.linkage)
                else:
                    self.write_event(item)

    def _records_of(self, items: Sequence[Any]) -> Iterator[_Records]:
        """Yields the records of states and of arguments for `write`, in their order."""
        states = defaultdict[tuple[str, ...], list[LoggedState]](list)
        for item in items:
            if type(item) is LoggedState:
                states[item.linkages].append(item)
        layouts = {linkages: self._layouts.of(linkages) for linkages in states}
        rows = {linkages: layouts[linkages].rows_of(found) for linkages, found in states.items()}
        for item in items:
            if type(item) is LoggedState:
                yield next(rows[item.linkages]), item.time, layouts[item.linkages].messages
            else:
                channel, stamp, data = item
                yield message_record(channel, (stamp, stamp), data), stamp, ((channel, 0),)

    def flush(self) -> None:
        """Passes all messages to the operating system, so that they survive if the run is killed.

        Raises:
            LogError: The file cannot be written, or was removed or truncated.
        """
        self.mcap.flush()

    def close(self) -> None:
        """Writes the end record and the summary, and closes the file.

        Raises:
            LogError: The file cannot be written, or was removed or truncated.
        """
        if self.file.stream.closed:
            return
        self.flush()  # otherwise the last chunk would follow the end record
        if self.has_end:
            self._add(END_RECORD, seal({'messages': str(self.mcap.statistics.message_count)}))
        self.mcap.finish()
        self.file.close()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, _: object
    ) -> None:
        """Closes the log; after an unexpected error, omits the end record and the summary."""
        if error is None or isinstance(error, LinkageError):
            self.close()
            return
        if not self.file.stream.closed:
            with suppress(Exception):  # the cause may prevent it
                self.flush()
        self.file.close()
