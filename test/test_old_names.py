# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Names before version 2.0: refused in files with the new lines, converted in logs."""

import json

import pytest
import yaml
from golden import LOGS, STATES, first_difference
from mcap.records import Metadata
from mcap_records import records_of, write_records
from ros_harness import report_of

from linkage_ros import ConfigurationError, LogError, __version__, load, preset_names, read_log
from linkage_ros.log.reader import LogReader
from linkage_ros.log.records import CONFIGURATION_RECORD, seal, unseal
from linkage_ros.programs import log_tool, replay
from linkage_ros.programs import record as record_module
from linkage_ros.programs.record import record
from linkage_ros.settings.configuration import configure, read_values

# The loads of the presets of version 1.0.0; its other presets had none, or have them still.
OLD_PRESETS = {
    'compressor': """
slider.damping: 25.0
load.link: slider
load.over: position
load.at: [0.0998, 0.1073, 0.1147, 0.1222, 0.1297, 0.1371, 0.1446, 0.1521, 0.1595, 0.1701, 0.1725,
          0.175, 0.1774, 0.1799]
load.value: [0.0, -36.0, -81.0, -140.0, -218.0, -323.0, -477.0, -718.0, -1129.0, -1131.0, -1131.0,
             -1131.0, -1131.0, -1131.0]
load.return_value: [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -80.0, -217.0, -470.0,
                    -1131.0]
""",
    'excavator': """
rod.damping: 2500.0
loads.payload.kind: force
loads.payload.link: crank
loads.payload.at: [1.4, 0.05]
loads.payload.force: [0.0, -9000.0]
""",
    'press': """
load.link: slider
load.over: position
load.at: [0.27, 0.29, 0.299, 0.3]
load.value: [0.0, -6000.0, -20000.0, -20000.0]
load.return_value: [0.0, 0.0, 0.0, 0.0]
friction.pin: 0.08
friction.pin_radius: 0.02
friction.guide: 0.1
""",
    'wind_pump': 'slider.damping: 60.0',
    'wiper': """
rocker.damping: 0.2
load.link: rocker
load.over: position
load.at: [0.0]
load.value: [-5.0]
load.return_value: [5.0]
""",
}
CURVE = {'load.link': 'crank', 'load.at': [0.0, 1.0], 'load.value': [1.0, 2.0]}
NEW_CURVE = {'kind': 'curve', 'link': 'crank', 'at': [0.0, 1.0], 'value': [1.0, 2.0]}
# Old parameters, and the loads that the message proposes.
FORMS = {
    'rocker': (
        {'rocker.torque': -2.0, 'rocker.damping': 0.3, 'rocker.stiffness': 5.0,
         'rocker.rest_angle': 1.7},
        {'rocker': {'kind': 'link', 'link': 'rocker', 'force': -2.0, 'damping': 0.3,
                    'stiffness': 5.0, 'rest': 1.7}},
    ),
    'slider': (
        {'slider.force': 1, 'slider.stiffness': 1.5e-5, 'slider.rest_position': 0.1},
        {'slider': {'kind': 'link', 'link': 'slider', 'force': 1, 'stiffness': 1.5e-5,
                    'rest': 0.1}},
    ),
    'rod': ({'rod.force': 5.0}, {'rod': {'kind': 'link', 'link': 'rod', 'force': 5.0}}),
    'crank': (
        {'crank.damping': 0.1}, {'crank': {'kind': 'link', 'link': 'crank', 'damping': 0.1}}
    ),
    'curve': (CURVE, {'work': NEW_CURVE}),
    'file': (
        {'load.link': 'slider', 'load.file': '/a b/on: #1.csv', 'load.bore': 0.1},
        {'work': {'kind': 'curve', 'link': 'slider', 'file': '/a b/on: #1.csv', 'bore': 0.1}},
    ),
    'friction': (
        {'friction.pin': 0.1, 'friction.pin_radius': 0.02},
        {'friction': {'kind': 'friction', 'pin': 0.1, 'pin_radius': 0.02}},
    ),
    'a load that is 0': (CURVE | {'rocker.torque': 0.0}, {'work': NEW_CURVE}),
    # In order of the old sum: the part's load, the curve, then loads by name.
    'order': (
        CURVE | {'rocker.torque': 1.0, 'loads.b.kind': 'pins', 'loads.b.damping': 1.0},
        {'A_rocker': {'kind': 'link', 'link': 'rocker', 'force': 1.0}, 'A_work': NEW_CURVE,
         'b': {'kind': 'pins', 'damping': 1.0}},
    ),
}  # fmt: skip


def refusal(values):
    """Returns names and proposed lines of the error about old names."""
    with pytest.raises(ConfigurationError) as refused:
        configure(values)
    first, *lines = str(refused.value).splitlines()
    names, _, rest = first.partition(': since version 2.0, each load is below loads')
    assert rest
    return names.split(', '), lines


