# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_replay: publishes a log on its topics, byte for byte and in its rhythm."""

from __future__ import annotations

import argparse
import queue
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager

from tqdm import tqdm

from linkage_ros import cli
from linkage_ros.errors import ConfigurationError, LinkageError, LogError
from linkage_ros.log_reader import LoggedMessage, LogReader
from linkage_ros.machine import Machine
from linkage_ros.messages import JOINT_STATES, TOPICS, JointStateCodec, Topic
from linkage_ros.stream import Sample, View
from linkage_ros.worker import Worker

_NAME = 'linkage_replay'
_NS = 10**9
# Messages read ahead, so that unpacking a chunk never holds up the next message.
_AHEAD = 4_000

Sink = Callable[[LoggedMessage], None]


def replay(
    log: LogReader,
    sinks: list[Sink],
    stop: cli.Stop,
    *,
    rate: float = 1.0,
    start_offset: float = 0.0,
    topics: list[str] | None = None,
    progress: bool = False,
) -> int:
    """Hands the messages of a log to sinks at the times at which they were logged.

    Args:
        log: The log.
        sinks: Each gets every message.
        stop: Ends it early.
        rate: Log time over real time.
        start_offset: s of the log to leave out; latched messages in them are handed over.
        topics: Fully qualified names; None: all.
        progress: Whether to show a bar on stderr.

    Returns:
        The number of messages.
    """
    start = log.start + round(start_offset * _NS)
    count, origin = 0, time.monotonic()
    with _shown((log.end - start) / _NS, progress) as show:
        for message in _read_ahead(_selected(log, start, topics)):
            due = origin + max(0, message.time - start) / _NS / rate
            while (left := due - time.monotonic()) > 0:
                show((message.time - start) / _NS - left * rate)
                if stop.wait(min(left, 0.5)):
                    return count
            for sink in sinks:
                sink(message)
            count += 1
    return count


def _selected(log: LogReader, start: int, topics: list[str] | None) -> Iterator[LoggedMessage]:
    latched = [topic.name for topic in log.topics if topic.latched]
    wanted = [topic.name for topic in log.topics] if topics is None else topics
    early = [name for name in latched if name in wanted] if start > log.start else []
    last = {m.topic: m for m in log.messages(early) if m.time < start} if early else {}
    yield from last.values()
    yield from log.messages(wanted, start)


def _read_ahead(messages: Iterator[LoggedMessage]) -> Iterator[LoggedMessage]:
    """The same messages, read by a thread ahead of their time."""
    ahead: queue.Queue[LoggedMessage | LinkageError | None] = queue.Queue(_AHEAD)

    def read() -> None:
        try:
            for message in messages:
                ahead.put(message)
            ahead.put(None)
        except LinkageError as error:
            ahead.put(error)

    threading.Thread(target=read, name='reader', daemon=True).start()
    while (item := ahead.get()) is not None:
        if isinstance(item, LinkageError):
            raise item
        yield item


@contextmanager
def _shown(seconds: float, progress: bool) -> Iterator[Callable[[float], None]]:
    layout = '{desc}{percentage:3.0f}%|{bar}| {n:.1f}/{total:.1f} s'
    bar = tqdm(
        total=round(seconds, 3), bar_format=layout, disable=None if progress else True,
        mininterval=0.5, leave=False,
    )  # fmt: skip
    with bar:

        def show(position: float) -> None:
            bar.update(max(0.0, min(position, seconds) - bar.n))

        yield show


def _view_sink(log: LogReader, target: str) -> tuple[Sink, Callable[[], None]]:
    """Shows the joint states of a log in Rerun."""
    machine = Machine(log.configuration)
    codec, joints = JointStateCodec(machine.joints), len(machine.joints)
    failed: list[Exception] = []
    worker: Worker[Sample] = Worker(
        'view',
        View(log.configuration, target, log.configuration.session.viewer_bind),
        capacity=1_000_000,
        period=0.03,
        on_error=failed.append,
    )

    def show(message: LoggedMessage) -> None:
        if message.type != JOINT_STATES.interface.name:
            return
        try:
            stamp, numbers = codec.decode(message.data)
        except ValueError as error:
            raise LogError(f'{log.path}: a message on {message.topic} is {error}') from error
        rows = (numbers[start : start + joints] for start in range(0, 3 * joints, joints))
        worker.offer(Sample(stamp, *rows))

    def close() -> None:
        worker.close(timeout=10.0)
        if failed:
            cli.print_error(_NAME, f'the view ended early: {failed[0]}')

    return show, close


