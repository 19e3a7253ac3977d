# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Angles, rates, accelerations and torque of four-bars against 50 digits, and their laws."""

from __future__ import annotations

import cmath
import itertools
import math
from fractions import Fraction

import mechanisms
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mechanisms import ASSEMBLIES, DOCUMENT_1, TURN, four_bar, rows, worst_errors
from oracle import Oracle, wrap

from linkage_ros import Body, ConfigurationError, Coupler, FourBar, Frame, Solver, UnreachableError

DOCUMENT_SPEED = 150 * TURN / 60
EVERYWHERE_OFF_CENTRE = FourBar(
    Frame(0.425, 5.497787143782138),
    Body(0.1, 1.3, 0.0245, (0.03, -0.02)),
    Coupler(0.315, 2.0, 0.016, (0.1575, 0.04)),
    Body(0.5, 3.5, 0.066, (0.25, -0.07)),
    gravity=(1.7, -9.5),
)
CHANGE_POINTS = [name for name, lengths in mechanisms.CHANGE_POINTS.items() if len(lengths) == 4]
# Document 1.


@pytest.mark.parametrize('assembly', ASSEMBLIES)
@pytest.mark.parametrize(
    ('mechanism', 'acceleration'),
    [(DOCUMENT_1, 0.0), (DOCUMENT_1, -40.0), (EVERYWHERE_OFF_CENTRE, 25.0)],
    ids=['document', 'accelerated', 'off_centre'],
)
def test_document_quadrilateral_is_right_over_the_turn(mechanism, acceleration, assembly):
    solver = Solver(with_assembly(mechanism, assembly))
    angles = [math.radians(degrees) for degrees in range(0, 360, 5)]
    errors = worst_errors(solver, angles, DOCUMENT_SPEED, acceleration, period=0)
    assert max(errors) < 1e-13


def with_assembly(mechanism, assembly):
    return FourBar(
        mechanism.frame, mechanism.crank, mechanism.coupler, mechanism.rocker, assembly,
        mechanism.gravity,
    )  # fmt: skip


@pytest.mark.parametrize(
    ('degrees', 'torque'),
    [(0, -6.83836258084855), (294, 8.47528439441018), (348, -8.54729141947142)],
)
def test_document_torque_has_its_known_values(degrees, torque):
    state = Solver(DOCUMENT_1).state(math.radians(degrees), DOCUMENT_SPEED)
    assert state.torque == pytest.approx(torque, rel=0, abs=1e-14 * 8.55)


def test_document_newton_method_agrees_to_its_tolerance_and_no_further():
    """Document 1's listing from its equations (1) to (18), 100 steps, tolerance 1e-3.

    Two slips of the listing are mended: eq. (10) has c in the Jacobian's second column, and
    the real part belongs there. The squared rates of eq. (18) take the listing's signs.
    """
    r, b, c, d, delta = 0.1, 0.315, 0.5, 0.425, 7 / 4 * math.pi
    w, tolerance = DOCUMENT_SPEED, 0.001
    unknown = np.array([math.radians(15), math.radians(100)])
    differences = []
    for alpha in np.arange(0, TURN, TURN / 100):
        change = residual = np.array([1.0, 1.0])
        while np.any(np.abs(change) > tolerance) or np.any(np.abs(residual) > tolerance):
            beta, gamma = (cmath.exp(1j * x) for x in unknown)
            f = r * cmath.exp(1j * alpha) + b * beta - c * gamma - d * cmath.exp(1j * delta)
            residual = np.array([f.real, f.imag])
            change = -np.linalg.solve(columns(1j * b * beta, -1j * c * gamma), residual)
            unknown = unknown + change
        crank, beta, gamma = (cmath.exp(1j * x) for x in (alpha, *unknown))
        system = columns(-1j * b * beta, 1j * c * gamma)
        right = 1j * r * w * crank
        beta1, gamma1 = np.linalg.solve(system, [right.real, right.imag])
        right = r * w**2 * crank + b * beta1**2 * beta - c * gamma1**2 * gamma
        beta2, gamma2 = -np.linalg.solve(system, [right.real, right.imag])
        v2 = 1j * w * r * crank + 1j * beta1 * b / 2 * beta
        v3 = 1j * gamma1 * c / 2 * gamma
        a2 = -(w**2) * r * crank + (1j * beta2 - beta1**2) * b / 2 * beta
        a3 = (1j * gamma2 - gamma1**2) * c / 2 * gamma
        power = 2.0 * (v2.conjugate() * (a2 + 9.81j)).real + 0.016 * beta1 * beta2
        power += 3.5 * (v3.conjugate() * (a3 + 9.81j)).real + 0.066 * gamma1 * gamma2
        differences.append(abs(Solver(DOCUMENT_1).state(float(alpha), w).torque - power / w))
    assert 1e-9 < max(differences) < 1.15e-6


