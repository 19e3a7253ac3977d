# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Four-bars and slider-cranks against 50 digits, above all in bad places."""

from __future__ import annotations

import itertools
import math
from fractions import Fraction
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mechanisms import (
    ANY,
    ASSEMBLIES,
    CHANGE_POINTS,
    FULL,
    LIMITED,
    TURN,
    of,
    oracle_of,
    path,
    worst_errors,
)
from mpmath import mp
from oracle import wrap

from linkage_ros import FourBar, MechanismError, Solver, UnreachableError

each_assembly = pytest.mark.parametrize('assembly', ASSEMBLIES)
through_change_points = pytest.mark.parametrize('name', CHANGE_POINTS)
limited = pytest.mark.parametrize('name', LIMITED)


def around(lengths, angle, exponents):
    """Angles at, and on both sides of, the change points of the last and the next two turns."""
    near = [0.0, *(sign * 10.0**-n for n in exponents for sign in (1, -1))]
    first = angle - math.pi if len(lengths) == 4 else angle - 1.5 * math.pi
    points = [first + k * math.pi for k in range(5)]
    return [point + x for point in points for x in near] + [-5.0, 1.9, 4.4, 11.0]


# The reference itself.


@each_assembly
@pytest.mark.parametrize('angle', [-40.0])
@pytest.mark.parametrize('crank', [-7.5])
@pytest.mark.parametrize('name', ['crank_rocker', 'double_crank', 'offset_left', 'offset_right'])
def test_reference_is_consistent_to_50_digits(name, crank, angle, assembly):
    mechanism = of(FULL[name], angle, assembly)
    oracle = oracle_of(mechanism)
    at = path(oracle, crank, 3.0, 2.0)
    with mp.workdps(60):
        state = at(0)
        lengths = [mp.mpf(x.numerator) / x.denominator for x in oracle.lengths]
        frame, alpha, beta = mp.expj(mp.mpf(angle)), state.position[0], state.position[1]
        coupler = lengths[1] * mp.expj(beta)
        crank_pin, slider_pin = lengths[0] * mp.expj(alpha), mp.mpc(state.position[2], lengths[2])
        if isinstance(mechanism, FourBar):
            pivot = lengths[3] * frame
            loop = crank_pin + coupler - lengths[2] * mp.expj(state.position[2]) - pivot
            side = (mp.conj(pivot - crank_pin) * coupler).imag
        else:
            loop = crank_pin + coupler - slider_pin * frame
            side = (mp.conj(frame) * coupler).real
        assert abs(loop) < 1e-50
        assert (side > 0) == (assembly == 'open')
        for link in range(3):
            slope = mp.diff(lambda t, link=link: at(t).position[link], 0)
            assert abs(slope - state.velocity[link]) < 1e-35
            slope = mp.diff(lambda t, link=link: at(t).velocity[link], 0)
            assert abs(slope - state.acceleration[link]) < 1e-35


@each_assembly
@through_change_points
def test_reference_moves_smoothly_through_change_points(name, assembly):
    oracle = oracle_of(of(CHANGE_POINTS[name], 5.5, assembly))
    step = TURN / 48
    states = [oracle.state(0.4 + i * step, 1.0) for i in range(2 * 48)]
    for before, after in itertools.pairwise(states):
        for link in (1, 2):
            moved = after.position[link] - before.position[link]
            if oracle.turning[link]:
                moved = wrap(moved)
            # Hermite's corrected trapezoid rule; a change of branch would leave O(step).
            rule = step / 2 * (before.velocity[link] + after.velocity[link])
            rule += step**2 / 12 * (before.acceleration[link] - after.acceleration[link])
            assert abs(moved - rule) < 1e-3 * step


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


@pytest.mark.parametrize('name', ['crank_rocker', 'offset_left'])
@pytest.mark.parametrize('quantity', range(10))
def test_comparison_catches_a_slip_of_a_part_in_1e12(quantity, name):
    """Negative control of worst_errors: only the quantity that slipped is found wrong."""
    solver = Solver(of(FULL[name]))
    angles = np.linspace(-6.0, 6.5, 24).tolist()
    assert max(worst_errors(solver, angles, 2.0, 1.5)) < 1e-14
    errors = worst_errors(Slipped(solver, quantity), angles, 2.0, 1.5)
    slipped = quantity // 3
    assert 3e-13 < errors[slipped] < 1e-11
    assert max(x for i, x in enumerate(errors) if i != slipped) < 1e-14


@pytest.mark.parametrize('name', [*FULL, *CHANGE_POINTS])
def test_comparison_catches_the_other_branch(name):
    lengths = {**FULL, **CHANGE_POINTS}[name]
    right, other = (Solver(of(lengths, 0.3, assembly)) for assembly in ASSEMBLIES)
    confused = SimpleNamespace(mechanism=right.mechanism, state=other.state)
    assert min(worst_errors(confused, [1.0], 2.0, 1.5)) > 0.01


# Cranks that turn fully.


@pytest.mark.parametrize('kind', ['four_bar', 'slider_crank'])
@settings(max_examples=15)
@given(
    data=st.data(),
    angles=st.lists(st.floats(-TURN, TURN, allow_subnormal=False), min_size=4, max_size=4),
)
def test_any_mechanism_whose_crank_turns_fully_is_right(kind, data, angles):
    solver = Solver(data.draw(ANY[kind]()))
    assert max(worst_errors(solver, angles, 2.0, 1.5, period=12)) < 1e-13


