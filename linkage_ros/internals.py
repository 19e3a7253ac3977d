# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Names that linkage_lab needs to compare methods; they may change in any release."""

from linkage_ros.mechanism.equations import (
    Model,
    accelerations,
    acting_forces,
    balance,
    torque,
    velocities,
)
from linkage_ros.mechanism.joint_forces import reactions
from linkage_ros.mechanism.loads.link_load import LinkForce
from linkage_ros.mechanism.nested import transformed
from linkage_ros.mechanism.program import Constants, Program
from linkage_ros.mechanism.tracer import Tape
from linkage_ros.mechanism.wrenches import generalised, poses
from linkage_ros.messages.urdf import make_urdf
from linkage_ros.motion.along_law import LawMotion
from linkage_ros.motion.coordinates import DrivenMechanism
from linkage_ros.motion.drives.follow import FollowDrive
from linkage_ros.motion.law import Sine
from linkage_ros.motion.measured import FollowMotion
from linkage_ros.motion.steps import LONGEST_STEP, TOLERANCE, Integrate, live_steps, record_steps
from linkage_ros.motion.under_torque import Motor, published
from linkage_ros.run.states import Simulator
from linkage_ros.settings.summary import notes
from linkage_ros.settings.yaml_file import read_yaml
from linkage_ros.view.drawing import Drawing

__all__ = [
    'LONGEST_STEP',
    'TOLERANCE',
    'Constants',
    'Drawing',
    'DrivenMechanism',
    'FollowDrive',
    'FollowMotion',
    'Integrate',
    'LawMotion',
    'LinkForce',
    'Model',
    'Motor',
    'Program',
    'Simulator',
    'Sine',
    'Tape',
    'accelerations',
    'acting_forces',
    'balance',
    'generalised',
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
    'velocities',
]
