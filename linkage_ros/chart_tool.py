# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_chart: pictures and tables of what a mechanism does."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from linkage_ros import cli
from linkage_ros.chart_motion import motion
from linkage_ros.chart_output import about, folder, libraries, progress, save
from linkage_ros.core.mechanism import Linkage, WindPump
from linkage_ros.errors import ConfigurationError
from linkage_ros.methods.problems import ChartMechanisms
from linkage_ros.motion.drives import Motor, TorqueDrive
from linkage_ros.parameters.configuration import find_file, load
from linkage_ros.parameters.presets import preset_names

_NAME = 'linkage_chart'


def _preset(name: str) -> Linkage:
    """The mechanism of a preset that a crank angle describes."""
    mechanism = load(name).mechanism
    assert not isinstance(mechanism, WindPump)  # noqa: S101
    return mechanism


def accuracy(options: argparse.Namespace) -> None:
    """Measures speed and accuracy of all methods, draws them and writes the records.

    Args:
        options: Of the command line.

    Raises:
        ConfigurationError: The folder cannot be written.
    """
    with libraries():
        from linkage_ros.charts.accuracy import draw_accuracy
        from linkage_ros.charts.integration import draw_integration
        from linkage_ros.methods.accuracy import measure_accuracy, tasks
        from linkage_ros.methods.bench import Bench
        from linkage_ros.methods.motion_accuracy import measure_motion_accuracy
    quadrilateral, slider_crank = (_preset(name) for name in ('quadrilateral', 'slider_crank'))
    with folder(options.out):
        benches = {
            name: Bench(task, 120 if options.quick else 360)
            for name, task in tasks(quadrilateral, slider_crank).items()
        }
        points = measure_accuracy(benches, quick=options.quick, progress=progress)
        moved = measure_motion_accuracy(_mechanisms(), quick=options.quick, progress=progress)
        on = ', '.join(f'{name} {value}' for name, value in about().items())
        save(options.out / 'accuracy.json', [point.record() for point in (*points, *moved)])
        for name in benches:
            path = options.out / f'accuracy_{name.replace(" ", "_")}.png'
            title = f'Speed against accuracy: {name.replace("_", "-")}\n{on}'
            draw_accuracy([point for point in points if point.mechanism == name], title, path)
            print(path)
        path = options.out / 'accuracy_motions.png'
        title = f'Speed against accuracy: motions under a torque\n{on}'
        draw_integration(moved, title, path)
        print(path)


def stability(options: argparse.Namespace) -> None:
    """Runs all methods through all situations, draws what comes of it and writes the records.

    Args:
        options: Of the command line.

    Raises:
        ConfigurationError: The folder cannot be written.
    """
    with libraries():
        from linkage_ros.charts.stability import draw_stability
        from linkage_ros.methods.motion_outcomes import measure_motion_outcomes
        from linkage_ros.methods.outcomes import measure_outcomes
        from linkage_ros.methods.situations import SITUATIONS
    with folder(options.out):
        cases = 6 if options.quick else 30
        cells = measure_outcomes(SITUATIONS, cases=cases, progress=progress)
        moved = measure_motion_outcomes(_mechanisms(), cases=cases, progress=progress)
        save(options.out / 'stability.json', [cell.record() for cell in (*cells, *moved)])
        title = (
            'What comes of each method in each situation\n'
            f'the worst of {cases} cases, or of a few motions, and the largest relative error'
        )
        draw_stability(cells, moved, title, options.out / 'stability.png')
    print(options.out / 'stability.png')


def _mechanisms() -> ChartMechanisms:
    """What moves in the charts: the presets, the pump with its motor."""
    pump = load('wind_pump')
    motor = pump.drive.motor if isinstance(pump.drive, TorqueDrive) else Motor()
    return ChartMechanisms.of(load('quadrilateral').mechanism, pump.mechanism, motor)


