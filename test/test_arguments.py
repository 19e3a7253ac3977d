# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Arguments of the solver that are not numbers, or misshapen."""

import math
from decimal import Decimal
from fractions import Fraction

import numpy as np
import pytest
from test_refusals import refused as one_line_of

from linkage_ros import (
    Body,
    ConfigurationError,
    Coupler,
    FourBar,
    Frame,
    Piston,
    Slider,
    SliderCrank,
    Solver,
    UnreachableError,
    WindPump,
)

FOUR_BAR = FourBar(
    Frame(2.2), Body(1.0, 0.7, 0.02), Coupler(3.0, 2.0, 0.5, point=(1.5, 0.2)), Body(2.5, 3.0, 0.3)
)
SLIDER_CRANK = SliderCrank(Body(0.3, 2.0, 0.1), Coupler(0.9, 1.0, 0.2), Slider(0.1, 3.0, 4.0, 0.5))
LIMITED = FourBar(Frame(1.0), Body(0.9, 1.0, 0.1), Coupler(0.5), Body(0.5))
PUMP = WindPump(
    Body(0.12, 20.0, 20.0), Coupler(0.8, 40.0, 1.2), Body(1.6, 4.0, 0.85), Piston(1.5, 0, 6, 60)
)
LINKAGES = [FOUR_BAR, SLIDER_CRANK]

NO_NUMBERS = [
    'fast', '1.0', '', b'1', 1j, 1 + 0j, None, True, {}, {1.0}, {0: 1.0}, object(), min, 10**400,
    [None, 1.0], ['a', 1.0], [[1.0], [1.0, 2.0]], [1.0, 2j], np.array([1j, 2.0]),
    np.array(['a', 'b']), np.array([None]), np.array([1j, None]), np.array([True]),
    np.array(['2026-01-01'], 'datetime64[s]'), range, iter([1.0]),
]  # fmt: skip
NOT_FINITE = [math.nan, -math.inf, np.array([1.0, math.nan])]
WRONG_ROWS = [0.3, 3, None, 'a', 'ab', b'ab', 1j, (), (1.0,) * 3, [1.0] * 3, np.zeros(3),
              np.array(1.0), {}, {1.0, 2.0}, {'crank': 1.0, 'slider': 2.0}, min]  # fmt: skip
wrong_row = pytest.mark.parametrize('bad', WRONG_ROWS, ids=range(len(WRONG_ROWS)))


def refused(call, *words):
    """Checks that a call is refused in one line that contains these words."""
    message = one_line_of(call, f'…{words[0]}…', ConfigurationError)
    assert all(word in message for word in words), message


# The solver.


@pytest.mark.parametrize('bad', NO_NUMBERS + NOT_FINITE, ids=range(len(NO_NUMBERS + NOT_FINITE)))
def test_non_real_arguments_are_refused(bad):
    for mechanism in (FOUR_BAR, LIMITED):
        solver = Solver(mechanism)
        for name, call in (
            ('crank angle', lambda solver=solver: solver.state(bad)),
            ('crank speed', lambda solver=solver: solver.state(1.8, bad)),
            ('crank acceleration', lambda solver=solver: solver.state(1.8, 1, bad)),
            ('crank angle', lambda solver=solver: solver.matrix(bad)),
            ('crank speed', lambda solver=solver: solver.energy((1.8,), (bad,))),
            ('torque', lambda solver=solver: solver.accelerations((1.8,), (1.0,), bad)),
        ):
            refused(call, f'{name} = ', ': must be a finite number')
    solver, q, u = Solver(PUMP), (0.3, 1.5), (2.0, 0.1)
    for name, call in (
        ('crank angle', lambda: solver.matrix((bad, 1.5))),
        ('slider position', lambda: solver.accelerations((0.3, bad), u, 6.0)),
        ('slider speed', lambda: solver.energy(q, (2.0, bad))),
        ('slider acceleration', lambda: solver.state(q, u, (0.0, bad))),
        ('torque', lambda: solver.accelerations(q, u, bad)),
    ):
        refused(call, f'{name} = ', ': must be a finite number')


def test_shapes_that_do_not_fit_are_refused():
    solver, two, three = Solver(PUMP), np.array([0.1, 0.2]), np.array([1.5, 1.6, 1.7])
    words = 'the shapes of crank angle (2,), crank speed (3,) do not fit: give one shape'
    refused(lambda: Solver(FOUR_BAR).state([0.1, 0.2], [1.0, 2.0, 3.0]), words)
    refused(
        lambda: solver.matrix((two, three)), 'crank angle (2,), slider position (3,) do not fit'
    )
    words = 'crank angle (2,), torque (3,) do not fit'
    refused(lambda: solver.accelerations((two, 1.5), (1.0, 0.0), three), words)


@pytest.mark.parametrize('mechanism', LINKAGES)
def test_solver_refuses_what_is_no_state_of_its_mechanism(mechanism):
    solver = Solver(mechanism)
    good = solver.state(0.7, 2.0, 1.5)
    pump = Solver(PUMP).state((0.3, 1.5), (2.0, 0.1), (0.0, 0.0))
    for bad in (*NO_NUMBERS, 0.7, (0.7, 2.0, 1.5), tuple(good), [*good], pump):
        for call in (solver.reactions, lambda state: solver.point(state, 'A')):
            refused(lambda call=call, bad=bad: call(bad), 'state = ', 'must be a State of this')
    for name in NO_NUMBERS:
        refused(lambda name=name: solver.point(good, name), 'point ', ': must be one of A0, A, B')


