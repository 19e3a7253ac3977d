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

from linkage_ros.core.bodies import Body, Coupler, Frame, Guide, Piston, Slider, gravity_quantity
from linkage_ros.core.numeric import is_rounding, rounded, short_sum
from linkage_ros.core.quantities import Checked, quantity
from linkage_ros.errors import MechanismError

OPEN = 'open'
CROSSED = 'crossed'


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
    gravity: tuple[float, float] = gravity_quantity()

    def __post_init__(self) -> None:
        super().__post_init__()
        r, b, e = self._lengths()
        if short_sum(self.longest, abs(e), -r, -b) > 0:
            raise MechanismError(
                f'the offset of the slider, {e:g} m, is farther from 0 than crank + coupler '
                f'reach, by {math.fsum((abs(e), -r, -b)):.6g} m: the loop cannot close; bring it '
                'nearer to 0 or lengthen them'
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
        """What stops a crank.

        Args:
            far: Whether it cannot point to the left of the guide.
            near: Whether it cannot point to the right of the guide.

        Yields:
            A clause for people.
        """
        r, b, e = self._lengths()
        for stopped, word, side, offset in ((far, '-', 'left', -e), (near, '+', 'right', e)):
            if stopped:
                lack = math.fsum((r, offset, -b))
                yield (
                    f"on the guide's {side}, crank {word} offset are {lack:.6g} m longer than the "
                    'coupler'
                )

    def cures(self) -> Iterator[str]:
        """What would make a limited crank turn: each clause by itself, as short as can be."""
        r, b, e = self._lengths()
        yield f'lengthen the coupler to at least {rounded(r + abs(e), up=True)} m'
        if (shorter := short_sum(self.longest, b, -abs(e))) > 0:
            yield f'shorten the crank to at most {rounded(shorter, up=False)} m'
        if (nearer := short_sum(self.longest, b, -r)) > 0:
            yield f'bring the offset to within {rounded(nearer, up=False)} m of 0'


@dataclass(frozen=True)
class WindPump(Checked):
    """A wind pump, closed by inertia: crank A0-A, coupler A-B, rod B-D, slider D on the x axis.

    Two degrees of freedom: the crank angle and the slider's position are independent.

    Attributes:
        crank: Driven link, from A0, the origin.
        coupler: From the crank pin A to B.
        rod: From B to the slider's pin D.
        slider: The pump's piston, at D.
        assembly: 'open': B lies left of the line from A to D; 'crossed': right of it, which is
            below where the slider is to the right.
        gravity: Acceleration of gravity [x, y], m/s^2.
    """

    crank: Body
    coupler: Coupler
    rod: Body
    slider: Piston
    assembly: str = quantity(
        'choice', 'side of the coupler-rod pin', choices=(OPEN, CROSSED), default=OPEN
    )
    gravity: tuple[float, float] = gravity_quantity()


# Mechanisms of one degree of freedom: the crank angle tells where all links are.
Linkage: TypeAlias = FourBar | SliderCrank
Mechanism: TypeAlias = Linkage | WindPump

# The names under which parameter files ask for a mechanism.
MECHANISMS: dict[str, type[Mechanism]] = {
    'four_bar': FourBar,
    'slider_crank': SliderCrank,
    'wind_pump': WindPump,
}


def equalities(mechanism: Linkage) -> Iterator[str]:
    """Sums of lengths that are not 0 in binary and count as 0, in words."""
    for words, terms in mechanism.sums.items():
        total = math.fsum(terms)
        if total and is_rounding(mechanism.longest, total):
            yield f'{words} = {total:.2g} m counts as 0'
