# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Which part of a log is played, as times and topics."""

from __future__ import annotations

from typing import NamedTuple

from linkage_ros.log.reader import LogReader
from linkage_ros.units import NS_PER_S


class Excerpt(NamedTuple):
    """A part of a log.

    Attributes:
        start: First log time, ns.
        end: Log time before which it ends, ns; one message period after the log's last message
            where it is played to the end, so that rounds join.
        topics: Fully qualified names.
    """

    start: int
    end: int
    topics: list[str]


def excerpt_of(
    log: LogReader, offset: float, duration: float | None, topics: list[str] | None
) -> Excerpt:
    """The excerpt of a log that options describe.

    Args:
        log: The log.
        offset: s to leave out at the beginning.
        duration: s to play from there; None: to the end.
        topics: Fully qualified names; None: all.

    Returns:
        The excerpt.
    """
    start = log.start + round(offset * NS_PER_S)
    end = log.end + round(NS_PER_S / log.configuration.session.rate_hz)
    if duration is not None:
        end = min(end, start + max(1, round(duration * NS_PER_S)))
    return Excerpt(start, end, topics or [topic.name for topic in log.topics])
