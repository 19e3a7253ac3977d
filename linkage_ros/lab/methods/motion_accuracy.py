# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Speed against accuracy of integrators, on motions under a torque.

A point's time, `us_per_state`, is that of one simulated ms, at which the live default makes one
state: 1000 us would be real time. What a motion loses is its largest error at all of
its times; a state is asked for every 50 ms, and read by the method's own means if its steps are
longer.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from linkage_ros.errors import LinkageError
from linkage_ros.lab.methods.accuracy import Measurement, mark_fronts
from linkage_ros.lab.methods.bench import FAILURES
from linkage_ros.lab.methods.integrators import Follower
from linkage_ros.lab.methods.motion_bench import ENERGY, TRAJECTORY, MotionBench, even
from linkage_ros.lab.methods.problems import ChartMechanisms, Phase
from linkage_ros.lab.methods.registry import INTEGRATORS, Integrator, Setting, label

# Of a whole motion; and what a live node has to be ready for, the slowest of its ticks.
MEAN, SLOWEST = 'motion', 'motion, slowest ms'
_TICK = 1e-3  # s
_CHEAP = 0.2  # s: a motion that takes less is timed again


@dataclass
class _Job:
    """A method with a setting on a bench, timed again and again."""

    method: Integrator
    setting: Setting
    bench: MotionBench
    phases: list[Phase]
    seconds: float = math.inf

    def follow(self) -> None:
        """The whole motion; it has no phases where the method fails."""
        try:
            follower = self.method.make(self.bench.problem, self.setting)
            start = time.perf_counter()
            self.phases = [follower.at(moment) for moment in self.bench.times]
            self.seconds = min(self.seconds, time.perf_counter() - start)
        except (LinkageError, *FAILURES):
            self.phases, self.seconds = [], math.nan

    def point(self, mechanism: str, quantity: str, errors: Iterable[float]) -> Measurement:
        """Its point in the chart; where the method fails there are no errors."""
        per_ms = self.seconds / (self.bench.times[-1] * 1e3) * 1e6
        worst = max(errors, default=math.inf)
        name = self.method.name
        return Measurement(name, label(self.setting), mechanism, quantity, MEAN, per_ms, worst)


class ChartBenches(NamedTuple):
    """What one row of the chart needs.

    Attributes:
        trajectory: A motion whose trajectory is compared.
        energy: One whose energy stays.
    """

    trajectory: MotionBench
    energy: MotionBench


def chart_benches(mechanisms: ChartMechanisms, *, quick: bool) -> dict[str, ChartBenches]:
    """The motions of the chart.

    Args:
        mechanisms: What moves.
        quick: Whether a fifth of the time will do.

    Returns:
        Benches by name of the mechanism: the pump at its fast speed, with motor and water and
        without; the quadrilateral coasting from 150 rpm.
    """
    seconds = 2.0 if quick else 10.0
    coasting = MotionBench(mechanisms.coasting(5 * math.pi), even(seconds * 0.4))
    return {
        'wind_pump': ChartBenches(
            MotionBench(mechanisms.driven(6.0), even(seconds)),
            MotionBench(mechanisms.freed(6.0), even(seconds)),
        ),
        'quadrilateral': ChartBenches(coasting, coasting),
    }


def measure_motion_accuracy(
    mechanisms: ChartMechanisms,
    *,
    quick: bool,
    progress: Callable[[Iterable[Any], str], Any],
    methods: Sequence[Integrator] = INTEGRATORS,
) -> list[Measurement]:
    """Measures all points.

    Args:
        mechanisms: What moves.
        quick: Whether shorter motions and fewer rounds will do.
        progress: Wraps what is gone through, with a word for it: a progress bar.
        methods: To measure.

    Returns:
        The points, fronts marked.
    """
    points: list[Measurement] = []
    for name, (moved, free) in chart_benches(mechanisms, quick=quick).items():
        kinds = [(method, setting) for method in methods for setting in method.settings]
        jobs = {
            bench: [_Job(method, setting, bench, []) for method, setting in kinds]
            for bench in (moved, free)
        }
        every = [job for group in jobs.values() for job in group]
        for job in progress(every, f'motions, {name}'):
            job.follow()
        for _ in progress(range(1 if quick else 2), 'times'):
            for job in every:
                if job.seconds < _CHEAP:
                    job.follow()
        for job in jobs[moved]:
            errors = (moved.error(i, phase) for i, phase in enumerate(job.phases))
            points.append(job.point(name, TRAJECTORY, errors))
            if job.setting.get('step', 0) <= _TICK:
                points.append(_ticking(points[-1], job, quick=quick))
        points += [job.point(name, ENERGY, map(free.drift, job.phases)) for job in jobs[free]]
    mark_fronts(points)
    return points


def _ticking(point: Measurement, job: _Job, *, quick: bool) -> Measurement:
    """The same error, and the time of the slowest ms of the first s, asked for every ms."""
    ticks, rounds = 300 if quick else 1000, 3
    fastest = [math.inf] * ticks
    try:
        for _ in range(rounds):
            follower = job.method.make(job.bench.problem, job.setting)
            fastest = list(map(min, fastest, _ticks(follower, ticks)))
        slowest = max(fastest) * 1e6
    except (LinkageError, *FAILURES):
        slowest = math.nan
    return replace(point, mode=SLOWEST, us_per_state=slowest)


def _ticks(follower: Follower, count: int) -> list[float]:
    seconds = []
    for i in range(count):
        start = time.perf_counter()
        follower.at((i + 1) * _TICK)
        seconds.append(time.perf_counter() - start)
    return seconds
