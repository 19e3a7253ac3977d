# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The examples of CONTRIBUTING.md, made in a copy of the package as a contributor would."""

from __future__ import annotations

import itertools
import json
import math
import os
import re
import shutil
import subprocess
import sys
import textwrap
from importlib import import_module

import house
import pytest
import test_docs_figures as figures
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from pages import ROOT, read

GEAR = 'linkage_ros/mechanisms/cardan_gear.py'
EXAMPLE = ROOT / 'docs' / 'examples' / 'cardan_gear.py'
HEAD = '# Copyright 2026 The linkage_ros authors\n# SPDX-License-Identifier: Apache-2.0\n'


def commit_of(title):
    """(file, lines) for each name of a file in a section's blocks."""
    sections = read('CONTRIBUTING.md').split('\n## ')
    (section,) = [part for part in sections if part.startswith(title)]
    # Sentences end a block; empty lines, which are of the code, do not.
    indented = re.sub(r'^\S.*\n', '\0', section, flags=re.MULTILINE)
    blocks = [textwrap.dedent(block) for block in re.split('\0+', indented)]
    parts = [re.split(r'^# (\w[\w/]*\.\w+)\n', block, flags=re.MULTILINE)[1:] for block in blocks]
    return [
        (name, text.strip('\n') + '\n')
        for part in parts
        for name, text in zip(part[::2], part[1::2], strict=True)
    ]


def apply(root, name, text):
    """A new file, new lines at the end of one, or changes in one."""
    path = root / name
    if not any(line[0] in '+-' for line in text.splitlines() if line):
        old = path.read_text() + '\n\n' if path.exists() else HEAD
        path.write_text(old + text)
        return
    content = path.read_text()
    for change in text.split('@@\n'):
        lines = change.splitlines(keepends=True)
        old = ''.join(line[1:] for line in lines if line[0] != '+')
        new = ''.join(line[1:] for line in lines if line[0] != '-')
        # As in a patch, the end of the last line that stands is that of the old one.
        assert content.count(old.rstrip('\n')) == 1, f'{name} has not, or not once:\n{old}'
        content = content.replace(old.rstrip('\n'), new.rstrip('\n'))
    path.write_text(content)


@pytest.fixture(scope='module')
def copy(tmp_path_factory):
    """The package with both commits."""
    root = tmp_path_factory.mktemp('contribution')
    for folder in ('linkage_ros', 'config', 'test', 'docs', 'launch'):
        ignored = shutil.ignore_patterns('__pycache__')
        shutil.copytree(ROOT / folder, root / folder, ignore=ignored)
    for name in ('README.md', 'CHANGELOG.md', 'package.xml', 'pyproject.toml'):
        shutil.copy(ROOT / name, root)
    shutil.copy(EXAMPLE, root / GEAR)
    for title in ('A method', 'A mechanism'):
        for name, text in commit_of(title):
            apply(root, name, text)
    return root


