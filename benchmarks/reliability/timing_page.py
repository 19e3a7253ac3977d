# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The figures of realtime.py as a page: docs/timing.md is made by this and never by hand."""

from collections.abc import Iterator, Sequence

CONTENDERS = {
    'bare loop': 'bare loop of sleeps',
    'rclpy timer': 'rclpy timer, default executor',
    'rclpy timer, events': 'rclpy timer, EventsExecutor',
    'linkage_node': 'linkage_node without log',
    'linkage_node, log': 'linkage_node with log',
    'linkage_node, log, viewer': 'linkage_node with log and viewer',
}
PAGE = """\
# Timing

This page shows the node's punctuality at 1 kHz and the cost of logs. On an idle machine, this
command measures and writes it, with [realtime.json](realtime.json) and
[log_speed.json](log_speed.json):

    python benchmarks/reliability/realtime.py --out docs

## Ticks at 1 kHz

The contenders take turns in slices. Each node has one subscriber in another process. The rclpy
timers publish only joint states, without a log. Lateness is the time from a tick's deadline to
its start: the table shows the medians over the slices of the median and the 99th percentile, and
the largest value of all slices. Processor time is that of the node's process.

{ticks}

A separate recorder process, fed through shared memory, was compared with the thread that writes
the log, in a loop of ticks without ROS on a busy machine. The process took 9 to 12 us of
processor time per tick; the thread takes about 10 us in the node. 99 % of the ticks were at most
106 us late with the process, 99 us with the thread at its real-time priority, 177 us with the
thread without that priority, and 111 us without a log. So the log is written by a thread.

## Logs

This table shows the processor time per state (four messages), for the quadrilateral at a given
speed and for the wind pump under its torque. Compression of the same bytes (zstd and crc32) is the
minimum for writing a log.

{logs}

## Limits

{limits}

States and arrays beside other software are in [peers.md](peers.md).
"""


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table; its first column holds words, the others numbers."""
    lines = [f'| {" | ".join(cells)} |' for cells in (head, *rows)]
    return '\n'.join([lines[0], f'|---{"|--:" * (len(head) - 1)}|', *lines[1:]])


def per_tick(record: dict) -> float:
    """Processor time of a tick, us."""
    return float(1e6 * record['cpu_seconds'] / record['ticks'])


def _limits(ticks: Sequence[dict], logs: Sequence[dict]) -> Iterator[tuple[str, float, float]]:
    """Each limited quantity with its measured value and its limit."""
    found = {record['contender']: record for record in ticks}
    cost = {name: per_tick(record) for name, record in found.items()}
    log, viewer = 'linkage_node, log', 'linkage_node, log, viewer'
    yield 'the log adds to a tick, us', cost[log] - cost['linkage_node'], 15
    yield 'the viewer adds to a tick, us', cost[viewer] - cost[log], 40
    yield "node with log, over the rclpy timer's tick", cost[log] / cost['rclpy timer'], 0.55
    # Twice the bare loop's, or 300 us.
    late = max(2 * found['bare loop']['p99_us'], 300.0)
    yield 'p99 lateness with log, us', found[log]['p99_us'], late
    most = {('speed-driven', 'record'): 6, ('torque-driven', 'record'): 20,
            ('speed-driven', 'verify'): 6}  # fmt: skip
    for record in logs:
        key = record['case'], record['work']
        if key in most:
            yield f'{key[1]}, {key[0]}, over compression', record['over_compression'], most[key]


def limits(ticks: Sequence[dict], logs: Sequence[dict]) -> dict[str, bool]:
    """Whether each limit holds."""
    return {words: value <= most for words, value, most in _limits(ticks, logs)}


def page(ticks: Sequence[dict], logs: Sequence[dict]) -> str:
    """The page."""
    late = 'late, us: median', '99 %', 'largest'
    keys = 'p50_us', 'p99_us', 'max_us'
    return PAGE.format(
        ticks=table(
            ('', *late, 'ticks', 'missed', 'us of processor a tick'),
            [
                (
                    CONTENDERS[one['contender']],
                    *(f'{one[key]:.0f}' for key in (*keys, 'ticks', 'missed')),
                    f'{per_tick(one):.1f}',
                )
                for one in ticks
            ],
        ),
        logs=table(
            ('', 'us a state', 'over compression'),
            [
                (
                    f'{one["work"]}, {one["case"]}',
                    f'{one["us_per_state"]:.2f}',
                    f'{one["over_compression"]:.1f}',
                )
                for one in logs
            ],
        ),
        limits=table(
            ('', 'measured', 'limit'),
            [
                (words, f'{value:.3g}', f'{most:.3g}')
                for words, value, most in _limits(ticks, logs)
            ],
        ),
    )
