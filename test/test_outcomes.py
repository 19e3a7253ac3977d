# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The rule by which outcomes are told, on planted failures, and the situations they come of."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from linkage_ros import ConfigurationError, MotionError, Solver, UnreachableError
from linkage_ros.lab.methods.chain import BATCH, ONE, POSITION, RATES, Chain
from linkage_ros.lab.methods.functions import SCALAR
from linkage_ros.lab.methods.integrators import Follower
from linkage_ros.lab.methods.linkages import other_assembly
from linkage_ros.lab.methods.motion_outcomes import measure_motion_outcomes
from linkage_ros.lab.methods.motion_situations import LOOP, MOTION_SITUATIONS, MotionCase
from linkage_ros.lab.methods.outcomes import (
    DIVERGED,
    NAN,
    REFUSED,
    RIGHT,
    WRONG_BRANCH,
    measure_outcomes,
)
from linkage_ros.lab.methods.positions import factored
from linkage_ros.lab.methods.registry import (
    INTEGRATORS,
    MOTION,
    Integrator,
    Method,
)
from linkage_ros.lab.methods.situations import SITUATIONS
from linkage_ros.lab.reference.problems import ChartMechanisms
from linkage_ros.lab.reference.states import Reference
from linkage_ros.parameters.configuration import load

BY_NAME = {situation.name: situation for situation in SITUATIONS}
PUMP = load('wind_pump')
MECHANISMS = ChartMechanisms(load('quadrilateral').mechanism, PUMP.mechanism, PUMP.drive.motor)
MOTIONS = {situation.name: situation for situation in MOTION_SITUATIONS}
# Where the situations' own motions would take a while.
QUICK = {
    '_stretched': MotionCase(
        MECHANISMS.driven(2.0, 5.0), (0.1, 0.2, 0.3, 0.398, 0.4005, 0.42), 0.3994655636001
    ),
    '_long': MotionCase(MECHANISMS.freed(6.0), (0.5, 1.0, 1.5)),
}


def plain(items, _):
    return items


def planted(locate, stage=POSITION, modes=(ONE,)):
    """A method of that position, made for numbers; arrays of one are taken for a number."""

    def make(task, *_):
        right = factored(task.mechanism, SCALAR)

        def position(crank):
            if np.ndim(crank):
                return np.array([locate(task, right, x) for x in crank.tolist()]).T
            return locate(task, right, crank)

        def nothing(_):
            raise NotImplementedError

        return Chain(position, position, position, nothing)

    return Method('planted', stage, '', '', make, modes=modes)


def outcome(locate, situation='ordinary', **options):
    (cell,) = measure_outcomes(
        [BY_NAME[situation]], cases=2, progress=plain, methods=(planted(locate, **options),)
    )
    return cell.outcome, cell.worst_error


def other_side(task, _, crank):
    state = Solver(other_assembly(task.mechanism)).state(crank)
    return state.position[1:]


def failing_once(value):
    """Right but at one of the angles."""

    def locate(_, right, crank):
        coupler, output = right(crank)
        return (value(coupler) if 3.0 < crank < 3.2 else coupler), output

    return locate


def raised(error):
    def value(_):
        raise error

    return value


def test_what_is_right_is_called_so():
    found, error = outcome(lambda _, right, crank: right(crank))
    assert (found, error < 1e-15) == (RIGHT, True)
    found, error = outcome(failing_once(lambda x: x + 1e-9))
    assert (found, error) == (RIGHT, pytest.approx(1e-9, rel=1e-3))


@pytest.mark.parametrize(
    ('value', 'expected'),
    [
        (lambda x: x + 1e-5, DIVERGED),
        (lambda x: 1e300 + x, DIVERGED),
        (lambda _: math.nan, NAN),
        (lambda _: -math.inf, NAN),
        (raised(ZeroDivisionError()), NAN),
        (raised(ValueError('math domain error')), NAN),
        (raised(OverflowError()), NAN),
        (raised(np.linalg.LinAlgError()), NAN),
        (raised(ConfigurationError('no such state')), REFUSED),
    ],
)
def test_one_planted_failure_decides(value, expected):
    assert outcome(failing_once(value))[0] == expected


def test_the_other_assembly_is_a_wrong_branch():
    found, error = outcome(other_side)
    assert found == WRONG_BRANCH
    assert error > 0.01


def test_the_other_assembly_missed_is_no_branch():
    def locate(task, right, crank):
        coupler, output = other_side(task, right, crank)
        return coupler + 1e-4, output

    assert outcome(locate)[0] == DIVERGED


def test_a_wrong_rate_is_no_branch():
    assert outcome(other_side, stage=RATES)[0] == DIVERGED


def test_where_no_state_exists_only_a_refusal_is_right():
    assert outcome(lambda _, right, crank: right(crank), 'no assembly')[0] == REFUSED
    assert outcome(lambda *_: (0.1, 0.2), 'no assembly')[0] == DIVERGED
    assert outcome(lambda *_: (math.nan, 0.2), 'no assembly')[0] == NAN


def test_a_refusal_at_one_angle_hides_nothing_at_the_others():
    def locate(_, right, crank):
        if 3.0 < crank < 3.2:
            raise ConfigurationError('no such state')
        coupler, output = right(crank)
        return coupler + 1.0, output

    assert outcome(locate)[0] == DIVERGED
    # An array is refused as a whole; then each of its angles is asked by itself.
    assert outcome(locate, modes=(BATCH,))[0] == DIVERGED


