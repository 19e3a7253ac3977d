# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""MJCF of a mechanism for MuJoCo, with its loop closed.

Masses, shapes and colours are those of the URDF.
"""

import cmath
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any, cast
from xml.etree import ElementTree as ET

import numpy as np

from linkage_ros import ConfigurationError, Force, LinkLoad, Mechanism, Pins, Solver, Spring, State
from linkage_ros.extensions import Link, Point, Structure
from linkage_ros.internals import FRAME, axes_of, make_urdf, rigid_links, spin_of
from linkage_ros.quantities import changed, flatten

# MuJoCo raises the time constant of a constraint, the first number of solref, to at least twice
# the timestep, so this makes the loop as stiff as the timestep allows.
_SOLREF, _SOLIMP = (1e-6, 1.0), (0.9999, 0.9999, 0.001)
_TIMESTEP = 2e-4  # s
# For changes of the driving torque: places on an arc; the part of it left out at each end, where
# rates are infinite; and the largest change without a note, relative to the peak.
_PLACES, _MARGIN, _NEGLIGIBLE = 361, 0.01, 1e-9
_ABOUT = """
  Written by linkage_lab. Joint positions are those of joint_states. The control "{name}" is the
  {effort}: effort[{name}] of joint_states. The keyframe
  "start" is the state at t = 0.
