# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Steady states of the wind pump, compared with other programs, with laws, and for other pumps."""

import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text
from scipy.integrate import solve_ivp

from linkage_ros import ConfigurationError, Solver, UnreachableError
from linkage_ros.lab.output import DPI
from linkage_ros.lab.pump.analysis import analyse
from linkage_ros.lab.pump.chart import draw_pump, states_table
from linkage_ros.lab.pump.equations import BOTH, PumpSolver
from linkage_ros.lab.pump.harmonic_balance import HarmonicBalance
from linkage_ros.lab.pump.load_curve import (
    FOLD,
    PERIOD_DOUBLING,
    TORUS,
    bistable_ranges,
    follow,
    stability_lost,
    steady_states,
    with_curves,
)
from linkage_ros.lab.pump.motions import Motions, alternating_motions
from linkage_ros.lab.pump.settling import Search, prepared, settle
from linkage_ros.lab.reference.motions import InitialValueProblem, MotionReference
from linkage_ros.model.load_curve import LoadCurve
from linkage_ros.model.parts import Body, Coupler, Piston
from linkage_ros.motion.driven_mechanism import DrivenMechanism
from linkage_ros.motion.drives import Motor
from linkage_ros.motion.integrators import FixedSteps
from linkage_ros.parameters.configuration import load

PUMP = load('wind_pump').mechanism
MOTOR = Motor(8.4, 1.2)
BALANCE = HarmonicBalance(PUMP, MOTOR.damping)
# Speed, stroke and multipliers of the states, by another program, which shares nothing with the
# package; multipliers to the digits it printed. It printed no stroke of the unstable state.
STATES = (
    (2.604252349376, 0.519128369836, (0.0038 + 0.3505j, 0.0038 - 0.3505j, 0.2851)),
    (3.951611254418, None, (1.28656, 0.0824 + 0.2818j, 0.0824 - 0.2818j)),
    (6.248845170700, 0.137861636990, (0.94983, -0.762, -0.337)),
)
LOW_AT_0 = (1.540999924466, 2.568032724352, 0.573289247289)


def plain(items, _):
    return items


def slid(**changes):
    return replace(PUMP, slider=replace(PUMP.slider, **changes))


WEAK = slid(damping=15.0)


def analysed(pump, motor=MOTOR):
    return analyse(pump, motor, speeds=(2.0, 6.0), progress=plain)


def branch(mechanism, low, high):
    """Returns the load curve between two speeds."""
    balance = HarmonicBalance(mechanism, MOTOR.damping)
    seed = next(balance.resting_sliders((low + high) / 2, low))
    return balance, follow(balance, seed, (low, high))


def at_crank_angle_0(motion):
    """Returns slider position, crank speed and slider velocity."""
    return motion.at(np.zeros(1))[:, 0].tolist()


def moved(pump, motor, start, times, *steps):
    """Returns crank angle and speed at times after a start, by the integrator of the package."""
    steps, found = FixedSteps(DrivenMechanism(Solver(pump), motor.at), (0.0, *start), *steps), []
    for time in times:
        steps.advance(time)
        found.append((steps.driven.crank(steps.phase, steps.pairs), steps.phase[2]))
    return found


def moved_freely(motor, start, times):
    """Returns phases of the weakly damped pump, whose bodies move independently, in 50 digits."""
    followed = MotionReference(InitialValueProblem(WEAK, (0.0, *start), motor))
    return [np.array(followed.at(time), float) for time in times]


def table_of(analysis, **changes):
    return states_table(analysis._replace(**changes))


@pytest.fixture(scope='module')
def analysis():
    return analysed(PUMP)


@pytest.fixture(scope='module')
def motions(analysis):
    return [state.motion for state in analysis.states]


@pytest.fixture(scope='module')
def doubled():
    """Returns the pump with weak damping, with which one of its states repeats after two turns."""
    return analysed(WEAK)


# ---------------------------------------------------------------- document 3's figure 3


