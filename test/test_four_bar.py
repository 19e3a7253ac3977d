# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Four-bars: values that documents print, closed answers, and where doubles are coarse."""

import cmath
import itertools
import math
import random
from dataclasses import replace

import mechanisms
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mechanisms import ASSEMBLIES, DOCUMENT_1, TURN, four_bar, worst_errors

from linkage_ros import Body, ConfigurationError, Coupler, FourBar, Frame, Solver, UnreachableError

DOCUMENT_SPEED = 150 * TURN / 60


# Document 1, and a textbook.


@pytest.mark.parametrize('assembly', ASSEMBLIES)
def test_document_quadrilateral_is_right_over_the_turn(assembly):
    solver = Solver(replace(DOCUMENT_1, assembly=assembly))
    angles = [math.radians(degrees) for degrees in range(0, 360, 5)]
    assert max(worst_errors(solver, angles, DOCUMENT_SPEED, -40.0, period=0)) < 1e-13


@pytest.mark.parametrize(
    ('degrees', 'torque'),
    [(0, -6.83836258084855), (294, 8.47528439441018), (348, -8.54729141947142)],
)
def test_document_torque_has_its_known_values(degrees, torque):
    state = Solver(DOCUMENT_1).state(math.radians(degrees), DOCUMENT_SPEED)
    assert state.torque == pytest.approx(torque, rel=0, abs=1e-14 * 8.55)


@pytest.mark.parametrize(
    ('assembly', 'coupler', 'rocker'), [('open', 88.84, 117.29), ('crossed', -115.21, -143.66)]
)
def test_norton_example_is_met_to_its_printed_digits(assembly, coupler, rocker):
    linkage = FourBar(Frame(6), Body(2), Coupler(7), Body(9), assembly)
    angle = Solver(linkage).state(math.radians(30)).position
    assert math.degrees(angle[1]) == pytest.approx(coupler, abs=0.005)
    assert math.degrees(angle[2]) == pytest.approx(rocker, abs=0.005)


# Document 2: half-angle substitution.


def half_angles(lengths, crank, assembly):
    """theta_3 and theta_4 by eq. 10 to 26, omega_3 and omega_4 for omega_2 = 1 by eq. 32, 33."""
    r2, r3, r4, r1 = lengths
    h1, h2, h3 = r1 / r2, r1 / r3, r1 / r4
    h4 = (-(r1**2) - r2**2 - r3**2 + r4**2) / (2 * r2 * r3)
    h5 = (r1**2 + r2**2 - r3**2 + r4**2) / (2 * r2 * r4)
    cos = math.cos(crank)
    a, b = -h1 + (1 + h2) * cos + h4, -2 * math.sin(crank)
    c = h1 - (1 - h2) * cos + h4
    d, e = -h1 + (1 - h3) * cos + h5, h1 - (1 + h3) * cos + h5
    side = -1 if assembly == 'open' else 1
    theta3 = 2 * math.atan((-b + side * math.sqrt(b * b - 4 * a * c)) / (2 * a))
    theta4 = 2 * math.atan((-b + side * math.sqrt(b * b - 4 * d * e)) / (2 * d))
    omega3 = r2 / r3 * math.sin(crank - theta4) / math.sin(theta4 - theta3)
    omega4 = r2 / r4 * math.sin(crank - theta3) / math.sin(theta4 - theta3)
    return theta3, theta4, omega3, omega4


@pytest.mark.parametrize('assembly', ASSEMBLIES)
@pytest.mark.parametrize('seed', range(3))
def test_half_angle_solution_agrees_where_it_is_defined(seed, assembly):
    rng = random.Random(seed)
    middle = sorted(rng.uniform(1.6, 3) for _ in range(3))
    crank = rng.uniform(0.2, 0.9) * (middle[0] + middle[1] - middle[2])
    r, b, c, d = lengths = (min(crank, 1.4), *rng.sample(middle, 3))
    coupler = Coupler(b, point=(0.7, -0.4))
    solver = Solver(FourBar(Frame(d), Body(r), coupler, Body(c), assembly))
    for alpha in np.arange(0.12, TURN, 0.19).tolist():
        theta3, theta4, omega3, omega4 = half_angles(lengths, alpha, assembly)
        state = solver.state(alpha, 1.0)
        # A tangent of 89.9 deg or a small determinant costs the document digits, not us.
        for angle, theta in zip(state.position[1:], (theta3, theta4), strict=True):
            assert abs(math.remainder(angle - theta, TURN)) < 1e-9
        assert state.velocity[1:] == pytest.approx((omega3, omega4), abs=1e-8)
        # The coupler point: eq. a2, a3, 34, 35.
        arm, lever = cmath.rect(r, alpha), complex(0.7, -0.4) * cmath.exp(1j * theta3)
        point = solver.point(state, 'C')
        assert complex(*point.position) == pytest.approx(arm + lever, abs=1e-8)
        velocity = 1j * arm + 1j * omega3 * lever
        assert complex(*point.velocity) == pytest.approx(velocity, abs=1e-7)


