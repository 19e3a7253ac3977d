# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The node as a lifecycle node: transitions asked of a real process by rclpy's own client."""

import re
import signal
import time
from contextlib import nullcontext

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetAvailableTransitions, GetState
from mechanisms import FOLLOWED
from pages import ROOT, read
from rclpy.serialization import deserialize_message
from ros_harness import (
    CODEC,
    PATIENCE,
    SteppedClock,
    assert_refused,
    call,
    decoded,
    dump,
    finished,
    logged,
    measurement,
    node_arguments,
    running,
    set_parameter,
    stop,
    verified,
    wait_for,
    watched,
)
from sensor_msgs.msg import JointState
from test_faults import fill_the_disk
from test_live_linkages import arguments_of, joints_in
from test_several_linkages import CASES, FOLLOWERS, columns, several
from test_torque_ends import (
    ALTERED,
    EFFORTS,
    TRAJECTORIES,
    assert_moves_without_torque,
    effort_in,
    is_torque,
    is_zero,
    plant,
)

from linkage_ros import MotionError
from linkage_ros.log.reader import LogReader
from linkage_ros.messages.cdr import ERROR, stamp_of
from linkage_ros.programs.record import record, record_measured
from linkage_ros.settings.configuration import configure, read_values

STATES, SAID, MS = '/joint_states', '/diagnostics', 10**6
TOPICS = {STATES: 'sensor_msgs/msg/JointState', SAID: 'diagnostic_msgs/msg/DiagnosticArray'}
TRANSITIONS = {
    'configure': Transition.TRANSITION_CONFIGURE, 'cleanup': Transition.TRANSITION_CLEANUP,
    'activate': Transition.TRANSITION_ACTIVATE, 'deactivate': Transition.TRANSITION_DEACTIVATE,
}  # fmt: skip
SHUTDOWNS = {
    'unconfigured': Transition.TRANSITION_UNCONFIGURED_SHUTDOWN,
    'inactive': Transition.TRANSITION_INACTIVE_SHUTDOWN,
    'active': Transition.TRANSITION_ACTIVE_SHUTDOWN,
}
# Transitions that lead to each state.
PATHS = {
    'unconfigured': (), 'inactive': ('configure',), 'active': ('configure', 'activate'),
    'inactive again': ('configure', 'activate', 'deactivate'),
    'unconfigured again': ('configure', 'activate', 'deactivate', 'cleanup'),
    'active again': ('configure', 'activate', 'deactivate', 'activate'),
}  # fmt: skip


class Supervisor:
    """Asks a managed node for transitions."""

    def __init__(self, listener, namespace=''):
        self._listener, self._namespace = listener, namespace
        self._client = listener.node.create_client(
            ChangeState, f'{namespace}/linkage_node/change_state'
        )
        assert self._client.wait_for_service(PATIENCE)
        futures = []
        nothing = ChangeState.Request(transition=Transition(label='nothing'))

        def is_matched():
            """Sends a request that changes nothing: the answer to a first one may be lost."""
            futures.append(self._client.call_async(nothing))
            time.sleep(0.1)
            return any(future.done() for future in futures)

        wait_for(is_matched)
        assert not any(future.result().success for future in futures if future.done())

    def state(self):
        found = call(self._listener, GetState, 'get_state', GetState.Request(), self._namespace)
        return found.current_state.label

    def ask(self, transition):
        """Asks for a transition; returns whether it succeeded, and the state after it."""
        number = SHUTDOWNS[self.state()] if transition == 'shutdown' else TRANSITIONS[transition]
        request = ChangeState.Request(transition=Transition(id=number))
        future = self._client.call_async(request)
        wait_for(future.done)
        return future.result().success, self.state()

    def follow(self, *transitions):
        """Asks for transitions, which must succeed; returns the state after the last."""
        state = ''
        for transition in transitions:
            succeeded, state = self.ask(transition)
            assert succeeded, transition
        return state


