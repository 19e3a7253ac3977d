# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The periodic motions of a wind pump by harmonic balance (Galerkin's method).

Slider position and crank speed are Fourier series in the crank angle, with H and H - 1 harmonics:

    xD    = X0 + a1 cos phi1 + b1 sin phi1 + ...
    phi1' = w0 + c1 cos phi1 + d1 sin phi1 + ...

The force R2 on the slider and the torque R1 on the crank that are missing in the equations of
motion vanish on average over a turn, R2 weighted with each function of the first series and R1
with each of the second: as many equations as coefficients.

With one harmonic the crank speed is constant. These are the averaged equations of document 3,
after Van der Pol. With 16 harmonics the motions of the preset are exact to 12 digits.
"""

from __future__ import annotations

import numpy as np

from linkage_ros.dynamics.solver import Solver
from linkage_ros.errors import LinkageError
from linkage_ros.lab.pump.periodic_motion import (
    ANGLES,
    DIFFERENCE,
    PARTS,
    PeriodicMotion,
    waves,
)
from linkage_ros.model.wind_pump import WindPump
from linkage_ros.motion.drives import Motor
from linkage_ros.numeric import Array

AVERAGED, EXACT = 1, 16  # harmonics
_PLACES = 9  # of a resting slider, with the ends of its reach
_TAIL = 1e-4  # largest coefficient of the last harmonic, in crank lengths
_ITERATIONS = 15  # of Newton's method; 4 or 5 suffice from a neighbour
_TOLERANCE = 1e-9  # of the last step, relative: it squares the error


class HarmonicBalance:
    """The equations of one pump, whose motor's torque falls with the crank speed.

    Attributes:
        solver: Solver of the pump.
        damping: Torque that the motor loses per crank speed, N m s.
    """

    def __init__(self, mechanism: WindPump, damping: float, harmonics: int) -> None:
        self._mechanism, self.solver, self.damping = mechanism, Solver(mechanism), damping
        self._sizes = slider, crank = 2 * harmonics + 1, 2 * harmonics - 1
        # By coefficient: xD, its first and second derivative by phi1, phi1', its derivative.
        self._waves = np.zeros((5, PARTS, slider + crank))
        for order in range(3):
            self._waves[order, :, :slider] = waves(ANGLES, slider, order)
        for order in range(2):
            self._waves[3 + order, :, slider:] = waves(ANGLES, crank, order)

    def fit(self, phases: Array, torque: float) -> Array:
        """The unknowns that fit a motion best.

        Args:
            phases: Crank angle, slider position and their rates, of shape (4, n).
            torque: Torque of the motor at rest, N m.

        Returns:
            Coefficients of both series, and the torque.
        """
        angle, position, speed, _ = phases
        slider, crank = self._sizes
        return np.concatenate((
            np.linalg.lstsq(waves(angle, slider), position)[0],
            np.linalg.lstsq(waves(angle, crank), speed)[0],
            [torque],
        ))  # fmt: skip

    def resting_sliders(self, speed: float) -> list[Array]:
        """Guesses at a mean crank speed: the slider rests somewhere within its reach."""
        pump = self._mechanism
        r, b, c = pump.crank.length, pump.coupler.length, pump.rod.length
        places = pump.slider.position, *np.linspace(abs(b - c) + r, b + c - r, _PLACES)[1:-1]
        one, none = np.ones(PARTS), np.zeros(PARTS)
        return [self.fit(np.array((ANGLES, x * one, speed * one, none)), 0.0) for x in places]

    def find(
        self, guess: Array, *, torque: float | None = None, speed: float = 0.0
    ) -> PeriodicMotion | None:
        """Finds a motion.

        Args:
            guess: Unknowns from which Newton's method begins.
            torque: Torque of the motor at rest, N m; None: the speed is given.
            speed: Mean crank speed, rad/s.

        Returns:
            The motion, or None if none is found.
        """
        unknowns = guess
        try:
            with np.errstate(all='ignore'):  # what overflows is refused by the equations of motion
                for _ in range(_ITERATIONS):
                    step = np.linalg.solve(*self._equations(unknowns, torque, speed))
                    unknowns = unknowns - step
                    if np.abs(step).max() < _TOLERANCE * np.abs(unknowns).max():
                        return self._motion(unknowns)
        except (LinkageError, np.linalg.LinAlgError):
            pass
        return None

    def _motion(self, unknowns: Array) -> PeriodicMotion | None:
        """The motion with these unknowns; None: its crank stops, or it takes more harmonics."""
        slider, crank, (torque,) = np.split(unknowns, np.cumsum(self._sizes))
        motion = PeriodicMotion(self.solver, self.damping, slider, crank, float(torque))
        tail = np.abs(slider[-2:]).max() / self._mechanism.crank.length
        is_whole = len(slider) == 2 * AVERAGED + 1 or tail < _TAIL
        return motion if is_whole and motion.at(ANGLES)[1].min() > 0 else None

    def _equations(
        self, unknowns: Array, torque: float | None, speed: float
    ) -> tuple[Array, Array]:
        """The Jacobian of the equations and their residuals; the last is the condition."""
        jacobian, residuals = np.zeros((len(unknowns), len(unknowns))), np.zeros(len(unknowns))
        values = self._waves @ unknowns[:-1]
        length, fastest = self._mechanism.crank.length, np.abs(values[3]).max()
        steps = DIFFERENCE * np.array((length, length, length, fastest, fastest))
        moves = np.concatenate((np.zeros((1, 5)), np.diag(steps), np.diag(-steps)))
        lacks = self._lacks(values + moves[..., None], unknowns[-1])
        by_value = (lacks[:, 1:6] - lacks[:, 6:]) / (2 * steps[:, None])
        slopes = np.einsum('evn,vnk->enk', by_value, self._waves)
        weights = self._waves[[3, 0]] / PARTS
        residuals[:-1] = np.einsum('enk,en->k', weights, lacks[:, 0])
        jacobian[:-1, :-1] = (weights.swapaxes(1, 2) @ slopes).sum(axis=0)
        jacobian[:-1, -1] = -weights[0].sum(axis=0)
        if torque is None:
            residuals[-1] = np.mean(1 / values[3]) - 1 / speed
            jacobian[-1, :-1] = -np.mean(self._waves[3] / values[3, :, None] ** 2, axis=0)
        else:
            residuals[-1] = unknowns[-1] - torque
            jacobian[-1, -1] = 1.0
        return jacobian, residuals

    def _lacks(self, values: Array, torque: float) -> Array:
        """R1, N m, and R2, N, at the angles of a turn, for rows of values."""
        x, slope, bend, w, rate = values.swapaxes(0, 1)
        q, u = (np.broadcast_to(ANGLES, x.shape), x), (w, w * slope)
        # R = M q'' + h - Q is M (q'' - the q'' of a motion that is left to itself).
        spin, push = self.solver.accelerations(q, u, Motor(torque, self.damping).at(w))
        (m11, m12), (_, m22) = self.solver.matrix(q)
        spin, push = w * rate - spin, w * w * bend + w * rate * slope - push
        return np.array((m11 * spin + m12 * push, m12 * spin + m22 * push))
