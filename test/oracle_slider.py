# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The slider-crank again, in 50 digits and by other routes than the package's.

Position: the circle about A meets the guide's line, as textbooks have it: half a chord on either
side of the perpendicular's foot. Rates and accelerations: the 2x2 systems of the differentiated
loop equation, in world axes. Torque: Newton-Euler for each body, through the pin forces.
All of this is singular at a change point, but the motion is analytic there: the mean of two
positions 1e-60 rad to either side is the limit.
"""

from __future__ import annotations

import math
from fractions import Fraction

from mpmath import mp
from oracle import ASIDE, Reference, complex_of, cross, dot, mean, mpf, solve, wrap


class SliderOracle:
    """States of one slider-crank.

    lengths (crank, coupler, offset), as fractions or decimal text, replace the doubles of the
    mechanism where those only stand for rounded decimals.
    """

    turning = True, True, False

    def __init__(self, mechanism, lengths=None):
        self.mechanism = mechanism
        doubles = mechanism.crank.length, mechanism.coupler.length, mechanism.slider.offset
        self.lengths = tuple(Fraction(x) for x in lengths or doubles)
        r, b, e = self.lengths
        # A change point where the crank stands across the guide: on the offset's side (alpha =
        # pi/2 from the guide) and on the other. There the coupler stands across it as well.
        self.upper = r - e == b
        self.lower = r + e == b
        self.passes_change_point = self.upper or self.lower

    def angle(self, crank):
        """Crank angle counted from the guide, whose own angle is taken nearest to zero."""
        angle = mp.mpf(self.mechanism.frame.angle)
        return mp.mpf(crank) - wrap(angle)

    def closes(self, crank):
        """Whether the circle about A meets the guide's line."""
        with mp.workdps(100):
            r, b, e = (mpf(x) for x in self.lengths)
            return bool(abs(e - r * mp.sin(self.angle(crank))) <= b)

    def state(self, crank, speed=0.0, acceleration=0.0):
        """The state at exactly these doubles, to 50 digits or more."""
        with mp.workdps(400):
            quarter = self.angle(crank) / mp.pi - mp.mpf(0.5)
            nearest = abs(quarter - mp.nint(quarter))
            # Nearer than any difference of doubles: only the rounding of these 400 digits.
            hit = nearest < mp.mpf('1e-350')
        singular = hit and (self.upper or self.lower)
        nearness = 60 if hit else int(-mp.log10(nearest))
        # Twice the nearness is lost in the half chord, as much again in the systems.
        with mp.workdps(60 + 6 * max(nearness, 16)):
            motion = mp.mpf(crank), mp.mpf(speed), mp.mpf(acceleration)
            if not singular:
                return self._state(*motion)
            aside = mp.mpf(ASIDE)
            before = self._state(motion[0] - aside, *motion[1:])
            after = self._state(motion[0] + aside, *motion[1:])
            turned = wrap(after.position[1] - before.position[1])
            return Reference(
                (
                    motion[0],
                    wrap(before.position[1] + turned / 2),
                    (before.position[2] + after.position[2]) / 2,
                ),
                mean(before.velocity, after.velocity),
                mean(before.acceleration, after.acceleration),
                (before.torque + after.torque) / 2,
            )

    def energy(self, crank, speed):
        """Kinetic plus potential energy, J, in the caller's precision; not at change points."""
        mechanism = self.mechanism
        A, coupler, B = self._pose(mp.mpf(crank))
        gravity = complex_of(mechanism.gravity)
        spin, slide = self._rates(A, coupler, speed)
        total = mp.mpf(mechanism.slider.mass) * (slide**2 / 2 - dot(gravity, B))
        for body, pin, pin_velocity, vector, rate in (
            (mechanism.crank, 0, 0, A, speed),
            (mechanism.coupler, A, 1j * speed * A, coupler, spin),
        ):
            lever = _lever(body, vector)
            speed_squared = abs(pin_velocity + 1j * rate * lever) ** 2
            weight = dot(gravity, pin + lever)
            total += mp.mpf(body.mass) * (speed_squared / 2 - weight)
            total += mp.mpf(body.inertia) * rate**2 / 2
        return total

    def natural(self, speed, acceleration):
        """What each quantity is like in a mechanism of this size at this speed."""
        mechanism = self.mechanism
        r, b, e = (abs(float(x)) for x in self.lengths)
        square, gravity = speed**2 + abs(acceleration), math.hypot(*mechanism.gravity)
        force = abs(mechanism.slider.force) + mechanism.slider.damping * r * abs(speed)
        force += mechanism.slider.mass * (r * square + gravity)
        torque = r * force
        for body in (mechanism.crank, mechanism.coupler):
            torque += body.inertia * square
            torque += body.mass * max(r, b) * (max(r, b) * square + gravity)
        slide = 1.0, 1.0, r
        rates = [abs(speed) * x for x in slide]
        return 1.0, 1.0, r + b + e, *rates, *(square * x for x in slide), torque

    def _guide(self):
        return mp.expj(mp.mpf(self.mechanism.frame.angle))

    def _state(self, crank, speed, acceleration):
        A, coupler, B = self._pose(crank)
        spin, slide = self._rates(A, coupler, speed)
        rest = A * mp.mpc(-(speed**2), acceleration) - coupler * spin**2
        spin_up, slide_up = solve(1j * coupler, -self._guide(), -rest)
        velocity = speed, spin, slide
        accelerations = acceleration, spin_up, slide_up
        torque = self._torque(A, coupler, velocity, accelerations)
        position = crank, mp.arg(coupler), dot(self._guide(), B)
        return Reference(position, velocity, accelerations, torque)

    def _pose(self, crank):
        """Crank pin, coupler as a vector from it, slider pin."""
        r, b, e = (mpf(x) for x in self.lengths)
        guide = self._guide()
        A = r * mp.expj(crank)
        foot = 1j * e * guide + dot(guide, A) * guide
        half_chord = mp.sqrt(b**2 - abs(foot - A) ** 2)
        B = foot + self._side(crank) * half_chord * guide
        return A, B - A, B

    def _side(self, crank):
        """+1 where the slider is on the + side of the crank pin, -1 where on the other.

        The assembly names the side at alpha in (-pi/2, pi/2). Each change point between there
        and alpha is passed straight through: the slider changes sides.
        """
        interval = int(mp.floor(self.angle(crank) / mp.pi + mp.mpf(0.5)))
        # The change point between interval j - 1 and j is the upper one for odd j.
        passed = range(1, interval + 1) if interval > 0 else range(interval + 1, 1)
        changes = sum(self.upper if j % 2 else self.lower for j in passed)
        return (1 if self.mechanism.assembly == 'open' else -1) * (-1) ** changes

    def _rates(self, A, coupler, speed):
        return solve(1j * coupler, -self._guide(), -1j * A * speed)

    def _torque(self, A, coupler, velocity, accelerations):
        mechanism, guide = self.mechanism, self._guide()
        gravity = complex_of(mechanism.gravity)
        slider = mechanism.slider
        # Along the guide, the coupler pushes the slider with what its other forces lack.
        along = mp.mpf(slider.mass) * (accelerations[2] - dot(gravity, guide))
        along += mp.mpf(slider.damping) * velocity[2] - mp.mpf(slider.force)
        lever = _lever(mechanism.coupler, coupler)
        at_A = A * mp.mpc(-(velocity[0] ** 2), accelerations[0])
        centre = at_A + lever * mp.mpc(-(velocity[1] ** 2), accelerations[1])
        force = mp.mpf(mechanism.coupler.mass) * (centre - gravity)
        # Across it, with what the coupler's moments about A require.
        moment = mp.mpf(mechanism.coupler.inertia) * accelerations[1] + cross(lever, force)
        across = -(moment + along * cross(coupler, guide)) / cross(coupler, 1j * guide)
        on_coupler_at_A = force + along * guide + across * 1j * guide
        crank = _lever(mechanism.crank, A)
        centre = crank * mp.mpc(-(velocity[0] ** 2), accelerations[0])
        force = mp.mpf(mechanism.crank.mass) * (centre - gravity)
        moment = mp.mpf(mechanism.crank.inertia) * accelerations[0] + cross(crank, force)
        return moment + cross(A, on_coupler_at_A)


def _lever(body, vector):
    """From the body's first pin to its centre of mass."""
    return complex_of(body.center) * vector / abs(vector)
