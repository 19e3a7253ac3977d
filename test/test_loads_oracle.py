# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Loads and friction against Newton-Euler in 50 digits, above all in bad places; their work."""

import math
import struct
from dataclasses import replace

import numpy as np
import pytest
from mechanisms import (
    CHANGE_POINTS,
    FULL,
    PUMPS,
    TURN,
    asked_of_oracle,
    at,
    four_bar,
    longest,
    motion,
    moving,
    slider_crank,
)
from mpmath import mp
from oracle import Oracle, oracle_of
from ros_harness import logged

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
from linkage_ros.motion.speed_driven import SpeedMotion
from linkage_ros.numeric import with_turns
from linkage_ros.parameters.configuration import load
from linkage_ros.record import record

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


def with_loads(mechanism, *loads):
    """The mechanism with these loads, and none of its own on the output link."""
    name = 'rocker' if isinstance(mechanism, FourBar) else 'slider'
    part = getattr(mechanism, name)
    bare = replace(part, **dict.fromkeys(part.load_fields, 0.0))
    return replace(mechanism, **{name: bare}, loads=loads)


def loaded(name, *kinds):
    """A mechanism with loads of these kinds."""
    mechanism = MECHANISMS[name]
    if isinstance(mechanism, FourBar):
        spring = with_loads(mechanism, LinkLoad('rocker', stiffness=1.0))
        found = loads_of('rocker', float(oracle_of(spring).middle))
    else:
        found = loads_of('slider', 1.6)
    return with_loads(mechanism, *(found[kind] for kind in kinds))


def errors(mechanism, cranks, speed=2.0, acceleration=1.5, meant=None):
    """The largest errors, each as a part of the peak of its kind over these crank angles.

    Each angle is asked for alone and as one array. The reference is given what is meant, by
    default the same mechanism.
    """
    solver, oracle = Solver(mechanism), oracle_of(meant or mechanism)
    right = [oracle.state(*asked_of_oracle(mechanism, x, speed, acceleration)) for x in cranks]
    together = moving(solver, np.array(cranks), speed, acceleration)
    forces, exerted = solver.reactions(together), solver.load_forces(together)
    found = []
    for i, crank in enumerate(cranks):
        row = {link: float(np.broadcast_to(x, len(cranks))[i]) for link, x in exerted.items()}
        driven = answers(together)[:, i].tolist()
        found.append((right[i], driven, at(forces, i), row))
        state = moving(solver, crank, speed, acceleration)
        driven = answers(state).tolist()
        found.append((right[i], driven, solver.reactions(state), solver.load_forces(state)))
    differences = [difference(oracle, solver.links, *each) for each in found]
    peaks = [size(solver.links, state) for state in right]
    largest = {kind: max(peak[kind] for peak in peaks) for kind in peaks[0]}
    largest['moment'] = largest['force'] * longest(mechanism)
    return {
        kind: max(float(row[kind]) for row in differences) / float(largest[kind] or 1.0)
        for kind in differences[0]
    }


def answers(state):
    """What the drive answers with: the torque, and the accelerations."""
    return np.array(np.broadcast_arrays(state.torque, *state.acceleration))


def size(links, state):
    """What the quantities of a right state are like."""
    return {
        'torque': abs(state.torque),
        'acceleration': max(map(abs, state.acceleration)),
        'force': max(map(abs, state.joints.values())),
        **{link: abs(x) for link, x in zip(links, state.exerted, strict=True)},
    }


def difference(oracle, links, right, driven, forces, exerted):
    """How far the answers are off the right ones."""
    with mp.workdps(60):
        force, moment = oracle.shaking(right)
    pins = [abs(mp.mpc(*x) - right.joints[pin]) for pin, x in forces.pins.items()]
    guide = mp.mpf(forces.guide_force or 0) - right.joints.get('guide', 0)
    shaken = abs(mp.mpc(*forces.shaking_force) - force)
    return {
        'torque': max(abs(mp.mpf(x) - right.torque) for x in (driven[0], forces.torque)),
        'acceleration': max(
            abs(mp.mpf(x) - y) for x, y in zip(driven[1:], right.acceleration, strict=True)
        ),
        'force': max(*pins, abs(guide), shaken),
        'moment': abs(forces.shaking_moment - moment),
        **{
            link: abs(exerted.get(link, 0.0) - x)
            for link, x in zip(links, right.exerted, strict=True)
        },
    }


KINDS = tuple(loads_of('rocker', 0.0))


@pytest.mark.parametrize('kind', KINDS)
@pytest.mark.parametrize('name', ['across_the_seam', 'offset_right'])
def test_each_load_gives_the_torque_and_forces_of_newton_and_euler(name, kind):
    found = errors(loaded(name, kind), [0.8, -3.0])
    assert max(found.values()) < CLOSE, found


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
    found = errors(mechanism, [-4.1, 1.3], speed, acceleration)
    assert max(found.values()) < CLOSE, found


