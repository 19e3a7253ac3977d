# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A mechanism in one position and the paths of its pins, as a part of a picture."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patheffects import withStroke

from linkage_ros.dynamics.period import Period
from linkage_ros.lab.charts.sizes import SMALL
from linkage_ros.palette import DARK, GREY, color_of, fractions
from linkage_ros.view.drawing import Drawing

# Around the names of pins, which may lie on paths.
_HALO = withStroke(linewidth=2.5, foreground='white')
_AWAY = 16.0  # points, of a name from its pin


def draw_linkage(axes: Axes, period: Period, crank: float) -> None:
    """Draws the mechanism with its pins, what they trace out over the period, and a scale.

    Args:
        axes: Axes to draw in.
        period: Period to draw.
        crank: The crank angle at which it is drawn, rad.
    """
    drawing = Drawing(period.solver.mechanism)
    columns = [period.columns[f'{joint}.position'].values for joint in drawing.joints]
    tracks = drawing.place(np.stack(columns, axis=-1))
    now = tracks[np.abs(period.crank - crank).argmin()][np.newaxis]
    for line in drawing.ground:
        axes.plot(*line.T, color=fractions(GREY), linewidth=0.9)
    for pin, owner in drawing.owners.items():
        track = tracks[:, drawing.pins.index(pin)]
        axes.plot(*track.T, color=fractions(color_of(owner)), linewidth=0.8)
    for link, (line,) in drawing.links(now).items():
        axes.plot(*line.T, color=fractions(color_of(link)), linewidth=2.6, solid_capstyle='round')
    pins = np.array([*drawing.pivots, *now[0]])
    axes.plot(*pins.T, 'o', color=fractions(DARK), markersize=3.5)
    labels = np.array([*drawing.pivot_labels, *drawing.labels(now)[0]])
    for name, pin, label in zip((*drawing.pivot_names, *drawing.pins), pins, labels, strict=True):
        way = label - pin
        if name in drawing.pivot_names:  # beside the ground, which is below
            way = np.array((pin[0] - pins[:, 0].mean(), 0.0))
        axes.annotate(
            name, tuple(pin), xytext=tuple(_AWAY * way / np.linalg.norm(way)),
            textcoords='offset points', fontsize=SMALL, ha='center', va='center',
            annotation_clip=False, path_effects=[_HALO],
        )  # fmt: skip
    # Below what is shown, which is not all that the scale of a moving picture is below.
    low, high = axes.dataLim.get_points()
    scale = drawing.scale - drawing.scale.min(axis=0) + low - (0.0, 0.06 * (high - low).max())
    axes.plot(*scale.T, color=fractions(GREY), linewidth=0.9)
    axes.annotate(
        f'{drawing.scale_length:g} m', tuple(scale[2]), xytext=(5, 0),
        textcoords='offset points', fontsize=SMALL, va='center', annotation_clip=False,
    )  # fmt: skip
    axes.set_aspect('equal')
    axes.margins(0.08)
    axes.set_axis_off()
