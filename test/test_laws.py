# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Laws that hold for every mechanism, whatever its links and however many its coordinates."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mechanisms import (
    ALL,
    ANY,
    TURN,
    coordinates,
    is_close,
    kinds,
    longest,
    mirrored,
    motion,
    moving,
    rows,
    scaled,
    turned,
    turning_parts,
    vector,
)
from mpmath import mp
from oracle import Oracle

from linkage_ros import FourBar, SliderCrank, Solver, WindPump

every = pytest.mark.parametrize('name', ALL)
of_one_coordinate = pytest.mark.parametrize(
    'name', [name for name, mechanism in ALL.items() if not isinstance(mechanism, WindPump)]
)
any_of = pytest.mark.parametrize('kind', ANY)
few = settings(max_examples=15)
angles_of_two_turns = st.floats(-TURN, TURN, allow_subnormal=False)


def spread_about(cranks):
    """These crank angles and 24 others over two turns, so that largest values are seen."""
    return np.array([*cranks, *np.linspace(-6.0, 6.5, 24)])


def vectors(solver, state):
    """Position, velocity and acceleration of all points, then all forces, as complex rows."""
    points = [vector(x) for name in solver.structure.points for x in solver.point(state, name)]
    found = solver.reactions(state)
    forces = [vector(force) for force in (*found.pins.values(), found.shaking_force)]
    shape = np.shape(state.position[0])
    return tuple(np.array([np.broadcast_to(x, shape) for x in x_s]) for x_s in (points, forces))


def moments(solver, state):
    """The shaking moment, and the torque through the forces."""
    found = solver.reactions(state)
    return np.array([found.shaking_moment, found.torque])


def check_vectors(got, expected, tolerance=1e-12):
    """Compares rows of vectors; each may differ by a part of the largest of its kind."""
    for one, right in zip(got, expected, strict=True):
        assert np.max(np.abs(one - right)) <= tolerance * np.max(np.abs(right))


# Ways of asking.


@every
def test_scalars_and_arrays_agree_to_a_few_ulp(name):
    mechanism = ALL[name]
    solver = Solver(mechanism)
    q, u, a = motion(mechanism, np.linspace(-7.0, 14.0, 101))
    alone = [solver.state(x, u, a) for x in zip(*(x.tolist() for x in q), strict=True)]
    together = solver.state(q, u, a)
    assert is_close(rows(together), np.array([rows(x) for x in alone]).T, 4, mechanism)
    each = list(zip(*(vectors(solver, state) for state in alone), strict=True))
    check_vectors(vectors(solver, together), [np.array(x).T for x in each])


@pytest.mark.parametrize('name', ['crank_rocker', 'offset_right', 'pump'])
@pytest.mark.parametrize('shape', [(0,), (3, 0), (1,), (2, 1, 4)])
def test_the_shape_of_the_angles_is_kept(name, shape):
    mechanism = ALL[name]
    solver = Solver(mechanism)
    angles = np.arange(math.prod(shape), dtype=float).reshape(shape)
    q, u, a = motion(mechanism, angles)
    state = solver.state(q, u, a)
    got = rows(state)
    assert got.shape == (len(kinds(mechanism)), *shape)
    flat = rows(solver.state(tuple(x.ravel() for x in q), u, a))
    assert np.array_equal(got.reshape(len(got), -1), flat)
    # Views that are not contiguous are read right as well.
    transposed = solver.state(tuple(x.T for x in q), u, a).torque
    assert np.allclose(transposed, state.torque.T, rtol=1e-14, atol=0)
    forces = solver.reactions(state)
    found = *solver.point(state, 'B'), *forces.pins.values(), forces.shaking_force
    assert {np.shape(x) for pair in found for x in pair} == {shape}
    speeds = np.array([1.0, -2.0])
    assert np.shape(moving(solver, angles[..., None], speeds).torque) == (*shape, 2)


@every
@pytest.mark.parametrize('kind', [np.float64, np.array])
def test_floats_of_any_kind_give_floats(name, kind):
    mechanism = ALL[name]
    solver = Solver(mechanism)
    given_motion = motion(mechanism, 0.7, 3.0, 1.0)
    state = solver.state(*given_motion)
    assert solver.state(*(tuple(map(kind, x)) for x in given_motion)) == state
    forces = solver.reactions(state)
    found = *state[:3], *forces.pins.values(), *solver.point(state, 'A'), (state.torque,)
    assert {type(x) for row in found for x in row} == {float}
    if len(given_motion[0]) == 1:
        assert solver.state(*(kind(x) for (x,) in given_motion)) == state


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


