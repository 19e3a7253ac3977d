# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Hostile input in the long form: seeded cases in watched processes, and executables.

Each case has to end in success or one clear line, within 5 s and 1 GB beyond what the imports
take. The cases are those of test/hostile.py; what fails is saved in DIR/fuzz.
Run: python benchmarks/reliability/fuzz.py [--out DIR] [--cases N]
"""

import multiprocessing
import sys
from concurrent.futures import ProcessPoolExecutor

import harness
from fuzz_seeded import CONTROLS, work

SHARES = {'parameter file': 0.4, 'log': 0.35, 'replay options': 0.15, 'live parameters': 0.1}
BATCH = 500  # cases of one process


def run(kind, seeds, out):
    """Tries cases; a process that dies ends the benchmark with BrokenProcessPool.

    Args:
        kind: Kind of the cases.
        seeds: Seeds of the cases.
        out: Folder for the files of those that fail.

    Returns:
        Figures for the report.
    """
    rows = []
    for first in range(0, len(seeds), BATCH):
        with ProcessPoolExecutor(1, multiprocessing.get_context('spawn')) as pool:
            rows += pool.submit(work, kind, seeds[first : first + BATCH], out).result()
    failures = [{'seed': seed, 'words': words} for seed, *_, words in rows if words]
    slowest = max(rows, key=lambda row: row[1])
    largest = max(rows, key=lambda row: row[2])
    return {
        'cases': len(rows), 'accepted': sum(row[3] for row in rows),
        'slowest, s of processor': round(slowest[1], 3), 'seed of the slowest': slowest[0],
        'greatest memory, MB': round(largest[2]), 'its seed': largest[0], 'failures': failures,
    }  # fmt: skip


def main():
    """Runs all kinds and leaves DIR/fuzz.json."""
    options = harness.options(
        __doc__,
        cases=(10_000, 'seeded cases'), processes=(120, 'executables started'),
        seed=(0, 'of the first case'),
    )  # fmt: skip
    out = options.out / 'fuzz'
    out.mkdir(parents=True, exist_ok=True)
    for kind in CONTROLS:
        assert len(run(kind, [0], out)['failures']) == 1, f'{kind} was not found'
    print('every control was found', flush=True)
    counts = {kind: round(share * options.cases) for kind, share in SHARES.items()}
    figures = {}
    for kind, count in {**counts, 'executable': options.processes}.items():
        figures[kind] = run(kind, range(options.seed, options.seed + count), out)
        for failure in figures[kind]['failures']:
            print(f'{kind}, seed {failure["seed"]}: {failure["words"].splitlines()[-1]}')
        print(kind, {k: v for k, v in figures[kind].items() if k != 'failures'}, flush=True)
    harness.finish('fuzz', options.out, figures)
    sys.exit(any(part['failures'] for part in figures.values()))


if __name__ == '__main__':
    main()
