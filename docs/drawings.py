# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Draws the figures of mechanisms.md: each kind of mechanism, with the names of its parameters.

    python docs/drawings.py        writes docs/mechanism_*.svg

Positions, ground and colours come from the code of the Rerun view. The SVG is written as text,
without a library, so that the files are the same bytes on every machine.
"""

import argparse
import cmath
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
from sheet import Sheet

import linkage_ros as lr
from linkage_ros.mechanism.base import Mechanism
from linkage_ros.mechanism.structure import Point
from linkage_ros.palette import BLACK, COLORS, DARK, GREY, Color
from linkage_ros.view.picture import Picture as LinkagePicture

_PALE = 0.25  # opacity of the other assembly


class Picture(Sheet):
    """A drawing of a mechanism at one crank angle, in both assemblies.

    Attributes:
        at: Positions of the pins, by name.
        other: Positions of the pins in the other assembly, by name.
        centers: Centres of mass of the links that turn.
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
            names: Offset of the label of each labelled pin, px.
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
        drawing = LinkagePicture(mechanism, crank)
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
            # In the other assembly, only the dyad is drawn, without traced points.
            shown = line[:2] if attributes and link in ('coupler', 'rocker', 'rod') else line
            self.line([complex(*p) for p in shown], COLORS[link], 6, attributes)
        for name, place in self.at.items():
            if name not in structure.traced or not attributes:
                self.dot(place, 5, BLACK)

    def angle(self, pin: str, span: tuple[float, float], radius: float, color: Color, words: str,
              shift: complex) -> None:  # fmt: skip
        """Draws an angle at a pin, with its label at the middle of the arc."""
        at, middle = self.at[pin], sum(span) / 2
        if not span[0]:
            self.dashes(at, at + (radius + 25) / self.scale)
        self.arc(at, radius, span, color)
        tip = at + cmath.rect(radius / self.scale, middle)
        self.text(tip, words, color, shift=shift, anchor='start' if shift.real > 0 else 'end')

    def texts(self, *texts: tuple[complex, str, Color, complex, str]) -> None:
        """Draws texts, each given by position, words, colour, offset in px, and anchor."""
        for place, words, color, shift, anchor in texts:
            self.text(place, words, color, shift=shift, anchor=anchor)

    def gravity(self, place: complex) -> None:
        """Draws the default direction of gravity as an arrow from a position."""
        length = 120 / self.scale
        self.arrow(place, place - 1j * length)
        self.text(place - 1j * length, 'gravity', shift=-18j)

    def away(self, link: int, pin: str, to: complex, color: Color, side: float) -> None:
        """Draws the dimensions of a point of a link: along the link from a pin, and across."""
        at, turn = self.at[pin], cmath.rect(1, self.directions[link])
        foot = at + turn * ((to - at) / turn).real
        if side:
            shift = side * 1j * turn / self.scale
            self.arrow(at + shift, foot + shift, color, both=True)
            self.along((at, foot), 'along', color, 2 * side)
            self.along((foot, to), 'across', color, -14)
        self.arrow(foot, to, color, both=True)


