# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The state of a mechanism at a crank angle: positions, rates, accelerations and torque."""

from __future__ import annotations

from math import isfinite
from typing import NamedTuple, NoReturn

import numpy as np

from linkage_ros.dynamics import MassBody, MassDistribution
from linkage_ros.errors import ConfigurationError, MechanismError
from linkage_ros.four_bar import FourBarKinematics
from linkage_ros.links import PerLink
from linkage_ros.mechanism import FourBar
from linkage_ros.mobility import assess, refusal, unreachable
from linkage_ros.numeric import ARRAY, SCALAR, Functions, Real

# Arrays are worked through in pieces whose intermediate results stay in the processor's cache.
_CHUNK = 4096
# A named tuple's own constructor unpacks and repacks; at 3 us a state that would show.
_new = tuple.__new__


class State(NamedTuple):
    """The motion of a mechanism at one crank angle, or at an array of them.

    The links are in the order of `Solver.links`: crank, coupler, rocker.

    Attributes:
        angle: Directions of the links from first to second pin, rad; in [-pi, pi], except the
            crank's, which is the angle that was asked for.
        rate: Their angular velocities, rad/s.
        acceleration: Their angular accelerations, rad/s^2.
        torque: Driving torque on the crank, N m, counter-clockwise positive.
    """

    angle: PerLink
    rate: PerLink
    acceleration: PerLink
    torque: Real


class Solver:
    """Exact states of one mechanism.

    Attributes:
        mechanism: The description it was made from.
        links: Names of the links, in the order of all tuples.
        mobility: What the crank can do.
    """

    def __init__(self, mechanism: FourBar) -> None:
        self.mechanism = mechanism
        self._kinematics = FourBarKinematics(mechanism)
        self.links = self._kinematics.links
        self.mobility = assess(mechanism, self._kinematics.map)
        self._limited = not self.mobility.turns_fully
        bodies = (mechanism.crank, mechanism.coupler, mechanism.rocker)
        self._masses = MassDistribution(
            [
                MassBody(link, body.mass, body.inertia, center)
                for link, (body, center) in enumerate(
                    zip(bodies, self._kinematics.centers(mechanism), strict=True)
                )
            ],
            mechanism.gravity,
        )

    def require_full_turn(self) -> None:
        """Refuses a linkage whose crank does not turn through every angle.

        Raises:
            MechanismError: With its class, what stops the crank, and where it can be.
        """
        if self._limited:
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
            ConfigurationError: An angle, speed or acceleration is not finite, or so large that
                the torque is not.
        """
        if not type(crank) is type(speed) is type(acceleration) is float:
            inputs = (np.asarray(x, float) for x in (crank, speed, acceleration))
            arrays = np.broadcast_arrays(*inputs)
            if arrays[0].ndim > 0:
                return self._solve_chunks(*arrays)
            crank, speed, acceleration = (float(x) for x in arrays)
        if not isfinite(crank + speed + acceleration):
            _refuse_not_finite(crank, speed, acceleration)
        state = self._solve(crank, speed, acceleration, SCALAR)
        if not isfinite(state.torque):
            _refuse_not_finite(crank, speed, acceleration)
        return state

    def _solve(self, crank: Real, speed: Real, acceleration: Real, functions: Functions) -> State:
        if self._limited:
            self._require_reachable(crank, functions)
        links = self._kinematics.solve(crank, functions)
        angle, _, _, ((k1, k2, k3),), (c1, c2, c3) = links
        squared = speed * speed
        rate = k1 * speed, k2 * speed, k3 * speed
        accelerations = (
            c1 * squared + k1 * acceleration,
            c2 * squared + k2 * acceleration,
            c3 * squared + k3 * acceleration,
        )
        (torque,) = self._masses.balance(links, rate, accelerations)
        return _new(State, (angle, rate, accelerations, torque))

    def _require_reachable(self, crank: Real, functions: Functions) -> None:
        for margin in self._kinematics.map.margins(crank, functions):
            if not functions.lowest(margin) > 0:
                worst = np.atleast_1d(crank)[np.atleast_1d(margin) <= 0][0]
                raise unreachable(self.mobility, float(worst))

    def _solve_chunks(self, crank: Real, speed: Real, acceleration: Real) -> State:
        shape = crank.shape
        inputs = crank.ravel(), speed.ravel(), acceleration.ravel()
        rows = np.empty((10, crank.size))
        for start in range(0, crank.size, _CHUNK):
            piece = slice(start, start + _CHUNK)
            crank, speed, acceleration = (x[piece] for x in inputs)
            if not all(np.isfinite(x).all() for x in (crank, speed, acceleration)):
                _refuse_not_finite(crank, speed, acceleration)
            with np.errstate(over='ignore', invalid='ignore', under='ignore'):
                state = self._solve(crank, speed, acceleration, ARRAY)
            if not np.isfinite(state.torque).all():
                _refuse_not_finite(crank, speed, acceleration)
            values = (*state.angle, *state.rate, *state.acceleration, state.torque)
            for row, value in zip(rows, values, strict=True):
                row[piece] = value
        a1, a2, a3, r1, r2, r3, e1, e2, e3, torque = (row.reshape(shape) for row in rows)
        return State((a1, a2, a3), (r1, r2, r3), (e1, e2, e3), torque)


def _refuse_not_finite(crank: Real, speed: Real, acceleration: Real) -> NoReturn:
    named = {'crank angle': crank, 'speed': speed, 'acceleration': acceleration}
    for name, values in named.items():
        bad = np.atleast_1d(values)[~np.isfinite(np.atleast_1d(values))]
        if bad.size:
            raise ConfigurationError(f'{name} = {bad[0]}: must be a finite number')
    fastest, hardest = np.max(np.abs(speed)), np.max(np.abs(acceleration))
    raise ConfigurationError(
        f'the torque overflows at a speed up to {fastest:g} rad/s and an acceleration up to '
        f'{hardest:g} rad/s^2: lower them'
    )
