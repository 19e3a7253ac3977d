# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reference for all mechanisms in 50 digits, by methods other than the package's.

Positions are intersections of circles, or of a circle and the guide; enough digits compensate the
cancellation of this textbook method. Rates solve the 2x2 system of the differentiated loop. The
Newton-Euler equations of all bodies about their centres of mass, together with the second
derivative of the loop, form one linear system for accelerations, joint forces and torque. Friction
adds an unknown moment for each pin and a force for the guide, which Newton's method determines.

These systems are singular at a change point, but the motion is analytic there: the state is the
mean of the states 1e-60 rad on either side.
"""

import functools
import math
from contextlib import suppress
from fractions import Fraction
from typing import NamedTuple

import mpmath
from mpmath import mp

ASIDE = '1e-60'


class Reference(NamedTuple):
    """The fields of linkage_ros.State and linkage_ros.Reactions, in mpf and mpc.

    Attributes:
        position: Positions of the links; angles are in (-pi, pi], except the crank's.
        velocity: Velocities of the links.
        acceleration: Accelerations of the links.
        torque: Torque on the crank.
        joints: Forces in the pins by name, and the guide force, positive to the left; empty at a
            change point, where they are infinite.
        exerted: Torque, or force along the guide, of loads and friction on each link.
        outside: Share of `exerted` that is external to the machine and its frame.
        pushes: External forces at points, as pairs of a place and a force.
        moment: Moment of a barrel on its rod, about the rod's pin.
    """

    position: tuple
    velocity: tuple
    acceleration: tuple
    torque: mpmath.mpf
    joints: dict
    exerted: tuple = ()
    outside: tuple = ()
    pushes: tuple = ()
    moment: mpmath.mpf = 0


class Point(NamedTuple):
    """A point of the mechanism: a constant plus one vector for each link that carries the point.

    Attributes:
        fixed: The constant, m.
        carried: Vectors by index of the link; for a slider, the unit vector of its guide.
    """

    fixed: mpmath.mpc
    carried: dict


class Rubbing(NamedTuple):
    """A joint with dry friction, and the effect of a unit of its friction.

    Attributes:
        joint: Name of the pin, or 'guide'.
        factor: Friction per unit of joint force: m for a pin, a number for the guide.
        on: Torque on the links by index; for the guide, the force on the slider.
    """

    joint: str
    factor: mpmath.mpf
    on: dict


def load_fields(part):
    """Returns the parameters of a part's own load: force, damping, stiffness and rest."""
    if hasattr(part, 'torque'):
        return 'torque', 'damping', 'stiffness', 'rest_angle'
    return 'force', 'damping', 'stiffness', 'rest_position'


