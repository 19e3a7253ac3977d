# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Names for custom mechanisms, loads and formulas, in addition to those of `linkage_ros`.

Public: other packages may import this module, and also `formulas`, `quantities`, `cli`, `palette`
and `executables`, and `LinkageNode` of `node.linkage_node`. All further modules may change in any
release.
"""

from linkage_ros.mechanism.dyads import dyads_field
from linkage_ros.mechanism.kinematics import LinkPose, Pose
from linkage_ros.mechanism.loads import LOADS, loads_field
from linkage_ros.mechanism.loads.base import AppliedLoad, Load, LoadedMechanism
from linkage_ros.mechanism.parts import gravity_quantity, points_field
from linkage_ros.mechanism.program import Constants, Program
from linkage_ros.mechanism.registry import MECHANISMS
from linkage_ros.mechanism.structure import Link, Point, Structure
from linkage_ros.mechanism.wrenches import Wrench
from linkage_ros.numeric import two_sum

__all__ = [
    'LOADS',
    'MECHANISMS',
    'AppliedLoad',
    'Constants',
    'Link',
    'LinkPose',
    'Load',
    'LoadedMechanism',
    'Point',
    'Pose',
    'Program',
    'Structure',
    'Wrench',
    'dyads_field',
    'gravity_quantity',
    'loads_field',
    'points_field',
    'two_sum',
]
