# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Sweeps: designs equal machines of their own parameter files, and no results are lost."""

import collections
import csv
import io
import json
import math
import os
import subprocess
import sys
import textwrap
import time
from concurrent.futures import BrokenExecutor, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from importlib.metadata import PackageNotFoundError
from pathlib import Path

import mortal
import numpy as np
import pytest
import yaml
from mechanisms import traced
from one_linkage import by_lengths
from pages import page_files, read
from scipy.integrate import quad
from test_law_chart import LIMITED

from linkage_lab import command_line
from linkage_lab.charts import sweep as command
from linkage_lab.charts.motion import _measures
from linkage_lab.charts.sweep import FRONT
from linkage_lab.period import law_samples, mean, speed_driven_period
from linkage_lab.sampling import peaks, samples
from linkage_lab.sweep import spread as command_spread
from linkage_lab.sweep.designs import CANNOT_TURN, TURNS, measured, with_values
from linkage_lab.sweep.measures import MEASURES, Task
from linkage_lab.sweep.spread import cluster, processes, spread
from linkage_lab.sweep.study import Settings, _designs, _prescribed_motion, parameters
from linkage_ros import Body, Frame, InvertedSliderCrank, LoadCurve
from linkage_ros.errors import ConfigurationError, MechanismError, UnreachableError
from linkage_ros.mechanism.solver import Solver
from linkage_ros.mechanism.travel import travel
from linkage_ros.motion.drives.law import LawDrive, Prescribed
from linkage_ros.quantities import Leaf, Quantity, build, flatten
from linkage_ros.settings.configuration import load
from linkage_ros.units import radians_per_second

RPM = 150.0
SPEED = radians_per_second(RPM)


def peak(x, curve):
    """Returns the largest magnitude of a function of places."""
    found, _ = peaks(x, np.abs(curve(x))[None], lambda places: np.abs(curve(places))[None])
    return found[0]


def efforts(solver, x, motion):
    """Returns peak and root mean square of the torque, and the peak shaking force."""

    def torque(places):
        return solver.state(*motion(places)).torque

    def force(places):
        return np.hypot(*solver.reactions(solver.state(*motion(places))).shaking_force)

    return [peak(x, torque), math.sqrt(mean(x, torque(x) ** 2)), peak(x, force)]


def changed(mechanism, names, row):
    """Creates a mechanism with other values, as from a parameter file."""
    given = dict(zip(names, map(float, row), strict=True))
    return build(type(mechanism), with_values(flatten(mechanism), given))


# A load that acts only in the second of two turns.
TWO_TURNS = [0.0, *(math.tau + x for x in (0.0, 1.0, 2.0, math.tau))]
FOUR_STROKE = {
    'kind': 'curve', 'link': 'crank', 'at': TWO_TURNS, 'value': [0.0, 0.0, 900.0, 0.0, 0.0],
}  # fmt: skip
ALL_LOADS = {
    'slider_crank': {
        'cycle': FOUR_STROKE,
        'indicator': {'kind': 'curve', 'link': 'slider', 'over': 'crank_angle_from_tdc',
                      'at': [0.0, 1.0, 4.0], 'value': [5.0, -9.0, 7.0]},
        'gas': {'kind': 'gas', 'link': 'slider', 'bore': 0.06, 'clearance': 0.05, 'inlet': 1e5,
                'outlet': 3e5},
        'rubber': {'kind': 'link', 'link': 'slider', 'damping': 3.0, 'stiffness': 9.0},
    },
    'quadrilateral': {
        'spring': {'kind': 'spring', 'link': 'rocker', 'at': [0.1, 0.02], 'to': 'frame',
                   'to_at': [0.3, 0.3], 'stiffness': 80.0, 'free_length': 0.1, 'damping': 2.0},
        'push': {'kind': 'force', 'link': 'coupler', 'at': [0.1, 0.0], 'force': [3.0, -5.0]},
        'oil': {'kind': 'pins', 'damping': 0.02},
        'stop': {'kind': 'link', 'link': 'rocker', 'stiffness': 5.0, 'rest': 1.0},
        'cam': {'kind': 'curve', 'link': 'rocker', 'over': 'position',
                'at': [-9.0, 0.5, 0.9, 9.0], 'value': [9.0, 9.0, -4.0, -4.0]},
    },
    'coupler_point': {},
    'shaper': {},
    'watt': {'cycle': FOUR_STROKE},
}  # fmt: skip
OWN_MEASURES = ('peak_torque', 'rms_torque', 'shaking_force', 'swing', 'stroke', 'time_ratio',
                'transmission_angle')  # fmt: skip


