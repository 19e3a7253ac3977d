# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Motions of a wind pump that repeat after each turn, as Fourier series in the crank angle.

The crank angle phi serves as the independent variable in place of time, as long as the crank
turns (M. Henon, Physica D 5 (1982), 412-414).
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from linkage_ros.dynamics.solver import Solver
from linkage_ros.model.load_curve import LoadCurve
from linkage_ros.model.wind_pump import WindPump
from linkage_ros.motion.drives import Motor
from linkage_ros.numeric import Array

PARTS = 64  # of a turn: means over them are exact to rounding
ANGLES: Array = np.linspace(0, 2 * math.pi, PARTS, endpoint=False)
DIFFERENCE = 1e-5  # relative, for derivatives by central differences
NUMBERS = ('torque', 'load', 'speed', 'stroke', 'flow')


def waves(angles: Array, count: int, derivative: int = 0) -> Array:
    """The functions 1, cos phi, sin phi, cos 2 phi, ... or their derivatives.

    Args:
        angles: phi, of shape (n), rad.
        count: Number of functions, odd.
        derivative: Order of the derivative.

    Returns:
        Of shape (n, count).
    """
    orders = np.arange(1, count // 2 + 1)
    shifted = np.outer(angles, orders) + derivative * math.pi / 2
    pairs = np.stack((np.cos(shifted), np.sin(shifted)), axis=-1) * orders[:, None] ** derivative
    first = np.full((len(angles), 1), float(derivative == 0))
    return np.concatenate((first, pairs.reshape(len(angles), -1)), axis=1)


@dataclass(frozen=True, eq=False)
class PeriodicMotion:
    """A motion that repeats after each turn.

    Attributes:
        solver: Solver of the pump.
        damping: Torque that the motor loses per crank speed, N m s.
        slider: Coefficients of the slider's position, m.
        crank: Coefficients of the crank's speed, rad/s.
        torque: Torque of the motor at rest, N m.
    """

    solver: Solver
    damping: float
    slider: Array
    crank: Array
    torque: float

    @property
    def unknowns(self) -> Array:
        """The coefficients, and the torque."""
        return np.concatenate((self.slider, self.crank, [self.torque]))

    @property
    def units(self) -> Array:
        """Units of slider position, crank speed and slider velocity; of shape (3)."""
        length = self.solver.mechanism.crank.length
        return np.array((length, self.speed, length * self.speed))

    def at(self, angles: Array) -> Array:
        """The motion at crank angles.

        Args:
            angles: Of shape (n), rad.

        Returns:
            Slider position, m, crank speed, rad/s, and slider velocity, m/s; of shape (3, n).
        """
        position, slope = (waves(angles, len(self.slider), d) @ self.slider for d in (0, 1))
        speed = waves(angles, len(self.crank)) @ self.crank
        return np.array((position, speed, speed * slope))

    def is_near(self, phases: Array, share: float) -> bool:
        """Whether another motion is near to this one.

        Args:
            phases: Of the other: crank angle, slider position and their rates; of shape (4, n).
            share: Allowed difference, of the crank length and of the speed.

        Returns:
            Whether all of its phases are.
        """
        away = np.abs(self.at(phases[0]) - phases[1:])
        return bool((away < share * self.units[:, None]).all())

    @functools.cached_property
    def speed(self) -> float:
        """Mean crank speed over time, rad/s."""
        return float(1 / np.mean(1 / self.at(ANGLES)[1]))

    @property
    def load(self) -> float:
        """Mean torque on the crank over time, N m."""
        return float(Motor(self.torque, self.damping).at(self.speed))

    @functools.cached_property
    def extremes(self) -> tuple[float, float]:
        """Least and largest slider position, m: by a Newton step from the nearest of 4096."""
        angles = np.linspace(0, 2 * math.pi, 4097)
        x, slope, bend = (waves(angles, len(self.slider), d) @ self.slider for d in range(3))
        low, high = (x[at] - slope[at] ** 2 / (2 * bend[at]) for at in (x.argmin(), x.argmax()))
        return float(low), float(high)

    @property
    def stroke(self) -> float:
        """Way of the slider from end to end, m."""
        low, high = self.extremes
        return high - low

    @property
    def flow(self) -> float:
        """Stroke x speed, m/s: proportional to the flow of water."""
        return self.stroke * self.speed

    @functools.cached_property
    def efficiency(self) -> float | None:
        """Share of the crank's power that goes into the lift load; None: there is none.

        The lift load is the slider's force and load curve; a constant force takes no power.
        """
        pump = cast('WindPump', self.solver.mechanism)
        slider, curves = pump.slider, (one for one in pump.loads if isinstance(one, LoadCurve))
        if not slider.force and all(curve.link != 'slider' for curve in curves):
            return None
        x, w, v = self.at(ANGLES)
        torque = Motor(self.torque, self.damping).at(w)
        state = self.solver.state((ANGLES, x), (w, v))
        force = self.solver.load_forces(state)['slider'] + slider.damping * v
        force = force + slider.stiffness * (x - slider.rest_position)
        return float(-np.mean(force * v / w) / np.mean(torque))

    @functools.cached_property
    def multipliers(self) -> tuple[complex, ...]:
        """Floquet multipliers, the largest first: a turn multiplies small deviations by them."""
        values = np.linalg.eigvals(_monodromy(self)).tolist()
        return tuple(sorted(map(complex, values), key=lambda value: (-abs(value), -value.imag)))

    @property
    def stable(self) -> bool:
        """Whether small deviations die away."""
        return abs(self.multipliers[0]) < 1

    def record(self) -> dict[str, Any]:
        """For JSON, in SI units; flow is stroke x speed."""
        start = self.at(np.zeros(1))[:, 0].tolist()
        names = 'slider_position', 'crank_speed', 'slider_velocity'
        low, high = self.extremes
        return {
            **{name: getattr(self, name) for name in NUMBERS},
            'efficiency': self.efficiency,
            'stable': self.stable,
            'period': 2 * math.pi / self.speed,
            'slider_lowest': low,
            'slider_highest': high,
            'at_crank_angle_0': dict(zip(names, start, strict=True)),
            'multipliers': [[value.real, value.imag] for value in self.multipliers],
        }


def _monodromy(motion: PeriodicMotion) -> Array:
    """Derivatives of the values of `at` after a turn by those before.

    By Magnus' method of order 4 (S. Blanes and others, Physics Reports 470 (2009), 151-238).
    """
    step = 2 * math.pi / PARTS
    aside = step * math.sqrt(3) / 6
    one, other = (step * _jacobians(motion, ANGLES + shift) for shift in (-aside, aside))
    exponents = (one + other) / 2 - math.sqrt(3) / 12 * (one @ other - other @ one)
    # Exponentials by Pade's approximation: for such small ones, SciPy's takes five times as long.
    squares = exponents @ exponents
    even, odd = np.eye(3) + squares / 10, exponents / 2 + exponents @ squares / 120
    factors = np.linalg.solve(even - odd, even + odd)
    product: Array = functools.reduce(lambda before, factor: factor @ before, factors)
    return product


def _jacobians(motion: PeriodicMotion, angles: Array) -> Array:
    """Derivatives of the slopes by the values, over the crank angle; of shape (n, 3, 3)."""
    steps = DIFFERENCE * motion.units
    moves = np.concatenate((np.diag(steps), np.diag(-steps)))
    x, w, v = motion.at(angles)[:, None] + moves.T[..., None]
    torque = Motor(motion.torque, motion.damping).at(w)
    spin, push = motion.solver.accelerations((np.broadcast_to(angles, x.shape), x), (w, v), torque)
    slopes = np.array((v, spin, push)) / w
    derivatives = (slopes[:, :3] - slopes[:, 3:]) / (2 * steps[:, None])
    jacobians: Array = derivatives.transpose(2, 0, 1)
    return jacobians
