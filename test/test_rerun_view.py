# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The live view: what a reader finds in it, who can read it, and viewers that do not behave.

No window is opened. Where one is asked for, RERUN_CLI_PATH names a script that takes its place,
as Rerun's own command allows.
"""

from __future__ import annotations

import math
import os
import re
import signal
import socket
import stat
import subprocess
import sys
import time
import urllib.parse
import urllib.request
import warnings
from contextlib import closing, contextmanager, suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from linkage_ros import ViewerError
from linkage_ros.dynamics.solver import Solver
from linkage_ros.log.writer import LogWriter
from linkage_ros.motion.joints import joint_values
from linkage_ros.motion.speed_driven import CrankMotion
from linkage_ros.palette import COLORS
from linkage_ros.parameters.configuration import configure, load
from linkage_ros.run.health import Health, Watch
from linkage_ros.run.ticker import Timekeeping
from linkage_ros.run.worker import Worker
from linkage_ros.view import rerun_program, rerun_sender, targets
from linkage_ros.view.drawing import Drawing
from linkage_ros.view.rerun_view import Sample, View
from linkage_ros.wire.codecs import JointStateCodec
from linkage_ros.wire.diagnostics import ERROR, WARN
from linkage_ros.wire.topics import JOINT_STATES

# First as views import it: from then on the SDK says nothing in this process, not even from a
# thread that notices after a test that the viewer has gone.
with suppress(ViewerError):
    rerun_sender._import_rerun()
rerun = pytest.importorskip('rerun')
rerun_chunk = pytest.importorskip('rerun.chunk')

PROGRAM = Path(rerun.__file__).parents[1] / 'rerun_cli' / 'rerun'
PATIENCE = 20.0  # s, until a wait that must end counts as a hang
WALL = 1_795_000_000_000_000_000
JOINTS = ('crank', 'coupler', 'rocker')
QUANTITIES = ('position', 'velocity', 'effort')
CONFIGURATION = load('quadrilateral')


def run_of(configuration, count, rate=200, start=0):
    """The samples of a run, and the solver's own angles."""
    solver, motion = Solver(configuration.mechanism), CrankMotion.begin(configuration.drive, start)
    samples, angles = [], []
    for tick in range(count):
        stamp = start + tick * 10**9 // rate
        crank = motion.at(stamp)
        state = solver.state(crank.angle, crank.speed, crank.acceleration)
        values = joint_values(solver.structure.links, state, crank)
        samples.append(Sample(stamp, values.position, values.velocity, values.effort))
        angles.append(state.position)
    return samples, np.array(angles)


def show(path, samples, configuration=CONFIGURATION, batch=37, **options):
    view = View(configuration, str(path), **options)
    for start in range(0, len(samples), batch):
        view.consume(samples[start : start + batch])
    view.close()
    return view


def read(path, *, blueprint=False):
    """What Rerun's reader finds, as Arrow gives it: {entity: {column: values in order}}."""
    with warnings.catch_warnings():
        warnings.filterwarnings('ignore', 'RRD file has no footer')
        reader = rerun_chunk.RrdReader(path)
    store = reader.blueprints()[0] if blueprint else None
    return collect(reader.stream(store=store))


def collect(stream):
    found = {}
    for chunk in stream:
        columns = found.setdefault(str(chunk.entity_path), {})
        batch = chunk.to_record_batch()
        for name, column in zip(batch.schema.names, batch.columns, strict=True):
            kind = 'time' if str(column.type).startswith(('timestamp', 'duration')) else 'value'
            values = column.cast('int64') if kind == 'time' else column
            columns.setdefault(name, []).extend(values.to_pylist())
            columns[f'{name} type'] = str(column.type)
    return found


def plane(points):
    """x and y of complex numbers as Rerun keeps them."""
    return np.stack([np.real(points), np.imag(points)], axis=-1).astype(np.float32)


# ---------------------------------------------------------------- what a file holds


@pytest.mark.parametrize(('start', 'kind'), [(0, 'duration[ns]'), (WALL, 'timestamp[ns]')])
def test_a_file_holds_every_sample_to_the_last_bit(tmp_path, start, kind):
    samples, _ = run_of(CONFIGURATION, 500, start=start)
    view = show(tmp_path / 'run.rrd', samples)
    found = read(tmp_path / 'run.rrd')
    for quantity in QUANTITIES:
        entity = found[f'/joint_states/{quantity}']
        assert entity['ros2_timestamp type'] == kind
        assert entity['ros2_timestamp'] == [sample.stamp for sample in samples]
        rows = [tuple(row) for row in entity['Scalars:scalars']]
        assert rows == [getattr(sample, quantity) for sample in samples]
        assert entity['SeriesLines:names'] == [list(JOINTS)]
    assert (view.dropped, view.url, view.exposed) == (0, None, False)


