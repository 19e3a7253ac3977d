# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_record --measured: bags of other writers, and the states at their measurements."""

import math
import re
import struct
from contextlib import suppress

import numpy as np
import pytest
from mechanisms import FOLLOWED, LIMITED, four_bar
from one_linkage import answers_of, inputs_of, templates_of, with_linkage
from other_bags import JOINTS, MS, START, WRITERS, measurement, robot, write_mcap, write_rosbag2
from ros_harness import assert_refused, finished, logged, verified
from rosbags import rosbag2
from state_messages import messages_of

from linkage_ros import ConfigurationError, LogError
from linkage_ros.log.bag import Bag
from linkage_ros.messages.cdr import JointReader, decode_joint_state
from linkage_ros.messages.fields import Template
from linkage_ros.messages.templates import joint_state
from linkage_ros.messages.topics import JOINT_STATE
from linkage_ros.programs.record import record_measured
from linkage_ros.run.states import Simulator
from linkage_ros.settings.configuration import configure, load

FOLLOW = configure(FOLLOWED)


def live(configuration, messages):
    """Returns the messages of the states as the node makes them, one by one."""
    simulator = Simulator(configuration.only)
    (crank,), found = inputs_of(simulator).values(), []
    for time, data in messages:
        with suppress(ValueError):
            stamp, coordinates = crank.read(data, time)
            made = messages_of(simulator, stamp, coordinates, crank.later(coordinates))
            found.append((time, made))
    return simulator, found, crank.rejected


@pytest.mark.parametrize('write', WRITERS.values(), ids=WRITERS)
@pytest.mark.parametrize('lead', [{}, {'effort_command_topic': '/torque', 'lead_time': 0.01}])
def test_a_bag_of_another_writer_is_answered_like_live_measurements(tmp_path, write, lead):
    configuration, out = configure({**FOLLOWED, **lead}), tmp_path / 'out.mcap'
    messages = [(time, data) for topic, _, time, data in robot() if topic == '/joint_states']
    answers = record_measured(configuration, out, write(tmp_path / 'robot.mcap', robot()))
    simulator, due, rejected = live(configuration, messages)
    assert answers == (len(due), rejected)
    assert len(due) == 300
    log, found = logged(out)
    assert [(one.time, one.data) for one in found['/measured_joint_states']] == messages
    for i, topic in enumerate(templates_of(simulator).topics):
        states = [(one.time, one.data) for one in found[log.channel(topic).name]]
        assert states == [(time, made.messages[i]) for time, made in due]
    assert verified(out).states == 300


@pytest.mark.parametrize('lead', [{}, {'effort_command_topic': '/torque', 'lead_time': 0.01}])
def test_extreme_measurements_are_rejected_in_batches_as_one_by_one(lead):
    limited = four_bar(LIMITED['rocker_crank'])
    (start, end), *_ = limited.reach().arcs
    nearest, joints = math.nextafter(end, start), Template(joint_state(('crank',), ''))
    for mechanism, inside in ((FOLLOW.mechanism, 0.5), (limited, end - 1e-3)):
        configuration = with_linkage(configure({**FOLLOWED, **lead}), mechanism=mechanism)
        values = [(inside, 0.0), (inside, 1e300), (inside, -1e13), (1e308, 0.0), (math.nan, 0.0),
                  (end, 5.0), (nearest, 5.0), (nearest, 1e12), (inside, 3.0)]  # fmt: skip
        messages = [(n, joints.pack(0, n * MS, *one, 0.0)) for n, one in enumerate(values, 1)]
        simulator, due, rejected = live(configuration, messages)
        states = answers_of(simulator)
        ((times, stamps, numbers, _),) = states.answers(messages)
        assert states.rejected() == rejected
        assert times == [time for time, _ in due]
        assert stamps == [made.stamp for _, made in due]
        rows = np.transpose(numbers)
        assert rows.tobytes() == np.array([made.numbers for _, made in due]).tobytes()


def test_one_joint_is_read_as_from_the_whole_message():
    """Layouts change between messages of one size, and messages are cut at any place."""
    kinds = (JOINTS, 'a'), (JOINTS[::-1], 'a'), (JOINTS[1:], 'a'), (('crank',), 'long'), ((), '')
    frames = [Template(joint_state(names, frame)) for names, frame in kinds]
    whole = [frame.pack(5, 6, *range(1, len(frame.places) - 1)) for frame in frames]
    short = whole[0][:-28]  # without the efforts and two velocities
    cut = [short[:-12] + struct.pack('<I', n) + short[-8:] for n in (0, 1)]
    messages = [*whole, *cut, *(whole[0][:n] for n in range(0, len(whole[0]), 3)), *whole]
    reader, compared = JointReader('crank'), 0
    for data in messages * 2:
        try:
            heard = decode_joint_state(data)
        except ValueError:
            with pytest.raises(ValueError, match='not a JointState'):
                reader.read(data)
            continue
        rows = (dict(zip(heard.names, row, strict=False)) for row in heard[2:4])
        assert reader.read(data) == (heard.stamp, *(row.get('crank') for row in rows))
        compared += 1
    assert compared >= 20


# ---------------------------------------------------------------- refusals


def two_topics():
    yield from robot(20)
    yield '/commands', JOINT_STATE, START, measurement(0)


def test_the_topic_is_chosen_by_the_crank_or_by_name(tmp_path):
    bag, out = write_mcap(tmp_path / 'robot.mcap', two_topics()), tmp_path / 'out.mcap'
    with pytest.raises(LogError, match=r'crank on /commands, /joint_states: give one .*--topic'):
        record_measured(FOLLOW, out, bag)
    assert record_measured(FOLLOW, out, bag, topic='/commands').states == 1
    with pytest.raises(LogError, match=r'crank on /commands, /joint_states: give one .*--topic'):
        record_measured(FOLLOW, out, bag, topic='/nothing')


