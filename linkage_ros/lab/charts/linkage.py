# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Draws a mechanism and the paths of its pins in a chart or a movie."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke

from linkage_ros.lab.charts.sizes import SMALL
from linkage_ros.lab.period import Period
from linkage_ros.numeric import Array
from linkage_ros.palette import DARK, GREY, Color, color_of, fractions
from linkage_ros.view.drawing import Drawing

_AWAY = 16.0  # points, of a name from its pin
_NAME: dict[str, Any] = {
    'textcoords': 'offset points', 'fontsize': SMALL, 'va': 'center', 'annotation_clip': False,
}  # fmt: skip


class LinkagePicture:
    """A mechanism with its pins, their paths over a period, and a scale.

    Attributes:
        period: The period drawn.
    """

    def __init__(self, axes: Axes, period: Period, samples: Sequence[int]) -> None:
        """Draws the mechanism at the first sample, with room for all samples.

        Args:
            axes: Axes to draw in.
            period: Period to draw.
            samples: Indices of the crank angles to be shown.
        """
        self.period, self._axes = period, axes
        self._drawing = drawing = Drawing(period.solver.mechanism)
        columns = [period.columns[f'{joint}.position'].values for joint in drawing.joints]
        self._tracks = drawing.place(np.stack(columns, axis=-1))
        for line in drawing.ground:
            self._plot(line, GREY, linewidth=0.9)
        for pin, owner in drawing.owners.items():
            self._plot(self._tracks[:, drawing.pins.index(pin)], color_of(owner), linewidth=0.8)
        shown = self._tracks[list(samples)]
        self._links = {
            link: self._plot(lines.reshape(-1, 2), color_of(link), linewidth=2.6)
            for link, lines in drawing.links(shown).items()
        }
        pins = np.concatenate([drawing.pivots, shown.reshape(-1, 2)])
        self._pins = self._plot(pins, DARK, linestyle='', marker='o', markersize=3.5)
        # The names of pivots stand beside the ground, which is below.
        middle = pins[:, 0].mean()
        self._asides = [(pivot[0] - middle, 0.0) for pivot in drawing.pivots]
        self._draw_scale()
        halo = withStroke(linewidth=2.5, foreground='white')  # around names, which lie on paths
        self._names = [
            axes.annotate(name, (0, 0), xytext=(0, 0), ha='center', path_effects=[halo], **_NAME)
            for name in (*drawing.pivot_names, *drawing.pins)
        ]
        axes.set_aspect('equal')
        axes.margins(0.08)
        axes.set_axis_off()
        self.move(samples[0])

    def move(self, sample: int) -> None:
        """Shows the mechanism at a sample of the period."""
        drawing, now = self._drawing, self._tracks[sample : sample + 1]
        for link, (line,) in drawing.links(now).items():
            self._links[link].set_data(*line.T)
        pins = np.array([*drawing.pivots, *now[0]])
        self._pins.set_data(*pins.T)
        ways = np.array([*self._asides, *(drawing.labels(now)[0] - now[0])])
        for name, pin, way in zip(self._names, pins, ways, strict=True):
            name.xy = tuple(pin)
            name.set_position(_AWAY * way / np.linalg.norm(way))

    def _plot(self, points: Array, color: Color, **style: Any) -> Line2D:
        (line,) = self._axes.plot(
            *points.T, color=fractions(color), solid_capstyle='round', **style
        )
        return line

    def _draw_scale(self) -> None:
        """Draws the scale below the visible part of the motion."""
        drawing = self._drawing
        low, high = self._axes.dataLim.get_points()
        scale = drawing.scale - drawing.scale.min(axis=0) + low - (0.0, 0.06 * (high - low).max())
        self._plot(scale, GREY, linewidth=0.9)
        words = f'{drawing.scale_length:g} m'
        self._axes.annotate(words, tuple(scale[2]), xytext=(5, 0), **_NAME)
