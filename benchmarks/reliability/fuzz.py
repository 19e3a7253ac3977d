# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Hostile input in the long form: seeded cases in watched processes, executables, and coverage.

Each case has to end in success or one clear line, within 5 s and 1 GB beyond what the imports
take. The cases are those of test/hostile.py; what fails is saved in DIR/fuzz. With --coverage a
fuzzer that sees which lines are reached (pip install atheris) goes on from good files for so many
seconds, as many for each of its targets.
Run: python benchmarks/reliability/fuzz.py [--out DIR] [--cases N] [--coverage S]
"""

from __future__ import annotations

import importlib.util
import subprocess
import sys
import time
from pathlib import Path

import fuzz_executables
import harness
from fuzz_seeded import CONTROLS, Seeded

SHARES = {'parameter file': 0.4, 'log': 0.35, 'replay options': 0.15, 'live parameters': 0.1}
TARGETS = 'parameter_file', 'log', 'recover', 'replay_options', 'live_parameters'


def run_covered(seconds, out):
    """The same time for each target; where a hang ends the fuzzer it is started again."""
    if importlib.util.find_spec('atheris') is None:
        sys.exit('fuzz.py: atheris is not installed: pip install atheris')
    figures = {}
    for target in TARGETS:
        end = time.monotonic() + seconds / len(TARGETS)
        ends = 0
        while (left := round(end - time.monotonic())) > 0:
            program = Path(__file__).with_name('fuzz_covered.py')
            subprocess.run([sys.executable, program, target, str(left), out / target], check=False)
            ends += 1
        found = sorted(path.name for path in (out / target).glob('*-*'))
        figures[target] = {'seconds': seconds / len(TARGETS), 'starts': ends, 'found': found}
        print(f'{target}: {len(found)} findings', *found, flush=True)
    return figures


def main():
    """Runs what was asked for and leaves DIR/fuzz.json."""
    options = harness.options(
        __doc__,
        cases=(10_000, 'seeded cases'), processes=(120, 'executables started'),
        seed=(0, 'of the first case'), coverage=(0, 's under coverage instead of cases'),
    )  # fmt: skip
    out = options.out / 'fuzz'
    out.mkdir(parents=True, exist_ok=True)
    if options.coverage:
        harness.finish('fuzz_coverage', options.out, run_covered(options.coverage, out))
        return
    figures = {}
    for kind in CONTROLS:
        control = Seeded(kind, out)
        control.run([0])
        assert len(control.failures) == 1, f'{kind} was not found'
    print('every control was found')
    for kind, share in SHARES.items():
        seeded = Seeded(kind, out)
        seeded.run(range(options.seed, options.seed + round(share * options.cases)))
        figures[kind] = seeded.figures()
        print(kind, {k: v for k, v in figures[kind].items() if k != 'failures'}, flush=True)
    figures['executables'] = fuzz_executables.run(options.processes, options.seed, out)
    print('executables', figures['executables'], flush=True)
    harness.finish('fuzz', options.out, figures)
    sys.exit(any(part['failures'] for part in figures.values()))


if __name__ == '__main__':
    main()
