# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The averaged equations of Deliu and Vlase, after Van der Pol.

The motion is approximated with one harmonic and a constant crank speed w:

    xD = X0 + a cos phi1 + b sin phi1,    phi1' = w.

This leaves residual forces R on the slider and residual torques R1 on the crank. On average over a
turn, R, R cos phi1, R sin phi1 and R1 vanish; these four equations determine X0, a, b and w.
"""

from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import root

from linkage_lab.pump.shooting import TURN, PeriodicMotion, Shooting
from linkage_ros import LinkageError
from linkage_ros.formulas import Array

_ANGLES = np.linspace(0, TURN, 64, endpoint=False)
_WAVES: Any = np.array((np.ones_like(_ANGLES), np.cos(_ANGLES), np.sin(_ANGLES)))
_ALIKE = 0.1  # largest relative difference in speed and stroke between a motion and its average


class AveragedMotion(NamedTuple):
    """A solution of the averaged equations.

    Attributes:
        mean: Mean X0 of the slider's position, m.
        cosine: Coefficient a, m.
        sine: Coefficient b, m.
        speed: Crank speed w, rad/s.
    """

    mean: float
    cosine: float
    sine: float
    speed: float

    def at(self, angles: Array) -> Array:
        """Evaluates slider position, crank speed and slider velocity at crank angles, rad."""
        x = self.mean + self.cosine * np.cos(angles) + self.sine * np.sin(angles)
        v = self.speed * (self.sine * np.cos(angles) - self.cosine * np.sin(angles))
        return np.array((x, self.speed + 0.0 * x, v))

    @property
    def stroke(self) -> float:
        """Distance between the ends of the slider's motion, m."""
        return float(2 * np.hypot(self.cosine, self.sine))

    @property
    def numbers(self) -> dict[str, float]:
        """Main numbers of the motion, for JSON, in SI units."""
        return {'speed': self.speed, 'stroke': self.stroke, 'flow': self.stroke * self.speed}


def residuals(shooting: Shooting, motion: AveragedMotion, torque: float) -> Array:
    """Computes the means of R, R cos phi1 and R sin phi1, N, and of R1, N m.

    Raises:
        UnreachableError: The dyad does not close at some crank angle.
    """
    x, w, v = motion.at(_ANGLES)
    q, motor_torque = (_ANGLES, x), torque - shooting.motor.damping * w
    free_crank, free_slider = shooting.solver.accelerations(q, (w, v), motor_torque)
    # A motion with other accelerations than the free ones needs the forces M (q'' - free q'').
    # The crank of the approximate motion does not accelerate.
    (m11, m12), (_, m22) = shooting.solver.matrix(q)
    extra = w * w * (motion.mean - x) - free_slider
    forces = m22 * extra - m12 * free_crank
    torques = m12 * extra - m11 * free_crank
    return np.append(_WAVES @ forces, torques.sum()) / len(_ANGLES)


def averaged(motion: PeriodicMotion) -> AveragedMotion | None:
    """Finds the averaged motion near a motion of one turn; None if there is none."""
    if motion.turns > 1:
        return None
    mean, cosine, sine = _WAVES @ motion.at(_ANGLES)[0] / len(_ANGLES)
    guess = np.array((mean, 2 * cosine, 2 * sine, motion.speed))
    try:
        solution = root(
            lambda values: residuals(motion.shooting, AveragedMotion(*values), motion.torque),
            guess,
        )
    except LinkageError:
        return None
    average = AveragedMotion(*solution.x.tolist())
    changes = average.speed / motion.speed - 1, average.stroke / motion.stroke - 1
    is_near = max(map(abs, changes)) < _ALIKE
    return average if solution.success and is_near else None
