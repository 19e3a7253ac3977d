# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Crank angles of a period: peaks and means under loads with corners, jumps and reversals."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mechanisms import TURN, examples

from linkage_lab.period import extent, speed_driven_period
from linkage_lab.sampling import derivative, integral, samples
from linkage_ros import (
    Body,
    Coupler,
    FourBar,
    Frame,
    Friction,
    Guide,
    LoadCurve,
    Slider,
    SliderCrank,
    Solver,
)

SPEED = -3.0


def integrated(at, value, power=1):
    """Integrates a piecewise linear function, or its square, exactly."""
    x, y = np.array(at), np.array(value)
    means = (y[1:] + y[:-1]) / 2, (y[1:] ** 2 + y[1:] * y[:-1] + y[:-1] ** 2) / 3
    return np.sum(np.diff(x) * means[power - 1])


@examples(10)
@given(
    st.floats(-9.0, 9.0),
    st.lists(st.tuples(st.floats(1e-5, 0.3), st.integers(-5, 5)), min_size=2, max_size=9),
)
@pytest.mark.parametrize('double', [False, True])
def test_peak_rms_and_mean_of_a_curve_are_exact_however_narrow_its_spikes(double, first, steps):
    """Without masses, the driving torque is the reversed load; one linkage repeats in 2 turns."""
    at = first + np.cumsum([width for width, _ in steps])
    value = [force for _, force in steps]
    curve = LoadCurve('crank', at=tuple(at), value=tuple(value))
    lengths = (1.0, 1.5, 2.5, 3.0) if double else (1.0, 3.0, 2.5, 2.2)
    linkage = FourBar(*(kind(x) for kind, x in zip(
        (Frame, Body, Coupler, Body), (lengths[3], *lengths[:3]), strict=True
    )), loads=(curve,))  # fmt: skip
    period = speed_driven_period(linkage, SPEED)
    assert period.crank[-1] == pytest.approx((1 + double) * TURN)
    found = extent(period.crank, period.columns['driving_torque'].values)
    at, value = [*at, at[0] + TURN], [*value, value[0]]
    size = max(map(abs, value)) + 1e-300
    assert (found.low, found.high) == pytest.approx((-max(value), -min(value)), abs=1e-8 * size)
    assert found.rms == pytest.approx(
        math.sqrt(integrated(at, value, 2) / TURN), rel=1e-7, abs=1e-7 * size
    )
    assert period.mean_power == pytest.approx(
        -SPEED * integrated(at, value) / TURN, abs=1e-8 * size
    )


@pytest.mark.parametrize('narrow', [1e-1, 1e-3, 1e-6])
def test_work_against_a_curve_over_position_is_the_area_between_its_strokes(narrow):
    """The slider passes the second corner and returns within one step if this is narrow."""
    r, b = 0.04, 0.2
    at = (b - r + 0.01, b + r - narrow * r, b + r)
    value, back = (0.0, -2500.0, -3000.0), (100.0, 700.0, 500.0)
    linkage = SliderCrank(
        Body(r), Coupler(b), loads=(LoadCurve('slider', 'position', at, value, back),)
    )
    period = speed_driven_period(linkage, 3.0)
    strokes = (b - r, *at), (value[0], *value), (back[0], *back)
    work = integrated(strokes[0], strokes[2]) - integrated(strokes[0], strokes[1])
    assert period.mean_power == pytest.approx(work * 3.0 / TURN, rel=1e-9)


def test_friction_changes_at_both_sides_of_a_reversal():
    linkage = SliderCrank(
        Body(0.04), Coupler(0.2), Slider(mass=3.0), Guide(0.7), loads=(Friction(guide=0.3),)
    )
    solver = Solver(linkage)
    crank = samples(solver, 1.0)
    for reversal in (0.7, 0.7 + math.pi):
        rates = solver.state(crank[np.abs(crank - reversal) < 1e-15], 1.0).velocity[2]
        assert rates.min() < 0 < rates.max()


def test_parts_between_jumps_are_integrated_and_differentiated_to_full_precision():
    low, high = np.linspace(0, 1, 400), np.linspace(1, 3, 400)
    crank = np.concatenate([low, [math.nextafter(1, 2)], high[1:]])
    values = np.concatenate([np.sin(low), np.cos(crank[400:])])
    total = (1 - math.cos(1)) + (math.sin(3) - math.sin(1))
    assert integral(crank, values)[-1] == pytest.approx(total, abs=1e-11)
    slopes = np.concatenate([np.cos(low), -np.sin(crank[400:])])
    assert derivative(crank, values) == pytest.approx(slopes, abs=1e-7)
