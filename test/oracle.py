# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reference for all mechanisms in 50 digits, by methods other than the package's.

Each body has three absolute coordinates: the place of its centre of mass, and its angle. Places
are intersections of circles, or of a circle and a guide; enough digits compensate the cancellation
of this textbook method. Pins, guides and drives are constraints. Their first derivatives give the
rates; their second derivatives, together with the Newton-Euler equations of all bodies, form one
linear system for accelerations, joint forces and drive. Friction adds an unknown moment for each
pin and a force for each guide, which Newton's method determines.

These systems are singular at a change point, but the motion is analytic there: the state is the
mean of the states 1e-60 rad on either side.
"""

import functools
import math
from contextlib import suppress
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any, NamedTuple

import mpmath
from mpmath import mp

ASIDE = '1e-60'


class Reference(NamedTuple):
    """The fields of linkage_ros.State and linkage_ros.Reactions, in mpf and mpc.

    Attributes:
        position: Positions of the links; angles are in (-pi, pi], except the crank's.
        velocity: Velocities of the links.
        acceleration: Accelerations of the links.
        torque: Torque on the crank; of a driven slide, the force along it.
        pins: Forces in the pins by name; empty at a change point, where they are infinite.
        guides: Forces in the guides, positive to the left, and moments, by name of the slider.
        exerted: Torque, or force along the guide, of loads and friction on each link.
        shaking: Force on the frame, and its moment about A0 with the drive's reaction.
        bodies: Motion of each body, by name.
    """

    position: tuple
    velocity: tuple
    acceleration: tuple
    torque: mpmath.mpf
    pins: dict
    guides: dict
    exerted: tuple
    shaking: tuple
    bodies: dict


class Body(NamedTuple):
    """The motion of a body's origin, which is its first pin; `way` is its direction."""

    place: Any
    way: Any
    velocity: Any = 0
    spin: Any = 0
    acceleration: Any = 0
    change: Any = 0

    def at(self, at):
        """Returns the position of a point, [along, across] as mpc."""
        return self.place + at * self.way

    def point(self, at):
        """Returns position, velocity and acceleration of a point, [along, across] as mpc."""
        arm = at * self.way
        return (
            self.place + arm,
            self.velocity + 1j * self.spin * arm,
            self.acceleration + mp.mpc(-(self.spin**2), self.change) * arm,
        )


class Joint(NamedTuple):
    """A point `at` of a body, held by a point `on` of a carrier.

    Attributes:
        name: Name of the pin; of a guide, that of the slider.
        guide: Direction in the carrier's axes in which the body may slide; None for a pin.
    """

    name: str
    body: str
    at: Any
    carrier: str
    on: Any
    guide: Any = None


@dataclass
class Row:
    """A constraint on velocities: derivatives by body and axis, and the bias of the second one."""

    slopes: dict = field(default_factory=dict)
    bias: Any = 0


class Push(NamedTuple):
    """A force at a point of a body, and a couple."""

    body: str
    at: Any
    force: Any
    couple: Any = 0
    is_external: bool = False

    def times(self, size):
        return self._replace(force=self.force * size, couple=self.couple * size)


class Effort(NamedTuple):
    """A couple on a link; on a sliding link, a force along its guide."""

    link: str
    size: Any
    is_external: bool = False

    def times(self, size):
        return self._replace(size=self.size * size)


