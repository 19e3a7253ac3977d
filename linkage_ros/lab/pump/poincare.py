# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The Poincare map of a wind pump: from one passage of the crank through angle 0 to the next.

While the crank turns, its angle serves as the independent variable in place of time, so that a
turn ends at 2 pi exactly and no passage has to be searched for (M. Henon, Physica D 5 (1982),
412-414). A column of an array is one motion. All columns take the same steps: differences between
neighbours are free of the noise that steps of their own would make.

The only file of this floor that knows SciPy.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NoReturn

import numpy as np
from scipy.integrate import DOP853

from linkage_ros.dynamics.solver import Solver
from linkage_ros.errors import MotionError
from linkage_ros.model.wind_pump import WindPump
from linkage_ros.numeric import Array, Real

_TOLERANCE = 1e-13  # relative, and absolute in crank lengths, rad/s and s
_LEAST = 0.01  # of the speed at the start: a slower crank counts as one that stops
_SHORTEST = 1e-6  # rad: steps at the edge of what the coordinates describe
_MOST = 1000  # steps in a turn: a crank that all but stops needs ever more
_COURSE = 64  # least steps in a turn whose course is asked for: between them, no digit is lost


class PoincareMap:
    """The map of one pump whose motor's torque falls with the crank speed.

    Attributes:
        solver: Solver of the mechanism.
        damping: What the motor's torque loses per crank speed, N m s.
    """

    def __init__(self, mechanism: WindPump, damping: float) -> None:
        self.solver, self.damping = Solver(mechanism), damping

    def image(self, points: Array, torque: Real) -> Array:
        """Where motions are after a turn.

        Args:
            points: At crank angle 0; rows slider position, m, its velocity, m/s, and crank
                speed, rad/s; a column for each motion.
            torque: Torque of the motor at rest, N m; one, or one for each motion.

        Returns:
            The same after the turn, and as a fourth row the time it took, s.

        Raises:
            LinkageError: A motion leaves what the coordinates describe, or the crank stops.
        """
        with np.errstate(all='ignore'):  # what overflows is refused by the equations of motion
            *_, last = self._steps(points, torque, np.inf)
        ends: Array = last.y.reshape(4, -1)
        return ends

    def orbit(self, points: Array, torque: Real, count: int) -> Array:
        """The course of a turn.

        Args:
            points: As for `image`.
            torque: Likewise.
            count: Number of equal parts of the turn.

        Returns:
            Of shape (4, count + 1, motions): the rows of `image` at crank angles 0 to 2 pi.

        Raises:
            LinkageError: As `image`.
        """
        angles = np.linspace(0, 2 * math.pi, count + 1)
        course = [np.vstack((points, 0 * points[2]))[:, None]]
        with np.errstate(all='ignore'):
            for step in self._steps(points, torque, 2 * math.pi / _COURSE):
                passed = angles[(step.t_old < angles) & (angles <= step.t)]
                values = step.dense_output()(passed).reshape(4, points.shape[1], len(passed))
                course.append(values.swapaxes(1, 2))
        return np.concatenate(course, axis=1)

    def _steps(self, points: Array, torque: Real, longest: float) -> Iterator[DOP853]:
        """SciPy's integrator after each of the steps of a turn."""
        motions, least = points.shape[1], _LEAST * points[2]

        def slope(angle: float, flat: Array) -> Array:
            x, v, w, _ = flat.reshape(4, motions)
            if not (w > least).all():
                _refuse(angle, flat, int(np.argmin(w / least)))
            spin, push = self.solver.accelerations(
                (np.full(motions, angle), x), (w, v), torque - self.damping * w
            )
            return (np.array((v, push, spin, np.ones(motions))) / w).ravel()

        length = self.solver.mechanism.crank.length
        units = np.repeat((length, length, 1.0, 1.0), motions)
        start = np.vstack((points, np.zeros(motions))).ravel()
        steps = DOP853(
            slope, 0.0, start, 2 * math.pi, max_step=longest,
            rtol=_TOLERANCE, atol=_TOLERANCE * units,
        )  # fmt: skip
        for _ in range(_MOST):
            steps.step()
            if steps.status != 'failed':
                yield steps
            if steps.status == 'finished':
                return
            if steps.status == 'failed' or steps.step_size < _SHORTEST:
                break
        _refuse(steps.t, steps.y, 0)


def _refuse(angle: float, flat: Array, motion: int) -> NoReturn:
    position, _, _, time = flat.reshape(4, -1)[:, motion].tolist()
    raise MotionError(
        f'the motion cannot be followed for a turn: at crank angle {np.degrees(angle):.6g} deg '
        'the crank all but stops, or coupler and rod come into one line; drive it with more '
        'torque, or start it faster',
        time=time,
        coordinates=(angle, position),
    )
