# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Values that documents and a textbook print, and places where doubles are coarse."""

import cmath
import itertools
import math

import mechanisms
import numpy as np
import pytest
from mechanisms import ALL, ASSEMBLIES, DOCUMENT_1, four_bar, slider_crank, worst_errors

from linkage_ros import Body, Coupler, FourBar, Frame, Solver, UnreachableError


@pytest.mark.parametrize(
    ('degrees', 'torque'),
    [(0, -6.83836258084855), (294, 8.47528439441018), (348, -8.54729141947142)],
)
def test_document_torque_has_its_known_values(degrees, torque):
    state = Solver(DOCUMENT_1).state(math.radians(degrees), 5 * math.pi)
    assert state.torque == pytest.approx(torque, rel=0, abs=1e-14 * 8.55)


@pytest.mark.parametrize(
    ('assembly', 'coupler', 'rocker'), [('open', 88.84, 117.29), ('crossed', -115.21, -143.66)]
)
def test_norton_example_is_met_to_its_printed_digits(assembly, coupler, rocker):
    linkage = FourBar(Frame(6), Body(2), Coupler(7), Body(9), assembly)
    angle = Solver(linkage).state(math.radians(30)).position
    assert math.degrees(angle[1]) == pytest.approx(coupler, abs=0.005)
    assert math.degrees(angle[2]) == pytest.approx(rocker, abs=0.005)


def test_document_4_has_its_printed_values():
    state = Solver(ALL['document_4']).state(math.radians(45), 0.5, 1.0)
    assert state.position[0] == math.radians(45)
    assert math.degrees(state.position[1]) == pytest.approx(-30, rel=1e-14)
    assert state.position[2] == pytest.approx(1.93185165258, rel=5e-12)
    assert state.velocity[1:] == pytest.approx((-0.288675134595, -0.557677535825), rel=5e-12)
    assert state.acceleration[1:] == pytest.approx((-0.481125224325, -1.32615245782), rel=5e-12)


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


@pytest.mark.parametrize('ratio', [1e-2, 1e-6])
def test_crank_far_longer_than_its_coupler_loses_its_angles_rounding_and_no_more(ratio):
    """On an arc of 2 b/r rad one rounding of the crank angle is seen r/b times as large."""
    cranks = [0.3 + ratio * x for x in (-0.9, -0.5, -0.1, 0.3, 0.7, 0.95)]
    errors = worst_errors(Solver(slider_crank((1, ratio, 0))), cranks, period=0, floor=1)
    assert max(errors) < 32 * math.ulp(1.0) / ratio


@pytest.mark.parametrize(
    ('mechanism', 'limit', 'degrees'),
    [(four_bar((1, 2, 3, 6), 0.0), 0.0, 0), (slider_crank((1, 2, 3), 0.0), math.pi / 2, 90)],
)
def test_crank_is_refused_exactly_at_its_limit(mechanism, limit, degrees):
    """Frame = crank + coupler + rocker, offset = crank + coupler: stretched, with no rates."""
    for crank in (limit, np.full(2, limit)):
        with pytest.raises(UnreachableError, match=f'cannot move at {degrees} deg'):
            Solver(mechanism).state(crank)
