# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Hostile input ends in success or one clear line: no traceback, no hang, no gigabytes.

LINKAGE_ROS_CASES=10000 tries so many cases instead of a hundred. Watched from outside, with
limits of time and memory, benchmarks/reliability/fuzz.py tries the same ones.
"""

import os
import random
import subprocess
import sys
from pathlib import Path

import hostile
import hostile_logs
import hostile_outcomes
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from ros_harness import fresh_domain

from linkage_ros.log.reader import LogReader
from linkage_ros.parameters.configuration import load
from linkage_ros.verification.verify import verify

CASES = int(os.environ.get('LINKAGE_ROS_CASES', '100'))
MORE = settings(max_examples=max(15, CASES // 20))
ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope='module')
def logs(tmp_path_factory):
    return hostile_logs.good_logs(tmp_path_factory.mktemp('logs'))


@pytest.fixture(scope='module')
def nodes():
    rclpy = pytest.importorskip('rclpy')
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=fresh_domain())
    names = ('quadrilateral', 'wind_pump')
    yield [hostile_outcomes.LiveNode(load(name), context) for name in names]
    context.shutdown()


@pytest.fixture
def put(tmp_path):
    """Writes bytes into a file; returns its path."""
    return lambda name, data: (tmp_path / name).write_bytes(data) and tmp_path / name


# How many of the cases are tried, and how many different refusals there are at least.
SEEDED = {
    'parameter file': (0.4, 10), 'log': (0.35, 5), 'replay options': (0.15, 5),
    'live parameters': (0.1, 1),
}  # fmt: skip


@pytest.mark.parametrize('kind', SEEDED)
def test_seeded_cases(put, logs, request, kind):
    share, least = SEEDED[kind]
    nodes = request.getfixturevalue('nodes') if kind == 'live parameters' else []
    outcomes, good = hostile_outcomes, put('good.mcap', logs[0])
    case = {
        'parameter file': lambda rng: outcomes.parameter_file(
            put('case.yaml', hostile.parameter_file(rng) or b'\n')
        ),
        'log': lambda rng: outcomes.log_file(
            put('case.mcap', hostile_logs.log_file(rng, logs) or b'\n')
        ),
        'replay options': lambda rng: outcomes.replay_options(hostile.replay_options(rng), good),
        'live parameters': lambda rng: rng.choice(nodes).request(hostile.live_parameters(rng)),
    }[kind]
    answers = [case(random.Random(seed)) for seed in range(round(share * CASES))]
    refused = {words for said in answers for words in said if words}
    assert len(refused) > least
    assert kind == 'replay options' or not all(map(any, answers))


# ---------------------------------------------------------------- what a case is measured by


def test_good_files_are_no_cases(put, logs):
    for data in logs:
        for log in (data, hostile_logs.bare(data)):
            path = put('good.mcap', log)
            assert hostile_outcomes.log_file(path) == [''] * 4
            with LogReader(path) as reader:
                report = verify(reader)
            assert (report.states, report.difference) == (30, '')


# ---------------------------------------------------------------- any text, any bytes

ANY = st.text(max_size=30)
SCALAR = st.none() | st.booleans() | st.integers() | st.floats() | ANY | st.dates() | st.binary()
TREE = st.recursive(
    SCALAR, lambda part: st.lists(part) | st.dictionaries(ANY, part), max_leaves=20
)


@MORE
@given(TREE, st.dictionaries(st.sampled_from(hostile.NAMES) | ANY, TREE))
def test_any_tree_as_a_parameter_file(tmp_path_factory, tree, own):
    path = tmp_path_factory.getbasetemp() / 'tree.yaml'
    for content in (tree, {'linkage_node': {'ros__parameters': own}}):
        path.write_text(yaml.safe_dump(content, allow_unicode=True), errors='replace')
        hostile_outcomes.parameter_file(path)


# ---------------------------------------------------------------- bombs

LIMITED = """
import resource, sys, time
from pathlib import Path
import numpy as np
sys.path.insert(0, sys.argv[1])
import hostile, hostile_bombs, hostile_outcomes as outcomes
from mcap.reader import make_reader
np.seterr(all='raise')
taken = int(Path('/proc/self/statm').read_text().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (taken + 2**29, taken + 2**29))
path = Path('bomb.mcap')
"""
BOMBS = """
for number, bomb in enumerate(hostile_bombs.bombs()):
    path.write_bytes(bomb())
    begin = time.process_time()
    outcomes.log_file(path)
    assert time.process_time() - begin < 5, number
for number, bomb in enumerate(hostile.yaml_bombs()):
    path.with_suffix('.yaml').write_bytes(bomb())
    begin = time.process_time()
    outcomes.parameter_file(path.with_suffix('.yaml'))
    assert time.process_time() - begin < 5, number
print('all')
"""
UNLIMITED = """
path.write_bytes(hostile_bombs.bombs()[2]())
with path.open('rb') as stream:
    print(len(list(make_reader(stream).iter_messages())))
"""


def limited(program, tmp_path):
    words = [sys.executable, '-c', LIMITED + program, str(ROOT / 'test')]
    return subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False)


def test_bombs_take_neither_long_nor_half_a_gigabyte(tmp_path):
    done = limited(BOMBS, tmp_path)
    assert done.stdout == 'all\n', done.stderr


def test_they_are_bombs_to_the_mcap_library(tmp_path):
    done = limited(UNLIMITED, tmp_path)
    assert done.returncode
    assert 'MemoryError' in done.stderr or 'resize buffer' in done.stderr, done.stderr
