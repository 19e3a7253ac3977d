# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The MCAP log: a bag that ROS tools open bare, and that explains how it came about."""

from __future__ import annotations

import itertools
import json
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import NamedTuple, TypeAlias

from mcap.reader import make_reader
from mcap.records import Statistics
from mcap.writer import CompressionType, Writer

from linkage_ros import __version__
from linkage_ros.configuration import Configuration, from_strings, to_strings
from linkage_ros.errors import LinkageError, LogError
from linkage_ros.messages import Topic
from linkage_ros.motion import CrankMotion
from linkage_ros.quantities import shown

CONFIGURATION_RECORD = 'linkage_ros'
MOTION_RECORD = 'linkage_ros/motion'

# s. What a killed run loses is at most this and the worker's period.
FLUSH_PERIOD = 0.2

# Arguments of `LogWriter.write`, or a change of motion.
LogItem: TypeAlias = tuple[int, int, bytes] | CrankMotion

_CHUNK_SIZE = 1 << 20
_FOREVER = '{sec: 9223372036, nsec: 854775807}'


def _qos(topic: Topic) -> str:
    """A publisher's quality of service as rosbag2 writes it down; it wants every key."""
    durability = 'transient_local' if topic.latched else 'volatile'
    return (
        f'- history: keep_last\n  depth: {topic.depth}\n'
        f'  reliability: reliable\n  durability: {durability}\n'
        f'  deadline: {_FOREVER}\n  lifespan: {_FOREVER}\n'
        f'  liveliness: automatic\n  liveliness_lease_duration: {_FOREVER}\n'
        '  avoid_ros_namespace_conventions: false\n'
    )


