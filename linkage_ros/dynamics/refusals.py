# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Functions that programs call where a result is not finite."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NoReturn

from linkage_ros.errors import ConfigurationError, MechanismError
from linkage_ros.numeric import require_finite


def refuse_overflow(names: Sequence[str], *values: float) -> NoReturn:
    """Rejects numbers that are not finite, or whose results overflow.

    Raises:
        ConfigurationError: Always.
    """
    given = dict(zip(names, values, strict=False))
    require_finite(**given)
    words = ', '.join(f'{name.replace("_", " ")} = {x:g}' for name, x in given.items())
    raise ConfigurationError(f'the torque or an acceleration overflows at {words}: lower them')


def refuse_massless() -> NoReturn:
    """Rejects a mass matrix that is not positive definite.

    Raises:
        MechanismError: Always.
    """
    raise MechanismError(
        'something moves without a mass: its acceleration under a torque has no finite value; '
        'give the links a mass or an inertia'
    )
