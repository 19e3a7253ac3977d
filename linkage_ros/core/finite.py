# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Numbers that have to be finite, one by one or in arrays: nothing is computed from others."""

from __future__ import annotations

from math import isfinite

import numpy as np

from linkage_ros.core.numeric import Real
from linkage_ros.errors import ConfigurationError


def all_finite(*values: Real) -> bool:
    """Whether floats, and all values of arrays, are finite."""
    # A sum is cheaper than a look at each; it may overflow where none of them is infinite.
    return all(
        isfinite(x if isinstance(x, float) else np.sum(x)) or bool(np.isfinite(x).all())
        for x in values
    )


def require_finite(**named: Real) -> None:
    """Passes if they are.

    Args:
        **named: Floats or arrays, by what they are called, words joined by _.

    Raises:
        ConfigurationError: One is not, which it names.
    """
    for name, values in named.items():
        if not all_finite(values):
            bad = np.atleast_1d(values)[~np.isfinite(np.atleast_1d(values))]
            words = name.replace('_', ' ')
            raise ConfigurationError(f'{words} = {bad[0]}: must be a finite number')
