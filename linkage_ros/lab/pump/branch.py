# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The settled motions over the mean speed, where they become unstable, and what a motor keeps up.

Averaged over time, the motor's torque M0 - m phi1' is M0 - m w, w the mean speed. So M0(w) - m w
is the load that the settled motion at w puts on the motor, the load curve, and its crossings with
the motor's line are the motor's states. Followed over the speed, the curve passes its folds.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from linkage_ros.lab.pump.averaging import Averaged
from linkage_ros.lab.pump.boundaries import Boundary, find_boundaries
from linkage_ros.lab.pump.periodic import PeriodicMotion, Wanted, find_motions
from linkage_ros.lab.pump.poincare import PoincareMap
from linkage_ros.numeric import Array

END = 'end of the scan'
_TOGETHER = 45  # motions whose turns are followed at once


class BranchPiece(NamedTuple):
    """Settled motions without a change of stability or a gap.

    Attributes:
        motions: By growing speed, with the boundaries at the ends.
        stable: Whether they are.
    """

    motions: list[PeriodicMotion]
    stable: bool


class SettledState(NamedTuple):
    """A settled motion that a motor keeps up.

    Attributes:
        motion: The motion.
        piece: Number of the piece of the branch: those of one stable piece are the same state.
    """

    motion: PeriodicMotion
    piece: int


class BistableRange(NamedTuple):
    """Torques of the motor, N m, for which two stable states exist, or more.

    Attributes:
        low: Least.
        high: Largest.
        low_is: What ends it: the kind of a boundary, or END, of the speeds that were looked at.
        high_is: Likewise.
    """

    low: float
    high: float
    low_is: str
    high_is: str


@dataclass(frozen=True)
class Branch:
    """Settled motions over the mean speed.

    Attributes:
        stretches: By growing speed, without a gap within a stretch.
        boundaries: Between stable and unstable ones.
    """

    stretches: tuple[tuple[PeriodicMotion, ...], ...]
    boundaries: tuple[Boundary, ...]

    @property
    def pieces(self) -> list[BranchPiece]:
        """The motions of each stretch between boundaries."""
        ends = {boundary.motion for boundary in self.boundaries}
        pieces: list[BranchPiece] = []
        for stretch in self.stretches:
            low, high = stretch[0].speed, stretch[-1].speed
            inner = {motion for motion in ends if low < motion.speed < high}
            pieces.append(BranchPiece([], stretch[0].stable))
            for motion in sorted((*stretch, *inner), key=lambda motion: motion.speed):
                pieces[-1].motions.append(motion)
                if motion in inner:
                    pieces.append(BranchPiece([motion], not pieces[-1].stable))
        return pieces

    def bistable_ranges(self) -> list[BistableRange]:
        """The torques for which two stable states exist, or more.

        Along a stable piece the torque grows with the speed, so that each has one state there.
        """
        kinds = {boundary.motion: boundary.kind for boundary in self.boundaries}
        ends = [
            (motion.torque, change, kinds.get(motion, END))
            for motions, stable in self.pieces
            if stable
            for motion, change in ((motions[0], 1), (motions[-1], -1))
        ]
        found, exist = [], 0
        for one, other in itertools.pairwise(sorted(ends)):
            exist += one[1]
            if exist >= 2:
                found.append(BistableRange(one[0], other[0], one[2], other[2]))
        return found


def follow_branch(
    poincare: PoincareMap,
    averaged: Sequence[Sequence[Averaged]],
    progress: Callable[[Iterable[Any], str], Any],
) -> Branch:
    """Finds the settled motions at the speeds of averaged ones, and the boundaries.

    Args:
        poincare: The Poincare map.
        averaged: By growing speed, in stretches; Newton's method begins with them.
        progress: Wraps what is gone through, with a word for it.

    Returns:
        The branch; without the motions that are not found.
    """
    flat = [one.unknowns(poincare.damping) for one in itertools.chain(*averaged)]
    owners = [number for number, stretch in enumerate(averaged) for _ in stretch]
    guesses = np.array(flat).reshape(-1, 4).T
    found: list[PeriodicMotion | None] = []
    for first in progress(range(0, len(flat), _TOGETHER), 'load curve'):
        part = guesses[:, first : first + _TOGETHER]
        found += find_motions(poincare, part, Wanted(part[2], is_speed=True))
    _extend(poincare, guesses, owners, found)
    stretches = [
        tuple(motion for motion, _ in group if motion)
        for (is_found, _), group in itertools.groupby(
            zip(found, owners, strict=True), key=lambda pair: (pair[0] is not None, pair[1])
        )
        if is_found
    ]
    neighbours = itertools.chain(*map(itertools.pairwise, stretches))
    changes = [(one, other) for one, other in neighbours if one.stable != other.stable]
    return Branch(tuple(stretches), tuple(find_boundaries(poincare, changes)))


def _extend(
    poincare: PoincareMap,
    guesses: Array,
    owners: Sequence[int],
    found: list[PeriodicMotion | None],
) -> None:
    """Finds more motions from those at the speeds next to them, upwards and downwards."""
    for step in (1, -1):
        for i in range(len(found))[::step]:
            last = i - step
            if found[i] or not 0 <= last < len(found) or owners[last] != owners[i]:
                continue
            if neighbour := found[last]:
                guess = guesses[:, i] + neighbour.unknowns - guesses[:, last]
                wanted = Wanted(guesses[2:3, i], is_speed=True)
                found[i : i + 1] = find_motions(poincare, guess[:, None], wanted)


def find_states(
    poincare: PoincareMap, branch: Branch, torques: Sequence[float]
) -> list[list[SettledState]]:
    """The settled motions under a motor.

    Args:
        poincare: The Poincare map.
        branch: Where to look for them.
        torques: Torques of the motor at rest, N m.

    Returns:
        For each torque, the states by growing speed, stable or not.
    """
    places = [
        (number, piece, one, other, (torque - one.torque) / (other.torque - one.torque))
        for number, torque in enumerate(torques)
        for piece, (motions, _) in enumerate(branch.pieces)
        for one, other in itertools.pairwise(motions)
        if (one.torque < torque) != (other.torque < torque)
    ]
    guesses = [
        one.unknowns + share * (other.unknowns - one.unknowns) for *_, one, other, share in places
    ]
    values = np.array([torques[number] for number, *_ in places])
    wanted = Wanted(values, is_speed=False)
    found = find_motions(poincare, np.reshape(guesses, (-1, 4)).T, wanted) if places else []
    states: list[list[SettledState]] = [[] for _ in torques]
    for motion, (number, piece, one, other, _) in zip(found, places, strict=True):
        if motion and one.speed <= motion.speed <= other.speed:
            states[number].append(SettledState(motion, piece))
    return states
