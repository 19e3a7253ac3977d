# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Results of linkage_chart: folder, records, tables, pictures in one style, and progress."""

import csv
import json
import math
import os
import platform
import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np

from linkage_ros import ConfigurationError, __version__
from linkage_ros.numeric import Array
from linkage_ros.progress import progress_bar

# Charts must be readable at half their size, which is 700 pixels wide; the smallest text then has
# 8 pixels.
WIDTH, DPI = 10.0, 140  # inches, and pixels in each
TITLE, TEXT, SMALL, NUMBERS = 11.0, 10.0, 9.0, 8.5  # points
STYLE: dict[Any, Any] = {
    'font.size': SMALL, 'figure.titlesize': TITLE, 'axes.titlesize': TEXT,
    'xtick.labelsize': NUMBERS, 'ytick.labelsize': NUMBERS, 'text.parse_math': False,
    'axes.grid': True, 'axes.axisbelow': True, 'grid.color': '0.88', 'grid.linewidth': 0.6,
    'legend.frameon': False, 'axes.formatter.useoffset': False,
}  # fmt: skip


@contextmanager
def folder(path: Path) -> Iterator[None]:
    """Makes the folder for results; reports a failure to write in one line.

    Raises:
        ConfigurationError: The folder or a file cannot be written.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
        yield
    except OSError as error:
        raise ConfigurationError(f'{path} cannot be written: {error.strerror}') from error


def progress(items: Iterable[Any], words: str) -> Iterable[Any]:
    """Iterates over items with a progress bar."""
    return progress_bar(items, desc=words, unit=' steps')


def about() -> dict[str, str]:
    """Versions of the software and description of the machine, for measurements."""
    models: list[str] = []
    with suppress(OSError):
        models = re.findall(r'model name\s*: (.*)', Path('/proc/cpuinfo').read_text())
    return {
        'linkage_ros': __version__,
        'Python': platform.python_version(),
        'NumPy': np.__version__,
        'system': f'{platform.system()} {platform.machine()}',
        'processors': f'{os.cpu_count()} x {models[0]}' if models else str(os.cpu_count()),
    }


def save_records(path: Path, records: list[dict[str, Any]]) -> None:
    """Writes records as JSON, with versions and machine."""
    path.write_text(json.dumps({'about': about(), 'records': records}, indent=1) + '\n')


def save_csv(path: Path, head: Sequence[str], rows: Iterable[Iterable[object]]) -> None:
    """Writes a complete CSV file, with all digits of floats and an empty cell for None."""
    new = path.with_suffix('.csv.new')
    with new.open('w', newline='', encoding='utf-8') as stream:
        csv.writer(stream, lineterminator='\n').writerows([head, *rows])
    new.replace(path)


@contextmanager
def chart(
    path: Path, height: float, title: str = '', layout: Any = 'constrained'
) -> Iterator[Any]:
    """Makes a chart in the common style, and saves it.

    Args:
        path: The PNG file, replaced if it exists.
        height: Height, inches.
        title: Title of the whole chart.
        layout: Layout engine of matplotlib.

    Yields:
        The empty figure.

    Raises:
        OSError: The file cannot be written.
    """
    # Programs that draw nothing, such as the workers of a sweep, need not import matplotlib.
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    with rc_context(STYLE):
        figure = Figure(figsize=(WIDTH, height), dpi=DPI, layout=layout)
        figure.suptitle(title)
        yield figure
        figure.savefig(path)


def over_crank(axes: Any, crank: Array, label: str, parts: int = 8) -> None:
    """Completes a plot against the crank angle: `parts` even ticks, a label, a line at 0."""
    end = math.degrees(crank[-1])
    axes.set(xlim=(0, end), xticks=np.linspace(0, end, parts + 1), ylabel=label)
    low, high = axes.get_ylim()
    if low < 0 < high:
        axes.axhline(0, color='0.6', linewidth=0.8, zorder=0)
