# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Each kind of drive with each kind of mechanism: motion, measurements, torque, trajectories."""

import math
from pathlib import Path

import numpy as np
import pytest
from joint_codec import JointStateCodec
from one_linkage import inputs_of
from ros_harness import report_of, verified

from linkage_ros import ConfigurationError, Solver, read_log
from linkage_ros.log.reader import LogReader
from linkage_ros.messages.templates import crank_trajectory
from linkage_ros.messages.topics import CRANK_TRAJECTORY, JOINT_COMMANDS
from linkage_ros.programs.log_commands import info
from linkage_ros.programs.record import record, record_measured
from linkage_ros.quantities import flatten
from linkage_ros.run.states import Simulator
from linkage_ros.settings.configuration import configure, load
from linkage_ros.settings.summary import summary
from linkage_ros.units import NS_PER_MS, NS_PER_S

RAM = str(Path(__file__).parent / 'data' / 'ram.yaml')  # a press that is driven by its ram
NAMES = 'quadrilateral', 'slider_crank', 'shaper', 'excavator', RAM
every = pytest.mark.parametrize('name', NAMES)


def driven(name, drive, **values):
    """Returns a configuration of a preset's mechanism with another drive."""
    given = load(name).parameters()
    own = {x: given[x] for x in flatten(load(name).mechanism) if x in given}
    changed = {key.replace('__', '.'): value for key, value in values.items()}
    return configure({'mechanism': given['mechanism'], **own, 'drive': drive, **changed})


def middle(name):
    """Returns the middle of the reach of the driven joint, and a fifth of its width."""
    (low, high), *_ = Solver(load(name).mechanism).reach.arcs
    return 0.5 * (low + high) + 0.3 * (high - low), 0.15 * (high - low)


def swinging(name, **values):
    """Returns a configuration in which the driven joint swings within its reach."""
    center, amplitude = middle(name)
    return driven(
        name, 'motion', motion__center=center, motion__amplitude=amplitude,
        motion__frequency=0.7, **values,
    )  # fmt: skip


def joint_of(name):
    return load(name).mechanism.structure().driven_link


def states(path):
    """Returns the columns of the joints in a log."""
    return read_log(str(path))['/joint_states']


@every
def test_a_law_moves_the_driven_joint_and_verifies(name, tmp_path):
    config, joint = swinging(name), joint_of(name)
    record(config, tmp_path / 'run.mcap', duration=1.5)
    assert verified(tmp_path / 'run.mcap').states == 300
    found, (center, amplitude) = states(tmp_path / 'run.mcap'), middle(name)
    due = center + amplitude * np.sin(2 * math.pi * 0.7 * found['t'])
    np.testing.assert_allclose(found[f'{joint.name}.position'], due, rtol=1e-12)
    solver = Solver(config.mechanism)
    q, u = (found[f'{joint.name}.{x}'] for x in ('position', 'velocity'))
    a = -((2 * math.pi * 0.7) ** 2) * (q - center)
    due = solver.state(q, u, a).torque
    size = np.abs(due).max()
    np.testing.assert_allclose(found[f'{joint.name}.effort'], due, atol=1e-9 * size)
    unit = 'm' if joint.slides else 'deg'
    assert f'{unit} with amplitude' in summary(config.only, solver)


@every
@pytest.mark.parametrize('mapped', [{}, {'zero': 0.2, 'ratio': -3.0, 'name': 'motor'}])
def test_measurements_of_a_motion_give_its_states(name, mapped, tmp_path):
    """The answers repeat the measured position to the bit, and verify."""
    joint = joint_of(name)
    joints = {f'joints__{joint.name}__{key}': value for key, value in mapped.items()}
    record(swinging(name, **joints), tmp_path / 'robot.mcap', duration=1.0)
    follow = driven(name, 'follow', **joints, effort_command_topic='/torque', lead_time=0.01)
    answers = record_measured(
        follow, tmp_path / 'out.mcap', tmp_path / 'robot.mcap', topic='/joint_states'
    )
    assert answers.states == 200
    assert verified(tmp_path / 'out.mcap').states == 200
    robot, found = states(tmp_path / 'robot.mcap'), states(tmp_path / 'out.mcap')
    own = mapped.get('name', joint.name)
    np.testing.assert_array_equal(found[f'{own}.position'], robot[f'{own}.position'])
    for column in robot:
        if column.endswith('.position'):
            apart = np.abs(np.sin(0.5 * (found[column] - robot[column])))
            assert apart.max() < 1e-12
    late = slice(60, None)  # once the filter has settled
    effort = robot[f'{own}.effort'][late]
    error = np.abs(found[f'{own}.effort'][late] - effort).max()
    assert error < 0.2 * np.abs(effort).max()


@every
def test_a_measurement_out_of_reach_is_rejected(name):
    joint, simulator = joint_of(name), Simulator(driven(name, 'follow').only)
    (crank,) = inputs_of(simulator).values()
    codec = JointStateCodec((joint.name,), 'base_link')
    reach = simulator.solver.reach
    inside = middle(name)[0]
    _, found = crank.read(codec.encode(NS_PER_S, [inside, 0.0, 0.0]), 0)
    assert found.q == (inside,)
    if reach.turns_fully:
        return
    with pytest.raises(ValueError, match=r'out of reach: .* it reaches 0\.'):
        crank.read(codec.encode(2 * NS_PER_S, [1.78, 0.0, 0.0]), 0)


