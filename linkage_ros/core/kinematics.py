# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The exact kinematics of a mechanism, found by its description."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from linkage_ros.core.four_bar import FourBarKinematics
from linkage_ros.core.links import Links
from linkage_ros.core.mechanism import FourBar, Linkage, Mechanism, SliderCrank, WindPump
from linkage_ros.core.numeric import Functions, Real
from linkage_ros.core.slider_crank import SliderCrankKinematics
from linkage_ros.core.structure import Structure
from linkage_ros.core.transmission import TransmissionMap
from linkage_ros.core.wind_pump import WindPumpKinematics
from linkage_ros.errors import MechanismError


class Kinematics(Protocol):
    """What every mechanism with one degree of freedom offers.

    Attributes:
        map: From the crank to the transmission angle.
        structure: How the links hang together.
        side: 1 for the open assembly, -1 for the crossed one.
    """

    map: TransmissionMap
    structure: Structure
    side: float

    def locate(self, crank: Real, functions: Functions) -> tuple[Real, Real]:
        """The coupler's direction, rad, and the output, rad or m, where the loop closes."""

    def solve(self, crank: Real, functions: Functions) -> Links:
        """The position and its derivatives by the crank angle, where the loop closes."""


KINEMATICS: dict[type[Linkage], Callable[..., Kinematics]] = {
    FourBar: FourBarKinematics,
    SliderCrank: SliderCrankKinematics,
}


def kinematics_of(mechanism: Linkage) -> Kinematics:
    """The kinematics of a described mechanism.

    Raises:
        MechanismError: It has not one degree of freedom, or is no mechanism.
    """
    if type(mechanism) not in KINEMATICS:
        names = ', '.join(kind.__name__ for kind in KINEMATICS)
        raise MechanismError(
            f'a {type(mechanism).__name__} is no linkage whose crank tells all: one of {names}; '
            'a WindPump has EquationsOfMotion'
        )
    return KINEMATICS[type(mechanism)](mechanism)


def structure_of(mechanism: Mechanism) -> Structure:
    """How the links of a described mechanism hang together."""
    if isinstance(mechanism, WindPump):
        return WindPumpKinematics(mechanism).structure
    return kinematics_of(mechanism).structure
