# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Docstrings name the attributes that a class has; of arguments and errors ruff sees to that."""

from __future__ import annotations

import ast
import re

import pytest
from pages import ROOT

FILES = sorted([*(ROOT / 'linkage_ros').rglob('*.py'), *(ROOT / 'docs').rglob('*.py')])


def classes(source):
    return [node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.ClassDef)]


def named(cls):
    """What the docstring's section lists; None: it has no section."""
    section = re.search(r'Attributes:\n((?:    .*\n?|\n)+)', ast.get_docstring(cls) or '')
    return section and set(re.findall(r'^    (\w+):', section[1], re.MULTILINE))


def attributes(cls):
    """Public fields, and what methods set."""
    found = {
        part.target.id
        for part in cls.body
        if isinstance(part, ast.AnnAssign) and isinstance(part.target, ast.Name)
    }
    for part in ast.walk(cls):
        if isinstance(part, ast.Attribute) and isinstance(part.ctx, ast.Store):
            found |= {part.attr} if ast.unparse(part.value) == 'self' else set()
    return {name for name in found if not name.startswith('_')}


def differences(source):
    """(class, names that are missing or too many) where a section is not what the class has."""
    return [
        (cls.name, names ^ attributes(cls))
        for cls in classes(source)
        if (names := named(cls)) is not None and names != attributes(cls)
    ]


@pytest.mark.parametrize('path', FILES, ids=lambda path: str(path.relative_to(ROOT)))
def test_attributes_are_those_of_the_class(path):
    assert differences(path.read_text()) == []


def test_a_wrong_name_is_found():
    source = '''
class Link:
    """A link.

    Attributes:
        length: m.
        mass: kg,
            without the pins.
    """

    length: float

    def __init__(self):
        self.weight = self._other = 0
'''
    assert differences(source) == [('Link', {'mass', 'weight'})]
    assert differences(source.replace('weight', 'mass')) == []
