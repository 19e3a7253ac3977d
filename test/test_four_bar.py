# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Angles, rates, accelerations and torque of four-bars against 50 digits, and their laws."""

from __future__ import annotations

import cmath
import itertools
import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mpmath import mp
from oracle import Oracle, worst_errors, wrap

from linkage_ros import Body, ConfigurationError, Coupler, FourBar, Frame, Solver, UnreachableError

TURN = 2 * math.pi
ASSEMBLIES = 'open', 'crossed'
DOCUMENT_SPEED = 150 * TURN / 60
DOCUMENT = FourBar(
    Frame(0.425, 5.497787143782138),
    Body(0.1, inertia=0.0245),
    Coupler(0.315, 2.0, 0.016, (0.1575, 0.0)),
    Body(0.5, 3.5, 0.066, (0.25, 0.0)),
)
EVERYWHERE_OFF_CENTRE = FourBar(
    Frame(0.425, 5.497787143782138),
    Body(0.1, 1.3, 0.0245, (0.03, -0.02)),
    Coupler(0.315, 2.0, 0.016, (0.1575, 0.04)),
    Body(0.5, 3.5, 0.066, (0.25, -0.07)),
    gravity=(1.7, -9.5),
)
# Crank, coupler, rocker, frame. First come those which pass two change points a turn (p0 = 0
# and q0 = 0), then those which pass one at theta = pi (p0 = 0), then one at theta = 0 (q0 = 0).
CHANGE_POINTS = {
    'parallelogram': (1, 2, 1, 2),
    'kite_r_b': (1, 1, 2, 2),
    'kite_r_b_long_crank': (2, 2, 1, 1),
    'rhombus': (1, 1, 1, 1),
    'p0': (1, 2.5, 1.5, 3),
    'p0_double_crank': (2.5, 2, 1.5, 1),
    'q0_coupler_longest': (1, 3.5, 2.5, 2),
    'q0_rocker_longest': (1, 2.5, 3.5, 2),
    'q0_double_crank': (3, 2.5, 1.5, 1),
    'kite_r_d': (1, 2, 2, 1),
}
LIMITED = {
    'rocker_crank': (2, 3, 1, 2.5),
    'double_rocker': (2, 1, 2.5, 3),
    'double_rocker_two_arcs': (2, 1, 1.5, 2),
    'triple_rocker_far': (2, 1.5, 1.2, 2.2),
    'triple_rocker_near': (1.5, 1.2, 3, 1.6),
    'p0_and_near_limit': (2, 4, 1, 3),
}


def four_bar(lengths, angle=0.3, assembly='open', unit=1.0):
    """A linkage with mass everywhere and no symmetry; `unit` scales lengths and dynamics."""
    r, b, c, d = (float(x) * unit for x in lengths)
    inertia = unit * unit
    return FourBar(
        Frame(d, angle),
        Body(r, 0.7, 0.02 * inertia, (0.3 * r, -0.2 * r)),
        Coupler(b, 2.0, 0.5 * inertia, (0.6 * b, 0.3 * b)),
        Body(c, 3.0, 0.3 * inertia, (0.4 * c, -0.25 * c)),
        assembly=assembly,
        gravity=(1.3 * min(unit, 1e4), -9.7 * min(unit, 1e4)),
    )


def rows(state):
    return np.array([*state.position, *state.velocity, *state.acceleration, state.torque])


def is_close(got, expected, ulps):
    """Whether quantities over many angles agree within some ulp of each one's largest value."""
    largest = np.max(np.abs(expected), axis=1, keepdims=True)
    difference = np.abs(got - expected)
    difference[:3] = np.abs(np.remainder(difference[:3] + math.pi, TURN) - math.pi)
    largest[:3] = math.pi
    return bool(np.all(difference <= ulps * np.spacing(largest)))


# The reference itself.