class Oracle:
    """Computes the states of a mechanism.

    `lengths` (crank, coupler, then rocker and frame, offset, or rod; of a cylinder crank, frame
    and offset), as fractions or decimal text, replace the mechanism's lengths if these are only
    rounded decimals.
    """

    def __init__(self, mechanism, lengths=None):
        self.mechanism, self.kind = mechanism, type(mechanism).__name__
        names = 'crank', 'coupler', 'barrel', 'rod', 'rocker', 'slider'
        self.parts = {x: getattr(mechanism, x) for x in names if hasattr(mechanism, x)}
        sliding = 'rod' if self.kind == 'InvertedSliderCrank' else 'slider'
        sliders = {sliding}
        for dyad in mechanism.dyads:
            words = 'first', 'second', 'barrel', 'rod', 'slider'
            given = {x: getattr(dyad, x) for x in words}
            self.parts |= {f'{dyad.name}_{x}': part for x, part in given.items() if part}
            sliders |= {f'{dyad.name}_rod', f'{dyad.name}_slider'}
        self.turning = [name not in sliders for name in self.parts]
        self.is_free = self.kind == 'WindPump'
        self.driven = next(iter(mechanism.coordinates))
        self.by_slide = self.driven != 'crank'
        self.lengths = tuple(map(Fraction, lengths or self._doubles()))
        # Change points at even and at odd multiples of pi of theta.
        self.folded = self.stretched = False
        if self.kind == 'SliderCrank':
            r, b, e = self.lengths
            self.folded, self.stretched = r - e == b, r + e == b
            if self.by_slide:  # at position 0
                self.folded, self.stretched = abs(r - b) == abs(e), False
        elif self.kind == 'FourBar':
            r, b, c, d = self.lengths
            self.folded, self.stretched = abs(d - r) == abs(b - c), b + c == d + r
        self.passes_change_point = self.stretched or self.folded
        self.loads = mechanism.loads
        self.state = functools.cache(self._state)
        self._joints_in = functools.cache(self._joints)

    def _doubles(self):
        m = self.mechanism
        if self.kind == 'InvertedSliderCrank':
            return m.crank.length, m.frame.length, m.offset
        links = [part.length for part in list(self.parts.values())[:3] if hasattr(part, 'length')]
        if self.kind == 'FourBar':
            return *links, m.frame.length
        return (*links, m.slider.offset) if self.kind == 'SliderCrank' else links

    def angle(self, crank):
        """Returns theta, the crank's angle from the frame, or from the normal of the guide.

        The angle of frame or guide is reduced to its value nearest to zero.
        """
        if self.is_free:
            return mp.mpf(crank)
        quarter = mp.pi / 2 if self.kind == 'SliderCrank' else 0
        return mp.mpf(crank) - wrap(mp.mpf(self.mechanism.frame.angle)) - quarter

    def closes(self, crank):
        """Returns whether the circles, or circle and guide, intersect."""
        with mp.workdps(100), suppress(ArithmeticError):
            return bool(self._placed_base(crank))
        return False

    def _state(self, q, u=0.0, a=0.0):
        """Computes the state at exactly these doubles, to 50 digits or more.

        Args:
            q: Crank angle or position of a driven slide; both coordinates of a wind pump.
            u: Rates of the coordinates.
            a: Acceleration of the coordinate; for a wind pump, the torque on the crank.
        """
        hit, nearness = False, 0
        if self.passes_change_point:
            with mp.workdps(400):
                theta = mp.mpf(_first(q)) if self.by_slide else self.angle(_first(q)) / mp.pi
                nearest = abs(theta - (0 if self.by_slide else mp.nint(theta)))
                # Nearer than any difference of doubles: only rounding remains.
                at_once = nearest < mp.mpf('1e-350')
                hit = at_once and (self.stretched if int(mp.nint(theta)) % 2 else self.folded)
            nearness = 60 if at_once else int(-mp.log10(nearest))
        # The triangle's height loses twice the digits of this distance, and the system as many.
        with mp.workdps(60 + 6 * max(nearness, 16)):
            if not hit:
                return self.solve(q, u, a)
            before, after = (
                self.solve(mp.mpf(_first(q)) + x, u, a) for x in (-mp.mpf(ASIDE), mp.mpf(ASIDE))
            )
            links = zip(before.position, after.position, self.turning, strict=True)
            position = [x + (wrap(y - x) if turns else y - x) / 2 for x, y, turns in links]
            return Reference(
                tuple(position), means(before.velocity, after.velocity),
                means(before.acceleration, after.acceleration),
                (before.torque + after.torque) / 2, {}, {}, means(before.exerted, after.exerted),
                means(before.shaking, after.shaking),
                {k: Body(*means(x, after.bodies[k])) for k, x in before.bodies.items()},
            )  # fmt: skip

    def solve(self, q, u, a):
        """Computes the state in the caller's precision, except at change points."""
        bodies = self.moving(q, u)
        pushes = self.pushes(_first(q), bodies)
        bodies, torque, joints, rubbed = self._balanced(bodies, a, pushes)
        frame, pushes = bodies.pop('frame'), pushes + rubbed
        position, velocity, acceleration = zip(
            *(self.of_link(name, {**bodies, 'frame': frame}) for name in bodies), strict=True
        )
        crank = () if self.by_slide else (mp.mpf(_first(q)),)
        every = {**bodies, 'frame': frame}
        return Reference(
            (*crank, *position[len(crank) :]), velocity, acceleration, torque,
            {k: x for k, x in joints.items() if not isinstance(x, tuple)},
            {k: x for k, x in joints.items() if isinstance(x, tuple)},
            tuple(self._generalised(name, every, pushes) for name in bodies),
            self._shaking(every, pushes), bodies,
        )  # fmt: skip

    # The machine in the caller's precision.

    def pivot(self):
        """Returns the position of the pivot B0."""
        length = self.lengths[1 if self.kind == 'InvertedSliderCrank' else 3]
        return mp.convert(length) * mp.expj(mp.mpf(self.mechanism.frame.angle))

    def guide(self):
        """Returns a point of the guide and its direction."""
        if self.is_free:
            return mp.mpc(0), mp.mpc(1)
        way = mp.expj(mp.mpf(self.mechanism.frame.angle))
        return 1j * mp.convert(self.lengths[2]) * way, way

    def joints(self):
        """Returns the joints; the carrier's force acts on the body."""
        return self._joints_in(mp.prec)

    def _joints(self, _):
        lengths = [mp.convert(x) for x in self.lengths]
        found = [Joint('A0', 'crank', 0, 'frame', 0)]
        if self.kind == 'InvertedSliderCrank':
            r, _, e = lengths
            found += [
                Joint('A', 'rod', 0, 'crank', r), Joint('B0', 'barrel', 0, 'frame', self.pivot()),
                Joint('rod', 'rod', 0, 'barrel', mp.mpc(0, e), mp.mpc(1)),
            ]  # fmt: skip
        else:
            r, b, c, *_ = lengths
            found.append(Joint('A', 'coupler', 0, 'crank', r))
        if self.kind == 'FourBar':
            found.append(Joint('B', 'rocker', c, 'coupler', b))
            found.append(Joint('B0', 'rocker', 0, 'frame', self.pivot()))
        elif self.kind == 'SliderCrank':
            found.append(Joint('B', 'slider', 0, 'coupler', b))
        elif self.kind == 'WindPump':
            found.append(Joint('B', 'rod', 0, 'coupler', b))
            found.append(Joint('D', 'slider', 0, 'rod', c))
        if self.kind in {'SliderCrank', 'WindPump'}:
            found.append(Joint('slider', 'slider', 0, 'frame', *self.guide()))
        for dyad in self.mechanism.dyads:
            found += _joints_of_dyad(dyad)
        return found

    def placed(self, q):
        """Returns the places and directions of all bodies, and of the frame."""
        bodies = {'frame': Body(mp.mpc(0), mp.mpc(1)), **self._placed_base(q)}
        waiting = list(self.mechanism.dyads)
        while waiting:
            ready = [x for x in waiting if _carriers(x) <= {*bodies}]
            waiting = [x for x in waiting if x not in ready]
            for dyad in ready:
                bodies |= _placed_dyad(dyad, bodies)
        return {'frame': bodies['frame'], **{name: bodies[name] for name in self.parts}}

    def _placed_base(self, q):
        lengths = [mp.convert(x) for x in self.lengths]
        side = 1 if self.mechanism.assembly == 'open' else -1
        if self.kind == 'InvertedSliderCrank':
            (r, _, e), pivot = lengths, self.pivot()
            if self.by_slide:
                s = mp.mpf(_first(q))
                A = meet(mp.mpc(0), r, pivot, mp.hypot(s, e), side)
            else:
                A = r * mp.expj(mp.mpf(_first(q)))
                s = root(abs(A - pivot) ** 2 - e**2)
            way = (A - pivot) / mp.mpc(s, e)
            return {
                'crank': Body(mp.mpc(0), A / r), 'barrel': Body(pivot, way), 'rod': Body(A, way),
            }  # fmt: skip
        r, b, c, *_ = lengths
        if self.by_slide:
            on, way = self.guide()
            x = mp.mpf(_first(q))
            B = on + x * way
            A = meet(mp.mpc(0), r, B, b, -side if self.folded and x < 0 else side)
            return {
                'crank': Body(mp.mpc(0), A / r), 'coupler': Body(A, unit(B - A)),
                'slider': Body(B, way),
            }  # fmt: skip
        way = mp.expj(mp.mpf(_first(q)))
        A = r * way
        if self.kind == 'FourBar':
            B = meet(A, b, self.pivot(), c, self._side(q))
            last = {'rocker': Body(self.pivot(), unit(B - self.pivot()))}
        elif self.is_free:
            end = mp.mpf(q[1])
            B = meet(A, b, end, c, side)
            last = {'rod': Body(B, unit(end - B)), 'slider': Body(mp.mpc(end), mp.mpc(1))}
        else:
            B = met_on_guide(A, b, *self.guide(), self._side(q))
            last = {'slider': Body(B, self.guide()[1])}
        return {'crank': Body(mp.mpc(0), way), 'coupler': Body(A, unit(B - A)), **last}

    def _side(self, crank):
        """Returns +1 for the open assembly, -1 for the crossed one.

        The assembly is defined for theta in (0, pi), on a guide for (-pi, 0). The side changes at
        each change point from there to theta.
        """
        home = -int(self.kind == 'SliderCrank')
        interval = int(mp.floor(self.angle(_first(crank)) / mp.pi))
        passed = range(min(home, interval) + 1, max(home, interval) + 1)
        changes = sum(self.stretched if j % 2 else self.folded for j in passed)
        return (1 if self.mechanism.assembly == 'open' else -1) * (-1) ** changes

    def gap(self, position):
        """Returns the largest closure error of the joints, m, at positions of the links."""
        links = dict(zip(self.parts, map(mp.mpf, position), strict=True))
        joints, bodies = self.joints(), {'frame': Body(mp.mpc(0), mp.mpc(1))}
        for name in self.parts:
            slide = next((x for x in joints if x.name == name), None)
            hung = next(x for x in joints if x.body == name and not x.at)
            if slide and slide.carrier == 'frame':
                bodies[name] = Body(slide.on + links[name] * slide.guide, slide.guide)
            else:
                place = bodies[hung.carrier].at(hung.on)
                way = slide.guide * bodies[slide.carrier].way if slide else mp.expj(links[name])
                bodies[name] = Body(place, way)
        gaps = []
        for joint in joints:
            place, carrier = bodies[joint.body].at(joint.at), bodies[joint.carrier]
            gap = place - carrier.at(joint.on)
            if joint.guide is not None:
                gap -= links[joint.name] * joint.guide * carrier.way
            gaps.append(abs(gap))
        return max(gaps)

    # Motion.

    def moving(self, q, u):
        """Returns the bodies with their rates."""
        bodies = self.placed(q)
        rows = [row for joint in self.joints() for row in self._rows(joint, bodies)]
        drives = self._drives(bodies)
        given = [mp.mpf(x) for x in (u if isinstance(u, tuple) else (u,))]
        table = [{**row.slopes, 0: mp.mpf(0)} for row in rows]
        table += [{**row.slopes, 0: x} for row, x in zip(drives, given, strict=True)]
        found = solved(table)
        for name, body in bodies.items():
            if name != 'frame':
                x, y, spin = (found[name, axis][0] for axis in ('x', 'y', 'spin'))
                arm = self.center(name) * body.way
                bodies[name] = body._replace(velocity=mp.mpc(x, y) - 1j * spin * arm, spin=spin)
        return bodies

    def center(self, name):
        """Returns the centre of mass of a body."""
        return complex_of(getattr(self.parts[name], 'center', (0, 0)))

    def _rows(self, joint, bodies):
        """Returns the two constraints of a joint."""
        if joint.guide is None:
            return self._along((mp.mpc(1), mp.mpc(0, 1)), joint, bodies)
        way = joint.guide * bodies[joint.carrier].way
        turns = {(joint.body, 'spin'): mp.mpf(1), (joint.carrier, 'spin'): -mp.mpf(1)}
        turns.pop(('frame', 'spin'), None)
        return [*self._along((1j * way,), joint, bodies), Row(turns)]

    def _along(self, axes, joint, bodies):
        """Returns the constraints of the relative velocity in a joint along axes."""
        body, carrier = bodies[joint.body], bodies[joint.carrier]
        place, velocity, _ = body.point(joint.at)
        held = place - carrier.place  # the carrier's point at the joint
        slip = velocity - (carrier.velocity + 1j * carrier.spin * held)
        arms = [
            (name, sign, place - bodies[name].at(self.center(name)))
            for name, sign in ((joint.body, 1), (joint.carrier, -1)) if name != 'frame'
        ]  # fmt: skip
        rows = []
        for axis in axes:
            row = Row(bias=-2 * carrier.spin * cross(slip, axis))
            for name, sign, arm in arms:
                row.slopes |= {
                    (name, 'x'): sign * axis.real, (name, 'y'): sign * axis.imag,
                    (name, 'spin'): sign * cross(arm, axis),
                }  # fmt: skip
                row.bias -= sign * dot(axis, arm) * bodies[name].spin ** 2
            rows.append(row)
        return rows

    def _drives(self, bodies):
        """Returns the constraints of the coordinates."""
        slides = {joint.name: joint for joint in self.joints() if joint.guide is not None}

        def along(name):
            way = slides[name].guide * bodies[slides[name].carrier].way
            return self._along((way,), slides[name], bodies)[0]

        if self.by_slide:
            return [along(self.driven)]
        crank = Row({('crank', 'spin'): mp.mpf(1)})
        return [crank, along('slider')] if self.is_free else [crank]

    def slide(self, joint, bodies):
        """Returns position, velocity and acceleration of a sliding link on its guide."""
        carrier, body = bodies[joint.carrier], bodies[joint.body]
        way, spin = joint.guide * carrier.way, carrier.spin
        on, velocity, acceleration = carrier.point(joint.on)
        apart, speed = body.place - on, body.velocity - velocity
        rate = dot(way, speed) + spin * dot(1j * way, apart)
        second = dot(way, body.acceleration - acceleration) + 2 * spin * dot(1j * way, speed)
        second += carrier.change * dot(1j * way, apart) - spin**2 * dot(way, apart)
        return dot(way, apart), rate, second

    def of_link(self, name, bodies):
        """Returns position, velocity and acceleration of a link."""
        slide = self.slide_of(name)
        if slide is not None:
            return self.slide(slide, bodies)
        return mp.arg(bodies[name].way), bodies[name].spin, bodies[name].change

    def spin_of(self, name):
        """Returns the link, or frame, with which a link turns."""
        slide = self.slide_of(name)
        return self.spin_of(slide.carrier) if slide else name

    def slide_of(self, name):
        """Returns the joint in which a link slides; None for a link that turns."""
        return next((x for x in self.joints() if x.name == name and x.guide is not None), None)

    def trace(self, state):
        """Returns position, velocity and acceleration of all points, also at change points."""
        with mp.workdps(150):
            bodies = {'frame': Body(mp.mpc(0), mp.mpc(1)), **state.bodies}
            found = {
                x.name: bodies[x.carrier].point(x.on) for x in self.joints() if x.guide is None
            }
            if self.kind == 'InvertedSliderCrank':
                r, d, e = map(mp.convert, self.lengths)
                short, long = (d - r) ** 2 - e**2, (d + r) ** 2 - e**2
                mouth = mp.mpc(mp.sqrt(short if short > 0 else long), e)
                found['E'] = bodies['barrel'].point(mouth)
            for point in self.mechanism.points:
                found[point.name] = bodies[point.link].point(complex_of(point.at))
            return found

    # Dynamics.

    def _balanced(self, bodies, driven, pushes):
        """Solves the Newton-Euler equations of all bodies at once.

        Args:
            bodies: From `moving`.
            driven: Acceleration of the coordinate; for a wind pump, the torque on the crank.
            pushes: From `pushes`.

        Returns:
            The bodies with their accelerations, the drive, the forces of the joints, and the
            pushes of friction.
        """
        joints, drives = self.joints(), self._drives(bodies)
        rubbing = self._rubbing(bodies)
        rows = {(x.name, k): row for x in joints for k, row in enumerate(self._rows(x, bodies))}
        if self.is_free:
            pushes = [*pushes, Push('crank', 0, 0, mp.mpf(driven))]
        else:
            rows['drive', 0] = drives[0]
        # Columns: accelerations of the bodies, joint forces; then the right-hand side, and the
        # contribution of a unit of each friction.
        table = []
        for name, part in self.parts.items():
            mass, inertia = mp.mpf(part.mass), mp.mpf(getattr(part, 'inertia', 0) or 0)
            weight = mass * complex_of(self.mechanism.gravity)
            loads = [
                self._on(name, bodies, each) for each in (pushes, *(x for _, _, x in rubbing))
            ]
            loads[0] = loads[0][0] + weight, loads[0][1]
            for axis, own in (('x', mass), ('y', mass), ('spin', inertia)):
                row = {(name, axis): own}
                row |= {
                    k: -x.slopes[name, axis] for k, x in rows.items() if (name, axis) in x.slopes
                }
                row |= {i: {'x': force.real, 'y': force.imag, 'spin': moment}[axis]
                        for i, (force, moment) in enumerate(loads)}  # fmt: skip
                table.append(row)
        zeros = {i: mp.mpf(0) for i in range(1, len(rubbing) + 1)}
        for key, row in rows.items():
            given = mp.mpf(driven) if key[0] == 'drive' else 0
            table.append({**row.slopes, **zeros, 0: given - row.bias})
        found = solved(table)
        forces = [{x.name: _force(x, found, i) for x in joints} for i in range(len(rubbing) + 1)]
        sizes = settle([(name, factor) for name, factor, _ in rubbing], forces)
        weights = [mp.mpf(1), *sizes]
        total = {k: sum(map(mp.fmul, row, weights)) for k, row in found.items()}
        for name, body in bodies.items():
            if name != 'frame':
                change, center = total[name, 'spin'], mp.mpc(total[name, 'x'], total[name, 'y'])
                arm = self.center(name) * body.way
                bodies[name] = body._replace(
                    acceleration=center - mp.mpc(-(body.spin**2), change) * arm, change=change
                )
        rubbed = [
            x.times(size)
            for size, (_, _, each) in zip(sizes, rubbing, strict=True) for x in each
        ]  # fmt: skip
        torque = mp.mpf(driven) if self.is_free else total['drive', 0]
        last = {k: [x] for k, x in total.items()}
        return bodies, torque, {x.name: _force(x, last, 0) for x in joints}, rubbed

    def _on(self, name, bodies, pushes):
        """Returns the force of pushes on a body, and their moment about its centre of mass."""
        center, force, moment = bodies[name].at(self.center(name)), mp.mpc(0), mp.mpf(0)
        for push in self._spread(pushes, bodies):
            if push.body == name:
                force += push.force
                moment += push.couple + cross(bodies[name].at(push.at) - center, push.force)
        return force, moment

    def _spread(self, pushes, bodies):
        """Yields forces and couples on bodies; what slides on a body pushes it back."""
        for push in pushes:
            if isinstance(push, Push):
                yield push
            elif (slide := self.slide_of(push.link)) is None:
                yield Push(push.link, 0, 0, push.size, push.is_external)
            else:
                carrier = bodies[slide.carrier]
                force = push.size * slide.guide * carrier.way
                held = (bodies[push.link].place - carrier.place) / carrier.way
                yield Push(push.link, 0, force, 0, push.is_external)
                yield Push(slide.carrier, held, -force)

    def _generalised(self, link, bodies, pushes):
        """Returns the power of pushes per rate of one link of the open tree."""
        total = mp.mpf(0)
        for push in pushes:
            if isinstance(push, Effort):
                total += push.size if push.link == link else 0
            elif push.body != 'frame':
                total += push.couple if link == self.spin_of(push.body) else 0
                slide = self.slide_of(push.body)
                if slide and slide.carrier == 'frame':
                    total += dot(slide.guide, push.force) if link == push.body else 0
                else:
                    total += dot(self._lever(link, push.body, push.at, bodies), push.force)
        return total

    def _lever(self, link, body, at, bodies):
        """Returns the velocity of a point per rate of one link of the open tree."""
        if body == 'frame':
            return mp.mpc(0)
        hung = next(x for x in self.joints() if x.body == body and not x.at and x.guide is None)
        own = 1j * at * bodies[body].way if link == self.spin_of(body) else 0
        return own + self._lever(link, hung.carrier, hung.on, bodies)

    def _is_external(self, link):
        """Returns whether a load on a link originates outside the machine."""
        slide = self.slide_of(link)
        return slide is None or slide.carrier == 'frame'

    def _shaking(self, bodies, pushes):
        """Computes the force on the frame, and its moment about A0 with the drive's reaction.

        They are the external forces on the machine, minus the rate of change of its momentum.
        """
        force, moment = mp.mpc(0), mp.mpf(0)
        for name, part in self.parts.items():
            place, _, change = bodies[name].point(self.center(name))
            push = mp.mpf(part.mass) * (complex_of(self.mechanism.gravity) - change)
            force += push
            moment += cross(place, push)
            moment -= mp.mpf(getattr(part, 'inertia', 0) or 0) * bodies[name].change
        for push in self._spread(pushes, bodies):
            if push.is_external:
                force += push.force
                moment += push.couple + cross(bodies[push.body].at(push.at), push.force)
        return force, moment

    # Loads and friction.

    def pushes(self, q, bodies):
        """Returns the efforts on links, and the forces at points, of all loads but friction."""
        crank = mp.arg(bodies['crank'].way) if self.by_slide else mp.mpf(q)
        found = []
        for load in self.loads:
            kind = type(load).__name__
            if kind == 'Force':
                force = complex_of(load.force)
                if load.axes == 'link':
                    force *= bodies[load.link].way
                found.append(Push(load.link, complex_of(load.at), force, 0, True))
            elif kind == 'Spring':
                found += _spring(load, bodies)
            elif kind == 'Pins':
                for joint in self.joints():
                    if joint.guide is None and load.pin in {'', joint.name}:
                        body, carrier = bodies[joint.body], bodies[joint.carrier]
                        couple = mp.mpf(load.damping) * (carrier.spin - body.spin)
                        found.append(Push(joint.body, 0, 0, couple))
                        found.append(Push(joint.carrier, 0, 0, -couple))
            elif kind in {'LinkLoad', 'LoadCurve', 'Gas'}:
                found += getattr(self, f'_of_{kind}')(load, crank, bodies)
        return found

    def _of_LinkLoad(self, load, _, bodies):
        place, rate, _ = self.of_link(load.link, bodies)
        held = -mp.mpf(load.damping) * rate
        if load.stiffness:
            held -= mp.mpf(load.stiffness) * self._stretch(load, place)
        return [
            Effort(load.link, mp.mpf(load.force), self._is_external(load.link)),
            Effort(load.link, held),
        ]

    def _of_LoadCurve(self, load, crank, bodies):
        if load.over == 'position':
            place, rate, _ = self.of_link(load.link, bodies)
            falls = rate < 0 and load.return_value is not None
            value = load.return_value if falls else load.value
            size = between(self._reduced(load), value, self._continuous(load.link, place))
            return [Effort(load.link, size, self._is_external(load.link))]
        crank -= self._start(load)
        turns = 2 if load.at[-1] - load.at[0] > 6.2832 else 1
        if load.pressure is not None:  # the head of the cylinder takes the opposite
            pressure = periodic(load.at, load.pressure, crank, turns)
            return [Effort(load.link, self._pressed(load, pressure))]
        size = periodic(load.at, load.value, crank, turns)
        return [Effort(load.link, size, self._is_external(load.link))]

    def _of_Gas(self, load, _, bodies):
        place, rate, _ = self.of_link(load.link, bodies)
        top, bottom = self._ends(load)
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
        return [Effort(load.link, self._pressed(load, pressure))]

    def _ends(self, load):
        """Returns the position at the top of a cylinder and at the bottom."""
        lengths = [mp.convert(x) for x in self.lengths]
        if self.kind == 'InvertedSliderCrank':
            r, d, e = lengths
            short, long = (mp.sqrt(x**2 - e**2) for x in (d - r, d + r))
            return (long, short) if load.top == 'near' else (short, long)
        r, b, e = lengths
        side = 1 if self.mechanism.assembly == 'open' else -1
        far, near = (side * mp.sqrt(x**2 - e**2) for x in (b + r, b - r))
        return (near, far) if load.top == 'near' else (far, near)

    def _start(self, curve):
        """Returns the crank angle from which a curve counts: 0, or the top of the stroke."""
        if curve.over != 'crank_angle_from_tdc':
            return 0
        turned = mp.pi if curve.top == 'near' else 0  # the crank points away from there
        turned += mp.mpf(self.mechanism.frame.angle)
        if self.kind == 'InvertedSliderCrank':
            return turned
        top, _ = self._ends(curve)
        return mp.atan2(mp.convert(self.lengths[2]), top) + turned

    def _pressed(self, load, pressure):
        """Returns the force of a pressure along the guide."""
        top, bottom = self._ends(load)
        behind = mp.mpf(101300.0 if load.ambient is None else load.ambient)
        return (pressure - behind) * mp.pi * mp.mpf(load.bore) ** 2 / 4 * mp.sign(bottom - top)

    @functools.cached_property
    def middle(self):
        """Middle of the rocker's swing, from the package; test_loads.py checks it."""
        return mp.mpf(self.mechanism.swing_middle('', 0.0))

    def _continuous(self, link, place):
        """Returns the position of a link; a rocker's is within half a turn of its middle."""
        return self.middle + wrap(place - self.middle) if link == 'rocker' else place

    def _stretch(self, load, place):
        rest = self._continuous(load.link, mp.mpf(load.rest))
        return self._continuous(load.link, place) - rest

    def _reduced(self, curve):
        """Returns the points of a curve; angles of a rocker are shifted by whole turns."""
        if curve.link != 'rocker':
            return curve.at
        turns = mp.nint((mp.mpf(curve.at[0] + curve.at[-1]) / 2 - self.middle) / (2 * mp.pi))
        return [mp.mpf(x) - 2 * mp.pi * turns for x in curve.at]

    def _rubbing(self, bodies):
        """Returns the joints with friction: name, factor, and the pushes of a unit of it."""
        friction = next((x for x in self.loads if hasattr(x, 'pin_radius')), None)
        found = []
        for joint in self.joints() if friction else ():
            body, carrier = bodies[joint.body], bodies[joint.carrier]
            if joint.guide is None:
                factor = mp.mpf(friction.pin) * mp.mpf(friction.pin_radius)
                sign = _sign(body.spin - carrier.spin, abs(body.spin) + abs(carrier.spin))
                pushes = Push(joint.body, 0, 0, -sign), Push(joint.carrier, 0, 0, sign)
            else:
                factor, (_, rate, _) = mp.mpf(friction.guide), self.slide(joint, bodies)
                sign = _sign(rate, abs(body.velocity) + abs(carrier.velocity))
                pushes = (Effort(joint.name, -sign),)
            if factor and sign:
                found.append((joint.name, factor, pushes))
        return found

    def energy(self, q, u):
        """Computes the kinetic and potential energy of masses and loads on links, J."""
        bodies, total = self.moving(q, u), mp.mpf(0)
        for name, part in self.parts.items():
            place, velocity, _ = bodies[name].point(self.center(name))
            mass, inertia = mp.mpf(part.mass), mp.mpf(getattr(part, 'inertia', 0) or 0)
            total += mass * (
                abs(velocity) ** 2 / 2 - dot(complex_of(self.mechanism.gravity), place)
            )
            total += inertia * bodies[name].spin ** 2 / 2
        for load in self.loads:
            if hasattr(load, 'rest'):
                place = self.of_link(load.link, bodies)[0]
                total -= mp.mpf(load.force) * self._continuous(load.link, place)
                if load.stiffness:
                    total += mp.mpf(load.stiffness) * self._stretch(load, place) ** 2 / 2
        return total

    def natural(self, speed, acceleration):
        """Estimates the size of each quantity in a mechanism of this size at this speed."""
        size, square = float(max(map(abs, self.lengths))), speed**2 + abs(acceleration)
        gravity = math.hypot(*self.mechanism.gravity)
        torque = sum(
            (getattr(part, 'inertia', 0) or 0) * square
            + part.mass * size * (size * square + gravity)
            for part in self.parts.values()
        )
        for load in self.loads:
            if hasattr(load, 'rest'):
                arm = 1.0 if self.slide_of(load.link) is None else size
                held = load.damping * abs(speed) + load.stiffness
                torque += arm * (abs(load.force) + arm * held)
        units = [1.0 if turns else size for turns in self.turning]
        return *units, *(abs(speed) * x for x in units), *(square * x for x in units), torque


