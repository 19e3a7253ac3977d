# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Places, rates, accelerations and torque of slider-cranks against 50 digits, and their laws."""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction

import mechanisms
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from mechanisms import ASSEMBLIES, TURN, full_slider_cranks, rows, slider_crank, worst_errors
from oracle import wrap
from oracle_slider import SliderOracle

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


def three(table):
    """Those of crank, coupler and offset."""
    return {name: lengths for name, lengths in table.items() if len(lengths) == 3}


FULL, LIMITED = three(mechanisms.FULL), three(mechanisms.LIMITED)
CHANGE_POINTS = three(mechanisms.CHANGE_POINTS)
BOTH_KINDS = {**FULL, **CHANGE_POINTS}
angles_of_two_turns = st.floats(-TURN, TURN, allow_subnormal=False)


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
    angles = [math.radians(degrees) for degrees in range(0, 360, 5)]
    assert max(worst_errors(Solver(mechanism), angles, 0.5, 1.0, period=0)) < 1e-13


def test_names_of_the_members_follow_the_chain():
    assert Solver(DOCUMENT).links == ('crank', 'coupler', 'slider')


# Work and energy.


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


@settings(max_examples=15)
@given(full_slider_cranks(), angles_of_two_turns)
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


@pytest.mark.parametrize('halves', [-7, 1, 99])
@pytest.mark.parametrize('name', ['upper', 'lower'])
def test_branch_is_the_one_of_the_nearest_turn_at_half_turns_of_the_guide(name, halves):
    """No double is an odd multiple of pi: the branch changes from one double to the next."""
    rounded = halves * math.pi
    for angle in (rounded, math.nextafter(rounded, 1e3), math.nextafter(rounded, -1e3)):
        solver = Solver(slider_crank(CHANGE_POINTS[name], angle))
        assert max(worst_errors(solver, [0.3, 2.0, 5.0], 2.0, 1.5, period=6)) < 1e-13


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
    errors = worst_errors(solver, around(0.3, (3, 8, 15)), 2.0, 1.5, (1, 1, 0))
    assert max(errors) < 1e-13


GAPS = 0.0, 2.0**-20, 2.0**-46


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


@pytest.mark.parametrize('ratio', [1e-2, 1e-8])
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


# What the crank can do.


@settings(max_examples=15)
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


def test_folded_mechanism_keeps_its_slider_at_the_crank_pivot():
    state = Solver(slider_crank((1, 1, 0), 0.3, 'crossed')).state(np.linspace(-7, 7, 200), 2.0)
    for values in (state.position[2], state.velocity[2], state.acceleration[2]):
        assert np.max(np.abs(values)) < 1e-14


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


@settings(max_examples=15)
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
    # Doubles that miss an equality by rounding stand for other lengths.
    assume(not solver.mobility.turns_fully and not solver.mobility.equalities)
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
