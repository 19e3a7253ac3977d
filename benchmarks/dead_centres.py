# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Compares random motions through dead centres and stretched dyads with absolute coordinates.

Pumps move for 10 s from a crank speed of 3 rad/s; four-bars and slider-cranks whose cranks cannot
turn fully move for 5 s under gravity. None has a motor. The reference integrates the coordinates
of every body. A motion counts as chaotic from the time at which two references whose starts differ
by 1e-12 rad differ by more than 1e-9 rad; from then on, only its energy is checked.
"""

import argparse
import random
import time
from contextlib import suppress
from dataclasses import replace

import numpy as np

from linkage_lab.methods.integrators import Multipliers
from linkage_lab.reference.motions import InitialValueProblem
from linkage_ros import Body, Coupler, FourBar, Frame, Guide, Piston, Slider, SliderCrank, WindPump
from linkage_ros.errors import LinkageError
from linkage_ros.mechanism.solver import Solver
from linkage_ros.motion.steps import live_steps, record_steps
from linkage_ros.motion.under_torque import published

_LOOK = 0.05  # s between compared states
_CHAOTIC = 1e-9  # rad between motions whose starts differ by 1e-12 rad
_GRAVITY = (0.0, -9.81)


def _body(chance, length, kind=Body):
    mass = chance.uniform(0.3, 2.0)
    center = chance.uniform(0.2, 0.8) * length, chance.uniform(-0.2, 0.2) * length
    return kind(length, mass, mass * length**2 * chance.uniform(0.05, 0.2), center)


def pump(chance):
    """Makes a random pump, and initial coordinates and rates with a bent dyad."""
    r, b, c = (x * chance.uniform(0.5, 2.0) for x in (0.5 * chance.uniform(0.5, 3.0), 1.5, 2.0))
    coupler = _body(chance, b, Coupler)
    while True:
        place, angle = chance.uniform(-(b + c), r + b + c), chance.uniform(0.0, 6.28)
        parts = _body(chance, r), coupler, _body(chance, c), Piston(place, mass=1.5)
        mechanism = WindPump(*parts, chance.choice(('open', 'crossed')), _GRAVITY)
        start = angle, place, 3.0, 0.0
        with suppress(LinkageError):  # out of reach
            if Solver(mechanism).dyad_sines(start)[0].sine > 0.2:
                return mechanism, start


def limited(chance):
    """Makes a random linkage whose crank cannot turn fully, and initial coordinates at rest."""
    while True:
        r, b, c, d = (chance.uniform(0.2, 1.0) for _ in range(4))
        last, coupler = (chance.choice(('open', 'crossed')), _GRAVITY), _body(chance, b, Coupler)
        with suppress(LinkageError):  # the loop cannot close
            if chance.random() < 0.5:
                parts = Frame(d, chance.uniform(-3.0, 3.0)), _body(chance, r), coupler
                mechanism = FourBar(*parts, _body(chance, c), *last)
            else:
                ends = Slider(chance.uniform(-0.5, 0.5), 1.0), Guide(chance.uniform(-3, 3))
                mechanism = SliderCrank(_body(chance, r), coupler, *ends, *last)
            if not (reach := mechanism.reach()).turns_fully:
                low, high = chance.choice(reach.arcs)
                return mechanism, (chance.uniform(low + 1e-3, high - 1e-3), 0.0)


def run(problem, seconds, begin):
    """Integrates a motion.

    Returns:
        Crank angles every 0.05 s, rad; the change of energy divided by the largest kinetic
        energy; and the error that ended the motion, or an empty string.
    """
    steps, angles, totals, kinetic = begin(problem.driven, problem.start), [], [], 0.0
    for tick in range(1, round(seconds / _LOOK) + 1):
        try:
            steps.advance(tick * _LOOK)
        except LinkageError as error:
            return angles, np.ptp(totals or [0.0]) / max(kinetic, 1e-300), str(error)
        half, solver = len(steps.phase) // 2, steps.driven.solver
        moving, still = solver.energy(solver.state(steps.phase[:half], steps.phase[half:]))
        angles.append(published(steps.driven, steps.phase, steps.pairs).unwrapped)
        totals.append(moving + still)
        kinetic = max(kinetic, moving)
    return angles, np.ptp(totals) / kinetic, ''


def compare(problem, angles):
    """Returns the largest difference from the reference while the motion is not chaotic, rad."""
    near = replace(problem, start=(problem.start[0] + 1e-12, *problem.start[1:]))
    followers = Multipliers(problem, 1e-13), Multipliers(near, 1e-13)
    worst = 0.0
    with suppress(LinkageError, ArithmeticError, np.linalg.LinAlgError):
        for tick, angle in enumerate(angles, 1):
            one, other = (follower.at(tick * _LOOK)[0] for follower in followers)
            if abs(one - other) > _CHAOTIC:
                break
            worst = max(worst, abs(angle - one))
    return worst


def main():
    """Prints a line for each kind of mechanism."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--pumps', type=int, default=119)
    parser.add_argument('--limited', type=int, default=200)
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--live', action='store_true', help='use the integrator of live runs')
    options = parser.parse_args()
    begin = live_steps if options.live else record_steps
    kinds = (('pumps', pump, options.pumps, 10.0), ('limited', limited, options.limited, 5.0))
    for name, make, count, seconds in kinds:
        chance, begun = random.Random(options.seed), time.process_time()
        problems = [InitialValueProblem(*make(chance)) for _ in range(count)]
        runs = [run(problem, seconds, begin) for problem in problems]
        spent = (time.process_time() - begun) / count
        _, energies, ends = zip(*runs, strict=True)
        apart = [compare(problem, each[0]) for problem, each in zip(problems, runs, strict=True)]
        print(
            f'{name}: {sum(map(bool, ends))} of {count} end; energy off by {max(energies):.2g} of '
            f'the largest kinetic one, {sum(e > 1e-8 for e in energies)} by more than 1e-8; crank '
            f'off by {max(apart):.2g} rad, {sum(a > 1e-7 for a in apart)} by more than 1e-7; '
            f'{spent:.2g} s of processor time each'
        )
        print(*(f'{number}: {end}\n' for number, end in enumerate(ends) if end), sep='', end='')


if __name__ == '__main__':
    main()