def said(listener):
    """Returns level, message and state in the last diagnostics."""
    (*_, last) = listener.received[SAID] or [None]
    if last is None:
        return None
    motion, *_ = deserialize_message(last, DiagnosticArray).status
    values = {pair.key: pair.value for pair in motion.values}
    return int.from_bytes(motion.level, 'big'), motion.message, values['state']


# ---------------------------------------------------------------- motion and log

MACHINES = {'speed': 'quadrilateral', 'motion': 'quadrilateral', 'torque': 'wind_pump'}


def machine_of(drive, count):
    """Returns the parameters of one linkage, or of one of each mechanism."""
    if count == 'one':
        return {**CASES[drive][MACHINES[drive]], 'drive': drive, 'rate_hz': 250.0}
    if drive != 'torque':
        return several(drive, CASES[drive])
    # With a stronger motor, some are too fast for a live run; with this one, the gas of the
    # compressor ends its motion, which must not matter to the others.
    motor = {'motor.torque': 5.0, 'motor.damping': 0.5}
    return several(drive, {name: {**own, **motor} for name, own in CASES[drive].items()})


@pytest.mark.parametrize('count', ['one', 'several'])
@pytest.mark.parametrize('drive', MACHINES)
def test_a_pause_is_no_time_for_the_motion(tmp_path, drive, count):
    """Before and after it, the states are those of a record; stamps are the time of now."""
    path, again = tmp_path / 'run.mcap', tmp_path / 'record.mcap'
    values = {**machine_of(drive, count), 'log': str(path)}
    arguments = arguments_of(tmp_path, values, managed=True, use_sim_time=True)
    with watched([STATES], *arguments) as (listener, node):
        supervisor, states = Supervisor(listener), listener.received[STATES]
        assert supervisor.follow('configure') == 'inactive'
        clock, due = SteppedClock(listener, 4 * MS), []
        for pause in (0, 7 * 10**9, -(10**9)):
            # Time that passes while the node is inactive has no state.
            for _ in range(3):
                clock.go_on(pause)
            assert len(states) == len(due)
            assert supervisor.follow('activate') == 'active'
            for _ in range(12):
                clock.step()
                due.append(clock._now)
            assert supervisor.follow('deactivate') == 'inactive'
        assert supervisor.follow('cleanup') == 'unconfigured'
        assert [stamp_of(data) for data in states] == due
        ends = {'compressor'} & {*values.get('linkages', ())} if drive == 'torque' else {}
        stop(node, code=1 if ends else 0)
    assert verified(path).states == 36
    for name, motions in LogReader(path).motions.items():
        pauses = [segment for segment in motions if segment.old_stamp is not None]
        assert len(pauses) == (0 if name in ends else 2)
    with pytest.raises(MotionError) if ends else nullcontext():
        record(configure({**values, 'log': ''}), again, duration=36 / 250)
    found, expected = columns(path), columns(again)
    assert found.keys() == expected.keys()
    for name, column in found.items():
        if name.endswith('.t'):  # of a point
            continue
        if drive == 'torque':  # a record integrates in another way
            np.testing.assert_allclose(column, expected[name], rtol=1e-6, atol=1e-6)
        else:
            assert column.tobytes() == expected[name].tobytes(), name


