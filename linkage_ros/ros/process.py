# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Starts, spins and ends a program on ROS 2, and protects it from a blocked stderr."""

from __future__ import annotations

import argparse
import faulthandler
import os
import re
import sys
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

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
from linkage_ros.ros.parameters import check_parameter_files

_PIPE_SIZE = 65536  # bytes, the size of a pipe
_FLUSH_SECONDS = 1.0  # s, for the reader of our last lines
_DESTROY_SECONDS = 10.0  # s after which a node that does not end never will
_LAST_DOMAIN = 232  # for which there are ports

# What rclpy raises for command lines, files, names and values that a user got wrong. RCLError,
# which has no public name, is a RuntimeError.
USER_ERRORS = (
    RuntimeError,
    ValueError,
    InvalidParameterTypeException,
    InvalidNamespaceException,
    InvalidNodeNameException,
    InvalidTopicNameException,
)


@contextmanager
def ros_context(arguments: list[str]) -> Iterator[list[str]]:
    """Initialises rclpy and shuts it down; reports a bad command line or file in one line.

    The caller handles signals: rclpy's handlers would shut down during a tick.

    Args:
        arguments: The command line, ROS arguments included.

    Yields:
        The arguments that are not ROS's, without the program's name.

    Raises:
        ConfigurationError: rcl refuses them, or the environment.
    """
    _require_ports(os.environ.get('ROS_DOMAIN_ID', ''))
    with muted_stderr(), reported_as_configuration():
        others: list[str] = remove_ros_args(arguments)
        rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
    try:
        yield others[1:]
    finally:
        rclpy.try_shutdown()


@contextmanager
def ros_program(arguments: list[str], parser: argparse.ArgumentParser) -> Iterator[None]:
    """Runs a program that takes only ROS arguments, with rclpy and a non-blocking stderr.

    Args:
        arguments: The command line.
        parser: Knows the program's name, --help and --version.

    Yields:
        While rclpy may be used.

    Raises:
        ConfigurationError: rcl refuses an argument, a parameter file or the environment.
    """
    check_parameter_files(arguments, parser.prog)
    with nonblocking_stderr(), ros_context(arguments) as others:
        cli.refuse_arguments(parser, others)
        yield


def _require_ports(domain: str) -> None:
    """Refuses a domain without ports, for which Fast DDS would end the process.

    Args:
        domain: ROS_DOMAIN_ID; rcl refuses text that is not a number.

    Raises:
        ConfigurationError: The number is too large.
    """
    found = re.match(r'\s*\+?0*(\d+)', domain)  # as rcl reads it
    if found and int(found[1][:10]) > _LAST_DOMAIN:
        raise ConfigurationError(
            f'ROS_DOMAIN_ID = {domain}: must be a whole number from 0 to {_LAST_DOMAIN}'
        )


@contextmanager
def reported_as_configuration() -> Iterator[None]:
    """Turns errors of rclpy about user input into one-line ConfigurationErrors.

    Raises:
        ConfigurationError: rclpy's message, without its source lines.
        LinkageError: Errors of this package, unchanged.
    """
    try:
        yield
    except LinkageError:  # it says by itself what to do
        raise
    except USER_ERRORS as error:
        text = ' '.join(str(error).split())
        if text.startswith('['):  # UnknownROSArgsError names them and nothing else
            text = f'unknown ROS arguments {text}'
        text = re.sub(r'(, at \S+:\d+)+|Error: error not set', '', text)
        raise ConfigurationError(
            f'{text.rstrip(" .,")}; check the ROS arguments (--ros-args -p NAME:=VALUE, '
            '--params-file FILE, -r FROM:=TO)'
        ) from error


def _spin(executor: SingleThreadedExecutor, node: Node) -> None:
    """Spins until the end, despite exceptions such as those for parameters without a type."""
    while node.context.ok():
        try:
            executor.spin()
        except ExternalShutdownException:  # noqa: PERF203, once for each failure
            return
        except Exception as error:  # noqa: BLE001, nothing bounds what others send
            words = one_line(f'{type(error).__name__}: {error}')
            if 'timer is canceled' not in words:  # by another thread, just before its call
                node.get_logger().error(f'a callback failed: {words}', throttle_duration_sec=1.0)
        else:
            return


@contextmanager
def spinning(node: Node) -> Iterator[None]:
    """Runs a node's callbacks in a thread; destroys the node at the end.

    Args:
        node: The node.

    Yields:
        While the callbacks run.
    """
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    thread = threading.Thread(target=_spin, args=(executor, node), name='executor', daemon=True)
    thread.start()
    try:
        yield
    finally:
        executor.shutdown(timeout_sec=2.0)
        thread.join(2.0)
        # Fast DDS may never return, in C code that keeps the interpreter (eProsima/Fast-DDS#6513):
        # no thread of Python's could end the process then.
        with Path(os.devnull).open('w') as devnull:
            faulthandler.dump_traceback_later(_DESTROY_SECONDS, exit=True, file=devnull)
            node.destroy_node()
            faulthandler.cancel_dump_traceback_later()


@contextmanager
def nonblocking_stderr() -> Iterator[None]:
    """Makes stderr non-blocking, so that Ctrl-S in the terminal cannot stop the crank.

    Log lines go through a pipe of ours. Lines beyond the 64 KiB that it holds are lost, and so
    are the last ones if nobody reads them within a second of the end.
    """
    if sys.stderr is None:  # closed by `2>&-`: the log must not get its number, and its lines
        os.open(os.devnull, os.O_WRONLY)
    original = os.dup(2)
    if os.isatty(original):  # rcutils would look at our pipe
        os.environ.setdefault('RCUTILS_COLORIZED_OUTPUT', '1')
    outlet, inlet = os.pipe()
    os.set_blocking(inlet, False)
    _redirect(inlet)
    thread = threading.Thread(target=_copy, args=(outlet, original), name='stderr', daemon=True)
    thread.start()
    try:
        yield
    finally:
        _redirect(os.open(os.devnull, os.O_WRONLY))  # which ends our pipe
        thread.join(_FLUSH_SECONDS)
        if not thread.is_alive():
            _redirect(original)


@contextmanager
def muted_stderr() -> Iterator[None]:
    """Drops rcl's output about errors that it also raises: the user gets one line.

    If nothing is raised, the output is printed afterwards.
    """
    with tempfile.TemporaryFile() as held:
        original = os.dup(2)
        _redirect(os.dup(held.fileno()))
        try:
            yield
        finally:
            _redirect(original)
        held.seek(0)
        os.write(2, held.read())


def _redirect(number: int) -> None:
    """Redirects stderr to an open file."""
    with suppress(OSError, AttributeError):  # the disk is full; there is no stderr
        sys.stderr.flush()
    os.dup2(number, 2)
    os.close(number)


def _copy(outlet: int, original: int) -> None:
    """Copies a pipe to a file that may block."""
    while data := os.read(outlet, _PIPE_SIZE):
        with suppress(OSError):  # the terminal has gone, or the disk is full
            while data:
                data = data[os.write(original, data) :]
    os.close(outlet)
