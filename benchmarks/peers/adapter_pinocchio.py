# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Pinocchio: a tree of three hinges; Newton's method closes the loop with its Jacobians."""

import numpy as np
import pinocchio as pin
from contract import NewtonPeer

AXES = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


def inertia(body):
    """Returns a body's mass and inertia; only rotation about z matters."""
    return pin.Inertia(body.mass, np.array([*body.center, 0.0]), body.inertia * np.eye(3))


def shifted(x, y):
    """Returns a placement without rotation."""
    return pin.SE3(np.eye(3), np.array([x, y, 0.0]))


class Adapter(NewtonPeer):
    """Wraps Pinocchio's model and data of a four-bar."""

    name = 'Pinocchio'
    distribution = 'pin'
    how = (
        'As for MuJoCo, with computeJointJacobians and getFrameJacobian, '
        'getFrameClassicalAcceleration, and rnea.'
    )

    def __init__(self, mechanism, speed, first):
        super().__init__(mechanism, speed, first)
        r, b, c, _ = self.lengths
        model = self.model = pin.Model()
        model.gravity.linear = np.array([*mechanism.gravity, 0.0])
        hinge, here = pin.JointModelRZ, pin.SE3.Identity()
        crank = model.addJoint(0, hinge(), here, 'crank')
        coupler = model.addJoint(crank, hinge(), shifted(r, 0.0), 'coupler')
        rocker = model.addJoint(0, hinge(), shifted(*self.pivot), 'rocker')
        links = mechanism.crank, mechanism.coupler, mechanism.rocker
        for joint, body in zip((crank, coupler, rocker), links, strict=True):
            model.appendBodyToJoint(joint, inertia(body), here)
        self.frames = [
            model.addFrame(pin.Frame(name, joint, 0, shifted(x, 0.0), pin.FrameType.OP_FRAME))
            for name, joint, x in (('on coupler', coupler, b), ('on rocker', rocker, c))
        ]
        self.data = model.createData()
        self.vectors = np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(3)

    def torque(self, angles):
        model, data, speed, rows = self.model, self.data, self.speed, []
        position, velocity, acceleration, _ = self.vectors
        for angle in angles:
            row = self.state(angle)
            acceleration[:] = 0.0, row[4], row[5]
            force = pin.rnea(model, data, position, velocity, acceleration)
            rows.append((*row, float(force.dot(velocity)) / speed))
        return rows

    def state(self, crank):
        model, data, speed, tolerance = self.model, self.data, self.speed, self.tolerance
        position, velocity, _, zero = self.vectors
        on_coupler, on_rocker = self.frames
        q2, q3 = self.begin(crank)
        for _ in range(self.STEPS):
            position[:] = crank, q2, q3
            pin.computeJointJacobians(model, data, position)
            x2, y2, _ = pin.updateFramePlacement(model, data, on_coupler).translation.tolist()
            x3, y3, _ = pin.updateFramePlacement(model, data, on_rocker).translation.tolist()
            jacobian = pin.getFrameJacobian(model, data, on_coupler, AXES)
            k, a = jacobian.item(0, 0), jacobian.item(0, 1)
            m, c = jacobian.item(1, 0), jacobian.item(1, 1)
            jacobian = pin.getFrameJacobian(model, data, on_rocker, AXES)
            b, d = -jacobian.item(0, 2), -jacobian.item(1, 2)
            determinant = a * d - b * c
            gx, gy = x2 - x3, y2 - y3
            if abs(gx) + abs(gy) < tolerance:
                break
            q2 -= (d * gx - b * gy) / determinant
            q3 -= (a * gy - c * gx) / determinant
        else:
            self.give_up(crank)
        v2 = (b * m - d * k) * speed / determinant
        v3 = (c * k - a * m) * speed / determinant
        velocity[:] = speed, v2, v3
        pin.forwardKinematics(model, data, position, velocity, zero)
        x2, y2, _ = pin.getFrameClassicalAcceleration(
            model, data, on_coupler, AXES
        ).linear.tolist()
        x3, y3, _ = pin.getFrameClassicalAcceleration(model, data, on_rocker, AXES).linear.tolist()
        hx, hy = x2 - x3, y2 - y3
        e2, e3 = (b * hy - d * hx) / determinant, (c * hx - a * hy) / determinant
        self.last = (crank, q2, q3, v2, v3)
        return crank + q2, q3, speed + v2, v3, e2, e3
