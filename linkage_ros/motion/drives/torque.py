# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A given torque on the crank, from a motor and from commands, which moves the mechanism.

The driving torque that a given motion needs is in `mechanism/equations.py`.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any, cast

from linkage_ros.errors import ConfigurationError, LinkageError, UnreachableError
from linkage_ros.mechanism.base import Description, Mechanism
from linkage_ros.mechanism.parts import CROSSED, OPEN
from linkage_ros.mechanism.solver import Solver
from linkage_ros.mechanism.structure import Link
from linkage_ros.messages.cdr import decode_joint_state
from linkage_ros.messages.topics import JOINT_COMMANDS, Topic
from linkage_ros.motion.drives.base import Drive, Machine
from linkage_ros.motion.inputs import Expiring, Input, UnnamedError
from linkage_ros.motion.segments import Coordinates
from linkage_ros.motion.under_torque import Motor, TorqueMotion, TorqueSegment
from linkage_ros.numeric import within_two_turns
from linkage_ros.quantities import quantity
from linkage_ros.units import NS_PER_S, rad_and_deg, radians_per_second

TAKEN, CUT, REJECTED, TIMEOUTS = (
    'commands taken', 'commands cut to torque_limit', 'commands rejected', 'command timeouts'
)  # fmt: skip
_NO_LIMIT = 1e12  # default of torque_limit, N m or N


