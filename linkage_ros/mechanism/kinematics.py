# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Kinematic results: pose at given coordinates, state, and reach of the crank."""

import functools
import math
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple, NoReturn, Protocol, TypeAlias, overload

import numpy as np

from linkage_ros.errors import ConfigurationError, MechanismError, UnreachableError
from linkage_ros.formulas import ZERO, Vector, turned
from linkage_ros.mechanism.conditions import OWN_CONDITIONS, Conditions
from linkage_ros.numeric import Array, Real
from linkage_ros.quantities import shown
from linkage_ros.units import SLIDING, TURNING, place_words

Arc: TypeAlias = tuple[float, float]

_PER_DECADE = 48  # samples per decade of the distance from a crank angle with fast motion
FULL_TURN: tuple[Arc, ...] = ((0.0, 2 * math.pi),)


class LinkPose(NamedTuple):
    """The position of a link, and its derivatives with respect to the coordinates.

    Attributes:
        position: Direction from the first to the second pin, rad, in [-pi, pi] except for the
            crank; for a sliding link, its position along the guide, m.
        direction: Unit vector of the link; for a sliding link, unit vector of its guide.
        jacobian: Derivatives of the position with respect to the coordinates; ZERO if a
            coordinate does not move the link.
        curvature: Coefficients of u1^2 and, with two coordinates, of u1 u2 and u2^2 in the
            link's acceleration, where u are the rates of the coordinates; ZERO if a term
            vanishes.
    """

    position: Real
    direction: Vector
    jacobian: tuple[Real, ...]
    curvature: tuple[Real, ...]


class Pose(NamedTuple):
    """The positions of all links at given coordinates.

    Attributes:
        links: The pose of each moving link.
        sines: For each dyad, the sine of the angle from its first to its second link or, for a
            slider, to the normal of its guide; accurate to a few ulp even near 0.
    """

    links: tuple[LinkPose, ...]
    sines: tuple[Real, ...]


class Loop(Protocol):
    """Interface of a mechanism's kinematic constants: a named tuple of floats and `Opaque`s."""

    def pose(self, q: tuple[Real, ...]) -> Pose:
        """Computes the exact pose at the coordinates `q`; rejects unreachable coordinates."""


def directions(
    apart: Vector, square: Real, root: Real, first: float, second: float
) -> tuple[Vector, Vector]:
    """Computes the directions of a dyad's links along the path from its first to its last pin.

    Args:
        apart: Vector from the first link's outer pin to that of the second link, m.
        square: Square of the length of `apart`, m^2.
        root: Square root of (stretched length^2 - square) (square - folded length^2), m^2. It is
            positive if the common pin lies to the left of `apart`.
        first: Length of the first link, m.
        second: Length of the second link, m.

    Returns:
        The unit vectors of the two links. The sine of the angle from the first to the second is
        -root / (2 first second).
    """
    moment, scale = (first - second) * (first + second), 0.5 / square
    # Cosine and sine of the angle from `apart` to the first link and, clockwise, to the second,
    # divided by the length of `apart`.
    cos_first, cos_second = (
        scale * (square + moment) / first,
        scale * (square - moment) / second,
    )
    sin_first, sin_second = scale * root / first, scale * root / second
    second_direction = Vector(
        apart.x * cos_second + apart.y * sin_second, apart.y * cos_second - apart.x * sin_second
    )
    return turned(apart, cos_first, sin_first), second_direction


def bends(
    lengths: tuple[Real, Real],
    over: tuple[Real, Real],
    cosine: Real,
    squares: tuple[Real, Real],
    ends: tuple[Real, Real] = (ZERO, ZERO),
) -> tuple[Real, Real]:
    """Computes the angular accelerations of a dyad's links, or coefficients in them.

    Args:
        lengths: Lengths of the links, m.
        over: 2 x (length of the other link) / root for each link, 1/m; see `directions`.
        cosine: Cosine of the angle between the links' directions.
        squares: Squared rate of each link, or coefficients of a product of rates in it.
        ends: Components, along the second and the first link, of the acceleration of the second
            end relative to the first.

    Returns:
        The values for both links.
    """
    (b, c), (over_b, over_c) = lengths, over
    phi_phi, psi_psi = squares
    along_second, along_first = ends
    return (
        -over_b * (along_second + b * cosine * phi_phi + c * psi_psi),
        over_c * (along_first + b * phi_phi + c * cosine * psi_psi),
    )