def columns(first, second):
    return np.array([[first.real, second.real], [first.imag, second.imag]])


@pytest.mark.parametrize(
    ('assembly', 'coupler', 'rocker'), [('open', 88.84, 117.29), ('crossed', -115.21, -143.66)]
)
def test_norton_example_is_met_to_its_printed_digits(assembly, coupler, rocker):
    linkage = FourBar(Frame(6), Body(2), Coupler(7), Body(9), assembly)
    angle = Solver(linkage).state(math.radians(30)).position
    assert math.degrees(angle[1]) == pytest.approx(coupler, abs=0.005)
    assert math.degrees(angle[2]) == pytest.approx(rocker, abs=0.005)


# Ways of asking.


def test_angle_speed_and_acceleration_broadcast():
    solver = Solver(DOCUMENT_1)
    angles, speeds = np.array([[0.5], [1.0], [4.0]]), np.array([1.0, -2.0])
    state = solver.state(angles, speeds, 3.0)
    assert state.torque.shape == (3, 2)
    assert state.torque[2, 1] == pytest.approx(solver.state(4.0, -2.0, 3.0).torque, rel=1e-14)
    assert solver.state(0.5, speeds).velocity[2].shape == (2,)
    assert solver.state(0.5, 1.0, speeds).acceleration[0].tolist() == [1.0, -2.0]


@pytest.mark.parametrize('kind', [int, np.int64, np.float64, np.array])
def test_whole_numbers_and_zero_dimensions_give_the_same_floats(kind):
    solver = Solver(DOCUMENT_1)
    state = solver.state(kind(2), kind(3), kind(1))
    assert state == solver.state(2.0, 3.0, 1.0)
    assert {type(x) for x in rows(state).tolist()} == {float}
    assert type(state.torque) is float


# Bad places on purpose.


@pytest.mark.parametrize('assembly', ASSEMBLIES)
@pytest.mark.parametrize('name', CHANGE_POINTS)
def test_change_points_are_neared_to_1e_300_rad(name, assembly):
    solver = Solver(four_bar(mechanisms.CHANGE_POINTS[name], 0.0, assembly))
    near = [0.0, 1e-20, -1e-50, 1e-100, -1e-150, 1e-160, -1e-200, -1e-300, 1e-300]
    assert max(worst_errors(solver, near, 2.0, 1.5)) < 1e-13


@pytest.mark.parametrize('odd', [1, -1, 3, -7, 315])
@pytest.mark.parametrize('name', ['p0', 'q0_rocker_longest', 'kite_r_d'])
def test_frame_angle_of_half_turns_counts_as_the_nearer_to_zero(name, odd):
    """The double nearest to 3 pi lies below it: it stands for almost pi, not for -pi."""
    solver = Solver(four_bar(mechanisms.CHANGE_POINTS[name], odd * math.pi))
    assert max(worst_errors(solver, [-2.0, 0.3, 1.0, 3.0, 5.0, 9.0], 2.0, 1.5)) < 1e-13


GAPS = 0.0, 2.0**-7, 2.0**-33, 2.0**-46


@pytest.mark.parametrize('assembly', ASSEMBLIES)
@pytest.mark.parametrize('first', GAPS)
@pytest.mark.parametrize('second', GAPS)
def test_nearly_concentric_linkages_keep_all_digits(first, second, assembly):
    """Crank nearly as long as the frame, coupler as the rocker: A passes B0 closely."""
    for frame, coupler in ((1.3, 2.7), (2.7, 1.3)):
        for signs in itertools.product((1, -1), repeat=2):
            lengths = frame + signs[0] * first, coupler, coupler + signs[1] * second, frame
            assert Fraction(lengths[0]) - Fraction(frame) == signs[0] * Fraction(first)
            solver = Solver(four_bar(lengths, 0.3, assembly))
            if solver.mobility.turns_fully:
                close = [x * gap for gap in {first, second} for x in (0.1, -0.7, 1.0, 4.0)]
                angles = [0.3, 0.3 + 1e-9, 2.0, *(0.3 + x for x in close)]
                assert max(worst_errors(solver, angles, 2.0, 1.5, period=6)) < 1e-13


