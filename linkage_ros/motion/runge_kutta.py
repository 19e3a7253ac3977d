# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Formulas for one Runge-Kutta step of a torque-driven motion, explicit or linearly implicit.

The explicit method is Dormand and Prince's, of order 5 (J. Comput. Appl. Math. 6 (1980),
RK5(4)7M). The difference from the embedded result of order 4 shows whether the step was short
enough.

Under strong damping, rates settle with a time constant (inertia / damping) that may be much
shorter than a step. Explicit steps diverge unless they are as short as this time constant, whereas
only accuracy limits linearly implicit (Rosenbrock) steps. The implicit method is Rodas5P, of order
5, L-stable and stiffly accurate (G. Steinebach, BIT Numer. Math. 63 (2023), article 27). With the
jacobian J of the slope, the stages of the method solve

    (1 / gamma - h J) k_i = slope(y + h sum_j a_ij k_j) + sum_j c_ij k_j.

Half of the slope consists of the rates themselves, so each stage only requires solving a system of
n equations for n coordinates. The last stage gives the difference from the result of order 4.
"""

import operator
from collections.abc import Callable, Sequence
from typing import NamedTuple

from linkage_ros.formulas import ZERO, total, where
from linkage_ros.numeric import Real

_NUDGE = 1e-7  # relative step of a value, or of its unit, for derivatives


class Method(NamedTuple):
    """The coefficients of a Runge-Kutta method: weights of the slopes, 0 for unused slopes.

    Attributes:
        stages: Weights for each point at which a slope after the first is evaluated.
        end: Weights for the values at the end of a step.
        error: Weights for the error of a step; the last weight is for the slope at its end.
    """

    stages: tuple[tuple[Real, ...], ...]
    end: tuple[Real, ...]
    error: tuple[Real, ...]


DORMAND_PRINCE = Method(
    (
        (0.2,),
        (3 / 40, 9 / 40),
        (44 / 45, -56 / 15, 32 / 9),
        (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729),
        (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656),
    ),
    (35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84),
    (71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40),
)
_GAMMA = 0.21193756319429014
_SIXTH = (
    -7.502846399306121, 2.561846144803919, -11.627539656261098, -0.18268767659942256,
    0.030198172008377946,
)  # fmt: skip
_RODAS = Method(
    (
        (),
        (3.0,),
        (2.849394379747939, 0.45842242204463923),
        (-6.954028509809101, 2.489845061869568, -10.358996098473584),
        (2.8029986275628964, 0.5072464736228206, -0.3988312541770524, -0.04721187230404641),
        _SIXTH,
        (*_SIXTH, 1.0),
        (*_SIXTH, 1.0, 1.0),
    ),
    (*_SIXTH, 1.0, 1.0, 1.0),
    (*[0.0] * 7, 1.0),
)
_COUPLINGS = (
    (),
    (-14.155112264123755,),
    (-17.97296035885952, -2.859693295451294),
    (147.12150275711716, -1.41221402718213, 71.68940251302358),
    (165.43517024871676, -0.4592823456491126, 42.90938336958603, -5.961986721573306),
    (24.854864614690072, -3.0009227002832186, 47.4931110020768, 5.5814197821558125,
     -0.6610691825249471),
    (30.91273214028599, -3.1208243349937974, 77.79954646070892, 34.28646028294783,
     -19.097331116725623, -28.087943162872662),
    (37.80277123390563, -3.2571969029072276, 112.26918849496327, 66.9347231244047,
     -40.06618937091002, -54.66780262877968, -9.48861652309627),
)  # fmt: skip


class Plant(NamedTuple):
    """The equations of motion integrated by a step.

    Attributes:
        units: Units of errors; see `DrivenMechanism.units`.
        accelerations: Function that returns the accelerations; its arguments are the coordinates,
            then their rates.
    """

    units: tuple[Real, ...]
    accelerations: Callable[..., Sequence[Real]]


def slope_at(
    accelerations: Callable[..., Sequence[Real]], y: tuple[Real, ...]
) -> tuple[Real, ...]:
    """Computes y', the rates followed by the accelerations; compiled as a formula."""
    changes, half = accelerations(*y), len(y) // 2
    return (*y[half:], *(changes[i] for i in range(half)))


