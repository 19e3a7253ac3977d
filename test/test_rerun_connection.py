# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The live view: its data in a file, access to its page, and viewers that fail.

No window is opened. Instead, RERUN_CLI_PATH names a script that replaces the viewer, which Rerun's
own command also supports.
"""

import http.client
import os
import re
import signal
import socket
import subprocess
import threading
import urllib.parse
import urllib.request
import warnings
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest
from ros_harness import PATIENCE, finished, stop, wait_for
from ros_harness import running as running_program

from linkage_ros import ViewerError
from linkage_ros.programs.record import record
from linkage_ros.run.states import Simulator
from linkage_ros.settings.configuration import load
from linkage_ros.units import NS_PER_S
from linkage_ros.view import rerun_connection
from linkage_ros.view.rerun_connection import View
from linkage_ros.view.viewer_process import free_address

rerun_chunk = pytest.importorskip('rerun.chunk')

PROGRAM = Path(rerun_connection.rr.__file__).parents[1] / 'rerun_cli' / 'rerun'
WALL = 1_795_000_000_000_000_000
CONFIGURATION = load('quadrilateral')


def run_of(configuration, count, rate=200, start=0):
    """Returns the stamps and states of a run from its start."""
    simulator = Simulator(configuration.only)
    motion, stamps = simulator.begin(start), [start + n * 10**9 // rate for n in range(count)]
    return [(stamp, {'': simulator.state(motion.at(stamp))}) for stamp in stamps]


def show(path, samples, configuration=CONFIGURATION, batch=37, **options):
    view = View(configuration, str(path), **options)
    for start in range(0, len(samples), batch):
        view.consume(samples[start : start + batch])
    view.close()
    return view


def read(path, *, blueprint=False):
    """Reads a file with Rerun's reader: {entity: {column: values in order}} from Arrow."""
    with warnings.catch_warnings():
        warnings.filterwarnings('ignore', 'RRD file has no footer')
        reader = rerun_chunk.RrdReader(path)
    found = {}
    for chunk in reader.stream(store=reader.blueprints()[0] if blueprint else None):
        columns = found.setdefault(str(chunk.entity_path), {})
        batch = chunk.to_record_batch()
        for name, column in zip(batch.schema.names, batch.columns, strict=True):
            is_time = str(column.type).startswith(('timestamp', 'duration'))
            values = column.cast('int64') if is_time else column
            columns.setdefault(name, []).extend(values.to_pylist())
            columns[f'{name} type'] = str(column.type)
    return found


def stamps_in(path):
    """Returns the stamps of the curves in a file; () if there are none yet."""
    try:
        return read(path)['/values']['ros2_timestamp']
    except (ValueError, OSError, KeyError, RuntimeError):
        return ()


SAMPLES = run_of(CONFIGURATION, 300)
STAMPS = [stamp for stamp, _ in SAMPLES]


# ---------------------------------------------------------------- contents of a file


@pytest.mark.parametrize(('start', 'kind'), [(0, 'duration[ns]'), (WALL, 'timestamp[ns]')])
def test_file_holds_every_sample(tmp_path, start, kind):
    samples = run_of(CONFIGURATION, 500, start=start)
    view = show(tmp_path / 'run.rrd', samples)
    stamps, states = map(list, zip(*samples, strict=True))
    curves = read(tmp_path / 'run.rrd')['/values']
    assert (curves['ros2_timestamp type'], curves['ros2_timestamp']) == (kind, stamps)
    torques = [state[''].torque for state in states]
    assert [row[0] for row in curves['Scalars:scalars']] == torques
    assert (view.dropped, view.page) == (0, '')
    with pytest.warns(match='RRD file has no footer'):  # a footer would grow in memory
        rerun_chunk.RrdReader(tmp_path / 'run.rrd')


