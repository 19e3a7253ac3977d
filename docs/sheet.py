# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Draws lines, arrows, angles and text as SVG."""

import cmath
import math
from collections.abc import Iterable
from xml.sax.saxutils import escape

import numpy as np

from linkage_ros.palette import BLACK, GREY, Color

_SIZE = 19  # font size, px; legible at half size


class Sheet:
    """An SVG picture under construction; positions are x + iy, m, in base_link, sizes are px."""

    def __init__(self, width: int, height: int, scale: float, origin: complex) -> None:
        """Creates an empty picture.

        Args:
            width: Width, px.
            height: Height, px.
            scale: Scale, px per m.
            origin: Position of base_link, px to the right and down from the upper left corner.
        """
        self.scale, self._origin = scale, origin
        # The first of these fonts is the widest, so text that fits in it fits in all of them.
        head = (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" '
            f'width="{width}" height="{height}" font-size="{_SIZE}" stroke-linejoin="round" '
            'font-family="DejaVu Sans, Verdana, Arial, sans-serif" stroke-linecap="round">'
        )
        self._parts = [head, f'<rect width="{width}" height="{height}" fill="white"/>']

    def line(
        self, places: Iterable[complex], color: Color, width: float = 1.5, attributes: str = ''
    ) -> None:
        """Draws a line through positions; `attributes` are further SVG attributes."""
        points = ' '.join(self._point(place) for place in places)
        self._parts.append(
            f'<polyline points="{points}" fill="none" stroke="rgb{color}" '
            f'stroke-width="{width:g}" {attributes}/>'
        )

    def dashes(self, *places: complex, color: Color = GREY) -> None:
        """Draws a dashed auxiliary line."""
        self.line(places, color, 1.5, 'stroke-dasharray="6 5"')

    def dot(self, place: complex, radius: float, color: Color) -> None:
        """Draws a pin as a circle."""
        x, y = self._point(place).split(',')
        self._parts.append(
            f'<circle cx="{x}" cy="{y}" r="{radius:g}" fill="white" stroke="rgb{color}" '
            'stroke-width="2"/>'
        )

    def mass(self, place: complex, color: Color) -> None:
        """Draws the symbol of a centre of mass: a circle with two dark quarters."""
        self.dot(place, 9, color)
        r = 9 / self.scale
        for turn in (1, -1):
            sweep = [place + turn * r * cmath.rect(1, t * math.pi / 16) for t in range(9)]
            self.line([place, *sweep, place], color, 1, f'style="fill:rgb{color}"')

    def arrow(
        self, start: complex, end: complex, color: Color = BLACK, *, both: bool = False
    ) -> None:
        """Draws an arrow, with two heads if `both` is set."""
        self.line([start, end], color)
        self._head(end, cmath.phase(end - start), color)
        if both:
            self._head(start, cmath.phase(start - end), color)

    def arc(self, center: complex, radius: float, span: tuple[float, float], color: Color) -> None:
        """Draws an arc with an arrowhead at its end; `span` in rad, `radius` in px."""
        start, end = span
        r = radius / self.scale
        sweep = [center + cmath.rect(r, float(a)) for a in np.linspace(start, end, 33)]
        self.line(sweep, color)
        # Aligned with the arc's chord below the head, so that the head lies on the arc.
        turn = math.copysign(math.pi / 2 - 6 / radius, end - start)
        self._head(sweep[-1], end + turn, color)

    def text(
        self, place: complex, words: str, color: Color = BLACK, *, shift: complex = 0j,
        anchor: str = 'middle', turn: float = 0.0,
    ) -> None:  # fmt: skip
        """Draws text at a position, offset by `shift` px right and up, rotated by `turn` rad."""
        x, y = self._point(place + shift / self.scale).split(',')
        turned = f' transform="rotate({-math.degrees(turn):.1f} {x} {y})"' if turn else ''
        self._parts.append(
            f'<text x="{x}" y="{y}" fill="rgb{color}" text-anchor="{anchor}" '
            f'dominant-baseline="central"{turned}>{escape(words)}</text>'
        )

    def along(self, ends: tuple[complex, complex], words: str, color: Color, side: float) -> None:
        """Draws text along a line, offset by `side` px to its left."""
        way = ends[1] - ends[0]
        turn = cmath.phase(way)
        upright = turn - math.copysign(math.pi, turn) if abs(turn) > math.pi / 2 else turn
        shift = side * 1j * way / abs(way)
        self.text((ends[0] + ends[1]) / 2, words, color, shift=shift, turn=upright)

    def svg(self) -> str:
        """Returns the picture as SVG."""
        return '\n'.join([*self._parts, '</svg>', ''])

    def _head(self, tip: complex, direction: float, color: Color) -> None:
        back = [tip - cmath.rect(12 / self.scale, direction + t) for t in (0.3, -0.3)]
        self.line([tip, *back, tip], color, 1, f'style="fill:rgb{color}"')

    def _point(self, place: complex) -> str:
        """Formats a position for SVG: px to the right and down."""
        at = self._origin + self.scale * place.conjugate()
        # + 0.0 turns -0.0, an accident of rounding, into 0.0.
        return f'{round(at.real, 1) + 0.0},{round(at.imag, 1) + 0.0}'
