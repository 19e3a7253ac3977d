# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_chart accuracy as a command, and the page that shows what it and stability made."""

from __future__ import annotations

import itertools
import json
import math
import re
import subprocess
import sys
from pathlib import Path

import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text
from test_chart import chart

from linkage_ros import __version__
from linkage_ros.lab.charts.accuracy import draw_accuracy, draw_integration
from linkage_ros.lab.charts.stability import draw_stability
from linkage_ros.lab.methods.accuracy import MEAN, NEAR, MIN_RATE, Measurement
from linkage_ros.lab.methods.bench import LIMIT
from linkage_ros.lab.methods.chain import BATCH, ONE, OWN, QUANTITIES
from linkage_ros.lab.methods.motion_bench import ENERGY, TRAJECTORY
from linkage_ros.lab.methods.motion_situations import MOTION_SITUATIONS
from linkage_ros.lab.methods.outcomes import OUTCOMES, Cell
from linkage_ros.lab.methods.registry import DEFAULT, INTEGRATORS, METHODS, label
from linkage_ros.lab.methods.situations import SITUATIONS

EPSILON = 2.0**-52
EVERY = {method.name for method in (*METHODS, *INTEGRATORS)}
PLACES = {situation.name for situation in (*SITUATIONS, *MOTION_SITUATIONS)}


def committed(name):
    """The records in the docs."""
    path = Path(__file__).parents[1] / 'docs' / f'{name}.json'
    return json.loads(path.read_text())['records']


def run_quick(command, folder):
    done = subprocess.run(
        [sys.executable, '-m', 'linkage_ros.chart_tool', command, '--quick', '--out', folder],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, '')
    written = [Path(line) for line in done.stdout.splitlines()]
    assert written == sorted(written, key=written.index)
    assert set(written) == set(folder.iterdir())
    for path in written:
        if path.suffix == '.png':
            assert path.read_bytes().startswith(b'\x89PNG')
            assert path.stat().st_size > 50_000
    (records,) = (path for path in written if path.suffix == '.json')
    content = json.loads(records.read_text(), parse_constant=pytest.fail)
    assert content['about']['linkage_ros'] == __version__
    return written, content['records']


@pytest.fixture(scope='module')
def accuracy(tmp_path_factory):
    """Paths and records of one quick run: half a minute, so that all tests look at the same."""
    return run_quick('accuracy', tmp_path_factory.mktemp('accuracy'))


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
    names = ('quadrilateral', 'slider_crank', 'near_a_change_point', 'motions')
    assert [path.name for path in written] == [
        'accuracy.json',
        *(f'accuracy_{name}.png' for name in names),
    ]
    assert {record['method'] for record in records} == EVERY
    assert all(record['us_per_state'] is None or record['us_per_state'] > 0 for record in records)
    panels = {(r['mechanism'], r['quantity'], r['mode']) for r in records}
    assert len(panels) == 3 * 4 * 2 + 2 * 3
    for panel in panels:
        of_panel = [r for r in records if (r['mechanism'], r['quantity'], r['mode']) == panel]
        front = [r for r in of_panel if r['pareto']]
        assert front
        assert all(r['max_error'] <= LIMIT for r in front)
        if panel[0] == NEAR:
            assert [r['method'] for r in front] == [DEFAULT]


def test_every_integrator_is_measured_at_every_setting(errors):
    for mechanism in ('wind_pump', 'quadrilateral'):
        for quantity in (TRAJECTORY, ENERGY):
            for method in INTEGRATORS:
                settings = [label(setting) for setting in method.settings]
                assert list(errors[mechanism, quantity, method.name, MEAN]) == settings
                assert (mechanism, TRAJECTORY, method.name, MIN_RATE) in errors


def steady_error(errors, mechanism, quantity, method, mode):
    return errors[mechanism, quantity, method.name, mode][label(method.steady)]


@pytest.mark.parametrize('mechanism', ['quadrilateral', 'slider_crank'])
def test_every_method_is_right_on_an_easy_mechanism(errors, mechanism):
    limits = {'factored, float32': 1e-5, 'central differences': 2e-6}
    if mechanism == 'slider_crank':
        limits['half-angle'] = 1e-9  # near alpha = 0 its denominator is small
    for method in METHODS:
        for mode, quantity in itertools.product(method.modes, OWN[method.stage]):
            error = steady_error(errors, mechanism, quantity, method, mode)
            assert error < limits.get(method.name, 1e-11), (method.name, mode, quantity)


