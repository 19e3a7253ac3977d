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
_UNIT_NAMES = {'m': 'metres', 'mm': 'millimetres'}
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
        pins: Names of its pins, misspelt ones corrected.
        is_certain: Whether all its pins are known.
    """

    label: str
    part: Any
    pins: tuple[str, ...]
    is_certain: bool


class Outline:
    """The parts of a drawing and their pins, as far as they are certain.

    Attributes:
        drawing: The drawing.
        forgotten: Pins without a place that several parts have: they are not misspelt.
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
        """Reads the lists of pins of a `drawing.Drawing`."""
        self.drawing, self.mistakes = drawing, list[str]()
        links = [(f'drawing.links.{x.name}', x, x.pins) for x in drawing.links]
        slides = [(f'drawing.slides.{x.name}', x, x.all_pins) for x in drawing.slides]
        cylinders = [
            (f'drawing.cylinders.{x.name}', x, (x.from_, x.to)) for x in drawing.cylinders
        ]
        lists = [drawing.frame, *(pins for _, _, pins in (*links, *slides, *cylinders))]
        pins_of_parts = [{*pins} - {UNKNOWN} for pins in lists if pins is not UNKNOWN]
        uses = Counter(pin for pins in pins_of_parts for pin in pins)
        self.forgotten = [pin for pin in uses if pin not in drawing.pins and uses[pin] > 1]
        self.frame = self._read('drawing.frame', None, drawing.frame)
        self.links = [self._read(*link) for link in links]
        self.slides = [self._read(*slide) for slide in slides]
        self.cylinders = [self._read(*cylinder) for cylinder in cylinders]
        self.names = [x.part.name for x in self.parts]
        self.input = self._known(drawing.input, self.names)
        bodies = [FRAME_NAME, *(x.part.name for x in (*self.links, *self.slides))]
        self.guides = dict[str, Any]()
        for slide in drawing.slides:
            others = [body for body in bodies if body != slide.name]
            self.guides[slide.name] = self._known(slide.on, others)
        has_all_pins = self.frame.is_certain and all(
            x.is_certain and len(x.pins) >= self.least(x.part) for x in self.parts
        )
        self.is_certain = bool(self.input) and all(self.guides.values()) and has_all_pins

    @property
    def parts(self) -> list[_Part]:
        """The links, slides and cylinders."""
        return [*self.links, *self.slides, *self.cylinders]

    @property
    def bodies(self) -> dict[str, tuple[str, ...]]:
        """The pins of each body by its name; a driven cylinder is two bodies."""
        pins_of = {x.part.name: x.pins for x in (*self.links, *self.slides)}
        for _, cylinder, pins, _ in self.cylinders:
            if cylinder.name == self.input:
                ends = f'{cylinder.name}_barrel', f'{cylinder.name}_rod'
                pins_of |= {name: pins[i : i + 1] for i, name in enumerate(ends)}
        return pins_of

    @property
    def single_pins(self) -> list[str]:
        """The pins that one link or slide alone has, and the frame has not."""
        counts = Counter(pin for pins in self.bodies.values() for pin in pins)
        pins = [pin for pin in self.drawing.pins if pin not in self.frame.pins]
        return [pin for pin in pins if counts[pin] == 1]

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
        meant = (self._meant(label, name, names) for name in dict.fromkeys(names))
        pins = tuple(pin for pin in meant if pin)
        return _Part(label, part, pins, is_certain=len(pins) == len(given))

    def _meant(self, label: str, name: str, others: Sequence[str]) -> str:
        """Returns the pin that is meant by a name, or ''."""
        pins = self.drawing.pins
        if name in pins or name in self.forgotten:
            return name
        meant = resembling(name, [pin for pin in pins if pin not in others])
        cure = f'; did you mean {meant}?' if meant else (
            f', which has {listed(pins)}; correct the name, or write its place there'
        )  # fmt: skip
        self.mistakes.append(f'{label}: no pin {shown(name)} in drawing.pins{cure}')
        return meant


def mistakes_of(drawing: Any) -> Iterator[str]:
    """Yields the mistakes in a `drawing.Drawing`, and its values that are probably mistakes."""
    outline = Outline(drawing)
    checks = [
        _bad_names, _bad_input, _bad_lists, _bad_lengths, _bad_pins, _bad_slides, _bad_cylinders,
        _bad_centers, _rigid_pairs,
    ]  # fmt: skip
    if outline.is_certain:  # else, the pin of another part may be the one that is missing
        checks.append(_loose_parts)
    mistakes = [words for check in checks for words in check(outline)]
    yield from mistakes
    if mistakes:
        yield from contradictions(drawing)


