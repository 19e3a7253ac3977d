# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Viewers without a screen: Rerun's own program, which saves to a file what it is sent."""

from __future__ import annotations

import os
import subprocess
import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from harness import Process, node, wait_for
from rerun.chunk import RrdReader

from linkage_ros.view.rerun_program import find_viewer
from linkage_ros.view.targets import free_address

PROGRAM = find_viewer()


class Viewer:
    """A viewer without a screen at a URL, which may be started again and again.

    Attributes:
        url: Where it takes data.
    """

    def __init__(self, folder: Path) -> None:
        _, self._port, _ = free_address('127.0.0.1')
        self.url = f'rerun+http://127.0.0.1:{self._port}/proxy'
        self._folder, self._processes = folder, []

    def start(self) -> None:
        """Starts it, with a file of its own."""
        saved = self._folder / f'{len(self._processes)}.rrd'
        command = [PROGRAM, '--save', saved, '--bind', '127.0.0.1', '--port', str(self._port)]
        self._processes.append(subprocess.Popen(command, stderr=subprocess.DEVNULL))

    def open(self, url: str) -> None:
        """Opens another window on what a node serves."""
        saved = self._folder / f'{len(self._processes)}.rrd'
        command = [PROGRAM, url, '--save', saved, '--bind', '127.0.0.1', '--port', 'auto']
        self._processes.append(subprocess.Popen(command, stderr=subprocess.DEVNULL))

    def send(self, number: int) -> None:
        """Sends it a signal."""
        self._processes[-1].send_signal(number)

    def close(self) -> None:
        """Ends it."""
        for process in self._processes:
            process.kill()
            process.wait()


def shown(folder: Path) -> int:
    """How many states have reached the viewers that save to a folder."""
    stamps: set[int] = set()
    for path in folder.glob('*.rrd'):
        with warnings.catch_warnings():
            warnings.simplefilter('ignore')
            chunks = RrdReader(path).stream()
            for chunk in (c for c in chunks if str(c.entity_path) == '/joint_states/effort'):
                batch = chunk.to_record_batch()
                if 'ros2_timestamp' in batch.schema.names:
                    stamps.update(batch.column('ros2_timestamp').cast('int64').to_pylist())
    return len(stamps)


def children(process: Process) -> list[int]:
    """The processes that one has started."""
    tasks = Path(f'/proc/{process.pid}/task').iterdir()
    return [int(word) for task in tasks for word in (task / 'children').read_text().split()]


@contextmanager
def windows(folder: Path) -> Iterator[None]:
    """Lets a program without a screen be started in place of a window."""
    script = folder / 'window'
    options = '--bind 127.0.0.1 --port auto'
    script.write_text(f'#!/bin/sh\nexec {PROGRAM} "$1" --save {folder}/$$.rrd {options}\n')
    script.chmod(0o755)
    os.environ |= {'RERUN_CLI_PATH': str(script), 'DISPLAY': ':99'}
    try:
        yield
    finally:
        del os.environ['RERUN_CLI_PATH'], os.environ['DISPLAY']


def served(process: Process) -> list[str]:
    """The addresses at which a node and what it started take TCP connections, as ss has them."""
    said = subprocess.run(['ss', '-ltnpH'], capture_output=True, text=True, check=True).stdout
    ours = [f'pid={pid},' for pid in (process.pid, *children(process))]
    lines = [line for line in said.splitlines() if any(pid in line for pid in ours)]
    return sorted(line.split()[3].rpartition(':')[0] for line in lines)


def addresses(domain: int, target: str, folder: Path, **parameters: object) -> dict[str, Any]:
    """Where a node serves its view, and whether it warns."""
    with windows(folder), node(domain, viewer=target, **parameters) as process:
        wait_for(lambda: 'rpm at' in process.output and len(served(process)) >= 2)
        time.sleep(1.0)
        found = served(process)
        process.end()
    return {'served': found, 'warned': 'to whoever reaches it' in process.output}
