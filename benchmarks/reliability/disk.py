# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Cost of trouble with the log: full disk, file or folder removed, file replaced.

linkage_node runs at 1 kHz and logs to a disk of a few MB that exists for this benchmark alone:
a tmpfs in a mount namespace, made as root or, with `unshare -U`, as anybody. A subscriber in
another process counts the states. Promised are: states go on, one line of error, diagnostics in
ERROR, and what was written stays readable. Exit code 1 if that is broken, 77 if no disk can be
made here.

    python benchmarks/reliability/disk.py --out DIR              in a minute
    python benchmarks/reliability/disk.py --out DIR --after 0.5  in half of one
"""

import os
import shutil
import subprocess
import sys
import tempfile
import time
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from harness import (
    DOMAIN,
    NOT_HERE,
    Diagnostics,
    Process,
    finish,
    listening,
    node,
    options,
    tool,
    wait_for,
)

from linkage_ros.log.reader import LogReader
from linkage_ros.wire.cdr import ERROR

RATE = 1000.0
SIZE = '3m'
SILENCE = 0.1  # s between two states that a subscriber notices
INSIDE = 'LINKAGE_DISK_BENCHMARK'
LOG = 'linkage_node: log'  # its part of /diagnostics


def enter_namespace() -> None:
    """Begins anew in a mount namespace, which takes its disks along when it ends."""
    if INSIDE in os.environ:
        return
    words = ['unshare', '-m'] if os.geteuid() == 0 else ['unshare', '-Urm']
    tried = subprocess.run([*words, 'true'], capture_output=True, text=True, check=False)
    if tried.returncode:
        print(f'no disk can be made here: {tried.stderr.strip()}', file=sys.stderr)
        sys.exit(NOT_HERE)
    os.environ[INSIDE] = '1'
    os.execvp(words[0], [*words, sys.executable, *sys.argv])


@contextmanager
def disk(path: Path):
    """A small disk, and a folder on it."""
    path.mkdir()
    subprocess.run(['mount', '-t', 'tmpfs', '-o', f'size={SIZE}', 'disk', path], check=True)
    try:
        (path / 'logs').mkdir()
        yield path / 'logs'
    finally:
        subprocess.run(['umount', '--lazy', path], check=True)
        path.rmdir()


def replace(path: Path) -> None:
    """Puts another file in the log's place."""
    path.unlink()
    path.write_text('of somebody else')


CASES = {
    'full disk': lambda path: wait_for(lambda: shutil.disk_usage(path.parent).free == 0, 60.0),
    'file removed': Path.unlink,
    'folder removed': lambda path: shutil.rmtree(path.parent),
    'file replaced': replace,
}


def errors(process: Process) -> list[str]:
    """Its lines of error."""
    return [text for _, text in process.lines if text.startswith('[ERROR]') or 'Trace' in text]


def run(path: Path, spoil, heard: Path, after: float) -> dict:
    """A run whose log is spoilt."""
    with (
        listening(DOMAIN, heard) as listener,
        Diagnostics(DOMAIN) as diagnostics,
        node(DOMAIN, rate_hz=RATE, log=path) as process,
    ):
        wait_for(lambda: 'heard' in listener.output and LOG in diagnostics.parts)
        time.sleep(after)
        spoil(path)
        begin = time.time_ns()
        said = wait_for(lambda: diagnostics.parts[LOG][0] == ERROR)
        time.sleep(after)
        # A log that cannot be put back is named by a place that ends with the process.
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
        **saved_of(saved, begin),
    }


def saved_of(path: Path, begin: int) -> dict:
    """What can still be read, and how long before the fault it ends, s."""
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / 'saved.mcap'
        recovered, verified = tool('recover', path, target), tool('verify', target)
        if recovered.returncode or verified.returncode:
            return {'readable': False, 'said': recovered.stderr + verified.stdout}
        with LogReader(target) as log:
            return {
                'readable': True,
                'said': recovered.stdout.strip(),
                'logged_until': (log.end - begin) * 1e-9,
            }


def promises(name: str, one: dict) -> dict[str, bool]:
    """Whether each promise was kept."""
    kept = {
        'one line of error': len(one['errors']) == 1,
        'states go on': one['longest_silence'] < SILENCE,
        'exit code 1': one['exit_code'] == 1,
        'what was written stays readable': one['readable'],
    }
    if name != 'full disk':
        kept['nothing logged is lost'] = one['readable'] and one['logged_until'] > -0.3
    return {f'{name}: {words}': is_kept for words, is_kept in kept.items()}


def main() -> int:
    given = options(__doc__, after=(2.0, 's before each trouble'))
    enter_namespace()
    figures = {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for case, spoil in CASES.items():
            with disk(folder / 'disk') as logs:
                heard = folder / 'heard.npy'
                figures[case] = run(logs / 'run.mcap', spoil, heard, given.after)
    kept = {}
    for name, one in figures.items():
        print(f'{name}: ' + '; '.join(f'{key} {value}' for key, value in one.items()))
        kept |= promises(name, one)
    return finish('disk', given.out, figures, kept)


if __name__ == '__main__':
    sys.exit(main())
