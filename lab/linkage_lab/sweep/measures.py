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
_NEWTON_STEPS = 8  # from a chord of a path to the path


class PrescribedMotion(NamedTuple):
    """A motion of the driven joint between two positions, or along a law.

    Attributes:
        low: Smallest position of the joint: crank angle, rad, or position of a slide, m.
        high: Largest position.
        law: Law of the motion; None for a constant speed from `low` to `high`.
        reversals: Positions at which the joint reverses along the law.
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
        return reach.turns_fully or any(
            self._is_inside(start, end, is_angle=not reach.slides) for start, end in reach.arcs
        )

    def _is_inside(self, start: float, end: float, *, is_angle: bool) -> bool:
        """Returns whether the motion lies inside an arc, or inside the arc in another turn."""
        shift = (self.low - start) // math.tau * math.tau if is_angle else 0.0
        return start + shift < self.low and self.high < end + shift


class Task(NamedTuple):
    """Specifies the computation for every design.

    Attributes:
        mechanism: The base mechanism of all designs.
        speed: Crank speed, rpm, or speed of a driven slide, m/s; None if the base has none.
        names: The parameters in which designs differ.
        measures: Names of the measures.
        angles: Number of crank angles in a turn, or of samples of a motion within an arc.
        points: Points that the traced point should pass through, x + iy, m.
        prescribed: Motion of the driven joint; None for whole turns at a constant speed.
        point: Name of the traced point.
        drawing: The drawing of the base mechanism, whose parameters vary; None without one.
    """

    mechanism: Mechanism
    speed: float | None
    names: tuple[str, ...]
    measures: tuple[str, ...]
    angles: int
    points: tuple[complex, ...] = ()
    prescribed: PrescribedMotion | None = None
    point: str = ''
    drawing: Any = None

    @property
    def has_law(self) -> bool:
        """Whether the driven joint follows a law."""
        return self.prescribed is not None and self.prescribed.law is not None

    @property
    def turns(self) -> bool:
        """Whether the crank makes whole turns, at a constant speed or along a law."""
        return self.prescribed is None or self.prescribed.turns

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
        prescribed, solver, speed = self.task.prescribed, self.solver, self.speed
        if prescribed is None:
            crank = samples(solver, speed, self.task.angles)
            return Samples(crank, lambda places: (places, speed))
        if prescribed.law is None:
            crank = np.linspace(prescribed.low, prescribed.high, self.task.angles)
            crank = with_breaks(crank, solver, lambda q: solver.state(q, speed))
            return Samples(crank, lambda places: (places, speed))
        time, motion = law_samples(solver, prescribed.law, self.task.angles - 1)
        return Samples(time, lambda places: motion(places)[:3])

    def efforts(self, places: Array) -> Array:
        """Computes the driving torque, N m, or force, N; and the force on the frame, N, if needed.

        Returns:
            A row of the torque and, if the shaking force is a measure and the design passes no
            change point, a row of the force; shape (1, n) or (2, n).
        """
        motion = self.samples.motion(places)
        arguments = ('q', 'u', 'a')[: len(motion)]  # no acceleration if the speed is constant
        if 'shaking_force' not in self.task.measures or self.is_in_line:
            (effort,) = self.solver.program(torque, *arguments)(*motion)
            return np.array([effort])
        program = self.solver.program(_torque_and_force, *arguments)
        effort, force_x, force_y = program(*motion)
        return np.array([effort, np.hypot(force_x, force_y)])

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
    def shaking_force(self) -> float:
        """Largest force on the frame, N, as in charts."""
        if not self.is_in_line:
            return float(self.peaks[1])
        x, motion = self.samples
        position, speed, *_ = motion(x)
        speeds = np.broadcast_to(speed, len(x))
        in_line = at_change_points(self.solver, position, speeds)
        fastest = float(np.abs(speeds).max()) if self.task.has_law else 0.0
        columns, _ = joint_forces(self.solver, motion, x, in_line, fastest)
        force_x, force_y = (columns[f'shaking_force.{axis}'].values for axis in 'xy')
        return extent(x, np.hypot(force_x, force_y)).high

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
        prescribed = self.task.prescribed
        if prescribed is None or prescribed.turns:
            extremes = self.travel.extremes
        else:
            extremes = extremes_between(self.solver, prescribed.low, prescribed.high)
        if extremes is None:
            return math.nan
        distance = extremes[1] - extremes[0]
        turns_fully = not self.task.output_slides and distance >= math.tau - _IN_LINE
        return math.nan if turns_fully else distance

    @cached_property
    def transmission(self) -> float:
        """Smallest transmission angle, as an acute angle, rad; infinite if there is none."""
        prescribed, reach = self.task.prescribed, self.solver.reach
        if prescribed is None or prescribed.turns:
            if reach.transmission is None:
                return math.inf
            smallest, largest = reach.transmission
            return min(smallest, math.pi - largest)
        # It is smallest at an end of the motion, or where crank and frame are in line: at the
        # angle `fast` or half turns away.
        low, high = prescribed.low, prescribed.high
        first, last = (math.ceil((end - reach.fast) / math.pi) for end in (low, high))
        in_line = (reach.fast + i * math.pi for i in range(first, last))
        cranks = (low, *in_line, high)
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
    lambda task: (task.speed is not None or task.has_law) and not task.mechanism.joint_loads(),
)
_DRIVEN_CRANK = Need('a driven crank', lambda task: not task.drives_slide)
_DRIVEN_SLIDE = Need('a driven cylinder or slider', lambda task: task.drives_slide)
_SWINGS = Need('an output link that swings', lambda task: not task.output_slides)
_SLIDES = Need('a slider', lambda task: task.output_slides)
_WHOLE_TURNS = Need(
    'a crank that turns fully, without a law', lambda task: task.prescribed is None
)
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


def _point_distance(run: Run) -> float:
    """Computes the largest distance of the given points from the path of the traced point."""
    solver, points = run.solver, np.array(run.task.points)
    constants = Constants((solver.model.loop, solver.structure.points[run.task.point]))
    motion = Program(_path_motion, constants, ('crank_angle',))
    step = math.tau / run.task.angles
    crank = (np.arange(solver.reach.period_turns * run.task.angles) + 0.5) * step
    x, y, *_ = motion(crank)
    chord, fraction = _nearest_on_chords(points, x + 1j * y)
    start = crank[chord]
    distances = _distances_from_path(
        motion, points, start + step * fraction, low=start - step, high=start + 2 * step
    )
    return float(distances.max())


def _nearest_on_chords(points: Array, path: Array) -> tuple[Any, Array]:
    """Finds the nearest place to each point on the closed polygon through samples of a path.

    Args:
        points: Points, x + iy, shape (m,).
        path: Vertices of the polygon, x + iy, shape (n,).

    Returns:
        The index of the vertex before the nearest place, and the fraction of the side between
        them, each of shape (m,).
    """
    chords = np.roll(path, -1) - path
    along = (points[:, None] - path) / chords  # the real part is the fraction of the chord
    fractions = np.clip(along.real, 0.0, 1.0)
    nearest = np.abs(chords * (along - fractions)).argmin(axis=1)
    return nearest, fractions[np.arange(len(points)), nearest]


def _distances_from_path(
    motion: Callable[..., Any], points: Array, crank: Array, *, low: Array, high: Array
) -> Array:
    """Computes the distances of points from a path by Newton's method, m.

    Args:
        motion: Function that computes the six values of `_path_motion` at crank angles.
        points: Points, x + iy, m, shape (m,).
        crank: Approximate crank angle of the nearest place to each point, rad.
        low: Smallest crank angle to use for each point, rad.
        high: Largest one.
    """
    smallest: Array = np.full(len(points), math.inf)
    for _ in range(_NEWTON_STEPS):
        x, y, dx, dy, ddx, ddy = motion(crank)
        gap, tangent, bend = x + 1j * y - points, dx + 1j * dy, ddx + 1j * ddy
        smallest = np.fmin(smallest, np.abs(gap))
        # Derivatives of half the squared distance with respect to the crank angle. Where the
        # second is not positive, the term with the gap is left out, as in Gauss-Newton.
        gradient = (gap * tangent.conj()).real
        square = np.abs(tangent) ** 2
        curvature = square + (gap * bend.conj()).real
        change = gradient / np.where(curvature > 0, curvature, square)
        crank = np.clip(crank - change, low, high)
    return smallest


def _torque_and_force(model: Any, q: Any, u: Any, a: Any = ()) -> tuple[Real, ...]:
    """Computes the driving torque, and the components of the force on the frame, N."""
    return *torque(model, q, u, a), *reactions(model, q, u, a)[2]


def _path_motion(constants: Any, angle: Real) -> tuple[Real, ...]:
    """Computes a point's position and its derivatives with respect to the angle.

    Returns:
        x and y, m, of the position, the first and the second derivative.
    """
    loop, point = constants
    links = loop.pose((angle,)).links
    vectors = point.motion(
        [link.direction for link in links],
        [link.jacobian[0] for link in links],
        [link.curvature[0] for link in links],
    )
    return tuple(component for vector in vectors for component in vector)


def _time_ratio(run: Run) -> float:
    """Computes the ratio of the longer to the shorter crank rotation between reversals."""
    ratio = run.travel.time_ratio
    return math.nan if ratio is None else ratio


def _peak(run: Run) -> float:
    """Computes the largest driving torque or force."""
    return float(run.peaks[0])


def _rms(run: Run) -> float:
    """Computes the root mean square over time of the driving torque or force."""
    return math.sqrt(mean(run.samples.x, run.sampled[0] ** 2))


MEASURES = {
    'peak_torque': Measure('N m', _peak, (_SPEED, _DRIVEN_CRANK)),
    'peak_force': Measure('N', _peak, (_SPEED, _DRIVEN_SLIDE)),
    'rms_torque': Measure('N m', _rms, (_SPEED, _DRIVEN_CRANK)),
    'rms_force': Measure('N', _rms, (_SPEED, _DRIVEN_SLIDE)),
    'shaking_force': Measure('N', lambda run: run.shaking_force, (_SPEED,)),
    'swing': Measure('deg', lambda run: math.degrees(run.output_range), (_SWINGS,)),
    'stroke': Measure('m', lambda run: run.output_range, (_SLIDES,)),
    'time_ratio': Measure('', _time_ratio, (_WHOLE_TURNS,)),
    'transmission_angle': Measure(
        'deg', lambda run: math.degrees(run.transmission), (_TRANSMISSION,)
    ),
    'point_distance': Measure('m', _point_distance, (_POINTS, _WHOLE_TURNS)),
}
