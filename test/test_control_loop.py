# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The plant under controllers whose commands arrive late, with jitter, and sometimes not at all.

Many cranks turn at once, each with its own random start and delays. The state that a controller
answers is 1 to 4 ticks old when its command acts, and 2 % of the ticks are missed, up to three in
a row. Until a controller is active, the plant turns freely.
"""

import math
from typing import NamedTuple

import numpy as np
from test_crank_trajectory import (
    HALF,
    PERIOD,
    Controller,
    launched_by_the_example,
    machine,
    parameters_of_the_example,
    trajectory,
)
from test_docs_figures import agrees, check_numbers

from linkage_ros import Solver
from linkage_ros.motion.runge_kutta import Plant, leap, slope_at
from linkage_ros.settings.configuration import load
from linkage_ros.units import NS_PER_S

RUNS = 200
# Ticks: until every controller is active, until the speed must be kept, and of a turn.
START, SETTLED, TURN = 300, 2000, 400
SPEED = 5 * math.pi
SOLVER = Solver(load('quadrilateral').mechanism)


class Delays(NamedTuple):
    """Times of the commands that act from a tick on, shape (ticks, runs); they never decrease.

    Attributes:
        measured: Tick of the state that the command answers; negative for no command.
        computed: Tick at which the controller computed the command.
    """

    measured: np.ndarray
    computed: np.ndarray


def delays(factor=1, count=RUNS):
    """Returns the random delays of some runs, multiplied by a factor."""
    rng, runs, shape = np.random.default_rng(1), np.arange(count), (START + SETTLED + TURN, count)
    ticks = np.arange(shape[0])[:, None]
    # The delay changes every 200 ticks on average; in between, every tenth differs by a tick.
    renewed = np.where(rng.random(shape) < 1 / 200, ticks, 0)
    usual = rng.integers(1, 5, shape)[np.maximum.accumulate(renewed), runs]
    jitter = rng.choice([-1, 0, 1], shape, p=[0.05, 0.9, 0.05])
    age = factor * np.clip(usual + jitter, 1, 4)
    missed = np.zeros(shape, bool)
    for tick, run in np.argwhere(rng.random(shape) < 1 / 100):
        missed[tick : tick + factor * rng.integers(1, 4), run] = True
    kept = np.maximum.accumulate(np.where(missed, 0, ticks))
    measured, computed = ticks - age, ticks - age + age // 2
    measured = np.where(measured < 0, measured, kept[measured, runs])
    return Delays(*(np.maximum.accumulate(x)[kept, runs] for x in (measured, computed)))


def speed_errors(law, delays, limit, angle, speed):
    """Returns the largest relative speed error of each run, in a turn after 2 s of control.

    Args:
        law: Computes commands from `measured` and `computed` of a tick, angles and speeds.
        delays: The delays.
        limit: The plant's torque_limit, N m.
        angle: Crank angles at the start, rad.
        speed: Crank speeds at the start, rad/s.
    """
    q, u, torque = angle, speed, np.zeros(len(angle))
    # A controller that is active before the first state reads the end, which is not yet written.
    seen = np.zeros((2, *delays.measured.shape))

    def accelerations(q, u):
        return SOLVER.accelerations((q,), (u,), torque)

    plant, runs = Plant((1.0, 1.0), accelerations), np.arange(len(angle))
    for tick, (measured, computed) in enumerate(zip(*delays, strict=True)):
        seen[:, tick] = q, u
        command = law(measured, computed, *seen[:, measured, runs])
        # The node rejects NaN, and keeps the last command.
        torque = np.where(np.isnan(command), torque, np.clip(command, -limit, limit))
        slope = slope_at(accelerations, (q, u))
        (q, u), _, _ = leap(plant, (q, u), PERIOD / NS_PER_S, slope)
    return abs(seen[1, START + SETTLED :] / SPEED - 1).max(axis=0)


def followed_trajectories(gains, delays, rng):
    """Returns a control law for `speed_errors`: that of joint_trajectory_controller.

    A tenth of the controllers are active before the plant's first state. A controller holds the
    crank until it receives a trajectory.
    """
    one, count = machine(), delays.measured.shape[1]
    ahead, motion, reference = trajectory(one), one.begin(PERIOD), []
    follower = Controller({**parameters_of_the_example(), 'gains': {'crank': gains}})
    for stamp in range(PERIOD, PERIOD * (len(delays.measured) + 1), PERIOD):
        if data := ahead.message_at(motion, stamp):
            follower.receive(data, stamp)
        reference.append(follower.reference(stamp))
    reference = np.transpose(reference)
    first, active = rng.integers(0, START // 5, count), rng.integers(0, START, count)
    followed = -(-active // (HALF // PERIOD)) * (HALF // PERIOD)
    held = np.full(count, math.nan)

    def law(measured, computed, angle, speed):
        nonlocal held
        angle = np.where(measured < first, math.nan, angle)
        held = np.where(computed <= active, angle, held)
        wanted = np.where(
            computed < followed, [held, 0.0 * held, 0.0 * held], reference[:, computed]
        )
        return np.where(computed < active, math.nan, follower.effort(wanted, angle, speed))

    return law


def test_example_of_the_page_keeps_its_speed_in_a_loop_with_delays():
    """The example's gains, also with delays three times as long; then gains that are too high."""
    gains = [parameters_of_the_example()['gains']['crank']] * 2 + [{'p': 150.0, 'd': 5.0}]
    gains = {name: np.repeat([one[name] for one in gains], RUNS) for name in ('p', 'd')}
    groups, rng = [delays(), delays(3), delays()], np.random.default_rng(2)
    all_delays = Delays(*(np.hstack(columns) for columns in zip(*groups, strict=True)))
    (plant,) = launched_by_the_example().nodes[0]['parameters']
    law = followed_trajectories(gains, all_delays, rng)
    angle = rng.uniform(0.0, 2 * math.pi, 3 * RUNS)
    errors = speed_errors(law, all_delays, plant['torque_limit'], angle, 0.0 * angle)
    usual, late, steep = 100 * errors.reshape(3, RUNS).max(axis=1)
    check_numbers('docs/controllers.md', [usual])
    assert agrees('14', late)
    assert usual < 5.0 < steep
