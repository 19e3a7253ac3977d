# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Dyads that a mechanism carries in addition to its loop, for six-bars and linkages in series.

A dyad is two links between points of other links, a link and a slider on a guide of another link,
or a barrel and a rod between points of other links. Its pose follows from the poses of the links
that carry it. With the vector D between the ends of two links, b e + c f = D, where e and f point
from the first end to the second. Differentiating gives

    b phi' sigma = D'.f    -c psi' sigma = D'.e        sigma = sin(psi - phi)
    b phi'' sigma = D''.f + b cos(psi - phi) phi'^2 + c psi'^2    and likewise psi''

For a slider on a guide whose direction g turns with the angle psi, with the vector W from the
guide's point to the first end, W + l e = s g. In the axes (g, n) of the guide, W = (p, -h) and
l e = (x, h), so that s = p + x and

    x phi' = s psi' - W'.n        x phi'' = 2 s' psi' + s psi'' + h phi'^2 - W''.n
    s' = W'.g - h phi'            s'' = W''.g - h phi'' - x phi'^2 + s psi'^2

For a rod at the position s in a barrel with the direction g and the angle phi, whose axis is at a
distance e to the left of the barrel's pin, with the vector D from that pin to the rod's,
D = (s + i e) g, so that s^2 = D.D - e^2 and

    s phi' = D'.n                 s phi'' = D''.n - 2 s' phi' + e phi'^2
    s' = D'.g + e phi'            s'' = D''.g + e phi'' + s phi'^2

In the code, x_1 lists the derivatives of x with respect to the coordinates, and x_2 the
coefficients of the products of two rates in x'', as in `LinkPose`.

