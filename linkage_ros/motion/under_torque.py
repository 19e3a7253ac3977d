# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Motion of a mechanism under a motor and torque commands, integrated from stamp to stamp."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np

from linkage_ros.errors import ConfigurationError, LinkageError
from linkage_ros.mechanism.base import Description
from linkage_ros.mechanism.conditions import OWN_CONDITIONS, Conditions
from linkage_ros.mechanism.kinematics import State
from linkage_ros.mechanism.parts import CROSSED, OPEN
from linkage_ros.mechanism.solver import Solver
from linkage_ros.motion.driven_mechanism import DrivenMechanism
from linkage_ros.motion.segments import Coordinates, Motion, Segment, stacked
from linkage_ros.motion.steps import FixedSteps, Integrate, StiffSteps, Values, live_steps
from linkage_ros.numeric import Real, wrap
from linkage_ros.quantities import Checked, quantity
from linkage_ros.units import NS_PER_S, TURNING, JointUnits

# Longest delay, ns, that a late run catches up with. Catching up with more would take so long that
# the delay would grow.
CATCH_UP = NS_PER_S // 4
_MOST_STEPS, _TRIED = 20, 100  # limit of steps per ms, at 12 us each; ms of motion to check
_ROUNDINGS = 8  # largest number of conversions to joint angles and back; see `legible`


@dataclass(frozen=True)
class Motor(Checked):
    """A motor whose torque decreases linearly with the crank speed.

    On a driven slide, it is a force that decreases with its rate.
    """

    torque: float = quantity(
        'number', 'motor torque at rest, counter-clockwise positive; force on a driven '
        'slider, or force that lengthens a driven cylinder',
        'N m or N', span=(-1e12, 1e12), live=True, default=0.0,
    )  # fmt: skip
    damping: float = quantity(
        'number',
        'decrease of motor torque per crank speed, or of force per speed of a cylinder or slider',
        'N m s or N s/m',
        span=(0.0, 1e12),
        default=0.0,
    )

    def __str__(self) -> str:
        return self.words()

    def words(self, units: JointUnits = TURNING) -> str:
        """Describes the motor of a joint with these units."""
        lost = f' - {self.damping:g} {units.damping} x speed' if self.damping else ''
        return f'motor {self.torque:g} {units.effort}{lost}'

    def at(self, speed: Real) -> Real:
        """Returns the torque, N m, at a crank speed or an array of crank speeds, rad/s."""
        return self.torque - self.damping * speed


@dataclass(frozen=True)
class TorqueSegment(Segment):
    """A segment in which a motor torque drives the mechanism.

    Attributes:
        torque: Torque of the motor at rest, N m, or its force, N.
        description: Coordinates and assembly of the motion; None for the mechanism's own.
    """

    torque: float
    old_stamp: int | None = None
    description: Description | None = None

    def words(self, units: JointUnits) -> str:
        """Describes the motor's torque and, if they are not the usual ones, the coordinates."""
        words = f'motor torque {self.torque:g} {units.effort}'
        if self.description:
            coordinates, assembly = self.description
            words += f', described by {" and ".join(coordinates)}, {assembly}'
        return words


