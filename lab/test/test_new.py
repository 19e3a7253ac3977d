# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_chart new: parameter files to start from."""

import re
from dataclasses import fields

import pytest
from ros_harness import assert_refused

from linkage_lab import command_line
from linkage_lab.charts.new import STARTS, parameter_file
from linkage_lab.command_line import KINDS
from linkage_ros import Solver
from linkage_ros.mechanism.registry import MECHANISMS
from linkage_ros.settings.configuration import load


def test_there_is_a_file_for_every_mechanism():
    assert [*STARTS] == [*KINDS] == [*MECHANISMS]


@pytest.mark.parametrize('kind', KINDS)
def test_file_loads_and_states_all_defaults(tmp_path, kind):
    path = tmp_path / 'new.yaml'
    text = parameter_file(kind)
    path.write_text(text)
    found = load(str(path))
    solver = Solver(found.mechanism)
    assert solver.mobility is None or solver.mobility.turns_fully
    # Without the # before each default, the file means the same.
    head, tail = text.split('\n\n    # Also')
    lines = [
        re.sub(r'^    # (?= *\w+:)', '    ', line)
        for line in head.split('\n')
        if not re.search(r'\w: +#', line)  # no default
    ]
    path.write_text('\n'.join(lines))
    same = load(str(path))
    for field in fields(found):
        assert getattr(same, field.name) == getattr(found, field.name)
    assert len(re.findall(r'^    # ', head, re.MULTILINE)) > 10
    assert re.findall(r'kind: (\w+)', tail)


def test_unknown_kind_is_refused_with_the_known_ones(called):
    assert_refused(*called(command_line, 'new', 'fivebar'), 'slider_crank')
