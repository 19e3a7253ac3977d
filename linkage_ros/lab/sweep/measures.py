# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What designs are judged by: functions of many designs over all crank angles of a period."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cached_property, partial
from typing import Any, NamedTuple, TypeAlias, cast

import numpy as np

from linkage_ros.dynamics.model import Model
from linkage_ros.dynamics.program import Program
from linkage_ros.dynamics.reactions import Joints, reactions
from linkage_ros.dynamics.trees import Constants, transformed
from linkage_ros.formulas import ZERO, Vector
from linkage_ros.lab.sweep.designs import groups
from linkage_ros.lab.torque_models import driving_torque
from linkage_ros.model.four_bar import FourBarLoop
from linkage_ros.model.structure import Mechanism
from linkage_ros.model.transmission import Transmission
from linkage_ros.numeric import Array, Real, wrap
from linkage_ros.units import radians_per_second

RPM = 'rpm'
_AT_ONCE = 16384  # values of an array: what lies between stays in the processor's cache
_STEPS = 8  # of Newton's method; four reach the last digits
# What measures may need.
_SPEED = 'a crank speed, such as rpm: 60.0, and no dry friction'
_ROCKER, _SLIDER = 'a rocker', 'a slider'
_POINTS = 'coupler.point, and points: [x, y, ...]'
_Constants: TypeAlias = tuple[Model, Any, Joints]  # and the coupler point


def torque_of(constants: _Constants, angle: Real, speed: Real) -> Real:
    """The driving torque, N m."""
    return driving_torque(constants[0], angle, speed)[0]


def _output_of(constants: _Constants, angle: Real, _: Real) -> tuple[Real, Real, Real]:
    """Position of the output link, and its first two derivatives over the crank angle."""
    link = constants[0].loop.pose((angle,)).links[-1]
    return link.position, link.jacobian[0], link.curvature[0]


def _path_of(constants: _Constants, angle: Real, _: Real) -> Vector:
    """The coupler point, m."""
    model, point, _ = constants
    directions = [link.direction for link in model.loop.pose((angle,)).links]
    at_rest = [ZERO] * len(directions)
    return cast('Vector', point.follow(directions, at_rest, at_rest)[0])


def _force_of(constants: _Constants, angle: Real, speed: Real) -> Vector:
    """The force on the frame, N."""
    return reactions((constants[0], constants[2]), (angle,), (speed,), ())[2]


class Batch:
    """Designs of one structure whose cranks turn fully, over a period.

    All arrays have a row for each design.
    """

    def __init__(
        self, constants: Constants, transmission: Transmission, speed: Array, task: Task
    ) -> None:
        """Takes designs.

        Args:
            constants: A coupler point, or None, behind the constants of the model.
            transmission: Those of the transmission angle.
            speed: Crank speeds, of shape (designs, 1), rad/s.
            task: Number of angles, and points.
        """
        self._constants, self._transmission = constants, transmission
        self._speed, self._points = speed, task.points
        straight = [square.least is ZERO for square in (transmission.cos, transmission.sin)]
        self._has_change_point = any(straight)
        turns = 2 if sum(straight) == 1 else 1
        self._step = 2 * math.pi / task.angles
        self._angles = (np.arange(turns * task.angles) + 0.5) * self._step

    def _run(self, formula: Callable[..., Any], angles: Real) -> Any:
        found = Program(formula, self._constants, ('angle', 'speed')).designs(angles, self._speed)
        shape = len(self._speed), angles.shape[-1]
        return transformed(lambda x: np.broadcast_to(x, shape), found)

    @cached_property
    def torque(self) -> Array:
        """Driving torque, N m."""
        return cast('Array', self._run(torque_of, self._angles))

    def shaking_force(self) -> Array:
        """Largest force on the frame, N; it has no bound where there are change points."""
        if self._has_change_point:
            return np.full(len(self._speed), math.inf)
        return np.asarray(np.hypot(*self._run(_force_of, self._angles)).max(-1))

    @cached_property
    def _reversals(self) -> Array:
        """Crank angles of two reversals of the output, else not numbers, rad."""
        _, rate, _ = self._run(_output_of, self._angles)
        turned = rate * np.roll(rate, -1, axis=-1) < 0
        first, last = turned.argmax(-1), turned[:, ::-1].argmax(-1)
        before = self._angles[np.stack([first, turned.shape[-1] - 1 - last], -1)]
        at = before + 0.5 * self._step
        for _ in range(_STEPS):
            _, slope, bend = self._run(_output_of, at)
            at = np.clip(at - slope / bend, before, before + self._step)
        # A rocker that passes change points may swing by more than pi.
        twice = (turned.sum(-1, keepdims=True) == 2) & (not self._has_change_point)
        return np.where(twice, at, math.nan)

    def stroke(self) -> Array:
        """Distance of the two reversals, rad or m."""
        places, *_ = self._run(_output_of, self._reversals)
        return np.asarray(places[:, 1] - places[:, 0])

    def swing(self) -> Array:
        """Swing of a rocker that stays on one side of the frame, deg."""
        return cast('Array', np.abs(np.degrees(wrap(self.stroke(), np.rint))))

    def time_ratio(self) -> Array:
        """Ratio of the longer to the shorter crank rotation between the reversals."""
        way = self._reversals[:, 1] - self._reversals[:, 0]
        rest = len(self._angles) * self._step - way
        return np.maximum(way, rest) / np.minimum(way, rest)

    def transmission_angle(self) -> Array:
        """Smallest transmission angle, as an acute one, deg."""
        low, high = self._transmission.extremes()
        return cast('Array', np.degrees(np.minimum(low, math.pi - high)).ravel())

    def point_distance(self) -> Array:
        """Largest distance of the given points from the path of the coupler point, m."""
        x, y = self._run(_path_of, self._angles)
        dx, dy = (np.roll(row, -1, axis=-1) - row for row in (x, y))
        farthest = np.zeros(len(x))
        for px, py in self._points:
            along = np.clip(((px - x) * dx + (py - y) * dy) / (dx * dx + dy * dy), 0.0, 1.0)
            distances = np.hypot(x + along * dx - px, y + along * dy - py)
            farthest = np.maximum(farthest, distances.min(-1))
        return farthest


