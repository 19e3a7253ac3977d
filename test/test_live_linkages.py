# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Several linkages in one live node: subsets in messages, and the end of one of them."""

import itertools
import json
import math

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import WrenchStamped
from rclpy.serialization import deserialize_message, serialize_message
from ros_harness import (
    SteppedClock,
    assert_refused,
    finished,
    logged,
    measurement,
    node_arguments,
    set_parameter,
    stop,
    verified,
    wait_for,
    watched,
)
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from test_crank_commands import trajectory
from test_live_force import PUSH, wrench
from test_several_linkages import CASES, FOLLOWERS, LEGS
from trajectory_msgs.msg import JointTrajectory

from linkage_ros.log.reader import LogReader
from linkage_ros.log.verify import verify
from linkage_ros.messages.cdr import decode_trajectory
from linkage_ros.motion.drives.torque import TorqueCommands
from linkage_ros.motion.inputs import SharedInput, UnnamedError
from linkage_ros.programs.log_commands import info
from linkage_ros.run.robot import Robot
from linkage_ros.run.trajectory_ahead import TrajectoryAhead
from linkage_ros.settings.configuration import configure
from linkage_ros.settings.parameters import OF_THE_RUN

STATES, EFFORTS, PLANNED = '/joint_states', '/efforts', '/planned'
DIAGNOSTICS = '/diagnostics'
TYPES = {
    STATES: 'sensor_msgs/msg/JointState', EFFORTS: 'std_msgs/msg/Float64MultiArray',
    PLANNED: 'trajectory_msgs/msg/JointTrajectory',
}  # fmt: skip
MS = 1_000_000


def arguments_of(folder, values, **more):
    """Writes a parameter file; returns arguments of a node on simulated time."""
    path, values = folder / 'robot.yaml', {k: v for k, v in values.items() if v is not None}
    path.write_text(json.dumps({'/**': {'ros__parameters': {**values, **more}}}))
    return ['--ros-args', '--params-file', path]


def joints_in(data):
    return deserialize_message(data, JointState).name


def efforts_in(data):
    return list(deserialize_message(data, Float64MultiArray).data)


