# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Places, rates, accelerations and torque of slider-cranks against 50 digits, and their laws."""

from __future__ import annotations

import cmath
import itertools
import math
from dataclasses import replace
from fractions import Fraction
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from mpmath import mp
from oracle_slider import SliderOracle, worst_errors, wrap

from linkage_ros import (
    Body,
    Coupler,
    Guide,
    MechanismError,
    Slider,
    SliderCrank,
    Solver,
    UnreachableError,
)

TURN = 2 * math.pi
ASSEMBLIES = 'open', 'crossed'
# Crank, coupler, offset. The crank turns fully, and never passes a change point.
FULL = {
    'centric': (1, 2.5, 0),
    'offset_left': (1, 2.2, 0.7),
    'offset_right': (1, 2.2, -0.7),
    'short_coupler': (1, 1.1, 0),
    'offset_longer_than_crank': (0.5, 3, 1.5),
}
# One change point a turn on the side away from the offset, or both, which needs no offset.
CHANGE_POINTS = {
    'lower': (1, 1.5, 0.5),
    'upper': (1, 1.5, -0.5),
    'lower_long_offset': (0.5, 2.5, 2),
    'upper_long_offset': (0.5, 2.5, -2),
    'both': (1, 1, 0),
}
BOTH_KINDS = {**FULL, **CHANGE_POINTS}
LIMITED = {
    'offset_left': (2, 2.5, 1),
    'offset_right': (2, 2.5, -1),
    'long_crank': (3, 2, 1.5),
    'offset_longer_than_coupler': (1, 2, 2.5),
    'offset_longest': (1, 0.5, -1.2),
    'rotating_coupler': (3, 1, 0.5),
    'rotating_coupler_far_offset': (3, 1, -1.5),
    'rotating_coupler_centric': (2, 1, 0),
    'upper_change_point': (3, 2, 1),
    'lower_change_point': (3, 2, -1),
}


def slider_crank(lengths, angle=0.3, assembly='open', unit=1.0):
    """A mechanism with mass everywhere and no symmetry; `unit` scales lengths and dynamics."""
    r, b, e = (float(x) * unit for x in lengths)
    inertia, gravity = unit * unit, min(unit, 1e4)
    return SliderCrank(
        crank=Body(r, 0.7, 0.02 * inertia, (0.3 * r, -0.2 * r)),
        coupler=Coupler(b, 2.0, 0.5 * inertia, (0.6 * b, 0.3 * b)),
        slider=Slider(offset=e, mass=1.5, force=6.0 * unit, damping=0.9),
        frame=Guide(angle=angle),
        assembly=assembly,
        gravity=(1.3 * gravity, -9.7 * gravity),
    )


def rows(state):
    return np.array([*state.position, *state.velocity, *state.acceleration, state.torque])


def spread_about(cranks):
    """These crank angles and 24 others over two turns, so that largest values are seen."""
    return np.array([*cranks, *np.linspace(-6.0, 6.5, 24)])


def is_close(got, expected, ulps, mechanism):
    """Whether quantities over many angles agree within some ulp of each one's largest value.

    The slider of a folded mechanism stays at 0: it is held to the crank's length.
    """
    largest = np.max(np.abs(expected), axis=1, keepdims=True)
    difference = np.abs(got - expected)
    difference[:2] = np.abs(np.remainder(difference[:2] + math.pi, TURN) - math.pi)
    largest[:2] = math.pi
    slide = largest[[2, 5, 8]]
    r = mechanism.crank.length
    largest[[2, 5, 8]] = np.where(slide < 1e-10 * r, 4 * r, slide)
    return bool(np.all(difference <= ulps * np.spacing(largest)))


def mirrored_center(body):
    return replace(body, center=(body.center[0], -body.center[1]))


# The reference itself.


@pytest.mark.parametrize('assembly', ASSEMBLIES)
@pytest.mark.parametrize('crank', [0.0, 1.234, -7.5])
@pytest.mark.parametrize('name', ['offset_left', 'offset_right'])
def test_reference_is_consistent_to_50_digits(name, crank, assembly):
    oracle = SliderOracle(slider_crank(FULL[name], -40.0, assembly))
    with mp.workdps(60):
        time = mp.mpf(0.25)
        motion = crank + 3 * time + time**2, 3 + 2 * time, 2
        state = oracle.state(*motion)
        r, b, e = (mp.mpf(x.numerator) / x.denominator for x in oracle.lengths)
        alpha, beta, x = state.position
        loop = r * mp.expj(alpha) + b * mp.expj(beta)
        assert abs(loop - mp.mpc(x, e) * mp.expj(mp.mpf(-40))) < 1e-50
        on_plus_side = mp.cos(beta + 40) > 0
        assert on_plus_side == (assembly == 'open')
        for link in range(3):

            def position(t, link=link):
                return oracle.state(crank + 3 * t + t**2).position[link]

            def velocity(t, link=link):
                return oracle.state(crank + 3 * t + t**2, 3 + 2 * t).velocity[link]

            assert abs(mp.diff(position, time) - state.velocity[link]) < 1e-35
            assert abs(mp.diff(velocity, time) - state.acceleration[link]) < 1e-35


@pytest.mark.parametrize('assembly', ASSEMBLIES)
@pytest.mark.parametrize('name', CHANGE_POINTS)
def test_reference_moves_smoothly_through_change_points(name, assembly):
    oracle = SliderOracle(slider_crank(CHANGE_POINTS[name], 5.5, assembly))
    step = TURN / 96
    states = [oracle.state(0.4 + i * step, 1.0) for i in range(2 * 96)]
    for before, after in itertools.pairwise(states):
        for link in (1, 2):
            moved = after.position[link] - before.position[link]
            if link == 1:
                moved = wrap(moved)
            # Hermite's corrected trapezoid rule; a change of branch would leave O(step).
            rule = step / 2 * (before.velocity[link] + after.velocity[link])
            rule += step**2 / 12 * (before.acceleration[link] - after.acceleration[link])
            assert abs(moved - rule) < 1e-4 * step


