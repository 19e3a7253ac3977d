# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Runs a mechanism, a load and a method from docs/examples in every program of the package."""

import csv
import json
import math
import sys
import xml.etree.ElementTree as ET
from importlib import import_module

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from mpmath import mp
from pages import ROOT
from rclpy.serialization import deserialize_message
from ros_harness import assert_refused, finished, stop, wait_for, watched
from sensor_msgs.msg import JointState

from linkage_lab.methods.registry import METHODS
from linkage_ros import (
    Body,
    Coupler,
    LinkLoad,
    MechanismError,
    Solver,
    TracedPoint,
    read_log,
)
from linkage_ros.mechanism.parts import Guide, Slider
from linkage_ros.mechanism.registry import MECHANISMS
from linkage_ros.messages.urdf import make_urdf
from linkage_ros.view.picture import Picture

EXAMPLES = ROOT / 'docs' / 'examples'
GEAR = EXAMPLES / 'cardan_gear.yaml'
SPEED = 4 * math.pi
RUN = EXAMPLES / 'run.py'
IMPORT = f'import sys\nsys.path.insert(0, {str(EXAMPLES)!r})\n'


@pytest.fixture(scope='module')
def cardan_gear():
    """Imports the example, which is registered in the programs under test, but not here."""
    sys.path.insert(0, str(EXAMPLES))
    module = import_module('cardan_gear')
    sys.path.remove(str(EXAMPLES))
    del MECHANISMS['cardan_gear']
    yield module
    del sys.modules['cardan_gear']


@pytest.fixture(scope='module')
def solver(cardan_gear):
    gear = cardan_gear.CardanGear(
        Body(0.1, inertia=0.02),
        Coupler(0.1, mass=0.5, inertia=0.001, center=(0.01, 0.02)),
        Slider(mass=2.0),
        Guide(0.7),
        loads=(LinkLoad('slider', -5.0, 30.0, 400.0, 0.05),),
        points=(TracedPoint('middle', 'coupler', (0.05, 0.0)),),
    )
    return Solver(gear)


def textbook(crank, speed, change, stiffness=400):
    """Computes slider position and driving torque of the example with complex numbers, in mpf."""
    r, delta, gravity = mp.mpf(0.1), mp.mpf(0.7), mp.mpc(0, mp.mpf(-9.81))
    alpha, u, a = mp.mpf(crank), mp.mpf(speed), mp.mpf(change)
    guide, theta = mp.expj(delta), alpha - delta
    arm = r * mp.expj(alpha)
    body = mp.mpc(mp.mpf(0.01), mp.mpf(0.02)) * mp.expj(2 * delta - alpha)
    slope = 1j * arm - 1j * body
    acceleration = (1j * a - u**2) * arm + (-1j * a - u**2) * body
    torque = mp.mpf(0.02) * a + mp.mpf(0.001) * a
    torque += mp.mpf(0.5) * ((acceleration - gravity) * mp.conj(slope)).real
    x, slope = 2 * r * mp.cos(theta), -2 * r * mp.sin(theta)
    push = 2 * (slope * a - x * u**2 - (gravity / guide).real)
    push += 30 * slope * u + 5 + stiffness * (x - mp.mpf(0.05))
    return x, torque + push * slope


def run(*words, cwd, program=RUN):
    done = finished(program, *words, cwd=cwd)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def check_textbook(joints):
    """Allows for the rounding of the crank angle in messages, which includes whole turns."""
    assert list(joints.name) == ['crank', 'coupler', 'slider']
    crank, coupler, slider = joints.position
    ulp, (x, torque) = math.ulp(crank), textbook(crank, SPEED, 0)
    assert abs(slider - x) < 1e-16 + 0.2 * ulp
    assert abs(math.remainder(coupler - (1.4 - 2 * crank), 2 * math.pi)) < 1e-15 + 4 * ulp
    assert joints.velocity[1] == -2 * joints.velocity[0]
    assert abs(joints.effort[0] - torque) < 2e-14 + 60 * ulp


# ---------------------------------------------------------------- exactness


