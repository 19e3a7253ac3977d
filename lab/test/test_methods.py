# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The registry of methods, their reference, and linkage_chart accuracy with its page."""

import itertools
import json
import math
import sys
import time
from dataclasses import replace

import numpy as np
import pytest
from mpmath import mp
from oracle import Oracle
from pages import ROOT
from test_errata import CRANKS, B, positions

from linkage_lab import command_line
from linkage_lab.charts.stability import GRIDS
from linkage_lab.methods import linkage_cases, situations
from linkage_lab.methods.linkage_cases import NEAR, TOGGLE, LinkageCase, TurnCase, linkages
from linkage_lab.methods.measure import BATCH, LIMIT, ONE, label, with_fronts
from linkage_lab.methods.registry import (
    CAP,
    DEFAULT,
    INTEGRATORS,
    METHODS,
    listing,
    newton_raphson,
)
from linkage_lab.methods.stages import ACCELERATION, OWN, QUANTITIES, SPEED
from linkage_lab.output import Stopwatch
from linkage_lab.reference import states
from linkage_lab.reference.states import Reference
from linkage_ros import ConfigurationError, Solver, __version__
from linkage_ros.settings.configuration import load

EPSILON = 2.0**-52
BY_NAME = {method.name: method for method in METHODS}
PRESETS = {name: load(name).mechanism for name in ('quadrilateral', 'slider_crank')}


@pytest.fixture(scope='module')
def turns():
    return {name: TurnCase(each, 24) for name, each in PRESETS.items()}


# ---------------------------------------------------------------- the reference


def compared():
    """Yields linkages far from change points, with them, in decimals, and with dyads."""
    for seed in range(4):
        random = np.random.default_rng(seed)
        mechanism = situations.turning(random)
        yield mechanism, (*random.uniform(-7, 7, 3).tolist(), 1e4 + 0.3), None
    for seed in range(2):
        mechanism = situations.with_change_point(np.random.default_rng(seed))
        yield mechanism, (0.0, 1e-300, -1e-18, 1e-9, 4.0, 7.0), None
    lengths = 0.1, 0.3, 0.4, 0.2
    yield situations.four_bar(lengths), (1e-6, 2.0, 4.0, 8.0), (*map(repr, lengths),)
    for name in ('six_bar', TOGGLE):
        mechanism = replace(dict(linkages(quick=True))[name].mechanism, loads=())
        yield mechanism, (0.3, 1.6, 1e-4, -2.3, -1.0), None


@pytest.mark.parametrize(('mechanism', 'cranks', 'lengths'), [*compared()])
def test_reference_agrees_with_an_independent_oracle(mechanism, cranks, lengths):
    """The state is continuous at change points; lengths in decimals are exact."""
    reference = Reference(mechanism, 3.0, -7.0, decimal=lengths is not None)
    for crank in cranks:
        mine, other = reference.state(crank), Oracle(mechanism, lengths).state(crank, 3.0, -7.0)
        with mp.workdps(60):
            for name, theirs in (
                ('position', other.position[1:]), ('rate', other.velocity[1:]),
                ('acceleration', other.acceleration[1:]), ('torque', (other.torque,)),
            ):  # fmt: skip
                for x, y in zip(mine[name], theirs, strict=True):
                    apart = abs(x - y)
                    if name == 'position':  # an angle, or a length below 1 m
                        apart = min(apart, abs(apart - 2 * mp.pi))
                    assert apart < max(abs(y), mp.mpf('1e-3')) * mp.mpf('1e-45'), (name, crank)


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
def test_arrays_equal_single_values(method):
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


@pytest.mark.parametrize('name', PRESETS)
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


# With an infinite tolerance, an iteration ends after one step, and the next call continues it.


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


def test_newton_raphson_stops_at_its_limit_of_iterations():
    mechanism = situations.limited(np.random.default_rng(1))
    beyond = Solver(mechanism).mobility.arcs[0][1] + 0.3
    once = newton(mechanism, (0.3, 0.5), math.inf)
    steps = [once(beyond) for _ in range(CAP + 1)]
    assert newton(mechanism, (0.3, 0.5), 1e-12)(beyond) == steps[CAP - 1] != steps[CAP]


