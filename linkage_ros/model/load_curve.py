# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A load curve, measured or assumed: force or torque over the crank angle or a position."""

from __future__ import annotations

import bisect
import csv
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import ClassVar, NamedTuple

import numpy as np

from linkage_ros.errors import ConfigurationError
from linkage_ros.files import open_file
from linkage_ros.formulas import ZERO, Opaque, where
from linkage_ros.model.loads import AppliedLoad, continuous
from linkage_ros.model.pose import LinkPose
from linkage_ros.model.structure import Mechanism
from linkage_ros.numeric import Real, without_turns
from linkage_ros.quantities import quantity, shown

_TURN = 2 * math.pi
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
        file: A CSV file with columns at, value and optionally return_value; it is read at once,
            and not kept.
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
        for i, (x, y) in enumerate(itertools.pairwise(at)):
            if not x < y:
                raise ConfigurationError(
                    f'load.at must rise: its number {i + 2}, {y:g}, is not above {x:g} before it'
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
        columns = _columns_of(self.file)
        for field in fields(self):
            if field.name in columns:
                name, row = f'load.{field.name}', columns[field.name]
                object.__setattr__(self, field.name, field.metadata['quantity'].clean(name, row))
        object.__setattr__(self, 'file', '')

    def _require_one_turn(self, at: Sequence[float], value: Sequence[float]) -> None:
        if self.return_value is not None:
            raise ConfigurationError(
                "load.return_value is for load.over = 'position': leave it out, the crank angle "
                'tells forth from back'
            )
        span = at[-1] - at[0]
        if abs(span - _TURN) <= 8 * math.ulp(_TURN):
            if value[0] != value[-1]:
                raise ConfigurationError(
                    f'load.value starts with {value[0]:g} and ends, one turn later, with '
                    f'{value[-1]:g}: they must be equal, or leave the last point out'
                )
        elif span > _TURN:
            raise ConfigurationError(
                f'load.at spans {span:g} rad: must be at most one turn, {_TURN!r}'
            )

    def on(self, mechanism: Mechanism) -> CurveForce:
        """See `AppliedLoad`.

        Raises:
            ConfigurationError: The mechanism has no such link, or the link turns fully, over:
                position.
        """
        link, at = mechanism.output(self.link, 'load.link'), self.at or ()
        if self.over == 'crank_angle':
            return CurveForce(link, None, Opaque(Table(at, self.value or (), turns=True)))
        middle = mechanism.swing_middle(link, "load.over = 'position'")
        if middle is not None:
            turns = round((0.5 * (at[0] + at[-1]) - middle) / _TURN)
            at = tuple(place - turns * _TURN for place in at)
        forth = Opaque(Table(at, self.value or ()))
        back = Opaque(Table(at, self.return_value)) if self.return_value else None
        return CurveForce(link, middle, forth, back, over_position=True)


class CurveForce(NamedTuple):
    """A load curve for formulas.

    Attributes:
        link: Index of the link.
        middle: Middle of the swing of a link that turns, rad.
        value: The load as a function of angle or position.
        return_value: The load while the position falls; None: the same.
        over_position: Whether the curve depends on the link's position, not on the crank angle.
    """

    link: int
    middle: Real
    value: Opaque
    return_value: Opaque | None = None
    over_position: bool = False

    def forces(self, links: Sequence[LinkPose], rates: Sequence[Real]) -> dict[int, Real]:
        """See `Load`."""
        place = links[0].position
        if self.over_position:
            place = continuous(links[self.link].position, self.middle)
        force = self.value(place)
        if self.return_value is not None:
            force = where(rates[self.link] >= 0, force, self.return_value(place))
        return {self.link: force}

    def resistance(self, links: Sequence[LinkPose], rates: Sequence[Real]) -> dict[int, Real]:
        """See `Load`: none, because the force is external."""
        del links, rates
        return {}

    def potential(self, links: Sequence[LinkPose]) -> Real:
        """See `Load`: there is none."""
        del links
        return ZERO


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

        Raises:
            ConfigurationError: Two points are so close together that no slope can be computed.
        """
        self._turns, self._first = turns, at[0]
        if turns:
            at, value = (*at, at[0] + _TURN), (*value, value[0])
            if at[-1] - at[-2] <= 8 * math.ulp(_TURN):
                at, value = at[:-1], value[:-1]
        with np.errstate(all='ignore'):
            slopes = np.diff(value) / np.diff(at)
        steep = np.flatnonzero(~np.isfinite(slopes))
        if len(steep):
            first, second = at[steep[0]], at[steep[0] + 1]
            raise ConfigurationError(
                f'load.at: {first!r} and {second!r} are too close together; move them apart'
            )
        # The slopes before the first point and after the last; a direction that is rounded may lie
        # there.
        before, after = (slopes[-1], slopes[0]) if turns else (0.0, 0.0)
        self._at = list(at)
        self._from = [at[0], *at]
        self._value = [value[0], *value]
        self._slope = [float(before), *slopes.tolist(), float(after)]
        self._rows = [np.array(row) for row in (at, self._from, self._value, self._slope)]

    def __call__(self, place: Real) -> Real:
        """The value at a place, or at an array of them."""
        if self._turns:
            place = without_turns(place, self._first)
        if isinstance(place, float):
            i = bisect.bisect_right(self._at, place)
            return self._value[i] + self._slope[i] * (place - self._from[i])
        at, start, value, slope = self._rows
        found = np.searchsorted(at, place, side='right')
        return value[found] + slope[found] * (place - start[found])


def _columns_of(path: str) -> dict[str, tuple[float, ...]]:
    """The columns of a CSV file.

    Raises:
        ConfigurationError: The file cannot be read, or is not such a table.
    """
    try:
        with open_file(path) as stream:
            text = stream.read(_MOST_BYTES + 1).decode('utf-8-sig')
        if len(text) > _MOST_BYTES:
            raise ConfigurationError(
                f'load.file = {shown(path)}: is longer than {_MOST_BYTES} bytes; give fewer points'
            )
        rows = [row for row in csv.reader(text.splitlines()) if row]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        reason = getattr(error, 'strerror', None) or 'no table'
        raise ConfigurationError(
            f'load.file = {shown(path)}: {reason}; give the path of a CSV file with the columns '
            'at, value and, if wanted, return_value'
        ) from error
    names = [name.strip() for name in rows[0]] if rows else []
    if names not in (list(_COLUMNS[:2]), list(_COLUMNS)):
        raise ConfigurationError(
            f'load.file = {shown(path)}: the first line must be at,value or at,value,return_value'
        )
    columns: dict[str, list[float]] = {name: [] for name in names}
    if len(rows) == 1:
        raise ConfigurationError(f'load.file = {shown(path)}: holds no points')
    for line, row in enumerate(rows[1:], 2):
        numbers = [_number(cell) for cell in row]
        if len(row) != len(names) or not all(map(math.isfinite, numbers)):
            raise ConfigurationError(
                f'load.file = {shown(path)}, row {line}: must be {len(names)} finite numbers'
            )
        for name, number in zip(names, numbers, strict=True):
            columns[name].append(number)
    return {name: tuple(column) for name, column in columns.items()}


def _number(cell: str) -> float:
    """Reads a cell; nan if it is not a number."""
    try:
        return float(cell)
    except ValueError:
        return math.nan
