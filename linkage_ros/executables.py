# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The entry points: each imports its program only when it is run.

Importing rclpy takes most of a start-up. Ctrl-C meanwhile ends the program without a traceback,
and a missing rclpy is one line.
"""

from __future__ import annotations

import sys
from importlib import import_module

from linkage_ros.cli import STOPPED_BY_USER, leave


def node() -> int:
    """linkage_node."""
    return _start('linkage_node', 'node')


def record() -> int:
    """linkage_record."""
    return _start('linkage_record', 'record')


def replay() -> int:
    """linkage_replay."""
    return _start('linkage_replay', 'replay')


def log() -> int:
    """linkage_log."""
    return _start('linkage_log', 'log_tool')


def chart() -> int:
    """linkage_chart."""
    return _start('linkage_chart', 'chart_tool')


def controller() -> int:
    """linkage_controller."""
    return _start('linkage_controller', 'controller')


def _start(name: str, module: str) -> int:
    try:
        program = import_module(f'linkage_ros.{module}')
        return leave(program.main())
    except KeyboardInterrupt:
        return STOPPED_BY_USER
    except ModuleNotFoundError as error:
        missing = (error.name or '').partition('.')[0]
        cure = (
            "source ROS 2 Jazzy, or on Linux x86-64 pip install 'linkage_ros[ros]'"
            if missing.startswith('rcl') or missing.endswith('_msgs')
            else f'pip install {missing}'
        )
        print(f'{name}: {missing} is not installed: {cure}', file=sys.stderr)
        return 2