@pytest.mark.parametrize('assembly', ASSEMBLIES)
@pytest.mark.parametrize('gap', ['1e-6', '1e-14'])
def test_nearly_concentric_linkage_in_decimals_loses_only_what_its_doubles_lose(gap, assembly):
    """Typing 1.000001 m moves r - d by half an ulp of 1 m; the motion depends on (r - d)/gap."""
    meant = 1 + Fraction(gap), 2, 2 + Fraction(gap), 1
    solver = Solver(four_bar(meant, 0.3, assembly))
    angles = [0.3 + x * float(gap) for x in (0.0, 0.1, -0.5, 1.0, 5.0)] + [1.0, 3.0]
    errors = worst_errors(solver, angles, 2.0, 1.5, meant)
    assert max(errors) < max(1e-13, 4 * math.ulp(1.0) / float(gap))


@pytest.mark.parametrize('assembly', ASSEMBLIES)
@pytest.mark.parametrize('power', [10, 30, 44, 46])
def test_loop_closes_where_doubles_miss_an_equality_by_an_ulp_or_two(power, assembly):
    """Below 4 ulp the equality counts as met, also where d - r itself is not much more."""
    gap = 2.0**-power
    for signs in itertools.product((1, -1), repeat=2):
        for ulps in (-1, 1):
            lengths = 1 + signs[0] * gap, 2, 2 + signs[1] * gap + ulps * math.ulp(1.0) * 2, 1
            solver = Solver(four_bar(lengths, 0.3, assembly))
            assert solver.mobility.grashof == 'change-point'
            for part in (0.0, 0.1, -0.4, 1.0, 3.0, 100.0):
                crank = 0.3 + part * gap
                vectors = zip(solver.state(crank).position, lengths, strict=False)
                A, coupler, rocker = (cmath.rect(length, angle) for angle, length in vectors)
                assert abs(A + coupler - rocker - cmath.exp(0.3j)) <= 8 * math.ulp(2.0)


@pytest.mark.parametrize('ratio', [1e-2, 1e-8])
@pytest.mark.parametrize('place', ['crank', 'frame'])
def test_short_cranks_and_frames_keep_all_digits(place, ratio):
    lengths = (ratio, 1, 1.2, 0.9) if place == 'crank' else (0.9, 1, 1.2, ratio)
    solver = Solver(four_bar(lengths))
    angles = [-3.0, -1.5, 0.3, 1.0, 2.0, 3.4, 5.0]
    assert max(worst_errors(solver, angles, 2.0, 1.5)) < 1e-13


# Cranks that do not turn fully.


def effect_of_one_ulp(linkage, crank):
    """How far the exact state moves when each length moves by one ulp."""
    oracle = Oracle(linkage)
    base = reference_row(oracle, crank)
    moved = [0] * 10
    for link in range(4):
        lengths = list(oracle.lengths)
        lengths[link] += Fraction(math.ulp(float(lengths[link])))
        after = reference_row(Oracle(linkage, lengths), crank)
        after = [x - y for x, y in zip(after, base, strict=True)]
        after[:3] = [wrap(x) for x in after[:3]]
        moved = [total + abs(x) for total, x in zip(moved, after, strict=True)]
    return base, moved


def reference_row(oracle, crank):
    state = oracle.state(crank, 2.0, 1.5)
    return *state.position, *state.velocity, *state.acceleration, state.torque


