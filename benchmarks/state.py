# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The cost of one state with torque, beside the plain closed form, as a ratio within one run.

The plain form, of plain.py, is what a textbook program computes. Run: python benchmarks/state.py
"""

import argparse
import math
import statistics
import timeit

from plain import make_plain

from linkage_ros import Solver
from linkage_ros.parameters.configuration import load

ROUNDS, STATES = 15, 20_000


def main():
    """Times them in turn and prints medians and their ratio."""
    argparse.ArgumentParser(description=__doc__.splitlines()[0]).parse_args()
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
