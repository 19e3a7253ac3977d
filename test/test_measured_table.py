# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The CSV log of a board is answered as a bag with the same measurements."""

import math
from pathlib import Path

import numpy as np
import pytest
from mechanisms import FOLLOWED
from other_bags import write_mcap
from ros_harness import assert_refused

from linkage_ros import read_log
from linkage_ros.log.reader import LogReader
from linkage_ros.log.verify import verify
from linkage_ros.messages.fields import Template
from linkage_ros.messages.templates import joint_state
from linkage_ros.messages.topics import JOINT_STATE
from linkage_ros.programs import record as record_module
from linkage_ros.programs.record import record_measured
from linkage_ros.settings.configuration import configure, read_values

CYLINDER = {**read_values('excavator'), 'drive': 'follow'}
CYLINDER = {name: x for name, x in CYLINDER.items() if not name.startswith(('motion.', 'rate_hz'))}
TIMES = [0.0, 0.001, 0.0025, 0.004, 0.004, 0.0065]  # s; one is not new
ANGLES = [0.5, 0.75, 1.0, 1.25, 1.5, 1.75]
KINDS = {
    'rad': (FOLLOWED, 'time,angle', lambda t, x, v: f'{t},{x}', ''),
    'speed': (FOLLOWED, 'time,angle,speed', lambda t, x, v: f'{t},{x},{v}', ''),
    'degrees': (
        FOLLOWED,
        '# board 3\n\ntime_ms,volt,angle_deg,state',
        lambda t, x, v: f'{t * 1e3:g},3.3,{math.degrees(x)!r},"on, hot"',
        '',
    ),
    'column': (
        FOLLOWED,
        'angle,time_us,enc_deg',
        lambda t, x, v: f'7.0,{t * 1e6:g},{math.degrees(x)!r}',
        'enc_deg',
    ),
    'cylinder': (CYLINDER, 'time,position', lambda t, x, v: f'{t},{x / 4 + 0.75}', ''),
}


@pytest.mark.parametrize(('values', 'head', 'row', 'column'), KINDS.values(), ids=KINDS)
def test_table_is_answered_as_a_bag(tmp_path, values, head, row, column):
    configuration = configure(values)
    rows = [*zip(TIMES, ANGLES, np.linspace(8.0, 9.0, len(TIMES)).tolist(), strict=True)]
    lines = [head, *(row(*each) for each in rows), f'{row(0.008, 2.0, 1.0)[:5]},x']
    (tmp_path / 'a.csv').write_text('\n'.join(lines))
    joint = configuration.only.crank_joint
    template, messages = Template(joint_state([joint], '')), []
    for time, angle, speed in rows:
        stamp = round(time * 1e9)
        if 'deg' in head:
            angle = math.degrees(angle) * (math.pi / 180)
        if values is CYLINDER:
            angle = angle / 4 + 0.75
        numbers = angle, speed if 'speed' in head else math.nan, math.nan
        messages.append(
            ('/js', JOINT_STATE, stamp, template.pack(*divmod(stamp, 10**9), *numbers))
        )
    bag = write_mcap(tmp_path / 'bag.mcap', messages)
    found = record_measured(configuration, tmp_path / 'x.mcap', tmp_path / 'a.csv', column=column)
    due = record_measured(configuration, tmp_path / 'y.mcap', bag)
    assert (found.states, due.states) == (len(TIMES) - 1,) * 2
    assert sum(found.rejected.values()) >= sum(due.rejected.values())
    ours, theirs = (read_log(tmp_path / x, '/mechanism_state') for x in ('x.mcap', 'y.mcap'))
    assert ours.keys() == theirs.keys()
    assert all(np.array_equal(ours[name], theirs[name]) for name in ours)
    report = verify(LogReader(tmp_path / 'x.mcap'))
    assert (report.states, report.difference) == (found.states, '')


def test_many_rows_are_answered_in_batches(tmp_path):
    count = 5000
    lines = ['time,angle', *(f'{0.001 * n:.3f},{0.01 * n:.2f}' for n in range(count))]
    (tmp_path / 'a.csv').write_text('\n'.join(lines))
    found = record_measured(configure(FOLLOWED), tmp_path / 'x.mcap', tmp_path / 'a.csv')
    assert (found.states, *found.rejected) == (count,)
    stamps = read_log(tmp_path / 'x.mcap', '/joint_states')['t']
    assert np.array_equal(stamps, np.arange(count) * 1_000_000 / 1e9)


@pytest.mark.parametrize(
    ('text', 'options', 'words'),
    [
        ('t,angle\n0,1\n', [], r'names t, angle: one must be of time \[s\], time_ms \[ms\]'),
        (
            'time,x\n0,1\n',
            [],
            r'one must be of angle \[rad\], angle_deg .*; or give --column NAME',
        ),
        ('time,angle,angle_deg\n0,1,1\n', [], 'angle and angle_deg: give one of these as --col'),
        ('time,time_ms,angle\n0,0,1\n', [], 'has time and time_ms'),
        ('time;angle\n0;1\n', [], 'separate columns by commas'),
        ('time,angle\n0,1\n', ['--column', 'x'], "no column 'x', only time, angle"),
        ('time,angle\n0,1\n', ['--topic', '/x'], 'of a CSV file, give --column'),
        (
            'time,angle\n0,1\n-1,2\n',
            [],
            "line 3: time = '-1': must be .* keeps the 1 state before",
        ),
        ('time,angle\n0,1\nnan,2\n', [], "line 3: time = 'nan'"),
        ('time,angle\n0,1\n1e30,2\n', [], 'line 3: time'),
        ('time,angle\n0,1\n0,' + '1' * 70000, [], 'more than 65536 bytes'),
        ('', [], 'its first line names nothing'),
        ('\0\xff' * 100, [], 'its first line names'),
    ],
)
def test_wrong_table_is_one_line(called, tmp_path, monkeypatch, text, options, words):
    monkeypatch.chdir(tmp_path)
    lines = ''.join(f'    {name}: {value!r}\n' for name, value in FOLLOWED.items())
    Path('a.yaml').write_text(f'/**:\n  ros__parameters:\n{lines}')
    Path('a.csv').write_bytes(text.encode('latin-1'))
    words_given = ['a.yaml', 'x.mcap', '--measured', 'a.csv', *options]
    assert_refused(*called(record_module, *words_given), words)
