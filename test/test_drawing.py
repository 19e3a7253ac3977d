# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Machines as they are drawn: the same states as the machines from which they were drawn."""

import cmath
import math
import random
import re
from dataclasses import replace

import numpy as np
import pytest
from test_dyads import random_structure

from linkage_ros import (
    ConfigurationError,
    Force,
    Gas,
    LoadCurve,
    MechanismError,
    SliderCrank,
    Solver,
    Spring,
    UnreachableError,
)
from linkage_ros.mechanism.axes import axes_of
from linkage_ros.mechanism.drawing import (
    UNITS,
    Drawing,
    DrawnLink,
    DrawnSlide,
)
from linkage_ros.mechanism.parts import TracedPoint
from linkage_ros.settings.configuration import configure, from_strings, to_strings
from linkage_ros.settings.notes import notes

STRUCTURES = 40  # 2000 were run by hand, and also compared with absolute coordinates


def place_of(solver, q, point):
    """Returns a point, m."""
    state = solver.state(q)
    turned = [cmath.rect(1.0, x) for x in state.position]
    return point.fixed + sum(w * x for w, x in zip(point.weights, turned, strict=True))


def drawn(mechanism, q, rng, unit='m'):
    """Draws a mechanism at a position, with new names of links, in a new order.

    Returns:
        The drawing, and the names of the links in it by those of the mechanism.
    """
    solver = Solver(mechanism)
    structure = solver.structure
    links, parts = structure.links, mechanism.parts()
    names = [f'l{number}' for number in rng.sample(range(100, 999), len(links))]
    shift = complex(rng.uniform(-1, 1), rng.uniform(-1, 1))

    def pair(point):
        place = (place_of(solver, q, point) + shift) / float(UNITS[unit])
        return place.real, place.imag

    pins = {pin.name: pair(structure.points[pin.name]) for pin in structure.pins}
    of = [[pin.name for pin in structure.pins if j in pin[1:]] for j in range(len(links))]
    state = solver.state(q)
    made, slides = [], []
    for j, link in enumerate(links):
        name, part = names[j], parts[link.name]
        own = rng.sample(of[j], len(of[j]))
        mass = {'mass': part.mass, 'inertia': getattr(part, 'inertia', 0.0) or 0.0}
        if not link.is_guided:
            mass['center'] = pair(link.center)
        if link.slides:
            spin, angle = axes_of(links, j)
            way = cmath.rect(1.0, angle or 0.0)
            if spin is not None:
                way *= cmath.rect(1.0, state.position[spin])
            on = 'frame' if link.parent is None else names[link.parent]
            slides.append(DrawnSlide(name, (way.real, way.imag), pins=own, on=on, **mass))
        else:
            # A barrel that is pinned once needs another point.
            if len(own) == 1:
                pins[f'{name}_tip'] = pair(structure.point_of(j, (0.3, 0.4)))
                own.append(f'{name}_tip')
            made.append(DrawnLink(name, own, **mass))
    for rows in (made, slides):
        rng.shuffle(rows)
    frame = [pin.name for pin in structure.pins if pin.first is None]
    driven = names[structure.driven]
    order = rng.sample([*pins], len(pins))
    drawing = Drawing(
        input=driven, frame=frame, pins={name: pins[name] for name in order}, links=made,
        slides=slides, units=unit,
    )  # fmt: skip
    return drawing, {link.name: name for link, name in zip(links, names, strict=True)}


def difference(mechanism, found, q, u, a):
    """Returns the largest difference of pins, their motion, torque and pin forces, relative."""
    worst, solvers = 0.0, [Solver(mechanism), Solver(found)]
    states = [solver.state(x, u, a) for solver, x in zip(solvers, q, strict=True)]
    names = [pin.name for pin in solvers[0].structure.pins]
    forces = [solver.reactions(state) for solver, state in zip(solvers, states, strict=True)]
    base = [solver.point(state, names[0]) for solver, state in zip(solvers, states, strict=True)]
    rows = [
        [
            [
                np.array(x) - np.array(y)
                for x, y in zip(solver.point(state, name), zero, strict=True)
            ]
            for name in names
        ]
        for solver, state, zero in zip(solvers, states, base, strict=True)
    ]
    for one, other in zip(np.moveaxis(rows[0], 1, 0), np.moveaxis(rows[1], 1, 0), strict=True):
        worst = max(worst, abs(one - other).max() / max(1.0, abs(one).max()))
    peak = max(abs(np.array(force)).max() for force in forces[0].pins.values())
    for name in names:
        # The order of the two links of a pin depends on their names.
        one, other = (np.array(force.pins[name]) for force in forces)
        worst = max(worst, min(abs(one - other).max(), abs(one + other).max()) / peak)
    return max(worst, abs(states[0].torque - states[1].torque) / peak)


def random_machine(seed):
    """Returns a mechanism with one degree of freedom, and its motion."""
    rng = random.Random(seed)
    while True:
        mechanism, q, u, a = random_structure(rng, most=5)
        if len(q) == 1:
            return replace(mechanism, loads=()), q[0], u, a


@pytest.mark.parametrize('seed', range(STRUCTURES))
def test_a_drawn_machine_moves_as_the_machine_it_was_drawn_from(seed):
    mechanism, q, u, a = random_machine(seed)
    rng = random.Random(seed)
    drawing, names = drawn(mechanism, q, rng, rng.choice([*UNITS]))
    found = drawing.mechanism(gravity=mechanism.gravity)
    assert set(found.parts()) == set(names.values())
    assert difference(mechanism, found, (q, found.drawn.position), u, a) < 1e-11


# Two chains of six links with one degree of freedom: the joints of each link.
CHAINS = {
    'watt': {'t': 'abc', 'v': 'ade', 'k': 'bx', 'l': 'xd', 'm': 'cz', 'p': 'ze'},
    'stephenson': {'t': 'abc', 'v': 'def', 'k': 'ad', 'l': 'be', 'm': 'cx', 'p': 'xf'},
}
PLACES = {
    'a': (0.1, 0.2), 'b': (1.3, -0.4), 'c': (-0.8, 1.1), 'd': (0.9, 1.9), 'e': (-1.2, 2.6),
    'f': (2.2, 2.4), 'x': (2.5, 0.7), 'z': (-2.3, 1.6),
}  # fmt: skip