class TorqueMotion(Motion):
    """A motion under a torque; the stamps of successive calls must not decrease.

    Attributes:
        segment: The current segment, in the form stored in logs.
    """

    segment: TorqueSegment

    def __init__(
        self,
        solver: Solver,
        motor: Motor,
        start: Coordinates,
        stamp: int,
        period: int,
        integrate: Integrate = live_steps,
        conditions: Conditions = OWN_CONDITIONS,
    ) -> None:
        """Starts a motion from coordinates and rates at t = 0, of a given stamp, ns.

        The period between states is in ns. `under` may change the values of the conditions'
        forces.
        """
        self._solver, self._motor, self._command = solver, motor, 0.0
        self._period = period
        self._end: LinkageError | None = None
        y = start.unwrapped, *start.q[1:], *start.u
        self.conditions = conditions
        self._steps = integrate(DrivenMechanism(solver, self._torque, conditions=conditions), y)
        self._begin(TorqueSegment(stamp, motor.torque))

    def at(self, stamp: int) -> Coordinates:
        """Computes the coordinates at a stamp; see `Motion.at` and `published`."""
        self._advance(stamp)
        self._describe(stamp, self._steps.driven)
        return published(self._steps.driven, self._steps.phase, self._steps.pairs)

    def at_all(self, stamps: Sequence[int]) -> Coordinates:
        """Computes the coordinates at many stamps; see `Motion.at_all`.

        They are also shorter than `stamps` if the coordinates of the motion change, which starts a
        new segment.

        Raises:
            LinkageError: The motion ends before the first stamp.
        """
        if self._end:
            raise self._end
        driven, moments = self._steps.driven, list[tuple[Values, int]]()
        try:
            for moment in self._steps.phases([self._time(stamp) for stamp in stamps]):
                if moments and self._steps.driven is not driven:
                    break  # the next call starts in the other coordinates
                driven = self._steps.driven
                moments.append(moment)
        except LinkageError as error:
            if not moments:
                raise
            self._end = error  # raised by the next call
        self._describe(stamps[0], driven)
        self._last = stamps[len(moments) - 1]
        return all_published(driven, moments)

    def command(self, stamp: int, torque: float) -> None:
        """Sets the torque to add to the motor's torque from a stamp on.

        Args:
            stamp: Stamp, ns; must not be earlier than in the last call.
            torque: Torque to add, N m.

        Raises:
            MotionError: The motion ends before the stamp.
        """
        if torque != self._command:
            self._advance(stamp)
            self._command = torque
            self._steps.changed()

    def under(self, stamp: int, conditions: Conditions, drive: Any) -> 'TorqueMotion':
        """Continues this motion under conditions and a `TorqueDrive`; see `Motion.under`.

        A change of the motor starts a new segment. So does a delay of more than 0.25 s, during
        which the motion is paused. Only the forces of the conditions may change.
        """
        self._begin_if_due(stamp, drive)
        if conditions != self.conditions:
            self._advance(stamp)
            self.conditions = self._steps.driven.conditions = conditions
            self._steps.changed()
        return self

    def _begin_if_due(self, stamp: int, drive: Any) -> None:
        """Starts a new segment if the motor has changed, or after a long delay; see `under`."""
        is_late = stamp - self._last > self._period + CATCH_UP
        if drive.motor == self._motor and not is_late:
            return
        if not is_late:
            self._advance(stamp)
        self._begin(replace(self.segment, stamp=stamp, torque=drive.motor.torque, old_stamp=None))
        self._motor = drive.motor
        self._steps.changed()

    def restamp(self, old: int, new: int) -> 'TorqueMotion':
        """Continues this motion after a step of the clock; see `Motion.restamp`.

        Raises:
            MotionError: The motion ends before the step.
        """
        self._advance(old)
        self._begin(replace(self.segment, stamp=new, old_stamp=old))
        return self

    def require_live(self) -> None:
        """Simulates the first 0.1 s, and rejects a motion that takes too many steps.

        Raises:
            ConfigurationError: The motion takes too many steps for a live run, or it ends within
                the first ms.
        """
        steps, problem, steps_per_ms = cast('FixedSteps', self._steps), '', 0.0
        # An implicit step takes twice as long, and so does a step in two coordinates.
        cost = len(steps.driven.links) * (2 if isinstance(steps, StiffSteps) else 1)
        most = _MOST_STEPS // cost
        try:
            for ms in range(1, _TRIED + 1):
                steps.advance(1e-3 * ms)
                steps_per_ms = steps.tried / ms
        except LinkageError as error:
            if ms == 1:  # the run reports a later end
                problem = str(error)
        if steps_per_ms > most:
            problem = (
                f'it requires {steps_per_ms:.0f} steps per ms, but only {most} fit; '
                'lower a stiffness, the slope of a load or the speed, add mass, or use '
                'linkage_record'
            )
        if problem:
            _, frequency = steps.driven.rates
            fastest = max(frequency, abs(steps.driven.speed(steps.phase)))
            raise ConfigurationError(
                'a live run cannot follow this motion, in which a radian of the crank or of an '
                f'oscillation takes {1e3 / fastest:.3g} ms and a tick '
                f'{1e3 * self._period / NS_PER_S:.3g} ms: {problem}'
            )

    def rehearse(self) -> None:
        """Compiles the programs for all coordinates and assemblies, to avoid a delay later."""
        own, mechanism = self._steps.driven, self._solver.mechanism
        if not (own.is_limited and mechanism.other_coordinates):
            return
        for coordinates in (mechanism.other_coordinates, mechanism.coordinates):
            driven, y = own.redescribed(self._steps.phase, coordinates)
            for assembly in (OPEN, CROSSED):
                driven = driven.described(Description(coordinates, assembly))
                driven.ready(y)
                driven.slope(y)
                published(driven, y, 0)

    def _describe(self, stamp: int, driven: DrivenMechanism) -> None:
        """Starts a new segment at a stamp if the description of the motion has changed."""
        description = None if driven.is_usual else driven.solver.description
        if description != self.segment.description:
            self.segment = replace(
                self.segment, stamp=stamp, old_stamp=None, description=description
            )

    def _begin(self, segment: TorqueSegment) -> None:
        self.segment, self._last = segment, segment.stamp
        # A reference stamp, ns, and the integrator's time at this stamp, s.
        self._origin, self._begun = segment.stamp, self._steps.time

    def _advance(self, stamp: int) -> None:
        self._last = stamp
        self._steps.advance(self._time(stamp))

    def _time(self, stamp: int) -> float:
        """Returns the integrator's time at a stamp, s."""
        return self._begun + (stamp - self._origin) / NS_PER_S

    def _torque(self, speed: float) -> Real:
        return self._motor.at(speed) + self._command


