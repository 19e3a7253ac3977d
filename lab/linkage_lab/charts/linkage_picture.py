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
from linkage_ros.internals import Drawing
from linkage_ros.palette import DARK, GREY, Color, fractions

# Margin around the drawing, relative to its size; and at least, for names, inches.
_MARGIN, _NAMES = 0.08, 0.4
_AS_FAR = 8.0  # a distance as bad as covering a point of a line, points
_STEP = 4.0  # between the points of lines that names should not cover, points
WIDE = 2.2  # a drawing with this ratio of width to height is above text or diagrams
# A name's distances from its pin, points, and its directions relative to the preferred one, deg;
# radius of a pin, points.
_DISTANCES, _TURNS, _PIN = (16.0, 26.0, 36.0), (0, 40, -40, 80, -80, 120, -120, 180), 2.5
NAME_STYLE: dict[str, Any] = {
    'textcoords': 'offset points', 'fontsize': SMALL, 'va': 'center', 'annotation_clip': False,
    'snap': False,  # a moving letter of straight lines, such as E, would change its shape
}  # fmt: skip


def proportion(drawing: Drawing, positions: Array) -> float:
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
        drawing: Drawing,
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
        tracks = drawing.place(positions)
        for line in drawing.ground:
            self._plot(line, GREY, linewidth=0.9)
        for pin, owner in drawing.owners.items():
            path = tracks[:, drawing.pins.index(pin)]
            width = 1.3 if pin in drawing.traced else 0.8
            self._plot(path, drawing.colors[owner], linewidth=width)
        first, shown = shown[0], drawing.place(shown)
        self._links = {
            link: self._plot(lines.reshape(-1, 2), drawing.colors[link], linewidth=2.6)
            for link, lines in drawing.links(shown).items()
        }
        pins = np.concatenate([drawing.pivots, shown.reshape(-1, 2)])
        self._pins = self._plot(pins, DARK, linestyle='', marker='o', markersize=3.5)
        # The ground is drawn below the pivots, so their names are placed to the sides.
        self._asides = [(pivot[0] - pins[:, 0].mean(), 0.0) for pivot in drawing.pivots]
        low, high = axes.dataLim.get_points()
        scale = drawing.scale - drawing.scale.min(axis=0) + low - (0.0, 0.06 * (high - low).max())
        self._plot(scale, GREY, linewidth=0.9)
        length = f'{drawing.scale_length:g} m'
        unit = axes.annotate(length, tuple(scale[2]), xytext=(5, 0), **NAME_STYLE)
        halo = withStroke(linewidth=2.5, foreground='white')  # names may lie on paths
        names = (*drawing.pivot_names, *drawing.pins)
        style = NAME_STYLE | {'ha': 'center', 'path_effects': [halo]}
        self._names = [
            axes.annotate('' if name == drawing.unnamed else name, (0, 0), xytext=(0, 0), **style)
            for name in names
        ]
        axes.set_aspect('equal')
        box, inch = axes.get_window_extent(), axes.figure.dpi
        wide, high = (max(_MARGIN, _NAMES * inch / size) for size in (box.width, box.height))
        axes.margins(wide, high)
        axes.set_axis_off()
        axes.apply_aspect()
        self.moving = [*self._links.values(), self._pins, *self._names]
        self._points_per_pixel = 72 / axes.figure.dpi  # per pixel
        boxes = [text.get_window_extent().get_points() for text in (unit, *self._names)]
        self._unit, *corners = self._points_per_pixel * np.array(boxes)
        self._sizes = np.ptp(corners, axis=1)
        self.move(first)

    def move(self, position: Array) -> None:
        """Shows the mechanism at a position of its links, shape (links,)."""
        drawing = self._drawing
        now = drawing.place(position[np.newaxis])
        for link, (line,) in drawing.links(now).items():
            self._links[link].set_data(*line.T)
        pins = np.array([*drawing.pivots, *now[0]])
        self._pins.set_data(*pins.T)
        ways = np.array([*self._asides, *(drawing.labels(now)[0] - now[0])])
        at = self.to_points(pins)
        self._taken = np.array([self._unit, *([pin - _PIN, pin + _PIN] for pin in at)])
        places = self.free_places(at, ways, self._sizes, self._others)
        for name, pin, place in zip(self._names, pins, places, strict=True):
            name.xy = tuple(pin)
            name.set_position(tuple(place.tolist()))

    def to_points(self, places: Array) -> Array:
        """Converts places, m, shape (n, 2), to points of the page."""
        return np.asarray(self._points_per_pixel * self._axes.transData.transform(places))

    def free_places(
        self,
        anchors: Array,
        ways: Array,
        sizes: Array,
        lines: Sequence[Array] = (),
        distances: Sequence[float] = _DISTANCES,
    ) -> list[Array]:
        """Finds places for names one after another.

        The page should not cut them off; they should cover no earlier name or pin, be within the
        axes, and be near and cover few lines, in this order.

        Args:
            anchors: Positions of what the names belong to, points, shape (n, 2).
            ways: Preferred direction of each name from there, of the same shape.
            sizes: Widths and heights of the names, points, of the same shape.
            lines: Lines that names should not cover, m, shapes (k, 2).
            distances: Distances of a name that are tried in turn, points.

        Returns:
            Positions of the names relative to the anchors, points.
        """
        figure, axes = self._axes.figure, self._axes.get_position(original=True)
        boxes = figure.bbox, axes.transformed(figure.transFigure)
        page, room = (self._points_per_pixel * box.get_points() for box in boxes)
        points = np.concatenate([np.empty((0, 2)), *(_dense(self.to_points(x)) for x in lines)])
        far = np.repeat(distances, len(_TURNS)) / _AS_FAR
        chosen = []
        for anchor, way, size in zip(anchors, ways, sizes, strict=True):
            places, half = _places(way, distances), 0.5 * size + 1.0
            low, high = anchor + places - half, anchor + places + half
            covers = (low[:, None] < self._taken[:, 1]) & (self._taken[:, 0] < high[:, None])
            is_on = (low[:, None] < points) & (points < high[:, None])
            is_cut, is_out = (((low < x[0]) | (x[1] < high)).any(axis=1) for x in (page, room))
            covered = is_on.all(axis=2).sum(axis=1)
            costs = covered + far, is_out, covers.all(axis=2).sum(axis=1), is_cut
            best = np.lexsort(costs)[0]  # the first of the best ones
            self._taken = np.concatenate([self._taken, [[low[best], high[best]]]])
            chosen.append(places[best])
        return chosen

    def _plot(self, points: Array, color: Color, **style: Any) -> Line2D:
        style |= {'color': fractions(color), 'solid_capstyle': 'round'}
        return self._axes.plot(*points.T, **style)[0]


def _places(way: Array, distances: Sequence[float]) -> Array:
    """Returns positions of a name relative to its pin, points, in the order of preference.

    Args:
        way: Preferred direction of the name, shape (2,).
        distances: Distances from the pin, points.
    """
    turned = np.exp(1j * np.radians(_TURNS)) * complex(*way)
    directions = turned / math.hypot(*way)
    places = np.outer(distances, directions).ravel()  # the nearest ones first
    return np.stack([places.real, places.imag], axis=1)


def _dense(line: Array) -> Array:
    """Returns points along a line, close to each other; all in points."""
    steps = np.linalg.norm(np.diff(line, axis=0), axis=1)
    return np.concatenate([
        start + np.linspace(0, 1, max(2, math.ceil(step / _STEP)))[:, np.newaxis] * (end - start)
        for start, end, step in zip(line[:-1], line[1:], steps, strict=True)
    ])  # fmt: skip
