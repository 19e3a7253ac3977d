# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The classification of outcomes, tested with injected failures, and linkage_chart stability."""

import math
from dataclasses import replace

import numpy as np
import pytest
from test_methods import run_quick

from linkage_lab.charts import stability as stability_chart
from linkage_lab.methods import stages
from linkage_lab.methods.dyads import DYAD, DYAD_METHODS, DYAD_SITUATIONS
from linkage_lab.methods.loads import (
    CURVE_METHODS,
    CURVE_SITUATIONS,
    FRICTION_METHODS,
    FRICTION_SITUATIONS,
    GROWN,
    STRAIGHT,
)
from linkage_lab.methods.measure import (
    BATCH,
    DIVERGED,
    NAN,
    ONE,
    REFUSED,
    RIGHT,
    WRONG_BRANCH,
    Method,
    measure_outcomes,
)
from linkage_lab.methods.motion_cases import MOTION_SITUATIONS, MotionCase
from linkage_lab.methods.registry import DEFAULT, INTEGRATORS, LIVE, METHODS, RECORDS
from linkage_lab.methods.situations import SITUATIONS
from linkage_lab.methods.stages import POSITION, RATES
from linkage_lab.reference.motions import free_pump
from linkage_lab.reference.states import other_assembly
from linkage_ros import ConfigurationError, MotionError, Solver, UnreachableError

BY_NAME = {situation.name: situation for situation in (*SITUATIONS, *MOTION_SITUATIONS)}


def measured(method, situation):
    (cell,) = measure_outcomes([situation], [method], cases=2)
    return cell['outcome'], cell['worst_error']


def outcome(locate, situation='ordinary', stage=POSITION, modes=(ONE,)):
    """Returns the outcome of a method, given its function of case and crank angle."""

    def tool(case, _):
        def at(crank):
            found = [locate(case, x) for x in np.atleast_1d(crank).tolist()]
            return tuple(np.array(found).T) if np.ndim(crank) else found[0]

        return at

    def solve(links, crank, *_):
        pair = stages.looked_up(links, crank)
        return pair if stage == POSITION else (pair,) * 3

    return measured(
        Method('planted', stage, '', '', solve, modes=modes, tool=tool), BY_NAME[situation]
    )


def right(case, crank):
    return Solver(case.mechanism).state(crank).position[1:]


def other_side(case, crank):
    return Solver(other_assembly(case.mechanism)).state(crank).position[1:]


def failing_once(value):
    """Makes a method that is right except at one angle."""

    def locate(case, crank):
        coupler, output = right(case, crank)
        return (value(coupler) if 3.0 < crank < 3.2 else coupler), output

    return locate


def raised(error):
    def value(*_):
        raise error

    return value


@pytest.mark.parametrize(
    ('value', 'expected', 'error'),
    [
        (lambda x: x + 1e-9, RIGHT, 1e-9),
        (lambda x: x + 1e-5, DIVERGED, 1e-5),
        (lambda x: 1e300 + x, DIVERGED, None),
        (lambda _: math.nan, NAN, None),
        (lambda _: -math.inf, NAN, None),
        (raised(ZeroDivisionError()), NAN, None),
        (raised(ValueError('math domain error')), NAN, None),
        (raised(np.linalg.LinAlgError()), NAN, None),
        (raised(ConfigurationError('no such state')), REFUSED, None),
    ],
)
def test_one_injected_failure_decides(value, expected, error):
    found, worst = outcome(failing_once(value))
    assert found == expected
    assert error is None or worst == pytest.approx(error, rel=1e-3)


def test_only_the_position_of_the_other_assembly_is_a_wrong_branch():
    found, error = outcome(other_side)
    assert found == WRONG_BRANCH
    assert error > 0.01
    assert outcome(lambda *given: np.add(other_side(*given), (1e-4, 0)))[0] == DIVERGED
    assert outcome(other_side, stage=RATES)[0] == DIVERGED


def refuses_first(locate):
    """Makes a method that refuses the first angle of each case and solves the others."""
    refused = []

    def first_refused(case, crank):
        if case not in refused:
            refused.append(case)
            raise ConfigurationError('no such state')
        return locate(case, crank)

    return first_refused