def test_three_states_are_those_of_another_program(motions):
    assert [motion.stable for motion in motions] == [True, False, True]
    for motion, (speed, stroke, (largest, *others)) in zip(motions, STATES, strict=True):
        assert motion.multipliers[0] == pytest.approx(largest, abs=1e-4)
        assert motion.multipliers[1:] == pytest.approx(others, abs=5e-4)
        assert motion.speed == pytest.approx(speed, abs=1e-10)
        assert stroke is None or motion.stroke == pytest.approx(stroke, abs=1e-10)
    assert at_crank_angle_0(motions[0]) == pytest.approx(LOW_AT_0, abs=1e-10)
    ends = sorted(motions[0].turning_points)
    assert ends == pytest.approx([1.133966760583, 1.653095130419], abs=1e-10)


def test_the_multipliers_shrink_phase_space_as_resistance_does(motions):
    # Liouville: the volume of phases (q, M q') shrinks by tr(M^-1 D), D the resistances.
    crank = np.arange(512) * (2 * math.pi / 512)
    for motion in motions:
        x, w, _ = motion.at(crank)
        (m11, m12), (_, m22) = Solver(PUMP).matrix((crank, x))
        shrink = (MOTOR.damping * m22 + PUMP.slider.damping * m11) / (m11 * m22 - m12 * m12)
        expected = math.exp(-2 * math.pi * np.mean(shrink / w))
        assert math.prod(motion.multipliers) == pytest.approx(expected, rel=1e-6)


def test_averaging_with_one_harmonic_comes_near(analysis, motions):
    averaged = [state.averaged for state in analysis.states]
    assert [one.speed for one in averaged] == pytest.approx([2.6046, 3.8871, 6.3015], abs=5e-5)
    assert [one.stroke for one in averaged] == pytest.approx(
        [motion.stroke for motion in motions], rel=0.04
    )
    # Van der Pol: the crank has one speed, and its load is the torque that the motor has left.
    assert all(len(one.crank) == 1 for one in averaged)
    # How slow deviations die away is near to what the exact motion does.
    for one, motion in zip(averaged, motions, strict=True):
        assert one.stable == motion.stable
        assert abs(one.multipliers[0]) == pytest.approx(abs(motion.multipliers[0]), rel=0.02)
    assert averaged[0].load == pytest.approx(8.4 - 1.2 * averaged[0].speed, rel=1e-12)


def test_two_stable_states_exist_between_two_folds(analysis):
    (found,) = bistable_ranges(analysis.pieces)
    assert (found['low'], found['high']) == pytest.approx((7.28, 12.65), abs=0.01)
    assert (found['low_is'], found['high_is']) == (FOLD, FOLD)
    low, high = found['low'] - 1e-3, found['high'] - 1e-3
    for torque, stable in ((0.3, []), (5.0, [1]), (low, [1]), (high, [1, 0, 1])):
        states = steady_states(BALANCE, analysis.pieces, torque)
        assert [state.motion.stable for state in states] == stable
    for piece in analysis.pieces[:-1]:
        assert piece.motions[-1].multipliers[0] == pytest.approx(1, abs=1e-6)


def test_torques_with_two_stable_states_do_not_depend_on_the_torque_asked_for(analysis):
    other = analysed(PUMP, Motor(12.5, MOTOR.damping))
    assert bistable_ranges(other.pieces) == bistable_ranges(analysis.pieces)
    assert other.states[0].motion.speed > analysis.states[0].motion.speed
    # Beyond the fold the slow state no longer exists.
    _, lost = (one for one in other.sensitivities if one['state'] == 0)
    assert (lost['motion'], lost['changes']) == (None, {})
    assert lost['reason'] == 'its curve ends at 12.65 N m: fold'
    assert f'torque +5%: {lost["reason"]}' in '\n'.join(states_table(other))


def test_small_changes_of_the_torque_leave_the_pump_about_the_same(analysis):
    changes = [one['changes'] for one in analysis.sensitivities]
    assert [one['state'] for one in analysis.sensitivities] == [0, 2, 0, 2]
    assert [one['stroke'] for one in changes[::2]] == pytest.approx([-0.0255, 0.0246], abs=2e-4)
    assert [one['flow'] for one in changes[1::2]] == pytest.approx([0.0020, 0.0120], abs=2e-4)
    assert [one['speed'] > 0 for one in changes] == [False, False, True, True]
    for one in changes:
        flow = (1 + one['speed']) * (1 + one['stroke']) - 1
        assert one['flow'] == pytest.approx(flow, abs=1e-12)


