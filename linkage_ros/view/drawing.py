# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a picture of a linkage consists of: lines and points, whatever shows them.

All coordinates are m in base_link, x to the right and y up.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from linkage_ros.model.structure import Mechanism, Point, Structure
from linkage_ros.numeric import Array
from linkage_ros.view.reach import going_round, reach

# Parts of the width of all that moves: the margin around it, the marks of the fixed link, and how
# long a scale may be.
_MARGIN, _MARK, _BAR = 0.04, 0.04, 0.25
# In marks: how far that of a pivot reaches below it, how far names are beside their pins, beyond a
# slider's block too, and how high a name is in a small window.
_FOOT, _ASIDE, _BEYOND, _NAME = 1.4, 1.4, 1.9, 1.5


class Drawing:
    """The picture of one mechanism.

    Attributes:
        structure: How the links hang together.
        has_free_slider: Whether the crank angle alone does not tell where the slider is.
        joints: Names of the joints, in the order of positions.
        turning: Those of links that have a direction: all but a slider.
        going_round: Those of them that turn on and on.
        pivots: The fixed pivots A0 and, if there is one, B0; shape (1 or 2, 2), m.
        pivot_names: Their names.
        pins: Names of the moving points, in the order of `place`.
        ends: The pins between which each link that turns lies.
        owners: Of moving points that leave the circle of the crank pin, the links that are drawn
            in the colour of their paths.
        output: Name of the output link.
        paths: What the pin of the output link and, if there is one, the coupler point C trace
            out, by the name of the link whose point it is; each of shape (n, 2), m. Empty for a
            wind pump, whose points have no path of their own.
        ground: The marks of the fixed link, lines of shape (n, 2), m.
        footings: Where names of the fixed pivots can hang, below their marks; shape as pivots.
        scale: A bar below everything, a line of shape (4, 2), m.
        scale_length: How long it is, m.
        bounds: Lower left and upper right corner of everything at any time, shape (2, 2), m; of
            a wind pump while its slider is where it can be at every crank angle.
    """

    def __init__(self, mechanism: Mechanism, crank_angle: float = 0.0) -> None:
        """Draws it.

        Args:
            mechanism: The mechanism.
            crank_angle: From which it starts, rad; it matters where the crank cannot reach it
                from everywhere.
        """
        self.structure = structure = mechanism.structure()
        self.has_free_slider = len(mechanism.coordinates) > 1
        self.joints = tuple(link.name for link in structure.links)
        self.turning = tuple(link.name for link in structure.links if not link.slides)
        self.going_round = going_round(mechanism)
        points = structure.points
        fixed = {name: point.fixed for name, point in points.items() if not any(point.weights)}
        moving = {name: point for name, point in points.items() if name not in fixed}
        self.pins, self.pivot_names = tuple(moving), tuple(fixed)
        self._weights = np.array([point.weights for point in moving.values()])
        self._fixed = np.array([point.fixed for point in moving.values()])
        self.pivots = _plane(np.array(list(fixed.values())))

        positions, is_path = reach(mechanism, crank_angle)
        swept = self.place(positions)
        self.ends = _ends(structure)
        self.owners = self._owners(moving)
        pin_of = {link: pin for pin, link in self.owners.items()}
        output = structure.links[-1]
        self.output, self._output_pin = output.name, self.pins.index(pin_of[output.name])
        self.paths: dict[str, Array] = {}
        if is_path:
            for pin, link in self.owners.items():
                self.paths[link] = swept[:, self.pins.index(pin)]
        everything = np.concatenate([self.pivots, swept.reshape(-1, 2)])
        mark = _MARK * np.ptp(everything, axis=0).max()
        self.ground = [line for pivot in self.pivots for line in _pivot(pivot, mark)]
        self._block: npt.NDArray[np.complex128] | None = None
        self._axis: Array | None = None
        if output.slides:
            axis = complex(math.cos(output.angle), math.sin(output.angle))
            self._axis = np.array([axis.real, axis.imag])
            self._block = mark * axis * np.array([1 + 0.6j, -1 + 0.6j, -1 - 0.6j, 1 - 0.6j])
            self.ground += _rail(swept[:, self._output_pin], axis, mark)
        self._mark, down = mark, np.array([0.0, mark])
        self.footings = self.pivots - _FOOT * down
        names = self.beside(swept).reshape(-1, 2)
        everything = np.concatenate([everything, *self.ground, names, self.footings])
        self.scale_length = _round_below(_BAR * np.ptp(everything, axis=0).max())
        self.scale = _bar(everything.min(axis=0) - down, self.scale_length, mark)
        hanging = [place - _NAME * down for place in (self.footings, self.scale)]
        everything = np.concatenate([everything, self.scale, *hanging])
        margin = _MARGIN * np.ptp(everything, axis=0).max()
        self.bounds = np.array([everything.min(axis=0) - margin, everything.max(axis=0) + margin])

    def _owners(self, moving: dict[str, Point]) -> dict[str, str]:
        """Of pins beyond the crank's the next link, of other points their own link."""
        owners = {
            self.ends[link][1]: after
            for link, after in pairwise(self.joints[1:])
            if link in self.ends
        }
        on_line = {pin for ends in self.ends.values() for pin in ends}
        for name, point in moving.items():
            if name not in on_line:
                owners[name] = self.joints[np.flatnonzero(point.weights)[-1]]
        return owners

    def place(self, position: Array) -> Array:
        """Where the moving points are.

        Args:
            position: Of the links, shape (n, 3 or 4), rad and m.

        Returns:
            The pins, in the order of `pins`; shape (n, 2 to 4, 2), m.
        """
        # A slide would be no angle, but then the points do not depend on it.
        slides = [link.slides for link in self.structure.links]
        turned = np.exp(1j * np.where(slides, 0.0, position))
        return _plane(turned @ self._weights.T + self._fixed)

    def beside(self, points: Array) -> Array:
        """Where names of the moving points can hang: away from the middle of all points.

        Args:
            points: As `place` gives them, shape (n, 2 to 4, 2), m.

        Returns:
            Likewise, m.
        """
        fixed = self.pivots.sum(axis=0)
        middle = (points.sum(axis=1) + fixed) / (points.shape[1] + len(self.pivots))
        away = points - middle[:, np.newaxis]
        length = np.maximum(np.linalg.norm(away, axis=-1, keepdims=True), 1e-12 * self._mark)
        away = away / length
        far = np.full((points.shape[1], 1), _ASIDE)
        if (
            self._axis is not None
        ):  # on the guide, beside the block: below it the ground is hatched
            side = np.copysign(1.0, away[:, self._output_pin] @ self._axis)
            away[:, self._output_pin] = np.outer(side, self._axis)
            far[self._output_pin] = _BEYOND
        # A name hangs down from its place: above a pin it needs room for its height.
        away[..., 1] += 0.5 * (1 + away[..., 1])
        aside: Array = points + far * self._mark * away
        return aside

    def of_links(self, position: Array) -> Array:
        """The positions of the links, from those that ROS sees; or their rates.

        Args:
            position: Joint positions in the order of the tree, shape (n, 3 or 4), rad and m.

        Returns:
            As `place` takes them: directions in base_link, rad, and slides, m.
        """
        links: Array = position.copy()
        for i, link in enumerate(self.structure.links):
            if link.parent is not None:
                links[:, i] += links[:, link.parent]
        return links

    def links(self, points: Array) -> dict[str, Array]:
        """The lines of the moving links, by their names.

        Args:
            points: As `place` gives them, shape (n, 2 to 4, 2), m.

        Returns:
            Lines of shape (n, 2, 2), m. A coupler with a point is a triangle, (n, 4, 2), a
            slider a block, (n, 5, 2).
        """
        at = {name: points[:, i] for i, name in enumerate(self.pins)}
        for name, pivot in zip(self.pivot_names, self.pivots, strict=True):
            at[name] = np.broadcast_to(pivot, (len(points), 2))
        lines = {}
        for joint in self.joints:
            if joint in self.ends:
                ends = self.ends[joint]
                aside = [pin for pin, link in self.owners.items() if link == joint]
                aside = [pin for pin in aside if pin not in ends]
                lines[joint] = [at[name] for name in (*ends, *aside, *(ends[:1] if aside else ()))]
        if self._block is not None:
            corners = _plane(self._block)
            lines[self.output] = [points[:, self._output_pin] + corners[i % 4] for i in range(5)]
        return {name: np.stack(line, axis=1) for name, line in lines.items()}


