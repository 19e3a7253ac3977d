# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the view shows of every mechanism: the drawing, the curves, and when they have a gap."""

import math
from dataclasses import replace

import numpy as np
import pytest
from test_rerun_view import read, run_of, show

from linkage_ros.dynamics.solver import Solver
from linkage_ros.model.friction import Friction
from linkage_ros.motion.drives import FollowDrive, TorqueDrive
from linkage_ros.parameters.configuration import configure, load
from linkage_ros.parameters.presets import preset_names
from linkage_ros.view.drawing import Drawing
from linkage_ros.view.scene import Directions, Scene

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


def changed(preset, **parameters):
    """A preset with other parameters; __ in place of a dot."""
    given = {name.replace('__', '.'): value for name, value in parameters.items()}
    return configure({**load(preset).parameters(), **given})


DRAG_LINK = changed(  # coupler and rocker turn fully, with the crank
    'quadrilateral', frame__length=0.1, crank__length=0.4, coupler__length=0.35,
    rocker__length=0.42, crank_angle=40.0,
)  # fmt: skip
MECHANISMS = {
    **{name: load(name) for name in preset_names()},
    'backwards': changed('quadrilateral', rpm=-37.0, crank_angle=1.3, frame__angle=3.0),
    'drag_link': DRAG_LINK,
    'two_turns': changed(  # passes a change point
        'quadrilateral', crank__length=0.1, coupler__length=0.4, rocker__length=0.3,
        frame__length=0.2,
    ),
    'hanging': configure(HANGING),
    'other_side': changed(
        'wind_pump', assembly='open', slider__position=-1.5, coupler__point=[0.3, 0.1],
    ),
}  # fmt: skip


@pytest.fixture(scope='module')
def pumped():
    """The pump's first 15 s: six turns, on the way to its slow state."""
    return run_of(PUMP, 3000)[0]


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


# ---------------------------------------------------------------- drawings


@pytest.fixture(scope='module', params=MECHANISMS)
def drawn(request, tmp_path_factory):
    """A run of 2 s in a file: configuration, solved states and what Rerun reads."""
    configuration = MECHANISMS[request.param]
    samples, states = run_of(configuration, 400)
    path = tmp_path_factory.mktemp('drawn') / 'run.rrd'
    assert show(path, samples, configuration).dropped == 0
    found = read(path)
    # 200 states a second, 50 drawings.
    stamps = [sample.stamp for sample in samples[::4]]
    assert found['/linkage/pins']['ros2_timestamp'] == stamps
    return configuration, states[::4], found, read(path, blueprint=True)


def complex_of(entity, column):
    """Points of an entity as complex numbers."""
    return np.array(entity[column], float) @ (1, 1j)


def lines_of(found, link):
    (strips,) = np.moveaxis(complex_of(found[f'/linkage/{link}'], 'LineStrips2D:strips'), 1, 0)
    return strips


def test_pins_are_where_the_solver_puts_them(drawn):
    configuration, states, found, _ = drawn
    solver = Solver(configuration.mechanism)
    (names,) = found['/linkage/pins/names']['Points2D:labels']
    pins = complex_of(found['/linkage/pins'], 'Points2D:positions')
    for name, place in zip(names, pins.T, strict=True):
        exact = [complex(*solver.point(state, name).position) for state in states]
        assert abs(place - exact).max() < 3e-7
    fixed = complex_of(found['/linkage/pivots'], 'Points2D:positions').ravel()
    frame = getattr(configuration.mechanism, 'frame', None)
    far = frame.length * np.exp(1j * frame.angle) if hasattr(frame, 'length') else 0.0
    assert fixed == pytest.approx([0.0, far] if far else [0.0], abs=3e-7)