@pytest.mark.parametrize('crank', [0.0, 1.234, -7.5])
def test_reference_is_consistent_to_50_digits(crank):
    oracle = Oracle(EVERYWHERE_OFF_CENTRE)
    with mp.workdps(60):
        time = mp.mpf(0.25)
        motion = crank + 3 * time + time**2, 3 + 2 * time, 2
        state = oracle.state(*motion)
        r, b, c, d = (mp.mpf(x.numerator) / x.denominator for x in oracle.lengths)
        alpha, beta, gamma = state.position
        loop = r * mp.expj(alpha) + b * mp.expj(beta) - c * mp.expj(gamma)
        assert abs(loop - d * mp.expj(mp.mpf(EVERYWHERE_OFF_CENTRE.frame.angle))) < 1e-50
        for link in range(3):

            def angle(t, link=link):
                return oracle.state(crank + 3 * t + t**2).position[link]

            def rate(t, link=link):
                return oracle.state(crank + 3 * t + t**2, 3 + 2 * t).velocity[link]

            assert abs(mp.diff(angle, time) - state.velocity[link]) < 1e-35
            assert abs(mp.diff(rate, time) - state.acceleration[link]) < 1e-35


@pytest.mark.parametrize('assembly', ASSEMBLIES)
@pytest.mark.parametrize('name', CHANGE_POINTS)
def test_reference_moves_smoothly_through_change_points(name, assembly):
    oracle = Oracle(four_bar(CHANGE_POINTS[name], 5.5, assembly))
    step = TURN / 96
    states = [oracle.state(0.4 + i * step, 1.0) for i in range(2 * 96)]
    for before, after in itertools.pairwise(states):
        for link in (1, 2):
            moved = wrap(after.position[link] - before.position[link])
            # Hermite's corrected trapezoid rule; a change of branch would leave O(step).
            rule = step / 2 * (before.velocity[link] + after.velocity[link])
            rule += step**2 / 12 * (before.acceleration[link] - after.acceleration[link])
            assert abs(moved - rule) < 1e-4 * step


# Document 1.


@pytest.mark.parametrize('assembly', ASSEMBLIES)
@pytest.mark.parametrize(
    ('mechanism', 'acceleration'),
    [(DOCUMENT, 0.0), (DOCUMENT, -40.0), (EVERYWHERE_OFF_CENTRE, 25.0)],
    ids=['document', 'accelerated', 'off_centre'],
)
def test_document_quadrilateral_is_right_over_the_turn(mechanism, acceleration, assembly):
    solver = Solver(with_assembly(mechanism, assembly))
    angles = [math.radians(degrees / 2) for degrees in range(720)]
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
    state = Solver(DOCUMENT).state(math.radians(degrees), DOCUMENT_SPEED)
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
        differences.append(abs(Solver(DOCUMENT).state(float(alpha), w).torque - power / w))
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


@pytest.mark.parametrize('lengths', [(0.1, 0.315, 0.5, 0.425), (1, 2, 1, 2), (1, 2, 2, 1)])
def test_scalars_and_arrays_agree_to_a_few_ulp(lengths):
    solver = Solver(four_bar(lengths))
    angles = np.linspace(-7.0, 14.0, 5001)  # more than one chunk of the solver
    one_by_one = np.array([rows(solver.state(x, 2.0, 1.5)) for x in angles.tolist()]).T
    assert is_close(rows(solver.state(angles, 2.0, 1.5)), one_by_one, 4)


@pytest.mark.parametrize('shape', [(0,), (3, 0), (1,), (2, 3), (2, 1, 4)])
def test_the_shape_of_the_angles_is_kept(shape):
    solver = Solver(DOCUMENT)
    angles = np.arange(math.prod(shape), dtype=float).reshape(shape)
    state = solver.state(angles, 2.0)
    assert rows(state).shape == (10, *shape)
    assert np.array_equal(rows(state).reshape(10, -1), rows(solver.state(angles.ravel(), 2.0)))


