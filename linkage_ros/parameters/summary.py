# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A configuration in one line."""

from __future__ import annotations

from linkage_ros.dynamics.solver import Solver
from linkage_ros.dynamics.travel import travel
from linkage_ros.motion.drives import Drive, Motor, TorqueDrive
from linkage_ros.parameters.configuration import Configuration


def summary(configuration: Configuration, solver: Solver) -> str:
    """What moves, and how.

    Args:
        configuration: Configuration of the run.
        solver: Solver of its mechanism.

    Returns:
        One line.
    """
    words = [configuration.kind.mechanism, configuration.mechanism.assembly]
    if reach := solver.mobility:
        words.append(reach.grashof)
        if reach.turns_fully:
            words += travel(solver).words()
    words.append(f'{_drive(configuration.drive)} at {configuration.session.rate_hz:g} Hz')
    return ', '.join(words)


def motor_line(motor: Motor) -> str:
    """A motor and its damping."""
    lost = f' - {motor.damping:g} N m s x speed' if motor.damping else ''
    return f'motor {motor.torque:g} N m{lost}'


def _drive(drive: Drive) -> str:
    if isinstance(drive, TorqueDrive):
        return f'{motor_line(drive.motor)}, from {drive.start_rpm:g} rpm'
    if drive.start_rpm is None or not drive.crank_acceleration:
        return f'{drive.rpm:g} rpm'
    return (
        f'from {drive.start_rpm:g} to {drive.rpm:g} rpm with {drive.crank_acceleration:g} rad/s^2'
    )
