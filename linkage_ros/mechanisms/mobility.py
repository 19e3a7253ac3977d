# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Which way a mechanism can move: its class and the reach of its crank."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple, NoReturn

from linkage_ros.errors import UnreachableError
from linkage_ros.mechanisms.registry import Linkage
from linkage_ros.mechanisms.transmission import Arc, TransmissionMap
from linkage_ros.numeric import is_rounding


class Mobility(NamedTuple):
    """How a mechanism can move.

    Attributes:
        grashof: Class, such as 'crank-rocker' or 'change-point'; see the mechanism's.
        turns_fully: Whether the crank turns through every angle.
        period_turns: Turns of the crank after which the motion repeats.
        arcs: Where the crank can be, (from, to) with from in [0, 2 pi), rad; the whole turn
            where it turns fully.
        limits: What stops the crank; empty where it turns fully.
        cures: What would make it turn, each by itself; empty where it does.
        equalities: Sums of lengths that are not 0 in binary and count as 0, in words.
    """

    grashof: str
    turns_fully: bool
    period_turns: int
    arcs: tuple[Arc, ...]
    limits: tuple[str, ...]
    cures: tuple[str, ...]
    equalities: tuple[str, ...]


def assess(mechanism: Linkage, transmission: TransmissionMap) -> Mobility:
    """Classifies a mechanism and finds the reach of its crank in closed form.

    Args:
        mechanism: The mechanism.
        transmission: Its map from the crank to the transmission angle.

    Returns:
        Its mobility.
    """
    return Mobility(
        mechanism.grashof,
        transmission.turns_fully,
        transmission.period_turns,
        transmission.arcs(),
        tuple(mechanism.limits(far=transmission.p < 0, near=transmission.q < 0)),
        () if transmission.turns_fully else tuple(mechanism.cures()),
        tuple(equalities(mechanism)),
    )


def refusal(mobility: Mobility, purpose: str) -> str:
    """Why the crank cannot do something, in one line.

    Args:
        mobility: Of a mechanism whose crank does not turn fully.
        purpose: What it cannot do, such as 'turn fully' or 'reach 57.3 deg'.

    Returns:
        The class, the cause, the cures and the reachable arcs in degrees.
    """
    arcs = ' and '.join(
        f'{math.degrees(start):.6g} to {math.degrees(end):.6g} deg' for start, end in mobility.arcs
    )
    return (
        f'the crank of this {mobility.grashof} linkage cannot {purpose}: '
        f'{"; ".join(mobility.limits)}; {" or ".join(mobility.cures)}; it reaches {arcs}'
    )


def refuse(mobility: Mobility, crank: float) -> NoReturn:
    """Refuses a crank angle at which no state, or no finite rate, exists.

    Args:
        mobility: Of the mechanism.
        crank: rad.

    Raises:
        UnreachableError: With the class, the cause, the cures and the reachable arcs.
    """
    purpose = f'move at {math.degrees(crank):.9g} deg'
    raise UnreachableError(refusal(mobility, purpose), crank_angle=crank, arcs=mobility.arcs)


def equalities(mechanism: Linkage) -> Iterator[str]:
    """Sums of lengths that are not 0 in binary and count as 0, in words."""
    for words, terms in mechanism.sums.items():
        total = math.fsum(terms)
        if total and is_rounding(mechanism.longest, total):
            yield f'{words} = {total:.2g} m counts as 0'
