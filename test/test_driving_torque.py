# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The driving torque against energy, superposition and sums over the bodies one by one."""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mpmath import mp
from oracle import Oracle

from linkage_ros import Body, Coupler, FourBar, Frame, Solver
from linkage_ros.dynamics.driving_torque import MassDistribution
from linkage_ros.mechanisms.structure import Point, Structure, TurningBody

TURN = 2 * math.pi
DOCUMENT_SPEED = 150 * TURN / 60
DOCUMENT = FourBar(
    Frame(0.425, 5.497787143782138),
    Body(0.1, inertia=0.0245),
    Coupler(0.315, 2.0, 0.016, (0.1575, 0.0)),
    Body(0.5, 3.5, 0.066, (0.25, 0.0)),
)


def four_bar(lengths, assembly='open', gravity=(1.3, -9.7)):
    """A linkage with mass everywhere and no symmetry."""
    r, b, c, d = lengths
    return FourBar(
        Frame(d, 0.3),
        Body(r, 0.7, 0.02, (0.3 * r, -0.2 * r)),
        Coupler(b, 2.0, 0.5, (0.6 * b, 0.3 * b)),
        Body(c, 3.0, 0.3, (0.4 * c, -0.25 * c)),
        assembly,
        gravity,
    )


LINKAGES = {
    'document': DOCUMENT,
    'crank_rocker': four_bar((1, 3, 2.5, 2.2)),
    'crank_rocker_crossed': four_bar((1, 3, 2.5, 2.2), 'crossed'),
    'double_crank': four_bar((3, 2.5, 2.2, 1)),
    'parallelogram': four_bar((1, 2, 1, 2)),
    'antiparallelogram': four_bar((1, 2, 1, 2), 'crossed'),
    'one_change_point': four_bar((1, 2.5, 1.5, 3)),
    'kite': four_bar((1, 2, 2, 1)),
}
linkages = pytest.mark.parametrize('name', LINKAGES)
cranks = st.floats(-TURN, TURN)


def bodies_at(linkage, crank, speed):
    """For each body: mass, inertia, spin, and position and velocity of its centre, one by one."""
    state = Solver(linkage).state(crank, speed)
    crank_pin = cmath.rect(linkage.crank.length, crank)
    pins = (
        (0, 0),
        (crank_pin, 1j * speed * crank_pin),
        (cmath.rect(linkage.frame.length, linkage.frame.angle), 0),
    )
    bodies = linkage.crank, linkage.coupler, linkage.rocker
    for body, angle, spin, (place, velocity) in zip(
        bodies, state.position, state.velocity, pins, strict=True
    ):
        lever = complex(*body.center) * cmath.exp(1j * angle)
        yield body.mass, body.inertia, spin, place + lever, velocity + 1j * spin * lever


def kinetic_energy(linkage, crank, speed):
    return sum(
        0.5 * (mass * abs(velocity) ** 2 + inertia * spin**2)
        for mass, inertia, spin, _, velocity in bodies_at(linkage, crank, speed)
    )


def power_of_weights(linkage, crank, speed):
    gravity = complex(*linkage.gravity)
    return sum(
        mass * (gravity.conjugate() * velocity).real
        for mass, _, _, _, velocity in bodies_at(linkage, crank, speed)
    )


# Work and energy.


@linkages
@pytest.mark.parametrize('acceleration', [0.0, -3.0])
def test_torque_times_speed_is_the_rate_of_the_energy(name, acceleration):
    """The energy is the reference's, differentiated in 50 digits: no forces are involved."""
    linkage = LINKAGES[name]
    oracle, solver, speed = Oracle(linkage), Solver(linkage), 2.0
    errors, largest = [], 0.0
    for crank in np.linspace(-6.0, 6.0, 13).tolist():
        with mp.workdps(60):

            def energy(t, crank=crank):
                return oracle.energy(
                    crank + speed * t + acceleration * t**2 / 2, speed + acceleration * t
                )

            expected = mp.diff(energy, 0) / speed
            assert abs(expected - oracle.state(crank, speed, acceleration).torque) < 1e-35
        errors.append(abs(solver.state(crank, speed, acceleration).torque - float(expected)))
        largest = max(largest, abs(float(expected)))
    assert max(errors) < 1e-14 * largest