class Slipped:
    """A solver that errs in one quantity, by a part in 10^12."""

    def __init__(self, solver, quantity):
        self.mechanism, self._solver, self._quantity = solver.mechanism, solver, quantity

    def state(self, *motion):
        state = self._solver.state(*motion)
        values = [*state.position, *state.velocity, *state.acceleration, state.torque]
        values[self._quantity] = values[self._quantity] * (1 + 1e-12)
        position, velocity, acceleration = (tuple(values[i : i + 3]) for i in (0, 3, 6))
        return type(state)(position, velocity, acceleration, values[9])


@pytest.mark.parametrize('quantity', range(10))
def test_comparison_catches_a_slip_of_a_part_in_1e12(quantity):
    """Negative control of worst_errors: only the quantity that slipped is found wrong."""
    solver = Solver(slider_crank(FULL['offset_left']))
    angles = spread_about([]).tolist()
    assert max(worst_errors(solver, angles, 2.0, 1.5)) < 1e-14
    errors = worst_errors(Slipped(solver, quantity), angles, 2.0, 1.5)
    slipped = quantity // 3
    assert 3e-13 < errors[slipped] < 1e-11
    assert max(x for i, x in enumerate(errors) if i != slipped) < 1e-14


@pytest.mark.parametrize('name', BOTH_KINDS)
def test_comparison_catches_the_other_branch(name):
    right, other = (Solver(slider_crank(BOTH_KINDS[name], 0.3, x)) for x in ASSEMBLIES)
    confused = SimpleNamespace(mechanism=right.mechanism, state=other.state)
    assert min(worst_errors(confused, [1.0], 2.0, 1.5)) > 0.01


# Document 4.


DOCUMENT = SliderCrank(
    crank=Body(1.0, 1.2, 0.1, (0.5, 0.0)),
    coupler=Coupler(math.sqrt(2), 0.8, 0.15, (0.7, 0.0)),
    slider=Slider(mass=2.0),
    frame=Guide(),
)


def test_document_4_has_its_printed_values():
    state = Solver(DOCUMENT).state(math.radians(45), 0.5, 1.0)
    assert state.position[0] == math.radians(45)
    assert math.degrees(state.position[1]) == pytest.approx(-30, rel=1e-14)
    assert state.position[2] == pytest.approx(1.93185165258, rel=5e-12)
    assert state.velocity[1:] == pytest.approx((-0.288675134595, -0.557677535825), rel=5e-12)
    assert state.acceleration[1:] == pytest.approx((-0.481125224325, -1.32615245782), rel=5e-12)
    assert (state.velocity[0], state.acceleration[0]) == (0.5, 1.0)


@pytest.mark.parametrize('assembly', ASSEMBLIES)
@pytest.mark.parametrize('loads', [{}, {'force': -7.0, 'damping': 2.5, 'offset': 0.3}])
def test_document_4_is_right_over_the_turn(loads, assembly):
    mechanism = replace(DOCUMENT, slider=Slider(mass=2.0, **loads), assembly=assembly)
    angles = [math.radians(degrees / 2) for degrees in range(720)]
    assert max(worst_errors(Solver(mechanism), angles, 0.5, 1.0, period=0)) < 1e-13


def test_names_of_the_members_follow_the_chain():
    assert Solver(DOCUMENT).links == ('crank', 'coupler', 'slider')


# Ways of asking.


@pytest.mark.parametrize('name', BOTH_KINDS)
@pytest.mark.parametrize('assembly', ASSEMBLIES)
def test_scalars_and_arrays_agree_to_a_few_ulp(name, assembly):
    solver = Solver(slider_crank(BOTH_KINDS[name], 0.3, assembly))
    angles = np.linspace(-7.0, 14.0, 5001)  # more than one chunk of the solver
    one_by_one = np.array([rows(solver.state(x, 2.0, 1.5)) for x in angles.tolist()]).T
    assert is_close(rows(solver.state(angles, 2.0, 1.5)), one_by_one, 4, solver.mechanism)


@pytest.mark.parametrize('shape', [(0,), (3, 0), (1,), (2, 3), (2, 1, 4)])
def test_the_shape_of_the_angles_is_kept(shape):
    solver = Solver(DOCUMENT)
    angles = np.arange(math.prod(shape), dtype=float).reshape(shape)
    state = solver.state(angles, 2.0)
    assert rows(state).shape == (10, *shape)
    assert np.array_equal(rows(state).reshape(10, -1), rows(solver.state(angles.ravel(), 2.0)))


def test_state_of_floats_is_made_of_floats():
    state = Solver(DOCUMENT).state(2, 3, 1)
    values = *state.position, *state.velocity, *state.acceleration, state.torque
    assert {type(x) for x in values} == {float}


@given(st.floats(-20, 20))
def test_coupler_stays_in_range_and_the_crank_angle_is_returned_as_asked(crank):
    position = Solver(slider_crank(FULL['offset_left'])).state(crank).position
    assert position[0] == crank
    assert abs(position[1]) <= math.pi


# Laws and the reference, over mechanisms whose lengths are whole multiples of a power of two:
# sums of them are exact, so that change points are drawn as themselves.


@st.composite
def full_turn_mechanisms(draw, scales=20, turns=150):
    r = draw(st.integers(4, 256))
    offset = draw(st.one_of(st.just(0), st.integers(-256, 256)))
    slack = draw(st.one_of(st.just(0), st.integers(0, 512)))
    angle = draw(st.integers(-3 * 1024, 3 * 1024)) / 1024 + TURN * draw(
        st.one_of(st.just(0), st.integers(-turns, turns))
    )
    unit = 2.0 ** (draw(st.integers(-scales, scales)) - 8)
    lengths = r, r + abs(offset) + slack, offset
    return slider_crank(lengths, angle, draw(st.sampled_from(ASSEMBLIES)), unit)


