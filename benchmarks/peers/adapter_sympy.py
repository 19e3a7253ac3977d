# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""SymPy: differentiates the textbook position twice and generates functions."""

import functools

import numpy as np
import sympy as sp
from contract import Peer

LENGTHS = sp.symbols('r b c dx dy side')
MASSES = sp.symbols('m1 x1 y1 m2 j2 x2 y2 m3 j3 x3 y3 gx gy')


@functools.cache
def expressions():
    """Returns symbolic angles, rates and accelerations of coupler and rocker, and the torque."""
    r, b, c, dx, dy, side = LENGTHS
    m1, x1, y1, m2, j2, x2, y2, m3, j3, x3, y3, gx, gy = MASSES
    alpha, w = sp.symbols('alpha w')
    crank = sp.Matrix([r * sp.cos(alpha), r * sp.sin(alpha)])
    to_pivot = sp.Matrix([dx, dy]) - crank
    square = to_pivot.dot(to_pivot)
    u = (b**2 - c**2 + square) / (2 * square)
    v = side * sp.sqrt(b**2 / square - u**2)
    coupler = to_pivot * u + sp.Matrix([-to_pivot[1], to_pivot[0]]) * v
    rocker = coupler - to_pivot
    angles = [sp.atan2(link[1], link[0]) for link in (coupler, rocker)]
    # The derivative of atan2, in which the sum of squares is replaced by the known length.
    first = [
        (link[0] * link[1].diff(alpha) - link[1] * link[0].diff(alpha)) / length**2
        for link, length in ((coupler, b), (rocker, c))
    ]
    second = [rate.diff(alpha) for rate in first]
    torque = 0
    centers = (
        (m1, crank / r * x1 + sp.Matrix([-crank[1], crank[0]]) / r * y1),
        (m2, crank + coupler / b * x2 + sp.Matrix([-coupler[1], coupler[0]]) / b * y2),
        (m3, rocker / c * x3 + sp.Matrix([-rocker[1], rocker[0]]) / c * y3),
    )
    for mass, center in centers:
        moved = center.diff(alpha)
        force = moved.diff(alpha) * w**2 - sp.Matrix([gx, gy])
        torque += mass * force.dot(moved)
    for inertia, k, bend in zip((j2, j3), first, second, strict=True):
        torque += inertia * k * bend * w**2
    rates = [k * w for k in first]
    return (alpha, w), [*angles, *rates, *(bend * w**2 for bend in second), torque]


class Adapter(Peer):
    """Wraps functions from lambdify with cse=True, in which the constants are substituted."""

    name = 'SymPy lambdify'
    distribution = 'sympy'
    how = (
        'SymPy derives the textbook closed form, which keeps B on one side of the diagonal: diff, '
        'virtual power for the torque, and lambdify with cse=True. The derivation is not timed.'
    )

    def __init__(self, mechanism, speed, first):
        super().__init__(mechanism, speed, first)
        crank, coupler, rocker = mechanism.crank, mechanism.coupler, mechanism.rocker
        numbers = [*self.lengths[:3], *self.pivot, self.side, crank.mass, *crank.center]
        for body in (coupler, rocker):
            numbers += [body.mass, body.inertia, *body.center]
        numbers += mechanism.gravity
        values = dict(zip(LENGTHS + MASSES, map(sp.Float, numbers), strict=True))
        arguments, wanted = expressions()
        wanted = [x.xreplace(values) for x in wanted]
        self.math, self.math_torque, self.numpy, self.numpy_torque = (
            sp.lambdify(arguments, wanted[:count], modules=modules, cse=True)
            for modules in ('math', 'numpy')
            for count in (6, 7)
        )

    def kinematics(self, angles):
        function, speed = self.math, self.speed
        return [function(angle, speed) for angle in angles]

    def torque(self, angles):
        function, speed = self.math_torque, self.speed
        return [function(angle, speed) for angle in angles]

    def kinematics_array(self, angles):
        return self.numpy(angles, self.speed)

    def torque_array(self, angles):
        return self.numpy_torque(angles, self.speed)

    def table(self, results):
        # For an array, results is a list of rows; otherwise it has one list per state.
        return np.array(results) if isinstance(results[0], np.ndarray) else super().table(results)
