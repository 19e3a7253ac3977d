# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Measures plants under commands.

The cases take turns. A plant at 1 kHz runs with linkage_controller, with the parameters of
controller.launch.py; alone; and with 1000 commands a second that are accepted (0.0) or rejected
(NaN).

    python benchmarks/reliability/inputs.py --out docs    docs/inputs.json, in four minutes

To compare with another version, run this command in the folder of its source tree, in turns: the
nodes are those of the working directory. The exit code is 1 if a promise is broken.
"""

import sys
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from statistics import median

import numpy as np
from harness import DOMAIN, Diagnostics, Process, finish, node, options, running, wait_for, words
from realtime import SETTLE

RATE = 1000.0  # Hz
COMMANDER = Path(__file__).with_name('commander.py')
# As in controller.launch.py.
PLANT = {'drive': 'torque', 'rate_hz': RATE, 'command_timeout': 0.02, 'torque_limit': 400.0}
RPM = 150.0
# Share of the ticks by which two cases may differ by chance.
SCATTER = 0.01


def shares(processes: dict[str, Process], seconds: float) -> dict[str, float]:
    """Measures the processor time of processes for some seconds, % of a core."""
    before = {name: one.computed() for name, one in processes.items()}
    time.sleep(seconds)
    return {
        name: 100 * (one.computed() - before[name]) / seconds for name, one in processes.items()
    }


def plant(seconds: float, health: Diagnostics, *source: object) -> dict[str, float]:
    """Measures a plant and the process that commands it, if any."""

    def counts() -> np.ndarray:
        _, _, values = health.parts['linkage_node: motion']
        return np.array([int(values[name]) for name in ('states', 'ticks missed')])

    with ExitStack() as stack:
        processes = {}
        if source:
            processes['source'] = stack.enter_context(running(*source, domain=DOMAIN))
            wait_for(lambda: len(processes['source'].by_thread()) > 1)
            time.sleep(SETTLE)
        health.parts.clear()
        processes['node'] = stack.enter_context(node(DOMAIN, start_rpm=RPM, **PLANT))
        wait_for(lambda: 'linkage_node: motion' in health.parts)
        time.sleep(SETTLE)
        before = counts()
        found = shares(processes, seconds)
        states, missed = map(int, counts() - before)
        for one in processes.values():
            one.end()
    return {
        'missed_percent': 100 * missed / (states + missed),
        'node_percent': found['node'],
        'source_percent': found.get('source', 0.0),
    }


def main() -> int:
    """Prints the cells of the table in docs/controllers.md."""
    given = options(__doc__, seconds=(15.0, 's for each case'), rounds=(3, 'rounds of all cases'))
    health, seconds = Diagnostics(DOMAIN), given.seconds
    controller = '-m', 'linkage_ros.programs.controller', *words({'rpm': RPM})
    cases: dict[str, Callable[[], dict[str, float]]] = {
        'controller': lambda: plant(seconds, health, *controller),
        'no commands': lambda: plant(seconds, health),
        'commands 0.0': lambda: plant(seconds, health, COMMANDER, RATE, 0.0),
        'commands NaN': lambda: plant(seconds, health, COMMANDER, RATE, 'nan'),
    }
    rounds: dict[str, list[dict[str, float]]] = {name: [] for name in cases}
    for number in range(given.rounds):
        for name in list(cases)[:: 1 - 2 * (number % 2)]:  # in reverse order every other time
            rounds[name].append(cases[name]())
            cells = ', '.join(f'{key} {value:.3g}' for key, value in rounds[name][-1].items())
            print(f'{name}: {cells}', flush=True)
    found = {
        name: {key: round(median(one[key] for one in all_), 3) for key in all_[0]}
        for name, all_ in rounds.items()
    }
    missed = [found[f'commands {effort}']['missed_percent'] for effort in ('NaN', '0.0')]
    kept = {'rejected commands cost no tick': missed[0] <= missed[1] + 100 * SCATTER}
    return finish('inputs', given.out, found, kept)


if __name__ == '__main__':
    sys.exit(main())
