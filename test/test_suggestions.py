# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Refusals suggest what was probably meant."""

from pathlib import Path

import pytest
from ros_harness import assert_refused

from linkage_ros.programs import log_tool, record
from linkage_ros.quantities import did_you_mean

FILE = """/**:
  ros__parameters:
    mechanism: four_bar
    rpm: 60.0
    frame: {length: 0.06}
    crank: {length: 0.02}
    coupler: {length: 0.07}
    rocker: {length: 0.09}
"""


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ('exercise.yaml', 'my file.yaml'):
        Path(name).write_text(FILE)
    Path('README.md').write_text('# A page\n\n![a picture](a.png) *and*: [more\n')
    Path('picture.png').write_bytes(b'\x89PNG\r\n\x1a\n\0\0\0\rIHDR: x\n')


@pytest.mark.parametrize(
    ('words', 'suggestion'),
    [
        ('Wiper', r'did you mean wiper\?'),
        ('wipper', r'did you mean wiper\?'),
        ('slider-crank', r'did you mean slider_crank\?'),
        ('wiper.yaml', r'did you mean wiper\? Presets have no .yaml'),
        ('exersice.yaml', r'no such file; .* did you mean exercise\.yaml\?'),
        ('my', 'did you mean "my file.yaml"'),
        ('my file.yaml', 'quotes around a name with spaces: "my file.yaml"'),
        ('pentagon', 'choose one of .*, wiper$'),  # resembles none
        ('nowhere/a.yaml', 'give the path of a parameter file$'),
        ('README.md', r'README\.md: line 3 is not YAML .* is it a parameter file\?'),
        ('picture.png', r'^linkage_record: picture\.png is not a text file: [ -~]*$'),
    ],
)
def test_file_that_was_meant_is_suggested(called, words, suggestion):
    assert_refused(*called(record, *words.split(), 'run.mcap'), suggestion)


@pytest.mark.parametrize(
    ('old', 'new', 'suggestion'),
    [
        ('coupler:', 'Coupler:', r'did you mean coupler\.length\?'),
        ('{length: 0.02}', '{lenght: 0.02}', r'did you mean crank\.length\?'),
        ('0.07', '"0.07"', r'coupler\.length = .*; write 0\.07 without quotes'),
        ('four_bar', 'four-bar', r'did you mean four_bar\?'),
        ('rpm: 60.0', 'omega: 6.28', 'rpm is missing: .* crank speed'),
    ],
)
def test_parameter_that_was_meant_is_suggested(called, old, new, suggestion):
    Path('a.yaml').write_text(FILE.replace(old, new))
    code, out, err = called(record, 'a.yaml', 'run.mcap')
    assert_refused(code, out, err.splitlines(keepends=True)[-1], suggestion)


def test_command_that_was_meant_is_suggested(called):
    assert_refused(*called(log_tool, 'verfy', 'run.mcap'), r'did you mean verify\?')


def test_nothing_is_suggested_for_a_name_that_resembles_none():
    assert did_you_mean('x' * 5000, ['wiper', '']) == ''
