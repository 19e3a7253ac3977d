# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A disk stalls for longer than the node's queue lasts: the log lacks states, but verifies.

A frozen file system blocks every write in the kernel, as a hanging disk does.
"""

import math
import os
import re
import subprocess
from contextlib import contextmanager
from fcntl import ioctl
from itertools import count

import pytest
from mechanisms import FOLLOWED
from rclpy.qos import QoSProfile
from ros_harness import CODEC, node_arguments, report_of, set_parameter, stop, wait_for, watched
from sensor_msgs.msg import JointState

from linkage_ros.log.reader import LogReader
from linkage_ros.log.recover import recover
from linkage_ros.programs import log_tool

_FREEZE, _THAW = 0xC0045877, 0xC0045878  # requests of ioctl, from linux/fs.h
STATES = '/joint_states'
DRIVES = {
    'speed': {}, 'torque': {'drive': 'torque', 'motor.damping': 0.5}, 'follow': FOLLOWED,
}  # fmt: skip
# A node whose queue is full after a second.
PROGRAM = """
from linkage_ros import cli
from linkage_ros.node import linkage_node as node
from linkage_ros.node import outputs
from linkage_ros.motion.segments import Segment
outputs._LOG_CAPACITY = 200
Segment.size = {size}
cli.leave(cli.run('linkage_node', node.main))
"""
NODE = PROGRAM.format(size=1000)
# Seven changes of speed while the disk hangs end the log.
LARGE_SEGMENTS = PROGRAM.format(size=10_000_000)


@pytest.fixture
def disk(tmp_path):
    """Mounts a small file system; returns its folder."""
    image, folder = tmp_path / 'disk.img', tmp_path / 'disk'
    folder.mkdir()
    image.write_bytes(bytes(16 << 20))
    commands = ['mkfs.ext4', '-q', image], ['mount', '-o', 'loop', image, folder]
    try:
        for command in commands:
            subprocess.run(command, check=True, capture_output=True)
    except (OSError, subprocess.CalledProcessError) as error:
        pytest.skip(f'a file system can be mounted only by root, with a loop device: {error}')
    yield folder
    subprocess.run(['umount', folder], check=True)


@contextmanager
def frozen(folder):
    number = os.open(folder, os.O_RDONLY)
    ioctl(number, _FREEZE, 0)
    try:
        yield
    finally:
        ioctl(number, _THAW, 0)
        os.close(number)


@pytest.mark.parametrize('drive', DRIVES)
def test_log_of_a_stalled_disk_verifies(disk, tmp_path, called, drive):
    path, saved = disk / 'run.mcap', tmp_path / 'saved.mcap'
    arguments = node_arguments(**DRIVES[drive], log=path)
    renamed = '-r', 'joint_commands:=in', '-r', 'measured_joint_states:=in'
    with watched([STATES], *arguments, *renamed, program=NODE) as (listener, node):
        sender = listener.node.create_publisher(JointState, 'in', QoSProfile(depth=10))
        received, sent = listener.received[STATES], 0

        def states(count, **pause):
            """Waits for states; meanwhile sends commands or measurements, and changes the rpm."""
            nonlocal sent
            due = len(received) + count

            def arrived():
                nonlocal sent
                sent += 1
                message = JointState(name=['crank'], position=[0.01 * sent], effort=[sent % 13.0])
                message.header.stamp.sec = 1000 + sent // 100
                message.header.stamp.nanosec = sent % 100 * 10_000_000
                sender.publish(message)
                return len(received) >= due

            wait_for(arrived, **pause)
            if drive == 'speed':
                rpm = 200.0 + sent  # never the speed at the start
                assert set_parameter(listener, 'rpm', type=3, double_value=rpm).successful
                # The tick that logs the change comes later.
                wait_for(lambda: abs(CODEC.decode(received[-1])[1][3] - rpm * math.pi / 30) < 1e-9)

        # A flood of measurements would fill the queue of a busy machine before the disk stalls.
        states(20, pause=0.1)
        size = path.stat().st_size
        wait_for(lambda: path.stat().st_size > size)
        with frozen(disk):
            for _ in range(4):
                states(75)
        states(100)
        output = stop(node)
    lost = int(re.search(r', (\d+) lost to the log', output)[1])
    recover(path, saved)
    for found in (path, saved):
        report, log = report_of(found), LogReader(found)
        assert (report.difference, report.ulp) == ('', 0.0)
        assert log.dropped == lost > 50
        assert report.stops_at_gap == (drive == 'follow')
        assert report.states > (0 if report.stops_at_gap else 100)
        if drive == 'speed':
            assert len(log.motions['']) == 7
        code, out, _ = called(log_tool, 'verify', found)
        assert (code, f'because the disk was too slow: {lost}' in out) == (0, True)


def test_log_ends_when_too_much_waits_for_a_hanging_disk(disk, called):
    path, topics = disk / 'run.mcap', [STATES, '/diagnostics']
    with watched(topics, *node_arguments(log=path), program=LARGE_SEGMENTS) as (listener, node):
        received = listener.received[STATES]
        wait_for(lambda: len(received) > 50)
        size = path.stat().st_size
        wait_for(lambda: path.stat().st_size > size)
        rpm = count(300.0)

        def is_reported():
            changed = set_parameter(listener, 'rpm', type=3, double_value=next(rpm))
            assert changed.successful
            return any(b'64 MB' in message for message in listener.received['/diagnostics'])

        with frozen(disk):
            wait_for(is_reported, pause=0.02)
        due = len(received) + 50
        wait_for(lambda: len(received) > due)  # the node goes on
        output = stop(node, code=1)
    assert output.count('continues without a log') == 1
    assert 'Traceback' not in output
    report, log = report_of(path), LogReader(path)
    assert (report.difference, report.ulp, log.lost) == ('', 0.0, None)
    assert report.states > 10
    code, out, _ = called(log_tool, 'verify', path)
    assert (code, 'no end record' in out) == (0, True)
