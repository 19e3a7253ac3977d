# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the README and the CHANGELOG say is what the code does."""

from __future__ import annotations

import itertools
import re

from pages import ROOT, block, parameter_row, read, run_python

from linkage_ros.controller import Settings
from linkage_ros.mechanisms.registry import MECHANISMS
from linkage_ros.motion.drives import DRIVES
from linkage_ros.parameters.configuration import Kind, parameter_leaves
from linkage_ros.quantities import leaves
from linkage_ros.wire.topics import TOPICS

README = read('README.md')


def rows_of(mechanism, drive):
    """Links have the same parameters, so that one row of a LINK stands for all."""
    if mechanism == 'wind_pump' and drive == 'speed':
        return set()
    return {
        parameter_row(re.sub(r'^(crank|coupler|rocker|rod)\.(?!point)', 'LINK.', name), *rest)
        for name, *rest in parameter_leaves(Kind(mechanism, drive))
    }


def rows_between(start, end):
    return set(re.findall(r'^\| `.*', README.partition(start)[2].partition(end)[0], re.MULTILINE))


def test_the_table_of_parameters_is_the_code_s():
    found = rows_between('## Parameters', 'Those of `linkage_controller`')
    kinds = itertools.product(MECHANISMS, DRIVES)
    wanted = {row for mechanism, drive in kinds for row in rows_of(mechanism, drive)}
    assert found == wanted, 'README.md lacks\n' + '\n'.join(wanted - found)


def test_the_table_of_the_controller_is_the_code_s():
    found = rows_between('Those of `linkage_controller`', '## ')
    assert found == {parameter_row(*leaf) for leaf in leaves(Settings)}


def test_the_lines_of_a_parameter_file_are_the_preset_s():
    preset = (ROOT / 'config' / 'quadrilateral.yaml').read_text().splitlines()
    shown = block(README, 'ros__parameters').splitlines()
    assert set(shown) <= set(preset)


def test_a_row_has_unit_range_and_default():
    rows = '\n'.join(rows_of('four_bar', 'torque'))
    assert '| `torque_limit` | 0 to 1e12 N m | `1.0e12` |' in rows
    assert '| `gravity` | two, -1e6 to 1e6 m/s^2 | `[0.0, -9.81]` |' in rows
    assert '| `LINK.length` | 1e-9 to 1e9 m | required |' in rows
    assert '| `coupler.point` | two, -1e9 to 1e9 m | - |' in rows


def test_every_topic_and_executable_is_listed():
    for topic in TOPICS:
        package, _, kind = topic.interface.name.split('/')
        assert f'| `{topic.name}` | {package}/{kind}' in README
    names = re.findall(r"'(linkage_\w+) = ", (ROOT / 'setup.py').read_text())
    assert names
    for name in names:
        assert f'| `{name}' in README


def test_the_python_lines_run(capsys):
    run_python(block(README, 'import numpy'), 'README.md')
    first, second = capsys.readouterr().out.splitlines()
    assert first.startswith("crank-rocker ['swing 27.307 deg (82.445 to 109.752 deg)'")
    assert 8.4 < float(first.split()[-3]) < 8.5
    assert 0 < float(second.split()[0]) < 1000
    assert len([line for line in block(README, 'import numpy').splitlines() if line]) <= 12
