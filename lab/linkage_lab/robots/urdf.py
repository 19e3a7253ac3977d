# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads a URDF: http://wiki.ros.org/urdf/XML."""

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from typing import TypeVar
from xml.etree import ElementTree as ET

from linkage_lab.robots.model import (
    IDENTITY,
    INERTIA,
    KINDS,
    MOMENTS,
    PRISMATIC,
    REVOLUTE,
    Inertial,
    Joint,
    RobotModel,
    Transform,
    child_of,
    from_rpy,
    listed,
    numbers,
    quaternion_of,
    symmetric,
    unit,
    unknown_in,
    version_of,
)
from linkage_lab.robots.sdf import read_joint, read_pose
from linkage_ros import ConfigurationError
from linkage_ros.quantities import shown

_T = TypeVar('_T')
_ATTRIBUTES = {
    'origin': ('xyz', 'rpy', 'quat_xyzw'),
    'mass': ('value',),
    'inertia': INERTIA,
    'parent': ('link',),
    'child': ('link',),
    'axis': ('xyz',),
    'limit': ('lower', 'upper', 'effort', 'velocity', 'acceleration', 'deceleration', 'jerk'),
    'dynamics': ('damping', 'friction'),
    'mimic': ('joint', 'multiplier', 'offset'),
}
_IN_JOINT = (*_ATTRIBUTES, 'calibration', 'safety_controller')
_QUATERNIONS = 1, 1  # version from which they are read


def read_urdf(root: ET.Element) -> RobotModel:
    """Reads links and joints; limits, dynamics and visuals are ignored.

    Raises:
        ConfigurationError: The file has unexpanded macros or invalid values, or is not one tree.
    """
    if any('xacro' in element.tag for element in root.iter()):
        raise ConfigurationError(
            'it has xacro macros: run xacro FILE > robot.urdf, and import that'
        )
    if version_of(root, '1.0') < _QUATERNIONS:
        for origin in root.iter('origin'):
            if origin.get('quat_xyzw') is not None:
                raise ConfigurationError('quat_xyzw needs <robot version="1.1">')
    links = {link.get('name', ''): _read(_inertial, link) for link in root.findall('link')}
    joints = [_read(_joint, joint) for joint in root.findall('joint')]
    _require_ends(links, joints)
    poses = _zero_poses(links, joints)
    closing = [
        _read(lambda joint: _gazebo_joint(joint, poses), element)
        for element in root.findall('gazebo/joint')
    ]
    return RobotModel(links, [*joints, *closing])


def _require_ends(links: Collection[str], joints: Sequence[Joint]) -> None:
    """Requires known links of joints, and one parent joint of a link.

    Raises:
        ConfigurationError: A link is missing, or has two parent joints.
    """
    parent_joints = Counter(joint.child for joint in joints)
    for joint in joints:
        for link in (joint.parent, joint.child):
            if link not in links:
                raise ConfigurationError(
                    f'joint {shown(joint.name)} names link {shown(link)}, which is missing'
                )
        if parent_joints[joint.child] > 1:
            raise ConfigurationError(
                f'link {shown(joint.child)} has two parent joints, but a URDF is a tree: leave '
                'one out, and name two links that coincide with --close'
            )


def _read(read: Callable[[ET.Element], _T], element: ET.Element) -> _T:
    """Reads a link or joint.

    Raises:
        ConfigurationError: A value is invalid; the message names the link or joint.
    """
    try:
        return read(element)
    except ConfigurationError as error:
        name = shown(element.get('name', ''))
        raise ConfigurationError(f'{element.tag} {name}: {error}') from error


def _zero_poses(links: Collection[str], joints: Iterable[Joint]) -> dict[str, Transform]:
    """Returns the pose of each link in the root with all joints at 0.

    Raises:
        ConfigurationError: The links have several roots, or joints form a circle.
    """
    below: dict[str, list[Joint]] = {link: [] for link in links}
    for joint in joints:
        below[joint.parent].append(joint)
    children = {joint.child for joint in joints}
    roots = [link for link in links if link not in children]
    if len(roots) > 1:
        raise ConfigurationError(
            f'links {shown(roots[0])} and {shown(roots[1])} have no parent joint, but a URDF is '
            'one tree: connect them by a joint'
        )
    poses, waiting = dict.fromkeys(roots, IDENTITY), roots
    while waiting:
        link = waiting.pop()
        for joint in below[link]:
            poses[joint.child] = poses[link].then(joint.in_parent)
            waiting.append(joint.child)
    if circle := [link for link in links if link not in poses]:
        raise ConfigurationError(
            f'the joints above link {shown(circle[0])} form a circle, but a URDF is a tree: leave '
            'one out, and name two links that coincide with --close'
        )
    return poses


