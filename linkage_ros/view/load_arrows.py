# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Arrows for loads: straight for forces, curved about the pivot for torques.

`positions` and `rates` are those of the links in n states, rad and m, and per second, of shape
(n, links). Points are x + iy, m.
"""

import cmath
import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple, TypeAlias, cast

import numpy as np
import numpy.typing as npt

from linkage_ros.mechanism.axes import axes_of
from linkage_ros.mechanism.base import Mechanism
from linkage_ros.mechanism.kinematics import State
from linkage_ros.mechanism.solver import Solver
from linkage_ros.mechanism.structure import Link
from linkage_ros.numeric import Array

Complex: TypeAlias = npt.NDArray[np.complexfloating[Any, Any]]

# In marks (see `picture`): length of the longest straight arrow, and its distance from the
# slider's pin; radius of a curved arrow; length of an arrow's head.
_LONGEST, _BESIDE_PIN, _RADIUS, _HEAD = 6.0, 1.5, 2.6, 0.9
_SWEEP = np.linspace(0.0, 1.5 * math.pi, 25)  # angle of the longest curved arrow, rad
# The head of an arrow along the x axis, from its tip.
_SIDES = np.array([cmath.rect(1.0, math.pi - 0.45), 0.0, cmath.rect(1.0, math.pi + 0.45)])
_HARDLY = 1e-300  # a rate with a sign but negligible damping force


def placed(links: Sequence[Link], weights: Array, fixed: Array, positions: Array) -> Complex:
    """Computes the positions of points, shape (n, points), m; see `structure.Point`.

    Args:
        links: The moving links.
        weights: Weights of the points, shape (points, links), m.
        fixed: Constant terms, shape (points,), m.
        positions: Positions of the links.
    """
    # A slider's position is not an angle, but no point depends on it: its weights are 0.
    turned = np.exp(1j * np.where([link.slides for link in links], 0.0, positions))
    return np.asarray(turned @ weights.T + fixed)


class _Load(NamedTuple):
    """A load in n states.

    Attributes:
        size: Couple, N m, or force along a guide, N, shape (n,); of a force at a point, its
            components x + iy, N.
        at: The point of a force, m, shape (n,); otherwise None.
    """

    size: Complex | Array
    at: Complex | None = None


class LoadArrows:
    """Arrows for the loads on links, except loads that depend on joint forces.

    A force that messages replace is drawn as given in the parameters.

    The longest arrow corresponds to the largest load so far; loads that do not depend on speed are
    known from the start.

    Attributes:
        names: Names of the arrows: that of a link for its effort, or that of a force at a point;
            see `wrenches.Exerted`.
        reach: Corners of the area that arrows at points may cover, shape (n,).
    """

    def __init__(self, mechanism: Mechanism, mark: float, positions: Array) -> None:
        """Finds the links with loads, and the largest loads at a negligible speed.

        Args:
            mechanism: Mechanism whose loads are shown.
            mark: Unit of the sizes of arrows, m.
            positions: Positions that the links can take.
        """
        # Friction depends on joint forces, and so on accelerations; only rates are known here.
        loads = tuple(load for load in mechanism.loads if not load.in_joints(mechanism))
        self._solver, self._mark = Solver(replace(cast('Any', mechanism), loads=loads)), mark
        self._largest: dict[str, float] = {}  # magnitude of each load so far, N or N m
        feet = [np.empty(0, complex)]  # of forces at points
        for rate in (_HARDLY, -_HARDLY):
            exerted = self._exerted(positions, np.full_like(positions, rate))
            for name, load in exerted.items():
                self._largest_so_far(name, load.size)
                if load.at is not None:
                    feet.append(load.at)
        self.names = tuple(self._largest)
        corner = _LONGEST * mark * (1 + 1j)
        places = np.concatenate(feet)
        self.reach = np.concatenate([places + corner, places - corner])
        # Straight arrows are on the far side of a slider, where they overlap no link.
        self._sides = {
            j: math.copysign(1.0, positions[:, j].mean())
            for j, link in enumerate(self._solver.structure.links)
            if link.slides
        }

    def _outwards(self, j: int, positions: Array) -> Complex:
        """Returns the direction of straight arrows from a slider's pin, shape (n,) or ()."""
        spin, guide = axes_of(self._solver.structure.links, j)
        angle = 0.0 if spin is None else positions[:, spin]
        return np.asarray(self._sides[j] * np.exp(1j * np.asarray(angle + (guide or 0.0))))

    def _first_pin(self, j: int, positions: Array) -> Complex:
        """Returns the positions of a link's first pin, or of a slider's, shape (n,)."""
        structure = self._solver.structure
        point = structure.point_of(j, (0.0, 0.0))
        weights, fixed = np.array([point.weights]), np.array([point.fixed])
        return placed(structure.links, weights, fixed, positions)[:, 0]

    def farthest(self, positions: Array) -> Complex:
        """Returns the far ends of the longest straight arrows of loaded sliders, shape (n,)."""
        room = (_BESIDE_PIN + _LONGEST) * self._mark
        ends = [
            self._first_pin(j, positions) + room * self._outwards(j, positions)
            for j, link in enumerate(self._solver.structure.links)
            if link.slides and link.name in self.names
        ]
        return np.concatenate([*ends, np.empty(0, complex)])

    def lines(self, positions: Array, rates: Array) -> dict[str, Complex]:
        """Draws the arrows: lines of shape (n, points), by the name of the arrow."""
        lines = {}
        for name, load in self._exerted(positions, rates).items():
            # Relative to the largest magnitude so far.
            largest = self._largest_so_far(name, load.size)
            share: Any = load.size / np.where(largest > 0, largest, 1.0)
            if load.at is not None:
                lines[name] = self._at_point(load.at, share)
                continue
            j = self._solver.links.index(name)
            if self._solver.structure.links[j].slides:
                lines[name] = self._straight(j, positions, share)
            else:
                lines[name] = self._curved(self._first_pin(j, positions), positions[:, j], share)
        return lines

    def values(self, positions: Array, rates: Array) -> dict[str, list[str]]:
        """Returns the sizes of the loads as text, by the name of the arrow; see `lines`."""
        sliding = {link.name for link in self._solver.structure.links if link.slides}
        texts = {}
        for name, load in self._exerted(positions, rates).items():
            unit = 'N' if load.at is not None or name in sliding else 'N m'
            sizes = load.size if load.at is None else abs(load.size)
            texts[name] = [f'{size:.4g} {unit}' for size in sizes.tolist()]
        return texts

    def _exerted(self, positions: Array, rates: Array) -> dict[str, _Load]:
        """Returns the loads by the name of the arrow."""
        positions = np.nan_to_num(positions)  # a state in a log may be impossible
        state = State(tuple(positions.T), tuple(rates.T), tuple(0.0 * rates.T), 0.0)
        with np.errstate(all='ignore'):
            exerted = self._solver.exerted(state)
        count = len(positions)
        loads = dict[str, _Load]()
        for link, effort in exerted.efforts.items():
            loads[link] = _Load(np.broadcast_to(effort, count))
        for name, at_point in exerted.forces.items():
            force, at = (
                np.broadcast_to(vector.x + 1j * vector.y, count)
                for vector in (at_point.force, at_point.at)
            )
            loads[name] = _Load(force, at)
        return loads

    def _largest_so_far(self, name: str, load: Any) -> Array:
        """Returns the largest magnitude of a load up to each state, which it also stores."""
        known = self._largest.get(name, 0.0)
        largest = np.fmax.accumulate([known, *abs(load)])
        self._largest[name] = float(largest[-1])
        return largest[1:]

    def _at_point(self, foot: Complex, share: Any) -> Complex:
        """Draws arrows from points, along forces given as shares of the largest, x + iy."""
        tip = foot + share * _LONGEST * self._mark
        size = abs(share)
        forward = share / np.where(size > 0, size, 1.0)
        return self._with_head(np.stack([foot, tip], axis=1), forward, size * _LONGEST)

    def _straight(self, j: int, positions: Array, share: Array) -> Complex:
        """Draws arrows that push or pull a slider."""
        pin, outwards = self._first_pin(j, positions), self._outwards(j, positions)
        near = pin + np.where(share, _BESIDE_PIN * self._mark, 0.0) * outwards
        far = near + abs(share) * _LONGEST * self._mark * outwards
        pulls = share * self._sides[j] > 0
        body = np.stack([np.where(pulls, near, far), np.where(pulls, far, near)], axis=1)
        forward = np.where(pulls, 1.0, -1.0) * outwards
        return self._with_head(body, forward, abs(share) * _LONGEST)

    def _curved(self, pivot: Complex, angle: Array, share: Array) -> Complex:
        """Draws arrows about a pivot, from the link in the direction of the torque."""
        turned = np.exp(1j * (angle[:, np.newaxis] + share[:, np.newaxis] * _SWEEP))
        forward = 1j * np.sign(share) * turned[:, -1]
        body = pivot[:, np.newaxis] + _RADIUS * self._mark * turned
        return self._with_head(body, forward, abs(share) * _RADIUS * _SWEEP[-1])

    def _with_head(self, body: Complex, forward: Complex, length: Array) -> Complex:
        """Adds heads to arrows; `length` holds the lengths of the arrows in units of `mark`."""
        size = np.minimum(_HEAD, length) * self._mark
        return np.concatenate([body, body[:, -1:] + (size * forward)[:, np.newaxis] * _SIDES], 1)
