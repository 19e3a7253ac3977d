# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""docs/reference.md and the API reference list what the code declares."""

import itertools
import re

import pytest
from pages import ROOT, load_script, read

import linkage_ros
from linkage_ros.model.registry import MECHANISMS
from linkage_ros.parameters.configuration import MechanismAndDrive, parameter_leaves
from linkage_ros.parameters.drives import DRIVES

PAGE = read('docs/reference.md')


@pytest.fixture(scope='module')
def reference():
    return load_script('reference')


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


# ---------------------------------------------------------------- the API reference


def test_a_warning_ends_the_api_reference(tmp_path, monkeypatch):
    monkeypatch.setitem(linkage_ros.travel.__annotations__, 'solver', 'Unknown')
    with pytest.raises(UserWarning, match='Unknown'):
        load_script('api').write(tmp_path)


def test_the_api_reference_has_every_public_name(tmp_path):
    load_script('api').write(tmp_path)
    page = (tmp_path / 'linkage_ros.html').read_text()
    for name in linkage_ros.__all__:
        assert f'<section id="{name}">' in page
    assert 'id="Solver.state"' in page
