# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The one description of each mechanism: frozen, checked when made, with what lengths alone tell.

All sums of lengths that decide how a mechanism can move are `short_sum`s: lengths typed in
decimals that should meet an equality do meet it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TypeAlias

from linkage_ros.bodies import Body, Coupler, Frame, Guide, Slider
from linkage_ros.errors import MechanismError
from linkage_ros.numeric import is_rounding, short_sum
from linkage_ros.quantities import Checked, quantity

OPEN = 'open'
CROSSED = 'crossed'

_GRAVITY = (0.0, -9.81)


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
    gravity: tuple[float, float] = quantity(
        'pair', 'acceleration of gravity [x, y]', 'm/s^2', span=(-1e6, 1e6), default=_GRAVITY
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        longest, *others = sorted(self._lengths(), reverse=True)
        if longest > sum(others):
            raise MechanismError(
                f'the longest link, {longest:g} m, is longer than the other three together, '
                f'{sum(others):g} m: the loop cannot close; shorten it or lengthen the others'
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
        """What stops a crank, each with the cure.

        Args:
            far: Whether it cannot point away from the rocker pivot.
            near: Whether it cannot point to the rocker pivot.

        Yields:
            A clause for people.
        """
        r, b, c, d = self._lengths()
        if far:
            yield (
                f'coupler + rocker = {b + c:g} m are shorter than frame + crank = {d + r:g} m: '
                f'lengthen them or shorten the crank by {d + r - b - c:.3g} m'
            )
        if near:
            lack = abs(b - c) - abs(d - r)
            yield (
                f'coupler and rocker differ by {abs(b - c):g} m, more than frame and crank by '
                f'{abs(d - r):g} m: bring the former nearer or the latter apart by {lack:.3g} m'
            )


@dataclass(frozen=True)
class SliderCrank(Checked):
    """A slider-crank: crank A0-A, coupler A-B, slider at B on a guide that passes A0.

    Attributes:
        crank: Driven link, from A0, the origin.
        coupler: Connecting rod, from the crank pin A to B.
        slider: Output link, at B; its position counts along the guide from the foot of the
            perpendicular from A0.
        frame: Direction of the guide.
        assembly: 'open': the slider is on the + side of the crank pin where the crank points
            along the guide; 'crossed': on the - side.
        gravity: Acceleration of gravity [x, y], m/s^2.
    """

    crank: Body
    coupler: Coupler
    slider: Slider = field(default_factory=Slider)
    frame: Guide = field(default_factory=Guide)
    assembly: str = quantity(
        'choice', 'side of the crank pin on which the slider is', choices=(OPEN, CROSSED),
        default=OPEN,
    )  # fmt: skip
    gravity: tuple[float, float] = quantity(
        'pair', 'acceleration of gravity [x, y]', 'm/s^2', span=(-1e6, 1e6), default=_GRAVITY
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        r, b, e = self._lengths()
        if abs(e) > r + b:
            raise MechanismError(
                f'the offset of the slider, {e:g} m, is larger than crank + coupler, {r + b:g} '
                'm: the loop cannot close; lower it or lengthen them'
            )

    def _lengths(self) -> tuple[float, float, float]:
        return self.crank.length, self.coupler.length, self.slider.offset

    @property
    def sums(self) -> dict[str, tuple[float, ...]]:
        """The sums of lengths that vanish at a change point, in words and as signed terms."""
        r, b, e = self._lengths()
        return {
            'coupler + offset - crank': (b, e, -r),
            'coupler - offset - crank': (b, -e, -r),
        }

    @property
    def longest(self) -> float:
        """The longest of crank, coupler and offset, m."""
        return max(map(abs, self._lengths()))

    @property
    def grashof(self) -> str:
        """The class: 'crank-slider' (the crank turns), 'rotating-coupler' (the coupler does).

        Else 'change-point' or 'non-Grashof' (neither turns).
        """
        r, b, e = self._lengths()
        crank = short_sum(self.longest, r, abs(e), -b)
        coupler = short_sum(self.longest, b, abs(e), -r)
        if crank == 0 or coupler == 0:
            return 'change-point'
        if crank < 0:
            return 'crank-slider'
        return 'rotating-coupler' if coupler < 0 else 'non-Grashof'

    def limits(self, *, far: bool, near: bool) -> Iterator[str]:
        """What stops a crank, each with the cure.

        Args:
            far: Whether it cannot point to the left of the guide.
            near: Whether it cannot point to the right of the guide.

        Yields:
            A clause for people.
        """
        r, b, e = self._lengths()
        for stopped, word, side, reach in ((far, '-', 'left', r - e), (near, '+', 'right', r + e)):
            if stopped:
                yield (
                    f"on the guide's {side}, crank {word} offset = {reach:g} m are longer than "
                    f'the coupler, {b:g} m: lengthen the coupler or shorten the crank by '
                    f'{reach - b:.3g} m'
                )


Mechanism: TypeAlias = FourBar | SliderCrank

# The names under which parameter files ask for a mechanism.
MECHANISMS: dict[str, type[FourBar] | type[SliderCrank]] = {
    'four_bar': FourBar,
    'slider_crank': SliderCrank,
}


def equalities(mechanism: Mechanism) -> Iterator[str]:
    """Sums of lengths that are not 0 in binary and count as 0, in words."""
    for words, terms in mechanism.sums.items():
        total = math.fsum(terms)
        if total and is_rounding(mechanism.longest, total):
            yield f'{words} = {total:.2g} m counts as 0'
