# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Stroke or swing of the output link."""

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NamedTuple, cast

import numpy as np

from linkage_ros.errors import ConfigurationError
from linkage_ros.mechanism.solver import Solver
from linkage_ros.mechanism.structure import output_index
from linkage_ros.numeric import Array, Real, signs_around
from linkage_ros.quantities import shown

_SAME = 16 * 2.0**-53 * math.tau  # rad; a few rounding errors of an angle of one turn
_LAST_STEP = 2 * math.ulp(math.tau)  # rad or m; a smaller step is a rounding error
_STEPS = 720  # samples of an arc, or of a turn


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
    is_drawn: bool = False

    def words(self) -> list[str]:
        """Describes stroke or swing, transmission angle and time ratio; angles in degrees."""
        words = [f'{self.output} turns fully']
        if self.extremes is not None:
            name, unit = ('stroke', 'm') if self.slides else ('swing', 'deg')
            name = f'{name} of {self.output}' if self.is_drawn else name
            low, high = self.extremes if self.slides else map(math.degrees, self.extremes)
            words = [f'{name} {high - low:.4g} {unit} ({low:.4g} to {high:.4g} {unit})']
        if self.transmission:
            low, high = (math.degrees(angle) for angle in self.transmission)
            words.append(f'transmission angle {low:.4g} to {high:.4g} deg')
        return words if self.time_ratio is None else [*words, f'time ratio {self.time_ratio:.4g}']


def travel(solver: Solver) -> Travel:
    """Finds the extreme positions and reversals of the output link of a crank that turns fully.

    The positions are accurate to a few ulp, because an error of the crank angle has only a
    second-order effect on an extreme position.

    Raises:
        ConfigurationError: The argument is not a `Solver`.
        MechanismError: The crank does not turn fully.
    """
    if not isinstance(solver, Solver):
        raise ConfigurationError(f'{shown(solver)}: must be a Solver, as in Solver(mechanism)')
    solver.reach.require_full_turn()
    reach, output = cast('Any', solver.motion_reach), _Output(solver)
    period = reach.period_turns * math.tau
    ends = reach.samples(_STEPS)
    crank = 0.5 * (ends[1:] + ends[:-1])  # in the middle of each step, and a period later
    crank = np.append(crank, crank[0] + period)
    position, rate = output.path(crank)
    if not output.slides and np.ptp(position) <= _SAME:  # at rest: its rate is a rounding error
        position, rate = np.full_like(position, np.median(position)), np.zeros_like(rate)
    signs = signs_around(rate[:-1])
    following = np.append(signs[1:], signs[0])
    reversals = [*output.reversals(crank, position, signs, following)]
    angles = [angle for angle, _ in reversals]
    turns_fully = output.whole_turns(position[-1] - position[0]) != 0
    return Travel(
        solver.output,
        output.slides,
        extremes=None if turns_fully else output.extremes(position, reversals),
        at=tuple(sorted(angle % period for angle in angles)),
        transmission=reach.transmission,
        time_ratio=_time_ratio(angles, period),
        is_drawn=solver.mechanism.drawn is not None,
    )


def _time_ratio(reversals: Sequence[float], period: float) -> float | None:
    """Returns the ratio of the crank rotations between two reversals; see `Travel`."""
    if len(reversals) != 2:
        return None
    first, second = reversals
    forth = second - first
    back = period - forth
    return max(forth, back) / min(forth, back)


