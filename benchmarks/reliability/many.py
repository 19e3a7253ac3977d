# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Measures how many nodes one machine can run at 100 Hz before ticks are missed.

Each node is a process in its own namespace; all are in one ROS domain and start together. Once all
are discovered, missed ticks, processor time and memory are measured for some seconds. A subscriber
measures the delay of the first node's states.

    python benchmarks/reliability/many.py --out DIR    six minutes, on an idle machine
"""

import os
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack, suppress
from pathlib import Path

import numpy as np
from harness import (
    DOMAIN,
    LISTENER,
    Diagnostics,
    Process,
    finish,
    options,
    quantiles,
    running,
    wait_for,
    words,
)

NUMBERS = (1, 10, 20, 40, 60, 100)
RATE, SETTLED, PATIENCE = 100.0, 4.0, 90.0
# Largest acceptable share of missed ticks; the share, and the total memory, MiB, at which the
# benchmark ends.
ACCEPTABLE, ENOUGH, MEMORY = 1e-3, 0.05, 10_000.0
FIGURES = ('states', 'ticks missed', 'lateness p99, ms', 'lateness max, ms')


def listen(health: Diagnostics, seconds: float) -> np.ndarray:
    """Waits some seconds; returns the latest FIGURES of each node, shape (nodes, 4)."""
    time.sleep(seconds)
    parts = list(health.parts.values())
    heard = [values for *_, values in parts if 'ticks missed' in values]
    rows = [[float(values[name]) for name in FIGURES] for values in heard]
    return np.array(rows).reshape(-1, len(FIGURES))


def start(stack: ExitStack, number: int) -> list[Process]:
    """Starts a number of nodes."""
    command = ('-m', 'linkage_ros.node.linkage_node', *words({'rate_hz': RATE}), '-r')
    return [
        stack.enter_context(running(*command, f'__ns:=/m{index}', domain=DOMAIN))
        for index in range(number)
    ]


def total(nodes: list[Process]) -> float:
    """Returns the processor time of all running nodes, s."""
    return sum(one.computed() for one in nodes if one.alive)


def end(nodes: list[Process]) -> int:
    """Stops all nodes; returns how many do not end within 20 s."""
    for one in nodes:
        one.send(signal.SIGINT)
    with suppress(TimeoutError):
        wait_for(lambda: not any(one.alive for one in nodes), 20.0)
    hung = [one for one in nodes if one.alive]
    for one in hung:
        print(f'process {one.pid} does not end: {one.output[-300:]}')
        one.send(signal.SIGKILL)
    return len(hung)


def measure(number: int, health: Diagnostics, seconds: float) -> dict:
    """Measures a number of nodes that run together."""
    with ExitStack() as stack, tempfile.TemporaryDirectory() as folder:
        times = Path(folder, 'times.npy')
        listen(health, 1.0)  # receives the last messages of the previous nodes
        health.parts.clear()
        begin = time.monotonic()
        nodes = start(stack, number)
        listener = stack.enter_context(running(LISTENER, times, '/m0/joint_states', domain=DOMAIN))
        found = 0
        while found < number and time.monotonic() < begin + PATIENCE:
            found = len(listen(health, 0.2))
        started = time.monotonic() - begin
        before = listen(health, SETTLED)
        computed, since, at = total(nodes), time.monotonic(), time.time_ns()
        after = listen(health, seconds)
        computed, elapsed = total(nodes) - computed, time.monotonic() - since
        alive = [n for n in nodes if n.alive]
        memory = [n.memory() for n in alive]
        hung = end(nodes)
        with suppress(subprocess.TimeoutExpired):  # Fast DDS may hang here, as in the nodes
            listener.end(patience=20.0)
        stamp, arrival = np.load(times).T if times.exists() else np.empty((2, 0))
    late = (arrival - stamp)[arrival > at] * 1e-6
    kept, missed = (after[:, :2].sum(axis=0) - before[:, :2].sum(axis=0)).tolist()
    return {
        'nodes': number, 'found': found, 'started': started,
        'missed': int(missed), 'missed_share': missed / (kept + missed),
        'missed_at_start': int(before[:, 1].sum()), 'died': number - len(alive),
        'hung': hung,
        'tick_late_p99_ms': float(after[:, 2].max()),
        'tick_late_max_ms': float(after[:, 3].max()),
        'heard_late_ms': quantiles(late) if late.size else None,
        'cores': computed / elapsed, 'node_mib': float(np.median(memory)),
        'mib': float(sum(memory)),
    }  # fmt: skip


def show(one: dict) -> None:
    """Prints the figures of one number of nodes."""
    late = one['heard_late_ms'] or {'p99': float('nan')}
    print(
        f'{one["nodes"]:3} nodes: {one["found"]} found in '
        f'{one["started"]:.1f} s; {one["missed"]} ticks missed ({one["missed_share"]:.2%}), '
        f'{one["missed_at_start"]} at the start; ticks {one["tick_late_p99_ms"]:.1f} ms late (p99 '
        f'of the worst), heard {late["p99"]:.1f} ms late (p99); '
        f'{one["cores"]:.2f} of {os.cpu_count()} cores, {one["node_mib"]:.0f} MiB a node',
        flush=True,
    )


def main() -> None:
    given = options(
        __doc__,
        seconds=(8.0, 's for each number of nodes'),
        most=(max(NUMBERS), 'largest number of nodes'),
    )
    rows, health = [], Diagnostics(DOMAIN)
    for number in (n for n in NUMBERS if n <= given.most):
        rows.append(measure(number, health, given.seconds))
        show(rows[-1])
        if rows[-1]['missed_share'] > ENOUGH or rows[-1]['mib'] > MEMORY:
            break
    carried = max((r['nodes'] for r in rows if r['missed_share'] <= ACCEPTABLE), default=0)
    figures = {'cores': os.cpu_count(), 'rate_hz': RATE, 'carried': carried}
    finish('many', given.out, {**figures, 'one_domain': rows})
    print(f'{carried} nodes at {RATE:g} Hz miss no more than {ACCEPTABLE:.1%} of their ticks')


if __name__ == '__main__':
    main()
    sys.stdout.flush()
    os._exit(0)  # Fast DDS may hang if participants end at the same time
