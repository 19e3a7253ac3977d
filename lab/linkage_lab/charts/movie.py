# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_chart movie: the mechanism as it moves, with its driving torque; a film or a page."""

import argparse
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.animation import FFMpegWriter, PillowWriter
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke
from matplotlib.transforms import Bbox

from linkage_lab.movie_page import movie_page
from linkage_lab.output import (
    SMALL,
    STYLE,
    TEXT,
    dash,
    doubts,
    folder,
    over,
    print_notes,
    progress,
    shown_range,
)
from linkage_lab.period import Period, period_to_show
from linkage_ros import ConfigurationError, load
from linkage_ros.formulas import Array
from linkage_ros.palette import DARK, GREY, Color, dashes_of, fractions

_SECONDS = 3.0  # duration of a crank turn in the movie
_RATE = 20  # frames per second
# Inches, of a film with linkage and torque side by side, and one below the other; pixels per inch.
_SIZE, _HIGH, _DPI = (8.0, 4.2), (8.0, 5.4), 90
_PACES = 4  # slower, and faster, playing speeds on a page
WIDE = 2.2  # a drawing with this ratio of width to height is above text or diagrams
# A name's distances from its pin, points, and its directions relative to the preferred one, deg;
# radius of a pin, points.
_DISTANCES, _TURNS, _PIN = (16.0, 26.0, 36.0), (0, 40, -40, 80, -80, 120, -120, 180), 2.5
_WRITERS: dict[str, Any] = {'.gif': PillowWriter, '.mp4': FFMpegWriter}
_NAME: dict[str, Any] = {
    'textcoords': 'offset points', 'fontsize': SMALL, 'va': 'center', 'annotation_clip': False,
    'snap': False,  # a moving letter of straight lines, such as E, would change its shape
}  # fmt: skip


def proportion(period: Period) -> float:
    """Computes the ratio of width to height of the drawing of a mechanism."""
    tracks = period.drawing.place(period.rows('position'))
    points = np.concatenate([*period.drawing.ground, tracks.reshape(-1, 2)])
    width, height = np.ptp(points, axis=0)
    return float(width / height)


