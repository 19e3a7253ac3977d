# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_chart: pictures and tables of what a mechanism does."""

from __future__ import annotations

import argparse
import math
import sys
from pathlib import Path

from linkage_ros import cli
from linkage_ros.core.curves import Curves
from linkage_ros.core.travel import travel
from linkage_ros.errors import ConfigurationError
from linkage_ros.run.configuration import find, load
from linkage_ros.run.presets import preset_names

_NAME = 'linkage_chart'


def motion(options: argparse.Namespace) -> None:
    """Draws one period of a mechanism and writes its table.

    Args:
        options: Of the command line.

    Raises:
        ConfigurationError: The mechanism, the speed or the folder cannot be used.
    """
    try:
        from linkage_ros.chart import draw_motion
    except ModuleNotFoundError as error:
        raise ConfigurationError(
            f"charts need {error.name}: pip install 'linkage_ros[chart]'"
        ) from error

    configuration = load(options.params)
    mechanism, kind = configuration.mechanism, configuration.kind.mechanism
    rpm = configuration.drive.rpm if options.rpm is None else options.rpm
    for name, value in (('--rpm', rpm), ('--acceleration', options.acceleration)):
        if not abs(value) <= 1e9:
            raise ConfigurationError(f'{name} {value:g}: must be a number from -1e+09 to 1e+09')
    curves = Curves(
        mechanism, rpm * math.pi / 30, options.acceleration, reactions=options.reactions
    )
    name = find(options.params).stem
    accelerated = f', {options.acceleration:g} rad/s^2' if options.acceleration else ''
    title = [
        name,
        f'{kind}, {mechanism.assembly}, {curves.solver.mobility.grashof}',
        f'{rpm:g} rpm{accelerated}',
        *travel(curves.solver).words(),
    ]
    picture, table = options.out / f'{name}_motion.png', options.out / f'{name}_motion.csv'
    try:
        options.out.mkdir(parents=True, exist_ok=True)
        curves.save(table)
        draw_motion(curves, title, picture)
    except FileExistsError as error:
        raise ConfigurationError(f'{options.out} is no folder: name another') from error
    except OSError as error:
        raise ConfigurationError(f'{options.out} cannot be written: {error.strerror}') from error
    print(', '.join(title))
    print(f'{picture}\n{table}')


def _parser() -> argparse.ArgumentParser:
    parser = cli.make_parser(
        _NAME,
        'Draw what a mechanism does; needs no ROS.',
        ('motion quadrilateral', 'motion my_linkage.yaml --reactions --out charts',
         'motion slider_crank --rpm 4.7746482927568605 --acceleration 1'),
    )  # fmt: skip
    commands = parser.add_subparsers(dest='command', required=True, metavar='COMMAND')
    curves = commands.add_parser(
        'motion', help='position, rate, acceleration and torque over one period: PNG and CSV'
    )
    curves.add_argument(
        'params',
        metavar='PARAMS',
        help=f'parameter file, or a preset: {", ".join(preset_names())}',
    )
    curves.add_argument('--rpm', type=float, metavar='N', help="crank speed instead of the file's")
    curves.add_argument(
        '--acceleration', type=float, default=0.0, metavar='A',
        help='crank acceleration at every angle, rad/s^2 (default 0)',
    )  # fmt: skip
    curves.add_argument(
        '--reactions', action='store_true', help='add joint forces, shaking force and moment'
    )
    curves.add_argument(
        '--out',
        type=Path,
        default=Path(),
        metavar='DIR',
        help='folder for PNG and CSV, which are replaced (default: this one)',
    )
    return parser


def main() -> int:
    """Entry point."""
    options = _parser().parse_args()
    return cli.run(_NAME, lambda: motion(options))


if __name__ == '__main__':
    sys.exit(main())
