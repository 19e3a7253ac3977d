# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Drawings and tables of the pages equal those made by the code; quoted numbers were measured."""

import itertools
import json
import re
from fractions import Fraction
from importlib import import_module

import pytest
from pages import ROOT, load_script, read

from linkage_lab.methods.linkage_cases import NEAR, TOGGLE
from linkage_lab.methods.registry import DEFAULT, INTEGRATORS, LIVE, RECORDS
from linkage_ros.log import writer
from linkage_ros.log.scan import LARGEST
from linkage_ros.mechanism.registry import MECHANISMS
from linkage_ros.messages.topics import (
    CRANK_TRAJECTORY,
    JOINT_COMMANDS,
    MEASURED_JOINT_STATES,
    TOPICS,
    qualified,
)
from linkage_ros.motion.drives import DRIVES
from linkage_ros.settings.parameters import MechanismAndDrive, parameter_leaves

DOCS = ROOT / 'docs'


def test_drawings_equal_those_that_the_code_makes(monkeypatch):
    monkeypatch.syspath_prepend(DOCS)
    drawings = import_module('drawings').DRAWINGS
    assert {path.stem for path in DOCS.glob('mechanism_*.svg')} == {
        f'mechanism_{draw.__name__}' for draw in drawings
    }
    for draw in drawings:
        name = f'mechanism_{draw.__name__}.svg'
        assert (DOCS / name).read_text() == draw().svg(), 'run python docs/drawings.py'
        assert f']({name})' in read('docs/mechanisms.md')


# ---------------------------------------------------------------- numbers


def content(name):
    return json.loads((DOCS / f'{name}.json').read_text())


def measured(name):
    found = content(name)
    return found['records'] if isinstance(found, dict) else found


def agrees(shown, value):
    """Returns whether a number is the measured value, rounded to the digits shown."""
    least = Fraction(10) ** -len(shown.partition('.')[2])
    if '.' not in shown:
        least = Fraction(10) ** (len(shown) - len(shown.rstrip('0')))
    return abs(Fraction(shown) - Fraction(value)) <= least * Fraction(51, 100)


def check_numbers(page, *values):
    """Asserts that each value is on a page, rounded; the sentences around them may change."""
    for value in values:
        numbers = re.findall(r'\d+(?:\.\d+)?', read(page))
        exact = [x for x in numbers if '.' in x or value >= 100 or Fraction(x) == value]
        assert any(agrees(shown, value) for shown in exact), f'{page} has not {value}'


def test_follower_gave_the_states_of_the_reference():
    for one in content('follow').values():
        assert (one['difference'], one['error'] <= 1e-12) == ('', True)
        assert one['follow']['missed'] == one['speed']['missed']


def test_figures_of_the_reliability_page_are_measured():
    soak, killed = (content('reliability')[name] for name in ('soak', 'killed'))
    lost = sorted(kill['lost'] for kill in killed['runs'])
    values = *map(soak.get, ('growth_MiB', 'published', 'missed')), lost[0], lost[-1]
    check_numbers('docs/reliability.md', *values, (lost[9] + lost[10]) / 2)


def test_figures_of_the_readme_are_measured():
    right = {
        one['peer']: one['states'].get('right', 0)
        for one in content('peers')['outcomes']
        if one['situation'] == 'near a change point'
    }
    engines = max(right[f'{name}{start}'] for name in ('MuJoCo', 'Pinocchio')
                  for start in ('', ', cold'))  # fmt: skip
    runs = content('reliability')['killed']['runs']
    alone, fed = measured('controller')[:2]
    errors = [100 * one['p99_ripple'] for one in (fed, alone)]
    values = *map(right.get, ('linkage_ros', 'pylinkage', 'SymPy lambdify')), engines, *errors
    check_numbers('README.md', *values, len(runs), max(run['lost'] for run in runs))


@pytest.fixture(scope='module')
def figures():
    return load_script('figures')


def test_tables_of_the_pages_equal_the_json(figures):
    for name in figures.TABLES:
        page = read(name)
        assert figures.filled(name, page) == page, 'run python docs/figures.py'


