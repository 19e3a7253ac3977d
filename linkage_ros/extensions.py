# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Names for mechanisms, loads, methods and charts of your own, beside those of `linkage_ros`.

Public: other packages may import this module, and also `formulas`, `quantities`, `cli`, `palette`
and `executables`. All further modules may change in any release.
"""

from linkage_ros.mechanism.dyads import dyads_field
from linkage_ros.mechanism.equations import (
    Model,
    accelerations,
    acting_forces,
    balance,
    torque,
    velocities,
)
from linkage_ros.mechanism.joint_forces import reactions
from linkage_ros.mechanism.kinematics import LinkPose, Pose
from linkage_ros.mechanism.loads import LOADS
from linkage_ros.mechanism.loads.base import AppliedLoad, Load
from linkage_ros.mechanism.loads.link_load import LinkForce
from linkage_ros.mechanism.nested import transformed
from linkage_ros.mechanism.parts import gravity_quantity
from linkage_ros.mechanism.program import Constants, Program
from linkage_ros.mechanism.registry import MECHANISMS
from linkage_ros.mechanism.structure import Link, Point, Structure, coupler_point
from linkage_ros.mechanism.tracer import Tape
from linkage_ros.mechanism.wrenches import Wrench, generalised, poses
from linkage_ros.messages.urdf import make_urdf
from linkage_ros.motion.along_law import LawMotion
from linkage_ros.motion.coordinates import DrivenMechanism
from linkage_ros.motion.drives.follow import FollowDrive
from linkage_ros.motion.drives.law import LawDrive
from linkage_ros.motion.law import Sine
from linkage_ros.motion.measured import FollowMotion
from linkage_ros.motion.steps import LONGEST_STEP, TOLERANCE, Integrate, live_steps, record_steps
from linkage_ros.motion.under_torque import Motor, published
from linkage_ros.numeric import two_sum
from linkage_ros.run.states import Simulator
from linkage_ros.settings.summary import notes
from linkage_ros.settings.yaml_file import read_yaml
from linkage_ros.view.drawing import Drawing

__all__ = [
    'LOADS',
    'LONGEST_STEP',
    'MECHANISMS',
    'TOLERANCE',
    'AppliedLoad',
    'Constants',
    'Drawing',
    'DrivenMechanism',
    'FollowDrive',
    'FollowMotion',
    'Integrate',
    'LawDrive',
    'LawMotion',
    'Link',
    'LinkForce',
    'LinkPose',
    'Load',
    'Model',
    'Motor',
    'Point',
    'Pose',
    'Program',
    'Simulator',
    'Sine',
    'Structure',
    'Tape',
    'Wrench',
    'accelerations',
    'acting_forces',
    'balance',
    'coupler_point',
    'dyads_field',
    'generalised',
    'gravity_quantity',
    'live_steps',
    'make_urdf',
    'notes',
    'poses',
    'published',
    'reactions',
    'read_yaml',
    'record_steps',
    'torque',
    'transformed',
    'two_sum',
    'velocities',
]
