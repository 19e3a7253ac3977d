# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A load curve with a return_value whose force does not jump where the slider reverses.

Fourier series cannot follow a jump. Between slider speeds of -width and width the force changes
from one curve to the other, as a cubic polynomial of the speed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from linkage_ros.formulas import Opaque, where
from linkage_ros.model.kinematics import LinkPose
from linkage_ros.model.load_curve import CurveForce, LoadCurve
from linkage_ros.model.structure import Mechanism
from linkage_ros.model.wind_pump import WindPump
from linkage_ros.numeric import Real

_WIDTH = 0.03  # relative to crank length x the motor's largest speed


class _SmoothForce(NamedTuple):
    curve: CurveForce
    back: Opaque
    width: float

    def forces(self, links: Sequence[LinkPose], rates: Sequence[Real]) -> dict[int, Real]:
        """See `Load`."""
        place, rate = links[self.curve.link].position, rates[self.curve.link] / self.width
        share = where(rate > 1, 1.0, where(rate < -1, -1.0, 0.5 * rate * (3 - rate * rate)))
        ends = self.curve.value(place), self.back(place)
        return {self.curve.link: 0.5 * (ends[0] + ends[1] + share * (ends[0] - ends[1]))}


@dataclass(frozen=True)
class SmoothLoad(LoadCurve):
    """A load curve with a return_value.

    Attributes:
        width: Slider speed within which the force changes, m/s.
    """

    width: float = 0.0

    def on(self, mechanism: Mechanism) -> Any:
        """See `LoadCurve`."""
        force = super().on(mechanism)
        return _SmoothForce(force, force.return_value or force.value, self.width)


def smoothed(mechanism: WindPump, pace: float) -> WindPump:
    """A pump whose loads do not jump.

    Args:
        mechanism: The pump.
        pace: The largest crank speed, rad/s.

    Returns:
        The same pump if no load jumps.
    """
    width = _WIDTH * mechanism.crank.length * pace
    loads = tuple(
        SmoothLoad(load.link, load.over, load.at, load.value, load.return_value, width=width)
        if isinstance(load, LoadCurve) and load.return_value
        else load
        for load in mechanism.loads
    )
    return mechanism if loads == mechanism.loads else replace(mechanism, loads=loads)
