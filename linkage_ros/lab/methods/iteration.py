# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Newton-Raphson on the loop equation, as document 1 has it (eq. 8 to 12).

The document's listing goes on until the step and the residual are below a tolerance, and has no
cap; here 50 iterations are one, and the last iterate stands.
"""

from __future__ import annotations

from linkage_ros.lab.methods.functions import SCALAR
from linkage_ros.lab.methods.loop import Loop, solve_2x2

CAP = 50


class NewtonRaphson:
    """Solves one loop at one crank angle after another, as what `positions` returns.

    Attributes:
        iterations: Number of iterations in all calls so far.
    """

    def __init__(
        self, loop: Loop, tolerance: float, first_guess: tuple[float, float], *, warm: bool
    ) -> None:
        """Prepares it.

        Args:
            loop: The loop.
            tolerance: Tolerance of step (rad, of a slider m) and residual (m).
            first_guess: The coupler's direction and the output from which to begin.
            warm: Whether each angle begins from the solution of the one before; otherwise all
                begin from the first guess.
        """
        self._loop, self._tolerance, self._warm = loop, tolerance, warm
        self._guess = first_guess
        self.iterations = 0

    def __call__(self, crank: float) -> tuple[float, float]:
        """The position at a crank angle: whatever the iteration came to."""
        loop, tolerance = self._loop, self._tolerance
        coupler, output = self._guess
        for _ in range(CAP):
            x, y = loop.gap(crank, coupler, output, SCALAR)
            turn, move = solve_2x2(loop.columns(coupler, output, SCALAR), (-x, -y))
            coupler, output = coupler + turn, output + move
            self.iterations += 1
            if max(abs(turn), abs(move), abs(x), abs(y)) <= tolerance:
                break
        if self._warm:
            self._guess = coupler, output
        return coupler, output