@linkages
def test_work_over_the_period_vanishes_at_constant_speed(name):
    """The trapezoid rule is exact to all digits here: the torque is smooth and periodic."""
    solver = Solver(LINKAGES[name])
    period = TURN * solver.mobility.period_turns
    crank = np.arange(1440) * (period / 1440)
    torque = solver.state(crank, DOCUMENT_SPEED).torque
    assert abs(np.sum(torque)) * period / 1440 < 1e-10
    assert np.sum(np.abs(torque)) * period / 1440 > 1.0


def test_work_between_two_angles_is_the_gain_of_energy():
    linkage, speed = LINKAGES['crank_rocker'], 3.0
    nodes, weights = np.polynomial.legendre.leggauss(60)
    start, end = 0.4, 2.9
    crank = (start + end) / 2 + (end - start) / 2 * nodes
    work = np.sum(weights * Solver(linkage).state(crank, speed).torque) * (end - start) / 2

    def energy(angle):
        gravity = complex(*linkage.gravity)
        return kinetic_energy(linkage, angle, speed) - sum(
            mass * (gravity.conjugate() * place).real
            for mass, _, _, place, _ in bodies_at(linkage, angle, speed)
        )

    gain = energy(end) - energy(start)
    assert abs(gain) > 1.0
    assert work == pytest.approx(gain, rel=1e-12)


# The terms of the equation of motion, one at a time.


@linkages
@given(crank=cranks)
def test_torque_at_rest_is_mass_matrix_times_acceleration_less_weights(name, crank):
    linkage = LINKAGES[name]
    solver = Solver(linkage)
    inertia = 2 * kinetic_energy(linkage, crank, 1.0)  # M, kg m^2
    weights = power_of_weights(linkage, crank, 1.0)
    assert inertia > 0
    torque = solver.state(crank, 0.0, 1.5).torque
    assert torque == pytest.approx(1.5 * inertia - weights, rel=1e-13, abs=1e-13 * 1.5 * inertia)


@linkages
@given(crank=cranks)
def test_torque_at_rest_holds_the_weights(name, crank):
    linkage = LINKAGES[name]
    bound = sum(body.mass for body in (linkage.crank, linkage.coupler, linkage.rocker)) * 9.81
    held = power_of_weights(linkage, crank, 1.0)
    assert Solver(linkage).state(crank).torque == pytest.approx(
        -held, rel=1e-13, abs=1e-13 * bound
    )


@linkages
@given(crank=cranks, speed=st.floats(-50, 50), acceleration=st.floats(-50, 50))
def test_torques_of_weight_speed_and_acceleration_add_up(name, crank, speed, acceleration):
    linkage = LINKAGES[name]
    solver = Solver(linkage)

    def torque(*motion):
        return solver.state(crank, *motion).torque

    held, of_speed, of_acceleration = torque(), torque(speed), torque(0.0, acceleration)
    # The bodies' shares may cancel: what each of them amounts to bounds the rounding.
    square = 4 * speed**2 + abs(acceleration)
    rounding = 1e-14 * sum(
        body.mass * (10 * body.length + 8 * square * body.length**2) + body.inertia * square
        for body in (linkage.crank, linkage.coupler, linkage.rocker)
    )
    assert abs(torque(speed, acceleration) - (of_speed + of_acceleration - held)) <= rounding
    # The inertia terms grow by the square of the speed.
    assert abs((torque(2 * speed) - held) - 4 * (of_speed - held)) <= rounding


def test_gravity_at_any_angle_is_the_sum_of_its_components():
    def held(gravity):
        return Solver(four_bar((1, 3, 2.5, 2.2), gravity=gravity)).state(0.8).torque

    assert held((0.0, 0.0)) == 0.0
    assert held((2.0, -3.0)) == pytest.approx(
        2 * held((1.0, 0.0)) - 3 * held((0.0, 1.0)), rel=1e-14
    )


@given(cranks, st.floats(-20, 20), st.floats(-20, 20))
def test_lone_crank_is_a_pendulum(crank, speed, acceleration):
    """With massless coupler and rocker the equation of motion is known in closed form."""
    along, across = 0.05, -0.03
    linkage = FourBar(
        Frame(0.425), Body(0.1, 2.0, 0.01, (along, across)), Coupler(0.315), Body(0.5)
    )
    lever = complex(along, across) * cmath.exp(1j * crank)
    expected = (0.01 + 2.0 * abs(lever) ** 2) * acceleration + 2.0 * 9.81 * lever.real
    torque = Solver(linkage).state(crank, speed, acceleration).torque
    assert torque == pytest.approx(expected, rel=1e-14, abs=1e-15)