class Oracle:
    """Computes the states of a mechanism.

    `lengths` (crank, coupler, then rocker and frame, offset, or rod), as fractions or decimal
    text, replace the mechanism's lengths if these are only rounded decimals.
    """

    def __new__(cls, mechanism, lengths=None):
        from cylinder_oracle import CylinderOracle  # which imports this module

        return object.__new__(CylinderOracle if hasattr(mechanism, 'barrel') else cls)

    def __init__(self, mechanism, lengths=None):
        self.mechanism = mechanism
        names = 'crank', 'coupler', 'rod', 'rocker', 'slider'
        self.bodies = [getattr(mechanism, name) for name in names if hasattr(mechanism, name)]
        self.slides, self.is_free = hasattr(mechanism, 'slider'), hasattr(mechanism, 'rod')
        self.turning = [hasattr(body, 'length') for body in self.bodies]
        doubles = [body.length for body in self.bodies if hasattr(body, 'length')]
        if not self.is_free:
            doubles.append(mechanism.slider.offset if self.slides else mechanism.frame.length)
        r, b, *others = self.lengths = tuple(map(Fraction, lengths or doubles))
        # Change points at even and at odd multiples of pi of theta.
        self.folded = self.stretched = False
        if self.slides and not self.is_free:
            (e,) = others
            self.folded, self.stretched = r - e == b, r + e == b
        elif not self.slides:
            c, d = others
            self.folded, self.stretched = abs(d - r) == abs(b - c), b + c == d + r
        self.passes_change_point = self.stretched or self.folded
        self.state = functools.cache(self._state)

    def angle(self, crank):
        """Returns theta, the crank's angle from the frame, or from the normal of the guide.

        The angle of frame or guide is reduced to its value nearest to zero.
        """
        quarter = mp.pi / 2 if self.slides else 0
        return mp.mpf(crank) - wrap(mp.mpf(self.mechanism.frame.angle)) - quarter

    def closes(self, crank):
        """Returns whether the circles, or circle and guide, intersect."""
        with mp.workdps(100):
            if self.slides:
                r, b, e = map(mp.convert, self.lengths)
                return bool(abs(e - r * mp.cos(self.angle(crank))) <= b)
            r, b, c, d = map(mp.convert, self.lengths)
            distance = abs(d - r * mp.expj(self.angle(crank)))
            return bool(abs(b - c) <= distance <= b + c)

    def _state(self, q, u=0.0, a=0.0):
        """Computes the state at exactly these doubles, to 50 digits or more.

        Args:
            q: Crank angle, or both coordinates of a wind pump.
            u: Rates of the coordinates.
            a: Acceleration of the crank; for a wind pump, the torque on it.
        """
        if self.is_free:
            with mp.workdps(100):
                return self.solve(q, u, a)
        with mp.workdps(400):
            theta = self.angle(q) / mp.pi
            nearest = abs(theta - mp.nint(theta))
            # Nearer than any difference of doubles: only rounding in these 400 digits remains.
            hit = nearest < mp.mpf('1e-350')
            passes = self.stretched if int(mp.nint(theta)) % 2 else self.folded
        nearness = 60 if hit else int(-mp.log10(nearest))
        # The triangle's height loses twice the digits of this distance, and the system as many.
        with mp.workdps(60 + 6 * max(nearness, 16)):
            if not (hit and passes):
                return self.solve(q, u, a)
            before, after = (
                self.solve(mp.mpf(q) + x, u, a) for x in (-mp.mpf(ASIDE), mp.mpf(ASIDE))
            )
            links = zip(before.position, after.position, self.turning, strict=True)
            position = [x + (wrap(y - x) if turns else y - x) / 2 for x, y, turns in links]
            return Reference(
                tuple(position),
                means(before.velocity, after.velocity),
                means(before.acceleration, after.acceleration),
                (before.torque + after.torque) / 2,
                {},
                means(before.exerted, after.exerted),
            )

    def solve(self, q, u, a):
        """Computes the state in the caller's precision, except at change points."""
        vectors, rates = self.motion(q, u)
        exerted, outside = self.loads(q, vectors, rates)
        forces = self.forces_at_points(vectors, rates)
        acceleration, torque, joints, exerted = self._cut_free(vectors, rates, a, exerted, forces)
        for k, point, force, _ in forces:
            for j, x in point.carried.items() if k is not None else ():
                if k == j or self.turning[k]:
                    exerted[j] += dot(x * (1j if self.turning[j] else 1), force)
        found = acceleration, torque, joints, tuple(exerted)
        pushes = tuple(
            (self.follow(point, vectors, rates, rates)[0], force)
            for _, point, force, external in forces
            if external
        )
        links = zip(vectors, self.turning, strict=True)
        position = [mp.arg(x) if turns else x for x, turns in links]
        position[0] = mp.mpf(_first(q))
        return Reference(tuple(position), tuple(rates), *found, outside, pushes)

    # Kinematics.

    def guide(self):
        """Returns the direction of the guide; for a wind pump, the x axis."""
        return mp.mpc(1) if self.is_free else mp.expj(mp.mpf(self.mechanism.frame.angle))

    def pivot(self):
        """Returns the position of the rocker's pivot."""
        return mp.convert(self.lengths[3]) * mp.expj(mp.mpf(self.mechanism.frame.angle))

    def motion(self, q, u):
        """Returns the link vectors between pins, a slider's as its position, and their rates."""
        A = mp.convert(self.lengths[0]) * mp.expj(mp.mpf(_first(q)))
        b, c = mp.convert(self.lengths[1]), mp.convert(self.lengths[2])
        if self.is_free:
            side = 1 if self.mechanism.assembly == 'open' else -1
            end = mp.mpf(q[1])
            B = self._meet(A, b, end, c, side)
            vectors = [A, B - A, end - B, end]
        elif self.slides:
            along = mp.conj(self.guide()) * A
            half_chord = mp.sqrt(b**2 - (c - along.imag) ** 2)
            place = along.real + self._side(q) * half_chord
            vectors = [A, self.guide() * mp.mpc(place, c) - A, place]
        else:
            B = self._meet(A, b, self.pivot(), c, self._side(q))
            vectors = [A, B - A, B - self.pivot()]
        slopes = self.loop_slopes(vectors)
        given = [mp.mpf(x) for x in (u if self.is_free else (u,))]
        known = [0, 3][: len(given)]
        moved = sum(slopes[j] * x for j, x in zip(known, given, strict=True))
        first, second = solve(slopes[1], slopes[2], -moved)
        return vectors, [given[0], first, second, *given[1:]]

    def _meet(self, A, b, end, c, side):
        """Intersects the circles about A and `end`; side 1 is to the left of the line from A."""
        distance = abs(end - A)
        along = (b**2 - c**2 + distance**2) / (2 * distance)
        return A + (end - A) / distance * mp.mpc(along, side * mp.sqrt(b**2 - along**2))

    def _side(self, crank):
        """Returns +1 for the open assembly, -1 for the crossed one.

        The assembly is defined for theta in (0, pi), on a guide for (-pi, 0). The side changes at
        each change point from there to theta.
        """
        home, interval = -int(self.slides), int(mp.floor(self.angle(crank) / mp.pi))
        passed = range(min(home, interval) + 1, max(home, interval) + 1)
        changes = sum(self.stretched if j % 2 else self.folded for j in passed)
        return (1 if self.mechanism.assembly == 'open' else -1) * (-1) ** changes

    def loop_slopes(self, vectors):
        """Returns the derivatives of the loop's gap with respect to the positions of the links."""
        slopes = [1j * x for x in vectors]
        if self.slides:
            slopes[-1] = -self.guide()
        else:
            slopes[2] = -slopes[2]
        return slopes

    def gap(self, position):
        """Returns the closure error of the loop, m, at positions of the links."""
        rest = [0.0] * len(position)
        state = Reference(position, rest, rest, 0, {})
        vectors = self.vectors(state)
        end, *_ = self.follow(
            self.points(vectors)['D' if self.is_free else 'B'], vectors, rest, rest
        )
        return abs(sum(vectors[: 2 + self.is_free]) - end)

    def points(self, vectors):
        """Returns the pins and, if there is one, the coupler point."""
        carried = {j: x for j, x in enumerate(vectors) if self.turning[j]}
        if self.slides:
            carried[len(vectors) - 1] = self.guide()
        found = {'A0': Point(0, {}), 'A': Point(0, {0: carried[0]})}
        if self.mechanism.coupler.point is not None:
            lever = complex_of(self.mechanism.coupler.point) * unit(carried[1])
            found['C'] = Point(0, {0: carried[0], 1: lever})
        if self.is_free:
            found['B'] = Point(0, {0: carried[0], 1: carried[1]})
            found['D'] = Point(0, {3: carried[3]})
        elif self.slides:
            found['B'] = Point(1j * mp.convert(self.lengths[2]) * self.guide(), {2: carried[2]})
        else:
            found['B'] = Point(self.pivot(), {2: carried[2]})
            found['B0'] = Point(self.pivot(), {})
        return found

    def centers(self, vectors):
        """Returns the centres of mass."""
        points = self.points(vectors)
        firsts = [points[name] for name in ('A0', 'A', 'B' if self.is_free else 'B0', 'D')
                  if name in points]  # fmt: skip
        found = []
        for j, body in enumerate(self.bodies):
            if self.turning[j]:
                lever = complex_of(body.center) * unit(vectors[j])
                found.append(Point(firsts[j].fixed, {**firsts[j].carried, j: lever}))
            else:
                found.append(points['D' if self.is_free else 'B'])
        return found

    def follow(self, point, vectors, rates, accelerations):
        """Computes position, velocity and acceleration of a point."""
        place, velocity, acceleration = point.fixed, mp.mpc(0), mp.mpc(0)
        for j, x in point.carried.items():
            if self.turning[j]:
                place, velocity = place + x, velocity + 1j * rates[j] * x
                acceleration += mp.mpc(-(rates[j] ** 2), accelerations[j]) * x
            else:
                place, velocity = place + vectors[j] * x, velocity + rates[j] * x
                acceleration += accelerations[j] * x
        return place, velocity, acceleration

    def vectors(self, state):
        """Returns the link vectors between pins, a slider's as its position."""
        vectors = list(state.position)
        for j, turns in enumerate(self.turning):
            if turns:
                vectors[j] = mp.convert(self.lengths[j]) * mp.expj(state.position[j])
        return vectors

    def trace(self, state):
        """Computes position, velocity and acceleration of all points, also at change points."""
        with mp.workdps(150):
            vectors = self.vectors(state)
            points = self.points(vectors)
            motion = vectors, state.velocity, state.acceleration
            return {name: self.follow(point, *motion) for name, point in points.items()}

    # Dynamics.

    def pins(self):
        """Returns for each pin its name, the body on which its force acts, and the other body."""
        pins = [('A0', 0, None), ('A', 1, 0), ('B', 2, 1)]
        if self.is_free:
            pins.append(('D', 3, 2))
        elif not self.slides:
            pins.append(('B0', 2, None))
        return pins

    def _cut_free(self, vectors, rates, driven, exerted, pushes):
        """Solves the Newton-Euler equations of all bodies at once.

        Args:
            vectors: From `motion`.
            rates: From `motion`.
            driven: Acceleration of the crank; for a wind pump, the torque on it.
            exerted: Loads on each link.
            pushes: From `forces_at_points`.

        Returns:
            The fields of `Reference` from `acceleration` to `exerted`, the last one as a list.
        """
        points, rest = self.points(vectors), [mp.mpf(0)] * len(vectors)
        place = {x: self.follow(p, vectors, rates, rest)[0] for x, p in points.items()}
        centers = self.centers(vectors)
        # Unknown forces: name, direction, body on which they act, body that exerts them.
        unknown = [(*pin, axis) for pin in self.pins() for axis in (mp.mpc(1), mp.mpc(0, 1))]
        if self.slides:
            unknown.append(('guide', len(self.bodies) - 1, None, 1j * self.guide()))
            place['guide'] = place['D' if self.is_free else 'B']
        rubbing = self._rubbing(rates)
        zeros = [0] * len(rubbing)
        # Columns: accelerations of the links, forces, torque; then the right-hand side, and the
        # contribution of a unit of each friction.
        count = len(vectors)
        rows = []
        for k, body in enumerate(self.bodies):
            at, _, bias = self.follow(centers[k], vectors, rates, rest)
            mass = mp.mpf(body.mass)
            rubbed = [x.on.get(k, mp.mpf(0)) for x in rubbing]
            needed = [mass * (complex_of(self.mechanism.gravity) - bias), *map(mp.mpc, zeros)]
            moment = mp.mpf(0)
            for body_index, point, force, _ in pushes:
                if body_index == k:
                    needed[0] += force
                    moment += cross(self.follow(point, vectors, rates, rest)[0] - at, force)
            if not self.turning[k]:
                needed[0] += exerted[k] * self.guide()
                needed[1:] = [x * self.guide() for x in rubbed]
            inertial = [mass * self._slope(centers[k], j) for j in range(count)]
            acts = [((k == on) - (k == of), x, name) for name, on, of, x in unknown]
            for part in ('real', 'imag'):
                forces = [-sign * getattr(x, part) for sign, x, _ in acts]
                rows.append([*(getattr(x, part) for x in inertial), *forces, 0,
                             *(getattr(x, part) for x in needed)])  # fmt: skip
            if self.turning[k]:
                moments = [-sign * cross(place[name] - at, x) for sign, x, name in acts]
                spins = [mp.mpf(body.inertia) * (j == k) for j in range(count)]
                rows.append([*spins, *moments, -(k == 0), exerted[k] + moment, *rubbed])
        slopes, none = self.loop_slopes(vectors), [0] * (len(unknown) + 1)
        turned = zip(slopes, rates, self.turning, strict=True)
        bias = sum(1j * slope * rate**2 for slope, rate, turns in turned if turns)
        rows += [[*(getattr(x, part) for x in slopes), *none, -getattr(bias, part), *zeros]
                 for part in ('real', 'imag')]  # fmt: skip
        # Given is the torque for a wind pump, otherwise the acceleration of the crank.
        last = [0] * (count + len(unknown) + 1)
        last[-1 if self.is_free else 0] = 1
        found = solutions([*rows, [*last, mp.mpf(driven), *zeros]])
        sizes = settle(rubbing, [_joints(unknown, x[count:-1]) for x in zip(*found, strict=True)])
        values = tuple(
            first + sum(x * size for x, size in zip(added, sizes, strict=True))
            for first, *added in found
        )
        exerted = list(exerted)
        for size, rub in zip(sizes, rubbing, strict=True):
            for k, x in rub.on.items():
                exerted[k] += size * x
        joints = _joints(unknown, values[count:-1])
        return values[:count], values[-1], joints, exerted

    def _slope(self, point, j):
        """Computes the derivative of a point's position with respect to the position of a link."""
        return point.carried.get(j, 0) * (1j if self.turning[j] else 1)

    # Loads and friction.

    def loads(self, q, vectors, rates):
        """Computes the loads on each link, and the share that is external to the machine."""
        outside = [mp.mpf(0)] * len(vectors)
        place, rate = self.place(vectors), rates[-1]
        outside[-1], damping, stiffness, _ = map(mp.mpf, self.own_load)
        coupled = self.inside(vectors, rates)
        for load in self.link_loads:
            if load.link == 'crank':
                outside[0] += mp.mpf(load.force)
                coupled[0] -= mp.mpf(load.damping) * rates[0]
        for curve in self.mechanism.loads:
            if getattr(curve, 'pressure', None):  # the head of the cylinder takes the opposite
                crank = mp.mpf(_first(q)) - self.start(curve)
                pressure = periodic(curve.at, curve.pressure, crank, curve.turns)
                coupled[-1] += self.push(curve, pressure)
            elif hasattr(curve, 'over'):
                link = 0 if curve.link == 'crank' else len(vectors) - 1
                if curve.over != 'position':
                    crank = mp.mpf(_first(q)) - self.start(curve)
                    outside[link] += periodic(curve.at, curve.value, crank, curve.turns)
                else:
                    falls = rate < 0 and curve.return_value is not None
                    value = curve.return_value if falls else curve.value
                    outside[link] += between(self.reduced(curve.at), value, place)
        held = -damping * rate - stiffness * self.stretch(vectors)
        exerted = [*outside[:-1], outside[-1] + held]
        return [x + y for x, y in zip(exerted, coupled, strict=True)], tuple(outside)

    def inside(self, vectors, rates):
        """Computes the loads of viscous pins and gas on each link."""
        coupled = [mp.mpf(0)] * len(vectors)
        for load in self.mechanism.loads:
            if type(load).__name__ == 'Pins':
                for name, on, of in self.pins():
                    spins = [
                        rates[j] if j is not None and self.turning[j] else 0 for j in (on, of)
                    ]
                    for j, sign in ((on, -1), (of, 1)):
                        if load.pin in ('', name) and j is not None and self.turning[j]:
                            coupled[j] += sign * mp.mpf(load.damping) * (spins[0] - spins[1])
            elif type(load).__name__ == 'Gas':
                coupled[-1] += self.gas(load, vectors[-1], rates[-1])
        return coupled

    def gas(self, load, place, rate):
        """Computes the force of a gas on the slider along its guide."""
        top, bottom = self.ends(load)
        clearance, exponent = mp.mpf(load.clearance), mp.mpf(load.exponent)
        largest, distance = clearance + abs(top - bottom), clearance + abs(top - place)
        pressure = load.inlet * (largest / distance) ** exponent
        if load.outlet is not None:
            if (top - bottom) * rate >= 0:
                pressure = min(pressure, mp.mpf(load.outlet))
            else:
                pressure = max(
                    load.outlet * (clearance / distance) ** exponent, mp.mpf(load.inlet)
                )
        return self.push(load, pressure)

    def ends(self, load):
        """Returns the slider's position at the top of a cylinder and at the bottom."""
        r, b, e = map(mp.convert, self.lengths)
        side = 1 if self.mechanism.assembly == 'open' else -1
        far, near = (side * mp.sqrt(x**2 - e**2) for x in (b + r, b - r))
        return (near, far) if load.top == 'near' else (far, near)

    def start(self, curve):
        """Returns the crank angle from which a curve counts: 0, or the top of the stroke."""
        if curve.over != 'crank_angle_from_tdc':
            return 0
        (top, _), (_, _, e) = self.ends(curve), map(mp.convert, self.lengths)
        turned = mp.pi if curve.top == 'near' else 0  # the crank points away from the slider
        return mp.atan2(e, top) + mp.mpf(self.mechanism.frame.angle) + turned

    def push(self, load, pressure):
        """Computes the force of a pressure on the slider along its guide."""
        top, bottom = self.ends(load)
        behind = mp.mpf(101300.0 if load.ambient is None else load.ambient)
        return (pressure - behind) * mp.pi * mp.mpf(load.bore) ** 2 / 4 * mp.sign(bottom - top)

    def on_body(self, name, at, vectors):
        """Returns the index of a link, None for the frame, and a point of it."""
        if name == 'frame':
            return None, Point(complex_of(at), {})
        names = [x for x in ('crank', 'coupler', 'rod', 'rocker', 'slider')
                 if hasattr(self.mechanism, x)]  # fmt: skip
        k, points = names.index(name), self.points(vectors)
        if not self.turning[k]:
            pin = points['D' if self.is_free else 'B']
            return k, Point(pin.fixed + complex_of(at) * self.guide(), pin.carried)
        pin = points[['A0', 'A', 'B' if self.is_free else 'B0'][k]]
        return k, Point(pin.fixed, {**pin.carried, k: complex_of(at) * unit(vectors[k])})

    def forces_at_points(self, vectors, rates):
        """Returns forces at points: link or None, point, force, and whether it is external."""
        found = []
        for load in self.mechanism.loads:
            if type(load).__name__ == 'Force':
                k, point = self.on_body(load.link, load.at, vectors)
                force = complex_of(load.force)
                if load.axes == 'link':
                    force *= unit(vectors[k]) if self.turning[k] else self.guide()
                found.append((k, point, force, True))
            elif type(load).__name__ == 'Spring':
                ends = [self.on_body(load.link, load.at, vectors),
                        self.on_body(load.to, load.to_at, vectors)]  # fmt: skip
                (here, speed), (there, other) = (
                    self.follow(point, vectors, rates, rates)[:2] for _, point in ends
                )
                length = abs(there - here)
                towards = (there - here) / length
                pull = load.stiffness * (length - mp.mpf(load.free_length))
                pull += load.damping * dot(towards, other - speed)
                for (k, point), sign in zip(ends, (1, -1), strict=True):
                    found.append((k, point, sign * pull * towards, False))
        return found

    @property
    def own_load(self):
        """Force, damping, stiffness and rest position of the load on the output link."""
        for load in self.link_loads:
            if load.link != 'crank':
                return load.force, load.damping, load.stiffness, load.rest
        output = self.bodies[-1]
        return [getattr(output, name) for name in load_fields(output)]

    @property
    def link_loads(self):
        return [load for load in self.mechanism.loads if hasattr(load, 'rest')]

    def place(self, vectors):
        """Returns the output position; a rocker's is within half a turn of its swing's middle."""
        if self.slides:
            return vectors[-1]
        middle = self.middle if self.needs_middle else 0
        return middle + wrap(mp.arg(vectors[-1]) - middle)

    @property
    def needs_middle(self):
        """Whether any load depends on the position of the rocker."""
        curves = [x for x in self.mechanism.loads if getattr(x, 'over', '') == 'position']
        return not self.slides and bool(self.own_load[2] or curves)

    @functools.cached_property
    def middle(self):
        """Middle of the rocker's swing, from the package; test_loads.py checks it."""
        return mp.mpf(self.mechanism.swing_middle('', 0.0))

    def reduced(self, at):
        """Returns the points of a curve; angles of a rocker are shifted by whole turns."""
        if self.slides:
            return at
        turns = mp.nint((mp.mpf(at[0] + at[-1]) / 2 - self.middle) / (2 * mp.pi))
        return [mp.mpf(x) - 2 * mp.pi * turns for x in at]

    def stretch(self, vectors):
        """Computes the elongation of the spring on the output link."""
        if self.slides:
            return vectors[-1] - mp.mpf(self.own_load[3])
        if not self.own_load[2]:
            return mp.mpf(0)
        rest = self.middle + wrap(mp.mpf(self.own_load[3]) - self.middle)
        return self.place(vectors) - rest

    def _rubbing(self, rates):
        """Returns the joints with friction."""
        friction = next((x for x in self.mechanism.loads if hasattr(x, 'pin_radius')), None)
        if friction is None:
            return []
        found = []
        spins = [rate if turns else 0 for rate, turns in zip(rates, self.turning, strict=True)]
        factor = mp.mpf(friction.pin) * mp.mpf(friction.pin_radius)
        for name, on, of in self.pins():
            x = -mp.sign(spins[on] - (0 if of is None else spins[of]))
            turned = {k: y for k, y in ((on, x), (of, -x)) if k is not None and self.turning[k]}
            found.append(Rubbing(name, factor, turned))
        if self.slides:
            x = -mp.sign(rates[-1])
            found.append(Rubbing('guide', mp.mpf(friction.guide), {len(rates) - 1: x}))
        return [x for x in found if x.factor and any(x.on.values())]

    def shaking(self, state):
        """Computes the force on the frame, and its moment about A0 with the drive's reaction.

        They are the external forces on the machine, minus the rate of change of its momentum.
        """
        force, moment, vectors = mp.mpc(0), mp.mpf(0), self.vectors(state)
        for k, (body, center) in enumerate(zip(self.bodies, self.centers(vectors), strict=True)):
            place, _, change = self.follow(center, vectors, state.velocity, state.acceleration)
            push = mp.mpf(body.mass) * (complex_of(self.mechanism.gravity) - change)
            if self.turning[k]:
                moment += state.outside[k] - mp.mpf(body.inertia) * state.acceleration[k]
            else:
                push += state.outside[k] * self.guide()
            force += push
            moment += cross(place, push)
        for place, push in state.pushes:
            force += push
            moment += cross(place, push)
        return force, moment

    def energy(self, q, u):
        """Computes the kinetic plus potential energy, J, except at change points."""
        total = mp.mpf(0)
        vectors, rates = self.motion(q, u)
        for body, center, rate in zip(self.bodies, self.centers(vectors), rates, strict=True):
            place, velocity, _ = self.follow(center, vectors, rates, rates)
            height = dot(complex_of(self.mechanism.gravity), place)
            total += mp.mpf(body.mass) * (abs(velocity) ** 2 / 2 - height)
            total += mp.mpf(getattr(body, 'inertia', 0)) * rate**2 / 2
        force, _, stiffness, _ = map(mp.mpf, self.own_load)
        if force:
            place = vectors[-1] if self.slides else mp.arg(vectors[-1])
            if not self.slides:
                place = self.middle + wrap(place - self.middle)
            total -= force * place
        return total + stiffness * self.stretch(vectors) ** 2 / 2

    def natural(self, speed, acceleration):
        """Estimates the size of each quantity in a mechanism of this size at this speed."""
        size, square = float(max(map(abs, self.lengths))), speed**2 + abs(acceleration)
        gravity = math.hypot(*self.mechanism.gravity)
        torque = sum(
            getattr(body, 'inertia', 0) * square + body.mass * size * (size * square + gravity)
            for body in self.bodies
        )
        unit = size if self.slides else 1.0
        force, damping, stiffness, _ = self.own_load
        torque += unit * (abs(force) + unit * (damping * abs(speed) + stiffness))
        units = [1.0 if turns else size for turns in self.turning]
        return *units, *(abs(speed) * x for x in units), *(square * x for x in units), torque


