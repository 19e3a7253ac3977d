# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_export: writes a mechanism as URDF or as MJCF, MuJoCo's format, for other tools."""

import argparse
import cmath
import sys
from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree as ET

from linkage_ros import cli
from linkage_ros.errors import ConfigurationError
from linkage_ros.files import create_file, is_same_file
from linkage_ros.mechanism.kinematics import State
from linkage_ros.mechanism.loads import LinkForce, continuous
from linkage_ros.mechanism.rigid_links import RigidLink, rigid_links
from linkage_ros.mechanism.structure import Mechanism
from linkage_ros.messages.templates import joint_rows
from linkage_ros.messages.urdf import comment, element, link_of, make_urdf, rgba, text_of
from linkage_ros.run.states import Simulator
from linkage_ros.settings.configuration import Configuration, configure, read_values
from linkage_ros.settings.presets import find_file, preset_names

_NAME = 'linkage_export'
# MuJoCo raises the time constant of a constraint, the first number of solref, to at least twice
# the timestep, so this makes the loop as stiff as the timestep allows.
_SOLREF, _SOLIMP = (1e-6, 1.0), (0.9999, 0.9999, 0.001)
_TIMESTEP = 2e-4  # s
_ABOUT = """
  Written by linkage_ros. Joint positions are those of joint_states. The control "{crank}" is the
  torque on the crank, N m, counter-clockwise: effort[{crank}] of joint_states. The keyframe
  "start" is the state at t = 0.
"""


def make_mjcf(mechanism: Mechanism, start: State, joint_prefix: str = '') -> str:
    """Generates the MJCF: the tree of the URDF, closed by a connect constraint between two sites.

    The model includes masses, gravity and loads, a motor on the crank, sensors for the values of
    joint_states, and a keyframe of the start. The reference position of each joint is its position
    at the start, so that the model starts in the correct assembly even without the keyframe.

    Args:
        mechanism: Mechanism to export.
        start: State of the mechanism at t = 0.
        joint_prefix: Prefix of all joint and body names.

    Returns:
        The MJCF as XML text.

    Raises:
        ConfigurationError: A load has no equivalent in MJCF.
    """
    structure, links = mechanism.structure(), rigid_links(mechanism, joint_prefix)
    position, velocity, _, _ = joint_rows(structure.links, start, float(start.position[0]))
    world, bodies, crank = element('worldbody'), list[ET.Element](), links[0].name
    for link, at in zip(links, position, strict=True):
        bodies.append(_body(link, at))
        above = link.joint.parent
        (world if above is None else bodies[above]).append(bodies[-1])
    # A pin joins the two leaf links of the tree. The closure runs along the first and back along
    # the second, which explains the sign of the second weight.
    parents, weights = {link.joint.parent for link in links}, structure.closure.weights
    first, second = (number for number in range(len(links)) if number not in parents)
    ends = [f'{links[number].name}_end' for number in (first, second)]
    bodies[first].append(_site(ends[0], weights[first]))
    bodies[second].append(_site(ends[1], -weights[second]))
    of_joints = [load for load in mechanism.loads if load.in_joints(mechanism)]
    loads = [_load(load, links, position) for load in (*mechanism.link_loads(), *of_joints)]
    sensors = [
        element(kind, name=f'{link.name}_{word}', joint=link.name)
        for kind, word in (('jointpos', 'position'), ('jointvel', 'velocity'))
        for link in links
    ]
    sensors.append(element('actuatorfrc', name=f'{crank}_effort', actuator=crank))
    if point := structure.points.get('C'):
        name = f'{joint_prefix}coupler_point'
        bodies[1].append(_site(name, point.weights[1]))
        sensors.append(element('framepos', name=name, objtype='site', objname=name))
    root = element(
        'mujoco',
        ET.Comment(_ABOUT.format(crank=crank)),
        element('compiler', angle='radian'),
        element(
            'option', timestep=repr(_TIMESTEP), integrator='RK4',
            gravity=text_of(*mechanism.gravity, 0.0),
        ),
        world,
        element('equality', element(
            'connect', site1=ends[0], site2=ends[1], solref=text_of(*_SOLREF),
            solimp=text_of(*_SOLIMP),
        )),
        element('actuator', element('motor', name=crank, joint=crank), *loads),
        element('sensor', *sensors),
        element('keyframe', element(
            'key', name='start', qpos=text_of(*position), qvel=text_of(*velocity),
            ctrl=text_of(float(start.torque), *[0.0] * len(loads)),
        )),
        model='linkage',
    )  # fmt: skip
    ET.indent(root)
    return ET.tostring(root, encoding='unicode') + '\n'


def _body(link: RigidLink, at: float) -> ET.Element:
    """Returns the body of a link whose joint is at the position `at`, rad or m."""
    joint, half = link.joint, link.inertia / 2  # a flat body
    place, angle, kind, axis = joint.origin, joint.angle + at, 'hinge', '0 0 1'
    if joint.slides:
        place, angle = joint.origin + cmath.rect(at, joint.angle), joint.angle
        kind, axis = 'slide', '1 0 0'
    return element(
        'body',
        element('joint', name=link.name, type=kind, axis=axis, ref=repr(at)),
        *comment(link),
        element(
            'inertial', pos=text_of(*link.center, 0.0), mass=repr(link.mass),
            diaginertia=text_of(half, half, link.inertia),
        ),
        element(
            'geom', type='box', size=text_of(*(size / 2 for size in link.box)),
            pos=text_of(*link.place), rgba=rgba(link), contype='0', conaffinity='0',
        ),
        name=link_of(link.name), pos=text_of(place.real, place.imag, 0.0),
        euler=text_of(0.0, 0.0, angle),
    )  # fmt: skip


