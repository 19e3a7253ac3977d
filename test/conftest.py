# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Every floating-point surprise is an error, and random tests draw the same cases every time."""

from __future__ import annotations

import numpy as np
from hypothesis import settings

np.seterr(all='raise')
settings.register_profile(
    'repeatable', deadline=None, derandomize=True, database=None, max_examples=60
)
settings.load_profile('repeatable')
