# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The four-bar linkage: frozen, checked when made, with what lengths alone tell.

All sums of lengths that decide how a mechanism can move are `short_sum`s: lengths typed in
decimals that should meet an equality do meet it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from linkage_ros.errors import MechanismError
from linkage_ros.mechanisms.parts import CROSSED, OPEN, Body, Coupler, Frame, gravity_quantity
from linkage_ros.numeric import rounded, short_sum
from linkage_ros.quantities import Checked, quantity


@dataclass(frozen=True)
class FourBar(Checked):
    """A four-bar linkage: crank A0-A, coupler A-B, rocker B0-B, frame A0-B0.

    Attributes:
        frame: The fixed link.
        crank: Driven link, from A0, the origin.
        coupler: Floating link, from the crank pin A to B.
        rocker: Output link, from B0.
        assembly: 'open': B lies left of the line from A to B0; 'crossed': right of it. Of a
            linkage that passes change points it names the branch at crank angles 0 to pi
            counted from the frame.
        gravity: Acceleration of gravity [x, y], m/s^2.
    """

    frame: Frame
    crank: Body
    coupler: Coupler
    rocker: Body
    assembly: str = quantity(
        'choice', 'side of the coupler-rocker pin', choices=(OPEN, CROSSED), default=OPEN
    )
    gravity: tuple[float, float] = gravity_quantity()

    def __post_init__(self) -> None:
        super().__post_init__()
        longest, *others = sorted(self._lengths(), reverse=True)
        if short_sum(longest, longest, *(-other for other in others)) > 0:
            lack = math.fsum((longest, *(-other for other in others)))
            raise MechanismError(
                f'the longest link, {longest:g} m, is longer than the other three together by '
                f'{lack:.6g} m: the loop cannot close; shorten it or lengthen the others'
            )

    def _lengths(self) -> tuple[float, float, float, float]:
        return self.crank.length, self.coupler.length, self.rocker.length, self.frame.length

    @property
    def sums(self) -> dict[str, tuple[float, ...]]:
        """The sums of lengths that vanish at a change point, in words and as signed terms."""
        r, b, c, d = self._lengths()
        return {
            'coupler + rocker - frame - crank': (b, c, -d, -r),
            'frame + rocker - crank - coupler': (d, c, -r, -b),
            'frame + coupler - crank - rocker': (d, b, -r, -c),
        }

    @property
    def longest(self) -> float:
        """The longest link, m."""
        return max(self._lengths())

    @property
    def grashof(self) -> str:
        """The class of the linkage.

        'crank-rocker', 'double-crank', 'rocker-crank', 'double-rocker', 'triple-rocker' or
        'change-point'.
        """
        r, b, c, d = self._lengths()
        links = {'crank-rocker': r, 'double-rocker': b, 'rocker-crank': c, 'double-crank': d}
        shortest, middle, long, longest = sorted(links.values())
        # Shortest + longest against the other two (Grashof).
        excess = short_sum(longest, shortest, longest, -middle, -long)
        if excess > 0:
            return 'triple-rocker'
        if excess == 0:
            return 'change-point'
        return min(links, key=lambda name: links[name])

    def limits(self, *, far: bool, near: bool) -> Iterator[str]:
        """What stops a crank.

        Args:
            far: Whether it cannot point away from the rocker pivot.
            near: Whether it cannot point to the rocker pivot.

        Yields:
            A clause for people.
        """
        r, b, c, d = self._lengths()
        if far:
            lack = math.fsum((d, r, -b, -c))
            yield f'coupler + rocker are {lack:.6g} m shorter than frame + crank'
        if near:
            lack = abs(math.fsum((b, -c))) - abs(math.fsum((d, -r)))
            yield f'coupler and rocker differ by {lack:.6g} m more than frame and crank'

    def cures(self) -> Iterator[str]:
        """What would make a limited crank turn: each clause by itself, as short as can be."""
        r, b, c, d = self._lengths()
        short, long = sorted((b, c))
        triangle = (short, long, -d), (d, short, -long)
        at_most = min(short_sum(self.longest, *terms) for terms in triangle)
        upper = rounded(short + long - d, up=False)
        lower = rounded(d + long - short, up=True)
        fits, shortened = float(lower) <= float(upper), r > float(upper)
        if fits:
            way = 'shorten' if shortened else 'lengthen'
            yield f'{way} the crank to between {lower} and {upper} m'
        if 0 < at_most < r and not (fits and shortened):
            yield f'shorten the crank to at most {rounded(at_most, up=False)} m'
        longer = rounded(max(d + r - long, long - abs(d - r)), up=True)
        if short < float(longer) <= long + abs(d - r):
            yield f'lengthen the {"coupler" if b < c else "rocker"} to at least {longer} m'
        elif at_most <= 0:
            equal = rounded((d + r) / 2, up=True)
            yield f'make coupler and rocker equal, at least {equal} m each'