def left_over(chain, ground, driven):
    """Returns the links that are not solved pair after pair, by an independent search."""
    known = {*chain[ground], *chain[driven]}
    waiting = {name: {*pins} for name, pins in chain.items() if name not in {ground, driven}}
    while True:
        pair = next(
            ((x, y) for x in waiting for y in waiting if x < y and waiting[x] & known
             and waiting[y] & known and waiting[x] & waiting[y] - known), None
        )  # fmt: skip
        if pair is None:
            return {*waiting}
        for name in pair:
            known |= waiting.pop(name)


@pytest.mark.parametrize(
    ('chain', 'ground', 'driven'),
    [(kind, x, y) for kind, chain in CHAINS.items() for x in chain for y in chain
     if x != y and {*chain[x]} & {*chain[y]}],
)  # fmt: skip
def test_every_inversion_of_six_links_is_converted_or_refused_with_its_group(
    chain, ground, driven
):
    links = CHAINS[chain]
    pins = {pin: PLACES[pin] for pin in {*''.join(links.values())}}
    made = [DrawnLink(name, [*own]) for name, own in links.items() if name != ground]
    drawing = Drawing(input=driven, frame=[*links[ground]], pins=pins, links=made)
    left = left_over(links, ground, driven)
    if left:
        with pytest.raises(ConfigurationError) as error:
            drawing.mechanism()
        assert all(re.search(rf'\b{name}\b', str(error.value)) for name in left)
        return
    solver = Solver(drawing)
    state = solver.state(solver.mechanism.drawn.position)
    origin = np.array(PLACES[solver.structure.pins[0].name])
    for pin in pins:
        found = solver.point(state, pin).position
        assert np.allclose(found, PLACES[pin] - origin, rtol=0, atol=1e-14)


# ---------------------------------------------------------------- one machine

PINS = {
    'O': (0.0, 0.0), 'A': (30.0, 40.0), 'B': (120.0, 90.0), 'Q': (140.0, 0.0),
    'P': (80.0, 120.0), 'S': (260.0, 120.0), 'G': (200.0, -20.0),
}  # fmt: skip
LINKS = {
    'crank': {'pins': ['O', 'A']},
    'coupler': {'pins': ['A', 'B', 'P'], 'mass': 0.5, 'inertia': 0.001, 'center': [75.0, 80.0]},
    'rocker': {'pins': ['B', 'Q']},
    'conrod': {'pins': ['B', 'S'], 'mass': 0.2, 'center': [190.0, 105.0]},
}
SLIDES = {'ram': {'pin': 'S', 'direction': [1.0, 0.0], 'mass': 1.0}}
CYLINDERS = {'gas': {'from': 'G', 'to': 'P'}}


def values(**changes):
    """Returns the parameters of the machine, with some groups of the drawing changed."""
    groups = {
        'units': 'mm', 'input': 'crank', 'frame': ['O', 'Q', 'G'], 'pins': PINS, 'links': LINKS,
        'slides': SLIDES, 'cylinders': CYLINDERS,
    }  # fmt: skip
    found = {'mechanism': 'drawing', 'rpm': 60.0}

    def add(name, value):
        if isinstance(value, dict):
            for key, inner in value.items():
                add(f'{name}.{key}', inner)
        else:
            found[name] = value

    for name, value in (groups | changes).items():
        add(f'drawing.{name}', value)
    return found


def test_a_drawing_gives_its_names_to_links_joints_and_points():
    structure = configure(values()).mechanism.structure()
    assert [x.name for x in structure.links] == ['crank', 'coupler', 'rocker', 'conrod', 'ram']
    # Three links meet at B: the coupler carries two of them.
    joints = {pin.name: (pin.first, pin.second) for pin in structure.pins}
    assert joints == {
        'O': (None, 0), 'A': (0, 1), 'B': (1, 2), 'Q': (None, 2), 'B_conrod': (1, 3), 'S': (3, 4),
    }  # fmt: skip
    assert structure.traced == {'P': 'coupler'}


def test_the_drawn_position_is_the_start_and_a_log_restores_the_drawing():
    configuration = configure(values())
    solver = Solver(configuration.mechanism)
    state = solver.state(configuration.drive.crank_angle)
    for name, place in PINS.items():
        if name != 'G':
            found = solver.point(state, name).position
            assert np.allclose(found, np.array(place) / 1000, rtol=0, atol=1e-15)
    again = from_strings(to_strings(configuration))
    assert again.mechanism == configuration.mechanism
    assert again.parameters() == configuration.parameters()


def test_places_of_loads_and_points_are_as_drawn():
    drawing = configure(values()).only.drawn_mechanism.drawing
    at_pin = drawing.mechanism(
        loads=[Force(force=(3.0, -5.0), pin='P'), Spring(cylinder='gas', stiffness=80.0)]
    )
    as_drawn = drawing.mechanism(
        loads=[
            Force('coupler', (3.0, -5.0), (80.0, 120.0)),
            Spring('coupler', (80.0, 120.0), 'frame', (200.0, -20.0), 80.0),
        ],
        points=[TracedPoint('tip', 'coupler', (80.0, 120.0))],
    )
    states = [Solver(x).state(0.4, 2.0) for x in (at_pin, as_drawn)]
    assert states[0] == states[1]
    solver = Solver(as_drawn)
    assert solver.point(states[1], 'tip') == solver.point(states[1], 'P')


def test_a_drawing_runs_the_programs_of_the_same_machine_by_lengths():
    four_bar = {'links': without(LINKS, 'conrod'), 'pins': without(PINS, 'S', 'G', 'P')}
    four_bar['links']['coupler'] = {**LINKS['coupler'], 'pins': ['A', 'B']}
    drawn = configure(values(**four_bar, slides={}, cylinders={}, frame=['O', 'Q'])).mechanism
    assert drawn.drawn
    assert Solver(drawn).source == Solver(replace(drawn, drawn=None)).source


