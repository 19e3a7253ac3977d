# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Tests many random cases of hostile input, in processes with limits and in executables.

Each case must end with success or one line of error, within 5 s and 1 GB in addition to the memory
of the imports. The cases come from test/hostile.py; failing ones are saved in DIR/fuzz.
Run: python benchmarks/reliability/fuzz.py [--out DIR] [--cases N]
"""

import multiprocessing
import os
import random
import resource
import signal
import subprocess
import sys
import tempfile
import traceback
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import harness

# The cases, and the checks of their outcomes, are in modules of the test suite.
sys.path.append(str(Path(__file__).resolve().parents[2] / 'test'))

SHARES = {'parameter file': 0.4, 'log': 0.35, 'replay options': 0.15, 'live parameters': 0.1}
BATCH = 500  # cases per process
LONGEST, MEMORY = 5.0, 1 << 30  # limits of a case: processor time, s, and memory, bytes
LIMIT = 30.0  # s, for an executable, including its imports on a busy machine
IMPORTS = 3 << 30  # bytes of address space that the imports of an executable may reserve
# Negative controls: faults that must be detected.
CONTROLS = {
    'hang': 'while True: pass', 'memory': 'bytearray(2**31)', 'error': '1 / 0',
    'two lines': 'hostile_outcomes.one_line("two\\nlines of words")',
}  # fmt: skip


def cases_of(kind, folder):
    """Returns a function that runs a random case and returns the error lines."""
    import hostile
    import hostile_logs
    import hostile_outcomes
    import numpy as np

    np.seterr(all='raise')  # a warning would be a second line of output
    yaml, mcap = folder / 'case.yaml', folder / 'case.mcap'
    logs = (
        hostile_logs.good_logs(folder) if kind in ('log', 'replay options', 'executable') else []
    )

    def parameter_file(rng):
        yaml.write_bytes(hostile.parameter_file(rng))
        return hostile_outcomes.parameter_file(yaml)

    def log(rng):
        mcap.write_bytes(hostile_logs.log_file(rng, logs))
        return hostile_outcomes.log_file(mcap)

    def replay_options(rng):
        return hostile_outcomes.replay_options(hostile.replay_options(rng), folder / '0.mcap')

    def live_parameters(rng):
        return rng.choice(nodes).request(hostile.live_parameters(rng))

    def executable(rng):
        yaml.write_bytes(hostile.parameter_file(rng))
        mcap.write_bytes(hostile_logs.log_file(rng, logs))
        return run_executable(rng, yaml, mcap)

    if kind == 'live parameters':
        import rclpy

        from linkage_ros.settings.configuration import load

        rclpy.init()
        presets = ('quadrilateral', 'wind_pump')
        nodes = [hostile_outcomes.LiveNode(load(name), None) for name in presets]
    if kind in CONTROLS:
        return lambda _: exec(CONTROLS[kind], {'hostile_outcomes': hostile_outcomes})
    return {
        'parameter file': parameter_file, 'log': log, 'replay options': replay_options,
        'live parameters': live_parameters, 'executable': executable,
    }[kind]  # fmt: skip


def run_executable(rng, yaml, mcap):
    """Runs an executable on a hostile file; checks exit code and stderr."""
    out = yaml.with_name('out')
    programs = 'linkage_ros.programs.'
    module, *words = rng.choice((
        (f'{programs}log_tool', 'info', mcap), (f'{programs}log_tool', 'verify', mcap),
        (f'{programs}log_tool', 'recover', mcap, f'{out}.mcap', '--overwrite'),
        (f'{programs}replay', mcap, '--no-ros', '--viewer', f'{out}{rng.random()}.rrd',
         '--rate', '1e6', '--playback-duration', '0.1'),
        (f'{programs}record', yaml, f'{out}.mcap', '--duration', '0.02', '--overwrite'),
        ('linkage_lab.command_line', 'motion', yaml, '--out', out),
    ))  # fmt: skip
    done = subprocess.run(
        [sys.executable, '-m', module, *words],
        capture_output=True, text=True, errors='replace', timeout=LIMIT, check=False,
        preexec_fn=lambda: limit_memory(IMPORTS + MEMORY),
    )  # fmt: skip
    allowed = (0, 1, 2) if {'verify', 'recover'} & {*words} else (0, 2)
    assert done.returncode in allowed, f'{module}: exit code {done.returncode}: {done.stderr}'
    assert done.stderr.count('\n') <= 1, f'{module}: {done.stderr}'
    return [done.stderr]


def limit_memory(size):
    """Limits the address space of this process, bytes."""
    _, most = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (size, most))


def out_of_time(*_):
    """Ends a case that exceeds its processor time.

    Raises:
        TimeoutError: Always.
    """
    raise TimeoutError(f'not done within {LONGEST:g} s')


def work(kind, seeds, out):
    """Runs cases in this process, with limits of time and memory.

    Args:
        kind: Kind of the cases.
        seeds: Seeds of the cases.
        out: Folder for the files of failing cases.

    Returns:
        For each case: seed, processor time, s, memory, MB, whether the input was accepted, and the
        failure.
    """
    signal.signal(signal.SIGPROF, out_of_time)
    rows = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        draw = cases_of(kind, folder)
        taken = int(Path('/proc/self/statm').read_text().split()[0]) * resource.getpagesize()
        limit_memory(taken + MEMORY)
        for seed in seeds:
            Path('/proc/self/clear_refs').write_text('5')  # resets the peak memory
            begin, failure, answers = sum(os.times()[:4]), '', []
            signal.setitimer(signal.ITIMER_PROF, LONGEST)
            try:
                answers = draw(random.Random(f'{kind} {seed}'))
            except BaseException:  # noqa: BLE001, any exception is a failure
                failure = traceback.format_exc()
                keep(folder, out / f'{kind.replace(" ", "_")}_{seed}')
            signal.setitimer(signal.ITIMER_PROF, 0.0)
            seconds = sum(os.times()[:4]) - begin  # includes child processes
            peak = Path('/proc/self/status').read_text().partition('VmHWM:')[2].split()[0]
            accepted = not failure and not any(answers)
            rows.append((seed, seconds, int(peak) / 1024, accepted, failure))
    return rows


def keep(folder, target):
    """Copies the files of a failing case."""
    for path in (folder / 'case.yaml', folder / 'case.mcap'):
        if path.exists():
            target.with_suffix(path.suffix).write_bytes(path.read_bytes())


def run(kind, seeds, out):
    """Runs cases in child processes; if one crashes, the benchmark ends with BrokenProcessPool.

    Args:
        kind: Kind of the cases.
        seeds: Seeds of the cases.
        out: Folder for the files of failing cases.

    Returns:
        Figures for the report.
    """
    rows = []
    for first in range(0, len(seeds), BATCH):
        with ProcessPoolExecutor(1, multiprocessing.get_context('spawn')) as pool:
            rows += pool.submit(work, kind, seeds[first : first + BATCH], out).result()
    failures = [{'seed': seed, 'words': words} for seed, *_, words in rows if words]
    slowest = max(rows, key=lambda row: row[1])
    largest = max(rows, key=lambda row: row[2])
    return {
        'cases': len(rows), 'accepted': sum(row[3] for row in rows),
        'slowest, s of processor': round(slowest[1], 3), 'seed of the slowest': slowest[0],
        'greatest memory, MB': round(largest[2]), 'its seed': largest[0], 'failures': failures,
    }  # fmt: skip


def main():
    """Runs all kinds of cases, and writes DIR/fuzz.json."""
    options = harness.options(
        __doc__,
        cases=(10_000, 'random cases'), processes=(120, 'runs of executables'),
        seed=(0, 'seed of the first case'),
    )  # fmt: skip
    out = options.out / 'fuzz'
    out.mkdir(parents=True, exist_ok=True)
    for kind in CONTROLS:
        assert len(run(kind, [0], out)['failures']) == 1, f'{kind} was not found'
    print('every control was found', flush=True)
    counts = {kind: round(share * options.cases) for kind, share in SHARES.items()}
    figures = {}
    for kind, count in {**counts, 'executable': options.processes}.items():
        figures[kind] = run(kind, range(options.seed, options.seed + count), out)
        for failure in figures[kind]['failures']:
            print(f'{kind}, seed {failure["seed"]}: {failure["words"].splitlines()[-1]}')
        print(kind, {k: v for k, v in figures[kind].items() if k != 'failures'}, flush=True)
    harness.finish('fuzz', options.out, figures)
    sys.exit(any(part['failures'] for part in figures.values()))


if __name__ == '__main__':
    main()
