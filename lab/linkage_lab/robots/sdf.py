# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads an SDF model: http://sdformat.org/spec."""

from collections.abc import Callable, Iterator, Mapping
from xml.etree import ElementTree as ET

import numpy as np

from linkage_lab.robots.model import (
    FIXED,
    IDENTITY,
    INERTIA,
    KINDS,
    MOMENTS,
    Inertial,
    Joint,
    RobotModel,
    Transform,
    child_of,
    from_rpy,
    is_true,
    listed,
    numbers,
    quaternion_of,
    symmetric,
    unit,
    unknown_in,
    version_of,
)
from linkage_ros import ConfigurationError
from linkage_ros.formulas import Array
from linkage_ros.quantities import shown

_EXPAND = 'print the file with gz sdf -p, and import that'
# What would change the result: path, attribute or '' for the text, harmless values, and a cure.
_NOT_READ: tuple[tuple[str, str, tuple[str, ...], str], ...] = (
    ('.//model//include', '', (), 'put the contents of the file in its place'),
    ('.//inertial', 'auto', ('', 'false', '0'), 'give mass, pose and inertia as numbers'),
    ('.//inertial/pose', 'relative_to', ('',), 'give the pose in the link'),
    ('.//fluid_added_mass', '', (), 'leave it out, if the link is in air'),
    ('.//model', 'placement_frame', ('',), 'give the pose of the model'),
    ('.//model/pose', 'relative_to', ('', 'world'), 'give the pose in the world'),
    ('.//pose', 'frame', ('',), _EXPAND),
    ('.//use_parent_model_frame', '', ('0', 'false'), _EXPAND),
    ('.//link/gravity', '', ('1', 'true'), 'gravity must act on all links'),
)
_POSE = 'relative_to', 'rotation_format', 'degrees', 'frame'
_IN_INERTIAL = 'mass', 'pose', 'inertia', 'density', 'auto_inertia_params', 'fluid_added_mass'
_IN_JOINT = 'parent', 'child', 'pose', 'axis', 'physics', 'sensor'
_IN_AXIS = 'xyz', 'limit', 'dynamics', 'mimic', 'initial_position', 'use_parent_model_frame'
_OLDEST = 1, 5  # before, axes are those of the model


def read_sdf(root: ET.Element) -> RobotModel:
    """Reads the only model: links, frames as links without mass, and joints.

    Returns:
        The robot, whose root has the world's axes.

    Raises:
        ConfigurationError: There is not exactly one model, or the model has invalid values.
    """
    for path, name, harmless, cure in _NOT_READ:
        for element in root.iterfind(path):
            value = (element.get(name, '') if name else element.text or '').strip()
            if value.lower() not in harmless:
                what = f'{name} of <{element.tag}>' if name else f'<{element.tag}>'
                raise ConfigurationError(f'{what} {shown(value)} is not read: {cure}')
    if version_of(root, '1.5') < _OLDEST:
        raise ConfigurationError(
            f'version {root.get("version")} of SDF is not read: must be at least 1.5'
        )
    models = [*root.iter('model')]
    if len(models) != 1:
        names = listed(model.get('name', '') for model in models) or 'none'
        raise ConfigurationError(f'its models are {names}: must be one, without nested models')
    gravity = root.find('.//world/gravity')
    return _Reader(models[0]).robot(numbers(gravity, '', 3, '0 0 -9.81'))


