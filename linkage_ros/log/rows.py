# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Rows: the MCAP records of all messages of one state.

The messages of a state are adjacent in a log, so that a state is written, found and compared as
one block of bytes.
"""

import re
import struct
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from linkage_ros.messages.fields import Field, Part, Template
from linkage_ros.messages.templates import RunTemplates, StateTemplates
from linkage_ros.messages.topics import Topic
from linkage_ros.numeric import Real
from linkage_ros.units import NS_PER_S

# Opcode and length of the record, channel, sequence number, log time and publish time.
MESSAGE_HEAD = struct.Struct('<BQHIQQ')
_HEAD_FIELDS = np.dtype({
    'names': ['opcode', 'channel', 'time'], 'formats': ['u1', '<u2', '<u8'],
    'offsets': [0, 9, 15], 'itemsize': MESSAGE_HEAD.size,
})  # fmt: skip
_OPCODE, _OPCODE_AND_LENGTH = 5, 9  # of a message; bytes
_CONSTANT = 15  # number of bytes in the head before the times
_TIMES = Field('log time', 'Q'), Field('publish time', 'Q')


def message_record(channel: int, times: tuple[int, int], data: bytes) -> bytes:
    """Encodes the CDR bytes of a message, with its log and publish time, ns, as an MCAP record."""
    size = MESSAGE_HEAD.size - _OPCODE_AND_LENGTH + len(data)
    return MESSAGE_HEAD.pack(_OPCODE, size, channel, 0, *times) + data


def message_heads(data: bytes, starts: Sequence[int]) -> npt.NDArray[Any]:
    """Reads the heads of records that start at some offsets.

    Returns:
        A structured array with the fields opcode, channel and time (log time, ns). If a record is
        not a message, only its opcode is meaningful.
    """
    padded = np.frombuffer(data + bytes(MESSAGE_HEAD.size), np.uint8)
    windows = np.lib.stride_tricks.sliding_window_view(padded, MESSAGE_HEAD.size)
    heads: npt.NDArray[Any] = windows[np.array(starts, np.int64)].view(_HEAD_FIELDS)[:, 0]
    return heads


class LoggedState(NamedTuple):
    """A state to be logged.

    Attributes:
        time: Log and publish time, ns.
        messages: CDR bytes of its messages; see `StateTemplates.pack`.
        linkages: Names of the linkages that it holds.
    """

    time: int
    messages: bytes
    linkages: tuple[str, ...] = ('',)


class RowLayout(Template):
    """The layout of a row, which contains the records of one state's messages.

    Attributes:
        channels: Channel number of each message.
        starts: Offset of each message's record.
        messages: Channel and offset of each message.
        times: Field with the log time of the first message.
        linkages: Names of the linkages that the state holds.
    """

    def __init__(
        self,
        templates: StateTemplates,
        channels: Iterable[tuple[int, Topic]],
        linkages: tuple[str, ...] = ('',),
    ) -> None:
        """Computes the offsets of the messages, each given by channel and topic, and of fields."""
        self.linkages = linkages
        parts, patterns = list[Part](), list[bytes]()
        self.channels, self._ends = list[int](), [0]
        for channel, topic in channels:
            size = Template(templates.parts[topic]).size
            self.channels.append(channel)
            self._ends.append(self._ends[-1] + MESSAGE_HEAD.size + size)
            constant_head = message_record(channel, (0, 0), bytes(size))[:_CONSTANT]
            parts += [constant_head, *_TIMES, *templates.parts[topic]]
            variable_size = MESSAGE_HEAD.size - _CONSTANT + size
            patterns.append(re.escape(constant_head) + b'.{%d}' % variable_size)
        super().__init__(parts, [*(field.name for field in _TIMES), *templates.names])
        self.starts, self.times = self._ends[:-1], self.places[0]
        self.messages = [*zip(self.channels, self.starts, strict=True)]
        self._whole_rows = re.compile(b'(?:%b)*' % b''.join(patterns), re.DOTALL)

    def rows(
        self, times: npt.ArrayLike, stamps: npt.ArrayLike, numbers: Sequence[Real]
    ) -> bytearray:
        """Encodes states.

        Args:
            times: Log and publish time of each state, ns.
            stamps: Stamp of each state, ns.
            numbers: Numbers in the messages, as arrays; see `Robot.row`.
        """
        logged, stamped = np.asarray(times), np.divmod(stamps, NS_PER_S)
        return self.fill(len(logged), (logged, logged, *stamped, *numbers))

    def rows_of(self, states: Sequence[LoggedState]) -> Iterator[memoryview]:
        """Yields the row of each state; all topics of the states must have channels."""
        count, size = len(states), self.size
        rows = bytearray(self._blank * count)
        bytes_of_rows = np.frombuffer(rows, np.uint8).reshape(count, size)
        bodies = np.frombuffer(b''.join([x.messages for x in states]), np.uint8)
        bodies = bodies.reshape(count, -1)
        time_of_each = np.array([[x.time] for x in states], np.uint64)
        body_start = 0  # of the next message in `bodies`
        for start, end in pairwise(self._ends):
            start_in_row = start + MESSAGE_HEAD.size
            body_end = body_start + end - start_in_row
            bytes_of_rows[:, start_in_row:end] = bodies[:, body_start:body_end]
            body_start = body_end
            # Log and publish time, which follow the constant part of the head.
            both_times = np.ndarray((count, 2), '<u8', rows, start + _CONSTANT, strides=(size, 8))
            both_times[:] = time_of_each
        view = memoryview(rows)
        return (view[at : at + size] for at in range(0, len(rows), size))

    def fitting(self, records: bytes | bytearray) -> int:
        """Returns the length of the leading messages that match the start of a row, in bytes."""
        rows = ((end, records[:end] + self._blank[end:]) for end in self._ends)
        return max(end for end, row in rows if self.count(row, 0))

    def count(self, data: bytes | bytearray, at: int) -> int:
        """Counts the complete adjacent rows in MCAP records from an offset on."""
        match = self._whole_rows.match(data, at)
        return (match.end() - at) // self.size if match else 0


class RowLayouts:
    """The layouts of the rows of a log, one for each set of linkages that a state may hold.

    Attributes:
        channels: Channel number of each topic of the states that the log has, by topic.
    """

    def __init__(self, templates: RunTemplates, channels: Mapping[Topic, int]) -> None:
        self._templates, self.channels = templates, channels
        self._made = dict[tuple[str, ...], RowLayout]()
        # The linkage of each channel that one linkage alone has; None for shared channels.
        self._owners = dict[int, str | None].fromkeys(channels.values())
        for name, topics in templates.owned.items():
            self._owners |= {channels[topic]: name for topic in topics if topic in channels}

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all linkages."""
        return self._templates.names

    def of(self, names: tuple[str, ...]) -> RowLayout:
        """Returns the layout of the rows that hold some linkages."""
        if names not in self._made:
            templates, channels = self._templates.of(names), self.channels
            logged_topics = [
                (channels[topic], topic) for topic in templates.topics if topic in channels
            ]
            self._made[names] = RowLayout(templates, logged_topics, names)
        return self._made[names]

    def at(self, data: bytes | bytearray, at: int) -> RowLayout | None:
        """Finds the layout of the row that begins at an offset, by the topics of linkages in it.

        Returns:
            The layout; None if no message of the row is of one linkage alone.
        """
        channels, owners = set[int](), set[str | None]()
        while at + MESSAGE_HEAD.size <= len(data):
            opcode, size, channel, *_ = MESSAGE_HEAD.unpack_from(data, at)
            # A state has one message on each of its channels.
            if opcode != _OPCODE or channel in channels or channel not in self._owners:
                break
            channels.add(channel)
            owners.add(self._owners[channel])
            at += _OPCODE_AND_LENGTH + size
        names = tuple(name for name in self.names if name in owners)
        return self.of(names) if names else None