@pytest.mark.parametrize('rpm', [150.0, -37.0])
def test_the_pins_are_drawn_where_they_are(tmp_path, rpm):
    changed = {'rpm': rpm, 'crank_angle': 1.3, 'frame.angle': 0.4}
    configuration = configure({**CONFIGURATION.parameters(), **changed})
    samples, angles = run_of(configuration, 600)
    show(tmp_path / 'run.rrd', samples, configuration)
    found = read(tmp_path / 'run.rrd')
    # 200 states a second, 50 drawings; B by way of the coupler, which `drawing` does not take.
    alpha, beta, gamma = np.exp(1j * angles[::4]).T
    mechanism = configuration.mechanism
    a = mechanism.crank.length * alpha
    b, c = a + mechanism.coupler.length * beta, a + complex(*mechanism.coupler.point) * beta
    b0 = np.full_like(a, mechanism.frame.length * np.exp(0.4j))
    assert abs(b0 + mechanism.rocker.length * gamma - b).max() < 1e-12

    def same(entity, column, exact):
        got = np.array(found[f'/linkage/{entity}'][column], np.float32).reshape(exact.shape)
        assert abs(got - exact).max() < 2e-7
        return found[f'/linkage/{entity}']['ros2_timestamp']

    drawn = [sample.stamp for sample in samples[::4]]
    assert same('pins', 'Points2D:positions', plane(np.stack([a, b, c], -1))) == drawn
    lines = {'crank': [0 * a, a], 'coupler': [a, b, c, a], 'rocker': [b0, b]}
    for link, line in lines.items():
        assert same(link, 'LineStrips2D:strips', plane(np.stack(line, -1))) == drawn


@pytest.mark.parametrize(('rate', 'drawings'), [(1000, 100), (50, 100), (10, 20)])
def test_there_are_at_most_50_drawings_a_second_of_stamp_time(tmp_path, rate, drawings):
    samples, _ = run_of(CONFIGURATION, 2 * rate, rate)
    show(tmp_path / 'run.rrd', samples, batch=7)
    found = read(tmp_path / 'run.rrd')
    assert len(found['/linkage/crank']['ros2_timestamp']) == drawings
    assert len(found['/joint_states/effort']['ros2_timestamp']) == 2 * rate


def test_what_comes_all_at_once_is_all_shown(tmp_path):
    samples, _ = run_of(CONFIGURATION, 1000)
    many = [sample._replace(stamp=k * 10**6) for k, sample in enumerate(samples * 45)]
    view = show(tmp_path / 'run.rrd', many, batch=len(many))
    stamps = read(tmp_path / 'run.rrd')['/joint_states/position']['ros2_timestamp']
    assert stamps == [sample.stamp for sample in many]
    assert view.dropped == 0


def test_names_are_those_of_an_opened_log(tmp_path):
    samples, _ = run_of(CONFIGURATION, 50, start=WALL)
    codec = JointStateCodec(JOINTS)
    with LogWriter(tmp_path / 'run.mcap', CONFIGURATION, overwrite=False) as log:
        channel = log.add_topic(JOINT_STATES, '/joint_states')
        for sample in samples:
            log.write(channel, sample.stamp, codec.encode(*sample))
    show(tmp_path / 'run.rrd', samples)
    imported = collect(rerun_chunk.McapReader(tmp_path / 'run.mcap').stream())
    found = read(tmp_path / 'run.rrd')
    for quantity in QUANTITIES:
        ours, theirs = found[f'/joint_states/{quantity}'], imported[f'/joint_states/{quantity}']
        for column in ('ros2_timestamp', 'ros2_timestamp type', 'Scalars:scalars'):
            assert ours[column] == theirs[column]
        assert ours['SeriesLines:names'][0] == theirs['SeriesLines:names'][0]


def test_a_run_that_is_killed_is_kept_but_for_its_end(tmp_path):
    code = """
import os, signal, sys
from linkage_ros.view import rerun_view
from linkage_ros.parameters.configuration import load
from linkage_ros.view.rerun_view import Sample, View
rerun_view._FILE_SECONDS = 0.0
view = View(load('quadrilateral'), sys.argv[1])
for k in range(100):
    view.consume([Sample(k * 10**7, (k / 7, 1.0, 2.0), (0.0,) * 3, (0.0,) * 3)])
os.kill(os.getpid(), signal.SIGKILL)
"""
    subprocess.run(
        [sys.executable, '-c', code, tmp_path / 'run.rrd'], check=False, timeout=PATIENCE
    )
    assert len(read(tmp_path / 'run.rrd')['/joint_states/effort']['ros2_timestamp']) >= 99


def test_a_file_is_written_in_large_pieces(tmp_path):
    samples, _ = run_of(CONFIGURATION, 2000)
    sizes = []
    for batch in (2, 2000):
        show(tmp_path / f'{batch}.rrd', samples, batch=batch)
        sizes.append((tmp_path / f'{batch}.rrd').stat().st_size)
    assert sizes[0] < 1.2 * sizes[1]
    assert sizes[1] < 250 * len(samples)


# ---------------------------------------------------------------- what it looks like


def change_point():
    """It passes one change point: the motion repeats after two turns."""
    lengths = {'crank': 0.1, 'coupler': 0.4, 'rocker': 0.3, 'frame': 0.2}
    changed = {f'{link}.length': length for link, length in lengths.items()}
    return configure({**CONFIGURATION.parameters(), **changed})


DRAWN = {
    'once': CONFIGURATION,
    'twice': change_point(),
    'compressor': load('compressor'),
    'slider-crank': replace(load('slider_crank'), drive=CONFIGURATION.drive),
}