def test_links_have_their_lengths_and_end_at_pins(drawn):
    configuration, _, found, _ = drawn
    mechanism = configuration.mechanism
    pins = complex_of(found['/linkage/pins'], 'Points2D:positions')
    fixed = complex_of(found['/linkage/pivots'], 'Points2D:positions').ravel()
    pins = np.hstack([pins, np.broadcast_to(fixed, (len(pins), len(fixed)))])
    (joints,) = found['/joint_states/position']['SeriesLines:names']
    for joint in joints:
        line = lines_of(found, joint)
        if joint == 'slider':
            line = line[:, :4].mean(axis=1, keepdims=True)
        else:
            length = getattr(mechanism, joint).length
            assert abs(abs(line[:, 1] - line[:, 0]) - length).max() < 1e-6
        for corner in line.T:
            assert abs(pins.T - corner).min(axis=0).max() < 3e-7
    if getattr(mechanism.coupler, 'point', None):
        start, end, point, again = lines_of(found, 'coupler').T
        assert (again == start).all()
        exact = complex(*mechanism.coupler.point) / mechanism.coupler.length
        assert abs((point - start) / (end - start) - exact).max() < 1e-5


def points_of(found):
    """All points that are drawn of a linkage at any time; shape (n, 2)."""
    points = []
    for name, columns in found.items():
        for column in ('Points2D:positions', 'LineStrips2D:strips'):
            if name.startswith('/linkage/') and column in columns:
                points += [np.reshape(np.concatenate(row), (-1, 2)) for row in columns[column]]
    return np.concatenate(points)


def test_drawing_fits_its_window_and_fills_it(drawn):
    configuration, _, found, blueprint = drawn
    assert found['/linkage']['Transform3D:scale'] == [[[1.0, -1.0, 1.0]]]  # y is up
    drawing = Drawing(configuration.mechanism, configuration.drive.crank_angle)
    (left, low), (right, high) = drawing.bounds
    shown = [
        columns['VisualBounds2D:range'][0][0]
        for name, columns in blueprint.items()
        if name.endswith('VisualBounds2D')
    ]
    ranges = [[*one['x_range'], *one['y_range']] for one in shown]
    assert pytest.approx([left, right, -high, -low]) in ranges
    points = points_of(found)
    margins = [points.min(axis=0) - drawing.bounds[0], drawing.bounds[1] - points.max(axis=0)]
    width = np.ptp(drawing.bounds, axis=0).max()
    assert np.min(margins) > 0.6 * drawing._mark
    assert np.max(margins) < 0.3 * width  # a pump is drawn with room for its other motions


def test_arrows_are_as_long_as_the_loads_and_point_their_way(drawn):
    configuration, states, found, _ = drawn
    mechanism = configuration.mechanism
    loads = tuple(load for load in mechanism.loads if not isinstance(load, Friction))
    solver, mark = Solver(replace(mechanism, loads=loads)), Drawing(mechanism)._mark
    forces = [solver.load_forces(state) for state in states]
    arrows = {
        name.split('/')[-1]: lines_of(found, name[9:]) for name in found if '/loads/' in name
    }
    assert arrows.keys() == forces[0].keys()
    for link, lines in arrows.items():
        exerted = np.array([row[link] for row in forces])
        moving, longest = solver.structure.links[solver.links.index(link)], 1.5 * math.pi
        if moving.slides:
            longest = 6 * mark
            shown = (lines[:, -2] - lines[:, 0]) * np.exp(-1j * moving.angle)
            assert abs(shown.imag).max() < 1e-6
            shown = shown.real
        else:
            arc = lines[:, :-3] - moving.origin
            shown = np.angle(arc[:, 1:] / arc[:, :-1]).sum(axis=1)
        # The scale is that of the largest load so far; it may be known from the start.
        scales = np.abs(shown[exerted != 0] / exerted[exerted != 0])
        largest = np.maximum(
            np.maximum.accumulate(abs(exerted)), longest / scales.max(initial=1e-300)
        )
        assert shown == pytest.approx(longest * exerted / largest, abs=1e-5 * longest)
        assert not exerted.any() or abs(shown).max() > 0.01 * longest


