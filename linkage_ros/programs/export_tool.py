# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_export: writes a mechanism as URDF, for other tools."""

import argparse
import sys
from pathlib import Path

from linkage_ros import cli
from linkage_ros.errors import ConfigurationError, in_file
from linkage_ros.files import create_file, is_same_file
from linkage_ros.messages.urdf import make_urdf
from linkage_ros.settings.configuration import configure, read_values
from linkage_ros.settings.presets import find_file, preset_names

_NAME = 'linkage_export'


def urdf(options: argparse.Namespace) -> None:
    """Writes the mechanism as URDF, a tree of links with the loop cut open; prints the path.

    Args:
        options: Parsed options of the command.

    Raises:
        ConfigurationError: The parameters are invalid, or the file is the parameter file, exists
            without --overwrite, or cannot be written.
    """
    values = dict(read_values(options.params))
    if options.joint_prefix is not None:
        values['joint_prefix'] = options.joint_prefix
    with in_file(options.params):
        configuration = configure(values)
    session = configuration.session
    text = make_urdf(
        configuration.mechanism, session.joint_prefix, session.frame_id,
        ros2_control=options.ros2_control,
    )  # fmt: skip
    if is_same_file(str(options.out), str(find_file(options.params))):
        raise ConfigurationError(
            f'{options.out} holds the parameters and is kept: choose another name'
        )
    with create_file(
        options.out, ConfigurationError, overwrite=options.overwrite, cure='give --overwrite'
    ) as stream:
        stream.write(text.encode())
    print(options.out)


def mjcf(_options: argparse.Namespace) -> None:
    """Names the program that writes MJCF.

    Raises:
        ConfigurationError: Always.
    """
    raise ConfigurationError('linkage_lab writes MJCF: linkage_chart mjcf PARAMS OUT.xml')


def _parser() -> argparse.ArgumentParser:
    parser = cli.make_parser(
        _NAME,
        'Write a mechanism as a file for other tools; needs no ROS.',
        ('urdf quadrilateral linkage.urdf',),
    )
    presets = f'parameter file, or a preset: {", ".join(preset_names())}'
    prefix = 'prefix of every joint and link name (default: joint_prefix of the file)'
    cli.add_commands(parser, {
        'urdf': cli.Command(
            urdf, 'the URDF of the open tree, as published on robot_description',
            ('quadrilateral linkage.urdf',
             'my_linkage.yaml linkage.urdf --joint-prefix left_ --ros2-control'),
            (
                (('params',), None, {'metavar': 'PARAMS', 'help': presets}),
                (('out',), None,
                 {'metavar': 'OUT.urdf', 'type': Path, 'help': 'the file to write'}),
                (('--joint-prefix',), None, {'metavar': 'TEXT', 'help': prefix}),
                (('--overwrite',), None,
                 {'action': 'store_true', 'help': 'replace an existing file'}),
                (('--ros2-control',), None,
                 {'action': 'store_true',
                  'help': 'add the tag with which ros2_control drives the crank of a node'}),
            ),
        ),
        'mjcf': cli.Command(
            mjcf, 'moved to `linkage_chart mjcf` of linkage_lab', (),
            ((('words',), None, {'nargs': argparse.REMAINDER, 'help': argparse.SUPPRESS}),),
        ),
    })  # fmt: skip
    return parser


def main() -> int:
    """Runs `linkage_export`; returns the exit code. `cli.run` reports its errors."""
    options = _parser().parse_args()
    code: int = options.run(options) or 0
    return code


if __name__ == '__main__':
    sys.exit(cli.run(_NAME, main))