def test_a_link_that_stands_still_is_noted():
    # The second bar of the jaw's toggle hangs on the fixed pin instead of on the first.
    locked = {**LINKS, 'toggle': {'pins': ['R', 'J']}, 'jaw': {'pins': ['J', 'K']}}
    pins = {**PINS, 'R': (20.0, -90.0), 'J': (60.0, -120.0), 'K': (110.0, -80.0)}
    given = values(links=LINKS)
    assert not [line for line in notes(configure(given)) if 'without motion' in line]
    given = values(links={**locked, 'block': {'pins': ['A', 'R']}}, pins=pins,
                   frame=['O', 'Q', 'G', 'K', 'R'])  # fmt: skip
    with pytest.raises(ConfigurationError):
        configure(given)
    given = values(links=locked, pins=pins, frame=['O', 'Q', 'G', 'K', 'R'])
    found = [line for line in notes(configure(given)) if 'without motion' in line]
    assert [line.partition(':')[0] for line in found] == ['jaw, toggle']


def test_a_solver_takes_a_drawing_and_what_load_returns():
    configuration = configure(values())
    drawing = configuration.only.drawn_mechanism.drawing
    found = [Solver(x).state(0.4, 2.0) for x in (drawing, configuration, drawing.mechanism())]
    assert found[0] == found[1] == found[2]


@pytest.mark.parametrize('names', [('lever', 'rod', 'ram'), ('slider', 'rod', 'crank')])
def test_loads_know_crank_and_piston_by_their_place_not_by_their_names(names):
    crank, rod, ram = names
    drawing = Drawing(
        units='mm', input=crank, frame=['O'], pins={'O': (0, 0), 'A': (0, 30), 'S': (90, 0)},
        links=[DrawnLink(crank, ['O', 'A']), DrawnLink(rod, ['A', 'S'])],
        slides=[DrawnSlide(ram, (1, 0), 'S')],
    )  # fmt: skip
    gas = Gas(link=ram, bore=0.05, clearance=0.01, inlet=1e5)
    start = LoadCurve(ram, 'crank_angle_from_tdc', (0.0, 1.0), pressure=(2e5, 1e5), bore=0.05)
    curve = LoadCurve(ram, 'position', (0.0, 1.0), (10.0, -20.0))
    given = drawing.mechanism(loads=[gas, start, curve])
    plain = SliderCrank(
        crank=given.crank, coupler=given.coupler, slider=given.slider,
        loads=[replace(load, link='slider') for load in (gas, start, curve)],
    )  # fmt: skip
    assert Solver(given).state(0.4, 2.0) == Solver(plain).state(0.4, 2.0)
    with pytest.raises(ConfigurationError, match=f'must be crank_angle on {crank}'):
        Solver(drawing.mechanism(loads=[replace(curve, link=crank)]))


def test_a_force_at_a_pin_acts_on_its_carrier():
    plain = configure(values()).mechanism
    pin = Force(force=(3.0, -5.0), pin='B')
    place = Force('coupler', (3.0, -5.0), (plain.coupler.length, 0.0))
    one, other = (Solver(replace(plain, loads=(load,))) for load in (pin, place))
    forces = [solver.reactions(solver.state(0.4, 2.0)) for solver in (one, other)]
    for name in forces[0].pins:
        assert np.allclose(*(force.pins[name] for force in forces), rtol=1e-12)
    assert math.isclose(*(force.torque for force in forces), rel_tol=1e-12)


@pytest.mark.parametrize('scale', [0.1, 0.3, 1.0, 7.7])
@pytest.mark.parametrize('quarter', range(4))
def test_a_drawn_parallelogram_is_one(quarter, scale):
    rng = random.Random(quarter)
    for _ in range(20):
        turn = 1j**quarter
        a, d = (round(rng.uniform(10, 990), 1) + 1j * round(rng.uniform(-400, 400), 1)
                for _ in range(2))  # fmt: skip
        a, d = a * turn, d * turn * scale
        pins = {'O': 0j, 'A': a, 'Q': d, 'B': a + d}
        pins = {x: (round(y.real, 1), round(y.imag, 1)) for x, y in pins.items()}
        pins['B'] = tuple(round(x + y, 1) for x, y in zip(pins['A'], pins['Q'], strict=True))
        drawing = Drawing(
            units='mm', input='a', frame=['O', 'Q'], pins=pins,
            links=[DrawnLink('a', ['O', 'A']), DrawnLink('b', ['A', 'B']),
                   DrawnLink('c', ['Q', 'B'])],
        )  # fmt: skip
        assert drawing.mechanism().grashof == 'change-point'


# ---------------------------------------------------------------- refusals


def without(group, *names):
    return {name: value for name, value in group.items() if name not in names}


def lever(pins=(), **block):
    """Returns groups of a crank whose block slides in a lever."""
    return {
        'links': {'crank': {'pins': ['O', 'A']}, 'lever': {'pins': ['Q', 'T']}},
        'pins': {'O': (0.0, 0.0), 'A': (30.0, 40.0), 'Q': (0.0, -100.0), 'T': (50.0, 150.0),
                 **dict(pins)},
        'slides': {'block': {'pin': 'A', 'on': 'lever', **block}},
        'frame': ['O', 'Q'], 'cylinders': {},
    }  # fmt: skip


