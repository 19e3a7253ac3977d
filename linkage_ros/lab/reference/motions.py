# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Motions under a torque: their initial values, and references accurate to 1e-17 in SI units.

The multibody equations are integrated by extrapolation (Gragg, Bulirsch and Stoer: Hairer, Norsett
and Wanner, Solving Ordinary Differential Equations I, II.9), which no compared method uses. Unit
vectors replace angles, so that no trigonometry is needed. The numbers are decimals of 34 digits,
which are five times as fast as those of mpmath. Shorter steps, a quadrature of the energy and an
independent implementation give the same results (test/test_torque_driven_motion.py).
"""

import itertools
import math
from contextlib import suppress
from dataclasses import dataclass, field, replace
from decimal import Context, Decimal, localcontext
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
from mpmath import mp
from scipy import optimize

from linkage_ros.dynamics.solver import Solver
from linkage_ros.formulas import Vector, cross, dot
from linkage_ros.lab.reference.multibody import Multibody, eliminate
from linkage_ros.motion.driven_mechanism import DrivenMechanism
from linkage_ros.motion.drives import Motor
from linkage_ros.parameters.configuration import load

_CONTEXT = Context(prec=34)
_LOOK = 0.02  # s between two checks for a singularity of the coordinates
_SHORTEST = Decimal('1e-6')  # s
_GROWTH = Decimal('1.3')  # factor of the step length after a step with few rows
# Rows of the extrapolation. After a step with at most _FEW rows, the next step is longer; a step
# that needs more than _ROWS rows is halved. The order is twice the number of rows.
_FEW, _ROWS = 9, 12
_TOLERANCE = Decimal('1e-20')  # tolerance of a step, in SI units
_CLOSED = 4  # Newton steps that refine a position from doubles to all digits
_State: TypeAlias = Any  # an array of Decimals; NumPy has no type for it


# Coordinates, then their rates.
Phase: TypeAlias = tuple[float, ...]


@dataclass(frozen=True)
class InitialValueProblem:
    """An initial value problem in the crank angle and, for a wind pump, the slider position.

    Attributes:
        mechanism: A four-bar or a wind pump.
        start: Coordinates at t = 0, then their rates; rad and m, rad/s and m/s.
        motor: Motor of the crank.
    """

    mechanism: Any
    start: Phase
    motor: Motor = field(default_factory=Motor)

    @cached_property
    def driven(self) -> DrivenMechanism:
        """The first-order system, with the package's own equations of motion."""
        return DrivenMechanism(Solver(self.mechanism), lambda speed: self.motor.at(speed))

    @property
    def count(self) -> int:
        """Number of coordinates."""
        return len(self.start) // 2

    def energy(self, phase: Phase) -> tuple[float, float]:
        """Computes the kinetic energy, and the potential energy up to a constant, J."""
        return self.driven.solver.energy(phase[: self.count], phase[self.count :])


def driven_pump(speed: float, velocity: float = 0.0) -> InitialValueProblem:
    """Makes the initial value problem of document 3's wind pump with its motor and load.

    Args:
        speed: Speed of the crank at t = 0, rad/s.
        velocity: Velocity of the slider at t = 0, m/s.

    Returns:
        The problem; it starts at crank angle 0.
    """
    pump: Any = load('wind_pump')
    start = 0.0, pump.mechanism.slider.position, speed, velocity
    return InitialValueProblem(pump.mechanism, start, pump.drive.motor)


def free_pump(speed: float) -> InitialValueProblem:
    """Makes the initial value problem of the pump without motor and load: energy is constant."""
    driven = driven_pump(speed)
    slider = replace(driven.mechanism.slider, damping=0.0)
    return InitialValueProblem(replace(driven.mechanism, slider=slider), driven.start)


def coasting() -> InitialValueProblem:
    """Makes the initial value problem of document 1's quadrilateral coasting from 150 rpm."""
    return InitialValueProblem(load('quadrilateral').mechanism, (0.0, 5 * math.pi))


