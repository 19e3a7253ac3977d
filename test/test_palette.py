# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One palette for Rerun, charts, documents, URDF and RViz: colours are written down once."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

from linkage_ros.palette import BLACK, COLORS, FIRST, GREEN, SECOND, WHITE, fractions, mixed

ROOT = Path(__file__).resolve().parents[1]
PALETTE = ROOT / 'linkage_ros' / 'palette.py'
# Colours in words: hexadecimal, CSS, and the names that matplotlib has for its own palettes.
WORDS = re.compile(
    r'#([0-9a-fA-F]{3,4}|[0-9a-fA-F]{6}|[0-9a-fA-F]{8})|rgba?\(\s*\d.*|C\d|(tab|xkcd|css4):.*|'
    'red|orange|yellow|green|blue|cyan|magenta|purple|violet|pink|brown'
)


def colors_in(source):
    """(line, what stands there) of all that can only be a colour."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            if WORDS.fullmatch(node.value):
                yield node.lineno, node.value
        elif isinstance(node, (ast.Tuple, ast.List)) and len(node.elts) in (3, 4):
            values = [part.value for part in node.elts if isinstance(part, ast.Constant)]
            whole = [value for value in values if type(value) is int and 0 <= value <= 255]
            # Short counts, such as (0, 1, 2), are no colour that anybody could see.
            if len(whole) == len(node.elts) and max(whole) >= 16:
                yield node.lineno, tuple(whole)


FILES = [
    *(ROOT / 'linkage_ros').rglob('*.py'),
    *(ROOT / 'docs').glob('*.py'),
    *(ROOT / 'benchmarks').rglob('*.py'),
]


def test_no_colour_stands_outside_the_palette():
    found = {path: list(colors_in(path.read_text())) for path in FILES if path != PALETTE}
    assert {path.name: colors for path, colors in found.items() if colors} == {}


@pytest.mark.parametrize(
    'source',
    ["'#0072b2'", "'#07b'", "'rgb(0, 114, 178)'", '(0, 114, 178)', '[0, 114, 178, 255]', "'C1'",
     "'tab:blue'", "'red'"],
)  # fmt: skip
def test_a_colour_is_seen_where_it_stands(source):
    assert len(list(colors_in(source))) == 1


@pytest.mark.parametrize('source', ['(0, 1, 2)', '(1.0, 20.0, 3.0)', "'green line'", "'# 12'"])
def test_what_is_no_colour_passes(source):
    assert list(colors_in(source)) == []


def test_rviz_has_the_couplers_colour_for_its_point():
    text = (ROOT / 'rviz' / 'linkage.rviz').read_text()
    _, point = text.split('Name: Coupler point')
    red, green, blue = COLORS['coupler']
    assert re.search(r'Color: (.*)', point)[1] == f'{red}; {green}; {blue}'


def test_mixtures_lie_between():
    assert mixed(GREEN, WHITE, 0.0) == GREEN
    assert mixed(GREEN, WHITE, 1.0) == WHITE
    assert mixed((0, 100, 200), BLACK, 0.5) == (20, 70, 120)
    assert fractions((0, 51, 255)) == (0.0, 0.2, 1.0)


def test_what_is_no_link_has_no_links_colour():
    assert FIRST != SECOND
    assert not {FIRST, SECOND} & set(COLORS.values())


# Where methods, outcomes or modules are told apart, and no mechanism is shown.
LEGENDS = {'accuracy.py', 'integration.py', 'stability.py', 'layers.py'}


def test_colours_of_links_are_taken_by_their_names_alone():
    hues = {'VERMILION', 'BLUE', 'GREEN', 'PURPLE', 'ORANGE', 'SKY'}
    taken = {
        path.name
        for path in FILES
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.ImportFrom) and hues & {alias.name for alias in node.names}
    }
    assert taken == LEGENDS
