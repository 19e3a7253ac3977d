# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Publishes the messages of a log on its topics, and the log's time on /clock."""

import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager

from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.publisher import Publisher

from linkage_ros.errors import ConfigurationError, LogError
from linkage_ros.log.reader import LoggedMessage, LogReader
from linkage_ros.messages.cdr import encode_clock
from linkage_ros.messages.topics import EFFORT_COMMANDS, SIMULATED_CLOCK, TOPICS, WRENCHES, Topic
from linkage_ros.node.endpoints import create_publisher, wait_for_delivery, wait_for_subscribers
from linkage_ros.node.parameter_node import given_values
from linkage_ros.node.process import USER_ERRORS, reported_as_configuration, ros_context, spinning
from linkage_ros.quantities import shown

# Time limits, s: for the first subscriber to connect, because earlier messages are lost; for the
# other subscribers; and for subscribers to receive the last messages.
_DISCOVERY_SECONDS, _MATCH_SECONDS, _LAST_SECONDS = 3.0, 0.5, 2.0


@contextmanager
def republishing(
    name: str,
    arguments: list[str],
    log: LogReader,
    topics: Iterable[str],
    position: Callable[[], int],
    clock_hz: float | None,
) -> Iterator[Callable[[LoggedMessage], None]]:
    """Runs a node that publishes messages of a log.

    Args:
        name: Name of the node.
        arguments: The ROS arguments of the command line.
        log: The log; determines types and quality of service.
        topics: Fully qualified names of the topics to publish.
        position: Returns the position in the log, ns.
        clock_hz: Rate, in real time, at which the position is published on /clock, Hz; None
            disables /clock.

    Yields:
        A function that publishes a message.

    Raises:
        ConfigurationError: The command line sets a parameter, but the node has none.
        LogError: A topic has a type that linkage_ros does not write, or an invalid name.
    """
    with ExitStack() as stack:
        stack.enter_context(ros_context(arguments))
        with reported_as_configuration():
            node = Node(name)
        for parameter in given_values(node):
            raise ConfigurationError(
                f'{shown(parameter)} is not a parameter of {name}: leave it out'
            )
        stack.enter_context(spinning(node))
        publishers = _publishers(node, log, set(topics))
        stack.callback(wait_for_delivery, publishers.values(), _LAST_SECONDS)
        if clock_hz is not None:
            stack.enter_context(_publishing_clock(node, position, clock_hz))
        if not wait_for_subscribers(publishers.values(), _DISCOVERY_SECONDS, _MATCH_SECONDS):
            node.get_logger().info('no subscribers yet; --delay S gives them time to connect')

        def publish(message: LoggedMessage) -> None:
            try:
                publishers[message.topic].publish(message.data)
            except RuntimeError as error:  # RCLError, which has no public name
                raise LogError(
                    f'{log.path}: a message on {message.topic} does not match the type of '
                    'the topic and cannot be published; --topics can leave the topic out'
                ) from error

        yield publish


@contextmanager
def _publishing_clock(node: Node, position: Callable[[], int], clock_hz: float) -> Iterator[None]:
    """Publishes the position in the log on /clock, also while paused, and once at the end."""
    publisher, one_at_a_time = create_publisher(node, SIMULATED_CLOCK), threading.Lock()

    def publish_position() -> None:
        # At the end, the timer may publish too, and the clock must not go back.
        with one_at_a_time:
            publisher.publish(encode_clock(position()))

    steady = Clock(clock_type=ClockType.STEADY_TIME)  # the node's own clock may be /clock
    timer = node.create_timer(1 / clock_hz, publish_position, clock=steady)
    try:
        yield
    finally:
        timer.cancel()
        publish_position()
        wait_for_delivery([publisher], _LAST_SECONDS)


def _publishers(node: Node, log: LogReader, topics: set[str]) -> dict[str, Publisher]:
    """Creates a publisher for each of these topics of a log.

    Raises:
        LogError: A topic cannot be published.
    """
    interfaces = (topic.interface for topic in (*TOPICS, EFFORT_COMMANDS, WRENCHES))
    interface_of = {interface.name: interface for interface in interfaces}
    publishers = {}
    for logged in log.topics:
        name = logged.name
        if name not in topics:
            continue
        if logged.type not in interface_of:
            raise LogError(
                f'{log.path}: {name} has the type {logged.type}, which linkage_ros does not write'
            )
        depth = 1 if logged.latched else 10
        topic = Topic(name, interface_of[logged.type], logged.latched, depth)
        try:
            publishers[name] = create_publisher(node, topic)
        except USER_ERRORS as error:
            words = str(error).splitlines()[0]
            raise LogError(f'{log.path}: {name!r:.80} cannot be published: {words}') from error
    return publishers
