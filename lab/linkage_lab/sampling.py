# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Crank angles that resolve a period with all corners and jumps of its loads; integrals, peaks."""

import functools
import itertools
import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from typing import Any, cast

import numpy as np
from numpy.polynomial.chebyshev import chebvander

from linkage_lab.gaps import SAME, at_change_points
from linkage_ros import Solver, State, UnreachableError
from linkage_ros.formulas import Array
from linkage_ros.internals import poses

_BISECTIONS = 64  # halvings of a step, after which its ends differ only by rounding
_PARTS = 8  # least number of steps between two corners or jumps
# Values for the polynomial of a step, and the nodes and weights of Gauss that integrate it exactly
# over [-1, 1]. With six values, means of a machine with nearly singular positions change by 5e-9
# if it is turned as a whole.
_NEAR = 8
_NEAR_SLOPE = 6  # the same for slopes, which more values make worse where friction bends them
_GAUSS = np.polynomial.legendre.leggauss(_NEAR // 2)
# A search for peaks: order of the Chebyshev polynomials, parts of an interval, rounds, relative
# change at convergence, and most samples around which a function is searched.
_ORDER, _CELLS, _ROUNDS, _CLOSE, _TOPS = 10, 64, 24, 4e-15, 16
_DEGREES = np.arange(_ORDER + 1)
_NODES = -np.cos(math.pi / _ORDER * _DEGREES)
_TERMS = np.linalg.inv(chebvander(_NODES, _ORDER)).T  # values at the nodes @ this: coefficients
_FINE = chebvander(np.linspace(-1, 1, _CELLS + 1), _ORDER).T  # coefficients @ this: values
# Largest change of the force in a joint with friction from a sample to the next, relative to the
# smaller of both; and relative to the largest force, below which it has no effect.
_CHANGE, _SMALL = 0.125, 1e-9
_END = 1e-6  # least step next to a change point, rad
_EVEN = 1e-13  # a function with this relative range is constant but for rounding errors


def samples(
    solver: Solver, speed: float, steps_per_turn: int = 720, acceleration: float = 0.0
) -> Array:
    """Returns crank angles over one period; see `Reach.samples` and `with_breaks`.

    Corners of loads, and bends of friction, depend on the speed of the crank, rad/s, and on its
    acceleration, rad/s^2.
    """

    @functools.cache  # made only if `with_breaks` needs states
    def unloaded() -> Solver:
        return without_loads(solver)

    crank = solver.reach.samples(steps_per_turn)
    return with_breaks(crank, solver, lambda angles: unloaded().state(angles, speed, acceleration))


def without_loads(solver: Solver) -> Solver:
    """Returns a solver of the same motion, which loads and friction do not change."""
    return Solver(replace(cast('Any', solver.mechanism), loads=()))


def law_duration(solver: Solver, law: Any) -> int:
    """Computes the duration of a law or, if it repeats, of the period of motion, loads and law.

    Args:
        solver: Solver of the mechanism.
        law: The law of its driven joint.

    Returns:
        The duration, ns.
    """
    turns = abs(law.turns or 0)
    rounds = solver.reach.period_with(law_turns=turns) // turns if turns else 1
    return int(law.duration * rounds)


def with_breaks(crank: Array, solver: Solver, states: Callable[[Array], State]) -> Array:
    """Adds crank angles on both sides of each corner, jump or change point, and some in between.

    Args:
        crank: Crank angles in increasing order, rad.
        solver: Solver of the mechanism, with its loads.
        states: Function that computes the motion at crank angles.

    Returns:
        All crank angles in increasing order, rad.
    """
    pieces = _pieces(solver, states)
    if pieces is None:
        return crank
    breaks = _breaks(crank, pieces)
    if breaks.size:
        crank = _with_sides(crank, breaks)
    return _with_bends(crank, solver, states)


def _breaks(crank: Array, pieces: Callable[[Array], Array]) -> Array:
    """Finds both sides of each corner, jump or change point, in increasing order."""
    places, breaks = crank, np.empty(0)
    while True:
        numbers = pieces(places)
        differs = (numbers[:, 1:] != numbers[:, :-1]).any(axis=0)
        (steps,) = np.nonzero(differs & (np.diff(places) > SAME))
        if not steps.size:
            return breaks
        low, high = _bisected(pieces, places[steps], places[steps + 1], numbers[:, steps])
        breaks = np.unique([*breaks, *low, *high])
        places = np.unique([*places, *breaks])


def _bisected(
    pieces: Callable[[Array], Array], low: Array, high: Array, low_numbers: Array
) -> tuple[Array, Array]:
    """Narrows steps to neighbouring floats, between which the pieces change.

    Args:
        pieces: See `_pieces`.
        low: Lower ends of the steps, shape (k,).
        high: Upper ends of the steps, shape (k,).
        low_numbers: Numbers of the pieces at the lower ends, shape (m, k).
    """
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        # One more place, because programs compute one value by other functions than many; at a
        # corner, the last bit decides.
        numbers = pieces(np.append(middle, high[-1]))[:, :-1]
        is_low = (numbers == low_numbers).all(axis=0)
        low, high = np.where(is_low, middle, low), np.where(is_low, high, middle)
    return low, high


def _with_sides(crank: Array, breaks: Array) -> Array:
    """Adds breaks to crank angles, and even steps between each two breaks."""
    is_near = np.abs(crank[:, None] - breaks).min(axis=1) < SAME
    is_near[[0, -1]] = False
    even = [
        np.linspace(start, end, _PARTS + 1)
        for start, end in itertools.pairwise([crank[0], *breaks, crank[-1]])
        if end - start > SAME
    ]
    return np.unique(np.concatenate([crank[~is_near], breaks, *even]))


def _with_bends(crank: Array, solver: Solver, states: Callable[[Array], State]) -> Array:
    """Adds crank angles where the force in a joint with friction almost vanishes.

    The magnitude of the force, and with it the friction, then bends within a small angle. The same
    holds at a change point where friction limits the forces. If friction locks the mechanism, no
    angles are added.
    """
    rubbing, driven = _rubbing_joints(solver), solver.structure.driven
    if not rubbing:
        return crank

    def forces(angles: Array) -> Array:
        """Returns the forces in the joints with friction as x + iy, N, shape (joints, n)."""
        reactions = solver.reactions(states(angles))
        pins = [x + 1j * y for name, (x, y) in reactions.pins.items() if name in rubbing]
        guides = [x.force + 0j for name, x in reactions.guides.items() if name in rubbing]
        return np.array([*pins, *guides])

    state = states(crank)
    is_gap = at_change_points(solver, state.position[driven], state.velocity[driven])
    with suppress(UnreachableError):
        valid_forces = forces(crank[~is_gap])
        all_forces = np.full((len(valid_forces), len(crank)), np.nan + 0j)
        all_forces[:, ~is_gap] = valid_forces
        least = _SMALL * np.abs(valid_forces).max()
        while True:
            steps = _bent_steps(crank, all_forces, least)
            if not 0 < steps.size < len(crank) / 2:  # more are rounding errors
                break
            middle = 0.5 * (crank[steps] + crank[steps + 1])
            all_forces = np.insert(all_forces, steps + 1, forces(middle), axis=1)
            crank = np.insert(crank, steps + 1, middle)
    return crank


def _rubbing_joints(solver: Solver) -> set[str]:
    """Returns the names of the joints with friction."""
    model = solver.model
    still = [0.0] * len(model.links)
    return {
        contact.joint
        for load in model.joint_loads
        for contact in load.contacts(model.pins, model.links, still)
    }


def _bent_steps(crank: Array, forces: Array, least: float) -> Any:
    """Returns the indices of the steps that must be halved.

    In them, a force changes by much of its magnitude, or they end at a change point.

    Args:
        crank: Crank angles in increasing order, rad, shape (n,).
        forces: Forces as x + iy, N, NaN at change points, shape (joints, n).
        least: Smallest change of a force that has an effect, N.
    """
    size, change, step = np.abs(forces), np.abs(np.diff(forces)), np.diff(crank)
    smaller = np.minimum(size[:, 1:], size[:, :-1])
    is_bent = (change > np.maximum(_CHANGE * smaller, least)).any(axis=0)
    is_beside_gap = np.diff(np.isnan(forces[0]))
    (steps,) = np.nonzero((is_bent & (step > SAME)) | (is_beside_gap & (step > _END)))
    return steps


def _pieces(solver: Solver, states: Callable[[Array], State]) -> Callable[[Array], Array] | None:
    """Returns a function that finds, at crank angles or times, in which smooth piece each load is.

    At n places, the function returns piece numbers of shape (m, n): one row for each load with
    corners or jumps, and one for the side of a change point. Returns None if no row is needed.
    """
    model, mechanism = solver.model, solver.mechanism
    cornered = [load for load in mechanism.loads if load.has_corners]
    on_links: list[Any] = [found for load in cornered if (found := load.on(mechanism))]
    in_joints: list[Any] = [rub for load in cornered if (rub := load.in_joints(mechanism))]
    reach, driven = solver.mobility, solver.structure.driven
    has_change_point = reach is not None and reach.has_change_point
    if not (on_links or in_joints or has_change_point):
        return None

    def pieces(places: Array) -> Array:
        state = states(places)
        links = poses(model.links, state.position)
        rows = [load.piece(links, state.velocity) for load in on_links]
        rows += [load.piece(model.pins, model.links, state.velocity) for load in in_joints]
        if reach is not None and has_change_point:
            # Change points are at the angle `fast` or half a turn away.
            rows.append(np.sin(state.position[driven] - reach.fast) >= 0)
        return np.array(rows, dtype=float)

    return pieces


def peaks(x: Array, values: Array, curves: Callable[[Array], Array]) -> tuple[Array, Array]:
    """Finds the largest values of m functions over a period, to convergence, and where they are.

    Around each sample that may be next to the largest value, a function is expanded in Chebyshev
    polynomials. Until their last terms vanish, or the maximum no longer changes, only the interval
    next to the largest value is kept. The two sides of a corner or jump are searched separately.

    Args:
        x: Increasing places that resolve the functions, on both sides of each corner or jump,
            shape (n,).
        values: The functions there, shape (m, n).
        curves: The functions: values of shape (m, k) at places of shape (k,).

    Returns:
        The largest values, and their places, each of shape (m,).
    """
    # There are c candidates: each is a sample of one of the functions.
    function, sample = _tops(x, values)
    candidate = np.arange(len(function))
    low, high = _neighbors(x, sample)
    size = np.abs(values).max(axis=1)
    best, at = values[function, sample], x[sample]
    for _ in range(_ROUNDS):
        middle, half = 0.5 * (low + high), 0.5 * (high - low)
        places = middle[:, None] + half[:, None] * _NODES  # shape (c, nodes)
        places[:, 0], places[:, -1] = low, high  # beyond them, there may be a corner
        of_all = curves(places.ravel()).reshape(len(values), *places.shape)
        at_nodes = of_all[function, candidate]
        terms, best_before = at_nodes @ _TERMS, best
        node = at_nodes.argmax(axis=1)
        vertex, is_inside = _vertices(terms)
        # A Chebyshev polynomial of degree k is cos(k t) at cos(t).
        at_vertex = (terms * np.cos(np.arccos(vertex)[:, None] * _DEGREES)).sum(axis=1)
        best, at = at_nodes[candidate, node], places[candidate, node]
        at = np.where(is_inside, middle + half * vertex, at)
        best = np.where(is_inside, np.maximum(at_vertex, best), best)
        last_terms = np.abs(terms[:, -2:]).max(axis=1)
        error = np.minimum(8 * last_terms, np.abs(best - best_before))
        if (error <= _CLOSE * size[function]).all():
            break
        inner = np.minimum(np.maximum(node, 1), _ORDER - 1)
        low, high = places[candidate, inner - 1], places[candidate, inner + 1]
    chosen = list[int]()
    for i, noise in enumerate(_EVEN * size):
        own = np.flatnonzero(function == i)
        is_largest = best[own] >= best[own].max() - noise
        chosen.append(own[is_largest][0])
    return best[chosen], at[chosen]


def _vertices(terms: Array) -> tuple[Array, Any]:
    """Finds the largest values of Chebyshev polynomials, by parabolas through fine samples.

    Args:
        terms: Coefficients of the polynomials, shape (c, degrees).

    Returns:
        The places in [-1, 1], and whether the largest value is not at an end.
    """
    fine, polynomial = terms @ _FINE, np.arange(len(terms))
    largest = fine.argmax(axis=1)
    inner = np.minimum(np.maximum(largest, 1), _CELLS - 1)
    before, here, after = (fine[polynomial, inner + i] for i in (-1, 0, 1))
    bend = before - 2 * here + after
    is_maximum = bend < 0
    aside = 0.5 * (before - after) / np.where(is_maximum, bend, 1.0)  # in steps of the samples
    vertex = inner + np.where(is_maximum, aside, 0.0)
    is_inside = is_maximum & (vertex > 0) & (vertex < _CELLS)
    return np.clip(vertex, 0, _CELLS) * (2 / _CELLS) - 1, is_inside


def _neighbors(x: Array, sample: Any) -> tuple[Array, Array]:
    """Returns the places on both sides of samples, or their own at an end or a corner."""
    before, after = np.maximum(sample - 1, 0), np.minimum(sample + 1, len(x) - 1)
    low, here, high = x[before], x[sample], x[after]
    return np.where(here - low > SAME, low, here), np.where(high - here > SAME, high, here)


def _tops(x: Array, values: Array) -> tuple[Any, Any]:
    """Finds the samples that may be next to the largest value of each function.

    These are the largest sample, and local maxima whose bound reaches it. The bound of a function
    next to a sample is the sample's value plus the larger of its differences from its neighbours.

    Returns:
        The index of the function, and of the sample, of each, of shapes (c,).
    """
    changes = np.where(np.diff(x) > SAME, np.diff(values), 0.0)  # not over jumps
    none = np.zeros((len(values), 1))
    rise, fall = np.hstack([none, changes]), np.hstack([-changes, none])  # before and after each
    bound = values + np.maximum(rise, fall)
    noise = _EVEN * np.abs(values).max(axis=1, keepdims=True)
    is_maximum = (rise >= 0) & (fall >= 0) & (rise + fall > noise)
    is_top = is_maximum & (bound >= values.max(axis=1, keepdims=True))
    for i, bounds in enumerate(bound):
        if is_top[i].sum() > _TOPS:  # keep those with the largest bounds
            is_top[i] &= bounds >= np.partition(bounds[is_top[i]], -_TOPS)[-_TOPS]
    is_top[np.arange(len(values)), values.argmax(axis=1)] = True
    function, sample = np.nonzero(is_top)
    return function, sample


class _Steps:
    """A polynomial for each step between increasing places, through some values around it.

    Attributes:
        around: Indices of the places around each step, shape (n - 1, k).
    """

    def __init__(self, x: Array, count: int) -> None:
        """Computes Newton's coefficients of the polynomials of unit values.

        Args:
            x: The places, shape (n,).
            count: Number k of values for a polynomial, if there are so many.
        """
        count = min(count, len(x))
        first = np.clip(np.arange(1 - count // 2, len(x) - count // 2), 0, len(x) - count)
        self.around = first[:, None] + np.arange(count)
        self._x, self._nodes = x, x[self.around].T  # shape (k, n - 1)
        # Divided differences of the k values that are 1 at one place and 0 at the others:
        # shape (order, n - 1, k).
        self._terms = np.repeat(np.eye(count)[:, None], len(x) - 1, axis=1)
        for order in range(1, count):
            apart = self._nodes[order:] - self._nodes[:-order]
            self._terms[order:] = np.diff(self._terms[order - 1 :], axis=0) / apart[..., None]

    def at(self, places: Array) -> tuple[Any, Array, Array]:
        """Returns the steps of places, and the weights of values and slopes, shape (p, k)."""
        step = np.clip(np.searchsorted(self._x, places, side='right') - 1, 0, len(self._x) - 2)
        *lower, value = self._terms[:, step]
        slope = np.zeros_like(value)
        # Horner's method for Newton's form, from the highest term down.
        for node, term in zip(self._nodes[-2::-1, step], reversed(lower), strict=True):
            from_node = (places - node)[:, None]
            value, slope = value * from_node + term, slope * from_node + value
        return step, value, slope

    @functools.cached_property
    def areas(self) -> Array:
        """Weights of the integral over each step, shape (n - 1, k)."""
        half, middle = 0.5 * np.diff(self._x), 0.5 * (self._x[1:] + self._x[:-1])
        nodes, weights = _GAUSS
        _, values, _ = self.at(np.ravel(middle[:, None] + half[:, None] * nodes))
        return half[:, None] * np.tensordot(
            values.reshape(len(half), len(nodes), -1), weights, (1, 0)
        )

    @functools.cached_property
    def slopes(self) -> tuple[Any, Array]:
        """The steps of the places themselves, and the weights of the slopes there."""
        step, _, slopes = self.at(self._x)
        return step, slopes


def interpolated(x: Array, values: Array) -> Callable[[Array], Array]:
    """Interpolates m functions between samples, separately between corners and jumps."""
    parts = _smooth_parts(x.tobytes())
    starts = np.array([x[part.start] for part, _ in parts])

    def curves(places: Array) -> Array:
        part_of_place = np.clip(np.searchsorted(starts, places, side='right') - 1, 0, None)
        found = np.empty((len(values), len(places)))
        for i in np.unique(part_of_place):
            is_inside = part_of_place == i
            part, steps = parts[i]
            step, weights, _ = steps.at(places[is_inside])
            around = values[:, part][:, steps.around[step]]
            found[:, is_inside] = (around * weights).sum(axis=2)
        return found

    return curves


def derivative(crank: Array, values: Array) -> Array:
    """Differentiates values by the crank angle, separately between corners and jumps."""
    found = np.zeros_like(values)
    for part, steps in _smooth_parts(crank.tobytes(), _NEAR_SLOPE):
        step, weights = steps.slopes
        found[part] = (values[part][steps.around[step]] * weights).sum(axis=1)
    return found


def integral(crank: Array, values: Array) -> Array:
    """Integrates values over the crank angle, from the first angle to each angle."""
    areas = 0.5 * np.diff(crank) * (values[1:] + values[:-1])
    for part, steps in _smooth_parts(crank.tobytes()):
        around = values[part][steps.around]
        areas[part.start : part.stop - 1] = (around * steps.areas).sum(axis=1)
    return np.concatenate([[0.0], np.cumsum(areas)])


# Arrays are not hashable, hence the bytes. Sizing a flywheel differentiates and integrates many
# quantities at the same places; without the cache it takes three times as long.
@functools.lru_cache(4)
def _smooth_parts(places: bytes, count: int = _NEAR) -> list[tuple[slice, _Steps]]:
    """Finds the parts between corners and jumps, which have a crank angle on either side.

    Args:
        places: Crank angles in increasing order, rad, as bytes.
        count: See `_Steps`.

    Returns:
        The indices of the crank angles of each part, and their polynomials.
    """
    crank = np.frombuffer(places)
    cuts = [0, *(np.flatnonzero(np.diff(crank) < SAME) + 1).tolist(), len(crank)]
    parts = [slice(start, end) for start, end in itertools.pairwise(cuts) if end - start > 1]
    return [(part, _Steps(crank[part], count)) for part in parts]
