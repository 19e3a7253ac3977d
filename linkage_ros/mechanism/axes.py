# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Directions of links: a link that slides turns with the one on which it slides."""

from collections.abc import Sequence
from typing import Any


def spin_of(links: Sequence[Any], j: int) -> int | None:
    """Returns the index of the link whose angle gives the direction of link j.

    Args:
        links: The moving links of a mechanism, each a `structure.Link`.
        j: Index of a link.

    Returns:
        The link itself if it turns; None if nothing that it slides on turns.
    """
    spin: int | None = j
    while spin is not None and links[spin].slides:
        spin = links[spin].parent
    return spin


def axes_of(links: Sequence[Any], j: int) -> tuple[int | None, float | None]:
    """Returns the direction from which the links that link j carries are measured.

    Returns:
        The result of `spin_of`, and the direction of the guide relative to that link, or in
        base_link, rad; None if it is the direction of a link.
    """
    angle, above = 0.0, j
    spin = spin_of(links, j)
    while above is not None and above != spin:
        angle += links[above].angle
        above = links[above].parent
    return spin, angle if spin is None or angle else None
