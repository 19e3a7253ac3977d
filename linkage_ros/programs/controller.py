# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_controller: keeps a torque-driven crank at a set speed; a prototype to copy and adapt.

For each joint state, a PI controller computes a torque from the speed error. The exact torque of
the desired motion is added as feed-forward, computed for the crank angle at which the command
takes effect.
"""

import math
import sys
from dataclasses import replace

import numpy as np
from sensor_msgs.msg import JointState

from linkage_ros import cli
from linkage_ros.errors import ConfigurationError, in_file
from linkage_ros.mechanism.base import Mechanism
from linkage_ros.mechanism.solver import Solver
from linkage_ros.node.parameter_node import ParameterNode
from linkage_ros.node.process import Throttle, run_program
from linkage_ros.quantities import build, flatten, unknown_name
from linkage_ros.settings.configuration import load
from linkage_ros.settings.controller import PARAMETERS, ControllerSettings
from linkage_ros.settings.help import controller_parser
from linkage_ros.units import NS_PER_S, radians_per_second

_NAME = 'linkage_controller'
# Longest gap between two states, ns. After a longer gap, caused by a step of the clock, a restart
# of the plant or a lost connection, the integral is reset.
_LONGEST_GAP = NS_PER_S // 10


class SpeedController:
    """PI control of the crank speed, with feed-forward of the exact torque."""

    def __init__(
        self, mechanism: Mechanism, rpm: float, bandwidth: float, lead: float | None
    ) -> None:
        """Computes the gains from the mean inertia at the crank; see `ControllerSettings`.

        The bandwidth, Hz, is that of the proportional control alone; a lead of None is no
        feed-forward. The crank must turn fully.
        """
        self._solver, self._lead = Solver(mechanism), lead
        self._solver.reach.require_full_turn()
        self._speed = radians_per_second(rpm)
        ((inertias,),) = self._solver.matrix(np.linspace(0, 4 * math.pi, 720))
        inertia = float(np.mean(inertias))
        self._kp = 2 * math.pi * bandwidth * inertia
        self._ki = self._kp * 2 * math.pi * bandwidth / 5
        self._integral = 0.0

    def torque(self, angle: float, speed: float, elapsed: float) -> float:
        """Computes the torque to command.

        Args:
            angle: Measured crank angle, rad.
            speed: Measured crank speed, rad/s.
            elapsed: Time since the previous measurement, s; 0 to reset the integral.

        Returns:
            The torque on the crank, N m.
        """
        error = self._speed - speed
        if not elapsed:
            self._integral = 0.0
        self._integral += self._ki * error * elapsed
        torque = self._kp * error + self._integral
        if self._lead is not None:
            ahead = math.remainder(angle + self._speed * self._lead, 4 * math.pi)
            torque += self._solver.state(ahead, self._speed).torque
        return torque


class ControllerNode(ParameterNode):
    """Publishes a command on joint_commands for each message on joint_states."""

    def __init__(self, stop: cli.Stop) -> None:
        super().__init__(_NAME)
        self._stop = stop
        given = self.given
        names = [leaf.name for leaf in PARAMETERS]
        for name in given:
            if name not in names:
                words, _ = unknown_name(name, _NAME, names, f'{_NAME} --help')
                raise ConfigurationError(words)
        settings = build(ControllerSettings, given)
        with in_file(settings.plant):
            plant = load(settings.plant).linkage(settings.linkage)
        prefix, session = settings.joint_prefix, plant.session
        if prefix is not None:
            session = replace(session, joint_prefix=prefix)
        settings = replace(settings, joint_prefix=session.joint_prefix)
        self.declare(PARAMETERS, flatten(settings))
        self._controller = SpeedController(
            plant.mechanism, settings.rpm, settings.bandwidth,
            settings.lead_time if settings.feed_forward else None,
        )  # fmt: skip
        self._joint = replace(plant, session=session).robot_joints[0]
        self._crank = self._joint.name
        self._commanded = plant.session.crank_joint or self._crank
        self._last_stamp, self._throttle = -_LONGEST_GAP, Throttle()
        self._commands = self.create_publisher(JointState, 'joint_commands', 10)
        states = self.create_subscription(JointState, 'joint_states', self._answer, 10)
        self.get_logger().info(
            f'keeps the crank of {settings.plant} at {settings.rpm:g} rpm, with '
            f'{"the exact torque as" if settings.feed_forward else "no"} feed-forward; '
            f'waits for {states.topic_name}'
        )

    def work(self) -> int:
        """Waits until the end is requested; returns the exit code."""
        self._stop.wait()
        return 0

    def _answer(self, state: JointState) -> None:
        """Publishes the torque for a state of the crank."""
        if self._crank not in state.name:  # the message is from another robot
            return
        # Positions and velocities are optional in a JointState.
        joints = zip(state.name, state.position, state.velocity, strict=False)
        measured = {name: (angle, speed) for name, angle, speed in joints}
        angle, speed = measured.get(self._crank, (math.nan, math.nan))
        if not math.isfinite(angle + speed):  # would make the integral non-finite permanently
            if self._throttle.is_due():
                self.get_logger().warning(
                    f'a state without finite position and velocity of {self._crank} is ignored'
                )
            return
        stamp = state.header.stamp.sec * NS_PER_S + state.header.stamp.nanosec
        gap, self._last_stamp = stamp - self._last_stamp, stamp
        elapsed = gap / NS_PER_S if 0 < gap < _LONGEST_GAP else 0.0
        ratio = self._joint.ratio
        torque = self._controller.torque(self._joint.own(angle), speed / ratio, elapsed)
        command = JointState(name=[self._commanded], effort=[torque / ratio])
        command.header.stamp = state.header.stamp
        self._commands.publish(command)


def main() -> int:
    """Runs `linkage_controller`; returns the exit code. `cli.run` reports its errors."""
    return run_program(sys.argv, controller_parser(), ControllerNode)


if __name__ == '__main__':
    sys.exit(cli.leave(cli.run(_NAME, main)))
