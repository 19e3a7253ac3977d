# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Tests of a base_link that turns, and of forces that are given for each state.

The reference sees the whole machine in the world's axes: d'Alembert's principle with positions in
50 digits, whose derivatives it takes numerically. It knows no Coriolis terms.
"""

import cmath
import math
import pickle
from dataclasses import replace
from itertools import chain

import numpy as np
import pytest
from mechanisms import (
    CYLINDERS,
    FULL,
    PUMPS,
    SPRUNG_PUMP,
    SPRUNG_ROCKER,
    SPRUNG_SLIDER,
    four_bar,
    rows,
    slider_crank,
    with_loads,
)
from mpmath import mp
from oracle import Oracle

from linkage_ros import Conditions, ConfigurationError, Force, Friction, MechanismError, Solver
from linkage_ros.formulas import dot, number
from linkage_ros.mechanism.wrenches import FRAME, poses, velocity
from linkage_ros.settings.configuration import load

# A hip at 5 rad/s and 40 rad/s^2.
HIP = 0.7, 5.0, 40.0
PIVOT = 0.3, -0.4
KNEE = 2.0, 1.5
LEGS = {
    'four_bar': four_bar(FULL['crank_rocker'], 1.3),
    'slider_crank': with_loads(slider_crank(FULL['offset_right'], 5.5, 'crossed')),
    'cylinder': with_loads(CYLINDERS['swinging_barrel']),
}
FORCES = {'push': (3.0, -50.0), 'pull': (-7.0, 2.0)}


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


@pytest.mark.parametrize('name', ['six-bar', 'driven cylinder'])
def test_moment_balance_of_the_driven_link_gives_the_same_torque(name):
    leg = load('watt').mechanism
    if name != 'six-bar':
        leg = replace(CYLINDERS['swinging_barrel'], input='cylinder', assembly='crossed')
    solver = Solver(loaded(leg), pivot=PIVOT)
    (low, high), *_ = solver.reach.arcs
    q = np.linspace(low, high, 9)[1:-1]
    state = solver.state(q, *KNEE, under=Conditions(frame=HIP, forces=FORCES))
    found, peak = solver.reactions(state), np.abs(state.torque).max()
    assert found.torque == pytest.approx(state.torque, abs=1e-11 * peak)
    assert np.abs(solver.state(q, *KNEE).torque - state.torque).max() > 0.01 * peak


@pytest.mark.parametrize('friction', [False, True])
@pytest.mark.parametrize('name', LEGS)
def test_forces_as_arguments_equal_those_of_the_loads_to_the_bit(name, friction):
    rub = Friction(pin=0.1, pin_radius=0.05, **{'guide': 0.1} if name == 'slider_crank' else {})
    leg = replace(LEGS[name], loads=(rub,) if friction else ())
    fixed, live = (
        Solver(loaded(leg, forces), by_math=True)
        for forces in (FORCES, {'push': (0, 0), 'pull': (0, 0)})
    )
    cranks, under = np.linspace(0.4, 5.9, 5), Conditions(forces=FORCES)
    arrays = {key: tuple(np.full(5, x) for x in force) for key, force in FORCES.items()}
    state = fixed.state(cranks, *KNEE)
    given = live.state(cranks, *KNEE, under=Conditions(forces=arrays))
    assert rows(given).tobytes() == rows(state).tobytes()
    for i, crank in enumerate(cranks.tolist()):
        one = live.state(crank, *KNEE, under=under)
        assert rows(one).tobytes() == rows(state)[:, i].tobytes()
    assert str(live.reactions(given)) == str(fixed.reactions(state))
    if not friction:
        torque = fixed.torque(cranks, *KNEE)
        assert (live.torque(cranks, *KNEE, under=under) == torque).all()
        moved = fixed.accelerations(cranks, 2.0, 30.0)
        assert (live.accelerations(cranks, 2.0, 30.0, under=under) == moved).all()
        found = live.driven_by(lambda _: 30.0, under)(float(cranks[1]), 2.0, *under.values)
        assert found[0] == pytest.approx(moved[1], rel=1e-13)


def test_conditions_are_equal_and_pickle_whatever_the_order_of_their_forces():
    one, other = (
        Conditions([1.0, 2.0], HIP, {name: FORCES[name] for name in names})
        for names in (('push', 'pull'), ('pull', 'push'))
    )
    assert one == other == pickle.loads(pickle.dumps(one)) == replace(one)
    assert one.values == [1.0, 2.0, *HIP, *FORCES['pull'], *FORCES['push']]
    assert hash(one) == hash(other)
    assert not Conditions()


def test_driven_by_takes_the_values_of_the_conditions():
    solver = Solver(loaded(LEGS['four_bar']), pivot=PIVOT)
    under = Conditions((-2.0, 5.0), HIP, FORCES)
    found = solver.driven_by(lambda _: 30.0, under)(1.0, 2.0, *under.values)
    assert found == solver.accelerations((1.0,), 2.0, 30.0, under=under)
    for other in (replace(under, gravity=None), replace(under, frame=None), Conditions()):
        assert found != solver.accelerations((1.0,), 2.0, 30.0, under=other)


def virtual_power(solver, state, wrenches, levers):
    """Returns the power of wrenches at the given rates of all links."""
    bodies = solver.structure.links
    links, found = poses(bodies, state.position), 0.0
    for wrench in chain.from_iterable(wrenches.values()):
        if wrench.body != FRAME:
            found = found + number(wrench.effort) * levers[wrench.body]
            spin = bodies[wrench.body].spin(wrench.body)
            found = found + number(wrench.couple) * (0.0 if spin is None else levers[spin])
            if wrench.point is not None:
                found = found + dot(wrench.force, velocity(wrench.point, links, levers))
    return found


MACHINES = {
    **LEGS,
    'driven_cylinder': replace(CYLINDERS['swinging_barrel'], input='cylinder', assembly='crossed'),
    'sprung_rocker': SPRUNG_ROCKER,
    'sprung_slider': SPRUNG_SLIDER,
    'sprung_pump': SPRUNG_PUMP,
    **{name: load(name).mechanism for name in ('compressor', 'excavator', 'shaper', 'watt')},
}
WITHOUT_FRICTION = {'accelerations', 'driven_state', 'driven_by'}


@pytest.mark.parametrize('size', [None, 3])
@pytest.mark.parametrize('friction', [False, True])
@pytest.mark.parametrize('name', MACHINES)
def test_all_methods_agree_under_the_same_conditions(name, friction, size):
    rest = {'push': (1.0, 2.0), 'pull': (0.0, -1.0)}
    machine = loaded(MACHINES[name], rest)
    rub = (Friction(pin=0.1, pin_radius=0.02 * machine.crank.length),) if friction else ()
    solver = Solver(replace(machine, loads=(*machine.loads, *rub)), pivot=PIVOT)
    bare = Solver(replace(machine, loads=()), pivot=PIVOT)
    bare.model = bare.model._replace(loads=())  # without those of parts either
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
    for other in (
        Conditions(), replace(under, gravity=None), replace(under, frame=None),
        replace(under, forces=()),
    ):  # fmt: skip
        found = solver.torque(q, u, a, under=other)
        assert np.all(np.abs(found / state.torque - 1) > 1e-4)
    scale = np.max(np.abs(state.torque))
    close(solver.torque(q, u, a, under=under), state.torque)
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


@pytest.mark.parametrize('name', MACHINES)
def test_energy_is_that_of_a_machine_under_its_own_conditions(name):
    """A tilted base_link only turns gravity; a given force counts as constant."""
    gravity, tilt = (-3.0, 5.0), 0.7
    turned = complex(*gravity) * cmath.exp(-1j * tilt)
    rest = {'push': (1.0, 2.0), 'pull': (0.0, -1.0)}
    given, own = (Solver(loaded(MACHINES[name], forces)) for forces in (rest, FORCES))
    own = Solver(replace(own.mechanism, gravity=(turned.real, turned.imag)))
    under = Conditions(gravity, (tilt, 0.0, 0.0), FORCES)
    levels = []
    for share in (0.3, 0.5):
        q, u = PUMP[:2]
        if len(given.coordinates) == 1:
            low, high = given.reach.arcs[0]
            q, u = ((1 - share) * low + share * high,), (2.0,)
        pair = [x.energy(x.state(q, u, under=y)) for x, y in ((given, under), (own, Conditions()))]
        assert pair[0] == pytest.approx(pair[1], rel=1e-12, abs=1e-12)
        levels.append(pair[0])
    with pytest.raises(ConfigurationError, match='frame'):
        given.energy(given.state(q, u, under=replace(under, frame=HIP)))


@pytest.mark.parametrize('method', sorted(WITHOUT_FRICTION))
def test_friction_is_refused_where_the_torque_is_given(method):
    solver = Solver(replace(LEGS['four_bar'], loads=(Friction(pin=0.1, pin_radius=0.05),)))
    given = (lambda _: 3.0,) if method == 'driven_by' else (1.0, 2.0, 3.0)
    with pytest.raises(MechanismError, match='leave friction out'):
        getattr(solver, method)(*given)


def test_programs_and_formulas_agree_to_the_bit():
    for leg in (loaded(LEGS['slider_crank']), PUMPS['pump']):
        q, u, a = ((1.1,), (2.0,), (1.5,)) if leg.coordinates == ('crank',) else PUMP
        under = Conditions((1.0, -2.0), HIP, {} if leg is PUMPS['pump'] else FORCES)
        one, other = (
            Solver(leg, pivot=PIVOT, traced=traced).state(q, u, a, under=under)
            for traced in (True, False)
        )
        assert rows(one).tobytes() == rows(other).tobytes()


PUMP = (1.1, 2.3), (2.0, -0.3), (1.5, 0.4)


def test_at_rest_a_turned_base_only_turns_gravity():
    leg = LEGS['four_bar']
    gravity = complex(*leg.gravity) * np.exp(-1j * HIP[0])
    tilted = Solver(replace(leg, gravity=(gravity.real, gravity.imag)))
    found = Solver(leg).state(1.0, *KNEE, under=Conditions(frame=(HIP[0], 0.0, 0.0)))
    assert found.torque == pytest.approx(tilted.state(1.0, *KNEE).torque, rel=1e-13)


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
