# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Several linkages in one run: each has the numbers, bit for bit, of a run of it alone."""

import functools
from itertools import combinations_with_replacement

import numpy as np
import pytest
from other_bags import MS, START, write_mcap
from ros_harness import report_of, verified
from test_rerun_connection import read as read_rrd

from linkage_ros import ConfigurationError, MotionError, load, preset_names, read_log
from linkage_ros.log.bag import Bag
from linkage_ros.log.reader import LogReader
from linkage_ros.log.recover import recover
from linkage_ros.log.tables import write_csv
from linkage_ros.log.writer import LogWriter
from linkage_ros.messages.fields import Template
from linkage_ros.messages.templates import joint_state
from linkage_ros.messages.topics import JOINT_STATE
from linkage_ros.programs.log_commands import info
from linkage_ros.programs.record import record, record_measured
from linkage_ros.programs.replay import motions_in
from linkage_ros.quantities import flatten
from linkage_ros.run.batches import LinkageStates
from linkage_ros.run.robot import Robot
from linkage_ros.settings.configuration import configure, from_strings, to_strings
from linkage_ros.settings.parameters import OF_THE_RUN
from linkage_ros.view.rerun_connection import View

STATES = 6
MOTOR = {'motor.torque': 300.0, 'motor.damping': 0.5, 'start_rpm': 20.0}


def driven(preset, drive):
    """Returns the parameters of a preset with another drive; None if it cannot have it."""
    given = load(preset).parameters()
    own = {name: given[name] for name in flatten(load(preset).mechanism) if name in given}
    values = {'mechanism': given['mechanism'], **own, 'crank_angle': 0.0}
    if drive == 'torque':
        values |= MOTOR | {'crank_angle': given.get('crank_angle', 0.0)}
        values |= {x: given[x] for x in given if x.startswith('motor.')}
    elif drive == 'speed':
        values |= {'rpm': 40.0, 'start_rpm': -20.0, 'crank_acceleration': 9.0}
        values |= {'effort_command_topic': 'efforts', 'lead_time': 0.01}
    else:
        del values['crank_angle']
        (arc,) = reach.arcs if (reach := load(preset).mechanism.reach()) else (None,)
        if arc is None:
            return None
        center, width = 0.5 * sum(arc), min(1.0, 0.2 * (arc[1] - arc[0]))
        values |= {'motion.center': center, 'motion.amplitude': width, 'motion.frequency': 3.0}
        values |= {'effort_command_topic': 'efforts'}
    try:
        configure({**values, 'drive': drive})
    except ConfigurationError:
        return None
    return values


CASES = {drive: {name: values for name in preset_names() if (values := driven(name, drive))}
         for drive in ('speed', 'torque', 'motion')}  # fmt: skip


def several(drive, parts, **shared):
    """Returns the parameters of a run of several linkages, given those of each by name."""
    found = {'linkages': [*parts], 'drive': drive, **shared}
    found |= {} if drive == 'follow' else {'rate_hz': 250.0}
    for name, values in parts.items():
        for key, value in values.items():
            found[key if key in OF_THE_RUN else f'{name}.{key}'] = value
    return found


def columns(path, prefix=''):
    """Returns what a log holds of the joints, torques and points of a linkage, by name."""
    found = {}
    for topic, table in read_log(path).items():
        *_, name = topic.removeprefix(f'/{prefix}/').rpartition('/')
        if topic.startswith(f'/{prefix}/points/') or (not prefix and 'points' in topic):
            found |= {f'{name}.{key}': column for key, column in table.items()}
        elif topic in {'/joint_states', '/mechanism_state'}:
            start = f'{prefix}_' if prefix else ''
            found |= {
                f'{name} {key.removeprefix(start)}': column
                for key, column in table.items() if key.startswith(start) and key != 't'
            }  # fmt: skip
    return found


def messages(path, topic):
    found = (message for batch in Bag(path).messages(['std_msgs/msg/Float64MultiArray',
             'std_msgs/msg/Float64']) for message in batch)  # fmt: skip
    return [data for one, _, data in found if one.name == topic]


def assert_same(one, other):
    assert one.keys() == other.keys()
    for name, column in one.items():
        assert column.tobytes() == other[name].tobytes(), name


@pytest.fixture(scope='module', params=CASES)
def alone(request, tmp_path_factory):
    """Records each mechanism alone; returns the drive and the logs."""
    folder, drive = tmp_path_factory.mktemp('alone'), request.param
    for name, values in CASES[drive].items():
        run = configure({**values, 'drive': drive, 'rate_hz': 250.0})
        record(run, folder / f'{name}.mcap', duration=STATES / 250)
    return drive, folder


