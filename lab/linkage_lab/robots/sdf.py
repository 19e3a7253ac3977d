# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads an SDF model: http://sdformat.org/spec."""

from collections.abc import Mapping
from xml.etree import ElementTree as ET

import numpy as np

from linkage_lab.robots.model import (
    FIXED,
    IDENTITY,
    INERTIA,
    KINDS,
    Inertial,
    Joint,
    Robot,
    Transform,
    from_quaternion,
    from_rpy,
    numbers,
    symmetric,
    unit,
)
from linkage_ros import ConfigurationError
from linkage_ros.formulas import Array
from linkage_ros.quantities import shown


def read_sdf(root: ET.Element) -> Robot:
    """Reads the only model: links, frames as links without mass, and joints.

    Args:
        root: The element <sdf>.

    Returns:
        The robot, whose root has the world's axes.

    Raises:
        ConfigurationError: There is not exactly one model, or the model has invalid values.
    """
    models = [*root.iter('model')]
    if len(models) != 1:
        names = ', '.join(model.get('name', '') for model in models) or 'none'
        raise ConfigurationError(f'its models are {names}: must be one, without nested models')
    gravity = root.find('.//world/gravity')
    return _Reader(models[0]).robot(numbers(gravity, '', 3, '0 0 -9.81'))


class _Reader:
    """Resolves the poses of a model, each of which may refer to another frame."""

    def __init__(self, model: ET.Element) -> None:
        self.model = model
        parts = [*model.findall('link'), *model.findall('frame'), *model.findall('joint')]
        self.parts = {part.get('name', ''): part for part in parts}

    def robot(self, gravity: Array) -> Robot:
        """Returns the robot with a given acceleration of gravity, m/s^2."""
        links = {x.get('name', ''): _inertial(x) for x in self.model.findall('link')}
        frames = self.model.findall('frame')
        everything = {'world': None, **links, **{x.get('name', ''): None for x in frames}}
        poses = {name: self.pose(name) for name in everything}
        first = next(iter(links), 'world')
        joints = [
            *(self.attached(frame, poses, first) for frame in frames),
            *(self.joint(joint, poses) for joint in self.model.findall('joint')),
        ]
        return Robot(everything, joints, [], gravity, poses)

    def pose(self, name: str, seen: tuple[str, ...] = ()) -> Transform:
        """Returns the pose of a link, frame or joint in the world.

        Raises:
            ConfigurationError: The frame is missing or refers to itself.
        """
        if name in {'world', '__model__', ''}:
            # The pose of a model is in the world.
            return IDENTITY if name == 'world' else _pose(self.model)
        part = self.parts.get(name)
        if part is None or name in seen:
            fault = 'is missing' if part is None else 'refers to itself'
            raise ConfigurationError(f'frame {shown(name)} {fault}')
        base = {'joint': part.findtext('child', '').strip(), 'frame': part.get('attached_to', '')}
        pose = part.find('pose')
        other = (pose.get('relative_to') if pose is not None else '') or base.get(part.tag, '')
        return self.pose(other, (*seen, name)).then(_pose(part))

    def attached(self, frame: ET.Element, poses: Mapping[str, Transform], first: str) -> Joint:
        """Returns the fixed joint of a frame; without `attached_to`, it is on the first link."""
        name, link = frame.get('name', ''), frame.get('attached_to') or first
        part = self.parts.get(link)
        if part is not None and part.tag == 'joint':
            link = part.findtext('child', '').strip()
        return Joint('', FIXED, link, name, poses[link].inverse().then(poses[name]))

    def joint(self, element: ET.Element, poses: Mapping[str, Transform]) -> Joint:
        name, kind = element.get('name', ''), element.get('type', '')
        parent, child = (element.findtext(tag, '').strip() for tag in ('parent', 'child'))
        for link in (parent, child):
            if link not in poses:
                raise ConfigurationError(
                    f'joint {shown(name)} names link {shown(link)}, which is missing'
                )
        at, xyz = self.pose(name), element.find('axis/xyz')
        axis = numbers(xyz, '', 3, '0 0 1')
        if xyz is not None and (other := xyz.get('expressed_in')):
            axis = at.rotation.T @ self.pose(other).rotation @ axis
        first, second = (poses[link].inverse().then(at) for link in (parent, child))
        found = Joint(name, KINDS.get(kind, kind), parent, child, first, second)
        return (
            found._replace(axis=unit(axis, f'the axis of joint {shown(name)}'))
            if kind in KINDS
            else found
        )


def _pose(element: ET.Element) -> Transform:
    pose = element.find('pose')
    if pose is not None and pose.get('rotation_format') == 'quat_xyzw':
        x, y, z, *q = numbers(pose, '', 7)
        return Transform(from_quaternion(q[3], *q[:3]), np.array((x, y, z)))
    six = numbers(pose, '', 6, '0 0 0 0 0 0')
    rpy = np.radians(six[3:]) if pose is not None and pose.get('degrees') == 'true' else six[3:]
    return Transform(from_rpy(*rpy), six[:3])


def _inertial(link: ET.Element) -> Inertial:
    """Reads the mass; SDF's default is 1 kg with 1 kg m^2 about each axis."""
    element = link.find('inertial')
    if element is None:
        return Inertial(1.0, np.zeros(3), np.eye(3))
    pose, six = _pose(element), element.find('inertia')
    parts = (
        numbers(None if six is None else six.find(name), '', 1, default)
        for name, default in zip(INERTIA, '100101', strict=True)
    )
    inertia = symmetric(*(float(part[0]) for part in parts))
    (mass,) = numbers(element.find('mass'), '', 1, '1')
    return Inertial(float(mass), pose.place, pose.rotation @ inertia @ pose.rotation.T)