def test_laws_end_one_after_the_other_and_trajectories_name_any_cranks(tmp_path):
    """The left law ends while its crank moves; the others continue, along new trajectories."""
    log = tmp_path / 'run.mcap'
    values = {**LEGS, 'linkages': ['left', 'right', 'far'], 'rate_hz': 100.0,
              'far.motion.speeds': [0.0, 0.0], 'trajectory_command_topic': 'planned',
              'trajectory_horizon': 0.02, 'log': str(log), 'use_sim_time': True}  # fmt: skip
    with watched(TYPES, *arguments_of(tmp_path, values)) as (listener, node):
        publisher = listener.node.create_publisher(JointTrajectory, '/crank_trajectory', 10)
        wait_for(publisher.get_subscription_count)
        clock, states = SteppedClock(listener, 10 * MS), listener.received[STATES]
        for _ in range(20):
            clock.step()
        assert {x.partition('_')[0] for x in joints_in(states[-1])} == {'right', 'far'}
        both = trajectory((0.1, 0.2), (0.2, 0.3), names=('far_crank', 'right_crank'))
        for n, point in enumerate(both.points):
            point.positions = [0.4 + n, 0.2 + n]
        last = trajectory((0.1, 2.0), names=('right_crank', 'left_crank'))
        last.points[0].positions = [2.0, 1.0]
        wrong = trajectory((0.1, 0.7), names=('right_crank', 'left_coupler'))

        def sent(joint, position, *messages):
            """Sends trajectories, again if they are lost, and awaits where a joint arrives."""
            for message in messages:
                publisher.publish(message)

            def place():
                state = deserialize_message(states[-1], JointState)
                return state.position[state.name.index(joint)]

            return any(clock.step() or place() == pytest.approx(position) for _ in range(200))

        wait_for(lambda: sent('far_crank', 1.4, both, wrong))
        wait_for(lambda: sent('right_crank', 2.0, last))
        output = stop(node, code=1)
        wait_for(lambda: all(listener.received[x] for x in TYPES))
    assert 'left: the motion ends 0.1 s after the start of its law' in output
    assert 'the other linkages continue' in output
    assert output.rstrip().endswith('; ended early: left')
    verified(log)
    reader, messages = logged(log)
    left, right, far = (len(reader.motions[name]) for name in ('left', 'right', 'far'))
    assert (left, right >= 3, far >= 2) == (1, True, True)
    last = deserialize_message(messages[STATES][-1].data, JointState)
    place = dict(zip(last.name, last.position, strict=True))
    assert (place['right_crank'], place['far_crank']) == pytest.approx((2.0, 1.4))
    efforts = [efforts_in(message.data) for message in messages[EFFORTS]]
    ended = len(messages['/left/driving_torque'])
    assert ended == 11
    assert all(math.copysign(left, 1) > 0 for left, _, _ in efforts[:ended])
    assert {left for left, _, _ in efforts[ended:]} == {0.0}
    assert efforts[-1] == [0.0, 0.0, 0.0]  # the end of the node
    assert all(all(row[1:]) for row in efforts[:-1])
    (zero,) = reader.torque_ends
    assert (zero.linkage, zero.cause) == ('', 'SIGINT')
    report = deserialize_message(messages[DIAGNOSTICS][-1].data, DiagnosticArray)
    assert 100 <= report.header.stamp.sec < 200  # on the simulated clock
    planned = [deserialize_message(x.data, JointTrajectory) for x in messages[PLANNED]]
    assert {tuple(one.joint_names) for one in planned} == {
        ('left_crank', 'right_crank', 'far_crank')
    }
    assert [point.effort[0] for point in planned[-2].points] == [0.0] * len(planned[-2].points)
    assert planned[-2].points[0].positions[0] == pytest.approx(0.1, abs=0.02)
    assert planned[-1].points[0].effort.tolist() == [0.0, 0.0, 0.0]
    (line,) = [line for line in info(reader) if 'left ends' in line]
    assert 'where the speed is still 2 rad/s' in line


def test_a_trajectory_for_a_motion_that_has_ended_is_rejected_for_it_alone():
    """The tick that reads it ends the motion, or an earlier one did."""
    robot = Robot(configure(LEGS))
    (source,) = robot.inputs().values()
    names = 'left_crank', 'right_crank'
    both = trajectory((1.0, 0.3), names=names)
    both.points[0].positions = [0.3, 0.3]
    data, end = serialize_message(both), 100 * MS
    motions = {name: simulator.begin(0) for name, simulator in robot.simulators.items()}
    for stamp, refused in ((end, ()), (end + 1, ('left',))):
        for name, motion in motions.items():
            source.sources[name].prepare(motion, stamp)
        assert tuple(source.read(data, 0).refused) == refused
    source.sources['left'].prepare(motions['left'], end)
    source.sources['left'].has_ended = True
    assert tuple(source.read(data, 0).refused) == ('left',)
    counts = [source.sources[name].counts['trajectories rejected'] for name in LEGS['linkages']]
    assert counts == [2, 0]