def own_file(base, names, row, path):
    """Loads a parameter file with other values."""
    given = dict(zip(names, map(float, row), strict=True))
    rpm = given.pop('rpm')
    known, own = base.parameters(), flatten(base.mechanism)
    values = with_values({x: known[x] for x in known if x in own}, given)
    values = {x: list(y) if isinstance(y, tuple) else y for x, y in values.items()}
    values |= {'mechanism': base.kind.mechanism, 'drive': 'speed', 'rpm': rpm}
    path.write_text(yaml.safe_dump({'/**': {'ros__parameters': values}}))
    return load(str(path))


@pytest.mark.parametrize('sign', [1.0, -1.0])
@pytest.mark.parametrize('preset', ALL_LOADS)
def test_designs_equal_machines_of_their_own_parameter_files(preset, sign, tmp_path):
    """Every parameter varies, and every measure is that of a chart with as many samples."""
    base = by_lengths(load(preset)).only
    loads = {f'loads.{x}.{y}': v for x, of in ALL_LOADS[preset].items() for y, v in of.items()}
    bare = {k: v for k, v in flatten(base.mechanism).items() if not k.startswith('loads.')}
    base = replace(base, mechanism=build(type(base.mechanism), bare | loads))
    leaves = [*parameters(base.mechanism, sign * RPM)]
    names = tuple(leaf.name for leaf in leaves)
    values = np.array([leaf.default for leaf in leaves])
    shares = np.random.default_rng(7).uniform(-0.02, 0.02, (16, len(names)))
    lows, highs = np.transpose([(leaf.quantity.low, leaf.quantity.high) for leaf in leaves])
    table = np.clip(values + shares * np.where(values, values, 0.1), lows, highs)
    measures = tuple(
        x for x in OWN_MEASURES if MEASURES[x].applies(Task(base.mechanism, RPM, (), (), 720))
    )
    found = measured(Task(base.mechanism, sign * RPM, names, measures, 720), table)
    compared = 0
    for row, (outcome, *values) in zip(table, found, strict=True):
        try:
            machine = own_file(base, names, row, tmp_path / 'own.yaml')
        except MechanismError:
            assert outcome == CANNOT_TURN
            continue
        assert outcome == TURNS
        solver, speed = Solver(machine.mechanism), machine.drive.rpm * math.pi / 30
        assert np.sign(speed) == sign
        crank = samples(solver, speed, 720)
        torque, rms, force = efforts(solver, crank, lambda x, speed=speed: (x, speed))
        moved = travel(solver)
        span = np.ptp(moved.extremes)
        angles = moved.transmission or (math.nan, math.nan)
        expected = {
            'peak_torque': torque, 'rms_torque': rms, 'shaking_force': force,
            'swing': math.degrees(span), 'stroke': span,
            'time_ratio': moved.time_ratio or math.nan,
            'transmission_angle': math.degrees(min(angles[0], math.pi - angles[1])),
        }  # fmt: skip
        assert dict(zip(measures, values, strict=True)) == pytest.approx(
            {name: expected[name] for name in measures}, rel=1e-12, nan_ok=True
        )
        compared += len(measures)
    assert compared > 40


@pytest.mark.parametrize(
    ('preset', 'angles'), [('coupler_point', 24), *((x, 360) for x in ('watt', 'shaper'))]
)
def test_distance_from_a_path_is_that_of_many_samples_and_0_on_it(preset, angles):
    mechanism = traced(load(preset).mechanism)
    solver = Solver(mechanism)
    names, row, beside = ('crank.length',), np.array([[mechanism.crank.length]]), 0.02 + 0.03j
    for point in mechanism.points:
        x, y = solver.point(solver.state(np.linspace(0, math.tau, 100_001)), point.name).position
        for crank in np.random.default_rng(2).uniform(0, math.tau, 2).tolist():
            on_path = complex(*solver.point(solver.state(crank), point.name).position)
            for place, close in ((on_path, 1e-14), (on_path + beside, 1e-7)):
                task = Task(
                    mechanism, None, names, ('point_distance',), angles, (place,), None, point.name
                )
                ((_, distance),) = measured(task, row)
                expected = np.abs(x + 1j * y - place).min() if place != on_path else 0.0
                assert distance == pytest.approx(expected, abs=close), point