def test_each_of_two_linkages_has_the_bits_of_a_run_of_it_alone(alone, tmp_path):
    drive, folder = alone
    out = tmp_path / 'run.mcap'
    for first, second in combinations_with_replacement(CASES[drive], 2):
        parts = {'a': CASES[drive][first], 'b_2': CASES[drive][second]}
        configuration = configure(several(drive, parts))
        assert from_strings(to_strings(configuration)) == configuration
        record(configuration, out, duration=STATES / 250, overwrite=True)
        assert verified(out).states == STATES
        assert list(read_log(out)['/joint_states'])[1].startswith('a_')
        for name, preset in zip(parts, (first, second), strict=True):
            own = folder / f'{preset}.mcap'
            assert_same(columns(out, name), columns(own))
            assert messages(out, f'/{name}/driving_torque') == messages(own, '/driving_torque')
        if 'effort_command_topic' in parts['a']:
            efforts = zip(*(messages(folder / f'{x}.mcap', '/efforts') for x in (first, second)),
                          strict=True)  # fmt: skip
            due = [one[-8:] + other[-8:] for one, other in efforts]
            assert [data[-16:] for data in messages(out, '/efforts')] == due


# ---------------------------------------------------------------- the end of one


LEGS = {
    'linkages': ['left', 'right'], 'drive': 'motion', 'effort_command_topic': 'efforts',
    'motion.times': [0.0, 0.1], 'motion.angles': [0.0, 0.1],
    'left.motion.speeds': [0.0, 2.0], 'right.motion.speeds': [0.0, 0.0],
    **{name: value for name, value in load('quadrilateral').parameters().items()
       if name.partition('.')[0] in {'mechanism', 'frame', 'crank', 'coupler', 'rocker'}},
}  # fmt: skip


@pytest.fixture(scope='module')
def cut_short(tmp_path_factory):
    """Records two laws, of which one ends after 21 of 40 states."""
    path = tmp_path_factory.mktemp('ended') / 'run.mcap'
    with pytest.raises(MotionError, match=r'^left: .*run\.mcap keeps the 40 states of the others'):
        record(configure(LEGS), path, duration=0.2)
    return path


def test_the_end_of_one_motion_leaves_the_others_alone(cut_short, tmp_path):
    assert verified(cut_short).states == 40
    states = read_log(cut_short)['/joint_states']
    assert np.isfinite(states['right_crank.position']).all()
    assert np.isfinite(states['left_crank.position']).tolist() == 21 * [True] + 19 * [False]
    efforts = [np.frombuffer(data[-16:]) for data in messages(cut_short, '/efforts')]
    assert [bool(left) for left, _ in efforts] == 21 * [True] + 19 * [False]
    assert all(right for _, right in efforts)
    (line,) = [line for line in info(LogReader(cut_short)) if 'left ends' in line]
    assert '0.105000 s: left ends: the motion ends 0.1 s after' in line
    write_csv(cut_short, tmp_path / 'run.csv')
    *_, last = (tmp_path / 'run.csv').read_text().splitlines()
    assert last.startswith('0.195000000,,,,')
    (tmp_path / 'cut.mcap').write_bytes(cut_short.read_bytes()[:-900])
    recover(tmp_path / 'cut.mcap', tmp_path / 'saved.mcap')
    assert verified(tmp_path / 'saved.mcap').states == 40


def test_a_view_of_the_log_shows_each_linkage_in_axes_of_its_own(cut_short, tmp_path):
    log, path = LogReader(cut_short), tmp_path / 'run.rrd'
    read = functools.partial(motions_in, Robot(log.configuration))
    view = View(log.configuration, str(path), read=read)
    view.consume([(0, one.data) for one in log.messages(['/joint_states'])])
    view.close()
    found, states = read_rrd(path), read_log(cut_short)['/joint_states']
    for name, count in (('left', 21), ('right', 40)):
        shown = [row[0] for row in found[f'/{name}/values']['Scalars:scalars']]
        assert shown == states[f'{name}_crank.effort'][:count].tolist()
        assert found[f'/{name}/linkage/moving']['Points2D:labels'][0]
    layout = read_rrd(path, blueprint=True).values()
    titles = [title for view in layout for title in view.get('ViewBlueprint:display_name', ())]
    assert {'left: Linkage, m', 'right: Torque, N m'} <= {title for (title,) in titles}


