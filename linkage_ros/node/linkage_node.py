# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_node: runs a mechanism on ROS 2, and publishes its states and driving torque."""

import functools
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from itertools import chain
from typing import Any, TypeAlias, TypeVar, cast

from rclpy.publisher import Publisher

from linkage_ros import cli
from linkage_ros.errors import LinkageError, MotionError, in_linkage
from linkage_ros.log.records import LinkageEnd, TorqueEnd
from linkage_ros.log.rows import LoggedState
from linkage_ros.messages.cdr import WARN, encode_diagnostics
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
from linkage_ros.node.health import HealthMonitor
from linkage_ros.node.moving_linkage import MovingLinkage
from linkage_ros.node.outputs import Outputs
from linkage_ros.node.parameter_node import ParameterNode, given_values
from linkage_ros.node.process import reported_as_configuration, run_program
from linkage_ros.node.ticker import RealTimeTicker, SimTimeTicker, Ticker
from linkage_ros.node.workers import accompany_ticker, freeze_heap
from linkage_ros.quantities import counted
from linkage_ros.run.robot import HeldEfforts, Robot
from linkage_ros.run.trajectory_ahead import TrajectoryAhead
from linkage_ros.settings.configuration import Configuration, configure, preset_note
from linkage_ros.settings.help import node_parser
from linkage_ros.settings.notes import notes
from linkage_ros.settings.parameters import OF_THE_RUN
from linkage_ros.settings.summary import summary
from linkage_ros.units import NS_PER_MS

_T = TypeVar('_T')
# Coordinates of a state, and those for the feed-forward torque.
Moment: TypeAlias = tuple[Coordinates, Coordinates | None]

_NAME = 'linkage_node'
# Time for a tick to end before the zero is sent that ends the torque, s. It must not wait for a
# tick that hangs.
_LAST_TICK_SECONDS = 0.1
_REPORT_SECONDS, _WATCH_SECONDS = 1.0, 0.05  # between reports, and between looks for news


