# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Period of a run: of its motion, its loads and its law together."""

import math
from collections.abc import Iterable

from linkage_ros.mechanism.kinematics import Reach
from linkage_ros.mechanism.loads.base import AppliedLoad


def period_turns(reach: Reach, loads: Iterable[AppliedLoad] = (), law_turns: int = 1) -> int:
    """Computes the number of crank turns after which motion, loads and law repeat together.

    Args:
        reach: Reach of the crank, with the period of the motion.
        loads: Loads, each with its own period.
        law_turns: Crank turns of one repetition of the law, negative if backwards; 1 for a
            constant speed.

    Returns:
        The number of turns. It is 0 if the driven link slides, and if the law returns the crank
        to its start without a whole turn, where motion and loads are as they were.
    """
    if reach.slides:
        return 0
    return math.lcm(reach.period_turns, law_turns, *(load.turns for load in loads))
