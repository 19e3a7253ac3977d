# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_import: writes a parameter file from the closed loop of a robot model."""

import argparse
import json
import math
import re
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np

from linkage_lab.robots.model import Robot
from linkage_lab.robots.planar_loop import PlanarLoop, find_loop
from linkage_lab.robots.sdf import read_sdf
from linkage_lab.robots.urdf import read_urdf
from linkage_ros import ConfigurationError, cli
from linkage_ros.internals import (
    configure,
    create_file,
    is_same_file,
    notes,
    printable,
    read_xml,
)
from linkage_ros.quantities import shown

_NAME = 'linkage_import'
_MOST = 5000  # links, joints, and frames
_LAYER = 1e-9  # m, distance along the normal that is worth a line


def read_robot(path: Path) -> Robot:
    """Reads a robot model; the root element determines the format.

    Args:
        path: Path of a URDF, SDF or MJCF file.

    Returns:
        The robot.

    Raises:
        ConfigurationError: The file cannot be read, has another format, invalid values or too
            many parts.
    """
    root = read_xml(path)
    for tag in ('link', 'joint', 'frame'):
        if (number := sum(1 for _ in root.iter(tag))) > _MOST:
            raise ConfigurationError(
                f'{path}: the model has {number} {tag}s: must be at most {_MOST}'
            )
    try:
        if root.tag == 'robot':
            return read_urdf(root)
        if root.tag == 'sdf':
            return read_sdf(root)
        if root.tag == 'mujoco':
            # MuJoCo is needed by these models alone.
            from linkage_lab.robots.mjcf import read_mjcf

            return read_mjcf(path)
    except ConfigurationError as error:
        raise ConfigurationError(f'{path}: {error}') from error
    raise ConfigurationError(
        f'{path}: its root element is <{root.tag}>: must be <robot> (URDF), <sdf> or <mujoco> '
        '(MJCF)'
    )


def parameter_text(loop: PlanarLoop, source: str) -> str:
    """Formats the parameter file of a linkage that was found in a robot.

    Args:
        loop: The linkage.
        source: Name of the model, for the comment.

    Returns:
        The YAML text.
    """
    frame = loop.bodies['frame'][0]
    values = {'drive': 'follow', **loop.values}
    # The plane is a frame of its own: traced points are in its axes, not in those of the link.
    values['frame_id'] = re.sub('[^A-Za-z0-9_./-]', '_', f'{frame}_plane')
    groups = dict[str, list[str]]()
    for name, value in values.items():
        group, _, rest = name.rpartition('.')
        groups.setdefault(group, []).append(f'{rest}: {json.dumps(value)}')
    origin, x, y, _ = (', '.join(f'{part:.9g}' for part in axis) for axis in loop.axes)
    lines = [
        f'# Written by {_NAME} from {printable(source)}.',
        f'# {values["frame_id"]} in the axes of {printable(frame)}:',
        f'# origin [{origin}], x [{x}], y [{y}].',
        '/**:',
        '  ros__parameters:',
        *(f'    {line}' for line in groups.pop('')),
        *(f'    {group}: {{{", ".join(parts)}}}' for group, parts in groups.items()),
        '    joints:',
    ]
    for link, joint in loop.joints.items():
        parts = [f'{name}: {json.dumps(value)}' for name, value in joint._asdict().items()]
        usual = {'coupler': 'crank', 'rod': 'barrel'}.get(link, 'frame')
        lines.append(
            f'      {link}: {{{", ".join(parts[:-1] if joint.parent == usual else parts)}}}'
        )
    return '\n'.join(lines) + '\n'


def summary(loop: PlanarLoop) -> str:
    """Describes what was found, one line for each link and joint, and the residual of the loop."""
    values, joints = loop.values, loop.joints
    normal = ', '.join(f'{part:.6g}' for part in loop.axes[-1])
    frame = loop.bodies['frame']
    lines = [
        ', '.join([loop.kind, *filter(None, [values.get('assembly')])])
        + f', in the plane normal to [{normal}] of {frame[0]}',
        f'  frame    {_named(frame)}'
        + (f', {values["frame.length"]:.9g} m' if 'frame.length' in values else ''),
    ]
    for link, joint in joints.items():
        what = f'{values[f"{link}.mass"]:.9g} kg'
        if f'{link}.length' in values:
            what = (
                f'{values[f"{link}.length"]:.9g} m, {what}, {values[f"{link}.inertia"]:.6g} kg m^2'
            )
        lines.append(f'  {link:8} {_named(loop.bodies[link])}, {what}')
        lines.append(
            f'           {joint.name} = {joint.ratio:g} x (own - {joint.zero:.9g}), from the '
            f'{joint.parent}'
        )
    x, y = values['gravity']
    lines.append(f'  gravity  [{x:.6g}, {y:.6g}] m/s^2')
    if 'frame_joint.name' in values:
        (x, y), ratio = values['frame_joint.pivot'], values['frame_joint.ratio']
        lines[-1] += f' with {values["frame_joint.name"]} at 0, which turns the frame'
        lines[-1] += f' by {ratio:g} x its value about [{x:.9g}, {y:.9g}] m'
    poses = (
        ', '.join(f'{name} {value:.9g}' for name, value in pose.items())
        for pose in (loop.given, loop.closed)
    )
    given, closed = poses
    lines.append(f'as given, the ends of the loop are {loop.gap:.3g} m apart: {given}')
    word = 'closed' if loop.is_closed else 'as nearly closed as its axes allow'
    lines.append(f'{word}, with a residual of {loop.residual:.2g} m: {closed}')
    if loop.across > _LAYER:
        lines.append(f'the ends stay {loop.across:.6g} m apart along the normal')
    return '\n'.join([*lines, *(f'note: {note}' for note in loop.notes)])


