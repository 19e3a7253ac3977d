# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Laws of all mechanisms, printed values of the documents, and edge cases of rounding."""

import cmath
import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mechanisms import (
    ALL,
    ANY,
    ASSEMBLIES,
    DOCUMENT_1,
    TURN,
    coordinates,
    examples,
    four_bar,
    kinds,
    longest,
    motion,
    moving,
    rows,
    slider_crank,
    worst_errors,
)
from mpmath import mp
from oracle import Oracle

from linkage_ros import (
    Body,
    Coupler,
    FourBar,
    Frame,
    LinkLoad,
    Piston,
    Solver,
    UnreachableError,
    WindPump,
)
from linkage_ros.settings.configuration import load

every = pytest.mark.parametrize('name', ALL)
any_of = pytest.mark.parametrize('kind', ANY)
few = examples(15)


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
            residual = Oracle(mechanism).gap(position)
        assert residual <= 8 * math.ulp(max(longest(mechanism), *slides, 0.0))


@pytest.mark.parametrize('name', [*ALL, 'watt', 'shaper'])
def test_torque_is_linear_in_accelerations_and_inverted_by_them(name):
    """M q'' + h - Q = torque; M is symmetric, positive definite, and gives the kinetic energy."""
    mechanism = ALL[name] if name in ALL else load(name).mechanism
    solver = Solver(mechanism)
    for crank in np.linspace(-6.0, 6.5, 12).tolist():
        q, u, a = motion(mechanism, crank)
        matrix, rest = np.array(solver.matrix(q)), (0.0,) * len(u)
        assert np.all(np.linalg.eigvalsh(matrix) > 0)
        assert np.array_equal(matrix, matrix.T)
        kinetic, _ = solver.energy(solver.state(q, u))
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
        kinetic, potential = solver.energy(solver.state(q, u))
        with mp.workdps(40):
            at = (q, u) if oracle.is_free else (q[0], u[0])
            levels.append(kinetic + potential - float(oracle.energy(*at)))
            size = abs(kinetic) + abs(potential)
    assert max(levels) - min(levels) < 1e-12 * size


# Printed values of the documents, and edge cases.


@pytest.mark.parametrize(
    ('degrees', 'torque'),
    [(0, -6.83836258084855), (294, 8.47528439441018), (348, -8.54729141947142)],
)
def test_document_torque_has_its_known_values(degrees, torque):
    state = Solver(DOCUMENT_1).state(math.radians(degrees), 5 * math.pi)
    assert state.torque == pytest.approx(torque, rel=0, abs=1e-14 * 8.55)


@pytest.mark.parametrize(
    ('assembly', 'coupler', 'rocker'), [('open', 88.84, 117.29), ('crossed', -115.21, -143.66)]
)
def test_norton_example_agrees_to_its_printed_digits(assembly, coupler, rocker):
    linkage = FourBar(Frame(6), Body(2), Coupler(7), Body(9), assembly)
    angle = Solver(linkage).state(math.radians(30)).position
    assert math.degrees(angle[1]) == pytest.approx(coupler, abs=0.005)
    assert math.degrees(angle[2]) == pytest.approx(rocker, abs=0.005)


def test_document_4_has_its_printed_values():
    state = Solver(ALL['document_4']).state(math.radians(45), 0.5, 1.0)
    assert state.position[0] == math.radians(45)
    assert math.degrees(state.position[1]) == pytest.approx(-30, rel=1e-14)
    assert state.position[2] == pytest.approx(1.93185165258, rel=5e-12)
    assert state.velocity[1:] == pytest.approx((-0.288675134595, -0.557677535825), rel=5e-12)
    assert state.acceleration[1:] == pytest.approx((-0.481125224325, -1.32615245782), rel=5e-12)


@pytest.mark.parametrize('assembly', ASSEMBLIES)
@pytest.mark.parametrize('power', [10, 30, 46])
def test_loop_closes_where_doubles_miss_an_equality_by_an_ulp_or_two(power, assembly):
    """Below 4 ulp, lengths count as equal, even if d - r itself is hardly larger."""
    gap = 2.0**-power
    for sign, other, ulps in itertools.product((1, -1), repeat=3):
        lengths = 1 + sign * gap, 2, 2 + other * gap + ulps * math.ulp(1.0) * 2, 1
        solver = Solver(four_bar(lengths, 0.3, assembly))
        assert solver.mobility.grashof == 'change-point'
        for part in (0.0, 0.1, -0.4, 1.0, 3.0, 100.0):
            position = solver.state(0.3 + part * gap).position
            A, coupler, rocker = (cmath.rect(*x) for x in zip(lengths, position, strict=False))
            assert abs(A + coupler - rocker - cmath.exp(0.3j)) <= 8 * math.ulp(2.0)


@pytest.mark.parametrize('ratio', [1e-2, 1e-6])
def test_crank_far_longer_than_its_coupler_loses_only_the_rounding_of_its_angle(ratio):
    """On an arc of 2 b/r rad, a rounding of the crank angle is amplified by r/b."""
    cranks = [0.3 + ratio * x for x in (-0.9, -0.5, -0.1, 0.3, 0.7, 0.95)]
    errors = worst_errors(Solver(slider_crank((1, ratio, 0))), cranks, period=0, floor=1)
    assert max(errors) < 32 * math.ulp(1.0) / ratio


