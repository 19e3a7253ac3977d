# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What small changes of the motor's torque do to the stable states."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

from linkage_ros.lab.pump.branch import Branch, SettledState, find_states
from linkage_ros.lab.pump.periodic import PeriodicMotion
from linkage_ros.lab.pump.poincare import PoincareMap

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
    poincare: PoincareMap,
    branch: Branch,
    torque: float,
    found: Sequence[SettledState],
    progress: Callable[[Iterable[Any], str], Any],
) -> list[Sensitivity]:
    """Finds the stable states again at changed torques.

    Args:
        poincare: The Poincare map.
        branch: Where to look for them.
        torque: Of the motor at rest, N m, that is changed.
        found: All states at that torque.
        progress: Wraps what is gone through, with a word for it.

    Returns:
        For each change and stable state, what becomes of it.
    """
    changed = []
    for change in progress(CHANGES, 'other torques'):
        others = {one.piece: one.motion for one in find_states(poincare, branch, torque * change)}
        for number, (nominal, piece) in enumerate(found):
            if nominal.stable:
                motion = others.get(piece)
                changes = {
                    name: getattr(motion, name) / getattr(nominal, name) - 1
                    for name in ('speed', 'stroke', 'flow')
                    if motion
                }
                changed.append(Sensitivity(number, torque * change, motion, changes))
    return changed