# Cached, because tests share states.
oracle_of = functools.lru_cache(Oracle)


def _first(q):
    return q[0] if isinstance(q, tuple) else q


def means(one, other):
    return tuple((x + y) / 2 for x, y in zip(one, other, strict=True))


def _joints(unknown, values):
    """Returns the joint forces by name; the guide force is positive to the left."""
    joints = {}
    for value, (name, _, _, axis) in zip(values, unknown, strict=True):
        joints[name] = joints.get(name, 0) + (value if name == 'guide' else value * axis)
    return joints


def solutions(rows):
    """Solves linear equations with one or more right-hand sides, which are the last columns.

    Returns:
        A row for each unknown, with a value for each right-hand side.
    """
    rows, count = [list(row) for row in rows], len(rows)
    for i in range(count):
        largest = max(range(i, count), key=lambda k: abs(rows[k][i]))
        rows[i], rows[largest] = rows[largest], rows[i]
        rows[i][i:] = pivot = [x / rows[i][i] for x in rows[i][i:]]
        for row in rows[i + 1 :]:
            if row[i]:
                row[i:] = [x - row[i] * y for x, y in zip(row[i:], pivot, strict=True)]
    for i in reversed(range(count)):
        for row in rows[:i]:
            row[count:] = [
                x - row[i] * y for x, y in zip(row[count:], rows[i][count:], strict=True)
            ]
    return [row[count:] for row in rows]


