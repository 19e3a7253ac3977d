# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How every program on ROS 2 starts and ends: rclpy, and what it refuses, as one clear error."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager

import rclpy
from rclpy.exceptions import (
    InvalidNamespaceException,
    InvalidNodeNameException,
    InvalidParameterTypeException,
    InvalidTopicNameException,
)
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args

from linkage_ros.errors import ConfigurationError, LinkageError
from linkage_ros.ros.stderr import muted_stderr

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
def on_ros(arguments: list[str]) -> Iterator[list[str]]:
    """Initialises rclpy, and shuts it down; a bad command line or file is one clear error.

    Signals stay the caller's: rclpy's handlers would end the context under a running tick.

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
    """Turns what rclpy raises for a user's slip into a ConfigurationError of one line.

    Raises:
        ConfigurationError: With rclpy's words, without its source lines.
        LinkageError: One of ours, as it is.
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
