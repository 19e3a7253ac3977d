# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The live view of what a torque drives: wind pumps, limited cranks, and their curves."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from test_rerun_view import read, show

from linkage_ros.dynamics.solver import Solver
from linkage_ros.motion.drives import SpeedDrive
from linkage_ros.palette import COLORS
from linkage_ros.parameters.configuration import configure, load
from linkage_ros.parameters.presets import preset_names
from linkage_ros.run.machine import Machine
from linkage_ros.view.axes import MARKS, GrowingAxes, axis
from linkage_ros.view.drawing import Drawing
from linkage_ros.view.rerun_view import Sample
from linkage_ros.view.scene import Scene, angles_of
from linkage_ros.view.series import Directions, Flow

PUMP = load('wind_pump')
TURN = 2 * math.pi
# A crank that hangs, and swings within 157 deg about the line to the rocker's pivot.
HANGING = {
    'mechanism': 'four_bar', 'drive': 'torque', 'crank_angle': -2.0,
    'frame.length': 0.4, 'frame.angle': -math.pi / 2,
    'crank.length': 0.3, 'crank.mass': 1.0, 'crank.inertia': 0.01, 'crank.center': [0.15, 0.0],
    'coupler.length': 0.2, 'coupler.mass': 1.0, 'coupler.inertia': 0.005,
    'coupler.center': [0.1, 0.0], 'coupler.point': [0.1, 0.06],
    'rocker.length': 0.25, 'rocker.mass': 1.0, 'rocker.inertia': 0.005,
    'rocker.center': [0.12, 0.0],
}  # fmt: skip
SPEED_ALONE = {
    'drive',
    'rpm',
    'start_rpm',
    'crank_acceleration',
    'effort_command_topic',
    'lead_time',
}


def under_torque(configuration, **changed):
    """The same mechanism, driven by a torque."""
    kept = {k: v for k, v in configuration.parameters().items() if k not in SPEED_ALONE}
    return configure({**kept, 'drive': 'torque', 'motor.torque': 6.0, **changed})


