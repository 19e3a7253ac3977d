# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Geometry of a linkage drawing, as lines and points, for Rerun and for charts.

All coordinates are m in base_link, x to the right and y up. `positions` and `rates` are those of
the links in n states, rad and m, and per second, of shape (n, links).
"""

import cmath
import math
from contextlib import suppress
from dataclasses import replace
from itertools import pairwise
from typing import Any, NamedTuple, cast

import numpy as np

from linkage_ros.errors import UnreachableError
from linkage_ros.mechanism.axes import axes_of
from linkage_ros.mechanism.base import Mechanism
from linkage_ros.mechanism.exact import UNITS
from linkage_ros.mechanism.solver import Solver
from linkage_ros.mechanism.structure import Point, Structure
from linkage_ros.numeric import Array
from linkage_ros.palette import colors_of
from linkage_ros.view.load_arrows import Complex, LoadArrows, placed
from linkage_ros.view.slot import GUIDE, SIDES, Corner, Slot

# Fractions of the size of the picture: a mark, the unit of the lengths below, which is the size of
# a pivot's triangle; and the maximum length of the scale bar.
_MARK, _SCALE = 0.04, 0.25
_PIVOT_HEIGHT = 1.4  # height of a pivot's symbol with its ground, marks
# Distance of a label from a pin, and from the pin of a slider's block; height of a label; marks.
_LABEL_DISTANCE, _LABEL_BEYOND_BLOCK, _LABEL_HEIGHT = 1.5, 1.9, 1.4
# Corners of a block and midpoints of its sides, marks; how far its guide exceeds the stroke, and
# half the width of its slot, marks.
_BLOCK = np.array([1 + 0.6j, -1 + 0.6j, -1 - 0.6j, 1 - 0.6j, 1, -1, -0.6j])
_OUTLINE, _MIDDLE = (0, 1, 2, 3, 0), 4  # order of the corners, and first of the midpoints
_BEYOND, _HALF_SLOT = 1.6, 0.9
_STEPS_PER_TURN = 360
_BEFORE_END = 1e-9  # distance from the ends of an arc or of a dyad's reach, relative to its length
# Grid of crank angles and slider positions of a mechanism with a free slider.
_ANGLES, _POSITIONS = 72, 121
_SAME_PLACE = 1e-9  # distance of points at one place, relative to the largest distance


class _Axis(NamedTuple):
    """Two points that give the direction of a link.

    Attributes:
        start: Name of the first point.
        end: Name of the second point.
        arm: Vector from the first to the second in the axes of the link, m.
        offset: Instead of `arm`, the distance of the second from the line through the first in the
            direction of the link, along which a rod slides, m.
    """

    start: str
    end: str
    arm: complex = 0j
    offset: float | None = None


class _Guide(NamedTuple):
    """A guide on a moving link.

    Attributes:
        start: Name of a point of the link.
        first: Vector from there to the first end of the guide, in the axes of a link, m.
        last: Vector to its other end.
        spin: Index of the link with these axes; see `Corner`.
    """

    start: str
    first: complex
    last: complex
    spin: int | None


class Picture:
    """Picture of a mechanism.

    Attributes:
        joints: Names of the joints, in the order of the links.
        colors: Colours of the links by name.
        positions: Positions of the links in reach, rad and m, shape (n, links); in the order of
            the motion if the crank angle determines them.
        turning: Names of the links with an angle: all except a slider or rod.
        pivots: The fixed pins, also those of springs and cylinders alone; shape (n, 2), m.
        pivot_names: Names of the pivots.
        pivot_labels: Positions of the labels of the pivots; shape as `pivots`, m.
        unnamed: The mouth of a barrel in a drawing, which has no pin there; else ''.
        pins: Names of the moving points, in the order in which `place` returns them.
        ends: Both pins of each link that turns, and of the rod of a cylinder, whose other end is
            the mouth of its barrel; a lever that turns about its only pin ends at its slot. In the
            order of `joints`.
        owners: Names of the links that own the moving points, by point; the path of a point has
            the colour of its owner. Points on the circle of the crank pin have no owner.
        loaded: Names of the arrows of the loads; see `LoadArrows`.
        traced: Those of the moving points that are traced, or at a traced point.
        paths: Closed paths of the output links' pins and of the traced points, by point; shape
            (n, 2), m. Empty for a mechanism with a free slider.
        ground: Drawing of the fixed link, lines of shape (n, 2), m.
        scale: A scale bar below the drawing, a line of shape (4, 2), m.
        scale_length: Length of the scale bar, m.
        scale_label: The same in words, such as '50 mm'.
        bounds: Lower left and upper right corner of the picture in all positions that the links
            can reach, shape (2, 2), m.
    """

    ARROW_TIP = -2  # point of an arrow

    def __init__(
        self, mechanism: Mechanism, crank_angle: float = 0.0, *, units: str = 'm'
    ) -> None:
        """Computes the fixed parts of the drawing.

        Args:
            mechanism: Mechanism to draw.
            crank_angle: Crank angle at the start, rad; it selects the arc of a crank that cannot
                turn fully.
            units: Unit of the scale bar: 'm', 'cm', 'mm' or 'in'.
        """
        self._units, structure = units, mechanism.structure()
        self._links = structure.links
        self.joints = tuple(link.name for link in self._links)
        self.colors = colors_of(self.joints)
        self.turning = tuple(link.name for link in self._links if not link.slides)
        self.positions = positions = _reach(mechanism, crank_angle)
        drawn = mechanism.drawn
        self._block = drawn.block if drawn else _block_of_lever(structure, positions)
        self._has_slots = drawn is not None  # a cylinder of a drawing is no dyad
        self.unnamed = structure.mouth if drawn and not self._block else ''
        self._find_points(structure, positions, drawn.fixed if drawn else ())
        carriers = self._find_owners(structure)
        swept = self.place(positions)
        in_reach = np.concatenate([self.pivots, swept.reshape(-1, 2)])
        self._mark = _MARK * np.ptp(in_reach, axis=0).max()
        self.paths = dict[str, Array]()
        if mechanism.reach():  # there is no free slider
            self.paths = {pin: swept[:, self.pins.index(pin)] for pin in self.owners}
        self._connect(carriers, self._hidden(mechanism, positions), positions)
        self.ground = self._ground(swept)
        self.pivot_labels = self._pivot_labels(swept)
        self._arrows = LoadArrows(mechanism, self._mark, positions)
        self.loaded = self._arrows.names
        arrows = plane(np.append(self._arrows.reach, self._arrows.farthest(positions)))
        self._enclose(np.concatenate([in_reach, *self.ground, self.pivot_labels, arrows]))

    def _find_points(
        self, structure: Structure, positions: Array, fixed: tuple[tuple[str, complex], ...]
    ) -> None:
        """Finds the fixed points, after which are those of no link, and the moving points."""
        # A dyad's end at a pin of its carrier is that pin.
        self._names = _names_of_places(structure, positions)
        points = {x: point for x, point in structure.points.items() if x == self._names[point]}
        if self._block:
            points.pop(structure.mouth, None)
        self.pins = tuple(name for name, point in points.items() if any(point.weights))
        pivots = {name: point.fixed for name, point in points.items() if name not in self.pins}
        pivots |= fixed
        self._weights = np.array([points[name].weights for name in self.pins])
        self._fixed = np.array([points[name].fixed for name in self.pins])
        self.pivot_names, self.pivots = (*pivots,), plane(np.array([*pivots.values()]))

    def _find_owners(self, structure: Structure) -> dict[str, str]:
        """Finds the ends of the links and the owners of the points.

        Returns:
            The link of each point that is not an end of a link, by point.
        """
        self.ends = dict[str, tuple[str, str]]()
        self.owners = dict[str, str]()
        # The pin of each block, by the index of its link, and the mouth of the barrel of each
        # dyad's rod.
        self._blocks, self._mouths = dict[int, str](), dict[int, str]()
        # The pivot and the other pin of pairs whose direction these give, by the index of the
        # barrel or of the link with the slot.
        self._pairs = dict[int, tuple[str, str]]()
        loop = self._add_loop(structure)
        carriers = self._add_dyads(structure)
        known = {*loop, *carriers, *self.owners}
        for name in self.pins:
            if name not in known:  # a traced point, or else a point of the last link that moves it
                *_, link = np.flatnonzero(structure.points[name].weights)
                carriers[name] = structure.traced.get(name, self.joints[link])
        # A traced point at a pin is that pin.
        links = {self._names[structure.points[x]]: link for x, link in structure.traced.items()}
        self.traced = tuple(name for name in links if name in self.pins)
        self.owners |= {name: links[name] for name in self.traced if name not in self.owners}
        return carriers

    def _add_loop(self, structure: Structure) -> list[str]:
        """Finds the ends and owners in the loop; returns its points in order."""
        (_, last), *_ = structure.closures
        output = self._links[last]
        loop = [self._names[structure.points[x]] for x in _pins_of_the_loop(structure)]
        # The links that turn are in the same order; those of dyads follow.
        self.ends |= zip(self.turning, pairwise(loop), strict=False)
        # The owner of a pin between two links is the later link.
        self.owners |= zip(loop[2:], self.joints[2 : last + 1], strict=False)
        if output.is_guided:
            self._blocks[last] = loop[-1]
        elif output.slides:
            barrel = cast('int', output.parent)
            pivot = next(pin.name for pin in structure.pins if pin.second == barrel)
            pin, mouth = loop[-1], structure.mouth
            if self._block:
                self._add_slot(last, pivot, pin)
            else:
                self.ends |= {self.joints[barrel]: (pivot, mouth), output.name: (mouth, pin)}
                self.owners[mouth] = self.joints[barrel]
                loop.append(mouth)
        return loop

    def _ground(self, swept: Array) -> list[Array]:
        """Draws the pivots, and the guides of the sliders; see `place` for the points."""
        lines = [line for pivot in self.pivots for line in _pivot(pivot, self._mark)]
        for j, pin in self._blocks.items():
            if not self._links[j].is_guided:
                continue
            axis = cmath.rect(1.0, self._links[j].angle)
            path = swept[:, self.pins.index(pin)] @ (1, 1j)
            lines += _rail(path, axis, self._mark)
        return lines

    def _pivot_labels(self, swept: Array) -> Array:
        """Places the labels of pivots below them, or above them if the links are below."""
        is_low = swept[..., 1].mean() < self.pivots[:, 1:]
        above = np.where(is_low, _LABEL_DISTANCE + _LABEL_HEIGHT, -_PIVOT_HEIGHT)
        return np.asarray(self.pivots + self._mark * above * [0.0, 1.0])

    def _enclose(self, everything: Array) -> None:
        """Places the scale bar and the bounds around all points of the drawing, m."""
        mark = self._mark
        low, high = everything.min(axis=0), everything.max(axis=0)
        room = (_LABEL_DISTANCE + _LABEL_HEIGHT) * mark  # room for the names of the pins
        unit = float(UNITS[self._units])
        count = _round_below(_SCALE * (high - low).max() / unit)
        self.scale_length = length = count * unit
        self.scale_label = f'{count:g} {self._units}'
        end = 0.4 * mark  # the ends of the bar are turned up
        self.scale = low - room + np.array([(0, end), (0, 0), (length, 0), (length, end)])
        self.bounds = np.array([low - room - [mark, 2 * mark], high + room])

    def _add_dyads(self, structure: Structure) -> dict[str, str]:
        """Adds the pins of dyads; returns the links that carry their ends, by point."""
        carriers = dict[str, str]()
        for dyad, (_, j) in zip(structure.added, structure.closures[1:], strict=True):
            i = j - 1  # the dyad's links are i and j
            first, last = self.joints[i], self.joints[j]
            start, joint, *others = (self._names[structure.points[x]] for x in dyad.pins)
            if self._links[j].slides and self._links[j].parent == i:
                pivot = joint  # a barrel has no joint
                self._add_rod(j, pivot, start)
                carried_ends = {i: pivot}  # by the index of the dyad's link
            else:
                self.owners[joint] = last
                self.ends[first] = start, joint
                carried_ends = {i: start}
                if others:
                    (end,) = others
                    self.ends[last] = end, joint
                    carried_ends[j] = end
                else:
                    self._blocks[j] = joint
            for link, end in carried_ends.items():
                carrier = self._links[link].parent
                is_pin_of_carrier = end not in dyad.pins
                if carrier is not None and not is_pin_of_carrier:
                    carriers[end] = self.joints[carrier]
        return carriers

    def _add_rod(self, j: int, pivot: str, pin: str) -> None:
        """Adds a dyad's barrel j - 1, which turns about a pivot, and its rod j with a pin."""
        if self._has_slots:
            self._add_slot(j, pivot, pin)
            return
        barrel, rod = self.joints[j - 1 : j + 1]
        self._mouths[j] = mouth = f'mouth of {barrel}'
        self._pairs[j - 1] = pivot, pin
        self.ends |= {barrel: (pivot, mouth), rod: (mouth, pin)}

    def _add_slot(self, j: int, pivot: str, pin: str) -> None:
        """Adds a link that turns about a pivot, and link j, which slides on it and has a pin.

        Link j is a block in a slot of the other, or the other is a block on link j.
        """
        turning, sliding = self.joints[j - 1 : j + 1]
        self._pairs[j - 1] = pivot, pin
        if self._block == turning:
            self._blocks[j - 1] = pivot
            self.ends[sliding] = f'{j - 1} {GUIDE[-1]}', pin
        else:
            self._blocks[j] = pin
            self.ends[turning] = pivot, f'{j} {GUIDE[0]}'

    def _hidden(self, mechanism: Mechanism, positions: Array) -> dict[str, Corner]:
        """Places the corners that are no points of the structure.

        They are the mouths of dyads' barrels and, for each block, named by the index of its link
        and a number, its four corners, the midpoints of three of its sides and, if its guide
        moves, the ends of the guide and the corners of its slot.
        """
        structure, corners = mechanism.structure(), dict[str, Corner]()
        for j, name in self._mouths.items():
            nearest, farthest = positions[:, j].min(), positions[:, j].max()
            inner = nearest if nearest > self._mark else farthest
            pivot, _ = self.ends[self.joints[j - 1]]
            corners[name] = Corner(pivot, inner + self._links[j].origin, j - 1)
        for j, pin in self._blocks.items():
            spin, direction = axes_of(self._links, j)
            block = self._mark * cmath.rect(1.0, direction or 0.0) * _BLOCK
            corners |= {f'{j} {i}': Corner(pin, x, spin) for i, x in enumerate(block.tolist())}
            guide = self._guide_of(j, structure, positions)
            if guide:
                corners |= self._slot_corners(j, guide)
        spins = {corner.spin for corner in corners.values() if corner.spin is not None}
        self._axes = {j: self._axis_of(j, mechanism) for j in spins}
        return corners

    def _guide_of(self, j: int, structure: Structure, positions: Array) -> _Guide | None:
        """Returns the guide of block j; None if it is fixed."""
        link, margin = self._links[j], _BEYOND * self._mark
        if link.parent is not None:
            spin, direction = axes_of(self._links, link.parent)
            start = self._names[structure.point_of(link.parent, (0.0, 0.0))]
            places = _beyond(positions[:, j], margin)
            ends = [link.origin + cmath.rect(x, link.angle) for x in places]
            first, last = (end * cmath.rect(1.0, direction or 0.0) for end in ends)
            return _Guide(start, first, last, spin)
        if j in self._pairs:  # the guide is on the link that slides in this one
            (_, start), rod = self._pairs[j], self._links[j + 1]
            first, last = (-x - rod.origin for x in _beyond(positions[:, j + 1], margin))
            spin, _ = axes_of(self._links, j)
            return _Guide(start, first, last, spin)
        return None

    def _slot_corners(self, j: int, guide: _Guide) -> dict[str, Corner]:
        """Returns the ends of the guide of block j and the corners of its slot, by name."""
        ends, along = (guide.first, guide.last), guide.last - guide.first
        across = _HALF_SLOT * self._mark * (1j * along / abs(along))
        corners = dict[str, Corner]()
        for numbers, aside in zip((GUIDE, *SIDES), (0j, across, -across), strict=True):
            for i, end in zip(numbers, ends, strict=True):
                corners[f'{j} {i}'] = Corner(guide.start, end + aside, guide.spin)
        return corners

    def _axis_of(self, j: int, mechanism: Mechanism) -> _Axis:
        """Returns two points that give the direction of link j."""
        structure, name = mechanism.structure(), self.joints[j]
        if j in self._pairs:
            pivot, pin = self._pairs[j]
            return _Axis(pivot, pin, offset=self._links[j + 1].origin.imag)
        start = self._names[structure.point_of(j, (0.0, 0.0))]
        (end,) = (x for x in self.ends[name] if x != start)
        one, other = (structure.points[x].weights[j] for x in (start, end))
        return _Axis(start, end, arm=other - one or mechanism.parts()[name].length)

    def _connect(
        self, carriers: dict[str, str], corners: dict[str, Corner], positions: Array
    ) -> None:
        """Determines the corners of the links and the directions that labels must avoid.

        Args:
            carriers: The link of each point that is not an end of a link, by point.
            corners: Result of `_hidden`, to which the corners of bars to slots are added.
            positions: Positions in reach.
        """
        carried: dict[str, list[str]] = {link: [] for link in self.joints}
        for point, link in carriers.items():
            carried[link].append(point)
        slots = self._slots(corners, positions)
        shapes = {
            link: _shape(ends, carried[link], slots[link]) for link, ends in self.ends.items()
        }
        sides = [side for shape in shapes.values() for side in pairwise(shape)]
        for j, pin in self._blocks.items():
            link, block = self.joints[j], [f'{j} {i}' for i in range(len(_BLOCK))]
            shapes[link] = _block_shape(block, pin, carried[link], slots[link])
            sides += [(pin, end) for end in (*carried[link], *block[_MIDDLE:])]
        for j in self._blocks:
            if j in self._pairs:  # a rod slides in this block
                shapes[self.joints[j + 1]] += [f'{j} {i}' for i in GUIDE]
        self._shown, self._more = [*self.pins, *self.pivot_names, *corners], [*corners.values()]
        self._corners = {link: [*map(self._shown.index, shapes[link])] for link in self.joints}
        self._find_neighbours(sides)

    def _slots(self, corners: dict[str, Corner], positions: Array) -> dict[str, list[Slot]]:
        """Returns the slots in each link, by the link; see `_connect`."""
        places = self._places(corners, positions)
        slots: dict[str, list[Slot]] = {link: [] for link in self.joints}
        for j in self._blocks:
            carrier = self._links[j].parent
            if j not in self._pairs and carrier is not None:
                slots[self.joints[carrier]].append(Slot(j, places, corners))
        return slots

    def _find_neighbours(self, sides: list[tuple[str, str]]) -> None:
        """Finds the ends of the sides at each pin, between which its label is placed."""
        both_ways = [*sides, *(side[::-1] for side in sides)]
        neighbours = [
            [self._shown.index(end) for start, end in both_ways if start == pin]
            for pin in self.pins
        ]
        most = max(map(len, neighbours))
        # Repeated, so that each pin has the same number of them.
        self._neighbours = [(ends * most)[:most] for ends in neighbours]
        distances = [
            _LABEL_BEYOND_BLOCK if pin in self._blocks.values() else _LABEL_DISTANCE
            for pin in self.pins
        ]
        self._distances = self._mark * np.array(distances)[:, np.newaxis]

    def _places(self, hidden: dict[str, Corner], positions: Array) -> dict[str, complex]:
        """Returns the places of all pins and corners in the first position, m."""
        names = [*self.pins, *self.pivot_names, *hidden]
        self._shown, self._more = names, [*hidden.values()]
        (corners,) = self._all_corners(self.place(positions[:1])) @ (1, 1j)
        return dict(zip(names, corners.tolist(), strict=True))

    def place(self, positions: Array) -> Array:
        """Computes the moving points, in the order of `pins`; shape (n, pins, 2), m."""
        return plane(placed(self._links, self._weights, self._fixed, positions))

    def links(self, points: Array) -> dict[str, Array]:
        """Draws the moving links.

        Args:
            points: Points from `place`, shape (n, pins, 2), m.

        Returns:
            Lines of shape (n, k, 2), m, by the name of the link: its two pins and a triangle
            with each further point, or the block of a slider with a line to each further point;
            then the guides on it.
        """
        corners = self._all_corners(points)
        return {link: corners[:, shape] for link, shape in self._corners.items()}

    def loads(self, positions: Array, rates: Array) -> dict[str, Array]:
        """Draws the arrows of the loads.

        Returns:
            Lines of shape (n, k, 2), m, by the name of the arrow. The first point is the tail;
            the last three are the head: one side, the tip (ARROW_TIP), the other side.
        """
        if not self.loaded:
            return {}
        arrows = self._arrows.lines(positions, rates)
        return {name: plane(lines) for name, lines in arrows.items()}

    def load_values(self, positions: Array, rates: Array) -> dict[str, list[str]]:
        """Returns the sizes of the loads as text, by the name of the arrow; see `loads`."""
        return self._arrows.values(positions, rates) if self.loaded else {}

    def labels(self, points: Array) -> Array:
        """Places the label of each pin in the widest gap between the links around the pin.

        Takes points from `place`, and returns positions of the same shape, m.
        """
        sides = self._all_corners(points)[:, self._neighbours] - points[:, :, np.newaxis]
        angles = np.sort(np.arctan2(sides[..., 1], sides[..., 0]), axis=2)
        gaps = np.diff(angles, axis=2, append=angles[:, :, :1] + 2 * math.pi)
        widest = gaps.argmax(axis=2)[:, :, np.newaxis]
        middle = np.take_along_axis(angles + 0.5 * gaps, widest, axis=2)
        away = self._distances * np.concatenate([np.cos(middle), np.sin(middle)], axis=2)
        # The middle of a label is below its position.
        return np.asarray(points + away + [0.0, 0.5 * _LABEL_HEIGHT * self._mark])

    def _all_corners(self, points: Array) -> Array:
        """Computes pins, pivots and hidden corners in the order of `_shown`, as `place` does."""
        pivots = np.broadcast_to(self.pivots, (len(points), *self.pivots.shape))
        known = np.concatenate([points, pivots], axis=1) @ (1, 1j)
        directions: dict[int | None, Any] = {None: 1.0}
        for spin, axis in self._axes.items():
            directions[spin] = self._directions(known, axis)
        corners = [
            known[:, self._shown.index(start)] + arm * directions[spin]
            for start, arm, spin in self._more
        ]
        return plane(np.column_stack([known, *corners]))

    def _directions(self, known: Complex, axis: _Axis) -> Complex:
        """Returns the direction of a link in n positions, as e^(i angle), from known points."""
        apart = known[:, self._shown.index(axis.end)] - known[:, self._shown.index(axis.start)]
        if axis.offset is None:
            return np.asarray(apart / axis.arm)
        place = np.sqrt(np.maximum(abs(apart) ** 2 - axis.offset**2, 0.0))
        return np.asarray(apart / (place + 1j * axis.offset))


