# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Hostile input ends in success or a one-line error, without traceback, hang or excessive memory.

LINKAGE_ROS_CASES=10000 runs that number of cases instead of a hundred.
benchmarks/reliability/fuzz.py runs the same cases in processes with limits of time and memory.
"""

import os
import random
import re
import signal
import struct
import subprocess
import sys
import time
import tracemalloc
from contextlib import contextmanager
from pathlib import Path

import hostile
import hostile_logs
import hostile_outcomes
import lz4.frame
import pytest
import yaml
from hostile_logs import TORQUE, chunk, packed, tight, whole
from hypothesis import given, settings
from hypothesis import strategies as st
from joint_codec import encode_float64
from mcap.records import Channel, DataEnd, Header, Message, Metadata, Schema, Statistics
from mcap.writer import MCAP0_MAGIC
from mcap_records import packed_records
from mechanisms import load_values
from ros_harness import PATIENCE, assert_refused, command, fresh_domain, verified
from test_log import written

from linkage_ros import (
    ConfigurationError,
    LinkageError,
    LogError,
    MotionError,
    columns,
)
from linkage_ros.errors import MOST_LISTED, one_line, printable
from linkage_ros.log import scan as mcap_reader
from linkage_ros.log.reader import LogReader
from linkage_ros.log.records import (
    CONFIGURATION_RECORD,
    MOTION_RECORD,
    encode_configuration,
    encode_motion,
    seal,
)
from linkage_ros.log.recover import recover
from linkage_ros.log.scan import LARGEST
from linkage_ros.log.writer import LogWriter
from linkage_ros.motion.drives.law import Prescribed
from linkage_ros.programs import log_commands, log_tool, replay
from linkage_ros.programs import record as record_module
from linkage_ros.programs.record import record
from linkage_ros.run.states import Simulator
from linkage_ros.settings import configuration
from linkage_ros.settings.configuration import configure, load, to_strings
from linkage_ros.settings.yaml_file import read_parameter_file, read_yaml
from linkage_ros.xml_file import read_xml

MOTION = encode_motion(Simulator(load('quadrilateral').only).begin(0).segment)
# Everything that reads a file other than logs and bags.
READERS = {
    'parameters': read_parameter_file,
    'study': lambda path: read_yaml(path, 'study'),
    'robot': lambda path: read_xml(Path(path)),
    'law': lambda path: Prescribed(file=path),
    'load': lambda path: configure({**TORQUE, **load_values('curve', link='crank', file=path)}),
}
STEERING = '\x1b]0;title\x07\x1b[31m\u202e'


@contextmanager
def at_most(seconds):
    """Fails if the block takes more processor time, s, or hangs, even in a blocking call."""

    def stop(number, _):
        raise AssertionError(f'not within {limits[number]} s')

    limits = {signal.SIGPROF: seconds, signal.SIGALRM: PATIENCE}
    timers = {signal.SIGPROF: signal.ITIMER_PROF, signal.SIGALRM: signal.ITIMER_REAL}
    before = {number: signal.signal(number, stop) for number in limits}
    try:
        for number, limit in limits.items():
            signal.setitimer(timers[number], limit)
        yield
    finally:
        for number, handler in before.items():
            signal.setitimer(timers[number], 0)
            signal.signal(number, handler)


@pytest.fixture
def log(tmp_path):
    path = tmp_path / 'run.mcap'
    record(load('quadrilateral'), path, duration=0.1)
    return path


@pytest.fixture
def out(tmp_path):
    return tmp_path / 'out.mcap'


@pytest.fixture
def put(tmp_path):
    """Writes bytes to a file; returns its path."""
    return lambda name, data: ((tmp_path / name).write_bytes(data), tmp_path / name)[1]


@pytest.fixture
def stored(put):
    return lambda data: put('bad.mcap', data)


def read(path):
    """Reads all messages of a log, in order of log time and in order of writing."""
    log = LogReader(path)
    return list(log.messages()), written(log)


@contextmanager
def little_memory(most):
    """Fails if the block uses more memory than `most`, bytes."""
    tracemalloc.start()
    try:
        yield
        assert tracemalloc.get_traced_memory()[1] < most
    finally:
        tracemalloc.stop()


# ---------------------------------------------------------------- file names


NAMES = {
    'a NUL': 'a\0b',
    'half a character': 'a\ud800b.mcap',
    'not UTF-8': 'a\udcffb.mcap',
    'too long': 'x' * 300,
    'far too long': 'x/' * 5000,
    'of a terminal': STEERING,
    'empty': '',
    'a folder': '.',
}


@pytest.mark.parametrize('name', NAMES.values(), ids=NAMES)
def test_any_file_name_gives_a_one_line_error(tmp_path, log, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    for use in (
        lambda: LogReader(name),
        lambda: recover(name, tmp_path / 'out.mcap'),
        lambda: read_parameter_file(name),
        lambda: load(name),
    ):
        with pytest.raises(LinkageError) as caught:
            use()
        assert str(caught.value).isprintable()
        assert len(str(caught.value)) <= 600
    if name not in {NAMES['not UTF-8'], NAMES['of a terminal']}:  # valid file names
        with pytest.raises(LogError):
            recover(log, name)
        with pytest.raises(LogError):
            LogWriter(name, load('quadrilateral'), overwrite=True)


@pytest.mark.parametrize('name', ['pipe', '/dev/null', '/dev/zero', '/dev/full'])
def test_special_files_neither_block_nor_are_removed(tmp_path, out, name):
    os.mkfifo(tmp_path / 'pipe')
    (link := tmp_path / 'link.mcap').symlink_to(tmp_path / name)
    with at_most(5):
        with pytest.raises(LogError, match=r'link\.mcap'):
            LogReader(link)
        with pytest.raises(LogError):
            recover(link, out)
        if name in {'pipe', '/dev/full'}:
            with pytest.raises(LogError):
                LogWriter(link, load('quadrilateral'), overwrite=True)
    assert link.is_symlink()


@pytest.mark.parametrize('name', ['pipe', 'folder', '/dev/zero', '/dev/null', 'large', 'bytes'])
@pytest.mark.parametrize('reader', READERS)
def test_every_reader_refuses_other_files_without_blocking(tmp_path, monkeypatch, reader, name):
    os.mkfifo(tmp_path / 'pipe')
    (tmp_path / 'folder').mkdir()
    (tmp_path / 'bytes').write_bytes(b'\xff\xfe\0a')
    with (tmp_path / 'large').open('wb') as stream:
        stream.truncate(LARGEST + 1)
    monkeypatch.chdir(tmp_path)
    with at_most(5), pytest.raises(ConfigurationError) as caught:
        READERS[reader](name)
    assert name in str(caught.value)
    assert '\n' not in str(caught.value)
    if name == 'large':
        assert str(LARGEST + 1) in str(caught.value)


def test_twenty_unknown_names_are_explained_and_the_others_counted(monkeypatch):
    explained = []
    explain = configuration._not_a_parameter
    monkeypatch.setattr(
        configuration, '_not_a_parameter', lambda *x: explained.append(x) or explain(*x)
    )
    with pytest.raises(ConfigurationError, match=r'(?s)^8000 mistakes:\n.*\nand 7980 more$'):
        configure({**TORQUE, **{f'nonsense{i}': 1.0 for i in range(8000)}})
    assert len(explained) == MOST_LISTED


@pytest.mark.parametrize('count', [1, MOST_LISTED, MOST_LISTED + 1])
def test_few_unknown_names_are_all_counted(count):
    with pytest.raises(ConfigurationError) as caught:
        configure({**TORQUE, **{f'n{i}': 1.0 for i in range(count)}})
    found = re.match(r'(\d+) mistakes', str(caught.value))
    assert int(found[1] if found else 1) == count


@pytest.mark.parametrize('reader', ['law', 'load'])
def test_numbers_of_a_csv_file_with_too_many_rows_are_not_read(put, monkeypatch, reader):
    monkeypatch.setattr(columns, '_MOST_ROWS', 3)
    head = {'law': 'time,angle', 'load': 'at,value'}[reader]
    READERS[reader](str(put('three.csv', f'{head}\n0,1\n1,2\n2,1\n'.encode())))
    monkeypatch.setattr(columns.np, 'loadtxt', None)
    path = put('four.csv', f'{head}\n0,1\n1,2\n2,2\n3,1\n'.encode())
    with pytest.raises(ConfigurationError, match='4 rows') as caught:
        READERS[reader](str(path))
    assert 'four.csv' in str(caught.value)


@pytest.mark.parametrize('reader', ['law', 'load'])
def test_csv_file_with_too_many_columns_is_refused_by_their_number(put, reader):
    with pytest.raises(ConfigurationError, match='4000001 columns'):
        READERS[reader](str(put('wide.csv', b',' * 4_000_000)))


@pytest.mark.parametrize(
    ('text', 'words'),
    [
        (b'<a>' * 5_500_000, 'nested too deeply'),
        (b'<a>' + b'<b/>' * 2_000_000, 'too many elements'),
        (b'<!DOCTYPE a [' + b'<!ATTLIST a b CDATA "">' * 100_000 + b']><a/>', 'DOCTYPE'),
    ],
    ids=['deep', 'flat', 'declarations'],
)
def test_robot_model_is_refused_before_its_tree_takes_gigabytes(put, text, words):
    path = put('robot.urdf', text)
    tracemalloc.start()
    try:
        with pytest.raises(ConfigurationError, match=words):
            read_xml(path)
        assert tracemalloc.get_traced_memory()[1] < 1e8
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize('text', [b'<!--', b'<!-->', b'-->', b'<!-- -->x', b'<a:b '])
def test_a_robot_model_of_unfinished_parts_is_searched_once(put, text):
    path = put('robot.urdf', text * 50_000)
    begin = time.process_time()
    with pytest.raises(ConfigurationError):
        read_xml(path)
    assert time.process_time() - begin < 5  # 1 ms, or minutes for a search in quadratic time


def test_recovery_reads_a_log_of_damaged_chunks_about_once(stored, out, monkeypatch):
    """With many damaged chunks, each search for the next one must not read up to the end."""
    size = []
    read = mcap_reader.McapFile.read

    def counted(self, at, length):
        found = read(self, at, length)
        size.append(len(found))
        return found

    monkeypatch.setattr(mcap_reader.McapFile, 'read', counted)
    log = whole(*3000 * [chunk(b'zstd', b'damaged', 1)])
    assert recover(stored(log), out).places == 3000
    assert sum(size) < 30 * len(log)


# ---------------------------------------------------------------- messages


def test_error_is_one_line_that_every_terminal_can_print():
    error = ConfigurationError(f'a\nb\r\n{STEERING}\udcff {"x" * 10_000} end')
    assert str(error).startswith('a b \\x1b]0;title\\x07\\x1b[31m\\u202e\\udcff xxx')
    assert str(error).endswith('xxx end')
    assert len(str(error)) <= 600
    assert str(error).isprintable()
    assert len(one_line('\x1b' * 10_000)) <= 600
    assert printable('é ⚙') == 'é ⚙'


def test_log_texts_are_escaped_and_shortened_on_the_terminal(stored, called):
    data = whole(channels=300).replace(b'/joint_states7', b'/\x1b[2J\x1b[31m\x07\xc2\x9b7')
    path = stored(hostile_logs.resummed(data))
    code, said, err = called(log_tool, 'info', path)
    assert (code, err) == (0, '')
    assert '\\x1b[2J' in said
    assert '\x1b' not in said
    log = LogReader(path)
    topic = log.topics[0]._replace(name='x' * 1_000_000)
    log.topics = (topic, *log.topics[1:])
    assert sum(map(len, log_commands.info(log))) < 1_100_000


# ---------------------------------------------------------------- motions and settings


def test_a_motion_that_takes_millions_of_steps_is_refused(out):
    """All values of the file are in range, but a record took hours."""
    extreme = configure({**TORQUE, 'start_rpm': 1e6, 'rate_hz': 10.0})
    with at_most(15), pytest.raises(MotionError, match='fast'):
        record(extreme, out, duration=10.0)
    fast = configure({**TORQUE, 'start_rpm': 1e4, 'rate_hz': 10.0})
    assert record(fast, out, duration=0.2, overwrite=True) == 2


# ---------------------------------------------------------------- chunks and records


def test_decompressed_size_of_a_pass_is_limited(tmp_path, out, monkeypatch):
    path = tmp_path / 'run.mcap'
    record(configure({'rpm': 0.0, 'rate_hz': 1000.0}), path, duration=6.0)
    monkeypatch.setattr(mcap_reader, '_FREE', 0)
    monkeypatch.setattr(mcap_reader, '_RATIO', mcap_reader._RATIO // 4)  # also far below, at rest
    recover(path, out)
    for file in (path, out):
        for _ in range(3):  # each pass has its own limit, as a looping replay needs
            assert [len(messages) for messages in read(file)] == [24_001] * 2
    monkeypatch.setattr(mcap_reader, '_RATIO', 5)
    for act in (lambda: read(path), lambda: recover(path, out, overwrite=True)):
        with pytest.raises(LogError, match=r'run\.mcap.* decompress'):
            act()


INNER = packed(Message(0, 1, b'', 1, 0))
MANY = tight(packed(Message(0, 1, b'', 0, 0)) * 1000)  # with times after the start of their chunk
OTHER = packed(Channel(9, '/joint_states', 'cdr', {}, 1))
FIELDS = (
    {'phase': '1e999999999'}, {'speed': '1e-999999999'}, {'stamp': '9' * 4000},
    {'stamp': str(2**63)}, {'before': '-' + '9' * 30}, {'phase': '9' * 4200}, {'rpm': '[' * 500},
    {'torque': 'NaN'}, {'torque': '1e999'}, {'phase': '1/2/3'}, {'rpm': '9' * 400}, {'rpm': '{}'},
    {'rpm': '1e300'},
)  # fmt: skip


def misplaced():
    """Makes a log whose metadata index points to a bomb, which the mcap library unpacks."""
    data = whole(chunk(b'zstd', hostile_logs.zeros(4096), 2**32))
    at = data.index(b'\x06', data.index(b'linkage_ros/motion'))
    index = data.rindex(struct.pack('<I', 18) + b'linkage_ros/motion') - 16
    return hostile_logs.resummed(data[:index] + struct.pack('<Q', at) + data[index + 8 :])


def merged(told):
    """Makes a log merged from two, so that two channels have the same topic."""
    messages = packed(*(Message(number, 0, b'', 0, 0) for number in (0, 9)))
    counts = packed(Statistics(0, 2, {0: 1, 9: told}, 1, 1 + told, 1, 0, 2, 1))
    return whole(OTHER, tight(messages), behind=OTHER + counts)


def moved(fields):
    """Makes a log with a motion record of other fields and a valid checksum."""
    record = {name: text for name, text in {**MOTION, **fields}.items() if name != 'crc32'}
    return whole(metadata=[(MOTION_RECORD, seal(record))])


def foreign(*metadata, **options):
    """Makes an MCAP file of another tool, with metadata records."""
    schema = Schema(1, b'float64 data\n', 'ros2msg', 'std_msgs/msg/Float64')
    message = Message(1, 1, encode_float64(1.0), 1, 0)
    head = Header('ros2', 'other'), schema, Channel(1, '/x', 'cdr', {}, 1), message
    return packed_records([*head, *(Metadata(*pair) for pair in metadata)], **options)


def explained(fields):
    return foreign((CONFIGURATION_RECORD, fields))


SETTINGS = to_strings(load('quadrilateral'))
# Files, and what the error names: a value, the program's own error, or the guard by a word.
FORGED = {
    'foreign': (foreign(), 'linkage_ros'),
    'foreign, no chunks': (foreign(use_chunking=False), 'linkage_ros'),
    'foreign, no statistics': (foreign(use_statistics=False, use_summary_offsets=False), '.'),
    'version alone': (explained(seal({'version': '0.1.0'})), 'mechanism'),
    # With valid checksums, so the contents were written on purpose.
    'setting of the future': (
        explained(seal({**SETTINGS, 'crank.colour': '"red"'})),
        'crank.colour',
    ),
    'setting without JSON': (explained(seal({**SETTINGS, 'rpm': '150 rpm'})), 'JSON'),
    'impossible linkage': (explained(seal({**SETTINGS, 'crank.length': '9.0'})), '9 m'),
    'nested too deeply for Python': (
        explained(seal({**SETTINGS, 'rpm': '[' * 10**5})),
        'JSON',
    ),
    'motion with a zero divisor': (
        foreign(
            (CONFIGURATION_RECORD, seal(SETTINGS)),
            (MOTION_RECORD, seal({'stamp': '0', 'phase': '1/0', 'speed': '0', 'rpm': '1'})),
        ),
        'ZeroDivisionError',
    ),
    'settings without a checksum': (explained(SETTINGS), 'checksum'),
    'settings with another checksum': (
        explained({**seal(SETTINGS), 'rpm': '151.0'}),
        'checksum',
    ),
    'empty': (b'', 'empty'),
    'magic alone': (MCAP0_MAGIC, 'configuration'),
    'text': (b'/**:\n  ros__parameters:\n', r"b'/..:\\n r'"),
    'bytes': (b'\xff\0' * 4_096, r"b'(\\xff\\x00){4}'"),
    'misplaced': (misplaced(), '16777216'),
    'times': (whole(times=(0, 2**31 * 10**9)), '2147483648000000000 ns'),
    'nested': (whole(tight(tight(INNER) * 10)), 'record'),
    'counts': (whole(MANY), 'summary'),
    'waiting': (whole(*[MANY] * 3), 'overlap'),
    'more': (merged(0), 'summary'),
    'fewer': (merged(2), 'summary'),
    'configurations': (
        whole(metadata=[(CONFIGURATION_RECORD, encode_configuration(load('quadrilateral')))]),
        '2 configuration records',
    ),
    'short chunk': (whole(chunk(b'', INNER, len(INNER) + 1)), 'size'),
    'large chunk': (whole(chunk(b'', INNER, LARGEST + 1)), '16777216'),
    'zstd': (whole(chunk(b'zstd', hostile_logs.zeros(1, 1 << 20), 1 << 19)), 'size'),
    'lz4': (whole(chunk(b'lz4', lz4.frame.compress(bytes(1 << 20)), 1 << 19)), 'size'),
    'bz2': (whole(chunk(b'bz2', INNER, len(INNER))), "'bz2'"),
    **{str(fields)[:40]: (moved(fields), '.') for fields in FIELDS},
}


@pytest.mark.parametrize(('data', 'words'), FORGED.values(), ids=FORGED)
def test_a_foreign_or_forged_file_is_refused_in_one_line(stored, monkeypatch, data, words):
    monkeypatch.setattr('linkage_ros.log.reader._MOST_WAITING', 2000 * 500)
    path = stored(data)
    with at_most(5), pytest.raises(LogError, match=words) as caught:
        read(path)
    assert str(path) in str(caught.value)
    hostile_outcomes.log_file(path)


def test_unmodified_logs_are_accepted(stored):
    for data in (moved({}), whole(times=(0, 2**31 * 10**9 - 1))):
        assert read(stored(data)) == ([], [])
    assert [message.topic for message in read(stored(merged(1)))[1]] == ['/joint_states'] * 2


def test_false_starts_of_chunks_are_skipped(stored, out):
    head = struct.pack('<QQQII', 0, 0, LARGEST, 0, 4) + b'zstd' + struct.pack('<Q', 400_000)
    landmarks = b'\xff' + hostile_logs.record_bytes(6, head, len(head) + 400_000) * 20
    assert recover(stored(whole(landmarks)), out, overwrite=True).damaged > len(landmarks)


@pytest.mark.parametrize(
    ('opcode', 'claimed'), [(5, 1), (6, 1), (0x0C, 1), (6, 2)],
    ids=['message', 'chunk', 'metadata', 'chunk cut off'],
)  # fmt: skip
def test_huge_record_is_not_loaded_into_memory(stored, out, opcode, claimed):
    data, size = whole(), 1 << 26
    end = data.rindex(packed(DataEnd(0)))
    head = struct.pack('<QQQII', 0, 0, LARGEST, 0, 4) + b'zstd' + struct.pack('<Q', claimed * size)
    head = {5: bytes(22), 6: head, 0x0C: bytes(8)}[opcode]
    path = stored(data[:end] + struct.pack('<BQ', opcode, len(head) + claimed * size) + head)
    with path.open('ab') as file:
        length = file.truncate(file.tell() + size)  # a sparse file, which takes no disk space
    with little_memory(3 * LARGEST):
        assert recover(path, out).damaged == length - end


# ---------------------------------------------------------------- processes


def test_a_path_that_the_terminal_cannot_show_is_recorded_to(tmp_path, called):
    path = tmp_path / 'a\udcff\x1b[31m.mcap'
    for module, *words in (
        (record_module, 'quadrilateral', path, '--duration', '0.1'),
        (log_tool, 'info', path),
        (log_tool, 'verify', path),
        (log_tool, 'recover', path, f'{path}.out.mcap'),
    ):
        code, out, err = called(module, *words)
        assert (code, err) == (0, '')
        assert 'a\\udcff' in out


@pytest.mark.skipif(not Path('/dev/full').exists(), reason='needs /dev/full')
def test_a_full_disk_under_stdout_is_one_line(log):
    with Path('/dev/full').open('wb') as full:
        done = subprocess.run(
            command('log', 'info', log), stdout=full, stderr=subprocess.PIPE, text=True
        )
    assert done.returncode == 2
    assert done.stderr == 'linkage_log: [Errno 28] No space left on device\n'


def test_a_topic_of_no_name_is_not_published(stored, called):
    data = whole().replace(b'/joint_states', b'/joint/\x1b[2Jes')
    refusal = called(replay, stored(hostile_logs.resummed(data)))
    words = r"'/joint/\\x1b\[2Jes'"
    assert_refused(*refusal, words)


# ---------------------------------------------------------------- seeded cases

CASES = int(os.environ.get('LINKAGE_ROS_CASES', '100'))
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


# Fraction of the cases to run, and smallest number of different refusals.
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


# ---------------------------------------------------------------- checks of the cases


def test_good_files_pass_all_checks_of_the_cases(put, logs):
    for data in logs:
        for log in (data, hostile_logs.bare(data)):
            path = put('good.mcap', log)
            assert hostile_outcomes.log_file(path) == [''] * 4
            assert verified(path).states == 30


# ---------------------------------------------------------------- arbitrary text and bytes

ANY = st.text(max_size=30)
SCALAR = st.none() | st.booleans() | st.integers() | st.floats() | ANY | st.dates() | st.binary()
TREE = st.recursive(
    SCALAR, lambda part: st.lists(part) | st.dictionaries(ANY, part), max_leaves=20
)


@settings(max_examples=max(15, CASES // 20))
@given(TREE, st.dictionaries(st.sampled_from(hostile.NAMES) | ANY, TREE))
def test_any_tree_as_a_parameter_file(tmp_path_factory, tree, own):
    path = tmp_path_factory.getbasetemp() / 'tree.yaml'
    for content in (tree, {'linkage_node': {'ros__parameters': own}}):
        path.write_text(yaml.safe_dump(content, allow_unicode=True), errors='replace')
        hostile_outcomes.parameter_file(path)


# ---------------------------------------------------------------- bombs

BOMBS = """
import resource, sys, time
from pathlib import Path
import numpy as np
sys.path.insert(0, sys.argv[1])
import hostile, hostile_logs, hostile_outcomes as outcomes
np.seterr(all='raise')
taken = int(Path('/proc/self/statm').read_text().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (taken + 2**29, taken + 2**29))
path = Path('bomb.mcap')
for bomb in hostile_logs.bombs():
    path.write_bytes(bomb())
    outcomes.log_file(path)
for number, bomb in enumerate(hostile.yaml_bombs()):
    path.with_suffix('.yaml').write_bytes(bomb())
    begin = time.process_time()
    outcomes.parameter_file(path.with_suffix('.yaml'))
    assert time.process_time() - begin < 5, number
print('all')
"""


def test_bombs_take_little_memory(tmp_path):
    words = [sys.executable, '-c', BOMBS, str(ROOT / 'test')]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.stdout == 'all\n', done.stderr