@pytest.mark.parametrize('mechanism', ['quadrilateral', 'slider_crank'])
def test_errors_fall_with_each_setting_down_to_a_floor(errors, mechanism):
    methods = [method for method in METHODS if len(method.settings) > 1]
    assert len(methods) == 5
    for method in methods:
        mode = BATCH if BATCH in method.modes else ONE
        settings = [label(s) for s in method.settings if s.get('steps', 360) == 360]
        for quantity in OWN[method.stage]:
            found = [errors[mechanism, quantity, method.name, mode][s] for s in settings]
            floor = found.index(min(found))
            # On the floor, and beyond it where differences lose digits, rounding counts.
            down = [max(error, 20 * EPSILON) for error in found[: floor + 1]]
            assert all(b < a or b == 20 * EPSILON for a, b in itertools.pairwise(down)), found
            limit = 1e-6 if method.name.startswith('central') else 1e-14
            assert down[-1] < limit, (method.name, found)


def test_the_default_is_as_close_as_any_to_a_few_ulp(errors):
    for mechanism, mode in itertools.product(('quadrilateral', 'slider_crank'), (ONE, BATCH)):
        for quantity in QUANTITIES:
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


@pytest.mark.parametrize('command', ['accuracy', 'stability'])
def test_a_folder_that_cannot_be_made_is_one_line(tmp_path, monkeypatch, capsys, command):
    (tmp_path / 'file').write_text('')
    assert chart(monkeypatch, command, '--out', tmp_path / 'file') == 2
    expected = f'linkage_chart: {tmp_path / "file"} is no folder: name another\n'
    assert capsys.readouterr().err == expected


def test_every_method_and_situation_has_its_place_in_the_docs():
    page = Path(__file__).parents[1].joinpath('docs', 'methods.md').read_text()
    for method in METHODS:
        computes = {'state': 'everything'}.get(method.stage, method.stage)
        row = rf'\| {re.escape(method.name)} \| {computes} \| .* \| (.*) \| (.*) \|\n'
        assert re.findall(row, page) == [(method.needs, method.source)]
    for method in INTEGRATORS:
        row = rf'\| {re.escape(method.name)} \| {method.stage} \| .* \| (.*) \| (.*) \|\n'
        assert re.findall(row, page) == [(method.needs, method.source)]
    for outcome in OUTCOMES:
        assert f'| {outcome} | ' in page
    for situation in (*SITUATIONS, *MOTION_SITUATIONS):
        assert f'| {situation.name} | {situation.words} |' in page


def test_the_charts_of_the_docs_are_of_these_methods_and_situations():
    records = committed('stability')
    assert {r['method'] for r in records} == EVERY
    assert {r['situation'] for r in records} == PLACES
    assert {r['method'] for r in committed('accuracy')} == EVERY


# ---------------------------------------------------------------- how they look


@pytest.fixture(scope='module')
def redrawn():
    """The charts of the docs as figures, from the numbers in the docs: nothing is measured."""
    pages = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Figure, 'savefig', lambda figure, _: pages.append(figure))
        draw_all()
    assert len(pages) == 5
    return pages


def draw_all():
    unknown = {'max_error': math.inf, 'us_per_state': math.inf}  # null in JSON
    points = [
        Measurement(
            **{name: unknown[name] if value is None else value for name, value in one.items()}
        )
        for one in committed('accuracy')
    ]
    solved = [point for point in points if point.mode not in (MEAN, MIN_RATE)]
    for name in dict.fromkeys(point.mechanism for point in solved):
        draw_accuracy([p for p in solved if p.mechanism == name], name, Path(name))
    draw_integration([p for p in points if p.mode in (MEAN, MIN_RATE)], 'it', Path())
    cells = [Cell(**record) for record in committed('stability')]
    own = {situation.name for situation in SITUATIONS}
    draw_stability(
        [cell for cell in cells if cell.situation in own],
        [cell for cell in cells if cell.situation not in own], 'it', Path(),
    )  # fmt: skip


def test_charts_can_be_read_at_half_their_size(redrawn):
    for figure in redrawn:
        pixels = 700 / figure.get_figwidth() / 72  # of a point
        sizes = [text.get_fontsize() * pixels for text in figure.findobj(Text) if text.get_text()]
        assert min(sizes) > 7.9
