# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The URDF of a mechanism's open tree, made from its description alone."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple
from xml.etree import ElementTree as ET

from linkage_ros.model.parts import Body, Piston, Slider
from linkage_ros.model.structure import Link, Mechanism
from linkage_ros.palette import color_of, fractions
from linkage_ros.wire.codecs import ROOT_FRAME

# URDF demands limits of force and speed for a prismatic joint; the model has none.
_NO_LIMIT = '1e9'
# Simulators refuse a moving link without mass or inertia. Such a link gets this part of the mass
# of the whole linkage.
_SMALL = 1e-6
# kg or kg m^2, above which MuJoCo takes also the half of an inertia, which is ixx.
_LEAST = 1e-14
# What joint_state_topic_hardware_interface takes, beside a node that is the plant.
_PLUGIN = 'joint_state_topic_hardware_interface/JointStateTopicSystem'
_HARDWARE = {
    'joint_commands_topic': '/joint_commands',
    'joint_states_topic': '/plant/joint_states',
    'trigger_joint_command_threshold': '-1',
}


class RigidLink(NamedTuple):
    """A moving link as simulators take it: with mass and inertia, and a box as its shape.

    Attributes:
        joint: Joint that moves it.
        name: Name of the joint.
        mass: kg, more than 0.
        inertia: About its centre of mass, kg m^2, more than 0.
        center: Centre of mass in the link's axes, m.
        note: Which of the two are 0 in the parameters; empty: neither.
        box: Length, width and height of its shape, m.
        place: Centre of the shape in the link's axes, m.
        color: Red, green, blue and opacity, from 0 to 1.
    """

    joint: Link
    name: str
    mass: float
    inertia: float
    center: tuple[float, float]
    note: str
    box: tuple[float, float, float]
    place: tuple[float, float, float]
    color: str


def rigid_links(mechanism: Mechanism, joint_prefix: str = '') -> list[RigidLink]:
    """The moving links of a mechanism, in the order of its joints.

    Each link's x axis points from its first to its second pin, a slider's along its guide. Bars
    are drawn as boxes of a twentieth of the shortest link, one above the other so that they do
    not cut through each other.

    Args:
        mechanism: The mechanism.
        joint_prefix: Prepended to all joint names.

    Returns:
        The links; a mass or an inertia of 0 has become a small one.
    """
    joints = mechanism.structure().links
    bodies: list[Body | Piston | Slider] = [getattr(mechanism, joint.name) for joint in joints]
    width = min(body.length for body in bodies if isinstance(body, Body)) / 20
    least_mass = max(_SMALL * (math.fsum(body.mass for body in bodies) or 1.0), _LEAST)
    names = joint_names(joints, joint_prefix)
    return [
        _rigid_link(joint, name, body, least_mass, width, layer)
        for layer, (joint, name, body) in enumerate(zip(joints, names, bodies, strict=True))
    ]


def _rigid_link(
    joint: Link, name: str, body: Body | Piston | Slider, least_mass: float, width: float,
    layer: int,
) -> RigidLink:  # fmt: skip
    mass = body.mass or least_mass
    zeros = [] if body.mass else ['mass']
    if isinstance(body, Body):
        center, inertia = body.center, body.inertia
        length, height, middle = body.length, width, body.length / 2
        if not inertia:
            zeros.append('inertia')
            inertia = max(least_mass * length**2 / 12, _LEAST)
    else:  # it does not turn, so its inertia, here of a box, changes no motion
        center, length, height, middle = (0.0, 0.0), 6 * width, 4 * width, 0.0
        inertia = max(mass * math.hypot(length, height) ** 2 / 12, _LEAST)
    note = f'{" and ".join(zeros)} 0 in the parameters; simulators refuse 0, so small here'
    box, place = (length, height, width), (middle, 0.0, layer * width)
    color = ' '.join(f'{part:.3f}' for part in fractions(color_of(joint.name)))
    return RigidLink(
        joint, name, mass, inertia, center, note if zeros else '', box, place, f'{color} 1'
    )


def joint_names(joints: Iterable[Link], joint_prefix: str) -> tuple[str, ...]:
    """The names of joints in the URDF and in messages."""
    return tuple(f'{joint_prefix}{joint.name}' for joint in joints)


def link_of(joint: str) -> str:
    """The name of a joint's child link: not its own, because many URDF readers refuse that."""
    return f'{joint}_link'


