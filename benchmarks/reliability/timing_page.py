# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Generates the timing page and its figure from the JSON files of the benchmarks.

python benchmarks/reliability/timing_page.py    updates docs/timing.md and docs/timing.png
"""

import argparse
import json
from collections.abc import Iterator, Sequence
from pathlib import Path

from linkage_lab.methods.registry import LIVE, RECORDS
from linkage_ros.palette import FIRST, fractions

DOCS = Path(__file__).parents[2] / 'docs'
SOURCES = 'realtime', 'log_speed', 'accuracy', 'peers', 'linkages'

CONTENDERS = {
    'bare loop': 'bare loop of sleeps',
    'rclpy timer': 'rclpy timer, default executor',
    'rclpy timer, events': 'rclpy timer, EventsExecutor',
    'linkage_node': 'linkage_node without log',
    'linkage_node, log': 'linkage_node with log',
    'linkage_node, log, viewer': 'linkage_node with log and viewer',
}
# Groups of threads, whose processor time is measured separately.
PARTS = 'ticks', 'main thread', 'middleware', 'log', 'viewer'
PAGE = """\
# Timing

Punctuality of the node at 1 kHz, and the cost of ticks, logs, motions under a torque, and several
linkages; [peers.md](../lab/docs/peers.md) has the time of a state. These commands measure ticks
and logs ([realtime.json](realtime.json), [log_speed.json](log_speed.json)) on an idle machine,
motions ([accuracy.json](accuracy.json)) and several linkages ([linkages.json](linkages.json)), and
make the page:

    python benchmarks/reliability/realtime.py --out docs
    linkage_chart accuracy --out docs
    python benchmarks/reliability/linkages.py --out docs
    python benchmarks/reliability/timing_page.py

![Cost of logs, ticks, motions under a torque, and states](timing.png)

## Ticks at 1 kHz

The programs run in turn, in 3 slices of 10 s, on two processors (AMD EPYC of the fourth
generation), each with one subscriber in another process; the rclpy timers publish only joint
states. Lateness is the time from a tick's deadline to its start: medians over the slices, and the
largest of all, which for linkage_node includes the start-up.

{ticks}

Processor time per tick of the threads, us; `top -H` lists the threads by name:

{parts}