angles_of_two_turns = st.floats(-TURN, TURN, allow_subnormal=False)
some_angles = st.lists(angles_of_two_turns, min_size=4, max_size=4)


@given(full_turn_mechanisms(), some_angles)
def test_any_full_turn_mechanism_is_right(mechanism, angles):
    assert max(worst_errors(Solver(mechanism), angles, 2.0, 1.5, period=12)) < 1e-13


@given(full_turn_mechanisms(), angles_of_two_turns)
def test_loop_closes_within_8_ulp_of_the_largest_length(mechanism, crank):
    r, b = mechanism.crank.length, mechanism.coupler.length
    offset = mechanism.slider.offset
    solver = Solver(mechanism)
    for state in (solver.state(crank), solver.state([crank])):
        alpha, beta, x = (float(np.ravel(y)[0]) for y in state.position)
        with mp.workdps(40):
            A, coupler, guide = (mp.expj(mp.mpf(y)) for y in (alpha, beta, mechanism.frame.angle))
            residual = abs(r * A + b * coupler - mp.mpc(x, offset) * guide)
        assert residual <= 8 * math.ulp(max(r, b, abs(offset), abs(x)))


@given(full_turn_mechanisms(), some_angles)
def test_mirrored_mechanism_moves_mirrored(mechanism, cranks):
    mirrored = replace(
        mechanism,
        crank=mirrored_center(mechanism.crank),
        coupler=mirrored_center(mechanism.coupler),
        slider=replace(mechanism.slider, offset=-mechanism.slider.offset),
        frame=Guide(angle=-mechanism.frame.angle),
        gravity=(mechanism.gravity[0], -mechanism.gravity[1]),
    )
    cranks = spread_about(cranks)
    got = rows(Solver(mirrored).state(-cranks, -2.0, -1.5))
    got[[0, 1, 3, 4, 6, 7, 9]] *= -1
    expected = rows(Solver(mechanism).state(cranks, 2.0, 1.5))
    assert is_close(got[:9], expected[:9], 8, mechanism)
    # Where folded links balance, the torque is a small difference of large moments.
    assert is_close(got, expected, 64, mechanism)


@given(
    full_turn_mechanisms(turns=0),
    st.lists(st.integers(-8192, 8192), min_size=4, max_size=4),
    st.integers(-3 * 1024, 3 * 1024),
)
def test_rotated_mechanism_moves_rotated(mechanism, cranks, onto):
    """All angles are dyadic fractions: their sums are exact."""
    turned = onto / 1024 - mechanism.frame.angle
    cranks = np.array([x / 1024 for x in [*cranks, *range(-6144, 6657, 512)]])
    gravity = complex(*mechanism.gravity) * cmath.exp(1j * turned)
    rotated = replace(
        mechanism, frame=Guide(angle=onto / 1024), gravity=(gravity.real, gravity.imag)
    )
    got = rows(Solver(rotated).state(cranks + turned, 2.0, 1.5))
    expected = rows(Solver(mechanism).state(cranks, 2.0, 1.5))
    expected[:2] += turned
    assert is_close(got[:9], expected[:9], 16, mechanism)
    weight = 4.5 * mechanism.coupler.length * abs(gravity)  # a torque of this size is rotated
    largest = np.max(np.abs(expected[9]))
    assert np.max(np.abs(got[9] - expected[9])) <= 1e-14 * max(largest, weight)


@given(full_turn_mechanisms(scales=0), angles_of_two_turns, st.integers(-20, 19))
def test_scaled_mechanism_moves_alike_and_takes_torque_by_its_square(mechanism, crank, power):
    factor = 2.0**power

    def scaled(body):
        along, across = body.center
        return replace(
            body,
            length=body.length * factor,
            inertia=body.inertia * factor**2,
            center=(along * factor, across * factor),
        )

    slider = mechanism.slider
    larger = replace(
        mechanism,
        crank=scaled(mechanism.crank),
        coupler=scaled(mechanism.coupler),
        slider=replace(slider, offset=slider.offset * factor, force=slider.force * factor),
        gravity=(mechanism.gravity[0] * factor, mechanism.gravity[1] * factor),
    )
    got = rows(Solver(larger).state(crank, 2.0, 1.5))
    expected = rows(Solver(mechanism).state(crank, 2.0, 1.5))
    expected[[2, 5, 8]] *= factor
    assert got[:9].tolist() == expected[:9].tolist()
    assert got[9] == expected[9] * factor**2


@given(full_turn_mechanisms(), angles_of_two_turns)
def test_motion_played_backwards_takes_the_same_torque_but_for_damping(mechanism, crank):
    frictionless = replace(mechanism, slider=replace(mechanism.slider, damping=0.0))
    solver = Solver(frictionless)
    forth, back = (solver.state(crank, speed, 1.5) for speed in (2.0, -2.0))
    assert back.position == forth.position
    assert back.velocity == tuple(-x for x in forth.velocity)
    assert back.acceleration == forth.acceleration
    assert back.torque == forth.torque
    damped = Solver(mechanism)
    gain = damped.state(crank, 2.0, 1.5).torque - damped.state(crank, -2.0, 1.5).torque
    slide = forth.velocity[2]
    lost = 2 * mechanism.slider.damping * slide * slide / 2.0
    size = abs(forth.torque) + lost + mechanism.coupler.length**2
    assert gain == pytest.approx(lost, rel=1e-13, abs=1e-14 * size)