def test_angle_speed_and_acceleration_broadcast():
    solver = Solver(DOCUMENT)
    angles, speeds = np.array([[0.5], [1.0], [4.0]]), np.array([1.0, -2.0])
    state = solver.state(angles, speeds, 3.0)
    assert state.torque.shape == (3, 2)
    assert state.torque[2, 1] == pytest.approx(solver.state(4.0, -2.0, 3.0).torque, rel=1e-14)
    assert solver.state(0.5, speeds).velocity[2].shape == (2,)
    assert solver.state(0.5, 1.0, speeds).acceleration[0].tolist() == [1.0, -2.0]


def test_views_that_are_not_contiguous_are_read_right():
    solver = Solver(DOCUMENT)
    angles = np.arange(12.0).reshape(3, 4)
    transposed = solver.state(angles.T, 2.0).torque
    assert np.allclose(transposed, solver.state(angles, 2.0).torque.T, rtol=1e-14, atol=0)


@pytest.mark.parametrize('kind', [int, np.int64, np.float64, np.array])
def test_whole_numbers_and_zero_dimensions_give_the_same_floats(kind):
    solver = Solver(DOCUMENT)
    state = solver.state(kind(2), kind(3), kind(1))
    assert state == solver.state(2.0, 3.0, 1.0)
    assert {type(x) for x in rows(state).tolist()} == {float}
    assert type(state.torque) is float


@given(st.floats(-20, 20))
def test_angles_stay_in_range_and_the_crank_angle_is_returned_as_asked(crank):
    angle = Solver(DOCUMENT).state(crank).position
    assert angle[0] == crank
    assert max(abs(angle[1]), abs(angle[2])) <= math.pi


# Laws, over linkages whose lengths are whole multiples of a power of two: sums of them are
# exact, so that change points are drawn as themselves.


@st.composite
def full_turn_linkages(draw, scales=20):
    shortest = draw(st.integers(4, 256))
    middle = draw(st.integers(shortest, 512))
    long = draw(st.integers(middle, 512))
    longest = draw(st.integers(long, long + middle - shortest))
    others = draw(st.permutations((middle, long, longest)))
    lengths = draw(st.sampled_from([(shortest, *others), (*others, shortest)]))
    angle = draw(st.integers(-3 * 1024, 3 * 1024)) / 1024
    unit = 2.0 ** (draw(st.integers(-scales, scales)) - 8)
    return four_bar(lengths, angle, draw(st.sampled_from(ASSEMBLIES)), unit)


angles_of_two_turns = st.floats(-TURN, TURN, allow_subnormal=False)


@given(full_turn_linkages(), st.lists(angles_of_two_turns, min_size=4, max_size=4))
def test_any_full_turn_linkage_is_right(linkage, angles):
    assert max(worst_errors(Solver(linkage), angles, 2.0, 1.5, period=12)) < 1e-13


@given(full_turn_linkages(), angles_of_two_turns)
def test_loop_closes_within_8_ulp_of_the_longest_link(linkage, crank):
    r, b, c, d = (
        x.length for x in (linkage.crank, linkage.coupler, linkage.rocker, linkage.frame)
    )
    for angles in (Solver(linkage).state(crank).position, Solver(linkage).state([crank]).position):
        with mp.workdps(40):
            A, B, C, D = (
                mp.expj(mp.mpf(float(x))) for x in (*np.ravel(angles), linkage.frame.angle)
            )
            residual = abs(r * A + b * B - c * C - d * D)
        assert residual <= 8 * math.ulp(max(r, b, c, d))