class _Reader:
    """Resolves the poses of a model, each of which may refer to another frame."""

    def __init__(self, model: ET.Element) -> None:
        self.model = model
        self.parts: dict[str, ET.Element] = {}
        for part in (*model.findall('link'), *model.findall('frame'), *model.findall('joint')):
            name = part.get('name', '')
            if name in self.parts:
                raise ConfigurationError(
                    f'two links, frames or joints are named {shown(name)}: rename one'
                )
            self.parts[name] = part
        self.poses = {'world': IDENTITY}  # by name, as far as they are known

    def robot(self, gravity: Array) -> RobotModel:
        """Returns the robot with a given acceleration of gravity, m/s^2."""
        bodies = {x.get('name', ''): x for x in self.model.findall('link')}
        frames = {x.get('name', ''): x for x in self.model.findall('frame')}
        inertials = {name: _inertial(x) for name, x in bodies.items()}
        links = {'world': None, **inertials, **dict.fromkeys(frames)}
        poses = {name: self.pose(name) for name in links}
        first = self.model.get('canonical_link') or next(iter(bodies), 'world')
        joints = [
            *(self.attached(frame, poses, first) for frame in frames.values()),
            *(self.joint(joint, poses) for joint in self.model.findall('joint')),
        ]
        doubts = {name: text for name, x in bodies.items() if (text := _assumed(x))}
        return RobotModel(links, joints, [], gravity, poses, doubts=doubts)

    def pose(self, name: str) -> Transform:
        """Returns the pose of a link, frame or joint in the world.

        Raises:
            ConfigurationError: The frame is missing or refers to itself.
        """
        unresolved = dict[str, ET.Element]()  # each relative to the next
        base = name
        while base not in self.poses:
            is_model = base in {'__model__', ''}  # its pose is in the world
            part = self.model if is_model else self.parts.get(base)
            if part is None or base in unresolved:
                fault = 'is missing' if part is None else 'refers to itself'
                raise ConfigurationError(f'frame {shown(base)} {fault}')
            unresolved[base] = part
            base = self._base(part)
        pose = self.poses[base]
        for part_name, part in reversed(unresolved.items()):
            pose = self.poses[part_name] = pose.then(read_pose(part))
        return pose

    def _base(self, part: ET.Element) -> str:
        """Returns the name of the frame to which the pose of an element is relative."""
        pose = child_of(part, 'pose')
        if pose is not None and (other := pose.get('relative_to')):
            return other
        if part.tag == 'model':
            return 'world'
        if part.tag == 'joint':
            return part.findtext('child', '').strip()
        return part.get('attached_to', '') if part.tag == 'frame' else ''

    def attached(self, frame: ET.Element, poses: Mapping[str, Transform], first: str) -> Joint:
        """Returns the fixed joint of a frame; without `attached_to`, it is on the first link."""
        name, link = frame.get('name', ''), frame.get('attached_to') or first
        part = self.parts.get(link)
        if part is not None and part.tag == 'joint':
            link = part.findtext('child', '').strip()
        return Joint('', FIXED, link, name, poses[link].inverse().then(poses[name]))

    def joint(self, element: ET.Element, poses: Mapping[str, Transform]) -> Joint:
        return read_joint(element, self.pose(element.get('name', '')), poses, self.pose)


def read_joint(
    element: ET.Element,
    at: Transform,
    poses: Mapping[str, Transform],
    pose_of: Callable[[str], Transform],
) -> Joint:
    """Reads a joint.

    Args:
        element: The element <joint>.
        at: Pose of the joint.
        poses: Pose of each link.
        pose_of: Function that returns the pose of a frame by name.

    Returns:
        The joint, at 0 in these poses.

    Raises:
        ConfigurationError: A link is missing, or a value is invalid.
    """
    name, kind = element.get('name', ''), element.get('type', '')
    parent, child = (element.findtext(tag, '').strip() for tag in ('parent', 'child'))
    for link in (parent, child):
        if link not in poses:
            raise ConfigurationError(
                f'joint {shown(name)} names link {shown(link)}, which is missing'
            )
    in_parent, in_child = (poses[link].inverse().then(at) for link in (parent, child))
    joint = Joint(name, KINDS.get(kind, kind), parent, child, in_parent, in_child)
    if kind not in KINDS:
        return joint
    axis_element = child_of(element, 'axis')
    if axis_element is None:
        axis_element = ET.Element('axis')
    xyz = child_of(axis_element, 'xyz', ('expressed_in',))
    axis = numbers(xyz, '', 3, '0 0 1')
    if xyz is not None and (frame := xyz.get('expressed_in')):
        axis = at.rotation.T @ pose_of(frame).rotation @ axis
    left_out = [
        *_dynamics(axis_element), *unknown_in(element, _IN_JOINT),
        *unknown_in(axis_element, _IN_AXIS),
    ]  # fmt: skip
    if (mimic := child_of(axis_element, 'mimic')) is not None:
        joint = joint._replace(mimics=_mimics(mimic))
    axis = unit(axis, f'the axis of joint {shown(name)}')
    return joint._replace(axis=axis, left_out=', '.join(left_out))