@pytest.mark.parametrize('assembly', ASSEMBLIES)
@pytest.mark.parametrize('name', ['offset_left', 'centric', 'upper', 'both'])
def test_rates_and_accelerations_are_derivatives_to_second_order(name, assembly):
    solver = Solver(slider_crank(BOTH_KINDS[name], assembly=assembly))
    angles, speed, acceleration = np.linspace(0.0, 6.0, 41), 2.0, 1.5
    exact = solver.state(angles, speed, acceleration)
    steps, errors = [0.02 / 2**i for i in range(4)], []
    for step in steps:
        later, earlier = (
            solver.state(
                angles + speed * t + acceleration * t * t / 2,
                speed + acceleration * t,
                acceleration,
            )
            for t in (step, -step)
        )
        errors.append([])
        for link in (1, 2):
            moved = later.position[link] - earlier.position[link]
            if link == 1:
                moved = np.remainder(moved + math.pi, TURN) - math.pi
            gained = later.velocity[link] - earlier.velocity[link]
            for got, right in (
                (moved, exact.velocity[link]), (gained, exact.acceleration[link])
            ):  # fmt: skip
                errors[-1].append(np.max(np.abs(got / (2 * step) - right)))
    for quantity in np.array(errors).T:
        if quantity[0] < 1e-11:  # exactly linear, as the coupler of the folded mechanism
            assert np.max(quantity) < 1e-11
            continue
        assert quantity[-1] < 1e-2
        slope = np.polyfit(np.log(steps), np.log(quantity), 1)[0]
        assert slope == pytest.approx(2.0, abs=0.1)


# Work and energy.


@pytest.mark.parametrize('assembly', ASSEMBLIES)
@pytest.mark.parametrize('acceleration', [0.0, -3.0])
@pytest.mark.parametrize('name', BOTH_KINDS)
def test_power_put_in_less_what_is_lost_is_the_rate_of_the_energy(name, acceleration, assembly):
    """The energy is the reference's, differentiated in 50 digits: no pin forces are involved."""
    mechanism = slider_crank(BOTH_KINDS[name], 0.3, assembly)
    oracle, solver, speed = SliderOracle(mechanism), Solver(mechanism), 2.0
    errors, largest = [], 0.0
    for crank in np.linspace(-6.0, 6.0, 9).tolist():
        with mp.workdps(60):

            def energy(t, crank=crank):
                return oracle.energy(
                    crank + speed * t + acceleration * t**2 / 2, speed + acceleration * t
                )

            state = oracle.state(crank, speed, acceleration)
            slide = state.velocity[2]
            force = mp.mpf(mechanism.slider.force) - mp.mpf(mechanism.slider.damping) * slide
            expected = (mp.diff(energy, 0) - force * slide) / speed
            assert abs(expected - state.torque) < 1e-35
        errors.append(abs(solver.state(crank, speed, acceleration).torque - float(expected)))
        largest = max(largest, abs(float(expected)))
    assert max(errors) < 1e-14 * largest


@pytest.mark.parametrize('name', BOTH_KINDS)
def test_work_over_the_period_at_constant_speed_is_what_damping_takes(name):
    """The trapezoid rule is exact to all digits here: the torque is smooth and periodic."""
    solver = Solver(slider_crank(BOTH_KINDS[name]))
    period, speed = TURN * solver.mobility.period_turns, 3.0
    crank = np.arange(2880) * (period / 2880)
    state = solver.state(crank, speed)
    work = np.sum(state.torque) * period / 2880
    lost = np.sum(0.9 * state.velocity[2] ** 2) * period / 2880 / speed
    throughput = np.sum(np.abs(state.torque)) * period / 2880
    assert throughput > 10.0
    assert work == pytest.approx(lost, rel=0, abs=1e-12 * throughput)


def test_sinusoidal_slider_loses_what_the_formula_says():
    """Equal crank and coupler: x = 2 r cos(alpha), so damping takes 4 pi d r^2 speed a turn."""
    mechanism = SliderCrank(
        crank=Body(0.2, 1.0, 0.1),
        coupler=Coupler(0.2, 1.0, 0.1),
        slider=Slider(mass=3.0, force=40.0, damping=5.0),
        frame=Guide(angle=1.0),
    )
    crank = np.arange(360) * (TURN / 360)
    state = Solver(mechanism).state(crank, 3.0)
    assert np.allclose(state.position[2], 0.4 * np.cos(crank - 1.0), rtol=0, atol=4e-16)
    assert np.sum(state.torque) * TURN / 360 == pytest.approx(4 * math.pi * 5 * 0.04 * 3)


@pytest.mark.parametrize('name', BOTH_KINDS)
def test_torque_at_rest_carries_the_weights_and_the_force(name):
    mechanism = slider_crank(BOTH_KINDS[name])
    oracle, solver = SliderOracle(mechanism), Solver(mechanism)
    for crank in (0.1, 1.0, 2.2, 4.0, 5.7, -3.0):
        with mp.workdps(60):
            heave = mp.diff(lambda x: oracle.energy(x, 0), crank)
            slide = mp.diff(lambda x: oracle.state(x).position[2], crank)
            expected = float(heave - mp.mpf(mechanism.slider.force) * slide)
        assert solver.state(crank).torque == pytest.approx(expected, rel=1e-13, abs=1e-13)
        assert solver.state([crank]).torque[0] == pytest.approx(expected, rel=1e-13, abs=1e-13)


@given(full_turn_mechanisms(), angles_of_two_turns)
def test_massless_mechanism_hands_the_slider_forces_through(mechanism, crank):
    slider = replace(mechanism.slider, mass=0.0)
    massless = replace(
        mechanism,
        crank=Body(mechanism.crank.length),
        coupler=Coupler(mechanism.coupler.length),
        slider=slider,
    )
    state = Solver(massless).state(crank, 2.0, 1.5)
    slide = state.velocity[2]
    force = slider.force - slider.damping * slide
    assert state.torque == pytest.approx(-force * slide / 2.0, rel=1e-14, abs=1e-300)


