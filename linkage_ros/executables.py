# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Entry points of the executables, which import their programs only when called.

Importing rclpy takes most of the start-up time. Importing it inside `cli.run` ensures that Ctrl-C
during the import prints no traceback, and that a missing rclpy is reported in one line.
"""

from functools import partial
from importlib import import_module

from linkage_ros import cli


def _start(name: str, module: str) -> int:
    return cli.run(name, lambda: cli.leave(_main(module)))


def _main(module: str) -> int:
    if module in {'node', 'controller'}:  # --help needs no rclpy
        from linkage_ros.parameters.command_lines import PARSERS

        PARSERS[module]().parse_known_args()
    code: int = import_module(f'linkage_ros.{module}').main()
    return code


node = partial(_start, 'linkage_node', 'node')
record = partial(_start, 'linkage_record', 'record')
replay = partial(_start, 'linkage_replay', 'replay')
log = partial(_start, 'linkage_log', 'log_tool')
export = partial(_start, 'linkage_export', 'export_tool')
chart = partial(_start, 'linkage_chart', 'chart_tool')
controller = partial(_start, 'linkage_controller', 'controller')
