# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Compares states, points and joint forces of mechanisms with 50 digits, at critical angles."""

import itertools
import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mechanisms import (
    ALL,
    ANY,
    ASSEMBLIES,
    CHANGE_POINTS,
    FULL,
    LIMITED,
    TURN,
    examples,
    force_errors,
    four_bar,
    of,
    slider_crank,
    worst_errors,
)
from mpmath import mp
from oracle import Oracle, oracle_of

from linkage_ros import (
    Body,
    Coupler,
    FourBar,
    Frame,
    LinkLoad,
    SliderCrank,
    Solver,
    UnreachableError,
)

each_assembly = pytest.mark.parametrize('assembly', ASSEMBLIES)
limited = pytest.mark.parametrize('name', LIMITED)


def line(lengths, angle):
    """Returns the crank angle at which the links of a change point, or near one, are in line."""
    return angle if len(lengths) == 4 else angle + math.pi / 2


def slipped(value):
    """Increases all numbers in nested tuples and dictionaries by a factor of 1 + 1e-10."""
    if isinstance(value, dict):
        return {name: slipped(x) for name, x in value.items()}
    return tuple(map(slipped, value)) if isinstance(value, tuple) else value * (1 + 1e-10)


@pytest.mark.parametrize(
    'field',
    ['position', 'velocity', 'acceleration', 'torque', 'pins', 'guides', 'shaking_force',
     'shaking_moment'],
)  # fmt: skip
def test_comparison_detects_an_error_in_any_quantity(field):
    """Negative control of worst_errors and force_errors."""
    solver, right = (Solver(ALL['offset_right']) for _ in range(2))

    def wrong(found):
        changed = {x: slipped(getattr(found, x)) for x in found._fields if x == field}
        return found._replace(**changed)

    solver.state = lambda *motion: wrong(right.state(*motion))
    solver.reactions = lambda state: wrong(right.reactions(state))
    angles = np.linspace(-6.0, 6.5, 5).tolist()
    assert max(*worst_errors(solver, angles), *force_errors(solver, angles)) > 3e-12


# Cranks that turn fully, and wind pumps.


@pytest.mark.parametrize('name', ALL)
@pytest.mark.parametrize('motion', [(2.0, 1.5), (-150.0, 1e3)])
def test_states_points_and_forces_are_right_around_two_turns(name, motion):
    solver, angles = Solver(ALL[name]), np.linspace(-6.0, 6.5, 5).tolist()
    # Near a dead centre, the pin of a driven slider is the sum of crank and coupler, which have
    # 1e4 times the accelerations of what it carries.
    allowed = 1e-12 if name == 'guide_on_driven_slider' else 1e-13
    assert max(worst_errors(solver, angles, *motion, period=4)) < allowed
    assert max(force_errors(solver, angles, *motion)) < 1e-12


@pytest.mark.parametrize('kind', ANY)
@examples(8)
@given(
    data=st.data(),
    angles=st.lists(st.floats(-TURN, TURN, allow_subnormal=False), min_size=3, max_size=3),
)
def test_random_mechanisms_are_right(kind, data, angles):
    solver = Solver(data.draw(ANY[kind]()))
    assert max(worst_errors(solver, angles)) < 1e-13
    if not (solver.mobility and solver.mobility.has_change_point):
        assert max(force_errors(solver, angles)) < 1e-12


def around(lengths, angle, exponents):
    """Returns angles at and on both sides of change points, over two turns."""
    near = [0.0, *((-1) ** n * 10.0**-n for n in exponents)]
    points = [line(lengths, angle) + k * math.pi for k in (-2, -1, 0, 1)]
    return [point + x for point in points for x in near] + [1.9]


@pytest.mark.parametrize('name', CHANGE_POINTS)
def test_states_as_close_to_change_points_as_doubles_allow_are_right(name):
    """Down to 1e-300 rad; the guide's angle compensates the rounding of pi/2, 6.123e-17."""
    lengths, lack = CHANGE_POINTS[name], 6.123233995736766e-17
    near = [0.0, 1e-20, -1e-100, 1e-160, -1e-300]
    if len(lengths) == 4:
        assert max(worst_errors(Solver(of(lengths, 0.0)), near)) < 1e-13
        return
    for sign in (1, -1):
        solver = Solver(of(lengths, -sign * lack))
        close = [sign * (math.pi / 2 + x) for x in (0.0, 3e-16, -1e-14)]
        assert max(worst_errors(solver, close)) < 1e-13
        solver = Solver(of(lengths, sign * math.pi / 2))
        close = [*near, *(x + sign * lack for x in near[2:])]
        assert max(worst_errors(solver, close)) < 1e-13


