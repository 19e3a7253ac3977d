# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a kill costs: SIGKILL at random moments at 1 kHz, then linkage_log recover and verify.

What a run has lost is what lies between the last state that a subscriber in another process
received and the last one in the recovered log. Exit code 1 if that is more than 0.3 s at any
time, or if a recovered log does not verify.

    python benchmarks/reliability/killed.py --out DIR            20 kills, in five minutes
    python benchmarks/reliability/killed.py --out DIR --kills 3  in less than one
"""

from __future__ import annotations

import random
import signal
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from harness import DOMAIN, finish, listening, node, options, tool, wait_for

from linkage_ros.log.reader import LogReader
from linkage_ros.wire.cdr import stamp_of

RATE = 1000.0
EARLIEST, LATEST = 1.0, 5.0  # s of the run in which it is killed
PROMISED = 0.3  # s


def run(path: Path, heard: Path, seconds: float) -> None:
    """A run that is killed some time after its first state."""
    with (
        listening(DOMAIN, heard) as listener,
        node(DOMAIN, rate_hz=RATE, log=path) as process,
    ):
        wait_for(lambda: 'heard' in listener.output)
        time.sleep(seconds)
        process.end(signal.SIGKILL)
        listener.end()


def last_state(path: Path) -> int:
    """The stamp of the last state in a log, ns."""
    with LogReader(path) as log:
        *_, last = log.messages(['/joint_states'])
    return stamp_of(last.data)


def kill(folder: Path, seconds: float) -> dict[str, Any]:
    """One run, and what is left of it."""
    path, saved, heard = folder / 'run.mcap', folder / 'saved.mcap', folder / 'heard.npy'
    run(path, heard, seconds)
    recovered = tool('recover', path, saved)
    verified = tool('verify', saved)
    figures = {
        'killed_after': seconds,
        'recovered': recovered.returncode == 0,
        'verified': verified.returncode == 0,
        'said': [*recovered.stdout.splitlines(), *recovered.stderr.splitlines()],
        'bytes': path.stat().st_size,
        'heard': len(np.load(heard)),
        'lost': None,
    }
    if figures['verified']:
        figures['lost'] = (int(np.load(heard)[:, 0].max()) - last_state(saved)) * 1e-9
    else:
        figures['said'] += [*verified.stdout.splitlines(), *verified.stderr.splitlines()]
    return figures


def is_kept(figures: dict[str, Any]) -> bool:
    """Whether a kill cost no more than promised."""
    return bool(figures['verified'] and figures['lost'] <= PROMISED)


def main() -> int:
    given = options(__doc__, kills=(20, 'runs killed'), seed=(1, 'of the moments'))
    rng, kills = random.Random(given.seed), []
    for number in range(given.kills):
        seconds = rng.uniform(EARLIEST, LATEST)
        with tempfile.TemporaryDirectory() as folder:
            figures = kill(Path(folder), seconds)
        kills.append(figures)
        if figures['verified']:
            words = f'{figures["lost"]:6.3f} s lost, verified'
        else:
            words = f'NOT KEPT: {"; ".join(figures["said"])}'
        print(f'{number + 1:3}: killed after {seconds:5.2f} s: {words}', flush=True)
    lost = sorted(figures['lost'] for figures in kills if figures['verified'])
    if lost:
        print(
            f'lost: least {lost[0]:.3f}, median {np.median(lost):.3f}, most {lost[-1]:.3f} s; '
            f'promised: {PROMISED} s'
        )
    well = sum(map(is_kept, kills))
    print(f'{well} of {len(kills)} kept the promise')
    finish('killed', given.out, {'promised': PROMISED, 'rate_hz': RATE, 'kills': kills})
    return 0 if well == len(kills) else 1


if __name__ == '__main__':
    sys.exit(main())
