# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The robot's own joints: names, zeros, ratios and parents in all messages, in and out.

The robots are made by `robots`, which reads their URDF again and computes pose and torque itself.
"""

import math
import re
from contextlib import suppress
from itertools import islice

import numpy as np
import pytest
from joint_codec import JointStateCodec
from mechanisms import FOLLOWED
from one_linkage import TrajectoryAlone, alone, inputs_of, run_alone
from other_bags import write_mcap
from rclpy.serialization import deserialize_message
from robots import Tree, make_robot
from ros_harness import (
    report_of,
    verified,
)
from state_messages import messages_at, messages_of
from trajectory_msgs.msg import JointTrajectory

from linkage_lab.robots.import_tool import parameter_text, read_robot
from linkage_lab.robots.loops import Request
from linkage_lab.robots.robot_drawing import draw_robot
from linkage_ros import ConfigurationError, read_log
from linkage_ros.log.reader import LogReader
from linkage_ros.log.verify import verify
from linkage_ros.messages.cdr import decode_joint_state
from linkage_ros.messages.joints import joint_rows, link_rows
from linkage_ros.messages.templates import trajectory
from linkage_ros.messages.topics import JOINT_STATE
from linkage_ros.programs.record import record, record_measured
from linkage_ros.programs.replay import motions_in
from linkage_ros.run.states import Simulator
from linkage_ros.settings.configuration import (
    configure,
    from_strings,
    load,
    read_values,
    to_strings,
)
from linkage_ros.settings.notes import notes

X_Z = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
ROBOTS = {
    'leg with a parallel four-bar': (
        {'crank.length': 0.06, 'coupler.length': 0.3, 'rocker.length': 0.06, 'frame.length': 0.3},
        'B', X_Z,
    ),
    'gripper driven at the rocker': (
        {'crank.length': 0.05, 'coupler.length': 0.03, 'rocker.length': 0.02,
         'frame.length': 0.055},
        'A', None,
    ),
    'tilted crank-rocker, open at the frame': (
        {'crank.length': 0.1, 'coupler.length': 0.4, 'rocker.length': 0.3, 'frame.length': 0.35},
        'B0', None,
    ),
    'slider-crank': (
        {'crank.length': 0.05, 'coupler.length': 0.2, 'slider.offset': 0.02}, 'B', X_Z,
    ),
    'tilted slider-crank, open at the crank pin': (
        {'crank.length': 0.05, 'coupler.length': 0.2, 'slider.offset': -0.03}, 'A', None,
    ),
    'excavator arm, driven by its cylinder': (
        {'crank.length': 1.2, 'frame.length': 0.57, 'offset': 0.04, 'stroke': 1.0,
         'input': 'cylinder'}, 'A', X_Z,
    ),
    'leg with a linear actuator, open at the hip': (
        {'crank.length': 0.1, 'frame.length': 0.4, 'offset': -0.02, 'stroke': 0.38,
         'input': 'cylinder'}, 'A0', None,
    ),
    'slotted lever, open at its pivot': (
        {'crank.length': 0.1, 'frame.length': 0.25, 'offset': 0.01, 'stroke': 0.2,
         'input': 'crank'}, 'B0', None,
    ),
}  # fmt: skip


def robot_of(name, tmp_path, number=0, hip=None):
    """Returns a robot, its tree, the configuration imported from it, and a reachable pose."""
    lengths, cut, axes = ROBOTS[name]
    random = np.random.default_rng(number)
    values = {
        'mechanism': 'inverted_slider_crank' if 'stroke' in lengths else 'four_bar'
        if 'frame.length' in lengths else 'slider_crank',
        'assembly': 'open', 'frame.angle': random.uniform(-3, 3), **lengths,
    }  # fmt: skip
    is_cylinder = 'stroke' in values
    for link in ('crank', 'coupler', 'rocker', *('barrel', 'rod') * is_cylinder):
        if f'{link}.length' in values or link in {'barrel', 'rod'}:
            values[f'{link}.mass'] = random.uniform(0.1, 3)
            values[f'{link}.inertia'] = random.uniform(0.001, 0.1)
            values[f'{link}.center'] = tuple(random.normal(size=2) * 0.1)
    if 'slider.offset' in values:
        values['slider.mass'] = 0.7
    made = make_robot(values, random, cut, axes, hip)
    path = tmp_path / 'robot.urdf'
    path.write_text(made.text)
    robot, trials = read_robot(path), 0
    while True:  # a crank value at which the loop closes
        trials += 1
        at = {name: random.uniform(-3, 3) for name, *_ in made.joints.values()}
        if is_cylinder:
            at[made.joints['rod'][0]] = 0.0
        driven = made.joints['rod' if values.get('input') == 'cylinder' else 'crank'][0]
        try:
            world = 'root' if hip else ''
            found = draw_robot(robot, Request(driven, [made.close], at=at, world=world))
            break
        except ConfigurationError:
            assert trials < 100
    parameters = tmp_path / 'robot.yaml'
    parameters.write_text(parameter_text(found, 'robot.urdf'))
    return made, Tree(made.text), load(str(parameters)), found


def answers(simulator, values, speed=3.0):
    """Yields measured values of the crank's joint and their messages, if within reach."""
    (crank,) = inputs_of(simulator).values()
    codec = JointStateCodec([simulator.crank_joint])
    for number, value in enumerate(values, 1):
        data = codec.encode(number * 1_000_000, [value], [speed], [0.0])
        with suppress(ValueError):
            stamp, coordinates = crank.read(data, 0)
            yield value, messages_of(simulator, stamp, coordinates, crank.later(coordinates))


