# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a four-bar's crank can do: classes, reach, period, and the words of the errors."""

import math
import random
import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mechanisms import ASSEMBLIES, CHANGE_POINTS, FULL, LIMITED, TURN
from mechanisms import of as made_of
from mpmath import mp
from oracle import Oracle

from linkage_ros import (
    MechanismError,
    Solver,
    UnreachableError,
)


def mobility(lengths, angle=0.0):
    return Solver(made_of(lengths, angle)).reach


any_lengths = st.tuples(*[st.integers(1, 40)] * 4).filter(lambda x: 2 * max(x) < sum(x))


@settings(max_examples=30)
@given(any_lengths)
def test_class_follows_from_shortest_and_longest_link(lengths):
    """Grashof's rule on whole numbers, where it is exact; every order of the links."""
    excess = 2 * (min(lengths) + max(lengths)) - sum(lengths)
    found, names = mobility(lengths), ('crank-rocker', 'double-rocker', 'rocker-crank')
    shortest = [
        name for name, length in zip((*names, 'double-crank'), lengths, strict=True)
        if length == min(lengths)
    ]  # fmt: skip
    if excess:
        assert found.grashof in (['triple-rocker'] if excess > 0 else shortest)
        assert found.turns_fully == (found.grashof in {'crank-rocker', 'double-crank'})
    else:
        assert found.grashof == 'change-point'


any_slider_crank = st.tuples(st.integers(1, 40), st.integers(1, 40), st.integers(-40, 40)).filter(
    lambda x: abs(x[2]) < x[0] + x[1]
)


@settings(max_examples=30)
@given(any_slider_crank)
def test_class_of_a_slider_crank_follows_from_its_lengths(lengths):
    (r, b, _), e = lengths, abs(lengths[2])
    found = mobility(lengths)
    if b == r + e or r == b + e:
        assert found.grashof == 'change-point'
    elif b > r + e:
        assert found.grashof == 'crank-slider'
    else:
        assert found.grashof == ('rotating-coupler' if b + e < r else 'non-Grashof')
    assert found.turns_fully == (b >= r + e)
    assert len(found.arcs) == (2 if b + e < r else 1)
    assert found.period_turns == (2 if b == r + e and e else 1)


@pytest.mark.parametrize(
    'every', [any_lengths, any_slider_crank], ids=['four_bar', 'slider_crank']
)
@settings(max_examples=15)
@given(data=st.data(), angle=st.floats(-7, 7), assembly=st.sampled_from(ASSEMBLIES))
def test_crank_reaches_just_where_the_loop_closes(every, data, angle, assembly):
    """The crank's circle, 48 angles of it, against the reach in closed form."""
    solver = Solver(made_of(data.draw(every), angle, assembly))
    oracle = Oracle(solver.mechanism)
    for i in range(24):
        crank = i * TURN / 24 + 0.01
        inside = any(
            start < crank + turn < end for start, end in solver.reach.arcs for turn in (0, TURN)
        )
        near_an_end = any(
            abs(math.remainder(crank - end, TURN)) < 1e-9
            for arc in solver.reach.arcs
            for end in arc
        )
        if solver.reach.turns_fully or not near_an_end:
            assert oracle.closes(crank) == inside
            if inside:
                solver.state(crank)
            else:
                with pytest.raises(UnreachableError, match='cannot move at'):
                    solver.state(crank)


def end_by_bisection(oracle, inside, outside):
    """Where the loop just closes between two angles, by nothing but trying."""
    assert oracle.closes(inside)
    assert not oracle.closes(outside)
    with mp.workdps(50):
        inside, outside = mp.mpf(inside), mp.mpf(outside)
        for _ in range(100):
            middle = (inside + outside) / 2
            if oracle.closes(middle):
                inside = middle
            else:
                outside = middle
        return inside


MORE_LIMITED = (
    (3, 1, 2.5, 2.2), (3, 2.5, 1, 2.2), (2, 2.1, 2.2, 4), (4, 2.1, 2.2, 2), (2, 4, 2.1, 2.2),
    (2, 2.1, 4, 2.2), (2, 2, 1, 3), (1, 1e-3, 2e-3, 1.0005), (0.3, 0.7, 0.5, 1.4999),
    (3.0, 7.0, 4.0, 0.01),
)  # fmt: skip


@pytest.mark.parametrize('angle', [0.3, 100.0])
@pytest.mark.parametrize('lengths', [*LIMITED.values(), *MORE_LIMITED])
def test_ends_of_the_reach_are_where_the_loop_just_closes(lengths, angle):
    solver = Solver(made_of(lengths, angle))
    oracle = Oracle(solver.mechanism)
    assert not solver.reach.turns_fully
    for start, end in solver.reach.arcs:
        assert 0 <= start < TURN
        assert start < end < start + TURN
        step = 0.1 * min(end - start, TURN - (end - start))
        for limit, out in ((start, -step), (end, step)):
            exact = end_by_bisection(oracle, limit - out, limit + out)
            # The limit is where L = |b - c| or b + c, or where sin(alpha) = (e -+ b)/r: an ulp or
            # two of the lengths is carried into the angle.
            r, d, sine = lengths[0], lengths[-1], abs(math.sin(oracle.angle(exact)))
            square = r * r + d * d - 2 * r * d * math.cos(oracle.angle(exact))
            slope = math.sqrt(square) / (r * d * sine) if len(lengths) == 4 else 1 / (r * sine)
            turned = math.ulp(TURN) if len(lengths) == 4 else math.ulp(limit)
            longest = max(abs(x) for x in lengths)
            rounding = turned + 2 * math.ulp(angle) + 2 * slope * math.ulp(longest)
            assert abs(exact - mp.mpf(limit)) <= rounding