@pytest.mark.parametrize('configuration', DRAWN.values(), ids=DRAWN)
def test_the_bounds_hold_all_that_ever_moves(configuration):
    drawing = Drawing(configuration.mechanism)
    samples, _ = run_of(configuration, 1000, rate=997)
    points = drawing.place(drawing.of_links(np.array([sample.position for sample in samples])))
    still = [drawing.pivots, *drawing.ground, drawing.footings, drawing.scale]
    still.append(drawing.beside(points).reshape(-1, 2))
    moving = [line.reshape(-1, 2) for line in drawing.links(points).values()]
    everything = np.concatenate([*moving, *still])
    margins = [
        everything.min(axis=0) - drawing.bounds[0],
        drawing.bounds[1] - everything.max(axis=0),
    ]
    width = np.ptp(drawing.bounds, axis=0).max()
    assert np.min(margins) > 0.03 * width
    assert np.max(margins) < 0.1 * width


@pytest.mark.parametrize('configuration', DRAWN.values(), ids=DRAWN)
def test_paths_are_whole_and_lie_under_their_points(configuration):
    drawing = Drawing(configuration.mechanism)
    samples, _ = run_of(configuration, 400, rate=397)
    points = drawing.place(drawing.of_links(np.array([sample.position for sample in samples])))
    step = 2 * math.pi / 360
    assert list(drawing.paths) == [drawing.output, 'coupler'][: points.shape[1] - 1]
    for path, point in zip(drawing.paths, points.swapaxes(0, 1)[1:], strict=True):
        line = drawing.paths[path]
        assert abs(line[0] - line[-1]).max() < 1e-12
        nearest = [np.hypot(*(line - at).T).min() for at in point]
        assert max(nearest) < step


@pytest.mark.parametrize('preset', ['compressor', 'slider_crank'])
def test_a_slider_is_a_block_about_its_pin_on_a_guide(tmp_path, preset):
    configuration = load(preset)
    samples, _ = run_of(configuration, 200)
    show(tmp_path / 'run.rrd', samples, configuration)
    found = read(tmp_path / 'run.rrd')
    assert found['/joint_states/position']['SeriesLines:names'] == [['crank', 'coupler', 'slider']]
    pins = np.array(found['/linkage/pins']['Points2D:positions'])
    blocks = np.array(found['/linkage/slider']['LineStrips2D:strips'])[:, 0]
    assert blocks.shape[1:] == (5, 2)
    assert abs(blocks[:, :4].mean(axis=1) - pins[:, 1]).max() < 1e-6
    # Where ROS has it: the joint's position along the guide, from the foot of the perpendicular.
    mechanism = configuration.mechanism
    guide = np.exp(1j * mechanism.frame.angle)
    slid = np.array([sample.position[2] for sample in samples[::4]])
    exact = (slid + 1j * mechanism.slider.offset) * guide
    assert abs(pins[:, 1] @ (1, 1j) - exact).max() < 1e-6
    # Its sides lie along the guide.
    sides = (blocks[:, 1] - blocks[:, 0]) @ (1, 1j) * guide.conj()
    assert abs(sides.imag).max() < 1e-6


def test_slider_plots_have_their_own_units(tmp_path):
    configuration = load('compressor')
    show(tmp_path / 'run.rrd', run_of(configuration, 5)[0], configuration)
    layout = read(tmp_path / 'run.rrd', blueprint=True)
    titles = {columns['ViewBlueprint:display_name'][0][0] for columns in layout.values()
              if 'ViewBlueprint:display_name' in columns}  # fmt: skip
    assert {title for title in titles if title.startswith('Slider')} == {
        'Slider, m (0.0998 to 0.18)',
        'Slider, m/s (-3.88 to 3.97 at 900 rpm)',
    }


def test_without_a_coupler_point_there_are_two_pins_and_one_path(tmp_path):
    coupler = replace(CONFIGURATION.mechanism.coupler, point=None)
    mechanism = replace(CONFIGURATION.mechanism, coupler=coupler)
    configuration = replace(CONFIGURATION, mechanism=mechanism)
    samples, _ = run_of(configuration, 20)
    show(tmp_path / 'run.rrd', samples, configuration)
    found = read(tmp_path / 'run.rrd')
    assert [len(row) for row in found['/linkage/pins']['Points2D:positions']] == [2] * 5
    assert [len(row[0]) for row in found['/linkage/coupler']['LineStrips2D:strips']] == [2] * 5
    assert [name for name in found if '/paths/' in name] == ['/linkage/paths/rocker']


