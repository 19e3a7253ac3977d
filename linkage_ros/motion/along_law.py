# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Motion of a crank along a law, exact at every stamp even after years."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

from linkage_ros.errors import ConfigurationError, MotionError, UnreachableError
from linkage_ros.mechanism.conditions import Conditions
from linkage_ros.mechanism.ranges import Ranges
from linkage_ros.mechanism.solver import Solver
from linkage_ros.motion.law import Law, Moment, Sine, Spline
from linkage_ros.motion.segments import Coordinates, Gravity, Motion, Segment, stacked
from linkage_ros.motion.spline import joined
from linkage_ros.numeric import nearest_turns, with_turns
from linkage_ros.units import NS_PER_S, SLIDING, TURNING, JointUnits

# rad, rad/s or rad/s^2. Larger values cannot be meant, and their squares may overflow.
_LARGEST = 1e12
_WORDS = {False: ('angle', 'speed', 'acceleration'), True: ('position', 'speed', 'acceleration')}


@dataclass(frozen=True)
class LawSegment(Segment):
    """A segment in which the crank follows a law.

    Attributes:
        law: The law.
        time: Time of the law at the start, ns.
        turns: Whole turns to add to the angle of the law.
    """

    law: Law
    time: int = 0
    turns: int = 0
    old_stamp: int | None = None
    gravity: Gravity | None = None

    def motion(self) -> 'LawMotion':
        """Returns the motion in this segment."""
        return LawMotion(self)

    @property
    def size(self) -> int:
        """About the memory that the segment takes, bytes."""
        points = 0 if isinstance(self.law, Sine) else len(self.law.times)
        return super().size + 400 * points

    def words(self, units: JointUnits) -> str:
        """Describes position and rate at the start, and the law."""
        _, (speed,), _, angle, *_ = LawMotion(self).at(self.stamp)
        return (
            f'from {angle:.6f} {units.position}, {speed:.6f} {units.velocity} along '
            f'{self.law.words}'
        )


class LawMotion(Motion):
    """The motion in one segment.

    Attributes:
        segment: The segment, in the form stored in logs.
    """

    segment: LawSegment

    def __init__(self, segment: LawSegment, conditions: Conditions | None = None) -> None:
        self.segment = segment
        self.conditions = segment.conditions if conditions is None else conditions

    @classmethod
    def begin(cls, law: Law, stamp: int) -> 'LawMotion':
        """Starts a motion along a law at a stamp, ns."""
        return cls(LawSegment(stamp, law))

    def at(self, stamp: int) -> Coordinates:
        """Computes position, rate and acceleration of the driven joint; see `Motion.at`."""
        turns, place, rate, acceleration = self._moment(stamp)
        q, unwrapped = place, place
        if not self.segment.law.slides:
            # Pairs of turns, as `with_turns` counts them, and those beyond the range of two turns.
            pairs = turns / 2
            whole_pairs = int((turns + place / math.tau) / 2)
            unwrapped = with_turns(place, pairs)
            q = with_turns(place, pairs - whole_pairs)
        return Coordinates((q,), (rate,), (acceleration,), unwrapped, conditions=self.conditions)

    def at_all(self, stamps: Sequence[int]) -> Coordinates:
        """Computes the coordinates at many stamps; see `Motion.at_all`."""
        end = self.segment.law.end
        reached = [x for x in stamps if end is None or self._time(x) <= end]
        return stacked([self.at(stamp) for stamp in reached or stamps[:1]])

    def restamp(self, old: int, new: int) -> 'LawMotion':
        """Returns the motion after a step of the clock; see `Motion.restamp`."""
        time = self._time(old)
        segment = replace(self.segment, stamp=new, time=time, old_stamp=old)
        return LawMotion(segment, self.conditions)

    def under(self, stamp: int, conditions: Conditions, drive: Any) -> 'LawMotion':  # noqa: ARG002
        """Returns the motion under conditions; see `Motion.under`. A law has no live parameter."""
        if conditions == self.conditions:
            return self
        segment, gravity = self.segment, conditions.gravity
        if gravity != segment.gravity:
            time = self._time(stamp)
            segment = replace(segment, stamp=stamp, time=time, old_stamp=None, gravity=gravity)
        return LawMotion(segment, conditions)

    def join(
        self,
        stamp: int,
        stamps: Sequence[int],
        angles: Sequence[float],
        slopes: Sequence[Sequence[float]] | None = None,
    ) -> 'LawMotion':
        """Returns the motion that leaves this one at a stamp for a trajectory.

        Args:
            stamp: Stamp at which to leave, ns.
            stamps: Stamps of the points, ns, increasing, after `stamp`.
            angles: Crank angles at the points, with all turns, rad; positions of a slide, m.
            slopes: Rates, or rates and accelerations, at the points; see `joined`.

        Returns:
            The motion in the next segment.

        Raises:
            MotionError: This motion ends before the stamp.
        """
        moment, slides = self._moment(stamp), self.segment.law.slides
        # The law begins at an angle without whole turns; the segment adds these.
        turns_of_angle = 0 if slides else nearest_turns(moment.angle)
        turns = moment.turns + turns_of_angle
        start = moment._replace(turns=turns, angle=with_turns(moment.angle, -turns_of_angle / 2))
        angles_without_turns = [with_turns(angle, -turns / 2) for angle in angles]
        times = [time - stamp for time in stamps]
        law = joined(start, times, angles_without_turns, slopes)._replace(slides=slides)
        segment = LawSegment(stamp, law, 0, turns, gravity=self.segment.gravity)
        return LawMotion(segment, self.conditions)

    def time_to_turn(self, turns: int) -> None:
        """Checks that the crank turns by a number of turns; see `Motion`.

        Raises:
            ConfigurationError: The crank never turns so far.
        """
        law = self.segment.law
        if isinstance(law, Spline) and law.turns:
            return
        start = law.at(0).angle
        extremes = [law.at(time).angle for time in law.extremes(math.inf, -math.inf)]
        most = max(abs(angle - start) for angle in extremes) / math.tau
        if most < turns:
            raise ConfigurationError(
                f'the crank gets at most {most:.3g} revolutions from its start, not {turns}: give '
                'a --duration'
            )

    def next_segment(self, logged: LawSegment) -> LawSegment:
        """Recomputes the segment that follows this motion; see `SpeedMotion.next_segment`.

        Only the start of a logged law is recomputed, because the rest is a user's trajectory.

        Raises:
            MotionError: This motion ends before the logged segment.
        """
        if logged.old_stamp is not None:
            return self.restamp(logged.old_stamp, logged.stamp).segment
        if logged.gravity != self.segment.gravity and logged.law == self.segment.law:
            return self.under(logged.stamp, logged.conditions, None).segment
        # A trajectory through any point begins in the same way.
        joined_segment = self.join(logged.stamp, [logged.stamp + 1], [0.0]).segment
        law = logged.law
        if isinstance(law, Spline) and isinstance(joined_segment.law, Spline):
            first, *others = law.rows
            start = joined_segment.law.rows[0][:3]  # angle, rate and half the acceleration
            law = law._replace(rows=((*start, *first[3:]), *others))
            joined_segment = replace(joined_segment, law=law)
        return replace(joined_segment, gravity=logged.gravity)

    def _time(self, stamp: int) -> int:
        return stamp - self.segment.stamp + self.segment.time

    def _moment(self, stamp: int) -> Moment:
        """Returns the motion of the crank at a stamp; see `at`.

        Raises:
            MotionError: The motion ends before the stamp.
        """
        law, time = self.segment.law, self._time(stamp)
        if law.end is not None and time > law.end:
            last, units = law.at(law.end), SLIDING if law.slides else TURNING
            raise MotionError(
                f'the motion ends {law.end / NS_PER_S:g} s after the start of its law, where the '
                f'speed is still {last.rate:g} {units.velocity}: end the law at rest, or repeat '
                'it',
                time=law.end / NS_PER_S, coordinates=(last.angle,),
            )  # fmt: skip
        moment = law.at(time)
        return moment._replace(turns=moment.turns + self.segment.turns)