def test_disc_that_rolls_is_a_heavier_slider():
    """Document 4's disc, mass m, inertia J, radius R: its energy is m/2 v^2 + J/2 (v/R)^2."""
    m, J, R = 2.0, 0.03, 0.1
    bodies = {'crank': Body(1.0), 'coupler': Coupler(math.sqrt(2)), 'frame': Guide()}
    rolling = SliderCrank(**bodies, slider=Slider(mass=m + J / R**2), gravity=(0.0, 0.0))
    state = Solver(rolling).state(math.radians(45), 0.5, 1.0)
    power = (m * state.velocity[2] * state.acceleration[2]) + J / R**2 * (
        state.velocity[2] * state.acceleration[2]
    )
    assert state.torque * 0.5 == pytest.approx(power, rel=1e-14)


# Bad places on purpose.


def around(angle, exponents):
    """Angles at, and on both sides of, the change points of the last and the next two turns."""
    near = [0.0, *(sign * 10.0**-n for n in exponents for sign in (1, -1))]
    points = [angle + (k + 0.5) * math.pi for k in (-2, -1, 0, 1, 2)]
    return [point + x for point in points for x in near] + [-5.0, 1.9, 4.4, 11.0]


@pytest.mark.parametrize('assembly', ASSEMBLIES)
@pytest.mark.parametrize('angle', [0.0, 0.3, 5.5, -2.0])
@pytest.mark.parametrize('name', CHANGE_POINTS)
def test_change_points_are_hit_neared_and_passed(name, angle, assembly):
    solver = Solver(slider_crank(CHANGE_POINTS[name], angle, assembly))
    assert max(worst_errors(solver, around(angle, (3, 7, 9, 12, 15)), 2.0, 1.5)) < 1e-13


@pytest.mark.parametrize('assembly', ASSEMBLIES)
@pytest.mark.parametrize('name', CHANGE_POINTS)
def test_change_points_are_neared_as_closely_as_doubles_can(name, assembly):
    """pi/2 lies 6.123e-17 above its double: the guide's angle can take that up, to 1e-33 rad."""
    lack = 6.123233995736766e-17
    for below in (lack, math.nextafter(lack, 1), math.nextafter(lack, 0), lack / 2):
        solver = Solver(slider_crank(CHANGE_POINTS[name], -below, assembly))
        near = [x + s * d for x in (math.pi / 2,) for s in (1, -1) for d in (0.0, 3e-16, 1e-14)]
        assert max(worst_errors(solver, near, 2.0, 1.5)) < 1e-13
        solver = Solver(slider_crank(CHANGE_POINTS[name], below, assembly))
        assert max(worst_errors(solver, [-x for x in near], 2.0, 1.5)) < 1e-13


@pytest.mark.parametrize('assembly', ASSEMBLIES)
@pytest.mark.parametrize('sign', [1, -1])
@pytest.mark.parametrize('name', CHANGE_POINTS)
def test_guide_across_the_x_axis_takes_tiny_crank_angles(name, sign, assembly):
    """The change point is at crank 0, up to 6e-17 rad, and angles there can be any size."""
    solver = Solver(slider_crank(CHANGE_POINTS[name], sign * math.pi / 2, assembly))
    near = [0.0, 1e-16, -1e-16, 1e-20, -1e-50, 1e-100, -1e-150, 1e-160, -1e-200, -1e-300, 1e-300]
    assert max(worst_errors(solver, near, 2.0, 1.5)) < 1e-13
    near = [x + sign * 6.123233995736766e-17 for x in near[2:]]
    assert max(worst_errors(solver, near, 2.0, 1.5)) < 1e-13


@pytest.mark.parametrize('turns', [1, -1, 2, 159])
@pytest.mark.parametrize('name', CHANGE_POINTS)
def test_branch_does_not_depend_on_turns_in_the_angle_of_the_guide(name, turns):
    solver = Solver(slider_crank(CHANGE_POINTS[name], 0.3 + turns * TURN))
    assert max(worst_errors(solver, [-2.0, 0.3, 1.0, 3.0, 5.0, 9.0], 2.0, 1.5)) < 1e-13


@pytest.mark.parametrize('halves', [-7, -3, -1, 1, 3, 5, 7, 99])
@pytest.mark.parametrize('name', ['upper', 'lower'])
def test_branch_is_the_one_of_the_nearest_turn_at_half_turns_of_the_guide(name, halves):
    """No double is an odd multiple of pi: the branch changes from one double to the next."""
    rounded = halves * math.pi
    for angle in (rounded, math.nextafter(rounded, 1e3), math.nextafter(rounded, -1e3)):
        solver = Solver(slider_crank(CHANGE_POINTS[name], angle))
        assert max(worst_errors(solver, [0.3, 2.0, 5.0], 2.0, 1.5, period=6)) < 1e-13


@pytest.mark.parametrize('assembly', ASSEMBLIES)
@pytest.mark.parametrize(
    'text',
    [
        '.1 .3 .2', '.1 .3 -.2', '.2 .3 .1', '.2 .3 -.1', '.7 .8 .1', '.1 .8 -.7', '1.1 3.3 2.2',
        '.0001 .0003 .0002', '110 330 220', '.3 .3 0',
    ],
)  # fmt: skip
def test_lengths_typed_in_decimals_meet_the_change_point_that_was_meant(text, assembly):
    meant = [Fraction(x) for x in text.split()]
    oracle = SliderOracle(slider_crank(meant, 0.3, assembly), meant)
    assert oracle.upper or oracle.lower
    solver = Solver(oracle.mechanism)
    assert solver.mobility.grashof == 'change-point'
    assert solver.mobility.turns_fully
    errors = worst_errors(solver, around(0.3, (3, 8, 12, 15)), 2.0, 1.5, meant)
    assert max(errors) < 1e-13


