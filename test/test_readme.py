# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The README is short, and its linkage, its pictures and its program give what it says."""

from __future__ import annotations

import re
import subprocess

import numpy as np
import pytest
from pages import ROOT, block, commands, page_files, read, run_python
from PIL import Image
from ros_harness import command

README = read('README.md')


def chart(source, folder):
    """Runs `linkage_chart motion` in a folder, where it leaves its files; what it prints."""
    done = subprocess.run(
        command('chart_tool', 'motion', source, '--out', folder),
        cwd=folder, capture_output=True, text=True, timeout=60, check=True,
    )  # fmt: skip
    return done.stdout


def differ(one, other):
    """Whether two pictures differ by more than the edges of letters and lines, or in size."""
    with Image.open(one) as first, Image.open(other) as second:
        if first.size != second.size:
            return True
        size = first.width // 8, first.height // 8
        small = [np.asarray(p.convert('RGB').resize(size, Image.Resampling.BOX), dtype=float)
                 for p in (first, second)]  # fmt: skip
    return bool(np.abs(small[0] - small[1]).max() > 40)


def test_it_is_short():
    assert len(README.split()) <= 1300


def test_its_set_up_is_the_one_that_its_page_explains():
    lines = block(README, 'rosdep')
    assert lines == block(read('docs/ros2.md'), 'rosdep')
    assert len(lines.splitlines()) == 5


def test_the_first_linkage_moves_as_described(tmp_path):
    for name, text in page_files(README).items():
        assert len(text.splitlines()) <= 10
        (tmp_path / name).write_text(text)
    printed = chart('wiper.yaml', tmp_path)
    table = np.genfromtxt(tmp_path / 'wiper_motion.csv', delimiter=',', names=True)
    (torque,) = [name for name in table.dtype.names if name.startswith('driving_torque')]
    least, most = table[torque].min(), table[torque].max()
    swing = float(re.search(r'swing ([\d.]+) deg', printed)[1])
    assert 'time ratio 1\n' in printed
    assert f'swings through {swing:.0f} deg and takes equal times' in README
    assert f'from {least:.2f} to {most:.2f} N m' in README
    shown = ROOT / 'docs' / 'wiper_motion.png'
    assert not differ(tmp_path / shown.name, shown), 'run linkage_chart motion wiper.yaml'


def test_the_chart_of_the_quadrilateral_is_today_s(tmp_path):
    chart('quadrilateral', tmp_path)
    shown = ROOT / 'docs' / 'quadrilateral_motion.png'
    assert not differ(tmp_path / shown.name, shown), 'run linkage_chart motion quadrilateral'


def test_the_chart_of_another_speed_differs(tmp_path):
    preset = (ROOT / 'config' / 'quadrilateral.yaml').read_text()
    (tmp_path / 'quadrilateral.yaml').write_text(preset.replace('rpm: 150.0', 'rpm: 149.0'))
    chart('quadrilateral.yaml', tmp_path)
    name = 'quadrilateral_motion.png'
    assert differ(tmp_path / name, ROOT / 'docs' / name)


def test_five_lines_use_the_ros2_command():
    lines = block(README, 'ros2 topic').splitlines()
    assert len(lines) == 5
    assert all(line.startswith('ros2 ') for line in lines)


def test_the_demo_and_the_checks_come_first():
    first = [words for words, is_block, _ in commands(README) if is_block][:2]
    assert first == [('make', 'demo'), ('make', 'check')]


def test_the_python_lines_run(capsys):
    text = block(README, 'import numpy')
    run_python(text, 'README.md')
    first, second = capsys.readouterr().out.splitlines()
    assert first.startswith('crank-rocker ')
    assert float(first.split()[1]) == pytest.approx(0.663, abs=2e-3)
    assert 0 < float(second.split()[0]) < 100
    assert len([line for line in text.splitlines() if line]) <= 10
