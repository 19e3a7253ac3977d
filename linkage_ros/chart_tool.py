# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Command line of linkage_chart; `lab/commands` has a file for each command."""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from importlib import import_module
from pathlib import Path

from linkage_ros import cli
from linkage_ros.parameters.presets import preset_names
from linkage_ros.quantities import Quantity

_NAME = 'linkage_chart'
# Modules of commands whose module has another name.
_MODULES = {'movie': 'motion'}
# Valid ranges of the options.
_RPM = Quantity('number', "crank speed instead of the file's", 'rpm', -1e6, 1e6)
_BESIDES = replace(_RPM, meaning="crank speeds besides the file's")
_ACCELERATION = Quantity('number', 'crank acceleration at every angle', 'rad/s^2', -1e9, 1e9)
_FLUCTUATION = Quantity(
    'number', 'largest less smallest speed over the mean, which a flywheel keeps', '', 1e-6, 1.0
)
_TOLERANCE = Quantity('number', 'error that is allowed, a share of the peak', '', 1e-9, 1.0)
_WORKERS = Quantity('whole', 'processes that do the work', '', 1, 1024)
_START = Quantity('number', 'crank speed to start from', 'rad/s', 1e-6, 1e6)

_OUT: cli.Option = (('--out',), None, {
    'type': cli.path, 'default': Path(), 'metavar': 'DIR',
    'help': 'folder for the results, which are replaced (default: this one)',
})  # fmt: skip
_QUICK: cli.Option = (('--quick',), None, {
    'action': 'store_true', 'help': 'fewer settings and cases: seconds, or a minute for stability',
})  # fmt: skip


def _commands() -> dict[str, cli.Command]:
    presets = f'parameter file, or a preset: {", ".join(preset_names())}'
    params: cli.Option = (('params',), None, {'metavar': 'PARAMS', 'help': presets})
    rpm: cli.Option = (
        ('--rpm',), _RPM, {'metavar': 'N', 'note': '; of a wind_pump, the one it settles from'}
    )  # fmt: skip
    return {
        'motion': cli.Command(
            _draw, 'position, rate, acceleration and torque over one period: PNG and CSV',
            ('quadrilateral', 'my_linkage.yaml --rpm 30 --reactions --out charts',
             'my_linkage.yaml --fluctuation 0.02', 'long_rod.yaml short_rod.yaml'),
            (
                (('params',), None,
                 {'metavar': 'PARAMS', 'nargs': '+',
                  'help': f'{presets}; several: beside each other'}),
                rpm,
                (('--acceleration',), _ACCELERATION,
                 {'default': 0.0, 'metavar': 'A', 'note': ' (default 0)'}),
                (('--fluctuation',), _FLUCTUATION,
                 {'metavar': 'F', 'note': '; adds the flywheel, and judges the motor: PNG'}),
                (('--reactions',), None,
                 {'action': 'store_true', 'help': 'add joint forces, shaking force and moment'}),
                _OUT,
            ),
        ),
        'movie': cli.Command(
            _draw, 'the mechanism as it moves, with its driving torque: GIF, or MP4 with ffmpeg',
            ('quadrilateral quadrilateral.gif', 'my_linkage.yaml my_linkage.mp4 --rpm 30'),
            (
                params,
                (('out',), None,
                 {'type': cli.path, 'metavar': 'OUT', 'help': '.gif or .mp4 file, replaced'}),
                rpm,
            ),
        ),
        'accuracy': cli.Command(
            _draw, 'speed against accuracy of all methods: PNG and JSON',
            ('--quick --out charts',), (_QUICK, _OUT),
        ),
        'stability': cli.Command(
            _draw, 'outcome of each method in the situations where some fail: PNG and JSON',
            ('--quick --out charts',), (_QUICK, _OUT),
        ),
        'economy': cli.Command(
            _draw, 'error of the torque without each of its terms: PNG and JSON',
            ('quadrilateral', 'my_linkage.yaml --rpm 30 60 --tolerance 0.02 --quick --out charts'),
            (
                (('params',), None, {'metavar': 'PARAMS', 'help': 'parameter file, or a preset'}),
                _QUICK,
                (('--rpm',), _BESIDES,
                 {'nargs': '+', 'metavar': 'N', 'note': ' (default: a quarter to four times it)'}),
                (('--tolerance',), _TOLERANCE,
                 {'default': 0.01, 'metavar': 'E', 'note': ' (default 0.01)'}),
                _OUT,
            ),
            '%(prog)s PARAMS [options]',  # after --rpm it would be parsed as a speed
        ),
        'sweep': cli.Command(
            _draw, 'many designs of one mechanism, measured and compared: CSV and PNG',
            ('tolerances.yaml', 'study.yaml --out charts --workers 8',
             'study.yaml --scheduler tcp://192.168.0.2:8786'),
            (
                (('study',), None,
                 {'metavar': 'STUDY', 'help': 'study file; see docs/sizing.md'}),
                (('--workers',), _WORKERS,
                 {'metavar': 'N', 'note': ' (default: one for each processor)'}),
                (('--scheduler',), None,
                 {'metavar': 'ADDRESS', 'help': 'Dask cluster that does the work instead'}),
                _OUT,
            ),
        ),
        'pump': cli.Command(
            _draw, 'steady states of a wind pump over start and motor torque: PNG and JSON',
            ('', 'my_pump.yaml --speeds 1 4 --quick --out charts'),
            (
                (('params',), None,
                 {'nargs': '?', 'default': 'wind_pump', 'metavar': 'PARAMS',
                  'help': 'parameter file, or a preset (default wind_pump)'}),
                _QUICK,
                (('--speeds',), _START,
                 {'nargs': '+', 'default': [2.0, 6.0], 'metavar': 'W', 'note': ' (default 2 6)'}),
                _OUT,
            ),
            '%(prog)s [PARAMS] [options]',  # after --speeds they would be parsed as speeds
        ),
    }  # fmt: skip


def _parser() -> argparse.ArgumentParser:
    parser = cli.make_parser(
        _NAME,
        'Draw the motion of a mechanism, or measurements of the methods; needs no ROS.',
        ('motion quadrilateral', 'motion my_linkage.yaml --reactions --out charts',
         'motion slider_crank --rpm 30 --acceleration 1',
         'accuracy --quick --out charts', 'stability --out charts', 'economy quadrilateral',
         'pump --out charts', 'sweep tolerances.yaml'),
    )  # fmt: skip
    cli.add_commands(parser, _commands())
    return parser


def _draw(options: argparse.Namespace) -> None:
    """Imports the module of a command and runs it."""
    name = _MODULES.get(options.command, options.command)
    getattr(import_module(f'linkage_ros.lab.commands.{name}'), options.command)(options)


def main() -> int:
    """Entry point."""
    options = _parser().parse_args()
    return cli.run(_NAME, lambda: options.run(options))


if __name__ == '__main__':
    sys.exit(main())