@dataclass(frozen=True)
class TorqueDrive(Drive):
    """A drive that applies a torque to the crank, or a force to a cylinder or slider.

    Commanded torques are added to that of the motor.
    """

    segment, subject, is_integrated = TorqueSegment, 'torque-driven {}', True

    motor: Motor = field(default_factory=Motor)
    start_rpm: float = quantity(
        'number', 'crank speed at t = 0', 'rpm', span=(-1e6, 1e6), default=0.0
    )
    crank_angle: float = quantity(
        'number', 'crank angle at t = 0', 'rad', span=(-1e6, 1e6), default=0.0
    )
    torque_limit: float = quantity(
        'number', 'largest torque of a command; larger ones are limited to it',
        'N m or N', span=(0.0, 1e12), default=_NO_LIMIT,
    )  # fmt: skip
    command_timeout: float = quantity(
        'number', 'time for which a command acts; refused if shorter than a tick',
        's', span=(1e-3, 1e9), default=0.1,
    )  # fmt: skip

    def words(self, joint: Link) -> str:
        """Describes motor and initial speed."""
        return f'{self.motor.words(joint.units)}, from {self.start_rpm:g} rpm'

    def start(self, mechanism: Mechanism) -> Coordinates:
        """Returns the coordinates at t = 0, with accelerations of 0."""
        positions, rates = mechanism.start()
        angle, _ = within_two_turns(self.crank_angle)
        u = radians_per_second(self.start_rpm), *rates
        if mechanism.coordinates[0] != 'crank':
            return self._start_of_slide(mechanism, angle, u[0])
        return Coordinates((angle, *positions), u, (0.0,) * len(u), self.crank_angle)

    def drawn_angle(self, mechanism: Mechanism) -> float:
        """Returns the place at t = 0; see `Drive.drawn_angle`."""
        return float(self.start(mechanism).unwrapped)

    def _start_of_slide(
        self, mechanism: Mechanism, crank_angle: float, crank_rate: float
    ) -> Coordinates:
        """Converts the start from the crank, rad and rad/s, to the driven slide, m and m/s.

        The slide may have a position in each assembly of the same mechanism with a driven crank.
        The one of `open` is taken, unless only the other one is in the assembly of the mechanism.

        Raises:
            ConfigurationError: The crank is on the side of the other assembly.
            UnreachableError: The mechanism cannot be there.
        """
        start = _slide_of(mechanism, OPEN, crank_angle, crank_rate)
        crank_angles = _crank_angles(mechanism, start.unwrapped)
        if _nearest(crank_angles, crank_angle) == mechanism.assembly:
            return start
        other_start = _slide_of(mechanism, CROSSED, crank_angle, crank_rate)
        with suppress(UnreachableError):  # the rod of a cylinder has only the first position
            other_angles = _crank_angles(mechanism, other_start.unwrapped)
            if _nearest(other_angles, crank_angle) == mechanism.assembly:
                return other_start
        slide = mechanism.structure().driven_link.driven_word
        raise ConfigurationError(
            f'crank_angle = {self.crank_angle:g}: is in assembly '
            f'{_nearest(crank_angles, crank_angle)}; in '
            f'{mechanism.assembly}, the crank is at '
            f'{rad_and_deg(crank_angles[mechanism.assembly])} for this position of the '
            f'{slide}; change crank_angle or assembly'
        )

    def check(self, mechanism: Mechanism) -> None:
        """Checks that the motion can start.

        Raises:
            ConfigurationError: The check failed; the message states the reason.
        """
        try:
            q, u, *_ = self.start(mechanism)
            Solver(mechanism).accelerations(q, u, self.motor.at(u[0]))
        except UnreachableError as error:
            where = f'crank_angle = {self.crank_angle} rad: ' if error.arcs else ''
            raise ConfigurationError(f'{where}the motion cannot start: {error}') from error

    def begin(self, stamp: int, machine: Machine) -> TorqueMotion:
        """Starts the motion; see `Drive.begin`."""
        start = self.start(machine.solver.mechanism)
        return TorqueMotion(
            machine.solver, self.motor, start, stamp, machine.period, machine.integrate,
            machine.conditions,
        )  # fmt: skip

    def inputs(self, machine: Machine) -> dict[Topic, Input]:
        """Receives commanded torques; see `Drive.inputs`."""
        unit = machine.solver.structure.driven_link.units.effort
        commands = TorqueCommands(
            self.torque_limit, self.command_timeout, machine.crank, machine.joint.ratio, unit
        )
        return {JOINT_COMMANDS: commands}

    def rehearse(self, machine: Machine) -> Iterator[Coordinates]:
        """Rejects a motion too fast for a live run; see `Drive.rehearse`.

        Raises:
            ConfigurationError: It is too fast, or commands would expire within a tick.
        """
        tick = machine.period
        if round(self.command_timeout * NS_PER_S) < tick:
            raise ConfigurationError(
                f'command_timeout = {self.command_timeout} s: must be at least a tick, '
                f'{tick / NS_PER_S} s, because a command acts for whole ticks; raise '
                'command_timeout or rate_hz'
            )
        motion = self.begin(0, machine)
        motion.require_live()
        with suppress(LinkageError):  # the run will report this error
            yield motion.at(NS_PER_S)
            motion.rehearse()


def _slide_of(
    mechanism: Mechanism, assembly_by_crank: str, crank_angle: float, crank_rate: float
) -> Coordinates:
    """Returns position, m, and rate, m/s, of the driven slide, given those of the crank.

    `assembly_by_crank` is the assembly of the same mechanism with a driven crank.
    """
    by_crank = Description(mechanism.other_coordinates, assembly_by_crank)
    solver = Solver(mechanism, description=by_crank)
    state, slide = solver.state(crank_angle, crank_rate), solver.structure.driven
    position, rate = state.position[slide], state.velocity[slide]
    return Coordinates((position,), (rate,), (0.0,), position)


def _crank_angles(mechanism: Mechanism, slide_position: float) -> dict[str, float]:
    """Returns the crank angle in each assembly, rad, at a position of the driven slide, m.

    Raises:
        UnreachableError: The slide cannot be there.
    """
    angles = dict[str, float]()
    for assembly in (OPEN, CROSSED):
        solver = Solver(replace(cast('Any', mechanism), assembly=assembly))
        (crank,) = solver.structure.indices_of(['crank'])
        angles[assembly] = solver.state(slide_position).position[crank]
    return angles