def test_the_end_of_one_law_leaves_the_trajectories_of_the_others_whole():
    robot = Robot(configure({**LEGS, 'trajectory_command_topic': 'planned'}))
    ahead, begin, end = TrajectoryAhead(robot), 20 * MS, 100 * MS
    motions = {name: simulator.begin(0) for name, simulator in robot.simulators.items()}
    for stamp in (begin, begin + 250 * MS):
        _, _, points = decode_trajectory(ahead.message_at(motions, stamp))
        assert points[-1].time == ahead._horizon
        ((place, *_), *_) = [p.positions for p in points if stamp + p.time >= end]
        for point in points:
            time = stamp + point.time
            ((q, u, a, effort), right) = zip(*point[:4], strict=True)
            assert right[0] == motions['right'].at(time).unwrapped
            assert bool(right[3])
            if time > end:
                assert (q, u, a, effort) == (place, 0.0, 0.0, 0.0)
            else:
                assert q == motions['left'].at(time).unwrapped
                assert effort
        motions.pop('left', None)
    # The last law ends the trajectories.
    motions = {'left': robot.simulators['left'].begin(0)}
    _, _, points = decode_trajectory(TrajectoryAhead(robot).message_at(motions, begin))
    assert points[-1].time == end - begin


def test_a_command_for_a_motion_that_has_ended_is_rejected_for_it_alone():
    commands = {name: TorqueCommands(5.0, 1.0, f'{name}_crank') for name in ('left', 'right')}
    source = SharedInput(commands)
    command = JointState(name=['left_crank', 'right_crank'], effort=[1.0, 2.0])
    assert source.read(serialize_message(command), 0) == ({'left': 1.0, 'right': 2.0}, {})
    commands['left'].has_ended = True
    values, refused = source.read(serialize_message(command), 0)
    assert (values, [*refused]) == ({'right': 2.0}, ['left'])
    short = JointState(name=['left_crank', 'other'], effort=[1.0])  # it is not for the right one
    for one in commands.values():
        one.has_ended = False
    assert [*source.read(serialize_message(short), 0).refused] == ['left']
    assert [one.counts['commands rejected'] for one in commands.values()] == [2, 0]


def test_commands_name_any_cranks_and_a_plant_that_ends_leaves_the_others_alone(tmp_path):
    """The gas stops the pump; a command for two cranks moves the other."""
    log, names = tmp_path / 'run.mcap', {'wheel': 'quadrilateral', 'pump': 'compressor',
                                         'arm': 'shaper'}  # fmt: skip
    values = {'linkages': [*names], 'drive': 'torque', 'rate_hz': 100.0, 'torque_limit': 5.0,
              'command_timeout': 10.0, 'log': str(log), 'use_sim_time': True}  # fmt: skip
    for name, preset in names.items():
        parts = {x: y for x, y in CASES['torque'][preset].items() if x not in OF_THE_RUN}
        parts |= {'motor.torque': 0.0, 'motor.damping': 1.0, 'start_rpm': 0.0}
        if name == 'pump':
            parts |= {'motor.torque': 3.0, 'motor.damping': 0.5, 'start_rpm': 20.0}
        values |= {f'{name}.{x}': y for x, y in parts.items() if y is not None}
    with watched(TYPES, *arguments_of(tmp_path, values)) as (listener, node):
        publisher = listener.node.create_publisher(JointState, '/joint_commands', 10)
        wait_for(publisher.get_subscription_count)
        clock, states = SteppedClock(listener, 10 * MS), listener.received[STATES]
        clock.pass_until(lambda: states and not any('pump' in x for x in joints_in(states[-1])))

        def effort_of(joint):
            last = deserialize_message(states[-1], JointState)
            return dict(zip(last.name, last.effort, strict=True))[joint]

        def is_commanded():  # again in each step, since a message may be lost
            publisher.publish(JointState(name=['pump_crank', 'arm_crank'], effort=[1.0, 2.0]))
            publisher.publish(JointState(name=['arm_crank', 'nobody'], effort=[math.nan, 1.0]))
            return effort_of('arm_crank') > 1.0

        clock.pass_until(is_commanded)
        assert abs(effort_of('wheel_crank')) < 1.0
        output = stop(node, code=1)
    assert output.rstrip().endswith('; ended early: pump')
    assert 'arm: effort nan: must be a finite number' in output
    report = verified(log)
    assert report.states == len(logged(log)[1][STATES])


