# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Analyses of linkage_chart: methods, reference solutions, studies and their charts."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from linkage_lab.notebook import Shown, Thing

__version__ = '2.0.0'
__all__ = ['show']


def show(thing: 'Thing', rpm: float | None = None, linkage: str = '') -> 'Shown':
    """Shows a mechanism in a notebook: its sketch, a table, and the page on which it moves.

    Args:
        thing: A mechanism, a drawing, a `Solver`, or what `load` returns; a preset's name, or the
            path of a parameter file or of a log. A log is shown as it moved.
        rpm: Speed of a crank that turns fully, rpm; by default that of the file, or 60.
        linkage: Name of the linkage, if the file or the log has several.

    Returns:
        An object that notebooks display; `str` gives its HTML.

    Raises:
        LinkageError: The file or the mechanism cannot be used.
    """
    from linkage_lab import notebook  # needs Matplotlib

    return notebook.show(thing, rpm, linkage)
