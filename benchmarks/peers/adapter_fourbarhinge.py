# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""fourbarhinge: closed form with an arc cosine, torque by modern_robotics."""

from contract import Peer
from fourbarhinge import (
    Actuator,
    Bar,
    BarId,
    FourBarDynamics,
    FourBarGeometry,
    FourBarKinematics,
    Point,
)


class Adapter(Peer):
    """FourBarKinematics and FourBarDynamics; its angles count from the frame."""

    name = 'fourbarhinge'
    distribution = 'fourbarhinge'
    how = (
        'solve_configuration, solve_theta_dot and solve_theta_ddot, each state by itself on one '
        'side; the torque by solve_required_effort of an actuator at the crank.'
    )

    def __init__(self, mechanism, speed, first):
        super().__init__(mechanism, speed, first)
        self.angle = mechanism.frame.angle
        # Its branch is the side seen from B0 to A.
        self.branch = -int(self.side)
        links = mechanism.crank, mechanism.coupler, mechanism.rocker
        bars = {
            bar: Bar(
                length=link.length, mass=link.mass, inertia=link.inertia,
                center_of_mass=Point(x=link.center[0], y=link.center[1]),
            )
            for bar, link in zip((BarId.INPUT, BarId.COUPLER, BarId.OUTPUT), links, strict=True)
        }  # fmt: skip
        bars[BarId.GROUND] = Bar(length=mechanism.frame.length)
        geometry = FourBarGeometry(position_ground=Point(x=0.0, y=0.0), bar=bars)
        self.linkage = FourBarKinematics(geometry, theta_ground=self.angle)
        self.dynamics = FourBarDynamics(self.linkage, gravity=mechanism.gravity)
        self.motor = Actuator(bar=BarId.INPUT)

    def kinematics(self, angles):
        linkage, speed, ground, branch = self.linkage, self.speed, self.angle, self.branch
        rows = []
        for angle in angles:
            theta = linkage.solve_configuration(angle - ground, branch=branch).theta
            _, w2, w3 = linkage.solve_theta_dot(speed)
            _, e2, e3 = linkage.solve_theta_ddot(0.0)
            coupler, rocker = theta[BarId.COUPLER] + ground, theta[BarId.OUTPUT] + ground
            rows.append((coupler, rocker, w2, w3, e2, e3))
        return rows

    def torque(self, angles):
        linkage, speed, ground, branch = self.linkage, self.speed, self.angle, self.branch
        effort, motor, rows = self.dynamics.solve_required_effort, self.motor, []
        for angle in angles:
            theta = linkage.solve_configuration(angle - ground, branch=branch).theta
            _, w2, w3 = linkage.solve_theta_dot(speed)
            # Solves the accelerations on its way.
            torque = effort(motor, 0.0)
            _, e2, e3 = linkage.get_theta_vector_ddot()
            coupler, rocker = theta[BarId.COUPLER] + ground, theta[BarId.OUTPUT] + ground
            rows.append((coupler, rocker, w2, w3, e2, e3, torque))
        return rows