def test_designs_with_change_points_have_the_torques_and_forces_of_their_charts():
    """The designs have several structures; the motion of one repeats only after two turns."""
    mechanism = load('quadrilateral').mechanism
    names = ('crank.length', 'coupler.length', 'rocker.length', 'frame.length')
    table = np.array([[0.1, 0.2, 0.3, 0.4], [0.1, 0.3, 0.1, 0.3], [0.1, 0.3, 0.25, 0.3]])
    found = measured(Task(mechanism, RPM, names, ('peak_torque', 'shaking_force'), 720), table)
    for row, (state, *values) in zip(table, found, strict=True):
        assert state == TURNS
        right = _measures(
            speed_driven_period(changed(mechanism, names, row), SPEED, reactions=True)
        )
        expected = right['peak torque [N m]'], right['peak shaking force [N]']
        assert values == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(
    ('sampler', 'count'), [('sobol', 100), ('latin_hypercube', 100), ('grid', 81)]
)
def test_samplers_fill_the_ranges(sampler, count):
    spans = Quantity('number', '', 'm', 1.0, 2.0), Quantity('number', '', 'm', -1.0, 1.0)
    columns = [Leaf('', span, 0.0) for span in spans]
    settings = partial(Settings, 'quadrilateral', 100 if count == 100 else 99, sampler)
    table = _designs(settings(7), columns)
    assert len(table) == count
    assert table.min(0) == pytest.approx([1, -1], abs=0.05)
    assert table.max(0) == pytest.approx([2, 1], abs=0.05)
    assert np.array_equal(table, _designs(settings(7), columns))
    assert np.array_equal(table, _designs(settings(8), columns)) == (sampler == 'grid')


STUDY = """
base: quadrilateral
designs: 200
seed: 3
angles: 24
ranges:
  crank.length: [0.05, 0.2]
  coupler: {length: [0.2, 0.4]}
tolerances: {rpm: 15.0}
measures: [time_ratio]
constraints: {transmission_angle: [20.0, .inf]}
goals: {peak_torque: least, swing: most}
"""


LAWS = {
    'arc at a set speed': None,
    'sine': Prescribed(center=1.2, amplitude=0.7, frequency=1.0),
    'repeating spline': Prescribed(times=(0.0, 0.4, 1.0), angles=(0.5, 2.0, 0.5), repeat=True),
    'spline': Prescribed(times=(0.0, 0.4, 1.0), angles=(0.5, 2.0, 1.0)),
}


@pytest.mark.parametrize('name', LAWS)
def test_rms_within_an_arc_is_the_integral_over_time(name):
    """Both ends of the motion are samples, of which each stands for half an interval."""
    mechanism, motion = load('quadrilateral').mechanism, LAWS[name]
    solver, joint = Solver(mechanism), mechanism.structure().driven_link

    def square(time):
        if motion is None:
            return solver.state(0.5 + 1.5 * time, radians_per_second(RPM), 0.0).torque ** 2
        _, *moved = motion.law.at(round(1e9 * time))
        return solver.state(*moved).torque ** 2

    # The corner of the splines is at 0.4 s.
    parts = [quad(square, *ends, epsabs=0, epsrel=1e-8)[0] for ends in ((0, 0.4), (0.4, 1))]
    exact = math.sqrt(sum(parts))
    # The reference takes whole nanoseconds.
    for angles, error in ((12, 0.02), (96, 2e-8), (960, 1e-9)):
        settings = Settings('quadrilateral', angles=angles, swing=None if motion else (0.5, 2.0))
        way = _prescribed_motion(settings, LawDrive(motion) if motion else None, joint)
        names = ('crank.mass',)
        task = Task(mechanism, None if motion else RPM, names, ('rms_torque',), angles, (), way)
        ((_, found),) = measured(task, np.array([[mechanism.crank.mass]]))
        assert found == pytest.approx(exact, rel=error)


