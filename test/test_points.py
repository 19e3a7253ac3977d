# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Traced points: of any link, of any mechanism, in states, records, tables and refusals."""

from dataclasses import replace

import numpy as np
import pytest
from mechanisms import ALL, moving, traced
from one_linkage import by_lengths, with_linkage
from ros_harness import report_of

from linkage_ros import (
    Barrel,
    Body,
    ConfigurationError,
    Coupler,
    Dyad,
    DyadSlider,
    Rod,
    Solver,
    TracedPoint,
    load,
    preset_names,
    read_log,
)
from linkage_ros.log import tables
from linkage_ros.log.reader import LogReader
from linkage_ros.mechanism.wrenches import FRAME
from linkage_ros.messages.topics import POINT_STAMPED
from linkage_ros.motion.steps import record_steps
from linkage_ros.programs.record import record
from linkage_ros.run.states import Simulator
from linkage_ros.settings.configuration import configure
from linkage_ros.view.picture import Picture

# Long enough for every mechanism of ALL: a link and a slider on the frame, two links, a link and a
# slider on a moving link, and a barrel and a rod.
REACHING = {'first': Body(9.0), 'from_at': (0.2, 0.1)}
ADDED = (
    Dyad(name='a', from_='crank', slider=DyadSlider(at=(0.3, -0.2), angle=0.4), **REACHING),
    Dyad(name='b', from_='a_first', to='a_slider', second=Body(9.5), **REACHING),
    Dyad(
        name='c',
        from_='b_second',
        first=Body(25.0),
        slider=DyadSlider(at=(0.3, -0.2), angle=0.4, on='crank'),
    ),
    Dyad(name='d', from_='c_slider', to='frame', barrel=Barrel(), rod=Rod(), offset=0.1),
)
MECHANISMS = {
    **{
        f'{name} with dyads': traced(replace(x, dyads=ADDED, points=())) for name, x in ALL.items()
    },
    **{name: load(name).mechanism for name in preset_names()},
}
AT = (0.0, 0.0), (0.35, -0.8), (-0.2, 0.45)
CRANK = 0.9  # rad


def on_every_link(mechanism):
    """Gives each link three points."""
    links = [link.name for link in mechanism.structure().links]
    points = [
        TracedPoint(f'{link}_{number}', link, at) for link in links for number, at in enumerate(AT)
    ]
    return replace(mechanism, points=points)


@pytest.mark.parametrize('preset', preset_names())
def test_record_holds_every_point_to_the_bit(preset, tmp_path):
    plain = by_lengths(load(preset))
    mechanism = on_every_link(plain.mechanism)
    configuration = with_linkage(plain, mechanism=mechanism)
    path, table = tmp_path / 'run.mcap', tmp_path / 'run.csv'
    record(configuration, path, duration=0.1)
    report = report_of(path)
    assert report.difference == ''
    topics = {f'/points/{name}' for name in mechanism.structure().traced}
    assert topics <= {*report.compared}
    log = LogReader(path)
    assert log.configuration.mechanism == mechanism
    assert {x.name: x.role for x in log.topics if x.type == POINT_STAMPED.name} == {
        topic: topic[1:] for topic in topics
    }
    simulator, found = Simulator(configuration.only), read_log(path)
    solver, motion = simulator.solver, simulator.begin(0, record_steps)
    stamps = np.round(found['/joint_states']['t'] * 1e9).astype(int).tolist()
    assert len(stamps) == round(0.1 * configuration.session.rate_hz)
    states = simulator.state(motion.at_all(stamps))
    for topic in topics:
        place = solver.point(states, topic.removeprefix('/points/')).position
        for axis, due in zip('xy', place, strict=True):
            assert found[topic][axis].tolist() == np.broadcast_to(due, len(stamps)).tolist()
    tables.write_csv(path, table)
    head, *rows = (line.split(',') for line in table.read_text().splitlines())
    for topic in topics:
        column = head.index(f'{topic.removeprefix("/points/")}.x [m]')
        assert [float(row[column]) for row in rows] == found[topic]['x'].tolist()


