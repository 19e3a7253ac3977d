# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The periodic motions of a wind pump by harmonic balance (Galerkin's method).

In a period of n turns, the second coordinate, xD or phi2, and the crank speed are Fourier series
in the crank angle, with H n and H n - 1 harmonics:

    xD    = X0 + a1 cos phi1/n + b1 sin phi1/n + ...
    phi1' = w0 + c1 cos phi1/n + d1 sin phi1/n + ...

The residuals of the equations of motion are the force or torque R2 of the second coordinate and
the torque R1 on the crank. On average over the n turns, R2 times each function of the first series
vanishes, and so does R1 times each function of the second series. This gives as many equations as
coefficients.

With one harmonic the crank speed is constant. The equations are then the averaged equations of
document 3, after Van der Pol. If a1, b1 and w0 vary slowly in time, these equations also determine
the stability of the averaged motion. With 16 harmonics, the motions of the preset are exact to 12
digits.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator
from contextlib import suppress

import numpy as np

from linkage_ros.errors import LinkageError
from linkage_ros.lab.pump.equations import PumpSolver
from linkage_ros.lab.pump.periodic_motion import (
    PeriodicMotion,
    by_size,
    parts_of,
    waves,
)
from linkage_ros.model.wind_pump import WindPump
from linkage_ros.numeric import Array

AVERAGED, EXACT, _FINEST = 1, 16, 64  # harmonics
_SPEEDS, _PLACES = 12, 7  # harmonics of guesses with a slider at rest
_ROUGH = 0.6  # harmonics of a guess, relative to the samples per turn
_WILD = 100.0  # larger multipliers of averaged motions, near a stretched dyad, are meaningless
_TAIL = 1e-4  # largest coefficient of the last harmonic, in crank lengths
# Largest steps of Newton's method, relative; from a neighbouring motion, 4 or 5 steps suffice.
_STEPS = (1.0,) * 4 + (0.1,) * 3 + (0.01,) * 5
_DOUBLED = 0.1  # amplitude of the added waves in the guess of a doubled motion, in its units
_TINY = 1e-12  # smallest range of samples, m, rad or rad/s
_DIFFERENCE = 1e-7  # relative change of the values of a motion, for derivatives