@pytest.mark.parametrize(('rate', 'drawings'), [(400, 100), (10, 20)])
def test_at_most_50_drawings_per_second_of_stamps(tmp_path, rate, drawings):
    show(tmp_path / 'run.rrd', run_of(CONFIGURATION, 2 * rate, rate), batch=7)
    found = read(tmp_path / 'run.rrd')
    assert len(found['/linkage/moving']['ros2_timestamp']) == drawings
    assert len(found['/values']['ros2_timestamp']) == 2 * rate


def test_large_batches_and_later_rounds_are_all_shown(tmp_path, monkeypatch):
    monkeypatch.setattr(rerun_connection, '_BATCH', 100)
    view = View(CONFIGURATION, str(tmp_path / 'run.rrd'))
    for shift in (0, 10**10):
        view.consume([(shift + stamp, state) for stamp, state in SAMPLES])
    view.close()
    assert stamps_in(tmp_path / 'run.rrd') == STAMPS + [stamp + 10**10 for stamp in STAMPS]


# Common first lines of the programs below.
PROLOGUE = """
import os, resource, signal, socket, sys, threading, time
from linkage_ros import ViewerError
from linkage_ros.settings.configuration import load
from linkage_ros.programs.record import record
from linkage_ros.node.workers import Worker
from linkage_ros.view import rerun_connection
from linkage_ros.view.rerun_connection import View
from linkage_ros.mechanism.kinematics import State
samples = [(k * 10**7, {'': State((k / 7, 1.0, 2.0), (0.0,) * 3, (0.0,) * 3, 0.0)})
           for k in range(1000)]
"""


def run_program(code, *arguments):
    done = finished(PROLOGUE + code, *arguments)
    assert 'Traceback' not in done.stderr, done.stderr
    return done


def test_file_of_a_killed_run_is_readable(tmp_path):
    code = """
view = View(load('quadrilateral'), sys.argv[1])
for sample in samples:
    view.consume([sample])
os.kill(os.getpid(), signal.SIGKILL)
"""
    run_program(code, tmp_path / 'run.rrd')
    assert len(stamps_in(tmp_path / 'run.rrd')) >= 980


def test_full_disk_is_one_error(tmp_path):
    code = """
rerun_connection._WRITE_SECONDS, rerun_connection._CLOSE_SECONDS = 0.5, 0.6
resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))
view = View(load('quadrilateral'), sys.argv[1])
try:
    for sample in samples:
        view.consume([sample] * 10)
except ViewerError as error:
    print(error)
view.close()
"""
    done = run_program(code, tmp_path / 'run.rrd')
    assert done.stdout == f'{tmp_path}/run.rrd cannot be written: is the disk full?\n'
    assert done.stderr == ''  # without Rerun's own messages


# ---------------------------------------------------------------- invalid targets


VALID = re.escape('is not one of: spawn, web, rerun+http://HOST:PORT/proxy or a .rrd path')


@pytest.mark.parametrize(
    ('target', 'overwrite', 'words'),
    [('', False, VALID), ('http://x/run.rrd', False, VALID),
     ('rerun+http://127.0.0.1:65536/proxy', False, VALID),
     ('folder.rrd', False, 'is a folder: add a file name'),
     ('no/way/run.rrd', False, 'cannot be written: there is no folder no$'),
     ('pipe.rrd', False, 'already exists'),
     ('pipe.rrd', True, 'cannot be written'),
     ('old.rrd', False, 'already exists: choose .* give --overwrite .a node: log_overwrite.'),
     ('busy.rrd', True, 'is being written by another run')],
)  # fmt: skip
def test_wrong_target_is_refused_and_left_alone(tmp_path, monkeypatch, target, overwrite, words):
    monkeypatch.chdir(tmp_path)
    Path('folder.rrd').mkdir()
    os.mkfifo('pipe.rrd')
    Path('old.rrd').write_text('precious')
    busy = View(CONFIGURATION, 'busy.rrd')
    with pytest.raises(ViewerError, match=words):
        View(CONFIGURATION, target, overwrite=overwrite)
    assert Path('old.rrd').read_text() == 'precious'
    busy.consume(SAMPLES)
    busy.close()
    assert stamps_in('busy.rrd') == STAMPS
    show('busy.rrd', SAMPLES[:5], overwrite=True)
    assert stamps_in('busy.rrd') == STAMPS[:5]


