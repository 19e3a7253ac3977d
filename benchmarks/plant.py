# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What torque-driven motion costs: one evaluation, one millisecond live, one minute recorded.

Run: python benchmarks/plant.py
"""

import argparse
import tempfile
import time
import timeit
from dataclasses import replace
from pathlib import Path

from linkage_ros import Solver
from linkage_ros.motion.driven_mechanism import DrivenMechanism
from linkage_ros.motion.fixed_step_integrator import FixedSteps
from linkage_ros.parameters.configuration import configure, load
from linkage_ros.progress import progress_bar
from linkage_ros.record import record

ROUNDS = 7


def best(words, call, number):
    """Seconds a call, the best of some rounds."""
    rounds = progress_bar(range(ROUNDS), desc=words, unit=' rounds')
    return min(timeit.timeit(call, number=number) for _ in rounds) / number


def main():
    """Times the wind pump and the quadrilateral."""
    argparse.ArgumentParser(description=__doc__.splitlines()[0]).parse_args()
    for configuration in (load('wind_pump'), configure({'drive': 'torque'})):
        solver = Solver(configuration.mechanism)
        count = len(solver.coordinates)
        q, u = (0.3, 1.5)[:count], (2.0, 0.4)[:count]
        one = best('accelerations', lambda s=solver, y=(*q, *u): s.forward(y, 3.0), 5_000)
        steps = FixedSteps(DrivenMechanism(solver, lambda speed: 8.4 - 1.2 * speed), (*q, *u))
        tick = best('steps', lambda steps=steps: steps.advance(steps.time + 1e-3), 500)
        with tempfile.TemporaryDirectory() as folder:
            longer = replace(configuration, session=replace(configuration.session, rate_hz=200.0))
            start = time.perf_counter()
            states = record(longer, Path(folder) / 'run.mcap', duration=60, progress=True)
            minute = time.perf_counter() - start
        print(
            f'{configuration.kind.mechanism}: accelerations {one * 1e6:.1f} us, '
            f'one step of 1 ms live {tick * 1e6:.0f} us, '
            f'60 s recorded ({states} states) {minute:.2f} s'
        )


if __name__ == '__main__':
    main()
