# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The textbook closed form of a four-bar, in Python and in C.

The position of the coupler-rocker pin takes one square root; rates and accelerations take a
division by sin(gamma - beta); the torque comes from the power balance of Ghalbi 2019. The form
fails at change points.
"""

import math
import subprocess
from pathlib import Path

SOURCE = Path(__file__).with_name('plain.c')


def make_plain(mechanism, side):
    """Makes a Python function with all constants bound.

    Args:
        mechanism: A four-bar with a balanced crank, centres of mass on the lines between pins,
            and gravity along -y. For other four-bars the torque is wrong.
        side: +1 if the coupler-rocker pin is left of the line from A to B0, -1 if right.

    Returns:
        A function of crank angle and speed that returns angles, rates and accelerations of
        coupler and rocker, and the torque.
    """
    r, b = mechanism.crank.length, mechanism.coupler.length
    c, d = mechanism.rocker.length, mechanism.frame.length
    m2, j2, s2 = mechanism.coupler.mass, mechanism.coupler.inertia, mechanism.coupler.center[0] / b
    m3, j3, s3 = mechanism.rocker.mass, mechanism.rocker.inertia, mechanism.rocker.center[0] / c
    pivot_j3 = j3 + m3 * s3 * s3 * c * c
    g = -mechanism.gravity[1]
    bx0, by0 = d * math.cos(mechanism.frame.angle), d * math.sin(mechanism.frame.angle)
    sin, cos, sqrt, atan2 = math.sin, math.cos, math.sqrt, math.atan2

    def plain(alpha, w):
        ca, sa = cos(alpha), sin(alpha)
        zx, zy = bx0 - r * ca, by0 - r * sa
        square = zx * zx + zy * zy
        u = (b * b - c * c + square) / (2 * square)
        v = side * sqrt(b * b / square - u * u)
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
            + k3 * e3 * pivot_j3
            + m3 * g * s3 * k3 * cx
        )
        return atan2(by, bx), atan2(cy, cx), w2, w3, e2, e3, torque

    return plain


def constants(mechanism, side):
    """Returns the constants of a four-bar in the order expected by the C function."""
    crank, coupler, rocker = mechanism.crank, mechanism.coupler, mechanism.rocker
    frame = mechanism.frame
    pivot = (frame.length * math.cos(frame.angle), frame.length * math.sin(frame.angle))
    return [
        *(crank.length, coupler.length, rocker.length, *pivot),
        *(coupler.mass, coupler.inertia, coupler.center[0]),
        *(rocker.mass, rocker.inertia, rocker.center[0]),
        *(-mechanism.gravity[1], side),
    ]


def compiled(folder, *flags):
    """Compiles the C function; returns the path of the library.

    Raises:
        RuntimeError: cc fails; the message contains its output.
    """
    library = Path(folder, 'plain.so')
    command = ['cc', '-O3', *flags, '-shared', '-fPIC', SOURCE, '-o', library, '-lm']
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(done.stderr)
    return library
