# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Hostile files for the executables themselves: exit code 0, 1 or 2, at most a line on stderr."""

from __future__ import annotations

import random
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

# The test suite's cases.
sys.path.append(str(Path(__file__).resolve().parents[2] / 'test'))

import hostile
import hostile_logs

STARTED = 30.0  # s in which one has to end: imports on a busy machine, and the case


def commands(rng, folder, logs):
    """The command line of one case of a real process, and the file that it reads."""
    tool, out = (
        rng.choice(('info', 'verify', 'recover', 'replay', 'record', 'motion')),
        folder / 'out',
    )
    if tool in {'record', 'motion'}:
        path = folder / 'case.yaml'
        path.write_bytes(hostile.parameter_file(rng))
        if tool == 'motion':
            return ['chart_tool', 'motion', path, '--out', out], path
        return ['record', path, f'{out}.mcap', '--duration', '0.02', '--overwrite'], path
    path = folder / 'case.mcap'
    path.write_bytes(hostile_logs.log_file(rng, logs))
    if tool == 'replay':
        options = ['--rate', '1e6', '--playback-duration', '0.1']
        target = folder / f'{rng.random()}.rrd'
        return ['replay', path, '--no-ros', '--viewer', target, *options], path
    more = [f'{out}.mcap', '--overwrite'] if tool == 'recover' else []
    return ['log_tool', tool, path, *more], path


def run(count, first, out):
    """Starts executables on hostile files; returns how many of each, and what failed."""
    counts, codes, failures, slowest = Counter(), Counter(), [], 0.0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        logs = hostile_logs.good_logs(folder)
        for seed in range(first, first + count):
            (module, *words), path = commands(random.Random(f'process {seed}'), folder, logs)
            command = [sys.executable, '-m', f'linkage_ros.{module}', *map(str, words)]
            begin = time.perf_counter()
            try:
                done = subprocess.run(command, capture_output=True, timeout=STARTED, check=False)
                code, err = done.returncode, done.stderr.decode(errors='replace')
            except subprocess.TimeoutExpired:
                code, err = 'none', f'not done within {STARTED:g} s'
            slowest = max(slowest, time.perf_counter() - begin)
            tool = f'{module} {words[0]}' if module in {'log_tool', 'chart_tool'} else module
            counts[tool] += 1
            codes[str(code)] += 1
            allowed = {0, 1, 2} if tool == 'log_tool verify' else {0, 2}
            if code not in allowed or err.count('\n') > 1 or 'Traceback' in err:
                saved = out / f'process_{seed}{path.suffix}'
                saved.write_bytes(path.read_bytes())
                failures.append({'seed': seed, 'tool': tool, 'code': code, 'stderr': err[-2000:]})
                print(f'{tool}, seed {seed}: exit code {code}: {err[-300:]}', flush=True)
    return {
        'by tool': counts, 'exit codes': codes, 'slowest, s': round(slowest, 2),
        'failures': failures,
    }  # fmt: skip
