# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Which integrator follows a motion: the one place where it is chosen.

Processor time in s for each second of motion, in steps of 1 ms and in a record, of the
quadrilateral at 150 rpm under motor lines of several dampings, and of the wind pump:

    damping, N m s       rate, 1/s   explicit   implicit   DOP853   implicit, 1e-11
    quadrilateral 30     7e2         0.06       0.06       2.5      0.3
    quadrilateral 200    4e3         0.15       0.07       1.3      0.3
    quadrilateral 1e3    2e4         0.4        0.06       3.0      0.24
    quadrilateral 1e7    2e8         -          0.08       -        0.1
    pump 1e5             5e3         0.10       0.13       0.35     0.16
    pump 4e5             2e4         0.65       0.17       1.1      0.10

With the same cost as the implicit steps at 1e-11, SciPy's Radau and LSODA at 1e-12 leave errors of
the torque that are 100 to 1000 times as large at 1e5 N m s (2e-5, 2e-6 and 2e-7 N m).
"""

from __future__ import annotations

from typing import Any

from linkage_ros.errors import ConfigurationError
from linkage_ros.model.load_curve import LoadCurve
from linkage_ros.motion.adaptive_integrator import AdaptiveSteps
from linkage_ros.motion.driven_mechanism import DrivenMechanism
from linkage_ros.motion.fixed_step_integrator import FixedSteps, Steps, Values
from linkage_ros.motion.stiff_integrator import StiffSteps

# Rates, 1/s: of settling, from which implicit steps cost less than explicit ones; of swinging, for
# which all of them need more than a core.
_STIFF, _TOO_FAST = 2e3, 1e4
_RECORD = {'tolerance': 1e-11, 'trials': 10_000}  # of implicit steps


def live_steps(driven: DrivenMechanism, phase: Values, **options: Any) -> Steps:
    """Begins to follow a motion with bounded work for each tick.

    Args:
        driven: What moves.
        phase: Coordinates, then their rates.
        **options: Of `FixedSteps`.

    Returns:
        The integrator.

    Raises:
        LinkageError: The motion cannot begin, as `Solver.accelerations` tells.
    """
    steps = StiffSteps if driven.rates[0] > _STIFF else FixedSteps
    return steps(driven, phase, **options)


def require_live(driven: DrivenMechanism, period: float) -> None:
    """Refuses a mechanism that swings too fast on its springs for a live run.

    Args:
        driven: What moves.
        period: Time of a tick, s.

    Raises:
        ConfigurationError: It does.
    """
    swinging = driven.rates[1]
    if swinging > _TOO_FAST:
        raise ConfigurationError(
            f'the linkage swings on its spring in a time constant of {1e3 / swinging:.3g} ms, '
            f'with ticks of {1e3 * period:.3g} ms: a live run follows {1e3 / _TOO_FAST:g} ms and '
            f'more; divide {driven.solver.links[-1]}.stiffness, or the slope of the load, by '
            f'{(swinging / _TOO_FAST) ** 2:.2g}, or add mass'
        )


def record_steps(driven: DrivenMechanism, phase: Values) -> Steps:
    """Begins to follow a motion as exactly as possible; see `live_steps`."""
    if driven.rates[0] > _STIFF:
        return live_steps(driven, phase, **_RECORD)
    # A load curve has corners, between which long steps of high order lose their accuracy.
    has_corners = any(isinstance(x, LoadCurve) for x in driven.solver.mechanism.loads)
    return (FixedSteps if has_corners else AdaptiveSteps)(driven, phase)
