# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The wind pump: kinematics, solver of motion and energy against other hands, and its laws."""

from __future__ import annotations

import math

import numpy as np
import oracle_pump
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from mpmath import mp
from oracle_pump_symbolic import lagrange_accelerations, lagrange_energy
from test_equations import power_of

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
from linkage_ros.dynamics.state import loop_residual
from linkage_ros.parameters.configuration import load

PUMP = load('wind_pump').mechanism
NAMES = ('crank', 'coupler', 'rod')


def described(pump):
    """The oracle's description of a pump of ours."""
    bodies = [getattr(pump, name) for name in NAMES]
    return oracle_pump.Pump(
        lengths=tuple(body.length for body in bodies),
        centers=tuple(body.center for body in bodies),
        masses=tuple(body.mass for body in bodies),
        inertias=tuple(body.inertia for body in bodies),
        slider_mass=pump.slider.mass,
        damping=pump.slider.damping,
        gravity=pump.gravity,
        side=1 if pump.assembly == 'open' else -1,
    )


def numbers(low, high):
    return st.floats(low, high, allow_nan=False)


@st.composite
def bodies(draw, cls=Body, span=(0.5, 2.0)):
    center = draw(numbers(-1, 2)), draw(numbers(-1, 1))
    return cls(draw(numbers(*span)), draw(numbers(0.1, 40)), draw(numbers(0.05, 20)), center)


@st.composite
def pumps(draw):
    return WindPump(
        draw(bodies(span=(0.05, 0.4))), draw(bodies(Coupler)), draw(bodies()),
        Piston(1.0, 0.0, draw(numbers(0.1, 20)), draw(numbers(0, 100))),
        draw(st.sampled_from(['open', 'crossed'])),
        (draw(numbers(-3, 3)), draw(numbers(-12, 0))),
    )  # fmt: skip


@st.composite
def places(draw):
    """A pump, and coordinates at which its dyad is neither stretched nor folded."""
    pump = draw(pumps())
    crank = draw(numbers(-10, 10))
    b, c = pump.coupler.length, pump.rod.length
    angle = draw(numbers(0.3, math.pi - 0.3))
    far = math.sqrt(b * b + c * c - 2 * b * c * math.cos(angle))
    y = pump.crank.length * math.sin(crank)
    assume(far > abs(y) + 0.05)
    side = draw(st.sampled_from([-1, 1]))
    slide = pump.crank.length * math.cos(crank) + side * math.sqrt(far * far - y * y)
    rates = draw(numbers(-8, 8)), draw(numbers(-4, 4))
    return pump, (crank, slide), rates


@settings(max_examples=15, deadline=None)
@given(places(), numbers(-50, 50))
def test_all_motion_is_that_of_fifty_digits(place, torque):
    pump, q, u = place
    solver = Solver(pump)
    exact = oracle_pump.exact_accelerations(described(pump), q, u, torque)
    found = solver.accelerations(q, u, torque)
    state = solver.state(q, u, found)
    # How strongly a rounding of q shows in what follows from it.
    sine = solver.alignment(q)[0]
    for name, tolerance in (('position', 1e-13), ('velocity', 1e-13), ('acceleration', 1e-11)):
        true = [float(value) for value in getattr(exact, name)]
        size = 1 + max(map(abs, true))
        for index, (value, expected) in enumerate(zip(getattr(state, name), true, strict=True)):
            apart = value - expected
            if name == 'position' and index in (1, 2):
                apart = math.remainder(apart, 2 * math.pi)
            assert abs(apart) < tolerance * size / sine**3, (name, index)
    assert state.torque == pytest.approx(torque, abs=1e-10 * (1 + abs(torque)) / sine**3)
    assert loop_residual(solver.structure, state) < 1e-14
    x, y = solver.point(state, 'D').position
    assert (x, y) == (pytest.approx(q[1], abs=1e-14), pytest.approx(0, abs=1e-14))


@settings(max_examples=10, deadline=None)
@given(places(), numbers(-50, 50))
def test_energies_and_accelerations_are_those_of_lagrange(place, torque):
    pump, q, u = place
    solver, other = Solver(pump), described(pump)
    sine = solver.alignment(q)[0]
    ours, theirs = solver.energy(q, u), lagrange_energy(other, q, u)
    at_rest = solver.energy(q, (0.0, 0.0))[1] - lagrange_energy(other, q, (0.0, 0.0))[1]
    size = abs(ours[0]) + abs(ours[1]) + 1
    assert ours[0] == pytest.approx(theirs[0], rel=1e-11 / sine)
    assert ours[1] == pytest.approx(theirs[1] + at_rest, abs=1e-12 * size)
    found = solver.accelerations(q, u, torque)
    true = lagrange_accelerations(other, q, u, torque)
    assert found == pytest.approx(tuple(true), rel=1e-9, abs=1e-9 * (1 + max(map(abs, true))))


@settings(max_examples=15, deadline=None)
@given(places(), numbers(-50, 50))
def test_the_matrix_is_positive_and_power_is_the_rate_of_energy(place, torque):
    pump, q, u = place
    solver = Solver(pump)
    matrix = np.array(solver.matrix(q))
    assert np.array_equal(matrix, matrix.T) or np.allclose(matrix, matrix.T, rtol=1e-13)
    assert np.linalg.eigvalsh(matrix).min() > 0
    a = solver.accelerations(q, u, torque)
    h = 1e-4 / (1 + max(map(abs, u)))

    def energy(time):
        moved = tuple(x + v * time + e * time * time / 2 for x, v, e in zip(q, u, a, strict=True))
        return sum(solver.energy(moved, tuple(v + e * time for v, e in zip(u, a, strict=True))))

    # Along this path the acceleration is right at time 0, where the rate is taken.
    rate = (8 * (energy(h) - energy(-h)) - (energy(2 * h) - energy(-2 * h))) / (12 * h)
    size = abs(torque * u[0]) + solver.energy(q, u)[0] + 1
    power = power_of(solver, q, u, torque)
    assert rate == pytest.approx(power, abs=2e-5 * size / solver.alignment(q)[0] ** 2)
    damping = pump.slider.damping
    assert power == pytest.approx(torque * u[0] - damping * u[1] ** 2, rel=1e-12, abs=1e-12)


