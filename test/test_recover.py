# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Broken logs made whole: nothing that is there is lost, nothing that is wrong is kept."""

from __future__ import annotations

import os
import random
import signal
import struct
import subprocess
import sys
import time
from itertools import accumulate

import pytest
from mcap.reader import make_reader
from ros_harness import command
from test_log import sections
from test_verify import CHANGES, live

from linkage_ros import LogError
from linkage_ros.log.reader import LogReader
from linkage_ros.log.writer import LogWriter
from linkage_ros.parameters.configuration import load
from linkage_ros.record import record
from linkage_ros.recovery.damaged_mcap import Losses
from linkage_ros.recovery.recover import recover
from linkage_ros.verification.verify import verify

NOTHING = Losses()


@pytest.fixture(scope='module')
def whole(tmp_path_factory):
    """A live log of seven chunks with seven pieces of motion."""
    path = tmp_path_factory.mktemp('whole') / 'run.mcap'
    return live(path, load('quadrilateral'), CHANGES)


def messages(path):
    with LogReader(path) as log:
        return list(log.written())


def spans(data, kind):
    return [(first, end) for name, first, end in sections(data) if name == kind]


def chunk_messages(path):
    """How many messages the first n chunks have, for n = 0, 1, ..."""
    with path.open('rb') as stream:
        summary = make_reader(stream).get_summary()
        counts = []
        for chunk in summary.chunk_indexes:
            at = chunk.chunk_start_offset + chunk.chunk_length
            stream.seek(at)
            data, count, place = stream.read(chunk.message_index_length), 0, 0
            while place < len(data):
                _, length = struct.unpack_from('<BQ', data, place)
                count += (length - 6) // 16
                place += 9 + length
            counts.append(count)
    return [0, *accumulate(counts)]


def broken(tmp_path, data):
    path = tmp_path / 'broken.mcap'
    path.write_bytes(data)
    return path


# ---------------------------------------------------------------- complete logs


@pytest.mark.parametrize('preset', ['quadrilateral', 'compressor'])
def test_a_complete_log_comes_back_byte_for_byte(tmp_path, preset):
    path = tmp_path / 'run.mcap'
    record(load(preset), path, duration=20.0)  # in several chunks
    data = path.read_bytes()
    assert len(spans(data, 'chunk')) > 1
    done = recover(path, tmp_path / 'out.mcap')
    assert (tmp_path / 'out.mcap').read_bytes() == data == path.read_bytes()
    assert (done.messages, done.losses) == (len(messages(path)), NOTHING)
    assert done.duration == pytest.approx(20.0, abs=0.01)
    assert {item.name for item in tmp_path.iterdir()} == {'run.mcap', 'out.mcap'}


def test_a_live_log_comes_back_byte_for_byte(tmp_path, whole):
    assert recover(whole, tmp_path / 'out.mcap').losses == NOTHING
    assert (tmp_path / 'out.mcap').read_bytes() == whole.read_bytes()


def test_a_log_without_messages_comes_back(tmp_path):
    LogWriter(tmp_path / 'run.mcap', load('quadrilateral'), overwrite=False).close()
    recover(tmp_path / 'run.mcap', tmp_path / 'out.mcap')
    assert (tmp_path / 'out.mcap').read_bytes() == (tmp_path / 'run.mcap').read_bytes()


# ---------------------------------------------------------------- cut off


