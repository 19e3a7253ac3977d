# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Mobility of crank and output: classes, reach, period, swing and stroke."""

import cmath
import math
import random
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from mechanisms import (
    ASSEMBLIES,
    CHANGE_POINTS,
    FULL,
    LIMITED,
    TURN,
    examples,
    four_bar,
    of,
    slider_crank,
)
from mpmath import mp
from oracle import Oracle

from linkage_ros import (
    Friction,
    LoadCurve,
    MechanismError,
    Solver,
    UnreachableError,
    travel,
)
from linkage_ros.mechanism.kinematics import Reach
from linkage_ros.quantities import flatten
from linkage_ros.settings.configuration import configure
from linkage_ros.settings.summary import summary


def mobility(lengths, angle=0.0):
    return Solver(of(lengths, angle)).reach


any_lengths = st.tuples(*[st.integers(1, 40)] * 4).filter(lambda x: 2 * max(x) < sum(x))


@given(any_lengths)
def test_class_follows_from_shortest_and_longest_link(lengths):
    """Applies Grashof's rule to integers, for which it is exact, in every order of the links."""
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
    assert found.period_turns == (2 if (b == r + e) != (r == b + e) else 1)


@pytest.mark.parametrize(
    'every', [any_lengths, any_slider_crank], ids=['four_bar', 'slider_crank']
)
@examples(15)
@given(data=st.data(), angle=st.floats(-7, 7), assembly=st.sampled_from(ASSEMBLIES))
def test_crank_reaches_just_where_the_loop_closes(every, data, angle, assembly):
    """The crank's circle, 48 angles of it, against the reach in closed form."""
    solver = Solver(of(data.draw(every), angle, assembly))
    oracle = Oracle(solver.mechanism)
    assert sum(end - start for start, end in solver.reach.arcs) <= TURN
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
                with pytest.raises(UnreachableError, match='cannot move at') as error:
                    solver.state(crank)
                assert (error.value.crank_angle, error.value.arcs) == (crank, solver.reach.arcs)


def end_by_bisection(oracle, inside, outside):
    """Finds the angle at which the loop just closes by bisection between two angles."""
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
    solver = Solver(of(lengths, angle))
    oracle = Oracle(solver.mechanism)
    assert not solver.reach.turns_fully
    for start, end in solver.reach.arcs:
        assert 0 <= start < TURN
        assert start < end < start + TURN
        step = 0.1 * min(end - start, TURN - (end - start))
        for limit, out in ((start, -step), (end, step)):
            exact = end_by_bisection(oracle, limit - out, limit + out)
            # The limit is where L = |b - c| or b + c, or where sin(alpha) = (e -+ b)/r; an ulp or
            # two of the lengths changes this angle.
            r, d, sine = lengths[0], lengths[-1], abs(math.sin(oracle.angle(exact)))
            square = r * r + d * d - 2 * r * d * math.cos(oracle.angle(exact))
            slope = math.sqrt(square) / (r * d * sine) if len(lengths) == 4 else 1 / (r * sine)
            turned = math.ulp(TURN) if len(lengths) == 4 else math.ulp(limit)
            longest = max(abs(x) for x in lengths)
            rounding = turned + 2 * math.ulp(angle) + 2 * slope * math.ulp(longest)
            assert abs(exact - mp.mpf(limit)) <= rounding


# Lengths with equalities.


TURNS = dict.fromkeys(CHANGE_POINTS, 2) | dict.fromkeys(
    ('parallelogram', 'kite_r_b', 'kite_r_b_long_crank', 'rhombus', 'both'), 1
)


@pytest.mark.parametrize('assembly', ASSEMBLIES)
@pytest.mark.parametrize('name', [*FULL, *CHANGE_POINTS])
def test_period_is_the_fewest_turns_after_which_the_motion_repeats(name, assembly):
    mechanism = of({**FULL, **CHANGE_POINTS}[name], 5.5, assembly)
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


