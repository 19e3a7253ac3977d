# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How the links of a mechanism hang together: its joints, its points, its bodies.

Everything that is drawn, described to ROS, weighed or loaded reads this one description.
"""

from __future__ import annotations

from typing import NamedTuple


class Joint(NamedTuple):
    """A joint of the open tree in which ROS sees a mechanism.

    URDF has no closed loops. The loop is cut at the pin of the output link, B between coupler and
    rocker or slider, of a wind pump D between rod and slider. Every joint is measured from its
    parent in the tree: the coupler's from the crank, the rod's from the coupler.

    Attributes:
        name: Of the joint and of its child link.
        link: Index of the child link.
        parent: Index of the parent link; None: base_link.
        origin: Place of the joint in its parent, x + iy, m.
        angle: Direction of the joint's x axis in its parent, rad.
        slides: Whether it is prismatic, along that axis.
    """

    name: str
    link: int
    parent: int | None
    origin: complex
    angle: float = 0.0
    slides: bool = False


class Point(NamedTuple):
    """A point as a combination of the directions of the links that turn.

    Attributes:
        weights: The point is the sum of weights[j] e^(i phi_j), plus `fixed`, m; one for each
            moving link, 0 for one that slides.
        fixed: x + iy, m.
    """

    weights: tuple[complex, ...]
    fixed: complex = 0j


class TurningBody(NamedTuple):
    """A body that turns with a link.

    Attributes:
        link: Index of the link.
        mass: kg.
        inertia: About its centre of mass, kg m^2.
        center: Its centre of mass.
    """

    link: int
    mass: float
    inertia: float
    center: Point


class SlidingBody(NamedTuple):
    """A link that slides, the last of a mechanism.

    Attributes:
        link: Its index.
        mass: kg.
        force: External force along the guide, N.
        damping: N s/m.
        start: Of a free slider, whose place is a coordinate by itself: position, m, and
            velocity, m/s, at t = 0. Empty: the crank tells where it is.
    """

    link: int
    mass: float
    force: float
    damping: float
    start: tuple[float, ...] = ()


class Structure(NamedTuple):
    """A mechanism, without its motion.

    Attributes:
        joints: The open tree, in the order of the links.
        points: The pins A0, A, B and, where there are such, B0, D and the coupler point C.
        bodies: Those that turn.
        closure: The way around the loop but for what slides: its end is where the sliding link
            is, or where the way began.
        slider: The one that slides; None: there is none.
    """

    joints: tuple[Joint, ...]
    points: dict[str, Point]
    bodies: tuple[TurningBody, ...]
    closure: Point
    slider: SlidingBody | None = None

    @property
    def free_slider(self) -> SlidingBody | None:
        """The slider, if the crank does not tell where it is."""
        return self.slider if self.slider and self.slider.start else None

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the joints that tell where all links are: 'crank', and a free slider's."""
        return ('crank', self.joints[-1].name) if self.free_slider else ('crank',)
