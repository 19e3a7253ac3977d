# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Draws the house of CONTRIBUTING.md from the imports of the package.

    python docs/layers.py        writes docs/layers.svg anew

The floors, the rooms on them and their imports are what test/house.py reads, and
test/test_layers.py checks.
"""

from __future__ import annotations

import argparse
import ast
import sys
from collections.abc import Iterable
from pathlib import Path

from sheet import Sheet

from linkage_ros.palette import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    SKY,
    VERMILION,
    Color,
    mixed,
)

sys.path.append(str(Path(__file__).parents[1] / 'test'))
import house

_GRAPH = house.graph()
_DOORS, _GROUND = 'executables', 'ground'
_PURPOSES = {
    _DOORS: 'What a shell starts, in thick frames, and what these share.',
    _GROUND: 'What every floor may import.',
}
_MESSAGES = ('rcl_interfaces', '_msgs')  # come with rclpy
# Where the columns begin and end, px from the left.
_NAMES, _ROOMS, _LIBRARIES, _STAIRS, _END = 30, 205, 1120, 1290, 1670
# Heights of a row of rooms, of a room and of the rest of a floor; widths of a letter and a stair.
_ROW, _ROOM, _REST, _LETTER, _STAIR = 38, 30, 58, 11.6, 23
# Dark enough to be read on a pale ground.
_INKS: tuple[Color, ...] = (
    BLUE, VERMILION, mixed(GREEN, BLACK, 0.2), mixed(PURPLE, BLACK, 0.3),
    mixed(ORANGE, BLACK, 0.5), mixed(SKY, BLACK, 0.4), mixed(VERMILION, BLACK, 0.6),
    mixed(BLUE, BLACK, 0.6), mixed(GREEN, BLACK, 0.6), mixed(PURPLE, BLACK, 0.7),
    mixed(ORANGE, BLACK, 0.7), mixed(SKY, BLACK, 0.7), mixed(VERMILION, BLACK, 0.3),
    mixed(BLUE, BLACK, 0.3), mixed(PURPLE, BLACK, 0.5),
    mixed(ORANGE, BLACK, 0.35), BLACK,
)  # fmt: skip


class Floor:
    """A storey: its rooms, and what they know of libraries and of the storeys below.

    Attributes:
        name: Of its folder.
        purpose: What its folder says of itself.
        rooms: Names of its files.
        libraries: That they import; of NumPy only the lowest floor says so, because all know it.
        below: The floors that they import. The ground is known to all.
    """

    def __init__(self, name: str, modules: Iterable[str]) -> None:
        modules = sorted(modules)
        self.purpose = _PURPOSES.get(name) or _first_line(house.PACKAGE / name / '__init__.py')
        self.name, self.rooms = name, [module.rpartition('.')[2] for module in modules]
        known = {
            lib for m in modules for top in (True, False) for lib in house.foreign(m, top=top)
        }
        if name != house.FLOORS[0]:
            known -= {'numpy'}
        self.libraries = sorted(lib for lib in known if not lib.endswith(_MESSAGES))
        found = {storey(other) for m in modules for other in _GRAPH[m] - {'__init__'}}
        self.below = found - {name, _GROUND}


def _first_line(path: Path) -> str:
    return (ast.get_docstring(ast.parse(path.read_text())) or '').partition('\n')[0]


def storey(module: str) -> str:
    """Where a module lies: a floor, above them all, or on the ground that is below them all."""
    folder = module.partition('.')[0]
    if folder in house.FLOORS:
        return folder
    # What has no folder and imports no floor, and is imported by one, is common ground.
    is_common = any(module in _GRAPH[other] for other in _GRAPH if '.' in other)
    leans = {other.partition('.')[0] for other in _GRAPH[module]} & set(house.FLOORS)
    return _GROUND if is_common and not leans else _DOORS


def floors() -> list[Floor]:
    """The ground, the floors and what stands on them, lowest first."""
    rooms = house.MODULES - set(house.FLOORS)  # a folder by itself is no room
    return [
        Floor(name, (module for module in rooms if storey(module) == name))
        for name in (_GROUND, *house.FLOORS, _DOORS)
    ]


def _in_rows(words: list[str], width: float) -> list[list[tuple[float, str]]]:
    """Words beside each other as long as they fit: rows of (place, word), px."""
    rows: list[list[tuple[float, str]]] = [[]]
    place = 0.0
    for word in words:
        step = _LETTER * len(word) + 28
        if rows[-1] and place + step > width:
            rows.append([])
            place = 0.0
        rows[-1].append((place, word))
        place += step
    return rows


class House(Sheet):
    """The picture: places are px from the upper left corner, x + iy with y upwards."""

    def __init__(self, storeys: list[Floor]) -> None:
        """Draws it from the roof down."""
        rooms = [_in_rows(floor.rooms, _LIBRARIES - _ROOMS) for floor in storeys]
        libraries = [_in_rows(floor.libraries, _STAIRS - _LIBRARIES) for floor in storeys]
        rows = [max(map(len, pair)) for pair in zip(rooms, libraries, strict=True)]
        height = sum(_ROW * count + _REST for count in rows)
        super().__init__(_END + 20, height + 64, 1.0, 0j)
        for x, words in (
            (_ROOMS, 'files'), (_LIBRARIES, 'libraries'),
            (_STAIRS, 'imports: from dots to the arrow'),
        ):  # fmt: skip
            self.text(complex(x, -24), words, GREY, anchor='start')
        self._middles: dict[str, float] = {}
        bottom = -float(height + 48)
        for i, floor in enumerate(storeys):
            top = bottom + _ROW * rows[i] + _REST
            ink = GREY if i == 0 else _INKS[i - 1]
            self._floor(floor, rooms[i], libraries[i], (bottom, top), ink)
            bottom = top
        self._stairs(storeys)

    def _floor(
        self, floor: Floor, rooms: list[list[tuple[float, str]]],
        libraries: list[list[tuple[float, str]]], span: tuple[float, float], ink: Color,
    ) -> None:  # fmt: skip
        bottom, top = span
        self._middles[floor.name] = (bottom + top) / 2
        self._box(
            (20, bottom + 3), (_END, top - 3), ink, f'fill:rgb{ink};fill-opacity:0.1;stroke:none'
        )
        self.text(complex(_NAMES, top - 24), floor.name, ink, anchor='start')
        self.text(complex(_ROOMS, top - 24), floor.purpose, ink, anchor='start')
        top -= _REST - 13  # below the words
        for row, words in enumerate(rooms):
            y = top - _ROW * (row + 0.5)
            for x, word in words:
                left, right = _ROOMS + x, _ROOMS + x + _LETTER * len(word) + 18
                # What a shell starts has a door: a thick frame.
                width = 3 if word in house.EDGES and floor.name == _DOORS else 1
                corners = (left, y - _ROOM / 2), (right, y + _ROOM / 2)
                self._box(*corners, ink, f'fill:white;stroke-width:{width}')
                self.text(complex((left + right) / 2, y), word)
        for row, words in enumerate(libraries):
            y = top - _ROW * (row + 0.5)
            for x, word in words:
                self.text(complex(_LIBRARIES + x, y), word, ink, anchor='start')

    def _stairs(self, storeys: list[Floor]) -> None:
        """For each floor that others import a line down to it, with a dot on each of those."""
        used = [floor for floor in storeys if any(floor.name in o.below for o in storeys)]
        for lane, floor in enumerate(reversed(used)):
            x, ink = _STAIRS + 20 + _STAIR * lane, _INKS[storeys.index(floor) - 1]
            users = [self._middles[o.name] for o in storeys if floor.name in o.below]
            self.arrow(complex(x, max(users)), complex(x, self._middles[floor.name]), ink)
            for y in users:
                self.dot(complex(x, y), 5, ink)

    def _box(
        self, low: tuple[float, float], high: tuple[float, float], ink: Color, look: str
    ) -> None:
        (left, bottom), (right, top) = low, high
        corners = ((left, bottom), (right, bottom), (right, top), (left, top), (left, bottom))
        self.line([complex(*corner) for corner in corners], ink, 1, f'style="{look}"')


def main() -> None:
    """Writes the picture."""
    argparse.ArgumentParser(description=__doc__.splitlines()[0]).parse_args()
    Path(__file__).with_suffix('.svg').write_text(House(floors()).svg())


if __name__ == '__main__':
    main()
