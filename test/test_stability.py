# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The rule by which outcomes are told, on planted failures, and what the real methods come to."""

from __future__ import annotations

import math

import numpy as np
import pytest

from linkage_ros import ConfigurationError, Solver
from linkage_ros.core.numeric import SCALAR
from linkage_ros.methods.chain import BATCH, ONE, POSITION, RATES, Chain
from linkage_ros.methods.linkages import other_assembly
from linkage_ros.methods.positions import factored
from linkage_ros.methods.reference import Reference
from linkage_ros.methods.situations import SITUATIONS
from linkage_ros.methods.stability import (
    DIVERGED,
    NAN,
    OUTCOMES,
    REFUSED,
    RIGHT,
    WRONG_BRANCH,
    measure,
)
from linkage_ros.methods.table import DEFAULT, METHODS, Method

BY_NAME = {situation.name: situation for situation in SITUATIONS}


def plain(items, _):
    return items


def planted(locate, stage=POSITION, modes=(ONE,)):
    """A method of that position, made for numbers; arrays of one are taken for a number."""

    def make(task, *_):
        right = factored(task.mechanism, SCALAR)

        def position(crank):
            if np.ndim(crank):
                return np.array([locate(task, right, x) for x in crank.tolist()]).T
            return locate(task, right, crank)

        def nothing(_):
            raise NotImplementedError

        return Chain(position, position, position, nothing)

    return Method('planted', stage, '', '', make, modes=modes)


def outcome(locate, situation='ordinary', **options):
    (cell,) = measure(
        [BY_NAME[situation]], cases=2, progress=plain, methods=(planted(locate, **options),)
    )
    return cell.outcome, cell.worst_error


def other_side(task, _, crank):
    state = Solver(other_assembly(task.mechanism)).state(crank)
    return state.position[1:]


def failing_once(value):
    """Right but at one of the angles."""

    def locate(_, right, crank):
        coupler, output = right(crank)
        return (value(coupler) if 3.0 < crank < 3.2 else coupler), output

    return locate


def raised(error):
    def value(_):
        raise error

    return value


def test_what_is_right_is_called_so():
    found, error = outcome(lambda _, right, crank: right(crank))
    assert (found, error < 1e-15) == (RIGHT, True)
    found, error = outcome(failing_once(lambda x: x + 1e-9))
    assert (found, error) == (RIGHT, pytest.approx(1e-9, rel=1e-3))


@pytest.mark.parametrize(
    ('value', 'expected'),
    [
        (lambda x: x + 1e-5, DIVERGED),
        (lambda x: 1e300 + x, DIVERGED),
        (lambda _: math.nan, NAN),
        (lambda _: -math.inf, NAN),
        (raised(ZeroDivisionError()), NAN),
        (raised(ValueError('math domain error')), NAN),
        (raised(OverflowError()), NAN),
        (raised(np.linalg.LinAlgError()), NAN),
        (raised(ConfigurationError('no such state')), REFUSED),
    ],
)
def test_one_planted_failure_decides(value, expected):
    assert outcome(failing_once(value))[0] == expected


def test_the_other_assembly_is_a_wrong_branch():
    found, error = outcome(other_side)
    assert found == WRONG_BRANCH
    assert error > 0.01


def test_the_other_assembly_missed_is_no_branch():
    def locate(task, right, crank):
        coupler, output = other_side(task, right, crank)
        return coupler + 1e-4, output

    assert outcome(locate)[0] == DIVERGED


def test_a_wrong_rate_is_no_branch():
    assert outcome(other_side, stage=RATES)[0] == DIVERGED


def test_where_no_state_exists_only_a_refusal_is_right():
    assert outcome(lambda _, right, crank: right(crank), 'no assembly')[0] == REFUSED
    assert outcome(lambda *_: (0.1, 0.2), 'no assembly')[0] == DIVERGED
    assert outcome(lambda *_: (math.nan, 0.2), 'no assembly')[0] == NAN


