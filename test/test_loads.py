# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Laws of loads, friction and conditions, each over every mechanism.

The references: Newton's and Euler's equations of all bodies in absolute coordinates (`oracle.py`),
and, for a base_link that turns, d'Alembert's principle with positions in the world's axes, whose
derivatives are taken numerically. It knows no Coriolis terms.
"""

import cmath
import math
import pickle
from dataclasses import fields, replace
from itertools import chain

import numpy as np
import pytest
from mechanisms import (
    CHANGE_POINTS,
    CYLINDERS,
    FULL,
    LIMITED,
    PUMPS,
    SEVERAL_FORCES,
    SPRUNG_PUMP,
    SPRUNG_ROCKER,
    SPRUNG_SLIDER,
    TURN,
    force_errors,
    four_bar,
    motion,
    rows,
    slider_crank,
    with_loads,
    worst_errors,
)
from mpmath import mp
from oracle import Oracle

from linkage_ros import (
    Conditions,
    ConfigurationError,
    Force,
    Friction,
    Gas,
    LinkLoad,
    LoadCurve,
    MechanismError,
    Pins,
    Solver,
    Spring,
    UnreachableError,
    travel,
)
from linkage_ros.formulas import dot, number
from linkage_ros.mechanism.axes import spin_of
from linkage_ros.mechanism.kinematics import LinkPose
from linkage_ros.mechanism.loads.gas import GasForce
from linkage_ros.mechanism.wrenches import FRAME, poses, velocity
from linkage_ros.quantities import build, flatten
from linkage_ros.settings.configuration import load
from linkage_ros.view.picture import Picture

CLOSE = 1e-11
MACHINES = {
    'four_bar': four_bar(FULL['crank_rocker'], 1.3),  # its rocker swings across pi
    'slider_crank': slider_crank(FULL['offset_right'], 5.5, 'crossed'),
    'wind_pump': PUMPS['pump'],
    'cylinder': CYLINDERS['swinging_barrel'],
    'driven_cylinder': replace(CYLINDERS['swinging_barrel'], input='cylinder', assembly='crossed'),
}
LINKS = {
    name: tuple(x.name for x in machine.structure().links) for name, machine in MACHINES.items()
}
OTHERS = {  # of the same kinds
    'four_bar': four_bar(CHANGE_POINTS['p0'], 0.2, 'crossed'),
    'slider_crank': slider_crank(FULL['offset_left'], -1.1),
    'wind_pump': PUMPS['pump_open'],
}
CYLINDER_NAMES = 'cylinder', 'driven_cylinder'
FRICTION = {
    'four_bar': Friction(0.2, 0.08),
    'slider_crank': Friction(0.1, 0.05, 0.2),
    'cylinder': Friction(0.1, 0.05, 0.2),
    'driven_cylinder': Friction(0.1, 0.05, 0.2),
}
RISE, FALL = (5.0, -7.0, 30.0), (0.0, 2.0, -4.0)


def around(name, link):
    """Returns loads of one link, with corners in its swing."""
    middle = MACHINES[name].swing_middle('', 0.0) or 1.6
    places = tuple(middle + x for x in (-0.4, 0.05, 0.3))
    return [
        LinkLoad(link, 3.0),
        LinkLoad(link, damping=0.7),
        LinkLoad(link, stiffness=11.0, rest=middle + 0.4),
        LoadCurve(link, 'position', places, RISE, FALL),
        LoadCurve(link, 'position', places, RISE),
        LoadCurve(link, at=(0.5, 2.0, 6.0), value=(4.0, -3.0, 8.0)),
        LinkLoad('crank', -2.0, 0.3),
        LoadCurve('crank', at=(-7.0, -5.0), value=(2.0, 9.0)),
    ]


CASES = [
    *((name, x) for name, link in (('four_bar', 'rocker'), ('slider_crank', 'slider'),
                                   ('wind_pump', 'slider')) for x in around(name, link)),
    *FRICTION.items(),
    *((name, Force(link, (30.0, -50.0), (0.2, -0.3), axes))
      for name, links in LINKS.items() for link in links for axes in ('world', 'link')),
    *((name, Spring(link, (0.2, 0.1), to, (-0.4, 0.9), 80.0, 0.3, 5.0))
      for name, links in LINKS.items()
      for i, link in enumerate(links) for to in (*links[i + 1:], 'frame')),
    ('four_bar', Spring('coupler', (0.2, 0.1), 'frame', (0.4, 0.3), 80.0)),
    *((name, Pins(7.0, pin)) for name, pins in (
        ('four_bar', ('', 'A0', 'A', 'B', 'B0')), ('slider_crank', ('', 'A0', 'A', 'B')),
        ('wind_pump', ('', 'A0', 'A', 'B', 'D')), ('cylinder', ('', 'A0', 'A', 'B0')),
        ('driven_cylinder', ('', 'A0', 'A', 'B0')))
      for pin in pins),
    *((name, Gas('rod', 0.2, 0.1, 1e5, outlet, 1.3, 0.9e5, top)) for name in CYLINDER_NAMES
      for outlet in (None, 1.5e5) for top in ('far', 'near')),
    *(('slider_crank', Gas('slider', 0.2, 0.1, 1e5, outlet, exponent, 0.9e5, top))
      for outlet in (None, 1.5e5) for exponent in (1.0, 1.3) for top in ('far', 'near')),
    *((name, LoadCurve('crank', at=(-7.0, -5.0, 1.5), value=(2.0, 9.0, -4.0)))
      for name in LINKS),
    ('slider_crank', LoadCurve('slider', at=(0.5, 4.0, 0.5 + 2 * TURN), value=(4.0, -9.0, 4.0))),
    *((name, load) for name in CYLINDER_NAMES for load in (
        LoadCurve('rod', at=(0.5, 4.0, 9.0), pressure=(1e5, 5e5, 9e4), bore=0.1),
        LoadCurve('rod', 'position', (1.5, 2.5, 3.3), (5.0, -7.0, 30.0), (0.0, 2.0, -4)))),
    ('slider_crank', LoadCurve('slider', at=(0.5, 4.0, 9.0), pressure=(1e5, 5e5, 9e4), bore=0.1)),
    *((name, LoadCurve(link, 'crank_angle_from_tdc', at, top=top, **values))
      for name, link in (('slider_crank', 'slider'), ('cylinder', 'rod'),
                         ('driven_cylinder', 'rod'))
      for at in ((-0.3, 0.0, 2.0), (-0.3, 1.4, 9.0)) for top in (None, 'near')
      for values in ({'value': (4.0, -9.0, 3.0)}, {'pressure': (1e5, 5e5, 9e4), 'bore': 0.1})),
]  # fmt: skip
# One load of each kind; those of the first list have a potential, the others take energy.
CONSERVING = {
    'four_bar': [*around('four_bar', 'rocker')[::4], around('four_bar', 'rocker')[2],
                 Spring('coupler', (0.2, 0.1), 'frame', (0.4, 2.3), 80.0, 0.3),
                 Force('coupler', (3.0, -5.0), (0.2, 0.1))],
    'slider_crank': [*around('slider_crank', 'slider')[::4], around('slider_crank', 'slider')[2],
                     Gas('slider', 0.2, 0.3, 1e4, exponent=1.3),
                     Spring('crank', (0.2, 0.1), 'slider', (0.4, 0.3), 80.0),
                     Force('slider', (3.0, -5.0), (0.2, 0.1), 'link')],
    'cylinder': [Gas('rod', 0.2, 0.3, 1e4, exponent=1.3),
                 Spring('crank', (0.2, 0.1), 'rod', (0.4, 0.3), 80.0, 0.3, 0.0),
                 Force('barrel', (3.0, -5.0), (0.2, 0.1))],
    'wind_pump': [*around('wind_pump', 'slider')[::4], around('wind_pump', 'slider')[2],
                  Spring('crank', (0.2, 0.1), 'rod', (0.4, 0.3), 80.0, 0.3, 0.0),
                  Spring('rod', (0.2, 0.1), 'frame', (0.4, 0.9), 30.0)],
}  # fmt: skip
CONSERVING['driven_cylinder'] = CONSERVING['cylinder']
LOSING = {
    'four_bar': [Pins(0.7), Spring('rocker', (0.2, 0.1), 'frame', (0.4, 2.3), 0.0, 0.3, 4.0),
                 *around('four_bar', 'rocker')[1::2]],
    'slider_crank': [Pins(0.7), Gas('slider', 0.2, 0.3, 1e4, 2e4, exponent=1.3),
                     *around('slider_crank', 'slider')[1::2]],
    'cylinder': [Pins(0.7), Gas('rod', 0.2, 0.3, 1e4, 2e4, exponent=1.3)],
    'wind_pump': [Pins(0.2), Spring('coupler', (0.2, 0.1), 'frame', (0.4, 2.3), 0.0, 0.3, 4.0),
                  *around('wind_pump', 'slider')[1::2]],
}  # fmt: skip
LOSING['driven_cylinder'] = LOSING['cylinder']


def error(mechanism, cranks, speed=2.0, acceleration=1.5, meant=None):
    """Computes the largest error of any quantity; the reference solves the mechanism `meant`."""
    solver = Solver(mechanism)
    solver.mechanism = meant or mechanism
    states = worst_errors(solver, cranks, speed, acceleration, period=0, floor=1e-2)
    return max(*states, *force_errors(solver, cranks, speed, acceleration))


# ---------------------------------------------------------------- against the oracle


@pytest.mark.parametrize(('name', 'load'), CASES, ids=lambda x: getattr(x, 'label', x))
def test_each_load_on_each_link_gives_the_forces_of_newton_and_euler(name, load):
    solver = Solver(replace(MACHINES[name], loads=(load,)))
    assert max(force_errors(solver, [0.8, -3.0])) < CLOSE


@pytest.mark.parametrize('axes', ['world', 'link'])
def test_comparison_detects_a_point_that_is_a_nanometre_off(axes):
    loads = [Force('coupler', (30.0, -50.0), (0.2, y), axes) for y in (0.3, 0.3 + 1e-9)]
    right, wrong = (replace(MACHINES['four_bar'], loads=(x,)) for x in loads)
    assert error(right, [0.8], meant=wrong) > CLOSE


@pytest.mark.parametrize(('machines', 'speed', 'acceleration'), [
    (MACHINES, 2.0, 1.5), (MACHINES, -40.0, 1.5), (MACHINES, 0.0, -1.5), (MACHINES, 150.0, 1e3),
    (OTHERS, -2.0, 1.5),
], ids=lambda x: '' if isinstance(x, dict) else x)  # fmt: skip
def test_all_loads_at_once_in_either_direction_and_at_rest(machines, speed, acceleration):
    for name, machine in machines.items():
        loads = [load for owner, load in CASES if owner == name]
        if machines is OTHERS:  # without the gas, whose stroke is another
            loads = [x for x in loads if not isinstance(x, Gas)]
        found = error(replace(machine, loads=tuple(loads)), [-4.1, 1.3, 9.0], speed, acceleration)
        assert found < CLOSE, name


def curve(points, value, over='crank_angle', **more):
    bare = slider_crank(FULL['offset_right'], 0.3)
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
    """Forces reach 1e3 times those without friction; beyond, the reference has no solution."""
    name = 'guide' if friction.guide == 1.0 else 'pin_radius'

    def rubs(share):
        rubbing = replace(friction, **{name: share * locks})
        return with_loads(MACHINES['slider_crank'], rubbing)

    for share in (0.8, 0.999):
        assert error(rubs(share), [crank]) < CLOSE
    Solver(rubs(1 - 1e-9)).state(crank, 2.0, 1.5)
    with pytest.raises(UnreachableError, match='friction locks the mechanism: no joint forces'):
        Solver(rubs(1 + 1e-9)).state(crank, 2.0, 1.5)
    with pytest.raises(ArithmeticError, match='no friction'):
        Oracle(rubs(1 + 1e-6)).state(crank, 2.0, 1.5)


def test_strong_friction_that_does_not_lock_is_solved_in_many_small_steps():
    """It takes more than 1000 rounds; a lock was reported there, where the forces are small."""
    bare = slider_crank(FULL['short_coupler'], -0.0144)
    for friction in (Friction(23.15, 0.05, 23.15), Friction(30.0, 0.05, 30.0)):
        assert error(with_loads(bare, friction), [1.613]) < CLOSE


def test_frictions_act_together_and_are_told_apart_by_name():
    """Two coefficients for all pins act like their sum, in proportion."""
    mechanism = with_loads(MACHINES['slider_crank'], Friction(0.1, 0.05, 0.2, name='a'))
    cranks = np.linspace(-6.0, 6.5, 101)
    state = Solver(mechanism).state(cranks, 2.0, 1.5)
    parts = Friction(0.04, 0.05, name='worn'), Friction(0.06, 0.05, 0.2, name='dry')
    solver = Solver(with_loads(mechanism, *parts))
    found = solver.state(cranks, 2.0, 1.5)
    assert np.allclose(found.torque, state.torque, rtol=1e-12)
    wrenches = solver.wrenches(found)
    assert [*wrenches] == ['dry', 'worn']
    crank = [sum(x.effort for x in wrenches[name] if x.body == 0) for name in wrenches]
    assert np.allclose(crank[1] * 0.06, crank[0] * 0.04, rtol=1e-12)


# ---------------------------------------------------------------- the swing of a rocker


@pytest.mark.parametrize(
    'lengths', [(1, 3, 2.5, 2.2), (2, 1.5, 1.6, 2.2), LIMITED['triple_rocker_near']]
)
@pytest.mark.parametrize('angle', [0.0, 1.3, math.pi, -2.5])
@pytest.mark.parametrize('assembly', ['open', 'crossed'])
def test_the_middle_of_the_swing_is_between_its_ends(lengths, angle, assembly):
    mechanism = four_bar(lengths, angle, assembly)
    solver = Solver(mechanism)
    (start, end), *_ = solver.reach.arcs
    inside = 1e-6 * (end - start)
    cranks = np.linspace(start + inside, end - inside, 20_001)
    swung = np.unwrap(solver.state(cranks).position[2])
    middle = mechanism.swing_middle('', 0.0)
    assert abs(middle) <= math.pi
    low, high = swung.min(), swung.max()
    if solver.reach.turns_fully:
        assert math.remainder(0.5 * (low + high) - middle, TURN) == pytest.approx(0, abs=1e-6)
    turns = TURN * round((0.5 * (low + high) - middle) / TURN)
    assert middle - math.pi < low - turns < high - turns < middle + math.pi


@pytest.mark.parametrize('angle', [0.3, 3.0])
def test_spring_and_curve_of_a_double_rocker_are_reduced_to_the_swing_of_each_circuit(angle):
    """Each arc of the crank is a circuit: the rocker stays on one side of the frame's line."""
    bare = with_loads(four_bar(LIMITED['double_rocker_two_arcs'], angle))
    arcs = Solver(bare).reach.arcs
    assert len(arcs) == 2
    for low, high in arcs:
        cranks = np.linspace(low, high, 402)[1:-1]
        both = [
            Solver(replace(bare, assembly=assembly)).state(cranks).position[2]
            for assembly in ('open', 'crossed')
        ]
        swung = np.unwrap(np.concatenate([both[0], both[1][::-1]]))
        middle = 0.5 * (swung.min() + swung.max())
        for rest in np.linspace(-9.0, 9.0, 61).tolist():
            near = middle + math.remainder(rest - middle, TURN)
            spring = Solver(with_loads(bare, LinkLoad('rocker', stiffness=2.0, rest=rest)))
            state = spring.state(cranks)
            pull = spring.load_forces(state)['rocker']
            assert pull == pytest.approx(-2.0 * (swung[:400] - near), abs=1e-9)
            points, value = (rest - 0.5, rest + 0.5), (3.0, 8.0)
            curve = Solver(with_loads(bare, LoadCurve('rocker', 'position', points, value)))
            push = curve.load_forces(curve.state(cranks))['rocker']
            expected = np.interp(swung[:400], (near - 0.5, near + 0.5), value)
            assert push == pytest.approx(expected, abs=1e-9)


