# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Points and forces of both mechanisms, in 50 digits and by other routes than the package's.

Every body is cut free; all Newton-Euler equations, about the bodies' centres of mass, make one
linear system for all unknown forces and the torque at once. What acts on the frame is summed
from these, and from the momenta whose rates it has to balance.
"""

from __future__ import annotations

from typing import NamedTuple

import mpmath
from mpmath import mp

_DIGITS = 150


class Part(NamedTuple):
    """A body on its own: one that turns, or the slider, a mass at B."""

    mass: mpmath.mpf
    inertia: mpmath.mpf
    spin: mpmath.mpf
    angular_acceleration: mpmath.mpf
    place: mpmath.mpc
    velocity: mpmath.mpc
    acceleration: mpmath.mpc


class Forces(NamedTuple):
    """As linkage_ros.Reactions, vectors as complex numbers."""

    pins: dict
    guide_force: mpmath.mpf | None
    shaking_force: mpmath.mpc
    shaking_moment: mpmath.mpf
    torque: mpmath.mpf


def points(oracle, state):
    """Position, velocity and acceleration of A, B and, if it is traced, C.

    Args:
        oracle: Oracle or SliderOracle.
        state: One of its states.
    """
    mechanism = oracle.mechanism
    position, velocity, acceleration = state[:3]
    with mp.workdps(_DIGITS):

        def on_link(link, pair, pin):
            lever = _complex(pair) * mp.expj(position[link])
            turning = mp.mpc(-(velocity[link] ** 2), acceleration[link])
            motion = lever, 1j * velocity[link] * lever, turning * lever
            return tuple(x + y for x, y in zip(pin, motion, strict=True))

        found = {'A': on_link(0, (_mpf(oracle.lengths[0]), 0), (0, 0, 0))}
        if hasattr(mechanism, 'slider'):
            guide = mp.expj(mp.mpf(mechanism.frame.angle))
            foot = 1j * _mpf(oracle.lengths[2]) * guide
            slide = position[2], velocity[2], acceleration[2]
            found['B'] = foot + slide[0] * guide, slide[1] * guide, slide[2] * guide
        else:
            found['B'] = on_link(2, (_mpf(oracle.lengths[2]), 0), (_pivot(oracle), 0, 0))
        if mechanism.coupler.point is not None:
            found['C'] = on_link(1, mechanism.coupler.point, found['A'])
    return found


def parts(oracle, state):
    """Crank, coupler, and rocker or slider, in the caller's precision."""
    mechanism = oracle.mechanism
    position, velocity, acceleration = state[:3]
    pins = points(oracle, state)
    links = [(0, mechanism.crank, (mp.mpc(0),) * 3), (1, mechanism.coupler, pins['A'])]
    if not hasattr(mechanism, 'slider'):
        links.append((2, mechanism.rocker, (_pivot(oracle), mp.mpc(0), mp.mpc(0))))
    found = []
    for link, body, pin in links:
        lever = _complex(body.center) * mp.expj(position[link])
        spin, faster = velocity[link], acceleration[link]
        motion = lever, 1j * spin * lever, mp.mpc(-(spin**2), faster) * lever
        mass, inertia = mp.mpf(body.mass), mp.mpf(body.inertia)
        centre = (x + y for x, y in zip(pin, motion, strict=True))
        found.append(Part(mass, inertia, spin, faster, *centre))
    if hasattr(mechanism, 'slider'):
        mass = mp.mpf(mechanism.slider.mass)
        found.append(Part(mass, mp.mpf(0), mp.mpf(0), mp.mpf(0), *pins['B']))
    return found


def momenta(oracle, state):
    """Linear momentum, and angular momentum about A0, in the caller's precision."""
    bodies = parts(oracle, state)
    linear = sum(body.mass * body.velocity for body in bodies)
    angular = sum(
        body.mass * _cross(body.place, body.velocity) + body.inertia * body.spin for body in bodies
    )
    return linear, angular


def reactions(oracle, crank, speed=0.0, acceleration=0.0):
    """All forces at a crank angle that is not a change point.

    Args:
        oracle: Oracle or SliderOracle.
        crank: Crank angle, rad.
        speed: Crank speed, rad/s.
        acceleration: Crank acceleration, rad/s^2.
    """
    state = oracle.state(crank, speed, acceleration)
    mechanism = oracle.mechanism
    with mp.workdps(_DIGITS):
        bodies = parts(oracle, state)
        pins = points(oracle, state)
        A, B = pins['A'][0], pins['B'][0]
        # Unknown forces: name, where, along which direction, on which body, from which body.
        joints = [('A0', mp.mpc(0), 0, None), ('A', A, 1, 0), ('B', B, 2, 1)]
        if not hasattr(mechanism, 'slider'):
            joints.append(('B0', _pivot(oracle), 2, None))
        unknown = [
            (name, place, unit, onto, source)
            for name, place, onto, source in joints
            for unit in (mp.mpc(1), mp.mpc(0, 1))
        ]
        applied = [body.mass * _complex(mechanism.gravity) for body in bodies]
        damper = mp.mpc(0)
        if hasattr(mechanism, 'slider'):
            guide = mp.expj(mp.mpf(mechanism.frame.angle))
            unknown.append(('guide', B, 1j * guide, 2, None))
            damper = -mp.mpf(mechanism.slider.damping) * state[1][2] * guide
            applied[2] += mp.mpf(mechanism.slider.force) * guide + damper
        values = _solve_all(bodies, unknown, applied)
        torque = values[-1]
        forces = {}
        on_frame, moment = -damper, -torque - _cross(B, damper)
        for value, (name, place, unit, _, source) in zip(values, unknown, strict=False):
            forces[name] = forces.get(name, 0) + value * unit
            if source is None:
                on_frame -= value * unit
                moment -= _cross(place, value * unit)
        force = forces.pop('guide', None)
        along = None if force is None else (force / (1j * guide)).real
        return Forces(forces, along, on_frame, moment, torque)


def _solve_all(bodies, unknown, applied):
    """The unknown forces' sizes, and last the torque: per body two force balances and a moment.

    The slider does not turn: of it only the forces count.
    """
    rows, right = [], []
    for number, (body, force) in enumerate(zip(bodies, applied, strict=True)):
        acts = [(number == onto) - (number == source) for *_, onto, source in unknown]
        units = [unit for _, _, unit, _, _ in unknown]
        needed = body.mass * body.acceleration - force
        for part, size in (('real', needed.real), ('imag', needed.imag)):
            rows.append([x * getattr(u, part) for x, u in zip(acts, units, strict=True)] + [0])
            right.append(size)
        if len(unknown) == 7 and number == 2:
            continue
        levers = [place - body.place for _, place, *_ in unknown]
        row = [x * _cross(y, u) for x, y, u in zip(acts, levers, units, strict=True)]
        rows.append([*row, 1 if number == 0 else 0])
        right.append(body.inertia * body.angular_acceleration)
    return list(mp.lu_solve(mp.matrix(rows), mp.matrix(right)))


def _pivot(oracle):
    frame = oracle.mechanism.frame
    return _mpf(oracle.lengths[3]) * mp.expj(mp.mpf(frame.angle))


def _mpf(fraction):
    return mp.mpf(fraction.numerator) / fraction.denominator


def _complex(pair):
    return mp.mpc(mp.mpf(pair[0]), mp.mpf(pair[1]))


def _cross(u, v):
    return (mp.conj(u) * v).imag
