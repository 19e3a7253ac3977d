# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The controller prototype: benefit of feed-forward, and a plant that survives its controller."""

import math
from collections import deque
from dataclasses import replace

import pytest
from joint_codec import JointStateCodec
from rclpy.serialization import deserialize_message
from ros_harness import (
    SteppedClock,
    assert_refused,
    fresh_domain,
    logged,
    node_arguments,
    running,
    stop,
    verified,
    wait_for,
    watched,
)
from sensor_msgs.msg import JointState

from linkage_ros import Solver
from linkage_ros.messages.cdr import decode_joint_state, stamp_of
from linkage_ros.motion.drives.base import Machine
from linkage_ros.programs import controller
from linkage_ros.programs.controller import SpeedController
from linkage_ros.settings.configuration import configure, load
from linkage_ros.settings.presets import preset_path

MECHANISM = load('quadrilateral').mechanism
STATES, COMMANDS = '/joint_states', '/joint_commands'
TICK, TICK_NS = 1e-3, 10**6
PREFIXED = JointStateCodec(('left_crank', 'left_coupler', 'left_rocker'), 'tool0')


def heavier(factor):
    """Returns the mechanism with all masses and inertias multiplied by a factor."""
    bodies = {name: getattr(MECHANISM, name) for name in ('crank', 'coupler', 'rocker')}
    changed = {
        name: replace(body, mass=body.mass * factor, inertia=body.inertia * factor)
        for name, body in bodies.items()
    }
    return replace(MECHANISM, **changed)


def ripple(believed, lead, rpm=600.0):
    """Returns the peak speed error from 1.5 to 2 s; a command acts one tick after its state."""
    configuration = configure({'drive': 'torque', 'start_rpm': rpm})
    plant = configuration.drive.begin(0, Machine(Solver(MECHANISM), TICK_NS))
    law = SpeedController(believed, rpm, 15.0, lead)
    waiting, speeds = deque([0.0]), []
    for tick in range(1, 2000):
        found = plant.at(tick * TICK_NS)
        (speed,), crank = found.u, found.unwrapped
        plant.command(tick * TICK_NS, waiting.popleft())
        waiting.append(law.torque(crank, speed, TICK))
        speeds.append(speed)
    return max(abs(speed / (rpm * math.pi / 30) - 1) for speed in speeds[1500:])


def test_feed_forward_removes_most_of_the_ripple():
    alone, late, ahead = (ripple(MECHANISM, lead) for lead in (None, 0.0, 1.5 * TICK))
    wrong = ripple(heavier(1.05), 1.5 * TICK)
    assert 0.1 < alone < 0.5
    assert alone > 20 * ahead
    assert alone > 10 * wrong
    # The look-ahead is essential: without it, the torque is 1.5 ticks old.
    assert late > 3 * ahead
    assert wrong > 3 * ahead


def test_integral_restarts_after_a_gap():
    law = SpeedController(MECHANISM, 150.0, 15.0, None)
    first = law.torque(0.0, 10.0, 0.0)
    assert law.torque(0.0, 10.0, 0.1) > first > 0
    assert law.torque(0.0, 10.0, 0.0) == first


def has_speed(listener, low, high):
    """Returns whether the mean speed of the last 100 states, rad/s, is within limits."""
    last = [PREFIXED.decode(data)[1][3] for data in listener.received[STATES][-100:]]
    return len(last) == 100 and low < sum(last) / 100 < high


def test_killed_controller_is_reported_and_a_new_one_takes_over(tmp_path, monkeypatch):
    """Names and frame come from the plant's parameter file, which the controller also reads."""
    # A process killed while it writes to shared memory may leave the memory locked for others.
    monkeypatch.setenv('FASTDDS_BUILTIN_TRANSPORTS', 'UDPv4')
    path, plant, domain = tmp_path / 'run.mcap', tmp_path / 'plant.yaml', fresh_domain()
    preset = preset_path('quadrilateral').read_text().rstrip()
    names = {'joint_prefix': 'left_', 'frame_id': 'tool0', 'crank_joint': 'arm_motor'}
    lines = (f'    {name}: {text}' for name, text in names.items())
    plant.write_text('\n'.join([preset, *lines, '']))
    arguments = node_arguments(
        drive='torque', start_rpm=150.0, rate_hz=500.0, log=path, command_timeout=0.2,
        torque_limit=60.0, use_sim_time='true', **names, **{'motor.damping': 2.0},
    )  # fmt: skip
    follow = node_arguments(plant=plant, lead_time=0.003)
    heard = [STATES, COMMANDS, '/diagnostics']
    with watched(heard, *arguments, domain=domain) as (listener, node):
        clock = SteppedClock(listener, 2 * 10**6)

        def is_answered(stamp):
            return any(stamp_of(data) == stamp for data in listener.received[COMMANDS][-3:])

        with running('controller', *follow, domain=domain) as first:
            clock.await_controller()
            clock.pass_until(lambda: has_speed(listener, 14.0, 17.5), is_answered)
            first.kill()
            # Without commands, the motor's damping stops the crank, which may swing back.
            clock.pass_until(lambda: has_speed(listener, -12.0, 12.0))
            reported = b'within command_timeout'
            told = listener.received['/diagnostics']
            wait_for(lambda: any(reported in data for data in told[-1:]) or clock.step())
        with running('controller', *follow, domain=domain) as second:
            clock.await_controller()
            clock.pass_until(lambda: has_speed(listener, 14.0, 17.5), is_answered)
            stop(second)
        output = stop(node)
    assert 'are rejected' not in output
    assert 'within command_timeout: the motor alone drives the crank' in output
    assert verified(path).others == ('/diagnostics', COMMANDS)
    (sent, *_) = logged(path)[1][COMMANDS]
    assert decode_joint_state(sent.data).names == ['arm_motor']


