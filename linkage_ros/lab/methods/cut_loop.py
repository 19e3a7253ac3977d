# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The equations of motion with the loop cut open: constraints and Lagrange multipliers.

Every link turns by itself; what closes the loop is a force, found with the accelerations from

    [ M   G^T ] [   q''    ]   [ Q - h        ]
    [ G    0  ] [ -lambda  ] = [ -(G' q')     ]

where the lower rows are the loop's closure, l1 e^(i phi1) + l2 e^(i phi2) + l3 e^(i phi3) = end,
differentiated twice. The textbook way for any mechanism (Baumgarte, Comput. Methods Appl. Mech.
Eng. 1 (1972), eq. 1 to 5). There is no dyad in it: it also goes on where coupler and third link
are stretched. Of any kind of number, so that it serves as a method in doubles and, in many
digits, as the truth.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

from linkage_ros.model.four_bar import FourBar
from linkage_ros.model.wind_pump import WindPump

Number: TypeAlias = Any  # a float or a Decimal
Pair: TypeAlias = tuple[Number, Number]  # x and y, or cosine and sine
Row: TypeAlias = list[Number]
Solve: TypeAlias = Callable[[list[Row], Row], Sequence[Number]]


class CutLoop:
    """Four-bar or wind pump as three links in a row, in one kind of number.

    Attributes:
        lengths: Of the three, from pin to pin; the rocker's is negative, for it is gone through
            from B to B0.
        slides: Whether the last pin slides along the x axis; otherwise it stays.
    """

    def __init__(
        self,
        mechanism: FourBar | WindPump,
        number: Callable[[float], Number],
        unit: Callable[[float], Pair],
    ) -> None:
        """Sums up the bodies.

        Args:
            mechanism: What it is of.
            number: Makes a number of a double.
            unit: Cosine and sine of an angle, rad, as numbers.
        """
        links = mechanism.structure().links
        self.slides = isinstance(mechanism, WindPump)
        self._zero = number(0)
        x, y = mechanism.gravity
        self._gravity = number(x), number(y)
        end: Pair = self._zero, self._zero
        if isinstance(mechanism, WindPump):
            last, slider = mechanism.rod.length, mechanism.slider
            self._slider, self._resistance = number(slider.mass), number(slider.damping)
        else:
            last = -mechanism.rocker.length
            cos, sin = unit(mechanism.frame.angle)
            end = number(mechanism.frame.length) * cos, number(mechanism.frame.length) * sin
        self._end = end
        lengths = mechanism.crank.length, mechanism.coupler.length, last
        self.lengths: tuple[Number, ...] = tuple(map(number, lengths))
        self._weights = [[self._zero] * 2 for _ in range(3)]
        self._moments = {(j, k): [self._zero] * 2 for j in range(3) for k in range(j, 3)}
        for link, body in enumerate(links[:3]):
            mass = number(body.mass)
            arms = [(number(w.real), number(w.imag)) for w in map(complex, body.center.weights)]
            for j, (xj, yj) in enumerate(arms[:3]):
                _add(self._weights[j], mass * xj, mass * yj)
                for k, (xk, yk) in enumerate(arms[j:3], j):
                    _add(
                        self._moments[j, k],
                        mass * (xj * xk + yj * yk), mass * (xj * yk - yj * xk),
                    )  # fmt: skip
            _add(self._moments[link, link], number(body.inertia), self._zero)

    def gap(self, directions: Sequence[Pair], place: Number) -> Pair:
        """By how much the loop does not close, m.

        Args:
            directions: Cosine and sine of each link.
            place: The slider's, m; None: there is none.

        Returns:
            x and y.
        """
        x, y = self._end
        if place is not None:
            x = place
        for length, (cos, sin) in zip(self.lengths, directions, strict=True):
            x, y = x - length * cos, y - length * sin
        return -x, -y

    def accelerations(
        self,
        directions: Sequence[Pair],
        spins: Sequence[Number],
        velocity: Number,
        torque: Number,
        solve: Solve,
    ) -> Sequence[Number]:
        """The accelerations that keep the loop as open as it is.

        Args:
            directions: Cosine and sine of each link.
            spins: Angular velocities, rad/s.
            velocity: The slider's, m/s; None: there is none.
            torque: On the crank, N m.
            solve: Of a system of equations.

        Returns:
            Of the three links and, of a wind pump, the slider; rad/s^2 and m/s^2.
        """
        zero, count = self._zero, 4 if self.slides else 3
        rows = [[zero] * (count + 2) for _ in range(count + 2)]
        right = [zero] * (count + 2)
        gx, gy = self._gravity
        right[0] = torque
        closing, across = rows[count], rows[count + 1]
        for j, ((cos, sin), spin) in enumerate(zip(directions, spins, strict=True)):
            x, y = self._weights[j]
            right[j] += (x * cos - y * sin) * gy - (x * sin + y * cos) * gx
            rows[j][j] = self._moments[j, j][0]
            x, y = self.lengths[j] * cos, self.lengths[j] * sin
            closing[j] = rows[j][count] = -y
            across[j] = rows[j][count + 1] = x
            right[count] += x * spin * spin
            right[count + 1] += y * spin * spin
        for j, k in ((0, 1), (0, 2), (1, 2)):
            (cj, sj), (ck, sk), (a, b) = directions[j], directions[k], self._moments[j, k]
            cos, sin = cj * ck + sj * sk, cj * sk - sj * ck
            rows[j][k] = rows[k][j] = a * cos - b * sin
            turned = a * sin + b * cos
            right[j] += turned * spins[k] * spins[k]
            right[k] -= turned * spins[j] * spins[j]
        if self.slides:
            rows[3][3] = self._slider
            right[3] = self._slider * gx - self._resistance * velocity
            closing[3] = rows[3][count] = -1 + zero
        return solve(rows, right)[:count]


def eliminate(rows: list[Row], right: Row) -> Row:
    """Solves a system of equations by Gaussian elimination, for any kind of number.

    Args:
        rows: Of the matrix.
        right: The right side.

    Returns:
        The unknowns.

    Raises:
        ArithmeticError: The matrix is singular.
    """
    size = len(right)
    table = [[*row, value] for row, value in zip(rows, right, strict=True)]
    for i in range(size):
        largest = max(range(i, size), key=lambda row: abs(table[row][i]))
        table[i], table[largest] = table[largest], table[i]
        top = table[i]
        for row in table[i + 1 :]:
            if row[i]:
                factor = row[i] / top[i]
                for column in range(i + 1, size + 1):
                    row[column] -= factor * top[column]
    found: Row = [None] * size
    for i in range(size - 1, -1, -1):
        row = table[i]
        rest = sum(row[column] * found[column] for column in range(i + 1, size))
        found[i] = (row[size] - rest) / row[i]
    return found


def _add(pair: list[Number], x: Number, y: Number) -> None:
    pair[0] += x
    pair[1] += y
