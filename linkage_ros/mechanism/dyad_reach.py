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
from numpy.typing import NDArray

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
    """Computes the reach of the crank, with the dyads, as `Mechanism.reach` without them.

    Raises:
        MechanismError: A dyad does not close at any crank angle.
    """
    reach: Reach | None = mechanism.reach()
    if reach is None:
        return None
    reach = mechanism.in_own_terms(reach)
    if not mechanism.dyads:
        return reach
    loop, kinematics = mechanism.chain()
    arcs, period = _arcs_of_period(reach), math.tau * reach.period_turns
    limits, cures = list(reach.limits), list(reach.cures)
    for i, dyad in enumerate(mechanism.dyads):
        constants = Constants((Chain(loop, kinematics[:i]), kinematics[i]))
        margins = Program(_margins, constants, ('crank_angle',))
        size = kinematics[i].size
        arcs, worst = _closed_arcs(margins, arcs, size, period)
        if worst is None:
            continue
        if mechanism.drawn and reach.turns_fully and abs(worst.margin) < _LEAST * size:
            raise MechanismError(_in_line(mechanism, dyad, worst.crank))
        place = f'{worst.crank:.9g} m' if reach.slides else rad_and_deg(worst.crank)
        gap = mechanism.in_own_unit(_gap_words(dyad, worst))
        cure = f'change lengths or ends of {dyad.title}'
        if not arcs:
            raise MechanismError(
                f'{dyad.subject} not close anywhere in the reach of {reach.subject}, and come '
                f'nearest at {place}, {gap}; {cure}'
            )
        limits.append(f'{dyad.subject} not close at {place}, {gap}')
        cures.append(cure)
    if len(limits) == len(reach.limits):
        return reach
    if reach.period_turns == 1:
        arcs = [normalized(*arc) for arc in arcs]
    return reach._replace(arcs=tuple(arcs), limits=tuple(limits), cures=tuple(cures))


def _arcs_of_period(reach: Reach) -> list[Arc]:
    """Returns the arcs that a loop reaches in a period of its motion: the same in each turn."""
    if reach.turns_fully:
        return [(0.0, math.tau * reach.period_turns)]
    shifts = [math.tau * i for i in range(max(1, reach.period_turns))]
    return [(low + shift, high + shift) for shift in shifts for low, high in reach.arcs]


