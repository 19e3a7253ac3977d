# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A mechanism, a drawing or a log is shown in a notebook, with its sketch, a table and a page."""

import ast
import html
import json
import re

import numpy as np
import pytest
from mechanisms import ALL
from pages import ROOT, run_python
from ros_harness import finished

from linkage_lab import show
from linkage_ros import Drawing, DrawnLink, LinkageError, Solver, load, read_log
from linkage_ros.programs.record import record
from linkage_ros.settings.configuration import configure, read_values

PINS = {'O': (0, 0), 'A': (30, 40), 'B': (120, 90), 'Q': (140, 0)}
LINKS = {'arm': ('O', 'A'), 'rod': ('A', 'B'), 'lever': ('Q', 'B')}
SHOWN = {
    'preset': 'shaper',
    'law': load('excavator'),
    'mechanism': ALL['centric'],
    'limited': Solver(ALL['swinging_barrel_driven']),
    'drawing': Drawing(
        units='mm', input='arm', frame=['O', 'Q'], pins=PINS,
        links=[DrawnLink(*link) for link in LINKS.items()],
    ),
}  # fmt: skip


def table(shown):
    """Returns smallest and largest value of each quantity of the table."""
    cells = [re.findall(r'<td[^>]*>([^<]*)', row) for row in str(shown).split('<tr>')[2:]]
    return {row[0]: [*map(float, row[2:])] for row in cells}


@pytest.mark.parametrize('thing', SHOWN.values(), ids=SHOWN)
def test_sketch_table_and_page_are_shown(thing):
    shown = show(thing)
    text = shown._repr_html_()
    assert 'src="data:image/png;base64,' in text
    (page,) = re.findall('<iframe sandbox="allow-scripts" [^>]* srcdoc="([^"]*)"', text)
    assert html.unescape(page).lower().startswith('<!doctype html>')
    assert '\n' not in repr(shown)
    if thing is SHOWN['drawing']:
        assert {f'{link}.direction' for link in LINKS} <= table(shown).keys()


@pytest.mark.parametrize('preset', ['wiper', 'wind_pump', 'excavator'])
def test_log_is_shown_as_it_moved(tmp_path, preset):
    log = tmp_path / 'run.mcap'
    record(load(preset), log, duration=0.5)
    states = read_log(log, '/joint_states')
    driven = load(preset).mechanism.structure().driven_link.name
    found = table(show(log))
    assert found['time'] == [0.0, states['t'][-1]]
    effort = states[f'{driven}.effort']
    (shown,) = (found[name] for name in ('driving_torque', 'driving_force') if name in found)
    assert shown == pytest.approx([effort.min(), effort.max()], rel=1e-3)
    speed = states[f'{driven}.velocity']
    word = 'velocity' if preset == 'excavator' else 'angular_velocity'
    assert found[f'{driven}.{word}'] == pytest.approx([speed.min(), speed.max()], rel=1e-3)


def test_one_of_several_linkages_is_shown(tmp_path):
    values = {'linkages': ['left', 'right']}
    for name, preset in (('left', 'quadrilateral'), ('right', 'wiper')):
        values |= {
            f'{name}.{key}': x for key, x in read_values(preset).items() if key != 'rate_hz'
        }
    both, log = configure(values), tmp_path / 'run.mcap'
    record(both, log, duration=0.5)
    for thing in (both, log):
        speeds = table(show(thing, linkage='right'))['crank.angular_velocity']
        assert speeds == pytest.approx([1.5 * np.pi] * 2, rel=1e-3)
        with pytest.raises(LinkageError, match='left, right'):
            show(thing)


def test_mechanism_without_a_motion_is_shown_without_its_page():
    text = str(show(ALL['pump']))
    assert '<img' in text
    assert 'No motion: ' in text
    assert '<iframe' not in text


def test_speed_is_that_of_the_call():
    speeds = table(show(ALL['centric'], rpm=30.0))['crank.angular_velocity']
    assert speeds == pytest.approx([np.pi, np.pi], rel=1e-3)


@pytest.mark.parametrize('thing', ['no_such_preset', 'missing.mcap', 3.5])
def test_what_cannot_be_shown_is_refused(thing):
    with pytest.raises(LinkageError):
        show(thing)


def test_cells_of_the_notebook_run_in_order(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names, shown = {}, []
    for cell in json.loads((ROOT / 'lab/docs/notebook.ipynb').read_text())['cells']:
        source = ''.join(cell['source'])
        if cell['cell_type'] == 'markdown':
            continue
        if source.startswith('!linkage_'):
            done = finished(*source.removeprefix('!linkage_').split(), cwd=tmp_path)
            assert done.returncode == 0, done.stderr
            continue
        lines = source.splitlines()
        last = ast.parse(source).body[-1].lineno - 1
        lines[last] = f'_ = {lines[last]}'  # a notebook shows the value of the last statement
        run_python('\n'.join(lines), 'notebook', names)
        shown.append(names['_'])
    assert [repr(x).split()[0] for x in shown if hasattr(x, '_repr_html_')].count('<Shown:') == 3
