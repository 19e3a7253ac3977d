# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The load curve of a pump: its periodic motions at all mean crank speeds, and their stability.

The motor's torque M0 - m phi1' has the time average M0 - m w, where w is the mean speed. The load
curve M0(w) - m w is therefore the mean load of the motion with the mean speed w. The steady states
are the intersections of the load curve with the torque-speed line of the motor. Each curve is
followed along its length, past its folds.
"""

import functools
import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from linkage_ros.lab.pump.harmonic_balance import STATE, Accuracy, HarmonicBalance
from linkage_ros.lab.pump.periodic_motion import PeriodicMotion

# Kinds of stability loss. The largest multiplier is 1 (two motions merge), -1, or a complex pair.
FOLD, PERIOD_DOUBLING, TORUS = 'fold', 'period doubling', 'torus'
# Ends of a curve: a limit of speed or torque; or no next motion, because the crank nearly stops or
# the motion needs too many harmonics.
END, LOST = 'end of the scan', 'end of what was followed'
ALONE = 'not followed further'  # ends of a piece with a single motion
_GAP = 1e-2  # relative torque difference between a period doubling and the doubled motion
# Longest step per turn and shortest step along a curve, in the units of the unknowns.
_STEP, _SHORTEST = 0.3, 1e-2
_SHARP, _STRAIGHT = 0.5, 0.9  # cosines of the angle between two steps
_MOST = 400  # largest number of steps along a curve
_CURVE = Accuracy(1e-6, 1e-5, 128)  # along a curve
_BOUNDARY = Accuracy(1e-10, 1e-5, 128)  # where the stability changes
_FEW = 2  # most turns of states whose curves are followed: four turns take eight times as long
_HALVINGS = 6  # of the way between two motions of a curve
_NEARLY_HALF = 0.51  # largest distance from the middle of that way
_MOST_SECANTS, _UNIT = 12, 1e-6  # steps to a multiplier of modulus 1, and tolerance


@dataclass(eq=False)
class Piece:
    """A piece of the load curve without a change of stability.

    Attributes:
        motions: The motions, in their order along the curve.
        begins_at: Type of the start: FOLD, PERIOD_DOUBLING, TORUS, END, LOST or ALONE.
        ends_at: Type of the end; the same types.
    """

    motions: list[PeriodicMotion]
    begins_at: str = LOST
    ends_at: str = LOST

    @property
    def middle(self) -> PeriodicMotion:
        """A motion in the middle of the piece."""
        return self.motions[len(self.motions) // 2]

    @property
    def stable(self) -> bool:
        """Whether the motions are stable; at the ends of a piece, stability may be undefined."""
        return self.middle.stable

    @property
    def ends(self) -> list[tuple[PeriodicMotion, str]]:
        """Motion and type of both ends; the end with the lower torque is first."""
        ends = (self.motions[0], self.begins_at), (self.motions[-1], self.ends_at)
        return sorted(ends, key=lambda end: end[0].torque)


class SteadyState(NamedTuple):
    """A periodic motion that a motor sustains.

    Attributes:
        motion: The sustained motion.
        piece: The piece of the load curve that contains it.
        averaged: The averaged motion near it; None if none was found.
        share: Fraction of the starts that settle in this state.
    """

    motion: PeriodicMotion
    piece: Piece
    averaged: PeriodicMotion | None = None
    share: float = 0.0


def steady_states(
    balance: HarmonicBalance,
    pieces: Iterable[Piece],
    torque: float,
    accuracy: Accuracy = STATE,
) -> list[SteadyState]:
    """Finds the steady states at a torque of the motor.

    Args:
        balance: Equations for the motor's damping.
        pieces: The pieces of the load curve.
        torque: Torque of the motor at rest, N m.
        accuracy: Required accuracy of the states.

    Returns:
        The states in order of speed.
    """
    states: list[SteadyState] = []
    for piece in pieces:
        for one, other in itertools.pairwise(piece.motions):
            if (one.torque < torque) != (other.torque < torque):
                motion = _between(balance, one, other, torque, accuracy)
                if motion and not any(motion.is_same(state.motion) for state in states):
                    states.append(SteadyState(motion, piece))
    return sorted(states, key=lambda state: state.motion.speed)


@functools.lru_cache(256)  # the same states are requested after each new curve
def _between(
    balance: HarmonicBalance,
    one: PeriodicMotion,
    other: PeriodicMotion,
    torque: float,
    accuracy: Accuracy,
) -> PeriodicMotion | None:
    """Finds the motion between two motions of a curve at a torque; None if there is none.

    Near a fold, Newton's method may lead to a motion beyond the fold. The search then continues in
    one half of the curve between the two motions.
    """
    equations = balance.over(one.turns, max(one.harmonics, other.harmonics))
    start, end = equations.unknowns(one), equations.unknowns(other)
    for _ in range(_HALVINGS):
        way = end - start
        plane = way / equations.units(one) ** 2
        motion = equations.find(start + (torque - start[-1]) / way[-1] * way, None, accuracy)
        move = equations.unknowns(motion) - start if motion else -way
        if abs((plane @ move) / (plane @ way) - 0.5) < _NEARLY_HALF:
            return motion
        middle = equations.find(start + way / 2, plane, accuracy)
        if middle is None:
            break
        half = equations.unknowns(middle)
        is_before = (half[-1] < torque) == (start[-1] < torque)
        start, end = (half, end) if is_before else (start, half)
    return None


def stability_lost(pieces: Sequence[Piece]) -> list[tuple[str, PeriodicMotion]]:
    """Returns the type of each change of stability along the curves, and the motion there."""
    return [
        (one.ends_at, one.motions[-1])
        for one, other in itertools.pairwise(pieces)
        if one.motions[-1] is other.motions[0]
    ]


def bistable_ranges(pieces: Sequence[Piece]) -> list[dict[str, Any]]:
    """Finds the torques of the motor at rest for which two or more stable states exist.

    Args:
        pieces: The pieces of the load curve. Along a stable piece, the torque is monotonic, so
            that each torque belongs to one state of the piece.

    Returns:
        For each range: its ends low and high, N m, and their types low_is and high_is.
    """
    spans = [
        [(motion.torque, kind) for motion, kind in piece.ends] for piece in pieces if piece.stable
    ]
    ranges: list[dict[str, Any]] = []
    for (low, low_is), (high, high_is) in itertools.pairwise(sorted(itertools.chain(*spans))):
        if sum(start <= (low, low_is) and (high, high_is) <= end for start, end in spans) < 2:
            continue
        if ranges and low - ranges[-1]['high'] < _GAP * low:  # a doubled period takes over
            ranges[-1].update(high=high, high_is=high_is)
        else:
            ranges.append({'low': low, 'high': high, 'low_is': low_is, 'high_is': high_is})
    return ranges


def with_curves(
    balance: HarmonicBalance,
    pieces: Sequence[Piece],
    seeds: Iterable[PeriodicMotion | None],
    speeds: tuple[float, float],
) -> list[Piece]:
    """Completes the load curve with the curves of further motions.

    Where the period of a motion of one turn doubles, the motions of two turns are followed as
    well.

    Args:
        balance: The equations for one turn.
        pieces: The known pieces.
        seeds: Further motions; None values are skipped.
        speeds: Lowest and highest mean speed to which the curves are followed, rad/s.

    Returns:
        All pieces.
    """
    found, waiting = list(pieces), list(seeds)
    for seed in waiting:
        if seed is None or seed.turns > _FEW or not speeds[0] <= seed.speed <= speeds[1]:
            continue
        if _is_on(balance, found, seed) or _is_end(found, seed):
            continue
        curve = follow(balance.over(seed.turns), seed, speeds)
        # A piece repeats a part of the curve if its own curve was lost there.
        found = [one for one in found if not _is_on(balance, curve, one.middle, _CURVE)] + curve
        waiting += [
            balance.doubled(piece.motions[-1])
            for piece in curve
            if seed.turns == 1 and piece.ends_at == PERIOD_DOUBLING
        ]
    return found


def _is_on(
    balance: HarmonicBalance,
    curve: Sequence[Piece],
    motion: PeriodicMotion,
    accuracy: Accuracy = STATE,
) -> bool:
    """Whether a curve contains a motion."""
    states = steady_states(balance, curve, motion.torque, accuracy)
    return any(motion.is_same(state.motion) for state in states)


def _is_end(pieces: Iterable[Piece], motion: PeriodicMotion) -> bool:
    """Whether a known curve ends at the period doubling near a motion of twice the period."""
    return any(
        kind == PERIOD_DOUBLING and one.turns == motion.turns
        and np.allclose((one.torque, one.speed), (motion.torque, motion.speed), rtol=_GAP)
        for piece in pieces
        for one, kind in piece.ends
    )  # fmt: skip


def follow(
    balance: HarmonicBalance, seed: PeriodicMotion, speeds: tuple[float, float]
) -> list[Piece]:
    """Follows the load curve from a motion in both directions.

    Args:
        balance: The equations for the same number of turns.
        seed: Motion from which the curve is followed.
        speeds: Lowest and highest mean speed, rad/s.

    Returns:
        The pieces of the curve, starting at its end with the slower crank.
    """
    (back, begins_at), (forth, ends_at) = (
        _continued(balance, seed, sign, speeds) for sign in (-1, 1)
    )
    motions = [*back[::-1], seed, *forth]
    pieces = [Piece([motions[0]], begins_at)]
    for one, other in itertools.pairwise(motions):
        if one.stable != other.stable:
            motion = _boundary(balance, one, other)
            pieces[-1].motions.append(motion)
            pieces[-1].ends_at = _kind(motion.multipliers[0])
            pieces.append(Piece([motion], pieces[-1].ends_at))
        pieces[-1].motions.append(other)
    pieces[-1].ends_at = ends_at
    return pieces


def _kind(multiplier: complex) -> str:
    if multiplier.imag:
        return TORUS
    return FOLD if multiplier.real > 0 else PERIOD_DOUBLING


def _continued(
    balance: HarmonicBalance, seed: PeriodicMotion, sign: int, speeds: tuple[float, float]
) -> tuple[list[PeriodicMotion], str]:
    """Follows the load curve from a motion in one direction.

    Returns the motions found, and the reason why the curve ends.
    """
    motions, longest = [seed], _STEP * seed.turns
    step = longest / 4
    way = sign * balance.tangent(seed) / balance.units(seed)
    way /= np.linalg.norm(way)
    bend, length = 0.0 * way, step  # change of the way per length, and length of the last step
    while step > _SHORTEST and len(motions) < _MOST:
        units, before = balance.units(motions[-1]), balance.unknowns(motions[-1])
        ahead = way + bend * (length + step) / 2
        one = balance.find(before + step * ahead * units, ahead / units, _CURVE)
        move = (balance.unknowns(one) - before) / units if one else -way
        size = float(np.linalg.norm(move))
        cosine = float(way @ move) / size
        if one is None or cosine < _SHARP:
            step /= 3
            finer = balance.finer(_CURVE.most) if step <= _SHORTEST else None
            if finer:
                way, bend = (finer.sized(*balance.split(row)) for row in (way, bend))
                balance, step = finer, longest / 4
            continue
        if one.shortest.turns < one.turns or _is_doubled(motions[-1], one):
            return motions[1:], PERIOD_DOUBLING
        motions.append(one)
        if not (speeds[0] <= one.speed <= speeds[1] and one.torque > 0):
            return motions[1:], END
        bend = (move / size - way) / ((length + size) / 2)
        way, length = move / size, size
        step = min(1.5 * step, longest) if cosine > _STRAIGHT else step
    return motions[1:], LOST


def _is_doubled(one: PeriodicMotion, other: PeriodicMotion) -> bool:
    """Returns whether the curve passes a period doubling between two motions.

    Beyond a period doubling, the turns of a motion are in reverse order.
    """
    if one.turns % 2:
        return False
    first, second = one.subharmonics(2), other.subharmonics(2)
    size = min(len(first), len(second))
    return bool(first[:size] @ second[:size] < 0)


def _boundary(
    balance: HarmonicBalance, one: PeriodicMotion, other: PeriodicMotion
) -> PeriodicMotion:
    """Finds, between two motions, the motion whose largest multiplier has the modulus 1.

    It uses the Illinois method (M. Dowell and P. Jarratt, BIT 11 (1971), 168-174) along the line
    between the two motions.
    """
    balance = balance.over(one.turns, max(one.harmonics, other.harmonics))
    way = balance.unknowns(other) - balance.unknowns(one)
    plane, found = way / balance.units(one) ** 2, other
    x, y = 0.0, 1.0
    at_x, at_y = abs(one.multipliers[0]) - 1, abs(other.multipliers[0]) - 1
    for _ in range(_MOST_SECANTS):
        if abs(at_y) < _UNIT:
            break
        z = y - at_y * (y - x) / (at_y - at_x)
        motion = balance.find(balance.unknowns(found) + (z - y) * way, plane, _BOUNDARY)
        if motion is None:
            break
        found, at_z = motion, abs(motion.multipliers[0]) - 1
        x, at_x = (x, 0.5 * at_x) if at_z * at_y > 0 else (y, at_y)
        y, at_y = z, at_z
    return found
