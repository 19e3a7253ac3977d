# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Publishers and subscriptions of a node, which pass messages as CDR bytes."""

import time
from collections.abc import Callable, Collection, Iterable, Iterator
from importlib import import_module
from typing import Any

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.duration import Duration
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from linkage_ros.errors import ConfigurationError, one_line
from linkage_ros.messages.cdr import LARGEST_COMMAND, stamp_of
from linkage_ros.messages.topics import Topic, prefix_of
from linkage_ros.motion.inputs import Received
from linkage_ros.node.process import Throttle, rclpy_internals
from linkage_ros.units import NS_PER_S, TIME_END

# Time limit, s, for subscribers to discover a node, and time for the others to match.
_DISCOVERY_SECONDS, _MATCH_SECONDS = 0.8, 0.2
_DELIVERY_SECONDS = 0.5  # time limit for a subscriber that does not respond
# Queue length of commands between ticks, which bounds the cost of a flood: older commands are
# dropped. It is also the queue length of /clock, and large enough for a burst.
_DEPTH = 100
_PATIENCE = 0.05  # s, longest wait for a message, by which the end of a node is delayed
# Number of causes of rejection that are counted separately between two reports, for each linkage.
# Causes contain received names and values, so a flood of messages may have any number of them.
_CAUSES = 5
# Name that rmw gives to a node whose publisher was discovered before it.
_UNKNOWN_NODE = '_NODE_NAME_UNKNOWN_'
# Topics of every rclpy node.
_ROS_TOPICS = ('/rosout', '/parameter_events')


def message_class(name: str) -> Any:
    """Imports the Python class of a message type such as 'std_msgs/msg/Float64'."""
    package, _, kind = name.split('/')
    return getattr(import_module(f'{package}.msg'), kind)


def create_publisher(node: Node, topic: Topic, **options: Any) -> Publisher:
    """Creates a publisher of CDR bytes with the topic's quality of service."""
    durability = DurabilityPolicy.TRANSIENT_LOCAL if topic.latched else DurabilityPolicy.VOLATILE
    qos = QoSProfile(
        depth=topic.depth, reliability=ReliabilityPolicy.RELIABLE, durability=durability
    )
    return node.create_publisher(message_class(topic.interface.name), topic.name, qos, **options)


class StatePublisher:
    """Publishes a topic while it has subscribers.

    The subscribers are counted only when they change, because counting takes as long as
    publishing.

    Attributes:
        publisher: Publisher of CDR bytes.
        is_heard: Whether there were subscribers when they were last counted.
    """

    def __init__(self, node: Node, topic: Topic) -> None:
        events = PublisherEventCallbacks(matched=self.count)  # a subscriber came or went
        self.publisher = create_publisher(node, topic, event_callbacks=events)
        self.is_heard = True

    def count(self, *_: object) -> None:
        """Counts the subscribers."""
        self.is_heard = self.publisher.get_subscription_count() > 0


def require_distinct(node: Node, topics: Iterable[Topic]) -> None:
    """Raises an error if two topics of a node, the subscribed ones first, have the same name.

    Raises:
        ConfigurationError: Two topics have the same name.
    """
    taken = {node.resolve_topic_name(name): name for name in _ROS_TOPICS}
    for topic in topics:
        name, resolved = topic.name, node.resolve_topic_name(topic.name)
        label = f'{topic.parameter} = {name}' if topic.parameter else name
        if resolved in taken:
            both = f'{taken[resolved]} and {label}'
            remapping = f'give {name} another name, -r {name}:=linkage/{name.lstrip("/")}'
            # A remapping would affect a parameter's topic, too.
            cure = 'change the parameter' if ' = ' in both else remapping
            raise ConfigurationError(f'{both} are the same topic, {resolved}: {cure}')
        taken[resolved] = label


def wait_for_subscribers(
    publishers: Collection[Publisher],
    patience: float = _DISCOVERY_SECONDS,
    settle: float = _MATCH_SECONDS,
) -> bool:
    """Waits until existing subscribers have discovered a node; returns whether there are any.

    The first one may take `patience`, s, and others `settle`, s, longer.
    """
    end = time.monotonic() + patience
    while time.monotonic() < end:
        if any(publisher.get_subscription_count() for publisher in publishers):
            time.sleep(settle)
            return True
        time.sleep(0.01)
    return False


def wait_for_delivery(
    publishers: Collection[Publisher], seconds: float = _DELIVERY_SECONDS
) -> None:
    """Waits until subscribers have received the last messages, unless one does not respond.

    It polls, because rclpy holds the interpreter lock while it waits, which stops all threads of
    the process, such as the ticks of another node.

    Args:
        publishers: Publishers of the messages.
        seconds: Time limit, s.
    """
    end, at_once = time.monotonic() + seconds, Duration()
    while not all(publisher.wait_for_all_acked(at_once) for publisher in publishers):
        if time.monotonic() > end:
            return
        time.sleep(0.005)


class _PolledGroup(ReentrantCallbackGroup):  # type: ignore[misc]  # rclpy has no types
    """Hides a subscription from the executor.

    Otherwise each message would wake the executor's thread, which then competes with the tick
    thread for the interpreter: at 10 kHz, five of six ticks were missed.
    """

    def can_execute(self, _: object) -> bool:
        """Returns False, so that the executor ignores this group."""
        return False


