# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A simulator's messages beside those of a log, state by state, up to the first difference.

A state is one message of each topic. They were logged at one time, in the order of the topics;
those with a header bear the state's stamp. So a message that is lost, doubled or in another's
place shows even where its value would do.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from contextlib import suppress

from linkage_ros.errors import LinkageError
from linkage_ros.log.channels import Pairing
from linkage_ros.log.reader import LoggedMessage
from linkage_ros.run.simulator import Simulator
from linkage_ros.run.ticker import CLOCK_STEP
from linkage_ros.verification.message_difference import differing, unsigned_zeros
from linkage_ros.verification.recomputation import Recomputation
from linkage_ros.verification.timeline import Timeline, seconds
from linkage_ros.wire.cdr import stamp_of

# Messages that one topic may be behind the others before it counts as broken off.
_BEHIND = 10_000


class StateComparison:
    """Compares the states of one log.

    Attributes:
        states: Found equal so far.
        cut: Names of the topics that the very last state lacks: it was cut off while written.
    """

    def __init__(
        self, simulator: Simulator, pairings: list[Pairing], timeline: Timeline, *, recorded: bool
    ) -> None:
        """Prepares a comparison.

        Args:
            simulator: Recomputes the states.
            pairings: Channels, with the topics of the simulator that they carry, in its order; at
                least one has stamps.
            timeline: Timeline of the log.
            recorded: Whether every tick has a state, logged at its stamp.
        """
        self.states = 0
        self.cut: tuple[str, ...] = ()
        self._pairings, self._timeline = pairings, timeline
        self._recorded = recorded
        topics = [topic for _, topic in pairings]
        self._recomputation = Recomputation(simulator, topics, recorded=recorded)
        self._stamped = [i for i, (_, topic) in enumerate(pairings) if topic.interface.is_stamped]
        self._queues = [deque[LoggedMessage]() for _ in pairings]
        self._by_name = {
            name: queue for (name, _), queue in zip(pairings, self._queues, strict=True)
        }
        self._before: list[bytes] = []
        self._piece = 1
        self._piece_before = timeline.piece
        # What is wrong with the log time of the state before, unless the clock was set back.
        self._fell, self._latest = '', 0
        self._time_before: int | None = None

    def run(self, messages: Iterator[LoggedMessage], progress: Callable[[int], object]) -> str:
        """Compares all messages.

        Args:
            messages: In the order of writing; those of other topics are passed over.
            progress: Called with the number of states that were compared since the last call.

        Returns:
            The first difference; empty if there is none.
        """
        ready, shown, queues = 0, 0, self._queues
        for message in messages:
            queue = self._by_name.get(message.topic)
            if queue is None:
                continue
            queue.append(message)
            ready += len(queue) == 1
            if len(queue) > _BEHIND:
                return self._broken_off()
            if ready == len(queues):
                if difference := self._compare(messages):
                    return difference
                ready = sum(len(queue) > 0 for queue in queues)
                if self.states >= shown + 1000:
                    progress(self.states - shown)
                    shown = self.states
        progress(self.states - shown)
        return self._end()

    def _end(self) -> str:
        """Looks at what is left when all messages were read: nothing, or the start of a state."""
        left = [len(queue) for queue in self._queues]
        begun = left.count(1)
        if left != [1] * begun + [0] * (len(left) - begun):
            return self._broken_off()
        if begun:
            self.cut = tuple(name for name, _ in self._pairings[begun:])
            if self._stamped[0] < begun:
                return self._compare(iter(()))
        return ''

    def _compare(self, messages: Iterator[LoggedMessage]) -> str:
        """Compares the first message of each queue and takes it, or tells the difference."""
        heads = [queue[0] for queue in self._queues if queue]
        times = [head.time for head in heads]
        if times.count(times[0]) < len(times):
            self._read_on(messages)
            return self._out_of_line(times)
        logged = [head.data for head in heads]
        stamps = [stamp_of(logged[i]) for i in self._stamped if i < len(logged)]
        stamp = stamps[0] if stamps.count(stamps[0]) == len(stamps) else self._likeliest(stamps)
        expected, wrong = self._explain(logged, stamp)
        if wrong := wrong or self._mistimed(stamp, times[0]):
            return f'the stamp {seconds(stamp)} of state {self.states + 1} {wrong}'
        if logged != expected:
            self._read_on(messages)
            return self._unequal(stamp, expected)
        for queue in self._queues:
            if queue:
                queue.popleft()
        self.states += len(logged) == len(self._queues)
        self._before, self._time_before = expected, times[0]
        return ''

    def _explain(self, logged: list[bytes], stamp: int) -> tuple[list[bytes], str]:
        """The messages that belong to a stamp, or what is wrong with the stamp."""
        timeline = self._timeline
        likeliest: tuple[int, list[bytes]] | None = None
        for piece in timeline.pieces_at(stamp):
            try:
                expected = self._recomputation.messages_at(piece.segment, stamp, logged)
            except LinkageError as error:
                return [], str(error)
            if expected == logged or expected == list(map(unsigned_zeros, logged)):
                tick = timeline.take(piece, stamp)
                self._piece = piece.number
                return logged, self._recomputation.follow(tick, logged)
            likeliest = likeliest or (piece.number, expected)
        if likeliest is None:
            return [], timeline.why_none(stamp)
        self._piece, expected = likeliest
        return expected, ''

    def _mistimed(self, stamp: int, time: int) -> str:
        """What is wrong with the log time of a state that is right, or with those before it."""
        when = f'was logged at {seconds(time)}'
        if self._recorded:
            if self._timeline.missed:
                return f'comes after {self._timeline.missed} lost states: a record has every tick'
            return '' if time == stamp else f'{when}: a record has its stamp'
        piece, self._piece_before = self._piece_before, self._timeline.piece
        fell, self._fell = self._fell, ''
        if piece != self._piece_before and self._piece_before.segment.old_stamp is not None:
            # The clock may have been set back between the stamp of a state and its log time.
            self._latest, fell = time, ''
        elif time < self._latest - 2 * CLOCK_STEP:
            self._fell = f'{when}, before states that it follows'
        self._latest = max(self._latest, time)
        return fell

    def _likeliest(self, stamps: list[int]) -> int:
        """The stamp of a state whose messages do not agree on it."""
        timeline, last = self._timeline, self._timeline.last

        def doubt(stamp: int) -> tuple[int, bool, bool, int]:
            past = last is not None and stamp <= last
            return -stamps.count(stamp), timeline.late(stamp) > 0, past, stamp

        return min(stamps, key=doubt)

    def _read_on(self, messages: Iterator[LoggedMessage]) -> None:
        """Reads until there are two messages of each topic, which tells lost from swapped."""
        for message in messages:
            queue = self._by_name.get(message.topic)
            if queue is not None:
                queue.append(message)
            if all(len(queue) > 1 for queue in self._queues) or (queue and len(queue) > _BEHIND):
                return

    def _out_of_line(self, times: list[int]) -> str:
        """Tells which message does not belong to the state of the others: log times differ."""
        time = min(times, key=lambda t: (-times.count(t), t == self._time_before, t))
        channel = next(i for i, other in enumerate(times) if other != time)
        nexts = [queue[1].time if len(queue) > 1 else None for queue in self._queues]
        follows = next((nexts[i] for i, other in enumerate(times) if other == time), None)
        name, wrong = self._pairings[channel][0], times[channel]
        where = f'state {self.states + 1}, logged at {seconds(time)}'
        if wrong == self._time_before:
            return f'{name} has the message logged at {seconds(wrong)} twice'
        if wrong != follows:
            return f'{name} has the log time {seconds(wrong)} in {where}'
        if nexts[channel] == time:
            return f'{name} has two messages swapped: in {where}, and the next'
        return f'{name} has no message in {where}'

    def _unequal(self, stamp: int, expected: list[bytes]) -> str:
        """Tells what is wrong with the first message that differs; its log time is right."""
        pairs = enumerate(zip(self._queues, expected, strict=False))
        channel = next(i for i, (queue, data) in pairs if queue[0].data != data)
        (name, topic), queue = self._pairings[channel], self._queues[channel]
        where = f'state {self.states + 1}, stamp {seconds(stamp)}'
        if queue[0].data == self._next_expected(stamp, channel):
            if len(queue) > 1 and queue[1].data == expected[channel]:
                return f'{name} has two messages swapped: of {where}, and the next'
            return f'{name} has no message of {where}: the next one is in its place'
        if self._before and queue[0].data == self._before[channel]:
            return f'{name} has in {where} the message of the state before again'
        words = differing(topic.interface, queue[0].data, expected[channel])
        return f'{name}: {words}; {where}, in piece of motion {self._piece}'

    def _next_expected(self, stamp: int, place: int) -> bytes | None:
        """The message of the next state, if the log tells when that is and what it was."""
        for channel in self._stamped:
            queue = self._queues[channel]
            if len(queue) < 2:
                continue
            this, following = (stamp_of(queue[i].data) for i in range(2))
            if this == stamp < following:
                nexts = [q[min(1, len(q) - 1)].data for q in self._queues]
                with suppress(LinkageError):
                    piece = self._timeline.piece.segment
                    return self._recomputation.messages_at(piece, following, nexts)[place]
        return None

    def _broken_off(self) -> str:
        """Tells which topic has no more messages while others have."""
        fewest = min(range(len(self._queues)), key=lambda i: len(self._queues[i]))
        heads = [self._queues[i][0].data for i in self._stamped if self._queues[i]]
        where = f', stamp {seconds(stamp_of(heads[0]))}' if heads else ''
        return f'{self._pairings[fewest][0]} has no message in state {self.states + 1}{where}'
