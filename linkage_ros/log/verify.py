# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Recomputes every state of a log from its configuration and its segments of motion.

Messages are considered equal if their bytes are equal, or if each number differs by at most 4 ulp,
because sines differ between machines. The ulp is that of the largest number of the field in the
log or, if larger, the change of the number under noise of one part in 2^54 in every operation: the
terms of the number may cancel, or depend strongly on the angle. 0.0 and -0.0 are equal within 1
ulp. In robot_description, only positions depend on sines: they may differ by 4 ulp of the largest
coordinate. The log times of a live run cannot be recomputed, so only their equality within a state
is checked. Topics are identified by their roles, because they may be remapped. Other topics of the
log are listed but not compared.
"""

import functools
import itertools
import math
import re
import struct
from bisect import bisect_right
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import Any

import numpy as np
import numpy.typing as npt

from linkage_ros.errors import LinkageError, LogError
from linkage_ros.log.expected_states import (
    MeasuredStates,
    Rows,
    Segments,
    TickStates,
    check_motions,
)
from linkage_ros.log.logged_forces import LoggedForces
from linkage_ros.log.reader import LoggedMessage, LogReader
from linkage_ros.log.rows import MESSAGE_HEAD, RowLayout, RowLayouts
from linkage_ros.log.torque_states import TorqueStates
from linkage_ros.log.torque_zeros import TorqueZeros
from linkage_ros.mechanism.elementwise import noise
from linkage_ros.messages.cdr import ENCAPSULATION, encode_string
from linkage_ros.messages.topics import (
    DIAGNOSTICS,
    TRAJECTORY_COMMANDS,
    prefix_of,
)
from linkage_ros.messages.urdf import text_of
from linkage_ros.numeric import Array
from linkage_ros.run.robot import Robot
from linkage_ros.run.states import RowPart

_BATCH = 1024  # states per batch
# ulp. On another machine, sines and all results may differ in the last bits.
_TOLERANCE = 4
# Relative noise in every operation that gives the unit of a difference, noise that is large enough
# to show in a number despite its rounding error, and the number of samples.
_LAST_BIT, _NOISE, _SAMPLES = 2.0**-54, 2.0**-40, 4
# A position in the URDF.
_NUMBER = r'(-?\d+(?:\.\d+)?(?:e[+-]\d+)?)'
_POSITION = re.compile(f'xyz="{_NUMBER} {_NUMBER} {_NUMBER}"')


def verify(log: LogReader, progress: Callable[[int], object] = lambda _: None) -> 'Verification':
    """Recomputes and compares the messages of a log, up to the first difference.

    Args:
        log: The log to verify.
        progress: Called with the number of states compared since the last call.

    Returns:
        The completed comparison.

    Raises:
        LogError: The file is damaged, lacks the topics or segments required to recompute it, or
            has names of parameters before version 2.0.
    """
    if log.has_old_names:
        raise LogError(
            f'{log.path} cannot be verified: its parameters have names before version 2.0; verify '
            f'it with the version that wrote it, {log.version}'
        )
    done = Verification(log)
    done.run(progress)
    if log.lost and not done.difference:
        kind = 'missing' if log.lost > 0 else 'too many'
        done.difference = f'logged messages {kind}: {abs(log.lost)}, according to the end record'
    return done


class Verification:
    """Compares the messages of a log with recomputed messages, up to the first difference.

    Attributes:
        states: Number of equal states.
        compared: Names of the compared topics.
        others: Names of the topics that cannot be recomputed.
        absent: Relative names of the topics of states that are missing from the log.
        missed: Number of ticks without a state.
        stops_at_gap: Whether the states after missing messages were not compared, because they
            depend on the missing measurements or forces.
        cut: Names of the topics that are missing from an incomplete last state.
        ulp: Largest difference, ulp; 0 if all bits are equal.
        difference: Description of the first difference; empty if there is none.
    """

    def __init__(self, log: LogReader) -> None:
        """Compares the topics and segments of the log with those of a run."""
        self._log, self._rows = log, bytearray()
        self._robot = robot = Robot(log.configuration)
        self.states, self.missed, self.ulp = 0, 0, 0.0
        self.cut: tuple[str, ...] = ()
        self.stops_at_gap = False
        descriptions = robot.descriptions()
        # The channel of each topic that can be recomputed and is in the log.
        recomputed = *robot.templates.topics, *descriptions
        channels = {topic: channel for topic in recomputed if (channel := log.channel(topic))}
        self.absent = tuple(x.name for x in robot.templates.topics if x not in channels)
        self.compared = tuple(channel.name for channel in channels.values())
        self.others = tuple(c.name for c in log.topics if c not in channels.values())
        # The robot_description expected on a channel.
        self._descriptions = {
            channels[topic].number: text
            for topic, text in descriptions.items()
            if topic in channels
        }
        self._channels = {
            topic: channel for topic, channel in channels.items() if topic not in descriptions
        }
        self.difference = self._wrong_channel() or self._wrong_motion()

    def _wrong_motion(self) -> str:
        """Describes the first difference in the segments of motion."""
        for name, simulator in self._robot.simulators.items():
            difference = check_motions(simulator, self._log.motions[name])
            if difference:
                return f'{prefix_of(name, ": ")}{difference}'
        return ''

    def _wrong_channel(self) -> str:
        """Describes the last channel whose topic or schema a run would not have."""
        robot = self._robot
        forces = itertools.chain.from_iterable(robot.live_forces().values())
        topics = (
            *robot.templates.topics,
            *robot.descriptions(),
            DIAGNOSTICS,
            TRAJECTORY_COMMANDS,
            *robot.inputs(),
            *forces,
        )
        interfaces = {topic.role: topic.interface for topic in topics}
        wrong = ''
        for channel in self._log.topics:
            due = interfaces.get(channel.role)
            layout = due and (due.name, 'cdr', 'ros2msg', due.definition)
            if channel.role and layout != (channel.type, *channel.layout):
                wrong = f'{channel.name}: no run of this configuration has such a topic or schema'
        return wrong

    def _prepare(self) -> None:
        """Prepares the comparison of states.

        Raises:
            LogError: The log lacks the topics or segments required to recompute its states.
        """
        log, robot = self._log, self._robot
        drive = log.configuration.drive_kind
        kind: type[TickStates] | type[MeasuredStates] = TickStates
        if drive.is_measured:
            kind = MeasuredStates
        elif drive.is_integrated:
            kind = TorqueStates
        needed = {topic.interface for topic in kind.needed}
        has_needed = any(topic.interface in needed for topic in self._channels)
        has_motions = all(log.motions.values())
        if not has_needed or (kind.needs_motion and not has_motions):
            raise LogError(
                f'{log.path} cannot be verified: it has no motion record, or no '
                f'{" or ".join(topic.name for topic in kind.needed)}'
            )
        numbers = {topic: channel.number for topic, channel in self._channels.items()}
        self._layouts = RowLayouts(robot.templates, numbers)
        self._layout = self._layouts.of(robot.names)
        self._names = {channel.number: channel.name for channel in self._channels.values()}
        self._comparisons = dict[tuple[str, ...], RowComparison]()
        self._forces, self._zeros = LoggedForces(robot, log), TorqueZeros(robot, log)
        self._expected = kind(robot, log)
        self._gone = set[str]()  # linkages whose motions have ended

    def run(self, progress: Callable[[int], object]) -> None:
        """Compares the messages, up to the first difference; see `verify`.

        Raises:
            LogError: The file is damaged, or lacks the topics or segments required to recompute
                it.
        """
        if self.difference or not any(c.messages for c in self._channels.values()):
            return
        self._prepare()
        self._compare_log(progress)
        self._compare_last(progress)
        if not (self.difference or self.stops_at_gap or self._log.lost):
            self.difference = self._zeros.missing()
        self.missed = self._expected.missed
        self.ulp = max([self.ulp, *(one.ulp for one in self._comparisons.values())])

    def _compare_log(self, progress: Callable[[int], object]) -> None:
        """Compares the rows of the log in batches, up to a difference or an incomplete state."""
        for layout, records in self._log.rows(
            self._layouts,
            lambda message: self._handle(message, progress),
            lambda: self._cross_gap(progress),
        ):
            if self.difference or self.stops_at_gap:
                return
            if layout is not self._layout:
                self._compare_rows(progress)
                if self.difference or self._rows:  # the previous state is incomplete
                    return
                self._layout = layout
            self._rows += records
            if len(self._rows) >= _BATCH * layout.size:
                self._compare_rows(progress)
                if self.difference or len(self._rows) >= layout.size:
                    return

    def _cross_gap(self, progress: Callable[[int], object]) -> None:
        """Compares the states before missing messages, and prepares for those after them."""
        self._compare_last(progress)
        self._rows.clear()
        self.cut = ()
        self.stops_at_gap = self._forces.is_live or not self._expected.cross_gap()

    def _handle(self, message: LoggedMessage, progress: Callable[[int], object]) -> None:
        """Handles a message that is not part of a state; called in the order of writing."""
        self._expected.handle(message)
        if end := self._zeros.end_at(message):
            self._compare_rows(progress)  # before the efforts change
            self._expected.end_efforts(end)
            self.difference = self.difference or self._zeros.check(message)
        if self._forces.is_live:
            self._forces.handle(message, self.states + self._layout.count(self._rows, 0))
        due = self._descriptions.get(message.channel)
        if due:
            ulp = _description_ulp(message.data, due)
            self.ulp = max(self.ulp, ulp)
            if ulp > _TOLERANCE:
                self.difference = (
                    f'{message.topic}: data at {message.time} ns is not the URDF of the '
                    'configuration'
                )

    def _compare_rows(self, progress: Callable[[int], object]) -> None:
        """Compares all complete rows read so far."""
        layout = self._layout
        rows = bytes(self._rows[: layout.count(self._rows, 0) * layout.size])
        del self._rows[: len(rows)]
        while rows and not self.difference:
            count, self.difference = self._compare(rows)
            rows = rows[count * layout.size :]
            self.states += count
            progress(count)

    def _compare_last(self, progress: Callable[[int], object]) -> None:
        """Compares the last rows, after which there may be the beginning of a state."""
        self._compare_rows(progress)
        if not self._rows or self.difference:
            return
        layout, end = self._layout, self._layout.fitting(self._rows)
        if end < len(self._rows):
            _, _, channel, _, time, _ = MESSAGE_HEAD.unpack_from(self._rows, end)
            self.difference = (
                f'{self._names[channel]}: the message logged at {time} ns '
                f'is not the next message of state {self.states + 1}'
            )
        else:
            starts = zip(layout.starts, layout.channels, strict=True)
            self.cut = tuple(self._names[channel] for start, channel in starts if start >= end)

    def _compare(self, rows: bytes) -> tuple[int, str]:
        """Compares the leading rows that belong to one segment.

        Returns:
            The number of equal states, and a description of the error in the next state. The
            description is empty if the next state was not compared.
        """
        stamps = self._layout.stamps(rows)
        count, problem = 0, self._wrong_linkages(int(stamps[0]))
        if not problem:
            count, problem = self._compare_in_segments(rows, stamps)
        if problem:
            problem = f'state {self.states + count + 1}, stamp {stamps[count]} ns: {problem}'
        return count, problem

    def _compare_in_segments(self, rows: bytes, stamps: npt.NDArray[np.int64]) -> tuple[int, str]:
        """Compares rows with the states of each segment that they fit; see `_compare`."""
        layout = self._layout
        first_problem = ''
        for segments, ticks in self._expected.fitting(layout.linkages, stamps):
            logged = rows[: len(ticks) * layout.size]
            recompute = functools.partial(
                self._recompute, segments, stamps[: len(ticks)].tolist(), Rows(layout, logged)
            )
            try:
                parts, recomputed = recompute()
            except LinkageError as error:
                if len(ticks) > 1:  # bisect to find the first invalid state
                    half = len(ticks) // 2
                    return self._compare_in_segments(rows[: half * layout.size], stamps[:half])
                first_problem = first_problem or str(error)
                continue
            count, difference = self._comparison.compare(logged, recomputed, recompute)
            if count:
                count, problem = self._expected.take(segments, ticks[:count], parts)
                self._zeros.take(layout, rows[: count * layout.size])
                return count, problem
            first_problem = first_problem or difference
        return 0, first_problem or (
            'no tick or measurement that can come next has this stamp; earlier states may be '
            'lost, because a record has one at every tick'
        )

    def _wrong_linkages(self, stamp: int) -> str:
        """Describes a linkage that the states lack from a stamp on, or hold, without a reason."""
        if not self._expected.needs_motion:
            return ''  # measurements are the reason
        present, ended = {*self._layout.linkages}, {*self._log.linkage_ends}
        for name in self._robot.names:
            if name in present:
                if name in self._gone:
                    return f'{name} reappears after its motion ended'
            elif name not in ended:
                return f'{name} is missing, but no record says that its motion ended'
            elif name not in self._gone and not self._expected.has_ended(name, stamp):
                return f'{name} is missing, but its motion continues'
        self._gone |= {*self._robot.names} - present
        return ''

    @property
    def _comparison(self) -> 'RowComparison':
        """The comparison of rows with the current layout."""
        names = self._layout.linkages
        if names not in self._comparisons:
            self._comparisons[names] = RowComparison(
                self._log, self._layouts, self._layout, self._names
            )
        return self._comparisons[names]

    def _recompute(
        self, segments: Segments, stamps: list[int], rows: Rows
    ) -> tuple[dict[str, RowPart], bytearray]:
        """Recomputes logged rows.

        Args:
            segments: Index of the segment of each linkage, by its name.
            stamps: Stamps of the rows, ns.
            rows: The logged rows, and their layout.

        Returns:
            The part of each linkage, by its name, and the rows.

        Raises:
            LinkageError: A logged row does not describe a valid state.
        """
        expected, layout = self._expected, rows.layout
        forces = self._forces.at(self.states, expected.elapsed(segments, stamps))
        parts = {
            name: self._robot.simulators[name].part(
                *expected.coordinates(name, segment, stamps, rows, forces[name])
            )
            for name, segment in segments.items()
        }
        # The log times of a live run cannot be recomputed; those of a record are the stamps.
        times = stamps if expected.is_record else layout.column(rows.data, layout.times)
        columns = self._robot.row(parts, expected.efforts_of_others())
        return parts, layout.rows(times, stamps, columns)


def _description_ulp(logged: bytes, due: bytes) -> float:
    """Returns the largest difference of positions in two robot descriptions, CDR bytes.

    It is in ulp of the largest coordinate of a position; inf if the rest differs. The logged one
    may be arbitrary.
    """
    if logged == due:
        return 0.0
    start = len(ENCAPSULATION) + 4  # after the length of the text
    text, urdf = (data[start:].rstrip(b'\0').decode(errors='replace') for data in (logged, due))
    if encode_string(text) != logged or _POSITION.sub('', text) != _POSITION.sub('', urdf):
        return math.inf
    positions = zip(_POSITION.findall(text), _POSITION.findall(urdf), strict=True)
    return max((_position_ulp(words, due_words) for words, due_words in positions), default=0.0)


def _position_ulp(words: Sequence[str], due_words: Sequence[str]) -> float:
    """Returns the difference of two positions in URDF, ulp; inf if one is oddly written."""
    if words == due_words:
        return 0.0
    numbers, due = [float(word) for word in words], [float(word) for word in due_words]
    if text_of(*numbers) != ' '.join(words):
        return math.inf
    difference = max(abs(x - y) for x, y in zip(numbers, due, strict=True))
    return difference / math.ulp(max(map(abs, due)))


class RowComparison:
    """Compares the rows of a log with recomputed rows.

    Attributes:
        ulp: Largest accepted difference so far, ulp.
    """

    def __init__(
        self, log: LogReader, layouts: RowLayouts, layout: RowLayout, names: Mapping[int, str]
    ) -> None:
        """Initializes without rows; `layout` is that of those to compare, of all `layouts`."""
        self._log, self._layouts, self.ulp, self._layout = log, layouts, 0.0, layout
        self._names = [names[channel] for channel in layout.channels]
        self._doubles = [place for place in layout.places if place.code == 'd']

    def compare(
        self, logged: bytes, recomputed: bytearray, again: Callable[[], tuple[Any, bytearray]]
    ) -> tuple[int, str]:
        """Compares rows.

        Args:
            logged: One or more logged rows.
            recomputed: The same number of recomputed rows.
            again: Recomputes the rows, which it returns second.

        Returns:
            The number of leading rows that are equal within the tolerance, and a description of
            the first difference in the next row.

        Raises:
            LogError: The log is damaged.
        """
        size = self._layout.size
        rows = len(logged) // size
        if logged == recomputed:  # usual, unless another machine computes different sines
            return rows, ''
        values = self._values(recomputed)
        with np.errstate(all='ignore'):  # logged values may be arbitrary
            units = self._units(values, again)
            ulp = abs(self._values(logged) - values) / units
        wrong = self._wrong_bytes(logged, recomputed, ulp <= _TOLERANCE)
        wrong_rows = np.flatnonzero(wrong.any(axis=1))
        count = int(wrong_rows[0]) if len(wrong_rows) else rows
        # Rows that differ only in the sign of a zero must not count as equal to the bit.
        self.ulp = max(self.ulp, float(ulp[:, :count].max(initial=math.ulp(0.0))))
        if count == rows:
            return count, ''
        first_byte = int(wrong[count].argmax())
        row = slice(count * size, (count + 1) * size)
        return count, self._describe(first_byte, logged[row], recomputed[row], units[:, count])

    def _units(self, values: Array, again: Callable[[], tuple[Any, bytearray]]) -> Array:
        """Returns the size of an ulp of each double in recomputed rows, shape (fields, rows)."""
        moved = np.zeros_like(values)
        for seed in range(_SAMPLES):
            with suppress(LinkageError), noise(_NOISE, seed):  # beyond a limit of the crank
                moved = np.maximum(moved, abs(self._values(again()[1]) - values))
        return np.maximum(np.spacing(self._largest), moved * (_LAST_BIT / _NOISE))

    def _wrong_bytes(
        self, logged: bytes, recomputed: bytearray, near: npt.NDArray[np.bool_]
    ) -> npt.NDArray[np.bool_]:
        """Returns which bytes differ and are in no double that is near, shape (rows, bytes).

        `near` states whether each double is equal within the tolerance, shape (fields, rows).
        """
        rows, due = np.frombuffer(logged, np.uint8), np.frombuffer(recomputed, np.uint8)
        wrong = np.not_equal(rows, due).reshape(-1, self._layout.size)
        for place, is_near in zip(self._doubles, near, strict=True):
            wrong[is_near, place.offset : place.offset + 8] = False
        return wrong

    @functools.cached_property
    def _largest(self) -> Array:
        """The largest finite magnitude of each field in the log, shape (fields, 1)."""
        largest = np.zeros((len(self._doubles), 1))
        for layout, rows in self._log.rows(self._layouts):
            if layout is self._layout and layout.count(rows, 0):
                values = np.nan_to_num(self._values(rows), nan=0, posinf=0, neginf=0)
                largest = np.maximum(largest, abs(values).max(axis=1, keepdims=True))
        return largest

    def _values(self, rows: bytes | bytearray) -> Array:
        """Returns the doubles in rows, shape (fields, rows)."""
        return np.array([self._layout.column(rows, place) for place in self._doubles])

    def _describe(self, at: int, logged: bytes, recomputed: bytearray, units: Array) -> str:
        """Describes the difference between two rows at their first different byte."""
        layout = self._layout
        message = bisect_right(layout.starts, at) - 1
        byte = at - layout.starts[message] - MESSAGE_HEAD.size
        words = f'byte {byte} = {logged[at]:#04x} logged, {recomputed[at]:#04x} recomputed'
        for place in layout.places:
            if place.offset <= at < place.offset + struct.calcsize(place.code):
                value = layout.column(logged, place).item()
                due = layout.column(recomputed, place).item()
                words = (
                    f'{place.name} = {value!r} logged, {due!r} recomputed: '
                    f'off by {abs(value - due):.3g}'
                )
                if place in self._doubles:
                    unit = units[self._doubles.index(place)]
                    words += f', {abs(value - due) / unit:.6g} ulp'
        return f'{self._names[message]}: {words}'
