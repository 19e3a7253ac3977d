# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What kinematics hands to dynamics: the links' positions and how they follow the speeds."""

from __future__ import annotations

from typing import TypeAlias

from linkage_ros.core.numeric import Real

# One value for each of the moving links: three, or four where a slider moves by itself.
PerLink: TypeAlias = tuple[Real, ...]

# The moving links in one position, floats or arrays: a plain tuple, because it is made at every
# step and a named one costs a tenth of the whole state. The crank and the coupler turn; the third
# link turns, or slides. A slider that is a coordinate by itself is the fourth: as its motion is
# that coordinate's, it is in `position` alone.
#   position   directions from first to second pin, in [-pi, pi] except the crank's, rad; of a
#              sliding link its place along its guide, m
#   cos, sin   of these directions; of a sliding link, of its guide's
#   partial    for each independent speed, every link's velocity per unit of that speed
#   curvature  for each pair of independent speeds (1 1; 1 2; 2 2), every link's acceleration per
#              their product, while none of these speeds changes
Links: TypeAlias = tuple[PerLink, PerLink, PerLink, tuple[PerLink, ...], tuple[PerLink, ...]]
