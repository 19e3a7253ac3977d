# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A force at a point of a link, constant or from messages."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, cast

from linkage_ros.errors import ConfigurationError
from linkage_ros.formulas import ZERO, Vector, dot, turned
from linkage_ros.mechanism.axes import spin_of
from linkage_ros.mechanism.kinematics import LinkPose
from linkage_ros.mechanism.loads.base import AppliedLoad, LoadedMechanism
from linkage_ros.mechanism.structure import Point
from linkage_ros.mechanism.wrenches import Wrench, place
from linkage_ros.numeric import Real
from linkage_ros.quantities import TOPIC_NAME, quantity

WORLD, LINK = 'world', 'link'


@dataclass(frozen=True)
class Force(AppliedLoad):
    """A force at a point of a link.

    Attributes:
        link: Name of the link; empty if `pin` is given.
        force: Force [x, y] on the link, N.
        at: Point [along, across] from the link's first pin, m; on a slider, from its pin in the
            axes of the guide; None for that pin.
        axes: Axes of `force`: 'world' for those of base_link, 'link' for along and across the
            link, or the guide.
        wrench_topic: Topic of messages with the force; empty for a constant force.
        wrench_timeout: Time for which a message acts, s. Without one, `force` acts.
        pin: Pin or traced point at which the force acts, instead of `link` and `at`.
    """

    link: str = quantity('text', 'link on which the force acts', default='')
    # Required; the default lets `link` be left out.
    force: tuple[float, float] = quantity(
        'pair', 'force [x, y] on the link', 'N', span=(-1e12, 1e12), default=None
    )
    at: tuple[float, float] | None = quantity(
        'pair', 'point [along, across] from the first pin of the link', 'm',
        span=(-1e9, 1e9), default=None,
    )  # fmt: skip
    axes: str = quantity(
        'choice', 'axes of the force: world, or along and across the link',
        choices=(WORLD, LINK), default=WORLD,
    )  # fmt: skip
    wrench_topic: str = quantity(
        'text', 'topic of the force while the node runs, in these axes; empty: none',
        pattern=TOPIC_NAME, default='',
    )  # fmt: skip
    wrench_timeout: float = quantity(
        'number', 'time for which a message acts; without one, force acts', 's',
        span=(1e-3, 1e9), default=0.1,
    )  # fmt: skip
    pin: str = quantity(
        'text', 'pin or point at which the force acts, instead of link and at', default=''
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if cast('Any', self.force) is None:
            raise ConfigurationError(f'{self.label}.force is missing: must be two numbers, N')

    def on(self, mechanism: LoadedMechanism) -> 'PointForce':
        """See `AppliedLoad.on`.

        Raises:
            ConfigurationError: The mechanism has no such link.
        """
        structure = mechanism.structure()
        link, point = structure.place_of(f'{self.label}.link', self.link, self.at, self.pin)
        turns = self.axes == LINK
        is_fixed = not turns or spin_of(structure.links, link) is None
        return PointForce(link, point, complex(*self.force), turns, is_fixed)


class PointForce(NamedTuple):
    """A force at a point, in the form used by formulas.

    Attributes:
        link: Index of the link.
        point: The point.
        force: The force, N; a `Vector` in formulas.
        turns_with_link: Whether the force is given in the axes of the link.
        is_fixed: Whether its direction is constant, so that it has a potential.
    """

    link: int
    point: Point
    force: Any
    turns_with_link: bool
    is_fixed: bool

    def _force(self, links: Sequence[LinkPose]) -> Vector:
        if not self.turns_with_link:
            return self.force  # type: ignore[no-any-return]
        return turned(links[self.link].direction, self.force.x, self.force.y)

    def wrenches(self, links: Sequence[LinkPose], _rates: Sequence[Real]) -> list[Wrench]:
        """See `Load`."""
        return [Wrench(self.link, force=self._force(links), point=self.point)]

    def potential(self, links: Sequence[LinkPose]) -> Real:
        """Returns the potential energy, J, or ZERO if the force turns with a link; see `Load`."""
        return -dot(self._force(links), place(self.point, links)) if self.is_fixed else ZERO
