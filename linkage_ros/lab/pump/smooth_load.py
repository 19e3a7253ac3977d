# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Load curves of a pump that do not jump where the slider reverses.

The force of a load curve with a return_value jumps where the slider reverses. A Fourier series
cannot represent this jump, so the force is smoothed: between slider speeds of -width and width, it
changes from one curve to the other as a cubic polynomial of the speed.
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
    """A load curve with a return_value, smoothed where the slider reverses.

    Attributes:
        width: Slider speed below which the force is between the two curves, m/s.
    """

    width: float = 0.0

    def on(self, mechanism: Mechanism) -> Any:
        """See `LoadCurve`."""
        force = super().on(mechanism)
        return _SmoothForce(force, force.return_value or force.value, self.width)


def smoothed(mechanism: WindPump, pace: float) -> WindPump:
    """Replaces the load curves of a pump whose force jumps where the slider reverses.

    Args:
        mechanism: Description of the pump.
        pace: Largest crank speed, rad/s, to which the width of the transition is proportional.

    Returns:
        The pump with smooth loads; the given pump if none of its loads jumps.
    """
    width = _WIDTH * mechanism.crank.length * pace
    loads = tuple(
        SmoothLoad(load.link, load.over, load.at, load.value, load.return_value, width=width)
        if isinstance(load, LoadCurve) and load.return_value
        else load
        for load in mechanism.loads
    )
    return mechanism if loads == mechanism.loads else replace(mechanism, loads=loads)
