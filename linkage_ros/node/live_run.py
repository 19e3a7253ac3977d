# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The motion of a node's linkages: ticks, published states, log and view, diagnostics."""

import functools
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import chain
from typing import Any, TypeAlias, TypeVar, cast

from rclpy.node import Node
from rclpy.publisher import Publisher

from linkage_ros.errors import LinkageError, MotionError, in_linkage, one_line
from linkage_ros.log.records import LinkageEnd, TorqueEnd
from linkage_ros.log.rows import LoggedState
from linkage_ros.messages.cdr import WARN, Status, encode_diagnostics
from linkage_ros.messages.templates import encode_efforts
from linkage_ros.messages.topics import DIAGNOSTICS, SIMULATED_CLOCK, Topic, prefix_of
from linkage_ros.motion.drives.follow import MeasuredCrank
from linkage_ros.motion.inputs import Received, SharedInput
from linkage_ros.motion.segments import Coordinates, Motion
from linkage_ros.node.commanded_torque import (
    END_OF_MOTION,
    INVALID_MEASUREMENT,
    CommandedTorque,
)
from linkage_ros.node.endpoints import (
    PolledSubscription,
    StatePublisher,
    create_publisher,
    read_clock,
    require_distinct,
    wait_for_delivery,
    wait_for_subscribers,
)
from linkage_ros.node.health import ACTIVE, HealthMonitor
from linkage_ros.node.moving_linkage import MovingLinkage
from linkage_ros.node.outputs import Outputs
from linkage_ros.node.process import reported_as_configuration
from linkage_ros.node.ticker import RealTimeTicker, SimTimeTicker, Ticker
from linkage_ros.node.workers import freeze_heap
from linkage_ros.quantities import counted
from linkage_ros.run.robot import Robot
from linkage_ros.run.states import RowPart
from linkage_ros.run.trajectory_ahead import TrajectoryAhead
from linkage_ros.settings.configuration import Configuration
from linkage_ros.units import NS_PER_MS

_T = TypeVar('_T')
# Coordinates of a state, and those for the feed-forward torque.
Moment: TypeAlias = tuple[Coordinates, Coordinates | None]

# Time for a tick to end before the zero is sent that ends the torque, s. It must not wait for a
# tick that hangs.
_LAST_TICK_SECONDS = 0.1


