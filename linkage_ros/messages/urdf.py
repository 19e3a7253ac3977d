# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Generates the URDF of a mechanism's open tree."""

import math
from collections.abc import Sequence
from typing import Any
from xml.etree import ElementTree as ET

from linkage_ros.errors import ConfigurationError
from linkage_ros.mechanism.base import Mechanism
from linkage_ros.mechanism.rigid_links import RigidLink, rigid_links
from linkage_ros.messages.templates import ROOT_FRAME
from linkage_ros.palette import Color, colors_of, fractions

# URDF requires effort and velocity limits for a prismatic joint, which the model does not have.
_NO_LIMIT = '1e9'
# Parameters of joint_state_topic_hardware_interface if a node simulates the plant.
_PLUGIN = 'joint_state_topic_hardware_interface/JointStateTopicSystem'
_HARDWARE = {
    'joint_commands_topic': '/joint_commands',
    'joint_states_topic': '/plant/joint_states',
    'trigger_joint_command_threshold': '-1',
}


def merged_urdf(descriptions: Sequence[str]) -> str:
    """Merges one or more robot descriptions that have the same root link.

    Raises:
        ConfigurationError: Their root links differ.
    """
    if len(descriptions) == 1:
        return descriptions[0]
    first, *others = map(ET.fromstring, descriptions)  # noqa: S314, made here
    base = first[0].attrib
    for root, *children in others:
        if root.attrib != base:
            raise ConfigurationError('frame_id: must be the same link for all linkages')
        first.extend(children)
    return ET.tostring(first, encoding='unicode')


def link_of(joint: str) -> str:
    """Returns the name of a joint's child link; many tools require it to differ from `joint`."""
    return f'{joint}_link'


def text_of(*numbers: float) -> str:
    """Formats numbers for an XML attribute with all digits, separated by spaces."""
    return ' '.join(map(repr, numbers))


def make_urdf(
    mechanism: Mechanism,
    joint_prefix: str = '',
    frame_id: str = ROOT_FRAME,
    *,
    ros2_control: bool = False,
) -> str:
    """Generates the URDF, with a link and a joint for each joint of the open tree.

    See `Link` for the pin at which the loop is cut; the positions on joint_states close the loop.
    A comment marks each mass or inertia that is 0 in the parameters.

    Args:
        mechanism: Mechanism to export.
        joint_prefix: Prefix of all joint and link names, except frame_id.
        frame_id: Name of the root link, which carries the fixed pivots.
        ros2_control: Whether to add a ros2_control tag, with which a controller drives the crank,
            cylinder or slider of a node.

    Returns:
        The URDF as XML text.
    """
    links, driven = rigid_links(mechanism, joint_prefix), mechanism.structure().driven
    colors = colors_of(link.joint.name for link in links)
    # The loop cannot close beyond these limits of a sliding link.
    (loop, output), *added = mechanism.structure().closures
    limits = {output: math.fsum(map(abs, (*loop.weights, loop.fixed)))}
    for closure, i in added:
        lengths = (*closure.weights, closure.fixed, links[i].joint.origin)
        limits[i] = math.fsum(map(abs, lengths))
    robot = element('robot', element('link', name=frame_id), name='linkage')
    for i, link in enumerate(links):
        parent = frame_id
        if link.joint.parent is not None:
            parent = link_of(links[link.joint.parent].name)
        robot.append(_link(link, colors[link.joint.name]))
        robot.append(_joint(link, parent, repr(limits.get(i))))
    if ros2_control:
        robot.append(_ros2_control(links[driven].name))
    ET.indent(robot)
    return ET.tostring(robot, encoding='unicode', xml_declaration=True) + '\n'


def element(tag: str, *children: Any, text: str | None = None, **rest: str) -> ET.Element:
    """Creates an XML element with children and text; keyword arguments are its attributes."""
    made = ET.Element(tag, rest)
    made.text = text
    made.extend(children)
    return made


def comment(link: RigidLink) -> list[Any]:
    """Returns an XML comment with the note of a link; empty if there is no note."""
    return [ET.Comment(link.note)] if link.note else []


def _rgba(color: Color) -> str:
    """Returns red, green, blue and opacity, each from 0 to 1."""
    return ' '.join(f'{part:.3f}' for part in fractions(color)) + ' 1'


def _link(link: RigidLink, color: Color) -> ET.Element:
    """Returns the element of a link: its box, colour and inertia."""
    # The parameters define only izz; for a flat body, ixx + iyy = izz.
    half = repr(link.inertia / 2)
    return element(
        'link',
        element(
            'visual',
            _origin(*link.place),
            element('geometry', element('box', size=text_of(*link.box))),
            element('material', element('color', rgba=_rgba(color)), name=link.name),
        ),
        *comment(link),
        element(
            'inertial',
            _origin(*link.center),
            element('mass', value=repr(link.mass)),
            element(
                'inertia', ixx=half, iyy=half, izz=repr(link.inertia), ixy='0', ixz='0', iyz='0'
            ),
        ),
        name=link_of(link.name),
    )


def _joint(link: RigidLink, parent: str, reach: str) -> ET.Element:
    """Returns the element of the joint of a link; `reach` limits a sliding one, m."""
    joint, limits = link.joint, list[ET.Element]()
    if joint.slides:
        span = {'lower': f'-{reach}', 'upper': reach}
        limits = [element('limit', **span, effort=_NO_LIMIT, velocity=_NO_LIMIT)]
    return element(
        'joint',
        element('parent', link=parent),
        element('child', link=link_of(link.name)),
        _origin(joint.origin.real, joint.origin.imag, yaw=joint.angle),
        element('axis', xyz='1 0 0' if joint.slides else '0 0 1'),
        *limits,
        name=link.name,
        type='prismatic' if joint.slides else 'continuous',
    )


def _origin(x: float, y: float, z: float = 0.0, *, yaw: float = 0.0) -> ET.Element:
    return element('origin', xyz=text_of(x, y, z), rpy=f'0 0 {yaw!r}')


def _ros2_control(driven: str) -> ET.Element:
    """Returns the tag for the driven joint, because the node ignores commands for others."""
    states = (element('state_interface', name=n) for n in ('position', 'velocity', 'effort'))
    return element(
        'ros2_control',
        element(
            'hardware',
            element('plugin', text=_PLUGIN),
            *(element('param', text=value, name=name) for name, value in _HARDWARE.items()),
        ),
        element('joint', element('command_interface', name='effort'), *states, name=driven),
        name='linkage',
        type='system',
    )