@pytest.mark.parametrize('mechanism', LINKAGES)
def test_solver_refuses_states_filled_with_what_is_no_number(mechanism):
    solver = Solver(mechanism)
    good = solver.state(0.7, 2.0, 1.5)
    for bad in (*NO_NUMBERS, float('nan'), np.array([1.0, np.inf])):
        for name, state in (
            ('crank position', good._replace(position=(bad, *good.position[1:]))),
            ('coupler velocity', good._replace(velocity=(2.0, bad, good.velocity[2]))),
        ):
            refused(lambda state=state: solver.point(state, 'B'), f'{name} = ', 'finite number')
        state = good._replace(position=(bad, *good.position[1:]))
        refused(lambda state=state: solver.reactions(state), 'crank angle = ', 'finite number')
    for bad in (None, 3.0, 'abc'[:2], (1.0, 2.0)):
        refused(lambda bad=bad: solver.reactions(good._replace(position=bad)), 'must be a State')
    uneven = good._replace(position=(np.zeros(2), *good.position[1:]), velocity=(np.zeros(3),) * 3)
    refused(lambda: solver.reactions(uneven), 'crank angle (2,), crank speed (3,)')


def test_reactions_of_a_state_out_of_reach_are_refused():
    """The state of a linkage whose crank turns fully, given to one whose crank does not."""
    for cranks in (3.0, np.array([5.5, 3.0])):
        state = Solver(FOUR_BAR).state(cranks, 1.0)
        with pytest.raises(UnreachableError, match='cannot move at 171'):
            Solver(LIMITED).reactions(state)


@wrong_row
def test_wrong_numbers_of_coordinates_are_refused(bad):
    solver, q = Solver(PUMP), (0.3, 1.5)
    words = (
        'crank angle, slider position',
        'crank speed, slider speed',
        'crank acceleration, slider acceleration',
    )
    for letter, expected, call in (
        ('q', words[0], lambda: solver.matrix(bad)),
        ('q', words[0], lambda: solver.accelerations(bad, q, 1.0)),
        ('u', words[1], lambda: solver.energy(q, bad)),
        ('u', words[1], lambda: solver.accelerations(q, bad, 1.0)),
        ('a', words[2], lambda: solver.state(q, q, bad)),
    ):
        refused(call, f'{letter} = ', f'must be a tuple ({expected})')


def test_one_value_for_two_coordinates_and_two_for_one_are_refused():
    refused(lambda: Solver(PUMP).matrix((0.3,)), 'q = (0.3,): must be a tuple (crank')
    refused(lambda: Solver(PUMP).energy((0.3, 1.5), [2.0]), 'u = [2.0]: must be')
    refused(
        lambda: Solver(FOUR_BAR).accelerations((0.3, 1.5), (2.0,), 1.0),
        'q = (0.3, 1.5): must be a tuple (crank angle,)',
    )
    # Two values in all, as there should be, but no coordinate among them.
    refused(lambda: Solver(FOUR_BAR).energy((), (2.0, 1.0)), 'q = ()')


# What is taken.


@pytest.mark.parametrize(
    'two', [2, np.int64(2), np.float32(2), Fraction(2), Decimal(2), np.array(2), np.float64(2)]
)
def test_all_kinds_of_real_numbers_are_floats(two):
    solver = Solver(FOUR_BAR)
    expected = solver.state(2.0, 2.0, 2.0)
    found = solver.state(two, two, two)
    assert found == expected
    assert {type(x) for x in (*found.velocity, found.torque)} == {float}
    assert solver.matrix(two) == solver.matrix(2.0)
    assert solver.reactions(expected._replace(position=(two, *expected.position[1:])))
    assert solver.energy((two,), (two,)) == solver.energy(2.0, 2.0)
    found = solver.accelerations([two], np.array([two], object), two)
    assert found == [solver.accelerations(2.0, 2.0, 2.0)]


def test_nested_sequences_are_arrays():
    solver, pump = Solver(SLIDER_CRANK), Solver(PUMP)
    angles = [[0.1, 0.2], [0.3, 0.4]]
    assert np.array_equal(solver.matrix(angles), solver.matrix(np.array(angles)))
    assert np.array_equal(solver.state(angles).torque, solver.state(np.array(angles)).torque)
    found = pump.energy((angles, 1.5), ((2, 3), 0))
    expected = pump.energy((np.array(angles), 1.5), (np.array([2.0, 3.0]), 0.0))
    assert np.array_equal(found, expected)
    rows = np.array([[0.1, 0.2, 0.3], [1.4, 1.5, 1.6]])
    found = pump.accelerations(rows, (2.0, 0.1), 6.0)
    assert np.array_equal(found, pump.accelerations(tuple(rows), (2.0, 0.1), 6.0))


@pytest.mark.parametrize('mechanism', [*LINKAGES, PUMP])
def test_energy_that_overflows_is_refused(mechanism):
    solver = Solver(mechanism)
    q, u = ((0.3, 1.5), (1e160, 0.0)) if mechanism is PUMP else (0.3, 1e160)
    refused(lambda: solver.energy(q, u), 'overflows at crank angle = 0.3', 'crank speed = 1e+160')
