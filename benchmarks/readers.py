# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Logs as Foxglove reads them: its npm packages decode every message, every bit is compared.

The expected values come from the solver, as in test/test_foreign_readers.py; diagnostics are
written by hand. The packages also check the file itself: chunk and summary checksums, the index,
statistics, metadata. Needs Node.js and npm, which fetches them. Run: python benchmarks/readers.py
"""

import argparse
import json
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from linkage_ros.log.writer import LogWriter
from linkage_ros.motion.speed_driven import SpeedMotion
from linkage_ros.parameters.configuration import configure, load
from linkage_ros.parameters.presets import preset_names
from linkage_ros.record import record
from linkage_ros.run.machine import Machine
from linkage_ros.wire.diagnostics import OK, WARN, Status, encode_diagnostics
from linkage_ros.wire.topics import DIAGNOSTICS, ROBOT_DESCRIPTION

HERE = Path(__file__).resolve().parent
DURATION = 10.0  # s
START = 1_795_000_000_123_456_789

# The test suite's expectations, which no reader shares.
sys.path.append(str(HERE.parent / 'test'))


def record_preset(preset, path):
    """A record, and what its messages should say."""
    from solved_messages import solved_messages

    configuration = load(preset)
    count = record(configuration, path, duration=DURATION)
    rate = round(configuration.session.rate_hz)
    stamps = [tick * 10**9 // rate for tick in range(count)]
    motion = SpeedMotion.begin(configuration.drive, 0)
    return solved_messages(configuration, motion, stamps), 1


def write_as_the_node(path):
    """A log with the time of day, many chunks, changes of motion and diagnostics."""
    from solved_messages import plain, solved_messages, time_of

    changes = {'start_rpm': -30.0, 'crank_acceleration': 7.1}
    configuration = configure({**load('quadrilateral').parameters(), **changes})
    machine = Machine(configuration)
    motions, stamps, expected = [machine.begin(START)], [], {}
    diagnostics = []
    with LogWriter(path, configuration, overwrite=False) as log:
        *channels, description, health = (
            log.add_topic(topic, f'/{topic.name.lstrip("/")}')
            for topic in (*machine.topics, ROBOT_DESCRIPTION, DIAGNOSTICS)
        )
        log.write_motion(motions[0].segment)
        log.write(description, START, machine.description)
        for tick in range(2000):
            stamp = START + machine.elapsed(tick)
            if tick and tick % 400 == 0:
                motions.append(motions[-1].change(stamp, 60.0 - tick / 7))
                log.write_motion(motions[-1].segment)
            if tick % 40 == 39:
                log.flush()
            if tick % 200 == 199:
                statuses = [
                    Status(WARN, 'node: motion', 'ä, 3 ticks missed', {'states': str(tick)}),
                    Status(OK, 'node: log', '', {}),
                ]
                log.write(health, stamp, encode_diagnostics(stamp, 'four_bar', statuses))
                told = [
                    {
                        'level': status.level,
                        'name': status.name,
                        'message': status.message,
                        'hardware_id': 'four_bar',
                        'values': [{'key': k, 'value': v} for k, v in status.values.items()],
                    }
                    for status in statuses
                ]
                header = {'stamp': time_of(stamp), 'frame_id': ''}
                diagnostics.append((stamp, plain({'header': header, 'status': told})))
            snapshot = machine.snapshot_at(motions[-1], stamp)
            for channel, message in zip(channels, snapshot.messages, strict=True):
                log.write(channel, stamp, message)
            stamps.append(stamp)
    for number, motion in enumerate(motions):
        part = solved_messages(configuration, motion, stamps[400 * number : 400 * (number + 1)])
        for topic, rows in part.items():
            if topic != '/robot_description' or number == 0:
                expected.setdefault(topic, []).extend(rows)
    return {**expected, '/diagnostics': diagnostics}, len(motions)


def read(folder, path):
    """What the packages say about a log: its faults, and its messages by topic."""
    done = subprocess.run(
        ['node', 'read.mjs', path.resolve()],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        return {'faults': [done.stderr.strip()], 'metadata': []}, {}
    about, *lines = done.stdout.splitlines()
    found = {}
    for line in lines:
        row = json.loads(line)
        stamp, published = map(int, row['times'])
        assert stamp == published
        found.setdefault(row['topic'], []).append((stamp, row['message']))
    return json.loads(about), found


def check(folder, path, expected, motions):
    """Compares one log and prints a line per topic; tells how many things are wrong."""
    begun = time.perf_counter()
    about, found = read(folder, path)
    seconds = time.perf_counter() - begun
    faults = list(about['faults'])
    if about['metadata'] != ['linkage_ros'] + ['linkage_ros/motion'] * motions:
        faults.append(f'its metadata records are {about["metadata"]}')
    for topic in sorted(expected | found):
        got, wanted = found.get(topic, []), expected.get(topic, [])
        wrong = sum(a != b for a, b in zip(got, wanted, strict=False))
        wrong += abs(len(got) - len(wanted))
        words = 'every bit equal' if not wrong else f'{wrong} DIFFER'
        print(f'{path.stem:14} {topic:20} {len(got):6} messages  {words}')
        faults += [topic] * bool(wrong)
    fate = 'well formed' if not about['faults'] else '; '.join(about['faults'])
    print(f'{path.stem:14} checksums, index, statistics and metadata: {fate} ({seconds:.1f} s)')
    return len(faults)


def main():
    """Makes the logs, has them read, and ends with 1 where anything differs."""
    argparse.ArgumentParser(description=__doc__.splitlines()[0]).parse_args()
    if missing := [name for name in ('node', 'npm') if shutil.which(name) is None]:
        print(f'not run: {" and ".join(missing)} not found; this needs Node.js 20 with npm')
        return 2
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for file in (HERE / 'readers').iterdir():
            shutil.copy(file, folder)
        installed = subprocess.run(
            ['npm', 'install', '--silent', '--ignore-scripts', '--no-package-lock', '--no-audit'],
            cwd=folder, capture_output=True, text=True, check=False,
        )  # fmt: skip
        if installed.returncode:
            print(f'not run: npm could not install the packages: {installed.stderr.strip()[:200]}')
            return 2
        faults, begun = 0, time.perf_counter()
        # What an oracle solves anew: the motions at a given speed.
        for preset in (n for n in preset_names() if load(n).kind.drive == 'speed'):
            path = folder / f'{preset}.mcap'
            faults += check(folder, path, *record_preset(preset, path))
        path = folder / 'as_the_node.mcap'
        faults += check(folder, path, *write_as_the_node(path))
    seconds = time.perf_counter() - begun
    print(f'{faults} FAULTS' if faults else f'all equal, in {seconds:.1f} s')
    return 1 if faults else 0


if __name__ == '__main__':
    sys.exit(main())
