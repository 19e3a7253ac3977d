# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The four-bar again, in 50 digits and by other routes than the package's.

Position: the circles about A and B0 are intersected as textbooks do it; the cancellation that
spoils this in double precision is paid for with digits. Rates and accelerations: the 2x2 systems
of the differentiated loop equation. Torque: Newton-Euler for each body, through the pin forces.
All of this is singular at a change point, but the motion is analytic there: the mean of two
positions 1e-60 rad to either side is the limit.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import NamedTuple

import mpmath
import numpy as np
from mpmath import mp

_ASIDE = '1e-60'


class Reference(NamedTuple):
    """As linkage_ros.State, in mpf."""

    position: tuple
    velocity: tuple
    acceleration: tuple
    torque: mpmath.mpf


class Oracle:
    """States of one four-bar.

    lengths (crank, coupler, rocker, frame), as fractions or decimal text, replace the doubles
    of the mechanism where those only stand for rounded decimals.
    """

    def __init__(self, mechanism, lengths=None):
        self.mechanism = mechanism
        links = mechanism.crank, mechanism.coupler, mechanism.rocker, mechanism.frame
        self.lengths = tuple(Fraction(x) for x in lengths or [link.length for link in links])
        r, b, c, d = self.lengths
        # A change point at theta = pi, and one at theta = 0.
        self.stretched = b + c == d + r
        self.folded = abs(d - r) == abs(b - c)

    def theta(self, crank):
        """Crank angle counted from the frame, whose own angle is taken nearest to zero."""
        delta = mp.mpf(self.mechanism.frame.angle)
        return mp.mpf(crank) - (delta - 2 * mp.pi * mp.nint(delta / (2 * mp.pi)))

    def closes(self, crank):
        """Whether the circles about A and B0 meet."""
        with mp.workdps(100):
            r, b, c, d = (_mpf(x) for x in self.lengths)
            distance = abs(d - r * mp.expj(self.theta(crank)))
            return bool(abs(b - c) <= distance <= b + c)

    def state(self, crank, speed=0.0, acceleration=0.0):
        """The state at exactly these doubles, to 50 digits or more."""
        with mp.workdps(400):
            theta = self.theta(crank)
            nearest = abs(theta - mp.pi * mp.nint(theta / mp.pi))
            # Nearer than any difference of doubles: only the rounding of these 400 digits.
            hit = nearest < mp.mpf('1e-350')
        singular = hit and (self.folded or self.stretched)
        nearness = 60 if hit else int(-mp.log10(nearest))
        # Twice the nearness is lost in the height of the triangle, as much again in the systems.
        with mp.workdps(60 + 6 * max(nearness, 16)):
            motion = mp.mpf(crank), mp.mpf(speed), mp.mpf(acceleration)
            if not singular:
                return self._state(*motion)
            aside = mp.mpf(_ASIDE)
            before = self._state(motion[0] - aside, *motion[1:])
            after = self._state(motion[0] + aside, *motion[1:])
            return Reference(
                tuple(
                    wrap(x + wrap(y - x) / 2)
                    for x, y in zip(before.position, after.position, strict=True)
                ),
                _mean(before.velocity, after.velocity),
                _mean(before.acceleration, after.acceleration),
                (before.torque + after.torque) / 2,
            )

    def energy(self, crank, speed):
        """Kinetic plus potential energy, J, in the caller's precision; not at change points."""
        poses = self._pose(mp.mpf(crank))
        rates = self._rates(poses, speed)
        total = mp.mpf(0)
        for _, mass, _, center, velocity, _ in self._bodies(poses, rates, (0, 0, 0)):
            weight = mass * _dot(_complex(self.mechanism.gravity), center)
            total += mass * abs(velocity) ** 2 / 2 - weight
        for body, rate in zip(self._links(), rates, strict=True):
            total += mp.mpf(body.inertia) * rate**2 / 2
        return total

    def _links(self):
        return self.mechanism.crank, self.mechanism.coupler, self.mechanism.rocker

    def _state(self, crank, speed, acceleration):
        poses = self._pose(crank)
        rates = self._rates(poses, speed)
        accelerations = self._accelerations(poses, rates, acceleration)
        torque = self._torque(poses, rates, accelerations)
        angles = tuple(mp.arg(pose) for pose in poses[1:])
        return Reference((crank, *angles), rates, accelerations, torque)

    def _pose(self, crank):
        """The links as vectors from first to second pin."""
        r, b, c, d = (_mpf(x) for x in self.lengths)
        A = r * mp.expj(crank)
        B0 = d * mp.expj(mp.mpf(self.mechanism.frame.angle))
        distance = abs(B0 - A)
        along = (b**2 - c**2 + distance**2) / (2 * distance)
        across = mp.sqrt(b**2 - along**2)
        B = A + (B0 - A) / distance * mp.mpc(along, self._side(crank) * across)
        return A, B - A, B - B0

    def _side(self, crank):
        """+1 where B lies left of the line from A to B0, -1 where right of it.

        The assembly names the side at theta in (0, pi). Each change point between there and
        theta is passed straight through: B changes sides.
        """
        interval = int(mp.floor(self.theta(crank) / mp.pi))
        passed = range(1, interval + 1) if interval > 0 else range(interval + 1, 1)
        changes = sum(self.stretched if j % 2 else self.folded for j in passed)
        return (1 if self.mechanism.assembly == 'open' else -1) * (-1) ** changes

    def _rates(self, poses, speed):
        crank, coupler, rocker = poses
        return speed, *_solve(1j * coupler, -1j * rocker, -1j * crank * speed)

    def _accelerations(self, poses, rates, acceleration):
        crank, coupler, rocker = poses
        rest = crank * mp.mpc(-(rates[0] ** 2), acceleration)
        rest += rocker * rates[2] ** 2 - coupler * rates[1] ** 2
        return acceleration, *_solve(1j * coupler, -1j * rocker, -rest)

    def _bodies(self, poses, rates, accelerations):
        """For each body: mass, inertia, and its centre's position, velocity, acceleration.

        First comes the centre's lever about the body's first pin.
        """
        pins = (
            (mp.mpc(0), mp.mpc(0), mp.mpc(0)),
            (
                poses[0],
                1j * rates[0] * poses[0],
                mp.mpc(-(rates[0] ** 2), accelerations[0]) * poses[0],
            ),
            (_mpf(self.lengths[3]) * mp.expj(mp.mpf(self.mechanism.frame.angle)), 0, 0),
        )
        for body, pose, rate, spin, (place, velocity, acceleration) in zip(
            self._links(), poses, rates, accelerations, pins, strict=True
        ):
            lever = _complex(body.center) * pose / abs(pose)
            yield (
                lever,
                mp.mpf(body.mass),
                mp.mpf(body.inertia),
                place + lever,
                velocity + 1j * rate * lever,
                acceleration + mp.mpc(-(rate**2), spin) * lever,
            )

    def _torque(self, poses, rates, accelerations):
        gravity = _complex(self.mechanism.gravity)
        moments, forces = [], []
        for (lever, mass, inertia, _, _, acceleration), spin in zip(
            self._bodies(poses, rates, accelerations), accelerations, strict=True
        ):
            force = mass * (acceleration - gravity)
            moments.append(inertia * spin + _cross(lever, force))
            forces.append(force)
        # The pin force at B on the rocker, from the moments about A (coupler) and B0 (rocker).
        coupler, rocker = poses[1], poses[2]
        x, y = _solve(
            mp.mpc(coupler.imag, -rocker.imag),
            mp.mpc(-coupler.real, rocker.real),
            mp.mpc(moments[1], moments[2]),
        )
        on_coupler_at_A = forces[1] + mp.mpc(x, y)
        return moments[0] + _cross(poses[0], on_coupler_at_A)


