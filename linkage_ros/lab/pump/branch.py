# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The periodic motions over the mean crank speed, and where they lose their stability.

Averaged over time, the motor's torque M0 - m phi1' is M0 - m w, w the mean speed. So M0(w) - m w
is the load of the motion at w: the load curve. Its crossings with the motor's line are the
steady states.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from linkage_ros.lab.pump.harmonic_balance import (
    HarmonicBalance,
    at_torque,
    between,
)
from linkage_ros.lab.pump.periodic_motion import PeriodicMotion

# How stability is lost, by the largest multiplier: 1 (two motions merge), -1, or a complex pair.
FOLD, PERIOD_DOUBLING, TORUS = 'fold', 'period doubling', 'torus'
# Why a curve ends: at a limit of speed or torque; where no next motion is found, since the crank
# stops or the dyad is stretched.
END, LOST = 'end of the scan', 'end of the description'
_GAP = 1e-2  # relative, between a torque where a period doubles and the doubled motion beside it


@dataclass(eq=False)
class Piece:
    """A piece of the load curve without a change of stability.

    Attributes:
        motions: In the order of the curve.
        begins_at: FOLD, PERIOD_DOUBLING, TORUS, END or LOST.
        ends_at: Likewise.
    """

    motions: list[PeriodicMotion]
    begins_at: str = END
    ends_at: str = END

    @property
    def stable(self) -> bool:
        """Whether its motions are stable; at its ends they may be neither."""
        return self.motions[len(self.motions) // 2].stable


class SteadyState(NamedTuple):
    """A motion that a motor keeps up.

    Attributes:
        motion: The motion.
        piece: The piece of the load curve in which it lies.
    """

    motion: PeriodicMotion
    piece: Piece


def steady_states(
    balance: HarmonicBalance, found: Sequence[Piece], torque: float
) -> list[SteadyState]:
    """The motions at a torque of the motor.

    Args:
        balance: The equations.
        found: The pieces of the load curve.
        torque: Torque of the motor at rest, N m.

    Returns:
        The states by growing speed.
    """
    states = []
    for piece in found:
        for one, other in itertools.pairwise(piece.motions):
            if (one.torque < torque) != (other.torque < torque):
                share = (torque - one.torque) / (other.torque - one.torque)
                equations = balance.over(one.turns)
                guess = between(equations, one, other, share)
                if motion := equations.find(guess, at_torque(torque)):
                    states.append(SteadyState(motion, piece))
    return sorted(states, key=lambda state: state.motion.speed)


def bistable_ranges(found: Sequence[Piece]) -> list[dict[str, Any]]:
    """The torques of the motor at rest for which two or more stable states exist.

    Args:
        found: The pieces of the load curve. Along a stable piece the torque grows or falls, so
            that it has one state at each of its torques.

    Returns:
        For each range: low and high, N m; low_is and high_is, what ends it there.
    """
    ends = []
    for piece in found:
        if piece.stable:
            first, last = piece.motions[0].torque, piece.motions[-1].torque
            lower, upper = sorted(((first, piece.begins_at), (last, piece.ends_at)))
            ends += [(lower[0], 1, lower[1]), (upper[0], -1, upper[1])]
    ranges: list[dict[str, Any]] = []
    exist = 0
    for (low, change, low_is), (high, _, high_is) in itertools.pairwise(sorted(ends)):
        exist += change
        if exist >= 2:
            one = {'low': low, 'high': high, 'low_is': low_is, 'high_is': high_is}
            if ranges and low - ranges[-1]['high'] < _GAP * low:  # a doubled period takes over
                one.update(low=ranges[-1]['low'], low_is=ranges[-1]['low_is'])
                ranges.pop()
            ranges.append(one)
    return ranges