def _dynamics(axis: ET.Element) -> Iterator[str]:
    """Yields the forces of an <axis> that are not 0."""
    for tag in ('damping', 'friction', 'spring_stiffness'):
        part = axis.find(f'dynamics/{tag}')
        if part is not None and (value := numbers(part, '', 1)[0]):
            yield f'{part.tag} = {value:g}'


def _mimics(mimic: ET.Element) -> tuple[str, float, float]:
    """Returns the joint that a joint follows, the ratio, and the value where the other is 0."""
    multiplier, offset, reference = (
        float(numbers(mimic.find(tag), '', 1, default)[0])
        for tag, default in (('multiplier', '1'), ('offset', '0'), ('reference', '0'))
    )
    return mimic.get('joint', ''), multiplier, offset - multiplier * reference


def read_pose(element: ET.Element) -> Transform:
    """Reads the pose of an element in the frame to which it is relative.

    Raises:
        ConfigurationError: A value or an attribute is invalid.
    """
    pose = child_of(element, 'pose', _POSE)
    kind, is_degrees = 'euler_rpy', False
    if pose is not None:
        kind = pose.get('rotation_format', kind)
        is_degrees = is_true(pose.get('degrees', 'false'))
    if kind == 'quat_xyzw' and not is_degrees:
        x, y, z, *q = numbers(pose, '', 7)
        return Transform(quaternion_of(np.array(q)), np.array((x, y, z)))
    if kind != 'euler_rpy':
        raise ConfigurationError(
            f'rotation_format of <pose> {shown(kind)} is not read: must be euler_rpy, or '
            'quat_xyzw without degrees'
        )
    six = numbers(pose, '', 6, '0 0 0 0 0 0')
    rpy = np.radians(six[3:]) if is_degrees else six[3:]
    return Transform(from_rpy(*rpy), six[:3])


def _inertial(link: ET.Element) -> Inertial:
    """Reads the mass; SDF's default is 1 kg with 1 kg m^2 about each axis.

    Raises:
        ConfigurationError: A value is invalid, or is not read.
    """
    element = child_of(link, 'inertial')
    if element is None:
        return Inertial(1.0, np.zeros(3), np.eye(3))
    pose, six = read_pose(element), child_of(element, 'inertia')
    if more := [*unknown_in(element, _IN_INERTIAL), *unknown_in(six, INERTIA)]:
        raise ConfigurationError(f'{listed(more)} of <inertial> is not read: leave it out')
    parts = (
        numbers(None if six is None else child_of(six, name), '', 1, default)
        for name, default in zip(INERTIA, '100101', strict=True)
    )
    inertia = symmetric(*(float(part[0]) for part in parts))
    (mass,) = numbers(child_of(element, 'mass'), '', 1, '1')
    return Inertial(float(mass), pose.place, pose.rotation @ inertia @ pose.rotation.T)


def _assumed(link: ET.Element) -> str:
    """Describes the defaults of SDF that replace missing values of a mass; empty if none is."""
    element = link.find('inertial')
    missing = ['inertial']
    if element is not None:
        missing = [name for name in ('mass', 'inertia') if element.find(name) is None]
        six = element.find('inertia')
        missing += [name for name in MOMENTS if six is not None and six.find(name) is None]
    tags = ' and '.join(f'<{name}>' for name in missing)
    return tags and f'no {tags} in the model; SDF then gives 1 kg and 1 kg m^2'
