# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The state of a mechanism at a crank angle: positions, rates, accelerations and torque."""

from __future__ import annotations

import functools
import math
from math import isfinite
from typing import NoReturn

import numpy as np

from linkage_ros.dynamics.arguments import checked_state
from linkage_ros.dynamics.driving_torque import MassDistribution
from linkage_ros.dynamics.reactions import Reactions, reactions
from linkage_ros.dynamics.state import PointMotion, State, point_motion
from linkage_ros.errors import ConfigurationError, MechanismError, UnreachableError
from linkage_ros.mechanisms.kinematics import CrankKinematics
from linkage_ros.mechanisms.mobility import refusal
from linkage_ros.mechanisms.registry import Linkage
from linkage_ros.numeric import (
    ARRAY,
    SCALAR,
    Functions,
    Real,
    all_finite,
    functions_of,
    real_numbers,
    require_finite,
)
from linkage_ros.quantities import shown

# Arrays are worked through in pieces whose intermediate results stay in the processor's cache.
_CHUNK = 16384
# A named tuple's own constructor unpacks and repacks; at 3 us a state that would show.
_new = tuple.__new__


class Solver:
    """Exact states of one mechanism.

    Attributes:
        mechanism: The description it was made from.
        kinematics: Its exact position at a crank angle.
        structure: How its links hang together.
        links: Names of the links, in the order of all tuples.
        mobility: What the crank can do.
    """

    def __init__(self, mechanism: Linkage) -> None:
        self.mechanism = mechanism
        self.kinematics = CrankKinematics(mechanism)
        self.structure = self.kinematics.structure
        self.links = tuple(joint.name for joint in self.structure.joints)
        self.mobility = self.kinematics.mobility
        self._masses = MassDistribution(self.structure, mechanism.gravity)

    def require_full_turn(self) -> None:
        """Refuses a mechanism whose crank does not turn through every angle.

        Raises:
            MechanismError: With its class, what stops the crank, and where it can be.
        """
        if not self.mobility.turns_fully:
            raise MechanismError(refusal(self.mobility, 'turn fully'))

    def state(self, crank: Real, speed: Real = 0.0, acceleration: Real = 0.0) -> State:
        """Solves positions, rates, accelerations and the driving torque.

        Args:
            crank: Crank angle, rad; a float, or an array of any shape. One within a few turns
                keeps all its digits.
            speed: Crank speed, rad/s; a float, or an array that broadcasts with crank.
            acceleration: Crank acceleration, rad/s^2; likewise.

        Returns:
            Floats for floats; otherwise arrays of the broadcast shape.

        Raises:
            UnreachableError: The loop cannot close at a crank angle, or is stretched straight
                there so that no finite rate exists.
            ConfigurationError: An angle, speed or acceleration is not a finite number or an
                array of them, their shapes do not broadcast, or the torque overflows.
        """
        if not type(crank) is type(speed) is type(acceleration) is float:
            (crank, speed, acceleration), shape = real_numbers(
                crank_angle=crank, speed=speed, acceleration=acceleration
            )
            if shape:
                return self._solve_chunks(shape, (crank, speed, acceleration))
            crank, speed, acceleration = float(crank), float(speed), float(acceleration)
        if not isfinite(crank + speed + acceleration):
            _refuse_not_finite(crank, speed, acceleration)
        state = self._solve(crank, speed, acceleration, SCALAR)
        if not isfinite(state.torque):
            _refuse_not_finite(crank, speed, acceleration)
        return state

    def point(self, state: State, name: str) -> PointMotion:
        """Follows a point of the mechanism.

        Args:
            state: From `state`; floats or arrays.
            name: 'A0', 'A', 'B', 'C' (the coupler point, where there is one) or the four-bar's
                'B0'.

        Returns:
            Its position, velocity and acceleration in the axes of base_link.

        Raises:
            ConfigurationError: The mechanism has no such point, or the state is none of it.
        """
        points = self.structure.points
        if not isinstance(name, str) or name not in points:
            raise ConfigurationError(f'point {shown(name)}: must be one of {", ".join(points)}')
        state = checked_state(self.links, state)
        with np.errstate(under='ignore'):
            return point_motion(points[name], state)

    def reactions(self, state: State) -> Reactions:
        """Computes the forces in the joints, the shaking force and the shaking moment.

        Args:
            state: From `state`; floats or arrays.

        Returns:
            The forces.

        Raises:
            UnreachableError: The mechanism is at a change point, to within the rounding of the
                crank angle, where forces in its joints have no finite value.
            ConfigurationError: The state is none of this mechanism.
            MechanismError: Those of such a mechanism are not known.
        """
        state = checked_state(self.links, state)
        functions, kinematics = functions_of(state.torque), self.kinematics
        cranks = state.position[0]
        with np.errstate(under='ignore'):
            kinematics.require_reachable(cranks, functions)
            sine = kinematics.side * kinematics.map.sine(cranks, functions)
            at_change_point = kinematics.map.at_change_point(cranks, functions)
        if np.any(at_change_point):
            crank = float(np.atleast_1d(cranks)[np.atleast_1d(at_change_point)][0])
            raise UnreachableError(
                f'at {math.degrees(crank):.9g} deg all links lie in one line: the forces in the '
                'joints have no finite value at a change point; ask for angles beside it',
                crank_angle=crank,
                arcs=self.mobility.arcs,
            )
        with np.errstate(under='ignore'):
            return reactions(self.mechanism, self.structure, state, sine)

    def inertia(self, crank: Real) -> Real:
        """The moment of inertia of the whole mechanism, as the crank feels it.

        Args:
            crank: Crank angle, rad; a float, or an array.

        Returns:
            kg m^2: torque per crank acceleration; a float, or an array.

        Raises:
            ConfigurationError: A crank angle is not a finite number or an array of them.
            UnreachableError: The loop cannot close at a crank angle.
        """
        ((crank,), _) = real_numbers(crank_angle=crank)
        require_finite(crank_angle=crank)
        ((inertia,),) = self._masses.matrix(self.kinematics.links((crank,), functions_of(crank)))
        return inertia

    def _solve(self, crank: Real, speed: Real, acceleration: Real, functions: Functions) -> State:
        links = self.kinematics.links((crank,), functions)
        position, _, _, ((k1, k2, k3),), ((c1, c2, c3),) = links
        squared = speed * speed
        velocity = k1 * speed, k2 * speed, k3 * speed
        accelerations = c1 * squared, c2 * squared, c3 * squared
        if acceleration.__class__ is not float or acceleration:
            e1, e2, e3 = accelerations
            accelerations = (
                e1 + k1 * acceleration,
                e2 + k2 * acceleration,
                e3 + k3 * acceleration,
            )
        (torque,) = self._masses.balance(links, velocity, accelerations)
        return _new(State, (position, velocity, accelerations, torque))

    def _solve_chunks(self, shape: tuple[int, ...], inputs: tuple[Real, Real, Real]) -> State:
        # What is the same for all states stays a number: half of the work on it is saved.
        crank, speed, acceleration = (
            float(x) if isinstance(x, float) else np.broadcast_to(x, shape).ravel() for x in inputs
        )
        _keep_memory()
        size = math.prod(shape)
        rows = np.empty((10, size))
        for start in range(0, size, _CHUNK):
            piece = slice(start, start + _CHUNK)
            angle, rate, change = (
                x if isinstance(x, float) else x[piece] for x in (crank, speed, acceleration)
            )
            with np.errstate(over='ignore', invalid='ignore', under='ignore'):
                if not all_finite(angle, rate, change):
                    _refuse_not_finite(angle, rate, change)
                state = self._solve(angle, rate, change, ARRAY)
                if not all_finite(state.torque):
                    _refuse_not_finite(angle, rate, change)
            values = (*state.position, *state.velocity, *state.acceleration, state.torque)
            for row, value in zip(rows, values, strict=True):
                row[piece] = value
        a1, a2, a3, r1, r2, r3, e1, e2, e3, torque = (row.reshape(shape) for row in rows)
        return State((a1, a2, a3), (r1, r2, r3), (e1, e2, e3), torque)


@functools.cache
def _keep_memory() -> None:
    """Lets the C library keep the memory of intermediate results, which doubles the speed.

    glibc hands pieces of this size back to the system at once, and gets them again page by page,
    until it has seen a larger one freed. This one is never touched, so it costs nothing.
    """
    np.empty(3_000_000)


def _refuse_not_finite(crank: Real, speed: Real, acceleration: Real) -> NoReturn:
    require_finite(crank_angle=crank, speed=speed, acceleration=acceleration)
    fastest, hardest = np.max(np.abs(speed)), np.max(np.abs(acceleration))
    raise ConfigurationError(
        f'the torque overflows at a speed up to {fastest:g} rad/s and an acceleration up to '
        f'{hardest:g} rad/s^2: lower them'
    )