# States of other robots, and of a crank without the values that a controller needs.
OTHERS = [
    {},
    {'name': ['wheel', 'arm'], 'position': [1.0, 2.0], 'velocity': [3.0, 4.0]},
    {'name': ['wheel', 'crank'], 'position': [1.0], 'velocity': [3.0, 4.0]},
    {'name': ['crank'], 'position': [1.0]},
    {'name': ['crank'], 'velocity': [1.0]},
    {'name': ['crank'], 'position': [math.nan], 'velocity': [1.0]},
]


def test_states_of_other_robots_and_without_velocity_change_no_command():
    law = SpeedController(MECHANISM, 150.0, 15.0, 0.0015)
    with watched([COMMANDS], program='controller') as (listener, process):
        states = listener.node.create_publisher(JointState, 'joint_states', 10)

        def send(tick, **fields):
            message = JointState(**fields)
            message.header.stamp.nanosec = tick * 10**6
            states.publish(message)

        # Both directions must be connected before the control law starts to integrate.
        commands = listener.received[COMMANDS]
        wait_for(lambda: send(500, name=['crank'], position=[0.0], velocity=[0.0]) or commands)
        send(0, name=['crank'], position=[0.0], velocity=[15.0])
        wait_for(lambda: 0 in sent_back(commands))
        expected = {0: law.torque(0.0, 15.0, 0.0)}
        for tick in range(1, 6):
            for number, other in enumerate(OTHERS):
                send(10 * tick - number - 1, **other)
            place, speed = 0.15 * tick, 15.0 + 0.1 * tick
            send(10 * tick, name=['x', 'crank'], position=[9.0, place], velocity=[9.0, speed])
            wait_for(lambda tick=tick: 10 * tick in sent_back(commands))
            expected[10 * tick] = law.torque(place, speed, 0.01)
        output = stop(process)
    answers = sent_back(commands)
    del answers[500]
    assert answers == expected
    assert output.count('without finite position and velocity of crank is ignored') == 1
    assert 'a callback failed' not in output


def test_controller_answers_in_the_robots_joint(tmp_path):
    law, ratio, plant = SpeedController(MECHANISM, 150.0, 15.0, 0.0015), -5.0, tmp_path / 'p.yaml'
    joints = f'    joints: {{crank: {{name: motor, zero: 0.4, ratio: {ratio}}}}}\n'
    plant.write_text(f'{preset_path("quadrilateral").read_text().rstrip()}\n{joints}')
    arguments = node_arguments(plant=plant)
    with watched([COMMANDS], *arguments, program='controller') as (listener, process):
        states = listener.node.create_publisher(JointState, 'joint_states', 10)
        place, speed = 0.9, 15.2
        state = JointState(name=['motor'], position=[ratio * (place - 0.4)])
        state.velocity = [ratio * speed]
        commands = listener.received[COMMANDS]
        wait_for(lambda: states.publish(state) or commands)
        stop(process)
    command = deserialize_message(commands[0], JointState)
    assert command.name == ['motor']
    assert command.effort[0] == pytest.approx(law.torque(place, speed, 0.0) / ratio, rel=1e-9)


def sent_back(commands):
    """Returns the torque of each command, by its stamp in ms."""
    found = [deserialize_message(data, JointState) for data in commands]
    return {m.header.stamp.nanosec // 10**6: m.effort[0] for m in found}


@pytest.mark.parametrize(
    ('parameter', 'words'),
    [
        ('joint_prefix:=left-', "joint_prefix = 'left-': must be text of the form"),
        ('plant:=pentagon', 'no preset'),
        ('plant:=wind_pump', 'a WindPump has 2 degrees of freedom'),
        ('feed_forward:=3', 'feed_forward = 3: must be true or false'),
        ('bandwidth:=-15.0', 'bandwidth = -15.0: must be a number from 0 to 1e'),
        ('rmp:=600.0', "'rmp' is not a parameter of linkage_controller; did you mean rpm?"),
    ],
)
def test_invalid_parameter_is_one_line_and_exit_code_2(called, parameter, words):
    assert_refused(*called(controller, '--ros-args', '-p', parameter), words)


def test_controller_parameters_are_read_only():
    """No code handles a change, so it must be refused rather than accepted and ignored."""
    assert not any(leaf.quantity.live for leaf in controller.PARAMETERS)
