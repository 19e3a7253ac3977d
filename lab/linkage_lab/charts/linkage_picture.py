# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A linkage drawn with Matplotlib, with the names of its pins, for charts, movies and sketches."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke

from linkage_lab.output import SMALL
from linkage_ros.formulas import Array
from linkage_ros.internals import Picture
from linkage_ros.palette import DARK, GREY, Color, fractions

# Margin around the drawing, relative to its size; and at least, for names, inches.
_MARGIN, _NAMES = 0.08, 0.4
_AS_FAR = 8.0  # a gap as bad as covering a point of a line, points
_MOVED = 0.5  # a moved anchor is as bad as covering this many points of a line
_AS_NEAR = 0.5  # a name this much farther from its part than from another is as near, points
_STEP = 4.0  # between the points of lines that names should not cover, points
WIDE = 2.2  # a drawing with this ratio of width to height is above text or diagrams
# Gaps between a name and its pin, points, and its directions relative to the preferred one, deg;
# radius of a pin, points.
_GAPS, _TURNS, _PIN = (6.0, 14.0, 24.0), (0, 40, -40, 80, -80, 120, -120, 180), 2.5
NAME_STYLE: dict[str, Any] = {
    'textcoords': 'offset points', 'fontsize': SMALL, 'va': 'center', 'annotation_clip': False,
    'snap': False,  # a moving letter of straight lines, such as E, would change its shape
}  # fmt: skip


def proportion(drawing: Picture, positions: Array) -> float:
    """Computes the ratio of width to height of the drawing of a mechanism.

    Args:
        drawing: The drawing.
        positions: Positions of the links, rad and m, shape (n, links).
    """
    tracks = drawing.place(positions)
    points = np.concatenate([*drawing.ground, tracks.reshape(-1, 2)])
    width, height = np.ptp(points, axis=0)
    return float(width / height)


