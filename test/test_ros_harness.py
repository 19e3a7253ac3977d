# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What keeps tests apart that run at the same time."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from ros_harness import Listener, clear_ports, environment, fresh_domain

NODE = 'import rclpy; rclpy.init(); rclpy.create_node("x")'


def test_a_domain_in_which_somebody_listens_is_nobody_elses():
    domain = fresh_domain()
    with Listener(domain, {}):
        others = [fresh_domain() for _ in range(50)]
    assert domain not in others
    assert domain in [fresh_domain() for _ in range(50)]  # free again


def ends(domain, *, cleared, seconds):
    """Whether a process of a domain ends in which another left half-made ports."""
    for number in range(10, 40):  # of whatever participant the process becomes
        Path(f'/dev/shm/fastrtps_port{7400 + 250 * domain + number}').touch()
    if cleared:
        clear_ports(domain)
    start = [sys.executable, '-c', NODE]
    try:
        subprocess.run(start, env=environment(domain), timeout=seconds, check=True)
    except subprocess.TimeoutExpired:
        return False
    finally:
        clear_ports(domain)
    return True


def test_a_port_that_a_killed_process_left_half_made_stops_nobody_once_it_is_removed():
    """Without the removal processes wait for ever: not each, so that several may try."""
    assert ends(fresh_domain(), cleared=True, seconds=60)
    assert not all(ends(fresh_domain(), cleared=False, seconds=5) for _ in range(6))


def test_only_the_ports_of_the_domain_are_removed(tmp_path):
    own, others = tmp_path / 'fastrtps_port9160', ['fastrtps_port9149', 'fastrtps_port9400', 'x']
    for name in [own.name, *others]:
        (tmp_path / name).touch()
    clear_ports(7, tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == set(others)
