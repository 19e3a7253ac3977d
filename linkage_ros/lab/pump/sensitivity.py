# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Effect of small changes of the motor's torque on the stable states."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from linkage_ros.lab.pump.branch import SettledState
from linkage_ros.lab.pump.periodic import PeriodicMotion

CHANGES = (0.95, 1.05)  # of the torque


class Sensitivity(NamedTuple):
    """A stable state under another torque.

    Attributes:
        state: Its number.
        torque: The other torque, N m.
        motion: The motion then; None: there is none.
        changes: Relative changes of speed, stroke and flow; empty: there is none.
    """

    state: int
    torque: float
    motion: PeriodicMotion | None
    changes: dict[str, float]

    def record(self) -> dict[str, Any]:
        """For JSON."""
        motion = self.motion.record() if self.motion else None
        return {**self._asdict(), 'motion': motion}


def sensitivities(
    torque: float, found: Sequence[SettledState], changed: Sequence[Sequence[SettledState]]
) -> list[Sensitivity]:
    """Compares the stable states with those at changed torques.

    Args:
        torque: Torque of the motor at rest, N m.
        found: All states at that torque.
        changed: All states at each of the changed torques.

    Returns:
        For each change and stable state, the state then.
    """
    rows = []
    for change, states in zip(CHANGES, changed, strict=True):
        others = {one.piece: one.motion for one in states}
        for number, (nominal, piece) in enumerate(found):
            if nominal.stable:
                motion = others.get(piece)
                changes = {
                    name: getattr(motion, name) / getattr(nominal, name) - 1
                    for name in ('speed', 'stroke', 'flow')
                    if motion
                }
                rows.append(Sensitivity(number, torque * change, motion, changes))
    return rows
