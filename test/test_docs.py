# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The commands of the pages work, and their links and pictures lead somewhere.

Cheap commands are run as they stand; others are read by the parser of their executable. The
words of `ros2` are compared with the package; other programs that are not installed here stand
beside the words 'not tried'.
"""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import time
from importlib import import_module
from pathlib import Path

import pytest
import yaml
from pages import (
    PAGES,
    ROOT,
    blocks,
    commands,
    is_python,
    links,
    load_reference,
    page_files,
    read,
    run_python,
)
from ros_harness import command, environment, fresh_domain

from linkage_ros import cli
from linkage_ros.controller import Settings
from linkage_ros.errors import ConfigurationError
from linkage_ros.motion.drives import SpeedDrive
from linkage_ros.parameters.configuration import check_live, configure, read_values
from linkage_ros.quantities import build, leaves
from linkage_ros.wire.topics import TOPICS, qualified

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


def without_ros2_run(words):
    """An executable of the package is the same with `ros2 run linkage_ros` before it."""
    is_run = words[:3] == ('ros2', 'run', 'linkage_ros') and '--enclave' not in words
    return words[3:] if is_run else words


def check_tool(words, *, is_block):
    """The executable's own parser takes it; within a sentence it need not be complete.

    Raises:
        SyntaxError: It does not.
    """
    name, *rest = [word for word in words if word != '[options]']
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
    """What follows --ros-args: a file of the page, and -p NAME:=VALUE for existing parameters."""
    given = dict(word.split(':=', 1) for word in words if ':=' in word)
    flags = [word for word in words if ':=' not in word]
    values = {key: yaml.safe_load(value) for key, value in given.items()}
    if '--params-file' in flags:
        at = flags.index('--params-file')
        values = {**read_values(flags[at + 1]), **values}
        del flags[at : at + 2]
    assert flags in ([], ['--ros-args', *['-p'] * len(given)]), words
    if name == 'linkage_controller':
        assert set(values) <= {leaf.name for leaf in leaves(Settings)}
        build(Settings, values)
    else:
        configure(values)


def check_ros2(words):
    """Whether it is a use of this package whose words are known: `ros2` is not installed here.

    Raises:
        AssertionError: The package has no such launch argument, topic or parameter.
    """
    match words:
        case ('launch', 'linkage_ros', file, *rest):
            declared = load_reference().launch_arguments(ROOT / 'launch' / file)
            assert {word.partition(':=')[0] for word in rest} <= set(declared), words
        case ('topic', 'echo' | 'hz', topic):
            assert topic in [qualified(known) for known in TOPICS], words
        case ('param', 'set', '/linkage_node', name, value):
            assert name in [leaf.name for leaf in leaves(SpeedDrive) if leaf.quantity.live], words
            check_live(name, yaml.safe_load(value))
        case _:
            return False
    return True


def helps(program, options):
    """Whether a program that has nothing to do with ours knows these options."""
    done = subprocess.run([*program, '--help'], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert 'usage' in done.stdout.lower(), f'{program}: does not say what it is for'
    known = re.findall(r'--[\w-]+', done.stdout)
    return all(option in known for option in options if option.startswith('--'))


def check_command(words, *, is_block, near):
    """That it is understood, or said to be not tried."""
    words = without_ros2_run(words)
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
    elif not (name == 'ros2' and check_ros2(rest)):
        said = re.search(r'not\s+tried', near, re.IGNORECASE)
        assert said, f'{" ".join(words)}: test it or say so'


@pytest.fixture(autouse=True)
def parsers_raise(monkeypatch):
    """They would end the program."""

    def error(self, message):
        raise SyntaxError(message)

    monkeypatch.setattr(cli.Parser, 'error', error)


@pytest.mark.parametrize('page', PAGES)
def test_commands_are_understood_or_said_to_be_not_tried(page, tmp_path, monkeypatch):
    write_files(page, tmp_path)
    monkeypatch.chdir(tmp_path)
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
    words = [re.sub('^(viewer:=)?(spawn|web)$', r'\1shown.rrd', word) for word in words]
    return [*words, '--rate', '100'] if words[0] == 'linkage_replay' else words


def write_files(page, folder):
    for name, text in page_files(read(page)).items():
        (folder / name).write_text(text)


def run_node(words, folder):
    """A second of a node that Ctrl-C ends."""
    name, *rest = words
    process = subprocess.Popen(
        command(module_of(name), *rest), env=environment(fresh_domain()), cwd=folder,
        stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    try:
        for line in process.stderr:
            if line.endswith(' Hz\n'):
                break
        time.sleep(1)
        process.send_signal(signal.SIGINT)
        _, others = process.communicate(timeout=60)
    finally:
        process.kill()
    assert process.returncode == 0, f'{" ".join(words)}: {line}{others}'


@pytest.mark.parametrize('page', PAGES)
def test_recording_replaying_and_looking_work_as_they_stand(page, tmp_path):
    cheap = ('linkage_record', 'linkage_replay', 'linkage_log')
    write_files(page, tmp_path)
    for command_line, is_block, _ in commands(read(page)):
        words = without_ros2_run(command_line)
        (tmp_path / 'shown.rrd').unlink(missing_ok=True)
        if not is_block or '[options]' in words:  # which shows all of them
            continue
        if words[0] == 'linkage_node':
            run_node(quick(words), tmp_path)
        elif words[0] in cheap or words[:2] == ('linkage_chart', 'motion'):
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
        ('ros2 bag play run.mcap', 'say so'),
        ('ros2 run linkage_ros linkage_log check run.mcap', 'invalid choice'),
        ('ros2 launch linkage_ros controller.launch.py speed:=600.0', 'speed'),
        ('ros2 topic echo /joint_state', 'joint_state'),
        ('ros2 param set /linkage_node crank.length 1.0', 'crank.length'),
        ('ros2 param set /linkage_node rpm fast', 'fast'),
        ('fastdds discovery -i 0', 'say so'),
        ('LINKAGE_ROS_CASES=9 pytest test/test_hostage.py', 'hostage'),
        ('. venv/bin/activate', 'venv'),
    ],
)
def test_a_wrong_command_is_found(line, found):
    ((words, is_block, near),) = commands(f'Type\n\n    {line}    # this\n\nand wait.\n')
    with pytest.raises((AssertionError, SyntaxError, ConfigurationError), match=found):
        check_command(words, is_block=is_block, near=near)
