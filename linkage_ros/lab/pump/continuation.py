# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Curves of periodic motions, followed along their length past their folds."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from linkage_ros.lab.pump.branch import (
    END,
    FOLD,
    LOST,
    PERIOD_DOUBLING,
    TORUS,
    Piece,
    steady_states,
)
from linkage_ros.lab.pump.harmonic_balance import (
    HarmonicBalance,
    at_speed,
    at_torque,
    between,
    on_plane,
)
from linkage_ros.lab.pump.periodic_motion import PeriodicMotion

_NUDGE = 1e-3  # of the speed: from a motion to the first one beside it
_SHORTEST = 1e-4  # step along a curve, relative to the unknowns' units
_SHARP, _STRAIGHT = 0.5, 0.9  # cosines of the angle between two steps: too large, and small
_MOST = 400  # steps along a curve
_MOST_SECANTS, _UNIT = 40, 1e-9  # to where a multiplier has the modulus 1, and how nearly


class Limits(NamedTuple):
    """How far curves are followed.

    Attributes:
        slowest: Mean speed, rad/s.
        fastest: Likewise.
        torque: Largest torque of the motor at rest, N m.
        step: Along the curve, relative to crank length, speed and torque.
    """

    slowest: float
    fastest: float
    torque: float
    step: float

    def hold(self, motion: PeriodicMotion) -> bool:
        """Whether a motion lies within."""
        return self.slowest <= motion.speed <= self.fastest and 0 < motion.torque <= self.torque

    def cut(
        self, balance: HarmonicBalance, one: PeriodicMotion, other: PeriodicMotion
    ) -> PeriodicMotion:
        """The motion at the limit that lies between two; the second, if none is found."""
        if other.torque > self.torque:
            share = (self.torque - one.torque) / (other.torque - one.torque)
            condition = at_torque(self.torque)
        else:
            speed = min(max(other.speed, self.slowest), self.fastest)
            share = (speed - one.speed) / (other.speed - one.speed)
            condition = at_speed(speed)
        return balance.find(between(balance, one, other, share), condition) or other


def curves(balance: HarmonicBalance, limits: Limits) -> list[Piece]:
    """The load curves that begin at the ends of the scan.

    Args:
        balance: The equations.
        limits: How far curves are followed.

    Returns:
        Their pieces.
    """
    pieces: list[Piece] = []
    for seed in _seeds(balance, limits):
        pieces = with_curve(balance, seed, pieces, limits)
    return pieces


