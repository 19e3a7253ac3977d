# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The periodic motions of a wind pump by harmonic balance (Galerkin's method).

Over n turns, slider position and crank speed are Fourier series in the crank angle, with H n and
H n - 1 harmonics:

    xD    = X0 + a1 cos phi1/n + b1 sin phi1/n + ...
    phi1' = w0 + c1 cos phi1/n + d1 sin phi1/n + ...

The force R2 on the slider and the torque R1 on the crank that are missing in the equations of
motion vanish on average over the turns, R2 weighted with each function of the first series and R1
with each of the second: as many equations as coefficients.

With one harmonic the crank speed is constant. These are the averaged equations of document 3,
after Van der Pol: where a1, b1 and w0 vary slowly in time, they also say whether the averaged
motion is stable. With 16 harmonics the motions of the preset are exact to 12 digits.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from linkage_ros.dynamics.solver import Solver
from linkage_ros.errors import LinkageError
from linkage_ros.lab.pump.periodic_motion import (
    DIFFERENCE,
    PeriodicMotion,
    by_size,
    parts_of,
    waves,
)
from linkage_ros.model.wind_pump import WindPump
from linkage_ros.motion.drives import Motor
from linkage_ros.numeric import Array

AVERAGED, EXACT, _FINEST = 1, 16, 64  # harmonics
_PLACES = 9  # of a resting slider, with the ends of its reach
_TAIL = 1e-4  # largest coefficient of the last harmonic, in crank lengths
_ITERATIONS = 15  # of Newton's method; 4 or 5 suffice from a neighbour
_TOLERANCE = 1e-6  # of the last step, relative: it squares the error


@dataclass(frozen=True, eq=False)
class AveragedMotion(PeriodicMotion):
    """A motion with one harmonic.

    Attributes:
        multipliers: What a turn multiplies small slow deviations by, the largest first.
    """

    multipliers: tuple[complex, ...] = ()


