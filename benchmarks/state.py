# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The cost of one state with torque, beside the plain closed form, as a ratio within one run.

The plain form is what a textbook program computes: the coupler-rocker pin by one square root,
rates and accelerations by division by sin(gamma - beta), and document 1's power balance. It fails
at change points. Run: python benchmarks/state.py
"""

import math
import statistics
import timeit

from linkage_ros import Solver
from linkage_ros.run.configuration import load

ROUNDS, STATES = 15, 20_000


def make_plain(mechanism):
    """The plain closed form with torque, all constants bound beforehand."""
    r, b = mechanism.crank.length, mechanism.coupler.length
    c, d = mechanism.rocker.length, mechanism.frame.length
    m2, j2, s2 = (mechanism.coupler.mass, mechanism.coupler.inertia, 0.5)
    m3, j3 = mechanism.rocker.mass, mechanism.rocker.inertia
    g = -mechanism.gravity[1]
    bx0, by0 = d * math.cos(mechanism.frame.angle), d * math.sin(mechanism.frame.angle)
    sin, cos, sqrt, atan2 = math.sin, math.cos, math.sqrt, math.atan2

    def plain(alpha, w):
        ca, sa = cos(alpha), sin(alpha)
        zx, zy = bx0 - r * ca, by0 - r * sa
        square = zx * zx + zy * zy
        u = (b * b - c * c + square) / (2 * square)
        v = sqrt(b * b / square - u * u)
        bx, by = zx * u - zy * v, zx * v + zy * u
        cx, cy = bx - zx, by - zy
        det = bx * cy - by * cx
        k2, k3 = -r * (ca * cy - sa * cx) / det, -r * (ca * by - sa * bx) / det
        w2, w3 = k2 * w, k3 * w
        fx = r * w * w * ca + w2 * w2 * bx - w3 * w3 * cx
        fy = r * w * w * sa + w2 * w2 * by - w3 * w3 * cy
        e2, e3 = (fx * cx + fy * cy) / det, (fx * bx + fy * by) / det
        vx, vy = -r * sa - s2 * k2 * by, r * ca + s2 * k2 * bx
        ax = -r * w * w * ca - s2 * (w2 * w2 * bx + e2 * by)
        ay = -r * w * w * sa + s2 * (e2 * bx - w2 * w2 * by)
        torque = (
            m2 * (ax * vx + (ay + g) * vy)
            + j2 * k2 * e2
            + k3 * e3 * (j3 + m3 * 0.25 * c * c)
            + m3 * g * 0.5 * k3 * cx
        )
        return atan2(by, bx), atan2(cy, cx), w2, w3, e2, e3, torque

    return plain


def main():
    """Times them in turn and prints medians and their ratio."""
    mechanism = load('quadrilateral').mechanism
    plain, exact = make_plain(mechanism), Solver(mechanism).state
    slider_crank = Solver(load('compressor').mechanism).state
    speed = 5 * math.pi
    assert abs(plain(1.0, speed)[-1] - exact(1.0, speed).torque) < 1e-12

    def time(state):
        return timeit.timeit(lambda: state(1.0, speed), number=STATES) / STATES * 1e6

    rows = []
    for _ in range(ROUNDS):
        ours, textbook, sliding = time(exact), time(plain), time(slider_crank)
        rows.append((ours, textbook, ours / textbook, sliding))
    exact_us, plain_us, ratio, sliding_us = (
        statistics.median(column) for column in zip(*rows, strict=True)
    )
    print(f'exact four-bar state with torque     {exact_us:.2f} us')
    print(f'its plain closed form                {plain_us:.2f} us')
    print(f'ratio                                {ratio:.2f}')
    print(f'exact slider-crank state with torque {sliding_us:.2f} us')


if __name__ == '__main__':
    main()
