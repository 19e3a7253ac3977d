# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A page of one file, without network access, on which a mechanism moves."""

import base64
import html
import json
import math
import string
from collections.abc import Iterator, Mapping, Sequence
from importlib import resources
from typing import Any, NamedTuple

import numpy as np
from matplotlib.ticker import MaxNLocator

from linkage_lab.gaps import Column
from linkage_lab.output import shown_range
from linkage_lab.period import OVER_TIME, Period, angle_name
from linkage_ros.formulas import Array
from linkage_ros.internals import Picture
from linkage_ros.palette import GREY, SECOND, Color

_SIZE, _TALLEST = 480, 400  # px, width of a picture, and largest height of the linkage
_ROOM = 26  # px around the linkage, for the names of its pins
_BAR = 24  # px below the linkage, for the scale bar
_NAME = 17  # px from a pin to the middle of its name
_LETTER = 12  # px, at most a letter's mean width in a name, on a phone
# Margins of the curves and the height of one, px.
_LEFT, _RIGHT, _TOP, _ROW, _FOOT = 70, 20, 24, 104, 42
_GAP = _TOP + 12  # px between two curves
_WIDE = 2.2  # a drawing with this ratio of width to height is above the curves, not beside them
_SAMPLES = 721  # most samples; half a degree each in a period of one turn
_BYTES = 250_000  # of the data of all samples
_POINT, _NUMBER = 12, 10  # bytes of a point of a curve or path, and of a number


class _Quantity(NamedTuple):
    """A quantity to read off the page; drawn as a curve if `is_drawn`."""

    name: str
    unit: str
    color: Color
    values: Array
    is_drawn: bool


def movie_page(
    name: str,
    about: str,
    period: Period,
    paces: Sequence[tuple[float, str]],
    pace: float,
    springs: Mapping[str, Array],
) -> str:
    """Makes the page.

    Args:
        name: Name of the mechanism.
        about: Description of the mechanism and its motion.
        period: Period to show.
        paces: Playing speeds relative to real time, each with its description.
        pace: The playing speed at the start, one of `paces`.
        springs: Lines of springs and cylinders at all samples, shapes (n, 2, 2), m, by name.

    Returns:
        The HTML page, of less than 300 kB.
    """
    linkage = _linkage(period, springs)
    quantities, time = _quantities(period), period.time
    # Two bytes a coordinate, and a third more as text.
    sample_bytes = 8 / 3 * linkage.coordinates + _POINT * len(linkage.drawing.owners)
    sample_bytes += (_POINT + _NUMBER) * len(quantities)
    shown = _samples(period, min(_SAMPLES, int(_BYTES / sample_bytes)))
    if period.speed < 0:
        shown, time = shown[::-1], time[-1] - time
    picture, shape, places = _draw_linkage(linkage, shown)
    curves, scales = _curves(period, quantities, shown)
    data = {
        'time': _rounded(time[shown]), 'across': _rounded(period.marks[shown]),
        'start': period.marks[0], 'end': period.marks[-1],
        'left': _LEFT, 'width': _SIZE - _LEFT - _RIGHT,
        'total': _SIZE, 'places': base64.b64encode(places.tobytes()).decode(),
        'quantities': [
            {'unit': quantity.unit, 'values': _rounded(quantity.values[shown]), 'scale': scale}
            for quantity, scale in zip(quantities, scales, strict=True)
        ],
    }  # fmt: skip
    text = resources.files('linkage_lab').joinpath('movie.html').read_text(encoding='utf-8')
    return string.Template(text).substitute(
        name=html.escape(name), about=html.escape(about), linkage=picture, curves=curves,
        arrangement='' if shape > _WIDE else 'beside', last=len(shown) - 1,
        data=json.dumps(data, separators=(',', ':')),
        readings='\n'.join(
            f'<div><dt>{html.escape(quantity.name)}</dt><dd id="value{i}"></dd></div>'
            for i, quantity in enumerate(quantities)
        ),
        paces='\n'.join(
            f'<option value="{ratio:g}"{" selected" if ratio == pace else ""}>{words}</option>'
            for ratio, words in paces
        ),
    )  # fmt: skip