def test_half_angle_solution_fails_where_its_denominator_vanishes_and_ours_does_not():
    with pytest.raises(ZeroDivisionError):
        half_angles((1.0, 1.0, 1.0, 1.0), 0.0, 'open')
    state = Solver(four_bar((1.0, 1.0, 1.0, 1.0), 0.0)).state(0.0, 1.0)
    assert state.velocity == pytest.approx((1.0, 0.0, 1.0), abs=1e-14)


# Closed answers.


@settings(max_examples=15)
@given(st.floats(-TURN, TURN), st.floats(-20, 20), st.floats(-20, 20))
def test_lone_crank_is_a_pendulum(crank, speed, acceleration):
    """With massless coupler and rocker the equation of motion is known in closed form."""
    along, across = 0.05, -0.03
    linkage = FourBar(
        Frame(0.425), Body(0.1, 2.0, 0.01, (along, across)), Coupler(0.315), Body(0.5)
    )
    lever = complex(along, across) * cmath.exp(1j * crank)
    expected = (0.01 + 2.0 * abs(lever) ** 2) * acceleration + 2.0 * 9.81 * lever.real
    torque = Solver(linkage).state(crank, speed, acceleration).torque
    assert torque == pytest.approx(expected, rel=1e-14, abs=1e-15)


def test_crank_inertia_alone_takes_torque_only_while_it_accelerates():
    linkage = FourBar(Frame(2.2), Body(1, inertia=0.5), Coupler(3), Body(2.5))
    assert Solver(linkage).state(0.7, 3.0).torque == 0.0
    assert Solver(linkage).state(0.7, 3.0, 2.0).torque == 1.0


# Where doubles are coarse.


@pytest.mark.parametrize('assembly', ASSEMBLIES)
@pytest.mark.parametrize('power', [10, 30, 46])
def test_loop_closes_where_doubles_miss_an_equality_by_an_ulp_or_two(power, assembly):
    """Below 4 ulp the equality counts as met, also where d - r itself is not much more."""
    gap = 2.0**-power
    for sign, other, ulps in itertools.product((1, -1), repeat=3):
        lengths = 1 + sign * gap, 2, 2 + other * gap + ulps * math.ulp(1.0) * 2, 1
        solver = Solver(four_bar(lengths, 0.3, assembly))
        assert solver.mobility.grashof == 'change-point'
        for part in (0.0, 0.1, -0.4, 1.0, 3.0, 100.0):
            position = solver.state(0.3 + part * gap).position
            A, coupler, rocker = (cmath.rect(*x) for x in zip(lengths, position, strict=False))
            assert abs(A + coupler - rocker - cmath.exp(0.3j)) <= 8 * math.ulp(2.0)


def test_first_angle_out_of_reach_of_an_array_is_named():
    solver = Solver(four_bar(mechanisms.LIMITED['triple_rocker_far'], 0.0))
    angles = np.full(10_000, 0.5)
    angles[[7000, 7001, 9999]] = 3.0, 3.1, 3.2
    with pytest.raises(UnreachableError, match=r'cannot move at 171\.887339 deg') as error:
        solver.state(angles.reshape(100, 100))
    assert error.value.crank_angle == 3.0


def test_crank_is_refused_exactly_at_its_limit():
    """Frame = crank + coupler + rocker: one single position, stretched straight."""
    for crank in (0.0, np.zeros(2)):
        with pytest.raises(UnreachableError, match='cannot move at 0 deg'):
            Solver(FourBar(Frame(6.0), Body(1.0), Coupler(2.0), Body(3.0))).state(crank)


@pytest.mark.parametrize('form', [float, lambda x: np.array([x, x])])
def test_speed_that_overflows_the_torque_is_refused(form):
    with pytest.raises(ConfigurationError, match=r'overflows at .*crank speed = 1e\+200'):
        Solver(DOCUMENT_1).state(form(1.2), 1e200)
