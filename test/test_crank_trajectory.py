# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The crank's trajectory, and the control law of joint_trajectory_controller of Jazzy.

`Controller` reimplements that controller, which is in no Python package. Comments cite the lines
of ros2_controllers, branch jazzy, version 4.42.1 (commit ed360c9), in joint_trajectory_controller:
  C  src/joint_trajectory_controller.cpp
  T  src/trajectory.cpp
  P  src/joint_trajectory_controller_parameters.yaml
States and commands are exchanged as in topic_based_hardware_interfaces 1.1.0 (d115f23):
  H  joint_state_topic_hardware_interface/src/joint_state_topic_hardware_interface.cpp
The controller manager is that of ros2_control, branch jazzy, version 4.46.0 (9ffbf97):
  M  controller_manager/src/controller_manager.cpp
"""

import math
import re
from typing import NamedTuple
from unittest.mock import MagicMock

import numpy as np
import pytest
import yaml
from one_linkage import TrajectoryAlone
from pages import ROOT
from rclpy.serialization import deserialize_message
from ros_harness import logged, node_arguments, stop, unbroken, verified, wait_for, watched
from trajectory_msgs.msg import JointTrajectory

from linkage_ros import Conditions
from linkage_ros.messages.cdr import stamp_of
from linkage_ros.motion.at_speed import SpeedMotion
from linkage_ros.numeric import wrap
from linkage_ros.run.states import Simulator
from linkage_ros.settings.configuration import configure, load, read_values
from linkage_ros.settings.presets import preset_path
from linkage_ros.units import NS_PER_MS, NS_PER_S

EXAMPLE = ROOT / 'docs' / 'examples' / 'ros2_control'
PARAMETERS = yaml.safe_load((EXAMPLE / 'controllers.yaml').read_text())
TOPIC = '/crank_controller/joint_trajectory'
T0 = 1_700_000_000_123_456_789  # ns
PERIOD = NS_PER_MS  # of the controller manager, ns
HALF = NS_PER_S // 4  # half of the default horizon, ns


def machine(**values):
    given = {k: v for k, v in load('quadrilateral').parameters().items() if v is not None}
    return Simulator(configure({**given, 'trajectory_command_topic': TOPIC, **values}).only)


def trajectory(machine):
    return TrajectoryAlone(machine)


def nanoseconds(time):
    return time.sec * NS_PER_S + time.nanosec


class Controller:
    """joint_trajectory_controller with only the effort interface."""

    def __init__(self, parameters):
        self.joints = parameters['joints']
        # C:892-895: without other command interfaces, the effort is added to a PID law.
        assert parameters['command_interfaces'] == ['effort']
        # C:943-955: this requires both states.
        assert parameters['state_interfaces'] == ['position', 'velocity']
        self.may_end_moving = parameters.get('allow_nonzero_velocity_at_trajectory_end', False)
        self.gains = parameters['gains'][self.joints[0]]
        self.points = None

    def receive(self, data, now):
        """Receives a message on ~/joint_trajectory, C:1001-1004 and C:1385-1398."""
        message = deserialize_message(data, JointTrajectory)
        self._validate(message, now)
        # T:101-107: the new trajectory replaces the old one, and starts at its stamp.
        start = nanoseconds(message.header.stamp) or now  # T:128-131: 0 means now
        self.times = [start + nanoseconds(p.time_from_start) for p in message.points]
        self.points = message.points

    def _validate(self, message, now):
        assert list(message.joint_names) == self.joints  # C:1676-1714
        assert message.points  # C:1695
        # C:1717-1730: refused unless allowed.
        assert self.may_end_moving or abs(message.points[-1].velocities[0]) < 1.2e-7
        after = [nanoseconds(point.time_from_start) for point in message.points]
        start = nanoseconds(message.header.stamp)
        assert not start or start + after[-1] >= now  # C:1737-1748
        assert all(np.diff(after) > 0)  # C:1755
        for point in message.points:  # C:1797-1803: effort is not checked there, but read in C:422
            row = point.positions, point.velocities, point.accelerations, point.effort
            assert [len(numbers) for numbers in row] == [1, 1, 1, 1]

    def sample(self, now):
        """Computes position, velocity and effort at a time, T:109-254."""
        # T:148-169: before the first point it would interpolate from the measured state, whose
        # effort is 0.
        assert now >= self.times[0]
        after = int(np.searchsorted(self.times, now, 'right'))
        if after == len(self.times):  # T:208-236: the last point is held
            last = self.points[-1]
            return last.positions[0], last.velocities[0], last.effort[0]
        a, b = self.points[after - 1], self.points[after]
        T, t = (moment / NS_PER_S for moment in (self.times[after] - self.times[after - 1],
                                                 now - self.times[after - 1]))  # fmt: skip
        (p0,), (v0,), (a0,) = a.positions, a.velocities, a.accelerations
        (p1,), (v1,), (a1,) = b.positions, b.velocities, b.accelerations
        # T:365-406: a quintic spline through both points.
        c = [
            p0, v0, 0.5 * a0,
            (-20 * p0 + 20 * p1 - 3 * a0 * T**2 + a1 * T**2 - 12 * v0 * T - 8 * v1 * T)
            / (2 * T**3),
            (30 * p0 - 30 * p1 + 3 * a0 * T**2 - 2 * a1 * T**2 + 16 * v0 * T + 14 * v1 * T)
            / (2 * T**4),
            (-12 * p0 + 12 * p1 - a0 * T**2 + a1 * T**2 - 6 * v0 * T - 6 * v1 * T) / (2 * T**5),
        ]  # fmt: skip
        position = sum(x * t**n for n, x in enumerate(c))
        velocity = sum(n * x * t ** (n - 1) for n, x in enumerate(c) if n)
        # T:296-313: linear interpolation of the effort.
        effort = a.effort[0] + t * (b.effort[0] - a.effort[0]) / T
        return position, velocity, effort

    def reference(self, now):
        """Computes the desired position and velocity, and the effort of the next cycle."""
        position, velocity, _ = self.sample(now)  # C:322
        _, _, effort = self.sample(now + PERIOD)  # C:327-329
        return position, velocity, effort

    def effort(self, reference, position, velocity):
        """Computes the effort for the hardware, C:360-427, for arrays."""
        desired, speed, effort = reference
        # C:110-116 and C:1500-1504: the crank is continuous in the URDF, so angles are wrapped.
        error = wrap(desired - position, np.rint)
        # C:420-425, with the default ff_velocity_scale of 0 (P:174-178).
        return effort + self.gains['p'] * error + self.gains['d'] * (speed - velocity)


def test_a_trajectory_holds_the_forces_at_its_stamp():
    """Forces come at any rate; points before a change are computed again for the next message."""
    pushed = machine(**{
        'loads.push.kind': 'force', 'loads.push.link': 'rocker', 'loads.push.force': [0.0, 0.0],
        'loads.push.wrench_topic': 'push',
    })  # fmt: skip
    ahead, motion = trajectory(pushed), pushed.begin(T0)
    for tick in range(600):
        stamp, force = T0 + tick * PERIOD, {'push': (float(tick // 100), -20.0)}
        motion = motion.under(stamp, Conditions(forces=force), pushed.linkage.drive)
        message = ahead.message_at(motion, stamp)
        assert (message is not None) == (tick % 250 == 0)
        if message is not None:
            assert message == trajectory(pushed).message_at(motion, stamp)


def parameters_of_the_example():
    return PARAMETERS['crank_controller']['ros__parameters']


class Launched(NamedTuple):
    """The launch file of the example.

    Attributes:
        nodes: Arguments of each node.
        awaited: Command whose end is awaited.
        started_afterwards: Arguments of the nodes that are started when this command has ended.
    """

    nodes: list
    awaited: list
    started_afterwards: list


def launched_by_the_example():
    """Runs the launch file; launch and ros2_control are not available as Python packages."""
    text = (EXAMPLE / 'linkage.launch.py').read_text()
    code, nodes = re.sub(r'(?m)^from .*$', '', text), []

    def node(**arguments):
        nodes.append(arguments)
        return arguments

    names = {
        'Node': node, 'ExecuteProcess': dict, 'OnProcessExit': dict, 'LaunchDescription': list,
        'RegisterEventHandler': lambda event: event, 'Path': MagicMock(),
        'preset_path': preset_path,
    }  # fmt: skip
    exec(code, names)
    (handler,) = [x for x in names['generate_launch_description']() if 'on_exit' in x]
    return Launched(nodes, handler['target_action']['cmd'], handler['on_exit'])


# ---------------------------------------------------------------- messages


def made(machine, seconds, rate=1000):
    """Returns the messages of a run and their stamps, as rclpy reads them."""
    ahead, motion = trajectory(machine), machine.begin(T0)
    for tick in range(seconds * rate):
        stamp = T0 + tick * NS_PER_S // rate
        if data := ahead.message_at(motion, stamp):
            yield stamp, deserialize_message(data, JointTrajectory)


@pytest.mark.parametrize(
    ('prefix', 'rate'), [('', 1000), ('left_', 1000), ('a', 1000), ('ab_', 333)]
)
def test_points_hold_the_exact_motion_and_torque_of_the_crank_alone(prefix, rate):
    """At 333 Hz, ticks fall between points, and a trajectory begins before its stamp."""
    one = machine(joint_prefix=prefix, crank_acceleration=3.0, start_rpm=20.0, crank_angle=90.0)
    motion = one.begin(T0)
    for stamp, message in made(one, 1, rate):
        assert message.joint_names == [f'{prefix}crank']
        assert message.header.frame_id == 'base_link'
        start = nanoseconds(message.header.stamp)
        assert start <= stamp < start + NS_PER_MS
        assert rate != 1000 or start == stamp
        stamps = [start + nanoseconds(point.time_from_start) for point in message.points]
        assert stamps == list(range(start, stamp + 2 * HALF + NS_PER_MS, NS_PER_MS))
        for due, point in zip(stamps, message.points, strict=True):
            (q,), (u,), (a,), unwrapped, *_ = motion.at(due)
            row = point.positions, point.velocities, point.accelerations, point.effort
            torque = one.solver.state(q, u, a).torque
            assert [value for (value,) in row] == [unwrapped, u, a, torque]


@pytest.mark.parametrize('horizon', [0.5, 0.1])
def test_trajectory_is_renewed_after_half_its_horizon(horizon):
    stamps = [stamp - T0 for stamp, _ in made(machine(trajectory_horizon=horizon), 2)]
    assert stamps == list(range(0, 2 * NS_PER_S, round(horizon * NS_PER_S / 2)))


def test_speed_change_clock_step_and_pause_renew_the_trajectory_at_once(monkeypatch):
    one, solved = machine(), []
    at = SpeedMotion.at
    monkeypatch.setattr(SpeedMotion, 'at', lambda *stamp: solved.append(stamp) or at(*stamp))
    ahead, motion = trajectory(one), one.begin(T0)
    assert ahead.message_at(motion, T0)
    now = T0 + 10 * NS_PER_MS
    assert ahead.message_at(motion, now) is None
    motion = motion.change(now, 60.0)
    faster = deserialize_message(ahead.message_at(motion, now), JointTrajectory)
    assert faster.points[0].velocities[0] == pytest.approx(2 * math.pi)
    assert ahead.message_at(motion, now + HALF - 1) is None
    motion = motion.restamp(now, now - 5 * NS_PER_S)
    stepped = deserialize_message(ahead.message_at(motion, now - 5 * NS_PER_S), JointTrajectory)
    assert nanoseconds(stepped.header.stamp) == now - 5 * NS_PER_S
    solved.clear()
    later = now + 3600 * NS_PER_S
    resumed = deserialize_message(ahead.message_at(motion, later), JointTrajectory)
    assert nanoseconds(resumed.header.stamp) == later
    assert len(solved) == 501  # the pause is not made up for


# ---------------------------------------------------------------- on DDS


def test_node_publishes_and_logs_trajectories(tmp_path):
    path, topic = tmp_path / 'run.mcap', '/arm/mechanism_state'
    given = node_arguments(
        trajectory_command_topic=topic, rate_hz=1000.0, joint_prefix='left_', log=path
    )
    renamed = '-r', 'mechanism_state:=s', '--params-file', preset_path('quadrilateral')
    topics = {topic: 'trajectory_msgs/msg/JointTrajectory'}
    with watched(topics, *given, *renamed) as (listener, node):
        received = listener.received[topic]
        wait_for(lambda: len(received) > 4)
        stop(node)
    messages = [deserialize_message(data, JointTrajectory) for data in received]
    stamps = [nanoseconds(message.header.stamp) for message in messages]
    parameters = parameters_of_the_example()
    parameters = {**parameters, 'joints': ['left_crank'],
                  'gains': {'left_crank': parameters['gains']['crank']}}  # fmt: skip
    controller = Controller(parameters)
    for data, stamp in zip(received, stamps, strict=True):
        controller.receive(data, stamp or max(stamps) + 1)
    *_, zero = messages
    (place,) = zero.points[0].positions
    assert controller.sample(2 * max(stamps)) == (place, 0.0, 0.0)
    _, kept = logged(path)
    assert unbroken(received, [message.data for message in kept[topic]])
    # The first state at or after half of the horizon renews the trajectory, however late it is.
    renewals = [-HALF]
    for stamp in (stamp_of(message.data) for message in kept['/joint_states']):
        if stamp >= renewals[-1] + HALF:
            renewals.append(stamp)
    assert [stamp_of(message.data) for message in kept[topic]] == [*renewals[1:], 0]
    report = verified(path)
    assert report.others == ('/diagnostics', topic)
    assert '/s' in report.compared


def test_launch_file_of_the_example_names_existing_topics_and_parameters():
    launched = launched_by_the_example()
    plant, reference, publisher, manager, spawner = launched.nodes
    assert configure(plant['parameters'][0]).only.kind.drive == 'torque'
    # M:755-756: the manager subscribes to robot_description, so ours must have another name.
    assert (plant['namespace'], reference['namespace']) == ('plant', 'reference')
    assert plant['remappings'] == [('joint_commands', '/joint_commands')]
    assert publisher['remappings'] == [('joint_states', f'{plant["namespace"]}/joint_states')]
    file, values = reference['parameters']
    drive = configure({**read_values(str(file)), **values}).drive
    # C:1002: the topic is joint_trajectory in the controller's namespace.
    controller, _, word = drive.trajectory_command_topic.lstrip('/').partition('/')
    assert word == 'joint_trajectory'
    *spawned, _, _ = spawner['arguments']
    assert spawned[-1] == controller
    managed = PARAMETERS['controller_manager']['ros__parameters']
    assert spawned == [name for name in managed if name != 'update_rate']
    assert managed[controller]['type'] == 'joint_trajectory_controller/JointTrajectoryController'
    assert managed['update_rate'] * PERIOD == NS_PER_S
    assert manager['executable'] == 'ros2_control_node'
    # A controller that is active before the plant's first state reports an error in every cycle.
    assert launched.awaited[-2:] == ['/plant/joint_states', 'sensor_msgs/msg/JointState']
    assert launched.started_afterwards == [spawner]