Relative errors grow as 1 / sigma^2, because the ends have rounding errors.
"""

import itertools
import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, NoReturn, cast

from linkage_ros.errors import ConfigurationError, Mistakes, UnreachableError
from linkage_ros.formulas import ZERO, Opaque, Vector, atan2, cross, dot, require, sqrt, turned
from linkage_ros.mechanism.axes import axes_of
from linkage_ros.mechanism.kinematics import LinkPose, Loop, Pose, bends, directions
from linkage_ros.mechanism.parts import CROSSED, FRAME_NAME, OPEN, Barrel, Body, Rod
from linkage_ros.numeric import Real
from linkage_ros.quantities import (
    Checked,
    groups,
    quantity,
    require_name,
    required,
    shown,
    unlisted,
)
from linkage_ros.units import rad_and_deg

_AT = (-1e9, 1e9)
# The parts of each kind of dyad, and its pins.
_KINDS: dict[tuple[str, ...], tuple[str, ...]] = {
    ('first', 'second'): ('from', 'joint', 'to'),
    ('first', 'slider'): ('from', 'joint'),
    ('barrel', 'rod'): ('from', 'to'),
}


@dataclass(frozen=True)
class DyadSlider(Checked):
    """The slider of a dyad, on a guide; it does not turn relative to the link with the guide.

    Attributes:
        mass: Mass, kg.
        at: A point of the pin's path, at which the slider's position is 0, [along, across] on the
            link with the guide, m; on the frame in base_link.
        angle: Direction of the guide in which the slider's position increases, from the direction
            of its link, rad.
        on: Link with the guide; 'frame' is the fixed link.
        inertia: Moment of inertia about the centre of mass, kg m^2; None on the frame.
        center: Centre of mass [along, across] from the pin in the direction of the guide, m; None
            on the frame, where it is the pin.
    """

    mass: float = quantity('number', 'mass', 'kg', span=(0.0, 1e12), default=0.0)
    at: tuple[float, float] = quantity(
        'pair', "point of the pin's path at which the position is 0, on the link with the guide",
        'm', span=_AT, default=(0.0, 0.0),
    )  # fmt: skip
    angle: float = quantity(
        'number', 'direction of the guide on its link', 'rad', span=(-1e3, 1e3), default=0.0
    )
    on: str = quantity('text', 'link with the guide, or frame', default=FRAME_NAME)
    inertia: float = quantity(
        'number', 'moment of inertia about the centre of mass, unless on the frame', 'kg m^2',
        span=(0.0, 1e12), default=None,
    )  # fmt: skip
    center: tuple[float, float] = quantity(
        'pair', 'centre of mass [along, across] the guide from the pin, unless on the frame', 'm',
        span=_AT, default=None,
    )  # fmt: skip

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, zero in {'inertia': 0.0, 'center': (0.0, 0.0)}.items():
            if self.on != FRAME_NAME and getattr(self, name) is None:
                object.__setattr__(self, name, zero)


@dataclass(frozen=True, kw_only=True)
class Dyad(Checked):
    """Two links, a link and a slider, or a barrel and a rod, that a mechanism carries.

    The links are named NAME_first and NAME_second or NAME_slider, or NAME_barrel and NAME_rod, the
    pins NAME_from, NAME_joint and NAME_to, unless `names` gives other names.

    Attributes:
        name: Name of the dyad.
        from_: Link that carries the first end; 'frame' is the fixed link.
        from_at: The first end, [along, across] on that link, m; on the frame in base_link.
        first: Link from the first end to the joint.
        second: Link from the second end to the joint; None with a slider.
        to: Link that carries the second end.
        to_at: The second end, [along, across] on that link, m.
        slider: Slider at the joint; None with a second link.
        barrel: Cylinder or slotted lever that turns about the second end.
        rod: Link that slides in the barrel and is pinned to the first end. Its position is
            measured from the foot of the perpendicular from the second end.
        offset: Distance of the rod's axis from the second end, positive to the left of the
            barrel's direction, m; None without a barrel.
        assembly: 'open' if the joint lies to the left of the line from the first end to the second
            or, with a slider, on the + side of the first end. A barrel has only 'open'.
        names: Names of the two links, and of the pins at the first end, the joint and the second
            end, if there are; empty for the usual names.
    """

    name: str = required()
    from_: str = quantity('text', 'link that carries the first end, or frame')
    from_at: tuple[float, float] = quantity(
        'pair', 'first end [along, across] on its link', 'm', span=_AT, default=(0.0, 0.0)
    )
    first: Body | None = None
    second: Body | None = None
    slider: DyadSlider | None = None
    to: str | None = quantity('text', 'link that carries the second end, or frame', default=None)
    to_at: tuple[float, float] | None = quantity(
        'pair', 'second end [along, across] on its link', 'm', span=_AT, default=None
    )
    barrel: Barrel | None = None
    rod: Rod | None = None
    offset: float = quantity(
        'number', "distance of the rod's axis from the second end, to the barrel's left", 'm',
        span=_AT, default=None,
    )  # fmt: skip
    assembly: str = quantity('choice', 'side of the joint', choices=(OPEN, CROSSED), default=OPEN)
    names: tuple[str, ...] = unlisted(())

    def __post_init__(self) -> None:
        super().__post_init__()
        require_name('dyad', self.name)
        self._check_parts()
        self._check_second_end()
        self._check_barrel()
        self._check_slider()
        offset: Any = self.offset  # None if it is not given
        if self.barrel is not None and offset is None:
            object.__setattr__(self, 'offset', 0.0)

    @property
    def _label(self) -> str:
        return f'dyads.{self.name}'

    def _check_parts(self) -> None:
        if tuple(self._parts) not in _KINDS:
            raise ConfigurationError(
                f'{self._label} needs second or slider, and not both: two links between two '
                'points (first and second), one link and a slider (first and slider), or a '
                'cylinder (barrel and rod); a part needs at least one value, such as mass: 0.0'
            )

    def _check_second_end(self) -> None:
        if self.slider is None and self.to is None:
            raise ConfigurationError(
                f'{self._label}.to is missing: must be a link, or {FRAME_NAME}'
            )
        if self.slider is not None and (self.to, self.to_at) != (None, None):
            raise ConfigurationError(
                f'{self._label}.to is for a dyad of two links: leave it out; slider.at and '
                'slider.angle are the guide'
            )

    def _check_barrel(self) -> None:
        offset: Any = self.offset
        if self.barrel is None:
            if offset is not None:
                raise ConfigurationError(
                    f'{self._label}.offset is for a barrel and a rod: leave it out'
                )
        elif self.assembly != OPEN:
            raise ConfigurationError(
                f'{self._label}.assembly = {self.assembly!r}: must be {OPEN} with a barrel and a '
                'rod'
            )

    def _check_slider(self) -> None:
        slider: Any = self.slider  # whose inertia and center may be None
        if slider is None or slider.on != FRAME_NAME:
            return
        if slider.inertia is not None or slider.center is not None:
            raise ConfigurationError(
                f'{self._label}.slider: inertia and center are for a guide on a moving link: '
                'leave them out; a slider on the frame does not turn, and its centre of mass is '
                'its pin'
            )

    @property
    def _parts(self) -> dict[str, Any]:
        """The parts of the two links, by parameter."""
        every = {word: getattr(self, word) for kind in _KINDS for word in kind}
        return {word: part for word, part in every.items() if part is not None}

    @property
    def words(self) -> tuple[str, ...]:
        """The parameters of the parts of the two links, such as ('first', 'second')."""
        return tuple(self._parts)

    @property
    def parts(self) -> dict[str, Any]:
        """The parts of the two links, by the name of the link."""
        names = self.names[:2] or tuple(f'{self.name}_{word}' for word in self._parts)
        return dict(zip(names, self._parts.values(), strict=True))

    @property
    def pins(self) -> tuple[str, ...]:
        """The names of the pins at the first end, the joint and the second end, if there are."""
        words = _KINDS[tuple(self._parts)]
        return self.names[2:] or tuple(f'{self.name}_{word}' for word in words)

    @property
    def references(self) -> dict[str, str]:
        """The links that carry the dyad, by parameter."""
        ends = {'from': self.from_}
        if self.to is not None:
            ends['to'] = self.to
        if self.slider is not None:
            ends['slider.on'] = self.slider.on
        return {f'dyads.{self.name}.{end}': link for end, link in ends.items()}

    def loop(self, structure: Any) -> 'TwoLinks | LinkAndSlider | BarrelAndRod':
        """Returns the kinematic constants, given the structure of the whole mechanism."""
        refuse = Opaque(self._refuse)  # a program calls it, and records no operations of it
        first_end, *_, last_pin = (structure.points[pin] for pin in self.pins)
        if self.barrel is not None:  # it turns about the second end, the last pin
            barrel_to_rod = first_end.minus(last_pin)
            return BarrelAndRod(barrel_to_rod, self.offset, abs(self.offset), refuse)
        side, first = 1 if self.assembly == OPEN else -1, cast('Body', self.first)
        if self.second is not None:
            apart = last_pin.minus(first_end)
            return TwoLinks(apart, first.length, self.second.length, side, refuse)
        start, spin, guide = self._from_guide(structure, first_end)
        return LinkAndSlider(start, spin, guide, first.length, side, refuse)

    def _from_guide(self, structure: Any, first_end: Any) -> tuple[Any, int | None, Vector]:
        """Returns `start`, `spin` and `guide` of a `LinkAndSlider`."""
        _, slider = self.parts
        spin, angle = axes_of(structure.links, structure.link_index(slider, self.name))
        guide = Vector.at(angle or 0.0)
        _, guide_point = structure.ends(self)
        start = first_end.minus(guide_point.point)
        if spin is None:
            # The guide does not turn: convert to its axes once, instead of in each pose.
            start = start.times(complex(guide.x, -guide.y))
        return start, spin, guide

    @property
    def title(self) -> str:
        """The dyad in a sentence: its links in a drawing, otherwise its name."""
        return ' and '.join(self.parts) if self.names else f'the dyad {self.name}'

    @property
    def has_assemblies(self) -> bool:
        """Whether there are two assemblies; a barrel and a rod have only one."""
        return self.barrel is None

    @property
    def assembly_words(self) -> str:
        """The assembly, after the links in a drawing, otherwise after the dyad's name."""
        return f'{" and ".join(self.parts) if self.names else self.name} {self.assembly}'

    @property
    def subject(self) -> str:
        """The dyad as the subject of a sentence, with 'do' or 'does'."""
        return f'{self.title} {"do" if self.names else "does"}'

    def gap(self, distance: float) -> str:
        """Describes by how much the dyad does not close.

        The distance is that of the ends, or of the first end from the pin's path, m.
        """
        (link, last), (start, *_, end) = self.parts, self.pins
        if self.barrel is not None:
            return (
                f'{start} and {end} are {distance:.6g} m apart, and the offset is '
                f'{self.offset:.6g} m, gap {abs(self.offset) - distance:.3g} m'
            )
        length = cast('Body', self.first).length
        if self.second is None:
            return (
                f'{start} is {distance:.6g} m from the path of {last}, and '
                f'{link} reaches {length:.6g} m, gap {distance - length:.3g} m'
            )
        stretched, folded = length + self.second.length, abs(length - self.second.length)
        words = f'{start} and {end} are {distance:.6g} m apart, and the links reach '
        if distance > 0.5 * (stretched + folded):
            return f'{words}{stretched:.6g} m, gap {distance - stretched:.3g} m'
        return f'{words}no nearer than {folded:.6g} m, gap {folded - distance:.3g} m'

    def _refuse(self, crank: float, distance: float) -> NoReturn:
        distance = math.sqrt(distance) if self.slider is None else abs(distance)
        # The links of a drawing have names, and its input has one of any kind.
        what = 'an angle of the input of' if self.names else 'crank angle'
        raise UnreachableError(
            f'{self.subject} not close, or only in line, at {what} '
            f'{rad_and_deg(crank)}: {self.gap(distance)}',
            crank_angle=crank, arcs=(),
        )  # fmt: skip


