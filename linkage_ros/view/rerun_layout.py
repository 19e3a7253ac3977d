# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The fixed parts of a view in Rerun: layout and constant components."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from linkage_ros.motion.drives import SpeedDrive, TorqueDrive
from linkage_ros.numeric import Array
from linkage_ros.palette import GREY, SECOND, Color, color_of
from linkage_ros.parameters.configuration import Configuration
from linkage_ros.view.drawing import Drawing
from linkage_ros.view.scene import (
    DIRECTIONS,
    JOINT_FIELDS,
    JOINT_STATES,
    LINKAGE,
    LOADS,
    RATES,
    TIMELINE,
)

_TURNS, _LONGEST = 5, 60.0  # plotted at a speed: turns, but no more seconds than these
_STANDING_SECONDS, _DRIVEN_SECONDS = 10.0, 5.0  # plotted at standstill, and under a torque
_FRONT = 32.0  # drawing order of the pins, above all lines
_THIN, _MEDIUM, _THICK, _PIN = -1.0, -2.0, -3.5, -5.0  # radii; negative: points on the screen


def layout(configuration: Configuration, drawing: Drawing) -> rrb.Blueprint:
    """The linkage beside two columns of plots; each shows one plot, with tabs for the others.

    The plots have the height of the window: on low plots Rerun labels the y axis once.

    Args:
        configuration: Configuration of the run.
        drawing: The picture of its mechanism.

    Returns:
        The blueprint.
    """
    (left, low), (right, high) = drawing.bounds.tolist()
    linkage = rrb.Spatial2DView(
        name='Linkage, m',
        contents=f'/{LINKAGE}/**',
        visual_bounds=rrb.VisualBounds2D(x_range=(left, right), y_range=(-high, -low)),
    )
    first, second = _plots(configuration, drawing)
    return rrb.Blueprint(
        rrb.Horizontal(linkage, rrb.Tabs(*first), rrb.Tabs(*second)),
        rrb.TimePanel(timeline=TIMELINE, state='collapsed'),
        rrb.SelectionPanel(state='collapsed'),
        rrb.BlueprintPanel(state='collapsed'),
    )


def _plots(
    configuration: Configuration, drawing: Drawing
) -> tuple[list[rrb.TimeSeriesView], list[rrb.TimeSeriesView]]:
    """Two columns: torque and rates, and the speed if torque-driven; positions."""
    drive, joints = configuration.drive, {name: color_of(name) for name in drawing.joints}
    turning = {name: joints[name] for name in drawing.turning}
    seconds = _plotted_seconds(drive.rpm) if isinstance(drive, SpeedDrive) else _DRIVEN_SECONDS

    def plot(title: str, entity: str, colors: Mapping[str, Color]) -> rrb.TimeSeriesView:
        return _plot(title, entity, colors, seconds)

    def of_joint(title: str, field: str, joint: str) -> rrb.TimeSeriesView:
        return _plot(title, f'{JOINT_STATES}/{field}', joints, seconds, shown=[joint])

    first = [of_joint('Torque, N m', 'effort', 'crank'), plot('Rates, rad/s', RATES, turning)]
    angles = {name: color for name, color in turning.items() if name != 'crank'}
    second = [plot('Angles, rad', DIRECTIONS, angles)]
    if isinstance(drive, TorqueDrive):
        first.insert(0, of_joint('Crank speed, rad/s', 'velocity', 'crank'))
    if drawing.output not in turning:
        second.insert(0, of_joint('Slider, m/s', 'velocity', drawing.output))
        second.insert(0, of_joint('Slider, m', 'position', drawing.output))
    return first, second


def _plotted_seconds(rpm: float) -> float:
    """Duration of the plotted past at a speed, s."""
    return min(_TURNS * 60 / abs(rpm), _LONGEST) if rpm else _STANDING_SECONDS


def _plot(
    title: str,
    entity: str,
    colors: Mapping[str, Color],
    seconds: float,
    shown: Collection[str] | None = None,
) -> rrb.TimeSeriesView:
    """Curves of an entity over the last seconds: all, or selected names."""
    shown = colors if shown is None else shown
    series = rr.SeriesLines(
        names=list(colors),
        colors=list(colors.values()),
        widths=[2.0] * len(colors),
        visible_series=[name in shown for name in colors],
        aggregation_policy='MinMax',  # no peak is averaged away
    )
    last = rr.TimeRange(
        start=rr.TimeRangeBoundary.cursor_relative(seconds=-seconds),
        end=rr.TimeRangeBoundary.cursor_relative(),
    )
    return rrb.TimeSeriesView(
        name=title,
        origin=f'/{entity}',
        contents=f'/{entity}',
        overrides={f'/{entity}': series},
        # Without a range of its own, the time axis holds just the data: no half of it is empty.
        time_ranges=rrb.VisibleTimeRanges(timeline=TIMELINE, range=last),
        plot_legend=rrb.PlotLegend(corner='LeftTop', visible=len(shown) > 1),
    )


def fixed_components(drawing: Drawing) -> dict[str, rr.AsComponents]:
    """Components that are sent once: colours, names, paths, the ground.

    Args:
        drawing: The picture.

    Returns:
        Components by entity.
    """
    line, point = rr.LineStrips2D, rr.Points2D
    thin: dict[str, Any] = {'colors': GREY, 'radii': _THIN}
    pin: dict[str, Any] = {'colors': GREY, 'radii': _PIN, 'draw_order': _FRONT}
    middle, length = drawing.scale.mean(axis=0, keepdims=True), f'{drawing.scale_length:g} m'
    fixed: dict[str, rr.AsComponents] = {
        LINKAGE: rr.Transform3D(scale=[1, -1, 1]),  # y is down in Rerun's 2-D views
        f'{LINKAGE}/ground': line(drawing.ground, **thin),
        f'{LINKAGE}/pivots': point(drawing.pivots, **pin),
        f'{LINKAGE}/pivots/names': _texts(drawing.pivot_labels, drawing.pivot_names),
        f'{LINKAGE}/pins': point.from_fields(**pin),
        f'{LINKAGE}/pins/names': _texts(None, drawing.pins),
        f'{LINKAGE}/scale': line([drawing.scale], **thin),
        f'{LINKAGE}/scale/length': _texts(middle, [length]),
        RATES: rr.SeriesLines(names=list(drawing.turning)),
        DIRECTIONS: rr.SeriesLines(names=list(drawing.turning[1:])),
    }
    for link, path in drawing.paths.items():
        fixed[f'{LINKAGE}/paths/{link}'] = line(
            path.astype(np.float32), colors=color_of(link), radii=_THIN
        )
    for joint in drawing.joints:
        # The crank above the others: a coupler's triangle would hide it.
        order = _FRONT - 1 if joint == 'crank' else _FRONT - 2
        fixed[f'{LINKAGE}/{joint}'] = line.from_fields(
            colors=color_of(joint), radii=_THICK, draw_order=order
        )
    for link in drawing.loaded:
        fixed[f'{LOADS}/{link}'] = line.from_fields(
            colors=SECOND, radii=_MEDIUM, draw_order=_FRONT - 1
        )
    for field in JOINT_FIELDS:
        fixed[f'{JOINT_STATES}/{field}'] = rr.SeriesLines(names=list(drawing.joints))
    return fixed


def _texts(places: Array | None, texts: Collection[str]) -> rr.Points2D:
    """Labels at positions; None: the positions follow later."""
    return rr.Points2D.from_fields(
        positions=places, radii=0.0, colors=GREY, labels=list(texts), show_labels=True
    )
