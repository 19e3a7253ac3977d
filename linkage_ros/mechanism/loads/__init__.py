# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Loads on mechanisms, one kind in each file, and the registry of their kinds."""

from typing import Any

from linkage_ros.mechanism.loads.base import AppliedLoad
from linkage_ros.mechanism.loads.curve import LoadCurve
from linkage_ros.mechanism.loads.force import Force
from linkage_ros.mechanism.loads.friction import Friction
from linkage_ros.mechanism.loads.gas import Gas
from linkage_ros.mechanism.loads.link_load import LinkLoad
from linkage_ros.mechanism.loads.pins import Pins
from linkage_ros.mechanism.loads.spring import Spring
from linkage_ros.quantities import groups

# Kinds of loads by their names in parameter files. Other packages may add their own kinds before
# they start a program of this package.
LOADS: dict[str, type[AppliedLoad]] = {
    'force': Force,
    'spring': Spring,
    'pins': Pins,
    'gas': Gas,
    'curve': LoadCurve,
    'link': LinkLoad,
    'friction': Friction,
}


def loads_field() -> Any:
    """Declares the field of a mechanism that holds its loads."""
    return groups(AppliedLoad, LOADS)
