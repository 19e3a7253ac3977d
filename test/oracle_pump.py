# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The motion of the wind pump again, in absolute coordinates.

Every body has its own coordinates, and pins are constraints with Lagrange multipliers. There is
no dyad in that, so it also runs on where (phi1, xD) no longer says where B is.

Everywhere: a state is (phi1, xD, phi1', xD'). Torques of the motor are functions of time, phi1
and phi1'.
"""

from __future__ import annotations

import cmath
import itertools
import math
from dataclasses import dataclass

import numpy as np
from scipy.integrate import DOP853

_PROJECTIONS = 3


@dataclass(frozen=True)
class Pump:
    """Crank O-A, coupler A-B, rod B-D and a slider D on the x axis, in this order.

    Attributes:
        lengths: Of the three links, m.
        centers: Centres of mass [along, across] from the first pin (O, A, B), m.
        masses: Of the three links, kg.
        inertias: Of the three links about their own centres of mass, kg m^2.
        slider_mass: Mass of the slider, kg.
        damping: Pump force on the slider per speed against it, N s/m.
        gravity: Acceleration, m/s^2.
        side: +1 with B left of the line from A to D (open), -1 right of it (crossed).
    """

    lengths: tuple = (0.12, 0.8, 1.6)
    centers: tuple = ((-0.24, 0.0), (0.72, 0.0), (0.8, 0.0))
    masses: tuple = (20.0, 40.0, 4.0)
    inertias: tuple = (20.0, 1.2, 0.85)
    slider_mass: float = 6.0
    damping: float = 60.0
    gravity: tuple = (0.0, -9.81)
    side: int = -1


SLOW = 0.0, 1.5, 2.0, 0.0
FAST = 0.0, 1.5, 6.0, 0.0


def motor(time, angle, speed):
    """The torque that goes with the default data, N m."""
    return 8.4 - 1.2 * speed


# Absolute coordinates: x, y of the centre and the angle of each link, then x of the slider.


def multipliers(pump, start, times, tau=motor, tolerance=1e-13):
    """States at the times, one per row; `start` is the state at the first.

    Each step is put back onto the constraints.

    Raises:
        ArithmeticError: No step is short enough.
    """

    def derivative(time, state):
        torque = tau(time, state[2], state[12])
        return np.concatenate((state[10:], _kkt(pump, state, torque)))

    states = [assembled(pump, start)]
    step = None
    for begin, end in itertools.pairwise(times):
        # A solver for each interval: its steps hit the times, and nothing is interpolated.
        first = None if step is None else min(step, end - begin)
        options = {'rtol': tolerance, 'atol': tolerance, 'first_step': first}
        solver = DOP853(derivative, begin, states[-1], end, **options)
        while solver.status == 'running':
            message = solver.step()
            if solver.status == 'failed':
                raise ArithmeticError(message)
            solver.y = projected(pump, solver.y)
            solver.f = derivative(solver.t, solver.y)
        step = solver.h_abs
        states.append(solver.y)
    return np.array(states)[:, [2, 9, 12, 19]]


def assembled(pump, start):
    """The absolute state, closed to the last bits, that goes with a state."""
    phi1, x_d, speed, slide = start
    l1, l2, l3 = pump.lengths
    chord = x_d - cmath.rect(l1, phi1)
    distance = abs(chord)
    # Law of cosines at A and at D; the projection mends what little these two lose.
    at_a = math.acos((l2**2 + distance**2 - l3**2) / (2 * l2 * distance))
    at_d = math.acos((l3**2 + distance**2 - l2**2) / (2 * l3 * distance))
    middle = cmath.phase(chord)
    angles = phi1, middle + pump.side * at_a, middle - pump.side * at_d
    pin, state = 0, np.zeros(20)
    for body, angle in enumerate(angles):
        center = pin + complex(*pump.centers[body]) * cmath.rect(1, angle)
        state[3 * body : 3 * body + 3] = center.real, center.imag, angle
        pin += cmath.rect(pump.lengths[body], angle)
    state[9] = x_d
    # The other rates follow from the given two, which make the constraints a full set.
    for _ in range(_PROJECTIONS):
        residual, jacobian, _ = _constraints(pump, state)
        rows = np.vstack((jacobian, np.eye(10)[[2, 9]]))
        state[:10] -= np.linalg.solve(rows, np.append(residual, (state[2] - phi1, state[9] - x_d)))
    jacobian = _constraints(pump, state)[1]
    rows = np.vstack((jacobian, np.eye(10)[[2, 9]]))
    state[10:] = np.linalg.solve(rows, np.append(np.zeros(8), (speed, slide)))
    return state


def projected(pump, state):
    """The nearest absolute state on the constraints, positions first, then rates."""
    state = state.copy()
    for _ in range(_PROJECTIONS):
        residual, jacobian, _ = _constraints(pump, state)
        state[:10] -= jacobian.T @ np.linalg.solve(jacobian @ jacobian.T, residual)
    jacobian = _constraints(pump, state)[1]
    rates = jacobian @ state[10:]
    state[10:] -= jacobian.T @ np.linalg.solve(jacobian @ jacobian.T, rates)
    return state


def _constraints(pump, state):
    """What the pins O, A, B and D lack to closing, its derivatives by the coordinates, and what
    these times the accelerations have to be.
    """
    residual, jacobian, needed = np.zeros(8), np.zeros((8, 10)), np.zeros(8)
    for body in range(3):
        x, y, angle = state[3 * body : 3 * body + 3]
        spin = state[12 + 3 * body]
        first = -complex(*pump.centers[body])
        # The second pin of a link minus the first of the next.
        for arm, pin, sign in ((first, body, -1), (pump.lengths[body] + first, body + 1, 1)):
            row = 2 * pin
            arm = sign * arm * cmath.rect(1, angle)
            residual[row] += sign * x + arm.real
            residual[row + 1] += sign * y + arm.imag
            jacobian[row, 3 * body] = jacobian[row + 1, 3 * body + 1] = sign
            jacobian[row, 3 * body + 2] = -arm.imag
            jacobian[row + 1, 3 * body + 2] = arm.real
            needed[row] += spin**2 * arm.real
            needed[row + 1] += spin**2 * arm.imag
    residual[6] -= state[9]
    jacobian[6, 9] = -1
    return residual, jacobian, needed


def _kkt(pump, state, torque):
    """All ten accelerations."""
    _, jacobian, needed = _constraints(pump, state)
    inertia, force = np.zeros(10), np.zeros(10)
    for body, mass in enumerate(pump.masses):
        inertia[3 * body : 3 * body + 3] = mass, mass, pump.inertias[body]
        force[3 * body : 3 * body + 2] = mass * pump.gravity[0], mass * pump.gravity[1]
    inertia[9] = pump.slider_mass
    force[9] = pump.slider_mass * pump.gravity[0] - pump.damping * state[19]
    force[2] = torque
    matrix = np.block([[np.diag(inertia), jacobian.T], [jacobian, np.zeros((8, 8))]])
    return np.linalg.solve(matrix, np.append(force, needed))[:10]
