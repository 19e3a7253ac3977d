# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_chart state: motion and forces at one position, for every assembly."""

import csv
import json
import math

import numpy as np
import pytest
from pages import page_files, read
from ros_harness import assert_refused

from linkage_lab import command_line
from linkage_lab.charts.state import _table, assemblies, snapshots
from linkage_lab.period import SLIDING, TURNING, law_period
from linkage_ros import Solver, UnreachableError
from linkage_ros.settings.configuration import configure, load

NORTON = {
    'mechanism': 'four_bar', 'rpm': 60.0, 'crank.length': 2.0, 'coupler.length': 7.0,
    'rocker.length': 9.0, 'frame.length': 6.0,
}  # fmt: skip
CHANGE_POINT = NORTON | {
    'frame.length': 2.0, 'crank.length': 1.0, 'coupler.length': 3.0, 'rocker.length': 2.0,
    'coupler.mass': 1.0, 'loads.dry.kind': 'friction', 'loads.dry.pin': 0.1,
    'loads.dry.pin_radius': 0.01,
}  # fmt: skip
LIMITED = CHANGE_POINT | {'crank.length': 4.0, 'drive': 'follow'}
del LIMITED['rpm']


def at(values, degrees, **rest):
    return snapshots(configure(values), math.radians(degrees), 2 * math.pi, **rest)


def test_both_assemblies_of_a_textbook_four_bar():
    # Norton, Design of Machinery, problem 4-7: 2, 7, 9, 6, crank at 30 deg.
    found, notes = at(NORTON, 30.0)
    links = 'coupler', 'rocker'
    angles = {
        one.assembly: [math.degrees(one.values[f'{x}.direction'].value) for x in links]
        for one in found
    }
    assert angles['open'] == pytest.approx([88.84, 117.29], abs=0.01)
    assert angles['crossed'] == pytest.approx([-115.21, -143.66], abs=0.01)
    assert not notes


@pytest.mark.parametrize('degrees', [30.0, 200.0, 330.0])
def test_transmission_angle_is_between_coupler_and_rocker(degrees):
    found, _ = at(NORTON, degrees)
    for one in found:
        coupler, rocker = (one.values[f'{x}.direction'].value for x in ('coupler', 'rocker'))
        between = abs(math.remainder(rocker - coupler, math.tau))
        assert math.isclose(one.values['transmission_angle'].value, between, rel_tol=1e-12)


@pytest.mark.parametrize('preset', ['watt', 'shaper', 'excavator', 'compressor', 'slider_crank'])
def test_values_are_those_of_the_solver(preset):
    design = load(preset)
    place = design.drive.drawn_angle(design.mechanism)
    found, _ = snapshots(design, place, 1.5, 0.5)
    solver = Solver(design.mechanism)
    state = solver.state(place, 1.5, 0.5)
    forces = solver.reactions(state)
    values = {name: value.value for name, value in found[0].values.items()}
    for link in solver.structure.links:
        (word, _) = (SLIDING if link.slides else TURNING)[2]
        assert values[f'{link.name}.{word}'] == state[link.name].acceleration
    effort = 'force' if solver.structure.driven_link.slides else 'torque'
    assert values[f'driving_{effort}'] == state.torque
    for pin, force in forces.pins.items():
        assert (values[f'pin_{pin}.x'], values[f'pin_{pin}.y']) == tuple(force)
    # Each combination of assemblies is another position.
    words = 'position', 'direction'
    loops = {tuple(x.value for name, x in one.values.items() if name.endswith(words))
             for one in found}  # fmt: skip
    assert len(loops) == len(found) == {'watt': 4, 'shaper': 2, 'compressor': 2}.get(preset, 2)


def test_assemblies_of_a_drawing_have_the_names_of_its_links(tmp_path):
    path = tmp_path / 'scissors.yaml'
    path.write_text(page_files(read('docs/drawings.md'))[path.name])
    # A barrel and a rod have one assembly, so the table and its block are not named.
    assert [words for words, _ in assemblies(load(str(path)).mechanism)] == [
        f'{loop}, other_bar and foot {dyad}'
        for loop in ('open', 'crossed') for dyad in ('open', 'crossed')
    ]  # fmt: skip