# Decimal lengths whose doubles miss the intended change point, and an offset of rounding size.
DECIMALS = [
    [Fraction(x) for x in text.split()]
    for text in (
        '.1 .2 .3 .4', '.1 .4 .2 .3', '.3 .4 .2 .1', '.1 .7 .3 .5', '.2 .3 .2 .3', '.1 .25 .4 .25',
        '.0001 .0007 .0003 .0005', '.1 .3 .2', '.1 .3 -.2', '.7 .8 .1', '1.1 3.3 2.2', '.3 .3 0',
    )
]  # fmt: skip
ROUNDED = [((1, 1, offset), (1, 1, 0)) for offset in (1e-300, -1e-17, 4e-16)]
ROUNDED += [(meant, meant) for meant in DECIMALS]


@pytest.mark.parametrize(('lengths', 'meant'), ROUNDED)
def test_rounded_lengths_have_the_intended_change_point(lengths, meant):
    solver = Solver(of(lengths, 0.3))
    assert solver.reach.grashof == 'change-point'
    assert Oracle(solver.mechanism, meant).passes_change_point
    assert max(worst_errors(solver, around(meant, 0.3, (8, 15)), lengths=meant)) < 1e-13


@pytest.mark.parametrize('gap', [1e-14, 1e-8])
@pytest.mark.parametrize(
    'name', ['rhombus', 'p0', 'p0_double_crank', 'q0_rocker_longest', 'kite_r_d', 'upper', 'lower']
)
def test_lengths_near_a_change_point_keep_all_digits(name, gap):
    tried = 0
    for link, sign in itertools.product(range(len(CHANGE_POINTS[name])), (1, -1)):
        lengths = [float(x) for x in CHANGE_POINTS[name]]
        lengths[link] += sign * gap
        solver = Solver(of(lengths, 0.3, ASSEMBLIES[link % 2]))
        if solver.reach.turns_fully and not solver.reach.has_change_point:
            width, first = math.sqrt(gap), line(lengths, 0.3)
            angles = [first + x for x in (0.0, -width / 3, math.pi, math.pi + gap)]
            assert max(worst_errors(solver, angles, period=4)) < 1e-13
            tried += 1
    assert tried


GAPS = 0.0, 2.0**-7, 2.0**-33


@each_assembly
@pytest.mark.parametrize(('first', 'second'), list(itertools.product(GAPS, repeat=2)))
def test_nearly_concentric_linkages_keep_all_digits(first, second, assembly):
    """A passes B0 closely, or B passes A0 closely: links have nearly equal lengths in pairs."""
    frame, coupler = (1.3, 2.7) if assembly == 'open' else (2.7, 1.3)
    cases = [
        (frame + sign * first, coupler, coupler + other * second, frame)
        for sign, other in itertools.product((1, -1), repeat=2)
    ]
    cases += [(1.3, 1.3 + first, second), (1.3, 1.3 + first, -second)]
    for lengths in cases:
        solver = Solver(of(lengths, 0.3, assembly))
        if solver.reach.turns_fully:
            sizes = (first, second) if len(lengths) == 4 else (math.sqrt(first), math.sqrt(second))
            close = [line(lengths, 0.3) + x * gap for gap in {*sizes} for x in (-0.7, 1.0, 4.0)]
            assert max(worst_errors(solver, [0.3, 2.0, *close], period=4)) < 1e-13


@pytest.mark.parametrize('gap', ['1e-6', '1e-14'])
def test_nearly_concentric_linkage_in_decimals_loses_only_what_its_doubles_lose(gap):
    """Rounding 1.000001 m moves r - d by half an ulp of 1 m; the motion depends on (r - d)/gap."""
    meant = 1 + Fraction(gap), 2, 2 + Fraction(gap), 1
    angles = [0.3 + x * float(gap) for x in (0.0, 0.1, -0.5, 1.0, 5.0)] + [1.0]
    errors = worst_errors(Solver(of(meant, 0.3)), angles, lengths=meant)
    assert max(errors) < max(1e-13, 4 * math.ulp(1.0) / float(gap))


# Change points that are hit, neared and passed; unusual proportions; and directions of frame or
# guide at odd multiples of pi. The double nearest to 3 pi is below it, so it represents nearly pi,
# not -pi.
USUAL = [-3.0, 0.3, 1.0, 4.0]
HARD = [
    *((lengths, angle, assembly, around(lengths, angle, (3, 8, 15)))
      for lengths in CHANGE_POINTS.values()
      for angle, assembly in ((0.3, 'open'), (-2.0, 'crossed'))),
    *((tuple(unit * x for x in FULL[name]), 0.3, 'open', USUAL)
      for unit in (1e-6, 1e6) for name in FULL),
    *((lengths, 0.3, 'open', USUAL) for lengths in (
        (1e-2, 1, 1.2, 0.9), (1e-8, 1, 1.2, 0.9), (0.9, 1, 1.2, 1e-2), (0.9, 1, 1.2, 1e-8),
        (1e-8, 1, 0.4), (0.7, 1, 1e-8), (1e-8, 1 + 2e-8, -1),
    )),
    *((CHANGE_POINTS[name], halves * math.pi, 'open', USUAL)
      for name in ('p0', 'q0_rocker_longest', 'kite_r_d', 'upper', 'lower')
      for halves in (1, -1, -7, 315, -318)),
]  # fmt: skip