def along(solver, way, speed, angles):
    """Returns samples of a motion within an arc, and the motion as a function of them."""
    if way.law is None:
        return np.linspace(way.low, way.high, angles), lambda x: (x, speed)
    time, motion = law_samples(solver, way.law, angles - 1)
    return time, lambda x: motion(x)[:3]


def swung(solver, low, high):
    """Returns the swing of the output within an arc, deg, from many samples."""
    crank = np.linspace(low, high, 100001)
    output = solver.structure.output_index
    return math.degrees(np.ptp(np.unwrap(solver.state(crank).position[output])))


@pytest.mark.parametrize('law', [True, False])
def test_measures_within_an_arc_match_the_solver(law):
    mechanism = load('quadrilateral').mechanism
    names = 'crank.length', 'coupler.length', 'rocker.length', 'frame.length', 'coupler.mass'
    base = [flatten(mechanism)[name] for name in names]
    table = np.random.default_rng(4).uniform(0.5, 1.6, (60, len(names))) * base
    settings = {'times': (0.0, 0.4, 1.0), 'angles': (0.5, 2.0, 1.0)}
    drive = LawDrive(Prescribed(**settings))
    chosen = Settings('quadrilateral', angles=48, **({} if law else {'swing': (0.5, 2.0)}))
    joint = mechanism.structure().driven_link
    way, rpm = _prescribed_motion(chosen, drive, joint), None if law else RPM
    measures = 'peak_torque', 'rms_torque', 'shaking_force', 'swing', 'transmission_angle'
    found = measured(Task(mechanism, rpm, names, measures, 48, (), way), table)
    counts = [0, 0]
    for row, (fits, *values) in zip(table, found, strict=True):
        try:
            solver = Solver(changed(mechanism, names, row))
            for angle in (way.low, way.high, *np.linspace(way.low, way.high, 500)):
                solver.state(float(angle))
        except (MechanismError, UnreachableError):
            assert (fits, *np.isnan(values)) == (0, *[True] * len(values))
            counts[0] += 1
            continue
        assert fits == 1
        counts[1] += not solver.reach.turns_fully
        crank = np.linspace(way.low, way.high, 100001)
        _, coupler, rocker = solver.state(crank).position
        acute = np.degrees(np.arcsin(np.abs(np.sin(rocker - coupler)).min()))
        expected = efforts(solver, *along(solver, way, radians_per_second(RPM), 48))
        expected += [swung(solver, way.low, way.high), acute]
        for value, right, digits in zip(
            values, expected, (1e-12, 1e-12, 1e-12, 1e-8, 1e-8), strict=True
        ):
            assert value == pytest.approx(right, rel=digits)
    assert min(counts) > 3


def test_measures_of_a_driven_cylinder_match_the_solver():
    design = load('excavator')
    mechanism, drive = design.mechanism, design.drive
    way = _prescribed_motion(
        Settings('excavator', angles=48), drive, mechanism.structure().driven_link
    )
    names = 'frame.length', 'barrel.mass'
    table = np.random.default_rng(5).uniform((0.3, 10.0), (0.62, 40.0), (40, 2))
    measures = 'peak_force', 'rms_force', 'shaking_force', 'swing'
    found = measured(Task(mechanism, None, names, measures, 48, (), way), table)
    solved = 0
    for row, (fits, *values) in zip(table, found, strict=True):
        solver = Solver(changed(mechanism, names, row))
        ((low, high),) = solver.reach.arcs
        assert fits == (low < way.low and way.high < high)
        if not fits:
            continue
        solved += 1
        expected = efforts(solver, *along(solver, way, 0.0, 48))
        assert values[:3] == pytest.approx(expected, rel=1e-12)
        assert values[3] == pytest.approx(swung(solver, way.low, way.high), rel=1e-8)
    assert 5 < solved < 35
    for name in ('peak_torque', 'stroke'):
        assert not MEASURES[name].applies(Task(mechanism, None, names, (name,), 48, (), way))


CYLINDER = """
base: excavator
swing: [0.82, 1.4]
angles: 48
designs: 8
speed: 0.2
ranges: {speed: [0.1, 0.6]}
measures: [rms_force, peak_force]
"""


