# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Laws of motion: the position of the driven joint over time, with its first two derivatives.

Times are integers, ns, and whole turns are counted, so that a repeating law stays exact at all
times.
"""

import functools
import json
import math
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from fractions import Fraction
from itertools import chain, pairwise
from typing import NamedTuple, TypeAlias

import numpy as np

from linkage_ros.numeric import TURN
from linkage_ros.quantities import counted
from linkage_ros.units import NS_PER_S

# Angles of a sine are integers in units of 2^-_BITS turn.
_BITS = 128
# Coefficients of x^2, x^4, ... in sin(x) / x - 1 and cos(x) - 1, the last ones first.
_SINES, _COSINES = (
    [(-1) ** n / math.factorial(2 * n + more) for n in range(9, 0, -1)] for more in (1, 0)
)


@functools.lru_cache(maxsize=16)
def _in_turns(angle: float) -> int:
    """Converts an angle, rad, to units of 2^-_BITS turn."""
    return round(Fraction(angle) / TURN * (1 << _BITS))


def _direction(angle: int) -> tuple[float, float]:
    """Computes sine and cosine to two ulp, by arithmetic that is equal on all processors.

    The angle is in units of 2^-_BITS turn.
    """
    quarter_turn = 1 << _BITS - 2
    quarters = (angle + quarter_turn // 2) // quarter_turn
    x = math.ldexp(2 * math.pi * float(angle - quarters * quarter_turn), -_BITS)
    # Horner's method for sin(x) / x - 1 and cos(x) - 1, divided by x^2.
    square, sine, cosine = x * x, 0.0, 0.0
    for of_sine, of_cosine in zip(_SINES, _COSINES, strict=True):
        sine = sine * square + of_sine
        cosine = cosine * square + of_cosine
    sine, cosine = x + x * (square * sine), 1.0 + square * cosine
    if quarters & 1:
        sine, cosine = cosine, -sine
    return (-sine, -cosine) if quarters & 2 else (sine, cosine)


class Moment(NamedTuple):
    """The motion of the driven joint at a time; a sliding joint's values are in m instead of rad.

    Attributes:
        turns: Whole turns to add to the angle.
        angle: Angle without these turns, rad.
        rate: Rate, rad/s.
        acceleration: Acceleration, rad/s^2.
    """

    turns: int
    angle: float
    rate: float
    acceleration: float


class Sine(NamedTuple):
    """A harmonic law: center + amplitude sin(2 pi frequency t + phase).

    Attributes:
        center: Middle of the swing, rad.
        amplitude: Amplitude, rad.
        frequency: Frequency, Hz.
        phase: Phase at t = 0, rad.
        slides: Whether it is the law of a sliding joint, whose center and amplitude are in m.
    """

    center: float
    amplitude: float
    frequency: float
    phase: float
    slides: bool = False

    @property
    def duration(self) -> int:
        """The period, ns, rounded."""
        return round(NS_PER_S / Fraction(self.frequency))

    @property
    def end(self) -> int | None:
        """The time at which the law ends, ns; always None."""
        return None

    @property
    def repeats(self) -> bool:
        """Whether the motion repeats; always True."""
        return True

    @property
    def turns(self) -> int:
        """Whole turns by which the crank advances in a period; always 0."""
        return 0

    @property
    def words(self) -> str:
        """Describes the law; angles in degrees."""
        unit, scale = ('m', 1.0) if self.slides else ('deg', math.degrees(1.0))
        center, amplitude = self.center * scale, self.amplitude * scale
        return f'{center:g} {unit} with amplitude {amplitude:g} {unit} at {self.frequency:g} Hz'

    def at(self, time: int) -> Moment:
        """Returns the motion of the crank at a time, ns."""
        numerator, denominator = self.frequency.as_integer_ratio()
        turned = (numerator * time << _BITS) // (denominator * NS_PER_S)
        sine, cosine = _direction(turned + _in_turns(self.phase))
        speed = 2 * math.pi * self.frequency
        swing, slope = self.amplitude * sine, self.amplitude * cosine
        return Moment(0, self.center + swing, slope * speed, -swing * speed * speed)

    @property
    def largest(self) -> tuple[float, float, float]:
        """Upper bounds of the magnitudes of angle, rad, rate, rad/s, and acceleration, rad/s^2."""
        speed, swing = 2 * math.pi * self.frequency, abs(self.amplitude)
        return abs(self.center) + swing, swing * speed, swing * speed * speed

    def extremes(self, *_: float) -> list[int]:
        """Returns times that include those of the extreme angles, ns; see `Spline.extremes`."""
        quarter, phase = Fraction(1, 4), Fraction(self.phase) / TURN
        shares = [(quarter * n - phase) % 1 for n in (1, 3)]
        return [0, *(round(share / Fraction(self.frequency) * NS_PER_S) for share in shares)]

    def __str__(self) -> str:
        return _text(self)


class Spline(NamedTuple):
    """A law of polynomials, from t = 0.

    Attributes:
        times: Times of the points, ns, increasing from 0.
        rows: Coefficients of the polynomials that begin at the points, in rad/s^n, in powers of
            the time since that point. If the crank rests at the end, the last polynomial is its
            angle there. Without it, the law repeats, or the motion ends at the last point.
        turns: Whole turns by which the crank advances each time that the law repeats; None if it
            does not repeat.
        slides: Whether it is the law of a sliding joint, whose coefficients are in m/s^n.
    """

    times: tuple[int, ...]
    rows: tuple[tuple[float, ...], ...]
    turns: int | None = None
    slides: bool = False

    @property
    def duration(self) -> int:
        """The time of the last point, ns."""
        return self.times[-1]

    @property
    def end(self) -> int | None:
        """The time at which the motion ends, ns; None if it repeats, or the crank rests."""
        return None if self.repeats or len(self.rows) == len(self.times) else self.times[-1]

    @property
    def repeats(self) -> bool:
        """Whether the motion repeats."""
        return self.turns is not None

    @property
    def words(self) -> str:
        """Describes the law."""
        words = f'{counted(len(self.times), "point")} in {self.duration / NS_PER_S:g} s'
        if self.turns is None:
            return words
        return f'{words}, repeated' + (
            f' with {counted(self.turns, "turn")}' if self.turns else ''
        )

    def at(self, time: int) -> Moment:
        """Returns the motion of the crank at a time, ns, which is not after the end."""
        turns = 0
        if self.turns is not None:
            periods, time = divmod(time, self.times[-1])
            turns = periods * self.turns
        i = min(bisect_right(self.times, time), len(self.rows)) - 1
        seconds = (time - self.times[i]) / NS_PER_S
        # Horner's method for the polynomial, its rate, and half its second derivative, `bend`.
        angle = rate = bend = 0.0
        for factor in reversed(self.rows[i]):
            bend = bend * seconds + rate
            rate = rate * seconds + angle
            angle = angle * seconds + factor
        return Moment(turns, angle, rate, 2 * bend)

    @property
    def largest(self) -> tuple[float, float, float]:
        """Upper bounds of the magnitudes of angle, rad, rate, rad/s, and acceleration, rad/s^2."""
        bounds = [(abs(row[0]), 0.0, 0.0) for row in self.rows]
        for row, length in self._pieces():
            of_angle = [abs(factor) for factor in row]
            of_rate, of_acceleration = _derivative(of_angle), _derivative(_derivative(of_angle))
            bounds.append(
                (
                    _value(of_angle, length),
                    _value(of_rate, length),
                    _value(of_acceleration, length),
                )
            )
        angle, rate, acceleration = map(max, zip(*bounds, strict=True))
        return angle, rate, acceleration

    def _pieces(self) -> Iterator[tuple[tuple[float, ...], float]]:
        """Yields the coefficients of each polynomial between two points, and its length, s."""
        for row, (start, end) in zip(self.rows, pairwise(self.times), strict=False):
            yield row, (end - start) / NS_PER_S

    def extremes(self, low: float, high: float) -> list[int]:
        """Finds times that include those of the largest and smallest angle, if these matter.

        Args:
            low: Lower end of the range in which angles do not matter, rad.
            high: Upper end of this range.

        Returns:
            The times, ns, rounded.
        """
        times = [*self.times]
        for start, (row, length) in zip(self.times, self._pieces(), strict=False):
            farthest = sum(abs(x) * length**n for n, x in enumerate(row[1:], 1))
            if low < row[0] - farthest and row[0] + farthest < high:
                continue
            highest_first = _derivative(row)[::-1]
            roots: list[float] = np.roots(highest_first).real.tolist()
            times += [start + round(x * NS_PER_S) for x in roots if 0 < x < length]
        return times

    def __str__(self) -> str:
        return _text(self)


def _derivative(factors: Sequence[float]) -> list[float]:
    """Returns the coefficients of the derivative of a polynomial, the constant first."""
    return [n * factor for n, factor in enumerate(factors)][1:]


def _value(factors: Sequence[float], x: float) -> float:
    """Returns the value of a polynomial whose first coefficient is the constant."""
    return sum(factor * x**n for n, factor in enumerate(factors))


Law: TypeAlias = Sine | Spline


def _text(law: Law) -> str:
    """Returns a law as JSON; `parse_law` inverts it."""
    return json.dumps({k: v for k, v in law._asdict().items() if k != 'slides' or v})


def parse_law(text: str) -> Law:
    """Parses the output of `str(law)`, bit for bit; it may come from an untrusted file.

    Raises:
        ValueError: The text is not a law. Malformed text may raise other exceptions.
    """
    fields = json.loads(text)
    slides = bool(fields.pop('slides', False))
    if 'frequency' in fields:
        law = Sine(**{name: float(value) for name, value in fields.items()}, slides=slides)
        if not law.frequency > 0:
            raise ValueError(f'frequency = {law.frequency}: must be above 0')
        return law
    times = tuple(map(int, fields['times']))
    rows = tuple(tuple(map(float, row)) for row in fields['rows'])
    turns = None if fields['turns'] is None else int(fields['turns'])
    begins_at_0 = not times[0]
    increases = all(before < after for before, after in pairwise(times))
    has_row_at_end = len(rows) == len(times)
    has_rows = has_row_at_end or len(rows) == len(times) - 1
    repeats_fully = turns is None or not has_row_at_end
    if not (begins_at_0 and increases and has_rows and repeats_fully):
        raise ValueError('not a spline: its points and polynomials do not match')
    if not all(rows) or not all(map(math.isfinite, chain(*rows))):
        raise ValueError('not a spline: a polynomial is empty or not finite')
    return Spline(times, rows, turns, slides)
