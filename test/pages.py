# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The pages of the documentation, taken apart for the tests that hold them to the code."""

from __future__ import annotations

import ast
import re
import shlex
import textwrap
from dataclasses import MISSING
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[1]
PAGES = (
    *('README.md', 'CONTRIBUTING.md'),
    *sorted(f'docs/{path.name}' for path in (ROOT / 'docs').glob('*.md')),
)
# A block is fenced, or stands four columns in after a blank line.
_BLOCK = re.compile(
    r'^```\w*\n(.*?)^```$|(?:\A|(?<=\n\n))((?: {4}[^\n]*\n|\n(?= {4}))+)', re.MULTILINE | re.DOTALL
)
# What a shell is told begins with one of these, or with a variable before it.
_COMMAND = re.compile(
    r'(?:[A-Z_]+=\S+ )*(linkage_\w+|python|pytest|make|pip|ros2|colcon|rosdep|source|\.|rerun'
    r'|rosbags-convert|plotjuggler|fastdds|apt|npm)(?= |$)'
)


class Command(NamedTuple):
    """A command line of a page.

    Attributes:
        words: Of it, without variables before it and remarks behind it.
        is_block: Whether it stands in a block, to be copied, and not within a sentence.
        near: What stands about it: its block and the paragraphs around it, or its own paragraph.
    """

    words: tuple[str, ...]
    is_block: bool
    near: str


def read(page):
    return (ROOT / page).read_text()


def blocks(text):
    return [textwrap.dedent(one or other).strip('\n') for one, other in _BLOCK.findall(text)]


def block(text, words):
    """The one block of a page that holds these words."""
    (found,) = [one for one in blocks(text) if words in one]
    return found


def is_python(text):
    """Whether a block is a program: formulas and shell lines import nothing."""
    try:
        tree = ast.parse(text)
    except SyntaxError:
        return False
    return any(isinstance(part, (ast.Import, ast.ImportFrom)) for part in ast.walk(tree))


def run_python(text, page, names=None):
    """Runs a block as it stands, or what was made of it."""
    exec(compile(text, page, 'exec'), {} if names is None else names)


def parameter_row(name, quantity, default):
    """The row of a parameter in a table of name, valid values, default and meaning."""
    span = f'{brief(quantity.low)} to {brief(quantity.high)} {quantity.unit}'
    values = {
        'number': span,
        'pair': f'two, {span}',
        'choice': ', '.join(f'`{word}`' for word in quantity.choices),
        'text': f'`{quantity.pattern}`' if quantity.pattern else 'text',
        'switch': '`true`, `false`',
    }[quantity.kind]
    if default is MISSING:
        shown = 'required'
    elif default is None:
        shown = '-'
    else:
        shown = f'`{in_yaml(default)}`'
    return f'| `{name}` | {values} | {shown} | {quantity.meaning} |'


def brief(number):
    """A float in few letters: 1e-9, 0, 1000, 1e12."""
    mantissa, _, power = f'{number:g}'.partition('e')
    return f'{mantissa}e{int(power)}' if power else mantissa


def in_yaml(value):
    """A value as a parameter file may have it."""
    if isinstance(value, float):
        return repr(value) if abs(value) < 1e6 else brief(value).replace('e', '.0e')
    if isinstance(value, bool):
        return str(value).lower()
    return (value or "''") if isinstance(value, str) else str(list(value))


def links(text):
    """Where links and pictures lead, without the place on a page."""
    return re.findall(r'\]\(([^)#\s]+)', text) + re.findall(r'(?:src|href)="([^"#]+)', text)


def commands(text):
    """The command lines of a page, of blocks and of sentences; a name alone is no command."""
    found = []
    for match in _BLOCK.finditer(text):
        before, after = text[: match.start()].rstrip('\n'), text[match.end() :].lstrip('\n')
        near = '\n'.join((before.rpartition('\n\n')[2], match[0], after.partition('\n\n')[0]))
        lines = textwrap.dedent(match[1] or match[2]).replace('\\\n', ' ').splitlines()
        found += [(line, True, near) for line in lines]
    for paragraph in re.split(r'\n\n|(?<=\|)\n', _BLOCK.sub('', text)):
        spans = re.findall(r'`([^`]+)`', paragraph)
        found += [(' '.join(span.split()), False, paragraph) for span in spans if ' ' in span]
    return [
        Command(tuple(shlex.split(line[match.start(1) :], comments=True)), is_block, near)
        for line, is_block, near in found
        if (match := _COMMAND.match(line))
    ]
