# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Cases for integrators: motions under a torque, some of them random and hard to integrate."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from decimal import Decimal
from functools import cached_property, lru_cache, partial
from typing import Any

import numpy as np

from linkage_lab.methods.measure import (
    DIVERGED,
    Case,
    Method,
    Panels,
    Row,
    Setting,
    Situation,
    attempt,
    elapsed,
)
from linkage_lab.methods.situations import Random, four_bar, limited
from linkage_lab.reference.motions import (
    InitialValueProblem,
    MotionReference,
    Phase,
    coasting,
    driven_pump,
    free_pump,
    halves,
)
from linkage_ros import Body, Coupler, FourBar, LinkLoad, Solver, State
from linkage_ros.internals import Motor

TRAJECTORY, ENERGY, LOOP = 'trajectory', 'energy', 'loop'  # compared quantities
# Modes: mean time per simulated ms, and time of the slowest ms, which limits a live node.
MEAN, SLOWEST = 'motion', 'motion, slowest ms'
_TICK = 1e-3  # s
_SEED = 20_261_122


class MotionCase(Case):
    """A motion whose states are compared with a reference at given times.

    Attributes:
        problem: Equations and initial values of the motion.
        times: Times at which states are compared, in order, s.
        quantities: Compared quantities: TRAJECTORY, ENERGY or LOOP.
        rounds: Number of timings.
    """

    rounds = 3

    def __init__(
        self,
        problem: InitialValueProblem,
        times: Iterable[float],
        quantities: Sequence[str] = (TRAJECTORY,),
        at: Callable[[float], Sequence[Any]] | None = None,
    ) -> None:
        """Prepares the case; `at` returns the true phase at a time, by default in 34 digits."""
        self.problem, self.times, self.quantities = problem, tuple(times), quantities
        self._at = at or MotionReference(problem).at

    @cached_property
    def _exact(self) -> Any:
        """Reference phases, in Decimals."""
        return np.array([[*map(Decimal, self._at(time))] for time in self.times])

    @cached_property
    def _sizes(self) -> list[float]:
        """Units of the coordinates, and the largest magnitude of each rate."""
        count = len(self.problem.start) // 2
        return [*self.problem.driven.units[:count], *abs(self._exact[:, count:]).max(axis=0)]

    def panels(self, _: Method, setting: Setting) -> Panels:
        """See `Case`; SLOWEST needs steps of at most 1 ms."""
        found = [(quantity, MEAN) for quantity in self.quantities]
        if TRAJECTORY in self.quantities and setting.get('step', 0) <= _TICK:
            found.append((TRAJECTORY, SLOWEST))
        return found

    def rows(self, method: Method, setting: Setting, *_: str) -> Sequence[Row]:
        """See `Case`; a row is a phase and the loop gap, m. A failed row is the last one."""
        return integrate(self.problem, self.times, method.solve, tuple(setting.items()))

    def error(self, quantity: str, place: int, row: Sequence[float]) -> float:
        """Computes the error of a row; see `Case`.

        For TRAJECTORY, the largest error: of angles in rad, of lengths in crank lengths, and of
        rates relative to the largest rate. For ENERGY, the change of energy without motor and
        damping, relative to the initial kinetic energy. For LOOP, the loop gap in crank lengths.
        """
        *phase, gap = row
        if quantity == LOOP:
            return float(gap / self.problem.mechanism.crank.length)
        if quantity == ENERGY:
            kinetic, potential = self.problem.energy(self.problem.start)
            change = sum(self.problem.energy(tuple(phase))) - (kinetic + potential)
            return abs(change) / kinetic
        errors = abs(np.array([*map(Decimal, phase)]) - self._exact[place])
        return float(max(errors.astype(float) / np.array(self._sizes, float)))

    def outcomes(self, method: Method, setting: Setting, *panel: str) -> list[tuple[str, float]]:
        """See `Case`; if any row is wrong, only the wrong rows are returned."""
        found = super().outcomes(method, setting, *panel)
        return [each for each in found if each[0] == DIVERGED] or found

    def timer(self, method: Method, setting: Setting, _: str, mode: str) -> Callable[[], float]:
        """Returns a function that measures the mean or largest time, us, per simulated ms."""
        start, times = partial(method.solve, self.problem, setting), self.times
        if mode == SLOWEST:
            return lambda: _slowest_time(times[-1], start)
        return lambda: elapsed(start().at, times) / times[-1] * 1e3


