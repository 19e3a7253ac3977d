# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How true linkage_replay is to a log: lateness at a subscriber, memory, time to a late start.

The subscriber is this process; replay is another. A message is due at its log time over the rate
after the start; the start is where the median message is on time. So the figures say how much the
rhythm wavers, delivery by DDS included. Needs rclpy.
Run: python benchmarks/replay.py [--messages N]
"""

import argparse
import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import JointState

from linkage_ros.log.reader import LogReader
from linkage_ros.log.writer import LogWriter
from linkage_ros.parameters.configuration import configure
from linkage_ros.record import record
from linkage_ros.run.machine import Machine
from linkage_ros.wire.codecs import encode_float64
from linkage_ros.wire.topics import DRIVING_TORQUE, JOINT_STATES

SECONDS, RATES = 10.0, (0.5, 1.0, 4.0)
PERIOD = 5_000_000  # ns


def start(path, *options):
    """linkage_replay as a process of its own."""
    words = [sys.executable, '-m', 'linkage_ros.replay', path, *map(str, options)]
    return subprocess.Popen(words, stdout=subprocess.DEVNULL, stdin=subprocess.DEVNULL)


def measure_lateness(path, *options, rate=1.0):
    """Milliseconds by which each joint state comes after its time."""
    with LogReader(path) as log:
        stored = [(m.time, m.data) for m in log.messages(['/joint_states'])]
    arrived = []
    node = Node('listener')
    node.create_subscription(
        JointState, '/joint_states', lambda data: arrived.append((time.monotonic(), data)), 1000,
        raw=True,
    )  # fmt: skip
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    process = start(path, '--rate', rate, *options)
    while process.poll() is None or executor.spin_once(timeout_sec=0.2):
        executor.spin_once(timeout_sec=0.2)
    executor.shutdown()
    node.destroy_node()
    assert [bytes(data) for _, data in arrived] == [data for _, data in stored]
    times = np.array([moment for moment, _ in arrived])
    late = times - np.array([moment for moment, _ in stored]) / 1e9 / rate
    return (late - np.median(late)) * 1e3


def measure_bare_loop():
    """Milliseconds by which a loop that does nothing but sleep wakes late: what the machine is."""
    begin, late = time.monotonic(), []
    for tick in range(round(SECONDS * 1e9 / PERIOD)):
        due = begin + tick * PERIOD / 1e9
        time.sleep(max(0.0, due - time.monotonic()))
        late.append(time.monotonic() - due)
    return np.array(late) * 1e3


def show(name, late):
    """Prints figures of some latenesses, ms."""
    print(
        f'{name} off the rhythm by {np.median(late):.3f} ms (median), '
        f'{np.percentile(late, 99):.3f} ms (p99), {late.max():.3f} ms (most); '
        f'over 2 ms: {np.count_nonzero(late > 2)}'
    )


def write_long(path, messages):
    """A log of as many messages, two to a state, without solving a state."""
    configuration = configure({'rpm': 60.0})
    machine = Machine(configuration)
    data = machine.snapshot_at(machine.begin(0), 0).messages[0]
    with LogWriter(path, configuration, overwrite=True) as log:
        states, torque = (log.add_topic(t, f'/{t.name}') for t in (JOINT_STATES, DRIVING_TORQUE))
        log.write_motion(machine.begin(0))
        for tick in range(messages // 2):
            log.write(states, tick * PERIOD, data)
            log.write(torque, tick * PERIOD, encode_float64(tick))


def memory(process):
    """MiB that a process holds; None where it has ended."""
    try:
        text = Path(f'/proc/{process.pid}/status').read_text()
    except FileNotFoundError:
        return None
    found = re.search(r'VmRSS:\s+(\d+)', text)
    return int(found[1]) / 1024 if found else None


def watch_memory(path):
    """MiB held once a second, while it plays as fast as it can."""
    process, held = start(path, '--rate', 1e6), []
    while process.poll() is None:
        time.sleep(1)
        held.append(memory(process))
    return [value for value in held if value]


def time_to_first(path, offset):
    """Seconds from opening a log to its first message from an offset on."""
    begin = time.perf_counter()
    with LogReader(path) as log:
        next(log.messages(None, round(offset * 1e9)))
    return time.perf_counter() - begin


def main():
    """Prints the figures."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--messages', type=int, default=2_000_000, help='of the long log')
    messages = parser.parse_args().messages
    os.environ.setdefault('ROS_DOMAIN_ID', '77')
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, 'run.mcap')
        record(configure({'rpm': 60.0}), path, duration=SECONDS)
        rclpy.init()
        for rate in RATES:
            part = np.abs(measure_lateness(path, rate=rate))
            show(f'rate {rate:3g}: {len(part)} joint states, same bytes;', part)
        show('a bare loop of sleeps:', measure_bare_loop())
        rclpy.try_shutdown()
        long = Path(folder, 'long.mcap')
        begin = time.perf_counter()
        write_long(long, messages)
        hours = messages / 2 * PERIOD / 1e9 / 3600
        print(
            f'{messages} messages, {hours:.2g} h of log, {long.stat().st_size / 1e6:.0f} MB, '
            f'written in {time.perf_counter() - begin:.1f} s'
        )
        print(f'first message at the start {time_to_first(long, 0) * 1e3:.1f} ms,', end=' ')
        print(f'in the last second {time_to_first(long, hours * 3600 - 1) * 1e3:.1f} ms')
        held = watch_memory(long)
        print('MiB held while it is played:', *(f'{value:.1f}' for value in held))


if __name__ == '__main__':
    main()