def test_all_whole_chunks_before_a_cut_are_saved_and_verify(tmp_path, whole):
    data, good, counts = whole.read_bytes(), messages(whole), chunk_messages(whole)
    chunks = spans(data, 'chunk')
    ends = [end for name, _, end in sections(data) if name != 'magic']
    first = spans(data, 'configuration')[0][1]
    cuts = {*ends, *range(first, len(data), len(data) // 50), *(len(data) - n for n in (1, 9))}
    cuts |= {start + n for start, _ in chunks for n in (1, 8, 9, 40, 60)}
    for cut in sorted(cut for cut in cuts if first <= cut < len(data)):
        path = broken(tmp_path, data[:cut])
        with pytest.raises(LogError, match='linkage_log recover'):
            LogReader(path)
        done = recover(path, tmp_path / 'out.mcap', overwrite=True)
        saved = messages(tmp_path / 'out.mcap')
        assert saved == good[: len(saved)]
        assert len(saved) >= counts[sum(end <= cut for _, end in chunks)]
        assert (done.messages, done.losses.places) == (len(saved), 0)
        assert done.losses.tail < max(end - start for start, end in chunks)
        with LogReader(tmp_path / 'out.mcap') as log, LogReader(whole) as old:
            assert log.configuration == old.configuration
            report = verify(log)
        assert report.difference == ''


def test_whole_blocks_of_a_cut_chunk_are_saved(tmp_path):
    """zstd packs blocks of 128 KiB, of which a chunk of a record has several."""
    path = tmp_path / 'run.mcap'
    record(load('quadrilateral'), path, duration=20.0)
    data, good, counts = path.read_bytes(), messages(path), chunk_messages(path)
    start, end = spans(data, 'chunk')[1]
    saved = []
    for part in (0.0, 0.3, 0.6, 0.9):
        cut = broken(tmp_path, data[: start + 9 + int(part * (end - start - 9))])
        recover(cut, tmp_path / 'out.mcap', overwrite=True)
        found = messages(tmp_path / 'out.mcap')
        assert found == good[: len(found)]
        saved.append(len(found) - counts[1])
        with LogReader(tmp_path / 'out.mcap') as log:
            assert verify(log).difference == ''
    assert saved[0] == 0
    assert saved == sorted(saved)
    assert saved[3] > 0.6 * (counts[2] - counts[1])


@pytest.mark.parametrize('tail', ['zeros', 'garbage'])
def test_a_tail_that_never_reached_the_disk_is_left_out(tmp_path, whole, tail):
    data, good, counts = whole.read_bytes(), messages(whole), chunk_messages(whole)
    chunks = spans(data, 'chunk')
    for number in (2, 4):
        cut = chunks[number][0] + 100
        lost = len(data) - cut
        end = bytes(lost) if tail == 'zeros' else random.Random(number).randbytes(lost)
        done = recover(broken(tmp_path, data[:cut] + end), tmp_path / 'out.mcap', overwrite=True)
        assert messages(tmp_path / 'out.mcap') == good[: counts[number]]
        assert done.losses.tail > 0 or done.losses.places > 0


# ---------------------------------------------------------------- damaged


@pytest.mark.parametrize('where', ['data', 'crc', 'length', 'opcode', 'compression'])
@pytest.mark.parametrize('number', [0, 1, 3, -1])
def test_a_damaged_chunk_is_passed_over_and_the_others_kept(tmp_path, whole, number, where):
    data, good, counts = bytearray(whole.read_bytes()), messages(whole), chunk_messages(whole)
    chunks = spans(bytes(data), 'chunk')
    start, end = chunks[number]
    offset = {'data': (end - start) // 2, 'crc': 9 + 24, 'length': 2, 'opcode': 0}.get(where, 42)
    data[start + offset] ^= 0x40
    done = recover(broken(tmp_path, data), tmp_path / 'out.mcap')
    last, number = number == -1, number % len(chunks)
    lost = counts[number + 1] - counts[number]
    saved = messages(tmp_path / 'out.mcap')
    if last and where == 'length':  # nothing follows, so that the chunk tells its own length
        assert saved == good
    else:
        assert saved == good[: counts[number]] + good[counts[number + 1] :]
        assert done.losses.places == (not (last and where == 'opcode'))
        assert done.losses.damaged + done.losses.tail >= end - start
        assert done.losses.messages in ({0, lost} if where in {'length', 'opcode'} else {lost})
    with LogReader(tmp_path / 'out.mcap') as log:
        report = verify(log)
    assert report.difference == ''
    assert (report.missed > 5) == (not last)
    assert report.absent == (('robot_description',) if number == 0 else ())


@pytest.mark.parametrize('opcode', [0x02, 0x03, 0x0A, 0x0E, 0x0F])
def test_a_chunk_that_claims_to_be_something_else_is_lost_and_told(tmp_path, whole, opcode):
    """An end of the data, a schema, an index: one wrong bit makes a chunk look like these."""
    data, good, counts = bytearray(whole.read_bytes()), messages(whole), chunk_messages(whole)
    start, end = spans(bytes(data), 'chunk')[2]
    data[start] = opcode
    done = recover(broken(tmp_path, data), tmp_path / 'out.mcap')
    assert messages(tmp_path / 'out.mcap') == good[: counts[2]] + good[counts[3] :]
    assert done.losses.places == 1
    assert done.losses.damaged >= end - start


@pytest.mark.parametrize('bit', range(12, 22))
def test_a_length_that_swallows_what_lies_behind_it_is_not_believed(tmp_path, whole, bit):
    data, good = bytearray(whole.read_bytes()), messages(whole)
    start, _ = spans(bytes(data), 'motion')[2]
    length = struct.unpack_from('<Q', data, start + 1)[0]
    struct.pack_into('<Q', data, start + 1, length ^ (1 << bit))
    done = recover(broken(tmp_path, data), tmp_path / 'out.mcap')
    assert messages(tmp_path / 'out.mcap') == good
    assert done.losses.places == 1


def test_what_an_earlier_run_left_beside_the_target_is_left_alone(tmp_path, whole):
    source, target = tmp_path / 'saved.mcap.part', tmp_path / 'saved.mcap'
    source.write_bytes(whole.read_bytes())
    recover(source, target)
    assert source.read_bytes() == target.read_bytes() == whole.read_bytes()


def test_devices_and_links_are_never_replaced(tmp_path, whole):
    dangling, kept = tmp_path / 'dangling.mcap', tmp_path / 'kept.mcap'
    kept.write_bytes(b'precious')
    dangling.symlink_to(tmp_path / 'nowhere')
    link = tmp_path / 'link.mcap'
    link.symlink_to(kept)
    os.mkfifo(tmp_path / 'pipe')
    for target in (dangling, link, tmp_path / 'pipe', tmp_path):
        for overwrite in (False, True):
            with pytest.raises(LogError, match='is no file that could be replaced'):
                recover(whole, target, overwrite=overwrite)
    assert kept.read_bytes() == b'precious'
    assert link.is_symlink()


def test_a_damaged_chunk_of_a_cut_file(tmp_path, whole):
    data, good, counts = bytearray(whole.read_bytes()), messages(whole), chunk_messages(whole)
    chunks = spans(bytes(data), 'chunk')
    data[chunks[2][0] + 300] ^= 1
    done = recover(broken(tmp_path, data[: chunks[5][0] + 50]), tmp_path / 'out.mcap')
    assert messages(tmp_path / 'out.mcap') == good[: counts[2]] + good[counts[3] : counts[5]]
    assert (done.losses.places, done.losses.messages) == (1, counts[3] - counts[2])
    assert done.losses.tail == 50
    # Without a summary nothing names the topics of a file whose first chunk is lost.
    data[chunks[0][0] + 300] ^= 1
    done = recover(broken(tmp_path, data[: chunks[5][0]]), tmp_path / 'out.mcap', overwrite=True)
    assert (done.messages, done.losses.messages) == (0, counts[5])


def test_of_two_faults_neither_lets_wrong_values_through(tmp_path, whole):
    """A chunk that tells its own length has to be right; so have topics that the end repeats."""
    good, counts = messages(whole), chunk_messages(whole)
    chunks = spans(whole.read_bytes(), 'chunk')
    data = bytearray(whole.read_bytes())
    data[chunks[-1][0] + 2] ^= 0x40  # its length
    data[chunks[-1][0] + 9 + 24] ^= 1  # its checksum
    recover(broken(tmp_path, data), tmp_path / 'out.mcap')
    assert messages(tmp_path / 'out.mcap') == good[: counts[-2]]
    data = bytearray(whole.read_bytes())
    data[chunks[0][0] + 300] ^= 1
    data[data.index(b'/driving_torque', chunks[-1][1]) + 1] ^= 1
    done = recover(broken(tmp_path, data), tmp_path / 'out.mcap', overwrite=True)
    assert (done.messages, done.losses.messages) == (0, counts[-1])


def test_a_damaged_motion_record_is_left_out(tmp_path, whole):
    data = bytearray(whole.read_bytes())
    start, _ = spans(bytes(data), 'motion')[1]
    data[data.index(b'phase', start) + 9] ^= 1
    done = recover(broken(tmp_path, data), tmp_path / 'out.mcap')
    assert done.losses == Losses(records=1)
    assert messages(tmp_path / 'out.mcap') == messages(whole)
    with LogReader(tmp_path / 'out.mcap') as log:
        assert len(log.motions) == 6
        assert verify(log).difference != ''


def test_a_flipped_byte_anywhere_never_ends_in_another_error_or_other_values(tmp_path, whole):
    """Whatever is recovered was there, and in that order."""
    data, good = whole.read_bytes(), messages(whole)
    numbers = {message: number for number, message in enumerate(good)}
    rng, refusals = random.Random(5), set()
    for place in [*range(8, 60), *(rng.randrange(8, len(data)) for _ in range(250))]:
        bad = bytearray(data)
        bad[place] ^= 1 << rng.randrange(8)
        try:
            recover(broken(tmp_path, bad), tmp_path / 'out.mcap', overwrite=True)
        except LogError as error:
            refusals.add(str(error).partition(' has ')[2])
            continue
        order = [numbers[message] for message in messages(tmp_path / 'out.mcap')]
        assert order == sorted(order), place
        assert len(order) > 0.5 * len(good), place
    assert refusals == {'no configuration record: it cannot be recovered'}


# ---------------------------------------------------------------- refusals


def refused(source, target, words, **options):
    with pytest.raises(LogError, match=words) as caught:
        recover(source, target, **options)
    assert '\n' not in str(caught.value)
    assert not list(target.parent.glob('*.part'))


def test_existing_files_are_kept(tmp_path, whole):
    target = tmp_path / 'out.mcap'
    target.write_bytes(b'precious')
    refused(whole, target, r'out\.mcap exists already and is kept')
    # Asked for, it is replaced, but only by a log.
    refused(broken(tmp_path, b'text'), target, 'is no MCAP file', overwrite=True)
    assert target.read_bytes() == b'precious'
    recover(whole, target, overwrite=True)
    assert target.read_bytes() == whole.read_bytes()


def test_the_broken_log_itself_is_no_target(tmp_path, whole):
    source, link = broken(tmp_path, whole.read_bytes()), tmp_path / 'link.mcap'
    link.symlink_to(source)
    for target in (source, link):
        for overwrite in (False, True):
            refused(source, target, 'is the broken log itself', overwrite=overwrite)
    assert source.read_bytes() == whole.read_bytes()


def test_what_is_no_log_of_ours_is_refused(tmp_path, whole):
    target, data = tmp_path / 'out.mcap', whole.read_bytes()
    first = spans(data, 'configuration')[0]
    for content, words in (
        (b'', 'is no MCAP file'),
        (b'\x89MCAP0', 'is no MCAP file'),
        (b'SQLite format 3\0' + bytes(4096), 'is no MCAP file'),
        (b'\x89MCAP0\r\n', 'has no configuration record'),
        (data[: first[1] - 1], 'has no configuration record'),
        (data[: first[0]] + data[first[1] :], 'has no configuration record'),
    ):
        refused(broken(tmp_path, content), target, words)
        assert not target.exists()
    refused(tmp_path / 'missing.mcap', target, r'missing\.mcap cannot be read')
    refused(tmp_path, target, 'cannot be read')
    refused(whole, tmp_path / 'no' / 'out.mcap', 'cannot be written')


def run(*arguments):
    return subprocess.run(
        command('log_tool', *arguments), capture_output=True, text=True, check=False
    )


def test_the_command_says_in_one_line_what_was_saved_and_lost(tmp_path, whole):
    data, counts = bytearray(whole.read_bytes()), chunk_messages(whole)
    chunks = spans(bytes(data), 'chunk')
    data[chunks[2][0] + 300] ^= 1
    source, target = broken(tmp_path, data[:-5]), tmp_path / 'out.mcap'
    hint = run('info', source)
    assert hint.returncode == 2
    assert 'linkage_log recover' in hint.stderr
    done = run('recover', source, target)
    assert (done.returncode, done.stderr) == (0, '')
    size, lost = chunks[2][1] - chunks[2][0], counts[3] - counts[2]
    assert done.stdout.startswith(f'{target}: {counts[-1] - lost} messages saved, ')
    assert done.stdout.endswith(f'lost: 1 damaged places of {size} bytes with {lost} messages\n')
    assert run('verify', target).returncode == 0
    again = run('recover', source, target)
    assert (again.returncode, again.stdout) == (2, '')
    assert again.stderr.startswith('linkage_log: ')
    assert again.stderr.count('\n') == 1
    assert run('recover', source, target, '--overwrite').returncode == 0


# ---------------------------------------------------------------- killed

KILLED = """
import itertools, sys, time
from linkage_ros.parameters.configuration import configure
from linkage_ros.log.writer import LogWriter
from linkage_ros.run.machine import Machine
from linkage_ros.wire.topics import ROBOT_DESCRIPTION
from linkage_ros.run.worker import Worker

configuration = configure({'rate_hz': 1000.0, 'crank_acceleration': 20.0})
machine = Machine(configuration)
log = LogWriter(sys.argv[1], configuration, overwrite=False)
*channels, description = (
    log.add_topic(topic, '/' + topic.name) for topic in (*machine.topics, ROBOT_DESCRIPTION)
)
write, flush, newest = log.write, log.flush, 0

def told_write(channel, stamp, data):
    global newest
    newest = stamp
    write(channel, stamp, data)

def told_flush():
    flush()
    print(newest, flush=True)

log.write, log.flush = told_write, told_flush
worker = Worker('log', log, capacity=120_000, period=0.05, on_error=print)
origin, t0 = time.monotonic_ns(), time.time_ns()
motion = machine.begin(t0)
worker.offer(motion)
worker.offer((description, t0, machine.description))
for tick in itertools.count():
    due = machine.elapsed(tick)
    while time.monotonic_ns() < origin + due:
        time.sleep(0.0002)
    if tick % 250 == 249:
        motion = motion.change(t0 + due, 10.0 + tick % 77)
        worker.offer(motion)
    now = time.time_ns()
    for channel, data in zip(channels, machine.snapshot_at(motion, t0 + due).messages):
        worker.offer((channel, now, data))
"""


@pytest.mark.parametrize('delay', [0.0, 0.07, 0.13])
def test_a_killed_run_at_1_khz_is_recovered_up_to_its_last_flush(tmp_path, delay):
    """A flush comes every 0.15 s (FLUSH_PERIOD) at least, a batch of the worker 0.05 s here."""
    path = tmp_path / 'run.mcap'
    with subprocess.Popen(
        [sys.executable, '-c', KILLED, path], stdout=subprocess.PIPE, text=True
    ) as process:
        flushed = [int(process.stdout.readline()) for _ in range(4)]
        time.sleep(delay)
        process.send_signal(signal.SIGKILL)
        rest, _ = process.communicate()
    flushed += [int(line) for line in rest.splitlines(keepends=True) if line.endswith('\n')]
    done = recover(path, tmp_path / 'out.mcap')
    assert (done.losses.places, done.losses.messages, done.losses.records) == (0, 0, 0)
    with LogReader(tmp_path / 'out.mcap') as log:
        report = verify(log)
        assert report.difference == ''
        assert report.states > 100
        assert log.end >= flushed[-1]