def mistakes_of_places(drawing: Any, loads: Any, points: Any) -> Iterator[str]:
    """Yields the mistakes in the places of loads and points on a `drawing.Drawing`.

    The loads are UNKNOWN if they were rejected, and likewise the points.
    """
    outline = Outline(drawing)
    for load in () if loads is UNKNOWN else loads:
        if cylinder := getattr(load, 'cylinder', ''):
            yield from _bad_cylinder_of_load(outline, f'{load.label}.cylinder', cylinder)
            continue
        for words in place_words(load):
            values = (getattr(load, word) for word in words)
            yield from _bad_place(outline, load.label, words, *values)
    for point in () if points is UNKNOWN else points:
        label, words = f'points.{point.name}', PlaceWords('link', 'at', '')
        yield from _bad_place(outline, label, words, point.link, point.at, '')


class PlaceWords(NamedTuple):
    """The parameters of a place of a load or a point: its link, the place on it, or a pin."""

    link: str
    at: str
    pin: str


def place_words(load: Any) -> list[PlaceWords]:
    """Returns the parameters of the places of a load."""
    kinds = {x.name: getattr(x.metadata.get('quantity'), 'kind', '') for x in fields(load)}
    words = PlaceWords('link', 'at', 'pin'), PlaceWords('to', 'to_at', 'to_pin')
    # A curve has a list of angles or positions.
    return [x for x in words if x.link in kinds and kinds.get(x.at) == 'pair']


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
    outline: Outline, label: str, words: PlaceWords, link: str, at: Any, pin: str
) -> Iterator[str]:
    """Yields the mistake in a place of a load or a point, given by a link or a pin, or both."""
    bodies = {FRAME_NAME: outline.frame.pins, **outline.bodies}
    is_second_end = words.link == 'to'
    if not is_second_end:  # a force on the frame does nothing, and a point of it does not move
        del bodies[FRAME_NAME]
    pins = outline.drawing.pins
    owners = [name for name, own_pins in bodies.items() if pin in own_pins]
    is_default = is_second_end and link == FRAME_NAME
    if pin and pin not in pins:
        hint = did_you_mean(pin, pins)
        yield f'{label}.{words.pin}: no pin {shown(pin)}; must be one of {listed(pins)}{hint}'
    elif pin and link:
        if owners and link not in owners and not is_default:
            yield (
                f'{label}.{words.pin}: no link {shown(link)} at the pin {pin}; must be one of '
                f'{listed(owners)}'
            )
    elif pin:
        if pin in outline.frame.pins and not is_second_end:
            beside = f', or a link beside it: link: {" or ".join(owners)}' if owners else ''
            yield (
                f'{label}.{words.pin} = {pin}: a force on a fixed pin does nothing; give another '
                f'pin{beside}'
            )
    elif link and link not in bodies:
        why = 'the frame does not move; ' if link == FRAME_NAME else ''
        yield (
            f'{label}.{words.link} = {shown(link)}: {why}must be one of {listed(bodies)}'
            f'{did_you_mean(link, bodies)}'
        )
    elif link and at is None:
        instead = f', or {words.pin}' if words.pin else ''
        yield f'{label}.{words.at} is missing: give the place on {link} as drawn{instead}'


def contradictions(drawing: Any) -> list[str]:
    """Returns a line for each pin in another unit, and for each length unlike the drawn one."""
    places = {pin: place for pin, place in drawing.pins.items() if place is not UNKNOWN}
    if drawing.units is UNKNOWN or len(places) < 3:
        return []
    lines = _pins_in_another_unit(drawing.units, places)
    for link in drawing.links:
        if link.pins is UNKNOWN or len(link.pins) != 2 or link.length in {None, UNKNOWN}:
            continue
        one, other = link.pins
        if one not in places or other not in places:
            continue
        apart = math.dist(places[one], places[other])
        if abs(link.length - apart) > _OFF * apart:
            lines.append(
                f'drawing.links.{link.name}.length = {link.length:g}, but {one} and {other} are '
                f'drawn {apart:.6g} {drawing.units} apart: correct it, or draw them so'
            )
    return lines