class LinkageNode(ParameterNode):
    """Publishes the states of one or several linkages.

    Published topics: those of the states, while they have subscribers; robot_description;
    and /diagnostics, once a second.
    Subscribed topics: /clock, if use_sim_time is true; commands or measurements, depending on the
    drive.
    Parameters: those of the configuration. rpm, motor.torque and, unless the drive is a torque,
    gravity may be set at any time, for all linkages without a value of their own, or for one.
    """

    def __init__(self, stop: cli.Stop) -> None:
        super().__init__(_NAME)
        given = given_values(self)
        configuration = configure(given)
        self._stop = stop
        self._error: BaseException | None = None  # of a tick or a report, which ends the node
        self._own = {name: {*names} for name, names in configuration.own.items()}
        self._declare_all(configuration)
        self._robot = robot = Robot(configuration)
        for name, simulator in robot.simulators.items():
            with in_linkage(name):
                simulator.prepare_live()
        # Names of linkages whose motion has ended, each with the error.
        self._ended = dict[str, LinkageError]()
        self._held = HeldEfforts(robot.names)
        others, inputs, forces = [DIAGNOSTICS], robot.inputs(), robot.live_forces()
        heard: dict[Topic, Any] = {**inputs}
        for topics in forces.values():
            heard |= topics
        others += robot.descriptions()
        self._trajectory: TrajectoryAhead | None = None
        if robot.drive.trajectory_command_topic:
            self._trajectory = TrajectoryAhead(robot)
            others.append(self._trajectory.topic)
        with reported_as_configuration():  # a topic name may be invalid
            require_distinct(self, [*heard, *robot.templates.topics, *others])
            self._states = {
                topic.name: StatePublisher(self, topic) for topic in robot.templates.topics
            }
            self._publisher_of = {topic.name: create_publisher(self, topic) for topic in others}
            for name, state in self._states.items():
                self._publisher_of[name] = state.publisher
        self._torque = CommandedTorque(self._send_zeros, robot.drive.measurement_timeout)
        self._outputs = Outputs(self, robot, [*others, *heard])
        self._inputs = self._subscribed(inputs)
        self._linkages = {
            name: MovingLinkage(
                simulator, self._subscribed(forces[name]), self._outputs.log_segment
            )
            for name, simulator in robot.simulators.items()
        }
        self._moving = {**self._linkages}  # without those whose motion has ended
        self._ticker = self._make_ticker()
        name = self.get_fully_qualified_name().lstrip('/')
        self._monitor = HealthMonitor(name)
        for name, linkage in self._linkages.items():
            words = summary(linkage.simulator.linkage, linkage.simulator.solver)
            self.get_logger().info(f'{preset_note(given)}{prefix_of(name, ": ")}{words}')
        for line in notes(configuration):
            self.get_logger().warning(line)
        for subscription, source in self._inputs:
            for line in source.notes(subscription.name):
                self.get_logger().warning(line)
        wait_for_subscribers([state.publisher for state in self._states.values()])
        self._lost: list[str] = []  # warnings in the last report about sources of messages
        freeze_heap()

    def _declare_all(self, configuration: Configuration) -> None:
        """Declares the parameters, and those of each linkage that may be set while running."""
        values, leaves = configuration.parameters(), configuration.leaves()
        for linkage in configuration.linkages:
            prefix, own = prefix_of(linkage.name, '.'), linkage.parameters()
            for name, value in own.items():
                if leaves[f'{prefix}{name}' if name not in OF_THE_RUN else name].quantity.live:
                    values.setdefault(f'{prefix}{name}', value)
            if 'start_rpm' not in own and 'rpm' in own:
                values[f'{prefix}start_rpm'] = own['rpm']  # the effective default
        self.declare(leaves.values(), values)

    def _subscribed(self, sources: Mapping[Topic, Any]) -> list[tuple[PolledSubscription, Any]]:
        """Subscribes to topics; returns each subscription with the reader of its messages."""
        log = self._outputs.log_message
        return [
            (PolledSubscription(self, topic, source.read, log), source)
            for topic, source in sources.items()
        ]

    def _make_ticker(self) -> Ticker:
        callbacks = self._robot.ticks, self._tick, self._restamp, self._fail
        if self._robot.drive.is_measured:
            ((measured, _),) = self._inputs
            receive = functools.partial(self._measurements, measured)
            return Ticker(self._robot.ticks, self._answer, self._restamp, self._fail, receive)
        if not self.get_parameter('use_sim_time').value:
            return RealTimeTicker(*callbacks)
        clock = PolledSubscription(self, SIMULATED_CLOCK, read_clock, lambda *_: None)
        return SimTimeTicker(*callbacks, clock.receive)

    def work(self) -> int:
        """Runs the motion until the end is requested; returns the exit code."""
        # Publish these before the first tick, for which simulated time may have to wait.
        for topic, message in self._robot.descriptions().items():
            self._publish(topic, message)
        self._ticker.start()
        try:
            self._report_until_stop()
        except Exception as error:  # noqa: BLE001, whatever it is, the torque must end
            self._fail(error)
        self._ticker.stop(functools.partial(self._stop.join, timeout=_LAST_TICK_SECONDS))
        self._torque.end_for_good(self._cause_of_end())
        wait_for_delivery(self._command_publishers().values())
        ended = self._ticker.stop(self._stop.join)
        try:
            if ended:
                self._report()
            else:
                self.get_logger().error('a tick hangs, and the node ends without it')
            self._report_totals()
        finally:
            succeeded = self._outputs.close(self._stop.join)
        failed = self._error or self._ended
        return 0 if succeeded and ended and not failed else 1

    def _report_until_stop(self) -> None:
        """Reports once a second, and when a source of messages is lost or returns.

        Real time counts, because simulated time may be paused.
        """
        accompany_ticker()  # a tick may wait for the interpreter lock that a report holds
        due = time.monotonic() + _REPORT_SECONDS
        while not self._stop.wait(_WATCH_SECONDS):
            now = time.monotonic()
            if now >= due:
                due = max(due + _REPORT_SECONDS, now)
                self._report()
            elif self._lost_sources() != self._lost:
                self._report()

    def _sources(self) -> list[tuple[PolledSubscription, Any]]:
        """Returns all subscriptions, each with the reader of its messages."""
        forces = (linkage.forces for linkage in self._linkages.values())
        return [*self._inputs, *chain.from_iterable(forces)]

    def _lost_sources(self) -> list[str]:
        """Returns the warnings about sources of messages that are lost."""
        return [line for topic, x in self._sources() for line in x.troubles(topic.name)]

    def _cause_of_end(self) -> str:
        if self._error:
            return END_OF_MOTION if isinstance(self._error, MotionError) else 'error'
        return self._stop.signal or 'end'

    def _report_totals(self) -> None:
        counts, health = self._ticker.counts, self._outputs.health()
        lost = [
            f', {one.dropped} lost to the {part}' for part, one in health.items() if one.dropped
        ]
        ended = ', '.join(filter(None, self._ended))
        self.get_logger().info(
            f'{counted(counts.kept, "state")}, '
            f'{counted(counts.missed, "tick")} missed, '
            f'{counted(counts.clock_steps, "clock step")}, latest tick '
            f'{counts.max_lateness / NS_PER_MS:.1f} ms late{"".join(lost)}'
            f'{f"; ended early: {ended}" * bool(ended)}'
        )

    def _tick(self, stamp: int) -> None:
        """Computes and publishes the state of a tick; runs in the ticker's thread."""
        start = self._ticker.t0
        elapsed = stamp - start
        motions = self._each(stamp, self._moving, lambda x: x.begin_tick(stamp, start))
        for subscription, source in self._inputs:
            motions = self._received(subscription, source, motions, stamp, elapsed)
        found = self._each(stamp, motions, lambda x: x.at(stamp, motions[x.name]))
        self._publish_state(stamp, found)
        self._publish_trajectory(stamp)

    def _each(
        self, stamp: int, names: Iterable[str], do: Callable[[MovingLinkage], _T]
    ) -> dict[str, _T]:
        """Calls a function with moving linkages; an error of one ends only its own motion.

        Args:
            stamp: Stamp of the current state, ns.
            names: Names of linkages; those whose motion has ended are left out.
            do: The function.

        Returns:
            The results by linkage.

        Raises:
            LinkageError: The motion of the last linkage ends.
        """
        found = dict[str, _T]()
        for name in [name for name in names if name in self._moving]:
            try:
                found[name] = do(self._moving[name])
            except LinkageError as error:  # noqa: PERF203, one must not affect the others
                self._end_motion(name, stamp, error)
        return found

    def _end_motion(self, name: str, stamp: int, error: LinkageError) -> None:
        """Ends the motion of a linkage; the others continue.

        Raises:
            LinkageError: There is no other.
        """
        self._ended[name] = error
        del self._moving[name]
        if not self._moving:
            raise error
        self.get_logger().error(f'{name}: {error}; the other linkages continue')
        self._held.end([name])
        for _, source in self._inputs:
            source.sources[name].has_ended = True
        self._outputs.log_linkage_end(LinkageEnd(stamp, str(error), name))
        if self._robot.drive.is_measured:  # the next state of another linkage may never come
            self._torque.end([name], END_OF_MOTION)

    def _received(
        self,
        subscription: PolledSubscription,
        source: SharedInput,
        motions: Mapping[str, Motion],
        stamp: int,
        elapsed: int,
    ) -> dict[str, Motion]:
        """Applies the messages received since the last tick to the motions, by linkage."""
        for name, motion in motions.items():
            source.sources[name].prepare(motion, stamp)
        received = [*subscription.take()]

        def applied(linkage: MovingLinkage) -> Motion:
            name = linkage.name
            values = [one.values[name] for one in received if name in one.values]
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
        under = {name: linkage.conditions(stamp) for name, linkage in self._moving.items()}
        found = dict[str, Moment]()
        for name, (_, coordinates) in received.values.items():
            if name in self._moving:
                now = self._moving[name].measured(stamp, coordinates, under[name])
                found[name] = now, self._crank(name).later(now)
        self._publish_state(stamp, found)

    def _crank(self, name: str) -> MeasuredCrank:
        """Returns the reader of the measured crank of a linkage."""
        ((_, cranks),) = self._inputs
        return cast('MeasuredCrank', cranks.sources[name])

    def _restamp(self, old: int, new: int) -> None:
        for linkage in self._moving.values():
            linkage.restamp(old, new)

    def _publish_state(self, stamp: int, found: Mapping[str, Moment]) -> None:
        """Computes, publishes, logs and shows the state at a stamp.

        Args:
            stamp: The stamp, ns.
            found: Coordinates of each linkage in the state, and those ahead, by name.
        """
        parts = self._each(stamp, found, lambda x: x.part(*found[x.name]))
        if not parts:
            return
        names = tuple(parts)
        numbers = self._robot.row(parts, self._held.values)
        self._held.hold(parts)
        templates = self._robot.templates.of(names)
        messages = templates.pack(stamp, numbers)
        now = time.time_ns()
        for topic, place in templates.slices.items():
            state = self._states[topic.name]
            if state.is_heard:
                state.publisher.publish(messages[place])
        self._outputs.log_state(LoggedState(now, messages, names))
        self._torque.renew(names)
        states = {name: one for name in names if (one := self._linkages[name].state)}
        self._outputs.show(stamp, states)

    def _publish_trajectory(self, stamp: int) -> None:
        """Publishes the trajectory ahead of a stamp, if one is due."""
        ahead = self._trajectory
        if not ahead:
            return
        motions = {name: x.motion for name, x in self._moving.items() if x.motion}
        if (message := ahead.message_at(motions, stamp)) is not None:
            self._publish(ahead.topic, message)

    def _command_publishers(self) -> dict[str, Publisher]:
        """Returns the publishers of commands for controllers, by name of the topic."""
        drive = self._robot.drive
        topics = drive.effort_command_topic, drive.trajectory_command_topic
        return {name: self._publisher_of[name] for name in topics if name}

    def _send_zeros(self, end: TorqueEnd) -> None:
        """Sends and logs torques of 0 on each topic of commands."""
        zeros, drive = dict[str, bytes](), self._robot.drive
        self._held.end([end.linkage] if end.linkage else self._linkages)
        if drive.effort_command_topic:
            efforts = [*self._held.values.values()]
            zeros[drive.effort_command_topic] = encode_efforts(efforts)
        places = {
            name: float(x.coordinates.unwrapped)
            for name, x in self._linkages.items() if x.coordinates
        }  # fmt: skip
        if self._trajectory and len(places) == len(self._linkages):
            zeros[drive.trajectory_command_topic] = self._trajectory.zero(places)
        for name, message in zeros.items():
            self._publisher_of[name].publish(message)
        if zeros:
            self._outputs.log_torque_end(end, zeros)

    def _publish(self, topic: Topic, message: bytes) -> None:
        """Publishes and logs a message that is not part of a state."""
        self._publisher_of[topic.name].publish(message)
        self._outputs.log_message(time.time_ns(), topic, message)

    def set_live(self, name: str, value: Any) -> None:
        """Sets a parameter of one linkage, or of all that have no value of their own."""
        first, _, rest = name.partition('.')
        if first in self._own:
            self._own[first].add(rest)
            self._linkages[first].set_live(rest, value)
            return
        for linkage in self._linkages.values():
            if name in self._own.get(linkage.name, ()):
                continue
            linkage.set_live(name, value)
            if linkage.name:
                self.show_value(f'{linkage.name}.{name}', value)

    def _report(self) -> None:
        """Publishes the diagnostics, and logs new warnings and the ends of warnings."""
        for state in self._states.values():
            state.count()
        figures = dict[str, str]()
        for linkage in self._linkages.values():
            figures.update(linkage.figures())
        for _, source in self._inputs:
            figures.update(source.diagnostics())
        health, troubles = self._outputs.health(), self._troubles()
        statuses = self._monitor.report(self._ticker.counts, figures, health, troubles)
        logger = self.get_logger()
        for line in self._first_states():
            logger.info(line)
        for status in self._monitor.changes(statuses):
            if status.level == WARN:
                logger.warning(status.message)
            else:
                logger.info(status.message)
        for name, linkage in self._linkages.items():
            for line in linkage.ranges.notes():
                logger.warning(f'{prefix_of(name, ": ")}{line}')
        now = self.get_clock().now().nanoseconds  # 0 until the first /clock message
        kinds = (x.kind.mechanism for x in self._robot.configuration.linkages)
        hardware = ', '.join(dict.fromkeys(kinds))
        self._publish(DIAGNOSTICS, encode_diagnostics(now, hardware, statuses))

    def _troubles(self) -> list[str]:
        """Returns the current warnings about the motion."""
        has_states = any(linkage.state for linkage in self._linkages.values())
        is_waiting = isinstance(self._ticker, SimTimeTicker) and not has_states
        self._lost = self._lost_sources()
        troubles = ['waiting for /clock'] * is_waiting + self._lost
        ended = [*self._ended]  # a copy: the ticker's thread may add to it
        troubles += [f'{name}: the motion has ended' for name in ended if name]
        for subscription, _ in self._sources():
            troubles += subscription.mistyped()
        return troubles

    def _first_states(self) -> Iterator[str]:
        """Yields the joints of first states, once; they show which assembly it is."""
        for name, linkage in self._linkages.items():
            if linkage.first:
                words = linkage.simulator.joint_words(linkage.first)
                yield f'{prefix_of(name, ": ")}first state: {words}'
                linkage.first = ()

    def _fail(self, error: BaseException) -> None:
        """Ends the node because of an error in a tick or a report."""
        self._error = self._error or error
        kind = (
            ''
            if isinstance(error, LinkageError)
            else f'the motion ends here: {type(error).__name__}: '
        )
        whose = next((name for name, x in self._ended.items() if x is error), '')
        self.get_logger().fatal(f'{prefix_of(whose, ": ")}{kind}{error}')
        self._stop.set()


def main() -> int:
    """Runs `linkage_node`; returns the exit code. `cli.run` reports its errors."""
    return run_program(sys.argv, node_parser(), LinkageNode)


if __name__ == '__main__':
    sys.exit(cli.leave(cli.run(_NAME, main)))
