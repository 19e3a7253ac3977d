# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Compares the time of a six-bar's state with that of its four-bar, in turns within one run.

python benchmarks/six_bars.py
"""

import argparse
import time
from dataclasses import replace

import numpy as np

from linkage_ros import Body, Coupler, Dyad, DyadSlider, FourBar, Frame, Rocker, Solver

_ROUNDS, _CALLS, _ANGLES = 200, 200, 10_000
_FOUR_BAR = FourBar(
    Frame(0.425, 5.4977),
    Body(0.1, 1.0, 0.0245, (0.02, 0.01)),
    Coupler(0.315, 2.0, 0.016, (0.1575, 0.02)),
    Rocker(0.5, 3.5, 0.066, (0.25, 0.03)),
)
_DYADS = {
    'two links on the coupler': Dyad(
        name='ram', from_='coupler', from_at=(0.2, 0.05), to='frame', to_at=(0.6, 0.0),
        first=Body(0.5, 1.0, 0.02, (0.2, 0.05)), second=Body(0.45, 0.8, 0.01, (0.2, 0.1)),
    ),
    'a link and a slider on the coupler': Dyad(
        name='ram', from_='coupler', from_at=(0.2, 0.05),
        first=Body(0.4, 1.0, 0.01, (0.2, 0.01)), slider=DyadSlider(2.0, (0.3, 0.3), 0.1),
    ),
}  # fmt: skip


def measured(solvers):
    """Returns the least times of one state and of one in an array, s, a row for each solver."""
    angles, found = np.linspace(0, 6, _ANGLES), np.full((len(solvers), 2), np.inf)
    for _ in range(_ROUNDS):
        for row, solver in zip(found, solvers, strict=True):
            start = time.perf_counter()
            for _ in range(_CALLS):
                solver.state(0.3, 2.0)
            middle = time.perf_counter()
            solver.state(angles, 2.0)
            times = (middle - start) / _CALLS, (time.perf_counter() - middle) / _ANGLES
            row[:] = np.minimum(row, times)
    return found


def main():
    """Prints the times."""
    argparse.ArgumentParser(description=__doc__).parse_args()
    mechanisms = [_FOUR_BAR, *(replace(_FOUR_BAR, dyads=(dyad,)) for dyad in _DYADS.values())]
    four_bar, *others = measured([Solver(mechanism) for mechanism in mechanisms])
    print(f'{"four-bar":36}{four_bar[0] * 1e6:6.2f} us, {four_bar[1] * 1e9:5.0f} ns in arrays')
    for name, (one, many) in zip(_DYADS, others, strict=True):
        ratios = f'{one / four_bar[0]:.2f} and {many / four_bar[1]:.2f} times'
        print(f'{name:36}{one * 1e6:6.2f} us, {many * 1e9:5.0f} ns in arrays: {ratios}')


if __name__ == '__main__':
    main()
