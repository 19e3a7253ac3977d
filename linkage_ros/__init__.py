# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Planar linkages that move exactly: states, driving torque, ROS 2 node, log, replay and view."""

__version__ = '0.1.0'

from linkage_ros.bodies import Body, Coupler, Frame, Guide, Slider
from linkage_ros.errors import (
    ConfigurationError,
    LinkageError,
    LogError,
    MechanismError,
    UnreachableError,
    ViewerError,
)
from linkage_ros.mechanism import CROSSED, OPEN, FourBar, SliderCrank
from linkage_ros.mobility import Mobility
from linkage_ros.reactions import Reactions
from linkage_ros.solver import Solver
from linkage_ros.state import PointMotion, State
from linkage_ros.travel import Travel, travel

__all__ = [
    'CROSSED',
    'OPEN',
    'Body',
    'ConfigurationError',
    'Coupler',
    'FourBar',
    'Frame',
    'Guide',
    'LinkageError',
    'LogError',
    'MechanismError',
    'Mobility',
    'PointMotion',
    'Reactions',
    'Slider',
    'SliderCrank',
    'Solver',
    'State',
    'Travel',
    'UnreachableError',
    'ViewerError',
    'travel',
]
