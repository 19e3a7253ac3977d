# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The motion of a mechanism over one period, as columns of numbers."""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from linkage_ros.drawing import Array
from linkage_ros.errors import ConfigurationError
from linkage_ros.mechanism import Mechanism
from linkage_ros.solver import Solver
from linkage_ros.state import State

_STEPS_PER_TURN = 720


class Column(NamedTuple):
    """One quantity over the period.

    Attributes:
        name: Such as 'coupler.position'.
        unit: SI unit.
        values: Over the crank angles.
    """

    name: str
    unit: str
    values: Array


class Extent(NamedTuple):
    """How large a quantity gets over the period.

    Attributes:
        low: Its smallest value.
        low_at: Where, crank angle, rad.
        high: Its largest value.
        high_at: Where, crank angle, rad.
        mean: Over the crank angle.
        rms: Root mean square over the crank angle.
    """

    low: float
    low_at: float
    high: float
    high_at: float
    mean: float
    rms: float


class Curves:
    """One period of a mechanism, at a speed and an acceleration that hold at every angle.

    Attributes:
        solver: Of the mechanism.
        crank: Crank angles from 0 to the end of the period, 0.5 deg apart, rad.
        speed: rad/s.
        columns: All quantities, by name; angles without jumps.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        speed: float,
        acceleration: float = 0.0,
        *,
        reactions: bool = False,
    ) -> None:
        """Solves the period.

        Args:
            mechanism: Its crank must turn fully.
            speed: Crank speed, rad/s.
            acceleration: Crank acceleration, rad/s^2.
            reactions: Whether to add pin forces, shaking force and shaking moment.

        Raises:
            MechanismError: The crank does not turn fully.
            ConfigurationError: The speed or acceleration is not finite, or reactions are asked
                for that pass all bounds at a change point.
        """
        self.solver = solver = Solver(mechanism)
        solver.require_full_turn()
        turns = solver.mobility.period_turns
        self.speed = speed
        self.crank = np.linspace(0, turns * 2 * math.pi, turns * _STEPS_PER_TURN + 1)
        state = solver.state(self.crank, speed, acceleration)
        columns = [Column('crank_angle', 'rad', self.crank), *self._links(state)]
        columns += [
            Column('driving_torque', 'N m', state.torque),
            Column('driving_power', 'W', state.torque * speed),
        ]
        if 'C' in solver.structure.points:
            columns += self._coupler_point(state)
        if reactions:
            columns += self._reactions(state)
        self.columns: Mapping[str, Column] = {column.name: column for column in columns}

    def _links(self, state: State) -> list[Column]:
        columns = []
        for joint in self.solver.structure.joints:
            unit = 'm' if joint.slides else 'rad'
            position, velocity, acceleration = (
                np.broadcast_to(x[joint.link], self.crank.shape) for x in state[:3]
            )
            columns += [
                Column(f'{joint.name}.position', unit,
                       position if joint.slides else np.unwrap(position)),
                Column(f'{joint.name}.velocity', f'{unit}/s', velocity),
                Column(f'{joint.name}.acceleration', f'{unit}/s^2', acceleration),
            ]  # fmt: skip
        return columns

    def _coupler_point(self, state: State) -> list[Column]:
        motion = self.solver.point(state, 'C')
        units = ('position', 'm'), ('velocity', 'm/s'), ('acceleration', 'm/s^2')
        return [
            Column(f'coupler_point.{name}.{axis}', unit, values)
            for (name, unit), vector in zip(units, motion, strict=True)
            for axis, values in zip('xy', vector, strict=True)
        ]

    def _reactions(self, state: State) -> list[Column]:
        low, high = self.solver.kinematics.map.extremes()
        if low == 0 or high == math.pi:
            raise ConfigurationError(
                'this mechanism passes a change point, where the forces in its joints have no '
                'finite value: leave the reactions out'
            )
        reactions = self.solver.reactions(state)
        columns = [
            Column(f'pin_{pin}.{axis}', 'N', values)
            for pin, force in reactions.pins.items()
            for axis, values in zip('xy', force, strict=True)
        ]
        if reactions.guide_force is not None:
            columns.append(Column('guide_force', 'N', reactions.guide_force))
        columns += [
            Column(f'shaking_force.{axis}', 'N', values)
            for axis, values in zip('xy', reactions.shaking_force, strict=True)
        ]
        return [*columns, Column('shaking_moment', 'N m', reactions.shaking_moment)]

    def extent(self, values: Array) -> Extent:
        """How large a quantity gets, among its samples.

        Args:
            values: Over the crank angles, such as those of a column.

        Returns:
            Its extent.
        """
        low, high = int(np.argmin(values)), int(np.argmax(values))
        once = values[:-1]  # the end of the period is its start
        return Extent(
            float(values[low]), float(self.crank[low]), float(values[high]),
            float(self.crank[high]), float(once.mean()), math.sqrt(float(np.mean(once * once))),
        )  # fmt: skip

    def save(self, path: Path) -> None:
        """Writes all columns to a CSV file; every number reads back to the last bit.

        Args:
            path: The file; replaced if there is one.
        """
        columns = self.columns.values()
        with path.open('w', newline='', encoding='utf-8') as stream:
            writer = csv.writer(stream)
            writer.writerow(f'{column.name} [{column.unit}]' for column in columns)
            rows = zip(*(column.values.tolist() for column in columns), strict=True)
            writer.writerows([repr(value) for value in row] for row in rows)