def test_speed_is_set_at_the_top_or_of_one_linkage(tmp_path):
    log = tmp_path / 'run.mcap'
    own = {k: v for k, v in LEGS.items() if 'motion' not in k}
    values = {**own, 'linkages': ['left', 'right', 'far'], 'drive': 'speed', 'rpm': 60.0,
              'far.rpm': 30.0, 'log': str(log)}  # fmt: skip
    with watched(TYPES, *arguments_of(tmp_path, values)) as (listener, node):
        listener.await_more(5)
        for name, rpm in (('rpm', 90.0), ('left.rpm', 10.0), ('rpm', 120.0)):
            assert set_parameter(listener, name, type=3, double_value=rpm).successful
            listener.await_more(5)
        for name in ('left.joint_prefix', 'joint_prefix'):  # which each linkage has itself
            refused = set_parameter(listener, name, type=4, string_value='other_')
            assert not refused.successful
            assert 'left.joint_prefix' in refused.reason
        stop(node)
    speeds = {name: [x.rpm for x in found] for name, found in LogReader(log).motions.items()}
    assert speeds == {
        'left': [60.0, 90.0, 10.0], 'right': [60.0, 90.0, 120.0], 'far': [30.0],
    }  # fmt: skip
    verified(log)


def test_measurements_that_stop_for_one_crank_end_its_torque_alone(tmp_path):
    log = tmp_path / 'run.mcap'
    values = {'linkages': ['leg', 'arm'], 'drive': 'follow', 'effort_command_topic': 'efforts',
              'measurement_timeout': 0.2, 'log': str(log),
              **{f'{name}.{x}': y for name in ('leg', 'arm')
                 for x, y in FOLLOWERS[name].items()}}  # fmt: skip
    topics = {**TYPES, DIAGNOSTICS: 'diagnostic_msgs/msg/DiagnosticArray'}
    with watched(topics, *arguments_of(tmp_path, values)) as (listener, node):
        publisher = listener.node.create_publisher(JointState, '/measured_joint_states', 10)
        wait_for(publisher.get_subscription_count)
        efforts, states, n = listener.received[EFFORTS], listener.received[STATES], 0

        def measure(*joints):
            nonlocal n
            n += 1
            publisher.publish(measurement(n * MS, dict.fromkeys(joints, 0.3 + 1e-4 * n)))

        wait_for(lambda: measure('arm_crank', 'hip', 'leg_crank') or len(states) > 20)
        assert all(efforts_in(efforts[-1]))
        wait_for(lambda: measure('hip', 'arm_crank') or efforts_in(efforts[-1])[0] == 0.0)
        assert efforts_in(efforts[-1])[1]
        assert not any('leg' in joint for joint in joints_in(states[-1]))
        lost, reports = b'leg: no measurement of leg_crank', listener.received[DIAGNOSTICS]
        wait_for(lambda: measure('hip', 'arm_crank') or any(lost in x for x in reports))
        output = stop(node)
    assert 'leg: no measurement of leg_crank on /measured_joint_states' in output
    report, reader = verified(log), LogReader(log)
    assert report.states == len(logged(log)[1][STATES])
    assert reader.torque_ends[0].linkage == 'leg'
    assert reader.torque_ends[-1].linkage == ''


