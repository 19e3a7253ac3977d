# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Forces in the joints and on the frame: 50 digits by one linear system, momenta, hand sums."""

from __future__ import annotations

import cmath
import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mechanisms import (
    ASSEMBLIES,
    DOCUMENT_1,
    PUMPS,
    TURN,
    asked_of_oracle,
    four_bar,
    is_free,
    last_pin,
    longest,
    mirrored,
    motion,
    moving,
    oracle_of,
    path,
    slider_crank,
    turned,
    vector,
    wind_pumps,
)
from mpmath import mp
from oracle_forces import applied_forces, momenta, parts, points, reactions

from linkage_ros import (
    Body,
    Coupler,
    FourBar,
    Frame,
    Guide,
    Slider,
    SliderCrank,
    Solver,
    UnreachableError,
)

MOTION = 2.0, 1.5
MECHANISMS = {
    'crank_rocker': four_bar((1, 3, 2.5, 2.2)),
    'crank_rocker_crossed': four_bar((1, 3, 2.5, 2.2), 5.5, 'crossed'),
    'double_crank': four_bar((3, 2.5, 2.2, 1), -2.0),
    'document_1': DOCUMENT_1,
    'centric': slider_crank((1, 2.5, 0), 0.0),
    'offset_left': slider_crank((1, 2.2, 0.7)),
    'offset_right_crossed': slider_crank((1, 2.2, -0.7), 5.5, 'crossed'),
    'inclined_by_turns': slider_crank((0.5, 3, 1.5), 0.3 + 40 * TURN),
    'document_4': SliderCrank(
        crank=Body(1.0, 1.2, 0.1, (0.5, 0.0)),
        coupler=Coupler(math.sqrt(2), 0.8, 0.15, (0.7, 0.0)),
        slider=Slider(mass=2.0, force=-3.0, damping=0.4),
        frame=Guide(),
    ),
    **PUMPS,
}
# These pass change points, where the forces in the joints are without bound.
CHANGE_POINTS = {
    'parallelogram': four_bar((1, 2, 1, 2)),
    'antiparallelogram': four_bar((1, 2, 1, 2), 0.3, 'crossed'),
    'one_change_point': four_bar((1, 2.5, 1.5, 3)),
    'kite': four_bar((1, 2, 2, 1)),
    'equal_links': slider_crank((1, 1, 0)),
    'folded': slider_crank((1, 1, 0), 0.3, 'crossed'),
    'upper': slider_crank((1, 1.5, -0.5)),
    'lower': slider_crank((1, 1.5, 0.5), 0.3, 'crossed'),
}
ALL = {**MECHANISMS, **CHANGE_POINTS}
mechanisms = pytest.mark.parametrize('name', MECHANISMS)
all_mechanisms = pytest.mark.parametrize('name', ALL)


def has_slider(mechanism):
    return hasattr(mechanism, 'slider')


def largest_length(mechanism):
    if is_free(mechanism):
        return longest(mechanism)
    other = mechanism.slider.offset if has_slider(mechanism) else mechanism.rocker.length
    return max(mechanism.crank.length, mechanism.coupler.length, abs(other))


def worst_errors(mechanism, cranks, speed=2.0, acceleration=1.5, solver=None):
    """Errors of the pin forces, the guide's, the shaking force, its moment, and the torque.

    Forces count relative to the largest in any joint at the same crank angle, moments to that
    times the largest length. Each angle is asked for alone and as one array.
    """
    oracle, solver = oracle_of(mechanism), solver or Solver(mechanism)
    together = solver.reactions(moving(solver, np.array(cranks), speed, acceleration))
    worst = [0.0] * 5
    for i, crank in enumerate(cranks):
        right = reactions(oracle, *asked_of_oracle(mechanism, crank, speed, acceleration))
        force = max(abs(x) for x in right.pins.values())
        moment = force * largest_length(mechanism)
        alone = solver.reactions(moving(solver, crank, speed, acceleration))
        for got, pick in ((alone, lambda x: x), (together, lambda x, i=i: x[i])):
            assert got.pins.keys() == right.pins.keys()

            def off(pair, expected, pick=pick):
                return abs(mp.mpc(float(pick(pair[0])), float(pick(pair[1]))) - expected)

            errors = [
                max(off(got.pins[name], right.pins[name]) for name in right.pins) / force,
                0.0,
                off(got.shaking_force, right.shaking_force) / force,
                abs(mp.mpf(float(pick(got.shaking_moment))) - right.shaking_moment) / moment,
                abs(mp.mpf(float(pick(got.torque))) - right.torque) / moment,
            ]
            if right.guide_force is None:
                assert got.guide_force is None
            else:
                errors[1] = abs(mp.mpf(float(pick(got.guide_force))) - right.guide_force) / force
            worst = [max(x, float(y)) for x, y in zip(worst, errors, strict=True)]
    return worst