def test_y_is_up_and_a_link_has_the_colour_of_its_curves(tmp_path):
    show(tmp_path / 'run.rrd', run_of(CONFIGURATION, 5)[0])
    found, layout = read(tmp_path / 'run.rrd'), read(tmp_path / 'run.rrd', blueprint=True)
    assert found['/linkage']['Transform3D:scale'] == [[[1.0, -1.0, 1.0]]]
    bounds = [columns for name, columns in layout.items() if name.endswith('VisualBounds2D')]
    ((shown,),) = bounds[0]['VisualBounds2D:range']
    (left, low), (right, high) = Drawing(CONFIGURATION.mechanism).bounds
    ranges = [*shown['x_range'], *shown['y_range']]
    assert ranges == pytest.approx([left, right, -high, -low])
    colors = [[(r << 24) + (g << 16) + (b << 8) + 255] for r, g, b in map(COLORS.get, JOINTS)]
    assert [found[f'/linkage/{j}']['LineStrips2D:colors'][0] for j in JOINTS] == colors
    curves = [columns['SeriesLines:colors'] for columns in layout.values()
              if 'SeriesLines:colors' in columns]  # fmt: skip
    # Directions, of links that swing; turning, rates and torque, of all.
    shown = [color for (color,) in colors]
    assert sorted(curves) == sorted([[shown[1:]], *[[shown]] * 3])
    titles = {columns['ViewBlueprint:display_name'][0][0] for columns in layout.values()
              if 'ViewBlueprint:display_name' in columns}  # fmt: skip
    torque = next(title for title in titles if title.startswith('Driving torque, N m'))
    assert torque == 'Driving torque, N m (-8.55 to 8.48 at 150 rpm)'
    assert titles - {torque} == {
        *(
            'Linkage, m',
            'Directions, rad',
            'Turning, rad',
            'Rates, rad/s',
        ),
    }


@pytest.mark.parametrize('configuration', DRAWN.values(), ids=DRAWN)
def test_a_scale_below_everything_is_as_long_as_it_says(tmp_path, configuration):
    show(tmp_path / 'run.rrd', run_of(configuration, 5)[0], configuration)
    found, drawing = read(tmp_path / 'run.rrd'), Drawing(configuration.mechanism)
    ((bar,),) = found['/linkage/scale']['LineStrips2D:strips']
    left, low = np.min(bar, axis=0)
    assert np.max(bar, axis=0)[0] - left == pytest.approx(drawing.scale_length)
    assert found['/linkage/scale/length']['Points2D:labels'] == [[f'{drawing.scale_length:g} m']]
    assert f'{drawing.scale_length:.0e}'[0] in '125'
    width = np.ptp(drawing.bounds, axis=0).max()
    assert 0.08 * width < drawing.scale_length < 0.25 * width
    assert low < min(line[:, 1].min() for line in (*drawing.ground, *drawing.paths.values()))


@pytest.mark.parametrize('configuration', DRAWN.values(), ids=DRAWN)
def test_every_pin_has_its_name_beside_it(tmp_path, configuration):
    samples, _ = run_of(configuration, 200)
    show(tmp_path / 'run.rrd', samples, configuration)
    found, drawing = read(tmp_path / 'run.rrd'), Drawing(configuration.mechanism)
    assert found['/linkage/pivots/names']['Points2D:labels'] == [list(drawing.pivot_names)]
    names = found['/linkage/pins/names']
    assert names['Points2D:labels'] == [list(drawing.pins)]
    pins = np.array(found['/linkage/pins']['Points2D:positions'])
    places = np.array(names['Points2D:positions'])
    assert names['ros2_timestamp'] == found['/linkage/pins']['ros2_timestamp']
    away = np.linalg.norm(places - pins, axis=-1) / np.ptp(drawing.bounds, axis=0).max()
    assert 0.03 < away.min() < away.max() < 0.12
    assert (places > drawing.bounds[0]).all()
    assert (places < drawing.bounds[1]).all()


# ---------------------------------------------------------------- targets that are none


@pytest.mark.parametrize(
    'target',
    [
        'foo',
        '',
        'http://x',
        'http://x/run.rrd',
        'rerun+http://127.0.0.1:9876',
        'run.mcap',
        'rerun+http://127.0.0.1:65536/proxy',
    ],
)
def test_other_targets_are_refused_in_a_line_that_names_the_right_ones(target):
    valid = r'spawn, web, rerun\+http://HOST:PORT/proxy or a \.rrd path'
    with pytest.raises(ViewerError, match=rf'^viewer = {target!r} is not one of: {valid}$'.replace(
        'rerun+http://127', r'rerun\+http://127')):  # fmt: skip
        View(CONFIGURATION, target)


def test_a_folder_is_refused(tmp_path):
    for name in ('folder', 'folder.rrd'):
        (tmp_path / name).mkdir()
        with pytest.raises(ViewerError, match=rf'^viewer = .*{name}\' is not one of: spawn, '):
            View(CONFIGURATION, str(tmp_path / name))


def test_a_pipe_needs_another_name(tmp_path):
    os.mkfifo(path := tmp_path / 'run.rrd')
    with pytest.raises(ViewerError, match=r'run\.rrd is no file that could be replaced: choose'):
        View(CONFIGURATION, str(path))