SHAPER = lever({'R': (-60.0, 170.0)}, direction=[30.0, 140.0])
SHAPER['links']['rod'] = {'pins': ['T', 'R']}
SHAPER['slides']['ram'] = {'pin': 'R', 'direction': [1.0, 0.0]}
CROSSED = {**PINS, 'Z': (300.0, 0.0)}
REFUSED = {
    'a pin misspelt': ({'links': {**LINKS, 'rocker': {'pins': ['b', 'Q']}}}, "no pin 'b'"),
    'a pin with a letter twice': (
        {'links': {**LINKS, 'crank': {'pins': ['O', 'AA']}}}, "no pin 'AA' .* did you mean A[?]"),
    'a link without its pin of a slide': (
        {'links': {**LINKS, 'conrod': {'pins': ['B']}}}, 'add the pin that joins it .* P or S,'),
    'a fixed pin of a lever left out': (
        {**SHAPER, 'frame': ['O']}, '^Q is a pin of lever alone; is it fixed[?] then add it to'),
    'a fixed pin of a lever left out, which has a point': (
        {**SHAPER, 'frame': ['O'], 'pins': {**SHAPER['pins'], 'V': (60.0, 20.0)},
         'links': {**SHAPER['links'], 'lever': {'pins': ['Q', 'T', 'V']}}},
        '^Q is .* and V is a pin of lever alone; is one of them fixed'),
    'a link with one pin': ({'links': {**LINKS, 'rocker': {'pins': ['Q']}}}, 'two pins or more'),
    'a pin twice': ({'links': {**LINKS, 'crank': {'pins': ['O', 'O']}}}, 'one pin twice: O'),
    'a pin of nothing': ({'pins': CROSSED}, 'drawing.pins.Z: neither'),
    'pins on each other': ({'pins': {**PINS, 'S': PINS['B']}}, 'same place as B'),
    'no such input': ({'input': 'motor'}, "drawing.input = 'motor': must be one of"),
    'input not on the frame': ({'input': 'coupler'}, 'exactly one fixed pin, and has no fixed'),
    'input on two pins': (
        {'links': {**LINKS, 'crank': {'pins': ['O', 'A', 'G']}}}, 'has O and G'),
    'a frame pin missing': ({'frame': ['O', 'G']}, 'rocker is joined to the others at B alone'),
    'a fixed pin of a slide': ({'frame': ['O', 'Q', 'G', 'S']}, 'take S out of drawing.frame'),
    'a frame as a link': ({'links': {**LINKS, 'bed': {'pins': ['O', 'Q']}}}, 'bed has O and Q of'),
    'a coupler on a fixed pin': (
        {'links': {**LINKS, 'coupler': {'pins': ['A', 'Q', 'P']}}},
        'coupler joins crank at A to the fixed pin Q'),
    'two links on two pins': (
        {'links': {**LINKS, 'plate': {'pins': ['B', 'S']}}}, 'share the pins B and S'),
    'a cylinder on one pin': (
        {'cylinders': {'gas': {'from': 'P', 'to': 'P'}}}, 'one pin twice: P, P'),
    'masses of a spring': (
        {'cylinders': {'gas': {**CYLINDERS['gas'], 'rod': {'mass': 1.0, 'center': [1.0, 1.0]}}}},
        'gas.rod: only the input has'),
    'a length that cannot close': (
        {'links': {**LINKS, 'rocker': {'pins': ['B', 'Q'], 'length': 900.0}}},
        'the longest link, rocker, 900 mm'),
    'a length of a link of three pins': (
        {'links': {**LINKS, 'coupler': {'pins': ['A', 'B', 'P'], 'length': 120.0}}},
        'coupler.length is for a link of two pins .* it has 3 pins'),
    'a length of a lever with a slot': (
        {**lever(direction=[30.0, 140.0]),
         'links': {'crank': LINKS['crank'], 'lever': {'pins': ['Q', 'T'], 'length': 250.0}}},
        'lever.length .* block slides on it'),
    'a length unlike the drawn one': (
        {'links': {**LINKS, 'rocker': {'pins': ['B', 'Q'], 'length': 20.0}}},
        'rocker.length = 20, but B and Q are drawn 92.1954 mm apart: .* cannot turn fully'),
    'two inputs': ({'input': ['crank', 'rocker']}, 'must be text, not a list'),
    'a Scotch yoke': (
        {'slides': {'block': {'pin': 'A', 'on': 'yoke', 'direction': [0.0, 1.0]},
                    'yoke': {'pins': ['W', 'V'], 'direction': [1.0, 0.0]}},
         'links': {'crank': LINKS['crank']}, 'frame': ['O'], 'cylinders': {},
         'pins': {'O': PINS['O'], 'A': PINS['A'], 'V': (90.0, 9.0), 'W': (90.0, 0.0)}},
        'block slides on yoke, which slides too'),
    'an unknown unit': ({'units': 'milli'}, 'must be one of m, cm, mm, in'),
    'a slide without a direction': (
        {'slides': {'ram': {'pin': 'S', 'direction': [0.0, 0.0]}}}, 'must be a direction'),
    'a slide without a pin': ({'slides': {'ram': {'direction': [1.0, 0.0]}}}, 'give pin, or pins'),
    'a slide on nothing': (
        {'slides': {'ram': {**SLIDES['ram'], 'on': 'rail'}}}, "^drawing.slides.ram.on = 'rail'"),
    'a name that ROS reads as a boolean': (
        {'links': {**without(LINKS, 'rocker'), 'no': {'pins': ['B', 'Q']}}}, 'boolean'),
    'a fixed pin that ROS reads as a boolean': ({'frame': [False]}, 'ROS reads y, n'),
    'an input that ROS reads as a boolean': ({'input': True}, 'ROS reads y, n'),
    'a reserved name': (
        {'links': {**without(LINKS, 'rocker'), 'world': {'pins': ['B', 'Q']}}}, 'links.world'),
    'a name of two parts': (
        {'slides': {'rocker': SLIDES['ram']}}, 'has the name of drawing.links.rocker'),
    'a mass without a center': (
        {'links': {**LINKS, 'rocker': {'pins': ['B', 'Q'], 'mass': 1.0}}},
        r'center: \[130.0, 45.0\]'),
    'a center of a slide of the frame': (
        {'slides': {'ram': {**SLIDES['ram'], 'center': [1.0, 1.0]}}}, 'it is the pin'),
    'a link held twice': (
        {'links': {**LINKS, 'bar': {'pins': ['P', 'G']}}}, 'nothing can move'),
    'a rod across its slide': (
        {'pins': {**PINS, 'S': (260.0, 90.0)}, 'links': LINKS,
         'slides': {'ram': {**SLIDES['ram'], 'direction': [0.0, 1.0]}}},
        'conrod is at right angles to the line of ram'),
    'a coupler with a fixed pin more': (
        {'frame': ['O', 'Q', 'G', 'P']}, 'coupler has A, B and the fixed pin P: nothing can move'),
    'a connecting rod with a fixed pin more': (
        {'links': {'crank': LINKS['crank'], 'rod': {'pins': ['A', 'P', 'S']}}, 'cylinders': {},
         'frame': ['O', 'P'], 'pins': without(PINS, 'B', 'Q', 'G')}, 'rod has A, S and the fixed'),
    'a block with a fixed pin more': (
        {**lever({'P': (40.0, 40.0)}), 'frame': ['O', 'Q', 'P'],
         'slides': {'block': {'pins': ['A', 'P'], 'on': 'lever', 'direction': [30.0, 140.0]}}},
        'block has A and the fixed pin P'),
    'a cylinder with a fixed pin more': (
        {'links': {'crank': LINKS['crank'], 'barrel': {'pins': ['Q', 'T']}}, 'frame': ['O', 'Q'],
         'pins': {'O': PINS['O'], 'A': PINS['A'], 'Q': PINS['Q'], 'T': (50.0, 50.0)},
         'slides': {'rod': {'pins': ['A', 'T'], 'on': 'barrel', 'direction': [110.0, -40.0]}},
         'cylinders': {}}, 'rod has T, a pin of barrel'),
    'a slide that is also the slide of another link': (
        {'links': {'crank': LINKS['crank'], 'bar': {'pins': ['G', 'P']},
                   'arm': {'pins': ['P', 'B']}},
         'slides': {'lever': {'pins': ['Q'], 'on': 'bar', 'direction': [1.0, 2.0]},
                    'block': {'pins': ['A', 'B'], 'on': 'lever', 'direction': [1.0, 3.0]}},
         'pins': without(PINS, 'S'), 'cylinders': {}}, 'lever slides on bar.*nothing can move'),
    'two degrees of freedom': (
        {'links': {**LINKS, 'far': {'pins': ['S', 'Z']}, 'mid': {'pins': ['Z', 'V']},
                   'end': {'pins': ['V', 'W']}},
         'frame': ['O', 'Q', 'G', 'W'],
         'pins': {**CROSSED, 'V': (350.0, 60.0), 'W': (400.0, 50.0)}},
        'end, far, mid: .* 2 degrees of freedom, where 1 is needed'),
    'a dyad out of reach': (
        {'slides': {'ram': {**SLIDES['ram'], 'direction': [0.2, 1.0]}}},
        'conrod and ram do not close at .*; change lengths or ends of conrod and ram'),
    'no freedom': (
        {'links': {**LINKS, 'strut': {'pins': ['A', 'Q']}}}, 'strut joins crank and frame at A'),
    'a link across its guide': (
        {'slides': {'ram': {**SLIDES['ram'], 'direction': [-30.0, 140.0]}}},
        'right angles to the line of ram .* correct the direction of the line'),
    'a slot across its lever': (lever(direction=[140.0, -30.0]), 'from Q to A as drawn'),
    'a slot that its lever may leave': (
        lever({'A': (50.0, 0.0)}, direction=[0.0, 1.0]), 'draw its line or a pin elsewhere'),
    'a rod across its guide': (
        {'links': {'crank': LINKS['crank'], 'rod': {'pins': ['A', 'B']}}, 'frame': ['O'],
         'pins': {name: PINS[name] for name in 'OAB'}, 'cylinders': {},
         'slides': {'ram': {'pin': 'B', 'direction': [-50.0, 90.0]}}},
        'at B, rod is at right angles to the line of ram'),
    'links in line': ({'pins': {**PINS, 'B': (85.0, 20.0)}}, 'coupler and rocker are in line'),
    'links of a dyad in line': (
        {'links': {**LINKS, 'arm': {'pins': ['P', 'W']}, 'leg': {'pins': ['W', 'V']}},
         'frame': ['O', 'Q', 'G', 'V'],
         'pins': {**PINS, 'W': (80.0, 160.0), 'V': (80.0, 200.0)}},
        'arm and leg are in line at W'),
    'a pin in m': ({'pins': {**PINS, 'B': (0.12, 0.09)}}, r'metres; in mm it is \[120, 90\]'),
    'a fixed pin in m': ({'pins': {**PINS, 'Q': (0.14, 0.0)}}, r'metres; in mm it is \[140, 0\]'),
    'a pin in mm': (
        {'units': 'm', 'pins': {**{name: (0.001 * x, 0.001 * y) for name, (x, y) in PINS.items()},
                                'Q': PINS['Q']}}, r'millimetres; in m it is \[0.14, 0\]'),
    'pins in one text': ({'links': {**LINKS, 'crank': {'pins': 'O, A'}}}, 'a list of names'),
    'a link without pins': ({'links': {**LINKS, 'crank': {'mass': 0.0}}}, 'crank.pins is missing'),
    'a part of a link misspelt': (
        {'links': {**LINKS, 'crank': {'pins': ['O', 'A'], 'masse': 0.0}}},
        'did you mean drawing.links.crank.mass'),
    'a slide with two kinds of pins': (
        {'slides': {'ram': {**SLIDES['ram'], 'pins': ['S', 'B']}}}, 'give pin, or pins for'),
    'a slide on itself': ({'slides': {'ram': {**SLIDES['ram'], 'on': 'ram'}}}, "on = 'ram': must"),
    'a slide without any direction': (
        {'slides': {'ram': {'pin': 'S'}}}, r'missing: .*, the direction \[x, y\] of the line'),
    'an angle as a direction': (
        {'slides': {'ram': {'pin': 'S', 'direction': 90.0}}}, 'direction = 90.0: must be two num'),
    'a cylinder without an end': ({'cylinders': {'gas': {'from': 'G'}}}, 'gas.to is missing'),
    'a cylinder at no pin': ({'cylinders': {'gas': {'from': 'G', 'to': 'p'}}}, "gas: no pin 'p'"),
    'a name with a hyphen': (
        {'links': {**without(LINKS, 'rocker'), 'my-rocker': {'pins': ['B', 'Q']}}}, 'letters,'),
}  # fmt: skip


