# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The equations of motion, for any links and coordinates, against sums over the bodies.

What holds for every mechanism of the package is in test_laws.py.
"""

from __future__ import annotations

import cmath
import itertools
import math
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mechanisms import TURN

from linkage_ros import Body, Coupler, FourBar, Frame, Solver
from linkage_ros.formulas import Vector, cos, sin
from linkage_ros.model.loads import LinkLoad
from linkage_ros.model.pose import LinkPose, Pose
from linkage_ros.model.structure import Link, Mechanism, Point, Structure


@settings(max_examples=15)
@given(st.floats(-TURN, TURN), st.floats(-20, 20), st.floats(-20, 20))
def test_lone_crank_is_a_pendulum(crank, speed, acceleration):
    """With massless coupler and rocker the equation of motion is known in closed form."""
    along, across = 0.05, -0.03
    linkage = FourBar(
        Frame(0.425), Body(0.1, 2.0, 0.01, (along, across)), Coupler(0.315), Body(0.5)
    )
    lever = complex(along, across) * cmath.exp(1j * crank)
    expected = (0.01 + 2.0 * abs(lever) ** 2) * acceleration + 2.0 * 9.81 * lever.real
    torque = Solver(linkage).state(crank, speed, acceleration).torque
    assert torque == pytest.approx(expected, rel=1e-14, abs=1e-15)


def test_crank_inertia_alone_takes_torque_only_while_it_accelerates():
    linkage = FourBar(Frame(2.2), Body(1, inertia=0.5), Coupler(3), Body(2.5))
    assert Solver(linkage).state(0.7, 3.0).torque == 0.0
    assert Solver(linkage).state(0.7, 3.0, 2.0).torque == 1.0


# A mechanism that the package does not know: four links that turn and one that slides, which
# follow one, two or three coordinates by polynomials of the second degree.


class Polynomials(NamedTuple):
    """The position of each link is constant + sum slope q_i + sum bend q_i q_k / 2."""

    constants: tuple
    slopes: tuple
    bends: tuple
    guide: tuple

    def pose(self, q):
        links, pairs = [], list(itertools.combinations_with_replacement(range(len(q)), 2))
        for constant, slope, bend in zip(self.constants, self.slopes, self.bends, strict=True):
            position = constant
            for factor, x in zip(slope, q, strict=True):
                position = position + factor * x
            jacobian, curvature = list(slope), []
            for factor, (i, k) in zip(bend, pairs, strict=True):
                position = position + 0.5 * (factor * (q[i] * q[k]))
                jacobian[i] = jacobian[i] + 0.5 * (factor * q[k])
                jacobian[k] = jacobian[k] + 0.5 * (factor * q[i])
                curvature.append(factor)
            links.append((position, tuple(jacobian), tuple(curvature)))
        directions = [(cos(position), sin(position)) for position, *_ in links[:-1]]
        return Pose(
            tuple(
                LinkPose(position, Vector(*direction), jacobian, curvature)
                for (position, jacobian, curvature), direction in zip(
                    links, [*directions, self.guide], strict=True
                )
            ),
            (),
        )


class Spring(NamedTuple):
    """A load that the package does not know."""

    link: int
    stiffness: float

    def forces(self, links, rates):
        del rates
        return {self.link: -(self.stiffness * links[self.link].position)}

    def resistance(self, rates):
        del rates
        return {}

    def potential(self, links):
        position = links[self.link].position
        return 0.5 * (self.stiffness * (position * position))


class Made(Mechanism):
    """Random masses, centres, loads and polynomials."""

    NAMES = 'crank', 'arm', 'second', 'leg', 'slider'

    def __init__(self, seed, count):
        random = np.random.default_rng(seed)

        def uniform(low, high, *shape):
            return random.uniform(low, high, shape).tolist()

        self.coordinates = ('crank', 'second', 'slider')[:count]
        self.gravity = (1.7, -9.5)
        self.masses, self.inertias = uniform(0.1, 3, 5), [*uniform(0.1, 3, 4), 0.0]
        self.centers = [
            Point((*(complex(*uniform(-1, 1, 2)) for _ in range(4)), 0j), 0.5 - 0.2j)
            for _ in range(5)
        ]
        self.force, self.drag, self.stiffness = uniform(1, 5, 3)
        self.guide = 0.4
        self.slopes = np.array(uniform(-2, 2, 5, count))
        self.bends = np.array(uniform(-1, 1, 5, count * (count + 1) // 2))
        self.constants = np.array(uniform(-2, 2, 5))
        for i, name in enumerate(self.coordinates):
            link = self.NAMES.index(name)
            self.slopes[link] = np.eye(count)[i]
            self.bends[link] = self.constants[link] = 0.0

    def structure(self):
        rows = zip(self.NAMES, self.masses, self.inertias, self.centers, strict=True)
        links = tuple(Link(*row, slides=row[0] == 'slider', angle=self.guide) for row in rows)
        return Structure(links, {}, closure=Point((0j,) * 5))

    def loop(self):
        def frozen(rows):
            return tuple(map(tuple, rows.tolist()))

        guide = math.cos(self.guide), math.sin(self.guide)
        constants = tuple(self.constants.tolist())
        return Polynomials(constants, frozen(self.slopes), frozen(self.bends), guide)

    def loads(self):
        push = LinkLoad(4, self.force, self.drag)
        return push, LinkLoad(2, damping=0.3), Spring(3, self.stiffness)


def summed_over_bodies(made, q, u, a):
    """M_jk = sum m v_j.v_k + J w_j w_k; balance_j = sum m v_j.(a - g) + J w_j eps - loads.

    And the potential energy of weights and spring. No formula of the package is used: positions
    and their derivatives are those of the polynomials.
    """
    count = len(q)
    pairs = list(itertools.combinations_with_replacement(range(count), 2))
    full = np.zeros((5, count, count))
    for column, (i, k) in enumerate(pairs):
        full[:, i, k] += made.bends[:, column] / 2
        full[:, k, i] += made.bends[:, column] / 2
    position = made.constants + made.slopes @ q + np.einsum('lik,i,k->l', full, q, q) / 2
    partial = made.slopes + full @ q
    rates = partial @ u
    # bend / 2 q_i q_k: its second derivative while no rate changes is bend u_i u_k.
    changes = partial @ a + np.einsum('lik,i,k->l', full, u, u)
    gravity, potential = complex(*made.gravity), 0.0
    M, balance = np.zeros((count, count)), np.zeros(count)
    for link in range(5):
        mass, inertia = made.masses[link], made.inertias[link]
        if link == 4:
            guide = cmath.rect(1.0, made.guide)
            place, directions = guide * position[4], guide * partial[4]
            acceleration = guide * changes[4]
        else:
            terms = np.array(made.centers[link].weights[:4]) * np.exp(1j * position[:4])
            place = terms.sum()
            directions = 1j * terms @ partial[:4]
            acceleration = terms @ (1j * changes[:4] - rates[:4] ** 2)
        potential -= mass * (gravity.conjugate() * place).real
        M += mass * np.outer(directions.conj(), directions).real
        M += inertia * np.outer(partial[link], partial[link])
        balance += mass * (directions.conj() * (acceleration - gravity)).real
        balance += inertia * partial[link] * changes[link]
    balance -= partial[4] * (made.force - made.drag * rates[4])
    balance += partial[2] * 0.3 * rates[2] + partial[3] * made.stiffness * position[3]
    return M, balance, potential + made.stiffness * position[3] ** 2 / 2


@pytest.mark.parametrize('count', [1, 2, 3])
@pytest.mark.parametrize('seed', range(3))
def test_equations_of_motion_are_the_sum_over_the_bodies(seed, count):
    made = Made(seed, count)
    solver = Solver(made)
    q, u, a = np.random.default_rng(seed + 100).uniform(-2, 2, (3, count))
    M, balance, potential = summed_over_bodies(made, q, u, a)
    *motion, torque = *(tuple(x.tolist()) for x in (q, u, a)), 3.0
    assert np.allclose(solver.matrix(motion[0]), M, rtol=1e-13, atol=1e-13)
    assert np.array_equal(solver.matrix(motion[0]), np.transpose(solver.matrix(motion[0])))
    assert solver.state(*motion).torque == pytest.approx(balance[0], rel=1e-12, abs=1e-12)
    held = summed_over_bodies(made, q, u, 0 * a)[1]
    driven = np.eye(count)[0] * torque - held
    found = solver.accelerations(*motion[:2], torque)
    size = np.max(np.abs(driven)) * np.linalg.cond(M) / np.linalg.norm(M)
    assert np.allclose(found, np.linalg.solve(M, driven), rtol=0, atol=1e-13 * size)
    kinetic, height = solver.energy(*motion[:2])
    assert kinetic == pytest.approx(u @ M @ u / 2, rel=1e-13)
    elsewhere = tuple((q + 1).tolist())
    gained = summed_over_bodies(made, q + 1, u, a)[2] - potential
    assert solver.energy(elsewhere, motion[1])[1] - height == pytest.approx(gained, abs=1e-12)


@pytest.mark.parametrize('count', [1, 2, 3])
@pytest.mark.parametrize('seed', range(1))
def test_arrays_of_coordinates_give_what_floats_give(seed, count):
    solver = Solver(Made(seed, count))
    q, u, a = np.random.default_rng(seed).uniform(-2, 2, (3, count, 5))
    state = solver.state(tuple(q), tuple(u), tuple(a))
    found = solver.accelerations(tuple(q), tuple(u), 3.0)
    matrix = np.array(solver.matrix(tuple(q)))
    energies = np.array(solver.energy(tuple(q), tuple(u)))
    for i in range(5):
        at, rates, changes = (tuple(x[:, i].tolist()) for x in (q, u, a))
        alone = solver.state(at, rates, changes)
        for many, one in zip(state[:3], alone[:3], strict=True):
            assert [row[i] for row in many] == pytest.approx(one, rel=1e-13, abs=1e-13)
        assert state.torque[i] == pytest.approx(alone.torque, rel=1e-12, abs=1e-12)
        one = solver.accelerations(at, rates, 3.0)
        assert [row[i] for row in found] == pytest.approx(one, rel=1e-11, abs=1e-11)
        assert np.allclose(matrix[:, :, i], solver.matrix(at), rtol=1e-13, atol=1e-13)
        assert energies[:, i] == pytest.approx(solver.energy(at, rates), rel=1e-13, abs=1e-12)
