# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Builds sdist and wheel into a folder, and tests the wheel in a fresh environment.

The wheel is built from the sdist, which shows that the sdist is complete. The tested programs
cannot access the clone.
"""

import argparse
import shutil
import sys
import tempfile
from pathlib import Path
from zipfile import ZipFile

from test_packaging import ROOT, build_wheel, copy_tree, run

BUILD_SDIST = 'import sys, setuptools.build_meta as b; b.build_sdist(sys.argv[1])'
EXTRAS = 'ros,viewer,record'
TRIED = (
    'python -m linkage_ros.programs.demo',
    'linkage_record wiper run.mcap',
    'linkage_log verify run.mcap',
    'linkage_log verify demo/quadrilateral.mcap',
    'linkage_replay run.mcap --viewer run.rrd --rate 1000',
    'linkage_chart motion quadrilateral --reactions',
    'linkage_chart movie wiper wiper.gif',
    'linkage_chart movie wiper wiper.html',
    'linkage_chart mjcf compressor compressor.xml',
    'linkage_record --help',
)


def build(folder: Path) -> tuple[Path, Path]:
    """Builds sdist and wheel, and checks their metadata."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    with tempfile.TemporaryDirectory() as parent:
        tree = copy_tree(Path(parent) / 'linkage_ros')
        run(sys.executable, '-c', BUILD_SDIST, folder, cwd=tree)
    (sdist,) = folder.glob('*.tar.gz')
    wheel = build_wheel(sdist, folder)
    print(run(sys.executable, '-m', 'twine', 'check', '--strict', sdist, wheel, cwd=folder))
    with ZipFile(wheel) as archive:
        assert 'linkage_ros/py.typed' in archive.namelist()
    return sdist, wheel


def try_out(wheel: Path, folder: Path) -> None:
    """Installs a wheel into a new environment in a folder, and runs its programs there."""
    run(sys.executable, '-m', 'venv', folder / 'venv', cwd=folder)
    programs = folder / 'venv' / 'bin'
    pip = (programs / 'python', '-m', 'pip', 'install', '--quiet', '--no-compile')
    run(*pip, '-c', ROOT / 'constraints.txt', f'{wheel}[{EXTRAS}]', cwd=folder)
    for line in TRIED:
        name, *rest = line.split()
        printed = run(programs / name, *rest, cwd=folder)
        print(f'{line}\n    {printed.strip().splitlines()[-1].strip()}')
    found = run(
        programs / 'python', '-c', 'import linkage_ros as p; print(p.__file__)', cwd=folder
    )
    assert Path(found).is_relative_to(folder), found


if __name__ == '__main__':
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('folder', type=Path, nargs='?', default=Path('dist'), help='default: dist')
    _, wheel = build(parser.parse_args().folder.resolve())
    with tempfile.TemporaryDirectory() as folder:
        try_out(wheel, Path(folder))