def wrap(angle):
    """Brought into [-pi, pi]."""
    return angle - 2 * mp.pi * mp.nint(angle / (2 * mp.pi))


def _mpf(fraction):
    return mp.mpf(fraction.numerator) / fraction.denominator


def _complex(pair):
    return mp.mpc(mp.mpf(pair[0]), mp.mpf(pair[1]))


def _dot(u, v):
    return (mp.conj(u) * v).real


def _cross(u, v):
    return (mp.conj(u) * v).imag


def _solve(u, v, w):
    """Real x, y with x u + y v = w, all three complex."""
    determinant = _cross(u, v)
    return _cross(w, v) / determinant, _cross(u, w) / determinant


def _mean(first, second):
    return tuple((x + y) / 2 for x, y in zip(first, second, strict=True))


def worst_errors(
    solver, angles, speed=1.0, acceleration=0.0, lengths=None, period=24, floor=1e-20
):
    """Errors of angle, rate, acceleration and torque, over each quantity's largest value.

    Angles count in rad. The largest values are those over these angles and `period` more,
    spread over two turns. A quantity below `floor` of its like (the crank's spin, its square,
    the moments of the weights and inertia forces), such as the spin of a parallelogram's
    coupler, is held to that.

    Args:
        solver: The solver under test.
        angles: Crank angles, rad; each is asked for alone and as one array.
        speed: Crank speed, rad/s.
        acceleration: Crank acceleration, rad/s^2.
        lengths: As for Oracle.
        period: Number of angles added for the largest values only; 0 for a limited crank.
        floor: See above.

    Returns:
        The four largest errors, whichever the link and the way of asking.
    """
    oracle = Oracle(solver.mechanism, lengths)
    expected = [_row(oracle.state(x, speed, acceleration)) for x in angles]
    start = float(mp.mpf(angles[0]) - oracle.theta(angles[0])) + 0.1
    spread = [start + 4 * math.pi * i / period for i in range(period)]
    around = [_row(oracle.state(x, speed, acceleration)) for x in spread]
    largest = [max(abs(row[i]) for row in expected + around) for i in range(10)]
    natural = [1.0] * 3 + [abs(speed)] * 3 + [speed**2 + abs(acceleration)] * 3
    natural.append(_natural_torque(oracle, natural[-1]))
    largest[:3] = [mp.mpf(1)] * 3
    scales = [x if x > floor * n else mp.mpf(n) for x, n in zip(largest, natural, strict=True)]
    one_by_one = [_row(solver.state(x, speed, acceleration)) for x in angles]
    together = solver.state(np.array(angles), speed, acceleration)
    worst = [0.0] * 10
    for got in (one_by_one, np.array(_row(together)).T.tolist()):
        for row, right in zip(got, expected, strict=True):
            for i in range(10):
                error = mp.mpf(row[i]) - right[i]
                if i < 3:
                    error = wrap(error)
                worst[i] = max(worst[i], float(abs(error) / scales[i]) if scales[i] else 0.0)
    return max(worst[:3]), max(worst[3:6]), max(worst[6:9]), worst[9]


def _row(state):
    return *state.position, *state.velocity, *state.acceleration, state.torque


def _natural_torque(oracle, square):
    longest = float(max(oracle.lengths))
    gravity = math.hypot(*oracle.mechanism.gravity)
    links = oracle._links()
    return sum(
        body.inertia * square + body.mass * longest * (longest * square + gravity)
        for body in links
    )
