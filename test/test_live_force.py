# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Forces from messages while a run lasts: in torque, motion, log and verify."""

import math
import time

import pytest
from geometry_msgs.msg import WrenchStamped
from rclpy.serialization import serialize_message
from ros_harness import node_arguments, stop, verified, wait_for, watched
from sensor_msgs.msg import JointState

from linkage_ros import Conditions, ConfigurationError, Solver, read_log
from linkage_ros.log.reader import LogReader
from linkage_ros.log.verify import verify
from linkage_ros.messages.cdr import decode_trajectory
from linkage_ros.messages.topics import WRENCH_STAMPED
from linkage_ros.programs.record import record
from linkage_ros.run.robot import Robot
from linkage_ros.run.states import Simulator
from linkage_ros.settings.configuration import configure, load
from linkage_ros.units import NS_PER_S

MS = 1_000_000
LINKS = {
    name: [*value] if isinstance(value, tuple) else value
    for name, value in load('quadrilateral').parameters().items()
    if name.split('.')[0] in ('mechanism', 'frame', 'crank', 'coupler', 'rocker')
}
PUSH = {
    'loads.push.kind': 'force', 'loads.push.link': 'coupler', 'loads.push.at': [0.1, 0.05],
    'loads.push.force': [0.0, -3.0], 'loads.push.wrench_topic': 'push',
    'loads.push.wrench_timeout': 0.1,
}  # fmt: skip
PULL = {
    'loads.pull.kind': 'force', 'loads.pull.link': 'rocker', 'loads.pull.axes': 'link',
    'loads.pull.at': [0.2, 0.1], 'loads.pull.force': [0.0, 0.0], 'loads.pull.wrench_topic': 'pull',
    'loads.pull.wrench_timeout': 0.1,
}  # fmt: skip
THEIRS, ALONG = (5.0, -40.0), (3.0, 7.0)  # N
DRIVES = {
    'speed': {'rpm': 90.0},
    'torque': {'motor.torque': 9.0, 'motor.damping': 0.5},
    'motion': {'motion.center': 0.3, 'motion.amplitude': 0.8, 'motion.frequency': 2.0},
    'follow': {},
}


def wrench(x=5.0, y=-40.0, frame_id='base_link'):
    message = WrenchStamped()
    message.header.frame_id = frame_id
    message.wrench.force.x, message.wrench.force.y = x, y
    message.wrench.force.z = message.wrench.torque.z = math.nan  # out of the plane
    return message


@pytest.mark.parametrize('drive', DRIVES)
def test_each_drive_takes_forces_and_its_log_verifies(drive, tmp_path):
    log, given = tmp_path / 'run.mcap', {**LINKS, **PUSH, **PULL, **DRIVES[drive]}
    arguments = node_arguments(**given, drive=drive, log=log, rate_hz=200.0)
    if drive == 'follow':
        arguments = node_arguments(**given, drive=drive, log=log)
    solver, values = Solver(configure({**given, 'drive': drive}).mechanism), given

    def seen(state):
        """Returns which forces act: those of the messages or of the parameters."""
        _, _, (point,) = decode_trajectory(state)
        q, u, a = point.positions[0], point.velocities[0], point.accelerations[0]
        found = [
            (push is THEIRS, pull is ALONG)
            for push in (THEIRS, tuple(values['loads.push.force']))
            for pull in (ALONG, (0.0, 0.0))
            if math.isclose(
                solver.torque(q, u, a, under=Conditions(forces={'push': push, 'pull': pull})),
                point.efforts[0], rel_tol=1e-9, abs_tol=1e-9,
            )
        ]  # fmt: skip
        return found[0] if len(found) == 1 else None

    with watched(['/mechanism_state'], *arguments) as (listener, process):
        heard, sent = listener.received['/mechanism_state'], [0]
        robot = listener.node.create_publisher(JointState, '/measured_joint_states', 10)
        pushes, pulls = (
            listener.node.create_publisher(WrenchStamped, topic, 10)
            for topic in ('/push', '/pull')
        )

        def await_forces(acting, *messages):
            """Sends messages, and measurements, until the forces act in a state."""
            left = len(heard)

            def act():
                nonlocal left
                for publisher, message in messages:
                    publisher.publish(message)
                if drive == 'follow':
                    sent[0] += 1
                    measured = JointState(name=['crank'], position=[0.01 * sent[0]])
                    stamp = divmod(time.time_ns(), NS_PER_S)
                    measured.header.stamp.sec, measured.header.stamp.nanosec = stamp
                    robot.publish(measured)
                new = heard[left:]
                left += len(new)
                return any(seen(state) == acting for state in new)

            wait_for(act)

        await_forces((False, False))
        await_forces((True, False), (pushes, wrench()))
        await_forces((True, True), (pushes, wrench()), (pulls, wrench(*ALONG, 'rocker_link')))
        await_forces((False, False))
        wrong = wrench(x=math.nan), wrench(y=math.inf), wrench(frame_id='tool')
        await_forces((False, True), *((pushes, one) for one in wrong), (pulls, wrench(*ALONG, '')))
        stop(process)
    assert verified(log).states >= len(heard)
    if drive == 'speed':
        with watched({'/push': WRENCH_STAMPED.name}, log, '--loop', program='replay') as (
            listener, process,
        ):  # fmt: skip
            wait_for(lambda: listener.received['/push'])
            stop(process)
    # With another point or another timeout, the log differs.
    for name, value in (('at', (0.1, 0.0)), ('wrench_timeout', 100.0)):
        forged = LogReader(log)
        forged.configuration = configure(
            {**forged.configuration.parameters(), f'loads.push.{name}': value}
        )
        assert verify(forged).difference, name


