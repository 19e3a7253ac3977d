# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_node: runs a mechanism on ROS 2, and publishes its states and driving torque."""

import functools
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any

from rclpy.publisher import Publisher

from linkage_ros import cli
from linkage_ros.errors import LinkageError, MotionError
from linkage_ros.log.records import TorqueEnd
from linkage_ros.log.rows import LoggedState
from linkage_ros.mechanism.conditions import OWN_CONDITIONS, Conditions
from linkage_ros.mechanism.kinematics import State
from linkage_ros.mechanism.ranges import Ranges
from linkage_ros.messages.cdr import WARN, encode_diagnostics
from linkage_ros.messages.templates import ZERO_EFFORT
from linkage_ros.messages.topics import (
    DIAGNOSTICS,
    ROBOT_DESCRIPTION,
    SIMULATED_CLOCK,
    Topic,
)
from linkage_ros.motion.drives.follow import MeasuredCrank
from linkage_ros.motion.measured import FollowSegment
from linkage_ros.motion.segments import Coordinates, Gravity, Motion, Segment
from linkage_ros.node.commanded_torque import CommandedTorque
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
from linkage_ros.node.outputs import Outputs
from linkage_ros.node.parameter_node import ParameterNode, given_values
from linkage_ros.node.process import reported_as_configuration, run_program
from linkage_ros.node.ticker import RealTimeTicker, SimTimeTicker, Ticker
from linkage_ros.node.workers import accompany_ticker, freeze_heap
from linkage_ros.quantities import build, counted, flatten
from linkage_ros.run.states import Simulator
from linkage_ros.run.trajectory_ahead import TrajectoryAhead
from linkage_ros.settings.configuration import configure, preset_note
from linkage_ros.settings.help import node_parser
from linkage_ros.settings.notes import notes
from linkage_ros.settings.parameters import parameter_leaves
from linkage_ros.settings.summary import summary
from linkage_ros.units import NS_PER_MS

_NAME = 'linkage_node'
# Time for a tick to end before the zero is sent that ends the torque, s. It must not wait for a
# tick that hangs.
_LAST_TICK_SECONDS = 0.1
_REPORT_SECONDS, _WATCH_SECONDS = 1.0, 0.05  # between reports, and between looks for news


