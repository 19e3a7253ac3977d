# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_node: turns the crank on ROS 2 and publishes the states and the driving torque."""

from __future__ import annotations

import gc
import queue
import sys
import time

import rclpy
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock as ClockMessage

from linkage_ros import cli, ros
from linkage_ros.core.state import State
from linkage_ros.errors import LinkageError, LogError
from linkage_ros.log.writer import LogItem, LogWriter
from linkage_ros.ros_commands import listen
from linkage_ros.ros_parameters import check_parameter_files, declare
from linkage_ros.ros_view import open_view
from linkage_ros.run.clock_stepper import ClockStepper
from linkage_ros.run.commands import Commands
from linkage_ros.run.configuration import Configuration, configure, preset_note
from linkage_ros.run.diagnostics import WARN, Health, Watch, encode_diagnostics
from linkage_ros.run.drives import TorqueDrive
from linkage_ros.run.machine import Machine
from linkage_ros.run.stepper import Stepper
from linkage_ros.run.torque import RunMotion, TorqueMotion
from linkage_ros.run.worker import Worker
from linkage_ros.view.stream import Sample, View
from linkage_ros.wire.messages import DIAGNOSTICS, JOINT_COMMANDS, ROBOT_DESCRIPTION

_NAME = 'linkage_node'
# Items that the queues hold: a stalled disk is waited for a minute at 1 kHz, a viewer 4 s.
_LOG_CAPACITY, _VIEW_CAPACITY = 120_000, 4_000
# s between batches. With the log's flush period this bounds what a killed run loses.
_LOG_PERIOD, _VIEW_PERIOD = 0.05, 0.03
# As ROS's own clocks listen, but a burst is not thinned out.
_CLOCK_QOS = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)


