# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Motion that follows from structure alone: links that turn together, and rigid links.

`links` are the moving links of a mechanism, each a `structure.Link`.
"""

import itertools
from collections.abc import Sequence
from typing import Any


def spin_of(links: Sequence[Any], j: int) -> int | None:
    """Returns the index of the link whose angle gives the direction of link j.

    It is the link itself if that turns, and None if nothing that it slides on turns.
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
    spin = spin_of(links, j)
    angle = 0.0
    sliding: int | None = j
    while sliding is not None and sliding != spin:
        angle += links[sliding].angle
        sliding = links[sliding].parent
    return spin, angle if spin is None or angle else None


def carriers_of(pins: Sequence[Any], links: Sequence[Any]) -> list[int | None]:
    """Finds the link with which each link is rigid.

    A dyad whose two ends are on one link, or on links that are rigid with each other, does not
    move relative to it.

    Returns:
        The index of that link for each link: its own if it moves, None for the frame.
    """
    joints = [(pin.first, pin.second) for pin in pins]
    joints += [(link.parent, j) for j, link in enumerate(links) if link.slides]
    carriers: list[int | None] = [*range(len(links))]
    for i, j in itertools.pairwise(range(len(links))):
        if (i, j) not in joints and (j, i) not in joints:
            continue  # the two links are not a dyad
        first_ends = _carriers_before(i, _neighbours(i, joints), carriers)
        second_ends = _carriers_before(i, _neighbours(j, joints), carriers)
        ends = first_ends | second_ends
        if first_ends and second_ends and len(ends) == 1:
            (carriers[i],) = (carriers[j],) = ends
    return carriers


def _neighbours(j: int, joints: Sequence[tuple[int | None, int]]) -> list[int | None]:
    """Returns the links to which link j is joined; None is the frame."""
    return [one if other == j else other for one, other in joints if j in {one, other}]


def _carriers_before(
    i: int, neighbours: Sequence[int | None], carriers: Sequence[int | None]
) -> set[int | None]:
    """Returns the links with which those of the neighbours before link i are rigid."""
    return {None if k is None else carriers[k] for k in neighbours if k is None or k < i}