def with_curve(
    balance: HarmonicBalance, seed: PeriodicMotion, pieces: list[Piece], limits: Limits
) -> list[Piece]:
    """The pieces, and the curve of a motion that is not among them.

    Args:
        balance: The equations.
        seed: The motion.
        pieces: The pieces that are known.
        limits: How far curves are followed.

    Returns:
        All, without those that the new curve holds too.
    """
    if _hold(balance, pieces, seed):
        return pieces
    found = follow(balance, seed, limits)
    middles = ((piece, piece.motions[len(piece.motions) // 2]) for piece in pieces)
    return [piece for piece, middle in middles if not _hold(balance, found, middle)] + found


def _hold(balance: HarmonicBalance, pieces: Sequence[Piece], motion: PeriodicMotion) -> bool:
    """Whether a motion lies in one of the pieces."""
    states = steady_states(balance, pieces, motion.torque)
    return any(motion.is_same(state.motion) for state in states)


def _seeds(balance: HarmonicBalance, limits: Limits) -> Iterator[PeriodicMotion]:
    """From above and from below the first motion that is found, from sliders that rest."""
    speeds = np.geomspace(limits.slowest, limits.fastest, 12)[1:-1]
    for row in (speeds[::-1], speeds):
        guesses = ((x, at_speed(speed)) for speed in row for x in balance.resting_sliders(speed))
        found = (balance.find(*guess) for guess in guesses)
        yield from itertools.islice(filter(None, found), 1)


def follow(balance: HarmonicBalance, seed: PeriodicMotion, limits: Limits) -> list[Piece]:
    """Follows the curve of a motion both ways.

    Args:
        balance: The equations.
        seed: The motion.
        limits: How far.

    Returns:
        The pieces of the curve.
    """
    equations = balance.over(seed.turns)
    (back, begins_at), (forth, ends_at) = (
        _follow(equations, seed, sign, limits) for sign in (-1, 1)
    )
    motions, ends = [*back[::-1], seed, *forth], [begins_at, ends_at]
    if motions[0].speed > motions[-1].speed:
        motions.reverse()
        ends.reverse()
    found = [Piece([motions[0]], begins_at=ends[0])]
    for one, other in itertools.pairwise(motions):
        if one.stable != other.stable:
            motion, kind = _boundary(equations, one, other)
            found[-1].motions.append(motion)
            found[-1].ends_at = kind
            found.append(Piece([motion], begins_at=kind))
        found[-1].motions.append(other)
    found[-1].ends_at = ends[1]
    return found


def _follow(
    balance: HarmonicBalance, seed: PeriodicMotion, sign: int, limits: Limits
) -> tuple[list[PeriodicMotion], str]:
    """The motions of a curve after one of them, to one beyond a limit, and why it ends."""
    condition = at_speed(seed.speed * (1 + sign * _NUDGE))
    motions, one = [seed], balance.find(balance.unknowns(seed), condition)
    step = limits.step / 4
    while one is not None and len(motions) < _MOST:
        before = motions[-1]
        if one.repeats_sooner or _is_doubled(before, one):
            return motions[1:], PERIOD_DOUBLING
        if not limits.hold(one):
            return [*motions[1:], limits.cut(balance, before, one)], END
        motions.append(one)
        last, one = one, None
        while one is None and step > _SHORTEST:
            share = 1 + step / _length(balance, before, last)
            one = balance.find(
                between(balance, before, last, share), on_plane(before, last, share)
            )
            cosine = _turn(balance, before, last, one) if one else 0.0
            if cosine < _SHARP:
                one = None
            step = min(1.5 * step, limits.step) if cosine > _STRAIGHT else step / 3
    return motions[1:], LOST


def _is_doubled(one: PeriodicMotion, other: PeriodicMotion) -> bool:
    """Whether the period was doubled between two motions: beyond, turns come in another order."""
    if one.turns % 2:
        return False
    first, second = one.subharmonics(2), other.subharmonics(2)
    size = min(len(first), len(second))
    return bool(first[:size] @ second[:size] < 0)


def _length(balance: HarmonicBalance, one: PeriodicMotion, other: PeriodicMotion) -> float:
    apart = balance.unknowns(other) - balance.unknowns(one)
    return float(np.linalg.norm(apart / balance.units(one)))


def _turn(
    balance: HarmonicBalance, before: PeriodicMotion, last: PeriodicMotion, one: PeriodicMotion
) -> float:
    """The cosine of the angle between two steps."""
    x, y, z = (balance.unknowns(motion) / balance.units(last) for motion in (before, last, one))
    return float((y - x) @ (z - y) / np.linalg.norm(y - x) / np.linalg.norm(z - y))


def _boundary(
    balance: HarmonicBalance, one: PeriodicMotion, other: PeriodicMotion
) -> tuple[PeriodicMotion, str]:
    """The motion between two others whose largest multiplier has the modulus 1, and the kind."""

    def motion(share: float) -> PeriodicMotion:
        guess = between(balance, one, other, share)
        found = balance.find(guess, on_plane(one, other, share)) if 0 < share < 1 else None
        return found or (one if share < 0.5 else other)

    def excess(share: float) -> float:
        return abs(motion(share).multipliers[0]) - 1

    found = motion(_zero(excess))
    largest = found.multipliers[0]
    if largest.imag:
        return found, TORUS
    return found, FOLD if largest.real > 0 else PERIOD_DOUBLING


def _zero(function: Callable[[float], float]) -> float:
    """Where a function changes its sign between 0 and 1, by the Illinois method.

    See M. Dowell and P. Jarratt, BIT 11 (1971), 168-174.
    """
    x, y = 0.0, 1.0
    at_x, at_y = function(x), function(y)
    for _ in range(_MOST_SECANTS):
        z = y - at_y * (y - x) / (at_y - at_x)
        at_z = function(z)
        x, at_x = (x, 0.5 * at_x) if at_z * at_y > 0 else (y, at_y)
        y, at_y = z, at_z
        if abs(at_y) < _UNIT:
            break
    return y
