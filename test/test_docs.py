# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The commands, programs and links of the pages work.

Cheap commands are run as they are written; others are checked by the parser of their executable.
`ros2` commands are compared with the package; other programs stand in the table of what was not
tested.
"""

import os
import re
from functools import cache
from importlib import import_module
from pathlib import Path
from subprocess import STDOUT

import pytest
import yaml
from pages import (
    PAGES,
    ROOT,
    blocks,
    commands,
    is_python,
    links,
    load_script,
    page_files,
    read,
    run_python,
)
from ros_harness import command, finished, hiding, stop, wait_for, watched
from sensor_msgs.msg import JointState
from test_managed import Supervisor

from linkage_ros import cli
from linkage_ros.errors import ConfigurationError
from linkage_ros.messages.topics import TOPICS, qualified
from linkage_ros.motion.drives.speed import SpeedDrive
from linkage_ros.quantities import build, leaves
from linkage_ros.settings.configuration import configure, read_values
from linkage_ros.settings.controller import ControllerSettings

MODULES = {
    'linkage_log': 'linkage_ros.programs.log_tool',
    'linkage_chart': 'linkage_lab.command_line',
    'linkage_export': 'linkage_lab.export',
    'linkage_import': 'linkage_lab.robots.import_tool',
}
CHARTS = [
    ('linkage_chart', word)
    for word in (
        'new',
        'sketch',
        'state',
        'motion',
        'movie',
        'economy',
        'sweep',
    )
]
CHEAP = ('linkage_record', 'linkage_replay', 'linkage_log', 'linkage_export', 'linkage_import')
OTHER_PROGRAMS = ('pip', '.', 'source', 'rerun', 'rosbags-convert')
# The programs of these pages need a log or a node; other tests run them.
PYTHON_ELSEWHERE = {
    'docs/managed.md': 'test/test_managed.py',
    'docs/mcap.md': 'test/test_foreign_readers.py',
    'lab/docs/mjcf.md': 'lab/test/test_mjcf.py',
}
README = read('README.md')
_ROWS = read('docs/faq.md').partition('## What was not tested\n')[2].splitlines()
NOT_TESTED = [name for row in _ROWS for name in re.findall('`([^`]+)`', row.partition(' | ')[0])]
# Modules that a line of a set-up brings, by a word of the line.
INSTALLED_BY = {
    './lab': ('matplotlib', 'mpmath', 'scipy'),
    '.[viewer]': ('rerun', 'rerun_bindings'),
    'rosdep': (
        'rclpy',
        'lifecycle_msgs',
        'rcl_interfaces',
        'sensor_msgs',
        'std_msgs',
        'trajectory_msgs',
    ),
    'rerun-sdk': ('rerun', 'rerun_bindings'),
    'matplotlib': ('matplotlib',),
    'scipy': ('scipy',),
    'mujoco': ('mujoco',),
    'distributed': ('dask', 'distributed'),
}
DOORS = links(README[README.index('## Start here') : README.index('## Set-up')])


# ---------------------------------------------------------------- commands are understood


def without_ros2_run(words):
    """Removes `ros2 run linkage_ros`, which does not change the meaning of an executable."""
    is_run = words[:3] == ('ros2', 'run', 'linkage_ros') and '--enclave' not in words
    return words[3:] if is_run else words


def check_executable(name, words, *, is_block):
    """Parses a command line; within a sentence it may be incomplete.

    Raises:
        SyntaxError: The executable rejects the command line.
    """
    words = [word for word in words if word not in ('[options]', '--help')]
    if name in ('linkage_node', 'linkage_controller'):
        return check_parameters(name, words)
    module = MODULES.get(name, name.replace('linkage_', 'linkage_ros.programs.'))
    try:
        import_module(module)._parser().parse_args(words)
    except SyntaxError as error:
        if is_block or 'are required' not in str(error):
            raise


def check_parameters(name, words):
    """Checks --params-file with a file from the page, -p NAME:=VALUE and -r FROM:=TO."""
    words = [word for i, word in enumerate(words) if '-r' not in (word, *words[max(0, i - 1) : i])]
    given = dict(word.split(':=', 1) for word in words if ':=' in word)
    flags = [word for word in words if ':=' not in word]
    values = {key: yaml.safe_load(value) for key, value in given.items()}
    if '--params-file' in flags:
        at = flags.index('--params-file')
        values = {**read_values(flags[at + 1]), **values}
        del flags[at : at + 2]
    assert flags in ([], ['--ros-args', *['-p'] * len(given)]), words
    if name == 'linkage_controller':
        assert set(values) <= {leaf.name for leaf in leaves(ControllerSettings)}
        build(ControllerSettings, values)
    else:
        configure(values)


def is_known_to_ros2(words):
    """Returns whether a `ros2` command uses launch arguments, topics and names of this package."""
    match words:
        case ('launch', 'linkage_ros', file, *rest):
            declared = load_script('reference').launch_arguments(ROOT / 'launch' / file)
            assert {word.partition(':=')[0] for word in rest} <= set(declared), words
        case ('launch',) | ('lifecycle', 'set'):
            pass  # in a sentence
        case ('topic', 'pub', *_, topic, kind, _):
            types = {qualified(known): known.interface.name for known in TOPICS}
            assert kind == types[topic], words
        case ('topic', 'echo' | 'hz', topic):
            assert topic in [qualified(known) for known in TOPICS], words
        case ('lifecycle', 'set', '/linkage_node', transition):
            assert transition in ('configure', 'activate', 'deactivate', 'cleanup'), words
        case ('run', 'joint_state_publisher', 'joint_state_publisher', '--ros-args', *_):
            pass  # tested by hand
        case ('run', 'controller_manager', 'spawner', *spawned, '--param-file', file):
            (manager,) = yaml.safe_load((ROOT / file).read_text())['controller_manager'].values()
            assert {*spawned} == {*manager} - {'update_rate'}
        case ('param', 'set', '/linkage_node', name, value):
            live = {leaf.name: leaf.quantity for leaf in leaves(SpeedDrive) if leaf.quantity.live}
            assert name in live, words
            live[name].clean(name, yaml.safe_load(value))
        case _:
            return False
    return True


def knows(script, options=()):
    """Returns whether a script of this clone has these options."""
    done = finished(ROOT / script, '--help')
    assert done.returncode == 0, done.stderr
    wanted = {word for word in options if word.startswith('--')}
    return wanted <= set(re.findall(r'--[\w-]+', done.stdout))


def check_command(words, *, is_block):
    """Checks that a command is valid, or in the table of what was not tested."""
    name, *rest = without_ros2_run(words)
    if name.startswith('linkage_'):
        check_executable(name, rest, is_block=is_block)
    elif name == 'make':
        targets = re.findall(r'^(\w+):', (ROOT / 'Makefile').read_text(), re.MULTILINE)
        assert set(rest) <= set(targets), words
    elif name == 'python':
        assert knows(rest[0], rest), words
    elif name not in OTHER_PROGRAMS and not (name == 'ros2' and is_known_to_ros2(rest)):
        line = ' '.join(words)
        assert line.startswith(tuple(NOT_TESTED)), f'{line}: test it or say so in docs/faq.md'


@pytest.fixture(autouse=True)
def parsers_raise(monkeypatch, tmp_path):
    """Makes parsers raise errors instead of exiting."""

    def error(self, message):
        raise SyntaxError(message)

    monkeypatch.setattr(cli.Parser, 'error', error)
    monkeypatch.chdir(tmp_path)


def write_files(page, folder):
    """Writes the files of a page, and links those that its commands read in a clone."""
    for name, text in page_files(read(page)).items():
        (folder / name).write_text(text)
    (folder / 'docs').mkdir()
    (folder / 'docs' / 'examples').symlink_to(ROOT / 'docs' / 'examples')
    (folder / 'src' / 'linkage_ros').mkdir(parents=True)
    (folder / 'src' / 'linkage_ros' / 'config').symlink_to(ROOT / 'config')


@pytest.mark.parametrize('page', PAGES)
def test_commands_are_understood_or_marked_as_not_tried(page, tmp_path):
    write_files(page, tmp_path)
    for words, is_block in commands(read(page)):
        check_command(words, is_block=is_block)


SCRIPTS = [
    path
    for folder in ('docs', 'benchmarks')
    for path in sorted((ROOT / folder).glob('*.py'))
    if '__main__' in path.read_text()
]


@pytest.mark.parametrize('path', SCRIPTS, ids=lambda path: path.name)
def test_every_script_has_help(path):
    assert knows(path)


@pytest.mark.parametrize(
    ('line', 'found'),
    [
        ('linkage_record quadrilateral run.mcap --speed 3', 'unrecognized'),
        ('linkage_node --ros-args -p rmp:=60.0', 'rmp'),
        ('make tea', 'tea'),
        ('python benchmarks/delay.py --fast', '--fast'),
        ('ros2 doctor', 'say so'),
        ('ros2 run linkage_ros linkage_log check run.mcap', 'invalid choice'),
        ('ros2 launch linkage_ros controller.launch.py speed:=600.0', 'speed'),
        ('ros2 param set /linkage_node rpm fast', 'fast'),
    ],
)
def test_wrong_command_is_detected(line, found):
    ((words, is_block),) = commands(f'Type\n\n    {line}    # this\n\nand wait.\n')
    with pytest.raises((AssertionError, SyntaxError, ConfigurationError), match=found):
        check_command(words, is_block=is_block)


# ---------------------------------------------------------------- commands and programs work


def quick(words):
    """Shortens a command, and replaces a viewer window by a file."""
    words = [re.sub('^(viewer:=)?(spawn|web)$', r'\1shown.rrd', word) for word in words]
    if '--duration' in words:
        words[words.index('--duration') + 1] = '1'
    if words[:2] == ['linkage_chart', 'economy']:
        words.append('--quick')
    if words[:2] == ['linkage_chart', 'sweep']:
        words += ['--workers', '1']
    return [*words, '--rate', '100'] if words[0] == 'linkage_replay' else words


def installed_by(words):
    """Returns the modules that a command of a set-up brings."""
    if words[0] not in ('pip', 'rosdep'):
        return set()
    return {module for word in words for module in INSTALLED_BY.get(word, ())}


def run_node(words, folder):
    """Runs a node until its joint states arrive, then sends Ctrl-C."""
    is_following = 'joint_states:=linkage/joint_states' in words
    topic = '/linkage/joint_states' if is_following else '/joint_states'
    with watched([topic], *words, cwd=folder) as (listener, process):
        robot = listener.node.create_publisher(JointState, '/joint_states', 10)
        if 'managed:=true' in words:
            Supervisor(listener).follow('configure', 'activate')

        def has_answered():
            if is_following:
                robot.publish(JointState(name=['crank'], position=[0.5]))
            return len(listener.received[topic]) > 20 or process.poll() is not None

        wait_for(has_answered)
        return stop(process)


@pytest.fixture(scope='module')
def run_page(tmp_path_factory):
    """Runs the cheap commands of a page once; returns their folder and output.

    On a page with a set-up, a command finds only what the lines above it install.
    """

    @cache
    def run(page):
        folder, printed = tmp_path_factory.mktemp('page'), {}
        write_files(page, folder)
        has_set_up = 'pip install' in read(page)
        missing = {module for modules in INSTALLED_BY.values() for module in modules}
        for line, is_block in commands(read(page)):
            words = without_ros2_run(line)
            if not is_block or '[options]' in words:  # '[options]' is a placeholder
                continue
            (folder / 'shown.rrd').unlink(missing_ok=True)
            missing -= installed_by(words)
            name, *rest = quick(words)
            if name == 'linkage_node':
                run_node(rest, folder)
            elif name in CHEAP or words[:2] in CHARTS:
                program, options = name.removeprefix('linkage_'), {}
                if has_set_up:
                    program = command(program)
                    options['env'] = os.environ | hiding(folder / 'site', missing)
                done = finished(program, *rest, cwd=folder, stderr=STDOUT, **options)
                assert done.returncode == 0, f'{" ".join(words)}: {done.stdout}'
                printed[words] = done.stdout
        return folder, printed

    return run


@pytest.mark.parametrize('page', PAGES)
def test_cheap_commands_work_as_they_are_written(page, run_page):
    run_page(page)


@pytest.mark.parametrize('page', PAGES)
def test_python_examples_run_and_doors_make_their_picture(page, run_page, monkeypatch):
    found = [one for one in blocks(read(page)) if is_python(one)]
    if page in PYTHON_ELSEWHERE:
        assert found
        assert f"read('{page}')" in (ROOT / PYTHON_ELSEWHERE[page]).read_text()
        return
    if found or page in DOORS:
        monkeypatch.chdir(run_page(page)[0])
    for one in found:
        run_python(one, page)
    if page in DOORS:
        (picture,) = re.findall(r'!\[[^]]*\]\((\S+)\)', read(page))
        assert Path(Path(picture).name).is_file()


# ---------------------------------------------------------------- links


@pytest.mark.parametrize('page', PAGES)
def test_links_pictures_and_named_files_exist(page):
    for link in links(read(page)):
        assert link.startswith('https://') or (ROOT / page).parent.joinpath(link).exists(), link
    for name in re.findall(r'`((?:\w+/)+\w[\w.-]*)`', read(page)):
        if '.' in name or name.startswith('benchmarks/'):
            assert (ROOT / name).exists() or (ROOT / 'linkage_ros' / name).exists(), name


def test_tracer_page_shows_what_its_example_prints(capsys):
    example, tape, program, result = blocks(read('docs/tracer.md'))
    exec(compile(example, 'docs/tracer.md', 'exec'), {})
    printed = re.sub(r' +$', '', capsys.readouterr().out, flags=re.MULTILINE)
    assert printed == f'{tape}\n{program}\n\n{result}\n'


# ---------------------------------------------------------------- quoted output


@pytest.mark.parametrize('page', ['sizing', 'indicator', 'designs'])
def test_page_quotes_the_output_of_its_commands(page, run_page):
    page = f'lab/docs/{page}.md'
    told, found = ' '.join(read(page).split()), []
    for words, text in run_page(page)[1].items():
        if words[1] == 'economy' and words[2].endswith('.yaml'):
            found.append(text.splitlines()[0].partition(': ')[2])
        elif words[1] == 'sweep':
            found += [line for line in text.splitlines() if ': ' in line]
        else:
            found += re.findall('^(?:driv|fluct|to first|motor |with).*', text, re.MULTILINE)
    assert found
    assert [line for line in found if line not in told] == []
