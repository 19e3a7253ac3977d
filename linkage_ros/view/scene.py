# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The contents of a view: rows of numbers over time for each entity."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt
import rerun as rr

from linkage_ros.motion.drives import FollowDrive
from linkage_ros.numeric import Array
from linkage_ros.parameters.configuration import Configuration
from linkage_ros.view.drawing import Drawing

Stamps: TypeAlias = npt.NDArray[np.int64]

# Rerun's MCAP importer gives these names to stamps and to the parts of a topic joint_states, so
# that a live view, a replay and a log opened in Rerun have the same entities.
TIMELINE = 'ros2_timestamp'
JOINT_FIELDS = ('position', 'velocity', 'effort')
# Directions in base_link of the links that turn, except the crank, and rates of all of them. The
# angles of joints count from the link before, and jump at pi.
DIRECTIONS, RATES = 'directions', 'rates'
JOINT_STATES, LINKAGE = 'joint_states', 'linkage'  # with entities below them
LOADS = f'{LINKAGE}/loads'

_DRAWING_NS = 20_000_000  # 50 drawings a second of stamp time


class Rows(NamedTuple):
    """Values of an entity at some stamps.

    Attributes:
        entity: Its path.
        archetype: Rerun's type of the values.
        stamps: ns.
        values: One row for each stamp.
    """

    entity: str
    archetype: Any
    stamps: Stamps
    values: Array


class Directions:
    """Directions of links over time, without jumps between -pi and pi."""

    def __init__(self) -> None:
        self._last: Array | None = None

    def follow(self, angles: Array) -> Array:
        """Unwraps the directions at the next samples.

        Args:
            angles: Directions up to whole turns, rad; shape (n, links).

        Returns:
            Directions, rad: the first from -pi to pi, each other one within pi of its predecessor.
            A sample with a non-finite angle is not changed.
        """
        known = np.isfinite(angles).all(axis=1)
        within = angles[known] - 2 * math.pi * np.round(angles[known] / (2 * math.pi))
        if not within.size:
            return angles
        before = within[:1] if self._last is None else self._last
        found: Array = angles.copy()
        found[known] = np.unwrap(np.concatenate([before, within]), axis=0)[1:]
        self._last = found[known][-1:]
        return found


class Scene:
    """Makes rows from samples, in batches of any size.

    Attributes:
        drawing: The linkage.
    """

    def __init__(self, configuration: Configuration) -> None:
        mechanism, drive = configuration.mechanism, configuration.drive
        reach, start = mechanism.reach(), drive.crank_angle
        if isinstance(drive, FollowDrive) and reach and not reach.turns_fully:
            start = 0.5 * sum(reach.arcs[0])
        self.drawing = Drawing(mechanism, start)
        self._directions = Directions()
        self._last_frame = -1

    def advance(
        self, stamps: Stamps, position: Array, velocity: Array, effort: Array
    ) -> Iterator[Rows]:
        """Rows for the next samples.

        Args:
            stamps: ns, shape (n,), n > 0.
            position: Positions of the joints in tree order, rad and m; shape (n, joints).
            velocity: Velocities of the joints, rad/s and m/s.
            effort: Efforts of the joints, N m.

        Yields:
            Rows of all entities with values.
        """
        for field, row in zip(JOINT_FIELDS, (position, velocity, effort), strict=True):
            yield Rows(f'{JOINT_STATES}/{field}', rr.Scalars, stamps, row)
        links, count = self.drawing.links_from_joints(position), len(self.drawing.turning)
        directions = self._directions.follow(links[:, 1:count])
        yield Rows(DIRECTIONS, rr.Scalars, stamps, directions)
        rates = self.drawing.links_from_joints(velocity)
        yield Rows(RATES, rr.Scalars, stamps, rates[:, :count])
        frames = stamps // _DRAWING_NS
        due = np.diff(frames, prepend=self._last_frame) != 0
        self._last_frame = frames[-1]
        if due.any():
            yield from self._draw(stamps[due], links[due], rates[due])

    def _draw(self, stamps: Stamps, links: Array, rates: Array) -> Iterator[Rows]:
        points = self.drawing.place(links)
        yield Rows(f'{LINKAGE}/pins', rr.Points2D, stamps, points)
        yield Rows(f'{LINKAGE}/pins/names', rr.Points2D, stamps, self.drawing.labels(points))
        for link, lines in self.drawing.links(points).items():
            yield Rows(f'{LINKAGE}/{link}', rr.LineStrips2D, stamps, lines.astype(np.float32))
        for link, lines in self.drawing.loads(points, links, rates).items():
            yield Rows(f'{LOADS}/{link}', rr.LineStrips2D, stamps, lines.astype(np.float32))
