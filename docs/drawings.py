# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Draws the pictures of mechanisms.md: each kind of mechanism, with the names of its parameters.

    python docs/drawings.py        writes docs/mechanism_*.svg anew

Places, ground and colours are those of the Rerun view, solved and not drawn by hand. SVG is text
and needs no library: the same mechanism gives the same bytes wherever it is drawn.
"""

from __future__ import annotations

import argparse
import cmath
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
from sheet import Sheet

import linkage_ros as lr
from linkage_ros.model.registry import Mechanism
from linkage_ros.model.structure import Point
from linkage_ros.palette import BLACK, COLORS, DARK, GREY, Color
from linkage_ros.view.drawing import Drawing

_PALE = 0.25  # opacity of the other assembly


class Picture(Sheet):
    """A mechanism in one position, in both of its assemblies.

    Attributes:
        at: Places of its pins, by name.
        other: Where they are in the other assembly.
        centers: Centres of mass, of the links that turn.
        directions: Directions of the links that turn, rad.
    """

    def __init__(
        self, mechanism: Mechanism, crank: float, size: tuple[int, int, float, complex],
        names: dict[str, complex],
    ) -> None:  # fmt: skip
        """Draws links, pins and ground.

        Args:
            mechanism: The mechanism, in its open assembly.
            crank: Crank angle, rad.
            size: Size of the sheet: width, height, scale, origin.
            names: The pins that are named, and by how much the name is shifted, px.
        """
        super().__init__(*size)
        self._links(replace(mechanism, assembly=lr.CROSSED), crank, f'opacity="{_PALE}"')
        self.other = self.at
        self._links(mechanism, crank, '')
        for name, shift in names.items():
            self.text(self.at[name], name, shift=shift)

    def _links(self, mechanism: Mechanism, crank: float, attributes: str) -> None:
        structure, (places, _) = mechanism.structure(), mechanism.start()
        position = [link.position for link in mechanism.loop().pose((crank, *places)).links]
        drawing = Drawing(mechanism, crank)
        self.directions = [
            angle for angle, link in zip(position, structure.links, strict=True) if not link.slides
        ]
        turned = [cmath.rect(1, angle) for angle in self.directions]

        def place_of(point: Point) -> complex:
            return point.fixed + sum(w * t for w, t in zip(point.weights, turned, strict=False))

        self.at = {name: place_of(point) for name, point in structure.points.items()}
        self.centers = [place_of(link.center) for link in structure.links if not link.slides]
        lines = drawing.links(drawing.place(np.array([position])))
        if not attributes:
            for ground in drawing.ground:
                self.line([complex(*p) for p in ground], GREY, 2)
        for link, (line,) in lines.items():
            # Of the other assembly the dyad alone, without the coupler point.
            shown = line[:2] if attributes and link in ('coupler', 'rocker', 'rod') else line
            self.line([complex(*p) for p in shown], COLORS[link], 6, attributes)
        for name, place in self.at.items():
            if name != 'C' or not attributes:
                self.dot(place, 5, BLACK)

    def angle(self, pin: str, span: tuple[float, float], radius: float, color: Color, words: str,
              shift: complex) -> None:  # fmt: skip
        """An angle at a pin, from a dashed line to a link, and its name at the arc's middle."""
        at, middle = self.at[pin], sum(span) / 2
        if not span[0]:
            self.dashes(at, at + (radius + 25) / self.scale)
        self.arc(at, radius, span, color)
        tip = at + cmath.rect(radius / self.scale, middle)
        self.text(tip, words, color, shift=shift, anchor='start' if shift.real > 0 else 'end')

    def gravity(self, place: complex) -> None:
        """Where it points by default, from a place on the sheet."""
        length = 120 / self.scale
        self.arrow(place, place - 1j * length)
        self.text(place - 1j * length, 'gravity', shift=-18j)

    def away(self, link: int, pin: str, to: complex, color: Color, side: float) -> None:
        """How far a point of a link is along it from its first pin, and across it."""
        at, turn = self.at[pin], cmath.rect(1, self.directions[link])
        foot = at + turn * ((to - at) / turn).real
        if side:
            shift = side * 1j * turn / self.scale
            self.arrow(at + shift, foot + shift, color, both=True)
            self.along((at, foot), 'along', color, 2 * side)
            self.along((foot, to), 'across', color, -14)
        self.arrow(foot, to, color, both=True)