def test_a_missing_folder_is_named(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # a long path would be cut in the message
    with pytest.raises(ViewerError, match=r"= 'none/run\.rrd' cannot be written \(No such file"):
        View(CONFIGURATION, 'none/run.rrd')


def test_a_file_is_kept_unless_it_is_to_be_replaced(tmp_path):
    path = tmp_path / 'run.rrd'
    path.write_text('precious')
    with pytest.raises(
        ViewerError, match=r'run\.rrd exists already and is kept: choose .* set log_overwrite\)$'
    ):
        View(CONFIGURATION, str(path))
    assert path.read_text() == 'precious'
    show(path, run_of(CONFIGURATION, 5)[0], overwrite=True)
    assert len(read(path)['/joint_states/effort']['ros2_timestamp']) == 5


def test_a_full_disk_is_one_error(tmp_path):
    code = """
import resource, sys
from linkage_ros import ViewerError
from linkage_ros.view import rerun_sender, rerun_view
from linkage_ros.parameters.configuration import load
from linkage_ros.view.rerun_view import Sample, View
rerun_sender._WRITE_SECONDS, rerun_view._FILE_SECONDS = 0.5, 0.0
resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))
view = View(load('quadrilateral'), sys.argv[1])
try:
    for k in range(1000):
        view.consume([Sample(k * 10**7, (k / 7, 1.0, 2.0), (0.0,) * 3, (0.0,) * 3)] * 10)
except ViewerError as error:
    print(error)
view.close()
"""
    done = subprocess.run(
        [sys.executable, '-c', code, tmp_path / 'run.rrd'],
        capture_output=True, text=True, check=True, timeout=PATIENCE,
    )  # fmt: skip
    assert done.stdout == f'{tmp_path}/run.rrd takes no more: is the disk full?\n'
    assert done.stderr == ''  # and none of Rerun's own


def test_without_rerun_the_package_to_install_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, 'rerun', None)
    with pytest.raises(ViewerError, match=r'needs rerun-sdk, .* pip install --upgrade rerun-sdk'):
        View(CONFIGURATION, 'run.rrd')


def test_rerun_is_imported_by_the_first_view_and_not_before():
    code = 'import sys, linkage_ros.view.rerun_view; sys.exit("rerun" in sys.modules)'
    subprocess.run([sys.executable, '-c', code], check=True, timeout=PATIENCE)


# ---------------------------------------------------------------- a window of one's own


@pytest.fixture
def window(tmp_path, monkeypatch):
    """Installs what is run in place of a window; returns how."""

    def install(script):
        path = tmp_path / 'window'
        path.write_text(f'#!/bin/sh\n{script}\n')
        path.chmod(path.stat().st_mode | stat.S_IXUSR)
        monkeypatch.setenv('RERUN_CLI_PATH', str(path))
        monkeypatch.setenv('DISPLAY', ':99')
        monkeypatch.delenv('CI', raising=False)

    return install


@contextmanager
def opened(*arguments, **options):
    view = View(CONFIGURATION, *arguments, **options)
    process = view._program.process if view._program else None
    try:
        yield view, process
    finally:
        view.close()
        if process:
            process.kill()
            process.wait()


def listening(*processes):
    """Addresses at which processes, or this one, take connections, as the kernel has them."""
    mine = set()
    for entry in (e for p in processes or ['self'] for e in Path(f'/proc/{p}/fd').iterdir()):
        with suppress(OSError):
            mine.add(str(entry.readlink()))
    found = set()
    for name in ('tcp', 'tcp6'):
        for line in Path(f'/proc/self/net/{name}').read_text().splitlines()[1:]:
            fields = line.split()
            if fields[3] == '0A' and f'socket:[{fields[9]}]' in mine:
                found.add((name, fields[1].split(':')[0], int(fields[1].split(':')[1], 16)))
    return found


def wait_until(condition):
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


def stamps_in(path):
    """The stamps in a file that is being written; () where there are none yet."""
    try:
        return read(path)['/joint_states/effort']['ros2_timestamp']
    except (ValueError, OSError, KeyError, RuntimeError):
        return ()


@contextmanager
def running_at(url, saved):
    """Another viewer of what is served."""
    command = [PROGRAM, url, '--save', saved, '--bind', '127.0.0.1', '--port', 'auto']
    with subprocess.Popen(command, stderr=subprocess.DEVNULL) as process:
        try:
            yield
        finally:
            process.kill()


SAVE = f'exec {PROGRAM} "$1" --save "{{}}" --bind 127.0.0.1 --port auto'


def test_a_window_gets_all_there_is_however_late_it_connects(tmp_path, window):
    saved = tmp_path / 'saved.rrd'
    window(f'sleep 0.5\n{SAVE.format(saved)}')
    samples, _ = run_of(CONFIGURATION, 400)
    with opened('spawn') as (view, _):
        for start in range(0, 400, 10):
            view.consume(samples[start : start + 10])
        wait_until(lambda: stamps_in(saved))
        view.consume(samples[:1])
        assert view.dropped == 0
        view.close()
        wait_until(lambda: len(stamps_in(saved)) > len(samples))
    assert stamps_in(saved) == [sample.stamp for sample in (*samples, samples[0])]


@pytest.mark.parametrize(
    ('bind', 'address', 'exposed'),
    [('127.0.0.1', ('tcp', '0100007F'), False), ('0.0.0.0', ('tcp', '00000000'), True),
     ('::1', ('tcp6', '00000000000000000000000001000000'), False)],
)  # fmt: skip
def test_data_is_served_on_the_given_address_alone(window, bind, address, exposed):
    window('exec sleep 30')
    before = listening()
    with opened('spawn', bind) as (view, _):
        ((name, host, port),) = listening() - before
        assert (name, host) == address
        written = f'[{bind}]' if ':' in bind else bind
        assert view.url == f'rerun+http://{written}:{port}/proxy'
        assert view.exposed is exposed
    assert listening() == before


@pytest.mark.parametrize('bind', ['everywhere', '', '203.0.113.7', '127.0.0.1:9876'])
def test_an_address_that_is_not_here_is_refused(window, bind):
    window('exec sleep 30')
    with pytest.raises(ViewerError, match=rf"^viewer_bind = '{bind}' is no address of this mach"):
        View(CONFIGURATION, 'spawn', bind)