def test_where_no_state_exists_every_angle_has_to_be_refused():
    refused = []

    def locate(task, right, crank):
        if task not in refused:  # at the first angle of each case
            refused.append(task)
            right(crank)
        return 0.1, 0.2

    assert outcome(locate, 'no assembly')[0] == DIVERGED


def test_a_programming_error_is_no_outcome():
    with pytest.raises(KeyError):
        outcome(failing_once(raised(KeyError('typo'))))


# ---------------------------------------------------------------- situations


@pytest.mark.parametrize('situation', SITUATIONS, ids=lambda situation: situation.name)
def test_situations_are_the_same_every_time_and_as_many_as_asked(situation):
    cases = situation.cases(5)
    assert len(cases) >= 5
    assert cases == situation.cases(5)
    assert situation.words
    assert len({case.task.mechanism for case in cases}) > 1 or 'links' in situation.name


def test_beyond_its_reach_a_crank_has_no_state():
    for case in BY_NAME['no assembly'].cases(3):
        reference = Reference(case.task.mechanism, 1.0, 0.0)
        for crank in case.cranks:
            with pytest.raises(UnreachableError, match='does not close'):
                reference.state(crank)


# ---------------------------------------------------------------- motions: the rule


class Planted(Follower):
    """The default but for what is planted from a time on."""

    def __init__(self, problem, since, fault):
        super().__init__(problem)
        self.right = INTEGRATORS[1].make(problem, {})
        self.since, self.fault = since, fault

    def _advance(self, time):
        if time < self.since:
            return self.right.at(time)
        return self.fault(self.right, time)


def motion_outcome(fault, situation='change point under a torque', since=1.0):
    method = Integrator(
        'planted', MOTION, '', '', lambda problem, _: Planted(problem, since, fault)
    )
    chosen = MOTIONS[situation]
    if case := QUICK.get(chosen.generate.__name__):
        chosen = replace(chosen, generate=lambda *_: iter([case]))
    (cell,) = measure_motion_outcomes(
        MECHANISMS, cases=1, progress=plain, situations=(chosen,), methods=[method]
    )
    return cell.outcome, cell.worst_error


def moved(by):
    def fault(right, time):
        angle, *rest = right.at(time)
        return angle + by, *rest

    return fault


def failing(error):
    def fault(*_):
        raise error

    return fault


def told(time):
    return MotionError('the motion ends', time=time, coordinates=(0.0,))


@pytest.mark.parametrize(
    ('fault', 'expected', 'error'),
    [
        (moved(1e-9), RIGHT, 1e-9),
        (moved(1e-5), DIVERGED, 1e-5),
        (moved(2 * math.pi), DIVERGED, 2 * math.pi),
        (moved(math.nan), NAN, None),
        (moved(math.inf), NAN, None),
        (failing(ZeroDivisionError()), NAN, None),
        (failing(np.linalg.LinAlgError()), NAN, None),
        (failing(ConfigurationError('no')), REFUSED, None),
        # Nothing ends there, so that no time can be told well.
        (failing(told(1.0)), REFUSED, None),
    ],
)
def test_one_planted_fault_decides_what_comes_of_a_motion(fault, expected, error):
    outcome, worst = motion_outcome(fault)
    assert outcome == expected
    assert worst == (None if error is None else pytest.approx(error, rel=1e-2))


def test_a_wrong_value_counts_more_than_a_refusal_after_it():
    def fault(right, time):
        if time > 2.0:
            raise ConfigurationError('no')
        return moved(1e-3)(right, time)

    assert motion_outcome(fault) == (DIVERGED, pytest.approx(1e-3, rel=1e-2))


def test_a_motion_that_ends_is_told_from_one_that_is_refused_too_early():
    early = failing(told(0.1))
    assert motion_outcome(early, 'before a stretched dyad', 0.3)[0] == REFUSED
    outcome, error = motion_outcome(early, 'stretched dyad', 0.3)
    assert (outcome, error) == (REFUSED, pytest.approx(0.2994655636001))
    timely = failing(told(0.3994))
    assert motion_outcome(timely, 'before a stretched dyad', 0.399)[0] == RIGHT
    assert motion_outcome(timely, 'stretched dyad', 0.399)[1] == pytest.approx(6.55636001e-5)
    timeless = failing(ConfigurationError('it ends somewhere'))
    assert motion_outcome(timeless, 'stretched dyad', 0.399) == (REFUSED, None)


def test_beyond_the_end_only_the_true_motion_counts():
    def stays(right, _):
        return right.phase

    assert motion_outcome(stays, 'stretched dyad', 0.399)[0] == DIVERGED


def test_energy_and_loop_are_judged_by_themselves():
    def faster(right, time):
        angle, place, speed, velocity = right.at(time)
        return angle, place, speed * (1 + 1e-5), velocity

    outcome, error = motion_outcome(faster, 'long free run')
    assert (outcome, error) == (DIVERGED, pytest.approx(2e-5, rel=0.5))
    assert motion_outcome(faster, 'loop after a long run')[0] == RIGHT


def test_a_programming_error_in_an_integrator_is_no_outcome():
    with pytest.raises(KeyError):
        motion_outcome(failing(KeyError('typo')))


@pytest.mark.parametrize(
    'situation',
    [s for s in MOTION_SITUATIONS if s.exists and s.judged != LOOP],
    ids=lambda s: s.name,
)
def test_motions_are_the_same_every_time(situation):
    case, again = (
        next(situation.generate(MECHANISMS, np.random.default_rng(7), 1)) for _ in range(2)
    )
    assert case.problem == again.problem
    assert list(case.times) == list(again.times) == sorted(case.times)
    assert situation.words
    assert (case.end is not None) == (situation.generate.__name__ == '_stretched')
