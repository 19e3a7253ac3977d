# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Seeded cases of one kind, each tried in a process that is watched; fuzz.py starts them."""

from __future__ import annotations

import multiprocessing
import os
import random
import resource
import sys
import tempfile
import time
import traceback
from pathlib import Path

# The test suite's cases and what may come of them.
sys.path.append(str(Path(__file__).resolve().parents[2] / 'test'))

LONGEST, MEMORY = 5.0, 1 << 30  # s and bytes of one case
BATCH = 500  # cases of one process
# What has to be found, so that finding nothing means something.
CONTROLS = {
    'hang': 'while True: pass', 'memory': 'bytearray(2**31)', 'error': '1 / 0',
    'death': 'os.abort()', 'two lines': 'hostile_outcomes.one_line("two\\nlines of words")',
}  # fmt: skip


def cases_of(kind, folder):
    """Makes a function that tries the case of a seed; it returns what was said."""
    import hostile
    import hostile_logs
    import hostile_outcomes
    import numpy as np

    if kind in CONTROLS:
        names = {'os': os, 'hostile_outcomes': hostile_outcomes}
        return lambda _: exec(CONTROLS[kind], names)
    np.seterr(all='raise')  # a warning would be a second line
    if kind == 'parameter file':
        path = folder / 'case.yaml'

        def draw(rng):
            path.write_bytes(hostile.parameter_file(rng))
            return hostile_outcomes.parameter_file(path)

    elif kind == 'log':
        path, logs = folder / 'case.mcap', hostile_logs.good_logs(folder)

        def draw(rng):
            path.write_bytes(hostile_logs.log_file(rng, logs))
            return hostile_outcomes.log_file(path)

    elif kind == 'replay options':
        path = folder / '0.mcap'
        hostile_logs.good_logs(folder)

        def draw(rng):
            return hostile_outcomes.replay_options(hostile.replay_options(rng), path)

    else:
        import rclpy

        from linkage_ros.parameters.configuration import load

        rclpy.init()
        nodes = [
            hostile_outcomes.LiveNode(load(name), None) for name in ('quadrilateral', 'wind_pump')
        ]

        def draw(rng):
            return rng.choice(nodes).request(hostile.live_parameters(rng))

    return draw


def work(kind, seeds, folder, pipe):
    """Tries cases in a process of its own, and tells of the beginning and the end of each."""
    draw = cases_of(kind, folder)
    taken = int(Path('/proc/self/statm').read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (taken + MEMORY, taken + MEMORY))
    for seed in seeds:
        pipe.send(('begin', seed))
        Path('/proc/self/clear_refs').write_text('5')  # the peak counts from here
        begin, failure, said = time.process_time(), '', []
        try:
            said = draw(random.Random(f'{kind} {seed}'))
        except BaseException:  # noqa: BLE001, which is what is looked for
            failure = traceback.format_exc()
        seconds = time.process_time() - begin
        peak = Path('/proc/self/status').read_text().partition('VmHWM:')[2].split()[0]
        pipe.send(('end', seed, seconds, int(peak) / 1024, not any(said), failure))
    pipe.send(('done', None))


def _answers(pipe, pid, patience):
    """Whether a process says something before it has computed for so long, or waited thrice that.

    Others may have the processor meanwhile.
    """
    begin, end = _computed(pid), time.monotonic() + 3 * patience
    while not pipe.poll(0.5):
        if _computed(pid) - begin > patience or time.monotonic() > end:
            return False
    return True


def _computed(pid):
    """Processor time of a process, s."""
    words = Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()
    return (int(words[11]) + int(words[12])) / os.sysconf('SC_CLK_TCK')


class Seeded:
    """Cases of one kind, and what came of them."""

    def __init__(self, kind, out):
        self.kind, self.out = kind, out
        self.cases = self.accepted = 0
        self.slowest, self.greatest = (0.0, None), (0.0, None)
        self.failures = []

    def run(self, seeds):
        """Tries all seeds; a process that hangs or dies is followed by another one."""
        seeds = list(seeds)
        while seeds:
            seeds = self._batch(seeds[:BATCH]) + seeds[BATCH:]

    def _batch(self, seeds):
        context = multiprocessing.get_context('spawn')
        with tempfile.TemporaryDirectory() as name:
            ours, theirs = context.Pipe()
            arguments = self.kind, seeds, Path(name), theirs
            process = context.Process(target=work, args=arguments, daemon=True)
            process.start()
            theirs.close()
            seed, patience, fault = None, 60.0, ''  # first it imports
            while not fault:
                if not _answers(ours, process.pid, patience):
                    fault = f'not done within {LONGEST:g} s'
                    break
                try:
                    word, *said = ours.recv()
                except EOFError:
                    process.join(5.0)
                    fault = f'the process died: exit code {process.exitcode}'
                    break
                if word == 'done':
                    process.join()
                    return []
                seed = said[0]
                patience = LONGEST if word == 'begin' else 60.0
                if word == 'end':
                    self._count(*said, Path(name))
            process.kill()
            process.join()
            self._fail(seed, fault, Path(name))
            return seeds[seeds.index(seed) + 1 :] if seed in seeds else []

    def _count(self, seed, seconds, peak, accepted, failure, folder):
        self.cases += 1
        self.accepted += accepted
        self.slowest = max(self.slowest, (seconds, seed))
        self.greatest = max(self.greatest, (peak, seed))
        if failure:
            self._fail(seed, failure, folder)

    def _fail(self, seed, words, folder):
        saved = []
        for path in folder.glob('case.*'):
            if path.suffix in {'.yaml', '.mcap'}:
                target = self.out / f'{self.kind.replace(" ", "_")}_{seed}{path.suffix}'
                target.write_bytes(path.read_bytes())
                saved.append(str(target))
        self.failures.append({'seed': seed, 'words': words, 'files': saved})
        print(f'{self.kind}, seed {seed}: {words.strip().splitlines()[-1]}', *saved, flush=True)

    def figures(self):
        """What came of it, for the report."""
        return {
            'cases': self.cases, 'accepted': self.accepted,
            'slowest, s of processor': round(self.slowest[0], 3),
            'seed of the slowest': self.slowest[1],
            'greatest memory, MB': round(self.greatest[0]), 'its seed': self.greatest[1],
            'failures': self.failures,
        }  # fmt: skip