@each_assembly
@pytest.mark.parametrize('angle', [0.3, -2.0])
@through_change_points
def test_change_points_are_hit_neared_and_passed(name, angle, assembly):
    lengths = CHANGE_POINTS[name]
    solver = Solver(of(lengths, angle, assembly))
    angles = around(lengths, angle, (3, 8, 15))
    assert max(worst_errors(solver, angles, 2.0, 1.5)) < 1e-13


@pytest.mark.parametrize('turns', [-1, 159])
@through_change_points
def test_branch_does_not_depend_on_turns_in_the_angle_of_frame_or_guide(name, turns):
    solver = Solver(of(CHANGE_POINTS[name], 0.3 + turns * TURN))
    assert max(worst_errors(solver, [-2.0, 0.3, 1.0, 3.0, 5.0, 9.0], 2.0, 1.5)) < 1e-13


@each_assembly
@pytest.mark.parametrize(
    'text',
    [
        '.1 .2 .3 .4', '.1 .4 .3 .2', '.1 .4 .2 .3', '.3 .4 .2 .1', '.1 .3 .4 .2', '.2 .4 .3 .1',
        '.1 .7 .3 .5', '.3 .7 .5 .1', '.2 .3 .2 .3', '1.1 2.3 1.1 2.3', '.1 .25 .4 .25',
        '.0001 .0007 .0003 .0005', '110 230 110 230',
        '.1 .3 .2', '.1 .3 -.2', '.2 .3 .1', '.2 .3 -.1', '.7 .8 .1', '.1 .8 -.7', '1.1 3.3 2.2',
        '.0001 .0003 .0002', '110 330 220', '.3 .3 0',
    ],
)  # fmt: skip
def test_lengths_typed_in_decimals_meet_the_change_point_that_was_meant(text, assembly):
    meant = [Fraction(x) for x in text.split()]
    oracle = oracle_of(of(meant, 0.3, assembly), meant)
    assert oracle.passes_change_point
    solver = Solver(oracle.mechanism)
    assert solver.reach.grashof == 'change-point'
    assert solver.reach.turns_fully
    errors = worst_errors(solver, around(meant, 0.3, (3, 8, 15)), 2.0, 1.5, meant)
    assert max(errors) < 1e-13


@each_assembly
@pytest.mark.parametrize('gap', [1e-14, 1e-8])
@through_change_points
def test_lengths_a_little_off_a_change_point_keep_all_digits(name, gap, assembly):
    tried = 0
    for link in range(len(CHANGE_POINTS[name])):
        for sign in (1, -1):
            lengths = [float(x) for x in CHANGE_POINTS[name]]
            lengths[link] += sign * gap
            solver = Solver(of(lengths, 0.3, assembly))
            passes = oracle_of(solver.mechanism).passes_change_point
            if solver.reach.turns_fully:
                assert not passes or len(lengths) == 4
            if solver.reach.turns_fully and not passes:
                tried += 1
                width, first = math.sqrt(gap), 0.3 if len(lengths) == 4 else 0.3 + math.pi / 2
                angles = [first + x for x in (0.0, width, -width / 3, gap)]
                angles += [x + math.pi for x in angles] + [2.0]
                assert max(worst_errors(solver, angles, 2.0, 1.5)) < 1e-13
    least = {'parallelogram': 0, 'kite_r_b': 0, 'kite_r_b_long_crank': 0, 'both': 0}
    assert tried >= least.get(name, 1 if len(CHANGE_POINTS[name]) == 4 else 2)


@pytest.mark.parametrize('unit', [1e-6, 1e6])
@pytest.mark.parametrize('name', FULL)
def test_tiny_and_huge_mechanisms_are_right(name, unit):
    solver = Solver(of(FULL[name], unit=unit))
    assert max(worst_errors(solver, [-3.0, 0.3, 1.0, 4.0, 9.0], 2.0, 1.5)) < 1e-13


# Cranks that do not turn fully.


def distances_inside(arc, distances):
    start, end = arc
    inside = [start + x for x in distances] + [end - x for x in distances]
    return [x for x in inside if start < x < end]


@each_assembly
@limited
def test_limited_crank_is_right_until_a_thousandth_of_a_radian_from_its_limit(name, assembly):
    solver = Solver(of(LIMITED[name], 0.3, assembly))
    assert not solver.reach.turns_fully
    for arc in solver.reach.arcs:
        for crank in distances_inside(arc, (1e-3, 0.1, 1.0)):
            errors = worst_errors(solver, [crank], 2.0, 1.5, period=0, floor=1)
            assert max(errors) < 1e-12


@pytest.mark.parametrize(
    'lengths',
    [
        (1, 0.01, 0.02, 1.005), (1, 0.001, 0.002, 1.0005),
        (1, 0.01, 0.995), (1, 0.001, -0.9995), (1, 0.01, 0),
    ],
)  # fmt: skip
def test_long_limited_crank_on_a_short_arc_keeps_its_digits(lengths):
    solver = Solver(of(lengths))
    for start, end in solver.reach.arcs:
        cranks = [start + part * (end - start) for part in (0.1, 0.2, 0.5, 0.8)]
        # A slider that passes 0 is held to where it is at the other angles.
        for some in [[x] for x in cranks] if len(lengths) == 4 else [cranks]:
            assert max(worst_errors(solver, some, 2.0, 1.5, period=0, floor=1)) < 1e-12


@each_assembly
@limited
def test_out_of_reach_is_an_error_with_the_reach(name, assembly):
    solver = Solver(of(LIMITED[name], 0.3, assembly))
    arcs = solver.reach.arcs
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


@limited
def test_full_turn_of_a_limited_crank_is_refused(name):
    with pytest.raises(MechanismError, match='cannot turn fully: '):
        Solver(of(LIMITED[name])).reach.require_full_turn()
