# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads MuJoCo's MJCF: https://mujoco.readthedocs.io/en/stable/XMLreference.html."""

import math
import re
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from linkage_lab.robots.model import (
    FIXED,
    IDENTITY,
    PRISMATIC,
    REVOLUTE,
    Closure,
    Inertial,
    Joint,
    Robot,
    Transform,
    about,
    from_quaternion,
    lumped,
    numbers,
    symmetric,
    unit,
)
from linkage_ros import ConfigurationError
from linkage_ros.formulas import Array
from linkage_ros.quantities import shown

_KINDS = {'hinge': REVOLUTE, 'slide': PRISMATIC}
_SIZES = {'sphere': 1, 'capsule': 2, 'cylinder': 2, 'box': 3, 'ellipsoid': 3}
_WORLD = 'world'


def read_mjcf(root: ET.Element, read: Callable[[Path], ET.Element], path: Path) -> Robot:
    """Reads bodies, joints, sites as links without mass, and active connect constraints.

    Args:
        root: The element <mujoco>.
        read: Function that reads an included file.
        path: Path of the file, to which included files are relative.

    Returns:
        The robot, whose root is the world.

    Raises:
        ConfigurationError: The file has invalid values.
    """
    _include(root, read, path.parent)
    return _Reader(root).robot(root)


def _include(element: ET.Element, read: Callable[[Path], ET.Element], folder: Path) -> None:
    """Replaces each element <include> by the contents of its file."""
    found = list[ET.Element]()
    for child in element:
        if child.tag == 'include':
            included = read(folder / child.get('file', ''))
            _include(included, read, folder)
            found.extend(included)
        else:
            _include(child, read, folder)
            found.append(child)
    element[:] = found


def _solid(kind: str, a: float, b: float, c: float) -> tuple[float, tuple[float, float, float]]:
    """Returns the volume of a solid, m^3, and its mean x^2, y^2 and z^2, m^2; NaN for others."""
    if kind == 'box':
        return 8 * a * b * c, (a * a / 3, b * b / 3, c * c / 3)
    if kind == 'ellipsoid':
        return 4 / 3 * math.pi * a * b * c, (a * a / 5, b * b / 5, c * c / 5)
    if kind == 'sphere':
        return _solid('ellipsoid', a, a, a)
    if kind == 'cylinder':
        return 2 * math.pi * a * a * b, (a * a / 4, a * a / 4, b * b / 3)
    if kind == 'capsule':
        (tube, (x, _, z)), (ball, _) = _solid('cylinder', a, b, b), _solid('sphere', a, a, a)
        # A half ball's centre is 3/8 of its radius from the flat side.
        across = (tube * x + ball * a * a / 5) / (tube + ball)
        along = (tube * z + ball * (b * b + 0.75 * a * b + a * a / 5)) / (tube + ball)
        return tube + ball, (across, across, along)
    return math.nan, (math.nan, math.nan, math.nan)


def _moved(mass: Inertial, at: Transform) -> Inertial:
    """Returns a mass that is given in another frame."""
    turned = at.rotation @ mass.inertia @ at.rotation.T
    return Inertial(mass.mass, at.of(mass.center), turned)


