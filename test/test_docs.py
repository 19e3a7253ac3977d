# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the pages tell to type works, and their links and pictures lead somewhere.

Commands that are cheap are run as they stand; of others the executable itself says whether it
understands them. What cannot be had here stands beside the words 'not tried'.
"""

from __future__ import annotations

import re
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest
import yaml
from pages import PAGES, ROOT, blocks, commands, is_python, links, read, run_python
from ros_harness import command, environment, fresh_domain

from linkage_ros import cli
from linkage_ros.controller import Settings
from linkage_ros.errors import ConfigurationError
from linkage_ros.parameters.configuration import configure
from linkage_ros.quantities import build, leaves

TOOLS = {'linkage_log': 'log_tool', 'linkage_chart': 'chart_tool'}
# Blocks that need a log or a node to work on: by the pages' own tests.
PYTHON_ELSEWHERE = {
    'README.md': 'test_readme.py',
    'docs/controllers.md': 'test_controllers_page.py',
    'docs/mcap.md': 'test_foreign_readers.py',
}


# ---------------------------------------------------------------- commands


def module_of(name):
    return TOOLS.get(name, name.removeprefix('linkage_'))


def check_tool(words, *, is_block):
    """The executable's own parser takes it; within a sentence it need not be complete.

    Raises:
        SyntaxError: It does not.
    """
    name, *rest = words
    if name in ('linkage_node', 'linkage_controller'):
        check_parameters(name, rest)
        return
    parser = import_module(f'linkage_ros.{module_of(name)}')._parser()
    try:
        parser.parse_args(rest)
    except SyntaxError as error:
        if is_block or 'are required' not in str(error):
            raise


def check_parameters(name, words):
    """What follows --ros-args: -p NAME:=VALUE for parameters that there are."""
    given = dict(word.split(':=', 1) for word in words if ':=' in word)
    flags = [word for word in words if ':=' not in word]
    assert flags in ([], ['--ros-args', *['-p'] * len(given)]), words
    values = {key: yaml.safe_load(value) for key, value in given.items()}
    if name == 'linkage_controller':
        assert set(values) <= {leaf.name for leaf in leaves(Settings)}
        build(Settings, values)
    else:
        configure(values)


def helps(program, options):
    """Whether a program that has nothing to do with ours knows these options."""
    done = subprocess.run([*program, '--help'], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert 'usage' in done.stdout.lower(), f'{program}: does not say what it is for'
    known = re.findall(r'--[\w-]+', done.stdout)
    return all(option in known for option in options if option.startswith('--'))


def check_command(words, *, is_block, near):
    """That it is understood, or said to be not tried."""
    name, *rest = words
    where = Path(sys.executable).parent
    if name.startswith('linkage_'):
        check_tool(words, is_block=is_block)
    elif name == 'make':
        targets = re.findall(r'^(\w+):', (ROOT / 'Makefile').read_text(), re.MULTILINE)
        assert set(rest) <= set(targets), words
    elif name == '.':
        assert rest == ['.venv-*/bin/activate']
        assert '\nVENV := .venv-' in (ROOT / 'Makefile').read_text()
    elif name == 'pytest':
        assert all((ROOT / path).exists() for path in rest), words
    elif name == 'pip':
        assert rest[1].strip('\'"').split('[')[0] in (ROOT / 'setup.py').read_text(), words
    elif name == 'python':
        assert helps([sys.executable, ROOT / rest[0]], rest), words
    elif name == 'rosbags-convert':
        assert helps([where / name], rest), words
    elif name == 'rerun':
        tool = rest[: 2 * (rest[0] == 'mcap')]
        assert helps([where / name, *tool], rest), words
    else:
        said = re.search(r'not\s+tried', near, re.IGNORECASE)
        assert said, f'{" ".join(words)}: test it or say so'


@pytest.fixture(autouse=True)
def parsers_raise(monkeypatch):
    """They would end the program."""

    def error(self, message):
        raise SyntaxError(message)

    monkeypatch.setattr(cli.Parser, 'error', error)


@pytest.mark.parametrize('page', PAGES)
def test_commands_are_understood_or_said_to_be_not_tried(page):
    for words, is_block, near in commands(read(page)):
        check_command(words, is_block=is_block, near=near)


SCRIPTS = [
    path
    for folder in ('docs', 'benchmarks')
    for path in sorted((ROOT / folder).glob('*.py'))
    if '__main__' in path.read_text()
]


@pytest.mark.parametrize('path', SCRIPTS, ids=lambda path: path.name)
def test_a_script_that_is_asked_for_help_gives_it(path):
    assert helps([sys.executable, path], [])


def quick(words):
    """The same in less time, and without a window."""
    words = ['shown.rrd' if word == 'spawn' else word for word in words]
    return [*words, '--rate', '100'] if words[0] == 'linkage_replay' else words


@pytest.mark.parametrize('page', PAGES)
def test_recording_replaying_and_looking_work_as_they_stand(page, tmp_path):
    cheap = ('linkage_record', 'linkage_replay', 'linkage_log')
    for words, is_block, _ in commands(read(page)):
        if is_block and (words[0] in cheap or words[:2] == ('linkage_chart', 'motion')):
            name, *rest = quick(words)
            done = subprocess.run(
                command(module_of(name), *rest), env=environment(fresh_domain()), cwd=tmp_path,
                capture_output=True, text=True, timeout=60, check=False,
            )  # fmt: skip
            assert done.returncode == 0, f'{" ".join(words)}: {done.stderr}'


@pytest.mark.parametrize('page', PAGES)
def test_python_runs(page, tmp_path, monkeypatch):
    found = [block for block in blocks(read(page)) if is_python(block)]
    if page in PYTHON_ELSEWHERE:
        assert found
        test = (ROOT / 'test' / PYTHON_ELSEWHERE[page]).read_text()
        assert f"read('{page}')" in test
        return
    monkeypatch.chdir(tmp_path)
    for block in found:
        run_python(block, page)


# ---------------------------------------------------------------- links


@pytest.mark.parametrize('page', PAGES)
def test_links_and_pictures_lead_somewhere(page):
    for link in links(read(page)):
        assert link.startswith('https://') or (ROOT / page).parent.joinpath(link).exists(), link


@pytest.mark.parametrize('page', PAGES)
def test_files_that_are_named_are_there(page):
    for name in re.findall(r'`((?:\w+/)+\w[\w.-]*)`', read(page)):
        if '.' in name or name.startswith('benchmarks/'):
            assert (ROOT / name).exists() or (ROOT / 'linkage_ros' / name).exists(), name


# ---------------------------------------------------------------- the checks themselves


@pytest.mark.parametrize(
    ('line', 'found'),
    [
        ('linkage_record quadrilateral run.mcap --speed 3', 'unrecognized'),
        ('linkage_record quadrilateral', 'required'),
        ('linkage_chart area', 'invalid choice'),
        ('linkage_node --ros-args -p rmp:=60.0', 'rmp'),
        ('make tea', 'tea'),
        ('python benchmarks/delay.py --fast', '--fast'),
        ('ros2 topic list', 'say so'),
        ('fastdds discovery -i 0', 'say so'),
        ('LINKAGE_ROS_CASES=9 pytest test/test_hostage.py', 'hostage'),
        ('. venv/bin/activate', 'venv'),
    ],
)
def test_a_wrong_command_is_found(line, found):
    ((words, is_block, near),) = commands(f'Type\n\n    {line}    # this\n\nand wait.\n')
    with pytest.raises((AssertionError, SyntaxError, ConfigurationError), match=found):
        check_command(words, is_block=is_block, near=near)