def _samples(period: Period, count: int) -> Array:
    """Selects evenly spaced samples, and those with the extreme values of each quantity."""
    size = len(period.crank)
    even = np.round(np.linspace(0, size - 1, min(count, size))).astype(int)
    columns = [column.values for column in period.columns.values()]
    extremes = [index for values in columns for index in (values.argmin(), values.argmax())]
    return np.unique([*even, *extremes])


def _quantities(period: Period) -> list[_Quantity]:
    """Lists what the page shows: driven link, output link, torque and loads."""
    columns, colors, driven = period.columns, period.colors, period.driven
    color, speed = colors[driven.name], period.motion(driven.name, 'velocity').values
    is_law = period.across is OVER_TIME
    is_uneven = bool(np.ptp(speed) > 0)
    if driven.slides:
        word = driven.driven_word.capitalize()
        found = [
            _Quantity(f'{word} position', 'm', color, period.crank, is_law),
            _Quantity(f'{word} speed', 'm/s', color, speed, is_uneven),
        ]
    else:
        found = [
            _Quantity(angle_name(driven.name), 'deg', color, np.degrees(period.crank), is_law),
            _Quantity(
                f'{driven.name.capitalize()} speed', 'rpm', color, speed * 30 / math.pi, is_uneven
            ),
        ]
    output = period.solver.output
    position, velocity = (period.motion(output, word) for word in ('position', 'velocity'))
    found += [
        _quantity(position, f'{output.capitalize()} position', colors[output], is_drawn=False),
        _quantity(velocity, f'{output.capitalize()} speed', colors[output]),
        _quantity(columns[period.effort], period.effort_name, color),
    ]
    for name, column in columns.items():
        link, _, kind = name.partition('.')
        if kind == 'load':
            found.append(_quantity(column, f'Load on the {link}', colors[link]))
    return found


def _quantity(column: Column, name: str, color: Color, *, is_drawn: bool = True) -> _Quantity:
    unit, values = column
    if unit == 'rad':
        unit, values = 'deg', np.degrees(values)
    return _Quantity(name.replace('_', ' '), unit, color, values, is_drawn)


class _Linkage(NamedTuple):
    """A drawing, and its moving parts at all samples; see `Picture`."""

    drawing: Picture
    pins: Array
    links: dict[str, Array]
    loads: dict[str, Array]
    springs: Mapping[str, Array]

    @property
    def coordinates(self) -> int:
        """Number of coordinates of the moving parts and of the names of the pins."""
        lines = *self.links.values(), *self.loads.values(), *self.springs.values()
        pins_and_names = self.pins, self.pins
        count: int = sum(line[0].size for line in (*lines, *pins_and_names))
        return count + 2 * len(self.springs)  # their names

    @property
    def points(self) -> Array:
        """All points of the picture but those of names, m, shape (n, 2)."""
        lines = [
            *self.drawing.ground, self.pins, *self.links.values(), *self.loads.values(),
            *self.springs.values(),
        ]  # fmt: skip
        return np.concatenate([line.reshape(-1, 2) for line in lines])

    def at(self, samples: Array) -> '_Linkage':
        """Returns the linkage at samples alone, given their indices."""
        return self._replace(
            pins=self.pins[samples],
            links={link: lines[samples] for link, lines in self.links.items()},
            loads={link: lines[samples] for link, lines in self.loads.items()},
            springs={name: line[samples] for name, line in self.springs.items()},
        )


def _linkage(period: Period, springs: Mapping[str, Array]) -> _Linkage:
    drawing, positions, rates = period.drawing, period.rows('position'), period.rows('velocity')
    pins = drawing.place(positions)
    links, loads = drawing.links(pins), drawing.loads(positions, rates)
    return _Linkage(drawing, pins, links, loads, springs)