def run_of(configuration, seconds, rate=200):
    machine = Machine(configuration)
    motion, samples = machine.begin(0), []
    for stamp in range(0, round(seconds * 10**9), 10**9 // rate):
        values = machine.snapshot_at(motion, stamp).values
        samples.append(Sample(stamp, values.position, values.velocity, values.effort))
    return samples


@pytest.fixture(scope='module')
def pumped():
    """The pump's first 15 s: six turns, on the way to its slow state."""
    return run_of(PUMP, 15.0)


def arrays(samples):
    return [np.array(column) for column in zip(*samples, strict=True)]


def advanced(configuration, samples, batch):
    """All rows of a scene: {entity: (stamps, values)}."""
    scene, found = Scene(configuration), {}
    for start in range(0, len(samples), batch):
        for rows in scene.advance(*arrays(samples[start : start + batch])):
            found.setdefault(rows.entity, []).append((rows.stamps, rows.values))
    return {
        entity: tuple(np.concatenate(parts) for parts in zip(*pieces, strict=True))
        for entity, pieces in found.items()
    }


# ---------------------------------------------------------------- directions

DRAG_LINK = {  # coupler and rocker turn fully, with the crank
    **load('quadrilateral').parameters(), 'frame.length': 0.1, 'crank.length': 0.4,
    'coupler.length': 0.35, 'rocker.length': 0.42, 'crank_angle': 40.0,
}  # fmt: skip


@pytest.mark.parametrize(
    'configuration',
    [PUMP, configure(HANGING), configure(DRAG_LINK),
     configure({**load('quadrilateral').parameters(), 'frame.angle': 3.0, 'rpm': -400.0}),
     load('compressor')],
    ids=['pump', 'hanging', 'drag-link', 'about-pi', 'compressor'],
)  # fmt: skip
@pytest.mark.parametrize('batch', [1, 700])
def test_directions_are_those_of_the_links_without_jumps(configuration, batch):
    samples = run_of(configuration, 1.5, rate=500)
    _, position, *_ = arrays(samples)
    found = advanced(configuration, samples, batch)
    drawing = Drawing(configuration.mechanism, configuration.drive.crank_angle)
    links, count = drawing.of_links(position), len(drawing.turning)
    # Those that swing and those that go round are apart; a crank that alone does is its joint.
    curves = {'crank': position[:, 0]}
    for entity, names in angles_of(drawing).items():
        stamps, values = found[entity]
        assert list(stamps) == [sample.stamp for sample in samples]
        curves.update(zip(names, values.T, strict=True))
    assert (curves['crank'] == position[:, 0]).all()
    directions = np.stack([curves[name] for name in drawing.turning], axis=-1)
    _, rates = found['rates']
    assert abs(np.exp(1j * directions) - np.exp(1j * links[:, :count])).max() < 1e-12
    assert abs(directions[0, 1:]).max() <= math.pi
    # Rates are derivatives of directions: nothing jumps anywhere.
    middle = (rates[1:] + rates[:-1]) / 2
    assert np.diff(directions, axis=0) * 500 == pytest.approx(middle, abs=0.02 * abs(rates).max())


def test_a_gap_in_the_angles_is_no_jump_in_the_directions():
    angles = np.array([[3.0], [math.nan], [-3.0], [-2.9]])
    found = Directions().follow(angles)[:, 0]
    assert np.isnan(found[1])
    assert found[[0, 2, 3]] == pytest.approx([3.0, TURN - 3.0, TURN - 2.9])


@pytest.mark.parametrize(
    ('values', 'shown'),
    [(DRAG_LINK, ({'crank', 'coupler', 'rocker'}, set())),
     (load('quadrilateral').parameters(), ({'crank'}, {'coupler', 'rocker'})),
     (HANGING, ({'crank'}, {'coupler', 'rocker'})),
     (load('compressor').parameters(), ({'crank'}, {'coupler'})),
     (PUMP.parameters(), ({'crank'}, {'coupler', 'rod'}))],
    ids=['drag-link', 'crank-rocker', 'hanging', 'compressor', 'pump'],
)  # fmt: skip
def test_what_turns_on_and_on_is_plotted_apart(tmp_path, values, shown):
    configuration = configure(values)
    show(tmp_path / 'run.rrd', run_of(configuration, 0.01), configuration)
    visible = {}
    for name, columns in read(tmp_path / 'run.rrd', blueprint=True).items():
        if 'ViewBlueprint:display_name' in columns:
            ((title,),) = columns['ViewBlueprint:display_name']
            visible[name] = title
    blueprint = read(tmp_path / 'run.rrd', blueprint=True)
    found = {'Turning, rad': set(), 'Directions, rad': set()}
    for view, title in visible.items():
        for entity, columns in blueprint.items():
            if title in found and entity.startswith(view) and 'SeriesLines:names' in columns:
                names = columns['SeriesLines:names'][0]
                seen = columns['SeriesLines:visible_series'][0]
                found[title] = {n for n, one in zip(names, seen, strict=True) if one}
    assert (found['Turning, rad'], found['Directions, rad']) == shown


# ---------------------------------------------------------------- curves


def energies_of_bodies(mechanism, position, velocity):
    """Kinetic and potential energy, body by body, from the links' directions and rates."""
    phi, rate = np.cumsum(position[:, :3], axis=1), np.cumsum(velocity[:, :3], axis=1)
    kinetic = 0.5 * mechanism.slider.mass * velocity[:, 3] ** 2
    potential = np.zeros(len(phi))
    pin, pin_velocity = 0j, 0j
    for i, body in enumerate((mechanism.crank, mechanism.coupler, mechanism.rod)):
        direction = np.exp(1j * phi[:, i])
        center = pin + complex(*body.center) * direction
        speed = pin_velocity + 1j * rate[:, i] * complex(*body.center) * direction
        kinetic = kinetic + 0.5 * (body.mass * abs(speed) ** 2 + body.inertia * rate[:, i] ** 2)
        potential = potential - body.mass * mechanism.gravity[1] * center.imag
        pin = pin + body.length * direction
        pin_velocity = pin_velocity + 1j * rate[:, i] * body.length * direction
    assert abs(pin - position[:, 3]).max() < 1e-12
    return kinetic, potential


def test_energies_are_those_of_the_bodies(pumped):
    _, position, velocity, _ = arrays(pumped)
    kinetic, potential = energies_of_bodies(PUMP.mechanism, position, velocity)
    _, got = advanced(PUMP, pumped, 500)['energies']
    assert abs(got[:, 0] - kinetic).max() < 1e-9
    assert abs(got[:, 1] - (potential - potential[0])).max() < 1e-9
    assert abs(got[:, 2] - got[:, 0] - got[:, 1]).max() < 1e-12


def test_a_free_swing_keeps_its_energy():
    samples = run_of(configure(HANGING), 3.0)
    _, got = advanced(configure(HANGING), samples, 100)['energies']
    assert got[:, 0].max() > 2.0
    assert abs(got[:, 2]).max() < 1e-6


def test_the_flow_is_the_stroke_of_the_last_turn_times_the_speed(pumped):
    _, position, velocity, _ = arrays(pumped)
    _, got = advanced(PUMP, pumped, 500)['flow']
    turns = np.floor(position[:, 0] / TURN).astype(int)
    assert turns[-1] >= 5
    assert np.isnan(got[turns == 0]).all()
    for turn in range(1, turns[-1] + 1):
        now, ends = turns == turn, np.array([turn - 1, turn]) * TURN
        at_ends = np.interp(ends, position[:, 0], position[:, 3])
        stroke = np.ptp([*position[turns == turn - 1, 3], *at_ends])
        assert got[now, 0] == pytest.approx(stroke * velocity[now, 0], rel=1e-12)
    # Where it settles, by docs and design: 2.604 rad/s and 0.519 m.
    assert np.mean(got[turns == turns[-1]]) == pytest.approx(0.519 * 2.604, rel=0.02)


def flow_of(crank, slide, speed=1.0):
    crank = np.asarray(crank)
    return Flow().follow(crank, np.full(crank.shape, speed), np.asarray(slide))


STEPS = np.linspace(0, 3.2 * TURN, 641)


@pytest.mark.parametrize('sign', [1, -1])
def test_a_flow_does_not_care_which_way_the_crank_turns(sign):
    got = flow_of(5.0 + sign * STEPS, 2 + 0.3 * np.cos(STEPS), speed=sign * 4.0)
    whole = STEPS > TURN + 1e-9
    assert np.isnan(got[: np.argmax(whole) - 1]).all()
    assert got[whole] == pytest.approx(np.full(whole.sum(), 0.6 * 4.0), rel=1e-3)


@pytest.mark.parametrize('swing', [0.0, 2.0, 6.28, 20.0])
def test_a_crank_that_never_makes_a_whole_turn_has_no_flow(swing):
    crank = 0.5 * swing * np.sin(np.linspace(0, 60, 6000))
    got = flow_of(crank, np.cos(crank))
    assert np.isnan(got).all() == (swing < TURN)


def test_after_turning_back_or_a_leap_a_flow_waits_for_the_next_whole_turn():
    back = np.concatenate([STEPS, STEPS[-1] - STEPS[1:]])
    got = flow_of(back, np.cos(back))
    done = STEPS[-1] - back
    after = np.arange(back.size) >= STEPS.size
    assert np.isnan(got[after & (done < 0.99 * TURN)]).all()
    assert np.isfinite(got[after & (done > 1.01 * TURN)]).all()
    leap = np.concatenate([STEPS, STEPS])  # a log that is played again
    again = flow_of(leap, np.cos(leap))
    np.testing.assert_array_equal(again[: STEPS.size], again[STEPS.size :])


def test_samples_too_far_apart_for_a_stroke_have_none():
    assert np.isnan(flow_of(np.arange(100) * 0.8, np.cos(np.arange(100) * 0.8))).all()


@pytest.mark.parametrize('batch', [1, 7, 401])
def test_batches_make_no_difference(pumped, batch):
    samples = pumped[:1200]
    whole, pieces = (advanced(PUMP, samples, size) for size in (len(samples), batch))
    assert pieces.keys() == whole.keys()
    for entity, (stamps, values) in whole.items():
        assert (pieces[entity][0] == stamps).all(), entity
        if values.dtype.kind == 'U':
            assert (pieces[entity][1] == values).all()
        else:
            np.testing.assert_allclose(pieces[entity][1], values, rtol=1e-13, atol=1e-12)


def test_what_is_no_state_is_a_gap_and_ends_nothing(pumped):
    samples = list(pumped[:50])
    for i, place in ((10, 9.0), (20, math.nan), (30, 2.52), (40, 1e308)):
        position = (*samples[i].position[:3], place)
        samples[i] = samples[i]._replace(position=position)
    samples[45] = samples[45]._replace(velocity=(1e200,) * 4)
    found = advanced(PUMP, samples, 50)
    bad = [10, 20, 30, 40, 45]
    usual = np.delete(advanced(PUMP, pumped[:50], 50)['energies'][1], bad, axis=0)
    assert not np.isfinite(found['energies'][1][bad]).all(axis=1).any()
    np.testing.assert_allclose(np.delete(found['energies'][1], bad, axis=0), usual, rtol=1e-12)
    assert np.isfinite(found['phase_plane/curve/now'][1]).all()


def test_no_speed_driven_run_has_curves_of_its_own():
    configuration = load('quadrilateral')
    found = advanced(configuration, run_of(configuration, 0.1), 20)
    assert {entity.split('/')[0] for entity in found} == {
        'joint_states',
        'linkage',
        'directions',
        'rates',
    }


# ---------------------------------------------------------------- axes


@given(st.floats(-1e6, 1e6), st.floats(1e-3, 1e6))
def test_an_axis_holds_its_range_with_little_to_spare(low, length):
    found = axis(low, low + length)
    start, end = found.ends
    assert start <= low
    assert end >= low + length
    assert end - start <= 2.7 * length
    assert len(found.labels) == MARKS
    mantissa = float(f'{found.step:e}'.split('e')[0])
    assert mantissa in {1, 1.5, 2, 2.5, 3, 4, 5, 6, 8}


def test_zero_is_a_plain_mark():
    assert axis(-0.7, 0.71).labels == ['-0.8', '-0.4', '0', '0.4', '0.8']


@given(st.lists(st.tuples(st.floats(-1e9, 1e9), st.floats(-1e9, 1e9)), min_size=1, max_size=30))
def test_axes_hold_every_point_from_its_own_moment_on(points):
    points = np.array(points)
    whole, single = (GrowingAxes(np.array([-1.0, -1.0]), np.array([1.0, 1.0])) for _ in range(2))
    changes = list(whole.follow(points))
    assert changes[0][0] == 0
    for (i, axes), (end, _) in zip(changes, [*changes[1:], (len(points), None)], strict=True):
        low, high = np.array([one.ends for one in axes]).T
        assert ((points[i:end] >= low) & (points[i:end] <= high)).all()
    one_by_one = [
        (i, axes) for i in range(len(points)) for _, axes in single.follow(points[i : i + 1])
    ]
    assert one_by_one == changes


# ---------------------------------------------------------------- drawings


def corners(drawing, position):
    """Everything that moves, at joint positions: points of shape (n, 2)."""
    points = drawing.place(drawing.of_links(np.asarray(position)))
    lines = drawing.links(points).values()
    return np.concatenate([points.reshape(-1, 2), *(line.reshape(-1, 2) for line in lines)])


def inside(drawing, points):
    return ((points > drawing.bounds[0]) & (points < drawing.bounds[1])).all()


def test_the_pins_of_a_pump_are_where_its_links_are(pumped):
    _, position, _, _ = arrays(pumped[::40])
    drawing, mechanism = Drawing(PUMP.mechanism), PUMP.mechanism
    assert drawing.joints == ('crank', 'coupler', 'rod', 'slider')
    assert (drawing.pins, drawing.output, drawing.paths) == (('A', 'B', 'D'), 'slider', {})
    a, b, d = drawing.place(drawing.of_links(position)).swapaxes(0, 1) @ (1, 1j)
    assert abs(a - mechanism.crank.length * np.exp(1j * position[:, 0])).max() < 1e-12
    assert abs(abs(b - a) - mechanism.coupler.length).max() < 1e-12
    assert abs(abs(d - b) - mechanism.rod.length).max() < 1e-12
    assert abs(d - position[:, 3]).max() < 1e-12
    lines = drawing.links(drawing.place(drawing.of_links(position)))
    assert {name: line.shape[1] for name, line in lines.items()} == {
        'crank': 2,
        'coupler': 2,
        'rod': 2,
        'slider': 5,
    }
    ends = {name: line @ (1, 1j) for name, line in lines.items()}
    for name, start, end in (('crank', 0 * a, a), ('coupler', a, b), ('rod', b, d)):
        assert (ends[name] == np.stack([start, end], -1)).all()
    assert abs(ends['slider'][:, :4].mean(axis=1) - d).max() < 1e-12
    rail = np.concatenate(drawing.ground[-5:])
    assert (rail[:, 1] < 0).all()


def test_a_pump_with_a_coupler_point_draws_its_triangle():
    values = {**PUMP.parameters(), 'coupler.point': [0.3, 0.1]}
    drawing = Drawing(configure(values).mechanism)
    assert drawing.pins == ('A', 'B', 'D', 'C')
    points = drawing.place(drawing.of_links(np.array([[0.0, 4.5, 1.5, 1.5]])))
    line = drawing.links(points)['coupler'][0]
    a, b, c, again = line @ (1, 1j)
    assert a == again
    assert (c - a) / (b - a) == pytest.approx(complex(0.3, 0.1) / 0.8)


@pytest.mark.parametrize('rpm', [19.0986, 57.2958])
def test_the_bounds_hold_a_pump_which_is_not_small_in_them(rpm):
    configuration = configure({**PUMP.parameters(), 'start_rpm': rpm})
    drawing = Drawing(configuration.mechanism)
    _, position, _, _ = arrays(run_of(configuration, 4.0, rate=50))
    points = corners(drawing, position)
    assert inside(drawing, points)
    assert np.ptp(points, axis=0)[0] > 0.45 * np.ptp(drawing.bounds, axis=0)[0]
    assert np.ptp(points, axis=0)[1] > 0.49 * np.ptp(drawing.bounds, axis=0)[1]


@pytest.mark.parametrize('assembly', ['open', 'crossed'])
@pytest.mark.parametrize(
    ('lengths', 'start', 'low', 'high'),
    [((0.12, 0.8, 1.6), 1.5, 0.92, 2.28), ((0.12, 0.8, 1.6), -1.5, -2.28, -0.92),
     ((0.12, 0.8, 1.6), 2.5, 0.68, 2.52), ((0.3, 1.0, 1.1), 1.0, 0.4, 1.8),
     ((0.3, 1.0, 1.1), 0.1, -2.4, 2.4)],
)  # fmt: skip
def test_a_sliders_rail_is_as_long_as_its_places(assembly, lengths, start, low, high):
    values = {f'{link}.length': x for link, x in zip(('crank', 'coupler', 'rod'), lengths)}  # noqa: B905
    values |= {'slider.position': start, 'assembly': assembly, 'crank_angle': 0.05}
    mechanism = configure({**PUMP.parameters(), **values}).mechanism
    drawing = Drawing(mechanism)
    rail = max(drawing.ground, key=lambda line: np.ptp(line[:, 0]))
    mark = drawing.links(np.zeros((1, 3, 2)))['slider'][0, 0, 0]
    ends = rail[:, 0] + [1.6 * mark, -1.6 * mark]
    # Places are taken in steps, and the outermost, where coupler and rod are in line, left out.
    assert ends == pytest.approx([low, high], abs=0.04 * (high - low))
    assert low - 1e-9 < ends[0] < ends[1] < high + 1e-9
    # B is on its side of the crank's pivot and the slider at the same angles that the bounds hold.
    below = drawing.bounds[0, 1] < -1.1 * lengths[1]
    above = drawing.bounds[1, 1] > 1.1 * lengths[1]
    crossed = (assembly == 'crossed') == (start > 0)
    assert (below, above) == (crossed, not crossed) or low < 0 < high


@pytest.mark.parametrize('start', [-2.0, -0.9])
def test_a_limited_crank_is_drawn_over_its_arc(start):
    configuration = configure({**HANGING, 'crank_angle': start})
    drawing = Drawing(configuration.mechanism, start)
    assert list(drawing.paths) == ['rocker', 'coupler']
    _, position, _, _ = arrays(run_of(configuration, 3.0))
    points = drawing.place(drawing.of_links(position))
    assert inside(drawing, corners(drawing, position))
    for path, column in (('rocker', 1), ('coupler', 2)):
        line = drawing.paths[path]
        nearest = [np.hypot(*(line - at).T).min() for at in points[:, column]]
        assert max(nearest) < 0.01
        assert np.hypot(*np.diff(line, axis=0).T).max() < 0.02
    # Its ends are those of the arc: coupler and rocker in one line, 0.2 + 0.25 m from the crank.
    rocker = Drawing(configuration.mechanism).paths['rocker'] @ (1, 1j)
    far = abs(-0.4j - 0.3 * np.exp(1j * np.array(Solver(configuration.mechanism).mobility.arcs)))
    assert far == pytest.approx(np.full((1, 2), 0.45))
    for end in rocker[[0, -1]]:
        toward = (end + 0.4j) / 0.25
        assert abs(-0.4j + 0.45 * toward) == pytest.approx(0.3, abs=1e-3)


def test_of_two_arcs_only_the_own_one_is_drawn():
    lengths = {'frame': 0.3, 'crank': 0.3, 'coupler': 0.1, 'rocker': 0.25}
    values = {f'{link}.length': length for link, length in lengths.items()}
    mechanism = configure({**HANGING, **values, 'crank_angle': -1.0}).mechanism
    arcs = Solver(mechanism).mobility.arcs
    assert len(arcs) == 2
    for start, end in arcs:
        for turns in (-2, 0, 1):
            drawing = Drawing(mechanism, 0.3 * start + 0.7 * end + turns * TURN)
            inner = np.linspace(start + 1e-6, end - 1e-6, 50)
            solver = Solver(mechanism)
            b = solver.point(solver.state(inner), 'B').position
            got, expected = drawing.paths['rocker'], np.stack(b, axis=-1)
            assert got.min(axis=0) == pytest.approx(expected.min(axis=0), abs=2e-3)
            assert got.max(axis=0) == pytest.approx(expected.max(axis=0), abs=2e-3)


def test_a_limited_slider_crank_is_drawn_over_its_arc():
    crank = under_torque(load('slider_crank'), **{'coupler.length': 0.8, 'crank.mass': 1.0})
    drawing = Drawing(crank.mechanism, crank.drive.crank_angle)
    _, end = Solver(crank.mechanism).mobility.arcs[0]
    path = drawing.paths['slider']
    assert path[:, 0].max() == pytest.approx(1.8, abs=1e-3)
    assert path[:, 0].min() == pytest.approx(math.cos(end), abs=1e-3)


# ---------------------------------------------------------------- layouts and files

TITLES = {'Linkage, m', 'Crank speed, rad/s', 'Rates, rad/s', 'Torque, N m', 'Directions, rad',
          'Turning, rad', 'Energies, J (potential: from the start)'}  # fmt: skip
SLIDING = {'Slider, m', 'Slider, m/s'}
PHASE = 'Phase plane of the slider: velocity, m/s, over position, m'
OF_PUMP = SLIDING | {'Flow (stroke x speed), m/s', PHASE}


def column_of(store, name):
    return [columns[name] for columns in store.values() if name in columns]


def titles_in(path):
    blueprint = read(path, blueprint=True)
    return {title[0][0] for title in column_of(blueprint, 'ViewBlueprint:display_name')}


@pytest.mark.parametrize('name', preset_names())
def test_every_preset_under_a_torque_has_a_picture(tmp_path, name):
    configuration = load(name)
    if isinstance(configuration.drive, SpeedDrive):
        configuration = under_torque(configuration, start_rpm=20.0, **{'crank.inertia': 0.1})
    samples = run_of(configuration, 0.2)
    view = show(tmp_path / 'run.rrd', samples, configuration)
    assert view.dropped == 0
    slides = configuration.kind.mechanism == 'slider_crank'
    expected = OF_PUMP if name == 'wind_pump' else SLIDING if slides else set()
    assert titles_in(tmp_path / 'run.rrd') == TITLES | expected
    found = read(tmp_path / 'run.rrd')
    assert len(found['/energies']['ros2_timestamp']) == len(samples)
    assert found['/energies']['SeriesLines:names'] == [['kinetic', 'potential', 'total']]
    assert ('/flow' in found) == (name == 'wind_pump')
    scales = [found[entity]['Transform3D:scale'] for entity in found if entity == '/linkage']
    assert scales == [[[[1.0, -1.0, 1.0]]]]


@pytest.mark.parametrize('name', [name for name in preset_names() if name != 'wind_pump'])
def test_no_preset_at_a_given_speed_shows_energies(tmp_path, name):
    configuration = load(name)
    show(tmp_path / 'run.rrd', run_of(configuration, 0.05), configuration)
    found = titles_in(tmp_path / 'run.rrd')
    assert sum(title.startswith('Driving torque, N m (') for title in found) == 1
    assert not any(title.startswith(('Energies', 'Torque', 'Crank speed')) for title in found)


def test_a_file_of_a_pump_holds_its_curves(tmp_path, pumped):
    samples = pumped[:1000]
    show(tmp_path / 'run.rrd', samples, PUMP)
    found, computed = read(tmp_path / 'run.rrd'), advanced(PUMP, samples, 37)
    for entity in ('energies', 'flow'):
        stamps, values = computed[entity]
        assert found[f'/{entity}']['ros2_timestamp'] == stamps.tolist()
        got = np.array(found[f'/{entity}']['Scalars:scalars'], float)
        np.testing.assert_array_equal(got, values)
    names = found['/joint_states/effort']['SeriesLines:names']
    assert names == [['crank', 'coupler', 'rod', 'slider']]
    blocks = np.array(found['/linkage/slider']['LineStrips2D:strips'])[:, 0]
    assert abs(blocks[:, :4].mean(axis=1)[:, 1]).max() < 1e-6
    assert found['/linkage/rod']['LineStrips2D:colors'][0] == [
        sum(
            part << shift
            for part, shift in zip((*COLORS['rod'], 255), (24, 16, 8, 0), strict=True)
        )
    ]


def test_the_phase_plane_is_the_sliders_position_and_velocity(tmp_path, pumped):
    samples = pumped[:1000]
    show(tmp_path / 'run.rrd', samples, PUMP)
    found = read(tmp_path / 'run.rrd')
    drawn = samples[::4]
    exact = np.array([(s.position[3], s.velocity[3]) for s in drawn], np.float32)
    now = found['/phase_plane/curve/now']
    assert now['ros2_timestamp'] == [sample.stamp for sample in drawn]
    np.testing.assert_array_equal(np.array(now['Points2D:positions'])[:, 0], exact)
    trail = np.array(found['/phase_plane/curve/trail']['LineStrips2D:strips'])[:, 0]
    np.testing.assert_array_equal(trail[1:, 0], exact[:-1])
    np.testing.assert_array_equal(trail[:, 1], exact)
    # Within the frame at all times, at the numbers that are written there.
    scale = found['/phase_plane/curve']
    assert scale['ros2_timestamp'][0] == 0
    assert len(scale['ros2_timestamp']) < 12
    marks = [found[f'/phase_plane/{name}'] for name in 'xy']
    for mark in marks:
        assert [t for t in mark['ros2_timestamp'] if t is not None] == scale['ros2_timestamp']
    ends = [*scale['ros2_timestamp'][1:], 10**18]
    for i, (start, end) in enumerate(zip(scale['ros2_timestamp'], ends, strict=True)):
        shown = exact[[start <= sample.stamp < end for sample in drawn]]
        factor, shift = (np.array(scale[f'Transform3D:{part}'][i])[0, :2]
                         for part in ('scale', 'translation'))  # fmt: skip
        placed = shown * factor + shift
        assert (placed >= -1e-6).all()
        assert (placed <= 1 + 1e-6).all()
        for k, mark in enumerate(marks):
            labels = [row for row in mark['Points2D:labels'] if row is not None][i]
            values = np.array(labels, float) * factor[k] + shift[k]
            assert values == pytest.approx(np.linspace(0, 1, MARKS), abs=1e-5)


def test_the_phase_plane_has_y_up_and_keeps_a_trail(tmp_path, pumped):
    show(tmp_path / 'run.rrd', pumped[:20], PUMP)
    found, layout = read(tmp_path / 'run.rrd'), read(tmp_path / 'run.rrd', blueprint=True)
    ((_, y, _),) = found['/phase_plane']['Transform3D:scale'][0]
    assert y == -1
    assert found['/phase_plane/names']['Points2D:labels'] == [['position, m', 'velocity, m/s']]
    (shown,) = (
        columns['VisibleTimeRanges:ranges'][0][0]
        for name, columns in layout.items()
        if 'curve/trail' in name and 'VisibleTimeRanges:ranges' in columns
    )
    assert shown == {'timeline': 'ros2_timestamp', 'range': {'start': -(10**10), 'end': 0}}


def test_curves_leave_room_for_the_legend(tmp_path, pumped):
    show(tmp_path / 'run.rrd', pumped[:20], PUMP)
    layout = read(tmp_path / 'run.rrd', blueprint=True)
    axes = [one for ((one,),) in column_of(layout, 'TimeAxis:view_range')]
    drawn = [one for ((one,),) in column_of(layout, 'VisibleTimeRanges:ranges')]
    assert len(axes) == 9
    assert {axis['start'] for axis in axes} == {-6 * 10**9}
    assert [one['range']['start'] for one in drawn].count(-5 * 10**9) == len(axes)