def test_massless_linkage_takes_no_torque():
    linkage = FourBar(Frame(2.2), Body(1), Coupler(3), Body(2.5))
    assert Solver(linkage).state(0.7, 3.0, 2.0).torque == 0.0


def test_crank_inertia_alone_takes_torque_only_while_it_accelerates():
    linkage = FourBar(Frame(2.2), Body(1, inertia=0.5), Coupler(3), Body(2.5))
    assert Solver(linkage).state(0.7, 3.0).torque == 0.0
    assert Solver(linkage).state(0.7, 3.0, 2.0).torque == 1.0


# The equations of motion for any number of speeds, against a sum over the bodies.


def random_case(seed, shape=(), speeds=2):
    """Bodies and a motion; `shape` is that of the angles."""
    random = np.random.default_rng(seed)

    def three():
        return tuple(random.uniform(-2, 2, shape) for _ in range(3))

    def center():
        return Point(tuple(complex(*random.uniform(-1, 1, 2)) for _ in range(3)))

    bodies = [TurningBody(link, *random.uniform(0.1, 3, 2), center()) for link in (0, 1, 2, 2)]
    bodies.append(TurningBody(1, 1.5, 0.0, Point((0.5 + 0j, 0j, 0.2j))))
    angle, rates, accelerations = three(), three(), three()
    cos, sin = tuple(np.cos(x) for x in angle), tuple(np.sin(x) for x in angle)
    partial = tuple(three() for _ in range(speeds))
    return bodies, (angle, cos, sin, partial, ()), rates, accelerations


def summed_over_bodies(bodies, gravity, links, rates, accelerations):
    """M_jk = sum m v_j.v_k + J w_j w_k; balance_j = sum m v_j.(a - g) + J w_j eps."""
    angle, _, _, partial, _ = links
    speeds = range(len(partial))
    M, balance = [[0.0 for _ in speeds] for _ in speeds], [0.0 for _ in speeds]
    for body in bodies:
        terms = [rho * np.exp(1j * x) for rho, x in zip(body.center.weights, angle, strict=True)]
        velocity = [sum(1j * k * x for k, x in zip(row, terms, strict=True)) for row in partial]
        acceleration = -complex(*gravity) + sum(
            (1j * e - w * w) * x for e, w, x in zip(accelerations, rates, terms, strict=True)
        )
        for j in speeds:
            spin, v = partial[j][body.link], velocity[j].conjugate()
            balance[j] = balance[j] + body.mass * (v * acceleration).real
            balance[j] = balance[j] + body.inertia * spin * accelerations[body.link]
            for k in speeds:
                M[j][k] = M[j][k] + body.mass * (v * velocity[k]).real
                M[j][k] = M[j][k] + body.inertia * spin * partial[k][body.link]
    return M, balance


@pytest.mark.parametrize('speeds', [1, 2])
@pytest.mark.parametrize('shape', [(), (5,)])
@pytest.mark.parametrize('seed', range(10))
def test_equations_of_motion_are_the_sum_over_the_bodies(seed, shape, speeds):
    bodies, links, rates, accelerations = random_case(seed, shape, speeds)
    gravity = (1.7, -9.5)
    M, balance = summed_over_bodies(bodies, gravity, links, rates, accelerations)
    masses = MassDistribution(Structure((), {}, tuple(bodies), Point((0j, 0j, 0j))), gravity)
    assert np.allclose(masses.matrix(links), M, rtol=1e-13, atol=1e-13)
    got = masses.balance(links, rates, accelerations)
    assert np.allclose(got, balance, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize('seed', range(5))
def test_mass_matrix_is_symmetric_and_positive(seed):
    bodies, links, _, _ = random_case(seed)
    M = np.array(
        MassDistribution(Structure((), {}, tuple(bodies), Point((0j, 0j, 0j))), (0.0, 0.0)).matrix(
            links
        )
    )
    assert M[0, 1] == pytest.approx(M[1, 0], rel=1e-14)
    assert np.all(np.linalg.eigvalsh(M) > 0)
