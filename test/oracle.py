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
from mpmath import mp

ASIDE = '1e-60'


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

    turning = True, True, True

    def __init__(self, mechanism, lengths=None):
        self.mechanism = mechanism
        links = mechanism.crank, mechanism.coupler, mechanism.rocker, mechanism.frame
        self.lengths = tuple(Fraction(x) for x in lengths or [link.length for link in links])
        r, b, c, d = self.lengths
        # A change point at theta = pi, and one at theta = 0.
        self.stretched = b + c == d + r
        self.folded = abs(d - r) == abs(b - c)
        self.passes_change_point = self.stretched or self.folded

    def angle(self, crank):
        """Crank angle counted from the frame, whose own angle is taken nearest to zero."""
        delta = mp.mpf(self.mechanism.frame.angle)
        return mp.mpf(crank) - (delta - 2 * mp.pi * mp.nint(delta / (2 * mp.pi)))

    def closes(self, crank):
        """Whether the circles about A and B0 meet."""
        with mp.workdps(100):
            r, b, c, d = (mpf(x) for x in self.lengths)
            distance = abs(d - r * mp.expj(self.angle(crank)))
            return bool(abs(b - c) <= distance <= b + c)

    def state(self, crank, speed=0.0, acceleration=0.0):
        """The state at exactly these doubles, to 50 digits or more."""
        with mp.workdps(400):
            theta = self.angle(crank)
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
            aside = mp.mpf(ASIDE)
            before = self._state(motion[0] - aside, *motion[1:])
            after = self._state(motion[0] + aside, *motion[1:])
            return Reference(
                tuple(
                    wrap(x + wrap(y - x) / 2)
                    for x, y in zip(before.position, after.position, strict=True)
                ),
                mean(before.velocity, after.velocity),
                mean(before.acceleration, after.acceleration),
                (before.torque + after.torque) / 2,
            )

    def energy(self, crank, speed):
        """Kinetic plus potential energy, J, in the caller's precision; not at change points."""
        poses = self._pose(mp.mpf(crank))
        rates = self._rates(poses, speed)
        total = mp.mpf(0)
        for _, mass, _, center, velocity, _ in self._bodies(poses, rates, (0, 0, 0)):
            weight = mass * dot(complex_of(self.mechanism.gravity), center)
            total += mass * abs(velocity) ** 2 / 2 - weight
        for body, rate in zip(self._links(), rates, strict=True):
            total += mp.mpf(body.inertia) * rate**2 / 2
        return total

    def natural(self, speed, acceleration):
        """What each quantity is like in a linkage of this size at this speed."""
        square, longest = speed**2 + abs(acceleration), float(max(self.lengths))
        gravity = math.hypot(*self.mechanism.gravity)
        torque = sum(
            body.inertia * square + body.mass * longest * (longest * square + gravity)
            for body in self._links()
        )
        return *[1.0] * 3, *[abs(speed)] * 3, *[square] * 3, torque

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
        r, b, c, d = (mpf(x) for x in self.lengths)
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
        interval = int(mp.floor(self.angle(crank) / mp.pi))
        passed = range(1, interval + 1) if interval > 0 else range(interval + 1, 1)
        changes = sum(self.stretched if j % 2 else self.folded for j in passed)
        return (1 if self.mechanism.assembly == 'open' else -1) * (-1) ** changes

    def _rates(self, poses, speed):
        crank, coupler, rocker = poses
        return speed, *solve(1j * coupler, -1j * rocker, -1j * crank * speed)

    def _accelerations(self, poses, rates, acceleration):
        crank, coupler, rocker = poses
        rest = crank * mp.mpc(-(rates[0] ** 2), acceleration)
        rest += rocker * rates[2] ** 2 - coupler * rates[1] ** 2
        return acceleration, *solve(1j * coupler, -1j * rocker, -rest)

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
            (mpf(self.lengths[3]) * mp.expj(mp.mpf(self.mechanism.frame.angle)), 0, 0),
        )
        for body, pose, rate, spin, (place, velocity, acceleration) in zip(
            self._links(), poses, rates, accelerations, pins, strict=True
        ):
            lever = complex_of(body.center) * pose / abs(pose)
            yield (
                lever,
                mp.mpf(body.mass),
                mp.mpf(body.inertia),
                place + lever,
                velocity + 1j * rate * lever,
                acceleration + mp.mpc(-(rate**2), spin) * lever,
            )

    def _torque(self, poses, rates, accelerations):
        gravity = complex_of(self.mechanism.gravity)
        moments, forces = [], []
        for (lever, mass, inertia, _, _, acceleration), spin in zip(
            self._bodies(poses, rates, accelerations), accelerations, strict=True
        ):
            force = mass * (acceleration - gravity)
            moments.append(inertia * spin + cross(lever, force))
            forces.append(force)
        # The pin force at B on the rocker, from the moments about A (coupler) and B0 (rocker).
        coupler, rocker = poses[1], poses[2]
        x, y = solve(
            mp.mpc(coupler.imag, -rocker.imag),
            mp.mpc(-coupler.real, rocker.real),
            mp.mpc(moments[1], moments[2]),
        )
        on_coupler_at_A = forces[1] + mp.mpc(x, y)
        return moments[0] + cross(poses[0], on_coupler_at_A)


def wrap(angle):
    """Brought into [-pi, pi]."""
    return angle - 2 * mp.pi * mp.nint(angle / (2 * mp.pi))


def mpf(fraction):
    return mp.mpf(fraction.numerator) / fraction.denominator


def complex_of(pair):
    return mp.mpc(mp.mpf(pair[0]), mp.mpf(pair[1]))


def dot(u, v):
    return (mp.conj(u) * v).real


def cross(u, v):
    return (mp.conj(u) * v).imag


def solve(u, v, w):
    """Real x, y with x u + y v = w, all three complex."""
    determinant = cross(u, v)
    return cross(w, v) / determinant, cross(u, w) / determinant


def mean(first, second):
    return tuple((x + y) / 2 for x, y in zip(first, second, strict=True))
