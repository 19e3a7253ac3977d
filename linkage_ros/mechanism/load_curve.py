# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Load curves: force or torque as a function of an angle or position, given by points."""

import bisect
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, ClassVar, NamedTuple, cast

import numpy as np

from linkage_ros.errors import ConfigurationError
from linkage_ros.files import read_columns
from linkage_ros.formulas import ZERO, Opaque, where
from linkage_ros.mechanism.kinematics import LinkPose
from linkage_ros.mechanism.loads import AppliedLoad, continuous
from linkage_ros.mechanism.wrenches import Wrench
from linkage_ros.numeric import Array, Real, without_turns
from linkage_ros.quantities import quantity, shown

_TURN = 2 * math.pi
_ROUNDING = 8 * math.ulp(_TURN)  # rad; tolerance for points that are one turn apart
_POSITIONS = (-1e9, 1e9)
_FORCES = (-1e12, 1e12)
_COLUMNS = 'at', 'value', 'return_value'


@dataclass(frozen=True)
class LoadCurve(AppliedLoad):
    """A force or torque on a link, interpolated linearly between points.

    Attributes:
        link: Loaded link: 'crank', 'rocker' or 'slider'.
        over: Independent variable. With 'crank_angle', the curve repeats every turn of the crank.
            With 'position', it is the slider's position, or the rocker's angle without a jump in
            its swing; outside the points, the end values apply.
        at: Crank angles or positions of the points, in increasing order, rad or m.
        value: Load on the link at these points: torque, N m, positive counter-clockwise; on a
            slider, force along the guide, N.
        return_value: Load on the link while its rate is negative, or None to use `value`. Only
            with `over` = 'position'.
        file: CSV file with the columns at, value and optionally return_value. It is read on
            creation, after which this field is empty.
    """

    group: ClassVar[str] = 'load'
    has_corners: ClassVar[bool] = True

    link: str = quantity(
        'choice', 'link that the load curve acts on', choices=('crank', 'rocker', 'slider')
    )
    over: str = quantity(
        'choice', 'variable of the load curve', choices=('crank_angle', 'position'),
        default='crank_angle',
    )  # fmt: skip
    at: tuple[float, ...] | None = quantity(
        'list',
        'angles or positions of the points, in increasing order',
        'rad or m',
        span=_POSITIONS,
        default=None,
    )
    value: tuple[float, ...] | None = quantity(
        'list', 'force or torque on the link at these points', 'N or N m', span=_FORCES,
        default=None,
    )  # fmt: skip
    return_value: tuple[float, ...] | None = quantity(
        'list', 'the same while the position decreases; if empty, `value` is used', 'N or N m',
        span=_FORCES, default=None,
    )  # fmt: skip
    file: str = quantity(
        'text', 'CSV file with these lists as columns, used instead of them', default=''
    )

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
                    f'load.at must increase: number {i}, {y:g}, is not above {x:g} before it'
                )
        if self.over == 'crank_angle':
            self._require_one_turn(at, value)
        elif self.link == 'crank':
            raise ConfigurationError(
                "load.over = 'position': must be crank_angle if load.link is crank"
            )

    def _read(self) -> None:
        if any(getattr(self, name) is not None for name in _COLUMNS):
            raise ConfigurationError(
                f'load.file = {shown(self.file)}: leave out at, value and return_value, which the '
                'file contains'
            )
        try:
            columns = read_columns(self.file, _check_columns)
        except (OSError, ValueError) as error:
            raise ConfigurationError(
                f'load.file = {shown(self.file)}: {getattr(error, "strerror", None) or error}; '
                'give the path of a CSV file with the columns at, value and optionally '
                'return_value'
            ) from error
        kinds = {field.name: field.metadata['quantity'] for field in fields(self)}
        for name, row in columns.items():
            object.__setattr__(self, name, kinds[name].clean(f'load.{name}', row))
        object.__setattr__(self, 'file', '')

    def _require_one_turn(self, at: Sequence[float], value: Sequence[float]) -> None:
        if self.return_value is not None:
            raise ConfigurationError(
                "load.return_value is for load.over = 'position': leave it out; over crank_angle, "
                'value holds the load of both strokes'
            )
        span = at[-1] - at[0]
        ends = span >= _TURN - _ROUNDING and value[0] != value[-1]
        if span > _TURN + _ROUNDING or ends:
            raise ConfigurationError(
                f'load.at spans {span:g} rad and load.value ends with {value[-1]:g}: must span at '
                f'most one turn, {_TURN!r}; after a whole turn, the last value must equal the '
                f'first, {value[0]:g}'
            )

    def on(self, mechanism: Any) -> 'CurveForce':
        """See `AppliedLoad.on`.

        Raises:
            ConfigurationError: The mechanism has no such link, or the curve is over position and
                the link turns fully.
        """
        link, at, value = mechanism.output(self.link, 'load.link'), self.at or (), self.value or ()
        if self.over == 'crank_angle':
            return CurveForce(link, 0, None, Opaque(Table(at, value, turns=True)))
        half_way = 0.5 * (at[0] + at[-1])
        middle = mechanism.swing_middle("load.over = 'position'", half_way)
        if middle is not None:
            turns = round((half_way - middle) / _TURN)
            at = tuple(angle - turns * _TURN for angle in at)
        table = Table(at, value)
        if self.return_value:
            back = Opaque(Table(at, self.return_value))
            return CurveForce(link, link, middle, Opaque(table), back)
        return CurveForce(link, link, middle, Opaque(table), None, Opaque(table.integral))


