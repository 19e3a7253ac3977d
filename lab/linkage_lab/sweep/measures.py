# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Measures of one design over a period of its crank, or along a motion within an arc."""

import math
from collections.abc import Callable
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from linkage_lab.gaps import at_change_points
from linkage_lab.period import extent, joint_forces, law_samples, mean
from linkage_lab.sampling import peaks, samples, with_breaks
from linkage_ros import Mechanism, Reach, Solver, Travel, travel
from linkage_ros.extensions import Constants, Program
from linkage_ros.formulas import Array, Real
from linkage_ros.internals import extremes_between, reactions, torque

_IN_LINE = 1e-12  # sine of an angle between links that are in line


class Way(NamedTuple):
    """A motion of the crank within an arc, which all designs make.

    Attributes:
        low: Smallest crank angle of the motion, rad; for a driven slide, a position, m.
        high: Largest crank angle.
        law: Law of the motion; None for a constant speed from the smallest angle to the largest.
        reversals: Crank angles at which the crank reverses.
    """

    low: float
    high: float
    law: Any = None
    reversals: tuple[float, ...] = ()

    @property
    def turns(self) -> bool:
        """Whether the crank advances by whole turns in each repetition of the law."""
        return self.law is not None and bool(self.law.turns)

    def fits(self, reach: Reach) -> bool:
        """Returns whether a mechanism with this reach can make the motion."""
        starts = (start for start, _ in reach.arcs)
        shifts = (0.0 if reach.slides else (self.low - x) // math.tau * math.tau for x in starts)
        ends = zip(reach.arcs, shifts, strict=True)
        return reach.turns_fully or any(
            start + shift < self.low and self.high < end + shift for (start, end), shift in ends
        )


class Task(NamedTuple):
    """Specifies the computation for every design.

    Attributes:
        mechanism: The base mechanism of all designs.
        speed: Crank speed, rpm, or speed of a driven slide, m/s; None if the base has none.
        names: The parameters in which designs differ.
        measures: Names of the measures.
        angles: Number of crank angles in a turn, or of samples of a motion within an arc.
        points: Points that the traced point should pass through, x + iy, m.
        way: Motion of the crank; None for whole turns at a constant speed.
        point: Name of the traced point.
        drawing: The drawing of the base mechanism, whose parameters vary; None without one.
    """

    mechanism: Mechanism
    speed: float | None
    names: tuple[str, ...]
    measures: tuple[str, ...]
    angles: int
    points: tuple[complex, ...] = ()
    way: Way | None = None
    point: str = ''
    drawing: Any = None

    @property
    def drives_slide(self) -> bool:
        """Whether a cylinder or a slider is driven, not a crank."""
        return self.mechanism.structure().driven_link.slides

    @property
    def output_slides(self) -> bool:
        """Whether the output link is a slider."""
        structure = self.mechanism.structure()
        return structure.links[structure.output_index].slides


class Samples(NamedTuple):
    """The motion of the driven joint at samples.

    Attributes:
        x: Crank angles, rad, positions of a slide, m, or times of a law, s, increasing.
        motion: Function of such places that returns the positions of the driven joint, rad or m;
            its speed; and, unless the speed is constant, its accelerations.
    """

    x: Array
    motion: Callable[[Array], tuple[Real, ...]]


class Run:
    """One design in the motion that a task gives.

    Attributes:
        task: The task.
        solver: Solver of the design.
        speed: Speed of the driven joint, rad/s or m/s; unused if the task has a law.
    """

    def __init__(self, task: Task, solver: Solver, speed: float) -> None:
        """Prepares the measures, each of which is computed on demand."""
        self.task, self.solver, self.speed = task, solver, speed

    @cached_property
    def samples(self) -> Samples:
        """Samples of the motion, as charts take them."""
        way, solver, speed = self.task.way, self.solver, self.speed
        if way is None:
            crank = samples(solver, speed, self.task.angles)
            return Samples(crank, lambda places: (places, speed))
        if way.law is None:
            crank = np.linspace(way.low, way.high, self.task.angles)
            crank = with_breaks(crank, solver, lambda q: solver.state(q, speed))
            return Samples(crank, lambda places: (places, speed))
        time, motion = law_samples(solver, way.law, self.task.angles - 1)
        return Samples(time, lambda places: motion(places)[:3])

    def efforts(self, places: Array) -> Array:
        """Computes the driving torque, N m, or force, N; and the force on the frame, N, if needed.

        Returns:
            A row of the torque and, if the shaking force is a measure and the design passes no
            change point, a row of the force.
        """
        motion = self.samples.motion(places)
        has_force = 'shaking_force' in self.task.measures and not self.is_in_line
        formula: Callable[..., Any] = _torque_and_force if has_force else torque
        own, *force = self.solver.program(formula, *'qua'[: len(motion)])(*motion)
        return np.array([own, np.hypot(*force)] if force else [own])

    @cached_property
    def sampled(self) -> Array:
        """Result of `efforts` at the samples."""
        return self.efforts(self.samples.x)

    @cached_property
    def peaks(self) -> Array:
        """Largest magnitudes of the rows of `efforts`, as charts find them."""
        magnitudes = np.abs(self.sampled)
        return peaks(self.samples.x, magnitudes, lambda places: np.abs(self.efforts(places)))[0]

    @cached_property
    def shaking_in_line(self) -> float:
        """Largest force on the frame in a motion that passes a change point, N, as in charts."""
        x, motion = self.samples
        q, u, *_ = motion(x)
        rates = np.broadcast_to(u, len(x))
        in_line = at_change_points(self.solver, q, rates)
        is_over_time = self.task.way is not None and self.task.way.law is not None
        fastest = float(np.abs(rates).max()) if is_over_time else 0.0
        found, _ = joint_forces(self.solver, motion, x, in_line, fastest)
        return extent(x, np.hypot(*(found[f'shaking_force.{x}'].values for x in 'xy'))).high

    @cached_property
    def is_in_line(self) -> bool:
        """Whether the motion passes a change point."""
        return self.solver.reach.has_change_point and self.transmission < _IN_LINE

    @cached_property
    def travel(self) -> Travel:
        """Travel of the output over whole turns."""
        return travel(self.solver)

    @cached_property
    def output_range(self) -> float:
        """Distance of the output's extreme positions, m or rad; NaN if it turns fully."""
        way = self.task.way
        if way is None or way.turns:
            ends = self.travel.extremes
        else:
            ends = extremes_between(self.solver, way.low, way.high)
        found = math.nan if ends is None else ends[1] - ends[0]
        is_turn = not self.task.output_slides and found >= math.tau - _IN_LINE
        return math.nan if is_turn else found

    @cached_property
    def transmission(self) -> float:
        """Smallest transmission angle, as an acute angle, rad."""
        way, reach = self.task.way, self.solver.reach
        if way is None or way.turns:
            low, high = reach.transmission or (math.inf, -math.inf)
            return min(low, math.pi - high)
        # It is smallest at an end of the motion, or where crank and frame are in line.
        first, last = (math.ceil((x - reach.fast) / math.pi) for x in (way.low, way.high))
        cranks = [way.low, *(reach.fast + i * math.pi for i in range(first, last)), way.high]
        return math.asin(min(self.solver.dyad_sines((crank, 0.0))[0].sine for crank in cranks))


class Need(NamedTuple):
    """A requirement of measures.

    Attributes:
        words: The requirement in words.
        is_met: Function that returns whether a task meets it.
    """

    words: str
    is_met: Callable[[Task], bool]


_SPEED = Need(
    'a crank speed, such as rpm: 60.0 (of a cylinder or slider, speed: 0.1), or a law, and no dry '
    'friction',
    lambda task: (
        (task.speed is not None or (task.way is not None and task.way.law is not None))
        and not task.mechanism.joint_loads()
    ),
)
_DRIVEN_CRANK = Need('a driven crank', lambda task: not task.drives_slide)
_DRIVEN_SLIDE = Need('a driven cylinder or slider', lambda task: task.drives_slide)
_SWINGS = Need('an output link that swings', lambda task: not task.output_slides)
_SLIDES = Need('a slider', lambda task: task.output_slides)
_WHOLE_TURNS = Need('a crank that turns fully, without a law', lambda task: task.way is None)
_TRANSMISSION = Need(
    'a four_bar or a slider_crank',
    lambda task: (reach := task.mechanism.reach()) is not None and reach.transmission is not None,
)
_POINTS = Need(
    'a traced point in the base, and points: [x, y, ...]',
    lambda task: bool(task.points) and bool(task.point),
)


class Measure(NamedTuple):
    """One measure of designs.

    Attributes:
        unit: Unit of the measure.
        of: Function that computes the measure of a run; NaN if it does not exist.
        needs: Requirements on the task.
    """

    unit: str
    of: Callable[[Run], float]
    needs: tuple[Need, ...]

    @property
    def words(self) -> str:
        """The requirements in words."""
        return ', and '.join(need.words for need in self.needs)

    def applies(self, task: Task) -> bool:
        """Returns whether a task meets all requirements."""
        return all(need.is_met(task) for need in self.needs)


MEASURES: dict[str, Measure] = {}


def measure(
    unit: str, *needs: Need, name: str = ''
) -> Callable[[Callable[[Run], float]], Callable[[Run], float]]:
    """Declares a function of a run as a measure, under its own name or another one."""

    def declared(of: Callable[[Run], float]) -> Callable[[Run], float]:
        MEASURES[name or of.__name__] = Measure(unit, of, needs)
        return of

    return declared


@measure('N', _SPEED, _DRIVEN_SLIDE, name='peak_force')
@measure('N m', _SPEED, _DRIVEN_CRANK)
def peak_torque(run: Run) -> float:
    """Computes the largest driving torque or force."""
    return float(run.peaks[0])


@measure('N', _SPEED, _DRIVEN_SLIDE, name='rms_force')
@measure('N m', _SPEED, _DRIVEN_CRANK)
def rms_torque(run: Run) -> float:
    """Computes the root mean square over time of the driving torque or force."""
    return math.sqrt(mean(run.samples.x, run.sampled[0] ** 2))


@measure('N', _SPEED)
def shaking_force(run: Run) -> float:
    """Computes the largest force on the frame."""
    return run.shaking_in_line if run.is_in_line else float(run.peaks[1])


@measure('deg', _SWINGS)
def swing(run: Run) -> float:
    """Computes the angle between the extreme positions of the output."""
    return math.degrees(run.output_range)


@measure('m', _SLIDES)
def stroke(run: Run) -> float:
    """Computes the distance between the extreme positions of the output."""
    return run.output_range


@measure('', _WHOLE_TURNS)
def time_ratio(run: Run) -> float:
    """Computes the ratio of the longer to the shorter crank rotation between reversals."""
    found = run.travel.time_ratio
    return math.nan if found is None else found


@measure('deg', _TRANSMISSION)
def transmission_angle(run: Run) -> float:
    """Computes the smallest transmission angle, measured as an acute angle."""
    return math.degrees(run.transmission)


@measure('m', _POINTS, _WHOLE_TURNS)
def point_distance(run: Run) -> float:
    """Computes the largest distance of the given points from the path of the traced point."""
    solver, points = run.solver, np.array(run.task.points)
    constants = Constants((solver.model.loop, solver.structure.points[run.task.point]))
    motion = Program(_path_motion, constants, ('crank_angle',))
    turns, step = solver.reach.period_turns, math.tau / run.task.angles
    crank = (np.arange(turns * run.task.angles) + 0.5) * step
    x, y, *_ = motion(crank)
    path = x + 1j * y
    chords = np.roll(path, -1) - path
    ways = (points[:, None] - path) / chords
    parts = np.clip(ways.real, 0.0, 1.0)
    nearest = np.abs(chords * (ways - parts)).argmin(axis=1)
    before = crank[nearest]
    at = before + step * parts[np.arange(len(points)), nearest]
    found: Array = np.full(len(points), math.inf)
    for _ in range(8):  # Newton steps from the chord to the path
        rows = iter(motion(at))
        place, slope, bend = (x + 1j * y for x, y in zip(rows, rows, strict=True))
        gap, square = place - points, np.abs(slope) ** 2
        found = np.fmin(found, np.abs(gap))
        grows = square + (gap * bend.conj()).real
        way = (gap * slope.conj()).real / np.where(grows > 0, grows, square)
        at = np.clip(at - way, before - step, before + 2 * step)
    return float(found.max())


def _torque_and_force(model: Any, q: Any, u: Any, a: Any = ()) -> tuple[Real, ...]:
    """Computes the driving torque, and the components of the force on the frame, N."""
    return *torque(model, q, u, a), *reactions(model, q, u, a)[2]


def _path_motion(constants: Any, angle: Real) -> tuple[Real, ...]:
    """Computes a point's position and its derivatives with respect to the angle, m."""
    loop, point = constants
    links = loop.pose((angle,)).links
    found = point.motion(
        [link.direction for link in links],
        [link.jacobian[0] for link in links],
        [link.curvature[0] for link in links],
    )
    return tuple(x for vector in found for x in vector)
