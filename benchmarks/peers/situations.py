# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Tests each peer in difficult situations. Started by run.py.

Each peer runs in its own process, because it may hang or crash. To run the tests alone:
PYTHONPATH=.:test python benchmarks/peers/situations.py OUT.json
"""

import argparse
import contextlib
import json
import math
import subprocess
import sys
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import registry
from cases import cases
from oracle import Oracle

SPEED = 1.0
CLOSE = 1e-6
PATIENCE = 120.0  # s, time limit for the situations of one peer
# From worst to best; the worst outcome of all states is reported.
OUTCOMES = ('NaN', 'wrong branch', 'diverged', 'rates wrong', 'refused', 'right')


def reference(case, mechanism):
    """Returns exact angles, rates and accelerations; None where the loop cannot close."""
    oracle = Oracle(mechanism, case.lengths)
    columns = []
    for angle in case.angles:
        if not oracle.closes(angle):
            columns.append(None)
            continue
        state = oracle.state(angle, SPEED)
        rows = *state.position[1:], *state.velocity[1:], *state.acceleration[1:]
        columns.append([float(x) for x in rows])
    return columns


def apart(angles, others):
    """Returns the largest difference between two sets of directions, rad."""
    difference = angles - others
    return np.abs(difference - 2 * math.pi * np.round(difference / (2 * math.pi))).max()


def judge(state, right, other):
    """Classifies the outcome of one state."""
    if not np.isfinite(state).all():
        return 'NaN'
    if right is None:
        return 'diverged'
    if apart(state[:2], right[:2]) > CLOSE:
        return 'wrong branch' if apart(state[:2], other[:2]) <= CLOSE else 'diverged'
    scale = np.maximum(np.abs(right[2:]), 1.0)
    return 'right' if (np.abs(state[2:] - right[2:]) <= CLOSE * scale).all() else 'rates wrong'


def arithmetic(error):
    """Returns whether an exception, or one of its causes, is an arithmetic error."""
    while error is not None:
        if isinstance(error, (ArithmeticError, np.linalg.LinAlgError)):
            return True
        if isinstance(error, ValueError) and 'math domain' in str(error):
            return True
        error = error.__cause__
    return False


def answer(peer, ask, angle):
    """Returns a state, or the outcome and message of an exception."""
    try:
        return peer.table(ask(angle))[:6, 0], ''
    except Exception as error:  # noqa: BLE001 - any exception is an outcome
        outcome = 'NaN' if arithmetic(error) else 'refused'
        return outcome, f'{type(error).__name__}: {error}'


def tried(make, case, right, other):
    """Returns the worst outcome, the number of states per outcome, and the first message."""
    peer = make(case.mechanism, SPEED, case.angles[0])
    alone = peer.kinematics or peer.torque
    array = peer.torque_array

    def ask(angle):
        return alone([angle]) if alone else array(np.array([angle]))

    outcomes, said = [], ''
    for angle, *states in zip(case.angles, right, other, strict=True):
        state, message = answer(peer, ask, angle)
        said = said or message
        outcomes.append(state if isinstance(state, str) else judge(state, *states))
    counts = {name: outcomes.count(name) for name in OUTCOMES if name in outcomes}
    found = {'outcome': next(iter(counts)), 'states': counts}
    return {**found, 'said': said} if said else found


def references():
    """Returns the exact states of all cases, and those of the other assembly, as lists."""
    both = []
    for case in cases():
        mechanism = case.mechanism
        flipped = 'crossed' if mechanism.assembly == 'open' else 'open'
        both.append(
            [reference(case, mechanism), reference(case, replace(mechanism, assembly=flipped))]
        )
    return both


def worker(index, known):
    """Tests one peer; prints a line per situation."""
    warnings.simplefilter('ignore')
    make = registry.adapter(index)
    known = json.loads(known.read_text())
    for case, both in zip(cases(), known, strict=True):
        right, other = ([None if x is None else np.array(x) for x in states] for states in both)
        # Output of a peer must not mix with the results.
        with contextlib.redirect_stdout(sys.stderr):
            found = tried(make, case, right, other)
        record = {'peer': make.name, 'situation': case.name, **found}
        print(json.dumps(record), flush=True)


def run_peer(index, names, known):
    """Tests one peer in another process; situations after a crash also count as crashed."""
    command = [sys.executable, __file__, known, '--worker', str(index)]
    try:
        done = subprocess.run(command, capture_output=True, timeout=PATIENCE, check=False)
        lines, end = done.stdout, 'crashed'
    except subprocess.TimeoutExpired as late:
        lines, end = late.stdout or b'', 'hung'
    records = [json.loads(line) for line in lines.decode().splitlines()]
    peer = registry.adapter(index).name
    lost = names[len(records) :]
    return records + [{'peer': peer, 'situation': name, 'outcome': end} for name in lost]


def main():
    """Writes the outcomes and the descriptions of the situations."""
    parser = argparse.ArgumentParser()
    parser.add_argument('out', type=Path)
    parser.add_argument('--worker', type=int)
    options = parser.parse_args()
    if options.worker is not None:
        worker(options.worker, options.out)
        return
    described = {case.name: case.sentence for case in cases()}
    records = []
    first = cases()[0]
    known = options.out.with_suffix('.known')
    known.write_text(json.dumps(references()))
    for index, _ in registry.usable(first.mechanism, SPEED, first.angles[0], []):
        found = run_peer(index, list(described), known)
        records += found
        print(f'{found[0]["peer"]:16}', *(r['outcome'] for r in found), sep=' | ', flush=True)
    options.out.write_text(json.dumps({'situations': described, 'outcomes': records}))


if __name__ == '__main__':
    main()
