# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The periodic motions over the mean crank speed, and where they lose their stability.

Averaged over time, the motor's torque M0 - m phi1' is M0 - m w, w the mean speed. So M0(w) - m w
is the load of the motion at w: the load curve. Its crossings with the motor's line are the
steady states. Followed over the speed, the curve passes its folds.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from scipy import optimize

from linkage_ros.lab.pump.harmonic_balance import HarmonicBalance
from linkage_ros.lab.pump.periodic_motion import PeriodicMotion
from linkage_ros.numeric import Array

# How stability is lost, by the largest multiplier: 1 (two motions merge), -1, or a complex pair.
FOLD, PERIOD_DOUBLING, TORUS = 'fold', 'period doubling', 'torus'
END = 'end of the scan'
_ROUNDING = 1e-9  # of a speed


@dataclass(eq=False)
class Piece:
    """A piece of the load curve without a change of stability.

    Attributes:
        motions: By growing speed.
        begins_at: FOLD, PERIOD_DOUBLING, TORUS or END.
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
                if motion := balance.find(_between(one, other, share), torque=torque):
                    states.append(SteadyState(motion, piece))
    return sorted(states, key=lambda state: state.motion.speed)


def follow(balance: HarmonicBalance, speeds: Sequence[float]) -> list[list[PeriodicMotion]]:
    """Follows the motions over the speed, from above and from below, each from the one before.

    Args:
        balance: The equations.
        speeds: Mean speeds of the crank, growing, rad/s.

    Returns:
        By growing speed, in one stretch or, if they do not meet, in two.
    """
    down = list(_follow(balance, speeds[::-1]))[::-1]
    lowest = down[0].speed * (1 - _ROUNDING) if down else math.inf
    up = list(_follow(balance, [speed for speed in speeds if speed < lowest]))
    return [stretch for stretch in (up, down) if stretch]


def _follow(balance: HarmonicBalance, speeds: Iterable[float]) -> Iterator[PeriodicMotion]:
    """From the first speed with a motion to the last before one without."""
    guesses: list[Array] = []
    for speed in speeds:
        found = (balance.find(x, speed=speed) for x in guesses or balance.resting_sliders(speed))
        motion = next(filter(None, found), None)
        if motion:
            guesses = [motion.unknowns]
            yield motion
        elif guesses:
            return


def pieces(balance: HarmonicBalance, stretch: Sequence[PeriodicMotion]) -> list[Piece]:
    """Cuts a stretch of motions where their stability changes.

    Args:
        balance: The equations.
        stretch: By growing speed, without a gap.

    Returns:
        The pieces; neighbours share the motion between them.
    """
    found = [Piece([stretch[0]])]
    for one, other in itertools.pairwise(stretch):
        if one.stable != other.stable:
            motion, kind = _boundary(balance, one, other)
            found[-1].motions.append(motion)
            found[-1].ends_at = kind
            found.append(Piece([motion], begins_at=kind))
        found[-1].motions.append(other)
    return found


def _boundary(
    balance: HarmonicBalance, one: PeriodicMotion, other: PeriodicMotion
) -> tuple[PeriodicMotion, str]:
    """The motion between two others whose largest multiplier has the modulus 1, and the kind."""

    def motion(share: float) -> PeriodicMotion:
        speed = one.speed + share * (other.speed - one.speed)
        found = balance.find(_between(one, other, share), speed=speed)
        return found or (one if share < 0.5 else other)

    share: float = optimize.brentq(
        lambda share: abs(motion(share).multipliers[0]) - 1, 0.0, 1.0, xtol=1e-9
    )
    found = motion(share)
    largest = found.multipliers[0]
    if largest.imag:
        return found, TORUS
    return found, FOLD if largest.real > 0 else PERIOD_DOUBLING


def _between(one: PeriodicMotion, other: PeriodicMotion, share: float) -> Array:
    return one.unknowns + share * (other.unknowns - one.unknowns)


def bistable_ranges(found: Sequence[Piece]) -> list[dict[str, Any]]:
    """The torques of the motor at rest for which two or more stable states exist.

    Args:
        found: The pieces of the load curve. Along a stable piece the torque grows with the
            speed, so that it has one state at each of its torques.

    Returns:
        For each range: low and high, N m; low_is and high_is, what ends it there.
    """
    ends = []
    for piece in found:
        if piece.stable:
            ends.append((piece.motions[0].torque, 1, piece.begins_at))
            ends.append((piece.motions[-1].torque, -1, piece.ends_at))
    ranges, exist = [], 0
    for (low, change, low_is), (high, _, high_is) in itertools.pairwise(sorted(ends)):
        exist += change
        if exist >= 2:
            ranges.append({'low': low, 'high': high, 'low_is': low_is, 'high_is': high_is})
    return ranges