def published(driven: DrivenMechanism, y: Values, pairs: int) -> Coordinates:
    """Returns the coordinates to publish.

    Args:
        driven: The driven mechanism in its current coordinates.
        y: Coordinates, then their rates.
        pairs: Pairs of whole turns removed from the crank angle in y.

    Returns:
        The coordinates. They can be recomputed from messages bit for bit, because they are
        computed from the rounded values in messages.

    Raises:
        LinkageError: As for `Solver.accelerations`.
    """
    y, unwrapped = _as_published(driven, y, pairs)
    solver, half, under = driven.solver, len(y) // 2, driven.conditions
    q, u = y[:half], y[half:]
    if not driven.is_own:
        torque = driven.torque(driven.speed(y))
        state = solver.driven_state(q, u, torque, under=under)
        return own_coordinates(solver, state, unwrapped)
    a = driven.accelerations(*y)
    own_state = None if driven.is_usual else solver.state(q, u, a, under=under)
    return Coordinates(q, u, a, unwrapped, own_state, under)


def _as_published(driven: DrivenMechanism, y: Values, pairs: int) -> tuple[Values, float]:
    """Rounds y as messages do; returns it with the position of the driven joint, all turns too."""
    if not driven.has_driven:
        y = legible(driven, y)
        return y, driven.position(y, pairs)
    unwrapped = driven.position(y, pairs)
    y, _ = driven.wound((unwrapped, *y[1:]))
    return (y if driven.is_own else legible(driven, y)), unwrapped


def all_published(driven: DrivenMechanism, moments: list[tuple[Values, int]]) -> Coordinates:
    """Returns the coordinates to publish at many times, as arrays; see `published`."""
    solver, under = driven.solver, driven.conditions
    if not driven.is_own:
        return stacked([published(driven, *moment) for moment in moments])
    unwrapped = [driven.position(y, pairs) for y, pairs in moments]
    first_coordinates = list[float]()
    for position in unwrapped:
        (first,), _ = driven.wound((position,))
        first_coordinates.append(first)
    rows = np.array([y for y, _ in moments]).T
    count = len(solver.coordinates)
    q, u = (np.array(first_coordinates), *rows[1:count]), tuple(rows[count:])
    a = solver.accelerations(q, u, driven.torque(u[0]), under=under)
    state = None if driven.is_usual else solver.state(q, u, a, under=under)
    return Coordinates(q, u, a, np.array(unwrapped), state, under)


def legible(driven: DrivenMechanism, y: Values) -> Values:
    """Rounds y so that converting it to the joint values of a message and back is exact."""
    driven_name, half = driven.solver.links[driven.driven], len(y) // 2
    values = list(y)
    for i, link in enumerate(driven.links):
        if link.slides or link.name == driven_name:
            continue
        # The angle of a joint on the crank is relative to the crank, which is the first.
        is_on_crank = link.parent is not None
        crank_angle, crank_rate = (y[0], y[half]) if is_on_crank else (0.0, 0.0)
        angle, rate = values[i], values[half + i]
        for _ in range(_ROUNDINGS):
            before = angle, rate
            joint = wrap(angle - crank_angle)
            angle = crank_angle + (joint if joint > -math.pi else math.pi)  # as in messages
            rate = crank_rate + (rate - crank_rate)
            if (angle, rate) == before:
                break
        values[i], values[half + i] = angle, rate
    return tuple(values)


def own_coordinates(solver: Solver, state: State, unwrapped: Real) -> Coordinates:
    """Returns the mechanism's own coordinates with a state, as they may not determine it.

    Args:
        solver: Solver of the mechanism.
        state: A state of floats or arrays.
        unwrapped: Crank angle including all turns, rad.
    """
    own = solver.structure.indices_of(solver.mechanism.coordinates)
    q, u, a = (tuple(row[i] for i in own) for row in state[:3])
    return Coordinates(q, u, a, unwrapped, state, state.conditions)
