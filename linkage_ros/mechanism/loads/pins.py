# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Viscous friction in pins."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from linkage_ros.errors import ConfigurationError
from linkage_ros.formulas import ZERO
from linkage_ros.mechanism.axes import spin_of
from linkage_ros.mechanism.kinematics import LinkPose
from linkage_ros.mechanism.loads.base import AppliedLoad, LoadedMechanism
from linkage_ros.mechanism.structure import Structure
from linkage_ros.mechanism.wrenches import FRAME, Wrench
from linkage_ros.numeric import Real
from linkage_ros.quantities import quantity, shown


@dataclass(frozen=True)
class Pins(AppliedLoad):
    """Viscous friction in all pins, or in one: a torque against the relative rotation.

    Attributes:
        damping: Damping coefficient of each pin, N m s.
        pin: Name of the pin, such as 'B'; empty for all pins.
    """

    damping: float = quantity(
        'number', 'torque per relative angular velocity of each pin', 'N m s', span=(0.0, 1e12)
    )
    pin: str = quantity('text', 'name of the pin; empty: all pins', default='')

    def on(self, mechanism: LoadedMechanism) -> 'PinDamping':
        """See `AppliedLoad.on`.

        Raises:
            ConfigurationError: The mechanism has no such pin, or its pins are unknown.
        """
        structure = mechanism.structure()
        names = [pin.name for pin in structure.pins]
        if not names or (self.pin and self.pin not in names):
            words = 'left out, since the pins of this mechanism are unknown'
            if names:
                words = f'one of {", ".join(names)}, or empty for all'
            raise ConfigurationError(f'{self.label}.pin = {shown(self.pin)}: must be {words}')
        damped = [pin for pin in structure.pins if self.pin in {'', pin.name}]
        return PinDamping(
            self.damping,
            tuple(
                (_turning(structure, pin.first), _turning(structure, pin.second)) for pin in damped
            ),
        )


class PinDamping(NamedTuple):
    """Viscous friction in pins, in the form used by formulas.

    Attributes:
        damping: Damping coefficient, N m s.
        pairs: For the two bodies of each pin, the index of the body and that of the link with
            which it turns, or FRAME.
    """

    damping: Real
    pairs: tuple[tuple[tuple[int, int], ...], ...]

    def wrenches(self, _links: Sequence[LinkPose], rates: Sequence[Real]) -> list[Wrench]:
        """See `Load`."""
        found = []
        for first, second in self.pairs:
            rate, other = (ZERO if j == FRAME else rates[j] for _, j in (second, first))
            couple = -(self.damping * (rate - other))
            found += [_couple(*second, couple), _couple(*first, -couple)]
        return found

    def potential(self, _links: Sequence[LinkPose]) -> Real:
        """Returns ZERO; see `Load`."""
        return ZERO


def _turning(structure: Structure, j: int | None) -> tuple[int, int]:
    """Returns a body and the link with which it turns; see `PinDamping.pairs`."""
    if j is None:
        return FRAME, FRAME
    spin = spin_of(structure.links, j)
    return j, FRAME if spin is None else spin


def _couple(body: int, spin: int, couple: Real) -> Wrench:
    """Returns a couple on a body."""
    return Wrench(body, couple) if body == spin else Wrench(body, couple=couple)