def test_the_window_is_told_not_to_report_and_not_to_listen_to_others(tmp_path, window):
    window(f'(echo "$@"; env) >{tmp_path}/told~; mv {tmp_path}/told~ {tmp_path}/told')
    with opened('spawn') as (view, _):
        wait_until((tmp_path / 'told').exists)
    arguments, *environment = (tmp_path / 'told').read_text().splitlines()
    assert arguments.startswith(f'{view.url} --bind 127.0.0.1 --port auto')
    assert 'CI=1' in environment


@pytest.mark.parametrize('end', ['exit 0', 'kill -KILL $$', 'kill -TERM $$'])
def test_closing_the_window_does_not_disturb_the_run(window, end):
    window(end)
    with opened('spawn') as (view, process):
        process.wait(PATIENCE)
        for sample in run_of(CONFIGURATION, 20)[0]:
            view.consume([sample])
        assert view.dropped == 0


def test_a_window_that_lost_its_connection_is_told_from_one_that_was_closed(tmp_path, window):
    """As Rerun's server cuts off one that is stopped for half a minute."""
    window(f'{PROGRAM} "$1" --save {tmp_path}/0.rrd --bind 127.0.0.1 --port auto & echo $! '
           f'>{tmp_path}/pid; exec sleep 60')  # fmt: skip
    with opened('spawn') as (view, process):
        # Before it has connected, it is on its way.
        assert view.trouble == ''
        view.consume(run_of(CONFIGURATION, 20)[0])
        wait_until(lambda: view.trouble == '' and view._was_connected)
        os.kill(int((tmp_path / 'pid').read_text()), signal.SIGKILL)
        wait_until(lambda: view.trouble)
        assert view.trouble.startswith('the viewer window has lost its connection')
        assert f'`rerun {view.url}` opens another' in view.trouble
        with running_at(view.url, tmp_path / '1.rrd'):
            wait_until(lambda: view.trouble == '' and stamps_in(tmp_path / '1.rrd'))
        process.kill()
        process.wait()
        assert view.trouble == ''
    assert len(stamps_in(tmp_path / '1.rrd')) == 20


def test_a_window_outlives_the_run_and_its_terminal(window):
    window('exec sleep 30')
    with opened('spawn') as (view, process):
        assert os.getpgid(process.pid) != os.getpgrp()
        view.close()
        assert process.poll() is None


def test_a_window_that_crashes_is_told_from_one_that_was_closed(window):
    window('kill -SEGV $$')
    with opened('spawn') as (view, process):
        process.wait(PATIENCE)
        with pytest.raises(ViewerError, match=r'^the viewer has ended \(signal 11, Segmentation'):
            view.consume([])


def test_a_window_that_cannot_open_says_why(window):
    window('echo noise >&2; echo "Error: winit: no X server" >&2; exit 1')
    with opened('spawn') as (view, process):
        process.wait(PATIENCE)
        with pytest.raises(ViewerError, match=r'viewer could not be opened: winit: no X server$'):
            view.consume([])


def test_a_missing_program_is_named(window, monkeypatch, tmp_path):
    window('exit 0')
    monkeypatch.setenv('RERUN_CLI_PATH', str(tmp_path / 'nothing'))
    with pytest.raises(ViewerError, match=r'^no viewer program at .*/nothing: pip install'):
        View(CONFIGURATION, 'spawn')


def test_a_program_that_does_not_run_is_named(window, tmp_path):
    window('exit 0')
    (tmp_path / 'window').chmod(0o644)
    with pytest.raises(ViewerError, match=r'/window cannot be run: Permission denied$'):
        View(CONFIGURATION, 'spawn')


def test_the_program_is_found_beside_the_sdk(monkeypatch):
    monkeypatch.delenv('RERUN_CLI_PATH', raising=False)
    assert rerun_program.find_viewer() == PROGRAM


@pytest.mark.skipif(sys.platform != 'linux', reason='screens are named so on Linux')
def test_without_a_screen_there_is_no_window(monkeypatch):
    for name in ('DISPLAY', 'WAYLAND_DISPLAY', 'WAYLAND_SOCKET'):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(ViewerError, match=r'^no screen for a viewer window .*DISPLAY.*: give web'):
        View(CONFIGURATION, 'spawn')


# ---------------------------------------------------------------- a page for a browser

HOSTING = """
import sys, time
from linkage_ros.parameters.configuration import load
from linkage_ros.view.rerun_view import View
view = View(load('quadrilateral'), 'web')
print(view._program.process.pid, view.page, flush=True)
time.sleep(60)
"""


def fetched(page):
    with urllib.request.urlopen(page, timeout=PATIENCE) as answer:
        return answer.read().decode()


def reached(page):
    try:
        return fetched(page)
    except OSError:
        return ''


