# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The assemblies of a mechanism: combinations of those of its loop and of its dyads."""

from collections.abc import Iterable
from contextlib import suppress
from dataclasses import replace
from typing import Any

from linkage_ros import CROSSED, OPEN, ConfigurationError, Mechanism


def choices(mechanism: Mechanism) -> list[list[Any]]:
    """Returns the loop and each dyad, as they are and, if they have two assemblies, in the other.

    The loop is the mechanism itself, whose dyads do not count.
    """
    parts: tuple[Any, ...] = (mechanism, *mechanism.dyads)
    found = list[list[Any]]()
    for part in parts:
        found.append([part])
        with suppress(ConfigurationError):  # some have one assembly
            other = CROSSED if part.assembly == OPEN else OPEN
            found[-1].append(replace(part, assembly=other))
    return found


def combined(parts: Iterable[Any]) -> Any:
    """Returns the mechanism of a loop and dyads, one of each list of `choices`."""
    loop, *dyads = parts
    return replace(loop, dyads=tuple(dyads))
