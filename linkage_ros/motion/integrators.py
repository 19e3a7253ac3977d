# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Selects the integrator for a torque-driven motion.

The table lists the processor time, in s per second of motion, for ticks of 1 ms. The quadrilateral
turns at 150 rpm and the wind pump at 3 rad/s; `Motor.damping` varies:

    damping, N m s       rate, 1/s   explicit   implicit   DOP853   implicit, 1e-11
    quadrilateral 30     6e2         0.04       0.04       0.4      0.1
    quadrilateral 200    4e3         0.1        0.04       1.0      0.13
    quadrilateral 1e3    2e4         0.4        0.03       2 to 3   0.15
    quadrilateral 1e7    2e8         -          0.03       -        0.04
    wind pump 1e5        5e3         0.07       0.07       0.4      0.08
    wind pump 4e5        2e4         0.4        0.1        1.2      0.09
    wind pump 1e7        5e5         11         0.08       20       0.07

At a damping of 1e5 N m s, the error of the quadrilateral's torque is 2e-7 N m for implicit steps
with a tolerance of 1e-11. It is 2e-5 N m for SciPy's Radau (1e-12) at the same cost, and 2e-6 N m
for SciPy's LSODA at a sixth of this cost.
"""

from __future__ import annotations

from typing import Any

from linkage_ros.errors import ConfigurationError, LinkageError
from linkage_ros.motion.adaptive_integrator import AdaptiveSteps
from linkage_ros.motion.coordinates import Coordinates
from linkage_ros.motion.driven_mechanism import DrivenMechanism
from linkage_ros.motion.fixed_step_integrator import FixedSteps, Steps, Values
from linkage_ros.motion.stiff_integrator import StiffSteps

_STIFF = 2e3  # settling rate, 1/s, above which implicit steps cost less than explicit ones
_MOST_STEPS, _TRIED = 20, 100  # limit of steps per ms, at 12 us each; ms of motion to check
_RECORD: dict[str, Any] = {'tolerance': 1e-11, 'trials': 10_000}  # for implicit steps
_RECORD_CORNERS: dict[str, Any] = {'tolerance': 1e-13, 'trials': 10_000}  # for explicit steps


def live_steps(driven: DrivenMechanism, phase: Values, **options: Any) -> Steps:
    """Creates an integrator with bounded work per tick.

    Args:
        driven: The mechanism and its torque law.
        phase: Coordinates at t = 0, followed by their rates.
        **options: Further parameters of `FixedSteps`.

    Returns:
        The integrator at t = 0.

    Raises:
        LinkageError: The motion cannot start; see `Solver.accelerations`.
    """
    return live_method(driven)(driven, phase, **options)


def live_method(driven: DrivenMechanism) -> type[FixedSteps]:
    """Selects the integrator that costs less at the mechanism's settling rate."""
    return StiffSteps if driven.rates[0] > _STIFF else FixedSteps


def require_live(driven: DrivenMechanism, begin: Coordinates, period: float) -> None:
    """Rejects a motion that requires too many steps for a live run.

    Args:
        driven: The mechanism and its torque law.
        begin: Coordinates at t = 0.
        period: Period of the ticks, s.

    Raises:
        ConfigurationError: The first 0.1 s of the motion requires too many steps, or the motion
            ends within the first ms.
    """
    method, tried, words = live_method(driven), 0.0, ''
    steps = method(driven, (*begin.q, *begin.u))
    # An implicit step takes twice as long, and so does a step in two coordinates.
    most = _MOST_STEPS // (len(driven.links) * (2 if method is StiffSteps else 1))
    for ms in range(1, _TRIED + 1):
        try:
            steps.advance(1e-3 * ms)
        except LinkageError as error:
            words = f'{error}' if ms == 1 else ''  # the run reports a later end
            break
        tried = steps.tried / ms
    if tried > most:
        words = (
            f'it requires {tried:.0f} steps per ms, but only {most} fit; lower a stiffness, '
            'the slope of a load or the speed, add mass, or use linkage_record'
        )
    if words:
        fastest = max(driven.rates[1], abs(steps.driven.speed(steps.phase)))
        raise ConfigurationError(
            'a live run cannot follow this motion, in which a radian of the crank or of an '
            f'oscillation takes {1e3 / fastest:.3g} ms and a tick {1e3 * period:.3g} ms: {words}'
        )


def record_steps(driven: DrivenMechanism, phase: Values) -> Steps:
    """Creates the most accurate integrator for the mechanism; arguments as in `live_steps`."""
    if driven.rates[0] > _STIFF:
        return live_steps(driven, phase, **_RECORD)
    # Corners of a load destroy the accuracy of long high-order steps.
    if any(load.has_corners for load in driven.solver.mechanism.loads):
        return FixedSteps(driven, phase, **_RECORD_CORNERS)
    return AdaptiveSteps(driven, phase)