class PolledSubscription:
    """Keeps the last messages of a topic until the tick thread takes them.

    The subscription is best effort and volatile, so that it is compatible with every publisher.
    Lost messages are not sent again. It has no event handlers: with Fast DDS, an executor that
    waits for an event of a subscription wakes up continuously while a message is queued.

    Attributes:
        name: Resolved name of the topic.
    """

    def __init__(
        self,
        node: Node,
        topic: Topic,
        read: Callable[[bytes, int], Any],
        log: Callable[[int, Topic, bytes], None],
    ) -> None:
        """Creates the subscription.

        Args:
            node: Node of the subscription.
            topic: Topic to subscribe to.
            read: Decodes a message, given its time of receipt, ns; raises a ValueError to reject
                it, with the cause, which may be followed by a colon and details.
            log: Called for each message with time of receipt, ns, topic, and CDR bytes.

        Raises:
            ConfigurationError: This version of rclpy differs from that of ROS 2 Jazzy.
        """
        self.name, self._logger = node.resolve_topic_name(topic.name), node.get_logger()
        self._node = node
        self._topic, self._read, self._log = topic, read, log
        self._kind, self._depth = message_class(topic.interface.name), max(topic.depth, _DEPTH)
        self._rejections = Rejections()  # since the last report
        self._throttle = Throttle()
        qos = QoSProfile(depth=self._depth, reliability=ReliabilityPolicy.BEST_EFFORT)
        self._subscription = node.create_subscription(
            self._kind, topic.name, lambda _: None, qos, raw=True, callback_group=_PolledGroup(),
            event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False),
        )  # fmt: skip
        with rclpy_internals():
            # rclpy has no public way to take a message or to wait for one without an executor,
            # which takes 0.3 ms for each message.
            from rclpy.impl.implementation_singleton import rclpy_implementation

            self._wait_set = rclpy_implementation.WaitSet(1, 0, 0, 0, 0, 0, node.context.handle)
            self._take = self._subscription.handle.take_message

    def mistyped(self) -> list[str]:
        """Returns a warning if a node publishes another type on the topic, which is not heard."""
        own = self._topic.interface.name
        for other in self._node.get_publishers_info_by_topic(self.name):
            if other.topic_type != own:
                node = f'{other.node_namespace.rstrip("/")}/{other.node_name}'
                who = 'a node' if other.node_name == _UNKNOWN_NODE else node
                words = f'{who} publishes {other.topic_type} on {self.name}, which takes {own}'
                return [one_line(words)]
        return []

    def receive(self, seconds: float = _PATIENCE) -> Iterator[Any]:
        """Waits briefly, at most for some seconds, for messages; reads them like `take`."""
        handle = self._subscription.handle
        with handle:
            self._wait_set.clear_entities()
            self._wait_set.add_subscription(handle)
            self._wait_set.wait(round(min(max(seconds, 0.0), _PATIENCE) * NS_PER_S))
        yield from self.take()

    def discard(self) -> None:
        """Takes the queued messages without reading them."""
        handle = self._subscription.handle
        with handle:
            for _ in range(self._depth):
                if not self._take(self._kind, True):
                    break

    def take(self) -> Iterator[Any]:
        """Reads the queued messages; yields the results of accepted messages."""
        handle = self._subscription.handle
        for _ in range(self._depth):  # a flood of messages must not block the thread
            with handle:
                message = self._take(self._kind, True)
            if not message:
                break
            data, info = message
            received = info['received_timestamp'] or time.time_ns()
            if len(data) <= LARGEST_COMMAND:  # a message of megabytes would exceed a log's chunks
                self._log(received, self._topic, data)
            try:
                result = self._read(data, received)
            except ValueError as error:
                self._rejections.add(error)
                continue
            if isinstance(result, Received):
                for linkage, cause in result.refused.items():
                    self._rejections.add(cause, linkage)
            yield result
        if self._rejections and self._throttle.is_due():
            self._logger.warning(f'messages on {self.name} are rejected: {self._rejections}')
            self._rejections = Rejections()


class Rejections:
    """Counts rejected messages by linkage and cause."""

    def __init__(self) -> None:
        # Number of messages and the last error, by cause and by linkage.
        self._found: dict[str, dict[str, tuple[int, str]]] = {}

    def add(self, error: ValueError, linkage: str = '') -> None:
        """Counts a message that a linkage, or, without a name, all or the only one, rejects.

        The error's text is the cause, perhaps with a colon and details.
        """
        causes, words = self._found.setdefault(linkage, {}), str(error)
        cause = words.partition(':')[0]
        if cause not in causes and len(causes) >= _CAUSES:
            cause = words = 'other causes'
        count, _ = causes.get(cause, (0, ''))
        causes[cause] = count + 1, words

    def __bool__(self) -> bool:
        return bool(self._found)

    def __str__(self) -> str:
        return '; '.join(
            f'{prefix_of(linkage, ": ")}{words} ({count} x)'
            for linkage, causes in self._found.items()
            for count, words in causes.values()
        )


def read_clock(data: bytes, _: int) -> int:
    """Reads the time, ns, in a message of /clock.

    Raises:
        ValueError: The time is out of the range of stamps.
    """
    time = stamp_of(data)
    if not 0 <= time < TIME_END:
        raise ValueError(f'{time / 1e9:.15g} s: must be from 0 to 2^31 s')
    return time
