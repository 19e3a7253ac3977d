# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Slider-cranks: the values of document 4, closed answers, and the ends of the offset."""

import math
from dataclasses import replace

import numpy as np
import pytest
from mechanisms import ALL, ASSEMBLIES, TURN, slider_crank, worst_errors

from linkage_ros import (
    Body,
    Coupler,
    Guide,
    MechanismError,
    Slider,
    SliderCrank,
    Solver,
    UnreachableError,
)

DOCUMENT = ALL['document_4']


def test_document_4_has_its_printed_values():
    state = Solver(DOCUMENT).state(math.radians(45), 0.5, 1.0)
    assert state.position[0] == math.radians(45)
    assert math.degrees(state.position[1]) == pytest.approx(-30, rel=1e-14)
    assert state.position[2] == pytest.approx(1.93185165258, rel=5e-12)
    assert state.velocity[1:] == pytest.approx((-0.288675134595, -0.557677535825), rel=5e-12)
    assert state.acceleration[1:] == pytest.approx((-0.481125224325, -1.32615245782), rel=5e-12)


@pytest.mark.parametrize('assembly', ASSEMBLIES)
def test_document_4_is_right_over_the_turn(assembly):
    slider = Slider(mass=2.0, force=-7.0, damping=2.5, offset=0.3)
    solver = Solver(replace(DOCUMENT, slider=slider, assembly=assembly))
    angles = [math.radians(degrees) for degrees in range(0, 360, 5)]
    assert max(worst_errors(solver, angles, 0.5, 1.0, period=0)) < 1e-13


def test_sinusoidal_slider_loses_what_the_formula_says():
    """Equal crank and coupler: x = 2 r cos(alpha), so damping takes 4 pi d r^2 speed a turn."""
    mechanism = SliderCrank(
        Body(0.2, 1.0, 0.1), Coupler(0.2, 1.0, 0.1), Slider(mass=3.0, force=40.0, damping=5.0),
        Guide(angle=1.0),
    )  # fmt: skip
    crank = np.arange(360) * (TURN / 360)
    state = Solver(mechanism).state(crank, 3.0)
    assert np.allclose(state.position[2], 0.4 * np.cos(crank - 1.0), rtol=0, atol=4e-16)
    assert np.sum(state.torque) * TURN / 360 == pytest.approx(4 * math.pi * 5 * 0.04 * 3)


def test_folded_mechanism_keeps_its_slider_at_the_crank_pivot():
    state = Solver(slider_crank((1, 1, 0), 0.3, 'crossed')).state(np.linspace(-7, 7, 200), 2.0)
    for values in (state.position[2], state.velocity[2], state.acceleration[2]):
        assert np.max(np.abs(values)) < 1e-14


@pytest.mark.parametrize('ratio', [1e-2, 1e-6])
def test_crank_far_longer_than_its_coupler_loses_its_angles_rounding_and_no_more(ratio):
    """On an arc of 2 b/r rad one rounding of the crank angle is seen r/b times as large."""
    cranks = [0.3 + ratio * x for x in (-0.9, -0.5, -0.1, 0.3, 0.7, 0.95)]
    errors = worst_errors(Solver(slider_crank((1, ratio, 0))), cranks, period=0, floor=1)
    assert max(errors) < 32 * math.ulp(1.0) / ratio


@pytest.mark.parametrize('offset', [3.5, -3.5])
def test_offset_out_of_reach_is_refused_when_described(offset):
    with pytest.raises(MechanismError, match=f'offset of the slider, {offset:g} m.* by 0.5 m'):
        slider_crank((1, 2, offset))


def test_offset_just_in_reach_leaves_one_rigid_position():
    """Offset = crank + coupler: stretched straight across the guide, with no finite rate."""
    for crank in (math.pi / 2, np.full(2, math.pi / 2)):
        with pytest.raises(UnreachableError, match='cannot move at 90 deg'):
            Solver(slider_crank((1, 2, 3), 0.0)).state(crank)