def mechanism_state(made, simulator):
    """Returns positions, velocities, accelerations and efforts by name of the joint."""
    frame_id = simulator.linkage.session.frame_id
    codec = JointStateCodec(simulator.joints, frame_id, trajectory)
    _, numbers = codec.decode(made.messages[2])
    rows = np.reshape(numbers, (4, -1)).tolist()
    return [dict(zip(simulator.joints, row, strict=True)) for row in rows]


@pytest.mark.parametrize('name', ROBOTS)
def test_answers_close_the_robots_loop_with_its_torque(name, tmp_path):
    made, tree, configuration, found = robot_of(name, tmp_path)
    simulator, random = Simulator(configuration.only), np.random.default_rng(1)
    driven, reach = simulator.crank_joint, simulator.solver.reach
    values = found.given[driven] + np.cumsum(random.uniform(-0.08, 0.12, size=1000))
    if reach.slides:
        ((low, high),) = reach.arcs
        own = 0.5 * (low + high) + 0.49 * (high - low) * np.sin(np.arange(250.0))
        values = simulator.machine.joint.value(own)
    torques, errors, count = [], [], 0
    for value, answer in islice(answers(simulator, values), 250):
        state = decode_joint_state(answer.messages[0])
        q = dict(zip(state.names, state.positions, strict=True))
        assert len(q) == 3
        assert q[driven] == value  # the measured value itself
        assert tree.gap(q, made.close) < 1e-9
        count += 1
        if count % 10 == 0:
            q, u, a, efforts = mechanism_state(answer, simulator)
            torques.append(tree.power(q, u, a) / 3.0)
            errors.append(abs(efforts[driven] - torques[-1]))
    assert count == 250
    # Near a limit of the crank, single torques are huge.
    sizes = np.abs(torques) + np.median(np.abs(torques))
    assert np.max(errors / sizes) < 1e-9


@pytest.mark.parametrize('name', ['leg with a parallel four-bar', 'slider-crank'])
def test_torque_of_a_linkage_on_a_swinging_hip(name, tmp_path):
    """The torque is that of the whole robot, at the rates that the filters find."""
    _, tree, configuration, found = robot_of(name, tmp_path, hip='revolute')
    configuration = from_strings(to_strings(configuration))
    simulator, log = Simulator(configuration.only), tmp_path / 'leg.mcap'
    codec, start = JointStateCodec(['hip', 'crank_motor']), found.given['crank_motor']
    (crank,), answers, bag = inputs_of(simulator).values(), [], []
    for n in range(1, 301):
        # The hip swings with up to 5 rad/s and 40 rad/s^2.
        values = [0.625 * math.sin(8e-3 * n), start + 0.2 * math.sin(0.023 * n)]
        data = codec.encode(n * 1_000_000, values, 2 * [math.nan], 2 * [0.0])
        bag.append(('/joint_states', JOINT_STATE, n * 1_000_000, data))
        with suppress(ValueError):
            answers.append(crank.read(data, 0))
    assert len(answers) > 200
    turn, torques, errors = configuration.drive.frame_joint.ratio, [], []
    for stamp, coordinates in answers[1:]:  # at the first one, the rates are 0
        answer = messages_of(simulator, stamp, coordinates)
        *motion, efforts = mechanism_state(answer, simulator)
        moved = [
            {**row, 'hip': turn * x}
            for row, x in zip(motion, coordinates.conditions.frame, strict=True)
        ]
        torques.append(
            tree.power(*moved, along={**moved[1], 'hip': 0.0}) / moved[1]['crank_motor']
        )
        errors.append(abs(efforts['crank_motor'] - torques[-1]))
    assert np.max(errors) < 1e-9 * np.max(np.abs(torques))

    write_mcap(tmp_path / 'robot.mcap', bag)
    record_measured(configuration, log, tmp_path / 'robot.mcap')
    assert verified(log).ulp == 0
    efforts = read_log(log)['/joint_states']['crank_motor.effort']
    assert len(efforts) == len(answers)
    other = {**configuration.parameters(), 'frame_joint.pivot': (0.1, 0.2)}
    forged = LogReader(log)
    forged.configuration = configure(other)
    assert 'effort' in verify(forged).difference


