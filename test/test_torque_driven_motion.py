# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Torque in, motion out: orders, energy, other formulations, and where a motion ends."""

import math
from dataclasses import replace

import numpy as np
import pytest
from mechanisms import with_loads
from scipy.integrate import quad

from linkage_ros import (
    Body,
    Coupler,
    FourBar,
    Frame,
    LoadCurve,
    MechanismError,
    Solver,
    UnreachableError,
)
from linkage_ros.motion.adaptive_integrator import AdaptiveSteps
from linkage_ros.motion.driven_mechanism import DrivenMechanism
from linkage_ros.motion.drives import Motor, TorqueDrive
from linkage_ros.motion.fixed_step_integrator import FixedSteps
from linkage_ros.motion.integrators import live_steps, record_steps
from linkage_ros.motion.torque_driven import TorqueMotion
from linkage_ros.numeric import with_turns, within_two_turns
from linkage_ros.parameters.configuration import load

PUMP = load('wind_pump').mechanism
FREE = replace(PUMP, slider=replace(PUMP.slider, damping=0.0))
QUADRILATERAL = load('quadrilateral').mechanism
TWO_TURNS = 4 * math.pi
# Of even inertia, without weight.
WHEEL = FourBar(Frame(0.4), Body(0.1, inertia=2.0), Coupler(0.35), Body(0.3), gravity=(0.0, 0.0))
both = pytest.mark.parametrize('integrate', [FixedSteps, AdaptiveSteps])


def motor(speed):
    return 8.4 - 1.2 * speed


def idle(_):
    return 0.0


def begun(integrate, mechanism, phase, law=idle, **options):
    return integrate(DrivenMechanism(Solver(mechanism), law), phase, **options)


def energy(steps):
    count = len(steps.phase) // 2
    solver = steps.driven.solver
    return sum(solver.energy(steps.phase[:count], steps.phase[count:]))


# ---------------------------------------------------------------- right


def test_too_long_steps_are_halved():
    start = (0.0, 1.5, 6.0, 0.0)
    careless = begun(FixedSteps, PUMP, start, motor, longest=0.2, tolerance=math.inf)
    careful = begun(FixedSteps, PUMP, start, motor, longest=0.2)
    fine = begun(FixedSteps, PUMP, start, motor)
    for steps in (careless, careful, fine):
        steps.advance(2.0)
    apart = np.abs(np.subtract(careful.phase, fine.phase)).max()
    assert apart < 1e-7 < 1e-5 < np.abs(np.subtract(careless.phase, fine.phase)).max()


def test_without_gravity_a_lone_flywheel_turns_evenly():
    """A closed answer: constant torque, damping, constant inertia."""
    for integrate in (FixedSteps, AdaptiveSteps):
        steps = begun(integrate, WHEEL, (0.5, 0.0), lambda speed: 3.0 - 0.8 * speed)
        steps.advance(4.0)
        rate = 0.8 / 2.0
        speed = 3.0 / 0.8 * (1 - math.exp(-rate * 4.0))
        angle = 0.5 + 3.0 / 0.8 * (4.0 - (1 - math.exp(-rate * 4.0)) / rate)
        assert steps.phase[1] == pytest.approx(speed, rel=1e-12)
        assert with_turns(steps.phase[0], steps.pairs) == pytest.approx(angle, rel=1e-12)