class _Canvas(NamedTuple):
    """The area of the picture in which the mechanism is drawn.

    Attributes:
        low: Lower left corner of the area, m.
        high: Upper right corner of the area, m.
    """

    low: Array
    high: Array

    @classmethod
    def around(cls, points: Array) -> '_Canvas':
        """Encloses points, m, shape (n, 2)."""
        return cls(points.min(axis=0), points.max(axis=0))

    @property
    def size(self) -> tuple[float, float]:
        """Width and height of the area, m; above 0, because every pivot has a symbol."""
        width, height = (self.high - self.low).tolist()
        return width, height

    @property
    def scale(self) -> float:
        """Pixels per m."""
        width, height = self.size
        return min((_SIZE - 2 * _ROOM) / width, (_TALLEST - 2 * _ROOM) / height)

    @property
    def left(self) -> float:
        """Pixels to the left of the area, which is in the middle."""
        width, _ = self.size
        return 0.5 * (_SIZE - self.scale * width)

    @property
    def height(self) -> int:
        """Height of the picture, with room for the scale bar below, pixels."""
        _, height = self.size
        return round(self.scale * height) + 2 * _ROOM + _BAR

    def place(self, points: Array) -> Array:
        """Converts points from m to pixels, from the upper left corner."""
        right, up = np.moveaxis(points - self.low, -1, 0)
        across = self.left + self.scale * right
        return np.stack([across, self.height - _BAR - _ROOM - self.scale * up], axis=-1)


def _more_room(labels: list[tuple[Array, str]]) -> int:
    """Returns the pixels that long names need at each side, beyond the width of the picture.

    Args:
        labels: Places of each name from the left, pixels, and the name.
    """
    reach: float = max(
        np.abs(x - 0.5 * _SIZE).max() + 0.5 * _LETTER * len(name) for x, name in labels
    )
    return max(0, math.ceil(reach - 0.5 * _SIZE))


def _line(points: Array, color: Color, width: float) -> str:
    """Draws a line that does not move, through points in pixels."""
    return f'<polyline points="{_spaced(points)}" stroke="rgb{color}" stroke-width="{width:g}"/>'


def _moving_line(shape: Array, color: Color, width: float, dashes: str = 'none') -> str:
    """Draws a line that the page moves, of shape (samples, points, 2)."""
    points = shape.shape[1]
    return (
        f'<polyline data-points="{points}" stroke="rgb{color}" stroke-width="{width:g}" '
        f'stroke-dasharray="{dashes}"/>'
    )


class _NamedPin(NamedTuple):
    """A pin that does not move: its place and that of its name, pixels, and the name."""

    place: Array
    name_place: Array
    name: str


def _draw_linkage(linkage: _Linkage, shown: Array) -> tuple[str, float, Array]:
    """Draws the mechanism, to be shown at the samples of some indices.

    Returns:
        The picture as SVG; its ratio of width to height; and the coordinates of the moving parts
        at these samples, tenths of a pixel, shape (n, coordinates).
    """
    moving = linkage.at(shown)
    drawing, canvas = moving.drawing, _Canvas.around(moving.points)
    names = _name_places(moving, canvas)
    pivots = _pivots(drawing, canvas)
    labels = [(canvas.place(names)[:, i, 0], pin) for i, pin in enumerate(drawing.pins)]
    more = _more_room([*labels, *((pivot.name_place[..., 0], pivot.name) for pivot in pivots)])
    box = f'{-more} 0 {_SIZE + 2 * more} {canvas.height}'
    parts = [
        f'<svg id="linkage" viewBox="{box}" role="img" aria-label="the linkage">',
        *_still_lines(moving, canvas),
        *(_moving_line(line, drawing.colors[link], 5.0) for link, line in moving.links.items()),
        *(_moving_line(line, SECOND, 2.5) for line in moving.loads.values()),
        *(_moving_line(line, GREY, 2.5, '5 5') for line in moving.springs.values()),
        *map(_circle, pivots),
        *map(_name, pivots),
        *(f'<circle data-points="1" r="4" fill="rgb{GREY}"/>' for _ in drawing.pins),
        *map(_moving_name, drawing.pins),
        *map(_moving_name, moving.springs),
        '</svg>',
    ]
    # The name of a spring is above its middle.
    above = np.array([0.0, _NAME / canvas.scale])
    spring_names = [line.mean(axis=1) + above for line in moving.springs.values()]
    moved = (
        *moving.links.values(), *moving.loads.values(), *moving.springs.values(), moving.pins,
        names, *spring_names,
    )  # fmt: skip
    count = len(moving.pins)
    places = np.concatenate([canvas.place(part).reshape(count, -1) for part in moved], axis=1)
    return '\n'.join(parts), _SIZE / canvas.height, np.round(10 * places).astype('<i2')


