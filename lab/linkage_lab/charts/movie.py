# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_chart movie: the mechanism as it moves, with its driving torque; a film or a page."""

import argparse
import math
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from PIL import Image

from linkage_lab.charts.linkage_picture import NAME_STYLE, LinkagePicture, proportion
from linkage_lab.charts.sketch import SPRING_STYLE, spring_lines
from linkage_lab.movie_page import movie_page
from linkage_lab.output import STYLE, TEXT, doubts, new_file, over, progress, saved, shown_range
from linkage_lab.period import Period, period_to_show
from linkage_ros import ConfigurationError, cli, load
from linkage_ros.palette import DARK, fractions

_SECONDS = 3.0  # duration of a crank turn in the movie
_RATE = 20  # frames per second
# Inches, of a film with linkage and torque side by side; pixels per inch. The axes of both: left,
# bottom, width and height as shares of the film.
_SIZE, _DPI = (8.0, 4.2), 90
_SIDE_BY_SIDE = (0.02, 0.06, 0.5, 0.78), (0.62, 0.16, 0.35, 0.66)
# The linkage is above the torque from this ratio of its width to its height; inches: the linkage,
# at least and at most, the title above it, the torque, and the margin below this.
_BROAD, _LOW, _HIGH, _TITLE, _TORQUE, _FOOT = 1.4, 2.2, 3.6, 0.65, 1.7, 0.6
_PALETTE_STEP = 15  # a GIF has the colours of each 15th picture
_NEARLY_WHITE = 252  # of 255
_APART = 12.0  # of the name of a spring, points
_PACES = 4  # slower, and faster, playing speeds on a page


def movie(options: argparse.Namespace) -> None:
    """Shows the moving mechanism and its torque, as a film or as a page.

    Raises:
        ConfigurationError: The mechanism or the speed is invalid, the file's name does not end
            with .html, .gif or .mp4, ffmpeg is missing, or the file cannot be written.
    """
    path = new_file(options, options.out)
    if path.suffix == '.mp4' and not shutil.which('ffmpeg'):
        raise ConfigurationError(
            f'{path} needs ffmpeg, which is not installed; install it, or write .html or .gif'
        )
    if path.suffix not in {'.html', '.gif', '.mp4'}:
        raise ConfigurationError(f'{path}: must end with .html, .gif or .mp4')
    design = load(options.params).linkage(options.linkage)
    period, (name, about, speed, *_) = period_to_show(options.params, design, options.rpm)
    if not period.speed:
        raise ConfigurationError('the crank is at rest: a movie needs a speed, such as --rpm 30')
    cli.print_notes([*doubts(design), period.gap_note])
    words = f'{about}, {speed}'
    with saved(path) as part:
        if path.suffix == '.html':
            part.write_text(page_of(design, period, name, words), encoding='utf-8')
        else:
            words = f'{words}, {_slower(_pace(period))}'
            save = _save_gif if path.suffix == '.gif' else _save_mp4
            save(_film(design, period, name, words), part)
    print(f'{name}, {words}', path, sep='\n')


def page_of(design: Any, period: Period, name: str, words: str) -> str:
    """Makes the page of a period, with playing speeds around one turn in three seconds.

    Args:
        design: The configuration.
        period: The period; its speed is not 0.
        name: Name of the mechanism.
        words: Description of the mechanism and its motion.
    """
    round_paces = [digit * 10.0**k for k in range(-9, 10) for digit in (1, 2, 5)]
    pace, indices = _pace(period), range(len(round_paces))
    nearest = min(indices, key=lambda i: abs(math.log(round_paces[i] / pace)))
    offered = sorted({1.0, *round_paces[nearest - _PACES : nearest + _PACES + 1]})
    structure = period.solver.structure
    return movie_page(
        name, words, period, [(one, _slower(one)) for one in offered], round_paces[nearest],
        spring_lines(design, structure, period.rows('position')),
    )  # fmt: skip


def _pace(period: Period) -> float:
    """Returns the playing speed, relative to real time, of one turn in three seconds."""
    return float(period.time[-1]) / (_SECONDS * period.turns)


def _slower(pace: float) -> str:
    """Describes a playing speed relative to real time, such as '45 times slower'."""
    factor = f'{max(pace, 1 / pace):.2g}'
    if factor == '1':
        return 'real time'
    return f'{float(factor):g} times {"faster" if pace > 1 else "slower"}'


def _film(design: Any, period: Period, name: str, words: str) -> Iterator[Image.Image]:
    """Yields pictures of the moving mechanism, and its torque, if any, up to the crank angle."""
    samples, positions = _frames(period), period.rows('position')
    has_effort = bool(period.columns[period.effort].values.any())
    with rc_context(STYLE):
        ratio = proportion(period.drawing, positions)
        size, (linkage_place, *diagram_places) = _layout(ratio, has_diagram=has_effort)
        figure = Figure(figsize=size, dpi=_DPI)
        canvas: Any = FigureCanvasAgg(figure)  # its methods have no types
        figure.text(0.02, 1 - 0.25 / size[1], name, weight='bold', fontsize=TEXT)
        figure.text(0.02, 1 - 0.48 / size[1], words)
        linkage = figure.add_axes(linkage_place)
        springs = _Springs(linkage, design, period)
        picture = LinkagePicture(linkage, period.drawing, positions, positions[samples])
        diagrams = [_Diagram(figure.add_axes(place), period) for place in diagram_places]
        # Only what moves is drawn again for each picture.
        moving = [*springs.moving, *picture.moving]
        moving += [artist for diagram in diagrams for artist in diagram.moving]
        for artist in moving:
            artist.set_animated(True)
        canvas.draw()
        background = canvas.copy_from_bbox(figure.bbox)
        for sample in progress(samples, 'frames'):
            canvas.restore_region(background)
            springs.move(sample)
            picture.move(positions[sample])
            for diagram in diagrams:
                diagram.move(sample)
            for artist in moving:
                figure.draw_artist(artist)
            yield Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3])


