# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_record: the states of a run, written to a log as fast as the machine goes."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

from tqdm import tqdm

from linkage_ros import cli
from linkage_ros.errors import ConfigurationError
from linkage_ros.log.writer import LogWriter
from linkage_ros.run.configuration import Configuration, configure, find, preset_note
from linkage_ros.run.machine import Machine
from linkage_ros.run.parameter_file import read_parameter_file
from linkage_ros.run.presets import preset_names
from linkage_ros.wire.messages import ROBOT_DESCRIPTION

_NAME = 'linkage_record'
_DEFAULT_DURATION = 10.0
_LONGEST = 1e9  # s; stamps of thirty years still fit ROS's time


def record(
    configuration: Configuration,
    path: Path | str,
    *,
    duration: float | None = None,
    revolutions: int | None = None,
    overwrite: bool = False,
    progress: bool = False,
    stopped: Callable[[], bool] = lambda: False,
) -> int:
    """Writes the states from t = 0 up to, but not including, the end; log times are stamps.

    Args:
        configuration: Of the run.
        path: The new log.
        duration: s; by default 10.
        revolutions: Turns of the crank, either way, instead of a duration.
        overwrite: Whether to replace an existing file.
        progress: Whether to show a bar on stderr.
        stopped: Asked before each state; ends the record early.

    Returns:
        The number of states written.

    Raises:
        ConfigurationError: The end is not a positive number, or is never reached.
        LogError: The file cannot be written.
    """
    machine = Machine(configuration)
    motion = machine.begin(0)
    count = _count(machine, duration, revolutions)
    with LogWriter(path, configuration, overwrite=overwrite) as log:
        *channels, description = (
            log.add_topic(topic, f'/{topic.name}')
            for topic in (*machine.topics, ROBOT_DESCRIPTION)
        )
        log.write_motion(motion)
        log.write(description, 0, machine.description)
        for tick in _shown(count, progress):
            if stopped():
                return tick
            stamp = machine.elapsed(tick)
            step = machine.step(motion, stamp)
            for channel, message in zip(channels, step.messages, strict=True):
                log.write(channel, stamp, message)
    return count


def _count(machine: Machine, duration: float | None, revolutions: int | None) -> int:
    """How many states lie in [0, T).

    Raises:
        ConfigurationError: T is not a positive number, or is never reached.
    """
    if revolutions is None:
        seconds = _DEFAULT_DURATION if duration is None else duration
        if not 0 < seconds <= _LONGEST:
            raise ConfigurationError(
                f'duration = {seconds!r}: must be a number above 0 up to {_LONGEST:g} s'
            )
        # What was typed in decimals is meant: 0.535 * 10^9 is a little more than 535000000.
        end = math.ceil(Fraction(repr(float(seconds))) * 10**9)
    else:
        if not 0 < revolutions <= _LONGEST:
            raise ConfigurationError(
                f'revolutions = {revolutions}: must be a whole number from 1 to {_LONGEST:g}'
            )
        turned = machine.begin(0).time_to_turn(revolutions)
        if turned is None:
            raise ConfigurationError(
                f'the crank comes to rest before {revolutions} revolutions: '
                'give a --duration, or an rpm other than 0'
            )
        if turned > _LONGEST * 10**9:
            raise ConfigurationError(
                f'{revolutions} revolutions take longer than {_LONGEST:g} s: '
                'give fewer, or a higher rpm'
            )
        end = turned
    return machine.tick_at(end - 1) + 1


def _shown(count: int, progress: bool) -> Iterator[int]:
    # Without a bar where stderr is no terminal (disable=None).
    bar = tqdm(
        range(count), unit=' states', unit_scale=True, disable=None if progress else True,
        mininterval=0.5, leave=False,
    )  # fmt: skip
    return iter(bar)


def _parser() -> argparse.ArgumentParser:
    parser = cli.make_parser(
        _NAME,
        'Record the exact states of a mechanism to an MCAP log; needs no ROS.',
        ('quadrilateral run.mcap', 'my_linkage.yaml run.mcap --revolutions 5 --rate 1000'),
    )
    parser.add_argument(
        'params',
        metavar='PARAMS',
        help=f'parameter file, or a preset: {", ".join(preset_names())}',
    )
    parser.add_argument('out', metavar='OUT.mcap', type=Path, help='the log to write')
    length = parser.add_mutually_exclusive_group()
    length.add_argument('--duration', type=float, metavar='S', help='seconds (default 10)')
    length.add_argument('--revolutions', type=int, metavar='N', help='turns of the crank')
    parser.add_argument('--rate', type=float, metavar='HZ', help='states a second')
    parser.add_argument('--overwrite', action='store_true', help='replace an existing file')
    return parser


def _record(options: argparse.Namespace) -> int:
    stop = cli.Stop()
    values = read_parameter_file(find(options.params))
    configuration = configure(values)
    if options.rate is not None:
        session = replace(configuration.session, rate_hz=options.rate)
        configuration = replace(configuration, session=session)
    count = record(
        configuration,
        options.out,
        duration=options.duration,
        revolutions=options.revolutions,
        overwrite=options.overwrite or configuration.session.log_overwrite,
        progress=True,
        stopped=stop.is_set,
    )
    if note := preset_note(values):
        print(note + Machine(configuration).summary())
    if stop.is_set():
        print(f'{options.out}: stopped; the first {count} states are kept')
        return cli.STOPPED_BY_USER
    seconds = count / configuration.session.rate_hz
    print(f'{options.out}: {count} states, {seconds:g} s; linkage_replay {options.out} shows it')
    return 0


def main() -> int:
    """Entry point."""
    options = _parser().parse_args()
    return cli.run(_NAME, lambda: _record(options))


if __name__ == '__main__':
    sys.exit(main())
