# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What kinematics hands to dynamics: the links' positions and how they follow the speeds."""

from __future__ import annotations

from typing import TypeAlias

from linkage_ros.numeric import Real

# One value for each coordinate: the crank's angle and, of a wind pump, the slider's place.
PerCoordinate: TypeAlias = tuple[Real, ...]
# One value for each of the moving links: three, or four with a free slider.
PerLink: TypeAlias = tuple[Real, ...]

# The moving links in one position, floats or arrays: a plain tuple, because it is made at every
# step and a named one costs a tenth of the whole state. The crank and the coupler turn; the third
# link turns, or slides. A free slider is the fourth: as its motion is a coordinate's, it is in
# `position` alone.
#   position   directions from first to second pin, in [-pi, pi] except the crank's, rad; of a
#              sliding link its place along its guide, m
#   cos, sin   of these directions; of a sliding link, of its guide's
#   partial    for each coordinate, every link's velocity per rate of that coordinate
#   curvature  for each pair of coordinates (1 1; 1 2; 2 2), every link's acceleration per product
#              of their rates, while none of these rates changes
Links: TypeAlias = tuple[PerLink, PerLink, PerLink, tuple[PerLink, ...], tuple[PerLink, ...]]
