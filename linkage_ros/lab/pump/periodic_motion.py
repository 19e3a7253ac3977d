# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Motions of a wind pump that repeat after whole turns, as Fourier series in the crank angle.

As long as the crank turns, the crank angle phi is the independent variable in place of time
(M. Henon, Physica D 5 (1982), 412-414).
"""

import functools
import math
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np

from linkage_ros.lab.pump.equations import PumpSolver, assembly
from linkage_ros.model.kinematics import State
from linkage_ros.model.wind_pump import WindPump
from linkage_ros.numeric import Array, wrap

_DIFFERENCE = 1e-5  # relative, for derivatives by central differences
_FINE, _STEPS = 256, 4  # parts of a turn searched for reversals, and Newton steps per reversal
_SAME = 1e-4  # relative difference below which numbers of two motions count as equal
# Parts of a turn, and nodes in each, of Gauss's quadrature over a turn.
_PARTS, (_NODES, _WEIGHTS) = 8, np.polynomial.legendre.leggauss(48)
_TINY = 1e-5  # amplitude below which a harmonic counts as absent, in crank lengths


def parts_of(turns: int, harmonics: int) -> Array:
    """Returns evenly spaced crank angles, rad, at which products of two series have an exact mean.

    Args:
        turns: Number of turns of the crank.
        harmonics: Number of periods per turn of the shortest wave.

    Returns:
        Angles, the first at 0.
    """
    return np.linspace(0, 2 * math.pi * turns, turns * max(64, 4 * harmonics), endpoint=False)


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
    found = np.insert(pairs, 0, float(derivative == 0), axis=1)
    found.flags.writeable = False
    return found


@dataclass(frozen=True, eq=False)
class PeriodicMotion:
    """A motion that repeats after one or more turns.

    Attributes:
        solver: Solver of the pump.
        damping: Decrease of the motor torque per unit of crank speed, N m s.
        places: Coefficients of the positions of the solver's places, m or rad.
        crank: Coefficients of the crank's speed, rad/s.
        torque: Torque of the motor at rest, N m.
        turns: Number of turns after which the motion repeats.
        slow_multipliers: Floquet multipliers of an averaged motion, for slow deviations over a
            turn; if empty, `multipliers` are computed from the motion.
    """

    solver: PumpSolver
    damping: float
    places: tuple[Array, ...]
    crank: Array
    torque: float
    turns: int = 1
    slow_multipliers: tuple[complex, ...] = ()

    @functools.cached_property
    def angles(self) -> Array:
        """Evenly spaced crank angles over one period, rad."""
        return parts_of(self.turns, self.harmonics)

    @property
    def harmonics(self) -> int:
        """Number of periods per turn of the shortest wave."""
        return len(self.crank) // 2 // self.turns + 1

    @property
    def units(self) -> Array:
        """Units of the values of `phase`."""
        *places, rate = self.solver.units
        return np.array((*places, self.speed, rate * self.speed))

    @property
    def tail(self) -> float:
        """Largest coefficient of the last harmonic, in crank lengths."""
        rows = zip(self.places, self.solver.units, strict=False)
        return max(float(np.abs(row[-2:]).max() / unit) for row, unit in rows)

    def at(self, angles: Array) -> Array:
        """Evaluates the motion at crank angles.

        Args:
            angles: Crank angles, of shape (n), rad.

        Returns:
            Slider position, m, crank speed, rad/s, and slider velocity, m/s; of shape (3, n).
        """
        position, slope = (self._series(self.slider, angles, order) for order in (0, 1))
        speed = self._series(self.crank, angles)
        return np.array((position, speed, speed * slope))

    def _series(self, row: Array, angles: Array, derivative: int = 0) -> Array:
        """Evaluates a series with the coefficients `row`, or a derivative."""
        return waves(angles, len(row), self.turns, derivative) @ row

    def phase(self, angles: Array) -> Array:
        """Returns the motion at crank angles as phases of the solver, without the crank angle.

        Args:
            angles: Crank angles, of shape (n), rad.
        """
        places, slopes = (
            np.array([self._series(row, angles, order) for row in self.places]) for order in (0, 1)
        )
        speed = self._series(self.crank, angles)
        return self.solver.phases(angles, places, speed, slopes * speed)[1:]

    def states(self, angles: Array) -> State:
        """Computes the motion of all links at crank angles, of shape (n), rad."""
        phase = self.phase(angles)
        return self.solver.states(self.torque - self.damping * phase[-2], angles, *phase)

    @functools.cached_property
    def _state(self) -> State:
        return self.states(self.angles)

    @functools.cached_property
    def slider(self) -> Array:
        """Coefficients of the slider's position, m."""
        if self.solver.by_slider:
            return self.places[0]
        count = len(self.angles)
        found = (
            waves(self.angles, count - 1, self.turns).T @ self._state.position[-1] * (2 / count)
        )
        found[0] /= 2
        return found

    @functools.cached_property
    def assembly(self) -> str:
        """Assembly of the dyad: open, crossed, or alternating between both."""
        _, coupler, rod, _ = self._state.position
        return assembly(coupler, rod)

    def distance(self, phases: Array) -> Array:
        """Computes mean distances of other motions from this one, in the `units` of the values.

        Args:
            phases: Phases of the solver, of shape (k, rows, motions).

        Returns:
            The mean distance over the rows, of shape (motions). Each motion is first shifted by
            the whole number of turns for which this distance is smallest.
        """
        apart = []
        for turn in range(self.turns):
            angles = (phases[0] + 2 * math.pi * turn).ravel()
            away = self.phase(angles).reshape(phases[1:].shape) - phases[1:]
            if not self.solver.by_slider:
                away[:2] = wrap(away[:2], np.rint)
            apart.append((np.abs(away) / self.units[:, None, None]).max(axis=0).mean(axis=0))
        return np.min(apart, axis=0)

    def is_same(self, other: 'PeriodicMotion') -> bool:
        """Returns whether another motion is the same, up to a shift by whole turns."""
        ours, theirs = (np.array((one.speed, one.stroke, one.torque)) for one in (self, other))
        return self.turns == other.turns and bool(np.allclose(ours, theirs, rtol=_SAME, atol=0))

    def subharmonics(self, part: int) -> Array:
        """Returns coefficients that vanish if the motion repeats after a fraction of its turns.

        Args:
            part: Number of repetitions within the turns of the motion.

        Returns:
            Coefficients of the first place, in its unit.
        """
        found = self.places[0][1:]
        chosen = np.repeat(np.arange(1, len(found) // 2 + 1) % part > 0, 2)
        return found[chosen] / self.solver.units[0]

    @property
    def shortest(self) -> 'PeriodicMotion':
        """The same motion over the fewest turns after which it repeats."""
        for part in range(self.turns, 1, -1):
            if self.turns % part == 0 and np.abs(self.subharmonics(part)).max() < _TINY:
                *places, crank = (_shared(row, part) for row in (*self.places, self.crank))
                return replace(self, places=tuple(places), crank=crank, turns=self.turns // part)
        return self

    @functools.cached_property
    def speed(self) -> float:
        """Mean crank speed over time, rad/s."""
        return float(1 / np.mean(1 / self._series(self.crank, self.angles)))

    @functools.cached_property
    def speeds(self) -> list[float]:
        """Mean crank speed over time in each turn, rad/s."""
        parts = np.arange(self.turns * _PARTS)[:, None] + (_NODES + 1) / 2
        speed = self._series(self.crank, 2 * math.pi / _PARTS * parts.ravel())
        times = (1 / speed).reshape(self.turns, _PARTS, -1) @ _WEIGHTS
        return (2 * _PARTS / times.sum(axis=1)).tolist()

    @property
    def load(self) -> float:
        """Mean torque on the crank over time, N m."""
        return self.torque - self.damping * self.speed

    @functools.cached_property
    def turning_points(self) -> Array:
        """Positions at which the slider reverses, in order, m."""
        grid: Any = np.arange(self.turns * _FINE) * (2 * math.pi / _FINE)
        signs = np.sign(self._series(self.slider, grid, 1))
        angles = grid[signs != np.roll(signs, -1)]
        for _ in range(_STEPS):
            slope, bend = (self._series(self.slider, angles, order) for order in (1, 2))
            angles = angles - np.clip(slope / np.where(bend, bend, np.inf), -grid[1], grid[1])
        return self._series(self.slider, angles)

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

        The lift load is the force and the load curve of the slider; a constant force consumes no
        power over a period.
        """
        pump = cast('WindPump', self.solver.mechanism)
        slider, lifts = pump.slider, (getattr(load, 'link', '') for load in pump.loads)
        if not slider.force and 'slider' not in lifts:
            return None
        x, w, v = self.at(self.angles)
        torque = self.torque - self.damping * w
        resistance = slider.damping * v + slider.stiffness * (x - slider.rest_position)
        force = self.solver.load_forces(self._state)['slider'] + resistance
        return float(-np.mean(force * v / w) / np.mean(torque))

    @functools.cached_property
    def multipliers(self) -> tuple[complex, ...]:
        """Floquet multipliers, the largest first: factors of small deviations over a period."""
        return self.slow_multipliers or by_size(np.linalg.eigvals(self.monodromy))

    @functools.cached_property
    def monodromy(self) -> Array:
        """Derivatives of the `ways` after a period with respect to those before it.

        They are computed by Magnus' method of order 4 (S. Blanes and others, Physics Reports 470
        (2009), 151-238).
        """
        step = self.angles[1]
        middles, aside = self.angles + step / 2, step * math.sqrt(3) / 6
        jacobians = self._jacobians(np.concatenate((middles - aside, middles + aside)))
        size = jacobians.shape[1]
        one, other = step * jacobians.reshape(2, -1, size, size)
        exponents = (one + other) / 2 - math.sqrt(3) / 12 * (one @ other - other @ one)
        # Matrix exponentials by Pade approximation; SciPy's function is five times slower for such
        # small matrices.
        squares = exponents @ exponents
        even, odd = np.eye(size) + squares / 10, exponents / 2 + exponents @ squares / 120
        factors = np.linalg.solve(even - odd, even + odd)
        product = functools.reduce(lambda before, factor: factor @ before, factors)
        return self.ways.T @ product @ self.ways

    @functools.cached_property
    def ways(self) -> Array:
        """Directions of deviations from the phase at crank angle 0, orthonormal; shape (k, 3).

        The first moves dyad or slider, the others change the two velocities.
        """
        places = self.phase(np.zeros(1))[:-2]
        found = np.eye(len(places) + 2, 3, 1 - len(places))
        found[:-2, :1] = self.solver.ways(places)
        return found

    def _jacobians(self, angles: Array) -> Array:
        """Computes the Jacobian matrices of d(phase)/d(crank angle), of shape (n, k, k)."""
        steps = _DIFFERENCE * self.units
        moves = np.concatenate((np.diag(steps), np.diag(-steps)))
        phase = self.phase(angles)[:, None] + moves.T[..., None]
        speed, size = phase[-2], len(steps)
        slopes = self.solver.slopes(self.torque - self.damping * speed, angles, *phase)[1:] / speed
        return ((slopes[:, :size] - slopes[:, size:]) / (2 * steps[:, None])).transpose(2, 0, 1)

    @property
    def stable(self) -> bool:
        """Whether small deviations decay."""
        return abs(self.multipliers[0]) < 1

    @property
    def name(self) -> str:
        """Mean speed as text; also the number of turns if above 1, and 'unstable' if it is."""
        turns = f', {self.turns} turns' if self.turns > 1 else ''
        return f'{self.speed:.4g} rad/s{turns}{"" if self.stable else ", unstable"}'

    @property
    def numbers(self) -> dict[str, Any]:
        """Main numbers of the motion, for JSON, in SI units."""
        return {
            'torque': self.torque,
            'load': self.load,
            'speed': self.speed,
            'stroke': self.stroke,
            'flow': self.flow,
            'multipliers': [[value.real, value.imag] for value in self.multipliers],
        }

    def record(self) -> dict[str, Any]:
        """Returns the motion as a JSON record, in SI units; period in turns."""
        x, w, v = self.at(np.zeros(1))[:, 0].tolist()
        return {
            **self.numbers,
            'efficiency': self.efficiency,
            'stable': self.stable,
            'period': self.turns,
            'assembly': self.assembly,
            'speeds': self.speeds,
            'slider_lowest': float(self.turning_points.min()),
            'slider_highest': float(self.turning_points.max()),
            'at_crank_angle_0': {'slider_position': x, 'crank_speed': w, 'slider_velocity': v},
        }


def _shared(row: Array, part: int) -> Array:
    """Returns the coefficients that a motion shares with its repetitions within its turns."""
    waves_of_row = row[1:].reshape(-1, 2)
    return np.append(row[:1], waves_of_row[part - 1 :: part])


def by_size(values: Any) -> tuple[complex, ...]:
    """Sorts multipliers by magnitude, the largest first.

    In a complex pair, the multiplier with the positive imaginary part comes first.
    """
    ordered = sorted(values.tolist(), key=lambda one: (-round(abs(one), 9), -one.imag))
    return tuple(map(complex, ordered))
