# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Torque-driven motion: orders, energy, other formulations, ends of motion, integrators."""

import itertools
import math
from dataclasses import replace
from decimal import Decimal
from functools import partial

import numpy as np
import pytest
from mechanisms import with_loads
from mpmath import mp
from oracle import Oracle
from scipy.integrate import quad
from test_methods import slope

from linkage_lab.methods import registry, situations
from linkage_lab.methods.integrators import OfPackage
from linkage_lab.methods.measure import attempt
from linkage_lab.methods.motion_cases import (
    ENERGY,
    LOOP,
    MEAN,
    TRAJECTORY,
    MotionCase,
    even,
)
from linkage_lab.reference import motions
from linkage_lab.reference.motions import (
    InitialValueProblem,
    MotionReference,
    coasting,
    driven_pump,
    free_pump,
)
from linkage_lab.reference.multibody import eliminate
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
from linkage_ros.motion.coordinates import DrivenMechanism
from linkage_ros.motion.drives import Motor, TorqueDrive
from linkage_ros.motion.steps import (
    AdaptiveSteps,
    FixedSteps,
    StiffSteps,
    live_steps,
    record_steps,
)
from linkage_ros.motion.under_torque import TorqueMotion
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
    return sum(solver.energy(steps.phase[:count], steps.phase[count:]))


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
    motion = TorqueMotion(Solver(WHEEL), TorqueDrive(Motor(3.0)), 0, 10**7, integrate)
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


# ---------------------------------------------------------------- integrators of the charts

BY_NAME = {method.name: method for method in registry.INTEGRATORS}
DRIVEN, FREE_PUMP, COASTING = driven_pump(6.0), free_pump(9.0), coasting()
each = pytest.mark.parametrize('method', registry.INTEGRATORS, ids=lambda method: method.name)


@pytest.fixture(scope='module')
def cases():
    """Returns the driven pump, the free pump, and a four-bar."""
    return {
        'driven': MotionCase(DRIVEN, even(1.0)),
        'free': MotionCase(FREE_PUMP, even(2.0), (ENERGY,)),
        'four-bar': MotionCase(COASTING, even(0.3)),
    }


def worst(case, method, setting, quantity):
    return max(error for _, error in case.outcomes(method, setting, quantity, MEAN))


# ---------------------------------------------------------------- the reference


@pytest.mark.parametrize('problem', [COASTING, FREE_PUMP])
def test_reference_is_the_same_with_shorter_steps(problem, monkeypatch):
    mine = MotionReference(problem).at(0.3)
    monkeypatch.setattr(motions, '_LONGEST', 0.01)
    for x, y in zip(mine, MotionReference(problem).at(0.3), strict=True):
        assert abs(x - y) < Decimal('1e-17')


def test_reference_agrees_with_an_integral_of_the_energy():
    """The time of a free crank is an integral over its angle, without time steps."""
    angle, speed = MotionReference(COASTING).at(0.1)
    oracle = Oracle(COASTING.mechanism)
    with mp.workdps(30):
        start = oracle.energy(0.0, mp.mpf(COASTING.start[1]))

        def rate(x):
            rest = oracle.energy(x, 0)
            return mp.sqrt((start - rest) / (oracle.energy(x, 1) - rest))

        angle = mp.mpf(str(angle))
        assert abs(rate(angle) - mp.mpf(str(speed))) < 1e-17
        taken = mp.quad(lambda x: 1 / rate(x), mp.linspace(0, angle, 4))
        assert abs(taken - mp.mpf(0.1)) < 1e-17


@pytest.mark.parametrize(
    ('problem', 'end'),
    # From an independent reference, with the pump's other data unchanged.
    [(driven_pump(2.0, 5.0), 0.399465563600), (driven_pump(2.0, -6.0), 0.230043884145),
     (DRIVEN, None)],
)  # fmt: skip
def test_singularity_of_the_coordinates_is_found(problem, end):
    assert MotionReference(problem).end(0.42) == pytest.approx(end, abs=1e-11)


def test_reference_stops_where_its_equations_are_singular():
    parallelogram = situations.four_bar((0.25, 0.75, 0.25, 0.75))
    reference = MotionReference(InitialValueProblem(parallelogram, (-0.5, 2.0)))
    reference._known[Decimal(0)][1:7] = [Decimal(x) for x in (1, 0, 1, 0, 1, 0)]  # in line
    with pytest.raises(ArithmeticError, match='cannot be followed'):
        reference.at(1.0)


def test_elimination_takes_the_largest_pivot():
    rows, right = [[0.0, 2.0, 1.0], [1.0, 1.0, 1.0], [4.0, 0.0, -1.0]], [3.0, 2.0, 1.0]
    assert eliminate(rows, right) == pytest.approx(np.linalg.solve(rows, right))
    with pytest.raises(ZeroDivisionError):
        eliminate([[1.0, 2.0], [2.0, 4.0]], [1.0, 1.0])


