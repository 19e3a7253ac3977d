# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The live view: what a reader finds in it, who can read it, and viewers that do not behave.

No window is opened. Where one is asked for, RERUN_CLI_PATH names a script that takes its place,
as Rerun's own command allows.
"""

import os
import re
import signal
import socket
import subprocess
import sys
import time
import urllib.parse
import urllib.request
import warnings
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

import pytest
from ros_harness import wait_for

from linkage_ros import ViewerError
from linkage_ros.log.writer import LogWriter
from linkage_ros.parameters.configuration import load
from linkage_ros.run.health import Health, HealthMonitor
from linkage_ros.run.simulator import Simulator
from linkage_ros.run.ticker import TickCounts
from linkage_ros.run.worker import Worker
from linkage_ros.view import rerun_sender, rerun_view
from linkage_ros.view.rerun_view import View
from linkage_ros.wire.cdr import ERROR
from linkage_ros.wire.codecs import JointStateCodec
from linkage_ros.wire.topics import JOINT_STATES

rerun_chunk = pytest.importorskip('rerun.chunk')

PROGRAM = Path(rerun_sender.rr.__file__).parents[1] / 'rerun_cli' / 'rerun'
PATIENCE = 20.0  # s, until a wait that must end counts as a hang
WALL = 1_795_000_000_000_000_000
JOINTS = ('crank', 'coupler', 'rocker')
QUANTITIES = ('position', 'velocity', 'effort')
CONFIGURATION = load('quadrilateral')


class Sample(NamedTuple):
    """Joint states at a stamp."""

    stamp: int
    position: tuple[float, ...]
    velocity: tuple[float, ...]
    effort: tuple[float, ...]


def run_of(configuration, count, rate=200, start=0):
    """The samples of a run from its beginning, and the solved states."""
    simulator = Simulator(configuration)
    motion, samples, states = simulator.begin(start), [], []
    for stamp in (start + tick * 10**9 // rate for tick in range(count)):
        snapshot = simulator.snapshot_at(motion, stamp)
        numbers = simulator.joint_states.decode(snapshot.messages[0])[1]
        count = len(simulator.joints)
        samples.append(Sample(stamp, *(numbers[i * count :][:count] for i in range(3))))
        states.append(snapshot.state)
    return samples, states


def feed(view, samples, configuration=CONFIGURATION, shift=0):
    codec = Simulator(configuration).joint_states
    view.consume([(shift, codec.encode(*sample)) for sample in samples])


def show(path, samples, configuration=CONFIGURATION, batch=37, **options):
    view = View(configuration, str(path), **options)
    for start in range(0, len(samples), batch):
        feed(view, samples[start : start + batch], configuration)
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


# ---------------------------------------------------------------- what a file holds


@pytest.mark.parametrize(('start', 'kind'), [(0, 'duration[ns]'), (WALL, 'timestamp[ns]')])
def test_file_holds_every_sample_bit_for_bit(tmp_path, start, kind):
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
    assert (view.dropped, view.sender.url, view.sender.exposed) == (0, None, False)


@pytest.mark.parametrize(('rate', 'drawings'), [(400, 100), (10, 20)])
def test_at_most_50_drawings_per_second_of_stamps(tmp_path, rate, drawings):
    samples, _ = run_of(CONFIGURATION, 2 * rate, rate)
    show(tmp_path / 'run.rrd', samples, batch=7)
    found = read(tmp_path / 'run.rrd')
    assert len(found['/linkage/crank']['ros2_timestamp']) == drawings
    assert len(found['/joint_states/effort']['ros2_timestamp']) == 2 * rate


def test_more_samples_than_a_batch_are_all_shown(tmp_path, monkeypatch):
    monkeypatch.setattr(rerun_view, '_BATCH', 100)
    samples, _ = run_of(CONFIGURATION, 450)
    assert show(tmp_path / 'run.rrd', samples, batch=450).dropped == 0
    stamps = read(tmp_path / 'run.rrd')['/joint_states/position']['ros2_timestamp']
    assert stamps == [sample.stamp for sample in samples]


def test_stamps_of_a_later_round_are_shifted(tmp_path):
    samples, _ = run_of(CONFIGURATION, 3)
    view = View(CONFIGURATION, str(tmp_path / 'run.rrd'))
    for shift in (0, 10**9):
        feed(view, samples, shift=shift)
    view.close()
    stamps = read(tmp_path / 'run.rrd')['/joint_states/position']['ros2_timestamp']
    first = [sample.stamp for sample in samples]
    assert stamps == first + [stamp + 10**9 for stamp in first]


def test_series_have_the_names_that_an_opened_log_has(tmp_path):
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


def test_file_of_a_killed_run_is_readable(tmp_path):
    code = """