def test_torque_on_a_rocker_that_turns_fully_has_no_potential():
    bare = four_bar(FULL['double_crank'])
    loads = with_loads(bare), with_loads(bare, LinkLoad('rocker', 7.0))
    energies = [x.energy(x.state(np.linspace(-6.0, 6.5, 101), 2.0)) for x in map(Solver, loads)]
    assert np.array_equal(*energies)


# ---------------------------------------------------------------- energy


@pytest.mark.parametrize('loses', [False, True])
@pytest.mark.parametrize('name', LINKS)
def test_energy_grows_by_the_work_of_the_motor_and_of_loads_without_a_potential(name, loses):
    losing = LOSING[name] if loses else []
    mechanism = with_loads(MACHINES[name], *CONSERVING[name], *losing)
    solver, other = Solver(mechanism), Solver(with_loads(mechanism, *losing))
    bare, torque = Solver(with_loads(mechanism, *CONSERVING[name])), 4.0
    taken = []
    for crank in np.linspace(-6.0, 6.5, 25).tolist():
        q, u, _ = motion(mechanism, crank)
        a, step = solver.accelerations(q, u, torque), 1e-4

        def energy(time, q=q, u=u, a=a):
            moved = [x + time * (y + 0.5 * time * z) for x, y, z in zip(q, u, a, strict=True)]
            rates = [y + time * z for y, z in zip(u, a, strict=True)]
            return sum(bare.energy(bare.state(tuple(moved), tuple(rates))))

        power = sum(
            factor * (energy(i * step) - energy(-i * step))
            for i, factor in ((1, 45.0), (2, -9.0), (3, 1.0))
        ) / (60 * step)  # fmt: skip
        state = solver.state(q, u, a)
        own = other.load_forces(state)
        work = sum(float(x) * state.velocity[solver.links.index(y)] for y, x in own.items())
        taken.append(abs(work))
        size = abs(torque * u[0]) + abs(work) + abs(energy(0.0)) + abs(power)
        assert power == pytest.approx(torque * u[0] + work, abs=1e-9 * size)
    assert (max(taken) > 0.1) == loses