@pytest.mark.parametrize('count', ['one', 'several'])
def test_measurements_are_answered_while_the_node_is_active(tmp_path, count):
    """What is measured in a pause is not answered later; the log equals a record of its own."""
    path, again = tmp_path / 'run.mcap', tmp_path / 'record.mcap'
    values = several('follow', FOLLOWERS) if count == 'several' else FOLLOWED
    values = {**values, 'effort_command_topic': 'efforts', 'log': str(path)}
    joints = {'leg_crank': 0.3, 'boom_rod': 0.95, 'arm_crank': 3.0}
    joints = joints if count == 'several' else {'crank': 0.3}
    with watched([STATES], *arguments_of(tmp_path, values, managed=True)) as (listener, node):
        supervisor, states, n = Supervisor(listener), listener.received[STATES], 0
        publisher = listener.node.create_publisher(JointState, '/measured_joint_states', 10)

        def measure():
            nonlocal n
            n += 1
            places = {name: x + 1e-4 * n for name, x in joints.items()}
            publisher.publish(measurement(n * MS, places))

        supervisor.follow('configure')
        wait_for(publisher.get_subscription_count)
        paused = set()
        for _ in range(3):
            first = n + 1
            for _ in range(30):  # fewer than the node keeps
                measure()
            paused |= {stamp * MS for stamp in range(first, n + 1)}
            time.sleep(1.0)  # until none is under way
            supervisor.follow('activate')
            due = len(states) + 20
            wait_for(lambda due=due: measure() or len(states) >= due)
            supervisor.follow('deactivate')
        assert supervisor.follow('shutdown') == 'finalized'
        stop(node)
    answered = {stamp_of(message.data) for message in logged(path)[1][STATES]}
    assert len(answered) == verified(path).states >= 60
    assert answered.isdisjoint(paused)
    assert [end.cause for end in LogReader(path).torque_ends] == ['deactivate'] * 3
    record_measured(configure({**values, 'log': ''}), again, path, topic='/measured_joint_states')
    found, expected = columns(path), columns(again)
    assert found.keys() == expected.keys()
    for name, column in found.items():
        assert column.tobytes() == expected[name].tobytes(), name


def test_commands_of_a_pause_do_not_act_later(tmp_path):
    path = tmp_path / 'run.mcap'
    arguments = node_arguments(
        managed='true', drive='torque', log=path, command_timeout=1e6, gravity='[0.0, 0.0]'
    )
    with watched([STATES], *arguments) as (listener, node):
        supervisor, states = Supervisor(listener), listener.received[STATES]
        publisher = listener.node.create_publisher(JointState, '/joint_commands', 10)
        supervisor.follow('configure')
        wait_for(publisher.get_subscription_count)
        for _ in range(30):
            publisher.publish(JointState(name=['crank'], effort=[1.0]))
        time.sleep(1.0)  # until none is under way
        supervisor.follow('activate')
        listener.await_more(50)
        assert {numbers[6] for _, numbers in decoded(states)} == {0.0}
        publisher.publish(JointState(name=['crank'], effort=[1.0]))
        wait_for(lambda: CODEC.decode(states[-1])[1][6])
        stop(node)
    assert len(logged(path)[1]['/joint_commands']) == 1
    verified(path)


# ---------------------------------------------------------------- parameters


