# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The drawing in Rerun: entities over time, constant parts, and layout.

Lines and points come from `picture`, arrows of loads from `load_arrows`; `rerun_connection` opens
the viewer and sends what is drawn here.

Each call of Rerun takes as much processor time as twenty states. Therefore all moving parts are
one entity, and the curves are updated less often. Curves of one entity need different names.
"""

import math
from collections.abc import Collection, Iterator, Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import rerun as rr
import rerun.blueprint as rrb

from linkage_ros.messages.topics import prefix_of
from linkage_ros.numeric import Array
from linkage_ros.palette import GREY, SECOND
from linkage_ros.settings.configuration import Linkage
from linkage_ros.view.picture import Picture, free_ends

TIMELINE = 'ros2_timestamp'  # Rerun's name for the stamps in an MCAP log
LINKAGE = 'linkage'
_MOVING, _FIXED = f'{LINKAGE}/moving', f'{LINKAGE}/fixed'
_LOADS = f'{LINKAGE}/loads'  # the values of the loads, at the free ends of their arrows
# Entities of curves. VALUES: the torque, and position and rate of a slider. RATES, DIRECTIONS:
# rates and directions of the links that turn, in base_link, because joint angles are relative to
# the parent link and jump at pi.
VALUES, RATES, DIRECTIONS = 'values', 'rates', 'directions'

_DRAWING_NS = 20_000_000  # 50 drawings a second of stamp time
_WIDE = 2.2  # a linkage with this ratio of width to height is drawn above the plots
_FRONT = 32.0  # drawing order of the pins, above all lines
_THIN, _MEDIUM, _THICK, _PIN = -1.0, -2.0, -3.5, -5.0  # radii; negative: points on the screen

# Rerun's components with the Arrow types that it requires.
_SCALARS, _POSITIONS, _LABELS, _STRIPS = (
    (column.component_descriptor(), column.as_arrow_array().type.value_type)
    for column in (
        *rr.Scalars.columns(scalars=[0.0]),
        *rr.Points2D.columns(positions=[[0.0, 0.0]], labels=['']),
        *rr.LineStrips2D.columns(strips=[np.zeros((2, 2))]),
    )
)


# Rows of an entity: its path; stamps, ns; and components with a row for each stamp.
Rows: TypeAlias = tuple[str, npt.NDArray[np.int64], list[rr.ComponentColumn]]


class RerunDrawing:
    """Converts samples of a linkage to rows for Rerun, in batches of any size.

    Attributes:
        drawing: Picture of the linkage.
    """

    def __init__(self, linkage: Linkage) -> None:
        mechanism, self._drive = linkage.mechanism, linkage.drive
        self._path, self._title = prefix_of(linkage.name), prefix_of(linkage.name, ': ')
        self.drawing = Picture(mechanism, self._drive.drawn_angle(mechanism))
        turning, joints = self.drawing.turning, self.drawing.joints
        sliders = [joint for joint in joints if joint not in turning]
        self._turning, self._sliders = ([*map(joints.index, row)] for row in (turning, sliders))
        # Links whose curves each entity holds.
        joint = mechanism.structure().driven_link
        self._curves = {
            VALUES: (joint.name, *sliders, *sliders), RATES: turning,
            DIRECTIONS: turning if joint.slides else turning[1:],
        }  # fmt: skip
        self._driven = joint
        self._directions = np.zeros((1, len(turning)))  # at the last sample, rad
        self._last_frame = -1

    def rows(
        self, stamps: npt.NDArray[np.int64], places: Array, rates: Array, torque: Array
    ) -> Iterator[Rows]:
        """Converts the next samples, one or more, to rows of the moving parts and of the curves.

        Args:
            stamps: Stamps of the samples, ns, shape (n,).
            places: Positions of the links, rad and m, shape (n, links).
            rates: Rates of the links, rad/s and m/s, shape (n, links).
            torque: Driving torque, N m, or force, N, shape (n, 1).
        """
        turning, sliders = self._turning, self._sliders
        places = self._continued(places)
        shown = [*map(self.drawing.joints.index, self._curves[DIRECTIONS])]
        curves = {
            VALUES: np.concatenate([torque, places[:, sliders], rates[:, sliders]], axis=1),
            RATES: rates[:, turning],
            DIRECTIONS: np.degrees(places[:, shown]),
        }
        for entity, numbers in curves.items():
            path = f'{self._path}{entity}'
            yield path, stamps, [_column(_SCALARS, pa.array(numbers.ravel()), numbers.shape)]
        frames = stamps // _DRAWING_NS
        is_new_frame = np.diff(frames, prepend=self._last_frame) != 0
        self._last_frame = frames[-1]
        if is_new_frame.any():
            yield from self._drawn(stamps[is_new_frame], places[is_new_frame], rates[is_new_frame])

    def _continued(self, places: Array) -> Array:
        """Removes jumps by whole turns from the directions, also from those of the last call."""
        places, turning = places.copy(), self._turning
        steps = np.diff(places[:, turning], axis=0, prepend=self._directions)
        turns = np.cumsum(np.round(steps / (2 * math.pi)), axis=0)
        places[:, turning] -= 2 * math.pi * turns
        self._directions = places[-1:, turning]
        return places

    def frame(
        self, stamps: npt.NDArray[np.int64], places: Array, rates: Array, _: Array
    ) -> Iterator[Rows]:
        """Converts samples to rows of the moving parts only; see `rows`."""
        yield from self._drawn(stamps, places, rates)

    def _drawn(self, stamps: npt.NDArray[np.int64], places: Array, rates: Array) -> Iterator[Rows]:
        """Draws labels and pins as points, links and loads as lines, and the loads' values."""
        drawing = self.drawing
        pins = drawing.place(places)
        points = np.concatenate([drawing.labels(pins), pins], axis=1)
        loads = drawing.loads(places, rates)
        lines = [*drawing.links(pins).values(), *loads.values()]
        moving = [
            _column(_POSITIONS, _pairs(points), points.shape),
            _column(_STRIPS, _strips(lines), (len(pins), len(lines))),
        ]
        yield f'{self._path}{_MOVING}', stamps, moving
        if loads:
            tips = np.stack([free_ends(line, pins) for line in loads.values()], axis=1)
            words = zip(*drawing.load_values(places, rates).values(), strict=True)
            texts = pa.array([text for row in words for text in row])
            values = [
                _column(_POSITIONS, _pairs(tips), tips.shape),
                _column(_LABELS, texts, tips.shape),
            ]
            yield f'{self._path}{_LOADS}', stamps, values

    def constants(self) -> dict[str, list[rr.AsComponents]]:
        """Returns the components that are sent once, by entity: colours, labels, paths, ground."""
        drawing = self.drawing
        grey_lines = [*drawing.ground, drawing.scale]
        path_colors = [drawing.colors[drawing.owners[point]] for point in drawing.paths]
        scale_label = drawing.scale.mean(axis=0)
        links = len(drawing.joints)
        found: dict[str, list[rr.AsComponents]] = {
            LINKAGE: [rr.Transform3D(scale=[1, -1, 1])],  # y is down in Rerun's 2-D views
            _FIXED: [
                rr.LineStrips2D(
                    [x.astype(np.float32) for x in (*grey_lines, *drawing.paths.values())],
                    radii=_THIN, colors=[GREY] * len(grey_lines) + path_colors,
                ),
                _points([*drawing.pivot_labels, scale_label, *drawing.pivots],
                        [*drawing.pivot_names, drawing.scale_label],
                        pins=len(drawing.pivots)),
            ],
            _LOADS: [rr.Points2D.from_fields(colors=SECOND, radii=0.0, show_labels=True)],
            _MOVING: [
                rr.LineStrips2D.from_fields(
                    colors=[*drawing.colors.values(), *(SECOND for _ in drawing.loaded)],
                    radii=[_THICK] * links + [_MEDIUM] * len(drawing.loaded),
                    draw_order=_FRONT - 1,
                ),
                _points(None, drawing.pins, pins=len(drawing.pins)),
            ],
        }  # fmt: skip
        return {f'{self._path}{entity}': components for entity, components in found.items()}

    def layout(self, *, is_alone: bool) -> rrb.Container:
        """Lays out the linkage and two columns of tabbed plots.

        The plots are as high as the window, because on a low plot Rerun shows only one label on
        the y axis; only a wide linkage is above them.

        Args:
            is_alone: Whether no other linkage is beside it; otherwise the plots are one column.

        Returns:
            The container.
        """
        (left, low), (right, high) = self.drawing.bounds.tolist()
        linkage = rrb.Spatial2DView(
            name=f'{self._title}Linkage, m',
            contents=f'/{self._path}{LINKAGE}/**',
            visual_bounds=rrb.VisualBounds2D(x_range=(left, right), y_range=(-high, -low)),
        )
        drive = 'Force, N' if self._driven.slides else 'Torque, N m'
        left_plots = [self._plot(drive, VALUES, 0), self._plot('Rates, rad/s', RATES)]
        if self._drive.is_integrated and not self._driven.slides:
            left_plots.insert(0, self._plot('Crank speed, rad/s', RATES, 0))
        sliders = [self.drawing.joints[j].replace('_', ' ').capitalize() for j in self._sliders]
        titles = [f'{name}, {unit}' for unit in ('m', 'm/s') for name in sliders]
        right_plots = [
            *(self._plot(title, VALUES, number) for number, title in enumerate(titles, 1)),
            self._plot('Angles, deg', DIRECTIONS),
        ]
        if not is_alone:
            return rrb.Vertical(linkage, rrb.Tabs(*left_plots, *right_plots))
        parts = linkage, rrb.Horizontal(rrb.Tabs(*left_plots), rrb.Tabs(*right_plots))
        is_wide = right - left > _WIDE * (high - low)
        return rrb.Vertical(*parts) if is_wide else rrb.Horizontal(*parts, column_shares=[1, 2])

    def _plot(self, title: str, entity: str, shown: int | None = None) -> rrb.TimeSeriesView:
        """Plots all curves of an entity over the last seconds, or only curve number `shown`."""
        names = self._curves[entity]
        series = rr.SeriesLines(
            names=names,
            colors=[self.drawing.colors[name] for name in names],
            widths=[2.0] * len(names),
            visible_series=[shown in (None, number) for number in range(len(names))],
            aggregation_policy='MinMax',  # no averaging, to keep the peaks
        )
        last = rr.TimeRange(
            start=rr.TimeRangeBoundary.cursor_relative(seconds=-self._drive.plotted_seconds),
            end=rr.TimeRangeBoundary.cursor_relative(),
        )
        path = f'/{self._path}{entity}'
        return rrb.TimeSeriesView(
            name=f'{self._title}{title}',
            origin=path,
            contents=path,
            overrides={path: series},
            # Without a range of its own, the axis follows the data another frame later.
            axis_x=rrb.archetypes.TimeAxis(view_range=last),
            plot_legend=rrb.PlotLegend(corner='LeftTop', visible=shown is None),
        )