LEFT_OUT = None
SLIDING = {'drawing.input': 'ram', 'drive': 'motion', 'rpm': LEFT_OUT, 'motion.amplitude': 0.01,
           'motion.frequency': 1.0}  # fmt: skip
FORCE, SPRING = {'loads.f.kind': 'force', 'loads.f.force': [1.0, 0.0]}, {'loads.f.kind': 'spring'}
REFUSED_BESIDE = {
    'no input': ({'drawing.input': LEFT_OUT}, 'drawing.input is missing: .*, the driven link'),
    'no frame': ({'drawing.frame': LEFT_OUT}, 'drawing.frame is missing: .*, the fixed pins'),
    'lengths': ({'crank.length': 0.1}, 'only a four_bar .* has crank; leave it out'),
    'an assembly': ({'assembly': 'open'}, 'has assembly; leave it out'),
    'no mechanism': ({'mechanism': LEFT_OUT}, 'write mechanism: drawing'),
    'units beside the drawing': ({'units': 'mm'}, 'indent units below drawing'),
    'the rpm of a slide': ({'drawing.input': 'ram'}, 'ram slides, so that it has no rpm'),
    'degrees of a slide': ({**SLIDING, 'motion.center': '10deg'}, 'in m, because the ram slides'),
    'a slide driven too far': (
        {**SLIDING, 'motion.center': 7.0},
        'ram of this .* cannot move at 7 m: .*; as drawn, ram is at 0.12 m'),
    'a group misspelt': (
        {f'drawing.{group}.{name}.{key}': value if group == 'linkz' else LEFT_OUT
         for group in ('linkz', 'links') for name, x in LINKS.items() for key, value in x.items()},
        r"^'drawing.linkz' is not a .* did you mean drawing.links\?"),
    'a law of another drive': (
        {'motion.center': 1.0, 'motion.amplitude': 0.1}, "'motion' is .* write drive: motion"),
    'the name of a link for the input': (
        {'drawing.cylinders.crank.from': 'O', 'drawing.cylinders.crank.to': 'P'},
        'cylinders.crank has the name of drawing.links.crank'),
    'a weight': ({'drawing.links.crank.weight': 1.0}, 'give mass'),
    'a spring without any cylinder': (
        {**SPRING, 'loads.f.cylinder': 'gas', 'loads.f.stiffness': 1.0,
         'drawing.cylinders.gas.from': LEFT_OUT, 'drawing.cylinders.gas.to': LEFT_OUT},
        'add drawing.cylinders.gas'),
    'a force at no pin': ({**FORCE, 'loads.f.pin': 'X'}, "no pin 'X'; must be one of A, B,"),
    'a force on no link': (
        {**FORCE, 'loads.f.link': 'X', 'loads.f.at': [1.0, 1.0]}, "link = 'X': must be one"),
    'a force on one of two links': (
        {**FORCE, 'loads.f.link': 'rame', 'loads.f.at': [1.0, 1.0]}, 'did you mean ram[?]'),
    'a force on the frame': (
        {**FORCE, 'loads.f.link': 'frame', 'loads.f.at': [1.0, 1.0]}, 'frame does not move; must'),
    'a force at a fixed pin': (
        {**FORCE, 'loads.f.pin': 'Q'}, 'a fixed pin does nothing; .* link: rocker'),
    'a spring to a frame misspelt': (
        {**SPRING, 'loads.f.pin': 'P', 'loads.f.to': 'rame', 'loads.f.to_at': [0.0, 0.0],
         'loads.f.stiffness': 1.0}, 'did you mean frame or ram[?]'),
    'a force without a place': (
        {**FORCE, 'loads.f.link': 'rocker'}, 'f.at is missing: give the place on rocker as drawn'),
    'a force at a pin of others': (
        {**FORCE, 'loads.f.link': 'rocker', 'loads.f.pin': 'A'}, 'must be one of coupler, crank'),
    'a spring in no cylinder': (
        {**SPRING, 'loads.f.cylinder': 'gaz', 'loads.f.stiffness': 1.0}, "'gaz': must be one"),
    'a spring with one end': (
        {**SPRING, 'loads.f.pin': 'P', 'loads.f.stiffness': 1.0}, 'f.to_at is missing: give'),
    'a point of no link': (
        {'points.p.link': 'rockr', 'points.p.at': [1.0, 1.0]}, "link = 'rockr': must be"),
    'a point with the name of a pin': (
        {'points.A.link': 'rocker', 'points.A.at': [1.0, 1.0]}, "point 'A': .* another one"),
}  # fmt: skip