def turn(count):
    return np.linspace(-6.0, 6.5, count).tolist()


# The reference itself.


@all_mechanisms
def test_reference_forces_balance_the_momenta_to_50_digits(name):
    """What the frame feels against the rates of both momenta: no body is cut free for these."""
    mechanism = ALL[name]
    oracle = oracle_of(mechanism)
    asked = asked_of_oracle(mechanism, 1.234, 3.0, 2.0)
    right = reactions(oracle, *asked)

    def momentum(kind, part):
        return lambda t: getattr(momenta(oracle, path(oracle, *asked)(t))[kind], part)

    with mp.workdps(60):
        state = oracle.state(*asked)
        expected_force, expected_moment = loads_on_all(oracle, state)
        expected_force -= mp.mpc(*(mp.diff(momentum(0, part), 0) for part in ('real', 'imag')))
        expected_moment -= mp.diff(momentum(1, 'real'), 0)
        assert abs(right.shaking_force - expected_force) < 1e-35
        assert abs(right.shaking_moment - expected_moment) < 1e-35
        # The torque was found by virtual power, or through the forces one body after another.
        torque = asked[2] if is_free(mechanism) else state[3]
        assert abs(right.torque - torque) < 1e-45


def loads_on_all(oracle, state):
    """The weights and the external force: their sum, and their moment about A0."""
    loads, _ = applied_forces(oracle, state)
    bodies = parts(oracle, state)
    moments = ((mp.conj(x.place) * load).imag for x, load in zip(bodies, loads, strict=True))
    return sum(loads), sum(moments)


@all_mechanisms
def test_reference_leaves_no_body_out_of_balance(name):
    """Forces of both joints of crank and coupler, written out once more in words of one body."""
    mechanism = ALL[name]
    oracle = oracle_of(mechanism)
    asked = asked_of_oracle(mechanism, 2.2, 3.0, 2.0)
    right, state = reactions(oracle, *asked), oracle.state(*asked)
    with mp.workdps(60):
        crank, coupler, *_ = parts(oracle, state)
        place = {key: found[0] for key, found in points(oracle, state).items()}
        pins, gravity = right.pins, mp.mpc(*(mp.mpf(x) for x in mechanism.gravity))
        lack = pins['A0'] - pins['A'] - crank.mass * (crank.acceleration - gravity)
        assert abs(lack) < 1e-45
        lack = pins['A'] - pins['B'] - coupler.mass * (coupler.acceleration - gravity)
        assert abs(lack) < 1e-45
        inertia = coupler.mass * (coupler.acceleration - gravity)
        about_A = (mp.conj(coupler.place - place['A']) * inertia).imag
        about_A += coupler.inertia * coupler.angular_acceleration
        about_A += (mp.conj(place['B'] - place['A']) * pins['B']).imag
        assert abs(about_A) < 1e-45


# Against the reference.


@all_mechanisms
def test_forces_are_right_around_two_turns(name):
    assert max(worst_errors(ALL[name], turn(15))) < 1e-12


@mechanisms
@pytest.mark.parametrize('motion', [(0.0, -3.0), (150.0, 1e3)])
def test_forces_are_right_at_rest_and_at_speed(name, motion):
    assert max(worst_errors(MECHANISMS[name], turn(9), *motion)) < 1e-12


class Slipped:
    """A solver one of whose forces errs by a part in 10^11."""

    def __init__(self, solver, slip):
        self._solver, self._slip, self.mechanism = solver, slip, solver.mechanism
        self.state, self.accelerations = solver.state, solver.accelerations

    def reactions(self, state):
        return self._slip(self._solver.reactions(state))


def slipped_pin(name):
    def slip(forces):
        pins = dict(forces.pins)
        pins[name] = tuple(x * (1 + 1e-11) for x in pins[name])
        return forces._replace(pins=pins)

    return slip


def slipped_field(name):
    def slip(forces):
        value = getattr(forces, name)
        wrong = (
            tuple(x * (1 + 1e-11) for x in value)
            if isinstance(value, tuple)
            else value * (1 + 1e-11)
        )
        return forces._replace(**{name: wrong})

    return slip


