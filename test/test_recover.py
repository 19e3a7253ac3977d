# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Recovery of damaged logs: keeps all valid data, and discards everything invalid."""

import random
import re
import resource
import struct
from io import BytesIO
from itertools import accumulate, pairwise
from pathlib import Path
from typing import NamedTuple

import pytest
from hostile_logs import packed, record_bytes, tight
from hostile_logs import whole as whole_log
from live_logs import live, ticks
from mcap.records import Channel, Chunk, Message, Metadata
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.writer import MCAP0_MAGIC, Writer
from ros_harness import assert_refused, report_of
from test_log import spans, written
from test_verify import CHANGES

from linkage_ros import LogError
from linkage_ros.log.reader import LogReader
from linkage_ros.log.records import encode_configuration
from linkage_ros.log.recover import recover
from linkage_ros.log.writer import LogWriter
from linkage_ros.programs import log_tool
from linkage_ros.programs.record import record
from linkage_ros.settings.configuration import configure, load


class Good(NamedTuple):
    """An undamaged log: its contents, and the number of messages in its first n chunks."""

    path: Path
    data: bytes
    messages: list
    chunks: list
    counts: list


def described(path):
    with path.open('rb') as stream:
        records = list(StreamReader(stream, emit_chunks=True).records)
    chunks = (record for record in records if isinstance(record, Chunk))
    counts = (sum(isinstance(r, Message) for r in breakup_chunk(chunk)) for chunk in chunks)
    data = path.read_bytes()
    return Good(path, data, messages(path), spans(data, 'chunk'), [0, *accumulate(counts)])


@pytest.fixture(scope='module')
def whole(tmp_path_factory):
    """Returns a live log of seven chunks with seven segments of motion."""
    path = tmp_path_factory.mktemp('whole') / 'run.mcap'
    return described(live(path, load('quadrilateral'), CHANGES))


@pytest.fixture(scope='module')
def several(tmp_path_factory):
    """Returns a record of several chunks, larger than those of a live run."""
    path = tmp_path_factory.mktemp('several') / 'run.mcap'
    record(load('compressor'), path, duration=12.0)
    return described(path)


def messages(path):
    log = LogReader(path)
    return written(log)


@pytest.fixture
def recovered(tmp_path):
    """Recovers bytes; returns the result, the saved messages, and their verification."""
    path, out = tmp_path / 'broken.mcap', tmp_path / 'out.mcap'

    def save(data):
        path.write_bytes(data)
        done = recover(path, out, overwrite=True)
        saved = messages(out)
        assert done.messages == len(saved)
        return done, saved, report_of(out)

    return save


# ---------------------------------------------------------------- complete logs


def test_complete_logs_come_back_byte_for_byte(tmp_path, whole, several):
    empty, out = tmp_path / 'empty.mcap', tmp_path / 'out.mcap'
    LogWriter(empty, load('quadrilateral'), overwrite=False).close()
    assert len(several.chunks) > 1
    for log in (whole, described(empty), several):
        done = recover(log.path, out, overwrite=True)
        assert out.read_bytes() == log.data == log.path.read_bytes()
        assert (done.messages, done.places, done.unknown) == (len(log.messages), 0, 0)
    assert done.duration == pytest.approx(12.0, abs=0.01)
    assert {item.name for item in tmp_path.iterdir()} == {'empty.mcap', 'out.mcap'}


# ---------------------------------------------------------------- truncated logs


