# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Hostile input ends in success or one clear line: no traceback, no hang, no gigabytes.

LINKAGE_ROS_CASES=10000 tries so many cases instead of a hundred. Watched from outside, with
limits of time and memory, benchmarks/reliability/fuzz.py tries the same ones.
"""

import json
import os
import random
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import hostile
import hostile_bombs
import hostile_logs
import hostile_outcomes
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from ros_harness import fresh_domain

from linkage_ros.log.metadata import encode_motion, seal
from linkage_ros.log.reader import LogReader
from linkage_ros.parameters.configuration import configure, from_strings, load, to_strings
from linkage_ros.run.simulator import Simulator
from linkage_ros.verification.verify import verify

CASES = int(os.environ.get('LINKAGE_ROS_CASES', '100'))
MORE = settings(max_examples=max(15, CASES // 20))
ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope='module')
def logs(tmp_path_factory):
    return hostile_logs.good_logs(tmp_path_factory.mktemp('logs'))


def tried(share, case):
    """Tries a share of the cases; returns how many were accepted, and the words of refusals."""
    refused, accepted = set(), 0
    for seed in range(round(share * CASES)):
        try:
            said = case(random.Random(seed))
        except BaseException:
            print(f'seed {seed}')
            raise
        refused |= set(said) - {''}
        accepted += not any(said)
    return accepted, refused


# ---------------------------------------------------------------- seeded cases


def test_parameter_files(tmp_path):
    path = tmp_path / 'case.yaml'

    def case(rng):
        path.write_bytes(hostile.parameter_file(rng))
        return hostile_outcomes.parameter_file(path)

    accepted, refused = tried(0.4, case)
    assert accepted
    assert len(refused) > 10


def test_logs(tmp_path, logs):
    path = tmp_path / 'case.mcap'

    def case(rng):
        path.write_bytes(hostile_logs.log_file(rng, logs))
        return hostile_outcomes.log_file(path)

    accepted, refused = tried(0.35, case)
    assert accepted
    assert len(refused) > 5


def test_replay_options(tmp_path, logs):
    path = tmp_path / 'good.mcap'
    path.write_bytes(logs[0])
    _, refused = tried(
        0.15, lambda rng: hostile_outcomes.replay_options(hostile.replay_options(rng), path)
    )
    assert len(refused) > 5


@pytest.fixture(scope='module')
def nodes():
    rclpy = pytest.importorskip('rclpy')
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=fresh_domain())
    names = ('quadrilateral', 'wind_pump')
    yield [hostile_outcomes.LiveNode(load(name), context) for name in names]
    context.shutdown()


def test_live_parameters(nodes):
    accepted, refused = tried(
        0.1, lambda rng: rng.choice(nodes).request(hostile.live_parameters(rng))
    )
    assert accepted
    assert refused


# ---------------------------------------------------------------- what a case is measured by


def test_good_files_are_no_cases(tmp_path, logs):
    for number, data in enumerate(logs):
        path = tmp_path / f'{number}.mcap'
        for log in (data, hostile_logs.bare(data)):
            path.write_bytes(log)
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


@MORE
@given(st.dictionaries(st.sampled_from(hostile.NAMES) | ANY, TREE))
def test_any_settings(settings_):
    def texts():
        return {name: json.dumps(value, default=str) for name, value in settings_.items()}

    hostile_outcomes.outcome(lambda: configure(settings_))
    hostile_outcomes.outcome(lambda: from_strings({**to_strings(load('compressor')), **texts()}))


@MORE
@given(st.binary(max_size=300), st.integers(0, 300))
def test_any_bytes_as_a_message(data, at):
    simulator = Simulator(load('quadrilateral'))
    good = simulator.snapshot_at(simulator.begin(0), 0).messages[0]
    mixed = good[:at] + data + good[at + len(data) :]
    for message in (data, mixed):
        with suppress(ValueError):
            assert len(simulator.joint_states.decode(message)[1]) == 9


@MORE
@given(
    st.dictionaries(
        st.sampled_from(('stamp', 'phase', 'speed', 'rpm', 'acceleration', 'torque', 'before'))
        | ANY,
        st.sampled_from(hostile.TEXTS) | ANY,
    )
)
def test_any_words_as_a_motion_record(tmp_path_factory, fields):
    good = encode_motion(Simulator(load('quadrilateral')).begin(0).segment)
    good.pop('crc32')
    path = tmp_path_factory.getbasetemp() / 'motion.mcap'
    record = (
        'linkage_ros/motion',
        seal({name: hostile_logs.plain(text) for name, text in {**good, **fields}.items()}),
    )
    path.write_bytes(hostile_bombs.whole(metadata=[record]))
    hostile_outcomes.log_file(path)


@MORE
@given(
    st.lists(ANY | st.sampled_from(('--rate', '--clock', '--topics', '--delay', '1', '-1e999')))
)
def test_any_words_as_replay_options(tmp_path_factory, words):
    missing = tmp_path_factory.getbasetemp() / 'missing.mcap'
    hostile_outcomes.replay_options(words, missing)


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
path.write_bytes(hostile_bombs.bombs()[int(sys.argv[2])]())
with path.open('rb') as stream:
    print(len(list(make_reader(stream).iter_messages())))
"""


def limited(program, tmp_path, *words):
    words = [sys.executable, '-c', LIMITED + program, str(ROOT / 'test'), *map(str, words)]
    return subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False)


def test_bombs_take_neither_long_nor_half_a_gigabyte(tmp_path):
    done = limited(BOMBS, tmp_path)
    assert done.stdout == 'all\n', done.stderr


@pytest.mark.parametrize('number', [2, 4], ids=['zstd', 'lz4'])
def test_they_are_bombs_to_the_mcap_library(tmp_path, number):
    done = limited(UNLIMITED, tmp_path, number)
    assert done.returncode
    assert 'MemoryError' in done.stderr or 'resize buffer' in done.stderr, done.stderr
