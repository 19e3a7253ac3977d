# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Topics of the node: names, message types and quality of service.

This file contains the definitions and type hashes (REP 2011) of the message types, because logs
are also written without ROS. A test compares them with the installed message packages.
"""

from typing import NamedTuple

_HEADER = (
    ('std_msgs/Header', 'builtin_interfaces/Time stamp\nstring frame_id\n'),
    ('builtin_interfaces/Time', 'int32 sec\nuint32 nanosec\n'),
)


class Interface(NamedTuple):
    """A message type.

    Attributes:
        name: Name of the type, such as 'std_msgs/msg/Float64'.
        hash: Type hash, RIHS01.
        definition: Fields of the type, followed by those of each nested type after a separator
            line.
    """

    name: str
    hash: str
    definition: str


def _interface(
    name: str, digest: str, fields: str, contained: tuple[tuple[str, str], ...] = ()
) -> Interface:
    parts = [fields, *(f'MSG: {other}\n{text}' for other, text in contained)]
    return Interface(name, f'RIHS01_{digest}', f'{"=" * 80}\n'.join(parts))


JOINT_STATE = _interface(
    'sensor_msgs/msg/JointState',
    'a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e',
    'std_msgs/Header header\n'
    'string[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n',
    _HEADER,
)
FLOAT64 = _interface(
    'std_msgs/msg/Float64',
    '705ba9c3d1a09df43737eb67095534de36fd426c0587779bda2bc51fe790182a',
    'float64 data\n',
)
FLOAT64_MULTI_ARRAY = _interface(
    'std_msgs/msg/Float64MultiArray',
    '1025ddc6b9552d191f89ef1a8d2f60f3d373e28b283d8891ddcc974e8c55397f',
    'MultiArrayLayout layout\nfloat64[] data\n',
    (
        ('std_msgs/MultiArrayLayout', 'MultiArrayDimension[] dim\nuint32 data_offset\n'),
        ('std_msgs/MultiArrayDimension', 'string label\nuint32 size\nuint32 stride\n'),
    ),
)
STRING = _interface(
    'std_msgs/msg/String',
    'df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18',
    'string data\n',
)
POINT_STAMPED = _interface(
    'geometry_msgs/msg/PointStamped',
    '4c0296af86e01e562e9e0405d138a01537247580076c58ea38d7923ac1045897',
    'std_msgs/Header header\nPoint point\n',
    (*_HEADER, ('geometry_msgs/Point', 'float64 x\nfloat64 y\nfloat64 z\n')),
)
JOINT_TRAJECTORY = _interface(
    'trajectory_msgs/msg/JointTrajectory',
    '179b33eba59d676f6d967ac71fe35e7ca2f64b2f3928f4a018cec115e213796e',
    'std_msgs/Header header\nstring[] joint_names\nJointTrajectoryPoint[] points\n',
    (
        *_HEADER,
        (
            'trajectory_msgs/JointTrajectoryPoint',
            (
                'float64[] positions\nfloat64[] velocities\nfloat64[] accelerations\n'
                'float64[] effort\nbuiltin_interfaces/Duration time_from_start\n'
            ),
        ),
        ('builtin_interfaces/Duration', 'int32 sec\nuint32 nanosec\n'),
    ),
)
WRENCH_STAMPED = _interface(
    'geometry_msgs/msg/WrenchStamped',
    '8dc3deaf06b2ab281f9f9a742a8961c328ca7cec16e3fd6586d3a5c83fa78f77',
    'std_msgs/Header header\nWrench wrench\n',
    (
        *_HEADER,
        ('geometry_msgs/Wrench', 'Vector3 force\nVector3 torque\n'),
        ('geometry_msgs/Vector3', 'float64 x\nfloat64 y\nfloat64 z\n'),
    ),
)
DIAGNOSTIC_ARRAY = _interface(
    'diagnostic_msgs/msg/DiagnosticArray',
    '5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e',
    'std_msgs/Header header\nDiagnosticStatus[] status\n',
    (
        *_HEADER,
        (
            'diagnostic_msgs/DiagnosticStatus',
            (
                'byte OK=0\nbyte WARN=1\nbyte ERROR=2\nbyte STALE=3\n'
                'byte level\nstring name\nstring message\nstring hardware_id\nKeyValue[] values\n'
            ),
        ),
        ('diagnostic_msgs/KeyValue', 'string key\nstring value\n'),
    ),
)
CLOCK = _interface(
    'rosgraph_msgs/msg/Clock',
    '692f7a66e93a3c83e71765d033b60349ba68023a8c689a79e48078bcb5c58564',
    'builtin_interfaces/Time clock\n',
    (_HEADER[1],),
)


class Topic(NamedTuple):
    """A topic of the node.

    Attributes:
        name: Relative name, or absolute name with a leading slash.
        interface: Message type of the topic.
        latched: Whether late subscribers receive the last message (transient local durability).
        depth: QoS depth: number of messages queued for a slow subscriber.
        meaning: Contents of a message in one line, for docs/reference.md.
        parameter: The parameter that sets the name, if any.
    """

    name: str
    interface: Interface
    latched: bool = False
    depth: int = 10
    meaning: str = ''
    parameter: str = ''

    @property
    def role(self) -> str:
        """Name of the topic in logs, which neither a remapping nor a parameter changes."""
        return self.parameter or self.name.lstrip('/')


JOINT_STATES = Topic(
    'joint_states',
    JOINT_STATE,
    meaning='position and velocity of every joint; effort of the crank is the driving torque',
)
DRIVING_TORQUE = Topic(
    'driving_torque', FLOAT64, meaning='the same torque, N m, counter-clockwise positive'
)
MECHANISM_STATE = Topic(
    'mechanism_state',
    JOINT_TRAJECTORY,
    meaning='the same joints with accelerations, as one point',
)
POINTS = Topic(
    'points/NAME',
    POINT_STAMPED,
    meaning='position of the traced point `points.NAME`, one topic each',
)
DIAGNOSTICS = Topic(
    '/diagnostics',
    DIAGNOSTIC_ARRAY,
    meaning='once a second: rate, missed ticks, loop residual, health of log and viewer',
)
ROBOT_DESCRIPTION = Topic(
    'robot_description', STRING, latched=True, depth=1, meaning='URDF of the open tree of links'
)
TOPICS = (
    JOINT_STATES,
    DRIVING_TORQUE,
    MECHANISM_STATE,
    POINTS,
    DIAGNOSTICS,
    ROBOT_DESCRIPTION,
)
JOINT_COMMANDS = Topic(
    'joint_commands',
    JOINT_STATE,
    meaning="best effort, with `drive: torque`: the crank's effort is added to the motor's torque",
)
MEASURED_JOINT_STATES = Topic(
    'measured_joint_states',
    JOINT_STATE,
    depth=1000,
    meaning='best effort, with `drive: follow`: the measured crank; each message gives one state',
)
CRANK_TRAJECTORY = Topic(
    'crank_trajectory',
    JOINT_TRAJECTORY,
    meaning='best effort, with `drive: motion`: the further motion of the crank; its positions '
    'include all turns, and a stamp of 0 means now',
)
# Depth 1, because a slow subscriber needs only the latest time.
SIMULATED_CLOCK = Topic('/clock', CLOCK, depth=1, meaning='with `use_sim_time`: the time')


# Users choose the names of these topics: `name` is only the parameter that sets the name.
EFFORT_COMMANDS = Topic(
    'effort_command_topic',
    FLOAT64_MULTI_ARRAY,
    meaning='a number for each linkage: the driving torque `lead_time` later',
    parameter='effort_command_topic',
)
TRAJECTORY_COMMANDS = Topic(
    'trajectory_command_topic',
    JOINT_TRAJECTORY,
    meaning='motion and torque of the crank for `trajectory_horizon` from the stamp on',
    parameter='trajectory_command_topic',
)
WRENCHES = Topic(
    'wrench_topic',
    WRENCH_STAMPED,
    meaning='best effort: the force of a load of kind `force`, from the next state on',
    parameter='wrench_topic',
)


def point_topic(name: str) -> Topic:
    """Returns the topic of a traced point."""
    return POINTS._replace(name=f'points/{name}')


def prefix_of(linkage: str, separator: str = '/') -> str:
    """Returns the prefix of the names of a linkage; empty for the only one, which has no name."""
    return f'{linkage}{separator}' if linkage else ''


def topic_of_linkage(topic: Topic, linkage: str) -> Topic:
    """Returns the topic of one linkage, for a topic that each linkage has of its own."""
    return topic._replace(name=f'{prefix_of(linkage)}{topic.name}')


def qualified(topic: Topic) -> str:
    """Returns the fully qualified name of a topic for a node without a namespace."""
    return topic.name if topic.name.startswith('/') else f'/{topic.name}'
