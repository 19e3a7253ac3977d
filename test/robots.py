# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""URDF models of linkages in any plane, with their own kinematics and dynamics.

A model is made from the parameters of a linkage: its plane is tilted, its links get frames,
joint zeros, axis directions, inertial axes and fixed child links at random. `Tree` reads such a
model again with code of its own, moves it, and computes the power of its inertia and weight by
Newton and Euler, so that nothing here comes from the package.
"""

import math
from typing import NamedTuple
from xml.etree import ElementTree as ET

import numpy as np

LINKS = {
    'four_bar': ('crank', 'coupler', 'rocker'),
    'slider_crank': ('crank', 'coupler', 'slider'),
    'inverted_slider_crank': ('crank', 'rod', 'barrel'),
}
# A valid URDF has limits of its prismatic joints.
LIMITS = {'prismatic': '<limit lower="-9" upper="9" effort="9" velocity="9"/>', 'continuous': ''}
UP = np.array((0.0, 0.0, 1.0))


def rotation(rpy):
    """Returns the matrix of roll, pitch and yaw, each written out."""
    (a, b, c), (x, y, z) = np.cos(rpy), np.sin(rpy)
    return np.array([
        [b * c, x * y * c - a * z, a * y * c + x * z],
        [b * z, x * y * z + a * c, a * y * z - x * c],
        [-y, x * b, a * b],
    ])  # fmt: skip


def rpy_of(matrix):
    return (
        math.atan2(matrix[2, 1], matrix[2, 2]),
        math.atan2(-matrix[2, 0], math.hypot(matrix[0, 0], matrix[1, 0])),
        math.atan2(matrix[1, 0], matrix[0, 0]),
    )


def rotated(axis, angle):
    """Returns the matrix of a rotation about a unit vector."""
    x, y, z = axis
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    cosine = math.cos(angle)
    return np.eye(3) * cosine + math.sin(angle) * K + (1 - cosine) * np.outer(axis, axis)


def random_rotation(random):
    q = random.normal(size=4)
    w, x, y, z = q / np.linalg.norm(q)
    return rotated(np.array((x, y, z)) / math.hypot(x, y, z), 2 * math.acos(w))


def pose(matrix, place):
    made = np.eye(4)
    made[:3, :3], made[:3, 3] = matrix, place
    return made


def numbers(vector):
    return ' '.join(repr(float(number)) for number in vector)


def origin(made):
    return f'<origin xyz="{numbers(made[:3, 3])}" rpy="{numbers(rpy_of(made[:3, :3]))}"/>'


class Made(NamedTuple):
    """A URDF and the facts that an import must find.

    Attributes:
        text: The URDF.
        joints: Name, zero, ratio and parent link of each joint, by link of the mechanism.
        close: The two links whose origins coincide.
    """

    text: str
    joints: dict
    close: tuple


def make_robot(values, random, cut='B', axes=None, hip=None):
    """Returns a URDF of a linkage.

    Args:
        values: Parameters of a four_bar or slider_crank by dotted name; gravity is that of the
            plane.
        random: Random generator.
        cut: Pin at which the tree is open: A, B or B0; of a cylinder A0, A or B0.
        axes: Axes of the linkage in all frames of the model, as columns; by default, all frames
            are turned at random.
        hip: Kind of the joint on which the frame hangs, whose axis is normal to the plane; by
            default, the frame is fixed.
    """

    def turn():
        return random_rotation(random) if axes is None else np.eye(3)

    links = LINKS[values['mechanism']]
    out, delta = links[2], values['frame.angle']
    pins, above = tree_of(out, cut)
    length = {link: values.get(f'{link}.length', 0.0) for link in links}
    fixed = pivots(values, out)

    mount, bracket = pose(turn(), random.normal(size=3)), pose(turn(), random.normal(size=3))
    frame = mount @ bracket
    plane = frame @ pose(turn() if axes is None else axes, random.normal(size=3))
    normal = plane[:3, 2]

    def space(point, height=0.0):
        return (plane @ (point.real, point.imag, height, 1.0))[:3]

    # With all joints at 0: direction, first pin, link frame and the linkage's axes of each link.
    angle, start, zeros, own = {'frame': 0.0}, {}, {}, {}
    bodies = {'frame': frame}
    signs = {link: float(random.choice((-1, 1))) for link in links}
    parts = [
        '<link name="root"/><link name="hub"/><link name="frame"/>',
        weld('root', 'hub', mount), hung(hip, bracket, frame[:3, :3].T @ normal, random),
    ]  # fmt: skip

    def at(link, pin):
        """Returns a pin of a link, x + iy in the plane."""
        if link == 'frame':
            return fixed[pin]
        far = length[link] * (pins[link].index(pin) == 1)
        return start[link] + far * np.exp(1j * angle[link])

    def add(link, parent, place, axis, kind):
        """Adds a link and its joint, along or about an axis."""
        nonlocal parts
        level = random.normal()
        bodies[link] = pose(turn(), space(place, level))
        turned = pose(rotated(UP, angle[link]), (start[link].real, start[link].imag, level))
        own[link] = plane @ turned
        inside = np.linalg.inv(bodies[parent]) @ bodies[link]
        words = f'<axis xyz="{numbers(bodies[link][:3, :3].T @ axis)}"/>'
        parts.append(joint(f'{link}_motor', kind, parent, link, inside, words + LIMITS[kind]))
        parts += masses(link, values, own[link], bodies[link], random, turn)

    for link, parent in above.items():
        if {link, parent} == {'rod', 'barrel'}:
            zeros[link], angle[link] = random.uniform(0.8, 1.1) * values['stroke'], angle[parent]
            way = np.exp(1j * angle[link])
            side = 1 if link == 'rod' else -1
            start[link] = start[parent] + side * (zeros[link] + 1j * values['offset']) * way
            place, axis = start[link], side * signs[link] * (space(way) - space(0j))
            add(link, parent, place, axis, 'prismatic')
            continue
        (pin,) = set(pins[link]) & set(('A0', 'B0') if parent == 'frame' else pins[parent])
        place = at(parent, pin)
        zeros[link] = random.uniform(-math.pi, math.pi)
        angle[link] = zeros[link] + angle[parent]
        axis = signs[link] * normal
        if link == 'slider':
            zeros[link], angle[link] = random.normal() * length['crank'], 0.0
            place += zeros[link] * np.exp(1j * delta)
            axis = signs[link] * (space(np.exp(1j * delta)) - space(0j))
        start[link] = place
        start[link] -= at(link, pin) - place
        add(link, parent, place, axis, 'prismatic' if link == 'slider' else 'continuous')

    level = random.normal()
    ends = [*(link for link in pins if cut in pins[link]), 'frame']
    for name, link in zip(('tip', 'pin'), ends, strict=False):
        end = pose(turn(), space(at(link, cut), level))
        between = pose(turn(), random.normal(size=3))
        parts += [
            f'<link name="{name}"/><link name="{name}_arm"/>',
            weld(link, f'{name}_arm', np.linalg.inv(bodies[link]) @ between),
            weld(f'{name}_arm', name, np.linalg.inv(between) @ end),
        ]
    joints = joints_of(links, above, zeros, signs)
    return Made(f'<robot name="made">{"".join(parts)}</robot>', joints, ('tip', 'pin'))


def pivots(values, out):
    """Returns the points of the frame in the plane, x + iy."""
    way = np.exp(1j * values['frame.angle'])
    if out == 'slider':
        return {'A0': 0j, 'B0': 1j * values['slider.offset'] * way}
    return {'A0': 0j, 'B0': values['frame.length'] * way}


def tree_of(out, cut):
    """Returns the pins of each link, and the link above it in the tree that is open at a pin."""
    if out == 'barrel':
        return {'crank': ('A0', 'A'), 'rod': ('A',), 'barrel': ('B0',)}, {
            'A': {'crank': 'frame', 'barrel': 'frame', 'rod': 'barrel'},
            'B0': {'crank': 'frame', 'rod': 'crank', 'barrel': 'rod'},
            'A0': {'barrel': 'frame', 'rod': 'barrel', 'crank': 'rod'},
        }[cut]
    return {'crank': ('A0', 'A'), 'coupler': ('A', 'B'), out: ('B0', 'B')}, {
        'B': {'crank': 'frame', out: 'frame', 'coupler': 'crank'},
        'A': {'crank': 'frame', out: 'frame', 'coupler': out},
        'B0': {'crank': 'frame', 'coupler': 'crank', out: 'coupler'},
    }[cut]


def joints_of(links, above, zeros, signs):
    """Returns name, zero, ratio and parent link of each joint, by the link that it moves.

    A rod turns with its barrel, and slides in it.
    """
    found = {}
    for link in links:
        moved, parent = link, above[link]
        if {link, parent} == {'rod', 'barrel'}:
            moved = parent = 'rod'
        elif link == 'rod':
            moved = 'barrel'
        parent = 'barrel' if parent == 'rod' else parent
        found[moved] = f'{link}_motor', zeros[link], signs[link], parent
    return found


def joint(name, kind, parent, child, inside, axis=''):
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'{origin(inside)}{axis}</joint>'
    )


def hung(hip, inside, normal, random):
    """Returns the joint of the frame: fixed, or about or against the normal."""
    if not hip:
        return weld('hub', 'frame', inside)
    axis = f'<axis xyz="{numbers(float(random.choice((-1, 1))) * normal)}"/>'
    return joint('hip', hip, 'hub', 'frame', inside, axis)


def weld(parent, child, inside):
    return joint(f'{child}_weld', 'fixed', parent, child, inside)


def masses(link, values, own, body, random, turn):
    """Yields a link and a cover fixed to it, which share its mass, centre and inertia."""
    mass, inertia = values.get(f'{link}.mass', 0.0), values.get(f'{link}.inertia', 0.0)
    center = np.array((*values.get(f'{link}.center', (0.0, 0.0)), random.normal()))
    arm = random.normal(size=3) * 0.01 * bool(inertia)
    halves = mass / 4 * (arm[0] ** 2 + arm[1] ** 2)  # inertia of both halves of the mass
    cover = pose(turn(), random.normal(size=3))
    for name, side, frame in ((link, -0.5, body), (f'{link}_cover', 0.5, cover)):
        S = random.normal(size=(3, 3)) * 0.01
        S += S.T
        S[2, 2] = (inertia - halves) / 2
        place = (own @ (*(center + side * arm), 1.0))[:3]
        inside = np.linalg.inv(frame) @ pose(turn(), place)
        axes = own[:3, :3].T @ frame[:3, :3] @ inside[:3, :3]
        S = axes.T @ S @ axes
        six = ('xx', 'xy', 'xz', 'yy', 'yz', 'zz')
        six = (f'i{a}{b}="{float(S["xyz".index(a), "xyz".index(b)])!r}"' for a, b in six)
        yield (
            f'<link name="{name}"><inertial>{origin(inside)}<mass value="{mass / 2!r}"/>'
            f'<inertia {" ".join(six)}/></inertial></link>'
        )
    yield weld(link, f'{link}_cover', np.linalg.inv(body) @ cover)


class Tree:
    """A URDF read again: forward kinematics, and the power of inertia and weight."""

    def __init__(self, text):
        root = ET.fromstring(text)
        self.joints, self.inertials = [], {}
        for element in root.iter('joint'):
            axis = element.find('axis')
            self.joints.append((
                element.get('name'), element.get('type'),
                element.find('parent').get('link'), element.find('child').get('link'),
                self._pose(element),
                np.array([1.0, 0, 0] if axis is None else axis.get('xyz').split(), float),
            ))  # fmt: skip
        for link in root.iter('link'):
            if (element := link.find('inertial')) is not None:
                made, six = self._pose(element), element.find('inertia').attrib
                pairs = [['i' + ''.join(sorted(a + b)) for b in 'xyz'] for a in 'xyz']
                I = np.array([[float(six[pair]) for pair in row] for row in pairs])
                mass = float(element.find('mass').get('value'))
                self.inertials[link.get('name')] = made, mass, made[:3, :3] @ I @ made[:3, :3].T

    @staticmethod
    def _pose(element):
        found = element.find('origin')
        if found is None:
            return np.eye(4)
        place, rpy = (np.array(found.get(x, '0 0 0').split(), float) for x in ('xyz', 'rpy'))
        return pose(rotation(rpy), place)

    def moving(self, q, u=None, a=None, root='root'):
        """Returns pose, spin, velocity, and their rates of change for each link, by name."""
        zero = np.zeros(3)
        u, a = u or {}, a or {}
        found = {root: (np.eye(4), zero, zero, zero, zero)}
        waiting = list(self.joints)
        while waiting:
            name, kind, parent, child, inside, axis = joint = waiting.pop(0)
            if parent not in found:
                waiting.append(joint)
                continue
            above, w, v, dw, dv = found[parent]
            made = above @ inside
            n, value = made[:3, :3] @ axis, q.get(name, 0.0)
            rate, change = u.get(name, 0.0), a.get(name, 0.0)
            if kind == 'prismatic':
                made = made @ pose(np.eye(3), value * axis)
            elif kind != 'fixed':
                made = made @ pose(rotated(axis, value), zero)
            arm = made[:3, 3] - above[:3, 3]
            v2, dv2 = v + np.cross(w, arm), dv + np.cross(dw, arm) + np.cross(w, np.cross(w, arm))
            w2, dw2 = w, dw
            if kind == 'prismatic':
                v2 = v2 + rate * n
                dv2 = dv2 + change * n + 2 * np.cross(w, rate * n)
            elif kind != 'fixed':
                w2 = w + rate * n
                dw2 = dw + change * n + np.cross(w, rate * n)
            found[child] = made, w2, v2, dw2, dv2
        return found

    def power(self, q, u, a, gravity=(0.0, 0.0, -9.81), along=None):
        """Returns the power, W, that inertia and weight take from the drive.

        `along` are rates of the joints that replace the actual ones in the power alone, which is
        then that of the joints that they move.
        """
        parts, virtual = [], self.moving(q, along or u)
        for link, (made, w, _, dw, dv) in self.moving(q, u, a).items():
            if link not in self.inertials:
                continue
            inside, mass, I = self.inertials[link]
            R = made[:3, :3]
            arm, I = R @ inside[:3, 3], R @ I @ R.T
            _, spin, way, *_ = virtual[link]
            speed = way + np.cross(spin, arm)
            change = dv + np.cross(dw, arm) + np.cross(w, np.cross(w, arm)) - gravity
            parts += [mass * change @ speed, (I @ dw + np.cross(w, I @ w)) @ spin]
        return math.fsum(parts)

    def gap(self, q, close):
        """Returns the distance between the origins of two links, m."""
        above = {child: joint for joint in self.joints for child in joint[3:4]}
        ends = []
        for link in close:
            place = np.zeros(3)
            while link in above:
                name, kind, parent, _, inside, axis = above[link]
                value = q.get(name, 0.0)
                if kind == 'prismatic':
                    place = place + value * axis
                elif kind != 'fixed':
                    place = rotated(axis, value) @ place
                place, link = inside[:3, :3] @ place + inside[:3, 3], parent
            ends.append(place)
        return math.dist(*ends)
