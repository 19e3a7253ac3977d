# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Notes on values that are probably mistakes, and their absence for plausible mechanisms."""

import math
import re
from pathlib import Path

import numpy as np
import pytest
from mechanisms import ALL
from pages import PAGES, blocks, read

from linkage_ros.errors import ConfigurationError, ParameterWarning
from linkage_ros.mechanism.registry import MECHANISMS
from linkage_ros.programs import log_tool
from linkage_ros.programs import record as record_module
from linkage_ros.quantities import flatten
from linkage_ros.settings.configuration import configure, load
from linkage_ros.settings.notes import notes
from linkage_ros.settings.presets import preset_names
from linkage_ros.settings.yaml_file import read_parameter_file

KINDS = {kind: name for name, kind in MECHANISMS.items()}
GOOD = {
    'mechanism': 'slider_crank', 'rpm': 60.0, 'crank.length': 0.06, 'coupler.length': 0.18,
    'coupler.mass': 0.6, 'coupler.center': [0.06, 0.0], 'coupler.inertia': 0.002,
    'slider.mass': 0.4,
}  # fmt: skip
FORCE = {'loads.x.kind': 'force', 'loads.x.link': 'coupler', 'loads.x.force': [1.0, 0.0]}


def law(times, angles, **more):
    return {
        **{name: value for name, value in GOOD.items() if name != 'rpm'}, 'drive': 'motion',
        'motion.times': list(map(float, times)), 'motion.angles': list(map(float, angles)),
        'rate_hz': 1000.0, **{f'motion.{name}': value for name, value in more.items()},
    }  # fmt: skip


@pytest.mark.parametrize(
    ('changed', 'name'),
    [
        ({'coupler.mass': 600.0}, 'coupler.mass'),
        ({'slider.mass': 400.0}, 'slider.mass'),
        ({'crank.mass': 300.0}, 'crank.mass'),
        ({'coupler.center': [60.0, 0.0]}, 'coupler.center'),
        ({'points.x.link': 'coupler', 'points.x.at': [-10.0, 60.0]}, 'points.x.at'),
        ({**FORCE, 'loads.x.at': [50.0, 0.0]}, 'loads.x.at'),
        ({'rpm': 3000.0}, 'rate_hz'),
        ({'rpm': -3000.0}, 'rate_hz'),
        ({'rpm': 300.0, 'rate_hz': 20.0}, 'rate_hz'),
    ],
)
def test_probable_mistake_in_one_parameter_is_noted_by_its_name(changed, name):
    assert notes(configure(GOOD)) == []
    (line,) = notes(configure({**GOOD, **changed}))
    assert line.startswith(f'{name} = ')


SINE = {**{name: x for name, x in GOOD.items() if name != 'rpm'}, 'drive': 'motion',
        'motion.amplitude': 0.1, 'motion.frequency': 0.5}  # fmt: skip


@pytest.mark.parametrize(
    ('center', 'is_noted'), [(60.0, True), ('60deg', False), ('417deg', False), (1.0, False)]
)
def test_center_of_a_sine_of_more_than_a_turn_in_rad_is_noted(center, is_noted):
    found = notes(configure({**SINE, 'motion.center': center}))
    assert [line[:19] for line in found] == ['motion.center = 60 '] * is_noted


def test_mass_of_a_disc_is_plausible_by_its_inertia():
    """A flywheel of 600 kg and 0.5 m radius on a short coupler."""
    heavy = {**GOOD, 'coupler.mass': 600.0, 'coupler.inertia': 75.0}
    assert notes(configure(heavy)) == []


def test_mass_of_a_crank_may_be_that_of_a_disc_larger_than_its_pin_distance():
    assert notes(configure({**GOOD, 'crank.length': 0.01, 'crank.mass': 2.0})) == []


