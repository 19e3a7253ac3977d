# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Pins and traced coupler points of both mechanisms, against 50 digits and as derivatives."""

from __future__ import annotations

import cmath
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mechanisms import (
    PUMPS,
    TURN,
    asked_of_oracle,
    four_bar,
    last_pin,
    motion,
    moving,
    oracle_of,
    path,
    slider_crank,
    turned,
    wind_pumps,
)
from mpmath import mp
from oracle_forces import points

from linkage_ros import ConfigurationError, FourBar, SliderCrank, Solver, WindPump

MOTION = 2.0, 1.5


MECHANISMS = {
    'crank_rocker': four_bar((1, 3, 2.5, 2.2)),
    'crank_rocker_crossed': four_bar((1, 3, 2.5, 2.2), 5.5, 'crossed'),
    'double_crank': four_bar((3, 2.5, 2.2, 1), -2.0, point=(-1.5, 0.0)),
    'parallelogram': four_bar((1, 2, 1, 2)),
    'antiparallelogram': four_bar((1, 2, 1, 2), 0.0, 'crossed'),
    'one_change_point': four_bar((1, 2.5, 1.5, 3), point=(0.0, -2.0)),
    'kite': four_bar((1, 2, 2, 1)),
    'centric': slider_crank((1, 2.5, 0), 0.0),
    'offset_left': slider_crank((1, 2.2, 0.7)),
    'offset_right_crossed': slider_crank((1, 2.2, -0.7), 5.5, 'crossed', point=(-0.5, 0.2)),
    'inclined_by_turns': slider_crank((0.5, 3, 1.5), 0.3 + 40 * TURN),
    'equal_links': slider_crank((1, 1, 0)),
    'folded': slider_crank((1, 1, 0), -2.0, 'crossed'),
    'upper_change_point': slider_crank((1, 1.5, -0.5)),
    'lower_change_point': slider_crank((0.5, 2.5, 2), 2.0, 'crossed'),
    **{
        name: replace(pump, coupler=replace(pump.coupler, point=(0.4, 0.7)))
        for name, pump in PUMPS.items()
    },
}
mechanisms = pytest.mark.parametrize('name', MECHANISMS)


def pairs(motion):
    """Position, velocity and acceleration as an array of complex numbers."""
    return np.array([np.asarray(x) + 1j * np.asarray(y) for x, y in motion])


def around_change_points(mechanism):
    """Two turns, with all places where a crank may stand along its frame or across its guide."""
    frame = 0.0 if isinstance(mechanism, WindPump) else mechanism.frame.angle
    places = [frame % TURN + i * math.pi / 2 for i in range(-4, 5)]
    return np.array([x + y for x in places for y in (0.0, -1e-5, 1.1)])


def worst_error(mechanism, cranks, speed=2.0, acceleration=1.5):
    """Over all points, the largest error relative to each quantity's largest length."""
    oracle, solver = oracle_of(mechanism), Solver(mechanism)
    states = [moving(solver, x, speed, acceleration) for x in cranks.tolist()]
    together = moving(solver, cranks, speed, acceleration)
    asked = [asked_of_oracle(mechanism, x, speed, acceleration) for x in cranks.tolist()]
    references = [points(oracle, oracle.state(*x)) for x in asked]
    worst = 0.0
    for name in references[0]:
        one_by_one = np.array([pairs(solver.point(state, name)) for state in states]).T
        array = pairs(solver.point(together, name))
        for i in range(3):
            right = [reference[name][i] for reference in references]
            largest = max(abs(x) for x in right) or 1  # B of a folded slider-crank rests
            if largest < 1e-20:
                largest = mechanism.crank.length
            for got in (one_by_one[i], array[i]):
                errors = [abs(mp.mpc(x) - y) for x, y in zip(got.tolist(), right, strict=True)]
                worst = max(worst, float(max(errors) / largest))
    return worst


# The reference itself.


@mechanisms
def test_reference_points_are_each_others_derivatives(name):
    oracle = oracle_of(MECHANISMS[name])
    at = path(oracle, *asked_of_oracle(MECHANISMS[name], 2.047, 3.5, 2.0))

    def quantity(point, order, part):
        return lambda t: getattr(points(oracle, at(t))[point][order], part)

    with mp.workdps(60):
        for point in points(oracle, at(0)):
            for order in (0, 1):
                for part in ('real', 'imag'):
                    slope = mp.diff(quantity(point, order, part), 0)
                    assert abs(slope - quantity(point, order + 1, part)(0)) < 1e-35


