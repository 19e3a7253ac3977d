# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Dyads that a mechanism carries in addition to its loop, for six-bars and linkages in series.

A dyad is two links between points of other links, or a link and a slider on a fixed guide. Its
pose follows from the poses of the links that carry it. With the vector D between the ends of two
links, b e + c f = D, where e and f point from the first end to the second. Differentiating gives

    b phi' sigma = D'.f    -c psi' sigma = D'.e        sigma = sin(psi - phi)
    b phi'' sigma = D''.f + b cos(psi - phi) phi'^2 + c psi'^2    and likewise psi''

For a slider, with the first end at (p, -h) in the axes of the guide, l e = (x, h) and

    phi' = h'/x   phi'' = (h'' + h phi'^2) / x   s' = p' - h phi'   s'' = p'' - h phi'' - x phi'^2

Relative errors grow as 1 / sigma^2, because the ends have rounding errors.
"""

import itertools
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, NoReturn

from linkage_ros.errors import ConfigurationError, Mistakes, UnreachableError
from linkage_ros.formulas import ZERO, Opaque, Vector, atan2, dot, require, sqrt, turned
from linkage_ros.mechanism.kinematics import LinkPose, Loop, Pose, bends, directions
from linkage_ros.mechanism.parts import CROSSED, OPEN, Body
from linkage_ros.numeric import Real
from linkage_ros.quantities import Checked, groups, quantity, required, shown, unlisted
from linkage_ros.units import rad_and_deg

_FRAME = 'frame'
_AT = (-1e9, 1e9)


@dataclass(frozen=True)
class DyadSlider(Checked):
    """The slider of a dyad, on a fixed guide; its pin is its centre of mass.

    Attributes:
        mass: Mass, kg.
        at: A point of the pin's path, at which the slider's position is 0, in base_link, m.
        angle: Direction of the guide in which the slider's position increases, rad.
    """

    mass: float = quantity('number', 'mass', 'kg', span=(0.0, 1e12), default=0.0)
    at: tuple[float, float] = quantity(
        'pair', "point [x, y] of the pin's path at which the position is 0", 'm', span=_AT,
        default=(0.0, 0.0),
    )  # fmt: skip
    angle: float = quantity(
        'number', 'direction of the guide', 'rad', span=(-1e3, 1e3), default=0.0
    )


@dataclass(frozen=True, kw_only=True)
class Dyad(Checked):
    """Two links, or a link and a slider, that are pinned together and to a mechanism.

    The links are named NAME_first and NAME_second or NAME_slider, the pins NAME_from, NAME_joint
    and NAME_to, unless `names` gives other names.

    Attributes:
        name: Name of the dyad.
        from_: Link that carries the first end; 'frame' is the fixed link.
        from_at: The first end, [along, across] on that link, m; on the frame in base_link.
        first: Link from the first end to the joint.
        second: Link from the second end to the joint; None with a slider.
        to: Link that carries the second end.
        to_at: The second end, [along, across] on that link, m.
        slider: Slider at the joint; None with a second link.
        assembly: 'open' if the joint lies to the left of the line from the first end to the second
            or, with a slider, on the + side of the first end.
        names: Names of the first link, the second link or slider, and the pins at the first end,
            the joint and the second end; empty for the usual names.
    """

    name: str = required()
    from_: str = quantity('text', 'link that carries the first end, or frame')
    from_at: tuple[float, float] = quantity(
        'pair', 'first end [along, across] on its link', 'm', span=_AT, default=(0.0, 0.0)
    )
    first: Body
    second: Body | None = None
    slider: DyadSlider | None = None
    to: str | None = quantity('text', 'link that carries the second end, or frame', default=None)
    to_at: tuple[float, float] | None = quantity(
        'pair', 'second end [along, across] on its link', 'm', span=_AT, default=None
    )
    assembly: str = quantity('choice', 'side of the joint', choices=(OPEN, CROSSED), default=OPEN)
    names: tuple[str, ...] = unlisted(())

    def __post_init__(self) -> None:
        super().__post_init__()
        label = f'dyads.{self.name}'
        if not re.fullmatch('[A-Za-z_][A-Za-z0-9_]*', self.name):
            raise ConfigurationError(
                f'dyad {shown(self.name)}: its name must be letters, digits and underscores, and '
                'not begin with a digit'
            )
        if (self.second is None) == (self.slider is None):
            raise ConfigurationError(
                f'{label} needs second or slider, and not both: two links between two points, or '
                'one link and a slider'
            )
        if self.second is not None and self.to is None:
            raise ConfigurationError(f'{label}.to is missing: must be a link, or {_FRAME}')
        if self.slider is not None and (self.to, self.to_at) != (None, None):
            raise ConfigurationError(
                f'{label}.to is for a dyad of two links: leave it out; slider.at and '
                'slider.angle are the guide'
            )

    @property
    def parts(self) -> dict[str, Any]:
        """The parts of the two links, by the name of the link."""
        last = 'second' if self.slider is None else 'slider'
        names = self.names or (f'{self.name}_first', f'{self.name}_{last}')
        return {names[0]: self.first, names[1]: getattr(self, last)}

    @property
    def pins(self) -> tuple[str, ...]:
        """The names of the pins at the first end, the joint and, without a slider, the second."""
        ends = ('from', 'joint') if self.slider is not None else ('from', 'joint', 'to')
        return self.names[2:] or tuple(f'{self.name}_{end}' for end in ends)

    @property
    def references(self) -> dict[str, str]:
        """The links that carry the ends, by parameter."""
        ends = {'from': self.from_} if self.to is None else {'from': self.from_, 'to': self.to}
        return {f'dyads.{self.name}.{end}': link for end, link in ends.items()}

    def loop(self, points: dict[str, Any]) -> 'TwoLinks | LinkAndSlider':
        """Returns the kinematic constants, given the points of the whole mechanism."""
        start = points[self.pins[0]]
        length = self.first.length
        side = 1 if self.assembly == OPEN else -1
        refuse = Opaque(self._refuse)
        if self.slider is None:
            apart = points[self.pins[2]].minus(start)
            return TwoLinks(apart, length, self.second.length, side, refuse)  # type: ignore[union-attr]
        guide = Vector.at(self.slider.angle)
        guide_from_base = complex(guide.x, -guide.y)  # rotation
        start_in_guide = start._replace(
            weights=tuple(weight * guide_from_base for weight in start.weights),
            fixed=(start.fixed - complex(*self.slider.at)) * guide_from_base,
        )
        return LinkAndSlider(start_in_guide, guide, length, side, refuse)

    def gap(self, distance: float) -> str:
        """Describes by how much the dyad does not close.

        Args:
            distance: Distance of the ends, or of the first end from the pin's path, m.
        """
        first, (link, last), (start, *_, end) = self.first.length, self.parts, self.pins
        if self.second is None:
            return (
                f'{start} is {distance:.6g} m from the path of {last}, and '
                f'{link} reaches {first:.6g} m, gap {distance - first:.3g} m'
            )
        far, near = first + self.second.length, abs(first - self.second.length)
        words = f'{start} and {end} are {distance:.6g} m apart, and the links reach '
        if distance > 0.5 * (far + near):
            return f'{words}{far:.6g} m, gap {distance - far:.3g} m'
        return f'{words}no nearer than {near:.6g} m, gap {near - distance:.3g} m'

    def _refuse(self, crank: float, distance: float) -> NoReturn:
        distance = abs(distance) if self.second is None else math.sqrt(distance)
        raise UnreachableError(
            f'the dyad {self.name} does not close, or is in line, at crank angle '
            f'{rad_and_deg(crank)}: {self.gap(distance)}',
            crank_angle=crank, arcs=(),
        )  # fmt: skip


def dyads_field() -> Any:
    """Declares the field of a mechanism that holds its dyads."""
    return groups(Dyad, {'': Dyad})


def ordered(dyads: Sequence[Dyad], links: Sequence[str]) -> tuple[Dyad, ...]:
    """Sorts dyads so that each follows the dyads that carry it, and otherwise by name.

    Args:
        dyads: The dyads.
        links: Names of the links of the loop.

    Raises:
        ConfigurationError: Two dyads have one name, a link is unknown, or dyads carry each other.
    """
    mistakes, waiting = Mistakes(), {dyad.name: dyad for dyad in dyads}
    valid = [*links, *(link for dyad in dyads for link in dyad.parts), _FRAME]
    for name in (x for x in waiting if sum(dyad.name == x for dyad in dyads) > 1):
        with mistakes:
            raise ConfigurationError(f'two dyads have the name {shown(name)}: rename one')
    for what, link in (pair for dyad in dyads for pair in dyad.references.items()):
        with mistakes:
            if link not in valid:
                raise ConfigurationError(
                    f'{what} = {shown(link)}: must be one of {", ".join(valid)}'
                )
    mistakes.check()
    known, found = {*links, _FRAME}, list[Dyad]()
    while waiting:
        ready = (x for x in sorted(waiting) if known.issuperset(waiting[x].references.values()))
        chosen = next(ready, None)
        if chosen is None:
            raise ConfigurationError(_circle(waiting, known))
        found.append(waiting.pop(chosen))
        known.update(found[-1].parts)
    return tuple(found)


def _circle(waiting: dict[str, Dyad], known: set[str]) -> str:
    """Describes dyads that carry each other."""
    carriers = {link: dyad.name for dyad in waiting.values() for link in dyad.parts}
    way = [min(waiting)]
    while way[-1] not in way[:-1]:
        missing = set(waiting[way[-1]].references.values()) - known
        way.append(carriers[min(missing)])
    way = way[way.index(way[-1]) :]
    return (
        f'dyads: {" is carried by ".join(way)}: they form a circle; attach one of them to the '
        f'loop or to {_FRAME}'
    )


# ---------------------------------------------------------------- kinematics


class Chain(NamedTuple):
    """The kinematic constants of a mechanism with dyads: those of its loop, then of each dyad."""

    loop: Loop
    dyads: tuple[Any, ...]

    def pose(self, q: tuple[Real, ...]) -> Pose:
        """Computes the pose of the loop, then of each dyad, at the coordinates."""
        links, sines = self.loop.pose(q)
        for dyad in self.dyads:
            first, second, sine = dyad.pose(links)
            links, sines = (*links, first, second), (*sines, sine)
        return Pose(links, sines)


class TwoLinks(NamedTuple):
    """The kinematic constants of a dyad of two links.

    Attributes:
        apart: Vector from the first end to the second, a `structure.Point`.
        first: Length of the first link, m.
        second: Length of the second link, m.
        side: 1 for the open assembly, -1 for the crossed one.
        refuse: Function that rejects a crank angle and the squared distance of the ends.
    """

    apart: Any
    first: float
    second: float
    side: int
    refuse: Opaque

    def margins(self, links: Sequence[LinkPose]) -> tuple[Real, ...]:
        """Computes how far the ends are from the largest and smallest possible distance, m."""
        apart, *_ = _derivatives(self.apart, links)
        distance, (b, c) = sqrt(dot(apart, apart)), (self.first, self.second)
        return b + c - distance, distance - abs(b - c)

    def pose(self, links: Sequence[LinkPose]) -> tuple[LinkPose, LinkPose, Real]:
        """Computes the poses of both links, and the sine from the first to the second."""
        b, c = self.first, self.second
        apart, slopes, changes = _derivatives(self.apart, links)
        square = dot(apart, apart)
        stretch, fold = (b + c) * (b + c) - square, square - (b - c) * (b - c)
        require(stretch > 0, self.refuse, links[0].position, square)
        require(fold > 0, self.refuse, links[0].position, square)
        root = self.side * sqrt(stretch * fold)
        way, back = directions(apart, square, root, b, c)
        over_b, over_c, cosine = 2 * c / root, 2 * b / root, dot(way, back)
        rates = [(-over_b * dot(x, back), over_c * dot(x, way)) for x in slopes]
        curves = [
            bends((b, c), (over_b, over_c), cosine, (own, other), (dot(x, back), dot(x, way)))
            for (own, other), x in zip(_products(rates), changes, strict=True)
        ]
        back = -back
        (one, two), (bend, other_bend) = _columns(rates), _columns(curves)
        return (
            LinkPose(atan2(way.y, way.x), way, one, bend),
            LinkPose(atan2(back.y, back.x), back, two, other_bend),
            root * (0.5 / (b * c)),
        )


class LinkAndSlider(NamedTuple):
    """The kinematic constants of a dyad of a link and a slider.

    Attributes:
        start: The first end in the axes of the guide, a `structure.Point`.
        guide: Unit vector of the guide.
        length: Length of the link, m.
        side: 1 for the open assembly, -1 for the crossed one.
        refuse: Function that rejects a crank angle and the distance of the end from the path.
    """

    start: Any
    guide: Vector
    length: float
    side: int
    refuse: Opaque

    def margins(self, links: Sequence[LinkPose]) -> tuple[Real, ...]:
        """Computes how far the end is from the largest possible distance, m."""
        start, *_ = _derivatives(self.start, links)
        return (self.length - abs(start.y),)

    def pose(self, links: Sequence[LinkPose]) -> tuple[LinkPose, LinkPose, Real]:
        """Computes the poses of link and slider, and the sine to the normal of the guide."""
        length, guide = self.length, self.guide
        start, slopes, changes = _derivatives(self.start, links)
        height = -start.y
        square = (length - height) * (length + height)
        require(square > 0, self.refuse, links[0].position, height)
        run = self.side * sqrt(square)
        over = 1.0 / run
        turns = [-(slope.y * over) for slope in slopes]
        slides = [slope.x - height * turn for slope, turn in zip(slopes, turns, strict=True)]
        bent, slid = [], []
        for (square_rate,), change in zip(_products([(x,) for x in turns]), changes, strict=True):
            bend = (height * square_rate - change.y) * over
            bent.append(bend)
            slid.append(change.x - height * bend - run * square_rate)
        scale = 1.0 / length
        way = turned(Vector(run, height), guide.x * scale, guide.y * scale)
        return (
            LinkPose(atan2(way.y, way.x), way, tuple(turns), tuple(bent)),
            LinkPose(start.x + run, guide, tuple(slides), tuple(slid)),
            run * scale,
        )


def _derivatives(
    point: Any, links: Sequence[LinkPose]
) -> tuple[Vector, list[Vector], list[Vector]]:
    """Computes a point and its derivatives with respect to the coordinates.

    Args:
        point: The point, or a vector, as a `structure.Point`.
        links: Poses of the links that carry it.

    Returns:
        The position, the first derivatives, and the coefficients of the products of rates in the
        acceleration, as in `LinkPose`.
    """
    count, still = len(links[0].jacobian), Vector(ZERO, ZERO)
    place, slopes = point.fixed, [still] * count
    changes = [still] * (count * (count + 1) // 2)
    for weight, link in zip(point.weights, links, strict=False):
        if weight.x is ZERO and weight.y is ZERO:
            continue
        arm = turned(link.direction, weight.x, weight.y)
        left = arm.left()
        place += arm
        slopes = [slope + left * rate for slope, rate in zip(slopes, link.jacobian, strict=True)]
        products = _products([(rate,) for rate in link.jacobian])
        rows = zip(changes, link.curvature, products, strict=True)
        changes = [change + left * bend - arm * product for change, bend, (product,) in rows]
    return place, slopes, changes


def _products(rates: Sequence[tuple[Real, ...]]) -> list[tuple[Real, ...]]:
    """Computes the factor of each product of two rates in the square of a velocity.

    Args:
        rates: Derivatives with respect to each coordinate, of several links.
    """
    return [
        tuple(x * y if k == j else 2 * x * y for x, y in zip(rates[k], rates[j], strict=True))
        for k, j in itertools.combinations_with_replacement(range(len(rates)), 2)
    ]


def _columns(rows: Sequence[tuple[Real, Real]]) -> tuple[tuple[Real, ...], ...]:
    return tuple(zip(*rows, strict=True))
