# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The machines of docs/drawings.md, compared with published values and independent calculations.

The calculations intersect circles, and know nothing of loops and dyads.
"""

import math

import numpy as np
import pytest
from pages import page_files, read

from linkage_ros import Solver, load, travel
from linkage_ros.internals import make_urdf
from linkage_ros.settings.notes import notes

FILES = page_files(read('docs/drawings.md'))
TURN = np.radians(np.arange(0.0, 360.0, 2.0))


@pytest.fixture
def machine(tmp_path):
    """Returns a function that reads a file of the page."""

    def read_file(name):
        path = tmp_path / f'{name}.yaml'
        path.write_text(FILES[path.name])
        return load(path)

    return read_file


def path_of(solver, q, name, u=0.0):
    """Returns position and velocity of a point, complex, m and m/s."""
    motion = solver.point(solver.state(q, u), name)
    return motion.position.x + 1j * motion.position.y, motion.velocity.x + 1j * motion.velocity.y


def meet(p, r, q, s, side):
    """Returns the place at distances r from p and s from q, to the left of p to q, or right."""
    apart = q - p
    along = (abs(apart) ** 2 + r * r - s * s) / (2 * abs(apart))
    return p + apart / abs(apart) * (along + side * 1j * np.sqrt(r * r - along * along))


@pytest.mark.parametrize('name', [name.removesuffix('.yaml') for name in FILES])
def test_every_file_works_as_printed(name, machine):
    configuration = machine(name)
    solver = Solver(configuration.mechanism)
    state = solver.state(configuration.mechanism.drawn.position)
    pins = configuration.only.drawn_mechanism.drawing.pins
    unit = {'m': 1.0, 'cm': 0.01, 'mm': 0.001}[configuration.only.drawn_mechanism.drawing.units]
    origin = np.array(pins[dict(configuration.mechanism.drawn.points)['A0']])
    known = solver.structure.points
    for pin in {*pins} & {*known}:
        place = unit * (np.array(pins[pin]) - origin)
        # The page rounds to 0.0001 units, so a `length` differs from the drawn distance.
        assert np.allclose(solver.point(state, pin).position, place, rtol=0, atol=1e-4 * unit)
    assert make_urdf(configuration.mechanism)
    assert not [note for note in notes(configuration) if 'torque is 0' not in note]


def jansen(crank):
    m, z = 15 * np.exp(1j * crank), -38 - 7.8j
    a, c = meet(m, 50, z, 41.5, -1), meet(m, 61.9, z, 39.3, 1)
    b = meet(z, 40.1, a, 55.8, 1)
    e = meet(b, 39.4, c, 36.7, -1)
    return meet(e, 65.7, c, 49, -1)


def klann(crank):
    m, upper, lower = 26.8 * np.exp(1j * crank), -23.3 + 61.6j, -59 - 17.6j
    elbow = meet(m, 59, lower, 32.1, -1)
    knee = meet(m, 110.5, elbow, 52.2, 1)
    hip = meet(upper, 51.8, knee, 89.7, -1)
    return meet(hip, 173.2, knee, 89.7, 1)


@pytest.mark.parametrize(('name', 'foot'), [('jansen', jansen), ('klann', klann)])
def test_the_foot_of_a_leg_has_the_path_of_its_published_dimensions(name, foot, machine):
    place, _ = path_of(Solver(machine(name).mechanism), TURN, 'foot')
    # The page rounds the pins to 0.0001 mm.
    assert abs(1000 * place - foot(TURN)).max() < 1e-3


def test_klanns_step_has_the_height_that_he_gives(machine):
    place, _ = path_of(Solver(machine('klann').mechanism), TURN, 'foot')
    assert math.isclose(np.ptp(place.imag), 0.1 * 0.523, rel_tol=0.02)
    assert round(1000 * np.ptp(place.imag), 1) == 52.9


def test_hoekens_line_and_speed(machine):
    crank, step = np.radians(np.linspace(150, 210, 601)), 1e-5
    place, speed = path_of(Solver(machine('hoeken').mechanism), crank, 'P', 1.0)

    def tip(crank):
        pin = 0.04 * np.exp(1j * crank)
        return 2 * meet(pin, 0.1015, 0.081, 0.1015, 1) - pin

    assert abs(place - tip(crank)).max() < 1e-9  # the page rounds the pins to 1e-6 mm
    assert abs(speed - (tip(crank + step) - tip(crank - step)) / (2 * step)).max() < 1e-9
    way = np.ptp(place.real)
    assert round(100 * np.ptp(place.imag) / way, 3) == 0.387
    assert round(100 * np.ptp(speed.real) / abs(speed.real).mean(), 3) == 0.106


def test_chebyshevs_point_stays_near_its_line(machine):
    solver = Solver(machine('chebyshev').mechanism)
    # From (0, 40) to (40, 40) cm, where the bar is upright.
    low, high = np.arctan2(30, 40), np.arctan2(50, 0)
    place, _ = path_of(solver, np.linspace(low + 1e-6, high - 1e-6, 400), 'P')
    crank = np.linspace(low + 1e-6, high - 1e-6, 400)
    a = 0.5 * np.exp(1j * crank)
    assert abs(place - 0.5 * (a + meet(a, 0.2, 0.4, 0.5, -1))).max() < 1e-9
    assert np.ptp(place.real) > 0.399
    assert abs(place.imag - 0.4).max() < 1e-3


def test_peaucelliers_line_is_straight(machine):
    configuration = machine('peaucellier')
    crank = np.radians(np.linspace(-57, 57, 201))
    place, _ = path_of(Solver(configuration.mechanism), crank, 'R')
    assert abs(place.real - 0.06).max() < 1e-12 * np.ptp(place.imag)
    # By inversion, R is on the line from the fixed pin O, at (-20, 0) mm, through P.
    assert np.allclose(place.imag, 0.08 * np.tan(0.5 * crank), rtol=0, atol=1e-15)


def test_a_quick_return_has_the_time_ratio_of_its_lengths(machine):
    mechanism = machine('quick_return').mechanism
    # The lever reverses where it touches the circle of the crank pin.
    half = math.acos(math.hypot(60, 30) / 150)
    assert math.isclose(travel(Solver(mechanism)).time_ratio, math.pi / half - 1, rel_tol=1e-12)


def test_a_pantograph_enlarges(machine):
    solver = Solver(machine('pantograph').mechanism)
    (pen, speed), (p, slow) = (path_of(solver, TURN, name, 2.0) for name in ('pen', 'P'))
    fixed = -0.08 - 0.02j
    assert abs(pen - fixed - 2.5 * (p - fixed)).max() < 1e-15
    assert abs(speed - 2.5 * slow).max() < 1e-15


def test_the_pistons_of_a_v_twin_and_its_balance(machine):
    solver = Solver(machine('v_twin').mechanism)
    speed = 100 * math.pi
    state = solver.state(TURN, speed)
    for name, bank in (('left_piston', 0.75 * math.pi), ('right_piston', 0.25 * math.pi)):
        angle = TURN - bank
        stroke = 0.03 * np.cos(angle) + np.sqrt(0.12**2 - (0.03 * np.sin(angle)) ** 2)
        assert np.allclose(state[name].position, stroke, rtol=1e-14)
    unbalanced = 0.4 * 0.03 * speed**2
    force = solver.reactions(state).shaking_force
    weight = 1j * -9.81 * 1.8
    shaking = force.x + 1j * force.y - weight
    for order in (-1, 1):
        assert abs((shaking * np.exp(-1j * order * TURN)).mean()) < 1e-12 * unbalanced
    # The second harmonic is sqrt(2) x mass x r x speed^2 x r / l, but for terms in (r / l)^3.
    assert math.isclose(abs(shaking).max(), math.sqrt(2) / 4 * unbalanced, rel_tol=0.02)
