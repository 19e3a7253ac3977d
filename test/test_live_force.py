# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Forces from messages, and changes of gravity, in torque, motion, log and verify."""

import itertools
import math
import time
from dataclasses import replace

import pytest
from geometry_msgs.msg import WrenchStamped
from rclpy.serialization import serialize_message
from ros_harness import (
    measurement,
    node_arguments,
    set_parameter,
    stop,
    verified,
    wait_for,
    watched,
)
from sensor_msgs.msg import JointState

from linkage_ros import Conditions, ConfigurationError, Solver, read_log
from linkage_ros.log.reader import LogReader
from linkage_ros.log.verify import verify
from linkage_ros.messages.cdr import decode_trajectory
from linkage_ros.messages.topics import WRENCH_STAMPED
from linkage_ros.programs.log_commands import info
from linkage_ros.programs.record import record
from linkage_ros.run.robot import Robot
from linkage_ros.run.states import Simulator
from linkage_ros.settings.configuration import configure, load

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
# m/s^2: of the parameters, and set while the node runs.
OWN, GRAVITIES = (0.0, -9.81), ((-3.0, 5.0), (7.0, 0.0))
HIP = 0.3  # rad, direction of base_link with drive: follow
DRIVES = {
    'speed': {'rpm': 90.0},
    'torque': {'motor.torque': 9.0, 'motor.damping': 0.5},
    'motion': {'motion.center': 0.3, 'motion.amplitude': 0.8, 'motion.frequency': 2.0},
    'follow': {'frame_joint.name': 'hip', 'frame_joint.ratio': 2.0},
}


def wrench(x=5.0, y=-40.0, frame_id='base_link'):
    message = WrenchStamped()
    message.header.frame_id = frame_id
    message.wrench.force.x, message.wrench.force.y = x, y
    message.wrench.force.z = message.wrench.torque.z = math.nan  # out of the plane
    return message


def acting(state, solver, frame):
    """Returns which forces act, those of messages or of parameters, and the gravity."""
    _, _, (point,) = decode_trajectory(state)
    q, u, a = point.positions[0], point.velocities[0], point.accelerations[0]
    found = []
    for push, pull, gravity in itertools.product(
        (THEIRS, tuple(PUSH['loads.push.force'])), (ALONG, (0.0, 0.0)), (OWN, *GRAVITIES)
    ):
        under = Conditions(gravity, frame, {'push': push, 'pull': pull})
        torque = solver.torque(q, u, a, under=under)
        if math.isclose(torque, point.efforts[0], rel_tol=1e-9, abs_tol=1e-9):
            found.append((push is THEIRS, pull is ALONG, gravity))
    return found[0] if len(found) == 1 else None


def assert_set_in_log(log, gravities):
    """Checks that a log has these gravities, and that with other values it differs."""
    reader, forged = LogReader(log), LogReader(log)
    for name, value in (('at', (0.1, 0.0)), ('wrench_timeout', 100.0)):
        given = {**reader.configuration.parameters(), f'loads.push.{name}': value}
        forged.configuration = configure(given)
        assert verify(forged).difference, name
    *usual, last = reader.motions['']
    found = [x.gravity for x in reader.motions[''] if getattr(x, 'gravity', None)]
    assert found == gravities
    if gravities:
        assert 'gravity [-3.0, 5.0] m/s^2' in '\n'.join(info(reader))
        forged.configuration = reader.configuration
        for wrong in (usual, [*usual, replace(last, gravity=(7.0, 1e-6))]):
            forged.motions = {'': tuple(wrong)}
            assert verify(forged).difference


@pytest.mark.parametrize('drive', DRIVES)
def test_each_drive_takes_forces_and_gravity_and_its_log_verifies(drive, tmp_path):
    """A torque-driven run keeps the gravity of its parameters."""
    log, given = tmp_path / 'run.mcap', {**LINKS, **PUSH, **PULL, **DRIVES[drive]}
    solver = Solver(configure({**given, 'drive': drive}).mechanism)
    frame = (HIP, 0.0, 0.0) if drive == 'follow' else None
    rate = {} if drive == 'follow' else {'rate_hz': 200.0}
    arguments = node_arguments(**given, drive=drive, log=log, **rate)
    with watched(['/mechanism_state'], *arguments) as (listener, process):
        heard, sent = listener.received['/mechanism_state'], itertools.count()
        robot = listener.node.create_publisher(JointState, '/measured_joint_states', 10)
        pushes, pulls = (
            listener.node.create_publisher(WrenchStamped, topic, 10)
            for topic in ('/push', '/pull')
        )

        def measure():
            places = {'crank': 0.01 * next(sent), 'hip': 2.0 * HIP}
            robot.publish(measurement(time.time_ns(), places))

        def await_state(push, pull, gravity, *messages):
            """Sends messages, and measurements, until this acts in a state."""
            left = len(heard)

            def act():
                nonlocal left
                for publisher, message in messages:
                    publisher.publish(message)
                if drive == 'follow':
                    measure()
                new = heard[left:]
                left += len(new)
                return any(acting(x, solver, frame) == (push, pull, gravity) for x in new)

            wait_for(act)

        await_state(False, False, OWN)
        await_state(True, False, OWN, (pushes, wrench()))
        await_state(True, True, OWN, (pushes, wrench()), (pulls, wrench(*ALONG, 'rocker_link')))
        await_state(False, False, OWN)
        wrong = wrench(x=math.nan), wrench(y=math.inf), wrench(frame_id='tool')
        ours = pulls, wrench(*ALONG, '')
        await_state(False, True, OWN, *((pushes, one) for one in wrong), ours)
        for value in ([math.nan, 0.0], [1.0], [1e7, 0.0]) if drive != 'torque' else ():
            refused = set_parameter(listener, 'gravity', type=8, double_array_value=value)
            assert not refused.successful
            assert 'gravity' in refused.reason
            assert 'array' not in refused.reason
        # Whole numbers are accepted.
        changes = (
            {'type': 8, 'double_array_value': [-3.0, 5.0]},
            {'type': 7, 'integer_array_value': [7, 0]},
        )
        for gravity, value in zip(GRAVITIES, changes, strict=True):
            is_taken = set_parameter(listener, 'gravity', **value).successful
            assert is_taken == (drive != 'torque')
            if is_taken:
                await_state(True, False, gravity, (pushes, wrench()))
                await_state(False, False, gravity)
        stop(process)
    assert verified(log).states >= len(heard)
    assert_set_in_log(log, [*GRAVITIES] if drive != 'torque' else [])
    if drive == 'speed':
        with watched({'/push': WRENCH_STAMPED.name}, log, '--loop', program='replay') as (
            listener, process,
        ):  # fmt: skip
            wait_for(lambda: listener.received['/push'])
            stop(process)


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


def test_two_uses_of_one_topic_are_refused():
    values = {**LINKS, **PUSH, **PULL, 'loads.pull.wrench_topic': 'push', 'rpm': 60.0}
    with pytest.raises(ConfigurationError, match='two loads have it'):
        Robot(configure(values))
    values = {**LINKS, 'rpm': 60.0, 'effort_command_topic': 'joint_states'}
    with pytest.raises(ConfigurationError, match='states have this topic'):
        Robot(configure(values))


def live_force(**given):
    (force,) = Simulator(configure({**LINKS, **given, 'rpm': 60.0}).only).live_forces().values()
    return force