def test_a_page_is_hosted_here_alone_without_a_screen_while_the_run_lasts(monkeypatch):
    for name in ('DISPLAY', 'WAYLAND_DISPLAY', 'WAYLAND_SOCKET'):
        monkeypatch.delenv(name, raising=False)
    with opened('web') as (view, process):
        wait_until(lambda: 'rerun' in reached(view.page).lower())
        assert re.fullmatch(r'http://127\.0\.0\.1:\d+/\?url=rerun%2Bhttp%3A.*%2Fproxy', view.page)
        data = urllib.parse.parse_qs(urllib.parse.urlsplit(view.page).query)['url']
        assert data == [view.url]
        view.consume(run_of(CONFIGURATION, 10)[0])
        port = urllib.parse.urlsplit(view.page).port
        sockets = [line.split() for line in Path('/proc/net/tcp').read_text().splitlines()]
        served = [s[1] for s in sockets if s[1].endswith(f':{port:04X}') and s[3] == '0A']
        assert served == [f'0100007F:{port:04X}']  # 127.0.0.1, and nothing else
        assert process.poll() is None
    assert process.poll() is not None
    assert reached(view.page) == ''


def test_a_page_whose_host_is_stopped_ends_with_the_run_as_well():
    with opened('web') as (view, process):
        wait_until(lambda: reached(view.page))
        process.send_signal(signal.SIGSTOP)
        wait_until(lambda: ') T ' in Path(f'/proc/{process.pid}/stat').read_text())
    assert process.poll() == -signal.SIGKILL


@pytest.mark.parametrize(
    ('number', 'words'),
    [(signal.SIGKILL, '9, Killed'), (signal.SIGTERM, '15, Terminated')],
)
def test_a_page_whose_host_is_killed_is_an_error_in_the_diagnostics(number, words):
    with opened('web') as (view, process):
        errors = []
        worker = Worker('view', view, capacity=10, period=0.01, on_error=errors.append)
        wait_until(lambda: reached(view.page))
        assert errors == []
        process.send_signal(number)
        wait_until(lambda: worker.error)
        worker.close(PATIENCE)
        health = Health('web', worker.dropped, worker.error, view.trouble)
        _, status = Watch('linkage_node').report(Timekeeping(), {}, {'viewer': health}, [])
    assert status.level == ERROR
    assert status.message.startswith(f'failed: the viewer has ended (signal {words})')
    assert len(errors) == 1


def stop_listening(port):
    """As if Rerun's server had ended, which is a thread of this process."""
    for entry in Path('/proc/self/fd').iterdir():
        with (
            suppress(OSError, TypeError, IndexError),
            socket.socket(fileno=os.dup(int(entry.name))) as other,
        ):
            if other.getsockname()[1] == port:
                other.shutdown(socket.SHUT_RDWR)


def test_data_that_are_no_longer_served_are_a_warning_in_the_diagnostics(window):
    window('exec sleep 30')
    with opened('spawn') as (view, _):
        assert view.trouble == ''
        stop_listening(urllib.parse.urlsplit(view.url).port)
        assert view.trouble == f'the data are no longer served at {view.url}: start the run again'
        health = Health('spawn', 0, None, view.trouble)
        _, status = Watch('linkage_node').report(Timekeeping(), {}, {'viewer': health}, [])
    assert (status.level, status.message) == (WARN, health.trouble)


def test_a_page_ends_with_a_run_that_is_killed():
    with subprocess.Popen(
        [sys.executable, '-c', HOSTING], stdout=subprocess.PIPE, text=True
    ) as run:
        pid, page = run.stdout.readline().split()
        wait_until(lambda: reached(page))
        run.kill()
        wait_until(lambda: not reached(page))
    wait_until(lambda: not Path(f'/proc/{pid}/exe').exists())


# ---------------------------------------------------------------- a viewer elsewhere


def free_port():
    with socket.socket() as probe:
        probe.bind(('127.0.0.1', 0))
        return probe.getsockname()[1]


@contextmanager
def running(*arguments, port=None):
    """A viewer without a window, and its URL."""
    port = port or free_port()
    command = [PROGRAM, *arguments, '--bind', '127.0.0.1', '--port', str(port)]
    with subprocess.Popen(
        command, stderr=subprocess.DEVNULL, env={**os.environ, 'CI': '1'}
    ) as process:
        try:
            yield process, f'rerun+http://127.0.0.1:{port}/proxy'
        finally:
            process.kill()


def test_a_viewer_at_a_url_gets_all_there_is(tmp_path):
    saved = tmp_path / 'saved.rrd'
    samples, _ = run_of(CONFIGURATION, 300)
    with running('--save', str(saved)) as (_, url):
        show(url, samples)
        wait_until(lambda: len(stamps_in(saved)) == len(samples))
    assert stamps_in(saved) == [sample.stamp for sample in samples]


def test_a_viewer_that_comes_late_ends_and_comes_again_gets_what_is_shown_while_it_is_there(
    tmp_path, monkeypatch
):
    monkeypatch.setattr(rerun_sender, '_ANSWER_SECONDS', 0.0)
    monkeypatch.setattr(rerun_sender, '_RETRY_SECONDS', 0.05)
    samples, _ = run_of(CONFIGURATION, 300)
    port = free_port()
    url = f'rerun+http://127.0.0.1:{port}/proxy'
    view = View(CONFIGURATION, url)
    for n in range(2):
        assert view.trouble.startswith(f'no viewer answers at {url}: states are left out')
        before = view.dropped
        view.consume(samples[:100])
        assert view.dropped == before + 100
        saved = tmp_path / f'{n}.rrd'
        with running('--save', str(saved), port=port) as (process, _):

            def is_taken():
                before = view.dropped
                view.consume(samples[:1])
                return view.dropped == before

            wait_until(is_taken)
            assert view.trouble == ''
            view.consume(samples[100:])
            wait_until(lambda saved=saved: len(stamps_in(saved)) == 201)
            process.kill()
            process.wait()
        # What never changes came again as well.
        assert read(saved)['/joint_states/effort']['SeriesLines:names'] == [list(JOINTS)]
        assert stamps_in(saved) == [s.stamp for s in (samples[0], *samples[100:])]
        wait_until(lambda: view.consume(samples[:1]) or view.trouble)
    start = time.monotonic()
    view.close()
    assert time.monotonic() - start < 3


