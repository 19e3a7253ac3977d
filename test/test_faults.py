# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Tests the real node when its disk, log or viewer fails, or when it is killed.

benchmarks/reliability measures the cost of these faults in seconds and megabytes.
"""

import errno
import os
import re
import resource
import shutil
import signal
from itertools import pairwise

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from joint_codec import encode_float64
from rclpy.serialization import deserialize_message
from ros_harness import decoded, logged, node_arguments, stop, verified, wait_for, watched
from test_rerun_connection import running as viewing

from linkage_ros import LogError
from linkage_ros.log.disk import DiskSync
from linkage_ros.log.reader import LogReader
from linkage_ros.log.recover import recover
from linkage_ros.log.writer import LogWriter
from linkage_ros.messages.cdr import ERROR, OK, WARN
from linkage_ros.messages.topics import DRIVING_TORQUE
from linkage_ros.run.states import Simulator
from linkage_ros.settings.configuration import configure, load
from linkage_ros.view.viewer_process import free_address

STATES, HEARD = '/joint_states', ('/joint_states', '/diagnostics')


def health(listener, number):
    """Returns the last published level and message of the log (1) or the viewer (2)."""
    if not listener.received['/diagnostics']:
        return None, ''
    message = deserialize_message(listener.received['/diagnostics'][-1], DiagnosticArray)
    return message.status[number].level[0], message.status[number].message


def last_stamp(messages):
    ((stamp, _),) = decoded(messages[-1:])
    return stamp


def flushed(listener, path):
    """Waits until the log contains all states received so far; returns its last stamp."""
    due = last_stamp(listener.received[STATES])
    for _ in range(3):  # the first flush may have begun earlier
        size = path.stat().st_size
        wait_for(lambda size=size: path.stat().st_size > size)
    return due


def states_of(path):
    """Verifies a log, and returns its joint states."""
    verified(path)
    return [message.data for message in logged(path)[1][STATES]]


# ---------------------------------------------------------------- killed runs


def test_killed_run_is_recovered_up_to_the_last_flush(tmp_path):
    path, saved = tmp_path / 'run.mcap', tmp_path / 'saved.mcap'
    with watched(HEARD, *node_arguments(log=path)) as (listener, process):
        listener.await_more(50)
        flushed(listener, path)
        # During the run, no other process can write to the log, but a copy can be saved.
        with pytest.raises(LogError, match='another run'):
            LogWriter(path, load('quadrilateral'), overwrite=True)
        assert recover(path, saved).messages > 0
        with pytest.raises(LogError, match='another run'):
            recover(saved, path, overwrite=True)
        due = flushed(listener, path)
        process.kill()
        process.wait()
    with pytest.raises(LogError, match='incomplete'):
        LogReader(path)
    recover(path, saved, overwrite=True)
    states = states_of(saved)
    assert last_stamp(states) >= due
    # The log starts before a subscriber is matched; either may end first.
    heard = listener.received[STATES]
    begin = states.index(heard[0])
    common = min(len(heard), len(states) - begin)
    assert states[begin : begin + common] == heard[:common]


# ---------------------------------------------------------------- the log


def fill_the_disk(process, path):
    """Limits the size of the node's files, which has the effect of a full disk."""
    resource.prlimit(process.pid, resource.RLIMIT_FSIZE, (path.stat().st_size + 5000,) * 2)


def remove_the_folder(_, path):
    shutil.rmtree(path.parent)


@pytest.mark.parametrize(
    ('breaks', 'words'),
    [
        (fill_the_disk, 'cannot be written: File too large; linkage_log recover saves its c'),
        (remove_the_folder, 'was removed'),
    ],
)
def test_failing_log_ends_without_stopping_the_node(tmp_path, breaks, words):
    path, saved = tmp_path / 'logs' / 'run.mcap', tmp_path / 'saved.mcap'
    path.parent.mkdir()
    with watched(HEARD, *node_arguments(log=path)) as (listener, process):
        listener.await_more(50)
        due = flushed(listener, path)
        breaks(process, path)
        wait_for(lambda: health(listener, 1)[0] == ERROR)
        listener.await_more(50)
        report = health(listener, 1)[1]
        recover(path if path.exists() else re.search(r'/proc/\d+/fd/\d+', report)[0], saved)
        output = stop(process, code=1)
    assert f'failed: {path} {words}' in report
    (error,) = re.findall(r'\[ERROR\].*', output)
    assert f'the run continues without a log: {path} {words}' in error
    assert last_stamp(states_of(saved)) >= due


def begun(path):
    """Creates a log with one message."""
    log = LogWriter(path, load('quadrilateral'), overwrite=False)
    log.write(log.add_topic(DRIVING_TORQUE, '/driving_torque'), 5, encode_float64(1.5))
    return log


def values(path):
    return [(message.time, message.data) for message in logged(path)[1]['/driving_torque']]


