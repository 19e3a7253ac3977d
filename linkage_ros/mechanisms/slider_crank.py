# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The slider-crank: frozen, checked when made, with what lengths alone tell."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

from linkage_ros.errors import MechanismError
from linkage_ros.mechanisms.parts import (
    CROSSED,
    OPEN,
    Body,
    Coupler,
    Guide,
    Slider,
    gravity_quantity,
)
from linkage_ros.numeric import rounded, short_sum
from linkage_ros.quantities import Checked, quantity


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