class _Reader:
    """Walks through the bodies; collects links, joints and closures."""

    def __init__(self, root: ET.Element) -> None:
        options = {key: x for part in root.findall('compiler') for key, x in part.items()}
        self.per_angle = 1.0 if options.get('angle') == 'radian' else math.pi / 180
        self.sequence = options.get('eulerseq', 'xyz')
        if not re.fullmatch('[xyzXYZ]{3}', self.sequence):
            raise ConfigurationError(
                f'eulerseq = {shown(self.sequence)}: must be three of xyz or XYZ, such as xyz'
            )
        self.links: dict[str, Inertial | None] = {_WORLD: None}
        self.joints: list[Joint] = []
        self.defaults: dict[tuple[str, str], dict[str, str]] = {}
        for part in root.findall('default'):
            self.take_defaults(part, {})

    def robot(self, root: ET.Element) -> Robot:
        for world in root.findall('worldbody'):
            self.take_body(world, _WORLD, 'main')
        closures = [
            self.closure(connect)
            for part in root.findall('equality')
            for connect in part.findall('connect')
            if connect.get('active', 'true') == 'true'
        ]
        gravity = [part for part in root.findall('option') if part.get('gravity')]
        down = numbers(gravity[-1] if gravity else None, 'gravity', 3, '0 0 -9.81')
        return Robot(self.links, self.joints, closures, down)

    def take_defaults(self, element: ET.Element, above: Mapping[str, Mapping[str, str]]) -> None:
        """Stores the attributes that a class, and the classes in it, gives to joints and sites."""
        name = element.get('class', 'main')
        own = {
            tag: {
                **above.get(tag, {}),
                **{k: x for part in element.findall(tag) for k, x in part.items()},
            }
            for tag in ('joint', 'site', 'geom')
        }
        for tag, values in own.items():
            self.defaults[name, tag] = values
        for part in element.findall('default'):
            self.take_defaults(part, own)

    def complete(self, element: ET.Element, group: str) -> ET.Element:
        """Returns an element with the attributes of its default class."""
        values = self.defaults.get((element.get('class', group), element.tag), {})
        return ET.Element(element.tag, {**values, **element.attrib})

    def take_body(self, body: ET.Element, name: str, group: str) -> None:
        """Reads the contents of a body, including sites and child bodies."""
        for child, at, own in self.parts(body, IDENTITY, body.get('childclass', group)):
            if child.tag == 'site' and child.get('name'):
                site = self.complete(child, own)
                self.take_fixed(name, child.get('name', ''), at.then(self.pose(site)))
            elif child.tag == 'body':
                self.take_child(child, name, at, own)

    def parts(
        self, element: ET.Element, at: Transform, group: str
    ) -> Iterator[tuple[ET.Element, Transform, str]]:
        """Yields each child, the transform of the <frame> elements around it, and its class."""
        for child in element:
            if child.tag == 'frame':
                pose, inner = at.then(self.pose(child)), child.get('childclass', group)
                yield from self.parts(child, pose, inner)
            else:
                yield child, at, group

    def take_child(self, body: ET.Element, parent: str, at: Transform, group: str) -> None:
        """Reads a body with its joints; two joints have a link without mass between them."""
        name = body.get('name') or f'body {len(self.links)}'
        pose, own = at.then(self.pose(body)), body.get('childclass', group)
        parts = self.parts(body, IDENTITY, own)
        joints = [part for part in parts if part[0].tag in {'joint', 'freejoint'}]
        for index, (element, inside, inner) in enumerate(joints):
            is_last = index == len(joints) - 1
            child = name if is_last else f'{name}, before {joints[index + 1][0].get("name")}'
            self.take_joint(self.complete(element, inner), parent, child, pose, inside)
            if not is_last:
                self.links[child] = None
                parent, pose = child, IDENTITY
        if not joints:
            self.take_fixed(parent, name, pose)
        self.links[name] = self.inertial(body, own)
        self.take_body(body, name, own)

    def take_fixed(self, parent: str, name: str, at: Transform) -> None:
        if name in self.links:
            raise ConfigurationError(f'two bodies or sites are named {shown(name)}: rename one')
        self.links[name] = None
        self.joints.append(Joint('', FIXED, parent, name, at))

    def take_joint(
        self, element: ET.Element, parent: str, child: str, pose: Transform, inside: Transform
    ) -> None:
        if child in self.links:
            raise ConfigurationError(f'two bodies or sites are named {shown(child)}: rename one')
        name = element.get('name') or f'{child}_joint'
        kind = 'free' if element.tag == 'freejoint' else element.get('type', 'hinge')
        at = inside.then(Transform(np.eye(3), numbers(element, 'pos', 3, '0 0 0')))
        axis = unit(numbers(element, 'axis', 3, '0 0 1'), f'the axis of joint {shown(name)}')
        (reference,) = numbers(element, 'ref', 1, '0')
        if kind == 'hinge':
            reference *= self.per_angle
        known = _KINDS.get(kind, kind)
        self.joints.append(
            Joint(name, known, parent, child, pose.then(at), at, axis, float(reference))
        )

    def pose(self, element: ET.Element) -> Transform:
        """Reads position and orientation, which MJCF writes in one of five forms."""
        place = numbers(element, 'pos', 3, '0 0 0')
        rotation = np.eye(3)
        if element.get('quat'):
            rotation = from_quaternion(*numbers(element, 'quat', 4))
        elif element.get('axisangle'):
            *axis, angle = numbers(element, 'axisangle', 4)
            rotation = about(unit(np.array(axis), 'axisangle'), angle * self.per_angle)
        elif element.get('euler'):
            for letter, angle in zip(self.sequence, numbers(element, 'euler', 3), strict=True):
                turn = about(np.eye(3)['xyz'.index(letter.lower())], angle * self.per_angle)
                # A capital letter is an axis that does not turn.
                rotation = turn @ rotation if letter.isupper() else rotation @ turn
        elif element.get('xyaxes'):
            x, y = numbers(element, 'xyaxes', 6).reshape(2, 3)
            x = unit(x, 'xyaxes')
            y = unit(y - x * (x @ y), 'xyaxes')
            rotation = np.stack((x, y, np.cross(x, y)), axis=1)
        elif element.get('zaxis'):
            z = unit(numbers(element, 'zaxis', 3), 'zaxis')
            across = np.cross((0.0, 0.0, 1.0), z)
            if sine := math.hypot(*across):
                rotation = about(across / sine, math.atan2(sine, z[2]))
            elif z[2] < 0:
                rotation = about(np.eye(3)[0], math.pi)
        return Transform(rotation, place)

    def inertial(self, body: ET.Element, group: str) -> Inertial | None:
        """Reads the mass of a body, or computes it from its geoms."""
        parts = [*self.parts(body, IDENTITY, group)]
        own = [child for child, *_ in parts if child.tag == 'inertial']
        if not own:
            geoms = (
                _moved(self.geom(self.complete(geom, inner)), at)
                for geom, at, inner in parts
                if geom.tag == 'geom'
            )
            return lumped([geom for geom in geoms if geom.mass])
        element = own[0]  # MuJoCo does not apply the frames around it
        pose, (mass,) = self.pose(element), numbers(element, 'mass', 1)
        if element.get('fullinertia'):
            xx, yy, zz, xy, xz, yz = numbers(element, 'fullinertia', 6)
            inertia = symmetric(xx, xy, xz, yy, yz, zz)
        else:
            inertia = np.diag(numbers(element, 'diaginertia', 3, '0 0 0'))
        return Inertial(float(mass), pose.place, pose.rotation @ inertia @ pose.rotation.T)

    def geom(self, geom: ET.Element) -> Inertial:
        """Computes the mass of a geom; NaN if it is that of a mesh.

        Raises:
            ConfigurationError: A size is missing or not positive.
        """
        pose, kind = self.pose(geom), geom.get('type', 'sphere')
        words = geom.get('size', '').split()
        size = [*numbers(geom, 'size', len(words)), *3 * [math.nan]]
        if geom.get('fromto'):
            ends = numbers(geom, 'fromto', 6).reshape(2, 3)
            way = ends[1] - ends[0]
            # fromto gives the last size.
            size[1 if kind in {'capsule', 'cylinder'} else 2] = math.hypot(*way) / 2
            frame = ET.Element('geom', zaxis=' '.join(map(repr, map(float, way))))
            pose = Transform(self.pose(frame).rotation, ends.mean(axis=0))
        needed = _SIZES.get(kind, 0)
        if not all(part > 0 for part in size[:needed]):
            raise ConfigurationError(
                f'geom {shown(geom.get("name", ""))} of type {kind} has size {shown(words)}: must '
                f'be {needed} positive numbers, of which fromto gives the last'
            )
        volume, squares = _solid(kind, *size[:3])
        density = float(numbers(geom, 'density', 1, '1000')[0])
        mass = float(numbers(geom, 'mass', 1)[0]) if geom.get('mass') else density * volume
        x, y, z = squares
        inertia = mass * np.diag((y + z, x + z, x + y))
        return Inertial(mass, pose.place, pose.rotation @ inertia @ pose.rotation.T)

    def closure(self, connect: ET.Element) -> Closure:
        """Reads a constraint between two sites, or between two bodies at the model's start.

        Raises:
            ConfigurationError: A body or site is missing.
        """
        sites = connect.get('site1'), connect.get('site2')
        if None not in sites:
            first, second = map(str, sites)
            points: tuple[Array, Array] = np.zeros(3), np.zeros(3)
        else:
            first, second = connect.get('body1', ''), connect.get('body2', _WORLD)
            anchor = numbers(connect, 'anchor', 3)
            points = anchor, anchor  # the second follows from the poses
        for link in (first, second):
            if link not in self.links:
                raise ConfigurationError(f'<connect> names {shown(link)}, which is missing')
        if None in sites:
            start = self.starts()
            points = points[0], start[second].inverse().then(start[first]).of(points[0])
        return Closure(connect.get('name') or f'{first} and {second}', (first, second), points)

    def starts(self) -> dict[str, Transform]:
        """Returns the pose of each link at the reference position of all joints."""
        poses = {_WORLD: IDENTITY}
        for joint in self.joints:  # parents come first
            poses[joint.child] = poses[joint.parent].then(joint.moved(joint.reference))
        return poses