def _name_places(moving: _Linkage, canvas: _Canvas) -> Array:
    """Returns the places of the names of the moving pins, m, shape (n, pins, 2)."""
    directions = moving.drawing.labels(moving.pins) - moving.pins
    distances = np.linalg.norm(directions, axis=-1, keepdims=True)
    return np.asarray(moving.pins + _NAME / canvas.scale * directions / distances)


def _pivots(drawing: Picture, canvas: _Canvas) -> list[_NamedPin]:
    """Returns the pivots; their names are at the sides, because the ground is drawn below them."""
    middle = 0.5 * (canvas.low + canvas.high)[0]
    pivots = []
    for pivot, name in zip(drawing.pivots, drawing.pivot_names, strict=True):
        place, aside = canvas.place(pivot), (math.copysign(_NAME + 3, pivot[0] - middle), 0)
        pivots.append(_NamedPin(place, place + aside, name))
    return pivots


def _still_lines(linkage: _Linkage, canvas: _Canvas) -> Iterator[str]:
    """Draws the ground, the paths of the pins, and the scale bar."""
    drawing = linkage.drawing
    for ground in drawing.ground:
        yield _line(canvas.place(ground), GREY, 1.2)
    for pin, owner in drawing.owners.items():
        path = linkage.pins[:, drawing.pins.index(pin)]
        yield _line(canvas.place(path), drawing.colors[owner], 1.2)
    bar = np.array([(0, 5), (0, 0), (1, 0), (1, 5)]) * [canvas.scale * drawing.scale_length, -1]
    bar += [canvas.left, canvas.height - 8]
    yield f'<polyline points="{_spaced(bar)}" stroke="rgb{GREY}"/>'
    yield (
        f'<text class="tick" x="{bar[2, 0] + 6:.1f}" y="{canvas.height - 8}">'
        f'{drawing.scale_label}</text>'
    )


def _circle(pin: _NamedPin) -> str:
    return f'<circle r="4" transform="translate({_spaced(pin.place)})" fill="rgb{GREY}"/>'


def _name(pin: _NamedPin) -> str:
    place = _spaced(pin.name_place)
    return f'<text class="name" transform="translate({place})">{html.escape(pin.name)}</text>'


def _moving_name(name: str) -> str:
    return f'<text data-points="1" class="name">{html.escape(name)}</text>'


class _Scale(NamedTuple):
    """The vertical axis of a curve.

    Attributes:
        low: Value at the bottom.
        factor: Pixels per unit.
        bottom: Coordinate y of the bottom, px, downwards.
    """

    low: float
    factor: float
    bottom: float

    def y(self, value: Any) -> Any:
        """Returns the coordinate y of a value or of values, px."""
        return self.bottom - self.factor * (value - self.low)


def _x(period: Period, marks: Any) -> Any:
    """Returns the coordinate x of values of the horizontal axis of all curves, px."""
    start, end = period.marks[[0, -1]]
    return _LEFT + (_SIZE - _RIGHT - _LEFT) * (marks - start) / (end - start)


