# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_node: turns the crank on ROS 2 and publishes the states and the driving torque."""

from __future__ import annotations

import gc
import itertools
import sys
import time
from collections.abc import Callable

import rclpy
from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter

from linkage_ros import cli, ros
from linkage_ros.configuration import Configuration, check_live, configure, preset_note
from linkage_ros.errors import ConfigurationError, LogError
from linkage_ros.log import LogItem, LogWriter
from linkage_ros.machine import Machine
from linkage_ros.messages import ROBOT_DESCRIPTION
from linkage_ros.motion import CrankMotion
from linkage_ros.parameter_file import read_parameter_file
from linkage_ros.ros_parameters import declare
from linkage_ros.stepper import Stepper
from linkage_ros.stream import Sample, View
from linkage_ros.worker import Worker

_NAME = 'linkage_node'
# Items that the queues hold: a stalled disk is waited for a minute at 1 kHz, a viewer 4 s.
_LOG_CAPACITY, _VIEW_CAPACITY = 120_000, 4_000
# s between batches. With the log's flush period this bounds what a killed run loses.
_LOG_PERIOD, _VIEW_PERIOD = 0.05, 0.03


class LinkageNode(Node):  # type: ignore[misc]  # rclpy has no types
    """Publishes the states of one mechanism at its rate.

    Publishes: the machine's topics and robot_description. Parameters: those of the configuration;
    rpm may be set at any time.
    """

    def __init__(self, stop: cli.Stop) -> None:
        with ros.reported_as_configuration():
            super().__init__(_NAME)
        given = {name: p.value for name, p in self._parameter_overrides.items()}
        configuration = configure(given)
        if self.get_parameter('use_sim_time').value:
            raise ConfigurationError('use_sim_time = true: must be false in this version')
        declare(self, configuration)
        self._stop = stop
        self._machine = Machine(configuration)
        self._rpm = configuration.drive.rpm
        self._outputs = [ros.create_publisher(self, topic) for topic in self._machine.topics]
        self._description = ros.create_publisher(self, ROBOT_DESCRIPTION)
        self._shown = view = self._make_view(configuration)
        try:
            self._log = self._open_log(configuration)
        except LogError:
            if view is not None:
                view.discard()
            raise
        self._view = self._work(view)
        self._stepper = Stepper(self._machine, self._step, self._restamp, self._fail)
        self._missed_before = 0
        self._lost = {'log': 0, 'view': 0}
        self.add_on_set_parameters_callback(self._check_parameters)
        self.add_post_set_parameters_callback(self._apply_parameters)
        self.create_timer(1.0, self._report)
        self.get_logger().info(preset_note(given) + self._machine.summary())

    def start(self) -> None:
        """Starts turning."""
        ros.await_listeners(self._outputs)
        # What exists by now stays; without this, each collection would walk through all of it.
        gc.collect()
        gc.freeze()
        self._stepper.start(self._begin)

    def close(self) -> bool:
        """Stops turning and completes log and view.

        Returns:
            Whether all went well to the end.
        """
        self._stepper.stop()
        self._report()
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
        topics = (*self._machine.topics, ROBOT_DESCRIPTION)
        publishers = (*self._outputs, self._description)
        *self._channels, self._description_channel = (
            log.add_topic(topic, publisher.topic_name)
            for topic, publisher in zip(topics, publishers, strict=True)
        )
        return Worker(
            'log', log, capacity=_LOG_CAPACITY, period=_LOG_PERIOD, on_error=self._log_failed
        )

    def _make_view(self, configuration: Configuration) -> View | None:
        session = configuration.session
        if not session.viewer:
            return None
        view = View(
            configuration, session.viewer, session.viewer_bind, overwrite=session.log_overwrite
        )
        if view.exposed:
            self.get_logger().warning(
                f'the view is served at {view.url} to whoever reaches it; viewer_bind = '
                '127.0.0.1 keeps it on this machine'
            )
        return view

    def _work(self, view: View | None) -> Worker[Sample] | None:
        if view is None:
            return None
        return Worker(
            'view', view, capacity=_VIEW_CAPACITY, period=_VIEW_PERIOD, on_error=self._view_failed
        )

    def _begin(self, stamp: int) -> None:
        self._motion = self._machine.begin(stamp)
        now = time.time_ns()
        self._description.publish(self._machine.description)
        if self._log is not None:
            self._log.offer(self._motion)
            self._log.offer((self._description_channel, now, self._machine.description))

    def _step(self, stamp: int) -> None:
        """One tick, in the stepper's thread."""
        if self._rpm != self._motion.rpm:
            self._move(self._motion.change(stamp, self._rpm))
        step = self._machine.step(self._motion, stamp)
        now = time.time_ns()
        for publisher, message in zip(self._outputs, step.messages, strict=True):
            publisher.publish(message)
        if self._log is not None:
            for channel, message in zip(self._channels, step.messages, strict=True):
                self._log.offer((channel, now, message))
        if self._view is not None:
            position, velocity, _, effort = step.values
            self._view.offer(Sample(stamp, position, velocity, effort))

    def _restamp(self, old: int, new: int) -> None:
        self._move(self._motion.change(old, self._motion.rpm, restamp=new))
        self.get_logger().warning(f'the clock was stepped by {(new - old) * 1e-9:+.3f} s')

    def _move(self, motion: CrankMotion) -> None:
        self._motion = motion
        if self._log is not None:
            self._log.offer(motion)

    def _check_parameters(self, parameters: list[Parameter]) -> SetParametersResult:
        try:
            for parameter in parameters:
                check_live(parameter.name, parameter.value)
        except ConfigurationError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _apply_parameters(self, parameters: list[Parameter]) -> None:
        for parameter in parameters:
            if parameter.name == 'rpm':
                self._rpm = parameter.value

    def _report(self) -> None:
        missed = self._stepper.counts.missed
        if missed > self._missed_before:
            self.get_logger().warning(
                f'{missed - self._missed_before} ticks missed in the last second, '
                f'{missed} so far: the machine is too busy for this rate_hz'
            )
        self._missed_before = missed
        # One that failed has said so already; what it no longer gets is no news.
        if self._log is not None and self._log.error is None:
            self._say_lost('log', self._log.dropped, self.get_logger().error)
        if self._view is not None and self._view.error is None and self._shown is not None:
            # Dropped on the way to the view, and by the view for a viewer that lags.
            lost = self._view.dropped + self._shown.dropped
            self._say_lost('view', lost, self.get_logger().warning)

    def _say_lost(self, name: str, lost: int, say: Callable[[str], None]) -> None:
        if lost > self._lost[name]:
            self._lost[name] = lost
            say(f'the {name} lags: {lost} of its messages are lost so far')

    def _log_failed(self, error: Exception) -> None:
        self.get_logger().error(f'the log ends here, the motion goes on: {error}')

    def _view_failed(self, error: Exception) -> None:
        self.get_logger().error(f'the view ends here, the motion goes on: {error}')

    def _fail(self, error: BaseException) -> None:
        self.get_logger().fatal(f'the motion ends here: {type(error).__name__}: {error}')
        self._stop.set()


def _check_parameter_files(arguments: list[str]) -> None:
    """Reads the files as rcl will, because our words about a slip are clearer than its own."""
    names = [
        text.split(':=')[1] for text in arguments if text.startswith(('__node:=', '__name:='))
    ]
    for option, path in itertools.pairwise(arguments):
        if option == '--params-file':
            read_parameter_file(path, names[-1] if names else _NAME)


def _run(arguments: list[str]) -> int:
    stop = cli.Stop()
    parser = cli.make_parser(
        _NAME,
        'Turn the crank of a linkage on ROS 2; publish its states and the driving torque.',
        ('', '--ros-args -p rpm:=60.0 -p log:=run.mcap', '--ros-args --params-file linkage.yaml'),
    )
    _check_parameter_files(arguments)
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
