# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_chart accuracy as a command, and the page that shows what it and stability made."""

from __future__ import annotations

import itertools
import json
import math
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text

from linkage_ros import __version__
from linkage_ros.charts.accuracy import draw_accuracy
from linkage_ros.charts.integration import draw_integration
from linkage_ros.charts.stability import draw_stability
from linkage_ros.methods.accuracy import NEAR, Measurement
from linkage_ros.methods.bench import LIMIT
from linkage_ros.methods.motion_accuracy import MEAN, SLOWEST
from linkage_ros.methods.motion_bench import ENERGY, TRAJECTORY
from linkage_ros.methods.motion_situations import MOTION_SITUATIONS
from linkage_ros.methods.outcomes import OUTCOMES, Cell
from linkage_ros.methods.registry import DEFAULT, INTEGRATORS, METHODS, label
from linkage_ros.methods.situations import SITUATIONS
from linkage_ros.parameters.presets import preset_path

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


def test_speed_against_accuracy(tmp_path):
    written, records = run_quick('accuracy', tmp_path)
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

    moved = [r for r in records if r['mode'] in (MEAN, SLOWEST)]
    names = {method.name for method in INTEGRATORS}
    for mechanism in ('wind_pump', 'quadrilateral'):
        for quantity, mode in ((TRAJECTORY, MEAN), (ENERGY, MEAN), (TRAJECTORY, SLOWEST)):
            panel = (mechanism, quantity, mode)
            of_panel = [r for r in moved if (r['mechanism'], r['quantity'], r['mode']) == panel]
            assert {r['method'] for r in of_panel} == names
            if mode == MEAN:
                settings = [r['setting'] for r in of_panel]
                assert settings == [label(s) for m in INTEGRATORS for s in m.settings]


@pytest.mark.parametrize('command', ['accuracy', 'stability'])
def test_a_folder_that_cannot_be_made_is_one_line(tmp_path, command):
    (tmp_path / 'file').write_text('')
    done = subprocess.run(
        [sys.executable, '-m', 'linkage_ros.chart_tool', command, '--out', tmp_path / 'file'],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 2
    assert done.stderr == f'linkage_chart: {tmp_path / "file"} is no folder: name another\n'


@pytest.mark.parametrize('command', ['accuracy', 'stability'])
def test_a_preset_of_another_kind_is_one_line(tmp_path, command):
    config = tmp_path / 'share' / 'linkage_ros' / 'config'
    config.mkdir(parents=True)
    (hiding := config / 'quadrilateral.yaml').symlink_to(preset_path('slider_crank'))
    done = subprocess.run(
        [sys.executable, '-m', 'linkage_ros.chart_tool', command, '--out', tmp_path / 'out'],
        env={**os.environ, 'AMENT_PREFIX_PATH': str(tmp_path)},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 2
    assert done.stderr == (
        f'linkage_chart: {hiding} describes a slider_crank in place of the '
        "package's quadrilateral: rename it\n"
    )
    assert not (tmp_path / 'out').exists()


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


def redrawn(monkeypatch):
    """The charts of the docs as figures, from the numbers in the docs: nothing is measured."""
    pages = []
    monkeypatch.setattr(Figure, 'savefig', lambda figure, _: pages.append(figure))
    unknown = {'max_error': math.inf, 'us_per_state': math.inf}  # null in JSON
    points = [
        Measurement(
            **{name: unknown[name] if value is None else value for name, value in one.items()}
        )
        for one in committed('accuracy')
    ]
    solved = [point for point in points if point.mode not in (MEAN, SLOWEST)]
    for name in dict.fromkeys(point.mechanism for point in solved):
        draw_accuracy([p for p in solved if p.mechanism == name], name, Path(name))
    draw_integration([p for p in points if p.mode in (MEAN, SLOWEST)], 'it', Path())
    cells = [Cell(**record) for record in committed('stability')]
    own = {situation.name for situation in SITUATIONS}
    draw_stability(
        [cell for cell in cells if cell.situation in own],
        [cell for cell in cells if cell.situation not in own], 'it', Path(),
    )  # fmt: skip
    assert len(pages) == 5
    return pages


def overlaps(figure):
    """Pairs of texts in the panels of a figure that hide each other, or leave the picture."""
    figure.draw_without_rendering()
    for axes in figure.axes:
        places = [(text.get_text(), text.get_window_extent()) for text in axes.texts]
        for (one, box), (other, place) in itertools.combinations(places, 2):
            if box.overlaps(place):
                yield one, other
        for words, box in places:
            if not (figure.bbox.x0 < box.x0 and box.x1 < figure.bbox.x1):
                yield words, 'the edge'


def test_charts_can_be_read_at_half_their_size(monkeypatch):
    for figure in redrawn(monkeypatch):
        pixels = 700 / figure.get_figwidth() / 72  # of a point
        sizes = [text.get_fontsize() * pixels for text in figure.findobj(Text) if text.get_text()]
        assert min(sizes) > 7.9
        assert list(overlaps(figure)) == []


def test_settings_hide_neither_points_nor_lines(monkeypatch):
    for figure in redrawn(monkeypatch)[:2]:
        figure.draw_without_rendering()
        for axes in figure.axes:
            boxes = [text.get_window_extent() for text in axes.texts]
            assert len(boxes) >= 3
            for line in axes.lines:
                path = line.get_transform().transform_path(line.get_path())
                assert not any(path.intersects_bbox(box, filled=False) for box in boxes)
                assert not any(box.contains(*point) for box in boxes for point in path.vertices)


def test_letters_that_hide_each_other_are_seen():
    figure = Figure()
    axes = figure.subplots()
    axes.text(0.5, 0.5, 'one')
    axes.text(0.51, 0.51, 'two')
    axes.text(1.2, 0.1, 'beyond')
    assert list(overlaps(figure)) == [('one', 'two'), ('beyond', 'the edge')]
