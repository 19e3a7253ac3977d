# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Tells which load curves over position a motion has left, where their end values apply."""

import math
from typing import Any

import numpy as np

from linkage_ros.mechanism.kinematics import State
from linkage_ros.mechanism.loads import continuous
from linkage_ros.mechanism.solver import Solver

_ROUNDING = 1e-9  # relative to the span of the points


class Ranges:
    """Compares the states of a motion with the points of load curves over position."""

    def __init__(self, solver: Solver) -> None:
        """Collects the curves.

        Args:
            solver: Solver of the mechanism.
        """
        loads: tuple[Any, ...] = solver.model.loads
        self._links = solver.structure.links
        names = solver.mechanism.load_names()
        labels = {load.name or load.group: load.label for load in solver.mechanism.loads}
        self._curves = {
            labels[name]: (load.over, load.middle, ends)
            for name, load in zip(names, loads, strict=True)
            if (ends := getattr(load, 'ends', None))
        }
        self._found: dict[str, tuple[float, float]] = {}
        self._said: set[str] = set()

    def see(self, state: State) -> None:
        """Takes note of a state, or of an array of states."""
        for label, (link, middle, (low, high)) in self._curves.items():
            place = continuous(state.position[link], middle)
            room = _ROUNDING * (high - low)
            if np.all((low - room <= place) & (place <= high + room)):
                continue
            before = self._found.get(label, (math.inf, -math.inf))
            self._found[label] = (
                min(before[0], float(np.min(place))), max(before[1], float(np.max(place)))
            )  # fmt: skip

    def notes(self) -> list[str]:
        """Returns a line for each curve that the motion has left since the last call."""
        lines = []
        for label, (low, high) in self._found.items():
            if label in self._said:
                continue
            self._said.add(label)
            link, _, ends = self._curves[label]
            body, room = self._links[link], _ROUNDING * (ends[1] - ends[0])
            beyond = [low] if low < ends[0] - room else []
            beyond += [high] if high > ends[1] + room else []

            def words(*values: float, slides: bool = body.slides) -> str:
                meters = ' to '.join(f'{x:.6g}' for x in values)
                degrees = ' to '.join(f'{math.degrees(x):.6g}' for x in values)
                return f'{meters} m' if slides else f'{meters} rad ({degrees} deg)'

            lines.append(
                f'{label}.at spans {words(*ends)}, and the {body.name} has been at '
                f'{words(*beyond)}: beyond the points, the end values apply'
            )
        return lines
