# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The pages of the documentation, taken apart for the tests that hold them to the code."""

import ast
import re
import shlex
import textwrap
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[1]
PACKAGE_FILES = sorted((ROOT / 'linkage_ros').rglob('*.py'))
PAGES = (
    *('README.md', 'CONTRIBUTING.md', 'QUALITY_DECLARATION.md'),
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


def page_files(text):
    """The parameter files that a page shows: their text by the name in their first line."""
    found = [re.match(r'# (\w+\.yaml)\n', one) for one in blocks(text)]
    return {match[1]: match.string + '\n' for match in found if match}


def load_script(name):
    """A script of docs: reference.py, which makes the tables of the reference, or another."""
    spec = spec_from_file_location(name, ROOT / 'docs' / f'{name}.py')
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


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
