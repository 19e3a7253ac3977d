# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Motions under a torque: their initial values, and references accurate to 1e-17 in SI units.

The multibody equations are integrated by extrapolation (Gragg, Bulirsch and Stoer: Hairer, Norsett
and Wanner, Solving Ordinary Differential Equations I, II.9), which no compared method uses. Unit
vectors replace angles, so that no trigonometry is needed. The numbers are decimals of 34 digits,
which are five times as fast as those of mpmath. Shorter steps, a quadrature of the energy and an
independent implementation give the same results (lab/test/test_integrators.py).
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

from linkage_lab.reference.multibody import Multibody, eliminate
from linkage_ros import Solver, load
from linkage_ros.formulas import Vector, cross, dot
from linkage_ros.internals import DrivenMechanism, Motor

_CONTEXT = Context(prec=34)
_LOOK = 0.02  # s between two checks for a singularity of the coordinates
_LONGEST, _SHORTEST = 0.025, Decimal('1e-6')  # s
_ROWS = 12  # of the extrapolation; its order is twice their number
_TOLERANCE = Decimal('1e-20')  # tolerance of a step, in SI units

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
        return DrivenMechanism(Solver(self.mechanism), self.motor.at)

    def energy(self, phase: Phase) -> tuple[float, float]:
        """Computes the kinetic energy, and the potential energy up to a constant, J."""
        solver = self.driven.solver
        return solver.energy(solver.state(*halves(phase)))


def halves(phase: Phase) -> tuple[Phase, Phase]:
    """Splits a phase into coordinates and rates."""
    count = len(phase) // 2
    return phase[:count], phase[count:]


def driven_pump(speed: float, velocity: float = 0.0) -> InitialValueProblem:
    """Makes the initial value problem of Deliu and Vlase's wind pump with its motor and load.

    It starts at crank angle 0.

    Args:
        speed: Speed of the crank at t = 0, rad/s.
        velocity: Velocity of the slider at t = 0, m/s.
    """
    pump: Any = load('wind_pump')
    start = 0.0, pump.mechanism.slider.position, speed, velocity
    return InitialValueProblem(pump.mechanism, start, pump.drive.motor)


def free_pump(speed: float) -> InitialValueProblem:
    """Makes the initial value problem of the pump without motor and load: energy is constant."""
    driven = driven_pump(speed)
    return InitialValueProblem(replace(driven.mechanism, loads=()), driven.start)


def coasting() -> InitialValueProblem:
    """Makes the initial value problem of Ghalbi's quadrilateral coasting from 150 rpm."""
    return InitialValueProblem(load('quadrilateral').mechanism, (0.0, 5 * math.pi))


class MotionReference:
    """Integrates a motion with 34 decimal digits, from the nearest known state.

    A state is an array of Decimals: crank angle, two numbers per link position, all rates.
    """

    def __init__(self, problem: InitialValueProblem) -> None:
        """Prepares the initial state, with a closed loop."""
        self._problem = problem
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

    def _begin(self) -> Any:
        """Returns the state at t = 0."""
        bodies, zero, (q, u) = self._bodies, Decimal(0), halves(self._problem.start)
        first_guess = self._problem.driven.solver.state(q, u).position  # in doubles
        places = [
            Vector(Decimal(x), zero) if slides else unit(x)
            for x, slides in zip(first_guess, bodies.slides, strict=True)
        ]
        for _ in range(4):  # Newton steps, each of which doubles the number of digits
            turns = bodies.closed(places, [zero] * len(places), [-x for x in bodies.gap(places)])
            for i in (1, 2):  # coupler and third link
                moved = places[i] + places[i].left() * turns[i]
                places[i] = moved * (1 / dot(moved, moved).sqrt())
        speed, *others = map(Decimal, u)
        rates = bodies.closed(places, [speed, zero, zero, *others], [zero, zero])
        return np.array([Decimal(q[0]), *(x for place in places for x in place), *rates])

    def _split(self, state: Any) -> tuple[list[Vector], list[Decimal]]:
        """Returns the positions of the links, as `Multibody` takes them, and their rates."""
        count = len(self._bodies.slides)
        places = state[1 : 1 + 2 * count].reshape(count, 2)
        return [Vector(*place) for place in places], state[1 + 2 * count :].tolist()

    def _slope(self, state: Any) -> Any:
        """Returns the derivative of a state with respect to time."""
        places, rates = self._split(state)
        motor = self._problem.motor
        rows, right = self._bodies.system(places, rates)
        right[0] += Decimal(motor.torque) - Decimal(motor.damping) * rates[0]
        velocities = [
            Vector(rate, Decimal(0)) if slides else place.left() * rate
            for place, rate, slides in zip(places, rates, self._bodies.slides, strict=True)
        ]
        accelerations = eliminate(rows, right)[: len(rates)]
        components = [component for velocity in velocities for component in velocity]
        return np.array([rates[0], *components, *accelerations])

    def _state(self, time: float) -> Any:
        """Integrates to the state at a time, s, from the nearest known state."""
        end = Decimal(time)
        with localcontext(_CONTEXT):
            nearest = min(self._known, key=lambda known: abs(known - end))
            state, span = self._known[nearest], end - nearest
            steps = math.ceil(abs(span) / Decimal(_LONGEST))
            for _ in range(steps):
                state = self._moved(state, span / steps)
        self._known[end] = state
        return state

    def _moved(self, start: Any, span: Decimal) -> Any:
        """Returns the state after a step, which is halved if the extrapolation does not converge.

        Raises:
            ArithmeticError: Even the shortest step fails.
        """
        above: list[Any] = []  # the previous row of the extrapolation table
        with suppress(ArithmeticError):  # the step may diverge
            slope = self._slope(start)
            for i in range(1, _ROWS + 1):  # row i starts with the result of 2 i substeps
                row = [self._midpoint(start, slope, span / (2 * i), 2 * i)]
                for j, coarser in enumerate(above, 1):
                    squared_ratio = Decimal(i * i) / (i - j) ** 2
                    row.append(row[-1] + (row[-1] - coarser) / (squared_ratio - 1))
                if above and abs(row[-1] - above[-1]).max() <= _TOLERANCE:
                    return row[-1]
                above = row
        if abs(span) < _SHORTEST:
            raise ArithmeticError('the reference cannot be followed further')
        return self._moved(self._moved(start, span / 2), span / 2)

    def _midpoint(self, start: Any, slope: Any, h: Decimal, parts: int) -> Any:
        """Integrates a step by Gragg's modified midpoint rule."""
        before, here = start, start + h * slope
        for _ in range(parts - 1):
            before, here = here, before + 2 * h * self._slope(here)
        return here


def unit(angle: float) -> Vector:
    """Computes the unit vector at an angle, rad, in Decimals."""
    with mp.workdps(40):
        return Vector(Decimal(str(mp.cos(angle))), Decimal(str(mp.sin(angle))))