@mechanisms
def test_reference_closes_its_loop(name):
    """The last pin is found through the rocker or the slider; the rod or coupler has to agree."""
    mechanism = MECHANISMS[name]
    oracle = oracle_of(mechanism)
    at = path(oracle, *asked_of_oracle(mechanism, 2.2, 3.0, 2.0))
    link, first = (2, 'B') if isinstance(mechanism, WindPump) else (1, 'A')
    with mp.workdps(60):
        length = mp.mpf(int(oracle.lengths[link].numerator)) / oracle.lengths[link].denominator

        def gap(t):
            place = {pin: motion[0] for pin, motion in points(oracle, at(t)).items()}
            reached = place[first] + length * mp.expj(at(t).position[link])
            return place[last_pin(mechanism)] - reached

        assert abs(gap(0)) < 1e-48
        for order in (1, 2):
            assert abs(mp.diff(gap, 0, order)) < 1e-20


# Against the reference.


@mechanisms
def test_points_are_right_around_two_turns(name):
    mechanism = MECHANISMS[name]
    assert worst_error(mechanism, around_change_points(mechanism)) < 1e-13


def test_comparison_catches_a_slip_of_a_part_in_1e12():
    """Negative control: the traced point is moved by 1e-12 m behind the reference's back."""
    mechanism = MECHANISMS['offset_left']
    slipped = replace(mechanism.coupler, point=(0.4 + 1e-12, 0.7))
    cranks = np.linspace(0.0, 6.0, 7)
    right = [points(oracle_of(mechanism), oracle_of(mechanism).state(x))['C'][0] for x in cranks]
    solver = Solver(replace(mechanism, coupler=slipped))
    got = pairs(solver.point(solver.state(cranks), 'C'))[0]
    assert 5e-13 < max(abs(x - complex(y)) for x, y in zip(got, right, strict=True)) < 2e-12


@settings(max_examples=15)
@given(wind_pumps(scales=10), st.lists(st.floats(-7, 7, width=16), min_size=4, max_size=4))
def test_points_of_any_wind_pump_are_right(pump, cranks):
    assert worst_error(pump, np.array([*cranks, *np.linspace(0.0, 12.0, 12)])) < 1e-13


lengths = st.integers(4, 256)
# Dyadic fractions, which leave no tiny numbers to underflow here.
angles = st.lists(st.integers(-7000, 7000).map(lambda x: x / 1024), min_size=4, max_size=4)
places = st.tuples(*[st.integers(-768, 768).map(lambda x: x / 256)] * 2)


@settings(max_examples=15)
@given(
    lengths, st.integers(-256, 256), st.integers(0, 512), places, angles,
    st.sampled_from(['open', 'crossed']),
)  # fmt: skip
def test_points_of_any_slider_crank_are_right(r, offset, slack, place, cranks, assembly):
    units = [x / 256 for x in (r, r + abs(offset) + slack, offset)]
    mechanism = slider_crank(units, 0.7, assembly, point=place)
    cranks = np.array([*cranks, *np.linspace(0.0, 12.0, 12)])
    assert worst_error(mechanism, cranks) < 1e-13


@settings(max_examples=15)
@given(
    lengths, lengths, lengths, st.floats(0, 1), places, angles,
    st.sampled_from(['open', 'crossed']),
)  # fmt: skip
def test_points_of_any_crank_rocker_are_right(r, b, c, part, place, cranks, assembly):
    """The shortest link is the crank, and the frame is anything that lets it turn."""
    r, b, c = sorted((r, b, c))
    d = max(r, c + r - b) + round(part * (b + c - r - max(r, c + r - b)))
    mechanism = four_bar([x / 256 for x in (r, b, c, d)], 0.7, assembly, point=place)
    assert Solver(mechanism).mobility.turns_fully
    cranks = np.array([*cranks, *np.linspace(0.0, 12.0, 12)])
    assert worst_error(mechanism, cranks) < 1e-13


@pytest.mark.parametrize(
    'mechanism',
    [
        four_bar((2, 1, 2.5, 3)), four_bar((2, 1.5, 1.2, 2.2), assembly='crossed'),
        slider_crank((2, 2.5, 1)), slider_crank((3, 1, 0.5), assembly='crossed'),
        slider_crank((3, 2, 1)),
    ],
)  # fmt: skip
def test_points_of_limited_cranks_are_right(mechanism):
    for start, end in Solver(mechanism).mobility.arcs:
        cranks = start + np.array([0.05, 0.3, 0.5, 0.8, 0.95]) * (end - start)
        assert worst_error(mechanism, cranks) < 1e-13


