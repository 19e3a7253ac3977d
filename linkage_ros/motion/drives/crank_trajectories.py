# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Trajectories that replace the law of a crank while it runs."""

import itertools
import math
from bisect import bisect_right
from collections.abc import Iterable

from linkage_ros.messages.cdr import decode_trajectory
from linkage_ros.motion.along_law import LawMotion, require_possible
from linkage_ros.motion.drives.base import Machine
from linkage_ros.motion.inputs import Input
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
        """Reads a trajectory that leaves the motion at the stamp of the last `applied`.

        Args:
            data: CDR bytes of a JointTrajectory.

        Returns:
            The motion along the trajectory.

        Raises:
            ValueError: The message must be rejected; the error text is the cause.
        """
        try:
            motion = self._motion.join(self._stamp, *self._decode(data))
            require_possible(motion.segment.law, self._machine.solver)
        except ValueError:
            self.counts[TRAJECTORIES_REJECTED] += 1
            raise
        self.counts[TRAJECTORIES_TAKEN] += 1
        return motion

    def _decode(
        self, data: bytes
    ) -> tuple[list[int], list[float], list[tuple[float, ...]] | None]:
        """Returns the future points: stamps, ns, angles, and rates or rates and accelerations.

        Raises:
            ValueError: The message is not a trajectory for this crank.
        """
        stamp, names, points = decode_trajectory(data)
        crank, start = self._machine.crank, stamp or self._stamp
        if names != [crank]:
            words = ascii(', '.join(names))[1:-1] or 'nothing'
            raise ValueError(f'it names {words:.80}: must name {crank} alone')
        if not points:
            raise ValueError('it has no points')
        sizes = {(len(x.positions), len(x.velocities), len(x.accelerations)) for x in points}
        if sizes not in ({(1, 0, 0)}, {(1, 1, 0)}, {(1, 1, 1)}):
            raise ValueError(
                'its points do not match: each must have one position and, if every other point '
                'has them, one velocity, or one velocity and one acceleration'
            )
        joint = self._machine.joint
        rows = []
        for point in points:
            rates = *point.velocities, *point.accelerations
            rows.append((joint.own(point.positions[0]), *(rate / joint.ratio for rate in rates)))
        if not all(map(math.isfinite, itertools.chain(*rows))):
            raise ValueError('a number of it is not finite')
        times = [start + point.time for point in points]
        if any(before >= after for before, after in itertools.pairwise(times)):
            raise ValueError('its times do not increase')
        if len(rows[-1]) > 1 and rows[-1][1]:
            raise ValueError(f'its last velocity is {rows[-1][1]:g}: must be 0, where it ends')
        past = bisect_right(times, self._stamp)
        if past == len(times):
            late = (self._stamp - times[-1]) / NS_PER_S
            raise ValueError(f'all its points are in the past: the last one by {late:.3f} s')
        angles = [row[0] for row in rows[past:]]
        slopes = [row[1:] for row in rows[past:]]
        return times[past:], angles, slopes if slopes[0] else None

    def applied(
        self, motion: LawMotion, stamp: int, elapsed: int, received: Iterable[LawMotion]  # noqa: ARG002
    ) -> LawMotion:  # fmt: skip
        """Returns the motion along the last accepted trajectory, or the motion so far."""
        self._motion, self._stamp = motion, stamp
        for joined in received:  # each joins the motion along the one before
            self._motion = joined
        return self._motion

    def diagnostics(self) -> dict[str, str]:
        """Returns the counts of trajectories, for diagnostics."""
        return {name: str(count) for name, count in self.counts.items()}