def _pins_in_another_unit(unit: str, places: Mapping[str, Sequence[float]]) -> list[str]:
    """Returns a line for each pin that is among the others only if it is in m, or else in mm.

    If there are many, they may be right, and another pin wrong; none is returned then.
    """
    if unit == 'in':  # too near to m: by chance, a right pin may be among the others, too
        return []
    other, factor = 'm', 1 / float(UNITS[unit])
    if unit == 'm':
        other, factor = 'mm', float(UNITS['mm'])
    lines = []
    for name, place in places.items():
        other_places = [x for pin, x in places.items() if pin != name]
        columns = [*zip(*other_places, strict=True)]
        low, high = [*map(min, columns)], [*map(max, columns)]  # the corners of their box
        size, converted = math.dist(low, high), [factor * x for x in place]
        is_far = _outside(place, low, high) > _FAR * size
        is_near_origin = factor > 1 and 0 < max(map(abs, place)) < _NEAR * size
        fits_converted = _outside(converted, low, high) < size
        if (is_far or is_near_origin) and fits_converted:
            lines.append(
                f'drawing.pins.{name} = [{place[0]:g}, {place[1]:g}] {unit}: looks like '
                f'{_UNIT_NAMES[other]}; in {unit} it is [{converted[0]:.6g}, {converted[1]:.6g}]'
            )
    return lines if len(lines) <= max(1, len(places) // 3) else []


def _outside(place: Sequence[float], low: Sequence[float], high: Sequence[float]) -> float:
    """Returns by how much a place is outside a box."""
    return max(max(x - z, y - x, 0.0) for x, y, z in zip(place, low, high, strict=True))


# ---------------------------------------------------------------- checks


def _bad_names(outline: Outline) -> Iterator[str]:
    """Yields the mistakes in names of pins and parts."""
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
    for pin in outline.forgotten:
        owners = ', '.join(x.label for x in (outline.frame, *outline.parts) if pin in x.pins)
        yield (
            f'drawing.pins.{pin} is missing, a pin of {owners}: write its place [x, y]'
            f'{did_you_mean(pin, outline.drawing.pins)}'
        )
    for label, part, pins, is_certain in outline.links:
        if is_certain and len(pins) < outline.least(part):
            single = [pin for pin in outline.single_pins if pin not in pins]
            such = f', such as {" or ".join(single)}' if 0 < len(single) < 4 else ''
            yield (
                f'{label}.pins = {list(pins)}: a link needs two pins or more; add the pin that '
                f'joins it to another{such}, or leave it out'
            )


def _bad_lengths(outline: Outline) -> Iterator[str]:
    """Yields the lengths of links that have another shape than a line between two pins."""
    slide_on = {on: name for name, on in outline.guides.items()}
    for label, link, pins, is_certain in outline.links:
        if link.length in {None, UNKNOWN}:
            continue
        if link.name in slide_on:
            why = f'{slide_on[link.name]} slides on it'
        elif is_certain and len(pins) > 2:
            why = f'it has {len(pins)} pins'
        else:
            continue
        yield (
            f'{label}.length is for a link of two pins without a slide on it, but {why}: '
            'leave it out, and draw its pins where they are'
        )


def _bad_pins(outline: Outline) -> Iterator[str]:
    """Yields the mistakes in the pins themselves."""
    pins, parts = outline.drawing.pins, [outline.frame, *outline.parts]
    if all(x.is_certain for x in parts):
        used = {pin for x in parts for pin in x.pins}
        for pin in sorted({*pins} - used):
            yield (
                f'drawing.pins.{pin}: neither the frame nor a link has this pin; add it to one, '
                'or leave it out'
            )
    pin_at = dict[Exact, str]()
    for pin, pair in pins.items():
        if pair is UNKNOWN:
            continue
        first = pin_at.setdefault(Exact.of(pair), pin)
        if first != pin:
            yield (
                f'drawing.pins.{pin} is at the same place as {first}: write one pin that all '
                'their links share, or draw the machine at another position'
            )


def _bad_slides(outline: Outline) -> Iterator[str]:
    """Yields the mistakes in slides."""
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
        if slide.on == FRAME_NAME:
            for pin in pins:
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
    """Yields the mistakes in centres of mass."""
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
    moving = [*outline.links, *outline.slides]
    joinable = {pin for x in (outline.frame, *moving) for pin in x.pins}
    for label, _, pins, _ in outline.cylinders:
        for pin in pins:
            if pin not in joinable:
                yield f'{label}: no link has its pin {pin}; add it to a link or to drawing.frame'
    driven = [x for x in outline.cylinders if x.part.name == outline.input]
    counts = Counter(pin for x in (outline.frame, *moving, *driven) for pin in x.pins)
    guides = [*outline.guides.values()]
    for label, part, pins, _ in moving:
        joined = [pin for pin in pins if counts[pin] > 1]
        single = [pin for pin in pins if counts[pin] == 1]
        slides = part.name in outline.guides
        joints = len(joined) + (1 if slides else 0) + guides.count(part.name)
        if joints > 1:
            continue
        where = f'at {joined[0]} alone' if joined else 'nowhere'
        if slides and not joined:
            where = 'by its line alone'
        yield (
            f'{label} is joined to the others {where}: no other link has its '
            f'{" or ".join(single)}; add {"it" if len(single) == 1 else "one"} to another '
            'link or to drawing.frame, or leave this one out'
        )
