# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Creates and measures the designs of a study, each like the mechanism of a parameter file."""

import math
from collections.abc import Mapping
from typing import Any, cast

import numpy as np

from linkage_lab.sweep.measures import MEASURES, Run, Task
from linkage_ros import ConfigurationError, MechanismError, Reach, Solver
from linkage_ros.formulas import Array
from linkage_ros.internals import Ranges, radians_per_second, reach_of
from linkage_ros.quantities import build, flatten

RPM, SPEED = 'rpm', 'speed'
CANNOT_TURN, TURNS, REFUSED, REVERSES = range(4)


def measured(task: Task, designs: Array) -> Array:
    """Computes all measures of many designs.

    Args:
        task: The base mechanism, the varied parameters and the measures.
        designs: Parameter values; a row for each design, a column for each name in the task.

    Returns:
        A row for each design: TURNS or CANNOT_TURN; or, if it can turn, or make the motion of the
        task, REFUSED if a spring or load curve does not fit, REVERSES if the crank reverses where
        a gas has valves; then the measures, NaN where one does not apply.
    """
    rows = np.full((len(designs), 1 + len(task.measures)), math.nan)
    base = flatten(task.drawing or task.mechanism)
    speed_name = SPEED if task.drives_slide else RPM
    for row, design in zip(rows, designs.tolist(), strict=True):
        varied = dict(zip(task.names, design, strict=True))
        speed = varied.pop(speed_name, task.speed or 0.0)
        if not task.drives_slide:
            speed = radians_per_second(speed)
        run = _run(task, with_values(base, varied), speed)
        if isinstance(run, Run):
            row[:] = TURNS, *(MEASURES[name].of(run) for name in task.measures)
        else:
            row[0] = run
    return rows


def with_values(values: Mapping[str, Any], replaced: Mapping[str, float]) -> dict[str, Any]:
    """Returns parameters with other values.

    Args:
        values: Values by dotted parameter name.
        replaced: Values to replace; a name that ends with .0 or .1 is a number of a pair.
    """
    result = dict(values)
    for name, value in replaced.items():
        pair_name, _, index = name.rpartition('.')
        if index.isdigit():
            pair = list(result[pair_name])
            pair[int(index)] = value
            result[pair_name] = tuple(pair)
        else:
            result[name] = value
    return result


def _run(task: Task, values: Mapping[str, Any], speed: float) -> Run | int:
    """Creates a design with the checks of a parameter file.

    Returns:
        Its run, or the reason why there is none: CANNOT_TURN, REFUSED or REVERSES.
    """
    try:
        mechanism = build(type(task.drawing or task.mechanism), values).converted()
    except MechanismError:
        return CANNOT_TURN
    except ConfigurationError:
        return REFUSED
    if not _can_move(task, mechanism):
        return CANNOT_TURN
    try:
        solver = Solver(mechanism)
    except ConfigurationError:
        return REFUSED
    try:
        Ranges(solver).require_valves(task.prescribed.reversals if task.prescribed else ())
    except ConfigurationError:
        return REVERSES
    return Run(task, solver, speed)


def _can_move(task: Task, mechanism: Any) -> bool:
    """Returns whether a design can turn fully, or make the prescribed motion of the task."""
    try:
        reach = cast('Reach', reach_of(mechanism))
    except MechanismError:  # a dyad closes nowhere
        return False
    return task.prescribed.fits(reach) if task.prescribed else reach.turns_fully