class LiveRun:
    """The motion of the linkages of a configuration, which `start` and `pause` control.

    A pause is like a step of the clock: the next state continues the motion, one tick after the
    last state, with a stamp of the current time.

    Attributes:
        linkages: The linkages, by name.
        error: The error of a tick or a report that ended the motion of all linkages, or None.
    """

    def __init__(
        self,
        node: Node,
        configuration: Configuration,
        diagnostics: Publisher,
        on_failure: Callable[[], object],
    ) -> None:
        """Creates publishers and subscriptions, opens log and view, and compiles the programs.

        `on_failure` is called if an error ends the motion, also from the thread of the ticks.

        Raises:
            ConfigurationError: The configuration cannot run live.
            LogError: The log cannot be created.
            ViewerError: The view cannot be opened.
            ImportError: MCAP or Rerun is not installed.
        """
        self._node, self._on_failure = node, on_failure
        self.error: BaseException | None = None
        self._robot = robot = Robot(configuration)
        for name, simulator in robot.simulators.items():
            with in_linkage(name):
                simulator.prepare_live()
        # Names of linkages whose motion has ended, each with the error.
        self._ended = dict[str, LinkageError]()
        self._trajectory: TrajectoryAhead | None = None
        others = [*robot.descriptions()]
        if robot.drive.trajectory_command_topic:
            self._trajectory = TrajectoryAhead(robot)
            others.append(self._trajectory.topic)
        inputs, forces = robot.inputs(), robot.live_forces()
        heard = [*inputs, *chain.from_iterable(forces.values())]
        with reported_as_configuration():  # a topic name may be invalid
            require_distinct(node, [*heard, *robot.templates.topics, DIAGNOSTICS, *others])
            self._states = {
                topic.name: StatePublisher(node, topic) for topic in robot.templates.topics
            }
            self._publisher_of = {topic.name: create_publisher(node, topic) for topic in others}
        self._publisher_of[DIAGNOSTICS.name] = diagnostics
        self._publisher_of |= {name: state.publisher for name, state in self._states.items()}
        self._torque = self._new_torque()
        self._outputs = Outputs(node, robot, [DIAGNOSTICS, *others, *heard])
        self._polled = list[PolledSubscription]()
        self._inputs = self._subscribed(inputs)
        self.linkages = {
            name: MovingLinkage(
                simulator, self._subscribed(forces[name]), self._outputs.log_segment
            )
            for name, simulator in robot.simulators.items()
        }
        self._moving = {**self.linkages}  # without those whose motion has ended
        self._ticker = self._make_ticker()
        self._monitor = HealthMonitor(node.get_fully_qualified_name().lstrip('/'))
        self._lost: list[str] = []  # warnings in the last report about sources of messages

    def _subscribed(self, sources: Mapping[Topic, Any]) -> list[tuple[PolledSubscription, Any]]:
        """Subscribes to topics; returns each subscription with the reader of its messages."""
        subscribed = list[tuple[PolledSubscription, Any]]()
        for topic, source in sources.items():
            log = self._outputs.log_message
            subscription = PolledSubscription(self._node, topic, source.read, log)
            self._polled.append(subscription)
            subscribed.append((subscription, source))
        return subscribed

    def _make_ticker(self) -> Ticker:
        callbacks = self._robot.ticks, self._tick, self._restamp, self._fail
        if self._robot.drive.is_measured:
            ((measured, _),) = self._inputs
            receive = functools.partial(self._measurements, measured)
            return Ticker(self._robot.ticks, self._answer, self._restamp, self._fail, receive)
        if not self._node.get_parameter('use_sim_time').value:
            return RealTimeTicker(*callbacks)
        clock = PolledSubscription(self._node, SIMULATED_CLOCK, read_clock, lambda *_: None)
        self._polled.append(clock)
        return SimTimeTicker(*callbacks, clock.receive)

    def _new_torque(self) -> CommandedTorque:
        robot = self._robot
        return CommandedTorque(robot.names, self._send_zeros, robot.drive.measurement_timeout)

    def announce(self) -> None:
        """Waits for existing subscribers, and publishes the descriptions of the linkages."""
        wait_for_subscribers([state.publisher for state in self._states.values()])
        freeze_heap()
        # Publish these before the first tick, for which simulated time may have to wait.
        for topic, message in self._robot.descriptions().items():
            self._publish(topic, message)

    def notes(self) -> Iterator[str]:
        """Yields likely mistakes to report at the start."""
        for subscription, source in self._inputs:
            yield from source.notes(subscription.name)

    def start(self) -> None:
        """Starts the motion, also with the messages received so far."""
        self._ticker.start()

    def resume(self) -> None:
        """Starts or continues the motion, without the messages received while it was at rest."""
        for subscription in self._polled:
            subscription.discard()
        for _, source in self._sources():
            source.resume()
        self._torque = self._new_torque()
        self._ticker.start()

    def pause(self, cause: str, join: Callable[..., object]) -> bool:
        """Stops the motion and ends the torques; returns whether the last tick has ended.

        The cause is that of the torques' end, unless an error has ended the motion. `join` waits
        for a thread, with a time limit.
        """
        self._ticker.stop(functools.partial(join, timeout=_LAST_TICK_SECONDS))
        self._end_torques(cause)
        if self._ticker.stop(join):
            return True
        self._node.get_logger().error('a tick hangs, and the motion ends without it')
        return False

    def close(self, join: Callable[..., object]) -> bool:
        """Reports totals, and completes log and view; returns whether the log is complete."""
        try:
            self._report_totals()
        finally:
            is_complete = self._outputs.close(join)
        return is_complete

    @property
    def has_failed(self) -> bool:
        """Whether an error ended the motion of a linkage."""
        return self.error is not None or bool(self._ended)

    def _sources(self) -> list[tuple[PolledSubscription, Any]]:
        """Returns all subscriptions, each with the reader of its messages."""
        forces = (linkage.forces for linkage in self.linkages.values())
        return [*self._inputs, *chain.from_iterable(forces)]

    def _lost_sources(self) -> list[str]:
        """Returns the warnings about sources of messages that are lost."""
        return [line for topic, x in self._sources() for line in x.troubles(topic.name)]

    def _report_totals(self) -> None:
        counts, health = self._ticker.counts, self._outputs.health()
        lost = [
            f', {one.dropped} lost to the {part}' for part, one in health.items() if one.dropped
        ]
        ended = ', '.join(filter(None, self._ended))
        self._node.get_logger().info(
            f'{counted(counts.kept, "state")}, '
            f'{counted(counts.missed, "tick")} missed, '
            f'{counted(counts.clock_steps, "clock step")}, latest tick '
            f'{counts.max_lateness / NS_PER_MS:.1f} ms late{"".join(lost)}'
            f'{f"; ended early: {ended}" * bool(ended)}'
        )

    def _tick(self, stamp: int) -> None:
        """Computes and publishes the state of a tick; runs in the ticker's thread."""
        start = self._ticker.t0
        motions = self._after_messages(stamp, start) if self._inputs else {}
        parts = self._each(
            stamp, self._moving, lambda one: one.step(stamp, start, motions.get(one.name))
        )
        self._publish_state(stamp, parts)
        if self._trajectory:
            self._publish_trajectory(stamp, self._trajectory)

    def _each(
        self, stamp: int, names: Iterable[str], do: Callable[[MovingLinkage], _T]
    ) -> dict[str, _T]:
        """Calls a function with linkages, at the stamp of a state, ns; returns the results.

        Those whose motion has ended are left out; an error of one ends only its own motion.

        Raises:
            LinkageError: The motion of the last linkage ends.
        """
        results: dict[str, _T] = {}
        for name in [*names]:
            if linkage := self._moving.get(name):
                try:
                    results[name] = do(linkage)
                except LinkageError as error:
                    self._end_motion(name, stamp, error)
        return results

    def _end_motion(self, name: str, stamp: int, error: LinkageError) -> None:
        """Ends the motion of a linkage; the others continue.

        Raises:
            LinkageError: No other linkage is moving.
        """
        self._ended[name] = error
        del self._moving[name]
        if not self._moving:
            raise error
        self._node.get_logger().error(f'{name}: {error}; the other linkages continue')
        self._torque.clear([name])
        for _, source in self._inputs:
            source.sources[name].has_ended = True
        self._outputs.log_event(LinkageEnd(stamp, str(error), name))
        if self._robot.drive.is_measured:  # the next state of another linkage may never come
            self._torque.end([name], END_OF_MOTION)

    def _after_messages(self, stamp: int, start: int) -> dict[str, Motion]:
        """Returns the motions after the messages since the last tick, given it and tick 0, ns."""
        motions = self._each(stamp, self._moving, lambda one: one.begin_tick(stamp, start))
        for subscription, source in self._inputs:
            motions = self._received(subscription, source, motions, stamp, stamp - start)
        return motions

    def _received(
        self,
        subscription: PolledSubscription,
        source: SharedInput,
        motions: Mapping[str, Motion],
        stamp: int,
        elapsed: int,
    ) -> dict[str, Motion]:
        """Applies the messages of a subscription to the motions; see `Input.applied`."""
        for name, motion in motions.items():
            source.sources[name].prepare(motion, stamp)
        messages: list[Received] = [*subscription.take()]

        def applied(linkage: MovingLinkage) -> Motion:
            name = linkage.name
            values = [message.values[name] for message in messages if name in message.values]
            return source.sources[name].applied(motions[name], stamp, elapsed, values)

        return self._each(stamp, motions, applied)

    def _measurements(self, measured: PolledSubscription) -> Iterator[tuple[Received]]:
        """Waits for measurements; ends the torques of those that stop or are invalid."""
        for received in measured.receive(self._torque.seconds_left):
            self._torque.end(received.invalid, INVALID_MEASUREMENT)
            if received.values:
                yield (received,)
        self._torque.end_if_due()

    def _answer(self, received: Received) -> None:
        """Publishes the state of a measurement; runs in the ticker's thread."""
        stamp, _ = next(iter(received.values.values()))
        # Of all, because a force acts from the next state on, even if that lacks its linkage.
        conditions = {name: linkage.conditions(stamp) for name, linkage in self._moving.items()}
        moments = dict[str, Moment]()
        for name, (_, measured) in received.values.items():
            if name in self._moving:
                coordinates = self._moving[name].measured(stamp, measured, conditions[name])
                moments[name] = coordinates, self._crank(name).later(coordinates)
        self._publish_state(stamp, self._each(stamp, moments, lambda x: x.part(*moments[x.name])))

    def _crank(self, name: str) -> MeasuredCrank:
        """Returns the reader of the measured crank of a linkage."""
        ((_, cranks),) = self._inputs
        return cast('MeasuredCrank', cranks.sources[name])

    def _restamp(self, old: int, new: int) -> None:
        for linkage in self._moving.values():
            linkage.restamp(old, new)

    def _publish_state(self, stamp: int, parts: Mapping[str, RowPart]) -> None:
        """Publishes, logs and shows the state at a stamp.

        Args:
            stamp: The stamp, ns.
            parts: Numbers of each linkage in the state, by name.
        """
        if not parts:
            return
        names = tuple(parts)
        numbers = self._robot.row(parts, self._torque.efforts)
        templates = self._robot.templates.of(names)
        messages = templates.pack(stamp, numbers)
        now = time.time_ns()
        for topic, place in templates.slices.items():
            published = self._states[topic.name]
            if published.is_heard:
                published.publisher.publish(messages[place])
        self._outputs.log_state(LoggedState(now, messages, names))
        if self._robot.has_efforts:
            self._torque.renew(parts)
        if self._outputs.has_view:
            states = {name: state for name in names if (state := self.linkages[name].state)}
            self._outputs.show(stamp, states)

    def _publish_trajectory(self, stamp: int, ahead: TrajectoryAhead) -> None:
        """Publishes the trajectory ahead of a stamp, if one is due."""
        motions = {name: x.motion for name, x in self._moving.items() if x.motion}
        if (message := ahead.message_at(motions, stamp)) is not None:
            self._publish(ahead.topic, message)
            self._torque.renew({})

    def _send_zeros(self, end: TorqueEnd) -> None:
        """Sends and logs torques of 0 on each topic of commands."""
        zeros, drive = dict[str, bytes](), self._robot.drive
        if drive.effort_command_topic:
            efforts = [*self._torque.efforts.values()]
            zeros[drive.effort_command_topic] = encode_efforts(efforts)
        places = {
            name: float(x.coordinates.unwrapped)
            for name, x in self.linkages.items() if x.coordinates
        }  # fmt: skip
        if self._trajectory and len(places) == len(self.linkages):
            zeros[drive.trajectory_command_topic] = self._trajectory.zero(places)
        for name, message in zeros.items():
            self._publisher_of[name].publish(message)
        if zeros:
            self._outputs.log_torque_end(end, zeros)

    def _publish(self, topic: Topic, message: bytes) -> None:
        """Publishes and logs a message that is not part of a state."""
        self._publisher_of[topic.name].publish(message)
        self._outputs.log_message(time.time_ns(), topic, message)

    def has_news(self) -> bool:
        """Returns whether a source of messages was lost or has returned since the last report."""
        return self._lost_sources() != self._lost

    def report(self, state: str = '') -> None:
        """Publishes the diagnostics, and logs new warnings and the ends of warnings.

        The state is that of a managed node.
        """
        for published in self._states.values():
            published.count()
        figures = dict[str, str]()
        for linkage in self.linkages.values():
            figures.update(linkage.figures())
        for _, source in self._inputs:
            figures.update(source.diagnostics())
        health = self._outputs.health()
        troubles = self._troubles() if state in {'', ACTIVE} else []
        statuses = self._monitor.report(self._ticker.counts, figures, health, troubles, state)
        self._log_news(statuses)
        now = self._node.get_clock().now().nanoseconds  # 0 until the first /clock message
        kinds = (x.kind.mechanism for x in self._robot.configuration.linkages)
        hardware = ', '.join(dict.fromkeys(kinds))
        self._publish(DIAGNOSTICS, encode_diagnostics(now, hardware, statuses))

    def _log_news(self, statuses: Sequence[Status]) -> None:
        """Logs first states, new warnings and the ends of warnings, and ranges that were left."""
        logger = self._node.get_logger()
        for name, linkage in self.linkages.items():
            if linkage.first:  # it shows which assembly it is
                words = linkage.simulator.joint_words(linkage.first)
                logger.info(f'{prefix_of(name, ": ")}first state: {words}')
                linkage.first = ()
        for status in self._monitor.changes(statuses):
            if status.level == WARN:
                logger.warning(status.message)
            else:
                logger.info(status.message)
        for name, linkage in self.linkages.items():
            for line in linkage.ranges.notes():
                logger.warning(f'{prefix_of(name, ": ")}{line}')

    def _troubles(self) -> list[str]:
        """Returns the current warnings about the motion."""
        has_states = any(linkage.state for linkage in self.linkages.values())
        is_waiting = isinstance(self._ticker, SimTimeTicker) and not has_states
        if not self._ticker.is_stopped:  # otherwise, nothing is received any more
            self._lost = self._lost_sources()
        troubles = ['waiting for /clock'] * is_waiting + self._lost
        ended = [*self._ended]  # a copy: the ticker's thread may add to it
        troubles += [f'{name}: the motion has ended' for name in ended if name]
        for subscription in self._polled:
            troubles += subscription.mistyped()
        return troubles

    def fail(self, error: BaseException) -> None:
        """Ends the motion and the torques because of an error in a report."""
        self._ticker.stop(functools.partial(threading.Thread.join, timeout=_LAST_TICK_SECONDS))
        self._fail(error)

    def _fail(self, error: BaseException) -> None:
        """Ends the torques because of an error, after the last tick."""
        if self.error:
            return
        self.error = error
        words = str(error)
        if not isinstance(error, LinkageError):
            words = f'the motion ends here: {type(error).__name__}: {error}'
        linkage = next((name for name, own in self._ended.items() if own is error), '')
        self._node.get_logger().fatal(f'{prefix_of(linkage, ": ")}{words}')
        cause = END_OF_MOTION if isinstance(error, MotionError) else 'error'
        self._end_torques(cause)
        self._on_failure()

    def _end_torques(self, cause: str) -> None:
        """Sends torques of 0, and waits for their delivery; reports if ROS has ended before."""
        drive = self._robot.drive
        topics = drive.effort_command_topic, drive.trajectory_command_topic
        try:
            self._torque.end_for_good(cause)
            wait_for_delivery([self._publisher_of[name] for name in topics if name])
        except RuntimeError as error:  # RCLError, which has no public name
            words = one_line(str(error))
            self._node.get_logger().fatal(f'a torque of 0 cannot be sent: {words}')
