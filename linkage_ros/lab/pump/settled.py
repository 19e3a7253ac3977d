# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The steady state that a wind pump reaches from one start; one turn of it as columns."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable

import numpy as np

from linkage_ros.dynamics.period import Period, mean
from linkage_ros.errors import ConfigurationError
from linkage_ros.lab.pump.periodic import PeriodicMotion, Wanted, find_motions
from linkage_ros.lab.pump.poincare import PoincareMap
from linkage_ros.lab.pump.pump import require_forwards
from linkage_ros.model.wind_pump import WindPump
from linkage_ros.motion.drives import Motor

_PARTS = 720  # of a turn
_LONGEST = 500  # turns, until it is to have settled
_LOOK = 5  # turns between two looks whether it has
_NEAR = 0.01  # of crank length and speed: so near to a stable motion, it is going there


class SettledTurn(Period):
    """A turn of a settled wind pump.

    Attributes:
        motion: The settled motion.
    """

    def __init__(
        self,
        mechanism: WindPump,
        motor: Motor,
        speed: float,
        progress: Callable[[Iterable[int], str], Iterable[int]],
    ) -> None:
        """Lets a pump settle and takes a turn of it, 0.5 deg by 0.5 deg.

        Args:
            mechanism: The pump, with the start of its slider.
            motor: Motor of the pump.
            speed: Speed of the crank at angle 0, rad/s.
            progress: Wraps what is gone through, with a word for it: a progress bar.

        Raises:
            ConfigurationError: Motor or speed turn nothing forwards, or it does not settle.
            LinkageError: The motion leaves what the coordinates describe, or the crank stops.
        """
        poincare, self.motion = _settle(mechanism, motor, speed, progress)
        solver = poincare.solver
        points = np.array([self.motion.point]).T
        x, v, w, _ = poincare.orbit(points, motor.torque, _PARTS)[..., 0]
        crank = np.linspace(0, 2 * math.pi, _PARTS + 1)
        applied = motor.at(w)
        q, u = (crank, x), (w, v)
        state = solver.state(q, u, solver.accelerations(q, u, applied))
        super().__init__(
            solver, crank, state,
            speed=self.motion.speed, mean_power=mean(crank, applied) * self.motion.speed,
        )  # fmt: skip

    def words(self) -> list[str]:
        """Lines about the steady state."""
        motion = self.motion
        return [
            f'settled at {motion.speed:.4g} rad/s',
            f'stroke {motion.stroke:.4g} m ({motion.lowest:.4g} to {motion.highest:.4g} m)',
            f'flow (stroke x speed) {motion.flow:.4g} m/s',
        ]


def _settle(
    mechanism: WindPump,
    motor: Motor,
    speed: float,
    progress: Callable[[Iterable[int], str], Iterable[int]],
) -> tuple[PoincareMap, PeriodicMotion]:
    """Follows a pump until it has settled: the map of its turns, and the settled motion.

    Raises:
        ConfigurationError: As `SettledTurn`.
    """
    require_forwards(mechanism, motor, [speed])
    poincare, slider = PoincareMap(mechanism, motor.damping), mechanism.slider
    point = np.array([[slider.position], [slider.velocity], [speed]])
    for turn in progress(iter(range(1, _LONGEST + 1)), 'turns'):  # its length is but a bound
        point = poincare.image(point, motor.torque)[:3]
        if turn % _LOOK:
            continue
        guess = np.vstack((point, [[motor.torque]]))
        (found,) = find_motions(poincare, guess, Wanted(np.array([motor.torque]), is_speed=False))
        if found and found.stable:
            length, (_, _, now) = mechanism.crank.length, point[:, 0]
            sizes = np.array((length, length * now, now))
            if (np.abs(point[:, 0] - found.point) < _NEAR * sizes).all():
                return poincare, found
    raise ConfigurationError(
        f'from {speed:g} rad/s the pump does not settle within {_LONGEST} turns: '
        'linkage_chart pump draws what it does'
    )
