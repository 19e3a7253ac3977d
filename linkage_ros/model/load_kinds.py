# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The kinds of load."""

from typing import Any

from linkage_ros.model.load_curve import LoadCurve
from linkage_ros.model.loads import AppliedLoad, Friction, LinkLoad
from linkage_ros.quantities import groups

# Add a new one here.
LOADS: tuple[type[AppliedLoad], ...] = (LinkLoad, LoadCurve, Friction)


def loads_field() -> Any:
    """Declares the field of a mechanism that holds its loads."""
    return groups(AppliedLoad, LOADS)