def test_infinite_forces_at_a_change_point_leave_the_motion():
    found, notes = at(CHANGE_POINT, 0.0)
    assert [one.assembly for one in found] == ['open', 'crossed']
    assert not notes
    for one in found:
        assert one.values['rocker.angular_velocity'].value
        assert {*one.missing} == {'driving', 'joint'}
        assert 'driving_torque' not in one.values
    (near, _), _ = at(CHANGE_POINT, 90.0)
    assert not near.missing


def test_limited_crank_has_states_in_its_arc_only():
    found, _ = at(LIMITED, 30.0)
    assert len(found) == 2
    assert not found[0].missing
    with pytest.raises(UnreachableError, match='it reaches'):
        at(LIMITED, 180.0)


def test_csv_has_a_row_for_each_assembly(tmp_path, called):
    path = tmp_path / 'state.csv'
    _, out, _ = called(command_line, 'state', 'watt', '--at', '85deg', '--csv', path)
    with path.open(newline='') as stream:
        rows = [*csv.DictReader(stream)]
    assert {float(row['crank.direction [rad]']) for row in rows} == {math.radians(85.0)}
    assert out.count('driving_torque') == len(rows) == 4


@pytest.mark.parametrize(
    'words',
    [
        'state excavator --at 30deg', 'sketch excavator --at 30deg', 'state excavator --rpm 3',
        'state watt --speed 1',
    ],
)  # fmt: skip
def test_option_for_another_joint_is_refused(words, called):
    _, _, option, _ = words.split()
    assert_refused(*called(command_line, *words.split()), option)


ARM = {
    'mechanism': 'drawing', 'drawing.units': 'mm', 'drawing.frame': ['O', 'G'],
    'drawing.pins.O': [0.0, 0.0], 'drawing.pins.G': [300.0, -50.0],
    'drawing.pins.A': [200.0, 150.0], 'drawing.pins.tip': [500.0, 250.0],
    'drawing.links.arm.pins': ['O', 'A', 'tip'], 'drawing.links.arm.mass': 20.0,
    'drawing.links.arm.center': [250.0, 120.0], 'drawing.cylinders.ram.from': 'G',
    'drawing.cylinders.ram.to': 'A',
}  # fmt: skip
CARRIED = ARM | {
    'drawing.frame': ['O', 'G', 'Q'], 'drawing.pins.Q': [500.0, 0.0],
    'drawing.pins.B': [430.0, 210.0], 'drawing.links.rod.pins': ['A', 'B'],
    'drawing.links.out.pins': ['Q', 'B'], 'drawing.cylinders.far.from': 'tip',
    'drawing.cylinders.far.to': 'B',
}  # fmt: skip
LAW = {'drive': 'motion', 'motion.amplitude': 0.05, 'motion.frequency': 0.5}


def test_the_force_of_a_cylinder_is_the_torque_divided_by_its_leverage():
    driven = configure(ARM | {'drawing.input': 'ram', 'drive': 'follow'}).only
    place = driven.mechanism.drawn.position
    ((force, *_), _) = snapshots(driven, place, 0.0)
    carried = configure(CARRIED | {'drawing.input': 'arm', 'drive': 'follow'}).only
    ((torque, *_), _) = snapshots(carried, carried.mechanism.drawn.position, 0.0)
    found = torque.values['driving_torque'].value / torque.values['ram.leverage'].value
    assert math.isclose(found, force.values['driving_force'].value, rel_tol=1e-12)
    assert math.isclose(torque.values['ram.length'].value, place, rel_tol=1e-12)
    assert 'ram.tension' not in torque.values


def test_each_cylinder_has_columns_of_a_motion():
    design = configure({**CARRIED, **LAW, 'drawing.input': 'arm', 'motion.center': '37deg'}).only
    solver = Solver(design.mechanism)
    columns = law_period(solver, design.drive).columns
    values = {name: np.array(column.values) for name, column in columns.items()}
    state = solver.state(values['arm.direction'])
    tip, B = (np.array(solver.point(state, name).position) for name in ('tip', 'B'))
    assert np.allclose(values['far.length'], np.hypot(*(tip - B)), rtol=1e-12)
    speed = values['arm.angular_velocity']
    for name in ('ram', 'far'):
        rates = values[f'{name}.leverage'] * speed
        assert np.allclose(values[f'{name}.length_rate'], rates, rtol=0, atol=1e-12)
        slope = np.gradient(values[f'{name}.length'], values['time'])[1:-1]
        assert np.allclose(slope, values[f'{name}.length_rate'][1:-1], rtol=0, atol=2e-5)
        assert f'{name}.tension' not in values