@pytest.mark.parametrize('clearance', [1e-7, 1e-3, 10.0])
@pytest.mark.parametrize(
    'exponent', [1.0, *(1.0 + sign * 10.0**-k for k in range(1, 17) for sign in (-1, 1))]
)
def test_energy_of_a_closed_gas_has_all_digits_near_an_isothermal_one(exponent, clearance):
    """At 1 + 1e-16, the exponent is 1."""
    area, inlet, largest = 0.03, 1e5, clearance + 0.2
    gas = GasForce(0, area, 1.0, 0.0, clearance, largest, inlet, None, exponent, 0.0)
    for share in (0.0, 1e-6, 0.3, 0.9):
        place = -share * 0.2
        (found, *_) = gas.potential([LinkPose(np.array([place]), None, None, None)])
        assert gas.potential([LinkPose(place, None, None, None)]) == pytest.approx(
            found, rel=2e-15
        )
        with mp.workdps(50):
            volumes = [mp.mpf(area) * mp.mpf(x) for x in (largest, clearance - place)]
            ratio, extra = volumes[0] / volumes[1], mp.mpf(exponent) - 1
            work = (ratio**extra - 1) / extra if extra else mp.log(ratio)
            assert abs(found / (inlet * volumes[0] * work) - 1) < 2e-15