@pytest.mark.parametrize('assembly', ASSEMBLIES)
@pytest.mark.parametrize('angle', [-9.6, 3.0, 7 * math.pi / 4])
@pytest.mark.parametrize('name', CHANGE_POINTS)
def test_assembly_names_the_side_after_the_frame_angle_reduced_to_half_a_turn(
    name, angle, assembly
):
    lengths, reduced = CHANGE_POINTS[name], math.remainder(angle, TURN)
    solver = Solver(of(lengths, angle, assembly))
    if len(lengths) == 3:
        ahead = [solver.state(reduced).position[2] > lengths[0]]
    else:
        r, *_, d = lengths
        crank = reduced + np.linspace(0.1, 3.0, 9)
        diagonal = cmath.rect(d, angle) - r * np.exp(1j * crank)
        ahead = np.angle(np.exp(1j * solver.state(crank).position[1]) / diagonal) > 0
    assert set(ahead) == {assembly == 'open'}


# Descriptions and errors.


CURES = {
    'shorten the crank to at most': lambda r, b, c, d, x: (x, b, c, d),
    'make coupler and rocker equal, at least': lambda r, b, c, d, x: (r, x, x, d),
    'on a guide: lengthen the coupler to at least': lambda r, b, e, x: (r, x, e),
    'on a guide: shorten the crank to at most': lambda r, b, e, x: (x, b, e),
}


@pytest.mark.parametrize('lengths', [4, 3])
def test_each_suggested_change_is_just_enough_for_a_full_turn(lengths):
    """Four-bars and slider-cranks with random lengths and with round ones."""
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
            continue  # it cannot be assembled
        assert bool(found.cures) != found.turns_fully
        for cure in found.cures:
            words, bound = re.fullmatch(r'(.+?) ([0-9.e+-]+) m(?: each)?', cure).groups()
            words = words if count == 4 else f'on a guide: {words}'
            seen.add(words)
            assert mobility(CURES[words](*lengths, float(bound))).turns_fully, (lengths, cure)
            less = float(bound) * (0.9999 if 'at least' in words else 1.0001)
            if 'crank to at most' not in words or count == 3 or lengths[1] != lengths[2]:
                assert not mobility(CURES[words](*lengths, less)).turns_fully, (lengths, cure)
    assert seen == {words for words in CURES if (count == 3) == words.startswith('on a guide')}


# Dyadic fractions, so that no tiny numbers underflow.
ANGLES = st.integers(-10_240, 10_240).map(lambda x: x / 1024)


def way_of(found):
    """Returns the stroke or swing, m or rad; None if the output turns fully."""
    return None if found.extremes is None else found.extremes[1] - found.extremes[0]


def corner(a, b, c):
    """Returns the angle opposite the first side of a triangle, also of an almost flat one."""
    rise, run = (a - b + c) * (a + b - c), (b + c - a) * (a + b + c)
    return 2 * math.atan2(math.sqrt(max(rise, 0.0)), math.sqrt(max(run, 0.0)))


@st.composite
def crank_rockers(draw):
    """Generates crank, coupler, rocker and frame with a margin from every change point."""
    middle = sorted(draw(st.tuples(*[st.floats(1.6, 3)] * 3)))
    r = draw(st.floats(0.1, 0.95)) * (middle[0] + middle[1] - middle[2])
    others = draw(st.permutations(middle))
    return (min(r, 0.95 * middle[0]), *others)