# Cached, because tests share states.
oracle_of = functools.lru_cache(Oracle)


def _first(q):
    return q[0] if isinstance(q, tuple) else q


def _sign(x, size):
    """Returns the sign of a difference, 0 where only rounding errors are left of it."""
    return mp.sign(x) if abs(x) > size * mp.mpf('1e-50') else 0


def _carriers(dyad):
    return {dyad.from_, dyad.to or 'frame', dyad.slider.on if dyad.slider else 'frame'}


def _joints_of_dyad(dyad):
    first, name = f'{dyad.name}_first', dyad.name
    if dyad.barrel is not None:
        barrel, rod = f'{name}_barrel', f'{name}_rod'
        return [
            Joint(f'{name}_from', rod, 0, dyad.from_, complex_of(dyad.from_at)),
            Joint(f'{name}_to', barrel, 0, dyad.to, complex_of(dyad.to_at or (0, 0))),
            Joint(rod, rod, 0, barrel, mp.mpc(0, dyad.offset), mp.mpc(1)),
        ]
    found = [Joint(f'{name}_from', first, 0, dyad.from_, complex_of(dyad.from_at))]
    length = mp.mpf(dyad.first.length)
    if dyad.second is None:
        slider = f'{name}_slider'
        way = mp.expj(mp.mpf(dyad.slider.angle))
        found.append(Joint(f'{name}_joint', slider, 0, first, length))
        found.append(Joint(slider, slider, 0, dyad.slider.on, complex_of(dyad.slider.at), way))
    else:
        second, along = f'{name}_second', mp.mpf(dyad.second.length)
        found.append(Joint(f'{name}_joint', second, along, first, length))
        to_at = complex_of(dyad.to_at or (0, 0))
        found.append(Joint(f'{name}_to', second, 0, dyad.to, to_at))
    return found