def test_corners_of_a_load_cost_a_record_no_accuracy():
    """The time to each place follows from the work of a narrow peak of a load on a wheel."""
    at, value, turn = (1.0, 1.03, 1.06), (0.0, 9.0, 0.0), 2 * math.pi
    mechanism = with_loads(WHEEL, LoadCurve('crank', 'crank_angle', at, value))
    corners = np.array([k * turn + place for k in range(4) for place in (0.0, *at)])
    torques = np.interp(corners, at, value, period=turn)
    work = np.insert(np.cumsum(np.diff(corners) * (torques[1:] + torques[:-1]) / 2), 0, 0.0)

    def time_per_angle(angle):
        i = np.searchsorted(corners, angle, side='right') - 1
        torque = np.interp(angle, at, value, period=turn)
        done = work[i] + (angle - corners[i]) * (torques[i] + torque) / 2
        return 1 / math.sqrt(6.0**2 + done)  # of 2 kg m^2, from 6 rad/s

    def time(angle):
        inside = corners[corners < angle]
        return quad(time_per_angle, 0.0, angle, points=inside, limit=200, epsrel=1e-14)[0]

    angles = np.arange(1, 19)
    times = [time(angle) for angle in angles]

    def error(integrate):
        steps = begun(integrate, mechanism, (0.0, 6.0))
        found = [with_turns(phase[0], pairs) for phase, pairs in steps.phases(times)]
        return np.abs(np.subtract(found, angles)).max()

    assert error(record_steps) < 1e-10 < 1e-5 < error(AdaptiveSteps)  # which steps over the peak


@both
def test_a_command_acts_from_its_stamp_on(integrate):
    motion = TorqueMotion(Solver(WHEEL), TorqueDrive(Motor(3.0)), 0, 10**7, integrate)
    assert motion.at(10**9).u[0] == pytest.approx(3.0 / 2.0, rel=1e-12)
    motion.command(10**9, -1.0)
    assert motion.at(3 * 10**9).u[0] == pytest.approx((3.0 + 2 * 2.0) / 2.0, rel=1e-12)
    assert motion.at(3 * 10**9).a[0] == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize('integrate', [live_steps, record_steps])
@pytest.mark.parametrize('damping', [1e3, 1e5, 1e7])
def test_a_steep_motor_line_keeps_its_speed_with_bounded_work(integrate, damping):
    """From rest; the motor gives what the crank needs at an even speed, but for O(1 / damping)."""
    speed, calls = 5 * math.pi, []

    def law(u):
        calls.append(u)
        return damping * (speed - u)

    steps = begun(integrate, QUADRILATERAL, (0.0, 0.0), law)
    found = np.array([phase for phase, _ in steps.phases(np.arange(1, 81) * 5e-3)]).T
    needed = Solver(QUADRILATERAL).state(found[0], speed).torque
    given = damping * (speed - found[1])
    assert np.abs(given).max() < 1.2 * np.abs(needed).max()
    assert given == pytest.approx(needed, abs=40 / damping)
    # Explicit steps would need a call for each time constant, up to 1e8 of them.
    assert len(calls) < {live_steps: 11_000, record_steps: 60_000}[integrate]


def test_after_days_time_constants_shorter_than_the_clock_resolves_are_followed():
    """In double precision, 300 days are known to 4 ns; here 2 ps count."""
    ends = []
    for time in (0.0, 300 * 86400.0):
        steps = begun(live_steps, QUADRILATERAL, (0.0, 0.0), lambda u: 1e10 * (3.0 - u), time=time)
        steps.advance(time + 1e-3)
        ends.append(steps.phase)
    assert ends[1] == pytest.approx(ends[0], abs=1e-7)


# ---------------------------------------------------------------- everywhere


BODY = {'mass': 1.0, 'inertia': 0.02}
PARALLELOGRAM = FourBar(
    Frame(0.4, 0.3), Body(0.1, **BODY), Coupler(0.4, **BODY, center=(0.2, 0.05)),
    Body(0.1, **BODY),
)  # fmt: skip
MISSED_BY_A_HAIR = FourBar(
    Frame(0.425, 0.3), Body(0.1, **BODY), Coupler(0.315, **BODY), Body(0.21 + 1e-9, **BODY)
)


@both
@pytest.mark.parametrize('linkage', [PARALLELOGRAM, MISSED_BY_A_HAIR])
def test_change_points_are_passed(integrate, linkage):
    """The links turn on through the line in which they could change assembly."""
    steps = begun(integrate, linkage, (0.2, 9.0))
    start = energy(steps)
    for tick in range(1, 301):
        steps.advance(tick * 0.01)
        assert energy(steps) == pytest.approx(start, rel=1e-6)
    assert with_turns(steps.phase[0], steps.pairs) > 15
    coupler = Solver(linkage).state(*steps.phase).velocity[1]
    assert linkage is not PARALLELOGRAM or coupler == pytest.approx(0, abs=1e-9)