def test_listing_of_document_1_is_as_printed():
    """As a method, the listing returns the real parts of complex angles."""
    guess = math.radians(15), math.radians(100)
    locate = listing(LinkageCase(PRESETS['quadrilateral'], CRANKS, guess), {})
    (printed, _), found = positions(B, is_real=False), np.array([*map(locate, CRANKS)]).T
    assert found == pytest.approx(printed.real, abs=1e-9)
    with pytest.raises(ConfigurationError, match='for a four-bar'):
        listing(LinkageCase(PRESETS['slider_crank'], (0.3,)), {})(0.3)


# ---------------------------------------------------------------- measuring


def point(us, error, quantity='rate'):
    panel = {'mechanism': 'm', 'quantity': quantity, 'mode': ONE}
    return {**panel, 'us_per_state': us, 'max_error': error}


def test_front_has_the_right_points_that_no_point_beats():
    points = [
        point(1.0, 1e-7), point(2.0, 1e-9), point(2.0, 1e-9), point(2.5, 1e-9), point(3.0, 1e-8),
        point(4.0, 1e-15), point(0.1, 1e-3), point(9.0, None), point(None, None),
    ]  # fmt: skip
    *found, elsewhere = with_fronts([*points, point(9.0, 1e-6, 'torque')])
    assert [p['pareto'] for p in found] == [True, True, True, False, False, True] + [False] * 3
    assert elsewhere['pareto']


def test_deliberate_errors_are_detected(turns):
    case = turns['quadrilateral']
    exact = case.reference.state(float(case.cranks[3]))
    first, second = map(float, exact['rate'])
    assert case.error('rate', 3, [first, second]) < EPSILON
    assert 1e-4 < case.error('rate', 3, [first, second + 1e-2]) < 1e-2
    first, second = map(float, exact['position'])
    assert case.error('position', 3, [first + 6 * math.pi, second - 2 * math.pi]) < 4e-15
    assert case.error('position', 3, [first, second + 0.5]) == pytest.approx(0.5)
    # As unit vectors, whose length also matters.
    numbers = np.array([f(x) for x in map(float, exact['position']) for f in (math.cos, math.sin)])
    assert case.error('position', 3, numbers) < EPSILON
    for link, along in itertools.product((0, 2), (0, 1)):
        x, y = numbers[link : link + 2]
        off = numbers.copy()
        off[link : link + 2] += 1e-6 * np.array([(x, y), (-y, x)][along])
        assert case.error('position', 3, off) == pytest.approx(1e-6)


EVERY = {method.name for method in (*METHODS, *INTEGRATORS)}
EASY = 'quadrilateral', 'slider_crank'
LISTING = "Ghalbi's listing"


def committed(name):
    """Returns the records in the docs."""
    return json.loads((ROOT / 'docs' / f'{name}.json').read_text())['records']


def test_busy_machine_is_reported(monkeypatch):
    now = {'passed': 0.0, 'used': 0.0}
    monkeypatch.setattr(time, 'perf_counter', lambda: now['passed'])
    monkeypatch.setattr(time, 'process_time', lambda: now['used'])
    watch = Stopwatch()
    now |= {'passed': 10.0, 'used': 9.9}
    assert watch.warning() == ''
    now['used'] = 6.0
    assert 'had 60 % of a processor' in watch.warning()


def run_quick(command, folder):
    """Runs a command; returns the paths that it prints, and the records that it writes."""
    printed = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, 'argv', ['linkage_chart', command, '--quick', '--out', str(folder)])
        patch.setattr('builtins.print', lambda *lines, **_: printed.extend(lines))
        assert command_line.main() == 0
    assert set(printed) == set(folder.iterdir())
    for path in set(printed) - {*folder.glob('*.json')}:
        assert path.read_bytes().startswith(b'\x89PNG')
        assert path.stat().st_size > 50_000
    content = json.loads(printed[0].read_text(), parse_constant=pytest.fail)
    assert content['about']['linkage_ros'] == __version__
    return [path.name for path in printed], content['records']


@pytest.fixture(scope='module')
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp('accuracy')


