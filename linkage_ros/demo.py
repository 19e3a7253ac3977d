# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The job that `make demo` runs: a four-bar turns on ROS 2 and is watched from outside.

The node runs as a process of its own; this one subscribes, counts and reports. Where there is no
rclpy, the same run is recorded without it.
"""

from __future__ import annotations

import itertools
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

from linkage_ros import cli
from linkage_ros.errors import LinkageError, ViewerError
from linkage_ros.parameters.configuration import load
from linkage_ros.parameters.session import SPAWN
from linkage_ros.progress import progress_bar
from linkage_ros.record import record
from linkage_ros.units import NS_PER_MS, NS_PER_S
from linkage_ros.view.viewer_process import require_screen

_NAME = 'demo'
_FOLDER = Path('demo')
_LOG, _VIEW = _FOLDER / 'quadrilateral.mcap', _FOLDER / 'quadrilateral.rrd'
_SECONDS, _RPM, _RATE = 8.0, 150.0, 200.0
_PATIENCE = 60.0  # s, for all of it on a busy machine


def report(states: list[tuple[int, float]]) -> str:
    """Describes the joint states that a subscriber received.

    Args:
        states: Stamp, ns, and driving torque, N m, of each.

    Returns:
        A line for people.

    Raises:
        LinkageError: Next to nothing was received.
    """
    if len(states) < 2:
        raise LinkageError(
            f'received {len(states)} joint states; is multicast blocked on this machine, '
            'or ROS_AUTOMATIC_DISCOVERY_RANGE=OFF?'
        )
    stamps, torques = zip(*states, strict=True)
    span = (stamps[-1] - stamps[0]) / NS_PER_S
    gaps = [(later - earlier) / NS_PER_MS for earlier, later in itertools.pairwise(stamps)]
    return (
        f'received {len(states)} joint states in {span:.2f} s: '
        f'{(len(states) - 1) / span:.2f} Hz, stamps {min(gaps):.3f} to {max(gaps):.3f} ms apart, '
        f'{span * _RPM / 60:.1f} turns, driving torque {min(torques):.4f} to '
        f'{max(torques):.4f} N m'
    )


def _listen(process: subprocess.Popen[bytes]) -> list[tuple[int, float]]:
    """Subscribes to the node for some seconds from its first joint state on.

    Raises:
        LinkageError: Another node publishes the same topic.
    """
    import rclpy
    from sensor_msgs.msg import JointState

    from linkage_ros.ros.process import ros_context

    states = []

    def receive(message: JointState) -> None:
        stamp = message.header.stamp
        states.append((stamp.sec * NS_PER_S + stamp.nanosec, message.effort[0]))

    layout = '{percentage:3.0f}%|{bar}| {n:.1f}/{total:g} s\r'
    with ros_context([_NAME]), progress_bar(total=_SECONDS, bar_format=layout) as bar:
        node = rclpy.create_node('demo_listener')
        node.create_subscription(JointState, 'joint_states', receive, 10)
        passed, limit = 0.0, time.monotonic() + _PATIENCE
        while passed < _SECONDS and time.monotonic() < limit and process.poll() is None:
            rclpy.spin_once(node, timeout_sec=0.1)
            if states:
                passed = (time.time_ns() - states[0][0]) / NS_PER_S
                bar.update(passed - bar.n)
            if node.count_publishers('joint_states') > 1:
                raise LinkageError(
                    'another node publishes joint_states here: stop it, or choose another '
                    'domain, as in ROS_DOMAIN_ID=42 make demo'
                )
        node.destroy_node()
    return states


def _run_live(viewer: str | Path) -> None:
    settings = {
        'rpm': _RPM, 'rate_hz': _RATE, 'log': _LOG, 'log_overwrite': 'true', 'viewer': viewer,
    }  # fmt: skip
    arguments = [word for name, value in settings.items() for word in ('-p', f'{name}:={value}')]
    command = [sys.executable, '-m', 'linkage_ros.node', '--ros-args', *arguments]
    print(f'linkage_node turns the quadrilateral at {_RPM:g} rpm for {_SECONDS:g} s')
    process = subprocess.Popen(command)  # noqa: S603
    try:
        states = _listen(process)
    finally:
        process.send_signal(signal.SIGINT)
        code = process.wait(timeout=30)
    if code != 0:
        raise LinkageError(f'linkage_node ended with exit code {code}')
    print(report(states))


def _run_recorded(viewer: str | Path) -> None:
    print('rclpy is not installed here: recording the run without ROS')
    configuration = load('quadrilateral')
    session = replace(configuration.session, rate_hz=_RATE)
    record(replace(configuration, session=session), _LOG, duration=_SECONDS, overwrite=True)
    command = [sys.executable, '-m', 'linkage_ros.replay', str(_LOG), '--no-ros']
    rate = '1000' if viewer == _VIEW else '1'  # nobody watches a file
    subprocess.run([*command, '--viewer', str(viewer), '--rate', rate], check=True)  # noqa: S603


def _viewer() -> str | Path:
    """A window where there is a screen, else a file."""
    try:
        require_screen()
    except ViewerError:
        _VIEW.unlink(missing_ok=True)
        return _VIEW
    return SPAWN


def _run() -> None:
    _FOLDER.mkdir(exist_ok=True)
    viewer = _viewer()
    try:
        import rclpy  # noqa: F401
    except ModuleNotFoundError:
        _run_recorded(viewer)
    else:
        _run_live(viewer)
    python = Path(sys.executable).parent
    shown = python.relative_to(Path.cwd()) if python.is_relative_to(Path.cwd()) else python
    print(f'look inside:      {shown}/linkage_log info {_LOG}')
    print(f'replay on topics: {shown}/linkage_replay {_LOG}')
    if viewer == SPAWN:
        print(f'watch it again:   {shown}/linkage_replay {_LOG} --viewer spawn')
    else:
        print(f'watch it in 2-D:  {shown}/rerun {_VIEW}')


def _main() -> int:
    purpose = 'turn a four-bar on ROS 2 for 8 s and watch it; without rclpy, record it'
    notes = 'It writes into the folder demo, here.'
    cli.make_parser('python -m linkage_ros.demo', purpose, ('',), notes).parse_args()
    return cli.leave(cli.run(_NAME, _run))


if __name__ == '__main__':
    sys.exit(_main())
