# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Forces in the joints by hand, without masses, and at and beside change points.

test_fifty_digits.py compares them with 50 digits, test_laws.py with their mirror images.
"""

import math

import numpy as np
import pytest
from mechanisms import (
    force_errors,
    four_bar,
    slider_crank,
)
from mpmath import mp

from linkage_ros import (
    Body,
    Coupler,
    FourBar,
    Frame,
    Guide,
    Slider,
    SliderCrank,
    Solver,
    UnreachableError,
)

# By hand.


def test_rod_without_mass_pushes_along_itself():
    """Force F on the slider, nothing else: rod F/cos(beta), guide F tan(beta)."""
    mechanism = SliderCrank(
        Body(1.0), Coupler(math.sqrt(2)), Slider(force=100.0), Guide(), gravity=(0.0, 0.0)
    )
    solver = Solver(mechanism)
    found = solver.reactions(solver.state(math.radians(45)))
    # Rod at -30 deg; the slider is pushed along +x, and leans on the guide.
    rod = -100 * complex(1.0, -math.tan(math.radians(30)))
    for pin in ('A0', 'A', 'B'):
        assert complex(*found.pins[pin]) == pytest.approx(rod, rel=1e-13)
    assert found.guide_force == pytest.approx(-100 * math.tan(math.radians(30)), rel=1e-13)
    lever = math.cos(math.radians(45)) * rod.imag - math.sin(math.radians(45)) * rod.real
    assert found.torque == pytest.approx(lever, rel=1e-13)
    assert complex(*found.shaking_force) == pytest.approx(100, rel=1e-13)
    assert found.shaking_moment == pytest.approx(0, abs=1e-12)


def test_weights_of_a_square_hang_on_the_pivots():
    """Unit links: the coupler's weight halves on both uprights, no torque is due."""
    square = FourBar(
        Frame(1.0), Body(1.0, 3.0, 0.0, (0.5, 0.0)), Coupler(1.0, 4.0, 0.0, (0.5, 0.0)),
        Body(1.0, 5.0, 0.0, (0.5, 0.0)), gravity=(0.0, -10.0),
    )  # fmt: skip
    solver = Solver(square)
    found = solver.reactions(solver.state(math.pi / 2))
    hand = {'A0': 50j, 'A': 20j, 'B': -20j, 'B0': 70j}
    assert list(found.pins) == list(hand)
    for pin, force in hand.items():
        assert complex(*found.pins[pin]) == pytest.approx(force, rel=1e-13, abs=1e-13)
    assert complex(*found.shaking_force) == pytest.approx(-120j, abs=1e-13)
    # About A0: half the coupler's weight stands above A0, the rest and the rocker's at 1 m.
    assert found.shaking_moment == pytest.approx(-70, rel=1e-13)


# At change points. Where an angle is rounded, an exact comparison would not see them.

PASSED = {
    'small_parallelogram': (four_bar((0.1, 0.4, 0.1, 0.4), 0.0), (0.0, math.pi)),
    'antiparallelogram': (four_bar((1, 2, 1, 2), 0.3, 'crossed'), (0.3, 0.3 + math.pi)),
    'kite': (four_bar((1, 2, 2, 1), 5.5, 'crossed'), (5.5,)),
    'one_a_turn': (four_bar((1, 2.5, 1.5, 3), 0.0), (math.pi,)),
    'equal_rod': (slider_crank((1, 1, 0), 0.0), (math.pi / 2, -math.pi / 2)),
    'offset_slider': (slider_crank((1, 1.5, 0.5)), (0.3 - math.pi / 2,)),
}
passed = pytest.mark.parametrize('name', PASSED)
at_turns = pytest.mark.parametrize('turns', [0, 1, 3, 101, 1000])


def passing(name, turns):
    """Crank angles of the change points that many turns ahead and back, as a user types them."""
    _, first = PASSED[name]
    return [x + sign * turns * 2 * math.pi for x in first for sign in ((1, -1) if turns else (1,))]


@passed
@at_turns
def test_change_points_are_refused_after_any_number_of_turns(name, turns):
    solver = Solver(PASSED[name][0])
    for crank in passing(name, turns):
        alone = solver.state(crank, -2.0, 1.5)
        together = solver.state(np.array([crank + 1, crank, crank - 1]), 2.0, 1.5)
        assert all(np.isfinite(x).all() for state in (alone, together) for x in state[:3])
        for state in (alone, together):
            with pytest.raises(UnreachableError, match='all links lie in one line') as error:
                solver.reactions(state)
            assert error.value.crank_angle == crank
            assert error.value.arcs == solver.mobility.arcs
            assert '\n' not in str(error.value)


@passed
def test_angles_meant_as_change_points_miss_them(name):
    """Control of the test above: at these angles a guard of no width would let forces pass."""
    mechanism, _ = PASSED[name]
    for crank in (x for turns in (1, 3, 101, 1000) for x in passing(name, turns)):
        with mp.workdps(60):
            apart = mp.mpf(crank) - mp.mpf(mechanism.frame.angle)
            apart -= mp.pi / 2 if hasattr(mechanism, 'slider') else 0
            apart -= mp.pi * mp.nint(apart / mp.pi)
        assert 0 < abs(apart) < 2 * math.ulp(abs(crank) + abs(mechanism.frame.angle))


@passed
@at_turns
def test_forces_beside_change_points_are_large_and_right(name, turns):
    """Eight roundings away they are answered: the guard is no wider than it has to be."""
    solver = Solver(PASSED[name][0])
    for crank in passing(name, turns):
        for distance in (1e-2, -1e-4, 1e-6):
            assert max(force_errors(solver, [crank + distance], -3.0)) < 1e-12
        for sign in (8, -8):
            beside = crank + sign * math.ulp(8 + abs(crank))
            found = solver.reactions(solver.state(beside, 1.0))
            assert 1e6 < np.max(np.abs([*found.pins.values()])) < math.inf


def test_links_almost_in_line_are_no_change_point():
    """A sum of 1e-13 m does not count as 0: the forces are large, finite and right."""
    solver = Solver(four_bar((1 - 1e-13, 2, 1, 2), 0.0))
    assert solver.mobility.grashof == 'crank-rocker'
    assert max(force_errors(solver, [0.0, math.pi, 2000 * math.pi])) < 1e-12
