# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Coordinates, rates and accelerations of a mechanism: the output of every drive."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from linkage_ros.model.kinematics import State
from linkage_ros.numeric import Array, Real


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
    """Stacks the coordinates of many times into arrays."""
    q, u, a = (_columns([m[i] for m in moments]) for i in range(3))
    states = [m.state for m in moments if m.state is not None]
    state = None
    if states:
        positions, rates, changes = (_columns([s[i] for s in states]) for i in range(3))
        state = State(positions, rates, changes, np.array([s.torque for s in states]))
    return Coordinates(q, u, a, np.array([m.unwrapped for m in moments]), state)


def _columns(rows: Sequence[Any]) -> tuple[Array, ...]:
    return tuple(np.array(column) for column in zip(*rows, strict=True))
