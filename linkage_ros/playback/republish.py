# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Publishes what a log holds on its topics, and the log's time on /clock."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager

from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.publisher import Publisher

from linkage_ros.errors import ConfigurationError, LogError
from linkage_ros.log.reader import LogReader
from linkage_ros.parameters.configuration import without_ros_own
from linkage_ros.playback.feed import Item
from linkage_ros.playback.pace import Pace
from linkage_ros.playback.player import Sink
from linkage_ros.quantities import shown
from linkage_ros.ros.context import USER_ERRORS, on_ros, reported_as_configuration
from linkage_ros.ros.executor import served
from linkage_ros.ros.parameters import given_values
from linkage_ros.ros.publishers import await_listeners, create_publisher
from linkage_ros.wire.codecs import encode_clock
from linkage_ros.wire.topics import SIMULATED_CLOCK, TOPICS, Topic, effort_commands

# s given to subscribers to be found, because a replay loses what nobody hears, and for the last
# messages.
_PATIENCE, _SETTLE, _ACKNOWLEDGE = 3.0, 0.5, 2.0


@contextmanager
def republishing(
    name: str,
    arguments: list[str],
    log: LogReader,
    topics: Iterable[str],
    pace: Pace,
    clock_hz: float | None,
) -> Iterator[Sink]:
    """Publishes messages as a node.

    Args:
        name: Of the node.
        arguments: ROS's part of the command line.
        log: Tells types and quality of service.
        topics: Fully qualified names of those to publish.
        pace: Tells the time.
        clock_hz: How often a second, of real time, to publish that on /clock; None: never.

    Yields:
        Takes the messages.

    Raises:
        ConfigurationError: The command line sets a parameter; the node has none of its own.
        LogError: A topic has a type that linkage_ros does not write, or a name that is none.
    """
    with ExitStack() as stack:
        stack.enter_context(on_ros(arguments))
        with reported_as_configuration():
            node = Node(name)
        for parameter in without_ros_own(given_values(node)):
            raise ConfigurationError(
                f'{shown(parameter)} is not a parameter of {name}: leave it out'
            )
        stack.enter_context(served(node))
        publishers = _publishers(node, log, set(topics))
        if clock_hz is not None:
            stack.enter_context(_ticking(node, pace, clock_hz))
        if not await_listeners(publishers.values(), _PATIENCE, _SETTLE):
            node.get_logger().info('nobody listens so far; --delay S gives them time')

        def publish(item: Item) -> None:
            try:
                publishers[item.message.topic].publish(item.message.data)
            except RuntimeError as error:  # RCLError, which has no public name
                raise LogError(
                    f'{log.path}: a message on {item.message.topic} is none of its type: no '
                    'middleware publishes it; --topics leaves a topic out'
                ) from error

        yield publish
        end = time.monotonic() + _ACKNOWLEDGE
        for publisher in publishers.values():
            left = max(0.0, end - time.monotonic())
            publisher.wait_for_all_acked(Duration(seconds=left))


def _publishers(node: Node, log: LogReader, topics: set[str]) -> dict[str, Publisher]:
    interfaces = (topic.interface for topic in (*TOPICS, effort_commands('')))
    known = {interface.name: interface for interface in interfaces}
    publishers = {}
    for channel in log.topics:
        name, latched = channel.name, channel.latched
        if name not in topics:
            continue
        if channel.type not in known:
            raise LogError(f'{log.path}: {name} has the foreign type {channel.type}')
        topic = Topic(name, known[channel.type], latched, 1 if latched else 10)
        try:
            publishers[name] = create_publisher(node, topic)
        except USER_ERRORS as error:
            words = str(error).partition('\n')[0]
            raise LogError(f'{log.path}: {name!r:.80} cannot be published: {words}') from error
    return publishers


@contextmanager
def _ticking(node: Node, pace: Pace, frequency: float) -> Iterator[None]:
    """Publishes the time at a frequency, standing or running, and once more at the end."""
    publisher = create_publisher(node, SIMULATED_CLOCK)
    done = threading.Event()

    def publish() -> None:
        publisher.publish(encode_clock(pace.position()))

    def tick() -> None:
        due = time.monotonic()
        while not done.wait(max(0.0, due - time.monotonic())):
            publish()
            due = max(due + 1 / frequency, time.monotonic())  # what was missed stays so

    thread = threading.Thread(target=tick, name='clock', daemon=True)
    thread.start()
    try:
        yield
    finally:
        done.set()
        thread.join()
        publish()