def _placed_dyad(dyad, bodies):
    start = bodies[dyad.from_].at(complex_of(dyad.from_at))
    if dyad.barrel is not None:
        stop, offset = bodies[dyad.to].at(complex_of(dyad.to_at or (0, 0))), mp.mpf(dyad.offset)
        way = (start - stop) / mp.mpc(root(abs(start - stop) ** 2 - offset**2), offset)
        return {f'{dyad.name}_barrel': Body(stop, way), f'{dyad.name}_rod': Body(start, way)}
    side, length = (1 if dyad.assembly == 'open' else -1), mp.mpf(dyad.first.length)
    if dyad.second is None:
        carrier = bodies[dyad.slider.on]
        way = mp.expj(mp.mpf(dyad.slider.angle)) * carrier.way
        at = carrier.at(complex_of(dyad.slider.at))
        joint = met_on_guide(start, length, at, way, side)
        last = {f'{dyad.name}_slider': Body(joint, way)}
    else:
        stop = bodies[dyad.to].at(complex_of(dyad.to_at or (0, 0)))
        joint = meet(start, length, stop, mp.mpf(dyad.second.length), side)
        last = {f'{dyad.name}_second': Body(stop, unit(joint - stop))}
    return {f'{dyad.name}_first': Body(start, unit(joint - start)), **last}