def test_moving_points_stay_on_their_paths(drawn):
    configuration, _, found, _ = drawn
    pins = complex_of(found['/linkage/pins'], 'Points2D:positions').T
    paths = [columns for name, columns in found.items() if '/paths/' in name]
    solver = Solver(configuration.mechanism)
    assert len(paths) == (len(pins) - 1 if len(solver.coordinates) == 1 else 0)
    step = 0.05 * configuration.mechanism.crank.length
    for columns in paths:
        path = complex_of(columns, 'LineStrips2D:strips').ravel()
        assert min(abs(pin[:, np.newaxis] - path).min(axis=1).max() for pin in pins) < step
        assert abs(np.diff(path)).max() < 3 * step


def test_names_are_beside_their_pins_and_off_their_links(drawn):
    configuration, _, found, _ = drawn
    drawing = Drawing(configuration.mechanism)
    pins = complex_of(found['/linkage/pins'], 'Points2D:positions')
    places = complex_of(found['/linkage/pins/names'], 'Points2D:positions')
    away = places - 0.7j * drawing._mark - pins  # a name hangs down from its place
    width = np.ptp(drawing.bounds, axis=0).max()
    assert 0.03 * width < abs(away).min() < abs(away).max() < 0.08 * width
    for link in drawing.turning:
        line = lines_of(found, link)
        for start, end in ((0, 1), (1, 0)):
            at_pin = abs(pins - line[:, [start]]) < 1e-6
            way = line[:, [end]] - line[:, [start]]
            assert (abs(np.angle(away / way))[at_pin] > 0.7).all()


def test_plots_show_the_curves_of_the_run(drawn):
    configuration, _, found, blueprint = drawn
    plots = set()
    for name, columns in blueprint.items():
        if 'SeriesLines:names' in columns:
            entity = name.split('/overrides')[1].split('/visualizers')[0]
            pairs = zip(columns['SeriesLines:names'][0], columns['SeriesLines:visible_series'][0],
                        strict=True)  # fmt: skip
            plots.add((entity, *(curve for curve, is_shown in pairs if is_shown)))
    (joints,) = found['/joint_states/position']['SeriesLines:names']
    turning = [joint for joint in joints if joint != 'slider']
    expected = {('/joint_states/effort', 'crank'), ('/rates', *turning),
                ('/directions', *turning[1:])}  # fmt: skip
    if 'slider' in joints:
        expected |= {(f'/joint_states/{field}', 'slider') for field in ('position', 'velocity')}
    if isinstance(configuration.drive, TorqueDrive):
        expected |= {('/joint_states/velocity', 'crank')}
    assert plots == expected
    assert all(entity in found for entity, *_ in plots)


@pytest.mark.parametrize(
    ('lengths', 'start', 'low', 'high'),
    [((0.12, 0.8, 1.6), -1.5, -2.28, -0.92), ((0.12, 0.8, 1.6), 2.5, 0.68, 2.52),
     ((0.3, 1.0, 1.1), 0.1, -0.2, 0.2)],
)  # fmt: skip
def test_rail_is_as_long_as_the_slider_can_travel(lengths, start, low, high):
    crank, coupler, rod = lengths
    configuration = changed(
        'wind_pump', crank__length=crank, coupler__length=coupler, rod__length=rod,
        slider__position=start, crank_angle=0.05,
    )  # fmt: skip
    drawing = Drawing(configuration.mechanism)
    rail = max(drawing.ground, key=lambda line: np.ptp(line[:, 0]))[:, 0]
    # It reaches beyond the last places by a little more than the slider's block.
    assert [rail.min(), rail.max()] == pytest.approx([low, high], abs=0.2)
    assert rail.min() < low
    assert high < rail.max()