def dyads_field() -> Any:
    """Declares the field of a mechanism that holds its dyads."""
    return groups(Dyad, {'': Dyad})


def ordered(dyads: Sequence[Dyad], links: Sequence[str]) -> tuple[Dyad, ...]:
    """Sorts dyads so that each follows those that carry it, and otherwise by name.

    `links` are the names of the links of the loop.

    Raises:
        ConfigurationError: Two dyads have one name, a link is unknown, or dyads carry each other.
    """
    _require_names_and_carriers(dyads, links)
    waiting = {dyad.name: dyad for dyad in dyads}
    known, sorted_dyads = {*links, FRAME_NAME}, list[Dyad]()
    while waiting:
        ready = [x for x in waiting.values() if known.issuperset(x.references.values())]
        if not ready:
            raise ConfigurationError(_circle(waiting, known))
        dyad = min(ready, key=lambda x: x.name)
        del waiting[dyad.name]
        sorted_dyads.append(dyad)
        known.update(dyad.parts)
    return tuple(sorted_dyads)


def _require_names_and_carriers(dyads: Sequence[Dyad], links: Sequence[str]) -> None:
    """Rejects dyads of one name, and dyads on unknown links, all at once.

    Raises:
        ConfigurationError: There are such dyads; the message has all.
    """
    mistakes = Mistakes()
    for name, count in Counter(dyad.name for dyad in dyads).items():
        with mistakes:
            if count > 1:
                raise ConfigurationError(f'two dyads have the name {shown(name)}: rename one')
    valid = [*links, *(link for dyad in dyads for link in dyad.parts), FRAME_NAME]
    for dyad in dyads:
        for parameter, link in dyad.references.items():
            with mistakes:
                if link not in valid:
                    raise ConfigurationError(
                        f'{parameter} = {shown(link)}: must be one of {", ".join(valid)}'
                    )
    mistakes.check()


