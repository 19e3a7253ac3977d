# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads a URDF: http://wiki.ros.org/urdf/XML."""

from collections.abc import Callable, Collection, Iterable
from typing import TypeVar
from xml.etree import ElementTree as ET

from linkage_lab.robots.model import (
    INERTIA,
    KINDS,
    PRISMATIC,
    REVOLUTE,
    Inertial,
    Joint,
    Robot,
    Transform,
    from_rpy,
    numbers,
    symmetric,
    unit,
)
from linkage_ros import ConfigurationError
from linkage_ros.quantities import shown

_T = TypeVar('_T')


def read_urdf(root: ET.Element) -> Robot:
    """Reads links and joints; limits, dynamics and visuals are ignored.

    Args:
        root: The element <robot>.

    Returns:
        The robot.

    Raises:
        ConfigurationError: The file has unexpanded macros or invalid values, or is not one tree.
    """
    if any('xacro' in element.tag for element in root.iter()):
        raise ConfigurationError(
            'it has xacro macros: run xacro FILE > robot.urdf, and import that'
        )
    links = {link.get('name', ''): _read(_inertial, link) for link in root.findall('link')}
    joints = [_read(_joint, joint) for joint in root.findall('joint')]
    children = [joint.child for joint in joints]
    for joint in joints:
        for link in (joint.parent, joint.child):
            if link not in links:
                raise ConfigurationError(
                    f'joint {shown(joint.name)} names link {shown(link)}, which is missing'
                )
        if children.count(joint.child) > 1:
            raise ConfigurationError(
                f'link {shown(joint.child)} has two parent joints, but a URDF is a tree: leave '
                'one out, and name two links that coincide with --close'
            )
    _require_one_root(links, joints)
    return Robot(links, joints)


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


def _require_one_root(links: Collection[str], joints: Iterable[Joint]) -> None:
    """Requires that all links descend from one root.

    Raises:
        ConfigurationError: Some do not.
    """
    above = {joint.child: joint.parent for joint in joints}
    roots = [link for link in links if link not in above]
    if len(roots) > 1:
        raise ConfigurationError(
            f'links {shown(roots[0])} and {shown(roots[1])} have no parent joint, but a URDF is '
            'one tree: connect them by a joint'
        )
    for link in links:
        top = link
        for _ in links:
            top = above.get(top, top)
        if top in above:
            raise ConfigurationError(
                f'the joints above link {shown(link)} form a circle, but a URDF is a tree: leave '
                'one out, and name two links that coincide with --close'
            )


def _pose(element: ET.Element) -> Transform:
    origin = element.find('origin')
    place, rpy = (numbers(origin, name, 3, '0 0 0') for name in ('xyz', 'rpy'))
    return Transform(from_rpy(*rpy), place)


def _inertial(link: ET.Element) -> Inertial | None:
    element = link.find('inertial')
    if element is None:
        return None
    pose = _pose(element)
    for tag in ('mass', 'inertia'):
        if element.find(tag) is None:
            raise ConfigurationError(f'<inertial> has no <{tag}>')
    (mass,) = numbers(element.find('mass'), 'value', 1)
    inertia = symmetric(*(numbers(element.find('inertia'), name, 1, '0')[0] for name in INERTIA))
    return Inertial(float(mass), pose.place, pose.rotation @ inertia @ pose.rotation.T)


def _joint(element: ET.Element) -> Joint:
    name, kind = element.get('name', ''), element.get('type', '')
    parent, child = (
        '' if (end := element.find(tag)) is None else end.get('link', '')
        for tag in ('parent', 'child')
    )
    if not name:
        raise ConfigurationError(
            f'the joint from link {shown(parent)} to {shown(child)} has no name: give it one'
        )
    found = Joint(name, KINDS.get(kind, kind), parent, child, _pose(element))
    if found.kind in {REVOLUTE, PRISMATIC}:  # others may have an axis of length 0
        axis = unit(numbers(element.find('axis'), 'xyz', 3, '1 0 0'), '<axis>')
        found = found._replace(axis=axis)
    if (mimic := element.find('mimic')) is not None:
        (multiplier,), (offset,) = (
            numbers(mimic, attribute, 1, default)
            for attribute, default in (('multiplier', '1'), ('offset', '0'))
        )
        found = found._replace(mimics=(mimic.get('joint', ''), float(multiplier), float(offset)))
    return found
