# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Parses the pages of the documentation, for tests that compare them with the code."""

import ast
import re
import shlex
import sys
import textwrap
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[1]
PACKAGE_FILES = sorted(
    path for name in ('linkage_ros', 'lab/linkage_lab') for path in (ROOT / name).rglob('*.py')
)
PAGES = (
    *('README.md', 'CONTRIBUTING.md', 'QUALITY_DECLARATION.md'),
    *sorted(
        str(path.relative_to(ROOT))
        for folder in ('docs', 'lab', 'lab/docs')
        for path in (ROOT / folder).glob('*.md')
    ),
)
# A block is fenced, or indented by four columns after a blank line.
_BLOCK = re.compile(
    r'^```\w*\n(.*?)^```$|(?:\A|(?<=\n\n))((?: {4}[^\n]*\n|\n(?= {4}))+)', re.MULTILINE | re.DOTALL
)
# A shell command begins with one of these, or with an environment variable before it.
_COMMAND = re.compile(
    r'(?:[A-Z_]+=\S+ )*(linkage_\w+|python|pytest|make|pip|ros2|colcon|rosdep|source|\.|rerun'
    r'|rosbags-convert|plotjuggler|fastdds|apt|npm)(?= |$)'
)


class Command(NamedTuple):
    """A command line of a page.

    Attributes:
        words: Words of the command, without leading variables and trailing comments.
        is_block: Whether the command is in a block, to be copied, not within a sentence.
    """

    words: tuple[str, ...]
    is_block: bool


def read(page):
    return (ROOT / page).read_text()


def blocks(text):
    return [textwrap.dedent(one or other).strip('\n') for one, other in _BLOCK.findall(text)]


def block(text, words):
    """Returns the only block of a page that contains these words."""
    (found,) = [one for one in blocks(text) if words in one]
    return found


def is_python(text):
    """Returns whether a block is a Python program, which imports something."""
    try:
        tree = ast.parse(text)
    except SyntaxError:
        return False
    return any(isinstance(part, (ast.Import, ast.ImportFrom)) for part in ast.walk(tree))


def run_python(text, page, names=None):
    """Executes a Python block of a page; `names` is its namespace."""
    exec(compile(text, page, 'exec'), {} if names is None else names)


def page_files(text):
    """Returns the parameter files and CSV files of a page, by the name in their first line."""
    found = [re.match(r'# (\w+\.(?:yaml|csv))\n', one) for one in blocks(text)]
    return {
        match[1]: match.string[match.end() if match[1].endswith('csv') else 0 :] + '\n'
        for match in found
        if match
    }


def load_script(name):
    """Imports a script of docs, such as reference.py."""
    spec = spec_from_file_location(name, ROOT / 'docs' / f'{name}.py')
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def links(text):
    """Returns the targets of links and pictures, without anchors."""
    return re.findall(r'\]\(([^)#\s]+)', text) + re.findall(r'(?:src|href)="([^"#]+)', text)


def commands(text):
    """Returns the command lines in blocks and sentences; a bare name is not a command."""
    found = []
    for match in _BLOCK.finditer(text):
        lines = textwrap.dedent(match[1] or match[2]).replace('\\\n', ' ').splitlines()
        found += [(line, True) for line in lines]
    for paragraph in re.split(r'\n\n|(?<=\|)\n', _BLOCK.sub('', text)):
        spans = re.findall(r'`([^`]+)`', paragraph)
        found += [(' '.join(span.split()), False) for span in spans if ' ' in span]
    return [
        Command(tuple(shlex.split(line[match.start(1) :], comments=True)), is_block)
        for line, is_block in found
        if (match := _COMMAND.match(line))
    ]


def write_programs(folder):
    """Writes the Python programs of the pages to a folder, for a type checker."""
    folder.mkdir(parents=True, exist_ok=True)
    for page in PAGES:
        for number, text in enumerate(filter(is_python, blocks(read(page)))):
            name = re.sub(r'\W', '_', f'{page.removesuffix(".md")}_{number}')
            (folder / f'{name}.py').write_text(f'{text}\n')


if __name__ == '__main__':
    write_programs(Path(sys.argv[1]))