def test_one_of_those_decimals_does_miss_its_equality_in_binary():
    assert Fraction(0.1) + Fraction(0.2) != Fraction(0.3)
    (words,) = Solver(slider_crank((0.1, 0.3, 0.2))).mobility.equalities
    assert 'counts as 0' in words


@pytest.mark.parametrize('assembly', ASSEMBLIES)
@pytest.mark.parametrize('offset', [1e-300, -1e-17, 4e-16])
def test_offset_below_4_ulp_of_the_crank_counts_as_none_where_that_meets_equalities(
    offset, assembly
):
    solver = Solver(slider_crank((1, 1, offset), 0.3, assembly))
    assert solver.mobility.grashof == 'change-point'
    assert solver.mobility.period_turns == 1
    errors = worst_errors(solver, around(0.3, (3, 8, 12, 15)), 2.0, 1.5, (1, 1, 0))
    assert max(errors) < 1e-13


@pytest.mark.parametrize('assembly', ASSEMBLIES)
@pytest.mark.parametrize('gap', [1e-14, 1e-10, 1e-6])
@pytest.mark.parametrize('name', CHANGE_POINTS)
def test_lengths_a_little_off_a_change_point_keep_all_digits(name, gap, assembly):
    tried = 0
    for link in range(3):
        for sign in (1, -1):
            lengths = [float(x) for x in CHANGE_POINTS[name]]
            lengths[link] += sign * gap
            solver = Solver(slider_crank(lengths, 0.3, assembly))
            oracle = SliderOracle(solver.mechanism)
            if solver.mobility.turns_fully:
                assert not oracle.upper
                assert not oracle.lower
                tried += 1
                width = math.sqrt(gap)
                angles = [0.3 + math.pi / 2 + x for x in (0.0, width, -width / 3, gap)]
                angles += [x + math.pi for x in angles] + [2.0]
                assert max(worst_errors(solver, angles, 2.0, 1.5)) < 1e-13
    assert tried >= 2 or name == 'both'


GAPS = 0.0, 2.0**-7, 2.0**-20, 2.0**-33, 2.0**-46


@pytest.mark.parametrize('assembly', ASSEMBLIES)
@pytest.mark.parametrize('offset', [-x for x in GAPS[1:]] + [*GAPS])
@pytest.mark.parametrize('longer', GAPS)
def test_nearly_centric_mechanisms_of_nearly_equal_links_keep_all_digits(longer, offset, assembly):
    """Coupler nearly as long as the crank, hardly an offset: B passes A0 closely."""
    for r in (1.0, 1.3):
        solver = Solver(slider_crank((r, r + longer, offset), 0.3, assembly))
        assert Fraction(r + longer) - Fraction(r) == Fraction(longer)
        if solver.mobility.turns_fully:
            close = [math.sqrt(x) * f for x in {longer, abs(offset)} for f in (0.3, -1.0, 2.0)]
            quarter = 0.3 + math.pi / 2
            angles = [0.3, 2.0, *(x + y for x in (quarter, quarter + math.pi) for y in close)]
            assert max(worst_errors(solver, angles, 2.0, 1.5, period=6)) < 1e-13


@pytest.mark.parametrize('ratio', [1e-1, 1e-2, 1e-4, 1e-6, 1e-8])
@pytest.mark.parametrize('place', ['crank', 'offset', 'slack'])
def test_odd_proportions_keep_all_digits(place, ratio):
    lengths = {
        'crank': (ratio, 1, 0.4),
        'offset': (0.7, 1, ratio),
        'slack': (ratio, 1 + 2 * ratio, -1),
    }[place]
    solver = Solver(slider_crank(lengths))
    angles = [-3.0, -1.5, 0.3, 1.0, 2.0, 3.4, 5.0]
    assert max(worst_errors(solver, angles, 2.0, 1.5)) < 1e-13


@pytest.mark.parametrize('unit', [1e-6, 1e-3, 1e3, 1e6])
@pytest.mark.parametrize('name', FULL)
def test_tiny_and_huge_mechanisms_are_right(name, unit):
    solver = Solver(slider_crank(FULL[name], unit=unit))
    assert max(worst_errors(solver, [-3.0, 0.3, 1.0, 4.0, 9.0], 2.0, 1.5)) < 1e-13


# What the crank can do.


@given(st.integers(1, 40), st.integers(1, 40), st.integers(-40, 40))
def test_class_and_period_follow_from_the_lengths(r, b, offset):
    """On whole numbers, where sums are exact."""
    e = abs(offset)
    if e >= r + b:
        return
    found = Solver(slider_crank((r, b, offset))).mobility
    if b == r + e or r == b + e:
        assert found.grashof == 'change-point'
    elif b > r + e:
        assert found.grashof == 'crank-slider'
    elif b + e < r:
        assert found.grashof == 'rotating-coupler'
    else:
        assert found.grashof == 'non-Grashof'
    assert found.turns_fully == (b >= r + e)
    if found.turns_fully:
        assert found.period_turns == (2 if b == r + e and e else 1)
        assert found.arcs == ((0.0, TURN),)
        assert not found.limits
    else:
        assert len(found.arcs) == (2 if b + e < r else 1)
        assert found.limits


