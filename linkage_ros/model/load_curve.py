# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A load curve, measured or assumed: force or torque over the crank angle or a position."""

import bisect
import csv
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, ClassVar, NamedTuple

import numpy as np

from linkage_ros.errors import ConfigurationError
from linkage_ros.files import open_file
from linkage_ros.formulas import Opaque, where
from linkage_ros.model.kinematics import LinkPose
from linkage_ros.model.loads import AppliedLoad, continuous
from linkage_ros.numeric import Real, without_turns
from linkage_ros.quantities import quantity, shown

_TURN = 2 * math.pi
_ROUNDING = 8 * math.ulp(_TURN)  # rad: tolerance of points that are one turn apart
_PLACES = (-1e9, 1e9)
_FORCES = (-1e12, 1e12)
_COLUMNS = 'at', 'value', 'return_value'
_MOST_BYTES = 1 << 22


@dataclass(frozen=True)
class LoadCurve(AppliedLoad):
    """A force or torque on a link, linear between points.

    Attributes:
        link: 'crank', or the output link: 'rocker' or 'slider'.
        over: 'crank_angle': the crank's direction, and the first point follows the last one turn
            later; 'position': the output link's, a rocker's angle continuous over its swing. The
            end values hold outside the points.
        at: Crank angles or positions of the points, rising, rad or m.
        value: Load on the link there: N m counter-clockwise; on a slider, N along the guide.
        return_value: With over: position, the load while the link's rate is negative; None: value.
        file: A CSV file with columns at, value and optionally return_value. It is read on
            creation; the name is not kept.
    """

    group: ClassVar[str] = 'load'
    has_corners: ClassVar[bool] = True

    link: str = quantity(
        'choice', 'link that the load curve acts on', choices=('crank', 'rocker', 'slider')
    )
    over: str = quantity(
        'choice', 'what the curve depends on', choices=('crank_angle', 'position'),
        default='crank_angle',
    )  # fmt: skip
    at: tuple[float, ...] | None = quantity(
        'list', 'where its points are, rising', 'rad or m', span=_PLACES, default=None
    )
    value: tuple[float, ...] | None = quantity(
        'list', 'force or torque on the link at these points', 'N or N m', span=_FORCES,
        default=None,
    )  # fmt: skip
    return_value: tuple[float, ...] | None = quantity(
        'list', 'the same while the position falls; empty: as value', 'N or N m', span=_FORCES,
        default=None,
    )  # fmt: skip
    file: str = quantity('text', 'a CSV file with these columns instead', default='')

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.file:
            self._read()
        at, value, back = self.at, self.value, self.return_value
        if at is None or value is None:
            raise ConfigurationError('load needs at and value, lists of numbers, or file')
        for name, row in (('value', value), ('return_value', back)):
            if row is not None and len(row) != len(at):
                raise ConfigurationError(
                    f'load.{name} has {len(row)} numbers and load.at {len(at)}: give one for each '
                    'point'
                )
        for i, (x, y) in enumerate(itertools.pairwise(at), 2):
            if not x < y:
                raise ConfigurationError(
                    f'load.at must rise: its number {i}, {y:g}, is not above {x:g} before it'
                )
        if self.over == 'crank_angle':
            self._require_one_turn(at, value)
        elif self.link == 'crank':
            raise ConfigurationError(
                "load.over = 'position': must be crank_angle where load.link is crank"
            )

    def _read(self) -> None:
        if any(getattr(self, name) is not None for name in _COLUMNS):
            raise ConfigurationError(
                f'load.file = {shown(self.file)}: leave out at, value and return_value, which the '
                'file holds'
            )
        try:
            with open_file(self.file) as stream:
                columns = _columns(stream.read(_MOST_BYTES + 1))
        except (OSError, ValueError, csv.Error) as error:
            raise ConfigurationError(
                f'load.file = {shown(self.file)}: {getattr(error, "strerror", None) or error}; '
                'give the path of a CSV file with the columns at, value and, if wanted, '
                'return_value'
            ) from error
        kinds = {field.name: field.metadata['quantity'] for field in fields(self)}
        for name, row in columns.items():
            object.__setattr__(self, name, kinds[name].clean(f'load.{name}', row))
        object.__setattr__(self, 'file', '')

    def _require_one_turn(self, at: Sequence[float], value: Sequence[float]) -> None:
        if self.return_value is not None:
            raise ConfigurationError(
                "load.return_value is for load.over = 'position': leave it out, the crank angle "
                'tells forth from back'
            )
        span = at[-1] - at[0]
        ends = span >= _TURN - _ROUNDING and value[0] != value[-1]
        if span > _TURN + _ROUNDING or ends:
            raise ConfigurationError(
                f'load.at spans {span:g} rad and load.value ends with {value[-1]:g}: must be at '
                f'most one turn, {_TURN!r}, and after a whole one end with the first, {value[0]:g}'
            )

    def on(self, mechanism: Any) -> 'CurveForce':
        """See `AppliedLoad`.

        Raises:
            ConfigurationError: The mechanism has no such link, or a link of a curve over position
                turns fully.
        """
        link, at, value = mechanism.output(self.link, 'load.link'), self.at or (), self.value or ()
        if self.over == 'crank_angle':
            return CurveForce(link, 0, None, Opaque(Table(at, value, turns=True)))
        middle = mechanism.swing_middle("load.over = 'position'")
        if middle is not None:
            turns = round((0.5 * (at[0] + at[-1]) - middle) / _TURN)
            at = tuple(place - turns * _TURN for place in at)
        back = Opaque(Table(at, self.return_value)) if self.return_value else None
        return CurveForce(link, link, middle, Opaque(Table(at, value)), back)