@pytest.mark.parametrize('assembly', ASSEMBLIES)
@pytest.mark.parametrize('lengths', [(1, 3, 2.5, 2.2), (3, 2.5, 2.2, 1), (1, 2, 2, 1)])
def test_rates_and_accelerations_are_derivatives_to_second_order(lengths, assembly):
    solver = Solver(four_bar(lengths, assembly=assembly))
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
        worst = 0.0
        for link in (1, 2):
            moved = later.position[link] - earlier.position[link]
            moved = np.remainder(moved + math.pi, TURN) - math.pi
            gained = later.velocity[link] - earlier.velocity[link]
            worst = max(worst, np.max(np.abs(moved / (2 * step) - exact.velocity[link])))
            worst = max(worst, np.max(np.abs(gained / (2 * step) - exact.acceleration[link])))
        errors.append(worst)
    assert errors[-1] < 1e-3
    slope = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert slope == pytest.approx(2.0, abs=0.1)


@given(full_turn_linkages(), angles_of_two_turns)
def test_mirrored_linkage_moves_mirrored(linkage, crank):
    solver = Solver(linkage)
    oracle = Oracle(linkage)
    # Where a change point at theta = 0 is passed, the mirrored branch has the same name.
    swapped = {'open': 'crossed', 'crossed': 'open'}[linkage.assembly]
    bodies = [
        type(body)(body.length, body.mass, body.inertia, (body.center[0], -body.center[1]))
        for body in (linkage.crank, linkage.coupler, linkage.rocker)
    ]
    mirrored = FourBar(
        Frame(linkage.frame.length, -linkage.frame.angle),
        *bodies,
        linkage.assembly if oracle.folded else swapped,
        (linkage.gravity[0], -linkage.gravity[1]),
    )
    got, expected = (
        rows(Solver(mirrored).state(-crank, -2.0, -1.5)),
        rows(solver.state(crank, 2.0, 1.5)),
    )
    assert is_close(-got[:, None], expected[:, None], 2)


@given(full_turn_linkages(), st.integers(-8192, 8192), st.integers(-3 * 1024, 3 * 1024))
def test_rotated_linkage_moves_rotated(linkage, crank, onto):
    """All angles are dyadic fractions: their sums are exact."""
    turned = onto / 1024 - linkage.frame.angle
    crank /= 1024
    gravity = complex(*linkage.gravity) * cmath.exp(1j * turned)
    rotated = FourBar(
        Frame(linkage.frame.length, onto / 1024), linkage.crank, linkage.coupler, linkage.rocker,
        linkage.assembly, (gravity.real, gravity.imag),
    )  # fmt: skip
    got = rows(Solver(rotated).state(crank + turned, 2.0, 1.5))
    expected = rows(Solver(linkage).state(crank, 2.0, 1.5))
    expected[:3] += turned
    weight = 2.0 * linkage.coupler.length * abs(gravity)  # a torque of this size is rotated
    assert is_close(got[:9, None], expected[:9, None], 16)
    assert got[9] == pytest.approx(expected[9], rel=1e-13, abs=1e-14 * weight)


@given(full_turn_linkages(scales=0), angles_of_two_turns, st.integers(-20, 19))
def test_scaled_linkage_moves_alike_and_takes_torque_by_its_square(linkage, crank, power):
    factor = 2.0**power

    def scaled(body):
        along, across = body.center
        return type(body)(
            body.length * factor, body.mass, body.inertia * factor**2,
            (along * factor, across * factor),
        )  # fmt: skip

    larger = FourBar(
        Frame(linkage.frame.length * factor, linkage.frame.angle),
        *(scaled(body) for body in (linkage.crank, linkage.coupler, linkage.rocker)),
        linkage.assembly,
        (linkage.gravity[0] * factor, linkage.gravity[1] * factor),
    )
    got = rows(Solver(larger).state(crank, 2.0, 1.5))
    expected = rows(Solver(linkage).state(crank, 2.0, 1.5))
    assert got[:9].tolist() == expected[:9].tolist()
    assert got[9] == expected[9] * factor**2