@pytest.mark.parametrize('crank', [0.3, 0.7 + math.pi / 2, 0.7 - math.pi / 2, -2.0, 1e3])
def test_torque_and_position_match_the_textbook_formula(solver, crank):
    with mp.workdps(50):
        state = solver.state(crank, 5.0, 3.0)
        x, torque = textbook(crank, 5.0, 3.0)
        assert abs(state.position[2] / x - 1) < 5e-16
        assert abs(state.torque - torque) < 3e-15
        without = textbook(crank, 5.0, 3.0, stiffness=0)[1]
        assert abs(state.torque - without) > 0.5


def test_accelerations_invert_the_torque_and_energy_holds_spring_and_force(solver):
    crank = np.linspace(-3, 4, 50)
    state = solver.state(crank, 5.0, 3.0)
    assert solver.accelerations(crank, 5.0, state.torque) == pytest.approx(3.0, abs=1e-12)
    step = 1e-5
    later, sooner = (
        sum(solver.energy(solver.state(crank + sign * step * 5.0, 5.0 + sign * step * 3.0)))
        for sign in (1, -1)
    )
    slide = state.velocity[2]
    power = state.torque * 5.0 - 30.0 * slide**2
    assert (later - sooner) / (2 * step) == pytest.approx(power, rel=1e-6, abs=1e-6)


def test_a_gear_that_does_not_mesh_and_unknown_joint_forces_are_refused(cardan_gear, solver):
    with pytest.raises(MechanismError, match=r'must be crank\.length = 0\.1 and 0'):
        cardan_gear.CardanGear(Body(0.1), Coupler(0.2))
    with pytest.raises(MechanismError, match='joint forces of a CardanGear are not supported'):
        solver.reactions(solver.state(1.0))


def test_a_link_with_a_name_of_its_own_is_drawn_and_described(cardan_gear, solver):
    class Pinion(cardan_gear.CardanGear):
        pinion = property(lambda self: self.coupler)

        def loop_structure(self):
            plain = super().loop_structure()
            crank, coupler, slider = plain.links
            return plain._replace(links=(crank, coupler._replace(name='pinion'), slider))

    parts = {name: getattr(solver.mechanism, name) for name in Pinion.__match_args__}
    gear = Pinion(**{**parts, 'points': [TracedPoint('C', 'pinion', (0.05, 0.0))]})
    drawing = Picture(gear)
    ends = {'crank': ('A0', 'A'), 'pinion': ('A', 'B')}
    assert (drawing.ends, drawing.owners) == (ends, {'B': 'slider', 'C': 'pinion'})
    robot = ET.fromstring(make_urdf(gear).encode())
    joints = [joint.get('name') for joint in robot.findall('joint')]
    assert joints == ['crank', 'pinion', 'slider']


# ---------------------------------------------------------------- the programs


@pytest.fixture(scope='module')
def folder(tmp_path_factory):
    """Records a second of the gear."""
    root = tmp_path_factory.mktemp('gear')
    run('record', GEAR, 'run.mcap', '--duration', 1, cwd=root)
    return root


def test_recorded_states_match_the_textbook_formula(folder):
    with (folder / 'run.mcap').open('rb') as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        found = [decoded for *_, decoded in reader.iter_decoded_messages(['/joint_states'])]
    assert len(found) == 200
    for joints in found:
        check_textbook(joints)


def test_the_log_is_verified_and_described(folder):
    verified = run('log', 'verify', 'run.mcap', cwd=folder)
    assert '200 states, every one equal to the bit' in verified
    told = run('log', 'info', 'run.mcap', cwd=folder)
    assert 'cardan_gear, open, crank-slider, stroke 0.4 m' in told
    assert 'loads.spring.stiffness: 400.0  # N/m' in told


def test_the_chart_of_the_motion_has_the_torque_of_the_load(folder):
    run('chart', 'motion', GEAR, cwd=folder)
    assert (folder / 'cardan_gear_motion.png').stat().st_size > 50_000
    with (folder / 'cardan_gear_motion.csv').open() as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) > 700
    for row in rows[::90]:
        exact = textbook(float(row['crank.direction [rad]']), SPEED, 0)[1]
        assert abs(float(row['driving_torque [N m]']) - exact) < 3e-13