# ---------------------------------------------------------------- conditions

# A hip at 5 rad/s and 40 rad/s^2.
HIP = 0.7, 5.0, 40.0
PIVOT = 0.3, -0.4
KNEE = 2.0, 1.5
LEGS = {name: with_loads(MACHINES[name]) for name in ('four_bar', 'slider_crank', 'cylinder')}
FORCES = {'push': (3.0, -50.0), 'pull': (-7.0, 2.0)}
REST = {'push': (1.0, 2.0), 'pull': (0.0, -1.0)}
PUMP = (1.1, 2.3), (2.0, -0.3), (1.5, 0.4)


def loaded(mechanism, forces=FORCES):
    """Adds a force of each direction to two links."""
    first, last = (mechanism.structure().links[i].name for i in (1, -1))
    loads = (
        Force(first, forces['push'], (0.1, 0.2), name='push'),
        Force(last, forces['pull'], (0.0, 0.3), 'link', name='pull'),
    )
    return replace(mechanism, loads=(*mechanism.loads, *loads))


class World:
    """The machine on a base_link that turns about a pivot, seen from the world."""

    def __init__(self, mechanism, crank):
        self.oracle = Oracle(mechanism)
        self.bodies = self.oracle.parts.values()
        self.crank, self.gravity = crank, mp.mpc(*mechanism.gravity)

    def _parts(self, crank, hip):
        """Returns the centre and the direction of each body in the world."""
        bodies, turn = self.oracle.placed(crank), mp.expj(hip)
        places = [bodies[name].point(self.oracle.center(name))[0] for name in self.oracle.parts]
        centers = [turn * (place - mp.mpc(*PIVOT)) for place in places]
        return centers, [turn * bodies[name].way for name in self.oracle.parts]

    def needed(self):
        """Returns the torque on the crank, and the force on each body in base_link's axes."""
        (hip, hip_rate, hip_change), (rate, change) = HIP, KNEE

        def at(t, step=0):
            t = mp.mpf(t)
            return self._parts(
                self.crank + rate * t + change * t * t / 2 + step,
                hip + hip_rate * t + hip_change * t * t / 2,
            )

        torque, forces = mp.mpf(0), []
        for j, body in enumerate(self.bodies):
            acceleration = mp.diff(lambda t, j=j: at(t)[0][j], 0, 2)
            lever = mp.diff(lambda step, j=j: at(0, step)[0][j], 0)
            force = body.mass * (acceleration - self.gravity)
            torque += (mp.conj(lever) * force).real
            forces.append(force * mp.expj(-hip))
            inertia = getattr(body, 'inertia', 0)
            if inertia:
                spin = mp.diff(lambda t, j=j: mp.log(at(t)[1][j]).imag, 0, 2)
                turned = mp.diff(lambda step, j=j: mp.log(at(0, step)[1][j]).imag, 0)
                torque += inertia * spin * turned
        return torque, forces