"""


def about_zeros(mechanism: Mechanism, start: State) -> list[str]:
    """Returns a note on small masses and inertias in place of 0, which MuJoCo refuses.

    Smaller ones would alter the torque less, but make the constraint of the loop softer.

    Args:
        mechanism: Mechanism to export.
        start: State of the mechanism at t = 0.

    Returns:
        The note, with the links, and the change of the driving torque without `loads`. It is that
        at the speed u of the start, or 1 rad/s or 1 m/s at rest, with an acceleration of u^2.
        Empty if the change is negligible.
    """
    unloaded = replace(cast('Any', mechanism), loads=())
    small, links = _small_values(unloaded)
    if not small:
        return []
    note = f'{", ".join(links)}: MuJoCo refuses a mass or inertia of 0, so it is small here'
    if mechanism.reach() is None:
        return [note]
    driven, units = mechanism.structure().driven, mechanism.structure().driven_link.units
    speed, reach = float(start.velocity[driven]) or 1.0, Solver(mechanism).reach
    low, high = reach.arc_around(float(start.position[driven]))
    margin = 0.0 if reach.turns_fully else _MARGIN * (high - low)
    places = np.linspace(low + margin, high - margin, _PLACES)
    exact, changed_torque = (
        Solver(one).state(places, speed, speed**2).torque
        for one in (unloaded, changed(unloaded, small))
    )
    change, peak = float(np.abs(changed_torque - exact).max()), float(np.abs(exact).max())
    if change <= _NEGLIGIBLE * peak:
        return []
    size = f'{change:.2g} {units.effort} of {peak:.3g} {units.effort}'
    return [f'{note}; this changes the drive by up to {size} at {speed:.4g} {units.velocity}']


def _small_values(mechanism: Any) -> tuple[dict[str, object], list[str]]:
    """Returns the masses and inertias that replace 0, by parameter name, and their links."""
    link_of = {group: link for link, group in mechanism.part_groups().items()}
    # The joint of a link has its name.
    body_of = {body.joint.name: body for body in rigid_links(mechanism)}
    without_rotation = {link.name for link in mechanism.structure().links if link.is_guided}
    small, links = dict[str, object](), list[str]()
    for name, value in flatten(mechanism).items():
        group, _, word = name.rpartition('.')
        link = link_of.get(group, '')
        must_be_positive = word == 'mass' or (word == 'inertia' and link not in without_rotation)
        if must_be_positive and value == 0.0:
            small[name] = getattr(body_of[link], word)
            links.append(link)
    return small, list(dict.fromkeys(links))


def make_mjcf(mechanism: Mechanism, start: State, joint_prefix: str = '') -> str:
    """Generates the MJCF: the tree of the URDF, closed by connect constraints between sites.

    The model includes masses, gravity and loads, a motor on the driven joint, sensors for the
    values of joint_states, and a keyframe of the start. The reference position of each joint is
    its position at the start, so that the model starts in the correct assembly even without the
    keyframe.

    Args:
        mechanism: Mechanism to export.
        start: State of the mechanism at t = 0.
        joint_prefix: Prefix of all joint and body names.

    Returns:
        The MJCF as XML text.

    Raises:
        ConfigurationError: A load has no equivalent in MJCF.
    """
    structure = mechanism.structure()
    links, names = structure.links, [f'{joint_prefix}{link.name}' for link in structure.links]
    position, velocity = _joint_values(links, start)
    driven = names[structure.driven]
    world, link_bodies = _tree(mechanism, joint_prefix, names, position)
    bodies = [*link_bodies, world]  # with the index FRAME, the last one, the world
    pairs = _pairs(mechanism, names, bodies)
    passive, motors = _Passive(structure, names, bodies), list[ET.Element]()
    for load in mechanism.loads:
        # Two actuators must not have one name.
        one = replace(cast('Any', load), name=f'{driven}_load') if load.name == driven else load
        acting = one.on(mechanism)
        if not passive.add(one) and (acting or one.in_joints(mechanism)):
            motors.append(_load(one, acting, links, names, position))
    loads = [*passive.forces, *motors]
    sensors = _sensors(mechanism, names, bodies, joint_prefix)
    in_order = [names.index(str(joint.get('name'))) for joint in world.iter('joint')]  # of MuJoCo
    root = _element(
        'mujoco',
        ET.Comment(_ABOUT.format(name=driven, effort=_effort_words(structure.driven_link))),
        _element('compiler', angle='radian'),
        _element(
            'option', timestep=repr(_TIMESTEP), integrator='RK4',
            gravity=_text(*mechanism.gravity, 0.0),
        ),
        world,
        *([_element('tendon', *passive.tendons)] if passive.tendons else []),
        _element('equality', *(
            _element(
                'connect', site1=one, site2=other, solref=_text(*_SOLREF), solimp=_text(*_SOLIMP)
            )
            for one, other in pairs
        )),
        _element('actuator', _element('motor', name=driven, joint=driven), *loads),
        _element('sensor', *sensors),
        _element('keyframe', _element(
            'key', name='start', qpos=_text(*(position[i] for i in in_order)),
            qvel=_text(*(velocity[i] for i in in_order)),
            ctrl=_text(float(start.torque), *[0.0] * len(loads)),
        )),
        model='linkage',
    )  # fmt: skip
    ET.indent(root)
    return ET.tostring(root, encoding='unicode') + '\n'


def _tree(
    mechanism: Mechanism, joint_prefix: str, names: list[str], position: list[float]
) -> tuple[ET.Element, list[ET.Element]]:
    """Returns the world with the tree of bodies, and the body of each link."""
    world, bodies = _element('worldbody'), list[ET.Element]()
    links, shapes = mechanism.structure().links, _shapes(mechanism, joint_prefix)
    for name, link, shape, at in zip(names, links, shapes, position, strict=True):
        body = _body(name, link, shape, at)
        carrier = world if link.parent is None else bodies[link.parent]
        carrier.append(body)
        bodies.append(body)
    return world, bodies


def _sensors(
    mechanism: Mechanism, names: list[str], bodies: list[ET.Element], joint_prefix: str
) -> list[ET.Element]:
    """Returns sensors for the values of joint_states, and adds the sites of traced points.

    Args:
        mechanism: The mechanism.
        names: Names of its joints.
        bodies: Bodies of the links, then the world.
        joint_prefix: Prefix of all names.
    """
    structure = mechanism.structure()
    driven = names[structure.driven]
    sensors = [
        *(_element('jointpos', name=f'{name}_position', joint=name) for name in names),
        *(_element('jointvel', name=f'{name}_velocity', joint=name) for name in names),
        _element('actuatorfrc', name=f'{driven}_effort', actuator=driven),
    ]
    for point in mechanism.points:
        name, carrier = f'{joint_prefix}{point.name}', structure.link_index(point.link, point.name)
        bodies[carrier].append(_site(name, complex(*(point.at or (0.0, 0.0)))))
        sensors.append(_element('framepos', name=name, objtype='site', objname=name))
    return sensors


def _joint_values(links: Sequence[Link], start: State) -> tuple[list[float], list[float]]:
    """Returns positions and rates of the joints, each relative to the link that carries it."""
    position, velocity = (list(map(float, row)) for row in start[:2])
    for i, link in reversed([*enumerate(links)]):  # a carrier is converted after what it carries
        if link.parent is None or link.slides:  # its values are relative already
            continue
        # The parent's axes turn with the link `turning`, or not at all, at a constant angle to it.
        turning, angle = axes_of(links, link.parent)
        direction = angle or 0.0
        if turning is not None:
            direction += position[turning]
            velocity[i] -= velocity[turning]
        position[i] = math.remainder(position[i] - direction, math.tau)
    return position, velocity


def _shapes(mechanism: Mechanism, joint_prefix: str) -> list[ET.Element]:
    """Returns the element <link> of each moving link in the URDF."""
    parser = ET.XMLParser(target=ET.TreeBuilder(insert_comments=True))  # noqa: S314
    robot = ET.fromstring(make_urdf(mechanism, joint_prefix).encode(), parser)  # noqa: S314
    _, *moving = robot.findall('link')
    return moving


def _effort_words(driven: Link) -> str:
    if not driven.slides:
        return 'torque on the crank, N m, counter-clockwise'
    return {
        'cylinder': 'force that lengthens the cylinder, N',
        'slider': 'force on the slider, N, along its guide',
    }[driven.driven_word]


def _pairs(
    mechanism: Mechanism, names: list[str], bodies: list[ET.Element]
) -> list[tuple[str, str]]:
    """Adds two sites for each loop that constraints hold together; returns their names.

    Args:
        mechanism: The mechanism.
        names: Names of its joints.
        bodies: Bodies of the links, then, as the last one has the index FRAME, the world.
    """
    structure = mechanism.structure()
    of_loop, *of_dyads = structure.closures
    pairs = [_close(*of_loop, names, bodies)]
    for dyad, closure in zip(mechanism.dyads, of_dyads, strict=True):
        if dyad.rod is None:
            pairs.append(_close(*closure, names, bodies))
            continue
        # The pin of the rod is on the link that carries the dyad's first end.
        (end, _), (_, rod) = structure.ends(dyad), closure
        pin, rod_end = f'{names[rod]}_pin', f'{names[rod]}_end'
        carrier = FRAME if end.carrier is None else end.carrier
        bodies[carrier].append(_site(pin, end.at))
        bodies[rod].append(_site(rod_end, 0j))
        pairs.append((pin, rod_end))
    return pairs


def _close(
    closure: Point, last: int, names: list[str], bodies: list[ET.Element]
) -> tuple[str, str]:
    """Adds two sites that a constraint holds together; returns their names.

    The closure runs along the link before the last one that it contains, and back along the last,
    which explains the sign of its weight.
    """
    first = max(j for j, weight in enumerate(closure.weights) if weight and j != last)
    ends = f'{names[first]}_end', f'{names[last]}_end'
    bodies[first].append(_site(ends[0], closure.weights[first]))
    bodies[last].append(_site(ends[1], -closure.weights[last]))
    return ends


def _body(name: str, link: Link, shape: Any, at: float) -> ET.Element:
    """Returns the body of a link, described in the URDF, whose joint is at `at`, rad or m."""
    if link.slides:
        kind, axis = 'slide', '1 0 0'
        place, angle = link.origin + cmath.rect(at, link.angle), link.angle
    else:
        kind, axis = 'hinge', '0 0 1'
        place, angle = link.origin, link.angle + at
    visual, inertial = shape.find('visual'), shape.find('inertial')
    box = map(float, visual.find('geometry/box').get('size').split())
    return _element(
        'body',
        _element('joint', name=name, type=kind, axis=axis, ref=repr(at)),
        *(child for child in shape if child.tag is ET.Comment),
        _element(
            'inertial', pos=inertial.find('origin').get('xyz'),
            mass=inertial.find('mass').get('value'),
            diaginertia=' '.join(inertial.find('inertia').get(x) for x in ('ixx', 'iyy', 'izz')),
        ),
        _element(
            'geom', type='box', size=_text(*(size / 2 for size in box)),
            pos=visual.find('origin').get('xyz'), rgba=visual.find('material/color').get('rgba'),
            contype='0', conaffinity='0',
        ),
        name=shape.get('name'), pos=_text(place.real, place.imag, 0.0),
        euler=_text(0.0, 0.0, angle),
    )  # fmt: skip


def _site(name: str, place: complex) -> ET.Element:
    x, y = place.real + 0.0, place.imag + 0.0  # no -0.0
    return _element('site', name=name, pos=_text(x, y, 0.0))


class _Passive:
    """Forces at points, springs and viscous pins, which need no control input.

    Attributes:
        forces: Actuators of the forces.
        tendons: Tendons of the springs and pins.
    """

    def __init__(self, structure: Structure, names: list[str], bodies: list[ET.Element]) -> None:
        """Stores the bodies, to which it adds sites: those of the links, then the world."""
        self._structure, self._names, self._bodies = structure, names, bodies
        self.forces: list[ET.Element] = []
        self.tendons: list[ET.Element] = []

    def add(self, load: Any) -> bool:
        """Adds a load that needs no control input; returns False for any other load."""
        kinds: dict[type, Callable[[Any], None]] = {
            Force: self._add_force, Spring: self._add_spring, Pins: self._add_pins,
        }  # fmt: skip
        if type(load) not in kinds:
            return False
        kinds[type(load)](load)
        return True

    def _add_site(self, name: str, link: int, point: Point) -> str:
        """Adds a site for a point of a link; returns its name.

        It is on the frame if the point does not move. The pin at which a loop is closed may be a
        point of another link in the tree; then the site is on that link.
        """
        bodies = (FRAME, link, *range(len(self._names)))
        places = ((body, self._structure.place_on(body, point)) for body in bodies)
        body, place = next((body, place) for body, place in places if place is not None)
        self._bodies[body].append(_site(name, place))
        return name

    def _add_force(self, one: Force) -> None:
        place = self._structure.place_of(one.label, one.link, one.at, one.pin)
        site, world = self._add_site(one.name, *place), f'{one.name}_axes'
        axes = {}
        if one.axes == 'world':
            origin = FRAME, self._structure.point_of(FRAME, (0.0, 0.0))
            axes = {'refsite': self._add_site(world, *origin)}
        gear = _text(*one.force, 0.0, 0.0, 0.0, 0.0)
        self.forces.append(_element(
            'general', name=one.name, site=site, **axes, gear=gear, gainprm='0',
            biastype='affine', biasprm='1',
        ))  # fmt: skip

    def _add_spring(self, one: Spring) -> None:
        ends = one.ends(self._structure)
        sites = [self._add_site(f'{one.name}_{i}', *end) for i, end in enumerate(ends, 1)]
        self.tendons.append(_element(
            'spatial', *(_element('site', site=site) for site in sites), name=one.name,
            stiffness=repr(one.stiffness), damping=repr(one.damping),
            springlength=repr(one.free_length),
        ))  # fmt: skip

    def _add_pins(self, one: Pins) -> None:
        """Adds a tendon for each viscous pin; its length is the relative angle of the links."""
        for pin in self._structure.pins:
            if one.pin not in {'', pin.name}:
                continue
            coefficients = dict.fromkeys(self._names, 0)
            for joint in self._joints_of(pin.second):
                coefficients[joint] += 1
            for joint in self._joints_of(pin.first):
                coefficients[joint] -= 1
            joints = [
                _element('joint', joint=joint, coef=str(coefficient))
                for joint, coefficient in coefficients.items()
                if coefficient
            ]
            self.tendons.append(_element(
                'fixed', *joints, name=f'{one.name}_{pin.name}', damping=repr(one.damping)
            ))  # fmt: skip

    def _joints_of(self, link: int | None) -> Iterator[str]:
        """Yields the joints whose rates add up to that of a link; none for the frame."""
        links = self._structure.links
        while link is not None:
            turning = spin_of(links, link)
            if turning is None:
                return
            yield self._names[turning]
            link = links[turning].parent


def _load(
    one: Any, load: Any, links: tuple[Link, ...], names: list[str], position: list[float]
) -> ET.Element:
    """Returns the actuator of a load, given its parameters and its form on the mechanism.

    A `LinkLoad` becomes an actuator without control input that exerts force - stiffness x stretch
    - damping x rate. Another load, such as a load curve, becomes a motor whose control input the
    user must set to the value of the load, because MJCF has no tables.

    Raises:
        ConfigurationError: The load acts in joints, on several links, or on a turning link with a
            moving parent, on which the actuator would also act.
    """
    link: int | None = getattr(load, 'link', None)
    if link is None or (links[link].parent is not None and not links[link].slides):
        raise ConfigurationError(
            f'MJCF does not support {type(one).__name__}: only load curves, forces, damping, '
            'stiffness and gas of a link on the frame, forces at points, springs and viscous '
            'pins; leave it out'
        )
    if not isinstance(one, LinkLoad):
        return _element('motor', name=one.name, joint=names[link])
    force, stiffness = float(load.force), float(load.stiffness)
    if stiffness:  # MuJoCo positions are relative to the start, without a jump from pi to -pi
        jump = 0.0 if load.middle is None else position[link] - float(load.middle)
        force += stiffness * (float(load.rest) + math.tau * round(jump / math.tau))
    return _element(
        'general', name=one.name, joint=names[link],
        gainprm='0', biastype='affine', biasprm=_text(force, -stiffness, -float(load.damping)),
    )  # fmt: skip


def _element(tag: str, *children: Any, **attributes: str) -> ET.Element:
    made = ET.Element(tag, attributes)
    made.extend(children)
    return made


def _text(*numbers: float) -> str:
    return ' '.join(map(repr, numbers))
