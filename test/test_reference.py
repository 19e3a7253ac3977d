# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""docs/reference.md lists what the code declares."""

from __future__ import annotations

import itertools
import re
from dataclasses import MISSING

import pytest
from pages import ROOT, load_reference, read

from linkage_ros.model.registry import MECHANISMS
from linkage_ros.parameters.configuration import MechanismAndDrive, parameter_leaves
from linkage_ros.parameters.drives import DRIVES
from linkage_ros.quantities import Leaf, Quantity

PAGE = read('docs/reference.md')


@pytest.fixture(scope='module')
def reference():
    return load_reference()


def test_the_tables_are_those_of_the_declarations(reference):
    assert reference.filled(PAGE) == PAGE, 'run python docs/reference.py'


def test_every_table_has_a_place_on_the_page(reference):
    places = re.findall(r'<!-- table: (\w+) -->', PAGE)
    assert sorted(places) == sorted(reference.tables())
    assert PAGE.count('<!-- end -->') == len(places)


def test_a_changed_row_is_found(reference):
    changed = PAGE.replace('| `rate_hz` | 0.01 to 100000 Hz | `200.0` |', '| `rate_hz` | Hz | - |')
    assert changed != PAGE
    assert reference.filled(changed) == PAGE


def test_every_parameter_is_listed():
    """Also one of a class that the script does not know."""
    kinds = itertools.product(MECHANISMS, DRIVES)
    for mechanism, drive in kinds:
        for leaf in parameter_leaves(MechanismAndDrive(mechanism, drive)):
            assert f'\n| `{leaf.name}` | ' in PAGE


def test_every_launch_file_is_listed_with_its_arguments(reference):
    for path in (ROOT / 'launch').glob('*.py'):
        assert f'### `{path.name}`' in PAGE
    found = reference.launch_arguments(ROOT / 'launch' / 'controller.launch.py')
    assert found['rpm'] == ('150.0', 'speed to keep')
    # All that is declared, in a loop or not.
    assert {'rpm', 'feed_forward', 'log', 'viewer'} <= set(found)


@pytest.mark.parametrize(
    ('quantity', 'default', 'row'),
    [
        (Quantity('number', 'm', 'N m', 0.0, 1e12), 1e12, ('0 to 1e12 N m', '`1.0e12`', 'm')),
        (Quantity('number', 'm', 'm', 1e-9, 1e9), MISSING, ('1e-9 to 1e9 m', 'required', 'm')),
        (Quantity('pair', 'm', 'm', 0.0, 1.0), (0.0, 1.0), ('two, 0 to 1 m', '`[0.0, 1.0]`', 'm')),
        (Quantity('pair', 'm', 'm', -1.0, 1.0), None, ('two, -1 to 1 m', '-', 'm')),
        (Quantity('text', 'm'), '', ('text', "`''`", 'm')),
        (Quantity('switch', 'm'), False, ('`true`, `false`', '`false`', 'm')),
        (Quantity('choice', 'm', choices=('a', 'b')), 'a', ('`a`, `b`', '`a`', 'm')),
        (
            Quantity('number', 'm', '', 0.0, 1.0, live=True), 0.0,
            ('0 to 1', '`0.0`', 'm; may be set while the node runs'),
        ),
    ],
)  # fmt: skip
def test_a_row_has_values_default_and_meaning(reference, quantity, default, row):
    assert reference.parameter_row(Leaf('name', quantity, default)) == ('`name`', *row)
