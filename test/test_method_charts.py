# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_chart accuracy as a command, and the page that shows what it and stability made."""

import itertools
import json
import math
import sys
from pathlib import Path

import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text
from pages import ROOT, read

from linkage_ros import __version__, chart_tool
from linkage_ros.lab.commands.accuracy import draw_accuracy, draw_follow
from linkage_ros.lab.commands.stability import GRIDS, draw_stability
from linkage_ros.lab.methods.accuracy import NEAR
from linkage_ros.lab.methods.measure import BATCH, LIMIT, ONE, OUTCOMES, label
from linkage_ros.lab.methods.motion_cases import ENERGY, MEAN, SLOWEST, TRAJECTORY
from linkage_ros.lab.methods.registry import DEFAULT, INTEGRATORS, METHODS
from linkage_ros.lab.methods.stages import OWN, QUANTITIES

EPSILON = 2.0**-52
EVERY = {method.name for method in (*METHODS, *INTEGRATORS)}
EASY = 'quadrilateral', 'slider_crank'
LISTING = "document 1's listing"
each_easy = pytest.mark.parametrize('mechanism', EASY)


def committed(name):
    """The records in the docs."""
    return json.loads((ROOT / 'docs' / f'{name}.json').read_text())['records']


def run_quick(command, folder):
    """What the command prints and writes: paths, and records."""
    printed = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, 'argv', ['linkage_chart', command, '--quick', '--out', str(folder)])
        patch.setattr('builtins.print', lambda *lines, **_: printed.extend(lines))
        assert chart_tool.main() == 0
    assert set(printed) == set(folder.iterdir())
    for path in set(printed) - {*folder.glob('*.json')}:
        assert path.read_bytes().startswith(b'\x89PNG')
        assert path.stat().st_size > 50_000
    content = json.loads(printed[0].read_text(), parse_constant=pytest.fail)
    assert content['about']['linkage_ros'] == __version__
    return [path.name for path in printed], content['records']


@pytest.fixture(scope='module')
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp('accuracy')


@pytest.fixture(scope='module')
def accuracy(folder):
    """Names of files, and records, of one quick run."""
    return run_quick('accuracy', folder)


@pytest.fixture(scope='module')
def errors(accuracy):
    """The errors of all settings in turn, by mechanism, quantity, method and mode."""
    found = {}
    for r in accuracy[1]:
        key = r['mechanism'], r['quantity'], r['method'], r['mode']
        error = math.inf if r['max_error'] is None else r['max_error']
        found.setdefault(key, {})[r['setting']] = error
    return found


def test_every_panel_has_a_front_of_right_points(accuracy):
    written, records = accuracy
    pictures = (*EASY, 'near_a_change_point', 'motions')
    pictures = [f'accuracy_{name}.png' for name in pictures]
    assert written == ['accuracy.json', *pictures, 'accuracy_follow.json', 'accuracy_follow.png']
    assert {record['method'] for record in records} == EVERY
    assert all(record['us_per_state'] is None or record['us_per_state'] > 0 for record in records)
    panels = {}
    for r in records:
        panels.setdefault((r['mechanism'], r['quantity'], r['mode']), []).append(r)
    assert len(panels) == 3 * 4 * 2 + 2 * 3
    for points in panels.values():
        front = [r['max_error'] for r in points if r['pareto']]
        assert 0 <= max(front) <= LIMIT


def test_every_integrator_is_measured_at_every_setting(errors):
    kinds = itertools.product(('wind_pump', 'quadrilateral'), (TRAJECTORY, ENERGY), INTEGRATORS)
    for mechanism, quantity, method in kinds:
        settings = [label(setting) for setting in method.settings]
        assert list(errors[mechanism, quantity, method.name, MEAN]) == settings
        # Only steps up to a ms have a slowest ms.
        short = [label(s) for s in method.settings if s.get('step', 0) <= 1e-3]
        assert list(errors[mechanism, TRAJECTORY, method.name, SLOWEST]) == short