def test_a_cylinder_moves_at_its_own_speed(run):
    """Its speed is in m/s; a speed in rpm would be taken for another one."""
    code, words, _ = run(CYLINDER)
    assert code == 0
    rows = np.genfromtxt('study.csv', delimiter=',', names=True, dtype=None, encoding='utf8')
    solver, positions = Solver(load('excavator').mechanism), np.linspace(0.82, 1.4, 48)
    for _, speed, rms, highest, outcome in rows:
        force = solver.state(positions, speed, 0.0).torque
        square, _ = quad(
            lambda x, speed=speed: solver.state(x, speed, 0.0).torque ** 2, 0.82, 1.4, epsrel=1e-12
        )
        assert outcome == 'valid'
        assert rms == pytest.approx(math.sqrt(square / 0.58), 1e-8)
        assert highest == pytest.approx(np.abs(force).max(), 1e-12)  # it is at an end
    assert np.ptp(rows['peak_force_N']) > 100
    force = solver.state(positions, 0.2, 0.0).torque
    assert f'base {np.abs(force).max():.5g},' in words


@pytest.mark.parametrize(
    ('old', 'new', 'words'),
    [
        ('speed: 0.2', 'rpm: 60.0', 'rpm = 60.0: the cylinder is driven, which has no rpm'),
        ('{speed: [0.1, 0.6]}', '{rpm: [1.0, 60.0]}', "'rpm' is not a parameter"),
        (
            'speed: 0.2\nranges: {speed: [0.1, 0.6]}',
            'ranges: {rod.mass: [16.0, 17.0]}',
            'speed: 0.1',
        ),
        ('swing: [0.82, 1.4]\n', '', 'the cylinder is driven: give swing'),
        ('excavator', 'quadrilateral', 'speed = 0.2: the crank is driven; give rpm'),
    ],
)
def test_a_speed_of_another_joint_gives_one_line(run, old, new, words):
    code, _, errors = run(CYLINDER.replace(old, new))
    assert (code, errors.count('\n')) == (2, 1)
    assert words in errors


@pytest.mark.parametrize(
    'loads', [(), (LoadCurve('crank', at=TWO_TURNS, value=FOUR_STROKE['value']),)]
)
def test_an_output_that_turns_fully_along_a_law_has_no_swing(loads):
    """The barrel turns with a crank that is longer than the frame."""
    mechanism = InvertedSliderCrank(Frame(0.1), Body(0.3, 1.0), loads=loads)
    points = {'times': (0.0, 1.0), 'angles': (0.0, math.tau), 'repeat': True}
    joint = mechanism.structure().driven_link
    way = _prescribed_motion(Settings('shaper', angles=90), LawDrive(Prescribed(**points)), joint)
    names, measures = ('crank.mass',), ('swing', 'peak_torque')
    for motion in (way, None):
        task = Task(mechanism, 60.0, names, measures, 90, (), motion)
        ((outcome, swing, torque),) = measured(task, np.array([[1.0]]))
        assert outcome == TURNS
        assert math.isnan(swing)
        assert (torque > 400) == bool(loads)


def test_a_study_varies_the_numbers_of_a_drawing(run):
    text = page_files(read('docs/drawings.md'))['press.yaml']
    Path('press.yaml').write_text(text)
    study = """
        base: press.yaml
        designs: 3
        ranges: {drawing.pins.Q.0: [130.0, 140.0]}
        tolerances: {drawing.links.coupler.mass: 0.1, drawing.links.rocker.length: 0.5}
        measures: [stroke]
        """
    assert run(textwrap.dedent(study))[0] == 0
    with Path('study.csv').open(newline='') as stream:
        names, *rows = csv.reader(stream)
    pin, length, stroke = (
        next(i for i, x in enumerate(names) if word in x) for word in ('Q.0', 'length', 'stroke')
    )
    for row in rows:
        assert 'Q: [140.0,' in text
        assert 'rocker: {pins: [Q, B]' in text
        one = text.replace('Q: [140.0,', f'Q: [{float(row[pin])!r},')
        rocker = f'rocker: {{length: {float(row[length])!r}, pins: [Q, B]'
        Path('one.yaml').write_text(one.replace('rocker: {pins: [Q, B]', rocker))
        low, high = travel(Solver(load('one.yaml').mechanism)).extremes
        assert float(row[stroke]) == pytest.approx(abs(high - low), rel=1e-9)