@given(full_turn_linkages(), angles_of_two_turns)
def test_motion_played_backwards_takes_the_same_torque(linkage, crank):
    forth, back = (Solver(linkage).state(crank, speed, 1.5) for speed in (2.0, -2.0))
    assert back.position == forth.position
    assert back.velocity == tuple(-x for x in forth.velocity)
    assert back.acceleration == forth.acceleration
    assert back.torque == forth.torque


# Bad places on purpose.


def around(angle, exponents):
    """Angles at, and on both sides of, the change points of the last and the next two turns."""
    near = [0.0, *(sign * 10.0**-n for n in exponents for sign in (1, -1))]
    points = [angle + k * math.pi for k in (-1, 0, 1, 2, 3)]
    return [point + x for point in points for x in near] + [-5.0, 1.9, 4.4, 11.0]


@pytest.mark.parametrize('assembly', ASSEMBLIES)
@pytest.mark.parametrize('angle', [0.3, 5.5, -2.0])
@pytest.mark.parametrize('name', CHANGE_POINTS)
def test_change_points_are_hit_neared_and_passed(name, angle, assembly):
    solver = Solver(four_bar(CHANGE_POINTS[name], angle, assembly))
    assert max(worst_errors(solver, around(angle, (3, 7, 9, 12, 15)), 2.0, 1.5)) < 1e-13


@pytest.mark.parametrize('assembly', ASSEMBLIES)
@pytest.mark.parametrize('name', CHANGE_POINTS)
def test_change_points_are_neared_to_1e_300_rad(name, assembly):
    solver = Solver(four_bar(CHANGE_POINTS[name], 0.0, assembly))
    near = [0.0, 1e-20, -1e-50, 1e-100, -1e-150, 1e-160, -1e-200, -1e-300, 1e-300]
    assert max(worst_errors(solver, near, 2.0, 1.5)) < 1e-13


@pytest.mark.parametrize('turns', [1, -1, 2, 159])
@pytest.mark.parametrize('name', ['p0', 'q0_rocker_longest', 'kite_r_d', 'rhombus'])
def test_branch_does_not_depend_on_turns_in_the_frame_angle(name, turns):
    angle = 0.3 + turns * TURN
    solver = Solver(four_bar(CHANGE_POINTS[name], angle))
    assert max(worst_errors(solver, [-2.0, 0.3, 1.0, 3.0, 5.0, 9.0], 2.0, 1.5)) < 1e-13


@pytest.mark.parametrize('odd', [1, -1, 3, -3, 7, -7, 17, 19, 21, 315])
@pytest.mark.parametrize('name', ['p0', 'q0_rocker_longest', 'kite_r_d'])
def test_frame_angle_of_half_turns_counts_as_the_nearer_to_zero(name, odd):
    """The double nearest to 3 pi lies below it: it stands for almost pi, not for -pi."""
    solver = Solver(four_bar(CHANGE_POINTS[name], odd * math.pi))
    assert max(worst_errors(solver, [-2.0, 0.3, 1.0, 3.0, 5.0, 9.0], 2.0, 1.5)) < 1e-13


@pytest.mark.parametrize('assembly', ASSEMBLIES)
@pytest.mark.parametrize(
    'text',
    [
        '.1 .2 .3 .4', '.1 .4 .3 .2', '.1 .4 .2 .3', '.3 .4 .2 .1', '.1 .3 .4 .2', '.2 .4 .3 .1',
        '.1 .7 .3 .5', '.3 .7 .5 .1', '.2 .3 .2 .3', '1.1 2.3 1.1 2.3', '.1 .25 .4 .25',
        '.0001 .0007 .0003 .0005', '110 230 110 230',
    ],
)  # fmt: skip
def test_lengths_typed_in_decimals_meet_the_change_point_that_was_meant(text, assembly):
    meant = [Fraction(x) for x in text.split()]
    oracle = Oracle(four_bar(meant, 0.3, assembly), meant)
    assert oracle.folded or oracle.stretched
    solver = Solver(oracle.mechanism)
    assert solver.mobility.grashof == 'change-point'
    errors = worst_errors(solver, around(0.3, (3, 8, 12, 15)), 2.0, 1.5, meant)
    assert max(errors) < 1e-13


