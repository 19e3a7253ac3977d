# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Processor time of each integrator over the damping of a motor line: motion/integrators.py."""

import argparse
import math
import time
from contextlib import suppress
from functools import partial

from linkage_ros import Solver
from linkage_ros.errors import MotionError
from linkage_ros.motion.adaptive_integrator import AdaptiveSteps
from linkage_ros.motion.driven_mechanism import DrivenMechanism
from linkage_ros.motion.fixed_step_integrator import FixedSteps
from linkage_ros.motion.stiff_integrator import StiffSteps
from linkage_ros.parameters.configuration import load

_KINDS = {
    'explicit': FixedSteps, 'implicit': StiffSteps,
    'DOP853': AdaptiveSteps, 'implicit, 1e-11': partial(StiffSteps, tolerance=1e-11),
}  # fmt: skip
_MOST = 10.0  # s of processor time
_CASES = (
    *(('quadrilateral', damping, 5 * math.pi) for damping in (30.0, 200.0, 1e3, 1e7)),
    *(('wind_pump', damping, 3.0) for damping in (1e5, 4e5, 1e7)),
)


def main() -> None:
    """Prints s of processor time for each second of motion."""
    for preset, damping, speed in _CASES:
        mechanism = load(preset).mechanism
        driven = DrivenMechanism(Solver(mechanism), lambda u, d=damping, w=speed: d * (w - u))
        positions, rates = mechanism.start()
        found = []
        for name, kind in _KINDS.items():
            steps, start = kind(driven, (0.0, *positions, speed, *rates)), time.process_time()
            with suppress(MotionError):
                while steps.time < 1.0 and time.process_time() - start < _MOST:
                    steps.advance(steps.time + 1e-3)
            taken = (time.process_time() - start) / steps.time if steps.time else math.inf
            found.append(f'{name} {taken:.2g}')
        print(f'{preset} {damping:g} N m s, {driven.rates[0]:.1g}/s:', ', '.join(found))


if __name__ == '__main__':
    argparse.ArgumentParser(description=__doc__).parse_args()
    main()