class LogWriter:
    """Writes one log; not to be shared between threads.

    Attributes:
        path: The file.
    """

    def __init__(self, path: Path | str, configuration: Configuration, *, overwrite: bool) -> None:
        """Creates the file and writes down what the run is.

        Args:
            path: The file.
            configuration: Of the run.
            overwrite: Whether to replace an existing file.

        Raises:
            LogError: The file exists and is not to be replaced, or cannot be created.
        """
        self.path = Path(path)
        try:
            self._stream = self.path.open('wb' if overwrite else 'xb')
        except FileExistsError as error:
            raise LogError(
                f'{path} exists already and is kept: choose another name, or ask to overwrite it'
            ) from error
        except OSError as error:
            raise LogError(f'{path} cannot be written: {error.strerror or error}') from error
        self._writer = Writer(
            self._stream, chunk_size=_CHUNK_SIZE, compression=CompressionType.ZSTD
        )
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        self._writer.start(profile='ros2', library='linkage_ros')
        about = {'version': __version__, **to_strings(configuration)}
        self._writer.add_metadata(CONFIGURATION_RECORD, about)
        self.flush()

    def add_topic(self, topic: Topic, name: str) -> int:
        """Declares a channel.

        Args:
            topic: What is published.
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

    def write(self, channel: int, stamp: int, data: bytes) -> None:
        """Appends a message; `stamp`, ns, is its log and its publish time."""
        self._writer.add_message(channel, stamp, data, stamp)

    def write_motion(self, motion: CrankMotion) -> None:
        """Appends a change of motion."""
        self._writer.add_metadata(MOTION_RECORD, _motion_to_strings(motion))

    def consume(self, items: Sequence[LogItem]) -> None:
        """Appends what has come, and flushes what is older than the flush period.

        Args:
            items: Arguments of `write`, and changes of motion.
        """
        for item in items:
            if isinstance(item, CrankMotion):
                self.write_motion(item)
            else:
                self.write(*item)
        if time.monotonic() >= self._next_flush:
            self.flush()

    def flush(self) -> None:
        """Hands all messages to the operating system: a killed run loses only what came later."""
        self._writer.flush()
        self._next_flush = time.monotonic() + FLUSH_PERIOD

    def close(self) -> None:
        """Completes the file."""
        if not self._stream.closed:
            try:
                self._writer.finish()
            finally:
                self._stream.close()

    def __enter__(self) -> LogWriter:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()


class LoggedMessage(NamedTuple):
    """A message as it was logged.

    Attributes:
        topic: Fully qualified name.
        type: Message type, such as 'std_msgs/msg/Float64'.
        time: Log time, ns.
        data: CDR bytes.
    """

    topic: str
    type: str
    time: int
    data: bytes


class LoggedTopic(NamedTuple):
    """A channel of a log: its fully qualified name, message type and number of messages."""

    name: str
    type: str
    messages: int
    latched: bool


class LogReader:
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
            self._open()
        except BaseException:
            self._stream.close()
            raise

    def _open(self) -> None:
        with _damage_reported(self.path):
            self._read_summary()

    def _read_summary(self) -> None:
        self._reader = make_reader(self._stream, validate_crcs=True)
        summary = self._reader.get_summary()
        if summary is None or summary.statistics is None:
            raise LogError(f'{self.path} is not complete: its run was killed before the end')
        records = list(itertools.islice(self._reader.iter_metadata(), 1_000_000))
        about = [record.metadata for record in records if record.name == CONFIGURATION_RECORD]
        if not about:
            raise LogError(f'{self.path} is no log of linkage_ros: it has no configuration record')
        settings = dict(about[0])
        self.version = settings.pop('version', '')
        self.configuration = from_strings(settings)
        self.motions = tuple(
            _motion_from_strings(record.metadata)
            for record in records
            if record.name == MOTION_RECORD
        )
        counts: Mapping[int, int] = summary.statistics.channel_message_counts
        self.topics = tuple(
            LoggedTopic(
                channel.topic,
                summary.schemas[channel.schema_id].name,
                counts.get(channel.id, 0),
                'transient_local' in channel.metadata.get('offered_qos_profiles', ''),
            )
            for channel in summary.channels.values()
        )
        self.start, self.end = _span(summary.statistics)

    def messages(
        self, topics: Iterable[str] | None = None, start: int | None = None
    ) -> Iterator[LoggedMessage]:
        """Reads messages in the order of their log times.

        Args:
            topics: Fully qualified names; None: all.
            start: First log time, ns; None: from the beginning.

        Yields:
            The messages.

        Raises:
            LogError: The file is damaged.
        """
        wanted = None if topics is None else list(topics)
        stored = self._reader.iter_messages(topics=wanted, starting_at=start)
        with _damage_reported(self.path):
            for schema, channel, message in stored:
                kind = '' if schema is None else schema.name
                yield LoggedMessage(channel.topic, kind, message.log_time, message.data)

    def close(self) -> None:
        """Closes the file."""
        self._stream.close()

    def __enter__(self) -> LogReader:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()


def _span(statistics: Statistics) -> tuple[int, int]:
    return statistics.message_start_time, statistics.message_end_time


@contextmanager
def _damage_reported(path: Path) -> Iterator[None]:
    try:
        yield
    except LinkageError:
        raise
    except Exception as error:  # nothing bounds what damage makes a parser raise
        cause = ' '.join(f'{type(error).__name__}: {error}'.split())[:200]
        raise LogError(
            f'{path} is no readable MCAP file, or is damaged or not complete ({cause})'
        ) from error


def _motion_to_strings(motion: CrankMotion) -> dict[str, str]:
    return {
        'stamp': str(motion.stamp),
        'phase': str(motion.phase(motion.stamp)),
        'speed': str(motion.speed(motion.stamp)),
        'rpm': json.dumps(motion.rpm),
        'acceleration': json.dumps(motion.acceleration),
    }


def _motion_from_strings(strings: Mapping[str, str]) -> CrankMotion:
    try:
        return CrankMotion(
            int(strings['stamp']),
            Fraction(strings['phase']),
            Fraction(strings['speed']),
            float(json.loads(strings['rpm'])),
            float(json.loads(strings['acceleration'])),
        )
    except (KeyError, ValueError, TypeError, ZeroDivisionError) as error:
        raise LogError(f'a motion record of the log is damaged: {shown(dict(strings))}') from error