def test_where_no_state_exists_only_a_refusal_of_every_angle_is_right():
    assert outcome(right, 'no assembly') == (REFUSED, None)
    assert outcome(lambda *_: (0.1, 0.2), 'no assembly') == (DIVERGED, None)
    assert outcome(lambda *_: (math.nan, 0.2), 'no assembly')[0] == NAN
    assert outcome(refuses_first(lambda *_: (0.1, 0.2)), 'no assembly')[0] == DIVERGED


# An array is refused as a whole; then each of its angles is solved alone.
@pytest.mark.parametrize('mode', [ONE, BATCH])
def test_a_refusal_at_one_angle_hides_nothing_at_the_others(mode):
    wrong = refuses_first(lambda *given: np.add(right(*given), (1.0, 0)))
    assert outcome(wrong, modes=(mode,))[0] == DIVERGED


# ---------------------------------------------------------------- situations


@pytest.mark.parametrize('name', BY_NAME)
def test_situations_are_the_same_every_time_and_motions_are_few(name):
    kinds = ('problem', 'times') if BY_NAME[name] in MOTION_SITUATIONS else ('mechanism', 'guess')
    first, again = (
        [[getattr(case, kind) for kind in kinds] for case in BY_NAME[name].cases(10)]
        for _ in range(2)
    )
    assert first == again
    assert 1 <= len(first) <= 4 if kinds[0] == 'problem' else len(first) == 10


def test_beyond_its_reach_a_crank_has_no_state():
    for case in BY_NAME['no assembly'].cases(2):
        for crank in case.cranks.tolist():
            with pytest.raises(UnreachableError, match='does not close'):
                case.reference.state(crank)


# ---------------------------------------------------------------- outcomes of motions


class Planted:
    """The default integrator with an error injected from 1 s on."""

    def __init__(self, problem, fault):
        self.right, self.fault = INTEGRATORS[1].solve(problem, {}), fault

    def at(self, time):
        return self.right.at(time) if time < 1.0 else self.fault(self.right, time)


def motion_outcome(fault, *quantity):
    situation = BY_NAME['change point under a torque']
    if quantity:
        case = MotionCase(free_pump(6.0), (0.5, 1.0, 1.5), quantity)
        situation = replace(situation, make=lambda *_: case)
    return measured(
        Method('planted', 'motion', '', '', lambda problem, _: Planted(problem, fault)), situation
    )


def moved(by):
    def fault(right, time):
        angle, *rest = right.at(time)
        return angle + by, *rest

    return fault


@pytest.mark.parametrize(
    ('fault', 'expected', 'error'),
    [
        (moved(1e-9), RIGHT, 1e-9),
        (moved(2 * math.pi), DIVERGED, 2 * math.pi),
        (moved(math.nan), NAN, 0),
        (raised(ZeroDivisionError()), NAN, 0),
        (raised(MotionError('the motion ends', time=1.0, coordinates=(0.0,))), REFUSED, 0),
    ],
)
def test_one_injected_fault_decides_the_outcome_of_a_motion(fault, expected, error):
    found, worst = motion_outcome(fault)
    assert found == expected
    assert worst == pytest.approx(error, rel=1e-2, abs=1e-11)


@pytest.mark.parametrize('error', [ConfigurationError('no'), ZeroDivisionError()])
def test_a_wrong_value_counts_more_than_a_failure_after_it(error):
    def fault(right, time):
        if time > 2.0:
            raise error
        return moved(1e-3)(right, time)

    assert motion_outcome(fault) == (DIVERGED, pytest.approx(1e-3, rel=1e-2))


def test_energy_and_loop_are_judged_by_themselves():
    def faster(right, time):
        angle, place, speed, velocity = right.at(time)
        return angle, place, speed * (1 + 1e-5), velocity

    found, error = motion_outcome(faster, 'energy')
    assert (found, error) == (DIVERGED, pytest.approx(2e-5, rel=0.5))
    assert motion_outcome(faster, 'loop')[0] == RIGHT


@pytest.mark.parametrize('judged', [outcome, motion_outcome])
def test_programming_errors_are_raised(judged):
    with pytest.raises(KeyError):
        judged(raised(KeyError('typo')))


