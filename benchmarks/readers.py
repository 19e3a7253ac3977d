# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Decodes logs with Foxglove's npm packages and compares every bit of every message.

The logs, and the expected values from the solver, come from test/test_foreign_readers.py. The
packages also check the file: checksums of chunks and summary, index, statistics and metadata.
Requires Node.js, and npm, which downloads the packages. Run: python benchmarks/readers.py
"""

import argparse
import itertools
import json
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from linkage_ros.log.reader import LogReader
from linkage_ros.settings.presets import preset_names

HERE = Path(__file__).resolve().parent

# The expected values are in a module of the test suite.
sys.path.append(str(HERE.parent / 'test'))


def read(folder, path):
    """Reads a log with the packages; returns errors, metadata, and the messages by topic."""
    command = ['node', 'read.mjs', path.resolve()]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode:
        return {'faults': [done.stderr.strip()], 'metadata': []}, {}
    about, *lines = done.stdout.splitlines()
    found = {}
    for row in map(json.loads, lines):
        stamp, published = map(int, row['times'])
        assert stamp == published
        found.setdefault(row['topic'], []).append((stamp, row['message']))
    return json.loads(about), found


def check(folder, log):
    """Compares the messages of a log with the expected ones; returns the number of errors."""
    name = log.path.parent.name
    reader = LogReader(log.path)
    motions = len(reader.motions)
    about, found = read(folder, log.path)
    faults = list(about['faults'])
    expected = ['linkage_ros', *['linkage_ros/motion'] * motions, 'linkage_ros/end']
    if about['metadata'] != expected:
        faults.append(f'its metadata records are {about["metadata"]}')
    print(
        f'{name:14} checksums, index, statistics, metadata: {"; ".join(faults) or "well formed"}'
    )
    for topic in sorted(log.messages | found):
        got, wanted = found.get(topic, []), log.messages.get(topic, [])
        wrong = sum(a != b for a, b in itertools.zip_longest(got, wanted))
        words = f'{wrong} DIFFER' if wrong else 'every bit equal'
        print(f'{name:14} {topic:20} {len(got):6} messages  {words}')
        faults += [topic] * bool(wrong)
    return len(faults)


def main():
    """Writes and checks the logs; returns exit code 1 if there is any difference."""
    argparse.ArgumentParser(description=__doc__.splitlines()[0]).parse_args()
    install = ['npm', 'install', '--silent', '--ignore-scripts', '--no-package-lock', '--no-audit']
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for file in (HERE / 'readers').iterdir():
            shutil.copy(file, folder)
        try:
            subprocess.run(install, cwd=folder, check=True)
        except (OSError, subprocess.CalledProcessError) as error:
            print(f'not run: this needs Node.js 20 with npm, and the packages: {error}')
            return 2
        from test_foreign_readers import recorded, written_live

        faults = 0
        for name in (*preset_names(), 'live'):
            (folder / name).mkdir()
            log = written_live(folder / name) if name == 'live' else recorded(name, folder / name)
            faults += check(folder, log)
    print(f'{faults} FAULTS' if faults else 'all equal')
    return 1 if faults else 0


if __name__ == '__main__':
    sys.exit(main())
