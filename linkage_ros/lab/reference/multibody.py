# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Multibody equations of any mechanism, with constraints and Lagrange multipliers.

Every link has its own coordinate. The force that closes the loop is solved with the accelerations:

    [ M   G^T ] [   q''    ]   [ Q - h        ]
    [ G    0  ] [ -lambda  ] = [ -(G' q')     ]

The lower rows are the loop closure, differentiated twice. This is the textbook form for any
mechanism (Baumgarte, Comput. Methods Appl. Mech. Eng. 1 (1972), eq. 1 to 5). It needs no dyads, so
it also holds where coupler and third link are in line in motion. It is a method in floats and, in
many digits, the reference for states and motions.
"""

import operator
from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

import numpy as np

from linkage_ros.formulas import ZERO
from linkage_ros.model.four_bar import FourBar
from linkage_ros.model.structure import Mechanism

Number: TypeAlias = Any  # a float, a Decimal or an mpf
Row: TypeAlias = Any  # numbers, in a sequence or an array; NumPy has no type for Decimals


class Multibody:
    """The equations of one mechanism, in one kind of number.

    Positions are arrays of shape (2, links): unit vectors of the links that turn, and (position,
    0) of one that slides.

    Attributes:
        slides: For each link, whether it slides.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        number: Callable[[float], Number],
        unit: Callable[[float], Row],
        length: Callable[[float], Number] | None = None,
    ) -> None:
        """Reads masses, lengths and loads from the mechanism's description.

        Args:
            mechanism: The mechanism.
            number: Converts a float to the kind of number.
            unit: Makes the unit vector of an angle, rad, in these numbers.
            length: Converts a length, m; by default `number`.
        """
        structure, length = mechanism.structure(), length or number
        *_, last = links = structure.links
        self.slides, self._axis = np.array([x.slides for x in links]), np.vstack(unit(last.angle))
        self._masses = np.array([number(link.mass) for link in links] * 2)
        self._inertia = np.diag([number(link.inertia) for link in links])
        self._gravity = np.vstack([*map(number, mechanism.gravity)])
        closure, fixed = [*structure.closure.weights], structure.closure.fixed
        if last.slides:
            closure[-1], fixed = -1 + 0j, fixed - last.origin
        self._fixed = np.array([length(fixed.real), length(fixed.imag)])
        if isinstance(mechanism, FourBar):  # the structure holds its pivot in doubles
            self._fixed = np.array(unit(mechanism.frame.angle)) * -length(mechanism.frame.length)
        # Of each centre of mass, and of the gap of the loop: its weight on each link.
        rows = []
        for i, link in enumerate(links):
            # From pin to pin by the lengths; from the last pin to the centre by the given value.
            *pins, own = (0j,) * i + (1 + 0j,) if link.slides else link.center.weights[: i + 1]
            rest = [0j] * (len(links) - i - 1)
            rows.append([*_numbers(pins, length), *_numbers([own, *rest], number)])
        self._weights = np.array([*rows, _numbers(closure, length)]).transpose(2, 0, 1)
        # Loads are tuples of indices and numbers.
        loads: Any = mechanism.link_loads()
        self._loads = [
            type(load)(*((number(x) if x else ZERO) if isinstance(x, float) else x for x in load))
            for load in loads
        ]

    def gap(self, places: Row) -> Row:
        """The gap of the loop, m."""
        arms = self._arms(places)[:, -1]
        return self._fixed + (arms * np.where(self.slides, places[0], 1)).sum(axis=1)

    def closed(self, places: Row, rates: Row, opening: Row) -> Row:
        """Completes rates of coupler and third link so that the loop opens at a velocity, m/s."""
        free = np.array([rates[0], 0, 0, *rates[3:]])
        closure = self._columns(self._arms(places))[:, -1]
        found = eliminate(closure[:, 1:3], np.array(opening) - closure @ free)
        return np.array([free[0], *found, *free[3:]])

    def system(self, places: Row, rates: Row) -> tuple[Row, Row]:
        """The matrix and the right-hand side above, without a torque on the crank.

        Args:
            places: Positions of the links.
            rates: Velocities of the links, rad/s or m/s.

        Returns:
            The matrix, and the right-hand side.
        """
        arms, turning = self._arms(places), np.where(self.slides, 0, rates)
        columns, bias = self._columns(arms), -(arms * (turning * turning)).sum(axis=2)
        bodies, closure = columns[:, :-1].reshape(-1, len(rates)), columns[:, -1]
        weighted = bodies.T * self._masses
        right = weighted @ (self._gravity - bias[:, :-1]).ravel()
        for load in self._loads:
            for j, force in load.forces((), rates).items():
                right[j] += force
        upper = np.concatenate([self._inertia + weighted @ bodies, closure.T], 1)
        lower = np.concatenate([closure, 0 * closure[:, :2]], 1)
        return np.concatenate([upper, lower]), np.concatenate([right, -bias[:, -1]])

    def _arms(self, places: Row) -> Row:
        """Each weight times the direction of its link, for all points; the first axis is x, y."""
        (a, b), (x, y) = self._weights, np.where(self.slides, self._axis, places)
        return np.array([a * x - b * y, a * y + b * x])

    def _columns(self, arms: Row) -> Row:
        """The velocities of all points per rate of each link."""
        return np.where(self.slides, arms, [-arms[1], arms[0]])


def _numbers(weights: Sequence[complex], number: Callable[[float], Number]) -> list[Row]:
    return [(number(weight.real), number(weight.imag)) for weight in weights]


def eliminate(rows: Row, right: Row) -> list[Number]:
    """Solves a system of equations by Gaussian elimination, for any kind of number.

    Args:
        rows: The rows of the matrix.
        right: The right-hand side.

    Returns:
        The unknowns.

    Raises:
        ArithmeticError: The matrix is singular.
    """
    table = [[*row, value] for row, value in zip(rows, right, strict=True)]
    size = len(table)
    for i in range(size):
        largest = max(range(i, size), key=lambda row: abs(table[row][i]))
        table[i], table[largest] = table[largest], table[i]
        for row in table[i + 1 :]:
            if row[i]:
                factor = row[i] / table[i][i]
                row[i:] = [x - factor * y for x, y in zip(row[i:], table[i][i:], strict=True)]
    found: list[Number] = []
    for i, (*row, value) in reversed(list(enumerate(table))):
        found = [(value - sum(map(operator.mul, row[i + 1 :], found))) / row[i], *found]
    return found