def _shape(ends: tuple[str, str], points: list[str], slots: list[Slot]) -> list[str]:
    """Returns the corners of a link that turns, by its ends, further points, and slots."""
    if slots and ends[1] == slots[0].near:  # a lever, which ends at its slot
        return slots[0].joined([ends[0], *points])
    shape = [*ends]
    for i, point in enumerate(points):
        shape += [point, ends[i % 2]]  # a triangle with both ends
    for slot in slots:
        nearest = min((*ends, *points), key=slot.distance)
        shape += slot.joined([nearest])
    return shape


def _block_shape(block: list[str], pin: str, points: list[str], slots: list[Slot]) -> list[str]:
    """Returns the corners of a block: its outline, then lines from its pin.

    `block` has the names of its corners, in the order of `_BLOCK`; `points` and `slots` are
    further points of its link, and slots in it.
    """
    shape = [block[i] for i in _OUTLINE]
    middle = block[_MIDDLE]
    if points:
        shape.append(middle)  # along a side, then inwards to the pin
    for point in points:
        shape += [pin, point]
    for slot in slots:
        shape += [middle, pin, *slot.joined([pin]), pin, middle]
    return shape


def free_ends(arrows: Array, pins: Array) -> Array:
    """Returns the end of each arrow that is farther from the pins, where its value fits.

    Args:
        arrows: Arrows from `Picture.loads`, shape (n, k, 2), m.
        pins: Points from `Picture.place`, shape (n, pins, 2), m.

    Returns:
        The ends, shape (n, 2), m.
    """
    ends = arrows[:, [0, Picture.ARROW_TIP]]
    far = np.linalg.norm(ends[:, :, np.newaxis] - pins[:, np.newaxis], axis=-1).min(axis=-1)
    return np.asarray(ends[np.arange(len(ends)), far.argmax(axis=1)])


