# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Runs linkage_node for 20 minutes at 1 kHz, with log, viewer and changing crank speeds.

    python benchmarks/reliability/soak.py --out DIR [--minutes 20]

Rerun's server runs as another process, so that its memory is not counted. A subscriber runs in a
third process; the crank speed is changed every 10 s. Afterwards, published, logged and received
messages are counted, and the log is verified. States of the first and the last second are compared
with the 50-digit reference of the test suite at the exact crank angle. The exit code is 1 if a
promise is broken.
"""

import os
import random
import re
import subprocess
import sys
import tempfile
import time
from collections import Counter
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import rclpy
from harness import DOMAIN, Process, environment, finish, listening, node, options, wait_for
from mpmath import mp, mpf
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient

from linkage_ros.log.reader import LogReader
from linkage_ros.log.verify import verify
from linkage_ros.messages.cdr import stamp_of
from linkage_ros.run.robot import Robot
from linkage_ros.run.states import Simulator
from linkage_ros.view.viewer_process import find_viewer, free_address

# The reference is in a module of the test suite.
sys.path.append(str(Path(__file__).resolve().parents[2] / 'test'))

from oracle import Oracle

RATE = 1000.0
EVERY = 10.0  # s between changes of the speed, and between samples of the memory
GROWTH = 8.0  # MiB, largest growth of memory after the first minute
ULPS = 4.0  # largest error, in units in the last place of 1 rad


class Speeds:
    """Sets rpm like `ros2 param set`."""

    def __init__(self) -> None:
        rclpy.init()
        self._node = rclpy.create_node('operator')
        self._client = AsyncParameterClient(self._node, 'linkage_node')
        self._random = random.Random(1)

    def change(self) -> None:
        """Sets a random speed."""
        assert self._client.wait_for_services(30.0)
        rpm = self._random.uniform(-600.0, 600.0)
        future = self._client.set_parameters([Parameter('rpm', value=rpm)])
        rclpy.spin_until_future_complete(self._node, future, timeout_sec=10.0)
        assert future.result().results[0].successful


def watch(process: Process, speeds: Speeds, minutes: float) -> list[tuple[float, float]]:
    """Changes the speed again and again; returns times, s, and the memory used then, MiB."""
    begin, samples = time.monotonic(), []
    wait_for(lambda: process.lines or not process.alive)  # wait for its first line
    assert process.alive, process.output
    while (passed := time.monotonic() - begin) < 60 * minutes:
        speeds.change()
        samples.append((passed, process.memory()))
        if len(samples) % 12 == 1:
            print(f'{passed:6.0f} s  {samples[-1][1]:.1f} MiB', flush=True)
        time.sleep(EVERY)
    return samples


@contextmanager
def server():
    """Runs Rerun's server without a window; yields its URL."""
    _, port = free_address('127.0.0.1')
    words = ['--serve-grpc', '--bind', '127.0.0.1', '--port', str(port)]
    process = subprocess.Popen(
        [find_viewer(), *words, '--server-memory-limit', '64MB'], stderr=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
    )  # fmt: skip
    try:
        yield f'rerun+http://127.0.0.1:{port}/proxy'
    finally:
        process.kill()
        process.wait()


def errors(log: LogReader, simulator: Simulator, stamps: set[int]) -> dict[int, float]:
    """Returns the errors of the rocker's logged angle at some stamps, rad."""
    mp.dps = 50
    oracle = Oracle(simulator.linkage.mechanism)
    found = {}
    for message in log.messages(['/joint_states']):
        read = Robot(log.configuration).templates.of(('',)).joint_states.read(message.data)
        (stamp,), (values,) = (column.tolist() for column in read)
        if stamp in stamps:
            angle = mpf(log.configuration.drive.crank_angle)
            ends = [segment.stamp for segment in log.motions[1:]]
            for segment, end in zip(log.motions, [*ends, stamp], strict=True):
                lasted = max(0, min(end, stamp) - segment.stamp)
                angle += mpf(segment.rpm) * 2 * mp.pi * lasted / (60 * 10**9)
            apart = mpf(values[2]) - oracle.state(angle).position[2]
            found[stamp] = abs(float(apart - 2 * mp.pi * mp.nint(apart / (2 * mp.pi))))
    return found


def account(path: Path, heard: Path, output: str) -> dict:
    """Counts published, logged and received messages, and checks the log."""
    published, missed = map(int, re.findall(r'(\d+) states, (\d+) ticks? missed', output)[0])
    log = LogReader(path)
    report = verify(log)
    topics = Counter(message.topic for message in log.messages())
    stamps = [stamp_of(m.data) for m in log.messages(['/joint_states'])]
    simulator = Simulator(log.configuration.only)
    ends = errors(log, simulator, {*stamps[:1000], *stamps[-1000:]})
    received = np.load(heard)[:, 0]
    return {
        'published': published,
        'missed': missed,
        'ticks': simulator.ticks.tick_at(stamps[-1] - log.motions[0].stamp) + 1,
        'logged': dict(topics),
        'heard': len(received),
        'heard_of_the_logged': len(set(stamps) & set(received.tolist())),
        'difference': report.difference,
        'left_out': int((re.findall(r'(\d+) lost to the viewer', output) or ['0'])[0]),
        'first_second_worst_ulp': max(ends[s] for s in stamps[:1000]) / 2**-52,
        'last_second_worst_ulp': max(ends[s] for s in stamps[-1000:]) / 2**-52,
        'log_MB': path.stat().st_size / 1e6,
    }


def promises(figures: dict) -> dict[str, bool]:
    """Returns whether each promise is kept."""
    return {
        'every tick is a state or counted as missed': figures['ticks']
        == figures['published'] + figures['missed'],
        'every state is in the log': figures['logged']['/joint_states'] == figures['published'],
        'what was heard is in the log': figures['heard_of_the_logged'] == figures['heard'],
        'the log verifies': not figures['difference'],
        'the last state is as exact as the first': figures['last_second_worst_ulp'] < ULPS,
        f'memory grows by at most {GROWTH:g} MiB after the first minute': figures['growth_MiB']
        <= GROWTH,
        'no state was dropped by the viewer': figures['left_out'] == 0,
    }


def main() -> int:
    """Runs the benchmark and prints its figures."""
    given = options(__doc__, minutes=(20.0, 'minutes of the run'))
    os.environ.update(environment(DOMAIN))
    with tempfile.TemporaryDirectory() as folder:
        log, heard = Path(folder, 'run.mcap'), Path(folder, 'heard.npy')
        with (
            listening(DOMAIN, heard),
            server() as url,
            node(DOMAIN, rate_hz=RATE, log=log, viewer=url) as process,
        ):
            samples = watch(process, Speeds(), given.minutes)
            assert process.end() == 0, process.output
        figures = account(log, heard, process.output)
    later = [memory for passed, memory in samples if passed >= 60.0] or [samples[-1][1]]
    figures |= {'memory_MiB': samples, 'growth_MiB': max(later) - later[0]}
    print(*(f'{key}: {value}' for key, value in figures.items() if key != 'memory_MiB'), sep='\n')
    return finish('soak', given.out, figures, promises(figures))


if __name__ == '__main__':
    sys.exit(main())