@pytest.mark.parametrize('assembly', ASSEMBLIES)
@pytest.mark.parametrize('gap', [1e-14, 1e-10, 1e-6])
@pytest.mark.parametrize('name', CHANGE_POINTS)
def test_lengths_a_little_off_a_change_point_keep_all_digits(name, gap, assembly):
    tried = 0
    for link in range(4):
        for sign in (1, -1):
            lengths = [float(x) for x in CHANGE_POINTS[name]]
            lengths[link] += sign * gap
            solver = Solver(four_bar(lengths, 0.3, assembly))
            if solver.mobility.turns_fully and not any(
                (Oracle(solver.mechanism).folded, Oracle(solver.mechanism).stretched)
            ):
                tried += 1
                width = math.sqrt(gap)
                angles = [0.3 + x for x in (0.0, width, -width / 3, gap)]
                angles += [x + math.pi for x in angles] + [2.0]
                assert max(worst_errors(solver, angles, 2.0, 1.5)) < 1e-13
    assert tried or name in ('parallelogram', 'kite_r_b', 'kite_r_b_long_crank')


GAPS = 0.0, 2.0**-7, 2.0**-20, 2.0**-33, 2.0**-46


@pytest.mark.parametrize('assembly', ASSEMBLIES)
@pytest.mark.parametrize('first', GAPS)
@pytest.mark.parametrize('second', GAPS)
def test_nearly_concentric_linkages_keep_all_digits(first, second, assembly):
    """Crank nearly as long as the frame, coupler as the rocker: A passes B0 closely."""
    for frame, coupler in ((1.3, 2.7), (2.7, 1.3), (1.1, 1.7)):
        for signs in itertools.product((1, -1), repeat=2):
            lengths = frame + signs[0] * first, coupler, coupler + signs[1] * second, frame
            assert Fraction(lengths[0]) - Fraction(frame) == signs[0] * Fraction(first)
            solver = Solver(four_bar(lengths, 0.3, assembly))
            if solver.mobility.turns_fully:
                close = [x * gap for gap in {first, second} for x in (0.1, -0.7, 1.0, 4.0)]
                angles = [0.3, 0.3 + 1e-9, 2.0, *(0.3 + x for x in close)]
                assert max(worst_errors(solver, angles, 2.0, 1.5, period=6)) < 1e-13


@pytest.mark.parametrize('assembly', ASSEMBLIES)
@pytest.mark.parametrize('gap', ['1e-2', '1e-6', '1e-10', '1e-14'])
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


@pytest.mark.parametrize('ratio', [1e-1, 1e-2, 1e-4, 1e-6, 1e-8])
@pytest.mark.parametrize('place', ['crank', 'frame'])
def test_short_cranks_and_frames_keep_all_digits(place, ratio):
    lengths = (ratio, 1, 1.2, 0.9) if place == 'crank' else (0.9, 1, 1.2, ratio)
    solver = Solver(four_bar(lengths))
    angles = [-3.0, -1.5, 0.3, 1.0, 2.0, 3.4, 5.0]
    assert max(worst_errors(solver, angles, 2.0, 1.5)) < 1e-13


@pytest.mark.parametrize('unit', [1e-6, 1e-3, 1e3, 1e6])
def test_tiny_and_huge_linkages_are_right(unit):
    solver = Solver(four_bar((0.7, 2.1, 1.9, 1.3), unit=unit))
    assert max(worst_errors(solver, [-3.0, 0.3, 1.0, 4.0, 9.0], 2.0, 1.5)) < 1e-13


# Cranks that do not turn fully.


def distances_inside(arc, distances):
    start, end = arc
    inside = [start + x for x in distances] + [end - x for x in distances]
    return [x for x in inside if start < x < end]


