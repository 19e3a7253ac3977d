# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""All programs write files by one rule.

Results are on stdout, notes on stderr; an existing file is kept without --overwrite; a folder is
created if its parent exists; a file is complete, or is not there; '-' is standard output.
"""

import csv
import io
import json
from pathlib import Path

import pytest
from matplotlib.figure import Figure
from ros_harness import assert_refused

from linkage_lab import command_line, export
from linkage_lab.robots import import_tool
from linkage_ros import cli, load, read_log
from linkage_ros.programs import log_tool, record

STUDY = 'base: wiper\ndesigns: 4\nranges: {coupler.mass: [1.0, 2.0]}\nmeasures: [peak_torque]\n'
LEG = str(Path(__file__).parents[2] / 'docs/examples/leg.urdf')
# Command lines, and the files that each writes into the folder `new`.
CHEAP = {
    'record': (record, 'wiper new/a.mcap --duration 0.1', 'a.mcap'),
    'csv': (log_tool, 'csv run.mcap new/a.csv', 'a.csv'),
    'recover': (log_tool, 'recover run.mcap new/a.mcap', 'a.mcap'),
    'sketch': (command_line, 'sketch wiper --out new', 'wiper_sketch.png'),
    'state': (command_line, 'state wiper --csv new/a.csv', 'a.csv'),
    'motion': (command_line, 'motion wiper --out new', 'wiper_motion.png wiper_motion.csv'),
    'page': (command_line, 'movie wiper new/a.html', 'a.html'),
    'urdf': (export, 'urdf wiper new/a.urdf', 'a.urdf'),
    'mjcf': (export, 'mjcf wiper new/a.xml', 'a.xml'),
    'import': (
        import_tool,
        f'{LEG} --crank knee_motor --close rod_tip shank_pin -o new/a.yaml',
        'a.yaml',
    ),
}
# These take long, and must refuse before.
LONG = {
    'film': (command_line, 'movie wiper new/a.gif', 'a.gif'),
    'flywheel': (
        command_line,
        'motion quadrilateral --fluctuation 0.1 --out new',
        'quadrilateral_flywheel.png',
    ),
    'sweep': (command_line, 'sweep study.yaml --out new', 'study.csv'),
    'economy': (command_line, 'economy wiper --out new', 'wiper_economy.json'),
    'pump': (command_line, 'pump --out new', 'wind_pump_settled.json'),
    'accuracy': (command_line, 'accuracy --out new', 'accuracy_follow.json'),
    'stability': (command_line, 'stability --out new', 'stability.png'),
}


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    record.record(load('wiper'), 'run.mcap', duration=0.1)
    Path('study.yaml').write_text(STUDY)


@pytest.mark.parametrize(('module', 'line', 'files'), CHEAP.values(), ids=CHEAP)
def test_files_are_kept_unless_overwrite_is_given(called, module, line, files):
    code, out, err = called(module, *line.split())
    assert code == 0, err
    assert 'note:' not in out
    assert [*map(str, sorted(Path('new').iterdir()))] == sorted(f'new/{x}' for x in files.split())
    for path in (Path('new') / x for x in files.split()):
        before = path.read_bytes()
        assert before
        path.write_bytes(kept := b'\x89MCAP0\r\n')
        assert_refused(*called(module, *line.split()), 'already exists: .* give --overwrite')
        assert path.read_bytes() == kept
        assert called(module, *line.split(), '--overwrite')[0] == 0
        assert path.read_bytes() != kept
    lost = line.replace('new', 'no/way')
    assert_refused(*called(module, *lost.split()), 'cannot be written: there is no folder no')


@pytest.mark.parametrize(('module', 'line', 'files'), LONG.values(), ids=LONG)
def test_long_work_is_refused_before_it_begins(called, module, line, files):
    Path('new').mkdir()
    Path('new', files).write_bytes(b'')
    assert_refused(*called(module, *line.split()), 'already exists: .* give --overwrite')


@pytest.mark.parametrize('line', ['sketch wiper', 'motion wiper'])
def test_interrupted_picture_leaves_nothing(called, monkeypatch, line):
    def stop(_, path, **__):
        Path(path).write_bytes(b'half')
        raise KeyboardInterrupt

    monkeypatch.setattr(Figure, 'savefig', stop)
    assert called(command_line, *line.split(), '--out', 'new')[0] == 130
    assert not [*Path('new').glob('*.png')]
    assert not [*Path('new').glob('.*')]


def test_interrupted_film_leaves_nothing(called, monkeypatch):
    def stop(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr('linkage_lab.charts.movie.progress', stop)
    assert called(command_line, 'movie', 'wiper', 'new/a.gif')[0] == 130
    assert not [*Path('new').iterdir()]


@pytest.mark.parametrize(
    ('module', 'line', 'start'),
    [
        (log_tool, 'csv run.mcap -', 't [s],crank.position'),
        (command_line, 'state wiper --csv -', 'assembly,crank.direction [rad]'),
        (export, 'urdf wiper -', '<?xml'),
        (export, 'mjcf wiper -', '<mujoco'),
        (import_tool, f'{LEG} --crank knee_motor --close rod_tip shank_pin -o -', '# Written'),
    ],
)
def test_minus_is_standard_output(called, module, line, start):
    before = {*Path().iterdir()}
    code, out, _ = called(module, *line.split())
    assert code == 0
    assert out.startswith(start)
    assert 'note:' not in out
    assert {*Path().iterdir()} == before
    if 'csv' in line:
        head, *rows = csv.reader(io.StringIO(out))
        assert rows
        assert all(len(row) == len(head) for row in rows)


# ---------------------------------------------------------------- JSON


def as_json(called, module, line):
    code, out, err = called(module, *line.split(), '--json')
    assert code == 0, err
    return json.loads(out, parse_constant=pytest.fail)


def test_motion_as_json(called):
    found = as_json(called, command_line, 'motion wiper --out new')
    assert found['files'] == ['new/wiper_motion.png', 'new/wiper_motion.csv']
    head, *rows = csv.reader(io.StringIO(Path('new/wiper_motion.csv').read_text()))
    torque = [float(row[head.index('driving_torque [N m]')]) for row in rows]
    extent = found['designs']['wiper']['quantities']['driving_torque']
    assert extent['unit'] == 'N m'
    assert [extent['low'], extent['high']] == pytest.approx([min(torque), max(torque)], rel=1e-3)


def test_state_as_json(called):
    found = as_json(called, command_line, 'state wiper --at 85deg')
    assemblies = [one['assembly'] for one in found['assemblies']]
    assert assemblies == ['open', 'crossed']
    own = found['assemblies'][0]['values']['rocker.direction']
    assert own['unit'] == 'rad'
    assert f'{own["value"]:.3f}' == '1.561'


def test_sweep_as_json(called):
    found = as_json(called, command_line, 'sweep study.yaml --workers 1')
    assert found['files'] == ['study.csv']
    assert len(Path('study.csv').read_text().splitlines()) == 5


def test_log_info_as_json(called):
    found = as_json(called, log_tool, 'info run.mcap')
    counts = {topic['name']: topic['messages'] for topic in found['topics']}
    assert counts['/joint_states'] == len(read_log('run.mcap', '/joint_states')['t'])
    assert found['configuration']['mechanism'] == 'four_bar'


def test_numbers_that_json_lacks_are_null(capsys):
    cli.print_json({'a': [float('inf'), 1.0], 'b': float('nan')})
    assert json.loads(capsys.readouterr().out) == {'a': [None, 1.0], 'b': None}
