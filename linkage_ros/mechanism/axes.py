# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Motion that follows from structure alone: links that turn together, and rigid links."""

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


def carriers_of(pins: Sequence[Any], links: Sequence[Any]) -> list[int | None]:
    """Finds the link with which each link is rigid.

    A dyad whose two ends are on one link, or on links that are rigid with each other, does not
    move relative to it.

    Args:
        pins: The pin joints, each a `structure.Pin`.
        links: The moving links of a mechanism, each a `structure.Link`.

    Returns:
        The index of that link for each link: its own if it moves, None for the frame.
    """
    joints = [(pin.first, pin.second) for pin in pins]
    joints += [(link.parent, j) for j, link in enumerate(links) if link.slides]
    found: list[int | None] = [*range(len(links))]

    def held(j: int, first: int) -> set[int | None]:
        others = (a if b == j else b for a, b in joints if j in {a, b})
        return {None if k is None else found[k] for k in others if k is None or k < first}

    for i in range(len(links) - 1):
        j = i + 1
        is_pair = (i, j) in joints or (j, i) in joints
        ends = held(i, i), held(j, i)
        if is_pair and all(ends) and len(ends[0] | ends[1]) == 1:
            (found[i],) = (found[j],) = ends[0]
    return found
