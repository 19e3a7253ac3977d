# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How well a run goes: diagnostic_msgs statuses of its motion, log and viewer, and their bytes."""

from __future__ import annotations

import struct
import time
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from linkage_ros.run.stepper import Timekeeping
from linkage_ros.wire.messages import ENCAPSULATION, align, header, string

OK, WARN, ERROR = 0, 1, 2


class Status(NamedTuple):
    """The health of one part, as diagnostics have it.

    Attributes:
        level: OK, WARN or ERROR.
        name: Of the part.
        message: In a few words.
        values: Figures, as text.
    """

    level: int
    name: str
    message: str
    values: dict[str, str]


def encode_diagnostics(stamp: int, statuses: Sequence[Status]) -> bytes:
    """A diagnostic_msgs/DiagnosticArray message as CDR bytes.

    Args:
        stamp: ns.
        statuses: One for each part.

    Returns:
        The bytes, filled up to a multiple of 4 as those of `encode_string`.
    """
    body = align(header('', stamp), 4) + struct.pack('<I', len(statuses))
    for level, name, message, values in statuses:
        body += struct.pack('<B', level)
        for text in (name, message, ''):
            body = string(align(body, 4), text)
        body = align(body, 4) + struct.pack('<I', len(values))
        for text in (text for pair in values.items() for text in pair):
            body = string(align(body, 4), text)
    return align(ENCAPSULATION + body, 4)


class Health(NamedTuple):
    """What is known of a log or a view.

    Attributes:
        target: Its path or URL; empty: there is none.
        dropped: Items lost so far.
        error: What it failed with; None: it works.
    """

    target: str
    dropped: int = 0
    error: Exception | None = None


class Watch:
    """Tells how a run goes, report by report."""

    def __init__(self, node: str) -> None:
        """Begins to watch.

        Args:
            node: Name of the node, for the names of the statuses.
        """
        self._node = node
        self._before, self._time = Timekeeping(), time.monotonic()
        self._lost: dict[str, int] = {}

    def report(
        self,
        counts: Timekeeping,
        figures: dict[str, str],
        parts: dict[str, Health],
        troubles: Sequence[str] = (),
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
            'latest tick, ms late': f'{counts.latest * 1e-6:.3f}',
            'clock steps': str(counts.clock_steps),
            **figures,
        }
        words = '; '.join(troubles) or f'{rate:.1f} Hz kept'
        return Status(WARN if troubles else OK, f'{self._node}: motion', words, values)

    def _part(self, part: str, health: Health) -> Status:
        values = {'target': health.target, 'lost': str(health.dropped)}
        name = f'{self._node}: {part}'
        lost = health.dropped - self._lost.get(part, 0)
        self._lost[part] = health.dropped
        if health.error is not None:
            return Status(ERROR, name, f'ended: {health.error}', values)
        if lost > 0:
            words = f'the {part} lags: {health.dropped} of its items are lost so far'
            return Status(WARN, name, words, values)
        return Status(OK, name, 'well' if health.target else 'off', values)
