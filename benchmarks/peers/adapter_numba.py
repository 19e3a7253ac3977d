# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Numba: the textbook closed form, compiled."""

import numba
import numpy as np
from contract import Peer
from plain import make_plain


class Adapter(Peer):
    """Calls the Python function of plain.py, compiled by Numba."""

    name = 'Numba'
    distribution = 'numba'
    how = (
        'njit compiles the textbook closed form (benchmarks/peers/plain.py), with a loop over an '
        'array.'
    )

    def __init__(self, mechanism, speed, first):
        super().__init__(mechanism, speed, first)
        plain = self.plain = numba.njit(make_plain(mechanism, self.side))

        @numba.njit
        def loop(angles, w, out):
            for i in range(angles.size):
                state = plain(angles[i], w)
                for j in range(7):
                    out[j, i] = state[j]

        self.loop = loop

    def torque(self, angles):
        plain, speed = self.plain, self.speed
        return [plain(angle, speed) for angle in angles]

    def torque_array(self, angles):
        out = self.rows(7, angles.size)
        self.loop(angles, self.speed, out)
        return out

    def table(self, results):
        return results if isinstance(results, np.ndarray) else super().table(results)
