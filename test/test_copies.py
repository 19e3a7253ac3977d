# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Copies of a mechanism with other values equal mechanisms created with these values."""

from dataclasses import fields, replace

import pytest
import test_loads
from mechanisms import motion

from linkage_ros import LoadCurve, Solver, load
from linkage_ros.quantities import build, flatten

CRANKS = 0.8, -3.0
ROWS = {
    'pressure': ('pressure_bar', [[-10, 1], [0, 30], [90, 4]]),
    'value': ('value', [[-10, 1], [0, 30], [90, 4]]),
    'two turns': ('value', [[-10, 1], [0, 30], [450, 4]]),
}  # fmt: skip
SHAPER = replace(load('shaper').mechanism, loads=())
SLIDERS = {
    **{name: (test_loads.MACHINES[name], link) for name, link in (
        ('slider_crank', 'slider'), ('cylinder', 'rod'), ('driven_cylinder', 'rod'))},
    'shaper': (SHAPER, 'ram_slider'),
}  # fmt: skip
CASES = [(test_loads.MACHINES[name], load) for name, load in test_loads.CASES]


def changed_values(mechanism):
    """Returns other values for all lengths, offsets and angles, by name."""
    values = flatten(replace(mechanism, loads=()))
    names = [x for x in values if x.split('.')[-1] in {'length', 'offset', 'angle'}]
    return {name: 1.01 * values[name] + 0.001 * i for i, name in enumerate(names, 1)}


def check_copies(mechanism, given):
    """Compares the torques of a mechanism changed in two ways with those of a new one."""
    changed = changed_values(mechanism)
    new = build(type(mechanism), {**flatten(mechanism), **changed})
    parts = {x.name: getattr(new, x.name) for x in fields(new) if x.name != 'loads'}
    base, created = (replace(x, loads=(given,)) for x in (mechanism, new))
    expected = driven(created)
    assert expected != driven(base)
    for copy in (replace(base, **parts), build(type(base), flatten(created))):
        assert driven(copy) == expected


def driven(mechanism):
    """Returns the torques of a motion; for a wind pump, the accelerations under a torque."""
    solver, motions = Solver(mechanism), [motion(mechanism, crank) for crank in CRANKS]
    if len(mechanism.coordinates) == 2:
        return [solver.accelerations(q, u, 1.5) for q, u, _ in motions]
    return [solver.torque(*x) for x in motions]


@pytest.mark.parametrize(('mechanism', 'given'), CASES, ids=lambda x: getattr(x, 'label', ''))
def test_copies_with_a_load_have_the_torque_of_a_new_mechanism(mechanism, given):
    check_copies(mechanism, given)


@pytest.mark.parametrize('rows', ROWS)
@pytest.mark.parametrize('top', ['far', 'near'])
@pytest.mark.parametrize('name', SLIDERS)
def test_copies_keep_a_curve_at_their_own_top(tmp_path, name, top, rows):
    (column, points), (mechanism, link) = ROWS[rows], SLIDERS[name]
    lines = ['crank_angle_from_tdc_deg,' + column, *(f'{x},{y}' for x, y in points)]
    (tmp_path / 'tdc.csv').write_text('\n'.join(lines))
    bore = {'bore': 0.1} if rows == 'pressure' else {}
    check_copies(mechanism, LoadCurve(link, file=str(tmp_path / 'tdc.csv'), top=top, **bore))