@examples(15)
@given(crank_rockers(), st.sampled_from(ASSEMBLIES), ANGLES)
def test_swing_time_ratio_and_transmission_are_those_of_triangles(lengths, assembly, angle):
    r, b, c, d = lengths
    found = travel(Solver(four_bar(lengths, angle, assembly)))
    # At B0, between frame and rocker; crank and coupler are in line, of length b + r or b - r.
    swing = abs(corner(b + r, c, d) - corner(abs(b - r), c, d))
    assert way_of(found) == pytest.approx(swing, abs=1e-7)
    # At A0, between frame and that line; when folded with b > r, the crank points the other way.
    folded = corner(c, abs(b - r), d) + (math.pi if b > r else 0.0)
    way = (folded - corner(c, b + r, d)) % (2 * math.pi)
    ratio = max(way, 2 * math.pi - way) / min(way, 2 * math.pi - way)
    assert found.time_ratio == pytest.approx(ratio, rel=1e-7)
    # At B, in the two triangles in which crank and frame are in line.
    between = corner(d - r, b, c), corner(d + r, b, c)
    assert found.transmission == pytest.approx(between, abs=1e-7)


@examples(15)
@given(
    st.floats(0.05, 0.9), st.floats(-0.95, 0.95), st.sampled_from(ASSEMBLIES), ANGLES,
    st.sampled_from([1e-3, 1.0, 1e4]),
)  # fmt: skip
def test_stroke_and_time_ratio_of_a_slider_crank(r, part, assembly, angle, scale):
    b = scale
    r, e = r * scale, part * (1 - r) * scale
    found = travel(Solver(slider_crank((r, b, e), angle, assembly)))
    far, near = math.sqrt((b + r) ** 2 - e * e), math.sqrt((b - r) ** 2 - e * e)
    assert way_of(found) == pytest.approx(far - near, rel=1e-9)
    side = 1 if assembly == 'open' else -1
    assert sorted(map(abs, found.extremes)) == pytest.approx([near, far], rel=1e-9)
    assert side * found.extremes[0] > 0
    turned = abs(math.asin(e / (b + r)) - math.asin(e / (b - r)))
    ratio = (math.pi + turned) / (math.pi - turned)
    assert found.time_ratio == pytest.approx(ratio, rel=1e-6)
    low, high = (math.acos((e + x) / b) for x in (r, -r))
    assert found.transmission == pytest.approx((low, high), abs=1e-7)


def test_reversals_exactly_at_a_sample_are_found():
    """At 60 deg from the frame, and in line with the guide, a rate may be exactly 0."""
    lean = corner(2.0, 1.0, 2.0) - math.pi / 3
    for make, lengths, ratio in (
        (slider_crank, (0.1, 0.3, 0.0), 1.0),
        (four_bar, (0.5, 1.5, 2.0, 2.0), (math.pi + lean) / (math.pi - lean)),
    ):
        spans = []
        for degrees in np.arange(-359.5, 360) / 2:  # the samples are at such angles
            found = travel(Solver(make(lengths, math.radians(degrees))))
            assert len(found.at) == 2, degrees
            assert found.time_ratio == pytest.approx(ratio, rel=1e-7), degrees
            spans.append(way_of(found))
        assert spans == pytest.approx([spans[0]] * 720, rel=1e-14)


def test_travel_ignores_loads():
    """Friction locks the crank at some angles, to which a measured crank need not come."""
    bare = slider_crank((0.1, 0.3, 0.02))
    curve = LoadCurve('crank', 'crank_angle', (0.0, TURN, 2 * TURN), (0.0, 50.0, 0.0))
    mechanism = replace(bare, loads=(Friction(guide=50.0), curve))
    solver = Solver(mechanism)
    with pytest.raises(UnreachableError, match='friction locks'):
        solver.state(np.linspace(0.0, TURN, 100), 1.0)
    assert solver.reach.period_turns == 2
    assert travel(solver) == travel(Solver(bare))
    followed = configure({'mechanism': 'slider_crank', 'drive': 'follow'} | flatten(mechanism))
    assert 'stroke 0.2' in summary(followed.only, Solver(followed.mechanism))