class LinkagePicture:
    """A drawing of a mechanism with its pins, their paths over a period, and a scale bar.

    Attributes:
        moving: Artists that `move` changes, from back to front.
    """

    def __init__(
        self,
        axes: Axes,
        drawing: Picture,
        positions: Array,
        shown: Array,
        others: Sequence[Array] = (),
    ) -> None:
        """Draws the mechanism at the first position, with room for all positions.

        Args:
            axes: Axes to draw in, which may have other lines.
            drawing: The drawing.
            positions: Positions of the links along the paths, rad and m, shape (n, links).
            shown: Those to be shown, of the same kind.
            others: Other lines, which names should not cover, m, shapes (k, 2).
        """
        self._axes, self._drawing, self._others = axes, drawing, others
        self._plot_ground_and_paths(positions)
        places = drawing.place(shown)  # of the pins, shape (m, pins, 2)
        # Lines at all shown positions make room for them; `move` replaces them.
        self._links = {
            link: self._plot(lines.reshape(-1, 2), drawing.colors[link], linewidth=2.6)
            for link, lines in drawing.links(places).items()
        }
        pins = np.concatenate([drawing.pivots, places.reshape(-1, 2)])
        self._pins = self._plot(pins, DARK, linestyle='', marker='o', markersize=3.5, zorder=4)
        # The ground is drawn below the pivots, so their names are placed to the sides.
        self._asides = [(pivot[0] - pins[:, 0].mean(), 0.0) for pivot in drawing.pivots]
        scale_text = self._plot_scale()
        halo = withStroke(linewidth=2.5, foreground='white')  # names may lie on paths
        style = NAME_STYLE | {'ha': 'center', 'path_effects': [halo]}
        self._names = [
            axes.annotate('' if name == drawing.unnamed else name, (0, 0), xytext=(0, 0), **style)
            for name in (*drawing.pivot_names, *drawing.pins)
        ]
        self._set_limits()
        self.moving = [*self._links.values(), self._pins, *self._names]
        self._points_per_pixel = 72 / axes.figure.dpi
        self._measure_texts(scale_text)
        self.move(shown[0])

    def _plot_ground_and_paths(self, positions: Array) -> None:
        """Draws the ground, and the paths of the pins at these positions of the links."""
        drawing = self._drawing
        tracks = drawing.place(positions)
        for line in drawing.ground:
            self._plot(line, GREY, linewidth=0.9)
        for pin, owner in drawing.owners.items():
            path = tracks[:, drawing.pins.index(pin)]
            width = 1.3 if pin in drawing.traced else 0.8
            self._plot(path, drawing.colors[owner], linewidth=width)

    def _plot_scale(self) -> Any:
        """Draws the scale bar below all lines so far; returns the text of its length."""
        drawing = self._drawing
        low, high = self._axes.dataLim.get_points()
        below = 0.0, 0.06 * (high - low).max()
        self._scale_shift = low - below - drawing.scale.min(axis=0)
        scale = drawing.scale + self._scale_shift
        self._plot(scale, GREY, linewidth=0.9)
        return self._axes.annotate(
            drawing.scale_label, tuple(scale[2]), xytext=(5, 0), **NAME_STYLE
        )

    def _set_limits(self) -> None:
        """Sets equal scales, and margins with room for names."""
        axes = self._axes
        axes.set_aspect('equal')
        box, inch = axes.get_window_extent(), axes.figure.dpi
        axes.margins(
            max(_MARGIN, _NAMES * inch / box.width), max(_MARGIN, _NAMES * inch / box.height)
        )
        axes.set_axis_off()
        axes.apply_aspect()

    def _measure_texts(self, scale_text: Any) -> None:
        """Measures, in points, the sizes of the names, and the boxes of the scale."""
        boxes = [text.get_window_extent().get_points() for text in (scale_text, *self._names)]
        scale_text_box, *corners = self._points_per_pixel * np.array(boxes)
        self._sizes = np.ptp(corners, axis=1)
        scale = self.to_points(self._drawing.scale + self._scale_shift)
        # Names must not cover these boxes.
        self._scale_boxes = [scale_text_box, [scale.min(axis=0), scale.max(axis=0)]]

    def move(self, position: Array) -> None:
        """Shows the mechanism at a position of its links, shape (links,)."""
        drawing = self._drawing
        moving = drawing.place(position[np.newaxis])  # shape (1, pins, 2)
        for link, (line,) in drawing.links(moving).items():
            self._links[link].set_data(*line.T)
        pins = np.array([*drawing.pivots, *moving[0]])
        self._pins.set_data(*pins.T)
        preferred = np.array([*self._asides, *(drawing.labels(moving)[0] - moving[0])])
        anchors = self.to_points(pins)
        pin_boxes = [[anchor - _PIN, anchor + _PIN] for anchor in anchors]
        self._occupied = np.array([*self._scale_boxes, *pin_boxes])
        places = self.free_places(anchors, preferred, self._sizes, self._others)
        for name, pin, place in zip(self._names, pins, places, strict=True):
            name.xy = tuple(pin)
            name.set_position(tuple(place.tolist()))

    def to_points(self, places: Array) -> Array:
        """Converts places, m, shape (n, 2), to points of the page."""
        return np.asarray(self._points_per_pixel * self._axes.transData.transform(places))

    def free_places(
        self,
        anchors: Array,
        preferred: Array,
        sizes: Array,
        lines: Sequence[Array] = (),
        gaps: Sequence[float] = _GAPS,
        parts: Sequence[Array | None] = (),
        shifts: Array | None = None,
    ) -> list[Array]:
        """Finds places for names one after another.

        The page should not cut them off; they should cover no earlier name or pin, be nearest to
        what they belong to, be within the axes, and be near and cover few lines, in this order.

        Args:
            anchors: Positions of what the names belong to, points, shape (n, 2).
            preferred: Preferred direction of each name from there, of the same shape.
            sizes: Widths and heights of the names, points, of the same shape.
            lines: Lines that names should not cover, m, shapes (k, 2).
            gaps: Gaps between a name and its anchor that are tried in turn, points.
            parts: What the names belong to, lines of shapes (k, 2), m; None for a name that may be
                near to others. Empty for the anchors.
            shifts: A vector for each name, points, shape (n, 2), by which its anchor may be moved
                forwards and backwards; None for anchors that stay.

        Returns:
            Positions of the names relative to the anchors, points.
        """
        figure, position = self._axes.figure, self._axes.get_position(original=True)
        page = self._points_per_pixel * figure.bbox.get_points()
        inside = position.transformed(figure.transFigure).get_points() * self._points_per_pixel
        points = np.concatenate([np.empty((0, 2)), *(_dense(self.to_points(x)) for x in lines)])
        owned = {i: anchor[np.newaxis] for i, anchor in enumerate(anchors)}
        if parts:
            own_lines = {i: part for i, part in enumerate(parts) if part is not None}
            owned = {i: _dense(self.to_points(part)) for i, part in own_lines.items()}
        moves = np.zeros((len(anchors), 1, 2))
        if shifts is not None:
            moves = np.array([[0.0], [1.0], [-1.0]]) * shifts[:, np.newaxis]
        gap_costs = np.repeat(gaps, len(_TURNS)) / _AS_FAR
        costs_of_moves = np.where(np.arange(moves.shape[1]) > 0, _MOVED, 0.0)
        gap_costs = np.add.outer(costs_of_moves, gap_costs).ravel()
        chosen = []
        for i, (anchor, direction, size) in enumerate(zip(anchors, preferred, sizes, strict=True)):
            around, half = _places(direction, gaps, size), 0.5 * size + 1.0
            places = (moves[i][:, np.newaxis] + around).reshape(-1, 2)
            low, high = anchor + places - half, anchor + places + half  # corners of the name
            covered_boxes = _count_overlaps(low, high, self._occupied[:, 0], self._occupied[:, 1])
            covered_points = _count_overlaps(low, high, points, points)
            is_cut, is_outside = _exceeds(low, high, page), _exceeds(low, high, inside)
            apart = {k: _apart(low, high, part) for k, part in owned.items()}
            is_astray = np.zeros(len(low), dtype=bool)
            if i in apart:
                is_astray = apart[i] > np.min([*apart.values()], axis=0) + _AS_NEAR
            # The last key of `lexsort` is the first criterion.
            costs = covered_points + gap_costs, is_outside, is_astray, covered_boxes, is_cut
            best = np.lexsort(costs)[0]  # the first of the best ones
            self._occupied = np.concatenate([self._occupied, [[low[best], high[best]]]])
            chosen.append(places[best])
        return chosen

    def _plot(self, points: Array, color: Color, **style: Any) -> Line2D:
        style |= {'color': fractions(color), 'solid_capstyle': 'round'}
        return self._axes.plot(*points.T, **style)[0]


