# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The picture of a linkage as lines and points, for Rerun and for charts.

All coordinates are m in base_link, x to the right and y up.
"""

from __future__ import annotations

import cmath
import math
from itertools import pairwise
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from linkage_ros.model.structure import Mechanism, Point, Structure
from linkage_ros.numeric import Array
from linkage_ros.view.load_arrows import LoadArrows, plane
from linkage_ros.view.reach import reach

# Shares of the width of all that moves: size of a pivot's triangle (a mark), and the greatest
# length of the scale.
_MARK, _SCALE = 0.04, 0.25
# In marks: height of a pivot with its ground; distance of a name from its pin, and from that of a
# slider's block, and from a pivot, beside it; height of a name.
_PIVOT_HEIGHT, _LABEL_DISTANCE, _LABEL_BEYOND_BLOCK, _LABEL_ASIDE, _LABEL_HEIGHT = (
    1.4,
    1.5,
    1.9,
    2.5,
    1.4,
)

_Complex: TypeAlias = npt.NDArray[np.complex128]


class Drawing:
    """The picture of one mechanism.

    Attributes:
        structure: Links and points of the mechanism.
        joints: Names of the joints, in the order of positions.
        turning: Names of the links that have a direction: all but a slider.
        pivots: The fixed pivots A0 and, if there is one, B0; shape (1 or 2, 2), m.
        pivot_names: Their names.
        pivot_labels: Positions of their labels; shape as pivots, m.
        pins: Names of the moving points, in the order of `place`.
        ends: First and second pin of each link that turns.
        owners: Links that determine the colours of the paths, by moving point; not of points on
            the circle of the crank pin.
        output: Name of the output link.
        loaded: Names of the links on which loads act.
        paths: Closed paths of the output link's pin and of the coupler point C, by the name of
            the link whose point it is; shape (n, 2), m. Empty for a mechanism with a free slider.
        ground: Drawing of the fixed link, lines of shape (n, 2), m.
        scale: A bar below everything, a line of shape (4, 2), m.
        scale_length: Its length, m.
        bounds: Lower left and upper right corner of the whole motion, shape (2, 2), m; with a
            free slider, of the positions possible at every crank angle.
    """

    def __init__(self, mechanism: Mechanism, crank_angle: float = 0.0) -> None:
        """Makes the drawing.

        Args:
            mechanism: The mechanism.
            crank_angle: Crank angle at the start, rad; it selects the arc of a crank that cannot
                turn fully.
        """
        self.structure = structure = mechanism.structure()
        self.joints = tuple(link.name for link in structure.links)
        self.turning = tuple(link.name for link in structure.links if not link.slides)
        points = structure.points
        fixed = {name: point.fixed for name, point in points.items() if not any(point.weights)}
        moving = {name: point for name, point in points.items() if name not in fixed}
        self.pins, self.pivot_names = tuple(moving), tuple(fixed)
        self._weights = np.array([point.weights for point in moving.values()])
        self._fixed = np.array([point.fixed for point in moving.values()])
        self.pivots = plane(np.array(list(fixed.values())))
        self.ends = _ends(structure)
        self.owners = self._find_owners(moving)
        self.output = self.joints[-1]
        pin_of = {link: pin for pin, link in self.owners.items()}
        self._output_pin = pin_of[self.output]
        self._corners = {link: self._corners_of(link) for link in self.turning}
        sides = [side for corners in self._corners.values() for side in pairwise(corners)]
        self._neighbours = {
            pin: sorted({end for side in sides if pin in side for end in side} - {pin})
            for pin in self.pins
        }

        positions = reach(mechanism, crank_angle)
        swept = self.place(positions)
        traced = self.owners.items() if mechanism.reach() else ()
        self.paths = {link: swept[:, self.pins.index(pin)] for pin, link in traced}
        everything = np.concatenate([self.pivots, swept.reshape(-1, 2)])
        self._mark = mark = _MARK * np.ptp(everything, axis=0).max()
        self.ground = [line for pivot in self.pivots for line in _pivot(pivot, mark)]
        self._block: _Complex | None = None
        self._blocked_directions: tuple[
            complex, ...
        ] = ()  # directions that a slider's name must avoid
        if structure.links[-1].slides:
            axis = cmath.rect(1.0, structure.links[-1].angle)
            self._block = mark * axis * np.array([1 + 0.6j, -1 + 0.6j, -1 - 0.6j, 1 - 0.6j])
            self._blocked_directions = axis, -axis, -1j * axis
            self.ground += _rail(swept[:, self.pins.index(self._output_pin)], axis, mark)
        middle = swept.reshape(-1, 2).mean(axis=0)
        self.pivot_labels = np.array([_pivot_label(pivot, middle, mark) for pivot in self.pivots])
        end = self._by_name(swept)[self._output_pin]
        self._arrows = LoadArrows(mechanism, mark, positions, end)
        self.loaded = self._arrows.links
        room = self._arrows.room
        everything = np.concatenate([everything, *self.ground, self.pivot_labels, room])
        low, high = everything.min(axis=0), everything.max(axis=0)
        room = (_LABEL_DISTANCE + _LABEL_HEIGHT) * mark  # for the names of the pins
        self.scale_length = length = _round_below(_SCALE * (high - low).max())
        end = 0.4 * mark  # the ends of the bar are turned up
        self.scale = low - room + np.array([(0, end), (0, 0), (length, 0), (length, end)])
        self.bounds = np.array([low - room - [mark, 2 * mark], high + room])

    def _find_owners(self, moving: dict[str, Point]) -> dict[str, str]:
        """Finds the owners: the next link for outer pins, the own link for other points."""
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
        """Computes the positions of the moving points.

        Args:
            position: Positions of the links, shape (n, links), rad and m.

        Returns:
            The pins, in the order of `pins`; shape (n, pins, 2), m.
        """
        # A slider's position is not an angle, but no point depends on it: its weights are 0.
        slides = [link.slides for link in self.structure.links]
        turned = np.exp(1j * np.where(slides, 0.0, position))
        return plane(turned @ self._weights.T + self._fixed)

    def links_from_joints(self, position: Array) -> Array:
        """Converts positions or rates of the joints to those of the links.

        Args:
            position: Joint positions in the order of the tree, shape (n, links), rad and m.

        Returns:
            Directions in base_link, rad, and slides, m; as `place` takes them.
        """
        links: Array = position.copy()
        for i, link in enumerate(self.structure.links):
            if link.parent is not None:
                links[:, i] += links[:, link.parent]
        return links

    def links(self, points: Array) -> dict[str, Array]:
        """The lines of the moving links, by their names.

        Args:
            points: As `place` gives them, shape (n, pins, 2), m.

        Returns:
            Lines of shape (n, 2, 2), m. A coupler with a point is a triangle, (n, 4, 2), a
            slider a block, (n, 5, 2).
        """
        at = self._by_name(points)
        lines = {
            link: plane(np.stack([at[pin] for pin in pins], axis=1))
            for link, pins in self._corners.items()
        }
        if self._block is not None:
            middle = at[self._output_pin][:, np.newaxis]
            lines[self.output] = plane(middle + self._block[[0, 1, 2, 3, 0]])
        return lines

    def loads(self, points: Array, positions: Array, rates: Array) -> dict[str, Array]:
        """The arrows of the loads, by the names of the links on which they act.

        Args:
            points: As `place` gives them, shape (n, pins, 2), m.
            positions: Positions of the links, as `place` takes them.
            rates: Their rates, rad/s and m/s.

        Returns:
            Lines of shape (n, k, 2), m.
        """
        return self._arrows.lines(positions, rates, self._by_name(points)[self._output_pin])

    def labels(self, points: Array) -> Array:
        """Positions of the pins' labels, in the widest gap between the links.

        Args:
            points: From `place`, shape (n, pins, 2), m.

        Returns:
            Positions of the same shape, m.
        """
        at = self._by_name(points)
        return plane(np.stack([self._label(at, pin) for pin in self.pins], axis=1))

    def _label(self, at: dict[str, _Complex], pin: str) -> _Complex:
        ways = [at[other] - at[pin] for other in self._neighbours[pin]]
        blocked = self._blocked_directions if pin == self._output_pin else ()
        ways += [np.full_like(at[pin], wall) for wall in blocked]
        angles = np.sort(np.angle(ways), axis=0)
        gaps = np.diff(angles, axis=0, append=angles[:1] + 2 * math.pi)
        widest, column = gaps.argmax(axis=0), np.arange(gaps.shape[1])
        middle = angles[widest, column] + 0.5 * gaps[widest, column]
        # A name hangs: its middle is below its place.
        way = (_LABEL_BEYOND_BLOCK if blocked else _LABEL_DISTANCE) * np.exp(
            1j * middle
        ) + 0.5j * _LABEL_HEIGHT
        place: _Complex = at[pin] + self._mark * way
        return place

    def _corners_of(self, link: str) -> tuple[str, ...]:
        """The points of a turning link."""
        ends = self.ends[link]
        aside = [pin for pin, owner in self.owners.items() if owner == link and pin not in ends]
        return (*ends, *aside, *(ends[:1] if aside else ()))

    def _by_name(self, points: Array) -> dict[str, _Complex]:
        at = dict(zip(self.pins, (points @ (1, 1j)).T, strict=True))
        for name, pivot in zip(self.pivot_names, self.pivots @ (1, 1j), strict=True):
            at[name] = np.full(len(points), pivot)
        return at


def _ends(structure: Structure) -> dict[str, tuple[str, str]]:
    """First and second pin of each link that turns, in the order of the loop."""
    names = {point: name for name, point in structure.points.items()}
    way, rest = structure.closure.weights, (0j,) * len(structure.links)

    def pin_after(count: int) -> tuple[str, bool]:
        """The pin after some links, and whether it is counted from the loop's end."""
        there = names.get(Point(way[:count] + rest[count:]))
        back = Point(rest[:count] + tuple(-w for w in way[count:]), -structure.closure.fixed)
        return (there, False) if there else (names[back], True)

    ends: dict[str, tuple[str, str]] = {}
    for j, link in enumerate(structure.links):
        if way[j]:
            (start, is_back), (end, _) = pin_after(j), pin_after(j + 1)
            ends[link.name] = (end, start) if is_back else (start, end)
    return ends