class HarmonicBalance:
    """The harmonic-balance equations of one pump under a motor with a given damping.

    Attributes:
        solver: Solver of the pump.
        damping: Decrease of the motor torque per unit of crank speed, N m s.
        turns: Number of turns after which the motions repeat.
        angles: Evenly spaced crank angles in these turns, rad.
        sizes: Numbers of coefficients of the two series.
    """

    def __init__(
        self, mechanism: WindPump, damping: float, harmonics: int = EXACT, turns: int = 1
    ) -> None:
        self._mechanism, self.damping = mechanism, damping
        # The averaged equations of document 3 are those of the slider's motion.
        self.solver = PumpSolver(mechanism) if harmonics == AVERAGED else PumpSolver.of(mechanism)
        self._harmonics, self.turns = harmonics, turns
        count = harmonics * turns
        self.sizes = second, crank = 2 * count + 1, 2 * count - 1
        self.angles = parts_of(turns, harmonics)
        # For each coefficient: the second coordinate and its first two derivatives with respect to
        # phi1; phi1' and its first derivative with respect to phi1.
        self._waves = np.zeros((5, len(self.angles), second + crank))
        for order in range(3):
            self._waves[order, :, :second] = waves(self.angles, second, turns, order)
        for order in range(2):
            self._waves[3 + order, :, second:] = waves(self.angles, crank, turns, order)

    def over(self, turns: int, harmonics: int = 0) -> HarmonicBalance:
        """Returns the equations for another number of turns; 0 harmonics: as many as here."""
        return _balance(self._mechanism, self.damping, harmonics or self._harmonics, turns)

    def unknowns(self, motion: PeriodicMotion) -> Array:
        """Returns the unknowns of a motion with the same number of turns as these equations.

        The unknowns are the coefficients of both series, and the torque.
        """
        return self.sized(motion.second, motion.crank, np.array([motion.torque]))

    def sized(self, second: Array, crank: Array, torque: Array) -> Array:
        """Makes unknowns from coefficients, cut or padded with 0 to the `sizes`."""
        rows = zip((second, crank), self.sizes, strict=True)
        padded = (np.append(row, np.zeros(size))[:size] for row, size in rows)
        return np.concatenate((*padded, torque))

    def units(self, motion: PeriodicMotion) -> Array:
        """Units of the unknowns: unit of the second coordinate, speed and torque of a motion."""
        unit, speed, _ = motion.units
        return np.repeat((unit, speed, motion.torque), (*self.sizes, 1))

    def tangent(self, motion: PeriodicMotion) -> Array:
        """Differentiates the unknowns by the mean crank speed, along the load curve."""
        jacobian, _ = self.equations(self.unknowns(motion))
        row = jacobian[-1] = self.axis(of_speed=True)
        solved: Array = np.linalg.solve(jacobian, np.eye(len(row))[-1])
        return solved

    def axis(self, *, of_speed: bool) -> Array:
        """Returns the unit vector of an unknown: the mean of the crank speed, or the torque."""
        row = np.zeros(sum(self.sizes) + 1)
        row[self.sizes[0] if of_speed else -1] = 1.0
        return row

    def guess(self, phases: Array, torque: float) -> tuple[Array, float]:
        """Estimates the unknowns of a motion from samples and their slopes over the crank angle.

        Args:
            phases: Both coordinates and their rates at two or more moments of each turn, of shape
                (4, n).
            torque: Torque of the motor at rest, N m.

        Returns:
            The unknowns, in which the coefficients of high harmonics are 0; and the residual of
            the series, relative to the range of the samples.
        """
        angles, known, speed = phases[0], phases[1:3].T, phases[2]
        slopes = self.solver.slopes(torque - self.damping * speed, *phases)[1:3] / speed
        harmonics = int(_ROUGH * len(angles) * 2 * math.pi / np.ptp(angles))
        size = 2 * harmonics * self.turns + 1
        some, steep = (waves(angles, size, self.turns, order) for order in (0, 1))
        second, crank = rows = np.linalg.lstsq(
            np.concatenate((some, steep / harmonics)),
            np.concatenate((known, slopes.T / harmonics)),
            rcond=None,
        )[0].T
        missed = np.abs(some @ rows.T - known) / np.maximum(np.ptp(known, axis=0), _TINY)
        return self.sized(second, crank, np.array([torque])), float(missed.max())

    def doubled(self, motion: PeriodicMotion) -> PeriodicMotion | None:
        """Finds a motion of twice the period near a period-doubling point."""
        twice = self.over(2 * self.turns)
        second, crank = (np.zeros(2 * len(row) - 1) for row in (motion.second, motion.crank))
        for wide, row in ((second, motion.second), (crank, motion.crank)):
            wide[0], wide[3::4], wide[4::4] = row[0], row[1::2], row[2::2]
        unknowns = twice.sized(second, crank, np.array([motion.torque]))
        units = twice.units(motion)
        # The waves that twice the period adds. Along one direction of their coefficients, the
        # equations are singular.
        new = np.concatenate([(np.arange(size) + 1) // 2 % 2 for size in (*twice.sizes, 1)]) > 0
        jacobian = twice.equations(unknowns)[0][:-1] * units
        way = np.zeros(len(unknowns))
        way[new] = np.linalg.svd(jacobian[:, new])[2][-1]
        return twice.find(unknowns + _DOUBLED * way * units, way / units)

    def resting_sliders(self, first: float, last: float) -> Iterator[PeriodicMotion]:
        """Finds motions from guesses in which the slider rests.

        Args:
            first: Mean crank speed of the first guesses, rad/s.
            last: Mean crank speed of the last guesses, rad/s.
        """
        pump = self._mechanism
        r, b, c = pump.crank.length, pump.coupler.length, pump.rod.length
        places = pump.slider.position, *np.linspace(abs(b - c) + r, b + c - r, _PLACES + 2)[1:-1]
        for speed in np.geomspace(first, last, _SPEEDS):
            for x in places:
                with suppress(LinkageError):  # at some crank angle, the dyad cannot close
                    resting = np.broadcast_arrays(self.angles, x, speed, 0.0)
                    guess, _ = self.guess(self.solver.converted(np.array(resting)), 0.0)
                    if motion := self.find(guess, self.axis(of_speed=True)):
                        yield motion

    def find(
        self, guess: Array, fixed: Array | None = None, tolerance: float = 1e-6
    ) -> PeriodicMotion | None:
        """Finds a motion.

        Args:
            guess: Initial unknowns of Newton's method.
            fixed: Direction in which the unknowns are not changed; None keeps the torque.
            tolerance: Relative size of the last step; the error is about the square of this size.

        Returns:
            The motion; None if none was found.
        """
        unknowns, row = guess, self.axis(of_speed=False) if fixed is None else fixed
        try:
            with np.errstate(all='ignore'):  # an overflow ends the search below
                for allowed in _STEPS:
                    jacobian, residuals = self.equations(unknowns)
                    jacobian[-1] = row
                    step = np.linalg.solve(jacobian, residuals)
                    unknowns = unknowns - step
                    size = np.abs(step).max() / np.abs(unknowns).max()
                    if size < tolerance:
                        return self._checked(unknowns, row)
                    if not size <= allowed:  # or nan
                        return None
        except (LinkageError, np.linalg.LinAlgError):
            pass
        return None

    def _checked(self, unknowns: Array, row: Array) -> PeriodicMotion | None:
        """Makes a motion from unknowns, with more harmonics if needed.

        Returns:
            The motion; None if the crank stops or the motion needs too many harmonics.
        """
        cuts = np.cumsum(self.sizes)
        second, crank, (torque,) = np.split(unknowns, cuts)
        given = self.solver, self.damping, second, crank, float(torque), self.turns
        motion = PeriodicMotion(*given)
        if not motion.phase(self.angles)[1].min() > 0:
            return None
        if self._harmonics == AVERAGED:
            averaged = PeriodicMotion(*given, self._slow_multipliers(unknowns))
            return averaged if abs(averaged.multipliers[0]) < _WILD else None
        tail = np.abs(second[-2:]).max() / self.solver.unit
        if tail < _TAIL:  # next to a stretched dyad, multipliers may not be finite
            return motion if np.isfinite(motion.multipliers).all() else None
        if self._harmonics == _FINEST:
            return None
        finer = self.over(self.turns, 2 * self._harmonics)
        return finer.find(finer.unknowns(motion), finer.sized(*np.split(row, cuts)))

    def _slow_multipliers(self, unknowns: Array) -> tuple[complex, ...]:
        """Computes the Floquet multipliers of an averaged motion over a turn, the largest first.

        If a1, b1 and w0 vary slowly, xD'' gains 2 w0 (b1' cos phi1 - a1' sin phi1) +
        w0' dxD/dphi1. The equations become B (X0, a1, b1, w0)' = -J (X0, a1, b1, w0), where J is
        their Jacobian. The rate of X0 does not occur, so X0 follows from the other unknowns.
        """
        values, functions = self._waves @ unknowns[:-1], self._waves
        m11, m12, m22, *_ = self.solver.terms(self.angles, values[0], values[3], values[3])
        speed = unknowns[3]
        push = 2 * speed * functions[1]
        push[:, 0], push[:, 3] = 0.0, values[1]
        spin = functions[3]
        weights = functions[[3, 0]] / len(self.angles)
        inertia = weights[0].T @ (m11[:, None] * spin + m12[:, None] * push)
        inertia += weights[1].T @ (m12[:, None] * spin + m22[:, None] * push)
        jacobian = self.equations(unknowns)[0][:-1, :-1]
        times = np.linalg.eigvals(np.linalg.solve(-jacobian, inertia))
        growth = 1 / times[np.argsort(-np.abs(times))][:3]  # X0 has no rate: the fourth time is 0
        return by_size(np.exp(growth * (2 * math.pi / speed)))

    def equations(self, unknowns: Array) -> tuple[Array, Array]:
        """Computes Jacobian and residuals of the equations; `find` adds the last equation."""
        jacobian, residuals = np.zeros((len(unknowns), len(unknowns))), np.zeros(len(unknowns))
        values = self._waves @ unknowns[:-1]
        steps = _DIFFERENCE * np.array((*[self.solver.unit] * 2, values[3].max()))
        moves = np.zeros((4, 5))
        moves[[1, 2, 3], [0, 1, 3]] = steps
        second, slope, bend, w, rate = (values + moves[..., None]).swapaxes(0, 1)
        m11, m12, m22, h1, h2 = self.solver.terms(self.angles, second, w, w * slope)
        spin, push = w * rate, w * w * bend + w * rate * slope
        torque = unknowns[-1] - self.damping * w
        lacks = np.array((m11 * spin + m12 * push + h1 - torque, m12 * spin + m22 * push + h2))
        by_second, by_slope, by_w = ((lacks[:, 1:] - lacks[:, :1]) / steps[:, None]).swapaxes(0, 1)
        by_spin, by_push = np.array((m11[0], m12[0])), np.array((m12[0], m22[0]))
        by_bend, by_rate = w[0] ** 2 * by_push, w[0] * (by_spin + slope[0] * by_push)
        weights = self._waves[[3, 0]] / len(self.angles)
        residuals[:-1] = np.einsum('enk,en->k', weights, lacks[:, 0])
        by_value = np.array((by_second, by_slope, by_bend, by_w, by_rate))
        for weight, rows in zip(weights, by_value.swapaxes(0, 1), strict=True):
            jacobian[:-1, :-1] += weight.T @ np.einsum('vn,vnk->nk', rows, self._waves)
        jacobian[:-1, -1] = -weights[0].sum(axis=0)
        return jacobian, residuals


@functools.lru_cache(64)
def _balance(mechanism: WindPump, damping: float, harmonics: int, turns: int) -> HarmonicBalance:
    return HarmonicBalance(mechanism, damping, harmonics, turns)
