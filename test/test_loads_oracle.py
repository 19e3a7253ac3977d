# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Loads and friction against Newton-Euler in 50 digits, above all in bad places; their work."""

import math
from dataclasses import replace

import numpy as np
import pytest
from mechanisms import (
    CHANGE_POINTS,
    FULL,
    PUMPS,
    TURN,
    force_errors,
    four_bar,
    slider_crank,
    with_loads,
    worst_errors,
)
from oracle import Oracle, oracle_of

from linkage_ros import (
    FourBar,
    Friction,
    LinkLoad,
    LoadCurve,
    Solver,
    UnreachableError,
)
from linkage_ros.motion.adaptive_integrator import AdaptiveSteps
from linkage_ros.motion.driven_mechanism import DrivenMechanism
from linkage_ros.numeric import with_turns

CLOSE, SLIP = 1e-11, 1 + 1e-10
# Rockers that swing across the jump of angles at pi, and through the line of the frame.
ROCKERS = {
    'across_the_seam': four_bar(FULL['crank_rocker'], 1.3),
    'through_the_line': four_bar(CHANGE_POINTS['p0'], 0.2, 'crossed'),
}
SLIDERS = {
    'offset_left': slider_crank(FULL['offset_left'], -1.1),
    'offset_right': slider_crank(FULL['offset_right'], 5.5, 'crossed'),
}
MECHANISMS = {**ROCKERS, **SLIDERS, 'pump': PUMPS['pump'], 'pump_open': PUMPS['pump_open']}
RUBBING = {'rocker': Friction(0.2, 0.08), 'slider': Friction(0.1, 0.05, 0.2)}


def loads_of(link, middle):
    """Every kind of load, with corners in the swing about a middle."""
    places = tuple(middle + x for x in (-0.4, 0.05, 0.3))
    return {
        'force': LinkLoad(link, 3.0),
        'damping': LinkLoad(link, damping=0.7),
        'spring': LinkLoad(link, stiffness=11.0, rest=middle + 0.4),
        'over_position': LoadCurve(link, 'position', places, (5.0, -7.0, 30.0), (0.0, 2.0, -4.0)),
        'over_crank_angle': LoadCurve(link, at=(0.5, 2.0, 6.0), value=(4.0, -3.0, 8.0)),
        'on_the_crank': LoadCurve('crank', at=(-7.0, -5.0), value=(2.0, 9.0)),
        'friction': RUBBING[link],
    }


def loaded(name, *kinds):
    """A mechanism with loads of these kinds."""
    mechanism = MECHANISMS[name]
    if isinstance(mechanism, FourBar):
        spring = with_loads(mechanism, LinkLoad('rocker', stiffness=1.0))
        found = loads_of('rocker', float(oracle_of(spring).middle))
    else:
        found = loads_of('slider', 1.6)
    return with_loads(mechanism, *(found[kind] for kind in kinds))


def error(mechanism, cranks, speed=2.0, acceleration=1.5, meant=None):
    """The largest error of any quantity; the reference is given what is meant."""
    solver = Solver(mechanism)
    solver.mechanism = meant or mechanism
    motion = cranks, speed, acceleration
    states = worst_errors(solver, *motion, period=0, floor=1e-2)
    return max(*states, *force_errors(solver, *motion))


KINDS = tuple(loads_of('rocker', 0.0))


@pytest.mark.parametrize('kind', KINDS)
@pytest.mark.parametrize('name', ['across_the_seam', 'offset_right'])
def test_each_load_gives_the_torque_and_forces_of_newton_and_euler(name, kind):
    assert error(loaded(name, kind), [0.8, -3.0]) < CLOSE


@pytest.mark.parametrize(
    ('name', 'speed', 'acceleration'),
    [
        *((name, -2.0, 1.5) for name in MECHANISMS),
        *((name, 150.0, 1e3) for name in ('across_the_seam', 'offset_right')),
        *((name, 0.0, -1.5) for name in ('across_the_seam', 'offset_right', 'pump')),
    ],
)
def test_all_loads_at_once_in_either_direction_and_at_rest(name, speed, acceleration):
    kinds = KINDS[:-1] if name.startswith('pump') else KINDS
    kinds = [kind for kind in kinds if kind not in ('force', 'damping', 'spring')]
    mechanism = loaded(name, *kinds)
    link = 'rocker' if isinstance(mechanism, FourBar) else 'slider'
    mechanism = replace(mechanism, loads=(*mechanism.loads, LinkLoad(link, 3.0, 0.7, 11.0, 0.4)))
    assert error(mechanism, [-4.1, 1.3], speed, acceleration) < CLOSE


# Bad places.


def curve(points, value, over='crank_angle', **more):
    bare = slider_crank(FULL['offset_right'], 0.3, point=(0.1, 0.2))
    return with_loads(bare, LoadCurve('slider', over, points, value, **more))


@pytest.mark.parametrize(
    ('points', 'cranks'),
    [
        ((0.5, 2.0, 6.0), [0.5, 2.0, 6.0, 2.0 - TURN, math.nextafter(2.0, 0)]),
        ((0.5, 2.0, 6.0), [0.5 + 1000 * TURN, 2.0 - 1000 * TURN, 6.0 + 1000 * TURN]),
        ((1.0, 2.0, 1.0 + TURN), [1.0, 1.0 + TURN, 1.0 - 1e-12, 1.0 - 1000 * TURN]),
        ((-9.0, -7.0, -4.0), [-8.0, -5.0, 0.3, 901.5]),
        ((901.0, 902.0, 905.0), [1.5, 902.0, 902.0 - 286 * math.pi]),
        ((1.0, 1.001, 4.0), [1.0005, 1.0005 + 1000 * TURN, 1.0005 - 1000 * TURN]),
        ((0.5, 3.0, 6.75), [0.5 + 1000 * TURN, 0.4999, 0.48 - TURN]),
    ],
)
def test_curves_over_the_crank_angle_at_and_between_their_points(points, cranks):
    value = (8.0, -3.0, 8.0) if points[2] - points[0] == TURN else (-40.0, 900.0, 8.0)
    assert error(curve(points, value), cranks, -2.0) < 2e-13


