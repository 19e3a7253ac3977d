# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Evaluates a mechanism's formulas for floats, arrays and states."""

import functools
import math
from collections.abc import Callable
from typing import Any, NoReturn, cast

import numpy as np

from linkage_ros.dynamics.compiled import compiled_arrays
from linkage_ros.dynamics.equations import Model
from linkage_ros.dynamics.joint_loads import Round, joint_load_round, search_names
from linkage_ros.dynamics.program import Program
from linkage_ros.dynamics.tape import Constants, leaves
from linkage_ros.errors import ConfigurationError, MechanismError, UnreachableError
from linkage_ros.formulas import Opaque
from linkage_ros.model.kinematics import State
from linkage_ros.model.structure import Description, Mechanism
from linkage_ros.numeric import Real, real_numbers, require_finite
from linkage_ros.quantities import shown

ROUND = 'q', 'u', 'a', 'search'  # arguments of `joint_load_round`
_ROUNDS = 1000
_IN_LINE = (
    'all links are in line: the joint forces are infinite at a change point; choose another angle'
)


class Evaluator:
    """Evaluates the formulas of one mechanism, in one choice of coordinates.

    Attributes:
        mechanism: The mechanism.
        structure: Links, points and joints of the mechanism.
        links: Names of the links, in the order used by all tuples.
        description: Choice of coordinates and assembly.
        coordinates: Names of the links whose positions are the coordinates.
        model: Constants of the formulas.
        names: Names of the scalar arguments of the formulas, by key: 'q', 'u' and 'a' for
            coordinates, rates and accelerations; 'torque'; and 'search' for joint loads.
    """

    def __init__(
        self, mechanism: Mechanism, compiled: bool, description: Description | None
    ) -> None:
        """Collects the constants and the argument names; see `Solver` for the parameters.

        Raises:
            MechanismError: The argument is not a mechanism.
        """
        if not isinstance(mechanism, Mechanism):
            raise MechanismError(f'{shown(mechanism)}: must be a mechanism, such as a FourBar')
        self.mechanism, structure, self._compiled = mechanism, mechanism.structure(), compiled
        self.description = description or mechanism.description
        self.coordinates = self.description.coordinates
        if self.coordinates != mechanism.coordinates:
            own, others = structure.dyads, structure.other_dyads
            structure = structure._replace(dyads=others, other_dyads=own)
        self.structure = structure
        slides = {link.name: link.slides for link in structure.links}
        self.links = tuple(slides)
        self._moving = [self.links.index(name) for name in self.coordinates]
        self.names: dict[str, Any] = {
            'q': tuple(f'{x}_{"position" if slides[x] else "angle"}' for x in self.coordinates),
            'u': tuple(f'{x}_speed' for x in self.coordinates),
            'a': tuple(f'{x}_acceleration' for x in self.coordinates),
            'torque': 'torque',
        }
        q, u, a, _ = self.names.values()
        self.model = Model.of(
            mechanism,
            structure,
            mechanism.loop_of(self.description),
            refuse=Opaque(functools.partial(refuse_overflow, (*q, *u, *a))),
            refuse_torque=Opaque(functools.partial(refuse_overflow, (*q, *u, 'torque'))),
            refuse_forces=Opaque(functools.partial(self.refuse_angle, _IN_LINE)),
            massless=Opaque(_refuse_massless),
        )
        if self.model.joint_loads:
            self.names['search'] = search_names(self._constants.tree)
        self._programs: dict[tuple[Any, ...], Program] = {}

    @functools.cached_property
    def _constants(self) -> Constants:
        return Constants(self.model)

    def program(self, formula: Callable[..., Any], *letters: str) -> Program:
        """Returns the program of a formula whose arguments have the keys `letters` in `names`."""
        key = formula, letters
        if key not in self._programs:
            arguments = tuple(self.names[letter] for letter in letters)
            self._programs[key] = Program(formula, self._constants, arguments)
        return self._programs[key]

    def run(self, formula: Callable[..., Any], *, by_math: bool = False, **given: Any) -> Any:
        """Evaluates a formula of the model.

        Args:
            formula: Function of the model and the arguments.
            by_math: Whether array results must be bit-identical to scalar results.
            **given: Arguments of the formula, by their keys in `names`.

        Returns:
            The result of the formula, with arrays if an argument is an array.
        """
        values = [x for letter, row in given.items() for x in self.row(letter, row)]
        return self.run_program(self.program(formula, *given), *values, by_math=by_math)

    def run_program(self, program: Program, *given: Any, by_math: bool = False) -> Any:
        """Runs a program; see `run`.

        Raises:
            ConfigurationError: An argument is not a number, or the shapes do not fit.
        """
        if all(type(value) is float for value in given):
            return program.scalar(*given)
        values, shape = real_numbers(**dict(zip(program.names, given, strict=True)))
        if not shape:
            return program.scalar(*values)
        if self._compiled and not by_math:
            return compiled_arrays(program, *values)
        return program.arrays(*values, by_math=by_math)

    def settle(self, *given: Any, by_math: bool = False) -> Round:
        """Iterates until the joint forces and the loads caused by them are consistent.

        Args:
            *given: Coordinates, their rates and their accelerations.
            by_math: See `run`.

        Returns:
            The last round. In arrays, converged states stay unchanged, so that the results are
            bit-identical to those of single states.

        Raises:
            UnreachableError: Friction locks the mechanism.
        """
        program = self.program(joint_load_round, *ROUND)
        motion, shape = real_numbers(**dict(zip(program.names, given, strict=False)))
        search: list[Real] = [1.0, 0.0, math.inf, *[0.0] * (len(program.names) - len(given) - 3)]
        if shape:  # arrays from the start, so that all rounds use one program
            search = [np.full(shape, value) for value in search]
        for _ in range(_ROUNDS):
            found = cast('Round', self.run_program(program, *motion, *search, by_math=by_math))
            if not np.any(found.left) or np.any(np.less(found.left, 0)):
                break
            search = leaves(found.search)
        crank, locked = np.broadcast_arrays(motion[0], np.not_equal(found.left, 0))
        if locked.any():
            self.refuse_angle(
                'friction locks the mechanism: no joint forces are in equilibrium; lower the '
                'coefficients or the pin radius',
                crank[locked].item(0),
            )
        return found

    def row(self, letter: str, row: Any) -> tuple[Any, ...]:
        """Converts an argument of a solver method to a tuple of values.

        Args:
            letter: 'q', 'u' or 'a' for coordinates, rates or accelerations; or 'torque'.
            row: The argument as passed; a float or an array is accepted for a single coordinate.

        Returns:
            One value per coordinate; for the torque, one value.

        Raises:
            ConfigurationError: The number of values is wrong.
        """
        count = len(self._moving)
        if letter == 'torque' or (count == 1 and not isinstance(row, tuple)):
            return (row,)
        if letter != 'q' and type(row) is float and not row:
            return (row,) * count  # the default: at rest
        found = row if isinstance(row, (tuple, list)) or np.ndim(row) else ()
        if len(found) != count:
            words = ', '.join(self.names[letter]).replace('_', ' ') + ',' * (count == 1)
            raise ConfigurationError(f'{letter} = {shown(row)}: must be a tuple ({words})')
        return tuple(found)

    def rows(self, state: State) -> tuple[tuple[Real, ...], ...]:
        """Returns the positions, velocities and accelerations of all links.

        Raises:
            ConfigurationError: The argument is not a state of this mechanism.
        """
        rows, count = state[:3] if isinstance(state, State) else (), len(self.links)
        if not rows or any(type(row) is not tuple or len(row) != count for row in rows):
            raise ConfigurationError(
                f'state = {shown(state)}: must be a State of this mechanism, from its solver'
            )
        return rows

    def motion(self, state: State) -> tuple[Real, ...]:
        """Returns the coordinates, rates and accelerations of a state."""
        return tuple(row[i] for row in self.rows(state) for i in self._moving)

    def refuse_angle(self, reason: str, crank: float, *_: float) -> NoReturn:
        """Rejects a crank angle, rad.

        Raises:
            UnreachableError: Always. The message includes the reason.
        """
        reach = self.mechanism.reach()
        message = f'at {math.degrees(crank):.9g} deg {reason}'
        raise UnreachableError(message, crank_angle=crank, arcs=reach.arcs if reach else ())


def refuse_overflow(names: tuple[str, ...], *values: float) -> NoReturn:
    """Rejects numbers that are not finite or that cause an overflow.

    Raises:
        ConfigurationError: Always. The message lists the numbers by name.
    """
    given = dict(zip(names, values, strict=False))
    require_finite(**given)
    words = ', '.join(f'{name.replace("_", " ")} = {x:g}' for name, x in given.items())
    raise ConfigurationError(f'the torque or an acceleration overflows at {words}: lower them')


def _refuse_massless() -> NoReturn:
    """Rejects a mass matrix that is not positive definite.

    Raises:
        MechanismError: Always.
    """
    raise MechanismError(
        'links without mass have no finite acceleration under a torque: give them a mass or an '
        'inertia'
    )