# Stretched at 19 deg and, a turn and a half later except for that angle, at 161 deg.
_LEAN = 2 * math.asin(1 / 3)
DEGENERATE = {
    'double-crank': (four_bar((2.0, 1.5, 2.0, 1.0), 0.0), None, None),
    'parallelogram': (four_bar((1.0, 2.0, 1.0, 2.0), 0.0), None, None),
    'antiparallelogram': (four_bar((1.0, 2.0, 1.0, 2.0), 0.0, 'crossed'), None, None),
    'rhombus whose rocker rests': (four_bar((1.0, 1.0, 1.0, 1.0), 0.0, 'crossed'), 0.0, None),
    'two turns': (four_bar((1.0, 3.0, 2.0, 2.0), 0.0), 4 / 3 * math.pi, 2.0),
    'rod as long as the crank': (slider_crank((1.0, 1.0, 0.0)), 4.0, 1.0),
    'slider at rest': (slider_crank((1.0, 1.0, 0.0), 0.3, 'crossed'), 0.0, None),
    'slider through a change point': (
        slider_crank((1.0, 2.0, 1.0)),
        2 * math.sqrt(8.0),
        (3 * math.pi - _LEAN) / (math.pi + _LEAN),
    ),
}


@pytest.mark.parametrize(
    ('mechanism', 'span', 'ratio'), DEGENERATE.values(), ids=DEGENERATE.keys()
)
def test_outputs_that_turn_fully_rest_or_take_two_turns(mechanism, span, ratio):
    found = travel(Solver(mechanism))
    assert way_of(found) == (None if span is None else pytest.approx(span, rel=1e-12, abs=1e-12))
    assert found.time_ratio == (None if ratio is None else pytest.approx(ratio, rel=1e-9))
    words = ', '.join(found.words())
    assert ('turns fully' in words) == (span is None)
    assert 'nan' not in words
    assert '-0 ' not in words


@examples(15)
@given(
    st.sampled_from([(1, 2, 2, 1), (1, 2, 1, 2), (1, 3, 2, 2), (1, 1, 1, 1), (1.5, 3, 2.5, 1)]),
    st.integers(0, 3), st.floats(-14, -1), st.sampled_from([-1, 1]), ANGLES,
    st.sampled_from(ASSEMBLIES),
)  # fmt: skip
def test_swing_is_right_arbitrarily_near_a_change_point(
    lengths, link, power, sign, angle, assembly
):
    """Next to a kite, the rocker turns by 180 deg within a thousandth of a degree of the crank."""
    lengths = list(lengths)
    lengths[link] *= 1 + sign * 10**power
    solver = Solver(four_bar(lengths, angle, assembly))
    assume(solver.mobility.turns_fully and solver.mobility.grashof != 'change-point')
    found, (r, b, c, d) = travel(solver), lengths
    if solver.mobility.grashof == 'double-crank':
        assert way_of(found) is None
    else:
        swing = abs(corner(b + r, c, d) - corner(abs(b - r), c, d))
        assert way_of(found) == pytest.approx(swing, abs=1e-6)


@pytest.mark.parametrize(
    ('place', 'low'),
    # The arcs are 4 to 8 rad and 8.5 to 9 rad; the last place is on neither, next to the second.
    [(5.0, 4.0), (0.3, 4.0 - TURN), (13.0, 4.0 + TURN), (2.5, 8.5 - TURN), (2.8, 8.5 - TURN)],
)
def test_arc_around_a_place_is_in_its_turn(place, low):
    reach = Reach('triple-rocker', ((4.0, 8.0), (8.5, 9.0)), limits=('too short',))
    found, high = reach.arc_around(place)
    assert found == pytest.approx(low)
    assert high - found == pytest.approx(4.0 if low % TURN == pytest.approx(4.0) else 0.5)


def test_position_of_a_driven_slide_has_no_turns():
    reach = Reach('slider', ((0.1, 0.2), (7.0, 9.0)), limits=('too short',), driven='slider')
    assert [reach.arc_around(x) for x in (0.15, 0.2 + TURN)] == list(reach.arcs)
