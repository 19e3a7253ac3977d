# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The MJCF of a mechanism, MuJoCo's own format, with the loop closed and the crank driven."""

from __future__ import annotations

import cmath
from collections.abc import Sequence
from typing import NoReturn
from xml.etree import ElementTree as ET

from linkage_ros.dynamics.state import State
from linkage_ros.errors import ConfigurationError
from linkage_ros.model.load_curve import CurveForce
from linkage_ros.model.loads import LinkForce, continuous
from linkage_ros.model.structure import Mechanism, Structure
from linkage_ros.wire.codecs import joint_rows
from linkage_ros.wire.urdf import RigidLink, link_of, rigid_links, text_of

# MuJoCo raises the time constant of a constraint, the first number of solref, to twice the
# timestep: the loop is as stiff as the timestep allows.
_SOLREF, _SOLIMP = (1e-6, 1.0), (0.9999, 0.9999, 0.001)
_TIMESTEP = 2e-4  # s
_ABOUT = """
  Written by linkage_ros. Joint positions are those of joint_states. The control "{crank}" is the
  torque on the crank, N m, counter-clockwise: effort[{crank}] of joint_states. The keyframe
  "start" is the state at t = 0.
"""


def make_mjcf(mechanism: Mechanism, start: State, joint_prefix: str = '') -> str:
    """Writes the MJCF: the tree of the URDF, closed by a connect constraint between two sites.

    It holds masses, gravity and loads, a motor on the crank, sensors of what joint_states has,
    and the start as a keyframe. The reference positions of the joints are those of the start,
    so that the model begins in the right assembly without the keyframe as well.

    Args:
        mechanism: The mechanism.
        start: Its state at t = 0.
        joint_prefix: Prepended to all joint and body names.

    Returns:
        XML text.

    Raises:
        ConfigurationError: A load has no equivalent in MJCF.
    """
    structure, links = mechanism.structure(), rigid_links(mechanism, joint_prefix)
    position, velocity, _, _ = joint_rows(structure.links, start, float(start.position[0]))
    crank = links[0].name
    root = ET.Element('mujoco', model='linkage')
    root.append(ET.Comment(_ABOUT.format(crank=crank)))
    ET.SubElement(root, 'compiler', angle='radian')
    option = ET.SubElement(root, 'option', timestep=repr(_TIMESTEP), integrator='RK4')
    option.set('gravity', text_of(*mechanism.gravity, 0.0))
    bodies = _add_bodies(ET.SubElement(root, 'worldbody'), links, position)
    _add_loop(root, structure, links, bodies)
    actuator = ET.SubElement(root, 'actuator')
    ET.SubElement(actuator, 'motor', name=crank, joint=crank)
    loads = _add_loads(actuator, mechanism, links, position)
    sensor = _add_sensors(root, links)
    if point := structure.points.get('C'):
        name = f'{joint_prefix}coupler_point'
        _add_site(bodies[1], name, point.weights[1])
        ET.SubElement(sensor, 'framepos', name=name, objtype='site', objname=name)
    key = ET.SubElement(ET.SubElement(root, 'keyframe'), 'key', name='start')
    key.set('qpos', text_of(*position))
    key.set('qvel', text_of(*velocity))
    key.set('ctrl', text_of(float(start.torque), *[0.0] * loads))
    ET.indent(root)
    return ET.tostring(root, encoding='unicode') + '\n'


def _add_bodies(
    world: ET.Element, links: Sequence[RigidLink], position: Sequence[float]
) -> list[ET.Element]:
    """Adds a body for each link where it is at the start.

    Returns:
        The bodies.
    """
    bodies: list[ET.Element] = []
    for link, at in zip(links, position, strict=True):
        joint = link.joint
        parent = world if joint.parent is None else bodies[joint.parent]
        body = ET.SubElement(parent, 'body', name=link_of(link.name))
        if joint.slides:
            place, angle = joint.origin + cmath.rect(at, joint.angle), joint.angle
            kind, axis = 'slide', '1 0 0'
        else:
            place, angle = joint.origin, joint.angle + at
            kind, axis = 'hinge', '0 0 1'
        body.set('pos', text_of(place.real, place.imag, 0.0))
        body.set('euler', text_of(0.0, 0.0, angle))
        ET.SubElement(body, 'joint', name=link.name, type=kind, axis=axis, ref=repr(at))
        if link.note:
            body.append(ET.Comment(f' {link.note} '))
        half = link.inertia / 2  # a flat body
        ET.SubElement(
            body, 'inertial',
            pos=text_of(*link.center, 0.0), mass=repr(link.mass),
            diaginertia=text_of(half, half, link.inertia),
        )  # fmt: skip
        ET.SubElement(
            body, 'geom',
            type='box', size=text_of(*(size / 2 for size in link.box)), pos=text_of(*link.place),
            rgba=link.color, contype='0', conaffinity='0',
        )  # fmt: skip
        bodies.append(body)
    return bodies


