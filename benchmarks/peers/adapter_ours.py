# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""This package itself."""

import numpy as np
from contract import Peer

from linkage_ros import Solver
from linkage_ros.numeric import SCALAR


class Adapter(Peer):
    """Solver.state; the kinematics alone for what gives no torque."""

    name = 'linkage_ros'
    how = (
        'Solver.state, each state by itself. It always computes the torque; without it, '
        'Solver.kinematics.solve, its rates and curvatures multiplied by the speed.'
    )

    def __init__(self, mechanism, speed, first):
        super().__init__(mechanism, speed, first)
        solver = Solver(mechanism)
        self.state, self.solve = solver.state, solver.kinematics.solve
        self.solver, self.limited = solver, not solver.mobility.turns_fully

    def torque(self, angles):
        state, speed = self.state, self.speed
        return [state(angle, speed) for angle in angles]

    def kinematics(self, angles):
        solve, speed, square, rows = self.solve, self.speed, self.speed**2, []
        for angle in angles:
            if self.limited:
                self.solver.kinematics.require_reachable(angle, SCALAR)
            (_, beta, gamma), _, _, ((_, k2, k3),), ((_, c2, c3),) = solve(angle, SCALAR)
            rows.append((beta, gamma, k2 * speed, k3 * speed, c2 * square, c3 * square))
        return rows

    def torque_array(self, angles):
        return self.state(angles, self.speed)

    kinematics_array = torque_array

    def table(self, results):
        if isinstance(results, list) and not hasattr(results[0], 'torque'):
            return super().table(results)
        states = [results] if hasattr(results, 'torque') else results
        rows = [[*s.position[1:], *s.velocity[1:], *s.acceleration[1:], s.torque] for s in states]
        return np.array(rows[0] if states[0] is results else np.array(rows).T, float)
