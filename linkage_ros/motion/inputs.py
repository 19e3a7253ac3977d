# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Readers of the messages that a motion receives."""

import time
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Generic, NamedTuple, TypeVar

from linkage_ros.messages.topics import prefix_of
from linkage_ros.motion.segments import Motion
from linkage_ros.units import NS_PER_S

WINDOW = 10  # s, period to which the rates and warnings of diagnostics refer
_MOST_LOSSES = 3  # in this period; a source that is lost more often counts as lost throughout

T = TypeVar('T')


class Losses:
    """The last losses of a source of messages.

    A loss and its end are reported at once, so a source that is lost often must not count as
    found each time.
    """

    def __init__(self) -> None:
        self._times = deque[float](maxlen=_MOST_LOSSES)

    def add(self) -> None:
        """Notes that the source was lost."""
        self._times.append(time.monotonic())

    @property
    def note(self) -> str:
        """Words for warnings if the source was lost three times in the last 10 s, or none."""
        times = [*self._times]
        are_frequent = len(times) == _MOST_LOSSES and time.monotonic() - times[0] < WINDOW
        return f', {_MOST_LOSSES} times or more in the last {WINDOW} s' * are_frequent


class Expiring(Generic[T]):
    """The last received value, which acts from the tick that reads it until it expires.

    Attributes:
        default: Value that acts before the first value and after a timeout.
        value: The value that acts.
        timeouts: Number of values that expired.
        losses: The last of these.
    """

    def __init__(self, default: T, timeout: float) -> None:
        """Initializes without a received value, which acts until a timeout, s."""
        self.value, self.timeouts = default, 0
        self.default, self._timeout = default, round(timeout * NS_PER_S)
        self._begin: int | None = None  # of the last received value, ns
        self._is_active = False
        self.losses = Losses()

    def at(self, now: int, received: Iterable[T]) -> T:
        """Returns the value that acts from a tick on, given the values since the last call.

        The value expires if the time of the tick, ns, goes back.
        """
        for value in received:
            self.value, self._begin, self._is_active = value, now, True
        if self._begin is not None and not self.acts(now - self._begin):
            if self._is_active:
                self.timeouts += 1
                self.losses.add()
            self.value, self._is_active = self.default, False
        return self.value

    def acts(self, age: int) -> bool:
        """Returns whether a value acts at an age, ns."""
        return 0 <= age < self._timeout

    @property
    def is_lost(self) -> bool:
        """Whether the last value has expired, or values expire often."""
        has_expired = self._begin is not None and not self._is_active
        return has_expired or bool(self.losses.note)


class UnnamedError(ValueError):
    """The message does not name the crank of the linkage; it may be for another linkage."""


class Input:
    """Reader of the messages for one linkage on a topic that its drive receives.

    Attributes:
        has_ended: Whether the motion of the linkage has ended.
    """

    has_ended = False

    def require_motion(self) -> None:
        """Checks that a message can act.

        Raises:
            ValueError: The motion has ended.
        """
        if self.has_ended:
            raise ValueError('its motion has ended')

    def read(self, data: bytes, received: int) -> Any:
        """Reads a message.

        Args:
            data: CDR bytes of the message.
            received: Time of receipt, ns.

        Returns:
            A value for `applied`.

        Raises:
            UnnamedError: The message is not for this linkage.
            ValueError: The message must be rejected; the error text is the cause.
        """
        raise NotImplementedError

    def reject(self, error: ValueError) -> None:
        """Counts a rejected message, given the error of `read`."""

    def resume(self) -> None:
        """Notes that messages are read again, after a time in which they were not."""

    def prepare(self, motion: Any, stamp: int) -> None:
        """Takes the motion at a tick, before the messages since the last tick are read."""

    def applied(self, motion: Any, stamp: int, elapsed: int, received: Iterable[Any]) -> Motion:
        """Applies the messages received since the last tick to a motion.

        Args:
            motion: The motion so far.
            stamp: Stamp of the tick, ns.
            elapsed: Time from tick 0, ns, which a step of the clock does not change.
            received: Results of `read` for the new messages.

        Returns:
            The motion from the tick on.
        """
        raise NotImplementedError

    def notes(self, topic: str) -> list[str]:  # noqa: ARG002, for other inputs
        """Returns likely mistakes to report at the start, given the name of the topic."""
        return []

    def troubles(self, topic: str) -> list[str]:  # noqa: ARG002, for other inputs
        """Returns warnings, given the name of the topic; a change is reported at once."""
        return []

    def diagnostics(self) -> dict[str, str]:
        """Returns figures for diagnostics, by name."""
        return {}


class StaleError(ValueError):
    """The message is not newer than the last accepted one, so that it changes nothing."""


class Received(NamedTuple):
    """Values of a message for the linkages of a run, and reasons for rejections.

    Attributes:
        values: Result of `Input.read` for each linkage that accepts the message, by its name.
        refused: Why other linkages that it names reject it, by their names.
    """

    values: dict[str, Any]
    refused: dict[str, ValueError]

    @property
    def invalid(self) -> tuple[str, ...]:
        """Names of the linkages that reject the message although it is newer than the last."""
        return tuple(
            name for name, error in self.refused.items() if not isinstance(error, StaleError)
        )


class SharedInput:
    """Reader of the messages on a topic that all linkages of a run share.

    A message may name any of their cranks.

    Attributes:
        sources: Reader of each linkage, by its name.
    """

    def __init__(self, sources: Mapping[str, Input]) -> None:
        self.sources = sources

    def read(self, data: bytes, received: int) -> Received:
        """Reads a message; see `Input.read`.

        Raises:
            UnnamedError: The message names no crank. The error text is the cause.
        """
        return self.collect(lambda source, *message: source.read(*message), data, received)

    def collect(
        self, read: Callable[[Any, bytes, int], Any], data: bytes, received: int
    ) -> Received:
        """Reads a message for each linkage by a function like `Input.read`.

        Raises:
            UnnamedError: As for `read`.
        """
        # Literals, because dict[str, Any]() takes a tenth of the time of a record.
        accepted: dict[str, Any] = {}
        refused: dict[str, ValueError] = {}
        unnamed: list[ValueError] = []
        for name, source in self.sources.items():
            try:
                accepted[name] = read(source, data, received)
            except UnnamedError as error:  # noqa: PERF203, one must not affect the others
                unnamed.append(error)
            except ValueError as error:
                refused[name] = error
                source.reject(error)
        if accepted or refused:
            return Received(accepted, refused)
        for source, absent in zip(self.sources.values(), unnamed, strict=True):
            source.reject(absent)
        raise unnamed[0]

    def resume(self) -> None:
        """Notes that messages are read again; see `Input.resume`."""
        for source in self.sources.values():
            source.resume()

    def troubles(self, topic: str) -> list[str]:
        """Returns warnings, given the name of the topic; a change is reported at once."""
        return [
            f'{prefix_of(name, ": ")}{line}'
            for name, source in self.sources.items()
            for line in source.troubles(topic)
        ]

    def notes(self, topic: str) -> list[str]:
        """Returns likely mistakes to report at the start, given the name of the topic."""
        return [
            f'{prefix_of(name, ": ")}{line}'
            for name, source in self.sources.items()
            for line in source.notes(topic)
        ]

    def diagnostics(self) -> dict[str, str]:
        """Returns figures for diagnostics, by name."""
        return {
            f'{prefix_of(name, ": ")}{key}': value
            for name, source in self.sources.items()
            for key, value in source.diagnostics().items()
        }
