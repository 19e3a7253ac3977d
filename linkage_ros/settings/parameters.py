# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""All ROS parameters of linkage_node and linkage_record; `parameter_leaves` lists them.

A parameter is a field of a dataclass, declared by `quantity`, which gives the ROS parameter, its
valid range, its --help text, its row in the documentation and its value in the log. The fields of
a run are declared here (`Session`); those of a mechanism, a load, a drive and a robot's joint in
the file of each. After adding one, run docs/reference.py. `node/parameter_node.py` declares all to
ROS.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from linkage_ros.errors import ConfigurationError
from linkage_ros.mechanism.base import Mechanism
from linkage_ros.mechanism.registry import MECHANISMS
from linkage_ros.messages.joints import RobotJoint, own_joints
from linkage_ros.messages.templates import ROOT_FRAME
from linkage_ros.messages.urdf import link_of
from linkage_ros.motion.drives import DRIVES
from linkage_ros.quantities import Checked, Leaf, build, leaves, quantity, shown
from linkage_ros.settings.joints import joint_leaves
from linkage_ros.settings.plane import Plane

JOINT_PREFIX = '[A-Za-z0-9_]*'  # regular expression
# Parameters of the whole run, which no linkage has of its own.
OF_THE_RUN = (
    'linkages', 'managed', 'drive', 'rate_hz', 'log', 'log_overwrite', 'viewer', 'viewer_bind',
    'effort_command_topic', 'lead_time', 'trajectory_command_topic', 'trajectory_horizon',
    'measurement_timeout',
)  # fmt: skip
# Values of the parameter `viewer`: two of them, and all in words.
SPAWN, WEB = 'spawn', 'web'
VIEWERS = f'{SPAWN}, {WEB}, rerun+http://HOST:PORT/proxy or a .rrd path'


@dataclass(frozen=True)
class MechanismAndDrive(Checked):
    """The kinds of mechanism and drive, keys of `MECHANISMS` and `DRIVES`."""

    mechanism: str = quantity('choice', 'kind of mechanism', choices=MECHANISMS.keys())
    drive: str = quantity(
        'choice', 'given quantity: the speed of the crank, the torque on it, its measured angle, '
        'or its motion over time',
        choices=DRIVES.keys(), default='speed',
    )  # fmt: skip

    @classmethod
    def of(cls, given: Mapping[str, object]) -> 'MechanismAndDrive':
        """Reads mechanism and drive from parameters; a wind pump always has drive: torque.

        Raises:
            ConfigurationError: The mechanism is missing, or cannot have the drive.
        """
        kind = build(cls, given)
        drives, reason = MECHANISMS[kind.mechanism].drives(given)
        if not drives or kind.drive in drives:
            return kind
        if 'drive' not in given and len(drives) == 1:
            return replace(kind, drive=drives[0])
        raise ConfigurationError(
            f'drive = {kind.drive!r}: must be {" or ".join(drives)}, {reason}'
        )


@dataclass(frozen=True)
class Session(Checked):
    """Settings for publishing, logging and viewing a run; those from joint_prefix on of a linkage.

    The view checks `viewer`. `plane` is where frame_id is on a robot; None if that is not known.
    If a robot's joints are given, the robot has a robot_description of its own.
    """

    linkages: tuple[str, ...] | None = quantity(
        'names', 'names of several linkages; the parameters of each are below its name, or, for '
        'all linkages, at the top',
        pattern='[A-Za-z][A-Za-z0-9_]*', default=None,
    )  # fmt: skip
    managed: bool = quantity(
        'switch', 'make linkage_node a lifecycle node, which waits for configure and activate',
        default=False,
    )  # fmt: skip
    rate_hz: float = quantity('number', 'states per second', 'Hz', span=(0.01, 1e5), default=200.0)
    log: str = quantity('text', 'path of the .mcap log; empty: no log', default='')
    log_overwrite: bool = quantity('switch', 'replace an existing log or .rrd file', default=False)
    viewer: str = quantity('text', f'{VIEWERS}; empty: none', default='')
    viewer_bind: str = quantity(
        'text', 'address on which a spawned viewer or the page is served', default='127.0.0.1'
    )
    joint_prefix: str = quantity(
        'text', 'prefix of every joint name in messages and of every URDF link name',
        pattern=JOINT_PREFIX, default='',
    )  # fmt: skip
    crank_joint: str = quantity(
        'text', "a robot's name for the driven joint, in measurements, commands and trajectories; "
        'empty: crank (or rod), after joint_prefix', default='',
    )  # fmt: skip
    frame_id: str = quantity(
        'text', 'link that carries the fixed pivots; joint_prefix does not apply to it',
        pattern='[A-Za-z0-9_][A-Za-z0-9_./-]*', default=ROOT_FRAME,
    )  # fmt: skip
    plane: Plane | None = None
    publish_description: bool | None = quantity(
        'switch', "publish the linkage's robot_description; default: true without joints",
        default=None,
    )  # fmt: skip

    def require_names(self, mechanism: Mechanism, robot: Sequence[RobotJoint]) -> None:
        """Rejects a frame_id or crank_joint that is already the name of another joint or link.

        Args:
            mechanism: Mechanism of the run.
            robot: Joints of the mechanism in messages.

        Raises:
            ConfigurationError: The name is already in use.
        """
        links, driven = mechanism.structure().links, mechanism.structure().driven
        joints = [joint.name for joint in own_joints(links, self.joint_prefix)]
        if self.frame_id in {*joints, *map(link_of, joints)}:
            raise ConfigurationError(
                f'frame_id = {shown(self.frame_id)}: must not be a joint or moving link of this '
                'linkage; name the link that carries its fixed pivots, or change joint_prefix'
            )
        own, others = joints[driven], [*joints[:driven], *joints[driven + 1 :]]
        name = links[driven].name
        if self.crank_joint and robot[driven].name != own:
            raise ConfigurationError(
                f'crank_joint = {shown(self.crank_joint)}: joints.{name}.name already names the '
                f'{name}; leave crank_joint out'
            )
        if self.crank_joint in others:
            raise ConfigurationError(
                f'crank_joint = {shown(self.crank_joint)}: must not be another joint of this '
                f"linkage, {', '.join(others)}; give the robot's name for the {name}"
            )


def parameter_leaves(
    kind: MechanismAndDrive, values: Mapping[str, object] | None = None
) -> tuple[Leaf, ...]:
    """Returns the parameters of a mechanism, a drive and a run, in order of declaration.

    Args:
        kind: The kinds of mechanism and drive.
        values: Values by parameter name; their loads add parameters.

    Raises:
        ConfigurationError: A load in the values has no valid kind.
    """
    drive, mechanism = DRIVES[kind.drive], MECHANISMS[kind.mechanism]
    unused = set() if values is None else {*mechanism.unused(values)}
    if drive.is_measured:  # measurements set the rate
        unused.add('rate_hz')
    own = list[Leaf]()
    for cls in (MechanismAndDrive, mechanism, drive, Session):
        for leaf in leaves(cls, values=values):
            if leaf.name in unused:
                continue
            if leaf.name == 'gravity':  # an integrator keeps its model
                is_live = not drive.is_integrated
                leaf = leaf._replace(quantity=replace(leaf.quantity, live=is_live))
            own.append(leaf)
    return (*own, *joint_leaves(mechanism, values))