@pytest.mark.parametrize('mistake', REFUSED_BESIDE)
def test_a_mistake_beside_the_drawing_is_named_with_its_cure(mistake):
    changes, words = REFUSED_BESIDE[mistake]
    given = {name: x for name, x in (values() | changes).items() if x is not LEFT_OUT}
    with pytest.raises(ConfigurationError, match=words) as error:
        configure(given)
    assert '\n' not in str(error.value)


@pytest.mark.parametrize(('mass', 'is_noted'), [(5.0, False), (5000.0, True)])
def test_a_mass_is_judged_by_the_size_of_the_drawing(mass, is_noted):
    # The crank, 50 mm long, is the only link with a length.
    groups = lever(direction=[30.0, 140.0])
    groups['links']['lever'] |= {'mass': mass, 'center': [0.0, 0.0]}
    found = [line for line in notes(configure(values(**groups))) if 'cube of steel' in line]
    assert bool(found) == is_noted


@pytest.mark.parametrize(
    ('changed', 'meant'),
    [({'P': (0.08, 0.12)}, '[80, 120]'), ({'P': (0.25, -0.06)}, '[250, -60]')],
)
def test_a_pin_in_another_unit_is_noted(changed, meant):
    assert not [line for line in notes(configure(values())) if 'looks like' in line]
    given = values(pins={**PINS, **changed})
    (line,) = (line for line in notes(configure(given)) if 'looks like' in line)
    assert 'drawing.pins.P' in line
    assert f'in mm it is {meant}' in line