LIMITED = FourBar(
    Frame(1.0, math.pi), Body(0.9, 1.0, 0.1, (0.45, 0.0)), Coupler(0.5, 1.0, 0.05, (0.25, 0.0)),
    Body(0.6, 1.0, 0.05, (0.3, 0.0)),
)  # fmt: skip


def limited_rest():
    """The crank angle at which the weights alone balance, inside the reach."""
    solver = Solver(LIMITED)
    low, high = solver.mobility.arcs[0]
    cranks = np.linspace(low + 0.05, high - 0.05, 2000)
    potential = solver.energy((cranks,), (0.0,))[1]
    return float(cranks[np.argmin(potential)]), (low, high)


@both
def test_a_limited_crank_swings_inside_its_arc(integrate):
    rest, (low, high) = limited_rest()
    assert low + 0.1 < rest < high - 0.1
    steps = begun(integrate, LIMITED, (rest + 0.02, 0.0))
    start, seen = energy(steps), []
    for tick in range(1, 1001):
        steps.advance(tick * 0.01)
        seen.append(with_turns(steps.phase[0], steps.pairs))
        assert energy(steps) == pytest.approx(start, abs=1e-9 * abs(start))
    assert low < min(seen) < rest - 0.01
    assert rest + 0.01 < max(seen) < high


# ---------------------------------------------------------------- the edge


@both
@pytest.mark.parametrize(
    ('velocity', 'time'),
    # From the multiplier formulation, which runs through.
    [(5.0, 0.399465563600), (6.0, 0.273729384923), (-6.0, 0.230043884145)],
)
def test_a_dyad_is_stretched_or_folded_when_it_should_be(integrate, velocity, time):
    """And the pump goes on: before and after it stands in different assemblies."""
    steps = begun(integrate, PUMP, (0.0, 1.5, 2.0, velocity), motor)
    sides = []
    for tick in (time - 1e-6, time + 1e-6):
        steps.advance(tick)
        half = len(steps.phase) // 2
        _, coupler, rod, _ = steps.driven.solver.state(
            steps.phase[:half], steps.phase[half:]
        ).position
        sides.append(math.sin(rod - coupler))
    assert sides[0] * sides[1] < 0
    assert max(map(abs, sides)) < 1e-4


@both
def test_impossible_start_is_refused_at_once(integrate):
    with pytest.raises(UnreachableError, match='the slider can be within'):
        begun(integrate, PUMP, (0.0, 9.0, 0.0, 0.0))
    with pytest.raises(UnreachableError, match='cannot move at'):
        begun(integrate, LIMITED, (Solver(LIMITED).mobility.arcs[0][1] + 0.2, 0.0))
    bare = FourBar(Frame(2.2), Body(1.0), Coupler(3.0), Body(2.5))
    with pytest.raises(MechanismError, match='without a mass'):
        begun(integrate, bare, (0.0, 0.0))


# ---------------------------------------------------------------- turns


@pytest.mark.parametrize('pairs', [0, 1, -1, 12, -3_000, 10**6])
def test_turns_are_cut_and_added_exactly(pairs):
    for angle in np.linspace(-12.5, 12.5, 11).tolist():
        whole = with_turns(angle, pairs)
        cut, found = within_two_turns(whole)
        assert abs(cut) < TWO_TURNS + 1e-9
        assert with_turns(cut, found) == whole
        assert math.remainder(cut - angle, TWO_TURNS) == pytest.approx(0, abs=2 * math.ulp(whole))


@both
def test_the_crank_is_kept_within_two_turns_and_turns_are_counted(integrate):
    steps = begun(integrate, WHEEL, (0.5 - 40 * TWO_TURNS, -100.0))
    for second in range(1, 6):
        steps.advance(float(second))
        assert abs(steps.phase[0]) <= TWO_TURNS
    turned = with_turns(steps.phase[0], steps.pairs)
    assert turned == pytest.approx(0.5 - 40 * TWO_TURNS - 500.0, rel=1e-12)
    assert steps.pairs < -70
