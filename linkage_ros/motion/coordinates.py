# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The coordinates of a mechanism at one moment: the output of every drive."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from linkage_ros.model.kinematics import State
from linkage_ros.numeric import Array, Real


class Coordinates(NamedTuple):
    """Coordinates, rates and accelerations, each in the order of `Solver.coordinates`.

    The values are floats, or arrays for many moments.

    Attributes:
        q: Crank angle, rad, reduced to within two turns, after which every state repeats. For a
            wind pump also the slider's position, m.
        u: Rates of the coordinates, rad/s and m/s.
        a: Accelerations of the coordinates, rad/s^2 and m/s^2.
        unwrapped: The whole crank angle, correctly rounded, rad.
        state: The state, if the motion is in another assembly, which the coordinates do not
            determine; None: they determine the state.
    """

    q: tuple[Real, ...]
    u: tuple[Real, ...]
    a: tuple[Real, ...]
    unwrapped: Real
    state: State | None = None


def stacked(moments: Sequence[Coordinates]) -> Coordinates:
    """Stacks the coordinates of many moments into arrays."""
    q, u, a = (_columns([m[i] for m in moments]) for i in range(3))
    states = [m.state for m in moments if m.state is not None]
    state = None
    if states:
        positions, rates, changes = (_columns([s[i] for s in states]) for i in range(3))
        state = State(positions, rates, changes, np.array([s.torque for s in states]))
    return Coordinates(q, u, a, np.array([m.unwrapped for m in moments]), state)


def _columns(rows: Sequence[Any]) -> tuple[Array, ...]:
    return tuple(np.array(column) for column in zip(*rows, strict=True))
