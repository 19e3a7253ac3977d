# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Curves of periodic motions over the motor's torque, followed along their length past folds.

The motor's torque M0 - m phi1' has the time average M0 - m w, where w is the mean speed. Over w, a
curve is therefore the load curve M0(w) - m w of the pump; the steady states are its intersections
with the torque-speed line of the motor.
"""

import functools
import itertools
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import brentq

from linkage_lab.pump.shooting import CURVE, PeriodicMotion
from linkage_ros import MotionError
from linkage_ros.formulas import Array

# Kinds of stability loss. The largest multiplier is 1 (two motions merge), -1, or a complex pair.
FOLD, PERIOD_DOUBLING, TORUS = 'fold', 'period doubling', 'torus'
# Ends of a curve: the limits of the torque; or no next motion, because the crank nearly stops or
# the dyad is stretched.
END, LOST = 'end of the scan', 'end of what was followed'
_FARTHEST, _SLOWEST = 4.0, 0.1  # largest torque and smallest speed, relative to the motor's
# First, longest and shortest step, in the units of a phase; largest number of steps.
_STEP, _LONGEST, _SHORTEST, _MOST = 0.05, 0.25, 3e-3, 400
_SHARP, _STRAIGHT = 0.9, 0.98  # cosines of the angle between two steps
_GAP = 1e-2  # relative difference of two torques between which a doubled period takes over


class End(NamedTuple):
    """An end of a piece of a curve.

    Attributes:
        torque: Torque of the motor at rest, N m.
        kind: FOLD, PERIOD_DOUBLING, TORUS, END or LOST.
    """

    torque: float
    kind: str


@dataclass(eq=False)
class Piece:
    """A piece of a curve without a change of stability.

    Attributes:
        motions: The motions, in their order along the curve.
        begins_at: Kind of the start; see `End`.
        ends_at: Kind of the end.
    """

    motions: list[PeriodicMotion]
    begins_at: str
    ends_at: str = LOST

    @property
    def stable(self) -> bool:
        """Whether the motions are stable; at the ends of a piece, stability may be undefined."""
        return self.motions[len(self.motions) // 2].stable

    @property
    def ends(self) -> list[End]:
        """Both ends, that with the lower torque first."""
        first, last = self.motions[0].torque, self.motions[-1].torque
        return sorted([End(first, self.begins_at), End(last, self.ends_at)])

    def states(self, torque: float) -> Iterator[PeriodicMotion]:
        """Finds the motions at a torque of the motor at rest, N m."""
        for one, other in itertools.pairwise(self.motions):
            if (one.torque < torque) != (other.torque < torque):
                near = _between(one, other, lambda motion: motion.torque - torque, 1e-3)
                with suppress(MotionError):
                    yield near.shooting.find(np.append(near.phase[:3], torque), near.turns)


def _between(
    one: PeriodicMotion,
    other: PeriodicMotion,
    value: Callable[[PeriodicMotion], float],
    error: float = 1e-7,
) -> PeriodicMotion:
    """Finds the motion between two motions of a curve at which a value is 0, or else the second.

    `error` is the tolerance of its position, as a fraction of the distance between the two.
    """
    shooting = one.shooting
    chord = (other.phase - one.phase) / shooting.units

    @functools.cache
    def motion_at(fraction: float) -> PeriodicMotion:
        if fraction in {0.0, 1.0}:
            return other if fraction else one
        guess = one.phase + fraction * chord * shooting.units
        return shooting.find(guess, one.turns, chord, CURVE)

    with suppress(MotionError):
        fraction = brentq(lambda fraction: value(motion_at(fraction)), 0.0, 1.0, xtol=error)
        return motion_at(fraction)
    return other


def follow(seed: PeriodicMotion) -> list[Piece]:
    """Follows the curve through a motion in both directions.

    Returns:
        The pieces of the curve, in order.
    """
    (back, begins_at), (forth, ends_at) = (_continued(seed, sign) for sign in (-1.0, 1.0))
    motions = [*back[::-1], seed, *forth]
    pieces = [Piece([motions[0]], begins_at)]
    for one, other in itertools.pairwise(motions):
        if one.stable != other.stable:
            edge = _between(one, other, lambda motion: abs(motion.multipliers[0]) - 1)
            pieces[-1].motions.append(edge)
            pieces[-1].ends_at = _kind(edge.multipliers[0])
            pieces.append(Piece([edge], pieces[-1].ends_at))
        pieces[-1].motions.append(other)
    pieces[-1].ends_at = ends_at
    return pieces


def _kind(multiplier: complex) -> str:
    if multiplier.imag:
        return TORUS
    return FOLD if multiplier.real > 0 else PERIOD_DOUBLING


def _continued(seed: PeriodicMotion, sign: float) -> tuple[list[PeriodicMotion], str]:
    """Follows a curve in one direction, by pseudo-arclength continuation.

    Returns the motions found, and the reason why the curve ends.
    """
    shooting, motions, step, end = seed.shooting, [seed], _STEP, LOST
    direction = np.array((0.0, sign, 0.0, 0.0))
    while step > _SHORTEST and len(motions) < _MOST:
        last = motions[-1]
        tangent = _tangent(last, direction)
        guess = last.phase + step * shooting.units * tangent
        try:
            motion = shooting.find(guess, last.turns, tangent, CURVE)
        except MotionError:
            step /= 3
            continue
        move = (motion.phase - last.phase) / shooting.units
        cosine = float(tangent @ move / np.linalg.norm(move))
        if _passes_doubling(last, motion):
            end = PERIOD_DOUBLING
            step /= 3
        elif cosine < _SHARP:
            step /= 3
        else:
            motions.append(motion)
            if _is_outside(motion):
                return motions[1:], END
            direction = move
            step = min(1.5 * step, _LONGEST) if cosine > _STRAIGHT else step
    return motions[1:], end


def _tangent(motion: PeriodicMotion, direction: Array) -> Array:
    """Returns the unit tangent of the curve at a motion, in the units of a phase.

    It is the null vector of the derivative of P^n(y) - y, with the sign that makes an acute angle
    with a direction.
    """
    _, _, rows = np.linalg.svd(motion.derivative - np.eye(3, 4))
    return rows[-1] * np.copysign(1.0, rows[-1] @ direction)


def _is_outside(motion: PeriodicMotion) -> bool:
    """Returns whether the torque is outside the scan, or the crank almost stops."""
    _, pace, _, torque = motion.shooting.units
    return not (0 < motion.torque < _FARTHEST * torque and motion.speed > _SLOWEST * pace)


def _passes_doubling(one: PeriodicMotion, other: PeriodicMotion) -> bool:
    """Returns whether a curve ends between two motions, at a motion with half as many turns.

    Beyond this point, the turns would be in reverse order.
    """
    if one.turns == 1:
        return False
    if other.turns < one.turns:
        return True
    units = one.shooting.units[:3]
    first, second = (
        (motion.sections[:3, motion.turns // 2] - motion.phase[:3]) / units
        for motion in (one, other)
    )
    return bool(first @ second < 0)


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
        pieces: The pieces of the curves. Along a stable piece, the torque is monotonic.

    Returns:
        For each range: its ends low and high, N m, and their kinds low_is and high_is.
    """
    stable = [piece.ends for piece in pieces if piece.stable]
    ranges: list[tuple[End, End]] = []
    for low, high in itertools.pairwise(sorted(itertools.chain(*stable))):
        states = sum(start <= low and high <= end for start, end in stable)
        if states < 2:
            continue
        if ranges and low.torque - ranges[-1][1].torque < _GAP * low.torque:
            low, _ = ranges.pop()  # the same range, beyond a period doubling
        ranges.append((low, high))
    return [
        {'low': low.torque, 'high': high.torque, 'low_is': low.kind, 'high_is': high.kind}
        for low, high in ranges
    ]