def test_a_linkage_that_is_missing_without_a_reason_is_found(tmp_path, monkeypatch):
    """Negative control: without the record of its end, and after it has come back."""
    with monkeypatch.context() as patched:
        patched.setattr(LogWriter, 'write_event', lambda *_: None)
        with pytest.raises(MotionError):
            record(configure(LEGS), tmp_path / 'run.mcap', duration=0.2)
    report = report_of(tmp_path / 'run.mcap')
    assert report.states == 21
    assert 'left is missing, but no record says that its motion ended' in report.difference
    fill = LinkageStates.fill

    def fill_until(states, count, turns):
        if states.name == 'right' and states._tick >= 21:
            raise MotionError('it is tired', time=0.1, coordinates=(0.0,))
        fill(states, min(count, 21) if states.name == 'right' else count, turns)

    with monkeypatch.context() as patched:
        patched.setattr(LinkageStates, 'fill', fill_until)
        resting, path = {**LEGS, 'left.motion.speeds': [0.0, 0.0]}, tmp_path / 'tired.mcap'
        with pytest.raises(MotionError, match=r'^right: it is tired'):
            record(configure(resting), path, duration=0.2)
    assert 'right is missing, but its motion continues' in report_of(path).difference
    write = LogWriter.write_states

    def twice(log, times, stamps, numbers, linkages):
        write(log, times, stamps, numbers, linkages)
        if len(linkages) == 1:
            kept = [np.ravel(x)[:1] for x in numbers]
            write(log, times[:1], stamps[:1], [*kept[: len(kept) - 2], *kept], ('left', 'right'))

    monkeypatch.setattr(LogWriter, 'write_states', twice)
    with pytest.raises(MotionError):
        record(configure(LEGS), tmp_path / 'twice.mcap', duration=0.2)
    assert 'left reappears' in report_of(tmp_path / 'twice.mcap').difference


def test_revolutions_last_until_each_crank_has_made_them(tmp_path):
    pair = {'slow': {'rpm': -60.0}, 'fast': {'rpm': 240.0}}
    shared = {name: x for name, x in LEGS.items() if x is not None and '.' in name
              and name.partition('.')[0] in {'frame', 'crank', 'coupler', 'rocker'}}  # fmt: skip
    run = configure(several('speed', pair, mechanism='four_bar', **shared))
    assert record(run, tmp_path / 'run.mcap', revolutions=2) == 500
    motor = {'drive': 'torque', 'motor.torque': 2.0, 'gravity': [0.0, 1e-9]}
    pair = {'slow': {'start_rpm': 60.0}, 'fast': {'start_rpm': 240.0}}
    values = several('torque', pair, mechanism='four_bar', **shared) | motor
    count = record(configure(values), tmp_path / 'torque.mcap', revolutions=2)
    slow = {'mechanism': 'four_bar', **shared, **motor, 'start_rpm': 60.0, 'rate_hz': 250.0}
    assert count == record(configure(slow), tmp_path / 'slow.mcap', revolutions=2)
    assert verified(tmp_path / 'torque.mcap').states == count


# ---------------------------------------------------------------- parameters


def test_parameters_at_the_top_are_overlaid_name_by_name():
    found = configure({**LEGS, 'left.crank.length': 0.09, 'gravity': [1.0, 2.0]})
    left, right = found.linkages
    assert (left.mechanism.crank.length, right.mechanism.crank.length) == (0.09, 0.1)
    assert left.mechanism.gravity == right.mechanism.gravity == (1.0, 2.0)
    values = found.parameters()
    assert (values['crank.length'], values['left.crank.length']) == (0.1, 0.09)
    assert 'right.crank.length' not in values
    assert (values['left.joint_prefix'], values['right.joint_prefix']) == ('left_', 'right_')
    assert [joint.name for joint in right.robot_joints][:2] == ['right_crank', 'right_coupler']
    assert values.keys() <= found.leaves().keys()
    assert found.linkage('left') is left
    for name in ('', 'middle'):
        with pytest.raises(ConfigurationError, match='left, right'):
            found.linkage(name)


REFUSED = {
    'a parameter': ({'linkages': ['crank']}, "'crank' is a parameter"),
    'a group': ({'linkages': ['loads']}, "'loads' is a parameter"),
    'a topic': ({'linkages': ['joint_states']}, "'joint_states' is a topic"),
    'a topic of the user': (
        {'linkages': ['arm'], 'effort_command_topic': '/arm'}, "'arm' is a topic"
    ),
    'a boolean': ({'linkages': ['off']}, 'ROS reads it as a boolean'),
    'two underscores': ({'linkages': ['a__b']}, 'single underscores'),
    'a digit': ({'linkages': ['2nd']}, 'must be a list of names'),
    'twice': ({'linkages': ['a', 'a']}, 'named twice'),
    'none': ({'linkages': []}, 'must be a list of names'),
    'of the top': ({'rmp': 1.0}, "^'rmp' is not a parameter of a four_bar"),
    'of the run': ({'left.log': 'a.mcap'}, 'left.log: log is of the whole run'),
    'unknown': ({'left.rmp': 1.0}, "left: 'rmp' is not a parameter of a four_bar"),
    'another drive': ({'left.drive': 'speed'}, 'left.drive: drive is of the whole run'),
    'one frame on two links': (
        {'left.plane.link': 'thigh', 'right.plane.link': 'shank'},
        'left and right have one frame_id',
    ),
    'one joint name': ({'right.joint_prefix': 'left_'}, "left and right each have a joint 'left_"),
    'one robot joint': (
        {'joints.crank.name': 'knee'}, "left and right each have a joint 'knee'"
    ),
    'one measured name': (
        {'left.crank_joint': 'right_rocker'}, "left and right each have a joint 'right_rocker'"
    ),
    'no mechanism': ({'linkages': ['left'], 'mechanism': None}, 'mechanism is missing'),
    'no loop': ({'right.crank.length': 9.0}, 'right: the longest link'),
}  # fmt: skip