def _named(links: Sequence[str]) -> str:
    return f'{links[0]} (with {", ".join(links[1:])})' if links[1:] else links[0]


def import_robot(options: argparse.Namespace) -> None:
    """Writes the parameter file and prints what was found.

    Args:
        options: Parsed options of the command.

    Raises:
        ConfigurationError: The model cannot be read or imported, or the file cannot be written.
    """
    names = [name for name, _ in options.at]
    for name in names:
        if names.count(name) > 1:
            raise ConfigurationError(f'--at {printable(name)}: it is given twice: give one value')
    if options.weld and not options.close:
        raise ConfigurationError('--weld needs --close TIP_LINK PIN_LINK')
    robot = read_robot(options.robot)
    up = None if options.up is None else np.array(options.up)
    try:
        loop = find_loop(
            robot, options.crank, options.close and tuple(options.close), options.frame or '',
            dict(options.at), up, options.world or '', weld=options.weld,
        )  # fmt: skip
        configuration = configure({'drive': 'follow', **loop.values})
    except ConfigurationError as error:
        raise ConfigurationError(f'{options.robot}: {error}') from error
    if is_same_file(str(options.out), str(options.robot)):
        raise ConfigurationError(f'{options.out} is the model and is kept: choose another name')
    with create_file(
        options.out, ConfigurationError, overwrite=options.overwrite, cure='give --overwrite'
    ) as stream:
        stream.write(parameter_text(loop, options.robot.name).encode())
    print(summary(loop))
    for line in notes(configuration):
        print(f'note: {line}')
    print(options.out)


def _joint_value(text: str) -> tuple[str, float]:
    """Reads JOINT=VALUE.

    Raises:
        ArgumentTypeError: The text has another form.
    """
    name, _, number = text.rpartition('=')
    with suppress(ValueError):
        if name and math.isfinite(value := float(number)):
            return name, value
    raise argparse.ArgumentTypeError(f'{shown(text)}: must be JOINT=VALUE, in rad or m')


def _component(text: str) -> float:
    """Reads a finite number.

    Raises:
        ArgumentTypeError: The text is not a finite number.
    """
    with suppress(ValueError):
        if math.isfinite(value := float(text)):
            return value
    raise argparse.ArgumentTypeError(f'{shown(text)}: must be a finite number')


def _parser() -> argparse.ArgumentParser:
    parser = cli.make_parser(
        _NAME,
        'Write the parameter file of a closed loop in a robot model (URDF, SDF or MJCF).',
        ('robot.urdf --crank knee_motor --close pushrod_tip shank_pin -o leg.yaml',
         'gripper.xml --crank right_driver_joint -o gripper.yaml'),
    )  # fmt: skip
    text = {'metavar': 'LINK'}
    cli.add_options(parser, [
        (('robot',), None, {'metavar': 'ROBOT', 'type': Path, 'help': 'URDF, SDF or MJCF file'}),
        (('--crank',), None, {
            'required': True, 'metavar': 'JOINT',
            'help': 'the driven joint, on the frame, or a cylinder or slider',
        }),
        (('--close',), None, {
            'nargs': 2, 'metavar': ('TIP_LINK', 'PIN_LINK'),
            'help': 'two links whose origins coincide in the closed loop; not needed if the file '
            'closes one loop with the crank itself',
        }),
        (('--weld',), None, {
            'action': 'store_true',
            'help': 'the two links of --close are fixed to each other in the closed loop',
        }),
        (('--frame',), None, {
            **text, 'help': 'a link that carries the fixed pivots (default: the first common '
            'link of both ends)',
        }),
        (('--at',), None, {
            'action': 'append', 'default': [], 'metavar': 'JOINT=VALUE', 'type': _joint_value,
            'help': 'a joint value of the pose, rad or m, which decides assembly and gravity '
            '(default 0); may be repeated',
        }),
        (('--up',), None, {
            'nargs': 3, 'type': _component, 'metavar': ('X', 'Y', 'Z'),
            'help': "direction opposite to gravity in the root's axes (default: the z axis, or "
            "the model's gravity)",
        }),
        (('--world',), None, {
            **text, 'help': 'a link at rest, relative to which one joint turns the frame',
        }),
        (('-o',), None, {
            'dest': 'out', 'required': True, 'metavar': 'OUT.yaml', 'type': Path,
            'help': 'the file to write',
        }),
        (('--overwrite',), None, {'action': 'store_true', 'help': 'replace an existing file'}),
    ])  # fmt: skip
    return parser


def main() -> int:
    """Runs `linkage_import`; returns the exit code."""
    options = _parser().parse_args()
    return cli.run(_NAME, lambda: import_robot(options))


if __name__ == '__main__':
    sys.exit(main())
