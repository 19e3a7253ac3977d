# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a picture of a linkage consists of: lines and points, whatever shows them.

All coordinates are m in base_link, x to the right and y up.
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from linkage_ros.mechanism import FourBar
from linkage_ros.solver import Solver

Array: TypeAlias = npt.NDArray[np.float64]

_STEPS_PER_TURN = 360
_MARGIN = 0.06
_MARK = 0.04  # size of the marks at the fixed pivots; it and the margin are parts of the width


class FourBarDrawing:
    """The picture of one four-bar linkage.

    Attributes:
        pivots: The fixed pivots A0 and B0, shape (2, 2), m.
        pins: Names of the moving points, in the order of `points`.
        paths: What B and, if there is one, the coupler point C trace out, by the name of the
            link whose point it is; each of shape (n, 2), m.
        ground: The marks at the fixed pivots, lines of shape (n, 2), m.
        bounds: Lower left and upper right corner of everything at any time, shape (2, 2), m.
    """

    def __init__(self, mechanism: FourBar) -> None:
        frame, coupler = mechanism.frame, mechanism.coupler
        self._crank, self._rocker = mechanism.crank.length, mechanism.rocker.length
        self._point = None if coupler.point is None else complex(*coupler.point)
        self._pivot = frame.length * complex(math.cos(frame.angle), math.sin(frame.angle))
        self.pivots = _plane(np.array([0j, self._pivot]))
        self.pins = ('A', 'B') if self._point is None else ('A', 'B', 'C')
        swept = self._sweep(mechanism)
        self.paths = {'rocker': swept[:, 1]}
        if self._point is not None:
            self.paths['coupler'] = swept[:, 2]
        everything = np.concatenate([self.pivots, swept.reshape(-1, 2)])
        size = np.ptp(everything, axis=0).max()
        self.ground = [line for pivot in self.pivots for line in _mark(pivot, _MARK * size)]
        everything = np.concatenate([everything, *self.ground])
        margin = _MARGIN * size
        self.bounds = np.array([everything.min(axis=0) - margin, everything.max(axis=0) + margin])

    def _sweep(self, mechanism: FourBar) -> Array:
        solver = Solver(mechanism)
        turns = solver.mobility.period_turns
        crank = np.linspace(0, turns * 2 * math.pi, turns * _STEPS_PER_TURN + 1)
        return self._place(*solver.state(crank).angle)

    def _place(self, crank: Array, coupler: Array, rocker: Array) -> Array:
        a = self._crank * np.exp(1j * crank)
        points = [a, self._pivot + self._rocker * np.exp(1j * rocker)]
        if self._point is not None:
            points.append(a + self._point * np.exp(1j * coupler))
        return _plane(np.stack(points, axis=-1))

    def points(self, position: Array) -> Array:
        """Where the moving points are.

        Args:
            position: Joint positions in the order of the tree, shape (n, 3), rad.

        Returns:
            A, B and, if there is one, C; shape (n, 2 or 3, 2), m.
        """
        crank, coupler, rocker = position.T
        return self._place(crank, crank + coupler, rocker)

    def links(self, points: Array) -> dict[str, Array]:
        """The lines of the moving links, by their names.

        Args:
            points: As `points` gives them, shape (n, 2 or 3, 2), m.

        Returns:
            Lines of shape (n, 2, 2), m. A coupler with a point is a triangle, (n, 4, 2).
        """
        a0, b0 = (np.broadcast_to(pivot, (len(points), 1, 2)) for pivot in self.pivots)
        a, b, *c = (points[:, i : i + 1] for i in range(points.shape[1]))
        lines = {'crank': [a0, a], 'coupler': [a, b, *c, a] if c else [a, b], 'rocker': [b0, b]}
        return {name: np.concatenate(line, axis=1) for name, line in lines.items()}


def _plane(points: npt.NDArray[np.complex128]) -> Array:
    return np.stack([points.real, points.imag], axis=-1)


def _mark(pivot: Array, size: float) -> list[Array]:
    """A triangle that stands on hatched ground, as drawings of mechanisms have it."""
    shapes: list[list[tuple[float, float]]] = [
        [(0, 0), (-0.6, -1), (0.6, -1), (0, 0)],
        [(-1, -1), (1, -1)],
        *([(x, -1), (x - 0.4, -1.4)] for x in (-0.6, -0.2, 0.2, 0.6, 1.0)),
    ]
    return [pivot + size * np.array(shape) for shape in shapes]