def test_record_has_the_force_of_the_parameters(tmp_path):
    for drive in ('speed', 'torque'):
        log, states = tmp_path / f'{drive}.mcap', []
        for given in (PUSH, {k: v for k, v in PUSH.items() if 'wrench' not in k}):
            values = {**LINKS, **given, **DRIVES[drive], 'drive': drive}
            record(configure(values), log, duration=0.2, overwrite=True)
            verified(log)
            states.append(read_log(log)['/joint_states'])
        for column, values in states[0].items():
            assert (values == states[1][column]).all()


@pytest.mark.parametrize(('message', 'words'), [
    (wrench(x=math.nan), 'not finite'),
    (wrench(y=-math.inf), 'not finite'),
    (wrench(x=2e12), r'beyond 1e\+12 N'),
    (wrench(frame_id='tool'), 'frame_id tool: must be base_link or empty'),
    (JointState(), 'not a WrenchStamped'),
])  # fmt: skip
def test_wrong_messages_are_rejected_and_counted(message, words):
    force = live_force(**PUSH)
    assert force.read(serialize_message(wrench()), 0) == THEIRS
    assert force.read(serialize_message(wrench(frame_id='')), 0) == THEIRS
    with pytest.raises(ValueError, match=words):
        force.read(serialize_message(message), 0)
    figures = force.diagnostics()
    assert (figures['push: wrenches taken'], figures['push: wrenches rejected']) == ('2', '1')


def test_damaged_messages_are_rejected():
    force, data = live_force(**PUSH), serialize_message(wrench())
    for end in range(len(data) - 32):  # z and the torque are not read, but must be there
        with pytest.raises(ValueError, match='not a WrenchStamped'):
            force.read(data[:end], 0)


def test_a_message_acts_from_its_state_until_it_expires():
    force = live_force(**PUSH)
    own, late = PUSH['loads.push.force'], 100 * MS
    acting = [
        force.held.at(now, received)
        for now, received in (
            (0, []), (10, [(1.0, 2.0), THEIRS]), (9 + late, []), (10 + late, []),
            (2 * late, [THEIRS]), (MS, []),  # a step back
        )
    ]  # fmt: skip
    assert acting == [tuple(own), THEIRS, THEIRS, tuple(own), THEIRS, tuple(own)]
    assert force.diagnostics()['push: wrench timeouts'] == '2'
    assert 'wrench_timeout' in force.troubles('/push')[0]


def test_two_loads_with_one_topic_are_refused():
    values = {**LINKS, **PUSH, **PULL, 'loads.pull.wrench_topic': 'push', 'rpm': 60.0}
    with pytest.raises(ConfigurationError, match='two loads have it'):
        Robot(configure(values))


def live_force(**given):
    (force,) = Simulator(configure({**LINKS, **given, 'rpm': 60.0}).only).live_forces().values()
    return force
