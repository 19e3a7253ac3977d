# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Writes the MCAP log: a bag that ROS tools open bare, and that explains how it came about."""

from __future__ import annotations

import errno
import os
import shutil
import stat
import time
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from pathlib import Path
from typing import NoReturn, TypeAlias

from mcap.writer import CompressionType, Writer

from linkage_ros.errors import LogError
from linkage_ros.files import open_file
from linkage_ros.log.records import (
    CONFIGURATION_RECORD,
    MOTION_RECORD,
    write_configuration,
    write_motion,
)
from linkage_ros.motion.torque_driven import RunMotion
from linkage_ros.parameters.configuration import Configuration
from linkage_ros.wire.messages import Topic

# s. What a killed run loses is at most this and the worker's period, and what a busy machine adds
# to both; 0.3 s are promised. Each flush costs 0.8 kB of memory, for mcap's index of chunks.
FLUSH_PERIOD = 0.15

# Arguments of `LogWriter.write`, or a change of motion.
LogItem: TypeAlias = tuple[int, int, bytes] | RunMotion

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


class LogWriter(AbstractContextManager['LogWriter']):
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
            LogError: The file exists and is not to be replaced, is being written by another run,
                or cannot be created.
        """
        self.path = Path(path)
        self._begun = False
        try:
            self._stream = open_file(self.path, 'wb' if overwrite else 'xb')
        except FileExistsError as error:
            raise LogError(
                f'{path} exists already and is kept: choose another name, or ask to overwrite it'
            ) from error
        except BlockingIOError as error:
            raise LogError(
                f'{path} is being written by another run and is kept: choose another name'
            ) from error
        except OSError as error:
            self._fail(error)
        self._writer = Writer(
            self._stream, chunk_size=_CHUNK_SIZE, compression=CompressionType.ZSTD
        )
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        try:
            with self._reported():
                self._writer.start(profile='ros2', library='linkage_ros')
                record = write_configuration(configuration)
                self._writer.add_metadata(CONFIGURATION_RECORD, record)
            self.flush()
        except LogError:
            with suppress(OSError):
                if stat.S_ISREG(os.fstat(self._stream.fileno()).st_mode):  # and no device
                    self.path.unlink()  # nothing is in it
            self._close_stream()
            raise
        self._begun = True

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
        """Appends a message.

        Args:
            channel: From `add_topic`.
            stamp: Its log and its publish time, ns.
            data: CDR bytes.

        Raises:
            LogError: The file cannot be written.
        """
        try:
            self._writer.add_message(channel, stamp, data, stamp)
        except OSError as error:
            self._fail(error)

    def write_motion(self, motion: RunMotion) -> None:
        """Appends a change of motion."""
        with self._reported():
            self._writer.add_metadata(MOTION_RECORD, write_motion(motion))

    def consume(self, items: Sequence[LogItem]) -> None:
        """Appends what has come, and flushes what is older than the flush period.

        Args:
            items: Arguments of `write`, and changes of motion.
        """
        for item in items:
            if isinstance(item, tuple):
                self.write(*item)
            else:
                self.write_motion(item)
        if time.monotonic() >= self._next_flush:
            self.flush()

    def flush(self) -> None:
        """Hands all messages to the operating system: a killed run loses only what came later.

        Raises:
            LogError: The file cannot be written, or was removed, which ends the log.
        """
        self._check_size()  # what is written now would hide that somebody cut it off
        with self._reported():
            self._writer.flush()
        if self._is_removed():
            self.close()
        self._check_size()
        self._next_flush = time.monotonic() + FLUSH_PERIOD

    def close(self) -> None:
        """Completes the file; one that was removed meanwhile is put back first.

        Raises:
            LogError: The file cannot be written, or was removed.
        """
        if self._stream.closed:
            return
        try:
            with self._reported():
                self._writer.finish()
                self._stream.flush()
            if self._is_removed():
                self._put_back()
        finally:
            self._close_stream()

    def disk_sync(self) -> DiskSync:
        """What brings the file to the disk; for a worker of its own."""
        return DiskSync(self.path, self._stream.fileno())

    def _check_size(self) -> None:
        """Passes if the file is as long as what was written.

        Raises:
            LogError: Somebody cut it off, or wrote over it.
        """
        status = os.fstat(number := self._stream.fileno())
        written = os.lseek(number, 0, os.SEEK_CUR) if stat.S_ISREG(status.st_mode) else None
        if written not in {None, status.st_size}:
            raise LogError(
                f'{self.path} has {status.st_size} bytes instead of {written}: '
                'somebody else cuts it off or writes to it; give each run a log of its own'
            )

    def _is_removed(self) -> bool:
        # A log that is renamed or moved keeps a name; it goes on there.
        return os.fstat(self._stream.fileno()).st_nlink == 0

    def _put_back(self) -> NoReturn:
        """Copies the file without a name to where it was: Linux gives none back to a file.

        Raises:
            LogError: In any case: the log ends here, by the will or the mistake of somebody.
        """
        source, words = self._stream.fileno(), f'{self.path} was removed while it was written'
        try:
            _copy(source, self.path)
        except OSError as error:
            # It is there as long as somebody has it open.
            place = f'/proc/{os.getpid()}/fd/{os.dup(source)}'
            raise LogError(
                f'{words} and cannot be put back ({error.strerror or error}): copy it from '
                f'{place} before this process ends'
            ) from error
        raise LogError(f'{words}; it is put back with what was logged until then')

    def _close_stream(self) -> None:
        with suppress(OSError):  # closing flushes once more what could not be written before
            self._stream.close()

    @contextmanager
    def _reported(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            self._fail(error)

    def _fail(self, error: OSError) -> NoReturn:
        words = f'{self.path} cannot be written: {error.strerror or error}'
        rescue = '; linkage_log recover saves what it holds' if self._begun else ''
        raise LogError(words + rescue) from error

    def __exit__(self, *error: object) -> None:
        self.close()


def _copy(source: int, path: Path) -> None:
    """Copies an open file to a new one; one that cannot be completed is not left there.

    Raises:
        OSError: It cannot be copied.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open('xb') as target:
        try:
            with Path(f'/proc/self/fd/{source}').open('rb') as whole:
                shutil.copyfileobj(whole, target, _CHUNK_SIZE)
        except OSError:
            path.unlink()
            raise


class DiskSync:
    """Brings a log from the system's memory to the disk, where it outlives a power cut as well.

    A disk may take seconds for that, in which the log is still to be flushed: hence a worker of
    its own.
    """

    def __init__(self, path: Path, number: int) -> None:
        """Begins.

        Args:
            path: Of the log, for messages.
            number: Of its open file; it may be closed before this is.
        """
        self._path, self._number = path, os.dup(number)

    def consume(self, _: Sequence[object]) -> None:
        """Brings to the disk what was flushed so far.

        Raises:
            LogError: The disk fails.
        """
        try:
            os.fdatasync(self._number)
        except OSError as error:
            if error.errno != errno.EINVAL:  # a pipe or a device: there is no disk to wait for
                raise LogError(
                    f'{self._path} does not reach the disk: {error.strerror}'
                ) from error

    def close(self) -> None:
        """Lets the file go."""
        os.close(self._number)
