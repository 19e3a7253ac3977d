# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Output of linkage_chart: folder, JSON and CSV files, charts in a common style, progress bars."""

import argparse
import csv
import io
import json
import math
import os
import platform
import re
import textwrap
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from linkage_ros import ConfigurationError, LinkageError, __version__, load
from linkage_ros.cli import progress_bar
from linkage_ros.formulas import Array
from linkage_ros.internals import notes_on, replacement, require_new, text_output
from linkage_ros.quantities import Angle

# Charts must be readable at half size, 700 pixels wide; the smallest text is then 8 pixels high.
WIDTH, DPI = 10.0, 140  # inches, and pixels per inch
TITLE, TEXT, SMALL, NUMBERS = 11.0, 10.0, 9.0, 8.5  # points
STYLE: dict[Any, Any] = {
    'font.size': SMALL, 'figure.titlesize': TITLE, 'axes.titlesize': TEXT,
    'xtick.labelsize': NUMBERS, 'ytick.labelsize': NUMBERS, 'text.parse_math': False,
    'axes.grid': True, 'axes.axisbelow': True, 'grid.color': '0.88', 'grid.linewidth': 0.6,
    'legend.frameon': False, 'axes.formatter.useoffset': False,
    'axes.formatter.limits': (-12, 12),
}  # fmt: skip
# Inches: height of a name beside a line's end, and the line to it.
NAME, LEADER = 0.135, 0.2
Box: TypeAlias = tuple[float, float, float, float]
_COMPRESSED = 3  # level of PNG files: a tenth larger than the default, in two thirds of the time
_UNDISTURBED = 0.95  # share of a processor above which times are trusted
_AROUND = 16  # steps beside an infinite value, beyond whose values a diagram need not reach
# Distinct without colours: solid, long dashes, dots, dash and dot, dash and two dots, short
# dashes, long and short dashes.
_DASHES: tuple[Any, ...] = (
    '-', (0, (6, 2)), (0, (1, 1.2)), (0, (6, 1.5, 1, 1.5)), (0, (6, 1.5, 1, 1.5, 1, 1.5)),
    (0, (2.5, 1.8)), (0, (9, 1.5, 3, 1.5)),
)  # fmt: skip
_ANGLES = 5, 10, 15, 30, 45, 90, 180, 360, 720, 1440  # steps of ticks, deg
_LEVELS = 5  # most intervals between the ticks of a vertical axis


def pictures(options: argparse.Namespace, stem: str) -> list[Path]:
    """Names the files of a picture, one for each format.

    Args:
        options: Parsed command-line options with the folder, the formats and `overwrite`.
        stem: Name of the files, without the suffix.

    Raises:
        ConfigurationError: A file must not be written; see `new_file`.
    """
    return [
        new_file(options, options.out / f'{stem}.{suffix}')
        for suffix in dict.fromkeys(options.format)
    ]


def new_file(options: argparse.Namespace, path: Path) -> Path:
    """Returns the path of a file to be written, before the work for it begins.

    Args:
        options: Parsed command-line options with `overwrite`.
        path: Path of the file, or '-' for standard output.

    Raises:
        ConfigurationError: The file exists without --overwrite, or its folder cannot be created.
    """
    require_new(path, ConfigurationError, overwrite=options.overwrite, cure='give --overwrite')
    return path


def name_of(source: Path | str, design: Any) -> str:
    """Returns the name of a design in titles and in names of files.

    Args:
        source: Parameter file or preset of the design.
        design: The configuration of the linkage, whose name is added if it has one.
    """
    return '_'.join(filter(None, (Path(source).stem, design.name)))


def doubts(*linkages: Any) -> list[str]:
    """Returns a line for each parameter that was probably given in another unit."""
    return [line for one in linkages for line in notes_on(one)]


def load_pose(options: argparse.Namespace) -> tuple[Any, list[str]]:
    """Loads a linkage for the position --at; its drive need not be able to move it from there.

    Returns:
        The configuration, and notes: why the drive cannot move it, and what is doubtful.

    Raises:
        ConfigurationError: The configuration is invalid, or an angle is given for a slide.
    """
    found = load(options.params, checks_drive=False).linkage(options.linkage)
    at, notes = options.at, list[str]()
    try:
        found.check_drive()
    except LinkageError as error:
        notes.append(str(error))
    driven = found.mechanism.structure().driven_link
    is_angle = isinstance(at, Angle)  # it was given in degrees
    if driven.slides and is_angle:
        raise ConfigurationError(
            f'--at: {driven.name} is driven and slides; give its position in m'
        )
    if at is not None and not driven.slides and not is_angle and abs(at) > math.tau:
        notes.append(
            f'--at {at:g} is in rad: {at:g} rad = {math.degrees(at):.6g} deg; for {at:g} deg, '
            f'write {at:g}deg'
        )
    return found, [*notes, *doubts(found)]


