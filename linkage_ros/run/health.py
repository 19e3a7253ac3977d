# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How well a run goes: diagnostic_msgs statuses of its motion, log and viewer."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from linkage_ros.run.ticker import Timekeeping
from linkage_ros.units import NS_PER_MS
from linkage_ros.wire.diagnostics import ERROR, OK, WARN, Status


class Health(NamedTuple):
    """What is known of a log or a view.

    Attributes:
        target: Its path or URL; empty: there is none.
        dropped: Items lost so far.
        error: What it failed with; None: it works.
        trouble: Why it takes nothing now, in words; empty: it does.
    """

    target: str
    dropped: int = 0
    error: Exception | None = None
    trouble: str = ''


class Watch:
    """Tells how a run goes, report by report."""

    def __init__(self, node: str) -> None:
        """Begins to watch.

        Args:
            node: Name of the node, for the names of the statuses.
        """
        self._node = node
        self._before, self._time = Timekeeping(), time.monotonic()
        self._health: dict[str, Health] = {}
        self._told: dict[str, Status] = {}

    def report(
        self,
        counts: Timekeeping,
        figures: dict[str, str],
        parts: dict[str, Health],
        troubles: Sequence[str],
    ) -> list[Status]:
        """How it went since the last report.

        Args:
            counts: What became of the ticks so far.
            figures: Further values of the motion.
            parts: Log and viewer.
            troubles: What else is not well with the motion.

        Returns:
            A status of the motion and one of each part.
        """
        counts, now = replace(counts), time.monotonic()
        statuses = [self._motion(counts, now - self._time, figures, list(troubles))]
        statuses += [self._part(part, health) for part, health in parts.items()]
        self._before, self._time = counts, now
        return statuses

    def news(self, statuses: Sequence[Status]) -> list[Status]:
        """What of a report is worth a line: other warnings than last time, and their end.

        Args:
            statuses: Of the report.

        Returns:
            Those; what has failed was said when it did.
        """
        told, nothing = [], Status(OK, '', '', {})
        for status in statuses:
            before = self._told.get(status.name, nothing)
            is_other = status.level == WARN and status.message != before.message
            if is_other or status.level < before.level:
                told.append(status)
        self._told = {status.name: status for status in statuses}
        return told

    def _motion(
        self, counts: Timekeeping, seconds: float, figures: dict[str, str], troubles: list[str]
    ) -> Status:
        missed = counts.missed - self._before.missed
        stepped = counts.clock_steps - self._before.clock_steps
        rate = (counts.kept - self._before.kept) / seconds
        if missed and stepped:
            troubles.append(f'{missed} ticks skipped where the clock jumped')
        elif missed:
            troubles.append(
                f'{missed} ticks missed in the last second, {counts.missed} so far: the machine '
                'is too busy for this rate_hz'
            )
        if stepped:
            troubles.append(f'the clock was stepped {stepped} times')
        values = {
            'rate kept, Hz': f'{rate:.2f}',
            'states': str(counts.kept),
            'ticks missed': str(counts.missed),
            'lateness p50, ms': f'{counts.late.quantile(0.5) / NS_PER_MS:.3f}',
            'lateness p99, ms': f'{counts.late.quantile(0.99) / NS_PER_MS:.3f}',
            'lateness max, ms': f'{counts.late.greatest / NS_PER_MS:.3f}',
            'real-time priority': 'yes' if counts.real_time_priority else 'no',
            'clock steps': str(counts.clock_steps),
            **figures,
        }
        words = '; '.join(troubles) or f'{rate:.1f} Hz kept'
        return Status(WARN if troubles else OK, f'{self._node}: motion', words, values)

    def _part(self, part: str, health: Health) -> Status:
        values = {'target': health.target, 'lost': str(health.dropped)}
        name = f'{self._node}: {part}'
        before = self._health.get(part, Health(''))
        self._health[part] = health
        if health.error is not None:
            return Status(ERROR, name, f'failed: {health.error}', values)
        if health.trouble:
            return Status(WARN, name, health.trouble, values)
        # What was lost up to the end of a trouble was said when that began.
        if health.dropped > before.dropped and not before.trouble:
            words = f'the {part} lags: what comes is left out'
            return Status(WARN, name, words, values)
        well = f'well, but {health.dropped} items were left out' if health.dropped else 'well'
        return Status(OK, name, well if health.target else 'off', values)
