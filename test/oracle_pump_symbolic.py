# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The wind pump by Lagrange's equations, which SymPy derives from the two energies.

phi2 and phi3 are written out as functions of (phi1, xD), with arcus cosines, so every derivative
of the motion is SymPy's. What comes out holds for every pump; see oracle_pump.py for the data
and what a state is.
"""

from __future__ import annotations

import functools
import itertools
import math

import numpy as np
import sympy as sp
from oracle_pump import motor
from scipy.integrate import solve_ivp

# Of the reach: nearer to stretched or folded, rounding leaves no digits to go on with.
_MARGIN = 1e-8


def lagrange(pump, start, times, tau=motor, tolerance=1e-13):
    """States at the times, one per row; `start` is the state at the first.

    Raises:
        ArithmeticError: No step is short enough, or the start does not close. The former is how
            it ends where the dyad A, B, D gets stretched or folded, and (phi1, xD) no longer
            says where B is.
    """
    data = _data(pump)
    l1, l2, l3 = pump.lengths
    folded, stretched = abs(l2 - l3) * (1 + _MARGIN), (l2 + l3) * (1 - _MARGIN)

    def within(phi1, x_d):
        far, up = x_d - l1 * math.cos(phi1), l1 * math.sin(phi1)
        return folded < math.hypot(far, up) < stretched

    def derivative(time, state):
        q, u = state[:2], state[2:]
        if not within(*q):
            return [math.nan] * 4  # the step is tried again, shorter
        return *u, *_accelerations(data, q, u, tau(time, q[0], u[0]))

    states = [np.array(start, dtype=float)]
    if not within(*start[:2]):
        raise ArithmeticError(f'the links do not reach from phi1 {start[0]} to xD {start[1]}')
    for span in itertools.pairwise(times):
        # One by one, because solve_ivp interpolates between its steps for times within.
        options = {'method': 'DOP853', 'rtol': tolerance, 'atol': tolerance}
        solution = solve_ivp(derivative, span, states[-1], t_eval=span[1:], **options)
        if not solution.success:
            raise ArithmeticError(solution.message)
        states.append(solution.y[:, -1])
    return np.array(states)


def lagrange_accelerations(pump, q, u, torque):
    """phi1'' and xD'' at one state, in double precision."""
    return np.array(_accelerations(_data(pump), q, u, torque))


def lagrange_energy(pump, q, u):
    """Kinetic and potential energy, J; the latter is 0 with all centres of mass in O."""
    return derived()[1](*map(float, (*q, *u)), *_data(pump))


def _accelerations(data, q, u, torque):
    *state, torque = map(float, (*q, *u, torque))
    m11, m12, m22, right1, right2 = derived()[0](*state, torque, *data)
    determinant = m11 * m22 - m12**2
    return (
        (m22 * right1 - m12 * right2) / determinant,
        (m11 * right2 - m12 * right1) / determinant,
    )


def _data(pump):
    """In the order of the symbols in derived()."""
    pairs = [x for pair in (*pump.centers, pump.gravity) for x in pair]
    lists = *pump.lengths, *pump.masses, *pump.inertias, *pairs
    return tuple(map(float, (*lists, pump.slider_mass, pump.damping, pump.side)))


@functools.cache
def derived():
    """Two functions of phi1, xD, their rates and the data.

    The first takes the torque before the data and gives the mass matrix (11, 12, 22) and what it
    times the accelerations has to be; the second gives the two energies.
    """
    q = phi1, x_d = sp.symbols('phi1 x_d', real=True)
    u = sp.symbols('speed slide', real=True)
    lengths = l1, l2, l3 = sp.symbols('l1:4', positive=True)
    masses, inertias = sp.symbols('m1:4', positive=True), sp.symbols('J1:4', positive=True)
    along, across = sp.symbols('along1:4', real=True), sp.symbols('across1:4', real=True)
    gravity = g_x, g_y = sp.symbols('g_x g_y', real=True)
    others = slider_mass, damping, side = sp.symbols('slider_mass damping side', real=True)
    torque = sp.Symbol('torque', real=True)

    # The triangle A, B, D: direction of A-D, and the angles at A and D.
    far, up = x_d - l1 * sp.cos(phi1), -l1 * sp.sin(phi1)
    square = far**2 + up**2
    middle = sp.atan2(up, far)
    phi2 = middle + side * sp.acos((square + l2**2 - l3**2) / (2 * l2 * sp.sqrt(square)))
    phi3 = middle - side * sp.acos((square + l3**2 - l2**2) / (2 * l3 * sp.sqrt(square)))

    kinetic = slider_mass * u[1] ** 2 / 2
    potential = -slider_mass * g_x * x_d
    pin = sp.zeros(2, 1)
    for i, angle in enumerate((phi1, phi2, phi3)):
        turn = sp.Matrix([[sp.cos(angle), -sp.sin(angle)], [sp.sin(angle), sp.cos(angle)]])
        center = pin + turn * sp.Matrix([along[i], across[i]])
        velocity = center.jacobian(q) * sp.Matrix(u)
        spin = sum(sp.diff(angle, x) * rate for x, rate in zip(q, u, strict=True))
        kinetic += masses[i] * velocity.dot(velocity) / 2 + inertias[i] * spin**2 / 2
        potential -= masses[i] * (g_x * center[0] + g_y * center[1])
        pin += turn * sp.Matrix([lengths[i], 0])

    momenta = sp.Matrix([sp.diff(kinetic, x) for x in u])
    mass_matrix = momenta.jacobian(u)
    slopes = sp.Matrix([sp.diff(kinetic - potential, x) for x in q])
    forces = sp.Matrix([torque, -damping * u[1]])
    right = forces + slopes - momenta.jacobian(q) * sp.Matrix(u)

    pairs = [x for pair in zip(along, across, strict=True) for x in pair]
    data = *lengths, *masses, *inertias, *pairs, *gravity, *others
    results = mass_matrix[0, 0], mass_matrix[0, 1], mass_matrix[1, 1], *right
    return (
        sp.lambdify((*q, *u, torque, *data), results, 'math', cse=True),
        sp.lambdify((*q, *u, *data), (kinetic, potential), 'math', cse=True),
    )