class MotionReference:
    """Integrates a motion with 34 decimal digits, from the nearest known state."""

    def __init__(self, problem: InitialValueProblem, longest: float = 0.1) -> None:
        """Prepares the initial state, with a closed loop.

        Args:
            problem: Equations and initial values of the motion.
            longest: Longest step, s.
        """
        self._problem = problem
        self._span = self._longest = Decimal(longest)
        with localcontext(_CONTEXT):
            self._bodies = Multibody(problem.mechanism, _CONTEXT.create_decimal, unit)
            self._known = {Decimal(0): self._begin()}  # states by time

    def at(self, time: float) -> tuple[Decimal, ...]:
        """Returns coordinates, then rates, at a time, s; the crank angle is unwrapped."""
        state = self._state(time)
        places, rates = self._split(state)
        return state[0], *(place.x for place in places[3:]), rates[0], *rates[3:]

    def end(self, until: float) -> float | None:
        """Finds the first singularity, where coupler and third link are in line.

        Args:
            until: End of the search, s.

        Returns:
            The time, accurate to 1e-15 s; None if there is no singularity before `until`.
        """

        def sine(time: float) -> float:
            (_, coupler, third, *_), _rates = self._split(self._state(time))
            return float(cross(coupler, third))

        for before, time in itertools.pairwise(np.arange(0.0, until + _LOOK, _LOOK).tolist()):
            if (sine(before) > 0) != (sine(time) > 0):
                return float(optimize.brentq(sine, before, time, xtol=1e-16))
        return None

    def _begin(self) -> _State:
        """Returns the state at t = 0: crank angle, two numbers per link position, all rates."""
        count, bodies, zero = self._problem.count, self._bodies, Decimal(0)
        q, u = self._problem.start[:count], self._problem.start[count:]
        # Doubles serve as the first guess.
        found = self._problem.driven.solver.state(q, u, (0.0,) * count).position
        places = [
            Vector(Decimal(x), zero) if slides else unit(x)
            for x, slides in zip(found, bodies.slides, strict=True)
        ]
        for _ in range(_CLOSED):
            turns = bodies.closed(places, [zero] * len(places), [-x for x in bodies.gap(places)])
            places[1:3] = map(_turned_by, places[1:3], turns[1:3])
        speed, *others = map(Decimal, u)
        rates = bodies.closed(places, [speed, zero, zero, *others], [zero, zero])
        return np.array([Decimal(q[0]), *(x for place in places for x in place), *rates])

    def _split(self, state: _State) -> tuple[list[Vector], list[Decimal]]:
        count = len(self._bodies.slides)
        places = state[1 : 1 + 2 * count].reshape(count, 2)
        return [Vector(*place) for place in places], state[1 + 2 * count :].tolist()

    def _slope(self, state: _State) -> _State:
        places, rates = self._split(state)
        motor = self._problem.motor
        rows, right = self._bodies.system(places, rates)
        right[0] += Decimal(motor.torque) - Decimal(motor.damping) * rates[0]
        moving = [
            Vector(rate, Decimal(0)) if slid else place.left() * rate
            for place, rate, slid in zip(places, rates, self._bodies.slides, strict=True)
        ]
        found = eliminate(rows, right)[: len(rates)]
        return np.array([rates[0], *(x for vector in moving for x in vector), *found])

    def _state(self, time: float) -> _State:
        """Integrates to the state at a time, s, from the nearest known state.

        Raises:
            ArithmeticError: Even the shortest step fails.
        """
        end = Decimal(time)
        with localcontext(_CONTEXT):
            reached = min(self._known, key=lambda known: abs(known - end))
            state = self._known[reached]
            while left := end - reached:
                span = max(-self._span, min(self._span, left))
                found, rows = self._extrapolated(state, span)
                if found is not None:
                    state, reached = found, end if span == left else reached + span
                    self._span *= _GROWTH if rows <= _FEW and self._span < self._longest else 1
                elif abs(span) < _SHORTEST:
                    raise ArithmeticError(f'the reference cannot be followed beyond {reached} s')
                else:
                    self._span = abs(span) / 2
        self._known[end] = state
        return state

    def _extrapolated(self, start: _State, span: Decimal) -> tuple[_State | None, int]:
        """Returns the state after a step, or None if it diverges, and the number of rows."""
        above: list[_State] = []
        with suppress(ArithmeticError):  # the step may diverge
            slope = self._slope(start)
            for i in range(1, _ROWS + 1):
                row = [self._midpoint(start, slope, span / (2 * i), 2 * i)]
                for j, old in enumerate(above, 1):
                    row.append(row[-1] + (row[-1] - old) / (Decimal(i * i) / (i - j) ** 2 - 1))
                if above and abs(row[-1] - above[-1]).max() <= _TOLERANCE:
                    return row[-1], i
                above = row
        return None, _ROWS

    def _midpoint(self, start: _State, slope: _State, h: Decimal, parts: int) -> _State:
        """Integrates a step by Gragg's modified midpoint rule."""
        before, here = start, start + h * slope
        for _ in range(parts - 1):
            before, here = here, before + 2 * h * self._slope(here)
        return here


def unit(angle: float) -> Vector:
    """Computes the unit vector at an angle, rad, in Decimals."""
    with mp.workdps(40):
        return Vector(Decimal(str(mp.cos(angle))), Decimal(str(mp.sin(angle))))


def _turned_by(place: Vector, turn: Decimal) -> Vector:
    """Turns a unit vector by a small angle."""
    moved = place + place.left() * turn
    length: Decimal = dot(moved, moved).sqrt()
    return moved * (1 / length)
