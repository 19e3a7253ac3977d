# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The cost of an array of states with torque, beside plain C in one run, as ratios.

The C program is the textbook closed form of each mechanism with the same ten results, compiled
with -O3 and the scalar functions of libm. It fails at change points. Needs a C compiler, cc.
Run: python benchmarks/arrays.py
"""

import ctypes
import math
import statistics
import subprocess
import tempfile
import timeit
from pathlib import Path

import numpy as np

from linkage_ros import FourBar, Solver
from linkage_ros.run.configuration import load

ROUNDS, STATES = 15, 200_000
SOURCE = r"""
#include <math.h>

/* r b c dx dy, mass, inertia and distance of centre of coupler and rocker, crank inertia, g */
void four_bar(long n, const double *k, const double *alpha, double w, double *out)
{
    double r = k[0], b = k[1], c = k[2], dx = k[3], dy = k[4], m2 = k[5], j2 = k[6], s2 = k[7];
    double m3 = k[8], j3 = k[9], s3 = k[10], g = k[12];
    for (long i = 0; i < n; i++) {
        double ca = cos(alpha[i]), sa = sin(alpha[i]);
        double zx = dx - r * ca, zy = dy - r * sa, square = zx * zx + zy * zy;
        double u = (b * b - c * c + square) / (2 * square), v = sqrt(b * b / square - u * u);
        double bx = zx * u - zy * v, by = zx * v + zy * u, cx = bx - zx, cy = by - zy;
        double det = 1 / (bx * cy - by * cx);
        double k2 = -r * (ca * cy - sa * cx) * det, k3 = -r * (ca * by - sa * bx) * det;
        double w2 = k2 * w, w3 = k3 * w;
        double fx = r * w * w * ca + w2 * w2 * bx - w3 * w3 * cx;
        double fy = r * w * w * sa + w2 * w2 * by - w3 * w3 * cy;
        double e2 = (fx * cx + fy * cy) * det, e3 = (fx * bx + fy * by) * det;
        double p = s2 / b, q = s3 / c;
        double vx = -r * sa - p * k2 * by, vy = r * ca + p * k2 * bx;
        double ax = -r * w * w * ca - p * (w2 * w2 * bx + e2 * by);
        double ay = -r * w * w * sa + p * (e2 * bx - w2 * w2 * by);
        out[i] = alpha[i], out[n + i] = atan2(by, bx), out[2 * n + i] = atan2(cy, cx);
        out[3 * n + i] = w, out[4 * n + i] = w2, out[5 * n + i] = w3;
        out[6 * n + i] = 0, out[7 * n + i] = e2, out[8 * n + i] = e3;
        out[9 * n + i] = m2 * (ax * vx + (ay + g) * vy) + j2 * k2 * e2
            + k3 * e3 * (j3 + m3 * s3 * s3) + m3 * g * q * k3 * cx;
    }
}

/* r b, guide, offset, mass inertia centre of the coupler, slider mass force damping,
   moment of the crank, g */
void slider_crank(long n, const double *k, const double *alpha, double w, double *out)
{
    double r = k[0], b = k[1], e = k[3], m2 = k[4], j2 = k[5], s2 = k[6], m3 = k[7];
    double force = k[8], damping = k[9], m1s = k[10], g = k[11];
    double gx = cos(k[2]), gy = sin(k[2]), wx = -g * gy, wy = -g * gx;
    for (long i = 0; i < n; i++) {
        double ca = cos(alpha[i] - k[2]), sa = sin(alpha[i] - k[2]);
        double by = e - r * sa, bx = sqrt(b * b - by * by), k2 = -r * ca / bx;
        double w2 = k2 * w, e2 = (r * w * w * sa + w2 * w2 * by) / bx;
        double k3 = -r * sa - k2 * by, e3 = -r * w * w * ca - w2 * w2 * bx - e2 * by;
        double p = s2 / b;
        double vx = -r * sa - p * k2 * by, vy = r * ca + p * k2 * bx;
        double ax = -r * w * w * ca - p * (w2 * w2 * bx + e2 * by);
        double ay = -r * w * w * sa + p * (e2 * bx - w2 * w2 * by);
        out[i] = alpha[i], out[n + i] = atan2(gx * by + gy * bx, gx * bx - gy * by);
        out[2 * n + i] = r * ca + bx;
        out[3 * n + i] = w, out[4 * n + i] = w2, out[5 * n + i] = k3 * w;
        out[6 * n + i] = 0, out[7 * n + i] = e2, out[8 * n + i] = e3;
        out[9 * n + i] = m2 * ((ax - wx) * vx + (ay - wy) * vy) + j2 * k2 * e2
            + k3 * (m3 * (e3 - wx) + damping * k3 * w - force) - m1s * (wy * ca - wx * sa);
    }
}
"""


def constants(mechanism):
    """What the C functions want to know."""
    crank, coupler, g = mechanism.crank, mechanism.coupler, -mechanism.gravity[1]
    if isinstance(mechanism, FourBar):
        rocker, frame = mechanism.rocker, mechanism.frame
        pivot = (frame.length * math.cos(frame.angle), frame.length * math.sin(frame.angle))
        coupling = coupler.mass, coupler.inertia, coupler.center[0]
        following = rocker.mass, rocker.inertia, rocker.center[0]
        lengths = crank.length, coupler.length, rocker.length
        return [*lengths, *pivot, *coupling, *following, crank.inertia, g]
    slider = mechanism.slider
    return [
        *(crank.length, coupler.length, mechanism.frame.angle, slider.offset),
        *(coupler.mass, coupler.inertia, coupler.center[0]),
        *(slider.mass, slider.force, slider.damping, crank.mass * crank.center[0], g),
    ]


def compiled(folder):
    """The C functions."""
    source, library = Path(folder, 'plain.c'), Path(folder, 'plain.so')
    source.write_text(SOURCE)
    command = ['cc', '-O3', '-shared', '-fPIC', source, '-o', library, '-lm']
    subprocess.run(command, check=True)
    return ctypes.CDLL(str(library))


def main():
    """Times both in turn and prints medians and their ratio."""
    numbers = np.ctypeslib.ndpointer(float)
    angles, speed = np.linspace(0.0, 2 * math.pi, STATES), 5 * math.pi
    with tempfile.TemporaryDirectory() as folder:
        library = compiled(folder)
        for preset in ('quadrilateral', 'slider_crank', 'compressor'):
            configuration = load(preset)
            mechanism, exact = configuration.mechanism, Solver(configuration.mechanism).state
            plain = getattr(library, configuration.kind.mechanism)
            plain.argtypes = [ctypes.c_long, numbers, numbers, ctypes.c_double, numbers]
            k, out = np.array(constants(mechanism)), np.empty((10, STATES))

            def run_c(plain=plain, k=k, out=out):
                plain(STATES, k, angles, speed, out)

            def run_exact(exact=exact):
                return exact(angles, speed)

            run_c()
            state = run_exact()
            scale = np.abs(state.torque).max()
            assert np.abs(out[9] - state.torque).max() < 1e-9 * scale, preset
            assert np.abs(out[2] - state.position[2]).max() < 1e-9
            rows = [
                (timeit.timeit(run_exact, number=1), timeit.timeit(run_c, number=1))
                for _ in range(ROUNDS)
            ]
            ours, theirs = (
                statistics.median(column) / STATES * 1e9 for column in zip(*rows, strict=True)
            )
            ratio = statistics.median(a / b for a, b in rows)
            print(f'{preset:15} {ours:6.1f} ns a state, C {theirs:6.1f} ns, ratio {ratio:.2f}')


if __name__ == '__main__':
    main()
