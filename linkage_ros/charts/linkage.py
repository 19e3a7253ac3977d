# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A mechanism in one position and the paths of its pins, as a part of a picture."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patheffects import withStroke

from linkage_ros.charts.sizes import SMALL
from linkage_ros.dynamics.period import Period
from linkage_ros.numeric import Array
from linkage_ros.palette import COLORS, DARK, GREY, fractions
from linkage_ros.view.drawing import Drawing

# Around the names of pins, which may lie on lines.
_HALO = withStroke(linewidth=2.5, foreground='white')


def draw_linkage(axes: Axes, period: Period, crank: float) -> None:
    """Draws the mechanism with its pins, what they trace out over the period, and a scale.

    Args:
        axes: To draw in.
        period: To draw.
        crank: The crank angle at which it is drawn, rad.
    """
    drawing = Drawing(period.mechanism)
    columns = [period.columns[f'{joint}.position'].values for joint in drawing.joints]
    tracks = drawing.place(np.stack(columns, axis=-1))
    now = int(np.argmin(np.abs(period.crank - crank)))
    for line in drawing.ground:
        axes.plot(*line.T, color=fractions(GREY), linewidth=0.9)
    owners = {'B': drawing.joints[2], 'C': 'coupler', 'D': 'slider'}
    for pin, owner in owners.items():
        if pin in drawing.pins:
            track = tracks[:, drawing.pins.index(pin)]
            axes.plot(*track.T, color=fractions(COLORS[owner]), linewidth=0.8)
    for link, lines in drawing.links(tracks[now : now + 1]).items():
        axes.plot(
            *lines[0].T, color=fractions(COLORS[link]), linewidth=2.6, solid_capstyle='round'
        )
    pins = np.array([*drawing.pivots, *tracks[now]])
    axes.plot(*pins.T, 'o', color=fractions(DARK), markersize=3.5)
    _name_points(axes, (*drawing.pivot_names, *drawing.pins), pins, len(drawing.pivots))
    shown = np.concatenate([line.get_xydata() for line in axes.lines])
    # Below what is shown, which is not all that the scale of a moving picture is below.
    room = np.array([0.0, 0.06 * np.ptp(shown, axis=0).max()])
    scale = drawing.scale - drawing.scale.min(axis=0) + shown.min(axis=0) - room
    axes.plot(*scale.T, color=fractions(GREY), linewidth=0.9)
    axes.annotate(
        f'{drawing.scale_length:g} m', tuple(scale[2]), xytext=(5, 0),
        textcoords='offset points', fontsize=SMALL, va='center', annotation_clip=False,
    )  # fmt: skip
    axes.set_aspect('equal')
    axes.margins(0.08)
    axes.set_axis_off()


def _name_points(axes: Axes, names: Sequence[str], places: Array, fixed: int) -> None:
    """Writes names beside points: away from the middle of all, or beside the ground."""
    for number, (name, place) in enumerate(zip(names, places, strict=True)):
        away = place - places.mean(axis=0)
        if number < fixed:
            shift = math.copysign(16.0, away[0]), 0.0
        else:
            shift = tuple(11 * away / max(np.hypot(*away), 1e-300))
        axes.annotate(
            name, tuple(place), xytext=shift, textcoords='offset points', fontsize=SMALL,
            ha='center', va='center', annotation_clip=False, path_effects=[_HALO],
        )  # fmt: skip