# ---------------------------------------------------------------- a lift load


def test_efficiency_is_the_share_of_the_crank_work_that_lifts():
    at, value = (0.0, 1.5, 3.0, 4.5), (0.0, 60.0, 0.0, 0.0)
    pump = replace(PUMP, loads=(LoadCurve('slider', at=at, value=value),))
    found = settle(pump, MOTOR, 2.0, plain)
    # Its own means over time: the motion at equal angles, weighted with the time spent there.
    angles = np.linspace(0, 2 * math.pi, 4096, endpoint=False)
    _, w, v = found.at(angles)
    lifted = np.mean(-np.interp(angles, (*at, 2 * math.pi), (*value, 0.0)) * v / w)
    resisted = np.mean(60.0 * v * v / w)
    assert found.efficiency == pytest.approx(lifted / (lifted + resisted), rel=2e-3)
    assert 0.1 < found.efficiency < 0.5


def test_a_constant_force_lifts_nothing_and_no_force_has_no_efficiency(analysis):
    found = settle(slid(force=-20.0), MOTOR, 2.0, plain)
    assert found.efficiency == pytest.approx(0, abs=1e-12)
    vars(found)['efficiency'] = -1e-17  # its sign depends on the machine; it is printed without
    first, *others = analysis.states
    assert first.motion.efficiency is None
    head, _, *rows = table_of(analysis, states=[first._replace(motion=found), *others])[:5]
    assert 'efficiency' in head
    assert [row.split()[5] for row in rows] == ['0.0000', '-', '-']


def test_a_force_that_jumps_where_the_slider_turns_is_followed_within_half_a_percent():
    load_curve = LoadCurve(
        'slider', 'position', at=(1.0, 2.0), value=(-60.0, -60.0), return_value=(0.0, 0.0)
    )
    pump = replace(slid(damping=20.0), loads=(load_curve,))
    # By SciPy's integrator with the jump, and differences of its turn.
    for start, speed, multiplier in ((2.0, 2.521904, 0.5303), (6.0, 5.587804, 0.9511)):
        found = settle(pump, MOTOR, start, plain)
        assert found.speed == pytest.approx(speed, rel=0.005)
        assert found.multipliers[0] == pytest.approx(multiplier, abs=0.02)


# ---------------------------------------------------------------- from where


def test_runs_end_at_the_states(analysis):
    assert {run.name: run.state for run in analysis.runs} == {
        '2 rad/s': 0,
        '6 rad/s': 2,
        'beside 3.952 rad/s, slower': 0,
        'beside 3.952 rad/s, faster': 2,
    }
    ends = [np.mean(run.speeds[-100:]) for run in analysis.runs[:2]]
    assert ends == pytest.approx([STATES[0][0], STATES[2][0]], rel=0.02)


# A rod that is longer than crank and coupler together, and one that is not.
@pytest.mark.parametrize(('rod', 'position'), [(1.6, 1.5), (0.9, 1.0)])
def test_a_motion_is_followed_past_the_stretched_dyad(rod, position):
    pump = replace(PUMP, rod=replace(PUMP.rod, length=rod, center=(rod / 2, 0.0)))
    start, solver = (position, 2.0, 6.0), PumpSolver(pump)
    found = Motions(solver, MOTOR, solver.converted(np.array([(0.0, *start)]).T))
    found.advance(60)
    phases = np.array(found.phases)[..., 0]
    assert np.ptp(np.sign(np.sin(phases[:, 1] - phases[:, 2]))) == 2  # both assemblies
    ((crank, w),) = moved(pump, MOTOR, start, [found.times[-1][0]])
    assert phases[-1, [0, 3]] == pytest.approx([crank, w], abs=0.01)


