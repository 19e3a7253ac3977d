# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Document 2's own solution, half-angle substitution, where it is defined and where it fails."""

from __future__ import annotations

import math
import random

import pytest

from linkage_ros import Body, Coupler, FourBar, Frame, Solver, UnreachableError

SIDE = {'open': -1, 'crossed': 1}


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
    side = SIDE[assembly]
    theta3 = 2 * math.atan((-b + side * math.sqrt(b * b - 4 * a * c)) / (2 * a))
    theta4 = 2 * math.atan((-b + side * math.sqrt(b * b - 4 * d * e)) / (2 * d))
    omega3 = r2 / r3 * math.sin(crank - theta4) / math.sin(theta4 - theta3)
    omega4 = r2 / r4 * math.sin(crank - theta3) / math.sin(theta4 - theta3)
    return theta3, theta4, omega3, omega4


def linkage(lengths, assembly, point=None):
    crank, coupler, rocker, frame = lengths
    return FourBar(
        Frame(frame), Body(crank), Coupler(coupler, point=point), Body(rocker), assembly
    )


def gap(first, second):
    return abs(math.remainder(first - second, 2 * math.pi))


@pytest.mark.parametrize('assembly', SIDE)
@pytest.mark.parametrize('seed', range(4))
def test_half_angle_solution_agrees_where_it_is_defined(seed, assembly):
    rng = random.Random(seed)
    middle = sorted(rng.uniform(1.6, 3) for _ in range(3))
    crank = rng.uniform(0.2, 0.9) * (middle[0] + middle[1] - middle[2])
    lengths = (min(crank, 1.4), *rng.sample(middle, 3))
    solver = Solver(linkage(lengths, assembly, point=(0.7, -0.4)))
    for degree in range(7, 360, 11):
        alpha = math.radians(degree)
        theta3, theta4, omega3, omega4 = half_angles(lengths, alpha, assembly)
        state = solver.state(alpha, 1.0)
        # A tangent of 89.9 deg or a small determinant costs the document digits, not us.
        assert gap(state.position[1], theta3) < 1e-9
        assert gap(state.position[2], theta4) < 1e-9
        assert state.velocity[1:] == pytest.approx((omega3, omega4), abs=1e-8)
        # The coupler point: eq. a2, a3, 34, 35.
        r2, sin3, cos3 = lengths[0], math.sin(theta3), math.cos(theta3)
        place = (
            r2 * math.cos(alpha) + 0.7 * cos3 + 0.4 * sin3,
            r2 * math.sin(alpha) + 0.7 * sin3 - 0.4 * cos3,
        )
        velocity = (
            -r2 * math.sin(alpha) - omega3 * (0.7 * sin3 - 0.4 * cos3),
            r2 * math.cos(alpha) + omega3 * (0.7 * cos3 + 0.4 * sin3),
        )
        point = solver.point(state, 'C')
        assert point.position == pytest.approx(place, abs=1e-8)
        assert point.velocity == pytest.approx(velocity, abs=1e-7)


def test_it_fails_where_its_denominator_vanishes_and_ours_does_not():
    """With equal crank and rocker, and the coupler as long as the frame, d = 0 at 180 deg."""
    lengths = (1.0, 2.0, 1.0, 2.0)
    with pytest.raises((ZeroDivisionError, FloatingPointError, ValueError)):
        half_angles((1.0, 1.0, 1.0, 1.0), 0.0, 'open')
    state = Solver(linkage(lengths, 'open')).state(math.pi, 1.0)
    assert state.velocity == pytest.approx((1.0, 0.0, 1.0), abs=1e-14)


def test_no_real_root_is_no_assembly():
    lengths = (2.0, 1.0, 2.5, 3.0)
    with pytest.raises(ValueError, match=r'math domain error|nonnegative'):
        half_angles(lengths, math.pi, 'open')
    with pytest.raises(UnreachableError):
        Solver(linkage(lengths, 'open')).state(math.pi)
