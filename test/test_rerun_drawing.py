# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The view of every mechanism: its drawing and curves."""

import cmath
import itertools
import math
from dataclasses import replace
from types import SimpleNamespace
from unittest.mock import ANY

import numpy as np
import pytest
import rerun as rr
from mechanisms import MOVING_GUIDES, coordinates
from test_rerun_connection import read, run_of, show

from linkage_ros.mechanism.axes import axes_of
from linkage_ros.mechanism.drawing import Drawing as DrawnMachine
from linkage_ros.mechanism.drawing import DrawnLink, DrawnSlide
from linkage_ros.mechanism.loads.force import Force
from linkage_ros.mechanism.loads.friction import Friction
from linkage_ros.mechanism.solver import Solver
from linkage_ros.motion.drives.follow import FollowDrive
from linkage_ros.motion.drives.torque import TorqueDrive
from linkage_ros.settings.configuration import configure, load
from linkage_ros.settings.presets import preset_names
from linkage_ros.units import NS_PER_S
from linkage_ros.view.picture import Picture
from linkage_ros.view.rerun_drawing import RerunDrawing

# A crank that hangs, and swings within 157 deg about the line to the rocker's pivot.
HANGING = {
    'mechanism': 'four_bar', 'drive': 'torque', 'crank_angle': -2.0,
    'frame.length': 0.4, 'frame.angle': -math.pi / 2,
    'crank.length': 0.3, 'crank.mass': 1.0, 'crank.inertia': 0.01, 'crank.center': [0.15, 0.0],
    'coupler.length': 0.2, 'coupler.mass': 1.0, 'coupler.inertia': 0.005,
    'coupler.center': [0.1, 0.0], 'points.C.link': 'coupler', 'points.C.at': [0.1, 0.06],
    'rocker.length': 0.25, 'rocker.mass': 1.0, 'rocker.inertia': 0.005,
    'rocker.center': [0.12, 0.0],
}  # fmt: skip


def changed(preset, **parameters):
    """Returns a preset with other parameters; __ stands for a dot."""
    given = {name.replace('__', '.'): value for name, value in parameters.items()}
    return configure({**load(preset).parameters(), **given})


DRAG_LINK = changed(  # coupler and rocker turn fully with the crank
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
        'wind_pump', assembly='open', slider__position=-1.5, points__C__link='coupler',
        points__C__at=[0.3, 0.1],
    ),
}  # fmt: skip


# ---------------------------------------------------------------- drawings


MOVING, FIXED = '/linkage/moving', '/linkage/fixed'


def points_of(entity):
    """Returns positions of labels and of pins, as complex numbers."""
    points = np.array(entity['Points2D:positions']) @ (1, 1j)
    return np.split(points, [len(entity['Points2D:labels'][0])], axis=1)


@pytest.fixture(scope='module', params=MECHANISMS)
def drawn(request, tmp_path_factory):
    """Writes a run of 2 s to a file; returns its states, and what Rerun reads in the file.

    Points are complex numbers: `labels` and `pins` over time, `fixed` pins, and the `lines` of the
    links and `arrows` of the loads by link.
    """
    configuration = MECHANISMS[request.param]
    samples = run_of(configuration, 400)
    stamps, states = [stamp for stamp, _ in samples], [found[''] for _, found in samples]
    path = tmp_path_factory.mktemp('drawn') / 'run.rrd'
    assert show(path, samples, configuration).dropped == 0
    found, mechanism = read(path), configuration.mechanism
    moving = found[MOVING]
    # 200 states and 50 drawings per second.
    assert moving['ros2_timestamp'] == stamps[::4]
    drawing = Picture(mechanism, configuration.drive.crank_angle)
    labels, pins = points_of(moving)
    strips = zip(*moving['LineStrips2D:strips'], moving['LineStrips2D:colors'][0], strict=True)
    lines = [np.array(strip) @ (1, 1j) for *strip, _ in strips]
    links = len(drawing.joints)
    return SimpleNamespace(
        configuration=configuration, mechanism=mechanism, drawing=drawing, states=states[::4],
        found=found, blueprint=read(path, blueprint=True), labels=labels, pins=pins,
        fixed=points_of(found[FIXED])[1].ravel(),
        lines=dict(zip(drawing.joints, lines[:links], strict=True)),
        arrows=dict(zip(drawing.loaded, lines[links:], strict=True)),
    )  # fmt: skip