def test_a_pump_that_does_not_settle_in_time_says_so(motions):
    # For the first turns it stays beside the unstable state.
    x, w, v = at_crank_angle_0(motions[1])
    with pytest.raises(ConfigurationError, match=r'does not settle within \d+\.\d turns'):
        settle(slid(position=x, velocity=v), MOTOR, w, lambda items, _: [next(iter(items))])


def test_motions_that_pass_a_state_beside_an_unstable_one_do_not_belong_to_it():
    pump = replace(
        PUMP,
        crank=Body(0.165, 20.0, 4.891, (-0.263, 0.0)),
        coupler=Coupler(0.801, 41.816, 2.909, (0.582, -0.059)),
        rod=Body(1.824, 1.304, 0.27, (0.652, 0.0)),
        slider=Piston(2.167, mass=11.354, damping=14.942),
        assembly='open',
        gravity=(0.0, 9.81),
    )
    motor = Motor(6.415, 0.802)
    balance, _, _ = prepared(pump, motor, [6.0])
    seed = next(balance.resting_sliders(7.8, 7.0))
    pieces = with_curves(balance, [], [seed], (7.0, 12.0))
    known = [state.motion for state in steady_states(balance, pieces, motor.torque)]
    assert [(state.turns, state.stable) for state in known] == [(2, False), (1, True)]
    starts = np.array([(2.115, 7.436, 2.47), (1.427, 5.458, -1.61), (2.349, 6.624, -1.694)])
    phases = balance.solver.converted(np.insert(starts, 0, 0.0, axis=1).T)
    search = Search(balance, motor, phases, known)
    search.run(plain, 32)
    assert search.belongs[:3].tolist() == [1, -1, -1]
    cranks = [moved(pump, motor, start, (60.0, 64.0), 0.02, 1e-6) for start in starts.tolist()]
    speeds = [(end[0] - begin[0]) / 4 for begin, end in cranks]
    assert [abs(one / known[1].speed - 1) < 0.01 for one in speeds] == [True, False, False]


# ---------------------------------------------------------------- periods of more than one turn


def test_a_state_of_two_turns_is_found_beside_one_of_one_turn(doubled):
    found = [(state.motion.turns, state.motion.stable) for state in doubled.states]
    assert found == [(1, True), (1, False), (2, True), (1, False)]
    low, _, twice, _ = (state.motion for state in doubled.states)
    assert low.speed == pytest.approx(2.845147, abs=1e-6)
    assert low.stroke == pytest.approx(0.9572, abs=1e-4)
    expected = -0.272 + 0.837j, -0.272 - 0.837j, 0.569
    assert low.multipliers == pytest.approx(expected, abs=1e-3)
    assert sorted(twice.speeds) == pytest.approx([5.6649, 5.8398], abs=1e-4)
    assert abs(twice.multipliers[0]) == pytest.approx(0.907, abs=1e-3)
    # The slider goes forth and back once in the two turns.
    assert twice.flow == pytest.approx(twice.stroke * twice.speed / 2, rel=1e-9)
    assert doubled.unidentified < 0.02
    assert doubled.states[0].share > 0.4 < doubled.states[2].share
    record = json.loads(json.dumps(doubled.record(), allow_nan=False))
    assert [len(state['speeds']) for state in record['states']] == [1, 1, 2, 1]
    assert [state['period'] for state in record['states']] == [1, 1, 2, 1]


def test_the_table_names_the_turns_of_a_state_and_lists_its_changes_by_torque(doubled):
    rows = [line for line in states_table(doubled) if ', torque ' in line]
    slow, fast = '2.845 rad/s, torque', '5.751 rad/s, 2 turns, torque'
    names = [f'{slow} -5%', f'{slow} +5%', f'{fast} -5%', f'{fast} +5%']
    for row, name, number in zip(rows, names, (0, 2, 1, 3), strict=True):
        changes = doubled.sensitivities[number]['changes'].values()
        assert row.split('  ')[0] == name
        assert [float(cell.rstrip('%')) / 100 for cell in row[46:].split()] == pytest.approx(
            list(changes), abs=6e-5
        )