def test_parameters_are_refused_at_configure_and_changed_in_between(tmp_path):
    """Refusals leave the node unconfigured, and are said; each run has a log of its own."""
    first, second = tmp_path / 'first.mcap', tmp_path / 'second.mcap'
    arguments = node_arguments(**{'managed': 'true', 'crank.length': 0.9, 'log': first})
    with watched(TOPICS, *arguments) as (listener, node):
        supervisor, states = Supervisor(listener), listener.received[STATES]

        def gives(name, **value):
            return set_parameter(listener, name, **value).reason

        def is_refused(words):
            """Asserts that configure fails; the reason is in the diagnostics, once a second."""
            assert supervisor.ask('configure') == (False, 'unconfigured')
            wait_for(lambda: (told := said(listener)) and words in told[1])
            assert said(listener)[0] == 2
            assert said(listener)[2] == 'unconfigured'

        assert supervisor.state() == 'unconfigured'
        names = {
            'crank.length',
            'log',
            'managed',
            'use_sim_time',
            'start_type_description_service',
        }
        assert {*dump(listener)} == names
        is_refused('cannot turn fully')
        assert gives('crank.lenght', type=3, double_value=0.1) == ''
        is_refused("'crank.lenght' is not a parameter")
        assert gives('crank.lenght', type=0) == ''  # it is deleted
        assert {*dump(listener)} == names
        assert gives('log', type=4, string_value='/nowhere/at/all.mcap') == ''
        assert gives('crank.length', type=4, string_value='long') == ''
        is_refused("crank.length = 'long': must be")
        assert gives('crank.length', type=2, integer_value=0) == ''
        is_refused('crank.length = 0')
        assert gives('crank.length', type=3, double_value=0.1) == ''
        is_refused('there is no folder /nowhere')
        assert gives('managed', type=1, bool_value=False) == (
            'managed is read when the node starts: start it again'
        )
        assert gives('log', type=4, string_value=str(first)) == ''
        assert supervisor.follow('configure') == 'inactive'
        assert len(dump(listener)) > 20
        reason = 'rate_hz is read when the node is configured: clean it up first'
        assert gives('rate_hz', type=3, double_value=100.0) == reason
        assert gives('rpm', type=3, double_value=1e9).startswith('rpm = ')
        assert gives('rpm', type=3, double_value=30.0) == ''
        supervisor.follow('activate')
        listener.await_more(20)
        assert gives('rpm', type=3, double_value=-45.0) == ''
        assert gives('rate_hz', type=3, double_value=100.0) == reason
        listener.await_more(20)
        supervisor.follow('deactivate', 'cleanup')
        assert {*dump(listener)} == {*names, 'rpm'}
        before = first.read_bytes()
        is_refused('already exists')
        for name, value in (
            ('mechanism', {'type': 4, 'string_value': 'slider_crank'}),
            ('coupler.length', {'type': 3, 'double_value': 0.4}),
            ('slider.mass', {'type': 2, 'integer_value': 1}),
            ('rate_hz', {'type': 3, 'double_value': 500.0}),
            ('log', {'type': 4, 'string_value': str(second)}),
        ):
            assert gives(name, **value) == ''
        assert supervisor.follow('configure', 'activate') == 'active'
        wait_for(lambda: joints_in(states[-1]) == ['crank', 'coupler', 'slider'])
        listener.await_more(20)
        output = stop(node)
    assert first.read_bytes() == before
    assert output.count('already exists') == output.count('there is no folder') == 1
    assert [segment.rpm for segment in LogReader(first).motions['']] == [150.0, 30.0, -45.0]
    assert [segment.rpm for segment in LogReader(second).motions['']] == [-45.0]
    assert LogReader(second).configuration.session.rate_hz == 500.0
    for path in (first, second):
        assert verified(path).states >= 20


def test_a_dump_of_a_configured_node_configures_it_again(tmp_path):
    arguments = [*node_arguments(managed='true', **{'loads.w.kind': 'force'}), '-p',
                 'loads.w.link:=coupler', '-p', 'loads.w.force:=[0.0, -5.0]']  # fmt: skip
    with watched([STATES], *arguments) as (listener, node):
        supervisor = Supervisor(listener)
        supervisor.follow('configure')
        dumped = dump(listener)
        supervisor.follow('cleanup')
        for name, value in dumped.items():
            fields = {field: getattr(value, field) for field in value.get_fields_and_field_types()}
            assert set_parameter(listener, name, **fields).successful
        assert dump(listener) == dumped
        supervisor.follow('configure')
        assert dump(listener) == dumped
        stop(node)


@pytest.mark.parametrize(
    ('given', 'words'),
    [({'managed': 'maybe'}, "managed = 'maybe': must be true or false"),
     ({'managed': 'true', 'use_sim_time': 3}, 'use_sim_time')],
)  # fmt: skip
def test_a_node_whose_kind_is_not_known_does_not_start(given, words):
    done = finished('node', *node_arguments(**given))
    assert_refused(done.returncode, done.stdout, done.stderr, words)


# ---------------------------------------------------------------- every state


# Each end in each state, and each path.
ENDS = [
    *((path, end) for path in ('unconfigured', 'inactive', 'active')
      for end in ('SIGINT', 'SIGTERM', 'shutdown')),
    ('inactive again', 'SIGINT'), ('unconfigured again', 'SIGTERM'), ('active again', 'shutdown'),
]  # fmt: skip


