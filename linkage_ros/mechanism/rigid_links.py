# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Moving links in the form that simulators require, for the URDF."""

import math
from typing import Any, NamedTuple

from linkage_ros.mechanism.base import Mechanism
from linkage_ros.mechanism.structure import Link, mouth

# Simulators reject a moving link without mass or inertia, so such a link is given this fraction
# of the linkage's total mass.
_SMALL = 1e-6
# kg or kg m^2. MuJoCo must also accept half of this value, because ixx is half the inertia.
_LEAST = 1e-14


class RigidLink(NamedTuple):
    """A moving link for simulators, with nonzero mass and inertia and a box as its shape.

    Attributes:
        joint: The link's joint in the open tree.
        name: Name of the joint, including the prefix.
        mass: Mass, kg, above 0.
        inertia: Moment of inertia about the centre of mass, kg m^2, above 0.
        center: Centre of mass in the link's axes, m.
        note: Comment that names which of mass and inertia are 0 in the parameters; empty if
            neither is.
        box: Length, width and height of the box, m.
        place: Centre of the box in the link's axes, m.
    """

    joint: Link
    name: str
    mass: float
    inertia: float
    center: tuple[float, float]
    note: str
    box: tuple[float, float, float]
    place: tuple[float, float, float]


def rigid_links(mechanism: Mechanism, joint_prefix: str = '') -> list[RigidLink]:
    """Returns the moving links of a mechanism, in the order of its joints.

    The x axis of a link points from its first to its second pin; for a sliding link, it points
    along the guide. The width of the bars' boxes is 1/20 of the length of the shortest bar. They
    are stacked along z so that they do not intersect. A dyad's link without a length is a block at
    its pin.

    A small value replaces a mass or inertia of 0. `joint_prefix` begins all names.
    """
    structure = mechanism.structure()
    barrel_mouth, (_, last_of_loop) = mouth(structure).real, structure.closures[0]
    parts = mechanism.parts()
    bodies = [parts[joint.name] for joint in structure.links]
    width = min(body.length for body in bodies if hasattr(body, 'length')) / 20
    least_mass = max(_SMALL * (math.fsum(body.mass for body in bodies) or 1.0), _LEAST)
    links = []
    for layer, (joint, body) in enumerate(zip(structure.links, bodies, strict=True)):
        default_length = barrel_mouth if layer <= last_of_loop else 0.0
        length = getattr(body, 'length', default_length)
        box, center = (length, width, width), 0.5 * length
        if not length:  # a block at its pin
            box, center = (6 * width, 4 * width, width), 0.0
        elif joint.slides:  # a rod is between its pin and the mouth of its barrel
            center = -center
        mass = body.mass or least_mass
        links.append(
            RigidLink(
                joint,
                f'{joint_prefix}{joint.name}',
                mass,
                _inertia(joint, body, mass, least_mass, box),
                center=(0.0, 0.0) if joint.is_guided else body.center,
                note=_note_of_zeros(joint, body),
                box=box,
                place=(center, 0.0, layer * width),
            )
        )
    return links


def _inertia(
    joint: Link, body: Any, mass: float, least_mass: float, box: tuple[float, float, float]
) -> float:
    """Returns the inertia of a link, or a small value in its place, kg m^2."""
    length, height, _ = box
    if joint.is_guided:  # it does not turn, so its inertia does not change the motion
        return max(mass * math.hypot(length, height) ** 2 / 12, _LEAST)
    return body.inertia or max(least_mass * length**2 / 12, _LEAST)


def _note_of_zeros(joint: Link, body: Any) -> str:
    """Returns the comment of a link whose mass or inertia is 0; see `RigidLink`."""
    words = ('mass',) if joint.is_guided else ('mass', 'inertia')
    zeros = [word for word in words if getattr(body, word) == 0]
    if not zeros:
        return ''
    return f' {" and ".join(zeros)} 0 in the parameters; simulators refuse 0, so small here '
