# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Builds sdists and wheels of linkage_ros and linkage_lab, and tests them in a fresh environment.

Each wheel is built from its sdist, which shows that the sdist is complete. The tested programs
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
    'python -m linkage_ros.node.linkage_node --version',  # imports rclpy
    'linkage_record wiper run.mcap',
    'linkage_log verify run.mcap',
    'linkage_replay run.mcap --viewer run.rrd --rate 1000',
    'linkage_chart motion quadrilateral --reactions',
    'linkage_chart movie wiper wiper.gif',
    'linkage_chart movie wiper wiper.html',
    'linkage_export mjcf compressor compressor.xml',
    'linkage_record --help-parameters',
)


def build(folder: Path) -> list[Path]:
    """Builds sdists and wheels, checks their metadata, and returns the wheels."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    with tempfile.TemporaryDirectory() as parent:
        tree = copy_tree(Path(parent) / 'linkage_ros')
        for place in (tree, tree / 'lab'):
            run(sys.executable, '-c', BUILD_SDIST, folder, cwd=place)
    wheels = []
    for name in ('linkage_ros', 'linkage_lab'):
        (sdist,) = folder.glob(f'{name}-*.tar.gz')
        wheel = build_wheel(sdist, folder, name)
        print(run(sys.executable, '-m', 'twine', 'check', '--strict', sdist, wheel, cwd=folder))
        with ZipFile(wheel) as archive:
            assert f'{name}/py.typed' in archive.namelist()
        wheels.append(wheel)
    return wheels


def try_out(wheel: Path, lab: Path, folder: Path) -> None:
    """Installs both wheels into a new environment in a folder, and runs their programs there."""
    run(sys.executable, '-m', 'venv', folder / 'venv', cwd=folder)
    programs = folder / 'venv' / 'bin'
    pip = (programs / 'python', '-m', 'pip', 'install', '--quiet', '--no-compile')
    run(*pip, '-c', ROOT / 'constraints.txt', f'{wheel}[{EXTRAS}]', lab, cwd=folder)
    for line in TRIED:
        name, *rest = line.split()
        printed = run(programs / name, *rest, cwd=folder)
        print(f'{line}\n    {printed.strip().splitlines()[-1].strip()}')
    for name in ('linkage_ros', 'linkage_lab'):
        found = run(
            programs / 'python', '-c', f'import {name} as p; print(p.__file__)', cwd=folder
        )
        assert Path(found).is_relative_to(folder), found


if __name__ == '__main__':
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('folder', type=Path, nargs='?', default=Path('dist'), help='default: dist')
    wheels = build(parser.parse_args().folder.resolve())
    with tempfile.TemporaryDirectory() as folder:
        try_out(*wheels, Path(folder))