@pytest.mark.parametrize('name', REFUSED)
def test_parameters_that_cannot_be_are_refused_with_the_linkage(name):
    changes, words = REFUSED[name]
    values = {key: value for key, value in {**LEGS, **changes}.items() if value is not None}
    with pytest.raises(ConfigurationError, match=words):
        configure(values)


# ---------------------------------------------------------------- measurements

FOLLOWERS = {
    name: {
        'mechanism': load(preset).parameters()['mechanism'],
        **{x: y for x, y in load(preset).parameters().items()
           if x in flatten(load(preset).mechanism)},
    }
    for name, preset in (('leg', 'quadrilateral'), ('boom', 'excavator'), ('arm', 'shaper'))
}  # fmt: skip
TORQUES = {'effort_command_topic': 'efforts', 'lead_time': 0.002}
MEASURED, OUT_OF_REACH = ('leg_crank', 'boom_rod', 'arm_crank'), 9.0
REFUSED_BOOM = {1, 5}  # beside the others, and in a message of its own


def measured(n):
    """Returns a message that names some of the cranks, and the linkages that must answer it."""
    held = [name for i, name in enumerate(FOLLOWERS) if n % 8 in {0, 1, i + 2, 6 + i}]
    held = ['boom'] if n % 8 == 5 else held
    values = {'leg_crank': 0.05 * n, 'boom_rod': 0.95 + 1e-3 * n, 'arm_crank': 3.0 - 0.04 * n}
    values |= {'boom_rod': OUT_OF_REACH} if n % 8 in REFUSED_BOOM else {}
    names = ['wrist', *(joint for joint in MEASURED if joint.partition('_')[0] in held)]
    row = [0.1, *(values[joint] for joint in names[1:])]
    template = Template(joint_state(names, ''))
    data = template.pack(*divmod(START + n * MS, 10**9), *row, *(0.2 * x for x in row), *row)
    answering = [x for x in held if not (x == 'boom' and n % 8 in REFUSED_BOOM)]
    return ('/joint_states', JOINT_STATE, START + n * MS + 700, data), answering


def test_each_measured_linkage_has_the_bits_of_a_run_of_it_alone(tmp_path):
    """Messages name all cranks, some or none; one is out of reach at times."""
    messages_and_answers = [measured(n) for n in range(80)]
    bag = write_mcap(tmp_path / 'robot.mcap', [one for one, _ in messages_and_answers])
    out, due = tmp_path / 'run.mcap', [x for _, x in messages_and_answers if x]
    answers = record_measured(configure(several('follow', FOLLOWERS, **TORQUES)), out, bag)
    assert answers.states == len(due) == verified(out).states
    causes = {cause: count for cause, count in answers.rejected.items() if 'crank' not in cause}
    assert causes == {'boom: out of reach': 20}
    last = dict.fromkeys(FOLLOWERS, 0.0)
    alone = {}
    for name, values in FOLLOWERS.items():
        run = {**values, **TORQUES, 'drive': 'follow', 'joint_prefix': f'{name}_'}
        record_measured(configure(run), own := tmp_path / f'{name}.mcap', bag)
        table = read_log(own)['/joint_states']
        for key, column in read_log(out)['/joint_states'].items():
            if key.startswith(f'{name}_'):
                assert column[~np.isnan(column)].tobytes() == table[key].tobytes(), key
        alone[name] = iter([np.frombuffer(data[-8:])[0] for data in messages(own, '/efforts')])
    efforts = iter(messages(out, '/efforts'))
    for n, (_, answered) in enumerate(messages_and_answers):
        last |= {'boom': 0.0} if n % 8 in REFUSED_BOOM else {}
        last |= {name: next(alone[name]) for name in answered}
        if answered:
            assert np.frombuffer(next(efforts)[-24:]).tolist() == list(last.values())
    assert [*efforts] == []