class LinkagePicture:
    """A drawing of a mechanism with its pins, their paths over a period, and a scale bar.

    Attributes:
        period: Period of the drawn mechanism.
    """

    def __init__(self, axes: Axes, period: Period, samples: Sequence[int]) -> None:
        """Draws the mechanism at the first sample, with room for all samples.

        Args:
            axes: Axes to draw in.
            period: Period to draw.
            samples: Indices of the crank angles to be shown.
        """
        self.period, self._axes = period, axes
        self._drawing = drawing = period.drawing
        self._tracks = drawing.place(period.rows('position'))
        for line in drawing.ground:
            self._plot(line, GREY, linewidth=0.9)
        for pin, owner in drawing.owners.items():
            path = self._tracks[:, drawing.pins.index(pin)]
            width = 1.3 if pin in drawing.traced else 0.8
            self._plot(path, drawing.colors[owner], linewidth=width)
        shown = self._tracks[list(samples)]
        styles = [dash(number) for number in dashes_of(drawing.colors.values())]
        style_of = dict(zip(drawing.joints, styles, strict=True))
        self._links = {
            link: self._plot(
                lines.reshape(-1, 2), drawing.colors[link], linewidth=2.6, linestyle=style_of[link]
            )
            for link, lines in drawing.links(shown).items()
        }
        pins = np.concatenate([drawing.pivots, shown.reshape(-1, 2)])
        self._pins = self._plot(pins, DARK, linestyle='', marker='o', markersize=3.5)
        # The ground is drawn below the pivots, so their names are placed to the sides.
        self._asides = [(pivot[0] - pins[:, 0].mean(), 0.0) for pivot in drawing.pivots]
        low, high = axes.dataLim.get_points()
        scale = drawing.scale - drawing.scale.min(axis=0) + low - (0.0, 0.06 * (high - low).max())
        self._plot(scale, GREY, linewidth=0.9)
        length = f'{drawing.scale_length:g} m'
        unit = axes.annotate(length, tuple(scale[2]), xytext=(5, 0), **_NAME)
        halo = withStroke(linewidth=2.5, foreground='white')  # names may lie on paths
        self._names = [
            axes.annotate(name, (0, 0), xytext=(0, 0), ha='center', path_effects=[halo], **_NAME)
            for name in self._one_name_a_place()
        ]
        axes.set_aspect('equal')
        axes.margins(0.08)
        axes.set_axis_off()
        axes.apply_aspect()
        self._points_per_pixel = 72 / axes.figure.dpi
        corners = [text.get_window_extent().get_points() for text in (unit, *self._names)]
        self._unit, *self._sizes = (Bbox(self._points_per_pixel * corner) for corner in corners)
        self.move(samples[0])

    def _one_name_a_place(self) -> list[str]:
        """Returns the names of pivots and pins; empty for one where another always is.

        The mouth of a barrel has no name in a drawing.
        """
        drawing, drawn = self._drawing, self.period.solver.mechanism.drawn
        mouth = dict(drawn.points).get('E') if drawn else None
        still = [np.broadcast_to(pivot, self._tracks[:, 0].shape) for pivot in drawing.pivots]
        tracks, names = [*still, *np.moveaxis(self._tracks, 1, 0)], list[str]()
        near = 1e-9 * drawing.scale_length
        for i, name in enumerate((*drawing.pivot_names, *drawing.pins)):
            is_second = any(abs(tracks[i] - track).max() < near for track in tracks[:i])
            names.append('' if is_second or name == mouth else name)
        return names

    def move(self, sample: int) -> None:
        """Shows the mechanism at a sample of the period."""
        drawing, now = self._drawing, self._tracks[sample : sample + 1]
        for link, (line,) in drawing.links(now).items():
            self._links[link].set_data(*line.T)
        pins = np.array([*drawing.pivots, *now[0]])
        self._pins.set_data(*pins.T)
        ways = np.array([*self._asides, *(drawing.labels(now)[0] - now[0])])
        at = self._points_per_pixel * self._axes.transData.transform(pins)
        for name, pin, place in zip(self._names, pins, self._apart(at, ways), strict=True):
            name.xy = tuple(pin)
            name.set_position(tuple(place.tolist()))

    def _apart(self, pins: Array, ways: Array) -> list[Array]:
        """Places names of pins in the picture, so that they overlap no other name or pin.

        Args:
            pins: Positions of the pins, shape (n, 2), points.
            ways: Preferred direction of each name from its pin, of the same shape.

        Returns:
            Positions of the names relative to their pins, points.
        """
        page = Bbox(self._points_per_pixel * self._axes.figure.bbox.get_points())
        taken = [self._unit, *(Bbox([pin - _PIN, pin + _PIN]) for pin in pins)]
        chosen = []
        for pin, way, size in zip(pins, ways, self._sizes, strict=True):
            half = 0.5 * np.array([size.width, size.height]) + 1.0
            places = _places(way)
            boxes = [Bbox([pin + place - half, pin + place + half]) for place in places]
            costs = [_cost(box, page, taken) for box in boxes]
            best = costs.index(min(costs))  # the first of the best ones
            taken.append(boxes[best])
            chosen.append(places[best])
        return chosen

    def _plot(self, points: Array, color: Color, **style: Any) -> Line2D:
        style |= {'color': fractions(color), 'solid_capstyle': 'round'}
        return self._axes.plot(*points.T, **style)[0]


def _places(way: Array) -> Array:
    """Returns positions of a name relative to its pin, points, in the order of preference.

    Args:
        way: Preferred direction of the name, shape (2,).
    """
    turned = np.exp(1j * np.radians(_TURNS)) * complex(*way)
    directions = turned / math.hypot(*way)
    places = np.outer(_DISTANCES, directions).ravel()  # the nearest ones first
    return np.stack([places.real, places.imag], axis=1)


def _cost(box: Bbox, page: Bbox, taken: Sequence[Bbox]) -> tuple[bool, int]:
    """Returns whether the page cuts a name off, and how many names and pins it overlaps."""
    is_whole = page.contains(*box.min) and page.contains(*box.max)
    return not is_whole, box.count_overlaps(taken)