def _pivot_label(pivot: Array, middle: Array, mark: float) -> Array:
    """Position of a fixed pivot's label: below it, or beside it if the links are below."""
    if middle[1] >= pivot[1]:
        return np.array([pivot[0], pivot[1] - _PIVOT_HEIGHT * mark])
    aside = math.copysign(_LABEL_ASIDE, pivot[0] - middle[0])
    return np.array([pivot[0] + aside * mark, pivot[1] + 0.5 * _LABEL_HEIGHT * mark])


def _pivot(pivot: Array, size: float) -> list[Array]:
    """The symbol of a fixed pivot: a triangle on hatched ground."""
    shapes: list[list[tuple[float, float]]] = [
        [(0, 0), (-0.6, -1), (0.6, -1), (0, 0)],
        [(-1, -1), (1, -1)],
        *([(x, -1), (x - 0.4, -_PIVOT_HEIGHT)] for x in (-0.6, -0.2, 0.2, 0.6, 1.0)),
    ]
    return [pivot + size * np.array(shape) for shape in shapes]


def _round_below(length: float) -> float:
    """Rounds down to 1, 2 or 5 times a power of ten."""
    decade = 10.0 ** math.floor(math.log10(length))
    return max(digit * decade for digit in (1.0, 2.0, 5.0) if digit * decade <= length)


def _rail(path: Array, axis: complex, size: float) -> list[Array]:
    """Hatched ground below a slider, as long as its stroke."""
    along = (path[:, 0] + 1j * path[:, 1]) * axis.conjugate()
    below = 1j * (along.imag.mean() - 0.6 * size)
    start, end = along.real.min() - 1.6 * size, along.real.max() + 1.6 * size
    marks = np.linspace(start, end, round((end - start) / (0.8 * size)) + 1)[1:]
    lines = [[start, end], *([x, x - (0.4 + 0.4j) * size] for x in marks)]
    return [plane((np.array(line) + below) * axis) for line in lines]
