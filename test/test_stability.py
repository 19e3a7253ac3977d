# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where the defaults are right, where each other method fails, and linkage_chart stability."""

import pytest
from test_method_charts import run_quick

from linkage_ros.lab.commands import stability as stability_chart
from linkage_ros.lab.methods.loads import (
    CURVE_METHODS,
    CURVE_SITUATIONS,
    FRICTION_METHODS,
    FRICTION_SITUATIONS,
    GROWN,
    STRAIGHT,
)
from linkage_ros.lab.methods.measure import (
    DIVERGED,
    NAN,
    REFUSED,
    RIGHT,
    WRONG_BRANCH,
    measure_outcomes,
)
from linkage_ros.lab.methods.motion_cases import MOTION_SITUATIONS
from linkage_ros.lab.methods.registry import DEFAULT, INTEGRATORS, LIVE, METHODS, RECORDS
from linkage_ros.lab.methods.situations import SITUATIONS

DEFAULTS = DEFAULT, STRAIGHT, GROWN, LIVE, RECORDS
GRIDS = stability_chart.GRIDS
NAMED = {
    ('factored, float32', 'near a change point'): DIVERGED,
    ('half-angle', 'half-angle denominator'): NAN,
    ('two circles', 'ordinary'): RIGHT,
    ('two circles', 'change point passed'): WRONG_BRANCH,
    ('Newton-Raphson', 'wrong first guess'): WRONG_BRANCH,
    ('Newton-Raphson', 'few steps'): WRONG_BRANCH,
    ('Newton-Raphson', 'no assembly'): DIVERGED,
    ("document 1's listing", 'few steps'): NAN,
    ('table, cubic Hermite', 'near a change point'): DIVERGED,
    ('table, cubic Hermite', 'dead centre'): REFUSED,
    ('2x2 solve', 'change point hit'): NAN,
    ('central differences', 'near a change point'): DIVERGED,
    ('cubic spline', 'corner of a load curve'): DIVERGED,
    ('even nodes', 'corner of a load curve'): DIVERGED,
    ('Newton, at once', 'friction that relieves'): DIVERGED,
    ('fixed point', 'nearly self-locking'): DIVERGED,
    ('DOP853', 'stretched dyad'): NAN,
    ('DOP853', 'steep motor line'): NAN,
    ('RK4', 'stretched dyad'): DIVERGED,
    ('RK4', 'steep motor line'): DIVERGED,
    ('Radau', 'stiff guide'): RIGHT,
    ('Radau', 'stretched dyad'): DIVERGED,
    ('multipliers, unstabilised', 'change point under a torque'): DIVERGED,
    ('multipliers, unstabilised', 'loop after a long run'): DIVERGED,
    ('multipliers, unstabilised', 'stretched dyad'): RIGHT,
    # A loop that is held closed stays so, but the rest is as it was.
    ('multipliers, Baumgarte', 'loop after a long run'): RIGHT,
    ('multipliers, Baumgarte', 'change point under a torque'): DIVERGED,
    ('multipliers, projected', 'loop after a long run'): RIGHT,
    ('multipliers, projected', 'steep motor line'): NAN,
}


@pytest.mark.parametrize(
    ('situation', 'methods'),
    [(situation, methods) for methods, situations in GRIDS for situation in situations],
    ids=lambda value: getattr(value, 'name', ''),
)
def test_defaults_are_right_or_refuse_and_others_fail_where_they_are_named(situation, methods):
    chosen = [m for m in methods if m.name in DEFAULTS or (m.name, situation.name) in NAMED]
    for cell in measure_outcomes([situation], chosen, cases=2, progress=lambda items, _: items):
        if cell['method'] not in DEFAULTS:
            assert cell['outcome'] == NAMED[cell['method'], cell['situation']], cell
            continue
        assert cell['outcome'] == (RIGHT if situation.exists else REFUSED), cell
        largest = {DEFAULT: 1e-8, STRAIGHT: 1e-9, GROWN: 1e-10}.get(
            cell['method'], 1e-7 if situation.exists else 1e-3
        )
        assert cell['worst_error'] is None or cell['worst_error'] < largest, cell
        assert cell['worst_error'] is not None or not situation.exists


def test_every_method_but_the_defaults_has_a_cell_where_it_fails():
    failing = {method for (method, _), outcome in NAMED.items() if outcome != RIGHT}
    assert failing == {m.name for methods, _ in GRIDS for m in methods} - {*DEFAULTS}
    assert {place for _, place in NAMED} <= {s.name for _, places in GRIDS for s in places}


def test_command_writes_a_picture_and_the_cells(tmp_path, monkeypatch):
    chosen = (
        SITUATIONS[5:6], CURVE_SITUATIONS[:1], FRICTION_SITUATIONS[1:2], MOTION_SITUATIONS[1:2],
    )  # fmt: skip
    grids = tuple((methods, few) for (methods, _), few in zip(GRIDS, chosen, strict=True))
    monkeypatch.setattr(stability_chart, 'GRIDS', grids)
    written, records = run_quick('stability', tmp_path)
    assert written == ['stability.json', 'stability.png']
    assert set(records[0]) == {'method', 'situation', 'outcome', 'worst_error'}
    all_methods = *METHODS, *CURVE_METHODS, *FRICTION_METHODS, *INTEGRATORS
    assert len(records) == len(all_methods)
    assert all(r['worst_error'] is None or r['worst_error'] >= 0 for r in records)
    assert {r['outcome'] for r in records} == {RIGHT, REFUSED, DIVERGED, NAN}
