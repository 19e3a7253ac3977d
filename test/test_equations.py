# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Torque in, motion out: the driving torque turned round, and the energy that it feeds."""

from __future__ import annotations

import math

import numpy as np
import pytest
from mpmath import mp
from oracle import Oracle
from oracle_slider import SliderOracle

from linkage_ros import (
    ConfigurationError,
    FourBar,
    MechanismError,
    Solver,
    UnreachableError,
)
from linkage_ros.model.parts import Body, Coupler, Frame, Guide, Slider
from linkage_ros.model.slider_crank import SliderCrank
from linkage_ros.parameters.configuration import load

MECHANISMS = {
    **{name: load(name).mechanism for name in ('quadrilateral', 'coupler_point', 'compressor')},
    'leaning': SliderCrank(
        Body(0.3, 2.0, 0.1, (0.1, 0.05)), Coupler(0.9, 1.0, 0.2, (0.4, -0.1)),
        Slider(0.1, 3.0, force=4.0, damping=0.5), Guide(0.7), 'crossed', (1.3, -9.7),
    ),
    'crossed': FourBar(
        Frame(2.2, 0.3), Body(1.0, 0.7, 0.02, (0.3, -0.2)), Coupler(3.0, 2.0, 0.5, (1.8, 0.9)),
        Body(2.5, 3.0, 0.3, (1.0, -0.6)), 'crossed', (1.3, -9.7),
    ),
}  # fmt: skip
CRANKS = np.random.default_rng(5).uniform(-7, 7, 12).tolist()
each = pytest.mark.parametrize('name', MECHANISMS)


def power_of(solver, q, u, torque):
    """The power of the torque and of the mechanism's loads, W."""
    links = solver.mechanism.loop().pose(q).links
    rates = solver.state(q, u, (0.0,) * len(q)).velocity
    return torque * u[0] + sum(
        force * rates[link]
        for load in solver.mechanism.loads()
        for link, force in load.forces(links, rates).items()
    )


@each
def test_the_acceleration_is_that_which_takes_the_torque(name):
    solver = Solver(MECHANISMS[name])
    for crank in CRANKS:
        for speed, acceleration in ((3.0, -7.0), (-20.0, 0.0), (0.0, 2.0)):
            torque = solver.state(crank, speed, acceleration).torque
            scale = abs(acceleration) + speed * speed
            found = solver.accelerations((crank,), (speed,), torque)[0]
            assert found == pytest.approx(acceleration, abs=1e-12 * scale)


@each
def test_the_energy_is_that_of_another_hand(name):
    mechanism = MECHANISMS[name]
    solver = Solver(mechanism)
    oracle = (Oracle if isinstance(mechanism, FourBar) else SliderOracle)(mechanism)
    with mp.workdps(40):
        level = solver.energy((0.5,), (0.0,))[1] - float(oracle.energy(0.5, 0.0))
        for crank in CRANKS:
            kinetic, potential = solver.energy((crank,), (3.0,))
            assert kinetic > 0
            assert kinetic + potential - level == pytest.approx(
                float(oracle.energy(crank, 3.0)), rel=1e-13, abs=1e-12
            )


@each
def test_the_power_of_all_forces_is_the_rate_of_the_energy(name):
    """What a step of time adds to the energy, by central differences of order 4."""
    mechanism = MECHANISMS[name]
    solver = Solver(mechanism)
    speed, torque, h = 3.0, 5.0, 2e-4
    for crank in CRANKS:
        change = solver.accelerations((crank,), (speed,), torque)[0]

        def energy(time, crank=crank, change=change):
            moved = crank + speed * time + change * time * time / 2
            return sum(solver.energy((moved,), (speed + change * time,)))

        # Along this path the acceleration is right at time 0, where the rate is taken.
        rate = 8 * (energy(h) - energy(-h)) - (energy(2 * h) - energy(-2 * h))
        power = torque * speed
        if isinstance(mechanism, SliderCrank):
            slide = solver.state(crank, speed).velocity[2]
            power += (mechanism.slider.force - mechanism.slider.damping * slide) * slide
        assert power_of(solver, (crank,), (speed,), torque) == pytest.approx(power, rel=1e-13)
        scale = abs(torque * speed) + abs(solver.energy((crank,), (speed,))[0])
        assert rate / (12 * h) == pytest.approx(power, abs=1e-6 * scale)