import os, signal, sys
from linkage_ros.parameters.configuration import load
from linkage_ros.view.rerun_view import View
from linkage_ros.wire.codecs import JointStateCodec
codec = JointStateCodec(('crank', 'coupler', 'rocker'))
view = View(load('quadrilateral'), sys.argv[1])
for k in range(100):
    view.consume([(0, codec.encode(k * 10**7, (k / 7, 1.0, 2.0), (0.0,) * 3, (0.0,) * 3))])
os.kill(os.getpid(), signal.SIGKILL)
"""
    subprocess.run(
        [sys.executable, '-c', code, tmp_path / 'run.rrd'], check=False, timeout=PATIENCE
    )
    assert len(read(tmp_path / 'run.rrd')['/joint_states/effort']['ros2_timestamp']) >= 99


# ---------------------------------------------------------------- targets that are none


VALID = re.escape('is not one of: spawn, web, rerun+http://HOST:PORT/proxy or a .rrd path')


@pytest.mark.parametrize(
    ('target', 'words'),
    [('', VALID), ('http://x/run.rrd', VALID), ('rerun+http://127.0.0.1:65536/proxy', VALID),
     ('folder.rrd', 'exists already and is kept'),
     ('none/run.rrd', 'cannot be written: No such file'),
     ('pipe.rrd', 'exists already and is kept'),
     ('old.rrd', 'exists already and is kept: choose .* set log_overwrite')],
)  # fmt: skip
def test_wrong_target_is_refused_and_left_alone(tmp_path, monkeypatch, target, words):
    monkeypatch.chdir(tmp_path)
    Path('folder.rrd').mkdir()
    os.mkfifo('pipe.rrd')
    Path('old.rrd').write_text('precious')
    with pytest.raises(ViewerError, match=words):
        View(CONFIGURATION, target)
    assert Path('old.rrd').read_text() == 'precious'


def test_log_overwrite_replaces_a_file_but_not_a_pipe(tmp_path):
    os.mkfifo(tmp_path / 'pipe.rrd')
    with pytest.raises(ViewerError, match='cannot be written'):
        View(CONFIGURATION, str(tmp_path / 'pipe.rrd'), overwrite=True)
    (tmp_path / 'run.rrd').write_text('old')
    show(tmp_path / 'run.rrd', run_of(CONFIGURATION, 5)[0], overwrite=True)
    assert len(read(tmp_path / 'run.rrd')['/joint_states/effort']['ros2_timestamp']) == 5


def test_full_disk_is_one_error(tmp_path):
    code = """
import resource, sys
from linkage_ros import ViewerError
from linkage_ros.view import rerun_sender
from linkage_ros.parameters.configuration import load
from linkage_ros.view.rerun_view import View
from linkage_ros.wire.codecs import JointStateCodec
rerun_sender._WRITE_SECONDS = 0.5
resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))
codec = JointStateCodec(('crank', 'coupler', 'rocker'))
view = View(load('quadrilateral'), sys.argv[1])
try:
    for k in range(1000):
        message = codec.encode(k * 10**7, (k / 7, 1.0, 2.0), (0.0,) * 3, (0.0,) * 3)
        view.consume([(0, message)] * 10)
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


# ---------------------------------------------------------------- a window of one's own


