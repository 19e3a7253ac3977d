# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Starts, spins and ends a program on ROS 2."""

import argparse
import faulthandler
import itertools
import math
import os
import re
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import rclpy
from rclpy.exceptions import (
    InvalidNamespaceException,
    InvalidNodeNameException,
    InvalidParameterTypeException,
    InvalidTopicNameException,
)
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args

from linkage_ros import cli
from linkage_ros.errors import ConfigurationError, LinkageError, one_line
from linkage_ros.files import path_exists
from linkage_ros.node.stderr import muted_stderr, nonblocking_stderr
from linkage_ros.node.workers import accompany_ticker, show_name
from linkage_ros.settings.package_names import read_own_parameters
from linkage_ros.settings.presets import preset_names, preset_path

# A process whose node takes longer to end is killed; the shorter time is for an urgent end.
_DESTROY_SECONDS, _URGENT_SECONDS = 10.0, 2.0
_REPORT_SECONDS = 1.0  # shortest time between two reports of the same kind

# Errors of rclpy for invalid command lines, files, names and values. RCLError has no public name,
# but is a RuntimeError.
USER_ERRORS = (
    RuntimeError,
    ValueError,
    InvalidParameterTypeException,
    InvalidNamespaceException,
    InvalidNodeNameException,
    InvalidTopicNameException,
)


class Throttle:
    """Limits how often a recurring problem is reported.

    rclpy's throttled logger takes 0.2 to 0.7 ms for each call that it suppresses, which costs
    ticks.
    """

    def __init__(self) -> None:
        self._next = -math.inf  # s on the monotonic clock

    def is_due(self) -> bool:
        """Returns whether to report now, at most once a second."""
        now = time.monotonic()
        if now < self._next:
            return False
        self._next = now + _REPORT_SECONDS
        return True


def run_program(
    arguments: list[str], parser: argparse.ArgumentParser, make: Callable[[cli.Stop], Any]
) -> int:
    """Runs a node that takes only ROS arguments.

    Args:
        arguments: The command line.
        parser: Parser with the program's name, --help and --version.
        make: Creates the node, whose method `work` runs until the end and returns an exit code.

    Returns:
        The exit code.

    Raises:
        ConfigurationError: rcl refuses an argument, a parameter file or the environment.
    """
    stop = cli.Stop()
    _check_parameter_files(arguments, parser.prog)
    with nonblocking_stderr(), ros_context(arguments) as others:
        _, unknown = parser.parse_known_args(others)
        if unknown:
            parser.error(
                f'unknown: {" ".join(unknown)}; parameters follow --ros-args, as in '
                f'`{parser.prog} --ros-args -p rpm:=60.0`'
            )
        node = make(stop)
        with spinning(node, stop.is_urgent):
            code: int = node.work()
    return code


def _check_parameter_files(arguments: list[str], node: str) -> None:
    """Checks parameter files before rcl reads them.

    rcl would ignore a file without parameters of the node, which would then run with defaults. The
    arguments may change the name of the node.

    Raises:
        ConfigurationError: A file has an error or no parameters of the node, or a preset is given
            instead of a path.
    """
    name = full_name(arguments, node)
    for option, path in itertools.pairwise(arguments):
        if option == '--params-file':
            if path in preset_names() and not path_exists(path):
                raise ConfigurationError(
                    f'{path} is a preset, and --params-file takes a path: {preset_path(path)}'
                )
            # A pipe can be read only once, and rcl has to read it.
            if path_exists(path) and not Path(path).is_file():
                raise ConfigurationError(
                    f'{path} is not a file: give the path of a parameter file'
                )
            read_own_parameters(path, name, for_ros=True)


def full_name(arguments: list[str], node: str) -> str:
    """Returns the name that rcl gives to a node, with its namespace.

    The first rule for the name that applies is used, and likewise for the namespace.
    """

    def rule(kind: str, name: str) -> str:
        pattern = f'(?:{re.escape(name)}:)?__(?:{kind}):=(.+)'
        matches = (re.fullmatch(pattern, text) for text in arguments)
        return next((match[1] for match in matches if match), '')

    name = rule('node|name', node) or node
    return f'{rule("ns", name)}/{name}'