def progress(items: Iterable[Any], words: str) -> Iterable[Any]:
    """Iterates over items with a progress bar."""
    bar: Iterable[Any] = progress_bar(items, desc=words, unit=' steps')
    return bar


def about() -> dict[str, str]:
    """Returns software versions and a description of the machine, to save with measurements."""
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


class Stopwatch:
    """Compares the processor time of this process with the time that passes."""

    def __init__(self) -> None:
        self._start, self._used = time.perf_counter(), time.process_time()

    def warning(self) -> str:
        """Returns a warning if other programs slowed this one down, otherwise ''."""
        passed = time.perf_counter() - self._start
        share = (time.process_time() - self._used) / passed if passed else 1.0
        if share > _UNDISTURBED:
            return ''
        got = f'{100 * share:.0f} % of a processor'
        return f'busy machine: this program had {got}; times are too long'


def rounded(value: float) -> str:
    """Writes a number with four significant digits, below ten millions without an exponent."""
    return f'{float(f"{value:.4g}") + 0.0:.7g}'


def wrapped(text: str, width: int, indent: str = '') -> list[str]:
    """Wraps text, with an indent before further lines; keeps numbers and units together."""
    bound = re.sub(r'(?<=\d) (?=[a-zA-Z])|(?<=kg) (?=m)|(?<=N) (?=m)', '\N{NO-BREAK SPACE}', text)
    lines = textwrap.wrap(bound, width, subsequent_indent=indent)
    return [line.replace('\N{NO-BREAK SPACE}', ' ') for line in lines]


def in_degrees(angle: float) -> str:
    """Writes an angle, rad, in degrees; rounding errors of 0 are 0."""
    return f'{round(math.degrees(angle), 9) + 0.0:.5g} deg'


def dash(number: int) -> Any:
    """Returns a line style that distinguishes lines without colours."""
    return _DASHES[number % len(_DASHES)]


def save_records(path: Path, records: list[dict[str, Any]]) -> None:
    """Writes records as JSON, together with `about()`; see `save_text`."""
    save_text(path, json.dumps({'about': about(), 'records': records}, indent=1) + '\n')


def save_csv(path: Path, head: Sequence[str], rows: Iterable[Iterable[object]]) -> None:
    """Writes a CSV file; floats have all digits, None is an empty cell; see `save_text`."""
    text = io.StringIO()
    csv.writer(text, lineterminator='\n').writerows([head, *rows])
    save_text(path, text.getvalue())


def save_text(path: Path, text: str) -> None:
    """Writes a text file at once, to a path of `new_file`; to standard output if it is '-'.

    Raises:
        ConfigurationError: The file cannot be written.
    """
    with text_output(path, ConfigurationError, overwrite=True, cure='') as stream:
        stream.write(text)


@contextmanager
def saved(path: Path) -> Iterator[Path]:
    """Provides a temporary file that becomes a path of `new_file` once it is complete.

    Raises:
        ConfigurationError: The file cannot be written.
    """
    with replacement(path, ConfigurationError, overwrite=True, cure='') as part:
        yield part


@contextmanager
def chart(
    files: Iterable[Path], height: float, title: str = '', layout: Any = 'constrained'
) -> Iterator[Any]:
    """Creates a figure in the common style, and saves it at the end of the context.

    Args:
        files: The files, replaced if they exist.
        height: Height, inches.
        title: Title of the whole chart.
        layout: Layout engine of matplotlib.

    Yields:
        The empty figure.

    Raises:
        ConfigurationError: A file cannot be written.
    """
    # Imported here, so that programs without charts, such as sweep workers, skip matplotlib.
    from matplotlib import rc_context
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with rc_context(STYLE):
        figure = Figure(figsize=(WIDTH, height), dpi=DPI, layout=layout)
        FigureCanvasAgg(figure)  # keeps one text renderer, not one for each text
        figure.suptitle(title)
        yield figure
        for path in files:
            options: dict[str, Any] = {}
            if path.suffix == '.png':
                options['pil_kwargs'] = {'compress_level': _COMPRESSED}
            with saved(path) as part:
                figure.savefig(part, **options)


def shown_range(rows: Sequence[Array], limits: tuple[float, float]) -> tuple[float, float]:
    """Returns the limits of a diagram, without the surroundings of infinite values if any."""
    kept = list[Array]()
    for row in rows:
        (infinite,) = np.nonzero(~np.isfinite(row))
        around = (infinite[:, None] + np.arange(-_AROUND, _AROUND + 1)).ravel()
        kept.append(np.delete(row, np.unique(np.clip(around, 0, len(row) - 1))))
    values = np.concatenate(kept)
    are_all_finite = values.size == sum(map(len, rows))
    if are_all_finite or not values.size:
        return limits
    low, high = min(0.0, values.min()), max(0.0, values.max())
    margin = 0.05 * (high - low) or 1.0
    return low - margin, high + margin