def _circle(waiting: dict[str, Dyad], known: set[str]) -> str:
    """Describes dyads that carry each other."""
    carriers = {link: dyad.name for dyad in waiting.values() for link in dyad.parts}
    path = [min(waiting)]
    while path[-1] not in path[:-1]:
        missing = set(waiting[path[-1]].references.values()) - known
        path.append(carriers[min(missing)])
    circle = path[path.index(path[-1]) :]
    return (
        f'dyads: {" is carried by ".join(circle)}: they form a circle; attach one of them to the '
        f'loop or to {FRAME_NAME}'
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

    @property
    def size(self) -> float:
        """Sum of the lengths, m."""
        return self.first + self.second

    def margins(self, links: Sequence[LinkPose]) -> tuple[Real, ...]:
        """Computes how far the ends are from the largest and smallest possible distance, m."""
        apart, *_ = _derivatives(self.apart, links)
        distance, (b, c) = sqrt(dot(apart, apart)), (self.first, self.second)
        return b + c - distance, distance - abs(b - c)

    def pose(self, links: Sequence[LinkPose]) -> tuple[LinkPose, LinkPose, Real]:
        """Computes the poses of both links, and the sine from the first to the second."""
        b, c = self.first, self.second
        D, D_1, D_2 = _derivatives(self.apart, links)
        D_squared = dot(D, D)
        stretch, fold = (b + c) * (b + c) - D_squared, D_squared - (b - c) * (b - c)
        require(stretch > 0, self.refuse, links[0].position, D_squared)
        require(fold > 0, self.refuse, links[0].position, D_squared)
        root = self.side * sqrt(stretch * fold)
        e, f = directions(D, D_squared, root, b, c)
        # With sigma = -root / (2 b c), these are -1 / (b sigma) and -1 / (c sigma).
        over_b, over_c = 2 * c / root, 2 * b / root
        cosine = dot(e, f)
        phi_1 = [-over_b * dot(d, f) for d in D_1]
        psi_1 = [over_c * dot(d, e) for d in D_1]
        phi_2, psi_2 = list[Real](), list[Real]()
        for d, phi_phi, psi_psi in zip(D_2, _squares(phi_1), _squares(psi_1), strict=True):
            squares, ends = (phi_phi, psi_psi), (dot(d, f), dot(d, e))
            phi, psi = bends((b, c), (over_b, over_c), cosine, squares, ends)
            phi_2.append(phi)
            psi_2.append(psi)
        second = -f  # the second link's direction is from the second end to the joint
        return (
            LinkPose(atan2(e.y, e.x), e, tuple(phi_1), tuple(phi_2)),
            LinkPose(atan2(second.y, second.x), second, tuple(psi_1), tuple(psi_2)),
            root * (0.5 / (b * c)),
        )


class LinkAndSlider(NamedTuple):
    """The kinematic constants of a dyad of a link and a slider.

    Attributes:
        start: Vector from the guide's point to the first end, a `structure.Point`; in the axes of
            the guide if the guide does not turn.
        spin: Index of the link with which the guide turns; None if it does not turn.
        guide: Unit vector of the guide, in the axes of that link.
        length: Length of the link, m.
        side: 1 for the open assembly, -1 for the crossed one.
        refuse: Function that rejects a crank angle and the distance of the end from the path.
    """

    start: Any
    spin: int | None
    guide: Vector
    length: float
    side: int
    refuse: Opaque

    @property
    def size(self) -> float:
        """Length of the link, m."""
        return self.length

    def margins(self, links: Sequence[LinkPose]) -> tuple[Real, ...]:
        """Computes how far the end is from the largest possible distance, m."""
        (start, *_), _ = self._in_guide(links)
        return (self.length - abs(start.y),)

    def _in_guide(
        self, links: Sequence[LinkPose]
    ) -> tuple[tuple[Vector, list[Vector], list[Vector]], Vector]:
        """Returns W, W_1 and W_2, each along and across the guide; and the guide's direction."""
        W, W_1, W_2 = _derivatives(self.start, links)
        if self.spin is None:
            return (W, W_1, W_2), self.guide
        guide = turned(links[self.spin].direction, self.guide.x, self.guide.y)

        def in_guide(vector: Vector) -> Vector:
            return Vector(dot(guide, vector), cross(guide, vector))

        return (in_guide(W), [*map(in_guide, W_1)], [*map(in_guide, W_2)]), guide

    def pose(self, links: Sequence[LinkPose]) -> tuple[LinkPose, LinkPose, Real]:
        """Computes the poses of link and slider, and the sine to the normal of the guide."""
        (W, W_1, W_2), guide = self._in_guide(links)
        length, h = self.length, -W.y
        x_squared = (length - h) * (length + h)
        require(x_squared > 0, self.refuse, links[0].position, h)
        x = self.side * sqrt(x_squared)
        over_x, s = 1.0 / x, W.x + x
        psi_1, psi_2 = _spin(links, self.spin)
        phi_1 = [(s * psi - w.y) * over_x for w, psi in zip(W_1, psi_1, strict=True)]
        s_1 = [w.x - h * phi for w, phi in zip(W_1, phi_1, strict=True)]
        # Factors of each product of two rates in phi'^2, psi'^2, s' psi', and then phi'' and s''.
        phi_phi, psi_psi, s_psi = _squares(phi_1), _squares(psi_1), _mixed(s_1, psi_1)
        products = range(len(W_2))
        phi_2 = [
            (h * phi_phi[i] + (2 * s_psi[i] + s * psi_2[i]) - W_2[i].y) * over_x for i in products
        ]
        s_2 = [W_2[i].x - h * phi_2[i] - x * phi_phi[i] + s * psi_psi[i] for i in products]
        scale = 1.0 / length
        e = turned(Vector(x, h), guide.x * scale, guide.y * scale)
        return (
            LinkPose(atan2(e.y, e.x), e, tuple(phi_1), tuple(phi_2)),
            LinkPose(s, guide, tuple(s_1), tuple(s_2)),
            x * scale,
        )


class BarrelAndRod(NamedTuple):
    """The kinematic constants of a dyad of a barrel and a rod.

    Attributes:
        apart: Vector from the barrel's pin to the rod's, a `structure.Point`.
        offset: Distance of the rod's axis from the barrel's pin, to the left, m.
        nearest: Absolute value of the offset, m.
        refuse: Function that rejects a crank angle and the squared distance of the pins.
    """

    apart: Any
    offset: float
    nearest: float
    refuse: Opaque

    @property
    def size(self) -> float:
        """Largest distance of the pins, m, if all links that carry them were in line."""
        return math.fsum(map(abs, (*self.apart.weights, self.apart.fixed)))

    def margins(self, links: Sequence[LinkPose]) -> tuple[Real, ...]:
        """Computes how far the pins are from the smallest possible distance, m."""
        apart, *_ = _derivatives(self.apart, links)
        return (sqrt(dot(apart, apart)) - self.nearest,)

    def pose(self, links: Sequence[LinkPose]) -> tuple[LinkPose, LinkPose, Real]:
        """Computes the poses of barrel and rod, and the sine from the rod's pin to the guide."""
        e = self.offset
        D, D_1, D_2 = _derivatives(self.apart, links)
        D_squared = dot(D, D)
        distance = sqrt(D_squared)
        margin = distance - self.nearest
        require(margin > 0, self.refuse, links[0].position, D_squared)
        s = sqrt(margin * (distance + self.nearest))
        over_s, scale = 1.0 / s, 1.0 / D_squared
        g = turned(D, scale * s, scale * -e)
        phi_1 = [cross(g, d) * over_s for d in D_1]
        s_1 = [dot(d, g) + e * phi for d, phi in zip(D_1, phi_1, strict=True)]
        # Factors of each product of two rates in phi'^2, s' phi', and then phi'' and s''.
        phi_phi, s_phi = _squares(phi_1), _mixed(s_1, phi_1)
        products = range(len(D_2))
        phi_2 = [(cross(g, D_2[i]) - 2 * s_phi[i] + e * phi_phi[i]) * over_s for i in products]
        s_2 = [dot(D_2[i], g) + e * phi_2[i] + s * phi_phi[i] for i in products]
        return (
            LinkPose(atan2(g.y, g.x), g, tuple(phi_1), tuple(phi_2)),
            LinkPose(s, g, tuple(s_1), tuple(s_2)),
            s / distance,
        )


def _derivatives(
    point: Any, links: Sequence[LinkPose]
) -> tuple[Vector, list[Vector], list[Vector]]:
    """Computes a `structure.Point`, or a vector, and its derivatives by the coordinates.

    Returns:
        The position x; x_1, its derivatives; and x_2, the coefficients of the products of rates
        in its acceleration, as in `LinkPose`.
    """
    count = len(links[0].jacobian)  # of the coordinates
    x, zero = point.fixed, Vector(ZERO, ZERO)
    x_1, x_2 = [zero] * count, [zero] * (count * (count + 1) // 2)
    # The weights of later links, which the point does not depend on, are 0.
    for weight, link in zip(point.weights, links, strict=False):
        if weight.x is ZERO and weight.y is ZERO:
            continue
        arm = turned(link.direction, weight.x, weight.y)
        left = arm.left()
        x += arm
        x_1 = [total + left * rate for total, rate in zip(x_1, link.jacobian, strict=True)]
        terms = zip(x_2, link.curvature, _squares(link.jacobian), strict=True)
        x_2 = [total + left * bend - arm * square for total, bend, square in terms]
    return x, x_1, x_2


def _squares(rates: Sequence[Real]) -> list[Real]:
    """Computes the factor of each product of two rates in the square of a velocity.

    Args:
        rates: Derivatives with respect to each coordinate.
    """
    return [
        rates[k] * rates[j] if k == j else 2 * rates[k] * rates[j]
        for k, j in itertools.combinations_with_replacement(range(len(rates)), 2)
    ]


def _mixed(one: Sequence[Real], other: Sequence[Real]) -> list[Real]:
    """Computes the factor of each product of two rates in the product of two velocities."""
    return [
        one[k] * other[k] if k == j else one[k] * other[j] + one[j] * other[k]
        for k, j in itertools.combinations_with_replacement(range(len(one)), 2)
    ]


def _spin(links: Sequence[LinkPose], spin: int | None) -> tuple[Sequence[Real], Sequence[Real]]:
    """Returns the derivatives of the angle of a guide; ZERO if it does not turn."""
    if spin is not None:
        return links[spin].jacobian, links[spin].curvature
    count = len(links[0].jacobian)
    return [ZERO] * count, [ZERO] * (count * (count + 1) // 2)