def _layout(ratio: float, *, has_diagram: bool) -> tuple[tuple[float, float], list[Any]]:
    """Returns the size of a film, inches, and its axes of linkage and torque, as shares of it.

    `ratio` is that of width to height of the linkage.
    """
    if ratio < _BROAD and has_diagram:
        return _SIZE, [*_SIDE_BY_SIDE]
    wide, share = _SIZE[0], 0.92
    linkage = min(max(share * wide / ratio, _LOW), _HIGH)
    below = _FOOT + _TORQUE + 0.35 if has_diagram else 0.1  # with the title of the torque
    pair = 2 / _DPI  # an MP4 has an even number of rows
    high = pair * round((below + linkage + _TITLE) / pair)
    places = [(0.04, below / high, share, linkage / high)]
    if has_diagram:
        places.append((0.1, _FOOT / high, 0.87, _TORQUE / high))
    return (wide, high), places


class _Diagram:
    """The driving torque or force over the period in a film, up to the current sample.

    Attributes:
        moving: Artists that `move` changes, from back to front.
    """

    def __init__(self, axes: Axes, period: Period) -> None:
        """Draws the whole curve in grey."""
        self._marks, self._effort = period.marks, period.columns[period.effort].values
        axes.plot(self._marks, self._effort, color='0.8', linewidth=1.2)
        axes.set_ylim(shown_range([self._effort], axes.get_ylim()))
        color = fractions(period.colors[period.driven.name])
        (self._curve,) = axes.plot([], [], color=color, linewidth=1.8)
        (self._dot,) = axes.plot([], [], 'o', color=fractions(DARK), markersize=5)
        over(axes, period, period.effort_title, 4)
        axes.set_xlabel(f'{period.across.name}, {period.across.unit}')
        self.moving = [self._curve, self._dot]

    def move(self, sample: int) -> None:
        """Shows a sample of the period."""
        self._curve.set_data(self._marks[: sample + 1], self._effort[: sample + 1])
        here = slice(sample, sample + 1)
        self._dot.set_data(self._marks[here], self._effort[here])


class _Springs:
    """Springs and cylinders in a film, with their names.

    Attributes:
        moving: Artists that `move` changes, from back to front.
    """

    def __init__(self, axes: Axes, design: Any, period: Period) -> None:
        """Draws the springs and cylinders at the first sample."""
        structure = period.solver.structure
        self._lines = [*spring_lines(design, structure, period.rows('position')).items()]
        style = {**NAME_STYLE, 'ha': 'center', 'color': fractions(DARK),
                 'path_effects': [withStroke(linewidth=2.5, foreground='white')]}  # fmt: skip
        self._drawn = [axes.plot(*line[0].T, **SPRING_STYLE)[0] for _, line in self._lines]
        self._names = [
            axes.annotate(name, tuple(line[0].mean(axis=0)), xytext=(0, _APART), **style)
            for name, line in self._lines
        ]
        self.moving = [*self._drawn, *self._names]

    def move(self, sample: int) -> None:
        """Shows a sample of the period."""
        for (_, line), drawn, name in zip(self._lines, self._drawn, self._names, strict=True):
            drawn.set_data(*line[sample].T)
            name.xy = tuple(line[sample].mean(axis=0))


def _save_gif(pictures: Iterator[Image.Image], path: Path) -> None:
    """Saves an animation with the colours of some of its pictures."""
    # In one picture, a link may hide another.
    all_pictures = [*pictures]
    some = np.concatenate([np.asarray(picture) for picture in all_pictures[::_PALETTE_STEP]])
    colors = Image.fromarray(some).quantize(method=Image.Quantize.FASTOCTREE)
    # A palette colour is the mean of similar ones: that of white and others is not white.
    palette = colors.getpalette() or ()
    colors.putpalette([255 if part > _NEARLY_WHITE else part for part in palette])
    first, *others = (x.quantize(palette=colors, dither=Image.Dither.NONE) for x in all_pictures)
    first.save(
        path, format='GIF', save_all=True, append_images=others, duration=1000 // _RATE, loop=0
    )


def _save_mp4(pictures: Iterator[Image.Image], path: Path) -> None:
    """Saves a film with ffmpeg.

    Raises:
        OSError: ffmpeg failed.
    """
    first = next(pictures)
    width, height = first.size
    raw = '-f', 'rawvideo', '-pix_fmt', 'rgb24', '-s', f'{width}x{height}', '-r', str(_RATE)
    encoded = '-pix_fmt', 'yuv420p', '-f', 'mp4', '-y'
    process = subprocess.run(  # noqa: S603
        ['ffmpeg', '-loglevel', 'error', *raw, '-i', '-', *encoded, path],  # noqa: S607
        input=b''.join(picture.tobytes() for picture in (first, *pictures)),
        stderr=subprocess.PIPE, check=False,
    )  # fmt: skip
    if process.returncode:
        raise OSError(process.stderr.decode(errors='replace').strip())


def _frames(period: Period) -> list[int]:
    """Selects samples of the period at equal time intervals."""
    time, frames = period.time, round(period.turns * _SECONDS * _RATE)
    even = np.linspace(0, time[-1], frames, endpoint=False)
    if period.speed < 0:
        even = time[-1] - even
    return [int(np.abs(time - moment).argmin()) for moment in even]
