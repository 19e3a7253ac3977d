# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Recomputes every state of a log from its configuration and its segments of motion.

To be equal means to have equal bytes. Topics are told apart by their types, because their names
may be remapped. What the log has beside them is named, not compared.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from typing import NamedTuple

from linkage_ros.errors import LogError
from linkage_ros.log.channels import Pairing, paired
from linkage_ros.log.reader import LoggedMessage, LogReader
from linkage_ros.run.simulator import Simulator
from linkage_ros.verification.message_difference import differing
from linkage_ros.verification.motion_check import check_motions
from linkage_ros.verification.state_comparison import StateComparison
from linkage_ros.verification.timeline import Timeline, seconds
from linkage_ros.verification.topic_check import check_topics, has_states
from linkage_ros.wire.topics import DIAGNOSTICS, ROBOT_DESCRIPTION


class Report(NamedTuple):
    """What came of a verification.

    Attributes:
        states: Found equal.
        compared: Names of the topics that were compared.
        others: Names of the topics that nothing can recompute.
        absent: Relative names of the mechanism's topics that the log does not have.
        missed: Ticks without a state.
        cut: Names of the topics that the very last state lacks: it was cut off while written.
        difference: The first one; empty if there is none.
    """

    states: int
    compared: tuple[str, ...]
    others: tuple[str, ...]
    absent: tuple[str, ...]
    missed: int
    cut: tuple[str, ...]
    difference: str


def verify(log: LogReader, progress: Callable[[int], object] = lambda _: None) -> Report:
    """Recomputes and compares the messages of a log, up to the first difference.

    Args:
        log: The log.
        progress: Called with the number of states that were compared since the last call.

    Returns:
        What came of it.

    Raises:
        LogError: The file is damaged, or has states but nothing that explains or dates them.
    """
    simulator = Simulator(log.configuration)
    pairings = paired(log, simulator.topics)
    descriptions = [t.name for t in log.topics if t.type == ROBOT_DESCRIPTION.interface.name]
    difference = check_topics(log, pairings, descriptions, simulator)
    difference = difference or check_motions(simulator, log.motions)
    wrong: list[str] = []
    comparable = descriptions if log.has_same_urdf else []
    messages = _described(log, comparable, simulator.description, wrong)
    states, missed = 0, 0
    cut: tuple[str, ...] = ()
    if not difference and has_states(log, pairings):
        timeline = _timeline(log, simulator, pairings)
        comparison = StateComparison(simulator, pairings, timeline, recorded=_is_record(log))
        difference = comparison.run(messages, progress)
        states, cut, missed = comparison.states, comparison.cut, timeline.missed
    elif not difference:
        deque(messages, maxlen=0)
    names = [topic.name for topic in log.topics]
    known = {*(name for name, _ in pairings), *comparable}
    carried = [*(topic for _, topic in pairings), *[ROBOT_DESCRIPTION][: len(descriptions)]]
    return Report(
        states=states,
        compared=tuple(name for name in names if name in known),
        others=tuple(name for name in names if name not in known),
        absent=tuple(t.name for t in (*simulator.topics, ROBOT_DESCRIPTION) if t not in carried),
        missed=missed,
        cut=cut,
        difference=wrong[0] if wrong else difference,
    )


def _is_record(log: LogReader) -> bool:
    """Whether every tick has to be there; a run on simulated time may begin at 0 as well."""
    live = any(topic.type == DIAGNOSTICS.interface.name for topic in log.topics)
    return not live and bool(log.motions) and log.motions[0].stamp == 0


def _timeline(log: LogReader, simulator: Simulator, pairings: list[Pairing]) -> Timeline:
    if not any(topic.interface.is_stamped for _, topic in pairings):
        raise LogError(f'{log.path} cannot be verified: none of its topics has stamps')
    if not log.motions:
        raise LogError(f'{log.path} cannot be verified: it has states but no motion record')
    return Timeline(simulator, log.motions)


def _described(
    log: LogReader, descriptions: list[str], description: bytes, wrong: list[str]
) -> Iterator[LoggedMessage]:
    """The messages of a log, to the first with a wrong publish time or description.

    What is wrong with it goes to `wrong`.
    """
    for message in log.written():
        if message.published != message.time:
            published, time = seconds(message.published), seconds(message.time)
            wrong.append(f'{message.topic}: publish time {published}, log time {time}')
            return
        if message.topic not in descriptions:
            yield message
        elif message.data != description:
            words = differing(ROBOT_DESCRIPTION.interface, message.data, description)
            wrong.append(f'{message.topic}: {words}')
            return