# ---------------------------------------------------------------- viewer window


@pytest.fixture
def window(tmp_path, monkeypatch):
    """Installs a script in place of the viewer window; returns the function that does so."""

    def install(script, answers=False):
        path = tmp_path / 'window'
        path.write_text(f'#!/bin/sh\n{script}\n')
        path.chmod(0o755)
        monkeypatch.setenv('RERUN_CLI_PATH', str(path))
        monkeypatch.setenv('DISPLAY', ':99')
        monkeypatch.delenv('CI', raising=False)
        # On a busy machine, a viewer needs more time than it gets outside of tests.
        for limit in ('_ANSWER_SECONDS', '_SEND_SECONDS', '_CLOSE_SECONDS') if answers else ():
            monkeypatch.setattr(rerun_connection, limit, PATIENCE)
        if not answers:
            monkeypatch.setattr(rerun_connection, '_ANSWER_SECONDS', 0.0)

    return install


@contextmanager
def opened(*arguments):
    view = View(CONFIGURATION, *arguments)
    process = view._process.process
    try:
        yield view, process
    finally:
        view.close()
        process.kill()
        process.wait()


def test_window_gets_everything_and_outlives_the_run(tmp_path, window):
    saved, told = tmp_path / 'saved.rrd', tmp_path / 'told'
    window(
        f'(echo "$@"; env) >{told}\nsleep 0.5\nexec {PROGRAM} --save {saved} "$@"', answers=True
    )
    with opened('spawn') as (view, process):
        assert os.getpgid(process.pid) != os.getpgrp()  # not in the process group that gets Ctrl-C
        for start in range(0, 300, 10):
            view.consume(SAMPLES[start : start + 10])
        assert view.dropped == 0
        view.close()
        wait_for(lambda: len(stamps_in(saved)) == len(STAMPS))
        assert stamps_in(saved) == STAMPS
        assert process.poll() is None
    arguments, *environment = told.read_text().splitlines()
    assert re.match(r'--bind 127\.0\.0\.1 --port \d+ ', arguments)
    assert 'CI=1' in environment  # it sends no statistics


@pytest.mark.parametrize('end', ['exit 0', 'kill -TERM $$'])
def test_closing_the_window_does_not_disturb_the_run(window, end):
    window(end)
    with opened('spawn') as (view, process):
        process.wait(PATIENCE)
        view.consume(SAMPLES)
        assert view.dropped == 0


@pytest.mark.parametrize(
    ('target', 'script', 'words'),
    [('spawn', 'echo noise >&2; echo "Error: winit: no X server" >&2; exit 1',
      r'^the viewer has ended \(Error: winit: no X server\): restart the run'),
     ('spawn', 'kill -SEGV $$', r'^the viewer has ended \(signal 11, Segmentation'),
     ('web', 'echo "Port in use" >&2', r'^the viewer has ended \(Port in use\)')],
)  # fmt: skip
def test_failing_viewer_reports_the_reason(window, target, script, words):
    window(script)
    with opened(target) as (view, process):
        process.wait(PATIENCE)
        with pytest.raises(ViewerError, match=words):
            view.consume([])


