# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The gas in a cylinder, closed or with self-acting valves."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np

from linkage_ros.errors import ConfigurationError
from linkage_ros.formulas import ZERO, exp, expm1, log, log1p, number, where
from linkage_ros.mechanism.kinematics import LinkPose
from linkage_ros.mechanism.loads.base import AppliedLoad, LoadedMechanism, Range
from linkage_ros.mechanism.wrenches import Wrench
from linkage_ros.numeric import Real
from linkage_ros.quantities import quantity

AMBIENT = 1.013e5  # Pa
FAR, NEAR = 'far', 'near'
_LENGTHS, _PRESSURES = (1e-9, 1e9), (1e-3, 1e12)
_AT_END = 1e-9  # share of the stroke; a slider nearer to an end is at the end


@dataclass(frozen=True)
class Gas(AppliedLoad):
    """The gas above a piston, whose volume is area x (clearance + distance from the top).

    Without `outlet` the cylinder is closed: pressure x volume^exponent is constant, and the
    pressure at the largest volume is `inlet`. With `outlet` it has self-acting valves: the gas is
    compressed from `inlet` at the largest volume until `outlet`, and expands from `outlet` at the
    top until `inlet`. The direction of the motion selects between the two.

    Attributes:
        link: Name of the slider.
        bore: Diameter of the piston, m.
        clearance: Distance of the piston from the cylinder head at the top, m.
        inlet: Absolute pressure at the largest volume, Pa.
        outlet: Absolute pressure at which the gas is delivered, Pa; None for a closed cylinder.
        exponent: Exponent of compression and expansion.
        ambient: Absolute pressure on the other side of the piston, Pa.
        top: Where the gas is compressed: 'far' from the crank pivot, or 'near' to it.
    """

    has_corners: ClassVar[bool] = True

    link: str = quantity('text', 'slider on which the gas acts')
    bore: float = quantity('number', 'diameter of the piston', 'm', span=_LENGTHS)
    clearance: float = quantity(
        'number', 'distance of the piston from the head at the top', 'm', span=_LENGTHS
    )
    inlet: float = quantity(
        'number', 'absolute pressure at the largest volume', 'Pa', span=_PRESSURES
    )
    outlet: float | None = quantity(
        'number', 'absolute pressure of delivery; left out: a closed cylinder', 'Pa',
        span=_PRESSURES, default=None,
    )  # fmt: skip
    exponent: float = quantity(
        'number', 'exponent of compression and expansion', span=(0.1, 10.0), default=1.4
    )
    ambient: float = quantity(
        'number', 'absolute pressure on the other side of the piston', 'Pa', span=(0.0, 1e12),
        default=AMBIENT,
    )  # fmt: skip
    top: str = quantity(
        'choice', 'top of the stroke: far from the crank pivot, or near it', choices=(FAR, NEAR),
        default=FAR,
    )  # fmt: skip

    def on(self, mechanism: LoadedMechanism) -> 'GasForce':
        """See `AppliedLoad.on`.

        Raises:
            ConfigurationError: The mechanism has no such slider with a fixed stroke, or the gas
                never reaches the outlet pressure.
        """
        link = mechanism.structure().link_index(self.link, f'{self.label}.link')
        stroke = mechanism.stroke(self.label, self.link)
        (top, _), (bottom, _) = stroke.ends(self.top)
        length = abs(top - bottom)
        largest = self.clearance + length
        if self.outlet is not None:
            reached = self.inlet * math.exp(self.exponent * math.log(largest / self.clearance))
            if not self.inlet < self.outlet < reached:
                raise ConfigurationError(
                    f'{self.label}.outlet = {self.outlet:g}: must be between inlet, '
                    f'{self.inlet:g} Pa, and the {reached:.6g} Pa that the stroke of '
                    f'{length:.6g} m reaches; change outlet or clearance, or leave outlet out for '
                    'a closed cylinder'
                )
        return GasForce(
            link, 0.25 * math.pi * self.bore * self.bore, math.copysign(1.0, top - bottom), top,
            self.clearance, largest, self.inlet, self.outlet, self.exponent, self.ambient,
        )  # fmt: skip

    def one_way(self, mechanism: LoadedMechanism) -> Range | None:
        """See `AppliedLoad.one_way`; inside the stroke, valves would not switch at a reversal."""
        if self.outlet is None:
            return None
        load = self.on(mechanism)
        length = load.largest - load.clearance
        ends = (load.top - load.towards_top * x * length for x in (_AT_END, 1 - _AT_END))
        return Range(load.link, *sorted(ends))