@pytest.mark.parametrize(('length', 'is_noted'), [(92.0, False), (140.0, True)])
def test_a_length_unlike_the_drawn_one_is_noted(length, is_noted):
    links = {**LINKS, 'rocker': {'pins': ['B', 'Q'], 'length': length}}
    found = [line for line in notes(configure(values(links=links))) if 'rocker.length' in line]
    assert bool(found) == is_noted


def test_a_dyad_that_comes_in_line_with_a_parallelogram_is_refused():
    links = {'crank': 'OA', 'rod': 'AB', 'wheel': 'QB', 'second_rod': 'BC', 'last_wheel': 'RC'}
    pins = {
        'O': (0, 0),
        'Q': (100, 0),
        'R': (200, 0),
        'A': (0, 30),
        'B': (100, 30),
        'C': (200, 30),
    }
    drawing = Drawing(
        units='mm', input='crank', frame=[*'OQR'], pins=pins,
        links=[DrawnLink(name, [*of]) for name, of in links.items()],
    )  # fmt: skip
    words = 'last_wheel and second_rod are in line .* crank, rod, wheel, may turn'
    with pytest.raises(MechanismError, match=words):
        Solver(drawing.mechanism()).reach  # noqa: B018


def test_an_input_between_moving_links_is_refused():
    drive = {'drive': 'motion', 'motion.center': 0.1, 'motion.amplitude': 0.01}
    given = values(cylinders={'gas': {'from': 'P', 'to': 'S'}}, input='gas')
    given = {name: value for name, value in given.items() if name != 'rpm'} | drive
    with pytest.raises(ConfigurationError, match='both of its ends are on moving links'):
        configure(given)


def test_a_cylinder_that_moves_a_floating_link_is_refused_with_the_links_to_drive():
    drive = {'drive': 'motion', 'motion.center': 0.1, 'motion.amplitude': 0.01}
    given = values(input='gas', slides={}, links=without(LINKS, 'conrod'), pins=without(PINS, 'S'))
    given = {name: value for name, value in given.items() if name != 'rpm'} | drive
    with pytest.raises(ConfigurationError, match=r'coupler, which it moves, has no fixed .* drive '
                       r'crank or rocker by a law instead: .* force of gas is'):  # fmt: skip
        configure(given)
    law = {'motion.center': 1.78, 'motion.frequency': 1.0}
    configure(given | law | {'drawing.input': 'rocker'})


def test_a_link_between_two_slides_of_the_frame_is_refused():
    drawing = Drawing(
        input='across', frame=['O'], pins={'O': (0, 0), 'A': (2, 0), 'B': (0, 1)},
        links=[DrawnLink('bar', ['A', 'B']), DrawnLink('other', ['O', 'A'])],
        slides=[DrawnSlide('across', (1, 0), 'A'), DrawnSlide('up', (0, 1), 'B')],
    )  # fmt: skip
    with pytest.raises(ConfigurationError, match='bar joins the slides across and up'):
        drawing.mechanism()


# Machines whose inputs cannot turn fully; no name is that of a role.
LIMITED = {
    'four links': (
        {'body': {'pins': ['O', 'A']}, 'triangle': {'pins': ['A', 'B']},
         'tie': {'pins': ['B', 'Q']}}, {}, {'A': (60.0, 80.0)}),
    'a slide of the frame': (
        {'body': {'pins': ['O', 'A']}, 'tie': {'pins': ['A', 'B']}},
        {'ram': {'pin': 'B', 'direction': [1.0, 0.2]}}, {'A': (20.0, 150.0), 'B': (90.0, 130.0)}),
    'a slot': (
        {'body': {'pins': ['O', 'A']}, 'beam': {'pins': ['Q']}},
        {'block': {'pin': 'A', 'on': 'beam', 'direction': [-1.0, 5.0]}}, {'A': (30.0, 90.0)}),
    'links on a dyad': (
        {'body': {'pins': ['O', 'A']}, 'triangle': {'pins': ['A', 'B', 'P']},
         'tie': {'pins': ['B', 'Q']}, 'arm': {'pins': ['P', 'S']}, 'leg': {'pins': ['S', 'G']}},
        {}, {'S': (150.0, 70.0)}),
}  # fmt: skip
ROLES = r'(?<![\w-])(crank|coupler|rocker|slider|barrel|rod)(?![\w-])'


def refusal(solver, angle):
    """Returns why a machine cannot be at an angle of its input; '' if it can."""
    try:
        solver.state(angle)
    except UnreachableError as error:
        return str(error)
    return ''


@pytest.mark.parametrize('units', ['mm', 'in', 'm'])
@pytest.mark.parametrize('machine', LIMITED)
def test_an_input_out_of_reach_is_told_in_the_terms_of_the_drawing(machine, units):
    links, slides, pins = LIMITED[machine]
    used = {'O': PINS['O'], **{name: PINS[name] for link in links.values() for name in link['pins']
                               if name in PINS}, **pins}  # fmt: skip
    given = values(
        links=links, slides=slides, cylinders={}, input='body', units=units, pins=used,
        frame=[x for x in 'OQG' if x in used],
    )  # fmt: skip
    given = {'drive': 'follow', **{name: x for name, x in given.items() if name != 'rpm'}}
    mechanism = configure(given).mechanism
    solver, drawn = Solver(mechanism), math.degrees(mechanism.drawn.position)
    angles = np.radians(np.arange(0.0, 360.0, 2.0))
    errors = [*filter(None, (refusal(solver, float(angle)) for angle in angles))]
    assert 0 < len(errors) < len(angles)
    for words in errors:
        assert not re.search(ROLES, words), words
        assert re.search(r'\bbody\b', words) or machine == 'links on a dyad', words
        for length in re.findall(r'= (\S+) (\w+) is negative', words):
            assert length[1] == units, words
        arcs = re.findall(r'= (-?[\d.]+) to (-?[\d.]+) deg', words)
        assert not arcs or any(float(x) <= drawn <= float(y) for x, y in arcs), (words, drawn)