@each
def test_arrays_give_what_numbers_give(name):
    solver = Solver(MECHANISMS[name])
    cranks = np.array(CRANKS)
    kinetic, potential = solver.energy((cranks,), (3.0,))
    found = solver.accelerations((cranks,), (3.0,), 5.0)[0]
    for i, crank in enumerate(CRANKS):
        assert solver.energy((crank,), (3.0,)) == pytest.approx(
            (kinetic[i], potential[i]), rel=1e-14
        )
        assert solver.accelerations((crank,), (3.0,), 5.0)[0] == pytest.approx(found[i], rel=1e-12)


def test_without_any_mass_there_is_no_acceleration():
    solver = Solver(FourBar(Frame(2.2), Body(1.0), Coupler(3.0), Body(2.5)))
    with pytest.raises(MechanismError, match='something moves without a mass'):
        solver.accelerations((0.3,), (1.0,), 1.0)[0]
    with pytest.raises(MechanismError, match='give the links a mass or an inertia'):
        solver.accelerations((np.array([0.3, 0.4]),), (1.0,), 1.0)[0]


def test_beyond_the_reach_there_is_neither():
    linkage = FourBar(Frame(1.0), Body(0.9, 1.0, 0.1), Coupler(0.5), Body(0.5))
    solver = Solver(linkage)
    beyond = solver.mobility.arcs[0][1] + 0.1
    with pytest.raises(UnreachableError):
        solver.accelerations((beyond,), (0.0,), 1.0)[0]
    with pytest.raises(UnreachableError):
        solver.energy((beyond,), (0.0,))


@pytest.mark.parametrize('bad', [math.nan, math.inf, -math.inf, np.array([1.0, math.nan])])
def test_what_is_not_finite_is_named(bad):
    solver = Solver(MECHANISMS['quadrilateral'])
    for name, call in (
        ('crank angle', lambda: solver.accelerations((bad,), (1.0,), 1.0)[0]),
        ('crank speed', lambda: solver.accelerations((1.0,), (bad,), 1.0)[0]),
        ('torque', lambda: solver.accelerations((1.0,), (1.0,), bad)[0]),
        ('crank angle', lambda: solver.energy((bad,), (1.0,))),
        ('crank speed', lambda: solver.energy((1.0,), (bad,))),
        ('crank angle', lambda: solver.matrix(bad)),
    ):
        with pytest.raises(ConfigurationError, match=f'^{name} = .*: must be a finite number'):
            call()


def test_a_free_crank_keeps_its_energy():
    """Runge-Kutta of order 4 over two turns; its error falls sixteenfold with half the step."""
    solver = Solver(MECHANISMS['quadrilateral'])

    def drift(steps):
        crank, speed, h = 0.0, 12.0, 1.0 / steps
        start, worst = sum(solver.energy((crank,), (speed,))), 0.0
        for _ in range(steps):
            slopes = []
            for part in (0.0, 0.5, 0.5, 1.0):
                v, a = slopes[-1] if slopes else (speed, 0.0)
                at, fast = crank + part * h * v, speed + part * h * a
                slopes.append((fast, solver.accelerations((at,), (fast,), 0.0)[0]))
            (v1, a1), (v2, a2), (v3, a3), (v4, a4) = slopes
            crank += h / 6 * (v1 + 2 * v2 + 2 * v3 + v4)
            speed += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
            worst = max(worst, abs(sum(solver.energy((crank,), (speed,))) - start))
        assert crank > 4 * math.pi * 0.7
        return worst

    coarse, fine = drift(400), drift(800)
    assert fine < 1e-7
    assert 12 < coarse / fine < 40
