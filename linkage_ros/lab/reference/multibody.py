# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The bodies of any mechanism, its loop cut open: constraints and Lagrange multipliers.

Every link has its own coordinate. A force closes the loop; it is found with the accelerations:

    [ M   G^T ] [   q''    ]   [ Q - h        ]
    [ G    0  ] [ -lambda  ] = [ -(G' q')     ]

The lower rows are the loop's closure, differentiated twice. This is the textbook form for any
mechanism (Baumgarte, Comput. Methods Appl. Mech. Eng. 1 (1972), eq. 1 to 5). It needs no dyad, so
it also holds where coupler and third link are in line at speed. It serves as a method in doubles
and, in many digits, as the reference for states and motions.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeAlias

from linkage_ros.formulas import Vector, dot
from linkage_ros.model.four_bar import FourBar
from linkage_ros.model.structure import Link, Mechanism

Number: TypeAlias = Any  # a float, a Decimal or an mpf
Row: TypeAlias = list[Number]
Solve: TypeAlias = Callable[..., Any]  # of the rows of a matrix and a right-hand side


class Multibody:
    """The equations of one mechanism, in one kind of number.

    Attributes:
        slides: For each link, whether it slides.
        axis: Direction of the guide; (1, 0) if no link slides.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        number: Callable[[float], Number],
        unit: Callable[[float], Vector],
        meant: Mapping[float, Number] | None = None,
    ) -> None:
        """Takes masses, lengths and loads from the mechanism's description.

        Args:
            mechanism: The mechanism.
            number: Makes a number of a double.
            unit: Makes the unit vector of an angle, rad, in these numbers.
            meant: Lengths that doubles stand for.
        """
        structure = mechanism.structure()
        exact = {
            sign * double: sign * x for double, x in (meant or {}).items() for sign in (1, -1)
        }
        *_, last = links = structure.links

        def vector(weight: complex) -> Vector:
            x, y = weight.real, weight.imag
            return Vector(exact[x] if x in exact else number(x), number(y))

        def vectors(weights: Sequence[complex]) -> dict[int, Vector]:
            return {j: vector(complex(weight)) for j, weight in enumerate(weights) if weight}

        def center(i: int, link: Link) -> dict[int, Vector]:
            """From pin to pin by meant lengths, from the last pin to the centre as it is."""
            if link.slides:
                return {i: vector(1)}
            own = complex(link.center.weights[i])
            arm = Vector(number(own.real), number(own.imag))
            return vectors(link.center.weights) | ({i: arm} if own else {})

        self.slides, self.axis = [link.slides for link in links], unit(last.angle)
        self._zero = number(0.0)
        self._gravity = Vector(*map(number, mechanism.gravity))
        self._bodies = [
            (number(link.mass), number(link.inertia), center(i, link))
            for i, link in enumerate(links)
        ]
        self._closure = vectors(structure.closure.weights)
        if last.slides:
            self._closure[len(links) - 1] = vector(-1)
        self._fixed = vector(structure.closure.fixed - (last.origin if last.slides else 0))
        if isinstance(mechanism, FourBar):  # the structure has its pivot in doubles
            self._fixed = unit(mechanism.frame.angle) * -number(mechanism.frame.length)
        # Loads are tuples of indices and numbers.
        loads: Any = mechanism.link_loads()
        self._loads = [
            type(load)(*(number(x) if isinstance(x, float) else x for x in load)) for load in loads
        ]

    def gap(self, places: Sequence[Vector]) -> Vector:
        """How far the loop is from being closed, m.

        Args:
            places: Unit vector of each link, or (position, 0) of one that slides.

        Returns:
            The gap.
        """
        gap = self._fixed
        for j, weight in self._closure.items():
            slid = self.axis * places[j].x if self.slides[j] else places[j]
            gap = gap + turned(weight, slid)
        return gap

    def closure(self, places: Sequence[Vector], rates: Row) -> tuple[list[Row], Row]:
        """The derivatives G of the gap by the coordinates, and G' q', each as rows x and y."""
        columns, bias = self._columns(self._closure, places, rates)
        empty = Vector(self._zero, self._zero)
        found = [columns.get(j, empty) for j in range(len(rates))]
        return [[column.x for column in found], [column.y for column in found]], list(bias)

    def dependent(self, places: Sequence[Vector], opening: Sequence[Number]) -> Row:
        """The rates of coupler and third link that close the loop as fast as it opens, m/s."""
        closure, _ = self.closure(places, [self._zero] * len(self.slides))
        return eliminate([row[1:3] for row in closure], [-x for x in opening])

    def closed(self, places: Sequence[Vector], crank: Number, others: Row) -> Row:
        """All rates, from those of the crank and of the links after the third."""
        rates = [crank, self._zero, self._zero, *others]
        closure, _ = self.closure(places, rates)
        opening = [sum(map(operator.mul, row, rates)) for row in closure]
        return [crank, *self.dependent(places, opening), *others]

    def balance(self, places: Sequence[Vector], rates: Row) -> tuple[list[Row], Row]:
        """M and Q - h: masses, and the forces of weights, loads and rates."""
        count = len(rates)
        masses = [[self._zero] * count for _ in rates]
        forces = [self._zero] * count
        for i, (mass, inertia, weights) in enumerate(self._bodies):
            columns, bias = self._columns(weights, places, rates)
            masses[i][i] += inertia
            for j, one in columns.items():
                forces[j] += mass * dot(one, self._gravity - bias)
                for k, other in columns.items():
                    masses[j][k] += mass * dot(one, other)
        for load in self._loads:
            for j, force in load.forces((), rates).items():
                forces[j] += force
        return masses, forces

    def accelerations(
        self, places: Sequence[Vector], rates: Row, torque: Number, solve: Solve
    ) -> Sequence[Number]:
        """The accelerations that leave the gap as it is.

        Args:
            places: As for `gap`.
            rates: Velocities of the links, rad/s or m/s.
            torque: On the crank, N m.
            solve: Solves a system of equations.

        Returns:
            Accelerations of the links, rad/s^2 or m/s^2.
        """
        masses, forces = self.balance(places, rates)
        closure, bias = self.closure(places, rates)
        forces[0] += torque
        rows = [
            *(row + [rest[j] for rest in closure] for j, row in enumerate(masses)),
            *(row + [self._zero] * 2 for row in closure),
        ]
        found: Sequence[Number] = solve(rows, forces + [-x for x in bias])[: len(rates)]
        return found

    def _columns(
        self, weights: Mapping[int, Vector], places: Sequence[Vector], rates: Row
    ) -> tuple[dict[int, Vector], Vector]:
        """The velocities of a point per rate of each link, and its acceleration at these rates."""
        columns, bias = {}, Vector(self._zero, self._zero)
        for j, weight in weights.items():
            if self.slides[j]:
                columns[j] = turned(weight, self.axis)
            else:
                arm = turned(weight, places[j])
                columns[j], bias = arm.left(), bias - arm * (rates[j] * rates[j])
        return columns, bias


def turned(weight: Vector, direction: Vector) -> Vector:
    """The product of two vectors as complex numbers."""
    (a, b), (x, y) = weight, direction
    return Vector(a * x - b * y, a * y + b * x)


def eliminate(rows: list[Row], right: Row) -> Row:
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
        for row in table[:i] + table[i + 1 :]:
            if row[i]:
                factor = row[i] / table[i][i]
                row[i:] = [x - factor * y for x, y in zip(row[i:], table[i][i:], strict=True)]
    return [row[size] / row[i] for i, row in enumerate(table)]
