# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Tests faults of the log: full disk, file or folder removed, file replaced.

linkage_node runs at 1 kHz and logs to a tmpfs of a few MB. A subscriber in another process counts
the states. The promises are that the states continue, that one error line and diagnostics at level
ERROR report the fault, and that the data written before it stays readable. The exit code is 1 if a
promise is broken, and 77 if the tmpfs cannot be mounted, which takes root or `unshare -Urm`.

    python benchmarks/reliability/disk.py --out DIR              one minute
    python benchmarks/reliability/disk.py --out DIR --after 0.5  half a minute
"""

import shutil
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from harness import (
    DOMAIN,
    Diagnostics,
    Process,
    finish,
    listening,
    mounted,
    node,
    options,
    wait_for,
)
from killed import recovered

from linkage_ros.messages.cdr import ERROR

RATE = 1000.0
SIZE = '3m'
SILENCE = 0.1  # s, longest allowed pause between two states
LOG = 'linkage_node: log'  # name of the log's status in /diagnostics


def replace(path: Path) -> None:
    """Replaces the log by a file with other contents."""
    path.unlink()
    path.write_text('another file')


CASES = {
    'full disk': lambda path: wait_for(lambda: shutil.disk_usage(path.parent).free == 0, 60.0),
    'file removed': Path.unlink,
    'folder removed': lambda path: shutil.rmtree(path.parent),
    'file replaced': replace,
}


def errors(process: Process) -> list[str]:
    """Returns the error lines of a process."""
    return [text for _, text in process.lines if text.startswith('[ERROR]') or 'Trace' in text]


def run(path: Path, damage, heard: Path, after: float) -> dict:
    """Runs the node, damages its log, and recovers it."""
    with (
        listening(DOMAIN, heard) as listener,
        Diagnostics(DOMAIN) as diagnostics,
        node(DOMAIN, rate_hz=RATE, log=path) as process,
    ):
        wait_for(lambda: 'heard' in listener.output and LOG in diagnostics.parts)
        time.sleep(after)
        damage(path)
        begin = time.time_ns()
        said = wait_for(lambda: diagnostics.parts[LOG][0] == ERROR)
        time.sleep(after)
        # The error names the descriptor of a removed log, which exists until the process ends.
        unnamed = [word for word in process.output.split() if word.startswith('/proc/')]
        if unnamed:
            shutil.copyfile(unnamed[0], heard.with_suffix('.mcap'))
        end = time.time_ns()
        code = process.end()
    states, saved = np.load(heard), heard.with_suffix('.mcap') if unnamed else path
    during = states[(states[:, 0] > begin) & (states[:, 0] < end), 0]
    return {
        'exit_code': code,
        'errors': errors(process),
        'diagnosis': diagnostics.parts[LOG][1],
        'in_error_after': said,
        'states_after': len(during),
        'longest_silence': float(np.diff(during).max()) * 1e-9,
        'missed': 1 - len(during) / ((end - begin) * 1e-9 * RATE),
        **recovered(saved, heard.with_name('saved.mcap'), begin),
    }


def promises(name: str, one: dict) -> dict[str, bool]:
    """Returns whether each promise was kept."""
    kept = {
        'one line of error': len(one['errors']) == 1,
        'states continue': one['longest_silence'] < SILENCE,
        'exit code 1': one['exit_code'] == 1,
        'what was written stays readable': one['verified'],
    }
    if name != 'full disk':
        kept['nothing logged is lost'] = one['verified'] and one['lost'] < 0.3
    return {f'{name}: {words}': is_kept for words, is_kept in kept.items()}


def main() -> int:
    given = options(__doc__, after=(2.0, 's before each fault'))
    figures = {}
    for case, damage in CASES.items():
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            logs = folder / 'disk' / 'logs'
            with mounted(folder / 'disk', '-t', 'tmpfs', '-o', f'size={SIZE}', 'disk'):
                logs.mkdir()
                figures[case] = run(logs / 'run.mcap', damage, folder / 'heard.npy', given.after)
    kept = {}
    for name, one in figures.items():
        print(f'{name}: ' + '; '.join(f'{key} {value}' for key, value in one.items()))
        kept |= promises(name, one)
    return finish('disk', given.out, figures, kept)


if __name__ == '__main__':
    sys.exit(main())
