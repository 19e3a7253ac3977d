# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Points and forces of all mechanisms, in 50 digits and by other routes than the package's.

Every body is cut free; all Newton-Euler equations, about the bodies' centres of mass, make one
linear system for all unknown forces and the torque at once. What acts on the frame is summed
from these, and from the momenta whose rates it has to balance.
"""

from __future__ import annotations

from fractions import Fraction
from typing import NamedTuple

import mpmath
import oracle_pump
from mpmath import mp
from oracle import complex_of, cross, mpf

_DIGITS = 150


class Part(NamedTuple):
    """A body on its own: one that turns, or a slider, a mass at its pin with no inertia."""

    mass: mpmath.mpf
    inertia: mpmath.mpf | None
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


class PumpOracle:
    """States of one wind pump under a torque."""

    def __init__(self, mechanism):
        self.mechanism = mechanism
        bodies = mechanism.crank, mechanism.coupler, mechanism.rod
        self.lengths = tuple(Fraction(body.length) for body in bodies)
        self._pump = oracle_pump.Pump(
            tuple(body.length for body in bodies), tuple(body.center for body in bodies),
            tuple(body.mass for body in bodies), tuple(body.inertia for body in bodies),
            mechanism.slider.mass, mechanism.slider.damping, mechanism.gravity,
            1 if mechanism.assembly == 'open' else -1,
        )  # fmt: skip

    def state(self, q, u, torque):
        """Of its free motion, to nearly 50 digits."""
        return oracle_pump.exact_accelerations(self._pump, q, u, torque)


def points(oracle, state):
    """Position, velocity and acceleration of A, B, a wind pump's D and, if it is traced, C.

    Args:
        oracle: Oracle, SliderOracle or PumpOracle.
        state: One of its states.
    """
    mechanism = oracle.mechanism
    position, velocity, acceleration = state[:3]
    with mp.workdps(_DIGITS):

        def on_link(link, pair, pin):
            lever = complex_of(pair) * mp.expj(position[link])
            turning = mp.mpc(-(velocity[link] ** 2), acceleration[link])
            motion = lever, 1j * velocity[link] * lever, turning * lever
            return tuple(x + y for x, y in zip(pin, motion, strict=True))

        found = {'A': on_link(0, (mpf(oracle.lengths[0]), 0), (0, 0, 0))}
        if hasattr(mechanism, 'rod'):
            found['B'] = on_link(1, (mpf(oracle.lengths[1]), 0), found['A'])
        elif not hasattr(mechanism, 'slider'):
            found['B'] = on_link(2, (mpf(oracle.lengths[2]), 0), (_pivot(oracle), 0, 0))
        if hasattr(mechanism, 'slider'):
            guide, foot = _guide(oracle), mp.mpc(0)
            if not hasattr(mechanism, 'rod'):
                foot = 1j * mpf(oracle.lengths[2]) * guide
            slide = position[-1], velocity[-1], acceleration[-1]
            slider_pin = foot + slide[0] * guide, slide[1] * guide, slide[2] * guide
            found['D' if hasattr(mechanism, 'rod') else 'B'] = slider_pin
        if mechanism.coupler.point is not None:
            found['C'] = on_link(1, mechanism.coupler.point, found['A'])
    return found


def parts(oracle, state):
    """All bodies along the chain, in the caller's precision."""
    mechanism = oracle.mechanism
    position, velocity, acceleration = state[:3]
    pins = points(oracle, state)
    links = [(mechanism.crank, (mp.mpc(0),) * 3), (mechanism.coupler, pins['A'])]
    if hasattr(mechanism, 'rod'):
        links.append((mechanism.rod, pins['B']))
    elif not hasattr(mechanism, 'slider'):
        links.append((mechanism.rocker, (_pivot(oracle), mp.mpc(0), mp.mpc(0))))
    found = []
    for link, (body, pin) in enumerate(links):
        lever = complex_of(body.center) * mp.expj(position[link])
        spin, faster = velocity[link], acceleration[link]
        motion = lever, 1j * spin * lever, mp.mpc(-(spin**2), faster) * lever
        mass, inertia = mp.mpf(body.mass), mp.mpf(body.inertia)
        centre = (x + y for x, y in zip(pin, motion, strict=True))
        found.append(Part(mass, inertia, spin, faster, *centre))
    if hasattr(mechanism, 'slider'):
        slider_pin = pins['D' if hasattr(mechanism, 'rod') else 'B']
        found.append(Part(mp.mpf(mechanism.slider.mass), None, mp.mpf(0), mp.mpf(0), *slider_pin))
    return found


