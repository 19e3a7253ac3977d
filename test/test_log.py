# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The MCAP log, read back by three readers that share nothing with the writer, and damaged."""

from __future__ import annotations

import errno
import json
import os
import random
import re
import signal
import stat
import struct
import subprocess
import sys
import zlib
from contextlib import suppress
from importlib.util import find_spec
from io import BytesIO
from pathlib import Path

import pytest
import yaml
from mcap.reader import make_reader
from mcap.records import Message, Metadata
from mcap.stream_reader import StreamReader
from mcap.writer import MCAP0_MAGIC, Writer
from rosbags.highlevel import AnyReader
from rosbags.interfaces import QosDurability, QosHistory, QosLiveliness, QosReliability

from linkage_ros import LogError, __version__
from linkage_ros.log.metadata import CONFIGURATION_RECORD, MOTION_RECORD, _seal
from linkage_ros.log.reader import LogReader
from linkage_ros.log.writer import FLUSH_PERIOD, LogWriter
from linkage_ros.log_tool import info, main
from linkage_ros.motion.speed_driven import SpeedMotion
from linkage_ros.parameters.as_strings import to_strings
from linkage_ros.parameters.configuration import configure, load
from linkage_ros.record import record
from linkage_ros.wire.codecs import JointStateCodec, encode_float64, encode_string
from linkage_ros.wire.topics import DRIVING_TORQUE, JOINT_STATES, ROBOT_DESCRIPTION, TOPICS

START = 1_795_000_000_000_000_000
PERIOD = 5_000_000
COUNT = 240
JOINTS = ('crank', 'coupler', 'rocker')
CONFIGURATION = configure(
    {**load('quadrilateral').parameters(), 'start_rpm': -30.0, 'crank_acceleration': 7.1}
)


def states():
    """What the log holds: (stamp, positions, velocities, efforts, torque), the same every time."""
    rng = random.Random(4)
    for tick in range(COUNT):
        rows = [tuple(rng.uniform(-1e3, 1e3) for _ in JOINTS) for _ in range(3)]
        yield START + tick * PERIOD, *rows, rng.gauss(0, 1) * 10.0 ** rng.randint(-300, 300)


def motions():
    first = SpeedMotion.begin(CONFIGURATION.drive, START)
    second = first.change(START + 77 * PERIOD + 3, 60.0)
    return first, second, second.change(START + 200 * PERIOD, -1 / 3, restamp=START - 10**12)


STATES, MOTIONS = list(states()), motions()
DESCRIPTION = '<?xml version="1.0"?>\n<robot name="ä"/>\n'