def four_bar() -> Picture:
    """Four-bar: lengths, angles, coupler point, a centre of mass."""
    mechanism = lr.FourBar(
        lr.Frame(1.4, math.radians(9)),
        lr.Body(0.42),
        lr.Coupler(1.05, point=(0.45, 0.28)),
        lr.Body(0.85, center=(0.5, -0.16)),
    )
    names = {'A0': -28 + 0j, 'A': -22 + 8j, 'B0': 46 - 14j}
    sheet = Picture(mechanism, math.radians(65), (960, 700, 400, 120 + 470j), names)
    at, (alpha, beta, gamma) = sheet.at, sheet.directions
    crank, coupler, rocker = (COLORS[name] for name in ('crank', 'coupler', 'rocker'))
    sheet.arrow(0j, 0.75 + 0j, DARK)
    sheet.text(0.75 + 0j, 'x of base_link', DARK, shift=8 - 8j, anchor='start')
    sheet.dashes(at['A0'], at['B0'])
    sheet.along((at['A0'], at['A']), 'crank.length r', crank, 18)
    sheet.along((at['A'], at['B']), 'coupler.length b', coupler, -18)
    sheet.along((at['B'], at['B0']), 'rocker.length c', rocker, -18)
    sheet.along((at['A0'], at['B0']), 'frame.length d', DARK, 18)
    sheet.angle('A0', (0, alpha), 48, crank, 'alpha', 4 + 8j)
    sheet.angle('A0', (0, mechanism.frame.angle), 250, DARK, 'frame.angle delta', 8 + 3j)
    sheet.angle('A', (0, beta), 70, coupler, 'beta', 6 + 0j)
    sheet.angle('B0', (0, gamma), 48, rocker, 'gamma', 22 + 0j)
    sheet.angle('B', (beta + math.pi, gamma + math.pi), 60, BLACK, 'mu', -2 - 14j)
    sheet.away(1, 'A', at['C'], coupler, 12)
    sheet.text(at['C'], 'C: coupler.point = [along, across]', coupler, shift=-40 + 44j)
    sheet.away(2, 'B0', sheet.centers[2], rocker, 0)
    sheet.mass(sheet.centers[2], rocker)
    sheet.text(sheet.centers[2], 'rocker.center,', rocker, shift=16 + 4j, anchor='start')
    sheet.text(sheet.centers[2], 'here across < 0', rocker, shift=16 - 20j, anchor='start')
    sheet.text(at['B'], 'B of assembly: open', shift=18 + 12j, anchor='start')
    sheet.text(sheet.other['B'], 'B of assembly: crossed', shift=18 - 4j, anchor='start')
    sheet.gravity(1.95 + 0.25j)
    sheet.arc(0j, 85, (math.radians(200), math.radians(305)), crank)
    sheet.text(0j, 'driving torque', crank, shift=-20 - 105j)
    return sheet


def slider_crank() -> Picture:
    """Slider-crank: guide, offset, the slider's place and what acts on it."""
    e, delta = 0.2, math.radians(12)
    mechanism = lr.SliderCrank(
        lr.Body(0.6), lr.Coupler(1.15, center=(0.5, 0.13)), lr.Slider(offset=e), lr.Guide(delta)
    )
    sheet = Picture(
        mechanism, delta + math.radians(72), (1060, 460, 340, 380 + 335j),
        {'A0': 32 - 16j, 'A': -24 + 16j},
    )  # fmt: skip
    at, (crank_angle, beta) = sheet.at, sheet.directions
    crank, coupler, slider = (COLORS[name] for name in ('crank', 'coupler', 'slider'))
    guide = cmath.rect(1, delta)
    foot = 1j * e * guide
    sheet.dashes(-0.5 * guide, 1.05 * guide)
    sheet.dashes(foot - 1.0 * guide, foot + 1.3 * guide)
    sheet.arrow(0j, 0.75 + 0j, DARK)
    sheet.text(0.75 + 0j, 'x of base_link', DARK, shift=8 - 4j, anchor='start')
    sheet.angle('A0', (0, delta), 230, DARK, 'frame.angle', 8 + 2j)
    sheet.angle('A0', (delta, crank_angle), 48, crank, 'alpha', 4 + 8j)
    sheet.text(0.45 * at['A'], 'crank.length r', crank, shift=-12 + 0j, anchor='end')
    sheet.arc(0j, 85, (math.radians(215), math.radians(320)), crank)
    sheet.text(0j, 'driving torque', crank, shift=-105j)
    sheet.dashes(at['A'], at['A'] + 0.24 * guide)
    sheet.arc(at['A'], 60, (delta, beta), coupler)
    sheet.text(at['A'] + 0.2 * guide, 'beta, here < 0', coupler, shift=20j)
    sheet.along((at['A'], at['B']), 'coupler.length b', coupler, -18)
    sheet.away(1, 'A', sheet.centers[1], coupler, 0)
    sheet.mass(sheet.centers[1], coupler)
    words = 'coupler.center = [along, across]'
    sheet.text(sheet.centers[1], words, coupler, shift=16 + 34j, anchor='start')
    left = -0.32 * guide
    sheet.arrow(left, left + foot, slider, both=True)
    middle = left + foot / 2 - 0.03 * guide
    sheet.along((middle - 0.4 * guide, middle), 'slider.offset e', slider, 0)
    sheet.dashes(0j, foot, color=slider)
    sheet.arrow(foot, at['B'], slider)
    sheet.along((foot, foot + 1.2 * guide), 'slider position x', slider, 15)
    sheet.text(at['B'], 'B of assembly: open', shift=-10 - 66j)
    sheet.text(sheet.other['B'], 'B of assembly: crossed', shift=-36 - 60j, anchor='start')
    edge = at['B'] + (0.14 + 0.06j) * guide
    sheet.arrow(edge, edge + 0.2 * guide, slider)
    sheet.text(edge + 0.2 * guide, 'slider.force', slider, shift=8 + 4j, anchor='start')
    above = edge + 0.1j * guide
    sheet.arrow(above + 0.2 * guide, above, slider)
    sheet.text(above + 0.2 * guide, 'slider.damping', slider, shift=8 + 4j, anchor='start')
    sheet.gravity(1.7 + 0.2j)
    return sheet


