# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The registry of methods: its reference, and each method's order, floor and failures."""

import itertools
import math

import numpy as np
import pytest
from mpmath import mp
from oracle import Oracle
from test_errata import CRANKS, B, positions

from linkage_ros import ConfigurationError, Solver
from linkage_ros.lab.methods import situations
from linkage_ros.lab.methods.accuracy import with_fronts
from linkage_ros.lab.methods.linkage_cases import LinkageCase, TurnCase
from linkage_ros.lab.methods.measure import BATCH, ONE
from linkage_ros.lab.methods.registry import METHODS
from linkage_ros.lab.methods.stages import ACCELERATION, QUANTITIES, SPEED
from linkage_ros.lab.methods.tables import CAP, listing, newton_raphson
from linkage_ros.lab.reference import states
from linkage_ros.lab.reference.states import Reference
from linkage_ros.parameters.configuration import load

EPSILON = 2.0**-52
BY_NAME = {method.name: method for method in METHODS}
PRESETS = {name: load(name).mechanism for name in ('quadrilateral', 'slider_crank')}
each_preset = pytest.mark.parametrize('name', PRESETS)


@pytest.fixture(scope='module')
def turns():
    return {name: TurnCase(each, 24) for name, each in PRESETS.items()}


# ---------------------------------------------------------------- the reference


def assert_same(mechanism, crank, lengths=None):
    mine = Reference(mechanism, 3.0, -7.0, decimal=lengths is not None).state(crank)
    other = Oracle(mechanism, lengths).state(crank, 3.0, -7.0)
    with mp.workdps(60):
        for name, theirs in (
            ('position', other.position[1:]), ('rate', other.velocity[1:]),
            ('acceleration', other.acceleration[1:]), ('torque', (other.torque,)),
        ):  # fmt: skip
            for x, y in zip(mine[name], theirs, strict=True):
                size = max(abs(y), mp.mpf('1e-3'))
                apart = abs(x - y)
                if name == 'position':  # an angle, or a length below a metre
                    apart = min(apart, abs(apart - 2 * mp.pi))
                assert apart < size * mp.mpf('1e-45'), (name, crank, x, y)


@pytest.mark.parametrize('seed', range(4))
def test_reference_agrees_with_an_oracle_of_another_hand(seed):
    random = np.random.default_rng(seed)
    mechanism = situations.turning(random)
    for crank in (*random.uniform(-7, 7, 3).tolist(), 1e4 + 0.3):
        assert_same(mechanism, crank)


@pytest.mark.parametrize('seed', range(2))
def test_reference_is_the_limit_at_change_points_and_beside_them(seed):
    mechanism = situations.with_change_point(np.random.default_rng(seed))
    for crank in (0.0, 1e-300, -1e-18, 1e-9, 4.0, 7.0):
        assert_same(mechanism, crank)


def test_reference_takes_lengths_as_they_are_typed():
    lengths = 0.1, 0.3, 0.4, 0.2
    for crank in (1e-6, 2.0, 4.0, 8.0):
        assert_same(situations.four_bar(lengths), crank, [*map(repr, lengths)])


NARROW = ('change point hit', 'near a change point', 'equal lengths', 'lengths in decimals')


