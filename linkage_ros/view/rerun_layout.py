# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the live view shows where: the linkage beside its curves."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING

from linkage_ros.dynamics.period import extent
from linkage_ros.dynamics.solver import Solver
from linkage_ros.motion.drives import SpeedDrive
from linkage_ros.numeric import Array
from linkage_ros.palette import COLORS, FIRST, GREY, SECOND, Color, color_of
from linkage_ros.parameters.configuration import Configuration
from linkage_ros.units import radians_per_second
from linkage_ros.view.axes import ASPECT
from linkage_ros.view.drawing import Drawing
from linkage_ros.view.scene import (
    DIRECTIONS,
    ENERGY,
    FLOW,
    JOINT_STATES,
    LINKAGE,
    PHASE_PLANE,
    RATES,
    TIMELINE,
    TURNING,
    angles_of,
)
from linkage_ros.view.series import ENERGIES

if TYPE_CHECKING:
    import rerun as rr
    import rerun.blueprint as rrb

# Turns plotted: no fewer than the first, no more than the second if that is enough for the eye.
_FEW_TURNS, _MANY_TURNS, _FOR_THE_EYE, _FOR_PATIENCE = 4, 10, 2.0, 60.0  # s the last two
_STANDING_SECONDS = 10.0  # plotted where the crank stands still,
_DRIVEN_SECONDS = 5.0  # and under a torque: of a longer time axis Rerun leaves out the numbers
_TRAIL_SECONDS = 10.0  # in the phase plane
_LEGEND = 0.2  # of the seconds plotted: room before them, where the legend hides no curve
_ENERGY_COLORS = FIRST, SECOND, GREY


def layout(configuration: Configuration, drawing: Drawing) -> rrb.Blueprint:
    """The linkage beside plots of directions, rates and torque.

    Where a torque drives it, what it does is not known before: the speed is plotted first, and
    the energies as well. A wind pump adds its phase plane and its flow.

    Args:
        configuration: Of the run.
        drawing: The picture of its mechanism.

    Returns:
        The blueprint.
    """
    import rerun.blueprint as rrb

    (left, low), (right, high) = drawing.bounds.tolist()
    linkage = rrb.Spatial2DView(
        name='Linkage, m',
        contents=f'/{LINKAGE}/**',
        visual_bounds=rrb.VisualBounds2D(x_range=(left, right), y_range=(-high, -low)),
    )
    drive = configuration.drive
    pictures: rrb.View | rrb.Container = linkage
    if drawing.has_free_slider:
        pictures = rrb.Vertical(linkage, _phase_view(), row_shares=[2, 3])
    curves, shares = _curves_of_torque(drawing), [1, 2]  # two columns with room for tabs
    if isinstance(drive, SpeedDrive):
        solver = Solver(configuration.mechanism)
        curves, shares = _curves_of_speed(solver, drive.rpm, drawing), [1, 1]
    return rrb.Blueprint(
        rrb.Horizontal(pictures, curves, column_shares=shares),
        rrb.TimePanel(timeline=TIMELINE, state='collapsed'),
        rrb.SelectionPanel(state='collapsed'),
        rrb.BlueprintPanel(state='collapsed'),
    )


def _curves_of_speed(solver: Solver, rpm: float, drawing: Drawing) -> rrb.Container:
    """Directions, rates, and the torque that the speed takes."""
    import rerun.blueprint as rrb

    crank = solver.reach.samples()
    state = solver.state(crank, radians_per_second(rpm))

    def span(values: Array) -> str:
        # In a small window an axis may show no number but 0.
        found = extent(crank, values)
        return f' ({found.low:.3g} to {found.high:.3g}'

    sliding = f'{span(state.position[-1])})', f'{span(state.velocity[-1])} at {rpm:g} rpm)'
    joints = _JointPlots(drawing, _plotted_seconds(rpm), sliding)
    title = f'Driving torque, N m{span(state.torque)} at {rpm:g} rpm)'  # passive joints have none
    return rrb.Vertical(
        rrb.Tabs(*joints.places()),
        rrb.Tabs(*joints.rates()),
        joints.plot(title, 'effort', ['crank']),
        row_shares=[1, 1, 2],
    )