def test_recorded_torque_is_that_of_newton_and_euler(tmp_path):
    configuration = load('quadrilateral')
    curve = LoadCurve('rocker', 'position', (1.0, 2.0), (9.0, -4.0), (-9.0, 3.0))
    loads = LinkLoad('rocker', -3.0, 0.4, 25.0, 0.9), curve, Friction(0.15, 0.02)
    mechanism = replace(configuration.mechanism, loads=loads)
    configuration = replace(configuration, mechanism=mechanism)
    record(configuration, tmp_path / 'run.mcap', duration=0.4)
    log, messages = logged(tmp_path / 'run.mcap')
    assert log.configuration == configuration
    oracle, drive = Oracle(mechanism), SpeedMotion.begin(configuration.drive, 0)
    found = []
    for message in messages['/driving_torque'][::16]:
        (q,), (u,), (a,), *_ = drive.at(message.time)
        (torque,) = struct.unpack('<d', message.data[4:])
        found.append((torque, oracle.state(q, u, a).torque))
    assert len(found) == 5
    peak = max(abs(right) for _, right in found)
    assert max(abs(torque - right) for torque, right in found) < CLOSE * peak


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
    found = errors(curve(points, value), cranks, -2.0)
    assert max(found.values()) < 2e-13, found


def test_curves_over_a_position_at_their_points():
    cranks = [0.4, 1.9, 4.0]
    bare = Solver(curve((0.0,), (0.0,)))
    places = sorted(bare.state(crank).position[2] for crank in cranks)
    steep = (places[0], places[1], places[1] + 1e-4)
    for speed in (2.0, -2.0):
        for points in (places, steep):
            loads = curve(points, (5.0, -7.0, 30.0), 'position', return_value=(0.0, 2.0, -4.0))
            found = errors(loads, cranks, speed)
            assert max(found.values()) < 1e-11, found


@pytest.mark.parametrize('turns', [-3, 0, 1])
def test_places_on_a_rocker_count_without_whole_turns(turns):
    mechanism = loaded('across_the_seam', 'over_position')
    (curve,) = mechanism.loads
    moved = replace(curve, at=tuple(x + turns * TURN for x in curve.at))
    rest = float(Oracle(mechanism).middle) + 0.4 + turns * TURN
    mechanism = replace(mechanism, loads=(moved, LinkLoad('rocker', stiffness=9.0, rest=rest)))
    found = errors(mechanism, [0.4, 3.9])
    assert max(found.values()) < 1e-13, found


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
        found = errors(rubs(share), [crank])
        assert max(found.values()) < CLOSE, found
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


@pytest.mark.parametrize('kind', KINDS)
@pytest.mark.parametrize('name', ['across_the_seam', 'offset_left'])
def test_work_of_the_drive_over_the_period_is_that_of_the_loads(name, kind):
    """What the loads exert may jump; the sum of all powers does not, and is integrated exactly."""
    solver, speed = Solver(loaded(name, kind)), -3.0
    cranks = np.linspace(0.0, TURN * solver.reach.period_turns, 1440, endpoint=False)
    state = solver.state(cranks, speed)
    links = dict(zip(solver.links, state.velocity, strict=True))
    powers = [force * links[link] for link, force in solver.load_forces(state).items()]
    driven = state.torque * speed
    assert abs(np.mean(driven) + sum(map(np.mean, powers))) < 1e-10 * np.max(np.abs(powers))
    lost = kind in ('damping', 'friction')
    assert np.mean(driven) > 0.01 if lost else np.max(np.abs(powers)) > 0.1


@pytest.mark.parametrize('name', MECHANISMS)
def test_a_torque_accelerates_as_newton_and_euler_say(name):
    mechanism = loaded(name, *KINDS[3:-1])
    link = 'rocker' if isinstance(mechanism, FourBar) else 'slider'
    mechanism = replace(mechanism, loads=(*mechanism.loads, LinkLoad(link, 3.0, 0.7, 11.0, 0.4)))
    solver = Solver(mechanism)
    q, u, _ = motion(mechanism, 0.8)
    found = solver.accelerations(q, u, 5.0)
    given = (q, u, 5.0) if len(q) > 1 else (0.8, u[0], found[0])
    right = Oracle(mechanism).state(*given)
    links = [solver.links.index(link) for link in solver.coordinates]
    for link, x in zip(links, found, strict=True):
        assert abs(x - right.acceleration[link]) <= CLOSE * abs(x)
    assert abs(right.torque - 5.0) < CLOSE * max(map(abs, right.exerted))


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
        found = errors(mechanism, [0.8, -3.0], meant=slip(mechanism))
        assert max(found.values()) > 5 * CLOSE
