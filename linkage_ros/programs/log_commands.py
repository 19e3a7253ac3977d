# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The commands of linkage_log, and what they print."""

import argparse
import math
from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import suppress
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

from linkage_ros import __version__, cli
from linkage_ros.errors import LogError, printable
from linkage_ros.files import STANDARD_OUTPUT
from linkage_ros.log.reader import LogReader
from linkage_ros.log.recover import Recovered, recover
from linkage_ros.log.tables import write_csv
from linkage_ros.log.verify import Verification, verify
from linkage_ros.mechanism.solver import Solver
from linkage_ros.messages.topics import prefix_of
from linkage_ros.quantities import counted
from linkage_ros.settings.notes import notes
from linkage_ros.settings.summary import summary
from linkage_ros.units import NS_PER_S

# Stamps below this, s, are times since the start of a record, not dates.
_FIRST_DATE = 10**9
_MAX_WIDTH = 60  # width of the topic column, characters


def info(log: LogReader) -> Iterator[str]:
    """Describes a log in lines: file, times, mechanism, topics, motion and configuration."""
    yield f'file:       {log.path}, {log.path.stat().st_size / 1e6:.3f} MB'
    yield f'written by: linkage_ros {log.version}'
    yield f'start:      {_time(log.start)}'
    yield f'duration:   {(log.end - log.start) / NS_PER_S:.6f} s'
    for linkage in log.configuration.linkages:
        solver = Solver(linkage.mechanism)
        yield f'mechanism:  {prefix_of(linkage.name, ": ")}{summary(linkage, solver)}'
        if solver.mobility:
            yield from (f'            {words}' for words in solver.mobility.equalities)
    yield from (f'note:       {line}' for line in notes(log.configuration))
    yield 'topics:'
    yield from _topic_lines(log)
    yield 'motion:'
    yield from (f'  {_time(stamp)}: {words}' for stamp, words in _motions(log))
    if causes := _causes_of_zeros(log):
        counts = ', '.join(f'{printable(cause)} ({count} x)' for cause, count in causes.items())
        yield f'torque ended with 0: {counts}'
    yield 'configuration:'
    units = {name: x.quantity.unit for name, x in log.configuration.leaves().items()}
    for name, value in log.configuration.parameters().items():
        text = str(list(value) if isinstance(value, tuple) else value) or "''"
        yield f'  {name}: {text}' + (f'  # {units[name]}' if units[name] else '')


def _topic_lines(log: LogReader) -> Iterator[str]:
    """Describes the topics of a log, with roles that are not their names."""
    width = min(max((len(topic.name) for topic in log.topics), default=0), _MAX_WIDTH)
    for topic in log.topics:
        is_renamed = topic.role and not topic.name.endswith(f'/{topic.role}')
        role = f', {topic.role}' if is_renamed else ''
        yield f'  {topic.name:{width}}  {topic.messages:9d}  {topic.type}{role}'


def info_as_json(log: LogReader) -> dict[str, Any]:
    """Returns the description of a log as plain values, with times in s."""
    summaries = (
        f'{prefix_of(linkage.name, ": ")}{summary(linkage, Solver(linkage.mechanism))}'
        for linkage in log.configuration.linkages
    )
    return {
        'file': str(log.path),
        'bytes': log.path.stat().st_size,
        'version': log.version,
        'start': log.start / NS_PER_S,
        'duration': (log.end - log.start) / NS_PER_S,
        'mechanism': '; '.join(summaries),
        'notes': notes(log.configuration),
        'topics': [
            {'name': x.name, 'type': x.type, 'messages': x.messages, 'role': x.role}
            for x in log.topics
        ],
        'motion': [{'start': stamp / NS_PER_S, 'words': words} for stamp, words in _motions(log)],
        'torque_ends': _causes_of_zeros(log),
        'configuration': log.configuration.parameters(),
    }


def _motions(log: LogReader) -> Iterator[tuple[int, str]]:
    """Yields the stamp, ns, and the description of each segment of motion and of early ends."""
    for linkage in log.configuration.linkages:
        joint = linkage.mechanism.structure().driven_link.units
        for segment in log.motions[linkage.name]:
            under = f', gravity {list(segment.gravity)} m/s^2' if segment.gravity else ''
            words = f'{segment.words(joint)}{under}'
            yield segment.stamp, f'{prefix_of(linkage.name, ": ")}{words}'
        if end := log.linkage_ends.get(linkage.name):
            yield end.stamp, f'{linkage.name} ends: {printable(end.cause)}'


