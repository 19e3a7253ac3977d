# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where the plane of a linkage is on a robot."""

from dataclasses import dataclass

import numpy as np

from linkage_ros.errors import ConfigurationError
from linkage_ros.numeric import Array
from linkage_ros.quantities import Checked, quantity, shown

_SPAN = (-1e9, 1e9)
_UNIT = 1e-6  # largest error of an axis that is taken as one of length 1, and as perpendicular


@dataclass(frozen=True)
class Plane(Checked):
    """The axes of frame_id in a link of the robot, which launch files publish for tf.

    The directions x and y have length 1, and are perpendicular.
    """

    link: str = quantity('text', "robot's link that carries frame_id", pattern='.+')
    origin: tuple[float, ...] = quantity(
        'list', 'origin of frame_id in that link, x, y and z', 'm', span=_SPAN,
        default=(0.0, 0.0, 0.0),
    )  # fmt: skip
    x: tuple[float, ...] = quantity(
        'list', 'direction of its x axis in that link', span=(-1.0, 1.0), default=(1.0, 0.0, 0.0)
    )
    y: tuple[float, ...] = quantity(
        'list', 'direction of its y axis in that link', span=(-1.0, 1.0), default=(0.0, 1.0, 0.0)
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ('origin', 'x', 'y'):
            if len(value := getattr(self, name)) != 3:
                raise ConfigurationError(f'plane.{name} = {shown(value)}: must be 3 numbers')
        axes = np.array([self.x, self.y])
        if not np.allclose(axes @ axes.T, np.eye(2), rtol=0.0, atol=_UNIT):
            raise ConfigurationError(
                f'plane.x = {shown(self.x)}, plane.y = {shown(self.y)}: must be perpendicular, '
                'each of length 1'
            )

    def axes(self) -> Array:
        """Returns the axes x, y and normal of the plane in the link, as columns."""
        return np.column_stack([self.x, self.y, np.cross(self.x, self.y)])