def sqlite(path):
    return write_rosbag2(path, robot(9), storage=rosbag2.StoragePlugin.SQLITE3)


def compressed(mode):
    return lambda path: write_rosbag2(path, robot(9), compression=mode)


# A JointState with the name of the crank, and without numbers.
NAME_ALONE = b''.join(
    (b'\0\1\0\0', struct.pack('<5I', 0, 0, 1, 0, 1), b'\6\0\0\0crank\0\0\0', bytes(12))
)
CONVERTED = 'rosbags-convert --src FOLDER --dst NEW_FOLDER --dst-storage mcap'
REFUSED = {
    'sqlite3': (sqlite, f'only .*db3.*{CONVERTED}'),
    'sqlite3 file': (lambda path: next(sqlite(path).glob('*.db3')), f'SQLite f.*{CONVERTED}'),
    'compressed file': (compressed(rosbag2.CompressionMode.FILE), f'only .*zstd.*{CONVERTED}'),
    'compressed messages': (
        compressed(rosbag2.CompressionMode.MESSAGE), 'nothing, or its messages are compressed'
    ),
    'no bag': (lambda path: path, 'cannot be read: No such file'),
    'no joint': (
        lambda path: write_mcap(path, (one for one in robot(9) if 'gripper' in one[0])),
        'no position of crank: /gripper/joint_states names finger, thumb; give one .*crank_joint',
    ),
    'no position': (
        lambda path: write_mcap(path, [('/a', JOINT_STATE, 5, NAME_ALONE)]),
        'no position of crank: /a names crank$',
    ),
    'no joint states': (
        lambda path: write_mcap(path, (one for one in robot(9) if 'other' in one[0])),
        'no position of crank: it has no sensor_msgs/msg/JointState',
    ),
    'late': (
        lambda path: write_mcap(path, [('/a', JOINT_STATE, 2**63, measurement(0))]),
        'must be a valid ROS time',
    ),
}  # fmt: skip


@pytest.mark.parametrize(('write', 'words'), REFUSED.values(), ids=REFUSED)
def test_other_bags_are_refused_in_one_line(tmp_path, write, words):
    with pytest.raises(LogError, match=words) as caught:
        record_measured(FOLLOW, tmp_path / 'out.mcap', write(tmp_path / 'robot'))
    assert '\n' not in str(caught.value)
    assert str(tmp_path / 'robot') in str(caught.value)


def test_states_before_the_damage_are_kept(tmp_path):
    bag = write_mcap(tmp_path / 'robot.mcap', robot(), chunk_size=5000)
    whole, out, states = bag.read_bytes(), tmp_path / 'out.mcap', []
    for size in np.linspace(4000, len(whole) - 1, 12).astype(int):
        bag.write_bytes(whole[:size])
        try:
            states.append(record_measured(FOLLOW, out, bag, overwrite=True).states)
        except LogError as error:
            kept = re.search('incomplete: .* keeps the ([0-9]+) states? before', str(error))
            states.append(int(kept[1]))
        assert verified(out).states == states[-1]
    assert states == sorted(states)
    assert len(set(states)) > 3
    assert states[-1] == 300  # the end of the index alone is missing


def test_drive_and_output_are_checked(tmp_path):
    bag = write_mcap(tmp_path / 'robot.mcap', robot(9))
    with pytest.raises(LogError, match='the bag itself'):
        record_measured(FOLLOW, bag, bag, overwrite=True)
    with pytest.raises(ConfigurationError, match='needs drive: follow'):
        record_measured(load('quadrilateral'), tmp_path / 'out.mcap', bag)
    assert [*Bag(bag).messages()]


def test_live_forces_that_are_not_read_are_noted_once(tmp_path):
    bag = write_mcap(tmp_path / 'robot.mcap', robot(9))
    push = {'loads.push.kind': 'force', 'loads.push.link': 'coupler', 'loads.push.at': [0.1, 0.0],
            'loads.push.force': [0.0, -3.0]}  # fmt: skip
    for more, count in ((push, 0), ({**push, 'loads.push.wrench_topic': 'pushes'}, 1)):
        run, said = configure({**FOLLOW.parameters(), **more}), []
        record_measured(run, tmp_path / 'out.mcap', bag, overwrite=True, note=said.append)
        assert len(said) == count
        assert verified(tmp_path / 'out.mcap').states == 9
    assert 'pushes' in said[0]


FILE = """
/**:
  ros__parameters:
    mechanism: slider_crank
    drive: follow
    crank: {length: 0.05, mass: 0.3}
    coupler: {length: 0.2, mass: 0.5}
"""


def test_the_command_answers_a_bag_and_counts_rejected_measurements(tmp_path):
    bag, out = write_rosbag2(tmp_path / 'robot', robot(60)), tmp_path / 'out.mcap'
    (tmp_path / 'followed.yaml').write_text(FILE)
    words = 'record', tmp_path / 'followed.yaml', out
    done = finished(*words, '--measured', bag)
    assert (done.returncode, done.stderr) == (0, '')
    assert re.search(
        '60 states.*20 rejected: without a position of the crank.*2 rejected: not newer',
        done.stdout,
    )
    assert verified(out).states == 60
    for options, problem in (
        (('--measured', bag), 'already exists'),
        (('--measured', bag, '--topic', '/x', '--overwrite'), 'on /joint_states: give one'),
        (('--topic', '/x', '--overwrite'), 'give --measured BAG'),
        (('--overwrite',), 'or give linkage_record --measured BAG'),
        (('--measured', bag, '--duration', '1'), 'not allowed with'),
    ):
        done = finished(*words, *options)
        assert_refused(done.returncode, done.stdout, done.stderr, problem)