def momenta(oracle, state):
    """Linear momentum, and angular momentum about A0, in the caller's precision."""
    bodies = parts(oracle, state)
    linear = sum(body.mass * body.velocity for body in bodies)
    angular = sum(
        body.mass * cross(body.place, body.velocity) + (body.inertia or 0) * body.spin
        for body in bodies
    )
    return linear, angular


def applied_forces(oracle, state):
    """On each body: its weight, and on the slider the external force; then the damper's."""
    mechanism = oracle.mechanism
    applied = [body.mass * complex_of(mechanism.gravity) for body in parts(oracle, state)]
    damper = mp.mpc(0)
    if hasattr(mechanism, 'slider'):
        guide = _guide(oracle)
        applied[-1] += mp.mpf(getattr(mechanism.slider, 'force', 0)) * guide
        damper = -mp.mpf(mechanism.slider.damping) * state[1][-1] * guide
    return applied, damper


def reactions(oracle, *motion):
    """All forces in a state that is not a change point.

    Args:
        oracle: Oracle, SliderOracle or PumpOracle.
        *motion: As for its `state`.
    """
    state = oracle.state(*motion)
    mechanism = oracle.mechanism
    with mp.workdps(_DIGITS):
        bodies = parts(oracle, state)
        place = {name: motion[0] for name, motion in points(oracle, state).items()}
        # Unknown forces: name, where, along which direction, on which body, from which body.
        joints = [('A0', mp.mpc(0), 0, None), ('A', place['A'], 1, 0), ('B', place['B'], 2, 1)]
        if hasattr(mechanism, 'rod'):
            joints.append(('D', place['D'], 3, 2))
        elif not hasattr(mechanism, 'slider'):
            joints.append(('B0', _pivot(oracle), 2, None))
        unknown = [
            (name, at, unit, onto, source)
            for name, at, onto, source in joints
            for unit in (mp.mpc(1), mp.mpc(0, 1))
        ]
        applied, damper = applied_forces(oracle, state)
        end = joints[-1][1]
        if hasattr(mechanism, 'slider'):
            guide = _guide(oracle)
            applied[-1] += damper
            unknown.append(('guide', end, 1j * guide, len(bodies) - 1, None))
        if hasattr(mechanism, 'rod'):
            # Nothing drives the slider: what would have to is found to be 0.
            unknown.append(('drive', end, guide, len(bodies) - 1, None))
        values = _solve_all(bodies, unknown, applied)
        torque = values[-1]
        forces = {}
        on_frame, moment = -damper, -torque - cross(end, damper)
        for value, (name, at, unit, _, source) in zip(values, unknown, strict=False):
            forces[name] = forces.get(name, 0) + value * unit
            if source is None:
                on_frame -= value * unit
                moment -= cross(at, value * unit)
        assert abs(forces.pop('drive', 0)) < 1e-30
        force = forces.pop('guide', None)
        along = None if force is None else (force / (1j * guide)).real
        return Forces(forces, along, on_frame, moment, torque)


def _solve_all(bodies, unknown, applied):
    """The unknown forces' sizes, and last the torque: per body two force balances and a moment.

    A slider does not turn: of it only the forces count.
    """
    rows, right = [], []
    for number, (body, force) in enumerate(zip(bodies, applied, strict=True)):
        acts = [(number == onto) - (number == source) for *_, onto, source in unknown]
        units = [unit for _, _, unit, _, _ in unknown]
        needed = body.mass * body.acceleration - force
        for part, size in (('real', needed.real), ('imag', needed.imag)):
            rows.append([x * getattr(u, part) for x, u in zip(acts, units, strict=True)] + [0])
            right.append(size)
        if body.inertia is None:
            continue
        levers = [at - body.place for _, at, *_ in unknown]
        row = [x * cross(y, u) for x, y, u in zip(acts, levers, units, strict=True)]
        rows.append([*row, 1 if number == 0 else 0])
        right.append(body.inertia * body.angular_acceleration)
    return list(mp.lu_solve(mp.matrix(rows), mp.matrix(right)))


def _pivot(oracle):
    frame = oracle.mechanism.frame
    return mpf(oracle.lengths[3]) * mp.expj(mp.mpf(frame.angle))


def _guide(oracle):
    """Direction of the guide; a wind pump's is the x axis."""
    frame = getattr(oracle.mechanism, 'frame', None)
    return mp.mpc(1) if frame is None else mp.expj(mp.mpf(frame.angle))
