# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The elementary functions of a method, for floats and for arrays."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from linkage_ros.numeric import Real


@dataclass(frozen=True)
class Functions:
    """The elementary functions that a formula needs, for floats or for arrays.

    Attributes:
        sin: Sine of an angle, rad.
        cos: Likewise.
        sqrt: Square root.
        atan2: Direction of (y, x), rad, in [-pi, pi].
        round: To the nearest whole number.
        where: The second where the first holds, else the third.
        lowest: The least value of an array, infinity of an empty one, or the float itself.
    """

    sin: Callable[[Real], Real]
    cos: Callable[[Real], Real]
    sqrt: Callable[[Real], Real]
    atan2: Callable[[Real, Real], Real]
    round: Callable[[Real], Real]
    where: Callable[[Real, Real, Real], Real]
    lowest: Callable[[Real], float]


SCALAR = Functions(
    sin=math.sin, cos=math.cos, sqrt=math.sqrt, atan2=math.atan2, round=round, lowest=float,
    where=lambda condition, then, otherwise: then if condition else otherwise,
)  # fmt: skip
ARRAY = Functions(
    sin=np.sin, cos=np.cos, sqrt=np.sqrt, atan2=np.arctan2, round=np.rint, where=np.where,
    lowest=lambda values: np.min(values, initial=np.inf),
)  # fmt: skip
