# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Measures the speed error caused by a delayed torque.

The driving torque of the quadrilateral at a constant 150 rpm is computed for one moment of each
tick, held over the tick, and applied to the simulated plant. A torque computed for the middle of
the tick causes almost no error; each tick of delay adds an error of 2.5 % of the speed.

    python benchmarks/delay.py            prints the table
    python benchmarks/delay.py --out docs also writes docs/delay.png and docs/delay.json
"""

import argparse
import json
import math
from pathlib import Path

from linkage_ros.cli import progress_bar
from linkage_ros.mechanism.solver import Solver
from linkage_ros.motion.drives.base import Machine
from linkage_ros.palette import FIRST, fractions
from linkage_ros.settings.configuration import configure
from linkage_ros.units import NS_PER_S, radians_per_second

RATE, RPM, TURNS = 1000.0, 150.0, 10
DELAYS = tuple(quarter / 4 for quarter in range(17))  # ticks


def wander(delay: float) -> float:
    """Computes the largest relative deviation of the crank speed over ten turns.

    Args:
        delay: Time from the moment for which the torque is computed to the middle of the tick,
            ticks.

    Returns:
        The deviation, relative to the speed.
    """
    configuration = configure({'drive': 'torque', 'start_rpm': RPM})
    solver, speed = Solver(configuration.mechanism), radians_per_second(RPM)
    period = round(NS_PER_S / RATE)
    motion, worst = configuration.drive.begin(0, Machine(solver, period)), 0.0
    for tick in range(round(TURNS * 60 / RPM * RATE)):
        crank = speed * (tick + 0.5 - delay) / RATE
        torque = solver.state(math.remainder(crank, 4 * math.pi), speed).torque
        motion.command(tick * period, torque)
        worst = max(worst, abs(motion.at((tick + 1) * period).u[0] / speed - 1))
    return worst


def draw(records: list[dict[str, float]], path: Path) -> None:
    """Draws the deviation against the delay, with the typical delays of controllers."""
    from linkage_lab.output import chart

    percent = {record['delay_ticks']: 100 * record['largest_deviation'] for record in records}
    cases = {0.0: 'of mid-tick', 0.5: "of the tick's start", 1.5: 'one tick late'}
    title = f'Torque of a constant {RPM:g} rpm, held over each tick, {TURNS} turns'
    with chart([path], 5.0, title) as figure:
        axes = figure.subplots()
        axes.plot(percent.keys(), percent.values(), marker='o', color=fractions(FIRST))
        for delay, words in cases.items():
            value = percent[delay]
            axes.annotate(
                f'{words}: {value:.2g} %', (delay, value), (8, -12), textcoords='offset points'
            )
        axes.set_xlabel('delay of the torque from mid-tick, ticks of 1 ms')
        axes.set_ylabel('largest deviation of the crank speed, %')
        axes.spines[['top', 'right']].set_visible(False)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--out', type=Path, metavar='DIR', help='where to write picture and JSON')
    options = parser.parse_args()
    records = [
        {'delay_ticks': delay, 'largest_deviation': wander(delay)}
        for delay in progress_bar(DELAYS, desc='delays', unit=' runs')
    ]
    for record in records:
        print(f'{record["delay_ticks"]:5.2f} ticks  {100 * record["largest_deviation"]:8.4f} %')
    if options.out:
        options.out.mkdir(parents=True, exist_ok=True)
        (options.out / 'delay.json').write_text(json.dumps(records, indent=1) + '\n')
        draw(records, options.out / 'delay.png')


if __name__ == '__main__':
    main()