@pytest.mark.parametrize(
    ('place', 'slip'),
    [(0, slipped_pin(x)) for x in ('A0', 'A', 'B')]
    + [
        (i + 1, slipped_field(x))
        for i, x in enumerate(('guide_force', 'shaking_force', 'shaking_moment', 'torque'))
    ],
)
@pytest.mark.parametrize(('name', 'acceleration'), [('offset_left', 1.5), ('pump', 50.0)])
def test_comparison_catches_a_slip_of_a_part_in_1e11(name, acceleration, place, slip):
    """Negative control of worst_errors: only what slipped is found wrong."""
    mechanism = MECHANISMS[name]
    slipped = Slipped(Solver(mechanism), slip)
    errors = worst_errors(mechanism, turn(9), acceleration=acceleration, solver=slipped)
    assert errors[place] > 1e-12
    assert max(x for i, x in enumerate(errors) if i != place) < 1e-13


lengths = st.integers(4, 256)
angles = st.lists(st.integers(-7000, 7000).map(lambda x: x / 1024), min_size=4, max_size=4)


@settings(max_examples=15)
@given(
    lengths, st.integers(-256, 256), st.integers(1, 512), angles, st.integers(-20, 20),
    st.sampled_from(ASSEMBLIES),
)  # fmt: skip
def test_forces_of_any_slider_crank_are_right(r, offset, slack, cranks, scale, assembly):
    units = [x / 256 for x in (r, r + abs(offset) + slack, offset)]
    mechanism = slider_crank(units, 0.7, assembly, 2.0 ** (scale // 2))
    assert max(worst_errors(mechanism, cranks)) < 1e-12


@settings(max_examples=15)
@given(wind_pumps(scales=10), angles, st.floats(-50, 50))
def test_forces_of_any_wind_pump_are_right(pump, cranks, torque):
    assert max(worst_errors(pump, cranks, 2.0, torque)) < 1e-12


@settings(max_examples=15)
@given(
    lengths, lengths, lengths, st.floats(0, 1), angles, st.integers(-20, 20),
    st.sampled_from(ASSEMBLIES),
)  # fmt: skip
def test_forces_of_any_crank_rocker_are_right(r, b, c, part, cranks, scale, assembly):
    """The shortest link is the crank, and the frame is anything that lets it turn."""
    r, b, c = sorted((r, b + 1, c + 2))
    c += b == c
    r -= r == b
    low, high = max(r, c + r - b) + 1, b + c - r - 1
    if low > high:
        return
    d = low + round(part * (high - low))
    mechanism = four_bar([x / 256 for x in (r, b, c, d)], 0.7, assembly, 2.0 ** (scale // 2))
    assert Solver(mechanism).mobility.turns_fully
    assert Solver(mechanism).mobility.grashof != 'change-point'
    assert max(worst_errors(mechanism, cranks)) < 1e-12


@pytest.mark.parametrize('assembly', ASSEMBLIES)
@pytest.mark.parametrize(
    'make',
    [
        lambda assembly: four_bar((2, 1, 2.5, 3), assembly=assembly),
        lambda assembly: four_bar((2, 1.5, 1.2, 2.2), assembly=assembly),
        lambda assembly: slider_crank((2, 2.5, 1), assembly=assembly),
        lambda assembly: slider_crank((3, 1, 0.5), assembly=assembly),
        lambda assembly: slider_crank((3, 2, 1), assembly=assembly),
    ],
)
def test_forces_of_limited_cranks_are_right(make, assembly):
    mechanism = make(assembly)
    for start, end in Solver(mechanism).mobility.arcs:
        cranks = [start + part * (end - start) for part in (0.05, 0.3, 0.55, 0.8, 0.95)]
        assert max(worst_errors(mechanism, cranks)) < 1e-12


@pytest.mark.parametrize('distance', [1e-4, 1e-14])
@pytest.mark.parametrize('name', CHANGE_POINTS)
def test_forces_near_change_points_are_large_and_right(name, distance):
    mechanism = CHANGE_POINTS[name]
    first = mechanism.frame.angle + (math.pi / 2 if has_slider(mechanism) else 0.0)
    cranks = [
        first + k * math.pi + sign * distance for k, sign in itertools.product((0, 1), (1, -1))
    ]
    assert max(worst_errors(mechanism, cranks)) < 1e-12
    solver = Solver(mechanism)
    forces = [solver.reactions(solver.state(x, *MOTION)).pins['B'] for x in cranks]
    assert max(abs(vector(x)) for x in forces) > 0.01 / distance


@pytest.mark.parametrize('unit', [1e-6, 1e5])
@pytest.mark.parametrize('make', [four_bar, slider_crank])
def test_forces_of_tiny_and_huge_mechanisms_are_right(make, unit):
    lengths = (0.7, 2.1, 1.9, 1.3) if make is four_bar else (0.7, 2.1, 0.4)
    assert max(worst_errors(make(lengths, unit=unit), turn(9))) < 1e-12


# Laws.


@all_mechanisms
def test_torque_through_the_forces_is_that_of_virtual_power(name):
    """Two routes of the package; where pins are far more loaded than driven, to their digits."""
    mechanism = ALL[name]
    solver = Solver(mechanism)
    for cranks in (np.array(turn(101)), *turn(11)):
        state = moving(solver, cranks)
        found = solver.reactions(state)
        load = max(np.max(np.abs(vector(x))) for x in found.pins.values())
        size = np.max(np.abs(state.torque)) + load * mechanism.crank.length
        assert np.max(np.abs(found.torque - state.torque)) <= 1e-13 * size


def centres(mechanism, cranks, motion):
    """Mass and acceleration of each body, its centre traced as a point of a coupler or pin."""
    traced = replace(mechanism, coupler=replace(mechanism.coupler, point=mechanism.coupler.center))
    solver = Solver(traced)
    state = moving(solver, cranks, *motion)
    at = {x: vector(solver.point(state, x).acceleration) for x in solver.structure.points}
    crank = mechanism.crank
    yield crank.mass, at['A'] * complex(*crank.center) / crank.length
    yield mechanism.coupler.mass, at['C']
    if has_slider(mechanism):
        yield mechanism.slider.mass, at[last_pin(mechanism)]
    for name, (first, second) in {'rod': ('B', 'D'), 'rocker': ('B0', 'B')}.items():
        if body := getattr(mechanism, name, None):
            share = complex(*body.center) / body.length
            yield body.mass, at[first] + (at[second] - at[first]) * share


@all_mechanisms
@pytest.mark.parametrize('motion', [(-3.0, 4.0)])
def test_shaking_force_is_weights_less_inertia_and_the_external_force(name, motion):
    mechanism = ALL[name]
    solver, cranks = Solver(mechanism), np.array(turn(51))
    found = solver.reactions(moving(solver, cranks, *motion))
    gravity = complex(*mechanism.gravity)
    expected = np.zeros(51, complex)
    for mass, acceleration in centres(mechanism, cranks, motion):
        expected += mass * (gravity - acceleration)
    if isinstance(mechanism, SliderCrank):
        expected += mechanism.slider.force * cmath.exp(1j * mechanism.frame.angle)
    size = np.max([np.abs(vector(x)) for x in found.pins.values()]) + np.max(np.abs(expected))
    assert np.max(np.abs(vector(found.shaking_force) - expected)) <= 1e-13 * size


@all_mechanisms
def test_frame_feels_the_bearings_the_guide_the_damper_and_the_motor(name):
    """Action is reaction: shaking force and moment from the package's own joints."""
    mechanism = ALL[name]
    solver, cranks = Solver(mechanism), np.array(turn(51))
    state = moving(solver, cranks)
    found = solver.reactions(state)
    force, moment = -vector(found.pins['A0']), -found.torque
    length = largest_length(mechanism)
    if has_slider(mechanism):
        guide = 1 if is_free(mechanism) else cmath.exp(1j * mechanism.frame.angle)
        B = vector(solver.point(state, last_pin(mechanism)).position)
        damper = mechanism.slider.damping * state.velocity[-1] * guide
        on_frame = damper - found.guide_force * 1j * guide
        length = max(length, np.max(np.abs(B)))
    else:
        B = cmath.rect(mechanism.frame.length, mechanism.frame.angle)
        on_frame = -vector(found.pins['B0'])
        length = max(length, mechanism.frame.length)
    force, moment = force + on_frame, moment + (np.conj(B) * on_frame).imag
    size = np.max([np.abs(vector(x)) for x in found.pins.values()])
    assert np.max(np.abs(vector(found.shaking_force) - force)) <= 1e-13 * size
    assert np.max(np.abs(found.shaking_moment - moment)) <= 1e-13 * size * length


@mechanisms
@pytest.mark.parametrize('motion', [(-3.0, 4.0)])
def test_shaking_moment_is_the_loads_less_the_rate_of_angular_momentum(name, motion):
    """By central differences of the reference's momentum, in 60 digits."""
    mechanism = MECHANISMS[name]
    oracle, solver = oracle_of(mechanism), Solver(mechanism)
    errors, largest = [], 0.0
    for crank in turn(9):
        with mp.workdps(60):
            asked = asked_of_oracle(mechanism, crank, *motion)
            at = path(oracle, *asked)
            _, moment = loads_on_all(oracle, at(0))
            expected = moment - mp.diff(lambda t, at=at: momenta(oracle, at(t))[1], 0)
        found = solver.reactions(moving(solver, crank, *motion))
        errors.append(abs(found.shaking_moment - float(expected)))
        load = max(abs(vector(x)) for x in found.pins.values())
        largest = max(largest, load * largest_length(mechanism))
    assert max(errors) < 1e-13 * largest


@all_mechanisms
def test_forces_add_up_over_the_loads(name):
    """At rest forces are linear in the loads: weights and slider force or torque apart."""
    mechanism = replace(ALL[name], gravity=(1.3, -9.7))
    weightless = replace(mechanism, gravity=(0.0, 0.0))
    heavy = mechanism
    if isinstance(mechanism, SliderCrank):
        heavy = replace(mechanism, slider=replace(mechanism.slider, force=0.0))
    torques = (1.5, 1.5, 0.0) if is_free(mechanism) else (0.0, 0.0, 0.0)
    both, first, second = (
        Solver(x).reactions(moving(Solver(x), np.array(turn(21)), 0.0, torque))
        for x, torque in zip((mechanism, weightless, heavy), torques, strict=True)
    )
    for pin in both.pins:
        total = vector(first.pins[pin]) + vector(second.pins[pin])
        size = np.max(np.abs(vector(both.pins[pin]))) + np.max(np.abs(total))
        assert np.max(np.abs(vector(both.pins[pin]) - total)) <= 1e-13 * size


@mechanisms
def test_turned_mechanism_turns_its_forces(name):
    """By half a turn, gravity with it; but for the rounding of the angles."""
    mechanism, cranks = MECHANISMS[name], np.array(turn(21))
    q, u, _ = motion(mechanism, cranks)
    solver, other = Solver(mechanism), Solver(turned(mechanism, -math.pi))
    before = solver.reactions(moving(solver, cranks))
    image = (cranks - math.pi, *(-x for x in q[1:])), (u[0], *(-x for x in u[1:]))
    after = other.reactions(moving(other, image[0][0], *MOTION, *image))
    size = np.max([np.abs(vector(x)) for x in before.pins.values()])
    for pin in before.pins:
        assert np.max(np.abs(vector(after.pins[pin]) + vector(before.pins[pin]))) < 1e-12 * size
    assert np.max(np.abs(after.shaking_moment - before.shaking_moment)) < 1e-12 * size * (
        largest_length(mechanism)
    )


@mechanisms
def test_mirrored_mechanism_mirrors_its_forces(name):
    mechanism, cranks = MECHANISMS[name], np.array(turn(21))
    q, u, _ = motion(mechanism, cranks)
    solver, other = Solver(mechanism), Solver(mirrored(mechanism))
    before = solver.reactions(moving(solver, cranks))
    image = (-cranks, *q[1:]), (-u[0], *u[1:])
    after = other.reactions(moving(other, -cranks, -2.0, -1.5, *image))
    size = np.max([np.abs(vector(x)) for x in before.pins.values()])
    for pin in before.pins:
        difference = vector(after.pins[pin]) - np.conj(vector(before.pins[pin]))
        assert np.max(np.abs(difference)) < 1e-13 * size
    if has_slider(mechanism):
        assert np.max(np.abs(after.guide_force + before.guide_force)) < 1e-13 * size
    moment = size * largest_length(mechanism)
    assert np.max(np.abs(after.shaking_moment + before.shaking_moment)) < 1e-13 * moment


# By hand.


def test_rod_without_mass_pushes_along_itself():
    """Force F on the slider, nothing else: rod F/cos(beta), guide F tan(beta)."""
    mechanism = SliderCrank(
        crank=Body(1.0),
        coupler=Coupler(math.sqrt(2)),
        slider=Slider(force=100.0),
        frame=Guide(),
        gravity=(0.0, 0.0),
    )
    solver = Solver(mechanism)
    found = solver.reactions(solver.state(math.radians(45)))
    # Rod at -30 deg; the slider is pushed along +x, and leans on the guide.
    rod = -100 * complex(1.0, -math.tan(math.radians(30)))
    for pin in ('A0', 'A', 'B'):
        assert complex(*found.pins[pin]) == pytest.approx(rod, rel=1e-13)
    assert found.guide_force == pytest.approx(-100 * math.tan(math.radians(30)), rel=1e-13)
    lever = math.cos(math.radians(45)) * rod.imag - math.sin(math.radians(45)) * rod.real
    assert found.torque == pytest.approx(lever, rel=1e-13)
    assert complex(*found.shaking_force) == pytest.approx(100, rel=1e-13)
    assert found.shaking_moment == pytest.approx(0, abs=1e-12)


def test_weights_of_a_frame_like_four_bar_hang_on_the_pivots():
    """A square of unit links: the coupler's weight halves on both uprights, no torque is due."""
    square = FourBar(
        Frame(1.0), Body(1.0, 3.0, 0.0, (0.5, 0.0)), Coupler(1.0, 4.0, 0.0, (0.5, 0.0)),
        Body(1.0, 5.0, 0.0, (0.5, 0.0)), gravity=(0.0, -10.0),
    )  # fmt: skip
    solver = Solver(square)
    found = solver.reactions(solver.state(math.pi / 2))
    hand = {'A0': 50j, 'A': 20j, 'B': -20j, 'B0': 70j}
    for pin, force in hand.items():
        assert complex(*found.pins[pin]) == pytest.approx(force, rel=1e-13, abs=1e-13)
    assert found.torque == pytest.approx(0, abs=1e-13)
    assert complex(*found.shaking_force) == pytest.approx(-120j, abs=1e-13)
    # About A0: half the coupler's weight stands above A0, the rest and the rocker's at 1 m.
    assert found.shaking_moment == pytest.approx(-70, rel=1e-13)


@pytest.mark.parametrize('name', [name for name, x in ALL.items() if not is_free(x)])
def test_massless_mechanism_has_forces_from_the_slider_alone(name):
    mechanism = ALL[name]
    changes = {
        'crank': Body(mechanism.crank.length),
        'coupler': Coupler(mechanism.coupler.length),
    }
    if has_slider(mechanism):
        changes['slider'] = replace(mechanism.slider, mass=0.0)
    else:
        changes['rocker'] = Body(mechanism.rocker.length)
    massless = replace(mechanism, **changes)
    solver, cranks = Solver(massless), np.array(turn(21))
    state = solver.state(cranks, *MOTION)
    found = solver.reactions(state)
    if not has_slider(mechanism):
        assert all(np.all(vector(x) == 0) for x in found.pins.values())
        assert np.all(found.torque == 0)
        assert np.all(found.shaking_moment == 0)
        return
    slider = mechanism.slider
    push = slider.force - slider.damping * state.velocity[2]
    beta = state.position[1] - mechanism.frame.angle
    guide = cmath.exp(1j * mechanism.frame.angle)
    rod = -push * guide * (1 + 1j * np.tan(beta))
    for pin in ('A0', 'A', 'B'):
        assert np.allclose(vector(found.pins[pin]), rod, rtol=1e-12, atol=0)
    # The frame feels the external force, whose line is the guide, and nothing more.
    assert np.allclose(vector(found.shaking_force), slider.force * guide, rtol=0, atol=1e-11)
    assert np.allclose(found.shaking_moment, -slider.force * slider.offset, rtol=0, atol=1e-11)


def test_coupler_without_mass_is_a_rod_in_line():
    """No mass and no weight between its pins: what enters at A leaves at B along the line."""
    for name, length in {'crank_rocker': 2.5, 'offset_left': 2.5, 'pump': 1.6}.items():
        mechanism = replace(MECHANISMS[name], coupler=Coupler(length))
        solver, cranks = Solver(mechanism), np.array(turn(21))
        state = moving(solver, cranks)
        found = solver.reactions(state)
        A, B = vector(found.pins['A']), vector(found.pins['B'])
        assert np.allclose(A, B, rtol=1e-13, atol=0)
        across = (A * np.exp(-1j * state.position[1])).imag
        assert np.max(np.abs(across)) < 1e-13 * np.max(np.abs(A))


# Ways of asking.


@all_mechanisms
def test_scalars_and_arrays_agree(name):
    solver = Solver(ALL[name])
    cranks = np.linspace(-7.0, 14.0, 201)
    together = solver.reactions(moving(solver, cranks))
    for i, crank in enumerate(cranks.tolist()):
        alone = solver.reactions(moving(solver, crank))
        load = max(abs(vector(x)) for x in alone.pins.values())
        moment = load * largest_length(ALL[name])
        for pin, force in alone.pins.items():
            assert abs(vector(force) - vector(together.pins[pin])[i]) <= 1e-13 * load
        assert abs(vector(alone.shaking_force) - vector(together.shaking_force)[i]) <= 1e-13 * load
        assert abs(alone.shaking_moment - together.shaking_moment[i]) <= 1e-13 * moment
        assert abs(alone.torque - together.torque[i]) <= 1e-13 * moment
        if has_slider(ALL[name]):
            assert abs(alone.guide_force - together.guide_force[i]) <= 1e-13 * load
        else:
            assert alone.guide_force is together.guide_force is None


@pytest.mark.parametrize('name', ['crank_rocker', 'offset_left', 'pump'])
def test_floats_give_floats_and_arrays_their_shape(name):
    solver = Solver(MECHANISMS[name])

    def values(found):
        yield from itertools.chain(*found.pins.values(), found.shaking_force)
        yield from (found.shaking_moment, found.torque)
        if has_slider(MECHANISMS[name]):
            yield found.guide_force

    found = solver.reactions(moving(solver, 0.7))
    assert {type(x) for x in values(found)} == {float}
    for crank, speed, shape in (
        (np.full((2, 3), 0.7), 2.0, (2, 3)),
        (np.ones((3, 0)), 2.0, (3, 0)),
        (0.7, np.array([1.0, -2.0]), (2,)),
        (np.array([[0.7], [1.0], [2.0]]), np.array([1.0, -2.0]), (3, 2)),
    ):
        found = solver.reactions(moving(solver, crank, speed))
        assert {np.shape(x) for x in values(found)} == {shape}
    last = {'crank_rocker': ['B0'], 'offset_left': [], 'pump': ['D']}[name]
    assert list(found.pins) == ['A0', 'A', 'B', *last]


# At change points.


@pytest.mark.parametrize(
    ('mechanism', 'crank'),
    [
        (four_bar((1, 2, 1, 2), 0.0), 0.0),
        (four_bar((1, 2, 1, 2), 0.3, 'crossed'), 0.3),
        (four_bar((1, 3.5, 2.5, 2)), 0.3),
        (four_bar((1, 2, 2, 1), 5.5), 5.5),
        # pi/2 lies 6.123e-17 above its double; the guide's angle takes that up.
        (slider_crank((1, 1, 0), -6.123233995736766e-17), math.pi / 2),
        (slider_crank((1, 1.5, -0.5), -6.123233995736766e-17), math.pi / 2),
        (slider_crank((1, 1.5, 0.5), 6.123233995736766e-17, 'crossed'), -math.pi / 2),
    ],
)
def test_forces_at_a_change_point_are_refused(mechanism, crank):
    solver = Solver(mechanism)
    for angles in (crank, np.array([1.0, crank, 2.0])):
        state = solver.state(angles, *MOTION)
        with pytest.raises(UnreachableError, match='change point') as error:
            solver.reactions(state)
        assert '\n' not in str(error.value)
        assert error.value.crank_angle == crank
        assert error.value.arcs == solver.mobility.arcs


# Where an angle is rounded, an exact comparison would not see the change point.
PASSED = {
    'small_parallelogram': (four_bar((0.1, 0.4, 0.1, 0.4), 0.0), (0.0, math.pi)),
    'parallelogram': (four_bar((1, 2, 1, 2)), (0.3, 0.3 + math.pi)),
    'kite': (four_bar((1, 2, 2, 1), 5.5, 'crossed'), (5.5,)),
    'one_a_turn': (four_bar((1, 2.5, 1.5, 3), 0.0), (math.pi,)),
    'equal_rod': (slider_crank((1, 1, 0), 0.0), (math.pi / 2, -math.pi / 2)),
    'offset_slider': (slider_crank((1, 1.5, 0.5)), (0.3 - math.pi / 2,)),
}
passed = pytest.mark.parametrize('name', PASSED)
at_turns = pytest.mark.parametrize('turns', [0, 3, 1000])


def passing(name, turns):
    """Crank angles of the change points that many turns ahead and back, as a user types them."""
    _, first = PASSED[name]
    return [x + sign * turns * 2 * math.pi for x in first for sign in ((1, -1) if turns else (1,))]


@passed
@at_turns
def test_change_points_are_refused_after_any_number_of_turns(name, turns):
    solver = Solver(PASSED[name][0])
    for crank in passing(name, turns):
        for speed in (2.0, -2.0):
            alone = solver.state(crank, speed, 1.5)
            together = solver.state(np.array([crank + 1, crank, crank - 1]), speed, 1.5)
            values = [*alone.position, *alone.velocity, *alone.acceleration, alone.torque]
            assert np.isfinite(values).all()
            assert np.isfinite(np.array(together[:3])).all()
            for state in (alone, together):
                with pytest.raises(UnreachableError, match='change point') as error:
                    solver.reactions(state)
                assert error.value.crank_angle == crank


@passed
def test_angles_meant_as_change_points_miss_them(name):
    """Control of the test above: at these angles a guard of no width would let forces pass."""
    mechanism, _ = PASSED[name]
    missed = []
    for turns in (1, 3, 101, 1000):
        for crank in passing(name, turns):
            with mp.workdps(60):
                apart = mp.mpf(crank) - mp.mpf(mechanism.frame.angle)
                if has_slider(mechanism):
                    apart -= mp.pi / 2
                apart -= mp.pi * mp.nint(apart / mp.pi)
            assert abs(apart) < 2 * math.ulp(abs(crank) + abs(mechanism.frame.angle))
            missed.append(apart != 0)
    assert all(missed)


@pytest.mark.parametrize('turns', [2, 2.5, 3.5, 1000, -1000])
def test_parallelogram_is_refused_at_any_multiple_of_pi(turns):
    solver = Solver(PASSED['small_parallelogram'][0])
    with pytest.raises(UnreachableError, match='all links lie in one line'):
        solver.reactions(solver.state(turns * 2 * math.pi, 10.0))


def test_each_multiple_of_pi_is_refused_however_it_is_computed():
    solver = Solver(PASSED['small_parallelogram'][0])
    ways = (
        lambda k: k * math.pi,
        lambda k: math.radians(180.0 * k),
        lambda k: math.copysign(np.linspace(0, 4000 * math.pi, 4001)[abs(k)], k),
        lambda k: math.nextafter(k * math.pi, 0.0),
    )
    for k in (*range(-40, 41), 999, -1234, 3001, 4000):
        for way in ways:
            with pytest.raises(UnreachableError):
                solver.reactions(solver.state(way(k), 1.0))


@passed
@at_turns
@pytest.mark.parametrize('distance', [1e-6])
def test_forces_beside_change_points_are_right_after_any_number_of_turns(name, turns, distance):
    mechanism, _ = PASSED[name]
    cranks = [x + sign * distance for x in passing(name, turns) for sign in (1, -1)]
    assert max(worst_errors(mechanism, cranks)) < 1e-12
    assert max(worst_errors(mechanism, cranks[:2], -3.0, 0.0)) < 1e-12


@pytest.mark.parametrize('turns', [1, 3, 101, 1000])
def test_forces_beside_change_points_are_answered_a_few_roundings_away(turns):
    """The guard is no wider than it has to be."""
    for name in PASSED:
        solver = Solver(PASSED[name][0])
        for crank in passing(name, turns):
            for sign in (8, -8):
                beside = crank + sign * math.ulp(8 + abs(crank))
                found = solver.reactions(solver.state(beside, 1.0))
                assert np.isfinite([*found.pins.values()]).all()


def test_links_almost_in_line_are_no_change_point():
    """A sum of 1e-13 m does not count as 0: the forces are large, finite and right."""
    mechanism = four_bar((1 - 1e-13, 2, 1, 2), 0.0)
    assert Solver(mechanism).mobility.grashof == 'crank-rocker'
    assert max(worst_errors(mechanism, [0.0, math.pi, 2000 * math.pi])) < 1e-12


@pytest.mark.parametrize('tiny', [1e-300, -3e-308, 5e-324])
def test_tiny_crank_angles_do_not_underflow(tiny):
    for mechanism in (slider_crank((0.7, 2, 0), 0.0), four_bar((0.7, 2, 1.8, 1.5), 0.0)):
        solver = Solver(mechanism)
        for crank in (tiny, np.array([tiny, 1.0])):
            found = solver.reactions(solver.state(crank, *MOTION))
            assert all(np.all(np.isfinite(x)) for x in found.pins.values())
