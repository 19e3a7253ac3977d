# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Which way a four-bar linkage can move: its Grashof class and the reach of its crank."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

from linkage_ros.errors import UnreachableError
from linkage_ros.mechanism import FourBar
from linkage_ros.numeric import is_rounding, short_sum
from linkage_ros.transmission import TransmissionMap

Arc = tuple[float, float]


class Mobility(NamedTuple):
    """How a four-bar linkage can move.

    Attributes:
        grashof: 'crank-rocker', 'double-crank', 'rocker-crank', 'double-rocker',
            'triple-rocker' or 'change-point'.
        turns_fully: Whether the crank turns through every angle.
        period_turns: Turns of the crank after which the motion repeats.
        arcs: Where the crank can be, (from, to) with from in [0, 2 pi), rad; the whole turn
            where it turns fully.
        limits: What stops the crank, each with the cure; empty where it turns fully.
        equalities: Sums of lengths that are not 0 in binary and count as 0, in words.
    """

    grashof: str
    turns_fully: bool
    period_turns: int
    arcs: tuple[Arc, ...]
    limits: tuple[str, ...]
    equalities: tuple[str, ...]


def assess(mechanism: FourBar, transmission: TransmissionMap) -> Mobility:
    """Classifies a four-bar linkage and finds the reach of its crank in closed form.

    Args:
        mechanism: The linkage.
        transmission: Its map from the crank to the transmission angle.

    Returns:
        Its mobility.
    """
    limits = []
    r, b = mechanism.crank.length, mechanism.coupler.length
    c, d = mechanism.rocker.length, mechanism.frame.length
    if transmission.p < 0:
        limits.append(
            f'coupler + rocker = {b + c:g} m are shorter than frame + crank = {d + r:g} m: '
            f'lengthen them or shorten the crank by {d + r - b - c:.3g} m'
        )
    if transmission.q < 0:
        lack = abs(b - c) - abs(d - r)
        limits.append(
            f'coupler and rocker differ by {abs(b - c):g} m, more than frame and crank by '
            f'{abs(d - r):g} m: bring the former nearer or the latter apart by {lack:.3g} m'
        )
    return Mobility(
        _grashof(mechanism),
        transmission.turns_fully,
        transmission.period_turns,
        _arcs(mechanism, transmission),
        tuple(limits),
        tuple(_equalities(mechanism)),
    )


def _equalities(mechanism: FourBar) -> Iterator[str]:
    r, b = mechanism.crank.length, mechanism.coupler.length
    c, d = mechanism.rocker.length, mechanism.frame.length
    for words, terms in (
        ('coupler + rocker - frame - crank', (b, c, -d, -r)),
        ('frame + rocker - crank - coupler', (d, c, -r, -b)),
        ('frame + coupler - crank - rocker', (d, b, -r, -c)),
    ):
        total = math.fsum(terms)
        if total and is_rounding(max(r, b, c, d), total):
            yield f'{words} = {total:.2g} m counts as 0'


def _grashof(mechanism: FourBar) -> str:
    links = {
        'crank-rocker': mechanism.crank.length,
        'double-rocker': mechanism.coupler.length,
        'rocker-crank': mechanism.rocker.length,
        'double-crank': mechanism.frame.length,
    }
    shortest, middle, long, longest = sorted(links.values())
    # Shortest + longest against the other two (Grashof).
    excess = short_sum(longest, shortest, longest, -middle, -long)
    if excess > 0:
        return 'triple-rocker'
    if excess == 0:
        return 'change-point'
    return min(links, key=lambda name: links[name])


def _arcs(mechanism: FourBar, transmission: TransmissionMap) -> tuple[Arc, ...]:
    """The reachable crank angles: where (b-c)^2 <= L^2 <= (b+c)^2."""
    if transmission.turns_fully:
        return ((0.0, 2 * math.pi),)
    r, b = mechanism.crank.length, mechanism.coupler.length
    c, d = mechanism.rocker.length, mechanism.frame.length
    delta = mechanism.frame.angle
    near, far = 0.0, math.pi
    # tan^2(theta/2) at L = |b - c| and at L = b + c, in factors that do not cancel.
    if transmission.q < 0:
        rise = (math.fsum((b, -c)) ** 2 - math.fsum((d, -r)) ** 2) / 4
        near = 2 * math.atan2(
            math.sqrt(rise), 0.5 * math.sqrt((d + r - abs(b - c)) * (d + r + abs(b - c)))
        )
    if transmission.p < 0:
        rise = (b + c - abs(d - r)) * (b + c + abs(d - r))
        fall = math.fsum((d, r, -b, -c)) * (b + c + d + r)
        far = 2 * math.atan2(math.sqrt(rise), math.sqrt(fall))
    if transmission.q < 0 and transmission.p < 0:
        return _turned(delta + near, delta + far), _turned(delta - far, delta - near)
    if transmission.q < 0:
        return (_turned(delta + near, delta + 2 * math.pi - near),)
    return (_turned(delta - far, delta + far),)


def _turned(start: float, end: float) -> Arc:
    whole = 2 * math.pi * math.floor(start / (2 * math.pi))
    return start - whole, end - whole


def refusal(mobility: Mobility, purpose: str) -> str:
    """Why the crank cannot do something, in one line.

    Args:
        mobility: Of a linkage whose crank does not turn fully.
        purpose: What it cannot do, such as 'turn fully' or 'reach 57.3 deg'.

    Returns:
        The class, the cause with its cure, and the reachable arcs in degrees.
    """
    arcs = ' and '.join(
        f'{math.degrees(start):.6g} to {math.degrees(end):.6g} deg' for start, end in mobility.arcs
    )
    return (
        f'the crank of this {mobility.grashof} linkage cannot {purpose}: '
        f'{"; ".join(mobility.limits)}; it reaches {arcs}'
    )


def unreachable(mobility: Mobility, crank: float) -> UnreachableError:
    """The error for a crank angle at which no state, or no finite rate, exists."""
    purpose = f'move at {math.degrees(crank):.9g} deg'
    return UnreachableError(refusal(mobility, purpose), crank_angle=crank, arcs=mobility.arcs)