def test_components_have_the_types_that_rerun_draws(drawn):
    """Rerun draws no other types, even if only nullability differs."""
    columns = (*rr.Points2D.columns(positions=[[0.0, 0.0]]),
               *rr.LineStrips2D.columns(strips=[np.zeros((2, 2))]))  # fmt: skip
    for column in columns:
        name = column.component_descriptor().component
        assert drawn.found[MOVING][f'{name} type'] == str(column.as_arrow_array().type)


PINS = {'O': (0, 0), 'A': (3, 2), 'Q': (10, 0), 'T': (13, 6), 'R': (4, -5)}
FOUR = {'crank': 'OA', 'rod': 'AB', 'rocker': 'QB'}
SLOTS = {
    'in a lever': (
        PINS, 'OQ', {'crank': 'OA', 'lever': 'QT'}, DrawnSlide('block', (6, -3), 'A', on='lever')),
    'on a turning block': (
        PINS, 'OQ', {'crank': 'OA', 'rod': 'AT'}, DrawnSlide('block', (7, 1), 'Q', on='rod')),
    'in a dyad': (
        {**PINS, 'B': (9, 4)}, 'OQR', {**FOUR, 'arm': 'RT'},
        DrawnSlide('block', (5, 8), 'B', on='arm')),
    'in the rod of a dyad': (
        {**PINS, 'B': (9, 4), 'S': (6, 7)}, 'OQR', {**FOUR, 'arm': 'RS'},
        DrawnSlide('block', (6, 3), 'S', on='rod')),
}  # fmt: skip


def require_in_slot(line):
    """Checks that a link's line has a slot around a block.

    Args:
        line: Corners of the link's line, from the middle of the block, in its axes and lengths.
    """
    for side in (0.45, -0.45):
        on_side = line[abs(line.imag - side) < 1e-6].real
        assert on_side.min() < -0.5 < 0.5 < on_side.max(), line


@pytest.mark.parametrize(('pins', 'frame', 'links', 'block'), SLOTS.values(), ids=SLOTS)
def test_a_block_is_drawn_at_its_pin_and_its_slot_through_it(pins, frame, links, block):
    used = {*frame, block.pin, *''.join(links.values())}
    places = {name: place for name, place in pins.items() if name in used}
    sheet = DrawnMachine(
        input='crank', frame=[*frame], pins=places, slides=[block],
        links=[DrawnLink(name, [*of]) for name, of in links.items()],
    )  # fmt: skip
    mechanism = sheet.mechanism()
    solver, drawing = Solver(mechanism), Picture(mechanism)
    start = mechanism.drawn.position
    for place in (start, start + 0.2, start - 0.2):
        state = solver.state(place)
        lines = drawing.links(drawing.place(np.array(state.position)[np.newaxis]))
        corners, slot = (lines[name][0] @ (1, 1j) for name in ('block', block.on))
        pin = complex(*solver.point(state, block.pin).position)
        assert corners[:4].mean() == pytest.approx(pin, abs=1e-9)
        way = corners[0] - corners[1]
        if block.pin == 'Q':  # the rod slides in the block
            near, far = (slot[-2:] - pin) / way
            assert abs(near.imag) + abs(far.imag) < 1e-9
            assert near.real * far.real < 0
        else:
            require_in_slot((slot - pin) / way)
        if place == start:
            assert (way / complex(*block.direction)).imag == pytest.approx(0.0, abs=1e-12)


def test_pins_are_where_the_solver_puts_them(drawn):
    solver = Solver(drawn.mechanism)
    (names,) = drawn.found[MOVING]['Points2D:labels']
    for name, place in zip(names, drawn.pins.T, strict=True):
        exact = [complex(*solver.point(state, name).position) for state in drawn.states]
        assert abs(place - exact).max() < 3e-7
    frame = getattr(drawn.mechanism, 'frame', None)
    far = [frame.length * np.exp(1j * frame.angle)] if hasattr(frame, 'length') else []
    assert drawn.fixed == pytest.approx([0.0, *far], abs=3e-7)


def test_links_have_their_lengths_and_end_at_pins(drawn):
    pins = np.vstack([drawn.pins.T, *np.broadcast_arrays(*drawn.fixed, drawn.pins[:, 0])[:-1]])
    for joint, line in drawn.lines.items():
        if drawn.drawing._block and joint == 'barrel':  # see test_pins_of_a_lever
            continue
        if joint.endswith('slider') or joint == drawn.drawing._block:
            line = line[:, :4].mean(axis=1, keepdims=True)
        else:
            length = getattr(drawn.mechanism.parts()[joint], 'length', None)
            if length is None:  # barrel and rod: the rod ends at the mouth of the barrel
                length = abs(line[:, 1] - line[:, 0])
            assert abs(abs(line[:, 1] - line[:, 0]) - length).max() < 1e-6
        for corner in line.T:
            assert abs(pins - corner).min(axis=0).max() < 3e-7
    for traced in drawn.mechanism.points:
        start, end, point, again = drawn.lines['coupler'].T
        assert (again == start).all()
        exact = complex(*traced.at) / drawn.mechanism.coupler.length
        assert abs((point - start) / (end - start) - exact).max() < 1e-5


