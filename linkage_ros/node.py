# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_node: turns the crank on ROS 2; publishes the states and the driving torque."""

from __future__ import annotations

import argparse
import sys
import time
from typing import TYPE_CHECKING

from rclpy.clock import Clock, ClockType

from linkage_ros import cli
from linkage_ros.dynamics.state import State, loop_residual
from linkage_ros.errors import LinkageError, LogError
from linkage_ros.motion.drives import Drive, FollowDrive, TorqueDrive
from linkage_ros.motion.torque_driven import Motion, TorqueMotion
from linkage_ros.parameters.configuration import Configuration, configure, preset_note
from linkage_ros.parameters.descriptions import help_on_every_kind, summary
from linkage_ros.quantities import build, flatten
from linkage_ros.ros.parameters import (
    ParameterNode,
    declare,
    given_values,
)
from linkage_ros.ros.process import (
    reported_as_configuration,
    ros_program,
    spinning,
)
from linkage_ros.ros.publishers import create_publishers, wait_for_subscribers
from linkage_ros.ros.subscribers import (
    CommandSubscriber,
    MeasurementSubscriber,
    subscribe_to_clock,
)
from linkage_ros.run.crank_trajectory import CrankTrajectory
from linkage_ros.run.health import WINDOW, Health, HealthMonitor
from linkage_ros.run.scheduling import freeze_heap
from linkage_ros.run.simulator import Simulator, Snapshot
from linkage_ros.run.ticker import (
    Callbacks,
    MeasurementTicker,
    RealTimeTicker,
    SimTimeTicker,
    Ticker,
)
from linkage_ros.units import NS_PER_MS, NS_PER_S
from linkage_ros.wire.diagnostics import WARN, encode_diagnostics
from linkage_ros.wire.topics import (
    DIAGNOSTICS,
    ROBOT_DESCRIPTION,
    Topic,
)

# MCAP and Rerun may be missing: they are imported where a log is written and a view opens.
if TYPE_CHECKING:
    from linkage_ros.ros.live_view import LiveView
    from linkage_ros.ros.run_log import RunLog

_NAME = 'linkage_node'


