# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a viewer's trouble costs: it is absent, killed, or stopped by SIGSTOP, at 1 kHz.

Rerun's own program takes the place of a viewer, with --save in place of a screen, so that what
reached it can be counted. For each fault: the ticks the node missed and those that a node without
a viewer missed beside it, its greatest memory, what it said it left out, and whether the viewer
got all the rest. Then `ss` is asked on which addresses data and page are served. Exit code 1 if
a promise is broken.

    python benchmarks/reliability/viewer.py --out DIR              a minute each, six in all
    python benchmarks/reliability/viewer.py --out DIR --seconds 6  in one and a half
"""

from __future__ import annotations

import os
import re
import signal
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from harness import DOMAIN, Diagnostics, Process, finish, node, options, wait_for
from headless_viewer import Viewer, addresses, children, shown, windows

from linkage_ros.wire.diagnostics import OK, WARN

RATE = 1000.0
SETTLED = 4.0  # s before and after a fault
MEMORY = 100.0  # MiB by which a node may grow in a fault, 64 of them what it serves

Act = Callable[[Process, Viewer], object]


def nothing(_: Process, __: Viewer) -> None:
    """Leaves all as it is."""


def to_window(number: int) -> Act:
    """Sends a signal to what a node has started."""
    return lambda process, _: [os.kill(pid, number) for pid in children(process)]


def reopen(process: Process, viewer: Viewer) -> None:
    """Lets a window go on, and follows the advice that a node gives for one that is cut off."""
    to_window(signal.SIGCONT)(process, viewer)
    if advice := re.search(r'`rerun (\S+)` opens another', process.output):
        viewer.open(advice[1])


def to_viewer(number: int) -> Act:
    """Sends a signal to the viewer at a URL."""
    return lambda _, viewer: viewer.send(number)


def start_viewer(_: Process, viewer: Viewer) -> None:
    """Starts a viewer at the URL."""
    viewer.start()


# What the parameter viewer is ('url': a viewer's), and the acts that begin and end the fault.
FAULTS: dict[str, tuple[str, Act, Act]] = {
    'absent': ('url', nothing, start_viewer),
    'killed': ('url', to_viewer(signal.SIGKILL), start_viewer),
    'stopped': ('url', to_viewer(signal.SIGSTOP), to_viewer(signal.SIGCONT)),
    'window stopped': ('spawn', to_window(signal.SIGSTOP), reopen),
}


def run(name: str, seconds: float, folder: Path, viewer: Viewer) -> dict[str, Any]:
    """A run with a fault for some seconds."""
    target, begin, end = FAULTS[name]
    target = viewer.url if target == 'url' else target
    with (
        Diagnostics(DOMAIN) as diagnostics,
        Diagnostics(DOMAIN + 1) as beside,
        node(DOMAIN, rate_hz=RATE, viewer=target) as process,
        node(DOMAIN + 1, rate_hz=RATE),
    ):
        wait_for(lambda: diagnostics.parts and beside.parts)
        time.sleep(SETTLED)
        begin(process, viewer)
        figures = watched(process, diagnostics, beside, seconds)
        end(process, viewer)
        time.sleep(SETTLED)
        figures['memory_after'] = process.memory()
        figures['after'] = diagnostics.parts['viewer'][:2]
        window = children(process)
        figures['exit_code'] = process.end()
        figures |= accounted(process, folder)
        for pid in window:
            os.kill(pid, signal.SIGKILL)
    return figures


def watched(
    process: Process, diagnostics: Diagnostics, beside: Diagnostics, seconds: float
) -> dict[str, Any]:
    """What a fault does to a node while it lasts."""

    def missed() -> np.ndarray:
        parts = diagnostics.parts, beside.parts
        return np.array([int(one['motion'][2]['ticks missed']) for one in parts])

    held, before = [process.memory()], missed()
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        time.sleep(0.1)
        held.append(process.memory())
    with_viewer, without = (missed() - before).tolist()
    return {
        'missed': with_viewer,
        'missed_beside': without,
        'memory_before': held[0],
        'memory_most': max(held),
        'during': diagnostics.parts['viewer'][:2],
    }


def accounted(process: Process, folder: Path) -> dict[str, Any]:
    """What became of all the states: shown, left out and said so, or neither."""
    said = re.search(r'(\d+) states published.*?(?:, (\d+) lost to the viewer)?$', process.output)
    assert said, process.output
    published, left_out = int(said[1]), int(said[2] or 0)
    begin = time.monotonic()
    while shown(folder) + left_out < published and time.monotonic() < begin + 5.0:
        time.sleep(0.2)  # what it was sent, a viewer may take a moment to save
    lines = [text for _, text in process.lines if text.startswith(('[WARN]', '[ERROR]'))]
    return {
        'published': published,
        'left_out': left_out,
        'shown': shown(folder),
        'lines': [text.partition(']: ')[2] for text in lines if 'viewer' in text],
    }


def broken(figures: dict[str, Any]) -> list[str]:
    """Which promises were not kept."""
    wrong = []
    for name in FAULTS:
        one = figures[name]
        promises = {
            'ticks missed are no more than twice and ten those of a node without it':
                one['missed'] <= 2 * one['missed_beside'] + 10,
            'memory is bounded': max(one['memory_most'], one['memory_after'])
                <= one['memory_before'] + MEMORY,
            'the run ends well': one['exit_code'] == 0,
            'what it missed is said': not one['left_out']
                or (one['during'][0] == WARN and bool(one['lines'])),
            'it catches up': one['after'][0] == OK,
        }  # fmt: skip
        # What a killed viewer was sent and had not saved yet, nobody can know of.
        if name != 'killed':
            all_of_them = one['shown'] + one['left_out'] == one['published']
            promises['what it was not shown is counted'] = all_of_them
        wrong += [f'{name}: {words}' for words, is_kept in promises.items() if not is_kept]
    for name, one in figures['addresses'].items():
        here = all(address == '127.0.0.1' for address in one['served'])
        if here == ('0.0.0.0' in name) or one['warned'] == here:
            wrong.append(f'{name}: {one}')
    return wrong


def main() -> int:
    given = options(__doc__, seconds=(60.0, 's of each trouble'))
    figures: dict[str, Any] = {}
    for name, (target, *_) in FAULTS.items():
        with tempfile.TemporaryDirectory() as folder, windows(Path(folder)):
            viewer = Viewer(Path(folder))
            if target == 'url' and name != 'absent':
                viewer.start()
            try:
                figures[name] = run(name, given.seconds, Path(folder), viewer)
            finally:
                viewer.close()
        words = (f'{key} {value}' for key, value in figures[name].items())
        print(f'{name}: ' + '; '.join(words), flush=True)
    figures['addresses'] = {}
    for target in ('spawn', 'web'):
        for bind in ({}, {'viewer_bind': '0.0.0.0'}):
            name = ' '.join([target, *bind.values()])
            with tempfile.TemporaryDirectory() as folder:
                figures['addresses'][name] = one = addresses(DOMAIN, target, Path(folder), **bind)
            print(f'{name}: served on {one["served"]}, warned: {one["warned"]}', flush=True)
    finish('viewer', given.out, figures)
    for words in (wrong := broken(figures)):
        print(f'NOT KEPT: {words}')
    return 1 if wrong else 0


if __name__ == '__main__':
    sys.exit(main())