def four_bar() -> Picture:
    """Draws a four-bar with lengths, angles, a traced point and a centre of mass."""
    mechanism = lr.FourBar(
        lr.Frame(1.4, math.radians(9)),
        lr.Body(0.42),
        lr.Coupler(1.05),
        lr.Body(0.85, center=(0.5, -0.16)),
        points=(lr.TracedPoint('C', 'coupler', (0.45, 0.28)),),
    )
    names = {'A0': -28 + 0j, 'A': -22 + 8j, 'B0': 46 - 14j}
    sheet = Picture(mechanism, math.radians(65), (960, 700, 400, 120 + 470j), names)
    at, (alpha, beta, gamma), center = sheet.at, sheet.directions, sheet.centers[2]
    crank, coupler, rocker = (COLORS[name] for name in ('crank', 'coupler', 'rocker'))
    sheet.arrow(0j, 0.75 + 0j, DARK)
    sheet.dashes(at['A0'], at['B0'])
    for first, last, words, color, side in (
        ('A0', 'A', 'crank.length r', crank, 18),
        ('A', 'B', 'coupler.length b', coupler, -18),
        ('B', 'B0', 'rocker.length c', rocker, -18),
        ('A0', 'B0', 'frame.length d', DARK, 18),
    ):
        sheet.along((at[first], at[last]), words, color, side)
    for angle in (
        ('A0', (0, alpha), 48, crank, 'alpha', 4 + 8j),
        ('A0', (0, mechanism.frame.angle), 250, DARK, 'frame.angle delta', 8 + 3j),
        ('A', (0, beta), 70, coupler, 'beta', 6 + 0j),
        ('B0', (0, gamma), 48, rocker, 'gamma', 22 + 0j),
        ('B', (beta + math.pi, gamma + math.pi), 60, BLACK, 'mu', -2 - 14j),
    ):
        sheet.angle(*angle)
    sheet.away(1, 'A', at['C'], coupler, 12)
    sheet.away(2, 'B0', center, rocker, 0)
    sheet.mass(center, rocker)
    sheet.gravity(1.95 + 0.25j)
    sheet.arc(0j, 85, (math.radians(200), math.radians(305)), crank)
    sheet.texts(
        (at['C'], 'points.C.at = [along, across]', coupler, -40 + 44j, 'middle'),
        (0j, 'driving torque', crank, -20 - 105j, 'middle'),
        (0.75 + 0j, 'x of base_link', DARK, 8 - 8j, 'start'),
        (center, 'rocker.center,', rocker, 16 + 4j, 'start'),
        (center, 'here across < 0', rocker, 16 - 20j, 'start'),
        (at['B'], 'B of assembly: open', BLACK, 18 + 12j, 'start'),
        (sheet.other['B'], 'B of assembly: crossed', BLACK, 18 - 4j, 'start'),
    )
    return sheet


def slider_crank() -> Picture:
    """Draws a slider-crank with guide, offset, slider position and the forces on the slider."""
    e, delta = 0.2, math.radians(12)
    mechanism = lr.SliderCrank(
        lr.Body(0.6), lr.Coupler(1.15, center=(0.5, 0.13)), lr.Slider(offset=e), lr.Guide(delta)
    )
    sheet = Picture(
        mechanism, delta + math.radians(72), (1060, 460, 340, 380 + 335j),
        {'A0': 32 - 16j, 'A': -24 + 16j},
    )  # fmt: skip
    at, (crank_angle, beta), center = sheet.at, sheet.directions, sheet.centers[1]
    crank, coupler, slider = (COLORS[name] for name in ('crank', 'coupler', 'slider'))
    guide = cmath.rect(1, delta)
    foot, left = 1j * e * guide, -0.32 * guide
    middle, edge = left + foot / 2 - 0.03 * guide, at['B'] + (0.14 + 0.06j) * guide
    above = edge + 0.1j * guide
    for start, end, color in (
        (-0.5 * guide, 1.05 * guide, GREY),
        (foot - 1.0 * guide, foot + 1.3 * guide, GREY),
        (at['A'], at['A'] + 0.24 * guide, GREY),
        (0j, foot, slider),
    ):
        sheet.dashes(start, end, color=color)
    for start, end, color in (
        (0j, 0.75 + 0j, DARK),
        (foot, at['B'], slider),
        (edge, edge + 0.2 * guide, slider),
        (above + 0.2 * guide, above, slider),
    ):
        sheet.arrow(start, end, color)
    sheet.arrow(left, left + foot, slider, both=True)
    sheet.angle('A0', (0, delta), 230, DARK, 'frame.angle', 8 + 2j)
    sheet.angle('A0', (delta, crank_angle), 48, crank, 'alpha', 4 + 8j)
    sheet.arc(0j, 85, (math.radians(215), math.radians(320)), crank)
    sheet.arc(at['A'], 60, (delta, beta), coupler)
    for ends, words, color, side in (
        ((at['A'], at['B']), 'coupler.length b', coupler, -18),
        ((middle - 0.4 * guide, middle), 'slider.offset e', slider, 0),
        ((foot, foot + 1.2 * guide), 'slider position x', slider, 15),
    ):
        sheet.along(ends, words, color, side)
    sheet.away(1, 'A', center, coupler, 0)
    sheet.mass(center, coupler)
    sheet.gravity(1.7 + 0.2j)
    sheet.texts(
        (0.75 + 0j, 'x of base_link', DARK, 8 - 4j, 'start'),
        (0.45 * at['A'], 'crank.length r', crank, -12 + 0j, 'end'),
        (0j, 'driving torque', crank, -105j, 'middle'),
        (at['A'] + 0.2 * guide, 'beta, here < 0', coupler, 20j, 'middle'),
        (center, 'coupler.center = [along, across]', coupler, 16 + 34j, 'start'),
        (at['B'], 'B of assembly: open', BLACK, -10 - 66j, 'middle'),
        (sheet.other['B'], 'B of assembly: crossed', BLACK, -36 - 60j, 'start'),
        (edge + 0.2 * guide, 'force of a load', slider, 8 + 4j, 'start'),
        (above + 0.2 * guide, 'its damping', slider, 8 + 4j, 'start'),
    )
    return sheet


