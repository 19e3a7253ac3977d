# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The registry of methods: its reference, and each method's order, floor and failures."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from mpmath import mp
from oracle import Oracle

from linkage_ros import Solver, UnreachableError
from linkage_ros.lab.methods import linkages, registry
from linkage_ros.lab.methods.accuracy import (
    Measurement,
    mark_fronts,
    tasks,
)
from linkage_ros.lab.methods.bench import Bench
from linkage_ros.lab.methods.chain import (
    BATCH,
    FUNCTIONS,
    ONE,
    QUANTITIES,
    Task,
    make_task,
)
from linkage_ros.lab.methods.iteration import CAP, NewtonRaphson
from linkage_ros.lab.methods.loop import Loop
from linkage_ros.lab.methods.situations import SITUATIONS
from linkage_ros.lab.reference import states
from linkage_ros.lab.reference.states import Reference
from linkage_ros.parameters.configuration import load

EPSILON = 2.0**-52
BY_NAME = {method.name: method for method in registry.METHODS}
PRESETS = {name: load(name).mechanism for name in ('quadrilateral', 'slider_crank')}


@pytest.fixture(scope='module')
def benches():
    found = tasks(*PRESETS.values())
    return {name: Bench(found[name], 60) for name in PRESETS}


# ---------------------------------------------------------------- the reference


def reference_of(task, lengths=None):
    return Reference(task.mechanism, task.speed, task.acceleration, lengths)


def assert_same(task, crank, lengths=None):
    mine = reference_of(task, lengths).state(crank)
    other = Oracle(task.mechanism, lengths).state(crank, task.speed, task.acceleration)
    with mp.workdps(60):
        for name, theirs in (
            ('position', other.position[1:]), ('rate', other.velocity[1:]),
            ('acceleration', other.acceleration[1:]), ('torque', (other.torque,)),
        ):  # fmt: skip
            for x, y in zip(getattr(mine, name), theirs, strict=True):
                size = max(abs(y), mp.mpf('1e-3'))
                apart = abs(x - y)
                if name == 'position':  # an angle, or a length below a metre
                    apart = min(apart, abs(apart - 2 * mp.pi))
                assert apart < size * mp.mpf('1e-45'), (name, crank, x, y)


@pytest.mark.parametrize('seed', range(4))
def test_the_reference_agrees_with_an_oracle_of_another_hand(seed):
    random = np.random.default_rng(seed)
    mechanism = linkages.turning(random)
    task = Task(mechanism, (0.0, 0.0), 3.0, -7.0)
    for crank in (*random.uniform(-7, 7, 6).tolist(), 1e4 + 0.3):
        assert_same(task, crank)


@pytest.mark.parametrize('seed', range(3))
def test_the_reference_is_the_limit_at_change_points_and_beside_them(seed):
    task = Task(linkages.with_change_point(np.random.default_rng(seed)), (0.0, 0.0), 3.0, -7.0)
    for crank in (0.0, 1e-300, -1e-18, 1e-9, 3.0, 4.0, 7.0, 10.0):
        assert_same(task, crank)


def test_the_reference_takes_lengths_as_they_are_meant():
    texts = ('0.1', '0.3', '0.4', '0.2')
    task = Task(linkages.four_bar(tuple(map(float, texts))), (0.0, 0.0), 3.0, -7.0)
    for crank in (1e-6, 2.0, 4.0, 8.0):
        assert_same(task, crank, texts)


NARROW = ('change point hit', 'near a change point', 'equal lengths', 'lengths in decimals')


