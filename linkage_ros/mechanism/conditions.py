# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Conditions under which a state is computed: gravity, a turning base_link, forces of loads."""

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

from linkage_ros.errors import ConfigurationError
from linkage_ros.numeric import Real
from linkage_ros.quantities import shown

# Force (x, y) of each load, N, by its name; and the same in the order of the names.
Forces: TypeAlias = Mapping[str, Sequence[Real]]
NamedForces: TypeAlias = tuple[tuple[str, tuple[Real, Real]], ...]

_GRAVITY = 'gravity_x', 'gravity_y'
_FRAME = 'frame_angle', 'frame_speed', 'frame_acceleration'


@dataclass(frozen=True, init=False)
class Conditions:
    """External conditions that replace or add to those of the mechanism.

    The values are floats, or arrays that broadcast with the coordinates.

    Attributes:
        gravity: Acceleration of gravity (x, y), m/s^2, in the axes of base_link at direction 0;
            None for that of the mechanism.
        frame: Direction of base_link, rad, its rate, rad/s, and its acceleration, rad/s^2, if it
            turns about `Solver.pivot`; None if it is at rest.
        forces: Forces (x, y), N, that replace those of loads of kind force, as pairs of a load's
            name and its force, in the order of the names.
    """

    gravity: tuple[Real, Real] | None
    frame: tuple[Real, Real, Real] | None
    forces: NamedForces

    def __init__(
        self,
        gravity: Sequence[Real] | None = None,
        frame: Sequence[Real] | None = None,
        forces: Forces | NamedForces = (),
    ) -> None:
        """Collects the conditions; see the attributes. `forces` may be a mapping.

        Raises:
            ConfigurationError: The number of values is wrong.
        """
        rows = {
            'gravity': _row('gravity', gravity, 2, '(x, y), m/s^2'),
            'frame': _row('frame', frame, 3, '(angle, speed, acceleration)'),
            'forces': tuple(
                (name, _row(f'forces: {name}', force, 2, '[x, y], N'))
                for name, force in sorted(dict(forces).items())
            ),
        }
        for field, value in rows.items():
            object.__setattr__(self, field, value)

    def __bool__(self) -> bool:
        return self.gravity is not None or self.frame is not None or bool(self.forces)

    @functools.cached_property
    def names(self) -> tuple[tuple[str, ...], tuple[str, ...], tuple[tuple[str, ...], ...]]:
        """Names of the values: of gravity, of the frame's motion, and of each force."""
        return (
            () if self.gravity is None else _GRAVITY,
            () if self.frame is None else _FRAME,
            tuple((f'{name}_x', f'{name}_y') for name, _ in self.forces),
        )

    @functools.cached_property
    def values(self) -> list[Real]:
        """All values in the order of `names`."""
        forces = (x for _, force in self.forces for x in force)
        return [*(self.gravity or ()), *(self.frame or ()), *forces]


def _row(name: str, values: Any, count: int, words: str) -> tuple[Any, ...] | None:
    """Converts a sequence to a tuple; returns None for None.

    Raises:
        ConfigurationError: The number of values is not `count`.
    """
    if values is None:
        return None
    row = tuple(values) if hasattr(values, '__len__') and not isinstance(values, str) else ()
    if len(row) != count:
        raise ConfigurationError(f'{name} = {shown(values)}: must be {words}')
    return row


OWN_CONDITIONS = Conditions()