@pytest.mark.parametrize(('path', 'end'), ENDS)
def test_a_node_ends_in_every_state(tmp_path, path, end):
    log = tmp_path / 'run.mcap'
    values = {**read_values('quadrilateral'), 'managed': 'true', 'log': log,
              'effort_command_topic': EFFORTS}  # fmt: skip
    arguments = [*node_arguments(**values), '-r', '__ns:=/arm']
    topics = {'/arm/joint_states': TOPICS[STATES], SAID: TOPICS[SAID]}
    with watched(topics, *arguments) as (listener, node):
        supervisor = Supervisor(listener, '/arm')
        supervisor.follow(*PATHS[path])
        if path.startswith('active'):
            listener.await_more(5, '/arm/joint_states')
        state = path.removesuffix(' again')
        wait_for(lambda: said(listener) and said(listener)[2] == state)
        assert said(listener)[0] == 0
        if end == 'shutdown':
            assert supervisor.follow(end) == 'finalized'
            wait_for(lambda: said(listener)[1:] == ('finalized', 'finalized'))
        stop(node, signal.SIGINT if end == 'shutdown' else signal.Signals[end])
    if log.exists():
        assert 'configure' in PATHS[path]
        found = LogReader(log)
        assert found.lost == 0  # it has its end record
        usual = ['deactivate'] * PATHS[path].count('deactivate')
        last = [end] if path.startswith('active') else []
        assert [one.cause for one in found.torque_ends] == [*usual, *last]
        if 'activate' in PATHS[path]:
            verified(log)
    else:
        assert 'configure' not in PATHS[path]


def test_a_log_that_has_failed_fails_the_cleanup(tmp_path):
    path = tmp_path / 'run.mcap'
    with watched(TOPICS, *node_arguments(managed='true', log=path)) as (listener, node):
        supervisor = Supervisor(listener)
        supervisor.follow('configure', 'activate')
        listener.await_more(50, STATES)
        fill_the_disk(node, path)
        reports = listener.received[SAID]
        wait_for(lambda: any(b'cannot be written' in report for report in reports))
        supervisor.follow('deactivate')
        assert supervisor.ask('cleanup') == (False, 'unconfigured')
        failed = ERROR, 'unconfigured: the log is incomplete', 'unconfigured'
        wait_for(lambda: said(listener) == failed)
        stop(node, code=1)


def test_an_impossible_transition_is_refused_with_an_answer():
    with watched([STATES], *node_arguments(managed='true')) as (listener, node):
        supervisor = Supervisor(listener)
        for state, impossible in (
            ('unconfigured', ('activate', 'deactivate', 'cleanup')),
            ('inactive', ('configure', 'deactivate')),
            ('active', ('configure', 'activate', 'cleanup')),
        ):
            for transition in impossible:
                assert supervisor.ask(transition) == (False, state)
            request = GetAvailableTransitions.Request()
            found = call(
                listener, GetAvailableTransitions, 'get_available_transitions', request
            ).available_transitions
            assert {one.start_state.label for one in found} == {state}
            if state != 'active':
                supervisor.follow('configure' if state == 'unconfigured' else 'activate')
        listener.await_more(10)
        stop(node)


# ---------------------------------------------------------------- torques


# Functions whose error ends the motion.
FAULTS = {'error of a tick': 'Simulator.state', 'error of a report': 'HealthMonitor.report'}