def test_invalid_measurements_in_messages_of_their_own_end_a_torque_at_once(tmp_path):
    """A repeated message, which is older than what is known, does not."""
    log, names = tmp_path / 'run.mcap', ('leg', 'boom')
    values = {'linkages': [*names], 'drive': 'follow', 'effort_command_topic': 'efforts',
              'measurement_timeout': 0.0, 'log': str(log),
              **{f'{name}.{x}': y for name in names
                 for x, y in FOLLOWERS[name].items()}}  # fmt: skip
    (cranks,) = Robot(configure(values)).inputs().values()
    with pytest.raises(UnnamedError):  # it ends no torque
        cranks.read(b'no message', 0)
    with watched(TYPES, *arguments_of(tmp_path, values)) as (listener, node):
        publisher = listener.node.create_publisher(JointState, '/measured_joint_states', 10)
        wait_for(publisher.get_subscription_count)
        efforts, stamps = listener.received[EFFORTS], itertools.count(1)

        def measure(**joints):
            n = next(stamps)
            places = {name: x + 1e-4 * n for name, x in joints.items()}
            for _ in range(2):
                publisher.publish(measurement(n * MS, places))

        wait_for(lambda: measure(leg_crank=0.3, boom_rod=0.95) or len(efforts) > 20)
        assert all(efforts_in(efforts[-1]))
        wait_for(lambda: (measure(leg_crank=0.3), measure(boom_rod=9.0))
                 and efforts_in(efforts[-1])[1] == 0.0)  # fmt: skip
        assert efforts_in(efforts[-1])[0]
        count = len(efforts)
        wait_for(lambda: measure(leg_crank=0.3) or len(efforts) > count + 5)
        assert efforts_in(efforts[-1])[1] == 0.0
        stop(node)
    reader, report = LogReader(log), verified(log)
    assert report.states == len(logged(log)[1][STATES])
    ends = [(end.linkage, end.cause) for end in reader.torque_ends]
    assert ends == [('boom', 'invalid measurement'), ('', 'SIGINT')]


# Slider-cranks without mass, whose guides have no force until somebody pushes; then friction locks
# them.
LOCKING = {
    'mechanism': 'slider_crank', 'drive': 'follow', 'gravity': [0.0, 0.0],
    'crank.length': 0.1, 'coupler.length': 0.11,
    'loads.rails.kind': 'friction', 'loads.rails.guide': 1.5,
    'loads.push.kind': 'force', 'loads.push.link': 'slider', 'loads.push.force': [0.0, 0.0],
}  # fmt: skip


@pytest.mark.parametrize('together', [True, False])
def test_measurements_of_a_linkage_that_a_force_has_locked_are_rejected(tmp_path, together):
    """Its torque ends at once, also if no state of the other one holds the 0."""
    log, sides = tmp_path / 'run.mcap', ('left', 'right')
    values = {**LOCKING, 'linkages': [*sides], 'effort_command_topic': 'efforts',
              'measurement_timeout': 0.0, 'log': str(log),
              **{f'{side}.loads.push.wrench_topic': f'{side}/push' for side in sides},
              'loads.push.wrench_timeout': 60.0}  # fmt: skip
    with watched(TYPES, *arguments_of(tmp_path, values)) as (listener, node):
        push = listener.node.create_publisher(WrenchStamped, '/left/push', 10)
        robot = listener.node.create_publisher(JointState, '/measured_joint_states', 10)
        wait_for(robot.get_subscription_count)
        states, efforts = listener.received[STATES], listener.received[EFFORTS]
        stamps, cranks = itertools.count(1), ('left_crank', 'right_crank')

        def measure():
            for names in [cranks] if together else zip(cranks, strict=True):
                stamp = next(stamps) * MS
                places = dict.fromkeys(names, 1.2 + stamp * 1e-11)
                robot.publish(measurement(stamp, places, velocity=[1.0] * len(places)))

        def held():
            return {joint.partition('_')[0] for state in states[-2:] for joint in joints_in(state)}

        wait_for(lambda: measure() or len(states) > 20)
        assert held() == {*sides}
        wait_for(lambda: measure() or push.publish(wrench(50.0, 0.0)) or held() == {'right'})
        count = len(states)
        wait_for(lambda: measure() or len(states) > count + 20)
        assert held() == {'right'}
        output = stop(node, code=1)
    assert 'friction locks the mechanism' in output
    assert 'left: its motion has ended' in output
    assert output.rstrip().endswith('; ended early: left')
    assert efforts_in(efforts[-1]) == [0.0, 0.0]
    assert verified(log).states == len(logged(log)[1][STATES])
    ends = [(end.linkage, end.cause) for end in LogReader(log).torque_ends]
    assert ends == [('left', 'end of the motion'), ('', 'SIGINT')]
    (cranks,) = Robot(configure(values)).inputs().values()
    left = cranks.sources['left']
    left._last -= 10.0
    assert left.troubles('measured_joint_states')
    left.has_ended = True
    assert not left.troubles('measured_joint_states')
    # Negative controls: without the record, and with that of another linkage.
    for other in ({}, {'right': LogReader(log).linkage_ends['left']._replace(linkage='right')}):
        forged = LogReader(log)
        forged.linkage_ends = other
        assert verify(forged).difference


