# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Sketch, table and moving page of a mechanism or a log, to display in a notebook."""

import base64
import html
import io
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

from linkage_lab.charts.movie import page_of
from linkage_lab.charts.sketch import HIGH, Sketched, describe, draw_sketch, sketch_of
from linkage_lab.output import DPI, STYLE, WIDTH, name_of, rounded
from linkage_lab.period import Period, logged_period, period_to_show
from linkage_ros import Drawing, LinkageError, Mechanism, Solver, load
from linkage_ros.internals import Configuration, Linkage, configuration_of, logged_states

Thing: TypeAlias = str | Path | Mechanism | Drawing | Solver | Configuration | Linkage

_MOST = 4000  # states of a log that are shown
_RPM = 60.0  # of a mechanism without a speed of its own
_HEIGHT = 820  # of the page, px
_CELL = 'padding: 0 1em 0 0; font-variant-numeric: tabular-nums; text-align:'


class Shown:
    """HTML that a notebook displays.

    Attributes:
        title: One-line description.
    """

    def __init__(self, title: str, parts: Iterable[str]) -> None:
        """Joins the title and parts in HTML."""
        self.title = title
        self._html = '\n'.join((f'<h3>{html.escape(title)}</h3>', *parts))

    def __repr__(self) -> str:
        return f'<Shown: {self.title}>'

    def __str__(self) -> str:
        return self._html

    def _repr_html_(self) -> str:
        return self._html


class _Motion(NamedTuple):
    """A motion to show, with a name and a description."""

    name: str
    words: str
    period: Period


def show(thing: Thing, rpm: float | None, linkage: str = '') -> Shown:
    """See `linkage_lab.show`."""
    path = Path(thing) if isinstance(thing, (str, Path)) else None
    motion: _Motion | None = None
    if path is not None and (path.suffix == '.mcap' or path.is_dir()):
        design, motion = _logged(path, linkage)
        name = motion.name
    else:
        design = _configured(thing, rpm, linkage)
        name = name_of(path, design) if path else type(design.mechanism).__name__
    sketched = sketch_of(design)
    lines = '\n'.join(describe(sketched))
    parts = [_picture(sketched), f'<pre style="white-space: pre-wrap">{html.escape(lines)}</pre>']
    try:
        motion = motion or _periodic(name, design, rpm)
        parts += [
            _table(motion.period),
            _frame(page_of(design, motion.period, name, motion.words)),
        ]
    except LinkageError as error:  # the sketch shows the mechanism without a motion, too
        parts.append(f'<p>No motion: {html.escape(str(error))}</p>')
    return Shown(f'{name}: {motion.words if motion else repr(design.mechanism)}', parts)


def _picture(sketched: Sketched) -> str:
    """Draws a sketch as an image in HTML."""
    figure = Figure(figsize=(WIDTH, HIGH), dpi=DPI)
    with rc_context(STYLE):
        axes = figure.add_axes((0.02, 0.02, 0.96, 0.96))
        draw_sketch(axes, sketched, with_dimensions=False, with_centers=True)
        png = io.BytesIO()
        figure.savefig(png, format='png', bbox_inches='tight')
    source = base64.b64encode(png.getvalue()).decode()
    return f'<img style="max-width: 100%" alt="sketch" src="data:image/png;base64,{source}">'


def _configured(thing: Any, rpm: float | None, linkage: str) -> Linkage:
    if isinstance(thing, (str, Path)):
        thing = load(str(thing))
    if isinstance(thing, Configuration):
        return thing.linkage(linkage)
    if isinstance(thing, Linkage):
        return thing
    made = thing.mechanism if isinstance(thing, Solver) else thing
    return configuration_of(made, _RPM if rpm is None else rpm)


def _logged(path: Path, linkage: str) -> tuple[Linkage, _Motion]:
    """Reads a log, up to the first step of its clock backwards.

    Raises:
        LogError: The log cannot be read.
    """
    design, time, rows, torque = logged_states(path, _MOST, linkage)
    increases = np.append(np.diff(time) > 0, False)  # from each state to the next
    count = int(increases.argmin()) + 1
    period = logged_period(design.mechanism, time[:count], rows[..., :count], torque[:count])
    words = f'{count} states of the log, {rounded(float(time[count - 1]))} s'
    return design, _Motion(path.name, words, period)


def _periodic(name: str, design: Linkage, rpm: float | None) -> _Motion:
    """Computes the motion of a configuration, as `linkage_chart motion` does.

    Raises:
        LinkageError: The configuration has no motion to show.
    """
    has_law = design.drive.law(design.mechanism.structure().driven_link) is not None
    period, (_, about, speed, *_) = period_to_show(name, design, None if has_law else rpm)
    return _Motion(name, f'{about}, {speed}', period)


def _table(period: Period) -> str:
    """Makes a table of the smallest and the largest value of each quantity."""
    rows = [_table_row('', '', 'smallest', 'largest')]
    for name, (unit, values) in period.columns.items():
        if unit.startswith('rad') and not unit.startswith('rad/s'):
            unit, values = f'deg{unit[3:]}', np.degrees(values)
        low, high = (rounded(float(x)) for x in (values.min(), values.max()))
        rows.append(_table_row(name, unit, low, high))
    return f'<table>{"".join(rows)}</table>'


def _table_row(name: str, unit: str, smallest: str, largest: str) -> str:
    """Makes a row of the table."""
    left = (f'<td style="{_CELL} left">{html.escape(cell)}</td>' for cell in (name, unit))
    right = (f'<td style="{_CELL} right">{cell}</td>' for cell in (smallest, largest))
    return f'<tr>{"".join(left)}{"".join(right)}</tr>'


def _frame(page: str) -> str:
    """Embeds a page, whose script must not see the notebook."""
    return (
        f'<iframe sandbox="allow-scripts" style="width: 100%; height: {_HEIGHT}px; border: 0" '
        f'srcdoc="{html.escape(page)}"></iframe>'
    )
