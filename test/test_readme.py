# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the README and the CHANGELOG say is what the code does."""

from __future__ import annotations

import re
from dataclasses import MISSING

import pytest
from pages import ROOT, block, read, run_python

from linkage_ros.core.mechanism import MECHANISMS
from linkage_ros.run.configuration import Kind, parameter_leaves
from linkage_ros.wire.messages import TOPICS

README = read('README.md')


def rows_of(mechanism):
    rows = []
    kind = Kind(mechanism, 'torque' if mechanism == 'wind_pump' else 'speed')
    for name, quantity, default in parameter_leaves(kind):
        unit = f', {quantity.unit}' if quantity.unit else ''
        if default is MISSING:
            shown = 'required'
        elif default is None:
            shown = '-'
        else:
            shown = f'`{list(default) if isinstance(default, tuple) else default!r}`'
            shown = {'`True`': '`true`', '`False`': '`false`'}.get(shown, shown)
        rows.append(f'| `{name}` | {quantity.kind}{unit} | {shown} | {quantity.meaning} |')
    return rows


@pytest.mark.parametrize('mechanism', MECHANISMS)
def test_the_parameter_tables_are_the_code_s(mechanism):
    """The first is a four-bar's; other mechanisms have what differs from it."""
    rows, first = rows_of(mechanism), rows_of('four_bar')
    table = '\n'.join(row for row in rows if mechanism == 'four_bar' or row not in first)
    assert table in README, f'README.md should hold\n{table}'


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
