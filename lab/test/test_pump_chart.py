# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Steady states of the wind pump, compared with other programs, with laws, and for other pumps."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.text import Text
from scipy.integrate import solve_ivp
from scipy.optimize import root

from linkage_lab.charts.pump import draw_pump, states_table
from linkage_lab.output import DPI
from linkage_lab.pump.analysis import STOPPED, STRETCHED, UNSETTLED, analyse, settle
from linkage_lab.pump.averaged import averaged
from linkage_lab.pump.continuation import (
    FOLD,
    PERIOD_DOUBLING,
    bistable_ranges,
    follow,
    stability_lost,
)
from linkage_lab.pump.shooting import Shooting
from linkage_lab.reference.motions import InitialValueProblem, MotionReference
from linkage_ros import (
    Body,
    ConfigurationError,
    LinkLoad,
    LoadCurve,
    MotionError,
    Solver,
    UnreachableError,
)
from linkage_ros.motion.under_torque import Motor
from linkage_ros.settings.configuration import load

PUMP = load('wind_pump').mechanism
MOTOR = Motor(8.4, 1.2)
# Speed, stroke and multipliers of the states, by another program, which shares nothing with the
# package; multipliers to the digits it printed. It printed no stroke of the unstable state.
STATES = (
    (2.604252349376, 0.519128369836, (0.0038 + 0.3505j, 0.0038 - 0.3505j, 0.2851)),
    (3.951611254418, None, (1.28656, 0.0824 + 0.2818j, 0.0824 - 0.2818j)),
    (6.248845170700, 0.137861636990, (0.94983, -0.762, -0.337)),
)
LOW_AT_0 = (1.540999924466, 2.568032724352, 0.573289247289)
# The folds of the curve of steady states, N m, by harmonic balance with 16 harmonics.
FOLDS = 7.280846117255, 12.647779213684
CHANGES = 20.588412, 6.592404669, 7.720668750, 8.864104817  # with a damping of 30 N s/m


def slid(damping=60.0, force=0.0, **changes):
    """Returns the pump with changes of its slider and of the load on it."""
    loads = (LinkLoad('slider', force, damping),)
    return replace(PUMP, slider=replace(PUMP.slider, **changes), loads=loads)


def settled(pump, speed, motor=MOTOR):
    return settle(pump, motor, speed)


def shooting(pump):
    return Shooting(pump, MOTOR, MOTOR.torque / MOTOR.damping)


@pytest.fixture(scope='module')
def analysis():
    return analyse(PUMP, MOTOR, (2.0, 6.0))


@pytest.fixture(scope='module')
def motions(analysis):
    return [state.motion for state in analysis.states]


# ---------------------------------------------------------------- Deliu and Vlase's figure 3


def test_three_states_are_those_of_another_program(motions):
    assert [motion.stable for motion in motions] == [True, False, True]
    for motion, (speed, stroke, (largest, *others)) in zip(motions, STATES, strict=True):
        assert motion.multipliers[0] == pytest.approx(largest, abs=1e-4)
        assert motion.multipliers[1:] == pytest.approx(others, abs=5e-4)
        assert motion.speed == pytest.approx(speed, rel=1e-9)
        assert stroke is None or motion.stroke == pytest.approx(stroke, rel=1e-9)
    assert motions[0].phase[:3] == pytest.approx(LOW_AT_0, rel=1e-9)
    ends = sorted(motions[0].turning_points)
    assert ends == pytest.approx([1.133966760583, 1.653095130419], rel=1e-9)


def test_multipliers_shrink_phase_space_as_resistance_does(motions):
    """Liouville: the volume of phases (q, M q') shrinks by tr(M^-1 D), D the resistances."""
    crank = np.linspace(0, 2 * math.pi, 512, endpoint=False)
    for motion in motions:
        x, w, _ = motion.at(crank)
        (m11, m12), (_, m22) = Solver(PUMP).matrix((crank, x))
        shrink = (MOTOR.damping * m22 + PUMP.loads[0].damping * m11) / (m11 * m22 - m12 * m12)
        expected = math.exp(-2 * math.pi * np.mean(shrink / w))
        assert math.prod(motion.multipliers) == pytest.approx(expected, rel=1e-6)


def next_passage(pump, phase):
    """Integrates to the next passage of crank angle 0, over time and by an implicit method."""
    accelerations = Solver(pump).driven_by(MOTOR.at)

    def slopes(_, values):
        return *values[2:], *accelerations(*values.tolist())

    def passage(_, values):
        return values[0] - 2 * math.pi

    passage.terminal = True
    x, w, v = phase
    course = solve_ivp(
        slopes, (0.0, 10.0), (0.0, x, w, v), 'LSODA', events=passage, rtol=1e-10, atol=1e-12
    )
    return course.y_events[0][0][1:]


