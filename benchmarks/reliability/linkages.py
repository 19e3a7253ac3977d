# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Compares several linkages in one node with as many nodes of one linkage.

The cases take turns: 1, 4 and 12 linkages, in one node and in nodes of their own, that follow a
robot of 20 joints in another process, at 200 and 500 Hz. This process receives the answers. A
measurement is answered when the joints of all linkages have arrived; the others are lost.

    python benchmarks/reliability/linkages.py --out docs    docs/linkages.json, in ten minutes

The exit code is 1 if twelve linkages in one node take more than 2.5 times the processor time of
one for each measurement, by the median of the rounds.
"""

import os
import re
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from statistics import median
from typing import NamedTuple

import numpy as np
import rclpy
from harness import (
    DOMAIN,
    FOLLOWED,
    Process,
    environment,
    finish,
    node,
    options,
    running,
    wait_for,
)
from realtime import SETTLE

from linkage_ros.messages.cdr import decode_joint_state, stamp_of
from linkage_ros.messages.topics import JOINT_STATES
from linkage_ros.node.endpoints import PolledSubscription

ROBOT_NODE = Path(__file__).with_name('robot_node.py')
MOST, JOINTS = 12, 3  # linkages, and joints of each
NAMES = [f'l{number}' for number in range(MOST)]
LIMIT = 2.5  # twelve linkages in one node, relative to one linkage, in processor time
ANSWERS = 'linkage/joint_states'
PATIENCE = 120.0  # s, for twelve nodes to start


class Case(NamedTuple):
    """A number of linkages, all in one node or each in its own."""

    rate_hz: float
    linkages: int
    nodes: int


CASES = [
    Case(rate, number, nodes)
    for rate in (200.0, 500.0)
    for number in (1, 4, MOST)
    for nodes in dict.fromkeys((1, number))
]


class Answers:
    """Receives joint states, from one node or several.

    Attributes:
        received: For each message: stamp, ns, time of arrival, ns, and number of joints.
    """

    def __init__(self) -> None:
        os.environ.update(environment(DOMAIN))
        rclpy.init()
        topic = JOINT_STATES._replace(name=ANSWERS, depth=1000)
        self.received: list[tuple[int, int, int]] = []
        self._joints: dict[int, int] = {}  # by the size of a message
        self._subscription = PolledSubscription(
            rclpy.create_node('answers'), topic, self._read, lambda *_: None
        )

    def _read(self, data: bytes, arrival: int) -> None:
        if len(data) not in self._joints:
            self._joints[len(data)] = len(decode_joint_state(data).names)
        self.received.append((stamp_of(data), arrival, self._joints[len(data)]))

    def receive(self, seconds: float) -> None:
        """Receives for some seconds."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            for _ in self._subscription.receive():
                pass

    @property
    def last_stamp(self) -> int:
        """Stamp of the last message, ns; 0 if there is none."""
        return self.received[-1][0] if self.received else 0

    def complete(self, linkages: int) -> np.ndarray:
        """Returns stamp and arrival of each answer with the joints of all linkages, ns."""
        joints, last = Counter[int](), dict[int, int]()
        for stamp, arrival, number in self.received:
            joints[stamp] += number
            last[stamp] = arrival
        rows = [(x, last[x]) for x in last if joints[x] == JOINTS * linkages]
        return np.array(rows, dtype=np.int64).reshape(-1, 2)


@contextmanager
def moving(case: Case) -> Iterator[list[Process]]:
    """Runs the nodes of a case; they publish on the same topic."""
    names = NAMES[: case.linkages]
    if case.nodes > 1 or case.linkages == 1:
        each = [{'joint_prefix': f'{name}_'} for name in names]
    else:
        each = [{'linkages': f'[{",".join(names)}]'}]
    remaps = ('measured_joint_states', 'joint_states'), ('joint_states', ANSWERS)
    with ExitStack() as stack:
        yield [
            stack.enter_context(
                node(DOMAIN, remaps=(*remaps, ('__node', f'node{n}')), **FOLLOWED, **own)
            )
            for n, own in enumerate(each)
        ]


