# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Multibody equations of any mechanism, with constraints and Lagrange multipliers.

Every link has its own coordinate. The equations yield the accelerations and, at the same time, the
forces lambda that close the loop and each added dyad:

    [ M   G^T ] [   q''    ]   [ Q - h        ]
    [ G    0  ] [ -lambda  ] = [ -(G' q')     ]

The lower rows are the closures, differentiated twice. This is the textbook form for any
mechanism (Baumgarte, Comput. Methods Appl. Mech. Eng. 1 (1972), eq. 1 to 5). It solves no dyads,
so it also holds where coupler and third link are in line. In floats, these equations are one of
the compared methods; in multiple precision, they are the reference for states and motions.
"""

import operator
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, TypeAlias

from linkage_ros import FourBar, InvertedSliderCrank, Mechanism
from linkage_ros.extensions import LinkPose
from linkage_ros.formulas import ZERO, Vector, dot
from linkage_ros.internals import axes_of, spin_of

Row: TypeAlias = list[Any]  # of floats, Decimals or mpfs


class _MovingGuide(NamedTuple):
    """A guide on a moving link.

    Attributes:
        link: Index of the link that slides.
        origin: Zero of its position, in the axes of the guide's link, m.
        axes: Direction of these axes relative to the link with which they turn.
        spin: Index of that link; None if they do not turn.
    """

    link: int
    origin: Vector
    axes: Vector
    spin: int | None


class Multibody:
    """The multibody equations of a mechanism, for one number type.

    Attributes:
        slides: For each link, whether it slides.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        number: Callable[[float], Any],
        unit: Callable[[float], Vector],
        length: Callable[[float], Any] | None = None,
    ) -> None:
        """Reads masses, lengths and loads from the mechanism's description.

        Args:
            mechanism: Mechanism to describe.
            number: Converts a float to the number type.
            unit: Makes the unit vector at an angle, rad, in this type.
            length: Converts a length, m; by default `number`.
        """
        structure, length = mechanism.structure(), length or number
        links = structure.links
        self.slides = [link.slides for link in links]
        self._guides = [unit(link.angle) for link in links]
        self._zero = number(0.0)
        self._gravity = Vector(*map(number, mechanism.gravity))
        self._bodies = []
        for i, link in enumerate(links):
            spin = i if link.is_guided else spin_of(links, i)
            weights = (0j,) * i + (1 + 0j,) if link.is_guided else link.center.weights
            center = _vectors(weights, length)
            if not link.slides:  # the vector from the pin to the centre is given
                center |= _vectors([0j] * i + [weights[i]], number)
            self._bodies.append((number(link.mass), number(link.inertia), spin, center))
        # Weights and constant of each gap vector: of the loop, then of each added dyad.
        self._closures = []
        for closure, j in structure.closures:
            around, fixed = _vectors(closure.weights, length), closure.fixed
            if links[j].is_guided:
                around[j] = Vector(number(-1.0), self._zero)
                fixed -= links[j].origin
            self._closures.append((around, Vector(length(fixed.real), length(fixed.imag))))
        if isinstance(mechanism, (FourBar, InvertedSliderCrank)):  # the pivot is in doubles
            pivot = unit(mechanism.frame.angle) * -length(mechanism.frame.length)
            self._closures[0] = self._closures[0][0], pivot
        # Guides on moving links, by the number of the closure.
        self._moving = {}
        for i, (_, j) in enumerate(structure.closures):
            last = links[j]
            if last.slides and last.parent is not None:
                origin = Vector(length(last.origin.real), length(last.origin.imag))
                spin, angle = axes_of(links, last.parent)
                self._moving[i] = _MovingGuide(j, origin, unit(angle or 0.0), spin)
        axes = (axes_of(links, j) for j in range(len(links)))
        self._axes = [(spin, unit(angle or 0.0)) for spin, angle in axes]
        added = len(links) - 2 * len(structure.added)
        self._solved = 1, 2, *range(added, len(links))
        self._links = links
        self._loads = _constants(tuple(mechanism.link_loads().values()), number)

    def gap(self, places: Sequence[Vector]) -> Row:
        """Computes the gaps of the loop and of each added dyad.

        Args:
            places: Unit vector of each link that turns, (position, 0) of each link that slides.

        Returns:
            The components x and y of each gap vector, m.
        """
        gaps = []
        for weights, gap in self._closures:
            for j, weight in weights.items():
                slid = self._guides[j] * places[j].x if self.slides[j] else places[j]
                gap = gap + turned(weight, slid)
            gaps.append(gap)
        for i, guide in self._moving.items():
            gaps[i] -= self._arm(guide, places)
        return [x for gap in gaps for x in gap]

    def _arm(self, guide: _MovingGuide, places: Sequence[Vector]) -> Vector:
        """Returns the vector from the pin of a guide's link to that of the link that slides."""
        slid = guide.origin + self._guides[guide.link] * places[guide.link].x
        return self._turned(guide, slid, places)

    def _turned(self, guide: _MovingGuide, arm: Vector, places: Sequence[Vector]) -> Vector:
        """Turns a vector from the axes of a guide's link to those of base_link."""
        arm = turned(guide.axes, arm)
        return arm if guide.spin is None else turned(arm, places[guide.spin])

    def closure(self, places: Sequence[Vector], rates: Row) -> tuple[list[Row], Row]:
        """Returns the jacobian G of the gaps, as rows x and y of each, and G' q'."""
        empty = Vector(self._zero, self._zero)
        rows: list[Row] = []
        biases: Row = []
        for i, (weights, _) in enumerate(self._closures):
            columns, bias = self._columns(weights, places, rates)
            if guide := self._moving.get(i):
                arm, last, j = self._arm(guide, places), guide.link, guide.spin
                way = self._turned(guide, self._guides[last], places)
                columns[last] = -way
                if j is not None:
                    columns[j] = columns.get(j, empty) - arm.left()
                    twice = 2 * rates[last] * rates[j]
                    bias = bias + arm * (rates[j] * rates[j]) - way.left() * twice
            xy = zip(*(columns.get(j, empty) for j in range(len(rates))), strict=True)
            rows += map(list, xy)
            biases += bias
        return rows, biases

    def closed(self, places: Sequence[Vector], rates: Row, opening: Row) -> Row:
        """Solves for the rates of coupler, third link and dyads at given velocities of the gaps.

        Args:
            places: Unit vector of each link that turns, (position, 0) of each link that slides.
            rates: Rates of all links, of which those to solve for are ignored.
            opening: Velocities of the gaps, m/s.

        Returns:
            The rates of all links.
        """
        solved = self._solved
        free = [self._zero if j in solved else rate for j, rate in enumerate(rates)]
        closure, _ = self.closure(places, free)
        right = [
            x - sum(map(operator.mul, row, free)) for x, row in zip(opening, closure, strict=True)
        ]
        found = iter(eliminate([[row[j] for j in solved] for row in closure], right))
        return [next(found) if j in solved else rate for j, rate in enumerate(free)]

    def system(self, places: Sequence[Vector], rates: Row) -> tuple[list[Row], Row]:
        """Returns the matrix and the right-hand side of the equations, without a driving torque.

        Args:
            places: Unit vector of each link that turns, (position, 0) of each link that slides.
            rates: Velocities of the links, rad/s or m/s.

        Returns:
            The rows of the matrix, and the right-hand side.
        """
        count = len(rates)
        rows = [[self._zero] * count for _ in rates]
        right = [self._zero] * count
        for mass, inertia, spin, weights in self._bodies:
            columns, bias = self._columns(weights, places, rates)
            if spin is not None:
                rows[spin][spin] += inertia
            for j, one in columns.items():
                right[j] += mass * dot(one, self._gravity - bias)
                for k, other in columns.items():
                    rows[j][k] += mass * dot(one, other)
        poses = [
            LinkPose(place.x, self._axis(j, places), (), ()) for j, place in enumerate(places)
        ]
        for load in self._loads:
            for wrench in load.wrenches(poses, rates):
                for j, force in wrench.generalised(self._links, poses):
                    right[j] += force
        closure, rest_of_gap = self.closure(places, rates)
        for j, row in enumerate(rows):
            row += [rest[j] for rest in closure]
        rows += [[*row, *[self._zero] * len(closure)] for row in closure]
        return rows, [*right, *(-x for x in rest_of_gap)]

    def _axis(self, j: int, places: Sequence[Vector]) -> Vector:
        """Returns the direction of a link, or of its guide."""
        spin, way = self._axes[j]
        return way if spin is None else turned(way, places[spin])

    def _columns(
        self, weights: Mapping[int, Vector], places: Sequence[Vector], rates: Row
    ) -> tuple[dict[int, Vector], Vector]:
        """Returns a point's velocities per rate of each link, and its centripetal acceleration."""
        columns, bias = {}, Vector(self._zero, self._zero)
        for j, weight in weights.items():
            if self.slides[j]:
                columns[j] = turned(weight, self._guides[j])
            else:
                arm = turned(weight, places[j])
                columns[j], bias = arm.left(), bias - arm * (rates[j] * rates[j])
        return columns, bias