# Cached, because situations share motions, and panels of a chart share runs.
@lru_cache(maxsize=32)
def integrate(
    problem: InitialValueProblem,
    times: tuple[float, ...],
    solve: Callable[..., Any],
    setting: tuple[tuple[str, float], ...],
) -> list[Row]:
    """Integrates a motion; see `MotionCase.rows`."""
    rows: list[Row] = []

    def append_rows() -> Sequence[float]:
        integrator = solve(problem, dict(setting))
        for time in times:
            phase = integrator.at(time)
            if not all(map(math.isfinite, phase)):
                raise ArithmeticError('the motion overflows')
            rows.append(with_gap(problem, phase))
        return ()

    result = attempt(append_rows)
    if len(rows) < len(times):  # an error ended the motion, and the result is that of an error
        rows.append(result)
    return rows


def with_gap(problem: InitialValueProblem, phase: Phase) -> Phase:
    """Returns coordinates, rates and the loop gap, m, given a phase of coordinates or all links.

    Unreachable coordinates raise the same error as in a run.
    """
    solver, has_all_links = problem.driven.solver, len(phase) > len(problem.start)
    position, rates = halves(phase)
    state = State(position, rates, (), 0.0) if has_all_links else solver.state(position, rates)
    indices = [solver.links.index(name) for name in solver.coordinates]
    coordinates = [state.position[i] for i in indices]
    velocities = [state.velocity[i] for i in indices]
    return *coordinates, *velocities, solver.structure.loop_residual(state)


def _slowest_time(seconds: float, start: Callable[[], Any]) -> float:
    """Measures the time, us, of the slowest simulated ms; the best of three runs for each ms.

    Args:
        seconds: Duration of the motion, of which three tenths, at most 1 s, are timed.
        start: Function that starts an integrator.
    """
    ticks = [(i + 1) * _TICK for i in range(min(1000, round(seconds * 300)))]
    integrators = [start() for _ in range(3)]
    runs = [[elapsed(one.at, [tick]) for tick in ticks] for one in integrators]
    return float(np.min(runs, axis=0).max() * 1e6)


def even(seconds: float) -> list[float]:
    """Returns times 0.05 s apart, up to `seconds`, s, at which states are compared."""
    return [(i + 1) * 0.05 for i in range(round(seconds / 0.05))]


def motions(*, quick: bool) -> list[tuple[str, MotionCase]]:
    """Returns the motions of the accuracy chart, each with its mechanism's name.

    They are the wind pump, with and without motor and load, and a coasting four-bar.
    """
    seconds = 0.1 if quick else 10.0
    return [
        ('wind_pump', MotionCase(driven_pump(6.0), even(seconds))),
        ('wind_pump', MotionCase(free_pump(6.0), even(seconds), (ENERGY,))),
        ('quadrilateral', MotionCase(coasting(), even(seconds * 0.4), (TRAJECTORY, ENERGY))),
    ]


# ---------------------------------------------------------------- situations


def _driven(random: Random, i: int) -> MotionCase:
    """Makes the wind pump with its motor, at two given and then at random speeds."""
    speed = (2.0, 6.0)[i] if i < 2 else float(random.uniform(1.0, 7.0))
    return MotionCase(driven_pump(speed), even(5.0))


def _parallelogram(random: Random) -> FourBar:
    """Makes a random parallelogram without gravity; its inertia at the crank is constant."""
    x, y = (float(k) / 64 for k in random.integers((8, 33), (32, 64)))
    return replace(four_bar((x, y, x, y)), gravity=(0.0, 0.0))


def _change_point(random: Random, _: int) -> MotionCase:
    """Makes a parallelogram under a constant torque; its acceleration is constant."""
    mechanism = _parallelogram(random)
    angle, speed, torque = random.uniform((-2, 1, 0.1), (-1, 3, 0.2)).tolist()
    problem = InitialValueProblem(mechanism, (angle, speed), Motor(torque))
    acceleration = torque / problem.driven.solver.matrix(1.0)[0][0]

    def exact(t: float) -> Phase:
        return angle + (speed + acceleration / 2 * t) * t, speed + acceleration * t

    return MotionCase(problem, even(4.0), at=exact)


def _steep_line(random: Random, i: int) -> MotionCase:
    """Makes a parallelogram at rest with a motor whose torque falls steeply with the speed."""
    damping = (1e3, 1e7)[i] if i < 2 else 10.0 ** float(random.uniform(3, 9))
    mechanism, speed = _parallelogram(random), float(random.uniform(5, 20))
    problem = InitialValueProblem(mechanism, (0.0, 0.0), Motor(damping * speed, damping))
    rate = damping / problem.driven.solver.matrix(1.0)[0][0]
    return MotionCase(problem, even(1.0), at=lambda t: _settling(0.0, speed, rate, t))


