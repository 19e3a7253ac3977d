# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Curves that no message has: directions without jumps, energies, and what a pump delivers."""

from __future__ import annotations

import math

import numpy as np

from linkage_ros.dynamics.solver import Solver
from linkage_ros.errors import LinkageError
from linkage_ros.motion.drives import TorqueDrive
from linkage_ros.motion.torque_driven import start
from linkage_ros.numeric import Array

ENERGIES = ('kinetic', 'potential', 'total')
# Crank angle between two samples beyond which extremes in between would be missed by more than
# 8 % of the stroke, rad. A log that begins anew is such a leap too.
_LEAP = math.pi / 4


class Directions:
    """Directions of links over time, without the jumps of angles between -pi and pi."""

    def __init__(self) -> None:
        self._last: Array | None = None

    def follow(self, angles: Array) -> Array:
        """The directions at samples that follow those of the last call.

        Args:
            angles: rad, but for whole turns; shape (n, links).

        Returns:
            rad: the first from -pi to pi, each other one within pi of the one before it. Where
            an angle of a sample is not finite, the sample stays as it is.
        """
        known = np.isfinite(angles).all(axis=1)
        within = angles[known] - 2 * math.pi * np.round(angles[known] / (2 * math.pi))
        if not within.size:
            return angles
        before = within[:1] if self._last is None else self._last
        found: Array = angles.copy()
        found[known] = np.unwrap(np.concatenate([before, within]), axis=0)[1:]
        self._last = found[known][-1:]
        return found


class Energies:
    """The energies of a mechanism in its states; the potential one is 0 where the run starts."""

    def __init__(self, solver: Solver, drive: TorqueDrive) -> None:
        self._solver = solver
        self._columns = [solver.links.index(name) for name in solver.coordinates]
        q = start(solver.mechanism, drive).q
        _, self._offset = solver.energy(q, (0.0,) * len(q))

    def at(self, position: Array, velocity: Array) -> Array:
        """The energies, J.

        Args:
            position: Joint positions, shape (n, joints), rad and m.
            velocity: Their rates.

        Returns:
            Kinetic, potential and total, shape (n, 3); nan where no such state exists.
        """
        q, u = (tuple(rows[:, i] for i in self._columns) for rows in (position, velocity))
        with np.errstate(all='ignore'):
            try:
                kinetic, potential = np.broadcast_arrays(*self._solver.energy(q, u))
            except LinkageError:
                states = np.stack([*q, *u], axis=-1).tolist()
                kinetic, potential = np.array([self._single(*state) for state in states]).T
            potential = potential - self._offset
            return np.stack([kinetic, potential, kinetic + potential], axis=-1)

    def _single(self, *state: float) -> tuple[float, float]:
        # Any log can be replayed, and a state at the very end of a limited crank's arc may lie
        # beyond it by a rounding: that is a gap in the curves and ends no view.
        try:
            count = len(self._columns)
            kinetic, potential = self._solver.energy(state[:count], state[count:])
        except LinkageError:
            return math.nan, math.nan
        return kinetic, potential


class Flow:
    """What a pump delivers per area of its piston: stroke x crank speed.

    The stroke is that of the last whole turn of the crank in one go. Where the crank turns back,
    or the samples leap, the next turn must be complete before there is a flow again.
    """

    def __init__(self) -> None:
        self._stroke = self._angle = self._place = math.nan
        self._direction = 0.0
        self._begin(math.nan, math.nan)

    def _begin(self, angle: float, place: float) -> None:
        self._start, self._low, self._high = angle, place, place

    def follow(self, crank: Array, speed: Array, slide: Array) -> Array:
        """The flow at samples that follow those of the last call.

        Args:
            crank: Unwrapped crank angles, rad; shape (n,).
            speed: Crank speeds, rad/s.
            slide: Places of the slider, m.

        Returns:
            m/s, never negative; nan where no stroke is known.
        """
        pairs = zip(crank.tolist(), slide.tolist(), strict=True)
        strokes = [self._next(angle, place) for angle, place in pairs]
        return np.array(strokes) * np.abs(speed)

    def _next(self, angle: float, place: float) -> float:
        """The stroke that counts at the next sample."""
        step = angle - self._angle
        if not abs(step) <= _LEAP:  # the first step, from nowhere, included
            self._stroke, self._direction = math.nan, 0.0
            self._begin(angle, place)
        elif step:
            if step * self._direction < 0:
                self._stroke = math.nan
                self._begin(self._angle, self._place)
            self._direction = step
        if abs(angle - self._start) >= 2 * math.pi:
            end = self._start + math.copysign(2 * math.pi, step)
            there = self._place + (place - self._place) * ((end - self._angle) / step)
            self._stroke = max(self._high, there) - min(self._low, there)
            self._begin(end, there)
        self._angle, self._place = angle, place
        self._low, self._high = min(self._low, place), max(self._high, place)
        return self._stroke
