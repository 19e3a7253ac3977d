# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Segments of a run's motion, as stored in logs, and the coordinates that follow from them.

A segment lasts until the next one starts.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from linkage_ros.mechanism.kinematics import State
from linkage_ros.mechanism.structure import Description
from linkage_ros.motion.law import Law
from linkage_ros.numeric import Array, Real

Gravity: TypeAlias = tuple[float, float]


@dataclass(frozen=True)
class SpeedSegment:
    """A segment in which the crank accelerates from an initial speed to the set speed.

    Attributes:
        stamp: Stamp of the start, ns.
        phase: Crank angle at the start, turns.
        speed: Crank speed at the start, turns per minute.
        rpm: Set speed, turns per minute.
        acceleration: Magnitude of the acceleration towards the set speed, rad/s^2; 0 for an
            immediate change.
        old_stamp: If a step of the clock started the segment, the stamp of its start on the old
            clock, ns; otherwise None.
        gravity: Acceleration of gravity [x, y], m/s^2, since it was changed; None for that of the
            configuration.
    """

    stamp: int
    phase: Fraction
    speed: Fraction
    rpm: float
    acceleration: float
    old_stamp: int | None = None
    gravity: Gravity | None = None


@dataclass(frozen=True)
class TorqueSegment:
    """A segment in which a motor torque drives the mechanism.

    Attributes:
        stamp: Stamp of the start, ns.
        torque: Torque of the motor at rest, N m.
        old_stamp: If a step of the clock started the segment, the stamp of its start on the old
            clock, ns; otherwise None.
        description: Coordinates and assembly of the motion; None for the mechanism's own.
    """

    stamp: int
    torque: float
    old_stamp: int | None = None
    description: Description | None = None


@dataclass(frozen=True)
class LawSegment:
    """A segment in which the crank follows a law.

    Attributes:
        stamp: Stamp of the start, ns.
        law: The law.
        time: Time of the law at the start, ns.
        turns: Whole turns to add to the angle of the law.
        old_stamp: If a step of the clock started the segment, the stamp of its start on the old
            clock, ns; otherwise None.
        gravity: Acceleration of gravity [x, y], m/s^2, since it was changed; None for that of the
            configuration.
    """

    stamp: int
    law: Law
    time: int = 0
    turns: int = 0
    old_stamp: int | None = None
    gravity: Gravity | None = None


@dataclass(frozen=True)
class FollowSegment:
    """A segment in which the crank is measured; the first one is not logged.

    Attributes:
        stamp: Stamp of the first measurement, ns.
        gravity: Acceleration of gravity [x, y], m/s^2.
    """

    stamp: int
    gravity: Gravity


Segment: TypeAlias = SpeedSegment | TorqueSegment | LawSegment | FollowSegment


class Coordinates(NamedTuple):
    """Coordinates, rates and accelerations, each in the order of `Solver.coordinates`.

    The values are floats, or arrays for many times.

    Attributes:
        q: Crank angle, rad, reduced to the range of two turns, after which every state repeats;
            for a wind pump also the slider's position, m.
        u: Rates of the coordinates, rad/s and m/s.
        a: Accelerations of the coordinates, rad/s^2 and m/s^2.
        unwrapped: Crank angle including all turns, correctly rounded, rad.
        state: The state, if the motion may be in another assembly so that the coordinates do not
            determine the state; otherwise None.
    """

    q: tuple[Real, ...]
    u: tuple[Real, ...]
    a: tuple[Real, ...]
    unwrapped: Real
    state: State | None = None


def stacked(moments: Sequence[Coordinates]) -> Coordinates:
    """Stacks the coordinates of many times into arrays; either all or none have a state."""
    q, u, a, unwrapped, states = zip(*moments, strict=True)
    state = None
    if states[0] is not None:
        *rows, torques = zip(*states, strict=True)
        state = State._make((*map(_columns, rows), np.array(torques)))
    return Coordinates(_columns(q), _columns(u), _columns(a), np.array(unwrapped), state)


def _columns(rows: Sequence[Any]) -> tuple[Array, ...]:
    return tuple(np.array(column) for column in zip(*rows, strict=True))