def wind_pump() -> Picture:
    """Draws a wind pump with its two coordinates, motor torque and damping."""
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
    at, (phi1, phi2, phi3), (counterweight, _, center) = sheet.at, sheet.directions, sheet.centers
    crank, coupler, rod, slider = (COLORS[n] for n in ('crank', 'coupler', 'rod', 'slider'))
    sheet.arrow(0j, at['D'], slider)
    sheet.arrow(at['D'] + 0.34, at['D'] + 0.12, slider)
    for first, last, words, color, side in (
        ('A0', 'A', 'crank.length l1', crank, 18),
        ('A', 'B', 'coupler.length l2', coupler, 18),
        ('B', 'D', 'rod.length l3', rod, -18),
    ):
        sheet.along((at[first], at[last]), words, color, side)
    for angle in (
        ('A0', (0, phi1), 48, crank, 'phi1', 6 + 8j),
        ('A', (0, phi2), 70, coupler, 'phi2', 6 + 0j),
        ('B', (0, phi3), 60, rod, 'phi3, here < 0', 8 + 0j),
    ):
        sheet.angle(*angle)
    sheet.dashes(0j, counterweight, color=crank)
    sheet.mass(center, rod)
    sheet.mass(counterweight, crank)
    sheet.arc(0j, 85, (math.radians(140), math.radians(215)), crank)
    sheet.gravity(1.7 + 0.75j)
    sheet.texts(
        (0.8 + 0j, 'slider.position xD', slider, 15j, 'middle'),
        (center, 'rod.center', rod, 16 + 12j, 'start'),
        (counterweight, 'crank.center, here along < 0', crank, 14 - 26j, 'middle'),
        (0j, 'motor.torque', crank, -90 + 76j, 'middle'),
        (at['B'], 'B of assembly: open', BLACK, 22j, 'middle'),
        (sheet.other['B'], 'B of assembly: crossed', BLACK, 18 - 8j, 'start'),
        (at['D'] + 0.34, 'damping of a load', slider, 14 + 40j, 'end'),
    )
    return sheet


DRAWINGS = four_bar, slider_crank, wind_pump


def main() -> None:
    """Writes the SVG files."""
    argparse.ArgumentParser(description=__doc__.splitlines()[0]).parse_args()
    for draw in DRAWINGS:
        Path(__file__).with_name(f'mechanism_{draw.__name__}.svg').write_text(draw().svg())


if __name__ == '__main__':
    main()
