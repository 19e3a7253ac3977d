# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Trajectories that replace the law of a crank while it runs."""

import itertools
import math
from bisect import bisect_right
from collections.abc import Iterable, Sequence

from linkage_ros.errors import MotionError
from linkage_ros.messages.cdr import TrajectoryPoint, decode_trajectory
from linkage_ros.motion.along_law import LawMotion, require_possible
from linkage_ros.motion.drives.base import Machine
from linkage_ros.motion.inputs import Input, UnnamedError
from linkage_ros.units import NS_PER_S

TRAJECTORIES_TAKEN, TRAJECTORIES_REJECTED = 'trajectories taken', 'trajectories rejected'


class CrankTrajectories(Input):
    """Reads trajectories of the crank, and joins each of them to the motion.

    Attributes:
        counts: Numbers of trajectories, by their names in diagnostics.
    """

    def __init__(self, machine: Machine, motion: LawMotion) -> None:
        """Initializes without a trajectory.

        Args:
            machine: The mechanism.
            motion: The initial motion.
        """
        self.counts = dict.fromkeys((TRAJECTORIES_TAKEN, TRAJECTORIES_REJECTED), 0)
        self._machine, self._motion, self._stamp = machine, motion, 0

    def read(self, data: bytes, _: int) -> LawMotion:
        """Returns the motion along a trajectory, a JointTrajectory; see `Input.read`.

        It leaves the motion at the stamp of the last `prepare`.

        Raises:
            ValueError: The motion ends before that stamp, or the trajectory is impossible.
        """
        points = self._decode(data)
        try:
            motion = self._motion.join(self._stamp, *points)
        except MotionError as error:  # the tick that reads the message ends the motion
            raise ValueError(str(error)) from error
        require_possible(motion.segment.law, self._machine.solver)
        self.counts[TRAJECTORIES_TAKEN] += 1
        self._motion = motion  # a later message joins it
        return motion

    def reject(self, _: ValueError) -> None:
        """Counts a rejected trajectory; see `Input.reject`."""
        self.counts[TRAJECTORIES_REJECTED] += 1

    def prepare(self, motion: LawMotion, stamp: int) -> None:
        """Takes the motion that trajectories leave; see `Input.prepare`."""
        self._motion, self._stamp = motion, stamp

    def _decode(
        self, data: bytes
    ) -> tuple[list[int], list[float], list[tuple[float, ...]] | None]:
        """Returns the future points: stamps, ns, angles, and rates or rates and accelerations.

        Raises:
            UnnamedError: The message does not name this crank.
            ValueError: The message is not a trajectory for this crank.
        """
        stamp, names, points = decode_trajectory(data)
        self._require_names(names)
        _require_sizes(points, len(names))
        i, joint = names.index(self._machine.crank), self._machine.joint
        angles, slopes = list[float](), list[tuple[float, ...]]()
        for point in points:
            rates = *point.velocities[i : i + 1], *point.accelerations[i : i + 1]
            angles.append(joint.own(point.positions[i]))
            slopes.append(tuple(rate / joint.ratio for rate in rates))
        if not all(map(math.isfinite, itertools.chain(angles, *slopes))):
            raise ValueError('a number of it is not finite')
        start = stamp or self._stamp
        times = [start + point.time for point in points]
        if any(before >= after for before, after in itertools.pairwise(times)):
            raise ValueError('its times do not increase')
        last_slopes = slopes[-1]
        if last_slopes and last_slopes[0]:
            raise ValueError(f'its last velocity is {last_slopes[0]:g}: must be 0, where it ends')
        past = bisect_right(times, self._stamp)
        if past == len(times):
            late = (self._stamp - times[-1]) / NS_PER_S
            raise ValueError(f'all its points are in the past: the last one by {late:.3f} s')
        return times[past:], angles[past:], slopes[past:] if last_slopes else None

    def _require_names(self, names: Sequence[str]) -> None:
        """Checks the names of the joints.

        Raises:
            UnnamedError: The crank is not among them.
            ValueError: The crank is named twice, or others than cranks are named.
        """
        crank, other_cranks = self._machine.crank, self._machine.others
        words = ascii(', '.join(names))[1:-1] or 'nothing'
        if crank not in names:
            raise UnnamedError(f'it names {words:.80}: must name {crank}')
        self.require_motion()
        others = [name for name in names if name != crank]
        is_named_once = len(others) == len(names) - 1
        if not is_named_once or not {*others} <= other_cranks:
            alone = 'once, and only cranks' if other_cranks else 'alone'
            raise ValueError(f'it names {words:.80}: must name {crank} {alone}')

    def applied(
        self, motion: LawMotion, stamp: int, elapsed: int, received: Iterable[LawMotion]  # noqa: ARG002
    ) -> LawMotion:  # fmt: skip
        """Returns the motion along the last accepted trajectory, or the motion so far."""
        return [motion, *received][-1]

    def diagnostics(self) -> dict[str, str]:
        """Returns the counts of trajectories, for diagnostics."""
        return {name: str(count) for name, count in self.counts.items()}


def _require_sizes(points: Sequence[TrajectoryPoint], count: int) -> None:
    """Checks that the points have the same numbers for each of `count` joints.

    Raises:
        ValueError: They do not, or there are none.
    """
    if not points:
        raise ValueError('it has no points')
    sizes = {(len(x.positions), len(x.velocities), len(x.accelerations)) for x in points}
    if sizes not in ({(count, 0, 0)}, {(count, count, 0)}, {(count, count, count)}):
        each = ' for each joint' if count > 1 else ''
        raise ValueError(
            f'its points do not match: each must have one position{each} and, if every other '
            'point has them, one velocity, or one velocity and one acceleration'
        )