@contextmanager
def ros_context(arguments: list[str]) -> Iterator[list[str]]:
    """Initialises rclpy and shuts it down; reports an invalid command line or file in one line.

    The caller handles signals, because rclpy's handlers would shut down during a tick.

    Yields:
        The arguments that are not for ROS, without the program's name.

    Raises:
        ConfigurationError: rcl refuses the arguments or the environment.
    """
    with muted_stderr(), reported_as_configuration():
        others: list[str] = remove_ros_args(arguments)
        rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
    try:
        yield others[1:]
    finally:
        rclpy.try_shutdown()


@contextmanager
def rclpy_internals() -> Iterator[None]:
    """Reports in one line that rclpy lacks a name which is not part of its public interface.

    Raises:
        ConfigurationError: This version of rclpy differs from that of ROS 2 Jazzy.
    """
    try:
        yield
    except (ImportError, AttributeError, TypeError) as error:
        raise ConfigurationError(
            f'this rclpy is not that of ROS 2 Jazzy, version 7.1 ({one_line(str(error))}): '
            'install and source ROS 2 Jazzy'
        ) from error


@contextmanager
def reported_as_configuration() -> Iterator[None]:
    """Converts errors of rclpy about user input to one-line ConfigurationErrors.

    Raises:
        ConfigurationError: rclpy's message, without its source lines.
        LinkageError: Errors of this package, unchanged.
    """
    try:
        yield
    except LinkageError:  # its message is already clear
        raise
    except USER_ERRORS as error:
        text = re.sub(r'(, at \S+:\d+)+|Error: error not set', '', ' '.join(str(error).split()))
        if text.startswith('['):  # the message of UnknownROSArgsError is only the arguments
            text = f'unknown ROS arguments {text}'
        cure = (
            'check the environment of ROS, such as ROS_DOMAIN_ID and ROS_LOG_DIR'
            if text.startswith('failed to initialize')
            else 'check the ROS arguments (--ros-args -p NAME:=VALUE, --params-file FILE, '
            '-r FROM:=TO)'
        )
        raise ConfigurationError(f'{text.rstrip(" .,")}; {cure}') from error


def _spin(executor: SingleThreadedExecutor, node: Node, ends: threading.Event) -> None:
    """Spins until `ends` is set; continues after exceptions, as for untyped parameters."""
    show_name()
    accompany_ticker()  # a tick may wait for the interpreter lock that the callbacks hold
    throttle = Throttle()
    while not ends.is_set():
        try:
            executor.spin_once()
        except ExternalShutdownException:  # noqa: PERF203, once for each failure
            return
        except Exception as error:  # noqa: BLE001, other nodes may send anything
            words = one_line(f'{type(error).__name__}: {error}')
            # A timer may be cancelled just before the call, and the node destroyed during it.
            is_expected = 'timer is canceled' in words or ends.is_set()
            if not is_expected and throttle.is_due():
                node.get_logger().error(f'a callback failed: {words}')


@contextmanager
def spinning(node: Node, is_urgent: Callable[[], bool] = lambda: False) -> Iterator[None]:
    """Runs a node's callbacks in a thread during the block; destroys the node at the end.

    `is_urgent` returns whether to abandon threads that hang.
    """
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)
    ends = threading.Event()
    thread = threading.Thread(
        target=_spin, args=(executor, node, ends), name='executor', daemon=True
    )
    thread.start()
    try:
        yield
    finally:
        ends.set()
        executor.shutdown(timeout_sec=2.0)
        thread.join(2.0)
        # Fast DDS may hang in C code that holds the interpreter lock (eProsima/Fast-DDS#6513).
        # Then no Python thread could end the process.
        seconds = _URGENT_SECONDS if is_urgent() else _DESTROY_SECONDS
        with Path(os.devnull).open('w') as devnull:
            faulthandler.dump_traceback_later(seconds, exit=True, file=devnull)
            node.destroy_node()
            faulthandler.cancel_dump_traceback_later()
