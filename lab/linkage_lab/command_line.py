# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_chart: draws the motion of a mechanism, or compares methods.

The modules in `charts` implement its commands.
"""

import argparse
import sys
from importlib import import_module
from pathlib import Path

from linkage_ros import cli, preset_names
from linkage_ros.quantities import Quantity, did_you_mean, shown

_NAME = 'linkage_chart'
FORMATS = 'png', 'svg', 'pdf'
# Diagrams of `linkage_chart motion`.
QUANTITIES = 'position', 'velocity', 'acceleration', 'torque', 'load', 'point'
KINDS = 'four_bar', 'slider_crank', 'inverted_slider_crank', 'wind_pump', 'drawing'
DEFAULT = 'position', 'torque', 'load'
_PLACE = Quantity(
    'number',
    'crank angle, also written 85deg, or position of a driven slide',
    'rad or m',
    -1e6,
    1e6,
)
_RPM = Quantity('number', 'crank speed', 'rpm', -1e6, 1e6)


def _formats(text: str) -> tuple[str, ...]:
    formats = tuple(text.split(','))
    if not set(formats) <= set(FORMATS):
        raise argparse.ArgumentTypeError(f'{shown(text)}: must be of {",".join(FORMATS)}')
    return formats


def _quantity(text: str) -> str:
    if text not in QUANTITIES:
        hint = did_you_mean(text, QUANTITIES) or '; PARAMS must be before --show'
        raise argparse.ArgumentTypeError(
            f'{shown(text)}: must be of {", ".join(QUANTITIES)}{hint}'
        )
    return text


_LINKAGE: cli.Option = (('--linkage',), None, {
    'metavar': 'NAME', 'default': '', 'help': 'the linkage, if PARAMS has several',
})  # fmt: skip
_OUT: cli.Option = (('--out',), None, {
    'type': Path, 'default': Path(), 'metavar': 'DIR',
    'help': 'folder for the results, created if needed (default: the current folder)',
})  # fmt: skip
_FORMAT: cli.Option = (('--format',), None, {
    'type': _formats, 'default': ('png',), 'metavar': 'F',
    'help': f'formats of the pictures, of {",".join(FORMATS)} (default png)',
})  # fmt: skip
_QUICK: cli.Option = (('--quick',), None, {
    'action': 'store_true', 'help': 'fewer settings and cases, in a fraction of the time',
})  # fmt: skip


def _parser() -> argparse.ArgumentParser:
    parser = cli.make_parser(
        _NAME,
        'Draw the motion of a mechanism, or compare methods of solving it; needs no ROS.',
        ('motion quadrilateral', 'motion my_linkage.yaml --reactions --out charts',
         'motion slider_crank --rpm 30 --acceleration 1',
         'accuracy --quick --out charts', 'stability --out charts', 'economy quadrilateral',
         'pump --out charts', 'sweep tolerances.yaml'),
    )  # fmt: skip
    presets = f'parameter file, or a preset: {", ".join(preset_names())}'
    params = {'metavar': 'PARAMS', 'help': presets}
    note = " (default: the file's); for a wind_pump, its initial speed"
    rpm: cli.Option = (('--rpm',), _RPM, {'metavar': 'N', 'note': note})
    cli.add_commands(parser, {
        'new': cli.Command(
            _run, 'a parameter file to start from, on standard output',
            ('drawing > my_linkage.yaml', 'four_bar'),
            (
                (('kind',), None,
                 {'metavar': 'KIND', 'help': f'one of {", ".join(KINDS)}'}),
            ),
        ),
        'sketch': cli.Command(
            _run, 'what a parameter file means: the linkage with all names, and in words',
            ('shaper', 'my_linkage.yaml --dimensions --at 85deg --out charts'),
            (
                (('params',), None, params), _LINKAGE,
                (('--at',), _PLACE,
                 {'metavar': 'PLACE', 'note': ' (default: as drawn, or a place that shows all)'}),
                (('--dimensions',), None,
                 {'action': 'store_true', 'help': 'add the lengths of the links'}),
                _OUT, _FORMAT, cli.OVERWRITE,
            ),
        ),
        'state': cli.Command(
            _run, 'motion, torque and joint forces at one position, for every assembly: table',
            ('quadrilateral --at 85deg', 'excavator --at 1.2 --speed 0.1',
             'my_linkage.yaml --at 85deg --rpm 30 --csv state.csv'),
            (
                (('params',), None, params), _LINKAGE,
                (('--at',), _PLACE,
                 {'metavar': 'PLACE', 'note': ' (default: the start, or as drawn)'}),
                rpm,
                (('--speed',),
                 Quantity('number', 'speed of a driven slide or cylinder', 'm/s', -1e6, 1e6),
                 {'metavar': 'V', 'note': ' (default 0)'}),
                (('--acceleration',),
                 Quantity('number', 'acceleration of the driven joint', 'rad/s^2 or m/s^2',
                          -1e9, 1e9),
                 {'default': 0.0, 'metavar': 'A', 'note': ' (default 0)'}),
                (('--csv',), None,
                 {'type': Path, 'metavar': 'OUT', 'help': 'also write a CSV file; - prints it'}),
                cli.OVERWRITE, cli.JSON,
            ),
        ),
        'motion': cli.Command(
            _run, 'position, torque and load over one period: picture and CSV',
            ('quadrilateral', 'my_linkage.yaml --rpm 30 --reactions --out charts',
             'my_linkage.yaml --fluctuation 0.02', 'long_rod.yaml short_rod.yaml',
             'robot.yaml --linkage left --linkage right'),
            (
                (('params',), None,
                 {'metavar': 'PARAMS', 'nargs': '+',
                  'help': f'{presets}; several are compared'}),
                (('--linkage',), None,
                 {'metavar': 'NAME', 'action': 'append', 'default': [],
                  'help': 'the linkage, if PARAMS has several; repeat it to compare them'}),
                rpm,
                (('--acceleration',),
                 Quantity('number', 'crank acceleration at every angle', 'rad/s^2', -1e9, 1e9),
                 {'default': 0.0, 'metavar': 'A', 'note': ' (default 0)'}),
                (('--fluctuation',),
                 Quantity('number', 'coefficient of fluctuation, (largest - smallest speed) / '
                          'mean, that a flywheel must keep', '', 1e-6, 1.0),
                 {'metavar': 'F', 'note': '; sizes the flywheel and checks the motor'}),
                (('--show',), None,
                 {'nargs': '+', 'type': _quantity, 'default': DEFAULT, 'metavar': 'Q',
                  'help': f'diagrams to draw, of {", ".join(QUANTITIES)} (default '
                  f'{" ".join(DEFAULT)})'}),
                (('--csv',),
                 Quantity('number', 'step of the crank angle in the table, deg; its angles are in '
                          'degrees, and it has the coordinates of the pins', '', 0.01, 180.0),
                 {'metavar': 'STEP', 'note': ' (default: about 0.5 deg, in SI units)'}),
                (('--dimensions',), None,
                 {'action': 'store_true', 'help': 'add the lengths of the links to the sketch'}),
                (('--reactions',), None,
                 {'action': 'store_true', 'help': 'add joint forces, shaking force and moment'}),
                _OUT, _FORMAT, cli.OVERWRITE, cli.JSON,
            ),
        ),
        'movie': cli.Command(
            _run, 'the mechanism as it moves, with its driving torque: a page for a browser, GIF, '
            'or MP4 with ffmpeg',
            ('wiper wiper.html', 'quadrilateral quadrilateral.gif',
             'my_linkage.yaml my_linkage.mp4 --rpm 30'),
            (
                (('params',), None, params), _LINKAGE,
                (('out',), None,
                 {'type': Path, 'metavar': 'OUT', 'help': '.html, .gif or .mp4 file'}),
                rpm, cli.OVERWRITE,
            ),
        ),
        'accuracy': cli.Command(
            _run, 'speed against accuracy of all methods: pictures and JSON',
            ('--quick --out charts',), (_QUICK, _OUT, _FORMAT, cli.OVERWRITE),
        ),
        'stability': cli.Command(
            _run, 'outcome of each method in the situations where some fail: pictures and JSON',
            ('--quick --out charts',), (_QUICK, _OUT, _FORMAT, cli.OVERWRITE),
        ),
        'economy': cli.Command(
            _run, 'error of the torque without each of its terms: pictures and JSON',
            ('quadrilateral', 'my_linkage.yaml --rpm 30 60 --tolerance 0.02 --quick --out charts'),
            (
                (('params',), None, params), _LINKAGE,
                _QUICK,
                (('--rpm',), _RPM,
                 {'nargs': '+', 'metavar': 'N',
                  'note': "; the file's speed is added (default: a quarter to four times it)"}),
                (('--tolerance',),
                 Quantity('number', 'allowed error, relative to the peak torque', '', 1e-9, 1.0),
                 {'default': 0.01, 'metavar': 'E', 'note': ' (default 0.01)'}),
                _OUT, _FORMAT, cli.OVERWRITE,
            ),
            '%(prog)s PARAMS [options]',  # after --rpm, PARAMS would be parsed as a speed
        ),
        'sweep': cli.Command(
            _run, 'many designs of one mechanism, measured and compared: CSV and picture',
            ('tolerances.yaml', 'study.yaml --out charts --workers 8',
             'study.yaml --scheduler tcp://192.168.0.2:8786'),
            (
                (('study',), None,
                 {'metavar': 'STUDY', 'help': 'study file; see lab/docs/designs.md'}),
                (('--workers',), Quantity('whole', 'number of worker processes', '', 1, 1024),
                 {'metavar': 'N', 'note': ' (default: one for each processor)'}),
                (('--scheduler',), None,
                 {'metavar': 'ADDRESS', 'help': 'use the Dask cluster at this address instead'}),
                _OUT, _FORMAT, cli.OVERWRITE, cli.JSON,
            ),
        ),
        'pump': cli.Command(
            _run, 'steady states of a wind pump by start speed and motor torque: picture and JSON',
            ('', 'my_pump.yaml --speeds 1 4 --quick --out charts'),
            (
                (('params',), None,
                 {'nargs': '?', 'default': 'wind_pump', 'metavar': 'PARAMS',
                  'help': 'parameter file, or a preset (default wind_pump)'}),
                _LINKAGE,
                _QUICK,
                (('--speeds',),
                 Quantity('number', 'initial crank speed', 'rad/s', 1e-6, 1e6),
                 {'nargs': '+', 'default': [2.0, 6.0], 'metavar': 'W', 'note': ' (default 2 6)'}),
                _OUT, _FORMAT, cli.OVERWRITE,
            ),
            '%(prog)s [PARAMS] [options]',  # after --speeds, PARAMS would be parsed as a speed
        ),
    })  # fmt: skip
    return parser


def _run(options: argparse.Namespace) -> None:
    """Imports the module of a command and runs it."""
    name = f'linkage_lab.charts.{options.command}'
    run = getattr(import_module(name), options.command)
    with cli.working(f'{_NAME} {options.command}'):
        run(options)


def main() -> int:
    """Runs `linkage_chart`; returns the exit code."""
    options = _parser().parse_args()
    return cli.run(_NAME, lambda: options.run(options))


if __name__ == '__main__':
    sys.exit(main())
