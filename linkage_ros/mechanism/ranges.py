# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Finds motions outside the range of validity of a load.

Beyond the points of a load curve over position, its end values apply. Self-acting valves require
that the slider reverses only at the ends of its stroke; the crank must therefore not reverse
inside it.
"""

import math
from collections.abc import Iterable, Sequence

import numpy as np

from linkage_ros.errors import ConfigurationError
from linkage_ros.mechanism.kinematics import State
from linkage_ros.mechanism.loads.base import Range, continuous
from linkage_ros.mechanism.solver import Solver
from linkage_ros.mechanism.structure import Link
from linkage_ros.units import place_words

_ROUNDING = 1e-9  # relative to the span of the points


class Ranges:
    """Compares the states of a motion with load curves over position, and with valves."""

    def __init__(self, solver: Solver) -> None:
        """Collects the ranges of the loads."""
        self._solver, mechanism = solver, solver.mechanism
        self._links = solver.structure.links
        self._valid = dict[str, Range]()
        self._one_way = dict[str, Range]()
        for load in mechanism.loads:
            if valid := load.valid_range(mechanism):
                self._valid[load.label] = valid
            if one_way := load.one_way(mechanism):
                self._one_way[load.label] = one_way
        self._last_sign = 0.0  # of the crank's rate, where it was not 0
        self._has_reversed = False
        self._outside = dict[str, tuple[float, float]]()  # lowest and highest position seen
        self._noted: set[str] = set()

    def require_valves(self, reversals: Iterable[float]) -> None:
        """Checks that the crank angles of reversals, rad, are ends of the stroke of valves.

        Raises:
            ConfigurationError: It reverses inside the stroke.
        """
        driven = self._solver.structure.driven_link
        for angle in reversals if self._one_way else ():
            position = self._solver.state(angle).position
            for label, (link, low, high, _) in self._one_way.items():
                if low < position[link] < high:
                    raise ConfigurationError(
                        f'{label}: the {driven.driven_word} reverses at '
                        f'{place_words(angle, driven.units)}, inside the stroke, where the valves '
                        'would not switch at once; leave outlet out for a closed cylinder, or '
                        'keep a crank turning'
                    )

    def see(self, state: State) -> None:
        """Compares a state, or an array of states, with the curves and valves."""
        if self._one_way:
            signs = np.sign(np.append(self._last_sign, state.velocity[0]))
            signs = signs[signs != 0]
            if np.any(signs != signs[:1]):
                self._has_reversed = True
            self._last_sign = float(signs[-1]) if len(signs) else 0.0
        for label, valid in self._valid.items():
            position = continuous(state.position[valid.link], valid.middle)
            lowest, highest = float(np.min(position)), float(np.max(position))
            room = _ROUNDING * (valid.high - valid.low)
            if valid.low - room <= lowest and highest <= valid.high + room:
                continue
            before = self._outside.get(label, (math.inf, -math.inf))
            self._outside[label] = min(before[0], lowest), max(before[1], highest)

    def notes(self) -> list[str]:
        """Returns a line for each load that is not valid for the motion, once."""
        lines = []
        if self._has_reversed:
            lines += [
                f'{label}: the crank has reversed; inside the stroke, the valves would not '
                'switch at once, so that the pressure there is wrong; keep the crank turning'
                for label in self._one_way
            ]
            self._one_way, self._has_reversed = {}, False
        for label, (low, high) in list(self._outside.items()):  # another thread may add to it
            if label not in self._noted:
                self._noted.add(label)
                lines.append(self._note_of_curve(label, low, high))
        return lines

    def _note_of_curve(self, label: str, low: float, high: float) -> str:
        """Returns the line for a load curve whose link has been from `low` to `high`."""
        valid = self._valid[label]
        body = self._links[valid.link]
        room = _ROUNDING * (valid.high - valid.low)
        beyond = []
        if low < valid.low - room:
            beyond.append(low)
        if high > valid.high + room:
            beyond.append(high)
        span = _positions([valid.low, valid.high], body)
        return (
            f'{label}.at spans {span}, and the {body.name} has been at '
            f'{_positions(beyond, body)}: beyond the points, the end values apply'
        )


def _positions(values: Sequence[float], link: Link) -> str:
    """Formats positions of a link, such as '0.1 to 0.2 m'."""
    numbers = ' to '.join(f'{x:.6g}' for x in values)
    if link.slides:
        return f'{numbers} m'
    degrees = ' to '.join(f'{math.degrees(x):.6g}' for x in values)
    return f'{numbers} rad ({degrees} deg)'