def _site(name: str, place: complex) -> ET.Element:
    x, y = place.real + 0.0, place.imag + 0.0  # no -0.0
    return element('site', name=name, pos=text_of(x, y, 0.0))


def _load(load: object, links: Sequence[RigidLink], position: Sequence[float]) -> ET.Element:
    """Returns the actuator of a load.

    A `LinkForce` becomes an actuator without control input that exerts force - stiffness x stretch
    - damping x rate. Another load, such as a load curve, becomes a motor whose control input the
    user must set to the value of the load, because MJCF has no tables.

    Raises:
        ConfigurationError: The load acts in joints, on several links, or on a link with a moving
            parent, on which the actuator would also act.
    """
    link: int | None = getattr(load, 'link', None)
    if link is None or links[link].joint.parent is not None:
        raise ConfigurationError(
            f'MJCF does not support {type(load).__name__}: only load curves, forces, damping and '
            'stiffness of a link on the frame; leave the parameters of friction out'
        )
    name, start = links[link].name, position[link]
    if not isinstance(load, LinkForce):
        return element('motor', name=f'{name}_curve', joint=name)
    force, stiffness = float(load.force), float(load.stiffness)
    if stiffness:  # MuJoCo positions are relative to the start, without a jump from pi to -pi
        force += stiffness * (float(load.rest) + start - continuous(start, load.middle))
    return element(
        'general', name=f'{name}_load', joint=name, gainprm='0', biastype='affine',
        biasprm=text_of(force, -stiffness, -float(load.damping)),
    )  # fmt: skip


def urdf(options: argparse.Namespace) -> None:
    """Writes the mechanism as URDF: a tree of links, with the loop cut open.

    Args:
        options: Parsed options of the command.

    Raises:
        ConfigurationError: The parameters are invalid, or the file cannot be written.
    """
    configuration = _configuration(options)
    prefix, frame_id = configuration.session.joint_prefix, configuration.session.frame_id
    control = options.ros2_control
    _write(options, make_urdf(configuration.mechanism, prefix, frame_id, ros2_control=control))


def mjcf(options: argparse.Namespace) -> None:
    """Writes the mechanism as MJCF, with a closed loop.

    Args:
        options: Parsed options of the command.

    Raises:
        ConfigurationError: The parameters are invalid, or the file cannot be written.
    """
    configuration = _configuration(options)
    simulator = Simulator(configuration)
    start = simulator.snapshot_at(simulator.begin(0), 0).state
    _write(options, make_mjcf(configuration.mechanism, start, configuration.session.joint_prefix))


def _configuration(options: argparse.Namespace) -> Configuration:
    values = dict(read_values(options.params))
    if options.joint_prefix is not None:
        values['joint_prefix'] = options.joint_prefix
    return configure(values)


def _write(options: argparse.Namespace, text: str) -> None:
    """Writes text to the output file and prints its path.

    Raises:
        ConfigurationError: The file is the parameter file, exists without --overwrite, or cannot
            be written.
    """
    if is_same_file(str(options.out), str(find_file(options.params))):
        raise ConfigurationError(
            f'{options.out} holds the parameters and is kept: choose another name'
        )
    with create_file(
        options.out, ConfigurationError, overwrite=options.overwrite, cure='give --overwrite'
    ) as stream:
        stream.write(text.encode())
    print(options.out)


def _options(file: str) -> tuple[cli.Option, ...]:
    """Returns the options of both commands; `file` is the name of the output file in the help."""
    presets = f'parameter file, or a preset: {", ".join(preset_names())}'
    prefix = 'prefix of every joint and link name (default: joint_prefix of the file)'
    return (
        (('params',), None, {'metavar': 'PARAMS', 'help': presets}),
        (('out',), None, {'metavar': file, 'type': Path, 'help': 'the file to write'}),
        (('--joint-prefix',), None, {'metavar': 'TEXT', 'help': prefix}),
        (('--overwrite',), None, {'action': 'store_true', 'help': 'replace an existing file'}),
    )


def _parser() -> argparse.ArgumentParser:
    parser = cli.make_parser(
        _NAME,
        'Write a mechanism as a file for other tools; needs no ROS.',
        ('urdf quadrilateral linkage.urdf', 'mjcf my_linkage.yaml linkage.xml'),
    )
    control: cli.Option = (('--ros2-control',), None, {
        'action': 'store_true',
        'help': 'add the tag with which ros2_control drives the crank of a node',
    })  # fmt: skip
    cli.add_commands(parser, {
        'urdf': cli.Command(
            urdf, 'the URDF of the open tree, as published on robot_description',
            ('quadrilateral linkage.urdf',
             'my_linkage.yaml linkage.urdf --joint-prefix left_ --ros2-control'),
            (*_options('OUT.urdf'), control),
        ),
        'mjcf': cli.Command(
            mjcf, "MuJoCo's format, with the loop closed, a motor on the crank and sensors",
            ('quadrilateral linkage.xml',
             'my_linkage.yaml linkage.xml --joint-prefix left_ --overwrite'),
            _options('OUT.xml'),
        ),
    })  # fmt: skip
    return parser


def main() -> int:
    """Runs `linkage_export`; returns the exit code."""
    options = _parser().parse_args()
    return cli.run(_NAME, lambda: options.run(options))


if __name__ == '__main__':
    sys.exit(main())