FRAME_JOINT = {'frame_joint.name': 'hip', 'frame_joint.pivot': (0.1, 0.2)}


def test_measurements_without_the_frame_joint_are_rejected():
    (crank,) = inputs_of(Simulator(configure({**FOLLOWED, **FRAME_JOINT}).only)).values()

    def answer(n, **joints):
        codec = JointStateCodec([*joints])
        return crank.read(codec.encode(n, [*joints.values()], *2 * [[math.nan] * len(joints)]), 0)[
            1
        ]

    first = answer(1_000_000, crank=0.1, hip=0.0)
    for joints in ({'crank': 0.2}, {'crank': 0.2, 'hip': math.nan}, {'hip': 0.2}):
        with pytest.raises(ValueError, match=r'frame_joint|not finite|of the crank'):
            answer(2_000_000, **joints)
    assert set(crank.rejected.values()) == {1}
    # The filters did not see them.
    last = answer(3_000_000, crank=0.2, hip=0.1)
    assert (last.u, last.a) == (last.conditions.frame[1:2], last.conditions.frame[2:])
    assert first.conditions.frame == (0.0, 0.0, 0.0)


@pytest.mark.parametrize(('given', 'words'), [
    ({'frame_joint.name': 'crank'}, 'that is the crank'),
    ({'frame_joint.name': 'rocker'}, 'that is a joint of this linkage'),
    ({**FRAME_JOINT, 'joints.coupler.name': 'hip'}, 'that is a joint of this linkage'),
    ({'frame_joint.pivot': (0.1, 0.2)}, 'frame_joint.name is missing'),
    ({**FRAME_JOINT, 'frame_joint.ratio': 0.0}, 'positive or negative'),
    ({'plane.origin': [1.0, 2.0, 3.0]}, r'plane\.link is missing'),
    ({'plane.link': 'thigh', 'plane.origin': [1.0, 2.0]}, 'must be 3 numbers'),
    ({'plane.link': 'thigh', 'plane.x': [0.0, 0.6, 0.8]}, 'perpendicular'),
    ({'plane.link': 'thigh', 'plane.x': [0.5, 0.0, 0.0]}, 'length 1'),
    ({**FRAME_JOINT, 'drive': 'speed', 'rpm': 60.0}, 'drive: follow'),
])  # fmt: skip
def test_wrong_frame_joints_are_refused(given, words):
    with pytest.raises(ConfigurationError, match=words):
        configure({**FOLLOWED, **given})


def test_missing_zero_of_a_measured_crank_is_noted():
    given = {**FOLLOWED, 'joints.crank.name': 'motor'}
    (line,) = notes(configure(given))
    assert line == (
        "joints.crank.zero is not given, so zero 0: motor's 0 is taken as the direction of +x"
    )
    assert notes(configure({**given, 'joints.crank.zero': 0.0})) == []
    assert notes(configure({**given, 'drive': 'speed', 'rpm': 60.0})) == []


