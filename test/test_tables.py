# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Joint states as arrays and as tables: logs of this package, and bags of other programs."""

import csv
import math
import tracemalloc

import numpy as np
import pytest
from mcap.records import Channel, Message
from mcap_records import records_of, write_records
from mechanisms import FOLLOWED
from other_bags import GRIPPER, START, measurement, robot, write_mcap, write_rosbag2, write_split
from ros_harness import assert_refused, finished, logged

from linkage_ros import LogError, read_log
from linkage_ros.log import tables
from linkage_ros.log.bag import BagTopic
from linkage_ros.log.tables import write_csv
from linkage_ros.messages.cdr import decode_joint_state
from linkage_ros.messages.fields import Template
from linkage_ros.messages.templates import joint_state
from linkage_ros.messages.topics import JOINT_STATE, JOINT_TRAJECTORY, MECHANISM_STATE
from linkage_ros.programs.record import record, record_measured
from linkage_ros.settings.configuration import configure, load


def table(path):
    """Returns the head and the cells of a CSV file."""
    with path.open(newline='') as stream:
        head, *rows = csv.reader(stream)
    return head, rows


@pytest.mark.parametrize('preset', ['quadrilateral', 'compressor', 'wind_pump'])
def test_a_log_is_read_as_arrays_and_as_a_table_with_references(tmp_path, preset):
    log, out = tmp_path / 'run.mcap', tmp_path / 'run.csv'
    record(load(preset), log, duration=0.3)
    found = read_log(log)
    messages = [decode_joint_state(one.data) for one in logged(log)[1]['/joint_states']]
    states = found['/joint_states']
    assert states['t'].tolist() == [message.stamp / 1e9 for message in messages]
    for i, joint in enumerate(messages[0].names):
        for quantity in ('position', 'velocity', 'effort'):
            due = [getattr(message, _plural(quantity))[i] for message in messages]
            assert states[f'{joint}.{quantity}'].tolist() == due
            assert found['/mechanism_state'][f'{joint}.{quantity}'].tolist() == due
    assert write_csv(log, out) == ('/mechanism_state', len(messages), 0)
    head, rows = table(out)
    values = np.array(rows, float).T
    for name, column in zip(head, values, strict=True):
        key, *_ = name.split(' ')
        if key[-2:] in {'.x', '.y'}:
            due = found[f'/points/{key[:-2]}'][key[-1]]
        else:
            due = found['/mechanism_state'][key]
        assert column.tolist() == due.tolist()
    relative = {'coupler', 'rod'} & {*messages[0].names}
    for joint in messages[0].names:
        origin = {'coupler': ' relative to crank', 'rod': ' relative to coupler'}.get(joint, '')
        unit = 'm' if joint == 'slider' else 'rad'
        assert f'{joint}.position{origin} [{unit}]' in head
    assert relative


def test_a_topic_is_read_as_columns_of_one_length_as_pandas_needs(tmp_path):
    log = tmp_path / 'run.mcap'
    record(load('quadrilateral'), log, duration=0.1)
    every = read_log(log)
    for topic in ('/joint_states', '/points/coupler_point'):
        columns = read_log(log, topic)
        assert columns.keys() == every[topic].keys()
        for name, column in columns.items():
            assert column.shape == (20,)
            assert column.dtype == float
            assert np.array_equal(column, every[topic][name])
    with pytest.raises(LogError, match=r"'joint_state'.*/joint_states, .*/points/coupler_point"):
        read_log(log, 'joint_state')


def test_missing_messages_of_a_point_leave_empty_cells(tmp_path):
    log, cut, out = (tmp_path / name for name in ('run.mcap', 'cut.mcap', 'cut.csv'))
    record(load('quadrilateral'), log, duration=0.1)
    whole = read_log(log)['/points/coupler_point']
    lost, records = 3, records_of(log)
    (number,) = (
        item.id for item in records
        if isinstance(item, Channel) and item.topic == '/points/coupler_point'
    )  # fmt: skip
    of_point = [x for x in records if isinstance(x, Message) and x.channel_id == number]
    records.remove(of_point[lost])
    write_csv(write_records(cut, records), out)
    assert read_log(cut)['/points/coupler_point']['x'].tolist() == [*np.delete(whole['x'], lost)]
    head, rows = table(out)
    for axis in 'xy':
        due = [repr(x) for x in whole[axis].tolist()]
        due[lost] = ''
        assert [row[head.index(f'coupler_point.{axis} [m]')] for row in rows] == due


def _plural(quantity):
    return {'velocity': 'velocities'}.get(quantity, f'{quantity}s')


WRITERS = {'mcap': write_mcap, 'rosbags': write_rosbag2, 'split': write_split}


