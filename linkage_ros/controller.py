# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_controller: keeps a torque-driven crank at a speed. A prototype, to copy and to change.

A PI controller takes the measured speed of each joint state; on top of it the exact torque of the
motion that is wanted is fed forward, for the crank angle at which it will act.
"""

from __future__ import annotations

import math
import sys
from typing import Any

import numpy as np
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.node import Node
from sensor_msgs.msg import JointState

from linkage_ros import cli
from linkage_ros.core.mechanism import Mechanism, WindPump
from linkage_ros.core.solver import Solver
from linkage_ros.errors import ConfigurationError
from linkage_ros.ros.session import on_ros, reported_as_configuration, served
from linkage_ros.ros.stderr import never_waited_for
from linkage_ros.run.configuration import load

_NAME = 'linkage_controller'
_ANY_TYPE = ParameterDescriptor(dynamic_typing=True)  # rpm:=600 is meant as 600.0
# What the user may set: a default, and what it means.
PARAMETERS = {
    'plant': ('quadrilateral', 'parameter file, or preset, of the mechanism that is controlled'),
    'rpm': (150.0, 'crank speed to keep'),
    'bandwidth': (15.0, 'of the speed loop, Hz'),
    'feed_forward': (True, 'whether the exact torque is added'),
    'lead_time': (0.0015, 's from a measurement to the middle of what its command does'),
}


class SpeedController:
    """PI control of the crank speed, with the exact torque fed forward."""

    def __init__(
        self, mechanism: Mechanism, rpm: float, bandwidth: float, lead: float | None
    ) -> None:
        """Prepares it.

        Args:
            mechanism: What is controlled.
            rpm: Speed to keep.
            bandwidth: At which the proportional part alone closes the loop, Hz.
            lead: From a measurement to the middle of what its command does, s; None: nothing is
                fed forward.

        Raises:
            ConfigurationError: No crank angle tells the state of this mechanism.
        """
        if isinstance(mechanism, WindPump):
            raise ConfigurationError('plant: a wind_pump keeps its own speed; name a linkage')
        self._solver, self._lead = Solver(mechanism), lead
        self._solver.require_full_turn()
        self._speed = rpm * math.pi / 30
        inertia = float(np.mean(self._solver.inertia(np.linspace(0, 4 * math.pi, 720))))
        self._kp = 2 * math.pi * bandwidth * inertia
        self._ki = self._kp * 2 * math.pi * bandwidth / 5
        self._integral = 0.0

    def torque(self, angle: float, speed: float, elapsed: float) -> float:
        """The torque to command.

        Args:
            angle: Of the crank, measured, rad.
            speed: Likewise, rad/s.
            elapsed: Since the measurement before, s.

        Returns:
            N m.
        """
        error = self._speed - speed
        if not elapsed:  # another run: what was learnt belongs to the one before
            self._integral = 0.0
        self._integral += self._ki * error * elapsed
        torque = self._kp * error + self._integral
        if self._lead is not None:
            ahead = math.remainder(angle + self._speed * self._lead, 4 * math.pi)
            torque += self._solver.state(ahead, self._speed).torque
        return torque


def _checked(name: str, value: Any) -> Any:
    """A parameter's value, whole numbers as floats.

    Raises:
        ConfigurationError: It is of another type, or out of range.
    """
    default, meaning = PARAMETERS[name]
    if isinstance(default, float) and type(value) is int:
        value = float(value)
    low = {'bandwidth': 0.0, 'lead_time': 0.0}.get(name, -1e6)
    if type(value) is not type(default) or (type(value) is float and not low <= value <= 1e6):
        words = {float: f'a number from {low:g} to 1e+06', bool: 'true or false', str: 'text'}
        raise ConfigurationError(f'{name} = {value!r}: must be {words[type(default)]}: {meaning}')
    return value


class ControllerNode(Node):  # type: ignore[misc]  # rclpy has no types
    """Answers each of joint_states with a command on joint_commands."""

    def __init__(self) -> None:
        super().__init__(_NAME)
        given = {
            name: self.declare_parameter(name, value, _ANY_TYPE).value
            for name, (value, _) in PARAMETERS.items()
        }
        if unknown := set(self._parameter_overrides) - {*PARAMETERS, 'use_sim_time'}:
            raise ConfigurationError(
                f'{", ".join(sorted(unknown))}: no such parameter; '
                f'there are {", ".join(PARAMETERS)}'
            )
        plant, rpm, bandwidth, feed_forward, lead = (
            _checked(name, value) for name, value in given.items()
        )
        self._controller = SpeedController(
            load(plant).mechanism, rpm, bandwidth, lead if feed_forward else None
        )
        self._last: float | None = None
        self._commands = self.create_publisher(JointState, 'joint_commands', 10)
        self.create_subscription(JointState, 'joint_states', self._answer, 10)

    def _answer(self, state: JointState) -> None:
        now = state.header.stamp.sec + state.header.stamp.nanosec * 1e-9
        last, self._last = self._last, now
        # A clock that was stepped, or a plant that began anew, is no time that has passed.
        elapsed = now - last if last is not None and 0 < now - last < 0.1 else 0.0
        crank = state.name.index('crank')
        angle, speed = state.position[crank], state.velocity[crank]
        if not math.isfinite(angle + speed):  # it would stay in the integral for ever
            return
        torque = self._controller.torque(angle, speed, elapsed)
        command = JointState(name=['crank'], effort=[torque])
        command.header.stamp = state.header.stamp
        self._commands.publish(command)


def _run(arguments: list[str]) -> int:
    stop = cli.Stop()
    names = (f'  {name}: {meaning} ({value})' for name, (value, meaning) in PARAMETERS.items())
    parser = cli.make_parser(
        _NAME,
        'Keep a torque-driven crank at a speed.',
        ('', '--ros-args -p rpm:=600.0 -p feed_forward:=false'),
        '\n'.join(('parameters, with defaults:', *names)),
    )
    with never_waited_for(), on_ros(arguments) as others:
        parser.parse_args(others)
        with reported_as_configuration():
            node = ControllerNode()
        with served(node):
            stop.wait()
    return 0


def main() -> int:
    """Entry point."""
    return cli.run(_NAME, lambda: _run(sys.argv))


if __name__ == '__main__':
    sys.exit(main())