def _strips(lines: Sequence[Array]) -> pa.Array:
    """Returns the lines of n drawings, each of shape (n, k, 2), as strips for Rerun."""
    corners = np.concatenate(lines, axis=1)
    lengths = np.tile([line.shape[1] for line in lines], len(corners))
    ends = np.concatenate([[0], np.cumsum(lengths)]).astype(np.int32)
    return pa.ListArray.from_arrays(ends, _pairs(corners), type=_STRIPS[1])


def blueprint(drawings: Collection[RerunDrawing]) -> rrb.Blueprint:
    """Lays out the linkages of a run side by side, each in its own axes."""
    is_alone = len(drawings) == 1
    cells = [drawing.layout(is_alone=is_alone) for drawing in drawings]
    return rrb.Blueprint(
        cells[0] if is_alone else rrb.Grid(*cells),
        rrb.TimePanel(timeline=TIMELINE, state='collapsed'),
        rrb.SelectionPanel(state='collapsed'),
        rrb.BlueprintPanel(state='collapsed'),
    )


def _points(places: list[Array] | None, names: Collection[str], *, pins: int) -> rr.Points2D:
    """Makes labels, as points of radius 0; then `pins` pins, as points without labels."""
    return rr.Points2D.from_fields(
        positions=places, colors=GREY, draw_order=_FRONT, labels=list(names), show_labels=True,
        radii=[0.0] * len(names) + [_PIN] * pins,
    )  # fmt: skip


class _Batch(NamedTuple):
    """A batch of components for Rerun; making Rerun's own archetypes takes three times as long."""

    array: pa.Array

    def as_arrow_array(self) -> pa.Array:
        """Returns the components; Rerun calls this method."""
        return self.array


def _column(
    kind: tuple[Any, pa.DataType], components: pa.Array, shape: tuple[int, ...]
) -> rr.ComponentColumn:
    """Makes a column for shape[0] stamps, with shape[1] components for each stamp."""
    offsets = shape[1] * np.arange(shape[0] + 1, dtype=np.int32)
    return rr.ComponentColumn(kind[0], _Batch(components), offsets=offsets)


def _pairs(points: Array) -> pa.Array:
    """Converts points, shape (..., 2), to Rerun's type."""
    numbers = pa.array(points.astype(np.float32).ravel())
    return pa.FixedSizeListArray.from_arrays(numbers, type=_POSITIONS[1])