class LinkageNode(ParameterNode):
    """Publishes the states of one mechanism at its rate.

    Publishes: the topics of the simulator, robot_description and, once a second, /diagnostics.
    Subscribes: /clock, with use_sim_time; joint_commands, where a torque drives the mechanism.
    Parameters: those of the configuration; rpm or motor.torque may be set at any time.
    """

    def __init__(self, stop: cli.Stop) -> None:
        with reported_as_configuration():
            super().__init__(_NAME)
        given = given_values(self)
        configuration = configure(given)
        declare(self, configuration, self._set_live)
        self._stop = stop
        self._simulator = Simulator(configuration)
        self._simulator.prepare_live()
        self._ahead = CrankTrajectory.of(self._simulator)
        self._other_topics = (
            ROBOT_DESCRIPTION, DIAGNOSTICS, *([self._ahead.topic] if self._ahead else []),
        )  # fmt: skip
        self._hardware_id = configuration.kind.mechanism
        self._drive: Drive = configuration.drive  # with what was set since the start
        self._joint_commands: CommandSubscriber | None = None
        self._measurements: MeasurementSubscriber | None = None
        with reported_as_configuration():  # a topic may have the name of another
            topics = *self._simulator.topics, *self._other_topics
            self._output_publishers = create_publishers(self, topics)
            outputs = self._output_publishers
            if isinstance(self._drive, TorqueDrive):
                crank = self._simulator.crank_joint
                self._joint_commands = CommandSubscriber(self, self._drive, crank, outputs)
            if isinstance(self._drive, FollowDrive):
                self._measurements = MeasurementSubscriber(self, self._simulator, outputs)
        self._state_publishers = [
            self._output_publishers[topic.name] for topic in self._simulator.topics
        ]
        self._view = self._open_view(configuration) if configuration.session.viewer else None
        try:
            self._log = self._open_log() if configuration.session.log else None
        except (LogError, ImportError):
            if self._view is not None:
                self._view.discard()
            raise
        self._ticker = self._make_ticker(simulated=self.get_parameter('use_sim_time').value)
        self._motion: Motion | None = None
        self._state: State | None = None
        self.get_logger().info(preset_note(given) + summary(configuration, self._simulator.solver))
        wait_for_subscribers(self._state_publishers)
        freeze_heap()
        name = self.get_fully_qualified_name().lstrip('/')
        self._monitor = HealthMonitor(name, is_torque_driven=bool(self._joint_commands))
        # Simulated time may stand still: the reports keep real time.
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._report_timer = self.create_timer(1.0, self._report, clock=steady)

    def start(self) -> None:
        """Starts the motion."""
        # Before the first tick, which with use_sim_time may be a long time away.
        self._publish(ROBOT_DESCRIPTION, self._simulator.description)
        self._ticker.start()

    def close(self) -> bool:
        """Stops the motion, and completes log and view.

        Returns:
            Whether everything succeeded.
        """
        self._ticker.stop()
        self._report_timer.cancel()  # nothing is said after the closing line
        try:
            self._report()
            self._report_totals()
        finally:
            succeeded = self._log is None or self._log.close()
            if self._view is not None:
                self._view.close()
        return succeeded and not self._ticker.error

    def _report_totals(self) -> None:
        counts = self._ticker.counts
        lost = (
            f', {health.dropped} lost to the {part}'
            for part, health in self._health().items()
            if health.dropped
        )
        self.get_logger().info(
            f'{counts.kept} states published, {counts.missed} ticks missed, '
            f'{counts.clock_steps} clock steps, latest tick '
            f'{counts.max_lateness / NS_PER_MS:.1f} ms '
            f'late{"".join(lost)}'
        )

    def _open_view(self, configuration: Configuration) -> LiveView:
        from linkage_ros.ros.live_view import LiveView

        return LiveView(self, configuration)

    def _open_log(self) -> RunLog:
        from linkage_ros.ros.run_log import RunLog

        return RunLog(self, self._simulator, self._other_topics)

    def _make_ticker(self, *, simulated: bool) -> Ticker:
        callbacks = Callbacks(self._tick, self._restamp, self._fail)
        if self._measurements:
            receive = self._measurements.receive
            return MeasurementTicker(self._simulator, callbacks, receive, self._answer)
        if not simulated:
            return RealTimeTicker(self._simulator, callbacks)
        ticker = SimTimeTicker(self._simulator, callbacks)
        subscribe_to_clock(self, ticker.advance_to)
        return ticker

    def _tick(self, stamp: int) -> None:
        """Carries out one tick, in the ticker's thread."""
        motion = self._motion
        if motion is None:
            motion = self._set_motion(self._simulator.begin(self._ticker.t0))
        motion = self._set_motion(motion.follow(stamp, self._drive))
        if self._joint_commands and isinstance(motion, TorqueMotion):
            for received, command in self._joint_commands.poll():
                if self._log is not None:
                    self._log.write_heard(received, command)
            motion.command(stamp, self._joint_commands.commands.torque())
        snapshot = self._simulator.snapshot_at(motion, stamp)
        self._set_motion(motion)  # it may be described in another way from here on
        self._show(snapshot)
        if self._ahead and (message := self._ahead.message_at(motion, stamp)):
            self._publish(self._ahead.topic, message)

    def _answer(self, received: int, data: bytes) -> bool:
        """Answers a measurement, in the ticker's thread; returns whether it was accepted."""
        if self._log is not None:
            self._log.write_heard(received, data)
        heard = self._measurements.take(received, data) if self._measurements else None
        if heard is not None:
            self._show(self._simulator.snapshot_measured(*heard))
        return heard is not None

    def _show(self, snapshot: Snapshot) -> None:
        """Publishes, logs and shows a state."""
        self._state = snapshot.state
        row = snapshot.row(time.time_ns())
        messages = snapshot.layout.messages(row)
        for topic, publisher, message in zip(
            self._simulator.topics, self._state_publishers, messages, strict=True
        ):
            if not topic.on_demand or publisher.get_subscription_count():
                publisher.publish(message)
        if self._log is not None:
            self._log.write_row(row)
        if self._view is not None:
            self._view.offer(messages[0])

    def _publish(self, topic: Topic, message: bytes) -> None:
        """Publishes and logs a message outside the ticks."""
        self._output_publishers[topic.name].publish(message)
        if self._log is not None:
            self._log.write(time.time_ns(), topic, message)

    def _restamp(self, old: int, new: int) -> None:
        if self._motion is not None:
            self._set_motion(self._motion.restamp(old, new))
        self.get_logger().warning(f'the clock was stepped by {(new - old) / NS_PER_S:+.3f} s')

    def _set_motion(self, motion: Motion) -> Motion:
        """Continues with a motion, and logs its segment if that is new."""
        if self._log is not None:
            self._log.write_motion(motion.segment)
        self._motion = motion
        return motion

    def _set_live(self, name: str, value: float) -> None:
        self._drive = build(type(self._drive), {**flatten(self._drive), name: value})

    def _report(self) -> None:
        """Publishes the diagnostics, and logs what went wrong since the last report."""
        counts, parts = self._ticker.counts, self._health()
        statuses = self._monitor.report(counts, self._values(), parts, self._warnings())
        for status in self._monitor.changes(statuses):
            if status.level == WARN:
                self.get_logger().warning(status.message)
            else:
                self.get_logger().info(status.message)
        now = self.get_clock().now().nanoseconds  # 0 until simulated time is heard
        diagnosis = encode_diagnostics(now, self._hardware_id, statuses)
        self._publish(DIAGNOSTICS, diagnosis)

    def _health(self) -> dict[str, Health]:
        parts = {'log': self._log, 'viewer': self._view}
        return {name: part.health() if part else Health('') for name, part in parts.items()}

    def _warnings(self) -> list[str]:
        waiting = isinstance(self._ticker, SimTimeTicker) and not self._state
        troubles = ['waiting for /clock'] if waiting else []
        if self._measurements:
            troubles += self._measurements.troubles()
        if self._joint_commands and self._joint_commands.commands.timed_out_within(WINDOW):
            troubles.append(
                f'no command within command_timeout: the motor drove alone in the last {WINDOW} s'
            )
        return troubles

    def _values(self) -> dict[str, str]:
        if self._state is None:
            return {}
        residual = loop_residual(self._simulator.solver.structure, self._state)
        return {
            'crank speed, rad/s': f'{self._state.velocity[0]:.6g}',
            'driving torque, N m': f'{self._state.torque:.6g}',
            'loop residual, m': f'{residual:.3g}',
            **(self._joint_commands.commands.diagnostics() if self._joint_commands else {}),
            **(self._measurements.diagnostics() if self._measurements else {}),
        }

    def _fail(self, error: BaseException) -> None:
        kind = '' if isinstance(error, LinkageError) else f'{type(error).__name__}: '
        self.get_logger().fatal(f'the motion ends here: {kind}{error}' if kind else str(error))
        self._stop.set()


def _parser() -> argparse.ArgumentParser:
    return cli.make_parser(
        _NAME,
        'Turn the crank of a linkage on ROS 2; publish its states and the driving torque.',
        ('', '--ros-args -p rpm:=60.0 -p log:=run.mcap',
         '--ros-args -p drive:=torque -p motor.torque:=9.0 -p motor.damping:=0.5',
         '--ros-args -p drive:=follow -r joint_states:=linkage/joint_states',
         '--ros-args --params-file linkage.yaml'),
        help_on_every_kind(),
    )  # fmt: skip


def _run(arguments: list[str]) -> int:
    stop = cli.Stop()
    with ros_program(arguments, _parser()):
        node = LinkageNode(stop)
        with spinning(node):
            node.start()
            stop.wait()
            succeeded = node.close()
    return 0 if succeeded else 1


def main() -> int:
    """Entry point."""
    return cli.run(_NAME, lambda: _run(sys.argv))


if __name__ == '__main__':
    sys.exit(cli.leave(main()))
