# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A robot model in three dimensions: links, joints and closures of loops, as read from a file."""

import math
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import NamedTuple
from xml.etree import ElementTree as ET

import numpy as np

from linkage_ros import ConfigurationError
from linkage_ros.formulas import Array
from linkage_ros.quantities import shown

FIXED, REVOLUTE, PRISMATIC, BALL = 'fixed', 'revolute', 'prismatic', 'ball'
# Kinds of movable joints, and names of the components of inertia, in URDF and SDF.
KINDS = {'revolute': REVOLUTE, 'continuous': REVOLUTE, 'prismatic': PRISMATIC}
INERTIA = 'ixx', 'ixy', 'ixz', 'iyy', 'iyz', 'izz'
MOMENTS = 'ixx', 'iyy', 'izz'


class Transform(NamedTuple):
    """Pose of one frame in another: x in the other frame is rotation @ x + place.

    Attributes:
        rotation: Rotation matrix, shape (3, 3).
        place: Origin in the other frame, m, shape (3,).
    """

    rotation: Array
    place: Array

    def then(self, inner: 'Transform') -> 'Transform':
        """Returns the pose of a frame whose pose in this frame is `inner`."""
        return Transform(self.rotation @ inner.rotation, self.rotation @ inner.place + self.place)

    def inverse(self) -> 'Transform':
        """Returns the pose of the other frame in this frame."""
        return Transform(self.rotation.T, -(self.rotation.T @ self.place))

    def of(self, point: Array) -> Array:
        """Returns a point of this frame in the other frame, m."""
        found: Array = self.rotation @ point + self.place
        return found


_LISTED = 12
IDENTITY = Transform(np.eye(3), np.zeros(3))


class Inertial(NamedTuple):
    """Mass of a link.

    Attributes:
        mass: Mass, kg.
        center: Centre of mass in the link's frame, m, shape (3,).
        inertia: Inertia about the centre of mass in the link's axes, kg m^2, shape (3, 3).
    """

    mass: float
    center: Array
    inertia: Array


class Joint(NamedTuple):
    """A joint between two links.

    Attributes:
        name: Name of the joint; empty if the file gives none.
        kind: FIXED, REVOLUTE, PRISMATIC, BALL, or another type in the file.
        parent: Name of the parent link.
        child: Name of the child link, which moves along or about `axis` by the joint's value.
        in_parent: Pose of the joint's frame in the parent link.
        in_child: Pose of the joint's frame in the child link.
        axis: Axis in the joint's frame, a unit vector.
        mimics: Name, multiplier and offset of the joint to which the file couples this one.
        left_out: Properties in the file that a linkage does not have, such as damping.
    """

    name: str
    kind: str
    parent: str
    child: str
    in_parent: Transform
    in_child: Transform = IDENTITY
    axis: Array = np.array((1.0, 0.0, 0.0))
    mimics: tuple[str, float, float] | None = None
    left_out: str = ''

    def moved(self, value: float) -> Transform:
        """Returns the pose of the child link in the parent link at a value, rad or m."""
        return self.in_parent.then(self.motion(value)).then(self.in_child.inverse())

    def motion(self, value: float) -> Transform:
        """Returns the pose of the joint's frame in the child in that in the parent at a value."""
        if self.kind == REVOLUTE:
            return Transform(about(self.axis, value), np.zeros(3))
        return Transform(np.eye(3), value * self.axis) if self.kind == PRISMATIC else IDENTITY


class Closure(NamedTuple):
    """Two points of two links that coincide in the closed loop.

    Attributes:
        name: Name of the closure in the file or the names of the links.
        links: Names of both links.
        points: Point in the frame of each link, m, shape (3,) each.
        axis: Axis in the first link's frame, a unit vector; None for a ball joint.
        joint: Name of the joint that it is; empty if it is a constraint.
    """

    name: str
    links: tuple[str, str]
    points: tuple[Array, Array]
    axis: Array | None = None
    joint: str = ''


class RobotModel(NamedTuple):
    """A robot model.

    Attributes:
        links: Mass of each link by name; None if the file gives none.
        joints: The joints. Their graph may contain loops.
        closures: Closures given by the file, in addition to loops of joints.
        gravity: Acceleration of gravity in the axes of the root, m/s^2, shape (3,).
        roots: Pose of links in the root's axes; the origin for others.
        others: Constraints in the file that close no loop, with the reason.
        doubts: Description of omitted or assumed values of a link, by name.
        notes: Sentences about what is left out of the whole model.
    """

    links: Mapping[str, Inertial | None]
    joints: Sequence[Joint]
    closures: Sequence[Closure] = ()
    gravity: Array = np.array((0.0, 0.0, -9.81))
    roots: Mapping[str, Transform] = {}
    others: Sequence[str] = ()
    doubts: Mapping[str, str] = {}
    notes: Sequence[str] = ()


def listed(words: Iterable[str], separator: str = ', ') -> str:
    """Joins words for a message: at most twelve, and the number of further ones."""
    all_words = [word for word in words if word]
    shown_words, more = all_words[:_LISTED], len(all_words[_LISTED:])
    return separator.join([*shown_words, f'and {more} more'] if more else shown_words)