def plane(points: Complex) -> Array:
    """Converts points x + iy to rows of x and y."""
    return np.stack([points.real, points.imag], axis=-1)


def _reach(mechanism: Mechanism, crank_angle: float) -> Array:
    """Samples the positions that the links can reach, in the order of the motion if there is one.

    Args:
        mechanism: Mechanism whose positions are sampled.
        crank_angle: Crank angle at the start, rad, or position of a driven link that slides, m. A
            crank that cannot turn fully stays on the arc that contains this angle.
    """
    solver = Solver(mechanism)
    if solver.mobility is None:
        return _area(solver, mechanism.start()[0][0])
    if solver.reach.turns_fully:
        crank = solver.reach.samples(_STEPS_PER_TURN)
    else:
        start, end = solver.reach.arc_around(crank_angle)
        # Near an end, the links move with the square root of the distance to it, so even steps of
        # the crank would truncate the paths. At the end itself, the rates are infinite.
        even = np.linspace(-1, 1, _STEPS_PER_TURN + 1)
        uneven = (1 - _BEFORE_END) * np.sin(0.5 * math.pi * even)
        crank = 0.5 * (start + end) + 0.5 * (end - start) * uneven
    # Loads do not change the positions, but with friction, not all of them have forces.
    moving = Solver(replace(cast('Any', mechanism), loads=()))
    return np.stack(moving.state(crank).position, axis=-1)


