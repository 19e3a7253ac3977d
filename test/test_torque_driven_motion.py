# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Torque-driven motion: orders, energy, other formulations, ends of motion, integrators."""

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
    MotionError,
    Solver,
    UnreachableError,
)
from linkage_ros.motion.driven_mechanism import DrivenMechanism
from linkage_ros.motion.drives.base import Machine
from linkage_ros.motion.drives.torque import TorqueDrive
from linkage_ros.motion.steps import (
    AdaptiveSteps,
    FixedSteps,
    live_steps,
    record_steps,
)
from linkage_ros.motion.under_torque import Motor
from linkage_ros.numeric import with_turns, within_two_turns
from linkage_ros.settings.configuration import load

PUMP = load('wind_pump').mechanism
QUADRILATERAL = load('quadrilateral').mechanism
TWO_TURNS = 4 * math.pi
# Constant inertia, no weight.
WHEEL = FourBar(Frame(0.4), Body(0.1, inertia=2.0), Coupler(0.35), Body(0.3), gravity=(0.0, 0.0))
both = pytest.mark.parametrize('integrate', [FixedSteps, AdaptiveSteps])


def motor(speed):
    return 8.4 - 1.2 * speed


def begun(integrate, mechanism, phase, law=lambda _: 0.0, **options):
    return integrate(DrivenMechanism(Solver(mechanism), law), phase, **options)


def energy(steps):
    count = len(steps.phase) // 2
    solver = steps.driven.solver
    return sum(solver.energy(solver.state(steps.phase[:count], steps.phase[count:])))


# ---------------------------------------------------------------- accuracy


def test_too_long_steps_are_halved():
    start = (0.0, 1.5, 6.0, 0.0)
    careless = begun(FixedSteps, PUMP, start, motor, longest=0.2, tolerance=math.inf)
    careful = begun(FixedSteps, PUMP, start, motor, longest=0.2)
    fine = begun(FixedSteps, PUMP, start, motor)
    for steps in (careless, careful, fine):
        steps.advance(2.0)
    apart = np.abs(np.subtract(careful.phase, fine.phase)).max()
    assert apart < 1e-7 < 1e-5 < np.abs(np.subtract(careless.phase, fine.phase)).max()


def test_flywheel_without_gravity_follows_its_exact_solution():
    """The exact solution for constant torque, damping and inertia is known."""
    for integrate in (FixedSteps, AdaptiveSteps):
        steps = begun(integrate, WHEEL, (0.5, 0.0), lambda speed: 3.0 - 0.8 * speed)
        steps.advance(4.0)
        rate = 0.8 / 2.0
        speed = 3.0 / 0.8 * (1 - math.exp(-rate * 4.0))
        angle = 0.5 + 3.0 / 0.8 * (4.0 - (1 - math.exp(-rate * 4.0)) / rate)
        assert steps.phase[1] == pytest.approx(speed, rel=1e-12)
        assert with_turns(steps.phase[0], steps.pairs) == pytest.approx(angle, rel=1e-12)


def test_corners_of_a_load_do_not_reduce_the_accuracy_of_a_record():
    """The time to each position follows from the work of a narrow load peak on a flywheel."""
    at, value, turn = (1.0, 1.03, 1.06), (0.0, 9.0, 0.0), 2 * math.pi
    mechanism = with_loads(WHEEL, LoadCurve('crank', 'crank_angle', at, value))
    corners = np.array([k * turn + place for k in range(4) for place in (0.0, *at)])
    torques = np.interp(corners, at, value, period=turn)
    work = np.insert(np.cumsum(np.diff(corners) * (torques[1:] + torques[:-1]) / 2), 0, 0.0)

    def time_per_angle(angle):
        i = np.searchsorted(corners, angle, side='right') - 1
        torque = np.interp(angle, at, value, period=turn)
        done = work[i] + (angle - corners[i]) * (torques[i] + torque) / 2
        return 1 / math.sqrt(6.0**2 + done)  # 2 kg m^2, from 6 rad/s

    def time(angle):
        inside = corners[corners < angle]
        return quad(time_per_angle, 0.0, angle, points=inside, limit=200, epsrel=1e-14)[0]

    angles = np.arange(1, 19)
    times = [time(angle) for angle in angles]

    def error(integrate):
        steps = begun(integrate, mechanism, (0.0, 6.0))
        found = [with_turns(phase[0], pairs) for phase, pairs in steps.phases(times)]
        return np.abs(np.subtract(found, angles)).max()

    assert error(record_steps) < 1e-10 < 1e-5 < error(AdaptiveSteps)  # steps over the peak


