# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The plant of a torque-driven run: a mechanism under its motor and under commands."""

from __future__ import annotations

from linkage_ros.dynamics.solver import Solver
from linkage_ros.model.structure import Mechanism
from linkage_ros.motion.driven_mechanism import DrivenMechanism, Phase
from linkage_ros.motion.drives import TorqueDrive
from linkage_ros.motion.fixed_step_integrator import FixedSteps, Integrate
from linkage_ros.motion.speed_driven import CrankState
from linkage_ros.numeric import with_turns, within_two_turns
from linkage_ros.units import radians_per_second


class Plant:
    """A mechanism under its motor and under commands, followed from its start.

    Attributes:
        solver: Solver of the mechanism.
    """

    def __init__(
        self,
        solver: Solver,
        drive: TorqueDrive,
        integrate: Integrate = FixedSteps,
    ) -> None:
        """Puts it into its start.

        Args:
            solver: Solver of the mechanism.
            drive: Motor and start.
            integrate: Makes what follows the motion.

        Raises:
            LinkageError: It cannot start from there.
        """
        self.solver = solver
        self._motor, self._damping, self._command = drive.motor.torque, drive.motor.damping, 0.0
        self._steps = integrate(
            DrivenMechanism(solver, self.torque), start(solver.mechanism, drive)
        )

    @property
    def time(self) -> float:
        """Up to which it was followed, s."""
        return self._steps.time

    def torque(self, time: float, speed: float) -> float:  # noqa: ARG002, as a TorqueLaw
        """The torque on the crank, N m.

        Args:
            time: s.
            speed: Of the crank, rad/s.

        Returns:
            Of the motor line and the command.
        """
        return self._motor - self._damping * speed + self._command

    def drive(self, motor: float, command: float) -> None:
        """Sets the motor's torque at rest and the command from now on, N m."""
        if (motor, command) != (self._motor, self._command):
            self._motor, self._command = motor, command
            self._steps.changed()

    @property
    def command(self) -> float:
        """The command in force, N m."""
        return self._command

    def advance(self, time: float) -> None:
        """Follows the motion to a time, not before the one before.

        Args:
            time: s.

        Raises:
            MotionError: It cannot be followed that far.
        """
        self._steps.advance(time)

    def state(self) -> CrankState:
        """The coordinates at the time reached.

        The angle within two turns is that of the unwrapped one as it is published, so that a log
        tells the very state.
        """
        phase, count = self._steps.phase, len(self.solver.coordinates)
        unwrapped = with_turns(phase[0], self._steps.pairs)
        angle, _ = within_two_turns(unwrapped)
        q, u = (angle, *phase[1:count]), phase[count:]
        a = self.solver.forward(q, u, self.torque(self.time, u[0])).accelerations
        slide = (q[1], u[1], a[1]) if count > 1 else ()
        return CrankState(angle, unwrapped, u[0], a[0], slide)


def start(mechanism: Mechanism, drive: TorqueDrive) -> Phase:
    """Coordinates and rates at t = 0."""
    places, rates = mechanism.start()
    return drive.crank_angle, *places, radians_per_second(drive.start_rpm), *rates