def test_only_the_reachable_arc_is_drawn():
    lengths = {'frame': 0.3, 'crank': 0.3, 'coupler': 0.1, 'rocker': 0.25}
    values = {f'{link}.length': length for link, length in lengths.items()}
    configuration = configure({**HANGING, **values, 'frame.angle': 0.0, 'crank_angle': 0.6})
    mechanism = configuration.mechanism
    arcs = Solver(mechanism).mobility.arcs
    assert len(arcs) == 2
    # A crank that is measured is expected within the first, an angle of 0 in the other.
    measured = Scene(replace(configuration, drive=FollowDrive())).drawing.paths['rocker']
    assert np.array_equal(measured, Drawing(mechanism, sum(arcs[0]) / 2).paths['rocker'])
    for start, end in arcs:
        for turns in (-2, 0, 1):
            drawing = Drawing(mechanism, 0.3 * start + 0.7 * end + turns * TURN)
            inner = np.linspace(start + 1e-6, end - 1e-6, 50)
            solver = Solver(mechanism)
            b = solver.point(solver.state(inner), 'B').position
            got, expected = drawing.paths['rocker'], np.stack(b, axis=-1)
            assert got.min(axis=0) == pytest.approx(expected.min(axis=0), abs=2e-3)
            assert got.max(axis=0) == pytest.approx(expected.max(axis=0), abs=2e-3)


# ---------------------------------------------------------------- curves


@pytest.mark.parametrize(
    'configuration',
    [PUMP, configure(HANGING), DRAG_LINK, MECHANISMS['backwards']],
    ids=['pump', 'hanging', 'drag_link', 'backwards'],
)  # fmt: skip
def test_directions_have_no_jumps(configuration):
    samples, states = run_of(configuration, 500, rate=500)
    found = advanced(configuration, samples, 7)
    drawing = Drawing(configuration.mechanism, configuration.drive.crank_angle)
    stamps, directions = found['directions']
    assert list(stamps) == [sample.stamp for sample in samples]
    _, rates = found['rates']
    exact, exact_rates = (
        np.array([getattr(state, field) for state in states])[:, : len(drawing.turning)]
        for field in ('position', 'velocity')
    )
    assert abs(np.exp(1j * directions) - np.exp(1j * exact[:, 1:])).max() < 1e-12
    assert rates == pytest.approx(exact_rates, rel=1e-12, abs=1e-12)
    assert abs(directions[0]).max() <= math.pi
    # Rates are derivatives of directions: nothing jumps anywhere.
    middle = (rates[1:, 1:] + rates[:-1, 1:]) / 2
    assert np.diff(directions, axis=0) * 500 == pytest.approx(middle, abs=0.02 * abs(rates).max())


def test_missing_angle_makes_no_jump_in_directions():
    angles = np.array([[3.0], [math.nan], [-3.0], [-2.9]])
    found = Directions().follow(angles)[:, 0]
    assert np.isnan(found[1])
    assert found[[0, 2, 3]] == pytest.approx([3.0, TURN - 3.0, TURN - 2.9])


@pytest.mark.parametrize('batch', [1, 7])
def test_batch_size_does_not_change_rows(pumped, batch):
    samples = pumped[1400:1700]
    whole, pieces = (advanced(PUMP, samples, size) for size in (len(samples), batch))
    assert pieces.keys() == whole.keys()
    for entity, (stamps, values) in whole.items():
        assert (pieces[entity][0] == stamps).all(), entity
        if values.dtype.kind != 'U':
            np.testing.assert_allclose(pieces[entity][1], values, rtol=1e-13, atol=1e-12)


@pytest.mark.parametrize('place', [9.0, math.nan, 2.52, 1e308])
def test_impossible_state_is_a_gap_in_the_curves(pumped, place):
    samples = list(pumped[:60])
    samples[10] = samples[10]._replace(position=(*samples[10].position[:3], place))
    usual, found = advanced(PUMP, pumped[:60], 20), advanced(PUMP, samples, 20)
    slider = found['joint_states/position'][1][:, 3]
    np.testing.assert_array_equal(slider[10], place)
    np.testing.assert_array_equal(found['directions'][1], usual['directions'][1])