def test_a_refusal_at_one_angle_hides_nothing_at_the_others():
    def locate(_, right, crank):
        if 3.0 < crank < 3.2:
            raise ConfigurationError('no such state')
        coupler, output = right(crank)
        return coupler + 1.0, output

    assert outcome(locate)[0] == DIVERGED
    # An array is refused as a whole; then each of its angles is asked by itself.
    assert outcome(locate, modes=(BATCH,))[0] == DIVERGED


def test_where_no_state_exists_every_angle_has_to_be_refused():
    refused = []

    def locate(_, right, crank):
        if not refused:
            refused.append(crank)
            right(crank)
        return 0.1, 0.2

    assert outcome(locate, 'no assembly')[0] == DIVERGED


def test_a_programming_error_is_no_outcome():
    with pytest.raises(KeyError):
        outcome(failing_once(raised(KeyError('typo'))))


# ---------------------------------------------------------------- the real grid


@pytest.fixture(scope='module')
def cells():
    return measure(SITUATIONS, cases=4, progress=plain)


def test_the_default_is_right_or_refuses_everywhere(cells):
    for cell in cells:
        if cell.method == DEFAULT:
            right = RIGHT if BY_NAME[cell.situation].exists else REFUSED
            assert cell.outcome == right, cell
            assert cell.worst_error is None or cell.worst_error < 1e-8, cell


@pytest.mark.parametrize(
    ('method', 'situation', 'expected'),
    [
        ('factored, float32', 'near a change point', DIVERGED),
        ('half-angle', 'half-angle denominator', NAN),
        ('inverse cosine', 'change point passed', WRONG_BRANCH),
        ('Newton-Raphson, warm', 'wrong first guess', WRONG_BRANCH),
        ('Newton-Raphson, warm', 'few steps', WRONG_BRANCH),
        ('Newton-Raphson, cold', 'no assembly', DIVERGED),
        ('table, cubic Hermite', 'near a change point', DIVERGED),
        ('Fourier series', 'dead centre', REFUSED),
        ('2x2 solve', 'change point hit', NAN),
        ('sine formula', 'change point hit', NAN),
        ('central differences', 'near a change point', DIVERGED),
        ('power balance', 'crank at rest', NAN),
        ('constrained Newton-Euler', 'near a change point', DIVERGED),
    ],
)
def test_every_other_method_has_a_named_cell_where_it_fails(cells, method, situation, expected):
    (cell,) = (c for c in cells if (c.method, c.situation) == (method, situation))
    assert cell.outcome == expected


def test_the_named_cells_are_of_all_methods(cells):
    ((_, marks),) = [
        (mark.args[0], mark.args[1])
        for mark in test_every_other_method_has_a_named_cell_where_it_fails.pytestmark
    ]
    assert {method for method, _, _ in marks} == {m.name for m in METHODS} - {DEFAULT}


def test_the_grid_is_full(cells):
    assert len(cells) == len(METHODS) * len(SITUATIONS)
    assert {cell.outcome for cell in cells} == set(OUTCOMES)
    assert set(cells[0].record()) == {'method', 'situation', 'outcome', 'worst_error'}


# ---------------------------------------------------------------- situations


@pytest.mark.parametrize('situation', SITUATIONS, ids=lambda situation: situation.name)
def test_situations_are_the_same_every_time_and_as_many_as_asked(situation):
    cases = situation.cases(5)
    assert len(cases) >= 5
    assert cases == situation.cases(5)
    assert situation.words
    assert len({case.task.mechanism for case in cases}) > 1 or 'links' in situation.name


@pytest.mark.parametrize('situation', SITUATIONS, ids=lambda situation: situation.name)
def test_states_exist_where_situations_say_so(situation):
    for case in situation.cases(3):
        reference = Reference(case.task, case.lengths)
        for crank in case.cranks:
            if situation.exists:
                reference.state(crank)
            else:
                with pytest.raises(Exception, match='does not close'):
                    reference.state(crank)
