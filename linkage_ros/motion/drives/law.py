# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A crank, cylinder or slider that follows a law of motion."""

import functools
import math
from collections.abc import Container, Sequence
from dataclasses import dataclass, fields
from fractions import Fraction
from itertools import pairwise
from typing import Any

from linkage_ros.columns import column_names, read_columns
from linkage_ros.errors import ConfigurationError
from linkage_ros.mechanism.base import Mechanism
from linkage_ros.mechanism.solver import Solver
from linkage_ros.mechanism.structure import Link
from linkage_ros.messages.topics import CRANK_TRAJECTORY, Topic
from linkage_ros.motion.along_law import LawMotion, LawSegment, require_possible
from linkage_ros.motion.drives.base import Machine
from linkage_ros.motion.drives.crank_trajectories import CrankTrajectories
from linkage_ros.motion.drives.feed_forward import TrajectoryFeedForward
from linkage_ros.motion.inputs import Input
from linkage_ros.motion.law import Law, Sine
from linkage_ros.motion.spline import interpolated
from linkage_ros.quantities import Checked, quantity, refuse_angles, shown
from linkage_ros.units import NS_PER_S, place_words

_ANGLES, _SPEEDS, _ACCELERATIONS = (-1e6, 1e6), (-1e9, 1e9), (-1e12, 1e12)
# Lists by the quantities of columns.
_LIST_OF = {
    'time': 'times', 'angle': 'angles', 'position': 'positions', 'speed': 'speeds',
    'acceleration': 'accelerations',
}  # fmt: skip
_OF_SINE, _OF_POINTS = {'center', 'amplitude', 'frequency', 'phase'}, {'spline', 'repeat'}
_MOST_POINTS = 10_000  # whose spline in 50 digits takes a second or two
_ROUNDING = 8 * math.ulp(math.tau)  # relative tolerance of whole turns