class Stroke(NamedTuple):
    """The ends of a slider's stroke while the crank turns fully.

    Attributes:
        far: Position at the end that is farther from the crank pivot, m, and the crank angle
            there, rad.
        near: The same at the other end.
    """

    far: tuple[float, float]
    near: tuple[float, float]

    def ends(self, top: str) -> tuple[tuple[float, float], tuple[float, float]]:
        """Returns top and bottom; the top is the end `top`, 'far' or 'near'."""
        return (self.far, self.near) if top == 'far' else (self.near, self.far)


class Reach(NamedTuple):
    """The reach of the crank of a mechanism with one degree of freedom.

    Attributes:
        grashof: Grashof class, such as 'crank-rocker' or 'change-point'; see the mechanism.
        arcs: Reachable arcs of the crank angle as pairs (start, end), rad, with start in
            [0, 2 pi); a whole turn if the crank turns fully. If `slides`, positions of the driven
            link, m.
        period_turns: Number of crank turns after which the motion repeats; 0 if `slides`.
        transmission: Smallest and largest transmission angle, rad in [0, pi]; links are collinear
            at 0 and pi. None if the mechanism has no transmission angle.
        limits: Reasons why the crank cannot turn fully; empty if it can.
        cures: Alternative changes that would let the crank turn fully; empty if it already does.
        equalities: Descriptions of sums of lengths that are treated as 0 although their binary
            values differ from 0.
        near_equalities: Descriptions of sums of lengths that are nearly 0, within 1e-4 of the
            longest length, but count as other than 0.
        fast: Crank angle, rad. Near this angle and half a turn away, the output may move fast.
        width: Half-width of these two regions, rad; inf if there are none.
        driven: What is driven: 'crank', 'cylinder' or 'slider'.
        name: Name of the driven link in a drawing; empty without one.
        drawn: Crank angle in a drawing, rad, in whose turn messages state the arcs; None without.
    """

    grashof: str
    arcs: tuple[Arc, ...] = FULL_TURN
    period_turns: int = 1
    transmission: Arc | None = None
    limits: tuple[str, ...] = ()
    cures: tuple[str, ...] = ()
    equalities: tuple[str, ...] = ()
    near_equalities: tuple[str, ...] = ()
    fast: float = 0.0
    width: float = math.inf
    driven: str = 'crank'
    name: str = ''
    drawn: float | None = None

    @property
    def subject(self) -> str:
        """Name of the driven link for a sentence."""
        return self.name or f'the {self.driven}'

    def renamed(self, name: str, words: Callable[[str], str], drawn: float) -> 'Reach':
        """Returns the reach in the terms of a drawing.

        Args:
            name: Name of the driven link.
            words: Function that returns a reason with the names of the links.
            drawn: Crank angle in the drawing, rad.
        """
        return self._replace(
            name=name, drawn=drawn,
            limits=tuple(map(words, self.limits)), cures=tuple(map(words, self.cures)),
            equalities=tuple(map(words, self.equalities)),
            near_equalities=tuple(map(words, self.near_equalities)),
        )  # fmt: skip

    @property
    def shown_arcs(self) -> tuple[Arc, ...]:
        """The arcs for messages, rad or m: those of a drawing in the turn where it is drawn."""
        if self.drawn is None or self.slides or self.turns_fully:
            return self.arcs
        period = math.tau * self.period_turns
        middles = (0.5 * (low + high) for low, high in self.arcs)
        shifts = [period * round((self.drawn - middle) / period) for middle in middles]
        arcs = zip(self.arcs, shifts, strict=True)
        return tuple((low + shift, high + shift) for (low, high), shift in arcs)

    def period_with(self, loads: Iterable[Any] = (), law_turns: int = 1) -> int:
        """Computes the number of crank turns after which motion, loads and law repeat together.

        Args:
            loads: Loads, each with its own period.
            law_turns: Crank turns of one repetition of the law, negative if backwards; 1 for a
                constant speed.

        Returns:
            The number of turns. It is 0 if the driven link slides, and if the law returns the
            crank to its start without a whole turn, where motion and loads are as they were.
        """
        if self.slides:
            return 0
        return math.lcm(self.period_turns, law_turns, *(load.turns for load in loads))

    @property
    def slides(self) -> bool:
        """Whether the driven link slides, so that its position replaces the crank angle."""
        return self.driven != 'crank'

    @property
    def turns_fully(self) -> bool:
        """Whether the crank can turn through every angle."""
        return not self.limits

    @property
    def has_change_point(self) -> bool:
        """Whether all links become collinear during a full turn."""
        low, high = self.transmission or (1.0, 1.0)
        return self.turns_fully and (low == 0 or high == math.pi)

    def require_full_turn(self, otherwise: str = '') -> None:
        """Rejects a mechanism whose crank cannot turn fully; adds another remedy to the message.

        Raises:
            MechanismError: The crank is limited. The message states class, causes and arcs.
        """
        if self.slides:
            raise MechanismError(
                f'{self.subject} is driven, and its stroke has ends: this is for a crank that '
                f'turns fully{otherwise}'
            )
        if not self.turns_fully:
            cures = f'; {" or ".join(self.cures)}' * bool(self.cures)
            raise MechanismError(self._refusal('turn fully', cures) + otherwise)

    def refuse(self, crank: float) -> NoReturn:
        """Rejects a crank angle, rad or m, at which no state exists or the rates are infinite.

        Raises:
            UnreachableError: Always. The message states class, causes and reachable arcs.
        """
        purpose = f'move at {place_words(crank, SLIDING if self.slides else TURNING)}'
        raise UnreachableError(self._refusal(purpose), crank_angle=crank, arcs=self.arcs)

    def _refusal(self, purpose: str, cures: str = '') -> str:
        arcs = ' and '.join(self._arc_words(*arc) for arc in self.shown_arcs)
        return (
            f'{self.subject} of this {self.grashof} linkage cannot {purpose}: '
            f'{"; ".join(self.limits)}{cures}; it reaches {arcs}'
        )

    def _arc_words(self, start: float, end: float) -> str:
        if self.slides:
            return f'{start:.9g} to {end:.9g} m'
        degrees = f'{math.degrees(start):.6g} to {math.degrees(end):.6g} deg'
        return f'{start:.6g} to {end:.6g} rad = {degrees}'

    def arc_around(self, place: float) -> Arc:
        """Returns the arc that contains a place of the driven joint, rad or m, or the nearest one.

        The arc of a crank is in the turn where the angle is.
        """
        if self.slides:
            return min(self.arcs, key=lambda arc: _distance_to_arc(place, arc, math.inf))
        turns = range(max(1, self.period_turns))
        period = math.tau * len(turns)
        shifts = [math.tau * i for i in turns]
        arcs = [(low + shift, high + shift) for shift in shifts for low, high in self.arcs]
        low, high = min(arcs, key=lambda arc: _distance_to_arc(place, arc, period))
        shift = period * round((place - 0.5 * (low + high)) / period)
        return low + shift, high + shift

    def samples(self, steps_per_turn: int = 720) -> Array:
        """Returns crank angles over one period, with steps small enough to resolve the motion.

        Where the output moves fast, finer steps are added, much smaller than `width`. The angles
        increase from 0 to 2 pi or 4 pi, rad.
        """
        turns = self.period_turns
        even = _even_angles(turns, steps_per_turn)
        half_step = math.pi / steps_per_turn
        if self.width > 20 * half_step:
            return even
        # Geometric steps on both sides of each region with fast motion.
        nearest, farthest = self.width * 0.01, half_step * 40
        decades = math.log10(farthest / self.width) + 2
        distances = np.geomspace(nearest, farthest, math.ceil(decades * _PER_DECADE))
        around = np.concatenate([-distances[::-1], [0.0], distances])
        centers = [self.fast % math.pi + math.pi * i for i in range(-1, 2 * turns + 1)]
        angles = np.concatenate([even, *(center + around for center in centers)])
        is_within = (angles >= 0) & (angles <= even[-1])
        return np.asarray(np.unique(angles[is_within]))


