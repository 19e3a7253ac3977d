# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""pylinkage: dyads, each solved from the last position of its joint."""

import cmath
import math

import numpy as np
from contract import Peer
from pylinkage.actuators import Crank
from pylinkage.components import Ground
from pylinkage.dyads import RRRDyad
from pylinkage.simulation import Linkage


class Adapter(Peer):
    """Wraps a four-bar of Ground, Crank and RRRDyad, as in the README of pylinkage."""

    name = 'pylinkage'
    distribution = 'pylinkage'
    how = (
        'step_with_derivatives is called with one step of the crank per state; for arrays, '
        'step_fast_with_kinematics, with Numba. It selects the assembly nearer to the previous '
        'state. The conversion of pins to angles is not timed.'
    )

    def __init__(self, mechanism, speed, first):
        super().__init__(mechanism, speed, first)
        r, b, c, _ = self.lengths
        place = cmath.rect(r, first) + cmath.rect(b, self.beta)
        ground, pivot = Ground(0.0, 0.0), Ground(*self.pivot)
        self.crank = Crank(ground, r, initial_angle=first)
        self.rocker = RRRDyad(self.crank.output, pivot, b, c, x=place.real, y=place.imag)
        self.linkage = Linkage([ground, pivot, self.crank, self.rocker])
        self.linkage.set_input_velocity(self.crank, omega=speed)

    def kinematics(self, angles):
        linkage = self.linkage
        if len(angles) < 3 or np.ptp(np.diff(angles)) > 1e-9:
            return [self._alone(angle) for angle in angles]
        self._begin(angles)
        return list(linkage.step_with_derivatives(iterations=len(angles)))

    def kinematics_array(self, angles):
        self._begin(angles)
        return self.linkage.step_fast_with_kinematics(iterations=len(angles))

    def table(self, results):
        if isinstance(results, list):
            nothing = (math.nan, math.nan)
            results = [
                np.array([[pair or nothing for pair in state[i]] for state in results], float)
                for i in range(3)
            ]
        position, velocity, acceleration = (x[:, :, 0] + 1j * x[:, :, 1] for x in results)
        rows = [[], [], []]
        for start in (2, 1):
            link = position[:, 3] - position[:, start]
            square = abs(link) ** 2
            moving = velocity[:, 3] - velocity[:, start]
            pulled = acceleration[:, 3] - acceleration[:, start]
            rows[0].append(np.angle(link))
            rows[1].append((link.conj() * moving).imag / square)
            rows[2].append((link.conj() * pulled).imag / square)
        return np.array([row for pair in rows for row in pair])

    def _begin(self, angles):
        """Sets the crank one step before the first angle; its steps accumulate rounding errors."""
        step = angles[1] - angles[0]
        self.crank.angular_velocity = float(step)
        r, before = self.lengths[0], angles[0] - step
        self.crank.set_coord(r * math.cos(before), r * math.sin(before))

    def _alone(self, angle):
        r = self.lengths[0]
        self.crank.set_coord(r * math.cos(angle), r * math.sin(angle))
        return next(self.linkage.step_with_derivatives(iterations=1, dt=0.0))