def _nearest(crank_angles: dict[str, float], crank_angle: float) -> str:
    """Returns the assembly whose crank angle, rad, is nearest to a given one."""
    return min(
        crank_angles,
        key=lambda assembly: abs(math.remainder(crank_angles[assembly] - crank_angle, math.tau)),
    )


class TorqueCommands(Input):
    """Stores the last valid command until it expires, and counts commands.

    Attributes:
        counts: Numbers of commands, by their names in diagnostics.
        held: The torque, N m, which is 0 before the first command and after a timeout.
    """

    def __init__(
        self, limit: float, timeout: float, crank: str, ratio: float = 1.0, unit: str = 'N m'
    ) -> None:
        """Initializes without an active command.

        Args:
            limit: Magnitude to which torques are clipped.
            timeout: Time for which a command acts, s.
            crank: Name of the driven joint.
            ratio: Ratio of the joint; the driving torque is its effort times the ratio.
            unit: Unit of torques: N m for a crank, N for a slide.
        """
        self._unit = unit
        self.counts = dict.fromkeys((TAKEN, CUT, REJECTED), 0)
        self._limit, self._crank, self._ratio = limit, crank, ratio
        self.held = Expiring(0.0, timeout)

    def read(self, data: bytes, _: int) -> float:
        """Decodes the CDR bytes of a JointState; returns and raises what `commanded` does."""
        command = decode_joint_state(data)
        return self.commanded(command.names, command.efforts)

    def reject(self, _: ValueError) -> None:
        """Counts a rejected command; see `Input.reject`."""
        self.counts[REJECTED] += 1

    def commanded(self, names: Sequence[str], efforts: Sequence[float]) -> float:
        """Returns the commanded torque within `torque_limit`, N m, given the joints' efforts.

        Raises:
            UnnamedError: It does not name this crank.
            ValueError: The message is not a command for this crank.
        """
        shown = ascii(', '.join(names))[1:-1] or 'nothing'
        places = [i for i, name in enumerate(names) if name == self._crank]
        if not places:
            raise UnnamedError(f'it names {shown:.80}: must name {self._crank} once')
        self.require_motion()
        if len(efforts) != len(names):
            raise ValueError(
                f'{len(names)} names and {len(efforts)} efforts: must be one for each'
            )
        if len(places) > 1:
            raise ValueError(f'it names {shown:.80}: must name {self._crank} once')
        torque = float(efforts[places[0]]) * self._ratio
        if not math.isfinite(torque):
            raise ValueError(f'effort {torque}: must be a finite number, {self._unit}')
        self.counts[TAKEN] += 1
        self.counts[CUT] += abs(torque) > self._limit
        return min(max(torque, -self._limit), self._limit)

    def applied(
        self, motion: Any, stamp: int, elapsed: int, received: Iterable[float]
    ) -> TorqueMotion:
        """Adds the commanded torque to a motion; see `Input.applied`."""
        run: TorqueMotion = motion
        run.command(stamp, self.held.at(elapsed, received))
        return run

    def notes(self, topic: str) -> list[str]:
        """Returns a note if commands are not limited."""
        if self._limit < _NO_LIMIT:
            return []
        words = (
            f'torque_limit is not set, so any command on {topic} acts in full, and one that is '
            f'too large ends the node; set the largest effort of your machine, {self._unit}'
        )
        return [words]

    def troubles(self, topic: str) -> list[str]:
        """Returns a warning if commands stopped, or stop often."""
        if not self.held.is_lost:
            return []
        when = f'within command_timeout{self.held.losses.note}'
        return [f'no command on {topic} {when}: the motor alone drives the crank']

    def diagnostics(self) -> dict[str, str]:
        """Returns the active torque and the counts of commands, for diagnostics."""
        counts = {**self.counts, TIMEOUTS: self.held.timeouts}
        found = {name: str(count) for name, count in counts.items()}
        return {f'command, {self._unit}': f'{self.held.value:.6g}', **found}