class CurveForce(NamedTuple):
    """A load curve for formulas.

    Attributes:
        link: Index of the link.
        over: Index of the link on whose position the curve depends.
        middle: Middle of the swing of a link that turns, rad; see `continuous`.
        value: The load as a function of this position.
        return_value: The load while the position falls; None: the same.
    """

    link: int
    over: int
    middle: Real
    value: Opaque
    return_value: Opaque | None = None

    def forces(self, links: Sequence[LinkPose], rates: Sequence[Real]) -> dict[int, Real]:
        """See `Load`."""
        place = continuous(links[self.over].position, self.middle)
        force = self.value(place)
        if self.return_value is not None:
            force = where(rates[self.link] >= 0, force, self.return_value(place))
        return {self.link: force}


class Table:
    """A function that is linear between points, for floats and arrays with the same bits."""

    def __init__(
        self, at: Sequence[float], value: Sequence[float], *, turns: bool = False
    ) -> None:
        """Takes the points.

        Args:
            at: Places of the points, rising.
            value: Values there; the end values hold outside.
            turns: Whether `at` are directions, rad, so that the points repeat every turn.
        """
        self._turns = turns
        if turns and at[0] + _TURN - at[-1] > _ROUNDING:
            at, value = (*at, at[0] + _TURN), (*value, value[0])
        with np.errstate(all='ignore'):
            slopes = np.diff(value) / np.diff(at)
        # The slopes before the first point and after the last; a direction that is rounded may lie
        # there.
        before, after = (slopes[-1], slopes[0]) if turns else (0.0, 0.0)
        self._lists = [[*at], [at[0], *at], [value[0], *value], [before, *slopes, after]]
        self._arrays = [np.array(row) for row in self._lists]
        self._lists[3] = self._arrays[3].tolist()

    def __call__(self, place: Real) -> Real:
        """The value at a place, or at an array of them."""
        is_float = isinstance(place, float)
        at, start, value, slope = self._lists if is_float else self._arrays
        if self._turns:
            place = without_turns(place, at[0])
        i = bisect.bisect_right(at, place) if is_float else np.searchsorted(at, place, 'right')
        return value[i] + slope[i] * (place - start[i])


def _columns(data: bytes) -> dict[str, tuple[float, ...]]:
    """The columns of a CSV table.

    Raises:
        ValueError: It is not such a table.
    """
    if len(data) > _MOST_BYTES:
        raise ValueError(f'is longer than {_MOST_BYTES} bytes')
    lines = csv.reader(data.decode('utf-8-sig').splitlines())
    first, *rows = [row for row in lines if row] or [[]]
    names = tuple(name.strip() for name in first)
    if names not in (_COLUMNS[:2], _COLUMNS):
        raise ValueError('the first line must be at,value or at,value,return_value')
    if not rows or any(len(row) != len(names) for row in rows):
        raise ValueError(f'each line below {",".join(names)} must be {len(names)} numbers')
    columns = (tuple(map(float, column)) for column in zip(*rows, strict=True))
    return dict(zip(names, columns, strict=True))
