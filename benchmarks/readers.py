# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Logs as Foxglove reads them: its npm packages decode every message, every bit is compared.

The logs and the expected values, by the solver, are those of test/test_foreign_readers.py. The
packages also check the file itself: chunk and summary checksums, the index, statistics, metadata.
Needs Node.js and npm, which fetches them. Run: python benchmarks/readers.py
"""

import argparse
import json
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from linkage_ros.log.reader import LogReader
from linkage_ros.parameters.presets import preset_names

HERE = Path(__file__).resolve().parent

# The test suite's expectations, which no reader shares.
sys.path.append(str(HERE.parent / 'test'))


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


def check(folder, log):
    """Compares one log and prints a line per topic; returns how many things are wrong."""
    path, expected, name = log.path, log.messages, log.path.parent.name
    with LogReader(path) as reader:
        motions = len(reader.motions)
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
        print(f'{name:14} {topic:20} {len(got):6} messages  {words}')
        faults += [topic] * bool(wrong)
    fate = 'well formed' if not about['faults'] else '; '.join(about['faults'])
    print(f'{name:14} checksums, index, statistics and metadata: {fate} ({seconds:.1f} s)')
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
        from test_foreign_readers import live, recorded

        faults, begun = 0, time.perf_counter()
        for name in (*preset_names(), 'live'):
            (folder / name).mkdir()
            log = live(folder / name) if name == 'live' else recorded(name, folder / name)
            faults += check(folder, log)
    seconds = time.perf_counter() - begun
    print(f'{faults} FAULTS' if faults else f'all equal, in {seconds:.1f} s')
    return 1 if faults else 0


if __name__ == '__main__':
    sys.exit(main())