def settle(rubbing, joints):
    """Solves for friction equal to its factor times the joint force, in every joint.

    Args:
        rubbing: The joints.
        joints: Joint forces without friction, and their change per unit of each friction.

    Returns:
        The friction in each joint, not negative, by Newton's method. If the iteration does not
        converge at once, the coefficients are increased step by step.

    Raises:
        ArithmeticError: There is no solution.
    """
    first, *added = joints

    def lacks(share, sizes):
        for rub, size in zip(rubbing, sizes, strict=True):
            forces = (joint[rub.joint] * x for joint, x in zip(added, sizes, strict=True))
            yield share * rub.factor * abs(first[rub.joint] + sum(forces)) - size

    for shares in ([1], [1 - (1 - mp.mpf(k) / 24) ** 4 for k in range(1, 25)]):
        sizes = [mp.mpf(0)] * len(rubbing)
        with suppress(ValueError, ZeroDivisionError):  # no convergence
            for share in shares if rubbing else ():
                sizes = [*mp.findroot(lambda *x, share=share: [*lacks(share, x)], sizes)]
            if min(sizes, default=0) >= 0:
                return sizes
    raise ArithmeticError('no friction goes with these forces')


def between(at, value, place):
    """Interpolates linearly between points; end values apply outside."""
    if place <= at[0]:
        return mp.mpf(value[0])
    for i in range(1, len(at)):
        if place < at[i]:
            part = (place - at[i - 1]) / (mp.mpf(at[i]) - at[i - 1])
            return value[i - 1] + part * (mp.mpf(value[i]) - value[i - 1])
    return mp.mpf(value[-1])


def periodic(at, value, angle, turns=1):
    """Interpolates linearly between angles; the first point repeats one or two turns later."""
    period, first = 2 * turns * mp.pi, mp.mpf(at[0])
    angle -= period * mp.floor((angle - first) / period)
    last = max(first + period, mp.mpf(at[-1]))  # a double may be exactly one period
    return between([*at, last], [*value, value[0]], angle)


def wrap(angle):
    """Reduces an angle to [-pi, pi]."""
    return angle - 2 * mp.pi * mp.nint(angle / (2 * mp.pi))


def complex_of(pair):
    return mp.mpc(mp.mpf(pair[0]), mp.mpf(pair[1]))


def unit(vector):
    return vector / abs(vector)


def dot(u, v):
    return (mp.conj(u) * v).real


def cross(u, v):
    return (mp.conj(u) * v).imag


def solve(u, v, w):
    """Solves x u + y v = w for real x and y; u, v, w are complex."""
    determinant = cross(u, v)
    return cross(w, v) / determinant, cross(u, w) / determinant
