# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a run shows: rows of numbers over time for each entity, whatever shows them."""

from __future__ import annotations

from collections.abc import Iterator
from enum import Enum
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from linkage_ros.dynamics.solver import Solver
from linkage_ros.motion.drives import TorqueDrive
from linkage_ros.numeric import Array
from linkage_ros.parameters.configuration import Configuration
from linkage_ros.view.axes import Axis, GrowingAxes
from linkage_ros.view.drawing import Drawing
from linkage_ros.view.series import Directions, Energies, Flow

Stamps: TypeAlias = npt.NDArray[np.int64]

# The names that Rerun's MCAP importer gives stamps and the parts of a topic joint_states: the live
# view, a replay and a log that is opened directly have them in common.
TIMELINE = 'ros2_timestamp'
JOINT_FIELDS = ('position', 'velocity', 'effort')
# Of the links that turn, in base_link: where those point that swing, the angles of those that go
# round (the crank's is unwrapped), and how fast all turn. Those of joints, which a log has, count
# from the link before, and jump at pi.
DIRECTIONS, TURNING, RATES = 'directions', 'turning', 'rates'
ENERGY, FLOW = 'energies', 'flow'
JOINT_STATES, LINKAGE = 'joint_states', 'linkage'  # with entities below them
PHASE_PLANE = 'phase_plane'

_DRAWING_NS = 20_000_000  # 50 drawings a second of stamp time
_SHOWN = 1e30  # beyond which nothing has a place in a drawing


class Form(Enum):
    """What the numbers of an entity are."""

    SCALARS = 'one or more curves'
    POINTS = 'points'
    LINES = 'lines'
    SCALE = 'factors and then shifts of what lies below the entity, along x and y'
    LABELS = 'texts at points that stay'


class Rows(NamedTuple):
    """What an entity shows at some stamps.

    Attributes:
        entity: Its path.
        form: What the values are.
        stamps: ns.
        values: One row for each stamp.
    """

    entity: str
    form: Form
    stamps: Stamps
    values: npt.NDArray[Any]


def angles_of(drawing: Drawing) -> dict[str, list[str]]:
    """The links whose angles an entity shows, in their order.

    Links that swing, if any, are apart from those that go round. A crank that alone goes round
    needs no entity: its joint's position is the same curve.
    """
    swinging = [name for name in drawing.turning if name not in drawing.going_round]
    rest = [name for name in drawing.turning if name in drawing.going_round]
    found = {DIRECTIONS: swinging, TURNING: rest if len(rest) > 1 else []}
    return {entity: names for entity, names in found.items() if names}


class Scene:
    """Makes rows of samples, however these are cut into batches.

    Attributes:
        drawing: The linkage.
    """

    def __init__(self, configuration: Configuration) -> None:
        mechanism, drive = configuration.mechanism, configuration.drive
        self.drawing = Drawing(mechanism, drive.crank_angle)
        self._directions = Directions()
        turning = self.drawing.turning
        self._angles = {
            entity: [turning.index(name) for name in names]
            for entity, names in angles_of(self.drawing).items()
        }
        self._last_frame = -1
        self._energies: Energies | None = None
        self._flow: Flow | None = None
        self._axes: GrowingAxes | None = None
        self._last_point: Array | None = None
        if isinstance(drive, TorqueDrive):
            self._energies = Energies(Solver(mechanism), drive)
        if self.drawing.has_free_slider:
            # Room at least for what the crank pin does at 1 rad/s.
            ((place,), _), room = mechanism.start(), mechanism.crank.length
            middle = np.array([place, 0.0])
            self._flow, self._axes = Flow(), GrowingAxes(middle - room, middle + room)

    def advance(
        self, stamps: Stamps, position: Array, velocity: Array, effort: Array
    ) -> Iterator[Rows]:
        """What to show at the next samples.

        Args:
            stamps: ns, shape (n,), n > 0.
            position: Of the joints, in the order of the tree; shape (n, joints), rad and m.
            velocity: Likewise, rad/s and m/s.
            effort: Likewise, N m.

        Yields:
            Rows of all entities that have any.
        """
        for field, row in zip(JOINT_FIELDS, (position, velocity, effort), strict=True):
            yield Rows(f'{JOINT_STATES}/{field}', Form.SCALARS, stamps, row)
        links = self.drawing.of_links(position)
        count = len(self.drawing.turning)
        others = self._directions.follow(links[:, 1:count])
        angles = np.hstack([links[:, :1], others])
        for entity, columns in self._angles.items():
            yield Rows(entity, Form.SCALARS, stamps, angles[:, columns])
        rates = self.drawing.of_links(velocity)[:, :count]
        yield Rows(RATES, Form.SCALARS, stamps, rates)
        if self._energies:
            yield Rows(ENERGY, Form.SCALARS, stamps, self._energies.at(position, velocity))
        if self._flow:
            flow = self._flow.follow(position[:, 0], velocity[:, 0], position[:, -1])
            yield Rows(FLOW, Form.SCALARS, stamps, flow[:, np.newaxis])
        frames = stamps // _DRAWING_NS
        due = np.diff(frames, prepend=self._last_frame) != 0
        self._last_frame = frames[-1]
        if due.any():
            yield from self._draw(stamps[due], links[due])
            if self._axes:
                slider = np.stack([position[due, -1], velocity[due, -1]], axis=-1)
                yield from self._trace(self._axes, stamps[due], slider)

    def _draw(self, stamps: Stamps, links: Array) -> Iterator[Rows]:
        points = self.drawing.place(links)
        yield Rows(f'{LINKAGE}/pins', Form.POINTS, stamps, points)
        yield Rows(f'{LINKAGE}/pins/names', Form.POINTS, stamps, self.drawing.beside(points))
        for link, lines in self.drawing.links(points).items():
            yield Rows(f'{LINKAGE}/{link}', Form.LINES, stamps, lines)

    def _trace(self, axes: GrowingAxes, stamps: Stamps, points: Array) -> Iterator[Rows]:
        shown = (np.abs(points) < _SHOWN).all(axis=1)  # nan is not
        stamps, points = stamps[shown], points[shown]
        for i, (x, y) in axes.follow(points):
            now = stamps[i : i + 1]
            yield Rows(f'{PHASE_PLANE}/curve', Form.SCALE, now, _into_square(x, y))
            for name, one in (('x', x), ('y', y)):
                yield Rows(f'{PHASE_PLANE}/{name}', Form.LABELS, now, np.array([one.labels]))
        if points.size:
            start = points[:1] if self._last_point is None else self._last_point
            strips = np.stack([np.concatenate([start, points[:-1]]), points], axis=1)
            self._last_point = points[-1:]
            yield Rows(f'{PHASE_PLANE}/curve/trail', Form.LINES, stamps, strips)
            yield Rows(f'{PHASE_PLANE}/curve/now', Form.POINTS, stamps, points[:, np.newaxis])


def _into_square(x: Axis, y: Axis) -> Array:
    """Factors and shifts that bring two axes to 0 ... 1."""
    ends = np.array([x.ends, y.ends])
    length = ends[:, 1] - ends[:, 0]
    return np.array([[1 / length, -ends[:, 0] / length]])