# Equalities.


TURNS = dict.fromkeys(CHANGE_POINTS, 2) | dict.fromkeys(
    ('parallelogram', 'kite_r_b', 'kite_r_b_long_crank', 'rhombus', 'both'), 1
)


@pytest.mark.parametrize('assembly', ASSEMBLIES)
@pytest.mark.parametrize('name', [*FULL, *CHANGE_POINTS])
def test_period_is_the_fewest_turns_after_which_the_motion_repeats(name, assembly):
    mechanism = made_of({**FULL, **CHANGE_POINTS}[name], 5.5, assembly)
    reach = Solver(mechanism).reach
    assert reach.period_turns == TURNS.get(name, 1)
    assert reach.has_change_point == (name in CHANGE_POINTS)
    oracle = Oracle(mechanism)
    start, repeats = oracle.state(1.0).position, []
    for turns in (1, 2):
        after = oracle.state(1.0 + turns * TURN).position
        apart = [
            abs(mp.expj(x) - mp.expj(y)) if is_angle else abs(x - y)
            for x, y, is_angle in zip(start, after, oracle.turning, strict=True)
        ]
        repeats.append(max(apart[1:]) < 1e-12)
    assert repeats.index(True) + 1 == TURNS.get(name, 1)


@pytest.mark.parametrize(('gap', 'found'), [(1e-14, 'crank-rocker'), (-1e-14, 'triple-rocker')])
def test_a_gap_of_ten_femtometres_is_a_gap(gap, found):
    assert mobility((1, 2.5, 1.5, 3 - gap)).grashof == found


def test_links_that_just_reach_each_other_are_rigid():
    """Frame = crank + coupler + rocker: the reach is one angle."""
    found = mobility((1, 2, 3, 6), 0.3)
    assert not found.turns_fully
    ((start, end),) = found.arcs
    assert (start, end) == pytest.approx((0.3, 0.3), abs=1e-7)


# Words.


@pytest.mark.parametrize(
    'lengths', [(7, 2, 3, 1), (1, 7, 2, 3), (1, 2, 7, 3), (1, 2, 3, 6.0000001), (1, 2, 3, 7)]
)
def test_loop_that_cannot_close_is_refused_when_described(lengths):
    longest = f'{max(lengths):g} m'.replace('.', r'\.')
    with pytest.raises(
        MechanismError, match=f'longest link, {longest}, is longer .* the loop cannot close; '
    ):
        made_of(lengths)


CURES = {
    'shorten the crank to at most': lambda r, b, c, d, x: (x, b, c, d),
    'shorten the crank to between': lambda r, b, c, d, x: (x, b, c, d),
    'lengthen the crank to between': lambda r, b, c, d, x: (x, b, c, d),
    'lengthen the coupler to at least': lambda r, b, c, d, x: (r, x, c, d),
    'lengthen the rocker to at least': lambda r, b, c, d, x: (r, b, x, d),
    'make coupler and rocker equal, at least': lambda r, b, c, d, x: (r, x, x, d),
    'on a guide: lengthen the coupler to at least': lambda r, b, e, x: (r, x, e),
    'on a guide: shorten the crank to at most': lambda r, b, e, x: (x, b, e),
    'on a guide: bring the offset to within': lambda r, b, e, x: (r, b, math.copysign(x, e)),
}


@pytest.mark.parametrize('lengths', [4, 3])
def test_each_cure_by_itself_lets_the_crank_turn_and_nothing_less_does(lengths):
    """Four-bars and slider-cranks with random lengths, and with round ones."""
    rng, seen, count = random.Random(7), set(), lengths
    for number in range(200):
        if number % 2:
            lengths = [rng.uniform(0.1, 5) for _ in range(count)]
        else:
            lengths = [rng.randint(1, 9) / rng.choice([1, 3, 10]) for _ in range(count)]
        if count == 3:
            lengths[2] *= rng.choice([-1, 0, 1])
        try:
            found = mobility(lengths)
        except MechanismError:
            continue  # it cannot be put together
        assert bool(found.cures) != found.turns_fully
        for cure in found.cures:
            words, *bounds = re.fullmatch(
                r'(.+?) ([0-9.e+-]+)(?: and ([0-9.e+-]+))? m(?: each| of 0)?', cure
            ).groups()
            bounds = [float(bound) for bound in bounds if bound]
            words = words if count == 4 else f'on a guide: {words}'
            seen.add(words)
            for bound in bounds:
                assert mobility(CURES[words](*lengths, bound)).turns_fully, (lengths, cure)
            longer = 'lengthen' in words or 'at least' in words
            less = bounds[0] * 0.9999 if longer else bounds[-1] * 1.0001
            if 'crank to at most' not in words or count == 3 or lengths[1] != lengths[2]:
                assert not mobility(CURES[words](*lengths, less)).turns_fully, (lengths, cure)
    assert seen == {words for words in CURES if (count == 3) == words.startswith('on a guide')}
