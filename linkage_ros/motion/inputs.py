# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Readers of the messages that a motion receives."""

import math
import time
from collections.abc import Iterable
from typing import Any, Generic, TypeVar

from linkage_ros.motion.segments import Motion
from linkage_ros.units import NS_PER_S

WINDOW = 10  # s, period to which the rates and warnings of diagnostics refer

T = TypeVar('T')


class Expiring(Generic[T]):
    """The last received value, which acts from the tick that reads it until it expires.

    Attributes:
        default: Value that acts before the first value and after a timeout.
        value: The value that acts.
        timeouts: Number of values that expired.
    """

    def __init__(self, default: T, timeout: float) -> None:
        """Initializes without a received value.

        Args:
            default: Value that acts before the first value and after a timeout.
            timeout: Time for which a received value acts, s.
        """
        self.value, self.timeouts = default, 0
        self.default, self._timeout = default, round(timeout * NS_PER_S)
        self._begin: int | None = None  # of the last received value, ns
        self._is_active = False
        self._without_at = -math.inf  # last time without a value after a timeout, s

    def at(self, now: int, received: Iterable[T]) -> T:
        """Returns the value that acts from now on.

        Args:
            now: Time of a tick, ns. If it goes back, the value expires.
            received: The values received since the last call.
        """
        for value in received:
            self.value, self._begin, self._is_active = value, now, True
        if self._begin is not None and not self.acts(now - self._begin):
            self.timeouts += self._is_active
            self.value, self._is_active = self.default, False
            self._without_at = time.monotonic()
        return self.value

    def acts(self, age: int) -> bool:
        """Returns whether a value acts at an age, ns."""
        return 0 <= age < self._timeout

    @property
    def has_expired(self) -> bool:
        """Whether, after a timeout, no value acted at some time in the last 10 s."""
        return time.monotonic() - self._without_at < WINDOW


class Input:
    """Reader of the messages on a topic that a drive receives."""

    def read(self, data: bytes, received: int) -> Any:
        """Reads a message.

        Args:
            data: CDR bytes of the message.
            received: Time of receipt, ns.

        Returns:
            A value for `applied`.

        Raises:
            ValueError: The message must be rejected; the error text is the cause.
        """
        raise NotImplementedError

    def applied(self, motion: Any, stamp: int, elapsed: int, received: Iterable[Any]) -> Motion:
        """Applies the messages received since the last tick to a motion.

        Args:
            motion: The motion so far.
            stamp: Stamp of the tick, ns.
            elapsed: Time from tick 0, ns, which a step of the clock does not change.
            received: Iterator that calls `read` for each new message.

        Returns:
            The motion from the tick on.
        """
        raise NotImplementedError

    def notes(self, topic: str) -> list[str]:  # noqa: ARG002, for other inputs
        """Returns likely mistakes to report at the start, given the name of the topic."""
        return []

    def troubles(self, topic: str) -> list[str]:  # noqa: ARG002, for other inputs
        """Returns warnings, given the name of the topic."""
        return []

    def diagnostics(self) -> dict[str, str]:
        """Returns figures for diagnostics, by name."""
        return {}