@pytest.fixture
def window(tmp_path, monkeypatch):
    """Installs what is run in place of a window; returns how."""

    def install(script):
        path = tmp_path / 'window'
        path.write_text(f'#!/bin/sh\n{script}\n')
        path.chmod(0o755)
        monkeypatch.setenv('RERUN_CLI_PATH', str(path))
        monkeypatch.setenv('DISPLAY', ':99')
        monkeypatch.delenv('CI', raising=False)

    return install


@contextmanager
def opened(*arguments, **options):
    view = View(CONFIGURATION, *arguments, **options)
    process = view._process.process if view._process else None
    try:
        yield view, process
    finally:
        view.close()
        if process:
            process.kill()
            process.wait()


def served(port):
    """Addresses at which somebody takes connections at a port, as the kernel writes them."""
    tables = ''.join(Path(f'/proc/net/{name}').read_text() for name in ('tcp', 'tcp6'))
    sockets = [line.split() for line in tables.splitlines()]
    return [s[1] for s in sockets if s[1].endswith(f':{port:04X}') and s[3] == '0A']


def stamps_in(path):
    """The stamps in a file that is being written; () where there are none yet."""
    try:
        return read(path)['/joint_states/effort']['ros2_timestamp']
    except (ValueError, OSError, KeyError, RuntimeError):
        return ()


SAVE = f'exec {PROGRAM} "$1" --save "{{}}" --bind 127.0.0.1 --port auto'


def test_window_that_connects_late_gets_everything(tmp_path, window):
    saved = tmp_path / 'saved.rrd'
    window(f'sleep 0.5\n{SAVE.format(saved)}')
    samples, _ = run_of(CONFIGURATION, 400)
    with opened('spawn') as (view, _):
        for start in range(0, 400, 10):
            feed(view, samples[start : start + 10])
        wait_for(lambda: stamps_in(saved))
        feed(view, samples[:1])
        assert view.dropped == 0
        view.close()
        wait_for(lambda: len(stamps_in(saved)) > len(samples))
    assert stamps_in(saved) == [sample.stamp for sample in (*samples, samples[0])]


@pytest.mark.parametrize(
    ('bind', 'address', 'exposed'),
    [('127.0.0.1', '0100007F', False), ('0.0.0.0', '00000000', True),
     ('::1', '00000000000000000000000001000000', False)],
)  # fmt: skip
def test_data_is_served_only_on_viewer_bind(window, bind, address, exposed):
    window('exec sleep 30')
    with opened('spawn', bind) as (view, _):
        port = urllib.parse.urlsplit(view.sender.url).port
        assert served(port) == [f'{address}:{port:04X}']
        written = f'[{bind}]' if ':' in bind else bind
        assert view.sender.url == f'rerun+http://{written}:{port}/proxy'
        assert view.sender.exposed is exposed
    assert served(port) == []


def test_window_sends_no_statistics_and_listens_locally(tmp_path, window):
    window(f'(echo "$@"; env) >{tmp_path}/told~; mv {tmp_path}/told~ {tmp_path}/told')
    with opened('spawn') as (view, _):
        wait_for((tmp_path / 'told').exists)
    arguments, *environment = (tmp_path / 'told').read_text().splitlines()
    assert arguments.startswith(f'{view.sender.url} --bind 127.0.0.1 --port auto')
    assert 'CI=1' in environment


@pytest.mark.parametrize('end', ['exit 0', 'kill -TERM $$'])
def test_closing_the_window_does_not_disturb_the_run(window, end):
    window(end)
    with opened('spawn') as (view, process):
        process.wait(PATIENCE)
        feed(view, run_of(CONFIGURATION, 20)[0])
        assert view.dropped == 0


def test_window_outlives_the_run(window):
    window('exec sleep 30')
    with opened('spawn') as (view, process):
        assert os.getpgid(process.pid) != os.getpgrp()  # Ctrl-C in the terminal is not for it
        view.close()
        assert process.poll() is None