def test_a_state_of_two_turns_comes_back_after_two_where_every_body_moves_by_itself(doubled):
    motion = doubled.states[2].motion
    start = at_crank_angle_0(motion)
    times = np.cumsum([2 * math.pi / speed for speed in motion.speeds])
    half, end = moved_freely(MOTOR, start, times)
    assert end == pytest.approx((4 * math.pi, *start), abs=1e-8)
    assert abs(half[2] - start[1]) > 0.1


def test_brute_force_ends_at_the_listed_states_and_at_no_others(doubled):
    """Motions from four starts, by SciPy's integrator, end beside the stable states."""
    stable = [state.motion for state in doubled.states if state.motion.stable]
    reached, accelerations = set(), Solver(WEAK).driven_by(MOTOR.at)

    def slope(_, y):
        return (y[2], y[3], *accelerations(*y.tolist()))

    for x, w, v in ((1.3, 2.0, 0.5), (1.8, 3.0, -0.5), (1.2, 5.5, 0.0), (1.6, 6.0, -0.4)):
        with np.errstate(all='ignore'):
            course = solve_ivp(slope, (0.0, 110.0), (0.0, x, w, v), rtol=1e-6, atol=1e-8)
        last = doubled.states[0].motion.solver.converted(course.y[:, -20:])
        away = [one.distance(last[:, :, None])[0] for one in stable]
        assert min(away) < 0.3, (x, w, v)
        reached.add(int(np.argmin(away)))
    assert reached == {0, 1}


def test_two_stable_states_last_where_the_period_doubles(doubled):
    (found,) = bistable_ranges(doubled.pieces)
    assert found['low'] == pytest.approx(5.98947, abs=1e-4)
    lost = [(kind, motion.torque) for kind, motion in stability_lost(doubled.pieces)]
    doublings = [torque for kind, torque in lost if kind == PERIOD_DOUBLING]
    assert doublings == pytest.approx([7.1919, 8.9893], abs=1e-3)
    # Before this fold, the slower state stretches the dyad.
    assert (found['high'], found['high_is']) == (pytest.approx(26.5000, abs=1e-4), FOLD)


def test_a_state_that_stretches_the_dyad_returns_where_every_body_moves_by_itself(doubled):
    motions = [one for piece in doubled.pieces for one in piece.motions if one.assembly == BOTH]
    rough = max((one for one in motions if one.turns == 1), key=lambda one: one.tail)
    finer = HarmonicBalance(WEAK, MOTOR.damping, 48)
    motion = finer.find(finer.unknowns(rough))
    motor, start = Motor(motion.torque, MOTOR.damping), at_crank_angle_0(motion)
    (end,) = moved_freely(motor, start, [2 * math.pi / motion.speed])
    assert end == pytest.approx((2 * math.pi, *start), abs=1e-6)
    assert abs(rough.speed / motion.speed - 1) < 10 * rough.tail < 1e-3
    state = doubled.states[0]._replace(motion=rough)
    lines = table_of(doubled, states=[state], sensitivities=[])
    assert f'{rough.name}: stretches the dyad, and so alternates between the assemblies' in lines
    assert (
        f'{rough.name}: its numbers have a relative error of about {10 * rough.tail:.0e}' in lines
    )


@pytest.mark.parametrize(
    ('assembly', 'start', 'speed', 'stroke'),
    [
        ('open', (-0.10, 1.5, 0.06), 1.2189, 0.5509),
        ('crossed', (0.43, 2.53, -0.04), 2.5424, 0.3776),
    ],
)
def test_a_state_is_found_if_the_rod_becomes_perpendicular_to_the_guide(
    assembly, start, speed, stroke
):
    x, w, v = start
    rod = Body(0.85, 4.0, 0.25, (0.42, 0.0))
    pump = replace(slid(position=x, velocity=v), rod=rod, assembly=assembly)
    found = settle(pump, MOTOR, w, plain)
    # By another program, which integrates the angles of all links.
    assert (found.speed, found.stroke) == pytest.approx((speed, stroke), abs=1e-4)
    rods = found.states(np.linspace(0, 2 * math.pi, 360)).position[2]
    assert np.cos(rods).min() < 0 < np.cos(rods).max()
    # A motion through the state returns to it.
    x, w, v = at_crank_angle_0(found)
    (there,) = moved(pump, MOTOR, (x, w, v), [2 * math.pi / found.speed], 1e-3, 1e-10)
    assert there == pytest.approx((2 * math.pi, w), abs=1e-3)


