# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How the live view looks: what it shows where, and all that never changes during a run.

The only file beside `stream` that knows Rerun.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from linkage_ros.core.curves import extent
from linkage_ros.core.kinematics import structure_of
from linkage_ros.core.mechanism import Mechanism, WindPump
from linkage_ros.core.numeric import Array
from linkage_ros.core.solver import Solver
from linkage_ros.core.structure import Structure
from linkage_ros.palette import COLORS, GREY, Color
from linkage_ros.run.configuration import Configuration
from linkage_ros.run.drives import TorqueDrive
from linkage_ros.view.axes import MARKS
from linkage_ros.view.drawing import Drawing
from linkage_ros.view.scene import PHASE_PLANE, QUANTITIES
from linkage_ros.view.series import ENERGIES

if TYPE_CHECKING:
    import rerun as rr
    import rerun.blueprint as rrb

# The names that Rerun's MCAP importer gives a topic joint_states: the same plots fit the live
# view, a replay and a log that is opened directly.
TIMELINE = 'ros2_timestamp'

_PLOTTED_TURNS = 4
_STANDING_SECONDS = 10.0  # plotted where the crank stands still,
_DRIVEN_SECONDS = 5.0  # and under a torque: of a longer time axis Rerun leaves out the numbers
_TRAIL_SECONDS = 10.0  # in the phase plane
_FRONT = 32.0  # drawing order of the pins, above all lines
_THIN, _THICK, _PIN = -1.0, -3.5, -5.0  # radii; negative: points on the screen
# Those of the palette of Okabe and Ito that no link has.
_ENERGY_COLORS: tuple[Color, ...] = ((230, 159, 0), (86, 180, 233), GREY)
_GRID: Color = (70, 70, 70)
_ASPECT = 1.6  # width of the phase plane over its height


def fixed_components(configuration: Configuration, drawing: Drawing) -> dict[str, rr.AsComponents]:
    """What is sent once: colours, names, the paths and the ground.

    Args:
        configuration: Of the run.
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
    if isinstance(configuration.drive, TorqueDrive):
        fixed['energies'] = rr.SeriesLines(names=list(ENERGIES))
    if isinstance(configuration.mechanism, WindPump):
        fixed['flow'] = rr.SeriesLines(names='flow')
        fixed.update(_phase_plane())
    return fixed


def _phase_plane() -> dict[str, rr.AsComponents]:
    """The frame of the phase plane, 1 high, and the place of its marks."""
    import rerun as rr

    marks = np.linspace(0.0, 1.0, MARKS)
    across, up = ([[[x, 0], [x, 1]] for x in marks], [[[0, y], [1, y]] for y in marks])
    names = [(0.5, -0.1), (0.0, 1.13)]
    color = COLORS['slider']
    return {
        PHASE_PLANE: rr.Transform3D(scale=[_ASPECT, -1, 1]),
        f'{PHASE_PLANE}/grid': rr.LineStrips2D(across + up, colors=_GRID, radii=_THIN / 2),
        f'{PHASE_PLANE}/x': _texts([(x, -0.02) for x in marks]),
        f'{PHASE_PLANE}/y': _texts([(-0.06, y + 0.04) for y in marks]),
        f'{PHASE_PLANE}/names': _texts(names, 'position, m', 'velocity, m/s'),
        f'{PHASE_PLANE}/curve/trail': rr.LineStrips2D.from_fields(colors=color, radii=_THIN),
        f'{PHASE_PLANE}/curve/now': rr.Points2D.from_fields(
            colors=color, radii=_PIN, draw_order=_FRONT
        ),
    }


def _texts(places: Sequence[tuple[float, float]], *texts: str) -> rr.Points2D:
    """Texts in a diagram; without any, they come later."""
    import rerun as rr

    labels = texts or None
    return rr.Points2D(places, radii=0.0, colors=GREY, labels=labels, show_labels=True)


def layout(configuration: Configuration, bounds: Array) -> rrb.Blueprint:
    """The linkage beside plots of its angles, rates and torque.

    Where a torque drives it, what it does is not known before: the speed is plotted first, and
    the energies as well. A wind pump adds its phase plane and its flow.

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
    mechanism, drive = configuration.mechanism, configuration.drive
    pictures: rrb.View | rrb.Container = linkage
    if isinstance(mechanism, WindPump):
        pictures = rrb.Vertical(linkage, _phase_view(), row_shares=[2, 3])
    if isinstance(mechanism, WindPump) or isinstance(drive, TorqueDrive):
        curves, shares = _curves_of_torque(mechanism), [2, 3]
    else:
        curves, shares = _curves_of_speed(Solver(mechanism), drive.rpm), None
    return rrb.Blueprint(
        rrb.Horizontal(pictures, curves, column_shares=shares),
        rrb.TimePanel(timeline=TIMELINE, state='collapsed'),
        rrb.SelectionPanel(state='collapsed'),
        rrb.BlueprintPanel(state='collapsed'),
    )


