# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Drives of a mechanism, one kind in each file, and the registry of their kinds."""

from linkage_ros.motion.drives.base import Drive
from linkage_ros.motion.drives.follow import FollowDrive
from linkage_ros.motion.drives.law import LawDrive
from linkage_ros.motion.drives.speed import SpeedDrive
from linkage_ros.motion.drives.torque import TorqueDrive

# Kinds of drives by their names in parameter files.
DRIVES: dict[str, type[Drive]] = {
    'speed': SpeedDrive,
    'torque': TorqueDrive,
    'follow': FollowDrive,
    'motion': LawDrive,
}
