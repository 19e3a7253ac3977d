# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The slider-crank whose slider is driven: ends of the stroke, change points, forces, refusals."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mechanisms import (
    ASSEMBLIES,
    DRIVEN_SLIDERS,
    examples,
    force_errors,
    load_values,
    slider_crank,
    worst_errors,
)
from mpmath import mp
from oracle import oracle_of, wrap

from linkage_ros import LinkageError, MechanismError, Solver, UnreachableError
from linkage_ros.settings.configuration import configure, read_values

RAM = {
    name: value
    for name, value in read_values(str(Path(__file__).parent / 'data' / 'ram.yaml')).items()
    if not name.startswith(('motion.', 'loads.', 'drive'))
}


def sliding(lengths, angle=0.3, assembly='open', **more):
    """Makes a slider-crank from crank, coupler and offset, whose slider is driven."""
    return replace(slider_crank(lengths, angle, assembly, **more), input='slider')


def link_errors(mechanism, place, rate=2.0, second=1.5):
    """Computes the errors of crank and coupler, relative to the largest value of each kind."""
    found, right = (
        solver.state(place, rate, second) for solver in (Solver(mechanism), oracle_of(mechanism))
    )
    errors = []
    for order in range(3):
        pairs = [*zip(found[order][:2], right[order][:2], strict=True)]
        apart = [wrap(mp.mpf(x) - y) if order == 0 else mp.mpf(x) - y for x, y in pairs]
        size = 1 if order == 0 else max(abs(y) for _, y in pairs)
        errors.append(float(max(map(abs, apart)) / size))
    return errors


@pytest.mark.parametrize('name', DRIVEN_SLIDERS)
def test_digits_are_kept_next_to_the_ends_of_the_stroke(name):
    mechanism = DRIVEN_SLIDERS[name]
    solver, oracle = Solver(mechanism), oracle_of(mechanism)
    for low, high in solver.reach.arcs:
        for distance in (1e-3, 1e-8, 1e-13):
            for place, beyond in ((low + distance, low), (high - distance, high)):
                assert max(link_errors(mechanism, place)) < 3e-15
                outside = 2 * beyond - place
                assert not oracle.closes(outside)
                with pytest.raises(UnreachableError, match='the slider of this'):
                    solver.state(outside)


@pytest.mark.parametrize('assembly', ASSEMBLIES)
@pytest.mark.parametrize(
    'lengths', [(1, 1, 0), (1, 1.5, 0.5), (3, 2, -1), (1, 1, 0.4), (2, 2.5, 1)]
)
def test_the_slider_passes_its_foot(lengths, assembly):
    """Smoothly, also at the change point of the first three, where all links are in line."""
    mechanism = sliding(lengths, assembly=assembly)
    for place in (-0.3, -1e-9, -1e-150, 0.0, 1e-150, 1e-12, 1e-5):
        assert max(link_errors(mechanism, place)) < 3e-15


@pytest.mark.parametrize(
    ('lengths', 'arcs'),
    [
        ((3, 5, 0), [(2, 8), (-8, -2)]),
        ((5, 3, 0), [(2, 8), (-8, -2)]),
        ((9, 4, 3), [(4, math.sqrt(160)), (-math.sqrt(160), -4)]),
        ((2, 2, 0), [(-4, 4)]),
        ((8, 5, 5), [(-12, 12)]),
        ((3, 5, -2), [(-math.sqrt(60), math.sqrt(60))]),
        ((0.1, 0.3, 0.2), [(-math.sqrt(0.12), math.sqrt(0.12))]),  # a change point in decimals
    ],
)
def test_the_stroke_has_one_part_or_two(lengths, arcs):
    found = Solver(sliding(lengths)).reach
    np.testing.assert_allclose(found.arcs, arcs)
    assert (found.slides, found.driven, found.period_turns) == (True, 'slider', 0)


@examples(30)
@given(
    st.tuples(st.integers(4, 256), st.integers(4, 256), st.integers(-256, 256)).filter(
        lambda x: abs(x[2]) < 0.9 * (x[0] + x[1])
    ),
    st.sampled_from(ASSEMBLIES),
    st.integers(-20, 20),
    st.lists(st.integers(1, 6144).map(lambda x: x / 1024), max_size=3),
)  # fmt: skip
def test_random_sliders(lengths, assembly, exponent, places):
    solver = Solver(sliding(lengths, 1.1, assembly, unit=2.0 ** (exponent - 8)))
    assert max(worst_errors(solver, [0.4, *places], period=4)) < 1e-13
    assert max(force_errors(solver, [0.4, *places])) < 1e-11


@pytest.mark.parametrize(
    ('values', 'place'),
    [
        ({'crank_angle': 0.0}, math.sqrt(0.3**2 - 0.15**2)),
        ({'crank_angle': -1.0, 'slider.offset': 0.0, 'start_rpm': 5.0}, None),
        ({'crank_angle': 0.43, 'assembly': 'crossed'}, -0.352),  # that of its other position
        ({'crank_angle': -1.2, 'crank.length': 0.3, 'coupler.length': 0.2}, None),
    ],
)
def test_a_crank_angle_sets_the_start_under_a_force(values, place):
    config = configure(RAM | {'drive': 'torque', 'motor.torque': 5.0} | values)
    (q,), (u,), *_ = config.drive.start(config.mechanism)
    state = Solver(config.mechanism).state(q, u)
    assert math.remainder(state.position[0] - values['crank_angle'], math.tau) == pytest.approx(0)
    assert state.velocity[0] == pytest.approx(values.get('start_rpm', 0.0) * math.pi / 30)
    assert place is None or q == pytest.approx(place, abs=1e-3)


LAW = {'drive': 'motion', 'motion.times': [0.0, 1.0]}


@pytest.mark.parametrize(
    ('values', 'words'),
    [
        ({'drive': 'speed', 'rpm': 5.0}, "drive = 'speed': .* the slider is driven, .* no rpm"),
        (LAW | {'motion.angles': [0.2, 0.3]}, 'must be motion.positions, because the slider is'),
        (LAW | {'motion.positions': [0.2, 0.6]}, 'the slider of this .* cannot move at 0.6 m'),
        (LAW | {'motion.positions': [0.2, -0.2]}, 'it reaches 0.0866.* to 0.497.* m'),
        ({'drive': 'torque', 'crank_angle': -1.77, 'coupler.length': 0.1, 'slider.offset': 0.0},
         'for this position of the slider; change'),
        ({'drive': 'torque', 'crank_angle': 0.0, 'coupler.length': 0.05}, 'cannot start'),
        (LAW | {'motion.positions': [0.2, 0.3]}
         | load_values('gas', link='slider', bore=0.1, clearance=0.1, inlet=1e5),
         'a stroke whose ends the crank determines, but slider is driven'),
        ({'drive': 'torque', 'input': 'piston'}, "input = 'piston': must be one of crank, slider"),
    ],
)  # fmt: skip
def test_bad_values_are_refused(values, words):
    with pytest.raises(LinkageError, match=words):
        configure(RAM | values)


def test_a_slider_that_cannot_move_is_refused():
    assert Solver(slider_crank((1, 2, 3))).reach.limits
    with pytest.raises(MechanismError, match='so that the slider cannot move'):
        sliding((1, 2, 3))
