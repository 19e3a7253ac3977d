# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Writes the API reference of linkage_ros as HTML, from the docstrings of its public names.

It includes the modules that other packages may import.
"""

from __future__ import annotations

import argparse
import typing
import warnings
from pathlib import Path

import linkage_ros

PUBLIC = (
    'linkage_ros',
    *(
        f'linkage_ros.{name}'
        for name in ('cli', 'extensions', 'formulas', 'palette', 'quantities')
    ),
)


def write(folder: Path) -> None:
    """Writes the reference; treats warnings of pdoc as errors.

    Args:
        folder: Output folder; existing pages are replaced.
    """
    import pdoc  # not needed for `--help`

    for name in linkage_ros.__all__:
        public = getattr(linkage_ros, name)
        if isinstance(public, type) and issubclass(public, tuple):
            # __new__ has no module in which pdoc could resolve the types, so resolve them here.
            public.__new__.__annotations__ = typing.get_type_hints(public)
    pdoc.render.configure(docformat='google', show_source=False)
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        pdoc.pdoc(*PUBLIC, output_directory=folder)


if __name__ == '__main__':
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('folder', type=Path, nargs='?', default=Path('api'), help='default: api')
    write(parser.parse_args().folder)