class CurveForce(NamedTuple):
    """A load curve, in the form used by formulas.

    Attributes:
        link: Index of the loaded link.
        over: Index of the link whose position is the independent variable.
        middle: Middle of the swing of that link, rad; None to use its position unchanged.
        value: The load as a function of this position.
        return_value: The load while the position decreases, or None to use `value`.
        work: The work of the load from the first point to a position; None if it depends on more.
    """

    link: int
    over: int
    middle: Real
    value: Opaque
    return_value: Opaque | None = None
    work: Opaque | None = None

    def wrenches(self, links: Sequence[LinkPose], rates: Sequence[Real]) -> list[Wrench]:
        """See `Load`."""
        position = continuous(links[self.over].position, self.middle)
        force = self.value(position)
        if self.return_value is not None:
            force = where(rates[self.link] >= 0, force, self.return_value(position))
        return [Wrench(self.link, force)]

    def potential(self, links: Sequence[LinkPose]) -> Real:
        """Returns the potential energy, J, or ZERO if there is none; see `Load`."""
        if self.work is None:
            return ZERO
        return -self.work(continuous(links[self.over].position, self.middle))

    def piece(self, links: Sequence[LinkPose], rates: Sequence[Real]) -> Real:
        """Numbers the lines between points, separately for each direction; see `Load`."""
        position = continuous(links[self.over].position, self.middle)
        line = cast('Table', self.value.function).line(position)
        return 2 * line + (rates[self.over] >= 0)


class Table:
    """A piecewise linear function; results are bit-identical for floats and arrays."""

    def __init__(
        self, at: Sequence[float], value: Sequence[float], *, turns: bool = False
    ) -> None:
        """Computes the slopes between the points.

        Args:
            at: Values of x at the points, in increasing order.
            value: Values of the function at the points; the end values also apply outside.
            turns: Whether x is a direction, rad, so that the function repeats every turn.
        """
        self._turns = turns
        if turns and at[0] + _TURN - at[-1] > _ROUNDING:
            at, value = (*at, at[0] + _TURN), (*value, value[0])
        slopes = np.diff(value) / np.diff(at)
        # Slopes outside the points, because rounding may put a direction just beyond the ends.
        before, after = (slopes[-1], slopes[0]) if turns else (0.0, 0.0)
        # The integral from the first point to the start of each line.
        areas = np.cumsum(0.5 * np.diff(at) * np.add(value[1:], value[:-1]))
        starts = [at[0], *at], [value[0], *value], [0.0, 0.0, *areas]
        rows = at, *starts, [before, *slopes, after]
        self._arrays = [np.array(row) for row in rows]
        self._lists = [row.tolist() for row in self._arrays]

    def __call__(self, x: Real) -> Real:
        """Evaluates the function at x, a float or an array."""
        is_float = isinstance(x, float)
        at, start, value, _, slope = self._lists if is_float else self._arrays
        if self._turns:
            x = without_turns(x, at[0])
        i = bisect.bisect_right(at, x) if is_float else np.searchsorted(at, x, 'right')
        return value[i] + slope[i] * (x - start[i])

    def integral(self, x: Real) -> Real:
        """Integrates the function of a position from the first point to x, a float or an array."""
        is_float = isinstance(x, float)
        at, start, value, area, slope = self._lists if is_float else self._arrays
        i = bisect.bisect_right(at, x) if is_float else np.searchsorted(at, x, 'right')
        return area[i] + (value[i] + 0.5 * slope[i] * (x - start[i])) * (x - start[i])

    def line(self, x: Array) -> Any:
        """Returns the number of points up to x, in all turns."""
        at = self._arrays[0]
        if not self._turns:
            return np.searchsorted(at, x, 'right')
        within = without_turns(x, at[0])
        return np.searchsorted(at, within, 'right') + len(at) * np.rint((x - within) / _TURN)


def _check_columns(names: Sequence[str]) -> None:
    """Checks the names of columns.

    Raises:
        ValueError: They are not the columns of a load curve.
    """
    if tuple(names) not in (_COLUMNS[:2], _COLUMNS):
        raise ValueError('the first line must be at,value or at,value,return_value')