@pytest.mark.parametrize('name', LEGS)
def test_turning_base_against_the_whole_machine_in_the_world(name):
    leg = LEGS[name]
    solver = Solver(leg, pivot=PIVOT)
    cranks = np.linspace(0.4, 5.9, 4)
    state = solver.state(cranks, *KNEE, under=Conditions(frame=HIP))
    found = solver.reactions(state)
    at_rest = solver.state(cranks, *KNEE)
    torques = []
    for i, crank in enumerate(cranks):
        with mp.workdps(50):
            torque, forces = World(leg, crank).needed()
        torques.append(float(torque))
        shaking = complex(*(part[i] for part in found.shaking_force))
        assert shaking == pytest.approx(-complex(sum(forces)), rel=1e-11)
        for j, body in enumerate(solver.structure.links):
            if body.slides or name == 'cylinder':
                continue
            given = 0j
            for pin in solver.structure.pins:
                force = complex(*(part[i] for part in found.pins[pin.name]))
                given += force * ((pin.second == j) - (pin.first == j))
            assert given == pytest.approx(complex(forces[j]), rel=1e-11, abs=1e-11)
    peak = max(map(abs, torques))
    assert state.torque == pytest.approx(torques, abs=1e-11 * peak)
    assert found.torque == pytest.approx(torques, abs=1e-11 * peak)
    alone = solver.torque(cranks, *KNEE, under=state.conditions)
    assert alone == pytest.approx(torques, abs=1e-11 * peak)
    assert max(abs(at_rest.torque - torques)) > 0.3 * peak  # the frame matters


def test_conditions_are_equal_and_pickle_whatever_the_order_of_their_forces():
    one, other = (
        Conditions([1.0, 2.0], HIP, {name: FORCES[name] for name in names})
        for names in (('push', 'pull'), ('pull', 'push'))
    )
    assert one == other == pickle.loads(pickle.dumps(one)) == replace(one)
    assert one.values == [1.0, 2.0, *HIP, *FORCES['pull'], *FORCES['push']]
    assert hash(one) == hash(other)
    assert not Conditions()


def virtual_power(solver, state, wrenches, levers):
    """Returns the power of wrenches at the given rates of all links."""
    bodies = solver.structure.links
    links, found = poses(bodies, state.position), 0.0
    for wrench in chain.from_iterable(wrenches.values()):
        if wrench.body != FRAME:
            found = found + number(wrench.effort) * levers[wrench.body]
            spin = spin_of(bodies, wrench.body)
            found = found + number(wrench.couple) * (0.0 if spin is None else levers[spin])
            if wrench.point is not None:
                found = found + dot(wrench.force, velocity(wrench.point, links, levers))
    return found


