# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Compares other software with this package: speed, errors and difficult situations.

It creates a virtual environment from requirements.txt, measures in it, and prints the page, in a
few minutes. --markdown writes the page lab/docs/peers.md, and --json writes all figures.
Run: python benchmarks/peers/run.py
"""

import argparse
import datetime as dt
import json
import os
import platform
import re
import subprocess
import sys
import tempfile
import venv
from pathlib import Path

import report

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
REQUIREMENTS = HERE / 'requirements.txt'


def environment(folder):
    """Creates or completes the virtual environment; returns the path of its Python."""
    python = folder / 'bin' / 'python'
    if not python.exists():
        print(f'making {folder} ...', flush=True)
        venv.create(folder, with_pip=True)
    pip = [python, '-m', 'pip', 'install', '--quiet', '--disable-pip-version-check']
    subprocess.run([*pip, '-r', REQUIREMENTS], check=True)
    return python


def measured(python, script, folder, *options):
    """Runs a script in the environment of the peers; returns the data that the script writes."""
    out = Path(folder, f'{script}.json')
    paths = os.pathsep.join(map(str, (ROOT, ROOT / 'test')))
    # One thread each, because the peers are compared on one core.
    threads = dict.fromkeys(('OMP_NUM_THREADS', 'OPENBLAS_NUM_THREADS'), '1')
    variables = {**os.environ, **threads, 'PYTHONPATH': paths}
    subprocess.run([python, HERE / script, out, *options], check=True, env=variables)
    return json.loads(out.read_text())


def machine():
    """Returns CPU, number of cores and operating system."""
    information = Path('/proc/cpuinfo').read_text()
    release = Path('/etc/os-release').read_text()
    return {
        'cpu': re.search(r'^model name\s*: (.*)', information, re.MULTILINE)[1],
        'cores': os.cpu_count(),
        'os': re.search(r'^PRETTY_NAME="?([^"\n]*)', release, re.MULTILINE)[1],
    }


def first_line(*command):
    """Returns the first line of a program's output, or '' if the program is missing."""
    try:
        done = subprocess.run(command, check=True, capture_output=True, text=True)
    except (OSError, subprocess.CalledProcessError):
        return ''
    return done.stdout.splitlines()[0]


def main():
    """Runs the comparison."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    default = Path(tempfile.gettempdir(), '.peers')
    add = parser.add_argument
    add('--venv', type=Path, default=default, help='virtual environment (default: %(default)s)')
    add('--json', type=Path, metavar='FILE', help='file for the figures')
    add('--markdown', type=Path, metavar='FILE', help='file for the page')
    add('--rounds', type=int, default=21, help='rounds of each timing (default: %(default)s)')
    options = parser.parse_args()
    python = environment(options.venv)
    with tempfile.TemporaryDirectory() as folder:
        speed = measured(python, 'speed.py', folder, '--rounds', str(options.rounds))
        hard = measured(python, 'situations.py', folder)
    listed = json.loads(first_line(python, '-m', 'pip', 'list', '--format', 'json') or '[]')
    compiler = first_line('cc', '--version')
    results = {
        'date': dt.datetime.now(dt.timezone.utc).date().isoformat(),
        'machine': machine(),
        'python': platform.python_version(),
        'compiler': f', {compiler}' if compiler else '',
        'libraries': {package['name']: package['version'] for package in listed},
        'rounds': options.rounds,
        **speed,
        **hard,
    }
    page = report.markdown(results)
    print(page)
    if options.json:
        options.json.write_text(json.dumps(results, indent=1) + '\n')
    if options.markdown:
        options.markdown.write_text(page, encoding='utf-8')


if __name__ == '__main__':
    sys.exit(main())
