# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Sends 200 trajectories a second to linkage_node for 20 minutes at 1 kHz, with a log.

    python benchmarks/reliability/trajectories.py --out DIR [--minutes 20]

Each trajectory that is taken starts a new segment of motion, which must be logged. The memory of
the node is measured every 10 s. Afterwards, the log is verified. The exit code is 1 if a promise
is broken.
"""

import os
import re
import sys
import tempfile
import time
from pathlib import Path

import rclpy
from harness import DOMAIN, FOLLOWED, Process, environment, finish, node, options, wait_for
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from linkage_ros.log.reader import LogReader
from linkage_ros.log.verify import verify

RATE, SENT_RATE = 1000.0, 200.0
EVERY = 10.0  # s between samples of the memory
GROWTH = 8.0  # MiB, largest growth of memory after the first minute
TURNING = {**FOLLOWED, 'drive': 'motion', 'motion.amplitude': 0.5, 'motion.frequency': 0.5}


def trajectory(number: int) -> JointTrajectory:
    """Returns a trajectory to one of two angles, in turns of a second."""
    message = JointTrajectory(joint_names=['crank'])
    goal = 0.2 * (number // round(SENT_RATE) % 2)
    for k in (1, 2, 3):
        point = JointTrajectoryPoint(positions=[goal + 0.01 * k], velocities=[0.0])
        point.time_from_start.nanosec = k * 200_000_000
        message.points.append(point)
    return message


def watch(process: Process, minutes: float) -> list[tuple[float, float]]:
    """Sends trajectories; returns times, s, and the memory used then, MiB."""
    rclpy.init()
    publisher = rclpy.create_node('operator').create_publisher(
        JointTrajectory, 'crank_trajectory', 10
    )
    wait_for(lambda: publisher.get_subscription_count() or not process.alive)
    begin, number, samples = time.monotonic(), 0, list[tuple[float, float]]()
    while (passed := time.monotonic() - begin) < 60 * minutes and process.alive:
        publisher.publish(trajectory(number))
        number += 1
        if passed >= len(samples) * EVERY:
            samples.append((passed, process.memory()))
            print(f'{passed:6.0f} s  {samples[-1][1]:.1f} MiB', flush=True)
        time.sleep(max(0.0, begin + number / SENT_RATE - time.monotonic()))
    return samples


def main() -> int:
    """Runs the benchmark and prints its figures."""
    given = options(__doc__, minutes=(20.0, 'minutes of the run'))
    os.environ.update(environment(DOMAIN))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, 'run.mcap')
        with node(DOMAIN, rate_hz=RATE, log=path, **TURNING) as process:
            samples = watch(process, given.minutes)
            assert process.end() == 0, process.output
        published = int(re.findall(r'(\d+) states', process.output)[0])
        log = LogReader(path)
        report = verify(log)
        size = path.stat().st_size
    later = [memory for passed, memory in samples if passed >= 60.0] or [samples[-1][1]]
    figures = {
        'published': published, 'logged': report.states, 'motions': len(log.motions),
        'difference': report.difference, 'growth_MiB': max(later) - later[0],
        'log_MB': size / 1e6, 'memory_MiB': samples,
    }  # fmt: skip
    print(*(f'{key}: {value}' for key, value in figures.items() if key != 'memory_MiB'), sep='\n')
    return finish('trajectories', given.out, figures, {
        'every state is in the log': report.states == published,
        'the log verifies': not report.difference,
        f'memory grows by at most {GROWTH:g} MiB after the first minute':
            figures['growth_MiB'] <= GROWTH,
    })  # fmt: skip


if __name__ == '__main__':
    sys.exit(main())
