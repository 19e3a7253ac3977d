# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Interface and base class of loads.

Every load takes the same road: an `AppliedLoad` holds its parameters, and `AppliedLoad.on` gives
the `Load` that acts on a mechanism, which gives wrenches on bodies (`wrenches`). Torque, joint
forces, arrows and exports follow from these. In formulas, loads are named tuples of floats, in
which ZERO replaces absent terms.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, NamedTuple, Protocol

from linkage_ros.formulas import where
from linkage_ros.mechanism.kinematics import LinkPose, Stroke
from linkage_ros.mechanism.structure import Link, Pin, Structure
from linkage_ros.mechanism.wrenches import Wrench
from linkage_ros.numeric import Real
from linkage_ros.quantities import Checked, require_name, unlisted


class LoadedMechanism(Protocol):
    """The methods of a mechanism that loads use; `Mechanism` has them."""

    def structure(self) -> Structure:
        """Returns the links, points and pins."""

    def loaded_link(self, name: str, what: str) -> int:
        """Returns the index of a link that may carry a force along its guide, or a torque."""

    def swing_middle(self, what: str, near: float) -> float | None:
        """Returns the middle of the output link's swing, rad; None for a sliding link."""

    def swing_side(self) -> Real | None:
        """Returns the direction opposite to one that the output link never reaches, or None."""

    def stroke(self, what: str, name: str) -> Stroke:
        """Returns the stroke of a slider."""


class Load(Protocol):
    """Interface of a load: wrenches on bodies, computed from their motion.

    A load with corners or jumps (`AppliedLoad.has_corners`) also has a method `piece(links,
    rates)`. It returns the number of the smooth piece of the force, for arrays.
    """

    def wrenches(self, links: Sequence[LinkPose], rates: Sequence[Real]) -> list[Wrench]:
        """Computes the wrenches.

        Args:
            links: Poses of the links; only `position` and `direction` are set.
            rates: Velocities of the links, rad/s or m/s.

        Returns:
            The wrenches, in an order independent of the motion.
        """

    def potential(self, links: Sequence[LinkPose]) -> Real:
        """Returns the potential energy up to a constant, J; ZERO if the load has none."""


class Contact(NamedTuple):
    """A load caused by the force in a joint.

    Attributes:
        joint: Name of the pin or, for a guide, of its sliding link.
        levers: Load divided by joint force, by link index: m, or dimensionless for a sliding
            link. With two links, the load acts between them; with one, between that link and the
            frame.
    """

    joint: str
    levers: dict[int, Real]


class JointLoad(Protocol):
    """Interface of a load caused by joint forces, such as friction.

    These loads and the joint forces depend on each other and are solved together. With corners or
    jumps, there is also a method `piece(pins, links, rates)`; see `Load`.
    """

    def contacts(
        self, pins: Sequence[Pin], links: Sequence[Link], rates: Sequence[Real]
    ) -> list[Contact]:
        """Returns the loads per joint force.

        Args:
            pins: `Structure.pins` of the mechanism.
            links: `Structure.links` of the mechanism.
            rates: Velocities of the links, rad/s or m/s.

        Returns:
            A contact for each joint that causes a load, in an order independent of the rates.
        """


class Range(NamedTuple):
    """Positions of a link between two limits.

    Attributes:
        link: Index of the link.
        low: Lower limit, rad or m.
        high: Upper limit.
        middle: Middle of the link's swing, rad; None if its position is used unchanged. See
            `continuous`.
    """

    link: int
    low: float
    high: float
    middle: Real = None


@dataclass(frozen=True, kw_only=True)
class AppliedLoad(Checked):
    """Base class of the loads of a mechanism: frozen dataclasses of quantities.

    A parameter file gives a load under `loads`, with a name and one of the kinds in
    `linkage_ros.mechanism.loads.LOADS`.

    Attributes:
        has_corners: Whether the force, as a function of the motion, may have a corner or a jump.
        turns: Number of crank turns after which the load repeats.
        name: Name under `loads` in parameter files, in columns, arrows and exports. The mechanism
            gives a name to a load that has none.
    """

    has_corners: ClassVar[bool] = False
    turns: ClassVar[int] = 1

    name: str = unlisted('')

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.name:
            require_name('load', self.name)

    @property
    def label(self) -> str:
        """Start of the load's parameter names, without a dot, for error messages."""
        return f'loads.{self.name}' if self.name else type(self).__name__

    def completed(self) -> 'AppliedLoad':
        """Returns the load with the contents of its files; called when a mechanism is created.

        Values that depend on the mechanism belong in `on`, because copies with other lengths keep
        their loads.

        Raises:
            ConfigurationError: A file is missing or invalid.
        """
        return self

    def on(self, _mechanism: LoadedMechanism) -> Load | None:
        """Returns the load in the form used by formulas.

        Returns:
            The load; None if it is 0, or if joint forces cause all of it.

        Raises:
            ConfigurationError: The load does not fit the mechanism.
        """
        return None

    def in_joints(self, _mechanism: LoadedMechanism) -> JointLoad | None:
        """Returns the portion of the load caused by joint forces; None if there is none.

        Raises:
            ConfigurationError: The load does not fit the mechanism.
        """
        return None

    def valid_range(self, _mechanism: LoadedMechanism) -> Range | None:
        """Returns the positions beyond which the end values of the load apply, or None."""
        return None

    def one_way(self, _mechanism: LoadedMechanism) -> Range | None:
        """Returns the positions between which the link must not reverse, or None."""
        return None


def continuous(position: Real, middle: Real) -> Real:
    """Removes the jump from pi to -pi from the position of a link over its swing.

    Args:
        position: Direction in [-pi, pi], rad; for a sliding link, its position, m.
        middle: Middle of the link's swing, rad in [-pi, pi]; None for a sliding link.

    Returns:
        The direction within pi of the middle, rad; for a sliding link, its unchanged position, m.
    """
    if middle is None:
        return position
    apart, turn = position - middle, 2 * math.pi
    return position + where(apart > math.pi, -turn, where(apart < -math.pi, turn, 0.0))