DEFAULTS = DEFAULT, DYAD, STRAIGHT, GROWN, LIVE, RECORDS
GRIDS = stability_chart.GRIDS
FAILS = 'any outcome but right'  # rounding decides which, so it differs between processors
NAMED = {
    ('factored, float32', 'near a change point'): DIVERGED,
    ('half-angle', 'half-angle denominator'): NAN,
    ('two circles', 'ordinary'): RIGHT,
    ('two circles', 'change point passed'): WRONG_BRANCH,
    ('Newton-Raphson', 'wrong first guess'): WRONG_BRANCH,
    ('Newton-Raphson', 'few steps'): WRONG_BRANCH,
    ('Newton-Raphson', 'no assembly'): DIVERGED,
    ("Ghalbi's listing", 'few steps'): NAN,
    ('table, cubic Hermite', 'near a change point'): DIVERGED,
    ('table, cubic Hermite', 'dead centre'): REFUSED,
    ('2x2 solve', 'change point hit'): NAN,
    ('central differences', 'near a change point'): DIVERGED,
    ('Newton, two links', 'dyad near its toggle'): DIVERGED,
    ('differences of dyads', 'dyad near its toggle'): FAILS,
    ('differences of dyads', 'dyad'): RIGHT,
    ('cubic spline', 'corner of a load curve'): DIVERGED,
    ('even nodes', 'corner of a load curve'): DIVERGED,
    ('Newton, at once', 'friction that relieves'): DIVERGED,
    ('fixed point', 'nearly self-locking'): DIVERGED,
    ('DOP853', 'stretched dyad'): NAN,
    ('RK4', 'stretched dyad'): DIVERGED,
    ('RK4', 'steep motor line'): DIVERGED,
    ('Radau', 'stiff guide'): RIGHT,
    ('Radau', 'stretched dyad'): FAILS,
    ('multipliers, unstabilised', 'change point under a torque'): DIVERGED,
    ('multipliers, unstabilised', 'loop after a long run'): DIVERGED,
    ('multipliers, unstabilised', 'stretched dyad'): RIGHT,
    # A loop that is held closed stays closed, but other errors remain.
    ('multipliers, Baumgarte', 'loop after a long run'): RIGHT,
    ('multipliers, Baumgarte', 'change point under a torque'): DIVERGED,
    ('multipliers, projected', 'steep motor line'): NAN,
}


@pytest.mark.parametrize(
    ('situation', 'methods'),
    [(situation, methods) for methods, situations in GRIDS for situation in situations],
    ids=lambda value: getattr(value, 'name', ''),
)
def test_defaults_are_right_or_refuse_and_others_fail_where_they_are_named(situation, methods):
    chosen = [m for m in methods if m.name in DEFAULTS or (m.name, situation.name) in NAMED]
    for cell in measure_outcomes([situation], chosen, cases=2):
        if cell['method'] not in DEFAULTS:
            named, found = NAMED[cell['method'], cell['situation']], cell['outcome']
            assert found != RIGHT if named == FAILS else found == named, cell
            continue
        assert cell['outcome'] == (RIGHT if situation.exists else REFUSED), cell
        largest = {DEFAULT: 1e-8, STRAIGHT: 1e-9, GROWN: 1e-10}.get(
            cell['method'], 1e-7 if situation.exists else 1e-3
        )
        assert cell['worst_error'] is None or cell['worst_error'] < largest, cell
        assert cell['worst_error'] is not None or not situation.exists


def test_every_method_but_the_defaults_has_a_cell_where_it_fails():
    failing = {method for (method, _), outcome in NAMED.items() if outcome != RIGHT}
    assert failing == {m.name for methods, _ in GRIDS for m in methods} - {*DEFAULTS}
    assert {place for _, place in NAMED} <= {s.name for _, places in GRIDS for s in places}


def test_command_writes_a_picture_and_the_cells(tmp_path, monkeypatch):
    chosen = (
        SITUATIONS[5:6], DYAD_SITUATIONS[:1], CURVE_SITUATIONS[:1], FRICTION_SITUATIONS[1:2],
        MOTION_SITUATIONS[1:2],
    )  # fmt: skip
    grids = tuple((methods, few) for (methods, _), few in zip(GRIDS, chosen, strict=True))
    monkeypatch.setattr(stability_chart, 'GRIDS', grids)
    written, records = run_quick('stability', tmp_path)
    assert written == ['stability.json', 'stability.png']
    assert set(records[0]) == {'method', 'situation', 'outcome', 'worst_error'}
    all_methods = *METHODS, *DYAD_METHODS, *CURVE_METHODS, *FRICTION_METHODS, *INTEGRATORS
    assert len(records) == len(all_methods)
    assert all(r['worst_error'] is None or r['worst_error'] >= 0 for r in records)
    assert {r['outcome'] for r in records} == {RIGHT, REFUSED, DIVERGED, NAN}
