# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The cost of an array of states with torque, beside plain C in one run, as ratios.

The C program, plain.c, is the textbook closed form of each mechanism with the same ten results,
compiled with -O3 and the scalar functions of libm. Needs a C compiler, cc.
Run: python benchmarks/arrays.py
"""

import argparse
import ctypes
import math
import statistics
import tempfile
import timeit

import numpy as np
from plain import compiled, constants

from linkage_ros import Solver
from linkage_ros.parameters.configuration import load

ROUNDS, STATES = 15, 200_000


def main():
    """Times both in turn and prints medians and their ratio."""
    argparse.ArgumentParser(description=__doc__.splitlines()[0]).parse_args()
    numbers = np.ctypeslib.ndpointer(float)
    angles, speed = np.linspace(0.0, 2 * math.pi, STATES), 5 * math.pi
    with tempfile.TemporaryDirectory() as folder:
        library = ctypes.CDLL(str(compiled(folder)))
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
