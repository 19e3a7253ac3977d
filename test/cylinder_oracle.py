# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reference for the inverted slider-crank in many digits; see `oracle`.

Barrel and rod are bodies of their own: the Newton-Euler equations of all three bodies about their
centres of mass, with the force and the moment between barrel and rod as unknowns, are solved
together with the second derivative of the loop A = B0 + (s + i e) e^(i phi).
"""

import functools
from fractions import Fraction

from mpmath import mp
from oracle import (
    Oracle,
    Point,
    Reference,
    Rubbing,
    between,
    complex_of,
    cross,
    dot,
    periodic,
    settle,
    solutions,
    solve,
    wrap,
)

NAMES = 'crank', 'barrel', 'rod'
PINS = ('A0', 0, None), ('A', 2, 0), ('B0', 1, None)  # pin, body on which its force acts, other


class CylinderOracle(Oracle):
    """Computes the states of an inverted slider-crank, driven at its crank or its cylinder."""

    def __init__(self, mechanism, lengths=None):
        self.mechanism = mechanism
        self.bodies = [getattr(mechanism, name) for name in NAMES]
        self.turning, self.slides, self.is_free = [True, True, False], True, False
        self.by_rod = mechanism.coordinates == ('rod',)
        doubles = mechanism.crank.length, mechanism.frame.length, mechanism.offset
        self.lengths = tuple(map(Fraction, lengths or doubles))
        self.passes_change_point = self.folded = self.stretched = False
        self.state = functools.cache(self._state)

    def angle(self, crank):
        """Returns the crank's angle from the frame."""
        return mp.mpf(crank) - wrap(mp.mpf(self.mechanism.frame.angle))

    def closes(self, crank):
        """Returns whether the rod reaches the crank pin."""
        with mp.workdps(100):
            r, d, e = map(mp.convert, self.lengths)
            return bool(abs(r * mp.expj(self.angle(crank)) - d) > abs(e))

    def _state(self, q, u=0.0, a=0.0):
        with mp.workdps(120):
            return self.solve(q, u, a)

    def pivot(self):
        """Returns B0."""
        return mp.convert(self.lengths[1]) * mp.expj(mp.mpf(self.mechanism.frame.angle))

    def motion(self, q, u):
        """Returns the crank's vector, the barrel's unit vector and s, and their rates."""
        (r, d, e), pivot = map(mp.convert, self.lengths), self.pivot()
        q, u = (x[0] if isinstance(x, tuple) else x for x in (q, u))
        if self.by_rod:
            s = mp.mpf(q)
            along = (r**2 + d**2 - s**2 - e**2) / (2 * d)
            side = 1 if self.mechanism.assembly == 'open' else -1
            A = pivot / d * mp.mpc(along, side * mp.sqrt(r**2 - along**2))
        else:
            A = r * mp.expj(mp.mpf(q))
            s = mp.sqrt(abs(A - pivot) ** 2 - e**2)
        barrel = (A - pivot) / mp.mpc(s, e)
        given, others = (2, (0, 1)) if self.by_rod else (0, (1, 2))
        slopes = self.loop_slopes([A, barrel, s])
        found = solve(*(slopes[j] for j in others), -slopes[given] * mp.mpf(u))
        rates = [mp.mpf(u)] * 3
        for j, rate in zip(others, found, strict=True):
            rates[j] = rate
        return [A, barrel, s], rates

    def loop_slopes(self, vectors):
        """Returns the derivatives of A - B0 - (s + i e) e^(i phi)."""
        A, barrel, s = vectors
        return [1j * A, -1j * mp.mpc(s, mp.convert(self.lengths[2])) * barrel, -barrel]

    def gap(self, position):
        """Returns the closure error of the loop, m, at positions of the links."""
        r, _, e = map(mp.convert, self.lengths)
        crank, barrel = (mp.expj(mp.mpf(x)) for x in position[:2])
        return abs(r * crank - self.pivot() - mp.mpc(position[2], e) * barrel)

    def points(self, vectors):
        """Returns the pins, and the mouth of the barrel."""
        r, d, e = map(mp.convert, self.lengths)
        short, long = (d - r) ** 2 - e**2, (d + r) ** 2 - e**2
        mouth = mp.mpc(mp.sqrt(short if short > 0 else long), e)
        return {
            'A0': Point(0, {}), 'A': Point(0, {0: vectors[0]}), 'B0': Point(self.pivot(), {}),
            'E': Point(self.pivot(), {1: mouth * vectors[1]}),
        }  # fmt: skip

    def vectors(self, state):
        """Returns the crank's vector, the barrel's unit vector and s."""
        crank, barrel, s = state.position
        return [mp.convert(self.lengths[0]) * mp.expj(crank), mp.expj(barrel), s]

    def place_on(self, k, at, vectors):
        """Returns a point of a body; None is the frame."""
        if k is None:
            return Point(complex_of(at), {})
        A, barrel, _ = vectors
        lever = complex_of(at) * (A / abs(A) if k == 0 else barrel)
        carried = [{0: lever}, {1: lever}, {0: A, 1: lever}][k]
        return Point(self.pivot() if k == 1 else mp.mpc(0), carried)

    def centers(self, vectors):
        """Returns the centres of mass."""
        return [self.place_on(k, body.center, vectors) for k, body in enumerate(self.bodies)]

    def efforts(self, q, vectors, rates):
        """Returns couples on the bodies, those from outside, and the force along the cylinder."""
        couples, outside, along = [mp.mpf(0)] * 3, mp.mpf(0), mp.mpf(0)
        (_, _, s), rod = vectors, self.mechanism.rod
        along += mp.mpf(rod.force) - rod.damping * rates[2]
        along -= rod.stiffness * (s - mp.mpf(rod.rest_position))
        crank = mp.mpf(q)
        for load in self.mechanism.loads:
            kind = type(load).__name__
            if kind == 'Gas':
                along += self.gas(load, s, rates[2])
            elif kind == 'Pins':
                for name, on, of in PINS:
                    if load.pin in ('', name):
                        couple = load.damping * (self.spin(of, rates) - self.spin(on, rates))
                        couples[on] += couple
                        if of is not None:
                            couples[of] -= couple
            elif kind == 'LoadCurve' and load.link == 'crank':
                outside += periodic(load.at, load.value, crank, load.turns)
            elif kind == 'LoadCurve':
                along += self.curve(load, crank, s, rates[2])
        couples[0] += outside
        return couples, outside, along

    def curve(self, load, crank, s, rate):
        """Returns the force of a curve along the cylinder."""
        if load.over == 'crank_angle_from_tdc':  # the crank points to B0 where the rod is far
            crank -= mp.mpf(self.mechanism.frame.angle) + (mp.pi if load.top == 'near' else 0)
        if load.pressure is not None:
            return self.push(load, periodic(load.at, load.pressure, crank, load.turns))
        if load.over == 'position':
            falls = rate < 0 and load.return_value is not None
            return between(load.at, load.return_value if falls else load.value, s)
        return periodic(load.at, load.value, crank, load.turns)

    def ends(self, load):
        """Returns s at the top of the gas and at the bottom."""
        r, d, e = map(mp.convert, self.lengths)
        short, long = (mp.sqrt(x**2 - e**2) for x in (d - r, d + r))
        return (long, short) if load.top == 'near' else (short, long)

    @staticmethod
    def spin(k, rates):
        """Returns the angular velocity of a body; that of the rod is the barrel's."""
        return 0 if k is None else rates[min(k, 1)]

    def forces_at_points(self, vectors, rates):
        """Returns forces at points: body, point, force, and whether it is external."""
        found = []
        for load in self.mechanism.loads:
            names = [*NAMES, 'frame']
            if type(load).__name__ == 'Force':
                k, force = names.index(load.link), complex_of(load.force)
                if load.axes == 'link':
                    force *= vectors[1] if k else vectors[0] / abs(vectors[0])
                found.append((k, self.place_on(k, load.at, vectors), force, True))
            elif type(load).__name__ == 'Spring':
                ends = [
                    (None if name == 'frame' else names.index(name), at)
                    for name, at in ((load.link, load.at), (load.to, load.to_at))
                ]
                points = [self.place_on(k, at, vectors) for k, at in ends]
                (here, u, _), (there, v, _) = (
                    self.follow(point, vectors, rates, rates) for point in points
                )
                towards = (there - here) / abs(there - here)
                pull = load.stiffness * (abs(there - here) - mp.mpf(load.free_length))
                pull += load.damping * dot(towards, v - u)
                for (k, _), point, sign in zip(ends, points, (1, -1), strict=True):
                    found.append((k, point, sign * pull * towards, False))
        return found

    def solve(self, q, u, a):
        """Computes the state in the caller's precision."""
        q, u, a = (x[0] if isinstance(x, tuple) else x for x in (q, u, a))
        vectors, rates = self.motion(q, u)
        crank = mp.arg(vectors[0]) if self.by_rod else mp.mpf(q)
        couples, outside, along = self.efforts(crank, vectors, rates)
        forces = self.forces_at_points(vectors, rates)
        found, rubbing, sizes = self._balanced(vectors, rates, a, couples, along, forces)
        exerted = [couples[0], couples[1] + couples[2], along]
        for rub, size in zip(rubbing, sizes, strict=True):
            for k, x in rub.on.items():
                exerted[k] += size * x
        for k, point, force, _ in forces:
            for j, x in point.carried.items() if k is not None else ():
                exerted[j] += dot(1j * x, force)
        pins = {name: mp.mpc(*found[3 + 2 * i : 5 + 2 * i]) for i, (name, *_) in enumerate(PINS)}
        pushes = tuple(
            (self.follow(point, vectors, rates, rates)[0], force)
            for _, point, force, is_external in forces if is_external
        )  # fmt: skip
        return Reference(
            (crank, mp.arg(vectors[1]), vectors[2]), tuple(rates), tuple(found[:3]), found[-1],
            {**pins, 'guide': found[9]}, tuple(exerted), (outside, 0, 0), pushes, found[10],
        )  # fmt: skip

    def _balanced(self, vectors, rates, driven, couples, along, pushes):
        """Solves for accelerations, pin forces, guide force and moment, and the drive.

        Returns:
            These 12 unknowns, the joints with friction, and the friction in each.
        """
        (A, barrel, s), rest = vectors, [mp.mpf(0)] * 3
        places = {'A0': mp.mpc(0), 'A': A, 'B0': self.pivot()}
        rubbing = self.rubbing(rates)
        rows = []
        for k, (body, center) in enumerate(zip(self.bodies, self.centers(vectors), strict=True)):
            at, _, bias = self.follow(center, vectors, rates, rest)
            mass = mp.mpf(body.mass)
            lead = (k == 2) - (k == 1)  # the guide pushes the rod, and the barrel back
            acting = [mass * 1j * center.carried.get(j, 0) for j in range(2)] + [mp.mpc(0)]
            turning = [mp.mpf(body.inertia) * (j == min(k, 1)) for j in range(3)]
            for name, on, of in PINS:
                sign = (k == of) - (k == on)
                acting += [sign * mp.mpc(1), sign * mp.mpc(0, 1)]
                turning += [sign * cross(places[name] - at, x) for x in (mp.mpc(1), mp.mpc(0, 1))]
            normal = lead * 1j * barrel
            acting += [-normal, mp.mpc(0)]
            turning += [-cross(A - at, normal), -lead * mp.mpf(1)]
            axial = lead * barrel
            acting.append(-axial if self.by_rod else mp.mpc(0))
            turning.append(-cross(A - at, axial) if self.by_rod else -mp.mpf(k == 0))
            force = mass * (complex_of(self.mechanism.gravity) - bias) + along * axial
            moment = couples[k] + along * cross(A - at, axial)
            for on, point, push, _ in pushes:
                if on == k:
                    force += push
                    moment += cross(self.follow(point, vectors, rates, rest)[0] - at, push)
            acting.append(force)
            turning.append(moment)
            for rub in rubbing:  # the right-hand sides of a unit of each friction
                if rub.joint == 'guide':
                    acting.append(rub.on[2] * axial)
                    turning.append(rub.on[2] * cross(A - at, axial))
                else:
                    acting.append(mp.mpc(0))
                    turning.append(self.sides(rub).get(k, mp.mpf(0)))
            rows += [[x.real for x in acting], [x.imag for x in acting], turning]
        slopes, zeros = self.loop_slopes(vectors), [mp.mpf(0)] * len(rubbing)
        reach = mp.mpc(s, mp.convert(self.lengths[2])) * barrel
        bias = -A * rates[0] ** 2 + reach * rates[1] ** 2 - 2j * barrel * rates[1] * rates[2]
        rows += [
            [*(getattr(x, part) for x in slopes), *[0] * 9, -getattr(bias, part), *zeros]
            for part in ('real', 'imag')
        ]
        given = [mp.mpf(0)] * 12
        given[2 if self.by_rod else 0] = mp.mpf(1)
        found = solutions([*rows, [*given, mp.mpf(driven), *zeros]])
        joints = [
            {**{name: mp.mpc(*x[3 + 2 * i : 5 + 2 * i]) for i, (name, *_) in enumerate(PINS)},
             'guide': x[9]}
            for x in zip(*found, strict=True)
        ]  # fmt: skip
        sizes = settle(rubbing, joints)
        return [
            first + sum(x * size for x, size in zip(added, sizes, strict=True))
            for first, *added in found
        ], rubbing, sizes  # fmt: skip

    def rubbing(self, rates):
        """Returns the joints with friction; a unit of that in pin A turns crank and barrel."""
        friction = next((x for x in self.mechanism.loads if hasattr(x, 'pin_radius')), None)
        if friction is None:
            return []
        factor, found = mp.mpf(friction.pin) * mp.mpf(friction.pin_radius), []
        for name, on, of in PINS:
            x = -mp.sign(self.spin(on, rates) - self.spin(of, rates))
            turned = {min(on, 1): x} if of is None else {min(on, 1): x, of: -x}
            found.append(Rubbing(name, factor, turned))
        guide = Rubbing('guide', mp.mpf(friction.guide), {2: -mp.sign(rates[2])})
        return [x for x in (*found, guide) if x.factor and any(x.on.values())]

    @staticmethod
    def sides(rub):
        """Returns the couples of a unit of friction in a pin, by body."""
        return {2 if rub.joint == 'A' and k == 1 else k: x for k, x in rub.on.items()}

    def shaking(self, state):
        """Computes the force on the frame, and its moment about A0 with the drive's reaction."""
        vectors, force, moment = self.vectors(state), mp.mpc(0), state.outside[0]
        for k, (body, center) in enumerate(zip(self.bodies, self.centers(vectors), strict=True)):
            place, _, change = self.follow(center, vectors, state.velocity, state.acceleration)
            push = mp.mpf(body.mass) * (complex_of(self.mechanism.gravity) - change)
            moment += cross(place, push) - mp.mpf(body.inertia) * state.acceleration[min(k, 1)]
            force += push
        for place, push in state.pushes:
            force += push
            moment += cross(place, push)
        return force, moment

    def energy(self, q, u):
        """Computes the kinetic plus potential energy of masses and of the rod's own load, J."""
        (vectors, rates), rod = self.motion(q, u), self.mechanism.rod
        total = mp.mpf(0)
        for k, (body, center) in enumerate(zip(self.bodies, self.centers(vectors), strict=True)):
            place, velocity, _ = self.follow(center, vectors, rates, rates)
            total += mp.mpf(body.mass) * abs(velocity) ** 2 / 2
            total -= mp.mpf(body.mass) * dot(complex_of(self.mechanism.gravity), place)
            total += mp.mpf(body.inertia) * rates[min(k, 1)] ** 2 / 2
        stretch = vectors[2] - mp.mpf(rod.rest_position)
        return total - mp.mpf(rod.force) * vectors[2] + mp.mpf(rod.stiffness) * stretch**2 / 2