@pytest.mark.parametrize(
    ('end', 'topic'),
    [*zip(('deactivate', 'shutdown', *FAULTS), 2 * (EFFORTS, TRAJECTORIES), strict=True)],
)
def test_a_plant_moves_without_torque_when_the_node_is_not_active(tmp_path, end, topic):
    """An error leaves the node unconfigured; it may be configured again."""
    path, own, now = tmp_path / 'plant.mcap', tmp_path / 'run.mcap', tmp_path / 'now'
    given = {**read_values('quadrilateral'), 'managed': 'true', 'log': own}
    given |= {'effort_command_topic': EFFORTS, 'trajectory_command_topic': TRAJECTORIES}
    program = 'node'
    if is_error := end in FAULTS:
        action = f'Path({str(now)!r}).unlink(); 1 / 0'
        program = ALTERED.format(action=action, now=str(now), function=FAULTS[end])
        program = f'from pathlib import Path\n{program}'
    with plant(path, topic) as (held, domain):
        with running(program, *node_arguments(**given), domain=domain) as node:
            supervisor = Supervisor(held.listener)
            supervisor.follow('configure', 'activate')
            held.await_effort(is_torque)
            if is_error:
                now.touch()
                wait_for(lambda: supervisor.state() == 'unconfigured')
            else:
                supervisor.follow(end)
            held.await_held(is_zero)
            if end == 'deactivate':
                supervisor.follow('activate')
                held.await_effort(is_torque)
                supervisor.follow('deactivate', 'cleanup')
                held.await_held(is_zero)
            before = own.read_bytes()
            if is_error:
                assert set_parameter(
                    held.listener, 'log', type=4, string_value=str(tmp_path / 'again.mcap')
                ).successful
                supervisor.follow('configure', 'activate')
                held.await_effort(is_torque)
                supervisor.follow('deactivate')
                held.await_held(is_zero)
            stop(node, code=int(is_error))
        assert own.read_bytes() == before
    assert_moves_without_torque(path)
    verified(own)
    ends = LogReader(own).torque_ends
    assert {one.cause for one in ends} == {'error' if is_error else end}
    assert len(ends) == (2 if end == 'deactivate' else 1)
    zeros = [m for m in logged(own)[1][topic] if m.time in {one.stamp for one in ends}]
    assert [effort_in(topic, zero.data) for zero in zeros] == [0.0] * len(ends)


# ---------------------------------------------------------------- an executor of one's own

COMPOSED = ROOT / 'docs/examples/composed.py'


@pytest.mark.parametrize(
    ('kind', 'managed'), [('MultiThreadedExecutor', 'true'), ('SingleThreadedExecutor', 'false')]
)
def test_example_runs_the_node_in_an_executor_with_another(tmp_path, kind, managed):
    path = tmp_path / 'run.mcap'
    program = COMPOSED.read_text().replace('MultiThreadedExecutor', kind)
    given = {**read_values('quadrilateral'), 'effort_command_topic': EFFORTS, 'log': path,
             'managed': managed}  # fmt: skip
    topics = {**TOPICS, EFFORTS: 'std_msgs/msg/Float64MultiArray',
              '/rosout': 'rcl_interfaces/msg/Log'}  # fmt: skip
    with watched(topics, *node_arguments(**given), program=program) as (listener, process):
        if managed == 'true':
            Supervisor(listener).follow('configure', 'activate')
        listener.await_more(50)
        assert set_parameter(listener, 'rpm', type=3, double_value=30.0).successful
        wait_for(lambda: any(b'crank at' in line for line in listener.received['/rosout']))
        listener.await_more(50)
        stop(process, signal.SIGTERM)
        wait_for(lambda: effort_in(EFFORTS, listener.received[EFFORTS][-1]) == 0.0)
    assert verified(path).states >= 100
    assert [one.cause for one in LogReader(path).torque_ends] == ['SIGTERM']