def _count_overlaps(low: Array, high: Array, others_low: Array, others_high: Array) -> Any:
    """Returns with how many of m boxes each of n boxes overlaps, shape (n,).

    Args:
        low: Lower left corners of the boxes, shape (n, 2).
        high: Upper right corners of the boxes, shape (n, 2).
        others_low: Lower left corners of the other boxes, shape (m, 2).
        others_high: Upper right corners of the other boxes, shape (m, 2).
    """
    overlaps = (low[:, None] < others_high) & (others_low < high[:, None])
    return overlaps.all(axis=2).sum(axis=1)


def _apart(low: Array, high: Array, points: Array) -> Any:
    """Returns the distance of each box from the nearest of m points, shape (n,)."""
    gaps = np.maximum(low[:, None] - points, points - high[:, None])
    return np.linalg.norm(np.maximum(gaps, 0.0), axis=2).min(axis=1)


def _exceeds(low: Array, high: Array, area: Array) -> Any:
    """Returns whether each box exceeds an area, given its lower left and upper right corner."""
    return ((low < area[0]) | (area[1] < high)).any(axis=1)


def _places(preferred: Array, gaps: Sequence[float], size: Array) -> Array:
    """Returns positions of a name relative to its pin, points, in the order of preference.

    Args:
        preferred: Preferred direction of the name, shape (2,).
        gaps: Gaps between the pin and the name, points.
        size: Width and height of the name, points.
    """
    turned = np.exp(1j * np.radians(_TURNS)) * complex(*preferred) / math.hypot(*preferred)
    directions = np.stack([turned.real, turned.imag], axis=1)
    from_middle = np.reshape(gaps, (-1, 1, 1)) + 0.5 * size  # to the middle of the name
    return np.concatenate(from_middle * directions)  # the nearest ones first


def _dense(line: Array) -> Array:
    """Returns points along a line, close to each other; all in points."""
    steps = np.linalg.norm(np.diff(line, axis=0), axis=1)
    return np.concatenate([
        start + np.linspace(0, 1, max(2, math.ceil(step / _STEP)))[:, np.newaxis] * (end - start)
        for start, end, step in zip(line[:-1], line[1:], steps, strict=True)
    ])  # fmt: skip