def test_real_node_publishes_states_of_the_textbook_formula(folder):
    path = folder / 'live.mcap'
    words = 'node', '--ros-args', '--params-file', GEAR, '-p', f'log:={path}'
    topics = '/joint_states', '/robot_description'
    with watched(topics, *words, program=RUN) as (listener, process):
        listener.await_more(100)
        wait_for(lambda: listener.received['/robot_description'])
        stop(process)
    for data in listener.received['/joint_states']:
        check_textbook(deserialize_message(data, JointState))
    assert 'every one equal to the bit' in run('log', 'verify', path, cwd=folder)


def test_a_kind_of_load_works_on_a_mechanism_of_another_package(tmp_path):
    """The power of the fan on the gear's coupler, which turns like the crank: c |rate|^3."""
    words = '    loads:\n      blower: {kind: fan, link: coupler, coefficient: 0.4}\n'
    powers = []
    for name, text in (('bare', ''), ('fan', words)):
        (tmp_path / f'{name}.yaml').write_text(GEAR.read_text() + text)
        run('record', f'{name}.yaml', f'{name}.mcap', '--duration', 0.2, cwd=tmp_path)
        assert 'every one equal to the bit' in run('log', 'verify', f'{name}.mcap', cwd=tmp_path)
        found = read_log(tmp_path / f'{name}.mcap')['/joint_states']
        powers.append(found['crank.effort'] * found['crank.velocity'])
    rate = abs(120.0 * math.pi / 30)
    assert powers[1] - powers[0] == pytest.approx(0.4 * rate**3)


MEASURE = """
import json
from pathlib import Path
from linkage_lab.charts.accuracy import draw_accuracy
from linkage_lab.charts.stability import draw_stability
from linkage_lab.methods import linkage_cases, measure
from linkage_lab.methods.registry import METHODS
from linkage_lab.methods.situations import SITUATIONS
import inverse_cosine

FILES = [[Path(f'{name}.png')] for name in ('accuracy', 'stability')]
METHODS[1:-1] = []  # of all, the default and the new one
points = measure.measure_accuracy(
    linkage_cases.linkages(quick=True)[::2], METHODS, quick=True
)
draw_accuracy([p for p in points if p['mechanism'] == 'quadrilateral'], 'it', FILES[0])
some = [s for s in SITUATIONS if s.name in ('ordinary', 'no assembly')]
cells = measure.measure_outcomes(some, METHODS, cases=2)
draw_stability(cells, 'it', FILES[1])
print(json.dumps([points, cells]))
"""


def test_the_charts_find_the_method_and_measure_its_speed_and_errors(folder):
    assert not [method for method in METHODS if method.name == 'inverse cosine']
    points, cells = json.loads(run(cwd=folder, program=IMPORT + MEASURE))
    for picture in ('accuracy.png', 'stability.png'):
        assert (folder / picture).stat().st_size > 50_000
    default, cosines = (
        {
            (p['mechanism'], p['mode']): p
            for p in points
            if (p['method'], p['quantity']) == (name, 'position')
        }
        for name in ('factored closed form', 'inverse cosine')
    )
    assert len(cosines) == 4
    for place, point in cosines.items():
        if place[0] == 'near a change point':
            assert default[place]['max_error'] < 1e-15
            assert 1e-6 < point['max_error'] < 1e-3
        else:
            assert point['max_error'] < 2e-15
            assert point['us_per_state'] > 0
    own = [cell for cell in cells if cell['method'] == 'inverse cosine']
    assert {c['situation']: c['outcome'] for c in own} == {
        'ordinary': 'right',
        'no assembly': 'NaN',
    }


# ---------------------------------------------------------------- the limits


def test_without_the_import_the_name_is_refused_in_one_line(folder):
    done = finished('record', GEAR, 'no.mcap', cwd=folder)
    words = "mechanism = 'cardan_gear': must be one of four_bar, slider_crank, .*, wind_pump"
    assert_refused(done.returncode, done.stdout, done.stderr, words)
    assert not (folder / 'no.mcap').exists()
