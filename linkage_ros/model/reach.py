# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The reach of a crank: where it turns, what limits it, and where motion is fast."""

import math
from typing import NamedTuple, NoReturn, TypeAlias

import numpy as np

from linkage_ros.errors import MechanismError, UnreachableError
from linkage_ros.numeric import Array

Arc: TypeAlias = tuple[float, float]

_PER_DECADE = 24  # ratio of lengths of successively finer steps
FULL_TURN: tuple[Arc, ...] = ((0.0, 2 * math.pi),)


class Reach(NamedTuple):
    """The reach of the crank of a mechanism with one degree of freedom.

    Attributes:
        grashof: Class, such as 'crank-rocker' or 'change-point'; see the mechanism.
        arcs: Reachable crank angles, (from, to) with from in [0, 2 pi), rad; the whole turn
            if it turns fully.
        period_turns: Turns of the crank after which the motion repeats.
        transmission: Smallest and largest transmission angle, rad in [0, pi]; 0 or pi: links
            become collinear. None: the mechanism has no such angle.
        limits: Reasons why the crank cannot turn fully; empty if it does.
        cures: Changes that would let it turn, each sufficient; empty if it does.
        equalities: Descriptions of sums of lengths that count as 0 but are not 0 in binary.
        fast: A crank angle at which motion may be fast, repeated every half turn, rad.
        width: Half-width of that region, rad; inf: motion is fast nowhere.
    """

    grashof: str
    arcs: tuple[Arc, ...] = FULL_TURN
    period_turns: int = 1
    transmission: Arc | None = None
    limits: tuple[str, ...] = ()
    cures: tuple[str, ...] = ()
    equalities: tuple[str, ...] = ()
    fast: float = 0.0
    width: float = math.inf

    @property
    def turns_fully(self) -> bool:
        """Whether the crank turns through every angle."""
        return not self.limits

    @property
    def has_change_point(self) -> bool:
        """Whether all links become collinear during a full turn."""
        low, high = self.transmission or (1.0, 1.0)
        return self.turns_fully and (low == 0 or high == math.pi)

    def require_full_turn(self) -> None:
        """Refuses a mechanism whose crank does not turn through every angle.

        Raises:
            MechanismError: The crank is limited; the message names class, cause and arcs.
        """
        if not self.turns_fully:
            raise MechanismError(self._refusal('turn fully'))

    def refuse(self, crank: float) -> NoReturn:
        """Refuses a crank angle without a state or with infinite rates.

        Args:
            crank: Crank angle, rad.

        Raises:
            UnreachableError: Always; the message names class, cause, cures and reachable arcs.
        """
        purpose = f'move at {math.degrees(crank):.9g} deg'
        raise UnreachableError(self._refusal(purpose), crank_angle=crank, arcs=self.arcs)

    def _refusal(self, purpose: str) -> str:
        arcs = ' and '.join(
            f'{math.degrees(start):.6g} to {math.degrees(end):.6g} deg' for start, end in self.arcs
        )
        return (
            f'the crank of this {self.grashof} linkage cannot {purpose}: '
            f'{"; ".join(self.limits)}; {" or ".join(self.cures)}; it reaches {arcs}'
        )

    def samples(self, steps_per_turn: int = 720) -> Array:
        """Crank angles over one period that resolve the motion.

        Steps are finer where motion is fast, far below the width.

        Args:
            steps_per_turn: Number of even steps in a turn.

        Returns:
            Angles from 0 to 2 pi or 4 pi, rad, in rising order.
        """
        turns = self.period_turns
        even: Array = np.linspace(
            0, turns * 2 * math.pi, turns * steps_per_turn + 1, dtype=np.float64
        )
        step = math.pi / steps_per_turn
        if self.width > 20 * step:
            return even
        decades = math.log10(step * 40 / self.width) + 2
        fine = np.geomspace(self.width * 0.01, step * 40, math.ceil(decades * _PER_DECADE))
        around = np.concatenate([-fine[::-1], [0.0], fine])
        places = [self.fast % math.pi + math.pi * i for i in range(-1, 2 * turns + 1)]
        angles = np.concatenate([even, *(place + around for place in places)])
        all_angles: Array = np.unique(angles[(angles >= 0) & (angles <= even[-1])])
        return all_angles