@pytest.mark.parametrize('name', NARROW)
def test_reference_has_a_hundred_digits_left(name, monkeypatch):
    (situation,) = [one for one in situations.SITUATIONS if one.name == name]
    for case in situation.cases(2):
        cranks = case.cranks[:: max(1, len(case.cranks) // 6)].tolist()
        mine = list(map(case.reference.state, cranks))
        with monkeypatch.context() as more:
            more.setattr(states, '_DIGITS', 260)
            more.setattr(states, '_ASIDE', '1e-120')
            again = Reference(case.mechanism, SPEED, ACCELERATION, decimal=case.decimal)
            better = list(map(again.state, cranks))
        with mp.workdps(260):
            for one, other in zip(mine, better, strict=True):
                values = (itertools.chain(*state.values()) for state in (one, other))
                for x, y in zip(*values, strict=True):
                    apart = min(abs(x - y), abs(abs(x - y) - 2 * mp.pi))
                    assert apart < max(abs(y), 1) * mp.mpf('1e-100'), (x, y)


# ---------------------------------------------------------------- methods


@pytest.mark.parametrize(
    'method', [m for m in METHODS if m.modes == (ONE, BATCH)], ids=lambda m: m.name
)
def test_an_array_gives_what_numbers_give(method):
    case = LinkageCase(PRESETS['slider_crank'], np.arange(7) * (math.tau / 7) + 0.3)
    close = 1e-4 if method.name.startswith('central') else 1e-9
    for quantity in QUANTITIES:
        one, batch = (case.rows(method, method.steady, quantity, mode) for mode in (ONE, BATCH))
        assert np.array(one) == pytest.approx(np.array(batch), rel=close, abs=close)


def errors_of(case, name, quantity, settings):
    return [
        max(error for _, error in case.outcomes(BY_NAME[name], setting, quantity, BATCH))
        for setting in settings
    ]


def slope(x, y):
    return np.polyfit(np.log(x), np.log(y), 1)[0]


@each_preset
def test_cubic_hermite_is_of_order_4(turns, name):
    nodes = [32, 64, 128, 256, 512]
    settings = [{'nodes': n} for n in nodes]
    found = errors_of(turns[name], 'table, cubic Hermite', 'position', settings)
    assert slope(nodes, found) == pytest.approx(-4, abs=0.2)


@pytest.mark.parametrize('quantity', ['rate', 'acceleration'])
def test_central_differences_are_of_order_2(turns, quantity):
    steps = [0.1, 0.05, 0.025, 0.0125]
    settings = [{'step': step} for step in steps]
    found = errors_of(turns['quadrilateral'], 'central differences', quantity, settings)
    assert slope(steps, found) == pytest.approx(2, abs=0.1)


def newton(mechanism, guess, tolerance):
    return newton_raphson(LinkageCase(mechanism, (0.0,), guess), {'tolerance': tolerance})


# Any step ends an iteration of an infinite tolerance, and the next call goes on from there.


def test_newton_raphson_is_of_order_2():
    mechanism = PRESETS['quadrilateral']
    true = np.array(Solver(mechanism).state(1.0).position[1:])
    logs = []
    for direction in np.linspace(0, 2 * math.pi, 8, endpoint=False):
        guess = true + 0.2 * np.array([math.cos(direction), math.sin(direction)])
        locate = newton(mechanism, tuple(guess.tolist()), math.inf)
        found = [float(np.linalg.norm(np.array(locate(1.0)) - true)) for _ in range(4)]
        logs += [np.log([a, b]) for a, b in itertools.pairwise(found) if b > 1e-13]
    assert np.polyfit(*np.array(logs).T, 1)[0] == pytest.approx(2, abs=0.15)


def test_newton_raphson_stops_at_its_cap():
    mechanism = situations.limited(np.random.default_rng(1))
    beyond = Solver(mechanism).mobility.arcs[0][1] + 0.3
    once = newton(mechanism, (0.3, 0.5), math.inf)
    steps = [once(beyond) for _ in range(CAP + 1)]
    assert newton(mechanism, (0.3, 0.5), 1e-12)(beyond) == steps[CAP - 1] != steps[CAP]


def test_listing_of_document_1_is_as_printed():
    """It plots the real parts of complex angles: its errata, as a method."""
    guess = math.radians(15), math.radians(100)
    locate = listing(LinkageCase(PRESETS['quadrilateral'], CRANKS, guess), {})
    found = np.array([locate(crank) for crank in CRANKS.tolist()]).T
    printed, _ = positions(B, is_real=False)
    assert found == pytest.approx(printed.real, abs=1e-9)
    with pytest.raises(ConfigurationError, match='for a four-bar'):
        listing(LinkageCase(PRESETS['slider_crank'], (0.3,)), {})(0.3)


# ---------------------------------------------------------------- measuring


def point(us, error, quantity='rate'):
    panel = {'mechanism': 'm', 'quantity': quantity, 'mode': ONE}
    return {**panel, 'us_per_state': us, 'max_error': error}


def test_fronts_are_of_right_points_that_nothing_beats():
    points = [
        point(1.0, 1e-7), point(2.0, 1e-9), point(2.0, 1e-9), point(2.5, 1e-9), point(3.0, 1e-8),
        point(4.0, 1e-15), point(0.1, 1e-3), point(9.0, None), point(None, None),
    ]  # fmt: skip
    *found, elsewhere = with_fronts([*points, point(9.0, 1e-6, 'torque')])
    assert [p['pareto'] for p in found] == [True, True, True, False, False, True] + [False] * 3
    assert elsewhere['pareto']


def test_errors_are_seen(turns):
    case = turns['quadrilateral']
    exact = case.reference.state(float(case.cranks[3]))
    first, second = map(float, exact['rate'])
    assert case.error('rate', 3, [first, second]) < EPSILON
    assert 1e-4 < case.error('rate', 3, [first, second + 1e-2]) < 1e-2
    first, second = map(float, exact['position'])
    assert case.error('position', 3, [first + 6 * math.pi, second - 2 * math.pi]) < 4e-15
    assert case.error('position', 3, [first, second + 0.5]) == pytest.approx(0.5)
    # As unit vectors, whose lengths count too.
    numbers = np.array([float(x) for x in exact['direction']])
    assert case.error('position', 3, numbers) < EPSILON
    for one in np.eye(4):
        assert case.error('position', 3, numbers + 1e-6 * one) == pytest.approx(1e-6)
