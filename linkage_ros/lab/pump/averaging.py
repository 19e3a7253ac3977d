# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The averaged motion of a wind pump: one harmonic and a constant crank speed, after Van der Pol.

Document 3 averages its equations of motion over a turn and finds two speeds. Here the slider is
taken to move as

    xD = X0 + a cos phi1 + b sin phi1,    phi1' = w constant,

which the exact equations of motion do not quite allow. What they lack, the force R2(phi1) on the
slider and the torque R1(phi1) on the crank, is made to vanish on average over a turn (Galerkin):

    <R2> = <R2 cos phi1> = <R2 sin phi1> = 0    gives X0, a and b at each w,
    M0 - m w = <R1>                             the load of the motor.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy import optimize

from linkage_ros.dynamics.solver import Solver
from linkage_ros.errors import LinkageError
from linkage_ros.model.wind_pump import WindPump
from linkage_ros.motion.drives import Motor
from linkage_ros.numeric import Array

_PARTS = 128  # of a turn: the mean over them is exact to rounding, for a smooth periodic function
_TOLERANCE = 1e-12  # of an averaged motion, in crank lengths and of the speed
_GUESSES = 7  # of where the slider may be in the middle


class Averaged(NamedTuple):
    """An averaged motion.

    Attributes:
        mean: X0, the middle of the slider's way, m.
        cosine: a, m.
        sine: b, m.
        speed: w, of the crank, rad/s.
        load: Mean torque that it takes, N m.
    """

    mean: float
    cosine: float
    sine: float
    speed: float
    load: float

    @property
    def stroke(self) -> float:
        """Way of the slider from end to end, m."""
        return float(2 * np.hypot(self.cosine, self.sine))

    def torque(self, damping: float) -> float:
        """Of the motor at rest, if it loses so much per crank speed, N m."""
        return self.load + damping * self.speed

    def unknowns(self, damping: float) -> tuple[float, float, float, float]:
        """First guess of the exact motion for `periodic.find_motions`."""
        velocity = self.speed * self.sine
        return self.mean + self.cosine, velocity, self.speed, self.torque(damping)

    def record(self) -> dict[str, Any]:
        """For JSON."""
        return {**self._asdict(), 'stroke': self.stroke}


class Averaging:
    """The averaged equations of one pump."""

    def __init__(self, mechanism: WindPump) -> None:
        self._mechanism, self._solver = mechanism, Solver(mechanism)
        self._angles = np.arange(_PARTS) * (2 * math.pi / _PARTS)
        self._weights = np.array((np.ones(_PARTS), np.cos(self._angles), np.sin(self._angles)))

    def follow(self, speeds: Sequence[float]) -> list[list[Averaged]]:
        """The averaged motions over the speed, each begun from the one before.

        Args:
            speeds: Speeds of the crank, growing, rad/s.

        Returns:
            They lie in one stretch, or, where from above not all speeds are reached, in two. No
            more are found where there are several motions at a speed.
        """
        down = self._follow(speeds[::-1])
        up = self._follow([speed for speed in speeds if not down or speed < down[-1].speed])
        return [stretch for stretch in (up, down[::-1]) if stretch]

    def _follow(self, speeds: Sequence[float]) -> list[Averaged]:
        """From the first speed with a motion to the last before one without."""
        found: list[Averaged] = []
        for speed in speeds:
            guesses = [found[-1][:3]] if found else [(x, 0.0, 0.0) for x in self._middles()]
            motions = (self.find((*guess, speed)) for guess in guesses)
            motion = next(filter(None, motions), None)
            if motion:
                found.append(motion)
            elif found:
                break
        return found

    def states(self, stretches: Sequence[Sequence[Averaged]], motor: Motor) -> list[Averaged]:
        """The averaged motions that a motor keeps up: where the load meets its line.

        Args:
            stretches: As `follow` returns them.
            motor: Motor of the pump.

        Returns:
            Those between two neighbours of which one takes more torque and one less, by growing
            speed.
        """
        found = []
        for pair in itertools.chain(*map(itertools.pairwise, stretches)):
            low, high = (one.torque(motor.damping) - motor.torque for one in pair)
            if (low < 0) != (high < 0):
                share = low / (low - high)
                one, other = (np.array(end[:4]) for end in pair)
                guess = one * (1 - share) + other * share
                found.append(self.find(tuple(guess.tolist()), motor))
        return sorted(filter(None, found), key=lambda motion: motion.speed)

    def find(self, guess: tuple[float, ...], motor: Motor | None = None) -> Averaged | None:
        """An averaged motion, by Newton's method.

        Args:
            guess: X0, a and b, m, and the crank speed, rad/s.
            motor: That keeps it up; None: the speed stays.

        Returns:
            The motion, or None where none is found.
        """
        sizes = np.array((*[self._mechanism.crank.length] * 3, guess[3]))

        def lacks(part: Array) -> Array:
            found = self._lacks(part * sizes)
            speed = part[3] * guess[3]
            if motor:
                found[3] += motor.damping * speed - motor.torque
            else:
                found[3] = speed - guess[3]
            return found

        try:
            with np.errstate(all='ignore'):
                solved = optimize.root(lacks, guess / sizes, tol=_TOLERANCE)
        except LinkageError:
            return None
        if not solved.success:
            return None
        z = solved.x * sizes
        mean, cosine, sine, speed = map(float, z)
        return Averaged(mean, cosine, sine, speed, float(self._lacks(z)[3]))

    def _lacks(self, z: Array) -> Array:
        """<R2>, <R2 cos>, <R2 sin>, N, and <R1>, N m."""
        _, cos, sin = self._weights
        mean, a, b, w = z
        x, v = mean + a * cos + b * sin, w * (b * cos - a * sin)
        q, u = (self._angles, x), (np.full_like(x, w), v)
        # R = M q'' + h - Q is M (q'' - the q'' of a motion without a motor).
        spin, push = self._solver.accelerations(q, u, 0.0)
        (m11, m12), (_, m22) = self._solver.matrix(q)
        rest = w * w * (mean - x) - push
        force = m22 * rest - m12 * spin
        torque = m12 * rest - m11 * spin
        return np.array((*(self._weights @ force / _PARTS), np.mean(torque)))

    def _middles(self) -> list[float]:
        """Where the slider may be in the middle, m."""
        pump = self._mechanism
        r, b, c = pump.crank.length, pump.coupler.length, pump.rod.length
        inside = np.linspace(abs(b - c) + r, b + c - r, _GUESSES + 2)[1:-1]
        return [pump.slider.position, *inside.tolist()]