def test_curves_over_a_position_at_their_points():
    cranks = [0.4, 1.9, 4.0]
    bare = Solver(curve((0.0,), (0.0,)))
    places = sorted(bare.state(crank).position[2] for crank in cranks)
    steep = (places[0], places[1], places[1] + 1e-4)
    for speed in (2.0, -2.0):
        for points in (places, steep):
            loads = curve(points, (5.0, -7.0, 30.0), 'position', return_value=(0.0, 2.0, -4.0))
            assert error(loads, cranks, speed) < 1e-11


@pytest.mark.parametrize('turns', [-3, 0, 1])
def test_places_on_a_rocker_count_without_whole_turns(turns):
    mechanism = loaded('across_the_seam', 'over_position')
    (curve,) = mechanism.loads
    moved = replace(curve, at=tuple(x + turns * TURN for x in curve.at))
    rest = float(Oracle(mechanism).middle) + 0.4 + turns * TURN
    mechanism = replace(mechanism, loads=(moved, LinkLoad('rocker', stiffness=9.0, rest=rest)))
    assert error(mechanism, [0.4, 3.9]) < 1e-13


@pytest.mark.parametrize(
    ('friction', 'crank', 'locks'),
    [
        (Friction(guide=1.0), 1.0, 0.8484727408779),
        (Friction(guide=1.0), 4.2, 8.287186818148),
        (Friction(1.0, 1.0, 0.2), 1.0, 0.5333537900804),
        (Friction(1.0, 0.25, 1.0), 0.3, 0.9645420075187),
        (Friction(1.0, 0.25, 1.0), 2.2, 1.372153762702),
    ],
)
def test_friction_is_solved_until_it_locks(friction, crank, locks):
    """Forces up to 1e3 times those without friction; beyond, the reference finds none either."""
    name = 'guide' if friction.guide == 1.0 else 'pin_radius'

    def rubs(share):
        rubbing = replace(friction, **{name: share * locks})
        return with_loads(SLIDERS['offset_right'], rubbing)

    for share in (0.8, 0.99, 0.999):
        assert error(rubs(share), [crank]) < CLOSE
    Solver(rubs(1 - 1e-9)).state(crank, 2.0, 1.5)
    with pytest.raises(UnreachableError, match='friction locks the mechanism: no forces'):
        Solver(rubs(1 + 1e-9)).state(crank, 2.0, 1.5)
    with pytest.raises(ArithmeticError, match='no friction'):
        Oracle(rubs(1 + 1e-6)).state(crank, 2.0, 1.5)


def test_an_array_near_locking_has_the_bits_of_its_states():
    mechanism = with_loads(SLIDERS['offset_right'], Friction(1.0, 0.05, 0.55))
    solver, cranks = Solver(mechanism), np.linspace(0.0, TURN, 60)
    together = solver.state(cranks, 2.0, 1.5, by_math=True)
    alone = [solver.state(crank, 2.0, 1.5).torque for crank in cranks.tolist()]
    assert together.torque.tolist() == alone


# Work and energy.


def test_a_torque_driven_run_keeps_its_balance_of_energy_with_loads():
    """Motor torque, weight, spring, force and a curve over the position all have a potential."""
    at_points, value = (3.0, 3.13, 3.2), (5.0, -7.0, 3.0)
    mechanism = with_loads(
        ROCKERS['across_the_seam'],
        LinkLoad('rocker', 3.0, stiffness=11.0, rest=3.2),
        LoadCurve('rocker', 'position', at_points, value),
    )
    solver = Solver(mechanism)
    steps = AdaptiveSteps(DrivenMechanism(solver, lambda _: 2.0), (0.3, 4.0))

    def gained(place):
        """What force and curve have done on the rocker, from its place at 0."""
        corners = np.array(sorted({0.0, place, *(x for x in at_points if x < place)}))
        pushed = 3.0 + np.interp(corners, at_points, value)
        return np.sum((pushed[1:] + pushed[:-1]) / 2 * np.diff(corners))

    def place():
        return solver.state(steps.phase[0]).position[2] % TURN

    def total():
        turned = with_turns(steps.phase[0], steps.pairs)
        return sum(solver.energy(*steps.phase)) - 2.0 * turned - gained(place())

    start, places = total(), []
    for tick in range(1, 6):
        steps.advance(tick * 0.1)
        places.append(place())
        assert total() == pytest.approx(start, abs=1e-9 * abs(start))
    assert min(places) < 3.13 < 3.2 < max(places)


def test_comparison_catches_a_slip_of_a_part_in_1e10():
    """Negative control of errors."""
    slips = {
        'spring': lambda x: replace(x, rocker=replace(x.rocker, stiffness=11.0 * SLIP)),
        'over_crank_angle': lambda x: replace(
            x, loads=(replace(x.loads[0], value=(4.0 * SLIP, -3.0, 8.0)),)
        ),
        'friction': lambda x: replace(x, loads=(Friction(0.2, 0.08 * SLIP),)),
    }
    for kind, slip in slips.items():
        mechanism = loaded('across_the_seam', kind)
        assert error(mechanism, [0.8, -3.0], meant=slip(mechanism)) > 5 * CLOSE
