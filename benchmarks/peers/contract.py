# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The interface of all adapters, which make a peer from any four-bar of linkage_ros."""

import math

import numpy as np

from linkage_ros import Solver


class Peer:
    """A four-bar in another library.

    Each of the four methods takes crank angles, rad, which continue those of the previous call,
    and returns the peer's results in its own form; only these calls are timed. `table` converts
    the results. A method that the peer does not offer is None.

    Attributes:
        name: Name on the page.
        distribution: Name of the Python package; None if there is none.
        how: Description of the calls for the page, in a few sentences.
        kinematics: Computes position, rate and acceleration of coupler and rocker, state by state.
        torque: Like kinematics, with the driving torque.
        kinematics_array: Like kinematics, for an array.
        torque_array: Like torque, for an array.
    """

    name: str
    distribution = None
    how: str
    kinematics = torque = kinematics_array = torque_array = None

    def __init__(self, mechanism, speed, first):
        """Makes the four-bar.

        Args:
            mechanism: A FourBar.
            speed: Constant crank speed, rad/s.
            first: Crank angle of the first state, rad. It selects the assembly in peers that keep
                to one side of the diagonal or follow the motion.
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
        # +1 if the coupler-rocker pin is left of the line from A to B0, -1 if right.
        self.side = math.copysign(1.0, math.sin(self.gamma - self.beta))

    def table(self, results):
        """Returns rows of angles, rates and accelerations of coupler and rocker, and of torque."""
        return np.array(results, float).T

    def rows(self, count, size):
        """Returns reused memory for results: allocation would take longer than the C function."""
        if self._memory.shape != (count, size):
            self._memory = np.empty((count, size))
        return self._memory


class NewtonPeer(Peer):
    """Base of peers without loop constraints, in which Newton's method closes the loop.

    Each adapter contains its own iteration, because a call would add to the measured time.

    Attributes:
        tolerance: Gap at the coupler-rocker pin below which the loop counts as closed, m.
    """

    STEPS = 50
    COLD = (
        'The same code, but each state starts from the first state of the turn, as if no '
        'neighbour were known. linkage_ros needs no neighbour.'
    )
    # Whether each iteration starts from the first state, as if no neighbouring state were known.
    cold = False

    def __init__(self, mechanism, speed, first):
        super().__init__(mechanism, speed, first)
        self.tolerance = 2e-13 * max(self.lengths)
        # Crank angle, coupler angle relative to the crank, rocker angle; rates of the last two.
        coupler = math.remainder(self.beta - first, 2 * math.pi)
        self.last = (first, coupler, self.gamma, 0.0, 0.0)

    def begin(self, crank):
        """Returns a first guess: the last state extrapolated by its rates, or the first state."""
        before, coupler, rocker, w2, w3 = self.last
        if self.cold:
            # The coupler angle is relative to the crank, so it changes with the crank angle.
            return math.remainder(self.beta - crank, 2 * math.pi), self.gamma
        turned = crank - before
        # The rates of the last state are valid only near it.
        time = turned / self.speed if abs(turned) < 0.5 else 0.0
        return coupler + w2 * time, rocker + w3 * time

    def kinematics(self, angles):
        return [self.state(angle) for angle in angles]

    def state(self, crank):
        """Computes angles, rates and accelerations of coupler and rocker."""
        raise NotImplementedError

    def give_up(self, crank):
        """Reports that the iteration does not converge.

        Raises:
            RuntimeError: Always.
        """
        raise RuntimeError(f'at {crank} rad Newton does not converge in {self.STEPS} steps')
