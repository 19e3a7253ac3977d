# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Dry friction in the pins and on the guide (Coulomb)."""

from __future__ import annotations

from dataclasses import dataclass

from linkage_ros.errors import ConfigurationError
from linkage_ros.quantities import Checked, quantity


@dataclass(frozen=True)
class Friction(Checked):
    """Dry friction: one coefficient and radius for all pins, and one coefficient for the guide.

    A pin resists the rotation of its two links with coefficient x radius x force, the guide the
    sliding with coefficient x normal force; both with 0 where nothing moves. The solver finds
    the forces (dynamics/friction.py).

    Attributes:
        pin: Coefficient of friction of the pins.
        pin_radius: Radius of the pins, m.
        guide: Coefficient of friction of the guide.
    """

    pin: float = quantity(
        'number', 'friction coefficient of the pins', span=(0.0, 100.0), default=0.0
    )
    pin_radius: float = quantity('number', 'radius of the pins', 'm', span=(0.0, 1e9), default=0.0)
    guide: float = quantity(
        'number', 'friction coefficient of the guide', span=(0.0, 100.0), default=0.0
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if bool(self.pin) != bool(self.pin_radius):
            raise ConfigurationError(
                f'friction.pin = {self.pin:g} with friction.pin_radius = {self.pin_radius:g}: '
                'give both above 0, or leave both out'
            )