class Measure(NamedTuple):
    """One quantity that designs are judged by.

    Attributes:
        unit: Its unit.
        meaning: What it is.
        of: Computes it for each design of a batch.
        needs: What it needs of a task, in words; empty: nothing.
    """

    unit: str
    meaning: str
    of: Callable[[Batch], Array]
    needs: str = ''


MEASURES = {
    'peak_torque': Measure(
        'N m', 'largest driving torque', lambda x: np.abs(x.torque).max(-1), _SPEED
    ),
    'rms_torque': Measure(
        'N m', 'root mean square of the driving torque',
        lambda x: np.sqrt(np.mean(x.torque * x.torque, -1)), _SPEED,
    ),
    'shaking_force': Measure('N', 'largest force on the frame', Batch.shaking_force, _SPEED),
    'swing': Measure('deg', 'swing of the rocker', Batch.swing, _ROCKER),
    'stroke': Measure('m', 'stroke of the slider', lambda x: np.abs(x.stroke()), _SLIDER),
    'time_ratio': Measure(
        '', 'longer to shorter crank rotation between reversals', Batch.time_ratio
    ),
    'transmission_angle': Measure('deg', 'smallest transmission angle', Batch.transmission_angle),
    'point_distance': Measure(
        'm', 'largest distance of a given point from the coupler curve', Batch.point_distance,
        _POINTS,
    ),
}  # fmt: skip


class Task(NamedTuple):
    """What is done with every design.

    Attributes:
        mechanism: The mechanism that the designs have in common.
        rpm: Its crank speed; None: it has none.
        names: The parameters in which designs differ.
        measures: Names of the measures.
        angles: Number of crank angles in a turn.
        points: Points that the coupler point should pass, m.
    """

    mechanism: Mechanism
    rpm: float | None
    names: tuple[str, ...]
    measures: tuple[str, ...]
    angles: int
    points: tuple[tuple[float, float], ...] = ()

    def lacks(self, need: str) -> bool:
        """Whether the mechanism or the task lacks what a measure needs."""
        structure = self.mechanism.structure()
        slides = structure.links[-1].slides
        return {
            _SPEED: self.rpm is None or bool(self.mechanism.joint_loads()),
            _ROCKER: slides,
            _SLIDER: not slides,
            _POINTS: not self.points or 'C' not in structure.points,
        }.get(need, False)


def measure(task: Task, designs: Array) -> Array:
    """Measures designs.

    Args:
        task: What to measure.
        designs: A row for each design, a column for each name.

    Returns:
        A row for each design: 1 if its crank turns fully, else 0; then the measures, which are not
        numbers where a design has none.
    """
    found = np.full((len(designs), 1 + len(task.measures)), math.nan)
    found[:, 0] = 0
    columns = dict(zip(task.names, designs.T, strict=True))
    rpms: Real = columns.pop(RPM, np.full(len(designs), task.rpm or 0.0))
    at_once = max(1, _AT_ONCE // task.angles)
    # As in Program.arrays: from then on glibc keeps the memory of arrays.
    np.empty(3_000_000)
    with np.errstate(all='ignore'):
        for rows, model, constants in groups(task.mechanism, columns, len(designs)):
            transmission = cast('FourBarLoop', model.loop).transmission
            for start in range(0, len(rows), at_once) if transmission.turns_fully else ():
                part = slice(start, start + at_once)
                own = transformed(partial(_part, part), transmission)
                speed: Real = radians_per_second(rpms[rows[part], None])
                batch = Batch(constants.part(part), own, speed, task)
                found[rows[part], 0] = 1
                for i, name in enumerate(task.measures, 1):
                    found[rows[part], i] = MEASURES[name].of(batch)
    return found


def _part(rows: slice, value: Any) -> Any:
    return value[rows] if isinstance(value, np.ndarray) else value