@pytest.mark.parametrize('mistake', REFUSED)
def test_a_mistake_is_named_with_its_cure(mistake):
    changes, words = REFUSED[mistake]
    with pytest.raises(ConfigurationError, match=words) as error:
        configure(values(**changes))
    assert '\n' not in str(error.value)


# Each of another kind: a type, a name, a pin, a mass, a load, a name of a parameter, and a drive.
SEVEN = {
    'drawing.pins.P': (80.0, 120.0, 0.0),
    'drawing.input': 'cranck',
    'drawing.links.rocker.pins': ['B', 'q'],
    'drawing.links.conrod.center': LEFT_OUT,
    'loads.f.kind': 'force', 'loads.f.force': [1.0, 0.0], 'loads.f.pin': 'X',
    'drawing.slides.ram.massss': 1.0,
    'rpm': 'fast',
}  # fmt: skip
WORDS = (
    'drawing.pins.P = ', "drawing.input = 'cranck'", "no pin 'q'", 'conrod has a mass and no',
    "no pin 'X'", 'ram.massss', "rpm = 'fast'",
)  # fmt: skip


def refused(given):
    """Returns the mistakes of parameters, each of which is a line of the message."""
    with pytest.raises(ConfigurationError) as error:
        configure({name: value for name, value in given.items() if value is not LEFT_OUT})
    found = error.value.mistakes or (str(error.value),)
    head, *lines = str(error.value).split('\n')
    if lines:
        assert head == f'{len(found)} mistakes:'
        assert lines == [f'({number}) {words}' for number, words in enumerate(found, 1)]
    return found


def test_mistakes_of_all_kinds_are_told_at_once_without_their_consequences():
    found = refused(values() | SEVEN)
    assert len(found) == len(WORDS)
    for words in WORDS:
        assert any(words in one for one in found), words


@pytest.mark.parametrize('mistake', REFUSED)
def test_a_mistake_is_told_beside_those_in_a_load_and_a_mass(mistake):
    changes, words = REFUSED[mistake]
    given = values(**changes)
    link = next(name for name in given if name.startswith('drawing.links.'))
    heavy = link.rpartition('.')[0] + '.mass'
    others = {'loads.f.kind': 'pins', 'loads.f.damping': 'x', heavy: '1 kg'}
    found = refused(given | others)
    for wanted in (words, "loads.f.damping = 'x'", f"{heavy} = '1 kg'"):
        assert any(re.search(wanted, one) for one in found), (wanted, found)


def test_a_limited_input_is_told_beside_a_mistake_in_a_load():
    given = values(pins={**PINS, 'A': (60.0, 80.0)}) | {'loads.f.kind': 'force'}
    found = refused(given)
    assert len(found) == 2
    assert 'force is missing' in found[0]
    assert 'cannot turn fully' in found[1]


@pytest.mark.parametrize('group', ['links', 'slides', 'frame', 'units'])
def test_a_part_of_the_drawing_beside_it_is_one_mistake(group):
    given = values()
    moved = {name.removeprefix('drawing.') if name.startswith(f'drawing.{group}') else name: value
             for name, value in given.items()}  # fmt: skip
    (words,) = refused(moved)
    assert f'indent {group} below drawing' in words


@pytest.mark.parametrize(
    ('changes', 'words'),
    [
        ({'drawing.pins.P': LEFT_OUT, 'drawing.pins.P.x': 80.0, 'drawing.pins.P.y': 120.0},
         'drawing.pins.P is one value, without names below it: write drawing.pins.P: VALUE'),
        ({'drawing.links.rocker.pins': LEFT_OUT, 'drawing.links.rocker': ['B', 'Q']},
         'write drawing.links.rocker: {pins: ...}'),
        ({'drawing.links.rocker.pins': LEFT_OUT, 'drawing.links.rocker.pin': ['B', 'Q']},
         'did you mean drawing.links.rocker.pins?'),
        ({'drawing.loads.f.kind': 'force', 'drawing.loads.f.pin': 'P',
          'drawing.loads.f.force': [1.0, 0.0]}, 'loads is beside drawing, not in it'),
        ({'drawing.pins.B': LEFT_OUT},
         'drawing.pins.B is missing, a pin of drawing.links.conrod, drawing.links.coupler'),
        ({'drawing.input': 'O'}, 'that is a pin'),
        ({'drawing.frame': 'O, Q, G'}, 'write [O, Q, G]'),
        ({'drawing.pins.P': ['80,5', '120,0']}, 'write 80.5, with a point'),
        ({'drawing.links.conrod.mass': '0.2 kg'}, 'write 0.2, without a unit'),
        ({'drawing.cylinders.gas.to': 'W', 'drawing.pins.W': (9.0, 200.0)},
         'no link has its pin W'),
        ({**SLIDING, 'motion.center': 0.1, 'rpm': 60.0}, 'has rpm; leave it out'),
        ({'loads.f.force': [1.0, 0.0], 'loads.f.pin': 'P'}, 'loads.f.kind is missing'),
    ],
)  # fmt: skip
def test_a_slip_in_the_form_is_one_mistake_with_its_cure(changes, words):
    (found,) = refused(values() | changes)
    assert words in found


@pytest.mark.parametrize(
    ('on', 'pins', 'words'),
    [
        ('lever', ['Q', 'T', 'A'], 'block has A, a pin of lever, on which it slides'),
        ('crank', ['Q', 'T'], 'block has A, a pin of crank, on which it slides'),
        ('frame', ['Q', 'T'], 'block slides on the frame and has the pin A of crank'),
    ],
)
def test_a_slide_on_a_link_with_its_own_pin_is_refused(on, pins, words):
    groups = lever(direction=[30.0, 140.0], on=on)
    groups['links']['lever'] = {'pins': pins}
    if on != 'lever':
        groups['links']['bar'] = {'pins': ['T', 'W']}
        groups['pins']['W'] = (120.0, 150.0)
        groups['frame'] = ['O', 'Q', 'W']
    assert any(words in one for one in refused(values(**groups)))
