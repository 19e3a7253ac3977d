# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The exact kinematics of a mechanism, found by its description."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from linkage_ros.errors import MechanismError
from linkage_ros.mechanisms.links import Links, PerCoordinate
from linkage_ros.mechanisms.mobility import assess, refuse
from linkage_ros.mechanisms.registry import KINEMATICS, Linkage, Mechanism
from linkage_ros.mechanisms.structure import Structure
from linkage_ros.mechanisms.wind_pump import WindPump
from linkage_ros.mechanisms.wind_pump_kinematics import WindPumpKinematics
from linkage_ros.numeric import SCALAR, Functions, Real


class Kinematics(Protocol):
    """What every mechanism offers.

    Attributes:
        structure: How the links hang together.
        has_edge: Whether motion can reach places beyond which the coordinates do not describe it.
    """

    structure: Structure
    has_edge: bool

    def links(self, q: PerCoordinate, functions: Functions) -> Links:
        """The links where the coordinates are, rad and m; UnreachableError: no loop closes."""

    def dyad(self, q: PerCoordinate) -> tuple[float, str]:
        """The sine of the angle at which coupler and third link meet, and what they are at 0."""


class CrankKinematics:
    """Of a mechanism whose crank angle tells all, with the angles refused that it cannot have.

    Attributes:
        structure: How the links hang together.
        map: From the crank to the transmission angle.
        side: 1 for the open assembly, -1 for the crossed one.
        locate: The position alone, as `LoopSolution` has it.
        solve: The position and its derivatives, likewise.
        mobility: What the crank can do.
        has_edge: Whether the crank is limited. Change points are passed: there no coordinate
            turns back.
    """

    def __init__(self, mechanism: Linkage) -> None:
        """Finds the solution of its loop.

        Raises:
            MechanismError: It has not one degree of freedom, or is no mechanism.
        """
        if type(mechanism) not in KINEMATICS:
            names = ', '.join(kind.__name__ for kind in KINEMATICS)
            raise MechanismError(
                f'a {type(mechanism).__name__} is no linkage whose crank tells all: one of '
                f'{names}; a WindPump has EquationsOfMotion'
            )
        solution = KINEMATICS[type(mechanism)](mechanism)
        self.structure, self.map, self.side = solution.structure, solution.map, solution.side
        self.locate, self.solve = solution.locate, solution.solve
        self.mobility = assess(mechanism, self.map)
        self.has_edge = not self.mobility.turns_fully

    def links(self, q: PerCoordinate, functions: Functions) -> Links:
        """The links at a crank angle.

        Args:
            q: The crank angle, rad; float or array.
            functions: SCALAR or ARRAY.

        Returns:
            Positions, rates and curvatures per crank speed.

        Raises:
            UnreachableError: The loop cannot close at a crank angle.
        """
        if self.has_edge:
            self.require_reachable(q[0], functions)
        return self.solve(q[0], functions)

    def require_reachable(self, crank: Real, functions: Functions) -> None:
        """Refuses crank angles that a limited crank cannot have.

        Args:
            crank: Crank angle, rad; float or array.
            functions: SCALAR or ARRAY.

        Raises:
            UnreachableError: The loop cannot close at a crank angle.
        """
        for margin in self.map.margins(crank, functions):
            if not functions.lowest(margin) > 0:
                worst = np.atleast_1d(crank)[np.atleast_1d(margin) <= 0][0]
                refuse(self.mobility, float(worst))

    def dyad(self, q: PerCoordinate) -> tuple[float, str]:
        """How near coupler and output link are to one line, or the coupler to across its guide.

        Args:
            q: The crank angle, rad; a float.

        Returns:
            The sine of the transmission angle, and what they are where it is 0.
        """
        (crank,), mapped = q, self.map
        if self.has_edge and min(mapped.margins(crank, SCALAR)) <= 0:
            sine, folded = 0.0, mapped.q < 0 and mapped.margins(crank, SCALAR)[-1] <= 0
        else:
            _, _, sin_m, cos_m = mapped.place(crank, SCALAR)
            sine, folded = abs(2 * sin_m * cos_m), abs(sin_m) < abs(cos_m)
        if self.structure.slider:
            return sine, 'the coupler stands across the guide'
        return sine, f'coupler and rocker are {"folded" if folded else "stretched"}'


def kinematics_of(mechanism: Mechanism) -> Kinematics:
    """The kinematics of a described mechanism.

    Raises:
        MechanismError: It is no mechanism.
    """
    if isinstance(mechanism, WindPump):
        return WindPumpKinematics(mechanism)
    return CrankKinematics(mechanism)
