# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Measures speed and errors of each peer, compared with this package. Started by run.py.

Peer and package run alternately, on the same crank angles. Each round gives a ratio of their
times, which depends little on the load of the machine; the result is the median of all rounds. To
run the measurement alone: PYTHONPATH=.:test python benchmarks/peers/speed.py OUT.json
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

from linkage_ros.settings.configuration import load

SPEED = 5 * math.pi  # 150 rpm
TURN = 360  # states per turn
ARRAY = 200_000
LEAST = 0.02  # s, intended duration of a round
WAYS = (
    ('kinematics', 'one', 'kinematics'),
    ('torque', 'one', 'torque'),
    ('kinematics', 'array', 'kinematics_array'),
    ('torque', 'array', 'torque_array'),
)


def angles(start, count):
    """Returns crank angles on a grid of one degree; consecutive calls continue each other."""
    return [2 * math.pi * i / TURN for i in range(start, start + count)]


def reference(mechanism):
    """Computes one turn in 50 digits, in the format of `table`."""
    oracle = Oracle(mechanism)
    states = [oracle.state(angle, SPEED) for angle in angles(0, TURN)]
    return np.array(
        [
            [*s.position[1:], *s.velocity[1:], *s.acceleration[1:], s.torque] for s in states
        ],
        dtype=object,
    ).T  # fmt: skip


def errors(table, right):
    """Returns the largest errors of angle, rate, acceleration and torque, in SI units."""
    count = len(table)
    # The difference is computed in many digits, because errors may be smaller than a rounding.
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
    """Measures the duration of one call, s."""
    start = time.perf_counter()
    function(argument)
    return time.perf_counter() - start


def sample_size(function, mode):
    """Returns a number of states for which a round takes about LEAST seconds."""
    few = pieces(mode, 0, 24)
    function(few)
    each = min(seconds(function, few) for _ in range(3)) / 24
    if mode == 'array':
        return ARRAY if each < 20e-6 else max(60, int(LEAST / each))
    return min(4 * TURN, max(6, int(LEAST / each)))


def pieces(mode, start, count):
    """Returns the crank angles of one call."""
    if mode == 'array':
        return np.arange(count) * (2 * math.pi / max(count, TURN))
    return angles(start, count)


def compare(peer, ours, way, rounds, right):
    """Measures one method of a peer; returns its record."""
    work, mode, name = way
    ask, ask_ours = getattr(peer, name), getattr(ours, name)
    # A new peer, because peers that follow the motion must not start with a jump.
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
    """Writes the records and the descriptions of the peers."""
    parser = argparse.ArgumentParser()
    parser.add_argument('out', type=Path)
    parser.add_argument('--rounds', type=int, default=21)
    options = parser.parse_args()
    mechanism = load('quadrilateral').mechanism
    right = reference(mechanism)
    records, calls, left_out = [], {}, []
    ours = adapter_ours.Adapter(mechanism, SPEED, 0.0)
    for _, peer in registry.usable(mechanism, SPEED, 0.0, left_out):
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
    found = {'turn': TURN, 'records': records, 'calls': calls, 'left_out': left_out}
    options.out.write_text(json.dumps(found))


if __name__ == '__main__':
    main()
