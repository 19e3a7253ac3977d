# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The periodic motions of a wind pump by harmonic balance (Galerkin's method).

In a period of n turns, the angles of coupler and rod and the crank speed are Fourier series in the
crank angle, with H n, H n and H n - 1 harmonics:

    phi2  = X0 + a1 cos phi1/n + b1 sin phi1/n + ...
    phi3  = Y0 + ...
    phi1' = w0 + c1 cos phi1/n + d1 sin phi1/n + ...

The residuals are the torque R2 on the dyad, the closure G, and the torque R1 on the crank (see
`equations`). On average over the n turns, R2 times each function of the first series vanishes, and
so do G times each function of the second and R1 times each function of the third. The number of
these equations equals the number of coefficients.

With one harmonic, the slider's position xD replaces both angles, and the crank speed is constant.
The equations are then the averaged equations of document 3, after Van der Pol. If a1, b1 and w0
vary slowly in time, these equations also determine the stability of the averaged motion. With 16
harmonics, the motions of the preset are exact to 12 digits.
"""

import functools
import itertools
import math
import operator
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.linalg import lu_factor, lu_solve

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

AVERAGED, EXACT = 1, 16  # harmonics
_SPEEDS, _PLACES = 12, 7  # harmonics of guesses with a slider at rest
_ROUGH = 0.6  # harmonics of a guess, relative to the samples per turn
_WILD = 100.0  # larger multipliers of averaged motions, near a stretched dyad, are meaningless
_ROUGHEST = 1e-4  # largest last coefficient with the largest number of harmonics, in crank lengths
# Largest steps of Newton's method, relative; from a neighbouring motion, 4 or 5 steps suffice.
_STEPS = (1.0,) * 4 + (0.1,) * 3 + (0.01,) * 5
# A Jacobian is reused after a step below _CLOSE and below _FALLS times the step before it.
_CLOSE, _FALLS = 0.1, 0.2
_DOUBLED = 0.1  # amplitude of the added waves in the guess of a doubled motion, in its units
_TINY = 1e-12  # smallest range of samples, m, rad or rad/s
_DIFFERENCE = 1e-7  # relative change of the values of a motion, for derivatives


class Accuracy(NamedTuple):
    """Accuracy with which a motion is computed.

    Attributes:
        error: Largest estimated relative error.
        tail: Largest coefficient of the last harmonic, in crank lengths. With the largest number
            of harmonics, 1e-4 is allowed.
        most: Largest number of harmonics per period.
    """

    error: float
    tail: float
    most: int


STATE = Accuracy(1e-12, 1e-6, 256)  # of a steady state


class HarmonicBalance:
    """The harmonic-balance equations of one pump under a motor with a given damping.

    Attributes:
        solver: Solver of the pump.
        damping: Decrease of the motor torque per unit of crank speed, N m s.
        turns: Number of turns after which the motions repeat.
        angles: Evenly spaced crank angles in these turns, rad.
        sizes: Numbers of coefficients of the series.
    """

    def __init__(
        self, mechanism: WindPump, damping: float, harmonics: int = EXACT, turns: int = 1
    ) -> None:
        self._mechanism, self.damping = mechanism, damping
        self.solver = PumpSolver(mechanism, by_slider=harmonics == AVERAGED)
        self._harmonics, self.turns = harmonics, turns
        count, places = harmonics * turns, len(self.solver.places)
        self.sizes = (*[2 * count + 1] * places, 2 * count - 1)
        self.angles = parts_of(turns, harmonics)
        # The functions of each series and their derivatives with respect to phi1: two for a place,
        # one for phi1'.
        self._waves = [
            np.array([waves(self.angles, size, turns, order) for order in range(orders)])
            for size, orders in zip(self.sizes, (*[3] * places, 2), strict=True)
        ]
        self._weights = [functions[0].T / len(self.angles) for functions in self._waves]
        ends = np.cumsum((0, *self.sizes)).tolist()
        self._parts = [slice(*pair) for pair in itertools.pairwise(ends)]

    def over(self, turns: int, harmonics: int = 0) -> 'HarmonicBalance':
        """Returns the equations for another number of turns; 0 keeps the number of harmonics."""
        return _balance(self._mechanism, self.damping, harmonics or self._harmonics, turns)

    def finer(self, most: int) -> 'HarmonicBalance | None':
        """Returns the equations with twice as many harmonics; None beyond the largest number."""
        harmonics = 2 * self._harmonics
        return self.over(self.turns, harmonics) if harmonics * self.turns <= most else None

    def unknowns(self, motion: PeriodicMotion) -> Array:
        """Returns the unknowns of a motion with the same number of turns as these equations.

        The unknowns are the coefficients of the series, and the torque.
        """
        return self.sized(*motion.places, motion.crank, np.array([motion.torque]))

    def sized(self, *rows: Array) -> Array:
        """Makes unknowns from coefficients, cut or padded to the `sizes`, and the torque."""
        return np.concatenate([
            np.append(row, np.zeros(size))[:size]
            for row, size in zip(rows, (*self.sizes, 1), strict=True)
        ])  # fmt: skip

    def split(self, unknowns: Array) -> list[Array]:
        """Splits unknowns into the coefficients of each series, and the torque."""
        return np.split(unknowns, [part.stop for part in self._parts])

    def units(self, motion: PeriodicMotion) -> Array:
        """Units of the unknowns: units of the places, speed and torque of a motion."""
        each = *self.solver.units[:-1], motion.speed, motion.torque
        return np.repeat(each, (*self.sizes, 1))

    def tangent(self, motion: PeriodicMotion) -> Array:
        """Returns the derivative of the unknowns with respect to the mean crank speed."""
        jacobian = self.jacobian(self.unknowns(motion))
        row = jacobian[-1] = self.axis(of_speed=True)
        return np.linalg.solve(jacobian, np.eye(len(row))[-1])

    def axis(self, *, of_speed: bool) -> Array:
        """Returns the unit vector of an unknown: the mean of the crank speed, or the torque."""
        row = np.zeros(sum(self.sizes) + 1)
        row[self._parts[-1].start if of_speed else -1] = 1.0
        return row

    def guess(self, phases: Array, torque: float) -> tuple[Array, float]:
        """Estimates the unknowns of a motion from samples and their slopes over the crank angle.

        Args:
            phases: Phases of the solver at two or more moments of each turn, of shape (k, n).
            torque: Torque of the motor at rest, N m.

        Returns:
            The unknowns, in which the coefficients of high harmonics are 0; and the residual of
            the series, relative to the range of the samples.
        """
        angles, known, speed = phases[0], phases[1:-1], phases[-2]
        slopes = self.solver.slopes(torque - self.damping * speed, *phases)[1:-1] / speed
        harmonics = int(_ROUGH * len(angles) * 2 * math.pi / np.ptp(angles))
        size = 2 * harmonics * self.turns + 1
        some, steep = (waves(angles, size, self.turns, order) for order in (0, 1))
        rows = np.linalg.lstsq(
            np.concatenate((some, steep / harmonics)),
            np.concatenate((known.T, slopes.T / harmonics)),
            rcond=None,
        )[0].T
        missed = np.abs(some @ rows.T - known.T) / np.maximum(np.ptp(known, axis=1), _TINY)
        return self.sized(*rows, np.array([torque])), float(missed.max())

    def doubled(self, motion: PeriodicMotion) -> PeriodicMotion | None:
        """Finds a motion of twice the period near a period-doubling point."""
        twice = self.over(2 * self.turns)
        rows = (_over_twice(row) for row in (*motion.places, motion.crank))
        unknowns = twice.sized(*rows, np.array([motion.torque]))
        units = twice.units(motion)
        # Terms that appear only at twice the period. The equations are singular along one
        # direction of their coefficients.
        new = np.concatenate([(np.arange(size) + 1) // 2 % 2 for size in (*twice.sizes, 1)]) > 0
        jacobian = twice.jacobian(unknowns)[:-1] * units
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
                    resting = np.array(np.broadcast_arrays(self.angles, x, speed, 0.0))
                    guess, _ = self.guess(np.unwrap(self.solver.converted(resting)), 0.0)
                    if motion := self.find(guess, self.axis(of_speed=True)):
                        yield motion

    def find(
        self, guess: Array, fixed: Array | None = None, accuracy: Accuracy = STATE
    ) -> PeriodicMotion | None:
        """Finds a motion.

        Args:
            guess: Initial unknowns of Newton's method.
            fixed: Direction in which the unknowns are kept; None keeps the torque.
            accuracy: Required accuracy of the motion.

        Returns:
            The motion; None if none was found.
        """
        unknowns, row = guess, self.axis(of_speed=False) if fixed is None else fixed
        size, is_new = math.inf, True
        # An overflow makes a step too large.
        with suppress(LinkageError, np.linalg.LinAlgError), np.errstate(all='ignore'):
            for allowed in _STEPS:
                if is_new:
                    jacobian = self.jacobian(unknowns)
                    jacobian[-1] = row
                    factors = lu_factor(jacobian, overwrite_a=True)
                step = lu_solve(factors, self.residuals(unknowns))
                unknowns = unknowns - step
                before, size = size, np.abs(step).max() / np.abs(unknowns).max()
                if size * (size if is_new else size / before) < accuracy.error:
                    return self._checked(unknowns, row, accuracy)
                if not size <= allowed:  # or nan
                    break
                is_new = size > min(_CLOSE, _FALLS * before)
        return None

    def _checked(self, unknowns: Array, row: Array, accuracy: Accuracy) -> PeriodicMotion | None:
        """Makes a motion from unknowns, with more harmonics if needed.

        Returns:
            The motion; None if the crank stops or the motion needs too many harmonics.
        """
        *places, crank, (torque,) = self.split(unknowns)
        motion = PeriodicMotion(
            self.solver, self.damping, tuple(places), crank, float(torque), self.turns
        )
        if not motion.phase(self.angles)[-2].min() > 0:
            return None
        if self._harmonics == AVERAGED:
            averaged = replace(motion, slow_multipliers=self._slow_multipliers(unknowns))
            return averaged if abs(averaged.multipliers[0]) < _WILD else None
        finer = self.finer(accuracy.most)
        if motion.tail < (accuracy.tail if finer else _ROUGHEST):
            return motion if np.isfinite(motion.multipliers).all() else None
        if finer is None:
            return None
        guess, fixed = (finer.sized(*self.split(one)) for one in (unknowns, row))
        return finer.find(guess, fixed, accuracy)

    def _slow_multipliers(self, unknowns: Array) -> tuple[complex, ...]:
        """Computes the Floquet multipliers of an averaged motion over a turn, the largest first.

        If a1, b1 and w0 vary slowly, xD'' gains 2 w0 (b1' cos phi1 - a1' sin phi1) +
        w0' dxD/dphi1. The equations become B (X0, a1, b1, w0)' = -J (X0, a1, b1, w0), where J is
        their Jacobian. The rate of X0 does not occur, so X0 follows from the other unknowns.
        """
        functions, weights = self._waves[0], self._weights[0]
        places, slopes, _ = functions @ unknowns[:3]
        (m11, m12), (_, m22) = self.solver.matrix((self.angles, places))
        speed = unknowns[3]
        # Derivatives of the forces with respect to the rates of X0, a1, b1 and w0.
        push = np.column_stack((2 * speed * functions[1], slopes))
        push[:, 0], spin = 0.0, np.eye(1, 4, 3)
        inertia = np.vstack(
            (
                weights @ (m12[:, None] * spin + m22[:, None] * push),
                np.mean(m11[:, None] * spin + m12[:, None] * push, axis=0),
            )
        )
        jacobian = self.jacobian(unknowns)[:-1, :-1]
        times = np.linalg.eigvals(np.linalg.solve(-jacobian, inertia))
        growth = 1 / times[np.argsort(-np.abs(times))][:3]  # X0 has no rate: the fourth time is 0
        return by_size(np.exp(growth * (2 * math.pi / speed)))

    def residuals(self, unknowns: Array) -> Array:
        """Computes the residuals; the last, of the condition that `find` adds, is 0."""
        lacks = self._lacks(self._values(unknowns)[:, None], unknowns[-1])
        means = [weights @ lack[0] for weights, lack in zip(self._weights, lacks, strict=True)]
        return np.concatenate((*means, [0.0]))

    def jacobian(self, unknowns: Array) -> Array:
        """Computes the Jacobian; its last row, for the condition that `find` adds, is 0."""
        values = self._values(unknowns)
        units = [*np.repeat(self.solver.units[:-1], 3), *[values[-2].max()] * 2]
        steps = _DIFFERENCE * np.array(units)
        moves = np.vstack((np.zeros(len(units)), np.diag(steps)))
        lacks = self._lacks(values[:, None] + moves.T[..., None], unknowns[-1])
        by_value = (lacks[:, 1:] - lacks[:, :1]) / steps[:, None]
        jacobian = np.zeros((len(unknowns), len(unknowns)))
        for part, weights, by in zip(self._parts, self._weights, by_value, strict=True):
            for i, (other, functions) in enumerate(zip(self._parts, self._waves, strict=True)):
                some = by[3 * i : 3 * i + len(functions)]
                jacobian[part, other] = weights @ np.einsum('vn,vnk->nk', some, functions)
        jacobian[self._parts[-1], -1] = -self._weights[-1].sum(axis=1)
        return jacobian

    def _values(self, unknowns: Array) -> Array:
        """Computes the places and the crank speed with their derivatives, one row each."""
        *rows, _ = self.split(unknowns)
        return np.concatenate(list(map(operator.matmul, self._waves, rows)))

    def _lacks(self, values: Array, torque: float) -> Array:
        """Computes the residuals at all angles for rows of values, each of shape (m, angles)."""
        places, slopes, bends = values[:-2].reshape(-1, 3, *values.shape[1:]).swapaxes(0, 1)
        w, slope = values[-2:]
        rates = np.array((w, *w * slopes))
        changes = np.array((w * slope, *w * w * bends + w * slope * slopes))
        lacks = self.solver.residuals(self.angles, places, rates, changes)
        lacks[-1] -= torque - self.damping * w
        return lacks


def _over_twice(row: Array) -> Array:
    """Returns the coefficients of a series for twice as many turns."""
    wide = np.zeros(2 * len(row) - 1)
    wide[0], wide[3::4], wide[4::4] = row[0], row[1::2], row[2::2]
    return wide


@functools.lru_cache(64)
def _balance(mechanism: WindPump, damping: float, harmonics: int, turns: int) -> HarmonicBalance:
    return HarmonicBalance(mechanism, damping, harmonics, turns)