@pytest.mark.parametrize(('lengths', 'angle', 'assembly', 'cranks'), HARD)
def test_hard_cases_keep_all_digits(lengths, angle, assembly, cranks):
    assert max(worst_errors(Solver(of(lengths, angle, assembly)), cranks)) < 1e-13


# Cranks that do not turn fully.


@each_assembly
@limited
def test_limited_crank_is_right_until_a_millionth_of_a_radian_from_its_limit(name, assembly):
    """Near a limit, rates are unbounded, and so is the effect of a rounded length."""
    solver = Solver(of(LIMITED[name], 0.3, assembly))
    assert not solver.reach.turns_fully
    for start, end in solver.reach.arcs:
        for distance in (1e-1, 1e-3, 1e-6):
            crank = start + distance if distance < 1e-3 else end - distance
            if start < crank < end:
                errors = worst_errors(solver, [crank], period=0, floor=1)
                assert max(errors) < 1e-12 + 1e-14 / distance
                assert max(force_errors(solver, [crank])) < 1e-10 + 1e-13 / distance


@pytest.mark.parametrize(
    'lengths',
    [(1, 0.01, 0.02, 1.005), (1, 0.001, 0.002, 1.0005), (1, 0.01, 0.995), (1, 0.001, -0.9995),
     (1, 0.01, 0), *((1 + gap, *pair, 1) for gap in (-1e-5, 1e-12, 0.0)
                     for pair in ((2, 1.4), (1.4, 2), (0.3, 0.2)))],
)  # fmt: skip
def test_long_limited_cranks_keep_their_digits(lengths):
    solver = Solver(of(lengths))
    assert not solver.reach.turns_fully
    for start, end in solver.reach.arcs:
        cranks = [start + part * (end - start) for part in (0.1, 0.3, 0.51, 0.8)]
        # A slider that passes 0 is compared with its position at the other angles.
        for some in [[x] for x in cranks] if len(lengths) == 4 else [cranks]:
            assert max(worst_errors(solver, some, period=0, floor=1)) < 1e-12


@each_assembly
@pytest.mark.parametrize(
    ('lengths', 'quarter'),
    [((2, 2, 1, 3), 0), ((3, 1, 2, 2), 0), ((3, 2, 1), 1), ((3, 2, -1), -1), ((0.3, 0.1, 0.2), 1)],
)
def test_limited_crank_passes_the_change_point_inside_its_arc(lengths, quarter, assembly):
    meant = [Fraction(str(x)) for x in lengths]
    solver = Solver(of(lengths, 0.3, assembly))
    assert not solver.reach.turns_fully
    point = 0.3 + quarter * math.pi / 2
    near = [point + x for x in (-0.1, -1e-9, 0.0, 1e-12, 0.1)]
    assert max(worst_errors(solver, near, lengths=meant, period=0)) < 1e-13


# Calculated by hand.


def test_massless_rod_carries_only_an_axial_force():
    """A force F on the slider gives a rod force F/cos(beta) and a guide force F tan(beta)."""
    mechanism = SliderCrank(
        Body(1.0), Coupler(math.sqrt(2)), gravity=(0.0, 0.0), loads=(LinkLoad('slider', 100.0),)
    )
    solver = Solver(mechanism)
    found = solver.reactions(solver.state(math.radians(45)))
    # The rod is at -30 deg; the slider is pushed along +x against the guide.
    rod = -100 * complex(1.0, -math.tan(math.radians(30)))
    for pin in ('A0', 'A', 'B'):
        assert complex(*found.pins[pin]) == pytest.approx(rod, rel=1e-13)
    assert found.guides['slider'].force == pytest.approx(
        -100 * math.tan(math.radians(30)), rel=1e-13
    )
    lever = math.cos(math.radians(45)) * rod.imag - math.sin(math.radians(45)) * rod.real
    assert found.torque == pytest.approx(lever, rel=1e-13)
    assert complex(*found.shaking_force) == pytest.approx(100, rel=1e-13)
    assert found.shaking_moment == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize('crank', [3.14, 3.1415])
