# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Builds the package as users do, with colcon and pip, and inspects the installation."""

import configparser
import json
import os
import shutil
import subprocess
import sys
from email.message import Message
from email.parser import Parser
from importlib import import_module
from pathlib import Path
from xml.etree import ElementTree as ET
from zipfile import ZipFile

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from ros_harness import assert_refused

import linkage_ros
from linkage_ros.settings.presets import preset_names, preset_path

ROOT = Path(__file__).resolve().parents[1]
EXECUTABLES = (
    *('linkage_node', 'linkage_record', 'linkage_replay', 'linkage_log'),
    'linkage_controller',
)
LAB = 'linkage_chart', 'linkage_export', 'linkage_import'
ROS_SHARE = Path('share', 'linkage_ros')
SHARED = (
    'share/ament_index/resource_index/packages/linkage_ros',
    'share/linkage_ros/package.xml',
    'share/linkage_ros/config/quadrilateral.yaml',
)
FIND = """
import json, linkage_ros, linkage_ros.settings.presets as presets
names = presets.preset_names()
path = presets.preset_path('quadrilateral')
print(json.dumps([linkage_ros.__file__, names, str(path), path.read_text()]))
"""


def copy_tree(folder: Path) -> Path:
    """Copies the checkout, without files left by builds and tools."""
    # Only at the top level: linkage_ros/log and benchmarks/reliability are source folders.
    made = ('api', 'build', 'controller', 'demo', 'dist', 'install', 'log', 'reliability')

    def ignored(path: str, names: list[str]) -> set[str]:
        junk = {name for name in names if name.startswith('.') or name.endswith('.egg-info')}
        is_top = Path(path) in (ROOT, ROOT / 'lab')
        return junk | {'__pycache__'} | set(made if is_top else ())

    return Path(shutil.copytree(ROOT, folder, ignore=ignored))


def run(*command: str | Path, cwd: Path, **variables: str) -> str:
    """Runs a command without any sourced workspace; returns its output."""
    environment = {
        key: value
        for key, value in os.environ.items()
        if not key.startswith(('AMENT_', 'COLCON_', 'PIP_', 'PYTHONPATH'))
    }
    result = subprocess.run(
        command, cwd=cwd, env=environment | variables, capture_output=True, text=True, check=False
    )
    assert result.returncode == 0, result.stdout + result.stderr
    return result.stdout


def colcon_build(tree: Path, workspace: Path, *options: str) -> None:
    """Builds as a user does in a workspace."""
    command = (sys.executable, '-m', 'colcon', 'build', '--base-paths', str(tree), *options)
    run(*command, cwd=workspace, COLCON_HOME=str(workspace))


def run_sourced(workspace: Path, *command: str) -> str:
    """Runs a command as in a shell that has sourced the built package."""
    # Not with the workspace's local_setup.bash, which fails if Python's path has a space.
    sourced = '. install/linkage_ros/share/linkage_ros/package.bash && exec "$@"'
    return run('bash', '-c', sourced, 'bash', *command, cwd=workspace)


def build_wheel(tree: Path, folder: Path, name: str = 'linkage_ros') -> Path:
    options = ('--quiet', '--no-deps', '--no-build-isolation', '--no-index')
    run(sys.executable, '-m', 'pip', 'wheel', *options, '-w', folder, tree, cwd=folder)
    (wheel,) = folder.glob(f'{name}-*.whl')
    return wheel


def missing(prefix: Path, tree: Path) -> list[str]:
    """Returns what is missing in an installation: files of the ament index, shared files."""
    owed = set(SHARED)
    for kind in ('config/*.yaml', 'launch/*.launch.py', 'rviz/*.rviz'):
        owed |= {str(ROS_SHARE / path.relative_to(tree)) for path in tree.glob(kind)}
    return sorted(path for path in owed if not (prefix / path).is_file())


def executables(folder: Path) -> set[str]:
    return {path.name for path in folder.glob('linkage_*') if os.access(path, os.X_OK)}


def check_found(printed: str, *, module_in: Path, preset_in: Path) -> None:
    """Checks the module and the preset that FIND found."""
    module, names, preset, text = json.loads(printed)
    assert Path(module).resolve().is_relative_to(module_in.resolve())
    assert Path(preset) == preset_in / 'quadrilateral.yaml'
    assert names == sorted(path.stem for path in (ROOT / 'config').glob('*.yaml'))
    assert text == (ROOT / 'config' / 'quadrilateral.yaml').read_text()