def test_a_study_of_a_limited_crank_has_a_swing(run):
    text = LIMITED.format(drive='follow', rest='')
    Path('servo.yaml').write_text(text)
    study = """
        base: servo.yaml
        designs: 40
        ranges: {crank.length: [0.05, 0.6]}
        measures: [swing]
        """
    study = textwrap.dedent(study)
    assert 'cannot turn' in run(study)[1]
    code, out, _ = run(f'{study}swing: [0.2, 2.0]\n')
    assert code == 0
    assert 'cannot move so far' in out
    for line, words in (
        ('swing: [2.0, 0.2]', 'give the smaller angle first'),
        ('swing: [0.2, 2.0]\ngoals: {peak_torque: least, swing: most}', 'needs a crank speed'),
        ('swing: [0.2, 2.0]\ngoals: {time_ratio: least, swing: most}', 'needs a crank that turns'),
    ):
        code, _, errors = run(f'{study}{line}\n')
        assert (code, errors.count('\n')) == (2, 1)
        assert words in errors


@pytest.fixture
def run(called, tmp_path, monkeypatch):
    """Runs a study with options; returns exit code, stdout and stderr.

    Without options, a thread takes the place of the processes, which cost 1 s each.
    """
    monkeypatch.setattr(command, '_BLOCK', 64)
    monkeypatch.chdir(tmp_path)

    def run(text=STUDY, *options):
        Path('study.yaml').write_text(text)
        with monkeypatch.context() as patch:
            if not options:
                patch.setattr(command, 'processes', lambda _: ThreadPoolExecutor(1))
            return called(command_line, 'sweep', 'study.yaml', '--overwrite', *options)

    return run