@settings(max_examples=15, deadline=None)
@given(places(), numbers(-50, 50), numbers(0.01, 100))
def test_mirrored_and_scaled_pumps_move_mirrored_and_scaled(place, torque, scale):
    pump, (crank, slide), (speed, velocity) = place
    found = Solver(pump).accelerations((crank, slide), (speed, velocity), torque)
    other = 'open' if pump.assembly == 'crossed' else 'crossed'

    def body(name, flip, size):
        old = getattr(pump, name)
        x, y = old.center
        inertia = old.inertia * size * size
        return type(old)(old.length * size, old.mass, inertia, (x * size, flip * y * size))

    gx, gy = pump.gravity
    turned = WindPump(*(body(name, -1, 1) for name in NAMES), pump.slider, other, (gx, -gy))
    mirrored = Solver(turned).accelerations((-crank, slide), (-speed, velocity), -torque)
    assert (-mirrored[0], mirrored[1]) == pytest.approx(found, rel=1e-9, abs=1e-9)
    # With lengths the gravity grows alike, torques with their square: the same motion in time.
    sized = WindPump(
        *(body(name, 1, scale) for name in NAMES), pump.slider, pump.assembly,
        (gx * scale, gy * scale),
    )  # fmt: skip
    grown = Solver(sized).accelerations(
        (crank, slide * scale), (speed, velocity * scale), torque * scale * scale
    )
    assert (grown[0], grown[1] / scale) == pytest.approx(found, rel=1e-8, abs=1e-8)


def test_arrays_give_what_numbers_give():
    solver = Solver(PUMP)
    cranks, slides = np.linspace(-4, 9, 40), np.linspace(1.1, 2.2, 40)
    speeds, velocities = np.linspace(-5, 5, 40), np.linspace(2, -2, 40)
    found = solver.accelerations((cranks, slides), (speeds, velocities), 3.0)
    state = solver.state((cranks, slides), (speeds, velocities), found)
    for i, (q, u) in enumerate(
        zip(zip(cranks, slides, strict=True), zip(speeds, velocities, strict=True), strict=True)
    ):
        one = solver.accelerations(tuple(map(float, q)), tuple(map(float, u)), 3.0)
        assert one == pytest.approx((found[0][i], found[1][i]), rel=1e-12, abs=1e-12)
    assert np.abs(state.torque - 3.0).max() < 1e-11
    assert [len(row) for row in state[:3]] == [4, 4, 4]


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
    for call in (
        lambda: solver.accelerations(q, (1.0, 0.0), 1.0),
        lambda: solver.state(q, (1.0, 0.0), (0.0, 0.0)),
        lambda: solver.matrix(q),
        lambda: solver.energy(q, (1.0, 0.0)),
    ):
        with pytest.raises(UnreachableError, match=words):
            call()


def test_beyond_the_edge_it_is_refused_and_inside_it_answers():
    solver = Solver(PUMP)
    for slide in (0.12 + 2.4, 0.12 + 0.8):
        inside = slide - 1e-9 if slide > 2 else slide + 1e-9
        assert solver.alignment((0.0, inside))[0] < 1e-4
        assert np.isfinite(solver.accelerations((0.0, inside), (2.0, 0.1), 6.0)).all()
        with pytest.raises(UnreachableError):
            solver.matrix((0.0, slide + (1e-9 if slide > 2 else -1e-9)))


def every_answer(solver, q, u):
    """The calls that need the links' rates."""
    return (
        lambda: solver.accelerations(q, u, 6.0),
        lambda: solver.state(q, u, (0.0, 0.0)),
        lambda: solver.matrix(q),
        lambda: solver.energy(q, u),
    )


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
        exact = oracle_pump.exact_accelerations(described(pump), q, u, 6.0)
        state = solver.state(q, u, (0.0, 0.0))
        assert state.velocity == pytest.approx([float(x) for x in exact.velocity], rel=1e-12)
        assert np.isfinite(solver.accelerations(q, u, 6.0)).all()
    with pytest.raises(UnreachableError):
        solver.accelerations((0.0, 0.12), (2.0, 0.1), 6.0)


@pytest.mark.parametrize('bad', [math.nan, math.inf, np.array([1.5, math.nan])])
def test_what_is_not_finite_is_named(bad):
    solver = Solver(PUMP)
    for name, call in (
        ('crank angle', lambda: solver.accelerations((bad, 1.5), (1.0, 0.0), 1.0)),
        ('slider position', lambda: solver.accelerations((0.0, bad), (1.0, 0.0), 1.0)),
        ('crank speed', lambda: solver.accelerations((0.0, 1.5), (bad, 0.0), 1.0)),
        ('slider speed', lambda: solver.energy((0.0, 1.5), (1.0, bad))),
        ('torque', lambda: solver.accelerations((0.0, 1.5), (1.0, 0.0), bad)),
        ('slider acceleration', lambda: solver.state((0.0, 1.5), (1.0, 0.0), (0.0, bad))),
    ):
        with pytest.raises(ConfigurationError, match=f'^{name} = .*: must be a finite number'):
            call()


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
