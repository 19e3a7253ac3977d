# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Newton-Euler equations of mechanisms with dyads in absolute coordinates, in many digits.

Each body has three coordinates: position and angle of its first pin, or of a slider's pin. The
equations are those of pins, guides and drives, and their derivatives; the positions are found by
Newton's method from an estimate, and the multipliers are the forces in the joints.
"""

from dataclasses import dataclass, field
from typing import Any, NamedTuple

from mpmath import mp

from linkage_ros import Force, Pins, Spring, WindPump


def complex_of(pair):
    return mp.mpc(mp.mpf(pair[0]), mp.mpf(pair[1]))


def dot(a, b):
    return (mp.conj(a) * b).real


def cross(a, b):
    return (mp.conj(a) * b).imag


class Body(NamedTuple):
    """A body; its centre of mass is measured from its origin."""

    mass: Any
    inertia: Any
    center: Any


@dataclass
class Row:
    """A constraint: its value, its derivatives by coordinate, and its second derivative's bias."""

    value: Any = 0
    slopes: dict = field(default_factory=dict)
    bias: Any = 0

    def add(self, place, slope):
        self.slopes[place] = self.slopes.get(place, mp.mpf(0)) + slope


class Oracle:
    """Constraints of a mechanism, created from its parameters alone."""

    def __init__(self, mechanism):
        self.mechanism, self.bodies, self.joints, self.drives = mechanism, {}, [], []
        getattr(self, type(mechanism).__name__)(mechanism)
        for dyad in mechanism.dyads:
            self.dyad(dyad)
        self.names = [*self.bodies]

    # Each joint is ('pin', name, body, point, carrier, point), ('guide', body, point, angle) or
    # ('barrel', ...). A force acts from the carrier on the body.

    def body(self, name, part):
        center = complex_of(getattr(part, 'center', (0, 0)))
        inertia = mp.mpf(getattr(part, 'inertia', 0))
        self.bodies[name] = Body(mp.mpf(part.mass), inertia, center)

    def pin(self, name, body, at, carrier, on):
        self.joints.append(('pin', name, body, mp.mpmathify(at), carrier, mp.mpmathify(on)))

    def crank(self, m):
        self.body('crank', m.crank)
        self.pin('A0', 'crank', 0, 'frame', 0)
        self.drives.append('crank')

    def FourBar(self, m):
        self.crank(m)
        self.body('coupler', m.coupler)
        self.body('rocker', m.rocker)
        self.pin('A', 'coupler', 0, 'crank', m.crank.length)
        self.pin('B', 'rocker', m.rocker.length, 'coupler', m.coupler.length)
        ground = mp.mpf(m.frame.length) * mp.expj(mp.mpf(m.frame.angle))
        self.pin('B0', 'rocker', 0, 'frame', ground)

    def SliderCrank(self, m):
        self.crank(m)
        self.body('coupler', m.coupler)
        self.body('slider', m.slider)
        self.pin('A', 'coupler', 0, 'crank', m.crank.length)
        self.pin('B', 'slider', 0, 'coupler', m.coupler.length)
        angle = mp.mpf(m.frame.angle)
        self.joints.append(
            ('guide', 'slider', 1j * mp.mpf(m.slider.offset) * mp.expj(angle), angle)
        )

    def InvertedSliderCrank(self, m):
        self.crank(m)
        self.body('barrel', m.barrel)
        self.body('rod', m.rod)
        ground = mp.mpf(m.frame.length) * mp.expj(mp.mpf(m.frame.angle))
        self.pin('A', 'rod', 0, 'crank', m.crank.length)
        self.pin('B0', 'barrel', 0, 'frame', ground)
        self.joints.append(('barrel', 'rod', 'barrel', mp.mpf(m.offset)))
        if m.input == 'cylinder':
            self.drives = ['rod']

    def WindPump(self, m):
        self.crank(m)
        self.body('coupler', m.coupler)
        self.body('rod', m.rod)
        self.body('slider', m.slider)
        self.pin('A', 'coupler', 0, 'crank', m.crank.length)
        self.pin('B', 'rod', 0, 'coupler', m.coupler.length)
        self.pin('D', 'slider', 0, 'rod', m.rod.length)
        self.joints.append(('guide', 'slider', mp.mpc(0), mp.mpf(0)))
        self.drives.append('slider')

    def dyad(self, dyad):
        first, last = f'{dyad.name}_first', f'{dyad.name}_{"second" if dyad.second else "slider"}'
        self.body(first, dyad.first)
        self.body(last, dyad.second or dyad.slider)
        self.pin(f'{dyad.name}_from', first, 0, dyad.from_, complex_of(dyad.from_at))
        along = dyad.second.length if dyad.second else 0
        self.pin(f'{dyad.name}_joint', last, along, first, dyad.first.length)
        if dyad.second:
            self.pin(f'{dyad.name}_to', last, 0, dyad.to, complex_of(dyad.to_at or (0, 0)))
        else:
            self.joints.append(
                ('guide', last, complex_of(dyad.slider.at), mp.mpf(dyad.slider.angle))
            )

    # ------------------------------------------------------------ kinematics

    def place(self, name, point, x):
        """Returns a point of a body, and its arm from the body's origin."""
        if name == 'frame':
            return mp.mpc(point), mp.mpc(0)
        i = 3 * self.names.index(name)
        arm = point * mp.expj(x[i + 2])
        return mp.mpc(x[i], x[i + 1]) + arm, arm

    def speed(self, name, arm, v):
        if name == 'frame':
            return mp.mpc(0)
        i = 3 * self.names.index(name)
        return mp.mpc(v[i], v[i + 1]) + 1j * v[i + 2] * arm

    def spin(self, name, v):
        return mp.mpf(0) if name == 'frame' else v[3 * self.names.index(name) + 2]

    def moved(self, row, name, arm, axis, v, sign):
        """Adds the component along `axis` of a point's motion to a constraint."""
        if name == 'frame':
            return
        i = 3 * self.names.index(name)
        row.add(i, sign * axis.real)
        row.add(i + 1, sign * axis.imag)
        row.add(i + 2, sign * dot(axis, 1j * arm))
        row.bias -= sign * dot(axis, arm) * v[i + 2] ** 2

    def constraints(self, x, q, v):
        rows = []
        for kind, *joint in self.joints:
            if kind == 'pin':
                _, body, at, carrier, on = joint
                (one, arm), (other, other_arm) = (
                    self.place(body, at, x),
                    self.place(carrier, on, x),
                )
                for axis in (mp.mpc(1), mp.mpc(0, 1)):
                    row = Row(dot(axis, one - other))
                    self.moved(row, body, arm, axis, v, 1)
                    self.moved(row, carrier, other_arm, axis, v, -1)
                    rows.append(row)
            elif kind == 'guide':
                body, at, angle = joint
                i, axis = 3 * self.names.index(body), 1j * mp.expj(angle)
                row = Row(dot(axis, mp.mpc(x[i], x[i + 1]) - at))
                self.moved(row, body, mp.mpc(0), axis, v, 1)
                rows += [row, Row(x[i + 2] - angle, {i + 2: mp.mpf(1)})]
            else:
                body, barrel, offset = joint
                i, j = (3 * self.names.index(name) for name in (body, barrel))
                row = self.between(body, barrel, mp.mpc(0, 1), offset, x, v)
                rows += [row, Row(x[i + 2] - x[j + 2], {i + 2: mp.mpf(1), j + 2: mp.mpf(-1)})]
        for name, given in zip(self.drives, q, strict=True):
            if name == 'rod' and not isinstance(self.mechanism, WindPump):
                rows.append(self.between('rod', 'barrel', mp.mpc(1), given, x, v))
                continue
            i = 3 * self.names.index(name) + (2 if name == 'crank' else 0)
            rows.append(Row(x[i] - given, {i: mp.mpf(1)}))
        return rows

    def between(self, body, barrel, axis, given, x, v):
        """Returns the constraint of a component, in the axes of a barrel, of a body's place."""
        i, j = (3 * self.names.index(name) for name in (body, barrel))
        way = axis * mp.expj(x[j + 2])
        apart = mp.mpc(x[i] - x[j], x[i + 1] - x[j + 1])
        speed = mp.mpc(v[i] - v[j], v[i + 1] - v[j + 1])
        row = Row(dot(way, apart) - given)
        self.moved(row, body, mp.mpc(0), way, v, 1)
        self.moved(row, barrel, mp.mpc(0), way, v, -1)
        row.add(j + 2, dot(1j * way, apart))
        row.bias += 2 * v[j + 2] * dot(1j * way, speed) - dot(way, apart) * v[j + 2] ** 2
        return row

    def solve(self, estimate, q, u, a):
        """Returns positions, rates, accelerations and joint forces; `estimate` by body.

        The joint forces are complex, by pin; those of guides are pairs of force and moment.
        """
        q, u, a = ([mp.mpf(y) for y in row] for row in (q, u, a))
        x = [mp.mpf(y) for name in self.names for y in estimate[name]]
        still = [mp.mpf(0)] * len(x)
        for _ in range(6):
            rows = self.constraints(x, q, still)
            step = eliminated([row.slopes for row in rows], [-row.value for row in rows])
            x = [one + other for one, other in zip(x, step, strict=True)]
            if max(map(abs, step)) < mp.mpf(10) ** (-mp.dps // 2 - 2):
                break
        rows = self.constraints(x, q, still)
        driven = [mp.mpf(0)] * (len(rows) - len(u))
        v = eliminated([row.slopes for row in rows], [*driven, *u])
        rows = self.constraints(x, q, v)
        right = [-row.bias for row in rows]
        right[len(driven) :] = [y + z for y, z in zip(right[len(driven) :], a, strict=True)]
        changes = eliminated([row.slopes for row in rows], right)
        lacking = [
            m - f for m, f in zip(self.inertia(x, v, changes), self.forces(x, v), strict=True)
        ]
        columns = [{} for _ in x]
        for k, row in enumerate(rows):
            for i, slope in row.slopes.items():
                columns[i][k] = slope
        return x, v, changes, self.named(eliminated(columns, lacking))

    def named(self, values):
        found, values = {}, iter(values)
        for kind, *joint in self.joints:
            one, other = next(values), next(values)
            found[joint[0]] = mp.mpc(one, other) if kind == 'pin' else (one, other)
        return found, *values

    def inertia(self, x, v, changes):
        """Returns the inertia forces on the origin of each body, and moments about it."""
        found = []
        for k, (name, body) in enumerate(self.bodies.items()):
            _, arm = self.place(name, body.center, x)
            i = 3 * k
            change = mp.mpc(changes[i], changes[i + 1])
            change += 1j * changes[i + 2] * arm - v[i + 2] ** 2 * arm
            moment = body.inertia * changes[i + 2] + body.mass * cross(arm, change)
            found += [body.mass * change.real, body.mass * change.imag, moment]
        return found

    def forces(self, x, v):
        """Returns the generalised forces of weights and loads on each coordinate."""
        found, gravity = [mp.mpf(0)] * len(x), complex_of(self.mechanism.gravity)
        pushes = [
            (name, self.place(name, body.center, x)[1], body.mass * gravity, 0)
            for name, body in self.bodies.items()
        ]
        for load in self.mechanism.loads:
            pushes += {Force: self.force, Spring: self.spring, Pins: self.pins}[type(load)](
                load, x, v
            )
        for name, arm, force, couple in pushes:
            if name != 'frame':
                i = 3 * self.names.index(name)
                for j, y in enumerate((force.real, force.imag, cross(arm, force) + couple)):
                    found[i + j] += y
        return found

    def force(self, load, x, _):
        _, arm = self.place(load.link, complex_of(load.at), x)
        angle = x[3 * self.names.index(load.link) + 2] if load.axes == 'link' else 0
        return [(load.link, arm, complex_of(load.force) * mp.expj(angle), 0)]

    def spring(self, load, x, v):
        ends = [(load.link, complex_of(load.at)), (load.to, complex_of(load.to_at))]
        (one, arm), (other, other_arm) = (self.place(*end, x) for end in ends)
        way = (other - one) / abs(other - one)
        apart = self.speed(load.to, other_arm, v) - self.speed(load.link, arm, v)
        size = mp.mpf(load.stiffness) * (abs(other - one) - mp.mpf(load.free_length))
        size += mp.mpf(load.damping) * dot(way, apart)
        return [(load.link, arm, size * way, 0), (load.to, other_arm, -size * way, 0)]

    def pins(self, load, _, v):
        found, still = [], mp.mpc(0)
        for kind, *joint in self.joints:
            if kind == 'pin' and load.pin in {'', joint[0]}:
                _, body, _, carrier, _ = joint
                couple = mp.mpf(load.damping) * (self.spin(carrier, v) - self.spin(body, v))
                found += [(body, still, still, couple), (carrier, still, still, -couple)]
        return found

    def positions(self, x):
        """Returns the coordinate of each body in `State`: its angle or its place on the guide."""
        found = {name: x[3 * i + 2] for i, name in enumerate(self.names)}
        for kind, *joint in self.joints:
            if kind == 'guide':
                body, at, angle = joint
                found[body] = dot(mp.expj(angle), self.place(body, mp.mpc(0), x)[0] - at)
            elif kind == 'barrel':
                body, barrel, _ = joint
                apart = self.place(body, mp.mpc(0), x)[0] - self.place(barrel, mp.mpc(0), x)[0]
                found[body] = dot(mp.expj(found[barrel]), apart)
        return found

    def rates(self, x, v, changes):
        """Returns the rate and acceleration of each coordinate in `State`."""
        one = {name: v[3 * i + 2] for i, name in enumerate(self.names)}
        two = {name: changes[3 * i + 2] for i, name in enumerate(self.names)}
        for kind, *joint in self.joints:
            i = 3 * self.names.index(joint[0]) if kind != 'pin' else 0
            if kind == 'guide':
                way = mp.expj(joint[2])
                one[joint[0]], two[joint[0]] = (
                    dot(way, mp.mpc(row[i], row[i + 1])) for row in (v, changes)
                )
            elif kind == 'barrel':
                j = 3 * self.names.index(joint[1])
                way, spin, change = mp.expj(x[j + 2]), v[j + 2], changes[j + 2]
                apart, speed, faster = (
                    mp.mpc(row[i] - row[j], row[i + 1] - row[j + 1]) for row in (x, v, changes)
                )
                one['rod'] = dot(way, speed) + spin * dot(1j * way, apart)
                two['rod'] = dot(way, faster) + 2 * spin * dot(1j * way, speed)
                two['rod'] += change * dot(1j * way, apart) - spin**2 * dot(way, apart)
        return one, two


def eliminated(rows, right):
    """Solves sparse linear equations by elimination with the largest pivot of each column."""
    rows = [{**row, -1: value} for row, value in zip(rows, right, strict=True)]
    order, count = [], len(rows)
    for _ in range(count):
        # The row with fewest entries first, and the largest of them.
        row = min(rows, key=len)
        rows = [other for other in rows if other is not row]
        pivot = max((k for k in row if k >= 0), key=lambda k: abs(row[k]))
        order.append((pivot, row))
        for other in rows:
            factor = other.pop(pivot, 0)
            if factor:
                factor /= row[pivot]
                for k, x in row.items():
                    if k != pivot:
                        other[k] = other.get(k, 0) - factor * x
    found = [mp.mpf(0)] * count
    for pivot, row in reversed(order):
        rest = sum((x * found[k] for k, x in row.items() if k not in {pivot, -1}), mp.mpf(0))
        found[pivot] = (row[-1] - rest) / row[pivot]
    return found
