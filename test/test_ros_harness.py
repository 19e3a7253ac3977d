# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What keeps tests apart that run at the same time."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from ros_harness import Listener, clear_ports, environment, fresh_domain

NODE = 'import rclpy; rclpy.init(); rclpy.create_node("x")'


def test_a_domain_in_which_somebody_listens_is_nobody_elses():
    domain = fresh_domain()
    with Listener(domain, {}):
        others = [fresh_domain() for _ in range(50)]
    assert domain not in others
    assert domain in [fresh_domain() for _ in range(50)]  # free again


@pytest.mark.parametrize('cleared', [True, False])
def test_a_port_that_a_killed_process_left_half_made_stops_nobody_once_it_is_removed(cleared):
    """And without the removal every process of the domain waits for ever."""
    domain = fresh_domain()
    for number in range(10, 40):  # of whatever participant the process becomes
        Path(f'/dev/shm/fastrtps_port{7400 + 250 * domain + number}').touch()
    start = [sys.executable, '-c', NODE]
    try:
        if cleared:
            clear_ports(domain)
            subprocess.run(start, env=environment(domain), timeout=60, check=True)
        else:
            with pytest.raises(subprocess.TimeoutExpired):
                subprocess.run(start, env=environment(domain), timeout=5, check=True)
    finally:
        clear_ports(domain)


def test_only_the_ports_of_the_domain_are_removed(tmp_path):
    own, others = tmp_path / 'fastrtps_port9160', ['fastrtps_port9149', 'fastrtps_port9400', 'x']
    for name in [own.name, *others]:
        (tmp_path / name).touch()
    clear_ports(7, tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == set(others)
