# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Points of links that are traced: drawn with their paths, published and logged."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from linkage_ros.errors import ConfigurationError, Mistakes
from linkage_ros.mechanism.structure import Structure
from linkage_ros.quantities import Checked, groups, quantity, require_name, required, shown


@dataclass(frozen=True)
class TracedPoint(Checked):
    """A point of a link whose motion is of interest.

    Attributes:
        name: Name of the point, in topics, columns and pictures.
        link: Link that carries the point.
        at: The point, [along, across] from the link's first pin, m; on a sliding link, from its
            pin in the axes of its guide; None for that pin.
    """

    name: str = required()
    link: str = quantity('text', 'link that carries the point')
    at: tuple[float, float] | None = quantity(
        'pair', 'point [along, across] on its link', 'm', span=(-1e9, 1e9), default=None
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        require_name('point', self.name)


def points_field() -> Any:
    """Declares the field of a mechanism that holds its traced points."""
    return groups(TracedPoint, {'': TracedPoint})


def with_points(structure: Structure, points: Sequence[TracedPoint]) -> Structure:
    """Returns a structure with traced points after its pins.

    Args:
        structure: Structure with all links.
        points: The points.

    Raises:
        ConfigurationError: A link is unknown, or a name is already in use.
    """
    mistakes, all_points = Mistakes(), dict(structure.points)
    taken = {*all_points, *(link.name for link in structure.links), 'frame'}
    for point in points:
        with mistakes:
            if point.name in taken:
                raise ConfigurationError(
                    f'point {shown(point.name)}: a link, a pin or another point has this name; '
                    'give it another one'
                )
            taken.add(point.name)
            link = structure.link_index(point.link, f'points.{point.name}.link')
            all_points[point.name] = structure.point_of(link, point.at or (0.0, 0.0))
    mistakes.check()
    return structure._replace(points=all_points, traced={x.name: x.link for x in points})
