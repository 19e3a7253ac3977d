# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How the live view looks: what it shows where, and all that never changes during a run.

The only file beside `stream` that knows Rerun.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from linkage_ros.core.curves import extent
from linkage_ros.core.numeric import Array
from linkage_ros.core.solver import Solver
from linkage_ros.palette import COLORS, GREY
from linkage_ros.run.configuration import Configuration
from linkage_ros.view.drawing import Drawing

if TYPE_CHECKING:
    import rerun as rr
    import rerun.blueprint as rrb

# The names that Rerun's MCAP importer gives a topic joint_states: the same plots fit the live
# view, a replay and a log that is opened directly.
TIMELINE = 'ros2_timestamp'
QUANTITIES = ('position', 'velocity', 'effort')

_PLOTTED_TURNS = 4
_FRONT = 32.0  # drawing order of the pins, above all lines
_THIN, _THICK, _PIN = -1.0, -3.5, -5.0  # radii; negative: points on the screen


def fixed_components(drawing: Drawing) -> dict[str, rr.AsComponents]:
    """What is sent once: colours, names, the paths and the ground.

    Args:
        drawing: The picture.

    Returns:
        Components by entity.
    """
    import rerun as rr

    lines = rr.LineStrips2D
    fixed: dict[str, rr.AsComponents] = {
        'linkage': rr.Transform3D(scale=[1, -1, 1]),  # y is down in Rerun's 2-D views
        'linkage/ground': lines(drawing.ground, colors=GREY, radii=_THIN),
        'linkage/pivots': rr.Points2D(drawing.pivots, colors=GREY, radii=_PIN, draw_order=_FRONT),
        'linkage/pins': rr.Points2D.from_fields(colors=GREY, radii=_PIN, draw_order=_FRONT),
    }
    for link, path in drawing.paths.items():
        strip = path.astype(np.float32)
        fixed[f'linkage/paths/{link}'] = lines(strip, colors=COLORS[link], radii=_THIN)
    for joint in drawing.joints:
        # The crank above the others: a coupler's triangle would hide it.
        order = _FRONT - 1 if joint == 'crank' else _FRONT - 2
        fixed[f'linkage/{joint}'] = lines.from_fields(
            colors=COLORS[joint], radii=_THICK, draw_order=order
        )
    for quantity in QUANTITIES:
        fixed[f'joint_states/{quantity}'] = rr.SeriesLines(names=list(drawing.joints))
    return fixed


def layout(configuration: Configuration, bounds: Array) -> rrb.Blueprint:
    """The linkage beside plots of its angles, rates and torque.

    Args:
        configuration: Of the run.
        bounds: Lower left and upper right corner of the picture, shape (2, 2), m.

    Returns:
        The blueprint.
    """
    import rerun.blueprint as rrb

    (left, low), (right, high) = bounds.tolist()
    linkage = rrb.Spatial2DView(
        name='Linkage, m',
        contents='/linkage/**',
        visual_bounds=rrb.VisualBounds2D(x_range=(left, right), y_range=(-high, -low)),
    )
    rpm = configuration.drive.rpm
    # A few turns, but no less than eyes can follow and no more than anyone waits for.
    seconds = min(max(2.0, _PLOTTED_TURNS * 60 / abs(rpm)), 60.0) if rpm else 10.0
    solver = Solver(configuration.mechanism)
    crank, *others = solver.structure.joints
    turning = [joint.name for joint in others if not joint.slides]
    sliding = [joint.name for joint in others if joint.slides]

    def plot(title: str, quantity: str, joints: Sequence[str]) -> rrb.TimeSeriesView:
        return _plot(title, quantity, solver.links, joints, seconds)

    # The crank's angle is unwrapped: beside it the other angles would soon be straight lines.
    angles = [
        plot('Joint angles, rad', 'position', turning),
        plot('Crank angle, rad', 'position', [crank.name]),
    ]
    rates = [plot('Joint rates, rad/s', 'velocity', [crank.name, *turning])]
    if sliding:
        angles.insert(0, plot('Slider position, m', 'position', sliding))
        rates.insert(0, plot('Slider velocity, m/s', 'velocity', sliding))
    # Passive joints have none. In a small window the axis may show no number but 0.
    turns = solver.kinematics.map.samples()
    torque = extent(turns, solver.state(turns, rpm * math.pi / 30).torque)
    title = f'Driving torque, N m ({torque.low:.3g} to {torque.high:.3g} at {rpm:g} rpm)'
    effort = plot(title, 'effort', [crank.name])
    curves = rrb.Vertical(rrb.Tabs(*angles), rrb.Tabs(*rates), effort, row_shares=[1, 1, 2])
    return rrb.Blueprint(
        rrb.Horizontal(linkage, curves),
        rrb.TimePanel(timeline=TIMELINE, state='collapsed'),
        rrb.SelectionPanel(state='collapsed'),
        rrb.BlueprintPanel(state='collapsed'),
    )


def _plot(
    title: str, quantity: str, joints: Sequence[str], shown: Sequence[str], seconds: float
) -> rrb.TimeSeriesView:
    """Curves of some of the joints over the last seconds."""
    import rerun as rr
    import rerun.blueprint as rrb

    entity = f'/joint_states/{quantity}'
    series = rr.SeriesLines(
        names=list(joints),
        colors=[COLORS[joint] for joint in joints],
        widths=[2.0] * len(joints),
        visible_series=[joint in shown for joint in joints],
        aggregation_policy='MinMax',  # no peak is averaged away
    )
    until_now = rr.TimeRange(
        start=rr.TimeRangeBoundary.cursor_relative(seconds=-seconds),
        end=rr.TimeRangeBoundary.cursor_relative(),
    )
    return rrb.TimeSeriesView(
        name=title,
        origin=entity,
        contents=entity,
        overrides={entity: series},
        axis_x=rrb.archetypes.TimeAxis(view_range=until_now),
        plot_legend=rrb.PlotLegend(corner='LeftTop', visible=len(shown) > 1),
    )
