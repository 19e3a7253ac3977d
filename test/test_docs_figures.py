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
FIGURES, REFERENCE = load_script('figures'), load_script('reference')
PAGE = read('docs/reference.md')


def content(name):
    return json.loads((DOCS / f'{name}.json').read_text())


# ---------------------------------------------------------------- what scripts make


def test_drawings_equal_those_that_the_code_makes(monkeypatch):
    monkeypatch.syspath_prepend(DOCS)
    drawn = {f'mechanism_{draw.__name__}.svg': draw for draw in import_module('drawings').DRAWINGS}
    assert {path.name for path in DOCS.glob('mechanism_*.svg')} == set(drawn)
    for name, draw in drawn.items():
        assert (DOCS / name).read_text() == draw().svg(), 'run python docs/drawings.py'
        assert f']({name})' in read('docs/mechanisms.md')


@pytest.mark.parametrize('page', [*FIGURES.TABLES, *REFERENCE.PAGES])
def test_tables_equal_those_that_the_code_makes(page):
    text = read(page)
    if page in FIGURES.TABLES:
        assert FIGURES.filled(page, text) == text, 'run python docs/figures.py'
    if page in REFERENCE.PAGES:
        assert REFERENCE.filled(text) == text, 'run python docs/reference.py'


def test_changed_row_is_detected():
    changed = PAGE.replace('| `rate_hz` | 0.01 to 100000 Hz | `200.0` |', '| `rate_hz` | Hz | - |')
    assert changed != PAGE
    assert REFERENCE.filled(changed) == PAGE


def test_every_table_has_a_place_on_a_page():
    places = re.findall(r'<!-- table: (\w+) -->', ''.join(map(read, REFERENCE.PAGES)))
    assert sorted(places) == sorted(REFERENCE.tables())


def test_pages_of_measurements_equal_those_that_the_code_makes(monkeypatch, tmp_path):
    for folder in ('peers', 'reliability'):
        monkeypatch.syspath_prepend(ROOT / 'benchmarks' / folder)
    assert import_module('report').markdown(content('peers')) == read('lab/docs/peers.md')
    assert import_module('timing_page').write(tmp_path) == read('docs/timing.md')
    assert (tmp_path / 'timing.png').is_file()


def test_reference_lists_every_parameter_topic_and_launch_file():
    """Includes parameters of classes that the script does not name."""
    for mechanism, drive in itertools.product(MECHANISMS, DRIVES):
        for leaf in parameter_leaves(MechanismAndDrive(mechanism, drive)):
            name = re.sub(r'^joints\.\w+', 'joints.<link>', leaf.name)
            assert f'\n| `{name}` | ' in PAGE
    for topic in (*TOPICS, CRANK_TRAJECTORY, JOINT_COMMANDS, MEASURED_JOINT_STATES):
        assert f'| `{qualified(topic)}` | ' in read('docs/mcap.md')
    for path in (ROOT / 'launch').glob('*.py'):
        assert f'### `{path.name}`' in PAGE
    # All declared arguments, whether in a loop or not.
    found = REFERENCE.launch_arguments(ROOT / 'launch' / 'controller.launch.py')
    assert found['rpm'] == ('150.0', 'speed to keep')
    assert {'rpm', 'feed_forward', 'log', 'viewer'} <= set(found)


# ---------------------------------------------------------------- quoted numbers


def agrees(shown, value):
    """Returns whether a number is the measured value, rounded to the digits shown."""
    least = Fraction(10) ** -len(shown.partition('.')[2])
    if '.' not in shown:
        least = Fraction(10) ** (len(shown) - len(shown.rstrip('0')))
    return abs(Fraction(shown) - Fraction(value)) <= least * Fraction(51, 100)


def quoted():
    """Returns the measured numbers of each page."""
    soak, killed = (content('reliability')[name] for name in ('soak', 'killed'))
    lost = sorted(kill['lost'] for kill in killed['runs'])
    right = {
        one['peer']: one['states'].get('right', 0)
        for one in content('peers')['outcomes']
        if one['situation'] == 'near a change point'
    }
    engines = max(right[f'{name}{start}'] for name in ('MuJoCo', 'Pinocchio')
                  for start in ('', ', cold'))  # fmt: skip
    alone, fed, *_ = content('controller')
    settled = content('wind_pump_settled')['records'][0]['states']
    return {
        'docs/reliability.md': [
            *map(soak.get, ('growth_MiB', 'published', 'missed')), lost[0], lost[-1],
            (lost[9] + lost[10]) / 2,
        ],
        'README.md': [
            *map(right.get, ('linkage_ros', 'pylinkage', 'SymPy lambdify')), engines,
            *(100 * one['p99_ripple'] for one in (fed, alone)), len(lost), lost[-1],
        ],
        'docs/mcap.md': [LARGEST >> 20, writer.CHUNK_SIZE >> 20],
        'config/wind_pump.yaml': [
            state[name] for state in settled if state['stable'] for name in ('speed', 'stroke')
        ],
    }  # fmt: skip


def check_numbers(page, values):
    """Asserts that each value is on a page, rounded; the sentences around them may change."""
    numbers = re.findall(r'\d+(?:\.\d+)?', read(page))
    for value in values:
        exact = [x for x in numbers if '.' in x or value >= 100 or Fraction(x) == value]
        assert any(agrees(shown, value) for shown in exact), f'{page} has not {value}'


def test_figures_of_the_pages_are_measured():
    for page, values in quoted().items():
        check_numbers(page, values)


def test_wrong_number_is_detected():
    assert agrees('0.110', 0.11017)
    assert agrees('690', 693.5)
    assert not agrees('0.110', 0.1107)
    assert not agrees('151', 151.6)
    with pytest.raises(AssertionError, match=r'has not 66\.6'):
        check_numbers('README.md', [66.6])
