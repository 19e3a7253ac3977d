# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The launch files.

launch is not available as a wheel. The tests therefore run the files with stubs of the few names
that they import, and start the nodes as launch_ros would.
"""

import math
import re
import runpy
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from xml.etree import ElementTree as ET

import numpy as np
import pytest
import yaml
from rclpy.serialization import deserialize_message
from ros_harness import Listener, fresh_domain, running, stop, wait_for
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import JointState
from test_control_loop import PERIOD, SOLVER, START, delays, speed_errors
from test_import import CLOSE, LEG

from linkage_lab.robots import import_tool
from linkage_ros import ConfigurationError
from linkage_ros.programs.controller import SpeedController
from linkage_ros.quantities import build
from linkage_ros.settings.configuration import configure, read_values
from linkage_ros.settings.controller import ControllerSettings
from linkage_ros.units import NS_PER_S

ROOT = Path(__file__).resolve().parents[1]
DEMO, CONTROLLER, FOLLOW, ROBOT, TWO = (
    ROOT / 'launch' / f'{name}.launch.py'
    for name in ('demo', 'controller', 'follow', 'robot', 'two_linkages')
)
OWN = """
/left/linkage_node:
  ros__parameters:
    mechanism: slider_crank
    rpm: 30.0
    crank: {length: 0.05, mass: 1.0}
    coupler: {length: 0.2, mass: 0.5}
    points: {tip: {link: coupler, at: [0.1, 0.0]}}
    joint_prefix: file_
