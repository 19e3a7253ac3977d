# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Laws that hold for all mechanisms, regardless of links and number of coordinates."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mechanisms import (
    ALL,
    ANY,
    TURN,
    coordinates,
    kinds,
    longest,
    motion,
    moving,
    rows,
)
from mpmath import mp
from oracle import Oracle

from linkage_ros import Solver

every = pytest.mark.parametrize('name', ALL)
any_of = pytest.mark.parametrize('kind', ANY)
few = settings(max_examples=15)


@pytest.mark.parametrize('name', ['crank_rocker', 'offset_right', 'pump'])
@pytest.mark.parametrize('shape', [(0,), (3, 0), (1,), (2, 1, 4)])
def test_results_have_the_shape_of_the_angles(name, shape):
    mechanism = ALL[name]
    solver = Solver(mechanism)
    angles = np.arange(math.prod(shape), dtype=float).reshape(shape)
    q, u, a = motion(mechanism, angles)
    state = solver.state(q, u, a)
    got = rows(state)
    assert got.shape == (len(kinds(mechanism)), *shape)
    flat = rows(solver.state(tuple(x.ravel() for x in q), u, a))
    assert np.array_equal(got.reshape(len(got), -1), flat)
    # Non-contiguous views are also read correctly.
    transposed = solver.state(tuple(x.T for x in q), u, a).torque
    assert np.allclose(transposed, state.torque.T, rtol=1e-14, atol=0)
    forces = solver.reactions(state)
    found = *solver.point(state, 'B'), *forces.pins.values(), forces.shaking_force
    assert {np.shape(x) for pair in found for x in pair} == {shape}
    speeds = np.array([1.0, -2.0])
    assert np.shape(moving(solver, angles[..., None], speeds).torque) == (*shape, 2)


@any_of
@few
@given(data=st.data(), crank=st.floats(-20, 20))
def test_angles_stay_in_range_and_coordinates_are_returned_as_asked(kind, data, crank):
    mechanism = data.draw(ANY[kind]())
    solver, q = Solver(mechanism), coordinates(mechanism, crank)
    state = solver.state(q)
    asked = [state.position[solver.links.index(name)] for name in solver.coordinates]
    assert tuple(asked) == q
    for link, position in zip(solver.structure.links[1:], state.position[1:], strict=True):
        assert link.slides or abs(position) <= math.pi


def gap(mechanism, position):
    """Returns the closure error of the loop, m, in the precision that the caller has set."""
    oracle, rest = Oracle(mechanism), [0.0] * len(position)
    vectors = oracle.vectors(SimpleNamespace(position=position))
    output = oracle.points(vectors)['D' if oracle.is_free else 'B']
    end, *_ = oracle.follow(output, vectors, rest, rest)
    return abs(sum(vectors[: 2 + oracle.is_free]) - end)


@any_of
@few
@given(data=st.data(), crank=st.floats(-TURN, TURN, allow_subnormal=False))
def test_loop_closes_within_8_ulp_of_the_longest_link(kind, data, crank):
    mechanism = data.draw(ANY[kind]())
    solver, q = Solver(mechanism), coordinates(mechanism, crank)
    for state in (solver.state(q), solver.state(tuple(np.array([x]) for x in q))):
        position = [float(np.ravel(x)[0]) for x in state.position]
        slides = [abs(x) for x, link in zip(position, solver.structure.links, strict=True)
                  if link.slides]  # fmt: skip
        with mp.workdps(40):
            residual = gap(mechanism, position)
        assert residual <= 8 * math.ulp(max(longest(mechanism), *slides, 0.0))


@every
def test_torque_is_linear_in_accelerations_and_inverted_by_them(name):
    """M q'' + h - Q = torque; M is symmetric, positive definite, and gives the kinetic energy."""
    mechanism = ALL[name]
    solver = Solver(mechanism)
    for crank in np.linspace(-6.0, 6.5, 12).tolist():
        q, u, a = motion(mechanism, crank)
        matrix, rest = np.array(solver.matrix(q)), (0.0,) * len(u)
        assert np.all(np.linalg.eigvalsh(matrix) > 0)
        assert np.array_equal(matrix, matrix.T)
        kinetic, _ = solver.energy(q, u)
        assert kinetic == pytest.approx(u @ matrix @ u / 2, rel=1e-12)
        torque, held = (solver.state(q, u, x).torque for x in (a, rest))
        size = abs(torque) + abs(held) + np.max(np.abs(matrix)) * max(map(abs, a))
        assert torque - held == pytest.approx(matrix[0] @ a, rel=0, abs=1e-12 * size)
        found = solver.accelerations(q, u, 5.0)
        assert solver.driven_by(lambda _: 5.0)(*q, *u) == found
        size = 5.0 + np.max(np.abs(matrix)) * max(map(abs, found))
        assert solver.state(q, u, found).torque == pytest.approx(5.0, rel=0, abs=1e-13 * size)


@every
def test_energy_equals_the_reference_except_for_a_constant(name):
    mechanism = ALL[name]
    solver, oracle, levels = Solver(mechanism), Oracle(mechanism), []
    for crank in (0.5, 1.7, 3.1, -2.0):
        q, u, _ = motion(mechanism, crank)
        kinetic, potential = solver.energy(q, u)
        with mp.workdps(40):
            at = (q, u) if oracle.is_free else (crank, u[0])
            levels.append(kinetic + potential - float(oracle.energy(*at)))
            size = abs(kinetic) + abs(potential)
    assert max(levels) - min(levels) < 1e-12 * size