@settings(max_examples=15)
@given(
    st.tuples(*[st.integers(20, 1000)] * 4), st.floats(0, 1), st.sampled_from([1e-2, 1e-4, 1e-6])
)
def test_limited_crank_is_as_right_as_its_lengths(lengths, where, distance):
    """Close to a limit all is 1/sqrt(distance): the rounding of the lengths is seen, no more."""
    if max(lengths) * 2 >= sum(lengths):
        return
    solver = Solver(four_bar([x / 1000 for x in lengths]))
    if solver.mobility.turns_fully or solver.mobility.equalities:
        return  # doubles that miss an equality by rounding stand for other lengths
    start, end = solver.mobility.arcs[0]
    for crank in (start + where * (end - start), start + distance, end - distance):
        if start + 0.9 * distance < crank < end - 0.9 * distance:
            got = rows(solver.state(crank, 2.0, 1.5))
            base, moved = effect_of_one_ulp(solver.mechanism, crank)
            for i, (x, right, effect) in enumerate(zip(got.tolist(), base, moved, strict=True)):
                error = abs(wrap(x - right)) if i < 3 else abs(x - right)
                assert error <= 4 * effect + 1e-14 * (1 + abs(right))


@pytest.mark.parametrize('gap', [-1e-5, 1e-12, 0.0])
@pytest.mark.parametrize('coupler_rocker', [(2, 1.4), (1.4, 2), (0.7, 0.6), (0.3, 0.2)])
def test_limited_crank_as_long_as_the_frame_keeps_its_digits(coupler_rocker, gap):
    for assembly in ASSEMBLIES:
        solver = Solver(four_bar((1 + gap, *coupler_rocker, 1), 0.3, assembly))
        assert not solver.mobility.turns_fully
        for start, end in solver.mobility.arcs:
            for part in (0.1, 0.51):
                crank = start + part * (end - start)
                errors = worst_errors(solver, [crank], 2.0, 1.5, period=0, floor=1)
                assert max(errors) < 1e-13


@pytest.mark.parametrize('assembly', ASSEMBLIES)
@pytest.mark.parametrize('lengths', [(2, 2, 1, 3), (2, 1, 2, 3), (3, 1, 2, 2)])
@pytest.mark.parametrize('angle', [0.0, 0.3])
def test_limited_crank_passes_the_change_point_inside_its_arc(lengths, angle, assembly):
    solver = Solver(four_bar(lengths, angle, assembly))
    assert not solver.mobility.turns_fully
    near = [angle + x for x in (-0.1, -1e-9, 0.0, 1e-200, 1e-12, 0.1)]
    assert max(worst_errors(solver, near, 2.0, 1.5, period=0)) < 1e-13


def test_first_angle_out_of_reach_of_an_array_is_named():
    solver = Solver(four_bar(mechanisms.LIMITED['triple_rocker_far'], 0.0))
    angles = np.full(10_000, 0.5)
    angles[[7000, 7001, 9999]] = 3.0, 3.1, 3.2
    with pytest.raises(UnreachableError, match=r'cannot move at 171\.887339 deg') as error:
        solver.state(angles.reshape(100, 100))
    assert error.value.crank_angle == 3.0


def test_crank_is_refused_exactly_at_its_limit():
    """Frame = crank + coupler + rocker: one single position, stretched straight."""
    for crank in (0.0, np.zeros(2), np.float64(0)):
        with pytest.raises(UnreachableError, match='cannot move at 0 deg'):
            Solver(FourBar(Frame(6.0), Body(1.0), Coupler(2.0), Body(3.0))).state(crank)


@pytest.mark.parametrize('bad', [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize('lengths', [(1, 2.5, 2, 3), (1, 2, 1, 2), (2, 1, 1.5, 2)])
@pytest.mark.parametrize(
    ('place', 'name'), [(0, 'crank angle'), (1, 'speed'), (2, 'acceleration')]
)
def test_numbers_that_are_not_finite_are_refused(place, name, lengths, bad):
    solver = Solver(four_bar(lengths))
    for form in (float, np.array, lambda x: np.array([1.2, x]), lambda x: [[x], [1.2]]):
        motion = [1.2, 1.0, 0.5]
        motion[place] = form(bad)
        with pytest.raises(ConfigurationError, match=f'{name} = {bad}: must be a finite number'):
            solver.state(*motion)


@pytest.mark.parametrize('form', [float, lambda x: np.array([x, x])])
def test_speed_that_overflows_the_torque_is_refused(form):
    with pytest.raises(ConfigurationError, match=r'overflows at .*crank speed = 1e\+200'):
        Solver(DOCUMENT_1).state(form(1.2), 1e200)
