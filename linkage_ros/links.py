# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What kinematics hands to dynamics: the links' directions and how they follow the speeds."""

from __future__ import annotations

from typing import TypeAlias

from linkage_ros.numeric import Real

# One value for each of the three moving links.
PerLink: TypeAlias = tuple[Real, Real, Real]

# The three moving links in one position, floats or arrays: a plain tuple, because it is made at
# every step and a named one costs a tenth of the whole state.
#   angle      directions from first to second pin, in [-pi, pi] except the crank's, rad
#   cos, sin   of these
#   partial    for each independent speed, every link's spin per unit of that speed
#   curvature  every link's angular acceleration per squared crank speed, while the crank's own
#              acceleration is zero
Links: TypeAlias = tuple[PerLink, PerLink, PerLink, tuple[PerLink, ...], PerLink]
