# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Entry points of the executables, which import their programs only when called.

Importing rclpy takes most of the start-up time. Importing it inside `cli.run` ensures that Ctrl-C
during the import prints no traceback, and that a missing rclpy is reported in one line.

Public: other packages may import this module.
"""

from functools import partial
from importlib import import_module

from linkage_ros import cli


def _start(name: str, module: str) -> int:
    return cli.leave(cli.run(name, lambda: _main(module)))


def _main(module: str) -> int | None:
    if module in {'node.linkage_node', 'programs.controller'}:  # --help needs no rclpy
        from linkage_ros.settings.help import PARSERS

        PARSERS[module]().parse_known_args()
    code: int | None = import_module(f'linkage_ros.{module}').main()
    return code


node = partial(_start, 'linkage_node', 'node.linkage_node')
record = partial(_start, 'linkage_record', 'programs.record')
replay = partial(_start, 'linkage_replay', 'programs.replay')
log = partial(_start, 'linkage_log', 'programs.log_tool')
controller = partial(_start, 'linkage_controller', 'programs.controller')
