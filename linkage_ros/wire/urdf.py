# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The URDF of a mechanism's open tree, made from its description alone."""

from __future__ import annotations

import math
from collections.abc import Iterable
from xml.etree import ElementTree as ET

from linkage_ros.model.parts import Body, Piston, Slider
from linkage_ros.model.structure import Link, Mechanism
from linkage_ros.palette import Color, color_of, fractions
from linkage_ros.wire.codecs import ROOT_FRAME

# URDF demands limits of force and speed for a prismatic joint; the model has none.
_NO_LIMIT = '1e9'
# Simulators refuse a moving link without mass or inertia. Such a link gets this part of the mass
# of the whole linkage.
_SMALL = 1e-6
# kg or kg m^2, above which MuJoCo takes also the half of an inertia, which is ixx.
_LEAST = 1e-14


def make_urdf(mechanism: Mechanism, joint_prefix: str = '', frame_id: str = ROOT_FRAME) -> str:
    """Writes the URDF: a link and a joint for each joint of the open tree.

    The loop is open where `Link` says; joint states close it. Each link's x axis points from its
    first to its second pin, a slider's along its guide. Bars are drawn as boxes of a twentieth of
    the shortest link, one above the other so that they do not cut through each other.

    A mass or an inertia of 0 becomes a small one, and a comment in the text says so.

    Args:
        mechanism: The mechanism.
        joint_prefix: Prepended to all joint and link names but frame_id.
        frame_id: Name of the root link, which carries the fixed pivots.

    Returns:
        XML text.
    """
    robot = ET.Element('robot', name='linkage')
    ET.SubElement(robot, 'link', name=frame_id)
    joints = mechanism.structure().links
    names = joint_names(joints, joint_prefix)
    bodies: list[Body | Piston | Slider] = [getattr(mechanism, joint.name) for joint in joints]
    lengths = [body.length for body in bodies if isinstance(body, Body)]
    width = min(lengths) / 20
    least_mass = max(_SMALL * (math.fsum(body.mass for body in bodies) or 1.0), _LEAST)
    for layer, (joint, name, body) in enumerate(zip(joints, names, bodies, strict=True)):
        link = _add_link(robot, name, body, width, layer, color_of(joint.name))
        _add_inertial(link, body, width, least_mass)
        parent = frame_id if joint.parent is None else link_of(names[joint.parent])
        _add_joint(robot, joint, name, parent)
        if joint.slides:
            reach = repr(math.fsum(lengths))  # the loop closes nowhere beyond
            limit = {'effort': _NO_LIMIT, 'velocity': _NO_LIMIT}
            ET.SubElement(robot[-1], 'limit', {'lower': f'-{reach}', 'upper': reach, **limit})
    ET.indent(robot)
    return ET.tostring(robot, encoding='unicode', xml_declaration=True) + '\n'


def joint_names(joints: Iterable[Link], joint_prefix: str) -> tuple[str, ...]:
    """The names of joints in the URDF and in messages."""
    return tuple(f'{joint_prefix}{joint.name}' for joint in joints)


def link_of(joint: str) -> str:
    """The name of a joint's child link: not its own, because many URDF readers refuse that."""
    return f'{joint}_link'


def _add_joint(robot: ET.Element, joint: Link, name: str, parent: str) -> None:
    kind, axis = ('prismatic', '1 0 0') if joint.slides else ('continuous', '0 0 1')
    element = ET.SubElement(robot, 'joint', name=name, type=kind)
    ET.SubElement(element, 'parent', link=parent)
    ET.SubElement(element, 'child', link=link_of(name))
    _add_origin(element, joint.origin.real, joint.origin.imag, yaw=joint.angle)
    ET.SubElement(element, 'axis', xyz=axis)


def _add_link(
    robot: ET.Element, joint: str, body: Body | Piston | Slider, width: float, layer: int,
    color: Color,
) -> ET.Element:  # fmt: skip
    link = ET.SubElement(robot, 'link', name=link_of(joint))
    visual = ET.SubElement(link, 'visual')
    if isinstance(body, Body):
        length, height = body.length, width
        _add_origin(visual, length / 2, 0.0, layer * width)
    else:
        length, height = _block(width)
        _add_origin(visual, 0.0, 0.0, layer * width)
    box = ET.SubElement(ET.SubElement(visual, 'geometry'), 'box')
    box.set('size', f'{length!r} {height!r} {width!r}')
    rgb = ' '.join(f'{part:.3f}' for part in fractions(color))
    ET.SubElement(ET.SubElement(visual, 'material', name=joint), 'color', rgba=f'{rgb} 1')
    return link


def _block(width: float) -> tuple[float, float]:
    """Length and height of a slider, m, for bars of some width."""
    return 6 * width, 4 * width


def _add_inertial(
    link: ET.Element, body: Body | Piston | Slider, width: float, least_mass: float
) -> None:
    mass = body.mass or least_mass
    zeros = [] if body.mass else ['mass']
    if isinstance(body, Body):
        center, inertia = body.center, body.inertia
        if not inertia:
            zeros.append('inertia')
            inertia = max(least_mass * body.length**2 / 12, _LEAST)
    else:  # it does not turn, so its inertia, here of a box, changes no motion
        center = 0.0, 0.0
        inertia = max(mass * math.hypot(*_block(width)) ** 2 / 12, _LEAST)
    if zeros:
        words = f'{" and ".join(zeros)} 0 in the parameters; simulators refuse 0, so small here'
        link.append(ET.Comment(f' {words} '))
    inertial = ET.SubElement(link, 'inertial')
    _add_origin(inertial, *center)
    ET.SubElement(inertial, 'mass', value=repr(mass))
    # A planar description knows izz alone; a flat body has ixx + iyy = izz.
    half = repr(inertia / 2)
    terms = {'ixx': half, 'iyy': half, 'izz': repr(inertia)}
    ET.SubElement(inertial, 'inertia', {**terms, 'ixy': '0', 'ixz': '0', 'iyz': '0'})


def _add_origin(
    element: ET.Element, x: float, y: float, z: float = 0.0, *, yaw: float = 0.0
) -> None:
    ET.SubElement(element, 'origin', xyz=f'{x!r} {y!r} {z!r}', rpy=f'0 0 {yaw!r}')
