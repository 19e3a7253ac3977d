# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reach of the crank of a mechanism with dyads, found numerically.

The margin of a dyad is the distance by which its ends could be farther apart, or nearer, until it
does not close. It is sampled over the arcs on which the loop and the dyads before it close, with
steps so small that a cubic through the samples predicts it; its minima and its roots are then
refined. A whole turn is a ring, whose first sample follows its last.
"""

import cmath
import itertools
import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from linkage_ros.errors import ConfigurationError, MechanismError
from linkage_ros.mechanism.dyads import Chain, Dyad
from linkage_ros.mechanism.kinematics import Arc, Reach, Stroke
from linkage_ros.mechanism.program import Constants, Program
from linkage_ros.mechanism.transmission import normalized
from linkage_ros.numeric import Array, Real
from linkage_ros.units import rad_and_deg

_STEPS = 720  # samples per turn, at least
_HALVINGS = 16  # of a step; the smallest is 1e-7 rad
_INSIDE = 1e-9  # distance from the ends of an arc of the loop, relative to the arc
_LEAST = 1e-9  # a margin below this part of the dyad's size is that of a dyad in line
_BISECTIONS = 60
_PARTS, _ROUNDS = 8, 12  # each round divides an interval into this number of parts


class _Worst(NamedTuple):
    """The sample at which a dyad is closest to not closing or, if it closes nowhere, to closing.

    Attributes:
        crank: Crank angle, rad, or position of a driven slide, m.
        margin: Smallest margin of the dyad there, m; negative if it does not close.
        number: Index of this margin in `margins` of the dyad.
    """

    crank: float
    margin: float
    number: int


def reach_of(mechanism: Any) -> Reach | None:
    """Computes the reach of the crank, with the dyads.

    Args:
        mechanism: The mechanism.

    Returns:
        The reach; None if the crank angle does not determine the motion.

    Raises:
        MechanismError: A dyad does not close at any crank angle.
    """
    reach: Reach | None = mechanism.reach()
    if reach is not None and mechanism.drawn:
        driven = mechanism.structure().driven_link.name
        reach = reach.renamed(driven, mechanism.in_own_names)
    if reach is None or not mechanism.dyads:
        return reach
    loop, dyads = mechanism.chain()
    turn = 2 * math.pi * reach.period_turns
    arcs = [(0.0, turn)]
    if not reach.turns_fully:  # the loop reaches the same arcs in each turn of a period
        shifts = [math.tau * i for i in range(max(1, reach.period_turns))]
        arcs = [(low + shift, high + shift) for shift in shifts for low, high in reach.arcs]
    limits, cures = list(reach.limits), list(reach.cures)
    for i, (dyad, given) in enumerate(zip(dyads, mechanism.dyads, strict=True)):
        constants = Constants((Chain(loop, dyads[:i]), dyad))
        margins = Program(_margins, constants, ('crank_angle',))
        arcs, worst = _closed_arcs(margins, arcs, dyad.size, turn)
        if worst is None:
            continue
        if mechanism.drawn and reach.turns_fully and abs(worst.margin) < _LEAST * dyad.size:
            raise MechanismError(_in_line(mechanism, given, worst.crank))
        words = _words(given, worst)
        place = f'{worst.crank:.9g} m' if reach.slides else rad_and_deg(worst.crank)
        limits.append(f'{given.subject} not close at {place}, {words}')
        cures.append(f'change lengths or ends of {given.title}')
        if not arcs:
            raise MechanismError(
                f'{given.subject} not close anywhere in the reach of {reach.subject}, and come '
                f'nearest at {place}, {words}; {cures[-1]}'
            )
    if len(limits) == len(reach.limits):
        return reach
    found = tuple(normalized(*arc) if reach.period_turns == 1 else arc for arc in arcs)
    return reach._replace(arcs=found, limits=tuple(limits), cures=tuple(cures))


def stroke_of(mechanism: Any, what: str, name: str) -> Stroke:
    """Finds the ends of the stroke of a dyad's slider or rod.

    The far end of a slider's stroke is farther from the first pin of the link with the guide, or
    from the crank pivot; a rod is in its barrel there, as in an inverted slider-crank.

    Args:
        mechanism: The mechanism.
        what: Name of the setting, for the error message.
        name: Name of the slider.

    Raises:
        ConfigurationError: The crank cannot turn fully, or the slider does not reverse twice.
    """
    reach, structure = reach_of(mechanism), mechanism.structure()
    j = structure.link_index(name, what)
    slide = Program(_slide, Constants((mechanism.chain(), j)), ('crank_angle',))
    has_period = reach is not None and reach.turns_fully and reach.period_turns == 1
    reversals = _reversals(lambda crank: slide(crank)[1]) if has_period else []
    if len(reversals) != 2:
        raise ConfigurationError(
            f'{what}: the stroke of {name} has no fixed ends, because the crank cannot turn '
            'fully, or the slider does not reverse once at each end in a turn; use a load over '
            'position, or crank_angle'
        )
    places = slide(np.array(reversals))[0].tolist()
    link = structure.links[j]

    def distance(end: tuple[float, float]) -> float:
        if link.parent == j - 1:  # a piston is far from the rod's pin where the barrel is short
            return -end[0]
        return float(abs(link.origin + cmath.rect(end[0], link.angle)))

    ends = sorted(zip(places, reversals, strict=True), key=distance, reverse=True)
    return Stroke(*ends)


def _reversals(rate: Callable[[Any], Any]) -> list[float]:
    """Finds the crank angles in a turn, rad, at which a rate changes its sign."""
    crank = (np.arange(_STEPS + 1) + 0.5) * (2 * math.pi / _STEPS)
    falls = rate(crank) < 0
    at = np.flatnonzero(falls[1:] != falls[:-1])
    low, high = crank[at], crank[at + 1]
    for _ in range(_BISECTIONS if len(at) else 0):
        middle = 0.5 * (low + high)
        is_before = (rate(middle) < 0) == falls[at]
        low, high = np.where(is_before, middle, low), np.where(is_before, high, middle)
    return list(high.tolist())


def _slide(constants: Any, crank: Real) -> tuple[Real, Real]:
    loop, j = constants
    link = loop.pose((crank,)).links[j]
    return link.position, link.jacobian[0]


def _margins(constants: Any, crank: Real) -> tuple[Real, ...]:
    loop, dyad = constants
    found: tuple[Real, ...] = dyad.margins(loop.pose((crank,)).links)
    return found


def _in_line(mechanism: Any, dyad: Dyad, crank: float) -> str:
    """Explains why a dyad that is in line once in a turn, as the loop may be, is refused."""
    return (
        f'{dyad.title} are in line at {rad_and_deg(crank)}, where their motion is undetermined; '
        f'only the loop of the input, {", ".join(mechanism.drawn.links)}, may turn through such a '
        f'position; leave {dyad.title} out, or move one of their pins'
    )


def _words(dyad: Dyad, worst: _Worst) -> str:
    """Describes by how much a dyad does not close."""
    gap, (link, last) = f'{-worst.margin:.3g} m', dyad.parts
    path = last if dyad.names or dyad.slider is None else 'the slider'
    if worst.margin >= -_LEAST * (dyad.first.length if dyad.first else abs(dyad.offset)):
        if dyad.barrel:
            return f'where the pins of {link} and {last} are nearest to each other'
        if dyad.second:
            return 'where they are in line'
        return f'where {link} is at right angles to the path of {path}'
    if dyad.slider is not None:
        # A drawn pin that carries a further link gives the joint PIN_LINK.
        pin = dyad.pins[0].removesuffix(f'_{link}')
        return f'where {pin} is {gap} too far from the path of {path}'
    # Two links have one margin until they are stretched, then one until they are folded.
    is_too_far = dyad.barrel is None and worst.number == 0
    return f'where its ends are {gap} too {"far apart" if is_too_far else "near"}'


def _closed_arcs(
    margins: Callable[..., Any], arcs: Sequence[Arc], size: float, turn: float
) -> tuple[list[Arc], _Worst | None]:
    """Finds the parts of arcs on which a dyad closes.

    Args:
        margins: Function that returns the margins of the dyad, m, at crank angles, rad.
        arcs: Arcs on which the loop and the dyads before close, rad.
        size: Size of the dyad, m.
        turn: Length of an arc of whole turns, rad.

    Returns:
        The parts of the arcs; and None if these are the arcs, otherwise the sample with the
        smallest margin or, if the dyad closes nowhere, the largest.
    """
    least, found = _LEAST * size, list[Arc]()
    seen = list[tuple[Array, Array]]()
    for low, high in arcs:
        is_whole = high - low == turn
        crank, rows = _samples(margins, (low, high), least, is_ring=is_whole)
        minima = _minima(margins, crank, rows, is_ring=is_whole)
        if is_whole:
            minima = [low + (x - low) % turn for x in minima]
        crank = np.unique(np.concatenate([crank, *minima]))
        rows = np.array(margins(crank))
        seen.append((crank, rows))
        closes = rows.min(axis=0) > least
        ends = [low, *_edges(margins, crank, closes, least), high]
        parts = list(itertools.pairwise(ends))[0 if closes[0] else 1 :: 2]
        if is_whole and len(parts) > 1 and closes[0] and closes[-1]:
            (_, end), *others = parts
            parts = [*others[:-1], (others[-1][0], end + high - low)]
        found += parts
    if found == list(arcs):
        return found, None
    crank, rows = (np.concatenate(each, axis=-1) for each in zip(*seen, strict=True))
    smallest = rows.min(axis=0)
    i = int(smallest.argmin() if found else smallest.argmax())
    return found, _Worst(float(crank[i]), float(smallest[i]), int(rows[:, i].argmin()))


def _samples(
    margins: Callable[..., Any], arc: Arc, error: float, *, is_ring: bool
) -> tuple[Array, Array]:
    """Samples margins over an arc, with steps halved where a cubic does not predict their middle.

    Args:
        margins: Function that returns margins, m, at crank angles, rad.
        arc: The arc, rad.
        error: Largest error of a prediction, m.
        is_ring: Whether the arc is a period of whole turns.

    Returns:
        Crank angles in increasing order, rad, shape (samples,), and the margins there, m, shape
        (margins, samples).
    """
    low, high = arc

    def angles(place: Array) -> Array:
        if not is_ring:  # near an end, the links move with the square root of the distance to it
            place = (1 - _INSIDE) * np.sin(0.5 * math.pi * place)
        return 0.5 * (low + high) + 0.5 * (high - low) * place

    place = np.linspace(-1.0, 1.0, _STEPS * max(1, round((high - low) / math.tau)) + 1)
    rows = np.array(margins(angles(place)))
    steps = np.arange(len(place) - 1)  # those to test
    for _ in range(_HALVINGS):
        x, y = place, rows
        if is_ring:
            x = np.concatenate([x[-2:-1] - 2.0, x, x[1:2] + 2.0])
            y = np.concatenate([y[:, -2:-1], y, y[:, 1:2]], axis=1)
        middle = 0.5 * (place[steps] + place[steps + 1])
        first = steps if is_ring else np.clip(steps - 1, 0, len(x) - 4)
        near = first + np.arange(4)[:, None]
        found = np.array(margins(angles(middle)))
        is_off = (np.abs(_cubic(x[near], y[:, near], middle) - found) > error).any(axis=0)
        # The middle of the step i of those tested becomes the sample steps[i] + 1 + i.
        place = np.insert(place, steps + 1, middle)
        rows = np.insert(rows, steps + 1, found, axis=1)
        halves = (steps + np.arange(len(steps)))[is_off]
        steps = np.stack([halves, halves + 1], axis=1).ravel()
        if not len(steps):
            break
    return angles(place), rows


def _cubic(x: Array, y: Array, at: Array) -> Array:
    """Evaluates cubics through four points each; x of shape (4, n), y of shape (..., 4, n)."""
    total = np.zeros(y.shape[:-2] + at.shape)
    for i in range(4):
        others = [j for j in range(4) if j != i]
        total += y[..., i, :] * np.prod((at - x[others]) / (x[i] - x[others]), axis=0)
    return total


def _minima(
    margins: Callable[..., Any], crank: Array, rows: Array, *, is_ring: bool
) -> list[Array]:
    """Refines the minima of each margin; in a ring, some may be before its first sample."""
    if is_ring:
        crank = np.concatenate([crank[-2:-1] - (crank[-1] - crank[0]), crank])
        rows = np.concatenate([rows[:, -2:-1], rows], axis=1)
    else:  # nothing is beyond the ends
        crank = np.pad(crank, 1, mode='edge')
        rows = np.pad(rows, ((0, 0), (1, 1)), constant_values=math.inf)
    found = []
    for i, row in enumerate(rows):
        inner = 1 + np.flatnonzero((row[1:-1] <= row[:-2]) & (row[1:-1] <= row[2:]))
        low, high = crank[inner - 1], crank[inner + 1]
        for _ in range(_ROUNDS if len(inner) else 0):
            grid = np.linspace(low, high, _PARTS + 1)
            best = np.array(margins(grid.ravel()))[i].reshape(grid.shape).argmin(axis=0)
            column = np.arange(len(inner))
            low, high = (
                grid[np.maximum(best - 1, 0), column],
                grid[np.minimum(best + 1, _PARTS), column],
            )
        found.append(0.5 * (low + high))
    return found


def _edges(margins: Callable[..., Any], crank: Array, closes: Array, least: float) -> list[float]:
    """Finds the crank angles between samples at which a dyad begins or ceases to close."""
    at = np.flatnonzero(closes[1:] != closes[:-1])
    inside, outside = (np.where(closes[at] == x, crank[at], crank[at + 1]) for x in (True, False))
    for _ in range(_BISECTIONS if len(at) else 0):
        middle = 0.5 * (inside + outside)
        is_in = np.array(margins(middle)).min(axis=0) > least
        inside, outside = np.where(is_in, middle, inside), np.where(is_in, outside, middle)
    return [float(x) for x in inside]