@contextmanager
def _publishing(log: LogReader, arguments: list[str]) -> Iterator[Sink]:
    """Publishes messages on the topics of a log.

    Raises:
        LogError: A topic has a type that linkage_ros does not write.
    """
    import rclpy
    from rclpy.duration import Duration
    from rclpy.node import Node

    from linkage_ros import ros

    known = {topic.interface.name: topic for topic in TOPICS}
    ros.start(arguments)
    try:
        with ros.reported_as_configuration():
            node = Node(_NAME)
        with ros.served(node):
            publishers = {}
            for name, kind, _, latched in log.topics:
                if kind not in known:
                    raise LogError(f'{log.path}: {name} has the foreign type {kind}')
                topic = Topic(name, known[kind].interface, latched, 1 if latched else 10)
                publishers[name] = ros.create_publisher(node, topic)
            ros.await_listeners(publishers.values())
            yield lambda message: publishers[message.topic].publish(message.data)
            for publisher in publishers.values():
                publisher.wait_for_all_acked(Duration(seconds=2))
    finally:
        rclpy.try_shutdown()


def _parser() -> argparse.ArgumentParser:
    parser = cli.make_parser(
        _NAME,
        'Replay a log of linkage_ros on its topics, in the Rerun viewer, or both.',
        ('run.mcap', 'run.mcap --rate 0.5 --start-offset 2 --topics /joint_states',
         'run.mcap --viewer spawn --no-ros'),
    )  # fmt: skip
    parser.add_argument('log', metavar='LOG.mcap', help='the log')
    parser.add_argument(
        '--rate', type=float, default=1.0, metavar='R', help='log time over real time (default 1)'
    )
    parser.add_argument(
        '--start-offset',
        type=float,
        default=0.0,
        metavar='S',
        help='leave out the first S s',
    )
    parser.add_argument('--topics', nargs='+', metavar='NAME', help='replay these topics only')
    parser.add_argument(
        '--delay', type=float, default=0.0, metavar='S', help='wait S seconds before the start'
    )
    parser.add_argument(
        '--viewer', default='', metavar='TARGET',
        help='also show it in Rerun: spawn, rerun+http://HOST:PORT/proxy or a .rrd path',
    )  # fmt: skip
    parser.add_argument('--no-ros', action='store_true', help='do not publish, only view')
    return parser


def _check(options: argparse.Namespace, log: LogReader) -> None:
    length = (log.end - log.start) / _NS
    if not 1e-3 <= options.rate <= 1e6:
        raise ConfigurationError(f'--rate {options.rate:g}: must be a number from 0.001 to 1e+06')
    if not 0 <= options.start_offset <= length:
        raise ConfigurationError(
            f"--start-offset {options.start_offset:g}: must be from 0 to the log's {length:g} s"
        )
    if not 0 <= options.delay <= 1e6:
        raise ConfigurationError(f'--delay {options.delay:g}: must be from 0 to 1e+06 s')
    names = [topic.name for topic in log.topics]
    for name in options.topics or ():
        if name not in names:
            raise ConfigurationError(f'--topics {name}: the log has {", ".join(names)}')
    if options.no_ros and not options.viewer:
        raise ConfigurationError('--no-ros leaves nothing to do: give --viewer as well')


def _split(arguments: list[str]) -> tuple[list[str], list[str]]:
    """Our arguments, and ROS's from --ros-args to -- or the end."""
    if '--ros-args' not in arguments:
        return arguments[1:], arguments[:1]
    start = arguments.index('--ros-args')
    rest = arguments[start:]
    end = start + rest.index('--') if '--' in rest else len(arguments)
    return arguments[1:start] + arguments[end + 1 :], arguments[:1] + arguments[start:end]


def _run(arguments: list[str]) -> int:
    own, of_ros = _split(arguments)
    options = _parser().parse_args(own)
    stop = cli.Stop()
    with ExitStack() as stack:
        log = stack.enter_context(LogReader(options.log))
        _check(options, log)
        sinks = []
        if not options.no_ros:
            try:
                sinks.append(stack.enter_context(_publishing(log, of_ros)))
            except ModuleNotFoundError as error:
                if not options.viewer:
                    raise ConfigurationError(
                        'rclpy is not installed, so there are no topics: give --viewer'
                    ) from error
        if options.viewer:
            sink, close = _view_sink(log, options.viewer)
            stack.callback(close)
            sinks.append(sink)
        # A message must not wait for the reading thread's turn in the interpreter to end.
        sys.setswitchinterval(0.0005)
        if stop.wait(options.delay):
            return cli.STOPPED_BY_USER
        count = replay(
            log, sinks, stop, rate=options.rate, start_offset=options.start_offset,
            topics=options.topics, progress=True,
        )  # fmt: skip
    print(f'{options.log}: {count} messages replayed')
    return 0


def main() -> int:
    """Entry point."""
    return cli.run(_NAME, lambda: _run(sys.argv))


if __name__ == '__main__':
    sys.exit(main())