# Geometry.


def gap(mechanism, position):
    """By how much the links fail to close the loop, m; in the caller's precision."""
    links = [
        mp.mpf(getattr(mechanism, part).length) * mp.expj(mp.mpf(float(angle)))
        for part, angle in zip(turning_parts(mechanism), position, strict=False)
    ]
    if isinstance(mechanism, WindPump):
        return abs(sum(links) - mp.mpf(float(position[3])))
    frame = mp.expj(mp.mpf(mechanism.frame.angle))
    if isinstance(mechanism, SliderCrank):
        place = mp.mpc(mp.mpf(float(position[2])), mp.mpf(mechanism.slider.offset))
        return abs(links[0] + links[1] - place * frame)
    end = mp.mpf(mechanism.frame.length) * frame
    return abs(links[0] + links[1] - links[2] - end)


@any_of
@few
@given(data=st.data(), crank=angles_of_two_turns)
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
def test_rates_and_accelerations_are_derivatives_to_second_order(name):
    """Of all links, and of all points that the mechanism has."""
    mechanism = ALL[name]
    solver = Solver(mechanism)
    q, u, a = motion(mechanism, np.linspace(0.0, 6.0, 41))
    slides = [link.slides for link in solver.structure.links]

    def at(t):
        """Positions and velocities of links and points at a time."""
        state = solver.state(
            tuple(x + v * t + e * t * t / 2 for x, v, e in zip(q, u, a, strict=True)),
            tuple(v + e * t for v, e in zip(u, a, strict=True)),
            a,
        )
        moved = [solver.point(state, point) for point in solver.structure.points]
        rates = map(np.broadcast_to, state.velocity, [q[0].shape] * len(slides))
        return (
            [*state.position, *(vector(x.position) for x in moved)],
            [*rates, *(vector(x.velocity) for x in moved)],
            [*state.acceleration, *(vector(x.acceleration) for x in moved)],
        )

    _, velocity, acceleration = at(0.0)
    longest_step = 0.002 if isinstance(mechanism, WindPump) else 0.02
    steps, errors = [longest_step / 2**i for i in range(4)], []
    for step in steps:
        later, earlier = at(step), at(-step)
        errors.append([])
        for i in range(len(velocity)):
            moved, gained = (later[k][i] - earlier[k][i] for k in (0, 1))
            if i < len(slides) and not slides[i]:
                moved = np.remainder(moved + math.pi, TURN) - math.pi
            for change, right in ((moved, velocity[i]), (gained, acceleration[i])):
                errors[-1].append(np.max(np.abs(change / (2 * step) - right)))
    for quantity in np.array(errors).T:
        if quantity[0] < 1e-11:  # at rest or exactly linear
            assert np.max(quantity) < 1e-11
            continue
        assert quantity[-1] < 1e-2
        order = np.polyfit(np.log(steps), np.log(quantity), 1)[0]
        assert order == pytest.approx(2.0, abs=0.1)


# Mirrored, turned, scaled and played backwards.


@any_of
@few
@given(data=st.data(), cranks=st.lists(angles_of_two_turns, min_size=4, max_size=4))
def test_mirrored_mechanism_moves_mirrored(kind, data, cranks):
    mechanism = data.draw(ANY[kind]())
    q, u, a = motion(mechanism, spread_about(cranks))
    before = rows(Solver(mechanism).state(q, u, a))
    image = ((-x[0], *x[1:]) for x in (q, u, a))
    after = rows(Solver(mirrored(mechanism)).state(*image))
    after *= np.array([[1.0 if slides else -1.0] for _, slides in kinds(mechanism)])
    if kind == 'four_bar':  # each by itself: all forms of its equations are symmetric
        for got, expected in zip(after.T, before.T, strict=True):
            assert is_close(got[:, None], expected[:, None], 2, mechanism)
    assert is_close(after[:-1], before[:-1], 8, mechanism)
    # Where folded links balance, the torque is a small difference of large moments.
    assert is_close(after, before, 64, mechanism)


