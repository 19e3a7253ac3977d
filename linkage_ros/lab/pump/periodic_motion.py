# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Motions of a wind pump that repeat after whole turns, as Fourier series in the crank angle.

As long as the crank turns, the crank angle phi is the independent variable in place of time
(M. Henon, Physica D 5 (1982), 412-414).
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from linkage_ros.lab.pump.equations import PumpSolver, assembly
from linkage_ros.model.kinematics import State
from linkage_ros.model.wind_pump import WindPump
from linkage_ros.numeric import Array, wrap

_DIFFERENCE = 1e-5  # relative, for derivatives by central differences
_FINE, _STEPS = 256, 4  # parts of a turn searched for reversals, and Newton steps per reversal
_SAME = 1e-6  # relative difference below which numbers of two motions count as equal
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(96)  # of Gauss's quadrature over a turn
_TINY = 1e-5  # amplitude below which a harmonic counts as absent, in crank lengths


def parts_of(turns: int, harmonics: int) -> Array:
    """Returns evenly spaced crank angles, rad, at which products of two series have an exact mean.

    Args:
        turns: Number of turns of the crank.
        harmonics: Number of periods per turn of the shortest wave.

    Returns:
        Angles, the first at 0.
    """
    count = turns * max(64, 4 * harmonics)
    return np.linspace(0, 2 * math.pi * turns, count, endpoint=False)


def waves(angles: Array, count: int, turns: int, derivative: int = 0) -> Array:
    """Evaluates 1, cos phi/n, sin phi/n, cos 2 phi/n, ... for n turns, or their derivatives.

    Args:
        angles: phi, of shape (m), rad.
        count: Number of functions, odd.
        turns: Number of turns n.
        derivative: Order of the derivative.

    Returns:
        The values of the functions, of shape (m, count).
    """
    return _waves(angles.tobytes(), count, turns, derivative)