class HarmonicBalance:
    """The equations of one pump, whose motor's torque falls with the crank speed.

    Attributes:
        solver: Solver of the pump.
        damping: Torque that the motor loses per crank speed, N m s.
        turns: After which its motions repeat.
        angles: Crank angles in equal parts of these turns, rad.
    """

    def __init__(
        self, mechanism: WindPump, damping: float, harmonics: int = EXACT, turns: int = 1
    ) -> None:
        self._mechanism, self.solver, self.damping = mechanism, Solver(mechanism), damping
        self._harmonics, self.turns = harmonics, turns
        self._others: dict[int, HarmonicBalance] = {}
        count = harmonics * turns
        self._sizes = slider, crank = 2 * count + 1, 2 * count - 1
        self.angles = parts_of(turns, harmonics)
        # By coefficient: xD, its first and second derivative by phi1, phi1', its derivative.
        self._waves = np.zeros((5, len(self.angles), slider + crank))
        for order in range(3):
            self._waves[order, :, :slider] = waves(self.angles, slider, turns, order)
        for order in range(2):
            self._waves[3 + order, :, slider:] = waves(self.angles, crank, turns, order)

    @functools.cached_property
    def finer(self) -> HarmonicBalance:
        """The equations with twice the harmonics."""
        return HarmonicBalance(self._mechanism, self.damping, 2 * self._harmonics, self.turns)

    def over(self, turns: int) -> HarmonicBalance:
        """The equations of motions that repeat after so many turns."""
        if turns == self.turns:
            return self
        if turns not in self._others:
            self._others[turns] = HarmonicBalance(
                self._mechanism, self.damping, self._harmonics, turns
            )
        return self._others[turns]

    def unknowns(self, motion: PeriodicMotion) -> Array:
        """Coefficients of both series, and the torque, of a motion of as many turns."""
        rows = zip((motion.slider, motion.crank), self._sizes, strict=True)
        padded = (np.append(row, np.zeros(size))[:size] for row, size in rows)
        return np.concatenate((*padded, [motion.torque]))

    def units(self, motion: PeriodicMotion) -> Array:
        """Units of the unknowns: crank length, and speed and torque of a motion."""
        length, speed, _ = motion.units
        return np.repeat((length, speed, motion.torque), (*self._sizes, 1))

    def fit(self, position: Array, speed: Array, torque: float) -> Array:
        """The unknowns of a motion that is known at the angles.

        Args:
            position: Of the slider at `angles`, m.
            speed: Of the crank there, rad/s.
            torque: Torque of the motor at rest, N m.

        Returns:
            Coefficients of both series, and the torque.
        """
        slider = self._sizes[0]
        rows = self._waves[0, :, :slider].T @ position, self._waves[3, :, slider:].T @ speed
        for row in rows:
            row[1:] *= 2
        return np.concatenate((*(row / len(self.angles) for row in rows), [torque]))

    def resting_sliders(self, speed: float) -> Iterator[Array]:
        """Guesses at a mean crank speed: the slider rests somewhere within its reach."""
        pump = self._mechanism
        r, b, c = pump.crank.length, pump.coupler.length, pump.rod.length
        places = pump.slider.position, *np.linspace(abs(b - c) + r, b + c - r, _PLACES)[1:-1]
        one = np.ones(len(self.angles))
        for x in places:
            yield self.fit(x * one, speed * one, 0.0)

    def find(self, guess: Array, condition: Condition) -> PeriodicMotion | None:
        """Finds a motion.

        Args:
            guess: Unknowns from which Newton's method begins.
            condition: What chooses one of the motions.

        Returns:
            The motion, or None if none is found.
        """
        unknowns = guess
        try:
            with np.errstate(all='ignore'):  # what overflows is refused by the equations of motion
                for _ in range(_ITERATIONS):
                    jacobian, residuals = self._equations(unknowns)
                    jacobian[-1], residuals[-1] = condition(self, unknowns)
                    step = np.linalg.solve(jacobian, residuals)
                    unknowns = unknowns - step
                    if np.abs(step).max() < _TOLERANCE * np.abs(unknowns).max():
                        return self._checked(unknowns, condition)
        except (LinkageError, np.linalg.LinAlgError):
            pass
        return None

    def _checked(self, unknowns: Array, condition: Condition) -> PeriodicMotion | None:
        """The motion with these unknowns, with more harmonics where it takes them.

        Returns:
            None: its crank stops, or it takes too many.
        """
        slider, crank, (torque,) = np.split(unknowns, np.cumsum(self._sizes))
        given = self.solver, self.damping, slider, crank, float(torque), self.turns
        if self._harmonics == AVERAGED:
            return AveragedMotion(*given, self.slow_multipliers(unknowns)) if crank > 0 else None
        motion = PeriodicMotion(*given)
        if not motion.at(self.angles)[1].min() > 0:
            return None
        tail = np.abs(slider[-2:]).max() / self._mechanism.crank.length
        if tail < _TAIL:  # the multipliers refuse a motion next to a stretched dyad
            return motion if np.isfinite(motion.multipliers).all() else None
        if self._harmonics == _FINEST:
            return None
        return self.finer.find(self.finer.unknowns(motion), condition)

    def slow_multipliers(self, unknowns: Array) -> tuple[complex, ...]:
        """What a turn multiplies small deviations of an averaged motion by, the largest first.

        With slowly varying a1, b1 and w0 the equations become B (X0, a1, b1, w0)' = -J (...), J
        their Jacobian: xD'' = ... + 2 w0 (b1' cos phi1 - a1' sin phi1) + w0' dxD/dphi1, and X0
        follows the others.
        """
        values, functions = self._waves @ unknowns[:-1], self._waves
        (m11, m12), (_, m22) = self.solver.matrix((self.angles, values[0]))
        speed = unknowns[3]
        push = 2 * speed * functions[1]
        push[:, 0], push[:, 3] = 0.0, values[1]
        spin = functions[3]
        weights = functions[[3, 0]] / len(self.angles)
        inertia = weights[0].T @ (m11[:, None] * spin + m12[:, None] * push)
        inertia += weights[1].T @ (m12[:, None] * spin + m22[:, None] * push)
        jacobian = self._equations(unknowns)[0][:-1, :-1]
        times = np.linalg.eigvals(np.linalg.solve(-jacobian, inertia))
        growth = 1 / times[np.argsort(-np.abs(times))][:3]  # X0 has no rate: the fourth time is 0
        return by_size(np.exp(growth * (2 * math.pi / speed)))

    def _equations(self, unknowns: Array) -> tuple[Array, Array]:
        """The Jacobian of the equations and their residuals; the last are left to a condition."""
        jacobian, residuals = np.zeros((len(unknowns), len(unknowns))), np.zeros(len(unknowns))
        values = self._waves @ unknowns[:-1]
        length, fastest = self._mechanism.crank.length, np.abs(values[3]).max()
        steps = DIFFERENCE * np.array((length, length, length, fastest, fastest))
        moves = np.concatenate((np.zeros((1, 5)), np.diag(steps), np.diag(-steps)))
        lacks = self._lacks(values + moves[..., None], unknowns[-1])
        by_value = (lacks[:, 1:6] - lacks[:, 6:]) / (2 * steps[:, None])
        weights = self._waves[[3, 0]] / len(self.angles)
        residuals[:-1] = np.einsum('enk,en->k', weights, lacks[:, 0])
        for weight, row in zip(weights, by_value, strict=True):
            slopes = sum(one[:, None] * wave for one, wave in zip(row, self._waves, strict=True))
            jacobian[:-1, :-1] += weight.T @ slopes
        jacobian[:-1, -1] = -weights[0].sum(axis=0)
        return jacobian, residuals

    def _lacks(self, values: Array, torque: float) -> Array:
        """R1, N m, and R2, N, at the angles of the turns, for rows of values."""
        x, slope, bend, w, rate = values.swapaxes(0, 1)
        q, u = (np.broadcast_to(self.angles, x.shape), x), (w, w * slope)
        # R = M q'' + h - Q is M (q'' - the q'' of a motion that is left to itself).
        spin, push = self.solver.accelerations(q, u, Motor(torque, self.damping).at(w))
        (m11, m12), (_, m22) = self.solver.matrix(q)
        spin, push = w * rate - spin, w * w * bend + w * rate * slope - push
        return np.array((m11 * spin + m12 * push, m12 * spin + m22 * push))

    def mean_speed(self, unknowns: Array) -> tuple[float, Array]:
        """The mean of 1 / phi1', and its derivatives by the unknowns."""
        functions = self._waves[3]
        w = functions @ unknowns[:-1]
        row = np.append(-np.mean(functions / w[:, None] ** 2, axis=0), 0.0)
        return float(np.mean(1 / w)), row