def wind_pump() -> Picture:
    """Wind pump: its two coordinates, and what drives and brakes it."""
    mechanism = lr.WindPump(
        lr.Body(0.35, center=(-0.25, 0.0)),
        lr.Coupler(0.8),
        lr.Body(1.15, center=(0.27, 0.0)),
        lr.Piston(1.5),
    )
    sheet = Picture(
        mechanism, math.radians(60), (960, 620, 400, 200 + 400j),
        {'A0': -30 - 4j, 'A': -4 + 24j, 'D': 24 - 40j},
    )  # fmt: skip
    at, (phi1, phi2, phi3) = sheet.at, sheet.directions
    crank, coupler, rod, slider = (COLORS[n] for n in ('crank', 'coupler', 'rod', 'slider'))
    sheet.arrow(0j, at['D'], slider)
    sheet.text(0.8 + 0j, 'slider.position xD', slider, shift=15j)
    sheet.along((0j, at['A']), 'crank.length l1', crank, 18)
    sheet.along((at['A'], at['B']), 'coupler.length l2', coupler, 18)
    sheet.along((at['B'], at['D']), 'rod.length l3', rod, -18)
    sheet.angle('A0', (0, phi1), 48, crank, 'phi1', 6 + 8j)
    sheet.angle('A', (0, phi2), 70, coupler, 'phi2', 6 + 0j)
    sheet.angle('B', (0, phi3), 60, rod, 'phi3, here < 0', 8 + 0j)
    sheet.mass(sheet.centers[2], rod)
    sheet.text(sheet.centers[2], 'rod.center', rod, shift=16 + 12j, anchor='start')
    sheet.dashes(0j, sheet.centers[0], color=crank)
    sheet.mass(sheet.centers[0], crank)
    sheet.text(sheet.centers[0], 'crank.center, here along < 0', crank, shift=14 - 26j)
    sheet.arc(0j, 85, (math.radians(140), math.radians(215)), crank)
    sheet.text(0j, 'motor.torque', crank, shift=-90 + 76j)
    sheet.text(at['B'], 'B of assembly: open', shift=22j)
    sheet.text(sheet.other['B'], 'B of assembly: crossed', shift=18 - 8j, anchor='start')
    sheet.arrow(at['D'] + 0.34, at['D'] + 0.12, slider)
    sheet.text(at['D'] + 0.34, 'slider.damping', slider, shift=14 + 40j, anchor='end')
    sheet.gravity(1.7 + 0.75j)
    return sheet


DRAWINGS = four_bar, slider_crank, wind_pump


def main() -> None:
    """Writes the pictures."""
    argparse.ArgumentParser(description=__doc__.splitlines()[0]).parse_args()
    for draw in DRAWINGS:
        Path(__file__).with_name(f'mechanism_{draw.__name__}.svg').write_text(draw().svg())


if __name__ == '__main__':
    main()