def text_of(*numbers: float) -> str:
    """Numbers as XML attributes hold them: every digit, separated by spaces."""
    return ' '.join(map(repr, numbers))


def make_urdf(
    mechanism: Mechanism,
    joint_prefix: str = '',
    frame_id: str = ROOT_FRAME,
    *,
    ros2_control: bool = False,
) -> str:
    """Writes the URDF: a link and a joint for each joint of the open tree.

    The loop is open where `Link` says; joint states close it. A comment marks a mass or an
    inertia that is 0 in the parameters.

    Args:
        mechanism: The mechanism.
        joint_prefix: Prepended to all joint and link names but frame_id.
        frame_id: Name of the root link, which carries the fixed pivots.
        ros2_control: Whether to add the tag by which ros2_control drives the crank of a node.

    Returns:
        XML text.
    """
    robot = ET.Element('robot', name='linkage')
    ET.SubElement(robot, 'link', name=frame_id)
    links = rigid_links(mechanism, joint_prefix)
    # The loop closes nowhere beyond.
    reach = repr(math.fsum(link.box[0] for link in links if not link.joint.slides))
    for link in links:
        _add_link(robot, link)
        above = link.joint.parent
        _add_joint(robot, link, frame_id if above is None else link_of(links[above].name))
        if link.joint.slides:
            limit = {'effort': _NO_LIMIT, 'velocity': _NO_LIMIT}
            ET.SubElement(robot[-1], 'limit', {'lower': f'-{reach}', 'upper': reach, **limit})
    if ros2_control:
        _add_ros2_control(robot, links[0].name)
    ET.indent(robot)
    return ET.tostring(robot, encoding='unicode', xml_declaration=True) + '\n'


def _add_link(robot: ET.Element, link: RigidLink) -> None:
    element = ET.SubElement(robot, 'link', name=link_of(link.name))
    visual = ET.SubElement(element, 'visual')
    _add_origin(visual, *link.place)
    box = ET.SubElement(ET.SubElement(visual, 'geometry'), 'box')
    box.set('size', text_of(*link.box))
    material = ET.SubElement(visual, 'material', name=link.name)
    ET.SubElement(material, 'color', rgba=link.color)
    if link.note:
        element.append(ET.Comment(f' {link.note} '))
    inertial = ET.SubElement(element, 'inertial')
    _add_origin(inertial, *link.center)
    ET.SubElement(inertial, 'mass', value=repr(link.mass))
    # A planar description knows izz alone; a flat body has ixx + iyy = izz.
    half = repr(link.inertia / 2)
    terms = {'ixx': half, 'iyy': half, 'izz': repr(link.inertia)}
    ET.SubElement(inertial, 'inertia', {**terms, 'ixy': '0', 'ixz': '0', 'iyz': '0'})


def _add_joint(robot: ET.Element, link: RigidLink, parent: str) -> None:
    joint = link.joint
    kind, axis = ('prismatic', '1 0 0') if joint.slides else ('continuous', '0 0 1')
    element = ET.SubElement(robot, 'joint', name=link.name, type=kind)
    ET.SubElement(element, 'parent', link=parent)
    ET.SubElement(element, 'child', link=link_of(link.name))
    _add_origin(element, joint.origin.real, joint.origin.imag, yaw=joint.angle)
    ET.SubElement(element, 'axis', xyz=axis)


def _add_origin(
    element: ET.Element, x: float, y: float, z: float = 0.0, *, yaw: float = 0.0
) -> None:
    ET.SubElement(element, 'origin', xyz=text_of(x, y, z), rpy=f'0 0 {yaw!r}')


def _add_ros2_control(robot: ET.Element, crank: str) -> None:
    """The crank alone: commands that name another joint are refused by the node."""
    system = ET.SubElement(robot, 'ros2_control', name='linkage', type='system')
    hardware = ET.SubElement(system, 'hardware')
    ET.SubElement(hardware, 'plugin').text = _PLUGIN
    for name, value in _HARDWARE.items():
        ET.SubElement(hardware, 'param', name=name).text = value
    joint = ET.SubElement(system, 'joint', name=crank)
    ET.SubElement(joint, 'command_interface', name='effort')
    for name in ('position', 'velocity', 'effort'):
        ET.SubElement(joint, 'state_interface', name=name)