def pump(options: argparse.Namespace) -> None:
    """Finds what a wind pump settles at, draws it and writes the numbers.

    Args:
        options: Of the command line.

    Raises:
        ConfigurationError: It is no wind pump, or the folder cannot be written.
    """
    with libraries():
        from linkage_ros.analysis.pump import analyse
        from linkage_ros.analysis.states_table import states_table
        from linkage_ros.charts.pump import draw_pump
    configuration = load(options.params)
    mechanism, drive = configuration.mechanism, configuration.drive
    if not (isinstance(mechanism, WindPump) and isinstance(drive, TorqueDrive)):
        raise ConfigurationError(f'{options.params} is no wind_pump: try the preset wind_pump')
    name = find_file(options.params).stem
    title = f'{name}: {drive.motor.words()}'
    picture = options.out / f'{name}_settled.png'
    with folder(options.out):
        found = analyse(
            mechanism, drive.motor,
            speeds=options.speeds, quick=options.quick, progress=progress,
        )  # fmt: skip
        save(options.out / f'{name}_settled.json', [found.record()])
        draw_pump(found, title, picture)
    print(*states_table(found), picture, sep='\n')


def _parser() -> argparse.ArgumentParser:
    parser = cli.make_parser(
        _NAME,
        'Draw what a mechanism does; needs no ROS.',
        ('motion quadrilateral', 'motion my_linkage.yaml --reactions --out charts',
         'motion slider_crank --rpm 30 --acceleration 1',
         'accuracy --quick --out charts', 'stability --out charts', 'pump --out charts'),
    )  # fmt: skip
    commands = parser.add_subparsers(dest='command', required=True, metavar='COMMAND')
    _add_motion(commands)
    for draw, purpose in (
        (accuracy, 'speed against accuracy of all methods: PNG and JSON'),
        (stability, 'what comes of all methods where some of them fail: PNG and JSON'),
    ):
        _add_measured(commands, draw, purpose, '--quick --out charts')
    _add_pump(commands)
    return parser


def _add(
    commands: Any, draw: Callable[[argparse.Namespace], None], purpose: str, *examples: str
) -> argparse.ArgumentParser:
    """A command of the name of what draws it, with what all have."""
    command = cli.add_command(commands, _NAME, draw.__name__, purpose, examples)
    command.add_argument(
        '--out', type=Path, default=Path(), metavar='DIR',
        help='folder for the results, which are replaced (default: this one)',
    )  # fmt: skip
    command.set_defaults(draw=draw)
    return command


def _add_motion(commands: Any) -> None:
    command = _add(
        commands, motion, 'position, rate, acceleration and torque over one period: PNG and CSV',
        'quadrilateral', 'my_linkage.yaml --rpm 30 --reactions --out charts',
    )  # fmt: skip
    add = command.add_argument
    # fmt: off
    add('params', metavar='PARAMS',
        help=f'parameter file, or a preset: {", ".join(preset_names())}')
    add('--rpm', type=float, metavar='N',
        help="crank speed instead of the file's, rpm; of a wind_pump, the one it settles from")
    add('--acceleration', type=float, default=0.0, metavar='A',
        help='crank acceleration at every angle, rad/s^2 (default 0)')
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


def _add_pump(commands: Any) -> None:
    command = _add_measured(
        commands, pump, 'what a wind pump settles at, from where, for which torques: PNG and JSON',
        '', 'my_pump.yaml --speeds 1 4 --quick --out charts',
    )  # fmt: skip
    command.usage = '%(prog)s [PARAMS] [options]'  # behind --speeds they would be one of them
    add = command.add_argument
    # fmt: off
    add('params', nargs='?', default='wind_pump', metavar='PARAMS',
        help='parameter file, or a preset (default wind_pump)')
    add('--speeds', type=float, nargs='+', default=[2.0, 6.0], metavar='W',
        help='crank speeds to start from, rad/s (default 2 6)')
    # fmt: on


def main() -> int:
    """Entry point."""
    options = _parser().parse_args()
    return cli.run(_NAME, lambda: options.draw(options))


if __name__ == '__main__':
    sys.exit(main())
