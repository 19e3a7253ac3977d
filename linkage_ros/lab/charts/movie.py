# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Draws a period of a mechanism as a movie, beside its driving torque."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.animation import FFMpegWriter, PillowWriter
from matplotlib.figure import Figure

from linkage_ros.errors import ConfigurationError
from linkage_ros.lab.charts.axes import STYLE, over_crank
from linkage_ros.lab.charts.linkage import LinkagePicture
from linkage_ros.lab.charts.sizes import TEXT
from linkage_ros.lab.period import Period
from linkage_ros.palette import COLORS, DARK, fractions

SECONDS = 3.0  # of the moving picture, for each turn of the crank
_RATE = 20  # frames in a second
_SIZE, _DPI = (8.0, 4.2), 90  # inches, and pixels in each
_WRITERS: dict[str, Any] = {'.gif': PillowWriter, '.mp4': FFMpegWriter}


def draw_movie(
    period: Period,
    title: Sequence[str],
    path: Path,
    progress: Callable[[Iterable[Any], str], Iterable[Any]],
) -> None:
    """Draws the moving mechanism, and its torque over the crank angle so far.

    Args:
        period: Period to draw.
        title: A name, and a line of description.
        path: A .gif or .mp4 file, replaced if it exists.
        progress: Shows a progress bar over the frames.

    Raises:
        ConfigurationError: The crank stands still, the file's name has another ending, or ffmpeg
            is missing.
    """
    if path.suffix not in _WRITERS:
        raise ConfigurationError(f'{path}: must end with .gif or .mp4')
    if not _WRITERS[path.suffix].isAvailable():
        raise ConfigurationError(f'{path}: ffmpeg is not installed; install it, or write a .gif')
    writer, samples = _WRITERS[path.suffix](fps=_RATE), _frames(period)
    degrees, torque = np.degrees(period.crank), period.columns['driving_torque'].values
    with rc_context(STYLE):
        figure = Figure(figsize=_SIZE, dpi=_DPI)
        figure.text(0.02, 0.94, title[0], weight='bold', fontsize=TEXT)
        figure.text(0.02, 0.885, ', '.join(title[1:]))
        picture = LinkagePicture(figure.add_axes((0.02, 0.06, 0.5, 0.78)), period, samples)
        axes = figure.add_axes((0.62, 0.16, 0.35, 0.66))
        axes.plot(degrees, torque, color='0.8', linewidth=1.2)
        (drawn,) = axes.plot([], [], color=fractions(COLORS['crank']), linewidth=1.8)
        (dot,) = axes.plot([], [], 'o', color=fractions(DARK), markersize=5)
        over_crank(axes, period.crank, 'Driving torque, N m', 4)
        axes.set_xlabel('Crank angle, deg')
        with writer.saving(figure, path, _DPI):
            for sample in progress(samples, 'frames'):
                picture.move(sample)
                drawn.set_data(degrees[: sample + 1], torque[: sample + 1])
                dot.set_data(degrees[sample : sample + 1], torque[sample : sample + 1])
                writer.grab_frame()


def _frames(period: Period) -> list[int]:
    """The samples of the period at even steps of time.

    Raises:
        ConfigurationError: The crank stands still.
    """
    speed = np.abs(period.columns['crank.velocity'].values)
    if not speed.min() > 0:
        raise ConfigurationError('the crank stands still: nothing would move; give --rpm 30')
    steps = 2 * np.diff(period.crank) / (speed[1:] + speed[:-1])
    time = np.concatenate([[0.0], np.cumsum(steps)])
    frames = round(period.crank[-1] / (2 * math.pi) * SECONDS * _RATE)
    even = np.linspace(0, time[-1], frames, endpoint=False)
    samples: list[int] = np.searchsorted(time, even).tolist()
    return samples if period.speed > 0 else samples[::-1]
