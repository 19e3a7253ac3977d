# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Tests many random cases of hostile input, in processes with limits and in executables.

Each case must end with success or one line of error, within 5 s and 1 GB in addition to the memory
of the imports. The cases come from test/hostile.py, and long, deep and damaged files of every kind
from hostile_files.py; failing ones are saved in DIR/fuzz.
Run: python benchmarks/reliability/fuzz.py [--out DIR] [--cases N] [--files N] [--seed N]
"""

import multiprocessing
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import traceback
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from importlib import import_module
from pathlib import Path

import harness

# The cases, and the checks of their outcomes, are in modules of the test suite.
sys.path.append(str(Path(__file__).resolve().parents[2] / 'test'))

SHARES = {'parameter file': 0.4, 'log': 0.35, 'replay options': 0.15, 'live parameters': 0.1}
BATCH = 500  # cases per process
FORKED = {'file', 'crash'}  # kinds whose cases may end the process, as code in C does
# Modules that the cases of files use, imported once.
IMPORTED = (
    'hostile_files', 'linkage_lab.robots.import_tool', 'linkage_lab.robots.mjcf',
    'linkage_lab.sweep.study', 'linkage_ros.programs.record',
)  # fmt: skip
LONGEST, MEMORY = 5.0, 1 << 30  # limits of a case: processor time, s, and memory, bytes
LIMIT = 30.0  # s, for an executable, including its imports on a busy machine
MOST_NOTES = 8  # lines that a program may print before it ends
IMPORTS = 3 << 30  # bytes of address space that the imports of an executable may reserve
# Negative controls: faults that must be detected.
CONTROLS = {
    'hang': 'while True: pass', 'memory': 'bytearray(2**31)', 'error': '1 / 0',
    'crash': 'import os; os.abort()',
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
        hostile_logs.good_logs(folder)
        if kind in {'log', 'replay options', 'file', 'executable'}
        else []
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

    def file(rng):
        shutil.rmtree(folder / 'files', ignore_errors=True)
        (folder / 'files').mkdir()
        return read_file(rng, folder / 'files', logs)

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
        'live parameters': live_parameters, 'file': file, 'executable': executable,
    }[kind]  # fmt: skip


def read_file(rng, folder, logs):
    """Reads a long, deep or damaged file with a program; checks exit code and stderr."""
    import hostile_files
    import hostile_outcomes

    from linkage_lab.robots import import_tool
    from linkage_lab.sweep.study import read_study
    from linkage_ros import cli, load
    from linkage_ros.programs import log_tool, record

    kind = rng.choice([*hostile_files.KINDS])
    path = folder / ('case.mcap' if kind in {'log', 'bag'} else 'case')
    path.write_bytes(hostile_files.KINDS[kind](rng, logs))
    yaml, out = folder / 'settings.yaml', folder / 'out.mcap'
    yaml.write_text(hostile_files.SETTINGS.get(kind, ''))
    if kind == 'bag':
        (folder / 'bag').mkdir()
        path.rename(folder / 'bag/run_0.mcap')
        (folder / 'bag/metadata.yaml').write_bytes(hostile_files.parameter_file(rng))
        path = folder / 'bag'
    joints = ('knee_motor', '--close', 'rod_tip', 'shank_pin') if kind == 'URDF' else ('crank',)
    program, *words = rng.choice({
        'parameters': ((lambda: load(str(path)),),),
        'study': ((lambda: read_study(str(path)),),),
        'law': ((lambda: load(str(yaml)),),), 'load': ((lambda: load(str(yaml)),),),
        'log': (
            (log_tool.main, 'info', path), (log_tool.main, 'verify', path),
            (log_tool.main, 'recover', path, out), (log_tool.main, 'csv', path, out),
            (lambda: hostile_outcomes.play(path),),
        ),
        'bag': (
            (log_tool.main, 'csv', path, out),
            (record.main, yaml, out, '--measured', path),
        ),
    }.get(kind, ((import_tool.main, path, '--crank', *joints, '-o', out),)))  # fmt: skip
    errors = folder / 'errors'
    for number, target in ((1, os.devnull), (2, errors)):
        os.dup2(os.open(target, os.O_WRONLY | os.O_CREAT), number)
    sys.argv = ['program', *map(str, words)]
    try:
        code = cli.run('program', lambda: program() and 1)
    except SystemExit as ended:  # argparse
        code = ended.code
    sys.stderr.flush()
    said = errors.read_text(errors='replace')
    assert code in {0, 1, 2}, f'{kind}: exit code {code}: {said}'
    notes = [line for line in said.splitlines() if line.startswith('note: ')]
    assert len(notes) <= MOST_NOTES, f'{kind}: {said}'
    said = said.removeprefix('\n'.join([*notes, ''])).removesuffix('\n')
    assert code == 2 or '\n' not in said, f'{kind}: {said}'
    return [hostile_outcomes.one_line(said)] if code == 2 else [said]


def run_executable(rng, yaml, mcap):
    """Runs an executable on a hostile file; checks exit code and stderr."""
    import hostile_outcomes

    out = yaml.with_name('out')
    programs = 'linkage_ros.programs.'
    module, *words = rng.choice((
        (f'{programs}log_tool', 'info', mcap), (f'{programs}log_tool', 'verify', mcap),
        (f'{programs}log_tool', 'recover', mcap, f'{out}.mcap', '--overwrite'),
        (f'{programs}replay', mcap, '--no-ros', '--viewer', f'{out}{rng.random()}.rrd',
         '--rate', '1e6', '--playback-duration', '0.1'),
        (f'{programs}record', yaml, f'{out}.mcap', '--duration', '0.02', '--overwrite'),
        ('linkage_lab.command_line', 'motion', yaml, '--out', out, '--overwrite'),
    ))  # fmt: skip
    done = subprocess.run(
        [sys.executable, '-m', module, *words],
        capture_output=True, text=True, errors='replace', timeout=LIMIT, check=False,
        preexec_fn=lambda: limit_memory(IMPORTS + MEMORY),
    )  # fmt: skip
    allowed = (0, 1, 2) if {'verify', 'recover'} & {*words} else (0, 2)
    assert done.returncode in allowed, f'{module}: exit code {done.returncode}: {done.stderr}'
    lines = (line for line in done.stderr.splitlines() if not line.startswith('note: '))
    said = '\n'.join(lines)
    assert done.returncode == 2 or '\n' not in said, f'{module}: {done.stderr}'
    return [hostile_outcomes.one_line(said)] if done.returncode == 2 else [said]


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
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for module in IMPORTED if kind == 'file' else ():
            import_module(module)
        draw = cases_of(kind, folder)
        taken = int(Path('/proc/self/statm').read_text().split()[0]) * resource.getpagesize()
        limit_memory(taken + MEMORY)
        run_case = partial(case, kind, draw, folder, out)
        return [forked(run_case, seed) if kind in FORKED else run_case(seed) for seed in seeds]


def case(kind, draw, folder, out, seed):
    """Runs a case; returns its row, see `work`."""
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
    return seed, seconds, int(peak) / 1024, not failure and not any(answers), failure


def forked(run_case, seed):
    """Runs a case in a forked process, so that a crash, or a hang in C, is its failure alone."""
    receiver, sender = (context := multiprocessing.get_context('fork')).Pipe(duplex=False)

    def work_in_child():
        resource.setrlimit(resource.RLIMIT_CPU, (2 * int(LONGEST),) * 2)  # for code in C
        sender.send(run_case(seed))

    process = context.Process(target=work_in_child)
    process.start()
    sender.close()
    try:
        return receiver.recv() if receiver.poll(4 * LIMIT) else (seed, 0.0, 0, False, 'hangs')
    except EOFError:
        process.join()
        return seed, 0.0, 0, False, f'crashed: exit code {process.exitcode}'
    finally:
        process.kill()
        process.join()


def keep(folder, target):
    """Copies the files of a failing case."""
    for path in folder.glob('**/case*'):
        target.with_name(f'{target.name}_{path.name}').write_bytes(path.read_bytes())


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
        files=(2_000, 'long, deep and damaged files'), seed=(0, 'seed of the first case'),
    )  # fmt: skip
    out = options.out / 'fuzz'
    out.mkdir(parents=True, exist_ok=True)
    for kind in CONTROLS:
        assert len(run(kind, [0], out)['failures']) == 1, f'{kind} was not found'
    print('every control was found', flush=True)
    counts = {kind: round(share * options.cases) for kind, share in SHARES.items()}
    figures = {}
    counts |= {'file': options.files, 'executable': options.processes}
    for kind, count in counts.items():
        if not count:
            continue
        figures[kind] = run(kind, range(options.seed, options.seed + count), out)
        for failure in figures[kind]['failures']:
            print(f'{kind}, seed {failure["seed"]}: {failure["words"].splitlines()[-1]}')
        print(kind, {k: v for k, v in figures[kind].items() if k != 'failures'}, flush=True)
    harness.finish('fuzz', options.out, figures)
    sys.exit(any(part['failures'] for part in figures.values()))


if __name__ == '__main__':
    main()