@contextmanager
def dask(folder):
    """Starts a scheduler and two workers as processes; returns the address and the workers."""
    file, path = folder / 'scheduler.json', Path(sys.executable).parent / 'dask'
    variables = os.environ | {'PYTHONPATH': str(Path(__file__).parent)}
    begin = partial(
        subprocess.Popen, env=variables, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    at = '--host', '127.0.0.1', '--no-dashboard', '--scheduler-file', file
    own = '--nthreads', '1', '--no-nanny', '--local-directory', folder
    scheduler = begin([path, 'scheduler', '--port', '0', *at])
    workers = [begin([path, 'worker', *at, *own]) for _ in range(2)]
    try:
        deadline = time.monotonic() + 300  # reached only by a hang
        while not (file.exists() and file.read_text()) and time.monotonic() < deadline:
            time.sleep(0.05)
        yield json.loads(file.read_text())['address']
    finally:
        for process in (*workers, scheduler):
            process.kill()
            process.wait()


def test_processes_and_a_cluster_give_the_same_bytes_and_lose_nothing(run, tmp_path):
    code, words, errors = run(STUDY, '--workers', '2')
    assert (code, errors) == (0, '')
    table = Path('study.csv').read_bytes()
    with dask(tmp_path) as address:
        assert run(STUDY, '--scheduler', address)[0] == 0
        assert Path('study.csv').read_bytes() == table
        check_that_a_death_loses_nothing(partial(cluster, address), tmp_path / 'worker')
        with pytest.raises(ConfigurationError, match='linkage_lab'), cluster(address):
            raise PackageNotFoundError('linkage_lab')
        with pytest.raises(BrokenExecutor), cluster(address):
            raise TypeError('cannot unpack non-iterable int object')
        with pytest.raises(TypeError, match='of the work'), cluster(address):
            raise TypeError('of the work')
    check_words(words, table)


def check_that_a_death_loses_nothing(connect, path):
    """Kills a worker during the fourth of ten blocks, and sends SIGINT during the others."""
    blocks = [(i, str(path) if i == 3 else '') for i in range(10)]
    assert dict(spread(mortal.die_once, blocks, connect)) == {i: i * i for i in range(10)}
    assert path.exists()


def check_words(words, table):
    """Asserts that output and table agree, and that no design on the front beats another."""
    rows = np.genfromtxt(io.BytesIO(table), delimiter=',', names=True, dtype=None, encoding='utf8')
    counts = collections.Counter(rows['outcome'])
    assert set(counts) == {'cannot turn', 'outside the constraints', 'valid', FRONT}
    for outcome, count in counts.items():
        assert outcome == 'valid' or f'{count} {outcome}' in words
    good = rows[np.isin(rows['outcome'], ('valid', FRONT))]
    assert (good['transmission_angle_deg'] >= 20).all()
    assert np.isnan(rows['peak_torque_N_m'][rows['outcome'] == 'cannot turn']).all()
    beaten = [
        ((good['peak_torque_N_m'] < x) & (good['swing_deg'] > y)).any()
        for x, y in zip(good['peak_torque_N_m'], good['swing_deg'], strict=True)
    ]
    assert np.array_equal(~np.array(beaten), good['outcome'] == FRONT)
    assert Path('study.png').read_bytes().startswith(b'\x89PNG')


DYAD = """
/**:
  ros__parameters:
    mechanism: four_bar
    rpm: 60.0
    frame: {length: 0.4}
    crank: {length: 0.1}
    coupler: {length: 0.3}
    rocker: {length: 0.3}
    dyads:
      ram: {from: rocker, from_at: [0.15, 0.0], first: {length: 0.3}, slider: {mass: 1.0}}
    loads:
      pull: {kind: link, link: ram_slider, force: -5.0}
      spring: {kind: link, link: rocker, stiffness: 5.0}
"""


def test_designs_whose_spring_does_not_fit_are_counted_apart(run):
    """A rocker that turns fully has no middle of its swing, for a spring; some dyads are short."""
    Path('dyad.yaml').write_text(DYAD)
    study = 'base: dyad.yaml\ndesigns: 64\nmeasures: [peak_torque, stroke]\nranges:\n'
    run(f'{study}  frame.length: [0.02, 0.42]\n  dyads.ram.first.length: [0.05, 2.0]\n')
    rows = np.genfromtxt('study.csv', delimiter=',', names=True, dtype=None, encoding='utf8')
    counts = collections.Counter()
    for _, frame, first, *_, outcome in rows.tolist():
        text = DYAD.replace('frame: {length: 0.4}', f'frame: {{length: {frame!r}}}')
        text = text.replace('first: {length: 0.3}', f'first: {{length: {first!r}}}')
        Path('own.yaml').write_text(text)
        expected = 'valid'
        try:
            Solver(load('own.yaml').mechanism).reach.require_full_turn()
        except MechanismError:
            expected = 'cannot turn'
        except ConfigurationError:
            expected = 'a spring or load curve does not fit'
        assert outcome == expected
        counts[expected] += 1
    assert min(counts.values()) > 2
    assert len(counts) == 3


SLIDER = """
/**:
  ros__parameters:
    mechanism: slider_crank
    crank: {length: 0.05, mass: 0.5}
    coupler: {length: 0.15, mass: 0.5}
    slider: {mass: 0.4, offset: 0.0}
"""
VALVES = """
    drive: motion
    motion: {center: 1.5707963267948966, amplitude: 1.5707963267948966, frequency: 1.0}
    loads: {load: {kind: gas, link: slider, bore: 0.06, clearance: 0.005, inlet: 1e5, outlet: 6e5}}
"""


def test_designs_that_reverse_against_valves_are_counted_apart(run):
    """Their torques would be plausible, but of a wrong pressure."""
    outcome = 'reverses inside a stroke with valves'
    Path('base.yaml').write_text(SLIDER + VALVES)
    study = (
        'base: base.yaml\ndesigns: 4\nsampler: grid\nranges: {slider.offset: [0.0, 0.03]}\n'
        'measures: [peak_torque]\n'
    )
    code, words, _ = run(study)
    rows = np.genfromtxt('study.csv', delimiter=',', names=True, dtype=None, encoding='utf8')
    assert code == 0
    assert f'4 designs: 3 {outcome}, 1 valid' in words
    assert rows['outcome'].tolist() == ['valid', outcome, outcome, outcome]
    assert np.isnan(rows['peak_torque_N_m']).tolist() == [False, True, True, True]
    configuration = load('base.yaml')
    refused = changed(configuration.mechanism, ['slider.offset'], [0.03])
    with pytest.raises(ConfigurationError, match='inside the stroke'):
        configuration.drive.check(refused)


def test_killed_process_loses_no_designs(tmp_path, monkeypatch):
    check_that_a_death_loses_nothing(partial(processes, 2), tmp_path / 'dead')
    monkeypatch.setattr(command_spread, '_ATTEMPTS', 1)
    with pytest.raises(ConfigurationError, match='memory'):
        list(spread(mortal.die, [1], partial(processes, 1)))


def test_ctrl_c_leaves_complete_rows_of_measured_designs(run, monkeypatch):
    def interrupted(work, blocks, connect):
        yield 1, work(blocks[1])
        raise KeyboardInterrupt

    monkeypatch.setattr(command, 'spread', interrupted)
    code, _, errors = run()
    assert code == 130
    assert '64 of 200 designs are in study_unfinished.csv' in errors
    head, *lines = Path('study_unfinished.csv').read_text().splitlines()
    assert [int(line.partition(',')[0]) for line in lines] == list(range(65, 129))
    assert {line.count(',') for line in lines} == {head.count(',')}
    assert sorted(x.name for x in Path().glob('study*')) == ['study.yaml', 'study_unfinished.csv']


@pytest.mark.parametrize(
    ('old', 'new', 'found'),
    [
        ('designs: 200', 'desings: 200', 'base, designs, '),
        ('designs: 200', 'designs: 0', 'a whole number from 1'),
        ('base: quadrilateral', 'base: no_such', 'no preset'),
        ('base: quadrilateral', 'base: wind_pump', 'base = wind_pump'),
        ('base: quadrilateral', 'base: press', 'friction'),
        ('base: quadrilateral', '', 'base is missing'),
        ('seed: 3', 'sampler: dice', 'sobol'),
        ('designs: 200', 'designs: 7\nsampler: grid', 'at least 8'),
        ('crank.length', 'crank.lenght', 'four_bar: choose from frame.length, '),
        ('crank.length', 'crank.center', 'crank.length, crank.mass, '),
        ('crank.length', 'rocker.damping', 'write loads.NAME.damping, with a name of the base'),
        ('[0.05, 0.2]', '[0.2, 0.2]', 'empty'),
        ('[0.05, 0.2]', '[-0.1, 0.2]', 'two numbers, each from 1e-09'),
        ('[0.05, 0.2]', '0.2', 'two numbers'),
        ('rpm: 15.0', 'crank.length: 0.01', 'crank.length has a range'),
        ('rpm: 15.0', 'rpm: 0.0', 'empty'),
        ('rpm: 15.0', 'rocker.mass: 4.0', 'rocker.mass = [-0.5, 7.5]: must be two'),
        ('time_ratio', 'time_rato', "measures ['time_rato', 'peak"),
        ('time_ratio', 'stroke', 'needs a slider'),
        (
            'seed: 3',
            'point: toe',
            "point = 'toe': must be one of the traced points of the base, coupler_point",
        ),
        ('time_ratio', 'point_distance', 'needs a traced point in the base, and points'),
        ('transmission_angle', 'angle', "'angle']: choose from peak_torque"),
        ('[20.0, .inf]', '20.0', 'two numbers'),
        ('[20.0, .inf]', '[91.0, .inf]', 'no design is left of 200 designs: '),
        (
            'crank.length: [0.05, 0.2]',
            'crank.length: [0.6, 0.7]',
            '200 designs: 200 cannot turn; change',
        ),
        ('swing: most', 'swing: best', 'least, most'),
        (', swing: most', '', 'must be two'),
        (STUDY, 'base: quadrilateral\ntolerances: {rpm: 1.0}', 'measures []: choose from'),
        (STUDY, 'base: quadrilateral\nmeasures: swing', 'nothing varies'),
        (STUDY, 'base: quadrilateral\nranges: [1.0, 2.0]', 'ranges: {NAME: VALUE}'),
        (STUDY, '- base', 'instead of a mapping'),
    ],
)
def test_invalid_study_gives_one_line(run, monkeypatch, old, new, found):
    monkeypatch.setattr(command, 'spread', lambda work, blocks, _: enumerate(map(work, blocks)))
    code, _, errors = run(STUDY.replace(old, new))
    assert (code, errors.count('\n')) == (2, 1)
    assert found in errors


def test_absent_scheduler_gives_one_line(run):
    code, _, errors = run(STUDY, '--scheduler', 'tcp://127.0.0.1:9')
    assert (code, errors.count('\n')) == (2, 1)
    assert 'tcp://127.0.0.1:9' in errors