def test_multipliers_are_those_of_differences_over_time(motions):
    for motion in motions[1:]:
        start, step = motion.phase[:3], 1e-4
        columns = [
            next_passage(PUMP, start + move) - next_passage(PUMP, start - move)
            for move in step * np.eye(3)
        ]
        values = np.linalg.eigvals(np.array(columns).T / (2 * step))
        expected = sorted(values, key=lambda value: (-abs(value), -value.imag))
        assert motion.multipliers == pytest.approx(expected, abs=1e-5)


def test_two_stable_states_exist_between_two_folds(analysis):
    (found,) = bistable_ranges(analysis.pieces)
    assert (found['low'], found['high']) == pytest.approx(FOLDS, rel=1e-6)
    assert (found['low_is'], found['high_is']) == (FOLD, FOLD)
    for _, motion in stability_lost(analysis.pieces):
        assert motion.multipliers[0] == pytest.approx(1, abs=1e-5)
    low, high = FOLDS
    for torque, stable in (
        (low - 1e-3, [True]), (high - 1e-3, [True, False, True]), (high + 1e-3, [True]),
    ):  # fmt: skip
        states = [state for piece in analysis.pieces for state in piece.states(torque)]
        assert [state.stable for state in sorted(states, key=lambda one: one.speed)] == stable


def leftovers(pump, motor, mean, cosine, sine, speed):
    """Averages what virtual power leaves over, from positions of the centres of mass alone."""
    angles = np.linspace(0, 2 * math.pi, 128, endpoint=False)
    links = pump.crank, pump.coupler, pump.rod
    r, b, c = (link.length for link in links)
    side = 1 if pump.assembly == 'open' else -1

    def bodies(phi, x):
        """Returns positions of the centres and turns of the links, and of the slider."""
        a = r * np.exp(1j * phi)
        reach = abs(x - a)
        along = (b * b - c * c + reach * reach) / (2 * reach)
        joint = a + (along + side * 1j * np.sqrt(b * b - along * along)) * (x - a) / reach
        pins, ends = (0 * a, a, joint), (a, joint, x + 0j)
        ways = [(end - pin) / abs(end - pin) for pin, end in zip(pins, ends, strict=True)]
        centers = [
            pin + way * complex(*link.center)
            for pin, way, link in zip(pins, ways, links, strict=True)
        ]
        return np.array([*centers, x + 0j]), np.unwrap(np.angle(ways), axis=1)

    def over_turn(rows, order):
        """Differentiates periodic rows, apart from whole turns of the crank, over time."""
        waves = 1j * speed * np.fft.fftfreq(len(angles), 1 / len(angles))
        return np.fft.ifft(np.fft.fft(rows) * waves**order)

    x = mean + cosine * np.cos(angles) + sine * np.sin(angles)
    centers, turns = bodies(angles, x)
    turns[0] = 0.0  # its rate is constant
    pushes, twists = over_turn(centers, 2), over_turn(turns, 2).real
    masses = np.array([*(link.mass for link in links), pump.slider.mass])[:, None]
    inertias = np.array([link.inertia for link in links])[:, None]
    forces = masses * (pushes - complex(*pump.gravity))
    forces[3] += pump.loads[0].damping * over_turn(x, 1)
    powers, step = [], 1e-6
    for moves in ((0.0, step), (step, 0.0)):  # of the slider, then of the crank
        (ahead, on), (back, off) = (
            bodies(angles + sign * moves[0], x + sign * moves[1]) for sign in (1, -1)
        )
        power = (forces.conj() * (ahead - back)).real.sum(axis=0)
        powers.append((power + (inertias * twists * (on - off)).sum(axis=0)) / (2 * step))
    slider, crank = powers
    waves = np.ones_like(angles), np.cos(angles), np.sin(angles)
    left = crank - (motor.torque - motor.damping * speed)
    return [*(np.mean(wave * slider) for wave in waves), np.mean(left)]


def test_averaged_states_are_those_of_positions_alone(analysis, motions):
    found = [state.averaged for state in analysis.states]
    assert [one.speed for one in found] == pytest.approx([2.6046, 3.8871, 6.3015], abs=5e-5)
    for one, motion in zip(found, motions, strict=True):
        guess = np.array(one) * (0.99, 1.02, 0.98, 1.01)
        expected = root(lambda values: leftovers(PUMP, MOTOR, *values), guess, tol=1e-12).x
        assert tuple(one) == pytest.approx(tuple(expected), rel=1e-7, abs=1e-9)
        assert one.stroke == pytest.approx(motion.stroke, rel=0.04)


