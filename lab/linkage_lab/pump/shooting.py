# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Periodic motions of a wind pump, found by shooting.

As long as the crank turns forwards, its angle replaces time as the independent variable (M. Henon,
Physica D 5 (1982), 412-414). A phase holds slider position, crank speed, slider velocity and motor
torque at rest, M0, at crank angle 0. P maps a phase to the phase one turn later, where M0 is the
same. A motion that repeats after n turns satisfies P^n(y) = y, which Newton's method solves. The
eigenvalues of the derivative of P^n at constant M0 are its Floquet multipliers.

Loads that jump need no special treatment, because the integrator's step control resolves a jump.
"""

import functools
import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from linkage_ros import LinkageError, MotionError, Solver, State, WindPump
from linkage_ros.formulas import Array
from linkage_ros.internals import Motor

TURN = 2 * math.pi
# Relative tolerances of the integration: of states, along a curve, of guesses, and over time.
STATE, CURVE, ROUGH, _OVER_TIME = 1e-10, 1e-7, 1e-6, 1e-5
_TORQUE = np.array((0.0, 0.0, 0.0, 1.0))  # the direction of M0
_FIRST_STEP, _MOST = 0.1, 20_000  # rad; evaluations per turn, of which a jump needs up to 5 000
_DIFFERENCE = 1e-5  # for derivatives by central differences, in the units of a phase
# Nine phases near a phase: itself, then displaced forwards, then backwards along each axis.
_MOVES: Any = _DIFFERENCE * np.hstack((np.zeros((4, 1)), np.eye(4), -np.eye(4)))
_STEPS, _LONGEST = 8, 2.0  # number of Newton steps; length of the longest, in units of a phase
_LAST, _NOISE = 10.0, 1e3  # lengths of the last step, in tolerances; see `_has_converged`
_IN_LINE = 0.02  # smallest sine of the angle between coupler and rod
SAME = 1e-4  # distance below which two phases count as equal, in the units of a phase


class Shooting:
    """The map P of a pump with a motor.

    Attributes:
        solver: Solver of the pump.
        motor: The motor.
        units: Typical sizes of the values of a phase: m, rad/s, m/s and N m.
    """

    def __init__(self, mechanism: WindPump, motor: Motor, pace: float) -> None:
        """Prepares the map; `pace` is a typical crank speed, rad/s."""
        self.solver, self.motor = Solver(mechanism), motor
        r = mechanism.crank.length
        self.units: Any = np.array((r, pace, r * pace, motor.torque))
        self._lengths = r, mechanism.coupler.length, mechanism.rod.length
        # `driven_by` takes a torque that depends on the speed alone; the torque at rest, which
        # differs between phases, is set before each evaluation.
        self._torque_at_rest = motor.torque
        self._driven = self.solver.driven_by(lambda w: self._torque_at_rest - motor.damping * w)

    def shoot(
        self, phases: Array, turns: int = 1, tolerance: float = STATE, *, dense: bool = False
    ) -> Any:
        """Integrates motions in common steps, which makes their differences accurate.

        Args:
            phases: Phases at crank angle 0, of shape (4, n).
            turns: Number of turns.
            tolerance: Relative tolerance.
            dense: Whether to add the continuous solution.

        Returns:
            The result of `solve_ivp` over the crank angle. After each turn, `y` has n values for
            each value of a phase, and n times. `y_events` are the values of the first motion where
            its slider reverses.

        Raises:
            MotionError: The crank stops, the dyad is stretched, or a turn takes too many steps.
        """
        # The integrated values are n slider positions, n crank speeds, n slider velocities,
        # n torques and n times.
        count, evaluations = phases.shape[1], 0

        def slopes(angle: float, values: Array) -> Array:
            nonlocal evaluations
            evaluations += 1
            if evaluations > _MOST * turns:
                return math.nan * values  # ends the integration
            motions = values.reshape(5, count).T.tolist()
            return np.array([self._slope(angle, *motion) for motion in motions]).T.ravel()

        def slider_velocity(_: float, values: Array) -> float:
            return float(values[2 * count])  # of the first motion

        start = np.append(phases, np.zeros(count))
        absolute = tolerance * np.repeat((*self.units, 1 / self.units[1]), count)
        with np.errstate(all='ignore'):
            solution = solve_ivp(
                slopes, (0.0, TURN * turns), start, 'DOP853',
                t_eval=TURN * np.arange(1, turns + 1), dense_output=dense, events=slider_velocity,
                first_step=_FIRST_STEP, rtol=tolerance, atol=absolute,
            )  # fmt: skip
        if not solution.success:
            raise MotionError(
                'the crank stops, the dyad is stretched, or a load jumps too often',
                time=0.0, coordinates=(0.0, float(phases[0, 0])),
            )  # fmt: skip
        return solution

    def _slope(
        self, angle: float, x: float, w: float, v: float, torque: float, _: float
    ) -> tuple[float, ...]:
        """Computes the derivatives of a phase and of the time over the crank angle.

        They are NaN where no motion exists; the integrator then shortens its step.
        """
        self._torque_at_rest = torque
        crank, slider = self._accelerations(angle, x, w, v)
        return (v / w, crank / w, slider / w, 0.0, 1 / w) if w > 0 else (math.nan,) * 5

    def _accelerations(self, angle: float, x: float, w: float, v: float) -> tuple[float, ...]:
        """Computes the accelerations; NaN if the dyad is nearly in line."""
        r, b, c = self._lengths
        square = x * x + r * r - 2 * x * r * math.cos(angle)  # of the dyad's length
        sines = ((b + c) ** 2 - square) * (square - (b - c) ** 2)
        if not sines > (2 * b * c * _IN_LINE) ** 2:
            return math.nan, math.nan
        try:
            return self._driven(angle, x, w, v)
        except LinkageError:
            return math.nan, math.nan

    def find(
        self, guess: Array, turns: int = 1, fixed: Array = _TORQUE, tolerance: float = STATE
    ) -> 'PeriodicMotion':
        """Finds a periodic motion by Newton's method.

        Args:
            guess: Approximate phase of the motion.
            turns: Number of turns after which the motion repeats.
            fixed: Direction in which the phase is held fixed, in the units of a phase; by default,
                that of the torque.
            tolerance: Relative tolerance of the integration.

        Returns:
            The motion, with fewer turns if it repeats earlier.

        Raises:
            MotionError: No motion was found.
        """
        phase, size = guess, math.inf
        for _ in range(_STEPS):
            shot = self._shoot_near(phase, turns, tolerance)
            step = shot.newton_step(fixed)
            size_before, size = size, float(np.abs(step).max())
            if _has_converged(size, size_before, tolerance):
                if shot.period < turns:  # its derivative is over fewer turns
                    return self.find(phase, shot.period, fixed, tolerance)
                sections = np.column_stack((phase, self.units[:, None] * shot.ends[:, :-1]))
                turning_points = shot.reversals[:, 0]
                return PeriodicMotion(self, sections, shot.derivative, shot.times, turning_points)
            if not size < _LONGEST:
                break
            phase = phase + self.units * step
        raise MotionError(
            "Newton's method finds no periodic motion",
            time=0.0, coordinates=(0.0, float(guess[0])),
        )  # fmt: skip

    def _shoot_near(self, phase: Array, turns: int, tolerance: float) -> '_Shot':
        """Integrates the motion from a phase, with neighbours that show its derivative."""
        units = self.units[:, None]
        solution = self.shoot(phase[:, None] + units * _MOVES, turns, tolerance)
        values = solution.y.reshape(5, _MOVES.shape[1], turns)
        phases, times = values[:4] / units[..., None], values[4]
        # The phases after each turn, from starts in the order of _MOVES.
        base, forwards, backwards = phases[:, 0], phases[:, 1:5], phases[:, 5:]
        derivative = (forwards - backwards)[:3, :, -1] / (2 * _DIFFERENCE)
        moved = base - phase[:, None] / units
        return _Shot(base, moved, derivative, times[0], solution.y_events[0])

    def run(self, values: Array, duration: float, samples: Array | None = None) -> Any:
        """Integrates a motion over time; the crank may also turn backwards.

        Args:
            values: Crank angle, slider position, and their rates.
            duration: Duration, s.
            samples: Times of the samples, s; None for one per step.

        Returns:
            The result of `solve_ivp`. `y_events` are the values where the sine of the crank angle
            becomes positive. The motion ends early if the dyad is stretched.
        """
        evaluations, most_evaluations = 0, _MOST * (1 + duration * self.units[1] / TURN)
        self._torque_at_rest = self.motor.torque

        def slopes(_: float, values: Array) -> tuple[float, ...]:
            nonlocal evaluations
            evaluations += 1
            rates, accelerations = values[2:], self._accelerations(*values.tolist())
            return (*rates, *accelerations) if evaluations < most_evaluations else (math.nan,) * 4

        def sine(_: float, values: Array) -> float:
            return math.sin(values[0])

        sine.direction = 1.0  # type: ignore[attr-defined]  # an event where it rises
        with np.errstate(all='ignore'):
            return solve_ivp(
                slopes, (0.0, duration), values, 'DOP853', t_eval=samples, events=sine,
                first_step=_FIRST_STEP / self.units[1], rtol=_OVER_TIME,
                atol=_OVER_TIME * np.array((1.0, *self.units[:3])),
            )  # fmt: skip


class _Shot(NamedTuple):
    """A motion over some turns, with the derivative of its end with respect to its start.

    Attributes:
        ends: Phase at the end of each turn, in the units of a phase, of shape (4, turns).
        moved: Phase at each of these ends minus the phase at the start, in the same units.
        derivative: Derivative of the last end with respect to the start; see `PeriodicMotion`.
        times: Time at the end of each turn, s.
        reversals: Values of the motion at each reversal of the slider, in rows; may be empty.
    """

    ends: Array
    moved: Array
    derivative: Array
    times: Array
    reversals: Array

    @property
    def period(self) -> int:
        """Number of turns after which the phase is the same for the first time."""
        is_same = np.abs(self.moved).max(axis=0) < SAME
        return int(np.argmax(is_same)) + 1

    def newton_step(self, fixed: Array) -> Array:
        """Computes the change of the start that closes the motion, none along `fixed`."""
        matrix = np.vstack((self.derivative - np.eye(3, 4), fixed))
        gap = np.append(self.moved[:3, -1], 0.0)
        return -np.linalg.solve(matrix, gap)


def _has_converged(size: float, before: float, tolerance: float) -> bool:
    """Returns whether a Newton step is small enough, given its size and that of the step before.

    With loads that jump, steps stop shrinking early, at the noise of the integration.
    """
    return size < _LAST * tolerance or before / 2 < size < _NOISE * tolerance


@dataclass(frozen=True, eq=False)
class PeriodicMotion:
    """A motion that repeats after one or more turns.

    Attributes:
        shooting: The map of the pump.
        sections: Phase at the start of each turn, of shape (4, turns).
        derivative: Derivative of slider position, crank speed and slider velocity after a period
            with respect to the phase before it, in the units of a phase; of shape (3, 4).
        times: Time at the end of each turn, s.
        turning_points: Positions at which the slider reverses, in order, m.
    """

    shooting: Shooting
    sections: Array
    derivative: Array
    times: Array
    turning_points: Array

    @property
    def turns(self) -> int:
        """Number of turns after which the motion repeats."""
        return len(self.times)

    @property
    def phase(self) -> Array:
        """Phase at crank angle 0."""
        return self.sections[:, 0]

    @property
    def torque(self) -> float:
        """Torque of the motor at rest, N m."""
        return float(self.sections[3, 0])

    @property
    def speed(self) -> float:
        """Mean crank speed over time, rad/s."""
        return float(TURN * self.turns / self.times[-1])

    @property
    def speeds(self) -> list[float]:
        """Mean crank speed over time in each turn, rad/s."""
        return (TURN / np.diff(self.times, prepend=0.0)).tolist()

    @property
    def load(self) -> float:
        """Mean torque on the crank over time, N m."""
        return self.torque - self.shooting.motor.damping * self.speed

    @property
    def stroke(self) -> float:
        """Distance between the ends of the slider's motion, m."""
        return float(np.ptp(self.turning_points))

    @property
    def flow(self) -> float:
        """Forward travel of the slider per turn, times the speed, m/s (proportional to flow)."""
        points = self.turning_points
        forth = np.abs(points - np.roll(points, 1)).sum() / 2
        return float(forth / self.turns * self.speed)

    @functools.cached_property
    def multipliers(self) -> tuple[complex, ...]:
        """Floquet multipliers, the largest first: factors of small deviations over a period."""
        values = np.linalg.eigvals(self.derivative[:, :3])
        return tuple(values[np.lexsort((-values.imag, -np.abs(values)))].tolist())

    @property
    def stable(self) -> bool:
        """Whether small deviations decay."""
        return abs(self.multipliers[0]) < 1

    @functools.cached_property
    def _orbit(self) -> Any:
        return self.shooting.shoot(self.phase[:, None], self.turns, dense=True).sol

    def at(self, angles: Array) -> Array:
        """Evaluates slider position, crank speed and slider velocity at crank angles, rad."""
        return self._orbit(angles)[:3]

    def states(self, angles: Array) -> State:
        """Computes the motion of all links at crank angles within the period, rad."""
        solver, (x, w, v) = self.shooting.solver, self.at(angles)
        q, u = (angles, x), (w, v)
        torque = self.torque - self.shooting.motor.damping * w
        return solver.state(q, u, solver.accelerations(q, u, torque))

    def distance(self, phases: Array) -> Array:
        """Computes the distances of phases at crank angle 0 from this motion, in their units.

        Args:
            phases: Slider positions, crank speeds and slider velocities, of shape (3, n).
        """
        units = self.shooting.units[:3, None, None]
        away = (phases[:, :, None] - self.sections[:3, None]) / units  # shape (3, n, turns)
        return np.abs(away).max(axis=0).min(axis=1)  # to the nearest section

    def is_same(self, other: 'PeriodicMotion') -> bool:
        """Returns whether another motion at the same torque is the same."""
        return self.turns == other.turns and bool(self.distance(other.sections[:3]).max() < SAME)

    @property
    def name(self) -> str:
        """Mean speed as text; also the number of turns if above 1, and 'unstable' if it is."""
        turns = f', {self.turns} turns' if self.turns > 1 else ''
        return f'{self.speed:.4g} rad/s{turns}{"" if self.stable else ", unstable"}'

    @property
    def numbers(self) -> dict[str, Any]:
        """Main numbers of the motion, for JSON, in SI units."""
        return {
            'torque': self.torque,
            'load': self.load,
            'speed': self.speed,
            'stroke': self.stroke,
            'flow': self.flow,
            'multipliers': [[value.real, value.imag] for value in self.multipliers],
        }

    def record(self) -> dict[str, Any]:
        """Returns the motion as a JSON record, in SI units; period in turns."""
        x, w, v, _ = self.phase.tolist()
        return {
            **self.numbers,
            'stable': self.stable,
            'period': self.turns,
            'speeds': self.speeds,
            'slider_lowest': float(self.turning_points.min()),
            'slider_highest': float(self.turning_points.max()),
            'at_crank_angle_0': {'slider_position': x, 'crank_speed': w, 'slider_velocity': v},
        }