@pytest.mark.parametrize(
    ('settings', 'bind', 'words'),
    [({'RERUN_CLI_PATH': '/nothing'}, '127.0.0.1', 'no viewer program at /nothing: pip install'),
     ({'RERUN_CLI_PATH': __file__}, '127.0.0.1', 'no viewer program at .*test_rerun_connection'),
     ({}, '203.0.113.7', r"^viewer_bind = '203.0.113.7' is not an address of this machine"),
     ({'DISPLAY': ''}, '127.0.0.1', r'^no screen for a viewer window .*DISPLAY.*: give web')],
)  # fmt: skip
def test_window_that_cannot_be_opened_is_refused(window, monkeypatch, settings, bind, words):
    window('exec sleep 30')
    for name in ('WAYLAND_DISPLAY', 'WAYLAND_SOCKET'):
        monkeypatch.delenv(name, raising=False)
    for name, value in settings.items():
        monkeypatch.setenv(name, value)
    with pytest.raises(ViewerError, match=words):
        View(CONFIGURATION, 'spawn', bind)


# ---------------------------------------------------------------- browser page


def reached(page):
    # A server that is killed while it answers sends only a part.
    failures = OSError, http.client.HTTPException
    with suppress(*failures), urllib.request.urlopen(page, timeout=PATIENCE) as answer:
        return answer.read().decode()
    return ''


def served(url):
    """Returns the addresses that listen at a URL's port, as the kernel formats them."""
    port = urllib.parse.urlsplit(url).port
    tables = ''.join(Path(f'/proc/net/{name}').read_text() for name in ('tcp', 'tcp6'))
    sockets = [line.split() for line in tables.splitlines()]
    ends = [s[1] for s in sockets if s[1].endswith(f':{port:04X}') and s[3] == '0A']
    return [end.partition(':')[0] for end in ends]


@pytest.mark.parametrize(
    ('bind', 'host', 'address'),
    [('127.0.0.1', '127.0.0.1', '0100007F'), ('0.0.0.0', socket.gethostname(), '00000000'),
     ('::1', '[::1]', '00000000000000000000000001000000')],
)  # fmt: skip
def test_page_is_served_on_viewer_bind_alone_and_ends_with_the_run(
    monkeypatch, bind, host, address
):
    monkeypatch.delenv('DISPLAY', raising=False)
    with opened('web', bind) as (view, process):
        page = view.page
        port = urllib.parse.urlsplit(page).port
        here = f'http://[::1]:{port}' if ':' in bind else f'http://127.0.0.1:{port}'
        wait_for(lambda: 'rerun' in reached(here).lower())
        data = urllib.parse.parse_qs(urllib.parse.urlsplit(page).query)['url'][0]
        assert page.startswith(f'http://{host}:{port}/?url=rerun%2Bhttp%3A')
        assert re.fullmatch(rf'rerun\+http://{re.escape(host)}:\d+/proxy', data)
        assert (served(page), served(data)) == ([address], [address])
        assert not view.is_watched()
        view.consume(SAMPLES)
        with socket.create_connection((host.strip('[]'), urllib.parse.urlsplit(data).port)):
            wait_for(view.is_watched)
        wait_for(lambda: not view.is_watched())
        assert view.dropped == 0
        process.send_signal(signal.SIGSTOP)  # even if it is stuck, it ends with the run
        view.close()
        assert process.poll() == -signal.SIGKILL
    assert (served(page), served(data)) == ([], [])


def test_page_that_ends_early_is_an_error():
    with opened('web') as (view, process):
        process.kill()
        process.wait(PATIENCE)
        with pytest.raises(ViewerError, match=r'^the viewer has ended \(signal 9, Killed\)'):
            view.consume([])


def test_page_ends_with_a_killed_run():
    code = """
view = View(load('quadrilateral'), 'web')
print(view._process.process.pid, view.page, flush=True)
time.sleep(600)
"""
    with running_program(PROLOGUE + code, domain=0) as run:
        pid, page = run.stdout.readline().split()
        wait_for(lambda: reached(page))
        run.kill()
        wait_for(lambda: not reached(page))
    wait_for(lambda: not Path(f'/proc/{pid}/exe').exists())


@pytest.fixture(scope='module')
def log(tmp_path_factory):
    path = tmp_path_factory.mktemp('log') / 'run.mcap'
    record(CONFIGURATION, path, duration=1.0)
    return path