def _gazebo_joint(element: ET.Element, poses: Mapping[str, Transform]) -> Joint:
    """Reads a joint in <gazebo>, which Gazebo adds to the tree; its format is that of SDF.

    Raises:
        ConfigurationError: A link is missing, or a value is invalid.
    """
    pose, child = element.find('pose'), element.findtext('child', '').strip()
    base = (pose.get('relative_to') if pose is not None else '') or child
    if base not in poses:
        raise ConfigurationError(f'it is at link {shown(base)}, which is missing')
    return read_joint(element, poses[base].then(read_pose(element)), poses, poses.__getitem__)


def _part(element: ET.Element, tag: str) -> ET.Element | None:
    """Returns the only child of a name, all of whose attributes are known."""
    return child_of(element, tag, _ATTRIBUTES[tag])


def _pose(element: ET.Element) -> Transform:
    origin = _part(element, 'origin')
    place, rpy = (numbers(origin, name, 3, '0 0 0') for name in ('xyz', 'rpy'))
    if origin is None or origin.get('quat_xyzw') is None:
        return Transform(from_rpy(*rpy), place)
    if origin.get('rpy') is not None:
        raise ConfigurationError('<origin> has rpy and quat_xyzw: give one of them')
    return Transform(quaternion_of(numbers(origin, 'quat_xyzw', 4)), place)


def _inertial(link: ET.Element) -> Inertial | None:
    """Reads the mass of a link; None if it has none.

    Raises:
        ConfigurationError: A part is missing, or a value or an attribute is invalid.
    """
    element = child_of(link, 'inertial')
    if element is None:
        return None
    pose, parts = _pose(element), {tag: _part(element, tag) for tag in ('mass', 'inertia')}
    for tag, part in parts.items():
        if part is None:
            raise ConfigurationError(f'<inertial> has no <{tag}>')
    if unknown := unknown_in(element, ('origin', 'mass', 'inertia')):
        raise ConfigurationError(f'{listed(unknown)} of <inertial> is not read: leave it out')
    (mass,) = numbers(parts['mass'], 'value', 1)
    # The moments must be given; the products are 0 by default.
    defaults = {name: '' if name in MOMENTS else '0' for name in INERTIA}
    six = (numbers(parts['inertia'], name, 1, default)[0] for name, default in defaults.items())
    inertia = symmetric(*six)
    return Inertial(float(mass), pose.place, pose.rotation @ inertia @ pose.rotation.T)


def _joint(element: ET.Element) -> Joint:
    """Reads a joint.

    Raises:
        ConfigurationError: It has no name, or a value or an attribute is invalid.
    """
    name, kind = element.get('name', ''), element.get('type', '')
    parent, child = _end(element, 'parent'), _end(element, 'child')
    if not name:
        raise ConfigurationError(
            f'the joint from link {shown(parent)} to {shown(child)} has no name: give it one'
        )
    _part(element, 'limit')  # its attributes must be known; it is not read
    joint = Joint(name, KINDS.get(kind, kind), parent, child, _pose(element))
    dynamics = _part(element, 'dynamics')
    forces = {word: numbers(dynamics, word, 1, '0')[0] for word in ('damping', 'friction')}
    left_out = [f'{word} = {value:g}' for word, value in forces.items() if value]
    left_out += unknown_in(element, _IN_JOINT)
    joint = joint._replace(left_out=', '.join(left_out))
    if joint.kind in {REVOLUTE, PRISMATIC}:  # others may have an axis of length 0
        axis = unit(numbers(_part(element, 'axis'), 'xyz', 3, '1 0 0'), '<axis>')
        joint = joint._replace(axis=axis)
    if (mimic := _part(element, 'mimic')) is not None:
        (multiplier,) = numbers(mimic, 'multiplier', 1, '1')
        (offset,) = numbers(mimic, 'offset', 1, '0')
        joint = joint._replace(mimics=(mimic.get('joint', ''), float(multiplier), float(offset)))
    return joint


def _end(joint: ET.Element, tag: str) -> str:
    """Returns the link of <parent> or <child>; empty if it is missing."""
    element = _part(joint, tag)
    return '' if element is None else element.get('link', '')
