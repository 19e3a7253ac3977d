# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Computes constants of many designs at once, with the code for a single mechanism.

The description of a mechanism gets arrays in place of numbers. Where its code branches on a value,
all designs must take the same branch. If they do not, they are divided by this condition, and each
group starts again. So every group has one structure, and one program.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from linkage_ros.dynamics.equations import Model
from linkage_ros.dynamics.tape import Constants
from linkage_ros.errors import LinkageError
from linkage_ros.model.structure import Mechanism
from linkage_ros.numeric import Array

Rows = npt.NDArray[np.intp]


class DivideError(Exception):
    """A condition holds only for some designs; the argument is its value for each design."""


class Designs(np.ndarray[Any, Any]):
    """A quantity of many designs, of shape (designs, 1)."""

    def __bool__(self) -> bool:
        holds = np.asarray(self).ravel() != 0
        if holds.all() or not holds.any():
            return bool(holds[0])
        raise DivideError(holds)


def groups(
    mechanism: Mechanism, columns: Mapping[str, Array], count: int
) -> Iterator[tuple[Rows, Model, Constants]]:
    """Divides designs into groups of one structure.

    Args:
        mechanism: The mechanism that the designs have in common.
        columns: Values for all designs, by parameter name.
        count: Number of designs.

    Yields:
        The indices of the designs; their model, in which varied numbers are arrays of shape
        (designs, 1); the model and the coupler point as constants. Designs that cannot be
        assembled are in no group.

    Raises:
        TypeError: The mechanism cannot be computed for arrays.
    """
    waiting = [np.arange(count)]
    while waiting:
        rows = waiting.pop()
        try:
            yield rows, *_constants(mechanism, columns, rows)
        except DivideError as error:
            (holds,) = error.args
            waiting += [rows[holds], rows[~holds]]
        except TypeError:  # some constants of this mechanism are functions of floats alone
            if len(rows) == 1:
                raise
            waiting += np.split(rows, len(rows))
        except LinkageError:
            continue


def _constants(
    mechanism: Mechanism, columns: Mapping[str, Array], rows: Rows
) -> tuple[Model, Constants]:
    for name, column in columns.items():
        value = float(column[rows[0]]) if len(rows) == 1 else column[rows, None].view(Designs)
        mechanism = with_value(mechanism, name, value)
    structure = mechanism.structure()
    model = Model.of(mechanism, structure)
    return model, Constants((model, structure.points.get('C')))


def with_value(part: Any, name: str, value: Any) -> Any:
    """A description with one value replaced, without checks.

    Args:
        part: A mechanism, one of its parts, or a pair of numbers.
        name: Dotted name of a parameter; 0 and 1 are the numbers of a pair.
        value: The value.

    Returns:
        A copy.
    """
    first, _, rest = name.partition('.')
    if isinstance(part, tuple):
        return tuple(value if i == int(first) else old for i, old in enumerate(part))
    changed = copy.copy(part)
    inner = with_value(getattr(part, first), rest, value) if rest else value
    object.__setattr__(changed, first, inner)
    return changed
