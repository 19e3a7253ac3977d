# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What every executable does alike with rclpy."""

from __future__ import annotations

import subprocess
import sys

import pytest
from ros_harness import environment, fresh_domain

STUCK = """
import rclpy
from rclpy.node import Node
from linkage_ros.ros import session

session._STUCK = 0.5
rclpy.init()

class Stuck(Node):
    def destroy_node(self):
        ''.join('' for _ in range({turns}))  # holds the interpreter for ever, or not at all
        super().destroy_node()

with session.served(Stuck('stuck')):
    print('all is logged', flush=True)
rclpy.try_shutdown()
"""


@pytest.mark.parametrize(('turns', 'code'), [('10**15', 1), ('10', 0)])
def test_a_node_that_never_ends_is_ended(turns, code):
    done = subprocess.run(
        [sys.executable, '-c', STUCK.format(turns=turns)], env=environment(fresh_domain()),
        capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip
    assert done.returncode == code, done.stderr
    assert done.stdout == 'all is logged\n'
    assert done.stderr == ''