class GasForce(NamedTuple):
    """The gas in a cylinder, in the form used by formulas.

    Attributes:
        link: Index of the slider.
        area: Area of the piston, m^2.
        towards_top: 1 if the slider's position increases towards the top, otherwise -1.
        top: Position of the slider at the top, m.
        clearance: Smallest distance of the piston from the head, m.
        largest: Largest distance, m.
        inlet: Pressure at the largest distance, Pa.
        outlet: Pressure of delivery, Pa; None for a closed cylinder.
        exponent: Exponent of compression and expansion.
        ambient: Pressure on the other side of the piston, Pa.
    """

    link: int
    area: Real
    towards_top: Real
    top: Real
    clearance: Real
    largest: Real
    inlet: Real
    outlet: Real | None
    exponent: Real
    ambient: Real

    def _distance(self, links: Sequence[LinkPose]) -> Real:
        return self.clearance + self.towards_top * (self.top - links[self.link].position)

    def _pressures(self, links: Sequence[LinkPose]) -> tuple[Real, Real]:
        """Returns the pressure during compression, Pa, and during expansion."""
        distance = self._distance(links)
        pressed = self.inlet * exp(self.exponent * log(self.largest / distance))
        if self.outlet is None:
            return pressed, pressed
        drawn = self.outlet * exp(self.exponent * log(self.clearance / distance))
        return (
            where(pressed < self.outlet, pressed, self.outlet),
            where(drawn > self.inlet, drawn, self.inlet),
        )

    def wrenches(self, links: Sequence[LinkPose], rates: Sequence[Real]) -> list[Wrench]:
        """See `Load`; the gas also pushes the cylinder head, which belongs to the frame."""
        pressure, back = self._pressures(links)
        if self.outlet is not None:
            pressure = where(self.towards_top * rates[self.link] >= 0, pressure, back)
        force = -(self.towards_top * ((pressure - self.ambient) * self.area))
        return [Wrench(self.link, force, force)]

    def potential(self, links: Sequence[LinkPose]) -> Real:
        """Returns the energy of the gas, J; ZERO with valves. See `Load`."""
        if self.outlet is not None:
            return ZERO
        distance, extra = self._distance(links), self.exponent - 1.0
        log_ratio = log1p((self.largest - distance) / distance)  # of largest volume to volume
        # The limit of (ratio^extra - 1) / extra for extra = 0 is the logarithm: an isothermal gas.
        is_polytropic = abs(extra) > 0.0
        divisor = where(is_polytropic, extra, 1.0)
        work = where(is_polytropic, expm1(extra * log_ratio) / divisor, log_ratio)
        volume = self.area * self.largest
        return self.inlet * (volume * work) + self.ambient * (self.area * distance)

    def piece(self, links: Sequence[LinkPose], rates: Sequence[Real]) -> Any:
        """Numbers the parts of the cycle between the valves' openings; see `Load`."""
        forth = np.asarray(self.towards_top * rates[self.link] >= 0)
        if self.outlet is None:
            return np.zeros(forth.shape)
        pressure, back = (number(x) for x in self._pressures(links))
        return np.where(forth, 2.0 + (pressure < self.outlet), 0.0 + (back > self.inlet))