def _causes_of_zeros(log: LogReader) -> Counter[str]:
    """Returns how often torques ended, by the linkage, if it was one of several, and the cause."""
    return Counter(f'{prefix_of(end.linkage, ": ")}{end.cause}' for end in log.torque_ends)


def _time(stamp: int) -> str:
    if stamp < _FIRST_DATE * NS_PER_S:
        return f'{stamp / NS_PER_S:.6f} s'
    date = datetime.fromtimestamp(stamp // NS_PER_S, timezone.utc)
    return f'{date:%Y-%m-%d %H:%M:%S}.{stamp % NS_PER_S // 1000:06d} UTC'


def verdict(log: LogReader, report: Verification) -> Iterator[str]:
    """Describes the outcome of a verification of a log in lines."""
    if report.difference:
        yield f'{log.path}: DIFFERS: {report.difference}'
        equal = counted(report.states, 'state')
        yield f'  equal before it: {equal}; later messages were not compared'
    else:
        equal = f'within {math.ceil(report.ulp)} ulp' if report.ulp else 'to the bit'
        yield f'{log.path}: {counted(report.states, "state")}, every one equal {equal}'
        yield f'  compared: {", ".join(report.compared) or "nothing"}'
    notes = (
        (report.others, f'not recomputable, so not compared: {", ".join(report.others)}'),
        (log.dropped,
         f'states and other messages dropped, because the disk was too slow: {log.dropped}'),
        (report.stops_at_gap,
         'states after this were not compared: they depend on measurements that the log lost'),
        (report.absent, f'not in the log: {", ".join(report.absent)}'),
        (report.missed,
         f'{counted(report.missed, "tick")} without a state: the run was late or lost states'),
        (log.lost is None,
         'no end record, as after the recovery of an incomplete log: states may be missing'),
        (report.cut, f'the last state is cut off, before {", ".join(report.cut)}'),
        (log.version != __version__,
         f'written by linkage_ros {log.version}, recomputed by {__version__}'),
    )  # fmt: skip
    yield from (f'  {words}' for holds, words in notes if holds)


def saved(path: Path, done: Recovered) -> str:
    """Describes the outcome of a recovery in one line."""
    lost = []
    if done.places:
        places = counted(done.places, 'damaged place')
        lost.append(f'{counted(done.damaged, "byte")} in {places}')
    if done.unknown:
        lost.append(f'{counted(done.unknown, "message")} of unknown topics')
    return (
        f'{path}: {counted(done.messages, "message")} saved, {done.duration:.3f} s; '
        f'lost: {", ".join(lost) or "nothing that was on the disk"}'
    )


def _info(options: argparse.Namespace) -> None:
    log = LogReader(options.log)
    if options.json:
        cli.print_json(info_as_json(log))
    else:
        _print(info(log))


def _verify(options: argparse.Namespace) -> int:
    log = LogReader(options.log)
    most = max((topic.messages for topic in log.topics), default=0)
    with cli.progress_bar(total=most, unit=' states', unit_scale=True, delay=2) as bar:
        report = verify(log, bar.update)
    if not report.states and not report.difference:
        raise LogError(f'{options.log} has no states: there is nothing to verify')
    _print(verdict(log, report))
    return 1 if report.difference else 0


def _recover(options: argparse.Namespace) -> int:
    with cli.progress_bar(unit='B', unit_scale=True, delay=2) as bar:
        done = recover(options.log, options.out, overwrite=options.overwrite, progress=bar.update)
    _print([saved(options.out, done)])
    return 1 if done.places and not done.messages else 0


def _csv(options: argparse.Namespace) -> None:
    with cli.progress_bar(unit='B', unit_scale=True, delay=2) as bar:
        topic, rows, invalid = write_csv(
            options.log, options.out, topic=options.topic, overwrite=options.overwrite,
            progress=bar.update,
        )  # fmt: skip
    left_out = f'; left out: {counted(invalid, "damaged message")}' if invalid else ''
    words = f'{options.out}: {counted(rows, "row")} from {topic}{left_out}'
    if str(options.out) != STANDARD_OUTPUT:
        _print([words])
    elif invalid:
        cli.print_notes([words])


def _print(lines: Iterable[str]) -> None:
    with suppress(BrokenPipeError):  # without a reader, the exit code still shows the outcome
        print('\n'.join(map(printable, lines)))


COMMANDS = {'info': _info, 'verify': _verify, 'recover': _recover, 'csv': _csv}
