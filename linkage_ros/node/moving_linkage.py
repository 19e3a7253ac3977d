# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One linkage of a live run: its motion, its last state, and values set while it runs."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any

from linkage_ros.errors import LinkageError
from linkage_ros.mechanism.conditions import OWN_CONDITIONS, Conditions
from linkage_ros.mechanism.kinematics import State
from linkage_ros.mechanism.ranges import Ranges
from linkage_ros.messages.topics import prefix_of
from linkage_ros.motion.live_force import LiveForce
from linkage_ros.motion.measured import FollowSegment
from linkage_ros.motion.segments import Coordinates, Motion, Segment
from linkage_ros.node.endpoints import PolledSubscription
from linkage_ros.quantities import build, flatten
from linkage_ros.run.states import RowPart, Simulator


class MovingLinkage:
    """A linkage of a live run.

    Attributes:
        name: Name of the linkage; empty for the only one.
        simulator: Simulator of the linkage.
        drive: The drive, which `set_live` replaces.
        motion: The motion; None before the first tick, and for a measured crank.
        state: The last state; None before the first one.
        coordinates: The coordinates of that state.
        first: Numbers of the first state, until they are reported.
        ranges: The ranges of its load curves that the motion has left.
        forces: Subscriptions of its live loads, with the readers of their messages.
    """

    def __init__(
        self,
        simulator: Simulator,
        forces: Sequence[tuple[PolledSubscription, LiveForce]],
        log_segment: Callable[[Segment, str], object],
    ) -> None:
        """Initializes before the first state; `log_segment` takes the name of the linkage, too."""
        self.name, self.simulator, self.drive = simulator.name, simulator, simulator.linkage.drive
        self.motion: Motion | None = None
        self.state: State | None = None
        self.coordinates: Coordinates | None = None
        self.first: Sequence[float] = ()
        self.ranges = Ranges(simulator.solver)
        self.forces, self._log = forces, log_segment
        self._own = OWN_CONDITIONS  # with the gravity that is set while running
        self._segment: Segment | None = None  # the last logged one

    def begin_tick(self, stamp: int, start: int) -> Motion:
        """Returns the motion under the conditions of a tick, before it receives messages.

        The stamps, ns, are those of the tick and of tick 0.
        """
        motion = self.motion or self._continue(self.simulator.begin(start))
        return motion.under(stamp, self.conditions(stamp - start), self.drive)

    def step(self, stamp: int, start: int, motion: Motion | None) -> RowPart:
        """Moves to a tick; returns the numbers in its messages.

        Args:
            stamp: Stamp of the tick, ns.
            start: Stamp of tick 0, ns.
            motion: The motion after the messages that it has received; None if there are none.
        """
        if motion is None:
            motion = self.begin_tick(stamp, start)
        ahead = self.simulator.ahead_of(motion, stamp)
        coordinates = motion.at(stamp)
        self._continue(motion)
        return self.part(coordinates, ahead)

    def measured(self, stamp: int, coordinates: Coordinates, under: Conditions) -> Coordinates:
        """Returns the coordinates of a measurement under the conditions of its stamp, ns."""
        gravity = self._own.gravity
        if under:
            under = replace(under, frame=coordinates.conditions.frame)
            coordinates = coordinates._replace(conditions=under)
        if gravity is not None and not (self._segment and self._segment.gravity == gravity):
            self._log_segment(FollowSegment(stamp, gravity))
        return coordinates

    def restamp(self, old: int, new: int) -> None:
        """Continues the motion after a step of the clock, given the stamps of a tick, ns."""
        if self.motion is not None:
            self._continue(self.motion.restamp(old, new))

    def part(self, coordinates: Coordinates, ahead: Coordinates | None) -> RowPart:
        """Computes the state at coordinates; returns the numbers in its messages."""
        simulator = self.simulator
        self.state = state = simulator.state(coordinates)
        self.ranges.see(state)
        effort = None if ahead is None else simulator.numbers.effort(simulator.state(ahead))
        numbers = simulator.numbers.of(state, coordinates.unwrapped)
        if not self.coordinates:
            self.first = numbers
        self.coordinates = coordinates
        return RowPart(numbers, effort)

    def conditions(self, now: int) -> Conditions:
        """Returns gravity and forces of loads that act from now, ns, on."""
        if not self.forces:
            return self._own
        forces = {
            source.name: source.held.at(now, subscription.take())
            for subscription, source in self.forces
        }
        return Conditions(gravity=self._own.gravity, forces=forces)

    def _continue(self, motion: Motion) -> Motion:
        """Sets the current motion, and logs its segment if it is new."""
        if motion.segment is not self._segment:
            self._log_segment(motion.segment)
        self.motion = motion
        return motion

    def _log_segment(self, segment: Segment) -> None:
        self._segment = segment
        self._log(segment, self.name)

    def set_live(self, name: str, value: Any) -> None:
        """Sets rpm, motor.torque or gravity, with effect from the next tick on."""
        if name == 'gravity':
            # Compile the program before the tick needs it.
            last, under = self.coordinates, self.simulator.conditions
            angle = last.q[0] if last else 0.0
            under = replace(last.conditions if last else under, gravity=value)
            with suppress(LinkageError):
                self.simulator.solver.state(angle, 1.0, 1.0, under=under)
            self._own = Conditions(gravity=value)
            return
        self.drive = build(type(self.drive), {**flatten(self.drive), name: value})

    def figures(self) -> dict[str, str]:
        """Returns speed, torque and loop residual of the last state, for diagnostics."""
        if self.state is None:
            return {}
        structure = self.simulator.solver.structure
        joint, residual = structure.driven_link, structure.loop_residual(self.state)
        force = 'driving force' if joint.slides else 'driving torque'
        figures = {
            f'{joint.name} speed, {joint.units.velocity}': (
                f'{self.state.velocity[structure.driven]:.6g}'
            ),
            f'{force}, {joint.units.effort}': f'{self.state.torque:.6g}',
            'loop residual, m': f'{residual:.3g}',
        }
        for _, source in self.forces:
            figures.update(source.diagnostics())
        return {f'{prefix_of(self.name, ": ")}{key}': value for key, value in figures.items()}
