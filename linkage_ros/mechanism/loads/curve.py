# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Load curves: force, torque or pressure over an angle or position, given by points."""

import itertools
import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar, NamedTuple, cast

from linkage_ros.columns import column_names, read_columns
from linkage_ros.errors import ConfigurationError
from linkage_ros.formulas import ZERO, Opaque, where
from linkage_ros.mechanism.kinematics import LinkPose
from linkage_ros.mechanism.loads.base import AppliedLoad, LoadedMechanism, Range, continuous
from linkage_ros.mechanism.loads.gas import AMBIENT, FAR, NEAR
from linkage_ros.mechanism.loads.table import TURN, TURN_ROUNDING, Table
from linkage_ros.mechanism.wrenches import Wrench
from linkage_ros.numeric import Real
from linkage_ros.quantities import quantity, refuse_angles, shown

_POSITIONS = (-1e9, 1e9)
_FORCES = (-1e12, 1e12)
# Independent variables.
_ANGLE, _FROM_TDC, _POSITION = 'crank_angle', 'crank_angle_from_tdc', 'position'
_VARIABLES = 'at', _ANGLE, _FROM_TDC, _POSITION  # quantities of columns
_LISTS = 'at', 'value', 'return_value', 'pressure'


@dataclass(frozen=True)
class LoadCurve(AppliedLoad):
    """A force, torque or pressure on a link, interpolated linearly between points.

    Attributes:
        link: Loaded link: 'crank', 'rocker', 'slider', 'rod' of a cylinder, or a dyad's
            slider or rod.
        over: Independent variable. With 'crank_angle', the curve repeats every turn of the crank
            or, if its points span more than a turn, every two turns; likewise with
            'crank_angle_from_tdc', the crank angle from the top of a slider's stroke. With
            'position', it is the slider's position, or the rocker's angle without a jump in its
            swing; outside the points, the end values apply.
        at: Crank angles or positions of the points, in increasing order, rad or m.
        value: Load on the link at these points: torque, N m, positive counter-clockwise; on a
            slider, force along the guide, N.
        return_value: Load on the link while its rate is negative, or None to use `value`. Only
            with `over` = 'position'.
        file: CSV file whose header names the quantity and unit of each column. It is read when the
            mechanism is created, after which this field is empty. A column of angles from the top
            sets `over`.
        pressure: Absolute pressure at the points, Pa, instead of `value`. The force on the slider
            is (pressure - ambient) x area, away from the top; the cylinder head, a part of the
            frame, takes the opposite.
        bore: Diameter of the piston, m; only with `pressure`.
        ambient: Absolute pressure on the other side of the piston, Pa; by default 1.013e5.
        top: Top of the stroke, 'far' from the crank pivot (default) or 'near' to it; only with
            `pressure` or angles from the top.
    """

    has_corners: ClassVar[bool] = True

    link: str = quantity(
        'text', 'link that the load curve acts on: the crank, the output link, or a slider'
    )
    over: str = quantity(
        'choice', 'variable of the load curve; from_tdc: from the top of the stroke',
        choices=(_ANGLE, _FROM_TDC, _POSITION), default=_ANGLE,
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
    pressure: tuple[float, ...] | None = quantity(
        'list', 'absolute pressure on a slider at the points, instead of value', 'Pa',
        span=(0.0, 1e12), default=None,
    )  # fmt: skip
    bore: float | None = quantity(
        'number', 'diameter of the piston, with pressure', 'm', span=(1e-9, 1e9), default=None
    )
    ambient: float | None = quantity(
        'number', 'absolute pressure behind the piston; left out: 1.013e5', 'Pa',
        span=(0.0, 1e12), default=None,
    )  # fmt: skip
    top: str | None = quantity(
        'choice', 'top of the stroke: far from the crank pivot, or near it; left out: far',
        choices=(FAR, NEAR), default=None,
    )  # fmt: skip

    @property
    def turns(self) -> int:  # type: ignore[override]
        """Number of crank turns after which the curve repeats."""
        if self.over == _POSITION or self.at is None:
            return 1
        return 2 if self.at[-1] - self.at[0] > TURN + TURN_ROUNDING else 1

    def __post_init__(self) -> None:
        super().__post_init__()
        label, at = self.label, self.at
        given = [name for name in _LISTS if getattr(self, name) is not None]
        if self.file:
            if given:
                raise ConfigurationError(
                    f'{label}.file = {shown(self.file)}: leave out {", ".join(given)}, which the '
                    'file contains'
                )
            return
        if at is None or (self.value is None) == (self.pressure is None):
            raise ConfigurationError(
                f'{label} needs at and value, or at and pressure, lists of numbers, or file'
            )
        for name in given[1:]:
            row = getattr(self, name)
            if len(row) != len(at):
                raise ConfigurationError(
                    f'{label}.{name} has {len(row)} numbers and {label}.at {len(at)}: give one '
                    'for each point'
                )
        self._require_rising(at)
        self._require_bore()
        if self.over != _POSITION:
            self._require_turns(at, self.value or self.pressure or ())

    def _require_rising(self, at: Sequence[float]) -> None:
        for i, (x, y) in enumerate(itertools.pairwise(at), 2):
            if not x < y:
                raise ConfigurationError(
                    f'{self.label}.at must increase: number {i}, {y:g}, is not above {x:g} before '
                    'it'
                )

    def _require_bore(self) -> None:
        label = self.label
        if self.pressure is None:
            names = ('bore', 'ambient') if self.over == _FROM_TDC else ('bore', 'ambient', 'top')
            extra = [x for x in names if getattr(self, x) is not None]
            if extra:
                raise ConfigurationError(
                    f'{label}.{extra[0]} is for a pressure: leave it out, or give {label}.pressure'
                )
        elif self.bore is None or self.return_value is not None:
            raise ConfigurationError(
                f'{label}.pressure acts on a slider with a bore: give {label}.bore, in m, and '
                f'{label}.link: slider, and no return_value'
            )

    def _require_turns(self, at: Sequence[float], value: Sequence[float]) -> None:
        label = self.label
        if self.return_value is not None:
            raise ConfigurationError(
                f"{label}.return_value is for {label}.over = 'position': leave it out; over "
                'crank_angle, value holds the load of both strokes'
            )
        span = at[-1] - at[0]
        whole = any(abs(span - turns * TURN) <= turns * TURN_ROUNDING for turns in (1, 2))
        if span > 2 * (TURN + TURN_ROUNDING) or (whole and value[0] != value[-1]):
            name = 'value' if self.pressure is None else 'pressure'
            raise ConfigurationError(
                f'{label}.at spans {span:g} rad = {math.degrees(span):g} deg and {label}.{name} '
                f'ends with {value[-1]:g}: must span at most two turns, {2 * TURN!r}; after one '
                f'or two whole turns, the last value must equal the first, {value[0]:g}'
            )

    def completed(self) -> 'LoadCurve':
        """Reads the file; see `AppliedLoad.completed`.

        Raises:
            ConfigurationError: The file cannot be read, or does not fit the other parameters.
        """
        if not self.file:
            return self
        label = self.label
        try:
            lists = read_columns(self.file, {*_VARIABLES, *_LISTS})
            variable = _variable_of(lists)
            lists['at'] = lists.pop(variable)
            kinds = {field.name: field.metadata['quantity'] for field in fields(self)}
            cleaned: dict[str, Any] = {
                name: kinds[name].clean(f'{label}.{name}', row) for name, row in lists.items()
            }
        except (OSError, ValueError) as error:
            raise ConfigurationError(
                f'{label}.file = {shown(self.file)}: {getattr(error, "strerror", None) or error}; '
                'give the path of a CSV file whose first line names a column of angles or '
                f'positions, {column_names(*_VARIABLES)}; and one of values, '
                f'{column_names("value")}, optionally with return_value, or '
                f'{column_names("pressure")}'
            ) from error
        over = self.over if variable == 'at' else variable
        if self.over != over and (self.over, over) != (_ANGLE, _FROM_TDC):
            raise ConfigurationError(
                f'{label}.over = {self.over!r}: must be {over}, as in {self.file}'
            )
        return replace(self, file='', over=over, **cleaned)

    def on(self, mechanism: LoadedMechanism) -> 'CurveForce':
        """See `AppliedLoad.on`.

        Raises:
            ConfigurationError: The mechanism has no such link, the curve is over position and
                the link turns fully, or a curve of a pressure or from the top of the stroke acts
                on a link without a fixed stroke.
        """
        link = mechanism.loaded_link(self.link, f'{self.label}.link')
        by_frame = self.pressure is not None
        values = self.value or self._pushes(mechanism)
        if self.over != _POSITION:
            table = Table(self._crank_angles(mechanism), values, turns=self.turns)
            return CurveForce(link, over=0, middle=None, value=Opaque(table), by_frame=by_frame)
        at, middle = self._positions(mechanism, link)
        table, back = Table(at, values), self.return_value
        return CurveForce(
            link,
            over=link,
            middle=middle,
            value=Opaque(table),
            by_frame=by_frame,
            return_value=Opaque(Table(at, back)) if back else None,
            work=None if back else Opaque(table.integral),
        )

    def _crank_angles(self, mechanism: LoadedMechanism) -> Sequence[float]:
        """Returns the directions of the crank at the points, rad.

        Raises:
            ConfigurationError: The curve starts from the top of a stroke, and there is none.
        """
        at = self.at or ()
        if self.over != _FROM_TDC:
            return at
        stroke = mechanism.stroke(f'{self.label}.over', self.link)
        (_, top), _ = stroke.ends(self.top or FAR)
        at = tuple(top + x for x in at)
        self._require_rising(at)  # rounding may make points equal
        return at

    def _positions(
        self, mechanism: LoadedMechanism, link: int
    ) -> tuple[Sequence[float], float | None]:
        """Returns the positions of the loaded link at the points, rad or m.

        Args:
            mechanism: The mechanism.
            link: Index of the loaded link.

        Returns:
            The positions; and, for a turning link, the middle of its swing, rad.

        Raises:
            ConfigurationError: The link is the crank, or slides and the points are in degrees.
        """
        at = self.at or ()
        if link == 0:
            raise ConfigurationError(
                f"{self.label}.over = 'position': must be crank_angle on {self.link}, the crank"
            )
        if mechanism.structure().links[link].slides:
            refuse_angles(f'{self.label}.at', at, f'the {self.link}')
            return at, None
        half_way = 0.5 * (at[0] + at[-1])
        middle = mechanism.swing_middle(f"{self.label}.over = 'position'", half_way)
        turns = 0 if middle is None else round((half_way - middle) / TURN)
        return tuple(angle - turns * TURN for angle in at), middle

    def _pushes(self, mechanism: LoadedMechanism) -> tuple[float, ...]:
        """Returns the forces of the pressures on the slider, N."""
        stroke = mechanism.stroke(f'{self.label}.pressure', self.link)
        (top, _), (bottom, _) = stroke.ends(self.top or FAR)
        area = math.copysign(0.25 * math.pi * (self.bore or 0.0) ** 2, bottom - top)
        behind = AMBIENT if self.ambient is None else self.ambient
        return tuple(area * (x - behind) for x in self.pressure or ())

    def valid_range(self, mechanism: LoadedMechanism) -> Range | None:
        """See `AppliedLoad.valid_range`; a single point, and a curve over the angle, have none."""
        load = self.on(mechanism)
        ends = cast('Table', load.value.function).ends
        return Range(load.link, *ends, load.middle) if ends else None


def _variable_of(lists: Collection[str]) -> str:
    """Returns the independent variable of columns.

    Raises:
        ValueError: They are not the columns of a load curve.
    """
    variables = [name for name in lists if name in _VARIABLES]
    values = sorted(name for name in lists if name not in _VARIABLES)
    if len(variables) != 1:
        raise ValueError(f'it has {len(variables)} columns of angles or positions')
    if values not in (['value'], ['return_value', 'value'], ['pressure']):
        raise ValueError(f'its columns of values are {", ".join(values) or "missing"}')
    return variables[0]


class CurveForce(NamedTuple):
    """A load curve, in the form used by formulas.

    Attributes:
        link: Index of the loaded link.
        over: Index of the link whose position is the independent variable.
        middle: Middle of the swing of that link, rad; None to use its position unchanged.
        value: The load as a function of this position.
        by_frame: Whether the frame exerts the load, as a cylinder head does.
        return_value: The load while the position decreases, or None to use `value`.
        work: The work of the load from the first point to a position; None if the work depends on
            more than the position.
    """

    link: int
    over: int
    middle: Real
    value: Opaque
    by_frame: bool = False
    return_value: Opaque | None = None
    work: Opaque | None = None

    def wrenches(self, links: Sequence[LinkPose], rates: Sequence[Real]) -> list[Wrench]:
        """See `Load`."""
        position = continuous(links[self.over].position, self.middle)
        force = self.value(position)
        if self.return_value is not None:
            force = where(rates[self.link] >= 0, force, self.return_value(position))
        return [Wrench(self.link, force, by_frame=force if self.by_frame else ZERO)]

    def potential(self, links: Sequence[LinkPose]) -> Real:
        """See `Load`."""
        if self.work is None:
            return ZERO
        return -self.work(continuous(links[self.over].position, self.middle))

    def piece(self, links: Sequence[LinkPose], rates: Sequence[Real]) -> Real:
        """Numbers the lines between points, separately for each direction; see `Load`."""
        position = continuous(links[self.over].position, self.middle)
        line = cast('Table', self.value.function).line(position)
        return 2 * line + (rates[self.over] >= 0)