def measure(case: Case, answers: Answers, seconds: float) -> dict[str, float]:
    """Measures a case."""
    with tempfile.TemporaryDirectory() as folder, ExitStack() as stack:
        nodes, sent = stack.enter_context(moving(case)), Path(folder, 'sent.npy')
        for one in nodes:
            wait_for(lambda one=one: 'four_bar' in one.output, PATIENCE)
        cranks = [f'{name}_crank' for name in NAMES]
        command = ROBOT_NODE, case.rate_hz, sent, *cranks
        robot = stack.enter_context(running(*command, domain=DOMAIN))
        started = time.time_ns()  # answers of the previous case may be queued
        wait_for(lambda: answers.receive(0.1) or answers.last_stamp > started, PATIENCE)
        answers.receive(2 * SETTLE)
        answers.received.clear()
        begin, before = time.time_ns(), [one.computed() for one in nodes]
        own = time.process_time()
        answers.receive(seconds)
        computed = sum(one.computed() for one in nodes) - sum(before)
        own, end = time.process_time() - own, time.time_ns()
        memory = sum(one.memory() for one in nodes)
        answers.receive(SETTLE)  # late answers
        assert robot.end() == 0, robot.output
        for one in nodes:
            assert one.end() == 0, one.output
        found = compared(np.load(sent), answers.complete(case.linkages), begin, end)
    return {
        'cpu_percent': 100 * computed / seconds,
        'us_per_measurement': 1e6 * computed / found['sent'],
        'receiver_percent': 100 * own / seconds,
        'memory_mib': memory,
        **found,
    }


def compared(sent: np.ndarray, complete: np.ndarray, begin: int, end: int) -> dict[str, float]:
    """Compares measurements with answers.

    Args:
        sent: Stamps of the measurements, ns.
        complete: Stamps and arrivals of the answers, ns.
        begin: Start of the period that counts, ns.
        end: End of the period, ns.

    Returns:
        Numbers of measurements, of complete answers and of lost ones, the rate of the robot, Hz,
        and the latency of the answers, ms.
    """
    sent = sent[(sent >= begin) & (sent < end)]
    complete = complete[np.isin(complete[:, 0], sent)]
    late = (complete[:, 1] - complete[:, 0]) * 1e-6
    p50, p99 = np.quantile(late, (0.5, 0.99)) if len(late) else (np.nan, np.nan)
    return {
        'robot_hz': len(sent) / ((end - begin) * 1e-9),
        'sent': len(sent),
        'complete': len(complete),
        'lost': len(sent) - len(complete),
        'p50_ms': p50,
        'p99_ms': p99,
    }


def machine() -> dict[str, object]:
    """Returns processor, number of cores and load averages of the machine."""
    information = Path('/proc/cpuinfo').read_text()
    found = re.search(r'^model name\s*: (.*)', information, re.MULTILINE)
    return {
        'cpu': found[1] if found else 'unknown',
        'cores': os.cpu_count(),
        'load_before': os.getloadavg(),
        'nice': os.nice(0),
    }


def summary(case: Case, rounds: dict[Case, list[dict[str, float]]]) -> dict[str, object]:
    """Summarises the rounds of a case: totals of numbers of messages, medians of the rest."""
    own, one = rounds[case], rounds[case._replace(linkages=1, nodes=1)]
    found = {
        key: sum(x[key] for x in own) if key in {'sent', 'complete', 'lost'}
        else round(median(x[key] for x in own), 3)
        for key in own[0]
    }  # fmt: skip
    key = 'us_per_measurement'
    ratios = [x[key] / y[key] for x, y in zip(own, one, strict=True)]
    return {**case._asdict(), **found, 'over_one': round(median(ratios), 3)}


def main() -> int:
    """Measures, writes and prints the figures."""
    given = options(__doc__, seconds=(10.0, 's for each case'), rounds=(3, 'rounds of all cases'))
    about, answers = machine(), Answers()
    rounds: dict[Case, list[dict[str, float]]] = {case: [] for case in CASES}
    for number in range(given.rounds):
        for case in CASES[:: 1 - 2 * (number % 2)]:  # in reverse order every other time
            rounds[case].append(measure(case, answers, given.seconds))
            cells = ', '.join(f'{key} {value:.4g}' for key, value in rounds[case][-1].items())
            print(f'{case.rate_hz:g} Hz, {case.linkages} linkages in {case.nodes} nodes: {cells}',
                  flush=True)  # fmt: skip
    records = [summary(case, rounds) for case in CASES]
    kept = {
        f'{MOST} in one node at {x["rate_hz"]:g} Hz: at most {LIMIT} times one':
            x['over_one'] <= LIMIT
        for x in records if (x['linkages'], x['nodes']) == (MOST, 1)
    }  # fmt: skip
    figures = {'machine': about, 'seconds': given.seconds, 'rounds': given.rounds,
               'records': records}  # fmt: skip
    return finish('linkages', given.out, figures, kept)


if __name__ == '__main__':
    sys.exit(main())