class LinkageNode(Node):  # type: ignore[misc]  # rclpy has no types
    """Publishes the states of one mechanism at its rate.

    Publishes: the machine's topics, robot_description and, once a second, /diagnostics.
    Subscribes: /clock, with use_sim_time; joint_commands, where a torque drives the mechanism.
    Parameters: those of the configuration; rpm or motor.torque may be set at any time.
    """

    def __init__(self, stop: cli.Stop) -> None:
        with ros.reported_as_configuration():
            super().__init__(_NAME)
        given = {name: p.value for name, p in self._parameter_overrides.items()}
        configuration = configure(given)
        declare(self, configuration, self._set_live)
        self._stop = stop
        self._machine = Machine(configuration)
        self._target = configuration.drive.target
        self._outputs = [ros.create_publisher(self, topic) for topic in self._machine.topics]
        self._description = ros.create_publisher(self, ROBOT_DESCRIPTION)
        self._diagnostics = ros.create_publisher(self, DIAGNOSTICS)
        self._shown = view = open_view(self, configuration)
        try:
            self._log = self._open_log(configuration)
        except LogError:
            if view is not None:
                view.discard()
            raise
        self._view = self._work(view)
        self._stepper = self._make_stepper(simulated=self.get_parameter('use_sim_time').value)
        self._state: State | None = None
        self._said: dict[str, str] = {}
        # What other threads have for the log: channel, time, bytes.
        self._notes: queue.SimpleQueue[tuple[int, int, bytes]] = queue.SimpleQueue()
        self._commands: Commands | None = None
        if isinstance(configuration.drive, TorqueDrive):
            self._commands = listen(self, configuration.drive, self._note_command)
        self.get_logger().info(preset_note(given) + self._machine.summary())

    def start(self) -> None:
        """Starts turning."""
        ros.await_listeners(self._outputs)
        # What exists by now stays; without this, each collection would walk through all of it.
        gc.collect()
        gc.freeze()
        self._watch = Watch(self.get_fully_qualified_name().lstrip('/'))
        self._stepper.start(self._begin)
        # Simulated time may stand still; whether all goes well is asked in real time.
        self.create_timer(1.0, self._report, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def close(self) -> bool:
        """Stops turning and completes log and view.

        Returns:
            Whether all went well to the end.
        """
        self._stepper.stop()
        self._report()
        self._log_notes()  # no step is left to do it
        counts = self._stepper.counts
        self.get_logger().info(
            f'{counts.kept} states published, {counts.missed} ticks missed, '
            f'{counts.clock_steps} clock steps, latest tick {counts.latest * 1e-6:.1f} ms late'
        )
        closed = self._log is None or self._log.close(timeout=30.0)
        if not closed:
            cli.print_error(_NAME, 'the log could not be completed within 30 s: the disk hangs')
        if self._view is not None:
            self._view.close(timeout=5.0)
        failed = self._stepper.error or (self._log and self._log.error)
        return closed and not failed

    def _open_log(self, configuration: Configuration) -> Worker[LogItem] | None:
        session = configuration.session
        if not session.log:
            return None
        log = LogWriter(session.log, configuration, overwrite=session.log_overwrite)
        topics = (*self._machine.topics, ROBOT_DESCRIPTION, DIAGNOSTICS)
        publishers = (*self._outputs, self._description, self._diagnostics)
        *self._channels, self._description_channel, self._diagnostics_channel = (
            log.add_topic(topic, publisher.topic_name)
            for topic, publisher in zip(topics, publishers, strict=True)
        )
        if isinstance(configuration.drive, TorqueDrive):
            name = self.resolve_topic_name(JOINT_COMMANDS.name)
            self._commands_channel = log.add_topic(JOINT_COMMANDS, name)
        return Worker(
            'log', log, capacity=_LOG_CAPACITY, period=_LOG_PERIOD, on_error=self._log_failed
        )

    def _work(self, view: View | None) -> Worker[Sample] | None:
        if view is None:
            return None
        return Worker(
            'view', view, capacity=_VIEW_CAPACITY, period=_VIEW_PERIOD, on_error=self._view_failed
        )

    def _make_stepper(self, *, simulated: bool) -> Stepper | ClockStepper:
        calls = self._machine, self._step, self._restamp, self._fail
        if not simulated:
            return Stepper(*calls)
        stepper = ClockStepper(*calls)

        def hear(message: ClockMessage) -> None:
            stepper.hear(message.clock.sec * 10**9 + message.clock.nanosec)

        self.create_subscription(ClockMessage, '/clock', hear, _CLOCK_QOS)
        return stepper

    def _begin(self, stamp: int) -> None:
        self._motion = self._machine.begin(stamp)
        now = time.time_ns()
        self._description.publish(self._machine.description)
        if self._log is not None:
            self._log.offer(self._motion)
            self._log.offer((self._description_channel, now, self._machine.description))

    def _step(self, stamp: int) -> None:
        """One tick, in the stepper's thread."""
        motion = self._motion.next(stamp, self._target)
        if motion is not self._motion:
            self._move(motion)
        if self._commands and isinstance(motion, TorqueMotion):
            motion.command(stamp, self._commands.torque())
        step = self._machine.step(self._motion, stamp)
        self._state = step.state
        now = time.time_ns()
        for topic, publisher, message in zip(
            self._machine.topics, self._outputs, step.messages, strict=True
        ):
            if not topic.on_demand or publisher.get_subscription_count():
                publisher.publish(message)
        if self._log is not None:
            for channel, message in zip(self._channels, step.messages, strict=True):
                self._log.offer((channel, now, message))
            self._log_notes()
        if self._view is not None:
            position, velocity, _, effort = step.values
            self._view.offer(Sample(stamp, position, velocity, effort))

    def _log_notes(self) -> None:
        """Logs the notes; from the thread that logs the states, because queues ask so."""
        while self._log is not None and not self._notes.empty():
            self._log.offer(self._notes.get())

    def _note_command(self, data: bytes) -> None:
        if self._log is not None:
            self._notes.put((self._commands_channel, time.time_ns(), data))

    def _restamp(self, old: int, new: int) -> None:
        self._move(self._motion.change(old, self._motion.target, restamp=new))
        self.get_logger().warning(f'the clock was stepped by {(new - old) * 1e-9:+.3f} s')

    def _move(self, motion: RunMotion) -> None:
        self._motion = motion
        if self._log is not None:
            self._log.offer(motion)

    def _set_live(self, _: str, value: float) -> None:
        self._target = value  # rpm or motor.torque, whichever this drive has

    def _report(self) -> None:
        """Publishes the diagnostics, and says what went wrong since the last report."""
        parts = {'log': self._log_health(), 'viewer': self._viewer_health()}
        figures, troubles = self._figures(), self._troubles()
        statuses = self._watch.report(self._stepper.counts, figures, parts, troubles)
        for status in statuses:
            # What has failed was said when it did; what stays as it is is said once.
            if status.level == WARN and self._said.get(status.name) != status.message:
                self.get_logger().warning(status.message)
            self._said[status.name] = status.message
        stamp = self.get_clock().now().nanoseconds
        diagnosis = encode_diagnostics(stamp, statuses)
        self._diagnostics.publish(diagnosis)
        if self._log is not None:
            self._notes.put((self._diagnostics_channel, time.time_ns(), diagnosis))
        if isinstance(self._stepper, ClockStepper):  # it steps in this very thread, or stands
            self._log_notes()

    def _troubles(self) -> list[str]:
        troubles = [] if self._state else ['waiting for /clock']
        if self._commands and self._commands.timed_out:
            troubles.append('no command within command_timeout: the motor drives alone')
        return troubles

    def _figures(self) -> dict[str, str]:
        if self._state is None:
            return {}
        return {
            'crank speed, rad/s': f'{self._state.velocity[0]:.6g}',
            'driving torque, N m': f'{self._state.torque:.6g}',
            'loop residual, m': f'{self._machine.residual(self._state):.3g}',
            **(self._commands.figures() if self._commands else {}),
        }

    def _log_health(self) -> Health:
        if self._log is None:
            return Health('')
        path = self._machine.configuration.session.log
        return Health(path, self._log.dropped, self._log.error)

    def _viewer_health(self) -> Health:
        if self._view is None or self._shown is None:
            return Health('')
        target = self._machine.configuration.session.viewer
        # Dropped on the way to the view, and by the view for a viewer that lags.
        return Health(target, self._view.dropped + self._shown.dropped, self._view.error)

    def _log_failed(self, error: Exception) -> None:
        self.get_logger().error(f'the log ends here, the motion goes on: {error}')

    def _view_failed(self, error: Exception) -> None:
        self.get_logger().error(f'the view ends here, the motion goes on: {error}')

    def _fail(self, error: BaseException) -> None:
        known = isinstance(error, LinkageError)
        words = str(error) if known else f'the motion ends here: {type(error).__name__}: {error}'
        self.get_logger().fatal(words)
        self._stop.set()


def _run(arguments: list[str]) -> int:
    stop = cli.Stop()
    parser = cli.make_parser(
        _NAME,
        'Turn the crank of a linkage on ROS 2; publish its states and the driving torque.',
        ('', '--ros-args -p rpm:=60.0 -p log:=run.mcap', '--ros-args --params-file linkage.yaml'),
    )
    check_parameter_files(arguments, _NAME)
    parser.parse_args(ros.start(arguments))
    try:
        node = LinkageNode(stop)
        with ros.served(node):
            node.start()
            stop.wait()
            well = node.close()
    finally:
        rclpy.try_shutdown()
    return 0 if well else 1


def main() -> int:
    """Entry point."""
    return cli.run(_NAME, lambda: _run(sys.argv))


if __name__ == '__main__':
    sys.exit(main())