def lumped(parts: Sequence[Inertial]) -> Inertial | None:
    """Returns the mass of several parts, given in one frame; None if there are none."""
    mass = math.fsum(part.mass for part in parts)
    if not parts:
        return None
    weights = [part.mass / mass if mass else 1 / len(parts) for part in parts]
    center = sum((w * part.center for w, part in zip(weights, parts, strict=True)), np.zeros(3))
    inertia = np.zeros((3, 3))
    for part in parts:
        arm = part.center - center
        inertia += part.inertia + part.mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    return Inertial(mass, center, inertia)


def about(axis: Array, angle: float) -> Array:
    """Returns the matrix of a rotation by an angle, rad, about a unit vector."""
    x, y, z = axis
    cross = np.array(((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0)))
    half = math.sin(angle / 2)
    rotation: Array = np.eye(3) + math.sin(angle) * cross + 2 * half * half * (cross @ cross)
    return rotation


def from_rpy(roll: float, pitch: float, yaw: float) -> Array:
    """Returns the rotation matrix of roll, pitch and yaw, rad, about fixed axes (URDF, SDF)."""
    x, y, z = np.eye(3)
    rotation: Array = about(z, yaw) @ about(y, pitch) @ about(x, roll)
    return rotation


def from_quaternion(w: float, x: float, y: float, z: float) -> Array:
    """Returns the rotation matrix of a quaternion of any length above 0."""
    length = math.hypot(x, y, z)
    if not length:
        return np.eye(3)
    return about(np.array((x, y, z)) / length, 2 * math.atan2(length, w))


def quaternion_of(xyzw: Array) -> Array:
    """Returns the rotation matrix of a quaternion in the order of URDF and SDF.

    Raises:
        ConfigurationError: The quaternion has length 0.
    """
    x, y, z, w = unit(xyzw, 'quat_xyzw')
    return from_quaternion(w, x, y, z)


def child_of(
    element: ET.Element, tag: str, known: Collection[str] | None = None
) -> ET.Element | None:
    """Returns the only child of a name; None if there is none.

    Args:
        element: The parent.
        tag: Name of the child.
        known: Names of its attributes; None for any.

    Returns:
        The child.

    Raises:
        ConfigurationError: There are several, or one has another attribute.
    """
    children = element.findall(tag)
    if len(children) > 1:
        raise ConfigurationError(f'<{element.tag}> has several <{tag}>: must be one')
    found = next(iter(children), None)
    if found is not None and known is not None and (more := {*found.keys()} - {*known}):
        raise ConfigurationError(
            f'<{tag}> has {shown(min(more))}, which is not read: must be {listed(known)}'
        )
    return found


def unknown_in(element: ET.Element | None, known: Collection[str]) -> list[str]:
    """Returns the children that a format does not have, but for those with a prefix."""
    tags = () if element is None else (child.tag for child in element)
    return [f'<{tag}>' for tag in tags if tag not in known and '.' not in tag]


def is_true(text: str) -> bool:
    """Reads a truth value of SDF.

    Raises:
        ConfigurationError: The text is not a truth value.
    """
    word = text.strip().lower()
    if word not in {'0', '1', 'false', 'true'}:
        raise ConfigurationError(f'{shown(text)}: must be true, false, 1 or 0')
    return word in {'1', 'true'}


def version_of(root: ET.Element, default: str) -> tuple[int, ...]:
    """Reads the version of a format, of which 1.11 comes after 1.9.

    Raises:
        ConfigurationError: It is not numbers with dots between them.
    """
    text = root.get('version', default).strip()
    if not re.fullmatch(r'[0-9]{1,9}(\.[0-9]{1,9}){0,9}', text):
        raise ConfigurationError(f'version {shown(text)}: must be numbers, such as {default}')
    return tuple(map(int, text.split('.')))


def numbers(element: ET.Element | None, name: str, count: int, default: str = '') -> Array:
    """Reads an attribute, or the text if `name` is empty, as finite numbers.

    Args:
        element: Element to read; None for the default.
        name: Name of the attribute.
        count: Number of numbers.
        default: Text that replaces a missing attribute.

    Returns:
        The numbers, shape (count,).

    Raises:
        ConfigurationError: The text is missing or has other content.
    """
    text = default
    if element is not None:
        text = element.get(name, default) if name else (element.text or default)
    try:
        found = np.array([float(word) for word in text.split()])
        if len(found) == count and np.isfinite(found).all():
            return found
    except ValueError:
        pass
    tag = '' if element is None else f'<{element.tag}> '
    raise ConfigurationError(
        f'{tag}{name or "text"} = {shown(text)}: must be {count} finite '
        f'number{"s" if count > 1 else ""}'
    )


def unit(axis: Array, what: str) -> Array:
    """Scales an axis to length 1.

    Args:
        axis: Vector of any length.
        what: Description of the axis in the error message.

    Returns:
        The unit vector.

    Raises:
        ConfigurationError: The axis has length 0.
    """
    length = math.hypot(*axis)
    if not length:
        raise ConfigurationError(f'{what} has length 0: give a direction')
    scaled: Array = axis / length
    return scaled


def symmetric(xx: float, xy: float, xz: float, yy: float, yz: float, zz: float) -> Array:
    """Returns a symmetric matrix, shape (3, 3)."""
    return np.array(((xx, xy, xz), (xy, yy, yz), (xz, yz, zz)))
