# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_chart: its command line; what each command does is in a file of its name."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from linkage_ros import cli
from linkage_ros.lab.commands.accuracy import accuracy
from linkage_ros.lab.commands.economy import RPM as BESIDES
from linkage_ros.lab.commands.economy import TOLERANCE, economy
from linkage_ros.lab.commands.flywheel import FLUCTUATION
from linkage_ros.lab.commands.motion import ACCELERATION, RPM, motion
from linkage_ros.lab.commands.pump import pump
from linkage_ros.lab.commands.stability import stability
from linkage_ros.lab.pump.runs import START_SPEED
from linkage_ros.parameters.presets import preset_names

_NAME = 'linkage_chart'


def _parser() -> argparse.ArgumentParser:
    parser = cli.make_parser(
        _NAME,
        'Draw the motion of a mechanism, or measurements of the methods; needs no ROS.',
        ('motion quadrilateral', 'motion my_linkage.yaml --reactions --out charts',
         'motion slider_crank --rpm 30 --acceleration 1',
         'accuracy --quick --out charts', 'stability --out charts', 'economy quadrilateral',
         'pump --out charts'),
    )  # fmt: skip
    commands = parser.add_subparsers(dest='command', required=True, metavar='COMMAND')
    _add_motion(commands)
    for draw, purpose in (
        (accuracy, 'speed against accuracy of all methods: PNG and JSON'),
        (stability, 'outcome of each method in the situations where some fail: PNG and JSON'),
    ):
        _add_measured(commands, draw, purpose, '--quick --out charts')
    _add_economy(commands)
    _add_pump(commands)
    return parser


def _add(
    commands: Any, draw: Callable[[argparse.Namespace], None], purpose: str, *examples: str
) -> argparse.ArgumentParser:
    """A command of the name of what draws it, with what all have."""
    command = cli.add_command(commands, _NAME, draw.__name__, purpose, examples)
    command.add_argument(
        '--out', type=cli.path, default=Path(), metavar='DIR',
        help='folder for the results, which are replaced (default: this one)',
    )  # fmt: skip
    command.set_defaults(draw=draw)
    return command


def _add_motion(commands: Any) -> None:
    command = _add(
        commands, motion, 'position, rate, acceleration and torque over one period: PNG and CSV',
        'quadrilateral', 'my_linkage.yaml --rpm 30 --reactions --out charts',
        'my_linkage.yaml --fluctuation 0.02',
    )  # fmt: skip
    add = command.add_argument
    # fmt: off
    add('params', metavar='PARAMS',
        help=f'parameter file, or a preset: {", ".join(preset_names())}')
    cli.add_number(command, '--rpm', quantity=RPM, metavar='N',
                   note='; of a wind_pump, the one it settles from')
    cli.add_number(command, '--acceleration', quantity=ACCELERATION, default=0.0, metavar='A',
                   note=' (default 0)')
    cli.add_number(command, '--fluctuation', quantity=FLUCTUATION, metavar='F',
                   note='; adds the flywheel, and judges the motor: PNG')
    add('--reactions', action='store_true', help='add joint forces, shaking force and moment')
    # fmt: on


def _add_measured(
    commands: Any, draw: Callable[[argparse.Namespace], None], purpose: str, *examples: str
) -> argparse.ArgumentParser:
    """A command that has a quick form."""
    command = _add(commands, draw, purpose, *examples)
    command.add_argument(
        '--quick', action='store_true', help='fewer settings, cases and rounds: half a minute'
    )
    return command


def _add_economy(commands: Any) -> None:
    command = _add_measured(
        commands, economy, 'error of the torque without each of its terms: PNG and JSON',
        'quadrilateral', 'my_linkage.yaml --rpm 30 60 --tolerance 0.02 --quick --out charts',
    )  # fmt: skip
    command.usage = '%(prog)s PARAMS [options]'  # behind --rpm it would be one of them
    # fmt: off
    command.add_argument('params', metavar='PARAMS', help='parameter file, or a preset')
    cli.add_number(command, '--rpm', quantity=BESIDES, nargs='+', metavar='N',
                   note=' (default: a quarter to four times it)')
    cli.add_number(command, '--tolerance', quantity=TOLERANCE, default=0.01, metavar='E',
                   note=' (default 0.01)')
    # fmt: on


def _add_pump(commands: Any) -> None:
    command = _add_measured(
        commands, pump, 'steady states of a wind pump over start and motor torque: PNG and JSON',
        '', 'my_pump.yaml --speeds 1 4 --quick --out charts',
    )  # fmt: skip
    command.usage = '%(prog)s [PARAMS] [options]'  # behind --speeds they would be one of them
    add = command.add_argument
    # fmt: off
    add('params', nargs='?', default='wind_pump', metavar='PARAMS',
        help='parameter file, or a preset (default wind_pump)')
    cli.add_number(command, '--speeds', quantity=START_SPEED, nargs='+', default=[2.0, 6.0],
                   metavar='W', note=' (default 2 6)')
    # fmt: on


def main() -> int:
    """Entry point."""
    options = _parser().parse_args()
    return cli.run(_NAME, lambda: options.draw(options))


if __name__ == '__main__':
    sys.exit(main())
