# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Stroke, swing, transmission angles and time ratio against the triangles of textbooks."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from mechanisms import ASSEMBLIES, four_bar, slider_crank

from linkage_ros import MechanismError, SliderCrank, Solver, travel

# Dyadic fractions, which leave no tiny numbers to underflow.
ANGLES = st.integers(-10_240, 10_240).map(lambda x: x / 1024)


def way_of(found):
    """Stroke or swing, m or rad; None where the output turns fully."""
    return None if found.extremes is None else found.extremes[1] - found.extremes[0]


def corner(a, b, c):
    """The angle opposite the first side of a triangle, also of one that is almost flat."""
    rise, run = (a - b + c) * (a + b - c), (b + c - a) * (a + b + c)
    return 2 * math.atan2(math.sqrt(max(rise, 0.0)), math.sqrt(max(run, 0.0)))


@st.composite
def crank_rockers(draw):
    """Crank, coupler, rocker, frame with a margin from every change point."""
    middle = sorted(draw(st.tuples(*[st.floats(1.6, 3)] * 3)))
    r = draw(st.floats(0.1, 0.95)) * (middle[0] + middle[1] - middle[2])
    others = draw(st.permutations(middle))
    return (min(r, 0.95 * middle[0]), *others)


@settings(max_examples=15)
@given(crank_rockers(), st.sampled_from(ASSEMBLIES), ANGLES)
def test_rocker_swings_between_stretched_and_folded_crank_and_coupler(lengths, assembly, angle):
    r, b, c, d = lengths
    found = travel(Solver(four_bar(lengths, angle, assembly)))
    # At B0, between frame and rocker, where crank and coupler make one line of b + r or b - r.
    swing = abs(corner(b + r, c, d) - corner(abs(b - r), c, d))
    assert way_of(found) == pytest.approx(swing, abs=1e-7)
    # At A0, between frame and that line; folded with b > r the crank points the other way.
    folded = corner(c, abs(b - r), d) + (math.pi if b > r else 0.0)
    way = (folded - corner(c, b + r, d)) % (2 * math.pi)
    ratio = max(way, 2 * math.pi - way) / min(way, 2 * math.pi - way)
    assert found.time_ratio == pytest.approx(ratio, rel=1e-7)


@settings(max_examples=15)
@given(crank_rockers(), st.sampled_from(ASSEMBLIES))
def test_transmission_angles_are_those_of_the_two_triangles_with_the_frame(lengths, assembly):
    r, b, c, d = lengths
    low, high = travel(Solver(four_bar(lengths, 0.0, assembly))).transmission
    assert low == pytest.approx(corner(d - r, b, c), abs=1e-7)
    assert high == pytest.approx(corner(d + r, b, c), abs=1e-7)


@settings(max_examples=15)
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


def test_extremes_are_reached_and_never_passed():
    for mechanism in (
        four_bar((1.0, 3.0, 2.0, 2.0), 0.0), four_bar((1.0, 4.0, 3.0, 3.5), 2.0, 'crossed'),
        slider_crank((1.0, 2.0, 1.0)), slider_crank((1.0, 2.5, 1.2), -1.0, 'crossed'),
    ):  # fmt: skip
        solver = Solver(mechanism)
        found = travel(solver)
        turns = solver.mobility.period_turns
        crank = np.linspace(0, 2 * math.pi * turns, 20_001)
        place = solver.state(crank).position[2]
        place = place if isinstance(mechanism, SliderCrank) else np.unwrap(place)
        assert np.ptp(place) == pytest.approx(way_of(found), rel=1e-6)
        assert np.ptp(place) <= way_of(found) * (1 + 1e-14)
        assert len(found.at) == 2
        assert all(0 <= angle < 2 * math.pi * turns for angle in found.at)
        rates = [solver.state(angle, 1.0).velocity[2] for angle in found.at]
        assert np.abs(rates).max() < 1e-14


# Stretched at 19 and, a turn and a half later but for that angle, at 161 deg.
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


@settings(max_examples=15)
@given(
    st.sampled_from([(1, 2, 2, 1), (1, 2, 1, 2), (1, 3, 2, 2), (1, 1, 1, 1), (1.5, 3, 2.5, 1)]),
    st.integers(0, 3), st.floats(-14, -1), st.sampled_from([-1, 1]), ANGLES,
    st.sampled_from(ASSEMBLIES),
)  # fmt: skip
def test_swing_is_right_however_near_a_change_point_is(
    lengths, link, power, sign, angle, assembly
):
    """Next to a kite the rocker swings by half a turn within a thousandth of a degree."""
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


def test_words_have_the_figures_and_their_units():
    quadrilateral = four_bar((0.1, 0.315, 0.5, 0.425), angle=5.497787143782138)
    assert travel(Solver(quadrilateral)).words() == [
        'swing 27.307 deg (82.445 to 109.752 deg)',
        'transmission angle 39.35 to 76.49 deg',
        'time ratio 1.311',
    ]
    assert travel(Solver(slider_crank((1.0, math.sqrt(2), 0.0)))).words() == [
        'stroke 2 m (0.414214 to 2.41421 m)',
        'transmission angle 45 to 135 deg',
        'time ratio 1',
    ]


def test_middle_of_a_swing_through_the_seam_is_within_half_a_turn():
    lengths = (0.1, 0.315, 0.5, 0.425)
    middle = sum(travel(Solver(four_bar(lengths, 0.0))).extremes) / 2
    for aside in (-0.02, -0.01, 0.01, 0.02):
        low, high = travel(Solver(four_bar(lengths, math.pi - middle + aside))).extremes
        assert abs(low + high) / 2 <= math.pi


def test_a_crank_that_does_not_turn_has_no_travel():
    with pytest.raises(MechanismError, match='cannot turn fully'):
        travel(Solver(slider_crank((2.0, 1.0, 0.0))))