@pytest.mark.parametrize(('old', 'new'), FORMS.values(), ids=FORMS)
def test_every_old_form_is_refused_with_the_lines_to_write(old, new):
    names, lines = refusal(old)
    assert names == [name for name in old if not name.startswith('loads.')]
    proposed = yaml.safe_load('\n'.join(lines))['loads']
    assert [*proposed.items()] == sorted(new.items())


def test_names_without_effect_are_to_be_left_out():
    with pytest.raises(ConfigurationError, match=r'rocker\.torque, rocker\.rest_angle: .* leave'):
        configure({'rocker.torque': 0.0, 'rocker.rest_angle': 1.0})


@pytest.mark.parametrize(
    ('present', 'replaced'),
    [({}, ''), ({'points.foot.link': 'rocker'}, ' and the section points'),
     ({'rocker.torque': 2.0}, '')],
)  # fmt: skip
def test_old_coupler_point_is_refused_with_the_lines_to_write(present, replaced):
    with pytest.raises(ConfigurationError) as refused:
        configure({'coupler.point': [0.1, 0.05], **present})
    first, *lines = str(refused.value).splitlines()
    assert f'below points, by a name of your own; replace these parameters{replaced} with' in first
    section = yaml.safe_load('\n'.join(lines))
    due = {'coupler_point': {'link': 'coupler', 'at': [0.1, 0.05]}}
    due |= {'foot': {'link': 'rocker'}} if replaced else {}
    assert section['points'] == due
    assert ('loads' in section) == ('rocker.torque' in present)


@pytest.mark.parametrize('name', OLD_PRESETS)
def test_presets_of_version_1_follow_from_the_message_with_equal_bits(name, tmp_path):
    present = {k: v for k, v in read_values(name).items() if not k.startswith('loads.')}
    names, lines = refusal(present | yaml.safe_load(OLD_PRESETS[name]))
    assert not present.keys() & names
    rows = [f'    {key}: {json.dumps(value)}' for key, value in present.items()]
    path, log = tmp_path / 'new.yaml', tmp_path / 'new.mcap'
    path.write_text('\n'.join(['/**:', '  ros__parameters:', *rows, *lines]))
    configuration = load(str(path))
    today = tmp_path / 'today.mcap'  # the golden log may be of another kind of processor
    for one, to in ((configuration, log), (load(name), today)):
        record(one, to, duration=STATES / one.session.rate_hz)
    assert not first_difference(today, log)


def test_commands_print_the_lines_below_the_error(called, tmp_path):
    text = '/**: {ros__parameters: {mechanism: four_bar, rocker.torque: 2.0, friction.pin: 0.1}}'
    (tmp_path / 'old.yaml').write_text(text)
    asked = tmp_path / 'old.yaml', tmp_path / 'out.mcap', '--duration', 1
    code, out, err = called(record_module, *asked)
    assert (code, out) == (2, '')
    first, *lines = err.splitlines()
    assert first.startswith('linkage_record: ')
    assert 'old.yaml: rocker.torque, friction.pin: since version 2.0' in first
    assert lines == [
        '    loads:',
        '      friction: {kind: friction, pin: 0.1}',
        '      rocker: {kind: link, link: rocker, force: 2.0}',
    ]


def log_of_version_1(path, preset):
    """Writes the golden log of a preset with the configuration of version 1.0.0."""
    _, *records = all_records = records_of(LOGS[preset])
    (about,) = (x for x in records if isinstance(x, Metadata) and x.name == CONFIGURATION_RECORD)
    old = yaml.safe_load(OLD_PRESETS.get(preset, 'rocker.torque: 0.0'))
    values = unseal(about.metadata)
    if 'points.coupler_point.at' in values:
        old['coupler.point'] = json.loads(values['points.coupler_point.at'])
    new = 'loads.', 'points.'
    kept = {k: v for k, v in values.items() if not k.startswith(new)}
    texts = {name: json.dumps(value) for name, value in old.items()}
    about.metadata = seal({**kept, **texts, 'version': '1.0.0'})
    return write_records(path, all_records)


@pytest.mark.parametrize('preset', [*OLD_PRESETS, 'quadrilateral'])
def test_logs_of_version_1_are_read_but_not_verified(preset, called, tmp_path):
    assert preset in preset_names()
    path = log_of_version_1(tmp_path / 'old.mcap', preset)
    old, new = LogReader(path), LogReader(LOGS[preset])
    assert len(old.configuration.mechanism.loads) == len(new.configuration.mechanism.loads)
    assert old.configuration.mechanism.points == new.configuration.mechanism.points
    assert [x.data for x in old.messages()] == [x.data for x in new.messages()]
    assert read_log(path).keys() == read_log(LOGS[preset]).keys()
    assert called(log_tool, 'csv', path, tmp_path / 'old.csv')[0] == 0
    assert called(log_tool, 'info', path)[0] == 0
    view = '--no-ros', '--viewer', tmp_path / 'old.rrd', '--rate', 10, '--playback-duration', 0.1
    assert called(replay, path, *view)[0] == 0
    with pytest.raises(LogError, match=r'names before version 2\.0; verify it with .*, 1\.0\.0$'):
        report_of(path)
    assert new.version == __version__