# Laws.


@mechanisms
def test_traced_point_at_the_end_of_the_coupler_is_B(name):
    mechanism = MECHANISMS[name]
    end = replace(mechanism.coupler, point=(mechanism.coupler.length, 0.0))
    solver = Solver(replace(mechanism, coupler=end))
    state = moving(solver, around_change_points(mechanism))
    B, C = (pairs(solver.point(state, x)) for x in ('B', 'C'))
    A = pairs(solver.point(state, 'A'))
    # B of a folded slider-crank rests at A0, where the crank's and coupler's motions cancel.
    largest = np.max(np.abs(A), axis=1, keepdims=True) + np.max(np.abs(B), axis=1, keepdims=True)
    assert np.max(np.abs(B - C) / largest) < 1e-14


@mechanisms
def test_traced_point_at_the_start_of_the_coupler_is_A(name):
    mechanism = MECHANISMS[name]
    start = replace(mechanism.coupler, point=(0.0, 0.0))
    solver = Solver(replace(mechanism, coupler=start))
    state = moving(solver, np.linspace(-6.0, 6.0, 25))
    A, C = (pairs(solver.point(state, x)) for x in ('A', 'C'))
    assert np.max(np.abs(A - C)) <= 4 * math.ulp(np.max(np.abs(A)))


@mechanisms
def test_pins_keep_their_distances(name):
    mechanism = MECHANISMS[name]
    solver = Solver(mechanism)
    state = moving(solver, np.linspace(-6.0, 6.0, 49))
    A, B, C = (pairs(solver.point(state, x))[0] for x in ('A', 'B', 'C'))
    longest = max(mechanism.coupler.length, np.max(np.abs(B)))
    tolerance = 8 * math.ulp(longest)
    assert np.max(np.abs(np.abs(A) - mechanism.crank.length)) <= tolerance
    assert np.max(np.abs(np.abs(B - A) - mechanism.coupler.length)) <= tolerance
    assert np.max(np.abs(np.abs(C - A) - abs(complex(*mechanism.coupler.point)))) <= tolerance
    if isinstance(mechanism, WindPump):
        D, slide = pairs(solver.point(state, 'D'))[0], state.position[3]
        assert np.max(np.abs(np.abs(D - B) - mechanism.rod.length)) <= tolerance
        assert np.max(np.abs(D - slide)) <= tolerance
    elif isinstance(mechanism, SliderCrank):
        across = (B * cmath.exp(-1j * mechanism.frame.angle)).imag
        assert np.max(np.abs(across - mechanism.slider.offset)) <= tolerance
    else:
        pivot = cmath.rect(mechanism.frame.length, mechanism.frame.angle)
        assert np.max(np.abs(np.abs(B - pivot) - mechanism.rocker.length)) <= tolerance


@mechanisms
def test_turned_mechanism_turns_its_points(name):
    """By a right angle or half a turn, which swap coordinates but for the angle's own rounding."""
    mechanism = MECHANISMS[name]
    by, factor = (-math.pi, -1) if isinstance(mechanism, WindPump) else (-math.pi / 2, -1j)
    solver, other = Solver(mechanism), Solver(turned(mechanism, by))
    cranks = np.linspace(-6.0, 6.0, 25)
    q, u, _ = motion(mechanism, cranks)
    image = (cranks + by, *(-x for x in q[1:])), (u[0], *(-x for x in u[1:]))
    before, after = moving(solver, cranks), moving(other, image[0][0], *MOTION, *image)
    far = not isinstance(mechanism, WindPump) and mechanism.frame.angle > 100
    for point in ('A', last_pin(mechanism), 'B', 'C'):
        got = pairs(other.point(after, point))
        expected = factor * pairs(solver.point(before, point))
        size = np.max(np.abs(expected), axis=1, keepdims=True) + mechanism.crank.length
        assert np.max(np.abs(got - expected) / size) < (1e-13 if far else 2e-14)


def test_point_of_document_2_at_the_middle_of_the_coupler_is_the_mean_of_its_pins():
    mechanism = four_bar((0.1, 0.315, 0.5, 0.425), 5.497787143782138, point=(0.1575, 0.0))
    solver = Solver(mechanism)
    state = solver.state(np.linspace(0.0, 6.2, 33), 5 * math.pi)
    A, B, C = (pairs(solver.point(state, x)) for x in ('A', 'B', 'C'))
    size = np.max(np.abs(C), axis=1, keepdims=True)
    assert np.max(np.abs((A + B) / 2 - C) / size) < 1e-14


