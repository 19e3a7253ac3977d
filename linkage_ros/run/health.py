# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Health of a run: diagnostic_msgs statuses of its motion, log and viewer."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from linkage_ros.run.ticker import TickCounts
from linkage_ros.units import NS_PER_MS
from linkage_ros.wire.diagnostics import ERROR, OK, WARN, Status

# s, and reports, over which a run is judged.
WINDOW = 10
# Shares of missed ticks above which the warning begins, and below which it ends. They differ, so
# that a share near one of them does not switch the warning on and off.
_OVERLOADED, _RECOVERED = 0.10, 0.05
_FAST_CRANK = (
    ', or the crank is too fast: a fast crank costs more per tick (add motor.damping or lower '
    'rate_hz)'
)


class Health(NamedTuple):
    """Health of a log or a view.

    Attributes:
        target: Its path or URL; empty: not in use.
        dropped: Items lost so far.
        error: The error that ended it; None: it works.
        trouble: Why it accepts nothing now; empty: it does.
    """

    target: str
    dropped: int = 0
    error: Exception | None = None
    trouble: str = ''


class _Observation(NamedTuple):
    """The inputs of one report; times in s."""

    time: float
    counts: TickCounts
    parts: dict[str, Health]


class HealthMonitor:
    """Judges a run by its last seconds, at each report."""

    def __init__(self, node: str, *, is_torque_driven: bool = False) -> None:
        """Begins with a new run.

        Args:
            node: Name of the node, for the names of the statuses.
            is_torque_driven: Whether the motion is integrated; its cost grows with the speed.
        """
        self._node = node
        self._is_torque_driven = is_torque_driven
        self._observations = deque(
            [_Observation(time.monotonic(), TickCounts(), {})], maxlen=WINDOW + 1
        )
        self._is_overloaded = False
        self._last: dict[str, Status] = {}

    def report(
        self,
        counts: TickCounts,
        figures: dict[str, str],
        parts: dict[str, Health],
        troubles: Sequence[str],
    ) -> list[Status]:
        """The statuses of the motion and of each part.

        Args:
            counts: Counts of ticks so far.
            figures: Further values of the motion.
            parts: Log and viewer.
            troubles: Other current warnings about the motion.

        Returns:
            The motion's status first.
        """
        self._observations.append(_Observation(time.monotonic(), replace(counts), parts))
        return [
            self._motion_status(figures, troubles),
            *(self._output_status(part) for part in parts),
        ]

    def changes(self, statuses: Sequence[Status]) -> list[Status]:
        """Selects the statuses to log: new warnings, and warnings that have ended.

        Args:
            statuses: Statuses of the report.

        Returns:
            The statuses; a part that fails logs that itself.
        """
        found, nothing = [], Status(OK, '', '', {})
        for status in statuses:
            before = self._last.get(status.name, nothing)
            is_other = status.level == WARN and status.message != before.message
            if is_other or status.level < before.level:
                found.append(status)
        self._last = {status.name: status for status in statuses}
        return found

    def _motion_status(self, figures: dict[str, str], troubles: Sequence[str]) -> Status:
        first, last = self._observations[0], self._observations[-1]
        counts, troubles = last.counts, list(troubles)
        kept, missed = counts.kept - first.counts.kept, counts.missed - first.counts.missed
        if counts.clock_steps > first.counts.clock_steps:
            troubles.append(f'the clock was stepped in the last {WINDOW} s')
            missed = 0  # simulated time that jumps skips ticks, however fast the machine is
        share = missed / max(1, kept + missed)
        is_full = len(self._observations) > WINDOW
        self._is_overloaded = is_full and share > (
            _RECOVERED if self._is_overloaded else _OVERLOADED
        )
        if self._is_overloaded:
            troubles.append(
                f'more than {100 * _OVERLOADED:g} % of the ticks of the last {WINDOW} s were '
                'missed: the machine is too busy for this rate_hz'
                + (_FAST_CRANK if self._is_torque_driven else '')
            )
        rate = kept / (last.time - first.time)
        median, p99 = np.quantile(list(counts.lateness) or [0], (0.5, 0.99))
        values = {
            'rate kept, Hz': f'{rate:.2f}',
            'states': str(counts.kept),
            'ticks missed': str(counts.missed),
            'lateness p50, ms': f'{median / NS_PER_MS:.3f}',
            'lateness p99, ms': f'{p99 / NS_PER_MS:.3f}',
            'lateness max, ms': f'{counts.max_lateness / NS_PER_MS:.3f}',
            'real-time priority': 'yes' if counts.real_time_priority else 'no',
            'clock steps': str(counts.clock_steps),
            **figures,
        }
        words = '; '.join(troubles) or f'{rate:.1f} Hz kept'
        return Status(WARN if troubles else OK, f'{self._node}: motion', words, values)

    def _output_status(self, part: str) -> Status:
        past = [seen.parts.get(part, Health('')) for seen in self._observations]
        health = past[-1]
        values = {'target': health.target, 'lost': str(health.dropped)}
        level, words = OK, 'well' if health.target else 'off'
        if health.error is not None:
            level, words = ERROR, f'failed: {health.error}'
        elif health.trouble:
            level, words = WARN, health.trouble
        # Losses during a trouble belong to it.
        elif health.dropped > past[0].dropped and not any(one.trouble for one in past):
            level, words = WARN, f'the {part} lags: items were left out in the last {WINDOW} s'
        elif health.dropped:
            words = f'well, but {health.dropped} items were left out'
        return Status(level, f'{self._node}: {part}', words, values)