# ---------------------------------------------------------------- orders and floors


def implicit(problem, setting):
    begin = partial(StiffSteps, longest=setting['step'], tolerance=math.inf)
    return OfPackage(problem, begin)


@pytest.mark.parametrize(
    ('method', 'steps', 'order'),
    [
        (BY_NAME['RK4'], (0.05, 0.025, 0.0125, 0.005), 4),
        (BY_NAME[registry.LIVE], (0.025, 0.0125, 0.005, 0.0025), 5),
        (replace(BY_NAME[registry.LIVE], solve=implicit), (0.025, 0.0125, 0.00625), 5),
    ],
)
def test_fixed_steps_are_of_their_order(cases, method, steps, order):
    found = [worst(cases['driven'], method, {'step': s}, TRAJECTORY) for s in steps]
    assert slope(steps, found) == pytest.approx(order, abs=0.3)


@each
def test_errors_fall_with_each_setting_down_to_a_floor(cases, method):
    case = cases['driven']
    found = [worst(case, method, setting, TRAJECTORY) for setting in method.settings]
    down = [max(error, 2e-13) for error in found[: found.index(min(found)) + 1]]
    assert all(b < a or b == 2e-13 for a, b in itertools.pairwise(down)), found
    assert down[-1] < (2e-7 if method.name == 'Radau' else 1e-8), found


@pytest.mark.parametrize(
    ('name', 'steps'), [(registry.LIVE, live_steps), (registry.RECORDS, record_steps)]
)
def test_defaults_are_right_and_equal_those_of_live_runs_and_records(cases, name, steps):
    method, case = BY_NAME[name], cases['driven']
    for judged in (case, cases['four-bar']):
        assert worst(judged, method, method.steady, TRAJECTORY) < 1e-10
    taken = steps(DRIVEN.driven, DRIVEN.start)
    rows = case.rows(method, method.steady, TRAJECTORY, MEAN)
    for time, (*phase, _) in zip(case.times, rows, strict=True):
        taken.advance(time)
        assert tuple(phase) == (with_turns(taken.phase[0], taken.pairs), *taken.phase[1:])


# ---------------------------------------------------------------- energy and the loop


@each
def test_free_motion_keeps_its_energy_and_a_closed_loop(cases, method):
    case = cases['free']
    limit = 1e-6 if method.name.startswith(('Radau', 'multipliers')) else 1e-10
    assert worst(case, method, method.steady, ENERGY) < limit
    # Without stabilisation the loop opens; Baumgarte's equation limits the gap, projection
    # closes it.
    limits = {'multipliers, unstabilised': (1e-9, 1e-6), 'multipliers, Baumgarte': (1e-14, 1e-9)}
    least, most = limits.get(method.name, (0.0, 1e-14))
    assert least <= worst(case, method, method.steady, LOOP) < most


# ---------------------------------------------------------------- measuring


def test_a_method_that_fails_has_no_time():
    case = MotionCase(driven_pump(2.0, 6.0), even(0.5))
    panel = BY_NAME['RK4'], {'step': 0.05}, TRAJECTORY, MEAN
    assert attempt(case.timer(*panel)) is None
    assert case.rows(*panel)[-1] is None


def test_errors_of_angle_and_speed_and_lost_turns_are_measured(cases):
    case = cases['driven']
    exact = [float(x) for x in MotionReference(DRIVEN).at(case.times[0])]
    length = DRIVEN.mechanism.crank.length

    def error(*added):
        phase = tuple(np.add(exact, [*added, *[0.0] * (4 - len(added))]).tolist())
        return case.error(TRAJECTORY, 0, [*phase, 0.0])

    assert error(0.0) < 1e-15
    assert error(1e-3) == pytest.approx(1e-3)
    assert error(0.0, 1e-3 * length) == pytest.approx(1e-3)
    assert error(2 * math.pi) == pytest.approx(2 * math.pi)  # a lost turn is an error


@pytest.mark.parametrize('integrate', [live_steps, record_steps])
@pytest.mark.parametrize('link', ['rocker', 'slider'])
def test_a_load_that_holds_the_linkage_at_rest_is_named(link, integrate):
    """The load opposes the motion in both directions, like dry friction."""
    mechanism = load('quadrilateral' if link == 'rocker' else 'slider_crank').mechanism
    holds = LoadCurve(link, 'position', at=(0.0,), value=(-9.0,), return_value=(9.0,))
    crank = replace(mechanism.crank, inertia=0.02)
    mechanism = replace(mechanism, crank=crank, gravity=(0.0, 0.0), loads=(holds,))
    drive = TorqueDrive(Motor(0.05), start_rpm=40.0)
    motion = TorqueMotion(Solver(mechanism), drive, 0, 10_000_000, integrate)
    with pytest.raises(MotionError, match='holds the linkage at rest') as raised:
        motion.at(20_000_000_000)
    assert raised.value.time > 0.1