@pytest.fixture(scope='module')
def tree(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return copy_tree(tmp_path_factory.mktemp('source') / 'linkage_ros')


@pytest.fixture(scope='module')
def wheel(tree: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_wheel(tree, tmp_path_factory.mktemp('wheel'))


@pytest.fixture(scope='module')
def lab(tree: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Returns the wheel of linkage_lab."""
    return build_wheel(tree / 'lab', tmp_path_factory.mktemp('lab'), 'linkage_lab')


def read_from(wheel: Path, name: str) -> str:
    """Returns the text of a file in the metadata of a wheel."""
    with ZipFile(wheel) as archive:
        (found,) = (x for x in archive.namelist() if x.endswith(f'.dist-info/{name}'))
        return archive.read(found).decode()


@pytest.fixture(scope='module')
def metadata(wheel: Path) -> Message:
    """Returns the metadata from setup.py, as pip reads them."""
    return Parser().parsestr(read_from(wheel, 'METADATA'))


@pytest.fixture(scope='module')
def lab_metadata(lab: Path) -> Message:
    return Parser().parsestr(read_from(lab, 'METADATA'))


@pytest.mark.parametrize('options', [(), ('--symlink-install',)])
def test_colcon_build_gives_a_package_that_ros2_run_finds(
    options: tuple[str, ...], tmp_path: Path
) -> None:
    tree = copy_tree(tmp_path / 'source')
    old = tree / 'config' / 'old.yaml'
    if options:  # a build with symlinks must survive the deletion of a preset
        old.touch()
        colcon_build(tree, tmp_path, *options)
        assert (tmp_path / 'install' / 'linkage_ros' / ROS_SHARE / 'config' / old.name).is_file()
        old.unlink()
    colcon_build(tree, tmp_path, *options)

    prefix = tmp_path / 'install' / 'linkage_ros'
    assert missing(prefix, tree) == []
    assert executables(prefix / 'lib' / 'linkage_ros') == {*EXECUTABLES, *LAB}
    linked = (prefix / SHARED[-1]).is_symlink()
    assert linked == bool(options)

    printed = run_sourced(tmp_path, sys.executable, '-c', FIND)
    code, config = tree if linked else prefix, prefix / ROS_SHARE / 'config'
    check_found(printed, module_in=code, preset_in=config)
    for name in LAB:
        program = prefix / 'lib' / 'linkage_ros' / name
        told = run_sourced(tmp_path, str(program), '--version')
        assert told == f'{name} {linkage_ros.__version__}\n'
    # Without sourcing, the code still finds the presets of its own installation.
    lib = tmp_path / 'build' / 'linkage_ros' if linked else site_packages(prefix)
    printed = run(sys.executable, '-c', FIND, cwd=tmp_path, PYTHONPATH=str(lib))
    check_found(printed, module_in=code, preset_in=tree / 'config' if linked else config)


@pytest.mark.parametrize('name', LAB)
def test_program_of_the_lab_in_ros2_run_says_how_to_get_linkage_lab(
    name: str, tmp_path: Path
) -> None:
    python = tmp_path / 'python3'
    python.write_text(f'#!/bin/sh\nexec "{sys.executable}" -S "$@"\n')  # sees no linkage_lab
    python.chmod(0o755)
    environment = {'PATH': f'{tmp_path}{os.pathsep}{os.defpath}'}
    done = subprocess.run(
        [ROOT / 'scripts' / name, '--version'], env=environment, text=True,
        capture_output=True, check=False,
    )  # fmt: skip
    words = f'{name}: .*pip install src/linkage_ros/lab'
    assert_refused(done.returncode, done.stdout, done.stderr, words)


def test_pip_install_gives_executables_and_presets(
    wheel: Path, lab: Path, tree: Path, tmp_path: Path
) -> None:
    prefix = tmp_path / 'prefix'
    pip = (sys.executable, '-m', 'pip', 'install', '--quiet', '--no-deps', '--no-index')
    run(*pip, '--ignore-installed', '--no-compile', '--prefix', prefix, wheel, lab, cwd=tmp_path)

    assert missing(prefix, tree) == []
    assert executables(prefix / 'bin') == {*EXECUTABLES, *LAB}
    lib = site_packages(prefix)
    printed = run(sys.executable, '-c', FIND, cwd=tmp_path, PYTHONPATH=str(lib))
    check_found(printed, module_in=lib, preset_in=prefix / ROS_SHARE / 'config')

    first = prefix / SHARED[-1]  # the check detects a missing preset
    first.unlink()
    assert missing(prefix, tree) == [SHARED[-1]]


def site_packages(prefix: Path) -> Path:
    """Returns the folder that an installation prefix adds to the module search path."""
    (module,) = prefix.glob('**/linkage_ros/settings/presets.py')
    return module.parents[2]


def test_each_executable_names_a_function(wheel: Path, lab: Path) -> None:
    entries = configparser.ConfigParser()
    targets = {}
    for path, names in ((wheel, set(EXECUTABLES)), (lab, set(LAB))):
        entries.read_string(read_from(path, 'entry_points.txt'))
        found = dict(entries['console_scripts'])
        assert set(found) - set(targets) == names
        targets |= found
    for target in targets.values():
        module, _, function = target.partition(':')
        assert callable(getattr(import_module(module), function))


def test_every_version_is_the_same(metadata: Message, lab_metadata: Message) -> None:
    manifest = ET.parse(ROOT / 'package.xml').getroot()
    assert (manifest.tag, manifest.get('format')) == ('package', '3')
    assert manifest.findtext('export/build_type') == 'ament_python'
    assert manifest.findtext('name') == metadata['Name'].replace('-', '_')
    assert manifest.findtext('version') == metadata['Version'] == linkage_ros.__version__
    assert lab_metadata['Version'] == linkage_ros.__version__
    assert f'\nversion: {linkage_ros.__version__}\n' in (ROOT / 'CITATION.cff').read_text()
    assert f'linkage_ros=={linkage_ros.__version__}' in lab_metadata.get_all('Requires-Dist')
    assert manifest.findtext('description') == metadata['Summary']
    assert manifest.findtext('license') == 'Apache-2.0'


def test_package_xml_depends_on_all_that_the_ros_extra_brings(metadata: Message) -> None:
    manifest = ET.parse(ROOT / 'package.xml').getroot()
    packages = {element.text for element in manifest.iter('exec_depend')}
    for line in metadata.get_all('Requires-Dist', []):
        name = canonicalize_name(Requirement(line).name).removeprefix('ros-')
        if 'extra == "ros"' in line.replace("'", '"'):
            assert name.removeprefix('jazzy-').replace('-', '_') in packages


# From ros/rosdistro, 2026-08-22: keys of rosdep/python.yaml that are Debian packages on Ubuntu,
# and packages of jazzy/distribution.yaml. `rosdep install -s --os=ubuntu:noble` used only apt.
DEBIAN_KEYS = {
    *('builtin_interfaces', 'diagnostic_msgs', 'geometry_msgs', 'lifecycle_msgs'),
    *('rcl_interfaces', 'rclpy'),
    *('ros2launch', 'rosgraph_msgs', 'sensor_msgs', 'std_msgs', 'trajectory_msgs'),
    *('python3-hypothesis', 'python3-matplotlib', 'python3-numpy', 'python3-pytest'),
    *('python3-scipy', 'python3-tqdm', 'python3-yaml'),
}


def test_package_xml_has_only_keys_with_debian_packages_on_ubuntu() -> None:
    manifest = ET.parse(ROOT / 'package.xml').getroot()
    keys = {element.text for element in manifest.iter() if element.tag.endswith('_depend')}
    assert keys <= DEBIAN_KEYS
    assert 'rclpy' in keys  # the keys were found


def test_constraints_pin_what_the_metadata_ask_for(
    metadata: Message, lab_metadata: Message
) -> None:
    pinned = set()
    for line in (ROOT / 'constraints.txt').read_text().splitlines():
        if not line.startswith('#'):
            pin = Requirement(line)
            assert [mark.operator for mark in pin.specifier] == ['=='], line
            assert pin.url is None, line
            pinned.add(canonicalize_name(pin.name))
    asked = {
        canonicalize_name(Requirement(line).name)
        for each in (metadata, lab_metadata)
        for line in each.get_all('Requires-Dist', [])
    }
    assert asked - {'linkage-ros'} <= pinned


def preset(folder: Path, name: str = 'quadrilateral') -> Path:
    """Writes a preset into a new folder."""
    folder.mkdir(parents=True)
    path = folder / f'{name}.yaml'
    path.touch()
    return path


def test_presets_are_searched_in_workspace_installation_and_source(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    overlay, underlay = tmp_path / 'overlay', tmp_path / 'underlay'
    first = preset(overlay / ROS_SHARE / 'config')
    preset(underlay / ROS_SHARE / 'config')
    deleted = preset(tmp_path / 'none' / ROS_SHARE / 'config')
    deleted.unlink()
    deleted.symlink_to(tmp_path / 'gone.yaml')
    other = preset(tmp_path / 'third' / ROS_SHARE / 'config', 'other')
    folders = (tmp_path / 'none', overlay, '', underlay, tmp_path / 'third')
    monkeypatch.setenv('AMENT_PREFIX_PATH', os.pathsep.join(map(str, folders)))
    assert preset_path('quadrilateral') == first
    assert preset_path('other') == other
    assert 'other' in preset_names()
    monkeypatch.delenv('AMENT_PREFIX_PATH')
    monkeypatch.setattr(sys, 'prefix', str(tmp_path))
    assert preset_path('quadrilateral') == ROOT / 'config' / 'quadrilateral.yaml'
    installed = preset(tmp_path / ROS_SHARE / 'config')
    assert preset_path('quadrilateral') == installed