def test_the_states_of_a_pump_do_not_depend_on_the_assembly_at_the_start(doubled):
    other = analysed(replace(WEAK, assembly='open'))
    found, expected = (
        {
            (round(motion.speed, 6), motion.assembly, near and round(near.speed, 6))
            for motion, _, near, _ in one.states
        }
        for one in (other, doubled)
    )
    assert found >= expected


def test_unsettled_starts_give_a_warning_with_their_share(analysis):
    assert (analysis.unidentified, analysis.stopped) == (0, 0)
    assert 'warning' not in ' '.join(states_table(analysis))
    *_, last = table_of(analysis, unidentified=0.25)
    assert last.startswith('warning: 25.0% of 256 starts settle in none of the listed states')


def test_a_motion_whose_crank_nearly_stops_in_each_period_is_named_with_its_turns(analysis):
    pump = replace(
        PUMP,
        crank=Body(0.15834, 20.0, 9.3742, (-0.24, 0.0)),
        rod=Body(1.52515, 4.0, 0.85, (0.8, 0.0)),
        slider=Piston(1.2, mass=6.0, damping=6.0),
    )
    solver = PumpSolver(pump)
    starts = solver.converted(np.array([(0.0, 1.2297, 0.6945, -3.049)]).T)
    found = Motions(solver, Motor(13.54445, 1.360195), starts)
    for _ in range(36):
        found.advance(50)
    (motion,) = alternating_motions([found.speeds(0)], [9.8], 4)
    # By another program, which integrates the angles of all links.
    assert motion['speed'] == pytest.approx(4.7473, rel=0.01)
    assert motion['speeds'] == pytest.approx([3.65, 4.88, 6.39, 4.83], rel=0.02)
    assert motion['share_of_starts'] == 1 / 4
    named = analysis._replace(alternating=[motion])
    assert json.loads(json.dumps(named.record()))['alternating_motions'] == [motion]
    words = r'25.0% of 256 starts alternate between the assemblies at 4.7.*period 4, turns of 3.6'
    assert re.match(words, states_table(named)[-1])


def test_alternating_motions_without_a_period_are_not_named():
    rising, regular = np.geomspace(3.0, 9.0, 20), np.tile([3.0, 5.0], 10)
    courses = [rising, regular, np.zeros(0), np.roll(regular, 1)]
    (motion,) = alternating_motions(courses, [4.0], 4)
    assert (motion['period'], motion['speeds'], motion['share_of_starts']) == (2, [3.0, 5.0], 0.5)
    assert motion['speed'] == pytest.approx(3.75)
    assert alternating_motions(courses, [3.7], 4) == []  # it may be on its way to this state


# ---------------------------------------------------------------- pumps of other kinds


@pytest.mark.parametrize(
    ('damping', 'low', 'high', 'kind'),
    [(20.0, 5.4, 6.6, PERIOD_DOUBLING), (0.0, 1.69, 1.76, TORUS)],
)
def test_other_ways_to_lose_stability_are_told_from_a_fold(damping, low, high, kind):
    _, found = branch(slid(damping=damping), low, high)
    assert found[0].ends_at == found[1].begins_at == kind
    assert abs(found[0].motions[-1].multipliers[0]) == pytest.approx(1, abs=1e-6)


def test_without_resistance_nothing_settles():
    balance, found = branch(slid(damping=0.0), 6.9, 7.1)
    (state,) = steady_states(balance, found, MOTOR.torque)
    # The pump takes no power: the motor turns at its own speed, about which a motion wavers.
    assert state.motion.speed == pytest.approx(7, abs=0.01)
    assert not state.motion.stable


def test_a_motion_gets_the_harmonics_that_it_needs(motions):
    short = HarmonicBalance(PUMP, MOTOR.damping, 2)
    found = short.find(short.unknowns(motions[0]))
    assert len(found.slider) > 9
    assert found.speed == pytest.approx(motions[0].speed, rel=1e-5)


