# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The wind pump at the edge of its coordinates, where coupler and rod are in line."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mpmath import mp
from oracle import Oracle

from linkage_ros import (
    Body,
    ConfigurationError,
    Coupler,
    MechanismError,
    Piston,
    Solver,
    UnreachableError,
    WindPump,
)
from linkage_ros.parameters.configuration import load

PUMP = load('wind_pump').mechanism
NAMES = ('crank', 'coupler', 'rod')


def every_answer(solver, q, u):
    """The calls that need the links' rates."""
    return (
        lambda: solver.accelerations(q, u, 6.0),
        lambda: solver.state(q, u, (0.0, 0.0)),
        lambda: solver.matrix(q),
        lambda: solver.energy(q, u),
    )


@pytest.mark.parametrize(
    ('q', 'words'),
    [
        ((0.0, 2.6), 'do not reach or are stretched at crank angle 0 deg and slider position 2.6'),
        ((0.0, 0.5), 'do not fit in or are folded .* within -2.28 to -0.68 or 0.92 to 2.52 m'),
        ((0.0, -3.0), 'do not reach'),
        ((np.array([0.0, 0.3]), np.array([1.5, 9.0])), 'at crank angle 17.1887339 deg .* 9 m'),
        ((np.zeros((2, 3)), np.array([[1.5], [-9.0]])), 'at crank angle 0 deg .* -9 m'),
    ],
)
def test_where_the_dyad_does_not_close_there_is_one_clear_error(q, words):
    solver = Solver(PUMP)
    for call in every_answer(solver, q, (1.0, 0.0)):
        with pytest.raises(UnreachableError, match=words):
            call()


@pytest.mark.parametrize('slide', [2.52, 0.92, -2.28, -0.68])
def test_at_the_stretched_and_the_folded_point_itself_all_is_refused(slide):
    """No double is that point: the margins are 1e-16 m^2 there, of either sign."""
    solver = Solver(PUMP)
    words = 'stretched' if abs(slide) > 2 else 'folded'
    with pytest.raises(UnreachableError, match=f'{words} at crank angle 0 deg'):
        solver.forward((0.0, slide, 2.0, 0.1), 6.0)
    for q in ((0.0, slide), (np.array([0.1, 0.0]), np.array([1.5, slide]))):
        for call in every_answer(solver, q, (2.0, 0.1)):
            with pytest.raises(UnreachableError, match=f'{words} at crank angle 0 deg'):
                call()
    assert solver.alignment((0.0, slide)) == (0.0, 'coupler and rod are in line')


def edges(pump, crank):
    """Where the slider's pin is when coupler and rod are in line, m, exactly."""
    r, b, c = (mp.mpf(getattr(pump, name).length) for name in NAMES)
    x, y = r * mp.cos(mp.mpf(crank)), r * mp.sin(mp.mpf(crank))
    for radius in (b + c, abs(b - c)):
        if radius > abs(y):
            for side in (1, -1):
                yield x + side * mp.sqrt(radius**2 - y**2), side if radius == b + c else -side


@settings(max_examples=20, deadline=None)
@given(
    st.integers(-300, 300), st.floats(0.01, 0.4), st.floats(0.5, 2), st.floats(0.5, 2),
    st.one_of(st.sampled_from([0.0, math.pi, math.pi / 2]), st.floats(-1000, 1000)),
)  # fmt: skip
def test_the_double_nearest_to_an_edge_is_refused_and_one_beside_it_answers(power, r, b, c, crank):
    unit = 10.0 ** (power / 100)
    pump = WindPump(
        Body(r * unit, 1.0, unit**2), Coupler(b * unit, 2.0, unit**2),
        Body(c * unit, 3.0, unit**2), Piston(unit, 0.0, 1.0, 0.0),
    )  # fmt: skip
    solver = Solver(pump)
    total = sum(getattr(pump, name).length for name in NAMES)
    with mp.workdps(60):
        for edge, outward in edges(pump, crank):
            with pytest.raises(UnreachableError):
                solver.accelerations((crank, float(edge)), (2.0, 0.1 * unit), 6.0)
            # A hundred roundings inside, along the way that opens the dyad.
            r2 = (edge - mp.mpf(pump.crank.length) * mp.cos(crank)) ** 2
            steep = mp.sqrt(r2) / total
            inside = float(edge - outward * 100 * math.ulp(total) / steep)
            found = solver.accelerations((crank, inside), (2.0, 0.1 * unit), 6.0)
            assert np.isfinite(found).all()


def test_equal_links_answer_close_to_the_crank_pin():
    """There coupler and rod fold back on each other: nothing cancels, so nothing is refused."""
    pump = WindPump(
        Body(0.12, 20.0, 20.0), Coupler(0.8, 4.0, 1.2), Body(0.8, 4.0, 0.85),
        Piston(1.5, 0.0, 6.0, 60.0),
    )  # fmt: skip
    solver = Solver(pump)
    for apart in (1e-3, 1e-6, 1e-9, 1e-12):
        q, u = (0.0, 0.12 + apart), (2.0, 0.1)
        exact = Oracle(pump).state(q, u, 6.0)
        state = solver.state(q, u, (0.0, 0.0))
        assert state.velocity == pytest.approx([float(x) for x in exact.velocity], rel=1e-12)
        assert np.isfinite(solver.accelerations(q, u, 6.0)).all()
    with pytest.raises(UnreachableError):
        solver.accelerations((0.0, 0.12), (2.0, 0.1), 6.0)


def test_what_overflows_or_has_no_mass_is_refused():
    words = r'overflows at .*, crank speed = 1e\+200, slider speed = 0, torque = 1: lower them'
    with pytest.raises(ConfigurationError, match=words):
        Solver(PUMP).accelerations((0.0, 1.5), (1e200, 0.0), 1.0)
    bare = WindPump(Body(0.12), Coupler(0.8), Body(1.6), Piston(1.5), 'crossed')
    with pytest.raises(MechanismError, match='something moves without a mass'):
        Solver(bare).accelerations((0.0, 1.5), (1.0, 0.0), 1.0)


@pytest.mark.parametrize('what', [3, None, WindPump, PUMP.crank])
def test_a_solver_refuses_what_is_no_mechanism(what):
    with pytest.raises(MechanismError, match='must be a mechanism, such as a FourBar'):
        Solver(what)


def test_a_pump_has_no_reach_because_its_crank_does_not_tell_all_of_it():
    solver = Solver(PUMP)
    assert solver.mobility is None
    with pytest.raises(MechanismError, match='a WindPump has 2 degrees of freedom: its crank'):
        _ = solver.reach
    with pytest.raises(
        ConfigurationError, match=r'must be a tuple \(crank angle, slider position\)'
    ):
        solver.state(0.3)