def _curves(
    period: Period, quantities: Sequence[_Quantity], shown: Array
) -> tuple[str, list[_Scale | None]]:
    """Draws the curves one below the other over a common axis of crank angles.

    Returns:
        The picture as SVG; and for each quantity its axis, or None if it is not drawn.
    """
    drawn = sum(quantity.is_drawn for quantity in quantities)
    height, x = drawn * (_ROW + _GAP) + _FOOT, _x(period, period.marks[shown])
    parts, above = list[str](), list[str]()  # `above` covers the grid
    scales, top = list[_Scale | None](), float(_TOP)
    for i, quantity in enumerate(quantities):
        if not quantity.is_drawn:
            scales.append(None)
            continue
        scale, ticks = _scale(quantity.values, top)
        scales.append(scale)
        parts += _horizontal_grid(scale, ticks)
        points = np.stack([x, scale.y(quantity.values[shown])], axis=-1)
        parts += (
            f'<polyline points="{_spaced(part)}" stroke="rgb{quantity.color}" stroke-width="2"/>'
            for part in _parts_inside(points, top, scale.bottom)
        )
        above.append(
            f'<text class="title" x="{_LEFT}" y="{top - 8:g}">{html.escape(quantity.name)}, '
            f'{quantity.unit}</text>'
        )
        above.append(f'<circle id="dot{i}" r="5" fill="rgb{quantity.color}"/>')
        top = scale.bottom + _GAP
    foot = top - _GAP
    parts += _vertical_grid(period, foot)
    middle, title = 0.5 * (_LEFT + _SIZE - _RIGHT), f'{period.across.name}, {period.across.unit}'
    parts += [
        f'<text x="{middle:g}" y="{foot + 36:g}" text-anchor="middle">{title}</text>',
        f'<line id="cursor" y1="{_TOP}" y2="{foot:g}"/>', *above, '</svg>',
    ]  # fmt: skip
    head = (
        f'<svg id="curves" viewBox="0 0 {_SIZE} {height}" role="img" '
        f'aria-label="curves over the {period.across.name.lower()}">'
    )
    return '\n'.join([head, *parts]), scales


def _scale(values: Array, top: float) -> tuple[_Scale, Array]:
    """Chooses the vertical axis of a curve whose upper end is at `top`, px; returns its ticks."""
    limits = shown_range([values], _range(values))
    ticks = MaxNLocator(4, steps=[1, 2, 5, 10]).tick_values(*limits)
    low, high = float(ticks[0]), float(ticks[-1])
    return _Scale(low, _ROW / (high - low), top + _ROW), np.asarray(ticks)


def _horizontal_grid(scale: _Scale, ticks: Array) -> Iterator[str]:
    """Draws a line and a number for each tick of a vertical axis."""
    for tick in ticks:
        y = scale.y(tick)
        yield f'<path class="grid" d="M{_LEFT} {y:.1f}H{_SIZE - _RIGHT}"/>'
        yield (
            f'<text class="tick" x="{_LEFT - 6}" y="{y + 4:.1f}" text-anchor="end">'
            f'{tick + 0.0:.6g}</text>'
        )


def _vertical_grid(period: Period, foot: float) -> Iterator[str]:
    """Draws five lines and numbers of the horizontal axis, which is at `foot`, px."""
    for mark in np.linspace(period.marks[0], period.marks[-1], 5):
        x = _x(period, mark)
        yield f'<path class="grid" d="M{x:.1f} {_TOP}V{foot:g}"/>'
        yield (
            f'<text class="tick" x="{x:.1f}" y="{foot + 16:g}" text-anchor="middle">'
            f'{mark:.6g}</text>'
        )


def _parts_inside(points: Array, top: float, bottom: float) -> Iterator[Array]:
    """Yields the parts of a curve inside the diagram, which infinite values are not."""
    y = points[:, 1]
    is_inside = (y >= top - 1) & (y <= bottom + 1)
    cuts = np.flatnonzero(np.diff(is_inside)) + 1
    for part in np.split(np.arange(len(points)), cuts):
        if is_inside[part[0]]:
            yield points[part]


def _range(values: Array) -> tuple[float, float]:
    """Returns a range to draw; a constant value, even with rounding errors, lies in its middle."""
    values = values[np.isfinite(values)]
    low, high = float(values.min()), float(values.max())
    size = max(abs(low), abs(high))
    if high - low > 1e-9 * size:
        return low, high
    return low - (0.1 * size or 1.0), high + (0.1 * size or 1.0)


def _spaced(points: Array) -> str:
    return ' '.join(f'{x:.1f}' for x in points.ravel())


def _rounded(values: Array) -> list[float | None]:
    """Rounds to seven digits, finer than the page shows; hides rounding errors next to 0.

    An infinite value becomes None.
    """
    is_finite = np.isfinite(values)
    least = 1e-12 * np.abs(values[is_finite]).max(initial=0.0)
    numbers = [float(f'{x:.7g}') if abs(x) > least else 0.0 for x in values]
    return [x if known else None for x, known in zip(numbers, is_finite, strict=True)]