@functools.lru_cache(256)  # most are used repeatedly, at equal angles
def _waves(angles: bytes, count: int, turns: int, derivative: int) -> Array:
    first = np.exp(1j / turns * np.frombuffer(angles))
    orders = np.arange(1, count // 2 + 1) / turns
    powers = np.cumprod(np.broadcast_to(first[:, None], (len(first), len(orders))), axis=1)
    pairs = (powers * (1j * orders) ** derivative).view(float)  # cosines and sines in turn
    found: Array = np.insert(pairs, 0, float(derivative == 0), axis=1)
    found.flags.writeable = False
    return found


@dataclass(frozen=True, eq=False)
class PeriodicMotion:
    """A motion that repeats after one or more turns.

    Attributes:
        solver: Solver of the pump.
        damping: Decrease of the motor torque per unit of crank speed, N m s.
        second: Coefficients of the solver's second coordinate, m or rad.
        crank: Coefficients of the crank's speed, rad/s.
        torque: Torque of the motor at rest, N m.
        turns: Number of turns after which the motion repeats.
        slow_multipliers: Floquet multipliers of an averaged motion, for slow deviations in a turn;
            empty: `multipliers` are computed from the motion.
    """

    solver: PumpSolver
    damping: float
    second: Array
    crank: Array
    torque: float
    turns: int = 1
    slow_multipliers: tuple[complex, ...] = ()

    @functools.cached_property
    def angles(self) -> Array:
        """Evenly spaced crank angles over one period, rad."""
        return parts_of(self.turns, len(self.second) // 2 // self.turns)

    @property
    def units(self) -> Array:
        """Units of second coordinate, crank speed and rate of the former; of shape (3)."""
        unit = self.solver.unit
        return np.array((unit, self.speed, unit * self.speed))

    def at(self, angles: Array) -> Array:
        """Evaluates the motion at crank angles.

        Args:
            angles: Crank angles, of shape (n), rad.

        Returns:
            Slider position, m, crank speed, rad/s, and slider velocity, m/s; of shape (3, n).
        """
        return self._series(self.slider, angles)

    def phase(self, angles: Array) -> Array:
        """The motion at crank angles in the solver's coordinates.

        Args:
            angles: Crank angles, of shape (n), rad.

        Returns:
            Second coordinate, crank speed and rate of the former; of shape (3, n).
        """
        return self._series(self.second, angles)

    def _series(self, coefficients: Array, angles: Array) -> Array:
        position, slope = (
            waves(angles, len(coefficients), self.turns, d) @ coefficients for d in (0, 1)
        )
        speed = waves(angles, len(self.crank), self.turns) @ self.crank
        return np.array((position, speed, speed * slope))

    @functools.cached_property
    def _state(self) -> State:
        """The state of all links at the `angles`."""
        second, speed, rate = self.phase(self.angles)
        return self.solver.state((self.angles, second), (speed, rate))

    @functools.cached_property
    def slider(self) -> Array:
        """Coefficients of the slider's position, m."""
        if not self.solver.by_coupler:
            return self.second
        count = len(self.angles)
        slider = self._state.position[self.solver.links.index('slider')]
        found: Array = waves(self.angles, count - 1, self.turns).T @ slider * (2 / count)
        found[0] /= 2
        return found

    @functools.cached_property
    def assembly(self) -> str:
        """Assembly of the dyad: open, crossed, or both in turn."""
        return assembly(self._state)

    def distance(self, phases: Array) -> Array:
        """Computes mean distances of other motions from this one, in the `units` of the values.

        Args:
            phases: Both coordinates and their rates, of shape (4, rows, motions).

        Returns:
            The mean distance over the rows, of shape (motions). Each motion is first shifted by
            the whole number of turns for which this distance is smallest.
        """
        _, rows, motions = phases.shape
        apart = []
        for turn in range(self.turns):
            angles = (phases[0] + 2 * math.pi * turn).ravel()
            away = self.phase(angles).reshape(3, rows, motions) - phases[1:]
            if self.solver.by_coupler:
                away[0] = wrap(away[0], np.rint)
            apart.append((np.abs(away) / self.units[:, None, None]).max(axis=0).mean(axis=0))
        nearest: Array = np.min(apart, axis=0)
        return nearest

    def is_same(self, other: PeriodicMotion) -> bool:
        """Returns whether another motion is the same, up to a shift by whole turns."""
        ours, theirs = (np.array((one.speed, one.stroke, one.torque)) for one in (self, other))
        return self.turns == other.turns and bool(np.allclose(ours, theirs, rtol=_SAME, atol=0))

    def subharmonics(self, part: int) -> Array:
        """Returns coefficients that vanish if the motion repeats after a fraction of its turns.

        Args:
            part: Number of repetitions within the turns of the motion.

        Returns:
            Coefficients of the second coordinate, in its unit.
        """
        orders = np.arange(1, len(self.second) // 2 + 1)
        chosen = np.repeat(orders % part > 0, 2)
        return self.second[1:][chosen] / self.solver.unit

    @property
    def repeats_sooner(self) -> bool:
        """Whether the motion already repeats after a fraction of its turns."""
        parts = (part for part in range(2, self.turns + 1) if self.turns % part == 0)
        return any(np.abs(self.subharmonics(part)).max() < _TINY for part in parts)

    @functools.cached_property
    def speed(self) -> float:
        """Mean crank speed over time, rad/s."""
        return float(1 / np.mean(1 / self.phase(self.angles)[1]))

    @functools.cached_property
    def speeds(self) -> list[float]:
        """Mean crank speed over time in each turn, rad/s."""
        angles = math.pi * (_NODES + 1)
        turns = (self.phase(angles + 2 * math.pi * turn)[1] for turn in range(self.turns))
        return [float(2 / (_WEIGHTS @ (1 / speed))) for speed in turns]

    @property
    def load(self) -> float:
        """Mean torque on the crank over time, N m."""
        return self.torque - self.damping * self.speed

    @functools.cached_property
    def turning_points(self) -> Array:
        """Positions at which the slider reverses, in order, m."""
        grid: Any = np.arange(self.turns * _FINE) * (2 * math.pi / _FINE)
        slope = waves(grid, len(self.slider), self.turns, 1) @ self.slider
        angles = grid[np.sign(slope) != np.sign(np.roll(slope, -1))]
        for _ in range(_STEPS):
            slope, bend = (
                waves(angles, len(self.slider), self.turns, d) @ self.slider for d in (1, 2)
            )
            move = np.clip(slope / np.where(bend, bend, np.inf), -grid[1], grid[1])
            angles = angles - move
        points: Array = waves(angles, len(self.slider), self.turns) @ self.slider
        return points

    @property
    def stroke(self) -> float:
        """Distance between the ends of the slider's motion, m."""
        return float(np.ptp(self.turning_points))

    @property
    def flow(self) -> float:
        """Forward travel of the slider per turn, times the speed, m/s (proportional to flow)."""
        points = self.turning_points
        forth = np.abs(points - np.roll(points, 1)).sum() / 2
        return float(forth / self.turns * self.speed)

    @functools.cached_property
    def efficiency(self) -> float | None:
        """Fraction of the crank's power that reaches the lift load; None if there is no lift load.

        The lift load is the force and the load curve of the slider; a constant force takes no
        power in a period.
        """
        pump = cast('WindPump', self.solver.mechanism)
        slider, lifts = pump.slider, (getattr(load, 'link', '') for load in pump.loads)
        if not slider.force and 'slider' not in lifts:
            return None
        x, w, v = self.at(self.angles)
        torque = self.torque - self.damping * w
        force = self.solver.load_forces(self._state)['slider'] + slider.damping * v
        force = force + slider.stiffness * (x - slider.rest_position)
        return float(-np.mean(force * v / w) / np.mean(torque))

    @functools.cached_property
    def multipliers(self) -> tuple[complex, ...]:
        """Floquet multipliers, the largest first: factors of small deviations over a period."""
        return self.slow_multipliers or by_size(np.linalg.eigvals(self.monodromy))

    @functools.cached_property
    def monodromy(self) -> Array:
        """Derivatives of the `phase` after a period with respect to that before it.

        They are computed by Magnus' method of order 4 (S. Blanes and others, Physics Reports 470
        (2009), 151-238).
        """
        angles = self.angles
        step = angles[1]
        aside = step * math.sqrt(3) / 6
        jacobians = self._jacobians(np.concatenate((angles - aside, angles + aside)))
        one, other = step * jacobians.reshape(2, -1, 3, 3)
        exponents = (one + other) / 2 - math.sqrt(3) / 12 * (one @ other - other @ one)
        # Matrix exponentials by Pade approximation; SciPy's function is five times slower for such
        # small matrices.
        squares = exponents @ exponents
        even, odd = np.eye(3) + squares / 10, exponents / 2 + exponents @ squares / 120
        factors = np.linalg.solve(even - odd, even + odd)
        product: Array = functools.reduce(lambda before, factor: factor @ before, factors)
        return product

    def _jacobians(self, angles: Array) -> Array:
        """Computes the Jacobian matrices of d(values)/d(crank angle), of shape (n, 3, 3)."""
        steps = _DIFFERENCE * self.units
        moves = np.concatenate((np.diag(steps), np.diag(-steps)))
        second, w, rate = self.phase(angles)[:, None] + moves.T[..., None]
        torque = self.torque - self.damping * w
        slopes = self.solver.slopes(torque, angles, second, w, rate)[1:] / w
        derivatives = (slopes[:, :3] - slopes[:, 3:]) / (2 * steps[:, None])
        jacobians: Array = derivatives.transpose(2, 0, 1)
        return jacobians

    @property
    def stable(self) -> bool:
        """Whether small deviations decay."""
        return abs(self.multipliers[0]) < 1

    @property
    def numbers(self) -> dict[str, Any]:
        """Main numbers of the motion, for JSON, in SI units."""
        return {
            **{
                name: getattr(self, name) for name in ('torque', 'load', 'speed', 'stroke', 'flow')
            },
            'multipliers': [[value.real, value.imag] for value in self.multipliers],
        }

    def record(self) -> dict[str, Any]:
        """Returns the motion as a JSON record, in SI units; period in turns."""
        start = self.at(np.zeros(1))[:, 0].tolist()
        names = 'slider_position', 'crank_speed', 'slider_velocity'
        return {
            **self.numbers,
            'efficiency': self.efficiency,
            'stable': self.stable,
            'period': self.turns,
            'assembly': self.assembly,
            'speeds': self.speeds,
            'slider_lowest': float(self.turning_points.min()),
            'slider_highest': float(self.turning_points.max()),
            'at_crank_angle_0': dict(zip(names, start, strict=True)),
        }


def by_size(values: Any) -> tuple[complex, ...]:
    """Sorts multipliers by magnitude, the largest first.

    Of a complex pair, the multiplier with the positive imaginary part comes first.
    """
    ordered = sorted(values.tolist(), key=lambda one: (-round(abs(one), 9), -one.imag))
    return tuple(map(complex, ordered))
