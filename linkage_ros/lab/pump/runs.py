# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Motions of a wind pump over time, from a start at crank angle 0."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from linkage_ros.dynamics.solver import Solver
from linkage_ros.errors import ConfigurationError, MotionError
from linkage_ros.lab.pump.harmonic_balance import EXACT, HarmonicBalance
from linkage_ros.lab.pump.periodic_motion import PeriodicMotion
from linkage_ros.model.wind_pump import WindPump
from linkage_ros.motion.driven_mechanism import DrivenMechanism
from linkage_ros.motion.drives import Motor
from linkage_ros.motion.fixed_step_integrator import Values
from linkage_ros.motion.integrators import live_steps
from linkage_ros.numeric import Array
from linkage_ros.quantities import Quantity

# Crank speeds with which a run may start.
START_SPEED = Quantity('number', 'crank speed to start from', 'rad/s', 1e-6, 1e6)
SAMPLES = 50  # in a turn, and more

_NEAR = 0.05  # of crank length and speed: a run that ends so near to a state has settled there
_LOOK = 5  # turns between two looks whether a pump has settled
_LOOKS = 100
_NEARER = 0.01  # likewise: from there it goes to the state
_FORWARDS = Quantity('number', 'motor torque at rest that turns the crank', 'N m', 1e-9, 1e12)
_TOLERANCE = 1e-7  # of a step: for pictures, a hundred times that of a live run


def require_forwards(mechanism: WindPump, motor: Motor, speeds: Sequence[float]) -> None:
    """Passes if a motor and starts turn the crank forwards.

    Args:
        mechanism: The pump.
        motor: Motor of the pump.
        speeds: Speeds of the crank at the starts, rad/s.

    Raises:
        ConfigurationError: They do not.
        UnreachableError: The pump cannot start from where its slider is.
    """
    _FORWARDS.clean('motor.torque', motor.torque)
    slider = mechanism.slider
    solver = Solver(mechanism)
    for speed in speeds:
        START_SPEED.clean('start speed', speed)
        solver.accelerations((0.0, slider.position), (speed, slider.velocity), motor.torque)


class Run(NamedTuple):
    """A motion over time.

    Attributes:
        name: Name of the start.
        times: s.
        speeds: Speeds of the crank at these times, rad/s.
        state: Number of the steady state near which it ends; None: near none.
        ended: Why it could not be followed as long as was asked for; None: it could.
    """

    name: str
    times: Array
    speeds: Array
    state: int | None
    ended: str | None

    def record(self) -> dict[str, Any]:
        """For JSON."""
        return {
            'start': self.name, 'settles_at_state': self.state, 'ended': self.ended,
            'duration': float(self.times[-1]),
        }  # fmt: skip


def phases(solver: Solver, motor: Motor, start: Values) -> Iterator[tuple[float, Values]]:
    """Follows a motion in equal steps of time, at least 50 in a turn.

    Args:
        solver: Solver of the pump.
        motor: Motor of the pump.
        start: Crank angle, rad, slider position, m, and their rates.

    Yields:
        Time, s, and phase, without end.

    Raises:
        MotionError: It leaves what the coordinates describe.
    """
    fastest = motor.torque / motor.damping if motor.damping else 0.0
    step = 2 * math.pi / SAMPLES / max(start[2], fastest)
    driven = DrivenMechanism(solver, lambda speed: motor.at(speed))
    steps = live_steps(driven, start, longest=step, tolerance=_TOLERANCE)
    while True:
        yield steps.time, steps.phase
        steps.advance(steps.time + step)


def follow_run(
    solver: Solver,
    motor: Motor,
    start: Values,
    duration: float,
    name: str,
    states: Sequence[PeriodicMotion],
) -> Run:
    """Follows a motion for some time, or to its end.

    Args:
        solver: Solver of the pump.
        motor: Motor of the pump.
        start: Crank angle, rad, slider position, m, and their rates.
        duration: s.
        name: Name of the start.
        states: Steady states of the pump.

    Returns:
        The motion.
    """
    found: list[tuple[float, ...]] = []
    ended = None
    try:
        for time, phase in phases(solver, motor, start):
            found.append((time, *phase))
            if time >= duration:
                break
    except MotionError as error:
        ended = str(error)
    rows = np.array(found).T
    near = (
        number
        for number, state in enumerate(states)
        if state.stable and not ended and state.is_near(rows[1:, -SAMPLES:], _NEAR)
    )
    return Run(name, rows[0], rows[3], next(near, None), ended)


def settle(
    mechanism: WindPump,
    motor: Motor,
    speed: float,
    progress: Callable[[Iterable[int], str], Iterable[int]],
) -> PeriodicMotion:
    """Follows a pump until it is near to a stable motion.

    Args:
        mechanism: The pump, with the start of its slider.
        motor: Motor of the pump.
        speed: Speed of the crank at angle 0, rad/s.
        progress: Wraps what is gone through, with a word for it: a progress bar.

    Returns:
        The stable motion.

    Raises:
        ConfigurationError: Motor or speed turn nothing forwards, or it does not settle.
        LinkageError: The motion leaves what the coordinates describe.
    """
    require_forwards(mechanism, motor, [speed])
    balance, slider = HarmonicBalance(mechanism, motor.damping, EXACT), mechanism.slider
    course = phases(balance.solver, motor, (0.0, slider.position, speed, slider.velocity))
    for _ in progress(iter(range(_LOOKS)), 'turns'):  # its length is but a bound
        turns = itertools.islice(course, _LOOK * SAMPLES)
        latest = np.array([phase for _, phase in turns]).T
        found = balance.find(balance.fit(latest, motor.torque), torque=motor.torque)
        if found and found.stable and found.is_near(latest[:, -SAMPLES:], _NEARER):
            return found
    raise ConfigurationError(
        f'from {speed:g} rad/s the pump does not settle within {_LOOKS * _LOOK} turns: '
        'linkage_chart pump draws what it does'
    )