def stroke_of(mechanism: Any, what: str, name: str) -> Stroke:
    """Finds the ends of the stroke of a dyad's slider or rod.

    The far end of a slider's stroke is farther from the first pin of the link with the guide, or
    from the crank pivot; a rod is in its barrel there, as in an inverted slider-crank.

    See `Mechanism.stroke` for the arguments.

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
    positions = slide(np.array(reversals))[0].tolist()
    one, other = zip(positions, reversals, strict=True)
    link = structure.links[j]
    if link.parent == j - 1:  # a rod is far from its own pin where the cylinder is short
        is_far = positions[0] <= positions[1]
    else:
        distances = [abs(link.origin + cmath.rect(x, link.angle)) for x in positions]
        is_far = distances[0] >= distances[1]
    return Stroke(one, other) if is_far else Stroke(other, one)


def _reversals(rate: Callable[[Any], Any]) -> list[float]:
    """Finds the crank angles in a turn, rad, at which a rate changes its sign."""
    crank = (np.arange(_STEPS + 1) + 0.5) * (2 * math.pi / _STEPS)
    is_negative = rate(crank) < 0
    before = np.flatnonzero(is_negative[1:] != is_negative[:-1])  # the last samples before
    low, high = crank[before], crank[before + 1]
    for _ in range(_BISECTIONS if len(before) else 0):
        middle = 0.5 * (low + high)
        is_before = (rate(middle) < 0) == is_negative[before]
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


def _gap_words(dyad: Dyad, worst: _Worst) -> str:
    """Describes by how much a dyad does not close."""
    link, last = dyad.parts
    path = last if dyad.names or dyad.slider is None else 'the slider'
    size = dyad.first.length if dyad.first else abs(dyad.offset)
    if worst.margin >= -_LEAST * size:
        if dyad.barrel:
            return f'where the pins of {link} and {last} are nearest to each other'
        if dyad.second:
            return 'where they are in line'
        return f'where {link} is at right angles to the path of {path}'
    gap = f'{-worst.margin:.3g} m'
    if dyad.slider is not None:
        # A drawn pin that carries a further link gives the joint PIN_LINK.
        pin = dyad.pins[0].removesuffix(f'_{link}')
        return f'where {pin} is {gap} too far from the path of {path}'
    # The first margin of two links is that until they are stretched, the other until folded.
    is_too_far = dyad.barrel is None and worst.number == 0
    return f'where its ends are {gap} too {"far apart" if is_too_far else "near"}'


def _closed_arcs(
    margins: Callable[..., Any], arcs: Sequence[Arc], size: float, period: float
) -> tuple[list[Arc], _Worst | None]:
    """Finds the parts of arcs on which a dyad closes.

    Args:
        margins: Function that returns the margins of the dyad, m, at crank angles, rad.
        arcs: Arcs on which the loop and the dyads before close, rad.
        size: Size of the dyad, m.
        period: Length of an arc of whole turns, rad.

    Returns:
        The parts of the arcs; and None if these are the arcs, otherwise the sample with the
        smallest margin or, if the dyad closes nowhere, the largest.
    """
    least = _LEAST * size
    closed, sampled = list[Arc](), list[tuple[Array, Array]]()
    for low, high in arcs:
        is_ring = high - low == period
        crank, rows = _samples_with_minima(margins, (low, high), least, is_ring=is_ring)
        sampled.append((crank, rows))
        closes = rows.min(axis=0) > least
        ends = [low, *_edges(margins, crank, closes, least), high]
        # Parts on which the dyad closes alternate with parts on which it does not.
        parts = list(itertools.pairwise(ends))[0 if closes[0] else 1 :: 2]
        if is_ring and len(parts) > 1 and closes[0] and closes[-1]:
            # The last part continues the first.
            (_, end), *between, (start, _) = parts
            parts = [*between, (start, end + period)]
        closed += parts
    if closed == list(arcs):
        return closed, None
    crank, rows = (np.concatenate(each, axis=-1) for each in zip(*sampled, strict=True))
    smallest = rows.min(axis=0)
    i = int(smallest.argmin() if closed else smallest.argmax())
    return closed, _Worst(float(crank[i]), float(smallest[i]), int(rows[:, i].argmin()))


def _samples_with_minima(
    margins: Callable[..., Any], arc: Arc, error: float, *, is_ring: bool
) -> tuple[Array, Array]:
    """Returns the result of `_samples`, with the minima of each margin among the samples."""
    crank, rows = _samples(margins, arc, error, is_ring=is_ring)
    minima = _minima(margins, crank, rows, is_ring=is_ring)
    if is_ring:  # a minimum may be before the first sample
        low, high = arc
        minima = [low + (x - low) % (high - low) for x in minima]
    crank = np.unique(np.concatenate([crank, *minima]))
    return crank, np.array(margins(crank))


def _samples(
    margins: Callable[..., Any], arc: Arc, error: float, *, is_ring: bool
) -> tuple[Array, Array]:
    """Samples margins over an arc, with steps halved where a cubic does not predict their middle.

    `error` is the largest error of a prediction, m; a ring is an arc of whole turns.

    Returns:
        Crank angles in increasing order, rad, shape (samples,), and the margins there, m, shape
        (margins, samples).
    """
    low, high = arc
    count = _STEPS * max(1, round((high - low) / math.tau))
    place = np.linspace(-1.0, 1.0, count + 1)  # -1 at the start of the arc, 1 at its end
    rows = np.array(margins(_angles(arc, place, is_ring=is_ring)))
    steps = np.arange(count)  # those to test
    for _ in range(_HALVINGS):
        middle = 0.5 * (place[steps] + place[steps + 1])
        predicted = _predicted(place, rows, steps, middle, is_ring=is_ring)
        actual = np.array(margins(_angles(arc, middle, is_ring=is_ring)))
        is_off = (np.abs(predicted - actual) > error).any(axis=0)
        place = np.insert(place, steps + 1, middle)
        rows = np.insert(rows, steps + 1, actual, axis=1)
        # Each middle inserted before a step has moved it by one.
        halves = (steps + np.arange(len(steps)))[is_off]
        steps = np.stack([halves, halves + 1], axis=1).ravel()
        if not len(steps):
            break
    return _angles(arc, place, is_ring=is_ring), rows


def _angles(arc: Arc, place: Array, *, is_ring: bool) -> Array:
    """Returns the crank angles, rad, at places from -1 to 1 of an arc."""
    low, high = arc
    if not is_ring:  # near an end, the links move with the square root of the distance to it
        place = (1 - _INSIDE) * np.sin(0.5 * math.pi * place)
    return 0.5 * (low + high) + 0.5 * (high - low) * place


def _predicted(
    place: Array, rows: Array, steps: NDArray[np.intp], middle: Array, *, is_ring: bool
) -> Array:
    """Predicts margins in the middle of steps by a cubic through the four samples around it."""
    first = np.clip(steps - 1, 0, len(place) - 4)
    if is_ring:  # the sample before the first is the last but one, a period earlier
        place = np.concatenate([place[-2:-1] - 2.0, place, place[1:2] + 2.0])
        rows = np.concatenate([rows[:, -2:-1], rows, rows[:, 1:2]], axis=1)
        first = steps
    near = first + np.arange(4)[:, None]
    return _cubic(place[near], rows[:, near], middle)


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
    minima = []
    for number, row in enumerate(rows):
        is_lowest = (row[1:-1] <= row[:-2]) & (row[1:-1] <= row[2:])
        lowest = 1 + np.flatnonzero(is_lowest)
        minima.append(_refined(margins, number, crank[lowest - 1], crank[lowest + 1]))
    return minima


def _refined(margins: Callable[..., Any], number: int, low: Array, high: Array) -> Array:
    """Refines minima of one margin, each between two crank angles, rad, by finer grids."""
    column = np.arange(len(low))
    for _ in range(_ROUNDS if len(low) else 0):
        grid = np.linspace(low, high, _PARTS + 1)  # shape (_PARTS + 1, minima)
        values = np.array(margins(grid.ravel()))[number].reshape(grid.shape)
        best = values.argmin(axis=0)
        low = grid[np.maximum(best - 1, 0), column]
        high = grid[np.minimum(best + 1, _PARTS), column]
    return 0.5 * (low + high)


def _edges(margins: Callable[..., Any], crank: Array, closes: Array, least: float) -> list[float]:
    """Finds the crank angles between samples at which a dyad begins or ceases to close."""
    before = np.flatnonzero(closes[1:] != closes[:-1])
    low, high = crank[before], crank[before + 1]
    # The one of both at which the dyad closes, and the other.
    inside, outside = np.where(closes[before], (low, high), (high, low))
    for _ in range(_BISECTIONS if len(before) else 0):
        middle = 0.5 * (inside + outside)
        is_in = np.array(margins(middle)).min(axis=0) > least
        inside, outside = np.where(is_in, middle, inside), np.where(is_in, outside, middle)
    return [float(x) for x in inside]
