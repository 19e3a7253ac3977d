# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Recomputes every state of a log from its configuration and its segments of motion.

Messages are equal if their bytes are equal, or if their numbers are within 4 ulp of the largest
one, because sines differ between machines. Topics are identified by their types, because their
names may be remapped. Other topics of the log are named, not compared.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from linkage_ros.log.reader import LoggedMessage, LogReader, Pairing, measured_channel, paired
from linkage_ros.motion.drives import FollowDrive
from linkage_ros.run.simulator import Simulator
from linkage_ros.verification.follow_check import FollowCheck
from linkage_ros.verification.motion_check import check_motions
from linkage_ros.verification.row_comparison import RowComparison
from linkage_ros.verification.state_check import StateCheck
from linkage_ros.verification.timeline import seconds
from linkage_ros.verification.topic_check import check_topics
from linkage_ros.wire.topics import ROBOT_DESCRIPTION

_BATCH = 1024  # states that are compared at a time
_CONTEXT = 12  # bytes shown on either side of the first that differs


class Report(NamedTuple):
    """The outcome of a verification.

    Attributes:
        states: Number of equal states.
        compared: Names of the topics that were compared.
        others: Names of the topics that cannot be recomputed.
        absent: Relative names of the mechanism's topics that the log does not have.
        missed: Ticks without a state.
        cut: Names of the topics missing from the last state, which was cut off while written.
        ulp: Largest difference, in ulp of the largest value of its field; 0: all bits are equal.
        difference: The first difference; empty if there is none.
    """

    states: int = 0
    compared: tuple[str, ...] = ()
    others: tuple[str, ...] = ()
    absent: tuple[str, ...] = ()
    missed: int = 0
    cut: tuple[str, ...] = ()
    ulp: float = 0.0
    difference: str = ''


def verify(log: LogReader, progress: Callable[[int], object] = lambda _: None) -> Report:
    """Recomputes and compares the messages of a log, up to the first difference.

    Args:
        log: The log.
        progress: Called with the number of states that were compared since the last call.

    Returns:
        The outcome.

    Raises:
        LogError: The file is damaged, or lacks the configuration or segments of its states.
    """
    simulator = Simulator(log.configuration)
    pairings = paired(log, simulator.topics)
    descriptions = [t.name for t in log.topics if t.type == ROBOT_DESCRIPTION.interface.name]
    difference = check_topics(log, pairings, simulator) or check_motions(simulator, log.motions)
    comparable = descriptions if log.has_same_urdf else []
    found = Report(difference=difference)
    if not difference and any(channel.messages for channel, _ in pairings):
        others = _Others(comparable, simulator.description)
        found = _compare(log, simulator, pairings, others, progress)
    if log.lost > 0 and not found.difference:
        lost = f'{log.lost} messages that were logged are not there: the end is cut off'
        found = found._replace(difference=lost)
    names = [topic.name for topic in log.topics]
    known = {*(channel.name for channel, _ in pairings), *comparable}
    carried = [*(topic for _, topic in pairings), *[ROBOT_DESCRIPTION][: len(descriptions)]]
    return found._replace(
        compared=tuple(name for name in names if name in known),
        others=tuple(name for name in names if name not in known),
        absent=tuple(t.name for t in (*simulator.topics, ROBOT_DESCRIPTION) if t not in carried),
    )


def _compare(
    log: LogReader,
    simulator: Simulator,
    pairings: list[Pairing],
    others: _Others,
    progress: Callable[[int], object],
) -> Report:
    """Compares the messages of a log.

    Raises:
        LogError: The file is damaged, or lacks the configuration or segments of its states.
    """
    layout = simulator.layout_of((channel.number, topic) for channel, topic in pairings)
    names = [channel.name for channel, _ in pairings]
    comparison, measured = RowComparison(layout, names), measured_channel(log)
    check: StateCheck | FollowCheck
    if measured is not None and isinstance(simulator.configuration.drive, FollowDrive):
        check = FollowCheck(simulator, layout, comparison, measured.name)
    else:
        check = StateCheck(log, simulator, layout, comparison)
    waiting, tail, stray, difference = bytearray(), b'', None, ''

    def hear(message: LoggedMessage) -> None:
        others.check(message)
        check.hear(message)

    def compare() -> str:
        before, wrong = check.states, check.add(bytes(waiting))
        progress(check.states - before)
        waiting.clear()
        return wrong

    for rows, stray in log.rows(layout, hear):
        if stray or len(rows) % layout.size:
            tail = rows
            break
        waiting += rows
        if len(waiting) >= _BATCH * layout.size:
            difference = compare()
        if difference or others.wrong:
            break
    difference = others.wrong or difference or compare() or check.end()
    if stray and not difference:
        difference = (
            f'{stray.topic}: the message logged at {seconds(stray.time)} is not the next one of '
            f'state {check.states + 1}: one is lost, altered, there twice or out of order'
        )
    there = len([start for start in layout.starts if start < len(tail)])
    return Report(
        states=check.states,
        missed=check.missed,
        cut=tuple(names[there:]) if tail and not stray else (),
        ulp=comparison.ulp,
        difference=difference,
    )


class _Others:
    """Checks the messages that are not part of a state.

    Attributes:
        wrong: The first error found; empty: none so far.
    """

    def __init__(self, descriptions: list[str], description: bytes) -> None:
        self.wrong = ''
        self._descriptions, self._description = descriptions, description

    def check(self, message: LoggedMessage) -> None:
        """Checks the publish time of a message, and the robot description."""
        wrong = ''
        if message.published != message.time:
            published, time = seconds(message.published), seconds(message.time)
            wrong = f'{message.topic}: publish time {published}, log time {time}'
        elif message.topic in self._descriptions and message.data != self._description:
            wrong = f'{message.topic}: data = {_texts(message.data, self._description)}'
        self.wrong = self.wrong or wrong


def _texts(logged: bytes, recomputed: bytes) -> str:
    """Describes where two texts differ."""
    pairs = enumerate(zip(logged, recomputed, strict=False))
    at = next((i for i, (a, b) in pairs if a != b), min(len(logged), len(recomputed)))
    a, b = (
        text[max(8, at - _CONTEXT) : at + _CONTEXT].decode(errors='backslashreplace')
        for text in (logged, recomputed)
    )
    return f'{a!r} logged, {b!r} recomputed, at byte {at}'
