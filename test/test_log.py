# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The MCAP log: what the mcap library finds in it, our reader, and damaged files.

test_foreign_readers.py compares the decoded messages of other readers.
"""

import errno
import json
import os
import random
import re
import stat
import struct
import tracemalloc
import zlib
from pathlib import Path

import pytest
import yaml
from hostile_logs import resummed
from joint_codec import encode_float64
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.writer import MCAP0_MAGIC
from mcap_records import records_of, write_records
from one_linkage import alone, run_alone, templates_of
from ros_harness import CODEC, assert_refused

from linkage_ros import LogError, __version__
from linkage_ros.log.mcap_writer import _BLOCK_SIZE
from linkage_ros.log.reader import LogReader
from linkage_ros.log.records import CONFIGURATION_RECORD, END_RECORD, MOTION_RECORD, LoggedSegment
from linkage_ros.log.recover import recover
from linkage_ros.log.rows import LoggedState, RowLayouts
from linkage_ros.log.writer import LogWriter
from linkage_ros.messages.cdr import encode_string
from linkage_ros.messages.topics import (
    DRIVING_TORQUE,
    JOINT_COMMANDS,
    JOINT_STATES,
    ROBOT_DESCRIPTION,
)
from linkage_ros.programs import log_commands, log_tool, replay
from linkage_ros.programs.record import record
from linkage_ros.run.states import Simulator
from linkage_ros.settings.configuration import configure, load
from linkage_ros.units import NS_PER_MS

START = 1_795_000_000_000_000_000
PERIOD = 5_000_000
COUNT = 24
CONFIGURATION = configure(
    {**load('quadrilateral').parameters(), 'start_rpm': -30.0, 'crank_acceleration': 7.1}
)
DESCRIPTION = '<?xml version="1.0"?>\n<robot name="ä"/>\n'
JOINTS, TORQUE, ROBOT = '/ns/joint_states', '/ns/driving_torque', '/ns/robot_description'


def motions():
    first = CONFIGURATION.drive.begin(START, None)
    second = first.change(START + 7 * PERIOD + 3, 60.0)
    return first, second, second.change(START + 20 * PERIOD, -1 / 3, restamp=START - 10**12)


def contents():
    """Returns the contents of the log, always the same: (topic, stamp, data)."""
    rng = random.Random(4)
    yield ROBOT, START, encode_string(DESCRIPTION)
    for stamp in range(START, START + COUNT * PERIOD, PERIOD):
        rows = [tuple(rng.uniform(-1e3, 1e3) for _ in range(3)) for _ in range(3)]
        yield JOINTS, stamp, CODEC.encode(stamp, *rows)
        yield TORQUE, stamp, encode_float64(rng.gauss(0, 1) * 10.0 ** rng.randint(-300, 300))


MOTIONS, CONTENTS = [motion.segment for motion in motions()], list(contents())


def write(path, *, overwrite=False):
    """Writes the contents in three chunks, with the motions between them."""
    with LogWriter(path, CONFIGURATION, overwrite=overwrite) as log:
        topics = JOINT_STATES, DRIVING_TORQUE, ROBOT_DESCRIPTION
        channels = {
            f'/ns/{topic.name}': log.add_topic(topic, f'/ns/{topic.name}') for topic in topics
        }
        log.write_motion(MOTIONS[0])
        for number, (topic, stamp, data) in enumerate(CONTENTS):
            if number in {16, 32}:
                log.flush()
                log.write_motion(MOTIONS[number // 16])
            log.write(channels[topic], stamp, data)
    return Path(path)


@pytest.fixture(scope='module')
def path(tmp_path_factory):
    return write(tmp_path_factory.mktemp('log') / 'run.mcap')


def content(path):
    """Returns everything that LogReader reads from a file."""
    log = LogReader(path)
    about = (log.configuration, log.version, log.motions[''], log.topics, log.start, log.end)
    return about, list(log.messages())


def written(log):
    """Returns the messages of a log in the order of writing; none is on these channels."""
    simulator, found = Simulator(CONFIGURATION.only), []
    numbers = {topic: 200 + i for i, topic in enumerate(templates_of(simulator).topics)}
    layouts = RowLayouts(run_alone(simulator).templates, numbers)
    assert not list(log.rows(layouts, found.append))
    return found


def test_a_long_log_takes_little_memory(tmp_path):
    with LogWriter(tmp_path / 'run.mcap', CONFIGURATION, overwrite=False) as log:
        channel, batches = log.add_topic(DRIVING_TORQUE, TORQUE), 3000
        batch = LoggedSegment(MOTIONS[0]), (channel, START, encode_float64(1.0))
        log.consume(batch)
        tracemalloc.start()
        try:
            before, _ = tracemalloc.get_traced_memory()
            for _ in range(batches):
                log.consume(batch)
            after, _ = tracemalloc.get_traced_memory()
        finally:
            tracemalloc.stop()
    assert after - before < 40 * batches + 2 * _BLOCK_SIZE  # 134 in the index of the file
    assert len(LogReader(tmp_path / 'run.mcap').motions['']) == batches + 1


# ---------------------------------------------------------------- other readers


def test_mcap_reads_the_records_that_explain_the_log(path):
    with path.open('rb') as stream:
        reader = make_reader(stream)
        header, chunks = reader.get_header(), reader.get_summary().chunk_indexes
        records = [(r.name, r.metadata) for r in reader.iter_metadata()]
    assert (header.profile, header.library) == ('ros2', 'linkage_ros')
    assert [chunk.compression for chunk in chunks] == ['zstd'] * 3
    names = [CONFIGURATION_RECORD, *[MOTION_RECORD] * 3, END_RECORD]
    assert [name for name, _ in records] == names
    about, *moved, end = (metadata for _, metadata in records)
    for metadata in (about, *moved, end):
        checksum = metadata.pop('crc32')
        assert int(checksum, 16) == zlib.crc32(json.dumps(sorted(metadata.items())).encode())
    assert about.pop('version') == __version__
    values = {name: json.loads(text) for name, text in about.items()}
    expected = CONFIGURATION.parameters()
    assert {name: tuple(v) if isinstance(v, list) else v for name, v in values.items()} == expected
    assert end == {'messages': str(len(CONTENTS))}
    assert [int(metadata['stamp']) for metadata in moved] == [m.stamp for m in MOTIONS]
    assert [json.loads(metadata['rpm']) for metadata in moved] == [150.0, 60.0, -1 / 3]


# ---------------------------------------------------------------- our reader


def test_log_contains_its_definitions_and_returns_the_same_bytes_in_order(path):
    log = LogReader(path)
    assert (log.configuration, log.version) == (CONFIGURATION, __version__)
    assert (log.start, log.end) == (START, CONTENTS[-1][1])
    assert list(log.motions['']) == MOTIONS
    assert [(t.name, t.type, t.messages, t.latched) for t in log.topics] == [
        (JOINTS, 'sensor_msgs/msg/JointState', COUNT, False),
        (TORQUE, 'std_msgs/msg/Float64', COUNT, False),
        (ROBOT, 'std_msgs/msg/String', 1, True),
    ]
    assert [(m.topic, m.time, m.data) for m in log.messages()] == CONTENTS


@pytest.mark.parametrize('topics', [None, [], [TORQUE], ['/nowhere']])
@pytest.mark.parametrize('start', [None, START + 1, START + 8 * PERIOD])
def test_topics_and_start_select_like_a_filter(path, topics, start):
    log = LogReader(path)
    expected = (
        message
        for message in log.messages()
        if (topics is None or message.topic in topics) and (start is None or message.time >= start)
    )
    # Two concurrent iterations do not interfere.
    found = zip(log.messages(topics, start), expected, strict=True)
    assert all(message == due for message, due in found)


def test_messages_come_by_log_time_whatever_the_order_of_writing(tmp_path):
    with LogWriter(tmp_path / 'run.mcap', CONFIGURATION, overwrite=False) as log:
        channel = log.add_topic(DRIVING_TORQUE, TORQUE)
        for stamp in (5, 3, 9, 1):
            log.write(channel, stamp, encode_float64(stamp))
            log.flush()
    about, messages = content(tmp_path / 'run.mcap')
    assert [message.time for message in messages] == [1, 3, 5, 9]
    assert about[-2:] == (1, 9)


def test_every_batch_is_written_to_the_file_at_once(tmp_path):
    path, saved = tmp_path / 'run.mcap', tmp_path / 'saved.mcap'
    with LogWriter(path, CONFIGURATION, overwrite=False) as log:
        channel = log.add_topic(DRIVING_TORQUE, TORQUE)
        items = [(channel, stamp, encode_float64(stamp)) for stamp in range(60)]
        for number in range(2):
            log.consume([LoggedSegment(MOTIONS[0]), *items[30 * number : 30 * number + 30]])
            assert recover(path, saved, overwrite=True).messages == 30 * (number + 1)
    about, messages = content(path)
    assert len(about[2]) == 2
    assert [(message.time, message.data) for message in messages] == [item[1:] for item in items]


@pytest.mark.parametrize('start', [0, START])
def test_rows_have_the_bytes_that_the_library_would_write(tmp_path, start):
    """Includes chunks, indexes, counts and times, message by message, in several chunks."""
    simulator, path = Simulator(load('quadrilateral').only), tmp_path / 'run.mcap'
    stamps = [start + simulator.ticks.elapsed(tick) for tick in range(6000)]
    with LogWriter(path, alone(simulator.linkage), overwrite=False) as log:
        log.add_states(run_alone(simulator).templates, lambda topic: topic.name)
        found = simulator.begin(start).at_all(stamps)
        row = run_alone(simulator).row({'': simulator.part(found)})
        log.write_states(stamps, stamps, row)
    write_records(tmp_path / 'other.mcap', records_of(path), chunk_size=1 << 30,
                  enable_data_crcs=True)  # fmt: skip
    assert (tmp_path / 'other.mcap').read_bytes() == path.read_bytes()


def test_states_and_messages_of_a_run_are_written_in_their_order(tmp_path):
    """As many states as commands, as with a controller, in several chunks."""
    simulator, path = Simulator(load('quadrilateral').only), tmp_path / 'run.mcap'
    robot, motion = run_alone(simulator), simulator.begin(0)
    templates = robot.templates.of(('',))
    with LogWriter(path, alone(simulator.linkage), overwrite=False) as log:
        log.add_states(robot.templates, lambda topic: topic.name)
        channel = log.add_topic(JOINT_COMMANDS, '/joint_commands')
        items, due = [LoggedSegment(motion.segment)], []
        for stamp in range(0, 4000 * NS_PER_MS, NS_PER_MS):
            messages = templates.pack(stamp, robot.row({'': simulator.part(motion.at(stamp))}))
            command = channel, stamp + 5, encode_float64(stamp)
            items += LoggedState(stamp, messages), command
            due += [(stamp, messages[place]) for place in templates.slices.values()]
            due.append(command[1:])
        log.consume(items[:3001])
        log.consume(items[3001:])
    assert [(message.time, message.data) for message in content(path)[1]] == due
    write_records(tmp_path / 'other.mcap', records_of(path), chunk_size=1 << 30,
                  enable_data_crcs=True)  # fmt: skip
    assert (tmp_path / 'other.mcap').read_bytes() == path.read_bytes()


@pytest.mark.parametrize('preset', ['compressor', 'wind_pump'])
def test_the_configuration_that_info_prints_makes_the_same_run(tmp_path, preset):
    record(load(preset), path := tmp_path / 'run.mcap', duration=0.1)
    log = LogReader(path)
    lines = list(log_commands.info(log))
    text = '\n'.join(lines[lines.index('configuration:') + 1 :])
    assert configure(yaml.safe_load(text)) == log.configuration
    assert re.search(r'^  crank\.length: \S+  # m$', text, re.MULTILINE)


# ---------------------------------------------------------------- existing and unwritable files


def refused(target, words, *, overwrite):
    with pytest.raises(LogError, match=words):
        LogWriter(target, CONFIGURATION, overwrite=overwrite)


@pytest.mark.parametrize('old', [b'', MCAP0_MAGIC, None], ids=['empty', 'begun', 'log'])
def test_existing_file_is_kept_unless_overwriting(path, tmp_path, old):
    target, link = tmp_path / 'run.mcap', tmp_path / 'link.mcap'
    link.symlink_to(target)
    target.write_bytes(path.read_bytes() if old is None else old)
    before = target.read_bytes(), target.stat().st_mtime_ns
    refused(target, r'run\.mcap already exists', overwrite=False)
    refused(link, 'already exists', overwrite=False)
    assert (target.read_bytes(), target.stat().st_mtime_ns) == before
    assert write(target, overwrite=True).read_bytes() == path.read_bytes()


EXISTS, OTHER_FILE = 'already exists: choose another name', 'is not a log and was not replaced'
KEPT = {  # what is at the path, whether to replace it, and the expected error
    'parameters': (lambda p: p.write_bytes(b'/**:\n  ros__parameters:\n'), True, OTHER_FILE),
    'text': (lambda p: p.write_bytes(b'x'), True, OTHER_FILE),
    'half': (lambda p: p.write_bytes(MCAP0_MAGIC[:4]), True, OTHER_FILE),
    'folder': (Path.mkdir, False, 'is a folder: add a file name'),
    'folder to replace': (Path.mkdir, True, 'is a folder: add a file name'),
    'pipe': (os.mkfifo, False, EXISTS),
    'pipe to replace': (os.mkfifo, True, 'is a pipe: write the log to a regular file'),
    'loop': (lambda p: p.symlink_to(p), False, EXISTS),
    'socket': (lambda p: os.mknod(p, stat.S_IFSOCK | 0o600), False, EXISTS),
    'link': (lambda p: p.symlink_to('missing'), False, EXISTS),
    'device': (lambda p: p.symlink_to('/dev/null'), False, EXISTS),
}  # fmt: skip


@pytest.mark.parametrize(('make', 'overwrite', 'words'), KEPT.values(), ids=KEPT)
def test_existing_paths_are_kept_with_one_line(tmp_path, make, overwrite, words):
    make(tmp_path / 'run.mcap')
    before = os.lstat(tmp_path / 'run.mcap')
    refused(tmp_path / 'run.mcap', rf'run\.mcap {words}', overwrite=overwrite)
    after = os.lstat(tmp_path / 'run.mcap')
    # All but the time of reading, which may be in the next second.
    assert (after[:7], after.st_mtime_ns) == (before[:7], before.st_mtime_ns)


def test_a_pipe_with_a_reader_is_refused_by_its_path(tmp_path):
    os.mkfifo(pipe := tmp_path / 'run.mcap')
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    try:
        refused(pipe, r'run\.mcap is a pipe', overwrite=True)
        assert stat.S_ISFIFO(os.lstat(pipe).st_mode)
    finally:
        os.close(reader)


def test_device_can_be_written_by_two_runs_at_once(tmp_path):
    with LogWriter('/dev/null', CONFIGURATION, overwrite=True) as one:
        LogWriter('/dev/null', CONFIGURATION, overwrite=True).close()
        one.flush()


def test_a_log_that_another_run_writes_is_kept_until_that_run_ends(path, tmp_path):
    target = tmp_path / 'run.mcap'
    with LogWriter(target, CONFIGURATION, overwrite=True) as log:
        size = target.stat().st_size
        refused(target, r'run\.mcap is being written by another run', overwrite=True)
        assert target.stat().st_size == size
        log.flush()
    assert write(target, overwrite=True).read_bytes() == path.read_bytes()


def test_file_system_without_locks_can_be_written(path, tmp_path, monkeypatch):
    def no_locks(*_):
        raise OSError(errno.ENOLCK, 'No locks available')

    monkeypatch.setattr('fcntl.flock', no_locks)
    assert write(tmp_path / 'run.mcap').read_bytes() == path.read_bytes()


@pytest.mark.parametrize('where', ['missing/a/run.mcap', 'file/run.mcap', 'x' * 300 + '.mcap'])
def test_a_path_that_cannot_be_written_or_read_is_one_clear_error(tmp_path, where):
    (tmp_path / 'file').write_bytes(b'')
    refused(
        tmp_path / where,
        r'cannot be written: (there is no folder .*/missing$|[A-Z])',
        overwrite=True,
    )
    with pytest.raises(LogError, match=r'cannot be read: [A-Z]'):
        LogReader(tmp_path / where)
    assert [item.name for item in tmp_path.iterdir()] == ['file']


# ---------------------------------------------------------------- damage

KINDS = {
    1: 'header', 2: 'footer', 3: 'schema', 4: 'channel', 6: 'chunk', 7: 'message index',
    8: 'chunk index', 11: 'statistics', 12: 'metadata', 13: 'metadata index',
    14: 'summary offset', 15: 'data end',
}  # fmt: skip


def sections(data):
    """Parses the records of an MCAP file by hand: (kind, first byte, last byte + 1)."""
    at, found = 8, []
    while at < len(data) - 8:
        opcode, length = struct.unpack_from('<BQ', data, at)
        found.append((KINDS[opcode], at, at + 9 + length))
        at += 9 + length
    return found


def spans(data, kind):
    """Returns first byte and last byte + 1 of all records of a kind."""
    return [(first, end) for name, first, end in sections(data) if name == kind]


@pytest.fixture
def answer(path, tmp_path):
    """Reads bytes; returns 'good' if they equal the original, 'refused' after a one-line error."""
    good, target = content(path), tmp_path / 'bad.mcap'

    def read(data):
        target.write_bytes(data)
        try:
            return 'good' if content(target) == good else 'other values'
        except LogError as error:
            return 'refused' if str(target) in str(error) else str(error)

    assert read(path.read_bytes()) == 'good'
    return read


# In these records, most bytes are irrelevant.
UNREAD = {'header', 'message index', 'summary offset', 'data end'}


def test_flipped_byte_is_reported_or_harmless(path, answer):
    """No other exception is raised, and no other states, settings or times are returned."""
    data = path.read_bytes()
    found = {kind: set() for kind in KINDS.values()}
    for kind, first, end in sections(data):
        for number, place in enumerate(range(first, end, 1 + (end - first) // 10)):
            bad = bytearray(data)
            bad[place] ^= (0x01, 0x80, 0xFF, 0x10)[number % 4]
            found[kind].add(answer(bad))
    for kind, answers in found.items():
        assert answers, kind
        assert answers <= {'good', 'refused'}, kind
        assert 'refused' in answers or kind in UNREAD, kind


def test_a_copy_whose_summary_lacks_the_channels_is_refused(path, tmp_path):
    records = records_of(path)
    copy = write_records(tmp_path / 'copy.mcap', records, repeat_channels=False)
    with pytest.raises(LogError, match='its index leaves out parts of it'):
        LogReader(copy)
    assert LogReader(write_records(copy, records)).topics


@pytest.mark.parametrize('moment', [START + COUNT * PERIOD, 1 << 63])
def test_messages_outside_the_indexed_times_of_their_chunk_are_refused(path, answer, moment):
    data = path.read_bytes()
    (at,) = struct.unpack_from('<Q', data, len(data) - 28)  # the summary
    while data[at] != Opcode.CHUNK_INDEX:
        at += 9 + struct.unpack_from('<Q', data, at + 1)[0]
    forged = data[: at + 9] + struct.pack('<Q', moment) + data[at + 17 :]
    assert answer(resummed(forged)) == 'refused'


def test_a_cut_file_and_a_tail_of_zeros_or_of_garbage_are_reported(path, answer):
    """A crash of the machine can leave a file whose length was written before its data."""
    data = path.read_bytes()
    cuts = {*(len(data) * part // 30 for part in range(30)), 1, 8, 9, *range(-40, 0, 3)}
    for cut in (*cuts, *(end for _, _, end in sections(data))):
        assert answer(data[:cut]) == 'refused', cut
    for keep in range(0, len(data) - 8, len(data) // 10):
        lost = len(data) - keep
        for tail in (bytes(lost), random.Random(keep).randbytes(lost), bytes(3 * lost)):
            # Some of the last bytes are irrelevant.
            assert answer(data[:keep] + tail) in {'refused', 'good'}, keep
    assert answer(data + b'\0') == 'refused'


@pytest.mark.parametrize(
    ('module', 'arguments', 'words'),
    [
        (replay, [__file__], "is not an MCAP file on a disk: it starts with b'# Copyri'"),
        (log_tool, ['info', '\x1b[31m'], r'.x1b\[31m cannot be read: No such file'),
    ],
)
def test_foreign_file_is_refused(called, module, arguments, words):
    assert_refused(*called(module, *arguments), words)


def test_log_of_a_failed_writer_needs_recovery(tmp_path, monkeypatch):
    """A log that does not contain the whole run must not look complete."""
    path, whole = tmp_path / 'run.mcap', LogWriter.write_states
    batches = []

    def write_states(self, *values):
        batches.append(len(values[0]))
        if len(batches) == 3:
            raise MemoryError
        whole(self, *values)

    monkeypatch.setattr(LogWriter, 'write_states', write_states)
    with pytest.raises(MemoryError):
        record(load('quadrilateral'), path, duration=60.0)
    with pytest.raises(LogError, match='recover'):
        LogReader(path)
    assert recover(path, tmp_path / 'saved.mcap').messages >= 3 * sum(batches[:2])


def test_log_of_a_failed_thread_needs_recovery(tmp_path, monkeypatch):
    path = tmp_path / 'run.mcap'
    log = LogWriter(path, CONFIGURATION, overwrite=False)
    channel = log.add_topic(DRIVING_TORQUE, '/driving_torque')
    log.consume([(channel, START, encode_float64(1.0))])
    monkeypatch.setattr(log, '_write_records', lambda _: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        log.consume([(channel, START + 1, encode_float64(2.0))])
    log.close()
    with pytest.raises(LogError, match='recover'):
        LogReader(path)
    assert recover(path, tmp_path / 'saved.mcap').messages == 1