def test_drawing_fits_its_window_and_fills_it(drawn):
    assert drawn.found['/linkage']['Transform3D:scale'] == [[[1.0, -1.0, 1.0]]]  # y points up
    (left, low), (right, high) = bounds = drawn.drawing.bounds
    ranges = [
        [*columns['VisualBounds2D:range'][0][0]['x_range'],
         *columns['VisualBounds2D:range'][0][0]['y_range']]
        for name, columns in drawn.blueprint.items()
        if name.endswith('VisualBounds2D')
    ]  # fmt: skip
    assert pytest.approx([left, right, -high, -low]) in ranges
    points = np.concatenate([
        np.reshape(np.concatenate(row), (-1, 2))
        for entity in (drawn.found[MOVING], drawn.found[FIXED])
        for row in (*entity['Points2D:positions'], *entity['LineStrips2D:strips'])
    ])  # fmt: skip
    margins = [points.min(axis=0) - bounds[0], bounds[1] - points.max(axis=0)]
    assert np.min(margins) > 0.6 * drawn.drawing._mark
    # A pump is drawn with room for its other motions.
    assert np.max(margins) < 0.3 * np.ptp(bounds, axis=0).max()


def test_arrows_are_as_long_as_the_loads_and_point_their_way(drawn):
    loads = tuple(x for x in drawn.mechanism.loads if not isinstance(x, (Force, Friction)))
    solver = Solver(replace(drawn.mechanism, loads=loads))
    forces = [solver.load_forces(state) for state in drawn.states]
    arrows = {link: lines for link, lines in drawn.arrows.items() if ' on ' not in link}
    assert arrows.keys() == forces[0].keys()
    for link, lines in arrows.items():
        exerted = np.array([row[link] for row in forces])
        moving, longest = solver.structure.links[solver.links.index(link)], 1.5 * math.pi
        if moving.slides:
            longest = 6 * drawn.drawing._mark
            angle = moving.angle
            if moving.parent is not None:
                angle = np.array([state.position[moving.parent] for state in drawn.states])
            shown = (lines[:, -2] - lines[:, 0]) * np.exp(-1j * angle)
            assert abs(shown.imag).max() < 1e-6
            shown = shown.real
        else:
            arc = lines[:, :-3] - moving.origin
            shown = np.angle(arc[:, 1:] / arc[:, :-1]).sum(axis=1)
        # The scale is that of the largest load so far, which may be known from the start.
        scales = np.abs(shown[exerted != 0] / exerted[exerted != 0])
        largest = np.maximum(
            np.maximum.accumulate(abs(exerted)), longest / scales.max(initial=1e-300)
        )
        assert shown == pytest.approx(longest * exerted / largest, abs=1e-5 * longest)
        assert not exerted.any() or abs(shown).max() > 0.01 * longest


def test_moving_points_stay_on_their_paths(drawn):
    first = len(drawn.drawing.ground) + 1  # after the scale bar
    paths = drawn.found[FIXED]['LineStrips2D:strips'][0][first:]
    pins, is_free = drawn.pins.T, len(Solver(drawn.mechanism).coordinates) > 1
    ends = [name for name in drawn.drawing.pins if name.endswith(('_from', '_to'))]
    assert len(paths) == (0 if is_free else len(pins) - 1 - len(ends))
    step = 0.05 * drawn.mechanism.crank.length
    for line in paths:
        path = np.array(line) @ (1, 1j)
        assert min(abs(pin[:, np.newaxis] - path).min(axis=1).max() for pin in pins) < step
        assert abs(np.diff(path)).max() < 3 * step


def test_names_are_next_to_their_pins_and_clear_of_links(drawn):
    # A label hangs below its position.
    away = drawn.labels - 0.7j * drawn.drawing._mark - drawn.pins
    width = np.ptp(drawn.drawing.bounds, axis=0).max()
    assert 0.03 * width < abs(away).min() < abs(away).max() < 0.08 * width
    for line in (drawn.lines[link] for link in drawn.drawing.turning):
        for start, end in ((0, 1), (1, 0)):
            at_pin = abs(drawn.pins - line[:, [start]]) < 1e-6
            way = line[:, [end]] - line[:, [start]]
            assert (abs(np.angle(away / way))[at_pin] > 0.7).all()