@both
def test_a_command_acts_from_its_stamp_on(integrate):
    motion = TorqueDrive(Motor(3.0)).begin(0, Machine(Solver(WHEEL), 10**7, integrate=integrate))
    assert motion.at(10**9).u[0] == pytest.approx(3.0 / 2.0, rel=1e-12)
    motion.command(10**9, -1.0)
    assert motion.at(3 * 10**9).u[0] == pytest.approx((3.0 + 2 * 2.0) / 2.0, rel=1e-12)
    assert motion.at(3 * 10**9).a[0] == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize('integrate', [live_steps, record_steps])
@pytest.mark.parametrize('damping', [1e3, 1e5, 1e7])
def test_a_steep_motor_line_keeps_its_speed_with_bounded_work(integrate, damping):
    """From rest; up to O(1 / damping), the motor torque is that needed at a constant speed."""
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
    # Explicit steps would need a call per time constant, up to 1e8 calls.
    assert len(calls) < {live_steps: 11_000, record_steps: 60_000}[integrate]


def test_time_constants_below_the_resolution_of_time_are_followed_after_days():
    """In double precision, 300 days are resolved to 4 ns; this motion needs 2 ps."""
    ends = []
    for time in (0.0, 300 * 86400.0):
        steps = begun(live_steps, QUADRILATERAL, (0.0, 0.0), lambda u: 1e10 * (3.0 - u))
        steps.time = time
        steps.advance(time + 1e-3)
        ends.append(steps.phase)
    assert ends[1] == pytest.approx(ends[0], abs=1e-7)


# ---------------------------------------------------------------- change points


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
    """The links continue to turn through the line in which they could change assembly."""
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


# ---------------------------------------------------------------- impossible starts


@both
def test_impossible_start_is_refused_at_once(integrate):
    with pytest.raises(UnreachableError, match='the slider must be within'):
        begun(integrate, PUMP, (0.0, 9.0, 0.0, 0.0))
    with pytest.raises(UnreachableError, match='cannot move at'):
        begun(integrate, LIMITED, (Solver(LIMITED).mobility.arcs[0][1] + 0.2, 0.0))
    bare = FourBar(Frame(2.2), Body(1.0), Coupler(3.0), Body(2.5))
    with pytest.raises(MechanismError, match='without mass'):
        begun(integrate, bare, (0.0, 0.0))


# ---------------------------------------------------------------- turns


@pytest.mark.parametrize('pairs', [0, 1, -1, 12, -3_000, 10**6])
def test_turns_are_split_off_and_added_exactly(pairs):
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


@pytest.mark.parametrize('integrate', [live_steps, record_steps])
@pytest.mark.parametrize('link', ['rocker', 'slider'])
def test_a_load_that_holds_the_linkage_at_rest_is_named(link, integrate):
    """The load opposes the motion in both directions, like dry friction."""
    mechanism = load('quadrilateral' if link == 'rocker' else 'slider_crank').mechanism
    holds = LoadCurve(link, 'position', at=(0.0,), value=(-9.0,), return_value=(9.0,))
    crank = replace(mechanism.crank, inertia=0.02)
    mechanism = replace(mechanism, crank=crank, gravity=(0.0, 0.0), loads=(holds,))
    drive = TorqueDrive(Motor(0.05), start_rpm=40.0)
    motion = drive.begin(0, Machine(Solver(mechanism), 10_000_000, integrate=integrate))
    with pytest.raises(MotionError, match='holds the linkage at rest') as raised:
        motion.at(20_000_000_000)
    assert raised.value.time > 0.1
