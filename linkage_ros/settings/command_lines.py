# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Command lines of the programs that run on ROS, whose help needs no rclpy."""

import argparse
from dataclasses import dataclass

from linkage_ros import cli
from linkage_ros.quantities import Checked, leaves, quantity
from linkage_ros.settings.configuration import DEFAULT_PRESET
from linkage_ros.settings.help import help_on, help_on_every_kind
from linkage_ros.settings.session import JOINT_PREFIX


@dataclass(frozen=True)
class Settings(Checked):
    """The parameters of linkage_controller.

    Attributes:
        plant: Parameter file or preset of the controlled mechanism.
        rpm: Set crank speed, turns per minute.
        bandwidth: Bandwidth of the speed loop, Hz.
        feed_forward: Whether to add the exact torque.
        lead_time: Delay from a measurement to the middle of the period in which its command acts,
            s.
        joint_prefix: Prefix of the plant's joint names; None to use the prefix in its parameter
            file.
    """

    plant: str = quantity(
        'text', 'parameter file, or preset, of the controlled mechanism',
        default=DEFAULT_PRESET,
    )  # fmt: skip
    rpm: float = quantity('number', 'crank speed to keep', 'rpm', span=(-1e6, 1e6), default=150.0)
    bandwidth: float = quantity(
        'number', 'bandwidth of the speed loop', 'Hz', span=(0.0, 1e6), default=15.0
    )
    feed_forward: bool = quantity('switch', 'whether the exact torque is added', default=True)
    lead_time: float = quantity(
        'number', 'delay from a measurement to the middle of the period of its command', 's',
        span=(0.0, 10.0), default=0.0015,
    )  # fmt: skip
    joint_prefix: str | None = quantity(
        'text', "prefix of the plant's joints; default: joint_prefix in plant's parameter file",
        pattern=JOINT_PREFIX, default=None,
    )  # fmt: skip


PARAMETERS = leaves(Settings)


def node_parser() -> argparse.ArgumentParser:
    """Makes the parser of linkage_node."""
    return cli.make_parser(
        'linkage_node',
        'Turn the crank of a linkage on ROS 2; publish its states and the driving torque.',
        ('', '--ros-args -p rpm:=60.0 -p log:=run.mcap',
         '--ros-args -p drive:=torque -p motor.torque:=9.0 -p motor.damping:=0.5',
         '--ros-args --params-file linkage.yaml -r joint_states:=linkage/joint_states'),
        help_on_every_kind(),
    )  # fmt: skip


def controller_parser() -> argparse.ArgumentParser:
    """Makes the parser of linkage_controller."""
    return cli.make_parser(
        'linkage_controller',
        'Keep a torque-driven crank at a speed.',
        ('', '--ros-args -p rpm:=600.0 -p feed_forward:=false'),
        'parameters:\n' + help_on(PARAMETERS),
    )


PARSERS = {'node.linkage_node': node_parser, 'programs.controller': controller_parser}