QUADRILATERAL = load('quadrilateral').mechanism
REFUSED = {
    'of a pin': ([TracedPoint('B0', 'coupler')], "point 'B0': a link, a pin or another point"),
    'of a link': ([TracedPoint('rocker', 'coupler')], "point 'rocker': a link"),
    'of another point': ([TracedPoint('x', 'coupler'), TracedPoint('x', 'crank')], "point 'x'"),
    'of the fixed link': ([TracedPoint('frame', 'coupler')], "point 'frame'"),
    'an unknown link': (
        [TracedPoint('x', 'couplr')],
        "points.x.link = 'couplr': must be one of crank, coupler, rocker",
    ),
    'several': (
        [TracedPoint('x', 'y'), TracedPoint('A', 'crank')],
        "2 mistakes:\n(1) point 'A': a link, a pin or another point has this name",
    ),
}  # fmt: skip


@pytest.mark.parametrize(('points', 'words'), REFUSED.values(), ids=REFUSED)
def test_points_that_do_not_fit_are_refused(points, words):
    with pytest.raises(ConfigurationError) as refused:
        replace(QUADRILATERAL, points=points)
    assert str(refused.value).startswith(words)
    several = len(refused.value.mistakes)
    assert len(str(refused.value).splitlines()) == 1 + several


@pytest.mark.parametrize('name', ['', '1st', 'a b', 'a-b', 'é', 'a/b', None])
def test_names_that_no_topic_can_have_are_refused(name):
    with pytest.raises(ConfigurationError, match='must be letters, digits and underscores'):
        TracedPoint(name, 'coupler')


def test_order_of_points_does_not_matter():
    points = [TracedPoint('b', 'crank'), TracedPoint('a', 'rocker', (0.1, 0.2))]
    one, other = (replace(QUADRILATERAL, points=x) for x in (points, points[::-1]))
    assert one == other
    assert [*one.structure().traced] == ['a', 'b']


def test_parameters_give_points():
    values = {'points.foot.link': 'rocker', 'points.foot.at': [0.1, -0.2]}
    found = configure({**load('quadrilateral').parameters(), **values})
    assert found.mechanism.points[1:] == (TracedPoint('foot', 'rocker', (0.1, -0.2)),)
    assert found.parameters().items() >= {**values, 'points.foot.at': (0.1, -0.2)}.items()


def test_old_argument_of_a_coupler_is_refused_with_the_new_one():
    with pytest.raises(ConfigurationError) as refused:
        Coupler(0.3, point=(0.1, 0.05))
    _, _, words = str(refused.value).partition('give it ')
    new = eval(words.removeprefix('points='), {'TracedPoint': TracedPoint})
    assert new == [TracedPoint('coupler_point', 'coupler', (0.1, 0.05))]


@pytest.mark.parametrize('mechanism', MECHANISMS.values(), ids=MECHANISMS)
def test_drawing_shows_every_point_and_its_path(mechanism):
    mechanism = on_every_link(mechanism)
    solver, drawing = Solver(mechanism), Picture(mechanism)
    state = moving(solver, CRANK)
    (places,) = drawing.place(np.array([state.position], dtype=float))
    lines = drawing.links(places[np.newaxis])
    for name, link in solver.structure.traced.items():
        due = np.array(solver.point(state, name).position, dtype=float)
        shown = name
        if name not in drawing.pins:  # it is a pin of the link
            assert name.endswith('_0')
            apart = np.abs(np.concatenate([places, drawing.pivots]) - due).max(axis=1)
            shown = (*drawing.pins, *drawing.pivot_names)[int(apart.argmin())]
            assert apart.min() < 1e-14
        else:
            assert np.abs(places[drawing.pins.index(name)] - due).max() < 1e-13
            # A line of its link leads to it.
            assert np.abs(lines[link][0] - due).max(axis=1).min() < 1e-13
        assert (shown in drawing.pivot_names) or (shown in drawing.owners)
        assert shown in drawing.paths or shown in drawing.pivot_names or not mechanism.reach()
    assert np.isfinite(drawing.labels(places[np.newaxis])).all()


@pytest.mark.parametrize('name', ALL)
def test_place_on_a_link_is_that_of_its_point(name):
    """The place is the inverse of the point, and a point of a link is not one of the frame."""
    structure = Solver(ALL[name]).structure
    for link in range(len(structure.links)):
        point = structure.point_of(link, (0.3, -0.7))
        assert structure.place_on(link, point) == pytest.approx(0.3 - 0.7j, rel=1e-14)
        is_constant = not any(point.weights)
        assert (structure.place_on(FRAME, point) is not None) == is_constant