# ---------------------------------------------------------------- from where


def test_runs_end_at_the_states(analysis):
    assert {run.name: run.state for run in analysis.runs} == {
        '2 rad/s': 0,
        '6 rad/s': 2,
        'beside 3.952 rad/s, slower': 0,
        'beside 3.952 rad/s, faster': 2,
    }
    ends = [np.mean(run.speeds[-100:]) for run in analysis.runs]
    assert ends == pytest.approx([STATES[run.state][0] for run in analysis.runs], rel=0.04)


def test_each_start_ends_in_a_listed_state_or_is_counted(analysis):
    assert analysis.lost == {}
    assert '0.0% of 24 starts settle in no listed state' in states_table(analysis)
    shares = [state.share for state in analysis.states]
    assert shares[1] == 0
    assert sum(shares) == pytest.approx(1)
    lost = analysis._replace(lost={STRETCHED: 0.25, UNSETTLED: 0.125})
    assert '37.5% of 24 starts settle in no listed state' in states_table(lost)
    starts = lost.record()['starts']
    assert starts == {'count': 24, 'stopped': 0, 'stretched': 0.25, 'unidentified': 0.125}


@pytest.mark.parametrize(
    ('changes', 'motor', 'reason'),
    [
        ({'position': 1.5, 'velocity': 6.0}, MOTOR, STRETCHED),
        ({}, Motor(0.3, 1.2), STOPPED),
        ({'damping': 0.0}, Motor(0.01, 0.0), UNSETTLED),
    ],
)
def test_a_pump_that_does_not_settle_says_why(changes, motor, reason):
    with pytest.raises(ConfigurationError, match=f'does not settle within .* it {reason}'):
        settled(slid(**changes), 2.0, motor)


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
    found = settled(replace(slid(position=x, velocity=v), rod=rod, assembly=assembly), w)
    # By another program, which integrates the angles of all links.
    assert (found.speed, found.stroke) == pytest.approx((speed, stroke), abs=1e-4)
    rods = found.states(np.linspace(0, 2 * math.pi, 360)).position[2]
    assert np.cos(rods).min() < 0 < np.cos(rods).max()


# ---------------------------------------------------------------- periods of more than one turn


@pytest.mark.parametrize(
    ('damping', 'low', 'turns', 'tolerance'),
    [(15.0, 2.845147, [5.664884, 5.839811], 5e-7), (30.0, 2.7087403, [5.9643, 6.0586], 5e-5)],
)
def test_weak_damping_has_a_state_of_two_turns_beside_one_of_one_turn(
    damping, low, turns, tolerance
):
    pump = slid(damping=damping)
    slow, fast = (settled(pump, speed) for speed in (2.0, 6.0))
    assert (slow.turns, fast.turns) == (1, 2)
    assert slow.stable
    assert fast.stable
    assert slow.speed == pytest.approx(low, abs=5e-7)
    assert sorted(fast.speeds) == pytest.approx(turns, abs=tolerance)
    assert averaged(fast) is None


def test_a_state_of_two_turns_comes_back_after_two_where_every_body_moves_by_itself():
    """The bodies move independently, in 34 digits."""
    pump = slid(damping=15.0)
    motion = settled(pump, 6.0)
    start = 0.0, *motion.phase[:3]
    # The slider goes forth and back once in the two turns.
    assert motion.flow == pytest.approx(motion.stroke * motion.speed / 2, rel=1e-9)
    followed = MotionReference(InitialValueProblem(pump, start, MOTOR))
    half, end = (np.array(followed.at(time), float) for time in motion.times)
    assert end == pytest.approx((4 * math.pi, *start[1:]), abs=1e-7)
    assert abs(half[2] - start[2]) > 0.1


def test_a_curve_passes_from_a_fold_to_a_period_doubling():
    seed = shooting(slid(damping=30.0)).find(np.array((1.355, 6.55, 0.41, 8.4)))
    lost = [(kind, motion.torque) for kind, motion in stability_lost(follow(seed))]
    assert [kind for kind, _ in lost] == [FOLD, FOLD, PERIOD_DOUBLING, PERIOD_DOUBLING]
    # By harmonic balance with 16 harmonics.
    assert [torque for _, torque in lost] == pytest.approx(CHANGES, rel=1e-6)


# ---------------------------------------------------------------- loads that jump