def _spring(load, bodies):
    ends = (load.link, complex_of(load.at)), (load.to, complex_of(load.to_at))
    (here, speed, _), (there, other, _) = (bodies[name].point(at) for name, at in ends)
    length = abs(there - here)
    towards = (there - here) / length
    pull = load.stiffness * (length - mp.mpf(load.free_length))
    pull += load.damping * dot(towards, other - speed)
    return [Push(*end, sign * pull * towards) for end, sign in zip(ends, (1, -1), strict=True)]


def _force(joint, found, i):
    """Returns the force of a joint; of a guide, its force to the left and its moment."""
    one, other = (found[joint.name, k][i] for k in (0, 1))
    return mp.mpc(one, other) if joint.guide is None else (one, other)


# Geometry and equations.


def root(x):
    """Returns a square root.

    Raises:
        ArithmeticError: The number is negative: circles do not intersect.
    """
    if x < 0:
        raise ArithmeticError('the links do not reach')
    return mp.sqrt(x)


def meet(center, radius, other, its_radius, side):
    """Intersects two circles; side 1 is to the left of the line from the first centre."""
    distance = abs(other - center)
    along = (radius**2 - its_radius**2 + distance**2) / (2 * distance)
    across = side * root(radius**2 - along**2)
    return center + (other - center) / distance * mp.mpc(along, across)