def _distance_to_arc(place: float, arc: Arc, period: float) -> float:
    """Returns how far a place is outside an arc that repeats after a period; 0 inside."""
    low, high = arc
    from_middle = math.remainder(place - 0.5 * (low + high), period)
    return max(0.0, abs(from_middle) - 0.5 * (high - low))


@functools.lru_cache(maxsize=16)
def _even_angles(turns: int, steps_per_turn: int) -> Array:
    """Returns crank angles of equal steps, rad; read-only, because they are shared."""
    even = np.linspace(0, turns * math.tau, turns * steps_per_turn + 1)
    even.flags.writeable = False
    return even


# The first four fields of a `State`.
Rows: TypeAlias = tuple[tuple[Real, ...], tuple[Real, ...], tuple[Real, ...], Real]


class LinkMotion(NamedTuple):
    """The motion of one link, as in `State`.

    Attributes:
        position: Direction, rad, or position along the guide, m.
        velocity: Angular velocity, rad/s, or velocity, m/s.
        acceleration: Angular acceleration, rad/s^2, or acceleration, m/s^2.
    """

    position: Real
    velocity: Real
    acceleration: Real


class State(NamedTuple):
    """The motion of a mechanism at one crank angle or at an array of crank angles.

    The order of the links is that of `links`: crank, coupler, and rocker or slider; crank, barrel
    and rod of a cylinder; crank, coupler, rod and slider of a wind pump; then dyads. The motion of
    one link is `state['rocker']`. States are equal if motion and torque are. A state prints as a
    table of its links, with six digits; arrays, as their ranges.

    Attributes:
        position: Directions of the links from first to second pin, rad, in [-pi, pi] except for
            the crank, whose angle is as given; for a slider, its position on the guide, m.
        velocity: Angular velocities of the links, rad/s; for a slider, its velocity, m/s.
        acceleration: Angular accelerations of the links, rad/s^2; for a slider, its
            acceleration, m/s^2.
        torque: Driving torque on the crank, N m, positive counter-clockwise; force on a driven
            slider or rod, N, along its guide: it lengthens a cylinder if positive.
        conditions: The conditions under which the state was computed.
        links: Names of the links.
    """

    position: tuple[Real, ...]
    velocity: tuple[Real, ...]
    acceleration: tuple[Real, ...]
    torque: Real
    conditions: Conditions = OWN_CONDITIONS
    links: tuple[str, ...] = ()

    @overload
    def __getitem__(self, key: str) -> LinkMotion: ...

    @overload
    def __getitem__(self, key: Any) -> Any: ...

    def __getitem__(self, key: Any) -> Any:
        """Returns the motion of a link by its name, or fields by index.

        Raises:
            ConfigurationError: The mechanism has no such link.
        """
        if not isinstance(key, str):
            return tuple.__getitem__(self, key)
        if key not in self.links:
            raise ConfigurationError(f'link {shown(key)}: must be one of {", ".join(self.links)}')
        i = self.links.index(key)
        return LinkMotion(self.position[i], self.velocity[i], self.acceleration[i])

    def __eq__(self, other: object) -> bool:
        return isinstance(other, State) and self[:4] == other[:4]

    def __ne__(self, other: object) -> bool:
        return not self == other

    def __hash__(self) -> int:
        return hash(self[:4])

    def __repr__(self) -> str:
        if not all(isinstance(row, tuple) for row in self[:3]):  # not from a solver
            return f'State{tuple(self)!r}'
        names = map(str, self.links or range(len(self.position)))
        columns = [map(_digits, row) for row in self[:3]]
        rows = [
            ('', *LinkMotion._fields),
            *zip(names, *columns, strict=False),
            ('torque', _digits(self.torque), '', ''),
        ]
        widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
        lines = ('  '.join(map(str.ljust, row, widths)).rstrip() for row in rows)
        return '\n'.join(('State (SI units)', *lines))


def _digits(values: object) -> str:
    """Writes a number with six digits, or the range of an array."""
    row = np.asarray(values)
    if row.dtype.kind not in 'fiu' or not row.size:
        return shown(values)
    ends = (row.min(), row.max()) if row.ndim else (row,)
    return ' to '.join(f'{x + 0.0:.6g}' for x in ends)  # not -0


class PointMotion(NamedTuple):
    """The motion of a point, in the axes of base_link.

    Attributes:
        position: Position (x, y), m.
        velocity: Velocity (x, y), m/s.
        acceleration: Acceleration (x, y), m/s^2.
    """

    position: Vector
    velocity: Vector
    acceleration: Vector
