# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""MuJoCo: a tree of three hinges; Newton's method closes the loop with its Jacobians."""

import mujoco
import numpy as np
from contract import NewtonPeer

MODEL = """
<mujoco>
  <compiler angle="radian" inertiafromgeom="false"/>
  <option gravity="{gravity[0]!r} {gravity[1]!r} 0"/>
  <worldbody>
    <body name="crank">
      <joint type="hinge" axis="0 0 1"/>{crank}
      <body name="coupler" pos="{r!r} 0 0">
        <joint type="hinge" axis="0 0 1"/>{coupler}
        <site name="coupler" pos="{b!r} 0 0"/>
      </body>
    </body>
    <body name="rocker" pos="{pivot[0]!r} {pivot[1]!r} 0">
      <joint type="hinge" axis="0 0 1"/>{rocker}
      <site name="rocker" pos="{c!r} 0 0"/>
    </body>
  </worldbody>
</mujoco>
"""
# MuJoCo refuses bodies without mass or inertia.
SMALLEST = 1e-14


def inertial(body):
    """Returns the MJCF element of a body's mass and inertia; only rotation about z matters."""
    mass, inertia = max(body.mass, SMALLEST), max(body.inertia, SMALLEST)
    center = f'{body.center[0]!r} {body.center[1]!r} 0'
    return f'<inertial pos="{center}" mass="{mass!r}" diaginertia="{f"{inertia!r} " * 3}"/>'


class Adapter(NewtonPeer):
    """Wraps MuJoCo's model and data of a four-bar; looks up their arrays only once."""

    name = 'MuJoCo'
    distribution = 'mujoco'
    how = (
        'The model is a tree of three hinges. A Newton iteration in Python closes the loop with '
        "mj_jacSite, starting from the last state extrapolated by its rates; MuJoCo's own "
        'constraints are soft. The accelerations come from mj_jacDot, the torque from mj_rne, '
        'projected on the velocity of the loop.'
    )

    def __init__(self, mechanism, speed, first):
        super().__init__(mechanism, speed, first)
        r, b, c, _ = self.lengths
        text = MODEL.format(
            r=r, b=b, c=c, pivot=self.pivot, gravity=mechanism.gravity,
            crank=inertial(mechanism.crank), coupler=inertial(mechanism.coupler),
            rocker=inertial(mechanism.rocker),
        )  # fmt: skip
        self.model = mujoco.MjModel.from_xml_string(text)
        self.data = mujoco.MjData(self.model)
        self.jacobians = np.empty((3, 3)), np.empty((3, 3))
        self.bodies = self.model.body('coupler').id, self.model.body('rocker').id

    def torque(self, angles):
        model, data, speed, rows = self.model, self.data, self.speed, []
        acceleration, force = data.qacc, np.empty(3)
        for angle in angles:
            row = self.state(angle)
            _, _, w2, w3, e2, e3 = row
            acceleration[:] = 0.0, e2, e3
            mujoco.mj_rne(model, data, 1, force)
            f1, f2, f3 = force.tolist()
            rows.append((*row, f1 + (f2 * (w2 - speed) + f3 * w3) / speed))
        return rows

    def state(self, crank):
        model, data, speed, tolerance = self.model, self.data, self.speed, self.tolerance
        position, velocity, sites = data.qpos, data.qvel, data.site_xpos
        on_coupler, on_rocker = self.jacobians
        q2, q3 = self.begin(crank)
        for _ in range(self.STEPS):
            position[:] = crank, q2, q3
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            mujoco.mj_jacSite(model, data, on_coupler, None, 0)
            mujoco.mj_jacSite(model, data, on_rocker, None, 1)
            (x2, y2, _), (x3, y3, _) = sites.tolist()
            gx, gy = x2 - x3, y2 - y3
            (k, a, _), (m, c, _), _ = on_coupler.tolist()
            b, d = -on_rocker.item(2), -on_rocker.item(5)
            determinant = a * d - b * c
            if abs(gx) + abs(gy) < tolerance:
                break
            q2 -= (d * gx - b * gy) / determinant
            q3 -= (a * gy - c * gx) / determinant
        else:
            self.give_up(crank)
        v2 = (b * m - d * k) * speed / determinant
        v3 = (c * k - a * m) * speed / determinant
        velocity[:] = speed, v2, v3
        mujoco.mj_comVel(model, data)
        coupler, rocker = self.bodies
        mujoco.mj_jacDot(model, data, on_coupler, None, sites[0], coupler)
        mujoco.mj_jacDot(model, data, on_rocker, None, sites[1], rocker)
        (i, j, _), (n, o, _), _ = on_coupler.tolist()
        hx = i * speed + j * v2 - on_rocker.item(2) * v3
        hy = n * speed + o * v2 - on_rocker.item(5) * v3
        e2, e3 = (b * hy - d * hx) / determinant, (c * hx - a * hy) / determinant
        self.last = (crank, q2, q3, v2, v3)
        return crank + q2, q3, speed + v2, v3, e2, e3