@pytest.mark.parametrize(
    ('script', 'words'),
    [('echo noise >&2; echo "Error: winit: no X server" >&2; exit 1',
      r'^the viewer could not be opened: winit: no X server$'),
     ('kill -SEGV $$', r'^the viewer has ended \(signal 11, Segmentation')],
)  # fmt: skip
def test_window_that_fails_says_why(window, script, words):
    window(script)
    with opened('spawn') as (view, process):
        process.wait(PATIENCE)
        with pytest.raises(ViewerError, match=words):
            view.consume([])


@pytest.mark.parametrize(
    ('path', 'words'), [('nothing', 'no viewer program at .*/nothing: pip install'),
                        ('denied', '/denied cannot be run: Permission denied')],
)  # fmt: skip
def test_missing_viewer_program_is_named(window, monkeypatch, tmp_path, path, words):
    window('exit 0')
    (tmp_path / 'denied').touch()
    monkeypatch.setenv('RERUN_CLI_PATH', str(tmp_path / path))
    with pytest.raises(ViewerError, match=words):
        View(CONFIGURATION, 'spawn')


def test_viewer_bind_that_is_not_a_local_address_is_refused(window):
    window('exec sleep 30')
    with pytest.raises(ViewerError, match=r"^viewer_bind = '203.0.113.7' is not an address of th"):
        View(CONFIGURATION, 'spawn', '203.0.113.7')


@pytest.mark.skipif(sys.platform != 'linux', reason='screens are named so on Linux')
def test_spawn_without_a_screen_is_refused(monkeypatch):
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
print(view._process.process.pid, view.page, flush=True)
time.sleep(60)
"""


def reached(page):
    with suppress(OSError), urllib.request.urlopen(page, timeout=PATIENCE) as answer:
        return answer.read().decode()
    return ''


def test_page_needs_no_screen_and_ends_with_the_run(monkeypatch):
    for name in ('DISPLAY', 'WAYLAND_DISPLAY', 'WAYLAND_SOCKET'):
        monkeypatch.delenv(name, raising=False)
    with opened('web') as (view, process):
        wait_for(lambda: 'rerun' in reached(view.page).lower())
        assert re.fullmatch(r'http://127\.0\.0\.1:\d+/\?url=rerun%2Bhttp%3A.*%2Fproxy', view.page)
        data = urllib.parse.parse_qs(urllib.parse.urlsplit(view.page).query)['url']
        assert data == [view.sender.url]
        feed(view, run_of(CONFIGURATION, 10)[0])
        port = urllib.parse.urlsplit(view.page).port
        assert served(port) == [f'0100007F:{port:04X}']  # 127.0.0.1, and nothing else
        assert process.poll() is None
        process.send_signal(signal.SIGSTOP)  # even if it is stuck, it ends with the run
        wait_for(lambda: ') T ' in Path(f'/proc/{process.pid}/stat').read_text())
    assert process.poll() == -signal.SIGKILL
    assert reached(view.page) == ''


def test_page_that_ends_early_is_an_error_in_the_diagnostics():
    with opened('web') as (view, process):
        errors = []
        worker = Worker('view', view, capacity=10, period=0.01, on_error=errors.append)
        wait_for(lambda: reached(view.page))
        assert errors == []
        process.kill()
        wait_for(lambda: worker.error)
        worker.close(PATIENCE)
        health = Health('web', worker.dropped, worker.error, view.sender.trouble)
        _, status = HealthMonitor('linkage_node').report(TickCounts(), {}, {'viewer': health}, [])
    assert status.level == ERROR
    assert status.message.startswith('failed: the viewer has ended (signal 9, Killed)')
    assert len(errors) == 1


def test_page_ends_with_a_killed_run():
    with subprocess.Popen(
        [sys.executable, '-c', HOSTING], stdout=subprocess.PIPE, text=True
    ) as run:
        pid, page = run.stdout.readline().split()
        wait_for(lambda: reached(page))
        run.kill()
        wait_for(lambda: not reached(page))
    wait_for(lambda: not Path(f'/proc/{pid}/exe').exists())


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


def test_viewer_may_come_late_end_and_come_again(tmp_path, monkeypatch):
    monkeypatch.setattr(rerun_sender, '_ANSWER_SECONDS', 0.0)
    monkeypatch.setattr(rerun_sender, '_RETRY_SECONDS', 0.05)
    samples, _ = run_of(CONFIGURATION, 300)
    port = free_port()
    url = f'rerun+http://127.0.0.1:{port}/proxy'
    view = View(CONFIGURATION, url)
    for n in range(2):
        assert view.sender.trouble.startswith(f'no viewer answers at {url}: states are left out')
        before = view.dropped
        feed(view, samples[:100])
        assert view.dropped == before + 100
        saved = tmp_path / f'{n}.rrd'
        with running('--save', str(saved), port=port) as (process, _):

            def is_taken():
                before = view.dropped
                feed(view, samples[:1])
                return view.dropped == before

            wait_for(is_taken)
            assert view.sender.trouble == ''
            feed(view, samples[100:])
            wait_for(lambda saved=saved: len(stamps_in(saved)) == 201)
            process.kill()
            process.wait()
        # What never changes came again as well.
        assert read(saved)['/joint_states/effort']['SeriesLines:names'] == [list(JOINTS)]
        assert stamps_in(saved) == [s.stamp for s in (samples[0], *samples[100:])]
        wait_for(lambda: feed(view, samples[:1]) or view.sender.trouble)
    start = time.monotonic()
    view.close()
    assert time.monotonic() - start < 6


STUCK = """
import socket, sys, threading, time
from linkage_ros.parameters.configuration import load
from linkage_ros.view.rerun_view import View
from linkage_ros.wire.codecs import JointStateCodec
from linkage_ros.run.worker import Worker
server = socket.create_server(('127.0.0.1', 0))
kept = []
def accept():
    while True:
        kept.append(server.accept())