In 15 of 356 starts of linkage_node one tick waited for 0.33 s soon after the start, for a lock of
Fast DDS ([#6535](https://github.com/eProsima/Fast-DDS/issues/6535)).

## Logs

Processor time per state, for the quadrilateral at a given speed (four messages) and for the wind
pump under its torque (three). Compression of the same bytes (zstd and crc32) is a lower bound.

{logs}

## Motions under a torque

Time per millisecond of motion, on another machine:

{steps}

## Several linkages

{linkages}

## Limits

{limits}

The processor time of the tick thread varies by 20 us from one start to the next, and so does what
log or viewer adds.
"""


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Formats a table; the first column is text, the others are numbers."""
    lines = [f'| {" | ".join(cells)} |' for cells in (head, *rows)]
    return '\n'.join([lines[0], f'|---{"|--:" * (len(head) - 1)}|', *lines[1:]])


def per_tick(record: dict) -> float:
    """Returns the processor time per tick, us."""
    return float(1e6 * record['cpu_seconds'] / record['ticks'])


SEVERAL = """\
One, 4 and 12 four-bars, in one node and in nodes of their own, follow a robot in another process
that publishes 20 joints. The cases took turns in {rounds} rounds of {seconds:g} s; the figures are
medians of the rounds, and sums of measurements. The machine was {cpu} with {cores} cores; its load
average before the run, caused by other programs, was {load:.1f}, and the nice value of the
benchmark's processes {nice}. The second rate is the one that the robot kept. Processor time is
that of all linkage nodes for each measurement, also relative to one linkage in the same round.
Memory that processes share counts in parts. The answer to a measurement is complete when a
receiver in another process has the joints of all linkages; latency is the time from the stamp of
the measurement until then. Incomplete answers are lost.

{table}"""


def several(found: dict) -> str:
    """Formats the section on several linkages."""
    head = (
        'rate, kept', 'linkages', 'nodes', 'processor time, us', 'relative to one', '% of a core',
        'memory, MiB', 'latency, ms: median', '99 %', 'measurements', 'lost',
    )  # fmt: skip
    rows = [
        (
            f'{one["rate_hz"]:.0f} Hz, {one["robot_hz"]:.0f} Hz',
            str(one['linkages']), str(one['nodes']),
            f'{one["us_per_measurement"]:.0f}', f'{one["over_one"]:.2f}',
            f'{one["cpu_percent"]:.1f}', f'{one["memory_mib"]:.0f}',
            *(f'{one[key]:.1f}' for key in ('p50_ms', 'p99_ms')),
            *(str(one[key]) for key in ('sent', 'lost')),
        )
        for one in found['records']
    ]  # fmt: skip
    machine = found['machine']
    return SEVERAL.format(
        **{key: found[key] for key in ('rounds', 'seconds')}, cpu=machine['cpu'],
        cores=machine['cores'], load=machine['load_before'][0], nice=machine['nice'],
        table=table(head, rows),
    )  # fmt: skip


def _limits(ticks: Sequence[dict], logs: Sequence[dict]) -> Iterator[tuple[str, float, float]]:
    """Returns the measured value and the limit of each limited quantity."""
    found = {record['contender']: record for record in ticks}
    cost = {name: per_tick(record) for name, record in found.items()}
    log, viewer = 'linkage_node, log', 'linkage_node, log, viewer'
    yield 'the log adds to a tick, us', cost[log] - cost['linkage_node'], 15
    yield 'the threads of the log, us per tick', found[log]['parts_us']['log'], 15
    yield 'the viewer adds to a tick, us', cost[viewer] - cost[log], 40
    yield 'the threads of the viewer, us per tick', found[viewer]['parts_us']['viewer'], 40
    yield 'node with log, relative to the rclpy timer', cost[log] / cost['rclpy timer'], 0.55
    # twice that of the bare loop, or 300 us
    late = max(2 * found['bare loop']['p99_us'], 300.0)
    yield 'p99 lateness with log, us', found[log]['p99_us'], late
    most = {('speed-driven', 'record'): 6, ('torque-driven', 'record'): 20,
            ('speed-driven', 'verify'): 6}  # fmt: skip
    for record in logs:
        key = record['case'], record['work']
        if key in most:
            name = f'{key[1]}, {key[0]}, relative to compression'
            yield name, record['over_compression'], most[key]


def _limits_of_several(linkages: dict) -> Iterator[tuple[str, float, float]]:
    """Yields the cost of twelve linkages in one node; see `_limits`."""
    for one in linkages['records']:
        if (one['linkages'], one['nodes']) == (12, 1):
            rate = f'{one["rate_hz"]:.0f} Hz'
            yield f'twelve linkages in one node, relative to one, {rate}', one['over_one'], 2.5


def limits(ticks: Sequence[dict], logs: Sequence[dict]) -> dict[str, bool]:
    """Returns whether each limit is met."""
    return {words: value <= most for words, value, most in _limits(ticks, logs)}


def _steps(accuracy: dict) -> Iterator[tuple[str, float, float]]:
    """Yields the mean and the longest time per ms of motion, us, per integrator and mechanism."""
    settings = {LIVE: 'step 0.001, tolerance 1e-09', RECORDS: ''}
    found = {
        (one['method'], one['mechanism'], one['mode']): one['us_per_state']
        for one in accuracy['records']
        if one['quantity'] == 'trajectory' and one['setting'] == settings.get(one['method'])
    }
    for method, use in ((LIVE, 'live run'), (RECORDS, 'record')):
        for mechanism in ('quadrilateral', 'wind_pump'):
            mean, slowest = (
                found[method, mechanism, mode] for mode in ('motion', 'motion, slowest ms')
            )
            yield f'{use}, {mechanism}', mean, slowest


def _states(peers: dict) -> Iterator[tuple[str, float]]:
    """Yields the time of a state, relative to this package, of peers that compute the torque."""
    modes = {'one': 'one at a time', 'array': 'arrays'}
    for one in peers['records']:
        if one['work'] == 'torque':
            yield f'{one["peer"]}, {modes[one["mode"]]}', one['ratio']


def draw(
    ticks: Sequence[dict], logs: Sequence[dict], accuracy: dict, peers: dict, path: Path
) -> None:
    """Draws the figures of the page as bar charts."""
    from linkage_lab.output import chart

    def bars(axes, title: str, values: dict[str, float]) -> None:
        names = list(values)[::-1]
        drawn = axes.barh(names, [values[name] for name in names], color=fractions(FIRST))
        axes.bar_label(drawn, fmt='%.3g', padding=3)
        axes.set_title(title)
        axes.margins(x=0.15)
        axes.grid(visible=False, axis='y')
        axes.spines[['top', 'right']].set_visible(False)

    title = 'Processor time of ticks, logs, motions and states'
    with chart([path], 7.5, title) as figure:
        grid = figure.subplots(2, 2)
        costs = {CONTENDERS[one['contender']]: per_tick(one) for one in ticks}
        bars(grid[0, 0], 'A tick at 1 kHz, \N{MICRO SIGN}s', costs)
        over = {f'{x["work"]}, {x["case"]}': x['over_compression'] for x in logs}
        over = {name: value for name, value in over.items() if 'alone' not in name}
        bars(grid[0, 1], 'A logged state, relative to compression', over)
        means = {name: mean for name, mean, _ in _steps(accuracy)}
        bars(grid[1, 0], 'A ms of motion under a torque, \N{MICRO SIGN}s', means)
        ratios = dict(_states(peers))
        bars(grid[1, 1], 'A state with torque, relative to linkage_ros', ratios)


def page(ticks: Sequence[dict], logs: Sequence[dict], accuracy: dict, linkages: dict) -> str:
    """Formats the page."""
    late = 'late, us: median', '99 %', 'largest'
    keys = 'p50_us', 'p99_us', 'max_us'
    return PAGE.format(
        ticks=table(
            ('', *late, 'ticks', 'missed', 'processor time per tick, us'),
            [
                (
                    CONTENDERS[one['contender']],
                    *(f'{one[key]:.0f}' for key in (*keys, 'ticks', 'missed')),
                    f'{per_tick(one):.1f}',
                )
                for one in ticks
            ],
        ),
        parts=table(
            ('', *PARTS),
            [
                (CONTENDERS[one['contender']], *(f'{one["parts_us"][p]:.1f}' for p in PARTS))
                for one in ticks
                if any(one['parts_us'].values())
            ],
        ),
        logs=table(
            ('', 'us per state', 'relative to compression'),
            [
                (
                    f'{one["work"]}, {one["case"]}',
                    f'{one["us_per_state"]:.2f}',
                    f'{one["over_compression"]:.1f}',
                )
                for one in logs
            ],
        ),
        steps=table(
            ('', 'us per ms', 'slowest ms, us'),
            [(words, f'{mean:.3g}', f'{most:.3g}') for words, mean, most in _steps(accuracy)],
        ),
        linkages=several(linkages),
        limits=table(
            ('', 'measured', 'limit', 'met'),
            [
                (words, f'{value:.3g}', f'{most:.3g}', 'yes' if value <= most else '**no**')
                for words, value, most in (*_limits(ticks, logs), *_limits_of_several(linkages))
            ],
        ),
    )


def write(folder: Path) -> str:
    """Writes the page and its figure; returns the page.

    Args:
        folder: Folder with the figures of realtime.py; the other figures are read from docs.
    """
    files = {name: folder / f'{name}.json' for name in SOURCES}
    *found, peers, linkages = (
        json.loads((file if file.exists() else DOCS / file.name).read_text())
        for file in files.values()
    )
    text = page(*found, linkages)
    (folder / 'timing.md').write_text(text)
    draw(*found, peers, folder / 'timing.png')
    return text


if __name__ == '__main__':
    argparse.ArgumentParser(description=__doc__.splitlines()[0]).parse_args()
    write(DOCS)