def test_a_load_that_jumps_where_the_slider_turns_keeps_its_digits():
    """Compared with a motion that is integrated from one jump to the next."""
    at, forth, back = (1.0, 2.0), (-60.0, -60.0), (0.0, 0.0)
    jumping = LoadCurve('slider', 'position', at=at, value=forth, return_value=back)
    pump = replace(PUMP, loads=(LinkLoad('slider', damping=20.0), jumping))
    rough = shooting(pump).find(np.array((1.319, 5.529, 0.396, 8.4)), tolerance=1e-6)
    found = shooting(pump).find(rough.phase)
    # The same pump with the force of one direction alone, until its slider turns.
    ways = {
        sign: Solver(slid(damping=20.0, force=value)).driven_by(MOTOR.at)
        for sign, value in ((1, -60.0), (-1, 0.0))
    }
    values, sign, time = np.array((0.0, *found.phase[:3])), 1, 0.0

    def turn(_, values):
        return values[3]

    def whole(_, values):
        return values[0] - 2 * math.pi

    turn.terminal = whole.terminal = True
    while values[0] < 2 * math.pi * (1 - 1e-12):
        turn.direction = -sign
        with np.errstate(under='ignore'):
            course = solve_ivp(
                lambda _, y, way=ways[sign]: (*y[2:], *way(*y.tolist())), (0.0, 9.0), values,
                'DOP853', events=(turn, whole), rtol=1e-12, atol=1e-13,
            )  # fmt: skip
        values, sign, time = course.y[:, -1], -sign, time + course.t[-1]
    assert values[1:] == pytest.approx(found.phase[:3], abs=1e-7)
    assert found.speed == pytest.approx(2 * math.pi / time, rel=1e-8)
    assert f'{found.speed:.6f}' == '5.587805'
    # By finer integration, with which it no longer changes.
    assert found.multipliers[0] == pytest.approx(0.9511005, abs=5e-5)


# ---------------------------------------------------------------- what is written


@pytest.mark.parametrize(
    ('changes', 'torque', 'error', 'message'),
    [
        ({'position': 3.0}, 8.4, UnreachableError, 'do not close .* within'),
        ({}, -8.4, ConfigurationError, 'motor.torque = -8.4: must be above 0 N m'),
    ],
)
def test_pump_that_cannot_be_charted_is_refused(changes, torque, error, message):
    with pytest.raises(error, match=message):
        analyse(slid(**changes), Motor(torque, 1.2), (2.0,))


def test_a_turn_that_the_crank_cannot_complete_is_refused():
    with pytest.raises(MotionError, match='the crank stops'):
        shooting(PUMP).shoot(np.array([(1.5, 0.1, 0.0, 0.1)]).T)


def test_the_record_has_every_number(analysis, motions):
    record = json.loads(json.dumps(analysis.record(), allow_nan=False))
    assert [state['stable'] for state in record['states']] == [True, False, True]
    assert record['states'][0]['speed'] == motions[0].speed
    assert [run['settles_at_state'] for run in record['runs']] == [0, 2, 0, 2]
    assert [one['kind'] for one in record['stability_lost']] == [FOLD, FOLD]
    first = record['averaged_states'][0]
    assert first['load'] == pytest.approx(8.4 - 1.2 * first['speed'], rel=1e-12)
    assert '2.604252' in '\n'.join(states_table(analysis))
    # Entries without an averaged motion keep their place.
    state, *others = analysis.states
    fewer = analysis._replace(states=[state._replace(averaged=None), *others])
    assert fewer.record()['averaged_states'] == [None, *record['averaged_states'][1:]]


def test_a_pump_without_a_state_is_drawn_and_recorded(analysis, tmp_path):
    runs = [run._replace(state=None) for run in analysis.runs]
    none = analysis._replace(states=[], pieces=[], runs=runs, lost={UNSETTLED: 1.0})
    draw_pump(none, 'no state', [tmp_path / 'none.png'], DPI / 4)
    record = json.loads(json.dumps(none.record(), allow_nan=False))
    assert (record['states'], record['runs'][0]['settles_at_state']) == ([], None)


def test_the_picture_can_be_read_at_half_its_size(analysis, undrawn, tmp_path):
    draw_pump(analysis, 'wind_pump', [tmp_path / 'pump.png'], DPI)
    (figure,) = undrawn
    figure.draw_without_rendering()
    pixels = 700 / figure.get_figwidth() / 72  # of a point
    texts = [text for text in figure.findobj(Text) if text.get_text() and text.get_visible()]
    assert min(text.get_fontsize() for text in texts) * pixels > 7.9
    table = figure._supxlabel.get_window_extent()
    assert all(figure.bbox.contains(*corner) for corner in table.corners())
    for axes in figure.axes:
        parts = [axes.xaxis.label, *filter(None, [axes.get_legend()])]
        boxes = [part.get_window_extent() for part in parts]
        assert not any(box.overlaps(table) for box in boxes)
        assert len(boxes) == 1 or not boxes[0].overlaps(boxes[1])