ALL_KINDS = {
    **{name: with_loads(x, *CONSERVING[name], *LOSING[name]) for name, x in MACHINES.items()},
    'sprung_rocker': SPRUNG_ROCKER,
    'sprung_slider': SPRUNG_SLIDER,
    'sprung_pump': SPRUNG_PUMP,
    **{name: load(name).mechanism for name in ('compressor', 'excavator', 'shaper', 'watt')},
}


@pytest.mark.parametrize('size', [None, 3])
@pytest.mark.parametrize('friction', [False, True])
@pytest.mark.parametrize('name', ALL_KINDS)
def test_all_methods_agree_under_the_same_conditions(name, friction, size):
    machine = loaded(ALL_KINDS[name], REST)
    rub = (Friction(pin=0.1, pin_radius=0.02 * machine.crank.length),) if friction else ()
    solver = Solver(replace(machine, loads=(*machine.loads, *rub)), pivot=PIVOT)
    bare = Solver(replace(machine, loads=()), pivot=PIVOT)
    if len(machine.coordinates) > 1:
        motion = PUMP
    else:
        low, high = solver.reach.arcs[0]
        motion = (0.3 * low + 0.7 * high,), (2.0,), (1.5,)

    def sized(row):
        return tuple(x if size is None else x * np.linspace(1.0, 1.1, size) for x in row)

    q, u, a = motion[0], *map(sized, motion[1:])
    under = Conditions(
        sized((-3.0, 5.0)), sized(HIP), {key: sized(x) for key, x in FORCES.items()}
    )

    def close(one, other):
        assert one == pytest.approx(other, rel=1e-9, abs=1e-9 * scale)

    state, scale = solver.state(q, u, a, under=under), 1.0
    plain = Solver(solver.mechanism, pivot=PIVOT, traced=False).state(q, u, a, under=under)
    assert rows(plain).tobytes() == rows(state).tobytes()
    for other in (
        Conditions(), replace(under, gravity=None), replace(under, frame=None),
        replace(under, forces=()),
    ):  # fmt: skip
        found = solver.torque(q, u, a, under=other)
        assert np.all(np.abs(found / state.torque - 1) > 1e-6)
    scale = np.max(np.abs(state.torque))
    close(solver.torque(q, u, a, under=under), state.torque)
    close(solver.torque(q, u, a), solver.state(q, u, a).torque)
    close(solver.reactions(state).torque, state.torque)
    # A virtual motion of the first coordinate: the torque carries the loads and the rest.
    levers = solver.state(q, (1.0, *(0.0 for _ in q[1:]))).velocity
    rest = bare.torque(q, u, a, under=replace(under, forces=()))
    wrenches, exerted = solver.wrenches(state), solver.load_forces(state)
    close(rest - virtual_power(solver, state, wrenches, levers), state.torque)
    powers = [force * levers[solver.links.index(link)] for link, force in exerted.items()]
    close(rest - sum(powers), state.torque)
    sums = solver.exerted(state).forces
    for link in solver.links:
        pushes = [x for row in wrenches.values() for x in row if solver.links[x.body] == link]
        for i in range(2):
            close(
                sum(number(x.force[i]) for x in pushes if x.body != FRAME and x.point is not None),
                sum(x.force[i] for x in sums.values() if x.link == link),
            )
    if not friction:
        found = solver.accelerations(q, u, state.torque, under=under)
        again, driven = (
            solver.state(q, u, found, under=under),
            solver.driven_state(q, u, state.torque, under=under),
        )
        close(again.torque, state.torque)
        close(np.array(driven.acceleration), np.array(again.acceleration))
        assert driven.conditions == again.conditions == under
        torque, *row = (float(np.ravel(x)[0]) for x in (state.torque, *q, *u, *under.values))
        law = solver.driven_by(lambda _: torque, under)
        close(law(*row), [np.ravel(x)[0] for x in found])


@pytest.mark.parametrize('name', ALL_KINDS)
def test_energy_and_forces_are_those_of_a_machine_with_these_conditions_of_its_own(name):
    """A tilted base_link only turns gravity; a given force counts as constant."""
    gravity, tilt = (-3.0, 5.0), 0.7
    turned = complex(*gravity) * cmath.exp(-1j * tilt)
    given, own = (Solver(loaded(ALL_KINDS[name], forces)) for forces in (REST, FORCES))
    own = Solver(replace(own.mechanism, gravity=(turned.real, turned.imag)))
    under = Conditions(gravity, (tilt, 0.0, 0.0), FORCES)
    for share in (0.3, 0.5):
        q, u, a = PUMP
        if len(given.coordinates) == 1:
            low, high = given.reach.arcs[0]
            q, u, a = ((1 - share) * low + share * high,), (2.0,), (1.5,)
        pair = (given, given.state(q, u, a, under=under)), (own, own.state(q, u, a))
        energy, same = (x.energy(state) for x, state in pair)
        assert energy == pytest.approx(same, rel=1e-12, abs=1e-12)
        pins, same = (np.array([*x.reactions(state).pins.values()]) for x, state in pair)
        assert np.abs(pins - same).max() < 1e-11 * np.abs(pins).max()
    with pytest.raises(ConfigurationError, match='frame'):
        given.energy(given.state(q, u, under=replace(under, frame=HIP)))


