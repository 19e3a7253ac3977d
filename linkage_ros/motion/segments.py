# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Interfaces of motions and of their segments, and the coordinates that follow from them.

Each kind of motion derives both; a segment lasts until the next one starts, and is what a log
stores.
"""

import copy
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, TypeAlias, cast

import numpy as np

from linkage_ros.mechanism.conditions import OWN_CONDITIONS, Conditions
from linkage_ros.mechanism.kinematics import State
from linkage_ros.numeric import Array, Real
from linkage_ros.units import JointUnits

Gravity: TypeAlias = tuple[float, float]


@dataclass(frozen=True)
class Segment(ABC):
    """Base class of segments of motion.

    Attributes:
        stamp: Stamp of the start, ns.
        old_stamp: If a step of the clock started the segment, the stamp of its start on the old
            clock, ns; otherwise None.
        gravity: Acceleration of gravity [x, y], m/s^2, if it was changed; None for that of the
            configuration.
    """

    stamp: int
    # Not fields, so that only the segments that have such fields log them.
    old_stamp = cast('int | None', None)
    gravity = cast('Gravity | None', None)

    @property
    def conditions(self) -> Conditions:
        """The conditions in this segment, without forces of loads."""
        return OWN_CONDITIONS if self.gravity is None else Conditions(gravity=self.gravity)

    def motion(self) -> 'Motion | None':
        """Returns the motion in this segment; None if the segment alone does not determine it."""
        return None

    @property
    def size(self) -> int:
        """About the memory that the segment takes, bytes."""
        return 1000

    @abstractmethod
    def words(self, units: JointUnits) -> str:
        """Describes the segment, without its start and gravity; units of the driven joint."""


class Motion(ABC):
    """Base class of motions.

    Attributes:
        segment: The current segment.
        conditions: The current conditions, which its coordinates hold.
    """

    segment: Segment
    conditions: Conditions = OWN_CONDITIONS

    @abstractmethod
    def at(self, stamp: int) -> 'Coordinates':
        """Computes the coordinates at a stamp, ns, at or after the start of the segment.

        The stamps of successive calls must not decrease under a torque.

        Raises:
            MotionError: The motion ends before the stamp.
        """

    @abstractmethod
    def at_all(self, stamps: Sequence[int]) -> 'Coordinates':
        """Computes the coordinates at increasing stamps, ns, bit-identical to those of `at`.

        Returns:
            The coordinates as arrays, which are shorter than `stamps` if the motion ends.

        Raises:
            MotionError: The motion ends before the first stamp.
        """

    @abstractmethod
    def restamp(self, old: int, new: int) -> 'Motion':
        """Returns the motion after a step of the clock from one stamp, ns, to another."""

    def under(self, stamp: int, conditions: Conditions, drive: Any) -> 'Motion':  # noqa: ARG002
        """Returns the motion under conditions and a drive from a stamp on.

        Args:
            stamp: Stamp, ns; must not be earlier than in the last call of `at`.
            conditions: Gravity and forces of loads. In a motion whose segments hold a gravity, a
                change of gravity starts a new segment.
            drive: The drive. A change of a parameter that may be set while running starts a new
                segment.

        Raises:
            MotionError: The motion ends before the stamp.
        """
        if conditions is self.conditions or conditions == self.conditions:
            return self
        changed = copy.copy(self)
        changed.conditions = conditions
        return changed

    def next_segment(self, logged: Any) -> Segment:
        """Recomputes the segment that follows this motion, given a logged one.

        Args:
            logged: The logged segment, of which only what a user sets, and the stamps, are used.

        Returns:
            The segment as a run would log it.

        Raises:
            MotionError: This motion ends before the logged segment.
        """
        raise NotImplementedError

    def time_to_turn(self, turns: int) -> int | None:  # noqa: ARG002, as above
        """Finds when the crank is first a given number of turns away from its start.

        Args:
            turns: Number of turns in either direction, above 0.

        Returns:
            Time from the start, ns; TIME_END if the crank never turns so far; None if the time is
            not known in advance.
        """
        return None


class Coordinates(NamedTuple):
    """Coordinates, rates and accelerations, each in the order of `Solver.coordinates`.

    The values are floats, or arrays for many times.

    Attributes:
        q: Crank angle, rad, reduced to the range of two turns, after which every state repeats;
            for a wind pump also the slider's position, m; for a driven slide its position, m.
        u: Rates of the coordinates, rad/s and m/s.
        a: Accelerations of the coordinates, rad/s^2 and m/s^2.
        unwrapped: Position of the driven joint, correctly rounded: crank angle including all
            turns, rad, or position of a slide, m.
        state: The state, if the motion may be in another assembly so that the coordinates do not
            determine the state; otherwise None.
        conditions: Conditions of the state.
    """

    q: tuple[Real, ...]
    u: tuple[Real, ...]
    a: tuple[Real, ...]
    unwrapped: Real
    state: State | None = None
    conditions: Conditions = OWN_CONDITIONS


def stacked(moments: Sequence[Coordinates]) -> Coordinates:
    """Stacks the coordinates of many times.

    Either all or none have a state or a turning frame; gravity and forces are those of the first.
    """
    conditions = moments[0].conditions
    if conditions.frame is not None:
        frames: Any = _columns([moment.conditions.frame for moment in moments])
        conditions = replace(conditions, frame=frames)
    states = [moment.state for moment in moments if moment.state is not None]
    return Coordinates(
        _columns([moment.q for moment in moments]),
        _columns([moment.u for moment in moments]),
        _columns([moment.a for moment in moments]),
        np.array([moment.unwrapped for moment in moments]),
        _stacked_states(states, conditions) if states else None,
        conditions,
    )


def _stacked_states(states: Sequence[State], conditions: Conditions) -> State:
    """Stacks states of the same links, under given conditions."""
    return State(
        _columns([state.position for state in states]),
        _columns([state.velocity for state in states]),
        _columns([state.acceleration for state in states]),
        np.array([state.torque for state in states]),
        conditions,
        states[0].links,
    )


def _columns(rows: Sequence[Any]) -> tuple[Array, ...]:
    return tuple(np.array(column) for column in zip(*rows, strict=True))
