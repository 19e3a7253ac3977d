# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Planar linkages that move exactly: states, driving torque, ROS 2 node, log, replay and view."""

__version__ = '0.1.0'

from linkage_ros.core.bodies import Body, Coupler, Frame, Guide, Piston, Slider
from linkage_ros.core.equations import EquationsOfMotion
from linkage_ros.core.mechanism import CROSSED, OPEN, FourBar, SliderCrank, WindPump
from linkage_ros.core.mobility import Mobility
from linkage_ros.core.reactions import Reactions
from linkage_ros.core.solver import Solver
from linkage_ros.core.state import PointMotion, State
from linkage_ros.core.travel import Travel, travel
from linkage_ros.errors import (
    ConfigurationError,
    LinkageError,
    LogError,
    MechanismError,
    MotionError,
    UnreachableError,
    ViewerError,
)

__all__ = [
    'CROSSED',
    'OPEN',
    'Body',
    'ConfigurationError',
    'Coupler',
    'EquationsOfMotion',
    'FourBar',
    'Frame',
    'Guide',
    'LinkageError',
    'LogError',
    'MechanismError',
    'Mobility',
    'MotionError',
    'Piston',
    'PointMotion',
    'Reactions',
    'Slider',
    'SliderCrank',
    'Solver',
    'State',
    'Travel',
    'UnreachableError',
    'ViewerError',
    'WindPump',
    'travel',
]