def _stiff_guide(random: Random, i: int) -> MotionCase:
    """Makes a pump whose slider, damped strongly, moves independently of the crank."""
    pump = free_pump(1.0).mechanism
    damping = (1e5, 1e9)[i] if i < 2 else 10.0 ** float(random.uniform(5, 11))
    final_velocity, speed = random.uniform((-0.1, 1), (0.1, 3)).tolist()
    # Massless coupler and rod do not couple crank and slider.
    pump = replace(
        pump, gravity=(0.0, 0.0), crank=Body(0.12, inertia=20.0),
        coupler=Coupler(0.8), rod=Body(1.6),
        loads=(LinkLoad('slider', damping * final_velocity, damping),),
    )  # fmt: skip

    def exact(t: float) -> Phase:
        moved, velocity = _settling(1.0, final_velocity, damping / pump.slider.mass, t)
        return speed * t, pump.slider.position + moved, speed, velocity

    start = 0.0, pump.slider.position, speed, 1.0
    return MotionCase(InitialValueProblem(pump, start), even(1.0), at=exact)


def _settling(first: float, final: float, rate: float, time: float) -> tuple[float, float]:
    """Computes distance and speed of a damped body that approaches its final speed.

    Args:
        first: Speed at the start.
        final: Speed that it approaches.
        rate: Damping per mass, 1/s.
        time: Time since the start, s.
    """
    settled = -math.expm1(-rate * time)
    return final * time + (first - final) * settled / rate, first + (final - first) * settled


def _stretched(random: Random, i: int) -> MotionCase:
    """Makes a motion in which a dyad comes into line; every fourth is that of a limited crank."""
    while True:  # some random motions stretch no dyad
        problem = _limited_crank(random) if i % 4 == 3 else _accelerated_pump(random, i)
        exact, stretched = _stretch(problem)
        if stretched is not None:
            times = stretched * np.linspace(0.0, 1.5, 14)[1:]
            return MotionCase(problem, times.tolist(), at=exact)


def _limited_crank(random: Random) -> InitialValueProblem:
    """Starts a random linkage with a limited crank in the middle of its arc."""
    mechanism = limited(random)
    start, end = Solver(mechanism).reach.arcs[0]
    speed = float(random.uniform(3, 6)) * (end - start)
    return InitialValueProblem(mechanism, ((start + end) / 2, speed))


def _accelerated_pump(random: Random, i: int) -> InitialValueProblem:
    """Starts the wind pump with a slider velocity: three given ones, then random ones."""
    velocity = float(random.uniform(4.6, 8.0)) * (1 if random.random() < 0.5 else -1)
    return driven_pump(2.0, (5.0, 6.0, -7.0)[i] if i < 3 else velocity)


@lru_cache(maxsize=8)
def _stretch(problem: InitialValueProblem) -> tuple[Callable[[float], Any], float | None]:
    """Returns the reference of a motion, and the time at which a dyad comes into line, s."""
    reference = MotionReference(problem)
    return reference.at, reference.end(0.5)


def _long(_: Random, i: int, *, quantity: str) -> MotionCase:
    problem, seconds = ((coasting(), 30.0), (free_pump(9.0), 60.0))[i]
    return MotionCase(problem, even(seconds), (quantity,))


MOTION_SITUATIONS = (
    Situation(
        'driven pump', 'the wind pump with its motor, starting at 2, 6 and other rad/s', _driven,
        share=10, fewest=2, seed=(_SEED, '_driven'),
    ),
    Situation(
        'change point under a torque',
        'a torque drives a parallelogram through both, several times', _change_point,
        share=5, fewest=2, seed=(_SEED, '_change_point'),
    ),
    Situation(
        'steep motor line',
        'a parallelogram starts at rest; motor damping 1e3 to 1e9 N m s', _steep_line,
        share=5, fewest=2, seed=(_SEED, '_steep_line'),
    ),
    Situation(
        'stiff guide',
        "a force on a pump's moving slider; damping 1e5 to 1e11 N s/m", _stiff_guide,
        share=5, fewest=2, seed=(_SEED, '_stiff_guide'),
    ),
    Situation(
        'stretched dyad',
        'coupler and third link come into line in motion, which continues', _stretched,
        share=3, fewest=4, seed=(_SEED, '_stretched'),
    ),
    Situation(
        'long free run',
        'energy of quadrilateral (30 s) and pump (60 s) without motors',
        partial(_long, quantity=ENERGY), share=15,
    ),
    Situation(
        'loop after a long run', 'gap of the loop in the same motions',
        partial(_long, quantity=LOOP), share=15,
    ),
)  # fmt: skip