@pytest.mark.parametrize(
    ('given', 'is_noted'),
    [
        ({'amplitude': 1.0, 'frequency': 50.0}, False),
        ({'amplitude': 1.0, 'frequency': 200.0}, True),
        ({'times': [0.0, 0.02], 'angles': [0.0, math.tau], 'repeat': True}, False),
        ({'times': [0.0, 0.02], 'angles': [0.0, 20 * math.tau], 'repeat': True}, True),
        ({'times': [0.0, 0.005], 'angles': [0.0, 1.0]}, False),
    ],
)
def test_few_states_in_a_period_of_a_law_are_noted(given, is_noted):
    values = {f'motion.{name}': value for name, value in given.items()}
    rest = {name: value for name, value in GOOD.items() if name != 'rpm'}
    own = notes(configure({**rest, 'drive': 'motion', 'rate_hz': 1000.0, **values}))
    assert [line.startswith('rate_hz = ') for line in own] == [True] * is_noted


def smooth(name, times):
    """Returns smooth angles that are plausible for a law."""
    end = times[-1]
    x = times / end
    return {
        'sine': 0.5 * np.sin(math.tau * x),
        'seventh harmonic': np.sin(math.tau * x) + 0.05 * np.sin(7 * math.tau * x),
        'quintic rise': 10 * x**3 - 15 * x**4 + 6 * x**5,
        'cubic': 3 * x**2 - 2 * x**3,
        'ramp': np.interp(x, (0.0, 0.25, 0.75, 1.0), (0.0, 0.0, 1.0, 1.0)),
        'triangle': abs((4 * x) % 2 - 1),
        'jump': np.where(x < 0.5, 0.0, 1e-3),
        'rest': np.full_like(x, 0.3),
        'steady': x * math.tau,
    }[name]


SMOOTH = (
    'sine', 'seventh harmonic', 'quintic rise', 'cubic', 'ramp', 'triangle', 'jump', 'rest',
    'steady',
)  # fmt: skip


def sampled(count, jitter):
    """Returns times from 0 to 10 s, whose steps differ from their mean by up to 2 x jitter."""
    times, step = np.linspace(0.0, 10.0, count), 10.0 / (count - 1)
    errors = np.random.default_rng(1).uniform(-jitter, jitter, count - 2)
    return np.concatenate([[0.0], times[1:-1] + step * errors, [10.0]])


@pytest.mark.parametrize('name', SMOOTH)
@pytest.mark.parametrize('count', [5, 50, 400])
@pytest.mark.parametrize('jitter', [0.0, 0.3])
def test_smooth_points_are_not_noted(name, count, jitter):
    times = sampled(count, jitter)
    assert notes(configure(law(times, smooth(name, times)))) == []


@pytest.mark.parametrize(
    ('step', 'count', 'is_noted'),
    [
        (math.radians(0.1), 400, True),  # one digit of degrees
        (math.tau / 4096, 400, True),  # counts of an encoder
        (0.01, 400, True),
        (1e-9, 400, False),
        (1e-6, 4000, False),
        (0.01, 15, False),  # too few points to tell
    ],
)
@pytest.mark.parametrize('name', ['sine', 'quintic rise'])
@pytest.mark.parametrize('jitter', [0.0, 0.3])
def test_rounded_points_are_noted(name, step, count, is_noted, jitter):
    times = sampled(count, jitter)
    angles = step * np.round(smooth(name, times) / step)
    own = notes(configure(law(times, angles)))
    assert len(own) == is_noted
    # Exact speeds do not help: they contradict the points.
    slopes = np.gradient(smooth(name, times), times).tolist()
    assert len(notes(configure(law(times, angles, speeds=slopes)))) == is_noted


@pytest.mark.parametrize('name', ALL)
def test_plausible_mechanisms_are_not_noted(name):
    mechanism = ALL[name]
    kind = KINDS[type(mechanism)]
    values = {
        field: list(value) if isinstance(value, tuple) else value
        for field, value in flatten(mechanism).items()
        if value is not None and not (field == 'assembly' and kind == 'inverted_slider_crank')
    }
    drive = {} if kind == 'wind_pump' else {'drive': 'follow'}
    if values.get('input') == 'cylinder':
        values['assembly'] = mechanism.assembly
    own = notes(configure({'mechanism': kind, **drive, **values}))
    # 40 turns of the frame are intended.
    assert [line for line in own if not line.startswith('frame.angle')] == []