@pytest.fixture(scope='module')
def accuracy(folder):
    """Returns file names and records of one quick run, without the care of its times."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(linkage_cases, '_BATCH', 64)
        return run_quick('accuracy', folder)


@pytest.fixture(scope='module')
def errors(accuracy):
    """Returns the errors of all settings in order, by mechanism, quantity, method and mode."""
    found = {}
    for r in accuracy[1]:
        key = r['mechanism'], r['quantity'], r['method'], r['mode']
        error = math.inf if r['max_error'] is None else r['max_error']
        found.setdefault(key, {})[r['setting']] = error
    return found


def test_every_panel_has_a_front_of_right_points(accuracy):
    written, records = accuracy
    pictures = (*EASY, 'near_a_change_point', 'six_bar', 'near_a_toggle', 'motions')
    pictures = [f'accuracy_{name}.png' for name in pictures]
    assert written == ['accuracy.json', *pictures, 'accuracy_follow.json', 'accuracy_follow.png']
    assert {record['method'] for record in records} == EVERY
    assert all(record['us_per_state'] is None or record['us_per_state'] > 0 for record in records)
    panels = {}
    for r in records:
        panels.setdefault((r['mechanism'], r['quantity'], r['mode']), []).append(r)
    assert len(panels) == 5 * 4 * 2 + 2 * 3
    for points in panels.values():
        front = [r['max_error'] for r in points if r['pareto']]
        assert 0 <= max(front) <= LIMIT


def test_errors_of_a_measured_crank_equal_those_of_the_docs(accuracy, folder):
    """The errors do not depend on the machine, so they must equal the numbers in the docs."""
    assert accuracy
    records = json.loads((folder / 'accuracy_follow.json').read_text())['records']
    known, found = (
        {tuple(key): error for *key, error in map(dict.values, kept)}
        for kept in (committed('accuracy_follow'), records)
    )
    assert len(found) == 3 * 2 * 3
    assert found == pytest.approx({key: known[key] for key in found}, rel=1e-6)


@pytest.mark.parametrize('mechanism', EASY)
def test_every_method_is_right_on_an_easy_mechanism(errors, mechanism):
    limits = {'factored, float32': 1e-5, 'central differences': 2e-6}
    if mechanism == 'slider_crank':
        limits['half-angle'] = 1e-9  # near alpha = 0 its denominator is small
    for method in METHODS:
        if method.name == LISTING:
            continue
        for mode, quantity in itertools.product(method.modes, OWN[method.stage]):
            error = errors[mechanism, quantity, method.name, mode][label(method.steady)]
            assert error < limits.get(method.name, 1e-11), (method.name, mode, quantity)


def test_default_is_as_accurate_as_any_method_to_a_few_ulp(errors):
    easy = *EASY, 'six_bar'
    for mechanism, mode, quantity in itertools.product(easy, (ONE, BATCH), QUANTITIES):
        best = {
            method: min(found.values())
            for (*place, method, asked), found in errors.items()
            if (*place, asked) == (mechanism, quantity, mode)
        }
        assert best[DEFAULT] <= min(best.values()) + 4 * EPSILON, best


def test_near_a_change_point_the_default_alone_is_right(errors):
    near = {key: found for key, found in errors.items() if key[0] == NEAR}
    assert {method for _, _, method, _ in near} == {method.name for method in METHODS}
    for (_, _, method, _), found in near.items():
        for setting, error in found.items():
            right = method == DEFAULT
            assert (error < LIMIT) == (error < 1e-12) == right, (method, setting, error)


def test_a_dyad_near_its_toggle_costs_digits_as_the_square_of_its_sine(errors):
    """The default loses them, too; single precision and differences lose most of theirs."""
    near = {key[1:]: found for key, found in errors.items() if key[0] == TOGGLE}
    assert {method for _, method, _ in near} == {m.name for m in METHODS if m.dyads}
    for quantity, mode in itertools.product(QUANTITIES, (ONE, BATCH)):
        assert near[quantity, DEFAULT, mode][''] < 1e7 * EPSILON
    for quantity in ('acceleration', 'torque'):
        for method, mode in (('factored, float32', BATCH), ('central differences', ONE)):
            assert min(near[quantity, method, mode].values()) > LIMIT, (quantity, method)


def test_charts_of_the_docs_have_these_methods_and_situations():
    records = committed('stability')
    cells = {(m.name, s.name) for methods, places in GRIDS for m in methods for s in places}
    assert {(r['method'], r['situation']) for r in records} == cells
    points = committed('accuracy')
    assert {r['method'] for r in points} == EVERY
    assert {r['mechanism'] for r in points} >= {name for name, _ in linkages(quick=True)}