threading.Thread(target=accept, daemon=True).start()
codec = JointStateCodec(('crank', 'coupler', 'rocker'))
message = codec.encode(0, (1.0,) * 3, (2.0,) * 3, (3.0,) * 3)
view = View(load('quadrilateral'), f'rerun+http://127.0.0.1:{server.getsockname()[1]}/proxy')
errors = []
worker = Worker('view', view, capacity=100, period=0.005, on_error=errors.append)
longest, end = 0.0, time.monotonic() + 3.0
while time.monotonic() < end:
    start = time.monotonic()
    worker.offer((0, message))
    longest = max(longest, time.monotonic() - start)
    time.sleep(0.0005)
start = time.monotonic()
worker.close(10.0)
print(longest, time.monotonic() - start, view.dropped, errors)
"""


def test_process_ends_though_its_viewer_never_reads():
    done = subprocess.run(
        [sys.executable, '-c', STUCK],
        capture_output=True, text=True, check=False, timeout=PATIENCE,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    longest, closing, dropped, errors = done.stdout.split(maxsplit=3)
    assert errors == '[]\n'
    assert float(longest) < 6
    assert float(closing) < 6
    assert int(dropped) > 0


@pytest.mark.parametrize('bind', ['0.0.0.0', '127.0.0.1'])
def test_page_on_all_addresses_names_this_machine(window, bind):
    window('exec sleep 30')
    with opened('web', bind) as (view, _):
        host = socket.gethostname() if bind == '0.0.0.0' else bind
        assert re.fullmatch(rf'rerun\+http://{host}:\d+/proxy', view.sender.url)
        asked = urllib.parse.quote(view.sender.url, safe='')
        assert re.fullmatch(rf'http://{host}:\d+/\?url={asked}', view.page)


def test_file_of_a_running_run_is_not_replaced(tmp_path):
    path = tmp_path / 'run.rrd'
    with closing(View(CONFIGURATION, str(path))) as view:
        feed(view, run_of(CONFIGURATION, 5)[0])
        with pytest.raises(ViewerError, match='is being written by another run and is kept'):
            View(CONFIGURATION, str(path), overwrite=True)
    assert len(read(path)['/joint_states/effort']['ros2_timestamp']) == 5
    View(CONFIGURATION, str(path), overwrite=True).close()  # of a run that has ended
