# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What every method comes to in every situation, as linkage_chart stability --quick finds it."""

from __future__ import annotations

import pytest
from test_method_charts import EVERY, PLACES, run_quick

from linkage_ros.lab.methods.motion_situations import MOTION_SITUATIONS
from linkage_ros.lab.methods.outcomes import (
    DIVERGED,
    NAN,
    OUTCOMES,
    REFUSED,
    RIGHT,
    WRONG_BRANCH,
    Cell,
)
from linkage_ros.lab.methods.registry import DEFAULT, INTEGRATORS, LIVE, METHODS, RECORDS
from linkage_ros.lab.methods.situations import SITUATIONS

BY_NAME = {situation.name: situation for situation in (*SITUATIONS, *MOTION_SITUATIONS)}
UNSTABILISED = ('multipliers, unstabilised',)


@pytest.fixture(scope='module')
def chart(tmp_path_factory):
    """Paths and records: half a minute, so that all tests look at the same."""
    return run_quick('stability', tmp_path_factory.mktemp('chart'))


@pytest.fixture(scope='module')
def cells(chart):
    return [Cell(**record) for record in chart[1]]


def test_a_picture_and_the_cells_are_written(chart):
    written, records = chart
    assert [path.name for path in written] == ['stability.json', 'stability.png']
    assert set(records[0]) == {'method', 'situation', 'outcome', 'worst_error'}
    for record in records:
        assert record['worst_error'] is None or record['worst_error'] >= 0


def test_the_grid_is_full(cells):
    of_states, of_motions = (
        len(METHODS) * len(SITUATIONS),
        len(INTEGRATORS) * len(MOTION_SITUATIONS),
    )
    assert len({(c.method, c.situation) for c in cells}) == len(cells) == of_states + of_motions
    assert {c.method for c in cells} == EVERY
    assert {c.situation for c in cells} == PLACES
    methods = {method.name for method in METHODS}
    assert {c.outcome for c in cells if c.method in methods} == set(OUTCOMES)


# ---------------------------------------------------------------- states


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


# ---------------------------------------------------------------- motions


def test_the_defaults_follow_every_motion_or_say_when_it_ends(cells):
    for cell in cells:
        if cell.method in (LIVE, RECORDS):
            right = RIGHT if BY_NAME[cell.situation].exists else REFUSED
            assert cell.outcome == right, cell
            assert cell.worst_error < (1e-7 if right == RIGHT else 1e-3), cell


@pytest.mark.parametrize(
    ('method', 'situation', 'expected'),
    [
        ('DOP853', 'stretched dyad', NAN),
        ('RK4', 'stretched dyad', DIVERGED),
        ('Radau', 'stretched dyad', DIVERGED),
        ('multipliers, unstabilised', 'change point under a torque', DIVERGED),
        ('multipliers, unstabilised', 'loop after a long run', DIVERGED),
    ],
)
def test_every_other_integrator_has_a_named_cell_where_it_fails(
    cells, method, situation, expected
):
    (cell,) = (c for c in cells if (c.method, c.situation) == (method, situation))
    assert cell.outcome == expected


def test_the_named_cells_are_of_all_integrators():
    ((_, marks),) = [
        (mark.args[0], mark.args[1])
        for mark in test_every_other_integrator_has_a_named_cell_where_it_fails.pytestmark
    ]
    assert {m for m, _, _ in marks} == {m.name for m in INTEGRATORS} - {LIVE, RECORDS}


def test_what_has_no_dyad_goes_on_where_the_coordinates_end(cells):
    (cell,) = (c for c in cells if (c.method, c.situation) == (*UNSTABILISED, 'stretched dyad'))
    assert cell.outcome == RIGHT