@pytest.mark.parametrize('angle', [0.3, 5.5])
@pytest.mark.parametrize('assembly', ASSEMBLIES)
@pytest.mark.parametrize('name', BOTH_KINDS)
def test_period_is_the_fewest_turns_after_which_the_motion_repeats(name, assembly, angle):
    solver = Solver(slider_crank(BOTH_KINDS[name], angle, assembly))
    oracle = SliderOracle(solver.mechanism)
    start = oracle.state(1.0).position
    repeats = []
    for turns in (1, 2):
        after = oracle.state(1.0 + turns * TURN).position
        turned = abs(mp.expj(start[1]) - mp.expj(after[1]))
        repeats.append(max(turned, abs(start[2] - after[2])) < 1e-12)
    assert repeats.index(True) + 1 == solver.mobility.period_turns


@pytest.mark.parametrize('assembly', ASSEMBLIES)
@pytest.mark.parametrize('name', ['upper', 'lower'])
def test_one_turn_past_one_change_point_is_the_other_assembly(name, assembly):
    other = {'open': 'crossed', 'crossed': 'open'}[assembly]
    later = Solver(slider_crank(CHANGE_POINTS[name], 0.0, assembly)).state(1.0 + TURN).position
    now = Solver(slider_crank(CHANGE_POINTS[name], 0.0, other)).state(1.0).position
    assert later[1:] == pytest.approx(now[1:], abs=1e-14)


def test_folded_mechanism_keeps_its_slider_at_the_crank_pivot():
    state = Solver(slider_crank((1, 1, 0), 0.3, 'crossed')).state(np.linspace(-7, 7, 200), 2.0)
    for values in (state.position[2], state.velocity[2], state.acceleration[2]):
        assert np.max(np.abs(values)) < 1e-14


def end_by_bisection(oracle, inside, outside):
    """Where the loop just closes between two angles, by nothing but trying."""
    assert oracle.closes(inside)
    assert not oracle.closes(outside)
    with mp.workdps(50):
        inside, outside = mp.mpf(inside), mp.mpf(outside)
        for _ in range(100):
            middle = (inside + outside) / 2
            if oracle.closes(middle):
                inside = middle
            else:
                outside = middle
        return inside


@pytest.mark.parametrize('angle', [0.0, 0.3, -2.5, 5.5, 100.0])
@pytest.mark.parametrize('name', LIMITED)
def test_ends_of_the_reach_are_where_the_loop_just_closes(name, angle):
    solver = Solver(slider_crank(LIMITED[name], angle))
    oracle = SliderOracle(solver.mechanism)
    assert not solver.mobility.turns_fully
    for start, end in solver.mobility.arcs:
        assert 0 <= start < TURN
        assert start < end < start + TURN
        step = 0.1 * min(end - start, TURN - (end - start))
        for limit, out in ((start, -step), (end, step)):
            exact = end_by_bisection(oracle, limit - out, limit + out)
            # Besides the rounding of the angles: the limit is where sin(alpha) = (e -+ b)/r,
            # and an ulp or two of the lengths is carried into it.
            slope = 1 / (LIMITED[name][0] * abs(math.cos(oracle.alpha(exact))))
            longest = max(abs(x) for x in LIMITED[name])
            rounding = math.ulp(limit) + 2 * math.ulp(angle) + 2 * slope * math.ulp(longest)
            assert abs(exact - mp.mpf(limit)) <= rounding


@given(
    st.integers(1, 40), st.integers(1, 40), st.integers(-40, 40), st.floats(-7, 7),
    st.sampled_from(ASSEMBLIES),
)  # fmt: skip
def test_crank_reaches_just_where_the_loop_closes(r, b, offset, angle, assembly):
    """The crank's circle, 48 angles of it, against the reach in closed form."""
    if abs(offset) >= r + b:
        return
    solver = Solver(slider_crank((r, b, offset), angle, assembly))
    oracle = SliderOracle(solver.mechanism)
    for i in range(48):
        crank = i * TURN / 48 + 0.01
        inside = any(
            start < crank + turn < end for start, end in solver.mobility.arcs for turn in (0, TURN)
        )
        near_an_end = any(
            abs(math.remainder(crank - end, TURN)) < 1e-9
            for arc in solver.mobility.arcs
            for end in arc
        )
        if solver.mobility.turns_fully or not near_an_end:
            assert oracle.closes(crank) == inside
            if inside:
                solver.state(crank)
            else:
                with pytest.raises(UnreachableError, match='cannot move at'):
                    solver.state(crank)


def distances_inside(arc, distances):
    start, end = arc
    inside = [start + x for x in distances] + [end - x for x in distances]
    return [x for x in inside if start < x < end]


@pytest.mark.parametrize('assembly', ASSEMBLIES)
@pytest.mark.parametrize('name', LIMITED)
def test_limited_crank_is_right_until_a_thousandth_of_a_radian_from_its_limit(name, assembly):
    solver = Solver(slider_crank(LIMITED[name], 0.3, assembly))
    assert not solver.mobility.turns_fully
    for arc in solver.mobility.arcs:
        for crank in distances_inside(arc, (1e-3, 1e-2, 0.1, 0.3, 1.0)):
            errors = worst_errors(solver, [crank], 2.0, 1.5, period=0, floor=1)
            assert max(errors) < 1e-12


def reference_row(oracle, crank):
    state = oracle.state(crank, 2.0, 1.5)
    return *state.position, *state.velocity, *state.acceleration, state.torque


def effect_of_one_ulp(mechanism, crank):
    """How far the exact state moves when the crank angle and each length move by one ulp."""
    oracle = SliderOracle(mechanism)
    base = reference_row(oracle, crank)
    moved = [reference_row(oracle, math.nextafter(crank, 0))]
    for link in range(3):
        lengths = list(oracle.lengths)
        lengths[link] += Fraction(math.ulp(float(lengths[link])))
        moved.append(reference_row(SliderOracle(mechanism, lengths), crank))
    effects = [sum(abs(row[i] - base[i]) for row in moved) for i in range(10)]
    return base, effects


