# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Machines as they are drawn: the same states as the machines from which they were drawn."""

import cmath
import random
from dataclasses import replace

import numpy as np
import pytest
from test_dyads import random_structure

from linkage_ros import Solver
from linkage_ros.mechanism.axes import axes_of
from linkage_ros.mechanism.drawing import UNITS, Drawing, DrawnLink, DrawnSlide

STRUCTURES = 40  # 2000 were run by hand


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
        mass = {'mass': part.mass, 'inertia': getattr(part, 'inertia', 0.0)}
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
        mechanism, q, u, a = random_structure(rng)
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