@pytest.mark.parametrize('name', NARROW)
def test_the_reference_has_a_hundred_digits_left(name, monkeypatch):
    (situation,) = [one for one in SITUATIONS if one.name == name]
    for case in situation.cases(3):
        cranks = case.cranks[:: max(1, len(case.cranks) // 6)]
        mine = list(map(reference_of(*case[::2]).state, cranks))
        with monkeypatch.context() as more:
            more.setattr(states, '_DIGITS', 260)
            more.setattr(states, '_ASIDE', '1e-120')
            better = list(map(reference_of(*case[::2]).state, cranks))
        with mp.workdps(260):
            for one, other in zip(mine, better, strict=True):
                for x, y in zip(itertools.chain(*one), itertools.chain(*other), strict=True):
                    apart = min(abs(x - y), abs(abs(x - y) - 2 * mp.pi))
                    assert apart < max(abs(y), 1) * mp.mpf('1e-100'), (x, y)


def test_the_reference_refuses_where_no_state_exists():
    mechanism = linkages.limited(np.random.default_rng(1))
    start, end = Solver(mechanism).mobility.arcs[0]
    reference = Reference(mechanism, 1.0, 0.0)
    reference.state((start + end) / 2)
    with pytest.raises(UnreachableError):
        reference.state(end + 0.01)


def test_an_array_gives_what_numbers_give(benches):
    bench = benches['quadrilateral']
    for method in registry.METHODS:
        if method.modes != (ONE, BATCH):
            continue
        setting = method.steady
        one, batch = (method.make(bench.task, setting, FUNCTIONS[m]) for m in (ONE, BATCH))
        cranks = bench.even(7)
        for quantity in QUANTITIES:
            columns = getattr(batch, quantity)(cranks)
            for i, crank in enumerate(cranks.tolist()):
                found = [np.broadcast_to(column, 7)[i] for column in columns]
                close = 1e-4 if method.name.startswith('central') else 1e-9
                assert getattr(one, quantity)(crank) == pytest.approx(found, rel=close, abs=close)


# ---------------------------------------------------------------- orders


def errors_of(bench, name, quantity, settings=None):
    method = BY_NAME[name]
    mode = BATCH if BATCH in method.modes else ONE
    chosen = settings or method.settings
    return [bench.worst_error(method, setting, mode, quantity) for setting in chosen]


def slope(x, y):
    return np.polyfit(np.log(x), np.log(y), 1)[0]


@pytest.mark.parametrize('mechanism', ['quadrilateral', 'slider_crank'])
def test_cubic_hermite_is_of_order_4(benches, mechanism):
    nodes = [32, 64, 128, 256, 512]
    found = errors_of(
        benches[mechanism], 'table, cubic Hermite', 'position', [{'nodes': n} for n in nodes]
    )
    assert slope(nodes, found) == pytest.approx(-4, abs=0.2)


@pytest.mark.parametrize('mechanism', ['quadrilateral', 'slider_crank'])
def test_a_fourier_series_converges_geometrically(benches, mechanism):
    harmonics = np.arange(4, 25, 4)
    settings = [{'harmonics': int(n)} for n in harmonics]
    logs = np.log(errors_of(benches[mechanism], 'Fourier series', 'position', settings))
    line = np.polyfit(harmonics, logs, 1)
    assert line[0] < -0.7  # a factor of two and more with each harmonic
    assert np.corrcoef(harmonics, logs)[0, 1] < -0.99


@pytest.mark.parametrize('quantity', ['rate', 'acceleration'])
def test_central_differences_are_of_order_2(benches, quantity):
    steps = [0.1, 0.05, 0.025, 0.0125]
    settings = [{'step': step} for step in steps]
    found = errors_of(benches['quadrilateral'], 'central differences', quantity, settings)
    assert slope(steps, found) == pytest.approx(2, abs=0.1)


def test_newton_raphson_is_of_order_2():
    mechanism = PRESETS['quadrilateral']
    true = np.array(Solver(mechanism).state(1.0).position[1:])
    logs = []
    for direction in np.linspace(0, 2 * math.pi, 8, endpoint=False):
        guess = true + 0.2 * np.array([math.cos(direction), math.sin(direction)])
        # Any step ends an iteration of this tolerance, and the next call goes on from there.
        step = NewtonRaphson(Loop(mechanism), math.inf, tuple(guess), warm=True)
        found = [float(np.linalg.norm(np.array(step(1.0)) - true)) for _ in range(4)]
        logs += [np.log([a, b]) for a, b in itertools.pairwise(found) if b > 1e-13]
        assert step.iterations == 4
    assert np.polyfit(*np.array(logs).T, 1)[0] == pytest.approx(2, abs=0.15)


def test_newton_raphson_stops_at_its_cap():
    mechanism = linkages.limited(np.random.default_rng(1))
    _, end = Solver(mechanism).mobility.arcs[0]
    solve = NewtonRaphson(Loop(mechanism), 1e-12, (0.3, 0.5), warm=False)
    solve(end + 0.3)
    assert solve.iterations == CAP


# ---------------------------------------------------------------- measuring


def point(us, error, method='a', quantity='rate'):
    return Measurement(method, '', 'm', quantity, ONE, us, error)


def test_fronts_are_of_right_points_that_nothing_beats():
    points = [
        point(1.0, 1e-7), point(2.0, 1e-9), point(2.0, 1e-9), point(2.5, 1e-9), point(3.0, 1e-8),
        point(4.0, 1e-15), point(0.1, 1e-3), point(9.0, math.inf), point(math.nan, math.inf),
    ]  # fmt: skip
    elsewhere = point(9.0, 1e-6, quantity='torque')
    mark_fronts([*points, elsewhere])
    assert [p.pareto for p in points] == [True, True, True, False, False, True] + [False] * 3
    assert elsewhere.pareto


def test_errors_are_seen():
    bench = Bench(make_task(PRESETS['quadrilateral'], 0.1), 12)
    crank = float(bench.cranks[3])
    exact = reference_of(bench.task).state(crank)
    rate = [float(x) for x in exact.rate]
    assert bench.error('rate', crank, rate) < EPSILON
    assert 1e-4 < bench.error('rate', crank, [rate[0], rate[1] + 1e-2]) < 1e-2
    assert bench.error('rate', crank, [math.nan, rate[1]]) == math.inf
    position = [float(x) for x in exact.position]
    turned = [position[0] + 6 * math.pi, position[1] - 2 * math.pi]
    assert bench.error('position', crank, turned) < 4e-15
    assert bench.error('position', crank, [position[0], position[1] + 0.5]) == pytest.approx(0.5)
