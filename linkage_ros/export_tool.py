# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_export: writes a mechanism as URDF or MJCF for other tools."""

import argparse
import sys

from linkage_ros import cli
from linkage_ros.errors import ConfigurationError
from linkage_ros.files import create_file, is_same_file
from linkage_ros.mjcf import make_mjcf
from linkage_ros.parameters.configuration import Configuration, configure, read_values
from linkage_ros.parameters.presets import find_file, preset_names
from linkage_ros.run.simulator import Simulator
from linkage_ros.wire.urdf import make_urdf

_NAME = 'linkage_export'


def urdf(options: argparse.Namespace) -> None:
    """Writes the mechanism as URDF: a tree of links with an open loop.

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
        (('out',), None, {'metavar': file, 'type': cli.path, 'help': 'the file to write'}),
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
