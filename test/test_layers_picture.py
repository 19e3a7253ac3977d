# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The picture of floors, files, libraries and imports in CONTRIBUTING.md is that of the source."""

from __future__ import annotations

import itertools
import sys
from importlib import import_module

import house
import pytest
import test_docs_figures as figures
from pages import ROOT, read


@pytest.fixture(scope='module')
def layers():
    sys.path.insert(0, str(ROOT / 'docs'))
    try:
        yield import_module('layers')
    finally:
        sys.path.remove(str(ROOT / 'docs'))


def test_the_picture_is_that_of_the_imports(layers):
    text = layers.House(layers.floors()).svg()
    assert (ROOT / 'docs' / 'layers.svg').read_text() == text, 'run python docs/layers.py'
    assert '](docs/layers.svg)' in read('CONTRIBUTING.md')
    figures.test_a_drawing_keeps_within_its_edges_and_its_words_apart({'layers': text})


def test_every_file_has_a_room_and_arrows_lead_down(layers):
    floors = layers.floors()
    names = [floor.name for floor in floors]
    assert names == [names[0], *house.FLOORS, names[-1]]
    rooms = [len(floor.rooms) for floor in floors]
    assert sum(rooms) == len(house.MODULES - set(house.FLOORS))
    wrong = [
        (one.name, other.name)
        for one, other in itertools.product(floors, repeat=2)
        if other.name in one.below and names.index(other.name) > names.index(one.name)
    ]
    assert wrong == []