@contextmanager
def page_of(log, *options):
    """Replays a log on a page, 20 times as fast; yields the process and the page's URL."""
    words = log, '--viewer', 'web', '--no-ros', '--no-open', '--rate', 20, *options
    with running_program('replay', *words, domain=0) as process:
        yield process, re.search(r'until Ctrl-C; .*(http://\S+)\n', process.stdout.readline())[1]


@contextmanager
def late_viewer(page, saved):
    """Connects a viewer to the data of a page; yields a function that returns its stamps."""
    data = urllib.parse.parse_qs(urllib.parse.urlsplit(page).query)['url'][0]
    with running(free_address('127.0.0.1')[1], data, '--save', saved):
        yield lambda: stamps_in(saved)


def test_page_of_a_replay_serves_late_viewers_until_ctrl_c(log, tmp_path):
    first, late = tmp_path / 'first.rrd', tmp_path / 'late.rrd'
    with page_of(log) as (process, page):
        with late_viewer(page, first) as stamps:
            wait_for(lambda: max(stamps(), default=0) > 20 * NS_PER_S)
        passed = max(stamps_in(first))
        with late_viewer(page, late) as stamps:
            wait_for(lambda: max(stamps(), default=0) > passed + NS_PER_S)
        assert 'rerun' in reached(page).lower()
        stop(process)
    assert '/linkage/fixed' in read(late)
    assert read(late, blueprint=True)
    assert not reached(page)


# ---------------------------------------------------------------- remote viewer


@contextmanager
def running(port, *arguments):
    """Runs a viewer without a window; returns its process."""
    command = [PROGRAM, *arguments, '--bind', '127.0.0.1', '--port', str(port)]
    with subprocess.Popen(
        command, stderr=subprocess.DEVNULL, env={**os.environ, 'CI': '1'}
    ) as process:
        try:
            yield process
        finally:
            process.kill()


def test_viewer_may_start_late_end_and_restart(tmp_path, monkeypatch):
    monkeypatch.setattr(rerun_connection, '_ANSWER_SECONDS', 0.0)
    host, port = free_address('127.0.0.1')
    url = f'rerun+http://{host}:{port}/proxy'
    view = View(CONFIGURATION, url)

    def is_taken():
        before = view.dropped
        view.consume(SAMPLES[:1])
        return view.dropped == before

    for n in range(2):
        assert view.trouble.startswith(f'no viewer answers at {url}: states are dropped')
        assert not is_taken()
        saved = tmp_path / f'{n}.rrd'
        with running(port, '--save', saved):
            wait_for(is_taken)
            assert view.trouble == ''
            view.consume(SAMPLES[100:])
            wait_for(lambda saved=saved: view.consume([]) or len(stamps_in(saved)) == 201)
        # The constant components were sent again.
        assert read(saved)['/linkage/moving']['Points2D:labels'] == [['A', 'B', 'coupler_point']]
        assert stamps_in(saved) == [STAMPS[0], *STAMPS[100:]]
        wait_for(lambda: not is_taken() and 'no viewer answers' in view.trouble)
    closing = threading.Thread(target=view.close, daemon=True)
    closing.start()
    closing.join(PATIENCE)
    assert not closing.is_alive()


def test_process_ends_even_if_its_viewer_never_reads():
    code = """
server = socket.create_server(('127.0.0.1', 0))
kept = []
def accept():
    while True:
        kept.append(server.accept())
threading.Thread(target=accept, daemon=True).start()
rerun_connection._SEND_SECONDS = 0.5
view = View(load('quadrilateral'), f'rerun+http://127.0.0.1:{server.getsockname()[1]}/proxy')
errors = []
worker = Worker('view', view, capacity=100, period=0.005, on_error=errors.append)
while not view.dropped:
    worker.offer(samples[0])
    time.sleep(0.0005)
print(worker.close(1e6), errors)  # False if closing hangs
"""
    assert run_program(code).stdout == 'True []\n'