@pytest.mark.parametrize('method', ['accelerations', 'driven_state', 'driven_by'])
def test_friction_is_refused_where_the_torque_is_given(method):
    solver = Solver(replace(LEGS['four_bar'], loads=(Friction(pin=0.1, pin_radius=0.05),)))
    given = (lambda _: 3.0,) if method == 'driven_by' else (1.0, 2.0, 3.0)
    with pytest.raises(MechanismError, match='leave friction out'):
        getattr(solver, method)(*given)


def test_a_mechanism_without_them_keeps_its_program():
    for leg in LEGS.values():
        solver = Solver(leg)
        before = solver.source
        solver.state(1.0, *KNEE, under=Conditions(frame=HIP))
        assert solver.source == before == Solver(leg).source
        assert 'frame' not in before


@pytest.mark.parametrize(('given', 'words'), [
    ({'frame': (math.nan, 0.0, 0.0)}, 'frame angle = nan'),
    ({'frame': (0.0, math.inf, 0.0)}, 'frame speed = inf'),
    ({'frame': (0.0, 0.0, -math.inf)}, 'frame acceleration = -inf'),
    ({'frame': (0.0, 1e200, 0.0)}, 'overflows'),
    ({'frame': (0.0, 1.0)}, 'must be (angle, speed, acceleration)'),
    ({'gravity': (0.0, math.nan)}, 'gravity y = nan'),
    ({'gravity': 9.81}, 'must be (x, y), m/s^2'),
    ({'forces': {'push': (math.nan, 0.0)}}, 'push x = nan'),
    ({'forces': {'push': (0.0,)}}, 'must be [x, y], N'),
    ({'forces': {'push': (0.0, 1.0, 2.0)}}, 'must be [x, y], N'),
    ({'forces': {'shove': (0.0, 1.0)}}, 'the mechanism has pull, push'),
])  # fmt: skip
@pytest.mark.parametrize('friction', [False, True])
def test_wrong_values_are_refused(given, words, friction):
    leg = loaded(LEGS['four_bar'])
    if friction:
        leg = replace(leg, loads=(*leg.loads, Friction(pin=0.1, pin_radius=0.05)))
    solver = Solver(leg)
    with pytest.raises(ConfigurationError) as error:
        solver.state(1.0, *KNEE, under=Conditions(**given))
    assert words in str(error.value)
    if 'must be' not in words and 'overflows' not in words:
        state = solver.state(1.0, *KNEE)._replace(conditions=Conditions(**given))
        for method in (solver.reactions, solver.wrenches, solver.load_forces):
            with pytest.raises(ConfigurationError) as error:
                method(state)
            assert words in str(error.value)


# ---------------------------------------------------------------- wrenches, arrows, parameters


def test_forces_of_one_load_at_one_point_add_and_others_have_names_of_their_own():
    mechanism = replace(MACHINES['four_bar'], loads=(SEVERAL_FORCES, LinkLoad('crank', 3.0)))
    solver, point = Solver(mechanism), mechanism.structure().point_of(1, (0.3, 0.0))
    state = solver.state(np.linspace(0.5, 6.0, 4), 2.0)
    exerted = solver.exerted(state)
    assert exerted.efforts == {'crank': 3.0, 'coupler': 6.0, 'rocker': 2.0}
    assert {name: found.force for name, found in exerted.forces.items()} == {
        'tool on coupler': (15.0, 3.0),
        'tool on coupler 2': (0.0, 7.0),
        'tool on rocker': (0.0, -7.0),
    }
    place = point.fixed + np.array(point.weights) @ np.exp(1j * np.array(state.position))
    x, y = exerted.forces['tool on coupler 2'].at
    assert x + 1j * y == pytest.approx(place, rel=1e-12)
    # The generalised forces, in contrast, include the levers of these forces.
    assert solver.load_forces(state)['crank'] != pytest.approx(3.0)


def test_arrows_stand_at_the_points_of_forces():
    force = Force('coupler', (30.0, -40.0), (0.2, 0.3), name='payload')
    mechanism = with_loads(MACHINES['four_bar'], force, Pins(1.0))
    solver, drawing = Solver(mechanism), Picture(mechanism)
    state = solver.state(np.array([0.3, 2.0]), 2.0)
    position, rates = (np.stack(row, axis=-1) for row in state[:2])
    arrows = drawing.loads(position, rates)
    line = arrows['payload on coupler'] @ (1, 1j)
    exact = [np.array(x) for x in solver.point(state, 'A').position]
    place = exact[0] + 1j * exact[1] + (0.2 + 0.3j) * np.exp(1j * state.position[1])
    assert line[:, 0] == pytest.approx(place)
    assert np.angle(line[:, 1] - line[:, 0]) == pytest.approx(np.angle(30 - 40j))
    values = drawing.load_values(position, rates)
    assert values['payload on coupler'] == ['50 N', '50 N']
    assert set(arrows) == {'payload on coupler', 'crank', 'coupler', 'rocker'} == set(values)