# Ways of asking.


@mechanisms
@pytest.mark.parametrize('point', ['A', 'B', 'C'])
def test_scalars_and_arrays_agree_to_a_few_ulp(name, point):
    solver = Solver(MECHANISMS[name])
    cranks = np.linspace(-7.0, 14.0, 301)
    together = moving(solver, cranks)
    array = pairs(solver.point(together, point))
    one_by_one = [pairs(solver.point(moving(solver, x), point)) for x in cranks.tolist()]
    # B of a folded slider-crank rests at A0: its motion is a difference from A's.
    largest = sum(
        np.max(np.abs(pairs(solver.point(together, x))), axis=1, keepdims=True)
        for x in {point, 'A'}
    )
    assert np.all(np.abs(np.array(one_by_one).T - array) <= 8 * np.spacing(largest))


@mechanisms
@pytest.mark.parametrize('point', ['A', 'B', 'C'])
def test_floats_give_floats_and_arrays_their_shape(name, point):
    solver = Solver(MECHANISMS[name])
    found = solver.point(moving(solver, 0.7), point)
    assert {type(x) for pair in found for x in pair} == {float}
    assert found == (found.position, found.velocity, found.acceleration)
    for crank, speed, shape in (
        (np.ones((2, 3)), 2.0, (2, 3)),
        (np.ones((3, 0)), 2.0, (3, 0)),
        (0.7, np.array([1.0, -2.0]), (2,)),
        (np.array([[0.7], [1.0], [2.0]]), np.array([1.0, -2.0]), (3, 2)),
    ):
        found = solver.point(moving(solver, crank, speed), point)
        assert {np.shape(x) for pair in found for x in pair} == {shape}


def valid_names(mechanism):
    more = {FourBar: {'B0'}, SliderCrank: set(), WindPump: {'D'}}[type(mechanism)]
    return {'A0', 'A', 'B'} | more | ({'C'} if mechanism.coupler.point is not None else set())


def refusal(solver, name):
    """The words of the error, and the names that it lists."""
    with pytest.raises(ConfigurationError, match=r"^point '.*': must be one of ") as error:
        solver.point(moving(solver, 0.7), name)
    words = str(error.value)
    assert '\n' not in words
    return words, set(words.partition('must be one of ')[2].split(', '))


@mechanisms
@pytest.mark.parametrize('wrong', ['E', 'a', '', 'C0'])
def test_unknown_point_is_refused_with_the_names_there_are(name, wrong):
    words, names = refusal(Solver(MECHANISMS[name]), wrong)
    assert names == valid_names(MECHANISMS[name])
    assert repr(wrong) in words


@mechanisms
def test_point_that_is_not_traced_has_no_name(name):
    mechanism = MECHANISMS[name]
    untraced = replace(mechanism, coupler=replace(mechanism.coupler, point=None))
    solver = Solver(untraced)
    _, names = refusal(solver, 'C')
    assert names == valid_names(untraced) == valid_names(mechanism) - {'C'}
    state = moving(solver, 0.7)
    assert solver.point(state, 'B') == Solver(mechanism).point(state, 'B')


@mechanisms
def test_pivots_rest(name):
    mechanism = MECHANISMS[name]
    solver = Solver(mechanism)
    places = {'A0': 0}
    if isinstance(mechanism, FourBar):
        frame = mechanism.frame
        places['B0'] = cmath.rect(frame.length, frame.angle)
    for pivot, place in places.items():
        for crank in (0.7, np.array([0.7, 2.0])):
            found = pairs(solver.point(moving(solver, crank), pivot))
            assert np.max(np.abs(found[0] - place)) <= 1e-15 * abs(place)
            assert np.all(found[1:] == 0)


@pytest.mark.parametrize('tiny', [1e-300, -3e-308, 5e-324])
def test_tiny_crank_angles_do_not_underflow(tiny):
    for mechanism in (slider_crank((0.7, 2, 0), 0.0), four_bar((0.7, 2, 1.8, 1.5), 0.0)):
        solver = Solver(mechanism)
        for crank in (tiny, np.array([tiny, 1.0])):
            state = solver.state(crank, *MOTION)
            for point in ('A', 'B', 'C'):
                assert np.all(np.isfinite(pairs(solver.point(state, point))))