def _block_of_lever(structure: Structure, positions: Array) -> str:
    """Returns the rod of the loop if its barrel must be a lever with a slot, otherwise ''.

    A barrel with a point beyond the places of the rod's pin is not the barrel of a cylinder. This
    is for mechanisms given by lengths.
    """
    (_, last), *_ = structure.closures
    barrel = structure.links[last].parent
    if structure.links[last].is_guided or not structure.links[last].slides or barrel is None:
        return ''
    arms = [
        point.weights[barrel].real
        for name, point in structure.points.items()
        if name != structure.mouth and any(point.weights) and not any(point.weights[:barrel])
    ]
    return structure.links[last].name if max(arms, default=0.0) > positions[:, last].min() else ''


def _area(solver: Solver, start: float) -> Array:
    """Samples where a mechanism with a free slider can be, around a position of the slider, m.

    If all crank angles are possible there, so they are at each sampled position of the slider;
    otherwise, at least one is.
    """
    crank, coupler, rod = (abs(weight) for weight in solver.structure.closure.weights if weight)
    longest = crank + coupler + rod
    sliders = np.linspace(-longest, longest, _POSITIONS)
    angles = np.linspace(0, 2 * math.pi, _ANGLES, endpoint=False)
    slider, angle = np.meshgrid(sliders, angles, indexing='ij')
    # The coupler and the rod are a dyad between the crank pin and the slider's pin.
    distance = abs(slider - crank * np.exp(1j * angle))
    margin = _BEFORE_END * longest
    closes = (distance > abs(coupler - rod) + margin) & (distance < coupler + rod - margin)
    # Keep the slider's positions that are connected with the start.
    closes &= _rows_around(int(abs(sliders - start).argmin()), closes)[:, np.newaxis]
    positions = []
    for q in zip(angle[closes].tolist(), slider[closes].tolist(), strict=True):
        with suppress(UnreachableError):  # a dyad may not close
            positions.append(solver.state(q).position)
    return np.array(positions)


