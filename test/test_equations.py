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
    EquationsOfMotion,
    FourBar,
    MechanismError,
    Solver,
    UnreachableError,
)
from linkage_ros.mechanisms.parts import Body, Coupler, Frame, Guide, Slider
from linkage_ros.mechanisms.slider_crank import SliderCrank
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


@each
def test_the_acceleration_is_that_which_takes_the_torque(name):
    solver, equations = Solver(MECHANISMS[name]), EquationsOfMotion(MECHANISMS[name])
    for crank in CRANKS:
        for speed, acceleration in ((3.0, -7.0), (-20.0, 0.0), (0.0, 2.0)):
            torque = solver.state(crank, speed, acceleration).torque
            scale = abs(acceleration) + speed * speed
            found = equations.accelerations((crank,), (speed,), torque)[0]
            assert found == pytest.approx(acceleration, abs=1e-12 * scale)


@each
def test_the_energy_is_that_of_another_hand(name):
    mechanism = MECHANISMS[name]
    equations = EquationsOfMotion(mechanism)
    oracle = (Oracle if isinstance(mechanism, FourBar) else SliderOracle)(mechanism)
    with mp.workdps(40):
        level = equations.energy((0.5,), (0.0,))[1] - float(oracle.energy(0.5, 0.0))
        for crank in CRANKS:
            kinetic, potential = equations.energy((crank,), (3.0,))
            assert kinetic > 0
            assert kinetic + potential - level == pytest.approx(
                float(oracle.energy(crank, 3.0)), rel=1e-13, abs=1e-12
            )


@each
def test_the_power_of_all_forces_is_the_rate_of_the_energy(name):
    """What a step of time adds to the energy, by central differences of order 4."""
    mechanism = MECHANISMS[name]
    solver, equations = Solver(mechanism), EquationsOfMotion(mechanism)
    speed, torque, h = 3.0, 5.0, 2e-4
    for crank in CRANKS:
        change = equations.accelerations((crank,), (speed,), torque)[0]

        def energy(time, crank=crank, change=change):
            moved = crank + speed * time + change * time * time / 2
            return sum(equations.energy((moved,), (speed + change * time,)))

        # Along this path the acceleration is right at time 0, where the rate is taken.
        rate = 8 * (energy(h) - energy(-h)) - (energy(2 * h) - energy(-2 * h))
        power = torque * speed
        if isinstance(mechanism, SliderCrank):
            slide = solver.state(crank, speed).velocity[2]
            power += (mechanism.slider.force - mechanism.slider.damping * slide) * slide
        assert equations.power((crank,), (speed,), torque) == pytest.approx(power, rel=1e-13)
        scale = abs(torque * speed) + abs(equations.energy((crank,), (speed,))[0])
        assert rate / (12 * h) == pytest.approx(power, abs=1e-6 * scale)


@each
def test_arrays_give_what_numbers_give(name):
    equations = EquationsOfMotion(MECHANISMS[name])
    cranks = np.array(CRANKS)
    kinetic, potential = equations.energy((cranks,), (3.0,))
    found = equations.accelerations((cranks,), (3.0,), 5.0)[0]
    for i, crank in enumerate(CRANKS):
        assert equations.energy((crank,), (3.0,)) == pytest.approx(
            (kinetic[i], potential[i]), rel=1e-14
        )
        assert equations.accelerations((crank,), (3.0,), 5.0)[0] == pytest.approx(
            found[i], rel=1e-12
        )


def test_without_any_mass_there_is_no_acceleration():
    equations = EquationsOfMotion(FourBar(Frame(2.2), Body(1.0), Coupler(3.0), Body(2.5)))
    with pytest.raises(MechanismError, match='something moves without a mass'):
        equations.accelerations((0.3,), (1.0,), 1.0)[0]
    with pytest.raises(MechanismError, match='give the links a mass or an inertia'):
        equations.accelerations((np.array([0.3, 0.4]),), (1.0,), 1.0)[0]


def test_beyond_the_reach_there_is_neither():
    linkage = FourBar(Frame(1.0), Body(0.9, 1.0, 0.1), Coupler(0.5), Body(0.5))
    equations = EquationsOfMotion(linkage)
    beyond = Solver(linkage).mobility.arcs[0][1] + 0.1
    with pytest.raises(UnreachableError):
        equations.accelerations((beyond,), (0.0,), 1.0)[0]
    with pytest.raises(UnreachableError):
        equations.energy((beyond,), (0.0,))


@pytest.mark.parametrize('bad', [math.nan, math.inf, -math.inf, np.array([1.0, math.nan])])
def test_what_is_not_finite_is_named(bad):
    solver = Solver(MECHANISMS['quadrilateral'])
    equations = EquationsOfMotion(solver.mechanism)
    for name, call in (
        ('crank angle', lambda: equations.accelerations((bad,), (1.0,), 1.0)[0]),
        ('crank speed', lambda: equations.accelerations((1.0,), (bad,), 1.0)[0]),
        ('torque', lambda: equations.accelerations((1.0,), (1.0,), bad)[0]),
        ('crank angle', lambda: equations.energy((bad,), (1.0,))),
        ('crank speed', lambda: equations.energy((1.0,), (bad,))),
        ('crank angle', lambda: solver.inertia(bad)),
    ):
        with pytest.raises(ConfigurationError, match=f'^{name} = .*: must be a finite number'):
            call()


def test_a_free_crank_keeps_its_energy():
    """Runge-Kutta of order 4 over two turns; its error falls sixteenfold with half the step."""
    equations = EquationsOfMotion(MECHANISMS['quadrilateral'])

    def drift(steps):
        crank, speed, h = 0.0, 12.0, 1.0 / steps
        start, worst = sum(equations.energy((crank,), (speed,))), 0.0
        for _ in range(steps):
            slopes = []
            for part in (0.0, 0.5, 0.5, 1.0):
                v, a = slopes[-1] if slopes else (speed, 0.0)
                at, fast = crank + part * h * v, speed + part * h * a
                slopes.append((fast, equations.accelerations((at,), (fast,), 0.0)[0]))
            (v1, a1), (v2, a2), (v3, a3), (v4, a4) = slopes
            crank += h / 6 * (v1 + 2 * v2 + 2 * v3 + v4)
            speed += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
            worst = max(worst, abs(sum(equations.energy((crank,), (speed,))) - start))
        assert crank > 4 * math.pi * 0.7
        return worst

    coarse, fine = drift(400), drift(800)
    assert fine < 1e-7
    assert 12 < coarse / fine < 40
