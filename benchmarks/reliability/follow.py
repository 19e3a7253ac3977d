# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Measures a node that follows a measured crank.

A speed-driven node acts as the robot and publishes joint states at 100, 500 and 1000 Hz; the
following node answers each of them from another process. Both write logs. Subscribers measure the
age of both nodes' states on arrival; the processor time of both nodes is also measured. The log of
the answers is verified, which compares each answer with its measurement; its joints and rates are
compared with a reference of 100 digits.

    python benchmarks/reliability/follow.py --out docs    docs/follow.json, in four minutes

The exit code is 1 if a promise is broken.
"""

import math
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from harness import DOMAIN, FOLLOWED, finish, listening, missed, node, options, quantiles, wait_for
from realtime import SETTLE

from linkage_lab.reference.states import Reference
from linkage_ros.log.reader import LogReader
from linkage_ros.log.verify import verify
from linkage_ros.run.robot import Robot
from linkage_ros.run.states import Simulator

RATES = (100.0, 500.0, 1000.0)  # Hz
MEASURED, ANSWERS = '/joint_states', '/linkage/joint_states'
REMAPS = ('measured_joint_states', MEASURED), ('joint_states', ANSWERS)
COMPARED = 200  # number of states compared with the reference


def heard(path: Path, rate: float, seconds: float) -> dict:
    """Returns rate, missed ticks and ages of the states in the last seconds."""
    times = np.load(path)
    times = times[times[:, 0] > times[-1, 0] - seconds * 1e9]
    stamps = times[:, 0]
    return {
        'rate': (len(stamps) - 1) / ((stamps[-1] - stamps[0]) * 1e-9),
        'states': len(stamps),
        'missed': missed(stamps, rate),
        'age': quantiles((times[:, 1] - stamps) * 1e-3),
    }


def compared(path: Path) -> dict:
    """Verifies a log; returns the errors of joints, rad, and relative errors of rates."""
    errors = []
    log = LogReader(path)
    simulator, difference = Simulator(log.configuration.only), verify(log).difference
    data = b''.join(message.data for message in log.messages([ANSWERS]))
    _, answers = Robot(log.configuration).templates.of(('',)).joint_states.read(data)
    for values in answers[:: 1 + len(answers) // COMPARED].tolist():
        crank, coupler, rocker, speed, *rates = values[:6]
        exact = Reference(simulator.linkage.mechanism, speed, 0.0).state(crank)
        ours = coupler + crank, rocker, rates[0] / speed + 1.0, rates[1] / speed
        true = *exact['position'], *(rate / speed for rate in exact['rate'])
        apart = (float(a - b) for a, b in zip(ours, true, strict=True))
        errors += [abs(math.remainder(one, 2 * math.pi)) for one in apart]
    return {'answers': len(answers), 'difference': difference, 'error': max(errors)}


def measure(rate: float, seconds: float) -> dict:
    """Measures both nodes at one rate."""
    with tempfile.TemporaryDirectory() as folder:
        names = 'first.npy', 'second.npy', 'robot.mcap', 'follow.mcap'
        first, second, log, followed = (Path(folder, name) for name in names)
        with (
            listening(DOMAIN, first),
            listening(DOMAIN, second, topic=ANSWERS) as other,
            node(DOMAIN, remaps=REMAPS, **FOLLOWED, log=followed) as following,
            node(DOMAIN, rate_hz=rate, log=log) as robot,
        ):
            wait_for(lambda: 'heard' in other.output)
            time.sleep(SETTLE)
            before = robot.computed(), following.computed()
            time.sleep(seconds)
            shares = robot.computed() - before[0], following.computed() - before[1]
            codes = [process.end() for process in (robot, following)]
            assert codes == [0, 0], robot.output + following.output
        return {
            'speed': {'cpu_percent': 100 * shares[0] / seconds, **heard(first, rate, seconds)},
            'follow': {'cpu_percent': 100 * shares[1] / seconds, **heard(second, rate, seconds)},
            **compared(followed),
        }


def main() -> int:
    """Prints the rows of the table in docs/follow.md."""
    given, found, kept = options(__doc__, seconds=(60.0, 's at each rate')), {}, {}
    for name in map('{:g}'.format, RATES):
        one = found[name] = measure(float(name), given.seconds)
        cells = [
            f'{x["age"]["p50"]:.0f} | {x["age"]["p99"]:.0f} | {x["cpu_percent"]:.1f} %'
            for x in (one['speed'], one['follow'])
        ]
        print(f'| {name} Hz | {" | ".join(cells)} | {one["answers"]} |', flush=True)
        kept[f'{name} Hz: each measurement is answered once'] = not one['difference']
        kept[f'{name} Hz: joints and rates within 1e-12'] = one['error'] <= 1e-12
    return finish('follow', given.out, found, kept)


if __name__ == '__main__':
    sys.exit(main())