def test_an_error_of_the_program_ends_the_torque_before_it(tmp_path):
    """Unless a thread of the program goes on, which would keep the process."""
    path, now = tmp_path / 'run.mcap', tmp_path / 'now'
    wait = f'from pathlib import Path\n    while not Path({str(now)!r}).exists(): stop.wait(0.01)'
    program = COMPOSED.read_text().replace('stop.wait()', f'{wait}\n    1 / 0')
    given = {**read_values('quadrilateral'), 'effort_command_topic': EFFORTS, 'log': path}
    topics = {EFFORTS: 'std_msgs/msg/Float64MultiArray'}
    with watched(topics, *node_arguments(**given), program=program) as (listener, process):
        listener.await_more(5, EFFORTS)
        now.touch()
        assert 'ZeroDivisionError' in process.communicate(timeout=PATIENCE)[1]
        assert process.returncode == 1
        wait_for(lambda: effort_in(EFFORTS, listener.received[EFFORTS][-1]) == 0.0)
    assert [one.cause for one in LogReader(path).torque_ends] == ['end']
    verified(path)


# A program that is its own supervisor, and ends ROS before the node.
ALONE = """
import sys, time, rclpy
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions
from linkage_ros.node.linkage_node import LinkageNode
rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
path = sys.argv[1]
given = {'managed': True, 'crank.length': 9.0, 'log': path}
node = LinkageNode(
    name='leg', parameter_overrides=[Parameter(name, value=value) for name, value in given.items()]
)
node.start()
print(node.trigger_configure())
(result,) = node.set_parameters([Parameter('crank.length', value=0.1)])
print(result.successful, node.trigger_configure(), node.trigger_activate())
(result,) = node.set_parameters([Parameter('rpm', value=30.0)])
while open(path, 'rb').read().count(b'linkage_ros/motion') < 2:
    time.sleep(0.01)
rclpy.shutdown()
sys.exit(node.end())
"""


def test_a_program_may_supervise_the_node_and_end_ros_before_it(tmp_path):
    """Then no torque of 0 can be sent; the log is complete."""
    path = tmp_path / 'run.mcap'
    done = finished(ALONE, path)
    success, failure = (f'TransitionCallbackReturnType.{x}' for x in ('SUCCESS', 'FAILURE'))
    assert done.stdout == f'{failure}\nTrue {success} {success}\n'
    assert 'Traceback' not in done.stderr
    assert LogReader(path).lost == 0
    verified(path)
    assert [segment.rpm for segment in LogReader(path).motions['']] == [150.0, 30.0]


# A program whose parameters are refused twice, and which starts the node in every way.
REPEATED = """
import sys, threading, rclpy
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions
from linkage_ros import MechanismError
from linkage_ros.cli import Stop
from linkage_ros.node.linkage_node import LinkageNode
rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
stop = Stop()
for length in (9.0, 9.0, 0.1):
    given = {'crank.length': length, 'log': sys.argv[1]}
    overrides = [Parameter(name, value=value) for name, value in given.items()]
    try:
        node = LinkageNode(stop, parameter_overrides=overrides)
    except MechanismError:
        pass
node.start()
node.start()
threading.Timer(1.0, stop.set).start()
code = node.work()
node.start()
node.destroy_node()
rclpy.shutdown()
sys.exit(code or node.end())
"""


def test_a_node_is_started_once_and_destroyed_if_it_is_refused(tmp_path):
    path = tmp_path / 'run.mcap'
    done = finished(REPEATED, path)
    assert (done.returncode, 'Traceback' in done.stderr) == (0, False), done.stderr
    assert 'already registered' not in done.stderr
    assert verified(path).states > 0


def test_a_torque_is_refused_where_a_signal_would_end_ros_before_it():
    program = COMPOSED.read_text().replace('SignalHandlerOptions.NO', 'SignalHandlerOptions.ALL')
    given = {**read_values('quadrilateral'), 'effort_command_topic': EFFORTS}
    done = finished(program, *node_arguments(**given))
    assert done.returncode == 1
    assert 'the torque on /arm/efforts could not be ended' in done.stderr


def test_the_page_shows_the_lines_of_the_example():
    page, program = read('docs/managed.md'), COMPOSED.read_text()
    (block,) = re.findall(r'(?:    .*rclpy.init.*\n)(?:    .*\n|\n)+', page)
    for line in filter(None, map(str.strip, block.splitlines())):
        assert line in program