def jacobian(plant: Plant, y: tuple[Real, ...], slope: tuple[Real, ...]) -> list[list[Real]]:
    """Computes the jacobian of the accelerations by finite differences; compiled as a formula.

    Args:
        plant: The equations of motion.
        y: Coordinates, then their rates.
        slope: y' at y.

    Returns:
        A row for each element of y, with the derivatives of all accelerations.
    """
    columns = []
    for i, (value, unit) in enumerate(zip(y, plant.units, strict=True)):
        # Step away from 0, where the force of a load may jump.
        size = _NUDGE * where(abs(value) >= unit, abs(value), unit)
        nudged = value + where(value >= 0.0, size, -size)
        there = slope_at(plant.accelerations, (*y[:i], nudged, *y[i + 1 :]))[len(y) // 2 :]
        pairs = zip(there, slope[len(y) // 2 :], strict=True)
        columns.append([(a - b) / (nudged - value) for a, b in pairs])
    return columns


def leap(
    plant: Plant, values: tuple[Real, ...], h: Real, slope: tuple[Real, ...]
) -> tuple[tuple[Real, ...], tuple[Real, ...], tuple[Real, ...]]:
    """Performs one step of a motion, or of many motions as arrays; compiled as a formula.

    Args:
        plant: The equations of motion.
        values: Coordinates, then their rates.
        h: Length of the step, s.
        slope: Rates and accelerations at the start of the step.

    Returns:
        The values and the slope at the end of the step, and the errors; see `errors`.
    """
    slopes, end = [slope], values
    for weights in (*DORMAND_PRINCE.stages, DORMAND_PRINCE.end):
        end = moved(weights, values, h, slopes)
        slopes.append(slope_at(plant.accelerations, end))
    return end, slopes[-1], errors(DORMAND_PRINCE.error, plant.units, end, h, slopes)


def moved(
    weights: Sequence[Real], values: tuple[Real, ...], h: Real, slopes: Sequence[Sequence[Real]]
) -> tuple[Real, ...]:
    """Returns values + h * (weighted sum of the slopes); compiled as a formula."""
    used = [(weight, rates) for weight, rates in zip(weights, slopes, strict=True) if weight]
    return tuple(
        value + h * total(weight * rates[i] for weight, rates in used)
        for i, value in enumerate(values)
    )


def errors(
    weights: Sequence[Real],
    units: Sequence[Real],
    end: tuple[Real, ...],
    h: Real,
    slopes: Sequence[Sequence[Real]],
) -> tuple[Real, ...]:
    """Estimates the errors of a step; compiled as a formula.

    Args:
        weights: Weights of the slopes in the error.
        units: Units of the errors; see `DrivenMechanism.units`.
        end: The values at the end of the step.
        h: Length of the step, s.
        slopes: The slopes evaluated in the step.

    Returns:
        The error of each value in its unit; for a rate above one unit, the relative error.
    """
    sizes = [
        unit if i < len(end) // 2 else where(unit >= abs(value), unit, abs(value))
        for i, (unit, value) in enumerate(zip(units, end, strict=True))
    ]
    apart = moved(weights, (ZERO,) * len(end), h, slopes)
    return tuple(abs(part) / size for part, size in zip(apart, sizes, strict=True))


def stiff_leap(
    plant: Plant, values: tuple[Real, ...], h: Real, slope: tuple[Real, ...]
) -> tuple[tuple[Real, ...], tuple[Real, ...], tuple[Real, ...]]:
    """Performs one linearly implicit step; compiled as a formula.

    See `leap` for the arguments and the result.
    """
    derivatives = jacobian(plant, values, slope)
    results: list[tuple[Real, ...]] = []
    for weights, couplings in zip(_RODAS.stages, _COUPLINGS, strict=True):
        if results:
            slope = slope_at(plant.accelerations, moved(weights, values, h, results))
        right = [
            value + total(map(operator.mul, couplings, others))
            for value, *others in zip(slope, *results, strict=True)
        ]
        results.append(_solved(h * _GAMMA, derivatives, right))
    end = moved(_RODAS.end, values, h, results)
    apart = errors(_RODAS.error, plant.units, end, h, results)
    return end, slope_at(plant.accelerations, end), apart


def _solved(
    part: Real, derivatives: Sequence[Sequence[Real]], right: Sequence[Real]
) -> tuple[Real, ...]:
    """Solves the equations of one stage for k_i; `part` is gamma h, s."""
    count = len(derivatives) // 2
    # Of acceleration i with respect to coordinate j, and to rate j.
    by_place = [*zip(*derivatives[:count], strict=True)]
    by_rate = [*zip(*derivatives[count:], strict=True)]
    matrix = [
        [float(i == j) - part * (by_rate[i][j] + part * by_place[i][j]) for j in range(count)]
        for i in range(count)
    ]
    matrix_right = [
        _GAMMA * (right[count + i] + part * total(map(operator.mul, by_place[i], right)))
        for i in range(count)
    ]
    rates = _eliminated(matrix, matrix_right)
    places = (_GAMMA * value + part * rate for value, rate in zip(right, rates, strict=False))
    return (*places, *rates)


def _eliminated(rows: Sequence[Sequence[Real]], right: Sequence[Real]) -> list[Real]:
    """Solves equations by elimination, without pivoting because the identity dominates."""
    (pivot, *row), *other_rows = rows
    first_right, *other_rights = right
    if not other_rows:
        return [first_right / pivot]
    reduced_rows, reduced_right = list[list[Real]](), list[Real]()
    for other_row, other_right in zip(other_rows, other_rights, strict=True):
        factor = other_row[0] / pivot
        reduced_rows.append([x - factor * y for x, y in zip(other_row[1:], row, strict=True)])
        reduced_right.append(other_right - factor * first_right)
    others = _eliminated(reduced_rows, reduced_right)
    first = (first_right - total(map(operator.mul, row, others))) / pivot
    return [first, *others]
