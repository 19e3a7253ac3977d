# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What every adapter offers: one peer, made for any four-bar of linkage_ros, by one interface."""

import math

import numpy as np

from linkage_ros import Solver


class Peer:
    """A four-bar in another library.

    The four ways of asking take crank angles, rad, which go on from those asked before, and give
    what the peer gives: that alone is timed. `table` then brings it into one form. A way that
    the peer does not have is None.

    Attributes:
        name: As people know it.
        distribution: What its version is asked by; None for what has no package.
        how: How it is called, in a sentence or two for the reader of the table.
        kinematics: Position, rate and acceleration of coupler and rocker, state by state.
        torque: The same with the driving torque.
        kinematics_array: As kinematics, for an array.
        torque_array: As torque, for an array.
    """

    name: str
    distribution = None
    how: str
    kinematics = torque = kinematics_array = torque_array = None

    def __init__(self, mechanism, speed, first):
        """Puts it together.

        Args:
            mechanism: A FourBar.
            speed: Crank speed, rad/s, which is constant.
            first: Crank angle of the first state, rad. It tells which assembly is meant to peers
                that stay on one side, or begin at a guess and follow the motion.
        """
        self.mechanism, self.speed = mechanism, speed
        self._memory = np.empty((0, 0))
        _, self.beta, self.gamma = Solver(mechanism).state(first).position
        self.lengths = (
            *(mechanism.crank.length, mechanism.coupler.length),
            *(mechanism.rocker.length, mechanism.frame.length),
        )
        angle = mechanism.frame.angle
        self.pivot = self.lengths[3] * math.cos(angle), self.lengths[3] * math.sin(angle)
        # Where the coupler-rocker pin lies as seen along the line from A to B0.
        self.side = math.copysign(1.0, math.sin(self.gamma - self.beta))

    def table(self, results):
        """Rows: angle, rate and acceleration of coupler and rocker, then the torque, if asked."""
        return np.array(results, float).T

    def rows(self, count, size):
        """Memory for results, kept from call to call: new memory would cost more than C does."""
        if self._memory.shape != (count, size):
            self._memory = np.empty((count, size))
        return self._memory


class NewtonPeer(Peer):
    """What an engine without loops needs: the loop closed by Newton's method.

    The steps themselves are written out in each adapter: they are timed, and a call would count.

    Attributes:
        tolerance: Gap at the coupler-rocker pin below which the loop is closed, m.
    """

    STEPS = 50
    COLD = (
        'This row uses the same code, but each state starts from the first state of the turn, '
        'which shows the cost of a state without a known neighbour. This package solves every '
        'state without a neighbour.'
    )
    # Whether each state begins from the first one, as for one angle out of the blue.
    cold = False

    def __init__(self, mechanism, speed, first):
        super().__init__(mechanism, speed, first)
        self.tolerance = 2e-13 * max(self.lengths)
        # Crank angle, angle of the coupler to the crank, of the rocker; rates of the last two.
        coupler = math.remainder(self.beta - first, 2 * math.pi)
        self.last = (first, coupler, self.gamma, 0.0, 0.0)

    def begin(self, crank):
        """A first guess: the last state, carried on by its rates, or the first state."""
        before, coupler, rocker, w2, w3 = self.last
        if self.cold:
            # As directions, for which it is nearest.
            return math.remainder(self.beta - crank, 2 * math.pi), self.gamma
        turned = crank - before
        # Asked elsewhere, the rates of the last state say nothing.
        time = turned / self.speed if abs(turned) < 0.5 else 0.0
        return coupler + w2 * time, rocker + w3 * time

    def kinematics(self, angles):
        return [self.state(angle) for angle in angles]

    def state(self, crank):
        """Angles, rates and accelerations of coupler and rocker: an adapter's own."""
        raise NotImplementedError

    def give_up(self, crank):
        """Says that the loop does not close.

        Raises:
            RuntimeError: Always.
        """
        raise RuntimeError(f'at {crank} rad Newton does not converge in {self.STEPS} steps')
