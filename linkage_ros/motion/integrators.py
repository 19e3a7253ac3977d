# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Selects the integrator of a motion.

Processor time in s for each second of motion, in ticks of 1 ms, of the quadrilateral at 150 rpm
and the wind pump at 3 rad/s under motor lines of several dampings:

    damping, N m s       rate, 1/s   explicit   implicit   DOP853   implicit, 1e-11
    quadrilateral 30     6e2         0.04       0.04       0.4      0.1
    quadrilateral 200    4e3         0.1        0.04       1.0      0.13
    quadrilateral 1e3    2e4         0.4        0.03       2 to 3   0.15
    quadrilateral 1e7    2e8         -          0.03       -        0.04
    wind pump 1e5        5e3         0.07       0.07       0.4      0.08
    wind pump 4e5        2e4         0.4        0.1        1.2      0.09
    wind pump 1e7        5e5         11         0.08       20       0.07

At 1e5 N m s, implicit steps at 1e-11 leave an error of 2e-7 N m in the quadrilateral's torque.
SciPy's Radau at 1e-12 leaves an error of 2e-5 N m at the same cost, and SciPy's LSODA one of 2e-6
N m at a sixth of this cost.
"""

from __future__ import annotations

from typing import Any

from linkage_ros.errors import ConfigurationError, LinkageError
from linkage_ros.motion.adaptive_integrator import AdaptiveSteps
from linkage_ros.motion.coordinates import Coordinates
from linkage_ros.motion.driven_mechanism import DrivenMechanism
from linkage_ros.motion.fixed_step_integrator import FixedSteps, Steps, Values
from linkage_ros.motion.stiff_integrator import StiffSteps

_STIFF = 2e3  # rate of settling, 1/s, above which implicit steps cost less than explicit ones
_MOST_STEPS, _TRIED = 50, 100  # steps of 12 us of work in each ms; ms of the motion to try
_RECORD: dict[str, Any] = {'tolerance': 1e-11, 'trials': 10_000}  # tolerance of implicit steps
_RECORD_CORNERS: dict[str, Any] = {'tolerance': 1e-13, 'trials': 10_000}  # of explicit steps


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


def require_live(driven: DrivenMechanism, begin: Coordinates, period: float) -> None:
    """Refuses a motion that takes too many steps for a live run.

    Args:
        driven: The mechanism under its torque.
        begin: Coordinates at t = 0.
        period: Period of the ticks, s.

    Raises:
        ConfigurationError: The first 0.1 s of the motion take too many steps, or the motion ends
            in the first ms.
    """
    method, tried, words = live_method(driven), 0.0, ''
    steps = method(driven, (*begin.q, *begin.u))
    # An implicit step takes twice as long, and so does a step in two coordinates.
    most = _MOST_STEPS // (len(driven.links) * (2 if method is StiffSteps else 1))
    for ms in range(1, _TRIED + 1):
        try:
            steps.advance(1e-3 * ms)
        except LinkageError as error:
            words = f'{error}' if ms == 1 else ''  # the run itself reports a later end
            break
        tried = steps.tried / ms
    if tried > most:
        words = (
            f'it takes {tried:.0f} steps in each ms, where {most} fit: lower a stiffness, '
            'the slope of a load or the speed, or add mass; linkage_record follows it'
        )
    if words:
        fastest = max(driven.rates[1], abs(steps.driven.speed(steps.phase)))
        raise ConfigurationError(
            'a live run cannot follow this motion, where a swing, or a radian of the crank, takes '
            f'{1e3 / fastest:.3g} ms and a tick {1e3 * period:.3g} ms: {words}'
        )


def record_steps(driven: DrivenMechanism, phase: Values) -> Steps:
    """Makes the most accurate integrator; see `live_steps`."""
    if driven.rates[0] > _STIFF:
        return live_steps(driven, phase, **_RECORD)
    # Between the corners of a load, long steps of high order lose their accuracy.
    if any(load.has_corners for load in driven.solver.mechanism.loads):
        return FixedSteps(driven, phase, **_RECORD_CORNERS)
    return AdaptiveSteps(driven, phase)
