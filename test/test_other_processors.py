# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Verification of logs from another processor, whose C library has other sines.

glibc computes sines with FMA instructions if the processor has them. A setting of glibc switches
them off in a process, which then computes as a processor without them does.
"""

import json
import math
import os
import re
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from live_logs import live, ticks
from ros_harness import CODEC, PACKAGE_PATH, PATIENCE, logged, report_of
from test_verify import rewrite, written_over

from linkage_ros.mechanism.elementwise import noise
from linkage_ros.mechanism.program import Constants, Program
from linkage_ros.programs.record import record
from linkage_ros.settings.configuration import configure, read_values

# The names of the switches depend on the version of glibc, which ignores unknown ones.
TUNABLES = 'glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4,-AVX2_Usable,-FMA_Usable,-FMA4_Usable'
# A fast crank: the terms of the torque are tens of times larger than the torque.
FAST = configure(
    {'drive': 'torque', 'motor.torque': 0.5, 'motor.damping': 0.01, 'start_rpm': 1000.0}
)
# A sine that ends 3e-3 rad before the limits of the crank, where all errors of its angle grow.
SINE = configure({
    **{name: value for name, value in read_values('quadrilateral').items() if name != 'rpm'},
    'drive': 'motion', 'crank.length': 0.3, 'motion.center': 2.75 * math.pi,
    'motion.amplitude': 2.75452930305509, 'motion.frequency': 1.37, 'motion.phase': 0.3,
})  # fmt: skip


def write(folder):
    """Writes a live log with commands, and records."""
    plan = [(('command', math.sin(n)), *ticks(7)) for n in range(150)]
    live(folder / 'live.mcap', FAST, [item for part in plan for item in part])
    record(FAST, folder / 'record.mcap', duration=5.0)
    record(SINE, folder / 'sine.mcap', duration=5.0)


def outcome(folder):
    """Verifies the logs in a folder; returns sines of this process, and results by name."""
    found = {path.name: report_of(path) for path in sorted(folder.glob('*.mcap'))}
    sines = [math.sin(0.001 * n) for n in range(10_000)]
    return [sines, {name: [r.difference, r.states, r.ulp] for name, r in found.items()}]


def test_logs_of_processors_with_and_without_fma_are_equal(tmp_path):
    own, other = tmp_path / 'own', tmp_path / 'other'
    own.mkdir()
    other.mkdir()
    write(own)
    program = (
        'import json, sys; from pathlib import Path; import test_other_processors as test\n'
        'test.write(Path(sys.argv[2])); print(json.dumps(test.outcome(Path(sys.argv[1]))))'
    )
    paths = os.pathsep.join((str(Path(__file__).parent), PACKAGE_PATH))
    done = subprocess.run(
        [sys.executable, '-c', program, own, other], capture_output=True, check=True,
        timeout=PATIENCE,
        env={**os.environ, 'GLIBC_TUNABLES': TUNABLES, 'PYTHONPATH': paths},
    )  # fmt: skip
    sines, there = json.loads(done.stdout)
    here_sines, here = outcome(other)
    if sines == here_sines:
        pytest.skip('the C library has the same sines with and without FMA on this processor')
    for name, (difference, states, ulp) in (*here.items(), *there.items()):
        assert (name, difference) == (name, '')
        assert states == (1050 if name == 'live.mcap' else 1000)
        assert ulp <= 4


def test_torque_may_change_by_a_few_of_its_units(tmp_path):
    """Verification states the unit of a difference, which is that of the largest term."""
    write(tmp_path)
    path, number = tmp_path / 'live.mcap', 700
    before, (_, messages) = path.read_bytes(), logged(path)
    data = messages['/joint_states'][number].data
    torque = CODEC.decode(data)[1][6]
    place = data.index(struct.pack('<d', torque))

    def report(wrong):
        path.write_bytes(before)
        rewrite(path, written_over('/joint_states', number, place, wrong))
        return report_of(path)

    off, units = map(
        float, re.search(r'off by (\S+), (\S+) ulp', report(torque + 1.0).difference).groups()
    )
    assert math.ulp(torque) < off / units < 1e4 * math.ulp(torque)
    assert report(torque + 3.8 * off / units).difference == ''
    found = report(torque + 5.0 * off / units)
    assert 'effort[crank] = ' in found.difference
    assert found.states == number


def test_noise_shows_the_largest_terms_of_a_sum():
    """The terms cancel, so that rounding errors of the sum exceed those of its value."""
    program = Program(cancelling, Constants((1e8,)), ('x',), by_math=True)
    x = np.linspace(1.0, 2.0, 50)
    right = program(x)
    with noise(2.0**-40, 1):
        moved = abs(program(x) - right)
        assert program.floats(1.5) == cancelling((1e8,), 1.5)
    assert np.array_equal(program(x), right)
    assert np.abs(right).max() * 2.0**-40 < 1e-6 * moved.max() < 2.0**-40 * 1e3


def cancelling(k, x):
    return (x + k[0]) - k[0]
