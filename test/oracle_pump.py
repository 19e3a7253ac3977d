# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The wind pump again, by other routes than the package's.

The motion: every body has its own absolute coordinates, and pins are constraints with Lagrange
multipliers. There is no dyad in that, so it also runs on where (phi1, xD) no longer says where
B is. Accelerations at one state: Newton-Euler for every body with all pin forces, in 50 digits.
oracle_pump_symbolic.py has a third way. The three share the data below and nothing else.

Everywhere: q = (phi1, xD), u = (phi1', xD'), a state is (phi1, xD, phi1', xD'). Torques of the
motor are functions of time, phi1 and phi1'.
"""

from __future__ import annotations

import cmath
import itertools
import math
from dataclasses import dataclass
from typing import NamedTuple

import mpmath
import numpy as np
from mpmath import mp
from scipy.integrate import DOP853

_DIGITS = 50
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


def still(time, angle, speed):
    """No torque."""
    return 0.0


# Absolute coordinates: x, y of the centre and the angle of each link, then x of the slider.


def multipliers(pump, start, times, tau=motor, unstabilised=False, tolerance=1e-13):
    """States at the times, one per row; `start` is the state at the first."""
    return reduced(absolute(pump, start, times, tau, unstabilised, tolerance))


def reduced(states):
    """phi1, xD and their rates out of absolute states (..., 20)."""
    return states[..., [2, 9, 12, 19]]


def absolute(pump, start, times, tau=motor, unstabilised=False, tolerance=1e-13):
    """As multipliers(), but all ten coordinates and their rates, one state per row.

    Each step is put back onto the constraints, unless `unstabilised`: then only the constraints'
    second derivatives are held, and errors in the constraints themselves grow.

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
            if not unstabilised:
                solver.y = projected(pump, solver.y)
                solver.f = derivative(solver.t, solver.y)
        step = solver.h_abs
        states.append(solver.y)
    return np.array(states)


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


def violation(pump, state):
    """Largest gap, m, and largest speed of separation, m/s, in any pin of an absolute state."""
    residual, jacobian, _ = _constraints(pump, state)
    rates = jacobian @ state[10:]
    return tuple(max(np.hypot(x[::2], x[1::2])) for x in (residual, rates))


def multiplier_accelerations(pump, q, u, torque):
    """phi1'' and xD'' at one state, in double precision."""
    return _kkt(pump, assembled(pump, (*q, *u)), torque)[[2, 9]]


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


# One state, in many digits.


class Exact(NamedTuple):
    """phi1, phi2, phi3 and xD with their derivatives, and the forces in the pins O, A, B and D
    as complex numbers: on the crank, the coupler, the rod and the slider, all in mpf.
    """

    position: tuple
    velocity: tuple
    acceleration: tuple
    forces: tuple


def exact_accelerations(pump, q, u, tau):
    """The state at exactly these doubles and this torque (a number), to nearly 50 digits."""
    with mp.workdps(max(_DIGITS, mp.dps)):
        links, spins = _motion(pump, q, u)
        # Unknown: three angular accelerations, xD'', x and y of the forces in O, A, B and D, and
        # the guide's force on the slider. Rows: x, y and moment about the centre for each link,
        # x and y for the slider, x and y of the closed loop's acceleration.
        matrix, right = mp.matrix(13, 13), mp.matrix(13, 1)
        gravity = _complex(pump.gravity)
        bias = mp.mpc(0)  # of the link's first pin, then of its second
        for body, (link, spin) in enumerate(zip(links, spins, strict=True)):
            mass, row, ahead = mp.mpf(pump.masses[body]), 3 * body, 4 + 2 * body
            arm = _complex(pump.centers[body]) * link / abs(link)
            # Acceleration of the centre: of all links before, and of this link's own part.
            for other, vector in [*enumerate(links[:body]), (body, arm)]:
                matrix[row, other] = -mass * vector.imag
                matrix[row + 1, other] = mass * vector.real
            weight = mass * (gravity - (bias - spin**2 * arm))
            right[row], right[row + 1] = weight.real, weight.imag
            matrix[row + 2, body] = mp.mpf(pump.inertias[body])
            # The force in the first pin acts on this link, that in the second on the next.
            for column, lever, sign in ((ahead, -arm, 1), (ahead + 2, link - arm, -1)):
                matrix[row, column] = matrix[row + 1, column + 1] = -sign
                matrix[row + 2, column] = sign * lever.imag
                matrix[row + 2, column + 1] = -sign * lever.real
            bias -= spin**2 * link
            matrix[11, body], matrix[12, body] = -link.imag, link.real
        right[2] = mp.mpf(tau)
        weight = mp.mpf(pump.slider_mass) * gravity
        matrix[9, 3], matrix[9, 10] = mp.mpf(pump.slider_mass), -1
        right[9] = weight.real - mp.mpf(pump.damping) * mp.mpf(u[1])
        matrix[10, 11] = matrix[10, 12] = -1
        right[10] = weight.imag
        matrix[11, 3] = -1
        right[11], right[12] = -bias.real, -bias.imag
        solved = mp.lu_solve(matrix, right)
        angles = mp.mpf(q[0]), mp.arg(links[1]), mp.arg(links[2])
        forces = tuple(mp.mpc(solved[i], solved[i + 1]) for i in (4, 6, 8, 10))
        position, velocity = (*angles, mp.mpf(q[1])), (*spins, mp.mpf(u[1]))
        return Exact(position, velocity, tuple(solved[:4]), forces)


def exact_energy(pump, q, u):
    """Kinetic and potential energy, J; the latter is 0 with all centres of mass in O."""
    with mp.workdps(max(_DIGITS, mp.dps)):
        links, spins = _motion(pump, q, u)
        gravity, slide = _complex(pump.gravity), mp.mpf(u[1])
        kinetic = mp.mpf(pump.slider_mass) * slide**2 / 2
        potential = -mp.mpf(pump.slider_mass) * gravity.real * mp.mpf(q[1])
        pin = velocity = mp.mpc(0)
        for body, (link, spin) in enumerate(zip(links, spins, strict=True)):
            arm = _complex(pump.centers[body]) * link / abs(link)
            mass, inertia = mp.mpf(pump.masses[body]), mp.mpf(pump.inertias[body])
            kinetic += (mass * abs(velocity + 1j * spin * arm) ** 2 + inertia * spin**2) / 2
            potential -= mass * (mp.conj(gravity) * (pin + arm)).real
            pin, velocity = pin + link, velocity + 1j * spin * link
        return kinetic, potential


def _motion(pump, q, u):
    """The links as vectors from first to second pin, and their rates of turning."""
    l1, l2, l3 = (mpmath.mpf(x) for x in pump.lengths)
    crank, speed = l1 * mp.expj(mp.mpf(q[0])), mp.mpf(u[0])
    chord = mp.mpf(q[1]) - crank
    # Two circles, about A and D, meet in B.
    along = (l2**2 - l3**2 + abs(chord) ** 2) / (2 * abs(chord))
    across = pump.side * mp.sqrt(l2**2 - along**2)
    coupler = chord / abs(chord) * mp.mpc(along, across)
    rod = chord - coupler
    # i (spin2 coupler + spin3 rod) = xD' - i speed crank: crossed with either, the other is left.
    rest = -1j * mp.mpf(u[1]) - speed * crank
    area = (mp.conj(coupler) * rod).imag
    spins = (mp.conj(rest) * rod).imag / area, (mp.conj(coupler) * rest).imag / area
    return (crank, coupler, rod), (speed, *spins)


def _complex(pair):
    return mp.mpc(mp.mpf(pair[0]), mp.mpf(pair[1]))