def met_on_guide(center, radius, at, way, side):
    """Intersects a circle and a guide; side 1 is ahead of the centre."""
    foot = mp.conj(way) * (center - at)
    return at + way * (foot.real + side * root(radius**2 - foot.imag**2))


def means(one, other):
    return tuple((x + y) / 2 for x, y in zip(one, other, strict=True))


def solved(rows):
    """Solves sparse linear equations with one or more right-hand sides.

    Args:
        rows: Coefficients by unknown, and right-hand sides by number from 0, of each equation.

    Returns:
        For each unknown, a value for each right-hand side.
    """
    rows, order = [dict(row) for row in rows], []
    for _ in range(len(rows)):
        # The row with the fewest entries, and its largest entry.
        row = min(rows, key=len)
        rows = [other for other in rows if other is not row]
        pivot = max((k for k in row if not isinstance(k, int)), key=lambda k: abs(row[k]))
        order.append((pivot, row))
        for other in rows:
            if (factor := other.pop(pivot, 0)) != 0:
                factor /= row[pivot]
                for k, x in row.items():
                    if k != pivot:
                        other[k] = other.get(k, 0) - factor * x
    found = {}
    for pivot, row in reversed(order):
        known = [(x, found[k]) for k, x in row.items() if k in found]
        count = sum(isinstance(k, int) for k in row)
        found[pivot] = [
            (row[i] - sum((x * values[i] for x, values in known), mp.mpf(0))) / row[pivot]
            for i in range(count)
        ]
    return found


