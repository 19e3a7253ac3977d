# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""This package."""

import numpy as np
from contract import Peer

from linkage_ros import Solver
from linkage_ros.mechanism.program import Constants, Program


def pose(loop, crank):
    """Returns positions of coupler and output, with their first and second derivatives."""
    links = loop.pose((crank,)).links[1:]
    return tuple((link.position, link.jacobian[0], link.curvature[0]) for link in links)


class Adapter(Peer):
    """Calls Solver.state, or the kinematics without torque."""

    name = 'linkage_ros'
    how = (
        'Solver.state is called once for each state, or once for an array. It always computes the '
        'torque. For the kinematics of one state, the program of the pose is called instead.'
    )

    def __init__(self, mechanism, speed, first):
        super().__init__(mechanism, speed, first)
        self.state = Solver(mechanism).state
        self.pose = Program(pose, Constants(mechanism.loop()), ('crank',)).floats

    def torque(self, angles):
        state, speed = self.state, self.speed
        return [state(angle, speed) for angle in angles]

    def kinematics(self, angles):
        pose, speed, square, rows = self.pose, self.speed, self.speed**2, []
        for angle in angles:
            (beta, k2, c2), (gamma, k3, c3) = pose(angle)
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