def _rows_around(start: int, closes: Array) -> Array:
    """Returns which rows of a grid are in the range around the row of the start; see `_area`.

    The grid `closes` states whether the dyad closes, by slider position and by crank angle.
    """
    is_possible = closes.all(axis=1) if closes[start].all() else closes.any(axis=1)
    gaps = np.flatnonzero(~is_possible)
    before = gaps[gaps < start].max(initial=-1)
    after = gaps[gaps > start].min(initial=len(closes))
    rows = np.arange(len(closes))
    return np.asarray((before < rows) & (rows < after))


def _names_of_places(structure: Structure, positions: Array) -> dict[Point, str]:
    """Returns the name of each point: the first one that is always at its place."""
    points, names = structure.points.values(), [*structure.points]
    weights, fixed = np.array([x.weights for x in points]), np.array([x.fixed for x in points])
    paths = placed(structure.links, weights, fixed, positions)
    near = _SAME_PLACE * abs(paths).max()
    # A pin of a moving link is none of the frame's, even at rest.
    are_moving = np.array([any(x.weights) for x in points])
    names_of_points = dict[Point, str]()
    for point, path, is_moving in zip(points, paths.T, are_moving, strict=True):
        is_same = (abs(paths.T - path).max(axis=1) <= near) & (are_moving == is_moving)
        names_of_points[point] = names[int(is_same.argmax())]
    return names_of_points


