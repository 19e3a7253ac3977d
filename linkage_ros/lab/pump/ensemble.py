# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Many motions of a wind pump at once, each with steps as short as it needs, to the edge.

A step is that of Runge and Kutta, of order 4, taken whole and in two halves: what these differ by
tells the error, and so the length of the next step (E. Hairer, S. Norsett, G. Wanner, Solving
Ordinary Differential Equations I, section II.4). Nothing depends on time itself, so every motion
has its own; and one out of reach stops no other.
"""

from __future__ import annotations

import numpy as np

from linkage_ros.dynamics.solver import Solver
from linkage_ros.model.wind_pump import WindPump
from linkage_ros.motion.drives import Motor
from linkage_ros.numeric import Array

_TOLERANCE = 1e-6  # of a step, in rad and crank lengths, and of rates the same or relative
_GROWTH = (0.2, 4.0)  # of a step, least and most
_EDGE = 1e-9  # of the dyad's margins, in squared crank lengths: beyond, it is in one line
_FASTEST = 1e6  # rad/s and m/s: nothing that is followed rightly is as fast


class Ensemble:
    """The motions of one pump under its motor."""

    def __init__(self, mechanism: WindPump, motor: Motor) -> None:
        self._motor = motor
        self._solver = Solver(mechanism)
        self._margins = mechanism.loop().margins
        self._length = mechanism.crank.length

    def advance(self, phases: Array, spans: Array) -> tuple[Array, Array, Array]:
        """Follows each motion for a step, or not at all where that would be too far.

        Args:
            phases: Rows crank angle, rad, slider position, m, crank speed, rad/s, slider
                velocity, m/s; a column for each motion.
            spans: How long the steps are to be, s.

        Returns:
            The phases after the steps, the steps that were made (0 or as asked), and those to
            try next. A motion for which these shrink to nothing is at the edge of what the
            coordinates describe.
        """
        with np.errstate(all='ignore'):
            whole = self._step(phases, spans)
            ends = self._step(self._step(phases, spans / 2), spans / 2)
            gain = (ends - whole) / 15
            _, _, w, v = np.abs(phases)
            length = self._length
            sizes = np.array((np.ones_like(w), np.full_like(w, length), 1 + w, length + v))
            # A motion out of reach is nan.
            errors = np.nan_to_num(np.max(np.abs(gain) / sizes, axis=0), nan=np.inf) / _TOLERANCE
            growth = np.clip(0.9 * np.maximum(errors, 1e-9) ** -0.2, *_GROWTH)
        made = errors <= 1
        return np.where(made, ends + gain, phases), np.where(made, spans, 0.0), spans * growth

    def _step(self, phases: Array, span: Array) -> Array:
        first = self._slope(phases)
        second = self._slope(phases + span / 2 * first)
        third = self._slope(phases + span / 2 * second)
        fourth = self._slope(phases + span * third)
        result: Array = phases + span / 6 * (first + 2 * (second + third) + fourth)
        return result

    def _slope(self, phases: Array) -> Array:
        """The rates of phases; nan for those out of reach."""
        slopes = np.full_like(phases, np.nan)
        stretched, folded, _ = self._margins((phases[0], phases[1]))
        edge = _EDGE * self._length**2
        inside = (np.minimum(stretched, folded) > edge) & (abs(phases[2:]) < _FASTEST).all(axis=0)
        if inside.any():
            phi, x, w, v = phases[:, inside]
            torque = self._motor.at(w)
            slopes[:, inside] = w, v, *self._solver.accelerations((phi, x), (w, v), torque)
        return slopes
