# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Draws the torque error of a measured crank over the filter's bandwidth, for each encoder."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from pathlib import Path

from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from linkage_ros.lab.charts.sizes import DPI, SMALL, TEXT, TITLE, WIDTH
from linkage_ros.lab.methods.follow_accuracy import FollowError
from linkage_ros.motion.drives import FollowDrive
from linkage_ros.palette import (
    BLACK,
    BLUE,
    GREEN,
    ORANGE,
    PURPLE,
    VERMILION,
    fractions,
)

_LOOKS = (('s', VERMILION), ('^', ORANGE), ('o', GREEN), ('D', BLUE), ('v', PURPLE))
_SPAN = 1.0, 100.0  # % of error that are drawn


def draw_follow(errors: Sequence[FollowError], title: str, path: Path) -> None:
    """Draws two panels: without and with measured velocity.

    Args:
        errors: All points.
        title: Title of the picture.
        path: The PNG file, replaced if it exists.

    Raises:
        OSError: The picture cannot be written.
    """
    figure = Figure(figsize=(WIDTH, 4.8), dpi=DPI, layout='constrained')
    figure.suptitle(title, fontsize=TITLE)
    panels = figure.subplots(1, 2, sharey=True, sharex=True)
    for axes, with_velocity in zip(panels, (False, True), strict=True):
        points = [p for p in errors if p.measured_velocity == with_velocity]
        lines = itertools.groupby(points, key=lambda p: p.bits)
        for (bits, group), (marker, color) in zip(lines, _LOOKS, strict=False):
            line = list(group)
            axes.plot(
                [p.follow_bandwidth for p in line], [100 * p.max_error for p in line],
                marker=marker, color=fractions(color), linewidth=1.2, markersize=5,
                label=f'{bits} bit',
            )  # fmt: skip
        default = FollowDrive().follow_bandwidth
        axes.axvline(default, color=fractions(BLACK), linestyle='--', linewidth=1.0,
                     label=f'default, {default:g} Hz')  # fmt: skip
        axes.set(xscale='log', yscale='log', ylim=_SPAN)
        axes.grid(visible=True, which='both', color='0.9', linewidth=0.6)
        words = 'angle and velocity are measured' if with_velocity else 'the angle is measured'
        axes.set_title(words, fontsize=TEXT)
        axes.set_xlabel('follow_bandwidth, Hz', fontsize=TEXT)
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            axis.set_major_formatter(FuncFormatter(lambda value, _: f'{value:g}'))
            axis.set_minor_locator(NullLocator())
        axes.tick_params(labelsize=SMALL)
    panels[0].set_ylabel('largest torque error, % of the peak torque', fontsize=TEXT)
    panels[0].legend(fontsize=SMALL, loc='lower left')
    figure.savefig(path)
