# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Readers identify the topics of a log by their roles, so that any topic may have any name."""

import random

import pytest
from joint_codec import JointStateCodec
from live_logs import START, STATUSES
from mcap.records import Channel
from mcap_records import records_of, write_records
from mechanisms import FOLLOWED
from one_linkage import TrajectoryAlone, inputs_of, run_alone, templates_of
from ros_harness import verified
from state_messages import messages_at, messages_of

from linkage_ros import LogError, __version__
from linkage_ros.log.reader import LogReader
from linkage_ros.log.records import ROLE
from linkage_ros.log.recover import recover
from linkage_ros.log.rows import LoggedState
from linkage_ros.log.writer import LogWriter
from linkage_ros.messages.cdr import encode_diagnostics
from linkage_ros.messages.topics import (
    DIAGNOSTICS,
    JOINT_COMMANDS,
    JOINT_STATES,
    MEASURED_JOINT_STATES,
    ROBOT_DESCRIPTION,
    TOPICS,
)
from linkage_ros.motion.drives.follow import FollowDrive
from linkage_ros.motion.drives.speed import SpeedDrive
from linkage_ros.programs.log_commands import info
from linkage_ros.run.states import Simulator
from linkage_ros.settings.configuration import configure, load, read_values

STATES = 20
CRANK = JointStateCodec(('crank',))
DRIVES = {
    'speed': {
        **read_values('quadrilateral'),
        'effort_command_topic': '/effort',
        'trajectory_command_topic': '/trajectory',
    },
    'torque': {'drive': 'torque', 'motor.torque': 9.0, 'motor.damping': 0.5},
    'follow': {**FOLLOWED, 'effort_command_topic': '/effort'},
    'wind pump': load('wind_pump').parameters(),
}


def write(path, configuration, names):
    """Writes a log as the node does, with the given names of its topics.

    Further names are those of topics of other programs, which have the types of the node's.

    Returns:
        The names of the topics by role.
    """
    simulator, names = Simulator(configuration.only), iter(names)
    inputs, drive = inputs_of(simulator), configuration.drive
    others = [ROBOT_DESCRIPTION, DIAGNOSTICS, *inputs]
    crank = TrajectoryAlone(simulator) if isinstance(drive, SpeedDrive) else None
    others += [crank.topic] if crank else []
    used = {topic.role: next(names) for topic in (*templates_of(simulator).topics, *others)}
    with LogWriter(path, configuration, overwrite=True) as log:
        log.add_states(run_alone(simulator).templates, lambda topic: used[topic.role])
        channels = {topic.role: log.add_topic(topic, used[topic.role]) for topic in others}
        foreign = []
        for like, name in zip([*log.mcap.channels.values()], names, strict=False):
            foreign.append(100 + like.id)
            log.mcap.declare(Channel(foreign[-1], name, 'cdr', {}, like.schema_id))
        log.write(channels['robot_description'], START, simulator.description)
        if not isinstance(drive, FollowDrive):
            motion = simulator.begin(START)
            log.write_motion(motion.segment)
        for tick in range(STATES):
            stamp = START + simulator.ticks.elapsed(tick)
            made = None
            for number in foreign:
                log.write(number, stamp, b'\0\1\0\0')
            message = CRANK.encode(stamp, (0.1 * tick,), (tick % 3,), (0.1 * tick,))
            for topic, source in inputs.items():
                log.write(channels[topic.role], stamp, message)
                if isinstance(drive, FollowDrive):
                    _, found = source.read(message, stamp)
                    made = messages_of(simulator, stamp, found, source.later(found))
                else:
                    source.read(message, stamp)
                    motion.command(stamp, 0.1 * tick)
            made = made or messages_at(simulator, motion, stamp)
            log.consume([LoggedState(stamp + 1000, b''.join(made.messages))])
            if crank and (data := crank.message_at(motion, stamp)):
                log.write(channels[crank.topic.role], stamp, data)
        log.write(channels['diagnostics'], stamp, encode_diagnostics(stamp, '', STATUSES))
    return used


def random_names(seed):
    """Returns distinct names of topics, some of which end as another topic of the node does."""
    pick = random.Random(seed)
    words = [topic.name.strip('/') for topic in (*TOPICS, JOINT_COMMANDS, MEASURED_JOINT_STATES)]
    words += [''.join(pick.choices('abc_', k=4)) for _ in words]
    return pick.sample(
        [f'{place}/{word}' for place in ('', '/left', '/a/b') for word in words], 20
    )


@pytest.mark.parametrize('seed', range(5))
@pytest.mark.parametrize('drive', DRIVES)
def test_log_is_verified_whatever_the_names_of_its_topics(tmp_path, drive, seed):
    path, saved = tmp_path / 'run.mcap', tmp_path / 'saved.mcap'
    configuration = configure(DRIVES[drive])
    used = write(path, configuration, random_names(seed))
    recover(path, saved)
    own = [
        topic.role
        for topic in (*templates_of(Simulator(configuration.only)).topics, ROBOT_DESCRIPTION)
    ]
    for log in map(LogReader, (path, saved)):
        report = verified(log.path)
        assert report.states == STATES
        assert report.compared == tuple(used[role] for role in own)
        assert len(report.others) == len(log.topics) - len(own)
        assert log.channel(JOINT_STATES).name == used['joint_states']
        lines = [*info(log)]
        for role, name in used.items():
            (line,) = [line for line in lines if line.startswith(f'  {name} ')]
            assert line.endswith(f', {role}') or name.endswith(f'/{role}')


def test_log_of_an_older_version_without_roles_is_refused(tmp_path):
    path = tmp_path / 'run.mcap'
    write(path, configure(DRIVES['speed']), [f'/{i}' for i in range(20)])
    records = records_of(path)
    for record in records:
        if isinstance(record, Channel):
            record.metadata.pop(ROLE, None)  # topics of other programs have none
    with pytest.raises(LogError, match=f'version {__version__}'):
        LogReader(write_records(path, records))