/**:
  ros__parameters: {rpm: 31.0}
"""


class Recorded(SimpleNamespace):
    """An action that records its arguments."""

    def __init__(self, *positional, **named):
        super().__init__(positional=positional, **named)


OF_LAUNCH = {
    'launch': ('LaunchContext', 'LaunchDescription'),
    'launch.actions': (
        'DeclareLaunchArgument', 'LogInfo', 'OpaqueFunction', 'Shutdown',
    ),
    'launch_ros': (),
    'launch_ros.actions': ('Node',),
}  # fmt: skip


def stand_in(monkeypatch):
    """Replaces launch and launch_ros by classes that only record their arguments."""
    monkeypatch.delitem(sys.modules, 'linkage_ros.node.launching', raising=False)
    for module, classes in OF_LAUNCH.items():
        made = ModuleType(module)
        for name in classes:
            setattr(made, name, type(name, (Recorded,), {}))
        monkeypatch.setitem(sys.modules, module, made)


@pytest.fixture
def launched(monkeypatch, tmp_path):
    """Runs a launch file; returns the started programs by executable, and its messages."""
    stand_in(monkeypatch)

    def launch(file, *installed, **arguments):
        index = tmp_path / 'share' / 'ament_index' / 'resource_index' / 'packages'
        index.mkdir(parents=True, exist_ok=True)
        for package in installed:
            (index / package).touch()
        monkeypatch.setenv('AMENT_PREFIX_PATH', str(tmp_path))
        (*declared, function) = runpy.run_path(file)['generate_launch_description']().positional[0]
        given = {action.positional[0]: action.default_value for action in declared}
        assert set(arguments) <= set(given)
        context = SimpleNamespace(launch_configurations={**given, **arguments})
        actions = function.function(context)
        started = [action for action in actions if hasattr(action, 'executable')]
        words = [action.msg for action in actions if hasattr(action, 'msg')]
        names = (getattr(action, 'name', action.executable) for action in started)
        return dict(zip(names, started, strict=True)), words

    return launch


def values_of(node):
    (path,) = node.parameters
    assert path.startswith('/proc/')  # in memory, so that a killed launch leaves no file
    return yaml.safe_load(Path(path).read_text())['/**']['ros__parameters']


def ros_arguments(node):
    """Returns the command line that launch_ros makes for a node."""
    remaps = (word for pair in node.remappings or () for word in ('-r', ':='.join(pair)))
    namespace = f'__ns:=/{node.namespace}'
    return ['--ros-args', '-r', namespace, *remaps, '--params-file', *node.parameters]


@pytest.mark.parametrize(
    ('installed', 'rviz', 'started', 'said'),
    [
        (
            (),
            'false',
            set(),
            'robot_state_publisher is not installed, so there is no tf: sudo apt',
        ),
        (('robot_state_publisher',), 'false', {'robot_state_publisher'}, ''),
        (('robot_state_publisher',), 'true', {'robot_state_publisher'}, 'rviz2 is not installed'),
        (('robot_state_publisher', 'rviz2'), 'True', {'robot_state_publisher', 'rviz2'}, ''),
    ],
)
def test_missing_package_is_reported_when_requested(launched, installed, rviz, started, said):
    nodes, words = launched(DEMO, *installed, rviz=rviz)
    assert set(nodes) == {'linkage_node'} | started
    assert len(words) == bool(said)
    assert said in ''.join(words)
    assert configure(values_of(nodes['linkage_node'])).only.kind.mechanism == 'four_bar'


def test_arguments_replace_the_values_of_a_file_of_the_namespace(launched, tmp_path):
    (tmp_path / 'own.yaml').write_text(OWN)
    file = str(tmp_path / 'own.yaml')
    nodes, _ = launched(DEMO, 'robot_state_publisher', params=file, namespace='left')
    values = values_of(nodes['linkage_node'])
    assert (values['mechanism'], values['rpm']) == ('slider_crank', 31.0)  # of the later section
    assert values['joint_prefix'] == 'file_'
    nodes, _ = launched(
        DEMO, 'robot_state_publisher', 'rviz2', params=file, namespace='left', rpm='45',
        joint_prefix='l_', frame_prefix='left/', log='1e3', log_overwrite='yes',
        use_sim_time='true', rviz='true',
    )  # fmt: skip
    values = values_of(nodes['linkage_node'])
    assert configure(values).session.log == '1e3'  # a string that looks like a number
    assert (values['rpm'], values['joint_prefix']) == (45, 'l_')
    assert values['log_overwrite'] is values['use_sim_time'] is True
    values = values_of(nodes['robot_state_publisher'])
    assert values['use_sim_time'] is True
    assert values['publish_frequency'] >= 100.0  # 20 Hz by default, too few for a turning crank
    assert {node.namespace for node in nodes.values()} == {'left'}


@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        ({'rpm': 'fast'}, "^rpm = 'fast': must be a number"),
        ({'joint_prefix': 'l/'}, 'joint_prefix'),
        ({'rviz': 'maybe'}, "^rviz = 'maybe': must be true or false$"),
        (
            {'namespace': 'right'},
            'no parameters of /right/linkage_node, only of /left',
        ),
    ],
)
def test_wrong_values_are_refused_before_anything_is_started(launched, tmp_path, arguments, words):
    (tmp_path / 'own.yaml').write_text(OWN.partition('/**')[0])
    given = {'namespace': 'left', 'params': str(tmp_path / 'own.yaml'), **arguments}
    with pytest.raises(ConfigurationError, match=words):
        launched(DEMO, **given)


def test_a_misspelt_argument_is_refused_unless_it_is_for_another_file(launched, monkeypatch):
    monkeypatch.setattr(sys, 'argv', ['ros2', 'launch', 'linkage_ros', DEMO.name, 'rmp:=60'])
    with pytest.raises(ConfigurationError, match=r"^'rmp' is not an arg.* has .*, rpm,"):
        launched(DEMO)
    monkeypatch.setattr(sys, 'argv', ['ros2', 'launch', str(DEMO), 'rpm:=60', 'rviz:=false'])
    launched(DEMO)
    # Another file includes this one, and has arguments of its own.
    monkeypatch.setattr(sys, 'argv', ['ros2', 'launch', 'robot', 'robot.launch.py', 'rmp:=60'])
    launched(DEMO)


def test_frames_of_messages_and_rviz_are_those_of_tf(launched):
    nodes, _ = launched(
        DEMO, 'robot_state_publisher', 'rviz2', frame_prefix='left/', joint_prefix='l_',
        rviz='true',
    )  # fmt: skip
    values = values_of(nodes['robot_state_publisher'])
    links = {link.get('name') for link in ET.fromstring(values['robot_description']).iter('link')}
    in_tf = {values['frame_prefix'] + link for link in links}
    assert 'left/l_crank_link' in in_tf
    values = values_of(nodes['linkage_node'])
    assert values['frame_id'] in in_tf
    option, file = nodes['rviz2'].arguments
    assert option == '-d'
    rviz = yaml.safe_load(Path(file).read_text())['Visualization Manager']
    assert rviz['Global Options']['Fixed Frame'] == values['frame_id']
    assert rviz['Views']['Current']['Target Frame'] == values['frame_id']
    (model,) = (show for show in rviz['Displays'] if show['Class'].endswith('RobotModel'))
    assert f'{model["TF Prefix"]}/' == 'left/'  # RViz itself adds the '/'
    (_, topic), = nodes['robot_state_publisher'].remappings  # fmt: skip
    assert model['Description Topic']['Value'] == topic


@pytest.mark.parametrize('linkages', [(), ('a', 'b')])
@pytest.mark.parametrize('names', [(), ('tip',), ('heel', 'tip')])
def test_rviz_shows_each_traced_point(linkages, names, launched, tmp_path):
    own = {f'points.{name}': {'link': 'coupler', 'at': [0.1, 0.0]} for name in names}
    values = {name: x for name, x in read_values('quadrilateral').items() if 'point' not in name}
    if linkages:
        values |= {'linkages': [*linkages], 'b': own}
    else:
        values |= own
    path = tmp_path / 'own.yaml'
    path.write_text(yaml.safe_dump({'/**': {'ros__parameters': values}}))
    nodes, _ = launched(DEMO, 'rviz2', params=str(path), namespace='left', rviz='true')
    _, file = nodes['rviz2'].arguments
    rviz = yaml.safe_load(Path(file).read_text())['Visualization Manager']
    shown = [
        (show['Name'], show['Topic']['Value'])
        for show in rviz['Displays'] if show['Class'].endswith('PointStamped')
    ]  # fmt: skip
    of_one = 'b/' if linkages else ''
    assert shown == [(of_one + name, f'{of_one}points/{name}') for name in names]


@pytest.mark.parametrize('file', [DEMO, FOLLOW], ids=lambda path: path.name)
def test_state_publisher_can_be_switched_off(file, launched):
    nodes, words = launched(file, 'robot_state_publisher', params='wiper', state_publisher='false')
    assert (list(nodes), words) == (['linkage_node'], [])


@pytest.mark.parametrize('file', [DEMO, CONTROLLER, FOLLOW], ids=lambda path: path.name)
def test_the_launch_ends_with_each_node_and_fails_if_it_failed(file, launched):
    nodes, _ = launched(file, **({'params': 'wiper'} if file == FOLLOW else {}))
    for name, node in nodes.items():
        (action,) = node.on_exit(SimpleNamespace(process_name=name, returncode=0), None)
        assert type(action).__name__ == 'Shutdown'
        with pytest.raises(RuntimeError, match=f'{name} ended with exit code 2'):
            node.on_exit(SimpleNamespace(process_name=name, returncode=2), None)


def first_command(nodes, topic):
    """Runs a plant and its controller; returns the first command, as CDR bytes."""
    domain = fresh_domain()
    plant, controller = (
        ros_arguments(nodes[name]) for name in ('linkage_node', 'linkage_controller')
    )
    with (
        Listener(domain, {topic: 'sensor_msgs/msg/JointState'}) as heard,
        running('node', *plant, domain=domain) as node,
        running('controller', *controller, domain=domain) as other,
    ):
        wait_for(lambda: len(heard.received[topic]) > 20)
        stop(other)
        stop(node)
    return heard.received[topic][0]


def test_controller_and_plant_accept_the_parameters_of_their_launch_file(launched):
    nodes, _ = launched(CONTROLLER, namespace='left', joint_prefix='l_', rpm='60', viewer='')
    assert b'l_crank\0' in first_command(nodes, '/left/joint_commands')


def test_plant_of_a_file_is_driven_by_the_torque_of_its_controller(launched, tmp_path):
    file = tmp_path / 'own.yaml'
    file.write_text(OWN.replace('/left/', '/'))
    nodes, _ = launched(CONTROLLER, params=str(file), torque_limit='7.0', log_level='debug')
    plant, controller = (values_of(nodes[f'linkage_{name}']) for name in ('node', 'controller'))
    assert controller['plant'] == str(file)
    assert (plant['drive'], plant['torque_limit'], plant['crank.length']) == ('torque', 7.0, 0.05)
    configure(plant)
    assert {tuple(node.ros_arguments) for node in nodes.values()} == {('--log-level', 'debug')}


LEGS = """
/**:
  ros__parameters:
    linkages: [left, right]
    rpm: 30.0
    mechanism: slider_crank
    crank: {length: 0.05, mass: 0.2}
    coupler: {length: 0.2, mass: 0.3}
    right: {slider: {mass: 2.0}}
"""


def test_controller_keeps_the_speed_of_one_of_several_linkages(launched, tmp_path):
    file = tmp_path / 'legs.yaml'
    file.write_text(LEGS)
    for linkage in ('', 'middle'):
        with pytest.raises(ConfigurationError, match=r'legs.yaml: the linkages are left, right: '):
            launched(CONTROLLER, params=str(file), linkage=linkage)
    file.write_text(LEGS.replace('0.05', '-0.05'))
    with pytest.raises(ConfigurationError, match=r'legs.yaml: .*crank.length = -0.05'):
        launched(CONTROLLER, params=str(file), linkage='right')
    file.write_text(LEGS)
    nodes, _ = launched(CONTROLLER, params=str(file), linkage='right', rpm='60')
    values = values_of(nodes['linkage_node'])
    assert (values['right.start_rpm'], 'start_rpm' in values) == (60, False)
    command = first_command(nodes, '/joint_commands')
    assert b'right_crank\0' in command
    assert b'left_crank' not in command


def test_controller_of_the_launch_file_keeps_its_speed_in_a_loop_with_delays(launched):
    nodes, _ = launched(CONTROLLER)
    plant, given = (values_of(nodes[f'linkage_{name}']) for name in ('node', 'controller'))
    count = 20
    settings, rng = build(ControllerSettings, given), np.random.default_rng(3)
    controllers = [
        SpeedController(SOLVER.mechanism, settings.rpm, settings.bandwidth, settings.lead_time)
        for _ in range(count)
    ]
    active, last = rng.integers(0, START, count), np.full(count, -NS_PER_S)
    command = np.full(count, math.nan)

    def law(measured, _, angle, speed):
        elapsed = (measured - last) * PERIOD / NS_PER_S
        for run in np.flatnonzero((measured >= active) & (measured > last)):
            gap = elapsed[run] if elapsed[run] < 0.1 else 0.0
            command[run] = controllers[run].torque(angle[run], speed[run], gap)
            last[run] = measured[run]
        return command

    angle, speed = np.zeros(count), np.full(count, plant['start_rpm'] * math.pi / 30)
    assert speed_errors(law, delays(count=count), plant['torque_limit'], angle, speed).max() < 0.05


def test_following_node_accepts_the_parameters_of_its_launch_file(launched):
    """A preset contains a speed; parameters that a measured crank does not have are omitted."""
    nodes, _ = launched(
        FOLLOW, 'robot_state_publisher', params='quadrilateral', namespace='left',
        follow_bandwidth='7', crank_joint='1e3', frame_id='shank',
    )  # fmt: skip
    model = ET.fromstring(values_of(nodes['robot_state_publisher'])['robot_description'])
    assert 'shank' in {link.get('name') for link in model.iter('link')}
    # The robot publishes both topics as well, with which these must not collide.
    for node in nodes.values():
        taken = dict(node.remappings)
        assert taken['joint_states'] == 'linkage/joint_states'
        assert taken['robot_description'] != 'robot_description'
    domain, topic = fresh_domain(), '/left/linkage/joint_states'
    with (
        Listener(domain, {topic: 'sensor_msgs/msg/JointState'}) as heard,
        running('node', *ros_arguments(nodes['linkage_node']), domain=domain) as node,
    ):
        robot = heard.node.create_publisher(JointState, '/joint_states', 10)
        wait_for(lambda: robot.get_subscription_count())
        wait_for(lambda: robot.publish(JointState(name=['1e3'], position=[0.5]))
                 or heard.received[topic])  # fmt: skip
        output = stop(node)
    assert 'follows a measured crank, filter of 7 Hz' in output


@pytest.fixture
def leg(called, tmp_path):
    """Returns the launch arguments of a leg and of the parameters imported from it."""
    urdf, params = tmp_path / 'leg.urdf', tmp_path / 'leg.yaml'
    urdf.write_text(LEG)
    assert called(import_tool, urdf, '-o', params, *CLOSE)[0] == 0
    return {'urdf': str(urdf), 'params': str(params)}


def test_each_joint_of_a_robot_has_one_state_publisher(launched, leg):
    nodes, words = launched(ROBOT, 'robot_state_publisher', measured='/motors', **leg)
    assert [line.split()[0] for line in words] == ['tf2_ros']
    topics, movable = {}, {}
    for name in ('robot_state_publisher', 'linkage_state_publisher'):
        values = values_of(nodes[name])
        model = ET.fromstring(values['robot_description'])
        topics[name] = dict(nodes[name].remappings)
        movable[name] = {
            joint.get('name') for joint in model.iter('joint') if joint.get('type') != 'fixed'
        }
        # A mimic joint would be published with both values.
        assert model.find("joint[@name='knee']/mimic") is None
        assert values['ignore_timestamp']  # both publish every message, so that the loop closes
    whole, passive = topics
    assert topics[whole] == {'joint_states': '/motors'}
    assert movable[whole] == {'hip', 'knee_motor', 'rod_joint', 'knee', 'ankle'}
    # The answers name the crank too, which this model must not have.
    domain, topic = fresh_domain(), f'/{topics[passive]["joint_states"]}'
    with (
        Listener(domain, {topic: 'sensor_msgs/msg/JointState'}) as heard,
        running('node', *ros_arguments(nodes['linkage_node']), domain=domain) as node,
    ):
        robot = heard.node.create_publisher(JointState, '/motors', 10)
        measured = JointState(name=['hip', 'knee_motor'], position=[0.3, 0.5])
        wait_for(lambda: robot.publish(measured) or heard.received[topic])
        stop(node)
    answered = set(by_name(heard.received[topic][0]))
    assert answered == {'knee_motor', 'rod_joint', 'knee'}
    assert answered & movable[passive] == {'rod_joint', 'knee'}


def test_place_of_the_plane_on_the_robot_is_published(launched, leg):
    nodes, words = launched(ROBOT, 'tf2_ros', frame_prefix='left/', **leg)
    given = nodes['static_transform_publisher'].arguments
    options = dict(zip(given[::2], given[1::2], strict=True))
    own = ET.fromstring(LEG).find("joint[@name='knee_motor']")
    x, y, z = (float(options[f'--{axis}']) for axis in 'xyz')
    turn = Rotation.from_quat([float(options[f'--q{axis}']) for axis in 'xyzw'])
    normal = turn.apply([0.0, 0.0, 1.0])
    assert options['--frame-id'] == f'left/{own.find("parent").get("link")}'
    assert options['--child-frame-id'] == values_of(nodes['linkage_node'])['frame_id']
    # The joint's axis in the URDF passes through the origin of the plane, along its normal.
    at, axis = (np.array(own.find(tag).get(name).split(), float)
                for tag, name in (('origin', 'xyz'), ('axis', 'xyz')))  # fmt: skip
    assert np.abs(np.cross(at - [x, y, z], normal)).max() < 1e-12
    assert np.abs(np.cross(axis, normal)).max() < 1e-12
    assert any('robot_state_publisher is not installed' in line for line in words)


def by_name(data):
    state = deserialize_message(data, JointState)
    return dict(zip(state.name, state.position, strict=True))


def test_two_legs_of_a_robot_are_linkages_of_one_node(launched, called, tmp_path):
    robot, params = tmp_path / 'robot.urdf', tmp_path / 'robot.yaml'
    legs = [re.sub('(joint name|link name|link)="', rf'\1="{side}_', LEG) for side in ('l', 'r')]
    parts = [ET.fromstring(leg) for leg in legs]
    parts[0].extend(parts[1])
    root = ET.SubElement(parts[0], 'link', name='body')
    for side in 'lr':
        joint = ET.SubElement(parts[0], 'joint', name=f'{side}_mount', type='fixed')
        ET.SubElement(joint, 'parent', link=root.get('name'))
        ET.SubElement(joint, 'child', link=f'{side}_base')
    robot.write_bytes(ET.tostring(parts[0]))
    for side in 'lr':
        close = [word if word.startswith('--') else f'{side}_{word}' for word in CLOSE]
        arguments = robot, '-o', params, '--linkage', f'{side}_leg', *close
        code, _, error = called(import_tool, *arguments)
        assert code == 0, error
    nodes, _ = launched(
        ROBOT, 'robot_state_publisher', 'tf2_ros', urdf=str(robot), params=str(params),
        frame_prefix='a/',
    )  # fmt: skip
    values = values_of(nodes['linkage_node'])
    configuration = configure(values)
    assert [linkage.name for linkage in configuration.linkages] == ['l_leg', 'r_leg']
    assert {x.session.frame_id for x in configuration.linkages} == {
        'a/l_leg_plane', 'a/r_leg_plane',
    }  # fmt: skip
    model = ET.fromstring(values_of(nodes['linkage_state_publisher'])['robot_description'])
    renamed = {joint.get('name') for joint in model.iter('joint') if ',' in joint.get('name')}
    assert renamed == {'l_knee_motor, measured', 'r_knee_motor, measured'}


def test_robot_with_a_state_publisher_of_its_own_gets_that_of_the_linkage(launched, leg):
    nodes, _ = launched(ROBOT, 'robot_state_publisher', state_publisher='false', **leg)
    assert set(nodes) == {'linkage_node', 'linkage_state_publisher'}
    assert 'robot_description' in dict(nodes['linkage_state_publisher'].remappings)


@pytest.mark.parametrize(
    ('text', 'words'),
    [
        (None, 'No such file'),
        ('robot', 'not XML'),
        ('<sdf/>', 'must be a URDF with the joints knee_motor'),
        (LEG.replace('"rod_joint"', '"rod"'), 'must be a URDF with the joints knee_motor'),
    ],
)
def test_model_that_is_not_the_robots_is_refused(launched, leg, tmp_path, text, words):
    other = tmp_path / 'other.urdf'
    if text is not None:
        other.write_text(text)
    with pytest.raises(ConfigurationError, match=words):
        launched(ROBOT, **{**leg, 'urdf': str(other)})


def test_two_linkages_in_one_node_turn_together_and_are_one_tree(launched):
    """This test compares names; test_urdf.py compares positions of frames."""
    nodes, words = launched(TWO, 'robot_state_publisher', right='wiper', rpm='60')
    domain, topics = fresh_domain(), {'/joint_states': 'sensor_msgs/msg/JointState'}
    with (
        Listener(domain, topics) as heard,
        running('node', *ros_arguments(nodes['linkage_node']), domain=domain) as node,
    ):
        heard.await_more(25)
        stop(node)
    assert words == []
    states = by_stamp(heard.received['/joint_states']).values()
    assert all(state['left_crank'] == state['right_crank'] for state in states)
    assert len({state['left_rocker'] for state in states}) > 20
    values = values_of(nodes['robot_state_publisher'])
    joints = ET.fromstring(values['robot_description']).findall('joint')
    assert {joint.get('name') for joint in joints} == {*next(iter(states))}
    parents = {
        joint.find('child').get('link'): joint.find('parent').get('link') for joint in joints
    }
    assert len(parents) == 6
    assert set(parents.values()) - set(parents) == {'base_link'}


def test_linkages_on_different_links_are_no_tree_of_one_launch(launched, tmp_path):
    file = tmp_path / 'two.yaml'
    values = {'linkages': ['a', 'b'], **read_values('quadrilateral'), 'b.frame_id': 'shank'}
    file.write_text(yaml.safe_dump({'/**': {'ros__parameters': values}}))
    with pytest.raises(ConfigurationError, match='frame_id: must be the same link'):
        launched(DEMO, params=str(file))


def by_stamp(messages):
    """Returns the positions of the joints by name, by stamp."""
    found = (deserialize_message(data, JointState) for data in messages)
    return {
        (one.header.stamp.sec, one.header.stamp.nanosec): dict(
            zip(one.name, one.position, strict=True)
        )
        for one in found
    }
