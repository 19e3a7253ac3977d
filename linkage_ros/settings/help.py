# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Parameters in --help, and the command lines of programs on ROS, whose help needs no rclpy."""

import argparse
import json
from collections.abc import Iterable
from dataclasses import MISSING, replace

from linkage_ros import cli
from linkage_ros.mechanism.loads import LOADS
from linkage_ros.mechanism.points import TracedPoint
from linkage_ros.mechanism.registry import MECHANISMS
from linkage_ros.motion.drives import DRIVES
from linkage_ros.quantities import Leaf, leaves
from linkage_ros.settings.controller import PARAMETERS
from linkage_ros.settings.parameters import MechanismAndDrive, parameter_leaves


def help_on(parameters: Iterable[Leaf]) -> str:
    """Describes parameters, one line each: name, valid values, meaning and default.

    Args:
        parameters: Parameters of any dataclass of quantities.

    Returns:
        The lines, joined by newlines.
    """
    return '\n'.join(
        f'  {name}: {f"{quantity.valid}; ".removeprefix("text; ")}{quantity.meaning}'
        f'{_default(default)}'
        for name, quantity, default in parameters
    )


def _default(value: object) -> str:
    """Formats a default value as a user would type it; empty for None and empty strings."""
    if value is MISSING:
        return ' (required)'
    if value in (None, ''):
        return ''
    if isinstance(value, float):
        return f' (default {value:g})'
    return f' (default {value if isinstance(value, str) else json.dumps(value)})'


def help_on_every_kind() -> str:
    """Describes the parameters of a four_bar, then those added by other drives and mechanisms."""
    usual = MechanismAndDrive('four_bar', 'speed')
    own = parameter_leaves(usual)
    parts = ['parameters of a four_bar:', help_on(own)]
    known = {leaf.name for leaf in own}
    mechanisms = (('mechanism', name) for name in MECHANISMS if name != usual.mechanism)
    drives = (('drive', name) for name in DRIVES if name != usual.drive)
    for name, value in (*drives, *mechanisms):
        found = parameter_leaves(replace(usual, **{name: value}))
        parts.append(f'also, with {name}: {value}:')
        parts.append(help_on(leaf for leaf in found if leaf.name not in known))
    parts.append('also, any number of traced points, by names of your own:')
    parts.append(help_on(leaves(TracedPoint, 'points.NAME.')))
    for kind, cls in LOADS.items():
        parts.append(f'also, any number of loads, by names of your own, with kind: {kind}:')
        parts.append(help_on(leaves(cls, 'loads.NAME.')))
    return '\n'.join(parts)


def node_parser() -> argparse.ArgumentParser:
    """Makes the parser of linkage_node."""
    return cli.make_parser(
        'linkage_node',
        'Turn the crank of a linkage on ROS 2; publish its states and the driving torque.',
        ('', '--ros-args -p rpm:=60.0 -p log:=run.mcap',
         '--ros-args -p drive:=torque -p motor.torque:=9.0 -p motor.damping:=0.5',
         '--ros-args --params-file linkage.yaml -r joint_states:=linkage/joint_states'),
        help_on_every_kind(),
    )  # fmt: skip


def controller_parser() -> argparse.ArgumentParser:
    """Makes the parser of linkage_controller."""
    return cli.make_parser(
        'linkage_controller',
        'Keep a torque-driven crank at a speed.',
        ('', '--ros-args -p rpm:=600.0 -p feed_forward:=false'),
        'parameters:\n' + help_on(PARAMETERS),
    )


PARSERS = {'node.linkage_node': node_parser, 'programs.controller': controller_parser}