def _pins_of_the_loop(structure: Structure) -> list[str]:
    """Returns the names of the pins between the links that turn, in the order of the loop."""
    names = {point: name for name, point in reversed(structure.points.items())}
    weights, zeros = structure.closure.weights, (0j,) * len(structure.links)
    pins = []
    for count in range(sum(map(bool, weights)) + 1):
        # The structure may give a pin by the links before it in the loop, or by those after it.
        by_links_before = Point(weights[:count] + zeros[count:])
        after = tuple(-weight for weight in weights[count:])
        by_links_after = Point(zeros[:count] + after, -structure.closure.fixed)
        pins.append(names.get(by_links_before) or names[by_links_after])
    return pins


def _pivot(pivot: Array, size: float) -> list[Array]:
    """Draws the symbol of a fixed pivot: a triangle on hatched ground."""
    shapes: list[list[tuple[float, float]]] = [
        [(0, 0), (-0.6, -1), (0.6, -1), (0, 0)],
        [(-1, -1), (1, -1)],
        *([(x, -1), (x - 0.4, -_PIVOT_HEIGHT)] for x in (-0.6, -0.2, 0.2, 0.6, 1.0)),
    ]
    return [pivot + size * np.array(shape) for shape in shapes]


def _round_below(length: float) -> float:
    """Rounds down to 1, 2 or 5 times a power of ten."""
    decade = 10.0 ** math.floor(math.log10(length))
    return max(digit * decade for digit in (1.0, 2.0, 5.0) if digit * decade <= length)


def _beyond(stroke: Array, room: float) -> tuple[float, float]:
    """Returns the ends of a guide, which exceeds the stroke at both ends, m."""
    return float(stroke.min()) - room, float(stroke.max()) + room


def _rail(path: Complex, axis: complex, size: float) -> list[Array]:
    """Draws hatched ground below a slider, as long as its stroke."""
    along = path * axis.conjugate()
    below = 1j * (along.imag.mean() - 0.6 * size)
    start, end = along.real.min() - 1.6 * size, along.real.max() + 1.6 * size
    marks = np.linspace(start, end, round((end - start) / (0.8 * size)) + 1)[1:]
    lines = [[start, end], *([x, x - (0.4 + 0.4j) * size] for x in marks)]
    return [plane((np.array(line) + below) * axis) for line in lines]