def extremes_between(solver: Solver, low: float, high: float) -> tuple[float, float]:
    """Finds the extreme positions of the output link while the driven joint covers an arc.

    Args:
        solver: Solver of a mechanism with one degree of freedom.
        low: Smallest crank angle, rad, or position of a driven slide, m; within its reach.
        high: The largest one.

    Returns:
        Lowest and highest position, rad or m, as in `Travel.extremes`. They are 2 pi or more apart
        if the link turns fully.
    """
    reach, output = cast('Any', solver.motion_reach), _Output(solver)
    if reach.slides:
        driven = np.linspace(low, high, _STEPS + 1)
    else:
        period = reach.period_turns * math.tau
        shifts = period * np.arange(math.floor(low / period), math.ceil(high / period))
        samples = np.ravel(reach.samples(_STEPS)[:-1] + shifts[:, None])
        inside = samples[(low < samples) & (samples < high)]
        driven = np.array([low, *inside, high])
    position, rate = output.path(driven)
    signs = signs_around(rate)
    reversals = output.reversals(driven, position, signs[:-1], signs[1:])
    return output.extremes(position, reversals)


class _Output:
    """The motion of the output link, over the position of the driven joint.

    Attributes:
        slides: Whether the output link slides.
    """

    def __init__(self, solver: Solver) -> None:
        """Prepares the programs for a mechanism with one degree of freedom."""
        self.slides = solver.structure.links[solver.structure.output_index].slides
        self._path = solver.program(_path, 'q')
        self._motion = solver.program(_motion, 'q').floats

    def whole_turns(self, angle: float) -> float:
        """Returns the whole turns that are nearest to an angle, rad; 0 if the link slides."""
        return 0.0 if self.slides else math.tau * round(float(angle) / math.tau)

    def path(self, crank: Array) -> tuple[Array, Array]:
        """Computes the positions, as a continuous function, and their derivative."""
        position, rate = self._path(crank)
        if not self.slides and np.ptp(position) > math.pi:
            position = np.unwrap(position)
        return position, rate

    def reversals(
        self, driven: Array, position: Array, signs: Array, following: Array
    ) -> Iterator[tuple[float, float]]:
        """Yields the crank angle and the position of each reversal between two samples.

        Args:
            driven: The samples of the driven joint, in increasing order.
            position: Positions there, from `path`.
            signs: Sign of the rate at each sample but the last.
            following: Sign of the rate at the sample that follows each of them.
        """
        for i in np.flatnonzero(signs * following < 0):
            low, high = driven[i : i + 2].tolist()
            angle, place = self._reversal(low, high, rises=signs[i] > 0)
            # Each angle is shifted into the turn of the surrounding samples.
            yield angle, place + self.whole_turns(position[i] - place)

    def _reversal(self, low: float, high: float, *, rises: bool) -> tuple[float, float]:
        """Finds where the rate changes its sign, by Newton's method with bisection.

        Returns:
            The crank angle, and the position there.
        """
        at, last_size = 0.5 * (low + high), math.inf
        while True:
            position, rate, slope = self._motion(at)
            if (rate > 0) == rises:
                low = at
            else:
                high = at
            middle = 0.5 * (low + high)
            step = -rate / slope if slope else math.inf
            converges = low <= at + step <= high and 2 * abs(step) < last_size
            if not converges:
                step = middle - at
            if abs(step) <= _LAST_STEP or not low < middle < high:
                return at + step, position
            at, last_size = at + step, abs(step)

    def extremes(
        self, position: Array, reversals: Iterable[tuple[float, float]]
    ) -> tuple[float, float]:
        """Returns the lowest and the highest position, given samples and reversals."""
        # If the output nearly rests, rounding errors may hide a reversal; include the samples.
        ends = *(place for _, place in reversals), float(position.min()), float(position.max())
        seam = self.whole_turns(0.5 * (min(ends) + max(ends)))
        return min(ends) - seam, max(ends) - seam


def _motion(model: Any, q: tuple[Real]) -> tuple[Real, Real, Real]:
    """Computes the position of the output link, and its first two derivatives."""
    link = model.loop.pose(q).links[output_index(model.links, model.driven)]
    return link.position, link.jacobian[0], link.curvature[0]


def _path(model: Any, q: tuple[Real]) -> tuple[Real, Real]:
    """Computes the position of the output link, and its first derivative."""
    return _motion(model, q)[:2]
