# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Settled motions: those that repeat after each turn, and whether neighbours come back to them.

They are the fixed points of the Poincare map, found by Newton's method. The eigenvalues of the
map's Jacobian there are their Floquet multipliers: what a small deviation is multiplied with in a
turn. A motion is found for a torque of the motor, or, with the torque unknown, for a mean speed:
that also passes the folds where a state comes into being.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy import signal

from linkage_ros.errors import LinkageError
from linkage_ros.lab.pump.poincare import PoincareMap
from linkage_ros.numeric import Array

_RESIDUAL = 1e-12  # of a fixed point, in crank lengths, turns and the speed itself
_ITERATIONS = 10
_DIFFERENCE = 1e-5  # relative, for derivatives by central differences
_PARTS = 256  # of a turn, from which the slider's ends are found
_FINE = 2**15  # parts for the parabola


@dataclass(frozen=True)
class PeriodicMotion:
    """A settled motion.

    Attributes:
        torque: Torque of the motor at rest, N m.
        point: At crank angle 0: slider position, m, its velocity, m/s, crank speed, rad/s.
        period: Time of a turn, s.
        multipliers: Floquet multipliers, the largest first.
        lowest: Least slider position, m.
        highest: Largest.
    """

    torque: float
    point: tuple[float, float, float]
    period: float
    multipliers: tuple[complex, ...]
    lowest: float
    highest: float

    @property
    def speed(self) -> float:
        """Mean crank speed, rad/s."""
        return 2 * math.pi / self.period

    @property
    def stroke(self) -> float:
        """Way of the slider from end to end, m."""
        return self.highest - self.lowest

    @property
    def flow(self) -> float:
        """Stroke x speed, m/s: proportional to the flow of water."""
        return self.stroke * self.speed

    @property
    def radius(self) -> float:
        """Of the largest multiplier."""
        return abs(self.multipliers[0])

    @property
    def stable(self) -> bool:
        """Whether small deviations die away."""
        return self.radius < 1

    @property
    def unknowns(self) -> Array:
        """Point and torque: where Newton's method can begin for a neighbour."""
        return np.array((*self.point, self.torque))

    def toward(self, other: PeriodicMotion, share: float) -> Array:
        """The unknowns between those of this motion (0) and of another (1)."""
        return self.unknowns + share * (other.unknowns - self.unknowns)

    def record(self) -> dict[str, Any]:
        """For JSON."""
        return {
            'torque': self.torque,
            'stable': self.stable,
            'speed': self.speed,
            'period': self.period,
            'stroke': self.stroke,
            'flow': self.flow,
            'slider_lowest': self.lowest,
            'slider_highest': self.highest,
            'at_crank_angle_0': dict(
                zip(('slider_position', 'slider_velocity', 'crank_speed'), self.point, strict=True)
            ),
            'multipliers': [[value.real, value.imag] for value in self.multipliers],
        }


def extremum(samples: Array, sign: int) -> float:
    """The largest or least value of a periodic function, by a parabola between fine samples.

    Args:
        samples: Its values in equal parts of the period, enough for its Fourier series to end.
        sign: 1: the largest; -1: the least.

    Returns:
        The value.
    """
    fine = sign * signal.resample(samples, _FINE)
    top = int(np.argmax(fine))
    before, value, after = np.take(fine, (top - 1, top, top + 1), mode='wrap')
    bend = before - 2 * value + after
    return float(sign * (value - ((after - before) ** 2 / (8 * bend) if bend else 0.0)))


class Wanted(NamedTuple):
    """The prescribed speeds or torques of motions.

    Attributes:
        values: Their mean crank speeds, rad/s, or the motor's torques at rest, N m.
        is_speed: Which of the two.
    """

    values: Array
    is_speed: bool


def find_motions(
    poincare: PoincareMap, guesses: Array, wanted: Wanted
) -> list[PeriodicMotion | None]:
    """Finds settled motions.

    Args:
        poincare: The map.
        guesses: Rows slider position, its velocity, crank speed (at crank angle 0) and torque;
            a column for each motion.
        wanted: A value for each motion.

    Returns:
        The motions; None where Newton's method finds none.
    """
    count = guesses.shape[1]
    try:
        return _newton(poincare, guesses, wanted)
    except (LinkageError, np.linalg.LinAlgError):
        # One of them cannot be followed: the others are found without it.
        if count == 1:
            return [None]
    found: list[PeriodicMotion | None] = []
    for part in (slice(count // 2), slice(count // 2, None)):
        found += find_motions(
            poincare, guesses[:, part], wanted._replace(values=wanted.values[part])
        )
    return found


def _newton(poincare: PoincareMap, guesses: Array, wanted: Wanted) -> list[PeriodicMotion | None]:
    z = guesses.copy()
    length = poincare.solver.mechanism.crank.length
    for _ in range(_ITERATIONS):
        ends, slopes = _linearised(poincare, z, length)
        residual, jacobian = ends - z, slopes - np.eye(4)
        if wanted.is_speed:
            residual[3] = wanted.values * ends[3] - 2 * math.pi
            jacobian[:, 3] = wanted.values[:, None] * slopes[:, 3]
        else:
            residual[3] = z[3] - wanted.values
            jacobian[:, 3] = 0.0, 0.0, 0.0, 1.0
        sizes = _sizes(z, length)
        sizes[3] = 2 * math.pi if wanted.is_speed else sizes[3]
        done = (np.abs(residual) < _RESIDUAL * sizes).all(axis=0)
        if done.all():
            break
        step = np.linalg.solve(jacobian, residual.T[..., None])[..., 0].T
        z = z - np.where(done, 0.0, step)
    if not done.any():
        return [None] * len(done)
    ends, slopes, z = ends[:, done], slopes[done], z[:, done]
    courses = poincare.orbit(z[:3], z[3], _PARTS)[0, :-1]
    found = iter(
        PeriodicMotion(
            float(torque),
            (float(x), float(v), float(w)),
            float(period),
            _multipliers(slope),
            extremum(course, -1),
            extremum(course, 1),
        )
        for (x, v, w, torque), period, slope, course in zip(
            z.T, ends[3], slopes, courses.T, strict=True
        )
    )
    return [next(found) if one else None for one in done]


def _sizes(z: Array, length: float) -> Array:
    """The units of the unknowns."""
    return np.array((length + 0 * z[2], length * np.abs(z[2]), np.abs(z[2]), np.abs(z[3])))


def _linearised(poincare: PoincareMap, z: Array, length: float) -> tuple[Array, Array]:
    """Point and time after a turn, (4, n), and their derivatives by the unknowns, (n, 4, 4)."""
    steps = _DIFFERENCE * _sizes(z, length)
    moves = np.concatenate((np.zeros((4, 1)), np.eye(4), -np.eye(4)), axis=1)
    starts = z[:, None] + moves[..., None] * steps[:, None]
    ends = poincare.image(starts[:3].reshape(3, -1), starts[3].ravel()).reshape(starts.shape)
    slopes = (ends[:, 1:5] - ends[:, 5:]) / (2 * steps)
    return ends[:, 0], slopes.transpose(2, 0, 1)


def _multipliers(slope: Array) -> tuple[complex, ...]:
    values = np.linalg.eigvals(slope[:3, :3]).tolist()
    return tuple(sorted(map(complex, values), key=lambda value: (-abs(value), -value.imag)))
