# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Sphinx configuration of the documentation site, which `make docs` builds from the pages.

The pages stay where they are, so that their links also work on a code host. The tables of
README.md and lab/README.md, which list the pages by task, become the navigation. Movies of the
presets are made for the page movies.md.
"""

import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

import linkage_ros

project = 'linkage_ros'
author = copyright = 'The linkage_ros authors'  # noqa: A001 - a name of Sphinx
version = release = linkage_ros.__version__
extensions = [
    'myst_parser', 'sphinx.ext.autodoc', 'sphinx.ext.napoleon', 'sphinx_copybutton',
]  # fmt: skip
root_doc = 'README'
include_patterns = ['*.md', 'docs/*.md', 'docs/site/*', 'lab/*.md', 'lab/docs/*.md']
exclude_patterns = ['.*', 'build', 'demo', 'dist', 'install', 'log', 'site']
myst_heading_anchors = 4
html_theme = 'furo'
html_title = f'linkage_ros {version}'
html_copy_source = False
html_static_path = ['movies.css']
html_css_files = ['movies.css']
default_role = 'py:obj'
autodoc_member_order = 'bysource'
autodoc_typehints_format = 'short'
napoleon_use_ivar = True  # fields of named tuples and data classes are described once
python_use_unqualified_type_names = True


class Movies(SphinxDirective):
    """Shows a thumbnail of every preset, a link to the page on which it moves."""

    def run(self) -> list[nodes.Node]:
        """Returns the grid of thumbnails."""
        cells = [
            f'<a href="../../movies/{name}.html"><img src="../../movies/{name}_sketch.png" alt="" '
            f'loading="lazy">{name}</a>'
            for name in linkage_ros.preset_names()
        ]
        return [nodes.raw('', f'<div class="movies">{"".join(cells)}</div>', format='html')]


def make_movies(app: Sphinx) -> None:
    """Writes a movie of every preset, and its thumbnail, into the site."""
    folder = Path(app.outdir, 'movies')
    folder.mkdir(parents=True, exist_ok=True)
    chart = Path(sys.executable).with_name('linkage_chart')
    for name in linkage_ros.preset_names():
        for words in ('movie', name, folder / f'{name}.html'), ('sketch', name, '--out', folder):
            subprocess.run([chart, *words, '--overwrite'], check=True, stdout=subprocess.DEVNULL)


def add_navigation(_: Sphinx, page: str, source: list[str]) -> None:
    """Makes the navigation from the tables of pages by task."""
    if page not in {'README', 'lab/README'}:
        return
    for section in source[0].split('\n## ')[1:]:
        rows = '\n'.join(row for row in section.splitlines() if row.startswith('|'))
        links = dict.fromkeys(re.findall(r'\]\(([\w/.-]+)\.md\)', rows))
        caption = section.partition('\n')[0]
        lines = ['', '```{toctree}', ':hidden:', f':caption: {caption}', *links, '```', '']
        source[0] += '\n'.join(lines) if links else ''
    if page == 'README':
        source[0] += '\n```{toctree}\n:hidden:\ndocs/site/movies\ndocs/site/api\n```\n'


def hide_tuple_fields(_: Sphinx, __: str, ___: str, field: Any, *rest: Any) -> Any:
    """Omits fields of named tuples, which the class describes under Attributes."""
    return True if type(field).__name__ == '_tuplegetter' else None


def add_index(app: Sphinx, error: Exception | None) -> None:
    """Makes the first page the one that a server shows by default."""
    if error is None:
        shutil.copy(Path(app.outdir, 'README.html'), Path(app.outdir, 'index.html'))


def setup(app: Sphinx) -> None:
    """Registers the functions above."""
    app.add_directive('movies', Movies)
    app.connect('builder-inited', make_movies)
    app.connect('source-read', add_navigation)
    app.connect('autodoc-skip-member', hide_tuple_fields)
    app.connect('build-finished', add_index)
