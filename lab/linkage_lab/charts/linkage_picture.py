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
from matplotlib.transforms import Bbox

from linkage_lab.output import SMALL, dash
from linkage_ros.formulas import Array
from linkage_ros.internals import Drawing
from linkage_ros.palette import DARK, GREY, Color, dashes_of, fractions

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
        moving: What `move` changes, from below to above.
        taken: Boxes of the names of pins, of the pins and of the scale, points.
    """

    def __init__(self, axes: Axes, drawing: Drawing, positions: Array, shown: Array) -> None:
        """Draws the mechanism at the first position, with room for all positions.

        Args:
            axes: Axes to draw in, which may have other lines.
            drawing: The drawing.
            positions: Positions of the links along the paths, rad and m, shape (n, links).
            shown: Those to be shown, of the same kind.
        """
        self._axes, self._drawing = axes, drawing
        tracks = drawing.place(positions)
        for line in drawing.ground:
            self._plot(line, GREY, linewidth=0.9)
        for pin, owner in drawing.owners.items():
            path = tracks[:, drawing.pins.index(pin)]
            width = 1.3 if pin in drawing.traced else 0.8
            self._plot(path, drawing.colors[owner], linewidth=width)
        first, shown = shown[0], drawing.place(shown)
        styles = [dash(number) for number in dashes_of(drawing.colors.values())]
        style_of = dict(zip(drawing.joints, styles, strict=True))
        self._links = {
            link: self._plot(
                lines.reshape(-1, 2), drawing.colors[link], linewidth=2.6, linestyle=style_of[link]
            )
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
        axes.margins(0.08)
        axes.set_axis_off()
        axes.apply_aspect()
        self.moving = [*self._links.values(), self._pins, *self._names]
        self._points_per_pixel = 72 / axes.figure.dpi  # per pixel
        corners = [text.get_window_extent().get_points() for text in (unit, *self._names)]
        self._unit, *self._sizes = (Bbox(self._points_per_pixel * corner) for corner in corners)
        self.taken: list[Bbox] = []
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
        self.taken = [self._unit, *(Bbox([pin - _PIN, pin + _PIN]) for pin in at)]
        places = free_places(at, ways, self._sizes, self.taken, self.page)
        for name, pin, place in zip(self._names, pins, places, strict=True):
            name.xy = tuple(pin)
            name.set_position(tuple(place.tolist()))

    def to_points(self, places: Array) -> Array:
        """Converts places, m, shape (n, 2), to points of the page."""
        return np.asarray(self._points_per_pixel * self._axes.transData.transform(places))

    @property
    def page(self) -> Bbox:
        """The page, points."""
        return Bbox(self._points_per_pixel * self._axes.figure.bbox.get_points())

    def _plot(self, points: Array, color: Color, **style: Any) -> Line2D:
        style |= {'color': fractions(color), 'solid_capstyle': 'round'}
        return self._axes.plot(*points.T, **style)[0]


def free_places(
    anchors: Array,
    ways: Array,
    sizes: Sequence[Bbox],
    taken: list[Bbox],
    page: Bbox,
    obstacles: Array | None = None,
    distances: Sequence[float] = _DISTANCES,
) -> list[Array]:
    """Finds places for names, so that they overlap no other name; all in points.

    Args:
        anchors: Positions of what the names belong to, shape (n, 2).
        ways: Preferred direction of each name from there, of the same shape.
        sizes: Sizes of the names.
        taken: Boxes that names must not overlap, to which their own are added.
        page: The page, beyond which names must not go.
        obstacles: Points of lines that names should not cover, shape (k, 2).
        distances: Distances of a name that are tried in turn.

    Returns:
        Positions of the names relative to the anchors.
    """
    chosen = []
    for anchor, way, size in zip(anchors, ways, sizes, strict=True):
        half = 0.5 * np.array([size.width, size.height]) + 1.0
        places = _places(way, distances)
        boxes = [Bbox([anchor + place - half, anchor + place + half]) for place in places]
        costs = [_cost(box, page, taken, obstacles) for box in boxes]
        best = costs.index(min(costs))  # the first of the best ones
        taken.append(boxes[best])
        chosen.append(places[best])
    return chosen


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


def _cost(
    box: Bbox, page: Bbox, taken: Sequence[Bbox], obstacles: Array | None
) -> tuple[bool, int, int]:
    """Returns whether the page cuts a name off, and how many names, pins and lines it covers."""
    is_whole = page.contains(*box.min) and page.contains(*box.max)
    covered = 0
    if obstacles is not None:
        covered = int(((obstacles > box.min) & (obstacles < box.max)).all(axis=1).sum())
    return not is_whole, box.count_overlaps(taken), covered