def require_possible(law: Law, solver: Solver) -> None:
    """Checks that a mechanism can follow a law.

    Args:
        law: The law.
        solver: Solver of the mechanism.

    Raises:
        ConfigurationError: The crank leaves its arc, a value is not finite or beyond 1e12, or the
            crank reverses inside the stroke of a gas with valves.
    """
    units = solver.structure.driven_link.units
    for name, unit, value in zip(_WORDS[law.slides], units, law.largest, strict=False):
        if not value <= _LARGEST:
            raise ConfigurationError(
                f'the {name} reaches up to {value:.3g} {unit}: must be at most {_LARGEST:g} '
                f'{unit}; check the times and angles'
            )
    Ranges(solver).require_valves(reversals(law))
    if not solver.reach.turns_fully:
        _require_within_arc(law, solver)


def _require_within_arc(law: Law, solver: Solver) -> None:
    """Checks that a limited crank stays on the arc on which a law begins.

    Raises:
        ConfigurationError: It leaves the arc.
    """
    reach, start = solver.reach, law.at(0).angle
    low, high = reach.arc_around(start)
    if low < start < high:
        reach = reach._replace(arcs=((low, high),), drawn=None)  # in the turn of the law
    for time in sorted(law.extremes(low, high)):
        turns, angle, rate, acceleration = law.at(time)
        angle += turns * math.tau
        try:
            if not low < angle < high:
                reach.refuse(angle)
            solver.state(angle, rate, acceleration)
        except UnreachableError as error:
            raise ConfigurationError(f'at t = {time / NS_PER_S:.9g} s, {error}') from error


def reversals(law: Law) -> Iterator[float]:
    """Yields the angles at which the crank reverses, rad, in the law and in its repetition."""
    times = sorted({0, law.duration, *law.extremes(math.inf, -math.inf)})
    rounds = 2 if law.repeats else 1
    last_rate = 0.0  # the last one that was not 0
    for start, end in rounds * list(pairwise(times)):
        rate = law.at((start + end) // 2).rate
        if rate * last_rate < 0:
            yield law.at(start).angle
        last_rate = rate or last_rate
