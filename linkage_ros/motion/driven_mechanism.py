# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A mechanism under a torque, as a first-order system for integrators.

Near a singularity of the mechanism's own coordinates, such as a dead centre or a stretched dyad,
the motion is integrated in its other coordinates. After the singularity, its own coordinates are
used again, possibly in the other assembly.
"""

import functools
import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from fractions import Fraction
from statistics import median
from typing import Any, NoReturn

import numpy as np

from linkage_ros.errors import LinkageError, MotionError
from linkage_ros.mechanism.base import Description
from linkage_ros.mechanism.conditions import OWN_CONDITIONS, Conditions
from linkage_ros.mechanism.kinematics import FULL_TURN, State
from linkage_ros.mechanism.parts import CROSSED, OPEN
from linkage_ros.mechanism.solver import Solver
from linkage_ros.motion.runge_kutta import Plant, jacobian, slope_at
from linkage_ros.numeric import Real, with_turns, within_two_turns, wrap
from linkage_ros.units import rad_and_deg

_PLACES = 12  # number of crank angles per arc at which eigenvalues are computed
_SLOW = 1e-3  # rad/s or m/s, treated as rest
_NEAR = 0.05  # sine of the dyad angle below which the dyad is considered in line
# Sines of the dyad angle at which the motion leaves its own coordinates and returns to them.
_LEAVE, _RETURN = 0.1, 0.2


@dataclass(eq=False)
class DrivenMechanism:
    """A mechanism under a torque: y' = slope(y), where y are coordinates, then their rates.

    Attributes:
        solver: Solver of the mechanism in the current coordinates.
        torque: Torque on the crank, N m, as a function of its speed, rad/s; for a driven slide,
            force, N, as a function of its rate, m/s.
        middle: If a driven crank is not a coordinate, the middle of the arc on which it moves,
            rad.
        solvers: Solvers for all descriptions used so far.
        conditions: Conditions of the motion; the values of its forces may change.
        links: The links whose positions are the coordinates.
        units: Units of the errors in y: rad or crank lengths, then the same per second.
        driven: Index of the driven link.
        turns: Whether the driven link is a crank, whose turns are counted.
        has_driven: Whether the driven link is the first coordinate.
        is_own: Whether the current coordinates are the mechanism's own coordinates.
        is_usual: Whether the current coordinates and assembly are the mechanism's own.
        is_limited: Whether the coordinates are singular at positions other than change points.
    """

    solver: Solver
    torque: Callable[[Any], Real]
    middle: float = 0.0
    solvers: dict[Description, Solver] = field(default_factory=dict)
    conditions: Conditions = OWN_CONDITIONS

    def __post_init__(self) -> None:
        solver, mechanism = self.solver, self.solver.mechanism
        structure = solver.structure
        moving = structure.indices_of(solver.coordinates)
        self.links = tuple(structure.links[j] for j in moving)
        self.units = 2 * tuple(
            mechanism.crank.length if link.slides else 1.0 for link in self.links
        )
        self.driven = structure.driven
        self.turns = not structure.driven_link.slides
        self.has_driven = moving[0] == self.driven
        self.is_own = solver.coordinates == mechanism.coordinates
        self.is_usual = solver.description == mechanism.description
        self.is_limited = solver.mobility is None or not solver.mobility.turns_fully

    def wound(self, y: tuple[float, ...]) -> tuple[tuple[float, ...], int]:
        """Removes pairs of whole turns from the crank angle in y; returns y and their number."""
        if not (self.has_driven and self.turns):
            return y, 0
        angle, pairs = within_two_turns(y[0])
        return (angle, *y[1:]), pairs

    def position(self, y: tuple[float, ...], pairs: int) -> float:
        """Returns the position of the driven link, rad or m, including all turns of a crank.

        Args:
            y: Coordinates, then their rates.
            pairs: Pairs of whole turns removed from the crank angle in y.
        """
        place: float = y[0] if self.has_driven else self._state(y).position[self.driven]
        if not self.turns:
            return place
        if self.has_driven:
            return with_turns(place, pairs)
        return with_turns(place, pairs + turns_between(place, self.middle))

    def described(self, description: Description) -> 'DrivenMechanism':
        """Returns this driven mechanism in another description."""
        self.solvers.setdefault(self.solver.description, self.solver)
        if description not in self.solvers:
            self.solvers[description] = self.solver.described(description)
        return replace(self, solver=self.solvers[description])

    def ready(self, y: tuple[float, ...]) -> tuple['DrivenMechanism', tuple[float, ...], float]:
        """Chooses the best coordinates for the motion.

        Returns:
            The driven mechanism in the chosen coordinates, y in these coordinates, and the
            estimated time until they become singular, s.
        """
        if not self.is_limited:
            return self, y, math.inf
        sines, count = self.solver.dyad_sines(y), len(self.solver.structure.dyads)
        own, others = sines[:count], sines[count:]
        if others and (own[0].sine < _LEAVE or not self.is_own):
            better = self._better(y, own[0].sine, others[0].sine)
            if better:
                driven, y = self.redescribed(y, better)
                return driven.ready(y)
        times = [dyad.sine / -dyad.rate for dyad in own if dyad.rate < 0]
        return self, y, min(times, default=math.inf)

    def _better(self, y: tuple[float, ...], sine: float, other_sine: float) -> tuple[str, ...]:
        """Selects new coordinates, given the sines of the dyads; empty to keep the current ones.

        `other_sine` is that of the dyad in the other coordinates.
        """
        mechanism = self.solver.mechanism
        is_worse = sine < _LEAVE and other_sine > 2 * sine
        if self.is_own:
            return mechanism.other_coordinates if is_worse else ()
        if is_worse or other_sine > _RETURN:
            return mechanism.coordinates
        first = 1 if self.has_driven else 0  # the turns of a driven crank are counted instead
        undriven = zip(y[first:], self.links[first:], strict=False)
        has_turned = any(abs(angle) > math.pi for angle, link in undriven if not link.slides)
        # The same coordinates again, with the angles reduced to [-pi, pi].
        return self.solver.coordinates if has_turned else ()

    def redescribed(
        self, y: tuple[float, ...], coordinates: tuple[str, ...]
    ) -> tuple['DrivenMechanism', tuple[float, ...]]:
        """Converts the motion to other coordinates, in the assembly that matches the positions.

        Args:
            y: Coordinates, then their rates.
            coordinates: The mechanism's `coordinates` or `other_coordinates`.

        Returns:
            The driven mechanism, and y, in these coordinates.
        """
        state, structure = self._state(y), self.solver.structure
        positions = [
            position if link.slides else wrap(position)
            for position, link in zip(state.position, structure.links, strict=True)
        ]
        positions[self.driven] = self.position(y, 0)
        moving = structure.indices_of(coordinates)
        new_y = (*(positions[i] for i in moving), *(state.velocity[i] for i in moving))
        candidates = [self.described(Description(coordinates, x)) for x in (OPEN, CROSSED)]
        nearest = min(candidates, key=lambda driven: driven.distance(new_y, positions))
        middle = self.arc_middle(y[0]) if self.has_driven else self.middle
        return replace(nearest, middle=middle), new_y

    def distance(self, y: tuple[float, ...], positions: Sequence[float]) -> float:
        """Returns how far the links at y are from positions; inf if the loop cannot close."""
        try:
            own_positions = self._state(y).position
        except LinkageError:
            return math.inf
        links = self.solver.structure.links
        return sum(
            abs(one - other) if link.slides else abs(math.sin(0.5 * (one - other)))
            for one, other, link in zip(positions, own_positions, links, strict=True)
        )

    def arc_middle(self, crank: float) -> float:
        """Returns the middle of the arc on which the crank moves, rad, within pi of its angle.

        A position of a driven slide, m, is returned as it is.
        """
        mobility = self.solver.mobility
        if mobility is None or mobility.slides:
            return crank
        return 0.5 * sum(mobility.arc_around(crank))

    def _state(self, y: tuple[float, ...]) -> State:
        """Computes the positions and rates of all links."""
        return self.solver.state(y[: len(y) // 2], y[len(y) // 2 :])

    @functools.cached_property
    def accelerations(self) -> Callable[..., tuple[float, ...]]:
        """A function that returns the accelerations; its arguments are the elements of y.

        It raises the errors of `Solver.accelerations`.
        """
        program = self.solver.driven_by(self.torque, self.conditions)
        if not self.conditions:
            return program
        return lambda *y: program(*y, *self.conditions.values)

    def slope(self, y: tuple[float, ...]) -> tuple[float, ...]:
        """Computes y', the rates followed by the accelerations.

        Raises:
            LinkageError: As for `Solver.accelerations`.
        """
        return slope_at(self.accelerations, y)

    def speed(self, y: tuple[float, ...]) -> float:
        """Returns the rate of the driven link, rad/s or m/s."""
        return y[len(y) // 2] if self.has_driven else self._state(y).velocity[self.driven]

    @functools.cached_property
    def rates(self) -> tuple[float, float]:
        """Settling rate and angular frequency of small motions about rest, 1/s.

        They are medians, over several crank angles, of the largest decay rate and the largest
        imaginary part of the eigenvalues. The torque at rest is subtracted. The median ignores
        the dead centre of a massless crank, where an eigenvalue is infinite.
        """
        torque, conditions = self.torque, self.conditions
        free = DrivenMechanism(
            self.solver, lambda speed: torque(speed) - torque(0.0), conditions=conditions
        )
        arcs = self.solver.mobility.arcs if self.solver.mobility else FULL_TURN

        other_coordinates, _ = self.solver.mechanism.start()
        decays, frequencies = list[float](), list[float]()
        for low, high in arcs:
            for i in range(_PLACES):
                angle = low + (high - low) * (i + 0.5) / _PLACES
                with suppress(LinkageError, np.linalg.LinAlgError):
                    eigenvalues = free._eigenvalues((angle, *other_coordinates))
                    decays.append(-eigenvalues.real.min())
                    frequencies.append(eigenvalues.imag.max())
        return float(median(decays or [0.0])), float(median(frequencies or [0.0]))

    def _eigenvalues(self, q: tuple[float, ...]) -> Any:
        """Computes the eigenvalues of the motion linearised about rest, 1/s."""
        y, count = (*q, *[_SLOW] * len(q)), len(q)
        by_value = jacobian(Plant(self.units, self.accelerations), y, self.slope(y))
        system = np.vstack([np.eye(count, 2 * count, count), np.transpose(by_value)])
        return np.linalg.eigvals(system)

    def _is_held(self, y: tuple[float, ...], i: int) -> bool:
        """Returns whether a coordinate rests, and any motion of it would be stopped at once."""
        at = len(y) // 2 + i  # of its rate in y
        if abs(y[at]) > _SLOW:
            return False
        for rate in (_SLOW, -_SLOW):
            try:
                acceleration = self.accelerations(*y[:at], rate, *y[at + 1 :])[i]
            except LinkageError:
                return False
            if acceleration * rate >= 0:
                return False
        return True

    def fail(self, time: float, y: tuple[float, ...], cause: Exception | None) -> NoReturn:
        """Reports the end of a motion that cannot continue.

        Args:
            time: Time reached, s.
            y: Coordinates and rates at that time.
            cause: Error raised in the next step, if any.

        Raises:
            MotionError: Always. The message states the time, the position, the cause and remedies.
        """
        coordinates = self.solver.mechanism.coordinates
        q = y[: len(y) // 2]
        with suppress(LinkageError):
            _, own_y = self.redescribed(y, coordinates)
            q = own_y[: len(coordinates)]
        places = ', '.join(
            f'{link.name} at {f"{value:.6g} m" if link.slides else rad_and_deg(value)}'
            for value, link in zip(y, self.links, strict=False)
        )
        message = f'the motion ends at t = {time:.6g} s, {places}: {self._end_reason(y)}'
        raise MotionError(message, time=time, coordinates=q) from cause

    def _end_reason(self, y: tuple[float, ...]) -> str:
        """Explains why a motion cannot continue from coordinates and rates."""
        half = len(y) // 2
        sine, words = self.solver.alignment(y[:half])
        if sine < _NEAR and self.is_limited:
            return (
                f'{words}, and the motion can continue in more than one way; start more slowly or '
                'at another position, or change torque, masses or lengths'
            )
        if any(self._is_held(y, i) for i in range(half)):
            return (
                'a load that reverses with the direction of motion (return_value of a curve, or '
                'valves of a gas) holds the linkage at rest, which the equations of motion do not '
                'describe; raise the torque, or lower the load'
            )
        return (
            'the motion is too fast for the shortest step; lower the speed, the torque, the '
            'commands (torque_limit) or a stiffness, add mass, or, if links are almost in '
            'line, change a length'
        )


def turns_between(angle: float, middle: float) -> Fraction:
    """Returns the number of pairs of turns that bring `angle` to within pi of `middle`."""
    return Fraction(round((middle - angle) / (2 * math.pi)), 2)