# The joints of a robot: other names, zeros and directions, a gear, and another tree.
JOINTS = {
    'joints.crank.name': 'hip_motor', 'joints.crank.zero': 0.4, 'joints.crank.ratio': -5.0,
    'joints.coupler.name': 'rod', 'joints.coupler.zero': -1.2, 'joints.coupler.parent': 'rocker',
    'joints.rocker.ratio': -1.0, 'joint_prefix': 'left_',
}  # fmt: skip
DRIVES = {
    'speed': {'rpm': 150.0, 'trajectory_command_topic': 'ahead', 'effort_command_topic': 'effort'},
    'torque': {'motor.torque': 9.0, 'motor.damping': 0.5},
    'motion': {'motion.center': 1.57, 'motion.amplitude': 0.5, 'motion.frequency': 0.5},
}


def driven(drive, **changes):
    preset = {name: x for name, x in FOLLOWED.items() if name != 'drive'}
    return configure({**preset, 'drive': drive, **DRIVES[drive], **changes})


@pytest.mark.parametrize('drive', DRIVES)
def test_every_drive_maps_its_messages(drive, tmp_path):
    mapped, plain = (Simulator(driven(drive, **changes).only) for changes in (JOINTS, {}))
    assert mapped.joints == ('hip_motor', 'rod', 'left_rocker')
    assert mapped.description is None
    assert Simulator(driven(drive, **JOINTS, publish_description=True).only).description
    found, due = (
        mechanism_state(messages_at(x, x.begin(0), 700_000_000), x) for x in (mapped, plain)
    )
    turned = {}
    for k, (row, own) in enumerate(zip(found[:3], due[:3], strict=True)):
        zero = k == 0
        turned['hip_motor'] = -5.0 * (own['crank'] - 0.4 * zero)
        turned['rod'] = own['coupler'] + own['crank'] - own['rocker'] + 1.2 * zero
        turned['left_rocker'] = -own['rocker']
        for name, value in turned.items():
            off = row[name] - value
            off = math.remainder(off, math.tau) if zero else off
            assert off == pytest.approx(0.0, abs=1e-12 * (1 + abs(value)))
    assert abs(found[0]['rod']) <= math.pi
    assert found[3] == {'hip_motor': due[3]['crank'] / -5.0, 'rod': 0.0, 'left_rocker': 0.0}
    # A view of a log shows the linkage itself.
    for simulator in (mapped, plain):
        _, state, _, messages = messages_at(simulator, simulator.begin(0), 700_000_000)
        _, places, rates, torque = motions_in(run_alone(simulator), [(0, messages[0])])['']
        assert np.remainder(places[0] - state.position + 1, math.tau) == pytest.approx(
            1, abs=1e-12
        )
        assert rates[0] == pytest.approx(state.velocity, rel=1e-12)
        assert torque[0, 0] == pytest.approx(state.torque, rel=1e-12)
    # A record verifies, and its configuration survives.
    log = tmp_path / 'run.mcap'
    record(alone(mapped.linkage), str(log), duration=2.0)
    report = report_of(log)
    assert report.difference == ''
    assert report.ulp <= (4.0 if drive == 'torque' else 0.0)
    own = alone(mapped.linkage)
    assert from_strings(to_strings(own)) == own


def test_trajectory_and_command_are_those_of_the_motor():
    mapped, plain = (Simulator(driven('speed', **changes).only) for changes in (JOINTS, {}))
    messages = [TrajectoryAlone(x).message_at(x.begin(0), 0) for x in (mapped, plain)]
    found, due = (deserialize_message(x, JointTrajectory) for x in messages)
    assert found.joint_names == ['hip_motor']
    for one, own in zip(found.points, due.points, strict=True):
        assert one.positions[0] == pytest.approx(-5.0 * (own.positions[0] - 0.4))
        assert one.velocities[0] == -5.0 * own.velocities[0]
        assert one.accelerations[0] + 0.0 == -5.0 * own.accelerations[0] + 0.0
        assert one.effort[0] == own.effort[0] / -5.0
    plant = Simulator(driven('torque', **JOINTS, torque_limit=20.0).only)
    (commands,) = inputs_of(plant).values()
    assert commands.commanded(['hip_motor'], [-3.0]) == 15.0
    assert commands.commanded(['hip_motor'], [-5.0]) == 20.0


