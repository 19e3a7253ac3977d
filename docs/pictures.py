# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Renews the pictures of the pages.

    python docs/pictures.py                               all, in five minutes
    python docs/pictures.py lab/docs/lecture.md timing    those of a page and of a measurement

The commands and the Python of a page make its pictures, from the files on the page. Pictures of
long measurements are drawn again from the JSON files in this folder. These programs renew the
others: benchmarks/controller.py, `linkage_chart accuracy` (accuracy_follow.png) and, with Vulkan,
docs/moving_picture.py (quadrilateral.gif).
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

DOCS = Path(__file__).parent
ROOT = DOCS.parent
sys.path += [str(ROOT / folder) for folder in ('test', 'benchmarks', 'benchmarks/reliability')]

import delay  # noqa: E402
import timing_page  # noqa: E402
from pages import blocks, commands, is_python, page_files, read  # noqa: E402

from linkage_lab.charts import accuracy, stability  # noqa: E402

PAGES = (
    'README.md', 'docs/drawings.md', 'docs/pandas.md', 'docs/robot.md', 'lab/docs/designs.md',
    'lab/docs/homework.md', 'lab/docs/lecture.md', 'lab/docs/sizing.md',
)  # fmt: skip
GALLERY = 'README.md'  # its commands are in a table
PROGRAMS = 'linkage_chart', 'linkage_import', 'linkage_record'
MEASUREMENTS = 'accuracy', 'stability', 'timing', 'delay'


def make(page: str, folder: Path) -> Iterator[Path]:
    """Runs the commands and the Python of a page; yields the files that belong in docs.

    Args:
        page: Path of the page.
        folder: Empty folder in which they run.

    Raises:
        CalledProcessError: A command failed.
    """
    text = read(page)
    for name, content in page_files(text).items():
        (folder / name).write_text(content)
    for path in ('config', 'docs'):
        (folder / path).symlink_to(ROOT / path)
    scripts = Path(sysconfig.get_path('scripts'))
    for words, is_block in commands(text):
        if words[0] in PROGRAMS and (is_block or page == GALLERY):
            print(*words, file=sys.stderr)
            subprocess.run([scripts / words[0], *words[1:]], cwd=folder, check=True)  # noqa: S603
    for program in filter(is_python, blocks(text)):
        environment = {**os.environ, 'MPLBACKEND': 'agg'}
        subprocess.run([sys.executable, '-c', program], cwd=folder, env=environment, check=True)  # noqa: S603
    for path in folder.iterdir():
        if path.suffix in {'.png', '.gif', '.json'} and (DOCS / path.name).exists():
            yield path


def draw(name: str) -> None:
    """Draws the pictures of a measurement from its JSON file."""

    def content(name: str) -> Any:
        return json.loads((DOCS / f'{name}.json').read_text())

    def files(name: str) -> list[Path]:
        return [DOCS / f'{name}.png']

    if name == 'timing':
        timing_page.write(DOCS)
    elif name == 'delay':
        delay.draw(content(name), DOCS / 'delay.png')
    elif name == 'stability':
        stability.draw_stability(content(name)['records'], stability.heading(30), files(name))
    else:
        measured = content(name)
        for title, stem, points in accuracy.charts(measured['records'], measured['about']):
            accuracy.draw_accuracy(points, title, files(stem))


def main() -> None:
    """Renews the pictures."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    choices = [*PAGES, *MEASUREMENTS]
    parser.add_argument('names', nargs='*', metavar='NAME', help=f'of {", ".join(choices)}')
    names = parser.parse_args().names or choices
    for name in names:
        if name not in choices:
            parser.error(f'{name}: must be of {", ".join(choices)}')
        if name in MEASUREMENTS:
            draw(name)
            continue
        with tempfile.TemporaryDirectory() as folder:
            for path in make(name, Path(folder)):
                shutil.copyfile(path, DOCS / path.name)
                print(DOCS / path.name)


if __name__ == '__main__':
    main()