def test_a_linkage_that_cannot_run_live_is_refused_by_its_name(tmp_path):
    own = {k: v for k, v in LEGS.items() if 'motion' not in k and 'effort' not in k}
    values = {**own, 'drive': 'torque', 'left.command_timeout': 1e-3, 'rate_hz': 10.0}
    done = finished('node', *arguments_of(tmp_path, values))
    assert_refused(done.returncode, done.stdout, done.stderr, 'left: command_timeout = 0.001 s')
    done = finished('node', *node_arguments(linkages='[crank]'))
    assert_refused(done.returncode, done.stdout, done.stderr, "'crank' is a parameter")


@pytest.mark.parametrize('drive', ['follow', 'speed'])
def test_forces_and_gravity_act_on_the_linkage_that_they_name(tmp_path, drive):
    log, sides = tmp_path / 'run.mcap', ('left', 'right')
    own = {k: v for k, v in LEGS.items() if 'motion' not in k}
    values = {**own, 'drive': drive, 'log': str(log), **{'rpm': 90.0} | PUSH}
    values |= {f'{side}.loads.push.wrench_topic': f'{side}/push' for side in sides}
    if drive == 'follow':
        del values['rpm']
    with watched(TYPES, *arguments_of(tmp_path, values)) as (listener, node):
        pushes = [listener.node.create_publisher(WrenchStamped, f'/{x}/push', 10) for x in sides]
        robot = listener.node.create_publisher(JointState, '/measured_joint_states', 10)
        states, stamp = listener.received[STATES], 0

        def await_states(count, *given):
            """Awaits states while wrenches come and, with drive: follow, measurements of some."""
            nonlocal stamp
            due = len(states) + count

            def act():
                nonlocal stamp
                stamp += MS
                for publisher, message in given:
                    publisher.publish(message)
                if drive == 'follow':
                    joints = [f'{x}_crank' for x in sides if stamp // MS % 5 or x == 'left']
                    places = dict.fromkeys(joints, 1e-10 * stamp)
                    robot.publish(measurement(stamp, places))
                return len(states) >= due

            wait_for(act)

        await_states(20)
        await_states(20, (pushes[0], wrench()))
        assert set_parameter(
            listener, 'gravity', type=8, double_array_value=[3.0, -9.0]
        ).successful
        await_states(20, (pushes[1], wrench()))
        assert set_parameter(
            listener, 'right.gravity', type=8, double_array_value=[0.0, 9.0]
        ).successful
        await_states(20, (pushes[0], wrench()), (pushes[1], wrench()))
        stop(node)
    assert verified(log).states >= 80
    gravities = {
        name: [x.gravity for x in found if x.gravity]
        for name, found in LogReader(log).motions.items()
    }
    assert gravities == {'left': [(3.0, -9.0)], 'right': [(3.0, -9.0), (0.0, 9.0)]}
    # Negative control: each linkage has its own force.
    for name in sides:
        forged = LogReader(log)
        wrong = {f'{name}.loads.push.force': (0.0, -3.1)}
        forged.configuration = configure({**forged.configuration.parameters(), **wrong})
        assert verify(forged).difference
