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
from linkage_ros.internals import Ranges, reach_of
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
    found = np.full((len(designs), 1 + len(task.measures)), math.nan)
    base = flatten(task.drawing or task.mechanism)
    for row, design in zip(found, designs.tolist(), strict=True):
        given = dict(zip(task.names, design, strict=True))
        speed = given.pop(SPEED if task.drives_slide else RPM, task.speed or 0.0)
        speed = speed if task.drives_slide else speed * math.pi / 30
        run = _run(task, with_values(base, given), speed)
        if isinstance(run, int):
            row[0] = run
            continue
        row[:] = TURNS, *(MEASURES[name].of(run) for name in task.measures)
    return found


def with_values(values: Mapping[str, Any], given: Mapping[str, float]) -> dict[str, Any]:
    """Returns parameters with other values.

    Args:
        values: Values by dotted parameter name.
        given: Values to replace; a name that ends with .0 or .1 is a number of a pair.
    """
    found = dict(values)
    for name, value in given.items():
        owner, _, index = name.rpartition('.')
        if index.isdigit():
            pair = list(found[owner])
            pair[int(index)] = value
            found[owner] = tuple(pair)
        else:
            found[name] = value
    return found


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
    try:
        solver = Solver(mechanism)
    except ConfigurationError:
        solver = None
    try:
        reach = cast('Reach', solver.mobility if solver else reach_of(mechanism))
    except MechanismError:  # a dyad closes nowhere
        return CANNOT_TURN
    if not (task.way.fits(reach) if task.way else reach.turns_fully):
        return CANNOT_TURN
    if solver is None:
        return REFUSED
    try:
        Ranges(solver).require_valves(task.way.reversals if task.way else ())
    except ConfigurationError:
        return REVERSES
    return Run(task, solver, speed)