@pytest.mark.parametrize('name', preset_names())
def test_presets_are_not_noted(name):
    assert notes(load(name)) == []


def test_parameter_files_of_the_pages_are_not_noted(tmp_path):
    count = 0
    for text in [block for page in PAGES for block in blocks(read(page))]:
        path = tmp_path / 'page.yaml'
        path.write_text(text)
        try:
            configuration = load(str(path))
        except ConfigurationError:  # of another node, or with a file
            continue
        # Some have no masses, because they are about paths.
        assert [x for x in notes(configuration) if 'torque is 0' not in x] == [], text
        count += 1
    assert count >= 5


HEAD = '/**:\n  ros__parameters:\n'


@pytest.mark.parametrize(
    ('text', 'name', 'lines'),
    [
        (f'{HEAD}    rpm: 60.0\n    rate_hz: 9.0\n    rpm: 90.0\n', 'rpm', (3, 5)),
        (f'{HEAD}    crank: {{mass: 1.0, mass: 2.0}}\n', 'crank.mass', (3, 3)),
        (f'{HEAD}    crank.mass: 1.0\n    crank: {{mass: 2.0}}\n', 'crank.mass', (3, 4)),
        (f'{HEAD}    rpm: 1.0\n{HEAD}    rpm: 2.0\n', 'rpm', (3, 6)),
    ],
)
def test_name_given_twice_in_a_section_is_a_warning(tmp_path, text, name, lines):
    path = tmp_path / 'twice.yaml'
    path.write_text(text)
    with pytest.warns(ParameterWarning) as found:
        values = read_parameter_file(path)
    (words,) = [str(warning.message) for warning in found]
    assert repr(name) in words
    assert re.findall(r'\d+', words.partition(repr(name))[2]) == list(map(str, lines))
    assert values[name] in {90.0, 2.0}  # the last one


def test_many_names_given_twice_are_one_note(tmp_path):
    path = tmp_path / 'twice.yaml'
    names = ''.join(f'    n{i}: 1\n' for i in range(5000))
    path.write_text(HEAD + names + names)
    with pytest.warns(ParameterWarning) as found:
        read_parameter_file(path)
    (words,) = [str(warning.message) for warning in found]
    assert '4994 more' in words
    assert len(words) < 500 + len(str(path))


@pytest.mark.parametrize(
    'text',
    [
        f'{HEAD}    rpm: 60.0\nlinkage_node:\n  ros__parameters:\n    rpm: 90.0\n',
        f'{HEAD}    crank: {{mass: 1.0}}\n    crank: {{length: 2.0}}\n',
        f'{HEAD}    crank: {{mass: 1.0}}\n    slider: {{mass: 2.0}}\n',
    ],
)
def test_names_of_different_sections_or_groups_are_no_warning(tmp_path, text):
    path = tmp_path / 'once.yaml'
    path.write_text(text)
    read_parameter_file(path)


def test_programs_print_a_name_given_twice_once(tmp_path, called):
    text = Path('config/quadrilateral.yaml').read_text()
    path = tmp_path / 'twice.yaml'
    path.write_text(text.replace('rpm: 150.0', 'rpm: 150.0\n    rpm: 60.0'))
    code, _, error = called(record_module, path, tmp_path / 'o.mcap', '--duration', '0.01')
    assert code == 0
    assert len(re.findall("^note: .*'rpm'", error, re.MULTILINE)) == 1
    # The log contains one value.
    code, out, error = called(log_tool, 'info', tmp_path / 'o.mcap')
    assert (code, error) == (0, '')
    assert 'note' not in out