class LinkageNode(ParameterNode):
    """Publishes the states of a mechanism.

    Published topics: those of the simulator, while they have subscribers; robot_description;
    and /diagnostics, once a second.
    Subscribed topics: /clock, if use_sim_time is true; commands or measurements, depending on the
    drive.
    Parameters: those of the configuration. rpm, motor.torque and, unless the drive is a torque,
    gravity may be set at any time.
    """

    def __init__(self, stop: cli.Stop) -> None:
        super().__init__(_NAME)
        given = given_values(self)
        configuration = configure(given)
        self._stop, self._drive = stop, configuration.drive  # set_live replaces the drive
        values = configuration.parameters()
        values.setdefault('start_rpm', values.get('rpm'))  # the effective default
        self.declare(parameter_leaves(configuration.kind, values), values)
        self._simulator = simulator = Simulator(configuration)
        simulator.prepare_live()
        self._ranges = Ranges(simulator.solver)
        self._gravity: Gravity | None = None  # set while running
        self._motion: Motion | None = None
        self._segment: Segment | None = None  # the last logged segment
        self._state: State | None = None
        self._coordinates: Coordinates | None = None  # those of the state
        self._first: Sequence[float] = ()  # numbers of the first state, until they are reported
        others, inputs, forces = [DIAGNOSTICS], simulator.inputs(), simulator.live_forces()
        heard: dict[Topic, Any] = {**inputs, **forces}
        if simulator.description:
            others.append(ROBOT_DESCRIPTION)
        self._trajectory: TrajectoryAhead | None = None
        if self._drive.trajectory_command_topic:
            self._trajectory = TrajectoryAhead(simulator)
            others.append(self._trajectory.topic)
        with reported_as_configuration():  # a topic name may be invalid
            require_distinct(self, [*heard, *simulator.templates.topics, *others])
            # Each with the place of its message among those of a state.
            self._states = [
                (StatePublisher(self, topic), place)
                for topic, place in simulator.templates.slices.items()
            ]
            self._publisher_of = {topic.name: create_publisher(self, topic) for topic in others}
            for topic, (state, _) in zip(simulator.templates.slices, self._states, strict=True):
                self._publisher_of[topic.name] = state.publisher
        self._torque = CommandedTorque(self._send_zeros, self._drive.measurement_timeout)
        self._outputs = Outputs(self, simulator, [*others, *heard])
        self._inputs, self._forces = self._subscribed(inputs), self._subscribed(forces)
        self._ticker = self._make_ticker()
        name = self.get_fully_qualified_name().lstrip('/')
        self._monitor = HealthMonitor(name)
        self.get_logger().info(preset_note(given) + summary(configuration, simulator.solver))
        for line in notes(configuration):
            self.get_logger().warning(line)
        for subscription, source in self._inputs:
            for line in source.notes(subscription.name):
                self.get_logger().warning(line)
        wait_for_subscribers([state.publisher for state, _ in self._states])
        self._lost: list[str] = []  # warnings in the last report about sources of messages
        freeze_heap()

    def _subscribed(self, sources: Mapping[Topic, Any]) -> list[tuple[PolledSubscription, Any]]:
        """Subscribes to topics; returns each subscription with the reader of its messages."""
        log = self._outputs.log_message
        return [
            (PolledSubscription(self, topic, source.read, log), source)
            for topic, source in sources.items()
        ]

    def _make_ticker(self) -> Ticker:
        callbacks = self._simulator.ticks, self._tick, self._restamp, self._fail
        if self._drive.is_measured:
            ((measured, crank),) = self._inputs
            answer = functools.partial(self._answer, crank)
            receive = functools.partial(self._measurements, measured)
            return Ticker(self._simulator.ticks, answer, self._restamp, self._fail, receive)
        if not self.get_parameter('use_sim_time').value:
            return RealTimeTicker(*callbacks)
        clock = PolledSubscription(self, SIMULATED_CLOCK, read_clock, lambda *_: None)
        return SimTimeTicker(*callbacks, clock.receive)

    def work(self) -> int:
        """Runs the motion until the end is requested; returns the exit code."""
        # Publish this before the first tick, for which simulated time may have to wait.
        if self._simulator.description:
            self._publish(ROBOT_DESCRIPTION, self._simulator.description)
        self._ticker.start()
        self._report_until_stop()
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
        return 0 if succeeded and ended and not self._ticker.error else 1

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

    def _lost_sources(self) -> list[str]:
        """Returns the warnings about sources of messages that are lost."""
        sources = *self._inputs, *self._forces
        return [line for topic, source in sources for line in source.troubles(topic.name)]

    def _cause_of_end(self) -> str:
        error = self._ticker.error
        if error:
            return 'end of the motion' if isinstance(error, MotionError) else 'error'
        return self._stop.signal or 'end'

    def _report_totals(self) -> None:
        counts, health = self._ticker.counts, self._outputs.health()
        lost = [
            f', {one.dropped} lost to the {part}' for part, one in health.items() if one.dropped
        ]
        self.get_logger().info(
            f'{counted(counts.kept, "state")}, '
            f'{counted(counts.missed, "tick")} missed, '
            f'{counted(counts.clock_steps, "clock step")}, latest tick '
            f'{counts.max_lateness / NS_PER_MS:.1f} ms late{"".join(lost)}'
        )

    def _tick(self, stamp: int) -> None:
        """Computes and publishes the state of a tick; runs in the ticker's thread."""
        elapsed = stamp - self._ticker.t0
        motion = self._motion or self._continue(self._simulator.begin(self._ticker.t0))
        motion = motion.under(stamp, self._conditions(elapsed), self._drive)
        for subscription, source in self._inputs:
            motion = source.applied(motion, stamp, elapsed, subscription.take())
        ahead = self._simulator.ahead_of(motion, stamp)
        coordinates = motion.at(stamp)
        self._continue(motion)
        self._publish_state(stamp, coordinates, ahead)
        self._publish_trajectory(stamp, motion)

    def _measurements(self, measured: PolledSubscription) -> Iterator[tuple[int, Coordinates]]:
        """Waits for measurements; ends the torque if they stop."""
        yield from measured.receive(self._torque.seconds_left)
        self._torque.end_if_due()

    def _answer(self, crank: MeasuredCrank, stamp: int, coordinates: Coordinates) -> None:
        """Publishes the state of a measurement; runs in the ticker's thread."""
        under, gravity = self._conditions(stamp), self._gravity
        if under:
            under = replace(under, frame=coordinates.conditions.frame)
            coordinates = coordinates._replace(conditions=under)
        if gravity is not None and not (self._segment and self._segment.gravity == gravity):
            self._log_segment(FollowSegment(stamp, gravity))
        self._publish_state(stamp, coordinates, crank.later(coordinates))

    def _conditions(self, now: int) -> Conditions:
        """Returns gravity and forces of loads that act from now, ns, on."""
        forces = {
            source.name: source.force(now, subscription.take())
            for subscription, source in self._forces
        }
        if self._gravity is None and not forces:
            return OWN_CONDITIONS
        return Conditions(gravity=self._gravity, forces=forces)

    def _continue(self, motion: Motion) -> Motion:
        """Sets the current motion, and logs its segment if it is new."""
        if motion.segment is not self._segment:
            self._log_segment(motion.segment)
        self._motion = motion
        return motion

    def _log_segment(self, segment: Segment) -> None:
        self._segment = segment
        self._outputs.log_segment(segment)

    def _restamp(self, old: int, new: int) -> None:
        if self._motion is not None:
            self._continue(self._motion.restamp(old, new))

    def _publish_state(
        self, stamp: int, coordinates: Coordinates, ahead: Coordinates | None
    ) -> None:
        """Computes, publishes, logs and shows the state at a stamp, ns."""
        simulator = self._simulator
        self._state = state = simulator.state(coordinates)
        self._ranges.see(state)
        later = None if ahead is None else simulator.state(ahead)
        numbers = simulator.templates.numbers(state, coordinates.unwrapped, later)
        if not self._coordinates:
            self._first = numbers
        messages = simulator.templates.pack(stamp, numbers)
        self._coordinates = coordinates
        now = time.time_ns()
        for topic, place in self._states:
            if topic.is_heard:
                topic.publisher.publish(messages[place])
        self._outputs.log_state(LoggedState(now, messages))
        self._torque.renew()
        self._outputs.show(stamp, state)

    def _publish_trajectory(self, stamp: int, motion: Motion) -> None:
        """Publishes the trajectory ahead of a stamp, if one is due."""
        ahead = self._trajectory
        if ahead and (message := ahead.message_at(motion, stamp)) is not None:
            self._publish(ahead.topic, message)

    def _command_publishers(self) -> dict[str, Publisher]:
        """Returns the publishers of commands for controllers, by name of the topic."""
        topics = self._drive.effort_command_topic, self._drive.trajectory_command_topic
        return {name: self._publisher_of[name] for name in topics if name}

    def _send_zeros(self, end: TorqueEnd) -> None:
        """Sends and logs a torque of 0 on each topic of commands."""
        zeros, drive = dict[str, bytes](), self._drive
        if drive.effort_command_topic:
            zeros[drive.effort_command_topic] = ZERO_EFFORT
        if self._trajectory and self._coordinates:
            place = float(self._coordinates.unwrapped)
            zeros[drive.trajectory_command_topic] = self._trajectory.zero(place)
        for name, message in zeros.items():
            self._publisher_of[name].publish(message)
        if zeros:
            self._outputs.log_torque_end(end, zeros)

    def _publish(self, topic: Topic, message: bytes) -> None:
        """Publishes and logs a message that is not part of a state."""
        self._publisher_of[topic.name].publish(message)
        self._outputs.log_message(time.time_ns(), topic, message)

    def set_live(self, name: str, value: Any) -> None:
        """Sets rpm, motor.torque or gravity, with effect from the next tick on."""
        if name == 'gravity':
            # Compile the program before the tick needs it.
            last, under = self._coordinates, self._simulator.conditions
            angle = last.q[0] if last else 0.0
            under = replace(last.conditions if last else under, gravity=value)
            with suppress(LinkageError):
                self._simulator.solver.state(angle, 1.0, 1.0, under=under)
            self._gravity = value
            return
        self._drive = build(type(self._drive), {**flatten(self._drive), name: value})

    def _report(self) -> None:
        """Publishes the diagnostics, and logs new warnings and the ends of warnings."""
        for topic, _ in self._states:
            topic.count()
        is_waiting = isinstance(self._ticker, SimTimeTicker) and not self._state
        figures, self._lost = self._figures(), self._lost_sources()
        troubles = ['waiting for /clock'] * is_waiting + self._lost
        for subscription, source in (*self._inputs, *self._forces):
            troubles += subscription.mistyped()
            figures.update(source.diagnostics())
        health = self._outputs.health()
        statuses = self._monitor.report(self._ticker.counts, figures, health, troubles)
        logger = self.get_logger()
        if self._first:  # shows which assembly it is
            logger.info(f'first state: {self._simulator.joint_words(self._first)}')
            self._first = ()
        for status in self._monitor.changes(statuses):
            if status.level == WARN:
                logger.warning(status.message)
            else:
                logger.info(status.message)
        for line in self._ranges.notes():
            logger.warning(line)
        now = self.get_clock().now().nanoseconds  # 0 until the first /clock message
        hardware = self._simulator.configuration.kind.mechanism
        self._publish(DIAGNOSTICS, encode_diagnostics(now, hardware, statuses))

    def _figures(self) -> dict[str, str]:
        if self._state is None:
            return {}
        structure = self._simulator.solver.structure
        joint, residual = structure.driven_link, structure.loop_residual(self._state)
        force = 'driving force' if joint.slides else 'driving torque'
        return {
            f'{joint.name} speed, {joint.units.velocity}': (
                f'{self._state.velocity[structure.driven]:.6g}'
            ),
            f'{force}, {joint.units.effort}': f'{self._state.torque:.6g}',
            'loop residual, m': f'{residual:.3g}',
        }

    def _fail(self, error: BaseException) -> None:
        kind = (
            ''
            if isinstance(error, LinkageError)
            else f'the motion ends here: {type(error).__name__}: '
        )
        self.get_logger().fatal(f'{kind}{error}')
        self._stop.set()


def main() -> int:
    """Runs `linkage_node`; returns the exit code. `cli.run` reports its errors."""
    return run_program(sys.argv, node_parser(), LinkageNode)


if __name__ == '__main__':
    sys.exit(cli.leave(cli.run(_NAME, main)))
