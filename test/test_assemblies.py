# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How many ways there are to assemble a linkage at a crank angle, as document 2 counts them."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from mechanisms import CHANGE_POINTS, FULL, LIMITED, PUMPS, of

from linkage_ros import ConfigurationError, MechanismError, Solver, assemblies
from linkage_ros.dynamics.state import loop_residual

NEAR = 1e-12  # rad beside a limit; rounding of the limit itself is a few 1e-16


def counts(mechanism, *cranks):
    """The number of positions at each angle, each of which closes the loop."""
    solver, found = Solver(mechanism), []
    for crank in cranks:
        positions = assemblies(mechanism, crank)
        for position in positions:
            gap = loop_residual(solver.structure, SimpleNamespace(position=position))
            assert gap < 1e-14, (crank, position)
            assert position[0] == crank
        found.append(len(positions))
    return found


@pytest.mark.parametrize('name', LIMITED)
def test_count_changes_at_the_ends_of_the_reach(name):
    for angle in (0.3, -4.0):
        mechanism = of(LIMITED[name], angle=angle)
        for start, end in Solver(mechanism).reach.arcs:
            assert counts(mechanism, start - NEAR, start, start + NEAR) == [0, 1, 2]
            assert counts(mechanism, end - NEAR, end, end + NEAR) == [2, 1, 0]


@pytest.mark.parametrize(('name', 'at'), [('parallelogram', 0.0), ('both', math.pi / 2)])
def test_assemblies_meet_at_a_change_point(name, at):
    mechanism = of(CHANGE_POINTS[name], angle=0.0)
    assert counts(mechanism, at - NEAR, at, at + NEAR) == [2, 1, 2]


@pytest.mark.parametrize('name', FULL)
def test_a_crank_that_turns_fully_has_two_assemblies_everywhere(name):
    mechanism = of(FULL[name])
    cranks = np.linspace(-7.0, 7.0, 23).tolist()
    assert counts(mechanism, *cranks) == [2] * 23
    for crank in cranks:
        own = [Solver(of(FULL[name], assembly=each)).state(crank) for each in ('open', 'crossed')]
        assert list(assemblies(mechanism, crank)) == [state.position for state in own]


def test_a_wind_pump_or_no_angle_is_refused():
    with pytest.raises(MechanismError, match='2 degrees of freedom'):
        assemblies(PUMPS['pump'], 0.0)
    for wrong, words in ((math.nan, 'nan'), ('a', "'a'"), (None, 'None'), ([1.0, 2.0], '')):
        with pytest.raises(ConfigurationError, match=f'crank angle = .*{words}'):
            assemblies(of(FULL['centric']), wrong)
