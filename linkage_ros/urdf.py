# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The URDF of a mechanism's open tree, made from its description alone."""

from __future__ import annotations

import math
from xml.etree import ElementTree as ET

from linkage_ros.mechanism import Body, FourBar
from linkage_ros.messages import ROOT_FRAME
from linkage_ros.palette import COLORS


def make_urdf(mechanism: FourBar) -> str:
    """Writes the URDF: links crank, coupler and rocker, joints as in `joints`.

    The loop is open at the pin between coupler and rocker; joint states close it. Each link's x
    axis points from its first to its second pin. Bars are drawn as boxes of a twentieth of the
    shortest link, one above the other so that they do not cut through each other.

    Args:
        mechanism: The linkage.

    Returns:
        XML text.
    """
    robot = ET.Element('robot', name='four_bar')
    ET.SubElement(robot, 'link', name=ROOT_FRAME)
    frame = mechanism.frame
    pivot = (frame.length * math.cos(frame.angle), frame.length * math.sin(frame.angle))
    bars = (
        ('crank', mechanism.crank, ROOT_FRAME, (0.0, 0.0)),
        ('coupler', mechanism.coupler, 'crank', (mechanism.crank.length, 0.0)),
        ('rocker', mechanism.rocker, ROOT_FRAME, pivot),
    )
    width = min(body.length for _, body, _, _ in bars) / 20
    for layer, (name, body, parent, origin) in enumerate(bars):
        _add_link(robot, name, body, width, layer)
        joint = ET.SubElement(robot, 'joint', name=name, type='continuous')
        ET.SubElement(joint, 'parent', link=parent)
        ET.SubElement(joint, 'child', link=name)
        _add_origin(joint, *origin)
        ET.SubElement(joint, 'axis', xyz='0 0 1')
    ET.indent(robot)
    return ET.tostring(robot, encoding='unicode', xml_declaration=True) + '\n'


def _add_link(robot: ET.Element, name: str, body: Body, width: float, layer: int) -> None:
    link = ET.SubElement(robot, 'link', name=name)
    visual = ET.SubElement(link, 'visual')
    _add_origin(visual, body.length / 2, 0.0, layer * width)
    box = ET.SubElement(ET.SubElement(visual, 'geometry'), 'box')
    box.set('size', f'{body.length!r} {width!r} {width!r}')
    color = ' '.join(f'{part / 255:.3f}' for part in COLORS[name])
    ET.SubElement(ET.SubElement(visual, 'material', name=name), 'color', rgba=f'{color} 1')
    if body.mass or body.inertia:
        inertial = ET.SubElement(link, 'inertial')
        _add_origin(inertial, *body.center)
        ET.SubElement(inertial, 'mass', value=repr(body.mass))
        # A planar description knows izz alone; a flat body has ixx + iyy = izz.
        half = repr(body.inertia / 2)
        terms = {'ixx': half, 'iyy': half, 'izz': repr(body.inertia)}
        ET.SubElement(inertial, 'inertia', {**terms, 'ixy': '0', 'ixz': '0', 'iyz': '0'})


def _add_origin(element: ET.Element, x: float, y: float, z: float = 0.0) -> None:
    ET.SubElement(element, 'origin', xyz=f'{x!r} {y!r} {z!r}', rpy='0 0 0')
