# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Finds the mistakes in a drawing, all at once, before it is converted.

A value that was rejected is UNKNOWN here, and a misspelt pin counts as the pin that it resembles.
A mistake that may only follow from another one is not reported.
"""

import itertools
import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import fields
from typing import Any, NamedTuple

from linkage_ros.mechanism.exact import UNITS, Exact
from linkage_ros.mechanism.parts import FRAME_NAME
from linkage_ros.quantities import BOOLEANS, UNKNOWN, did_you_mean, resembling, shown

_NAME = '[A-Za-z](_?[A-Za-z0-9])*_?'  # without two underscores in succession
_RESERVED = {FRAME_NAME, 'world', 'base_link'}
# A pin that is so far from the others, or so near to the origin, is probably in another unit;
# relative to the size of the others.
_FAR, _NEAR = 10.0, 0.01
# A length that differs from the drawn one by more than this share of it is probably a mistake.
_OFF = 0.3


def listed(names: Iterable[str]) -> str:
    """Returns names for an error message."""
    return ', '.join(sorted(names)) or 'none'


class _Part(NamedTuple):
    """A link, slide or cylinder of a drawing, or its frame.

    Attributes:
        label: Name of its parameters.
        part: A `DrawnLink`, `DrawnSlide` or `DrawnCylinder`; None for the frame.
        pins: Its pins, each as it is meant.
        is_certain: Whether it has no others.
    """

    label: str
    part: Any
    pins: tuple[str, ...]
    is_certain: bool


class Outline:
    """The parts of a drawing and their pins, as far as they are certain.

    Attributes:
        drawing: The drawing.
        mistakes: The mistakes in the lists of pins.
        frame: The frame.
        links: The links.
        slides: The slides.
        cylinders: The cylinders.
        names: Names of links, slides and cylinders.
        input: Name of the driven one; empty if that is not certain.
        guides: Name of the body on which each slide slides, 'frame', or '', by the slide's name.
        is_certain: Whether all pins, guides and the input are certain.
    """

    def __init__(self, drawing: Any) -> None:
        """Reads the lists of pins.

        Args:
            drawing: A `drawing.Drawing`.
        """
        self.drawing, self.mistakes = drawing, list[str]()
        lists = [
            ('drawing.frame', None, drawing.frame),
            *((f'drawing.links.{x.name}', x, x.pins) for x in drawing.links),
            *((f'drawing.slides.{x.name}', x, x.all_pins) for x in drawing.slides),
            *((f'drawing.cylinders.{x.name}', x, (x.from_, x.to)) for x in drawing.cylinders),
        ]
        given = [{*pins} - {UNKNOWN} for *_, pins in lists if pins is not UNKNOWN]
        uses = Counter(pin for pins in given for pin in pins)
        # A pin that several parts have is forgotten rather than misspelt.
        self._forgotten = [x for x in uses if x not in drawing.pins and uses[x] > 1]
        self.frame, *others = (self._read(*x) for x in lists)
        counts = len(drawing.links), len(drawing.slides)
        self.links, others = others[: counts[0]], others[counts[0] :]
        self.slides, self.cylinders = others[: counts[1]], others[counts[1] :]
        for name in self._forgotten:
            having = ', '.join(x.label for x in (self.frame, *self.parts) if name in x.pins)
            self.mistakes.append(
                f'drawing.pins.{name} is missing, a pin of {having}: write its place [x, y]'
                f'{did_you_mean(name, drawing.pins)}'
            )
        self.names = [x.part.name for x in self.parts]
        self.input = self._known(drawing.input, self.names)
        bodies = [FRAME_NAME, *(x.part.name for x in (*self.links, *self.slides))]
        self.guides = {
            x.name: self._known(x.on, [body for body in bodies if body != x.name])
            for x in drawing.slides
        }
        self.is_certain = (
            bool(self.input) and all(self.guides.values()) and self.frame.is_certain
            and all(x.is_certain and len(x.pins) >= self.least(x.part) for x in self.parts)
        )  # fmt: skip

    @property
    def parts(self) -> list[_Part]:
        """The links, slides and cylinders."""
        return [*self.links, *self.slides, *self.cylinders]

    @property
    def bodies(self) -> dict[str, tuple[str, ...]]:
        """The pins of each body by its name; a driven cylinder is two bodies."""
        found = {x.part.name: x.pins for x in (*self.links, *self.slides)}
        for _, cylinder, pins, _ in self.cylinders:
            if cylinder.name == self.input:
                ends = f'{cylinder.name}_barrel', f'{cylinder.name}_rod'
                found |= {name: pins[i : i + 1] for i, name in enumerate(ends)}
        return found

    def least(self, part: Any) -> int:
        """Returns the number of pins that a part needs at least."""
        names = [x.part.name for x in self.links]
        return 2 - (part.name in self.guides.values()) if part.name in names else 1

    def _known(self, name: Any, names: Sequence[str]) -> str:
        """Returns a name, or one that it resembles, or ''."""
        return name if name in names or name is UNKNOWN else resembling(name, names)

    def _read(self, label: str, part: Any, given: Any) -> _Part:
        """Reads the pins of a part, and notes the mistakes."""
        if given is UNKNOWN:
            return _Part(label, part, (), is_certain=False)
        names = [name for name in given if name is not UNKNOWN]
        if len({*names}) < len(names):
            self.mistakes.append(f'{label} names one pin twice: {", ".join(names)}; leave one out')
        found = [*filter(None, (self._meant(label, name, names) for name in dict.fromkeys(names)))]
        return _Part(label, part, (*found,), is_certain=len(found) == len(given))

    def _meant(self, label: str, name: str, others: Sequence[str]) -> str:
        """Returns the pin that is meant by a name, or ''."""
        pins = self.drawing.pins
        if name in pins or name in self._forgotten:
            return name
        meant = resembling(name, [pin for pin in pins if pin not in others])
        cure = f'; did you mean {meant}?' if meant else (
            f', which has {listed(pins)}; correct the name, or write its place there'
        )  # fmt: skip
        self.mistakes.append(f'{label}: no pin {shown(name)} in drawing.pins{cure}')
        return meant


def mistakes_of(drawing: Any) -> Iterator[str]:
    """Yields the mistakes in a drawing, and in its values that are probably mistakes.

    Args:
        drawing: A `drawing.Drawing`.
    """
    outline = Outline(drawing)
    checks = [
        _bad_names, _bad_input, _bad_lists, _bad_lengths, _bad_pins, _bad_slides, _bad_cylinders,
        _bad_centers, _rigid_pairs,
    ]  # fmt: skip
    if outline.is_certain:  # else, the pin of another part may be the one that is missing
        checks.append(_loose_parts)
    found = [problem for find in checks for problem in find(outline)]
    if found:
        found += contradictions(drawing)
    yield from found


def mistakes_of_places(drawing: Any, loads: Any, points: Any) -> Iterator[str]:
    """Yields the mistakes in the places of loads and points on a drawing.

    Args:
        drawing: A `drawing.Drawing`.
        loads: The loads; UNKNOWN if they were rejected, as for the points.
        points: The traced points.
    """
    outline = Outline(drawing)
    for load in () if loads is UNKNOWN else loads:
        label, kinds = load.label, {x.name: x.metadata.get('quantity') for x in fields(load)}
        if cylinder := getattr(load, 'cylinder', ''):
            yield from _bad_cylinder_of_load(outline, f'{label}.cylinder', cylinder)
            continue
        for link, at, pin in (('link', 'at', 'pin'), ('to', 'to_at', 'to_pin')):
            if (
                link in kinds and getattr(kinds.get(at), 'kind', '') == 'pair'
            ):  # a curve has a list
                name, place = getattr(load, link), getattr(load, at)
                yield from _bad_place(
                    outline, (f'{label}.{link}', f'{label}.{at}', pin), name, place,
                    getattr(load, pin),
                )  # fmt: skip
    for point in () if points is UNKNOWN else points:
        label = f'points.{point.name}'
        yield from _bad_place(
            outline, (f'{label}.link', f'{label}.at', ''), point.link, point.at, ''
        )


def _bad_cylinder_of_load(outline: Outline, label: str, name: str) -> Iterator[str]:
    """Yields the mistake in the cylinder of a load."""
    names = [x.part.name for x in outline.cylinders if x.part.name != outline.input]
    if not names:
        yield (
            f'{label} = {shown(name)}: the drawing has no cylinder besides the input; add '
            f'drawing.cylinders.{name}: {{from: PIN, to: PIN}}'
        )
    elif name not in names:
        yield f'{label} = {shown(name)}: must be one of {listed(names)}{did_you_mean(name, names)}'


def _bad_place(
    outline: Outline, labels: tuple[str, str, str], link: str, at: Any, pin: str
) -> Iterator[str]:
    """Yields the mistake in a place of a load or a point.

    Args:
        outline: The drawing.
        labels: Names of the parameters of link and place, and the word for a pin.
        link: Name of the link; empty if there is none.
        at: Place on the link.
        pin: Name of the pin instead; empty if there is none.
    """
    label, label_at, word = labels
    pins, bodies = outline.drawing.pins, {FRAME_NAME: outline.frame.pins, **outline.bodies}
    own = '' if word == 'to_pin' and link == FRAME_NAME else link  # the default
    owners = [name for name, having in bodies.items() if pin in having]
    if pin:
        label = label_at.replace(label_at.rpartition('.')[2], word)
        if pin not in pins:
            hint = did_you_mean(pin, pins)
            yield f'{label}: no pin {shown(pin)}; must be one of {listed(pins)}{hint}'
        elif own and own not in owners and owners:
            yield (
                f'{label}: no link {shown(own)} at the pin {pin}; must be one of {listed(owners)}'
            )
    elif link and link not in bodies:
        yield (
            f'{label} = {shown(link)}: must be one of {listed(bodies)}{did_you_mean(link, bodies)}'
        )
    elif link and at is None:
        instead = f', or {word}' if word else ''
        yield f'{label_at} is missing: give the place on {link} as drawn{instead}'


def contradictions(drawing: Any) -> list[str]:
    """Returns a line for each pin in another unit, and for each length unlike the drawn one."""
    places = {pin: place for pin, place in drawing.pins.items() if place is not UNKNOWN}
    if drawing.units is UNKNOWN or len(places) < 3:
        return []
    found = _pins_in_another_unit(drawing.units, places)
    for link in drawing.links:
        pins = () if link.pins is UNKNOWN else link.pins
        ends: list[Any] = [places.get(pin) for pin in pins]
        if link.length in {None, UNKNOWN} or len(ends) != 2 or None in ends:
            continue
        (one, other), apart = link.pins, math.dist(*ends)
        if abs(link.length - apart) > _OFF * apart:
            found.append(
                f'drawing.links.{link.name}.length = {link.length:g}, but {one} and {other} are '
                f'drawn {apart:.6g} {drawing.units} apart: correct it, or draw them so'
            )
    return found


def _pins_in_another_unit(unit: str, places: Mapping[str, Sequence[float]]) -> list[str]:
    """Returns a line for each pin that is among the others only if it is in m, or else in mm.

    If there are many, they may be right, and another pin wrong; none is returned then.
    """
    metre = float(UNITS[unit])
    if unit == 'in':  # too near to m: by chance, a right pin may be among the others, too
        return []
    other, factor = ('mm', float(UNITS['mm'])) if unit == 'm' else ('m', 1 / metre)
    found = []
    for name, place in places.items():
        rest = [x for pin, x in places.items() if pin != name]
        low, high = ([end(column) for column in zip(*rest, strict=True)] for end in (min, max))
        size, meant = math.dist(low, high), [factor * x for x in place]
        is_alone = _outside(place, low, high) > _FAR * size
        is_at_origin = factor > 1 and 0 < max(map(abs, place)) < _NEAR * size
        if (is_alone or is_at_origin) and _outside(meant, low, high) < 0.5 * size:
            found.append(
                f'drawing.pins.{name} = [{place[0]:g}, {place[1]:g}] {unit}; did you mean {other} '
                f'= [{meant[0]:.6g}, {meant[1]:.6g}] {unit}?'
            )
    return found if len(found) <= max(1, len(places) // 3) else []


def _outside(place: Sequence[float], low: Sequence[float], high: Sequence[float]) -> float:
    """Returns by how much a place is outside a box."""
    return max(max(x - z, y - x, 0.0) for x, y, z in zip(place, low, high, strict=True))


# ---------------------------------------------------------------- checks


def _bad_names(outline: Outline) -> Iterator[str]:
    seen = dict[str, str]()
    names = [(f'drawing.pins.{name}', name) for name in outline.drawing.pins]
    parts = [(x.label, x.part.name) for x in outline.parts]
    for label, name in (*names, *parts):
        if name.lower() in BOOLEANS:
            yield f'{label}: ROS reads {name} as a boolean; choose another name'
        elif name in _RESERVED or not re.fullmatch(_NAME, name):
            yield (
                f'{label}: a name must be letters, digits and single underscores, begin with a '
                f'letter, and be none of {", ".join(sorted(_RESERVED))}'
            )
    for label, name in parts:
        if name in seen:
            yield f'{label} has the name of {seen[name]}: rename one'
        seen[name] = label


def _bad_input(outline: Outline) -> Iterator[str]:
    given, names = outline.drawing.input, outline.names
    if given is not UNKNOWN and given not in names:
        is_pin = given in outline.drawing.pins
        hint = '; that is a pin' if is_pin else did_you_mean(given, names)
        yield f'drawing.input = {shown(given)}: must be one of {listed(names)}{hint}'


def _bad_lists(outline: Outline) -> Iterator[str]:
    """Yields the mistakes in the lists of pins."""
    yield from outline.mistakes
    for label, part, pins, is_certain in outline.links:
        if is_certain and len(pins) < outline.least(part):
            yield f'{label}.pins = {list(pins)}: a link needs two pins or more'


def _bad_lengths(outline: Outline) -> Iterator[str]:
    guiding = {on: name for name, on in outline.guides.items()}
    for label, link, pins, is_certain in outline.links:
        why = f'it has {len(pins)} pins' if is_certain and len(pins) > 2 else ''
        if link.name in guiding:
            why = f'{guiding[link.name]} slides on it'
        if why and link.length not in {None, UNKNOWN}:
            yield (
                f'{label}.length is for a link of two pins without a slide on it, but {why}: '
                'leave it out, and draw its pins where they are'
            )


def _bad_pins(outline: Outline) -> Iterator[str]:
    """Yields the mistakes in the pins themselves."""
    pins, parts = outline.drawing.pins, [outline.frame, *outline.parts]
    used = {pin for x in parts for pin in x.pins}
    for pin in sorted({*pins} - used) if all(x.is_certain for x in parts) else ():
        yield (
            f'drawing.pins.{pin}: neither the frame nor a link has this pin; add it to one, or '
            'leave it out'
        )
    places = dict[Exact, str]()
    for pin, pair in pins.items():
        other = pin if pair is UNKNOWN else places.setdefault(Exact.of(pair), pin)
        if other != pin:
            yield (
                f'drawing.pins.{pin} is at the same place as {other}: write one pin that all '
                'their links share, or draw the machine at another position'
            )


def _bad_slides(outline: Outline) -> Iterator[str]:
    names = [x.part.name for x in (*outline.links, *outline.slides)]
    for label, slide, pins, _ in outline.slides:
        if bool(slide.pin) == bool(slide.pins):
            yield f'{label}: give pin, or pins for several'
        if slide.direction == (0.0, 0.0):
            yield f'{label}.direction = [0, 0]: must be a direction, such as [1.0, 0.0]'
        valid = [FRAME_NAME, *(name for name in names if name != slide.name)]
        if slide.on is not UNKNOWN and slide.on not in valid:
            hint = did_you_mean(slide.on, valid)
            yield f'{label}.on = {shown(slide.on)}: must be one of {listed(valid)}{hint}'
        for pin in pins if slide.on == FRAME_NAME else ():
            if pin in outline.frame.pins:
                yield f'{label} has the fixed pin {pin}: take {pin} out of drawing.frame'


def _bad_cylinders(outline: Outline) -> Iterator[str]:
    for label, cylinder, *_ in outline.cylinders:
        masses = {'barrel': cylinder.barrel, 'rod': cylinder.rod}
        heavy = [name for name, part in masses.items() if part.mass or part.inertia]
        if heavy and outline.input and cylinder.name != outline.input:
            yield (
                f'{label}.{" and ".join(heavy)}: only the input has a barrel and a rod with '
                'masses; leave them out, or draw a link, and a slide on it'
            )


def _bad_centers(outline: Outline) -> Iterator[str]:
    for label, part, pins, _ in outline.links:
        yield from _bad_center(outline, label, part, pins)
    for label, slide, pins, _ in outline.slides:
        on = outline.guides[slide.name]
        if on == FRAME_NAME and slide.center is not None:
            yield f'{label}.center: on the frame it is the pin; leave it out'
        elif on and on != FRAME_NAME:
            yield from _bad_center(outline, label, slide, pins)
    for label, cylinder, pins, _ in outline.cylinders:
        yield from _bad_center(outline, f'{label}.barrel', cylinder.barrel, pins[:1])
        yield from _bad_center(outline, f'{label}.rod', cylinder.rod, pins[1:])


def _bad_center(outline: Outline, label: str, body: Any, pins: Sequence[str]) -> Iterator[str]:
    """Yields the mistake in the centre of mass of a body."""
    if not body.mass or body.center is not None:
        return
    places = [outline.drawing.pins.get(pin, UNKNOWN) for pin in pins]
    proposal = ''
    if places and UNKNOWN not in places:
        middle = [math.fsum(row) / len(row) for row in zip(*places, strict=True)]
        proposal = f'; the middle of its pins is center: {[float(f"{x:.6g}") for x in middle]}'
    yield f'{label} has a mass and no center: give it as drawn{proposal}'


def _rigid_pairs(outline: Outline) -> Iterator[str]:
    """Yields a message for each link on two fixed pins, and for two parts that are one body."""
    for label, _, pins, _ in outline.links:
        fixed = [pin for pin in pins if pin in outline.frame.pins]
        if len(fixed) > 1:
            yield (
                f'{label} has {" and ".join(fixed)} of drawing.frame, so that it cannot move: '
                'correct its pins or drawing.frame, or leave it out'
            )
    for one, other in itertools.combinations(outline.links, 2):
        common = [pin for pin in one.pins if pin in other.pins]
        if len(common) > 1:
            yield (
                f'{one.part.name} and {other.part.name} share the pins {" and ".join(common)}, so '
                'that they are one rigid link: give both as one link, or leave out a pin'
            )
    pins_of = {x.part.name: x.pins for x in outline.links}
    for label, slide, pins, _ in outline.slides:
        on = outline.guides[slide.name]
        for pin in (x for x in pins if x in pins_of.get(on, ())):
            yield (
                f'{label} has {pin}, a pin of {on}, on which it slides, so that it cannot move: '
                f'take {pin} out of {on}, or correct on'
            )


def _loose_parts(outline: Outline) -> Iterator[str]:
    """Yields a message for each part that fewer than two joints hold."""
    moving, held = [*outline.links, *outline.slides], {*outline.frame.pins}
    held |= {pin for x in moving for pin in x.pins}
    for label, _, pins, _ in outline.cylinders:
        for pin in (x for x in pins if x not in held):
            yield f'{label}: no link has its pin {pin}; add it to a link or to drawing.frame'
    driven = [x for x in outline.cylinders if x.part.name == outline.input]
    counts = Counter(pin for x in (outline.frame, *moving, *driven) for pin in x.pins)
    for label, part, pins, _ in moving:
        joined = [pin for pin in pins if counts[pin] > 1]
        single = [pin for pin in pins if pin not in joined]
        slides = part.name in outline.guides
        joints = len(joined) + slides + [*outline.guides.values()].count(part.name)
        if joints < 2:
            how = 'by its line alone' if slides else 'nowhere'
            how = f'at {joined[0]} alone' if joined else how
            yield (
                f'{label} is joined to the others {how}: no other link has its '
                f'{" or ".join(single)}; add {"it" if len(single) == 1 else "one"} to another '
                'link or to drawing.frame, or leave this one out'
            )
