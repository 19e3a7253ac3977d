# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The slot of a block in a moving link: its outline, and the bars that join pins to it."""

from typing import NamedTuple

# Numbers of the corners of a slot, after the index of its block: the middles of its ends, and its
# sides from one end to the other.
GUIDE, SIDES = (7, 8), ((9, 10), (11, 12))


class Corner(NamedTuple):
    """A corner of a drawn link that is no point of the structure.

    Attributes:
        start: Name of the point from which it is placed.
        arm: Vector from there, in the axes of a link, m.
        spin: Index of that link; None for the axes of base_link.
    """

    start: str
    arm: complex
    spin: int | None


class Slot:
    """A slot: a rectangle, to which pins are joined.

    Attributes:
        near: Name of the middle of its first end.
    """

    def __init__(self, j: int, at: dict[str, complex], corners: dict[str, Corner]) -> None:
        """Names the corners of the slot of block j.

        Ports, which are places on a side that are joined to a pin, are added to the places `at` in
        one position, m, and to the corners.
        """
        self._at, self._corners, self._name = at, corners, str(j)
        self.near, self._far = (f'{j} {i}' for i in GUIDE)
        self._sides = [[f'{j} {i}' for i in side] for side in SIDES]

    def _port(self, pin: str) -> tuple[str, complex]:
        """Returns the nearest place on the outline to a pin: its name, and its place, m."""
        at, (left, right) = self._at, self._sides
        share = (at[pin] - at[self.near]) / (at[self._far] - at[self.near])
        if not 0 < share.real < 1:
            name = self.near if share.real <= 0 else self._far
            return name, at[name]
        side = left if share.imag >= 0 else right
        return f'{self._name} {pin}', at[side[0]] + share.real * (at[side[-1]] - at[side[0]])

    def _add(self, port: str, place: complex) -> None:
        """Adds a port at a place, m, on the outline: to the places, the corners and its side."""
        at = self._at

        def detour(side: list[str]) -> float:
            """Returns the way from end to end of a side via the place, shortest on its own."""
            return abs(place - at[side[0]]) + abs(place - at[side[-1]])

        side = min(self._sides, key=detour)
        first, last = side[0], side[-1]
        share = abs(place - at[first]) / abs(at[last] - at[first])
        start, end = self._corners[first], self._corners[last]
        self._corners[port] = start._replace(arm=start.arm + share * (end.arm - start.arm))
        at[port] = place
        side.append(port)
        side.sort(key=lambda corner: abs(at[corner] - at[first]))

    def distance(self, pin: str) -> float:
        """Returns the distance of a pin from the outline, m."""
        return abs(self._at[pin] - self._port(pin)[1])

    def joined(self, pins: list[str]) -> list[str]:
        """Joins pins to the slot, each at its nearest place or to a nearer pin.

        Returns the corners of one line through all bars and around the slot, from the first pin.
        """
        at, bars = self._at, dict[str, list[str]]()
        for pin in sorted(pins, key=self.distance):
            port, place = self._port(pin)
            known = [x for x in pins if x in bars]
            other = min(known, key=lambda x: abs(at[x] - at[pin]), default=pin)
            if 0 < abs(at[other] - at[pin]) < self.distance(pin):
                port = other
            elif port not in at:
                self._add(port, place)
            bars.setdefault(port, []).append(pin)
            bars.setdefault(pin, []).append(port)
        return self._walk(pins[0], bars, set())

    def _walk(self, start: str, bars: dict[str, list[str]], done: set[str]) -> list[str]:
        """Returns the corners of a line from one corner along all bars and back to it."""
        outline = [self.near, *self._sides[0], self._far, *reversed(self._sides[1])]
        line = [start]
        done.add(start)
        if start in outline and self._name not in done:
            done.add(self._name)
            i = outline.index(start)
            for corner in (*outline[i + 1 :], *outline[:i]):
                line += self._walk(corner, bars, done)
            line.append(start)
        for end in bars.get(start, ()):
            if end not in done:
                line += [*self._walk(end, bars, done), start]
        return line
