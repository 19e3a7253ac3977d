# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Selects the integrator of a motion.

Processor time in s for each second of motion, in ticks of 1 ms, of the quadrilateral at 150 rpm
and the wind pump at 3 rad/s under motor lines of several dampings:

    damping, N m s       rate, 1/s   explicit   implicit   DOP853   implicit, 1e-11
    quadrilateral 30     6e2         0.05       0.07       0.5      0.3
    quadrilateral 200    4e3         0.14       0.07       1.0      0.3
    quadrilateral 1e3    2e4         0.4        0.05       2 to 3   0.3
    quadrilateral 1e7    2e8         -          0.08       -        0.1
    wind pump 1e5        5e3         0.1        0.15       0.4      0.15
    wind pump 4e5        2e4         0.5        0.15       1.1      0.12
    wind pump 1e7        5e5         12         0.09       17       0.15

Implicit steps at 1e-11 leave an error of 2e-7 N m in the quadrilateral's torque at 1e5 N m s,
SciPy's Radau at 1e-12 one of 2e-5 N m at the same cost, its LSODA 2e-6 N m at a sixth of it.
"""

from __future__ import annotations

from typing import Any

from linkage_ros.errors import ConfigurationError
from linkage_ros.motion.adaptive_integrator import AdaptiveSteps
from linkage_ros.motion.driven_mechanism import DrivenMechanism
from linkage_ros.motion.fixed_step_integrator import FixedSteps, Steps, Values
from linkage_ros.motion.stiff_integrator import StiffSteps

# Rates, 1/s: of settling, above which implicit steps cost less than explicit ones; of swinging,
# above which both need more than a core.
_STIFF, _TOO_FAST = 2e3, 1e4
_RECORD: dict[str, Any] = {'tolerance': 1e-11, 'trials': 10_000}  # tolerance of implicit steps
_RECORD_CORNERS: dict[str, Any] = {'tolerance': 1e-13, 'trials': 10_000}  # of explicit ones


def live_steps(driven: DrivenMechanism, phase: Values, **options: Any) -> Steps:
    """Makes an integrator with bounded work per tick.

    Args:
        driven: The mechanism under its torque.
        phase: Coordinates, then their rates.
        **options: Options of `FixedSteps`.

    Returns:
        The integrator.

    Raises:
        LinkageError: The motion cannot begin; see `Solver.accelerations`.
    """
    return live_method(driven)(driven, phase, **options)


def live_method(driven: DrivenMechanism) -> type[FixedSteps]:
    """Selects the cheaper integrator of live runs by the settling rate."""
    return StiffSteps if driven.rates[0] > _STIFF else FixedSteps


def require_live(driven: DrivenMechanism, period: float) -> None:
    """Refuses a mechanism whose natural frequency is too high for a live run.

    Args:
        driven: The mechanism under its torque.
        period: Period of the ticks, s.

    Raises:
        ConfigurationError: The springs swing too fast.
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
    """Makes the most accurate integrator; see `live_steps`."""
    if driven.rates[0] > _STIFF:
        return live_steps(driven, phase, **_RECORD)
    # Between the corners of a load, long steps of high order lose their accuracy.
    if any(load.has_corners for load in driven.solver.mechanism.loads):
        return FixedSteps(driven, phase, **_RECORD_CORNERS)
    return AdaptiveSteps(driven, phase)