def test_values_of_loads_are_at_the_free_ends_of_their_arrows(drawn):
    if not drawn.arrows:
        return
    values = np.array(drawn.found['/linkage/loads']['Points2D:positions']) @ (1, 1j)
    for place, line in zip(values.T, drawn.arrows.values(), strict=True):
        ends = np.stack([line[:, 0], line[:, -2]])
        far = abs(ends[..., np.newaxis] - drawn.pins).min(axis=-1)
        assert abs(place - ends[far.argmax(axis=0), range(len(place))]).max() < 1e-6


def test_plots_show_the_curves_of_the_run(drawn):
    plots, ranges = set(), 0
    for name, columns in drawn.blueprint.items():
        if 'SeriesLines:names' in columns:
            entity = name.split('/overrides')[1].split('/visualizers')[0]
            (names,), (shown,) = (columns[f'SeriesLines:{field}'] for field in
                                  ('names', 'visible_series'))  # fmt: skip
            assert len(names) == len(drawn.found[entity]['Scalars:scalars'][0])
            plots.add((entity, *itertools.compress(names, shown)))
        if 'TimeAxis:view_range' in columns:
            ((shown_time,),) = columns['TimeAxis:view_range']
            # A computer without a graphics card takes up to 2 s for a frame.
            assert shown_time == {'start': ANY, 'end': 0}
            assert 2.0 <= -shown_time['start'] / NS_PER_S <= 60.0
            ranges += 1
    turning, driven = drawn.drawing.turning, drawn.mechanism.structure().driven_link
    directions = turning if driven.slides else turning[1:]
    expected = {('/values', driven.name), ('/rates', *turning), ('/directions', *directions)}
    expected |= {('/values', link) for link in drawn.drawing.joints if link not in turning}
    if isinstance(drawn.configuration.drive, TorqueDrive):
        expected.add(('/rates', 'crank'))
    assert plots == expected
    assert ranges >= len(plots)


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
    ground = Picture(configuration.mechanism).ground
    rail = max(ground, key=lambda line: np.ptp(line[:, 0]))[:, 0]
    # The rail extends beyond the extreme positions by little more than the slider's block.
    assert [rail.min(), rail.max()] == pytest.approx([low, high], abs=0.2)
    assert rail.min() < low
    assert high < rail.max()


def test_only_the_reachable_arc_is_drawn():
    lengths = {'frame': 0.3, 'crank': 0.3, 'coupler': 0.1, 'rocker': 0.25}
    values = {f'{link}.length': length for link, length in lengths.items()}
    configuration = configure({**HANGING, **values, 'frame.angle': 0.0, 'crank_angle': 0.6})
    mechanism, solver = configuration.mechanism, Solver(configuration.mechanism)
    first, second = solver.mobility.arcs
    # A measured crank is expected in the first arc; an angle of 0 is in the other.
    measured = RerunDrawing(replace(configuration.only, drive=FollowDrive())).drawing.paths['B']
    assert np.array_equal(measured, Picture(mechanism, sum(first) / 2).paths['B'])
    for (start, end), turns in itertools.product((first, second), (-2, 0, 1)):
        drawing = Picture(mechanism, 0.3 * start + 0.7 * end + turns * 2 * math.pi)
        b = solver.point(solver.state(np.linspace(start + 1e-6, end - 1e-6, 50)), 'B').position
        got, expected = drawing.paths['B'], np.stack(b, axis=-1)
        assert got.min(axis=0) == pytest.approx(expected.min(axis=0), abs=2e-3)
        assert got.max(axis=0) == pytest.approx(expected.max(axis=0), abs=2e-3)


# ---------------------------------------------------------------- curves


@pytest.mark.parametrize(
    'configuration',
    [load('wind_pump'), configure(HANGING), DRAG_LINK, MECHANISMS['backwards']],
    ids=['pump', 'hanging', 'drag_link', 'backwards'],
)  # fmt: skip
def test_curves_are_those_of_the_states_without_jumps(configuration, tmp_path):
    samples = run_of(configuration, 500, rate=500)
    stamps, states = [stamp for stamp, _ in samples], [found[''] for _, found in samples]
    show(tmp_path / 'run.rrd', samples, configuration, batch=7)
    found, curves = read(tmp_path / 'run.rrd'), []
    for entity in ('/values', '/rates', '/directions'):
        assert found[entity]['ros2_timestamp'] == stamps
        curves.append(np.array(found[entity]['Scalars:scalars']))
    values, rates, degrees = curves
    directions = np.radians(degrees)
    position, velocity = (np.array([getattr(state, field) for state in states])
                          for field in ('position', 'velocity'))  # fmt: skip
    count = rates.shape[1]
    expected = [[[state.torque] for state in states], position[:, count:], velocity[:, count:]]
    assert values == pytest.approx(np.hstack(expected), rel=1e-15)
    assert rates == pytest.approx(velocity[:, :count], rel=1e-12, abs=1e-12)
    assert abs(np.exp(1j * directions) - np.exp(1j * position[:, 1:count])).max() < 1e-12
    assert abs(directions[0]).max() <= math.pi
    # Rates are derivatives of directions, so nothing jumps.
    middle = (rates[1:, 1:] + rates[:-1, 1:]) / 2
    assert np.diff(directions, axis=0) * 500 == pytest.approx(middle, abs=0.02 * abs(rates).max())


