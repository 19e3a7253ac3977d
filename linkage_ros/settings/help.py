# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Parameters in --help, and the command lines of programs on ROS, whose help needs no rclpy."""

import argparse
import json
from collections.abc import Iterable
from dataclasses import MISSING, replace
from typing import Any

from linkage_ros import cli
from linkage_ros.mechanism.loads import LOADS
from linkage_ros.mechanism.parts import TracedPoint
from linkage_ros.mechanism.registry import MECHANISMS
from linkage_ros.motion.drives import DRIVES
from linkage_ros.quantities import Leaf, leaves
from linkage_ros.settings.controller import PARAMETERS
from linkage_ros.settings.parameters import MechanismAndDrive, parameter_leaves


def help_on(parameters: Iterable[Leaf]) -> str:
    """Describes parameters, one line each: name, valid values, meaning and default."""
    lines = []
    for name, quantity, default in parameters:
        valid = '' if quantity.valid == 'text' else f'{quantity.valid}; '
        lines.append(f'  {name}: {valid}{quantity.meaning}{_default(default)}')
    return '\n'.join(lines)


def _default(value: object) -> str:
    """Formats a default value as a user would type it; empty for None and empty strings."""
    if value is MISSING:
        return ' (required)'
    if value in (None, ''):
        return ''
    if isinstance(value, float):
        return f' (default {value:g})'
    return f' (default {value if isinstance(value, str) else json.dumps(value)})'


def help_on_kind(mechanism: str | None = None) -> str:
    """Describes the parameters of a mechanism with its usual drive, then those added by others.

    Without a kind of mechanism, it is a four_bar, followed by what the others add.
    """
    kind = mechanism or 'four_bar'
    allowed = MECHANISMS[kind].drives({})[0] or tuple(DRIVES)
    usual = MechanismAndDrive(kind, allowed[0])
    own = parameter_leaves(usual)
    parts = [f'parameters of a {kind}:', help_on(own)]
    known = {leaf.name for leaf in own}
    others = [('drive', name) for name in allowed[1:]]
    if mechanism is None:
        others += [('mechanism', name) for name in MECHANISMS if name != kind]
    for name, value in others:
        leaves_of_kind = parameter_leaves(replace(usual, **{name: value}))
        parts.append(f'also, with {name}: {value}:')
        parts.append(help_on(leaf for leaf in leaves_of_kind if leaf.name not in known))
    parts.append('also, any number of traced points, by names of your own:')
    parts.append(help_on(leaves(TracedPoint, 'points.NAME.')))
    for load, cls in LOADS.items():
        parts.append(f'also, any number of loads, by names of your own, with kind: {load}:')
        parts.append(help_on(leaves(cls, 'loads.NAME.')))
    return '\n'.join(parts)


class _HelpOnParameters(argparse.Action):
    """Prints the parameters of a kind of mechanism, and ends the program."""

    def __call__(self, parser: Any, _: Any, value: Any, __: str | None = None) -> None:
        print(help_on_kind(value))
        parser.exit()


# An option that lists the parameters, which do not fit on the screen of --help.
HELP_PARAMETERS: cli.Option = (('--help-parameters',), None, {
    'action': _HelpOnParameters, 'nargs': '?', 'choices': [*MECHANISMS],
    'metavar': 'MECHANISM',
    'help': f'list the parameters of a file, of {", ".join(MECHANISMS)} (default: of all)',
})  # fmt: skip


def node_parser() -> argparse.ArgumentParser:
    """Makes the parser of linkage_node."""
    parser = cli.make_parser(
        'linkage_node',
        'Turn the crank of a linkage on ROS 2; publish its states and the driving torque.',
        ('', '--ros-args -p rpm:=60.0 -p log:=run.mcap',
         '--ros-args -p drive:=torque -p motor.torque:=9.0 -p motor.damping:=0.5',
         '--ros-args --params-file linkage.yaml -r joint_states:=linkage/joint_states'),
    )  # fmt: skip
    cli.add_options(parser, [HELP_PARAMETERS])
    return parser


def controller_parser() -> argparse.ArgumentParser:
    """Makes the parser of linkage_controller."""
    return cli.make_parser(
        'linkage_controller',
        'Keep a torque-driven crank at a speed.',
        ('', '--ros-args -p rpm:=600.0 -p feed_forward:=false'),
        'parameters:\n' + help_on(PARAMETERS),
    )


PARSERS = {'node.linkage_node': node_parser, 'programs.controller': controller_parser}
