# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Refusals suggest what was probably meant."""

from pathlib import Path

import pytest
from ros_harness import assert_refused

from linkage_ros.programs import log_tool, record

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


def test_command_that_was_meant_is_suggested(called):
    assert_refused(*called(log_tool, 'verfy', 'run.mcap'), r'did you mean verify\?')