def test_conclusions_of_methods_follow_from_the_measurements():
    points, cells = measured('accuracy'), measured('stability')
    times = {}
    for point in points:
        if point['mechanism'] == NEAR:
            right = point['max_error'] is not None and point['max_error'] < 1e-6
            assert right == (point['method'] == DEFAULT), point
        elif point['method'] == DEFAULT:
            # A steep load and a toggle magnify rounding errors.
            limit = {'six_bar': 1e-13, TOGGLE: 1e-9}.get(point['mechanism'], 2e-15)
            assert point['max_error'] < limit, point
        if point['mechanism'] == 'quadrilateral':
            key = point['method'], point['quantity'], point['mode']
            times.setdefault(key, point['us_per_state'])
    for method, quantity, mode, share in (
        ('two circles', 'position', 'one at a time', 1 / 2),
        ('two circles', 'position', 'batch', 0.7),
        ('two circles', 'torque', 'batch', 0.85),
        ('factored, float32', 'torque', 'batch', 2 / 3),
    ):
        assert times[method, quantity, mode] < share * times[DEFAULT, quantity, mode]
    wrong = {cell['method'] for cell in cells if cell['outcome'] != 'right'}
    assert {method.name for method in INTEGRATORS} - wrong == {LIVE, RECORDS}


def test_mcap_page_matches_channels_and_sizes_of_the_code():
    page = read('docs/mcap.md')
    for topic in (*TOPICS, CRANK_TRAJECTORY, JOINT_COMMANDS, MEASURED_JOINT_STATES):
        assert f'| `{qualified(topic)}` | ' in page
    check_numbers('docs/mcap.md', LARGEST >> 20, writer.CHUNK_SIZE >> 20)


def test_figures_in_the_pump_preset_are_measured():
    slow, fast = (state for state in measured('wind_pump_settled')[0]['states'] if state['stable'])
    values = [one[name] for one in (slow, fast) for name in ('speed', 'stroke')]
    check_numbers('config/wind_pump.yaml', *values)


def test_generated_pages_match_their_json(monkeypatch):
    monkeypatch.syspath_prepend(ROOT / 'benchmarks' / 'peers')
    assert import_module('report').markdown(content('peers')) == read('lab/docs/peers.md')


def test_timing_picture_is_drawn_next_to_its_page(monkeypatch, tmp_path):
    monkeypatch.syspath_prepend(ROOT / 'benchmarks' / 'reliability')
    assert import_module('timing_page').write(tmp_path) == read('docs/timing.md')
    assert sorted(path.name for path in tmp_path.iterdir()) == ['timing.md', 'timing.png']
    assert '](timing.png)' in read('docs/timing.md')


def test_wrong_number_is_detected():
    assert agrees('0.110', 0.11017)
    assert agrees('690', 693.5)
    assert not agrees('0.110', 0.1107)
    assert not agrees('151', 151.6)
    with pytest.raises(AssertionError, match=r'has not 66\.6'):
        check_numbers('README.md', 66.6)


# ---------------------------------------------------------------- the reference pages

PAGE = read('docs/reference.md')


@pytest.fixture(scope='module')
def reference():
    return load_script('reference')


def test_tables_match_the_declarations(reference):
    for name in reference.PAGES:
        page = read(name)
        assert reference.filled(page) == page, 'run python docs/reference.py'


def test_every_table_has_a_place_on_a_page(reference):
    pages = ''.join(map(read, reference.PAGES))
    places = re.findall(r'<!-- table: (\w+) -->', pages)
    assert sorted(places) == sorted(reference.tables())
    assert pages.count('<!-- end -->') == len(places)


def test_changed_row_is_detected(reference):
    changed = PAGE.replace('| `rate_hz` | 0.01 to 100000 Hz | `200.0` |', '| `rate_hz` | Hz | - |')
    assert changed != PAGE
    assert reference.filled(changed) == PAGE


def test_every_parameter_is_listed():
    """Includes parameters of classes that the script does not name."""
    kinds = itertools.product(MECHANISMS, DRIVES)
    for mechanism, drive in kinds:
        for leaf in parameter_leaves(MechanismAndDrive(mechanism, drive)):
            name = re.sub(r'^joints\.\w+', 'joints.<link>', leaf.name)
            assert f'\n| `{name}` | ' in PAGE


def test_every_launch_file_is_listed_with_its_arguments(reference):
    for path in (ROOT / 'launch').glob('*.py'):
        assert f'### `{path.name}`' in PAGE
    found = reference.launch_arguments(ROOT / 'launch' / 'controller.launch.py')
    assert found['rpm'] == ('150.0', 'speed to keep')
    # All declared arguments, whether in a loop or not.
    assert {'rpm', 'feed_forward', 'log', 'viewer'} <= set(found)