@pytest.mark.parametrize(
    ('mechanism', 'limit', 'degrees'),
    [(four_bar((1, 2, 3, 6), 0.0), 0.0, 0), (slider_crank((1, 2, 3), 0.0), math.pi / 2, 90)],
)
def test_crank_is_refused_exactly_at_its_limit(mechanism, limit, degrees):
    """Frame = crank + coupler + rocker, or offset = crank + coupler: no rates exist there."""
    for crank in (limit, np.full(2, limit)):
        with pytest.raises(UnreachableError, match=f'cannot move at .* = {degrees} deg'):
            Solver(mechanism).state(crank)


PUMP = load('wind_pump').mechanism
NAMES = ('crank', 'coupler', 'rod')


def every_answer(solver, q, u):
    """Makes the calls that need the rates of the links."""
    return (
        lambda: solver.accelerations(q, u, 6.0),
        lambda: solver.state(q, u, (0.0, 0.0)),
        lambda: solver.matrix(q),
        lambda: solver.energy(solver.state(q, u)),
    )


@pytest.mark.parametrize(
    ('q', 'words'),
    [
        ((0.0, 2.6), 'in line, at crank angle 0 rad = 0 deg and slider position 2.6 m; at this'),
        ((0.0, 2.52), 'or are in line, at crank angle 0 rad = 0 deg'),
        (
            (np.array([0.1, 0.0]), np.array([1.5, 0.92])),
            'or are in line, at crank angle 0 rad = 0 deg',
        ),
        ((0.0, 0.5), 'do not close the loop, or .* within -2.28 to -0.68 or 0.92 to 2.52 m'),
        ((0.0, -3.0), 'do not close'),
        (
            (np.array([0.0, 0.3]), np.array([1.5, 9.0])),
            'at crank angle 0.3 rad = 17.1887339 deg .* 9 m',
        ),
        ((np.zeros((2, 3)), np.array([[1.5], [-9.0]])), 'at crank angle 0 rad = 0 deg .* -9 m'),
    ],
)
def test_dyad_that_does_not_close_is_one_clear_error(q, words):
    solver = Solver(PUMP)
    for call in every_answer(solver, q, (1.0, 0.0)):
        with pytest.raises(UnreachableError, match=words):
            call()


@pytest.mark.parametrize('slide', [2.52, 0.92, -2.28, -0.68])
def test_exactly_stretched_and_folded_dyads_are_in_line(slide):
    """No double is exactly this point; the margins are 1e-16 m^2, of either sign."""
    solver = Solver(PUMP)
    assert solver.alignment((0.0, slide)) == (0.0, 'coupler and rod are in line')
    with pytest.raises(UnreachableError, match='or are in line, at crank angle 0 rad = 0 deg'):
        solver.driven_by(lambda _: 6.0)(0.0, slide, 2.0, 0.1)


def edges(pump, crank):
    """Returns the exact positions of the slider's pin where coupler and rod are in line, m."""
    r, b, c = (mp.mpf(getattr(pump, name).length) for name in NAMES)
    x, y = r * mp.cos(mp.mpf(crank)), r * mp.sin(mp.mpf(crank))
    for radius in (b + c, abs(b - c)):
        if radius > abs(y):
            for side in (1, -1):
                yield x + side * mp.sqrt(radius**2 - y**2), side if radius == b + c else -side


@examples(20)
@given(
    st.integers(-300, 300), st.floats(0.01, 0.4), st.floats(0.5, 2), st.floats(0.5, 2),
    st.one_of(st.sampled_from([0.0, math.pi, math.pi / 2]), st.floats(-1000, 1000)),
)  # fmt: skip
def test_double_nearest_to_an_edge_is_refused_and_one_next_to_it_is_solved(power, r, b, c, crank):
    unit = 10.0 ** (power / 100)
    pump = WindPump(
        Body(r * unit, 1.0, unit**2), Coupler(b * unit, 2.0, unit**2),
        Body(c * unit, 3.0, unit**2), Piston(unit, 0.0, 1.0),
    )  # fmt: skip
    solver = Solver(pump)
    total = sum(getattr(pump, name).length for name in NAMES)
    with mp.workdps(60):
        for edge, outward in edges(pump, crank):
            with pytest.raises(UnreachableError):
                solver.accelerations((crank, float(edge)), (2.0, 0.1 * unit), 6.0)
            # A hundred roundings inside, in the direction that opens the dyad.
            r2 = (edge - mp.mpf(pump.crank.length) * mp.cos(crank)) ** 2
            steep = mp.sqrt(r2) / total
            inside = float(edge - outward * 100 * math.ulp(total) / steep)
            found = solver.accelerations((crank, inside), (2.0, 0.1 * unit), 6.0)
            assert np.isfinite(found).all()


def test_equal_links_are_solved_close_to_the_crank_pin():
    """Coupler and rod fold back on each other there; nothing cancels, so nothing is refused."""
    pump = WindPump(
        Body(0.12, 20.0, 20.0), Coupler(0.8, 4.0, 1.2), Body(0.8, 4.0, 0.85),
        Piston(1.5, 0.0, 6.0), loads=(LinkLoad('slider', damping=60.0),),
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
