# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The mechanisms that there are: their names, their descriptions and their kinematics."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, TypeAlias

from linkage_ros.mechanisms.four_bar import FourBar
from linkage_ros.mechanisms.four_bar_kinematics import FourBarKinematics
from linkage_ros.mechanisms.links import Links
from linkage_ros.mechanisms.slider_crank import SliderCrank
from linkage_ros.mechanisms.slider_crank_kinematics import SliderCrankKinematics
from linkage_ros.mechanisms.structure import Structure
from linkage_ros.mechanisms.transmission import TransmissionMap
from linkage_ros.mechanisms.wind_pump import WindPump
from linkage_ros.numeric import Functions, Real

# Mechanisms of one degree of freedom: the crank angle tells where all links are.
Linkage: TypeAlias = FourBar | SliderCrank
Mechanism: TypeAlias = Linkage | WindPump

# The names under which parameter files ask for a mechanism.
MECHANISMS: dict[str, type[Mechanism]] = {
    'four_bar': FourBar,
    'slider_crank': SliderCrank,
    'wind_pump': WindPump,
}


class LoopSolution(Protocol):
    """What is written for each mechanism of one degree of freedom: its loop, solved.

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


KINEMATICS: dict[type[Linkage], Callable[..., LoopSolution]] = {
    FourBar: FourBarKinematics,
    SliderCrank: SliderCrankKinematics,
}