def test_shaking_force_has_all_digits_where_joint_forces_are_large(crank):
    """Near a change point, the joint forces are 300 times as large, and cancel in it."""
    bodies = (
        Body(0.1, 1.0, 0.01, (0.05, 0.0)), Coupler(0.300001, 2.0, 0.02, (0.1, 0.03)),
        Body(0.1, 1.5, 0.02, (0.05, 0.0)),
    )  # fmt: skip
    mechanism = FourBar(Frame(0.3), *bodies)
    solver = Solver(mechanism)
    found = solver.reactions(solver.state(crank, 2.0, 1.5))
    with mp.workdps(50):
        right = oracle_of(mechanism).solve(mp.mpf(crank), mp.mpf(2), mp.mpf(1.5)).shaking[0]
        assert abs(mp.mpc(*found.shaking_force) - right) <= 1e-15 * abs(right)


def test_pivots_carry_the_weights_of_a_square():
    """With unit links, half of the coupler's weight acts on each upright link; the torque is 0."""
    square = FourBar(
        Frame(1.0), Body(1.0, 3.0, 0.0, (0.5, 0.0)), Coupler(1.0, 4.0, 0.0, (0.5, 0.0)),
        Body(1.0, 5.0, 0.0, (0.5, 0.0)), gravity=(0.0, -10.0),
    )  # fmt: skip
    solver = Solver(square)
    found = solver.reactions(solver.state(math.pi / 2))
    hand = {'A0': 50j, 'A': 20j, 'B': -20j, 'B0': 70j}
    assert list(found.pins) == list(hand)
    for pin, force in hand.items():
        assert complex(*found.pins[pin]) == pytest.approx(force, rel=1e-13, abs=1e-13)
    assert complex(*found.shaking_force) == pytest.approx(-120j, abs=1e-13)
    # About A0: half the coupler's weight acts above A0, the rest and the rocker's weight at 1 m.
    assert found.shaking_moment == pytest.approx(-70, rel=1e-13)


# At change points. Their angles as typed are rounded; an exact comparison would not detect them.

PASSED = {
    'small_parallelogram': (four_bar((0.1, 0.4, 0.1, 0.4), 0.0), (0.0, math.pi)),
    'antiparallelogram': (four_bar((1, 2, 1, 2), 0.3, 'crossed'), (0.3, 0.3 + math.pi)),
    'kite': (four_bar((1, 2, 2, 1), 5.5, 'crossed'), (5.5,)),
    'one_a_turn': (four_bar((1, 2.5, 1.5, 3), 0.0), (math.pi,)),
    'equal_rod': (slider_crank((1, 1, 0), 0.0), (math.pi / 2, -math.pi / 2)),
    'offset_slider': (slider_crank((1, 1.5, 0.5)), (0.3 - math.pi / 2,)),
}
passed = pytest.mark.parametrize('name', PASSED)
at_turns = pytest.mark.parametrize('turns', [0, 1, 3, 101, 1000])


def passing(name, turns):
    """Returns crank angles of change points, as typed, after some turns forward and back."""
    _, first = PASSED[name]
    return [x + sign * turns * 2 * math.pi for x in first for sign in ((1, -1) if turns else (1,))]


@passed
@at_turns
def test_change_points_are_refused_after_any_number_of_turns(name, turns):
    solver = Solver(PASSED[name][0])
    for crank in passing(name, turns):
        alone = solver.state(crank, -2.0, 1.5)
        together = solver.state(np.array([crank + 1, crank, crank - 1]), 2.0, 1.5)
        assert all(np.isfinite(x).all() for state in (alone, together) for x in state[:3])
        for state in (alone, together):
            with pytest.raises(UnreachableError, match='all links are in line') as error:
                solver.reactions(state)
            assert error.value.crank_angle == crank
            assert error.value.arcs == solver.mobility.arcs
            assert '\n' not in str(error.value)


@passed
@at_turns
def test_forces_next_to_change_points_are_large_and_right(name, turns):
    """At a distance of eight rounding errors, forces are computed: the guard is narrow enough."""
    solver = Solver(PASSED[name][0])
    for crank in passing(name, turns):
        for distance in (1e-2, -1e-4, 1e-6):
            assert max(force_errors(solver, [crank + distance], -3.0)) < 1e-12
        for sign in (8, -8):
            beside = crank + sign * math.ulp(8 + abs(crank))
            found = solver.reactions(solver.state(beside, 1.0))
            assert 1e6 < np.max(np.abs([*found.pins.values()])) < math.inf


def test_links_almost_in_line_are_no_change_point():
    """A sum of 1e-13 m does not count as 0: the forces are large, finite and correct."""
    solver = Solver(four_bar((1 - 1e-13, 2, 1, 2), 0.0))
    assert solver.mobility.grashof == 'crank-rocker'
    assert max(force_errors(solver, [0.0, math.pi, 2000 * math.pi])) < 1e-12
