# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Forces at points, springs, viscous pins, gas and curves over two turns.

The reference solves Newton's and Euler's equations of all bodies in absolute coordinates.
"""

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from mechanisms import (
    CYLINDERS,
    FULL,
    PUMPS,
    SEVERAL_FORCES,
    TURN,
    force_errors,
    four_bar,
    motion,
    moving,
    slider_crank,
    with_loads,
    worst_errors,
)
from scipy.integrate import solve_ivp

from linkage_ros import (
    Force,
    Friction,
    Gas,
    LinkageError,
    LinkLoad,
    LoadCurve,
    Pins,
    Solver,
    Spring,
    travel,
)
from linkage_ros.programs import record as record_module
from linkage_ros.quantities import build, flatten
from linkage_ros.settings import configuration
from linkage_ros.settings.notes import notes
from linkage_ros.view.drawing import Drawing

CLOSE = 1e-11
MECHANISMS = {
    'four_bar': four_bar(FULL['crank_rocker'], 1.3),
    'slider_crank': slider_crank(FULL['offset_right'], 5.5, 'crossed'),
    'wind_pump': PUMPS['pump'],
    'cylinder': CYLINDERS['swinging_barrel'],
    'driven_cylinder': replace(CYLINDERS['swinging_barrel'], input='cylinder', assembly='crossed'),
}
LINKS = {
    'four_bar': ('crank', 'coupler', 'rocker'),
    'slider_crank': ('crank', 'coupler', 'slider'),
    'wind_pump': ('crank', 'coupler', 'rod', 'slider'),
    'cylinder': ('crank', 'barrel', 'rod'),
    'driven_cylinder': ('crank', 'barrel', 'rod'),
}
CYLINDER_NAMES = 'cylinder', 'driven_cylinder'
FRICTION = {
    'four_bar': Friction(0.1, 0.05),
    'slider_crank': Friction(0.1, 0.05, 0.2),
    'cylinder': Friction(0.1, 0.05, 0.2),
    'driven_cylinder': Friction(0.1, 0.05, 0.2),
}
CASES = [
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


def error(mechanism, cranks, speed=2.0, acceleration=1.5, meant=None):
    """Computes the largest error of any quantity; the reference solves the mechanism `meant`."""
    solver = Solver(mechanism)
    solver.mechanism = meant or mechanism
    states = worst_errors(solver, cranks, speed, acceleration, period=0, floor=1e-2)
    return max(*states, *force_errors(solver, cranks, speed, acceleration))


@pytest.mark.parametrize(('name', 'load'), CASES, ids=lambda x: getattr(x, 'label', x))
def test_each_load_on_each_link_gives_the_forces_of_newton_and_euler(name, load):
    mechanism = replace(MECHANISMS[name], loads=(load,))
    assert error(mechanism, [0.8, -3.0]) < CLOSE


@pytest.mark.parametrize('axes', ['world', 'link'])
def test_comparison_detects_a_point_that_is_a_nanometre_off(axes):
    loads = [Force('coupler', (30.0, -50.0), (0.2, y), axes) for y in (0.3, 0.3 + 1e-9)]
    right, wrong = (replace(MECHANISMS['four_bar'], loads=(x,)) for x in loads)
    assert error(right, [0.8], meant=wrong) > CLOSE


@pytest.mark.parametrize('name', LINKS)
@pytest.mark.parametrize('speed', [2.0, -40.0])
def test_all_loads_with_friction_give_the_forces_of_newton_and_euler(name, speed):
    loads = [load for owner, load in CASES if owner == name]
    friction = [FRICTION[name]] if name in FRICTION else []
    mechanism = replace(MECHANISMS[name], loads=(*loads, *friction))
    assert error(mechanism, [1.3, 9.0], speed) < CLOSE


def test_forces_of_one_load_at_one_point_add_and_others_have_names_of_their_own():
    mechanism = replace(MECHANISMS['four_bar'], loads=(SEVERAL_FORCES, LinkLoad('crank', 3.0)))
    solver, point = Solver(mechanism), mechanism.structure().point_of(1, (0.3, 0.0))
    state = solver.state(np.linspace(0.5, 6.0, 4), 2.0)
    exerted = solver.exerted(state)
    assert exerted.efforts == {'crank': 3.0}
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


# ---------------------------------------------------------------- free bodies


def random_case(seed):
    """Returns a random mechanism with a random set of loads, and its motion."""
    random = np.random.default_rng(seed)
    name = list(LINKS)[seed % len(LINKS)]
    plain = MECHANISMS[name]
    changed = {
        part: replace(
            body, mass=random.uniform(0, 3), inertia=random.uniform(0, 2),
            center=tuple(random.uniform(-1, 1, 2)),
        )
        for part in ('crank', 'coupler', 'rod', 'rocker', 'barrel')
        if (body := getattr(plain, part, None)) is not None
    }  # fmt: skip
    plain = replace(plain, gravity=tuple(random.uniform(-10, 10, 2)), **changed)
    loads = []
    for _ in range(random.integers(1, 5)):
        one, other = random.choice((*LINKS[name], 'frame'), 2, replace=False)
        points = random.uniform(-1, 1, (2, 2)).tolist()
        if one == 'frame':
            one, other = other, one
        loads += [
            Force(one, random.uniform(-50, 50, 2), points[0], random.choice(('world', 'link'))),
            Spring(one, points[0], other, points[1], *random.uniform(0, (90, 0.5, 9))),
            Pins(random.uniform(0, 5), random.choice(('', 'A0', 'A'))),
        ]
    chosen = random.permutation(len(loads))[: random.integers(1, len(loads) + 1)]
    mechanism = with_loads(plain, *(loads[i] for i in chosen))
    return mechanism, random.uniform(-7, 7), random.uniform(-9, 9), random.uniform(-9, 9)


class FreeBodies:
    """Balances of all bodies at a state, from positions as complex numbers."""

    def __init__(self, mechanism, state):
        self.mechanism, self.state = mechanism, state
        self.names = [x for x in ('crank', 'coupler', 'barrel', 'rod', 'rocker', 'slider')
                      if hasattr(mechanism, x)]  # fmt: skip
        self.is_cylinder = 'barrel' in self.names
        guide = getattr(getattr(mechanism, 'frame', None), 'angle', 0.0)
        self.angles = dict(zip(self.names, state.position, strict=True))
        if self.is_cylinder:
            self.angles['rod'] = self.angles['barrel']
        self.axes = {
            name: np.exp(1j * (guide if name == 'slider' else angle))
            for name, angle in self.angles.items()
        }
        origins = {'crank': (0.0, ()), 'coupler': (0.0, ('crank',)),
                   'rod': (0.0, ('crank', 'coupler'))}  # fmt: skip
        for name in ('rocker', 'barrel'):
            if name in self.names:
                frame = mechanism.frame
                origins[name] = frame.length * np.exp(1j * frame.angle), ()
        self.origins = origins

    def motion(self, name, at):
        """Returns position, velocity and acceleration of a point of a body."""
        if name == 'frame':
            return complex(*at), 0.0, 0.0
        i, axis = self.names.index(name), self.axes[name]
        if name == 'slider':
            x, v, a = (row[i] for row in self.state[:3])
            offset = getattr(self.mechanism.slider, 'offset', 0.0)
            return (x + 1j * offset + complex(*at)) * axis, v * axis, a * axis
        if self.is_cylinder and name == 'rod':  # slides along the barrel, which turns
            (_, _, s), (_, w, v), (_, e, a) = self.state[:3]
            arm = (s + 1j * self.mechanism.offset + complex(*at)) * axis
            place, velocity = self.origins['barrel'][0] + arm, 1j * w * arm + v * axis
            return place, velocity, (1j * e - w * w) * arm + (2j * w * v + a) * axis
        place, chain = self.origins[name]
        arms = [(x, getattr(self.mechanism, x).length * self.axes[x]) for x in chain]
        velocity = acceleration = 0.0
        for link, arm in (*arms, (name, complex(*at) * axis)):
            _, w, e = (row[self.names.index(link)] for row in self.state[:3])
            place, velocity = place + arm, velocity + 1j * w * arm
            acceleration += (1j * e - w * w) * arm
        return place, velocity, acceleration

    def applied(self):
        """Yields forces of loads: body, place, force, couple."""
        spins = dict(zip(self.names, self.state.velocity, strict=True))
        spins |= {'frame': 0.0, 'slider': 0.0}
        if self.is_cylinder:
            spins['rod'] = spins['barrel']
        for load in self.mechanism.loads:
            if isinstance(load, Force):
                turned = self.axes[load.link] if load.axes == 'link' else 1.0
                place, *_ = self.motion(load.link, load.at)
                yield load.link, place, complex(*load.force) * turned, 0.0
            elif isinstance(load, Spring):
                (here, u, _), (there, v, _) = (
                    self.motion(*end) for end in ((load.link, load.at), (load.to, load.to_at))
                )
                along = (there - here) / abs(there - here)
                pull = load.stiffness * (abs(there - here) - load.free_length)
                pull += load.damping * ((v - u) * along.conjugate()).real
                yield load.link, here, pull * along, 0.0
                yield load.to, there, -pull * along, 0.0
            else:
                for pin, one, other in self.pins():
                    if load.pin in {'', pin}:
                        couple = load.damping * (spins[other] - spins[one])
                        yield one, 0.0, 0.0, couple
                        yield other, 0.0, 0.0, -couple

    def pins(self):
        """Returns each pin with the body on which its force acts, and the other body."""
        if self.is_cylinder:
            return [('A0', 'crank', 'frame'), ('A', 'rod', 'crank'), ('B0', 'barrel', 'frame')]
        chain = ['frame', *self.names[:3], *(['slider'] if 'rod' in self.names else [])]
        names = ['A0', 'A', 'B', *(['D'] if 'rod' in self.names else [])]
        found = [(pin, on, of) for pin, of, on in zip(names, chain, chain[1:], strict=False)]
        return [*found, *([('B0', 'rocker', 'frame')] if 'rocker' in self.names else [])]

    def gaps(self, reactions):
        """Returns unbalanced forces and moments, and the size of the forces and of the points."""
        places = {pin: self.motion(on, (0.0, 0.0))[0] for pin, on, _ in self.pins() if pin != 'B'}
        if not self.is_cylinder:
            last = self.names[-1 if 'rod' not in self.names else 2]
            length = getattr(self.mechanism, 'rocker', None)
            places['B'] = self.motion(last, (length.length if length else 0.0, 0.0))[0]
        total = {name: [0.0, 0.0] for name in (*self.names, 'frame')}
        size, reach = 1e-300, max(map(abs, places.values()))

        def add(body, place, force, couple=0.0):
            nonlocal size, reach
            total[body][0] += force
            total[body][1] += (np.conj(place) * force).imag + couple
            size, reach = max(size, abs(force), abs(couple)), max(reach, abs(place))

        for push in self.applied():
            add(*push)
        for pin, on, of in self.pins():
            force = complex(*reactions.pins[pin])
            add(on, places[pin], force)
            add(of, places[pin], -force)
        for slider, (across, moment) in reactions.guides.items():
            guide = 'barrel' if self.is_cylinder else 'frame'
            normal = 1j * self.axes[slider] * across
            place, *_ = self.motion(slider, (0.0, 0.0))
            add(slider, place, normal, moment)
            add(guide, place, -normal, -moment)
        if self.mechanism.coordinates == ('rod',):
            place, *_ = self.motion('rod', (0.0, 0.0))
            add('rod', place, self.axes['rod'] * reactions.torque)
            add('barrel', place, -self.axes['rod'] * reactions.torque)
        else:
            add('crank', 0.0, 0.0, reactions.torque)
            add('frame', 0.0, 0.0, -reactions.torque)
        gaps = []
        for name in self.names:
            body = getattr(self.mechanism, name)
            place, _, acceleration = self.motion(name, getattr(body, 'center', (0.0, 0.0)))
            add(name, place, body.mass * (complex(*self.mechanism.gravity) - acceleration))
            if name != 'slider':
                spin = 'barrel' if self.is_cylinder and name == 'rod' else name
                change = self.state.acceleration[self.names.index(spin)]
                add(name, 0.0, 0.0, -body.inertia * change)
            gaps.append(total[name][1] / reach)
            gaps.append(abs(total[name][0]))
        gaps.append(abs(total['frame'][0] - complex(*reactions.shaking_force)))
        gaps.append((total['frame'][1] - reactions.shaking_moment) / reach)
        return np.abs(gaps) / size


def test_every_body_of_random_mechanisms_is_in_balance():
    for seed in range(250):
        mechanism, crank, speed, acceleration = random_case(seed)
        solver = Solver(mechanism, traced=False)
        state = moving(solver, crank, speed, acceleration)
        found = solver.reactions(state)
        assert found.torque == pytest.approx(state.torque, rel=1e-11, abs=1e-11)
        gaps = FreeBodies(mechanism, state).gaps(found)
        assert gaps.max() < 1e-11, (seed, gaps)


# ---------------------------------------------------------------- energy

CONSERVING = {
    'four_bar': [Spring('coupler', (0.2, 0.1), 'frame', (0.4, 2.3), 80.0, 0.3),
                 Force('coupler', (3.0, -5.0), (0.2, 0.1))],
    'slider_crank': [Gas('slider', 0.2, 0.3, 1e4, exponent=1.3),
                     Spring('crank', (0.2, 0.1), 'slider', (0.4, 0.3), 80.0)],
    'cylinder': [Gas('rod', 0.2, 0.3, 1e4, exponent=1.3),
                 Spring('crank', (0.2, 0.1), 'rod', (0.4, 0.3), 80.0, 0.3, 0.0),
                 Force('barrel', (3.0, -5.0), (0.2, 0.1))],
    'wind_pump': [Spring('crank', (0.2, 0.1), 'rod', (0.4, 0.3), 80.0, 0.3, 0.0),
                  Spring('rod', (0.2, 0.1), 'frame', (0.4, 0.9), 30.0)],
}  # fmt: skip
CONSERVING['driven_cylinder'] = CONSERVING['cylinder']
LOSING = {
    'four_bar': [Pins(0.7), Spring('rocker', (0.2, 0.1), 'frame', (0.4, 2.3), 80.0, 0.3, 4.0)],
    'slider_crank': [Pins(0.7), Gas('slider', 0.2, 0.3, 1e4, 2e4, exponent=1.3)],
    'cylinder': [Pins(0.7), Gas('rod', 0.2, 0.3, 1e4, 2e4, exponent=1.3)],
    'wind_pump': [Pins(0.2), Spring('coupler', (0.2, 0.1), 'frame', (0.4, 2.3), 8.0, 0.3, 4.0)],
}
LOSING['driven_cylinder'] = LOSING['cylinder']


@pytest.mark.parametrize('gain', [0.0, 3.0], ids=['conserving', 'driven'])
@pytest.mark.parametrize('name', LINKS)
def test_energy_of_torque_driven_runs_balances(name, gain):
    """Work of the motor and, from the wrenches alone, of the loads that lose energy."""
    conserving = CONSERVING[name]
    if gain and name in {'slider_crank', *CYLINDER_NAMES}:
        conserving = conserving[1:]  # one gas in the cylinder
    mechanism = with_loads(MECHANISMS[name], *conserving, *(LOSING[name] if gain else []))
    solver = Solver(mechanism)
    place, rates, _ = motion(mechanism, 0.4, 2.5)
    count = len(rates)
    losing = Solver(with_loads(mechanism, *LOSING[name]))

    def change(_, y):
        q, u = tuple(y[:count]), tuple(y[count:-1])
        a = solver.accelerations(q, u, gain)
        power = gain * u[0]
        if gain:
            state = solver.state(q, u, a)
            acting = losing.load_forces(state)
            power += sum(
                float(force) * state.velocity[solver.links.index(link)]
                for link, force in acting.items()
            )
        return [*u, *a, power]

    start = [*place, *rates, 0.0]
    bare = Solver(with_loads(mechanism, *conserving))
    # The others would stretch a dyad, or reach the end of the stroke.
    end = {'four_bar': 1.5, 'driven_cylinder': 1.02}.get(name, 1.2)
    found = solve_ivp(change, (1.0, end), start, 'DOP853', rtol=1e-12, atol=1e-13)
    rows = found.y.T
    energies = []
    for y in (rows[0], rows[len(rows) // 2], rows[-1]):
        q, u = tuple(y[:count].tolist()), tuple(y[count:-1].tolist())
        energies.append(sum(map(float, bare.energy(bare.state(q, u)))) - y[-1])
    assert np.ptp(energies) < 1e-9 * max(1.0, np.abs(energies).max(), np.abs(rows[:, -1]).max())
    assert bool(gain) == (abs(rows[-1, -1]) > 1e-3)


# ---------------------------------------------------------------- values, files, notes

SLIDER = 'mechanism: slider_crank, rpm: 60.0, crank: {length: 0.1}, coupler: {length: 0.3}'
FOUR = (
    'mechanism: four_bar, rpm: 60.0, crank: {length: 0.1}, coupler: {length: 0.315}, '
    'frame: {length: 0.425}, rocker: {length: 0.5}'
)
LIMITED = SLIDER.replace('0.3}', '0.05}').replace('rpm: 60.0', 'drive: torque')
PUMP = (
    'mechanism: wind_pump, motor: {torque: 8.4}, crank: {length: 0.1, inertia: 1.0}, '
    'coupler: {length: 0.8, inertia: 1.0}, rod: {length: 1.6, inertia: 1.0}, '
    'slider: {mass: 6.0, position: 1.5}'
)
GAS = 'kind: gas, link: slider, bore: 0.1, clearance: 0.01, inlet: 1.0e5'
CURVE = 'kind: curve, link: slider, at: [0.0, 1.0]'
FILES = {
    'tdc.csv': 'crank_angle_from_tdc_deg,pressure_bar\n-10,1\n0,30\n',
    'mm.csv': 'position_mm,value\n200,1\n300,2\n',
    'two.csv': 'crank_angle_deg,crank_angle,value\n0,0,1\n',
    'unit.csv': 'crank_angle_deg,pressure_psi\n0,1\n',
    'none.csv': 'crank_angle_deg\n0\n',
    'falling.csv': 'crank_angle_deg,value\n10,1\n0,1\n',
    'degrees.csv': 'crank_angle_deg,value\n0,1\n10,1\n',
    'long.csv': 'crank_angle_deg,value\n0,1\n721,1\n',
    'open.csv': 'crank_angle_deg,value\n0,1\n720,2\n',
    'negative.csv': 'crank_angle_deg,pressure\n0,-1\n',
    'word.csv': 'crank_angle_deg,value\n0,one\n',
}
LABEL = r'loads\.x\.'
WRONG = [
    # The load itself.
    (FOUR, 'link: crank', LABEL + r'kind is missing: must be one of force, spring, pins, gas'),
    (FOUR, 'kind: weight', LABEL + r"kind = 'weight': must be one of force"),
    (FOUR, 'kind: 5.0', LABEL + r'kind = 5\.0: must be one of'),
    (FOUR, 'kind: force, link: crank, force: [1.0, 0.0], size: 3.0', r"'loads\.x\.size' is not a"),
    (FOUR, 'kind: pins, damping: 1.0, link: crank', r"'loads\.x\.link' is not a parameter"),
    (FOUR, 'kind: load, pin: 0.1', r'kind = .load.: must be one of .* friction'),
    # Forces.
    (FOUR, 'kind: force, force: [1.0, 0.0]', LABEL + 'link is missing'),
    (FOUR, 'kind: force, link: crank', LABEL + 'force is missing: must be two numbers'),
    (FOUR, 'kind: force, link: slider, force: [1.0, 0.0]',
     LABEL + "link = 'slider': must be one of crank, coupler, rocker"),
    (SLIDER, 'kind: force, link: rocker, force: [1.0, 0.0]',
     LABEL + "link = 'rocker': must be one of crank, coupler, slider"),
    (FOUR, 'kind: force, link: frame, force: [1.0, 0.0]', LABEL + "link = 'frame': must"),
    (FOUR, 'kind: force, link: 3.0, force: [1.0, 0.0]', LABEL + r'link = 3\.0: must be text'),
    (FOUR, 'kind: force, link: crank, force: 5.0', LABEL + r'force = 5\.0: must be two numbers'),
    (FOUR, 'kind: force, link: crank, force: [1.0, 2.0, 3.0]', LABEL + 'force = .*: must be two'),
    (FOUR, 'kind: force, link: crank, force: [1.0, .nan]', LABEL + 'force = .*nan.*: must be two'),
    (FOUR, 'kind: force, link: crank, force: [1.0, .inf]', LABEL + 'force = .*inf.*: must be two'),
    (FOUR, 'kind: force, link: crank, force: [1.0, 0]', r'mixes types'),
    (FOUR, 'kind: force, link: crank, force: [1.0, 0.0], at: 0.1', LABEL + r'at = 0\.1: must be'),
    (FOUR, 'kind: force, link: crank, force: [1.0, 0.0], axes: body',
     LABEL + "axes = 'body': must be one of world, link"),
    (PUMP, 'kind: force, link: rocker, force: [1.0, 0.0]', 'one of crank, coupler, rod, slider'),
    # Springs.
    (FOUR, 'kind: spring', LABEL + 'link is missing'),
    (FOUR, 'kind: spring, link: crank, stiffness: -1.0', LABEL + r'stiffness = -1\.0: must be a'),
    (FOUR, 'kind: spring, link: crank, damping: -1.0', LABEL + r'damping = -1\.0: must be a'),
    (FOUR, 'kind: spring, link: crank, free_length: -1.0', LABEL + r'free_length = -1\.0: must'),
    (FOUR, 'kind: spring, link: crank, to: crank', LABEL + 'to = .crank.: a spring between two'),
    (FOUR, 'kind: spring, link: crank, to: slider',
     LABEL + "to = 'slider': must be one of crank, coupler, rocker, frame"),
    (FOUR, 'kind: spring, link: base, to: frame', LABEL + "link = 'base': must be one of"),
    (FOUR, 'kind: spring, link: crank, to_at: [0.0]', LABEL + r'to_at = \[0\.0\]: must be two'),
    (FOUR, 'kind: spring, link: crank, stiffness: .nan', LABEL + 'stiffness = nan: must be'),
    (FOUR, 'kind: spring, link: crank, stiffness: stiff', LABEL + "stiffness = 'stiff': must be"),
    # Pins.
    (FOUR, 'kind: pins', LABEL + 'damping is missing'),
    (FOUR, 'kind: pins, damping: -1.0', LABEL + r'damping = -1\.0: must be a number from 0'),
    (FOUR, 'kind: pins, damping: 1.0, pin: D', LABEL + "pin = 'D': must be one of A0, A, B, B0"),
    (SLIDER, 'kind: pins, damping: 1.0, pin: B0', LABEL + "pin = 'B0': must be one of A0, A, B"),
    (PUMP, 'kind: pins, damping: 1.0, pin: C', LABEL + "pin = 'C': must be one of A0, A, B, D"),
    # Gas.
    (FOUR, GAS, LABEL + "link = 'slider': must be one of crank, coupler, rocker"),
    (SLIDER, GAS.replace('slider', 'crank'), 'crank of a SliderCrank is not a slider whose'),
    (PUMP, GAS, r'loads\.x: slider of a WindPump is not a slider whose stroke has fixed ends'),
    (LIMITED, GAS, r'loads\.x: this .* linkage has no stroke with fixed ends'),
    (f'{FOUR.replace("rpm: 60.0", "drive: motion")}, motion: {{amplitude: 1.0, frequency: 1.0}}',
     GAS, r"own\.yaml: loads\.x\.link = 'slider'"),
    (SLIDER, GAS.replace('bore: 0.1, ', ''), LABEL + 'bore is missing'),
    (SLIDER, GAS.replace('0.01', '0.0'), LABEL + r'clearance = 0\.0: must be a number from 1e-09'),
    (SLIDER, GAS.replace('1.0e5', '-1.0'), LABEL + r'inlet = -1\.0: must be'),
    (SLIDER, GAS + ', outlet: 0.5e5', LABEL + 'outlet = 50000: must be between inlet, 100000 Pa'),
    (SLIDER, GAS + ', outlet: 1.0e8', LABEL + r'outlet = 1e\+08: .* stroke of 0\.2 m reaches'),
    (SLIDER, GAS + ', exponent: 0.0', LABEL + r'exponent = 0\.0: must be a number from 0\.1'),
    (SLIDER, GAS + ', top: left', LABEL + "top = 'left': must be one of far, near"),
    # Curves.
    (SLIDER, CURVE, r'loads\.x needs at and value, or at and pressure'),
    (SLIDER, CURVE + ', value: [1.0]', r'loads\.x\.value has 1 numbers and loads\.x\.at 2'),
    (SLIDER, CURVE + ', value: [1.0, 2.0], pressure: [1.0, 2.0]', r'loads\.x needs at and value'),
    (SLIDER, CURVE + ', pressure: [1.0, 2.0]', LABEL + 'pressure acts on a slider with a bore'),
    (SLIDER, CURVE + ', value: [1.0, 2.0], bore: 0.1', LABEL + 'bore is for a pressure'),
    (FOUR, CURVE.replace('slider', 'rocker') + ', pressure: [1.0, 2.0], bore: 0.1', 'is not a'),
    (SLIDER, 'kind: curve, link: slider, file: no.csv', "file = '.*no.csv': No such file"),
    *((SLIDER, f'kind: curve, link: slider, file: {name}, bore: 0.1', words) for name, words in {
        'two.csv': 'its first line names crank_angle_deg, crank_angle, value: give each',
        'unit.csv': "its first line names 'pressure_psi'; give the path .* pressure_bar",
        'none.csv': 'its columns of values are missing; give',
        'negative.csv': r'pressure = \[-1\.0\]: must be a list of numbers from 0',
        'word.csv': 'one',
        'mm.csv': r"over = 'crank_angle': must be position, as in "}.items()),
    *((SLIDER, f'kind: curve, link: slider, over: {over}, file: {name}, bore: 0.1', words)
      for over, name, words in (
        ('position', 'tdc.csv', 'must be crank_angle_from_tdc, as in '),
        ('crank_angle_from_tdc', 'mm.csv', 'must be position, as in '),
        ('crank_angle_from_tdc', 'degrees.csv', 'must be crank_angle, as in '))),
    (SLIDER, CURVE + ', value: [1.0, 2.0], top: near', LABEL + 'top is for a pressure'),
    (SLIDER, CURVE.replace('1.0', '1.0e-17') + ', over: crank_angle_from_tdc, top: near, value: '
     '[1.0, 2.0]', LABEL + 'at must increase'),
    *((given, f'kind: curve, link: {link}, over: crank_angle_from_tdc, at: [0.0], value: [1.0]',
       words) for given, link, words in (
        (SLIDER, 'crank', LABEL + 'over: crank of a SliderCrank is not a slider whose stroke'),
        (FOUR, 'rocker', LABEL + 'over: rocker of a FourBar is not a slider whose stroke'),
        (LIMITED, 'slider', LABEL + 'over: this .* linkage has no stroke with fixed ends'))),
    *((SLIDER, f'kind: curve, link: slider, file: {name}', words) for name, words in {
        'tdc.csv': LABEL + 'pressure acts on a slider with a bore: give loads.x.bore',
        'falling.csv': LABEL + 'at must increase',
        'long.csv': LABEL + r'at spans 12\.5838 rad = 721 deg .*: must span at most two turns',
        'open.csv': 'the last value must equal the first, 1'}.items()),
    (PUMP, 'kind: curve, link: slider, file: tdc.csv, bore: 0.1', 'slider of a WindPump is not'),
]  # fmt: skip


def configured(folder, mechanism, loads):
    """Reads a parameter file beside the CSV files."""
    for name, text in FILES.items():
        (folder / name).write_text(text)
    (folder / 'own.yaml').write_text(f'/**: {{ros__parameters: {{{mechanism}, {loads}}}}}\n')
    found = configuration.load(str(folder / 'own.yaml'))
    Solver(found.mechanism)
    return found


@pytest.mark.parametrize(('mechanism', 'text', 'words'), WRONG, ids=range(len(WRONG)))
def test_a_wrong_load_is_one_line(tmp_path, mechanism, text, words):
    assert len(WRONG) >= 60
    with pytest.raises(LinkageError, match=words) as caught:
        configured(tmp_path, mechanism, f'loads: {{x: {{{text}}}}}')
    assert '\n' not in str(caught.value)


def test_parameters_hold_every_load(tmp_path):
    for name, mechanism in MECHANISMS.items():
        loaded = with_loads(mechanism, *(load for owner, load in CASES if owner == name))
        values = flatten(loaded)
        assert build(type(loaded), values) == loaded
        back = with_loads(mechanism, *reversed(loaded.loads))
        assert Solver(back).state(*motion(back, 0.8)) == Solver(loaded).state(*motion(back, 0.8))
    for name in ('2', 'a b', 'a.b', ''):
        with pytest.raises(LinkageError, match='name'):
            with_loads(mechanism, Pins(1.0, name=name or 'x'), Pins(1.0, name='x'))
    curve = 'a: {kind: curve, link: slider, over: position, file: mm.csv}'
    text = f'loads: {{b: {{kind: pins, damping: 1.0, pin: A}}, {curve}}}'
    read = configured(tmp_path, SLIDER, text).mechanism
    assert read.loads == (
        LoadCurve('slider', 'position', (0.2, 0.3), (1.0, 2.0), name='a'), Pins(1.0, 'A', name='b')
    )  # fmt: skip


def test_indicator_diagram_pushes_the_piston_from_its_top(tmp_path):
    """At 10 deg before the top, and at the top itself, the force is that of the pressure."""
    for top, sign in (('far', -1), ('near', 1)):
        text = f'loads: {{x: {{kind: curve, link: slider, file: tdc.csv, bore: 0.1, top: {top}}}}}'
        found = configured(tmp_path, f'{SLIDER}, slider: {{offset: 0.02}}', text)
        solver = Solver(found.mechanism)
        (curve,) = found.mechanism.loads
        assert curve.over == 'crank_angle_from_tdc'
        (_, start), _ = found.mechanism.stroke('', 'slider').ends(top)
        extreme = travel(solver).at
        assert min(abs(math.remainder(start - x, TURN)) for x in extreme) < 1e-7
        for angle, pressure in zip(curve.at, (1e5, 3e6), strict=True):
            force = sign * (pressure - 101300.0) * math.pi * 0.05**2
            state = solver.state(start + angle, 1.0)
            assert solver.load_forces(state)['slider'] == pytest.approx(force, rel=1e-12)


def test_force_at_the_coupler_point_of_the_quadrilateral():
    """100 N at C, with the crank at rest: A0 and B0 share them as an independent sum says."""
    plain = configuration.load('coupler_point').mechanism
    loaded = replace(plain, loads=(Force('coupler', (0.0, -100.0), plain.coupler.point),))
    found = []
    for mechanism in (plain, loaded):
        solver = Solver(mechanism)
        state = solver.state(1.0)
        found.append(solver.reactions(state))
        points = [complex(*solver.point(state, x).position) for x in ('A', 'B', 'C', 'B0')]
    A, B, C, B0 = points
    rocker = (B0 - B) / abs(B0 - B)  # the force in B acts along the massless rocker
    share = 100.0 * (C - A).real / (np.conj(B - A) * rocker).imag
    in_B = share * rocker
    at_A0 = 100j - in_B
    changes = [
        complex(*y) - complex(*x)
        for x, y in zip(found[0].pins.values(), found[1].pins.values(), strict=True)
    ]
    assert changes[0] == pytest.approx(at_A0, abs=1e-10)
    assert complex(*found[1].shaking_force) - complex(*found[0].shaking_force) == pytest.approx(
        -100j, abs=1e-10
    )
    assert found[1].torque - found[0].torque == pytest.approx((np.conj(A) * at_A0).imag, abs=1e-10)


def test_units_that_are_probably_wrong_are_noted(tmp_path):
    loaded = 'loads: {x: {kind: link, link: slider, force: 1.0}}'
    cases = {
        f'{FOUR}, crank_angle: 30.0': ['crank_angle = 30 rad = 278.9 deg .* 30 deg = 0.5236 rad'],
        FOUR: ['no link has a mass .*: the torque is 0'],
        f'{FOUR}, joints: {{rocker: {{zero: 90.0}}}}': ['joints.rocker.zero = 90 rad'],
        f'{SLIDER}, joints: {{slider: {{zero: 9.0}}}}, {loaded}': [],
        f'{SLIDER.replace("0.3", "300.0")}, slider: {{mass: 1.0}}': ['300 mm = 0.3 m'],
        f'{SLIDER.replace("0.1", "1e-5")}, slider: {{mass: 1.0}}': ['= 0.01 mm; did you mean'],
        f'{SLIDER}, {loaded}': [],
    }
    for text, expected in cases.items():
        own = notes(configured(tmp_path, text, 'gravity: [0.0, -9.81]'))
        own = own if text == FOUR else [x for x in own if 'torque is 0' not in x]
        assert len(own) == len(expected)
        for words, line in zip(expected, own, strict=True):
            assert re.search(words, line), line


def test_motion_beyond_the_points_of_a_curve_is_noted_once(tmp_path, called):
    text = 'loads: {x: {kind: curve, link: slider, over: position, file: mm.csv}}'
    configured(tmp_path, SLIDER, text)
    code, out, _ = called(record_module, tmp_path / 'own.yaml', tmp_path / 'a.mcap')
    assert code == 0
    assert out.count('note:') == 1
    words = r'note: loads\.x\.at spans 0\.2 to 0\.3 m, and the slider has been at 0\.4 m: beyond'
    assert re.search(words, out)
    wide = text.replace('file: mm.csv', 'at: [0.1, 0.5], value: [1.0, 2.0]')
    configured(tmp_path, SLIDER, wide)
    assert 'note:' not in called(record_module, tmp_path / 'own.yaml', tmp_path / 'b.mcap')[1]


VALVES = f'loads: {{x: {{{GAS}, outlet: 2.0e5}}}}'
TURN_BACK = 'angles: [0.0, 2.0, 0.0], repeat: true'


def along(law):
    return f'{SLIDER.replace("rpm: 60.0", "drive: motion")}, motion: {{{law}}}'


@pytest.mark.parametrize(
    ('mechanism', 'angle'),
    [
        (f'{SLIDER}, start_rpm: -60.0, crank_acceleration: 20.0, crank_angle: 2.0', '1.01304'),
        (along('center: 1.5, amplitude: 0.5, frequency: 0.5'), '(1|2)'),
        (along('center: 1.5, amplitude: 5.0, frequency: 0.5'), '(6.5|-3.5)'),
        (along(f'times: [0.0, 0.5, 1.0], {TURN_BACK}'), '2'),
        (along('times: [0.0, 0.5, 1.0, 2.0, 3.0], angles: [0.0, 2.0, 2.0, 2.0, 1.0], '
               'speeds: [0.0, 0.0, 0.0, 0.0, 0.0]'), '2'),
        (along('times: [0.0, 1.0], angles: [1.0, 2.0], speeds: [-1.0, 0.0]'), r'0\.946502'),
    ],
    ids=range(6),
)  # fmt: skip
def test_motion_that_reverses_the_crank_inside_the_stroke_of_valves_is_refused(
    tmp_path, mechanism, angle
):
    words = rf'loads\.x: the crank reverses at {angle} rad = \S+ deg, inside the stroke'
    with pytest.raises(LinkageError, match=words):
        configured(tmp_path, mechanism, VALVES)
    configured(tmp_path, mechanism, f'loads: {{x: {{{GAS}}}}}')  # a closed cylinder


@pytest.mark.parametrize(
    'mechanism',
    [
        f'{SLIDER}, start_rpm: 30.0, crank_acceleration: 20.0',
        f'{SLIDER}, start_rpm: -60.0',  # without an acceleration, the start is at rpm
        along(f'center: {math.pi / 2!r}, amplitude: {math.pi / 2!r}, frequency: 0.5'),
        along(
            f'times: [0.0, 0.4, 1.0], angles: [1.0, 1.0, {1.0 + math.tau!r}], '
            'speeds: [0.0, 0.0, 0.0], repeat: true'
        ),
        along('times: [0.0, 0.5, 1.0], angles: [0.0, 2.0, 5.0]'),
    ],
    ids=range(5),
)
def test_crank_that_reverses_at_dead_centres_or_nowhere_has_valves(tmp_path, mechanism):
    configured(tmp_path, mechanism, VALVES)


def test_reversal_that_valves_meet_in_a_run_is_noted_once(tmp_path, called):
    for torque, count in ((-9.0, 1), (0.0, 0)):
        drive = f'drive: torque, start_rpm: 60.0, motor: {{torque: {torque}}}'
        mechanism = SLIDER.replace('rpm: 60.0', drive).replace('0.1}', '0.1, inertia: 1.0}', 1)
        configured(tmp_path, mechanism, VALVES.replace('bore: 0.1', 'bore: 0.001'))
        told = called(
            record_module, tmp_path / 'own.yaml', tmp_path / f'{count}.mcap', '--duration', '1'
        )[1]  # fmt: skip
        assert told.count('the crank has reversed') == count


def test_arrows_stand_at_the_points_of_forces():
    force = Force('coupler', (30.0, -40.0), (0.2, 0.3), name='payload')
    mechanism = with_loads(MECHANISMS['four_bar'], force, Pins(1.0))
    solver, drawing = Solver(mechanism), Drawing(mechanism)
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