@every
def test_mirrored_and_turned_mechanisms_have_their_points_and_forces(name):
    mechanism = ALL[name]
    solver, cranks = Solver(mechanism), np.linspace(-6.0, 6.5, 21)
    q, u, _ = motion(mechanism, cranks)
    state = moving(solver, cranks)
    expected, held = vectors(solver, state), moments(solver, state)
    other = Solver(mirrored(mechanism))
    image = moving(other, -cranks, -2.0, -1.5, *((-x[0], *x[1:]) for x in (q, u)))
    check_vectors(map(np.conj, vectors(other, image)), expected)
    check_vectors([-moments(other, image)], [held])
    other = Solver(turned(mechanism, -math.pi))
    image = (q[0] - math.pi, *(-x for x in q[1:])), (u[0], *(-x for x in u[1:]))
    image = moving(other, cranks - math.pi, 2.0, 1.5, *image)
    check_vectors((-x for x in vectors(other, image)), expected)
    check_vectors([moments(other, image)], [held])


@any_of
@few
@given(data=st.data(), crank=angles_of_two_turns, power=st.integers(-20, 19))
def test_scaled_mechanism_moves_alike_and_takes_torque_by_its_square(kind, data, crank, power):
    check_scaled(data.draw(ANY[kind](scales=0)), crank, 2.0**power)


@pytest.mark.parametrize('crank', [-4.0, 0.8, 2.7])
@pytest.mark.parametrize('name', ['sprung_rocker', 'sprung_slider', 'sprung_pump'])
def test_scaled_loads_take_torque_by_the_square_of_the_scale(name, crank):
    check_scaled(ALL[name], crank, 8.0)


def check_scaled(mechanism, crank, factor):
    """Asserts that the larger mechanism moves alike, bit by bit."""
    q, u, a = motion(mechanism, crank)
    larger = ((x[0], *(y * factor for y in x[1:])) for x in (q, u, a))
    solver, other = Solver(mechanism), Solver(scaled(mechanism, factor))
    got, expected = rows(other.state(*larger)), rows(solver.state(q, u, a))
    expected[[slides for _, slides in kinds(mechanism)]] *= factor
    expected[-1] *= factor**2
    assert got.tolist() == expected.tolist()


def undamped(mechanism):
    if isinstance(mechanism, FourBar):
        return mechanism
    return replace(mechanism, slider=replace(mechanism.slider, damping=0.0))


@any_of
@few
@given(data=st.data(), crank=angles_of_two_turns)
def test_motion_played_backwards_takes_the_same_torque_but_for_damping(kind, data, crank):
    mechanism = data.draw(ANY[kind]())
    q, u, a = motion(mechanism, crank)
    reverse = tuple(-x for x in u)
    solver = Solver(undamped(mechanism))
    forth, back = (solver.state(q, rates, a) for rates in (u, reverse))
    assert back.position == forth.position
    assert back.velocity == tuple(-x for x in forth.velocity)
    assert back.acceleration == forth.acceleration
    assert back.torque == forth.torque
    damped = Solver(mechanism)
    gain = damped.state(q, u, a).torque - damped.state(q, reverse, a).torque
    damping = getattr(getattr(mechanism, 'slider', None), 'damping', 0.0)
    slide = 0.0 if kind == 'wind_pump' else forth.velocity[-1]  # nothing drives a pump's slider
    lost = 2 * damping * slide * slide / u[0]
    size = abs(forth.torque) + lost + mechanism.coupler.length**2
    assert gain == pytest.approx(lost, rel=1e-13, abs=1e-14 * size)


# The equations of motion, work and energy.


@every
def test_torque_is_linear_in_accelerations_and_inverted_by_them(name):
    """M q'' + h - Q = torque: M is symmetric and positive, and gives the kinetic energy."""
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
        assert solver.forward((*q, *u), 5.0) == found
        size = 5.0 + np.max(np.abs(matrix)) * max(map(abs, found))
        assert solver.state(q, u, found).torque == pytest.approx(5.0, rel=0, abs=1e-13 * size)


@every
def test_energy_is_that_of_the_reference_but_for_a_constant(name):
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


@of_one_coordinate
def test_work_over_the_period_at_constant_speed_is_that_of_the_loads(name):
    """The trapezoid rule is exact to all digits here: all power together is smooth."""
    mechanism = ALL[name]
    solver, speed = Solver(mechanism), 3.0
    period = TURN * solver.reach.period_turns
    state = solver.state(np.arange(2880) * (period / 2880), speed)
    work = np.sum(state.torque) * period / 2880
    rates = dict(zip(solver.links, state.velocity, strict=True))
    powers = [force * rates[link] for link, force in solver.load_forces(state).items()]
    lost = -sum(np.sum(power) for power in powers) * period / 2880 / speed
    throughput = np.sum(np.abs(state.torque)) * period / 2880
    assert throughput > 1.0
    assert work == pytest.approx(lost, rel=0, abs=1e-12 * throughput)