def test_a_cylinder_with_a_spring_has_the_columns_of_the_spring():
    spring = {'loads.gas.kind': 'spring', 'loads.gas.cylinder': 'ram', 'loads.gas.stiffness': 9.0}
    given = CARRIED | {'drawing.input': 'arm', 'drive': 'follow'}
    found, plain = (
        snapshots(design, design.mechanism.drawn.position, 0.7)[0][0].values
        for design in (configure(given | spring).only, configure(given).only)
    )
    assert found['gas.length'] == plain['ram.length']
    assert found['gas.leverage'] == plain['ram.leverage']
    assert found['gas.tension'].value == 9.0 * found['gas.length'].value
    assert 'ram.length' not in found


@pytest.mark.parametrize('command', ['state', 'sketch'])
@pytest.mark.parametrize(('at', 'is_noted'), [('60', True), ('60deg', False), ('420deg', False)])
def test_an_angle_of_many_turns_in_rad_is_noted(command, at, is_noted, tmp_path, called):
    out = ['--out', str(tmp_path)] * (command == 'sketch')
    _, _, err = called(command_line, command, 'quadrilateral', '--at', at, *out)
    assert ('60 rad = 3437.75 deg; for 60 deg, write 60deg' in err) == is_noted


@pytest.mark.parametrize('preset', ['watt', 'quadrilateral'])
def test_the_assembly_of_the_file_is_marked(preset, called):
    _, out, _ = called(command_line, 'state', preset, '--at', '85deg')
    titles = [line for line in out.splitlines() if ': crank at ' in line]
    assert [line for line in titles if ' (as in the file): ' in line] == titles[:1]
    assert len(titles) > 1


def test_the_drawn_assembly_is_marked_and_no_other(tmp_path, called):
    path = tmp_path / 'first.yaml'
    path.write_text(page_files(read('docs/drawings.md'))[path.name])
    _, out, _ = called(command_line, 'state', path, '--at', '85deg', '--json')
    own = [one for one in json.loads(out)['assemblies'] if one['is_own']]
    assert len(own) == 1
    _, plain, _ = called(command_line, 'state', path, '--at', '85deg')
    assert plain.count('(as drawn)') == 1
    assert f'{own[0]["assembly"]} (as drawn): ' in plain


def test_a_linkage_of_several_is_chosen_by_its_name(called, tmp_path):
    norton, file = {**NORTON, 'rpm': 30.0}, tmp_path / 'two.yaml'

    def state_of(values, *linkage):
        file.write_text(json.dumps({'/**': {'ros__parameters': values}}))
        return called(command_line, 'state', file, '--at', '0.5', *linkage)

    both = {'linkages': ['left', 'right'], **norton, 'left.crank.length': 1.5}
    left, right = (state_of(both, '--linkage', name) for name in ('left', 'right'))
    assert left == state_of({**norton, 'crank.length': 1.5})
    assert right == state_of(norton) != left
    for choice in ((), ('--linkage', 'middle')):
        assert_refused(*state_of(both, *choice), 'left, right')


def test_numbers_of_any_size_are_apart_in_the_table():
    found, _ = at({**NORTON, 'points.p.link': 'coupler', 'points.p.at': [1.0, 0.5]}, 30.0)
    for number in (-1.23456e-4, -1.23456e-6, -123456.0, -1.23456e9):
        values = {name: x._replace(value=number) for name, x in found[0].values.items()}
        lines = [*_table(found[0]._replace(values=values), '')]
        (point,) = (line for line in lines if line.startswith('  p '))
        assert len(point.split()) == 7
        links = [line for line in lines if ' rad/s^2' in line and ' deg ' in line]
        assert [len(line.split()) for line in links] == 3 * [7]
