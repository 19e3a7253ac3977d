# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Compares the processor time of the sweeps in the docs between two versions of this package.

python benchmarks/sweep.py PYTHON [PYTHON ...]

Each PYTHON is the interpreter of an environment with one version, such as .venv-3.11/bin/python
of another clone. A round runs each study once in every version, with one worker. The times are
those of the whole command, with its start, its table and its picture; the ratios are those to the
first version.
"""

import argparse
import os
import re
import resource
import statistics
import subprocess
import tempfile
from pathlib import Path

_PAGE = Path(__file__).parent.parent / 'lab/docs/designs.md'
_LAW = """
base: excavator                          # driven along a law
designs: 1024
tolerances: {frame.length: 0.0002, crank.length: 0.0001, barrel.mass: 0.3, rod.mass: 0.2}
measures: [peak_force, rms_force, swing, shaking_force]
"""


def studies():
    """Returns the studies in the docs and one along a law, by name."""
    found = re.findall(r'^    # (\w+)\.yaml\n((?:    .*\n)+)', _PAGE.read_text(), re.MULTILINE)
    return {name: re.sub('^    ', '', text, flags=re.MULTILINE) for name, text in found} | {
        'law': _LAW
    }


def seconds(python, path):
    """Returns the processor time of a sweep, s."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    command = [python, '-m', 'linkage_lab.command_line', 'sweep', path, '--workers', '1']
    with tempfile.TemporaryDirectory(dir=path.parent) as out:
        subprocess.run(
            [*command, '--out', out], check=True, stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL, cwd=path.parent, env=os.environ | {'OMP_NUM_THREADS': '1'},
        )  # fmt: skip
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main():
    """Prints a line for each study and version."""
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument('python', nargs='+', type=os.path.abspath)
    parser.add_argument('--rounds', type=int, default=5)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        for name, text in studies().items():
            path = Path(folder) / f'{name}.yaml'
            path.write_text(text)
            rounds = [
                [seconds(python, path) for python in options.python] for _ in range(options.rounds)
            ]
            for i, python in enumerate(options.python):
                time = statistics.median(each[i] for each in rounds)
                ratio = statistics.median(each[i] / each[0] for each in rounds)
                print(f'{name:12} {time:7.2f} s   x {ratio:.2f}   {python}', flush=True)


if __name__ == '__main__':
    main()
