# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""All of it, one after another, and a line for each; the figures together in one file.

    python benchmarks/reliability/run.py --out DIR          two hours and a quarter, as root
    python benchmarks/reliability/run.py soak many          these alone

Each leaves DIR/NAME.json; DIR/reliability.json holds what is there of all of them. The exit code
is 1 where a promise does not hold; what cannot be tried here is named.
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
# In this order: what asks for a quiet machine first.
SCRIPTS = {
    name: HERE / f'{name}.py'
    for name in ('many', 'killed', 'power', 'disk', 'hosts', 'soak', 'fuzz')
}


def gather(folder: Path) -> None:
    """Puts the figures of all into one file."""
    found = {name: folder / f'{name}.json' for name in SCRIPTS}
    figures = {name: json.loads(path.read_text()) for name, path in found.items() if path.exists()}
    text = json.dumps(figures, indent=1)
    folders = re.escape(tempfile.gettempdir()) + r'/tmp\w+/?'  # they say nothing to anybody
    (folder / 'reliability.json').write_text(re.sub(folders, '', text) + '\n')


def main() -> int:
    """Runs them."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('names', nargs='*', metavar='NAME', help=', '.join(SCRIPTS))
    parser.add_argument(
        '--out', type=Path, default=Path('reliability'), metavar='DIR', help='for figures'
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
        print(f'cannot be tried here: {", ".join(left_out)}')
    if broken := [name for name, code in codes.items() if code not in (0, NOT_HERE)]:
        print(f'a promise does not hold: {", ".join(broken)}')
        return 1
    print('every promise that was tried holds')
    return 0


if __name__ == '__main__':
    sys.exit(main())
