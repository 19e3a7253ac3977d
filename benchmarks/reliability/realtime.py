# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How punctual linkage_node is, beside a bare loop of sleeps and a timer of rclpy.

For each rate, one after another in the same run: slices of a bare Python loop that sleeps until
each deadline, linkage_node with log and viewer and with the log alone, and a node whose rclpy
timer publishes the same JointState, made as rclpy's tutorials do. A subscriber in a process of
its own hears the nodes.

    python benchmarks/reliability/realtime.py --out DIR     three rates, in a quarter of an hour
    python benchmarks/reliability/realtime.py --seconds 5   a quick look

The figures go to DIR/realtime.json; exit code 1 where a promise does not hold at 1 kHz.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from harness import DOMAIN, Process, finish, listening, node, options, quantiles, running

from linkage_ros.log.reader import LogReader

TIMER_NODE = Path(__file__).with_name('timer_node.py')
RATES = (200.0, 1000.0, 2000.0)  # Hz
SETTLE = 3.0  # s: discovery, and the first second of a run


def bare_loop(rate: float, seconds: float, lateness: list[int]) -> tuple[int, float]:
    """Sleeps until each deadline; returns the ticks missed and the processor time, s."""
    period, missed, tick = round(1e9 / rate), 0, 0
    computed, origin = time.process_time(), time.monotonic_ns()
    while tick < seconds * rate:
        while (left := origin + tick * period - time.monotonic_ns()) > 0:
            time.sleep(left * 1e-9)
        lateness.append(-left)
        due = (time.monotonic_ns() - origin) // period
        missed += due - tick
        tick = due + 1
    return missed, time.process_time() - computed


def watch(process: Process, seconds: float) -> dict[str, float]:
    """What a process takes while it runs for a while."""
    time.sleep(SETTLE)
    computed, memory = process.computed(), process.memory()
    time.sleep(seconds)
    return {
        'cpu_percent': 100 * (process.computed() - computed) / seconds,
        'memory_MiB': process.memory(),
        'memory_grown_MiB': process.memory() - memory,
    }


def heard(path: Path, rate: float, seconds: float) -> dict[str, Any]:
    """What the subscriber got in the last seconds: rate, gaps, age at its arrival."""
    times = np.load(path)
    times = times[times[:, 0] > times[-1, 0] - seconds * 1e9]
    stamps = times[:, 0]
    gaps = np.rint(np.diff(stamps) * 1e-9 * rate).astype(int) - 1
    age = (times[:, 1] - stamps) * 1e-3
    return {
        'rate': (len(stamps) - 1) / ((stamps[-1] - stamps[0]) * 1e-9),
        'states': len(stamps),
        'missed': int(gaps.sum()),
        'age': {**quantiles(age), 'over_1_ms': int((age > 1000).sum())},
    }


def listened(start: Callable[[], Any], rate: float, seconds: float) -> dict[str, Any]:
    """Runs a node with a subscriber; the figures of both, and the node's output."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, 'times.npy')
        with listening(DOMAIN, path) as listener:
            with start() as process:
                figures = watch(process, seconds)
                code = process.end()
            assert code == 0, process.output
            listener.end()
        return {**figures, **heard(path, rate, seconds), 'output': process.output}


def our_node(rate: float, seconds: float, viewer: str) -> dict[str, Any]:
    """linkage_node, with log and, perhaps, viewer."""
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder, 'run.mcap')
        given = {'rate_hz': rate, 'log': log, **({'viewer': viewer} if viewer else {})}
        figures = listened(lambda: node(DOMAIN, **given), rate, seconds)
        with LogReader(log) as run:
            *_, last = run.messages(['/diagnostics'])
            times = [(m.time, m.data) for m in run.messages(['/joint_states'])]
        figures['log_MB'] = log.stat().st_size / 1e6
    figures['late'] = {
        key: 1e3 * float(diagnosed(last.data, f'lateness {key}, ms'))
        for key in ('p50', 'p99', 'max')
    }
    figures['logged'] = len(times)
    return figures


def diagnosed(data: bytes, key: str) -> str:
    """A value in a message of /diagnostics."""
    from diagnostic_msgs.msg import DiagnosticArray
    from rclpy.serialization import deserialize_message

    message = deserialize_message(data, DiagnosticArray)
    (found,) = [v.value for status in message.status for v in status.values if v.key == key]
    return str(found)


def timer_node(rate: float, seconds: float) -> dict[str, Any]:
    """The same message from a timer of rclpy."""
    figures = listened(lambda: running(TIMER_NODE, rate, domain=DOMAIN), rate, seconds)
    p50, p99, most = map(float, figures['output'].splitlines()[-1].split())
    figures['late'] = {'p50': p50, 'p99': p99, 'max': most}
    return figures


def measure(rate: float, seconds: float) -> dict[str, Any]:
    """All three at one rate; the bare loop before and between the others."""
    missed, computed = 0, 0.0
    lateness: list[int] = []
    found: dict[str, Any] = {}
    runs = {
        'log, viewer': lambda: our_node(rate, seconds, 'web'),
        'log alone': lambda: our_node(rate, seconds, ''),
        'rclpy timer': lambda: timer_node(rate, seconds),
    }
    for name, run in runs.items():
        more, took = bare_loop(rate, seconds / 3, lateness)
        missed, computed = missed + more, computed + took
        found[name] = run()
        found[name].pop('output')
    found['bare loop'] = {
        'late': quantiles(np.array(lateness) * 1e-3),
        'missed': missed,
        'cpu_percent': 100 * computed / seconds,
    }
    return found


def show(rate: float, found: dict[str, Any]) -> None:
    """A line for each."""
    for name in ('bare loop', 'rclpy timer', 'log, viewer', 'log alone'):
        one = found[name]
        words = ', '.join(f'{key} {value:.0f}' for key, value in one['late'].items())
        line = f'{rate:5g} Hz  {name:12}  late, us: {words}; {one["missed"]} ticks missed; '
        line += f'{one["cpu_percent"]:.1f} % of a core'
        if 'age' in one:
            age = one['age']
            line += f'; at the subscriber after, us: p50 {age["p50"]:.0f}, p99 {age["p99"]:.0f}, '
            line += f'max {age["max"]:.0f}; {one["memory_MiB"]:.0f} MiB'
        print(line, flush=True)


def promises(found: dict[str, Any]) -> dict[str, bool]:
    """Whether the promises at 1 kHz hold."""
    ours, bare = found['log, viewer'], found['bare loop']
    return {
        "p99 lateness at most 1.5 times the bare loop's": ours['late']['p99']
        <= 1.5 * bare['late']['p99'],
        'ticks missed no more than the bare loop': ours['missed'] <= bare['missed'],
        'less than 10 % of a core with the log': found['log alone']['cpu_percent'] < 10.0,
        'p99 age at the subscriber below 1 ms': ours['age']['p99'] < 1000.0,
    }


def main() -> int:
    """Prints the figures."""
    given = options(__doc__, seconds=(60.0, 's of each contender and rate'))
    found = {}
    for rate in RATES:
        found[f'{rate:g}'] = measure(rate, given.seconds)
        show(rate, found[f'{rate:g}'])
    return finish('realtime', given.out, found, promises(found['1000']))


if __name__ == '__main__':
    sys.exit(main())
