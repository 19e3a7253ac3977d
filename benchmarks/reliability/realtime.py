# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Measures lateness and processor time of linkage_node at 1 kHz, and processor time of logs.

Contenders take turns in slices: a bare Python loop that sleeps until each deadline; a node whose
rclpy timer publishes the same JointState, with the default executor and with the EventsExecutor;
and linkage_node without log, with log, and with log and viewer. A subscriber in another process
receives the messages of each node. Then record, verify and recover take turns with compression of
the same bytes.

    python benchmarks/reliability/realtime.py --out docs                         in 12 minutes
    python benchmarks/reliability/realtime.py --slices 1 --seconds 3 --rounds 1  a short trial

After every round, the figures are written to DIR/realtime.json and DIR/log_speed.json, and page
and figure to DIR/timing.md and DIR/timing.png, so that Ctrl-C keeps what was measured. Each
contender has median and p99 of the lateness, us (medians over the slices), its maximum, the
numbers of missed ticks and of all ticks, and the processor time, s, as if all ticks took as much
as those of the median second. It also has the processor time per tick of groups of threads, us
(medians over the slices). The exit code is 1 if a limit is exceeded.
"""

import json
import sys
import tempfile
import time
import zlib
from collections import Counter
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
import zstandard
from harness import (
    DOMAIN,
    Diagnostics,
    finish,
    listening,
    missed,
    node,
    options,
    running,
    wait_for,
)
from mcap.records import Chunk
from mcap.stream_reader import StreamReader
from timing_page import CONTENDERS, PARTS, limits, write

from linkage_ros import cli
from linkage_ros.log.reader import LogReader
from linkage_ros.log.recover import recover
from linkage_ros.log.verify import verify
from linkage_ros.programs.record import record
from linkage_ros.settings.configuration import configure, load

TIMER_NODE = Path(__file__).with_name('timer_node.py')
RATE = 1000.0  # Hz
SETTLE = 1.5  # s after the first state, for discovery and start-up
STATES = 20_000  # per log
CASES = {
    'speed-driven': configure({'rate_hz': RATE}),
    'torque-driven': configure({**load('wind_pump').parameters(), 'rate_hz': RATE}),
}


def bare_loop(seconds: int) -> dict[str, Any]:
    """Sleeps until each deadline."""
    period, tick, lateness, computed = round(1e9 / RATE), 0, [], [time.process_time()]
    origin = time.monotonic_ns()
    while tick < seconds * RATE:
        while (left := origin + tick * period - time.monotonic_ns()) > 0:
            time.sleep(left * 1e-9)
        lateness.append(-left)
        tick = 1 + (time.monotonic_ns() - origin) // period
        if tick >= RATE * len(computed):
            computed.append(time.process_time())
    late = np.quantile(lateness, (0.5, 0.99, 1.0)) * 1e-3
    return figures(late, len(lateness), tick - len(lateness), computed, Counter())


def figures(
    late, ticks: int, missed: int, computed: list[float], threads: Counter[str]
) -> dict[str, Any]:
    """Collects the figures of a slice.

    Args:
        late: Lateness, us: median, p99 and maximum.
        ticks: Number of ticks.
        missed: Number of missed ticks.
        computed: Processor time of the process so far, s, at the start and after each second.
        threads: Processor time by thread name, ns.
    """
    p50, p99, most = map(float, late)
    words = {'p50_us': p50, 'p99_us': p99, 'max_us': most, 'missed': missed, 'ticks': ticks}
    parts = dict.fromkeys(PARTS, 0.0)
    for name, time_ns in threads.items():
        parts[part_of(name)] += time_ns * 1e-3 / ticks
    return {**words, 'computed': np.diff(computed).round(4).tolist(), 'parts_us': parts}


def part_of(thread: str) -> str:
    """Returns the group of `PARTS` to which a thread belongs, by the thread's name."""
    if thread.startswith('dds.'):
        return 'middleware'
    if thread.startswith('python') or thread == 'executor':
        return 'main thread'
    # The threads of the Rerun SDK have many names.
    return {'ticker': 'ticks', 'log': 'log', 'sync': 'log'}.get(thread, 'viewer')


def contender(name: str, folder: Path):
    """Returns a context in which the node of a contender runs; its log goes to the folder."""
    if not name.startswith('linkage_node'):
        return running(TIMER_NODE, RATE, name, domain=DOMAIN)
    parameters: dict[str, object] = {'rate_hz': RATE}
    if 'log' in name:
        parameters['log'] = folder / 'run.mcap'
    if 'viewer' in name:
        parameters['viewer'] = 'web'
    return node(DOMAIN, **parameters)


