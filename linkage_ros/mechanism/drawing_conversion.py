# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Converts a drawing to a mechanism with dyads.

The loop of the input becomes the mechanism; each further pair of bodies that is held by those
before becomes a dyad.
"""

import functools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from fractions import Fraction
from typing import Any, NamedTuple, cast

from linkage_ros.errors import (
    ConfigurationError,
    LinkageError,
    MechanismError,
    UnreachableError,
)
from linkage_ros.mechanism.base import Drawn, Mechanism
from linkage_ros.mechanism.drawing_checks import listed, place_words
from linkage_ros.mechanism.dyads import Dyad, DyadSlider
from linkage_ros.mechanism.exact import UNITS, Exact, over_root
from linkage_ros.mechanism.four_bar import FourBar
from linkage_ros.mechanism.inverted_slider_crank import CYLINDER, InvertedSliderCrank
from linkage_ros.mechanism.kinematics import Pose
from linkage_ros.mechanism.loads.spring import Spring
from linkage_ros.mechanism.parts import (
    CROSSED,
    FRAME_NAME,
    OPEN,
    Barrel,
    Body,
    Coupler,
    Frame,
    Guide,
    Rod,
    Slider,
    TracedPoint,
)
from linkage_ros.mechanism.slider_crank import SLIDER, SliderCrank
from linkage_ros.quantities import shown

# The smallest sine of the angle between two links at which a drawing shows their assembly: in the
# loop, which may be near a change point, and in a dyad.
_LEAST_SINE, _LEAST_SINE_OF_DYAD = 1e-6, 1e-3
_ONE_PIN_LESS = 3  # degrees of freedom of a mechanism without one of its fixed pins


def _ambiguous(what: str) -> str:
    """Explains that a drawing does not show which assembly is meant."""
    cure = ', or correct the direction of the line' if ' line of ' in what else ''
    return (
        f'{what} as drawn, so that the drawing does not show on which side they are joined; draw '
        f'the machine at another position{cure}'
    )


class _Body(NamedTuple):
    """A moving body of a drawing.

    Attributes:
        name: Name of the body.
        pins: Names of its pins.
        part: Mass of the body, and length if given.
        on: Body with the line on which it slides, or 'frame'; empty for a link.
        direction: Direction of the line as drawn.
    """

    name: str
    pins: tuple[str, ...]
    part: Any
    on: str = ''
    direction: Exact = Exact(Fraction(1), Fraction(0))


def _across(pin: str, link: _Body, slide: _Body) -> str:
    """Returns in words that a link is at right angles to the line of a slide."""
    return f'at {pin}, {link.name} is at right angles to the line of {slide.name}'


def _along(direction: Exact, arm: Exact) -> Exact:
    """Returns a direction, reversed if it points against an arm."""
    return Exact(-direction.x, -direction.y) if arm.dot(direction) < 0 else direction


class _Base(NamedTuple):
    """A loop that may become the mechanism.

    Attributes:
        kind: Class of the mechanism.
        bodies: Crank, coupler and rocker or slider; or crank, barrel and rod.
        pins: Pins A0 and A, then B and, of a rocker, B0; or B0 of a barrel.
    """

    kind: type[Mechanism]
    bodies: tuple[_Body, ...]
    pins: tuple[str, ...]


class _Loop(NamedTuple):
    """The part of a loop besides its crank.

    Attributes:
        parts: Further arguments of the mechanism's class.
        pins: Names of its pins by those in the class, besides A0 and A.
        position: Position of the driven joint as drawn, rad or m.
        ambiguity: Description of the positions in which a drawing does not show the assembly.
        block: See `Drawn`.
    """

    parts: dict[str, Any]
    pins: dict[str, str]
    position: float
    ambiguity: str
    block: str = ''


class _Axes(NamedTuple):
    """The axes of a body in the drawing.

    Attributes:
        start: Origin of the axes, where the body is carried.
        direction: Direction of the first axis.
        end: Pin on the first axis, at the body's length; empty if there is none.
        length: This length, m.
    """

    start: Exact
    direction: Exact
    end: str = ''
    length: float = 0.0


class Conversion:
    """The conversion of a drawing.

    Attributes:
        at: Place of each pin as drawn or, once the loop is chosen, from the origin, m.
        origin: The crank's fixed pin as drawn, which is base_link's origin, m.
        axes: Axes of each body whose motion is known, in the order of solution.
    """

    def __init__(self, drawing: Any) -> None:
        """Collects the bodies of a `drawing.Drawing`."""
        self.drawing, self.unit = drawing, UNITS[drawing.units]
        self.at = {name: Exact.of(place, self.unit) for name, place in drawing.pins.items()}
        self.bodies = {link.name: _Body(link.name, link.pins, link) for link in drawing.links}
        for slide in drawing.slides:
            self.bodies[slide.name] = _Body(
                slide.name, slide.all_pins, slide, slide.on, Exact.of(slide.direction)
            )
        for cylinder in drawing.cylinders:
            if cylinder.name == drawing.input:
                barrel, rod = f'{cylinder.name}_barrel', f'{cylinder.name}_rod'
                direction = self.at[cylinder.to].minus(self.at[cylinder.from_])
                self.bodies[barrel] = _Body(barrel, (cylinder.from_,), cylinder.barrel)
                self.bodies[rod] = _Body(rod, (cylinder.to,), cylinder.rod, barrel, direction)
        self.origin = Exact(Fraction(0), Fraction(0))
        self.axes: dict[str, _Axes] = {}

    def mechanism(self, gravity: Any, loads: Sequence[Any], points: Sequence[Any]) -> Mechanism:
        """Returns the mechanism; see `Drawing.mechanism`.

        Raises:
            ConfigurationError: Some links do not form dyads.
        """
        try:
            return self.converted(gravity, loads, points)
        except ConfigurationError as error:
            candidates = [*self.forgotten()] if self.degrees == _ONE_PIN_LESS else []
            if not candidates:
                raise
            pin = 'it' if len(candidates) == 1 else 'one of them'
            raise ConfigurationError(
                f'{", and ".join(candidates)}; is {pin} fixed? then add it to drawing.frame'
            ) from error

    def forgotten(self) -> Iterator[str]:
        """Yields the pins of one link that would make a mechanism as fixed pins, in words."""
        for pin in self.at:
            owners = [body.name for body in self.bodies.values() if pin in body.pins]
            if len(owners) == 1 and pin not in self.drawing.frame:
                with suppress(LinkageError):
                    drawing = replace(self.drawing, frame=(*self.drawing.frame, pin))
                    Conversion(drawing).converted((0.0, 0.0), (), ())
                    yield f'{pin} is a pin of {owners[0]} alone'

    def converted(self, gravity: Any, loads: Sequence[Any], points: Sequence[Any]) -> Mechanism:
        """Returns the mechanism; see `mechanism`.

        Raises:
            ConfigurationError: Some links do not form dyads.
        """
        base = self.base()
        mechanism = self.loop(base)
        waiting = {name: body for name, body in self.bodies.items() if name not in self.axes}
        dyads = []
        while waiting:
            dyad = self.next_dyad(waiting)
            if dyad is None:
                raise ConfigurationError(self.unsolved(waiting))
            dyads.append(dyad)
            waiting = {name: body for name, body in waiting.items() if name not in self.axes}
        changes = {
            'dyads': tuple(dyads),
            'loads': tuple(self.as_solved(load) for load in loads),
            'points': (*self.points(), *(self.as_solved(point) for point in points)),
            'gravity': gravity,
            'drawn': cast('Drawn', mechanism.drawn)._replace(cylinders=self.cylinders(loads)),
        }
        return cast('Mechanism', replace(cast('Any', mechanism), **changes))

    def cylinders(self, loads: Sequence[Any]) -> tuple[Spring, ...]:
        """Returns the cylinders without a load, besides the input, as springs without a force."""
        others = {self.drawing.input, *(getattr(load, 'cylinder', '') for load in loads)}
        names = [x.name for x in self.drawing.cylinders if x.name not in others]
        return tuple(self.as_solved(Spring(name=name, cylinder=name)) for name in names)

    # ------------------------------------------------------------ the loop

    def base(self) -> _Base:
        """Chooses the loop that becomes the mechanism.

        Raises:
            ConfigurationError: The input is in no loop that can.
        """
        name = self.drawing.input
        if any(cylinder.name == name for cylinder in self.drawing.cylinders):
            name = f'{name}_rod'
        driven = self.bodies[name]
        candidates = [*(self.driven_slides(driven) if driven.on else self.driven_turns(driven))]
        if not candidates:
            raise ConfigurationError(self.no_base(driven))
        return min(candidates, key=lambda base: self.preference(driven, base))

    def driven_turns(self, crank: _Body) -> Iterator[_Base]:
        """Yields the loops of a crank."""
        fixed = [pin for pin in crank.pins if pin in self.drawing.frame]
        if len(fixed) != 1:
            return
        (A0,) = fixed
        for A in crank.pins:
            for coupler in self.at_pin(A, crank) if A != A0 else ():
                yield from self.loops_of(crank, coupler, A0, A)

    def loops_of(self, crank: _Body, coupler: _Body, A0: str, A: str) -> Iterator[_Base]:
        """Yields the loops of a crank and a body that is pinned to it at A."""
        if coupler.on:
            partners = [self.bodies[coupler.on]] if coupler.on in self.bodies else []
        else:
            partners = [block for block in self.bodies.values() if block.on == coupler.name]
        for barrel in partners:
            for B0 in self.pivots(barrel, A0):
                yield _Base(InvertedSliderCrank, (crank, barrel, coupler), (A0, A, B0))
        if not coupler.on:
            yield from self.closed_by_pin(crank, coupler, A0, A)

    def closed_by_pin(self, crank: _Body, coupler: _Body, A0: str, A: str) -> Iterator[_Base]:
        """Yields the loops of a crank and a coupler with a third body, which are pinned at B."""
        for B in coupler.pins:
            for last in self.at_pin(B, crank, coupler) if B != A else ():
                if last.on == FRAME_NAME:
                    yield _Base(SliderCrank, (crank, coupler, last), (A0, A, B))
                elif not last.on:
                    for B0 in self.pivots(last, A0):
                        yield _Base(FourBar, (crank, coupler, last), (A0, A, B, B0))

    def driven_slides(self, driven: _Body) -> Iterator[_Base]:
        """Yields the loops of a driven slide or cylinder."""
        if driven.on == FRAME_NAME:
            for B in driven.pins:
                for coupler in self.at_pin(B, driven):
                    for crank, A0, A in self.cranks(coupler, B, driven):
                        yield _Base(SliderCrank, (crank, coupler, driven), (A0, A, B))
            return
        guide = self.bodies[driven.on]
        for barrel, rod in ((guide, driven), (driven, guide)):
            for B0 in self.pivots(barrel):
                for crank, A0, A in self.cranks(rod, B0, barrel):
                    yield _Base(InvertedSliderCrank, (crank, barrel, rod), (A0, A, B0))

    def cranks(self, coupler: _Body, pin: str, *others: _Body) -> Iterator[tuple[_Body, str, str]]:
        """Yields the cranks that are pinned to a body at another pin, with their pins A0 and A."""
        for A in coupler.pins:
            for crank in self.at_pin(A, coupler, *others) if pin != A else ():
                for A0 in self.pivots(crank, pin) if not crank.on else ():
                    yield crank, A0, A

    def at_pin(self, pin: str, *others: _Body) -> list[_Body]:
        """Returns the bodies at a pin that is not fixed, without the given ones."""
        if pin in self.drawing.frame:
            return []
        return [body for body in self.bodies.values() if pin in body.pins and body not in others]

    def pivots(self, body: _Body, *others: str) -> list[str]:
        """Returns the fixed pins of a body, without the given ones."""
        return [pin for pin in body.pins if pin in self.drawing.frame and pin not in others]

    def pins_of_no_link(self) -> tuple[tuple[str, complex], ...]:
        """Returns the fixed pins of no link, with their places from the origin, m."""
        linked = {pin for body in self.bodies.values() for pin in body.pins}
        pins = (pin for pin in self.drawing.frame if pin not in linked)
        return tuple((pin, complex(*self.at[pin].rounded)) for pin in pins)

    def preference(self, driven: _Body, base: _Base) -> tuple[Any, ...]:
        """Returns the key by which the loops are sorted, the best first.

        The best have a slide on a moving link, then a change point, then the driven body's first
        pin; the others are sorted by names.
        """
        has_change_point = False
        if base.kind is not InvertedSliderCrank:
            try:
                reach = Conversion(self.drawing).loop(base).reach()
            except (ConfigurationError, MechanismError):
                reach = None
            has_change_point = reach is not None and reach.has_change_point
        pin = base.pins[2] if driven.on else base.pins[1]
        _, *others = base.bodies
        return (
            base.kind is not InvertedSliderCrank,
            not has_change_point,
            driven.pins.index(pin) if pin in driven.pins else 0,
            *(body.name for body in others),
            *base.pins,
        )

    def loop(self, base: _Base) -> Mechanism:
        """Returns the mechanism of a loop, in the assembly that is drawn, from its crank's pin."""
        A0, A, *_ = base.pins
        crank, *_ = base.bodies
        self.require_motion(base.bodies, base.pins)
        self.origin = self.at[A0]
        self.at = {name: place.minus(self.origin) for name, place in self.at.items()}
        self.turn(crank, A0, A)
        if base.kind is FourBar:
            loop = self.four_bar(base)
        elif base.kind is SliderCrank:
            loop = self.slider_crank(base)
        else:
            loop = self.inverted_slider_crank(base)
        drawn = Drawn(
            links=tuple(body.name for body in base.bodies),
            points=(('A0', A0), ('A', A), *loop.pins.items()),
            crank_angle=self.at[A].angle,
            position=loop.position,
            block=loop.block,
            units=self.drawing.units,
            fixed=self.pins_of_no_link(),
        )
        parts = {'crank': self.body(crank), 'drawn': drawn, **loop.parts}
        return self.in_assembly(cast('Any', base.kind), loop.ambiguity, **parts)

    def four_bar(self, base: _Base) -> _Loop:
        """Returns what a loop with a rocker adds to its crank."""
        (_, A, B, B0), (_, coupler, rocker) = base.pins, base.bodies
        self.turn(coupler, A, B)
        self.turn(rocker, B0, B)
        parts = {
            'coupler': self.body(coupler, Coupler),
            'rocker': self.body(rocker),
            'frame': Frame(self.at[B0].length, self.at[B0].angle),
        }
        ambiguity = f'{coupler.name} and {rocker.name} are in line at {B}'
        return _Loop(parts, {'B': B, 'B0': B0}, self.at[A].angle, ambiguity)

    def slider_crank(self, base: _Base) -> _Loop:
        """Returns what a loop with a slide on the frame adds to its crank."""
        (_, A, B), (crank, coupler, slide) = base.pins, base.bodies
        self.turn(coupler, A, B)
        direction = slide.direction
        self.axes[slide.name] = _Axes(self.at[B], direction)
        offset = over_root(direction.cross(self.at[B]), direction.dot(direction))
        parts = {
            'coupler': self.body(coupler, Coupler),
            'slider': Slider(offset, slide.part.mass),
            'frame': Guide(direction.angle),
        }
        if self.drawing.input != slide.name:
            return _Loop(parts, {'B': B}, self.at[A].angle, _across(B, coupler, slide))
        position = over_root(direction.dot(self.at[B]), direction.dot(direction))
        ambiguity = f'{crank.name} and {coupler.name} are in line at {A}'
        return _Loop({**parts, 'input': SLIDER}, {'B': B}, position, ambiguity)

    def inverted_slider_crank(self, base: _Base) -> _Loop:
        """Returns what a loop with a slide on a moving link adds to its crank."""
        (A0, A, B0), (crank, barrel, rod) = base.pins, base.bodies
        slide = barrel if barrel.on else rod  # each may be drawn as the body that slides
        arm = self.at[A].minus(self.at[B0])
        direction = _along(slide.direction, arm)  # the rod's position is positive as drawn
        self.axes[barrel.name] = _Axes(self.at[B0], direction)
        self.axes[rod.name] = _Axes(self.at[A], direction)
        parts = {
            'barrel': self.mass(barrel, Barrel),
            'rod': self.mass(rod, Rod),
            'frame': Frame(self.at[B0].length, self.at[B0].angle),
            'offset': over_root(direction.cross(arm), direction.dot(direction)),
        }
        pins = {'B0': B0, 'E': f'{barrel.name}_mouth'}
        # A slide, unlike a cylinder, is drawn as a block.
        slides = {drawn.name for drawn in self.drawing.slides}
        block = slide.name if slide.name in slides else ''
        if self.drawing.input == crank.name:
            ambiguity = f'the line of {slide.name} is at right angles to that from {B0} to {A}'
            return _Loop(parts, pins, self.at[A].angle, ambiguity, block)
        position = over_root(direction.dot(arm), direction.dot(direction))
        ambiguity = f'{A0}, {A} and {B0} are in line'
        return _Loop({**parts, 'input': CYLINDER}, pins, position, ambiguity, block)

    def in_assembly(self, kind: Any, ambiguity: str, **parts: Any) -> Mechanism:
        """Returns the mechanism in the assembly whose links are nearest to the drawn ones.

        Raises:
            ConfigurationError: The drawing does not show the assembly.
        """
        is_driven_by_crank = kind is InvertedSliderCrank and 'input' not in parts
        assemblies = [OPEN] if is_driven_by_crank else [OPEN, CROSSED]
        drawn: Drawn = parts['drawn']
        candidates = list[tuple[float, Mechanism]]()
        for assembly in assemblies:
            mechanism: Mechanism = kind(assembly=assembly, **parts)
            try:
                pose = mechanism.loop().pose((drawn.position,))
            except UnreachableError:
                continue
            (sine,) = pose.sines
            if abs(sine) > _LEAST_SINE:
                candidates.append((self.turned_by(pose, drawn.links), mechanism))
        if candidates:
            _, nearest = min(candidates, key=lambda candidate: candidate[0])
            return nearest
        lengths = [
            x for x in drawn.links if getattr(self.bodies[x].part, 'length', None) is not None
        ]
        if lengths:
            raise ConfigurationError(
                f'with the length given for {" and ".join(lengths)}, {listed(drawn.links)} do not '
                'close where they are drawn; correct length, or draw the machine at another '
                'position'
            )
        raise ConfigurationError(_ambiguous(ambiguity))

    def turned_by(self, pose: Pose, names: Sequence[str]) -> float:
        """Returns how far the directions of links are from the drawn ones, added up."""
        distance = 0.0
        for name, link in zip(names, pose.links, strict=True):
            axis = self.axes[name].direction
            drawn = complex(*axis.rounded) / axis.length
            distance += abs(complex(link.direction.x, link.direction.y) - drawn)
        return distance

    # ------------------------------------------------------------ dyads

    def next_dyad(self, waiting: Mapping[str, _Body]) -> Dyad | None:
        """Returns the dyad with the first name that known bodies hold, and notes its axes.

        Raises:
            ConfigurationError: Known bodies hold a body fast.
        """
        makers = dict[str, Callable[[], Dyad]]()
        for body in waiting.values():
            carried_pins = [pin for pin in body.pins if self.carrier(pin)]
            if len(carried_pins) > 1 or (carried_pins and body.on and self.is_known(body.on)):
                raise ConfigurationError(self.rigid(body, carried_pins))
            for other in waiting.values():
                name = f'{body.name}__{other.name}'
                make = self.dyad_of(name, body, other, carried_pins) if other is not body else None
                if make:
                    makers[name] = make
        return makers[min(makers)]() if makers else None

    def dyad_of(
        self, name: str, first: _Body, last: _Body, carried_pins: list[str]
    ) -> Callable[[], Dyad] | None:
        """Returns the function that makes the dyad of two bodies; None if they are none.

        Known bodies carry `carried_pins` of the first body.
        """
        if len(carried_pins) != 1 or first.on:
            return None
        (start,) = carried_pins
        common = [pin for pin in first.pins if pin in last.pins and not self.carrier(pin)]
        ends = [pin for pin in last.pins if self.carrier(pin)]
        if last.on == first.name and len(ends) == 1:
            return functools.partial(self.with_rod, name, first, last, ends[0], start)
        if len(common) != 1:
            return None
        (joint,) = common
        if last.on and not ends and self.is_known(last.on):
            return functools.partial(self.with_slider, name, first, last, start, joint)
        if not last.on and len(ends) == 1 and first.name < last.name:
            pins = start, joint, ends[0]
            return functools.partial(self.with_two_links, name, (first, last), pins)
        return None

    def with_two_links(
        self, name: str, links: tuple[_Body, _Body], pins: tuple[str, str, str]
    ) -> Dyad:
        """Returns a dyad of two links."""
        (first, last), (start, joint, end) = links, pins
        self.require_motion(links, pins)
        joints = (self.joint(start, first), joint, self.joint(end, last))
        from_, to = self.carrier(start), self.carrier(end)
        from_at, to_at = self.local(from_, start), self.local(to, end)
        self.turn(first, start, joint)
        self.turn(last, end, joint)
        apart = self.at[end].minus(self.at[start])
        of_first, of_last = (self.at[joint].minus(self.at[pin]) for pin in (start, end))
        self.require_side(
            of_first.cross(of_last), of_first, of_last,
            f'{first.name} and {last.name} are in line at {joint}',
        )  # fmt: skip
        return Dyad(
            name=name, from_=from_, from_at=from_at, to=to, to_at=to_at,
            first=self.body(first), second=self.body(last),
            assembly=OPEN if apart.cross(of_first) > 0 else CROSSED,
            names=(first.name, last.name, *joints),
        )  # fmt: skip

    def with_slider(self, name: str, first: _Body, last: _Body, start: str, joint: str) -> Dyad:
        """Returns a dyad of a link and a slide on a known body."""
        self.require_motion((first, last), (start, joint))
        joints = (self.joint(start, first), joint)
        from_ = self.carrier(start)
        from_at = self.local(from_, start)
        self.turn(first, start, joint)
        guide, direction, on_line = self.axes.get(last.on), last.direction, self.at[last.pins[0]]
        origin = Exact(Fraction(0), Fraction(0))  # from which positions are measured
        if guide is not None:
            origin = guide.start
            direction = _along(direction, on_line.minus(origin))
        of_first = self.at[joint].minus(self.at[start])
        side = of_first.dot(direction)
        self.require_side(side, of_first, direction, _across(joint, first, last))
        # The path of the joint is parallel to the line, which is drawn through the first pin.
        zero = origin.foot(on_line, direction).plus(self.at[joint].minus(on_line))
        self.axes[last.name] = _Axes(self.at[joint], direction)
        slider = DyadSlider(last.part.mass, zero.rounded, direction.angle, last.on)
        if guide is not None:
            cosine, sine = guide.direction.dot(direction), guide.direction.cross(direction)
            slider = DyadSlider(
                last.part.mass, self.in_axes(guide, zero), math.atan2(float(sine), float(cosine)),
                last.on, last.part.inertia, self.center(last),
            )  # fmt: skip
        return Dyad(
            name=name, from_=from_, from_at=from_at, first=self.body(first), slider=slider,
            assembly=OPEN if side > 0 else CROSSED,
            names=(first.name, last.name, *joints),
        )  # fmt: skip

    def with_rod(self, name: str, barrel: _Body, rod: _Body, start: str, end: str) -> Dyad:
        """Returns a dyad of a barrel, pinned at `end`, and a rod in it, pinned at `start`."""
        self.require_motion((barrel, rod), (start, end))
        joints = self.joint(start, rod), self.joint(end, barrel)
        from_, to = self.carrier(start), self.carrier(end)
        from_at, to_at = self.local(from_, start), self.local(to, end)
        arm = self.at[start].minus(self.at[end])
        direction = _along(rod.direction, arm)
        self.require_side(
            arm.dot(direction), arm, direction,
            f'the line of {rod.name} is at right angles to that from {end} to {start}',
        )  # fmt: skip
        self.axes[barrel.name] = _Axes(self.at[end], direction)
        self.axes[rod.name] = _Axes(self.at[start], direction)
        return Dyad(
            name=name, from_=from_, from_at=from_at, to=to, to_at=to_at,
            barrel=self.mass(barrel, Barrel), rod=self.mass(rod, Rod),
            # The distance of the start from the barrel's line through the end.
            offset=over_root(direction.cross(arm), direction.dot(direction)),
            names=(barrel.name, rod.name, *joints),
        )  # fmt: skip

    def require_side(self, area: Fraction, first: Exact, last: Exact, where: str) -> None:
        """Rejects a dyad whose drawn position does not show its assembly.

        Raises:
            ConfigurationError: The sine of two directions, with this product, is nearly 0.
        """
        sine = over_root(area, first.dot(first) * last.dot(last))
        if abs(sine) < _LEAST_SINE_OF_DYAD:
            raise ConfigurationError(_ambiguous(where))

    def require_motion(self, bodies: Sequence[_Body], joints: Sequence[str]) -> None:
        """Rejects a loop or a dyad with more joints than those that determine it.

        Args:
            bodies: The bodies of the loop or dyad, which are not known yet.
            joints: Pins that join them, to each other or to known bodies.

        Raises:
            ConfigurationError: There are others, so that nothing can move.
        """
        for body in bodies:
            for pin in body.pins:
                others = [x.name for x in bodies if pin in x.pins and x.name != body.name]
                if carrier := self.carrier(pin):
                    others.append(carrier)
                most = 1 if pin in joints else 0
                if len(others) > most:
                    held = ', '.join(x for x in body.pins if x in joints and x != pin)
                    raise ConfigurationError(self.locked(body, held, pin, others[-1]))
        names = [body.name for body in bodies]
        sliding = [body for body in self.bodies.values() if self.slides_among(body, names)]
        # A loop has four joints, a dyad three.
        if len(joints) + len(sliding) > len(bodies) + 1:
            lines = ' and '.join(f'{body.name} slides on {body.on}' for body in sliding)
            raise ConfigurationError(
                f'{lines}, while {listed(names)} are joined at {", ".join(joints)}, so that '
                f'nothing can move; leave out one of the slides, or a pin; {self.freedom()}'
            )

    def slides_among(self, body: _Body, names: Sequence[str]) -> bool:
        """Returns whether a body slides on another; both are named, or one is known instead."""
        if body.name in names:
            return body.on in names or self.is_known(body.on)
        return body.on in names and self.is_known(body.name)

    # ------------------------------------------------------------ bodies and pins

    def is_known(self, body: str) -> bool:
        """Returns whether the motion of a body is known."""
        return body == FRAME_NAME or body in self.axes

    def carrier(self, pin: str) -> str:
        """Returns the first known body that has a pin, 'frame' if it is fixed, or ''."""
        if pin in self.drawing.frame:
            return FRAME_NAME
        return next((name for name in self.axes if pin in self.bodies[name].pins), '')

    def joint(self, pin: str, body: _Body) -> str:
        """Returns the name of the joint by which a pin carries a further body."""
        carrier = self.carrier(pin)
        others = (name for name in self.axes if pin in self.bodies[name].pins)
        is_first = not [name for name in others if name != carrier]
        return pin if is_first else f'{pin}_{body.name}'

    def turn(self, body: _Body, start: str, end: str) -> None:
        """Notes the axes of a link that is carried at one pin and closes its group at another."""
        direction = self.at[end].minus(self.at[start])
        given = getattr(body.part, 'length', None)
        length = direction.length if given is None else float(Fraction(repr(given)) * self.unit)
        self.axes[body.name] = _Axes(self.at[start], direction, end, length)

    def in_axes(self, axes: _Axes, place: Exact) -> tuple[float, float]:
        """Returns a place [along, across] in the axes of a body, m."""
        apart, direction = place.minus(axes.start), axes.direction
        square = direction.dot(direction)
        return over_root(apart.dot(direction), square), over_root(direction.cross(apart), square)

    def local(self, body: str, pin: str) -> tuple[float, float]:
        """Returns a pin [along, across] on a body, m; on the frame in base_link."""
        if body == FRAME_NAME:
            return self.at[pin].rounded
        axes = self.axes[body]
        return (axes.length, 0.0) if pin == axes.end else self.in_axes(axes, self.at[pin])

    def center(self, body: _Body) -> tuple[float, float]:
        """Returns the centre of mass [along, across] of a body, m."""
        if body.part.center is None:
            return 0.0, 0.0
        place = Exact.of(body.part.center, self.unit).minus(self.origin)
        return self.in_axes(self.axes[body.name], place)

    def body(self, body: _Body, kind: Any = Body) -> Any:
        """Returns a link as a part of a mechanism."""
        return self.mass(body, kind, length=self.axes[body.name].length)

    def mass(self, body: _Body, kind: Any, **others: Any) -> Any:
        """Returns a body as a part of a mechanism."""
        part = body.part
        return kind(mass=part.mass, inertia=part.inertia, center=self.center(body), **others)

    def points(self) -> Iterator[TracedPoint]:
        """Yields the pins of one link alone, as points of it."""
        for pin in self.at:
            owners = [body.name for body in self.bodies.values() if pin in body.pins]
            if len(owners) == 1 and pin not in self.drawing.frame:
                yield TracedPoint(pin, owners[0], self.local(owners[0], pin))

    def place(self, body: str, at: tuple[float, float]) -> tuple[float, float]:
        """Returns a place [along, across] on a body, m, given as drawn."""
        place = Exact.of(at, self.unit).minus(self.origin)
        return place.rounded if body == FRAME_NAME else self.in_axes(self.axes[body], place)

    def as_solved(self, load: Any) -> Any:
        """Returns a load or a point with its places in the axes of its links, not as drawn."""
        if getattr(load, 'cylinder', ''):
            load = self.between_pins(load)
        changes: dict[str, Any] = {}
        for link, at, pin in place_words(load):
            body = getattr(load, link)
            if given_pin := getattr(load, pin, ''):
                is_default = link == 'to' and body == FRAME_NAME
                if is_default or not body:
                    body = self.carrier(given_pin)
                changes |= {link: body, at: self.local(body, given_pin), pin: ''}
            elif body:
                changes[at] = self.place(body, getattr(load, at))
        return replace(load, **changes) if changes else load

    def between_pins(self, load: Any) -> Any:
        """Returns the load of a cylinder as one between its pins, a moving one first."""
        (cylinder,) = (x for x in self.drawing.cylinders if x.name == load.cylinder)
        pin, to_pin = cylinder.from_, cylinder.to
        if pin in self.drawing.frame:
            pin, to_pin = to_pin, pin
        return replace(load, cylinder='', pin=pin, to_pin=to_pin, to=FRAME_NAME)

    # ------------------------------------------------------------ refusals

    def no_base(self, driven: _Body) -> str:
        """Explains why the input is in no loop that can be the mechanism."""
        what = f'drawing.input = {shown(self.drawing.input)}'
        fixed, guide = self.pivots(driven), self.bodies.get(driven.on)
        if not driven.on and len(fixed) != 1:
            pins = ' and '.join(fixed) or 'no fixed pin'
            return (
                f'{what}: it must turn about exactly one fixed pin, and has {pins}; correct '
                'drawing.frame, or choose another input'
            )
        if guide and not (fixed or self.pivots(guide)):
            return (
                f'{what}: both of its ends are on moving links; what drives must be held by a '
                'fixed pin, so add one of its pins to drawing.frame, or choose another input'
            )
        floating = self.cylinder_on_floating_link()
        return floating or self.two_slides(driven) or self.wrong_neighbour(driven) or (
            f'{what}: it is in no loop of four links, or of three and a slide, that returns to '
            f'the frame at another pin, so that its motion does not follow link by link; '
            f'compare drawing.frame and the pins of {listed(self.bodies)}, or drive another '
            f'link; {self.freedom()}'
        )  # fmt: skip

    def cylinder_on_floating_link(self) -> str:
        """Explains that the input is a cylinder at a link without a fixed pin; '' if not."""
        name = self.drawing.input
        if all(cylinder.name != name for cylinder in self.drawing.cylinders):
            return ''
        own = f'{name}_barrel', f'{name}_rod'
        bodies = [body for body in self.bodies.values() if body.name not in own]
        moved = [x.name for x in bodies for end in own if {*x.pins} & {*self.bodies[end].pins}]
        held = [body.name for body in bodies if not body.on and len(self.pivots(body)) == 1]
        if not moved or not held or {*moved} & {*held}:
            return ''
        return (
            f'drawing.input = {shown(name)}: {moved[0]}, which it moves, has no fixed pin, so '
            'that the motion does not follow link by link; drive '
            f'{" or ".join(held)} by a law instead: '
            f'without friction, the force of {name} is driving_torque / its leverage'
        )

    def two_slides(self, driven: _Body) -> str:
        """Explains that a link joins the driven slide to another slide on the frame; or ''."""
        if driven.on != FRAME_NAME:
            return ''
        for other in (x for pin in driven.pins for x in self.at_pin(pin, driven)):
            ends = [x for pin in other.pins for x in self.at_pin(pin, driven, other)]
            second = next((x.name for x in ends if x.on == FRAME_NAME), '')
            if second:
                return (
                    f'{other.name} joins the slides {driven.name} and {second}: two slides on '
                    f'the frame are not supported; a long link instead of {second}, on a pin '
                    'of the frame far away, comes near its motion'
                )
        return ''

    def wrong_neighbour(self, driven: _Body) -> str:
        """Explains that a body at a pin of the driven link closes no loop; or ''."""
        fixed = self.pivots(driven)
        joined = [(pin, other) for pin in driven.pins for other in self.at_pin(pin, driven)]
        for pin, other in () if driven.on else joined:
            if other.on == FRAME_NAME:
                return (
                    f'{other.name} slides on the frame and has the pin {pin} of {driven.name}, so '
                    f'that neither can move; if it slides in a slot of a link, write on: LINK'
                )
            if other_fixed := self.pivots(other, *fixed):
                return (
                    f'{other.name} joins {driven.name} at {pin} to the fixed pin '
                    f'{other_fixed[0]}, so that neither can move; correct the pins of one, or '
                    'drawing.frame'
                )
            if other.on in self.bodies and self.bodies[other.on].on:
                return (
                    f'{other.name} slides on {other.on}, which slides too: a Scotch yoke is not '
                    f'supported; a long link from {pin} to {other.on} comes near its motion'
                )
        return ''

    def locked(self, body: _Body, held: str, pin: str, other: str) -> str:
        """Explains that a body of a loop or dyad has one joint too many."""
        also, cure = f'{pin}, which {other} has, too', f'leave {pin} out of one of them'
        if other == FRAME_NAME:
            also, cure = f'the fixed pin {pin}', f'take {pin} out of drawing.frame or {body.name}'
        return f'{body.name} has {held} and {also}: nothing can move; {cure}; {self.freedom()}'

    def rigid(self, body: _Body, pins: Sequence[str]) -> str:
        """Explains that known bodies hold a body fast."""
        carriers = ' and '.join(dict.fromkeys(self.carrier(pin) for pin in pins))
        also = f' and slides on {body.on}' if body.on and self.is_known(body.on) else ''
        return (
            f'{body.name} joins {carriers} at {" and ".join(pins)}{also}, but their motion is '
            f'already determined by {listed(self.axes)}, so that nothing can move; leave out '
            f'{body.name}, one of its pins, or another link; {self.freedom()}'
        )

    def unsolved(self, waiting: Mapping[str, _Body]) -> str:
        """Explains which bodies are left."""
        why = 'no two of these hang as a pair on the other links, so that they are not determined'
        if self.degrees == 1:
            why = 'these can only be found together, not pair after pair, which is not supported'
        return f'{listed(waiting)}: {why}; {self.freedom()}'

    @property
    def degrees(self) -> int:
        """The number of degrees of freedom, counted by links and joints."""
        joints = sum(1 for body in self.bodies.values() if body.on)
        for pin in self.at:
            count = sum(pin in body.pins for body in self.bodies.values())
            joints += max(0, count - 1 + (pin in self.drawing.frame))
        return 3 * len(self.bodies) - 2 * joints

    def freedom(self) -> str:
        """Describes the number of degrees of freedom."""
        free = self.degrees
        return (
            f'counted by links and joints the drawing has {free} degree'
            f'{"" if free == 1 else "s"} of freedom'
            f'{"" if free == 1 else ", where 1 is needed"}'
        )