def test_a_viewer_that_stops_reading_is_left_out_until_it_reads_again():
    rng = np.random.default_rng(1)
    rows = [tuple(row) for row in rng.random((4000, 3)).tolist()]
    samples = [Sample(k * 10**6, row, row, row) for k, row in enumerate(rows)]
    with running('--serve-grpc') as (process, url):
        view = View(CONFIGURATION, url)
        view.consume(samples)
        process.send_signal(signal.SIGSTOP)
        longest = 0.0
        for _ in range(100):
            if view.dropped:
                break
            start = time.monotonic()
            view.consume(samples)
            longest = max(longest, time.monotonic() - start)
        view.consume(samples)
        assert view.dropped == 2 * len(samples)
        assert longest < 3
        process.send_signal(signal.SIGCONT)

        def is_taken():
            before = view.dropped
            view.consume(samples[:1])
            return view.dropped == before

        wait_until(is_taken)
        process.send_signal(signal.SIGSTOP)
        start = time.monotonic()
        view.close()
        assert time.monotonic() - start < 3


STUCK = """
import socket, sys, threading, time
from linkage_ros.parameters.configuration import load
from linkage_ros.view.rerun_view import Sample, View
from linkage_ros.run.worker import Worker
server = socket.create_server(('127.0.0.1', 0))
kept = []
def accept():
    while True:
        kept.append(server.accept())
if sys.argv[1] == 'accept':
    threading.Thread(target=accept, daemon=True).start()
view = View(load('quadrilateral'), f'rerun+http://127.0.0.1:{server.getsockname()[1]}/proxy')
errors = []
worker = Worker('view', view, capacity=100, period=0.005, on_error=errors.append)
longest, end = 0.0, time.monotonic() + 3.0
while time.monotonic() < end:
    start = time.monotonic()
    worker.offer(Sample(time.time_ns(), (1.0,) * 3, (2.0,) * 3, (3.0,) * 3))
    longest = max(longest, time.monotonic() - start)
    time.sleep(0.0005)
start = time.monotonic()
worker.close(10.0)
print(longest, time.monotonic() - start, view.dropped, errors)
"""


@pytest.mark.parametrize('server', ['accept', 'ignore'])
def test_a_process_ends_though_its_viewer_never_reads(server):
    done = subprocess.run(
        [sys.executable, '-c', STUCK, server],
        capture_output=True, text=True, check=False, timeout=PATIENCE,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    longest, closing, dropped, errors = done.stdout.split(maxsplit=3)
    assert errors == '[]\n'
    assert float(longest) < 3
    assert float(closing) < 3
    assert int(dropped) > 0


@pytest.mark.parametrize('bind', ['0.0.0.0', '127.0.0.1'])
def test_a_page_for_everybody_asks_for_this_machine_by_name(window, bind):
    window('exec sleep 30')
    with opened('web', bind) as (view, _):
        host = socket.gethostname() if bind == '0.0.0.0' else bind
        assert re.fullmatch(rf'rerun\+http://{host}:\d+/proxy', view.url)
        asked = urllib.parse.quote(view.url, safe='')
        assert re.fullmatch(rf'http://{host}:\d+/\?url={asked}', view.page)


@pytest.mark.parametrize('host', ['a..b', 'a' * 70])
def test_a_name_that_no_host_can_have_does_not_answer(host):
    assert not targets.answers((host, 9876), 0.0)


def test_what_is_no_address_is_refused():
    with pytest.raises(ViewerError, match='is no address of a viewer'):
        View(CONFIGURATION, 'rerun+http://[:::::]:9876/proxy')


def test_rerun_switched_off_is_said(tmp_path, monkeypatch):
    monkeypatch.setenv('RERUN', 'off')
    with pytest.raises(ViewerError, match='unset RERUN'):
        View(CONFIGURATION, str(tmp_path / 'run.rrd'))


def test_a_pipe_is_no_recording(tmp_path):
    os.mkfifo(tmp_path / 'run.rrd')
    with pytest.raises(ViewerError, match='cannot be written'):
        View(CONFIGURATION, str(tmp_path / 'run.rrd'), overwrite=True)


def test_a_recording_that_another_run_writes_is_kept(tmp_path):
    path = tmp_path / 'run.rrd'
    with closing(View(CONFIGURATION, str(path))) as view:
        view.consume(run_of(CONFIGURATION, 5)[0])
        with pytest.raises(ViewerError, match='is being written by another run and is kept'):
            View(CONFIGURATION, str(path), overwrite=True)
    assert len(read(path)['/joint_states/effort']['ros2_timestamp']) == 5
    View(CONFIGURATION, str(path), overwrite=True).close()  # of a run that has ended