@pytest.mark.parametrize('assembly', ASSEMBLIES)
@pytest.mark.parametrize('name', LIMITED)
def test_limited_crank_is_right_until_a_thousandth_of_a_radian_from_its_limit(name, assembly):
    solver = Solver(four_bar(LIMITED[name], 0.3, assembly))
    assert not solver.mobility.turns_fully
    for arc in solver.mobility.arcs:
        for crank in distances_inside(arc, (1e-3, 1e-2, 0.1, 0.3)):
            errors = worst_errors(solver, [crank], 2.0, 1.5, period=0, floor=1)
            assert max(errors) < 1e-12


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


@given(
    st.tuples(*[st.integers(20, 1000)] * 4), st.floats(0, 1), st.sampled_from([1e-2, 1e-4, 1e-6])
)
def test_limited_crank_is_as_right_as_its_lengths(lengths, where, distance):
    """Close to a limit all is 1/sqrt(distance): the rounding of the lengths is seen, no more."""
    if max(lengths) * 2 >= sum(lengths):
        return
    solver = Solver(four_bar([x / 1000 for x in lengths]))
    if solver.mobility.turns_fully:
        return
    start, end = solver.mobility.arcs[0]
    for crank in (start + where * (end - start), start + distance, end - distance):
        if start + 0.9 * distance < crank < end - 0.9 * distance:
            got = rows(solver.state(crank, 2.0, 1.5))
            base, moved = effect_of_one_ulp(solver.mechanism, crank)
            for i, (x, right, effect) in enumerate(zip(got.tolist(), base, moved, strict=True)):
                error = abs(wrap(x - right)) if i < 3 else abs(x - right)
                assert error <= 4 * effect + 1e-14 * (1 + abs(right))


@pytest.mark.parametrize('lengths', [(1, 0.01, 0.02, 1.005), (1, 0.001, 0.002, 1.0005)])
def test_long_limited_crank_on_a_short_arc_keeps_its_digits(lengths):
    solver = Solver(four_bar(lengths))
    for start, end in solver.mobility.arcs:
        for part in (0.2, 0.5, 0.8):
            crank = start + part * (end - start)
            assert max(worst_errors(solver, [crank], 2.0, 1.5, period=0, floor=1)) < 1e-12


@pytest.mark.parametrize('gap', [1e-3, -1e-5, 1e-8, -1e-12, 0.0])
@pytest.mark.parametrize('coupler_rocker', [(2, 1.4), (1.4, 2), (0.7, 0.6), (0.3, 0.2)])
def test_limited_crank_as_long_as_the_frame_keeps_its_digits(coupler_rocker, gap):
    for assembly in ASSEMBLIES:
        solver = Solver(four_bar((1 + gap, *coupler_rocker, 1), 0.3, assembly))
        assert not solver.mobility.turns_fully
        for start, end in solver.mobility.arcs:
            for part in (0.1, 0.3, 0.5, 0.51, 0.8):
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


@pytest.mark.parametrize('name', LIMITED)
def test_out_of_reach_is_an_error_with_the_reach(name):
    solver = Solver(four_bar(LIMITED[name]))
    arcs = solver.mobility.arcs
    for start, end in arcs:
        for outside in (start - 1e-12, start - 1e-3, end + 1e-12, end + 1e-3):
            with pytest.raises(
                UnreachableError, match=r'cannot move at .* deg: .*; it reaches'
            ) as e:
                solver.state(outside, 1.0)
            assert e.value.crank_angle == outside
            assert e.value.arcs == arcs


def test_first_angle_out_of_reach_of_an_array_is_named():
    solver = Solver(four_bar(LIMITED['triple_rocker_far'], 0.0))
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
    with pytest.raises(ConfigurationError, match='torque overflows at a speed up to 1e'):
        Solver(DOCUMENT).state(form(1.2), 1e200)
