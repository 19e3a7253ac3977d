# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_import: writes a parameter file from the closed loops of a robot model."""

import argparse
import json
import math
import re
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from linkage_lab.output import new_file, save_text
from linkage_lab.robots.loops import Request
from linkage_lab.robots.model import RobotModel
from linkage_lab.robots.plane import FRAME
from linkage_lab.robots.robot_drawing import RobotDrawing, draw_robot
from linkage_lab.robots.sdf import read_sdf
from linkage_lab.robots.urdf import read_urdf
from linkage_ros import ConfigurationError, Solver, cli
from linkage_ros.internals import (
    STANDARD_OUTPUT,
    configure,
    is_same_file,
    notes_on,
    printable,
    read_values,
    read_xml,
)
from linkage_ros.quantities import Quantity, shown

_NAME = 'linkage_import'
_MOST = 5000  # links, joints, and frames
_LIST = '    linkages: ['  # beginning of the line with the names of several linkages
_NEAR_ENDS = 0.01  # of the longest link, distance of both ends of a loop as given
_GAP = Quantity(
    'number', 'largest distance of both ends of a loop in the given pose', 'm', 0.0, 1e9
)
_LAYER = 1e-9  # m, distance along the normal that is worth a line


def read_robot(path: Path) -> RobotModel:
    """Reads a robot model; the root element determines the format.

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


def parameter_text(found: RobotDrawing, source: str) -> str:
    """Formats the parameter file of the linkage of a robot."""
    return _file(source, _lines(_tree({'drive': 'follow', **file_values(found)}), '    '))


def text_with(found: RobotDrawing, source: str, linkage: str, text: str) -> str:
    """Appends the linkage of a robot to a parameter file of several linkages, or replaces it.

    Args:
        found: The linkage.
        source: Name of the model, for the comment.
        linkage: Name of the linkage.
        text: The file, whose linkages this program has written; empty for a new one.

    Returns:
        The YAML text.

    Raises:
        ConfigurationError: The text has no list of linkages, or not the lines of this one.
    """
    text = text or _file(source, (f'{_LIST}]', '    drive: follow'))
    list_line = re.search(rf'^{re.escape(_LIST)}(.*)\]$', text, re.MULTILINE)
    if list_line is None:
        raise ConfigurationError(
            f'it has no line {_LIST.strip()}...], as files of {_NAME} --linkage have; choose '
            'another file'
        )
    names = [name for name in list_line[1].split(', ') if name]
    head = f'    {linkage}:'
    group = [head, *_lines(_tree(file_values(found, linkage)), '      ')]
    if linkage not in names:
        longer_list = f'{_LIST}{", ".join([*names, linkage])}]'
        return '\n'.join((text.replace(list_line[0], longer_list).rstrip(), *group, ''))
    lines = text.rstrip().split('\n')
    if head not in lines:
        raise ConfigurationError(
            f'it has no line {head.strip()} alone, as {_NAME} writes it: remove the linkage'
        )
    start = lines.index(head)
    later_groups = (i for i in range(start + 1, len(lines)) if not lines[i].startswith('     '))
    lines[start : next(later_groups, len(lines))] = group
    return '\n'.join((*lines, ''))


def file_values(found: RobotDrawing, linkage: str = '') -> dict[str, object]:
    """Returns the parameters of the linkage of a robot, by name, without those of the run.

    Args:
        found: The linkage.
        linkage: Name of the linkage; empty if the file has only one.
    """
    frame = found.bodies[FRAME][0]
    # The plane is a frame of its own: traced points are in its axes, not in those of the link.
    # Linkages of one link may have different planes.
    frame_id = re.sub('[^A-Za-z0-9_./-]', '_', f'{linkage or frame}_plane')
    origin, x, y, _ = ((axis + 0.0).tolist() for axis in found.axes)
    values = {
        'mechanism': 'drawing',
        'frame_id': frame_id,
        'plane.link': frame,
        'plane.origin': origin,
        'plane.x': x,
        'plane.y': y,
    }
    return values | found.parameters


def _tree(values: Mapping[str, object]) -> dict[str, Any]:
    """Returns values by dotted name as nested groups."""
    tree: dict[str, Any] = {}
    for name, value in values.items():
        *groups, last = name.split('.')
        branch = tree
        for group in groups:
            branch = branch.setdefault(group, {})
        branch[last] = value
    return tree


def _file(source: str, lines: Iterable[str]) -> str:
    """Returns a parameter file with these lines."""
    head = f'# Written by {_NAME} from {printable(source)}.'
    return '\n'.join((head, '/**:', '  ros__parameters:', *lines, ''))


def _lines(tree: Mapping[str, Any], indent: str) -> Iterator[str]:
    """Yields the lines of a group; a group of values alone is one line."""
    for name, value in tree.items():
        if not isinstance(value, dict):
            yield f'{indent}{name}: {json.dumps(value)}'
        elif any(isinstance(x, dict) for x in value.values()) or name == 'pins':
            yield f'{indent}{name}:'
            yield from _lines(value, f'{indent}  ')
        else:
            parts = (f'{word}: {json.dumps(x)}' for word, x in value.items())
            yield f'{indent}{name}: {{{", ".join(parts)}}}'


def summary(found: RobotDrawing, mechanism_words: str) -> str:
    """Describes what was found: each link with its joint, and the residual of the loops."""
    normal = ', '.join(f'{part:.6g}' for part in found.axes[-1])
    closed = 'closed' if found.is_closed else 'as nearly closed as its axes allow'
    lines = [
        f'{mechanism_words}, in the plane normal to [{normal}] of {found.bodies[FRAME][0]}',
        f'  frame: {_named(found.bodies[FRAME])}',
        *_link_lines(found),
        f'  gravity: {_gravity_words(found.values)}',
        f'as given, the ends of the loops are {found.gap:.3g} m apart: {_pose_words(found.given)}',
        f'{closed}, with a residual of {found.residual:.2g} m: {_pose_words(found.closed)}',
    ]
    if found.across > _LAYER:
        lines.append(f'the ends stay {found.across:.6g} m apart along the normal')
    return '\n'.join(lines)


def _link_lines(found: RobotDrawing) -> Iterator[str]:
    """Yields two lines for each link: its part, and its joint."""
    parts = found.mechanism.parts()
    for link, joint in found.joints.items():
        part = parts[link]
        values = [f'{part.length:.9g} m'] if hasattr(part, 'length') else []
        values.append(f'{part.mass:.9g} kg')
        if getattr(part, 'inertia', 0.0):
            values.append(f'{part.inertia:.6g} kg m^2')
        yield f'  {link}: {_named(found.bodies[link])}, {", ".join(values)}'
        parent = f', from {joint.parent}' if joint.parent else ''
        yield f'    {joint.name} = {joint.ratio:g} x (own - {joint.zero:.9g}){parent}'


def _gravity_words(values: Mapping[str, Any]) -> str:
    x, y = values['gravity']
    gravity = f'[{x:.6g}, {y:.6g}] m/s^2'
    if 'frame_joint.name' not in values:
        return gravity
    name, ratio = values['frame_joint.name'], values['frame_joint.ratio']
    x, y = values['frame_joint.pivot']
    return (
        f'{gravity} with {name} at 0, which turns the frame by {ratio:g} x its value about '
        f'[{x:.9g}, {y:.9g}] m'
    )


def _pose_words(pose: Mapping[str, float]) -> str:
    return ', '.join(f'{name} {value:.9g}' for name, value in pose.items())


def _named(links: Sequence[str]) -> str:
    return f'{links[0]} (with {", ".join(links[1:])})' if links[1:] else links[0]


def import_robot(options: argparse.Namespace) -> None:
    """Writes the parameter file and prints what was found.

    Raises:
        ConfigurationError: The model cannot be read or imported, or the file cannot be written.
    """
    _require_options(options)
    if not options.linkage:
        new_file(options, options.out)
    robot = read_robot(options.robot)
    request = Request(
        crank=options.crank, close=[(tip, pin) for tip, pin in options.close],
        frame=options.frame or '', at=dict(options.at),
        up=None if options.up is None else np.array(options.up),
        world=options.world or '', weld=options.weld,
    )  # fmt: skip
    try:
        found = draw_robot(robot, request)
        _require_close_ends(found, options)
        linkage = configure({'drive': 'follow', **found.parameters}).only
    except ConfigurationError as error:
        raise ConfigurationError(f'{options.robot}: {error}') from error
    text, left_out = _text(options, found)
    save_text(options.out, text)
    cli.print_notes([*found.notes, *notes_on(linkage), *left_out])
    if str(options.out) == STANDARD_OUTPUT:
        return
    print(summary(found, linkage.mechanism_words))
    speed = ' --rpm 30' if Solver(found.mechanism).reach.turns_fully else ''
    of_one = f' --linkage {options.linkage}' if options.linkage else ''
    print(f'{options.out}; linkage_chart motion {options.out}{of_one}{speed} shows it')


def _require_options(options: argparse.Namespace) -> None:
    """Requires options that fit to each other.

    Raises:
        ConfigurationError: A joint has two values, --weld no links, or the output is the model.
    """
    names = [name for name, _ in options.at]
    for name in names:
        if names.count(name) > 1:
            raise ConfigurationError(f'--at {printable(name)}: it is given twice: give one value')
    if options.weld and not options.close:
        raise ConfigurationError('--weld needs --close TIP_LINK PIN_LINK')
    if is_same_file(str(options.out), str(options.robot)):
        raise ConfigurationError(f'{options.out} is the model and is kept: choose another name')


def _text(options: argparse.Namespace, found: RobotDrawing) -> tuple[str, list[str]]:
    """Returns the parameter file to write, and a note on what it has no longer.

    Raises:
        ConfigurationError: The linkage does not fit to those of an existing file.
    """
    source, out = options.robot.name, options.out
    if not options.linkage:
        return parameter_text(found, source), []
    try:
        left_out = _left_out(options, file_values(found, options.linkage))
        text = out.read_text(encoding='utf-8') if out.exists() else ''
        return text_with(found, source, options.linkage, text), left_out
    except ConfigurationError as error:
        raise ConfigurationError(f'{out}: {error}') from error


def _left_out(options: argparse.Namespace, values: Mapping[str, object]) -> list[str]:
    """Checks the parameters of a linkage with those of an existing file.

    Returns:
        A note on the parameters that only the replaced linkage has, if any.

    Raises:
        ConfigurationError: The linkage does not fit to the others, or must not be replaced.
    """
    out, prefix = options.out, f'{options.linkage}.'
    present: Mapping[str, Any] = read_values(str(out)) if out.exists() else {}
    names = [*present.get('linkages', ())]
    is_new = options.linkage not in names
    if not is_new and not options.overwrite:
        raise ConfigurationError(
            f'it has a linkage {options.linkage}: choose another name, or give --overwrite to '
            'replace it'
        )
    replaced = [] if is_new else [name for name in present if name.startswith(prefix)]
    others = {name: x for name, x in present.items() if name not in replaced}
    own = {f'{prefix}{name}': x for name, x in values.items()}
    all_names = [*names, options.linkage] if is_new else names
    configure({'drive': 'follow', **others, 'linkages': all_names, **own})
    left_out = ', '.join(name for name in replaced if name not in own)
    return [f'left out of {out}, where they were: {left_out}'] if left_out else []


def _require_close_ends(found: RobotDrawing, options: argparse.Namespace) -> None:
    """Rejects a model whose loops are open in the pose of the file, as if others were meant.

    Raises:
        ConfigurationError: The ends are further apart than --gap, or than a hundredth of the
            longest link if no pose is given.
    """
    allowed = _NEAR_ENDS * found.size if options.gap is None else options.gap
    if found.gap > allowed and (options.gap is not None or not options.at):
        raise ConfigurationError(
            f'as given, the ends of the loops are {found.gap:.4g} m apart, at '
            f'{_pose_words(found.given)}: must be at most {allowed:.3g} m; check --close, give '
            f'another pose with --at, or allow it with --gap {found.gap * 1.1:.2g}'
        )


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
        'Write the parameter file of the closed loops of a motor in a robot model (URDF, SDF or '
        'MJCF).',
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
            'nargs': 2, 'metavar': ('TIP_LINK', 'PIN_LINK'), 'action': 'append', 'default': [],
            'help': 'two links whose origins coincide in the closed loop; repeat it for each loop '
            'of the motor; not needed if the file closes the loops itself',
        }),
        (('--weld',), None, {
            'action': 'store_true',
            'help': 'the two links of each --close are fixed to each other',
        }),
        (('--frame',), None, {
            **text, 'help': 'a link that carries the fixed pivots (default: that of the '
            'loops nearest to the root)',
        }),
        (('--at',), None, {
            'action': 'append', 'default': [], 'metavar': 'JOINT=VALUE', 'type': _joint_value,
            'help': 'a joint value of the pose, rad or m, which decides assembly and gravity '
            '(default 0); may be repeated',
        }),
        (('--gap',), _GAP, {
            'metavar': 'M', 'note': ' (default: a hundredth of the longest link; with --at, any)'
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
            'help': 'the file to write; - prints it',
        }),
        (('--linkage',), None, {
            'metavar': 'NAME', 'default': '',
            'help': 'append the linkage under this name to OUT.yaml, for several in one node, or '
            'replace it with --overwrite',
        }),
        cli.OVERWRITE,
    ])  # fmt: skip
    return parser


def main() -> int:
    """Runs `linkage_import`; returns the exit code."""
    options = _parser().parse_args()
    return cli.run(_NAME, lambda: import_robot(options))


if __name__ == '__main__':
    sys.exit(main())