def test_unpublished_joint(tmp_path):
    changes = {**JOINTS, 'joints.coupler.name': ''}
    simulator, every = (Simulator(configure({**FOLLOWED, **x}).only) for x in (changes, JOINTS))
    assert simulator.joints == ('hip_motor', 'left_rocker')
    pairs = zip(answers(simulator, [0.1]), answers(every, [0.1]), strict=True)
    for (_, one), (_, other) in pairs:
        state, full = (decode_joint_state(x.messages[0]) for x in (one, other))
        assert state.names == ['hip_motor', 'left_rocker']
        assert state.positions == full.positions[::2]
        named = zip(state.names, state.positions, strict=True)
        numbers = simulator.numbers.of(one.state, state.positions[0])
        assert simulator.joint_words(numbers) == ', '.join(f'{x} {y:.6g} rad' for x, y in named)
        _, places, *_ = motions_in(run_alone(simulator), [(0, one.messages[0])])['']
        assert places[0, 1:] == pytest.approx(one.state.position[1:], abs=1e-12)


REFUSED = {
    'a joint of no link': ({'joints.wheel.name': 'a'}, 'joints has crank, coupler, rocker'),
    'a list of names': ({'joints': ['a', 'b', 'c']}, 'write joints: {crank: ...}'),
    'a joint of another mechanism': ({'joints.slider.name': 'a'}, 'joints.slider.name'),
    'a misspelt setting': ({'joints.crank.zeros': 0.0}, 'joints.crank.zero'),
    'no group': ({'joints.crank': 'a'}, 'joints.crank'),
    'a ratio of 0': ({'joints.crank.ratio': 0.0}, 'positive or negative'),
    'no name of the crank': ({'joints.crank.name': ''}, 'must be a name'),
    'one name twice': ({'joints.crank.name': 'a', 'joints.rocker.name': 'a'}, 'two joints'),
    'the name of another joint': ({'joints.crank.name': 'rocker'}, 'two joints'),
    'a parent that is missing': ({'joints.rocker.parent': 'base'}, 'frame or crank or coupler'),
    'itself as parent': ({'joints.rocker.parent': 'rocker'}, 'frame or crank or coupler'),
    'a moving parent of the crank': ({'joints.crank.parent': 'rocker'}, 'must be frame'),
    'parents in a circle': (
        {'joints.coupler.parent': 'rocker', 'joints.rocker.parent': 'coupler'}, 'circle',
    ),
    'two names of the crank': (
        {'joints.crank.name': 'a', 'crank_joint': 'b'}, 'leave crank_joint out',
    ),
    'a plant with an unpublished joint': (
        {'drive': 'torque', 'joints.rocker.name': '', 'motor.torque': 1.0}, 'drive: torque',
    ),
}  # fmt: skip


@pytest.mark.parametrize('case', REFUSED)
def test_wrong_joint_is_refused(case):
    changes, words = REFUSED[case]
    with pytest.raises(ConfigurationError, match=re.escape(words)):
        configure({**FOLLOWED, **changes})


def test_parent_of_a_slider_must_be_the_frame():
    values = read_values('slider_crank')
    assert configure({**values, 'joints.coupler.parent': 'frame'})
    for link, parent in (('slider', 'crank'), ('crank', 'slider')):
        with pytest.raises(ConfigurationError, match=f'joints.{link}.parent'):
            configure({**values, f'joints.{link}.parent': parent})


@pytest.mark.parametrize('mapped', [{}, {'joints.d_first.parent': 'slider'}])
def test_joint_on_a_slider_is_measured_from_its_guide(mapped):
    values = {
        'mechanism': 'slider_crank', 'crank.length': 0.1, 'coupler.length': 0.3,
        'frame.angle': 0.2, 'rpm': 60.0, 'dyads.d.from': 'slider', 'dyads.d.to': 'frame',
        'dyads.d.to_at': [0.5, 0.6], 'dyads.d.first.length': 0.4, 'dyads.d.second.length': 0.5,
    }  # fmt: skip
    simulator = Simulator(configure({**values, **mapped}).only)
    links, joints = simulator.solver.structure.links, simulator.robot_joints
    state = simulator.solver.state(1.0, 2.0, 0.0)
    found = np.array(joint_rows(links, state, 1.0, joints)[:2], float)
    assert found[:, 3] == pytest.approx((2.1709563553, -0.4382603036), abs=1e-9)
    own = link_rows(joints, found[:, :, np.newaxis])[:, :, 0]
    assert np.exp(1j * own[0, 3]) == pytest.approx(np.exp(1j * state.position[3]), abs=1e-14)
    assert own[1] == pytest.approx(np.array(state.velocity, float), abs=1e-14)
