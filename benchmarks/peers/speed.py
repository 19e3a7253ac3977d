# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Every peer's speed and errors, each beside ours in the same run. Started by run.py.

A peer and ours take turns, round by round, on the same crank angles; the ratio is the median
over the rounds of the ratio within each, so that a busy machine slows both. Run by itself:
PYTHONPATH=.:test python benchmarks/peers/speed.py OUT.json
"""

import argparse
import gc
import json
import math
import statistics
import time
from pathlib import Path

import adapter_ours
import numpy as np
import registry
from oracle import Oracle

from linkage_ros.parameters.configuration import load

SPEED = 5 * math.pi  # 150 rpm
TURN = 360  # States of one turn.
ARRAY = 200_000
LEAST = 0.02  # s that one round of a peer should take.
WAYS = (
    ('kinematics', 'one', 'kinematics'),
    ('torque', 'one', 'torque'),
    ('kinematics', 'array', 'kinematics_array'),
    ('torque', 'array', 'torque_array'),
)


def angles(start, count):
    """Crank angles on one grid of a degree, so that a later piece goes on from an earlier."""
    return [2 * math.pi * i / TURN for i in range(start, start + count)]


def reference(mechanism):
    """A turn in 50 digits; rows as the adapters' tables."""
    oracle = Oracle(mechanism)
    states = [oracle.state(angle, SPEED) for angle in angles(0, TURN)]
    return np.array(
        [
            [*s.position[1:], *s.velocity[1:], *s.acceleration[1:], s.torque] for s in states
        ],
        dtype=object,
    ).T  # fmt: skip


def errors(table, right):
    """The largest error of angle, rate, acceleration and torque, in SI units."""
    count = len(table)
    # The difference is taken in many digits: ours is no larger than the rounding of a double.
    difference = np.array(table - right[:count], float)
    difference[:2] -= 2 * math.pi * np.round(difference[:2] / (2 * math.pi))
    worst = np.abs(difference).max(axis=1)
    quantities = {
        'max_error_position': worst[0:2].max(),
        'max_error_rate': worst[2:4].max(),
        'max_error_acceleration': worst[4:6].max(),
        'max_error_torque': worst[6] if count == 7 else None,
    }
    return {name: x if x is None else float(x) for name, x in quantities.items()}


def seconds(function, argument):
    """One call's time."""
    start = time.perf_counter()
    function(argument)
    return time.perf_counter() - start


def sample_size(function, mode):
    """How many states make a round long enough to time and short enough to take turns."""
    few = pieces(mode, 0, 24)
    function(few)
    each = min(seconds(function, few) for _ in range(3)) / 24
    if mode == 'array':
        return ARRAY if each < 20e-6 else max(60, int(LEAST / each))
    return min(4 * TURN, max(6, int(LEAST / each)))


def pieces(mode, start, count):
    """The angles of one call."""
    if mode == 'array':
        return np.arange(count) * (2 * math.pi / max(count, TURN))
    return angles(start, count)


def compare(peer, ours, way, rounds, right):
    """One record."""
    work, mode, name = way
    ask, ask_ours = getattr(peer, name), getattr(ours, name)
    # Anew: what follows the motion would begin with a jump from where timing left it.
    fresh = type(peer)(peer.mechanism, SPEED, 0.0)
    found = errors(fresh.table(getattr(fresh, name)(pieces(mode, 0, TURN))), right)
    size, ours_size = sample_size(ask, mode), ARRAY if mode == 'array' else 8 * TURN
    rows, start = [], 0
    gc.collect()
    gc.disable()
    for _ in range(rounds):
        theirs_angles, our_angles = pieces(mode, start, size), pieces(mode, start, ours_size)
        before = seconds(ask_ours, our_angles)
        theirs = seconds(ask, theirs_angles) / size
        after = seconds(ask_ours, our_angles)
        mine = (before + after) / 2 / ours_size
        rows.append((theirs / mine, theirs * 1e6, mine * 1e6))
        start += size
    gc.enable()
    ratio, us, ours_us = (statistics.median(column) for column in zip(*rows, strict=True))
    return {
        'peer': peer.name, 'version': registry.version(peer), 'work': work, 'mode': mode,
        'states': size, 'ratio': ratio, 'us_per_state': us, 'ours_us_per_state': ours_us, **found,
    }  # fmt: skip


def main():
    """Writes the records and how each peer was called."""
    parser = argparse.ArgumentParser()
    parser.add_argument('out', type=Path)
    parser.add_argument('--rounds', type=int, default=21)
    options = parser.parse_args()
    mechanism = load('quadrilateral').mechanism
    right = reference(mechanism)
    records, calls = [], {}
    ours = adapter_ours.Adapter(mechanism, SPEED, 0.0)
    for _, peer in registry.usable(mechanism, SPEED, 0.0):
        calls[peer.name] = peer.how
        for way in WAYS:
            if getattr(peer, way[2]) is not None:
                record = compare(peer, ours, way, options.rounds, right)
                records.append(record)
                print(
                    f'{record["peer"]:16}{record["work"]:11}{record["mode"]:6}'
                    f'{record["us_per_state"]:10.4g} us a state, ratio {record["ratio"]:.3g}',
                    flush=True,
                )
    options.out.write_text(json.dumps({'turn': TURN, 'records': records, 'calls': calls}))


if __name__ == '__main__':
    main()
