# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""mechanism (gabemorris12): vector loops, solved by SciPy's fsolve."""

import numpy as np
from contract import Peer
from mechanism import Mechanism, Vector, get_joints


class Adapter(Peer):
    """The four-bar of its README."""

    name = 'mechanism'
    distribution = 'mechanism'
    how = (
        'calculate for one state, iterate for an array; position, rate and acceleration by '
        'fsolve, each from the last state. It has no torque.'
    )

    def __init__(self, mechanism, speed, first):
        super().__init__(mechanism, speed, first)
        self.guess = (np.array([self.beta, self.gamma]), np.zeros(2), np.zeros(2))
        self.vectors, self.one = self._make(first, speed, 0.0)

    def _make(self, position, speed, acceleration):
        r, b, c, d = self.lengths
        O, A, B, C = get_joints('O A B C')
        crank, coupler = Vector((O, A), r=r), Vector((A, B), r=b)
        frame = Vector((O, C), r=d, theta=self.mechanism.frame.angle, style='ground')
        rocker = Vector((C, B), r=c)

        def loop(x, i):
            return crank(i) + coupler(x[0]) - frame() - rocker(x[1])

        vectors = (crank, coupler, frame, rocker)
        solver = Mechanism(
            vectors=vectors, origin=O, loops=loop, pos=position, vel=speed, acc=acceleration,
            guess=self.guess,
        )  # fmt: skip
        return (coupler, rocker), solver

    def kinematics(self, angles):
        one, (coupler, rocker), rows = self.one, self.vectors, []
        for angle in angles:
            one.pos = angle
            one.calculate()
            row = (
                *(coupler.pos.theta, rocker.pos.theta),
                *(coupler.vel.omega, rocker.vel.omega),
                *(coupler.acc.alpha, rocker.acc.alpha),
            )
            one.guess = [np.array(row[:2]), np.array(row[2:4]), np.array(row[4:])]
            one.clear_joints()
            rows.append(row)
        return rows

    def kinematics_array(self, angles):
        size = len(angles)
        self.guess = self.one.guess
        vectors, solver = self._make(angles, np.full(size, self.speed), np.zeros(size))
        solver.iterate()
        coupler, rocker = vectors
        return np.array(
            [
                *(coupler.pos.thetas, rocker.pos.thetas),
                *(coupler.vel.omegas, rocker.vel.omegas),
                *(coupler.acc.alphas, rocker.acc.alphas),
            ]
        ).T