def settle(rubbing, joints):
    """Solves for friction equal to its factor times the joint force, in every joint.

    Args:
        rubbing: Names of the joints and factors.
        joints: Joint forces without friction, and their change per unit of each friction.

    Returns:
        The friction in each joint, not negative, by Newton's method. If the iteration does not
        converge at once, the coefficients are increased step by step.

    Raises:
        ArithmeticError: There is no solution.
    """
    first, *added = ({k: _pressing(x) for k, x in row.items()} for row in joints)

    def lacks(share, sizes):
        for (name, factor), size in zip(rubbing, sizes, strict=True):
            forces = (joint[name] * x for joint, x in zip(added, sizes, strict=True))
            yield share * factor * abs(first[name] + sum(forces)) - size

    for shares in ([1], [1 - (1 - mp.mpf(k) / 24) ** 4 for k in range(1, 25)]):
        sizes = [mp.mpf(0)] * len(rubbing)
        with suppress(ValueError, ZeroDivisionError):  # no convergence
            for share in shares if rubbing else ():
                sizes = [*mp.findroot(lambda *x, share=share: [*lacks(share, x)], sizes)]
            if min(sizes, default=0) >= 0:
                return sizes
    raise ArithmeticError('no friction goes with these forces')


def _pressing(force):
    return force[0] if isinstance(force, tuple) else force


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
    pair = pair or (0.0, 0.0)  # the first pin
    return mp.mpc(mp.mpf(pair[0]), mp.mpf(pair[1]))


def unit(vector):
    return vector / abs(vector)


def dot(u, v):
    return u.real * v.real + u.imag * v.imag


def cross(u, v):
    return u.real * v.imag - u.imag * v.real
