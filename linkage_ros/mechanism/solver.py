# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Exact solver for a mechanism: states, torque, accelerations, energy and forces.

The driving torque of a state comes from `equations.state`: the pose of the mechanism's `loop()`
gives positions, rates and accelerations of the links, from which `equations.balance` computes the
torque. `tracer.py` compiles such a formula once for all mechanisms of one structure; the solver
binds it to the numbers of its mechanism.
"""

import functools
import itertools
import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, NoReturn, Protocol, cast, overload

import numpy as np

from linkage_ros.errors import ConfigurationError, MechanismError, UnreachableError
from linkage_ros.formulas import ZERO, Opaque, Vector, dot, number, sqrt, where
from linkage_ros.mechanism import equations
from linkage_ros.mechanism.base import Description, Mechanism
from linkage_ros.mechanism.conditions import OWN_CONDITIONS, Conditions
from linkage_ros.mechanism.dyad_reach import reach_of
from linkage_ros.mechanism.equations import DyadSine, Environment, Model
from linkage_ros.mechanism.joint_forces import (
    GuideForce,
    JointForces,
    Reactions,
    Round,
    joint_load_round,
    reactions,
    search_names,
)
from linkage_ros.mechanism.kinematics import PointMotion, Reach, Rows, State
from linkage_ros.mechanism.loads.force import PointForce
from linkage_ros.mechanism.loads.spring import Spring, SpringMotion
from linkage_ros.mechanism.nested import leaves, rebuilt
from linkage_ros.mechanism.program import Constants, Program
from linkage_ros.mechanism.structure import Point
from linkage_ros.mechanism.tracer import Tape
from linkage_ros.mechanism.wrenches import FRAME, Exerted, ExertedForce, Wrench, place, poses
from linkage_ros.numeric import Numbers, Real, real_numbers, require_finite, single_numbers
from linkage_ros.quantities import shown
from linkage_ros.units import SLIDING, TURNING, place_words

_ROUND = 'q', 'u', 'a', 'search'  # arguments of `joint_load_round`
_ROUNDS = 10_000
_IN_LINE = (
    'all links are in line: the joint forces are infinite at a change point; choose another angle'
)


class _OpenModel(NamedTuple):
    """A model of which the numbers of conditions are arguments, not constants.

    Attributes:
        model: The model, which names these arguments in errors.
        constants: The prepared constants of the model.
        names: Names of these arguments.
    """

    model: Model
    constants: Constants
    names: Environment

    def within(self, values: Sequence[Real]) -> Model:
        """Returns the prepared model with the numbers of conditions.

        Raises:
            ConfigurationError: A value is not a finite number.
        """
        words: list[str] = leaves(self.names)
        numbers, _ = real_numbers(words, values)
        require_finite(**dict(zip(words, numbers, strict=True)))
        environment: Environment = rebuilt(self.names, iter(numbers))
        model: Model = self.constants.tree
        return model.within(environment)


class HasMechanism(Protocol):
    """A result of `load`, or a `Drawing`, whose `mechanism` is a method."""

    @property
    def mechanism(self) -> Any:
        """The mechanism, or a function that returns it."""


class Solver:
    """Exact solver for a mechanism.

    The coordinates are the crank angle and, for a wind pump, the slider's position; for a driven
    cylinder or slider, its position. With one coordinate, q, u and a are floats or arrays; with
    more, sequences of floats or arrays. A tuple always holds one value per coordinate, even if
    there is only one. Arrays broadcast. If a sliding link is driven, each torque is a force, N,
    along its guide; it lengthens a cylinder if positive.

    A state holds the `Conditions` under which it was computed, so that methods that take a state,
    of floats or arrays, need nothing else. They reject one of another mechanism.

    Attributes:
        mechanism: The mechanism.
        structure: Links, points and joints of the mechanism.
        links: Names of the links, in the order used by all tuples.
        output: Name of the output link.
        description: Choice of coordinates and assembly.
        pivot: The point of base_link that is fixed in the world if it turns, m.
        coordinates: Names of the links whose positions are the coordinates.
        model: Constants of the formulas.
        names: Names of the scalar arguments of the formulas, by key: 'q', 'u' and 'a' for
            coordinates, rates and accelerations; 'torque'; and 'search' for joint loads.
    """

    def __init__(
        self,
        mechanism: 'Mechanism | HasMechanism',
        *,
        traced: bool = True,
        by_math: bool = False,
        description: Description | None = None,
        pivot: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        """Prepares the programs, each of which is compiled on first use.

        Args:
            mechanism: The mechanism to solve, or an object that has one: a `Drawing`, or what
                `load` returns.
            traced: Whether to turn formulas into programs. Otherwise, the formulas themselves run,
                with the same results, so that a debugger can stop in them.
            by_math: Whether array results must be bit-identical to scalar results, which NumPy's
                faster functions do not give.
            description: Coordinates and assembly; by default, the mechanism's own. A solver in
                other coordinates supports only `driven_state`, `driven_by` and `dyad_sines`; the
                torque still acts on the crank.
            pivot: The point of base_link that is fixed in the world if it turns, m.

        Raises:
            MechanismError: The argument is not a mechanism.
            ConfigurationError: A load does not fit the mechanism.
        """
        self.mechanism = _mechanism_of(mechanism)
        self._traced, self._by_math, self.pivot = traced, by_math, pivot
        self.description = description or self.mechanism.description
        self.coordinates = self.description.coordinates
        structure = self.mechanism.structure()
        if self.coordinates != self.mechanism.coordinates:
            dyads, other_dyads = structure.other_dyads, structure.dyads
            structure = structure._replace(dyads=dyads, other_dyads=other_dyads)
        self.structure = structure
        self.links = tuple(link.name for link in structure.links)
        self.output = self.links[structure.output_index]
        self._moving = structure.indices_of(self.coordinates)
        self._count = len(self._moving)
        moving = [structure.links[j] for j in self._moving]
        self.names: dict[str, Any] = {
            'q': tuple(f'{x.name}_{"position" if x.slides else "angle"}' for x in moving),
            'u': tuple(f'{x.name}_speed' for x in moving),
            'a': tuple(f'{x.name}_acceleration' for x in moving),
            'torque': 'torque',
        }
        self.model = Model.of(
            self.mechanism,
            structure,
            self.mechanism.chain(self.description),
            pivot,
            **self._refusals(),
            refuse_forces=Opaque(functools.partial(_refuse_angle, self.mechanism, _IN_LINE)),
            massless=Opaque(_refuse_massless),
        )
        if self.model.joint_loads:
            self.names['search'] = search_names(self._constants.tree)
        self._programs: dict[tuple[Any, ...], Program] = {}
        self._open_models: dict[tuple[Any, ...], _OpenModel] = {}
        # Whether floats can be passed to the programs as they are.
        self._takes_floats = len(self.coordinates) == 1 and not self.model.joint_loads

    def __repr__(self) -> str:
        return f'Solver({self.mechanism!r})'

    def __reduce__(self) -> tuple[Any, tuple[Mechanism]]:
        return functools.partial(type(self), **self._options), (self.mechanism,)

    @property
    def _options(self) -> dict[str, Any]:
        return {
            'traced': self._traced, 'by_math': self._by_math, 'description': self.description,
            'pivot': self.pivot,
        }  # fmt: skip

    @functools.cached_property
    def _constants(self) -> Constants:
        return Constants(self.model)

    def described(self, description: Description) -> 'Solver':
        """Returns a solver of the same mechanism in another description."""
        return Solver(self.mechanism, **{**self._options, 'description': description})

    def program(
        self, formula: Callable[..., Any], *letters: str, under: Conditions = OWN_CONDITIONS
    ) -> Program:
        """Returns the program of a formula.

        Args:
            formula: The formula.
            *letters: Keys of its arguments in `names`.
            under: Conditions whose numbers are its last argument; by default, it has none.

        Raises:
            ConfigurationError: A force is given for a load that is not a force.
        """
        key = formula, letters, under.names
        if key not in self._programs:
            arguments = [self.names[letter] for letter in letters]
            constants = self._constants
            if under:
                opened = self._open_model(under)
                constants = opened.constants
                arguments.append(opened.names)
            self._programs[key] = self._bound(formula, constants, tuple(arguments))
        return self._programs[key]

    def _open_model(self, under: Conditions) -> _OpenModel:
        """Returns the model of all conditions that have numbers of the same names.

        Raises:
            ConfigurationError: A force is given for a load that is not a force.
        """
        if under.names not in self._open_models:
            names = Environment(*under.names)
            model = self.model._replace(
                given=self._force_indices(under), **self._refusals(*leaves(names))
            )
            self._open_models[under.names] = _OpenModel(model, Constants(model), names)
        return self._open_models[under.names]

    def _force_indices(self, under: Conditions) -> tuple[int, ...]:
        """Returns the index of each load whose force is given, among the loads on links.

        Raises:
            ConfigurationError: A force is given for a load that is not a force.
        """
        loads = self.mechanism.link_loads()
        index_of = {
            name: i for i, (name, load) in enumerate(loads.items()) if isinstance(load, PointForce)
        }
        for name, _ in under.forces:
            if name not in index_of:
                raise ConfigurationError(
                    f'forces: {shown(name)} is not a load of kind force; the mechanism has '
                    f'{", ".join(index_of) or "none"}'
                )
        return tuple(index_of[name] for name, _ in under.forces)

    def _refusals(self, *others: str) -> dict[str, Any]:
        """Returns the functions of a model that reject its arguments.

        Args:
            *others: Names of arguments after coordinates, rates, and accelerations or torque.
        """
        motion = *self.names['q'], *self.names['u']
        return {
            'refuse': _refusal(*motion, *self.names['a'], *others),
            'refuse_torque': _refusal(*motion, self.names['torque'], *others),
        }

    def _bound(self, formula: Callable[..., Any], constants: Constants, names: Any) -> Program:
        return Program(formula, constants, names, traced=self._traced, by_math=self._by_math)

    @functools.cached_property
    def motion_reach(self) -> Reach | None:
        """The same as `mobility`, without regard to loads."""
        return reach_of(self.mechanism)

    @functools.cached_property
    def mobility(self) -> Reach | None:
        """The reach of the crank; None if the crank angle alone does not determine the motion.

        Its `period_turns` are those of motion and loads together.
        """
        reach = self.motion_reach
        if reach is None:
            return None
        return reach._replace(period_turns=reach.period_with(self.mechanism.loads))

    @property
    def reach(self) -> Reach:
        """The reach of the crank.

        Raises:
            MechanismError: The crank angle alone does not determine the motion.
        """
        if self.mobility is None:
            raise MechanismError(
                f'a {type(self.mechanism).__name__} has {len(self.coordinates)} degrees of '
                'freedom: its crank angle alone does not determine its motion'
            )
        return self.mobility

    @property
    def tape(self) -> Tape:
        """The operations of the program of `state`; with friction, of one iteration."""
        if self.model.joint_loads:
            return self.program(joint_load_round, *_ROUND).tape
        return self._accelerated.tape

    @property
    def source(self) -> str:
        """The Python source of the program of `state`; with friction, of one iteration."""
        return self.tape.text

    def state(
        self,
        q: Numbers,
        u: Numbers = 0.0,
        a: Numbers = 0.0,
        *,
        under: Conditions = OWN_CONDITIONS,
    ) -> State:
        """Computes positions, rates and accelerations of all links, and the driving torque.

        Args:
            q: Coordinates, rad and m; see the class. A crank angle within a few turns is not
                rounded.
            u: Rates of the coordinates, rad/s and m/s.
            a: Accelerations of the coordinates, rad/s^2 and m/s^2. `accelerations` computes the
                acceleration of a wind pump's slider.
            under: Conditions that differ from the mechanism's own.

        Returns:
            The state. Its values are floats if all arguments are floats, otherwise arrays of the
            broadcast shape.

        Raises:
            UnreachableError: At these coordinates, the loop cannot close, or a dyad is in line so
                that the rates are infinite.
            ConfigurationError: A value is not a finite number, or the torque overflows.
        """
        rows: Rows
        are_floats = type(q) is type(u) is type(a) is float
        if are_floats and self._takes_floats and under is OWN_CONDITIONS:  # the fastest way
            rows = self._accelerated.floats(q, u, a) if a else self._steady.floats(q, u)
        elif self.model.joint_loads:
            rows = self._settle(q, u, a, under).rows
        elif type(a) is float and not a and not under:
            rows = self._steady(*self._row('q', q), *self._row('u', u))
        else:
            rows = self._run(equations.state, under, q=q, u=u, a=a)
        positions, velocities, accelerations, torque = rows
        return State(positions, velocities, accelerations, torque, under, self.links)

    def torque(
        self,
        q: Numbers,
        u: Numbers = 0.0,
        a: Numbers = 0.0,
        *,
        under: Conditions = OWN_CONDITIONS,
    ) -> Real:
        """Computes the driving torque alone, N m, which costs less than the state.

        Arguments, sign and errors are those of `state`.
        """
        if self.model.joint_loads:
            *_, torque = self._settle(q, u, a, under).rows
            return torque
        if not under and (single := self._single(q, u, a)):
            return self._torque.floats(*single)[0]
        return self._run(equations.torque, under, q=q, u=u, a=a)[0]

    @functools.cached_property
    def _torque(self) -> Program:
        return self.program(equations.torque, 'q', 'u', 'a')

    @functools.cached_property
    def _steady(self) -> Program:
        return self.program(equations.state, 'q', 'u')

    @functools.cached_property
    def _accelerated(self) -> Program:
        return self.program(equations.state, 'q', 'u', 'a')

    @functools.cached_property
    def _forward(self) -> Program:
        return self.program(equations.forward, 'q', 'u', 'torque')

    @overload
    def accelerations(
        self, q: float, u: float, torque: float, *, under: Conditions = ...
    ) -> float: ...

    @overload
    def accelerations(
        self, q: Numbers, u: Numbers, torque: Numbers, *, under: Conditions = ...
    ) -> Any: ...

    def accelerations(
        self,
        q: Numbers,
        u: Numbers,
        torque: Numbers,
        *,
        under: Conditions = OWN_CONDITIONS,
    ) -> Any:
        """Solves M q'' + h - Q = torque for the accelerations q'' under a given torque.

        Arguments are as for `state`; the torque is that on the crank, N m.

        Returns:
            Accelerations of the coordinates, rad/s^2 and, for a wind pump's slider, m/s^2. They
            are a tuple if q is a tuple or there are several coordinates, otherwise a float or an
            array.

        Raises:
            UnreachableError: At these coordinates, the loop cannot close, or a dyad is in line.
            ConfigurationError: A value is not a finite number, or an acceleration overflows.
            MechanismError: A moving coordinate has no mass, or the mechanism has dry friction.
        """
        if not under and (single := self._single(q, u, torque)):
            found = self._forward.floats(*single)
        else:
            self._refuse_friction()
            found = self._run(equations.forward, under, q=q, u=u, torque=torque)
        is_tuple = len(self.coordinates) > 1 or isinstance(q, tuple)
        return found if is_tuple else found[0]

    def driven_state(
        self,
        q: Numbers,
        u: Numbers,
        torque: Numbers,
        *,
        under: Conditions = OWN_CONDITIONS,
    ) -> State:
        """Computes the state under a given torque, which is its `torque`.

        Arguments and errors are those of `accelerations`.
        """
        self._refuse_friction()
        rows = self._run(equations.driven_state, under, q=q, u=u, torque=torque)
        positions, velocities, accelerations, torque = rows
        return State(positions, velocities, accelerations, torque, under, self.links)

    def driven_by(
        self, torque: Callable[[float], float], under: Conditions = OWN_CONDITIONS
    ) -> Callable[..., tuple[float, ...]]:
        """Returns a fast function for integrators: the accelerations under a torque law.

        Args:
            torque: Function that returns the torque on the crank, N m, at a crank speed, rad/s.
            under: Conditions that differ from the mechanism's own. Their values are not used, only
                which are given.

        Returns:
            A function whose parameters are the coordinates, their rates and `under.values`, all
            floats. It does not check the types of its arguments, and raises the errors of
            `accelerations`.

        Raises:
            ConfigurationError: A force is given for a load that is not a force.
            MechanismError: The mechanism has dry friction.
        """
        self._refuse_friction()
        model, arguments = self.model, [self.names['q'], self.names['u']]
        if under:
            opened = self._open_model(under)
            model = opened.model
            arguments.append(opened.names)
        constants = Constants((model, Opaque(torque)))
        return self._bound(equations.driven, constants, tuple(arguments)).floats

    def dyad_sines(self, y: Sequence[float]) -> tuple[DyadSine, ...]:
        """Computes the sine of the angle between the two links of each dyad.

        The dyads of the other coordinates, if any, are last. `y` are coordinates, then their
        rates, floats.
        """
        program = self.program(equations.dyad_sines, 'q', 'u')
        return cast('tuple[DyadSine, ...]', program.floats(*y))

    def energy(self, state: State) -> tuple[Real, Real]:
        """Computes the mechanical energy of a state.

        Returns:
            The kinetic energy, J, and the potential energy of weights and loads, up to a constant,
            J. Forces among the conditions count as constant.

        Raises:
            ConfigurationError: The argument is not a state of this mechanism, or base_link turns.
        """
        q, u, _ = self._motion(state)
        frame = state.conditions.frame
        if frame and any(np.any(rate) for rate in frame[1:]):
            raise ConfigurationError(
                f'frame = {shown(frame)}: energy needs a base_link at rest; its rate and its '
                'acceleration must be 0'
            )
        return cast('tuple[Real, Real]', self._run(equations.energy, state.conditions, q=q, u=u))

    def matrix(self, q: Numbers) -> tuple[tuple[Real, ...], ...]:
        """Computes the rows of the mass matrix M at coordinates, as for `state`.

        Entries are in kg m^2 for two angles, kg m for an angle and a position, and kg for two
        positions.
        """
        return cast('tuple[tuple[Real, ...], ...]', self._run(equations.matrix, q=q))

    def point(self, state: State, name: str) -> PointMotion:
        """Computes the motion of a point of the mechanism in a state.

        It is a traced point, a pin, such as 'B', the mouth 'E' of a barrel, or a joint of a dyad,
        such as 'ram_joint'.

        Raises:
            ConfigurationError: The mechanism has no such point.
        """
        points = self.structure.points
        if not isinstance(name, str) or name not in points:
            raise ConfigurationError(f'point {shown(name)}: must be one of {", ".join(points)}')
        return self._point_motion(points[name], state)

    @property
    def springs(self) -> dict[str, Spring]:
        """Loads of kind spring, and cylinders of a drawing without a load, by name."""
        found = [load for load in self.mechanism.loads if isinstance(load, Spring)]
        drawn = self.mechanism.drawn
        return {one.name: one for one in (*(drawn.cylinders if drawn else ()), *found)}

    def spring(self, state: State, name: str) -> SpringMotion:
        """Computes length, rate and tension of a load of kind spring in a state.

        It may be a cylinder of a drawing without a load, whose tension is 0.

        Raises:
            ConfigurationError: The mechanism has no such spring.
        """
        springs = self.springs
        if name not in springs:
            known = ', '.join(springs) or 'none'
            raise ConfigurationError(f'spring {shown(name)}: must be one of {known}')
        load = springs[name]
        (_, start), (_, end) = load.ends(self.structure)
        apart, rate, _ = self._point_motion(end.minus(start), state)
        length = sqrt(dot(apart, apart))
        speed = dot(apart, rate) / where(length > 0, length, 1.0)
        tension = load.stiffness * (length - load.free_length) + load.damping * speed
        return SpringMotion(length, speed, tension)

    def _point_motion(self, point: Point, state: State) -> PointMotion:
        words = ('position', 'velocity', 'acceleration')
        names = tuple(tuple(f'{link}_{word}' for link in self.links) for word in words)
        row = [value for values in self._rows(state) for value in values]
        program = self._bound(
            equations.point_motion, Constants((point, _refusal(*sum(names, ())))), names
        )
        return cast('PointMotion', program(*row))

    def reactions(self, state: State) -> Reactions:
        """Computes the forces in the joints, the shaking force and moment, in a state.

        Raises:
            UnreachableError: The mechanism is at a change point, where joint forces are infinite.
            MechanismError: Joint forces of this mechanism are not supported.
        """
        pins = [pin.name for pin in self.structure.pins]
        if not pins:
            raise MechanismError(
                f'joint forces of a {type(self.mechanism).__name__} are not supported'
            )
        q, u, a = self._motion(state)
        forces: JointForces
        if self.model.joint_loads:
            forces = self._settle(q, u, a, state.conditions).reactions
        else:
            forces = self._run(reactions, state.conditions, q=q, u=u, a=a)
        sliding = [link.name for link in self.structure.links if link.slides]
        guides = map(GuideForce, forces.guides, forces.moments)
        return Reactions(
            dict(zip(pins, forces.pins, strict=True)),
            dict(zip(sliding, guides, strict=True)),
            forces.shaking_force,
            forces.shaking_moment,
            forces.torque,
        )

    def load_forces(self, state: State) -> dict[str, Real]:
        """Computes the generalised forces of loads and friction; see `wrenches`.

        They are the power of the loads per unit of each link's rate. A force at a point of the
        coupler therefore also acts on the crank, unlike in `exerted`.

        Returns:
            The torque on each loaded link by its name, N m, positive counter-clockwise; for a
            sliding link, the force along its guide, N.
        """
        bodies, forces = self.structure.links, dict[str, Real]()
        links = poses(bodies, self._rows(state)[0])
        for wrench in itertools.chain.from_iterable(self.wrenches(state).values()):
            for j, force in wrench.generalised(bodies, links):
                forces[self.links[j]] = forces.get(self.links[j], ZERO) + force
        return {name: number(force) for name, force in forces.items()}

    def wrenches(self, state: State) -> dict[str, list[Wrench]]:
        """Computes the forces and couples on all bodies, by the name of the load or friction.

        Weights and inertia are not among them, and neither is the inertia due to a turning frame.
        The friction includes the effect of all of these on the joint forces.
        """
        position, velocity, _ = self._rows(state)
        under, model = state.conditions, self._constants.tree
        if under:
            model = self._open_model(under).within(under.values)
        links = poses(self.structure.links, position)
        # A turning frame adds a load of its own after those on links.
        wrenches = {
            name: list(load.wrenches(links, velocity))
            for name, load in zip(self.mechanism.link_loads(), model.loads, strict=False)
        }
        if self.model.joint_loads:
            q, u, a = self._motion(state)
            caused = self._settle(q, u, a, under).loads
            for name, load in zip(self.mechanism.joint_loads(), caused, strict=True):
                # A load may be both on links and in joints.
                wrenches.setdefault(name, []).extend(load.wrenches(links, velocity))
        return wrenches

    def exerted(self, state: State) -> Exerted:
        """Sums the wrenches of loads and friction on each link where they act.

        Couples and forces along a guide are added for each link, over all loads. Forces at a point
        are added for each load and point; each further point of a link has a number. Unlike
        `load_forces`, a force at a point of the coupler does not appear on the crank. Forces on
        the frame and couples on sliding links are left out.
        """
        bodies, exerted = self.structure.links, Exerted({}, {})
        links = poses(bodies, self._rows(state)[0])
        for load, wrenches in self.wrenches(state).items():
            for wrench in wrenches:
                if wrench.body == FRAME:
                    continue
                link, effort = self.links[wrench.body], wrench.effort
                if not bodies[wrench.body].slides:
                    effort = effort + wrench.couple
                if effort is not ZERO:
                    exerted.efforts[link] = exerted.efforts.get(link, 0.0) + effort
                if wrench.point is not None:
                    force = Vector(*map(number, wrench.force))
                    at = Vector(*map(number, place(wrench.point, links)))
                    _add_force(exerted.forces, ExertedForce(load, link, force, at))
        return exerted

    def alignment(self, q: Sequence[float]) -> tuple[float, str]:
        """Measures how close a dyad is to being in line at coordinates, where the motion may end.

        Returns:
            The smallest sine of the angle between a dyad's two links, or between a link and the
            normal of the guide; 0 if the loop cannot close. Also a description of the position
            at which this sine is 0.
        """
        dyads, links = self.structure.dyads, self.structure.links
        if not dyads:
            return 1.0, ''
        at_rest = [0.0] * len(q)
        try:
            sines = [dyad.sine for dyad in self.dyad_sines((*q, *at_rest))]
        except UnreachableError:
            sines = [0.0] * len(dyads)
        # The sines of other coordinates' dyads, after these, are not used.
        sine, (i, j) = min(zip(sines, dyads, strict=False))
        first, second = links[i], links[j]
        if second.slides and second.parent == i:
            return sine, f'the {second.name} is at 0 m in the {first.name}'
        if second.slides:
            return sine, f'the {first.name} is perpendicular to the guide'
        return sine, f'{first.name} and {second.name} are in line'

    def _run(
        self, formula: Callable[..., Any], under: Conditions = OWN_CONDITIONS, **given: Any
    ) -> Any:
        """Evaluates a formula of the model, whose arguments are given by their keys in `names`."""
        values = [x for letter, row in given.items() for x in self._row(letter, row)]
        return self.program(formula, *given, under=under)(*values, *under.values)

    def _settle(self, q: Any, u: Any, a: Any, under: Conditions) -> Round:
        """Iterates until the joint forces and the loads caused by them are consistent.

        Returns:
            The last round. In arrays, converged states stay unchanged, so that the results are
            bit-identical to those of single states.

        Raises:
            UnreachableError: Friction locks the mechanism.
        """
        program = self.program(joint_load_round, *_ROUND, under=under)
        row = (*self._row('q', q), *self._row('u', u), *self._row('a', a))
        # The program takes the motion, the numbers of a `Search`, and those of the conditions.
        start, end = len(row), len(program.names) - len(under.values)
        names = program.names[:start] + program.names[end:]
        given, shape = real_numbers(names, [*row, *under.values])
        motion, conditions = given[:start], given[start:]
        share, solved, change = 1.0, 0.0, math.inf
        forces = [0.0] * (end - start - 3)
        search: list[Real] = [share, solved, change, *forces]
        if shape is not None:  # arrays from the start, so that all rounds use one program
            search = [np.full(shape, value) for value in search]
        for _ in range(_ROUNDS):
            outcome = cast('Round', program(*motion, *search, *conditions))
            is_locked = np.any(np.less(outcome.left, 0))
            if is_locked or not np.any(outcome.left):
                break
            search = leaves(outcome.search)
        crank, is_unsettled = np.broadcast_arrays(motion[0], np.not_equal(outcome.left, 0))
        if is_unsettled.any():
            _refuse_angle(
                self.mechanism,
                'friction locks the mechanism: no joint forces are in equilibrium; lower the '
                'coefficients or the pin radius',
                crank[is_unsettled].item(0),
            )
        return outcome

    def _single(self, q: Any, u: Any, other: Any) -> Sequence[float]:
        """Returns the values as floats if a program accepts them directly, otherwise ()."""
        if not self._takes_floats:
            return ()
        values = q, u, other
        return values if type(q) is type(u) is type(other) is float else single_numbers(*values)

    def _row(self, letter: str, row: Any) -> tuple[Any, ...]:
        """Converts an argument of a method to one value per coordinate or, for a torque, one.

        Raises:
            ConfigurationError: The number of values is wrong.
        """
        count = 1 if letter == 'torque' else self._count
        if type(row) is tuple:
            if len(row) == count:
                return row
        elif count == 1:
            return (row,)
        is_zero = type(row) is float and not row
        if is_zero and letter != 'q':  # the default: at rest
            return (row,) * count
        values = row if isinstance(row, (tuple, list)) or np.ndim(row) else ()
        if len(values) != count:
            words = ', '.join(self.names[letter]).replace('_', ' ') + ',' * (count == 1)
            raise ConfigurationError(f'{letter} = {shown(row)}: must be a tuple ({words})')
        return tuple(values)

    def _rows(self, state: State) -> tuple[tuple[Real, ...], ...]:
        """Returns the positions, velocities and accelerations of all links.

        Raises:
            ConfigurationError: The argument is not a state of this mechanism.
        """
        if isinstance(state, State):
            rows, count = state[:3], len(self.links)
            if all(type(row) is tuple and len(row) == count for row in rows):
                return rows
        raise ConfigurationError(
            f'state = {shown(state)}: must be a State of this mechanism, from its solver'
        )

    def _motion(self, state: State) -> tuple[tuple[Real, ...], ...]:
        """Returns the coordinates, rates and accelerations of a state."""
        return tuple(tuple(row[i] for i in self._moving) for row in self._rows(state))

    def _refuse_friction(self) -> None:
        """Rejects a mechanism with dry friction whose torque is given.

        Raises:
            MechanismError: The mechanism has dry friction.
        """
        if self.model.joint_loads:
            raise MechanismError(
                'dry friction under a given torque has no unique acceleration at rest: leave '
                'friction out where the torque is given, or give the speed'
            )


def _mechanism_of(given: Any) -> Mechanism:
    """Returns a mechanism, or that of an object that has one.

    Raises:
        MechanismError: The argument is neither.
    """
    mechanism = given
    inner = getattr(given, 'mechanism', None)
    if inner is not None:
        mechanism = inner() if callable(inner) else inner
    if not isinstance(mechanism, Mechanism):
        raise MechanismError(
            f'{shown(mechanism)}: must be a mechanism, such as a FourBar, or what load returns'
        )
    return mechanism


def _add_force(forces: dict[str, ExertedForce], new: ExertedForce) -> None:
    """Adds a force to that at the same point of the link, or under a name of its own."""
    for count in itertools.count(1):
        name = f'{new.load} on {new.link}{f" {count}" * (count > 1)}'
        if name not in forces:
            forces[name] = new
            return
        old = forces[name]
        if all(map(np.array_equal, old.at, new.at)):  # the same point has the same bits
            forces[name] = new._replace(force=old.force + new.force)
            return


def _refuse_angle(mechanism: Mechanism, reason: str, crank: float, *_: float) -> NoReturn:
    """Rejects a crank angle, rad, or a position of a driven link that slides, m.

    Raises:
        UnreachableError: Always. The message includes the reason.
    """
    reach = reach_of(mechanism)
    slides = reach is not None and reach.slides
    raise UnreachableError(
        f'at {place_words(crank, SLIDING if slides else TURNING)} {reason}',
        crank_angle=crank, arcs=reach.arcs if reach else (),
    )  # fmt: skip


def _refusal(*names: str) -> Opaque:
    """Returns a function that rejects numbers that are not finite or that cause an overflow."""

    def refuse(*values: float) -> NoReturn:
        given = dict(zip(names, values, strict=False))
        require_finite(**given)
        words = ', '.join(f'{name.replace("_", " ")} = {x:g}' for name, x in given.items())
        raise ConfigurationError(f'the torque or an acceleration overflows at {words}: lower them')

    return Opaque(refuse)


def _refuse_massless() -> NoReturn:
    """Rejects a mass matrix that is not positive definite.

    Raises:
        MechanismError: Always.
    """
    raise MechanismError(
        'links without mass have no finite acceleration under a torque: give them a mass or an '
        'inertia'
    )
