# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_log: looks into a log."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from datetime import datetime, timezone

from linkage_ros import cli
from linkage_ros.log_reader import LogReader
from linkage_ros.machine import Machine

_NAME = 'linkage_log'
_NS = 10**9
# Stamps below are times since the start of a record, not dates (s).
_EPOCH_OF_DATES = 10**9


def info(log: LogReader) -> Iterator[str]:
    """What a log holds.

    Args:
        log: The log.

    Yields:
        Lines of text.
    """
    machine = Machine(log.configuration)
    duration = (log.end - log.start) / _NS
    yield f'file:       {log.path}, {log.path.stat().st_size / 1e6:.3f} MB'
    yield f'written by: linkage_ros {log.version}'
    yield f'start:      {_moment(log.start)}'
    yield f'duration:   {duration:.6f} s'
    yield f'mechanism:  {machine.summary()}'
    yield from (f'            {words}' for words in machine.solver.mobility.equalities)
    yield 'topics:'
    width = max((len(topic.name) for topic in log.topics), default=0)
    for topic in log.topics:
        yield f'  {topic.name:{width}}  {topic.messages:9d}  {topic.type}'
    yield 'motion:'
    for motion in log.motions:
        crank = motion.at(motion.stamp)
        at_once = f' at {motion.acceleration:g} rad/s^2' if motion.acceleration else ''
        yield (
            f'  {_moment(motion.stamp)}: from {crank.unwrapped:.6f} rad, {crank.speed:.6f} rad/s '
            f'to {motion.rpm:g} rpm{at_once}'
        )
    yield 'configuration:'
    for name, value in log.configuration.parameters().items():
        yield f'  {name}: {_plain(value)}'


def _plain(value: object) -> str:
    if isinstance(value, tuple):
        return f'[{", ".join(map(repr, value))}]'
    return repr(value) if isinstance(value, str) and not value else str(value)


def _moment(stamp: int) -> str:
    if stamp < _EPOCH_OF_DATES * _NS:
        return f'{stamp / _NS:.6f} s'
    seconds, rest = divmod(stamp, _NS)
    date = datetime.fromtimestamp(seconds, timezone.utc)
    return f'{date:%Y-%m-%d %H:%M:%S}.{rest // 1000:06d} UTC'


def _parser() -> argparse.ArgumentParser:
    parser = cli.make_parser(_NAME, 'Look into a log of linkage_ros.', ('info run.mcap',))
    commands = parser.add_subparsers(dest='command', required=True, metavar='COMMAND')
    show = commands.add_parser('info', help='topics, counts, times, configuration, mechanism')
    show.add_argument('log', metavar='LOG.mcap')
    return parser


def _run() -> None:
    options = _parser().parse_args()
    with LogReader(options.log) as log:
        for line in info(log):
            print(line)


def main() -> int:
    """Entry point."""
    return cli.run(_NAME, _run)


if __name__ == '__main__':
    sys.exit(main())