@pytest.mark.parametrize(
    ('changes', 'words'),
    [
        ({'units': 'm'}, 'the longest link, arm, has 120.83 m; did you mean units: mm'),
        ({'pins.A': [0.015, 0.02], 'pins.B': [0.07, 0.045], 'pins.Q': [0.075, 0.0],
          'links.arm.mass': 0.0}, 'did you mean units: m'),
        ({'links.arm.center': [9e4, 0.0]}, 'center of arm is 90 m from its link'),
        ({'units': 'mm'}, ''),
    ],
)  # fmt: skip
def test_units_of_a_drawing_are_doubted(changes, words):
    found = notes_on_drawing(changes)
    assert bool(found) == bool(words)
    assert words in ''.join(found[:1])


def notes_on_drawing(changes, drive='speed', others=()):
    """Returns the notes on a four-bar drawn in mm, of which some values are changed."""
    values = {
        'units': 'mm', 'input': 'crank', 'frame': ['O', 'Q'], 'pins.O': [0.0, 0.0],
        'pins.A': [30.0, 40.0], 'pins.B': [140.0, 90.0], 'pins.Q': [150.0, 0.0],
        'links.crank.pins': ['O', 'A'], 'links.arm.pins': ['A', 'B'], 'links.arm.mass': 0.5,
        'links.arm.center': [75.0, 80.0], 'links.rocker.pins': ['Q', 'B'], **changes,
    }  # fmt: skip
    drawing = {f'drawing.{name}': value for name, value in values.items()}
    rpm = {'rpm': 60.0} if drive == 'speed' else {}
    return notes(
        configure({'mechanism': 'drawing', 'drive': drive, **rpm, **drawing, **dict(others)})
    )


def test_mass_in_g_of_a_drawing_is_noted():
    (line,) = notes_on_drawing({'links.arm.mass': 500.0})
    assert line.startswith('drawing.links.arm.mass = 500 kg')


PARALLELOGRAM = {'pins.A': [30.0, 40.0], 'pins.B': [130.0, 40.0], 'pins.Q': [100.0, 0.0]}


@pytest.mark.parametrize(
    ('changes', 'sums'),
    [
        ({}, []),
        ({'pins.B': [130.001, 40.0]}, ['0.0016 mm']),
        ({'pins.B': [130.001, 40.0], 'links.arm.length': 100.0, 'links.rocker.length': 50.0}, []),
        ({'pins.B': [130.1, 40.0]}, []),  # 0.1 mm is no rounding error
        ({'units': 'm', 'pins.A': [0.03, 0.04], 'pins.B': [0.130001, 0.04], 'pins.Q': [0.1, 0.0],
          'links.arm.center': [0.07, 0.04]}, ['1.6e-06 m']),
    ],
)  # fmt: skip
def test_parallelogram_that_is_nearly_one_is_noted_with_its_sum(changes, sums):
    found = notes_on_drawing({**PARALLELOGRAM, **changes}, drive='follow')
    assert len(found) == bool(sums)
    for value in sums:
        assert value in found[0]
        assert 'rocker' in found[0]
        assert 'drawing.links.' in found[0]
        with pytest.raises(ConfigurationError, match=r'turn fully: .* give .* their length'):
            notes_on_drawing({**PARALLELOGRAM, **changes})


RAM = {
    'frame': ['O', 'Q'], 'pins.S': [260.0, 120.0], 'links.rod.pins': ['B', 'S'],
    'slides.ram.pin': 'S', 'slides.ram.direction': [1.0, 0.0], 'slides.ram.mass': 1.0,
}  # fmt: skip


@pytest.mark.parametrize(
    ('pin', 'link', 'acting'),
    [('S', '', 'rod'), ('S', 'ram', ''), ('S', 'rod', ''), ('B', '', '')],
)
def test_force_at_the_pin_of_a_slide_that_acts_on_another_link_is_noted(pin, link, acting):
    load = {'kind': 'force', 'pin': pin, 'link': link, 'force': [-800.0, 0.0]}
    given = {f'loads.cutting.{name}': value for name, value in load.items() if value}
    found = notes_on_drawing(RAM, others=given)
    if not acting:
        assert found == []
        return
    (line,) = found
    assert line.startswith(f'loads.cutting: the force at {pin} acts on {acting}, not on')
    assert 'write link: ram' in line