def _plotted_seconds(rpm: float) -> float:
    """How much of the past is plotted at a speed, s."""
    if not rpm:
        return _STANDING_SECONDS
    turn = 60 / abs(rpm)
    return min(max(min(_FOR_THE_EYE, _MANY_TURNS * turn), _FEW_TURNS * turn), _FOR_PATIENCE)


def _curves_of_torque(drawing: Drawing) -> rrb.Container:
    """Speed first, because it is what the torque leads to; the energies as well."""
    import rerun.blueprint as rrb

    joints = _JointPlots(drawing, _DRIVEN_SECONDS)
    energies = dict(zip(ENERGIES, _ENERGY_COLORS, strict=True))
    speeds = [joints.plot('Crank speed, rad/s', 'velocity', ['crank']), *joints.rates()]
    causes = [joints.plot('Torque, N m', 'effort', ['crank'])]
    if drawing.has_free_slider:
        title = 'Flow (stroke x speed), m/s'
        causes.insert(0, _plot(title, FLOW, {FLOW: COLORS['slider']}, _DRIVEN_SECONDS))
    title = 'Energies, J (potential: from the start)'
    # High plots: in low ones Rerun leaves out the numbers.
    return rrb.Grid(
        rrb.Tabs(*speeds),
        _plot(title, ENERGY, energies, _DRIVEN_SECONDS),
        rrb.Tabs(*causes),
        rrb.Tabs(*joints.places()),
        grid_columns=2,
    )


class _JointPlots:
    """Curves of joints and links of one mechanism over the last seconds."""

    def __init__(
        self, drawing: Drawing, seconds: float, sliding: tuple[str, str] = ('', '')
    ) -> None:
        """Takes what is told of a slider's position and velocity as well."""
        self._seconds = seconds
        self._of_position, self._of_velocity = sliding
        self._colors = {name: color_of(name) for name in drawing.joints}
        self._turning, self._angles = drawing.turning, angles_of(drawing)
        self._sliding = [name for name in drawing.joints if name not in drawing.turning]

    def plot(self, title: str, quantity: str, joints: Collection[str]) -> rrb.TimeSeriesView:
        """One quantity of some joints."""
        return _plot(title, f'{JOINT_STATES}/{quantity}', self._colors, self._seconds, joints)

    def places(self) -> list[rrb.TimeSeriesView]:
        """Where the links are: what goes round and round beside nothing that does not."""
        title = 'Turning, rad'
        plots = [
            self._of_links(title, TURNING, self._angles[TURNING])
            if TURNING in self._angles
            else self.plot(title, 'position', ['crank'])
        ]
        if DIRECTIONS in self._angles:
            title = 'Directions, rad'
            plots.insert(0, self._of_links(title, DIRECTIONS, self._angles[DIRECTIONS]))
        if self._sliding:
            title = f'Slider, m{self._of_position}'
            plots.insert(0, self.plot(title, 'position', self._sliding))
        return plots

    def rates(self) -> list[rrb.TimeSeriesView]:
        """How fast they are."""
        plots = [self._of_links('Rates, rad/s', RATES, self._turning)]
        if self._sliding:
            title = f'Slider, m/s{self._of_velocity}'
            plots.insert(0, self.plot(title, 'velocity', self._sliding))
        return plots

    def _of_links(self, title: str, entity: str, links: Sequence[str]) -> rrb.TimeSeriesView:
        """Angles or rates of links that turn."""
        return _plot(title, entity, {name: self._colors[name] for name in links}, self._seconds)


def _plot(
    title: str,
    entity: str,
    colors: Mapping[str, Color],
    seconds: float,
    shown: Collection[str] | None = None,
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
        axis_x=rrb.archetypes.TimeAxis(view_range=_last((1 + _LEGEND) * seconds)),
        time_ranges=rrb.VisibleTimeRanges(timeline=TIMELINE, range=_last(seconds)),
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
        visual_bounds=rrb.VisualBounds2D(x_range=(-0.26, ASPECT + 0.13), y_range=(-1.15, 0.26)),
    )
