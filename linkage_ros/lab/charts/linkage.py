# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A mechanism in one position and the paths of its pins, as a part of a picture."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patheffects import withStroke

from linkage_ros.dynamics.period import Period
from linkage_ros.lab.charts.sizes import SMALL
from linkage_ros.numeric import Array
from linkage_ros.palette import DARK, GREY, color_of, fractions
from linkage_ros.view.drawing import Drawing

# Around the names of pins, which may lie on lines.
_HALO = withStroke(linewidth=2.5, foreground='white')
# Where a name may be, points from its pin: nearby, or beyond a slider's block; and how much room,
# points, it needs there.
_TURN = np.linspace(0, 2 * math.pi, 32, endpoint=False)
_AROUND = np.stack([np.cos(_TURN), np.sin(_TURN)], axis=-1)
_SHIFTS = np.concatenate([distance * _AROUND for distance in (12.0, 18.0, 24.0)])
_ROOM = 8.0
_MARGIN = 0.08  # around what is shown, of its size


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
    now = int(np.argmin(np.abs(period.crank - crank)))
    for line in drawing.ground:
        axes.plot(*line.T, color=fractions(GREY), linewidth=0.9)
    for pin, owner in drawing.owners.items():
        track = tracks[:, drawing.pins.index(pin)]
        axes.plot(*track.T, color=fractions(color_of(owner)), linewidth=0.8)
    for link, lines in drawing.links(tracks[now : now + 1]).items():
        axes.plot(
            *lines[0].T, color=fractions(color_of(link)), linewidth=2.6, solid_capstyle='round'
        )
    pins = np.array([*drawing.pivots, *tracks[now]])
    axes.plot(*pins.T, 'o', color=fractions(DARK), markersize=3.5)
    strips = [
        np.asarray(line.get_xydata(), float)
        for line in axes.lines
        if line.get_linestyle() != 'None'
    ]
    shown = np.concatenate(strips)
    _name_points(axes, (*drawing.pivot_names, *drawing.pins), pins, len(drawing.pivots), strips)
    # Below what is shown, which is not all that the scale of a moving picture is below.
    room = np.array([0.0, 0.06 * np.ptp(shown, axis=0).max()])
    scale = drawing.scale - drawing.scale.min(axis=0) + shown.min(axis=0) - room
    axes.plot(*scale.T, color=fractions(GREY), linewidth=0.9)
    axes.annotate(
        f'{drawing.scale_length:g} m', tuple(scale[2]), xytext=(5, 0),
        textcoords='offset points', fontsize=SMALL, va='center', annotation_clip=False,
    )  # fmt: skip
    axes.set_aspect('equal')
    axes.margins(_MARGIN)
    axes.set_axis_off()


def _name_points(
    axes: Axes, names: Sequence[str], places: Array, fixed: int, strips: Sequence[Array]
) -> None:
    """Writes names beside points: where no line is, or beside the ground."""
    starts = np.concatenate([strip[:-1] for strip in strips])
    ends = np.concatenate([strip[1:] for strip in strips])
    size = np.array([axes.bbox.width, axes.bbox.height]) * (72 / axes.figure.dpi)
    point = ((1 + 2 * _MARGIN) * np.ptp(np.concatenate(strips), axis=0) / size).max()  # m
    for number, (name, place) in enumerate(zip(names, places, strict=True)):
        if number < fixed:
            shift = math.copysign(16.0, place[0] - places[:, 0].mean()), 0.0
        else:
            room = _room(place + point * _SHIFTS, starts, ends) / point
            near = 0.05 * np.linalg.norm(_SHIFTS, axis=-1)
            shift = tuple(_SHIFTS[np.argmax(np.minimum(room, _ROOM) - near)])
        axes.annotate(
            name, tuple(place), xytext=shift, textcoords='offset points', fontsize=SMALL,
            ha='center', va='center', annotation_clip=False, path_effects=[_HALO],
        )  # fmt: skip


def _room(points: Array, starts: Array, ends: Array) -> Array:
    """How far each of some points is from the nearest of some stretches of lines."""
    along = ends - starts
    square = np.maximum(np.sum(along * along, axis=-1), np.finfo(float).tiny)
    offset = points[:, np.newaxis] - starts
    part = np.clip(np.sum(offset * along, axis=-1) / square, 0.0, 1.0)
    nearest: Array = np.linalg.norm(offset - part[..., np.newaxis] * along, axis=-1).min(axis=1)
    return nearest