@pytest.mark.parametrize('name', MACHINES)
def test_parameters_hold_every_load_in_any_order(name):
    machine = MACHINES[name]
    loaded = with_loads(machine, *(load for owner, load in CASES if owner == name))
    assert build(type(loaded), flatten(loaded)) == loaded != with_loads(machine)
    back = with_loads(machine, *reversed(loaded.loads))
    assert Solver(back).state(*motion(back, 0.8)) == Solver(loaded).state(*motion(back, 0.8))


def test_spreadsheet_gives_the_curve_in_its_columns(tmp_path):
    """The file has a byte order mark, Windows line ends, an empty row and quoted numbers."""
    path = tmp_path / 'sheet.csv'
    text = '\ufeffat, value,return_value\r\n"-1","5.5",0\r\n1.5,-7,2\r\n\r\n4e0,30,-4\r\n'
    path.write_bytes(text.encode())
    expected = (-1.0, 1.5, 4.0), (5.5, -7.0, 30.0), (0.0, 2.0, -4.0)
    (read,) = with_loads(
        MACHINES['slider_crank'], LoadCurve('slider', 'position', file=str(path))
    ).loads
    assert read == LoadCurve('slider', 'position', *expected, name='curve_1')


def test_indicator_diagram_pushes_the_piston_from_its_top(tmp_path):
    """At 10 deg before the top, and at the top itself, the force is that of the pressure."""
    path = tmp_path / 'tdc.csv'
    path.write_text('crank_angle_from_tdc_deg,pressure_bar\n-10,1\n0,30\n')
    for top, sign in (('far', -1), ('near', 1)):
        curve = LoadCurve('slider', file=str(path), bore=0.1, top=top)
        solver = Solver(with_loads(slider_crank(FULL['offset_right']), curve))
        (curve,) = solver.mechanism.loads
        assert curve.over == 'crank_angle_from_tdc'
        (_, start), _ = solver.mechanism.stroke('', 'slider').ends(top)
        assert min(abs(math.remainder(start - x, TURN)) for x in travel(solver).at) < 1e-7
        for angle, pressure in zip(curve.at, (1e5, 3e6), strict=True):
            force = sign * (pressure - 101300.0) * math.pi * 0.05**2
            state = solver.state(start + angle, 1.0)
            assert solver.load_forces(state)['slider'] == pytest.approx(force, rel=1e-12)


# ---------------------------------------------------------------- copies

ROWS = {
    'pressure': ('pressure_bar', [[-10, 1], [0, 30], [90, 4]]),
    'value': ('value', [[-10, 1], [0, 30], [90, 4]]),
    'two turns': ('value', [[-10, 1], [0, 30], [450, 4]]),
}  # fmt: skip
SLIDERS = {
    'slider_crank': (MACHINES['slider_crank'], 'slider'),
    'cylinder': (MACHINES['cylinder'], 'rod'),
    'driven_cylinder': (MACHINES['driven_cylinder'], 'rod'),
    'shaper': (replace(load('shaper').mechanism, loads=()), 'ram_slider'),
}


def changed_values(mechanism):
    """Returns other values for all lengths, offsets and angles, by name."""
    values = flatten(replace(mechanism, loads=()))
    names = [x for x in values if x.split('.')[-1] in {'length', 'offset', 'angle'}]
    return {name: 1.01 * values[name] + 0.001 * i for i, name in enumerate(names, 1)}


def torques(mechanism):
    solver = Solver(mechanism)
    return [solver.torque(*motion(mechanism, crank)) for crank in (0.8, -3.0)]


@pytest.mark.parametrize('rows', ROWS)
@pytest.mark.parametrize('top', ['far', 'near'])
@pytest.mark.parametrize('name', SLIDERS)
def test_copies_keep_a_curve_at_their_own_top(tmp_path, name, top, rows):
    """A mechanism changed in two ways has the torques of a new one."""
    (column, points), (mechanism, link) = ROWS[rows], SLIDERS[name]
    lines = ['crank_angle_from_tdc_deg,' + column, *(f'{x},{y}' for x, y in points)]
    (tmp_path / 'tdc.csv').write_text('\n'.join(lines))
    bore = {'bore': 0.1} if rows == 'pressure' else {}
    curve = LoadCurve(link, file=str(tmp_path / 'tdc.csv'), top=top, **bore)
    new = build(type(mechanism), {**flatten(mechanism), **changed_values(mechanism)})
    parts = {x.name: getattr(new, x.name) for x in fields(new) if x.name != 'loads'}
    base, created = (with_loads(x, curve) for x in (mechanism, new))
    expected = torques(created)
    assert expected != torques(base)
    for copy in (replace(base, **parts), build(type(base), flatten(created))):
        assert torques(copy) == expected
