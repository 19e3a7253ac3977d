# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Test cases for methods: linkages with their reference states.

Errors are relative to the largest value of a quantity at evenly spaced angles. Near a change
point, a value may be many orders of magnitude larger; its error is then relative to the value
itself. Errors of directions are absolute, in rad.
"""

import itertools
import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cached_property, lru_cache
from typing import Any, TypeAlias, cast

import numpy as np
from mpmath import mp

from linkage_lab.methods import stages
from linkage_lab.methods.measure import (
    DIVERGED,
    FAILURES,
    LIMIT,
    ONE,
    WRONG_BRANCH,
    Case,
    Method,
    Panels,
    Row,
    Setting,
    attempt,
    elapsed,
)
from linkage_lab.methods.stages import ACCELERATION, POSITION, QUANTITIES, SPEED
from linkage_lab.reference.states import Linkage, Reference, other_assembly
from linkage_ros import Body, Dyad, LinkageError, Solver, UnreachableError, load
from linkage_ros.extensions import Constants, Program
from linkage_ros.formulas import Array, Real

NEAR, TOGGLE = 'near a change point', 'near a toggle'
_EVEN = 48  # number of evenly spaced angles in a period or an arc
_NOTHING = 1e-12  # relative to the largest value of a quantity; smaller values count as 0
_BATCH = 4096  # states
Function: TypeAlias = Callable[[Real], tuple[Real, ...]]


class LinkageCase(Case):
    """A linkage at given crank angles.

    Attributes:
        mechanism: Linkage to solve.
        cranks: Crank angles at which methods are tested, in order, rad.
        guess: Initial guess of iterative methods: direction of the coupler and output position.
        decimal: Whether lengths are exact decimals, so that 0.1 is a tenth.
        reference: Source of the reference states.
    """

    def __init__(
        self,
        mechanism: Linkage,
        cranks: Sequence[float] | Array,
        guess: stages.Pair | None = None,
        *,
        decimal: bool = False,
    ) -> None:
        """Prepares the case; by default, the guess is the first position, rounded to 0.1."""
        self.mechanism, self.cranks, self.decimal = mechanism, np.array(cranks), decimal
        self.guess = guess or _rough(mechanism, cranks[0])
        self.reference = Reference(mechanism, SPEED, ACCELERATION, decimal=decimal)
        self._exact = lru_cache(None)(self._state)

    @cached_property
    def _other(self) -> 'LinkageCase':
        """The same case in the other assembly."""
        other = other_assembly(self.mechanism)
        return LinkageCase(other, self.cranks, self.guess, decimal=self.decimal)

    def _state(self, place: int) -> dict[str, Any]:
        """Returns the reference values in long doubles, which resolve errors of doubles.

        The result is empty if no state exists.
        """
        with suppress(UnreachableError):
            state = self.reference.state(float(self.cranks[place]))
            return {
                name: np.array([np.longdouble(mp.nstr(x, 25)) for x in row])
                for name, row in state.items()
            }
        return {}

    @cached_property
    def _sizes(self) -> dict[str, Any]:
        """Largest magnitude of each quantity within the reach; rounding errors count as 0."""
        solver, fractions = Solver(self.mechanism), (np.arange(_EVEN) + 0.5) / _EVEN
        turns = solver.reach.period_turns
        cranks = [start + (end - start) * turns * fractions for start, end in solver.reach.arcs]
        state = solver.state(np.concatenate(cranks), SPEED, ACCELERATION)
        values = state.position[1:], state.velocity[1:], state.acceleration[1:], (state.torque,)
        sizes = dict[str, Any]()
        for quantity, of_links in zip(QUANTITIES, values, strict=True):
            largest = np.array([np.max(np.abs(of_link)) for of_link in of_links])
            sizes[quantity] = np.where(largest > _NOTHING * largest.max(), largest, 0.0)
        return sizes

    def error(self, quantity: str, place: int, row: Sequence[float]) -> float:
        """See `Case`; a position has a number per link, or more if unit vectors come first."""
        state = self._exact(place)
        if not state:
            return math.inf
        true, size = state[quantity], self._sizes[quantity]
        computed = np.array(row, np.longdouble)
        scale = np.where(size, np.maximum(size, abs(true)), 1.0)
        if quantity == POSITION:
            return self._position_error(computed, true, scale)
        return float(max(abs(computed - true) / scale))

    def _position_error(self, computed: Any, true: Any, scale: Any) -> float:
        """Computes the largest error of positions: of angles in rad, of others relative to scale.

        The length of a unit vector is judged, too.
        """
        turns, length_error = np.logical_not(self.reference.slides), 0.0
        if len(computed) > len(true):  # unit vectors come first
            count = np.sum(turns)
            x, y = computed[: 2 * count].reshape(count, 2).T
            length_error = max(abs(np.hypot(x, y) - 1))
            computed = np.append(np.arctan2(y, x), computed[2 * count :])
        apart = computed - true
        wrapped = np.arctan2(np.sin(apart), np.cos(apart))
        errors = np.where(turns, abs(wrapped), abs(apart) / scale)
        return float(max(length_error, *errors))

    def wrong(self, quantity: str, place: int, row: Sequence[float]) -> str:
        """See `Case`."""
        is_other = quantity == POSITION and self._other.error(quantity, place, row) <= LIMIT
        return WRONG_BRANCH if is_other else DIVERGED

    def panels(self, method: Method, _: Setting) -> Panels:
        """See `Case`; a method is judged by the quantities that it computes itself."""
        return itertools.product(stages.OWN[method.stage], method.modes)

    def function(self, method: Method, setting: Setting, quantity: str, mode: str) -> Function:
        """Makes a function from the crank angle to a quantity, including all prior stages.

        Args:
            method: A method for linkages.
            setting: Setting of the method.
            quantity: One of QUANTITIES; see `stages.formula`.
            mode: ONE for a function of one angle, BATCH for a function of an array of angles.

        Returns:
            The function. A method that cannot solve this linkage raises a `LinkageError`.
        """
        tool = method.tool(self, setting) if method.tool else None
        links = Constants(stages.Links.of(self.mechanism, tool))
        formula = stages.formula(quantity, method.stage, method.solve)
        program = Program(formula, links, ('crank',))
        if method.narrow:
            return lambda crank: program.arrays([np.asarray(crank, np.float32)], np.shape(crank))
        return program.floats if mode == ONE else program

    def rows(self, method: Method, setting: Setting, quantity: str, mode: str) -> Sequence[Row]:
        """See `Case`."""
        try:
            function = self.function(method, setting, quantity, mode)
        except LinkageError:
            return [None] * len(self.cranks)
        if mode == ONE:
            return [attempt(function, crank) for crank in self.cranks.tolist()]

        def rows_of(cranks: Array) -> list[list[float]]:
            columns = [np.broadcast_to(column, cranks.shape) for column in function(cranks)]
            return [*np.stack(columns, -1).tolist()]

        with np.errstate(all='ignore'), suppress(LinkageError, *FAILURES):
            return rows_of(self.cranks)
        # One angle makes the whole array fail, so each is evaluated as an array of its own.
        return [attempt(lambda one: rows_of(one)[0], crank) for crank in self.cranks[:, None]]


class TurnCase(LinkageCase):
    """One period of a linkage whose crank turns fully, to measure errors and times.

    The crank angles are closer together where the motion is fast.

    Attributes:
        rounds: Number of timings.
    """

    rounds = 15

    def __init__(self, mechanism: Linkage, angles: int, more: Sequence[float] = ()) -> None:
        """Prepares the case.

        Args:
            mechanism: Linkage whose crank turns fully.
            angles: Number of evenly spaced crank angles per turn.
            more: Further crank angles where the motion is fast, rad.
        """
        reach = Solver(mechanism).reach
        fine = reach.samples(angles)
        even = np.linspace(0, fine[-1], angles * reach.period_turns + 1)
        # The first angle is half a step after 0, so that special angles do not favour a method.
        self._timed = even[:-1] + math.pi / angles
        # Angles where the motion is fast are added, including the fastest.
        fastest = reach.fast + math.pi * np.arange(2 * reach.period_turns)
        fast = np.setdiff1d(fine, even)[:: 360 // angles]
        cranks = np.unique(np.concatenate([self._timed, fast, fastest, more]))
        super().__init__(mechanism, cranks, _rough(mechanism, 0.1))

    def panels(self, method: Method, _: Setting) -> Panels:
        """See `Case`; includes the quantities computed by the package's own later stages."""
        first = QUANTITIES.index(stages.OWN[method.stage][0])
        asked = method.dyads if self.mechanism.dyads else QUANTITIES[first:]
        return itertools.product(asked, method.modes)

    def timer(
        self, method: Method, setting: Setting, quantity: str, mode: str
    ) -> Callable[[], float]:
        """Prepares a method; returns a function that measures its time per state, us."""
        function = self.function(method, setting, quantity, mode)
        timed, batch = self._timed.tolist(), np.resize(self._timed, _BATCH)
        arguments: Any = timed if mode == ONE else [batch]
        return lambda: elapsed(function, arguments) / np.size(arguments) * 1e6