def _constants(x: Any, number: Callable[[float], Any]) -> Any:
    """Converts the float and complex constants of loads; leaves others unchanged."""
    if isinstance(x, tuple):
        return tuple.__new__(type(x), [_constants(part, number) for part in x])
    if isinstance(x, complex):
        return Vector(_constants(x.real, number), _constants(x.imag, number))
    return (number(x) if x else ZERO) if isinstance(x, float) else x


def _vectors(weights: Sequence[complex], number: Callable[[float], Any]) -> dict[int, Vector]:
    """Converts the nonzero weights of a point to vectors, by link."""
    return {
        j: Vector(number(weight.real), number(weight.imag))
        for j, weight in enumerate(weights)
        if weight
    }


def turned(weight: Vector, direction: Vector) -> Vector:
    """Multiplies two vectors as complex numbers."""
    (a, b), (x, y) = weight, direction
    return Vector(a * x - b * y, a * y + b * x)


def eliminate(rows: list[Row], right: Row) -> Row:
    """Solves a system of equations by Gaussian elimination, for any kind of number.

    Args:
        rows: The rows of the square matrix.
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
    found: Row = []
    for i, (*row, value) in reversed(list(enumerate(table))):
        found = [(value - sum(map(operator.mul, row[i + 1 :], found))) / row[i], *found]
    return found
