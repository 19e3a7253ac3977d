# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Integrates torque-driven motion with strong damping in fixed linearly implicit steps.

Under strong damping, rates settle with a time constant (inertia / damping) that may be much
shorter than a step. Explicit steps diverge unless they are as short as this time constant, whereas
only accuracy limits linearly implicit (Rosenbrock) steps. The method is Rodas5P, of order 5,
L-stable and stiffly accurate (G. Steinebach, BIT Numer. Math. 63 (2023), article 27). With the
jacobian J of the slope, the stages of the method solve

    (1 / gamma - h J) k_i = slope(y + h sum_j a_ij k_j) + sum_j c_ij k_j.

Half of the slope consists of the rates themselves, so each stage only requires solving a system of
n equations for n coordinates. The last stage gives the difference from the result of order 4.
"""

from __future__ import annotations

import operator
from collections.abc import Sequence

from linkage_ros.formulas import total
from linkage_ros.motion.driven_mechanism import jacobian, slope_at
from linkage_ros.motion.fixed_step_integrator import FixedSteps, Method, Plant, errors, moved
from linkage_ros.numeric import Real

_GAMMA = 0.21193756319429014
_SIXTH = (
    -7.502846399306121, 2.561846144803919, -11.627539656261098, -0.18268767659942256,
    0.030198172008377946,
)  # fmt: skip
_METHOD = Method(
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


def stiff_leap(
    plant: Plant, values: tuple[Real, ...], h: Real, slope: tuple[Real, ...]
) -> tuple[tuple[Real, ...], tuple[Real, ...], tuple[Real, ...]]:
    """Performs one linearly implicit step; compiled as a formula.

    See `fixed_step_integrator.leap` for the arguments and the result.
    """
    derivatives = jacobian(plant.accelerations, plant.units, values, slope)
    results: list[tuple[Real, ...]] = []
    for weights, couplings in zip(_METHOD.stages, _COUPLINGS, strict=True):
        if results:
            slope = slope_at(plant.accelerations, moved(weights, values, h, results))
        right = [
            value + total(map(operator.mul, couplings, others))
            for value, *others in zip(slope, *results, strict=True)
        ]
        results.append(_solved(h * _GAMMA, derivatives, right))
    end = moved(_METHOD.end, values, h, results)
    apart = errors(_METHOD.error, plant.units, end, h, results)
    return end, slope_at(plant.accelerations, end), apart


class StiffSteps(FixedSteps):
    """Integrates a motion in equal steps whose length strong damping does not limit."""

    _formula = staticmethod(stiff_leap)


def _solved(
    part: Real, derivatives: Sequence[Sequence[Real]], right: Sequence[Real]
) -> tuple[Real, ...]:
    """Solves the equations of one stage.

    Args:
        part: gamma h, s.
        derivatives: Result of `jacobian`.
        right: Right-hand side of the equations, in the units of a slope.

    Returns:
        The result k_i of the stage, in the same units.
    """
    count = len(derivatives) // 2
    by_place, by_rate = (
        [list(row) for row in zip(*half, strict=True)]
        for half in (derivatives[:count], derivatives[count:])
    )
    rows = [
        [float(i == j) - part * (by_rate[i][j] + part * by_place[i][j]) for j in range(count)]
        for i in range(count)
    ]
    forces = [
        _GAMMA * (right[count + i] + part * total(map(operator.mul, by_place[i], right)))
        for i in range(count)
    ]
    rates = _eliminated(rows, forces)
    places = (_GAMMA * value + part * rate for value, rate in zip(right, rates, strict=False))
    return (*places, *rates)


def _eliminated(rows: Sequence[Sequence[Real]], right: Sequence[Real]) -> list[Real]:
    """Solves equations by elimination, without pivoting because the identity dominates."""
    (pivot, *row), *others = rows
    if not others:
        return [right[0] / pivot]
    factors = [other[0] / pivot for other in others]
    rest = _eliminated(
        [
            [x - factor * y for x, y in zip(other[1:], row, strict=True)]
            for factor, other in zip(factors, others, strict=True)
        ],
        [x - factor * right[0] for factor, x in zip(factors, right[1:], strict=True)],
    )
    return [(right[0] - total(map(operator.mul, row, rest))) / pivot, *rest]