def test_log_that_cannot_be_begun_leaves_no_file(tmp_path):
    path, limits = tmp_path / 'run.mcap', resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, limits[1]))
    try:
        with pytest.raises(LogError, match=r'cannot be written: File too large$'):
            begun(path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    begun(path).close()  # the name is not taken


@pytest.mark.parametrize('end', [LogWriter.flush, LogWriter.close])
def test_removed_log_can_be_saved_while_its_process_runs(tmp_path, end):
    log = begun(tmp_path / 'run.mcap')
    log.flush()
    (tmp_path / 'run.mcap').unlink()
    (tmp_path / 'run.mcap').write_text('of somebody else')
    with pytest.raises(LogError, match=r'run\.mcap was removed .* linkage_log recover') as caught:
        end(log)
    recover(re.search(r'/proc/\d+/fd/\d+', str(caught.value))[0], tmp_path / 'saved.mcap')
    assert values(tmp_path / 'saved.mcap') == [(5, encode_float64(1.5))]
    log.close()  # has no further effect
    assert (tmp_path / 'run.mcap').read_text() == 'of somebody else'


def test_renamed_log_is_completed_under_its_new_name(tmp_path):
    log = begun(tmp_path / 'run.mcap')
    (tmp_path / 'run.mcap').rename(tmp_path / 'kept.mcap')
    log.flush()
    log.close()
    assert values(tmp_path / 'kept.mcap') == [(5, encode_float64(1.5))]
    assert not (tmp_path / 'run.mcap').exists()


def test_log_is_synced_to_the_disk_and_a_failure_reported(tmp_path, monkeypatch):
    log, synced = begun(tmp_path / 'run.mcap'), []
    sync = DiskSync(log.file.path, log.file.stream.fileno())
    monkeypatch.setattr(os, 'fdatasync', lambda number: synced.append(os.fstat(number).st_ino))
    sync.consume([])
    log.close()
    sync.consume([])
    assert synced == [(tmp_path / 'run.mcap').stat().st_ino] * 2

    def fail(_):
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    monkeypatch.setattr(os, 'fdatasync', fail)
    with pytest.raises(LogError, match=r'run\.mcap cannot be synced: Input/output error$'):
        sync.consume([])
    sync.close()


# ---------------------------------------------------------------- the viewer


def test_each_viewer_change_is_reported_once():
    _, port = free_address('127.0.0.1')
    url = f'rerun+http://127.0.0.1:{port}/proxy'
    arguments = node_arguments(viewer=url, rate_hz=3000.0)  # which fills its buffers sooner
    absent = f'no viewer answers at {url}: states are dropped until one does'
    stopped = f'the viewer at {url} is not reading: states are dropped until it does'

    with watched(HEARD[1:], *arguments) as (listener, process):
        wait_for(lambda: health(listener, 2) == (WARN, absent))
        with viewing(port, '--serve-grpc') as viewer:
            wait_for(lambda: health(listener, 2)[0] == OK)
            viewer.send_signal(signal.SIGSTOP)
            wait_for(lambda: health(listener, 2) == (WARN, stopped))
            listener.await_more(1, HEARD[1])
            viewer.send_signal(signal.SIGCONT)
            wait_for(lambda: health(listener, 2)[0] == OK)
            viewer.kill()
            viewer.wait()
            wait_for(lambda: health(listener, 2) == (WARN, absent))
        listener.await_more(1, HEARD[1])
        output = stop(process)
    said = re.findall(r'\]: (ok, but|no viewer .*|the viewer .*)', output)
    assert all(now != before for before, now in pairwise(said))
    # On a busy machine, the viewer may be slow in between.
    left = iter(said)
    assert all(one in left for one in (absent, 'ok, but', stopped, 'ok, but', absent))
    assert re.search(r' states.*, \d+ lost to the viewer$', output, re.MULTILINE)
    # Only the node reports it: the SDK is silenced.
    assert all(re.match(r'\[(INFO|WARN)\] \[', line) for line in output.splitlines())


def test_view_that_others_can_reach_is_served_with_a_warning():
    arguments = node_arguments(viewer='web', viewer_bind='0.0.0.0')
    with watched(HEARD, *arguments) as (listener, process):
        listener.await_more(1)
        output = stop(process)
    assert re.search(r'\[WARN\].*is served at .* viewer_bind = 127.0.0.1 restricts it', output)


@pytest.mark.parametrize('size', [0, 1000, 10_000])
def test_truncated_log_is_reported_and_left_alone(tmp_path, size):
    path = tmp_path / 'run.mcap'
    log = LogWriter(path, configure({'rpm': 60.0}), overwrite=False)
    motion = Simulator(configure({'rpm': 60.0}).only).begin(0)
    log.flush()
    os.truncate(path, size)
    log.write_motion(motion.segment)
    with pytest.raises(LogError, match='another program'):
        log.flush()  # would fill the gap
    assert path.stat().st_size == size  # recoverable data remains intact