def write(path, **options):
    """Writes the states, in three chunks, with the motions between them."""
    codec = JointStateCodec(JOINTS)
    with LogWriter(path, CONFIGURATION, **{'overwrite': False} | options) as log:
        joints, torque, description = (
            log.add_topic(topic, f'/ns/{topic.name}')
            for topic in (JOINT_STATES, DRIVING_TORQUE, ROBOT_DESCRIPTION)
        )
        log.write_motion(MOTIONS[0].segment)
        log.write(description, START, encode_string(DESCRIPTION))
        for tick, (stamp, *rows, value) in enumerate(STATES):
            if tick in {80, 160}:
                log.flush()
                log.write_motion(MOTIONS[tick // 80].segment)
            log.write(joints, stamp, codec.encode(stamp, *rows))
            log.write(torque, stamp, encode_float64(value))
    return Path(path)


@pytest.fixture(scope='module')
def path(tmp_path_factory):
    return write(tmp_path_factory.mktemp('log') / 'run.mcap')


def content(path):
    """All that LogReader says about a file."""
    with LogReader(path) as log:
        about = (log.configuration, log.version, log.motions, log.topics, log.start, log.end)
        return about, list(log.messages())


def one_line(caught):
    words = str(caught.value)
    assert '\n' not in words
    assert len(words) < 500
    return words


# ---------------------------------------------------------------- other readers


def test_rosbags_reads_every_value_from_the_bare_file(path):
    got = []
    with AnyReader([path]) as bag:
        assert {(c.topic, c.msgtype, c.msgcount) for c in bag.connections} == {
            ('/ns/joint_states', 'sensor_msgs/msg/JointState', COUNT),
            ('/ns/driving_torque', 'std_msgs/msg/Float64', COUNT),
            ('/ns/robot_description', 'std_msgs/msg/String', 1),
        }
        assert (bag.start_time, bag.end_time) == (START, STATES[-1][0] + 1)
        torques = {}
        for connection, time, data in bag.messages():
            message = bag.deserialize(data, connection.msgtype)
            if connection.topic == '/ns/joint_states':
                stamp = message.header.stamp
                assert stamp.sec * 10**9 + stamp.nanosec == time
                assert message.header.frame_id == 'base_link'
                assert tuple(message.name) == JOINTS
                rows = (message.position, message.velocity, message.effort)
                got.append((time, *(tuple(row.tolist()) for row in rows)))
            elif connection.topic == '/ns/driving_torque':
                torques[time] = message.data
            else:
                assert message.data == DESCRIPTION
    assert got == [state[:4] for state in STATES]
    assert torques == {state[0]: state[4] for state in STATES}


def test_rosbags_parses_the_quality_of_service(path):
    with AnyReader([path]) as bag:
        for connection in bag.connections:
            latched = connection.topic == '/ns/robot_description'
            [qos] = connection.ext.offered_qos_profiles
            assert connection.ext.serialization_format == 'cdr'
            assert qos.history == QosHistory.KEEP_LAST
            assert qos.depth == (1 if latched else 10)
            assert qos.reliability == QosReliability.RELIABLE
            durability = QosDurability.TRANSIENT_LOCAL if latched else QosDurability.VOLATILE
            assert qos.durability == durability
            assert qos.liveliness == QosLiveliness.AUTOMATIC
            for time in (qos.deadline, qos.lifespan, qos.liveliness_lease_duration):
                assert (time.sec, time.nsec) == (9223372036, 854775807)
            assert qos.avoid_ros_namespace_conventions is False


def test_mcap_finds_profile_encodings_hashes_chunks_and_index(path):
    with path.open('rb') as stream:
        reader = make_reader(stream, validate_crcs=True)
        header, summary = reader.get_header(), reader.get_summary()
        assert (header.profile, header.library) == ('ros2', 'linkage_ros')
        assert summary.statistics.message_count == 2 * COUNT + 1
        assert {chunk.compression for chunk in summary.chunk_indexes} == {'zstd'}
        assert len(summary.chunk_indexes) == 3
        interfaces = {topic.interface.name: topic.interface for topic in TOPICS}
        for channel in summary.channels.values():
            schema = summary.schemas[channel.schema_id]
            assert channel.message_encoding == 'cdr'
            assert schema.encoding == 'ros2msg'
            assert schema.data.decode() == interfaces[schema.name].definition
            assert set(channel.metadata) == {'offered_qos_profiles', 'topic_type_hash'}
            assert channel.metadata['topic_type_hash'] == interfaces[schema.name].hash
        times = [
            (message.log_time, message.publish_time) for _, _, message in reader.iter_messages()
        ]
        assert all(log == publish for log, publish in times)


def test_every_checksum_of_the_file_is_right(path):
    with path.open('rb') as stream:
        records = list(StreamReader(stream, validate_crcs=True).records)
    assert sum(isinstance(item, Message) for item in records) == 2 * COUNT + 1


def test_mcap_reads_the_records_that_explain_the_log(path):
    with path.open('rb') as stream:
        records = [(r.name, r.metadata) for r in make_reader(stream).iter_metadata()]
    assert [name for name, _ in records] == [CONFIGURATION_RECORD] + [MOTION_RECORD] * 3
    about = dict(records[0][1])
    for metadata in (about, *(metadata for _, metadata in records[1:])):
        checksum = metadata.pop('crc32')
        assert int(checksum, 16) == zlib.crc32(json.dumps(sorted(metadata.items())).encode())
    assert about.pop('version') == __version__
    values = {name: json.loads(text) for name, text in about.items()}
    expected = CONFIGURATION.parameters()
    assert {name: tuple(v) if isinstance(v, list) else v for name, v in values.items()} == expected
    assert [int(metadata['stamp']) for _, metadata in records[1:]] == [
        motion.segment.stamp for motion in MOTIONS
    ]
    assert [json.loads(m['rpm']) for _, m in records[1:]] == [150.0, 60.0, -1 / 3]


RERUN = find_spec('rerun_cli')


@pytest.fixture(scope='module')
def rerun(tmp_path_factory):
    """Runs Rerun's native binary: its wrapper would outlive a signal."""
    if RERUN is None:
        pytest.skip('rerun-sdk is not installed')
    home = str(tmp_path_factory.mktemp('home'))
    variables = {**os.environ, 'HOME': home, 'XDG_CONFIG_HOME': home, 'NO_COLOR': '1'}
    binary = Path(RERUN.submodule_search_locations[0], 'rerun')

    def run(*arguments):
        return subprocess.run(
            [binary, *arguments], env=variables, capture_output=True, text=True, check=False
        )

    assert run('analytics', 'disable').returncode == 0
    return run


def test_rerun_finds_no_fault(path, rerun):
    checked = rerun('mcap', 'check', str(path))
    assert checked.returncode == 0, checked.stdout + checked.stderr
    rows = [line.split() for line in checked.stdout.splitlines() if '/ns/' in line]
    assert sorted((row[0], row[3], row[4]) for row in rows) == [
        ('ok', f'/ns/{topic}', '—')
        for topic in ('driving_torque', 'joint_states', 'robot_description')
    ]
    assert checked.stderr == ''


def test_rerun_finds_the_fault_of_a_cut_file(path, rerun, tmp_path):
    cut = tmp_path / 'cut.mcap'
    cut.write_bytes(path.read_bytes()[:-100])
    checked = rerun('mcap', 'check', str(cut))
    assert checked.returncode != 0 or checked.stderr


def test_rerun_reads_every_value(path):
    chunk = pytest.importorskip('rerun.chunk')
    columns = {}
    for part in chunk.McapReader(path).stream():
        batch = part.to_record_batch()
        names = batch.schema.names
        if 'Scalars:scalars' in names:
            rows = columns.setdefault(str(part.entity_path), [])
            times = batch.column('message_log_time').cast('int64').to_pylist()
            rows += zip(times, batch.column('Scalars:scalars').to_pylist(), strict=True)
            labels = batch.column('SeriesLines:names').to_pylist()
            assert all(tuple(label) == JOINTS for label in labels)
    for row, name in enumerate(('position', 'velocity', 'effort'), start=1):
        got = sorted(columns[f'/ns/joint_states/{name}'])
        assert got == [(state[0], list(state[row])) for state in STATES]


# ---------------------------------------------------------------- our reader


def test_the_log_explains_itself(path):
    with LogReader(path) as log:
        assert log.configuration == CONFIGURATION
        assert log.version == __version__
        assert (log.start, log.end) == (START, STATES[-1][0])
        assert len(log.motions) == 3
        assert log.motions == tuple(motion.segment for motion in MOTIONS)
        assert [(t.name, t.type, t.messages, t.latched) for t in log.topics] == [
            ('/ns/joint_states', 'sensor_msgs/msg/JointState', COUNT, False),
            ('/ns/driving_torque', 'std_msgs/msg/Float64', COUNT, False),
            ('/ns/robot_description', 'std_msgs/msg/String', 1, True),
        ]


def test_the_very_bytes_come_back_in_order(path):
    codec = JointStateCodec(JOINTS)
    with LogReader(path) as log:
        got = list(log.messages())
    expected = [('/ns/robot_description', START, encode_string(DESCRIPTION))]
    for stamp, *rows, value in STATES:
        expected.append(('/ns/joint_states', stamp, codec.encode(stamp, *rows)))
        expected.append(('/ns/driving_torque', stamp, encode_float64(value)))
    assert [(m.topic, m.time, m.data) for m in got] == expected


@pytest.mark.parametrize('topics', [None, [], ['/ns/driving_torque'], ['/nowhere']])
@pytest.mark.parametrize(
    'start', [None, 0, START, START + 1, START + 80 * PERIOD, STATES[-1][0], STATES[-1][0] + 1]
)
def test_topics_and_start_pick_what_a_filter_picks(path, topics, start):
    with LogReader(path) as log:
        expected = [
            message
            for message in log.messages()
            if (topics is None or message.topic in topics)
            and (start is None or message.time >= start)
        ]
        assert list(log.messages(topics, start)) == expected


def test_chunks_share_one_table_of_their_channels(path):
    with LogReader(path) as log:
        tables = [chunk.message_index_offsets for chunk in log._summary.chunks]
    assert len(tables) > 2
    assert len({id(table) for table in tables}) == len({tuple(table) for table in tables})


def test_two_readers_of_one_log_do_not_disturb_each_other(path):
    with LogReader(path) as log:
        first, second = log.messages(), log.messages(['/ns/driving_torque'])
        pairs = [(next(first), next(second)) for _ in range(COUNT)]
        assert [pair[0] for pair in pairs] == list(log.messages())[:COUNT]
        assert [pair[1] for pair in pairs] == list(log.messages(['/ns/driving_torque']))


def test_messages_come_by_log_time_whatever_the_order_of_writing(tmp_path):
    with LogWriter(tmp_path / 'run.mcap', CONFIGURATION, overwrite=False) as log:
        channel = log.add_topic(DRIVING_TORQUE, '/driving_torque')
        for stamp in (5, 3, 9, 1):
            log.write(channel, stamp, encode_float64(stamp))
            log.flush()
    with LogReader(tmp_path / 'run.mcap') as log:
        assert [message.time for message in log.messages()] == [1, 3, 5, 9]
        assert (log.start, log.end) == (1, 9)


def test_a_log_without_messages_is_complete(tmp_path):
    LogWriter(tmp_path / 'run.mcap', CONFIGURATION, overwrite=False).close()
    about, messages = content(tmp_path / 'run.mcap')
    assert about == (CONFIGURATION, __version__, (), (), 0, 0)
    assert messages == []


def test_consume_takes_messages_and_motions(tmp_path):
    with LogWriter(tmp_path / 'run.mcap', CONFIGURATION, overwrite=False) as log:
        channel = log.add_topic(DRIVING_TORQUE, '/driving_torque')
        items = [(channel, stamp, encode_float64(stamp)) for stamp in range(100)]
        log.consume([MOTIONS[0].segment, *items[:50]])
        log.consume([])
        log.consume([*items[50:], MOTIONS[1].segment])
    (_, _, read, _, _, _), messages = content(tmp_path / 'run.mcap')
    assert read == (MOTIONS[0].segment, MOTIONS[1].segment)
    assert [(message.time, message.data) for message in messages] == [item[1:] for item in items]


# ---------------------------------------------------------------- determinism


def test_the_same_log_has_the_same_bytes(path, tmp_path):
    assert write(tmp_path / 'again.mcap').read_bytes() == path.read_bytes()


def test_the_same_record_has_the_same_bytes(tmp_path):
    configuration = load('quadrilateral')
    for name in ('one.mcap', 'two.mcap'):
        assert record(configuration, tmp_path / name, duration=1.5) == 300
    one, two = ((tmp_path / name).read_bytes() for name in ('one.mcap', 'two.mcap'))
    assert one == two
    other = configure({**configuration.parameters(), 'rpm': 150.00000000000003})
    record(other, tmp_path / 'other.mcap', duration=1.5)
    assert (tmp_path / 'other.mcap').read_bytes() != one


# ---------------------------------------------------------------- existing and unwritable files


@pytest.mark.parametrize('old', [b'', MCAP0_MAGIC, None], ids=['empty', 'begun', 'log'])
def test_an_existing_file_is_kept(path, tmp_path, old):
    target = tmp_path / 'run.mcap'
    target.write_bytes(path.read_bytes() if old is None else old)
    before = target.read_bytes(), target.stat().st_mtime_ns
    with pytest.raises(LogError, match=r'run\.mcap exists already and is kept') as caught:
        LogWriter(target, CONFIGURATION, overwrite=False)
    one_line(caught)
    assert (target.read_bytes(), target.stat().st_mtime_ns) == before
    # Asked for, it is replaced.
    write(target, overwrite=True)
    assert target.read_bytes() == path.read_bytes()


def test_a_link_to_an_existing_file_is_kept(tmp_path):
    target, link = tmp_path / 'precious', tmp_path / 'run.mcap'
    target.write_bytes(b'precious')
    link.symlink_to(target)
    with pytest.raises(LogError, match='exists already and is kept'):
        LogWriter(link, CONFIGURATION, overwrite=False)
    assert target.read_bytes() == b'precious'


@pytest.mark.parametrize('what', ['folder', 'pipe', 'loop', 'socket'])
def test_what_overwriting_would_not_replace_needs_another_name(tmp_path, what):
    target = tmp_path / 'run.mcap'
    if what == 'folder':
        target.mkdir()
    elif what == 'pipe':
        os.mkfifo(target)
    elif what == 'loop':
        target.symlink_to(target)
    else:
        os.mknod(target, stat.S_IFSOCK | 0o600)
    with pytest.raises(LogError, match=r'run\.mcap is no file that could be replaced: choose an'):
        LogWriter(target, CONFIGURATION, overwrite=False)


def test_a_link_to_no_file_and_a_device_could_be_replaced(tmp_path):
    link = tmp_path / 'run.mcap'
    link.symlink_to(tmp_path / 'missing')
    for target in (link, '/dev/null'):
        with pytest.raises(LogError, match='is kept: choose another name, or set log_overwrite'):
            LogWriter(target, CONFIGURATION, overwrite=False)
        LogWriter(target, CONFIGURATION, overwrite=True).close()


def test_a_log_that_another_run_writes_is_kept(path, tmp_path):
    target, before = tmp_path / 'run.mcap', path.read_bytes()
    with LogWriter(target, CONFIGURATION, overwrite=True) as log:
        size = target.stat().st_size
        with pytest.raises(LogError, match=r'run\.mcap is being written by another run') as caught:
            LogWriter(target, CONFIGURATION, overwrite=True)
        one_line(caught)
        assert target.stat().st_size == size
        log.flush()
    write(target, overwrite=True)
    assert target.read_bytes() == before


def test_a_run_that_was_killed_leaves_its_log_to_the_next(tmp_path):
    target = tmp_path / 'run.mcap'
    program = (
        'import os, sys\n'
        'from linkage_ros.log.writer import LogWriter\n'
        'from linkage_ros.parameters.configuration import load\n'
        'log = LogWriter(sys.argv[1], load("quadrilateral"), overwrite=False)\n'
        'os.kill(os.getpid(), 9)'
    )
    done = subprocess.run([sys.executable, '-c', program, str(target)], check=False)
    assert done.returncode == -signal.SIGKILL
    write(target, overwrite=True)
    with LogReader(target) as log:
        assert log.configuration == CONFIGURATION


def test_two_runs_may_log_to_a_device():
    with (
        LogWriter('/dev/null', CONFIGURATION, overwrite=True) as one,
        LogWriter('/dev/null', CONFIGURATION, overwrite=True) as other,
    ):
        one.flush()
        other.flush()


def test_a_file_system_without_locks_is_written_as_ever(path, tmp_path, monkeypatch):
    def no_locks(*_):
        raise OSError(errno.ENOLCK, 'No locks available')

    monkeypatch.setattr('fcntl.flock', no_locks)
    target = tmp_path / 'run.mcap'
    write(target)
    assert target.read_bytes() == path.read_bytes()


@pytest.mark.parametrize('overwrite', [False, True])
@pytest.mark.parametrize('where', ['missing/run.mcap', 'file/run.mcap', 'x' * 300])
def test_an_unwritable_path_is_one_clear_error(tmp_path, where, overwrite):
    (tmp_path / 'file').write_bytes(b'')
    with pytest.raises(LogError, match=r'cannot be written: [A-Z]') as caught:
        LogWriter(tmp_path / where, CONFIGURATION, overwrite=overwrite)
    one_line(caught)
    assert [item.name for item in tmp_path.iterdir()] == ['file']


def test_a_directory_is_not_overwritten(tmp_path):
    with pytest.raises(LogError, match='cannot be written: Is a directory') as caught:
        LogWriter(tmp_path, CONFIGURATION, overwrite=True)
    one_line(caught)


@pytest.mark.skipif(not Path('/dev/full').exists(), reason='needs /dev/full')
def test_a_full_disk_is_one_clear_error():
    with pytest.raises(LogError, match=r'/dev/full.*No space left') as caught:
        LogWriter('/dev/full', CONFIGURATION, overwrite=True)
    one_line(caught)


@pytest.mark.skipif(not Path('/dev/full').exists(), reason='needs /dev/full')
def test_a_disk_that_fills_up_is_one_clear_error(tmp_path):
    log = LogWriter(tmp_path / 'run.mcap', CONFIGURATION, overwrite=False)
    channel = log.add_topic(DRIVING_TORQUE, '/driving_torque')
    full = os.open('/dev/full', os.O_WRONLY)
    os.dup2(full, log._file.stream.fileno())
    os.close(full)
    log.write(channel, 0, encode_float64(1.0))
    with pytest.raises(LogError, match=r'run\.mcap.*No space left') as caught:
        log.flush()
    one_line(caught)
    with suppress(LogError):  # which may be said again, but nothing else
        log.close()
    assert log._file.stream.closed


# ---------------------------------------------------------------- damage


def refused(data, target):
    """True where a file with these bytes is refused by a LogError, else what is read from it."""
    target.write_bytes(data)
    try:
        return content(target)
    except LogError as error:
        words = str(error)
    assert '\n' not in words
    assert len(words) < 500
    assert str(target) in words
    return True


def sections(data):
    """The records of an MCAP file by hand: (name, first byte, last byte + 1)."""
    names = {
        1: 'header',
        2: 'footer',
        3: 'schema',
        4: 'channel',
        6: 'chunk',
        7: 'message index',
        8: 'chunk index',
        11: 'statistics',
        12: 'metadata',
        13: 'metadata index',
        14: 'summary offset',
        15: 'data end',
    }
    at, found, behind = 8, [('magic', 0, 8)], False
    while at < len(data) - 8:
        opcode, length = struct.unpack_from('<BQ', data, at)
        name = names[opcode]
        if name == 'metadata':
            name = (
                'configuration' if not any(n == 'configuration' for n, *_ in found) else 'motion'
            )
        found.append((f'summary {name}' if behind else name, at, at + 9 + length))
        behind = behind or name == 'data end'
        at += 9 + length
    assert at == len(data) - 8
    return [*found, ('magic', at, at + 8)]


def spans(data, kind):
    """First and last byte + 1 of all records of a kind."""
    return [(first, end) for name, first, end in sections(data) if name == kind]


KINDS = (
    *('magic', 'header', 'configuration', 'motion', 'chunk', 'message index', 'data end'),
    *('summary schema', 'summary channel', 'summary statistics', 'summary chunk index'),
    *('summary metadata index', 'summary summary offset', 'summary footer'),
)


@pytest.fixture(scope='module')
def small(tmp_path_factory):
    """A log of few bytes, in two chunks."""
    target = tmp_path_factory.mktemp('small') / 'run.mcap'
    codec = JointStateCodec(JOINTS)
    with LogWriter(target, CONFIGURATION, overwrite=False) as log:
        joints, torque, *_, description = (log.add_topic(t, f'/{t.name}') for t in TOPICS)
        log.write_motion(MOTIONS[0].segment)
        log.write(description, START, encode_string(DESCRIPTION))
        for tick, (stamp, *rows, value) in enumerate(STATES[:12]):
            if tick == 6:
                log.flush()
                log.write_motion(MOTIONS[1].segment)
            log.write(joints, stamp, codec.encode(stamp, *rows))
            log.write(torque, stamp, encode_float64(value))
    return target


def test_the_sections_are_all_there(small):
    assert {name for name, *_ in sections(small.read_bytes())} == set(KINDS)


@pytest.mark.parametrize('kind', KINDS)
def test_a_flipped_byte_is_reported_or_does_no_harm(small, tmp_path, kind):
    """Never another exception, and never other states, settings or times than were written."""
    data, good = small.read_bytes(), content(small)
    spans = [(first, end) for name, first, end in sections(data) if name == kind]
    places = [place for first, end in spans for place in range(first, end)]
    faults = {}
    for number, place in enumerate(places[:: 1 + len(places) // 110]):
        bad = bytearray(data)
        bad[place] ^= (0x01, 0x80, 0xFF, 0x10)[number % 4]
        try:
            answer = refused(bad, tmp_path / 'bad.mcap')
            if answer is not True and answer != good:
                faults.setdefault('read other values in silence', []).append(place)
        except Exception as error:  # noqa: BLE001, to name them all
            faults.setdefault(f'{type(error).__name__}: {error}'[:60], []).append(place)
    assert faults == {}


def test_a_cut_file_is_reported_wherever_it_is_cut(small, tmp_path):
    data = small.read_bytes()
    ends = {end for _, _, end in sections(data)} - {len(data)}
    cuts = {*(len(data) * part // 30 for part in range(30)), *ends, 1, 8, 9, *range(-40, 0, 3)}
    for cut in sorted(cuts):
        assert refused(data[:cut], tmp_path / 'cut.mcap') is True, cut


def test_a_tail_of_zeros_or_of_garbage_is_reported(small, tmp_path):
    """What a crash of the machine leaves of a file whose length was written before its data."""
    data, good = small.read_bytes(), content(small)
    for keep in range(0, len(data) - 8, len(data) // 20):
        lost = len(data) - keep
        for tail in (b'\0' * lost, random.Random(keep).randbytes(lost), b'\0' * lost * 3):
            # Of the last bytes, some count for nothing.
            assert refused(data[:keep] + tail, tmp_path / 'tail.mcap') in (True, good), keep
    assert refused(data + b'\0', tmp_path / 'tail.mcap') is True


def test_the_undamaged_file_is_read(small, tmp_path):
    assert refused(small.read_bytes(), tmp_path / 'good.mcap') == content(small)


def foreign(**options):
    """An MCAP file of somebody else's."""
    stream = BytesIO()
    writer = Writer(stream, **options)
    writer.start(profile='ros2', library='other')
    schema = writer.register_schema('std_msgs/msg/Float64', 'ros2msg', b'float64 data\n')
    channel = writer.register_channel('/x', 'cdr', schema)
    writer.add_message(channel, 1, encode_float64(1.0), 1)
    return writer, stream


def other_files():
    writer, stream = foreign()
    writer.finish()
    yield 'foreign', stream.getvalue(), 'is no log of linkage_ros'
    writer, stream = foreign(use_chunking=False)
    writer.finish()
    yield 'foreign, no chunks', stream.getvalue(), 'is no log of linkage_ros'
    writer, stream = foreign(use_statistics=False, use_summary_offsets=False)
    writer.finish()
    yield 'foreign, no statistics', stream.getvalue(), 'no log|not complete'
    writer, stream = foreign()
    writer.flush()
    yield 'foreign, cut', stream.getvalue(), 'not complete'
    settings = to_strings(CONFIGURATION)
    broken = {
        'version alone': ({'version': '0.1.0'}, None),
        'setting of the future': ({**settings, 'crank.colour': '"red"'}, None),
        'setting without JSON': ({**settings, 'rpm': '150 rpm'}, None),
        'setting out of range': ({**settings, 'rpm': '1e300'}, None),
        'impossible linkage': ({**settings, 'crank.length': '9.0'}, None),
        'huge number': ({**settings, 'rpm': '1' * 5_000}, None),
        'nested deeper than Python goes': ({**settings, 'rpm': '[' * 100_000}, None),
        'motion without speed': (settings, {'stamp': '0', 'phase': '0'}),
        'motion with a zero divisor': (
            settings,
            {'stamp': '0', 'phase': '1/0', 'speed': '0', 'rpm': '1', 'acceleration': '0'},
        ),
        'motion in words': (
            settings,
            {'stamp': 'now', 'phase': '0', 'speed': '0', 'rpm': '1', 'acceleration': '0'},
        ),
        'motion that is not finite': (
            settings,
            {'stamp': '0', 'phase': '0', 'speed': '0', 'rpm': 'NaN', 'acceleration': '0'},
        ),
        'motion that is infinite': (
            settings,
            {'stamp': '0', 'phase': '0', 'speed': '0', 'rpm': '1', 'acceleration': 'Infinity'},
        ),
    }
    for name, (about, motion) in broken.items():
        writer, stream = foreign()
        # With a right checksum: whatever wrote it, meant it.
        writer.add_metadata(CONFIGURATION_RECORD, _seal(about))
        if motion is not None:
            writer.add_metadata(MOTION_RECORD, _seal(motion))
        writer.finish()
        yield name, stream.getvalue(), '.'
    for name, about in {
        'settings without a checksum': settings,
        'settings with another checksum': {**_seal(settings), 'rpm': '151.0'},
    }.items():
        writer, stream = foreign()
        writer.add_metadata(CONFIGURATION_RECORD, about)
        writer.finish()
        yield name, stream.getvalue(), 'checksum is wrong'
    cut, other = 'is damaged or not complete: linkage_log recover', '; name a log of linkage_ros'
    begins = 'cannot be used: it is no MCAP file: it begins with'
    yield 'empty', b'', f'cannot be used: it is empty{other}'
    yield 'magic alone', b'\x89MCAP0\r\n', cut
    yield 'magic twice', b'\x89MCAP0\r\n' * 2, cut
    yield 'text', b'/**:\n  ros__parameters:\n    rpm: 1.0\n' * 10, rf"{begins} '/..:\\n r'{other}"
    yield 'ROS 1 bag', b'#ROSBAG V2.0\n' + bytes(4_096), f"{begins} '#ROSBAG '{other}"
    yield 'SQLite bag', b'SQLite format 3\0' + bytes(4_096), f"{begins} 'SQLite f'{other}"
    yield 'bytes', b'\xff\0' * 4_096, rf"{begins} '(\\xff\\x00){{4}}'{other}"


@pytest.mark.parametrize(
    ('data', 'words'), [pytest.param(data, words, id=name) for name, data, words in other_files()]
)
def test_other_files_are_refused_in_one_line(tmp_path, data, words):
    target = tmp_path / 'other.mcap'
    target.write_bytes(data)
    with pytest.raises(LogError, match=words) as caught:
        content(target)
    assert str(target) in one_line(caught)


@pytest.mark.parametrize('data', ['', 'a log'])
def test_a_pipe_is_told_as_one_whatever_comes_out(path, tmp_path, data):
    os.mkfifo(pipe := tmp_path / 'pipe.mcap')
    end = os.open(pipe, os.O_RDWR | os.O_NONBLOCK)  # so that both ends are open
    try:
        os.write(end, path.read_bytes()[:4096] if data else b'')
        with pytest.raises(LogError, match=r'pipe\.mcap cannot be used: it is a pipe, .*; name a'):
            LogReader(pipe)
    finally:
        os.close(end)


@pytest.mark.parametrize('arguments', [['info', ''], ['verify', ''], ['recover', 'run.mcap', '']])
def test_an_empty_name_is_no_folder(monkeypatch, capsys, arguments):
    monkeypatch.setattr(sys, 'argv', ['linkage_log', *arguments])
    with pytest.raises(SystemExit, match='2'):
        main()
    assert ".mcap: '' is no path: name one; see linkage_log" in capsys.readouterr().err


@pytest.mark.parametrize('where', ['.', 'missing.mcap', 'file/run.mcap', 'x' * 300])
def test_what_cannot_be_opened_is_refused_in_one_line(tmp_path, where):
    (tmp_path / 'file').write_bytes(b'')
    with pytest.raises(LogError, match=r'cannot be read: [A-Z]') as caught:
        LogReader(tmp_path / where)
    one_line(caught)


def test_damage_is_reported_while_iterating(path, tmp_path):
    """The summary of this file is whole; only the last chunk's checksum tells."""
    data = bytearray(path.read_bytes())
    _, first, end = [span for span in sections(bytes(data)) if span[0] == 'chunk'][-1]
    data[(first + end) // 2] ^= 0xFF
    target = tmp_path / 'bad.mcap'
    target.write_bytes(data)
    with pytest.raises(LogError, match='damaged') as caught:
        content(target)
    one_line(caught)


# ---------------------------------------------------------------- killed

KILLED = """
import itertools, sys, time
from linkage_ros.parameters.configuration import load
from linkage_ros.log.writer import LogWriter
from linkage_ros.wire.codecs import encode_float64
from linkage_ros.wire.topics import DRIVING_TORQUE
from linkage_ros.motion.speed_driven import SpeedMotion

configuration = load('quadrilateral')
log = LogWriter(sys.argv[1], configuration, overwrite=False)
channel = log.add_topic(DRIVING_TORQUE, '/driving_torque')
log.write_motion(SpeedMotion.begin(configuration.drive, 0).segment)
if sys.argv[2] == 'never':
    log.flush = lambda: None
for batch in itertools.count():
    before = time.monotonic()
    log.consume([(channel, n, encode_float64(n)) for n in range(10 * batch, 10 * batch + 10)])
    print(10 * batch + 10, before, time.monotonic(), flush=True)
    time.sleep(0.005)
"""


def killed(target, flushing):
    """What a killed writer said it wrote: rows of (messages, before, after)."""
    command = [sys.executable, '-c', KILLED, target, flushing]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        rows = []
        for line in process.stdout:
            count, before, after = line.split()
            rows.append((int(count), float(before), float(after)))
            if rows[-1][1] - rows[0][1] > 3.5 * FLUSH_PERIOD:
                process.send_signal(signal.SIGKILL)
                break
        said, _ = process.communicate()
    assert process.returncode == -signal.SIGKILL
    for line in said.splitlines(keepends=True):
        if line.endswith('\n'):
            count, before, after = line.split()
            rows.append((int(count), float(before), float(after)))
    return rows


def left(target):
    """Every record that a plain walk through the file finds before it breaks off."""
    found = []
    with target.open('rb') as stream, suppress(Exception):
        for item in StreamReader(stream).records:
            found.append(item)  # noqa: PERF402, extend says nothing of what came before an error
    return found


def test_a_killed_writer_loses_the_last_flush_period_at_most(tmp_path):
    target = tmp_path / 'run.mcap'
    rows = killed(target, 'flush')
    # A batch that was complete a flush period before the last one began has been flushed.
    due = max(count for count, _, after in rows if after + FLUSH_PERIOD <= rows[-1][1])
    records = left(target)
    messages = [item for item in records if isinstance(item, Message)]
    assert due > 0
    assert len(messages) >= due
    assert [m.log_time for m in messages] == list(range(len(messages)))
    assert all(m.data == encode_float64(m.log_time) for m in messages)
    names = [item.name for item in records if isinstance(item, Metadata)]
    assert names == [CONFIGURATION_RECORD, MOTION_RECORD]
    with pytest.raises(LogError, match='not complete') as caught:
        LogReader(target)
    one_line(caught)


def test_a_writer_that_never_flushes_loses_everything(tmp_path):
    target = tmp_path / 'run.mcap'
    rows = killed(target, 'never')
    assert rows[-1][0] > 0
    assert not any(isinstance(item, Message) for item in left(target))


def test_a_log_is_no_program(tmp_path):
    before = os.umask(0o022)
    try:
        LogWriter(tmp_path / 'run.mcap', configure({'rpm': 60.0}), overwrite=False).close()
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / 'run.mcap').stat().st_mode) == 0o644


@pytest.mark.parametrize('preset', ['compressor', 'wind_pump'])
def test_the_configuration_that_info_prints_makes_the_same_run(tmp_path, preset):
    record(load(preset), path := tmp_path / 'run.mcap', duration=0.1)
    with LogReader(path) as log:
        lines = list(info(log))
        text = '\n'.join(lines[lines.index('configuration:') + 1 :])
        assert configure(yaml.safe_load(text)) == log.configuration
    assert re.search(r'^  crank\.length: \S+  # m$', text, re.MULTILINE)


@pytest.mark.parametrize('old', [b'/**:\n  ros__parameters:\n', b'x', MCAP0_MAGIC[:4]])
def test_what_is_no_log_is_never_overwritten(tmp_path, old):
    (target := tmp_path / 'p.yaml').write_bytes(old)
    with pytest.raises(LogError, match=r'p\.yaml is no log and is kept: choose another name'):
        LogWriter(target, CONFIGURATION, overwrite=True)
    assert target.read_bytes() == old