@dataclass(frozen=True)
class Prescribed(Checked):
    """A law of motion: points, a CSV file with points, or a sine.

    The file is read on creation, after which that field is empty.
    """

    times: tuple[float, ...] | None = quantity(
        'list', 'times of the points, increasing from 0', 's', span=(0.0, 1e9), default=None
    )
    angles: tuple[float, ...] | None = quantity(
        'list', 'crank angles at the points', 'rad', span=_ANGLES, default=None
    )
    positions: tuple[float, ...] | None = quantity(
        'list', 'positions of a driven cylinder or slider at the points, instead of angles', 'm',
        span=_ANGLES, default=None,
    )  # fmt: skip
    speeds: tuple[float, ...] | None = quantity(
        'list', 'speeds at the points; empty: a spline', 'rad/s or m/s', span=_SPEEDS,
        default=None,
    )  # fmt: skip
    accelerations: tuple[float, ...] | None = quantity(
        'list', 'accelerations at the points; only with speeds', 'rad/s^2 or m/s^2',
        span=_ACCELERATIONS, default=None,
    )  # fmt: skip
    file: str = quantity(
        'text', 'CSV file with the columns time, angle or position, and optionally speed and '
        'acceleration, used instead of these lists; _deg after a name: degrees; position_mm: mm',
        default='',
    )  # fmt: skip
    spline: str = quantity(
        'choice', 'degree of the spline through the points; straight lines would need infinite '
        'accelerations', choices=('quintic', 'cubic'), default='quintic',
    )  # fmt: skip
    repeat: bool = quantity(
        'switch', 'repeat the points; the last angle equals the first, or is whole turns from it',
        default=False,
    )  # fmt: skip
    center: float = quantity('number', 'middle of a sine', 'rad or m', span=_ANGLES, default=0.0)
    amplitude: float | None = quantity(
        'number', 'amplitude of a sine, used instead of points', 'rad or m', span=_ANGLES,
        default=None,
    )  # fmt: skip
    frequency: float | None = quantity(
        'number', 'frequency of the sine', 'Hz', span=(1e-9, 1e6), default=None
    )
    phase: float = quantity(
        'number', 'phase of the sine at t = 0', 'rad', span=_ANGLES, default=0.0
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.file:
            self._read()
        is_sine = self.amplitude is not None and self.frequency is not None
        lists = [name for name in _LIST_OF.values() if getattr(self, name) is not None]
        has_points = 'times' in lists and ('angles' in lists) != ('positions' in lists)
        is_complete = not lists if is_sine else has_points
        if not is_complete:
            raise ConfigurationError(
                'motion: give times and angles, or file, or amplitude and frequency; for a '
                'cylinder or slider, positions instead of angles'
            )
        if is_sine:
            self._require_default(_OF_POINTS, 'points, not for a sine')
        else:
            self._require_default(_OF_SINE, 'a sine, not for points')
        if 'accelerations' in lists and 'speeds' not in lists:
            raise ConfigurationError('motion.accelerations: give motion.speeds as well')
        if lists:
            self._check_points(lists)
        _ = self.law  # rejects points without a law

    def _require_default(self, names: Container[str], purpose: str) -> None:
        """Rejects parameters that are for another kind of law.

        Raises:
            ConfigurationError: There is one.
        """
        for field in fields(self):
            value = getattr(self, field.name)
            if field.name in names and value != field.default:
                raise ConfigurationError(
                    f'motion.{field.name} = {shown(value)}: leave it out, because it is for '
                    f'{purpose}'
                )

    def _check_points(self, lists: Sequence[str]) -> None:
        times: Any = self.times
        if len(times) > _MOST_POINTS:
            raise ConfigurationError(
                f'motion.times has {len(times)} points: give at most {_MOST_POINTS}'
            )
        for name in lists:
            row = getattr(self, name)
            if len(row) != len(times):
                raise ConfigurationError(
                    f'motion.{name} has {len(row)} numbers and motion.times {len(times)}: give '
                    'one for each point'
                )
            if name in {'speeds', 'accelerations'}:
                self._check_rates(name, row)
        _check_times(times)
        if self.repeat:
            self._check_repetition()

    def _check_rates(self, name: str, row: Sequence[float]) -> None:
        """Checks speeds or accelerations at the points.

        Raises:
            ConfigurationError: They do not fit.
        """
        if len(row) == 1 and row[0]:
            raise ConfigurationError(
                f'motion.{name} is {row[0]:g} at the only point: give two points or more'
            )
        if self.repeat and row[0] != row[-1]:
            raise ConfigurationError(
                f'motion.{name} ends with {row[-1]:g}: must equal the first, {row[0]:g}, to '
                'repeat without a jump'
            )

    def _check_repetition(self) -> None:
        if len(self.times or ()) == 1:
            raise ConfigurationError('motion.repeat: give two points or more')
        places: Any = self.places
        advance = places[-1] - places[0]
        if self.positions is not None and advance:
            raise ConfigurationError(
                f'motion.positions ends {advance!r} m after its start: must end there, to repeat '
                'without a jump'
            )
        gap = math.remainder(advance, math.tau)
        ulp = math.ulp(max(abs(places[0]), abs(places[-1])))  # each angle was rounded
        if abs(gap) > _ROUNDING * max(1.0, abs(advance)) + 4 * ulp:
            raise ConfigurationError(
                f'motion.angles ends {advance!r} rad after its start: must be 0, or whole turns '
                f'of {math.tau!r}, to repeat without a jump'
            )

    def _read(self) -> None:
        lists = _LIST_OF.values()
        if any(getattr(self, name) is not None for name in lists):
            raise ConfigurationError(
                f'motion.file = {shown(self.file)}: leave out {", ".join(lists)}, which the file '
                'contains'
            )
        kinds = {field.name: field.metadata['quantity'] for field in fields(self)}
        for name, row in _columns(self.file).items():
            object.__setattr__(self, name, kinds[name].clean(f'motion.{name}', row))
        object.__setattr__(self, 'file', '')

    @property
    def places(self) -> tuple[float, ...] | None:
        """The angles, rad, or positions, m, at the points; None for a sine."""
        return self.angles if self.positions is None else self.positions

    @functools.cached_property
    def law(self) -> Law:
        """The law, in the form for a crank."""
        if self.amplitude is not None and self.frequency is not None:
            center, amplitude = float(self.center), float(self.amplitude)
            return Sine(center, amplitude, self.frequency, self.phase)
        times, places = self.times or (), self.places or ()
        rows = [row for row in (self.speeds, self.accelerations) if row is not None]
        slopes = [*zip(*rows, strict=True)] if rows else None
        return interpolated(
            _nanoseconds(times), places, slopes, cubic=self.spline == 'cubic', repeat=self.repeat
        )


def _nanoseconds(times: Sequence[float]) -> list[int]:
    """Rounds times, s, to ns."""
    return [round(Fraction(time) * NS_PER_S) for time in times]


def _check_times(times: Sequence[float]) -> None:
    """Checks that the times of points begin at 0 and increase.

    Raises:
        ConfigurationError: They do not.
    """
    stamps = _nanoseconds(times)
    if stamps[0]:
        raise ConfigurationError(f'motion.times begins with {times[0]:g}: must be 0.0')
    for i, (before, after) in enumerate(pairwise(stamps), 2):
        if not before < after:
            raise ConfigurationError(
                f'motion.times must increase by 1 ns or more: number {i}, {times[i - 1]!r}, '
                f'follows {times[i - 2]!r}'
            )


def _columns(path: str) -> dict[str, list[float]]:
    """Reads the points of a law from a CSV file, by the names of their parameters.

    Raises:
        ConfigurationError: The file cannot be read, or a name or a number is not valid.
    """
    try:
        columns = read_columns(path, _LIST_OF)
    except (OSError, ValueError) as error:
        raise ConfigurationError(
            f'motion.file = {shown(path)}: {getattr(error, "strerror", None) or error}; give the '
            f'path of a CSV file with the columns {column_names("time")}, one of '
            f'{column_names("angle", "position")}, and optionally one of {column_names("speed")}, '
            f'and one of {column_names("acceleration")}'
        ) from error
    return {_LIST_OF[quantity]: row for quantity, row in columns.items()}


@dataclass(frozen=True)
class LawDrive(TrajectoryFeedForward):
    """A crank, cylinder or slider that follows a law of motion."""

    segment, subject = LawSegment, '{} along a motion'

    motion: Prescribed

    @property
    def crank_angle(self) -> float:
        """The crank angle at t = 0, rad, or the position of a slide, m."""
        return self.motion.law.at(0).angle

    def law(self, joint: Link) -> Law:
        """Returns the law of a driven joint."""
        return self.motion.law._replace(slides=joint.slides)

    def words(self, joint: Link) -> str:
        """Describes the law."""
        return self.law(joint).words

    def check(self, mechanism: Mechanism) -> None:
        """Checks that the driven joint can follow the law.

        Raises:
            ConfigurationError: The check failed; the message states the reason.
        """
        solver = Solver(mechanism)
        joint = solver.structure.driven_link
        wrong, right = ('angles', 'positions') if joint.slides else ('positions', 'angles')
        if getattr(self.motion, wrong) is not None:
            raise ConfigurationError(
                f'motion.{wrong}: must be motion.{right}, because the {joint.name} is driven'
            )
        if joint.slides:
            for name in ('center', 'amplitude'):
                refuse_angles(f'motion.{name}', getattr(self.motion, name), f'the {joint.name}')
        try:
            require_possible(self.law(joint), solver)
        except ConfigurationError as error:
            drawn = ''
            if mechanism.drawn:
                place = place_words(mechanism.drawn.position, joint.units)
                drawn = f'; as drawn, {joint.name} is at {place}'
            raise ConfigurationError(f'motion: {error}{drawn}') from error

    def begin(self, stamp: int, machine: Machine) -> LawMotion:
        """Starts the motion; see `Drive.begin`."""
        return LawMotion.begin(self.law(machine.solver.structure.driven_link), stamp)

    def inputs(self, machine: Machine) -> dict[Topic, Input]:
        """Receives trajectories; see `Drive.inputs`."""
        return {CRANK_TRAJECTORY: CrankTrajectories(machine, self.begin(0, machine))}