@pytest.mark.parametrize('name', [x for x in MOVING_GUIDES if 'pump' not in x])
def test_blocks_and_barrels_turn_with_their_guides(name):
    mechanism = MOVING_GUIDES[name]
    solver, (q,) = Solver(mechanism), coordinates(mechanism, 1.3)
    structure, drawing = solver.structure, Picture(mechanism, q)
    position = np.array(solver.state(q).position)
    lines = drawing.links(drawing.place(position[np.newaxis]))
    for j, link in enumerate(structure.links):
        if not link.slides or link.is_guided:
            continue
        spin, guide = axes_of(structure.links, j)
        way = cmath.rect(1.0, (0.0 if spin is None else position[spin]) + (guide or 0.0))
        point = structure.point_of(j, (0.0, 0.0))
        pin = point.fixed + np.array(point.weights) @ np.exp(1j * position)
        line = (lines[link.name][0] @ (1, 1j) - pin) / way  # in the axes of the guide
        if link.name.endswith('slider'):
            carrier = lines[structure.links[link.parent].name][0] @ (1, 1j)
            require_in_slot((carrier - pin) / (line[0] - line[1]) / way)
            assert abs(line[:4].sum()) < 1e-9  # the corners of the block
        else:  # from the mouth of the barrel to the pin
            assert abs(line[:2].imag).max() < 1e-9
            assert line[1] == pytest.approx(0.0, abs=1e-9)


def slotted(kind, at=None):
    """Returns the drawing of a crank whose block slides in a lever, drawn or by lengths."""
    if kind == 'by lengths':
        return load('shaper').mechanism
    links = {'crank': 'OA', 'lever': 'QT' + 'W' * (at is not None)}
    pins = PINS if at is None else {**PINS, 'W': at}
    sheet = DrawnMachine(
        input='crank', frame=[*'OQ'], pins={name: pins[name] for name in 'OAQTW' if name in pins},
        slides=[DrawnSlide('block', (6, -3), 'A', on='lever')],
        links=[DrawnLink(name, [*of]) for name, of in links.items()],
    )  # fmt: skip
    return sheet.mechanism()


@pytest.mark.parametrize('at', [None, (7, 1), (2, 5), (14, -3), (0.5, 4.0), (6.5, 1.0)])
@pytest.mark.parametrize('kind', ['drawn', 'by lengths'])
def test_pins_of_a_lever_are_joined_to_its_slot(kind, at):
    mechanism = slotted(kind, at)
    drawing, lever = Picture(mechanism), mechanism.structure().links[1].name
    points = drawing.place(drawing.positions)
    line = drawing.links(points)[lever] @ (1, 1j)
    steps = abs(np.diff(line, axis=1))
    assert np.ptp(steps, axis=0) == pytest.approx(0.0, abs=1e-9)  # it is rigid
    assert [*drawing.links(points)] == [*drawing.joints]  # their colours are in this order
    own = [name for name in (*drawing.pins, *drawing.pivot_names)
           if name in {'Q', 'T', 'W', 'B0', 'ram_from'}]  # fmt: skip
    places = np.concatenate([points[0], drawing.pivots]) @ (1, 1j)
    for name, place in zip((*drawing.pins, *drawing.pivot_names), places, strict=True):
        assert (name in own) == bool((abs(line[0] - place) < 1e-9).any()), name


@pytest.mark.parametrize('name', ['shaper', 'excavator'])
def test_a_barrel_with_a_pin_beyond_its_rod_is_a_lever_with_a_slot(name):
    drawing = Picture(load(name).mechanism, load(name).drive.drawn_angle(load(name).mechanism))
    assert ('E' in drawing.pins) == (name == 'excavator')
    assert (drawing.ends['barrel'][1] == 'E') == (name == 'excavator')