@pytest.mark.parametrize('write', WRITERS.values(), ids=WRITERS)
def test_a_bag_of_another_writer_is_read_with_missing_values(tmp_path, write):
    bag, out = write(tmp_path / 'robot', robot(90)), tmp_path / 'robot.csv'
    found = read_log(bag)
    assert found.keys() == {'/joint_states', '/gripper/joint_states'}
    states = found['/joint_states']
    sent = [decode_joint_state(data) for topic, _, _, data in robot(90)
            if topic == '/joint_states' and len(data) != 40]  # fmt: skip
    assert states['t'].tolist() == [message.stamp / 1e9 for message in sent]
    for joint in ('crank', 'finger'):
        for quantity in ('position', 'velocity', 'effort'):
            due = [
                dict(zip(x.names, getattr(x, _plural(quantity)), strict=True)).get(joint, math.nan)
                for x in sent
            ]
            assert np.array_equal(states[f'{joint}.{quantity}'], due, equal_nan=True)
    with pytest.raises(
        LogError, match=r'on /gripper/joint_states, /joint_states: give one .*--to'
    ):
        write_csv(bag, out)
    assert not out.exists()
    written = write_csv(bag, out, topic='/joint_states')
    head, rows = table(out)
    of_topic = [one for one in robot(90) if one[0] == '/joint_states']
    assert written == ('/joint_states', len(rows), len(of_topic) - len(rows))
    assert written.invalid
    assert head == ['t [s]', *(name for name in states if name != 't')]
    crank, finger = head.index('crank.position'), head.index('finger.position')
    assert [row[0] for row in rows[:2]] == [f'{START // 10**9}.{START % 10**9:09d}'] * 2
    assert [bool(row[crank]) for row in rows[:3]] == [True, False, True]
    assert [bool(row[finger]) for row in rows[:3]] == [False, True, False]


def test_absent_sequences_stamps_and_repeated_names_are_read(tmp_path):
    parts = Template(joint_state(('crank', 'crank'), ''))
    whole = parts.pack(0, 0, *range(1, 7))
    bag = write_mcap(tmp_path / 'a.mcap', [('/a', JOINT_STATE, 5, whole)])
    states = read_log(bag)['/a']
    assert {name: column.tolist() for name, column in states.items()} == {
        't': [5e-9], 'crank.position': [1.0], 'crank.velocity': [3.0], 'crank.effort': [5.0]
    }  # fmt: skip


def test_measurements_in_a_log_have_no_references(tmp_path):
    bag = write_mcap(tmp_path / 'robot.mcap', robot(30))
    record_measured(configure(FOLLOWED), tmp_path / 'run.mcap', bag)
    write_csv(tmp_path / 'run.mcap', tmp_path / 'a.csv', topic='/measured_joint_states')
    assert 'crank.position' in table(tmp_path / 'a.csv')[0]
    write_csv(tmp_path / 'run.mcap', tmp_path / 'b.csv')
    assert 'coupler.position relative to crank [rad]' in table(tmp_path / 'b.csv')[0]


def test_tables_need_little_more_memory_than_their_numbers(tmp_path):
    def peak(use):
        tracemalloc.start()
        use()
        _, most = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        return most

    def needs(count):
        states = (('/a', JOINT_STATE, START + i, measurement(i)) for i in range(count))
        bag = write_mcap(tmp_path / f'{count}.mcap', states, chunk_size=5000)
        out = tmp_path / f'{count}.csv'
        return peak(lambda: read_log(bag)), peak(lambda: write_csv(bag, out))

    (read, written), (more_read, more_written) = needs(500), needs(3000)
    numbers = 8 * 2500 * len(read_log(tmp_path / '500.mcap')['/a'])
    assert more_read - read < 1.5 * numbers
    assert more_written - written < 1.5 * numbers


def test_the_command_writes_a_table_or_one_line(tmp_path):
    bag = write_mcap(tmp_path / 'robot.mcap', [('/a', JOINT_STATE, START, measurement(0))])
    out, other = tmp_path / 'out.csv', tmp_path / 'other.mcap'
    done = finished('log', 'csv', bag, out)
    assert (done.returncode, done.stdout) == (0, f'{out}: 1 row from /a\n'), done.stderr
    other.write_bytes(bag.read_bytes()[:200])
    number = write_mcap(
        tmp_path / 'b.mcap', [('/b', JOINT_STATE, START, GRIPPER.pack(*[0] * 8)[:9])]
    )
    for words, problem in (
        ((bag, out), 'already exists'),
        ((bag, bag, '--overwrite'), 'the log itself'),
        ((bag, out, '--overwrite', '--topic', '/b'), 'joint states on /a: give one'),
        ((number, out, '--overwrite'), 'has no joint states'),
        ((other, out, '--overwrite'), 'damaged or incomplete: '),
    ):
        done = finished('log', 'csv', *words)
        assert_refused(done.returncode, done.stdout, done.stderr, problem)
    assert len(table(out)[1]) == 1


def test_two_topics_of_states_need_a_choice():
    """A bag of two runs has two topics of one role: one of them must be named."""
    names = '/a/mechanism_state', '/b/mechanism_state'
    both = [
        tables._Table(BagTopic(name, JOINT_TRAJECTORY.name, MECHANISM_STATE.role))
        for name in names
    ]
    assert tables._chosen('two.mcap', both, names[0]) is both[0]
    with pytest.raises(LogError, match='give one of these as --topic'):
        tables._chosen('two.mcap', both, '')
