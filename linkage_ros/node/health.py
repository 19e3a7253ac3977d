# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Health of a run: diagnostic statuses of motion, log and viewer."""

import time
from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from linkage_ros.messages.cdr import ERROR, OK, WARN, Status
from linkage_ros.motion.inputs import WINDOW
from linkage_ros.node.ticker import TickCounts
from linkage_ros.units import NS_PER_MS, NS_PER_S

# Fractions of missed ticks above which the warning starts and below which it ends. They differ, so
# that the warning does not flicker if the fraction fluctuates around one of them.
_OVERLOADED, _RECOVERED = 0.10, 0.05
ACTIVE = 'active'  # the state of a managed node whose motion runs
_JITTER = 0.5  # s by which the window may be shorter or longer than 10 s
_BUSY = (
    f'more than {100 * _OVERLOADED:g} % of the ticks of the last {WINDOW} s were missed: '
    'the machine is too busy for this rate_hz, or a torque-driven crank is too fast (add '
    'motor.damping or lower rate_hz)'
)


class Health(NamedTuple):
    """Health of a log or viewer.

    Attributes:
        target: Path or URL of the log or viewer; empty if it is not used.
        dropped: Number of items lost so far.
        error: The error that ended the log or viewer, or None.
        trouble: Reason why it currently accepts no items; empty if it accepts items.
    """

    target: str
    dropped: int = 0
    error: Exception | None = None
    trouble: str = ''


class _Sample(NamedTuple):
    """Counts and health at the time of a report.

    Attributes:
        time: Time of the report, s.
        counts: Counts of ticks so far.
        parts: Health of log and viewer, by name.
    """

    time: float
    counts: TickCounts
    parts: dict[str, Health]


class HealthMonitor:
    """Evaluates the health of a run over the last 10 s."""

    def __init__(self, node: str) -> None:
        """Starts monitoring a new run of a node, whose name the statuses have."""
        self._node = node
        self._is_overloaded = False
        # At the start of the window and at each report since.
        self._samples = deque([_Sample(time.monotonic(), TickCounts(), {})])
        self._last: dict[str, Status] = {}

    def report(
        self,
        counts: TickCounts,
        figures: dict[str, str],
        parts: dict[str, Health],
        troubles: Sequence[str],
        state: str = '',
    ) -> list[Status]:
        """Returns the statuses of the motion and of each part; call it at least once a second.

        Args:
            counts: Counts of ticks so far.
            figures: Further values for the status of the motion.
            parts: Health of log and viewer, by name.
            troubles: Other current warnings about the motion.
            state: State of a managed node; empty for others.
        """
        now = time.monotonic()
        self._samples.append(_Sample(now, replace(counts), parts))
        while len(self._samples) > 2 and now - self._samples[1].time > WINDOW - _JITTER:
            self._samples.popleft()
        return [self._motion(figures, list(troubles), state), *map(self._output, parts)]

    def changes(self, statuses: Sequence[Status]) -> list[Status]:
        """Selects the statuses of a report to log: new warnings, and the ends of warnings.

        Ends repeat the warning. Errors of parts are omitted, because the parts log them.
        """
        changed = list[Status]()
        for status in statuses:
            before = self._last.get(status.name, Status(OK, '', '', {}))
            is_better = status.level < before.level
            is_new_warning = status.level == WARN and status.message != before.message
            if is_new_warning:
                changed.append(status)
            elif is_better:
                words = f'{status.message}; before: {before.message}'
                changed.append(status._replace(message=words))
        self._last = {status.name: status for status in statuses}
        return changed

    def _motion(self, figures: dict[str, str], troubles: list[str], state: str) -> Status:
        """Returns the status of the motion, given further values and warnings."""
        first, last = self._samples[0], self._samples[-1]
        counts = last.counts
        kept, missed = counts.kept - first.counts.kept, counts.missed - first.counts.missed
        if counts.clock_steps > first.counts.clock_steps:
            step = counts.last_step / NS_PER_S
            troubles.append(f'the clock was stepped by {step:+.3f} s in the last {WINDOW} s')
        limit = _RECOVERED if self._is_overloaded else _OVERLOADED
        is_full_window = last.time - first.time > WINDOW - _JITTER
        self._is_overloaded = is_full_window and missed > limit * max(1, kept + missed)
        if self._is_overloaded:
            troubles.append(_BUSY)
        rate = kept / (last.time - first.time)
        if counts.start > first.time:  # the first tick was in this window
            rate = (counts.kept - 1) / (last.time - counts.start)
        # Not by np.quantile, whose first call imports a module and delays the ticks by 16 ms.
        lateness = sorted(counts.lateness) or [0]
        median, p99 = (lateness[int(share * len(lateness))] for share in (0.5, 0.99))
        values = {
            'rate kept, Hz': f'{rate:.2f}',
            'states': str(counts.kept),
            'ticks missed': str(counts.missed),
            'lateness p50, ms': f'{median / NS_PER_MS:.3f}',
            'lateness p99, ms': f'{p99 / NS_PER_MS:.3f}',
            'lateness max, ms': f'{counts.max_lateness / NS_PER_MS:.3f}',
            'real-time priority': 'yes' if counts.real_time_priority else 'no',
            'clock steps': str(counts.clock_steps),
            **({'state': state} if state else {}),
            **figures,
        }
        usual = f'{rate:.1f} Hz kept' if state in {'', ACTIVE} else state
        words = '; '.join(troubles) or usual
        return Status(WARN if troubles else OK, f'{self._node}: motion', words, values)

    def _output(self, part: str) -> Status:
        """Returns the status of a part, 'log' or 'viewer'."""
        window = [sample.parts.get(part, Health('')) for sample in self._samples]
        health = window[-1]
        has_lost_items = health.dropped > window[0].dropped
        level, words = OK, 'ok' if health.target else 'off'
        if health.error is not None:
            level, words = ERROR, f'failed: {health.error}'
        elif health.trouble:
            level, words = WARN, health.trouble
        # Losses during a problem that is reported anyway need no separate warning.
        elif has_lost_items and not any(one.trouble for one in window):
            level, words = WARN, f'the {part} is too slow: items were lost in the last {WINDOW} s'
        elif health.dropped:
            words = f'ok, but items were lost: {health.dropped}'
        values = {'target': health.target, 'lost': str(health.dropped)}
        return Status(level, f'{self._node}: {part}', words, values)