def test_a_pump_does_not_settle_at_a_saddle(motions):
    x, w, v = at_crank_angle_0(motions[1])
    assert settle(slid(position=x, velocity=v), MOTOR, w, plain).stable


def test_a_pump_without_a_state_is_drawn_and_recorded(analysis, tmp_path):
    runs = [run._replace(state=None) for run in analysis.runs]
    none = analysis._replace(states=[], sensitivities=[], runs=runs)
    assert states_table(none) == ['no settled motion found']
    draw_pump(none._replace(pieces=[]), 'no state', tmp_path / 'none.png', DPI)
    record = json.loads(json.dumps(none.record(), allow_nan=False))
    assert (record['states'], record['runs'][0]['settles_at_state']) == ([], None)


@pytest.mark.parametrize(
    ('changes', 'torque', 'error', 'message'),
    [
        ({'position': 3.0}, 8.4, UnreachableError, 'do not close .* within'),
        ({}, -8.4, ConfigurationError, 'motor.torque = -8.4: must be a number from 1e-09'),
        ({'damping': 1e4}, 8.4, ConfigurationError, '251/s: must be at most'),
    ],
)
def test_pump_that_cannot_be_charted_is_refused(changes, torque, error, message):
    with pytest.raises(error, match=message):
        analyse(slid(**changes), Motor(torque, 1.2), speeds=(2.0,), progress=plain)


# ---------------------------------------------------------------- what is written


def test_the_record_has_every_number(analysis, motions):
    record = json.loads(json.dumps(analysis.record(), allow_nan=False))
    assert [state['stable'] for state in record['states']] == [True, False, True]
    assert record['states'][0]['speed'] == motions[0].speed
    assert [run['settles_at_state'] for run in record['runs']] == [0, 2, 0, 2]
    assert record['torques_with_two_stable_states'][0]['low'] == pytest.approx(7.28, abs=0.01)
    assert [one['kind'] for one in record['stability_lost']] == [FOLD, FOLD]
    assert [run['duration'] > 20 for run in record['runs']] == [True] * 4
    assert sum(state['share_of_starts'] for state in record['states']) > 0.9
    averaged = record['averaged_states'][1]
    assert averaged['multipliers'][0] == pytest.approx([1.3035, 0.0], abs=1e-3)
    assert '2.604252' in '\n'.join(states_table(analysis))
    # Entries without an averaged motion keep their place.
    first, *others = analysis.states
    fewer = analysis._replace(states=[first._replace(averaged=None), *others])
    assert fewer.record()['averaged_states'] == [None, *record['averaged_states'][1:]]


def test_a_curve_with_two_points_at_one_place_is_drawn(analysis, tmp_path):
    piece, first = analysis.pieces[0], analysis.pieces[0].motions[0]
    twice = replace(piece, motions=[first, *piece.motions])
    state = analysis.states[0]._replace(piece=twice)
    drawn = analysis._replace(pieces=[twice], states=[state], sensitivities=[], runs=[])
    draw_pump(drawn, 'twice', tmp_path / 'twice.png', DPI / 4)
    assert (tmp_path / 'twice.png').exists()


def test_the_picture_can_be_read_at_half_its_size(analysis, monkeypatch, tmp_path):
    pages, save = [], Figure.savefig
    monkeypatch.setattr(Figure, 'savefig', lambda *page: pages.append(page) or save(*page))
    draw_pump(analysis, 'wind_pump', tmp_path / 'pump.png', DPI)
    ((figure, path),) = pages
    assert path.read_bytes().startswith(b'\x89PNG')
    pixels = 700 / figure.get_figwidth() / 72  # of a point
    texts = [text for text in figure.findobj(Text) if text.get_text() and text.get_visible()]
    assert min(text.get_fontsize() for text in texts) * pixels > 7.9
    plane = figure.axes[0]
    below = plane.get_legend().get_window_extent()
    assert not below.overlaps(plane.xaxis.label.get_window_extent())
    table = figure.texts[-1].get_window_extent()
    assert all(figure.bbox.contains(*corner) for corner in table.corners())