@pytest.mark.parametrize('name', [x for x in NAMES if x != 'slider_crank'])  # its crank is light
def test_a_torque_driven_run_verifies(name, tmp_path):
    joint, mechanism = joint_of(name), load(name).mechanism
    crank = Solver(mechanism).state(middle(name)[0]).position[0]
    config = driven(name, 'torque', crank_angle=crank, motor__torque=7.0)
    path = tmp_path / 'run.mcap'
    record(config, path, duration=1.0)
    assert verified(path).states == 200
    np.testing.assert_allclose(states(path)[f'{joint.name}.effort'], 7.0, rtol=1e-9)
    unit = 'N' if joint.slides else 'N m'
    assert any(line.endswith(f'motor torque 7 {unit}') for line in info(LogReader(path)))
    (commands,) = (x for t, x in inputs_of(Simulator(config.only)).items() if t == JOINT_COMMANDS)
    assert commands.commanded([joint.name], [3.5]) == 3.5
    assert f'command, {unit}' in commands.diagnostics()


@every
def test_a_trajectory_moves_the_driven_joint(name):
    simulator, (center, amplitude) = Simulator(swinging(name).only), middle(name)
    reader = inputs_of(simulator)[CRANK_TRAJECTORY]
    begin = simulator.begin(0)
    reader.prepare(begin, 100 * NS_PER_MS)

    def to(goal):
        points = [(600 * NS_PER_MS, ([goal], [0.0], [0.0], [0.0]))]
        return reader.read(crank_trajectory([simulator.crank_joint], 'base_link', points), 0)

    motion, goal = to(center - amplitude), center - amplitude
    at = motion.at(700 * NS_PER_MS)
    assert at.q[0] == pytest.approx(goal, abs=1e-12)
    assert at.u == (0.0,)
    start, left = motion.at(100 * NS_PER_MS), begin.at(100 * NS_PER_MS)
    assert start.q == left.q
    assert start.u == left.u
    if not simulator.solver.reach.turns_fully:
        with pytest.raises(ValueError, match=r'cannot move at 1.9 m: .* it reaches 0\.'):
            to(1.9)


def test_points_of_a_cylinder_are_in_meters(tmp_path):
    """A file in mm gives the same law as the lists; angles and speeds in rpm are refused."""
    law = {'times': [0.0, 2.0, 3.0], 'positions': [0.8, 1.25, 0.8]}
    lists = driven('excavator', 'motion', **{f'motion__{k}': v for k, v in law.items()})
    (tmp_path / 'law.csv').write_text('time,position_mm\n0,800\n2,1250\n3,800\n')
    file = driven('excavator', 'motion', motion__file=str(tmp_path / 'law.csv'))
    assert file.drive.law(joint_of('excavator')) == lists.drive.law(joint_of('excavator'))
    assert configure(lists.parameters()) == lists
    for values, words in (
        ({'motion__times': [0.0, 1.0], 'motion__angles': [0.8, 0.9]}, 'must be motion.positions'),
        ({'motion__times': [0.0, 1.0], 'motion__positions': [0.8, 1.9]}, 'reaches 0.63 to 1.77 m'),
        ({'motion__times': [0.0, 1.0], 'motion__positions': [0.8, 0.9], 'motion__repeat': True},
         'ends .* m after its start'),
    ):  # fmt: skip
        with pytest.raises(ConfigurationError, match=words):
            driven('excavator', 'motion', **values)
    with pytest.raises(ConfigurationError, match=r'must be motion\.angles, because the crank'):
        driven('shaper', 'motion', motion__times=[0.0, 1.0], motion__positions=[0.2, 0.3])


@pytest.mark.parametrize(
    ('values', 'words'),
    [
        ({'drive': 'speed', 'rpm': 5.0}, "drive = 'speed': .* the cylinder is driven, .* no rpm"),
        ({'drive': 'torque', 'crank_angle': -1.0}, 'in open, the crank is at -0.32 rad'),
        ({'drive': 'torque', 'crank_angle': -0.66}, 'crank_angle'),
        ({'drive': 'torque', 'crank_angle': 0.2, 'joints.rod.name': ''}, 'joints.rod.name'),
        ({'drive': 'follow', 'crank_joint': 'barrel'}, 'crank_joint'),
    ],
)  # fmt: skip
def test_values_that_a_driven_cylinder_cannot_have_are_refused(values, words):
    drive = values.pop('drive')
    with pytest.raises(ConfigurationError, match=words):
        _ = driven('excavator', drive, **values).robot_joints


def test_a_driven_cylinder_makes_no_revolutions(tmp_path):
    with pytest.raises(ConfigurationError, match='makes no revolutions: give a --duration'):
        record(load('excavator'), tmp_path / 'run.mcap', revolutions=3)


def test_a_changed_force_is_found(tmp_path, monkeypatch):
    """Negative control: verification compares the force of the cylinder."""
    part = Simulator.part

    def wrong(simulator, *given):
        found = part(simulator, *given)
        numbers = [*found.numbers]
        place = 3 * len(simulator.joints) + simulator.driven
        numbers[place] = 1.0001 * numbers[place]
        return found._replace(numbers=numbers)

    with monkeypatch.context() as patched:
        patched.setattr(Simulator, 'part', wrong)
        record(load('excavator'), tmp_path / 'run.mcap', duration=0.2)
    assert 'rod' in report_of(tmp_path / 'run.mcap').difference
