# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Command lines of the programs that run on ROS, whose help needs no rclpy."""

import argparse

from linkage_ros import cli
from linkage_ros.settings.controller import PARAMETERS
from linkage_ros.settings.help import help_on, help_on_every_kind


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
