# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Makes a single state and its messages, as a tick of the node does."""

from typing import Any, NamedTuple

from one_linkage import templates_of


class StateMessages(NamedTuple):
    """A state, its stamp, ns, the numbers in its messages, and its messages, topic by topic."""

    stamp: int
    state: Any
    numbers: tuple[float, ...]
    messages: list[bytes]


def messages_of(simulator, stamp, coordinates, ahead=None):
    """Returns the state at given coordinates and its messages."""
    templates, state = templates_of(simulator), simulator.state(coordinates)
    numbers = simulator.numbers.of(state, coordinates.unwrapped)
    if ahead is not None:
        numbers = *numbers, simulator.numbers.effort(simulator.state(ahead))
    packed = templates.pack(stamp, numbers)
    messages = [packed[place] for place in templates.slices.values()]
    return StateMessages(stamp, state, numbers, messages)


def messages_at(simulator, motion, stamp):
    """Returns the state of a motion at a stamp, ns, and its messages."""
    lead = simulator.lead
    ahead = None if lead is None else motion.at(stamp + lead)
    return messages_of(simulator, stamp, motion.at(stamp), ahead)