def _rough(mechanism: Linkage, crank: float) -> stages.Pair:
    """Computes the position at a crank angle, rounded to 0.1 rad or m."""
    return tuple(round(x, 1) for x in Solver(mechanism).state(crank).position[1:])


def linkages(*, quick: bool) -> list[tuple[str, TurnCase]]:
    """Returns the linkages of the accuracy chart, each with its name.

    The third linkage is nearly a kite: its crank pin passes the rocker pivot at a distance of
    1e-12 m. Its masses and inertias equal those of the first linkage. The last one is the first
    linkage with a dyad: at crank angle 0, the sine of the angle between its links is 1e-3.
    """
    quadrilateral: Any = load('quadrilateral').mechanism
    kite = replace(
        quadrilateral,
        crank=replace(quadrilateral.crank, length=0.3),
        frame=replace(quadrilateral.frame, length=0.3 + 1e-12),
        coupler=replace(quadrilateral.coupler, length=0.5),
        rocker=replace(quadrilateral.rocker, length=0.5),
    )
    r = quadrilateral.crank.length
    rod = Body(1.5 * r * (1 + 1.25e-7), 2.0, 0.1, (0.75 * r, 0.0))
    dyad = Dyad(
        name='arm', from_='crank', from_at=(r, 0.0), to='frame', to_at=(-2 * r, 0.0), first=rod,
        second=rod,
    )  # fmt: skip
    near_toggle = [0.0, *(sign * 10.0**-k for k in range(2, 6) for sign in (-1, 1))]
    angles = 12 if quick else 360
    return [
        ('quadrilateral', TurnCase(quadrilateral, angles)),
        ('slider_crank', TurnCase(cast('Any', load('slider_crank').mechanism), angles)),
        (NEAR, TurnCase(kite, angles)),
        ('six_bar', TurnCase(cast('Any', load('watt').mechanism), angles)),
        (TOGGLE, TurnCase(replace(quadrilateral, dyads=(dyad,)), angles, near_toggle)),
    ]