def over(axes: Any, period: Any, title: str, parts: int = 8) -> None:
    """Formats a diagram over a period: its title, round ticks, and a line at 0.

    Args:
        axes: Axes whose vertical limits are set.
        period: The period; see `Period`.
        title: Title of the diagram, which ends with the unit.
        parts: Most intervals between the ticks of the horizontal axis.
    """
    axes.set_xlim(period.marks[0], period.marks[-1])
    axes.set_title(title, loc='left', fontsize=SMALL, pad=4, y=1.0)  # y: no search for room
    round_ticks(axes.xaxis, period.across.unit, parts)
    round_ticks(axes.yaxis, title.rpartition(', ')[2], _LEVELS)
    low, high = axes.get_ylim()
    if low < 0 < high:
        axes.axhline(0, color='0.6', linewidth=0.8, zorder=0)


def round_ticks(axis: Any, unit: str, parts: int) -> None:
    """Puts ticks at round values: multiples of 1, 2 or 5 times a power of ten, or round angles.

    Args:
        axis: Axis whose limits are set.
        unit: Unit of the axis; 'deg' gives round angles.
        parts: Most intervals between ticks.
    """
    from matplotlib.ticker import MaxNLocator, MultipleLocator

    low, high = axis.get_view_interval()
    steps = [step for step in _ANGLES if (high - low) / step <= parts]
    if unit == 'deg' and high - low > _ANGLES[0] * parts:
        axis.set_major_locator(MultipleLocator(steps[0] if steps else _ANGLES[-1]))
    else:
        axis.set_major_locator(MaxNLocator(parts, steps=[1, 2, 5, 10]))


def box(height: float, left: float, top: float, wide: float, high: float) -> Box:
    """Converts a box in a chart, inches from its upper left corner, to shares of the chart."""
    return left / WIDTH, 1 - (top + high) / height, wide / WIDTH, high / height


def write_title(
    figure: Any, text: str, left: float = 0.2, top: float = 0.12, color: Any = 'black'
) -> None:
    """Writes a bold line of text, by default in the upper left corner.

    Args:
        figure: A figure of `chart`.
        text: The text.
        left: Left end, inches from the left edge.
        top: Upper end, inches from the upper edge.
        color: Colour of the text.
    """
    x, y = left / WIDTH, 1 - top / figure.get_figheight()
    figure.text(x, y, text, va='top', weight='bold', fontsize=TEXT, color=color)


def name_ends(axes: Any, lines: Mapping[str, Any], size: tuple[float, float]) -> None:
    """Writes the names of lines beside their right ends, without overlaps.

    Args:
        axes: Axes whose limits are set.
        lines: The lines by name.
        size: Width and height of the axes, inches.
    """
    from matplotlib.colors import to_rgb
    from matplotlib.lines import Line2D

    (low, high), (width, height) = axes.get_ylim(), size
    ends = list[float]()
    for line in lines.values():
        values = np.asarray(line.get_ydata())
        last = values[np.isfinite(values)][-1]
        ends.append(float(np.clip((last - low) / (high - low), 0.0, 1.0)))
    places = spread(ends, NAME / height)
    for (name, line), end, place in zip(lines.items(), ends, places, strict=True):
        red, green, blue = to_rgb(line.get_color())
        color = 0.7 * red, 0.7 * green, 0.7 * blue  # readable on white
        leader = Line2D(
            [1.0, 1 + LEADER / width], [end, place], color=color, linewidth=0.6,
            transform=axes.transAxes, clip_on=False,
        )  # fmt: skip
        axes.add_line(leader)
        axes.text(
            1 + (LEADER + 0.03) / width, place, name, color=color, va='center_baseline',
            fontsize=NUMBERS, transform=axes.transAxes,
        )  # fmt: skip


def spread(places: Sequence[float], least: float) -> list[float]:
    """Moves places in the same order until they are `least` apart.

    Each run of places that are too close becomes evenly spaced about its mean.
    """

    def start(run: list[int]) -> float:
        """Returns the lower end of a run, given the indices of its places in order."""
        return sum(places[i] for i in run) / len(run) - 0.5 * least * len(run)

    runs = list[list[int]]()
    for i in sorted(range(len(places)), key=places.__getitem__):
        run = [i]
        # A run that overlaps the one before joins it, and may then overlap the next before.
        while runs and start(runs[-1]) + least * len(runs[-1]) > start(run):
            run = runs.pop() + run
        runs.append(run)
    moved = [0.0] * len(places)
    for run in runs:
        for number, i in enumerate(run):
            moved[i] = start(run) + (number + 0.5) * least
    return moved