def _ends(structure: Structure) -> dict[str, tuple[str, str]]:
    """The pins between which each link lies that turns, on the way around the loop."""
    names = {point: name for name, point in structure.points.items()}
    way, rest = structure.closure.weights, (0j,) * len(structure.links)

    def stop(count: int) -> tuple[str, bool]:
        """The pin after some links, and whether the way to it from the loop's end is taken."""
        there = names.get(Point(way[:count] + rest[count:]))
        back = Point(rest[:count] + tuple(-w for w in way[count:]), -structure.closure.fixed)
        return (there, False) if there else (names[back], True)

    ends: dict[str, tuple[str, str]] = {}
    for j, link in enumerate(structure.links):
        if way[j]:
            (start, is_back), (end, _) = stop(j), stop(j + 1)
            ends[link.name] = (end, start) if is_back else (start, end)
    return ends


def _plane(points: npt.NDArray[np.complex128]) -> Array:
    return np.stack([points.real, points.imag], axis=-1)


def _pivot(pivot: Array, size: float) -> list[Array]:
    """A triangle that stands on hatched ground, as drawings of mechanisms have it."""
    shapes: list[list[tuple[float, float]]] = [
        [(0, 0), (-0.6, -1), (0.6, -1), (0, 0)],
        [(-1, -1), (1, -1)],
        *([(x, -1), (x - 0.4, -_FOOT)] for x in (-0.6, -0.2, 0.2, 0.6, 1.0)),
    ]
    return [pivot + size * np.array(shape) for shape in shapes]


def _round_below(length: float) -> float:
    """The longest of 1, 2 and 5 times a power of ten that is no longer."""
    decade = 10.0 ** math.floor(math.log10(length))
    return max(digit * decade for digit in (1.0, 2.0, 5.0) if digit * decade <= length)


def _bar(start: Array, length: float, mark: float) -> Array:
    """A scale from a point to the right, with its ends turned up."""
    up = 0.4 * mark
    bar: Array = start + np.array([(0.0, up), (0.0, 0.0), (length, 0.0), (length, up)])
    return bar


def _rail(path: Array, axis: complex, size: float) -> list[Array]:
    """Hatched ground below a slider, as long as its stroke."""
    along = (path[:, 0] + 1j * path[:, 1]) * axis.conjugate()
    below = 1j * (along.imag.mean() - 0.6 * size)
    start, end = along.real.min() - 1.6 * size, along.real.max() + 1.6 * size
    marks = np.linspace(start, end, round((end - start) / (0.8 * size)) + 1)[1:]
    lines = [[start, end], *([x, x - (0.4 + 0.4j) * size] for x in marks)]
    return [_plane((np.array(line) + below) * axis) for line in lines]
