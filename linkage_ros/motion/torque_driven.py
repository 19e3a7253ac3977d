# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The motion of a torque-driven mechanism: pieces that a log explains, and the plant they move."""

from __future__ import annotations

from typing import TypeAlias

from linkage_ros.motion.plant import Plant
from linkage_ros.motion.speed_driven import CrankMotion, CrankState
from linkage_ros.units import NS_PER_S

# What a late run makes up for beyond a tick, ns. More would only hold it up further.
CATCH_UP = NS_PER_S // 4


class TorqueMotion:
    """One piece of a torque-driven motion: from a stamp on, a motor torque.

    Attributes:
        stamp: Start, ns.
        torque: Of the motor at rest, N m.
        before: What the moment of the start was called until then, ns, where a step of the clock
            began the piece; None: the clock went on.
    """

    def __init__(
        self,
        stamp: int,
        torque: float,
        before: int | None = None,
        plant: Plant | None = None,
        period: int = 0,
    ) -> None:
        """Describes a piece of motion.

        Args:
            stamp: Start, ns.
            torque: Of the motor at rest, N m.
            before: The start on the clock as it stood before a step; None: there was none.
            plant: What moves, at the start; None: a piece read from a log, which only tells.
            period: Between states, ns.
        """
        self.stamp, self.torque, self.before = stamp, torque, before
        self._plant, self._period = plant, period
        self._time = plant.time if plant else 0.0
        self._last = stamp

    @property
    def target(self) -> float:
        """What may be set while it runs: the motor's torque, N m."""
        return self.torque

    def at(self, stamp: int) -> CrankState:
        """The coordinates at a stamp, not before the one before.

        Args:
            stamp: ns.

        Returns:
            Angle, speed and acceleration of the crank, and the slider's motion.

        Raises:
            MotionError: The motion cannot be followed that far.
        """
        return self._advanced(stamp).state()

    def command(self, stamp: int, torque: float) -> None:
        """Sets the torque that comes on top of the motor's from a stamp on.

        Args:
            stamp: Not before the one before, ns.
            torque: N m.

        Raises:
            MotionError: The motion cannot be followed that far.
        """
        self._advanced(stamp).drive(self.torque, torque)

    def _advanced(self, stamp: int) -> Plant:
        assert self._plant, 'a piece from a log moves nothing'  # noqa: S101
        self._last = stamp
        self._plant.advance(self._time + (stamp - self.stamp) / NS_PER_S)
        return self._plant

    def next(self, stamp: int, torque: float) -> TorqueMotion:
        """The piece that a stamp lies in.

        Args:
            stamp: ns.
            torque: What the motor's torque is to be, N m.

        Returns:
            This piece, or a new one: where the torque changes, and where the run is late by more
            than 0.25 s, for which the plant then stood still.
        """
        if stamp - self._last > self._period + CATCH_UP:
            return self._follow(stamp, torque, None)
        return self if torque == self.torque else self.change(stamp, torque)

    def change(self, stamp: int, torque: float, restamp: int | None = None) -> TorqueMotion:
        """The motion from a stamp on, with another torque.

        Args:
            stamp: Where the change happens, ns.
            torque: Of the motor at rest, N m.
            restamp: What this moment is called from now on, where the clock was stepped.

        Returns:
            The next piece of motion.
        """
        if self._plant:
            self._advanced(stamp)
        if restamp is None:
            return self._follow(stamp, torque, None)
        return self._follow(restamp, torque, stamp)

    def _follow(self, stamp: int, torque: float, before: int | None) -> TorqueMotion:
        if self._plant:
            self._plant.drive(torque, self._plant.command)
        return TorqueMotion(stamp, torque, before, self._plant, self._period)

    def words(self) -> str:
        """What moves it."""
        return f'motor torque {self.torque:g} N m'


# A piece of a run's motion, whatever drives it.
RunMotion: TypeAlias = CrankMotion | TorqueMotion