def _curves_of_speed(solver: Solver, rpm: float) -> rrb.Container:
    """Angles, rates, and the torque that the speed takes."""
    import rerun.blueprint as rrb

    # A few turns, but no less than eyes can follow and no more than anyone waits for.
    seconds = min(max(2.0, _PLOTTED_TURNS * 60 / abs(rpm)), 60.0) if rpm else _STANDING_SECONDS
    joints = _JointPlots(solver.structure, seconds)
    # Passive joints have none. In a small window the axis may show no number but 0.
    turns = solver.kinematics.map.samples()
    torque = extent(turns, solver.state(turns, rpm * math.pi / 30).torque)
    title = f'Driving torque, N m ({torque.low:.3g} to {torque.high:.3g} at {rpm:g} rpm)'
    return rrb.Vertical(
        rrb.Tabs(*joints.angles()),
        rrb.Tabs(*joints.rates()),
        joints.plot(title, 'effort', ['crank']),
        row_shares=[1, 1, 2],
    )


def _curves_of_torque(mechanism: Mechanism) -> rrb.Container:
    """Speed first, because it is what the torque leads to; the energies as well."""
    import rerun.blueprint as rrb

    joints = _JointPlots(structure_of(mechanism), _DRIVEN_SECONDS)
    energies = dict(zip(ENERGIES, _ENERGY_COLORS, strict=True))
    speeds = [joints.plot('Crank speed, rad/s', 'velocity', ['crank']), *joints.rates()]
    causes = [joints.plot('Applied torque, N m', 'effort', ['crank'])]
    if isinstance(mechanism, WindPump):
        title = 'Flow (stroke x speed), m/s'
        causes.insert(0, _plot(title, 'flow', {'flow': COLORS['slider']}, _DRIVEN_SECONDS))
    title = 'Energies, J (potential: from the start)'
    # High plots: in low ones Rerun leaves out the numbers.
    return rrb.Grid(
        rrb.Tabs(*speeds),
        _plot(title, 'energies', energies, _DRIVEN_SECONDS),
        rrb.Tabs(*causes),
        rrb.Tabs(*joints.angles()),
        grid_columns=2,
    )


class _JointPlots:
    """Curves of the joints of one mechanism over the last seconds."""

    def __init__(self, structure: Structure, seconds: float) -> None:
        self._seconds = seconds
        self._colors = {joint.name: COLORS[joint.name] for joint in structure.joints}
        _, *others = structure.joints
        self._turning = [joint.name for joint in others if not joint.slides]
        self._sliding = [joint.name for joint in others if joint.slides]

    def plot(self, title: str, quantity: str, joints: Sequence[str]) -> rrb.TimeSeriesView:
        """One quantity of some joints."""
        return _plot(title, f'joint_states/{quantity}', self._colors, self._seconds, joints)

    def angles(self) -> list[rrb.TimeSeriesView]:
        """Where the joints are."""
        # The crank's angle is unwrapped: beside it the others would soon be straight lines.
        plots = [
            self.plot('Joint angles, rad', 'position', self._turning),
            self.plot('Crank angle, rad', 'position', ['crank']),
        ]
        if self._sliding:
            plots.insert(0, self.plot('Slider position, m', 'position', self._sliding))
        return plots

    def rates(self) -> list[rrb.TimeSeriesView]:
        """How fast they are."""
        plots = [self.plot('Joint rates, rad/s', 'velocity', ['crank', *self._turning])]
        if self._sliding:
            plots.insert(0, self.plot('Slider velocity, m/s', 'velocity', self._sliding))
        return plots


def _plot(
    title: str,
    entity: str,
    colors: Mapping[str, Color],
    seconds: float,
    shown: Sequence[str] | None = None,
) -> rrb.TimeSeriesView:
    """Curves of an entity over the last seconds: all, or those of some names."""
    import rerun as rr
    import rerun.blueprint as rrb

    names = list(colors)
    shown = names if shown is None else shown
    series = rr.SeriesLines(
        names=names,
        colors=list(colors.values()),
        widths=[2.0] * len(names),
        visible_series=[name in shown for name in names],
        aggregation_policy='MinMax',  # no peak is averaged away
    )
    return rrb.TimeSeriesView(
        name=title,
        origin=f'/{entity}',
        contents=f'/{entity}',
        overrides={f'/{entity}': series},
        axis_x=rrb.archetypes.TimeAxis(view_range=_last(seconds)),
        plot_legend=rrb.PlotLegend(corner='LeftTop', visible=len(shown) > 1),
    )


def _last(seconds: float) -> rr.TimeRange:
    import rerun as rr

    return rr.TimeRange(
        start=rr.TimeRangeBoundary.cursor_relative(seconds=-seconds),
        end=rr.TimeRangeBoundary.cursor_relative(),
    )


def _phase_view() -> rrb.Spatial2DView:
    """The slider's velocity over its position, with what came before."""
    import rerun.blueprint as rrb

    trail = rrb.VisibleTimeRanges(timeline=TIMELINE, range=_last(_TRAIL_SECONDS))
    return rrb.Spatial2DView(
        name='Phase plane of the slider: velocity, m/s, over position, m',
        contents=f'/{PHASE_PLANE}/**',
        overrides={f'/{PHASE_PLANE}/curve/trail': trail},
        visual_bounds=rrb.VisualBounds2D(x_range=(-0.2, _ASPECT + 0.1), y_range=(-1.15, 0.22)),
    )