def slice_of(name: str, seconds: int, health: Diagnostics) -> dict[str, Any]:
    """Measures one slice of a contender."""
    if name == 'bare loop':
        return bare_loop(seconds)
    with tempfile.TemporaryDirectory() as directory:
        heard = Path(directory, 'times.npy')
        with (
            listening(DOMAIN, heard) as listener,
            contender(name, Path(directory)) as process,
        ):
            wait_for(lambda: 'heard' in listener.output)
            time.sleep(SETTLE)
            before, computed = process.by_thread(), [process.computed()]
            for _ in range(seconds):
                time.sleep(1.0)
                computed.append(process.computed())
            threads = process.by_thread() - before
            assert process.end() == 0, process.output
        stamps = np.load(heard)[:, 0]
    if name.startswith('linkage_node'):
        _, _, values = health.parts['linkage_node: motion']
        late = [1e3 * float(values[f'lateness {key}, ms']) for key in ('p50', 'p99', 'max')]
    else:
        late = [float(word) for word in process.lines[-1][1].split()]
    stamps = stamps[stamps > stamps[-1] - seconds * 1e9]
    return figures(late, len(stamps), missed(stamps, RATE), computed, threads)


def summary(name: str, slices: list[dict[str, Any]]) -> dict[str, object]:
    """Summarises the slices of a contender in a record.

    The median second of all slices counts, because a virtual machine whose neighbours are busy may
    need half as much processor time again for some seconds.
    """
    ticks = sum(one['ticks'] for one in slices)
    seconds = [second for one in slices for second in one['computed']]
    return {
        'contender': name, 'rate': RATE,
        **{key: round(median(one[key] for one in slices), 1) for key in ('p50_us', 'p99_us')},
        'max_us': round(max(one['max_us'] for one in slices), 1),
        'missed': sum(one['missed'] for one in slices), 'ticks': ticks,
        'cpu_seconds': round(ticks / RATE * median(seconds), 4),
        'parts_us': {part: round(median(one['parts_us'][part] for one in slices), 2)
                     for part in PARTS},
    }  # fmt: skip


def log_speed(rounds: int) -> list[dict[str, object]]:
    """Measures processor time per state of record, verify and recover, relative to compression."""
    found = []
    with tempfile.TemporaryDirectory() as folder:
        log, other = Path(folder, 'log.mcap'), Path(folder, 'other.mcap')
        for case, configuration in CASES.items():
            seconds = STATES / RATE
            record(configuration, log, duration=seconds, overwrite=True)
            packed = chunks(log)
            runs = {
                'compression alone': lambda p=packed: compress(p),
                'record': lambda c=configuration, s=seconds: record(
                    c, other, duration=s, overwrite=True
                ),
                'verify': lambda: check(log),
                'recover': lambda: recover(log, other, overwrite=True),
            }
            times = [{name: timed(run) for name, run in runs.items()} for _ in range(rounds)]
            found += [
                {'case': case, 'work': name,
                 'us_per_state': round(1e6 / STATES * median(t[name] for t in times), 3),
                 'over_compression': round(median(
                     t[name] / t['compression alone'] for t in times), 2)}
                for name in runs
            ]  # fmt: skip
    return found


def chunks(path: Path) -> list[bytes]:
    """Returns the uncompressed contents of all chunks of a log."""
    with path.open('rb') as stream:
        records = list(StreamReader(stream, emit_chunks=True).records)
    packed = [record.data for record in records if isinstance(record, Chunk)]
    return [zstandard.decompress(data) for data in packed]


def compress(packed: list[bytes]) -> None:
    """Compresses chunks, which is the minimum work of writing a log."""
    for data in packed:
        zstandard.compress(data)
        zlib.crc32(data)


def check(path: Path) -> None:
    """Verifies a log.

    Raises:
        RuntimeError: The log differs from the recomputed states.
    """
    log = LogReader(path)
    if verify(log).difference:
        raise RuntimeError(f'{path} differs')


def timed(run) -> float:
    """Measures the processor time of a call, s."""
    begin = time.process_time()
    run()
    return time.process_time() - begin


def main() -> int:
    """Measures, writes and prints the figures."""
    given = options(
        __doc__, slices=(5, 'slices of each contender'), seconds=(12, 's of each slice'),
        rounds=(9, 'rounds of the logs'),
    )  # fmt: skip
    slices: dict[str, list[dict[str, Any]]] = {name: [] for name in CONTENDERS}
    logs = log_speed(given.rounds)
    finish('log_speed', given.out, logs)
    with Diagnostics(DOMAIN) as health:
        for number in range(given.slices):
            # In every other round the order is reversed, so that none always follows the same one.
            for name in list(CONTENDERS)[:: 1 if number % 2 == 0 else -1]:
                slices[name].append(slice_of(name, given.seconds, health))
                print(f'{number + 1}: {name}: {json.dumps(slices[name][-1])}', flush=True)
            records = [summary(name, found) for name, found in slices.items()]
            code = finish('realtime', given.out, records, limits(records, logs))
            text = write(given.out)
    print(text)
    return code


if __name__ == '__main__':
    sys.exit(cli.leave(main()))