def test_all_whole_chunks_before_a_cut_are_saved_and_verify(tmp_path, whole, recovered):
    data, chunks = whole.data, whole.chunks
    (_, first), *_, (_, end) = spans(data, 'metadata')
    cuts = {first, *range(first, len(data), len(data) // 8), len(data) - 9, len(data) - 1}
    cuts |= {chunks[3][0] + n for n in (0, 1, 8, 9, 40, 60)} | {chunks[-1][1]}
    for cut in sorted(cuts):
        done, saved, report = recovered(data[:cut])
        assert (saved, report.difference) == (whole.messages[: len(saved)], '')
        assert len(saved) >= whole.counts[sum(end <= cut for _, end in chunks)]
        assert done.places <= 1
        assert done.damaged < max(end - start for start, end in chunks)
        assert (LogReader(tmp_path / 'out.mcap').lost is None) == (cut < end)
        with pytest.raises(LogError, match='its run was killed or is still running; linkage_log'):
            LogReader(tmp_path / 'broken.mcap')


@pytest.mark.parametrize('tail', [bytes, random.Random(4).randbytes], ids=['zeros', 'garbage'])
def test_tail_that_was_not_written_to_disk_is_omitted(whole, recovered, tail):
    cut = whole.chunks[4][0] + 100
    done, saved, _ = recovered(whole.data[:cut] + tail(len(whole.data) - cut))
    assert saved == whole.messages[: whole.counts[4]]
    assert done.places > 0


# ---------------------------------------------------------------- damaged logs


def without(log, *lost):
    """Returns the messages of a log, except those of some chunks."""
    kept = [span for n, span in enumerate(pairwise(log.counts)) if n not in lost]
    return [message for first, end in kept for message in log.messages[first:end]]


def in_chunk(number, where):
    """Finds a byte of a chunk, by offset or by fraction of its length."""

    def place(log):
        start, end = log.chunks[number]
        return start + (where if isinstance(where, int) else int(where * (end - start)))

    return place


def in_record(kind, number, offset):
    return lambda log: spans(log.data, kind)[number][0] + offset


OPCODE, LENGTH, CHECKSUM, COMPRESSION, LAST = 0, 2, 33, 42, 5
# Position of a damaged byte, its flipped bits, the lost chunks, and whether a motion is lost.
DAMAGE = {
    **{f'chunk {n}, {where}': (in_chunk(n, where), 0x40, [n], False)
       for n in (0, 2, LAST) for where in (0.5, OPCODE, LENGTH, CHECKSUM, COMPRESSION)},
    # An end of the data, a schema, an index: with one wrong bit, a chunk looks like these.
    **{f'chunk as {opcode}': (in_chunk(2, OPCODE), 6 ^ opcode, [2], False)
       for opcode in (0x02, 0x03, 0x07, 0x0E, 0x0F)},
    # An index that looks like a message, and lengths that include the following records.
    **{f'index {n}': (in_record('message index', n, 0), 7 ^ 5, [], False) for n in (0, 9, 20)},
    **{f'length, bit {bit}': (in_record('metadata', 3, 1 + bit // 8), 1 << bit % 8, [], True)
       for bit in (12, 16, 21)},
    'motion': (in_record('metadata', 2, 80), 1, [], True),
    'motion as an index': (in_record('metadata', 2, 0), 0x0C ^ 0x0D, [], True),
    'name of a motion': (in_record('metadata', 2, 28), 1, [], True),
}  # fmt: skip


@pytest.mark.parametrize(('place', 'bits', 'lost', 'moved'), DAMAGE.values(), ids=DAMAGE)
def test_damage_is_found_and_all_other_data_kept(
    tmp_path, whole, recovered, place, bits, lost, moved
):
    data = bytearray(whole.data)
    data[place(whole)] ^= bits
    done, saved, report = recovered(data)
    assert len(whole.chunks) == LAST + 1
    assert (saved, done.places, done.unknown) == (without(whole, *lost), 1, 0)
    assert (report.difference != '') == moved
    assert (report.missed > 5) == (lost in ([0], [2]))
    with pytest.raises(LogError):
        report_of(tmp_path / 'broken.mcap')


@pytest.mark.parametrize('kind', ['record', 'torque record', 'live torque'])
def test_states_after_a_lost_chunk_are_verified(tmp_path, recovered, kind):
    path = tmp_path / 'run.mcap'
    values = {'drive': 'torque', 'motor.torque': 9.0, 'motor.damping': 0.5}
    configuration = configure(values if 'torque' in kind else {})
    if 'record' in kind:
        record(configuration, path, duration=25.0)
    else:
        live(path, configuration, [('command', 5.0), *ticks(90), ('command', -5.0), *ticks(110)])
    log = described(path)
    data = bytearray(log.data)
    data[log.chunks[1][0] + 300] ^= 1
    _, saved, report = recovered(data)
    assert (saved, report.difference, report.ulp) == (without(log, 1), '', 0.0)
    lost = log.counts[2] - log.counts[1]
    assert report.missed == pytest.approx(lost / 4, abs=2)


def test_damaged_chunks_of_a_cut_file(whole, recovered):
    data, cut = bytearray(whole.data), whole.chunks[5][0]
    data[whole.chunks[2][0] + 300] ^= 1
    done, saved, _ = recovered(data[: cut + 50])
    assert (saved, done.places, done.unknown) == (without(whole, 2, 5), 2, 0)
    # The first chunk and the end of a file have the names of its topics.
    data[whole.chunks[0][0] + 300] ^= 1
    done, saved, _ = recovered(data[:cut])
    assert (saved, done.unknown) == ([], len(without(whole, 0, 2, 5)))


def test_a_flipped_byte_anywhere_never_ends_in_another_error_or_other_values(tmp_path, whole):
    """Every recovered message was in the log, in the same order."""
    numbers = {message: number for number, message in enumerate(whole.messages)}
    path, out, rng, refusals = tmp_path / 'broken', tmp_path / 'out.mcap', random.Random(5), set()
    for place in [*range(8, 60, 4), *(rng.randrange(8, len(whole.data)) for _ in range(60))]:
        bad = bytearray(whole.data)
        bad[place] ^= 1 << rng.randrange(8)
        path.write_bytes(bad)
        try:
            recover(path, out, overwrite=True)
        except LogError as error:
            refusals.add(str(error))
            continue
        order = [numbers[message] for message in messages(out)]
        assert order == sorted(order), place
        assert len(order) > 0.5 * len(numbers), place
    assert {'no configuration record' in words for words in refusals} == {True}


TOPIC = Channel(9, '/other', 'cdr', {}, 7)
LATE_TIME = record_bytes(5, struct.pack('<HIQQ', 0, 0, 2**63, 0))
# With correct checksums, but a log that has it cannot be read.
UNREADABLE = {
    'time beyond those of ROS': (lambda: tight(LATE_TIME), 1, 0),
    'channel without its schema': (
        lambda: tight(packed(TOPIC) + record_bytes(5, struct.pack('<HIQQ', 9, 0, 0, 0))), 0, 1,
    ),
    'second configuration': (
        lambda: packed(Metadata('linkage_ros', encode_configuration(load('wiper')))), 1, 0,
    ),
}  # fmt: skip


@pytest.mark.parametrize(('part', 'places', 'unknown'), UNREADABLE.values(), ids=UNREADABLE)
def test_what_would_make_the_log_unreadable_is_left_out(tmp_path, part, places, unknown):
    path, out = tmp_path / 'broken.mcap', tmp_path / 'out.mcap'
    good = tight(record_bytes(5, struct.pack('<HIQQ', 0, 0, 5, 5)))
    path.write_bytes(whole_log(good, part(), good))
    done = recover(path, out)
    assert (done.messages, done.places, done.unknown) == (2, places, unknown)
    log = LogReader(out)
    assert [message.time for message in log.messages()] == [5, 5]
    assert log.configuration == load('quadrilateral')


# ---------------------------------------------------------------- refusals


def refused(source, target, words, **options):
    with pytest.raises(LogError, match=words):
        recover(source, target, **options)


def test_existing_files_are_kept(tmp_path, whole):
    target, text = tmp_path / 'out.mcap', tmp_path / 'text'
    text.write_bytes(b'text')
    target.write_bytes(MCAP0_MAGIC)
    refused(whole.path, target, r'out\.mcap already exists')
    refused(text, target, 'is not an MCAP file', overwrite=True)
    refused(whole.path, text, 'is not a log and was not replaced', overwrite=True)
    assert (target.read_bytes(), text.read_bytes()) == (MCAP0_MAGIC, b'text')
    (tmp_path / 'link').symlink_to(whole.path)
    (tmp_path / 'hard link').hardlink_to(whole.path)
    for itself in (whole.path, tmp_path / 'link', tmp_path / 'hard link'):
        refused(whole.path, itself, 'is the damaged log itself', overwrite=True)
    assert whole.path.read_bytes() == whole.data


LACKS = 'has no configuration record of linkage_ros'
# The last is refused after its first messages, as it lacks the record that every command needs.
REFUSED = {
    'empty': (lambda *_: b'', 'is not an MCAP file'),
    'another format': (lambda *_: b'SQLite format 3\0' + bytes(4096), 'is not an MCAP file'),
    'begun': (lambda *_: MCAP0_MAGIC, LACKS),
    'cut in its configuration': (lambda data, _, end: data[: end - 1], LACKS),
    'no configuration': (lambda data, start, end: data[:start] + data[end:], LACKS),
}


@pytest.mark.parametrize(('made', 'words'), REFUSED.values(), ids=REFUSED)
@pytest.mark.parametrize('old', [True, False], ids=['replaced', 'new'])
def test_refused_log_leaves_target_as_it_was(tmp_path, whole, made, words, old):
    source, target = tmp_path / 'broken.mcap', tmp_path / 'out.mcap'
    source.write_bytes(made(whole.data, *spans(whole.data, 'metadata')[0]))
    if old:
        target.write_bytes(whole.data)
    before = sorted(tmp_path.iterdir())
    refused(source, target, words, overwrite=old)
    assert sorted(tmp_path.iterdir()) == before
    assert not old or target.read_bytes() == whole.data


def foreign(*_):
    """Returns the log of another program that was killed."""
    with BytesIO() as stream:
        writer = Writer(stream, chunk_size=100)
        writer.start(profile='ros2', library='robot')
        schema = writer.register_schema('std_msgs/msg/Empty', 'ros2msg', b'')
        channel = writer.register_channel('/a', 'cdr', schema)
        for time in range(100):
            writer.add_message(channel, time, b'\0\1\0\0', time)
        return stream.getvalue()


@pytest.mark.parametrize(
    'made',
    [
        foreign,
        lambda data, *_: data[: len(data) // 2],
        lambda data, start, _: MCAP0_MAGIC + bytes(start - 8) + data[start : len(data) // 2],
        lambda data, start, end: data[: start + 40] + bytes(9) + data[start + 49 : end + 5000],
    ],
    ids=['of another program', 'cut', 'damaged header', 'damaged configuration'],
)
def test_reader_advises_a_recovery_only_where_it_works(tmp_path, whole, made):
    source, works = tmp_path / 'broken.mcap', True
    source.write_bytes(made(whole.data, *spans(whole.data, 'metadata')[0]))
    try:
        recover(source, tmp_path / 'out.mcap')
    except LogError:
        works = False
    with pytest.raises(LogError, match='incomplete') as error:
        LogReader(source)
    assert ('linkage_log recover saves' in str(error.value)) == works


def test_target_appears_only_when_complete(tmp_path, whole):
    source, target, link = tmp_path / 'run.mcap', tmp_path / 'out.mcap', tmp_path / 'link.mcap'
    source.write_bytes(whole.data)
    link.symlink_to(target)
    target.write_bytes(b'')
    sizes = []
    recover(source, link, overwrite=True, progress=lambda _: sizes.append(target.stat().st_size))
    assert set(sizes) == {0}
    assert target.read_bytes() == whole.data
    assert link.is_symlink()


def test_target_in_use_or_not_a_file_is_kept(tmp_path, whole):
    target, folder, missing = (
        tmp_path / 'out.mcap',
        tmp_path / 'folder',
        tmp_path / 'no' / 'way' / 'out.mcap',
    )
    with LogWriter(target, load('quadrilateral'), overwrite=False):
        size = target.stat().st_size
        refused(whole.path, target, 'is being written by another run', overwrite=True)
        assert target.stat().st_size == size
    folder.mkdir()
    refused(whole.path, folder, 'is a folder: add a file name', overwrite=True)
    refused(whole.path, '/dev/null', '/dev/null is not a regular file', overwrite=True)
    refused(whole.path, missing, 'cannot be written: there is no folder .*/no$', overwrite=True)
    refused(missing, tmp_path / 'new.mcap', 'no/way/out.mcap cannot be read: No such file')
    refused(folder, tmp_path / 'new.mcap', 'folder is a folder: give an .mcap file in it$')


def test_full_disk_ends_a_recovery(tmp_path, whole):
    """Limits the file size, which has the effect of a full disk."""
    most = resource.getrlimit(resource.RLIMIT_FSIZE)
    for size in (0, 100, 5000, len(whole.data) - 100):
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, most[1]))
        try:
            # The file is gone: there is nothing to recover from it.
            words = r'^[^;]*/out.mcap cannot be written: File too large$'
            refused(whole.path, tmp_path / 'out.mcap', words, overwrite=True)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, most)


def test_the_command_says_in_one_line_what_was_saved_and_lost(tmp_path, whole, called):
    data, counts, chunks = bytearray(whole.data), whole.counts, whole.chunks
    data[chunks[2][0] + 300] ^= 1
    source, target = tmp_path / 'broken.mcap', tmp_path / 'out.mcap'
    source.write_bytes(data[:-5])
    assert_refused(*called(log_tool, 'info', source), 'linkage_log recover')
    code, out, err = called(log_tool, 'recover', source, target)
    assert (code, err) == (0, '')
    assert out.startswith(f'{target}: {counts[-1] - counts[3] + counts[2]} messages saved, ')
    assert re.search(r's; lost: \d+ bytes in 1 damaged place\n$', out)
    assert called(log_tool, 'verify', target)[0] == 0
    assert_refused(*called(log_tool, 'recover', source, target), 'already exists')
    assert called(log_tool, 'recover', source, target, '--overwrite')[0] == 0
    source.write_bytes(data[: chunks[0][0] + 300])
    code, out, _ = called(log_tool, 'recover', source, target, '--overwrite')
    assert (code, ' 0 messages saved, ' in out) == (1, True)