@given(
    st.tuples(st.integers(20, 1000), st.integers(20, 1000), st.integers(-1000, 1000)),
    st.floats(0.01, 0.99),
    st.sampled_from([1e-2, 1e-4, 1e-6]),
    st.sampled_from([0.0, 0.3]),
)
def test_limited_crank_is_as_right_as_what_is_given(lengths, where, distance, angle):
    """Close to a limit all is 1/sqrt(distance): the input's rounding is seen, no more."""
    assume(abs(lengths[2]) < lengths[0] + lengths[1])
    solver = Solver(slider_crank([x / 1000 for x in lengths], angle))
    assume(not solver.mobility.turns_fully)
    start, end = solver.mobility.arcs[0]
    for crank in (start + where * (end - start), start + distance, end - distance):
        if start + 0.9 * distance < crank < end - 0.9 * distance:
            got = rows(solver.state(crank, 2.0, 1.5)).tolist()
            base, effects = effect_of_one_ulp(solver.mechanism, crank)
            for i, (x, right, effect) in enumerate(zip(got, base, effects, strict=True)):
                error = abs(wrap(x - right)) if i == 1 else abs(x - right)
                # A crank longer than the coupler loses as many ulp as it is longer.
                longer = max(1, lengths[0] / lengths[1])
                assert error <= longer * (4 * effect + 1e-14 * (1 + abs(right)))


@pytest.mark.parametrize('lengths', [(1, 0.01, 0.995), (1, 0.001, -0.9995), (1, 0.01, 0)])
def test_long_limited_crank_on_a_short_arc_keeps_its_digits(lengths):
    solver = Solver(slider_crank(lengths))
    for start, end in solver.mobility.arcs:
        cranks = [start + part * (end - start) for part in (0.1, 0.2, 0.5, 0.8)]
        assert max(worst_errors(solver, cranks, 2.0, 1.5, period=0, floor=1)) < 1e-12


@pytest.mark.parametrize('angle', [0.0, 0.3])
@pytest.mark.parametrize('ratio', [1e-2, 1e-4, 1e-6])
def test_crank_far_longer_than_its_coupler_loses_its_angles_rounding_and_no_more(ratio, angle):
    """On an arc of 2 b/r rad one rounding of the crank angle is seen r/b times as large."""
    solver = Solver(slider_crank((1, ratio, 0), angle))
    cranks = [angle + ratio * x for x in (-0.9, -0.5, -0.1, 0.3, 0.7, 0.95)]
    errors = worst_errors(solver, cranks, 2.0, 1.5, period=0, floor=1)
    assert max(errors) < 32 * math.ulp(1.0) / ratio


@pytest.mark.parametrize('assembly', ASSEMBLIES)
@pytest.mark.parametrize('angle', [0.0, 0.3])
@pytest.mark.parametrize(
    ('lengths', 'quarter'), [((3, 2, 1), 1), ((3, 2, -1), -1), ((0.3, 0.1, 0.2), 1)]
)
def test_limited_crank_passes_the_change_point_inside_its_arc(lengths, quarter, angle, assembly):
    meant = [Fraction(str(x)) for x in lengths]
    solver = Solver(slider_crank(lengths, angle, assembly))
    assert not solver.mobility.turns_fully
    assert solver.mobility.grashof == 'change-point'
    point = angle + quarter * math.pi / 2
    near = [point + x for x in (-0.1, -1e-9, 0.0, 1e-15, 1e-12, 0.1)]
    assert max(worst_errors(solver, near, 2.0, 1.5, meant, period=0)) < 1e-13
    across = [solver.state(point + x).position[2] for x in (-0.1, 0.1)]
    guide_axis = [across[i] - lengths[0] * math.cos(quarter * math.pi / 2 + x)
                  for i, x in enumerate((-0.1, 0.1))]  # fmt: skip
    assert guide_axis[0] * guide_axis[1] < 0


@pytest.mark.parametrize('assembly', ASSEMBLIES)
@pytest.mark.parametrize('name', LIMITED)
def test_out_of_reach_is_an_error_with_the_reach(name, assembly):
    solver = Solver(slider_crank(LIMITED[name], 0.3, assembly))
    arcs = solver.mobility.arcs
    for start, end in arcs:
        for outside in (start - 1e-12, start - 1e-3, end + 1e-12, end + 1e-3):
            for form in (float, lambda x: np.array([x])):
                with pytest.raises(
                    UnreachableError, match=r'cannot move at .* deg: .*; it reaches'
                ) as error:
                    solver.state(form(outside), 1.0)
                assert error.value.crank_angle == outside
                assert error.value.arcs == arcs
                assert '\n' not in str(error.value)


@pytest.mark.parametrize('name', LIMITED)
def test_full_turn_of_a_limited_crank_is_refused(name):
    with pytest.raises(MechanismError, match='cannot turn fully: '):
        Solver(slider_crank(LIMITED[name])).require_full_turn()


@pytest.mark.parametrize('lengths', [(1, 2, 3.5), (1, 2, -3.5), (0.1, 0.2, 7)])
def test_offset_out_of_reach_is_refused_when_described(lengths):
    with pytest.raises(MechanismError, match='offset') as error:
        slider_crank(lengths)
    words = str(error.value)
    assert '\n' not in words
    assert f'{lengths[2]:g} m' in words
    assert f'by {abs(lengths[2]) - lengths[0] - lengths[1]:g} m' in words


def test_offset_just_in_reach_leaves_one_rigid_position():
    """Offset = crank + coupler: stretched straight across the guide, with no finite rate."""
    for crank in (math.pi / 2, np.full(2, math.pi / 2)):
        with pytest.raises(UnreachableError, match='cannot move at 90 deg'):
            Solver(slider_crank((1, 2, 3), 0.0)).state(crank)