# Chooses a motion: a further equation of the unknowns, as its derivatives and its residual.
Condition: TypeAlias = Callable[[HarmonicBalance, Array], tuple[Array, float]]


def at_torque(torque: float) -> Condition:
    """That a motor with this torque at rest, N m, keeps the motion up."""

    def condition(balance: HarmonicBalance, unknowns: Array) -> tuple[Array, float]:
        del balance
        row = np.zeros(len(unknowns))
        row[-1] = 1.0
        return row, unknowns[-1] - torque

    return condition


def at_speed(speed: float) -> Condition:
    """That the mean crank speed is this, rad/s."""

    def condition(balance: HarmonicBalance, unknowns: Array) -> tuple[Array, float]:
        mean, row = balance.mean_speed(unknowns)
        return row, mean - 1 / speed

    return condition


def on_plane(one: PeriodicMotion, other: PeriodicMotion, share: float) -> Condition:
    """That the motion lies between or beyond two others, at a share of the way between them."""

    def condition(balance: HarmonicBalance, unknowns: Array) -> tuple[Array, float]:
        start, end = balance.unknowns(one), balance.unknowns(other)
        row = (end - start) / balance.units(one) ** 2
        return row, float(row @ (unknowns - start - share * (end - start)))

    return condition


def between(
    balance: HarmonicBalance, one: PeriodicMotion, other: PeriodicMotion, share: float
) -> Array:
    """A guess between or beyond two motions, at a share of the way between them."""
    start, end = balance.unknowns(one), balance.unknowns(other)
    return start + share * (end - start)