def run(copy, *arguments):
    path = os.pathsep.join((str(copy), os.environ.get('PYTHONPATH', '')))
    without = {key: value for key, value in os.environ.items() if key != 'AMENT_PREFIX_PATH'}
    done = subprocess.run(
        [sys.executable, *arguments], cwd=copy, env={**without, 'PYTHONPATH': path},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


# ---------------------------------------------------------------- the method

MEASURE = """
import json
from linkage_ros.charts.accuracy import draw_accuracy
from linkage_ros.methods import accuracy, outcomes, registry
from linkage_ros.methods.bench import Bench
from linkage_ros.methods.situations import SITUATIONS
from linkage_ros.parameters.configuration import load

(two,) = [method for method in registry.METHODS if method.name == 'two circles']
accuracy.METHODS = (registry.METHODS[0], two)  # of all, these alone
linkages = (load(name).mechanism for name in ('quadrilateral', 'slider_crank'))
benches = {name: Bench(task, 24) for name, task in accuracy.tasks(*linkages).items()}
plain = lambda what, _: what
points = accuracy.measure_accuracy(benches, quick=True, progress=plain)
draw_accuracy([p for p in points if p.mechanism == 'quadrilateral'], 'it', 'it.png')
some = [s for s in SITUATIONS if s.name in ('ordinary', 'no assembly')]
cells = outcomes.measure_outcomes(some, cases=2, progress=plain, methods=accuracy.METHODS[1:])
print(json.dumps([[p.record() for p in points], [c.record() for c in cells]]))
"""


def test_the_charts_find_the_method_and_measure_what_it_is_worth(copy):
    points, cells = json.loads(run(copy, '-c', MEASURE))
    assert (copy / 'it.png').stat().st_size > 50_000
    (default, circles) = (
        {(p['mechanism'], p['mode']): p for p in points if key(p) == (name, 'position')}
        for name in ('factored closed form', 'two circles')
    )
    assert len(default) == len(circles) == 6
    for place, point in circles.items():
        if place[0] == 'near a change point':
            assert default[place]['max_error'] < 1e-15
            assert 1e-6 < point['max_error'] < 1e-3
        else:
            assert point['max_error'] < 2e-15
            assert point['us_per_state'] > 0
    assert {c['situation']: c['outcome'] for c in cells} == {
        'ordinary': 'right',
        'no assembly': 'NaN',
    }


def key(point):
    return point['method'], point['quantity']


def test_the_tests_and_docs_find_the_method(copy):
    found = run(
        copy, '-m', 'pytest', '-q', '-p', 'no:cacheprovider', 'test/test_methods.py',
        'test/test_method_charts.py', '-k', 'two and circles or place_in_the_docs or complete',
    )  # fmt: skip
    assert '4 passed' in found
    assert "('two circles', 'no assembly', NAN)," in (copy / 'test/test_stability.py').read_text()


# ---------------------------------------------------------------- the mechanism

PARAMETERS = """
/**:
  ros__parameters:
    mechanism: cardan_gear
    rpm: 120.0
    frame: {angle: 1.5707963267948966}
    crank: {length: 0.1}
    coupler: {length: 0.1, mass: 0.5, point: [0.05, 0.0]}
    slider: {mass: 2.0, damping: 30.0}
"""
TOOLS = """
from linkage_ros.parameters.configuration import load
from linkage_ros.view.drawing import Drawing
from linkage_ros.wire.urdf import make_urdf
mechanism = load('cardan_gear.yaml').mechanism
print(make_urdf(mechanism).count('<joint '), Drawing(mechanism).output)
"""


@pytest.fixture(scope='module', autouse=True)
def parameters(copy):
    (copy / 'cardan_gear.yaml').write_text(PARAMETERS)


def test_the_mechanism_passes_its_own_tests(copy):
    assert '5 passed' in run(
        copy, '-m', 'pytest', '-q', '-p', 'no:cacheprovider', 'test/test_cardan_gear.py'
    )


def test_the_reference_has_the_parameters_of_the_mechanism(copy):
    run(copy, 'docs/reference.py')
    page = (copy / 'docs' / 'reference.md').read_text()
    _, _, section = page.partition('#### `mechanism: cardan_gear`')
    assert '| `assembly` | `open` | `open` |' in section.partition('####')[0]


def test_the_mechanism_is_recorded_and_verified_as_the_textbook_has_it(copy):
    run(copy, '-m', 'linkage_ros.record', 'cardan_gear.yaml', 'run.mcap', '--duration', '1')
    verified = run(copy, '-m', 'linkage_ros.log_tool', 'verify', 'run.mcap')
    assert '200 states, every one equal to the bit' in verified
    assert 'stroke 0.4 m' in run(copy, '-m', 'linkage_ros.log_tool', 'info', 'run.mcap')
    with (copy / 'run.mcap').open('rb') as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        found = [decoded for *_, decoded in reader.iter_decoded_messages(['/joint_states'])]
    assert len(found) == 200
    for joints in found:
        check_textbook(joints)


def check_textbook(joints):
    """x = 2 r cos(alpha - delta); the torque by the power of piston, water and pinion."""
    assert list(joints.name) == ['crank', 'coupler', 'slider']
    crank, speed = joints.position[0], 4 * math.pi
    place, slope = 0.2 * math.sin(crank), 0.2 * math.cos(crank)
    assert joints.position[2] == pytest.approx(place, abs=1e-16)
    assert joints.velocity[1:] == pytest.approx([-2 * speed, slope * speed], rel=1e-14, abs=1e-14)
    push = 2.0 * (9.81 - place * speed**2) + 30.0 * slope * speed
    torque = push * slope + 0.5 * 9.81 * 0.1 * math.cos(crank)
    assert joints.effort[0] == pytest.approx(torque, rel=1e-13, abs=1e-13)


def test_charts_the_view_and_ros_find_the_mechanism(copy):
    run(copy, '-m', 'linkage_ros.chart_tool', 'motion', 'cardan_gear.yaml')
    assert (copy / 'cardan_gear_motion.csv').exists()
    assert run(copy, '-c', TOOLS) == '3 slider\n'


def test_the_new_files_are_as_the_linters_have_them(copy):
    changed = [GEAR, *(name for t in ('A method', 'A mechanism') for name, _ in commit_of(t))]
    python = [name for name in changed if name.endswith('.py')]
    run(copy, '-m', 'ruff', 'check', '--quiet', *python)
    run(copy, '-m', 'ruff', 'format', '--check', '--quiet', *python)
    lengths = [(copy / name).read_text().count('\n') for name in python if 'test/' not in name]
    assert max(lengths) < 300


def test_a_change_of_what_has_gone_is_found(tmp_path):
    (tmp_path / 'a.py').write_text('one\ntwo\ntwo\n')
    for gone in (' three\n+four\n', '-two\n+four\n'):
        with pytest.raises(AssertionError, match='has not, or not once'):
            apply(tmp_path, 'a.py', gone)
    apply(tmp_path, 'a.py', '-one\n+four\n two\n two\n')
    assert (tmp_path / 'a.py').read_text() == 'four\ntwo\ntwo\n'


# ---------------------------------------------------------------- the picture


@pytest.fixture(scope='module')
def layers():
    sys.path.insert(0, str(ROOT / 'docs'))
    try:
        yield import_module('layers')
    finally:
        sys.path.remove(str(ROOT / 'docs'))


def test_the_picture_is_that_of_the_imports(layers):
    text = layers.House(layers.floors()).svg()
    assert (ROOT / 'docs' / 'layers.svg').read_text() == text, 'run python docs/layers.py'
    assert '](docs/layers.svg)' in read('CONTRIBUTING.md')
    figures.test_a_drawing_keeps_within_its_edges_and_its_words_apart({'layers': text})


def test_every_file_has_a_room_and_arrows_lead_down(layers):
    floors = layers.floors()
    names = [floor.name for floor in floors]
    assert names == [names[0], *house.FLOORS, names[-1]]
    rooms = [len(floor.rooms) for floor in floors]
    assert sum(rooms) == len(house.MODULES - set(house.FLOORS))
    wrong = [
        (one.name, other.name)
        for one, other in itertools.product(floors, repeat=2)
        if other.name in one.below and names.index(other.name) > names.index(one.name)
    ]
    assert wrong == []