def _add_site(body: ET.Element, name: str, place: complex) -> None:
    x, y = place.real + 0.0, place.imag + 0.0  # no -0.0
    ET.SubElement(body, 'site', name=name, pos=text_of(x, y, 0.0))


def _add_loop(
    root: ET.Element, structure: Structure, links: Sequence[RigidLink], bodies: list[ET.Element]
) -> None:
    """Closes the loop: the two links that end the tree meet in a pin.

    `Structure.closure` goes along the first of them and back along the second one.
    """
    parents = {link.joint.parent for link in links}
    first, second = (number for number in range(len(links)) if number not in parents)
    weights = structure.closure.weights
    loop = ET.SubElement(ET.SubElement(root, 'equality'), 'connect')
    for site, number, place in (
        ('site1', first, weights[first]),
        ('site2', second, -weights[second]),
    ):
        name = f'{links[number].name}_end'
        _add_site(bodies[number], name, place)
        loop.set(site, name)
    loop.set('solref', text_of(*_SOLREF))
    loop.set('solimp', text_of(*_SOLIMP))


def _add_loads(
    actuator: ET.Element,
    mechanism: Mechanism,
    links: Sequence[RigidLink],
    position: Sequence[float],
) -> int:
    """Adds an actuator for each load.

    One without control: force - stiffness x stretch - damping x rate. MJCF has no tables: a load
    curve is a motor whose control is to be set to the value of the curve.

    Returns:
        The number of loads.

    Raises:
        ConfigurationError: A load is of another kind, or acts on a link that hangs on another.
    """
    loads = mechanism.link_loads()
    for load in (*loads, mechanism.friction):
        if isinstance(load, CurveForce):
            name = _joint_on_frame(load, links)
            ET.SubElement(actuator, 'motor', name=f'{name}_curve', joint=name)
        elif isinstance(load, LinkForce):
            name = _joint_on_frame(load, links)
            terms = _affine(load, position[load.link])
            ET.SubElement(
                actuator, 'general',
                name=f'{name}_load', joint=name, gainprm='0', biastype='affine',
                biasprm=text_of(*terms),
            )  # fmt: skip
        elif load is not None:
            _refuse(load)
    return len(loads)


def _joint_on_frame(load: LinkForce | CurveForce, links: Sequence[RigidLink]) -> str:
    """The name of the joint on which a load acts: of another link it would act on two."""
    if links[load.link].joint.parent is not None:
        _refuse(load)
    return links[load.link].name


def _refuse(load: object) -> NoReturn:
    raise ConfigurationError(
        f'MJCF cannot hold {type(load).__name__}: only load curves, forces, damping and stiffness '
        'of a link on the frame; leave the parameters of friction out'
    )


def _affine(load: LinkForce, start: float) -> tuple[float, float, float]:
    """A force as a constant and its slopes over MuJoCo's position of a joint and over its rate.

    That position counts on from the start, without a jump from pi to -pi.
    """
    force, stiffness = float(load.force), float(load.stiffness)
    if stiffness:
        force += stiffness * (float(load.rest) + start - continuous(start, load.middle))
    return force, -stiffness, -float(load.damping)


def _add_sensors(root: ET.Element, links: Sequence[RigidLink]) -> ET.Element:
    """Adds sensors of what joint_states has.

    Returns:
        Their list.
    """
    sensor = ET.SubElement(root, 'sensor')
    for kind, word in (('jointpos', 'position'), ('jointvel', 'velocity')):
        for link in links:
            ET.SubElement(sensor, kind, name=f'{link.name}_{word}', joint=link.name)
    crank = links[0].name
    ET.SubElement(sensor, 'actuatorfrc', name=f'{crank}_effort', actuator=crank)
    return sensor
