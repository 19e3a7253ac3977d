# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads records and a live log with readers that share no code with the package.

Each reader decodes with the definitions in the file. The expected values come from the solver; see
`solved_messages`. benchmarks/readers.py does the same with Foxglove's readers.
"""

import sys
from pathlib import Path
from typing import NamedTuple

import pytest
from live_logs import START, live, ticks
from mcap.reader import make_reader
from pages import block, read, run_python
from rosbags import rosbag2
from rosbags.convert import cli
from rosbags.highlevel import AnyReader
from rosbags.interfaces import (
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from solved_messages import TYPES, plain, solved_messages, time_of

from linkage_ros.log.reader import LogReader
from linkage_ros.messages.topics import DIAGNOSTIC_ARRAY
from linkage_ros.motion.at_speed import SpeedMotion
from linkage_ros.motion.steps import AdaptiveSteps
from linkage_ros.programs.record import record
from linkage_ros.run.states import Simulator
from linkage_ros.settings.configuration import Configuration, configure, load

DOCUMENT = read('docs/mcap.md')
DIAGNOSTICS = {'/diagnostics': DIAGNOSTIC_ARRAY.name}
DURATION = 0.2  # s


class Log(NamedTuple):
    path: Path
    configuration: Configuration
    messages: dict


def recorded(preset, folder):
    path, configuration = folder / 'run.mcap', load(preset)
    count = record(configuration, path, duration=DURATION)
    rate = round(configuration.session.rate_hz)
    assert count == round(DURATION * rate)
    stamps = [tick * 10**9 // rate for tick in range(count)]
    motion = Simulator(configuration.only).begin(0, AdaptiveSteps)
    return Log(path, configuration, solved_messages(configuration, motion, stamps))


def written_live(folder):
    """Writes a log of several chunks as a node does, while the crank accelerates."""
    path, drive = folder / 'run.mcap', {'start_rpm': -30.0, 'crank_acceleration': 7.1}
    configuration, found = load('quadrilateral'), {}
    configuration = configure({**configuration.parameters(), **drive})
    log = LogReader(live(path, configuration, ticks(200)))
    for message in log.messages():
        found.setdefault(message.topic, []).append(message.time)
    stamps = [START + tick * 5_000_000 for tick in range(200)]
    expected = solved_messages(configuration, SpeedMotion(log.motions[''][0]), stamps)
    values = [{'key': 'rate', 'value': '200'}]
    status = {
        'level': 0,
        'name': 'motion',
        'message': 'kept',
        'hardware_id': 'live',
        'values': values,
    }
    expected['/diagnostics'] = [
        (None, {'header': {'stamp': time_of(stamp), 'frame_id': ''}, 'status': [status]})
        for stamp in stamps[::50]
    ]
    for topic, rows in expected.items():  # log times of a live run are times of publishing
        pairs = zip(found[topic], rows, strict=True)
        expected[topic] = [(time, message) for time, (_, message) in pairs]
    return Log(path, configuration, expected)


# A slider, a torque-driven motion and a coupler point; the quadrilateral as a live run.
@pytest.fixture(scope='module', params=['compressor', 'wind_pump', 'coupler_point', 'live'])
def log(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp(request.param)
    return written_live(folder) if request.param == 'live' else recorded(request.param, folder)


def assert_same(found, expected):
    assert set(found) == set(expected)
    for topic, rows in expected.items():
        assert len(found[topic]) == len(rows), topic
        for got, wanted in zip(sorted(found[topic], key=lambda row: row[0]), rows, strict=True):
            assert got == wanted, topic


# ---------------------------------------------------------------- rosbags

FOR_EVER = QosTime(9223372036, 854775807)
VOLATILE, LATCHED = (
    Qos(
        QosHistory.KEEP_LAST, depth, QosReliability.RELIABLE, durability, FOR_EVER, FOR_EVER,
        QosLiveliness.AUTOMATIC, FOR_EVER, avoid_ros_namespace_conventions=False,
    )
    for depth, durability in ((10, QosDurability.VOLATILE), (1, QosDurability.TRANSIENT_LOCAL))
)  # fmt: skip


def read_bag(bag):
    found = {connection.topic: [] for connection in bag.connections}
    for connection, time, data in bag.messages():
        message = plain(bag.deserialize(data, connection.msgtype))
        found[connection.topic].append((time, message))
    return found


def test_rosbags_reads_the_bare_file(log):
    with AnyReader([log.path]) as bag:
        assert_same(read_bag(bag), log.messages)
        times = [time for rows in log.messages.values() for time, _ in rows]
        assert (bag.start_time, bag.end_time) == (min(times), max(times) + 1)
        for connection in bag.connections:
            assert connection.msgtype == (TYPES | DIAGNOSTICS)[connection.topic]
            # Computed by rosbags from the definitions in the file.
            own = bag.typestore.hash_rihs01(connection.msgtype)
            with log.path.open('rb') as stream:
                channels = make_reader(stream).get_summary().channels.values()
            [channel] = [channel for channel in channels if channel.topic == connection.topic]
            assert channel.metadata['topic_type_hash'] == own
            assert connection.ext.serialization_format == 'cdr'
            latched = connection.topic == '/robot_description'
            assert connection.ext.offered_qos_profiles == [LATCHED if latched else VOLATILE]


def test_rosbags_converts_the_log_to_a_folder_with_the_same_bytes(log, tmp_path, monkeypatch):
    words = ['rosbags-convert', '--src', str(log.path), '--dst', str(tmp_path / 'run')]
    monkeypatch.setattr(sys, 'argv', words)
    with pytest.raises(SystemExit, match='0'):
        cli.main()
    assert (tmp_path / 'run' / 'metadata.yaml').is_file()

    def content(path):
        with rosbag2.Reader(path) as bag:
            return sorted((c.topic, time, bytes(data)) for c, time, data in bag.messages())

    assert content(tmp_path / 'run') == content(log.path)


# ---------------------------------------------------------------- mcap


def test_mcap_decodes_with_its_ros2_support(log):
    from mcap_ros2 import decoder

    found = {topic: [] for topic in log.messages}
    with log.path.open('rb') as stream:
        reader = make_reader(
            stream, validate_crcs=True, decoder_factories=[decoder.DecoderFactory()]
        )
        for _, channel, message, decoded in reader.iter_decoded_messages():
            assert message.log_time == message.publish_time
            found[channel.topic].append((message.log_time, plain(decoded)))
    assert_same(found, log.messages)


# ---------------------------------------------------------------- Rerun


def test_rerun_reads_every_topic(log):
    """The values are those of the definitions in the file, which the other readers decode."""
    chunk = pytest.importorskip('rerun.chunk')
    found = {str(one.entity_path) for one in chunk.McapReader(log.path).stream()}
    assert found >= {*log.messages}


# ---------------------------------------------------------------- examples of docs/mcap.md


def test_metadata_example_prints_configuration_and_motion(log, capsys, monkeypatch):
    monkeypatch.chdir(log.path.parent)
    lines = block(DOCUMENT, 'iter_metadata')
    assert len(lines.splitlines()) <= 5
    run_python(lines, 'mcap.md')
    about, motion, end = capsys.readouterr().out.splitlines()
    assert about.startswith('linkage_ros {')
    assert f"'rate_hz': '{log.configuration.session.rate_hz}'" in about
    assert motion.startswith('linkage_ros/motion {')
    assert end.startswith("linkage_ros/end {'messages': '")
    drive = log.configuration.drive
    is_speed = log.configuration.only.kind.drive == 'speed'
    expected = f"'rpm': '{drive.rpm}'" if is_speed else f"'torque': '{drive.motor.torque}'"
    assert expected in motion
