# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Runs all reliability benchmarks, one after another.

    python benchmarks/reliability/run.py --out DIR          all: 2.75 hours, as root
    python benchmarks/reliability/run.py soak many          only these two

Each benchmark writes DIR/NAME.json; DIR/reliability.json contains the figures of all. The exit
code is 1 if a promise is broken. Benchmarks that cannot run on this machine are listed.
"""

import argparse
import json
import re
import subprocess
import sys
import tempfile
from pathlib import Path

from harness import NOT_HERE

HERE = Path(__file__).parent
# Benchmarks that need an idle machine come first.
SCRIPTS = {
    name: HERE / f'{name}.py'
    for name in ('many', 'killed', 'power', 'disk', 'hosts', 'soak', 'trajectories', 'fuzz')
}


def gather(folder: Path) -> None:
    """Collects the figures of all benchmarks in one file."""
    found = {name: folder / f'{name}.json' for name in SCRIPTS}
    figures = {name: json.loads(path.read_text()) for name, path in found.items() if path.exists()}
    text = json.dumps(figures, indent=1)
    folders = re.escape(tempfile.gettempdir()) + r'/tmp\w+/?'  # temporary folders
    (folder / 'reliability.json').write_text(re.sub(folders, '', text) + '\n')


def main() -> int:
    """Runs the selected benchmarks."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('names', nargs='*', metavar='NAME', help=', '.join(SCRIPTS))
    parser.add_argument(
        '--out', type=Path, default=Path('reliability'), metavar='DIR', help='folder for figures'
    )
    options = parser.parse_args()
    if unknown := set(options.names) - set(SCRIPTS):
        parser.error(f'{", ".join(sorted(unknown))}: choose from {", ".join(SCRIPTS)}')
    codes = {}
    for name in options.names or SCRIPTS:
        print(f'--- {name}', flush=True)
        command = [sys.executable, SCRIPTS[name], '--out', options.out]
        codes[name] = subprocess.run(command, check=False).returncode
        gather(options.out)
    if left_out := [name for name, code in codes.items() if code == NOT_HERE]:
        print(f'cannot run on this machine: {", ".join(left_out)}')
    if broken := [name for name, code in codes.items() if code not in (0, NOT_HERE)]:
        print(f'broken promises in: {", ".join(broken)}')
        return 1
    print('every promise that was tested is kept')
    return 0


if __name__ == '__main__':
    sys.exit(main())