def movie(options: argparse.Namespace) -> None:
    """Shows the moving mechanism and its torque, as a film or as a page.

    Args:
        options: Parsed command-line options.

    Raises:
        ConfigurationError: The mechanism or the speed is invalid, the file's name does not end
            with .html, .gif or .mp4, ffmpeg is missing, or the file cannot be written.
    """
    path = options.out
    design = load(options.params)
    period, (name, about, speed, *_) = period_to_show(options.params, design, options.rpm)
    writer, is_page = _WRITERS.get(path.suffix), path.suffix == '.html'
    if not is_page and not (writer and writer.isAvailable()):
        raise ConfigurationError(
            f'{path}: must end with .html, .gif or, with ffmpeg installed, .mp4'
        )
    if not period.speed:
        raise ConfigurationError('the crank is at rest: a movie needs a speed, such as --rpm 30')
    print_notes([period.gap_note])
    pace = float(period.time[-1]) / (_SECONDS * period.turns)
    words = f'{about}, {speed}'
    with folder(path.parent):
        if is_page:
            series = [digit * 10.0**k for k in range(-9, 10) for digit in (1, 2, 5)]
            nearest = min(range(len(series)), key=lambda i: abs(math.log(series[i] / pace)))
            paces = sorted({1.0, *series[nearest - _PACES : nearest + _PACES + 1]})
            page = movie_page(
                name, words, period, [(x, _slower(x)) for x in paces], series[nearest]
            )
            path.write_text(page, encoding='utf-8')
        else:
            words = f'{words}, {_slower(pace)}'
            _film(period, name, words, writer, path)
    print(*doubts(design), f'{name}, {words}', path, sep='\n')


def _slower(pace: float) -> str:
    """Describes a playing speed relative to real time, such as '45 times slower'."""
    factor = f'{max(pace, 1 / pace):.2g}'
    if factor == '1':
        return 'real time'
    return f'{float(factor):g} times {"faster" if pace > 1 else "slower"}'


def _film(period: Period, name: str, words: str, writer: Any, path: Path) -> None:
    """Draws the moving mechanism, and its torque up to the current crank angle."""
    samples = _frames(period)
    marks, torque = period.marks, period.columns[period.effort].values
    with rc_context(STYLE):
        size, places = _SIZE, ((0.02, 0.06, 0.5, 0.78), (0.62, 0.16, 0.35, 0.66))
        if proportion(period) > WIDE:
            size, places = _HIGH, ((0.04, 0.47, 0.92, 0.4), (0.1, 0.11, 0.87, 0.32))
        figure = Figure(figsize=size, dpi=_DPI)
        figure.text(0.02, 1 - 0.25 / size[1], name, weight='bold', fontsize=TEXT)
        figure.text(0.02, 1 - 0.48 / size[1], words)
        linkage, axes = map(figure.add_axes, places)
        picture = LinkagePicture(linkage, period, samples)
        axes.plot(marks, torque, color='0.8', linewidth=1.2)
        axes.set_ylim(shown_range([torque], axes.get_ylim()))
        color = fractions(period.colors[period.driven.name])
        (drawn,) = axes.plot([], [], color=color, linewidth=1.8)
        (dot,) = axes.plot([], [], 'o', color=fractions(DARK), markersize=5)
        over(axes, marks, period.effort_title, 4)
        axes.set_xlabel(f'{period.across.name}, {period.across.unit}')
        saved = writer(fps=_RATE)
        with saved.saving(figure, path, _DPI):
            for sample in progress(samples, 'frames'):
                picture.move(sample)
                drawn.set_data(marks[: sample + 1], torque[: sample + 1])
                dot.set_data(marks[sample : sample + 1], torque[sample : sample + 1])
                saved.grab_frame()


def _frames(period: Period) -> list[int]:
    """Selects samples of the period at equal time intervals."""
    time, frames = period.time, round(period.turns * _SECONDS * _RATE)
    even = np.linspace(0, time[-1], frames, endpoint=False)
    if period.speed < 0:
        even = time[-1] - even
    return [int(np.abs(time - moment).argmin()) for moment in even]
