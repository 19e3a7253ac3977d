# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Stroke or swing of the output link."""

import math
from dataclasses import replace
from typing import Any, NamedTuple, cast

import numpy as np

from linkage_ros.errors import ConfigurationError
from linkage_ros.mechanism.solver import Solver
from linkage_ros.numeric import signs_around
from linkage_ros.quantities import shown

_SAME = 16 * 2.0**-53 * math.tau  # rad; a few rounding errors of an angle of one turn


class Travel(NamedTuple):
    """Stroke or swing of the output link over a period.

    Attributes:
        output: Name of the output link, such as 'rocker' or 'slider'.
        slides: Whether the output link slides.
        extremes: Lowest and highest position, rad or m. An angle exceeds pi only if the link
            swings through pi. None if the link turns fully.
        at: Crank angles at which the link reverses, rad, in [0, 2 pi) or [0, 4 pi).
        transmission: Smallest and largest transmission angle, between coupler and rocker or
            between coupler and the normal of the guide, rad in [0, pi]. None if the mechanism has
            no transmission angle.
        time_ratio: Ratio of the longer to the shorter crank rotation between the two reversals;
            None unless there are exactly two reversals.
    """

    output: str
    slides: bool
    extremes: tuple[float, float] | None
    at: tuple[float, ...]
    transmission: tuple[float, float] | None
    time_ratio: float | None

    def words(self) -> list[str]:
        """Describes stroke or swing, transmission angle and time ratio; angles in degrees."""
        words = [f'{self.output} turns fully']
        if self.extremes is not None:
            name, unit = ('stroke', 'm') if self.slides else ('swing', 'deg')
            low, high = self.extremes if self.slides else map(math.degrees, self.extremes)
            words = [f'{name} {high - low:.6g} {unit} ({low:.6g} to {high:.6g} {unit})']
        if self.transmission:
            low, high = (math.degrees(angle) for angle in self.transmission)
            words.append(f'transmission angle {low:.4g} to {high:.4g} deg')
        return words if self.time_ratio is None else [*words, f'time ratio {self.time_ratio:.4g}']


def travel(solver: Solver) -> Travel:
    """Finds the extreme positions and reversals of the output link.

    Args:
        solver: Solver of a mechanism whose crank turns fully.

    Returns:
        The travel. Its positions are accurate to a few ulp, because an error of the crank angle
        has only a second-order effect on an extreme position.

    Raises:
        ConfigurationError: The argument is not a `Solver`.
        MechanismError: The crank does not turn fully.
    """
    if not isinstance(solver, Solver):
        raise ConfigurationError(f'{shown(solver)}: must be a Solver, as in Solver(mechanism)')
    if solver.mechanism.loads:  # they do not change the motion, but friction may lock the crank
        solver = Solver(replace(cast('Any', solver.mechanism), loads=()))
    reach = solver.reach
    reach.require_full_turn()
    period = reach.period_turns * 2 * math.pi
    crank = reach.samples()
    crank = 0.5 * (crank[1:] + crank[:-1])
    crank = np.append(crank, crank[0] + period)
    state = solver.state(crank, 1.0)
    output = solver.structure.output_index
    position, rate = state.position[output], state.velocity[output]
    slides = solver.structure.links[output].slides

    def whole_turns(angle: float) -> float:
        return 0.0 if slides else 2 * math.pi * round(float(angle) / (2 * math.pi))

    position = position if slides else np.unwrap(position)
    if not slides and np.ptp(position) <= _SAME:  # at rest: its rate is a rounding error
        position, rate = np.full_like(position, np.median(position)), np.zeros_like(rate)
    signs = signs_around(rate[:-1])
    before = np.flatnonzero(signs * np.roll(signs, -1) < 0)
    at = [_reversal(solver, *crank[i : i + 2].tolist(), rises=signs[i] > 0) for i in before]
    found = [solver.state(angle).position[output] for angle in at]
    # Each angle is shifted into the turn of the surrounding samples.
    reversed_at = [p + whole_turns(position[i] - p) for i, p in zip(before, found, strict=True)]
    extremes: tuple[float, float] | None = None
    if not whole_turns(position[-1] - position[0]):
        # If the output nearly rests, rounding errors may hide a reversal; include the samples.
        ends = *reversed_at, float(position.min()), float(position.max())
        seam = whole_turns(0.5 * (min(ends) + max(ends)))
        extremes = min(ends) - seam, max(ends) - seam
    ratio = None
    if len(at) == 2:
        way = at[1] - at[0]
        ratio = max(way, period - way) / min(way, period - way)
    reversals = tuple(sorted(angle % period for angle in at))
    return Travel(solver.links[output], slides, extremes, reversals, reach.transmission, ratio)


def _reversal(solver: Solver, low: float, high: float, *, rises: bool) -> float:
    """Finds the crank angle at which the output's rate changes sign, by bisection."""
    output = solver.structure.output_index
    while low < (middle := 0.5 * (low + high)) < high:
        if (solver.state(middle, 1.0).velocity[output] > 0) == rises:
            low = middle
        else:
            high = middle
    return high
