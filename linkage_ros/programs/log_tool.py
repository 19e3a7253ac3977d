# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_log: describes, verifies or recovers a log, or writes it as a table."""

import argparse
import sys
from pathlib import Path

from linkage_ros import cli

_NAME = 'linkage_log'


def _run(options: argparse.Namespace) -> int | None:
    from linkage_ros.programs.log_commands import COMMANDS  # --help needs no NumPy

    return COMMANDS[options.command](options)


_LOG: cli.Option = (
    ('log',), None, {'metavar': 'LOG.mcap', 'type': Path, 'help': 'log of linkage_ros'}
)  # fmt: skip
_COMMANDS = {
    'info': cli.Command(
        _run, 'topics, counts, times, configuration, mechanism', ('run.mcap',), (_LOG, cli.JSON)
    ),
    'verify': cli.Command(
        _run,
        'recompute every state from the logged configuration and motions; exit code 0: all are '
        'equal to the bit or within 4 ulp, 1: one differs, 2: the log cannot be read',
        ('run.mcap',), (_LOG,),
    ),
    'recover': cli.Command(
        _run,
        'save the readable data of an incomplete or damaged log; exit code 1: no message found',
        ('run.mcap saved.mcap',),
        (_LOG,
         (('out',), None,
          {'metavar': 'OUT.mcap', 'type': Path, 'help': 'the complete log to write'}),
         cli.OVERWRITE),
    ),
    'csv': cli.Command(
        _run,
        'write the joint states of a log, or of a bag of another program, as a table',
        ('run.mcap run.csv', 'run.mcap - | head', 'robot.mcap robot.csv --topic /joint_states'),
        ((('log',), None,
          {'metavar': 'LOG', 'type': Path, 'help': 'an MCAP file, or a rosbag2 folder'}),
         (('out',), None,
          {'metavar': 'OUT.csv', 'type': Path, 'help': 'the table to write; - prints it'}),
         (('--topic',), None,
          {'metavar': 'NAME', 'default': '', 'help': 'topic of the joint states (default: the '
           'states of a log, or the only such topic of a bag)'}),
         cli.OVERWRITE),
    ),
}  # fmt: skip


def _parser() -> argparse.ArgumentParser:
    parser = cli.make_parser(
        _NAME,
        'Describe, verify or recover a log of linkage_ros, or write it as a table.',
        (
            'info run.mcap',
            'verify run.mcap',
            'recover run.mcap saved.mcap',
            'csv run.mcap run.csv',
        ),
    )
    cli.add_commands(parser, _COMMANDS)
    return parser


def main() -> int:
    """Runs `linkage_log`; returns the exit code. `cli.run` reports its errors."""
    options = _parser().parse_args()
    code: int = options.run(options) or 0
    return code


if __name__ == '__main__':
    sys.exit(cli.run(_NAME, main))
