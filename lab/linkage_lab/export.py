# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_export: writes a mechanism as URDF or MJCF, for other tools."""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from linkage_lab.mjcf import about_zeros, make_mjcf
from linkage_lab.output import doubts, new_file, save_text
from linkage_ros import ConfigurationError, cli, load, preset_names
from linkage_ros.internals import STANDARD_OUTPUT, Simulator, make_urdf

_NAME = 'linkage_export'


def urdf(options: argparse.Namespace) -> None:
    """Writes the mechanism as URDF, a tree of links with the loop cut open; see `_prepared`."""
    configuration = _prepared(options, '.urdf')
    session = configuration.session
    text = make_urdf(
        configuration.mechanism, session.joint_prefix, session.frame_id,
        ros2_control=options.ros2_control,
    )  # fmt: skip
    _write(options, text, doubts(configuration))


def mjcf(options: argparse.Namespace) -> None:
    """Writes the mechanism as MJCF, with its loop closed; see `_prepared`.

    Raises:
        ConfigurationError: A load has no equivalent in MJCF.
    """
    configuration = _prepared(options, '.xml')
    simulator, mechanism = Simulator(configuration), configuration.mechanism
    start = simulator.state(simulator.begin(0).at(0))
    text = make_mjcf(mechanism, start, configuration.session.joint_prefix)
    _write(options, text, [*doubts(configuration), *about_zeros(mechanism, start)])


def _prepared(options: argparse.Namespace, suffix: str) -> Any:
    """Loads the linkage to export, after a check of the file to write.

    Raises:
        ConfigurationError: The parameters are invalid, or the file has another suffix, exists
            without --overwrite, or cannot be written.
    """
    configuration, out = load(options.params).linkage(options.linkage), options.out
    if options.joint_prefix is not None:
        session = replace(configuration.session, joint_prefix=options.joint_prefix)
        configuration = replace(configuration, session=session)
    if out.suffix != suffix and str(out) != STANDARD_OUTPUT:
        raise ConfigurationError(f'{out}: must end with {suffix}, or be - for standard output')
    new_file(options, out)
    return configuration


def _write(options: argparse.Namespace, text: str, notes: Sequence[str]) -> None:
    """Writes the file, and prints notes and its path."""
    cli.print_notes(notes)
    save_text(options.out, text)
    if str(options.out) != STANDARD_OUTPUT:
        print(options.out)


def _parser() -> argparse.ArgumentParser:
    parser = cli.make_parser(
        _NAME,
        'Write a mechanism as a file for other tools; needs no ROS.',
        ('urdf quadrilateral linkage.urdf', 'mjcf quadrilateral linkage.xml'),
    )

    def arguments(suffix: str) -> tuple[cli.Option, ...]:
        presets = f'parameter file, or a preset: {", ".join(preset_names())}'
        return (
            (('params',), None, {'metavar': 'PARAMS', 'help': presets}),
            (('out',), None,
             {'metavar': f'OUT{suffix}', 'type': Path, 'help': 'the file to write; - prints it'}),
            (('--linkage',), None,
             {'metavar': 'NAME', 'default': '', 'help': 'the linkage, if PARAMS has several'}),
            (('--joint-prefix',), None,
             {'metavar': 'TEXT',
              'help': 'prefix of every joint and link name (default: joint_prefix of the file)'}),
            cli.OVERWRITE,
        )  # fmt: skip

    cli.add_commands(parser, {
        'urdf': cli.Command(
            urdf, 'the URDF of the open tree, as published on robot_description',
            ('quadrilateral linkage.urdf',
             'my_linkage.yaml linkage.urdf --joint-prefix left_ --ros2-control'),
            (
                *arguments('.urdf'),
                (('--ros2-control',), None,
                 {'action': 'store_true',
                  'help': 'add the tag with which ros2_control drives the crank of a node'}),
            ),
        ),
        'mjcf': cli.Command(
            mjcf, "MuJoCo's format, with the loop closed, a motor on the crank and sensors",
            ('quadrilateral linkage.xml',
             'my_linkage.yaml linkage.xml --joint-prefix left_ --overwrite'),
            arguments('.xml'),
        ),
    })  # fmt: skip
    return parser


def main() -> int:
    """Runs `linkage_export`; returns the exit code."""
    options = _parser().parse_args()
    return cli.run(_NAME, lambda: options.run(options))


if __name__ == '__main__':
    sys.exit(main())
