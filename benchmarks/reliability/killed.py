# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Measures the data lost by a kill: SIGKILL at random moments at 1 kHz.

linkage_log recovers and verifies each log. The loss is the time from the last state in the
recovered log to the last state that a subscriber in another process received. The exit code is 1
if a run lost more than 0.3 s, or if a recovered log fails verification.

    python benchmarks/reliability/killed.py --out DIR             20 kills in five minutes
    python benchmarks/reliability/killed.py --out DIR --number 3  less than a minute
"""

import argparse
import random
import signal
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from harness import DOMAIN, finish, listening, node, options, tool, wait_for

from linkage_ros.log.reader import LogReader
from linkage_ros.messages.cdr import stamp_of

RATE = 1000.0
EARLIEST, LATEST = 1.0, 5.0  # s from the first state to the kill
PROMISED = 0.3  # s, promised limit of the loss


def last_state(path: Path) -> int:
    """Returns the stamp of the last state in a log, ns."""
    log = LogReader(path)
    *_, last = log.messages(['/joint_states'])
    return stamp_of(last.data)


def recovered(path: Path, saved: Path, last: int) -> dict:
    """Recovers and verifies a log.

    Args:
        path: The log.
        saved: Path of the recovered log.
        last: Stamp of the last state before the fault, ns.

    Returns:
        Whether the log passes verification, the output of both commands, and the loss, s.
    """
    done = [tool('recover', path, saved), tool('verify', saved)]
    verified = done[1].returncode == 0
    return {
        'verified': verified,
        'said': ''.join(one.stdout + one.stderr for one in done).splitlines(),
        'lost': (last - last_state(saved)) * 1e-9 if verified else None,
    }


def kill(folder: Path, seconds: float) -> dict:
    """Kills a run some seconds after its first state, and recovers its log."""
    path, heard = folder / 'run.mcap', folder / 'heard.npy'
    with (
        listening(DOMAIN, heard) as listener,
        node(DOMAIN, rate_hz=RATE, log=path) as process,
    ):
        wait_for(lambda: 'heard' in listener.output)
        time.sleep(seconds)
        process.end(signal.SIGKILL)
    last = int(np.load(heard)[:, 0].max())
    return {'killed_after': seconds, **recovered(path, folder / 'saved.mcap', last)}


def survey(
    name: str, given: argparse.Namespace, interrupt,
    span: tuple[float, float], promised: float,
) -> int:  # fmt: skip
    """Interrupts runs at random moments, prints the loss of each, and writes the figures.

    Args:
        name: Name of the benchmark.
        given: Options: out, seed and number.
        interrupt: Runs the node in a folder and interrupts the run after a time, s.
        span: Shortest and longest of these times, s.
        promised: Promised limit of the loss, s.

    Returns:
        The exit code.
    """
    rng, runs = random.Random(given.seed), []
    for number in range(1, given.number + 1):
        seconds = rng.uniform(*span)
        with tempfile.TemporaryDirectory() as folder:
            runs.append(one := interrupt(Path(folder), seconds))
        words = f'{one["lost"]:6.3f} s lost' if one['verified'] else '; '.join(one['said'])
        print(f'{number:3}: after {seconds:5.2f} s: {words}', flush=True)
    lost = sorted(one['lost'] for one in runs if one['verified'])
    kept = sum(seconds <= promised for seconds in lost)
    if lost:
        print(f'lost: least {lost[0]:.3f}, median {np.median(lost):.3f}, most {lost[-1]:.3f} s')
    print(f'{kept} of {len(runs)} verify and lost no more than {promised:g} s')
    finish(name, given.out, {'promised': promised, 'rate_hz': RATE, 'runs': runs})
    return 0 if kept == len(runs) else 1


def main() -> int:
    given = options(__doc__, number=(20, 'kills'), seed=(1, 'seed of the moments'))
    return survey('killed', given, kill, (EARLIEST, LATEST), PROMISED)


if __name__ == '__main__':
    sys.exit(main())
