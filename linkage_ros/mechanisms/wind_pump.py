# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The wind pump: frozen, checked when made."""

from __future__ import annotations

from dataclasses import dataclass

from linkage_ros.mechanisms.parts import CROSSED, OPEN, Body, Coupler, Piston, gravity_quantity
from linkage_ros.quantities import Checked, quantity


@dataclass(frozen=True)
class WindPump(Checked):
    """A wind pump, closed by inertia: crank A0-A, coupler A-B, rod B-D, slider D on the x axis.

    Two degrees of freedom: the crank angle and the slider's position are independent.

    Attributes:
        crank: Driven link, from A0, the origin.
        coupler: From the crank pin A to B.
        rod: From B to the slider's pin D.
        slider: The pump's piston, at D.
        assembly: 'open': B lies left of the line from A to D; 'crossed': right of it, which is
            below where the slider is to the right.
        gravity: Acceleration of gravity [x, y], m/s^2.
    """

    crank: Body
    coupler: Coupler
    rod: Body
    slider: Piston
    assembly: str = quantity(
        'choice', 'side of the coupler-rod pin', choices=(OPEN, CROSSED), default=OPEN
    )
    gravity: tuple[float, float] = gravity_quantity()