def test_a_followed_crank_is_off_as_in_the_docs(accuracy, folder):
    """Nothing of it depends on the machine: the numbers of the docs are these."""
    assert accuracy
    records = json.loads((folder / 'accuracy_follow.json').read_text())['records']
    known, found = (
        {tuple(key): error for *key, error in map(dict.values, kept)}
        for kept in (committed('accuracy_follow'), records)
    )
    assert len(found) == 3 * 2 * 3
    assert found == pytest.approx({key: known[key] for key in found}, rel=1e-6)


@each_easy
def test_every_method_is_right_on_an_easy_mechanism(errors, mechanism):
    limits = {'factored, float32': 1e-5, 'central differences': 2e-6}
    if mechanism == 'slider_crank':
        limits['half-angle'] = 1e-9  # near alpha = 0 its denominator is small
    for method in METHODS:
        if method.name == LISTING:
            continue
        for mode, quantity in itertools.product(method.modes, OWN[method.stage]):
            error = errors[mechanism, quantity, method.name, mode][label(method.steady)]
            assert error < limits.get(method.name, 1e-11), (method.name, mode, quantity)


@each_easy
@pytest.mark.parametrize(
    'method', [m for m in METHODS if len(m.settings) > 1], ids=lambda method: method.name
)
def test_errors_fall_with_each_setting_down_to_a_floor(errors, mechanism, method):
    settings = [label(setting) for setting in method.settings]
    for quantity in OWN[method.stage]:
        by_setting = errors[mechanism, quantity, method.name, method.modes[-1]]
        found = [by_setting[setting] for setting in settings]
        # On the floor, and beyond it where differences lose digits, rounding counts.
        down = [max(error, 20 * EPSILON) for error in found[: found.index(min(found)) + 1]]
        assert all(b < a or b == 20 * EPSILON for a, b in itertools.pairwise(down)), found
        assert down[-1] < (1e-6 if method.name.startswith('central') else 1e-14), found


def test_the_default_is_as_close_as_any_to_a_few_ulp(errors):
    for mechanism, mode, quantity in itertools.product(EASY, (ONE, BATCH), QUANTITIES):
        best = {
            method: min(found.values())
            for (*place, method, asked), found in errors.items()
            if (*place, asked) == (mechanism, quantity, mode)
        }
        assert best[DEFAULT] <= min(best.values()) + 4 * EPSILON, best


def test_near_a_change_point_the_default_alone_is_right(errors):
    near = {key: found for key, found in errors.items() if key[0] == NEAR}
    assert {method for _, _, method, _ in near} == {method.name for method in METHODS}
    for (_, _, method, _), found in near.items():
        for setting, error in found.items():
            right = method == DEFAULT
            assert (error < LIMIT) == (error < 1e-12) == right, (method, setting, error)


def test_every_outcome_is_explained_in_the_docs():
    page = read('docs/methods.md')
    assert all(f'| {outcome} | ' in page for outcome in OUTCOMES)


def test_the_charts_of_the_docs_are_of_these_methods_and_situations():
    records = committed('stability')
    cells = {(m.name, s.name) for methods, places in GRIDS for m in methods for s in places}
    assert {(r['method'], r['situation']) for r in records} == cells
    assert {r['method'] for r in committed('accuracy')} == EVERY


def test_charts_can_be_read_at_half_their_size(monkeypatch):
    """The charts of the docs, from the numbers in the docs: nothing is measured."""
    figures = []
    monkeypatch.setattr(Figure, 'savefig', lambda figure, _: figures.append(figure))
    points = committed('accuracy')
    draw_accuracy([p for p in points if p['mechanism'] == NEAR], 'it', Path())
    draw_accuracy([p for p in points if p['mode'] in (MEAN, SLOWEST)], 'it', Path())
    draw_stability(committed('stability'), 'it', Path())
    draw_follow(committed('accuracy_follow'), 'it', Path())
    for figure in figures:
        pixels = 700 / figure.get_figwidth() / 72  # of a point
        sizes = [text.get_fontsize() * pixels for text in figure.findobj(Text) if text.get_text()]
        assert min(sizes) > 7.9
